//! One step of the located strategy: predict, correct with the selection frozen, accept or shorten, stop at the first event.

mod affine;
mod switching;

use crate::continuation::engine::{Curve, relative_residual, row_sizes};
use crate::continuation::event::locate::{Monitor, Unresolved, VERTICAL};
use crate::continuation::{ContinuationError, PointKind, Termination};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth};
use crate::sparse::{distance, dot, norm};

/// Angle (as a distance of unit vectors) allowed between the chord of a step and the mean of the tangents at its ends.
const CHORD: f64 = 0.05;
/// Corrections up to which a step counts as easy.
const EASY: usize = 3;
/// Share of the curvature of the last step that is remembered through inflections.
const FADING: f64 = 0.5;
/// Rejections, or steps in a row with rejections, after which a curve may be stuck at a singular point.
const REJECTED: usize = 3;

/// An acceptable step.
struct Accepted {
    corrections: usize,
    curvature: f64,
}

/// How a step bends.
struct Shape {
    /// Distance of the unit tangents at its ends.
    turn: f64,
    /// Distance of its direction from their mean.
    deviation: f64,
}

impl Curve<'_> {
    pub(in crate::continuation) fn step(&mut self) -> Result<(), ContinuationError> {
        let mut h = self.h.min(self.options.max_step);
        let room = self.options.max_arclength - self.arclength;
        if room > 0.0 {
            h = h.min(room.max(self.options.min_step));
        }
        let longest = h;
        let (mut rejected, mut crossing) = (0, false);
        loop {
            if h < self.options.min_step {
                if let Some(event) = self.event_at_branch_point(longest)? {
                    return self.arrive(Some(event), 0);
                }
                self.termination = Some(if crossing {
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
                match self.first_event()? {
                    Ok(first) => {
                        self.h = if rejected > 0 || corrections > EASY {
                            h
                        } else {
                            (h * self.options.growth).min(self.options.max_step)
                        };
                        self.curvature = curvature;
                        self.creeping = if rejected > 0 {
                            self.creeping.saturating_add(1)
                        } else {
                            0
                        };
                        return self.arrive(first, corrections);
                    }
                    // An event that cannot be located inside the step asks for a shorter one.
                    Err(unresolved) => crossing = unresolved == Unresolved::Crossing,
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

    /// Predicts and corrects; fills `next` if the corrected point is acceptable.
    fn try_step(&mut self, h: f64) -> Result<Option<Accepted>, ContinuationError> {
        for i in 0..self.here.x.len() {
            self.next.x[i] = self.here.x[i] + h * self.here.t[i];
        }
        self.next.t.copy_from_slice(&self.here.t);
        let o = &self.options;
        let tolerances = (o.residual_tolerance, o.step_tolerance * (norm(&self.here.x) + h));
        let sizes = std::mem::take(&mut self.row_sizes);
        let corrected = self.corrector.correct_measured(
            &self.map,
            &mut self.selection,
            &|r| relative_residual(r, &sizes),
            &mut self.next.x,
            &mut self.next.t,
            tolerances,
            o.max_corrections,
        );
        self.row_sizes = sizes;
        let correction = match corrected {
            Ok(c) => c,
            Err(PiecewiseError::Linear(_)) => return Ok(None),
            Err(e) => return Err(e.into()),
        };
        // The terms that cancel may have been smaller so far: none at all on leaving a branch point at the origin.
        let mut sizes = std::mem::take(&mut self.next_sizes);
        sizes.clear();
        let Self { next, options, .. } = self;
        let jac = self.corrector.jacobian();
        row_sizes(jac, &next.x, (h, &next.t), options.residual_tolerance, &mut sizes);
        let fine = relative_residual(self.corrector.residual(), &sizes) <= self.options.residual_tolerance
            && correction.step_norm <= tolerances.1;
        self.next_sizes = sizes;
        if !(correction.converged || fine) {
            return Ok(None);
        }
        self.next.orientation = self.corrector.orientation(&self.next.t);
        self.next.det_sign = self.corrector.det_sign();
        self.next.residual_norm = correction.residual_norm;
        self.next.s = self.progress_to(&self.next.x);
        let Some(mut shape) = self.shape(h) else {
            return Ok(None);
        };
        let flips = self.next.orientation != self.here.orientation;
        if !flips && self.is_doubtful(&shape, h, correction.iterations) && !self.holds_halfway(&shape)? {
            // Perhaps for tangents that are those of the iterates before.
            shape.turn = self.sharpen_tangents()?;
            let doubtful = self.is_doubtful(&shape, h, correction.iterations);
            if doubtful && !self.holds_halfway(&shape)? {
                return Ok(None);
            }
        }
        for (size, next) in self.row_sizes.iter_mut().zip(&self.next_sizes) {
            *size = size.max(*next);
        }
        self.map.test_functions(&self.next.x, &mut self.next.theta);
        Ok(Some(Accepted {
            corrections: correction.iterations,
            curvature: (shape.turn / h).max(FADING * self.curvature),
        }))
    }

    /// The shape of a step whose `next` is where the prediction pointed: tangents agree, the chord is their mean, the length is that of
    /// the step. `None` for others.
    fn shape(&self, h: f64) -> Option<Shape> {
        let (a, b) = (&self.here, &self.next);
        let cos = dot(&a.t, &b.t);
        if cos.is_nan() || cos < self.options.min_cos {
            return None;
        }
        let chord: Vec<f64> = b.x.iter().zip(&a.x).map(|(x, x0)| x - x0).collect();
        let length = norm(&chord);
        if !(length >= 0.5 * h && length <= 2.0 * h) {
            return None;
        }
        let mean_length = (2.0 + 2.0 * cos).sqrt();
        let deviation = chord
            .iter()
            .zip(a.t.iter().zip(&b.t))
            .map(|(c, (t0, t1))| (c / length - (t0 + t1) / mean_length).powi(2))
            .sum::<f64>()
            .sqrt();
        (deviation <= CHORD).then(|| Shape {
            turn: distance(&a.t, &b.t),
            deviation,
        })
    }

    /// Angle below which tangents cannot be told apart.
    fn tangent_noise(&self) -> f64 {
        let rcond = self.corrector.rcond().unwrap_or(1.0);
        1e-9 + 100.0 * f64::EPSILON / rcond.max(f64::EPSILON)
    }

    /// Whether the step may have gone over to another curve: it turns much more than the last one, its chord is not that of an arc, or the
    /// corrector converged slowly.
    fn is_doubtful(&self, shape: &Shape, h: f64, corrections: usize) -> bool {
        const MORE: f64 = 2.0;
        const SKEW: f64 = 0.1;
        const SLOW: usize = 5;
        let noise = self.tangent_noise();
        shape.turn > (MORE * self.curvature * h).max(noise)
            || shape.deviation > (SKEW * shape.turn.max(self.curvature * h)).max(noise)
            || corrections > SLOW
    }

    /// Makes the tangents at both ends, which are those of the iterates before, anew and gives their distance.
    fn sharpen_tangents(&mut self) -> Result<f64, ContinuationError> {
        for state in [&mut self.here, &mut self.next] {
            match (self.corrector).linearize(&self.map, &self.selection, &state.x, Some(&state.t)) {
                Ok(tangent) => {
                    let sign = dot(tangent, &state.t).signum();
                    state.t.iter_mut().zip(tangent).for_each(|(t, v)| *t = sign * v);
                }
                // Next to a singular point the tangent at hand serves.
                Err(PiecewiseError::Linear(_)) => {}
                Err(e) => return Err(e.into()),
            }
        }
        Ok(distance(&self.here.t, &self.next.t))
    }

    /// Whether the curve between `here` and `next` is the smooth one that its ends suggest, by one correction halfway. It is not where the
    /// step has gone over to another curve, across a crossing or beside it.
    fn holds_halfway(&mut self, shape: &Shape) -> Result<bool, ContinuationError> {
        const STRAY: f64 = 0.02;
        const TILT: f64 = 0.2;
        let high = self.next.clone();
        let mut middle = high.clone();
        self.interpolate(0.5 * high.s, &high, &mut middle);
        let length = norm(&middle.t);
        middle.t.iter_mut().for_each(|t| *t /= length);
        let mean = middle.t.clone();
        let free = (f64::INFINITY, f64::INFINITY);
        let corrected = self.corrector.correct(
            &self.map,
            &mut self.selection,
            |_, _| {},
            &mut middle.x,
            &mut middle.t,
            free,
            1,
        );
        let stray = match corrected {
            Ok(c) => c.step_norm,
            Err(PiecewiseError::Linear(_)) => return Ok(false),
            Err(e) => return Err(e.into()),
        };
        let turns = match (self.corrector.orientation(&middle.t), self.here.orientation) {
            (Some(middle), Some(here)) => middle != here,
            _ => false,
        };
        let near = stray <= STRAY * shape.turn * high.s + 1e-12 * (1.0 + norm(&high.x));
        let tilt = distance(&middle.t, &mean);
        Ok(!turns && near && tilt <= TILT * shape.turn + self.tangent_noise())
    }

    /// Moves to `next`, where the step ends regularly or at an event.
    pub(in crate::continuation) fn arrive(
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
            self.emit(crate::continuation::Event::Point(point));
            self.termination = Some(Termination::Closed);
            return Ok(());
        }
        if !matches!(event, Some(Monitor::Coactive(_))) {
            self.refresh_coactive()?;
        }
        match event {
            None => {
                let point = self.point_here(PointKind::Step, corrections);
                self.emit(crate::continuation::Event::Point(point));
                Ok(())
            }
            Some(Monitor::Facet { index, .. }) => self.pass_transition(index),
            Some(Monitor::Parameter { value, last }) => {
                self.hit_parameter(value)?;
                let point = self.point_here(PointKind::Target, corrections);
                self.emit(crate::continuation::Event::Point(point));
                if last {
                    self.termination = Some(Termination::ParameterRange);
                }
                Ok(())
            }
            Some(Monitor::Fold) => {
                let point = self.point_here(PointKind::Step, corrections);
                self.emit(crate::continuation::Event::SmoothFold(
                    crate::continuation::SmoothFold { point },
                ));
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

    /// Whether the stretch of curve from `here` to `next` leads through the start, where `next` is put then. It does if the point of this
    /// very stretch abreast of the start is the start: another stretch that passes nearby leads elsewhere, though the start solves
    /// H^(σ)(x) = 0 for its selection, too.
    fn closes(&mut self) -> Result<bool, ContinuationError> {
        let length = distance(&self.here.x, &self.next.x);
        let reach = 1e-8 * (1.0 + norm(&self.start));
        if self.arclength <= reach || distance(&self.here.x, &self.start) > 1.5 * length {
            return Ok(false);
        }
        let high = self.next.clone();
        let mut abreast = high.clone();
        if distance(&high.x, &self.start) > reach {
            let offset = self.progress_to(&self.start);
            let inside = offset > -reach && offset <= high.s + reach;
            if !inside
                || !self.state_at(offset, &high, &mut abreast)?
                || distance(&abreast.x, &self.start) > reach
            {
                return Ok(false);
            }
            self.complete_state(&mut abreast)?;
        }
        // Where the curve runs back beside itself, closer than that, it runs the other way.
        let (selection, start) = (self.selection.clone(), self.start.clone());
        let at_start = self.orientation_of(&selection, &start, &abreast.t)?;
        if let (Some(here), Some(there)) = (abreast.orientation, at_start)
            && here != there
        {
            return Ok(false);
        }
        self.next = abreast;
        Ok(true)
    }
}
