//! The names most programs need: `use semismooth::prelude::*;`.
//!
//! ```
//! use semismooth::prelude::*;
//!
//! // 0 ≤ x ⟂ 2 x − 3 ≥ 0.
//! let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
//!     a[0] = x[0];
//!     b[0] = 2.0 * x[0] - 3.0;
//! });
//! let mut x = [0.0];
//! Newton::new(NewtonOptions::default()).solve(&map, &mut x)?;
//! assert_eq!(x, [1.5]);
//! # Ok::<(), NewtonError>(())
//! ```

pub use crate::complementarity::{
    AffineFunction, ComplementarityError, Lcp, Mcp, McpFunction, McpOptions, McpReport, McpSolver,
    WithJacobian,
};
#[cfg(feature = "autodiff")]
pub use crate::complementarity::{Autodiff, SmoothFunction};
pub use crate::continuation::{
    Branch, Continuation, ContinuationError, ContinuationOptions, Diagram, DiagramOptions, Direction, Event,
    Termination, Transition, TransitionKind,
};
pub use crate::enumeration::{EnumerationOptions, all_arms, all_solutions};
pub use crate::newton::{Newton, NewtonError, NewtonOptions};
pub use crate::piecewise::{
    Facet, MinMap, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Real, Selection, Semismooth,
};
#[cfg(feature = "autodiff")]
pub use crate::piecewise::{Formula, Kinks, NonsmoothFunction, Traced};
pub use crate::run::Status;
pub use crate::sparse::{Matrix, Pattern};
