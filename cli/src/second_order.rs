//! Whether a KKT point is a minimum: curvature of the Lagrangian on the null space of the gradients of active constraints.

use semismooth::complementarity::{BoundState, ConstraintKind, Program};
use semismooth::linear::{null_space, symmetric_eigenvalues};
use semismooth::sparse::Matrix;

use crate::program::Nlp;

/// Largest number of variables: eigenvalues are computed of dense matrices.
pub const MAX_VARIABLES: usize = 300;

/// Values of constraints, singular values and curvatures below this fraction of the largest count as zero.
const ZERO: f64 = 1e-6;

/// Multipliers below this fraction of the largest are not taken as positive: at singular solutions they are accurate to few digits only.
const STRONG: f64 = 1e-4;

/// Whether a KKT point satisfies the second-order conditions of a minimum.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SecondOrder {
    /// The sufficient conditions hold: no point nearby is as good.
    Strict,
    /// The necessary conditions do not hold: points nearby are better.
    Violated,
    /// Neither holds, there are too many variables, or the eigenvalues could not be computed.
    Undecided,
}

/// The gradients of active constraints and bounds, as rows.
#[derive(Debug, Clone, Default)]
struct Active {
    rows: Vec<Vec<f64>>,
}

impl Active {
    /// A basis of the null space of the gradients, and whether these are linearly independent.
    fn directions(&self, n: usize) -> Option<(Vec<Vec<f64>>, bool)> {
        let rows = self.rows.iter().enumerate();
        let entries = rows.flat_map(|(i, row)| row.iter().enumerate().map(move |(j, v)| (i, j, *v)));
        let entries: Vec<(usize, usize, f64)> = entries.collect();
        let matrix = Matrix::from_triplets(self.rows.len(), n, &entries).ok()?;
        let kernel = null_space(&matrix, ZERO).ok()?;
        let independent = kernel.right.len() + self.rows.len() == n;
        Some((kernel.right, independent))
    }
}

/// Tests the second-order conditions at a solution z = (x, y) of the first-order conditions; `f` are their values at z, `states` says which
/// components of z are at bounds.
#[must_use]
pub fn second_order(nlp: &Nlp<'_>, z: &[f64], f: &[f64], states: &[BoundState]) -> SecondOrder {
    match nlp.num_vars() <= MAX_VARIABLES {
        true => decide(nlp, z, f, states).unwrap_or(SecondOrder::Undecided),
        false => SecondOrder::Undecided,
    }
}

fn decide(nlp: &Nlp<'_>, z: &[f64], f: &[f64], states: &[BoundState]) -> Option<SecondOrder> {
    let n = nlp.num_vars();
    let (x, y) = z.split_at(n);
    let mut jac = Matrix::zeros(nlp.constraint_pattern());
    nlp.constraint_jacobian(x, &mut jac);
    let mut hessian = Matrix::zeros(nlp.hessian_pattern());
    nlp.hessian(x, y, &mut hessian);
    let mut gradients = vec![vec![0.0; n]; y.len()];
    jac.triplets().for_each(|(i, j, v)| gradients[i][j] += v);

    let largest = |values: &[f64]| values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let small = STRONG * (1.0 + largest(y).max(largest(&f[..n])));
    // Strongly active constraints and bounds (positive multiplier), and all active ones.
    let (mut strong, mut all) = (Active::default(), Active::default());
    let mut note = |row: Vec<f64>, is_strong: bool| {
        if is_strong {
            strong.rows.push(row.clone());
        }
        all.rows.push(row);
    };
    for j in 0..n {
        if states[j] != BoundState::Interior {
            let unit = (0..n).map(|k| f64::from(u8::from(k == j))).collect();
            note(unit, f[j].abs() > small || nlp.is_fixed(j));
        }
    }
    for (i, kind) in nlp.kinds().into_iter().enumerate() {
        let is_equation = kind == ConstraintKind::Zero;
        let active = f[n + i].abs() <= ZERO * (1.0 + largest(&gradients[i]));
        if is_equation || active {
            note(std::mem::take(&mut gradients[i]), is_equation || y[i] > small);
        }
    }
    let size = largest(hessian.values());
    let least = |directions: &[Vec<f64>]| {
        let reduced = Matrix::from_rows(&reduce(&hessian, directions)).ok()?;
        symmetric_eigenvalues(&reduced).ok()?.first().copied()
    };
    let (wide, _) = strong.directions(n)?;
    if wide.is_empty() || least(&wide)? > ZERO * size {
        return Some(SecondOrder::Strict);
    }
    let (narrow, independent) = all.directions(n)?;
    match independent && !narrow.is_empty() && least(&narrow)? < -ZERO * size {
        true => Some(SecondOrder::Violated),
        false => Some(SecondOrder::Undecided),
    }
}

/// ZᵀHZ.
fn reduce(hessian: &Matrix, directions: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let images = directions.iter().map(|v| {
        let mut image = vec![0.0; v.len()];
        hessian.mul_vec(v, &mut image);
        image
    });
    images
        .map(|image| directions.iter().map(|v| dot(v, &image)).collect())
        .collect()
}
