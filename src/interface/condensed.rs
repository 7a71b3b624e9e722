use std::borrow::Cow;

use super::error::check_vector;
use super::full::sites_of_law;
use super::{InterfaceError, InterfaceLoad, InterfaceProblem, fill_sizes};
use crate::linear::{Condensation, LinearError};
use crate::piecewise::{Facet, PiecewiseSmooth, Selection, check_selection};
use crate::sparse::{Matrix, Pattern, dot};

/// An [`InterfaceProblem`] condensed onto its multipliers: x = (λ, α), q + 1 variables.
///
/// v(λ, α) = B A⁻¹ f(α) − C λ, and the residuals are those of the law, G(v(λ, α), λ, α). One Cholesky factorisation of A and a solve
/// for each load case at construction; evaluations cost O(q²) afterwards. With J the Jacobian of the full form and j that of this one,
/// det ∇_yJ = det A · det ∇_λj: signs agree.
#[derive(Debug)]
pub struct CondensedInterface<G> {
    problem: InterfaceProblem<G>,
    condensation: Condensation,
    free: Vec<f64>,
    free_cases: Vec<Vec<f64>>,
    pattern: Pattern,
}

impl<G: PiecewiseSmooth> CondensedInterface<G> {
    /// Condenses a problem.
    ///
    /// # Errors
    /// [`InterfaceError::NotSymmetric`]; [`LinearError::NotPositiveDefinite`]; failures of the solves.
    pub fn new(problem: InterfaceProblem<G>) -> Result<Self, InterfaceError> {
        if let Some((row, col, difference)) = problem.a.asymmetry(1e-10) {
            return Err(InterfaceError::NotSymmetric { row, col, difference });
        }
        let condensation = Condensation::new(&problem.a, &problem.b)?;
        let free = condensation.traces_of_solution(&problem.load.constant)?;
        let free_cases = problem
            .load
            .cases
            .iter()
            .map(|f| condensation.traces_of_solution(f))
            .collect::<Result<_, LinearError>>()?;
        let q = problem.num_traces();
        Ok(Self {
            problem,
            condensation,
            free,
            free_cases,
            pattern: Pattern::full(q, q + 1),
        })
    }

    /// The problem in full form.
    #[must_use]
    pub fn full(&self) -> &InterfaceProblem<G> {
        &self.problem
    }

    /// The compliance C = B A⁻¹ Bᵀ, q × q.
    #[must_use]
    pub fn compliance(&self) -> &Matrix {
        self.condensation.compliance()
    }

    /// The point (u, λ, α) of the full form: one solve.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn expand(&self, x: &[f64]) -> Result<Vec<f64>, InterfaceError> {
        let q = self.num_residuals();
        check_vector("the length of x", q + 1, x)?;
        let mut u = self.problem.load_at(x[q]);
        self.condensation.expand(&x[..q], &mut u)?;
        u.extend_from_slice(x);
        Ok(u)
    }

    /// The tangent (u̇, λ̇, α̇) of the full form that belongs to the direction `t` at `x`: one solve. It is not of unit length.
    ///
    /// # Errors
    /// Wrong lengths, values that are not finite.
    pub fn expand_tangent(&self, x: &[f64], t: &[f64]) -> Result<Vec<f64>, InterfaceError> {
        let q = self.num_residuals();
        check_vector("the length of x", q + 1, x)?;
        check_vector("the length of the tangent", q + 1, t)?;
        let load = &self.problem.load;
        let mut u = vec![0.0; self.problem.num_displacements()];
        self.problem.with_scratch(|s| {
            load.amplitudes(x[q], &mut s.amplitudes, &mut s.rates);
            s.rates.iter_mut().for_each(|r| *r *= t[q]);
            InterfaceLoad::accumulate(&load.cases, &s.rates, &mut u);
        });
        self.condensation.expand(&t[..q], &mut u)?;
        u.extend_from_slice(t);
        Ok(u)
    }

    /// The residual of the full form at the point that belongs to x, in the given selection: n rows of equilibrium, q of the law.
    ///
    /// # Errors
    /// As [`expand`](Self::expand); selections of other maps.
    pub fn full_residual(&self, selection: &Selection, x: &[f64]) -> Result<Vec<f64>, InterfaceError> {
        check_selection("the selection", selection, &self.problem)?;
        let full = self.expand(x)?;
        let mut out = vec![0.0; self.problem.num_residuals()];
        self.problem.residual(selection, &full, &mut out);
        Ok(out)
    }

    /// The point (λ, α) of the condensed form.
    ///
    /// # Errors
    /// Wrong length, values that are not finite.
    pub fn restrict(&self, full: &[f64]) -> Result<Vec<f64>, InterfaceError> {
        check_vector("the length of the full point", self.problem.num_vars(), full)?;
        Ok(full[self.problem.num_displacements()..].to_vec())
    }

    /// ln det A, by which logarithms of determinants of the full form exceed those of this one.
    #[must_use]
    pub fn log_det_operator(&self) -> f64 {
        self.condensation.log_det()
    }

    /// z = (v, λ, α), and dv/dα.
    fn law_point(&self, x: &[f64], s: &mut super::full::Scratch) {
        let q = self.num_residuals();
        let load = &self.problem.load;
        load.amplitudes(x[q], &mut s.amplitudes, &mut s.rates);
        InterfaceLoad::combine(&self.free, &self.free_cases, &s.amplitudes, &mut s.z[..q]);
        s.drift.fill(0.0);
        InterfaceLoad::accumulate(&self.free_cases, &s.rates, &mut s.drift);
        for (v, row) in
            s.z.iter_mut()
                .zip(self.compliance().values().chunks_exact(q.max(1)))
        {
            *v -= dot(row, x);
        }
        s.z[q..].copy_from_slice(x);
    }
}

impl<G: PiecewiseSmooth + Clone> Clone for CondensedInterface<G> {
    fn clone(&self) -> Self {
        Self {
            problem: self.problem.clone(),
            condensation: self.condensation.clone(),
            free: self.free.clone(),
            free_cases: self.free_cases.clone(),
            pattern: self.pattern.clone(),
        }
    }
}

impl<G: PiecewiseSmooth> PiecewiseSmooth for CondensedInterface<G> {
    sites_of_law!(problem.law);

    fn num_vars(&self) -> usize {
        self.num_residuals() + 1
    }

    fn num_residuals(&self) -> usize {
        self.problem.num_traces()
    }

    fn pattern(&self) -> Pattern {
        self.pattern.clone()
    }

    fn is_piecewise_affine(&self) -> bool {
        self.problem.is_piecewise_affine()
    }

    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        self.problem.law.site_rows(site, rows);
    }

    fn typical_sizes(&self, sizes: &mut [f64]) {
        fill_sizes(self.problem.sizes(), 0, sizes);
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.problem.with_scratch(|s| {
            self.law_point(x, s);
            self.problem.law.test_functions(&s.z, out);
        });
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        self.problem.with_scratch(|s| {
            self.law_point(x, s);
            self.problem.law.residual(selection, &s.z, out);
        });
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let q = self.num_residuals();
        let compliance = self.compliance().values();
        let full = jac.pattern().is_full();
        self.problem.with_scratch(|s| {
            self.law_point(x, s);
            s.jac.clear();
            self.problem.law.jacobian(selection, &s.z, &mut s.jac);
            for (i, k, v) in s.jac.triplets() {
                if k >= q {
                    jac.add(i, k - q, v);
                } else if v != 0.0 {
                    let row = &compliance[k * q..(k + 1) * q];
                    if full {
                        for (column, c) in jac.values_mut().chunks_exact_mut(q).zip(row) {
                            column[i] -= v * c;
                        }
                    } else {
                        for (j, c) in row.iter().enumerate() {
                            jac.add(i, j, -v * c);
                        }
                    }
                    jac.add(i, q, v * s.drift[k]);
                }
            }
        });
    }

    fn test_derivatives(&self, x: &[f64], d: &[f64], out: &mut [f64]) {
        let q = self.num_residuals();
        self.problem.with_scratch(|s| {
            self.law_point(x, s);
            let rows = self.compliance().values().chunks_exact(q.max(1));
            for ((dv, drift), row) in s.dz.iter_mut().zip(&s.drift).zip(rows) {
                *dv = d[q] * drift - dot(row, d);
            }
            s.dz[q..].copy_from_slice(d);
            self.problem.law.test_derivatives(&s.z, &s.dz, out);
        });
    }

    fn test_gradient(&self, site: usize, test: usize, x: &[f64], gradient: &mut [f64]) {
        let q = self.num_residuals();
        self.problem.with_scratch(|s| {
            self.law_point(x, s);
            self.problem.law.test_gradient(site, test, &s.z, &mut s.dz);
            gradient.copy_from_slice(&s.dz[q..]);
            for (k, &g) in s.dz[..q].iter().enumerate().filter(|g| *g.1 != 0.0) {
                let row = &self.compliance().values()[k * q..(k + 1) * q];
                for (o, c) in gradient.iter_mut().zip(row) {
                    *o -= g * c;
                }
                gradient[q] += g * s.drift[k];
            }
        });
    }
}
