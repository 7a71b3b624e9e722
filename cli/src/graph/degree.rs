//! Which expressions are affine or quadratic.

use super::{Binary, Expression, Graph, Node, Unary};

/// Degree of expressions that are not polynomials of degree 2 at most.
pub const CURVED: u8 = 3;

impl Graph {
    /// The degree of each of the expressions as a polynomial: 0, 1, 2, or [`CURVED`] for all others.
    #[must_use]
    pub fn degrees<'a>(&self, expressions: impl IntoIterator<Item = &'a Expression>) -> Vec<u8> {
        let mut degree = vec![0; self.nodes().len()];
        for (id, node) in self.nodes().iter().enumerate() {
            let d = |id: super::NodeId| degree[id as usize];
            let constant_or_curved = |all: &[u8]| if all.iter().all(|d| *d == 0) { 0 } else { CURVED };
            degree[id] = match *node {
                Node::Variable => 1,
                Node::Constant(_) => 0,
                Node::Defined(k) => self.defined(k as usize).map_or(CURVED, |e| d(e.root)),
                Node::Scale(_, a) | Node::Unary(Unary::Negate, a) => d(a),
                Node::Power(1.0, a) => d(a),
                Node::Power(2.0, a) => CURVED.min(2 * d(a)),
                Node::Power(_, a) | Node::Unary(_, a) | Node::Piecewise(_, a) => constant_or_curved(&[d(a)]),
                Node::Binary(Binary::Add | Binary::Subtract, a, b) => d(a).max(d(b)),
                Node::Binary(Binary::Multiply, a, b) => CURVED.min(d(a) + d(b)),
                Node::Binary(Binary::Divide, a, b) if d(b) == 0 => d(a),
                Node::Binary(_, a, b) => constant_or_curved(&[d(a), d(b)]),
                Node::If(test, a, b) => constant_or_curved(&[d(test), d(a), d(b)]),
                Node::AllDifferent(_) => CURVED,
            };
        }
        expressions.into_iter().map(|e| degree[e.root as usize]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_are_told_from_what_only_looks_like_them() {
        let mut g = Graph::new(2, 1).unwrap();
        let c = g.push(Node::Constant(3.0)).unwrap();
        let affine = g.push(Node::Binary(Binary::Subtract, 0, c)).unwrap();
        let first = g.close(2, affine);
        g.define(0, first);
        let start = g.nodes().len();
        let defined = g.push(Node::Defined(0)).unwrap();
        let nodes = [
            (Node::Scale(2.0, defined), 1),
            (Node::Power(2.0, defined), 2),
            (Node::Power(3.0, 1), CURVED),
            (Node::Power(0.5, 1), CURVED),
            (Node::Binary(Binary::Multiply, 0, defined), 2),
            (Node::Binary(Binary::Divide, 0, c), 1),
            (Node::Binary(Binary::Divide, c, 0), CURVED),
            (Node::Binary(Binary::Max, 0, 1), CURVED),
            (Node::Unary(Unary::Abs, 0), CURVED),
            (Node::Unary(Unary::Negate, defined), 1),
            (Node::If(0, 1, 1), CURVED),
            (Node::Constant(1.0), 0),
        ];
        for (node, expected) in nodes {
            let root = g.push(node).unwrap();
            assert_eq!(g.degrees([&g.close(start, root)]), [expected], "{node:?}");
        }
        let square = g.push(Node::Power(2.0, 0)).unwrap();
        let cube = g.push(Node::Binary(Binary::Multiply, square, 1)).unwrap();
        assert_eq!(g.degrees([&g.close(start, cube)]), [CURVED]);
    }
}
