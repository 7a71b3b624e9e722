//! The extended system of a simple branch point, and whether its solution is one.

use crate::continuation::ContinuationError;
use crate::linear::{DenseLu, LinearSolver, null_space};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern, dot};

/// |β|, in rounding errors of the terms of wᵀH, up to which β is zero.
const ROUNDING: f64 = 64.0;
/// Smallest unit of a variable, relative to the largest.
const SMALLEST: f64 = 1e-4;
/// Step of the differences, in units of the variables.
const DIFFERENCE: f64 = 6e-6;

/// A solution (x, β, w) of H(x) + β w = 0, ∇H(x)ᵀ w = 0, wᵀw = 1.
pub(in crate::continuation) struct Singular {
    pub(in crate::continuation) x: Vec<f64>,
    /// Whether β vanishes to rounding. Else x is a singular point of H = −β w, next to which two curves of H = 0 pass each other.
    pub(in crate::continuation) on_curve: bool,
}

/// The extended system of a simple branch point (A. Griewank and G. W. Reddien 1984, doi:10.1137/0721043): H(x) + β w = 0,
/// ∇H(x)ᵀ w = 0, wᵀw = 1, which is regular there. Anything that solves with ∇H stops at the square root of the rounding unit.
///
/// Rows and variables are scaled by their sizes between `from`, a point of the curve, and the guess, so that nothing depends on
/// units. Dense.
pub(in crate::continuation) struct BranchSystem<'m, P: ?Sized> {
    map: &'m P,
    selection: &'m Selection,
    /// Factors of the rows, units of the variables.
    rows: Vec<f64>,
    units: Vec<f64>,
    jac: Matrix,
    system: Matrix,
    rhs: Vec<f64>,
}

impl<'m, P: PiecewiseSmooth + ?Sized> BranchSystem<'m, P> {
    pub(in crate::continuation) fn new(
        map: &'m P,
        selection: &'m Selection,
        from: &[f64],
        guess: &[f64],
    ) -> Self {
        let (n, m) = (map.num_residuals(), map.num_vars());
        let mut units: Vec<f64> = guess
            .iter()
            .zip(from)
            .map(|(g, f)| g.abs() + (g - f).abs())
            .collect();
        let largest = units.iter().fold(f64::MIN_POSITIVE, |a, u| a.max(*u));
        units.iter_mut().for_each(|u| *u = u.max(SMALLEST * largest));
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(selection, from, &mut jac);
        let mut rows = vec![0.0f64; n];
        for (i, j, v) in jac.triplets() {
            rows[i] = rows[i].max(v.abs() * units[j]);
        }
        rows.iter_mut()
            .for_each(|r| *r = if *r > 0.0 { r.recip() } else { 1.0 });
        let order = n + m + 1;
        Self {
            map,
            selection,
            rows,
            units,
            jac,
            system: Matrix::zeros(Pattern::full(order, order)),
            rhs: vec![0.0; order],
        }
    }

    /// The solution next to `guess` by Newton's method, if that converges quickly: where the solution is regular.
    pub(in crate::continuation) fn solve(
        &mut self,
        guess: &[f64],
    ) -> Result<Option<Singular>, ContinuationError> {
        const LIMIT: usize = 15;
        const SETTLED: f64 = 1e-9;
        let (n, m) = (self.rows.len(), self.units.len());
        self.linearize(guess);
        let kernels = null_space(&self.jac, 1.0).map_err(PiecewiseError::from)?;
        let Some(mut w) = kernels.left.last().cloned() else {
            return Ok(None);
        };
        let (mut x, mut beta, mut last) = (guess.to_vec(), 0.0, f64::INFINITY);
        let mut solver = DenseLu::default();
        solver
            .analyze(self.system.pattern().as_ref())
            .map_err(PiecewiseError::from)?;
        for _ in 0..LIMIT {
            self.assemble(&x, beta, &w);
            if solver.factor(self.system.as_ref()).is_err() || solver.solve_in_place(&mut self.rhs).is_err() {
                return Ok(None);
            }
            let (dx, rest) = self.rhs.split_at(m);
            for ((x, d), unit) in x.iter_mut().zip(dx).zip(&self.units) {
                *x -= unit * d;
            }
            beta -= rest[0];
            w.iter_mut().zip(&rest[1..]).for_each(|(w, d)| *w -= d);
            let step = (dx.iter().chain(&rest[1..])).fold(0.0f64, |a, d| a.max(d.abs()));
            if !step.is_finite() {
                return Ok(None);
            }
            if step <= f64::EPSILON || (step >= 0.5 * last && step <= SETTLED) {
                last = step;
                break;
            }
            last = step;
        }
        if last > SETTLED {
            return Ok(None);
        }
        // Nothing below rounding of the units is known.
        for (x, unit) in x.iter_mut().zip(&self.units) {
            if x.abs() <= f64::EPSILON * unit {
                *x = 0.0;
            }
        }
        self.assemble(&x, beta, &w);
        let rounding = ROUNDING * f64::EPSILON * self.terms(&w) + 4.0 * self.noise(&x, &w);
        debug_assert_eq!(w.len(), n);
        Ok(Some(Singular {
            on_curve: beta.abs() <= rounding,
            x,
        }))
    }

    /// ∇H(x), scaled.
    fn linearize(&mut self, x: &[f64]) {
        self.jac.clear();
        self.map.jacobian(self.selection, x, &mut self.jac);
        self.jac.scale_columns(&self.units);
        let factors: Vec<f64> = self.jac.triplets().map(|(i, ..)| self.rows[i]).collect();
        let values = self.jac.values_mut().iter_mut();
        values.zip(factors).for_each(|(v, f)| *v *= f);
    }

    /// H(x), scaled.
    fn residual(&self, x: &[f64], r: &mut [f64]) {
        self.map.residual(self.selection, x, r);
        r.iter_mut().zip(&self.rows).for_each(|(r, f)| *r *= f);
    }

    fn assemble(&mut self, x: &[f64], beta: f64, w: &[f64]) {
        let (n, m) = (w.len(), x.len());
        self.system.clear();
        // d(∇Hᵀw)/dx by differences: it only drives Newton's method, the residual below is exact.
        let mut y = x.to_vec();
        let mut products = [vec![0.0; m], vec![0.0; m]];
        for j in 0..m {
            let h = DIFFERENCE * self.units[j];
            for (product, shift) in products.iter_mut().zip([h, -h]) {
                y[j] = x[j] + shift;
                self.linearize(&y);
                self.jac.mul_transpose_vec(w, product);
            }
            y[j] = x[j];
            for i in 0..m {
                let slope = (products[0][i] - products[1][i]) / (2.0 * DIFFERENCE);
                self.system.add(n + i, j, slope);
            }
        }
        self.linearize(x);
        for (i, j, v) in self.jac.triplets() {
            self.system.add(i, j, v);
            self.system.add(n + j, m + 1 + i, v);
        }
        for i in 0..n {
            self.system.add(i, m, w[i]);
            self.system.add(i, m + 1 + i, beta);
            self.system.add(n + m, m + 1 + i, 2.0 * w[i]);
        }
        let mut r = std::mem::take(&mut self.rhs);
        self.residual(x, &mut r[..n]);
        for i in 0..n {
            r[i] += beta * w[i];
        }
        self.jac.mul_transpose_vec(w, &mut r[n..n + m]);
        r[n + m] = dot(w, w) - 1.0;
        self.rhs = r;
    }

    /// Size of the terms of wᵀH at the point assembled last, up to second order: they cancel there and along the curve.
    fn terms(&self, w: &[f64]) -> f64 {
        let (n, m) = (w.len(), self.units.len());
        let first: f64 = self.jac.triplets().map(|(i, _, v)| (w[i] * v).abs()).sum();
        let second: f64 = (self.system.triplets())
            .filter(|(i, j, _)| (n..n + m).contains(i) && *j < m)
            .map(|(.., v)| v.abs())
            .sum();
        first + 0.5 * second
    }

    /// Scatter of wᵀH in the last bits of x: rounding errors of H, as it varies by squares of distances only.
    fn noise(&self, x: &[f64], w: &[f64]) -> f64 {
        const SHIFTS: [f64; 4] = [1.0, -2.0, 3.0, -4.0];
        let mut r = vec![0.0; w.len()];
        self.residual(x, &mut r);
        let centre = dot(w, &r);
        let mut noise = 0.0f64;
        for (k, shift) in SHIFTS.into_iter().enumerate() {
            let alternate = |j: usize| if (j >> k) & 1 == 0 { shift } else { -shift };
            let moved = (x.iter().enumerate()).map(|(j, x)| x * (1.0 + alternate(j) * f64::EPSILON));
            self.residual(&moved.collect::<Vec<_>>(), &mut r);
            noise = noise.max((dot(w, &r) - centre).abs());
        }
        noise
    }
}

#[cfg(test)]
mod tests {
    use super::BranchSystem;
    use crate::continuation::testing::{Function, Plane};
    use crate::piecewise::Selection;

    /// Two lines cross at (1/3, 1/7). Whether H is evaluated plainly, or with terms a hundred thousand times larger that cancel and leave their
    /// rounding in it, the crossing is one; 1e-6 beside it H has no solution that is singular.
    #[test]
    fn rounding_of_the_evaluation_does_not_hide_a_branch_point() {
        fn crossing(y: f64, a: f64) -> [f64; 3] {
            let (u, v) = (y - 1.0 / 3.0, a - 1.0 / 7.0);
            [u * u - v * v, 2.0 * u, -2.0 * v]
        }
        let plain: Function = crossing;
        let noisy: Function = |y, a| {
            let [h, dy, da] = crossing(y, a);
            [(1e5 * y + (h + 1e5 * a)) - 1e5 * (y + a), dy, da]
        };
        let apart: Function = |y, a| {
            let [h, dy, da] = crossing(y, a);
            [h + 1e-6, dy, da]
        };
        for (piece, on_curve) in [(plain, true), (noisy, true), (apart, false)] {
            let map = Plane::within(piece, &[]);
            let selection = Selection::uniform(1, 0);
            for k in 1..20 {
                let d = 1e-3 * f64::from(k);
                let (from, guess) = (
                    [1.0 / 3.0 + 0.3, 1.0 / 7.0 + 0.3],
                    [1.0 / 3.0 + d, 1.0 / 7.0 - 0.3 * d],
                );
                let mut system = BranchSystem::new(&map, &selection, &from, &guess);
                let found = system.solve(&guess).unwrap().unwrap();
                assert_eq!(found.on_curve, on_curve, "{k} {:?}", found.x);
                assert!((found.x[0] - 1.0 / 3.0).abs() + (found.x[1] - 1.0 / 7.0).abs() < 1e-9);
            }
        }
    }

    /// Two lines cross at the origin, where all terms of first order vanish and no last bit of x moves H: what H is off by counts against its
    /// terms of second order.
    #[test]
    fn terms_of_second_order_measure_what_is_rounding() {
        let rounding: Function = |y, a| [(y - a) * (y + a) + 1e-17, 2.0 * y, -2.0 * a];
        let apart: Function = |y, a| [(y - a) * (y + a) + 1e-13, 2.0 * y, -2.0 * a];
        for (piece, on_curve) in [(rounding, true), (apart, false)] {
            let map = Plane::within(piece, &[]);
            let selection = Selection::uniform(1, 0);
            let guess = [1e-3, -0.7e-3];
            let mut system = BranchSystem::new(&map, &selection, &[0.3, 0.3], &guess);
            let found = system.solve(&guess).unwrap().unwrap();
            assert_eq!(
                (found.x.as_slice(), found.on_curve),
                ([0.0; 2].as_slice(), on_curve)
            );
        }
    }
}
