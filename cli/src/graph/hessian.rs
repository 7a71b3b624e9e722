//! Hessians of weighted sums of expressions by one reverse sweep over the tape, pushing the edges of nonlinear interaction from each
//! node to its operands (R. M. Gower and M. P. Mello, 2012: "A new framework for the computation of Hessians").

use super::{Expression, Graph, Node, NodeId, Partials};

/// No edge.
const NONE: u32 = u32::MAX;

/// The pattern of a Hessian has more entries than the limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the Hessian of the Lagrangian has more than {limit} entries")]
pub struct TooDense {
    /// The limit.
    pub limit: usize,
}

/// An edge between the node in whose list it is and a node with the same or a smaller number.
#[derive(Debug, Clone, Copy)]
struct Edge {
    other: NodeId,
    weight: f64,
    next: u32,
}

/// Buffers of the sweep, reused by the next one.
#[derive(Debug, Clone)]
pub struct Hessian {
    adjoint: Vec<f64>,
    /// First edge of each node.
    first: Vec<u32>,
    edges: Vec<Edge>,
    /// First edge that is free to be used again.
    free: u32,
    /// Sum of the weights of the edges from the current node to each node.
    sum: Vec<f64>,
    /// Whether a node is among the neighbours; its sum does not tell, since it may cancel to zero meanwhile.
    known: Vec<bool>,
    neighbours: Vec<NodeId>,
}

impl Hessian {
    /// Buffers for a graph.
    #[must_use]
    pub fn new(graph: &Graph) -> Self {
        Self {
            adjoint: graph.workspace(),
            first: vec![NONE; graph.nodes.len()],
            edges: Vec::new(),
            free: NONE,
            sum: graph.workspace(),
            known: vec![false; graph.nodes.len()],
            neighbours: Vec::new(),
        }
    }

    /// Passes the entries of the Hessian of Σ weight · expression at the point of `values` to `add`, both triangles; an entry may come
    /// several times, with terms to be summed.
    pub fn sweep<'a>(
        &mut self,
        graph: &Graph,
        terms: impl IntoIterator<Item = (&'a Expression, f64)>,
        values: &[f64],
        add: &mut dyn FnMut(usize, usize, f64),
    ) {
        for (expression, weight) in terms {
            self.adjoint[expression.root as usize] += weight;
        }
        let partials = |id| graph.partials(id, values);
        self.run(graph, &partials, false, &mut |i, j, w| {
            add(i, j, w);
            if i != j {
                add(j, i, w);
            }
            true
        });
    }

    /// The pattern of the Hessian of a sum of expressions, both triangles.
    ///
    /// # Errors
    /// More than `limit` entries.
    pub fn pattern<'a>(
        &mut self,
        graph: &Graph,
        expressions: impl IntoIterator<Item = &'a Expression>,
        limit: usize,
    ) -> Result<Vec<(usize, usize)>, TooDense> {
        for expression in expressions {
            self.adjoint[expression.root as usize] = 1.0;
        }
        let mut entries: Vec<(usize, usize)> = Vec::new();
        let mut room = 1024;
        let partials = |id: NodeId| structure(graph, graph.nodes[id as usize]);
        let complete = self.run(graph, &partials, true, &mut |i, j, _| {
            entries.push((i, j));
            if i != j {
                entries.push((j, i));
            }
            if entries.len() > room {
                entries.sort_unstable();
                entries.dedup();
                room = 2 * entries.len().max(512);
            }
            entries.len() <= limit.saturating_mul(2)
        });
        entries.sort_unstable();
        entries.dedup();
        match complete && entries.len() <= limit && self.edges.len() <= limit.saturating_mul(2) {
            true => Ok(entries),
            false => Err(TooDense { limit }),
        }
    }

    /// The sweep; `false` if `add` has stopped it. With `flat`, weights only mark what may be nonzero.
    fn run(
        &mut self,
        graph: &Graph,
        partials: &dyn Fn(NodeId) -> Partials,
        flat: bool,
        add: &mut dyn FnMut(usize, usize, f64) -> bool,
    ) -> bool {
        let mut going = true;
        for id in (graph.variables..graph.nodes.len() as NodeId).rev() {
            let weight = std::mem::take(&mut self.adjoint[id as usize]);
            self.gather(id, flat);
            if !going || (weight == 0.0 && self.neighbours.is_empty()) {
                self.forget();
                continue;
            }
            let operands = graph.operands(graph.nodes[id as usize]);
            let (operands, p) = merge(operands, partials(id));
            for (operand, slope) in operands.into_iter().zip([p.a, p.b]) {
                if let Some(operand) = operand
                    && weight != 0.0
                    && slope != 0.0
                {
                    let passed = &mut self.adjoint[operand as usize];
                    *passed = if flat { 1.0 } else { *passed + weight * slope };
                }
            }
            let mut link = |hessian: &mut Self, i: NodeId, j: NodeId, w: f64| {
                if w == 0.0 {
                    return;
                }
                let (high, low) = (i.max(j), i.min(j));
                if high < graph.variables {
                    going &= add(high as usize, low as usize, w);
                } else {
                    hessian.insert(high, low, w);
                }
            };
            let second = [p.aa, p.ab, p.bb];
            self.push(id, operands, [p.a, p.b], weight, second, &mut link);
            self.forget();
        }
        self.adjoint[..graph.variables as usize].fill(0.0);
        going
    }

    /// Replaces the edges of a node and the second derivatives of its operation by edges between its operands and its other neighbours.
    fn push(
        &mut self,
        id: NodeId,
        operands: [Option<NodeId>; 2],
        slopes: [f64; 2],
        weight: f64,
        [aa, ab, bb]: [f64; 3],
        link: &mut dyn FnMut(&mut Self, NodeId, NodeId, f64),
    ) {
        let own = self.sum[id as usize];
        // The edge of the node with itself, and the second derivatives. Zero factors give zero, even if another factor is infinite.
        let product = |factors: &[f64]| match factors.contains(&0.0) {
            true => 0.0,
            false => factors.iter().product::<f64>(),
        };
        let [sa, sb] = slopes;
        if let Some(a) = operands[0] {
            link(self, a, a, product(&[own, sa, sa]) + product(&[weight, aa]));
        }
        if let Some(b) = operands[1] {
            link(self, b, b, product(&[own, sb, sb]) + product(&[weight, bb]));
        }
        if let [Some(a), Some(b)] = operands {
            link(self, a, b, product(&[own, sa, sb]) + product(&[weight, ab]));
        }
        for k in 0..self.neighbours.len() {
            let other = self.neighbours[k];
            if other == id {
                continue;
            }
            let w = self.sum[other as usize];
            for (operand, slope) in operands.into_iter().zip(slopes) {
                if let Some(operand) = operand {
                    let twice = if operand == other { 2.0 } else { 1.0 };
                    link(self, operand, other, twice * product(&[w, slope]));
                }
            }
        }
    }

    /// Sums the edges of a node by their other end, and frees them.
    fn gather(&mut self, id: NodeId, flat: bool) {
        let mut edge = std::mem::replace(&mut self.first[id as usize], NONE);
        while edge != NONE {
            let Edge { other, weight, next } = self.edges[edge as usize];
            if !std::mem::replace(&mut self.known[other as usize], true) {
                self.neighbours.push(other);
            }
            let sum = &mut self.sum[other as usize];
            *sum = if flat { 1.0 } else { *sum + weight };
            self.edges[edge as usize].next = self.free;
            self.free = edge;
            edge = next;
        }
    }

    /// Resets the sums.
    fn forget(&mut self) {
        for other in self.neighbours.drain(..) {
            self.sum[other as usize] = 0.0;
            self.known[other as usize] = false;
        }
    }

    fn insert(&mut self, high: NodeId, low: NodeId, weight: f64) {
        let edge = Edge {
            other: low,
            weight,
            next: self.first[high as usize],
        };
        let slot = match self.free {
            NONE => {
                self.edges.push(edge);
                self.edges.len() as u32 - 1
            }
            free => {
                self.free = self.edges[free as usize].next;
                self.edges[free as usize] = edge;
                free
            }
        };
        self.first[high as usize] = slot;
    }
}

/// Merges two equal operands into one.
fn merge(operands: [Option<NodeId>; 2], p: Partials) -> ([Option<NodeId>; 2], Partials) {
    match operands {
        [Some(a), Some(b)] if a == b => {
            let merged = Partials {
                a: p.a + p.b,
                aa: p.aa + 2.0 * p.ab + p.bb,
                ..Partials::default()
            };
            ([Some(a), None], merged)
        }
        _ => (operands, p),
    }
}

/// Ones where the derivatives of a node may differ from zero.
fn structure(graph: &Graph, node: Node) -> Partials {
    let is = |yes: bool| f64::from(u8::from(yes));
    let [a, b] = graph.operands(node);
    let varies = |operand: Option<NodeId>| is(operand.is_some_and(|id| graph.constant(id).is_none()));
    let (a, b) = (varies(a), varies(b));
    let (aa, ab, bb) = match node {
        Node::Power(p, _) => (is(p != 0.0 && p != 1.0), 0.0, 0.0),
        Node::Unary(op, _) => (is(!op.is_piecewise_affine()), 0.0, 0.0),
        Node::Binary(super::Binary::Multiply, ..) => (0.0, 1.0, 0.0),
        Node::Binary(super::Binary::Divide, ..) => (0.0, 1.0, 1.0),
        Node::Binary(op, ..) if !op.is_piecewise_affine() => (1.0, 1.0, 1.0),
        _ => (0.0, 0.0, 0.0),
    };
    Partials {
        a,
        b,
        aa: aa * a,
        ab: ab * a * b,
        bb: bb * b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::{Binary, Unary};

    /// s y − s y + 2 s y with s = sin x: the first two edges between s and y cancel before the third comes.
    #[test]
    fn edges_that_cancel_are_counted_once() {
        let mut graph = Graph::new(2, 0).unwrap();
        let s = graph.push(Node::Unary(Unary::Sin, 0)).unwrap();
        let mut root = None;
        for factor in [1.0, -1.0, 2.0] {
            let product = graph.push(Node::Binary(Binary::Multiply, s, 1)).unwrap();
            let term = graph.push(Node::Scale(factor, product)).unwrap();
            root = Some(root.map_or(term, |r| graph.push(Node::Binary(Binary::Add, r, term)).unwrap()));
        }
        let expression = graph.close(2, root.unwrap());
        let mut values = graph.workspace();
        graph.set_variables(&[0.3, 0.7], &mut values);
        graph.evaluate(&expression, &mut values);
        let mut found = [[0.0; 2]; 2];
        let mut hessian = Hessian::new(&graph);
        hessian.sweep(&graph, [(&expression, 1.0)], &values, &mut |i, j, v| {
            found[i][j] += v
        });
        let (sin, cos) = 0.3_f64.sin_cos();
        let expected = [[-1.4 * sin, 2.0 * cos], [2.0 * cos, 0.0]];
        for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
            assert!((found - expected).abs() < 1e-14, "{found} {expected}");
        }
        assert_eq!(
            hessian.pattern(&graph, [&expression], 3).unwrap(),
            [(0, 0), (0, 1), (1, 0)]
        );
        assert_eq!(
            hessian.pattern(&graph, [&expression], 2),
            Err(TooDense { limit: 2 })
        );
    }
}
