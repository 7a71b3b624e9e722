//! The algorithm of Haslinger, Janovský and Ligurský (2012): selections switch inside the corrector, steps
//! are halved in front of a kink, vanishing test functions give the selection beyond it. Steps are numbered
//! as in their talk on it; what that leaves open is listed at
//! `ContinuationOptions::haslinger_janovsky_ligursky`.

use crate::continuation::engine::Curve;
use crate::continuation::error::if_converged;
use crate::continuation::event::turn::kind;
use crate::continuation::{ContinuationError, Event, PointKind, StepRule, Termination, Transition};
use crate::newton::Correction;
use crate::piecewise::{
    ActiveSet, PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout, Vanishing, select_pieces,
};
use crate::sparse::{distance, dot, norm};

/// Number of smallest steps within which a test function counts as vanishing.
const REACH: f64 = 10.0;

/// Largest length of an accepted step ‖X − xʲ‖, relative to the step h along the tangent.
const FARTHEST: f64 = 3.0;

/// Rate of convergence of the corrections at which a step is neither too long nor too short
/// (`StepRule::Convergence`).
const IDEAL_RATE: f64 = 0.25;

impl Curve<'_> {
    /// Steps 2 to 7: predict, correct with the selection of the active set at each iterate, halve on failure; a new selection
    /// once the smallest step fails.
    pub(in crate::continuation) fn switching_step(&mut self) -> Result<(), ContinuationError> {
        let mut h = self.h.min(self.options.max_step);
        let mut halved = false;
        loop {
            if let Some(found) = self.try_switching(h)? {
                self.h = self.next_length(h, halved, found.rate);
                return self.arrive_switching(found.iterations);
            }
            if h <= self.options.min_step {
                return self.new_selection();
            }
            h = (h * self.options.shrink).max(self.options.min_step);
            halved = true;
            self.termination = self.is_over();
            if self.termination.is_some() {
                return Ok(());
            }
        }
    }

    /// Step 7: the length of the next step after one of length h, for which the corrections converged at the
    /// given rate.
    fn next_length(&self, h: f64, halved: bool, rate: f64) -> f64 {
        let options = &self.options;
        let most = if halved { 1.0 } else { options.growth };
        let factor = match options.step_rule {
            StepRule::Growth => most,
            StepRule::Convergence => (IDEAL_RATE / rate).sqrt().clamp(options.shrink, most),
        };
        (h * factor).max(options.min_step).min(options.max_step)
    }

    fn try_switching(&mut self, h: f64) -> Result<Option<Correction>, ContinuationError> {
        for i in 0..self.here.x.len() {
            self.next.x[i] = self.here.x[i] + h * self.here.t[i];
        }
        self.next.t.copy_from_slice(&self.here.t);
        let mut selection = self.selection.clone();
        let (map, layout) = (&self.map, &self.layout);
        let theta = &mut self.next.theta;
        let choose = |x: &[f64], selection: &mut Selection| {
            natural(map, layout, x, theta, selection);
        };
        let tolerances = (self.options.residual_tolerance, self.options.step_tolerance);
        let corrected = self.corrector.correct(
            &self.map,
            &mut selection,
            choose,
            &mut self.next.x,
            &mut self.next.t,
            tolerances,
            self.options.max_corrections,
        );
        let Some((correction, at)) = if_converged(corrected)? else {
            return Ok(None);
        };
        self.next.residual_norm = correction.residual_norm;
        self.next.orientation = at.orientation(&self.next.t);
        self.next.det_sign = at.det_sign();
        Ok(self.accepts(&selection, h).then_some(correction))
    }

    /// Whether `next`, finally corrected with `selection`, continues the curve from `here` without a kink in between: a point far from
    /// `here` is beyond a fold or on another branch, and a selection that is not active at `next` was left at a kink.
    fn accepts(&mut self, selection: &Selection, h: f64) -> bool {
        let (here, next) = (&self.here, &self.next);
        if dot(&here.t, &next.t) < self.options.min_cos || distance(&here.x, &next.x) > FARTHEST * h {
            return false;
        }
        if *selection == self.selection {
            return true;
        }
        self.map.residual(&self.selection, &next.x, &mut self.residual);
        norm(&self.residual) < self.options.residual_tolerance
    }

    fn arrive_switching(&mut self, corrections: usize) -> Result<(), ContinuationError> {
        self.arclength += distance(&self.here.x, &self.next.x);
        std::mem::swap(&mut self.here, &mut self.next);
        let alpha = self.here.x[self.here.x.len() - 1];
        let (lower, upper) = self.options.parameter_range;
        if alpha < lower || alpha > upper {
            self.termination = Some(Termination::ParameterRange);
        }
        let point = self.point_here(PointKind::Step, corrections);
        self.emit(Event::Point(point));
        Ok(())
    }

    /// Step 6: the test functions that vanish within a few smallest steps along τ give the candidate selections; the tangent
    /// preserves the orientation det [∇H; τᵀ]; a step of length zero corrects the point for the new selection.
    fn new_selection(&mut self) -> Result<(), ContinuationError> {
        let mut rates = vec![0.0; self.layout.total()];
        self.map
            .tests_of_selection(&self.selection, &self.here.x, Some(&self.here.t), &mut rates);
        let reach = REACH * self.options.min_step;
        let vanishing: Vec<Vanishing> = (0..rates.len())
            .filter(|&k| self.here.theta[k].abs() <= reach * rates[k].abs())
            .map(|k| Vanishing::new(&self.map, &self.layout, &self.selection, k, &self.here.x))
            .collect();
        let indices = vanishing.iter().map(|v| v.index).collect();
        let active = ActiveSet::from_tests(&self.map, &self.layout, &self.here.theta, indices);
        let before = self.selection.clone();
        let (arrival, oriented) = (self.here.t.clone(), self.here.orientation);
        for selection in active.selections().take(self.options.max_selections as usize) {
            if selection == before {
                continue;
            }
            let x = self.here.x.clone();
            let Ok(at) = (self.corrector).linearize(&self.map, &selection, &x, Some(&arrival)) else {
                continue;
            };
            let mut tangent = at.tangent().to_vec();
            let sign = match (at.orientation(&tangent), oriented) {
                (Some(s), Some(o)) => f64::from(s * o),
                _ => dot(&tangent, &arrival).signum(),
            };
            tangent.iter_mut().for_each(|t| *t *= sign);
            let enters = vanishing.iter().all(|v| {
                let v = v.of_selection(&self.map, &self.layout, &selection, &x);
                let cell = self.map.cell(v.site, selection.piece(v.site));
                cell.iter()
                    .filter(|f| f.test() == v.test)
                    .all(|f| f.sign() * dot(&v.gradient, &tangent) >= 0.0)
            });
            if !enters {
                continue;
            }
            self.emit_switch(&vanishing, &before, &selection, &tangent);
            self.selection.copy_from(&selection);
            self.here.t = tangent;
            self.recorrect()?;
            // The renewed correction is a step of length zero that was not halved.
            self.h = (self.options.step * self.options.growth).min(self.options.max_step);
            return Ok(());
        }
        self.termination = Some(Termination::End);
        Ok(())
    }

    fn recorrect(&mut self) -> Result<(), ContinuationError> {
        let mut frozen = self.selection.clone();
        let tolerances = (self.options.residual_tolerance, self.options.step_tolerance);
        let mut x = self.here.x.clone();
        let mut t = self.here.t.clone();
        let corrected = self.corrector.correct(
            &self.map,
            &mut frozen,
            |_, _| {},
            &mut x,
            &mut t,
            tolerances,
            self.options.max_corrections,
        );
        if let Some((c, at)) = if_converged(corrected)? {
            self.here.residual_norm = c.residual_norm;
            self.here.orientation = at.orientation(&t);
            self.here.det_sign = at.det_sign();
            self.here.x = x;
            self.here.t = t;
            self.map.test_functions(&self.here.x, &mut self.here.theta);
        }
        Ok(())
    }

    fn emit_switch(
        &mut self,
        vanishing: &[Vanishing],
        before: &Selection,
        after: &Selection,
        tangent: &[f64],
    ) {
        let mut r = vec![0.0; self.map.num_residuals()];
        self.map.residual(before, &self.here.x, &mut r);
        let sites = before
            .differing_sites(after)
            .map(|site| crate::continuation::SiteChange {
                site,
                from: before.piece(site),
                to: after.piece(site),
            })
            .collect();
        let arm = crate::continuation::Arm::along(after.clone(), tangent.to_vec(), Vec::new(), None);
        let mut arms = crate::continuation::point::Arms {
            list: vec![arm],
            complete: false,
            ..Default::default()
        };
        // The point, and so the tangent, is known to a few smallest steps only.
        let sign = |t: &[f64]| match t.last() {
            Some(rate) if rate.abs() > REACH * self.options.min_step => rate.signum() as i8,
            _ => 0,
        };
        arms.list[0].direction = sign(tangent);
        let kind = kind(sign(&self.here.t), arms.list.first(), &arms);
        let record = Transition {
            x: self.here.x.clone(),
            tangent_before: self.here.t.clone(),
            tangent_after: tangent.to_vec(),
            before: before.clone(),
            after: after.clone(),
            sites,
            test_functions: self.here.theta.clone(),
            vanishing: vanishing.iter().map(|v| v.index).collect(),
            kind,
            arms: arms.list,
            arrival: crate::continuation::Arm::along(
                before.clone(),
                self.here.t.iter().map(|t| -t).collect(),
                Vec::new(),
                self.here.det_sign,
            ),
            followed: Some(0),
            complete: false,
            det_sign: None,
            residual_norm: norm(&r),
            arclength: self.arclength,
        };
        self.emit(Event::Transition(record));
    }
}

fn natural<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    layout: &TestLayout,
    x: &[f64],
    theta: &mut [f64],
    selection: &mut Selection,
) {
    // The iterates of published runs depend on the scale that users prescribed.
    let prescribed = map.reported_tests(x, theta);
    if !prescribed {
        map.test_functions(x, theta);
    }
    select_pieces(map, layout, theta, true, 0.0, selection);
    if prescribed {
        map.test_functions(x, theta);
    }
}
