use std::fmt;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Buffers of a function that is evaluated through `&self`, perhaps from several threads. What is in them between two evaluations
/// does not matter, so that one which panicked leaves nothing behind.
pub(crate) struct Scratch<T>(Mutex<T>);

impl<T> Scratch<T> {
    pub(crate) fn new(buffers: T) -> Self {
        Self(Mutex::new(buffers))
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, T> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T: Clone> Clone for Scratch<T> {
    fn clone(&self) -> Self {
        Self::new(self.lock().clone())
    }
}

impl<T> fmt::Debug for Scratch<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Scratch")
    }
}
