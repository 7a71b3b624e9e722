//! Smooth branch points to full accuracy, distinguished from curves that pass each other.

use super::branch_point::{BranchSystem, Singular};
use super::locate::Find;
use super::watch::{Monitor, Unresolved};
use crate::continuation::ContinuationError;
use crate::continuation::engine::{Curve, State};
use crate::continuation::point::{LARGEST, ROOT, multiple_point};
use crate::piecewise::{PiecewiseSmoothExt, Selection, Vanishing};
use crate::sparse::{distance, dot, norm};

/// Distance to a facet, relative to 1 + ‖x‖, up to which a curve whose steps are rejected is taken to have approached it.
const CREEP: f64 = 1e-6;
/// Largest determinant, relative to that at the start of the step, of a bracketed point that counts as singular.
pub(in crate::continuation) const ZERO_DETERMINANT: f64 = 1e-6;

/// Error of a branch point found by its own equations, relative to 1 + ‖x‖.
pub(super) const LOCATED: f64 = 1e-12;

/// Relative singular value, and distance, up to which a singular point is looked for: far above the square root of rounding, to which points
/// are located where equations are singular. What is found there is decided by its own equations.
const NEARLY: f64 = 1e-5;

impl Curve<'_> {
    /// The singular point of the followed selection next to `guess`, where its equations are regular.
    fn singular_near(&self, guess: &[f64]) -> Result<Option<Singular>, ContinuationError> {
        self.singular_point(&self.path.selection, guess)
    }

    /// The solution of the extended system of a branch point. Next to a point where the kernel has one more dimension that is nearly singular
    /// and does not locate it: the equations of such a point decide, as they do at degenerate points, where the system does not converge.
    fn singular_point(
        &self,
        selection: &Selection,
        guess: &[f64],
    ) -> Result<Option<Singular>, ContinuationError> {
        let simple = BranchSystem::new(&self.map, selection, &self.here.x, guess).solve(guess)?;
        if self.map.is_piecewise_affine() {
            return Ok(simple);
        }
        let (near, reach) = match &simple {
            Some(simple) => (&simple.x[..], NEARLY * (1.0 + norm(guess))),
            None => (guess, f64::INFINITY),
        };
        let find = |dimension: usize| {
            multiple_point(&self.map, &self.setup.layout, selection, (near, reach), dimension)
        };
        let mut multiple = find(LARGEST)?;
        if simple.is_none() && multiple.is_none() {
            multiple = find(LARGEST - 1)?;
        }
        let degenerate = |x| Singular {
            x,
            on_curve: true,
            simple: false,
        };
        Ok(multiple.map(degenerate).or(simple))
    }

    /// Whether the singular point that a rate of decline announces is x, within rounding.
    pub(in crate::continuation) fn is_within_rounding(decline: f64, x: &[f64]) -> bool {
        decline.abs() * LOCATED * (1.0 + norm(x)) >= 1.0
    }

    /// Moves `next` to a degenerate singular point towards which the curve leads as its regularity falls: next to it the corrector gains no
    /// digits. Simple branch points lie between points of the curve.
    fn leads_to_singular_point(&mut self) -> Result<bool, ContinuationError> {
        if self.here.decline.is_none_or(|d| d <= 0.0) {
            return Ok(false);
        }
        let Some(found) = self.singular_near(&self.here.x)?.filter(|f| !f.simple) else {
            return Ok(false);
        };
        let size = LOCATED * (1.0 + norm(&found.x));
        Ok(self.here.progress_to(&found.x) > size && self.arrive_at(&found)?.is_ok())
    }

    /// Whether ∇H^(σ) of a selection is singular at a point within rounding of `here`, as far as rounding moves points located by
    /// equations that are nearly singular; `here` is moved to it. With an index, its test function has to vanish there, too.
    pub(in crate::continuation) fn moves_to_singular_point(
        &mut self,
        selection: &Selection,
        index: Option<usize>,
    ) -> Result<bool, ContinuationError> {
        if self.map.is_piecewise_affine() || !self.search(&[]).is_nearly_singular(selection, NEARLY)? {
            return Ok(false);
        }
        let guess = self.here.x.clone();
        let reach = NEARLY * (1.0 + norm(&guess));
        let found = self.singular_point(selection, &guess)?;
        let Some(Singular { x, .. }) = found.filter(|s| s.on_curve && distance(&s.x, &guess) <= reach) else {
            return Ok(false);
        };
        let mut theta = vec![0.0; self.setup.layout.total()];
        self.map.tests_of_selection(selection, &x, None, &mut theta);
        if let Some(index) = index {
            let v = Vanishing::new(&self.map, &self.setup.layout, selection, index, &x);
            let reach = self.setup.options.vanishing_distance * (1.0 + norm(&x));
            if theta[index].abs() > reach * v.gradient_norm {
                return Ok(false);
            }
        }
        self.here.x = x;
        self.here.theta = theta;
        self.here.orientation = None;
        self.here.det_sign = Some(0);
        self.here.decline = None;
        Ok(true)
    }

    /// The branch point of the followed selection within `reach` of `guess`.
    fn branch_point_near(&self, guess: &[f64], reach: f64) -> Result<Option<Vec<f64>>, ContinuationError> {
        let found = self.singular_near(guess)?;
        Ok(found
            .filter(|s| s.on_curve && distance(&s.x, guess) <= reach)
            .map(|s| s.x))
    }

    /// Moves `next`, whose orientation differs from that of `here`, to the branch point in between. There is one only if the extended
    /// system has a regular solution on the curve of `here`; otherwise the step has jumped to a curve that passes nearby.
    pub(in crate::continuation) fn resolve_flip(
        &mut self,
    ) -> Result<Result<(), Unresolved>, ContinuationError> {
        let beyond = self.next.clone();
        let mut guess = beyond.clone();
        self.interpolate(0.5 * beyond.s, &beyond, &mut guess);
        if let Some(found) = self.singular_near(&guess.x)?
            && self.is_between(&found.x, &beyond)
        {
            return self.arrive_at(&found);
        }
        Ok(Err(Unresolved::Crossing))
    }

    /// Whether x lies near the segment from `here` to `beyond`, whose end counts; not if it is `here`, a branch point that the curve has
    /// just left.
    fn is_between(&self, x: &[f64], beyond: &State) -> bool {
        const NEAR: f64 = 0.1;
        const LEFT: f64 = 1e-6;
        let s = self.here.progress_to(x);
        let mut guess = beyond.clone();
        self.interpolate(s, beyond, &mut guess);
        let rounding = LOCATED * (1.0 + norm(x));
        s > LEFT * beyond.s + rounding && s < beyond.s + rounding && distance(x, &guess.x) <= NEAR * beyond.s
    }

    /// Moves `next` to a branch point if the curve leads there: corrected points ever nearer, with the orientation of `here` and
    /// tangents that turn little.
    fn arrive_at(&mut self, found: &Singular) -> Result<Result<(), Unresolved>, ContinuationError> {
        const SHARES: [f64; 4] = [0.5, 0.9, 0.99, 0.999];
        const RATIO: f64 = 2.0;
        if !found.on_curve {
            return Ok(Err(Unresolved::Crossing));
        }
        let mut target = self.next.clone();
        target.x.copy_from_slice(&found.x);
        target.s = self.here.progress_to(&found.x);
        target.t = mirrored_tangent((&self.here.x, &self.here.t), &found.x);
        let rounding = LOCATED * (1.0 + norm(&found.x));
        // One more than the order with which the regularity falls.
        let most = 1.0 + if found.simple { 1.0 } else { ROOT };
        // Along trivial solutions rows have no terms by which their decline could be measured.
        let measured = !self.scale.rows.contains(&0.0);
        let (mut state, mut before) = (target.clone(), self.here.t.clone());
        for share in SHARES {
            // No other one may lie before or beyond it.
            let find = match share == SHARES[0] {
                true => Find::Decline(target.s),
                false => Find::Tangent,
            };
            if !self.find_state(share * target.s, &target, &mut state, find)? {
                return Ok(Err(Unresolved::Crossing));
            }
            let left = (1.0 - share) * target.s;
            let near = distance(&state.x, &found.x) <= RATIO * left + rounding;
            let turned = state.orientation != self.here.orientation;
            if !near || turned || dot(&state.t, &before) < self.setup.options.min_cos {
                return Ok(Err(Unresolved::Crossing));
            }
            if share == SHARES[0]
                && measured
                && state.decline.is_some_and(|d| !(0.0..=most).contains(&(d * left)))
            {
                return Ok(Err(Unresolved::Crossing));
            }
            // The last of the tangents is as good as that of the branch point.
            before.copy_from_slice(&state.t);
            target.t.copy_from_slice(&state.t);
        }
        self.settle_at(target);
        Ok(Ok(()))
    }

    /// Makes `target`, a singular point, the end of the step.
    fn settle_at(&mut self, mut target: State) {
        let mut r = vec![0.0; self.map.num_residuals()];
        self.map.residual(&self.path.selection, &target.x, &mut r);
        target.find_tests(&self.map, &self.path.selection);
        target.orientation = None;
        target.det_sign = Some(0);
        target.decline = None;
        target.residual_norm = norm(&r);
        self.next = target;
    }

    /// A facet crossed at a singular point, or a singular point without facets, to which the curve leads though no step arrives there.
    pub(in crate::continuation) fn event_at_singular_point(
        &mut self,
        h: f64,
    ) -> Result<Option<Monitor>, ContinuationError> {
        match self.event_at_branch_point(h)? {
            None if self.leads_to_singular_point()? => Ok(Some(Monitor::Singular)),
            event => Ok(event),
        }
    }

    /// The next facet, if it is crossed at a branch point of the frozen selection, where the corrector fails on both sides. The
    /// point is extrapolated along the tangent and found by the extended system.
    fn event_at_branch_point(&mut self, h: f64) -> Result<Option<Monitor>, ContinuationError> {
        let rates = self.rates_at(&self.here);
        let mut nearest: Option<(f64, Monitor)> = None;
        for (index, facet) in self.facets() {
            let s = -self.here.theta[index] / rates[index];
            let ahead = facet.sign() * rates[index] < 0.0 && s >= 0.0;
            if ahead && nearest.is_none_or(|n| s < n.0) {
                nearest = Some((s, Monitor::Facet { index, facet }));
            }
        }
        // Steps shortened towards the point are much shorter than the distance that remains.
        let far = 2.0 * h.max(CREEP * (1.0 + norm(&self.here.x)));
        let Some((s, monitor)) = nearest.filter(|n| n.0 <= far) else {
            return Ok(None);
        };
        let guess = self.here.ahead(s);
        let reach = 0.1 * s + 10.0 * self.setup.options.vanishing_distance * (1.0 + norm(&guess));
        let Some(x) = self.branch_point_near(&guess, reach)? else {
            return Ok(None);
        };
        let mut theta = vec![0.0; self.setup.layout.total()];
        self.map
            .tests_of_selection(&self.path.selection, &x, None, &mut theta);
        let tiny = self.setup.options.vanishing_distance * (1.0 + norm(&x));
        let Monitor::Facet { index, .. } = monitor else {
            return Ok(None);
        };
        if theta[index].abs() > tiny * rates[index].abs() {
            return Ok(None);
        }
        let length = distance(&x, &self.here.x);
        if length == 0.0 {
            return Ok(None);
        }
        let mut target = self.next.clone();
        target.t = mirrored_tangent((&self.here.x, &self.here.t), &x);
        target.x = x;
        target.s = length;
        self.settle_at(target);
        Ok(Some(monitor))
    }
}

/// The tangent at x of the circular arc from a point with its tangent: the tangents at both ends are mirror images in the chord.
pub(in crate::continuation) fn mirrored_tangent(from: (&[f64], &[f64]), x: &[f64]) -> Vec<f64> {
    let chord: Vec<f64> = x.iter().zip(from.0).map(|(a, b)| a - b).collect();
    let along = 2.0 * dot(&chord, from.1) / dot(&chord, &chord);
    chord.iter().zip(from.1).map(|(c, t)| along * c - t).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::continuation::testing::{Function, Plane};

    fn line() -> Plane {
        Plane::within(|y, _| [y, 1.0, 0.0], &[])
    }

    #[test]
    fn branch_points_lie_between_the_ends_of_a_step() {
        let map = line();
        let mut run = map.curve(0.0, 0.0);
        let curve = run.curve.erased_mut();
        curve.step_to([0.0, 1.0], [0.0, 1.0]);
        let beyond = curve.next.clone();
        let between = |x: [f64; 2]| curve.is_between(&x, &beyond);
        assert!(between([0.0, 0.5]) && between([0.09, 0.5]) && between([0.0, 1e-5]));
        assert!(!between([0.11, 0.5]) && !between([0.0, 1.1]));
        // The start itself, up to rounding: a branch point that the curve has just left.
        assert!(!between([0.0, 0.0]) && !between([0.0, 5e-7]) && !between([0.0, -0.5]));
    }

    /// A singular point on the line is reached along the line, with its orientation; one beside the line, or beside the curve, is not.
    #[test]
    fn branch_points_are_arrived_at_along_the_curve() {
        let map = line();
        let arrives = |x: [f64; 2], on_curve: bool, turned: bool| {
            let mut run = map.curve(0.0, 0.0);
            let curve = run.curve.erased_mut();
            curve.step_to([0.0, 1.0], [0.0, 1.0]);
            if turned {
                curve.here.orientation = curve.here.orientation.map(|o| -o);
            }
            let found = Singular {
                x: x.to_vec(),
                on_curve,
                simple: true,
            };
            let arrived = curve.arrive_at(&found).unwrap().is_ok();
            assert!(!arrived || (curve.next.x == x && curve.next.orientation.is_none()));
            arrived
        };
        assert!(arrives([0.0, 0.5], true, false));
        assert!(!arrives([0.0, 0.5], false, false) && !arrives([0.0, 0.5], true, true));
        assert!(!arrives([0.05, 0.5], true, false));
    }

    /// y² = α² along y = α towards the branch point at 0: a facet through the branch point is found, one that passes beside it is not.
    #[test]
    fn only_a_facet_through_the_branch_point_is_met_there() {
        let at: Function = |_, a| [-a, 0.0, -1.0];
        let behind: Function = |_, a| [5e-4 - a, 0.0, -1.0];
        for (facet, met) in [(at, true), (behind, false)] {
            let map = Plane::within(|y, a| [y * y - a * a, 2.0 * y, -2.0 * a], &[facet]);
            let mut run = map.curve(-0.01, -0.01);
            let found = run.curve.erased_mut().event_at_branch_point(0.01).unwrap();
            assert_eq!(found.is_some(), met);
        }
    }
}
