//! Gradients of single expressions by reverse sweeps.

use std::collections::BinaryHeap;

use super::{Expression, Graph, Node, NodeId};

/// Handles a node and its adjoint; the last argument passes adjoints on to its operands.
type Visit<'a> = dyn FnMut(NodeId, f64, &mut dyn FnMut(NodeId, f64)) + 'a;

/// Buffers of reverse sweeps. A sweep visits only the nodes of its expression and of the defined variables below it.
#[derive(Debug, Clone)]
pub struct Gradient {
    /// Derivative with respect to each node; zero between sweeps.
    adjoint: Vec<f64>,
    /// Defined variables that were reached and are still to be visited, the last one first.
    waiting: BinaryHeap<u32>,
    reached: Vec<bool>,
}

impl Gradient {
    /// Buffers for a graph.
    #[must_use]
    pub fn new(graph: &Graph) -> Self {
        Self {
            adjoint: graph.workspace(),
            waiting: BinaryHeap::new(),
            reached: vec![false; graph.defined.len()],
        }
    }

    /// Passes `scale` times the gradient of an expression at the point of `values` to `add`, by variable; a variable may come several
    /// times, with terms to be summed.
    pub fn sweep(
        &mut self,
        graph: &Graph,
        expression: &Expression,
        values: &[f64],
        scale: f64,
        add: &mut dyn FnMut(usize, f64),
    ) {
        self.walk(graph, expression, scale, &mut |id, weight, pass| {
            // Nodes with adjoint zero are skipped: the branch not taken may be undefined at this point.
            if weight == 0.0 {
                return;
            }
            let node = graph.nodes[id as usize];
            if matches!(node, Node::Variable) {
                add(id as usize, weight);
                return;
            }
            let partials = graph.partials(id, values);
            for (operand, slope) in graph.operands(node).into_iter().zip([partials.a, partials.b]) {
                if let Some(operand) = operand
                    && slope != 0.0
                {
                    pass(operand, weight * slope);
                }
            }
        });
    }

    /// Passes the variables on which an expression depends to `found`, possibly repeatedly.
    pub fn variables(&mut self, graph: &Graph, expression: &Expression, found: &mut dyn FnMut(usize)) {
        self.walk(graph, expression, 1.0, &mut |id, weight, pass| {
            if weight == 0.0 {
                return;
            }
            let node = graph.nodes[id as usize];
            if matches!(node, Node::Variable) {
                found(id as usize);
            }
            for operand in graph.operands(node).into_iter().flatten() {
                // Only zero or nonzero matters.
                pass(operand, 1.0);
            }
        });
    }

    /// Visits the nodes of an expression and of the defined variables below it from the last to the first; `visit` passes adjoints to
    /// operands. Variables are visited each time an adjoint is passed to them.
    fn walk(&mut self, graph: &Graph, expression: &Expression, weight: f64, visit: &mut Visit<'_>) {
        let mut current = expression.clone();
        let mut start = weight;
        loop {
            match current.root < graph.variables {
                true => visit(current.root, start, &mut |_, _| {}),
                false => self.adjoint[current.root as usize] += start,
            }
            for id in current.nodes.clone().rev() {
                let weight = std::mem::take(&mut self.adjoint[id as usize]);
                let node = graph.nodes[id as usize];
                let mut leaves = [(0, 0.0); 2];
                let mut count = 0;
                let (adjoint, waiting, reached) = (&mut self.adjoint, &mut self.waiting, &mut self.reached);
                visit(id, weight, &mut |operand, weight| {
                    if operand < graph.variables && !matches!(node, Node::Defined(_)) {
                        leaves[count] = (operand, weight);
                        count += 1;
                        return;
                    }
                    if let Node::Defined(d) = node
                        && !std::mem::replace(&mut reached[d as usize], true)
                    {
                        waiting.push(d);
                    }
                    adjoint[operand as usize] += weight;
                });
                for &(variable, weight) in &leaves[..count] {
                    visit(variable, weight, &mut |_, _| {});
                }
            }
            let Some(d) = self.waiting.pop() else { return };
            self.reached[d as usize] = false;
            let Some(next) = graph.defined(d as usize) else {
                return;
            };
            current = next.clone();
            // The adjoint passed to its root; a root that is a variable is visited there.
            start = match current.root < graph.variables {
                true => std::mem::take(&mut self.adjoint[current.root as usize]),
                false => 0.0,
            };
        }
    }
}
