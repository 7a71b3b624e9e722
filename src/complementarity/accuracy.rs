//! When a point counts as a solution: the one rule of all solvers of this module, stated in its documentation.

use super::blocks::Blocks;
use super::columns::{BoxLcp, Columns};

/// Part of its terms below which the residual of a row is rounding.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// Unknowns beyond 2⁴⁸ have hardly a digit after the point: residuals do not determine them.
pub(super) const LARGEST: f64 = 281_474_976_710_656.0;

/// Where the constants of all rows of a block are a smaller part of their terms, the residual is compared with the constants: far out along
/// directions near the kernel of J, every residual is small relative to its terms.
const FAR: f64 = 1e-6;
/// Smaller parts count as 0: they may be rounding errors.
const NO_CONSTANT: f64 = 8.0 * f64::EPSILON;

/// The unit of an unknown; 1 where no units are given.
pub(super) fn unit(units: &[f64], i: usize) -> f64 {
    units.get(i).copied().unwrap_or(1.0)
}

/// Whether constants that are this part of the terms are small, but more than rounding errors.
fn is_far(part: &f64) -> bool {
    (NO_CONSTANT..FAR).contains(part)
}

/// A residual of at least this part of its terms shows no cancellation.
const OPEN: f64 = 1e-3;

/// Sets components to zero that are rounding errors of the largest one, where the bounds allow it; returns whether there were any. In a row
/// whose terms are all of this size, neither signs nor relative residuals are meaningful.
pub(super) fn drop_rounding(lcp: BoxLcp<'_>, z: &mut [f64]) -> bool {
    let rounding = ROUNDING * z.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    let mut any = false;
    for ((z, l), u) in z.iter_mut().zip(lcp.lower).zip(lcp.upper) {
        if *z != 0.0 && z.abs() <= rounding && *l <= 0.0 && *u >= 0.0 {
            *z = 0.0;
            any = true;
        }
    }
    any
}

/// Terms of rows, and buffers.
#[derive(Debug, Clone, Default)]
pub(super) struct Accuracy {
    terms: Vec<f64>,
    /// J x, where the constants of rows are not given.
    sum: Vec<f64>,
    /// Sums of the constant terms of rows (unknowns at bounds, and F − J x), then their parts of the terms.
    constants: Vec<f64>,
    blocks: Blocks,
    /// Largest part of the constants in each block.
    largest: Vec<f64>,
}

/// How near a point is to a solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measure {
    /// Largest residual of a component relative to the terms of its row.
    pub(super) error: f64,
    /// Relative error that the evaluation of F may hide.
    hidden: f64,
    /// As `error`, but always relative to the terms, far out as well.
    plain: f64,
    /// Whether a row vanishes with all its terms although its unknowns do not: flat, or its numbers underflow.
    pub(super) flat: bool,
}

impl Measure {
    pub(super) fn is_solved(self, tolerance: f64) -> bool {
        self.error <= tolerance && self.hidden <= tolerance
    }

    /// Whether some residual is not small relative to its terms.
    pub(super) fn is_open(self) -> bool {
        self.plain >= OPEN
    }

    /// Whether the residuals are only rounding errors of the terms.
    pub(super) fn is_rounding(self) -> bool {
        self.plain <= ROUNDING
    }
}

/// A point and F there; it may lie slightly outside the bounds, where the distance to them counts as an error.
pub(super) struct Point<'a> {
    pub(super) x: &'a [f64],
    pub(super) f: &'a [f64],
    pub(super) jac: Columns<'a>,
    /// F − J x, where it is known without cancellation.
    pub(super) rest: Option<&'a [f64]>,
    /// The blocks of `jac`, where they are known.
    pub(super) blocks: Option<&'a Blocks>,
    /// Where the sizes of the unknowns are not |x|: those of their blocks, and the units they are measured in (empty for 1).
    pub(super) sizes: Option<(&'a [f64], &'a [f64])>,
    pub(super) lower: &'a [f64],
    pub(super) upper: &'a [f64],
}

impl<'a> Point<'a> {
    /// A point z of an LCP and w = M z + q.
    pub(super) fn of(lcp: BoxLcp<'a>, z: &'a [f64], w: &'a [f64]) -> Self {
        Self {
            x: z,
            f: w,
            jac: lcp.matrix,
            rest: Some(lcp.q),
            blocks: None,
            sizes: None,
            lower: lcp.lower,
            upper: lcp.upper,
        }
    }

    /// Whether the component is at a bound at which F has the required sign.
    fn rests(&self, i: usize) -> bool {
        let (x, f) = (self.x[i], self.f[i]);
        (x == self.lower[i] && f >= 0.0) || (x == self.upper[i] && f <= 0.0) || self.lower[i] == self.upper[i]
    }
}

impl Accuracy {
    /// Terms Sᵢ = Σⱼ |Jᵢⱼ xⱼ| + |fᵢ − Σⱼ Jᵢⱼ xⱼ|, and the residuals relative to them.
    pub(super) fn measure(&mut self, p: &Point<'_>) -> Measure {
        let n = p.x.len();
        for v in [&mut self.terms, &mut self.constants] {
            v.clear();
            v.resize(n, 0.0);
        }
        self.sum.clear();
        self.sum.resize(if p.rest.is_some() { 0 } else { n }, 0.0);
        for j in 0..n {
            let x = p.x[j];
            let size = p.sizes.map_or(x, |(sizes, units)| {
                sizes[p.blocks.map_or(j, |b| b.of(j))] * unit(units, j)
            });
            let moves = x != p.lower[j] && x != p.upper[j];
            p.jac.each(j, |i, v| {
                let term = v * x;
                self.terms[i] += (v * size).abs();
                if let Some(sum) = self.sum.get_mut(i) {
                    *sum += term;
                }
                if !moves {
                    self.constants[i] += term.abs();
                }
            });
        }
        for i in 0..n {
            let rest = p.rest.map_or_else(|| p.f[i] - self.sum[i], |rest| rest[i]).abs();
            self.terms[i] += rest;
            self.constants[i] = match self.terms[i] > 0.0 && !p.rests(i) {
                true => (self.constants[i] + rest) / self.terms[i],
                false => 0.0,
            };
        }
        let far_out = p.sizes.is_none() && self.constants.iter().any(is_far);
        if far_out {
            if p.blocks.is_none() {
                self.blocks.find(p.jac, n);
            }
            let blocks = p.blocks.unwrap_or(&self.blocks);
            blocks.largest(self.constants.iter().copied(), &mut self.largest);
        }
        let (mut worst, mut plain, mut far) = (0.0_f64, 0.0_f64, 1.0_f64);
        for i in 0..n {
            let part = if far_out { self.divisor(p, i) } else { 1.0 };
            let error = self.error(p, i);
            if error > plain || error.is_nan() {
                plain = error;
            }
            if error / part > worst || error.is_nan() {
                worst = error / part;
            }
            far = far.min(part);
        }
        let empty = |i: usize| self.terms[i] == 0.0 && !(p.x[i] == p.lower[i] || p.x[i] == p.upper[i]);
        let flat = (0..n).any(empty)
            && (0..n).any(|j| {
                let mut acts = false;
                p.jac.each(j, |i, _| acts |= empty(i));
                p.x[j] != 0.0 && acts
            });
        let beyond = p.x.iter().any(|x| x.abs() > LARGEST);
        Measure {
            error: worst,
            plain,
            flat,
            hidden: if beyond {
                f64::INFINITY
            } else if far < 1.0 {
                f64::EPSILON / far
            } else {
                0.0
            },
        }
    }

    /// The divisor of the residual of a row: less than 1 where all rows of its block have small constants.
    fn divisor(&self, p: &Point<'_>, i: usize) -> f64 {
        let largest = self.largest[p.blocks.unwrap_or(&self.blocks).of(i)];
        if is_far(&largest) { largest / FAR } else { 1.0 }
    }

    /// The residual of one component relative to the terms of its row; NaN where F is.
    fn error(&self, p: &Point<'_>, i: usize) -> f64 {
        let (f, x) = (p.f[i], p.x[i]);
        let outside = (p.lower[i] - x).max(x - p.upper[i]);
        if outside > 0.0 {
            return self.shift(p, i, outside);
        }
        if f == 0.0 || p.rests(i) {
            return 0.0;
        }
        self.part(i, f.abs())
    }

    /// A part of the terms of a row; infinite where these are above the largest number, since they hide any residual then.
    fn part(&self, row: usize, size: f64) -> f64 {
        match self.terms[row] {
            f64::INFINITY => f64::INFINITY,
            terms => size / terms,
        }
    }

    /// The largest relative change of a row, with respect to its terms, when x_i moves by `length`.
    fn shift(&self, p: &Point<'_>, i: usize, length: f64) -> f64 {
        let mut worst: Option<f64> = None;
        p.jac.each(i, |row, v| {
            let change = (v * length).abs();
            if change > 0.0 {
                worst = Some(worst.unwrap_or(0.0).max(self.part(row, change)));
            }
        });
        worst.unwrap_or(length / p.x[i].abs())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::complementarity::Lcp;
    use crate::sparse::Matrix;

    #[test]
    fn a_point_where_the_rows_overflow_is_no_solution() {
        let lcp = Lcp::new(Matrix::from_rows(&[[1e308]]).unwrap(), vec![-1.0]).unwrap();
        for w in [f64::NAN, f64::INFINITY, 1e307] {
            let measure = Accuracy::default().measure(&Point::of((&lcp).into(), &[10.0], &[w]));
            assert!(!measure.is_solved(1.0), "{w}");
        }
    }

    /// 0 ≤ z ⟂ 2 z − 3 ≥ 0: below its bound z is wrong by what moving back changes in the row, beside it by the residual.
    #[test]
    fn a_point_beside_its_bounds_is_none_within_them() {
        let lcp = Lcp::new(Matrix::from_rows(&[[2.0]]).unwrap(), vec![-3.0]).unwrap();
        let mut accuracy = Accuracy::default();
        let mut error = |z: f64| {
            let (z, w) = ([z], [2.0 * z - 3.0]);
            accuracy.measure(&Point::of((&lcp).into(), &z, &w)).error
        };
        assert_eq!(error(1.5), 0.0);
        assert_eq!(error(0.0), 1.0);
        for d in [1e-3, 0.5, 2.0] {
            let expected = 2.0 * d / (2.0 * d + 3.0);
            assert!((error(-d) - expected).abs() < 1e-15, "{d}");
            let inside = 2.0 * d / (2.0 * (1.5 + d) + 3.0);
            assert!((error(1.5 + d) - inside).abs() < 1e-15, "{d}");
        }
    }

    /// Beside a component of 1 what is below 64 units in its last place is rounding, and nothing else is.
    #[test]
    fn only_rounding_is_dropped() {
        let mut z = [1.0, 63.0 * f64::EPSILON, 65.0 * f64::EPSILON, 1e-12];
        let identity = Matrix::from_triplets(4, 4, &[0, 1, 2, 3].map(|i| (i, i, 1.0))).unwrap();
        let lcp = Lcp::new(identity, vec![-1.0; 4]).unwrap();
        assert!(drop_rounding((&lcp).into(), &mut z));
        assert_eq!(z, [1.0, 0.0, 65.0 * f64::EPSILON, 1e-12]);
        assert!(!drop_rounding((&lcp).into(), &mut z));
    }
}
