//! One step along a curve: predict and correct with the selection frozen (`correct`), judge the result (`judge`), watch for events
//! inside (`event::watch`), and arrive at the first of them, or at the regular end (`arrive`). Affine pieces need no corrector (`affine`).

mod affine;
mod arrive;
mod correct;
pub(super) mod judge;
mod switching;

use super::engine::Curve;
use super::event::watch::{Monitor, Unresolved};
use super::{ContinuationError, Event, Strategy, Termination};

/// Corrections up to which a step counts as easy.
const EASY: usize = 3;
/// Rejections, or steps in a row with rejections, after which a curve may be stuck at a singular point.
const REJECTED: usize = 3;

/// Share of a step by which a curve leaves a singular point.
const FIRST: f64 = 0.125;

/// An acceptable step.
struct Accepted {
    corrections: usize,
    curvature: f64,
}

impl Curve<'_> {
    pub(super) fn next_event(&mut self) -> Option<Result<Event, ContinuationError>> {
        loop {
            if let Some(event) = self.told.queue.pop_front() {
                return Some(Ok(event));
            }
            if self.told.termination.is_none() {
                self.limits();
            }
            if self.told.termination.is_some() {
                return None;
            }
            let stepped = match self.setup.options.strategy {
                Strategy::Located if self.map.is_piecewise_affine() => self.step_affine(),
                Strategy::Located => self.step(),
                Strategy::Switching => self.switching_step(),
            };
            if let Err(e) = stepped {
                self.told.termination = Some(Termination::Interrupted);
                return Some(Err(e));
            }
        }
    }

    /// The first event of a step, unless the step may have jumped to another curve.
    fn event_inside(&mut self) -> Result<Result<Option<Monitor>, Unresolved>, ContinuationError> {
        let first = self.first_event()?;
        let Ok(event) = first else { return Ok(first) };
        let unseen = self.passes_unseen(event) && (!self.refine_declines()? || self.passes_unseen(event));
        Ok(match unseen {
            true => Err(Unresolved::Crossing),
            false => first,
        })
    }

    fn step(&mut self) -> Result<(), ContinuationError> {
        // With the factors at hand.
        self.find_heading()?;
        let room = self.setup.options.max_arclength - self.pace.arclength;
        let mut limit = self.setup.options.max_step;
        if room > 0.0 {
            limit = limit.min(room.max(self.setup.options.min_step));
        }
        let mut h = self.pace.h.min(limit);
        let longest = h;
        let leaves_singular = self.here.decline.is_none();
        if leaves_singular {
            // No estimate ahead is available.
            h = (FIRST * h).max(self.setup.options.min_step);
        }
        // Next to a singular point rounding does not tell arms apart: the first step ends where it does.
        if !self.here.probe.is_empty() {
            let ahead = self.here.progress_to(&self.here.probe);
            if leaves_singular && ahead > 0.0 && ahead <= limit {
                h = ahead;
            } else {
                self.here.probe.clear();
            }
        }
        let (mut rejected, mut crossing) = (0, false);
        loop {
            if h < self.setup.options.min_step {
                if let Some(event) = self.event_at_singular_point(longest)? {
                    return self.arrive(Some(event), 0);
                }
                self.told.termination = Some(if crossing {
                    Termination::UnresolvedCrossing
                } else {
                    Termination::StepTooSmall
                });
                return Ok(());
            }
            if let Some(Accepted {
                corrections,
                curvature,
            }) = self.try_step(h)?
            {
                match self.event_inside()? {
                    Ok(first) => {
                        self.pace.h = if rejected > 0 || corrections > EASY {
                            h
                        } else if leaves_singular {
                            longest.max(h)
                        } else {
                            (h * self.setup.options.growth).min(self.setup.options.max_step)
                        };
                        self.pace.curvature = curvature;
                        self.pace.creeping = if rejected > 0 {
                            self.pace.creeping.saturating_add(1)
                        } else {
                            0
                        };
                        return self.arrive(first, corrections);
                    }
                    // An event that cannot be located inside the step requires a shorter one.
                    Err(unresolved) => crossing = unresolved == Unresolved::Crossing,
                }
            }
            if ((crossing && rejected == 0) || rejected >= REJECTED || self.pace.creeping >= REJECTED)
                && let Some(event) = self.event_at_singular_point(longest)?
            {
                self.pace.creeping = 0;
                return self.arrive(Some(event), 0);
            }
            self.here.probe.clear();
            h *= self.setup.options.shrink;
            rejected += 1;
            self.told.termination = self.setup.is_over();
            if self.told.termination.is_some() {
                return Ok(());
            }
        }
    }
}
