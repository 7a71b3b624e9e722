use std::cell::Cell;
use std::error::Error as StdError;
use std::ffi::{CStr, CString, c_int};
use std::marker::PhantomData;
use std::process::ExitCode;
use std::ptr::{null, null_mut};
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use semismooth::contact::ReducedReport;
use thiserror::Error;

use crate::ffi::{self, Code, Int};

/// How long a process with an error waits for the others to vote.
const PATIENCE: Duration = Duration::from_secs(60);
/// Bytes of an error message that are sent to other processes.
const MESSAGE: usize = 1000;

static STARTED: AtomicBool = AtomicBool::new(false);
static RUNNING: AtomicBool = AtomicBool::new(false);

/// Errors of a job, the same on all processes.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum Error {
    /// An error on which all processes agree: that of the first process that has one.
    #[error("process {rank}: {message}")]
    Agreed {
        /// The process with the error.
        rank: usize,
        /// The message of its error, with its sources.
        message: String,
        /// The error of this process, if it has one.
        source: Option<Box<dyn StdError + Send + Sync>>,
    },
    /// A linear solver failed in a Newton step.
    #[error("{source}")]
    StepFailed {
        /// The error, agreed on by all processes.
        source: Box<Error>,
        /// The best earlier iterate on the part of this process, with its history.
        best: Box<ReducedReport>,
    },
    /// PETSc and MPI were started before in this process: they can be started only once.
    #[error("PETSc is started once in a process")]
    StartedBefore,
    /// An argument with a zero byte.
    #[error("an argument has a byte 0")]
    Argument(#[source] std::ffi::NulError),
    /// PETSc or MPI did not start.
    #[error("PETSc did not start")]
    Start(#[source] PetscError),
}

/// A call of PETSc or MPI that failed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{call}: PETSc error {code}, {text}")]
#[non_exhaustive]
pub struct PetscError {
    /// The function that failed.
    pub call: &'static str,
    /// PETSc's error code.
    pub code: i32,
    /// PETSc's text for the code.
    pub text: String,
}

pub(crate) fn check(call: &'static str, code: Code) -> Result<(), PetscError> {
    if code == 0 {
        return Ok(());
    }
    let mut text = null();
    // SAFETY: PETSc returns a static string or null.
    let text = unsafe {
        ffi::PetscErrorMessage(code, &mut text, null_mut());
        if text.is_null() {
            "unknown".into()
        } else {
            CStr::from_ptr(text).to_string_lossy().into_owned()
        }
    };
    Err(PetscError { call, code, text })
}

/// Calls a function of the interface. Handles are valid, since their owners are borrowed; pointers come from slices whose lengths the
/// caller has checked.
macro_rules! call {
    ($name:ident($($arg:expr),* $(,)?)) => {
        // SAFETY: as said above.
        $crate::world::check(stringify!($name), unsafe { $crate::ffi::$name($($arg),*) })
    };
}
pub(crate) use call;

/// The processes of a job: PETSc and MPI, from start to finish. Everything made with it borrows it.
///
/// Functions are *collective* unless stated otherwise: all processes must call them, in the same order. An error on one process becomes an
/// error on all of them by a [vote](Self::agree), so that none waits for a process that has left. If the other processes do not come to the
/// vote within the [patience](Self::set_patience), because they wait in another call, the process with the error ends the job with its
/// message; so does a process that panics.
#[derive(Debug)]
pub struct World {
    rank: usize,
    size: usize,
    patience: Cell<Duration>,
    /// Not `Send`: MPI is used only from the thread that started it.
    _thread: PhantomData<*const ()>,
}

/// Runs a program on all processes of a job: starts PETSc with options (such as `-pc_type hypre`), calls the closure, prints an error once,
/// and finalises PETSc and MPI.
///
/// ```no_run
/// use semismooth_petsc::run;
/// fn main() -> std::process::ExitCode {
///     run(std::env::args().skip(1), |world| {
///         let mine = world.agree("1.5".parse::<f64>())?; // an error on one process is one on all
///         let all = world.sum([mine])?;
///         if world.rank() == 0 {
///             println!("{} processes: {}", world.size(), all[0]);
///         }
///         Ok(())
///     })
/// }
/// ```
pub fn run(
    options: impl IntoIterator<Item = String>,
    work: impl FnOnce(&World) -> Result<(), Error>,
) -> ExitCode {
    let say = |e: &Error| eprintln!("error: {}", chain(e));
    let outcome = match World::start(options) {
        Ok(world) => work(&world).inspect_err(|e| {
            // Print before MPI is finalised: afterwards the first process to exit with an error makes mpiexec kill the others.
            if world.rank == 0 {
                say(e);
            }
        }),
        Err(e) => {
            say(&e);
            Err(e)
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::FAILURE,
    }
}

impl World {
    /// Starts PETSc and MPI, with options of PETSc. Installs a panic hook that calls the previous hook and then ends the job.
    ///
    /// # Errors
    /// Started before in this process; arguments with a zero byte; errors of PETSc.
    pub fn start(options: impl IntoIterator<Item = String>) -> Result<Self, Error> {
        static HOOK: Once = Once::new();
        let options = options.into_iter().collect::<Vec<_>>().join(" ");
        let options = CString::new(options).map_err(Error::Argument)?;
        if STARTED.swap(true, Ordering::SeqCst) {
            return Err(Error::StartedBefore);
        }
        call!(shim_start(options.as_ptr())).map_err(Error::Start)?;
        RUNNING.store(true, Ordering::SeqCst);
        HOOK.call_once(|| {
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |info| {
                before(info);
                if RUNNING.load(Ordering::SeqCst) {
                    // SAFETY: MPI is running.
                    unsafe { ffi::shim_abort(101) };
                }
            }));
        });
        let (mut rank, mut size) = (0, 0);
        // SAFETY: both pointers are valid for a write.
        unsafe { ffi::shim_world(&mut rank, &mut size) };
        Ok(Self {
            rank: rank as usize,
            size: size as usize,
            patience: Cell::new(PATIENCE),
            _thread: PhantomData,
        })
    }

    /// Number of this process, from 0. Not collective.
    #[must_use]
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Number of processes. Not collective.
    #[must_use]
    pub fn size(&self) -> usize {
        self.size
    }

    /// Sets how long a process with an error waits for the others to vote before it ends the job; default 60 s. Not collective.
    pub fn set_patience(&self, patience: Duration) {
        self.patience.set(patience);
    }

    /// The result of this process, if all processes succeeded; else the error of the first one that failed.
    ///
    /// # Errors
    /// The same on all processes, except for the source, which is the error of this process, if it has one.
    pub fn agree<T, E>(&self, own: Result<T, E>) -> Result<T, Error>
    where
        E: Into<Box<dyn StdError + Send + Sync>>,
    {
        self.settle(own.map_err(|e| Some(e.into())))
    }

    /// As [`agree`](Self::agree); `Err(None)` means that another process has the error.
    pub(crate) fn settle<T>(
        &self,
        own: Result<T, Option<Box<dyn StdError + Send + Sync>>>,
    ) -> Result<T, Error> {
        let own = match own {
            Err(Some(e)) => match e.downcast::<Error>() {
                // All processes have agreed on this error already.
                Ok(e) => return Err(*e),
                Err(e) => Err(Some(e)),
            },
            own => own,
        };
        let voted = if matches!(own, Err(Some(_))) {
            self.rank
        } else {
            self.size
        };
        let (mut first, mut late) = (0, 0);
        let patience = self.patience.get().as_secs_f64();
        let failed = call!(shim_vote(
            voted as c_int,
            self.size as c_int,
            patience,
            &mut first,
            &mut late
        ));
        let text = match &own {
            Err(Some(e)) => chain(&**e),
            _ => String::new(),
        };
        if late != 0 || failed.is_err() {
            let why = failed.map_or_else(|e| e.to_string(), |()| "the others do not answer".into());
            eprintln!("error: process {}: {text} ({why})", self.rank);
            self.abort();
        }
        if first as usize == self.size {
            return own.map_err(|_| self.told(self.rank, "an error that no process names", None));
        }
        let mut message = [0u8; MESSAGE];
        for (to, from) in message.iter_mut().zip(text.bytes()) {
            *to = from;
        }
        if let Err(e) = call!(shim_broadcast(
            message.as_mut_ptr().cast(),
            MESSAGE as c_int,
            first
        )) {
            eprintln!("error: process {}: {text} ({e})", self.rank);
            self.abort();
        }
        let length = message.iter().position(|b| *b == 0).unwrap_or(MESSAGE);
        let text = String::from_utf8_lossy(&message[..length]);
        Err(self.told(first as usize, &text, own.err().flatten()))
    }

    fn told(&self, rank: usize, message: &str, source: Option<Box<dyn StdError + Send + Sync>>) -> Error {
        Error::Agreed {
            rank,
            message: message.into(),
            source,
        }
    }

    /// Ends the job at once.
    fn abort(&self) -> ! {
        // SAFETY: MPI is running.
        unsafe { ffi::shim_abort(1) };
        std::process::exit(1)
    }

    /// Sums over all processes, entry by entry.
    ///
    /// # Errors
    /// Errors of MPI.
    pub fn sum<const N: usize>(&self, mut values: [f64; N]) -> Result<[f64; N], Error> {
        let done = self.add(&mut values);
        self.agree(done.map(|()| values))
    }

    /// Maxima over all processes, entry by entry.
    ///
    /// # Errors
    /// Errors of MPI.
    pub fn max<const N: usize>(&self, mut values: [f64; N]) -> Result<[f64; N], Error> {
        let done = self.largest(&mut values);
        self.agree(done.map(|()| values))
    }

    /// Floating-point operations that PETSc has counted on this process since the start. Not collective.
    #[must_use]
    pub fn operations(&self) -> f64 {
        let mut count = 0.0;
        match call!(PetscGetFlops(&mut count)) {
            Ok(()) => count,
            Err(_) => f64::NAN,
        }
    }

    /// Returns freed memory to the operating system, before something large is allocated. Not collective.
    pub(crate) fn trim(&self) {
        // SAFETY: it has no arguments.
        unsafe { ffi::shim_trim() };
    }

    pub(crate) fn add(&self, values: &mut [f64]) -> Result<(), PetscError> {
        call!(shim_sum(values.as_mut_ptr(), values.len() as c_int))
    }

    pub(crate) fn largest(&self, values: &mut [f64]) -> Result<(), PetscError> {
        call!(shim_max(values.as_mut_ptr(), values.len() as c_int))
    }

    /// From a count on each process: the sum over the processes before this one, and the sum over all.
    pub(crate) fn offset(&self, own: usize) -> Result<(usize, usize), PetscError> {
        let (mut before, mut all) = (0, 0);
        call!(shim_offset(own as i64, &mut before, &mut all))?;
        Ok((before as usize, all as usize))
    }

    /// Fetches the `width` numbers of each of the given rows, which are numbered consecutively over the processes; `own` has the numbers of
    /// the rows of this process.
    pub(crate) fn fetch(&self, width: usize, own: &[f64], rows: &[Int]) -> Result<Vec<f64>, PetscError> {
        let mut out = vec![0.0; width * rows.len()];
        call!(shim_fetch(
            width as Int,
            (own.len() / width) as Int,
            own.as_ptr(),
            rows.len() as Int,
            rows.as_ptr(),
            out.as_mut_ptr(),
        ))?;
        Ok(out)
    }
}

impl World {
    /// Sends numbers to another process, which must receive as many. Not collective.
    fn send(&self, list: &[u64], to: usize) -> Result<(), PetscError> {
        let bytes = size_of_val(list) as i64;
        call!(shim_send(list.as_ptr().cast(), bytes, to as c_int))
    }

    /// The lists of all processes on process 0, nothing elsewhere.
    pub(crate) fn collect(&self, own: &[u64]) -> Result<Vec<Vec<u64>>, PetscError> {
        if self.rank > 0 {
            self.send_list(own, 0)?;
            return Ok(Vec::new());
        }
        let others = (1..self.size).map(|rank| self.receive_list(rank));
        std::iter::once(Ok(own.to_vec())).chain(others).collect()
    }

    /// Sends each process its list from process 0.
    pub(crate) fn spread(&self, lists: &[Vec<u64>]) -> Result<Vec<u64>, PetscError> {
        if self.rank > 0 {
            return self.receive_list(0);
        }
        for (rank, list) in lists.iter().enumerate().skip(1) {
            self.send_list(list, rank)?;
        }
        Ok(lists.first().cloned().unwrap_or_default())
    }

    /// Sends a list to another process, its length first. Not collective.
    pub(crate) fn send_list(&self, list: &[u64], to: usize) -> Result<(), PetscError> {
        self.send(&[list.len() as u64], to)?;
        self.send(list, to)
    }

    /// Receives a list from another process. Not collective.
    pub(crate) fn receive_list(&self, from: usize) -> Result<Vec<u64>, PetscError> {
        let mut length = [0];
        self.receive(&mut length, from)?;
        let mut list = vec![0; length[0] as usize];
        self.receive(&mut list, from)?;
        Ok(list)
    }

    /// Receives numbers from another process. Not collective.
    fn receive(&self, list: &mut [u64], from: usize) -> Result<(), PetscError> {
        let bytes = size_of_val(list) as i64;
        call!(shim_receive(list.as_mut_ptr().cast(), bytes, from as c_int))
    }
}

impl Drop for World {
    fn drop(&mut self) {
        RUNNING.store(false, Ordering::SeqCst);
        // SAFETY: started once, finished once; all handles borrow the world and are gone.
        unsafe { ffi::shim_finish() };
    }
}

/// The message of an error and its sources.
fn chain(error: &(dyn StdError + 'static)) -> String {
    let mut text = error.to_string();
    let mut source = match error.downcast_ref::<Error>() {
        // The message contains the sources already.
        Some(Error::Agreed { .. } | Error::StepFailed { .. }) => None,
        _ => error.source(),
    };
    while let Some(e) = source {
        let next = e.to_string();
        if !text.ends_with(&next) {
            text += ": ";
            text += &next;
        }
        source = e.source();
    }
    text
}
