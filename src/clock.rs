use std::ops::ControlFlow;
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

/// When a run has to end, if it has to: where time is not limited the clock is not read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Deadline(Option<(Clock, Duration)>);

impl Deadline {
    pub(crate) fn after(limit: Option<Duration>) -> Self {
        Self(limit.map(|limit| (Clock::start(), limit)))
    }

    /// That of a run whose clock began earlier.
    pub(crate) fn of(clock: Clock, limit: Option<Duration>) -> Self {
        Self(limit.map(|limit| (clock, limit)))
    }

    pub(crate) fn is_over(self) -> bool {
        self.0.is_some_and(|(clock, limit)| clock.elapsed() >= limit)
    }

    pub(crate) fn flow(self) -> ControlFlow<()> {
        match self.is_over() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    /// When half of what is left has passed.
    pub(crate) fn half(self) -> Self {
        Self::after(self.left().map(|left| left / 2))
    }

    /// What is left of the limit.
    pub(crate) fn left(self) -> Option<Duration> {
        self.0.map(|(clock, limit)| limit.saturating_sub(clock.elapsed()))
    }
}
