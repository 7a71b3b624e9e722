//! The smooth extension of one selection near a point: its Jacobian in balanced units with the errors of its entries, its kernels, and
//! Taylor coefficients along arcs.

use super::arc::{Arc, Value};
use crate::linear::{Decomposition, decompose};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, dot, norm};
use crate::spread::centred;

/// Rounding errors of a coordinate by which a point found to rounding may be off, and the factor by which differences between
/// computations from such points may be smaller than the errors that they stand for.
const SAFETY: f64 = 64.0;
/// Displacement, in balanced units, over which the change of a row of the Jacobian is its size where the row itself vanishes.
const APART: f64 = 1.0 / 1024.0;
/// Number of points beside the given one from which everything is computed again.
const BESIDE: usize = 2;

/// Highest order of the coefficients.
pub(super) const ORDER: usize = 4;

/// A point, the units of its variables and points that rounding may have put in its place.
pub(super) struct Frame<'a> {
    pub(super) map: &'a dyn PiecewiseSmooth,
    pub(super) x: &'a [f64],
    /// Positions of the test functions that vanish there.
    pub(super) vanishing: &'a [usize],
    /// Number of all test functions.
    pub(super) tests: usize,
    /// How far x may be off, beyond rounding.
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
}

/// Coefficients of H and of the vanishing test functions along an arc: `residual[k]` and `tests[k]` are those of s^k.
pub(super) struct Coefficients {
    pub(super) residual: Vec<Vec<f64>>,
    pub(super) tests: Vec<Vec<f64>>,
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
        let units = units(&jac, x);
        let apart = |sign: f64| -> Vec<f64> {
            let all = x.iter().zip(&units).enumerate();
            all.map(|(j, (x, unit))| x + sign * APART * unit * (1.0 + centred(j + 1, false))).collect()
        };
        let (mut ahead, mut behind) = (jac.clone(), jac.clone());
        at(&apart(1.0), &mut ahead)?;
        at(&apart(-1.0), &mut behind)?;
        let mut rows = vec![0.0_f64; jac.nrows()];
        let changes = ahead.values().iter().zip(behind.values()).map(|(a, b)| (a - b).abs());
        for ((i, j, v), change) in jac.triplets().zip(changes) {
            rows[i] = rows[i].max(v.abs() * units[j]).max(0.5 / APART * change * units[j]);
        }
        rows.iter_mut().for_each(|r| *r = if *r > 0.0 && r.is_finite() { r.recip() } else { 1.0 });
        let mut this = Self {
            frame,
            selection,
            bases: bases(x, &units, frame.off),
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
        jac.values_mut().iter_mut().zip(factors).for_each(|(v, f)| *v *= f);
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

    /// Whether a smaller rank is within the errors of the entries, too.
    pub(super) fn doubtful_rank(&self) -> Option<usize> {
        let least = self.rank.checked_sub(1).map(|k| self.svd.values[k])?;
        (least <= SAFETY * self.error).then(|| self.rank - 1)
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
        let unscaled = |v: &&[f64]| -> Vec<f64> { v.iter().zip(&self.units).map(|(v, u)| v * u).collect() };
        let terms: Vec<Vec<f64>> = arc.iter().map(unscaled).collect();
        let mut all: Vec<&[f64]> = vec![&self.bases[base]];
        all.extend(terms.iter().take(order).map(Vec::as_slice));
        let mut found = taylor(self.frame, self.selection, &all, order);
        for residual in &mut found.residual {
            residual.iter_mut().zip(&self.rows).for_each(|(r, f)| *r *= f);
        }
        found
    }

    /// α along an arc, relative to its value at the point, and the vanishing test functions, with their errors.
    pub(super) fn values(&self, arcs: &[Arc]) -> Followed {
        let each: Vec<(Vec<f64>, Vec<Vec<f64>>)> = (arcs.iter().enumerate()).map(|(b, a)| self.values_at(b, a)).collect();
        let (alpha, tests) = &each[0];
        let value = |own: f64, size: f64, others: &mut dyn Iterator<Item = f64>| {
            let apart = others.map(|o| (o - own).abs()).fold(0.0, f64::max);
            Value {
                value: own,
                error: SAFETY * f64::EPSILON * size + SAFETY.sqrt() * apart,
            }
        };
        let last = self.units.last().copied().unwrap_or(1.0);
        let size = |k: usize| arcs[0].size(k);
        Followed {
            alpha: (0..alpha.len())
                .map(|k| value(alpha[k], last * size(k), &mut each[1..].iter().map(|e| e.0[k])))
                .collect(),
            tests: (0..tests.len())
                .map(|v| {
                    let gradient = self.gradient_size(v);
                    (0..tests[v].len())
                        .map(|k| value(tests[v][k], gradient * size(k), &mut each[1..].iter().map(|e| e.1[v][k])))
                        .collect()
                })
                .collect(),
        }
    }

    /// Size of the gradient of a vanishing test function in the units of the variables.
    fn gradient_size(&self, v: usize) -> f64 {
        let mut sum = 0.0_f64;
        for second in [false, true] {
            let direction: Vec<f64> = (0..self.units.len()).map(|j| 2.0 * centred(j + 1, second)).collect();
            let found = self.along(0, &[&direction], 1);
            sum = sum.max(found.tests[1][v].abs());
        }
        sum
    }

    fn values_at(&self, base: usize, arc: &Arc) -> (Vec<f64>, Vec<Vec<f64>>) {
        let last = self.units.last().copied().unwrap_or(1.0);
        let alpha = |v: &[f64]| last * v.last().copied().unwrap_or(0.0);
        if let Some(half) = &arc.half {
            let rates = |d: &[f64]| self.along(base, &[d], 1).tests.swap_remove(1);
            let (first, second) = (rates(&arc.terms[0]), rates(half));
            let tests = first.iter().zip(&second).map(|(a, b)| vec![*a, *b]).collect();
            return (vec![alpha(&arc.terms[0]), alpha(half)], tests);
        }
        let order = arc.terms.len();
        let terms: Vec<&[f64]> = arc.terms.iter().map(Vec::as_slice).collect();
        let found = self.along(base, &terms, order);
        let tests = (0..self.frame.vanishing.len())
            .map(|v| (1..=order).map(|k| found.tests[k][v]).collect())
            .collect();
        (arc.terms.iter().map(|t| alpha(t)).collect(), tests)
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

/// Functions along an arc: coefficients of α and of each vanishing test function.
pub(super) struct Followed {
    pub(super) alpha: Vec<Value>,
    pub(super) tests: Vec<Vec<Value>>,
}

/// The size of each variable: its own or, where that is smaller, the change that rounding of the terms of a row cannot tell from it; where
/// nothing is known, 1.
fn units(jac: &Matrix, x: &[f64]) -> Vec<f64> {
    let mut terms = vec![0.0_f64; jac.nrows()];
    let lengths: Vec<f64> = x.iter().map(|x| x.abs()).collect();
    jac.as_ref().add_term_sizes(&lengths, &mut terms);
    let mut least = vec![f64::INFINITY; x.len()];
    for (i, j, v) in jac.triplets() {
        if v != 0.0 && terms[i] > 0.0 {
            least[j] = least[j].min(terms[i] / v.abs());
        }
    }
    let unit = |(x, least): (&f64, &f64)| {
        let known = if least.is_finite() { x.abs().max(*least) } else { x.abs().max(1.0) };
        if known > 0.0 { known.log2().round().exp2() } else { 1.0 }
    };
    x.iter().zip(&least).map(unit).collect()
}

fn bases(x: &[f64], units: &[f64], off: f64) -> Vec<Vec<f64>> {
    let mut bases = vec![x.to_vec()];
    for k in 0..BESIDE {
        let beside = x.iter().zip(units).enumerate().map(|(j, (x, unit))| {
            let sign = 2.0 * centred(j + 1, k % 2 == 1);
            x + sign * (SAFETY * f64::EPSILON * unit + off)
        });
        bases.push(beside.collect());
    }
    bases
}

/// Coefficients of H^(σ) and of the vanishing test functions along x(s) = Σ arc[k] s^k.
fn taylor(frame: &Frame<'_>, selection: &Selection, arc: &[&[f64]], order: usize) -> Coefficients {
    let (map, n) = (frame.map, frame.map.num_residuals());
    differences(map, frame, selection, arc, order, n)
}

/// By central differences of ∇H^(σ)(x(s)) x′(s) and of the rates of the test functions.
fn differences(
    map: &dyn PiecewiseSmooth,
    frame: &Frame<'_>,
    selection: &Selection,
    arc: &[&[f64]],
    order: usize,
    n: usize,
) -> Coefficients {
    const H: f64 = 1.0 / 128.0;
    let m = arc[0].len();
    let mut jac = Matrix::zeros(map.pattern());
    let mut at = |s: f64| {
        let (mut x, mut d) = (arc[0].to_vec(), vec![0.0; m]);
        for (k, term) in arc.iter().enumerate().skip(1) {
            let (power, slope) = (s.powi(k as i32), k as f64 * s.powi(k as i32 - 1));
            for j in 0..m {
                x[j] += power * term[j];
                d[j] += slope * term[j];
            }
        }
        jac.clear();
        map.jacobian(selection, &x, &mut jac);
        let (mut image, mut rates) = (vec![0.0; n], vec![0.0; frame.tests]);
        jac.mul_vec(&d, &mut image);
        map.tests_of_selection(selection, &x, Some(&d), &mut rates);
        image.extend(frame.vanishing.iter().map(|&k| rates[k]));
        image
    };
    let (mut residual, mut tests) = (vec![0.0; n], vec![0.0; frame.tests]);
    map.residual(selection, arc[0], &mut residual);
    map.tests_of_selection(selection, arc[0], None, &mut tests);
    let mut found = Coefficients {
        residual: vec![residual],
        tests: vec![frame.vanishing.iter().map(|&k| tests[k]).collect()],
    };
    let curved = order > 1 && !map.is_piecewise_affine();
    let f0 = at(0.0);
    let mut push = |values: Vec<f64>| {
        found.tests.push(values[n..].to_vec());
        found.residual.push(values[..n].to_vec());
    };
    if !curved {
        push(f0);
        for k in 2..=order {
            // The image of the term itself: nothing else is left on affine pieces.
            let mut only = vec![arc[0].to_vec()];
            only.extend(arc.get(k).map(|t| t.to_vec()));
            let mut values = vec![0.0; n + frame.vanishing.len()];
            if let Some(term) = only.get(1) {
                jac.mul_vec(term, &mut values[..n]);
                let mut rates = vec![0.0; frame.tests];
                map.tests_of_selection(selection, arc[0], Some(term), &mut rates);
                for (v, &k) in values[n..].iter_mut().zip(frame.vanishing) {
                    *v = rates[k];
                }
            }
            found.tests.push(values[n..].to_vec());
            found.residual.push(values[..n].to_vec());
        }
        return found;
    }
    let [a, b, c, d] = [-2.0 * H, -H, H, 2.0 * H].map(&mut at);
    let combine = |weights: [f64; 5], divisor: f64| -> Vec<f64> {
        (0..f0.len())
            .map(|i| (weights[0] * a[i] + weights[1] * b[i] + weights[2] * f0[i] + weights[3] * c[i] + weights[4] * d[i]) / divisor)
            .collect()
    };
    push(f0.clone());
    push(combine([1.0, -8.0, 0.0, 8.0, -1.0], 12.0 * H * 2.0));
    if order > 2 {
        push(combine([-1.0, 16.0, -30.0, 16.0, -1.0], 12.0 * H * H * 6.0));
    }
    if order > 3 {
        push(combine([-1.0, 2.0, 0.0, -2.0, 1.0], 2.0 * H * H * H * 24.0));
    }
    found
}
