//! Expressions as one tape: values, gradients by reverse sweeps, and the Hessian of a sum by edge pushing.
//!
//! Each node of the tape follows the nodes it depends on, with the variables first, so that every traversal is a loop and nesting may have
//! any depth. Each expression owns a range of nodes; a [defined variable](Node::Defined) is an expression that others refer to.

mod degree;
mod gradient;
mod hessian;
mod operator;
mod tables;

pub use degree::CURVED;
pub use gradient::Gradient;
pub use hessian::{Hessian, TooDense};
pub use operator::{Binary, Partials, Unary, power, power_derivatives};
pub use tables::PiecewiseLinear;

use std::ops::Range;

/// Number of a node.
pub type NodeId = u32;

/// One operation. Operands come before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Node {
    /// The variable with the number of this node.
    Variable,
    /// A number.
    Constant(f64),
    /// The value of a defined variable, by its number.
    Defined(u32),
    /// A number times an operand.
    Scale(f64, NodeId),
    /// An operand to a constant power.
    Power(f64, NodeId),
    /// An operator with one operand.
    Unary(Unary, NodeId),
    /// An operator with two operands.
    Binary(Binary, NodeId, NodeId),
    /// The second operand where the first is not zero, else the third.
    If(NodeId, NodeId, NodeId),
    /// A piecewise linear function, by its number.
    Piecewise(u32, NodeId),
    /// 1 where all operands of a list, by its number, differ, else 0.
    AllDifferent(u32),
}

impl Node {
    fn has_kinks(self) -> bool {
        match self {
            Self::Unary(op, _) => op.has_kinks(),
            Self::Binary(op, ..) => op.has_kinks(),
            Self::If(..) | Self::Piecewise(..) | Self::AllDifferent(_) => true,
            _ => false,
        }
    }
}

/// An expression: its own nodes, and the one that holds its value.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Expression {
    /// The nodes that belong only to this expression.
    pub nodes: Range<NodeId>,
    /// The node of its value: the last of these, or a variable.
    pub root: NodeId,
}

/// The expressions of a problem.
#[derive(Debug, Clone, PartialEq)]
pub struct Graph {
    nodes: Vec<Node>,
    variables: u32,
    defined: Vec<Option<Expression>>,
    tables: Vec<PiecewiseLinear>,
    lists: Vec<Vec<NodeId>>,
}

/// More nodes than a [`NodeId`] can count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the expressions have more than {} nodes", u32::MAX)]
pub struct TooLarge;

impl Graph {
    /// An empty graph with the given numbers of variables and defined variables.
    ///
    /// # Errors
    /// More than 2³² of both together.
    pub fn new(variables: usize, defined: usize) -> Result<Self, TooLarge> {
        let all = variables.checked_add(defined).and_then(|n| u32::try_from(n).ok());
        all.ok_or(TooLarge)?;
        Ok(Self {
            nodes: vec![Node::Variable; variables],
            variables: variables as u32,
            defined: vec![None; defined],
            tables: Vec::new(),
            lists: Vec::new(),
        })
    }

    /// Number of variables.
    #[must_use]
    pub fn num_variables(&self) -> usize {
        self.variables as usize
    }

    /// The nodes.
    #[must_use]
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// A defined variable, once it has been given.
    #[must_use]
    pub fn defined(&self, index: usize) -> Option<&Expression> {
        self.defined.get(index)?.as_ref()
    }

    /// A piecewise linear function.
    #[must_use]
    pub fn table(&self, index: u32) -> &PiecewiseLinear {
        &self.tables[index as usize]
    }

    /// Appends a node. Operations on constants become constants.
    ///
    /// # Errors
    /// 2³² nodes.
    pub fn push(&mut self, node: Node) -> Result<NodeId, TooLarge> {
        let node = self.fold(node);
        let id = u32::try_from(self.nodes.len()).map_err(|_| TooLarge)?;
        if id == u32::MAX {
            return Err(TooLarge);
        }
        self.nodes.push(node);
        Ok(id)
    }

    /// Appends a piecewise linear function of an operand.
    ///
    /// # Errors
    /// 2³² nodes.
    pub fn push_piecewise(&mut self, table: PiecewiseLinear, operand: NodeId) -> Result<NodeId, TooLarge> {
        self.tables.push(table);
        self.push(Node::Piecewise(self.tables.len() as u32 - 1, operand))
    }

    /// Appends a node that is 1 if all operands differ, else 0.
    ///
    /// # Errors
    /// 2³² nodes.
    pub fn push_all_different(&mut self, operands: Vec<NodeId>) -> Result<NodeId, TooLarge> {
        self.lists.push(operands);
        self.push(Node::AllDifferent(self.lists.len() as u32 - 1))
    }

    /// The expression of the nodes from `start` on, whose value is at `root`.
    #[must_use]
    pub fn close(&self, start: usize, root: NodeId) -> Expression {
        Expression {
            nodes: start as NodeId..self.nodes.len() as NodeId,
            root,
        }
    }

    /// Sets the expression of a defined variable.
    pub fn define(&mut self, index: usize, expression: Expression) {
        self.defined[index] = Some(expression);
    }

    /// The value of a node that is a constant.
    #[must_use]
    pub fn constant(&self, id: NodeId) -> Option<f64> {
        match self.nodes[id as usize] {
            Node::Constant(c) => Some(c),
            _ => None,
        }
    }

    fn fold(&self, node: Node) -> Node {
        let folded = match node {
            Node::Unary(op, a) => self.constant(a).map(|a| op.value(a)),
            Node::Scale(c, a) => self.constant(a).map(|a| c * a),
            Node::Power(p, a) => self.constant(a).map(|a| power(a, p)),
            Node::Binary(op, a, b) => match (self.constant(a), self.constant(b)) {
                (Some(a), Some(b)) => Some(op.value(a, b)),
                (None, Some(p)) if op == Binary::Power => return Node::Power(p, a),
                (None, Some(c)) if op == Binary::Multiply => return Node::Scale(c, a),
                (Some(c), None) if op == Binary::Multiply => return Node::Scale(c, b),
                _ => None,
            },
            _ => None,
        };
        folded.map_or(node, Node::Constant)
    }

    /// A buffer for the values of all nodes at a point.
    #[must_use]
    pub fn workspace(&self) -> Vec<f64> {
        vec![0.0; self.nodes.len()]
    }

    /// Writes the variables and all defined variables to `values`, for [`evaluate`](Self::evaluate).
    pub fn set_variables(&self, x: &[f64], values: &mut [f64]) {
        values[..x.len()].copy_from_slice(x);
        for expression in self.defined.iter().flatten() {
            self.evaluate(expression, values);
        }
    }

    /// Whether the sides of an inequality that decides a test are equal, so that the test changes beside this point. What is tested for
    /// equality is defined at this point alone.
    fn switches(&self, test: NodeId, values: &[f64]) -> bool {
        match self.nodes[test as usize] {
            Node::Unary(Unary::Not, a) => self.switches(a, values),
            Node::Binary(Binary::And | Binary::Or, a, b) => {
                self.switches(a, values) || self.switches(b, values)
            }
            Node::Binary(Binary::Below | Binary::AtMost | Binary::AtLeast | Binary::Above, a, b) => {
                values[a as usize] == values[b as usize]
            }
            _ => false,
        }
    }

    /// The value of an expression, after [`set_variables`](Self::set_variables).
    pub fn evaluate(&self, expression: &Expression, values: &mut [f64]) -> f64 {
        for id in expression.nodes.clone() {
            let v = |id: NodeId| values[id as usize];
            values[id as usize] = match self.nodes[id as usize] {
                Node::Variable => continue,
                Node::Constant(c) => c,
                Node::Defined(d) => self.defined(d as usize).map_or(f64::NAN, |e| v(e.root)),
                Node::Scale(c, a) => c * v(a),
                Node::Power(p, a) => power(v(a), p),
                Node::Unary(op, a) => op.value(v(a)),
                Node::Binary(op, a, b) => op.value(v(a), v(b)),
                Node::If(test, a, b) => match v(test) {
                    t if t.is_nan() => f64::NAN,
                    _ if !(v(a).is_finite() && v(b).is_finite()) && self.switches(test, values) => f64::NAN,
                    0.0 => v(b),
                    _ => v(a),
                },
                Node::Piecewise(table, a) => self.table(table).value(v(a)),
                Node::AllDifferent(list) => {
                    let mut all: Vec<f64> = self.lists[list as usize].iter().map(|&a| v(a)).collect();
                    all.sort_unstable_by(f64::total_cmp);
                    match all.iter().any(|x| x.is_nan()) {
                        true => f64::NAN,
                        false => f64::from(u8::from(all.windows(2).all(|w| w[0] != w[1]))),
                    }
                }
            };
        }
        values[expression.root as usize]
    }

    /// Whether an operation of any expression has kinks or jumps.
    #[must_use]
    pub fn has_kinks(&self) -> bool {
        self.nodes.iter().any(|node| node.has_kinks())
    }

    /// For each node, whether an operation that it depends on has kinks or jumps, and the largest absolute value among it and the nodes
    /// that it depends on.
    #[must_use]
    pub fn kinks_and_sizes(&self, values: &[f64]) -> Vec<(bool, f64)> {
        let mut all: Vec<(bool, f64)> = Vec::with_capacity(self.nodes.len());
        for (node, value) in self.nodes.iter().zip(values) {
            let mut own = (node.has_kinks(), value.abs());
            for operand in self.operands(*node).into_iter().flatten() {
                let (kinks, size) = all[operand as usize];
                own = (own.0 || kinks, own.1.max(size));
            }
            all.push(own);
        }
        all
    }

    /// The operands of a node on which its value depends continuously.
    fn operands(&self, node: Node) -> [Option<NodeId>; 2] {
        match node {
            Node::Variable | Node::Constant(_) | Node::AllDifferent(_) => [None, None],
            Node::Defined(d) => [self.defined(d as usize).map(|e| e.root), None],
            Node::Scale(_, a) | Node::Power(_, a) | Node::Unary(_, a) | Node::Piecewise(_, a) => {
                [Some(a), None]
            }
            Node::Binary(_, a, b) | Node::If(_, a, b) => [Some(a), Some(b)],
        }
    }

    /// The derivatives of a node with respect to its [operands](Self::operands) at the point of `values`.
    fn partials(&self, id: NodeId, values: &[f64]) -> Partials {
        let v = |id: NodeId| values[id as usize];
        let y = v(id);
        let one = |(a, aa)| Partials {
            a,
            aa,
            ..Partials::default()
        };
        match self.nodes[id as usize] {
            Node::Variable | Node::Constant(_) | Node::AllDifferent(_) => Partials::default(),
            Node::Defined(_) => one((1.0, 0.0)),
            Node::Scale(c, _) => one((c, 0.0)),
            Node::Power(p, a) => one(power_derivatives(v(a), p)),
            Node::Unary(op, a) => one(op.derivatives(v(a), y)),
            Node::Binary(op, a, b) => op.derivatives(v(a), v(b), y),
            Node::If(test, ..) => {
                let first = v(test) != 0.0;
                Partials {
                    a: f64::from(u8::from(first)),
                    b: f64::from(u8::from(!first)),
                    ..Partials::default()
                }
            }
            Node::Piecewise(table, a) => one((self.table(table).slope(v(a)), 0.0)),
        }
    }
}
