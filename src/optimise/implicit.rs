use std::ops::ControlFlow;
use std::time::Duration;

use super::{Objective, OptimiseError};
use crate::Cause;
use crate::InputError;
use crate::complementarity::{ComplementarityError, Mcp, McpFunction, McpIteration, McpSolver};
use crate::input::check_length;
use crate::piecewise::PiecewiseSmooth;
use crate::sensitivity::Sensitivity;
use crate::sparse::Matrix;

/// The function f(x(θ), θ), where x(θ) solves a complementarity problem with the parameters θ.
///
/// Each evaluation solves the problem, from the solution at the point that was kept last, and takes the gradient by one adjoint solve. At
/// kinks it is an element of the generalised derivative, in the sense of [`Sensitivity::vjp`]; where the solutions are not known to be one
/// function of θ near a point there is none, and the bundle method avoids the point.
#[derive(Debug, Clone)]
pub struct Implicit<F, P, O> {
    problem: Mcp<F>,
    map: P,
    objective: O,
    solver: McpSolver,
    last: Vec<f64>,
    kept: Vec<f64>,
}

impl<F: McpFunction, P: PiecewiseSmooth, O: McpFunction> Implicit<F, P, O> {
    /// The function f (one value of the unknowns x and behind them the parameters) of the solutions of a problem
    /// [with parameters](Mcp::with_parameters), which is solved from `x0` first. `map` has the same solutions and gives their derivatives: a
    /// copy of the problem, where its function is smooth, or [`parametric_mcp`](crate::parametric_mcp).
    ///
    /// # Errors
    /// Numbers of variables, parameters or values that do not fit; an `x0` of the wrong length or not finite.
    pub fn new(problem: Mcp<F>, map: P, objective: O, x0: &[f64]) -> Result<Self, OptimiseError> {
        let (n, m) = (problem.len(), problem.function().num_vars());
        let lengths = [
            ("x0", n, x0.len()),
            ("the variables of the map", m, map.num_vars()),
            ("the residual of the map", n, map.num_residuals()),
            ("the variables of the objective", m, objective.num_vars()),
            ("the value of the objective", 1, objective.num_values()),
        ];
        for (what, expected, found) in lengths {
            check_length(what, found, expected)?;
        }
        if let Some(index) = x0.iter().position(|x| !x.is_finite()) {
            let value = x0[index];
            let what = "x0";
            return Err(ComplementarityError::Input(InputError::NotFinite { what, index, value }).into());
        }
        Ok(Self {
            problem,
            map,
            objective,
            solver: McpSolver::default(),
            last: x0.to_vec(),
            kept: x0.to_vec(),
        })
    }

    /// The function with an observer of each iteration of its solves, which may stop them: the bundle method
    /// then ends with its best point.
    pub fn observed<'o>(
        &'o mut self,
        observe: &'o mut dyn FnMut(&McpIteration) -> ControlFlow<()>,
    ) -> impl Objective {
        Observed {
            function: self,
            observe,
        }
    }

    fn attempt(
        &mut self,
        parameters: &[f64],
        gradient: &mut [f64],
        observe: &mut dyn FnMut(&McpIteration) -> ControlFlow<()>,
    ) -> Result<f64, OptimiseError> {
        let n = self.kept.len();
        let mut x = self.kept.clone();
        let status = self
            .solver
            .solve_observed(&self.problem.at_parameters(parameters)?, &mut x, observe)?
            .status;
        if !status.is_solved() {
            return Err(OptimiseError::Unsolved(status));
        }
        let mut solution = Sensitivity::with_idle_parameters(&self.map, &x, parameters)?;
        self.last.copy_from_slice(solution.x());
        let mut all = self.last.clone();
        all.extend(parameters);
        let mut value = [0.0];
        self.objective.value(&all, &mut value);
        let mut derivative = Matrix::zeros(self.objective.pattern());
        self.objective.jacobian(&all, &mut derivative);
        let mut slopes = vec![0.0; all.len()];
        derivative.triplets().for_each(|(_, j, v)| slopes[j] += v);
        if !slopes.iter().all(|s| s.is_finite()) || derivative.stray().is_some() {
            return Err(OptimiseError::NotFinite);
        }
        let through = solution.vjp(&slopes[..n])?;
        for ((g, own), through) in gradient.iter_mut().zip(&slopes[n..]).zip(through) {
            *g = own + through;
        }
        Ok(value[0])
    }
}

impl<F: McpFunction, P: PiecewiseSmooth, O: McpFunction> Objective for Implicit<F, P, O> {
    fn evaluate(&mut self, parameters: &[f64], gradient: &mut [f64]) -> Result<f64, Cause> {
        let mut observe = |_: &McpIteration| ControlFlow::Continue(());
        self.attempt(parameters, gradient, &mut observe)
            .map_err(Cause::new)
    }

    fn limit_time(&mut self, left: Duration) {
        self.solver.limit_time(left);
    }

    fn keep(&mut self) {
        self.kept.copy_from_slice(&self.last);
    }

    fn state(&self) -> &[f64] {
        &self.kept
    }
}

/// [`Implicit`] with an observer.
struct Observed<'o, F, P, O> {
    function: &'o mut Implicit<F, P, O>,
    observe: &'o mut dyn FnMut(&McpIteration) -> ControlFlow<()>,
}

impl<F: McpFunction, P: PiecewiseSmooth, O: McpFunction> Objective for Observed<'_, F, P, O> {
    fn evaluate(&mut self, parameters: &[f64], gradient: &mut [f64]) -> Result<f64, Cause> {
        (self.function.attempt(parameters, gradient, self.observe)).map_err(Cause::new)
    }

    fn limit_time(&mut self, left: Duration) {
        self.function.limit_time(left);
    }

    fn keep(&mut self) {
        self.function.keep();
    }

    fn state(&self) -> &[f64] {
        self.function.state()
    }
}
