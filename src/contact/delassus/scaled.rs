use std::cell::Cell;

use super::DelassusProblem;
use super::cone::natural_residual;
use crate::sparse::max_abs;

/// A vector of blocks, one a contact.
pub(super) type Vector<const D: usize> = Vec<[f64; D]>;
pub(super) type Block<const D: usize> = [[f64; D]; D];

/// A problem in scaled variables and block storage: the mean diagonal entry of each contact is 1 and ‖q‖∞ is 1.
///
/// With S = diag(s_i) one positive factor a contact and σ = ‖S q‖∞ the scaled problem is S M S, S q / σ, with r = σ S r̃ and
/// u = σ S⁻¹ ũ: cones and the law do not feel it.
#[derive(Debug, Clone)]
pub(super) struct Scaled<const D: usize> {
    pub(super) friction: Vec<f64>,
    pub(super) q: Vector<D>,
    pub(super) matrix: BlockMatrix<D>,
    scale: Vec<f64>,
    sigma: f64,
    /// How often velocities of all contacts were asked for.
    evaluations: Cell<usize>,
}

/// D × D blocks by rows, with the way to read them by columns.
#[derive(Debug, Clone)]
pub(super) struct BlockMatrix<const D: usize> {
    pub(super) row_ptr: Vec<usize>,
    /// Block column of each block, increasing in a row.
    pub(super) col: Vec<usize>,
    pub(super) blocks: Vec<Block<D>>,
    /// Diagonal blocks, zero where none is stored.
    pub(super) diagonal: Vec<Block<D>>,
    pub(super) col_ptr: Vec<usize>,
    /// Block row of each block, increasing in a column.
    pub(super) row: Vec<usize>,
    /// Where that block stands in `blocks`.
    pub(super) slot: Vec<usize>,
}

impl<const D: usize> BlockMatrix<D> {
    /// Every diagonal block is stored, also where it vanishes.
    fn new(problem: &DelassusProblem, scale: &[f64]) -> Self {
        let nc = problem.contacts();
        let pattern = problem.matrix().pattern();
        let (ptr, rows) = (pattern.col_ptr(), pattern.row_idx());
        let values = problem.matrix().values();
        let mut col_ptr = Vec::with_capacity(nc + 1);
        col_ptr.push(0);
        let mut row = Vec::with_capacity(values.len() / (D * D));
        let mut place = vec![usize::MAX; nc];
        for j in 0..nc {
            let start = row.len();
            place[j] = start;
            row.push(j);
            for k in ptr[j * D]..ptr[(j + 1) * D] {
                let i = rows[k] / D;
                if values[k] != 0.0 && (place[i] == usize::MAX || place[i] < start) {
                    place[i] = row.len();
                    row.push(i);
                }
            }
            row[start..].sort_unstable();
            col_ptr.push(row.len());
        }
        let mut row_ptr = vec![0; nc + 1];
        for &i in &row {
            row_ptr[i + 1] += 1;
        }
        for i in 0..nc {
            row_ptr[i + 1] += row_ptr[i];
        }
        // The starts of rows serve as cursors, which end one row further on.
        let mut col = vec![0; row.len()];
        let mut slot = vec![0; row.len()];
        let mut blocks = vec![[[0.0; D]; D]; row.len()];
        let mut diagonal = vec![[[0.0; D]; D]; nc];
        for j in 0..nc {
            for k in col_ptr[j]..col_ptr[j + 1] {
                let i = row[k];
                slot[k] = row_ptr[i];
                place[i] = row_ptr[i];
                col[row_ptr[i]] = j;
                row_ptr[i] += 1;
            }
            for c in 0..D {
                for k in ptr[j * D + c]..ptr[j * D + c + 1] {
                    let (i, a) = (rows[k] / D, rows[k] % D);
                    if values[k] != 0.0 {
                        blocks[place[i]][a][c] = scale[i] * scale[j] * values[k];
                    }
                }
            }
            diagonal[j] = blocks[place[j]];
        }
        row_ptr.rotate_right(1);
        row_ptr[0] = 0;
        Self {
            row_ptr,
            col,
            blocks,
            diagonal,
            col_ptr,
            row,
            slot,
        }
    }

    /// Whether block (j, i) is stored with block (i, j).
    pub(super) fn is_structurally_symmetric(&self) -> bool {
        self.row_ptr == self.col_ptr && self.row == self.col
    }

    /// Row `i` of M r, added to `u`; the largest squared norm of the products that make it up.
    fn add_row_sized(&self, i: usize, r: &[[f64; D]], u: &mut [f64; D]) -> f64 {
        let mut largest = 0.0_f64;
        for k in self.row_ptr[i]..self.row_ptr[i + 1] {
            let mut product = [0.0; D];
            add_product(&self.blocks[k], &r[self.col[k]], &mut product);
            largest = largest.max(squared(&product));
            for a in 0..D {
                u[a] += product[a];
            }
        }
        largest
    }

    /// Adds row `i` of M r to `u`.
    #[inline]
    pub(super) fn add_row(&self, i: usize, r: &[[f64; D]], u: &mut [f64; D]) {
        for k in self.row_ptr[i]..self.row_ptr[i + 1] {
            add_product(&self.blocks[k], &r[self.col[k]], u);
        }
    }
}

fn squared<const D: usize>(z: &[f64; D]) -> f64 {
    z.iter().map(|v| v * v).sum()
}

/// How well the law holds, in scaled variables.
#[derive(Debug, Clone, Copy)]
pub(super) struct Law {
    /// max ‖r − P_K(r − û)‖ / size over the contacts, the size of a contact being that of the terms that cancel there.
    pub(super) residual: f64,
    /// The same in the norm of all contacts: what tells far from a solution whether an iteration gains.
    pub(super) overall: f64,
    /// In the norm of all contacts, against ‖q‖ and ‖u‖ alone, with what the rounding of the terms may hide: reactions that are large enough
    /// swallow u.
    pub(super) violation: f64,
}

/// A contact whose terms are a smaller share of the largest ones carries nothing that rounding there would leave.
const NEGLIGIBLE: f64 = 1e-12;

/// u += b r.
#[inline]
pub(super) fn add_product<const D: usize>(b: &Block<D>, r: &[f64; D], u: &mut [f64; D]) {
    for a in 0..D {
        for c in 0..D {
            u[a] += b[a][c] * r[c];
        }
    }
}

impl<const D: usize> Scaled<D> {
    pub(super) fn new(problem: &DelassusProblem) -> Self {
        let nc = problem.contacts();
        let m = problem.matrix();
        let means: Vec<f64> = (0..nc)
            .map(|i| (0..D).map(|k| m.get(i * D + k, i * D + k)).sum::<f64>() / D as f64)
            .collect();
        let largest = means.iter().fold(0.0_f64, |a, b| a.max(*b));
        // Contacts that cannot move have no scale of their own; where none can, M may be skew.
        let sizes = [largest, max_abs(m.values())];
        let ordinary = sizes.into_iter().find(|d| *d > 0.0).unwrap_or(1.0);
        let scale: Vec<f64> = means
            .into_iter()
            .map(|d| if d > 1e-13 * largest { d } else { ordinary }.sqrt().recip())
            .collect();
        let q = problem.q();
        let sigma = (0..nc * D).fold(0.0_f64, |a, i| a.max((scale[i / D] * q[i]).abs()));
        let sigma = if sigma > 0.0 { sigma } else { 1.0 };
        Self {
            friction: problem.friction().to_vec(),
            q: (0..nc)
                .map(|i| std::array::from_fn(|k| scale[i] * q[i * D + k] / sigma))
                .collect(),
            matrix: BlockMatrix::new(problem, &scale),
            scale,
            sigma,
            evaluations: Cell::new(0),
        }
    }

    pub(super) fn evaluations(&self) -> usize {
        self.evaluations.get()
    }

    pub(super) fn count_evaluation(&self) {
        self.evaluations.set(self.evaluations.get() + 1);
    }

    pub(super) fn contacts(&self) -> usize {
        self.friction.len()
    }

    /// u = M r + q.
    pub(super) fn velocities(&self, r: &[[f64; D]], u: &mut [[f64; D]]) {
        self.count_evaluation();
        for i in 0..r.len() {
            u[i] = self.q[i];
            self.matrix.add_row(i, r, &mut u[i]);
        }
    }

    /// u = M r + q, and how well the law holds. `contacts` gets the size of the terms of each contact and its squared residual.
    pub(super) fn law(&self, r: &[[f64; D]], u: &mut [[f64; D]], contacts: &mut [[f64; 2]]) -> Law {
        self.count_evaluation();
        let (mut errors, mut terms, mut largest, mut data) = (0.0, 0.0, 0.0_f64, [0.0_f64; 2]);
        for i in 0..r.len() {
            u[i] = self.q[i];
            let product = self.matrix.add_row_sized(i, r, &mut u[i]);
            let parts = [squared(&r[i]), squared(&u[i]), squared(&self.q[i])];
            let size = parts.iter().fold(product, |m, v| m.max(*v)).sqrt();
            let error = natural_residual(self.friction[i], 1.0, &r[i], &u[i]);
            contacts[i] = [size, error];
            largest = largest.max(size);
            errors += error;
            terms += size * size;
            data = [data[0] + parts[1], data[1] + parts[2]];
        }
        // Against terms that overflow nothing is small.
        let share = |error: f64, size: f64| match error {
            _ if !size.is_finite() => f64::INFINITY,
            0.0 => 0.0,
            _ => error.sqrt() / size,
        };
        let data = data[0].max(data[1]);
        let hidden = if data > 0.0 {
            f64::EPSILON.powi(2) * terms
        } else {
            0.0
        };
        let least = NEGLIGIBLE * largest;
        let blocks = contacts
            .iter()
            .map(|[size, error]| share(*error, size.max(least)));
        Law {
            residual: blocks.fold(
                0.0,
                |m, e| if e.is_nan() { f64::INFINITY } else { f64::max(m, e) },
            ),
            overall: share(errors, f64::sqrt(terms)),
            violation: share(errors + hidden, f64::sqrt(data).max(f64::MIN_POSITIVE)),
        }
    }

    /// The reactions in the units of the problem; without friction exactly normal.
    pub(super) fn unscale(&self, r: &[[f64; D]], out: &mut [f64]) {
        for (i, r) in r.iter().enumerate() {
            for k in 0..D {
                let carries = k == 0 || self.friction[i] > 0.0;
                out[i * D + k] = if carries {
                    self.sigma * self.scale[i] * r[k]
                } else {
                    0.0
                };
            }
        }
    }

    /// Reactions given in the units of the problem.
    pub(super) fn scale(&self, r: &[f64]) -> Vector<D> {
        let mut out = vec![[0.0; D]; self.contacts()];
        self.scale_into(r, &mut out);
        out
    }

    pub(super) fn scale_into(&self, r: &[f64], out: &mut [[f64; D]]) {
        for (i, out) in out.iter_mut().enumerate() {
            *out = std::array::from_fn(|k| r[i * D + k] / (self.sigma * self.scale[i]));
        }
    }
}
