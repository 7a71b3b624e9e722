use std::path::PathBuf;

use thiserror::Error;

use crate::Cause;
use crate::InputError;
use crate::contact::ContactError;
use crate::continuation::ContinuationError;
use crate::fem::FemError;

/// Errors in writing results.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum OutputError {
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The curve of solutions.
    #[error("the curve of solutions: {0}")]
    Curve(#[from] ContinuationError),
    /// The contact problem.
    #[error("the contact problem: {0}")]
    Contact(#[from] ContactError),
    /// Displacements or stresses of the body.
    #[error("the body: {0}")]
    Body(#[from] FemError),
    /// Names, unknowns to be drawn, or a range that do not fit the problem.
    #[error("{what}")]
    Report {
        /// What is wrong, and what is expected.
        what: String,
    },
    /// There is nothing to draw.
    #[error("there is nothing to draw: {what}")]
    Empty {
        /// What is missing.
        what: &'static str,
    },
    /// A coordinate is NaN or infinite, or too large to be drawn.
    #[error("curve {curve} of panel {panel}: vertex {vertex} = ({x:?}, {y:?}) cannot be drawn")]
    NotDrawable {
        /// Panel, from 0.
        panel: usize,
        /// Curve of the panel, from 0.
        curve: usize,
        /// Vertex (or mark) of the curve, from 0.
        vertex: usize,
        /// Abscissa.
        x: f64,
        /// Ordinate.
        y: f64,
    },
    /// A corner of a region is NaN, infinite or too large to be drawn.
    #[error("panel {panel}: region {region} has a corner at ({x:?}, {y:?}), which cannot be drawn")]
    Region {
        /// Panel, from 0.
        panel: usize,
        /// Region of the panel, from 0.
        region: usize,
        /// Abscissa.
        x: f64,
        /// Ordinate.
        y: f64,
    },
    /// The position of a note is NaN, infinite or too large to be drawn.
    #[error("panel {panel}: note {note} at ({x:?}, {y:?}) cannot be drawn")]
    Note {
        /// Panel, from 0.
        panel: usize,
        /// Note of the panel, from 0.
        note: usize,
        /// Abscissa.
        x: f64,
        /// Ordinate.
        y: f64,
    },
    /// The number of segment styles does not fit the number of vertices.
    #[error("a curve of {vertices} vertices has {styles} segment styles, expected one fewer than vertices")]
    Segments {
        /// Number of vertices.
        vertices: usize,
        /// Number of styles.
        styles: usize,
    },
    /// The size of the picture is out of range.
    #[error(
        "a picture of {width} x {height} with {panels} panels; each panel needs 160 x 160 to 10000 x 10000"
    )]
    Size {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Number of panels.
        panels: usize,
    },
    /// A range of an axis is not an interval.
    #[error("the {axis} range ({lower}, {upper}) must be finite with lower < upper")]
    Range {
        /// Which axis.
        axis: &'static str,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// A logarithmic axis shows positive values only.
    #[error("panel {panel}: {value:?} cannot be drawn on a logarithmic axis")]
    Logarithm {
        /// Panel, from 0.
        panel: usize,
        /// The value.
        value: f64,
    },
    /// A field does not fit its mesh.
    #[error("the field \"{name}\" has {found} values, expected {expected}")]
    Field {
        /// Its name.
        name: String,
        /// Values expected.
        expected: usize,
        /// Values given.
        found: usize,
    },
    /// A node of a body is not finite, or does not exist.
    #[error("node {node} cannot be drawn: it does not exist, or its position is not finite")]
    Node {
        /// The node, from 0.
        node: usize,
    },
    /// The time of a step of a series is NaN or infinite.
    #[error("step {index} of the series has the time {time}, which must be finite")]
    Time {
        /// Step, from 0.
        index: usize,
        /// Its time.
        time: f64,
    },
    /// Writing failed.
    #[error("cannot write{}: {source}", path.as_ref().map(|p| format!(" {}", p.display())).unwrap_or_default())]
    Io {
        /// The file, where there is one.
        path: Option<PathBuf>,
        /// The error of the operating system; of kind `InvalidInput` where the file name is not allowed.
        source: Cause,
    },
}

impl From<std::io::Error> for OutputError {
    fn from(e: std::io::Error) -> Self {
        Self::Io {
            path: None,
            source: e.into(),
        }
    }
}
