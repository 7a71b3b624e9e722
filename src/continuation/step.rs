//! One step of the located strategy: predict, correct with the selection frozen, accept or shorten, stop at the first event.

use super::engine::{Curve, term_size};
use super::locate::{Monitor, VERTICAL};
use super::{ContinuationError, PointKind, Termination};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth};
use crate::sparse::{distance, dot, norm};

/// Angle (as a distance of unit vectors) allowed between the chord of a step and the mean of the tangents at its ends.
const CHORD: f64 = 0.05;
/// Corrections up to which a step counts as easy.
const EASY: usize = 3;
/// Rejections, or steps in a row with rejections, after which a curve may be stuck at a singular point.
const REJECTED: usize = 3;

impl Curve<'_> {
    pub(super) fn step(&mut self) -> Result<(), ContinuationError> {
        let mut h = self.h.min(self.options.max_step);
        let room = self.options.max_arclength - self.arclength;
        if room > 0.0 {
            h = h.min(room.max(self.options.min_step));
        }
        let longest = h;
        let mut rejected = 0;
        loop {
            if h < self.options.min_step {
                if let Some(event) = self.event_at_branch_point(longest)? {
                    return self.arrive(Some(event), 0);
                }
                self.termination = Some(Termination::StepTooSmall);
                return Ok(());
            }
            if let Some(corrections) = self.try_step(h)? {
                let event = self.first_event()?;
                // An event that cannot be located inside the step asks for a shorter one.
                if let Ok(first) = event {
                    self.h = if rejected > 0 || corrections > EASY {
                        h
                    } else {
                        (h * self.options.growth).min(self.options.max_step)
                    };
                    self.creeping = if rejected > 0 { self.creeping + 1 } else { 0 };
                    return self.arrive(first, corrections);
                }
            }
            if (rejected >= REJECTED || self.creeping >= REJECTED)
                && let Some(event) = self.event_at_branch_point(longest)?
            {
                self.creeping = 0;
                return self.arrive(Some(event), 0);
            }
            h *= self.options.shrink;
            rejected += 1;
            if self.is_late() {
                self.termination = Some(Termination::MaxTime);
                return Ok(());
            }
        }
    }

    /// Predicts and corrects; fills `next` and returns the number of corrections if the corrected point is acceptable.
    fn try_step(&mut self, h: f64) -> Result<Option<usize>, ContinuationError> {
        for i in 0..self.here.x.len() {
            self.next.x[i] = self.here.x[i] + h * self.here.t[i];
        }
        self.next.t.copy_from_slice(&self.here.t);
        let o = &self.options;
        let tolerances = (
            o.residual_tolerance * (self.residual_scale + f64::MIN_POSITIVE),
            o.step_tolerance * (norm(&self.here.x) + h),
        );
        let corrected = self.corrector.correct(
            &self.map,
            &mut self.selection,
            |_, _| {},
            &mut self.next.x,
            &mut self.next.t,
            tolerances,
            o.max_corrections,
        );
        let correction = match corrected {
            Ok(c) => c,
            Err(PiecewiseError::Linear(_)) => return Ok(None),
            Err(e) => return Err(e.into()),
        };
        // The terms that cancel may have been smaller so far: none at all on leaving a branch point at the origin.
        let scale = term_size(self.corrector.jacobian(), &self.next.x, h, &self.next.t);
        let fine = correction.residual_norm <= self.options.residual_tolerance * scale
            && correction.step_norm <= tolerances.1;
        if !(correction.converged || fine) {
            return Ok(None);
        }
        self.next.orientation = self.corrector.orientation(&self.next.t);
        self.next.det_sign = self.corrector.det_sign();
        self.next.residual_norm = correction.residual_norm;
        if !self.acceptable(h) {
            return Ok(None);
        }
        self.residual_scale = self.residual_scale.max(scale);
        self.next.s = self.progress();
        self.map.test_functions(&self.next.x, &mut self.next.theta);
        Ok(Some(correction.iterations))
    }

    /// Distance of `next` from `here` along the tangent at `here`.
    fn progress(&self) -> f64 {
        let (a, b) = (&self.here, &self.next);
        a.t.iter()
            .zip(b.x.iter().zip(&a.x))
            .map(|(t, (x, x0))| t * (x - x0))
            .sum()
    }

    /// Whether `next` is where the prediction pointed: tangents agree, the chord is their mean, the length is that of the step.
    fn acceptable(&self, h: f64) -> bool {
        let (a, b) = (&self.here, &self.next);
        let cos = dot(&a.t, &b.t);
        if cos.is_nan() || cos < self.options.min_cos {
            return false;
        }
        let chord: Vec<f64> = b.x.iter().zip(&a.x).map(|(x, x0)| x - x0).collect();
        let length = norm(&chord);
        if !(length >= 0.5 * h && length <= 2.0 * h) {
            return false;
        }
        let mean_length = (2.0 + 2.0 * cos).sqrt();
        let deviation = chord
            .iter()
            .zip(a.t.iter().zip(&b.t))
            .map(|(c, (t0, t1))| (c / length - (t0 + t1) / mean_length).powi(2))
            .sum::<f64>()
            .sqrt();
        deviation <= CHORD
    }

    /// Moves to `next`, where the step ends regularly or at an event.
    pub(super) fn arrive(
        &mut self,
        event: Option<Monitor>,
        corrections: usize,
    ) -> Result<(), ContinuationError> {
        let closed = self.closes()?;
        self.arclength += distance(&self.here.x, &self.next.x);
        std::mem::swap(&mut self.here, &mut self.next);
        self.here.s = 0.0;
        self.refresh_sides();
        if closed {
            let point = self.point_here(PointKind::Step, corrections);
            self.emit(super::Event::Point(point));
            self.termination = Some(Termination::Closed);
            return Ok(());
        }
        if !matches!(event, Some(Monitor::Coactive(_))) {
            self.refresh_coactive()?;
        }
        match event {
            None => {
                let point = self.point_here(PointKind::Step, corrections);
                self.emit(super::Event::Point(point));
                Ok(())
            }
            Some(Monitor::Facet { index, .. }) => self.pass_transition(index),
            Some(Monitor::Parameter { value, last }) => {
                self.hit_parameter(value)?;
                let point = self.point_here(PointKind::Target, corrections);
                self.emit(super::Event::Point(point));
                if last {
                    self.termination = Some(Termination::ParameterRange);
                }
                Ok(())
            }
            Some(Monitor::Fold) => {
                let point = self.point_here(PointKind::Step, corrections);
                self.emit(super::Event::SmoothFold(super::SmoothFold { point }));
                Ok(())
            }
            Some(Monitor::Singular) => self.pass_branch_point(None),
            Some(Monitor::Coactive(k)) => self.pass_branch_point(Some(k)),
            Some(Monitor::User(k)) => {
                self.pass_monitor(k, corrections);
                Ok(())
            }
        }
    }

    /// Puts α exactly on a requested value.
    fn hit_parameter(&mut self, value: f64) -> Result<(), ContinuationError> {
        let m = self.here.x.len();
        let rate = self.here.t[m - 1];
        if self.map.is_piecewise_affine() && rate.abs() > VERTICAL {
            // The curve is straight: along it to the value.
            let rest = (value - self.here.x[m - 1]) / rate;
            for (x, t) in self.here.x.iter_mut().zip(&self.here.t) {
                *x += rest * t;
            }
            self.here.x[m - 1] = value;
            self.residual.resize(self.map.num_residuals(), 0.0);
            self.map
                .residual(&self.selection, &self.here.x, &mut self.residual);
            self.here.residual_norm = norm(&self.residual);
            self.map.test_functions(&self.here.x, &mut self.here.theta);
            return Ok(());
        }
        let mut normal = vec![0.0; m];
        normal[m - 1] = 1.0;
        let anchor = self.here.x.clone();
        let mut x = anchor.clone();
        let mut t = self.here.t.clone();
        let offset = value - anchor[m - 1];
        let corrected = self.corrector.correct_in_plane(
            &self.map,
            &self.selection,
            &anchor,
            &normal,
            offset,
            &mut x,
            &mut t,
        );
        if let Ok(c) = corrected
            && c.converged
        {
            x[m - 1] = value;
            self.here.x = x;
            self.here.residual_norm = c.residual_norm;
            self.map.test_functions(&self.here.x, &mut self.here.theta);
        }
        Ok(())
    }

    /// Whether the start lies on the stretch of curve between `here` and `next`.
    fn closes(&mut self) -> Result<bool, ContinuationError> {
        let length = distance(&self.here.x, &self.next.x);
        let reach = 1e-8 * (1.0 + norm(&self.start));
        if self.arclength <= reach || distance(&self.here.x, &self.start) > 1.5 * length {
            return Ok(false);
        }
        let offset: f64 = self
            .here
            .t
            .iter()
            .zip(self.start.iter().zip(&self.here.x))
            .map(|(t, (x, x0))| t * (x - x0))
            .sum();
        if offset <= -reach || offset > self.next.s + reach {
            return Ok(false);
        }
        let mut x = self.start.clone();
        let mut t = self.here.t.clone();
        let corrected = self.corrector.correct_in_plane(
            &self.map,
            &self.selection,
            &self.here.x,
            &self.here.t,
            offset,
            &mut x,
            &mut t,
        );
        match corrected {
            Ok(c) if c.converged && distance(&x, &self.start) <= reach => {
                self.next.x = x;
                self.next.t = t;
                Ok(true)
            }
            Ok(_) | Err(PiecewiseError::Linear(_)) => Ok(false),
            Err(e) => Err(e.into()),
        }
    }
}
