use std::time::Duration;

use crate::InputError;
use crate::input::{any, check_options, fraction};
use crate::options::setters;

/// Options of [`ReducedContact`](super::ReducedContact). The defaults suit most problems.
///
/// ```
/// use semismooth::contact::ReducedOptions;
/// let options = ReducedOptions::default().with_tolerance(1e-8).with_max_memory(Some(2 << 30));
/// assert!(options.validate().is_ok());
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct ReducedOptions {
    /// Largest residual of a solution in each block of equations (equilibrium, normal law, friction) relative to the largest force in it:
    /// those of [`ContactResiduals`](crate::contact::ContactResiduals). Default 1e-10.
    pub tolerance: f64,
    /// Largest number of Newton steps of each run. Default 60.
    pub max_iterations: usize,
    /// Largest number of GMRES iterations of each step. Default 400.
    pub max_krylov: usize,
    /// Directions that GMRES keeps, two vectors of displacements each, allocated as they are needed. Default 30.
    pub directions: usize,
    /// Largest relative residual to which the linear system of a step is solved (η_max of Eisenstat and Walker); it is that of the first
    /// step of a run and of all steps after nodes have changed their piece. Default 0.1.
    pub forcing: f64,
    /// Largest number of load steps, tried when Newton's method does not converge from the start; 0 skips them. Default 100.
    pub max_load_steps: usize,
    /// Largest number of displacements in space with which the condensed form, which factors the stiffness matrix, is tried when load steps
    /// fail as well; ten times as many in the plane, where factors have less fill-in. 0 skips it. Default 100 000.
    pub max_condensed: usize,
    /// Wall-clock time after which the construction of a problem ends, and each solve with its best iterate. It is checked between GMRES
    /// iterations, and in multigrid at each strip of rows: between two checks there is at most a product with the stiffness matrix, or a
    /// pass over the directions of GMRES; the condensed form checks it between factorisations. Default none: with a limit results depend on
    /// the machine.
    pub max_time: Option<Duration>,
    /// Memory in bytes that multigrid and GMRES may take in addition to the body, by an estimate made before they are allocated. Default
    /// none.
    pub max_memory: Option<u64>,
}

impl Default for ReducedOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-10,
            max_iterations: 60,
            max_krylov: 400,
            directions: 30,
            forcing: 0.1,
            max_load_steps: 100,
            max_condensed: 100_000,
            max_time: None,
            max_memory: None,
        }
    }
}

impl ReducedOptions {
    setters! {
        /// Sets the largest residual of a solution.
        with_tolerance(tolerance: f64);
        /// Sets the largest number of Newton steps.
        with_max_iterations(max_iterations: usize);
        /// Sets the largest number of GMRES iterations of a step.
        with_max_krylov(max_krylov: usize);
        /// Sets the number of directions that GMRES keeps.
        with_directions(directions: usize);
        /// Sets the largest relative residual of a linear system.
        with_forcing(forcing: f64);
        /// Sets the largest number of load steps.
        with_max_load_steps(max_load_steps: usize);
        /// Sets the number of displacements up to which the condensed form is tried.
        with_max_condensed(max_condensed: usize);
        /// Sets the largest wall-clock time.
        with_max_time(max_time: Option<Duration>);
        /// Sets the largest memory of multigrid and GMRES.
        with_max_memory(max_memory: Option<u64>);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        let fine = self.tolerance >= 1e-14 && self.tolerance < 1.0;
        check_options(&[
            ("tolerance", self.tolerance, fine, "at least 1e-14 and below 1"),
            fraction("forcing", self.forcing),
            any("max_iterations", self.max_iterations as u64),
            any("max_krylov", self.max_krylov as u64),
            any("directions", self.directions as u64),
        ])
    }
}
