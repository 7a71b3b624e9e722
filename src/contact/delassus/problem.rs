use super::DelassusError;
use super::cone::natural_residual;
use crate::sparse::Matrix;

/// A frictional contact problem reduced to its contacts: find the reactions r with
///
/// u = M r + q,  K* ∋ û ⟂ r ∈ K,  û = u + (μ‖u_T‖, 0, 0) contact by contact,
///
/// K = { r : ‖r_T‖ ≤ μ r_N } the Coulomb cone and K* its dual: Signorini's conditions 0 ≤ u_N ⟂ r_N ≥ 0 and Coulomb's law in one
/// (G. De Saxcé, Z.-Q. Feng, *The bipotential method*, Math. Comput. Modelling 28 (1998)). M = H W Hᵀ is the Delassus matrix:
/// positive semidefinite, often singular, and symmetric up to what wrote it. The components of a contact follow one another,
/// N, T1 in the plane (dimension 2) and N, T1, T2 in space (3). Units are free: [`residual`](Self::residual) does not depend on
/// that of q.
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
/// # Ok::<(), semismooth::contact::DelassusError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct DelassusProblem {
    dimension: usize,
    matrix: Matrix,
    q: Vec<f64>,
    friction: Vec<f64>,
}

impl DelassusProblem {
    /// A problem with `friction.len()` contacts in the plane (`dimension` 2) or in space (3): `matrix` is M, dense or sparse.
    ///
    /// # Errors
    /// Whatever of the shapes does not fit, NaN and infinities, negative coefficients of friction and negative diagonal entries
    /// of M. That M is positive semidefinite is not checked: it would cost more than most solutions.
    pub fn new(
        dimension: usize,
        matrix: Matrix,
        q: Vec<f64>,
        friction: Vec<f64>,
    ) -> Result<Self, DelassusError> {
        if dimension != 2 && dimension != 3 {
            return Err(DelassusError::Dimension { found: dimension });
        }
        let contacts = friction.len();
        if contacts == 0 {
            return Err(DelassusError::Empty);
        }
        let n = dimension * contacts;
        if matrix.nrows() != n || matrix.ncols() != n {
            return Err(DelassusError::Shape {
                nrows: matrix.nrows(),
                ncols: matrix.ncols(),
                contacts,
                dimension,
                expected: n,
            });
        }
        if q.len() != n {
            return Err(DelassusError::Length {
                what: "q",
                expected: n,
                found: q.len(),
            });
        }
        check_finite("q", &q)?;
        check_finite("mu", &friction)?;
        matrix
            .check_finite()
            .map_err(|source| DelassusError::Matrix { source })?;
        if let Some(contact) = friction.iter().position(|&mu| mu < 0.0) {
            return Err(DelassusError::NegativeFriction {
                contact,
                value: friction[contact],
            });
        }
        // Rounding of a product H W Hᵀ may leave a vanishing entry slightly negative.
        let diagonal = |i: usize| matrix.get(i, i);
        let largest = (0..n).map(diagonal).fold(0.0, f64::max);
        if let Some(index) = (0..n).find(|&i| diagonal(i) < -1e-10 * largest) {
            return Err(DelassusError::NegativeDiagonal {
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
    /// # Errors
    /// [`DelassusError::Length`] unless r has one entry an unknown, [`DelassusError::NotFinite`].
    pub fn velocities(&self, r: &[f64]) -> Result<Vec<f64>, DelassusError> {
        if r.len() != self.q.len() {
            return Err(DelassusError::Length {
                what: "r",
                expected: self.q.len(),
                found: r.len(),
            });
        }
        check_finite("r", r)?;
        let mut u = self.q.clone();
        self.matrix.as_ref().mul_add(1.0, r, &mut u);
        Ok(u)
    }

    /// ‖r − P_K(r − û)‖₂ / max(‖q‖₂, ‖r‖₂, ‖u‖₂) with u = M r + q, and 0 where all three vanish: 0 exactly at solutions, the same
    /// for (s q, s r).
    ///
    /// # Errors
    /// As [`velocities`](Self::velocities).
    pub fn residual(&self, r: &[f64]) -> Result<f64, DelassusError> {
        let u = self.velocities(r)?;
        Ok(match self.dimension {
            2 => self.relative_residual::<2>(r, &u),
            _ => self.relative_residual::<3>(r, &u),
        })
    }

    pub(super) fn mean_diagonal(&self) -> f64 {
        let n = self.q.len();
        (0..n).map(|i| self.matrix.get(i, i)).sum::<f64>() / n as f64
    }

    fn relative_residual<const D: usize>(&self, r: &[f64], u: &[f64]) -> f64 {
        let largest = |v: &[f64]| v.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
        let unit = largest(r).max(largest(u)).max(largest(&self.q));
        if unit == 0.0 {
            return 0.0;
        }
        // Squares of very small and very large numbers leave the range of floats.
        let norm = |v: &[f64]| v.iter().map(|x| (x / unit) * (x / unit)).sum::<f64>().sqrt();
        let size = norm(r).max(norm(u)).max(norm(&self.q));
        let sum: f64 = (0..self.contacts())
            .map(|i| {
                let at = |v: &[f64]| std::array::from_fn::<f64, D, _>(|k| v[i * D + k] / unit);
                natural_residual(self.friction[i], 1.0, &at(r), &at(u))
            })
            .sum();
        sum.sqrt() / size
    }
}

fn check_finite(what: &'static str, v: &[f64]) -> Result<(), DelassusError> {
    match v.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(DelassusError::NotFinite {
            what,
            index,
            value: v[index],
        }),
        None => Ok(()),
    }
}
