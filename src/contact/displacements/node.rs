//! The linearised law at one node, solved for the forces or for the displacements.

use super::system::ReducedStep;
use crate::contact::ContactState;
use crate::contact::law::{LocalRow, LocalValues, NodeLaw};
use crate::contact::solution::piece_of;
use crate::tolerances::{CHECKED, RESULT, SHIFT};

/// The linearised law of a node: some components of its displacement are prescribed, for the others (`free`)
/// δλ = stiffness δu + constant + coupling δλν, the last with prescribed penetration only.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Node {
    pub(super) piece: usize,
    /// Residuals of the law.
    pub(super) h: [f64; 3],
    pub(super) force: [f64; 3],
    /// Changes of the components that are prescribed.
    pub(super) prescribed: [Option<f64>; 3],
    pub(super) stiffness: [[f64; 3]; 3],
    pub(super) constant: [f64; 3],
    pub(super) coupling: [f64; 3],
}

/// The rows that the laws of contact nodes change in the system of a step.
#[derive(Debug, Default)]
pub(super) struct ChangedRows {
    constrained: Vec<usize>,
    added: Vec<(usize, usize, f64)>,
    beside: Vec<(usize, usize, f64)>,
    combined: Vec<(usize, usize, f64)>,
}

impl ChangedRows {
    pub(super) fn clear(&mut self) {
        self.constrained.clear();
        self.added.clear();
        self.beside.clear();
        self.combined.clear();
    }

    /// Adds those of a node, whose displacement begins at component `at`.
    pub(super) fn add(&mut self, node: &Node, at: usize, tangents: usize) {
        let free = |d: usize| node.prescribed[d].is_none();
        let definite = node.definite();
        for d in 0..=tangents {
            if !free(d) {
                self.constrained.push(at + d);
                continue;
            }
            for e in (0..=tangents).filter(|&e| free(e)) {
                if definite[d][e] != 0.0 {
                    self.added.push((at + d, at + e, definite[d][e]));
                }
                let rest = node.stiffness[d][e] - definite[d][e];
                if rest != 0.0 {
                    self.beside.push((at + d, at + e, rest));
                }
            }
            if node.coupling[d] != 0.0 {
                self.combined.push((at + d, at, -node.coupling[d]));
            }
        }
    }

    pub(super) fn step(&self) -> ReducedStep<'_> {
        ReducedStep {
            constrained: &self.constrained,
            added: &self.added,
            beside: &self.beside,
            combined: &self.combined,
        }
    }
}

impl Node {
    /// An error is the name of a piece whose equations do not determine the forces.
    pub(super) fn new(law: &dyn NodeLaw, v: &LocalValues) -> Result<Self, String> {
        let piece = piece_of(law, v);
        Self::solved(law, v, (piece, law.residual(piece, v)), true)
    }

    /// The linearised law of a piece with residuals h at the node, for derivatives: softened only where its forces are not determined
    /// otherwise.
    pub(super) fn with_residual(
        law: &dyn NodeLaw,
        v: &LocalValues,
        piece: usize,
        h: [f64; 3],
    ) -> Result<Self, String> {
        Self::solved(law, v, (piece, h), false)
    }

    fn solved(
        law: &dyn NodeLaw,
        v: &LocalValues,
        (piece, h): (usize, [f64; 3]),
        soft: bool,
    ) -> Result<Self, String> {
        let directions = 1 + law.num_tangents();
        let rows = law.rows(piece, v);
        let d = rows.map(|row: LocalRow| [row.penetration, row.slip[0], row.slip[1]]);
        let e = rows.map(|row: LocalRow| [row.pressure, row.traction[0], row.traction[1]]);
        let mut node = Self {
            piece,
            h,
            force: [v.pressure, v.traction[0], v.traction[1]],
            ..Self::default()
        };
        let refuse = || law.piece_name(piece).into();
        let small = |row: &[f64; 3], unit: f64| row.iter().all(|c| c.abs() <= RESULT * unit);
        if small(&e[0], 1.0) && small(&[0.0, d[0][1], d[0][2]], v.r) && d[0][0].abs() > RESULT * v.r {
            node.prescribed[0] = Some(-h[0] / d[0][0]);
        } else if e[0][0].abs() <= CHECKED {
            return Err(refuse());
        }
        let held = node.prescribed[0].is_some();
        let first = usize::from(held);
        let mut rhs = [0.0; 3];
        for a in first..directions {
            rhs[a] = -h[a] - node.prescribed[0].map_or(0.0, |change| d[a][0] * change);
        }
        if held
            && law.state(piece, v) == ContactState::Stick
            && !resists(&d, &e, directions)
            && let Some(change) = solve(&d, 1..directions, &rhs)
        {
            (1..directions).for_each(|a| node.prescribed[a] = Some(change[a]));
            return Ok(node);
        }
        let softer = softened(e, first..directions);
        let column = |b: &[f64; 3]| {
            let own = solve(&e, first..directions, b).filter(|_| !soft);
            own.or_else(|| solve(&softer, first..directions, b))
                .ok_or_else(refuse)
        };
        node.constant = column(&rhs)?;
        if held {
            node.coupling = column(&[0.0, -e[1][0], -e[2][0]])?;
        }
        for k in first..directions {
            let s = column(&[-d[0][k], -d[1][k], -d[2][k]])?;
            (first..directions).for_each(|a| node.stiffness[a][k] = s[a]);
        }
        Ok(node)
    }

    /// The part of the stiffness that is symmetric and positive semidefinite; normal and tangential directions are treated separately.
    pub(super) fn definite(&self) -> [[f64; 3]; 3] {
        let s = &self.stiffness;
        let mut out = [[0.0; 3]; 3];
        out[0][0] = s[0][0].max(0.0);
        let (a, b, c) = (s[1][1], 0.5 * (s[1][2] + s[2][1]), s[2][2]);
        let (mean, radius) = (0.5 * (a + c), (0.5 * (a - c)).hypot(b));
        let (low, high) = ((mean - radius).max(0.0), (mean + radius).max(0.0));
        if radius == 0.0 {
            (out[1][1], out[2][2]) = (high, high);
            return out;
        }
        // Projector on the direction of the larger eigenvalue.
        let p = [
            [0.5 + 0.25 * (a - c) / radius, 0.5 * b / radius],
            [0.5 * b / radius, 0.5 - 0.25 * (a - c) / radius],
        ];
        for i in 0..2 {
            for j in 0..2 {
                let identity = f64::from(u8::from(i == j));
                out[1 + i][1 + j] = high * p[i][j] + low * (identity - p[i][j]);
            }
        }
        out
    }
}

/// Whether a sticking node has tangential forces that determine its displacement like a spring: −E⁻¹ D is positive definite.
fn resists(d: &[[f64; 3]; 3], e: &[[f64; 3]; 3], directions: usize) -> bool {
    let column = |k: usize| solve(e, 1..directions, &[0.0, -d[1][k], -d[2][k]]);
    let Some(first) = column(1) else {
        return false;
    };
    if directions == 2 {
        return first[1] > 0.0;
    }
    let Some(second) = column(2) else {
        return false;
    };
    let off = 0.5 * (first[2] + second[1]);
    first[1] > 0.0 && first[1] * second[2] > off * off
}

/// A small share of the mean diagonal entry, where the block is nearly singular: at the onset of slip there is one direction in which the
/// force of a node does not change.
fn softened(mut e: [[f64; 3]; 3], range: std::ops::Range<usize>) -> [[f64; 3]; 3] {
    let size = range
        .clone()
        .flat_map(|a| e[a])
        .fold(0.0f64, |m, v| m.max(v.abs()));
    for a in range {
        e[a][a] += SHIFT * size; // invertible, if nearly singular
    }
    e
}

/// m x = b on a range of rows and columns by elimination with pivots; `None` where it is singular.
fn solve(m: &[[f64; 3]; 3], range: std::ops::Range<usize>, b: &[f64; 3]) -> Option<[f64; 3]> {
    let (mut m, mut b) = (*m, *b);
    let size = range
        .clone()
        .flat_map(|a| range.clone().map(move |c| (a, c)))
        .fold(0.0f64, |s, (a, c)| s.max(m[a][c].abs()));
    for k in range.clone() {
        let pivot = (k..range.end).max_by(|&i, &j| m[i][k].abs().total_cmp(&m[j][k].abs()))?;
        if m[pivot][k].is_nan() || m[pivot][k].abs() <= CHECKED * size || size == 0.0 {
            return None;
        }
        m.swap(k, pivot);
        b.swap(k, pivot);
        for i in k + 1..range.end {
            let factor = m[i][k] / m[k][k];
            for c in k..range.end {
                m[i][c] -= factor * m[k][c];
            }
            b[i] -= factor * b[k];
        }
    }
    let mut x = [0.0; 3];
    for k in range.clone().rev() {
        let known: f64 = (k + 1..range.end).map(|c| m[k][c] * x[c]).sum();
        x[k] = (b[k] - known) / m[k][k];
    }
    Some(x)
}
