//! Solves with the linearised system at a solution and with its transpose, and how far the solution is from a kink.

use super::{ALLOWANCE, Local, ReducedSensitivity, TOLERANCE};
use crate::contact::NodeLaw;
use crate::contact::displacements::system::ReducedSystem;
use crate::contact::law::{LocalRow, LocalValues, MAX_TESTS};
use crate::linear::{KrylovReport, LinearError};
use crate::sensitivity::SensitivityError;
use crate::sparse::max_abs;
use crate::spread::Random;
use crate::tolerances::{MOVED, ROUNDING};

impl ReducedSensitivity<'_> {
    /// Passes the rows that the laws change to the system, as a Newton step does.
    pub(super) fn select(&mut self, tangents: usize) -> Result<(), LinearError> {
        self.changed.clear();
        for (local, &at) in self.nodes.iter().zip(self.components) {
            self.changed.add(&local.node, at, tangents);
        }
        self.system.select(&self.changed.step())
    }

    /// The rates of the displacements and of f − A u, of which those of the contact nodes are forces, from rates e of A u + Bᵀ λ − f and h
    /// of the laws.
    pub(super) fn forward(&mut self, e: &[f64], h: &[[f64; 3]]) -> Result<(Vec<f64>, Vec<f64>), LinearError> {
        let dim = self.system.body().dim();
        let (mut u, mut rest) = (vec![0.0; e.len()], vec![0.0; e.len()]);
        let responses: Vec<[[f64; 3]; 2]> = (self.nodes.iter().zip(h)).map(|(n, h)| n.response(*h)).collect();
        for ([held, _], &at) in responses.iter().zip(self.components) {
            u[at..at + dim].copy_from_slice(&held[..dim]);
        }
        self.system.mul(&u, &mut rest)?;
        rest.iter_mut().zip(e).for_each(|(r, e)| *r = -*r - e);
        for ((local, [_, constant]), &at) in self.nodes.iter().zip(&responses).zip(self.components) {
            let pressure = rest[at];
            for d in 0..dim {
                rest[at + d] = match local.is_held(d) {
                    true => 0.0,
                    false => rest[at + d] - constant[d] - local.node.coupling[d] * pressure,
                };
            }
        }
        let mut step = vec![0.0; u.len()];
        if max_abs(&rest) > 0.0 {
            let outcome = self.system.solve(&rest, &mut step, TOLERANCE)?;
            self.accept(outcome)?;
        }
        u.iter_mut().zip(&step).for_each(|(u, s)| *u += s);
        self.system.mul(&u, &mut rest)?;
        rest.iter_mut().zip(e).for_each(|(r, e)| *r = -*r - e);
        Ok((u, rest))
    }

    /// The gradients in −e and h of a function whose gradients in u and in the nodes' forces are given.
    ///
    /// With R, which adds κ times the row of the normal to that of a free tangent, and S, the stiffness that the laws add, rates obey
    /// R (A u + e) + S u + c = 0 in the free components and λ = −(A u + e) in the others, where u is prescribed. Y = Rᵀ y + ω, y being the
    /// multiplier of the former and ω the gradient in the latter, is what multiplies A u + e.
    pub(super) fn transposed(
        &mut self,
        of_u: Vec<f64>,
        of_force: impl Fn(usize, usize) -> f64,
    ) -> Result<(Vec<f64>, Vec<[f64; 3]>), LinearError> {
        let dim = self.system.body().dim();
        let (mut omega, mut rhs) = (vec![0.0; of_u.len()], vec![0.0; of_u.len()]);
        for (i, (local, &at)) in self.nodes.iter().zip(self.components).enumerate() {
            for d in 0..dim {
                match local.is_held(d) {
                    true => omega[at + d] += of_force(i, d),
                    false => omega[at] += local.node.coupling[d] * of_force(i, d),
                }
            }
        }
        self.system.mul(&omega, &mut rhs)?;
        rhs.iter_mut().zip(&of_u).for_each(|(r, w)| *r = w - *r);
        for (i, (local, &at)) in self.nodes.iter().zip(self.components).enumerate() {
            for d in 0..dim {
                if local.is_held(d) {
                    rhs[at + d] = 0.0;
                    continue;
                }
                let free = (0..dim).filter(|&e| !local.is_held(e));
                rhs[at + d] += free
                    .map(|e| local.node.stiffness[e][d] * of_force(i, e))
                    .sum::<f64>();
            }
        }
        let mut y = vec![0.0; rhs.len()];
        if max_abs(&rhs) > 0.0 {
            let outcome = self.system.solve_transposed(&rhs, &mut y, TOLERANCE)?;
            self.accept(outcome)?;
        }
        let mut all = y.clone();
        all.iter_mut().zip(&omega).for_each(|(y, w)| *y += w);
        for &(i, j, c) in self.changed.step().combined {
            all[j] += c * y[i];
        }
        let mut image = vec![0.0; y.len()];
        self.system.mul(&all, &mut image)?;
        let of_h = self.nodes.iter().zip(self.components).enumerate();
        let of_h = of_h.map(|(i, (local, &at))| {
            std::array::from_fn(|k| {
                let [held, constant] = &local.unit[k];
                let part = |d: usize| match local.is_held(d) {
                    true => held[d] * (of_u[at + d] - image[at + d]),
                    false => constant[d] * (of_force(i, d) - y[at + d]),
                };
                (0..dim).map(part).sum()
            })
        });
        let of_h = of_h.collect();
        Ok((all, of_h))
    }

    /// With a random right-hand side, which a singular system cannot have: with one that it can have it is solved, too. Without slip,
    /// which couples tangents to pressures, the system is definite.
    pub(super) fn check_regular(&mut self) -> Result<(), LinearError> {
        let is_coupled = |local: &Local| local.node.coupling.iter().any(|c| *c != 0.0);
        if !self.is_regular && self.nodes.iter().any(is_coupled) {
            let mut spread = Random::new(1);
            let e: Vec<f64> = (0..self.system.body().len())
                .map(|_| spread.symmetric())
                .collect();
            self.forward(&e, &vec![[0.0; 3]; self.nodes.len()])?;
        }
        self.is_regular = true;
        Ok(())
    }

    fn accept(&mut self, outcome: KrylovReport) -> Result<(), LinearError> {
        self.iterations = outcome.iterations;
        match outcome.residual <= 10.0 * TOLERANCE {
            true => Ok(()),
            false => Err(LinearError::Inaccurate {
                residual: outcome.residual,
            }),
        }
    }

    /// How far test functions are from zero, in multiples of what one more Newton step would change them by, and which nodes are at
    /// kinks. Gives the possible errors of all test functions.
    pub(super) fn find_margin(
        &mut self,
        law: &dyn NodeLaw,
        values: &[LocalValues],
        sizes: &[f64],
        (at_solution, residual): (&[f64], &[f64]),
    ) -> Result<Vec<[f64; MAX_TESTS]>, SensitivityError> {
        let h: Vec<[f64; 3]> = (values.iter().zip(&self.nodes))
            .map(|(v, local)| law.residual(local.node.piece, v))
            .collect();
        let (u, rest) = self.forward(residual, &h)?;
        let distance = max_abs(&u);
        let lengths = values
            .iter()
            .map(|v| v.penetration.abs().max(v.slip[0].abs()).max(v.slip[1].abs()));
        let longest = lengths.fold(max_abs(at_solution), f64::max);
        let is_near = distance <= MOVED * longest;
        if !is_near {
            let variable = (0..u.len()).find(|&k| u[k].abs() == distance).unwrap_or(0);
            let residual = h
                .as_flattened()
                .iter()
                .chain(residual)
                .fold(0.0_f64, |m, r| m.max(r.abs()));
            return Err(SensitivityError::NoSolution {
                variable,
                distance,
                residual,
            });
        }
        let largest = sizes.iter().fold(0.0_f64, |m, s| m.max(*s));
        let mut errors: Vec<[f64; MAX_TESTS]> = Vec::with_capacity(values.len());
        for (i, (v, &at)) in values.iter().zip(self.components).enumerate() {
            let mut moved = LocalRow {
                penetration: u[at],
                pressure: rest[at],
                ..LocalRow::default()
            };
            for d in 0..law.num_tangents() {
                (moved.slip[d], moved.traction[d]) = (u[at + 1 + d], rest[at + 1 + d]);
            }
            let (mut tests, mut rows) = ([0.0; MAX_TESTS], [LocalRow::default(); MAX_TESTS]);
            law.tests(v, &mut tests);
            law.test_rows(v, &mut rows);
            let error = |row: &LocalRow| {
                let size = row.pressure.abs() + row.traction[0].abs() + row.traction[1].abs();
                let moved = ALLOWANCE * row.along(&moved).abs();
                (moved + ROUNDING * largest * size.max(f64::MIN_POSITIVE)).max(f64::MIN_POSITIVE)
            };
            errors.push(std::array::from_fn(|t| error(&rows[t])));
            // Only the facets of the cell tell whether the piece changes.
            let facets = law.cell(self.nodes[i].node.piece).iter();
            let margin = facets.map(|facet| tests[facet.test()].abs() / errors[i][facet.test()]);
            let margin = margin.fold(f64::INFINITY, f64::min);
            self.margin = self.margin.min(margin);
            if margin <= 1.0 {
                self.weak.push(i);
            }
        }
        Ok(errors)
    }
}
