use std::time::Duration;

use crate::InputError;
use crate::input::check_options;
use crate::options::setters;
use crate::words::named;

/// The strategies of [`ConeSolver`](super::ConeSolver).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ConeStrategy {
    /// Full steps of Newton's method for the natural map, as long as they converge (L. Qi, J. Sun, 1993).
    Newton,
    /// Where F is affine and monotone: interior points with the scaling of Yu. Nesterov and M. Todd (1997) and the corrector of S. Mehrotra
    /// (1992), ended by steps of the natural map.
    InteriorPoints,
    /// A smoothing Newton method for the Fischer–Burmeister function, ended by steps of the natural map (M. Fukushima, Z.-Q. Luo, P. Tseng,
    /// 2002; S. Hayashi, N. Yamashita, M. Fukushima, 2005).
    Smoothing,
    /// Interior points for F that are not affine and monotone.
    CentralPath,
    /// Proximal points, F(x) + w (x − x_k) with w → 0 (R. T. Rockafellar, 1976): for monotone F whose solutions are not unique.
    ProximalPoints,
}

impl ConeStrategy {
    const ALL: [Self; 5] = [
        Self::Newton,
        Self::InteriorPoints,
        Self::Smoothing,
        Self::CentralPath,
        Self::ProximalPoints,
    ];

    /// The strategy in words.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Newton => "Newton",
            Self::InteriorPoints => "interior points",
            Self::Smoothing => "smoothing",
            Self::CentralPath => "central path",
            Self::ProximalPoints => "proximal points",
        }
    }
}

named!(ConeStrategy, "strategy for a cone problem", Self::ALL);

/// Memory in bytes that a solve may take unless told otherwise, and a map: half of what a small machine has.
pub(super) const MEMORY: u64 = 1 << 32;

/// Options of [`ConeSolver`](super::ConeSolver).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct ConeOptions {
    /// Bound on [`ConeReport::error`](super::ConeReport::error). Default 1e-10.
    pub tolerance: f64,
    /// Largest number of iterations, over all starts and methods. Default 100 000.
    pub max_iterations: usize,
    /// Strategies tried from the first start, in this order, each only if all before it failed. Default: all of [`ConeStrategy`], in the
    /// order of its variants.
    ///
    /// On 284 problems of 31 families (the example `corrector_convergence` with `--full`) Newton's method before interior points takes 0.82
    /// of the work, and 0.79 of the time, that interior points take without it, in the mean. Among all orders with one strategy moved it is
    /// the best by work on a random half of the families in 99.5 % of the cases, and takes 0.73 to 0.92 of the work on the other half in
    /// nine of ten. With smoothing first instead it is 0.91 of the work and 0.73 of the time.
    pub strategies: Vec<ConeStrategy>,
    /// Further starts, should the first one fail, for the smoothing method. Default 8.
    pub restarts: usize,
    /// Largest wall-clock time. Default none.
    pub max_time: Option<Duration>,
    /// Largest memory in bytes: an estimate is compared with it before any of it is allocated
    /// ([`ComplementarityError::Memory`](crate::complementarity::ComplementarityError::Memory)). Default 4 GiB, where one second-order cone may have some 6 500 variables, and
    /// a semidefinite one the order 110.
    pub max_memory: u64,
}

impl Default for ConeOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-10,
            max_iterations: 100_000,
            strategies: ConeStrategy::ALL.to_vec(),
            restarts: 8,
            max_time: None,
            max_memory: MEMORY,
        }
    }
}

impl ConeOptions {
    setters! {
        /// Sets the bound on the error.
        with_tolerance(tolerance: f64);
        /// Sets the largest number of iterations.
        with_max_iterations(max_iterations: usize);
        /// Sets the strategies and their order.
        with_strategies(strategies: Vec<ConeStrategy>);
        /// Sets the number of further starts.
        with_restarts(restarts: usize);
        /// Sets the largest wall-clock time.
        with_max_time(max_time: Option<Duration>);
        /// Sets the largest memory in bytes.
        with_max_memory(max_memory: u64);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// A tolerance that is not between 2⁻⁵² and 1, an empty list of strategies.
    pub fn validate(&self) -> Result<(), InputError> {
        let fine = (f64::EPSILON..1.0).contains(&self.tolerance);
        let tries = !self.strategies.is_empty();
        check_options(&[
            (
                "tolerance",
                self.tolerance,
                fine,
                "at least 2.3e-16 and less than 1",
            ),
            ("strategies", 0.0, tries, "a list of at least one strategy"),
        ])
    }
}
