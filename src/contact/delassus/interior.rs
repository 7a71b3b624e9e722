//! An interior-point method for the law with De Saxcé's term: globally, into the neighbourhood of a solution.

use super::cone::tangential_norm;
use super::scaled::ScaledProblem;
use super::tolerances::{FREEZE, INTERIOR_START, LARGE, SHORT};
use crate::cones::{self, Cone, Image};

/// In x = (μ r_N, r_T) and y = (û_N / μ, û_T) both cones are the second-order cone L, and the problem reads y = M̃ x + q̃ + ‖u_T‖ e_N,
/// x ∘ y = 0. The Newton matrix G M̃ + W², G the derivative of De Saxcé's term, is regular whatever the rank of M, so that the iteration
/// applies to hyperstatic problems. Frictionless contacts are half-lines, their tangential reactions free variables with y = x.
///
/// Compare V. Acary, P. Armand, H. Minh Nguyen, M. Shpakovych, *Second order cone programming for frictional contact mechanics
/// using interior point algorithm* (2023).
#[derive(Debug)]
pub(super) struct Interior<const D: usize> {
    engine: cones::Interior,
    /// Steps left with De Saxcé's term frozen.
    frozen: usize,
    may_freeze: bool,
    /// u_T / ‖u_T‖ (first component unused).
    direction: Vec<[f64; D]>,
    reactions: Vec<[f64; D]>,
}

/// y of x.
struct Law<'a, const D: usize> {
    p: &'a ScaledProblem<D>,
    is_frozen: bool,
    direction: &'a mut [[f64; D]],
    reactions: &'a mut [[f64; D]],
}

/// 1/μ, 1 for a half-line.
fn inverse(mu: f64) -> f64 {
    if mu > 0.0 { mu.recip() } else { 1.0 }
}

fn reactions_of<const D: usize>(p: &ScaledProblem<D>, x: &[f64], r: &mut [[f64; D]]) {
    for (i, r) in r.iter_mut().enumerate() {
        r.copy_from_slice(&x[i * D..(i + 1) * D]);
        r[0] *= inverse(p.friction[i]);
    }
}

impl<const D: usize> Image for Law<'_, D> {
    fn image(&mut self, x: &[f64], y: &mut [f64]) {
        reactions_of(self.p, x, self.reactions);
        let (velocities, _) = y.as_chunks_mut::<D>();
        self.p.velocities(self.reactions, velocities);
        for (i, &mu) in self.p.friction.iter().enumerate() {
            let mut u = velocities[i];
            let t = tangential_norm(&u);
            self.direction[i] = if t > 0.0 { u.map(|v| v / t) } else { [0.0; D] };
            if mu > 0.0 {
                u[0] = u[0] / mu + t;
            } else {
                u[1..].copy_from_slice(&x[i * D + 1..(i + 1) * D]);
            }
            velocities[i] = u;
        }
    }

    fn derivative(&self, values: &mut [f64]) {
        self.write(values, false);
    }

    fn near(&self, values: &mut [f64]) {
        self.write(values, true);
    }

    fn unit(&self, variable: usize) -> f64 {
        match variable % D {
            0 => inverse(self.p.friction[variable / D]).powi(2),
            _ => 1.0,
        }
    }
}

impl<const D: usize> Law<'_, D> {
    /// G M̃, or, symmetric, M̃ without the columns that frictionless contacts do not have.
    fn write(&self, values: &mut [f64], symmetric: bool) {
        let m = &self.p.matrix;
        let slope = f64::from(!self.is_frozen && !symmetric);
        let mut at = 0;
        for j in 0..self.p.contacts() {
            let column = inverse(self.p.friction[j]);
            for c in 0..D {
                let s = match c {
                    0 => column,
                    _ if symmetric && self.p.friction[j] == 0.0 => 0.0,
                    _ => 1.0,
                };
                for (i, block) in m.column(j) {
                    let mu = self.p.friction[i];
                    let entry = &mut values[at..at + D];
                    entry.fill(0.0);
                    if mu > 0.0 {
                        let term: f64 = (1..D).map(|a| self.direction[i][a] * block[a][c]).sum();
                        entry[0] = s * (block[0][c] / mu + slope * term);
                        for a in 1..D {
                            entry[a] = s * block[a][c];
                        }
                    } else {
                        entry[0] = s * block[0][c];
                        if i == j && c > 0 {
                            entry[c] = 1.0;
                        }
                    }
                    at += D;
                }
            }
        }
    }
}

impl<const D: usize> Interior<D> {
    pub(super) fn new(p: &ScaledProblem<D>) -> Self {
        let nc = p.contacts();
        let m = &p.matrix;
        let mut col_ptr = vec![0];
        let mut row_idx = Vec::with_capacity(m.blocks.len() * D * D);
        for j in 0..nc {
            for _ in 0..D {
                for &i in &m.row[m.col_ptr[j]..m.col_ptr[j + 1]] {
                    row_idx.extend((0..D).map(|a| i * D + a));
                }
                col_ptr.push(row_idx.len());
            }
        }
        let n = nc * D;
        let symmetric = Self::is_large(p) && row_idx.len() < n * n / 4 && m.is_structurally_symmetric();
        let parts = p.friction.iter().flat_map(|&mu| match mu > 0.0 {
            true => [Cone::SecondOrder(D), Cone::Free(0)],
            false => [Cone::SecondOrder(1), Cone::Free(D - 1)],
        });
        Self {
            engine: cones::Interior::new(parts, col_ptr, row_idx, symmetric),
            frozen: 0,
            may_freeze: false,
            direction: vec![[0.0; D]; nc],
            reactions: vec![[0.0; D]; nc],
        }
    }

    /// The pattern of the Newton matrix, whose columns are made of whole blocks: column pointers and row indices.
    pub(super) fn into_pattern(self) -> (Vec<usize>, Vec<usize>) {
        self.engine.into_pattern()
    }

    /// Whether the order is so large that a factorisation that may not help is too expensive.
    pub(super) fn is_large(p: &ScaledProblem<D>) -> bool {
        p.contacts() * D >= LARGE
    }

    fn parts<'a>(&'a mut self, p: &'a ScaledProblem<D>) -> (&'a mut cones::Interior, Law<'a, D>) {
        let law = Law {
            p,
            is_frozen: self.frozen > 0,
            direction: &mut self.direction,
            reactions: &mut self.reactions,
        };
        (&mut self.engine, law)
    }

    /// Moves x and y well into the interior of the cones, near the reactions `r`.
    pub(super) fn start(&mut self, p: &ScaledProblem<D>, r: &[[f64; D]], may_freeze: bool) {
        self.may_freeze = may_freeze;
        self.frozen = 0;
        let mut x = r.to_vec();
        for (x, &mu) in x.iter_mut().zip(&p.friction) {
            if mu > 0.0 {
                x[0] *= mu;
            } else {
                x[1..].fill(0.0);
            }
        }
        let (engine, mut law) = self.parts(p);
        engine.start(&mut law, x.as_flattened(), INTERIOR_START);
    }

    /// The reactions of x.
    pub(super) fn reactions(&self, p: &ScaledProblem<D>, r: &mut [[f64; D]]) {
        reactions_of(p, self.engine.x(), r);
    }

    /// Complementarity, mean of x·y over the contacts.
    pub(super) fn gap(&self) -> f64 {
        self.engine.gap()
    }

    /// One step with one factorisation; the length of the step, or `None` if the matrix was singular.
    pub(super) fn step(&mut self, p: &ScaledProblem<D>) -> Option<f64> {
        let (engine, mut law) = self.parts(p);
        let length = engine.step(&mut law)?;
        if self.frozen > 0 {
            self.frozen -= 1;
        } else if self.may_freeze && length < SHORT {
            self.frozen = FREEZE;
        }
        Some(length)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::delassus::DelassusProblem;
    use crate::sparse::Matrix;

    /// Three contacts and one without friction, against differences of y; while De Saxcé's term is frozen, of y without it.
    #[test]
    fn newton_matrices_are_derivatives() {
        let n = 12;
        let entry = |i: usize, j: usize| {
            if i == j {
                3.0
            } else {
                0.1 * ((i * j % 5) as f64 - 2.0)
            }
        };
        let all = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        let m: Vec<_> = all.map(|(i, j)| (i, j, entry(i.min(j), i.max(j)))).collect();
        let m = Matrix::from_triplets(n, n, &m).unwrap();
        let q = (0..n).map(|i| (1.7 * i as f64).cos()).collect();
        let problem = DelassusProblem::new(3, m, q, vec![0.3, 0.8, 0.5, 0.0]).unwrap();
        let p = ScaledProblem::<3>::new(&problem);
        let x: Vec<f64> = (0..n).map(|i| (2.3 * i as f64).sin()).collect();
        let (col_ptr, row_idx) = Interior::new(&p).into_pattern();
        for is_frozen in [false, true] {
            let mut law = Law {
                p: &p,
                is_frozen,
                direction: &mut [[0.0; 3]; 4],
                reactions: &mut [[0.0; 3]; 4],
            };
            let mut values = vec![f64::NAN; row_idx.len()];
            law.image(&x, &mut [0.0; 12]);
            law.derivative(&mut values);
            let mut image = |j: usize, h: f64| {
                let (mut x, mut y) = (x.clone(), [0.0; 12]);
                x[j] += h;
                law.image(&x, &mut y);
                for i in (0..9).step_by(3).filter(|_| is_frozen) {
                    y[i] -= y[i + 1].hypot(y[i + 2]);
                }
                y
            };
            for j in 0..n {
                let h = 1e-6;
                let (above, below) = (image(j, h), image(j, -h));
                let mut column = [0.0; 12];
                for k in col_ptr[j]..col_ptr[j + 1] {
                    column[row_idx[k]] += values[k];
                }
                for i in 0..n {
                    let slope = (above[i] - below[i]) / (2.0 * h);
                    assert!((column[i] - slope).abs() < 1e-7, "{i} {j}: {} {slope}", column[i]);
                }
            }
        }
    }
}
