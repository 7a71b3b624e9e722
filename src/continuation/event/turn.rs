//! What happens at a located transition or branch point: arms, kind, and the arm that is followed.

use crate::continuation::engine::Curve;
use crate::continuation::error::if_converged;
use crate::continuation::event::singular::mirrored_tangent;
use crate::continuation::point::units::Units;
use crate::continuation::point::{Arms, Wanted};
use crate::continuation::{
    Arm, BranchPoint, ContinuationError, Event, PointKind, SiteChange, Termination, Transition,
    TransitionKind,
};
use crate::piecewise::{ActiveSet, PiecewiseSmoothExt, Selection, Vanishing};
use crate::sparse::{distance, dot};

/// An arm within this distance of the tangent of arrival goes straight on.
const STRAIGHT: f64 = 1e-5;

impl Curve<'_> {
    /// Handles the transition at `here`, where test function `index` vanishes.
    pub(in crate::continuation) fn pass_transition(&mut self, index: usize) -> Result<(), ContinuationError> {
        self.moves_to_singular_point(&self.path.selection.clone(), Some(index))?;
        let vanishing = self.met_together(index)?;
        let active = self.active_beside(&vanishing);
        let simple =
            vanishing.len() == 1 && matches!(active.degenerate_sites(), [(_, pieces)] if pieces.len() == 2);
        let mut jump = None;
        let first = (simple && self.here.orientation.is_some())
            .then(|| self.simple_arm(&vanishing, &active, &mut jump))
            .transpose()?;
        let (arms, arrival) = match first.flatten() {
            Some((arm, arrival)) => {
                let arrival = self.arm_behind(arrival);
                let mut arms = Arms::default();
                (arms.list, arms.complete) = (vec![arm], true);
                (arms, arrival)
            }
            None => {
                // Without an orientation the selection is singular here.
                let singular = self
                    .here
                    .orientation
                    .is_none()
                    .then(|| self.path.selection.clone());
                let all = self.setup.every_arm || singular.is_some();
                let (arrival, before) = (self.here.t.clone(), self.path.selection.clone());
                let step = distance(&self.here.x, &self.next.x);
                let mut search = self.search(&vanishing);
                (search.singular, search.within) = (singular, step);
                let mut arms = if all {
                    search.all(&active)?
                } else {
                    search.following(&active, Wanted::After(&arrival), &before)?
                };
                let incoming = self.take_incoming(&mut arms)?;
                // It was met in the step before, too: the arm that was found there did not leave it.
                let again = self.here.x == self.next.x;
                let stays = |arm: &Arm| arm.selection == self.path.selection;
                let known = incoming.as_ref().is_none_or(stays);
                let returns = again && self.choose(&arms).is_none_or(|k| stays(&arms.list[k]));
                match (jump, arms.list.as_slice()) {
                    (Some(error), _) if returns => return Err(error),
                    // The curve does cross the facet, and there the map is not continuous.
                    (Some(error), [arm]) if known && arm.grazing.is_empty() && !stays(arm) => {
                        return Err(error);
                    }
                    // What cannot be decided to higher order may still be followed to first order.
                    (None, []) if simple && !arms.complete => {
                        arms.list
                            .extend(self.arm_beyond(&vanishing, &active)?.map(|(arm, _)| arm));
                    }
                    _ => {}
                }
                (
                    arms,
                    incoming.unwrap_or_else(|| self.arm_behind(self.direction_here())),
                )
            }
        };
        let followed = self.choose(&arms);
        let mut record = self.transition(&vanishing, (&arms, arrival), followed);
        let stop = match (followed, arms.list.len()) {
            (Some(_), _) => None,
            (None, 0) if arms.complete => Some(Termination::End),
            (None, 0) => self.setup.is_over().or(Some(Termination::Undecided)),
            (None, _) => Some(Termination::Branching),
        };
        let Some(k) = followed else {
            self.emit(Event::Transition(record));
            self.told.termination = stop;
            return Ok(());
        };
        let mut left = self.adopt(&arms.list[k], &vanishing);
        if left.is_ok() && !simple {
            left = self.doubt_orientation(&arms.list[k]);
        }
        if left.is_ok() {
            record.det_sign = self.det_sign_here();
        }
        self.emit(Event::Transition(record));
        left
    }

    /// The arm along which the curve arrived, for this sign of α̇ on arrival.
    fn arm_behind(&self, direction: i8) -> Arm {
        let back = self.here.t.iter().map(|t| -t).collect();
        let grazing = self.point_here(PointKind::Step, 0).grazing;
        let mut arm = Arm::along(self.path.selection.clone(), back, grazing, self.here.det_sign);
        arm.direction = -direction;
        arm
    }

    /// Sign of α̇ on arrival, by the first order.
    fn direction_here(&self) -> i8 {
        Units::new(&self.map, &self.path.selection, &self.here.x).direction(&self.here.t)
    }

    /// The arm where a single facet between two pieces is crossed, and the sign of α̇ on arrival, where the first order decides both: the
    /// kernel of the selection beyond the facet. Its sign is fixed by the margin of the cell entered; the determinant must agree (∇H jumps
    /// by c ⊗ ∇θ). Where it does not, the map jumps, unless the curve touches the facet and does not cross it, which a higher order decides.
    fn simple_arm(
        &mut self,
        vanishing: &[Vanishing],
        active: &ActiveSet,
        jump: &mut Option<ContinuationError>,
    ) -> Result<Option<(Arm, i8)>, ContinuationError> {
        let affine = self.map.is_piecewise_affine();
        if !affine && self.is_singular_here(&self.selection_beyond(active))? {
            return Ok(None);
        }
        let before = self.direction_here();
        let Some((arm, after)) = self.arm_beyond(vanishing, active)? else {
            return Ok(None);
        };
        if !affine && (before == 0 || arm.direction == 0) {
            // A higher order decides.
            return Ok(None);
        }
        if let (Some(before), Some(after)) = (self.here.orientation, after)
            && before != after
        {
            *jump = Some(ContinuationError::Orientation {
                parameter: self.here.x.last().copied().unwrap_or(f64::NAN),
                site: self.map.site_name(vanishing[0].site).into_owned(),
            });
            return Ok(None);
        }
        Ok(Some((arm, before)))
    }

    /// The selection on the other side of the only facet that meets here.
    fn selection_beyond(&self, active: &ActiveSet) -> Selection {
        let mut beyond = self.path.selection.clone();
        for (site, pieces) in active.degenerate_sites() {
            if let Some(&other) = pieces.iter().find(|&&p| p != self.path.selection.piece(*site)) {
                beyond.set(*site, other);
            }
        }
        beyond
    }

    /// Its arm, if that crosses the facet transversally, with its orientation.
    fn arm_beyond(
        &mut self,
        vanishing: &[Vanishing],
        active: &ActiveSet,
    ) -> Result<Option<(Arm, Option<i8>)>, ContinuationError> {
        let (beyond, arrival) = (self.selection_beyond(active), self.here.t.clone());
        Ok(self.search(vanishing).regular_arm(&beyond, &arrival)?)
    }

    /// Takes the arm along which the curve arrived out of the list: the nearest to the curve behind, by a point at the distance of the
    /// corrected points of the arms where these are needed to tell them apart.
    fn take_incoming(&mut self, arms: &mut Arms) -> Result<Option<Arm>, ContinuationError> {
        let own = |a: &Arm| {
            let mut apart = a.selection.differing_sites(&self.path.selection);
            apart.all(|site| a.grazing.contains(&site))
        };
        let back: Vec<f64> = self.here.t.iter().map(|t| -t).collect();
        let mut candidates: Vec<usize> = (0..arms.list.len()).filter(|&k| own(&arms.list[k])).collect();
        if candidates.is_empty() {
            // Within rounding of a point where the curve touches a facet it may have been followed on the other side of it.
            let straight = |k: &usize| distance(&arms.list[*k].tangent, &back) < STRAIGHT;
            candidates.extend((0..arms.list.len()).find(straight));
        }
        let mut nearest: Option<(f64, usize)> = None;
        for &k in &candidates {
            let arm = &arms.list[k];
            let radius = if arm.probe.is_empty() {
                0.0
            } else {
                distance(&arm.probe, &self.here.x)
            };
            let point = if radius > 0.0 {
                self.point_behind(radius)?
            } else {
                None
            };
            let far = match point {
                Some(point) => distance(&arm.probe, &point) / radius,
                None => distance(&arm.tangent, &back),
            };
            if nearest.is_none_or(|n| far < n.0) {
                nearest = Some((far, k));
            }
        }
        let opposite = |k: usize| dot(&arms.list[k].tangent, &back) <= 0.0;
        Ok(nearest.filter(|n| !opposite(n.1)).map(|n| arms.list.remove(n.1)))
    }

    /// The point of the last step at a distance before `here`.
    fn point_behind(&mut self, radius: f64) -> Result<Option<Vec<f64>>, ContinuationError> {
        let (anchor, normal) = (self.next.x.clone(), self.next.t.clone());
        let chord: Vec<f64> = self.here.x.iter().zip(&anchor).map(|(x, a)| x - a).collect();
        let s = dot(&chord, &normal) - radius;
        if s <= 0.0 {
            return Ok(None);
        }
        // Where curves touch at the end the tangent there is any one between theirs.
        let mut end = self.here.clone();
        end.s = s + radius;
        end.t = mirrored_tangent((&anchor, &normal), &end.x);
        let mut behind = end.clone();
        std::mem::swap(&mut self.here, &mut self.next);
        self.interpolate(s, &end, &mut behind);
        std::mem::swap(&mut self.here, &mut self.next);
        let (guess, mut t) = (behind.x, behind.t);
        let mut y = guess.clone();
        let (map, plane) = (&self.map, (&anchor[..], &normal[..], s));
        let corrected = (self.corrector).correct_in_plane(map, &self.path.selection, plane, &mut y, &mut t);
        let met = if_converged(corrected)?.is_some();
        Ok((met && distance(&y, &guess) <= 0.5 * radius).then_some(y))
    }

    /// The arm that goes straight on from that of arrival: where several do, the one nearest to the parabola on which the curve arrived.
    fn straightest(&self, arms: &[Arm], arrival: &Arm) -> Option<usize> {
        let chord = |arm: &Arm| -> Vec<f64> {
            let points = arm.probe.iter().zip(&self.here.x);
            points.map(|(p, x)| p - x).collect()
        };
        let (before, t) = (chord(arrival), &self.here.t);
        let back = dot(&before, t);
        let far = |k: &usize| {
            let after = chord(&arms[*k]);
            if after.len() != before.len() || back == 0.0 {
                return distance(&arms[*k].tangent, t);
            }
            let share = dot(&after, t) / back;
            let off = before.iter().zip(&after).zip(t).map(|((b, a), t)| {
                let parabola = share * back * t + share * share * (b - back * t);
                (a - parabola).powi(2)
            });
            off.sum::<f64>()
        };
        let straight = |k: &usize| distance(&arms[*k].tangent, t) < STRAIGHT;
        let list = (0..arms.len()).filter(straight);
        list.min_by(|i, j| far(i).total_cmp(&far(j)))
    }

    /// The arm to follow: the only one, or the one that goes straight on, with the followed selection if there are several.
    fn choose(&self, arms: &Arms) -> Option<usize> {
        let straight = |k: &usize| distance(&arms.list[*k].tangent, &self.here.t) < STRAIGHT;
        let own = |k: &usize| arms.list[*k].selection == self.path.selection;
        match arms.list.len() {
            0 => None,
            1 => Some(0),
            n => (0..n).filter(straight).find(own).or((0..n).find(straight)),
        }
    }

    fn transition(
        &self,
        vanishing: &[Vanishing],
        (arms, arrival): (&Arms, Arm),
        followed: Option<usize>,
    ) -> Transition {
        let arm = followed.map(|k| &arms.list[k]);
        let after = arm.map_or(&self.path.selection, |a| &a.selection);
        let tangent_after = arm.map_or(&self.here.t, |a| &a.tangent);
        let mut sites: Vec<usize> = vanishing.iter().map(|v| v.site).collect();
        sites.extend(self.path.selection.differing_sites(after));
        sites.sort_unstable();
        sites.dedup();
        let mut changes: Vec<SiteChange> = sites
            .into_iter()
            .map(|site| SiteChange {
                site,
                from: self.path.selection.piece(site),
                to: after.piece(site),
            })
            .collect();
        changes.sort_by_key(|c| c.from == c.to);
        Transition {
            x: self.here.x.clone(),
            tangent_before: self.here.t.clone(),
            tangent_after: tangent_after.clone(),
            before: self.path.selection.clone(),
            after: after.clone(),
            sites: changes,
            test_functions: self.here.theta.clone(),
            vanishing: vanishing.iter().map(|v| v.index).collect(),
            kind: kind(-arrival.direction, arm, arms),
            arrival,
            arms: arms.list.clone(),
            followed,
            complete: arms.complete,
            det_sign: None,
            residual_norm: self.here.residual_norm,
            arclength: self.pace.arclength,
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
            Some(k) => self.path.coactive[k].0.clone(),
            None => self.path.selection.clone(),
        };
        if coactive.is_some() {
            self.moves_to_singular_point(&singular, None)?;
        }
        let forced: Vec<usize> = self.path.grazing.iter().map(|v| v.index).collect();
        let vanishing = self.vanishing_here(&forced);
        let active = self.active_here(&vanishing);
        let step = distance(&self.here.x, &self.next.x);
        let mut search = self.search(&vanishing);
        search.singular = Some(singular.clone());
        search.within = step;
        let mut arms = search.all(&active)?;
        let incoming = self.take_incoming(&mut arms)?;
        if let Some(incoming) = &incoming {
            // The tangent of arrival is extrapolated: that of the arm is known better.
            self.here.t = incoming.tangent.iter().map(|t| -t).collect();
        }
        let recognised = incoming.is_some();
        let arrival = incoming.unwrap_or_else(|| self.arm_behind(self.direction_here()));
        let grazing = self.point_here(PointKind::Step, 0).grazing;
        let straight = Arm::along(self.path.selection.clone(), self.here.t.clone(), grazing, None);
        let nearest = self.straightest(&arms.list, &arrival);
        // With the arm of arrival there are two, on one side of α*: a cusp.
        if recognised
            && arms.complete
            && let [arm] = arms.list.as_slice()
            && arm.direction == arrival.direction
        {
            let arm = arm.clone();
            let point = self.point_here(PointKind::Step, 0);
            self.emit(Event::SmoothFold(point));
            return self.adopt(&arm, &vanishing);
        }
        let k = match nearest {
            Some(k) => {
                // The followed selection is kept: it is regular, or its curve is the one that is followed.
                arms.list[k].selection = straight.selection;
                Some(k)
            }
            // All arms are known, and none goes straight on.
            None if recognised && arms.complete => None,
            None => {
                arms.complete = false;
                arms.list.insert(0, straight);
                Some(0)
            }
        };
        let event = BranchPoint {
            point: self.point_here(PointKind::Step, 0),
            singular,
            arms: arms.list.clone(),
            arrival,
            followed: k,
            complete: arms.complete,
        };
        self.emit(Event::BranchPoint(event));
        let Some(k) = k else {
            self.told.termination = Some(match arms.list.is_empty() {
                true => Termination::End,
                false => Termination::Branching,
            });
            return Ok(());
        };
        let mut watched = std::mem::take(&mut self.path.coactive);
        self.adopt(&arms.list[k], &vanishing)?;
        if !arms.list[k].probe.is_empty() {
            return Ok(());
        }
        // At the point itself signs are rounding noise; beyond it exactly one has flipped.
        match coactive {
            Some(k) => {
                watched[k].1 = watched[k].1.map(|s| -s);
                self.path.coactive = watched;
            }
            None => {
                self.here.orientation = self.next.orientation.map(|o| -o);
                self.here.decline = None;
            }
        }
        Ok(())
    }

    /// A vanishing test function of a facet of the followed cell across which the tangent leads out.
    pub(in crate::continuation) fn facet_left_here(&self) -> Option<usize> {
        let mut units = Units::new(&self.map, &self.path.selection, &self.here.x);
        let mut leaves = |v: &&Vanishing| {
            let rate = v.rate(&self.here.t);
            let least = units.least_rate(v, rate, v.gradient_norm, &self.here.t);
            let cell = self.map.cell(v.site, self.path.selection.piece(v.site));
            !self.is_grazing(v.index)
                && cell
                    .iter()
                    .any(|f| f.test() == v.test && f.sign() * rate < -least)
        };
        self.vanishing_here(&[]).iter().find(&mut leaves).map(|v| v.index)
    }
}

/// The kind of a transition on which the curve arrives with this sign of α̇.
pub(in crate::continuation) fn kind(arrival: i8, arm: Option<&Arm>, arms: &Arms) -> TransitionKind {
    match (arms.list.len(), arm) {
        (0, _) if arms.complete => TransitionKind::End,
        (0, _) => TransitionKind::Undecided,
        (1, Some(arm)) => match (arrival, arm.direction) {
            (a, b) if a == b => TransitionKind::PassThrough,
            (_, 0) => TransitionKind::VerticalBegin,
            (0, _) => TransitionKind::VerticalEnd,
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
        let arm = |angle: f64| {
            let tangent = vec![angle.sin(), -angle.cos()];
            Arm::along(curve.path.selection.clone(), tangent, Vec::new(), None)
        };
        let beside = [0.2, -0.05, 1e-3, 2e-5].map(arm);
        let back = arm(1e-7);
        let mut arms = Arms {
            list: beside.to_vec(),
            ..Arms::default()
        };
        arms.list.insert(2, back.clone());
        assert_eq!(curve.take_incoming(&mut arms).unwrap(), Some(back));
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
        curve.path.grazing = curve.vanishing_here(&[]);
        assert_eq!(curve.facet_left_here(), None);
    }
}
