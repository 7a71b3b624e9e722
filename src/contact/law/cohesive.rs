use super::ContactState;
use super::node_law::{LocalRow, LocalValues, NodeLaw, of_inner_law};
use crate::contact::ContactError;
use crate::piecewise::Facet;

/// Cohesion: another law with λν + T in place of λν. With Coulomb friction the bound is F (λν + T) = c + F λν, with the cohesion c = F T,
/// and vanishes at the apex of the cone, λν = −T = −c/F.
///
/// A node opens under the tension T, and bears it at any distance: a joint that yields perfectly. Its forces are then continuous, which
/// those of a bond that breaks are not. Pieces, states and names are those of the other law.
#[derive(Debug, Clone, PartialEq)]
pub struct Cohesive<L> {
    law: L,
    tension: Vec<f64>,
}

impl<L: NodeLaw> Cohesive<L> {
    /// The law with the tension T ≥ 0, a nodal force, of each contact node.
    ///
    /// # Errors
    /// Values that are negative or not finite.
    pub fn new(law: L, tension: Vec<f64>) -> Result<Self, ContactError> {
        super::check_bounds("the tension", &tension)?;
        Ok(Self { law, tension })
    }

    fn inner(&self, v: &LocalValues) -> LocalValues {
        LocalValues {
            pressure: v.pressure + self.tension(v.node),
            ..*v
        }
    }
}

impl<L: NodeLaw> NodeLaw for Cohesive<L> {
    of_inner_law!();

    fn num_nodes(&self) -> Option<usize> {
        Some(self.tension.len())
    }

    fn num_history(&self) -> usize {
        self.law.num_history()
    }

    fn update(&self, v: &LocalValues, history: &mut [f64]) {
        self.law.update(&self.inner(v), history);
    }

    fn tension(&self, node: usize) -> f64 {
        self.tension.get(node).copied().unwrap_or(0.0) + self.law.tension(node)
    }

    fn wear(&self, history: &[f64]) -> f64 {
        self.law.wear(history)
    }
}
