//! The corrector: Newton's method for piecewise-smooth and semismooth equations.

mod chords;
mod convergence;
mod enclosed;
mod error;
mod far;
mod forcing;
mod inexact;
mod iterate;
mod moore_penrose;
mod options;
mod regularity;
mod report;
mod secants;
mod solver;
mod step;
mod system;
mod workspace;

pub(crate) use enclosed::{regular_radius, step_enclosure};
pub use error::{NewtonError, Unsolved};
pub use forcing::{Forcing, NewtonKrylovOptions};
pub use inexact::NewtonKrylov;
pub use moore_penrose::{Correction, Linearisation, MoorePenrose};
pub use options::{Damping, NewtonOptions};
pub use report::{Convergence, Iteration, Report, Step};
pub(crate) use report::{Tail, observed_order};
pub use solver::Newton;
