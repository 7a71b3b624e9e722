//! Estimates at a point of a curve from its linearisation: how far rounding may have moved it, and how fast
//! ∇H approaches singularity.

use super::convergence::row_sizes;
use super::moore_penrose::{Held, Linearisation, MoorePenrose};
use crate::linear::LinearSolver;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection};
use crate::sparse::{dot, norm};
use crate::spread::centred;

impl<L: LinearSolver> MoorePenrose<L> {
    /// Upper estimate, by inverse iteration, of the least singular value of ∇H^(σ)(x) with its rows divided
    /// by `sizes`; 0 where the factorisation fails.
    pub(crate) fn least_singular_value<P: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &P,
        selection: &Selection,
        x: &[f64],
        sizes: &[f64],
    ) -> Result<f64, PiecewiseError> {
        const ITERATIONS: usize = 4;
        self.jacobian_at(&map, selection, x)?;
        if self.factor(None).is_err() {
            return Ok(0.0);
        }
        let t = self.bordered.tangent().to_vec();
        let mut v: Vec<f64> = (0..sizes.len()).map(|i| centred(i + 1, false)).collect();
        let mut least = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let length = norm(&v);
            for ((r, v), size) in self.r.iter_mut().zip(&v).zip(sizes) {
                *r = size * v / length;
            }
            let solved = (self.bordered.solve(&self.r, &t, 0.0, &mut self.dx))
                .and_then(|()| self.bordered.solve_transpose(&self.dx, &t, &mut v));
            if solved.is_err() {
                return Ok(0.0);
            }
            least = least.min(norm(&self.dx).recip());
            v.iter_mut().zip(sizes).for_each(|(v, size)| *v *= size);
        }
        Ok(least)
    }
}

impl<L: LinearSolver> Linearisation<'_, L> {
    /// The remaining correction of x, next to the point of the factors, within the hyperplane normal to
    /// `normal`: from H(x), below the last bits of x.
    pub(crate) fn remainder<P: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &P,
        x: &[f64],
        normal: &[f64],
    ) -> Option<&[f64]> {
        map.residual(&self.held.selection, x, &mut self.held.r);
        let solved = self.solve_across(normal);
        solved.is_ok().then_some(self.held.dx.as_slice())
    }

    /// Effect of rounding errors in the terms of H on a function with the given gradient, at a point x of the
    /// curve, next to that of the factors, in a hyperplane normal to `normal`: the root mean square over all
    /// signs of the errors. `None` where it cannot be estimated.
    pub(crate) fn rounding_of(&mut self, gradient: &[f64], x: &[f64], normal: &[f64]) -> Option<f64> {
        let mut weights = std::mem::take(&mut self.held.errors.0);
        let solved = self.solve_transpose(gradient, normal, &mut weights);
        let terms = &mut self.held.r;
        row_sizes(self.held.jac.as_ref(), x, terms);
        weights.iter_mut().zip(terms).for_each(|(w, t)| *w *= *t);
        let mean = f64::EPSILON * norm(&weights);
        self.held.errors.0 = weights;
        solved.filter(|()| mean.is_finite()).map(|()| mean)
    }

    /// Entry k of the tangent at x, the point of the factors, to first order in the error of `t`, and what
    /// rounding may have changed it by: errors of one rounding in the terms of ∇H t, as a mean over their
    /// signs, and displacements of x by `moves`. `None` where it cannot be estimated.
    pub(crate) fn entry_of_tangent<P: PiecewiseSmooth + ?Sized>(
        mut self,
        map: &P,
        (x, t): (&[f64], &[f64]),
        k: usize,
        moves: &[Vec<f64>],
    ) -> Result<Option<(f64, f64)>, PiecewiseError> {
        let (mut unit, mut weights) = (vec![0.0; x.len()], vec![0.0; self.held.r.len()]);
        unit[k] = 1.0;
        if self.solve_transpose(&unit, t, &mut weights).is_none() {
            return Ok(None);
        }
        let held = self.held;
        row_sizes(held.jac.as_ref(), t, &mut held.r);
        let terms = held.r.iter().zip(&weights).map(|(r, w)| (r * w).powi(2));
        let mut rounding = f64::EPSILON * terms.sum::<f64>().sqrt();
        // To first order the tangent is t less the solution of ∇H d = ∇H t across it.
        let mut off = |held: &MoorePenrose<L>| {
            held.jac.mul_vec(t, &mut unit[..weights.len()]);
            dot(&weights, &unit[..weights.len()])
        };
        let own = off(held);
        for moved in moves {
            let y: Vec<f64> = x.iter().zip(moved).map(|(x, m)| x + m).collect();
            held.assemble(&map, &y)?;
            rounding += (off(held) - own).abs();
        }
        let entry = t[k] - own;
        Ok((entry.is_finite() && rounding.is_finite()).then_some((entry, rounding)))
    }

    /// The rate of entry k of the unit tangent along the curve at x, the point of the factors, by central
    /// differences of ∇H over a distance. `None` where it cannot be found.
    pub(crate) fn turn_of_entry<P: PiecewiseSmooth + ?Sized>(
        mut self,
        map: &P,
        (x, t): (&[f64], &[f64]),
        k: usize,
        distance: f64,
    ) -> Result<Option<f64>, PiecewiseError> {
        let (mut unit, mut weights) = (vec![0.0; x.len()], vec![0.0; self.held.r.len()]);
        unit[k] = 1.0;
        if self.solve_transpose(&unit, t, &mut weights).is_none() {
            return Ok(None);
        }
        // ∇H ṫ = −(d/ds ∇H) t across t.
        let mut rate = 0.0;
        for h in [distance, -distance] {
            let y: Vec<f64> = x.iter().zip(t).map(|(x, t)| x + h * t).collect();
            self.held.assemble(&map, &y)?;
            self.held.jac.mul_vec(t, &mut self.held.r);
            rate -= dot(&weights, &self.held.r) / (2.0 * h);
        }
        Ok(rate.is_finite().then_some(rate))
    }

    /// The relative rate at which the regularity m of ∇H falls along the curve: −d ln m/ds with m = 1/‖∇H⁺ S
    /// v‖, S the row `sizes`, at x with the tangent t, the point of the factors or next to it, from one more
    /// Jacobian at a distance. Towards a simple singular point m falls linearly: it lies 1/rate ahead (or
    /// behind, where the rate is negative). `v` becomes that of the next step of inverse iteration, so that m
    /// follows the least singular value. `None` where it cannot be estimated. Where the factors are those of
    /// a point too far away the linearisation becomes that of x.
    pub(crate) fn decline<P: PiecewiseSmooth + ?Sized>(
        self,
        map: &P,
        (x, t): (&[f64], &[f64]),
        distance: f64,
        sizes: &mut [f64],
        v: &mut [f64],
        behind: &mut [f64],
    ) -> Result<(Option<f64>, Self), PiecewiseError> {
        let held = &mut *self.held;
        // On trivial solutions the terms of all rows may vanish.
        if sizes.contains(&0.0) {
            sizes.fill(0.0);
            (held.jac.triplets()).for_each(|(i, _, v)| sizes[i] += v.abs());
        }
        for ((r, size), v) in held.r.iter_mut().zip(&*sizes).zip(&*v) {
            *r = size * v;
        }
        let mut solved = held.solve_here(t);
        if solved == Ok(false) {
            // A singular point may be this near in a direction that the corrections did not take: signs of determinants must be those here.
            solved = held.factor_at(x, Some(t)).and_then(|()| held.solve_here(t));
        }
        let solved = solved.and_then(|_| held.solve_transpose_here(t, v));
        if solved.is_err() {
            return Ok((None, self));
        }
        for ((y, x), t) in behind.iter_mut().zip(x).zip(t) {
            *y = x - distance * t;
        }
        // ∇H there, less ∇H here, times ∇H⁺ S v, which is S v here with the factors of this point.
        if held.held == Held::Refined {
            held.r.fill(0.0);
            held.jac.as_ref().mul_add(1.0, &held.dx, &mut held.r);
        }
        held.r.iter_mut().for_each(|r| *r = -*r);
        held.assemble(&map, behind)?;
        held.jac.as_ref().mul_add(1.0, &held.dx, &mut held.r);
        let rate = dot(v, &held.r) / (distance * dot(&held.dx, &held.dx));
        v.iter_mut().zip(&*sizes).for_each(|(v, size)| *v *= size);
        let length = norm(v);
        v.iter_mut().for_each(|v| *v /= length);
        Ok((rate.is_finite().then_some(rate), self))
    }

    /// Two displacements by which rounding may have moved a point x, that of the factors, off the curve: the
    /// corrections for errors of one rounding of the terms of each residual (and for the residual itself),
    /// with two patterns of signs. `sizes` are those that the variables have had so far. Orthogonal to `t`.
    pub(crate) fn noise<P: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &P,
        (x, sizes): (&[f64], &[f64]),
        t: &[f64],
    ) -> Result<[Vec<f64>; 2], PiecewiseError> {
        map.residual(&self.held.selection, x, &mut self.held.r);
        let mut errors = vec![0.0; self.held.r.len()];
        self.add_term_sizes(&map, sizes, &mut errors);
        for (e, r) in errors.iter_mut().zip(&self.held.r) {
            *e = r.abs() + f64::EPSILON * *e;
        }
        let mut moves = [vec![0.0; x.len()], vec![0.0; x.len()]];
        for (second, moved) in [false, true].into_iter().zip(&mut moves) {
            for (i, (r, e)) in self.held.r.iter_mut().zip(&errors).enumerate() {
                *r = e.copysign(centred(i + 1, second));
            }
            self.solve_across(t)?;
            moved.copy_from_slice(&self.held.dx);
        }
        Ok(moves)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::complementarity::{AffineFunction, Mcp};
    use crate::linear::AutoSolver;
    use crate::piecewise::MinMap;
    use crate::sparse::Matrix;

    /// A point that misses the line y = α by some distance may have been moved by as much, and by the rounding of its terms at least.
    #[test]
    fn noise_is_what_the_point_misses_the_curve_by() {
        let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = x[0] - x[1];
            b[0] = 1e9;
        });
        let mut corrector = MoorePenrose::new(&map, AutoSolver::new()).unwrap();
        let selection = Selection::uniform(1, 0);
        let t = [0.5_f64.sqrt(); 2];
        for off in [0.0, 1e-12, -1e-9, 1e-6] {
            let x = [3.0 + off, 3.0];
            let mut at = corrector.linearize(&map, &selection, &x, Some(&t)).unwrap();
            let moves = at.noise(&map, (&x, &x), &t).unwrap();
            let distance = (x[0] - x[1]).abs() / 2.0_f64.sqrt();
            for moved in &moves {
                let length = norm(moved);
                assert!(length >= distance && length >= f64::EPSILON, "{off:e}: {moved:?}");
                assert!(length <= 1.01 * distance + 1e-14 && dot(moved, &t).abs() <= 1e-15);
            }
        }
    }

    /// 2 y = α and 4 z + y = α at fixed α: z is moved by a quarter of the error of its row, and by an eighth of that of the other.
    #[test]
    fn rounding_moves_functions_by_the_mean_over_its_signs() {
        let map = MinMap::curve(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            (a[0], a[1]) = (2.0 * x[0] - x[2], 4.0 * x[1] + x[0] - x[2]);
            b.fill(1e9);
        });
        let mut corrector = MoorePenrose::new(&map, AutoSolver::new()).unwrap();
        let (x, normal) = ([1.5, 0.375, 3.0], [0.0, 0.0, 1.0]);
        let selection = Selection::uniform(2, 0);
        let mut at = corrector.linearize(&map, &selection, &x, None).unwrap();
        let found = at.rounding_of(&[0.0, 1.0, 0.0], &x, &normal).unwrap();
        let expected = f64::EPSILON * f64::hypot(6.0 / 4.0, 6.0 / 8.0);
        assert!(
            (found - expected).abs() < 1e-6 * expected,
            "{found:e} {expected:e}"
        );
    }

    /// After an update of rows it is that of the selection requested, not of the one that was factored; so are the corrections by its
    /// factors.
    #[test]
    fn least_singular_values_are_those_of_the_selection() {
        let rows = [[2.0, 1.0, -1.0], [0.5, 1e-3, 1e-3]];
        let f = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), vec![1.0, -1.0]).unwrap();
        let map = Mcp::new(f, vec![0.0; 2], vec![f64::INFINITY; 2]).unwrap();
        let (x, sizes) = ([0.3, 0.2, 0.1], [1.0; 2]);
        let mut values = Vec::new();
        for pieces in [[0, 0], [0, 1], [1, 0], [1, 1]] {
            let selection = Selection::from_pieces(pieces);
            let mut anew = MoorePenrose::new(&map, AutoSolver::new()).unwrap();
            let expected = anew.least_singular_value(&map, &selection, &x, &sizes).unwrap();
            let mut at = anew.linearize(&map, &selection, &x, None).unwrap();
            let t = at.tangent().to_vec();
            let correction = at.remainder(&map, &x, &t).unwrap();
            for known in [[0, 0], [1, 1]] {
                let mut corrector = MoorePenrose::new(&map, AutoSolver::new()).unwrap();
                for s in [&Selection::from_pieces(known), &selection] {
                    corrector.linearize(&map, s, &x, None).unwrap();
                }
                assert_eq!(corrector.updates(), usize::from(known != pieces));
                let least = corrector.least_singular_value(&map, &selection, &x, &sizes);
                assert!(
                    (least.unwrap() - expected).abs() <= 1e-9 * expected,
                    "{known:?} {pieces:?}"
                );
                let mut at = corrector.linearize(&map, &selection, &x, None).unwrap();
                assert_eq!((at.selection(), at.point()), (&selection, None));
                let found = at.remainder(&map, &x, &t).unwrap();
                let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * norm(correction);
                assert!(found.iter().zip(correction).all(near), "{known:?} {pieces:?}");
            }
            values.push(expected);
        }
        assert!(
            values.iter().skip(1).any(|v| (v - values[0]).abs() > 0.1),
            "{values:?}"
        );
    }
}
