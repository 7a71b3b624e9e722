//! Steps, tangents and solutions of linear systems from the factors of a Jacobian at a nearby point (chord method).

use super::moore_penrose::{CONTRACTION, Held, Linearisation, MoorePenrose};
use crate::linear::{LinearError, LinearSolver};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection};
use crate::sparse::{dot, norm};
use crate::tolerances::CHECKED;

/// Largest number of refinement steps for a solution, and the relative change at which they end.
const REFINEMENTS: usize = 4;
const ACCURATE: f64 = 1e-3;

impl<L: LinearSolver> MoorePenrose<L> {
    /// [`linearize`](Self::linearize) for the same map as in the last call: factors of the same selection at the same point are reused. The
    /// Jacobian is assembled in any case.
    pub(crate) fn linearize_again<P: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &P,
        selection: &Selection,
        x: &[f64],
        hint: Option<&[f64]>,
    ) -> Result<Linearisation<'_, L>, PiecewiseError> {
        let known = self.held == Held::Point && self.selection == *selection && self.point == x;
        if !known || map.is_piecewise_affine() {
            return self.linearize(map, selection, x, hint);
        }
        self.assemble(&map, x)?;
        Ok(Linearisation::of(self))
    }

    /// Replaces `t` by the tangent at x: by iterative refinement with the stored factors of a nearby point, or, where that converges
    /// slowly, by a new factorisation.
    pub(super) fn take_tangent(
        &mut self,
        map: &dyn PiecewiseSmooth,
        x: &[f64],
        t: &mut [f64],
    ) -> Result<(), PiecewiseError> {
        self.assemble(map, x)?;
        self.held = Held::Refined;
        let mut change = 1.0;
        loop {
            let next = self.bordered.refine_tangent(&self.jac)?;
            if next <= CHECKED {
                break;
            }
            if next.is_nan() || next > CONTRACTION * change {
                self.factor_at(x, Some(t))?;
                break;
            }
            change = next;
        }
        turn_into(self.bordered.tangent(), t);
        Ok(())
    }

    /// dx ← ∇H⁺ r normal to t for the assembled Jacobian, which after chord steps is not the factored one; `false` where the two differ too
    /// much.
    pub(super) fn solve_here(&mut self, t: &[f64]) -> Result<bool, LinearError> {
        self.bordered.solve(&self.r, t, 0.0, &mut self.dx)?;
        if self.held != Held::Refined {
            return Ok(true);
        }
        let (rest, change) = &mut self.errors;
        let mut last = norm(&self.dx);
        for _ in 0..REFINEMENTS {
            rest.iter_mut().zip(&self.r).for_each(|(rest, r)| *rest = -r);
            self.jac.as_ref().mul_add(1.0, &self.dx, rest);
            self.bordered.solve(rest, t, 0.0, change)?;
            let step = norm(change);
            if step.is_nan() || step > CONTRACTION * last {
                return Ok(false);
            }
            (self.dx.iter_mut().zip(&*change)).for_each(|(dx, c)| *dx -= c);
            last = step;
            if step <= ACCURATE * norm(&self.dx) {
                break;
            }
        }
        Ok(true)
    }

    /// v ← the solution of ∇Hᵀ v + s t = dx for the assembled Jacobian, in the same way.
    pub(super) fn solve_transpose_here(&mut self, t: &[f64], v: &mut [f64]) -> Result<(), LinearError> {
        let mut s = self.bordered.solve_transpose(&self.dx, t, v)?;
        if self.held != Held::Refined {
            return Ok(());
        }
        let (change, rest) = &mut self.errors;
        for _ in 0..REFINEMENTS {
            let terms = self.dx.iter().zip(t);
            rest.iter_mut()
                .zip(terms)
                .for_each(|(rest, (dx, t))| *rest = dx - s * t);
            self.jac.as_ref().mul_transpose_add(-1.0, v, rest);
            s += self.bordered.solve_transpose(rest, t, change)?;
            v.iter_mut().zip(&*change).for_each(|(v, c)| *v += c);
            if norm(change) <= ACCURATE * norm(v) {
                break;
            }
        }
        Ok(())
    }
}

/// `t` becomes the unit kernel vector, oriented along the old `t`.
pub(super) fn turn_into(tangent: &[f64], t: &mut [f64]) {
    let sign = dot(tangent, t).signum();
    for (t, v) in t.iter_mut().zip(tangent) {
        *t = sign * v;
    }
}

/// Number of Newton steps that reduce the error as much as so many chord steps: a chord step multiplies it by a constant factor, a Newton
/// step squares the reduction reached before.
pub(super) fn newton_steps(chords: usize) -> usize {
    1 + chords.next_power_of_two().ilog2() as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::{AutoSolver, DENSE_LIMIT};
    use crate::piecewise::Facet;
    use crate::sparse::{Matrix, distance};
    use crate::spread::Random;

    /// Smooth curves of the given number of equations: values and derivatives of one row.
    struct Smooth<F>(usize, F);

    impl<F: Fn(usize, &[f64], &mut dyn FnMut(usize, f64)) -> f64> PiecewiseSmooth for Smooth<F> {
        fn num_vars(&self) -> usize {
            self.0 + 1
        }
        fn num_residuals(&self) -> usize {
            self.0
        }
        fn num_sites(&self) -> usize {
            0
        }
        fn num_pieces(&self, _site: usize) -> usize {
            0
        }
        fn num_tests(&self, _site: usize) -> usize {
            0
        }
        fn cell(&self, _site: usize, _piece: usize) -> &[Facet] {
            &[]
        }
        fn test_functions(&self, _x: &[f64], _out: &mut [f64]) {}
        fn residual(&self, _s: &Selection, x: &[f64], out: &mut [f64]) {
            for (i, out) in out.iter_mut().enumerate() {
                *out = self.1(i, x, &mut |_, _| {});
            }
        }
        fn jacobian(&self, _s: &Selection, x: &[f64], jac: &mut Matrix) {
            for i in 0..self.0 {
                self.1(i, x, &mut |j, v| jac.add(i, j, v));
            }
        }
    }

    const N: usize = DENSE_LIMIT + 40;

    /// y_i + sin(y_i + y_{i+1}/2)/5 + y_{i+7}/4 = (1 + i/N) α.
    fn coupled() -> impl PiecewiseSmooth {
        Smooth(N, |i: usize, x: &[f64], add: &mut dyn FnMut(usize, f64)| {
            let (next, far, rate) = ((i + 1) % N, (i + 7) % N, 1.0 + i as f64 / N as f64);
            let (sin, cos) = (x[i] + 0.5 * x[next]).sin_cos();
            add(i, 1.0 + 0.2 * cos);
            add(next, 0.1 * cos);
            add(far, 0.25);
            add(N, -rate);
            x[i] + 0.2 * sin + 0.25 * x[far] - rate * x[N]
        })
    }

    fn corrector(map: &impl PiecewiseSmooth) -> MoorePenrose<AutoSolver> {
        MoorePenrose::new(map, AutoSolver::new()).unwrap()
    }

    /// One factorisation per correction, and the same results as by Newton's method and by factors of the point itself: number of
    /// corrections, tangent, signs of determinants, and how fast ∇H loses its regularity.
    #[test]
    fn chords_do_what_newtons_method_does() {
        let (map, sigma) = (coupled(), Selection::uniform(0, 0));
        for (h, seed) in [(0.5, 1), (2.0, 2), (6.0, 3)] {
            let mut chords = corrector(&map);
            let there = chords.linearize(&map, &sigma, &[0.0; N + 1], None);
            let t = there.unwrap().tangent().to_vec();
            let guess: Vec<f64> = t.iter().map(|t| h * t).collect();
            let tolerances = (1e-11, 1e-8 * h);
            let (mut x, mut own, mut frozen) = (guess.clone(), t.clone(), sigma.clone());
            let before = chords.factorisations();
            let found = chords.correct(&map, &mut frozen, |_, _| {}, &mut x, &mut own, tolerances, 10);
            let (found, at) = found.unwrap();
            assert!(found.converged && found.residual_norm < 1e-13, "{found:?}");
            assert!(at.point().is_none() && *at.selection() == sigma);
            let signs = (at.orientation(&own), at.det_sign());
            assert_eq!(chords.factorisations(), before + 1);

            let (mut newton, mut there, mut turned) = (corrector(&map), guess, t.clone());
            let mut count = 0;
            loop {
                let free = (f64::INFINITY, f64::INFINITY);
                let step = newton.correct(&map, &mut frozen, |_, _| {}, &mut there, &mut turned, free, 1);
                let (step, _) = step.unwrap();
                count += 1;
                if step.residual_norm < tolerances.0 && step.step_norm < tolerances.1 {
                    break;
                }
            }
            assert_eq!(found.iterations, count);
            assert!(distance(&x, &there) < 1e-3 * h);

            let mut anew = corrector(&map);
            let exact = anew.linearize(&map, &sigma, &x, Some(&own)).unwrap();
            assert_eq!((exact.point(), exact.selection()), (Some(&x[..]), &sigma));
            assert_eq!(signs, (exact.orientation(&own), exact.det_sign()));
            let tangent = exact.tangent().to_vec();
            assert!(
                dot(&tangent, &own).abs() > 0.9
                    && (distance(&tangent, &own) < 1e-10 || dot(&tangent, &own) < 0.0)
            );
            let mut random = Random::new(seed);
            let probe: Vec<f64> = (0..N).map(|_| random.symmetric()).collect();
            let measured = [&mut chords, &mut anew].map(|corrector| {
                let (mut v, mut behind) = (probe.clone(), vec![0.0; N + 1]);
                let at = (x.as_slice(), own.as_slice());
                let held = Linearisation::of(corrector);
                let rate = held.decline(&map, at, 1e-3 * h, &mut [1.0; N], &mut v, &mut behind);
                (rate.unwrap().0.unwrap(), v)
            });
            let [(rate, v), (exact, w)] = measured;
            assert!(
                (rate - exact).abs() < 1e-3 * exact.abs().max(1e-3),
                "{rate} {exact}"
            );
            assert!(distance(&v, &w) < 1e-3, "{}", distance(&v, &w));
        }
    }

    /// Refined solutions after chord steps are much nearer to those of a new factorisation than solutions with the stored factors; so are
    /// those of the transposed equations.
    #[test]
    fn solutions_are_those_of_the_jacobian_at_hand() {
        let (map, mut sigma) = (coupled(), Selection::uniform(0, 0));
        let mut chords = corrector(&map);
        let start = chords.linearize(&map, &sigma, &[0.0; N + 1], None);
        let mut t = start.unwrap().tangent().to_vec();
        let mut x: Vec<f64> = t.iter().map(|t| 6.0 * t).collect();
        let found = chords.correct(&map, &mut sigma, |_, _| {}, &mut x, &mut t, (1e-11, 1e-8), 10);
        assert!(found.unwrap().0.converged && chords.held == Held::Refined);
        let mut anew = corrector(&map);
        anew.linearize(&map, &sigma, &x, Some(&t)).unwrap();
        let mut random = Random::new(4);
        let r: Vec<f64> = (0..N).map(|_| random.symmetric()).collect();
        let (mut exact, mut coarse) = (vec![0.0; N + 1], vec![0.0; N + 1]);
        anew.bordered.solve(&r, &t, 0.0, &mut exact).unwrap();
        chords.bordered.solve(&r, &t, 0.0, &mut coarse).unwrap();
        chords.r.copy_from_slice(&r);
        assert_eq!(chords.solve_here(&t), Ok(true));
        let missed = distance(&exact, &coarse);
        assert!(
            missed > 1e-6 && distance(&exact, &chords.dx) < 0.1 * missed,
            "{missed}"
        );

        let (mut exact, mut coarse, mut v) = (vec![0.0; N], vec![0.0; N], vec![0.0; N]);
        anew.bordered.solve_transpose(&chords.dx, &t, &mut exact).unwrap();
        chords
            .bordered
            .solve_transpose(&chords.dx, &t, &mut coarse)
            .unwrap();
        chords.solve_transpose_here(&t, &mut v).unwrap();
        let missed = distance(&exact, &coarse);
        assert!(missed > 1e-6 && distance(&exact, &v) < 0.1 * missed, "{missed}");
    }

    /// (y_1 − c) y_0 = 0 beside y_1 + y_1² = α: on y_0 = 0 no correction moves y_0, and the determinant changes its sign where y_1 = c, which
    /// is between the predicted point and the corrected one.
    #[test]
    fn signs_of_determinants_are_those_of_the_corrected_point() {
        for side in [0.5, 1.5] {
            let rows = |c: f64| {
                Smooth(
                    N,
                    move |i: usize, x: &[f64], add: &mut dyn FnMut(usize, f64)| match i {
                        0 => {
                            add(0, x[1] - c);
                            add(1, x[0]);
                            (x[1] - c) * x[0]
                        }
                        1 => {
                            add(1, 1.0 + 2.0 * x[1]);
                            add(N, -1.0);
                            x[1] + x[1] * x[1] - x[N]
                        }
                        _ => {
                            add(i, 1.0);
                            x[i]
                        }
                    },
                )
            };
            let sigma = Selection::uniform(0, 0);
            let correct = |c: f64| {
                let map = rows(c);
                let mut corrector = corrector(&map);
                let mut t = vec![0.0; N + 1];
                (t[1], t[N]) = (0.5_f64.sqrt(), 0.5_f64.sqrt());
                let mut x: Vec<f64> = t.iter().map(|t| 0.1 * t).collect();
                let guess = x[1];
                let mut frozen = sigma.clone();
                let found =
                    corrector.correct(&map, &mut frozen, |_, _| {}, &mut x, &mut t, (1e-12, 1e-9), 10);
                assert!(found.unwrap().0.converged);
                (map, corrector, guess, x, t)
            };
            let (_, _, guess, end, _) = correct(-3.0);
            let (map, mut chords, _, x, t) = correct(guess + side * (end[1] - guess));
            let mut anew = corrector(&map);
            let exact = anew
                .linearize(&map, &sigma, &x, Some(&t))
                .unwrap()
                .orientation(&t);
            let at = Linearisation::of(&mut chords);
            assert_eq!(at.orientation(&t) != exact, side < 1.0);
            let (mut v, mut behind) = (vec![0.1; N], vec![0.0; N + 1]);
            let place = (x.as_slice(), t.as_slice());
            let (_, at) = at
                .decline(&map, place, 1e-4, &mut [1.0; N], &mut v, &mut behind)
                .unwrap();
            assert_eq!(at.orientation(&t), exact);
            // Factors that were made anew are those of this point.
            assert!(side > 1.0 || at.point() == Some(x.as_slice()));
        }
    }

    /// Factors are reused for the same point and selection only.
    #[test]
    fn factors_serve_again_at_the_same_point() {
        let (map, sigma) = (coupled(), Selection::uniform(0, 0));
        let mut corrector = corrector(&map);
        let points = [0.0, 1.0, 1.0, 0.0].map(|v| vec![v; N + 1]);
        for (x, made) in points.iter().zip([1, 2, 2, 3]) {
            let at = corrector.linearize_again(&map, &sigma, x, None).unwrap();
            assert_eq!(at.point(), Some(x.as_slice()));
            let tangent = at.tangent().to_vec();
            assert_eq!(corrector.factorisations(), made);
            let mut product = vec![0.0; N];
            let mut jac = Matrix::zeros(map.pattern());
            map.jacobian(&sigma, x, &mut jac);
            assert_eq!(corrector.jac.values(), jac.values());
            jac.mul_vec(&tangent, &mut product);
            assert!(norm(&product) < 1e-13);
        }
    }

    /// The last of n chord steps with contraction ρ is ρⁿ⁻¹ of the first, that of k Newton steps ρ to the power 2ᵏ⁻¹ − 1.
    #[test]
    fn chords_count_as_steps_of_newtons_method() {
        for chords in 1..100 {
            let newton = (1..).find(|k| (1 << (k - 1)) >= chords);
            assert_eq!(Some(newton_steps(chords)), newton);
        }
    }
}
