use super::ContactState;
use super::node_law::{LocalRow, LocalValues, NodeLaw, of_inner_law};
use crate::contact::ContactError;
use crate::piecewise::Facet;

/// Wear of J. F. Archard (J. Appl. Phys. 24 (1953)): another law at a gap that grows with the work of pressing and slipping,
/// dw = k p ds, along a [history](crate::contact::evolve).
///
/// The depth w ≥ 0, by which the gap is wider, is the last history variable of a node. It grows at the end of each level, by k times the
/// pressure there times the slip of the level, which is k p s where the pressure does not change; else the error is of first order in the
/// length of the levels. Penetrations of solutions are measured from the surface without wear: those of worn nodes in contact are w.
///
/// ```
/// use std::ops::ControlFlow;
/// use semismooth::contact::{
///     CondensedContact, ContactBody, EvolutionOptions, FrictionCoefficient, LoadPath, PlanarCoulomb, Worn, evolve,
/// };
/// use semismooth::sparse::Matrix;
/// // A node of stiffness 1 under the load (2, α) with F = ½, of unit area, k = ¼.
/// let [normal, tangential] = [[1.0, 0.0], [0.0, 1.0]].map(|row| Matrix::from_rows(&[row]));
/// let load = LoadPath::affine(vec![2.0, 0.0], vec![0.0, 1.0]);
/// let body = ContactBody::new(Matrix::identity(2), normal?, vec![tangential?], load)?;
/// let law = Worn::new(PlanarCoulomb::new(FrictionCoefficient::constant(0.5)?), vec![0.25])?;
/// let mut problem = CondensedContact::new(body, law)?;
/// let start = problem.solve(0.0, None)?;
/// let steps = evolve(&mut problem, &start, &[2.0, 3.0], &EvolutionOptions::default(), |_| ControlFlow::Continue(()))?;
/// // It slips by 2 − ½ · 2 = 1, and wears off by ¼ · 2 · 1; then the pressure is 2 − ½, and the slip 3 − ½ · 1.5 − 1.
/// assert!((steps[0].history[0] - 0.5).abs() < 1e-12);
/// assert!((steps[1].history[0] - (0.5 + 0.25 * 1.5 * 1.25)).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Worn<L> {
    law: L,
    rates: Vec<f64>,
}

impl<L: NodeLaw> Worn<L> {
    /// The law with the depth that each contact node loses a unit of nodal force and of slip: k ≥ 0 over its area.
    ///
    /// # Errors
    /// Values that are negative or not finite.
    pub fn new(law: L, rates: Vec<f64>) -> Result<Self, ContactError> {
        super::check_bounds("the rate of wear", &rates)?;
        Ok(Self { law, rates })
    }

    fn inner(&self, v: &LocalValues) -> LocalValues {
        let depth = v.history.get(self.law.num_history()).copied().unwrap_or(0.0);
        LocalValues {
            penetration: v.penetration - depth,
            ..*v
        }
    }
}

impl<L: NodeLaw> NodeLaw for Worn<L> {
    of_inner_law!();

    fn num_nodes(&self) -> Option<usize> {
        Some(self.rates.len())
    }

    fn num_history(&self) -> usize {
        self.law.num_history() + 1
    }

    fn update(&self, v: &LocalValues, history: &mut [f64]) {
        if let Some((depth, own)) = history.split_last_mut() {
            self.law.update(&self.inner(v), own);
            let rate = self.rates.get(v.node).copied().unwrap_or(0.0);
            *depth += rate * v.pressure.max(0.0) * v.slip_norm();
        }
    }

    fn tension(&self, node: usize) -> f64 {
        self.law.tension(node)
    }

    fn wear(&self, history: &[f64]) -> f64 {
        let inner = self.law.num_history();
        history.get(inner).copied().unwrap_or(0.0) + self.law.wear(&history[..inner.min(history.len())])
    }
}
