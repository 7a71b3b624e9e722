//! The analysis of a point that a user gives, and of starts of curves.

use super::{Arms, Certainty, PointAnalysis, PointDoubt, certainty};
use crate::continuation::engine::Curve;
use crate::continuation::start::solver;
use crate::continuation::{Arm, ContinuationError, ContinuationOptions};
use crate::piecewise::{PiecewiseSmooth, Vanishing};

/// All arms of the solution set at a solution x, and whether the list is complete to first order.
///
/// # Complexity
/// Up to 16 active selections are tried one by one, a factorisation each. Where there are more, kᵖ for p sites with k active pieces each, a
/// pruned search looks for those that have an arm: exponential in p in the worst case, ended by
/// [`max_nodes`](ContinuationOptions::max_nodes), [`max_selections`](ContinuationOptions::max_selections) and
/// [`max_time`](ContinuationOptions::max_time).
///
/// # Errors
/// As [`Continuation::new`](crate::continuation::Continuation::new).
pub fn arms_at<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    x: &[f64],
    options: &ContinuationOptions,
) -> Result<PointAnalysis, ContinuationError> {
    let mut curve = Curve::prepare(map, x, options.clone(), Box::new(solver()))?;
    let curve = curve.erased_mut();
    let (mut arms, certainty) = curve.arms_of_start()?;
    let analysis = PointAnalysis::new(&mut arms, certainty);
    curve.map.unscale_arms(&mut arms.list);
    Ok(PointAnalysis {
        arms: arms.list,
        ..analysis
    })
}

impl Curve<'_> {
    /// All arms at the start, in scaled variables.
    pub(in crate::continuation) fn arms_of_start(&mut self) -> Result<(Arms, Certainty), ContinuationError> {
        self.moves_to_singular_point(&self.path.selection.clone(), None)?;
        let vanishing = self.met_here()?;
        let arms = self.all_arms(&vanishing)?;
        let certainty = match &arms.undecided {
            Some(doubt) => Certainty::Undecided(doubt.clone()),
            None if !arms.complete => Certainty::Undecided(PointDoubt::Budget),
            None => self.certainty_at(&vanishing, &arms.list),
        };
        Ok((arms, certainty))
    }

    /// How certain it is that the arms given are all that leave the start.
    pub(in crate::continuation) fn certainty_of(
        &mut self,
        arms: &[Arm],
    ) -> Result<Certainty, ContinuationError> {
        let vanishing = self.met_here()?;
        Ok(self.certainty_at(&vanishing, arms))
    }

    fn certainty_at(&self, vanishing: &[Vanishing], arms: &[Arm]) -> Certainty {
        certainty(&&self.map, &self.here.x, &self.active_here(vanishing), arms)
    }
}
