//! Directions, and how far to go along them.

use super::McpStep;
use super::engine::Engine;
use super::plan::Plan;
use super::work::Work;
use crate::complementarity::fischer::{Gap, component_gradient, is_kink};
use crate::linear::DENSE_LIMIT;
use crate::tolerances::ARMIJO;

/// Regularised steps by normal equations: the first parameter relative to ‖Φ‖ (at most 1), its growth, and how many are tried.
const REGULARISED: (f64, f64, usize) = (1e-3, 30.0, 5);
/// The same for larger problems, whose J gets a multiple of the identity.
const SHIFTED: (f64, f64, usize) = (1e-3, 10.0, 4);
/// Shortest steps along the Newton step of Φ, along regularised ones, and along the gradient relative to the first one.
const SHORTEST: [f64; 3] = [1e-2, 0.1, 1e-10];

impl Engine<'_> {
    /// The active set at `work.here.x`: −1 lower, +1 upper; returns whether it is unchanged.
    pub(super) fn update_active(&mut self) -> bool {
        let mut same = true;
        for i in 0..self.n() {
            let Gap { below, above } = self.gap(i, self.work.here.x[i]);
            let f = self.work.equations.scaled[i];
            let now = if self.lower[i] == self.upper[i] || f > below {
                -1
            } else if -f > above {
                1
            } else {
                0
            };
            same &= now == self.work.system.active[i];
            self.work.system.active[i] = now;
        }
        same
    }

    /// The Newton step of the natural map for the current active set.
    pub(super) fn natural_step(&mut self) -> bool {
        self.bound_steps();
        self.report.factorisations += 1;
        let Work {
            lin,
            equations,
            system,
            ..
        } = &mut *self.work;
        system.solve_natural(lin.scaled(), &equations.scaled)
    }

    /// The steps of the components at bounds, 0 for the others.
    pub(super) fn bound_steps(&mut self) {
        let w = &mut *self.work;
        for i in 0..w.n {
            w.system.d[i] = match w.system.active[i] {
                -1 => (self.lower[i] - w.here.x[i]) / w.lin.col()[i],
                1 => (self.upper[i] - w.here.x[i]) / w.lin.col()[i],
                _ => 0.0,
            };
        }
    }

    /// trial_x = P(x + t C d); components that step to a bound land on it.
    pub(super) fn make_trial(&mut self, t: f64, inside: bool) {
        let w = &mut *self.work;
        for i in 0..w.n {
            let x = w.here.x[i] + t * w.lin.col()[i] * w.system.d[i];
            w.trial.x[i] = match w.system.active[i] {
                -1 if t == 1.0 && inside => self.lower[i],
                1 if t == 1.0 && inside => self.upper[i],
                _ if inside => x.max(self.lower[i]).min(self.upper[i]),
                _ => x,
            };
        }
    }

    pub(super) fn accept_trial(&mut self) {
        let w = &mut *self.work;
        std::mem::swap(&mut w.here.x, &mut w.trial.x);
        std::mem::swap(&mut w.here.f, &mut w.trial.f);
    }

    /// ‖x − trial_x‖∞.
    pub(super) fn step_length(&self) -> f64 {
        let w = &*self.work;
        (0..w.n).fold(0.0, |m: f64, i| m.max((w.here.x[i] - w.trial.x[i]).abs()))
    }

    /// The merit at P(x + t C d), which is left in `work.trial.x`; `None` where F is not finite.
    pub(super) fn try_along(&mut self, plan: &Plan, t: f64) -> Option<f64> {
        self.work.system.active.fill(0);
        self.make_trial(t, true);
        if !self.evaluate_trial() {
            return None;
        }
        Some(self.trial_merit(plan))
    }

    /// A full, projected step of the natural map: taken where it helps, or as a step without decrease.
    pub(super) fn try_natural(
        &mut self,
        plan: &Plan,
        reference: f64,
        locked: bool,
        inside: bool,
    ) -> Option<f64> {
        self.update_active();
        if !self.natural_step() {
            return None;
        }
        self.make_trial(1.0, inside);
        // Where x and F tie, the projection may undo the whole step.
        if self.step_length() == 0.0 {
            return None;
        }
        let mut t = 1.0;
        // Outside the domain of F: halve the step.
        while !self.evaluate_trial() {
            t *= 0.5;
            if t < 1e-3 {
                return None;
            }
            self.make_trial(t, inside);
        }
        let psi = self.trial_merit(plan);
        if psi.is_nan() {
            return None;
        }
        let wanted = if plan.credit == 0 { 0.5 } else { 1.0 - ARMIJO };
        if psi <= wanted * reference {
            return Some(t);
        }
        let w = &*self.work;
        if plan.proximal == 0.0 && self.residual_of(&w.trial.x, &w.trial.f) <= 0.25 * self.attempt_best {
            return Some(t);
        }
        (!locked && plan.credit > 0 && psi < 1e6 * (1.0 + reference)).then_some(t)
    }

    /// ∂Φ, its H in `work.system`, and HᵀΦ.
    pub(super) fn prepare_fischer(&mut self, plan: &Plan, shift: f64) {
        let n = self.n();
        let mut any = false;
        for i in 0..n {
            let gap = self.gap(i, self.work.here.x[i]);
            let kink = is_kink(gap, self.work.equations.scaled[i], plan.lambda);
            self.work.equations.kinks[i] = f64::from(u8::from(kink));
            any |= kink;
        }
        self.work.equations.rate.fill(0.0);
        if any {
            let Work { lin, equations, .. } = &mut *self.work;
            lin.scaled().mul_vec(&equations.kinks, &mut equations.rate);
        }
        for i in 0..n {
            let gap = self.gap(i, self.work.here.x[i]);
            let (a, b) = component_gradient(
                gap,
                self.work.equations.scaled[i],
                plan.lambda,
                self.work.equations.rate[i],
            );
            self.work.equations.by_x[i] = a;
            self.work.equations.by_f[i] = b;
        }
        self.work.build_fischer(shift);
        let Work {
            system, equations, ..
        } = &mut *self.work;
        system.mul_transpose(&equations.phi, &mut equations.gradient);
    }

    /// Line searches along the Newton step of Φ, regularised steps and the negative gradient.
    pub(super) fn try_fischer(
        &mut self,
        plan: &Plan,
        psi: f64,
        reference: f64,
        inside: bool,
    ) -> Option<(McpStep, f64)> {
        let n = self.n();
        // Steps to bounds are not special here.
        self.work.system.active.fill(0);
        self.prepare_fischer(plan, 0.0);
        let norm = (2.0 * psi).sqrt();
        for i in 0..n {
            self.work.system.d[i] = -self.work.equations.phi[i];
        }
        self.report.factorisations += 1;
        if self.work.system.solve()
            && let Some(t) = self.search(plan, psi, reference, 1.0, SHORTEST[0], inside)
        {
            return Some((McpStep::FischerBurmeister, t));
        }
        if n <= DENSE_LIMIT {
            let (first, growth, most) = REGULARISED;
            let mut mu = norm.min(1.0) * first;
            for _ in 0..most {
                if self.is_over_time() {
                    return None;
                }
                self.report.factorisations += 1;
                if self.work.solve_regularised(mu)
                    && let Some(t) = self.search(plan, psi, reference, 1.0, SHORTEST[1], inside)
                {
                    return Some((McpStep::Regularised, t));
                }
                mu *= growth;
            }
        } else {
            let (first, growth, most) = SHIFTED;
            let mut shift = norm.min(1.0) * first;
            for _ in 0..most {
                if self.is_over_time() {
                    return None;
                }
                self.work.build_fischer(shift);
                for i in 0..n {
                    self.work.system.d[i] = -self.work.equations.phi[i];
                }
                self.report.factorisations += 1;
                if self.work.system.solve()
                    && let Some(t) = self.search(plan, psi, reference, 1.0, SHORTEST[1], inside)
                {
                    return Some((McpStep::Regularised, t));
                }
                shift *= growth;
            }
        }
        let steepest: f64 = self.work.equations.gradient.iter().map(|g| g * g).sum();
        if steepest == 0.0 {
            return None;
        }
        let t = (2.0 * psi / steepest).min(1e6);
        for i in 0..n {
            self.work.system.d[i] = -self.work.equations.gradient[i];
        }
        self.search(plan, psi, reference, t, t * SHORTEST[2], inside)
            .map(|s| (McpStep::Gradient, s))
    }

    /// Armijo search along P(x + t C d) from t = `first` down to `least`.
    pub(super) fn search(
        &mut self,
        plan: &Plan,
        psi: f64,
        reference: f64,
        first: f64,
        least: f64,
        inside: bool,
    ) -> Option<f64> {
        let mut t = first;
        for _ in 0..40 {
            if !(t >= least && t > 0.0) || self.is_over_time() {
                break;
            }
            self.make_trial(t, inside);
            let slope: f64 = {
                let w = &*self.work;
                (0..w.n)
                    .map(|i| w.equations.gradient[i] * (w.trial.x[i] - w.here.x[i]) / w.lin.col()[i])
                    .sum()
            };
            if slope < 0.0 && self.evaluate_trial() {
                let trial = self.trial_merit(plan);
                if trial <= reference + ARMIJO * slope && (trial < psi * (1.0 - 1e-14) || reference > psi) {
                    return Some(t);
                }
            }
            t *= 0.5;
        }
        None
    }
}
