//! Edges joined to branches, branches to components.

use super::{Diagram, EdgeEnd};
use crate::sparse::{distance, max_abs, norm};

/// Two arms this far from opposite go straight through a vertex.
const STRAIGHT: f64 = 1e-4;

/// A maximal chain of edges: through vertices of two arms, and straight on where several meet.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DiagramBranch {
    /// Its edges in order, each with whether it is walked against its direction.
    pub edges: Vec<(usize, bool)>,
    /// Whether it is a closed curve.
    pub closed: bool,
}

impl Diagram {
    /// The branches: every edge belongs to exactly one.
    #[must_use]
    pub fn branches(&self) -> Vec<DiagramBranch> {
        let mut used = vec![false; self.edges.len()];
        let mut branches = Vec::new();
        // Open chains first, from their ends; the remaining ones are closed.
        for (e, edge) in self.edges.iter().enumerate() {
            for (end, reverse) in [(edge.from, false), (edge.to, true)] {
                if !used[e] && self.partner(end).is_none() {
                    branches.push(self.walk(e, reverse, &mut used));
                }
            }
        }
        for e in 0..self.edges.len() {
            if !used[e] {
                branches.push(self.walk(e, false, &mut used));
            }
        }
        branches
    }

    /// The closed curves that are connected to nothing else.
    #[must_use]
    pub fn isolas(&self) -> Vec<DiagramBranch> {
        let components = self.components();
        let alone = |b: &DiagramBranch| {
            components
                .iter()
                .any(|c| c.len() == b.edges.len() && b.edges.iter().all(|e| c.contains(&e.0)))
        };
        self.branches()
            .into_iter()
            .filter(|b| b.closed && alone(b))
            .collect()
    }

    /// The connected components, each as its edges in increasing order.
    #[must_use]
    pub fn components(&self) -> Vec<Vec<usize>> {
        let mut label: Vec<usize> = (0..self.vertices.len()).collect();
        for edge in &self.edges {
            let (a, b) = (root(&label, edge.from.vertex), root(&label, edge.to.vertex));
            label[a.max(b)] = a.min(b);
        }
        let mut components: Vec<(usize, Vec<usize>)> = Vec::new();
        for (e, edge) in self.edges.iter().enumerate() {
            let r = root(&label, edge.from.vertex);
            match components.iter_mut().find(|c| c.0 == r) {
                Some(c) => c.1.push(e),
                None => components.push((r, vec![e])),
            }
        }
        components.into_iter().map(|c| c.1).collect()
    }

    fn walk(&self, first: usize, reverse: bool, used: &mut [bool]) -> DiagramBranch {
        let mut edges = Vec::new();
        let (mut e, mut reverse) = (first, reverse);
        loop {
            used[e] = true;
            edges.push((e, reverse));
            let edge = &self.edges[e];
            let leave = if reverse { edge.from } else { edge.to };
            let Some(next) = self.partner(leave) else {
                return DiagramBranch { edges, closed: false };
            };
            let Some(onward) = self.link(next).edge.filter(|n| !used[*n]) else {
                return DiagramBranch { edges, closed: true };
            };
            e = onward;
            reverse = self.edges[e].to == next;
        }
    }

    /// The arm on which a branch that arrives along `end` goes on.
    fn partner(&self, end: EdgeEnd) -> Option<EdgeEnd> {
        let arms = &self.vertices[end.vertex].arms;
        let tangent = |k: usize| self.explored(&arms[k].arm.tangent);
        let others = (0..arms.len()).filter(|&k| k != end.arm);
        let arm = if arms.len() == 2 {
            others.into_iter().next()?
        } else {
            let back: Vec<f64> = tangent(end.arm).iter().map(|t| -t).collect();
            let far = others.map(|k| (distance(&tangent(k), &back), k));
            far.filter(|f| f.0 < STRAIGHT)
                .min_by(|a, b| a.0.total_cmp(&b.0))?
                .1
        };
        arms[arm].edge.map(|_| EdgeEnd {
            vertex: end.vertex,
            arm,
        })
    }

    /// A direction in the scaled variables of the exploration: in others all arms may seem to be one.
    fn explored(&self, tangent: &[f64]) -> Vec<f64> {
        let mut t = tangent.to_vec();
        t.iter_mut().zip(&self.sizes).for_each(|(t, size)| *t /= size);
        let largest = max_abs(&t);
        t.iter_mut().for_each(|t| *t /= largest);
        let length = norm(&t);
        t.iter_mut().for_each(|t| *t /= length);
        t
    }
}

fn root(label: &[usize], mut v: usize) -> usize {
    while label[v] != v {
        v = label[v];
    }
    v
}
