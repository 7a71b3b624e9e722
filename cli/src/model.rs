//! A problem as the file states it.

use crate::graph::{Expression, Graph};
use crate::names::Names;
use crate::nl::{Header, Position};

/// Variables with their coefficients.
pub type Linear = Vec<(u32, f64)>;

/// A problem: variables with bounds, constraints, complementarities, objectives.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// What the header says.
    pub header: Header,
    /// All expressions.
    pub graph: Graph,
    /// Constraints and complementarities.
    pub rows: Vec<Row>,
    /// Lower bounds of the variables; −∞ where there is none.
    pub lower: Vec<f64>,
    /// Upper bounds; +∞ where there is none.
    pub upper: Vec<f64>,
    /// Objectives.
    pub objectives: Vec<Objective>,
    /// Initial values of the variables, 0 where none is given.
    pub start: Vec<f64>,
    /// Initial values of the multipliers of the rows, 0 where none is given.
    pub duals: Vec<f64>,
    /// Names of variables and rows.
    pub names: Names,
}

/// A row: its body, the sum of a nonlinear and a linear part, and the condition on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The nonlinear part.
    pub expression: Option<Expression>,
    /// Its place in the file.
    pub at: Position,
    /// The linear part, with a coefficient of 0 for variables that occur only in the nonlinear part.
    pub linear: Linear,
    /// The condition on the body.
    pub kind: RowKind,
}

/// The condition on a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RowKind {
    /// To lie between bounds.
    Range {
        /// Lower bound, or −∞.
        lower: f64,
        /// Upper bound, or +∞.
        upper: f64,
    },
    /// To complement a variable: ≥ 0 where it is at its lower bound, ≤ 0 at its upper one, 0 between.
    Complements {
        /// The variable, from 0.
        variable: usize,
        /// Whether its lower bound belongs to the condition.
        lower: bool,
        /// Whether its upper bound does.
        upper: bool,
    },
}

/// An objective.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Objective {
    /// Whether it is to be maximised.
    pub maximize: bool,
    /// The nonlinear part.
    pub expression: Expression,
    /// The linear part.
    pub linear: Linear,
}

impl Model {
    /// Rows with kinks or jumps that x violates by more than `tolerance` times the values of their operations, and by how much. Slopes,
    /// which may be far larger than these values, say nothing about what is on the other side of a kink.
    #[must_use]
    pub fn violated(&self, x: &[f64], tolerance: f64) -> Vec<(usize, f64)> {
        let mut values = self.graph.workspace();
        self.graph.set_variables(x, &mut values);
        let bodies: Vec<f64> = (self.rows.iter())
            .map(|row| row.body(&self.graph, &mut values))
            .collect();
        let all = self.graph.kinks_and_sizes(&values);
        let rows = self.rows.iter().zip(bodies).enumerate();
        rows.filter_map(|(index, (row, body))| {
            let (kinks, mut size) = all[row.expression.as_ref()?.root as usize];
            let violation = match row.kind {
                RowKind::Range { lower, upper } => {
                    size += [lower, upper]
                        .into_iter()
                        .filter(|b| b.is_finite())
                        .map(f64::abs)
                        .sum::<f64>();
                    (lower - body).max(body - upper)
                }
                RowKind::Complements { variable: j, .. } => {
                    let (x, lower, upper) = (x[j], self.lower[j], self.upper[j]);
                    let rests = (x == lower && body >= 0.0) || (x == upper && body <= 0.0) || lower == upper;
                    if rests { 0.0 } else { body.abs() }
                }
            };
            size += row
                .linear
                .iter()
                .map(|&(j, c)| (c * x[j as usize]).abs())
                .sum::<f64>();
            (kinks && violation > tolerance * size).then_some((index, violation))
        })
        .collect()
    }
}

impl RowKind {
    /// The right-hand side of an equation.
    #[must_use]
    pub fn equation(self) -> Option<f64> {
        match self {
            Self::Range { lower, upper } if lower == upper => Some(lower),
            _ => None,
        }
    }

    /// Whether there is no condition.
    #[must_use]
    pub fn is_free(self) -> bool {
        matches!(self, Self::Range { lower, upper } if lower == f64::NEG_INFINITY && upper == f64::INFINITY)
    }
}

impl Row {
    /// The body at the point where the variables of `values` are set.
    pub fn body(&self, graph: &Graph, values: &mut [f64]) -> f64 {
        let nonlinear = self
            .expression
            .as_ref()
            .map_or(0.0, |e| graph.evaluate(e, values));
        nonlinear + linear_value(&self.linear, values)
    }
}

/// Σ coefficient · variable.
#[must_use]
pub fn linear_value(linear: &Linear, x: &[f64]) -> f64 {
    linear.iter().map(|&(j, c)| c * x[j as usize]).sum()
}
