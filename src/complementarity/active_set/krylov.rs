use super::ReducedSolver;
use super::direct::mask;
use super::reduced::{check_order, check_square};
use crate::complementarity::ComplementarityError;
use crate::linear::{Gmres, IncompleteLu, LinearError, Preconditioner};
use crate::sparse::Matrix;

/// Directions between restarts.
const DIRECTIONS: usize = 40;

/// Restarted GMRES for sparse unsymmetric systems too large to factor, with a [`Preconditioner`]: incomplete LU factors of the reduced
/// matrix unless another one is given.
///
/// The preconditioner is given the whole matrix, rows and columns that are not free replaced by those of the identity. A solve that does
/// not converge ends the run as [`Inaccurate`](crate::run::Status::Inaccurate).
///
/// ```
/// use semismooth::complementarity::{Lcp, active_set::{ActiveSetOptions, ActiveSetSolver, GmresReduced}};
/// use semismooth::sparse::Matrix;
/// // −u″ + 20 u′ = 1 on a string above 0.01, upwind differences.
/// let (n, h) = (200, 1.0 / 201.0);
/// let mut entries = vec![];
/// for i in 0..n {
///     entries.push((i, i, 2.0 + 20.0 * h));
///     if i > 0 { entries.push((i, i - 1, -1.0 - 20.0 * h)) }
///     if i + 1 < n { entries.push((i, i + 1, -1.0)) }
/// }
/// let lcp = Lcp::boxed(Matrix::from_triplets(n, n, &entries)?, vec![-h * h; n], vec![0.01; n], vec![f64::INFINITY; n])?;
/// let gmres = GmresReduced::default();
/// let mut solver = ActiveSetSolver::with_reduced(ActiveSetOptions::default(), gmres);
/// let mut z = vec![0.01; n];
/// assert!(solver.solve(&lcp, &mut z)?.residual < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct GmresReduced<P = IncompleteLu> {
    preconditioner: P,
    gmres: Gmres,
    max_iterations: usize,
    free: Vec<bool>,
    system: Option<Matrix>,
}

impl<P: Preconditioner> GmresReduced<P> {
    /// GMRES with the given preconditioner.
    pub fn new(preconditioner: P) -> Self {
        Self {
            preconditioner,
            gmres: Gmres::new(DIRECTIONS),
            max_iterations: 1000,
            free: Vec::new(),
            system: None,
        }
    }

    /// Sets the number of iterations after which a solve is given up. 1000 unless set.
    #[must_use]
    pub fn with_max_iterations(mut self, max_iterations: usize) -> Self {
        self.max_iterations = max_iterations;
        self
    }
}

impl Default for GmresReduced {
    fn default() -> Self {
        Self::new(IncompleteLu::default())
    }
}

impl<P: Preconditioner> ReducedSolver for GmresReduced<P> {
    fn load(&mut self, matrix: &Matrix) -> Result<(), ComplementarityError> {
        check_square(matrix)?;
        self.free.clear();
        self.free.resize(matrix.nrows(), true);
        Ok(())
    }

    fn select(&mut self, matrix: &Matrix, free: &[bool]) -> Result<(), ComplementarityError> {
        check_order(
            self.free.len(),
            &[
                ("the matrix", matrix.nrows()),
                ("the set of free components", free.len()),
            ],
        )?;
        check_square(matrix)?;
        self.free.clear();
        self.free.extend_from_slice(free);
        mask(matrix, free, &mut self.system);
        if let Some(system) = &self.system {
            self.preconditioner.prepare(system.as_ref())?;
        }
        Ok(())
    }

    fn solve(&mut self, r: &mut [f64], d: &mut [f64], tolerance: f64) -> Result<usize, ComplementarityError> {
        let Self {
            preconditioner,
            gmres,
            max_iterations,
            free,
            system,
        } = self;
        let system = system.as_ref().ok_or(LinearError::NotAnalyzed)?;
        check_order(free.len(), &[("r", r.len()), ("d", d.len())])?;
        for ((d, r), free) in d.iter_mut().zip(&*r).zip(&*free) {
            *d = if *free { *r } else { 0.0 };
        }
        let outcome = gmres.solve(
            |x, y| system.as_ref().mul_add(1.0, x, y),
            |b| preconditioner.apply(b),
            d,
            tolerance,
            *max_iterations,
        )?;
        if outcome.residual > tolerance {
            return Err(LinearError::Inaccurate {
                residual: outcome.residual,
            }
            .into());
        }
        for (d, free) in d.iter_mut().zip(&*free) {
            if !*free {
                *d = 0.0;
            }
        }
        Ok(outcome.iterations)
    }

    fn is_direct(&self) -> bool {
        false
    }
}
