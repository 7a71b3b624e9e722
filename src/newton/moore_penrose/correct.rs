//! Corrections of a predicted point.

use super::linearisation::{Corrected, Linearisation};
use super::{AT_ROUNDING, CONTRACTION, Correction, Held, MoorePenrose, QUADRATIC, SECANTS};
use crate::linear::{DENSE_LIMIT, LinearSolver};
use crate::newton::chords::{newton_steps, turn_into};
use crate::newton::convergence::row_sizes;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection};
use crate::sparse::{dot, norm};
use crate::tolerances::{SAME, SIX_DIGITS};

impl<L: LinearSolver> MoorePenrose<L> {
    /// Corrects X = `x` towards the curve of the selection, which `choose` may change at each iterate (or leave, to freeze it), and turns
    /// `t` into the tangent there. Ends when ‖H‖ and ‖ΔX‖ are less than the two `tolerances`, or ‖H‖ is and ‖ΔX‖ is no longer than rounding
    /// errors of H make it, or after `max_iterations` (0 only linearises).
    ///
    /// The linearisation belongs to the last iterate but one, and so does `t`, where one iteration or
    /// Newton's method made the last correction; where large systems were corrected with the factors of an
    /// earlier iterate (chord steps), `t` is the tangent at `x`.
    ///
    /// # Errors
    /// Singular or non-finite linear systems, entries outside the pattern, vectors of other lengths, selections of other maps.
    #[allow(clippy::too_many_arguments)]
    pub fn correct<P: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &P,
        selection: &mut Selection,
        mut choose: impl FnMut(&[f64], &mut Selection),
        x: &mut [f64],
        t: &mut [f64],
        tolerances: (f64, f64),
        max_iterations: usize,
    ) -> Result<(Correction, Linearisation<'_, L>), PiecewiseError> {
        let limits = (tolerances, max_iterations);
        let found = self.correct_measured(&map, selection, &mut choose, &norm, x, t, limits)?;
        Ok((found.correction, found.linearisation()))
    }

    /// [`correct`](Self::correct) with another measure of H than its norm for the first tolerance.
    #[allow(clippy::too_many_arguments)]
    pub(crate) fn correct_measured(
        &mut self,
        map: &dyn PiecewiseSmooth,
        selection: &mut Selection,
        choose: &mut dyn FnMut(&[f64], &mut Selection),
        measure: &dyn Fn(&[f64]) -> f64,
        x: &mut [f64],
        t: &mut [f64],
        limits: ((f64, f64), usize),
    ) -> Result<Corrected<'_, L>, PiecewiseError> {
        let correction = self.corrections(map, selection, choose, measure, x, t, limits)?;
        Ok(Corrected::of(correction, self))
    }

    #[allow(clippy::too_many_arguments)]
    fn corrections(
        &mut self,
        map: &dyn PiecewiseSmooth,
        selection: &mut Selection,
        choose: &mut dyn FnMut(&[f64], &mut Selection),
        measure: &dyn Fn(&[f64]) -> f64,
        x: &mut [f64],
        t: &mut [f64],
        ((tol_residual, tol_step), max_iterations): ((f64, f64), usize),
    ) -> Result<Correction, PiecewiseError> {
        self.check(map, selection, &[("the point x", x), ("the tangent t", t)])?;
        choose(x, selection);
        map.residual(selection, x, &mut self.r);
        let mut outcome = Correction {
            converged: false,
            iterations: 0,
            residual_norm: norm(&self.r),
            step_norm: f64::INFINITY,
            rate: 0.0,
        };
        // Chord steps with the present factors, and corrections before these.
        let (mut steps, mut before) = (0_usize, 0);
        let mut taken = 0;
        if max_iterations == 0 {
            self.factorise(map, selection, x, Some(t))?;
        }
        let (mut chord, mut met) = (false, false);
        while met || outcome.iterations < max_iterations {
            if !chord {
                self.factorise(map, selection, x, Some(t))?;
                (before, steps) = (outcome.iterations, 0);
            }
            self.bordered.solve(&self.r, t, 0.0, &mut self.dx)?;
            let step = norm(&self.dx);
            if chord && (step.is_nan() || step > CONTRACTION * outcome.step_norm) {
                if met {
                    // As accurate as rounding permits with these factors.
                    break;
                }
                chord = false;
                continue;
            }
            for (x, d) in x.iter_mut().zip(&self.dx) {
                *x -= d;
            }
            if !chord {
                turn_into(self.bordered.tangent(), t);
            }
            let kept = (self.jac.nrows() > DENSE_LIMIT).then(|| selection.clone());
            choose(x, selection);
            chord = kept.as_ref() == Some(selection);
            map.residual(selection, x, &mut self.r);
            self.iterations += 1;
            steps += 1;
            taken += 1;
            outcome.residual_norm = norm(&self.r);
            outcome.compare(taken, step);
            if !met {
                outcome.iterations = before + newton_steps(steps);
            }
            if !(outcome.residual_norm.is_finite() && step.is_finite()) {
                return Ok(outcome);
            }
            met = met
                || measure(&self.r) < tol_residual && (step < tol_step || self.is_rounding(step, x, t)?);
            // The error after chord steps is a fraction of the last step, after Newton steps far less.
            let left = QUADRATIC * tol_step;
            if met && (steps == 1 || !chord || step < left || self.is_rounding(step, x, t)?) {
                break;
            }
        }
        outcome.converged = met;
        if steps > 1 {
            let taken = self.take_tangent(map, x, t);
            if met {
                taken?;
            }
        }
        Ok(outcome)
    }

    /// Solves H^(σ)(X) = 0 in the hyperplane normal·(X − anchor) = s (Keller's pseudo-arclength), `plane` =
    /// (anchor, normal, s), from the guess X = `x`, until steps no longer shrink, that is, to rounding. `t`
    /// becomes the tangent of the linearisation, which is that of the last iterate but one, oriented along
    /// the normal.
    ///
    /// # Errors
    /// Singular or non-finite linear systems, vectors of other lengths, selections of other maps.
    pub fn correct_in_plane<P: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &P,
        selection: &Selection,
        plane: (&[f64], &[f64], f64),
        x: &mut [f64],
        t: &mut [f64],
    ) -> Result<(Correction, Linearisation<'_, L>), PiecewiseError> {
        let correction = self.correct_in_plane_on(&map, selection, plane, x, Some(t))?;
        Ok((correction, Linearisation::of(self)))
    }

    /// [`correct_in_plane`](Self::correct_in_plane) without the tangent, by chord steps with the last factors where they belong to the same
    /// selection and the steps converge.
    pub(crate) fn correct_by_chords<P: PiecewiseSmooth + ?Sized>(
        &mut self,
        map: &P,
        selection: &Selection,
        plane: (&[f64], &[f64], f64),
        x: &mut [f64],
    ) -> Result<(Correction, Linearisation<'_, L>), PiecewiseError> {
        let correction = self.correct_in_plane_on(&map, selection, plane, x, None)?;
        Ok((correction, Linearisation::of(self)))
    }

    /// Whether a step from x in the plane normal to `normal` is no longer than the step that rounding errors of H cause with the stored
    /// factors: ε times the terms of each row, with alternating signs.
    fn is_rounding(&mut self, step: f64, x: &[f64], normal: &[f64]) -> Result<bool, PiecewiseError> {
        // With a nearly singular Jacobian x is not determined more accurately.
        if step.is_nan() || step > SIX_DIGITS * (1.0 + norm(x)) {
            return Ok(false);
        }
        let rounding = match self.rounding {
            Some(known) => known,
            None => {
                let (rows, made) = &mut self.errors;
                row_sizes(self.jac.as_ref(), x, rows);
                for (i, e) in rows.iter_mut().enumerate() {
                    *e *= if i % 2 == 0 { f64::EPSILON } else { -f64::EPSILON };
                }
                self.bordered.solve(rows, normal, 0.0, made)?;
                norm(made)
            }
        };
        self.rounding = Some(rounding);
        Ok(step <= AT_ROUNDING * rounding)
    }

    fn correct_in_plane_on(
        &mut self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        (anchor, normal, s): (&[f64], &[f64], f64),
        x: &mut [f64],
        mut t: Option<&mut [f64]>,
    ) -> Result<Correction, PiecewiseError> {
        const LIMIT: usize = 20;
        let vectors = [
            ("the point x", &*x),
            ("the tangent t", t.as_deref().unwrap_or(normal)),
            ("the anchor", anchor),
            ("the normal", normal),
        ];
        self.check(map, selection, &vectors)?;
        let mut outcome = Correction {
            converged: false,
            iterations: 0,
            residual_norm: f64::INFINITY,
            step_norm: f64::INFINITY,
            rate: 0.0,
        };
        let known = matches!(self.held, Held::Point | Held::Nearby | Held::Refined);
        let mut chord = t.is_none() && known && self.selection == *selection;
        let mut guess = chord.then(|| x.to_vec());
        self.secants.clear();
        while outcome.iterations < LIMIT {
            map.residual(selection, x, &mut self.r);
            let offset = x
                .iter()
                .zip(anchor)
                .zip(normal)
                .map(|((x, a), n)| (x - a) * n)
                .sum::<f64>()
                - s;
            if !chord {
                self.factorise(map, selection, x, Some(normal))?;
            }
            self.bordered.solve(&self.r, normal, offset, &mut self.dx)?;
            // Steps that are rounding errors carry no information on the Jacobian.
            if chord && !self.is_rounding(norm(&self.dx), x, normal)? {
                self.secants.turn(&mut self.dx);
            }
            if let Some(t) = &mut t {
                let tangent = self.bordered.tangent();
                let sign = dot(tangent, normal).signum();
                for (t, v) in t.iter_mut().zip(tangent) {
                    *t = sign * v;
                }
            }
            let step = norm(&self.dx);
            let size = norm(x);
            let noise = 4.0 * f64::EPSILON * size;
            let least = if chord { SECANTS } else { CONTRACTION };
            let slow = step.is_nan() || step > least * outcome.step_norm;
            let small = step <= SAME * (1.0 + size);
            let rounding = step <= noise || (small || slow) && self.is_rounding(step, x, normal)?;
            if chord && slow && !rounding {
                // The factors belong to a point too far away: restart from the guess, unless the chord steps have come near.
                self.secants.clear();
                if let Some(guess) = guess.take().filter(|_| outcome.iterations < 2) {
                    x.copy_from_slice(&guess);
                    outcome.step_norm = f64::INFINITY;
                }
                chord = false;
                continue;
            }
            self.iterations += 1;
            outcome.iterations += 1;
            outcome.residual_norm = norm(&self.r);
            if !(step.is_finite() && outcome.residual_norm.is_finite()) {
                return Ok(outcome);
            }
            // The last correction is applied while it still improves on its predecessor.
            if step < 0.5 * outcome.step_norm || rounding {
                for (x, d) in x.iter_mut().zip(&self.dx) {
                    *x -= d;
                }
                if t.is_none() {
                    self.secants.push(&self.dx);
                }
            }
            let stalled = step >= 0.5 * outcome.step_norm;
            outcome.compare(outcome.iterations, step);
            let piecewise_exact = map.is_piecewise_affine() && outcome.iterations >= 2;
            if rounding || piecewise_exact || (stalled && small) {
                outcome.converged = true;
                return Ok(outcome);
            }
            if stalled && outcome.iterations > 4 {
                return Ok(outcome);
            }
            chord = t.is_none();
        }
        Ok(outcome)
    }
}
