//! The smooth extension of one selection near a point: its Jacobian in balanced units with the errors of its entries, its kernels, and
//! Taylor coefficients along arcs.

use std::cell::Cell;

use super::arc::{Arc, Value};
use super::multiple::LARGEST;
use super::search::RANK;
use super::units::{changes, own_sizes, power, row_sizes, sizes};
use crate::linear::{Decomposition, decompose};
use crate::piecewise::expansion::{Exactness, TERMS, along};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection, Vanishing};
use crate::sparse::{Matrix, dot, norm};
use crate::spread::centred;

/// Rounding errors of a coordinate by which a point found to rounding may be off, and the factor by which differences between
/// computations from such points may be smaller than the errors that they stand for.
const SAFETY: f64 = 64.0;
/// Displacement, in balanced units, over which the change of a row of the Jacobian is its size where the row itself vanishes.
const APART: f64 = 1.0 / 1024.0;
/// Number of points beside the given one from which everything is computed again.
const BESIDE: usize = 2;
/// Highest order of a root that a located point may be.
pub(in crate::continuation) const ROOT: f64 = 4.0;
/// Times that sizes are found from changes of the Jacobian over the sizes before: where only a square tells the size of a variable that is 0,
/// each time takes three of four digits by which it is off, and 4⁸ digits are more than numbers have.
const PASSES: usize = 8;

/// Highest order of the coefficients.
pub(super) const ORDER: usize = TERMS - 1;

/// A point, the units of its variables and points that rounding may have put in its place.
pub(super) struct Frame<'a> {
    pub(super) map: &'a dyn PiecewiseSmooth,
    pub(super) x: &'a [f64],
    /// Positions of the test functions that vanish there.
    pub(super) vanishing: &'a [usize],
    /// Number of all test functions.
    pub(super) tests: usize,
    /// They with their gradients; as far as the facets that meet here are from x, x is from the point where they meet.
    pub(super) met: &'a [Vanishing],
    /// Values of all test functions.
    pub(super) theta: &'a [f64],
    /// How far x may be off, beyond rounding and `met`, in balanced units.
    pub(super) off: f64,
}

/// The map of a selection near a point.
pub(super) struct Extension<'a> {
    pub(super) frame: &'a Frame<'a>,
    pub(super) selection: &'a Selection,
    /// Sizes of the variables: everything is computed in multiples of them.
    pub(super) units: Vec<f64>,
    /// Factors of the rows of H.
    rows: Vec<f64>,
    /// The point, and those beside it.
    bases: Vec<Vec<f64>>,
    /// The Jacobians there, balanced.
    jacobians: Vec<Matrix>,
    svd: Decomposition,
    /// Singular values up to this one count as zero.
    pub(super) error: f64,
    pub(super) rank: usize,
    /// The largest estimated error of a coefficient of H of second or higher order so far.
    noise: Cell<f64>,
}

/// Coefficients of H and of the vanishing test functions along an arc: `residual[k]` and `tests[k]` are those of s^k.
pub(super) struct Coefficients {
    pub(super) residual: Vec<Vec<f64>>,
    pub(super) tests: Vec<Vec<f64>>,
    /// Estimated errors of those of the test functions; 0 where they are known to rounding.
    errors: Vec<Vec<f64>>,
}

impl<'a> Extension<'a> {
    /// # Errors
    /// Entries outside the pattern, values that are not finite.
    pub(super) fn new(frame: &'a Frame<'a>, selection: &'a Selection) -> Result<Self, PiecewiseError> {
        let (map, x) = (frame.map, frame.x);
        let mut jac = Matrix::zeros(map.pattern());
        let at = |x: &[f64], jac: &mut Matrix| {
            jac.clear();
            map.jacobian(selection, x, jac);
            match jac.stray() {
                Some((row, col)) => Err(PiecewiseError::StrayEntry { row, col }),
                None => Ok(()),
            }
        };
        at(x, &mut jac)?;
        let (mut units, mut there) = (own_sizes(x), jac.clone());
        let (mut settled, mut nothing) = (false, vec![false; x.len()]);
        for _ in 0..PASSES {
            let away = x.iter().zip(&units).enumerate();
            let away: Vec<f64> = away
                .map(|(j, (x, unit))| x + unit * centred(j + 1, false))
                .collect();
            at(&away, &mut there)?;
            // Halfway, in digits: sizes that only a cube or a higher power tells would swing about it.
            let larger = changes(&jac, [&there, &jac], 1.0);
            let next = sizes(&jac, larger, (x, &units), &mut nothing).into_iter();
            let next: Vec<f64> = next
                .zip(&units)
                .map(|(a, b)| power(a.sqrt() * b.sqrt()))
                .collect();
            settled = next
                .iter()
                .zip(&units)
                .all(|(a, b)| (0.5..=2.0).contains(&(a / b)));
            units = next;
            if settled {
                break;
            }
        }
        // Sizes that go on growing or falling are those of variables in which H is homogeneous: nothing tells them.
        if !settled {
            units = own_sizes(x);
        }
        let apart = |sign: f64| -> Vec<f64> {
            let all = x.iter().zip(&units).enumerate();
            all.map(|(j, (x, unit))| x + sign * APART * unit * (1.0 + centred(j + 1, false)))
                .collect()
        };
        let (mut ahead, mut behind) = (jac.clone(), jac.clone());
        at(&apart(1.0), &mut ahead)?;
        at(&apart(-1.0), &mut behind)?;
        let mut sizes = changes(&jac, [&ahead, &behind], 0.5 / APART);
        sizes.scale_columns(&units);
        let rows = row_sizes(&sizes).into_iter().map(f64::recip).collect();
        let mut this = Self {
            frame,
            selection,
            bases: bases(x, &units, off(frame, &units)),
            units,
            rows,
            jacobians: Vec::new(),
            svd: Decomposition {
                right: Vec::new(),
                left: Vec::new(),
                values: Vec::new(),
            },
            error: 0.0,
            rank: 0,
            noise: Cell::new(0.0),
        };
        for base in &this.bases {
            at(base, &mut jac)?;
            this.jacobians.push(this.balanced(&jac));
        }
        this.svd = decompose(&this.jacobians[0])?;
        this.error = this.error_of_entries();
        this.rank = this.svd.values.iter().filter(|s| **s > this.error).count();
        Ok(this)
    }

    fn balanced(&self, jac: &Matrix) -> Matrix {
        let mut jac = jac.clone();
        jac.scale_columns(&self.units);
        let factors: Vec<f64> = jac.triplets().map(|(i, ..)| self.rows[i]).collect();
        jac.values_mut()
            .iter_mut()
            .zip(factors)
            .for_each(|(v, f)| *v *= f);
        jac
    }

    /// Bound of the norm of the errors of the entries of the Jacobian: what rounding of the point makes of them, and their own rounding.
    fn error_of_entries(&self) -> f64 {
        let first = self.jacobians[0].values();
        let moved = |other: &Matrix| {
            let apart: Vec<f64> = first.iter().zip(other.values()).map(|(a, b)| a - b).collect();
            norm(&apart)
        };
        let scatter = self.jacobians[1..].iter().map(moved).fold(0.0, f64::max);
        SAFETY * f64::EPSILON * norm(first) + scatter
    }

    /// Whether a smaller rank is within the errors of the entries, too, or within those of a point located as a `singular` one.
    pub(super) fn doubtful_rank(&self, singular: bool) -> Option<usize> {
        let least = self.rank.checked_sub(1).map(|k| self.svd.values[k])?;
        let located = if singular { RANK } else { 0.0 };
        (least <= located.max(SAFETY * self.error)).then(|| self.rank - 1)
    }

    /// Errors up to which numbers computed from coefficients of H in the kernel are known, in balanced units: the kernels turn by the errors
    /// of the entries over the least singular value that counts.
    pub(super) fn resolution(&self) -> f64 {
        let least = self
            .rank
            .checked_sub(1)
            .map_or(1.0, |k| self.svd.values[k].min(1.0));
        self.error / least + self.noise.get()
    }

    /// How far the point may be from the one where the kernel has its dimension, in balanced units. At a root of order k of the equations of
    /// that point a step of Newton's method is 1/k of the distance. Where the quadratic form has rank one, it is the distance along its double
    /// root up to which ∇H in the kernel is 0 within rounding.
    pub(super) fn location_error(&self) -> Result<f64, PiecewiseError> {
        if !(2..=LARGEST).contains(&self.dimension()) {
            return Ok(0.0);
        }
        let step = self.towards_singular_point().map_or(0.0, |s| ROOT * norm(&s));
        let ([_, _], [u]) = (self.kernel(), self.cokernel()) else {
            return Ok(step);
        };
        let (forms, discriminant) = self.form();
        if discriminant.is_none_or(|d| d.sign() != 0) {
            return Ok(step);
        }
        let least = self.direction(&Self::double_root(forms[0]));
        let (map, mut jac) = (self.frame.map, Matrix::zeros(self.frame.map.pattern()));
        let rounding = 2.0 * self.svd.values[self.rank].max(self.error);
        let mut s = APART;
        while s > f64::EPSILON {
            let moved = self.bases[0].iter().zip(least.iter().zip(&self.units));
            let moved: Vec<f64> = moved.map(|(x, (v, unit))| x + s * v * unit).collect();
            jac.clear();
            map.jacobian(self.selection, &moved, &mut jac);
            let jac = self.balanced(&jac);
            let seen = |e: &Vec<f64>| {
                let mut image = vec![0.0; u.len()];
                jac.mul_vec(e, &mut image);
                dot(u, &image).abs() > rounding
            };
            if !self.kernel().iter().any(seen) {
                break;
            }
            s *= 0.5;
        }
        Ok(s)
    }

    /// Whether the part of H outside the range of its Jacobian is 0 within rounding, which its values beside the point tell.
    pub(super) fn vanishes(&self) -> bool {
        let part = |base: usize, u: &[f64]| dot(u, &self.along(base, &[], 0).residual[0]);
        self.cokernel().iter().all(|u| {
            let here = part(0, u);
            let apart = (1..self.num_bases()).map(|b| (part(b, u) - here).abs());
            here.abs() <= self.error + SAFETY * apart.fold(0.0, f64::max)
        })
    }

    /// Dimension of the kernel.
    pub(super) fn dimension(&self) -> usize {
        self.units.len() - self.rank
    }

    /// Orthonormal basis of the kernel.
    pub(super) fn kernel(&self) -> &[Vec<f64>] {
        &self.svd.right[self.rank..]
    }

    /// Orthonormal basis of the kernel of the transpose.
    pub(super) fn cokernel(&self) -> &[Vec<f64>] {
        &self.svd.left[self.rank..]
    }

    /// The vector w orthogonal to the kernel with J w = −r, as far as r is in the range of J; J is that of one of the bases.
    pub(super) fn solve(&self, base: usize, r: &[f64]) -> Vec<f64> {
        let mut w = vec![0.0; self.units.len()];
        let mut left = r.to_vec();
        // The second pass corrects the first by what it leaves, with the Jacobian of the base.
        for _ in 0..2 {
            for (v, sigma) in self.svd.right[..self.rank].iter().zip(&self.svd.values) {
                let mut image = vec![0.0; r.len()];
                self.jacobians[0].mul_vec(v, &mut image);
                let share = -dot(&image, &left) / (sigma * sigma);
                w.iter_mut().zip(v).for_each(|(w, v)| *w += share * v);
            }
            left.copy_from_slice(r);
            let mut image = vec![0.0; r.len()];
            self.jacobians[base].mul_vec(&w, &mut image);
            left.iter_mut().zip(&image).for_each(|(l, i)| *l += i);
        }
        w
    }

    /// The kernel vector nearest to a direction at one of the bases.
    pub(super) fn kernel_near(&self, base: usize, direction: &[f64]) -> Vec<f64> {
        let mut image = vec![0.0; self.rows.len()];
        self.jacobians[base].mul_vec(direction, &mut image);
        let correction = self.solve(base, &image);
        let mut t: Vec<f64> = direction.iter().zip(&correction).map(|(d, c)| d + c).collect();
        let length = norm(&t);
        t.iter_mut().for_each(|t| *t /= length);
        t
    }

    pub(super) fn num_bases(&self) -> usize {
        self.bases.len()
    }

    /// Taylor coefficients along base + Σ arc[k − 1] s^k, up to an order of at most 4.
    pub(super) fn along(&self, base: usize, arc: &[&[f64]], order: usize) -> Coefficients {
        let (n, tests) = (self.rows.len(), self.frame.tests);
        let unscaled = |v: &&[f64]| -> Vec<f64> { v.iter().zip(&self.units).map(|(v, u)| v * u).collect() };
        let terms: Vec<Vec<f64>> = arc.iter().map(unscaled).collect();
        let mut all: Vec<&[f64]> = vec![&self.bases[base]];
        all.extend(terms.iter().take(order).map(Vec::as_slice));
        let (mut residual, mut values) = (vec![0.0; TERMS * n], vec![0.0; TERMS * tests]);
        let exactness = along(&self.frame.map, self.selection, &all, &mut residual, &mut values);
        let (mut errors, mut noise) = (vec![0.0; TERMS * tests], self.noise.get());
        if let Exactness::Estimated { residual, tests } = exactness {
            errors = tests;
            for (own, factor) in residual.chunks_exact(TERMS).zip(&self.rows) {
                noise = own[2..=order.max(2)].iter().fold(noise, |m, e| m.max(e * factor));
            }
            self.noise.set(noise);
        }
        let vanishing = self.frame.vanishing;
        Coefficients {
            residual: (0..=order)
                .map(|k| (0..n).map(|i| residual[TERMS * i + k] * self.rows[i]).collect())
                .collect(),
            tests: (0..=order)
                .map(|k| vanishing.iter().map(|t| values[TERMS * t + k]).collect())
                .collect(),
            errors: (0..=order)
                .map(|k| vanishing.iter().map(|t| errors[TERMS * t + k]).collect())
                .collect(),
        }
    }

    /// α along an arc, relative to its value at the point, and the vanishing test functions, with their errors; the arc computed from each base.
    pub(super) fn values(&self, arcs: &[Arc]) -> Followed {
        let each: Vec<Along> = (arcs.iter().enumerate())
            .map(|(b, a)| self.values_at(b, a))
            .collect();
        let sizes = self.gradient_sizes();
        let value = |own: (f64, f64), size: f64, others: &mut dyn Iterator<Item = f64>| {
            let apart = others.map(|o| (o - own.0).abs()).fold(0.0, f64::max);
            Value {
                value: own.0,
                error: own.1 + SAFETY * f64::EPSILON * size + SAFETY.sqrt() * apart,
            }
        };
        let last = self.units.last().copied().unwrap_or(1.0);
        let size = |k: usize| arcs[0].size(k);
        let orders = each[0].alpha.len();
        let alpha = |k: usize| {
            let own = (each[0].alpha[k], 0.0);
            value(own, last * size(k), &mut each[1..].iter().map(|e| e.alpha[k]))
        };
        let test = |v: usize, k: usize| {
            let own = (each[0].tests[v][k].0, each[0].tests[v][k].1);
            value(
                own,
                sizes[v] * size(k),
                &mut each[1..].iter().map(|e| e.tests[v][k].0),
            )
        };
        let theta = self
            .frame
            .vanishing
            .iter()
            .map(|&index| self.frame.theta[index].abs());
        Followed {
            roundings: theta
                .zip(&sizes)
                .map(|(theta, size)| theta + SAFETY * f64::EPSILON * size)
                .collect(),
            alpha: (0..orders).map(alpha).collect(),
            tests: (0..sizes.len())
                .map(|v| (0..orders).map(|k| test(v, k)).collect())
                .collect(),
        }
    }

    /// Sizes of the gradients of the vanishing test functions in the units of the variables.
    fn gradient_sizes(&self) -> Vec<f64> {
        let mut sizes = vec![0.0_f64; self.frame.vanishing.len()];
        for second in [false, true] {
            let direction: Vec<f64> = (0..self.units.len())
                .map(|j| 2.0 * centred(j + 1, second))
                .collect();
            let found = self.along(0, &[&direction], 1);
            sizes
                .iter_mut()
                .zip(&found.tests[1])
                .for_each(|(s, t)| *s = s.max(t.abs()));
        }
        sizes
    }

    fn values_at(&self, base: usize, arc: &Arc) -> Along {
        let last = self.units.last().copied().unwrap_or(1.0);
        let alpha = |v: &[f64]| last * v.last().copied().unwrap_or(0.0);
        let vanishing = 0..self.frame.vanishing.len();
        if let Some(half) = &arc.half {
            let rates = |d: &[f64]| self.along(base, &[d], 1);
            let (first, second) = (rates(&arc.terms[0]), rates(half));
            let of = |v: usize| {
                [&first, &second]
                    .map(|c| (c.tests[1][v], c.errors[1][v]))
                    .to_vec()
            };
            return Along {
                alpha: vec![alpha(&arc.terms[0]), alpha(half)],
                tests: vanishing.map(of).collect(),
            };
        }
        let order = arc.terms.len();
        let terms: Vec<&[f64]> = arc.terms.iter().map(Vec::as_slice).collect();
        let found = self.along(base, &terms, order);
        let of = |v: usize| {
            (1..=order)
                .map(|k| (found.tests[k][v], found.errors[k][v]))
                .collect()
        };
        Along {
            alpha: arc.terms.iter().map(|t| alpha(t)).collect(),
            tests: vanishing.map(of).collect(),
        }
    }

    /// An arc of displacements in the variables of the map.
    pub(super) fn unscaled(&self, arc: &Arc) -> Arc {
        let mut arc = arc.clone();
        for term in arc.terms.iter_mut().chain(&mut arc.half) {
            term.iter_mut().zip(&self.units).for_each(|(t, u)| *t *= u);
        }
        arc
    }
}

/// Coefficients of α and of the vanishing test functions along an arc at one base; these with estimated errors.
struct Along {
    alpha: Vec<f64>,
    tests: Vec<Vec<(f64, f64)>>,
}

/// Functions along an arc: coefficients of α and of each vanishing test function.
pub(super) struct Followed {
    pub(super) alpha: Vec<Value>,
    pub(super) tests: Vec<Vec<Value>>,
    /// What the test functions are at the point, and the rounding of their terms.
    pub(super) roundings: Vec<f64>,
}

/// How far the point of a frame may be off, beyond rounding, in these units.
fn off(frame: &Frame<'_>, units: &[f64]) -> f64 {
    let each = frame.met.iter().map(|v| {
        let gradient: Vec<f64> = v.gradient.iter().zip(units).map(|(g, unit)| g * unit).collect();
        frame.theta[v.index].abs() / norm(&gradient)
    });
    each.filter(|off| off.is_finite()).fold(frame.off, f64::max)
}

fn bases(x: &[f64], units: &[f64], off: f64) -> Vec<Vec<f64>> {
    let mut bases = vec![x.to_vec()];
    for k in 0..BESIDE {
        let beside = x.iter().zip(units).enumerate().map(|(j, (x, unit))| {
            let sign = 2.0 * centred(j + 1, k % 2 == 1);
            x + sign * unit * (SAFETY * f64::EPSILON + off)
        });
        bases.push(beside.collect());
    }
    bases
}

#[cfg(test)]
mod tests {
    use super::{Extension, Frame};
    use crate::continuation::testing::{Function, Plane};
    use crate::piecewise::Selection;

    fn units(function: Function, x: [f64; 2]) -> Vec<f64> {
        let map = Plane::smooth(function);
        let frame = Frame {
            map: &map,
            x: &x,
            vanishing: &[],
            tests: 0,
            met: &[],
            theta: &[],
            off: 0.0,
        };
        Extension::new(&frame, &Selection::uniform(1, 0)).unwrap().units
    }

    /// Where both variables are 0 their sizes have the product 1 and make both terms of a row equal, up to a factor of two; where H is
    /// homogeneous in a variable that is 0 nothing tells its size.
    #[test]
    fn units_are_told_by_the_terms_of_a_row() {
        const FAR: f64 = (1_u64 << 40) as f64;
        // (y / 2⁴⁰)² = 2⁴⁰ α, and with a cube: y = 2⁴⁰ and α = 2⁻⁴⁰ give 1 = 1.
        let square: Function = |y, a| {
            let z = y / FAR;
            [z * z - FAR * a, 2.0 * z / FAR, -FAR]
        };
        let cube: Function = |y, a| {
            let z = y / FAR;
            [z * z * z - FAR * a, 3.0 * z * z / FAR, -FAR]
        };
        for function in [square, cube] {
            let found = units(function, [0.0, 0.0]);
            let near = |a: f64, b: f64| (0.25..=4.0).contains(&(a / b));
            assert!(near(found[0], FAR) && near(found[1], FAR.recip()), "{found:?}");
        }
        let homogeneous: Function = |y, a| [y * (a - 300.0), a - 300.0, y];
        assert_eq!(units(homogeneous, [0.0, 5.0]), [1.0, 4.0]);
    }
}
