//! Problems with an objective, as programs whose first-order conditions are a complementarity problem.

use std::cell::RefCell;

use semismooth::InputError;
use semismooth::complementarity::{ConstraintKind, Program};
use semismooth::sparse::{Matrix, Pattern};

use crate::graph::{Expression, Gradient, Hessian, TooDense};
use crate::model::{Model, Objective, RowKind, linear_value};

/// Largest number of entries of a Hessian (some gigabytes).
const MAX_HESSIAN: usize = 30_000_000;

/// A constraint c(x) ≥ 0 or c(x) = 0: sign · (body − slack − right-hand side).
#[derive(Debug, Clone, Copy, PartialEq)]
struct Constraint {
    row: usize,
    sign: f64,
    right: f64,
    /// The variable that stands for the body of a row with two different bounds.
    slack: Option<usize>,
    kind: ConstraintKind,
}

/// A model with an objective, in its variables and one more for each row with two different bounds.
#[derive(Debug)]
pub struct Nlp<'m> {
    model: &'m Model,
    objective: &'m Objective,
    constraints: Vec<Constraint>,
    variables: usize,
    hessian_pattern: Pattern,
    constraint_pattern: Pattern,
    work: RefCell<Work>,
}

#[derive(Debug)]
struct Work {
    values: Vec<f64>,
    gradient: Gradient,
    hessian: Hessian,
}

/// A program whose derivatives do not fit into memory.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NlpError {
    /// A dense Hessian of many variables.
    #[error(transparent)]
    Hessian(#[from] TooDense),
    /// A pattern could not be made.
    #[error(transparent)]
    Pattern(#[from] InputError),
}

impl<'m> Nlp<'m> {
    /// The program of one objective; complementarities are ignored.
    ///
    /// # Errors
    /// Derivatives that do not fit into memory.
    pub fn new(model: &'m Model, objective: &'m Objective) -> Result<Self, NlpError> {
        let mut constraints = Vec::new();
        let mut variables = model.lower.len();
        for (row, content) in model.rows.iter().enumerate() {
            let RowKind::Range { lower, upper } = content.kind else {
                continue;
            };
            let constraint = |sign, right, slack, kind| Constraint {
                row,
                sign,
                right,
                slack,
                kind,
            };
            constraints.push(match (lower.is_finite(), upper.is_finite()) {
                (true, true) if lower == upper => constraint(1.0, lower, None, ConstraintKind::Zero),
                (true, true) => {
                    variables += 1;
                    constraint(1.0, 0.0, Some(variables - 1), ConstraintKind::Zero)
                }
                (true, false) => constraint(1.0, lower, None, ConstraintKind::Nonnegative),
                (false, true) => constraint(-1.0, upper, None, ConstraintKind::Nonnegative),
                (false, false) => continue,
            });
        }
        let mut hessian = Hessian::new(&model.graph);
        let curved = constraints
            .iter()
            .filter_map(|c| model.rows[c.row].expression.as_ref());
        let curved = curved.chain([&objective.expression]);
        let entries = hessian.pattern(&model.graph, curved, MAX_HESSIAN)?;
        let hessian_pattern = Pattern::from_entries(variables, variables, entries)?;
        let entries = constraints.iter().enumerate().flat_map(|(i, c)| {
            let listed = model.rows[c.row].linear.iter().map(|(j, _)| *j as usize);
            listed.chain(c.slack).map(move |j| (i, j))
        });
        let constraint_pattern = Pattern::from_entries(constraints.len(), variables, entries)?;
        Ok(Self {
            objective,
            constraints,
            variables,
            hessian_pattern,
            constraint_pattern,
            work: RefCell::new(Work {
                values: model.graph.workspace(),
                gradient: Gradient::new(&model.graph),
                hessian,
            }),
            model,
        })
    }

    /// Whether the first-order conditions are affine: a quadratic objective and affine constraints.
    #[must_use]
    pub fn is_quadratic(&self) -> bool {
        let curved = self.constraints.iter().filter_map(|c| self.expression(c));
        let degrees = self
            .model
            .graph
            .degrees([&self.objective.expression].into_iter().chain(curved));
        degrees[0] <= 2 && degrees[1..].iter().all(|d| *d <= 1)
    }

    /// The kind of each constraint.
    #[must_use]
    pub fn kinds(&self) -> Vec<ConstraintKind> {
        self.constraints.iter().map(|c| c.kind).collect()
    }

    /// Bounds of all variables.
    #[must_use]
    pub fn bounds(&self) -> (Vec<f64>, Vec<f64>) {
        let (mut lower, mut upper) = (self.model.lower.clone(), self.model.upper.clone());
        for c in self.constraints.iter().filter(|c| c.slack.is_some()) {
            if let RowKind::Range { lower: l, upper: u } = self.model.rows[c.row].kind {
                lower.push(l);
                upper.push(u);
            }
        }
        (lower, upper)
    }

    /// Whether the bounds of a variable are equal.
    #[must_use]
    pub fn is_fixed(&self, variable: usize) -> bool {
        let bounds = self.model.lower.get(variable).zip(self.model.upper.get(variable));
        bounds.is_some_and(|(l, u)| l == u)
    }

    /// A start (x, y): the initial values of the model, the values of rows with two bounds, the multipliers of the file.
    #[must_use]
    pub fn start(&self) -> Vec<f64> {
        let work = &mut *self.work.borrow_mut();
        let graph = &self.model.graph;
        let mut x = self.model.start.clone();
        for ((x, lower), upper) in x.iter_mut().zip(&self.model.lower).zip(&self.model.upper) {
            *x = x.max(*lower).min(*upper);
        }
        graph.set_variables(&x, &mut work.values);
        for c in self.constraints.iter().filter(|c| c.slack.is_some()) {
            let body = self.model.rows[c.row].body(graph, &mut work.values);
            x.push(if body.is_finite() { body } else { 0.0 });
        }
        let multipliers = self.constraints.iter();
        x.extend(multipliers.map(|c| c.sign * self.sense() * self.model.duals[c.row]));
        x
    }

    /// The multipliers of the rows in AMPL's sign, the change of the objective with the right-hand side.
    #[must_use]
    pub fn duals(&self, multipliers: &[f64]) -> Vec<f64> {
        let mut duals = vec![0.0; self.model.rows.len()];
        for (c, y) in self.constraints.iter().zip(multipliers) {
            // Adding 0 turns −0 into 0.
            duals[c.row] = c.sign * self.sense() * y + 0.0;
        }
        duals
    }

    /// The objective at x.
    #[must_use]
    pub fn objective(&self, x: &[f64]) -> f64 {
        let work = &mut *self.work.borrow_mut();
        self.set(x, work);
        let nonlinear = self
            .model
            .graph
            .evaluate(&self.objective.expression, &mut work.values);
        nonlinear + linear_value(&self.objective.linear, x)
    }

    /// 1 for a minimum, −1 for a maximum.
    fn sense(&self) -> f64 {
        if self.objective.maximize { -1.0 } else { 1.0 }
    }

    fn set(&self, x: &[f64], work: &mut Work) {
        self.model
            .graph
            .set_variables(&x[..self.model.lower.len()], &mut work.values);
    }

    fn expression(&self, c: &Constraint) -> Option<&Expression> {
        self.model.rows[c.row].expression.as_ref()
    }
}

impl Program for Nlp<'_> {
    fn num_vars(&self) -> usize {
        self.variables
    }

    fn num_constraints(&self) -> usize {
        self.constraints.len()
    }

    fn gradient(&self, x: &[f64], out: &mut [f64]) {
        let work = &mut *self.work.borrow_mut();
        self.set(x, work);
        out.fill(0.0);
        let graph = &self.model.graph;
        let value = graph.evaluate(&self.objective.expression, &mut work.values);
        let add = &mut |j: usize, v: f64| out[j] += v;
        work.gradient
            .sweep(graph, &self.objective.expression, &work.values, self.sense(), add);
        for (j, v) in &self.objective.linear {
            out[*j as usize] += self.sense() * v;
        }
        // Derivatives may be finite where the function is not defined: those of the logarithm are.
        if !value.is_finite() {
            out.fill(f64::NAN);
        }
    }

    fn constraints(&self, x: &[f64], out: &mut [f64]) {
        let work = &mut *self.work.borrow_mut();
        self.set(x, work);
        for (out, c) in out.iter_mut().zip(&self.constraints) {
            let body = self.model.rows[c.row].body(&self.model.graph, &mut work.values);
            *out = c.sign * (body - c.slack.map_or(0.0, |s| x[s]) - c.right);
        }
    }

    fn constraint_jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let work = &mut *self.work.borrow_mut();
        self.set(x, work);
        let graph = &self.model.graph;
        for (i, c) in self.constraints.iter().enumerate() {
            for &(j, v) in &self.model.rows[c.row].linear {
                if v != 0.0 {
                    jac.add(i, j as usize, c.sign * v);
                }
            }
            if let Some(slack) = c.slack {
                jac.add(i, slack, -1.0);
            }
            if let Some(expression) = self.expression(c) {
                graph.evaluate(expression, &mut work.values);
                let add = &mut |j: usize, v: f64| jac.add(i, j, v);
                work.gradient.sweep(graph, expression, &work.values, c.sign, add);
            }
        }
    }

    fn hessian(&self, x: &[f64], multipliers: &[f64], hessian: &mut Matrix) {
        let work = &mut *self.work.borrow_mut();
        self.set(x, work);
        let graph = &self.model.graph;
        let mut terms = vec![(&self.objective.expression, self.sense())];
        for (c, y) in self.constraints.iter().zip(multipliers) {
            if let Some(expression) = self.expression(c)
                && *y != 0.0
            {
                terms.push((expression, -c.sign * y));
            }
        }
        for (expression, _) in &terms {
            graph.evaluate(expression, &mut work.values);
        }
        let add = &mut |i: usize, j: usize, v: f64| hessian.add(i, j, v);
        work.hessian.sweep(graph, terms, &work.values, add);
    }

    fn constraint_pattern(&self) -> Pattern {
        self.constraint_pattern.clone()
    }

    fn hessian_pattern(&self) -> Pattern {
        self.hessian_pattern.clone()
    }
}
