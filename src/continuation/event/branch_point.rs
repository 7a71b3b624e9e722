//! The extended system of a simple branch point, and whether its solution is one.

use crate::InputError;
use crate::linear::{AutoSolver, Bordered, LinearError, LinearSolver};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection};
use crate::sparse::{Matrix, Pattern, dot, max_abs, norm};
use crate::spread::centred;
use crate::tolerances::{CENTRAL, HALF_DIGITS, ROUNDING};

/// Smallest unit of a variable, relative to the largest.
const SMALLEST: f64 = 1e-4;

/// A solution (x, β) of H(x) + β e_k = 0, wᵀ∇H(x) = 0 with w_k = 1.
pub(in crate::continuation) struct Singular {
    pub(in crate::continuation) x: Vec<f64>,
    /// Whether H vanishes to rounding. Else x is a singular point of H = −β e_k, next to which two curves of H = 0 pass each other.
    pub(in crate::continuation) on_curve: bool,
    /// Whether it is a simple branch point.
    pub(in crate::continuation) simple: bool,
}

/// Orthonormal bases of the kernels of ∇H and ∇Hᵀ.
pub(in crate::continuation) struct Kernels {
    pub(in crate::continuation) right: [Vec<f64>; 2],
    pub(in crate::continuation) left: Vec<f64>,
}

/// The extended system of a simple branch point, where ∇H has a kernel of dimension 2 (A. Griewank and G. W. Reddien 1984,
/// doi:10.1137/0721043): H(x) + β e_k = 0, g(x) = 0. Two columns i, j of ∇H are left out and e_k is put in their place, which makes a regular
/// matrix N; Nᵀw is the unit vector of e_k, and g = (wᵀ∂ᵢH, wᵀ∂ⱼH) vanishes with wᵀ∇H. The system is regular at a simple branch point, where
/// methods that solve with ∇H reach only the square root of the rounding unit.
///
/// Newton's method by block elimination: all systems are solved with N, which is as sparse as ∇H.
///
/// Rows and variables are scaled by their sizes between `from`, a point of the curve, and the guess, so that nothing depends on units.
pub(in crate::continuation) struct BranchSystem<'m, P: ?Sized> {
    map: &'m P,
    selection: &'m Selection,
    /// Factors of the rows, units of the variables.
    rows: Vec<f64>,
    units: Vec<f64>,
    jac: Matrix,
    /// i and j; k.
    columns: [usize; 2],
    row: usize,
    /// N.
    core: Matrix,
    solver: AutoSolver,
    w: Vec<f64>,
    /// Solutions of ∇H v = −h e_k with (vᵢ, vⱼ) = (1, 0) and (0, 1), and their h.
    kernel: [(Vec<f64>, f64); 2],
    /// Derivatives of g.
    slopes: [Vec<f64>; 2],
    values: Vec<f64>,
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
        Self {
            map,
            selection,
            rows,
            units,
            jac,
            columns: [0, 1],
            row: 0,
            core: Matrix::zeros(Pattern::full(0, 0)),
            solver: AutoSolver::new(),
            w: vec![0.0; n],
            kernel: [(vec![0.0; m], 0.0), (vec![0.0; m], 0.0)],
            slopes: [vec![0.0; m], vec![0.0; m]],
            values: vec![0.0; n],
        }
    }

    /// The solution next to `guess` by Newton's method, if that converges quickly: where the solution is regular.
    pub(in crate::continuation) fn solve(
        &mut self,
        guess: &[f64],
    ) -> Result<Option<Singular>, PiecewiseError> {
        const LIMIT: usize = 15;
        const SETTLED: f64 = 1e-9;
        if !self.choose(guess)? {
            return Ok(None);
        }
        let (mut x, mut last) = (guess.to_vec(), f64::INFINITY);
        let mut dx = vec![0.0; x.len()];
        for _ in 0..LIMIT {
            if !self.step(&x, &mut dx)? {
                return Ok(None);
            }
            for ((x, d), unit) in x.iter_mut().zip(&dx).zip(&self.units) {
                *x += unit * d;
            }
            let step = max_abs(&dx);
            let settled = step <= f64::EPSILON || (step >= 0.5 * last && step <= SETTLED);
            last = step;
            if settled {
                break;
            }
        }
        if last > SETTLED {
            return Ok(None);
        }
        // Derivatives below rounding in these units are not known.
        for (x, unit) in x.iter_mut().zip(&self.units) {
            if x.abs() <= f64::EPSILON * unit {
                *x = 0.0;
            }
        }
        if !self.linear(&x)? {
            return Ok(None);
        }
        let length = norm(&self.w);
        self.w.iter_mut().for_each(|w| *w /= length);
        let mut r = std::mem::take(&mut self.values);
        self.residual(&x, &mut r);
        let beta = dot(&self.w, &r);
        self.values = r;
        let rounding = ROUNDING * self.terms(length) + 4.0 * self.noise(&x);
        Ok(Some(Singular {
            on_curve: beta.abs() <= rounding,
            simple: true,
            x,
        }))
    }

    /// Orthonormal bases of the kernels of ∇H and ∇Hᵀ at x, where they have the dimensions 2 and 1; else `None`.
    pub(in crate::continuation) fn kernels(&mut self, x: &[f64]) -> Result<Option<Kernels>, PiecewiseError> {
        if !self.choose(x)? || !self.linear(x)? {
            return Ok(None);
        }
        if (self.kernel.iter()).any(|(v, h)| h.abs() > HALF_DIGITS * max_abs(v)) {
            return Ok(None);
        }
        let [mut first, mut second] = [0, 1].map(|a| -> Vec<f64> {
            let scaled = self.kernel[a].0.iter().zip(&self.units);
            scaled.map(|(v, unit)| v * unit).collect()
        });
        let mut left: Vec<f64> = self.w.iter().zip(&self.rows).map(|(w, row)| w * row).collect();
        let unit = |v: &mut [f64]| {
            let length = norm(v);
            v.iter_mut().for_each(|v| *v /= length);
        };
        unit(&mut left);
        unit(&mut first);
        // Twice is enough.
        for _ in 0..2 {
            let share = dot(&first, &second);
            second.iter_mut().zip(&first).for_each(|(v, u)| *v -= share * u);
            unit(&mut second);
        }
        let right = [first, second];
        Ok(Some(Kernels { right, left }))
    }

    /// Chooses i, j and k from the kernel of ∇H at x and the smallest singular vectors, by inverse iteration: a branch point is near.
    fn choose(&mut self, x: &[f64]) -> Result<bool, PiecewiseError> {
        const ITERATIONS: usize = 3;
        let (n, m) = (self.rows.len(), self.units.len());
        let mut bordered = Bordered::new(self.jac.pattern(), AutoSolver::new())?;
        // Where ∇H does not have full rank at the point itself, it has at a nearby point.
        let mut ready = false;
        for shift in [0.0, 1e-4, -1e-3] {
            let moved = (x.iter().zip(&self.units)).enumerate();
            let moved: Vec<f64> = moved
                .map(|(j, (x, unit))| x + shift * (1.0 + 0.1 * (j as f64).sin()) * unit)
                .collect();
            self.linearize(&moved);
            ready = found(bordered.factor(&self.jac, None))?.is_some();
            if ready {
                break;
            }
        }
        if !ready {
            return Ok(false);
        }
        let tangent = bordered.tangent().to_vec();
        let mut v: Vec<f64> = (0..m).map(|j| 1.0 + 0.5 * (1.7 * j as f64).sin()).collect();
        let mut w = vec![0.0; n];
        for _ in 0..ITERATIONS {
            let solved = bordered
                .solve_transpose(&v, &tangent, &mut w)
                .and_then(|_| normalise(&mut w))
                .and_then(|()| bordered.solve(&w, &tangent, 0.0, &mut v))
                .and_then(|()| normalise(&mut v));
            if found(solved)?.is_none() {
                return Ok(false);
            }
        }
        let largest = |v: &[f64]| (0..v.len()).max_by(|&a, &b| v[a].abs().total_cmp(&v[b].abs()));
        let (Some(i), Some(k)) = (largest(&tangent), largest(&w)) else {
            return Ok(false);
        };
        let share = v[i] / tangent[i];
        v.iter_mut().zip(&tangent).for_each(|(v, t)| *v -= share * t);
        v[i] = 0.0;
        let Some(j) = largest(&v).filter(|&j| j != i) else {
            return Ok(false);
        };
        (self.columns, self.row) = ([i.min(j), i.max(j)], k);
        let kept = self.jac.triplets().filter(|e| !self.columns.contains(&e.1));
        let entries: Vec<_> = kept
            .map(|(r, c, _)| (r, place(c, self.columns)))
            .chain([(k, n - 1)])
            .collect();
        let Ok(pattern) = Pattern::from_entries(n, n, entries) else {
            return Ok(false);
        };
        self.core = Matrix::zeros(pattern.clone());
        Ok(found(self.solver.analyze(pattern.as_ref()))?.is_some())
    }

    /// N at x, with w, the kernel and the derivatives of g; `false` where N is singular.
    fn linear(&mut self, x: &[f64]) -> Result<bool, PiecewiseError> {
        let n = self.rows.len();
        self.linearize(x);
        let columns = self.columns;
        self.core.clear();
        for (r, c, v) in self.jac.triplets().filter(|e| !columns.contains(&e.1)) {
            self.core.add(r, place(c, columns), v);
        }
        self.core.add(self.row, n - 1, 1.0);
        if found(self.solver.factor(self.core.as_ref()))?.is_none() {
            return Ok(false);
        }
        self.w.fill(0.0);
        self.w[n - 1] = 1.0;
        if found(self.solver.solve_transpose_in_place(&mut self.w))?.is_none() {
            return Ok(false);
        }
        let mut r = vec![0.0; n];
        for a in 0..2 {
            r.fill(0.0);
            for (i, _, v) in self.jac.triplets().filter(|e| e.1 == columns[a]) {
                r[i] -= v;
            }
            if found(self.solver.solve_in_place(&mut r))?.is_none() {
                return Ok(false);
            }
            let (v, h) = &mut self.kernel[a];
            spread(&r, columns, v);
            (v[columns[a]], *h) = (1.0, r[n - 1]);
        }
        for a in 0..2 {
            self.differentiate(x, a);
        }
        Ok(true)
    }

    /// The Newton step from x, in units of the variables; β, in which the system is linear, need not be stored. `false` where it is
    /// singular.
    fn step(&mut self, x: &[f64], dx: &mut [f64]) -> Result<bool, PiecewiseError> {
        if !self.linear(x)? {
            return Ok(false);
        }
        let mut r = std::mem::take(&mut self.values);
        self.residual(x, &mut r);
        r.iter_mut().for_each(|r| *r = -*r);
        let solved = found(self.solver.solve_in_place(&mut r))?.is_some();
        spread(&r, self.columns, dx);
        self.values = r;
        // N v = −∂ₐH with the last entry h: g = wᵀ∂ₐH = −h.
        let [(first, h0), (second, h1)] = &self.kernel;
        let at = |a: usize, v: &[f64]| dot(&self.slopes[a], v);
        let (a, b, c, d) = (at(0, first), at(0, second), at(1, first), at(1, second));
        let (r0, r1) = (h0 - at(0, dx), h1 - at(1, dx));
        let det = a * d - b * c;
        let (s, t) = ((r0 * d - b * r1) / det, (a * r1 - c * r0) / det);
        for (dx, (u, v)) in dx.iter_mut().zip(first.iter().zip(second)) {
            *dx += s * u + t * v;
        }
        Ok(solved && dx.iter().all(|d| d.is_finite()))
    }

    /// d(wᵀ∇H v)/dx with v of the kernel, w fixed, by differences: they only drive Newton's method, the residuals are exact.
    fn differentiate(&mut self, x: &[f64], a: usize) {
        let h = CENTRAL / max_abs(&self.kernel[a].0);
        let mut slope = std::mem::take(&mut self.slopes[a]);
        let mut back = vec![0.0; slope.len()];
        for (product, h) in [(&mut slope, h), (&mut back, -h)] {
            let moved = x.iter().zip(&self.kernel[a].0).zip(&self.units);
            let y: Vec<f64> = moved.map(|((x, v), unit)| x + h * v * unit).collect();
            self.linearize(&y);
            self.jac.mul_transpose_vec(&self.w, product);
        }
        slope
            .iter_mut()
            .zip(&back)
            .for_each(|(s, b)| *s = (*s - b) / (2.0 * h));
        self.slopes[a] = slope;
        self.linearize(x);
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

    /// Size of the terms of wᵀH at the point linearised last, up to second order along the kernel: they cancel there and along the curve.
    /// The derivatives of g belong to a w of the given length.
    fn terms(&self, length: f64) -> f64 {
        let first: f64 = (self.jac.triplets()).map(|(i, _, v)| (self.w[i] * v).abs()).sum();
        let second: f64 = self.slopes.iter().flatten().map(|v| v.abs() / length).sum();
        first + 0.5 * second
    }

    /// Scatter of wᵀH in the last bits of x: rounding errors of H, as it varies by squares of distances only.
    fn noise(&self, x: &[f64]) -> f64 {
        let mut r = vec![0.0; self.w.len()];
        self.residual(x, &mut r);
        let centre = dot(&self.w, &r);
        let mut noise = 0.0f64;
        for k in 0..4 {
            let bits = |j: usize| (8.0 * centred(j + 1 + k * x.len(), k % 2 == 1)).round();
            let moved = (x.iter().enumerate()).map(|(j, x)| x * (1.0 + bits(j) * f64::EPSILON));
            self.residual(&moved.collect::<Vec<_>>(), &mut r);
            noise = noise.max((dot(&self.w, &r) - centre).abs());
        }
        noise
    }
}

/// `None` where a matrix is singular.
fn found<T>(result: Result<T, LinearError>) -> Result<Option<T>, PiecewiseError> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(
            LinearError::Input(InputError::Length { .. })
            | LinearError::NotAnalyzed
            | LinearError::NotFactored,
        ) => Ok(Some(result?)),
        Err(_) => Ok(None),
    }
}

/// The place of a column when two others are left out.
fn place(c: usize, columns: [usize; 2]) -> usize {
    c - usize::from(c > columns[0]) - usize::from(c > columns[1])
}

/// Entries of all columns but two, with zeros for these; the last entry is left out.
fn spread(entries: &[f64], columns: [usize; 2], out: &mut [f64]) {
    let mut entries = entries.iter();
    for (c, out) in out.iter_mut().enumerate() {
        *out = match columns.contains(&c) {
            true => 0.0,
            false => entries.next().copied().unwrap_or(0.0),
        };
    }
}

fn normalise(v: &mut [f64]) -> Result<(), LinearError> {
    let largest = max_abs(v);
    if !(largest.is_finite() && largest > 0.0) {
        return Err(LinearError::Singular { rcond: 0.0 });
    }
    v.iter_mut().for_each(|v| *v /= largest);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::BranchSystem;
    use crate::continuation::testing::{Function, Plane};
    use crate::piecewise::{Derivatives, Facet, PiecewiseSmooth, Selection};
    use crate::sparse::Matrix;

    /// Two lines cross at (1/3, 1/7). The crossing is recognised whether H is evaluated directly, or with terms a hundred thousand times
    /// larger that cancel up to their rounding errors; 1e-6 beside it H has no singular solution.
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

    /// Two lines cross at the origin, where all terms of first order vanish and the last bits of x do not change H: the error of H is
    /// measured by its terms of second order.
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

    /// Two curves that touch at the origin: the extended system is singular there, Newton's method converges slowly, and `solve` gives
    /// `None`.
    #[test]
    fn curves_that_touch_are_no_simple_branch_point() {
        let touching: Function = |y, a| [y * (y - a * a), 2.0 * y - a * a, -2.0 * y * a];
        let map = Plane::within(touching, &[]);
        let selection = Selection::uniform(1, 0);
        for k in 1..20 {
            let d = 1e-2 * f64::from(k);
            let mut system = BranchSystem::new(&map, &selection, &[0.3, 0.3], &[d, -0.7 * d]);
            assert!(system.solve(&[d, -0.7 * d]).unwrap().is_none(), "{d}");
        }
    }

    /// y² = α² and z = y + α: the kernel at the origin is spanned by (1, 0, 1) and (0, 1, 1), which are not orthogonal.
    struct Lifted;

    impl PiecewiseSmooth for Lifted {
        fn num_vars(&self) -> usize {
            3
        }
        fn num_residuals(&self) -> usize {
            2
        }
        fn num_sites(&self) -> usize {
            0
        }
        fn num_pieces(&self, _: usize) -> usize {
            1
        }
        fn num_tests(&self, _: usize) -> usize {
            0
        }
        fn cell(&self, _: usize, _: usize) -> &[Facet] {
            &[]
        }
        fn test_functions(&self, _: &[f64], _: &mut [f64]) {}
        fn residual(&self, _: &Selection, x: &[f64], out: &mut [f64]) {
            out[0] = x[0] * x[0] - x[2] * x[2];
            out[1] = x[1] - x[0] - x[2];
        }
        fn jacobian(&self, _: &Selection, x: &[f64], jac: &mut Matrix) {
            jac.add(0, 0, 2.0 * x[0]);
            jac.add(0, 2, -2.0 * x[2]);
            for (j, v) in [-1.0, 1.0, -1.0].into_iter().enumerate() {
                jac.add(1, j, v);
            }
        }
        fn derivatives(&self) -> Option<&dyn Derivatives> {
            Some(self)
        }
    }

    impl Derivatives for Lifted {
        fn test_gradient(&self, _: usize, _: usize, _: &[f64], _: &mut [f64]) {}
    }

    #[test]
    fn bases_of_kernels_are_orthonormal() {
        let (selection, origin) = (Selection::uniform(0, 0), [0.0; 3]);
        let mut system = BranchSystem::new(&Lifted, &selection, &[0.3, 0.6, 0.3], &origin);
        let [u, v] = system.kernels(&origin).unwrap().unwrap().right;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        assert!(dot(&u, &v).abs() < 1e-15, "{u:?} {v:?}");
        for w in [u, v] {
            assert!((dot(&w, &w) - 1.0).abs() < 1e-15 && (w[1] - w[0] - w[2]).abs() < 1e-15);
        }
    }

    /// At a point of a single curve the kernel has dimension one; where two curves cross it has dimension two.
    #[test]
    fn kernels_are_those_of_branch_points() {
        let crossing: Function = |y, a| [y * y - a * a, 2.0 * y, -2.0 * a];
        let map = Plane::within(crossing, &[]);
        let selection = Selection::uniform(1, 0);
        let kernels = |x: [f64; 2]| {
            let mut system = BranchSystem::new(&map, &selection, &[0.3, 0.3], &x);
            system.kernels(&x).unwrap()
        };
        assert!(kernels([0.2, 0.2]).is_none() && kernels([1e-3, -1e-3]).is_none());
        let found = kernels([0.0, 0.0]).unwrap();
        let [u, v] = found.right;
        assert!((u[0] * v[0] + u[1] * v[1]).abs() < 1e-15 && found.left == [1.0]);
        assert!([u, v].iter().all(|v| (v[0].hypot(v[1]) - 1.0).abs() < 1e-15));
    }
}
