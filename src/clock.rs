use std::time::{Duration, Instant};

/// Time since a run began. It stands still on `wasm32-unknown-unknown`, which has no clock.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock {
    begun: Option<Instant>,
    before: Duration,
}

impl Clock {
    pub(crate) fn start() -> Self {
        Self::resumed(Duration::ZERO)
    }

    /// That of a run which has taken some time already.
    pub(crate) fn resumed(before: Duration) -> Self {
        let known = !cfg!(all(target_family = "wasm", target_os = "unknown"));
        Self {
            begun: known.then(Instant::now),
            before,
        }
    }

    pub(crate) fn elapsed(&self) -> Duration {
        let since = self.begun.map_or(Duration::ZERO, |begun| begun.elapsed());
        self.before.saturating_add(since)
    }
}
