//! The algorithm of Haslinger, Janovský and Ligurský (2012): selections switch inside the corrector, steps
//! are halved in front of a kink, vanishing test functions give the selection beyond it. Steps are numbered
//! as in their talk on it; what that leaves open is listed at
//! `ContinuationOptions::haslinger_janovsky_ligursky`.

use crate::continuation::engine::Curve;
use crate::continuation::error::if_converged;
use crate::continuation::event::turn::kind;
use crate::continuation::point::Arms;
use crate::continuation::{
    Arm, ContinuationError, Event, PointKind, SiteChange, StepRule, Termination, Transition,
};
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
        let mut h = self.pace.h.min(self.setup.options.max_step);
        let mut halved = false;
        loop {
            if let Some(found) = self.try_switching(h)? {
                self.pace.h = self.next_length(h, halved, found.rate);
                return self.arrive_switching(found.iterations);
            }
            if h <= self.setup.options.min_step {
                return self.new_selection();
            }
            h = (h * self.setup.options.shrink).max(self.setup.options.min_step);
            halved = true;
            self.told.termination = self.setup.is_over();
            if self.told.termination.is_some() {
                return Ok(());
            }
        }
    }

    /// Step 7: the length of the next step after one of length h, for which the corrections converged at the
    /// given rate.
    fn next_length(&self, h: f64, halved: bool, rate: f64) -> f64 {
        let options = &self.setup.options;
        let most = if halved { 1.0 } else { options.growth };
        let factor = match options.step_rule {
            StepRule::Growth => most,
            StepRule::Convergence => (IDEAL_RATE / rate).sqrt().clamp(options.shrink, most),
        };
        (h * factor).max(options.min_step).min(options.max_step)
    }

    fn try_switching(&mut self, h: f64) -> Result<Option<Correction>, ContinuationError> {
        self.next.predict(&self.here, h);
        let mut selection = self.path.selection.clone();
        let (map, layout) = (&self.map, &self.setup.layout);
        let theta = &mut self.next.theta;
        let choose = |x: &[f64], selection: &mut Selection| {
            natural(map, layout, x, theta, selection);
        };
        let o = &self.setup.options;
        let tolerances = (o.residual_tolerance, o.step_tolerance);
        let (x, t, most) = (&mut self.next.x, &mut self.next.t, o.max_corrections);
        let corrected = (self.corrector).correct(map, &mut selection, choose, x, t, tolerances, most);
        let Some((correction, at)) = if_converged(corrected)? else {
            return Ok(None);
        };
        self.next.residual_norm = correction.residual_norm;
        self.next.take_signs(Some(&at));
        Ok(self.accepts(&selection, h).then_some(correction))
    }

    /// Whether `next`, finally corrected with `selection`, continues the curve from `here` without a kink in between: a point far from
    /// `here` is beyond a fold or on another branch, and a selection that is not active at `next` was left at a kink.
    fn accepts(&mut self, selection: &Selection, h: f64) -> bool {
        let (here, next) = (&self.here, &self.next);
        if dot(&here.t, &next.t) < self.setup.options.min_cos || distance(&here.x, &next.x) > FARTHEST * h {
            return false;
        }
        if *selection == self.path.selection {
            return true;
        }
        self.map
            .residual(&self.path.selection, &next.x, &mut self.buffers.residual);
        norm(&self.buffers.residual) < self.setup.options.residual_tolerance
    }

    fn arrive_switching(&mut self, corrections: usize) -> Result<(), ContinuationError> {
        self.pace.arclength += distance(&self.here.x, &self.next.x);
        std::mem::swap(&mut self.here, &mut self.next);
        let alpha = self.here.x[self.here.x.len() - 1];
        let (lower, upper) = self.setup.options.parameter_range;
        if alpha < lower || alpha > upper {
            self.told.termination = Some(Termination::ParameterRange);
        }
        let point = self.point_here(PointKind::Step, corrections);
        self.emit(Event::Point(point));
        Ok(())
    }

    /// Step 6: the test functions that vanish within a few smallest steps along τ give the candidate selections; the tangent
    /// preserves the orientation det [∇H; τᵀ]; a step of length zero corrects the point for the new selection.
    fn new_selection(&mut self) -> Result<(), ContinuationError> {
        let rates = self.rates_at(&self.here);
        let reach = REACH * self.setup.options.min_step;
        let vanishing: Vec<Vanishing> = (0..rates.len())
            .filter(|&k| self.here.theta[k].abs() <= reach * rates[k].abs())
            .map(|k| self.test_here(k))
            .collect();
        let indices = vanishing.iter().map(|v| v.index).collect();
        let active = ActiveSet::from_tests(&self.map, &self.setup.layout, &self.here.theta, indices);
        let before = self.path.selection.clone();
        let (arrival, oriented) = (self.here.t.clone(), self.here.orientation);
        let most = self.setup.options.max_selections as usize;
        for selection in active.selections().take(most) {
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
                let v = v.of_selection(&self.map, &self.setup.layout, &selection, &x);
                let cell = self.map.cell(v.site, selection.piece(v.site));
                cell.iter()
                    .filter(|f| f.test() == v.test)
                    .all(|f| f.sign() * dot(&v.gradient, &tangent) >= 0.0)
            });
            if !enters {
                continue;
            }
            self.emit_switch(&vanishing, &before, &selection, &tangent);
            self.path.selection.copy_from(&selection);
            self.here.t = tangent;
            self.recorrect()?;
            // The renewed correction is a step of length zero that was not halved.
            self.pace.h =
                (self.setup.options.step * self.setup.options.growth).min(self.setup.options.max_step);
            return Ok(());
        }
        self.told.termination = Some(Termination::End);
        Ok(())
    }

    fn recorrect(&mut self) -> Result<(), ContinuationError> {
        let mut frozen = self.path.selection.clone();
        let o = &self.setup.options;
        let tolerances = (o.residual_tolerance, o.step_tolerance);
        let mut x = self.here.x.clone();
        let mut t = self.here.t.clone();
        let (map, most) = (&self.map, o.max_corrections);
        let corrected =
            (self.corrector).correct(map, &mut frozen, |_, _| {}, &mut x, &mut t, tolerances, most);
        if let Some((c, at)) = if_converged(corrected)? {
            self.here.residual_norm = c.residual_norm;
            (self.here.x, self.here.t) = (x, t);
            self.here.take_signs(Some(&at));
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
            .map(|site| SiteChange {
                site,
                from: before.piece(site),
                to: after.piece(site),
            })
            .collect();
        let mut arms = Arms::default();
        (arms.list).push(Arm::along(after.clone(), tangent.to_vec(), Vec::new(), None));
        // The point, and so the tangent, is known to a few smallest steps only.
        let sign = |t: &[f64]| match t.last() {
            Some(rate) if rate.abs() > REACH * self.setup.options.min_step => rate.signum() as i8,
            _ => 0,
        };
        arms.list[0].direction = sign(tangent);
        let kind = kind(sign(&self.here.t), arms.list.first(), &arms);
        let back = self.here.t.iter().map(|t| -t).collect();
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
            arrival: Arm::along(before.clone(), back, Vec::new(), self.here.det_sign),
            followed: Some(0),
            complete: false,
            det_sign: None,
            residual_norm: norm(&r),
            arclength: self.pace.arclength,
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
