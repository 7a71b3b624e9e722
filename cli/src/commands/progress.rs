//! Progress of long runs, and an orderly end on Ctrl-C, SIGTERM and SIGHUP.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::error::CommandError;

/// Fits 80 columns, without colours.
const TEMPLATE: &str = "{elapsed_precise} [{bar:30}] {percent:>3} %  {msg:20!}";

/// A progress bar on standard error (if that is a terminal), and whether Ctrl-C was pressed, or the process was told to terminate.
pub(super) struct Progress {
    bar: ProgressBar,
    cancelled: Arc<AtomicBool>,
}

impl Progress {
    pub(super) fn new(length: u64, hidden: bool) -> Result<Self, CommandError> {
        let failed = |e: indicatif::style::TemplateError| CommandError::failed("the progress bar", e);
        let bar =
            ProgressBar::new(length).with_style(ProgressStyle::with_template(TEMPLATE).map_err(failed)?);
        if hidden {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        let cancelled = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&cancelled);
        let handler = ctrlc::set_handler(move || {
            // A second Ctrl-C exits at once.
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        });
        handler.map_err(|e| CommandError::failed("the handler of Ctrl-C", e))?;
        Ok(Self { bar, cancelled })
    }

    /// Shows a position; returns a request to stop after Ctrl-C.
    pub(super) fn at(&self, position: u64, message: impl Into<String>) -> ControlFlow<()> {
        self.bar.set_position(position);
        self.bar.set_message(message.into());
        self.flow()
    }

    /// Returns a request to stop after Ctrl-C.
    pub(super) fn flow(&self) -> ControlFlow<()> {
        match self.cancelled() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    /// Shows what is being done at the position; returns a request to stop after Ctrl-C.
    pub(super) fn message(&self, message: String) -> ControlFlow<()> {
        self.bar.set_message(message);
        self.flow()
    }

    /// Sets the last position.
    pub(super) fn of(&self, length: u64) {
        self.bar.set_length(length);
    }

    /// Moves to the next position.
    pub(super) fn advance(&self, message: impl Into<String>) -> ControlFlow<()> {
        self.at(self.bar.position() + 1, message)
    }

    /// Prints with the bar hidden meanwhile.
    pub(super) fn suspend<T>(&self, print: impl FnOnce() -> T) -> T {
        self.bar.suspend(print)
    }

    pub(super) fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
