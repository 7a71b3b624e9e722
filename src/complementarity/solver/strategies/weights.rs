//! The weights of all strategies, with the tests that tell when one is wrong (`tests/mcp`, unless said otherwise).

use crate::complementarity::solver::engine::Plan;

impl Plan {
    /// Newton's method with equilibration. `globalisation` (memory, credit), `properties::permuting_and_scaling_do_not_matter` (scaled),
    /// `defects::singular_jacobians_at_solutions_need_no_help` (λ).
    pub(super) const fn newton(max_iterations: usize) -> Self {
        Self {
            natural: true,
            lambda: 0.95,
            scaled: true,
            memory: 4,
            credit: 6,
            proximal: 0.0,
            loose: 0.0,
            max_iterations,
        }
    }

    /// The penalised Fischer–Burmeister function. `corpus::more_problems_of_the_literature_from_far_starts`.
    pub(super) const fn fischer(max_iterations: usize) -> Self {
        Self {
            natural: false,
            lambda: 0.9,
            scaled: false,
            memory: 8,
            credit: 8,
            ..Self::newton(max_iterations)
        }
    }

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
pub(super) struct Proximal {
    pub(super) rounds: usize,
    pub(super) shrink: f64,
    /// Smallest ε relative to the size of ∇F.
    pub(super) least: f64,
}

impl Proximal {
    /// Growth of ε after a problem that was not solved, and ε relative to the size of ∇F beyond which that ends.
    pub(super) const GROWTH: f64 = 30.0;
    pub(super) const MOST: f64 = 1e4;
    /// Range of the size of ∇F.
    pub(super) const SIZES: (f64, f64) = (1e-6, 1e6);
    /// Fall of the residual after which, or rounds after which, Newton's method tries to finish, and its iterations.
    pub(super) const FALL: f64 = 0.1;
    pub(super) const EVERY: usize = 4;
    pub(super) const FINISH: usize = 15;
}

/// `properties::positive_semidefinite_problems_are_solved_exactly_if_feasible`, `outcomes::infeasible_affine_problems_come_with_a_certificate`.
pub(super) const PROXIMAL_AFFINE: Proximal = Proximal {
    rounds: 40,
    shrink: 0.1,
    least: 1e-7,
};

/// `corpus::more_problems_of_the_literature_from_far_starts`; `tests/allocation.rs` ends there.
pub(super) const PROXIMAL_SMOOTH: Proximal = Proximal {
    rounds: 24,
    shrink: 0.2,
    least: 1e-9,
};

/// A certificate of infeasibility. `outcomes::infeasible_affine_problems_come_with_a_certificate`,
/// `accuracy::units_do_not_decide_what_is_solved`.
pub(super) struct Certificate {
    /// Smallest displacement, relative to 1 + ‖x‖.
    pub(super) displacement: f64,
    /// Smaller entries of v are zero.
    pub(super) zero: f64,
    /// (Mᵀv)ⱼ is zero up to this part of its terms.
    pub(super) orthogonal: f64,
    /// sup vᵀF must be negative by this part of its terms.
    pub(super) margin: f64,
}

pub(super) const CERTIFICATE: Certificate = Certificate {
    displacement: 1e-6,
    zero: 1e-12,
    orthogonal: 1e-10,
    margin: 1e-7,
};

/// Linearised problems. `corpus::more_problems_of_the_literature_from_far_starts`.
pub(super) struct Josephy {
    pub(super) rounds: usize,
    /// Iterations of Newton's method after each.
    pub(super) newton: usize,
    /// Multiples of I added to a Jacobian whose path does not leave the start.
    pub(super) shifts: [f64; 3],
    /// Shortest step along the solution, and growth of the merit that is let pass.
    pub(super) shortest: f64,
    pub(super) growth: f64,
    /// Margins by which components are held at bounds at the start of the path: from this on, spread over as much again.
    pub(super) margin: f64,
}

pub(super) const JOSEPHY: Josephy = Josephy {
    rounds: 20,
    newton: 8,
    shifts: [0.0, 1e-6, 1e-3],
    shortest: 1e-4,
    growth: 4.0,
    margin: 0.5,
};

/// The homotopy. `outcomes::paths_and_enumeration_keep_their_limits`, `corpus::more_problems_of_the_literature_from_far_starts`.
pub(super) struct Homotopy {
    /// Iterations of Newton's method at its end.
    pub(super) newton: usize,
    /// Distances of the anchor from bounds: from the first on, spread over the second.
    pub(super) margin: (f64, f64),
    /// Largest part of the width of a box for them.
    pub(super) inner: f64,
    /// Distance to a bound, relative to 1 + |x|, that counts as none.
    pub(super) at_bound: f64,
    /// How far t may turn back.
    pub(super) back: f64,
}

pub(super) const HOMOTOPY: Homotopy = Homotopy {
    newton: 60,
    margin: (0.05, 0.1),
    inner: 0.25,
    at_bound: 1e-9,
    back: 0.05,
};

/// Smoothing. `strategies::each_strategy_solves_a_monotone_problem_alone`.
pub(super) struct Smoothing {
    /// Largest μ at the start.
    pub(super) first: f64,
    /// Fall of μ once ‖Φ_μ‖ is below `centred` μ, and its end.
    pub(super) shrink: f64,
    pub(super) centred: f64,
    pub(super) least: f64,
    /// Shortest step.
    pub(super) shortest: f64,
    /// Iterations of Newton's method at the end.
    pub(super) newton: usize,
}

pub(super) const SMOOTHING: Smoothing = Smoothing {
    first: 1.0,
    shrink: 0.2,
    centred: 2.0,
    least: 1e-10,
    shortest: 1e-6,
    newton: 30,
};

/// Affine problems up to this size are enumerated. `properties::arbitrary_small_problems_are_never_claimed_wrongly`.
pub(super) const ENUMERABLE: usize = 24;

/// Iterations of Newton's method at an enumerated solution.
pub(super) const POLISH: usize = 10;

/// Half widths of the perturbed starts, in this order again and again. `corpus::more_problems_of_the_literature_from_far_starts`.
pub(super) const RESTART_WIDTHS: [f64; 12] =
    [1.0, 0.1, 10.0, 1.0, 100.0, 10.0, 0.01, 3.0, 30.0, 1e3, 0.3, 1.0];

/// Perturbed starts from which paths are followed, too.
pub(super) const RESTART_PATHS: usize = 6;

/// Steps into the domain of F. `defects::logarithm_with_a_free_variable_is_not_solved_outside_its_domain`.
pub(super) const DOMAIN_STEPS: [f64; 5] = [1e-6, 1e-4, 1e-2, 0.1, 1.0];

/// Numbers in [0, 1), different for each component and spread evenly (a Weyl sequence).
pub(super) fn spread(i: usize) -> f64 {
    crate::spread::golden(i + 1)
}

/// The same for each perturbed start, with another irrational number.
pub(super) fn spread_runs(k: usize) -> f64 {
    const SILVER: f64 = 0.414_213_562_373_095;
    ((k + 1) as f64 * SILVER).fract()
}
