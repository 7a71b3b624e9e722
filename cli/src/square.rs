//! Square problems: complementarities, and equations for the variables that no complementarity names.

use std::cell::RefCell;

use semismooth::complementarity::McpFunction;
use semismooth::sparse::{Matrix, Pattern};
use thiserror::Error;

use crate::graph::Gradient;
use crate::matching;
use crate::model::{Model, RowKind};

/// Why a problem is not a mixed complementarity problem.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SquareError {
    /// The number of equations differs from the number of variables that no complementarity names.
    #[error(
        "the problem is not square: {variables} variables, {complementarities} complementarities and {equations} equations; \
         each variable needs one of them"
    )]
    NotSquare {
        /// Number of variables.
        variables: usize,
        /// Number of complementarities.
        complementarities: usize,
        /// Number of equations.
        equations: usize,
    },
    /// Inequalities that complement no variable.
    #[error(
        "{count} inequalities complement no variable (the first is {row}); a problem without an objective of its own \
         has none: state each with its variable"
    )]
    Inequalities {
        /// How many.
        count: usize,
        /// The first of them.
        row: String,
    },
    /// A variable that two rows complement.
    #[error("{first} and {second} both complement {variable}; one row is needed for each variable")]
    Twice {
        /// The variable.
        variable: String,
        /// A row that complements it.
        first: String,
        /// Another one.
        second: String,
    },
}

/// The component of F that belongs to one variable.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Component {
    /// The row of the file that gives the value, constant + factor · body.
    row: usize,
    constant: f64,
    factor: f64,
    /// A variable whose term is left out of the body.
    without: Option<u32>,
    /// The row of the file that states the condition.
    stated: usize,
    /// Which bounds of the variable belong to the condition.
    lower: bool,
    upper: bool,
}

/// A variable that an equation defines and that occurs in one complementarity only, as Pyomo writes them:
/// variable = (right-hand side − rest of the row) / coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Eliminated {
    variable: usize,
    row: usize,
    coefficient: f64,
    right: f64,
}

/// A model as a function F with as many components as variables.
#[derive(Debug)]
pub struct Square<'m> {
    model: &'m Model,
    /// The variable of each component.
    variables: Vec<usize>,
    components: Vec<Component>,
    eliminated: Vec<Eliminated>,
    /// Number of each variable among the components.
    numbers: Vec<Option<usize>>,
    work: RefCell<Work>,
}

#[derive(Debug)]
struct Work {
    x: Vec<f64>,
    values: Vec<f64>,
    gradient: Gradient,
}

impl<'m> Square<'m> {
    /// Pairs rows with variables.
    ///
    /// # Errors
    /// A model that is not square.
    pub fn new(model: &'m Model) -> Result<Self, SquareError> {
        let n = model.lower.len();
        let mut stated: Vec<Option<usize>> = vec![None; n];
        let mut equations = Vec::new();
        let mut inequalities = Vec::new();
        for (index, row) in model.rows.iter().enumerate() {
            match row.kind {
                RowKind::Complements { variable, .. } => {
                    if let Some(first) = stated[variable].replace(index) {
                        return Err(SquareError::Twice {
                            variable: model.names.variable(variable),
                            first: model.names.row(first),
                            second: model.names.row(index),
                        });
                    }
                }
                kind if kind.equation().is_some() => equations.push(index),
                kind if kind.is_free() => {}
                _ => inequalities.push(index),
            }
        }
        if let Some(&row) = inequalities.first() {
            let (count, row) = (inequalities.len(), model.names.row(row));
            return Err(SquareError::Inequalities { count, row });
        }
        let complementarities = stated.iter().flatten().count();
        if complementarities + equations.len() != n {
            return Err(SquareError::NotSquare {
                variables: n,
                complementarities,
                equations: equations.len(),
            });
        }
        Ok(Self::pair(model, &stated, equations))
    }

    fn pair(model: &'m Model, stated: &[Option<usize>], mut equations: Vec<usize>) -> Self {
        let n = model.lower.len();
        let mut components: Vec<Option<Component>> = vec![None; n];
        for (variable, row) in stated.iter().enumerate() {
            if let Some(row) = *row
                && let RowKind::Complements { lower, upper, .. } = model.rows[row].kind
            {
                components[variable] = Some(Component {
                    row,
                    constant: 0.0,
                    factor: 1.0,
                    without: None,
                    stated: row,
                    lower,
                    upper,
                });
            }
        }
        let eliminated = eliminate(model, stated, &mut components);
        let mut gone = vec![false; n];
        eliminated.iter().for_each(|e| gone[e.variable] = true);
        let used: std::collections::HashSet<usize> = eliminated.iter().map(|e| e.row).collect();
        equations.retain(|row| !used.contains(row));

        let open: Vec<usize> = (0..n).filter(|&j| components[j].is_none() && !gone[j]).collect();
        assign(model, &equations, &open, &mut components);
        let variables: Vec<usize> = (0..n).filter(|&j| !gone[j]).collect();
        let mut numbers = vec![None; n];
        variables
            .iter()
            .enumerate()
            .for_each(|(k, &j)| numbers[j] = Some(k));
        Self {
            components: variables.iter().filter_map(|&j| components[j]).collect(),
            variables,
            eliminated,
            numbers,
            work: RefCell::new(Work {
                x: vec![0.0; n],
                values: model.graph.workspace(),
                gradient: Gradient::new(&model.graph),
            }),
            model,
        }
    }

    /// Bounds of the components: those of the variables or, with `stated`, only those that belong to the conditions.
    #[must_use]
    pub fn bounds(&self, stated: bool) -> (Vec<f64>, Vec<f64>) {
        let each = self.variables.iter().zip(&self.components);
        each.map(|(&j, c)| {
            let (l, u) = (self.model.lower[j], self.model.upper[j]);
            (
                if stated && !c.lower { f64::NEG_INFINITY } else { l },
                if stated && !c.upper { f64::INFINITY } else { u },
            )
        })
        .unzip()
    }

    /// The variables of the components, from all variables.
    #[must_use]
    pub fn restrict(&self, all: &[f64]) -> Vec<f64> {
        self.variables.iter().map(|&j| all[j]).collect()
    }

    /// All variables, from those of the components.
    #[must_use]
    pub fn extend(&self, x: &[f64]) -> Vec<f64> {
        let work = &mut *self.work.borrow_mut();
        self.set(x, work);
        for e in &self.eliminated {
            work.x[e.variable] = 0.0;
            work.values[e.variable] = 0.0;
        }
        for e in &self.eliminated {
            let rest = self.model.rows[e.row].body(&self.model.graph, &mut work.values);
            work.x[e.variable] = (e.right - rest) / e.coefficient;
        }
        work.x.clone()
    }

    /// The variable of a component, and the row that states its condition.
    #[must_use]
    pub fn origin(&self, component: usize) -> (usize, usize) {
        (self.variables[component], self.components[component].stated)
    }

    /// Whether the row of a component is an equation.
    #[must_use]
    pub fn is_equation(&self, component: usize) -> bool {
        let stated = self.components[component].stated;
        !matches!(self.model.rows[stated].kind, RowKind::Complements { .. })
    }

    /// The kind of problem, in words.
    #[must_use]
    pub fn what(&self) -> &'static str {
        match (0..self.components.len()).all(|i| self.is_equation(i)) {
            true => "system of equations",
            false => "complementarity problem",
        }
    }

    /// Whether no row has a nonlinear part.
    #[must_use]
    pub fn is_affine(&self) -> bool {
        self.components
            .iter()
            .all(|c| constant_part(self.model, c.row).is_some())
    }

    fn set(&self, x: &[f64], work: &mut Work) {
        for (&j, &x) in self.variables.iter().zip(x) {
            work.x[j] = x;
        }
        self.model.graph.set_variables(&work.x, &mut work.values);
    }

    /// Number and coefficient of each variable in the linear part of a component.
    fn linear(&self, c: &Component) -> impl Iterator<Item = (usize, f64)> {
        let listed = self.model.rows[c.row].linear.iter();
        listed.filter_map(|&(j, v)| Some((self.numbers[j as usize]?, v)))
    }
}

/// The value of the nonlinear part of a row, if it is constant.
fn constant_part(model: &Model, row: usize) -> Option<f64> {
    match &model.rows[row].expression {
        None => Some(0.0),
        Some(expression) => model.graph.constant(expression.root),
    }
}

/// Assigns an equation to each variable without one, if possible one that depends on it.
fn assign(model: &Model, equations: &[usize], open: &[usize], components: &mut [Option<Component>]) {
    let mut place = vec![None; components.len()];
    open.iter().enumerate().for_each(|(k, &j)| place[j] = Some(k));
    let edges: Vec<Vec<usize>> = equations
        .iter()
        .map(|&row| {
            let listed = model.rows[row].linear.iter();
            listed.filter_map(|(j, _)| place[*j as usize]).collect()
        })
        .collect();
    for (k, equation) in matching::complete(&edges, open.len()).into_iter().enumerate() {
        let row = equations[equation];
        components[open[k]] = Some(Component {
            row,
            constant: -model.rows[row].kind.equation().unwrap_or(0.0),
            factor: 1.0,
            without: None,
            stated: row,
            lower: false,
            upper: false,
        });
    }
}

/// Finds complementarities whose body is a single free variable that an equation defines, and substitutes the equation.
fn eliminate(
    model: &Model,
    stated: &[Option<usize>],
    components: &mut [Option<Component>],
) -> Vec<Eliminated> {
    // The rows of each variable that occurs in one or two.
    let mut found: Vec<Vec<usize>> = vec![Vec::new(); stated.len()];
    for (index, row) in model.rows.iter().enumerate() {
        for (j, _) in &row.linear {
            let rows = &mut found[*j as usize];
            if rows.len() < 3 {
                rows.push(index);
            }
        }
    }
    let mut gradient = Gradient::new(&model.graph);
    let mut taken = vec![false; model.rows.len()];
    let mut eliminated = Vec::new();
    for component in components.iter_mut().flatten() {
        let &[(slack, factor)] = &model.rows[component.row].linear[..] else {
            continue;
        };
        let variable = slack as usize;
        let free = model.lower[variable] == f64::NEG_INFINITY && model.upper[variable] == f64::INFINITY;
        let offset = constant_part(model, component.row);
        let (Some(offset), &[first, second]) = (offset, &found[variable][..]) else {
            continue;
        };
        let row = if first == component.row { second } else { first };
        if !free || stated[variable].is_some() || factor == 0.0 || taken[row] {
            continue;
        }
        let Some(given) = given_by(model, row, variable, &mut gradient) else {
            continue;
        };
        taken[row] = true;
        *component = Component {
            row,
            constant: offset + factor * given.right / given.coefficient,
            factor: -factor / given.coefficient,
            without: Some(slack),
            ..*component
        };
        eliminated.push(given);
    }
    eliminated
}

/// An equation solved for a variable on which it depends linearly.
fn given_by(model: &Model, row: usize, variable: usize, gradient: &mut Gradient) -> Option<Eliminated> {
    let right = model.rows[row].kind.equation()?;
    let listed = model.rows[row].linear.iter();
    let coefficient = listed
        .filter(|(j, _)| *j as usize == variable)
        .map(|(_, c)| *c)
        .sum();
    let mut nonlinear = false;
    if let Some(expression) = &model.rows[row].expression {
        gradient.variables(&model.graph, expression, &mut |j| nonlinear |= j == variable);
    }
    (coefficient != 0.0 && !nonlinear).then_some(Eliminated {
        variable,
        row,
        coefficient,
        right,
    })
}

impl McpFunction for Square<'_> {
    fn num_vars(&self) -> usize {
        self.variables.len()
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        let work = &mut *self.work.borrow_mut();
        self.set(x, work);
        for (out, c) in out.iter_mut().zip(&self.components) {
            if let Some(slack) = c.without {
                work.values[slack as usize] = 0.0;
            }
            let body = self.model.rows[c.row].body(&self.model.graph, &mut work.values);
            *out = c.constant + c.factor * body;
        }
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let work = &mut *self.work.borrow_mut();
        self.set(x, work);
        let graph = &self.model.graph;
        for (i, c) in self.components.iter().enumerate() {
            for (k, v) in self.linear(c) {
                if v != 0.0 {
                    jac.add(i, k, c.factor * v);
                }
            }
            if let Some(expression) = &self.model.rows[c.row].expression {
                graph.evaluate(expression, &mut work.values);
                let add = &mut |j: usize, v: f64| {
                    if let Some(k) = self.numbers[j] {
                        jac.add(i, k, v);
                    }
                };
                work.gradient
                    .sweep(graph, expression, &work.values, c.factor, add);
            }
        }
    }

    fn pattern(&self) -> Pattern {
        let n = self.variables.len();
        let rows = self.components.iter().enumerate();
        let entries = rows.flat_map(|(i, c)| self.linear(c).map(move |(k, _)| (i, k)));
        // Row and column indices are below n.
        Pattern::from_entries(n, n, entries).unwrap_or_else(|_| Pattern::full(n, n))
    }

    fn is_affine(&self) -> bool {
        Square::is_affine(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// c: b ⟂ x ≥ 0, e: b − x² = −2, as Pyomo states 0 ≤ x ⟂ x² − 2 ≥ 0.
    const TEXT: &str = "g3 1 1 0\n 2 2 0 0 1\n 1 0 1 0 0 0\n 0 0\n 1 0 0\n 0 0 0 1\n 0 0 0 0 0\n 3 0\n 0 0\n 0 0 0 0 0\n\
        C0\no16\no5\nv0\nn2\nC1\nn0\nr\n4 -2\n5 1 1\nb\n2 0\n3\nk1\n1\nJ0 2\n0 0\n1 1\nJ1 1\n1 1\n";

    #[test]
    fn a_slack_given_by_an_equation_is_eliminated() {
        let model = crate::nl::read(TEXT.as_bytes()).unwrap();
        let square = Square::new(&model).unwrap();
        assert_eq!(square.num_vars(), 1);
        let mut out = [0.0];
        square.value(&[3.0], &mut out);
        assert_eq!(out, [7.0]);
        let mut jac = Matrix::zeros(square.pattern());
        square.jacobian(&[3.0], &mut jac);
        assert_eq!(jac.get(0, 0), 6.0);
        assert_eq!(square.extend(&[3.0]), [3.0, 7.0]);
        assert_eq!((square.origin(0), square.is_equation(0)), ((0, 1), false));
    }

    #[test]
    fn a_slack_with_bounds_stays() {
        let model = crate::nl::read(TEXT.replace("2 0\n3\n", "2 0\n2 -9\n").as_bytes()).unwrap();
        let square = Square::new(&model).unwrap();
        assert_eq!(square.num_vars(), 2);
        let mut out = [0.0; 2];
        square.value(&[3.0, 4.0], &mut out);
        assert_eq!(out, [4.0, -3.0]);
        assert_eq!(square.bounds(false).0, [0.0, -9.0]);
        assert_eq!(square.bounds(true).0, [0.0, f64::NEG_INFINITY]);
        assert!(square.is_equation(1) && !square.is_equation(0));
    }

    #[test]
    fn what_is_not_square_is_told_in_numbers() {
        let inequality = TEXT.replace("4 -2", "1 -2");
        let free = TEXT.replace("4 -2", "3");
        let twice = TEXT.replace("4 -2", "5 1 1");
        let error = |text: &str| Square::new(&crate::nl::read(text.as_bytes()).unwrap()).unwrap_err();
        assert_eq!(
            error(&inequality),
            SquareError::Inequalities {
                count: 1,
                row: "row 0 (from 0)".into()
            }
        );
        assert_eq!(
            error(&free),
            SquareError::NotSquare {
                variables: 2,
                complementarities: 1,
                equations: 0
            }
        );
        assert_eq!(
            error(&twice),
            SquareError::Twice {
                variable: "variable 0 (from 0)".into(),
                first: "row 0 (from 0)".into(),
                second: "row 1 (from 0)".into()
            }
        );
    }
}
