//! Parameters of an attempt. Names of tests, here and in `strategies`, are those of `tests/mcp` that fail where a number is wrong.

/// The numbers of a descent.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plan {
    /// Whether steps of the natural map are tried first.
    pub(super) natural: bool,
    /// λ of the penalised Fischer–Burmeister merit.
    pub(super) lambda: f64,
    pub(super) scaled: bool,
    /// Number of merits the non-monotone line search looks back on.
    pub(super) memory: usize,
    /// Number of steps in a row that need not bring the merit below its best value.
    pub(super) credit: usize,
    /// ε of the proximal term (0: none), around `Equations::centre`.
    pub(super) proximal: f64,
    /// Residual at which a proximal problem counts as solved.
    pub(super) loose: f64,
    pub(super) max_iterations: usize,
}

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
}

/// Numbers in [0, 1), different for each component and spread evenly (a Weyl sequence).
pub(super) fn spread(i: usize) -> f64 {
    crate::spread::golden(i + 1)
}
