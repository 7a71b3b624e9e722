//! The derivative of one selection's solutions, on factors that are kept.

use super::SensitivityError;
use crate::InputError;
use crate::input::check_vector;
use crate::linear::{AutoSolver, LinearError, LinearSolver, least_singular_value};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection, square};
use crate::sparse::Matrix;
use crate::spread::Random;
use crate::tolerances::{DENSE, VALUE};

/// Random errors with which the rounding of all terms is propagated, and the factor from the largest result to
/// a bound: with fewer or smaller ones, terms that happen to cancel would be taken for certain.
const PROBES: usize = 4;
const ALLOWANCE: f64 = 16.0;
/// A width in units of |J⁻¹| |(J, ∂_θH)| |d|.
pub(super) const WIDTH: f64 = ALLOWANCE * VALUE;

/// An element of the generalised derivative of the solutions x(θ): the derivative −J⁻¹ ∂_θH (n × k) of the
/// solutions of one selection, J being its ∂_xH. It is kept as factors of J, so that products cost one solve
/// each.
#[derive(Debug, Clone)]
pub struct Element {
    selection: Selection,
    /// (J, ∂_θH), n × (n + k).
    jacobian: Matrix,
    solver: AutoSolver,
}

impl Element {
    pub(super) fn new(
        map: &dyn PiecewiseSmooth,
        at: &[f64],
        selection: &Selection,
    ) -> Result<Self, SensitivityError> {
        let mut jacobian = Matrix::zeros(map.pattern());
        derivatives(map, at, selection, &mut jacobian)?;
        let mut solver = AutoSolver::new();
        let leading = jacobian.leading_columns(map.num_residuals());
        solver.analyze(leading.pattern)?;
        match solver.factor(leading) {
            Ok(()) => {}
            Err(LinearError::Singular { rcond }) => return Err(irregular(selection, &jacobian, rcond)),
            Err(e) => return Err(e.into()),
        }
        Ok(Self {
            selection: selection.clone(),
            jacobian,
            solver,
        })
    }

    /// The selection σ.
    #[must_use]
    pub fn selection(&self) -> &Selection {
        &self.selection
    }

    /// The product with a change δ of the parameters (length k): the change of the solution to first order
    /// (length n).
    ///
    /// # Errors
    /// A wrong length, values that are not finite; a solve whose residual is not small.
    pub fn jvp(&mut self, delta: &[f64]) -> Result<Vec<f64>, SensitivityError> {
        let n = self.jacobian.nrows();
        check_vector("the change of the parameters", delta, self.jacobian.ncols() - n)?;
        Ok(rate(&self.jacobian, &mut self.solver, delta)?)
    }

    /// The product of the transpose with w (length n), the gradient of a function of the solution: its
    /// gradient in the parameters (length k).
    ///
    /// # Errors
    /// As [`jvp`](Self::jvp).
    pub fn vjp(&mut self, w: &[f64]) -> Result<Vec<f64>, SensitivityError> {
        let n = self.jacobian.nrows();
        check_vector("the gradient in the unknowns", w, n)?;
        let mut adjoint = w.to_vec();
        self.solver.solve_transpose_in_place(&mut adjoint)?;
        let mut all = vec![0.0; self.jacobian.ncols()];
        self.jacobian.as_ref().mul_transpose_add(-1.0, &adjoint, &mut all);
        let gradient = all.split_off(n);
        finite(&gradient)?;
        Ok(gradient)
    }

    /// The matrix, n × k: one solve for each parameter.
    ///
    /// # Errors
    /// A solve whose residual is not small; more entries than fit into memory.
    pub fn matrix(&mut self) -> Result<Matrix, SensitivityError> {
        let (n, m) = (self.jacobian.nrows(), self.jacobian.ncols());
        let mut entries = Vec::new();
        let mut delta = vec![0.0; m - n];
        for j in 0..m - n {
            delta[j] = 1.0;
            let column = rate(&self.jacobian, &mut self.solver, &delta)?;
            delta[j] = 0.0;
            entries.extend(column.iter().enumerate().map(|(i, v)| (i, j, *v)));
        }
        Ok(Matrix::from_triplets(n, m - n, &entries).map_err(LinearError::from)?)
    }

    pub(super) fn rcond(&mut self) -> f64 {
        self.solver.rcond().unwrap_or(1.0)
    }

    /// The Newton step −J⁻¹ r.
    pub(super) fn step(&mut self, r: &[f64]) -> Result<Vec<f64>, LinearError> {
        let mut step: Vec<f64> = r.iter().map(|r| -r).collect();
        self.solver.solve_in_place(&mut step)?;
        Ok(step)
    }

    pub(super) fn widths(&mut self, d: &[f64]) -> Result<Vec<f64>, LinearError> {
        widths(&self.jacobian, &mut self.solver, d)
    }

    pub(super) fn known(&mut self, v: Vec<f64>, delta: &[f64]) -> Result<Known, LinearError> {
        Known::new(&self.jacobian, &mut self.solver, v, delta)
    }

    /// The same with the roundings of the derivatives themselves, whose terms may cancel: by how much they differ in the last bits of (x, θ).
    pub(super) fn known_at(
        &mut self,
        map: &dyn PiecewiseSmooth,
        at: &[f64],
        v: Vec<f64>,
        delta: &[f64],
    ) -> Result<Known, SensitivityError> {
        let mut d = v.clone();
        d.extend(delta);
        let mut known = self.known(v, delta)?;
        let (mut beside, mut spread) = (self.jacobian.clone(), Random::new(2));
        let mut terms = vec![0.0_f64; self.jacobian.nrows()];
        for _ in 0..PROBES {
            let moved: Vec<f64> = at.iter().map(|x| x + VALUE * spread.error() * x).collect();
            derivatives(map, &moved, &self.selection, &mut beside)?;
            let mut apart = vec![0.0; terms.len()];
            beside.as_ref().mul_add(1.0, &d, &mut apart);
            self.jacobian.as_ref().mul_add(-1.0, &d, &mut apart);
            terms.iter_mut().zip(apart).for_each(|(t, a)| *t = t.max(a.abs()));
        }
        terms.iter_mut().for_each(|t| *t /= VALUE);
        for (width, own) in known.widths.iter_mut().zip(moved(&mut self.solver, &terms)?) {
            *width += own;
        }
        Ok(known)
    }
}

/// A vector with what is known of the errors of its components.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Known {
    pub(crate) value: Vec<f64>,
    /// By how much roundings of the terms of each row may move them.
    pub(crate) widths: Vec<f64>,
    /// The same for the roundings of elimination, which are of the size of the largest terms of a row, in balanced units: they move
    /// components, too, that are exactly 0.
    pub(crate) floors: Vec<f64>,
}

impl Known {
    /// The zero v of J v + ∂_θH δ.
    pub(super) fn new(
        jacobian: &Matrix,
        solver: &mut AutoSolver,
        value: Vec<f64>,
        delta: &[f64],
    ) -> Result<Self, LinearError> {
        let n = jacobian.nrows();
        let mut d = value.clone();
        d.extend(delta);
        let mut rows = vec![0.0_f64; n];
        let own = || jacobian.triplets().filter(|t| t.1 < n && t.2 != 0.0);
        own().for_each(|(i, _, v)| rows[i] = rows[i].max(v.abs()));
        let mut columns = vec![0.0_f64; n];
        own().for_each(|(i, j, v)| columns[j] = columns[j].max(v.abs() / rows[i]));
        let largest = value
            .iter()
            .zip(&columns)
            .fold(0.0_f64, |m, (v, c)| m.max((v * c).abs()));
        rows.iter_mut().for_each(|r| *r *= largest);
        Ok(Self {
            widths: widths(jacobian, solver, &d)?,
            floors: moved(solver, &rows)?,
            value,
        })
    }
}

/// (∂_xH^σ, ∂_θH^σ), checked.
pub(super) fn derivatives(
    map: &dyn PiecewiseSmooth,
    at: &[f64],
    selection: &Selection,
    jacobian: &mut Matrix,
) -> Result<(), PiecewiseError> {
    jacobian.clear();
    map.jacobian(selection, at, jacobian);
    if let Some((row, col)) = jacobian.stray() {
        return Err(PiecewiseError::StrayEntry { row, col });
    }
    match jacobian.triplets().find(|t| !t.2.is_finite()) {
        Some((index, _, value)) => Err(PiecewiseError::Input(InputError::NotFinite {
            what: "the derivative of the equations, row ",
            index,
            value,
        })),
        None => Ok(()),
    }
}

/// −J⁻¹ ∂_θH δ from the factors of J.
pub(super) fn rate(
    jacobian: &Matrix,
    solver: &mut AutoSolver,
    delta: &[f64],
) -> Result<Vec<f64>, PiecewiseError> {
    let n = jacobian.nrows();
    let mut change = vec![0.0; n];
    change.extend(delta);
    let mut rate = vec![0.0; n];
    jacobian.as_ref().mul_add(-1.0, &change, &mut rate);
    solver.solve_in_place(&mut rate)?;
    finite(&rate)?;
    Ok(rate)
}

fn finite(v: &[f64]) -> Result<(), PiecewiseError> {
    Ok(check_vector("the derivative of the solution", v, v.len())?)
}

/// How far roundings of the terms of J v + ∂_θH δ, d = (v, δ), move its zero v, component by component: |J⁻¹|
/// |(J, ∂_θH)| |d| ε, from a few solves with random signs. Independent of the units of rows and variables.
pub(super) fn widths(jacobian: &Matrix, solver: &mut AutoSolver, d: &[f64]) -> Result<Vec<f64>, LinearError> {
    let mut terms = vec![0.0; jacobian.nrows()];
    jacobian.as_ref().add_term_sizes(d, &mut terms);
    moved(solver, &terms)
}

/// How far roundings of terms of these sizes in the rows move a solution.
fn moved(solver: &mut AutoSolver, terms: &[f64]) -> Result<Vec<f64>, LinearError> {
    let (mut widths, mut spread) = (vec![0.0_f64; terms.len()], Random::new(1));
    for _ in 0..PROBES {
        let mut moved: Vec<f64> = terms.iter().map(|t| VALUE * t * spread.error()).collect();
        solver.solve_in_place(&mut moved)?;
        for (w, v) in widths.iter_mut().zip(&moved) {
            *w = w.max(ALLOWANCE * v.abs());
        }
    }
    Ok(widths)
}

fn irregular(selection: &Selection, jacobian: &Matrix, rcond: f64) -> SensitivityError {
    let small = Some(jacobian).filter(|j| j.nrows() <= DENSE);
    let value = small.and_then(|j| least_singular_value(&square(j).ok()?).ok());
    SensitivityError::Irregular {
        selection: selection.clone(),
        rcond,
        singular_value: value.map(|(value, _)| value),
    }
}
