//! What happens at a located transition or branch point: arms, kind, and the arm that is followed.

use super::arms::Arms;
use super::units::Units;
use super::watch::VERTICAL;
use crate::continuation::engine::Curve;
use crate::continuation::point::Wanted;
use crate::continuation::{
    Arm, BranchPoint, ContinuationError, Event, PointKind, SiteChange, Termination, Transition,
    TransitionKind,
};
use crate::piecewise::{ActiveSet, PiecewiseSmooth, Vanishing};
use crate::sparse::distance;

/// An arm within this distance of the reversed tangent of arrival is the arm of arrival.
const INCOMING: f64 = 1e-5;
const INCOMING_SINGULAR: f64 = 1e-2;
/// An arm within this distance of the tangent of arrival goes straight on.
const STRAIGHT: f64 = 1e-5;

impl Curve<'_> {
    /// Handles the transition at `here`, where test function `index` vanishes.
    pub(in crate::continuation) fn pass_transition(&mut self, index: usize) -> Result<(), ContinuationError> {
        let vanishing = self.met_together(index)?;
        let indices = vanishing.iter().map(|v| v.index).collect();
        let active = ActiveSet::beside(
            &self.map,
            &self.layout,
            &self.here.theta,
            indices,
            &self.selection,
        );
        let simple =
            vanishing.len() == 1 && matches!(active.degenerate_sites(), [(_, pieces)] if pieces.len() == 2);
        let arms = if simple && self.here.orientation.is_some() {
            self.simple_arms(&vanishing, &active)?
        } else {
            // Without an orientation the selection is singular here.
            let singular = self.here.orientation.is_none().then(|| self.selection.clone());
            let all = self.every_arm || singular.is_some();
            let (arrival, before) = (self.here.t.clone(), self.selection.clone());
            let mut search = self.search(&vanishing);
            search.singular = singular;
            let mut arms = if all {
                search.all(&active)?
            } else {
                search.following(&active, Wanted::After(&arrival), &before)?
            };
            self.remove_incoming(&mut arms);
            arms
        };
        let followed = self.choose(&arms);
        let mut record = self.transition(&vanishing, &arms, followed);
        let stop = match (followed, arms.list.len()) {
            (Some(_), _) => None,
            (None, 0) if arms.complete => Some(Termination::End),
            (None, 0) => self.is_over().or(Some(Termination::Undecided)),
            (None, _) => Some(Termination::Branching),
        };
        let Some(k) = followed else {
            self.emit(Event::Transition(record));
            self.termination = stop;
            return Ok(());
        };
        let mut left = self.adopt(&arms.list[k], &vanishing);
        if left.is_ok() && !simple {
            left = self.doubt_orientation();
        }
        if left.is_ok() {
            record.det_sign = self.det_sign_here();
        }
        self.emit(Event::Transition(record));
        left
    }

    /// The arms where a single facet between two pieces is crossed: the kernel of the selection beyond it. Its sign is fixed by the
    /// margin of the cell entered; the determinant must agree (∇H jumps by c ⊗ ∇θ).
    fn simple_arms(
        &mut self,
        vanishing: &[Vanishing],
        active: &ActiveSet,
    ) -> Result<Arms, ContinuationError> {
        let mut beyond = self.selection.clone();
        for (site, pieces) in active.degenerate_sites() {
            if let Some(&other) = pieces.iter().find(|&&p| p != self.selection.piece(*site)) {
                beyond.set(*site, other);
            }
        }
        let mut arms = Arms {
            complete: true,
            ..Arms::default()
        };
        let arrival = self.here.t.clone();
        self.search(vanishing)
            .of_selection(&beyond, Some(&arrival), &mut arms)?;
        if arms.list.len() != 1 || !arms.list[0].grazing.is_empty() {
            // Not transversal after all: the full list decides.
            let mut all = self.search(vanishing).all(active)?;
            self.remove_incoming(&mut all);
            return Ok(all);
        }
        let after = self.corrector.orientation(&arms.list[0].tangent);
        if let (Some(before), Some(after)) = (self.here.orientation, after)
            && before != after
        {
            return Err(ContinuationError::Orientation {
                parameter: self.here.x.last().copied().unwrap_or(f64::NAN),
                site: self.map.site_name(vanishing[0].site).into_owned(),
            });
        }
        Ok(arms)
    }

    fn remove_incoming(&self, arms: &mut Arms) {
        let back: Vec<f64> = self.here.t.iter().map(|t| -t).collect();
        let nearest = (0..arms.list.len()).min_by(|&i, &j| {
            let d = |k: usize| distance(&arms.list[k].tangent, &back);
            d(i).total_cmp(&d(j))
        });
        let tolerance = match self.here.orientation {
            Some(_) => INCOMING,
            // At a singular point the tangent of arrival is less accurate.
            None => INCOMING_SINGULAR,
        };
        if let Some(k) = nearest
            && distance(&arms.list[k].tangent, &back) < tolerance
        {
            arms.list.remove(k);
        }
    }

    /// The tangent of arrival is extrapolated: the arm of arrival is the one nearest to it.
    fn snap_tangent(&mut self, arms: &Arms) {
        const NEAR: f64 = 0.05;
        let far = |a: &Arm| {
            (a.tangent
                .iter()
                .zip(&self.here.t)
                .map(|(a, b)| (a + b).powi(2))
                .sum::<f64>())
            .sqrt()
        };
        let nearest = arms.list.iter().min_by(|a, b| far(a).total_cmp(&far(b)));
        if let Some(arm) = nearest.filter(|a| far(a) < NEAR) {
            self.here.t = arm.tangent.iter().map(|t| -t).collect();
        }
    }

    /// The arm to follow: the only one, or the one that goes straight on.
    fn choose(&self, arms: &Arms) -> Option<usize> {
        match arms.list.len() {
            0 => None,
            1 => Some(0),
            _ => arms
                .list
                .iter()
                .position(|a| distance(&a.tangent, &self.here.t) < STRAIGHT),
        }
    }

    fn transition(&self, vanishing: &[Vanishing], arms: &Arms, followed: Option<usize>) -> Transition {
        let arm = followed.map(|k| &arms.list[k]);
        let after = arm.map_or(&self.selection, |a| &a.selection);
        let tangent_after = arm.map_or(&self.here.t, |a| &a.tangent);
        let mut sites: Vec<usize> = vanishing.iter().map(|v| v.site).collect();
        sites.extend(self.selection.differing_sites(after));
        sites.sort_unstable();
        sites.dedup();
        let mut changes: Vec<SiteChange> = sites
            .into_iter()
            .map(|site| SiteChange {
                site,
                from: self.selection.piece(site),
                to: after.piece(site),
            })
            .collect();
        changes.sort_by_key(|c| c.from == c.to);
        Transition {
            x: self.here.x.clone(),
            tangent_before: self.here.t.clone(),
            tangent_after: tangent_after.clone(),
            before: self.selection.clone(),
            after: after.clone(),
            sites: changes,
            test_functions: self.here.theta.clone(),
            vanishing: vanishing.iter().map(|v| v.index).collect(),
            kind: kind(&self.here.t, arm, arms, VERTICAL),
            arms: arms.list.clone(),
            followed,
            complete: arms.complete,
            det_sign: None,
            residual_norm: self.here.residual_norm,
            arclength: self.arclength,
        }
    }

    /// Handles a point where the Jacobian of the followed selection (or of a co-active one) is singular.
    pub(in crate::continuation) fn pass_branch_point(
        &mut self,
        coactive: Option<usize>,
    ) -> Result<(), ContinuationError> {
        if coactive.is_none() {
            // On a facet the curve cannot go straight on: if it leaves the cell here, the point is a transition.
            if let Some(index) = self.facet_left_here() {
                self.here.orientation = None;
                return self.pass_transition(index);
            }
        }
        let singular = match coactive {
            Some(k) => self.coactive[k].0.clone(),
            None => self.selection.clone(),
        };
        let forced: Vec<usize> = self.grazing.iter().map(|v| v.index).collect();
        let vanishing = self.vanishing_here(&forced);
        let active = self.active_here(&vanishing)?;
        let mut search = self.search(&vanishing);
        search.singular = Some(singular.clone());
        let mut arms = search.all(&active)?;
        if coactive.is_none() {
            self.snap_tangent(&arms);
        }
        self.remove_incoming(&mut arms);
        let straight = Arm {
            selection: self.selection.clone(),
            tangent: self.here.t.clone(),
            grazing: self.point_here(PointKind::Step, 0).grazing,
        };
        let near = |a: &Arm| distance(&a.tangent, &straight.tangent) < 1e-3;
        let k = match arms.list.iter().position(near) {
            Some(k) => {
                // The followed selection is kept: it is regular, or its curve is the one that is followed.
                arms.list[k].selection = straight.selection;
                k
            }
            None => {
                arms.list.insert(0, straight);
                0
            }
        };
        let event = BranchPoint {
            point: self.point_here(PointKind::Step, 0),
            singular,
            arms: arms.list.clone(),
            followed: Some(k),
            complete: arms.complete,
        };
        self.emit(Event::BranchPoint(event));
        let mut watched = std::mem::take(&mut self.coactive);
        self.adopt(&arms.list[k], &vanishing)?;
        // At the point itself signs are rounding noise; beyond it exactly one has flipped.
        match coactive {
            Some(k) => {
                watched[k].1 = watched[k].1.map(|s| -s);
                self.coactive = watched;
            }
            None => {
                self.here.orientation = self.next.orientation.map(|o| -o);
                self.here.decline = None;
            }
        }
        Ok(())
    }

    /// A vanishing test function of a facet of the followed cell across which the tangent leads out.
    fn facet_left_here(&self) -> Option<usize> {
        let mut units = Units::new(&self.map, &self.selection, &self.here.x);
        let mut leaves = |v: &&Vanishing| {
            let rate = v.rate(&self.here.t);
            let least = units.least_rate(v, rate, v.gradient_norm, &self.here.t);
            let cell = self.map.cell(v.site, self.selection.piece(v.site));
            !self.grazing.iter().any(|g| g.index == v.index)
                && cell
                    .iter()
                    .any(|f| f.test() == v.test && f.sign() * rate < -least)
        };
        self.vanishing_here(&[]).iter().find(&mut leaves).map(|v| v.index)
    }
}

/// The kind of a transition; a rate of α no larger than `vertical` counts as 0.
pub(in crate::continuation) fn kind(
    arrival: &[f64],
    arm: Option<&Arm>,
    arms: &Arms,
    vertical: f64,
) -> TransitionKind {
    let rate = |t: &[f64]| {
        let last = t.last().copied().unwrap_or(0.0);
        if last.abs() <= vertical {
            0.0
        } else {
            last.signum()
        }
    };
    match (arms.list.len(), arm) {
        (0, _) if arms.complete => TransitionKind::End,
        (0, _) => TransitionKind::Undecided,
        (1, Some(arm)) => match (rate(arrival), rate(&arm.tangent)) {
            (a, b) if a == b => TransitionKind::PassThrough,
            (_, 0.0) => TransitionKind::VerticalBegin,
            (0.0, _) => TransitionKind::VerticalEnd,
            _ => TransitionKind::Fold,
        },
        _ => TransitionKind::Branching,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::continuation::testing::Plane;

    /// Of the arms at a point the arm of arrival is removed, and no other.
    #[test]
    fn arms_beside_the_incoming_one_stay() {
        let map = Plane::within(|y, _| [y, 1.0, 0.0], &[]);
        let mut run = map.curve(0.0, 0.0);
        let curve = run.curve.erased_mut();
        let arm = |angle: f64| Arm {
            selection: curve.selection.clone(),
            tangent: vec![angle.sin(), -angle.cos()],
            grazing: Vec::new(),
        };
        let beside = [0.2, -0.05, 1e-3, 2e-5].map(arm);
        let back = arm(1e-7);
        let mut arms = Arms {
            list: beside.to_vec(),
            ..Arms::default()
        };
        curve.remove_incoming(&mut arms);
        assert_eq!(arms.list, beside);
        arms.list.insert(2, back);
        curve.remove_incoming(&mut arms);
        assert_eq!(arms.list, beside);
    }

    /// At (0, 0) the curve y = 0 leads out of α ≤ 0, unless it runs in that facet: then it does not leave it.
    #[test]
    fn a_facet_in_which_the_curve_runs_is_not_left() {
        let map = Plane::within(|y, _| [y, 1.0, 0.0], &[|_, a| [-a, 0.0, -1.0]]);
        let mut run = map.curve(0.0, -0.5);
        let curve = run.curve.erased_mut();
        assert_eq!(curve.facet_left_here(), None);
        (curve.here.x[1], curve.here.theta[0]) = (0.0, 0.0);
        assert_eq!(curve.facet_left_here(), Some(0));
        curve.grazing = curve.vanishing_here(&[]);
        assert_eq!(curve.facet_left_here(), None);
    }
}
