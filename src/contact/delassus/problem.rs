use super::scaled::ScaledProblem;
use crate::InputError;
use crate::contact::ContactError;
use crate::input::{check_finite, check_vector};
use crate::sparse::Matrix;

/// A frictional contact problem reduced to its contacts: find the reactions r with
///
/// u = M r + q,  K* ∋ û ⟂ r ∈ K,  û = u + (μ‖u_T‖, 0, 0) contact by contact,
///
/// K = { r : ‖r_T‖ ≤ μ r_N } the Coulomb cone and K* its dual: Signorini's conditions 0 ≤ u_N ⟂ r_N ≥ 0 and Coulomb's law in one inclusion
/// (G. De Saxcé, Z.-Q. Feng, *The bipotential method*, Math. Comput. Modelling 28 (1998)). M = H W Hᵀ is the Delassus matrix: positive
/// semidefinite, often singular, and symmetric up to the accuracy of the program that wrote it. The components of a contact follow one
/// another, N, T1 in the plane (dimension 2) and N, T1, T2 in space (3). Units are free: [`residual`](Self::residual) and the solver do not
/// depend on those of M and q.
///
/// ```
/// use semismooth::contact::{ContactState, DelassusProblem, DelassusSolver};
/// use semismooth::sparse::Matrix;
///
/// // A block of unit mass, pressed by 1 and pushed by 0.2, with μ = 0.3: it sticks.
/// let problem = DelassusProblem::new(2, Matrix::identity(2), vec![-1.0, -0.2], vec![0.3])?;
/// let report = DelassusSolver::default().solve(&problem)?;
/// assert!(report.is_solved());
/// assert_eq!(report.states, [ContactState::Stick]);
/// assert!((report.r[0] - 1.0).abs() < 1e-12 && (report.r[1] - 0.2).abs() < 1e-12);
/// # Ok::<(), semismooth::contact::ContactError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(try_from = "Unchecked")
)]
pub struct DelassusProblem {
    dimension: usize,
    matrix: Matrix,
    q: Vec<f64>,
    friction: Vec<f64>,
}

/// The fields of a problem as read from a file.
#[cfg(feature = "serde")]
#[derive(serde::Deserialize)]
#[serde(rename = "DelassusProblem")]
struct Unchecked {
    dimension: usize,
    matrix: Matrix,
    q: Vec<f64>,
    friction: Vec<f64>,
}

#[cfg(feature = "serde")]
impl TryFrom<Unchecked> for DelassusProblem {
    type Error = ContactError;

    fn try_from(read: Unchecked) -> Result<Self, ContactError> {
        Self::new(read.dimension, read.matrix, read.q, read.friction)
    }
}

impl DelassusProblem {
    /// A problem with `friction.len()` contacts in the plane (`dimension` 2) or in space (3): `matrix` is M, dense or sparse.
    ///
    /// # Errors
    /// Shapes that do not fit, NaN and infinities, negative coefficients of friction and negative diagonal entries
    /// of M. That M is positive semidefinite is not checked: it would cost more than most solutions.
    pub fn new(
        dimension: usize,
        matrix: Matrix,
        q: Vec<f64>,
        friction: Vec<f64>,
    ) -> Result<Self, ContactError> {
        if dimension != 2 && dimension != 3 {
            return Err(ContactError::Dimension { found: dimension });
        }
        let contacts = friction.len();
        if contacts == 0 {
            return Err(ContactError::Empty {
                what: "there are no contacts",
            });
        }
        let n = dimension * contacts;
        if matrix.nrows() != n || matrix.ncols() != n {
            return Err(ContactError::Input(InputError::Shape {
                what: "M",
                rows: n,
                cols: n,
                found_rows: matrix.nrows(),
                found_cols: matrix.ncols(),
            }));
        }
        check_vector("q", &q, n)?;
        check_finite("mu", &friction)?;
        matrix
            .check_finite()
            .map_err(|source| ContactError::Matrix { what: "M", source })?;
        if let Some(contact) = friction.iter().position(|&mu| mu < 0.0) {
            return Err(ContactError::NegativeCoefficient {
                contact,
                value: friction[contact],
            });
        }
        // Rounding of a product H W Hᵀ may leave a vanishing entry slightly negative.
        let diagonal = |i: usize| matrix.get(i, i);
        let largest = (0..n).map(diagonal).fold(0.0, f64::max);
        if let Some(index) = (0..n).find(|&i| diagonal(i) < -1e-10 * largest) {
            return Err(ContactError::NegativeDiagonal {
                index,
                value: diagonal(index),
            });
        }
        Ok(Self {
            dimension,
            matrix,
            q,
            friction,
        })
    }

    /// 2 or 3.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Number of contacts.
    #[must_use]
    pub fn contacts(&self) -> usize {
        self.friction.len()
    }

    /// The Delassus matrix M.
    #[must_use]
    pub fn matrix(&self) -> &Matrix {
        &self.matrix
    }

    /// The free velocities (or displacements) q.
    #[must_use]
    pub fn q(&self) -> &[f64] {
        &self.q
    }

    /// The coefficient of friction of each contact.
    #[must_use]
    pub fn friction(&self) -> &[f64] {
        &self.friction
    }

    /// u = M r + q.
    ///
    /// # Complexity
    /// Linear in the entries of M: O(n²) where that is dense.
    ///
    /// # Errors
    /// [`InputError::Length`] unless r has one entry an unknown, [`InputError::NotFinite`].
    pub fn velocities(&self, r: &[f64]) -> Result<Vec<f64>, ContactError> {
        check_vector("r", r, self.q.len())?;
        let mut u = self.q.clone();
        self.matrix.as_ref().mul_add(1.0, r, &mut u);
        Ok(u)
    }

    /// The largest violation of the law at a contact, max over i of ‖rᵢ − P_K(rᵢ − ûᵢ)‖ / sizeᵢ with u = M r + q: 0 exactly at
    /// solutions.
    ///
    /// It is taken in scaled variables, S⁻¹ r and S u with one factor a contact by which its block of S M S has the mean diagonal entry 1
    /// (that of the largest block where its own vanishes, the largest entry of M where all do), and sizeᵢ = max(‖rᵢ‖, ‖uᵢ‖, ‖qᵢ‖, ‖Mᵢⱼ rⱼ‖
    /// over all j) is that of the terms that cancel there (at least 1e-12 of the largest one), so that it depends neither on the units of M
    /// and q nor on the size of the forces at other contacts. Infinite where squares of these terms overflow.
    ///
    /// # Complexity
    /// Linear in the entries of M: O(n²) where that is dense.
    ///
    /// # Errors
    /// As [`velocities`](Self::velocities).
    pub fn residual(&self, r: &[f64]) -> Result<f64, ContactError> {
        self.velocities(r)?;
        Ok(match self.dimension {
            2 => self.block_residual::<2>(r),
            _ => self.block_residual::<3>(r),
        })
    }

    pub(super) fn mean_diagonal(&self) -> f64 {
        let n = self.q.len();
        (0..n).map(|i| self.matrix.get(i, i)).sum::<f64>() / n as f64
    }

    fn block_residual<const D: usize>(&self, r: &[f64]) -> f64 {
        let scaled = ScaledProblem::<D>::new(self);
        let (mut u, mut contacts) = (vec![[0.0; D]; self.contacts()], vec![[0.0; 2]; self.contacts()]);
        scaled.law(&scaled.scale(r), &mut u, &mut contacts).residual
    }
}
