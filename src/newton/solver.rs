use std::ops::ControlFlow;

use super::iterate::iterate;
use super::system::{PsBuffers, PsSystem, SemismoothSystem};
use super::workspace::Workspace;
use super::{Convergence, Iteration, NewtonError, NewtonOptions, Report};
use crate::input::check_vector;
use crate::linear::{AutoSolver, LinearSolver};
use crate::piecewise::{
    PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection, Semismooth, TestLayout,
    regularity_report, semismooth_report,
};
use crate::sparse::Pattern;

/// Newton's method for piecewise-smooth and semismooth equations, with its workspaces.
///
/// At each iterate x the selection σ of the pieces in whose cells x lies is linearised and the step solves
/// ∇H^(σ)(x) d = −H(x) (Kojima–Shindo 1986; Qi–Sun 1993). Rule where several pieces are active: the piece used last is kept
/// while x is in its closed cell, else the one with the largest margin, else the one with the lowest number; deterministic.
///
/// Full steps converge in finitely many iterations on piecewise-affine problems or may cycle. A selection that comes back
/// without progress leads back to the best iterate and turns on a line search on ½‖H‖² (rows weighted). Where the
/// Jacobian is singular its least-squares step is taken, where the Newton step gives no descent the steepest one. If that fails
/// too, the least-index rule lets one site at a time change its piece (it terminates for P-matrix problems, Murty 1974).
///
/// A solver is reused from problem to problem; nothing is allocated once it has seen a map of the same shape.
///
/// ```
/// use semismooth::newton::Newton;
/// use semismooth::piecewise::MinMap;
/// let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| { a[0] = x[0]; b[0] = 2.0 * x[0] - 3.0; });
/// let mut newton = Newton::default();
/// let mut x = [10.0];
/// newton.solve(&map, &mut x)?;
/// assert!((x[0] - 1.5).abs() < 1e-9);
/// assert!(newton.report().history.len() <= 4);
/// # Ok::<(), semismooth::newton::NewtonError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Newton<L = AutoSolver> {
    options: NewtonOptions,
    solver: L,
    work: Workspace,
    pieces: PsBuffers,
}

impl Newton {
    /// A corrector with the crate's own linear solvers.
    #[must_use]
    pub fn new(options: NewtonOptions) -> Self {
        Self::with_solver(options, AutoSolver::default())
    }
}

// Not derived: generic over the solver, `Newton::default()` would leave its type open.
impl Default for Newton {
    fn default() -> Self {
        Self::new(NewtonOptions::default())
    }
}

impl<L: LinearSolver> Newton<L> {
    /// A corrector with a linear solver of your own.
    #[must_use]
    pub fn with_solver(options: NewtonOptions, solver: L) -> Self {
        Self {
            options,
            solver,
            work: Workspace::default(),
            pieces: PsBuffers::default(),
        }
    }

    /// The same without rescaling the map: a [prescribed
    /// scale](crate::piecewise::Description::in_prescribed_scale) is ignored.
    pub(crate) fn in_own_scale(mut self) -> Self {
        self.pieces.own_scale = true;
        self
    }

    /// The options.
    #[must_use]
    pub fn options(&self) -> &NewtonOptions {
        &self.options
    }

    /// The history of the last run.
    #[must_use]
    pub fn report(&self) -> &Report {
        &self.work.report
    }

    /// The selection at the solution of the last run on a piecewise-smooth map.
    #[must_use]
    pub fn selection(&self) -> &Selection {
        &self.pieces.selection
    }

    /// Solves H(x) = 0 from the start `x`, which is overwritten by the solution (on failure by the best
    /// iterate).
    ///
    /// A map with one variable more than residuals is solved for all variables but the last, the parameter,
    /// which stays fixed. Where users prescribed a scale, the equation is solved [in that
    /// scale](crate::piecewise::Description::in_prescribed_scale).
    ///
    /// # Errors
    /// [`NewtonError::Failed`] with the best iterate and the history; errors of options, map, start and
    /// linear solver. Where the regularity that [`NewtonOptions::regularity`] asks for cannot be examined,
    /// `x` holds the solution all the same.
    pub fn solve<P: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &P,
        x: &mut [f64],
    ) -> Result<Convergence, NewtonError> {
        solve_pieces(self.parts(), &map, x, &mut |_| ControlFlow::Continue(()))
    }

    /// [`solve`](Self::solve), reporting every iteration to `observe`, which may stop the run.
    ///
    /// # Errors
    /// As [`solve`](Self::solve); a stopped run is [`Status::Interrupted`](crate::run::Status::Interrupted).
    pub fn solve_observed<P: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &P,
        x: &mut [f64],
        mut observe: impl FnMut(&Iteration) -> ControlFlow<()>,
    ) -> Result<Convergence, NewtonError> {
        solve_pieces(self.parts(), &map, x, &mut observe)
    }

    fn parts(&mut self) -> Parts<'_> {
        Parts {
            work: Work {
                options: &self.options,
                solver: &mut self.solver,
                work: &mut self.work,
            },
            pieces: &mut self.pieces,
        }
    }

    /// Solves H(x) = 0 for a semismooth map.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_semismooth<S: Semismooth + ?Sized>(
        &mut self,
        map: &S,
        x: &mut [f64],
    ) -> Result<Convergence, NewtonError> {
        self.solve_semismooth_observed(map, x, |_| ControlFlow::Continue(()))
    }

    /// [`solve_semismooth`](Self::solve_semismooth), reporting every iteration to `observe`, which may stop the run.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_semismooth_observed<S: Semismooth + ?Sized>(
        &mut self,
        map: &S,
        x: &mut [f64],
        mut observe: impl FnMut(&Iteration) -> ControlFlow<()>,
    ) -> Result<Convergence, NewtonError> {
        let n = map.num_vars();
        if n == 0 {
            return Err(PiecewiseError::Dimensions {
                vars: 0,
                residuals: 0,
                expected: "an equation has at least 1 variable",
            }
            .into());
        }
        let mut system = SemismoothSystem(map);
        let pattern = || map.pattern();
        let convergence = run(self.parts().work, &mut system, x, (n, n), &pattern, &mut observe)?;
        if let Some(options) = &self.options.regularity {
            self.work.report.regularity = Some(semismooth_report(&map, x, options)?);
        }
        Ok(convergence)
    }
}

/// The corrector behind a trait object of the linear solver.
struct Work<'n> {
    options: &'n NewtonOptions,
    solver: &'n mut dyn LinearSolver,
    work: &'n mut Workspace,
}

impl Work<'_> {
    fn lend(&mut self) -> Work<'_> {
        Work {
            options: self.options,
            solver: self.solver,
            work: self.work,
        }
    }
}

struct Parts<'n> {
    work: Work<'n>,
    pieces: &'n mut PsBuffers,
}

/// [`Newton::solve_observed`], compiled once.
fn solve_pieces(
    Parts { mut work, pieces }: Parts<'_>,
    own: &dyn PiecewiseSmooth,
    x: &mut [f64],
    observe: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
) -> Result<Convergence, NewtonError> {
    let map = own;
    let prescribed = if pieces.own_scale {
        None
    } else {
        map.in_prescribed_scale()
    };
    let map = prescribed.as_deref().unwrap_or(map);
    let (m, n) = (map.num_vars(), map.num_residuals());
    if n == 0 || (m != n && m != n + 1) {
        return Err(PiecewiseError::Dimensions {
            vars: m,
            residuals: n,
            expected: "an equation has as many variables as residuals, a curve one more, both at least 1 residual",
        }
        .into());
    }
    let sites = map.num_sites();
    let known = pieces.layout.as_ref().is_some_and(|l| l.describes(map));
    let layout = match pieces.layout.take() {
        Some(layout) if known => layout,
        _ => TestLayout::new(map),
    };
    pieces.theta.resize(layout.total(), 0.0);
    if pieces.selection.len() != sites {
        pieces.selection = Selection::uniform(sites, 0);
        pieces.trial = Selection::uniform(sites, 0);
    }
    let mut system = PsSystem {
        map,
        layout: &layout,
        theta: &mut pieces.theta,
        selection: &mut pieces.selection,
        trial: &mut pieces.trial,
        least_index: false,
        fresh: true,
    };
    let pattern = || map.pattern();
    let result = run(work.lend(), &mut system, x, (m, n), &pattern, observe);
    pieces.layout = Some(layout);
    let convergence = result?;
    if let Some(options) = &work.options.regularity {
        work.work.report.regularity = Some(regularity_report(own, x, options)?);
    }
    Ok(convergence)
}

/// Runs the loop; a Jacobian that does not fit the pattern kept from an earlier map of the same size makes a new workspace.
fn run(
    Work {
        options,
        solver,
        work,
    }: Work<'_>,
    system: &mut dyn super::system::System,
    x: &mut [f64],
    (m, n): (usize, usize),
    pattern: &dyn Fn() -> Pattern,
    observe: &mut dyn FnMut(&Iteration) -> ControlFlow<()>,
) -> Result<Convergence, NewtonError> {
    options.validate()?;
    check_vector("the start x", x, m)?;
    if !work.fits(m, n) {
        work.prepare(pattern(), m, n)?;
    }
    match iterate(work, solver, options, system, x, observe) {
        Err(NewtonError::Map(PiecewiseError::StrayEntry { .. })) => {
            work.prepare(pattern(), m, n)?;
            iterate(work, solver, options, system, x, observe)
        }
        result => result,
    }
}
