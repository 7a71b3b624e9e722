//! Checkers for implementations of [`PiecewiseSmooth`] and of [`Semismooth`], to be called in their tests.
//!
//! ```
//! use semismooth::piecewise::MinMap;
//! use semismooth::piecewise::check::{CheckOptions, check};
//! let map = MinMap::new(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
//!     a.copy_from_slice(x);
//!     b[0] = 2.0 * x[0] + x[1] - 5.0;
//!     b[1] = x[0] + 2.0 * x[1].powi(2) - 1.0;
//! });
//! // Points on both sides of every kink, in general position.
//! let samples = [vec![0.3, -1.1], vec![4.2, 2.3], vec![-2.1, 0.7], vec![7.1, -3.9]];
//! let report = check(&map, &samples, &CheckOptions::default())?;
//! assert_eq!(report.points, 4);
//! assert!(report.boundaries > 0);
//! # Ok::<(), semismooth::piecewise::check::CheckError>(())
//! ```

use std::fmt;

use thiserror::Error;

use super::{PiecewiseSmooth, Semismooth};

mod cells;
mod derivatives;
mod newton_derivative;
mod session;

use crate::InputError;
use crate::input::check_vector;
use crate::input::{any, check_options, positive};
use crate::options::setters;
use crate::words::Count;
use session::Session;

/// Options of [`check`] and [`check_semismooth`]. The defaults suit maps of moderate size and scale.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct CheckOptions {
    /// Largest deviation of a derivative from its difference quotient, relative to its size. Default 1e-5.
    pub tolerance: f64,
    /// Largest jump of a residual at a kink, relative to the residuals there and at the samples on both sides. Default 1e-8.
    pub continuity_tolerance: f64,
    /// Largest number of selections examined at a point. If there are more, all those that differ in one site from the selection there
    /// are examined instead. Default 64.
    pub max_selections: usize,
    /// Number of findings at which the check ends. Default 20.
    pub max_findings: usize,
    /// Whether selections are examined also at points outside their cells, where correctors may evaluate them. Points at which they
    /// are not finite are skipped. Default true.
    pub beyond_cells: bool,
}

impl Default for CheckOptions {
    fn default() -> Self {
        Self {
            tolerance: 1e-5,
            continuity_tolerance: 1e-8,
            max_selections: 64,
            max_findings: 20,
            beyond_cells: true,
        }
    }
}

impl CheckOptions {
    setters! {
        /// Sets the tolerance for derivatives.
        with_tolerance(tolerance: f64);
        /// Sets the tolerance for jumps.
        with_continuity_tolerance(continuity_tolerance: f64);
        /// Sets the most selections examined at a point.
        with_max_selections(max_selections: usize);
        /// Sets the number of findings at which the check ends.
        with_max_findings(max_findings: usize);
        /// Sets whether selections are examined outside their cells.
        with_beyond_cells(beyond_cells: bool);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        check_options(&[
            positive("tolerance", self.tolerance),
            positive("continuity_tolerance", self.continuity_tolerance),
            any("max_findings", self.max_findings as u64),
        ])
    }
}

/// How much a [`check`] has examined: a pass means little where these numbers are small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CheckReport {
    /// Samples inside the domain.
    pub points: usize,
    /// Samples beyond a wall, skipped.
    pub outside: usize,
    /// Selections whose Jacobian was compared with difference quotients, over all points.
    pub selections: usize,
    /// Points on boundaries between pieces at which continuity was examined.
    pub boundaries: usize,
}

/// "20 points (2 more beyond a wall): 31 Jacobians and 12 points on boundaries examined": in one line.
impl fmt::Display for CheckReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", Count(self.points, "point", "points"))?;
        if self.outside > 0 {
            write!(f, " ({} more beyond a wall)", self.outside)?;
        }
        write!(
            f,
            ": {} and {} examined",
            Count(self.selections, "Jacobian", "Jacobians"),
            Count(self.boundaries, "point on boundaries", "points on boundaries")
        )
    }
}

/// What kind of error was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum FindingKind {
    /// A number or an index out of range.
    Structure,
    /// A point lies in the cell of no piece, and beyond no wall.
    Gap,
    /// A point lies in the cells of several pieces.
    Overlap,
    /// Active selections disagree on a boundary.
    Discontinuity,
    /// The Jacobian of a selection is not the derivative of its residual.
    Jacobian,
    /// A Jacobian entry lies outside the declared pattern.
    StrayEntry,
    /// `test_derivatives` are not the derivatives of the test functions.
    TestDerivatives,
    /// `test_gradient` is not the gradient of the test function.
    TestGradient,
    /// `tests_of_selection` differ from the test functions in the cell of the selection, or their rates from their derivatives.
    SelectionTests,
    /// A row outside `site_rows` depends on the piece of the site.
    SiteRows,
    /// The map is declared piecewise affine, and is not.
    Affine,
    /// A value is NaN or infinite.
    NotFinite,
    /// The remainder of a Newton derivative does not fall faster than the distance: the map is not semismooth there, or this is no
    /// generalised derivative of it.
    Semismooth,
}

impl fmt::Display for FindingKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Structure => "impossible structure",
            Self::Gap => "point in the cell of no piece",
            Self::Overlap => "point in the cells of several pieces",
            Self::Discontinuity => "jump between active selections",
            Self::Jacobian => "wrong Jacobian",
            Self::StrayEntry => "Jacobian entry outside the pattern",
            Self::TestDerivatives => "wrong test_derivatives",
            Self::TestGradient => "wrong test_gradient",
            Self::SelectionTests => "wrong tests_of_selection",
            Self::SiteRows => "row outside site_rows depends on the piece",
            Self::Affine => "derivative not constant although declared piecewise affine",
            Self::NotFinite => "value not finite",
            Self::Semismooth => "no Newton derivative",
        })
    }
}

/// One error of an implementation.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Finding {
    /// What kind of error.
    pub kind: FindingKind,
    /// Number of the sample at (or starting from) which it showed.
    pub point: Option<usize>,
    /// The site concerned, with its name.
    pub site: Option<(usize, String)>,
    /// The piece concerned, with its name.
    pub piece: Option<(usize, String)>,
    /// Row and column; for test functions the number of the test at its site and the variable.
    pub entry: Option<(usize, usize)>,
    /// The expected value.
    pub expected: f64,
    /// The value found.
    pub found: f64,
    /// What the values are.
    pub what: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.kind)?;
        if let Some(point) = self.point {
            write!(f, " at sample {point}")?;
        }
        if let Some((site, name)) = &self.site {
            write!(f, ", site {site} ({name})")?;
        }
        if let Some((piece, name)) = &self.piece {
            write!(f, ", piece {piece} ({name})")?;
        }
        if let Some((row, col)) = self.entry {
            write!(f, ", entry ({row}, {col})")?;
        }
        write!(
            f,
            ": {}; expected {:e}, found {:e}",
            self.what, self.expected, self.found
        )
    }
}

/// Why a [`check`] did not pass.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CheckError {
    /// Data that do not fit.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The implementation is wrong.
    #[error("{} error(s) in the map:{}", .0.len(), list(.0))]
    Findings(Vec<Finding>),
    /// There is no sample, or none inside the domain.
    #[error("there is no sample inside the domain of the map ({outside} outside)")]
    NoSamples {
        /// Samples beyond walls.
        outside: usize,
    },
    /// A sample has the wrong length or is not finite.
    #[error("sample {point}: {source}")]
    Sample {
        /// Number of the sample.
        point: usize,
        /// What is wrong.
        source: InputError,
    },
}

fn list(findings: &[Finding]) -> String {
    findings.iter().map(|f| format!("\n  {f}")).collect()
}

/// Tests whether a map keeps the contract of [`PiecewiseSmooth`], at given samples and at the kinks between
/// them.
///
/// Samples should be in general position (not on kinks) and lie in all the pieces; see the
/// [report](CheckReport) for how much was examined. Checked are: numbers and indices; that the cells of each
/// site tile the domain; continuity at boundaries found between samples; Jacobians, `test_derivatives`,
/// `test_gradient` and (where kinks lie inside of others) `tests_of_selection` against difference quotients;
/// `pattern`, `site_rows` and `is_piecewise_affine` against what the map does.
///
/// Cost: about 4 m residuals a selection and sample, and a
/// [`test_gradient`](crate::piecewise::Derivatives::test_gradient) a test function and sample.
///
/// # Errors
/// [`CheckError::Findings`] with all errors of the map; the other variants are errors of the call.
pub fn check<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    samples: &[Vec<f64>],
    options: &CheckOptions,
) -> Result<CheckReport, CheckError> {
    check_map(&map, samples, options)
}

fn check_map(
    map: &dyn PiecewiseSmooth,
    samples: &[Vec<f64>],
    options: &CheckOptions,
) -> Result<CheckReport, CheckError> {
    options.validate()?;
    for (point, x) in samples.iter().enumerate() {
        check_vector("the point", x, map.num_vars())
            .map_err(|source| CheckError::Sample { point, source })?;
    }
    let mut session = Session::new(map, samples, options);
    session.structure();
    // With a wrong structure nothing can be evaluated safely.
    if session.findings.is_empty() {
        session.run();
    }
    if !session.findings.is_empty() {
        return Err(CheckError::Findings(session.findings));
    }
    match session.report {
        CheckReport {
            points: 0, outside, ..
        } => Err(CheckError::NoSamples { outside }),
        report => Ok(report),
    }
}

/// Tests a Newton derivative: whether [`Semismooth::jacobian`] makes H semismooth at given samples, and of which order.
///
/// A semismooth map has ‖H(x + d) − H(x) − J(x + d) d‖ = o(‖d‖), one of order p has O(‖d‖^(1 + p)) (L. Qi, J. Sun, Math. Program. 58 (1993);
/// M. Ulbrich, *Semismooth Newton Methods* (2011), section 2). This is measured in 8 directions at 15 distances. Samples on kinks test
/// most; at smooth points the order is 1 or the remainder rounding. At points in general position next to the samples, where H is
/// differentiable, entries are compared with difference quotients: a wrong one is reported with its row and column.
///
/// Gives the order at each sample: the p for which the remainder falls as ‖d‖^(1 + p), measured between 2⁻⁶ and 2⁻²⁰ of the sizes of the
/// variables in the row that falls slowest, unless it falls faster in the directions tried than in others. 1: Newton's method converges
/// quadratically. `None` where the remainder is rounding, as for affine pieces.
///
/// Over these distances an order of 0.1 or less cannot be distinguished from 0, and counts as none. Of the options only `tolerance` and
/// `max_findings` are used. Cost: 120 + 64 n residuals and 128 Jacobians a sample. Points at which the map is not
/// finite are skipped, except the samples themselves.
///
/// # Errors
/// [`CheckError::Findings`] with all errors of the map; the other variants are errors of the call.
///
/// ```
/// use semismooth::piecewise::{Semismooth, check::{CheckOptions, check_semismooth}};
/// use semismooth::sparse::Matrix;
/// /// x |x|^½, semismooth of order ½ at 0.
/// struct Root;
/// impl Semismooth for Root {
///     fn num_vars(&self) -> usize { 1 }
///     fn residual(&self, x: &[f64], out: &mut [f64]) { out[0] = x[0] * x[0].abs().sqrt(); }
///     fn jacobian(&self, x: &[f64], jac: &mut Matrix) { jac.add(0, 0, 1.5 * x[0].abs().sqrt()); }
/// }
/// let orders = check_semismooth(&Root, &[vec![0.0], vec![1.0]], &CheckOptions::default())?;
/// assert!((orders[0].unwrap() - 0.5).abs() < 0.01 && (orders[1].unwrap() - 1.0).abs() < 0.05);
/// # Ok::<(), semismooth::piecewise::check::CheckError>(())
/// ```
pub fn check_semismooth<S: Semismooth + ?Sized>(
    map: &S,
    samples: &[Vec<f64>],
    options: &CheckOptions,
) -> Result<Vec<Option<f64>>, CheckError> {
    newton_derivative::check_map(&map, samples, options)
}
