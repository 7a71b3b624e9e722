//! The operations of a formula, as they are recorded.

use std::cell::RefCell;
use std::collections::HashMap;

use crate::piecewise::{Kinks, Real};

/// Functions of one argument without kinks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Smooth {
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tan,
    Atan,
    Sinh,
    Cosh,
    Tanh,
}

impl Smooth {
    pub(super) const ALL: [(&'static str, Smooth); 10] = [
        ("sqrt", Smooth::Sqrt),
        ("exp", Smooth::Exp),
        ("ln", Smooth::Ln),
        ("sin", Smooth::Sin),
        ("cos", Smooth::Cos),
        ("tan", Smooth::Tan),
        ("atan", Smooth::Atan),
        ("sinh", Smooth::Sinh),
        ("cosh", Smooth::Cosh),
        ("tanh", Smooth::Tanh),
    ];

    fn of<T: Real>(self, a: T) -> T {
        match self {
            Smooth::Sqrt => a.sqrt(),
            Smooth::Exp => a.exp(),
            Smooth::Ln => a.ln(),
            Smooth::Sin => a.sin(),
            Smooth::Cos => a.cos(),
            Smooth::Tan => a.tan(),
            Smooth::Atan => a.atan(),
            Smooth::Sinh => a.sinh(),
            Smooth::Cosh => a.cosh(),
            Smooth::Tanh => a.tanh(),
        }
    }
}

/// Operations on two arguments without kinks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Binary {
    Add,
    Sub,
    Mul,
    Div,
}

impl Binary {
    pub(super) fn of<T: Real>(self, a: T, b: T) -> T {
        match self {
            Binary::Add => a + b,
            Binary::Sub => a - b,
            Binary::Mul => a * b,
            Binary::Div => a / b,
        }
    }
}

/// A node; arguments are positions of nodes before it. Numbers are kept as their bits, so that equal nodes have one hash.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) enum Node {
    Variable(usize),
    Number(u64),
    Neg([usize; 1]),
    Two(Binary, [usize; 2]),
    Integer([usize; 1], i32),
    Power([usize; 1], u64),
    Of(Smooth, [usize; 1]),
    Max([usize; 2]),
    Min([usize; 2]),
    Abs([usize; 1]),
    /// lower, z, upper.
    Project([usize; 3]),
    /// test, value where test ≥ 0, value elsewhere.
    Switch([usize; 3]),
}

impl Node {
    pub(super) fn arguments(&self) -> impl Iterator<Item = usize> {
        let list: &[usize] = match self {
            Node::Variable(_) | Node::Number(_) => &[],
            Node::Neg(a) | Node::Integer(a, _) | Node::Power(a, _) | Node::Of(_, a) | Node::Abs(a) => a,
            Node::Two(_, a) | Node::Max(a) | Node::Min(a) => a,
            Node::Project(a) | Node::Switch(a) => a,
        };
        list.iter().copied()
    }

    /// The same node with its arguments at other places.
    pub(super) fn moved(&self, to: impl Fn(usize) -> usize) -> Self {
        match *self {
            Node::Variable(_) | Node::Number(_) => *self,
            Node::Neg(a) => Node::Neg(a.map(to)),
            Node::Two(operator, a) => Node::Two(operator, a.map(to)),
            Node::Integer(a, n) => Node::Integer(a.map(to), n),
            Node::Power(a, p) => Node::Power(a.map(to), p),
            Node::Of(function, a) => Node::Of(function, a.map(to)),
            Node::Max(a) => Node::Max(a.map(to)),
            Node::Min(a) => Node::Min(a.map(to)),
            Node::Abs(a) => Node::Abs(a.map(to)),
            Node::Project(a) => Node::Project(a.map(to)),
            Node::Switch(a) => Node::Switch(a.map(to)),
        }
    }

    /// Number of pieces: 0 for nodes without a kink.
    pub(super) const fn num_pieces(&self) -> usize {
        match self {
            Node::Max(_) | Node::Min(_) | Node::Abs(_) | Node::Switch(_) => 2,
            Node::Project(_) => 3,
            _ => 0,
        }
    }

    pub(super) const fn is_kink(&self) -> bool {
        self.num_pieces() > 0
    }

    /// The value, from those of the nodes before it.
    pub(super) fn value<T: Real>(&self, x: &[T], v: &[T], kinks: &mut Kinks<'_, T>) -> T {
        match *self {
            Node::Variable(k) => x[k],
            Node::Number(bits) => T::from(f64::from_bits(bits)),
            Node::Neg([a]) => -v[a],
            Node::Two(operator, [a, b]) => operator.of(v[a], v[b]),
            Node::Integer([a], n) => v[a].powi(n),
            Node::Power([a], bits) => v[a].powf(f64::from_bits(bits)),
            Node::Of(function, [a]) => function.of(v[a]),
            Node::Max([a, b]) => kinks.max(v[a], v[b]),
            Node::Min([a, b]) => kinks.min(v[a], v[b]),
            Node::Abs([a]) => kinks.abs(v[a]),
            Node::Project([l, z, u]) => kinks.project(v[l], v[z], v[u]),
            Node::Switch([test, a, b]) => kinks.switch(v[test], v[a], v[b]),
        }
    }
}

/// The nodes of a formula under construction, each once.
#[derive(Debug, Default)]
pub(super) struct Page(RefCell<Written>);

#[derive(Debug, Default)]
struct Written {
    nodes: Vec<Node>,
    known: HashMap<Node, usize>,
}

impl Page {
    pub(super) fn add(&self, node: Node) -> usize {
        let Written { nodes, known } = &mut *self.0.borrow_mut();
        *known.entry(node).or_insert_with(|| {
            nodes.push(node);
            nodes.len() - 1
        })
    }

    pub(super) fn number(&self, value: f64) -> usize {
        self.add(Node::Number(value.to_bits()))
    }

    pub(super) fn nodes(&self) -> Vec<Node> {
        self.0.borrow().nodes.clone()
    }

    /// The value of a node without variables, kinks and functions.
    pub(super) fn constant(&self, at: usize) -> Option<f64> {
        let node = self.0.borrow().nodes[at];
        Some(match node {
            Node::Number(bits) => f64::from_bits(bits),
            Node::Neg([a]) => -self.constant(a)?,
            Node::Two(operator, [a, b]) => operator.of(self.constant(a)?, self.constant(b)?),
            Node::Integer([a], n) => self.constant(a)?.powi(n),
            Node::Power([a], p) => self.constant(a)?.powf(f64::from_bits(p)),
            _ => return None,
        })
    }
}
