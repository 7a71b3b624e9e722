//! Symmetric matrices as vectors, and functions of their eigenvalues with derivatives (D. Sun, J. Sun, Math. Oper. Res. 27 (2002)).

use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};

use nalgebra::{DMatrix, DVector};

use crate::InputError;
use crate::complementarity::ComplementarityError;
use crate::sparse::max_abs;
use crate::tolerances::{STEPS, SUM};

/// Part of the largest eigenvalue of a root below which one is lost in the rounding of squares.
const SEPARATE: f64 = 1e-4;

/// The upper triangle of a symmetric matrix column by column, off-diagonal entries times √2: (x₁₁, √2 x₁₂, x₂₂, √2 x₁₃, …), so that the
/// scalar product of two such vectors is the trace of the product of the matrices. Only the upper triangle is read.
///
/// # Errors
/// [`InputError::Length`] for a row that is not as long as the matrix has rows.
///
/// ```
/// use semismooth::cones::{svec, smat};
/// let x = svec(&[[2.0, -1.0], [-1.0, 3.0]])?;
/// assert_eq!(x, [2.0, -std::f64::consts::SQRT_2, 3.0]);
/// assert!((smat(&x)?[1][0] + 1.0).abs() < 1e-15);
/// # Ok::<(), semismooth::complementarity::ComplementarityError>(())
/// ```
pub fn svec<R: AsRef<[f64]>>(rows: &[R]) -> Result<Vec<f64>, ComplementarityError> {
    let order = rows.len();
    if let Some(row) = rows.iter().find(|r| r.as_ref().len() != order) {
        return Err(ComplementarityError::Input(InputError::Length {
            what: "a row of the symmetric matrix",
            expected: order,
            found: row.as_ref().len(),
        }));
    }
    let entry = |(i, j): (usize, usize)| rows[i].as_ref()[j] * weight(i, j);
    Ok(triangle(order).map(entry).collect())
}

/// The rows of the symmetric matrix of a vector as [`svec`] makes it.
///
/// # Errors
/// [`InputError::Length`] where the length is not k (k + 1)/2 for some order k.
pub fn smat(x: &[f64]) -> Result<Vec<Vec<f64>>, ComplementarityError> {
    let order = (0..)
        .take_while(|k| k * (k + 1) / 2 <= x.len())
        .last()
        .unwrap_or(0);
    if order * (order + 1) / 2 != x.len() {
        return Err(ComplementarityError::Input(InputError::Length {
            what: "the vector of a symmetric matrix of the next larger order",
            expected: (order + 1) * (order + 2) / 2,
            found: x.len(),
        }));
    }
    let mut rows = vec![vec![0.0; order]; order];
    for ((i, j), v) in triangle(order).zip(x) {
        rows[i][j] = v / weight(i, j);
        rows[j][i] = rows[i][j];
    }
    Ok(rows)
}

/// Rows and columns of the upper triangle, column by column.
fn triangle(order: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..order).flat_map(|j| (0..=j).map(move |i| (i, j)))
}

fn weight(i: usize, j: usize) -> f64 {
    if i == j { 1.0 } else { SQRT_2 }
}

fn matrix(order: usize, x: &[f64]) -> DMatrix<f64> {
    let mut m = DMatrix::zeros(order, order);
    for ((i, j), v) in triangle(order).zip(x) {
        let v = if i == j { *v } else { v * FRAC_1_SQRT_2 };
        (m[(i, j)], m[(j, i)]) = (v, v);
    }
    m
}

fn write(m: &DMatrix<f64>, out: &mut [f64]) {
    for ((i, j), out) in triangle(m.nrows()).zip(out) {
        *out = 0.5 * (m[(i, j)] + m[(j, i)]) * weight(i, j);
    }
}

/// Eigenvalues and eigenvectors, as columns; `None` where they cannot be computed.
fn eigen(mut m: DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let largest = max_abs(m.as_slice());
    if largest == 0.0 {
        return Some((DVector::zeros(m.nrows()), DMatrix::identity(m.nrows(), m.nrows())));
    }
    // The decomposition may not end for numbers that are not finite, and squares them.
    if !m.iter().all(|v| v.is_finite()) {
        return None;
    }
    let half = (0.5 * largest.log2()).round();
    let (down, up) = ((-half).exp2(), half.exp2());
    m.iter_mut().for_each(|v| *v = *v * down * down);
    let sweeps = STEPS * m.nrows();
    let found = m.try_symmetric_eigen(f64::EPSILON, sweeps)?;
    let values = found.eigenvalues.map(|v| v * up * up);
    let finite = |m: &[f64]| m.iter().all(|v| v.is_finite());
    (finite(values.as_slice()) && finite(found.eigenvectors.as_slice()))
        .then_some((values, found.eigenvectors))
}

/// Q diag(f(λ)) Qᵀ.
fn spectral(values: &DVector<f64>, q: &DMatrix<f64>, f: impl Fn(f64) -> f64) -> DMatrix<f64> {
    let mut scaled = q.clone();
    for (mut column, &v) in scaled.column_iter_mut().zip(values.iter()) {
        column *= f(v);
    }
    scaled * q.transpose()
}

/// Moves x to the nearest positive semidefinite matrix: negative eigenvalues become zero.
pub(super) fn project(order: usize, x: &mut [f64]) {
    let Some((values, q)) = eigen(matrix(order, x)) else {
        return x.fill(f64::NAN);
    };
    // A matrix in the cone is left unchanged, to the last bit.
    if values.iter().any(|v| *v < 0.0) {
        write(&spectral(&values, &q, |v| v.max(0.0)), x);
    }
}

/// An element of the B-subdifferential of the projection at z, row by row: H ↦ Q (Ω ∘ QᵀHQ) Qᵀ.
pub(super) fn projection_derivative(order: usize, z: &[f64], out: &mut [f64]) {
    let Some((values, q)) = eigen(matrix(order, z)) else {
        return out.fill(f64::NAN);
    };
    // The divided differences of max(λ, 0); those of zero are the limits from below.
    let omega = DMatrix::from_fn(order, order, |i, j| {
        let (a, b) = (values[i].max(values[j]), values[i].min(values[j]));
        if b > 0.0 {
            1.0
        } else if a > 0.0 {
            a / (a - b)
        } else {
            0.0
        }
    });
    let rows = q.transpose();
    columns(&q, |_, _| &rows, 0.5, &omega, |at, image| out[at] = image);
}

/// X + Y − (X² + Y² + 2 μ² I)^½.
pub(super) fn smoothed(order: usize, mu: f64, x: &[f64], y: &[f64], out: &mut [f64]) {
    let [a, b] = [x, y].map(|v| matrix(order, v));
    let Some((roots, q)) = root(mu, &a, &b) else {
        return out.fill(f64::NAN);
    };
    write(&(a + b - spectral(&roots, &q, |v| v)), out);
}

/// Its derivatives by X and by Y: H ↦ H − Q ((Qᵀ(XH + HX)Q)ᵢⱼ / (zᵢ + zⱼ)) Qᵀ, z the eigenvalues of the root.
///
/// Where X² + Y² is singular and μ = 0 they are limits along (X + t I, Y + t `rate`), t ↓ 0: on the kernel N, which both map to 0, the root
/// is t S^½ + o(t) with S = G_XᵀG_X + G_YᵀG_Y, G the rates of XQ and YQ there, and S ⪰ I.
pub(super) fn smoothed_derivatives(
    order: usize,
    mu: f64,
    [x, y]: [&[f64]; 2],
    rate: Option<&[f64]>,
    by: [&mut [f64]; 2],
) {
    let [a, b] = [x, y].map(|v| matrix(order, v));
    let rate = rate.map_or_else(|| DMatrix::zeros(order, order), |v| matrix(order, v));
    let Some((mut roots, mut q)) = root(mu, &a, &b) else {
        return by.into_iter().for_each(|by| by.fill(f64::NAN));
    };
    let (largest, n) = (roots.max(), x.len());
    if largest <= f64::MIN_POSITIVE {
        // The derivative is the same all along the ray from the origin.
        let (mut one, mut along) = (vec![0.0; n], vec![0.0; n]);
        unit(order, &mut one);
        write(&rate, &mut along);
        return smoothed_derivatives(order, 0.0, [&one, &along], None, by);
    }
    let range = roots
        .iter()
        .filter(|z| **z > SUM * order as f64 * largest)
        .count();
    let mut limits = [DMatrix::zeros(0, 0), DMatrix::zeros(0, 0)];
    let mut slopes = roots.clone();
    if range < order {
        let kernel = q.columns(range, order - range).into_owned();
        let moved = &b * &rate * &kernel;
        let mut turned = q.columns(0, range).transpose() * moved;
        for (mut row, z) in turned.row_iter_mut().zip(roots.iter()) {
            row /= -z * z;
        }
        let turned = q.columns(0, range) * turned;
        let rates = [&kernel + &a * &turned, &rate * &kernel + &b * &turned];
        let squares = rates[0].transpose() * &rates[0] + rates[1].transpose() * &rates[1];
        let Some((squares, turn)) = eigen(squares) else {
            return by.into_iter().for_each(|by| by.fill(f64::NAN));
        };
        q.columns_mut(range, order - range).copy_from(&(kernel * &turn));
        for (k, s) in squares.iter().enumerate() {
            (roots[range + k], slopes[range + k]) = (0.0, s.sqrt());
        }
        limits = rates.map(|g| {
            let mut rows = DMatrix::zeros(order, order);
            rows.rows_mut(range, order - range)
                .copy_from(&(g * &turn).transpose());
            rows
        });
    }
    let weights = DMatrix::from_fn(order, order, |i, j| {
        let z = if i.min(j) >= range { &slopes } else { &roots };
        (z[i] + z[j]).recip()
    });
    for ((m, by), limits) in [a, b].into_iter().zip(by).zip(limits) {
        let mut rows = q.transpose() * m;
        rows.rows_mut(range, order - range).fill(0.0);
        let rows = |i: usize, j: usize| if i.min(j) >= range { &limits } else { &rows };
        columns(&q, rows, 1.0, &weights, |at, image| {
            by[at] = f64::from(u8::from(at % (n + 1) == 0)) - image;
        });
    }
}

/// ½ (A B + B A).
pub(super) fn product(order: usize, a: &[f64], b: &[f64], out: &mut [f64]) {
    write(&(matrix(order, a) * matrix(order, b)), out);
}

/// The unit matrix.
pub(super) fn unit(order: usize, out: &mut [f64]) {
    for ((i, j), v) in triangle(order).zip(out) {
        *v = f64::from(u8::from(i == j));
    }
}

/// Eigenvalues, from the largest on, and eigenvectors of (X² + Y² + 2 μ² I)^½. Those small beside the largest are recomputed on their
/// invariant subspace, from XQ and YQ, so that they are not square roots of rounding errors.
fn root(mu: f64, x: &DMatrix<f64>, y: &DMatrix<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
    let order = x.nrows();
    let (mut values, mut q) = (DVector::zeros(order), DMatrix::identity(order, order));
    let mut first = 0;
    while first < order {
        let part = q.columns(first, order - first).into_owned();
        let (of_x, of_y) = (x * &part, y * &part);
        let (found, turn) = eigen(of_x.transpose() * of_x + of_y.transpose() * of_y)?;
        let mut by_size: Vec<usize> = (0..found.len()).collect();
        by_size.sort_by(|a, b| found[*b].total_cmp(&found[*a]));
        for (k, &at) in by_size.iter().enumerate() {
            values[first + k] = found[at].max(0.0).sqrt();
            q.set_column(first + k, &(&part * turn.column(at)));
        }
        let least = SEPARATE * values[first];
        first += 1 + (first + 1..order).take_while(|k| values[*k] > least).count();
    }
    Some((values.map(|s| s.hypot(SQRT_2 * mu)), q))
}

/// The matrix (n × n) of H ↦ Q (W ∘ (R H Q + (R H Q)ᵀ)) Qᵀ times a factor, entry by entry with its place; R may depend on the entry of W.
fn columns<'m>(
    q: &DMatrix<f64>,
    rows: impl Fn(usize, usize) -> &'m DMatrix<f64>,
    factor: f64,
    weights: &DMatrix<f64>,
    mut write: impl FnMut(usize, f64),
) {
    let order = q.nrows();
    let n = order * (order + 1) / 2;
    let (mut inner, mut half, mut image) = (
        DMatrix::zeros(order, order),
        DMatrix::zeros(order, order),
        DMatrix::zeros(order, order),
    );
    let across = q.transpose();
    for (column, (a, b)) in triangle(order).enumerate() {
        // H is e_a e_aᵀ, or (e_a e_bᵀ + e_b e_aᵀ)/√2.
        let size = if a == b {
            0.5 * factor
        } else {
            factor * FRAC_1_SQRT_2
        };
        for j in 0..order {
            for i in 0..=j {
                let rows = rows(i, j);
                let sum = rows[(i, a)] * q[(b, j)]
                    + rows[(i, b)] * q[(a, j)]
                    + q[(b, i)] * rows[(j, a)]
                    + q[(a, i)] * rows[(j, b)];
                let value = size * weights[(i, j)] * sum;
                (inner[(i, j)], inner[(j, i)]) = (value, value);
            }
        }
        q.mul_to(&inner, &mut half);
        half.mul_to(&across, &mut image);
        for (row, (i, j)) in triangle(order).enumerate() {
            write(row * n + column, image[(i, j)] * weight(i, j));
        }
    }
}

/// The scaling of Nesterov and Todd between X and Y inside of the cone: RᵀXR = R⁻¹YR⁻ᵀ = Λ, diagonal, and W z = Rᵀ Z R.
#[derive(Debug, Clone)]
pub(super) struct MatrixScaling {
    r: DMatrix<f64>,
    inverse: DMatrix<f64>,
    /// R Rᵀ: WᵀW z = R Rᵀ Z R Rᵀ.
    square: DMatrix<f64>,
    lambda: DVector<f64>,
    /// Rows and columns of the entries of a vector.
    places: Vec<(usize, usize)>,
}

impl MatrixScaling {
    pub(super) fn identity(order: usize) -> Self {
        let one = DMatrix::identity(order, order);
        Self {
            r: one.clone(),
            inverse: one.clone(),
            square: one,
            lambda: DVector::from_element(order, 1.0),
            places: triangle(order).collect(),
        }
    }

    pub(super) fn order(&self) -> usize {
        self.lambda.len()
    }

    /// From X = K Kᵀ, Y = L Lᵀ and Lᵀ K = U Λ Vᵀ: R = L U Λ^(−½), R⁻¹ = Λ^(−½) Vᵀ Kᵀ (M. Todd, K. Toh, R. Tütüncü, 1998). `false` where
    /// X or Y is not inside to working precision.
    pub(super) fn between(&mut self, x: &[f64], y: &[f64]) -> bool {
        let order = self.order();
        let factor = |v: &[f64]| matrix(order, v).cholesky().map(|c| c.unpack());
        let (Some(k), Some(l)) = (factor(x), factor(y)) else {
            return false;
        };
        let product = l.transpose() * &k;
        if !product.iter().all(|v| v.is_finite()) {
            return false;
        }
        let Some(svd) = product.try_svd_unordered(true, true, f64::EPSILON, STEPS * order) else {
            return false;
        };
        let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
            return false;
        };
        self.lambda = svd.singular_values;
        let half = DMatrix::from_diagonal(&self.lambda.map(|s| s.sqrt().recip()));
        self.r = l * u * &half;
        self.inverse = half * v_t * k.transpose();
        self.square = &self.r * self.r.transpose();
        let finite = |m: &DMatrix<f64>| m.iter().all(|v| v.is_finite());
        finite(&self.square) && finite(&self.inverse)
    }

    fn congruence(&self, left: &DMatrix<f64>, z: &[f64], out: &mut [f64]) {
        write(&(left * matrix(self.order(), z) * left.transpose()), out);
    }

    /// W z.
    pub(super) fn apply(&self, z: &[f64], out: &mut [f64]) {
        self.congruence(&self.r.transpose(), z, out);
    }

    /// Wᵀ z.
    pub(super) fn apply_transposed(&self, z: &[f64], out: &mut [f64]) {
        self.congruence(&self.r, z, out);
    }

    /// W⁻ᵀ z.
    pub(super) fn apply_inverse_transposed(&self, z: &[f64], out: &mut [f64]) {
        self.congruence(&self.inverse, z, out);
    }

    /// out − WᵀW z.
    pub(super) fn subtract_square(&self, z: &[f64], out: &mut [f64]) {
        let mut image = vec![0.0; z.len()];
        self.congruence(&self.square, z, &mut image);
        out.iter_mut().zip(&image).for_each(|(o, v)| *o -= v);
    }

    /// Entry (i, j) of WᵀW.
    pub(super) fn square(&self, i: usize, j: usize) -> f64 {
        let ((a, b), (c, d), w) = (self.places[i], self.places[j], &self.square);
        0.5 * weight(a, b) * weight(c, d) * (w[(a, c)] * w[(b, d)] + w[(a, d)] * w[(b, c)])
    }

    /// Overwrites b by z with Λ ∘ z = b, A ∘ B = (AB + BA)/2.
    pub(super) fn divide(&self, b: &mut [f64]) {
        for (b, &(i, j)) in b.iter_mut().zip(&self.places) {
            *b /= 0.5 * (self.lambda[i] + self.lambda[j]);
        }
    }

    /// z + s I.
    pub(super) fn add_unit(&self, s: f64, z: &mut [f64]) {
        let diagonal = z.iter_mut().zip(&self.places).filter(|e| e.1.0 == e.1.1);
        diagonal.for_each(|(z, _)| *z += s);
    }

    /// A ∘ B.
    pub(super) fn product(&self, a: &[f64], b: &[f64], out: &mut [f64]) {
        let [a, b] = [a, b].map(|v| matrix(self.order(), v));
        write(&(a * b), out);
    }

    /// Largest t ≤ 1 with Z + t D in the cone, for Z inside.
    pub(super) fn reach(&self, z: &[f64], d: &[f64]) -> f64 {
        let [z, d] = [z, d].map(|v| matrix(self.order(), v));
        let Some(l) = z.cholesky().map(|c| c.unpack()) else {
            return 0.0;
        };
        let half = l.solve_lower_triangular(&d).map(|h| h.transpose());
        let inner = half.and_then(|h| l.solve_lower_triangular(&h));
        match inner.and_then(eigen) {
            Some((values, _)) if values.min() < -1.0 => -values.min().recip(),
            Some(_) => 1.0,
            None => 0.0,
        }
    }

    /// Lifts the eigenvalues of Z to at least `inside`.
    pub(super) fn lift(&self, inside: f64, z: &mut [f64]) {
        if let Some((values, _)) = eigen(matrix(self.order(), z)) {
            self.add_unit((inside - values.min()).max(0.0), z);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::sparse::{dot, norm};

    proptest! {
        /// z = P(z) − P(−z) with both parts semidefinite and orthogonal; derivatives are those of differences, where there are any.
        #[test]
        fn projections_and_roots(r in prop::collection::vec(-3.0..3.0_f64, 30), order in 1..5_usize, mu in 0.1..2.0_f64) {
            let n = order * (order + 1) / 2;
            let (x, y, d) = (&r[..n], &r[10..10 + n], &r[20..20 + n]);
            let (mut plus, mut minus) = (x.to_vec(), x.iter().map(|v| -v).collect::<Vec<_>>());
            project(order, &mut plus);
            project(order, &mut minus);
            prop_assert!(dot(&plus, &minus).abs() < 1e-12);
            for i in 0..n {
                prop_assert!((plus[i] - minus[i] - x[i]).abs() < 1e-12);
            }
            let least = |v: &[f64]| eigen(matrix(order, v)).unwrap().0.min();
            prop_assert!(least(&plus) > -1e-13 && least(&minus) > -1e-13);
            let along = |f: &dyn Fn(&[f64], &mut [f64]), v: &[f64]| -> Vec<f64> {
                let at = |s: f64| {
                    let moved: Vec<f64> = v.iter().zip(d).map(|(v, d)| v + s * d).collect();
                    let mut out = vec![0.0; n];
                    f(&moved, &mut out);
                    out
                };
                let (p, m) = (at(1e-5), at(-1e-5));
                p.iter().zip(&m).map(|(p, m)| (p - m) / 2e-5).collect()
            };
            let times = |m: &[f64]| -> Vec<f64> { m.chunks(n).map(|row| dot(row, d)).collect() };
            let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
            let eigenvalues = eigen(matrix(order, x)).unwrap().0;
            let (mut by_x, mut by_y) = (vec![0.0; n * n], vec![0.0; n * n]);
            if eigenvalues.iter().all(|v| v.abs() > 1e-2) {
                projection_derivative(order, x, &mut by_x);
                let quotient = along(&|v, out| { out.copy_from_slice(v); project(order, out); }, x);
                prop_assert!(near(&times(&by_x), &quotient));
            }
            smoothed_derivatives(order, mu, [x, y], None, [&mut by_x, &mut by_y]);
            prop_assert!(near(&times(&by_x), &along(&|v, out| smoothed(order, mu, v, y, out), x)));
            prop_assert!(near(&times(&by_y), &along(&|v, out| smoothed(order, mu, x, v, out), y)));
            // It vanishes exactly where X Y = μ² I, both definite.
            let mut inside = plus.clone();
            triangle(order).zip(&mut inside).filter(|((i, j), _)| i == j).for_each(|(_, v)| *v += 0.5);
            let inverse = matrix(order, &inside).try_inverse().unwrap() * (mu * mu);
            let mut image = vec![0.0; n];
            write(&inverse, &mut image);
            let mut out = vec![0.0; n];
            smoothed(order, mu, &inside, &image, &mut out);
            prop_assert!(norm(&out) < 1e-10 * (1.0 + norm(&image)));
        }
    }

    proptest! {
        /// W x = W⁻ᵀ y = Λ, WᵀW x = y; division undoes the product; the reach ends on the boundary.
        #[test]
        fn scalings_of_matrices(r in prop::collection::vec(-2.0..2.0_f64, 30), order in 1..5_usize) {
            let n = order * (order + 1) / 2;
            let mut scaling = MatrixScaling::identity(order);
            let inside = |r: &[f64]| {
                let mut z = r[..n].to_vec();
                scaling.lift(0.3, &mut z);
                z
            };
            let (x, y, d) = (inside(&r), inside(&r[10..]), &r[20..20 + n]);
            prop_assert!(scaling.between(&x, &y));
            let near = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
            let (mut left, mut right) = (vec![0.0; n], vec![0.0; n]);
            scaling.apply(&x, &mut left);
            scaling.apply_inverse_transposed(&y, &mut right);
            prop_assert!(near(&left, &right));
            let mut lambda = vec![0.0; n];
            write(&DMatrix::from_diagonal(&scaling.lambda), &mut lambda);
            prop_assert!(near(&left, &lambda));
            let rows: Vec<f64> = (0..n).map(|i| (0..n).map(|j| scaling.square(i, j) * x[j]).sum()).collect();
            prop_assert!(near(&rows, &y));
            let mut rest = y.clone();
            scaling.subtract_square(&x, &mut rest);
            prop_assert!(near(&rest, &vec![0.0; n]));
            // ⟨W d, x⟩ = ⟨d, Wᵀ x⟩.
            scaling.apply(d, &mut left);
            scaling.apply_transposed(&x, &mut right);
            prop_assert!((dot(&left, &x) - dot(d, &right)).abs() < 1e-9);
            scaling.product(&lambda, d, &mut left);
            scaling.divide(&mut left);
            prop_assert!(near(&left, d));
            let t = scaling.reach(&x, d);
            let at: Vec<f64> = x.iter().zip(d).map(|(x, d)| x + t * d).collect();
            let least = eigen(matrix(order, &at)).unwrap().0.min();
            prop_assert!(least > -1e-9 && (t == 1.0 || least < 1e-9));
        }
    }

    #[test]
    fn what_is_not_finite_stays_so() {
        let mut x = [f64::NAN, 0.0, 1.0];
        project(2, &mut x);
        assert!(x.iter().all(|v| v.is_nan()));
        let mut huge = [-1e300, 1e300, 1e300];
        project(2, &mut huge);
        assert!(huge.iter().all(|v| v.is_finite()));
    }
}
