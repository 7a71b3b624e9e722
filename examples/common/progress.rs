//! Progress of long runs, and an orderly end on Ctrl-C.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use indicatif::{ProgressBar, ProgressStyle};

use super::common::{INTERRUPTED, Outcome};

/// A bar on standard error (none where that is no terminal), and whether Ctrl-C was pressed.
pub(crate) struct Progress {
    bar: ProgressBar,
    cancelled: Arc<AtomicBool>,
}

impl Progress {
    /// A bar of `length` units.
    pub(crate) fn new(length: u64) -> Outcome<Self> {
        let template = "{elapsed_precise} [{bar:20}] {percent:>3} %  {wide_msg}";
        let bar = ProgressBar::new(length).with_style(ProgressStyle::with_template(template)?);
        let cancelled = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&cancelled);
        ctrlc::set_handler(move || {
            // A second Ctrl-C ends the program at once.
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(i32::from(INTERRUPTED));
            }
        })?;
        Ok(Self { bar, cancelled })
    }

    /// Shows a position; asks to stop once Ctrl-C was pressed.
    pub(crate) fn at(&self, position: u64, message: impl Into<String>) -> ControlFlow<()> {
        self.bar.set_position(position);
        self.bar.set_message(message.into());
        if self.cancelled() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Whether Ctrl-C was pressed.
    pub(crate) fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
