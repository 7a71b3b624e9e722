//! What the full and the condensed form have in common.

use super::ContactError;
use super::node_law::{LocalValues, NodeLaw};
use crate::piecewise::PiecewiseSmooth;

/// A contact problem in one of its forms: x ends with the multipliers, all normal ones first, and α.
pub(super) trait Form: PiecewiseSmooth {
    type Law: NodeLaw;
    type Under<M: NodeLaw>: Form<Law = M>;

    fn law(&self) -> &Self::Law;

    /// The augmentation parameter.
    fn augmentation(&self) -> f64;

    /// Stiffness of single contact nodes.
    fn stiffness(&self) -> f64;

    fn values(&self, node: usize, x: &[f64]) -> LocalValues;

    /// The same body under another law, with another augmentation parameter.
    fn under<M: NodeLaw>(&self, law: M, r: f64) -> Self::Under<M>;

    /// The same body under another law, with the load that it has at α.
    fn at_load<M: NodeLaw>(&self, alpha: f64, law: M) -> Result<Self::Under<M>, ContactError>;

    /// Forces of the problem with all nodes stuck, as a start.
    fn stick(&self, alpha: f64) -> Result<Option<Vec<f64>>, ContactError>;

    /// Improves a start by a quick method of the form, if there is one; whether that converged.
    fn improve(&self, _x: &mut [f64]) -> bool {
        false
    }
}
