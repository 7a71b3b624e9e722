//! Problems with known solutions.

use crate::dense::eliminate;
use crate::maps::{one_piece, two_pieces};
use semismooth::piecewise::{PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

/// min(C x, R (M C x + q)) = 0 with exact Jacobian; R and C are units of rows and columns.
#[derive(Debug, Clone)]
pub(crate) struct Lcp {
    pub(crate) m: Vec<Vec<f64>>,
    pub(crate) q: Vec<f64>,
    pub(crate) row: Vec<f64>,
    pub(crate) col: Vec<f64>,
}

impl Lcp {
    pub(crate) fn new(m: Vec<Vec<f64>>, q: Vec<f64>) -> Self {
        let n = q.len();
        Self {
            m,
            q,
            row: vec![1.0; n],
            col: vec![1.0; n],
        }
    }

    pub(crate) fn w(&self, x: &[f64], i: usize) -> f64 {
        let products = self.m[i].iter().zip(x).zip(&self.col);
        products.map(|((m, x), c)| m * x * c).sum::<f64>() + self.q[i]
    }

    /// All solutions by enumeration of the 2ⁿ bases.
    pub(crate) fn enumerate(&self) -> Vec<Vec<f64>> {
        let n = self.q.len();
        let mut found = Vec::new();
        for basis in 0..1_u32 << n {
            let (mut a, mut b) = (vec![vec![0.0; n]; n], vec![0.0; n]);
            for i in 0..n {
                if basis >> i & 1 == 1 {
                    a[i].copy_from_slice(&self.m[i]);
                    b[i] = -self.q[i];
                } else {
                    a[i][i] = 1.0;
                }
            }
            if let (_, 1e-13.., Some(x)) = eliminate(&a, &b)
                && (0..n).all(|i| x[i] >= -1e-12 && self.w(&x, i) >= -1e-12)
            {
                found.push(x);
            }
        }
        found
    }
}

impl PiecewiseSmooth for Lcp {
    two_pieces!(
        self,
        [positive, negative],
        self.q.len(),
        self.q.len(),
        self.q.len()
    );
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for i in 0..x.len() {
            out[i] = self.w(x, i) - x[i] * self.col[i];
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        for i in 0..x.len() {
            out[i] = self.row[i] * [x[i] * self.col[i], self.w(x, i)][s.piece(i)];
        }
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        for i in 0..x.len() {
            if s.piece(i) == 0 {
                jac.add(i, i, self.row[i] * self.col[i]);
            } else {
                for j in 0..x.len() {
                    jac.add(i, j, self.row[i] * self.m[i][j] * self.col[j]);
                }
            }
        }
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
}

/// A smooth equation in one or more variables by closures.
pub(crate) struct Smooth<F, J> {
    pub(crate) n: usize,
    pub(crate) f: F,
    pub(crate) j: J,
}

impl<F: Fn(&[f64], &mut [f64]), J: Fn(&[f64], &mut Matrix)> PiecewiseSmooth for Smooth<F, J> {
    one_piece!(self, self.n, self.n);
    fn residual(&self, _: &Selection, x: &[f64], out: &mut [f64]) {
        (self.f)(x, out);
    }
    fn jacobian(&self, _: &Selection, x: &[f64], jac: &mut Matrix) {
        (self.j)(x, jac);
    }
}

pub(crate) fn scalar(f: impl Fn(f64) -> f64, d: impl Fn(f64) -> f64) -> impl PiecewiseSmooth {
    Smooth {
        n: 1,
        f: move |x: &[f64], out: &mut [f64]| out[0] = f(x[0]),
        j: move |x: &[f64], jac: &mut Matrix| jac.add(0, 0, d(x[0])),
    }
}

/// B Bᵀ + skew + a positive diagonal: positive definite, hence P, and not symmetric.
pub(crate) fn p_matrix(n: usize, entries: &[f64], shift: f64) -> Vec<Vec<f64>> {
    let b = |i: usize, j: usize| entries[(i * n + j) % entries.len()];
    let mut m = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..n {
            m[i][j] = (0..n).map(|k| b(i, k) * b(j, k)).sum::<f64>();
            m[i][j] += b(i, j) - b(j, i);
        }
        m[i][i] += shift;
    }
    m
}

pub(crate) fn close(a: &[f64], b: &[f64], tolerance: f64) -> bool {
    let size = b.iter().fold(1.0, |m: f64, v| m.max(v.abs()));
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance * size)
}

/// A P-matrix on which full steps visit three bases in turn: each step solves the wrong pair of the three equations.
pub(crate) fn cycling() -> Lcp {
    let m = vec![vec![1.0, 0.0, 4.0], vec![4.0, 1.0, 0.0], vec![0.0, 4.0, 1.0]];
    Lcp::new(m, vec![-1.0; 3])
}
