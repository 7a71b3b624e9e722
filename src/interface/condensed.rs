use std::sync::Arc;

use super::load::{Factors, add};
use super::view::FullView;
use super::{CondensedInterface, Interface, InterfaceProblem};
use crate::input::check_vector;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection, check_selection};
use crate::sparse::Matrix;

impl<G: PiecewiseSmooth> CondensedInterface<G> {
    /// The compliance C = B A⁻¹ Bᵀ, q × q.
    #[must_use]
    pub fn compliance(&self) -> &Matrix {
        self.view.condensation().compliance()
    }

    /// The problem in full form.
    ///
    /// # Errors
    /// None in practice; patterns are checked again.
    pub fn full(&self) -> Result<InterfaceProblem<G>, PiecewiseError>
    where
        G: Clone,
    {
        Interface::with_view(Arc::clone(&self.operator), FullView, self.law.clone())
    }

    /// The traces v = B A⁻¹ f without multipliers, at the parameters α[, β].
    ///
    /// # Errors
    /// No parameter, values that are not finite.
    pub fn free_traces(&self, parameters: &[f64]) -> Result<Vec<f64>, PiecewiseError> {
        check_vector("the list of parameters", parameters, self.num_parameters())?;
        let mut x = vec![0.0; self.num_vars()];
        x[self.num_residuals()..].copy_from_slice(parameters);
        self.traces(&x)
    }

    /// The tangent (u̇, λ̇, α̇) of the full form that corresponds to the direction `t` at `x`: one solve. It is not normalised.
    ///
    /// # Errors
    /// Wrong lengths, values that are not finite.
    pub fn expand_tangent(&self, x: &[f64], t: &[f64]) -> Result<Vec<f64>, PiecewiseError> {
        let q = self.num_traces();
        check_vector("x", x, self.num_vars())?;
        check_vector("the tangent", t, self.num_vars())?;
        let mut u = vec![0.0; self.num_displacements()];
        // Factors of its own: those of the workspace belong to the point evaluated last.
        let load = &self.operator.load;
        let mut factors = Factors::new(load);
        factors.set(load, &x[q..]);
        if load.base().is_none() {
            let (mut f, mut rate) = (vec![0.0; u.len()], vec![0.0; u.len()]);
            load.general(x[q], &mut f, &mut rate);
            add(t[q], &rate, &mut u);
        }
        for (k, case) in load.parts().enumerate() {
            add(factors.rate[k] * t[q + load.slot(k)], case.forces(), &mut u);
        }
        self.view.condensation().expand(&t[..q], &mut u)?;
        u.extend_from_slice(t);
        Ok(u)
    }

    /// The residual of the full form at the point that corresponds to x, in the given selection: n rows of equilibrium, q of the law.
    ///
    /// # Errors
    /// As [`expand`](Self::expand); selections of other maps.
    pub fn full_residual(&self, selection: &Selection, x: &[f64]) -> Result<Vec<f64>, PiecewiseError> {
        check_selection("the selection", selection, self)?;
        let point = self.expand(x)?;
        let (n, q) = (self.num_displacements(), self.num_traces());
        let mut out = vec![0.0; n + q];
        self.with_scratch(|s| {
            self.parts().equilibrium(&point, s, &mut out[..n]);
            self.parts().law_point(x, s);
            self.law.residual(selection, &s.z, &mut out[n..]);
        });
        Ok(out)
    }

    /// ln det A, the difference between the logarithms of the determinants of the full and the condensed form.
    #[must_use]
    pub fn log_det_operator(&self) -> f64 {
        self.view.condensation().log_det()
    }
}
