use std::time::Duration;

use super::McpStrategy;
use crate::InputError;
use crate::input::{any, check_options, not_negative, positive};
use crate::options::setters;
use crate::piecewise::RegularityOptions;

/// Options of [`McpSolver`](super::McpSolver). The defaults suit most problems.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct McpOptions {
    /// Bound on the error of a solution relative to the terms of its rows ([accuracy](crate::complementarity#accuracy)). Default 1e-10.
    ///
    /// Iterations go on, as long as they make progress, while the natural residual max |xᵢ − mid(lᵢ, uᵢ, xᵢ − Fᵢ)|, in the units of x and
    /// F, is larger than this, too.
    pub tolerance: f64,
    /// Error that counts as solved where no strategy reaches the tolerance, as happens at solutions whose Jacobian is singular; it has an
    /// effect only if it exceeds the tolerance. Default 1e-8.
    pub acceptable: f64,
    /// Largest number of iterations, over all strategies, points of paths included. Default 20 000.
    pub max_iterations: usize,
    /// Largest number of iterations of one attempt. Default 200.
    pub max_attempt: usize,
    /// Largest wall-clock time, checked before each factorisation and each trial point. A factorisation is not interrupted: a full matrix
    /// of 800 unknowns takes some 50 ms. Default none.
    pub max_time: Option<Duration>,
    /// Whether F is evaluated within the bounds only. Default true. An affine F is evaluated anywhere.
    pub stay_inside: bool,
    /// Whether rows and columns are equilibrated, by powers of two, for the Jacobian at the start and again where rows have changed much.
    /// Default true.
    pub equilibrate: bool,
    /// What is tried, in this order, each only if all before it failed. Default: all of [`McpStrategy`], in the order of its variants.
    ///
    /// Of the eleven orders in which another strategy comes first or second, none is better throughout on 619 problems of 51 families (the
    /// example `corrector_convergence` with `--full`). With smoothing second, all families take 0.97 of the default's time in the mean. But
    /// the order that is best on a random half of the families takes 0.94 to 1.02 of that time on the other half in nine of ten cases
    /// (median 0.99), and 0.98 to 1.50 of the work (median 1.00).
    ///
    /// ```
    /// use semismooth::complementarity::{Mcp, McpOptions, McpSolver, McpStrategy};
    /// use semismooth::sparse::Matrix;
    /// let strategies = vec![McpStrategy::Smoothing, McpStrategy::Enumeration];
    /// let mut solver = McpSolver::new(McpOptions::default().with_strategies(strategies));
    /// let m = Matrix::from_rows(&[[2.0, 1.0], [1.0, 2.0]])?;
    /// let problem = Mcp::affine(m, vec![-5.0, -1.0], vec![0.0; 2], vec![f64::INFINITY; 2])?;
    /// let mut x = [1.0, 1.0];
    /// let report = solver.solve(&problem, &mut x)?;
    /// assert!(report.is_solved() && report.strategy == McpStrategy::Smoothing);
    /// assert!((x[0] - 2.5).abs() < 1e-9 && x[1].abs() < 1e-9);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub strategies: Vec<McpStrategy>,
    /// Whether other strategies follow where the first one fails. Default true.
    pub fallbacks: bool,
    /// Largest number of components for which paths are followed as a last resort; four times as many where F is affine and its paths are
    /// piecewise linear, as one sparse factorisation serves for 64 kinks. Default 300.
    pub max_path_size: usize,
    /// Largest number of points of one path, which count as iterations; 0 for no paths. Default 1500.
    pub max_path_points: usize,
    /// Largest number of partial selections tried where the linearised problem is solved by enumeration. Default 50 000.
    pub max_nodes: u64,
    /// Number of perturbed starts tried in the end. Default 12.
    pub restarts: usize,
    /// Whether, and how, the regularity of solutions is examined, for [`McpReport::regularity`](super::McpReport::regularity). Default
    /// `None`: it is not.
    pub regularity: Option<RegularityOptions>,
}

impl Default for McpOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-10,
            acceptable: 1e-8,
            max_iterations: 20_000,
            max_attempt: 200,
            max_time: None,
            stay_inside: true,
            equilibrate: true,
            strategies: McpStrategy::ALL.to_vec(),
            fallbacks: true,
            max_path_size: 300,
            max_path_points: 1500,
            max_nodes: 50_000,
            restarts: 12,
            regularity: None,
        }
    }
}

impl McpOptions {
    setters! {
        /// Sets the bound on the error of a solution.
        with_tolerance(tolerance: f64);
        /// Sets the error that counts as solved where the tolerance is out of reach.
        with_acceptable(acceptable: f64);
        /// Sets the largest number of iterations, over all strategies.
        with_max_iterations(max_iterations: usize);
        /// Sets the largest number of iterations of one attempt.
        with_max_attempt(max_attempt: usize);
        /// Sets the largest wall-clock time.
        with_max_time(max_time: Option<Duration>);
        /// Sets whether F is evaluated within the bounds only.
        with_stay_inside(stay_inside: bool);
        /// Sets whether rows and columns are equilibrated.
        with_equilibrate(equilibrate: bool);
        /// Sets what is tried, and in which order.
        with_strategies(strategies: Vec<McpStrategy>);
        /// Sets whether other strategies follow where the first one fails.
        with_fallbacks(fallbacks: bool);
        /// Sets the largest number of components for which paths are followed.
        with_max_path_size(max_path_size: usize);
        /// Sets the largest number of points of one path.
        with_max_path_points(max_path_points: usize);
        /// Sets the largest number of partial selections tried by enumeration.
        with_max_nodes(max_nodes: u64);
        /// Sets the number of perturbed starts.
        with_restarts(restarts: usize);
        /// Sets whether, and how, the regularity of solutions is examined.
        with_regularity(regularity: Option<RegularityOptions>);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        let tries = !self.strategies.is_empty();
        check_options(&[
            positive("tolerance", self.tolerance),
            not_negative("acceptable", self.acceptable),
            ("strategies", 0.0, tries, "a list of at least one strategy"),
            any("max_iterations", self.max_iterations as u64),
            any("max_attempt", self.max_attempt as u64),
        ])?;
        self.regularity
            .as_ref()
            .map_or(Ok(()), RegularityOptions::validate)
    }
}
