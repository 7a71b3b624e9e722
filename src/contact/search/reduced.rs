//! Newton's method for a condensed problem, with the unknowns that each node's own equations determine eliminated first.

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::sync::Arc;

use crate::contact::Contact;
use crate::contact::law::{LocalRow, LocalValues, NodeLaw};
use crate::contact::rounding::size_of_forces;
use crate::contact::solution::piece_of;
use crate::interface::View;
use crate::linear::{CondensedRows, DenseLu, Hierarchical, HierarchicalLu, LinearSolver};
use crate::parallel;
use crate::piecewise::PiecewiseSmooth;
use crate::sparse::Matrix;
use crate::tolerances::{CHECKED, COLUMNS, RESULT, ROUNDING};

/// A residual above this share of the earlier one with the same pieces is no progress.
const PROGRESS: f64 = 0.9;

/// The rows of one node, D δv + E δλ = b, after elimination: the first `rank` contain displacements; the others give δλ = T μ + s with
/// `rank` free components μ.
#[derive(Debug, Clone, Copy, Default)]
struct Node {
    rank: usize,
    /// Index of the node's first component of μ.
    first: usize,
    d: [[f64; 3]; 3],
    e: [[f64; 3]; 3],
    b: [f64; 3],
    t: [[f64; 3]; 3],
    s: [f64; 3],
}

impl Node {
    /// `None` where the forces are not determined.
    fn new(blocks: usize, h: &[f64; 3], rows: &[LocalRow; 3]) -> Option<Self> {
        let mut n = Self::default();
        for a in 0..blocks {
            n.d[a] = [rows[a].penetration, rows[a].slip[0], rows[a].slip[1]];
            n.e[a] = [rows[a].pressure, rows[a].traction[0], rows[a].traction[1]];
            n.b[a] = -h[a];
        }
        let largest = n.d.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
        let mut used = [false; 3];
        while n.rank < blocks {
            let k = n.rank;
            let (row, column) = pivot(&n.d, k..blocks, blocks, &used);
            if n.d[row][column].abs() <= RESULT * largest {
                break;
            }
            n.d.swap(k, row);
            n.e.swap(k, row);
            n.b.swap(k, row);
            used[column] = true;
            // The pivot may contain a factor that changes with the coefficient of friction; the row divided by it does not change.
            let p = n.d[k][column];
            n.d[k] = n.d[k].map(|v| v / p);
            n.e[k] = n.e[k].map(|v| v / p);
            n.b[k] /= p;
            for a in k + 1..blocks {
                let c = n.d[a][column];
                for j in 0..3 {
                    n.d[a][j] -= c * n.d[k][j];
                    n.e[a][j] -= c * n.e[k][j];
                }
                n.b[a] -= c * n.b[k];
            }
            n.rank += 1;
        }
        n.solve_local(blocks)?;
        Some(n)
    }

    /// Whether the node contributes the same rows and columns to the matrix as `other`.
    fn has_matrix_of(&self, other: &Self) -> bool {
        let rows = |n: &Self| (n.rank, n.first, n.t, n.d, n.e);
        let (own, other) = (rows(self), rows(other));
        own.0 == other.0
            && own.1 == other.1
            && own.2 == other.2
            && own.3[..own.0] == other.3[..own.0]
            && own.4[..own.0] == other.4[..own.0]
    }

    /// T and s from the rows without displacements (Gauss–Jordan).
    fn solve_local(&mut self, blocks: usize) -> Option<()> {
        let mut used = [false; 3];
        let mut column_of = [0; 3];
        for k in self.rank..blocks {
            let size = self.e[k..blocks]
                .iter()
                .flatten()
                .fold(0.0f64, |m, v| m.max(v.abs()));
            let (row, column) = pivot(&self.e, k..blocks, blocks, &used);
            let p = self.e[row][column];
            if p.abs() <= RESULT * size || p == 0.0 {
                return None;
            }
            self.e.swap(k, row);
            self.b.swap(k, row);
            self.e[k] = self.e[k].map(|v| v / p);
            self.b[k] /= p;
            used[column] = true;
            column_of[k] = column;
            for a in self.rank..blocks {
                let c = self.e[a][column];
                if a == k || c == 0.0 {
                    continue;
                }
                for j in 0..3 {
                    self.e[a][j] -= c * self.e[k][j];
                }
                self.b[a] -= c * self.b[k];
            }
        }
        for (m, c) in (0..blocks).filter(|&c| !used[c]).enumerate() {
            self.t[c][m] = 1.0;
            for k in self.rank..blocks {
                self.t[column_of[k]][m] = -self.e[k][c];
            }
        }
        for k in self.rank..blocks {
            self.s[column_of[k]] = self.b[k];
        }
        Some(())
    }
}

/// Row and column of the largest entry in the given rows and in columns not used yet.
fn pivot(m: &[[f64; 3]; 3], rows: std::ops::Range<usize>, blocks: usize, used: &[bool; 3]) -> (usize, usize) {
    let (mut best, mut at) = (-1.0, (rows.start, 0));
    for a in rows {
        for c in (0..blocks).filter(|&c| !used[c]) {
            if m[a][c].abs() > best {
                (best, at) = (m[a][c].abs(), (a, c));
            }
        }
    }
    at
}

/// Newton's method for condensed problems in the unknowns left after elimination at each node. The last factorisation is kept: under laws
/// with given bounds the matrix depends only on the pieces and serves from one problem to the next.
#[derive(Debug, Default)]
pub(in crate::contact) struct ReducedNewton {
    nodes: Vec<Node>,
    pieces: Vec<usize>,
    /// The nodes to which `lu` belongs; empty where the factorisation failed.
    factored: Vec<Node>,
    lu: DenseLu,
    /// The step in the forces, and C times it.
    s: Vec<f64>,
    image: Vec<f64>,
    rhs: Vec<f64>,
    /// The matrix of the remaining system by columns; for each column, the node and the index of its component of μ.
    matrix: Vec<f64>,
    columns: Vec<(usize, usize)>,
    /// Factors of the equations of all nodes, where C has a hierarchical form, and scratch of its products.
    by_blocks: Option<HierarchicalLu>,
    room: Vec<f64>,
}

/// The state of the nodes at an iterate.
struct Look {
    /// The largest residual, and the largest force.
    worst: f64,
    size: f64,
    changed: bool,
    order: usize,
}

impl ReducedNewton {
    /// Improves x by Newton steps (full ones; damped ones once they cycle) until the residual is rounding, or an affine selection is
    /// repeated. False where that fails, in full form, and where `go_on`, called before each step, breaks.
    ///
    /// The forces of open nodes are known; at slipping nodes λt = ±F λν in the plane, and in space one of the three equations contains
    /// forces alone. The dense system has only the remaining unknowns, which makes large problems fast. The result is not verified here: it
    /// is a start for the general method.
    pub(super) fn run<V: View>(
        &mut self,
        problem: &Contact<V, &dyn NodeLaw>,
        x: &mut [f64],
        max_iterations: usize,
        go_on: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> bool {
        let supported = problem.body().anchors().is_empty();
        let Some(reduced) = problem.view.reduced().filter(|_| supported) else {
            return false;
        };
        let law = *problem.node_law();
        let (p, q) = (problem.num_contacts(), problem.num_residuals());
        self.pieces.clear();
        self.pieces.resize(p, usize::MAX);
        self.nodes.resize(p, Node::default());
        let mut before = f64::INFINITY;
        let mut seen = HashMap::new();
        let mut cycles = false;
        for _ in 0..max_iterations {
            let Some(look) = self.look(problem, x) else {
                return false;
            };
            let Look { worst, size, .. } = look;
            let settled = worst <= CHECKED * size && worst > 0.1 * before;
            if worst <= ROUNDING * size || settled || (!look.changed && law.is_affine()) {
                return true;
            }
            before = worst;
            let known = seen.insert(self.pieces.clone(), worst);
            cycles |= known.is_some_and(|known| worst > PROGRESS * known);
            if go_on().is_break() {
                return false;
            }
            let stepped = reduced.hierarchical().and_then(|c| self.step_by_blocks(c, q / p));
            // Blocks on the diagonal may be singular where the matrix is not.
            let stepped = stepped.or_else(|| self.step(reduced.compliance(), q / p, look.order));
            if stepped.is_none() {
                return false;
            }
            // Full steps that return to the same pieces without progress would cycle.
            if cycles {
                if !descend(problem, x, &self.s) {
                    return false;
                }
            } else {
                x.iter_mut().zip(&self.s).for_each(|(x, d)| *x += d);
            }
        }
        false
    }

    /// Pieces, residuals and rows of all nodes at x.
    fn look<V: View>(&mut self, problem: &Contact<V, &dyn NodeLaw>, x: &[f64]) -> Option<Look> {
        let law = *problem.node_law();
        let blocks = problem.num_residuals() / problem.num_contacts();
        let mut look = Look {
            worst: 0.0,
            size: 0.0,
            changed: false,
            order: 0,
        };
        let values = problem.nodes(x);
        if values.len() != self.nodes.len() {
            return None;
        }
        for (i, v) in values.into_iter().enumerate() {
            let piece = piece_of(law, &v);
            look.changed |= std::mem::replace(&mut self.pieces[i], piece) != piece;
            let h = law.residual(piece, &v);
            look.worst = h[..blocks].iter().fold(look.worst, |m, h| m.max(h.abs()));
            look.size = look.size.max(size_of_forces(&v, [0.0; 3]));
            let mut node = Node::new(blocks, &h, &law.rows(piece, &v))?;
            node.first = look.order;
            look.order += node.rank;
            self.nodes[i] = node;
        }
        (look.worst.is_finite() && look.size.is_finite()).then_some(look)
    }

    /// The Newton step into `s`.
    fn step(&mut self, compliance: &Matrix, blocks: usize, order: usize) -> Option<()> {
        let Self {
            nodes, s, image, rhs, ..
        } = self;
        let p = nodes.len();
        for v in [&mut *s, image] {
            v.clear();
            v.resize(blocks * p, 0.0);
        }
        for (i, node) in nodes.iter().enumerate() {
            for b in 0..blocks {
                s[b * p + i] = node.s[b];
            }
        }
        compliance.as_ref().mul_add(1.0, s, image);
        rhs.clear();
        for (i, node) in nodes.iter().enumerate() {
            for a in 0..node.rank {
                let known = |b: usize| node.d[a][b] * image[b * p + i] - node.e[a][b] * node.s[b];
                rhs.push(node.b[a] + (0..blocks).map(known).sum::<f64>());
            }
        }
        if order > 0 {
            self.factor(compliance.values(), blocks, order)?;
            self.lu.solve_in_place(&mut self.rhs).ok()?;
        }
        for (i, node) in self.nodes.iter().enumerate() {
            for b in 0..blocks {
                let moved = (0..node.rank).map(|m| node.t[b][m] * self.rhs[node.first + m]);
                self.s[b * p + i] += moved.sum::<f64>();
            }
        }
        Some(())
    }

    /// The Newton step into `s`, from hierarchical factors of the equations of all nodes, improved once. `None` where blocks are singular.
    fn step_by_blocks(&mut self, c: &Arc<Hierarchical>, blocks: usize) -> Option<()> {
        self.factor_by_blocks(c, blocks)?;
        let lu = self.by_blocks.as_mut()?;
        let (nodes, p) = (&self.nodes, self.nodes.len());
        self.s.clear();
        self.s.resize(blocks * p, 0.0);
        for _ in 0..2 {
            self.image.clear();
            self.image.resize(blocks * p, 0.0);
            c.subtract_product(&self.s, &mut self.image, &mut self.room);
            self.rhs.clear();
            for a in 0..blocks {
                self.rhs.extend(nodes.iter().enumerate().map(|(i, node)| {
                    let d = if a < node.rank { node.d[a] } else { [0.0; 3] };
                    let term = |b: usize| d[b] * self.image[b * p + i] + node.e[a][b] * self.s[b * p + i];
                    node.b[a] - (0..blocks).map(term).sum::<f64>()
                }));
            }
            lu.solve_in_place(&mut self.rhs).ok()?;
            self.s.iter_mut().zip(&self.rhs).for_each(|(s, d)| *s += d);
        }
        // The forces that nodes determine themselves are exact: zero at open nodes.
        for (i, node) in nodes.iter().enumerate() {
            let is_free =
                |c: usize, m: usize| (0..node.rank).all(|k| node.t[c][k] == f64::from(u8::from(k == m)));
            let mut mu = [0.0; 3];
            for (m, mu) in mu[..node.rank].iter_mut().enumerate() {
                *mu = self.s[(0..blocks).find(|&c| is_free(c, m))? * p + i];
            }
            for b in 0..blocks {
                self.s[b * p + i] = node.s[b] + (0..node.rank).map(|m| node.t[b][m] * mu[m]).sum::<f64>();
            }
        }
        self.s.iter().all(|s| s.is_finite()).then_some(())
    }

    /// Factors −D C + E by blocks, unless it is the matrix factored last.
    fn factor_by_blocks(&mut self, c: &Arc<Hierarchical>, blocks: usize) -> Option<()> {
        let (nodes, p) = (&self.nodes, self.nodes.len());
        let matrix = |n: &Node| (n.rank, n.d, n.e);
        let same = self.by_blocks.is_some()
            && self.factored.len() == p
            && (nodes.iter().zip(&self.factored)).all(|(node, known)| matrix(node) == matrix(known));
        if same {
            return Some(());
        }
        // `factored` is that of one matrix.
        if self.by_blocks.take().is_some() {
            self.factored.clear();
        }
        let mut rows = CondensedRows::default();
        for a in 0..blocks {
            for (i, node) in nodes.iter().enumerate() {
                let entries = |row: [f64; 3]| {
                    let entry = move |b: usize| (a * p + i, b * p + i, row[b]);
                    (0..blocks).map(entry).filter(|e| e.2 != 0.0)
                };
                if a < node.rank {
                    rows.traces.extend(entries(node.d[a]));
                }
                rows.multipliers.extend(entries(node.e[a]));
            }
        }
        self.by_blocks = Some(HierarchicalLu::new(Arc::clone(c), &rows, &[]).ok()?);
        self.factored.clone_from(nodes);
        Some(())
    }

    /// Factors the matrix of the remaining system, unless it is the one factored last.
    fn factor(&mut self, c: &[f64], blocks: usize, order: usize) -> Option<()> {
        if self.by_blocks.take().is_some() {
            self.factored.clear();
        }
        let (nodes, p) = (&self.nodes, self.nodes.len());
        let same = self.factored.len() == p
            && (nodes.iter().zip(&self.factored)).all(|(node, known)| node.has_matrix_of(known));
        if same {
            return Some(());
        }
        self.factored.clear();
        let q = blocks * p;
        self.columns.clear();
        let of_node = |(j, node): (usize, &Node)| (0..node.rank).map(move |m| (j, m));
        self.columns.extend(nodes.iter().enumerate().flat_map(of_node));
        self.matrix.resize(order.checked_mul(order)?, 0.0);
        let columns = &self.columns;
        parallel::parts(&mut self.matrix, order * COLUMNS, &|first, part| {
            let mut column = vec![0.0; q];
            for (target, (j, m)) in part.chunks_exact_mut(order).zip(&columns[first / order..]) {
                let node = &nodes[*j];
                column.fill(0.0);
                for b in 0..blocks {
                    let t = node.t[b][*m];
                    if t != 0.0 {
                        let own = &c[(b * p + j) * q..(b * p + j + 1) * q];
                        column.iter_mut().zip(own).for_each(|(y, c)| *y -= t * c);
                    }
                }
                for (i, row) in nodes.iter().enumerate() {
                    for a in 0..row.rank {
                        let moved = (0..blocks).map(|b| row.d[a][b] * column[b * p + i]);
                        target[row.first + a] = moved.sum();
                    }
                }
                for a in 0..node.rank {
                    target[node.first + a] += (0..blocks).map(|b| node.e[a][b] * node.t[b][*m]).sum::<f64>();
                }
            }
        });
        self.lu.factor_full(order, &self.matrix).ok()?;
        self.factored.extend_from_slice(nodes);
        Some(())
    }
}

/// Backtracks along the step, by halving, until the residual decreases; `false` where it does not.
fn descend<V: View>(problem: &Contact<V, &dyn NodeLaw>, x: &mut [f64], step: &[f64]) -> bool {
    const HALVINGS: i32 = 12;
    let law = *problem.node_law();
    let blocks = problem.num_residuals() / problem.num_contacts();
    let squares = |x: &[f64]| -> f64 {
        let square = |v: &LocalValues| {
            let h = law.residual(piece_of(law, v), v);
            h[..blocks].iter().map(|h| h * h).sum::<f64>()
        };
        problem.nodes(x).iter().map(square).sum()
    };
    let (start, before) = (x.to_vec(), squares(x));
    for halvings in 0..HALVINGS {
        let length = 0.5_f64.powi(halvings);
        for ((x, start), d) in x.iter_mut().zip(&start).zip(step) {
            *x = start + length * d;
        }
        if squares(x) < (1.0 - 1e-4 * length) * before {
            return true;
        }
    }
    x.copy_from_slice(&start);
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spread::Random;

    /// D of each rank, as a product with permuted rows, and steps (δv, δλ) that satisfy the rows: they satisfy the eliminated rows with the
    /// free components of δλ as μ.
    #[test]
    fn elimination_at_a_node_keeps_its_solutions() {
        let mut random = Random::new(3);
        for case in 0..300 {
            let blocks = 2 + case % 2;
            let rank = case / 2 % (blocks + 1);
            let mut numbers = || -> [[f64; 3]; 3] {
                std::array::from_fn(|a| {
                    std::array::from_fn(|b| {
                        let v = random.symmetric();
                        if a < blocks && b < blocks { v } else { 0.0 }
                    })
                })
            };
            let [left, right, e, steps] = std::array::from_fn(|_| numbers());
            let d: [[f64; 3]; 3] = std::array::from_fn(|a| {
                std::array::from_fn(|b| (0..rank).map(|k| left[a][k] * right[k][b]).sum())
            });
            let dot = |a: &[f64; 3], b: &[f64; 3]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
            let [v, lambda, _] = steps;
            let h = std::array::from_fn(|a| -dot(&d[a], &v) - dot(&e[a], &lambda));
            let rows = std::array::from_fn(|a| LocalRow {
                penetration: d[a][0],
                slip: [d[a][1], d[a][2]],
                pressure: e[a][0],
                traction: [e[a][1], e[a][2]],
                ..LocalRow::default()
            });
            let node = Node::new(blocks, &h, &rows).unwrap();
            assert_eq!(node.rank, rank, "{case}");
            let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-7, "{case}: {a} {b}");
            for k in 0..rank {
                near(dot(&node.d[k], &v) + dot(&node.e[k], &lambda), node.b[k]);
            }
            let free = |m: usize| {
                (0..blocks).position(|c| (0..rank).all(|k| node.t[c][k] == f64::from(u8::from(k == m))))
            };
            let mu: Vec<f64> = (0..rank).map(|m| lambda[free(m).unwrap()]).collect();
            for c in 0..blocks {
                near(
                    node.s[c] + (0..rank).map(|m| node.t[c][m] * mu[m]).sum::<f64>(),
                    lambda[c],
                );
            }
        }
    }
}
