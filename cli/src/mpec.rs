//! Mathematical programs with equilibrium constraints (MPECs): an objective over upper-level variables, and complementarities that determine
//! the other variables for given upper-level ones.

use std::cell::RefCell;

use semismooth::InputError;
use semismooth::complementarity::{ComplementarityError, Mcp, McpFunction};
use semismooth::optimise::{Bundle, BundleOptions, Implicit, OptimiseError};
use semismooth::sparse::{Matrix, Pattern};
use semismooth::variational::Polyhedron;
use thiserror::Error;

use crate::graph::Gradient;
use crate::model::{Model, Objective, Row, RowKind, linear_value};
use crate::options::Options;
use crate::solution::Solution;
use crate::solve::{Observer, code};
use crate::square::{Square, SquareError};

/// Why a mathematical program with equilibrium constraints is not solved.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum MpecError {
    /// Which variables are the upper-level ones is not clear.
    #[error(
        "the problem is a mathematical program with equilibrium constraints (MPEC), and it is not clear which {upper} of its variables are the \
         upper-level ones: {equations} equations do not say which variables they determine; give bounds to upper-level variables, and to no \
         other variable that no complementarity names"
    )]
    Levels {
        /// Number of upper-level variables.
        upper: usize,
        /// Number of equations.
        equations: usize,
    },
    /// A constraint on variables of the lower level.
    #[error(
        "the problem is a mathematical program with equilibrium constraints (MPEC) with {row} as a constraint on lower-level variables, or a \
         curved one; only bounds and linear inequalities in the upper-level variables are supported"
    )]
    Constraint {
        /// The row.
        row: String,
    },
    /// Functions with kinks.
    #[error(
        "the problem is a mathematical program with equilibrium constraints (MPEC) whose functions have kinks; only smooth functions are \
         supported there"
    )]
    Kinks,
    /// The objective depends on a variable that only stands for the body of a complementarity.
    #[error(
        "the problem is a mathematical program with equilibrium constraints (MPEC) whose objective depends on {variable}, which stands for the \
         other side of a complementarity; write its expression in the objective"
    )]
    Slack {
        /// The variable.
        variable: String,
    },
    /// The rest of the problem is not square.
    #[error(
        "the problem is a mathematical program with equilibrium constraints (MPEC) whose lower level is no complementarity problem: {0}"
    )]
    LowerLevel(#[from] SquareError),
    /// The library refused the problem, or the start.
    #[error("the problem is a mathematical program with equilibrium constraints (MPEC): {0}")]
    Library(#[from] OptimiseError),
}

impl From<ComplementarityError> for MpecError {
    fn from(error: ComplementarityError) -> Self {
        Self::Library(error.into())
    }
}

impl From<InputError> for MpecError {
    fn from(error: InputError) -> Self {
        Self::Library(ComplementarityError::from(error).into())
    }
}

/// Whether there are more variables than complementarities and equations, so that some are left to the objective.
#[must_use]
pub fn is_mpec(model: &Model) -> bool {
    let is_condition =
        |row: &&Row| matches!(row.kind, RowKind::Complements { .. }) || row.kind.equation().is_some();
    model.lower.len() > model.rows.iter().filter(is_condition).count()
}

/// The upper-level variables: of those that no complementarity names, equations determine first the ones that stand for the other side of a
/// complementarity, then those without bounds; the others are left.
fn upper_level(model: &Model) -> Result<Vec<usize>, MpecError> {
    let mut class = vec![2_u8; model.lower.len()];
    for (j, class) in class.iter_mut().enumerate() {
        if model.lower[j] == f64::NEG_INFINITY && model.upper[j] == f64::INFINITY {
            *class = 1;
        }
    }
    let mut named = vec![false; class.len()];
    for row in &model.rows {
        if let RowKind::Complements { variable, .. } = row.kind {
            named[variable] = true;
            if let &[(slack, _)] = &row.linear[..]
                && class[slack as usize] == 1
            {
                class[slack as usize] = 0;
            }
        }
    }
    let equations = model.rows.iter().filter(|r| r.kind.equation().is_some()).count();
    let open = || (0..class.len()).filter(|&j| !named[j]);
    let upper = open().count() - equations;
    for least in 0..=3 {
        let left: Vec<usize> = open().filter(|&j| class[j] >= least).collect();
        if left.len() == upper {
            return Ok(left);
        }
    }
    Err(MpecError::Levels { upper, equations })
}

/// The bounds and linear inequalities of the upper-level variables; rows of the lower level alone remain in the model.
fn upper_set(model: &Model, upper: &[usize]) -> Result<Polyhedron, MpecError> {
    let place = |j: usize| upper.iter().position(|u| *u == j);
    let (mut entries, mut right) = (Vec::new(), Vec::new());
    for (index, row) in model.rows.iter().enumerate() {
        let RowKind::Range { lower, upper } = row.kind else {
            continue;
        };
        if row.kind.equation().is_some() || row.kind.is_free() {
            continue;
        }
        let constant = match &row.expression {
            None => Some(0.0),
            Some(expression) => model.graph.constant(expression.root),
        };
        let places: Option<Vec<(usize, f64)>> = row
            .linear
            .iter()
            .map(|(j, v)| Some((place(*j as usize)?, *v)))
            .collect();
        let (Some(constant), Some(places)) = (constant, places) else {
            let row = model.names.row(index);
            return Err(MpecError::Constraint { row });
        };
        for (sign, bound) in [(-1.0, lower), (1.0, upper)] {
            if bound.is_finite() {
                entries.extend(places.iter().map(|(j, v)| (right.len(), *j, sign * v)));
                right.push(sign * (bound - constant));
            }
        }
    }
    let [lower, higher] = [&model.lower, &model.upper].map(|b| upper.iter().map(|j| b[*j]).collect());
    let rows = Matrix::from_triplets(right.len(), upper.len(), &entries)?;
    Ok(Polyhedron::boxed(lower, higher)?.with_inequalities(rows, right)?)
}

/// The model at given upper-level variables: an equation for each of them, whose right-hand side the parameters are.
fn lower_level(model: &Model, upper: &[usize]) -> Model {
    let mut square = model.clone();
    square
        .rows
        .retain(|row| matches!(row.kind, RowKind::Complements { .. }) || row.kind.equation().is_some());
    let Some(at) = model.rows.first().map(|row| row.at) else {
        return square;
    };
    for &j in upper {
        square.lower[j] = f64::NEG_INFINITY;
        square.upper[j] = f64::INFINITY;
        square.rows.push(Row {
            expression: None,
            at,
            linear: vec![(j as u32, 1.0)],
            kind: RowKind::Range {
                lower: 0.0,
                upper: 0.0,
            },
        });
    }
    square
}

/// The function of a square problem, with the upper-level variables as parameters behind its unknowns.
#[derive(Debug)]
struct Lower<'s> {
    square: &'s Square<'s>,
    /// The component of each parameter.
    places: Vec<usize>,
}

impl McpFunction for Lower<'_> {
    fn num_values(&self) -> usize {
        self.square.num_vars()
    }
    fn num_vars(&self) -> usize {
        self.num_values() + self.places.len()
    }
    fn value(&self, x: &[f64], out: &mut [f64]) {
        let (own, parameters) = x.split_at(out.len());
        self.square.value(own, out);
        self.places.iter().zip(parameters).for_each(|(i, p)| out[*i] -= p);
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let n = self.num_values();
        self.square.jacobian(&x[..n], jac);
        self.places
            .iter()
            .enumerate()
            .for_each(|(k, i)| jac.add(*i, n + k, -1.0));
    }
    fn pattern(&self) -> Pattern {
        let (n, own) = (self.num_values(), self.square.pattern());
        let mut entries: Vec<(usize, usize)> = Vec::new();
        for j in 0..n {
            let rows = &own.row_idx()[own.col_ptr()[j]..own.col_ptr()[j + 1]];
            entries.extend(rows.iter().map(|i| (*i, j)));
        }
        entries.extend(self.places.iter().enumerate().map(|(k, i)| (*i, n + k)));
        Pattern::from_entries(n, self.num_vars(), entries)
            .unwrap_or_else(|_| Pattern::full(n, self.num_vars()))
    }
}

/// The objective as a function of the same variables, which depends on the unknowns alone: the upper-level variables are among them.
#[derive(Debug)]
struct Value<'s> {
    model: &'s Model,
    objective: &'s Objective,
    square: &'s Square<'s>,
    vars: usize,
    /// The component of each variable.
    components: Vec<Option<usize>>,
    work: RefCell<(Vec<f64>, Gradient)>,
}

impl Value<'_> {
    fn sign(&self) -> f64 {
        if self.objective.maximize { -1.0 } else { 1.0 }
    }
}

impl McpFunction for Value<'_> {
    fn num_values(&self) -> usize {
        1
    }
    fn num_vars(&self) -> usize {
        self.vars
    }
    fn value(&self, x: &[f64], out: &mut [f64]) {
        let all = self.square.extend(&x[..self.square.num_vars()]);
        let (values, _) = &mut *self.work.borrow_mut();
        self.model.graph.set_variables(&all, values);
        let nonlinear = self.model.graph.evaluate(&self.objective.expression, values);
        out[0] = self.sign() * (nonlinear + linear_value(&self.objective.linear, &all));
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let all = self.square.extend(&x[..self.square.num_vars()]);
        let (values, gradient) = &mut *self.work.borrow_mut();
        let graph = &self.model.graph;
        graph.set_variables(&all, values);
        graph.evaluate(&self.objective.expression, values);
        let add = &mut |j: usize, v: f64| {
            if let Some(i) = self.components[j] {
                jac.add(0, i, v);
            }
        };
        gradient.sweep(graph, &self.objective.expression, values, self.sign(), add);
        for (j, v) in &self.objective.linear {
            add(*j as usize, self.sign() * v);
        }
    }
}

/// Minimises the objective over the upper-level variables, by the bundle method from the start of the file.
///
/// # Errors
/// A problem whose levels are not clear, or that the method cannot solve.
pub fn mpec(
    model: &Model,
    objective: &Objective,
    options: &Options,
    observe: &mut Observer<'_>,
) -> Result<Solution, MpecError> {
    if model.graph.has_kinks() {
        return Err(MpecError::Kinks);
    }
    let upper = upper_level(model)?;
    let set = upper_set(model, &upper)?;
    let fixed = lower_level(model, &upper);
    let square = Square::new(&fixed)?;
    let n = square.num_vars();
    let mut components = vec![None; model.lower.len()];
    (0..n).for_each(|i| components[square.origin(i).0] = Some(i));
    let mut gradient = Gradient::new(&model.graph);
    let mut slack = None;
    let mut note = |j: usize| slack = slack.or(components[j].is_none().then_some(j));
    gradient.variables(&model.graph, &objective.expression, &mut note);
    objective
        .linear
        .iter()
        .filter(|(_, v)| *v != 0.0)
        .for_each(|(j, _)| note(*j as usize));
    if let Some(variable) = slack {
        let variable = model.names.variable(variable);
        return Err(MpecError::Slack { variable });
    }
    let (lower, higher) = square.bounds(false);
    let problem = || {
        let places = upper.iter().filter_map(|j| components[*j]).collect();
        let function = Lower {
            square: &square,
            places,
        };
        Mcp::with_parameters(function, lower.clone(), higher.clone()).map_err(OptimiseError::from)
    };
    let value = Value {
        model,
        objective,
        square: &square,
        vars: n + upper.len(),
        components: components.clone(),
        work: RefCell::new((model.graph.workspace(), gradient)),
    };
    let start: Vec<f64> = upper.iter().map(|j| model.start[*j]).collect();
    let mut f = Implicit::new(problem()?, problem()?, value, &square.restrict(&model.start))?;
    let bundle = Bundle::new(BundleOptions::default().with_max_time(options.solver.max_time));
    let found = bundle.minimise(&set, &start, &mut f.observed(observe));
    if let Some(status) = found.as_ref().err().and_then(OptimiseError::stopped) {
        let message = format!(
            "Not solved: mathematical program with equilibrium constraints: {status}, before the lower level was solved at the start, which \
             is returned."
        );
        return Ok(Solution {
            message,
            code: code(status),
            x: model.start.clone(),
            duals: Vec::new(),
            objective: 0,
        });
    }
    let (_, report) = found?;
    let best = if objective.maximize {
        -report.value
    } else {
        report.value
    };
    let code = code(report.status);
    let what = match code {
        0 => "Stationary in the sense of Clarke, to the tolerance".to_owned(),
        _ => format!("Not solved ({})", report.status),
    };
    let mut message = format!(
        "{what}: mathematical program with equilibrium constraints, objective {best:?}; subgradient {:.1e} of gradients up to {:.1e}, \
         points within {:.0e}, {} iterations, {} evaluations.",
        report.subgradient_norm, report.gradient_norm, report.radius, report.iterations, report.evaluations
    );
    message.push_str(match code {
        0 => "\nWhether it is a minimum has not been decided; other starts may lead to better points.",
        _ => "\nThe best point found is returned.",
    });
    if let Some(trouble) = report.trouble.filter(|_| code != 0) {
        message.push_str(&format!("\nAt some points there is no gradient: {trouble}."));
    }
    Ok(Solution {
        message,
        code,
        x: square.extend(&report.state),
        duals: Vec::new(),
        objective: 0,
    })
}
