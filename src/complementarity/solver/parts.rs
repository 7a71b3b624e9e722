use crate::complementarity::{Mcp, McpFunction};
use crate::piecewise::PiecewiseSmooth;
use crate::sparse::Pattern;

/// A problem without its type parameter, so that the solver is compiled once for all problems.
#[derive(Clone, Copy)]
pub(super) struct Parts<'a> {
    pub(super) function: &'a dyn McpFunction,
    pub(super) natural: &'a dyn PiecewiseSmooth,
    pub(super) pattern: &'a Pattern,
    pub(super) lower: &'a [f64],
    pub(super) upper: &'a [f64],
}

impl<'a> Parts<'a> {
    pub(super) fn of<F: McpFunction>(problem: &'a Mcp<F>) -> Self {
        Self {
            function: problem.function(),
            natural: problem,
            pattern: problem.jacobian_pattern(),
            lower: problem.lower(),
            upper: problem.upper(),
        }
    }
}
