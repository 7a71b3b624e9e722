//! What people take away: branches as CSV tables and, with the `svg` feature, as diagrams.

mod csv;
#[cfg(feature = "svg")]
mod diagram;
#[cfg(feature = "svg")]
mod draw;
mod error;
#[cfg(feature = "svg")]
mod plane;
#[cfg(feature = "vtk")]
mod vtu;
mod walk;

pub use csv::{Column, write_csv};
#[cfg(feature = "svg")]
pub use diagram::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
pub use error::OutputError;
#[cfg(feature = "vtk")]
pub use vtu::{Field, write_vtu};
