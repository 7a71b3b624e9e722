use std::sync::Arc;

use super::operator::Operator;
use super::view::{CondensedView, FullView};
use super::{CondensedInterface, Interface, InterfaceProblem, LoadPath};
use crate::InputError;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth};
use crate::sparse::Matrix;

impl<G: PiecewiseSmooth> InterfaceProblem<G> {
    /// A problem from its parts: A (n × n), B (q × n), the load and the law.
    ///
    /// # Errors
    /// Shapes that do not fit, a law without q residuals and 2q + 1 or 2q + 2 variables, entries that are not finite.
    pub fn from_parts(a: Matrix, b: &Matrix, load: LoadPath, law: G) -> Result<Self, PiecewiseError> {
        Self::with_view(Arc::new(Operator::new(a, b, load)?), FullView, law)
    }

    /// The problem condensed onto its multipliers; the law is cloned. A law that is not `Clone` can be passed to both by reference.
    ///
    /// # Complexity
    /// That of [`Condensation::new`](crate::linear::Condensation::new) and one solve for each load case.
    ///
    /// # Errors
    /// [`InputError::NotSymmetric`]; [`LinearError::NotPositiveDefinite`](crate::linear::LinearError::NotPositiveDefinite);
    /// failures of the solves.
    pub fn condensed(&self) -> Result<CondensedInterface<G>, PiecewiseError>
    where
        G: Clone,
    {
        if let Some((row, col, difference)) = self.operator.a.asymmetry(1e-10) {
            return Err(PiecewiseError::Input(InputError::NotSymmetric {
                what: "the operator A",
                row,
                col,
                difference,
            }));
        }
        let view = CondensedView::new(&self.operator)?;
        Interface::with_view(Arc::clone(&self.operator), view, self.law.clone())
    }
}
