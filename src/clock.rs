use std::fmt;
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

    /// The clock of a run that has already taken the time `before`.
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

/// The end of a run, if its time is limited; the clock is not read otherwise.
#[derive(Clone, Copy)]
pub(crate) struct Deadline<'a> {
    limit: Option<(Clock, Duration)>,
    stop: Option<&'a dyn Fn() -> bool>,
}

impl<'a> Deadline<'a> {
    pub(crate) fn after(limit: Option<Duration>) -> Self {
        Self {
            limit: limit.map(|limit| (Clock::start(), limit)),
            stop: None,
        }
    }

    /// The deadline of a run that began with `clock`.
    pub(crate) fn of(clock: Clock, limit: Option<Duration>) -> Self {
        Self {
            limit: limit.map(|limit| (clock, limit)),
            stop: None,
        }
    }

    /// Passes as well once `stop` returns true.
    pub(crate) fn or(self, stop: &'a dyn Fn() -> bool) -> Self {
        Self {
            stop: Some(stop),
            ..self
        }
    }

    pub(crate) fn is_over(self) -> bool {
        self.limit.is_some_and(|(clock, limit)| clock.elapsed() >= limit)
            || self.stop.is_some_and(|stop| stop())
    }

    pub(crate) fn flow(self) -> ControlFlow<()> {
        match self.is_over() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    }

    /// A deadline after half of the remaining time.
    pub(crate) fn half(self) -> Self {
        let limit = self.left().map(|left| left / 2);
        Self {
            stop: self.stop,
            ..Self::after(limit)
        }
    }

    /// The remaining time; `None` without a limit.
    pub(crate) fn left(self) -> Option<Duration> {
        self.limit
            .map(|(clock, limit)| limit.saturating_sub(clock.elapsed()))
    }
}

/// The end of a run, shared by its threads.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Until(Option<(Clock, Duration)>);

impl Until {
    /// `limit` from now on; never without a limit.
    pub(crate) fn after(limit: Option<Duration>) -> Self {
        Self(limit.map(|limit| (Clock::start(), limit)))
    }

    #[inline]
    pub(crate) fn is_over(self) -> bool {
        self.0.is_some_and(|(clock, limit)| clock.elapsed() >= limit)
    }
}

impl fmt::Debug for Deadline<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Deadline")
            .field("limit", &self.limit)
            .finish_non_exhaustive()
    }
}
