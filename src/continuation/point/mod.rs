//! The local theory of a point of {H = 0}: all arms that leave it, what α does on each, and how certain that is.

pub(super) mod active;
mod analyse;
mod arc;
mod beside;
mod cell;
mod classify;
pub(super) mod coincidence;
mod cone;
mod extension;
mod first;
mod large;
mod multiple;
mod proof;
mod reduced;
mod roots;
pub(super) mod search;
mod settle;
pub(super) mod units;

use std::fmt;

use super::{Arm, VertexKind};
use crate::words::Count;

pub use analyse::arms_at;
pub(super) use classify::kind_of;
pub(super) use extension::ROOT;
pub(super) use first::{Wanted, one_arm};
pub(super) use multiple::{LARGEST, multiple_point};
pub(super) use proof::certainty;
pub(super) use search::Arms;

use arc::Arc;
use cell::{InCell, in_cell};

/// An arm with what it was found by.
#[derive(Debug, Clone)]
pub(super) struct Found {
    pub(super) arm: Arm,
    /// Positions of the test functions in whose zero set it runs.
    facets: Vec<usize>,
    /// Its expansion in the variables of the map, where that was computed.
    arc: Option<Arc>,
    /// Sizes of the variables in its selection; empty where they are all 1.
    units: Vec<f64>,
    /// Length of its tangent in balanced units: one over it is a length along the arm over which the map changes noticeably. `None` until it
    /// is needed, where it takes a Jacobian of its own.
    unit: Option<f64>,
}

/// All that is known about a point of the solution set: the arms that leave it, what α does on them, and how certain the list is.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PointAnalysis {
    /// What the point is, by its arms.
    pub kind: VertexKind,
    /// All arms found: half-curves that leave the point.
    pub arms: Vec<Arm>,
    /// Dimensions of the continua of solutions that contain the point: one for each affine cell that a kernel of two dimensions or more
    /// meets. Their directions are not listed as arms.
    pub continua: Vec<usize>,
    /// Whether further arms are excluded.
    pub certainty: Certainty,
}

impl PointAnalysis {
    /// Of the arms found, which are added by the caller.
    pub(super) fn new(arms: &mut Arms, certainty: Certainty) -> Self {
        Self {
            kind: arms.kind(),
            arms: Vec::new(),
            continua: std::mem::take(&mut arms.continua),
            certainty,
        }
    }
}

/// How certain a list of arms is.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Certainty {
    /// No other arm exists, by the exact coefficients of the pieces.
    Proven,
    /// No other arm leaves the sphere of this radius about the point, by enclosures of derivatives.
    Within {
        /// The radius, in the units of x.
        radius: f64,
    },
    /// No other arm was found; all active selections were examined, with derivatives that are known up to estimated errors.
    Estimated,
    /// Further arms are not excluded, or an arm that is listed may be none.
    Undecided(PointDoubt),
}

impl Certainty {
    /// Whether no other arm leaves the point.
    #[must_use]
    pub fn is_proven(&self) -> bool {
        matches!(self, Self::Proven | Self::Within { .. })
    }

    /// Whether something was left open.
    #[must_use]
    pub fn is_undecided(&self) -> bool {
        matches!(self, Self::Undecided(_))
    }
}

impl fmt::Display for Certainty {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Proven => f.write_str("proven"),
            Self::Within { radius } => write!(f, "no other arm within {radius:.1e}"),
            Self::Estimated => f.write_str("no other arm found"),
            Self::Undecided(doubt) => write!(f, "undecided: {doubt}"),
        }
    }
}

/// Why the arms of a point are not decided.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum PointDoubt {
    /// The kernel of a selection has more than three dimensions, or the forms in it are degenerate up to the fourth order.
    Kernel {
        /// Its dimension.
        dimension: usize,
        /// The variables that take part in it, those with the largest components first.
        variables: Vec<usize>,
    },
    /// Rounding does not decide the rank of a Jacobian, and the possible ranks lead to different arms.
    Rank,
    /// An arm and the corrected points along it contradict each other.
    Contradiction,
    /// A limit (`max_selections`, `max_nodes`, `max_time`, a stop) ended the search.
    Budget,
    /// One arm that continues the curve was found; others were not searched for.
    NotSearched,
}

impl PointDoubt {
    /// The kernel of a basis in multiples of the units.
    fn kernel(basis: &[Vec<f64>], units: &[f64]) -> Self {
        const NAMED: f64 = 1e-6;
        let part = |j: usize| basis.iter().fold(0.0, |sum, v| sum + (v[j] * units[j]).powi(2));
        let parts: Vec<f64> = (0..units.len()).map(part).collect();
        let largest = parts.iter().fold(0.0_f64, |m, p| m.max(*p));
        let mut variables: Vec<usize> = (0..parts.len())
            .filter(|&j| parts[j] > NAMED * NAMED * largest)
            .collect();
        variables.sort_by(|&a, &b| parts[b].total_cmp(&parts[a]));
        Self::Kernel {
            dimension: basis.len(),
            variables,
        }
    }
}

impl fmt::Display for PointDoubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Kernel { dimension, variables } => {
                const NAMED: usize = 8;
                let names: Vec<String> = variables.iter().take(NAMED).map(|j| format!("x[{j}]")).collect();
                write!(f, "kernel of dimension {dimension} along {}", names.join(", "))?;
                match variables.len().saturating_sub(NAMED) {
                    0 => Ok(()),
                    more => write!(f, " and {}", Count(more, "more", "more")),
                }
            }
            Self::Rank => f.write_str("the rank of a Jacobian is not decided by rounding"),
            Self::Contradiction => f.write_str("an arm and the points along it contradict each other"),
            Self::Budget => f.write_str("a limit ended the search"),
            Self::NotSearched => f.write_str("other arms were not searched for"),
        }
    }
}
