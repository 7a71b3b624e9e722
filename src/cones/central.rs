//! An interior-point method for cone problems.

use std::ops::ControlFlow;

use super::equations::{Map, Part};
use super::interior::{Image, Interior};
use super::run::{Run, TAIL};
use crate::complementarity::ComplementarityError;
use crate::linear::{Cholesky, LinearSolver};
use crate::run::Status;
use crate::sparse::{Matrix, Pattern, max_abs};
use crate::tolerances::{RESULT, STEPS};

/// A step is short below this length, and the iteration ends after so many short ones in a row.
const SHORT: f64 = 0.02;
const STUCK: usize = 5;

/// F in units of each cone, and its derivative, at the point of the last evaluation.
struct Evaluated<'a> {
    f: &'a [f64],
    jac: &'a Matrix,
    parts: &'a [Part],
    owner: &'a [usize],
    /// The place of each entry of ∇F in the pattern of the iteration.
    slots: &'a [usize],
}

impl Image for Evaluated<'_> {
    fn image(&mut self, _: &[f64], y: &mut [f64]) {
        for part in self.parts {
            for i in part.range.clone() {
                y[i] = part.unit * self.f[i];
            }
        }
    }

    fn derivative(&self, values: &mut [f64]) {
        values.fill(0.0);
        let entries = self.jac.pattern().row_idx().iter().zip(self.jac.values());
        for ((row, value), slot) in entries.zip(self.slots) {
            values[*slot] += self.parts[self.owner[*row]].unit * value;
        }
    }
}

/// Whether M + Mᵀ is positive semidefinite, up to rounding.
pub(super) fn is_monotone(matrix: &Matrix) -> Result<bool, ComplementarityError> {
    let n = matrix.nrows();
    let shift = RESULT * max_abs(matrix.values());
    let mut entries: Vec<_> = (0..n).map(|i| (i, i, shift)).collect();
    for (i, j, v) in matrix.triplets() {
        entries.extend([(i, j, 0.5 * v), (j, i, 0.5 * v)]);
    }
    let symmetric = Matrix::from_triplets(n, n, &entries)?;
    let mut cholesky = Cholesky::new();
    let factored = cholesky
        .analyze(symmetric.pattern().as_ref())
        .and_then(|()| cholesky.factor(symmetric.as_ref()));
    Ok(factored.is_ok())
}

impl Run<'_> {
    /// Whether F is affine and monotone up to rounding; ∇F must have been evaluated.
    pub(super) fn is_monotone(&self) -> Result<bool, ComplementarityError> {
        Ok(self.constant.is_some() && is_monotone(&self.jac)?)
    }

    /// Follows the central path from `start` until steps of the natural map end at a solution; `None` where they do not. The path leads
    /// there where F is monotone and some x has both x and F(x) in the interiors of their cones; solutions need not be unique.
    pub(super) fn interior_points(&mut self, start: &[f64]) -> Result<Option<Status>, ComplementarityError> {
        self.x.copy_from_slice(start);
        if !self.evaluate()? {
            return Ok(None);
        }
        self.choose_units();
        let first = self.map(Map::Natural, false);
        let n = self.x.len();
        let diagonal = self.parts.iter().flat_map(|part| {
            let rows = part.range.clone();
            rows.flat_map(|j| part.range.clone().map(move |i| (i, j)))
        });
        let entries = self.jac.triplets().map(|(i, j, _)| (i, j)).chain(diagonal);
        let pattern = Pattern::from_entries(n, n, entries)?;
        let slots: Vec<usize> = self
            .jac
            .triplets()
            .filter_map(|(i, j, _)| pattern.slot(i, j))
            .collect();
        let (col_ptr, row_idx) = (pattern.col_ptr().to_vec(), pattern.row_idx().to_vec());
        let cones = self.parts.iter().map(|part| part.cone);
        let mut engine = Interior::new(cones, col_ptr, row_idx, false);
        // In their units x and F are of similar size; where both vanish their size is not known.
        let size = max_abs(&self.x).max(max_abs(&self.y));
        let least = if size > 0.0 { size } else { 1.0 };
        let begin = self.x.clone();
        let (mut next_tail, mut length, mut stuck) = (TAIL * first, 1.0, 0);
        for step in 0..=STEPS {
            if let Some(status) = self.exhausted() {
                return Ok(Some(status));
            }
            let mut map = Evaluated {
                f: &self.f,
                jac: &self.jac,
                parts: &self.parts,
                owner: &self.owner,
                slots: &slots,
            };
            if step == 0 {
                engine.start(&mut map, &begin, least);
            } else {
                let Some(moved) = engine.step(&mut map) else { break };
                self.report.factorisations += 1;
                length = moved;
            }
            self.x.copy_from_slice(engine.x());
            if !self.evaluate()? {
                return Ok(None);
            }
            // x ∘ y = μ² e on the central path, where Φ_μ vanishes.
            let smoothed = Map::Smoothed(engine.gap().max(0.0).sqrt());
            let merit = self.map(smoothed, false);
            if self.record(merit, smoothed, length).is_break() {
                return Ok(Some(Status::Interrupted));
            }
            stuck = if length < SHORT { stuck + 1 } else { 0 };
            let merit = self.map(Map::Natural, false);
            if merit <= next_tail {
                next_tail = TAIL * merit;
                match self.tail()? {
                    Some(ControlFlow::Continue(())) => return Ok(Some(Status::Solved)),
                    Some(ControlFlow::Break(())) => return Ok(Some(Status::Interrupted)),
                    None => {}
                }
            }
            if stuck == STUCK {
                break;
            }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Cone, ConeOptions, ConeProblem};
    use super::*;
    use crate::clock::Deadline;
    use crate::complementarity::{AffineFunction, McpFunction, WithJacobian};
    use crate::sparse::norm;
    use crate::spread::Random;

    /// How interior points alone end, whether F counts as monotone, and the point.
    fn solve(function: &dyn McpFunction, cones: Vec<Cone>) -> (Option<Status>, bool, Vec<f64>) {
        let problem = ConeProblem::new(function, cones).unwrap();
        let options = ConeOptions::default();
        let mut silent = |_: &_| ControlFlow::Continue(());
        let mut run = Run::new(&problem, &options, Deadline::after(None), &mut silent).unwrap();
        let start = vec![0.0; problem.len()];
        run.best.copy_from_slice(&start);
        assert!(run.evaluate().unwrap());
        let monotone = run.is_monotone().unwrap();
        (run.interior_points(&start).unwrap(), monotone, run.best)
    }

    /// min cᵀx + ½ x₀² over h − G x in two cones, a half-line and an equality, with points inside of both sides: value and dual value
    /// agree.
    #[test]
    fn cone_programs_have_no_duality_gap() {
        let mut random = Random::new(5);
        for curved in [0.0, 1.0] {
            for _ in 0..20 {
                let inside = |random: &mut Random, dual: bool| {
                    let mut z: Vec<f64> = (0..9).map(|_| random.symmetric()).collect();
                    z[0] = norm(&z[1..3]) + 0.5;
                    z[3] = norm(&z[4..7]) + 0.2;
                    z[7] = z[7].abs() + 0.1;
                    z[8] *= f64::from(dual);
                    z
                };
                let (s, z) = (inside(&mut random, false), inside(&mut random, true));
                let g: Vec<Vec<f64>> = (0..9)
                    .map(|_| (0..4).map(|_| random.symmetric()).collect())
                    .collect();
                let mut entries = vec![(0, 0, curved)];
                let (mut q, at) = (vec![0.0; 13], [0.3, -0.2, 0.5, 0.1]);
                q[0] = -curved * at[0];
                for i in 0..9 {
                    q[4 + i] = s[i];
                    for j in 0..4 {
                        entries.extend([(j, 4 + i, g[i][j]), (4 + i, j, -g[i][j])]);
                        q[j] -= g[i][j] * z[i];
                        q[4 + i] += g[i][j] * at[j];
                    }
                }
                let function =
                    AffineFunction::new(Matrix::from_triplets(13, 13, &entries).unwrap(), q.clone());
                let cones = [Cone::Free(4), Cone::SecondOrder(3), Cone::SecondOrder(4)];
                let rest = [Cone::Nonnegative(1), Cone::Free(1)];
                let (status, monotone, w) = solve(&function.unwrap(), [&cones[..], &rest[..]].concat());
                assert!(monotone && status == Some(Status::Solved), "{status:?}");
                let (x, z) = w.split_at(4);
                let slack = |i: usize| q[4 + i] - (0..4).map(|j| g[i][j] * x[j]).sum::<f64>();
                let value = 0.5 * curved * x[0] * x[0] + (0..4).map(|j| q[j] * x[j]).sum::<f64>();
                let dual = -0.5 * curved * x[0] * x[0] - (0..9).map(|i| q[4 + i] * z[i]).sum::<f64>();
                assert!(
                    (value - dual).abs() <= 1e-8 * (1.0 + value.abs()),
                    "{value} {dual}"
                );
                let s: Vec<f64> = (0..9).map(slack).collect();
                for v in [&s[..], z] {
                    assert!(v[0] >= norm(&v[1..3]) - 1e-8 && v[3] >= norm(&v[4..7]) - 1e-8 && v[7] >= -1e-8);
                }
                assert!(s[8].abs() <= 1e-8);
            }
        }
    }

    /// The gradient of a convex function that is not quadratic, its least point on the boundary, inside, and at the apex of the cones.
    #[test]
    fn curved_functions_are_solved_too() {
        let goal = [1.0, 0.6, 0.8, 2.0, 0.1, -1.0, 0.0, 0.0, 0.0];
        let value = |x: &[f64], f: &mut [f64]| {
            (0..9).for_each(|i| f[i] = (x[i] - goal[i]).exp() - 1.0);
            f[6] += 1.0;
        };
        let jacobian =
            |x: &[f64], jac: &mut Matrix| (0..9).for_each(|i| jac.add(i, i, (x[i] - goal[i]).exp()));
        let (status, monotone, x) = solve(
            &WithJacobian::new(9, value, jacobian),
            vec![Cone::SecondOrder(3); 3],
        );
        assert_eq!((status, monotone), (Some(Status::Solved), false));
        assert!(x.iter().zip(&goal).all(|(x, g)| (x - g).abs() <= 1e-7), "{x:?}");
    }

    #[test]
    fn indefinite_matrices_are_not_monotone() {
        for (entry, expected) in [(0.9, true), (1.0, true), (1.1, false)] {
            let matrix = Matrix::from_rows(&[[1.0, 2.0 * entry - 3.0], [3.0, 1.0]]).unwrap();
            let function = AffineFunction::new(matrix, vec![1.0, 1.0]).unwrap();
            assert_eq!(
                solve(&function, vec![Cone::SecondOrder(2)]).1,
                expected,
                "{entry}"
            );
        }
    }
}
