//! From a model to a solution: the choice of the problem to solve, the result, and what it proves.

use std::ops::ControlFlow;

use semismooth::complementarity::{
    AffineFunction, BoundState, ComplementarityError, Mcp, McpFunction, McpIteration, McpReport, McpSolver,
    kkt,
};
use semismooth::run::Status;
use semismooth::sparse::Matrix;
use thiserror::Error;

use crate::model::{Model, Objective, RowKind};
use crate::mpec::{MpecError, is_mpec, mpec};
use crate::options::Options;
use crate::program::{Nlp, NlpError};
use crate::second_order::{SecondOrder, second_order};
use crate::solution::Solution;
use crate::square::{Square, SquareError};

/// Why this program cannot solve a model. The outcome of a solve is in the [`Solution`].
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SolveError {
    /// Binary or integer variables.
    #[error("{0} variables are integer; this program solves problems with continuous variables")]
    Integers(usize),
    /// Logical constraints.
    #[error(
        "{0} constraints are logical; this program solves problems with equations, inequalities and complementarities"
    )]
    Logical(usize),
    /// The number of an objective that does not exist.
    #[error("objno={number} is out of range; the problem has {available} objectives")]
    Objective {
        /// The requested number.
        number: usize,
        /// How many there are.
        available: usize,
    },
    /// The model is not a mixed complementarity problem.
    #[error(transparent)]
    Square(#[from] SquareError),
    /// Second derivatives of the program are not available.
    #[error(transparent)]
    Program(#[from] NlpError),
    /// A mathematical program with equilibrium constraints that is not supported.
    #[error(transparent)]
    Mpec(#[from] MpecError),
    /// The library refused the problem.
    #[error(transparent)]
    Library(#[from] ComplementarityError),
}

/// Is called after each iteration, and may stop the run.
pub type Observer<'a> = dyn FnMut(&McpIteration) -> ControlFlow<()> + 'a;

/// Solves a model: as a mathematical program with equilibrium constraints if it has complementarities, an objective and more variables than
/// conditions, as a mixed complementarity problem if it has complementarities otherwise, or as many equations as variables and no objective;
/// else by its first-order conditions.
///
/// # Errors
/// A model that this program cannot solve.
pub fn solve(model: &Model, options: &Options, observe: &mut Observer<'_>) -> Result<Solution, SolveError> {
    if model.header.integers > 0 {
        return Err(SolveError::Integers(model.header.integers));
    }
    if model.header.logical > 0 {
        return Err(SolveError::Logical(model.header.logical));
    }
    let available = model.objectives.len();
    let objective = match options.objno.checked_sub(1) {
        Some(index) if index < available => Some(&model.objectives[index]),
        // 1 is the default, even for a model without objectives.
        None | Some(0) => None,
        Some(_) => {
            return Err(SolveError::Objective {
                number: options.objno,
                available,
            });
        }
    };
    let is_complementarity = |kind: RowKind| matches!(kind, RowKind::Complements { .. });
    let mut solution = match objective.filter(|o| !is_constant(model, o)) {
        Some(objective) if model.rows.iter().any(|r| is_complementarity(r.kind)) && is_mpec(model) => {
            mpec(model, objective, options, observe)?
        }
        _ if model.rows.iter().any(|r| is_complementarity(r.kind)) => {
            let ignored = objective.is_some_and(|o| !is_constant(model, o));
            square(model, options, ignored, observe)?
        }
        Some(objective) => program(model, objective, options, observe)?,
        None => square(model, options, false, observe)?,
    };
    solution.objective = options.objno.saturating_sub(1);
    Ok(solution)
}

fn is_constant(model: &Model, objective: &Objective) -> bool {
    let nonlinear = model.graph.constant(objective.expression.root).is_some();
    nonlinear && objective.linear.iter().all(|(_, c)| *c == 0.0)
}

fn square(
    model: &Model,
    options: &Options,
    ignored: bool,
    observe: &mut Observer<'_>,
) -> Result<Solution, SolveError> {
    let square = Square::new(model)?;
    let mut x = square.restrict(&model.start);
    let function = square.is_affine().then(|| affine(&square)).transpose()?.flatten();
    let mut run = |x: &mut [f64], stated: bool, options: &Options| {
        let bounds = square.bounds(stated);
        match &function {
            Some(function) => run(function, bounds, x, options, observe),
            None => run(&square, bounds, x, options, observe),
        }
    };
    let mut report = run(&mut x, false, options)?;
    let mut doubt = Doubt::new(model, &square, &x, &report);
    if report.is_solved() && doubt.any() {
        // Solve with only the bounds that belong to conditions: a solution counts if it satisfies the other bounds, too.
        let mut y = x.clone();
        let mut rest = options.clone();
        rest.solver.max_time = rest.solver.max_time.map(|all| all.saturating_sub(report.time));
        let other = run(&mut y, true, &rest)?;
        let (lower, upper) = square.bounds(false);
        if other.is_solved() && (0..y.len()).all(|i| lower[i] <= y[i] && y[i] <= upper[i]) {
            (x, report) = (y, other);
            doubt = Doubt::default();
        }
    }
    let (mut code, mut message) = verdict(&report, square.what());
    let all = square.extend(&x);
    if report.is_solved() {
        (code, message) = doubt.word(code, message);
        code = confirm(model, &all, options, code, &mut message);
    }
    if let Status::EvaluationFailure { component } = report.status {
        let (_, row) = square.origin(component);
        message.push_str(&format!("\nThe component belongs to {}.", model.names.row(row)));
    }
    if ignored {
        message.push_str("\nThe objective plays no part in a complementarity problem.");
    }
    Ok(Solution {
        message,
        code,
        x: all,
        duals: Vec::new(),
        objective: 0,
    })
}

fn program(
    model: &Model,
    objective: &Objective,
    options: &Options,
    observe: &mut Observer<'_>,
) -> Result<Solution, SolveError> {
    let nlp = Nlp::new(model, objective)?;
    let (lower, upper) = nlp.bounds();
    let variables = lower.len();
    let mut z = nlp.start();
    let kinds = nlp.kinds();
    let problem = kkt(&nlp, &kinds, lower, upper)?;
    let bounds = (problem.lower().to_vec(), problem.upper().to_vec());
    let quadratic = match nlp.is_quadratic() {
        true => affine(problem.function())?,
        false => None,
    };
    let report = if let Some(function) = &quadratic {
        run(function, bounds.clone(), &mut z, options, observe)?
    } else {
        let mut solver = McpSolver::new(options.solver.clone());
        solver.solve_observed(&problem, &mut z, observe)?.clone()
    };
    let (mut code, mut message) = verdict(&report, "first-order (KKT) conditions");
    let (x, y) = z.split_at(variables);
    let value = nlp.objective(x);
    if report.is_solved() {
        let aim = if objective.maximize { "maximum" } else { "minimum" };
        let mut f = vec![0.0; z.len()];
        problem.function().value(&z, &mut f);
        let second = match model.graph.has_kinks() {
            true => SecondOrder::Undecided,
            false => second_order(&nlp, &z, &f, &report.states),
        };
        message.push_str(&format!("\nA KKT point, objective {value:?}; "));
        message.push_str(&match second {
            SecondOrder::Strict => format!("a strict local {aim}, by second derivatives."),
            SecondOrder::Violated => format!("no local {aim}, by second derivatives."),
            SecondOrder::Undecided => format!("whether it is a {aim} has not been decided."),
        });
        if model.graph.has_kinks() {
            message.push_str("\nAt kinks the derivatives are those of one of the pieces.");
            code = confirm(model, &x[..model.lower.len()], options, code, &mut message);
        }
    } else if let (Status::NoSolution, Some(function)) = (report.status, &quadratic) {
        let text;
        (code, text) = without_kkt_point(&nearest(function, variables)?, bounds, options)?;
        message.push_str(text);
    }
    Ok(Solution {
        message,
        code,
        x: x[..model.lower.len()].to_vec(),
        duals: nlp.duals(y),
        objective: 0,
    })
}

/// Why a quadratic program has no KKT point; `nearest` is the problem of the feasible point of least norm. A quadratic function that is
/// bounded below on a polyhedron attains its minimum there (Frank and Wolfe 1956), at a KKT point.
fn without_kkt_point(
    nearest: &AffineFunction,
    bounds: (Vec<f64>, Vec<f64>),
    options: &Options,
) -> Result<(u16, &'static str), SolveError> {
    let mut z = vec![0.0; nearest.num_vars()];
    let report = run(nearest, bounds, &mut z, options, &mut |_| {
        ControlFlow::Continue(())
    })?;
    Ok(match report.status {
        Status::NoSolution => (200, "\nNo point satisfies the constraints (proven)."),
        Status::Solved => (
            300,
            "\nThe problem has no KKT point (proven), but its constraints can be satisfied: it is unbounded.",
        ),
        _ => (
            504,
            "\nThe problem has no KKT point (proven): it is infeasible or unbounded.",
        ),
    })
}

/// The first-order conditions of the same constraints with ½‖x‖² as objective, x the first `n` unknowns.
fn nearest(function: &AffineFunction, n: usize) -> Result<AffineFunction, SolveError> {
    let size = function.num_vars();
    let kept = function.matrix().triplets().filter(|&(i, j, _)| i >= n || j >= n);
    let entries: Vec<_> = kept.chain((0..n).map(|i| (i, i, 1.0))).collect();
    let q = function.q().iter().enumerate();
    let q = q.map(|(i, q)| if i < n { 0.0 } else { *q }).collect();
    let matrix = Matrix::from_triplets(size, size, &entries).map_err(ComplementarityError::from)?;
    Ok(AffineFunction::new(matrix, q)?)
}

/// An affine function in the form F = M x + q, which lets the solver use that it is affine. `None` if a coefficient is not finite: the
/// general solver then says which component cannot be evaluated.
fn affine(function: &impl McpFunction) -> Result<Option<AffineFunction>, ComplementarityError> {
    let zero = vec![0.0; function.num_vars()];
    let mut q = zero.clone();
    let mut matrix = Matrix::zeros(function.pattern());
    function.value(&zero, &mut q);
    function.jacobian(&zero, &mut matrix);
    let finite = q.iter().chain(matrix.values()).all(|v| v.is_finite());
    finite.then(|| AffineFunction::new(matrix, q)).transpose()
}

fn run<F: McpFunction>(
    function: F,
    (lower, upper): (Vec<f64>, Vec<f64>),
    x: &mut [f64],
    options: &Options,
    observe: &mut Observer<'_>,
) -> Result<McpReport, ComplementarityError> {
    let problem = Mcp::new(function, lower, upper)?;
    let mut solver = McpSolver::new(options.solver.clone());
    solver.solve_observed(&problem, x, observe).cloned()
}

/// The code, 100 instead of 0 if a row with kinks or jumps holds only relative to its slopes: the message then names it.
fn confirm(model: &Model, x: &[f64], options: &Options, code: u16, message: &mut String) -> u16 {
    let tolerance = options.solver.tolerance.max(options.solver.acceptable);
    let violated = match code {
        0 => model.violated(x, tolerance),
        _ => Vec::new(),
    };
    let Some(&(row, violation)) = violated.first() else {
        return code;
    };
    message.push_str(&format!(
        "\nIn doubt: {}, which has kinks or jumps, has the residual {violation:.1e}{}; it is small relative to the slopes, but not to the \
         values of its operations.",
        model.names.row(row),
        more(violated.len() - 1)
    ));
    100
}

/// What a message says about rows that it does not name.
fn more(rows: usize) -> String {
    match rows {
        0 => String::new(),
        rows => format!(", and {rows} more such rows"),
    }
}

/// AMPL's code and the message for a result.
fn verdict(report: &McpReport, what: &str) -> (u16, String) {
    let numbers = format!(
        "residual {:.1e}, error {:.1e}, {} iterations, {} evaluations",
        report.residual, report.error, report.iterations, report.evaluations
    );
    let code = match code(report.status) {
        0 => return (0, format!("Solved: {what}; {numbers}.")),
        code => code,
    };
    (code, format!("Not solved: {what}: {}; {numbers}.", report.status))
}

/// AMPL's code for how a run ended.
pub(crate) fn code(status: Status) -> u16 {
    match status {
        Status::Solved => 0,
        Status::AtRounding => 100,
        Status::NoSolution => 200,
        Status::IterationLimit => 400,
        Status::TimeLimit => 401,
        Status::Stationary { .. } => 501,
        Status::Unbounded => 502,
        Status::EvaluationFailure { .. } => 503,
        Status::Interrupted => 505,
        _ => 500,
    }
}

/// Variables at bounds that do not belong to the condition of their row, although the row is not zero there.
#[derive(Debug, Clone, Default)]
struct Doubt {
    /// For equations: the first variable, its row, the value of the row, and the number of further ones.
    equation: Option<(String, String, f64, usize)>,
    /// The same for complementarities.
    condition: Option<(String, String, f64, usize)>,
}

impl Doubt {
    fn new(model: &Model, square: &Square<'_>, x: &[f64], report: &McpReport) -> Self {
        let mut doubt = Self::default();
        let mut f = vec![0.0; x.len()];
        square.value(x, &mut f);
        for (i, state) in report.states.iter().enumerate() {
            let (variable, row) = square.origin(i);
            let (lower, upper) = match model.rows[row].kind {
                RowKind::Complements { lower, upper, .. } => (lower, upper),
                RowKind::Range { .. } => (false, false),
            };
            // The sign says which bound is active; needed if both bounds are equal.
            let named = if f[i] > 0.0 { lower } else { upper };
            if *state == BoundState::Interior || named || f[i] == 0.0 {
                continue;
            }
            let found = match square.is_equation(i) {
                true => &mut doubt.equation,
                false => &mut doubt.condition,
            };
            match found {
                Some((.., more)) => *more += 1,
                None => *found = Some((model.names.variable(variable), model.names.row(row), f[i], 0)),
            }
        }
        doubt
    }

    fn any(&self) -> bool {
        self.equation.is_some() || self.condition.is_some()
    }

    fn word(&self, code: u16, message: String) -> (u16, String) {
        if let Some((variable, row, value, others)) = &self.equation {
            let text = format!(
                "Not solved: {variable} rests at a bound, where {row}, an equation, has the residual {value:.1e}{}; no point was \
                 found that satisfies both.",
                more(*others)
            );
            return (500, text);
        }
        if let Some((variable, row, value, others)) = &self.condition {
            let text = format!(
                "{message}\nIn doubt: {variable} rests at a bound that {row}, which complements it and has the value {value:.1e}, \
                 does not name{}. The point solves the problem in which all bounds of variables belong to the conditions.",
                more(*others)
            );
            return (100, text);
        }
        (code, message)
    }
}
