use super::projection::Projection;
use super::{Polyhedron, VariationalError, Vi};
use crate::complementarity::{AffineFunction, McpFunction};
use crate::enumeration::{Completeness, Continuum, EnumerationOptions, all_solutions};
use crate::linear::null_space;
use crate::piecewise::{PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, max_abs};

/// Part of the largest entry of a kernel vector below which another one counts as zero, and of (x, λ, μ) below which two x are one.
const SAME: f64 = 1e-9;

/// All solutions of an affine variational inequality.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ViSolutions {
    /// The isolated x, whether their multipliers are unique or not.
    pub solutions: Vec<Vec<f64>>,
    /// Continua along which x changes, in the variables (x, λ, μ).
    pub continua: Vec<Continuum>,
    /// Whether all selections of the Karush–Kuhn–Tucker conditions were examined, and with what certainty. That multipliers alone change
    /// along a continuum is decided in floating-point numbers.
    pub completeness: Completeness,
}

impl<F: McpFunction> Vi<F> {
    /// All solutions of the problem with affine F, by [`all_solutions`] of the conditions [`Vi::kkt`].
    ///
    /// # Complexity
    /// Exponential in the number of inequalities and bounds in the worst case; the search is pruned and keeps the limits of its options.
    ///
    /// # Errors
    /// As [`all_solutions`]: F that is not affine, a parametric problem, options out of range.
    pub fn all_solutions(&self, options: &EnumerationOptions) -> Result<ViSolutions, VariationalError> {
        let conditions = self.kkt()?;
        let n = self.set().dimension();
        let found = all_solutions(&conditions, 0.0, options)?;
        let mut all = ViSolutions {
            solutions: Vec::new(),
            continua: Vec::new(),
            completeness: found.completeness,
        };
        for solution in &found.solutions {
            all.insert(&solution.x[..n], max_abs(&solution.x));
        }
        let affine = conditions.function().coefficients();
        for continuum in found.continua {
            let point = match affine {
                Some((f, _)) => self.only_multipliers(&conditions, f, &continuum)?,
                None => None,
            };
            match point {
                Some(point) => all.insert(&point[..n], max_abs(&point)),
                None => all.continua.push(continuum),
            }
        }
        Ok(all)
    }

    /// A point (x, λ, μ) of a continuum along which only multipliers change.
    fn only_multipliers(
        &self,
        conditions: &impl PiecewiseSmooth,
        f: &AffineFunction,
        continuum: &Continuum,
    ) -> Result<Option<Vec<f64>>, VariationalError> {
        let n = self.set().dimension();
        let mut point = None;
        for selection in &continuum.selections {
            let mut jac = Matrix::zeros(conditions.pattern());
            conditions.jacobian(selection, &vec![0.0; conditions.num_vars()], &mut jac);
            let Ok(kernel) = null_space(&jac, SAME) else {
                return Ok(None);
            };
            let fixed = |v: &Vec<f64>| max_abs(&v[..n]) <= SAME * max_abs(v);
            if !kernel.right.iter().all(fixed) {
                return Ok(None);
            }
            let cell = self.cell(selection, f)?;
            match cell.project(&vec![0.0; conditions.num_vars()]) {
                Ok(Projection::Nearest(nearest)) => point = Some(nearest.x),
                _ => return Ok(None),
            }
        }
        Ok(point)
    }

    /// The polyhedron of the points (x, λ, μ) that solve the conditions in a selection.
    fn cell(&self, selection: &Selection, f: &AffineFunction) -> Result<Polyhedron, VariationalError> {
        let conditions = self.kkt()?;
        let (mut lower, mut upper) = (conditions.lower().to_vec(), conditions.upper().to_vec());
        let (n, mut equal, mut less) = (lower.len(), Vec::new(), Vec::new());
        for i in 0..n {
            match &*conditions.piece_name(i, selection.piece(i)) {
                "interior" => equal.push((i, 1.0)),
                "lower" => {
                    upper[i] = lower[i];
                    less.push((i, -1.0));
                }
                "upper" => {
                    lower[i] = upper[i];
                    less.push((i, 1.0));
                }
                _ => {}
            }
        }
        let rows = |list: &[(usize, f64)]| -> Result<(Matrix, Vec<f64>), VariationalError> {
            let mut entries = Vec::new();
            let mut place = vec![None; n];
            for (row, (i, sign)) in list.iter().enumerate() {
                place[*i] = Some((row, *sign));
            }
            for (i, j, v) in f.matrix().triplets() {
                if let Some((row, sign)) = place[i] {
                    entries.push((row, j, sign * v));
                }
            }
            let right = list.iter().map(|(i, sign)| -sign * f.q()[*i]).collect();
            Ok((Matrix::from_triplets(list.len(), n, &entries)?, right))
        };
        let ((e, d), (a, b)) = (rows(&equal)?, rows(&less)?);
        Polyhedron::boxed(lower, upper)?
            .with_equations(e, d)?
            .with_inequalities(a, b)
    }
}

impl ViSolutions {
    /// Keeps x, found with multipliers of a size, unless it is known.
    fn insert(&mut self, x: &[f64], size: f64) {
        let same = |y: &Vec<f64>| {
            let apart: Vec<f64> = y.iter().zip(x).map(|(a, b)| a - b).collect();
            max_abs(&apart) <= SAME * size
        };
        if !self.solutions.iter().any(same) {
            self.solutions.push(x.to_vec());
        }
    }
}
