//! Whether a convex combination of regular matrices is singular.

use super::orientation::sign_of;
use super::regularity::Element;
use super::{PiecewiseError, Selection, Selections};
use crate::linear::{AutoSolver, LinearError, LinearSolver, eigenvalues, symmetric_eigenvalues};
use crate::sparse::{Matrix, Pattern};
use crate::spread::Random;
use crate::tolerances::{CHECKED, DENSE, DOUBTFUL, HALF_DIGITS, SAME};

/// Eigenvalues within this angle of the negative half-line may lie on it: rounding moves fourfold ones by the fourth root of its size.
const ON_AXIS: f64 = 1e-3;

/// Random combinations tried.
const RANDOM: u64 = 300;

/// What is known of the convex hull of some matrices.
pub(super) enum Hull {
    /// All of it is regular.
    Regular,
    /// The combination with these weights (of sum 1) has a determinant of another sign than the element `from`.
    Crossing { from: usize, weights: Vec<f64> },
    /// Neither is known.
    Open,
}

/// What is known of the hull of regular matrices; those marked as not certain may not belong to the set.
pub(super) fn search(elements: &[Element], cap: u64) -> Result<Hull, PiecewiseError> {
    let [first, rest @ ..] = elements else {
        return Ok(Hull::Regular);
    };
    if rest.is_empty() {
        return Ok(Hull::Regular);
    }
    // Without signs nothing below applies.
    let Some(sign) = first.sign.filter(|_| elements.iter().all(|e| e.sign.is_some())) else {
        return Ok(Hull::Open);
    };
    let certain = || (0..elements.len()).filter(|&k| elements[k].certain);
    if let Some(one) = certain().next()
        && let Some(other) = certain().find(|&k| elements[k].sign != elements[one].sign)
    {
        let mut weights = vec![0.0; elements.len()];
        weights[other] = 1.0;
        return Ok(Hull::Crossing { from: one, weights });
    }
    if elements.iter().any(|e| e.sign != Some(sign)) {
        return Ok(Hull::Open);
    }
    let transposed: Vec<Matrix> = elements.iter().map(|e| e.matrix.transpose()).collect();
    if mixtures(elements.iter().map(|e| &e.matrix), sign, cap)? || mixtures(transposed.iter(), sign, cap)? {
        return Ok(Hull::Regular);
    }
    if first.matrix.nrows() > DENSE {
        return Ok(Hull::Open);
    }
    if definite(elements)? {
        return Ok(Hull::Regular);
    }
    segments(elements, sign, cap)
}

/// Whether all matrices whose rows are each taken from any of the given ones have determinants of one sign, which the given ones have.
/// The given matrices are distinct.
fn mixtures<'m>(
    matrices: impl Iterator<Item = &'m Matrix> + Clone,
    sign: i8,
    cap: u64,
) -> Result<bool, PiecewiseError> {
    let Some(mut mixed) = matrices.clone().next().cloned() else {
        return Ok(true);
    };
    let n = mixed.nrows();
    // Positions of the entries of each row, and its different values.
    let mut places: Vec<Vec<usize>> = vec![Vec::new(); n];
    mixed
        .pattern()
        .row_idx()
        .iter()
        .enumerate()
        .for_each(|(k, &i)| places[i].push(k));
    let mut rows: Vec<Vec<Vec<f64>>> = vec![Vec::new(); n];
    let mut count = 0_u128;
    for m in matrices {
        count += 1;
        for (row, places) in rows.iter_mut().zip(&places) {
            let values: Vec<f64> = places.iter().map(|&k| m.values()[k]).collect();
            if !row.contains(&values) {
                row.push(values);
            }
        }
    }
    let choices = rows.iter().enumerate().filter(|r| r.1.len() > 1);
    let choices = choices.map(|(i, row)| (i, (0..row.len()).collect())).collect();
    let all = Selections::new(Selection::uniform(n, 0), choices);
    // Each of them is a matrix given, whose sign is known.
    if all.total() == Some(count) {
        return Ok(true);
    }
    if all.total().is_none_or(|t| t > u128::from(cap)) {
        return Ok(false);
    }
    let mut solver = AutoSolver::default();
    solver.analyze(mixed.as_ref().pattern)?;
    for choice in all {
        for (i, places) in places.iter().enumerate() {
            for (&k, v) in places.iter().zip(&rows[i][choice.piece(i)]) {
                mixed.values_mut()[k] = *v;
            }
        }
        if sign_of(&mut solver, &mixed, n, DOUBTFUL)? != Some(sign) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// A⁻¹ B as a full matrix, and the reciprocal condition of A; `None` where it is inaccurate by rounding.
fn quotient(a: &Matrix, b: &Matrix) -> Result<Option<(Matrix, f64)>, PiecewiseError> {
    let n = a.nrows();
    let mut solver = AutoSolver::default();
    solver.analyze(a.as_ref().pattern)?;
    let mut columns = vec![0.0; n * n];
    b.triplets().for_each(|(i, j, v)| columns[j * n + i] += v);
    let solved = solver
        .factor(a.as_ref())
        .and_then(|()| solver.solve_in_place(&mut columns));
    match solved {
        Ok(()) => {}
        Err(LinearError::Singular { .. } | LinearError::Inaccurate { .. }) => return Ok(None),
        Err(e) => return Err(e.into()),
    }
    let rcond = solver.rcond().unwrap_or(0.0);
    Ok(Matrix::from_values(Pattern::full(n, n), columns)
        .ok()
        .map(|quotient| (quotient, rcond)))
}

/// A B, A and the product full matrices, and a bound of the rounding in a row or a column of it.
fn times(a: &Matrix, b: &Matrix) -> (Matrix, f64) {
    let n = a.nrows();
    let mut product = Matrix::zeros(Pattern::full(n, n));
    let mut sizes = vec![0.0; n * n];
    for (k, j, v) in b.triplets() {
        let entries = product.values_mut()[j * n..].iter_mut().zip(&mut sizes[j * n..]);
        for ((entry, size), a) in entries.zip(&a.values()[k * n..(k + 1) * n]) {
            *entry += a * v;
            *size += (a * v).abs();
        }
    }
    let column = |j: usize| sizes[j * n..(j + 1) * n].iter().sum::<f64>();
    let row = |i: usize| sizes.iter().skip(i).step_by(n).sum::<f64>();
    let largest = (0..n).fold(0.0_f64, |m, k| m.max(column(k)).max(row(k)));
    (product, 2.0 * (n as f64 + 2.0) * f64::EPSILON * largest)
}

/// Whether the computed inverse of their mean makes the symmetric parts of all products with the matrices definite.
fn definite(elements: &[Element]) -> Result<bool, PiecewiseError> {
    let n = elements[0].matrix.nrows();
    let mut mean = elements[0].matrix.clone();
    mix(elements, &vec![1.0; elements.len()], &mut mean);
    let Some((inverse, _)) = quotient(&mean, &Matrix::identity(n))? else {
        return Ok(false);
    };
    for e in elements {
        let (mut product, rounding) = times(&inverse, &e.matrix);
        let transposed = product.transpose();
        let entries = product.values_mut().iter_mut().zip(transposed.values());
        entries.for_each(|(v, t)| *v = 0.5 * (*v + t));
        let values = symmetric_eigenvalues(&product)?;
        let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let positive = values.iter().all(|v| *v > CHECKED * largest + rounding);
        if !positive {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Looks for a determinant of the other sign on the segment between any two of the matrices, and then at random combinations. (1 − t) A + t
/// B is singular exactly where A⁻¹B has the eigenvalue −(1 − t)/t.
fn segments(elements: &[Element], sign: i8, cap: u64) -> Result<Hull, PiecewiseError> {
    let pairs = (0..elements.len()).flat_map(|j| (0..j).map(move |i| [i, j]));
    let mut mixture = Mixture::new(elements)?;
    for ([i, j], _) in pairs.zip(0..cap) {
        let (a, b) = (&elements[i], &elements[j]);
        let Some((product, rcond)) = quotient(&a.matrix, &b.matrix)? else {
            continue;
        };
        let values = eigenvalues(&product)?;
        let largest = values.iter().fold(0.0_f64, |m, z| m.max(z.0.hypot(z.1)));
        let on_axis = |(re, im): &(f64, f64)| *re < 0.0 && im.abs() <= ON_AXIS * re.abs();
        // Small eigenvalues may have any angle, and the angles of a quotient of matrices of bad condition are rounding.
        let clear = |z: &(f64, f64)| !on_axis(z) && z.0.hypot(z.1) > SAME * largest;
        if elements.len() == 2 && rcond > HALF_DIGITS && values.iter().all(clear) {
            return Ok(Hull::Regular);
        }
        let mut shares: Vec<f64> = (values.iter().filter(|&z| on_axis(z)))
            .map(|(re, _)| 1.0 / (1.0 - re))
            .collect();
        if !(a.certain && b.certain) {
            continue;
        }
        shares.sort_by(f64::total_cmp);
        for w in shares.windows(2) {
            let share = 0.5 * (w[0] + w[1]);
            let mut weights = vec![0.0; elements.len()];
            (weights[i], weights[j]) = (1.0 - share, share);
            if mixture.sign(&weights, DOUBTFUL)? == Some(-sign) {
                return Ok(Hull::Crossing { from: i, weights });
            }
        }
    }
    let Some(from) = elements.iter().position(|e| e.certain) else {
        return Ok(Hull::Open);
    };
    let mut random = Random::new(7);
    for _ in 0..cap.min(RANDOM) {
        let mut weights: Vec<f64> = elements.iter().map(|e| f64::from(u8::from(e.certain))).collect();
        // Uniform in the simplex.
        weights
            .iter_mut()
            .for_each(|w| *w *= -(0.5 - 0.5 * random.symmetric()).max(f64::MIN_POSITIVE).ln());
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|w| *w /= sum);
        if mixture.sign(&weights, DOUBTFUL)? == Some(-sign) {
            return Ok(Hull::Crossing { from, weights });
        }
    }
    Ok(Hull::Open)
}

/// Convex combinations of matrices over one pattern.
struct Mixture<'a> {
    elements: &'a [Element],
    mixed: Matrix,
    solver: AutoSolver,
}

impl<'a> Mixture<'a> {
    fn new(elements: &'a [Element]) -> Result<Self, PiecewiseError> {
        let mixed = elements[0].matrix.clone();
        let mut solver = AutoSolver::default();
        solver.analyze(mixed.as_ref().pattern)?;
        Ok(Self {
            elements,
            mixed,
            solver,
        })
    }

    fn sign(&mut self, weights: &[f64], singular: f64) -> Result<Option<i8>, PiecewiseError> {
        mix(self.elements, weights, &mut self.mixed);
        let n = self.mixed.nrows();
        sign_of(&mut self.solver, &self.mixed, n, singular)
    }
}

/// Σ w A over elements A and their weights w.
pub(super) fn mix(elements: &[Element], weights: &[f64], mixed: &mut Matrix) {
    mixed.clear();
    for (e, w) in elements.iter().zip(weights).filter(|e| *e.1 != 0.0) {
        let entries = mixed.values_mut().iter_mut().zip(e.matrix.values());
        entries.for_each(|(m, v)| *m += w * v);
    }
}
