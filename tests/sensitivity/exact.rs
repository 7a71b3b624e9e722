//! Linear complementarity problems with small integers, whose one-sided derivatives are found in exact
//! arithmetic.

use semismooth::complementarity::Lcp;
use semismooth::sensitivity::{Directional, Sensitivity, SensitivityError};
use semismooth::sparse::Matrix;

use super::random::Random;

/// A fraction with a positive denominator.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fraction(pub(super) i128, pub(super) i128);

impl Fraction {
    pub(super) fn value(self) -> f64 {
        self.0 as f64 / self.1 as f64
    }
}

/// The determinant of a matrix of integers (Bareiss 1968).
pub(super) fn determinant(rows: &[Vec<i128>]) -> i128 {
    let mut a = rows.to_vec();
    let n = a.len();
    let (mut sign, mut last) = (1, 1);
    for k in 0..n {
        let Some(pivot) = (k..n).find(|&i| a[i][k] != 0) else {
            return 0;
        };
        if pivot != k {
            a.swap(pivot, k);
            sign = -sign;
        }
        for i in k + 1..n {
            for j in k + 1..n {
                a[i][j] = (a[i][j] * a[k][k] - a[i][k] * a[k][j]) / last;
            }
        }
        last = a[k][k];
    }
    sign * last
}

/// Where z > 0 = w, z = 0 = w, z = 0 < w.
#[derive(Clone, Copy, PartialEq, Debug)]
enum Index {
    Interior,
    Degenerate,
    Bound,
}

struct Problem {
    m: Vec<Vec<i128>>,
    kinds: Vec<Index>,
    z: Vec<i128>,
    q: Vec<i128>,
    /// ∂q/∂θ.
    column: Vec<i128>,
}

impl Problem {
    fn new(random: &mut Random, definite: bool) -> Self {
        let n = 2 + random.below(4);
        let small = |random: &mut Random| random.below(7) as i128 - 3;
        let mut m: Vec<Vec<i128>> = (0..n).map(|_| (0..n).map(|_| small(random)).collect()).collect();
        if definite {
            (0..n).for_each(|i| m[i][i] += 4 * n as i128);
        }
        let kind = |random: &mut Random| [Index::Interior, Index::Degenerate, Index::Bound][random.below(3)];
        let kinds: Vec<Index> = (0..n).map(|_| kind(random)).collect();
        let z: Vec<i128> = (kinds.iter())
            .map(|k| {
                if *k == Index::Interior {
                    1 + random.below(5) as i128
                } else {
                    0
                }
            })
            .collect();
        let q = (0..n).map(|i| {
            let w = if kinds[i] == Index::Bound {
                1 + random.below(5) as i128
            } else {
                0
            };
            w - (0..n).map(|j| m[i][j] * z[j]).sum::<i128>()
        });
        let q = q.collect();
        let column = (0..n)
            .map(|_| if random.below(3) == 0 { 0 } else { small(random) })
            .collect();
        Self {
            m,
            kinds,
            z,
            q,
            column,
        }
    }

    fn degenerate(&self) -> Vec<usize> {
        (0..self.z.len())
            .filter(|&i| self.kinds[i] == Index::Degenerate)
            .collect()
    }

    /// The selections of the degenerate components: whether w = 0 is required of component i.
    fn selections(&self) -> impl Iterator<Item = Vec<bool>> + '_ {
        let degenerate = self.degenerate();
        (0..1usize << degenerate.len()).map(move |bits| {
            let chosen = |i: usize| {
                degenerate
                    .iter()
                    .position(|&d| d == i)
                    .is_some_and(|k| bits >> k & 1 == 1)
            };
            (0..self.z.len())
                .map(|i| self.kinds[i] == Index::Interior || chosen(i))
                .collect()
        })
    }

    /// The rows of (w = 0 or z = 0).
    fn rows(&self, interior: &[bool]) -> Vec<Vec<i128>> {
        let n = interior.len();
        let row = |i: usize| match interior[i] {
            true => self.m[i].clone(),
            false => (0..n).map(|j| i128::from(i == j)).collect(),
        };
        (0..n).map(row).collect()
    }

    /// The derivatives along ±∂q: for each solution of the linearised problem its values, by Cramer's rule.
    /// `None` if one of the selections is singular.
    fn branches(&self, sign: i128) -> Option<Vec<Vec<Fraction>>> {
        let n = self.z.len();
        let mut all: Vec<Vec<Fraction>> = Vec::new();
        for interior in self.selections() {
            let rows = self.rows(&interior);
            let det = determinant(&rows);
            if det == 0 {
                return None;
            }
            let right: Vec<i128> = (0..n)
                .map(|i| if interior[i] { -sign * self.column[i] } else { 0 })
                .collect();
            let v: Vec<Fraction> = (0..n)
                .map(|j| {
                    let mut replaced = rows.clone();
                    (0..n).for_each(|i| replaced[i][j] = right[i]);
                    Fraction(determinant(&replaced) * det.signum(), det.abs())
                })
                .collect();
            let fits = self.degenerate().iter().all(|&i| {
                let w =
                    (0..n).map(|j| self.m[i][j] * v[j].0).sum::<i128>() + sign * self.column[i] * det.abs();
                v[i].0 >= 0 && w >= 0
            });
            let known = |u: &Vec<Fraction>| u.iter().zip(&v).all(|(a, b)| a.0 * b.1 == b.0 * a.1);
            if fits && !all.iter().any(known) {
                all.push(v);
            }
        }
        Some(all)
    }

    /// Whether all selections have determinants of one sign: the solution is then locally unique and
    /// Lipschitz in q (Robinson 1980).
    fn is_strongly_regular(&self) -> bool {
        let mut signs = self.selections().map(|s| determinant(&self.rows(&s)).signum());
        let first = signs.next().unwrap_or(0);
        first != 0 && signs.all(|s| s == first)
    }

    /// The problem in floating-point numbers. With `rounded`, rows and unknowns are scaled by fractions that
    /// are not stored exactly, and the solution given is off by 1e-10, as one found by a solver.
    fn sensitivity(
        &self,
        rounded: bool,
    ) -> Result<Sensitivity<impl semismooth::piecewise::PiecewiseSmooth>, SensitivityError> {
        let n = self.z.len();
        let row = |i: usize| if rounded { 10_f64.powi(i as i32) / 7.0 } else { 1.0 };
        let scaled = |v: &[i128]| (0..n).map(|i| row(i) * v[i] as f64).collect::<Vec<f64>>();
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                (0..n)
                    .map(|j| row(i) * self.m[i][j] as f64 * unit(j, rounded))
                    .collect()
            })
            .collect();
        let lcp = Lcp::new(Matrix::from_rows(&rows).unwrap(), scaled(&self.q)).unwrap();
        let column: Vec<[f64; 1]> = scaled(&self.column).into_iter().map(|v| [v]).collect();
        let map = lcp.in_constants(&Matrix::from_rows(&column).unwrap()).unwrap();
        let mut random = Random::new(n as u64);
        let z: Vec<f64> = (0..n)
            .map(|j| {
                let off = if rounded { 1e-10 * random.symmetric() } else { 0.0 };
                self.z[j] as f64 / unit(j, rounded) + off
            })
            .collect();
        Sensitivity::new(map, &z, &[0.0])
    }
}

/// The unit of an unknown.
fn unit(j: usize, rounded: bool) -> f64 {
    if rounded { (j + 2) as f64 / 3.0 } else { 1.0 }
}

fn is_near(found: &[f64], exact: &[Fraction], rounded: bool) -> bool {
    let largest = exact.iter().fold(1.0_f64, |m, v| m.max(v.value().abs()));
    let gap = |j: usize| found[j] * unit(j, rounded) - exact[j].value();
    (0..found.len()).all(|j| gap(j).abs() <= 1e-11 * largest)
}

/// *Differentiable* is said exactly where it is true, and derivatives along both directions are the exact ones, on 600 problems with random
/// degenerate solutions; where the solution is not strongly regular, neither yes nor no is said, and the
/// branches are the exact ones.
#[test]
fn degenerate_complementarity_problems_are_as_in_exact_arithmetic() {
    agrees_with_exact_arithmetic(false);
}

/// The same where data and solution are rounded, so that no kink is met exactly.
#[test]
fn rounding_of_data_and_solution_does_not_matter() {
    agrees_with_exact_arithmetic(true);
}

fn agrees_with_exact_arithmetic(rounded: bool) {
    let mut counts = [0; 4];
    for seed in 0..600 {
        let problem = Problem::new(&mut Random::new(seed), seed % 2 == 0);
        if problem.column.iter().all(|c| *c == 0) {
            continue;
        }
        let mut found = match problem.sensitivity(rounded) {
            Ok(found) => found,
            // Which of the selections is met first is not specified.
            Err(SensitivityError::Irregular { .. }) => {
                let is_singular = problem.selections().any(|s| determinant(&problem.rows(&s)) == 0);
                assert!(is_singular, "seed {seed}");
                continue;
            }
            Err(e) => panic!("seed {seed}: {e}"),
        };
        let known = found.differentiable().unwrap().known();
        if !problem.is_strongly_regular() {
            assert_eq!(known, None, "seed {seed}");
            for (sign, delta) in [(1, 1.0), (-1, -1.0)] {
                let Directional::Branches { branches, complete } = found.directional(&[delta]).unwrap()
                else {
                    panic!("seed {seed}: one function");
                };
                if let (Some(exact), true) = (problem.branches(sign), complete) {
                    assert_eq!(branches.len(), exact.len(), "seed {seed}");
                    let all = branches
                        .iter()
                        .all(|b| exact.iter().any(|e| is_near(b, e, rounded)));
                    assert!(all, "seed {seed}: {branches:?}, {exact:?}");
                    counts[0] += 1;
                }
            }
            continue;
        }
        let sides = [1, -1].map(|sign| problem.branches(sign).unwrap());
        let ([right], [left]) = (sides[0].as_slice(), sides[1].as_slice()) else {
            panic!("seed {seed}: a strongly regular solution has one derivative on each side");
        };
        let linear = right.iter().zip(left).all(|(a, b)| a.0 * b.1 + b.0 * a.1 == 0);
        assert_eq!(known, Some(linear), "seed {seed}");
        for (delta, exact) in [(1.0, right), (-1.0, left)] {
            assert!(
                is_near(&found.jvp(&[delta]).unwrap(), exact, rounded),
                "seed {seed}"
            );
        }
        let degenerate = !problem.degenerate().is_empty();
        counts[1 + usize::from(degenerate) * (1 + usize::from(!linear))] += 1;
    }
    // All cases occur: several branches, smooth solutions, kinks that the parameter does not feel, and kinks.
    assert!(counts.iter().all(|c| *c > 10), "{counts:?}");
}
