use super::Multipliers;
use crate::complementarity::ComplementarityError;
use crate::input::{check_length, check_vector};
use crate::sparse::Matrix;

/// The polyhedron C = {x ∈ ℝⁿ: A x ≤ b, E x = d, l ≤ x ≤ u}.
///
/// ```
/// use semismooth::sparse::Matrix;
/// use semismooth::variational::{Polyhedron, Projection};
/// // The simplex x ≥ 0, x₁ + x₂ + x₃ = 1.
/// let simplex = Polyhedron::boxed(vec![0.0; 3], vec![f64::INFINITY; 3])?
///     .with_equations(Matrix::from_rows(&[[1.0, 1.0, 1.0]])?, vec![1.0])?;
/// let Projection::Nearest(nearest) = simplex.project(&[1.0, 0.5, -3.0])? else { panic!("it is not empty") };
/// assert!((nearest.x[0] - 0.75).abs() < 1e-15 && nearest.x[2] == 0.0);
/// # Ok::<(), semismooth::complementarity::ComplementarityError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Polyhedron {
    pub(super) a: Rows,
    pub(super) e: Rows,
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
}

/// The entries (column, value) of a row, and its right-hand side.
pub(crate) type Row = (Vec<(usize, f64)>, f64);

/// Rows of a matrix as columns of its transpose, with right-hand sides.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rows {
    pub(super) transposed: Matrix,
    pub(super) right: Vec<f64>,
}

impl Rows {
    fn none(n: usize) -> Result<Self, ComplementarityError> {
        Ok(Self {
            transposed: Matrix::from_triplets(n, 0, &[])?,
            right: Vec::new(),
        })
    }

    fn new(
        names: [&'static str; 2],
        n: usize,
        matrix: &Matrix,
        right: Vec<f64>,
    ) -> Result<Self, ComplementarityError> {
        check_length(names[0], matrix.ncols(), n)?;
        matrix.check_finite()?;
        check_vector(names[1], &right, matrix.nrows())?;
        Ok(Self {
            transposed: matrix.transpose(),
            right,
        })
    }

    pub(super) fn len(&self) -> usize {
        self.right.len()
    }

    /// Entries (column, value) of row i.
    pub(super) fn row(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let pattern = self.transposed.pattern();
        let span = pattern.col_ptr()[i]..pattern.col_ptr()[i + 1];
        let values = &self.transposed.values()[span.clone()];
        pattern.row_idx()[span]
            .iter()
            .copied()
            .zip(values.iter().copied())
    }

    /// The value of row i at x.
    pub(super) fn at(&self, i: usize, x: &[f64]) -> f64 {
        self.row(i).map(|(j, v)| v * x[j]).sum()
    }
}

impl Polyhedron {
    /// All of ℝⁿ.
    ///
    /// # Errors
    /// n = 0.
    pub fn space(n: usize) -> Result<Self, ComplementarityError> {
        Self::boxed(vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n])
    }

    /// The box l ≤ x ≤ u; −∞ and +∞ where there is no bound.
    ///
    /// # Errors
    /// No variables, bounds of different lengths, NaN among them, lᵢ = +∞, uᵢ = −∞. Where lᵢ > uᵢ the box is empty, which is no error.
    pub fn boxed(lower: Vec<f64>, upper: Vec<f64>) -> Result<Self, ComplementarityError> {
        let n = lower.len();
        if n == 0 {
            return Err(ComplementarityError::Empty);
        }
        check_length("the upper bounds", upper.len(), n)?;
        for (what, bounds, wrong, free) in [
            ("lower", &lower, f64::INFINITY, "-inf"),
            ("upper", &upper, f64::NEG_INFINITY, "+inf"),
        ] {
            if let Some(index) = bounds.iter().position(|b| b.is_nan() || *b == wrong) {
                let value = bounds[index];
                return Err(ComplementarityError::Bound {
                    what,
                    index,
                    value,
                    free,
                });
            }
        }
        Ok(Self {
            a: Rows::none(n)?,
            e: Rows::none(n)?,
            lower,
            upper,
        })
    }

    /// Replaces the inequalities by A x ≤ b, A of shape m × n.
    ///
    /// # Errors
    /// Shapes that do not fit, numbers that are not finite.
    pub fn with_inequalities(mut self, a: Matrix, b: Vec<f64>) -> Result<Self, ComplementarityError> {
        self.a = Rows::new(["a row of A", "b"], self.lower.len(), &a, b)?;
        Ok(self)
    }

    /// Replaces the equations by E x = d, E of shape k × n. They may be linearly dependent.
    ///
    /// # Errors
    /// Shapes that do not fit, numbers that are not finite.
    pub fn with_equations(mut self, e: Matrix, d: Vec<f64>) -> Result<Self, ComplementarityError> {
        self.e = Rows::new(["a row of E", "d"], self.lower.len(), &e, d)?;
        Ok(self)
    }

    /// Number n of variables.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.lower.len()
    }

    /// Number m of inequalities A x ≤ b, bounds not among them.
    #[must_use]
    pub fn num_inequalities(&self) -> usize {
        self.a.len()
    }

    /// Number k of equations E x = d.
    #[must_use]
    pub fn num_equations(&self) -> usize {
        self.e.len()
    }

    /// Lower bounds.
    #[must_use]
    pub fn lower(&self) -> &[f64] {
        &self.lower
    }

    /// Upper bounds.
    #[must_use]
    pub fn upper(&self) -> &[f64] {
        &self.upper
    }

    /// The largest violation of an inequality, an equation or a bound by x, each divided by the Euclidean norm of its row; 0 in C.
    ///
    /// # Errors
    /// x of the wrong length or not finite.
    pub fn violation(&self, x: &[f64]) -> Result<f64, ComplementarityError> {
        check_vector("x", x, self.dimension())?;
        let distance = |rows: &Rows, i: usize, excess: f64| {
            let size = rows.row(i).map(|(_, v)| v * v).sum::<f64>().sqrt();
            if excess == 0.0 { 0.0 } else { excess / size }
        };
        let a = (0..self.a.len()).map(|i| distance(&self.a, i, (self.a.at(i, x) - self.a.right[i]).max(0.0)));
        let e = (0..self.e.len()).map(|i| distance(&self.e, i, (self.e.at(i, x) - self.e.right[i]).abs()));
        let bounds = (0..x.len()).map(|j| (self.lower[j] - x[j]).max(x[j] - self.upper[j]));
        let worst = |m: f64, v: f64| if v <= m { m } else { v };
        Ok(a.chain(e).chain(bounds).fold(0.0, worst))
    }

    /// The rows of A x ≤ b with b, then those of E x = d with d, each by its entries (column, value).
    pub(crate) fn rows(&self) -> [Vec<Row>; 2] {
        [&self.a, &self.e].map(|rows| {
            (0..rows.len())
                .map(|i| (rows.row(i).collect(), rows.right[i]))
                .collect()
        })
    }

    /// Adds the normal with these multipliers, Aᵀλ + Eᵀμ − ρₗ + ρᵤ, and returns the sum of their products with the slacks at x.
    pub(crate) fn add_normal(&self, x: &[f64], multipliers: &Multipliers, out: &mut [f64]) -> f64 {
        let mut products = 0.0;
        for (i, w) in multipliers.inequalities.iter().enumerate() {
            self.a.row(i).for_each(|(j, v)| out[j] += w * v);
            products += w * (self.a.right[i] - self.a.at(i, x)).max(0.0);
        }
        for (i, w) in multipliers.equations.iter().enumerate() {
            self.e.row(i).for_each(|(j, v)| out[j] += w * v);
        }
        for j in 0..x.len() {
            let (l, u) = (multipliers.lower[j], multipliers.upper[j]);
            out[j] += u - l;
            products += if l > 0.0 { l * (x[j] - self.lower[j]) } else { 0.0 };
            products += if u > 0.0 { u * (self.upper[j] - x[j]) } else { 0.0 };
        }
        products
    }
}
