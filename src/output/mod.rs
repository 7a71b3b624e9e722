//! Output of results: branches and explored diagrams as CSV tables, fields on meshes for ParaView, and, by feature, diagrams as JSON
//! (`json`) and as SVG (`svg`) or PDF (`pdf`) pictures; reports of all this on one page of HTML (`svg`).

mod csv;
#[cfg(feature = "svg")]
mod diagram;
#[cfg(feature = "svg")]
mod draw;
mod error;
mod graph;
mod live;
#[cfg(feature = "svg")]
mod report;
#[cfg(feature = "svg")]
mod styles;
mod vtu;

pub use csv::{Column, write_csv};
#[cfg(feature = "svg")]
pub use diagram::{BranchDiagram, Colour, Curve, Marker, Panel, SegmentStyle};
#[cfg(feature = "svg")]
pub use draw::BodyPicture;
pub use error::OutputError;
pub use graph::write_diagram_csv;
#[cfg(feature = "json")]
pub use graph::write_diagram_json;
pub use live::CsvWriter;
#[cfg(feature = "json")]
pub use live::JsonLinesWriter;
#[cfg(feature = "svg")]
pub use report::{Report, ReportBody, ReportOptions};
pub use vtu::{Field, write_pvd, write_vtu};
