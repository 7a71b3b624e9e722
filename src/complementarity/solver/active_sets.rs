//! Starts of large affine problems from primal–dual active sets.

use std::ops::ControlFlow;

use super::parts::Parts;
use super::{McpIteration, McpOptions, McpReport, McpStep, McpStrategy};
use crate::clock::Clock;
use crate::complementarity::Lcp;
use crate::complementarity::active_set::{ActiveSetIteration, ActiveSetOptions, ActiveSetSolver};
use crate::run::Status;
use crate::sparse::Matrix;
use crate::tolerances::{ROUNDING, STEPS};

/// Number of components from which active sets come first: below, full steps of the natural map, which are the same iteration, take less
/// than a millisecond each, and the other strategies are within reach.
const LARGE: usize = 300;

/// Whether a run from `x` begins with active sets.
pub(super) fn come_first(problem: &Parts<'_>, options: &McpOptions) -> bool {
    problem.lower.len() >= LARGE && options.strategies.first() == Some(&McpStrategy::Newton)
}

/// Replaces x by the solution that active sets find, if they do: with sparse factors or multigrid, and a start from coarser problems, they
/// take a fraction of the time of general steps (obstacle problems, contact without friction). `jac` and `constants` are ∇F and F(0).
pub(super) fn start(
    problem: &Parts<'_>,
    (jac, constants): (&Matrix, &[f64]),
    x: &mut [f64],
    options: &McpOptions,
    report: &mut McpReport,
    observe: &mut dyn FnMut(&McpIteration) -> ControlFlow<()>,
    clock: Clock,
) {
    let (lower, upper) = (problem.lower.to_vec(), problem.upper.to_vec());
    // What is wrong with the data is said by the run that follows.
    if jac.stray().is_some() {
        return;
    }
    let Ok(lcp) = Lcp::boxed(jac.clone(), constants.to_vec(), lower, upper) else {
        return;
    };
    // Active sets need a dozen iterations where they suit the problem, one a node of a path where not.
    let own = ActiveSetOptions::default()
        .with_max_iterations(STEPS.min(options.max_iterations.max(1)))
        .with_tolerance(ROUNDING.min(options.tolerance));
    let mut z: Vec<f64> = { x.iter().zip(lcp.lower().iter().zip(lcp.upper())) }
        .map(|(x, (l, u))| x.max(*l).min(*u))
        .collect();
    let is_late = || options.max_time.is_some_and(|most| clock.elapsed() >= most);
    let mut solver = ActiveSetSolver::new(own);
    let told = |iteration: &ActiveSetIteration| {
        let now = McpIteration {
            index: report.iterations,
            strategy: McpStrategy::Newton,
            residual: iteration.residual,
            merit: f64::NAN,
            step: McpStep::Natural,
            damping: 1.0,
            sites_changed: iteration.changes,
        };
        report.history.push(now);
        report.iterations += 1;
        report.factorisations += usize::from(iteration.linear_iterations == 0);
        match observe(&now).is_break() || is_late() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        }
    };
    // Whether the point is a solution is judged by the run that follows, whatever is said of it here.
    let found = solver.solve_observed(&lcp, &mut z, None, told);
    if found.is_ok_and(|found| matches!(found.status, Status::Solved | Status::Inaccurate)) {
        x.copy_from_slice(&z);
    }
}
