//! Proximal points, and what their displacement proves.

use crate::complementarity::infeasible::Conditions;
use crate::complementarity::solver::engine::Engine;
use crate::complementarity::solver::plan::Plan;
use crate::run::Status;
use crate::sparse::max_abs;

impl Plan {
    /// A proximal problem, solved to the residual `loose`. `defects::rank_deficient_monotone_problems_take_few_iterations`.
    pub(super) const fn proximal(epsilon: f64) -> Self {
        Self {
            scaled: false,
            proximal: epsilon,
            loose: 1e-8,
            ..Self::newton(40)
        }
    }
}

/// How ε falls from the size of ∇F.
struct Proximal {
    rounds: usize,
    shrink: f64,
    /// Smallest ε relative to the size of ∇F.
    least: f64,
}

impl Proximal {
    /// Growth of ε after a problem that was not solved, and ε relative to the size of ∇F beyond which that ends.
    const GROWTH: f64 = 30.0;
    const MOST: f64 = 1e4;
    /// Range of the size of ∇F.
    const SIZES: (f64, f64) = (1e-6, 1e6);
    /// Fall of the residual after which, or rounds after which, Newton's method tries to finish, and its iterations.
    const FALL: f64 = 0.1;
    const EVERY: usize = 4;
    const FINISH: usize = 15;
}

/// `properties::positive_semidefinite_problems_are_solved_exactly_if_feasible`,
/// `outcomes::infeasible_affine_problems_come_with_a_certificate`.
const PROXIMAL_AFFINE: Proximal = Proximal {
    rounds: 40,
    shrink: 0.1,
    least: 1e-7,
};

/// `corpus::more_problems_of_the_literature_from_far_starts`; `tests/allocation.rs` ends there.
const PROXIMAL_SMOOTH: Proximal = Proximal {
    rounds: 24,
    shrink: 0.2,
    least: 1e-9,
};

/// A certificate of infeasibility. `outcomes::infeasible_affine_problems_come_with_a_certificate`,
/// `accuracy::units_do_not_decide_what_is_solved`.
struct Certificate {
    /// Smallest displacement, relative to 1 + ‖x‖.
    displacement: f64,
    /// Smaller entries of v are zero.
    zero: f64,
    /// (Mᵀv)ⱼ is zero up to this part of its terms.
    orthogonal: f64,
    /// sup vᵀF must be negative by this part of its terms.
    margin: f64,
}

const CERTIFICATE: Certificate = Certificate {
    displacement: 1e-6,
    zero: 1e-12,
    orthogonal: 1e-10,
    margin: 1e-7,
};

impl Engine<'_> {
    /// Proximal points with ε → 0, the centre moving along.
    pub(super) fn proximal_points(&mut self) -> Status {
        if !self.evaluate() || !self.jacobian() {
            return Status::Stalled;
        }
        let size = max_abs(self.work.lin.jac().values()).clamp(Proximal::SIZES.0, Proximal::SIZES.1);
        let mut epsilon = size;
        let mut outcome = Status::Stalled;
        let mut last = f64::INFINITY;
        let weights = match self.affine {
            true => PROXIMAL_AFFINE,
            false => PROXIMAL_SMOOTH,
        };
        for k in 0..weights.rounds {
            let w = &mut *self.work;
            w.equations.centre.copy_from_slice(&w.here.x);
            let plan = Plan::proximal(epsilon);
            outcome = Status::Stalled;
            if self.affine {
                outcome = self.affine_newton(&plan);
                if outcome != Status::Solved {
                    let w = &mut *self.work;
                    w.here.x.copy_from_slice(&w.equations.centre);
                    if self.affine_path(&plan) {
                        outcome = Status::Solved;
                    }
                }
            }
            if outcome != Status::Solved {
                outcome = self.descend(&plan);
            }
            if let Some(status) = self.exhausted() {
                return status;
            }
            if outcome != Status::Solved {
                // Too little regularisation, or a centre too far away.
                let w = &mut *self.work;
                w.here.x.copy_from_slice(&w.equations.centre);
                epsilon *= Proximal::GROWTH;
                if epsilon > Proximal::MOST * size {
                    return outcome;
                }
                continue;
            }
            let residual = self.residual();
            if self.affine && self.certify() {
                return Status::NoSolution;
            }
            if residual <= Proximal::FALL * last || (k + 1) % Proximal::EVERY == 0 {
                let w = &mut *self.work;
                w.equations.centre.copy_from_slice(&w.here.x);
                if self.descend(&Plan::newton(Proximal::FINISH)) == Status::Solved {
                    return Status::Solved;
                }
                let w = &mut *self.work;
                w.here.x.copy_from_slice(&w.equations.centre);
            }
            last = last.min(residual);
            epsilon = (epsilon * weights.shrink).max(weights.least * size);
        }
        match outcome {
            Status::Solved => Status::Stalled,
            other => other,
        }
    }

    /// Whether x − centre proves an affine problem infeasible: v a recession direction of the box, so that vᵀF ≥ 0 at solutions, and sup
    /// (Mᵀv)ᵀx + qᵀv < 0 over the bounds, up to rounding, and whether exact arithmetic confirms that there is no solution.
    fn certify(&mut self) -> bool {
        let n = self.n();
        let mut v: Vec<f64> = (0..n)
            .map(|i| {
                let d = self.work.here.x[i] - self.work.equations.centre[i];
                match (self.lower[i].is_finite(), self.upper[i].is_finite()) {
                    (true, true) => 0.0,
                    (true, false) => d.max(0.0),
                    (false, true) => d.min(0.0),
                    (false, false) => d,
                }
            })
            .collect();
        let norm = max_abs(&v);
        if norm <= CERTIFICATE.displacement * (1.0 + max_abs(&self.work.here.x)) {
            return false;
        }
        for v in &mut v {
            *v /= norm;
            if v.abs() < CERTIFICATE.zero {
                *v = 0.0;
            }
        }
        if !self.jacobian() {
            return false;
        }
        let w = &mut *self.work;
        // q = F(0), as M x + q would lose it far out.
        w.trial.x.fill(0.0);
        self.function.value(&w.trial.x, &mut w.trial.f);
        self.report.evaluations += 1;
        let jac = w.lin.jac();
        let mut sum: f64 = w.trial.f.iter().zip(&v).map(|(q, v)| q * v).sum();
        let mut size: f64 = w.trial.f.iter().zip(&v).map(|(q, v)| (q * v).abs()).sum();
        let pattern = jac.pattern();
        for j in 0..n {
            let span = pattern.col_ptr()[j]..pattern.col_ptr()[j + 1];
            let terms = pattern.row_idx()[span.clone()].iter().zip(&jac.values()[span]);
            let (s, terms) = terms.fold((0.0, 0.0), |(s, t), (&i, a)| (s + a * v[i], t + (a * v[i]).abs()));
            let bound = if s > 0.0 { self.upper[j] } else { self.lower[j] };
            if bound.is_finite() {
                sum += s * bound;
                size += terms * bound.abs();
            } else if s.abs() > CERTIFICATE.orthogonal * terms {
                return false;
            }
        }
        let conditions = Conditions {
            matrix: jac,
            q: &w.trial.f,
            lower: self.lower,
            upper: self.upper,
        };
        let proven = sum < -CERTIFICATE.margin * size && conditions.contradict(&v);
        if proven {
            self.report.certificate = v;
        }
        proven
    }
}
