//! The solver of mixed complementarity problems.

mod active_sets;
mod descent;
mod engine;
mod equations;
mod judge;
mod linearisation;
mod options;
mod outcome;
mod parts;
mod plan;
mod report;
mod steps;
mod strategies;
mod strategy;
mod system;
mod units;
mod work;

use std::ops::ControlFlow;
use std::time::Duration;

pub use options::McpOptions;
pub use report::{BoundState, Fallback, McpIteration, McpReport, McpStep};
pub use strategy::McpStrategy;

use super::strong::strong;
use super::{ComplementarityError, Mcp, McpFunction};
use crate::clock::Clock;
use crate::input::{check_length, check_vector};
use crate::piecewise::{RegularityOptions, regularity_report};

use engine::Engine;
use parts::Parts;
use units::Units;
use work::Work;

/// Solves mixed complementarity problems from any start.
///
/// # Strategy
/// Strategies are tried in this order, each only if all before it failed; the report lists every attempt. All of it is deterministic.
///
/// 0. Affine problems of at least 300 components begin with [active sets](super::active_set), on sparse factors or multigrid and from
///    coarser problems: their iterations are listed as Newton's, and their solution is judged as any start.
/// 1. The start is projected on the bounds; if F cannot be evaluated there a point nearby is sought. Rows and columns are equilibrated.
///    *Newton*: steps of the natural map (active-set steps), full while they reduce the merit ½‖Φ‖² of the penalised Fischer–Burmeister
///    function below the largest of its last values, and for a few steps without such a decrease (watchdog technique); else line searches
///    along the Newton step of Φ, regularised least-squares steps where H is singular, and the projected gradient (De Luca, Facchinei and
///    Kanzow 1996; Munson et al. 2001). For affine F full steps of the natural map come first: they need no merit, and end at a solution
///    after finitely many active sets or are abandoned when a set recurs.
/// 2. *Fischer–Burmeister*: the penalised function of Chen, Chen and Kanzow (2000), without equilibration.
/// 3. *Proximal*: F(x) + ε (x − x_k), ε → 0 (Billups 1995); for affine F its displacement may prove infeasibility.
/// 4. *Josephy–Newton*: linearised problems, solved along the piecewise linear path from the iterate (Ralph 1994; Dirkse and Ferris
///    1995) by the crate's continuation.
/// 5. *Homotopy*: t F(x) + (1 − t)(x − x⁰) from t = 0 to 1, by arclength continuation through kinks and folds.
/// 6. *Enumeration*: for affine problems of up to 24 components a pruned search of all active sets.
/// 7. *Smoothing*: Newton's method for a + b − √((a − b)² + 4μ²) in place of 2 min(a, b), μ → 0 (Chen and Harker 1993; Kanzow 1996).
/// 8. *Restart*: 1, 2 and 5 from perturbed starts.
///
/// [`McpOptions::strategies`] chooses among them, and their order.
///
/// Iterates stay within the bounds (unless F is affine), and F is evaluated nowhere else ([`McpOptions::stay_inside`]); where it is not
/// finite the step is shortened. Success is claimed only by the rule stated under [accuracy](super#accuracy), for the point returned.
///
/// ```
/// use semismooth::complementarity::{Lcp, McpOptions, McpSolver};
/// use semismooth::sparse::Matrix;
/// // A string of three points over an obstacle at 0, pulled up beside the middle, which rests.
/// let matrix = Matrix::from_rows(&[[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])?;
/// let lcp = Lcp::new(matrix, vec![-0.5, 1.0, -0.5])?;
/// let mut solver = McpSolver::new(McpOptions::default().with_tolerance(1e-12));
/// let mut x = [1.0; 3];
/// let report = solver.solve(lcp.mcp(), &mut x)?;
/// assert!(report.is_solved() && report.error <= 1e-12);
/// for (x, exact) in x.iter().zip([0.25, 0.0, 0.25]) {
///     assert!((x - exact).abs() < 1e-12);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Complexity
/// A step factors the system of the k components away from their bounds: O(k³) where it is small or mostly full, else with the
/// fill-in of sparse LU; up to 200 components regularised steps are O(n³). Paths take such a step at each point, and enumeration
/// up to 3ⁿ nodes, within [`McpOptions::max_nodes`]. Up to 48 components nothing is allocated once a solver
/// has seen a problem with the same pattern, unless it comes to strategies 4 to 6 or 8.
#[derive(Debug, Clone, Default)]
pub struct McpSolver {
    options: McpOptions,
    work: Option<Work>,
    report: McpReport,
}

impl McpSolver {
    /// A solver with the given options.
    #[must_use]
    pub fn new(options: McpOptions) -> Self {
        Self {
            options,
            ..Self::default()
        }
    }

    /// The options.
    #[must_use]
    pub fn options(&self) -> &McpOptions {
        &self.options
    }

    /// Changes the largest wall-clock time of the solves to come.
    pub(crate) fn limit_time(&mut self, limit: Duration) {
        self.options.max_time = Some(limit);
    }

    /// How the last solve went.
    #[must_use]
    pub fn report(&self) -> &McpReport {
        &self.report
    }

    /// Solves from the start `x`, which is overwritten by the solution, or by the point with the smallest natural residual.
    ///
    /// A solution of a similar problem is a good start: with the right active set one factorisation solves an affine problem.
    ///
    /// # Errors
    /// Misuse only: a parametric problem, a start of wrong length or not finite, options out of range, a Jacobian entry outside the
    /// pattern, and failures of the linear solver where [regularity](McpOptions::regularity) is requested (`x` then holds the solution).
    /// That no solution was found is no error: see [`McpReport::status`].
    pub fn solve<F: McpFunction>(
        &mut self,
        problem: &Mcp<F>,
        x: &mut [f64],
    ) -> Result<&McpReport, ComplementarityError> {
        self.solve_observed(problem, x, |_| ControlFlow::Continue(()))
    }

    /// [`solve`](Self::solve), reporting every iteration to `observe`, which may stop the run. It is also called, with residual and merit
    /// NaN, for points of paths, during enumeration, and for perturbed starts at which F is not finite; these are not in the history.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_observed<F: McpFunction>(
        &mut self,
        problem: &Mcp<F>,
        x: &mut [f64],
        mut observe: impl FnMut(&McpIteration) -> ControlFlow<()>,
    ) -> Result<&McpReport, ComplementarityError> {
        self.run(&Parts::of(problem), x, None, &mut observe)
    }

    /// [`solve`](Self::solve) from an active set: components given as at a bound are moved there, and for affine F the first step is that
    /// of this active set. The [states](McpReport::states) of a similar problem can be used.
    ///
    /// # Errors
    /// As [`solve`](Self::solve); states of the wrong length, or at a bound that does not exist.
    pub fn solve_from_states<F: McpFunction>(
        &mut self,
        problem: &Mcp<F>,
        x: &mut [f64],
        states: &[BoundState],
    ) -> Result<&McpReport, ComplementarityError> {
        check_length("the active set", states.len(), problem.len())?;
        for (i, s) in states.iter().enumerate() {
            let (what, bound, free) = match s {
                BoundState::Lower => ("lower", problem.lower()[i], "another state"),
                BoundState::Upper => ("upper", problem.upper()[i], "another state"),
                BoundState::Interior => continue,
            };
            if bound.is_infinite() {
                return Err(ComplementarityError::Bound {
                    what,
                    index: i,
                    value: bound,
                    free,
                });
            }
        }
        self.run(&Parts::of(problem), x, Some(states), &mut |_| {
            ControlFlow::Continue(())
        })
    }

    fn run(
        &mut self,
        problem: &Parts<'_>,
        x: &mut [f64],
        states: Option<&[BoundState]>,
        observe: &mut dyn FnMut(&McpIteration) -> ControlFlow<()>,
    ) -> Result<&McpReport, ComplementarityError> {
        let clock = Clock::start();
        self.options.validate()?;
        // An observer that has asked to stop is not called again.
        let mut stopped = ControlFlow::Continue(());
        let observe: &mut dyn FnMut(&McpIteration) -> ControlFlow<()> = &mut |iteration| {
            if stopped.is_continue() {
                stopped = observe(iteration);
            }
            stopped
        };
        let (n, vars) = (problem.lower.len(), problem.function.num_vars());
        if vars > n {
            return Err(ComplementarityError::Dimensions {
                vars,
                values: n,
                expected: "fix the parameter first, by `Mcp::at`, or follow the solutions by `continuation`",
            });
        }
        check_vector("the start x", x, n)?;
        let mut work = match self.work.take() {
            Some(work) if work.fits(problem.pattern) => work,
            _ => Work::new(problem.pattern)?,
        };
        self.report.clear();
        let mut units = std::mem::take(&mut work.units);
        let own = match problem.function.is_affine() {
            true => {
                let (jac, constants) = work.scratch();
                units.find(problem, jac, constants);
                if states.is_none() && active_sets::come_first(problem, &self.options) {
                    let data = (&*jac, &**constants);
                    active_sets::start(problem, data, x, &self.options, &mut self.report, observe, clock);
                }
                units.are_own()
            }
            false => true,
        };
        let stray = match own {
            true => self.run_in_units(problem, &mut work, x, states, observe, clock),
            false => self.run_scaled(problem, &mut units, &mut work, x, states, observe, clock),
        };
        work.units = units;
        self.work = Some(work);
        if let Some((row, col)) = stray {
            return Err(crate::piecewise::PiecewiseError::StrayEntry { row, col }.into());
        }
        if let Some(wanted) = self.options.regularity.filter(|_| self.report.is_solved()) {
            let mut found = regularity_report(problem.natural, x, &wanted)?;
            let RegularityOptions { tolerance, cap } = wanted;
            let bounds = (problem.lower, problem.upper);
            found.strong = Some(strong(bounds, problem.natural, x, tolerance, cap)?);
            self.report.regularity = Some(found);
        }
        self.report.time = clock.elapsed();
        Ok(&self.report)
    }
}

impl McpSolver {
    /// The run in units of its own.
    #[allow(clippy::too_many_arguments)] // those of `run`, and what it has made
    fn run_scaled(
        &mut self,
        problem: &Parts<'_>,
        units: &mut Units,
        work: &mut Work,
        x: &mut [f64],
        states: Option<&[BoundState]>,
        observe: &mut dyn FnMut(&McpIteration) -> ControlFlow<()>,
        clock: Clock,
    ) -> Option<(usize, usize)> {
        units.enter(x);
        let point = std::mem::take(units.point());
        let function = units.function(problem.function, point);
        let (lower, upper) = units.bounds();
        let scaled = Parts {
            function: &function,
            lower,
            upper,
            ..*problem
        };
        let stray = self.run_in_units(&scaled, work, x, states, observe, clock);
        *units.point() = function.end();
        units.leave(problem, x, &mut work.here.f, &mut self.report);
        stray
    }

    /// The run; the entry of ∇F outside its pattern, if there is one.
    fn run_in_units(
        &mut self,
        problem: &Parts<'_>,
        work: &mut Work,
        x: &mut [f64],
        states: Option<&[BoundState]>,
        observe: &mut dyn FnMut(&McpIteration) -> ControlFlow<()>,
        clock: Clock,
    ) -> Option<(usize, usize)> {
        work.start.copy_from_slice(x);
        for (x, (lower, upper)) in work.start.iter_mut().zip(problem.lower.iter().zip(problem.upper)) {
            *x = x.max(*lower).min(*upper);
        }
        let mut engine = Engine::new(problem, &self.options, work, &mut self.report, observe, clock);
        engine.given_active = states.is_some();
        let status = engine.solve(states);
        let stray = engine.work.lin.jac().stray();
        engine.finish(status, x);
        stray
    }
}
