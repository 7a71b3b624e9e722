//! Stability of equilibria of y′ = H(y, α), or M y′ = H(y, α) with a diagonal M, along curves of solutions of H = 0.
//!
//! A curve of solutions alone carries no stability: rows of H = 0 may have any order and sign. Where they are the right-hand sides of
//! differential equations, [`Dynamics`] says so, and gives
//!
//! * the eigenvalues at a point, and how many have positive real parts ([`Spectrum`]),
//! * curves with the eigenvalues at all points, and Hopf points on them located to rounding ([`Dynamics::follow`]),
//! * at kinks the boundary equilibrium bifurcations: *persistence* or *non-smooth fold* with the eigenvalues on both sides (M. di Bernardo,
//!   C. J. Budd, A. R. Champneys, P. Kowalczyk, *Piecewise-smooth Dynamical Systems*, 2008, chapter 5),
//! * of large sparse systems some eigenvalues next to a real shift ([`Dynamics::nearest`]).
//!
//! Quasi-static equilibria with friction are no equilibria of differential equations: there the *rate
//! problem* takes the place of eigenvalues, which velocities follow a change of the load.
//! [`implicit_function`](crate::piecewise::implicit_function) of the map of a [contact
//! problem](crate::contact) says whether it has one solution whatever the load's rate, and
//! [`arms_at`](crate::continuation::arms_at) lists all its solutions: arms with α̇ > 0, with α̇ < 0, and with
//! α̇ = 0, the motions at a constant load. Away from kinks, where det ∇_yH has another sign than if all nodes
//! stuck, an odd number of the modes in which slipping nodes go on slipping grows exponentially at constant
//! load, for any masses that do not couple the axes of contact nodes: *directional* instability (J. A. C.
//! Martins, S. Barbarin, M. Raous, A. Pinto da Costa, Comput. Methods Appl. Mech. Eng. 177 (1999)).
//!
//! ```
//! use semismooth::continuation::{ContinuationOptions, Direction};
//! use semismooth::stability::Dynamics;
//! use semismooth::parametric;
//! // The normal form of Hopf, y₁′ = α y₁ − y₂ − y₁ r², y₂′ = y₁ + α y₂ − y₂ r²: eigenvalues α ± i at 0.
//! let map = parametric(2, 1, |y, a| {
//!     let r = y[0] * y[0] + y[1] * y[1];
//!     vec![a[0] * y[0] - y[1] - y[0] * r, y[0] + a[0] * y[1] - y[1] * r]
//! });
//! let range = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
//! let found = Dynamics::new(&map).follow(&[0.0, 0.0, -1.0], Direction::Increasing, range)?;
//! assert_eq!(found.hopf.len(), 1);
//! assert!(found.hopf[0].parameter().abs() < 1e-12 && (found.hopf[0].frequency - 1.0).abs() < 1e-12);
//! # Ok::<(), semismooth::stability::StabilityError>(())
//! ```

mod arnoldi;
mod branch;
mod spectrum;

pub use arnoldi::Ritz;
pub use branch::{BoundaryEquilibrium, BoundaryKind, Hopf, StabilityBranch, Stretch};
pub use spectrum::Spectrum;

use thiserror::Error;

use crate::InputError;
use crate::continuation::ContinuationError;
use crate::input::check_options;
use crate::input::{check_length, check_vector};
use crate::linear::{AutoSolver, LinearError, LinearSolver};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection, TestLayout, carries_maps, select_pieces};
use crate::sparse::Matrix;

/// Equations up to which all eigenvalues are computed: 8 MB and some seconds a point.
const DENSE: usize = 1000;

/// Why eigenvalues are not given.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum StabilityError {
    /// A map, a point or a diagonal that does not fit or is not finite.
    #[error(transparent)]
    Map(PiecewiseError),
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A linear system or the iteration for eigenvalues failed.
    #[error(transparent)]
    Linear(#[from] LinearError),
    /// The algebraic equations, those with 0 in M, do not determine as many unknowns at a point.
    #[error(
        "at this point the equations with 0 in M do not determine the unknowns that have no derivative there: the system is not of index 1"
    )]
    Index,
    /// All eigenvalues of so many equations are not computed.
    #[error(
        "{size} equations are more than {limit}, up to which all eigenvalues are computed; `nearest` computes some of them"
    )]
    TooLarge {
        /// Number of equations.
        size: usize,
        /// The limit.
        limit: usize,
    },
    /// The curve could not be followed.
    #[error(transparent)]
    Continuation(#[from] ContinuationError),
}

carries_maps!(StabilityError);

/// A map H of the variables (y, α) as the right-hand side of differential equations y′ = H(y, α), or M y′ = H(y, α).
#[derive(Debug)]
pub struct Dynamics<'a, P: ?Sized> {
    map: &'a P,
    layout: TestLayout,
    /// The diagonal of M.
    mass: Option<Vec<f64>>,
}

impl<'a, P: PiecewiseSmooth + ?Sized> Dynamics<'a, P> {
    /// y′ = H(y, α): row i of H is the derivative of variable i.
    #[must_use]
    pub fn new(map: &'a P) -> Self {
        Self {
            map,
            layout: TestLayout::new(map),
            mass: None,
        }
    }

    /// M y′ = H(y, α) with a diagonal M: zeros mark algebraic equations.
    ///
    /// # Errors
    /// Another number of entries than equations, entries that are not finite, zeros only.
    pub fn with_mass(mut self, mass: Vec<f64>) -> Result<Self, StabilityError> {
        check_vector("the diagonal of M", &mass, self.map.num_residuals())?;
        let moves = mass.iter().any(|m| *m != 0.0);
        check_options(&[("mass", 0.0, moves, "different from 0 for one equation at least")])?;
        self.mass = Some(mass);
        Ok(self)
    }

    /// The eigenvalues at x = (y, α), with the derivative of the piece in whose cell x lies.
    ///
    /// # Errors
    /// A wrong length, values or derivatives that are not finite, more than 1000 equations, algebraic equations that are singular.
    pub fn spectrum(&self, x: &[f64]) -> Result<Spectrum, StabilityError> {
        self.spectrum_in(&self.selection(x)?, x)
    }

    /// The eigenvalues at x with the derivative of a given selection.
    ///
    /// # Errors
    /// As [`spectrum`](Self::spectrum); a selection of another map.
    pub fn spectrum_in(&self, selection: &Selection, x: &[f64]) -> Result<Spectrum, StabilityError> {
        let size = self.map.num_residuals();
        if size > DENSE {
            return Err(StabilityError::TooLarge { size, limit: DENSE });
        }
        let derivative = self.derivative(selection, x)?;
        Spectrum::of(&self.reduced(&derivative)?)
    }

    fn selection(&self, x: &[f64]) -> Result<Selection, StabilityError> {
        check_vector("x", x, self.map.num_vars())?;
        let mut theta = vec![0.0; self.layout.total()];
        self.map.test_functions(x, &mut theta);
        check_vector("the test functions", &theta, theta.len())?;
        let mut selection = Selection::uniform(self.layout.num_sites(), 0);
        select_pieces(self.map, &self.layout, &theta, false, 0.0, &mut selection);
        Ok(selection)
    }

    /// ∂_yH of a selection.
    fn derivative(&self, selection: &Selection, x: &[f64]) -> Result<Matrix, StabilityError> {
        let n = self.map.num_residuals();
        check_vector("x", x, self.map.num_vars())?;
        check_length("the variables x = (y, α)", x.len(), n + 1)?;
        check_length(
            "the sites of the selection",
            selection.len(),
            self.layout.num_sites(),
        )?;
        let mut all = Matrix::zeros(self.map.pattern());
        self.map.jacobian(selection, x, &mut all);
        if let Some((row, col)) = all.stray() {
            return Err(PiecewiseError::StrayEntry { row, col }.into());
        }
        let entries: Vec<_> = all.triplets().filter(|e| e.1 < n).collect();
        if let Some((index, _, value)) = entries.iter().find(|e| !e.2.is_finite()) {
            let (what, index, value) = ("the derivative of the equations, row ", *index, *value);
            return Err(InputError::NotFinite { what, index, value }.into());
        }
        Ok(Matrix::from_triplets(n, n, &entries).map_err(LinearError::from)?)
    }

    /// The matrix of the linearised differential equations: M⁻¹ ∂_yH without algebraic equations, else in the unknowns that have derivatives,
    /// the others eliminated.
    fn reduced(&self, derivative: &Matrix) -> Result<Matrix, StabilityError> {
        let Some(mass) = &self.mass else {
            return Ok(derivative.clone());
        };
        let n = mass.len();
        // The place of each unknown among those of its kind.
        let mut place = vec![0; n];
        let mut counts = [0; 2];
        for i in 0..n {
            let kind = usize::from(mass[i] == 0.0);
            place[i] = counts[kind];
            counts[kind] += 1;
        }
        let [moving, fixed] = counts;
        let (mut own, mut right) = (vec![vec![0.0; moving]; moving], vec![vec![0.0; fixed]; moving]);
        let (mut out, mut inner) = (Vec::new(), Vec::new());
        for (i, j, v) in derivative.triplets() {
            match (mass[i] == 0.0, mass[j] == 0.0) {
                (false, false) => own[place[i]][place[j]] += v / mass[i],
                (false, true) => out.push((place[i], place[j], v / mass[i])),
                (true, false) => right[place[j]][place[i]] += v,
                (true, true) => inner.push((place[i], place[j], v)),
            }
        }
        if fixed > 0 {
            let inner = Matrix::from_triplets(fixed, fixed, &inner).map_err(LinearError::from)?;
            let mut solver = AutoSolver::new();
            let factored =
                (solver.analyze(inner.pattern().as_ref())).and_then(|()| solver.factor(inner.as_ref()));
            match factored {
                Err(LinearError::Singular { .. }) => return Err(StabilityError::Index),
                other => other?,
            }
            for (j, column) in right.iter_mut().enumerate() {
                solver.solve_in_place(column)?;
                out.iter().for_each(|(i, k, v)| own[*i][j] -= v * column[*k]);
            }
        }
        Ok(Matrix::from_rows(&own).map_err(LinearError::from)?)
    }
}
