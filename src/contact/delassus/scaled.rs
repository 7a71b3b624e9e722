use std::cell::Cell;

use super::DelassusProblem;
use super::cone::natural_residual;
use crate::judge::laws::coulomb;
use crate::judge::power_below;
use crate::sparse::max_abs;
use crate::tolerances::RESULT;

/// A vector of blocks, one a contact.
pub(super) type Vector<const D: usize> = Vec<[f64; D]>;
pub(super) type Block<const D: usize> = [[f64; D]; D];

/// A problem in scaled variables and block storage: the mean diagonal entry of each contact is 1 and ‖q‖∞ is 1.
///
/// With S = diag(s_i) one positive factor a contact, ω a power of two, and σ = ‖ω S q‖∞ the scaled problem is ω S M S, ω S q / σ, with
/// r = σ S r̃ and u = (σ/ω) S⁻¹ ũ: cones and the law are invariant under this scaling. Problems whose units differ by powers of two become
/// the same one to the last bit: roots are taken of numbers near 1 that do not depend on units.
#[derive(Debug, Clone)]
pub(super) struct ScaledProblem<const D: usize> {
    pub(super) friction: Vec<f64>,
    pub(super) q: Vector<D>,
    pub(super) matrix: BlockMatrix<D>,
    scale: Vec<f64>,
    sigma: f64,
    /// Number of evaluations of the velocities of all contacts.
    evaluations: Cell<usize>,
}

/// D × D blocks by columns.
#[derive(Debug, Clone)]
pub(super) struct BlockMatrix<const D: usize> {
    pub(super) col_ptr: Vec<usize>,
    /// Block row of each block, increasing in a column.
    pub(super) row: Vec<usize>,
    pub(super) blocks: Vec<Block<D>>,
    /// Index of the diagonal block of each column.
    diagonal: Vec<usize>,
}

impl<const D: usize> BlockMatrix<D> {
    /// The blocks of M that do not vanish, and every diagonal block.
    fn new(problem: &DelassusProblem) -> Self {
        let nc = problem.contacts();
        let pattern = problem.matrix().pattern();
        let (ptr, rows) = (pattern.col_ptr(), pattern.row_idx());
        let values = problem.matrix().values();
        let mut col_ptr = Vec::with_capacity(nc + 1);
        let mut row = Vec::with_capacity(nc + values.len() / (D * D));
        let mut blocks = Vec::with_capacity(row.capacity());
        let mut diagonal = Vec::with_capacity(nc);
        for j in 0..nc {
            col_ptr.push(row.len());
            let end: [usize; D] = std::array::from_fn(|c| ptr[j * D + c + 1]);
            let mut at: [usize; D] = std::array::from_fn(|c| ptr[j * D + c]);
            loop {
                let next = (0..D).map(|c| if at[c] < end[c] { rows[at[c]] } else { usize::MAX });
                let next = next.fold(usize::MAX, usize::min) / D;
                let is_due = diagonal.len() == j;
                let i = if is_due { next.min(j) } else { next };
                if i == usize::MAX / D {
                    break;
                }
                let place = blocks.len();
                blocks.push([[0.0; D]; D]);
                let block: &mut Block<D> = &mut blocks[place];
                let mut vanishes = true;
                for c in 0..D {
                    while at[c] < end[c] && rows[at[c]] < (i + 1) * D {
                        let value = values[at[c]];
                        block[rows[at[c]] - i * D][c] = value;
                        vanishes &= value == 0.0;
                        at[c] += 1;
                    }
                }
                if i == j {
                    diagonal.push(place);
                } else if vanishes {
                    blocks.pop();
                    continue;
                }
                row.push(i);
            }
        }
        col_ptr.push(row.len());
        Self {
            col_ptr,
            row,
            blocks,
            diagonal,
        }
    }

    pub(super) fn diagonal(&self, i: usize) -> &Block<D> {
        &self.blocks[self.diagonal[i]]
    }

    /// Block rows and blocks of column `j`.
    #[inline]
    pub(super) fn column(&self, j: usize) -> impl Iterator<Item = (usize, &Block<D>)> {
        let range = self.col_ptr[j]..self.col_ptr[j + 1];
        self.row[range.clone()].iter().copied().zip(&self.blocks[range])
    }

    /// ω S M S.
    fn scale(&mut self, s: &[f64], unit: f64) {
        for j in 0..s.len() {
            for k in self.col_ptr[j]..self.col_ptr[j + 1] {
                let factor = unit * s[self.row[k]] * s[j];
                let entries = self.blocks[k].iter_mut().flatten();
                entries.for_each(|v| *v *= factor);
            }
        }
    }

    /// Whether block (j, i) is stored with block (i, j).
    pub(super) fn is_structurally_symmetric(&self) -> bool {
        let is_stored = |i: usize, j: usize| {
            let rows = &self.row[self.col_ptr[j]..self.col_ptr[j + 1]];
            rows.binary_search(&i).is_ok()
        };
        (0..self.diagonal.len()).all(|j| self.column(j).all(|(i, _)| is_stored(j, i)))
    }

    /// Adds column `j` times `r` to `u`.
    #[inline]
    pub(super) fn add_column(&self, j: usize, r: &[f64; D], u: &mut [[f64; D]]) {
        if *r != [0.0; D] {
            for (i, block) in self.column(j) {
                add_product(block, r, &mut u[i]);
            }
        }
    }

    /// Adds M r to `u`.
    pub(super) fn add(&self, r: &[[f64; D]], u: &mut [[f64; D]]) {
        for (j, r) in r.iter().enumerate() {
            self.add_column(j, r, u);
        }
    }
}

fn squared<const D: usize>(z: &[f64; D]) -> f64 {
    z.iter().map(|v| v * v).sum()
}

/// Residuals of the law, in scaled variables.
#[derive(Debug, Clone, Copy)]
pub(super) struct Law {
    /// max ‖r − P_K(r − û)‖ / size over the contacts, the size of a contact being that of the terms that cancel there.
    pub(super) residual: f64,
    /// The same in the Euclidean norm over all contacts: far from a solution it measures progress better than the maximum.
    pub(super) overall: f64,
    /// In the Euclidean norm over all contacts, relative to ‖q‖ and ‖u‖ alone, plus the rounding error of the terms: with very large
    /// reactions u is lost in rounding.
    pub(super) violation: f64,
}

/// The larger one of m and the largest modulus of z.
pub(super) fn larger<const D: usize>(m: f64, z: &[f64; D]) -> f64 {
    // `f64::max` takes several times as long for the sake of NaN, which is not larger here either.
    z.iter().fold(m, |m, v| if v.abs() > m { v.abs() } else { m })
}

/// u += b r.
#[inline]
pub(super) fn add_product<const D: usize>(b: &Block<D>, r: &[f64; D], u: &mut [f64; D]) {
    for a in 0..D {
        for c in 0..D {
            u[a] += b[a][c] * r[c];
        }
    }
}

impl<const D: usize> ScaledProblem<D> {
    pub(super) fn new(problem: &DelassusProblem) -> Self {
        let nc = problem.contacts();
        let mut matrix = BlockMatrix::<D>::new(problem);
        let trace = |b: &Block<D>| (0..D).map(|k| b[k][k]).sum::<f64>();
        let means: Vec<f64> = (0..nc).map(|i| trace(matrix.diagonal(i)) / D as f64).collect();
        let largest = means.iter().fold(0.0_f64, |a, b| a.max(*b));
        // Contacts that cannot move have no scale of their own; where none can, M may be skew.
        let ordinary = if largest > 0.0 {
            largest
        } else {
            Some(max_abs(problem.matrix().values()))
                .filter(|d| *d > 0.0)
                .unwrap_or(1.0)
        };
        let means: Vec<f64> = { means.into_iter() }
            .map(|d| if d > 0.0 { d } else { ordinary })
            .collect();
        // Whether exponents are even depends on the units of M, differences do not. The first one counts as odd.
        let first = means.first().map_or(0.0, |d| power_below(*d).log2()) - 1.0;
        let scale: Vec<f64> = { means.iter() }
            .map(|d| {
                let half = ((power_below(*d).log2() - first) / 2.0).floor();
                let rest = d * (-first - 2.0 * half).exp2();
                rest.sqrt().recip() * (-half).exp2()
            })
            .collect();
        let unit = (-first).exp2();
        matrix.scale(&scale, unit);
        let (q, _) = problem.q().as_chunks::<D>();
        let sigma = (q.iter().zip(&scale)).fold(0.0, |m, (q, s)| larger(m, &q.map(|v| unit * s * v)));
        let sigma = if sigma > 0.0 { sigma } else { 1.0 };
        Self {
            friction: problem.friction().to_vec(),
            q: q.iter()
                .zip(&scale)
                .map(|(q, s)| q.map(|v| unit * s * v / sigma))
                .collect(),
            matrix,
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
        u.copy_from_slice(&self.q);
        self.matrix.add(r, u);
    }

    /// u = M r + q, and the residuals of the law. `contacts` receives the squared size of the terms of each contact and its squared
    /// residual.
    pub(super) fn law(&self, r: &[[f64; D]], u: &mut [[f64; D]], contacts: &mut [[f64; 2]]) -> Law {
        self.count_evaluation();
        for ((r, u), (q, contact)) in r.iter().zip(&mut *u).zip(self.q.iter().zip(&mut *contacts)) {
            *u = *q;
            contact[0] = larger(squared(r), &[squared(q)]);
        }
        for (j, r) in r.iter().enumerate().filter(|(_, r)| **r != [0.0; D]) {
            for (i, block) in self.matrix.column(j) {
                let mut product = [0.0; D];
                add_product(block, r, &mut product);
                contacts[i][0] = larger(contacts[i][0], &[squared(&product)]);
                for k in 0..D {
                    u[i][k] += product[k];
                }
            }
        }
        let (mut errors, mut terms, mut largest, mut data) = (0.0, 0.0, 0.0_f64, [0.0_f64; 2]);
        for i in 0..r.len() {
            let velocity = squared(&u[i]);
            let size = larger(contacts[i][0], &[velocity]);
            let error = natural_residual(self.friction[i], 1.0, &r[i], &u[i]);
            contacts[i] = [size, error];
            largest = larger(largest, &[size]);
            errors += error;
            terms += size;
            data = [data[0] + velocity, data[1] + squared(&self.q[i])];
        }
        // A quotient of squares; infinite where the terms overflow.
        let share = |error: f64, size: f64| match size.is_finite() {
            true if error == 0.0 => 0.0,
            true if !error.is_nan() => error / size,
            _ => f64::INFINITY,
        };
        let data = data[0].max(data[1]);
        let hidden = if data > 0.0 {
            f64::EPSILON.powi(2) * terms
        } else {
            0.0
        };
        let least = RESULT * RESULT * largest;
        let blocks = contacts
            .iter()
            .map(|[size, error]| share(*error, size.max(least)));
        Law {
            residual: blocks.fold(0.0, f64::max).sqrt(),
            overall: share(errors, terms).sqrt(),
            violation: share(errors + hidden, data.max(f64::MIN_POSITIVE)).sqrt(),
        }
    }

    /// The largest violation of the law at any contact, each part of it relative to its own terms, given u = M r + q and the squared sizes
    /// from [`law`](Self::law).
    pub(super) fn violation(&self, r: &[[f64; D]], u: &[[f64; D]], contacts: &[[f64; 2]]) -> f64 {
        let mut terms: Vector<D> = self.q.iter().map(|q| q.map(f64::abs)).collect();
        for (j, r) in r.iter().enumerate().filter(|(_, r)| **r != [0.0; D]) {
            for (i, block) in self.matrix.column(j) {
                for (term, row) in terms[i].iter_mut().zip(block) {
                    *term += row.iter().zip(r).map(|(b, r)| (b * r).abs()).sum::<f64>();
                }
            }
        }
        let largest = contacts.iter().fold(0.0_f64, |m, c| m.max(c[0])).sqrt();
        (0..r.len()).fold(0.0, |worst: f64, i| {
            let size = contacts[i][0].sqrt().max(RESULT * largest);
            worst.max(coulomb(self.friction[i], &r[i], &u[i], &terms[i], size))
        })
    }

    /// The reactions in the units of the problem; tangential ones are exactly 0 at contacts without friction.
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
            let inverse = (self.sigma * self.scale[i]).recip();
            *out = std::array::from_fn(|k| inverse * r[i * D + k]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::Matrix;
    use crate::spread::Random;

    /// Blocks that are not stored, zeros that are, and diagonals that vanish: u and M are those of the problem, S⁻¹ (σ ũ) = M r + q.
    #[test]
    fn blocks_are_those_of_the_problem() {
        let mut random = Random::new(8);
        for case in 0..50 {
            let nc = 1 + case % 9;
            let n = 3 * nc;
            let is_stored = |i: usize, j: usize| {
                !(i / 3 + 2 * (j / 3) + case).is_multiple_of(4) && !(i * j + case).is_multiple_of(5)
            };
            let all = (0..n).flat_map(|j| (0..n).map(move |i| (i, j)));
            let stored = all.filter(|(i, j)| is_stored(*i, *j));
            let m: Vec<_> = stored
                .map(|(i, j)| {
                    let vanishes = (i / 3 + j / 3) % 3 == 2 && i / 3 != j / 3;
                    let value = random.symmetric() + if i == j { 2.0 } else { 0.0 };
                    (i, j, if vanishes { 0.0 } else { 10.0 * value })
                })
                .collect();
            let q = (0..n).map(|_| random.symmetric()).collect();
            let m = Matrix::from_triplets(n, n, &m).unwrap();
            let problem = DelassusProblem::new(3, m, q, vec![0.5; nc]).unwrap();
            let p = ScaledProblem::<3>::new(&problem);
            let unit = p.q[0][0] * p.sigma / p.scale[0] / problem.q()[0];
            let blocks: Vec<(usize, usize)> = (0..nc)
                .flat_map(|j| p.matrix.column(j).map(move |(i, _)| (i, j)))
                .collect();
            for i in 0..nc {
                for j in 0..nc {
                    let entries = (0..9).map(|k| problem.matrix().get(3 * i + k / 3, 3 * j + k % 3));
                    let is_block = i == j || entries.into_iter().any(|v| v != 0.0);
                    let found = blocks.iter().filter(|b| **b == (i, j)).count();
                    assert_eq!(found, usize::from(is_block), "case {case}, block {i}, {j}");
                }
            }
            let mirrored = blocks.iter().all(|(i, j)| blocks.contains(&(*j, *i)));
            assert_eq!(p.matrix.is_structurally_symmetric(), mirrored);
            let r: Vec<f64> = (0..n)
                .map(|i| if i % 4 == 0 { 0.0 } else { random.symmetric() })
                .collect();
            let mut u = vec![[0.0; 3]; nc];
            p.velocities(&p.scale(&r), &mut u);
            let expected = problem.velocities(&r).unwrap();
            for (i, expected) in expected.iter().enumerate() {
                let found = u[i / 3][i % 3] * p.sigma / p.scale[i / 3] / unit;
                assert!(
                    (found - expected).abs() < 1e-13 * 100.0,
                    "case {case}: {found} {expected}"
                );
            }
            let mut back = vec![0.0; n];
            p.unscale(&p.scale(&r), &mut back);
            assert!(
                r.iter()
                    .zip(&back)
                    .all(|(a, b)| (a - b).abs() <= 4.0 * f64::EPSILON * a.abs())
            );
        }
    }
}
