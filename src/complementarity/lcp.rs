use super::{AffineFunction, ComplementarityError, Mcp};
use crate::input::{check_length, check_vector};
use crate::sparse::Matrix;

/// The linear complementarity problem LCP(M, q), or with bounds the box LCP (affine variational inequality over a box).
///
/// Without bounds: find z ≥ 0 with w = M z + q ≥ 0 and zᵀw = 0. With bounds l ≤ z ≤ u (infinite, equal and absent ones included):
/// wᵢ ≥ 0 where zᵢ = lᵢ, wᵢ ≤ 0 where zᵢ = uᵢ, and wᵢ = 0 between; for lᵢ = uᵢ no condition on wᵢ.
///
/// It holds an affine [`Mcp`], and so is a piecewise-smooth map to Newton's method, enumeration and continuation:
///
/// ```
/// use semismooth::complementarity::Lcp;
/// use semismooth::enumeration::{EnumerationOptions, all_solutions};
/// use semismooth::sparse::Matrix;
/// // Two solutions: z = 0 and z = 1.
/// let lcp = Lcp::new(Matrix::from_rows(&[[-1.0]])?, vec![1.0])?;
/// let set = all_solutions(lcp.mcp(), 0.0, &EnumerationOptions::default())?;
/// assert_eq!(set.solutions.len(), 2);
/// assert_eq!(lcp.natural_residual(&[1.0], &mut [0.0])?, 0.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Deserialize),
    serde(try_from = "file::Fields<'_>")
)]
pub struct Lcp {
    mcp: Mcp<AffineFunction>,
}

#[cfg(feature = "serde")]
mod file {
    use std::borrow::Cow;

    use serde::{Deserialize, Serialize, Serializer};

    use super::{ComplementarityError, Lcp, Matrix};

    /// Serialised form of an [`Lcp`].
    #[derive(Serialize, Deserialize)]
    #[serde(rename = "Lcp")]
    pub(super) struct Fields<'a> {
        matrix: Cow<'a, Matrix>,
        q: Cow<'a, [f64]>,
        #[serde(with = "crate::extended::list")]
        lower: Cow<'a, [f64]>,
        #[serde(with = "crate::extended::list")]
        upper: Cow<'a, [f64]>,
    }

    impl Serialize for Lcp {
        fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
            Fields {
                matrix: Cow::Borrowed(self.matrix()),
                q: self.q().into(),
                lower: self.lower().into(),
                upper: self.upper().into(),
            }
            .serialize(s)
        }
    }

    impl TryFrom<Fields<'_>> for Lcp {
        type Error = ComplementarityError;

        fn try_from(read: Fields<'_>) -> Result<Self, ComplementarityError> {
            let (lower, upper) = (read.lower.into_owned(), read.upper.into_owned());
            Self::boxed(read.matrix.into_owned(), read.q.into_owned(), lower, upper)
        }
    }
}

impl Lcp {
    /// LCP(M, q): z ≥ 0.
    ///
    /// # Errors
    /// [`ComplementarityError`] names the shape or the entry that is wrong.
    pub fn new(matrix: Matrix, q: Vec<f64>) -> Result<Self, ComplementarityError> {
        let n = q.len();
        Self::boxed(matrix, q, vec![0.0; n], vec![f64::INFINITY; n])
    }

    /// The box LCP: l ≤ z ≤ u, −∞ and +∞ where there is no bound.
    ///
    /// # Errors
    /// As [`new`](Self::new), and bounds that are NaN or leave no value.
    pub fn boxed(
        matrix: Matrix,
        q: Vec<f64>,
        lower: Vec<f64>,
        upper: Vec<f64>,
    ) -> Result<Self, ComplementarityError> {
        if matrix.nrows() != matrix.ncols() {
            return Err(ComplementarityError::Dimensions {
                vars: matrix.ncols(),
                values: matrix.nrows(),
                expected: "the matrix of an LCP is square",
            });
        }
        if let Some((row, col)) = matrix.stray() {
            return Err(crate::piecewise::PiecewiseError::StrayEntry { row, col }.into());
        }
        let mcp = Mcp::affine(matrix, q, lower, upper)?;
        Ok(Self { mcp })
    }

    /// The problem with constants q + C θ, C (n × k), as a map of z and the parameters θ: for
    /// [`Sensitivity`](crate::sensitivity::Sensitivity). With C = I the parameters are changes of q.
    ///
    /// # Errors
    /// Another number of rows, entries that are not finite.
    ///
    /// ```
    /// use semismooth::complementarity::Lcp;
    /// use semismooth::sensitivity::Sensitivity;
    /// use semismooth::sparse::Matrix;
    /// let lcp = Lcp::new(Matrix::from_rows(&[[2.0, 1.0], [1.0, 2.0]])?, vec![-4.0, -2.0])?;
    /// // z = (2, 0), and w₁ = 0 as well: z₁ grows where q₁ falls, and cannot fall.
    /// let mut found = Sensitivity::new(lcp.in_constants(&Matrix::identity(2))?, &[2.0, 0.0], &[0.0; 2])?;
    /// assert_eq!(found.differentiable()?.known(), Some(false));
    /// assert_eq!(found.jvp(&[0.0, -3.0])?, [-1.0, 2.0]);
    /// assert_eq!(found.jvp(&[0.0, 3.0])?, [0.0, 0.0]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn in_constants(&self, columns: &Matrix) -> Result<Mcp<AffineFunction>, ComplementarityError> {
        let n = self.len();
        check_length("the rows of the columns C", columns.nrows(), n)?;
        let moved = columns.triplets().map(|(i, j, v)| (i, n + j, v));
        let entries: Vec<_> = self.matrix().triplets().chain(moved).collect();
        let matrix = Matrix::from_triplets(n, n + columns.ncols(), &entries)?;
        let function = AffineFunction::with_parameters(matrix, self.q().to_vec())?;
        Mcp::with_parameters(function, self.lower().to_vec(), self.upper().to_vec())
    }

    /// The problem as an MCP, which is a piecewise-smooth map.
    #[must_use]
    pub fn mcp(&self) -> &Mcp<AffineFunction> {
        &self.mcp
    }

    /// Number n of unknowns.
    #[must_use]
    pub fn len(&self) -> usize {
        self.mcp.len()
    }

    /// Always false: a problem has at least one unknown.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.mcp.is_empty()
    }

    /// M, its diagonal stored.
    #[must_use]
    pub fn matrix(&self) -> &Matrix {
        self.mcp.function().matrix()
    }

    /// q.
    #[must_use]
    pub fn q(&self) -> &[f64] {
        self.mcp.function().q()
    }

    /// Lower bounds; 0 unless given.
    #[must_use]
    pub fn lower(&self) -> &[f64] {
        self.mcp.lower()
    }

    /// Upper bounds; +∞ unless given.
    #[must_use]
    pub fn upper(&self) -> &[f64] {
        self.mcp.upper()
    }

    /// Replaces q, for batches of problems with one matrix; nothing is allocated.
    ///
    /// # Errors
    /// Wrong length or entries that are not finite; the problem is then unchanged.
    pub fn set_q(&mut self, q: &[f64]) -> Result<(), ComplementarityError> {
        check_vector("q", q, self.len())?;
        self.mcp.function_mut().q_mut().copy_from_slice(q);
        Ok(())
    }

    /// Replaces the values of M over the pattern of [`matrix`](Self::matrix); nothing is allocated.
    ///
    /// # Errors
    /// Wrong length or entries that are not finite; the problem is then unchanged.
    pub fn set_values(&mut self, values: &[f64]) -> Result<(), ComplementarityError> {
        check_vector("the values of the matrix", values, self.matrix().values().len())?;
        self.mcp.function_mut().values_mut().copy_from_slice(values);
        Ok(())
    }

    /// w = M z + q.
    ///
    /// # Panics
    /// Unless both slices have length n.
    pub fn value(&self, z: &[f64], w: &mut [f64]) {
        w.copy_from_slice(self.q());
        self.matrix().as_ref().mul_add(1.0, z, w);
    }

    /// The natural residual zᵢ − mid(lᵢ, uᵢ, zᵢ − wᵢ), zero exactly at solutions, into `out` (length n); returns its largest entry.
    ///
    /// # Errors
    /// As [`Mcp::natural_residual`].
    pub fn natural_residual(&self, z: &[f64], out: &mut [f64]) -> Result<f64, ComplementarityError> {
        self.mcp.natural_residual(z, out)
    }

    /// Whether the bounds are 0 ≤ z < ∞.
    #[must_use]
    pub fn is_standard(&self) -> bool {
        self.lower().iter().all(|l| *l == 0.0) && self.upper().iter().all(|u| *u == f64::INFINITY)
    }
}
