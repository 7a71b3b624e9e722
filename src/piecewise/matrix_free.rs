use super::Semismooth;
use crate::InputError;
use crate::linear::{LinearError, LinearOperator, Preconditioner};
use crate::sparse::Matrix;

/// A semismooth map H: ℝⁿ → ℝⁿ whose generalized Jacobians are available only as products with vectors.
///
/// [`NewtonKrylov`](crate::newton::NewtonKrylov) solves such maps. The products of the supertrait [`LinearOperator`], of order n, are those with
/// the element G of the generalized Jacobian chosen by the last [`linearize`](Self::linearize). [`Assembled`] makes such a map from one
/// with matrices.
///
/// ```
/// use semismooth::linear::LinearOperator;
/// use semismooth::newton::{NewtonError, NewtonKrylov};
/// use semismooth::piecewise::MatrixFree;
/// /// A string under the load 1 that softens where it is deflected by more than 0.1: −u″ − 5 (u − 0.1)₊ = 1.
/// struct Softening { h: f64, soft: Vec<bool> }
/// impl Softening {
///     fn differences(&self, u: &[f64], i: usize) -> f64 {
///         let at = |i: usize| u.get(i).copied().unwrap_or(0.0);
///         (2.0 * u[i] - at(i.wrapping_sub(1)) - at(i + 1)) / (self.h * self.h)
///     }
/// }
/// impl LinearOperator for Softening {
///     fn order(&self) -> usize { self.soft.len() }
///     fn product(&mut self, v: &[f64], y: &mut [f64]) {
///         for i in 0..v.len() {
///             y[i] = self.differences(v, i) - if self.soft[i] { 5.0 * v[i] } else { 0.0 };
///         }
///     }
/// }
/// impl MatrixFree for Softening {
///     fn residual(&mut self, u: &[f64], out: &mut [f64]) {
///         for i in 0..u.len() { out[i] = self.differences(u, i) - 5.0 * (u[i] - 0.1).max(0.0) - 1.0; }
///     }
///     fn linearize(&mut self, u: &[f64]) -> Result<(), semismooth::linear::LinearError> {
///         self.soft.iter_mut().zip(u).for_each(|(s, u)| *s = *u > 0.1);
///         Ok(())
///     }
/// }
/// let mut string = Softening { h: 1.0 / 64.0, soft: vec![false; 63] };
/// let mut u = vec![0.0; 63];
/// NewtonKrylov::default().solve(&mut string, &mut u)?;
/// let mut r = vec![0.0; 63];
/// string.residual(&u, &mut r);
/// assert!(u[31] > 0.1 && r.iter().all(|r| r.abs() < 1e-8));
/// # Ok::<(), NewtonError>(())
/// ```
pub trait MatrixFree: LinearOperator {
    /// The residual H(x), of length n.
    fn residual(&mut self, x: &[f64], out: &mut [f64]);

    /// Chooses an element G of the generalized (B- or Clarke) Jacobian at x for the products that follow, and prepares
    /// [`precondition`](LinearOperator::precondition).
    ///
    /// # Errors
    /// Failures of this preparation; they end the run.
    fn linearize(&mut self, x: &[f64]) -> Result<(), LinearError>;
}

/// A [`Semismooth`] map with a [`Preconditioner`], as a [`MatrixFree`] one.
///
/// ```
/// use semismooth::linear::IncompleteLu;
/// use semismooth::newton::{NewtonError, NewtonKrylov};
/// use semismooth::piecewise::{Assembled, Semismooth};
/// use semismooth::sparse::{Matrix, Pattern};
/// /// 4 xᵢ − xᵢ₋₁ − xᵢ₊₁ + |xᵢ| = 1.
/// struct Chain(usize);
/// impl Semismooth for Chain {
///     fn num_vars(&self) -> usize { self.0 }
///     fn pattern(&self) -> Pattern {
///         let near = |i: usize| (i.saturating_sub(1)..=(i + 1).min(self.0 - 1)).map(move |j| (i, j));
///         Pattern::from_entries(self.0, self.0, (0..self.0).flat_map(near)).unwrap()
///     }
///     fn residual(&self, x: &[f64], out: &mut [f64]) {
///         let at = |i: usize| x.get(i).copied().unwrap_or(0.0);
///         for i in 0..x.len() { out[i] = 4.0 * x[i] - at(i.wrapping_sub(1)) - at(i + 1) + x[i].abs() - 1.0; }
///     }
///     fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
///         for i in 0..x.len() {
///             jac.add(i, i, 4.0 + x[i].signum());
///             if i > 0 { jac.add(i, i - 1, -1.0); jac.add(i - 1, i, -1.0); }
///         }
///     }
/// }
/// let mut x = vec![-1.0; 500];
/// NewtonKrylov::default().solve(&mut Assembled::new(&Chain(500), IncompleteLu::default()), &mut x)?;
/// assert!((x[250] - 1.0 / 3.0).abs() < 1e-9);
/// # Ok::<(), NewtonError>(())
/// ```
#[derive(Debug)]
pub struct Assembled<'a, S: ?Sized, P> {
    map: &'a S,
    matrix: Matrix,
    preconditioner: P,
}

impl<'a, S: Semismooth + ?Sized, P: Preconditioner> Assembled<'a, S, P> {
    /// A map, and the preconditioner prepared with each of its matrices.
    pub fn new(map: &'a S, preconditioner: P) -> Self {
        Self {
            map,
            matrix: Matrix::zeros(map.pattern()),
            preconditioner,
        }
    }
}

impl<S: Semismooth + ?Sized, P: Preconditioner> LinearOperator for Assembled<'_, S, P> {
    fn order(&self) -> usize {
        self.map.num_vars()
    }

    fn product(&mut self, x: &[f64], y: &mut [f64]) {
        self.matrix.mul_vec(x, y);
    }

    fn transpose_product(&mut self, x: &[f64], y: &mut [f64]) -> bool {
        self.matrix.mul_transpose_vec(x, y);
        true
    }

    fn precondition(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.preconditioner.apply(b)
    }
}

impl<S: Semismooth + ?Sized, P: Preconditioner> MatrixFree for Assembled<'_, S, P> {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) {
        self.map.residual(x, out);
    }

    fn linearize(&mut self, x: &[f64]) -> Result<(), LinearError> {
        self.matrix.clear();
        self.map.jacobian(x, &mut self.matrix);
        let n = self.map.num_vars();
        if let Some((row, col)) = self.matrix.stray() {
            let what =
                format!("the Jacobian has an entry at ({row}, {col}), where the pattern of the map has none");
            return Err(LinearError::Solver { what });
        }
        if self.matrix.nrows() != n || self.matrix.ncols() != n {
            return Err(LinearError::Input(InputError::Length {
                what: "the pattern of the map (rows)",
                expected: n,
                found: self.matrix.nrows(),
            }));
        }
        self.preconditioner.prepare(self.matrix.as_ref())
    }
}
