//! Runs of the library without the interpreter's lock, ended by exceptions in callbacks, by Ctrl-C or by errors.

use std::error::Error;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

create_exception!(
    semismooth,
    SemismoothError,
    PyValueError,
    "A problem, an option or a start that semismooth cannot use; the message says which and why."
);

/// Time between two checks for signals: a check takes the lock, and Ctrl-C is to be noticed within 0.1 s.
const LOOK_EVERY: Duration = Duration::from_millis(30);
const BETWEEN_LOOKS: Duration = Duration::from_millis(5);

/// An error of the library as an exception, with the messages of its causes.
pub(crate) fn raised(error: impl Error) -> PyErr {
    let mut message = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let text = inner.to_string();
        if !message.contains(&text) {
            message = format!("{message}: {text}");
        }
        cause = inner.source();
    }
    SemismoothError::new_err(message)
}

/// A run that Python can end. The functions of a map return numbers and no errors: after the first exception they return NaN without a call
/// (as those of `semismooth::fallible` do), observers stop, and the exception is raised when the library has returned.
pub(crate) struct Run {
    broken: AtomicBool,
    exception: Mutex<Option<PyErr>>,
    looked: Mutex<Instant>,
}

impl Run {
    /// Runs `work` without the interpreter's lock.
    pub(crate) fn detached<T: Send>(
        py: Python<'_>,
        work: impl FnOnce(&Run) -> PyResult<T> + Send,
    ) -> PyResult<T> {
        let run = Run {
            broken: AtomicBool::new(false),
            exception: Mutex::new(None),
            looked: Mutex::new(Instant::now()),
        };
        let result = py.detach(|| work(&run));
        match lock(&run.exception).take() {
            Some(exception) => Err(exception),
            None => result,
        }
    }

    /// As [`detached`](Self::detached), for work whose observers are called from other threads, which receive no signals: this thread
    /// checks for them while another one does the work, whose observers return [`flow`](Self::flow).
    pub(crate) fn watched<T: Send>(
        py: Python<'_>,
        work: impl FnOnce(&Run) -> PyResult<T> + Send,
    ) -> PyResult<T> {
        Self::detached(py, |run| {
            std::thread::scope(|scope| {
                let worker = scope.spawn(|| work(run));
                while !worker.is_finished() {
                    std::thread::sleep(BETWEEN_LOOKS);
                    let _ = run.poll();
                }
                worker
                    .join()
                    .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
            })
        })
    }

    /// Whether to go on: not after an exception, nor after Ctrl-C.
    pub(crate) fn poll(&self) -> ControlFlow<()> {
        let due = {
            let mut looked = lock(&self.looked);
            let due = looked.elapsed() >= LOOK_EVERY;
            if due {
                *looked = Instant::now();
            }
            due
        };
        if due && !self.is_broken() {
            Python::attach(|py| py.check_signals().map_err(|e| self.keep(e)).ok());
        }
        self.flow()
    }

    /// Whether to go on, without a check for signals.
    pub(crate) fn flow(&self) -> ControlFlow<()> {
        match self.is_broken() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    pub(crate) fn is_broken(&self) -> bool {
        self.broken.load(Ordering::Relaxed)
    }

    /// Calls Python; `None` after the first exception.
    pub(crate) fn call<R>(&self, work: impl FnOnce(Python<'_>) -> PyResult<R>) -> Option<R> {
        if self.is_broken() {
            return None;
        }
        Python::attach(|py| work(py).map_err(|e| self.keep(e)).ok())
    }

    fn keep(&self, exception: PyErr) {
        lock(&self.exception).get_or_insert(exception);
        self.broken.store(true, Ordering::Relaxed);
    }
}

pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
