use std::fmt;

use crate::run::Status;
use crate::words::{Count, Size};

/// Options of [`Lemke`](super::Lemke). The defaults suit most problems.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct LemkeOptions {
    /// Largest number of exchanges on a path; default `None`: 50 n + 1000, on up to five paths.
    pub max_pivots: Option<usize>,
    /// The covering vector d > 0, one entry an unknown; default `None`: all ones, and others where that path cycles (unless
    /// `max_pivots` is set). It chooses the path, and with several
    /// solutions the one that is found.
    pub covering: Option<Vec<f64>>,
    /// The number k of the unknown at which the path begins, for the method of Lemke and Howson; default
    /// `None`. Then z at its bounds has to be a solution (z = 0 with q ≥ 0), and the path of points at which
    /// all pairs but (zₖ, wₖ) are complementary leads from it to another solution. There is no covering
    /// vector.
    pub label: Option<usize>,
}

impl LemkeOptions {
    /// Sets the largest number of exchanges.
    #[must_use]
    pub fn with_max_pivots(mut self, max_pivots: usize) -> Self {
        self.max_pivots = Some(max_pivots);
        self
    }

    /// Sets the covering vector.
    #[must_use]
    pub fn with_covering(mut self, covering: Vec<f64>) -> Self {
        self.covering = Some(covering);
        self
    }

    /// Sets the unknown at which the path begins.
    #[must_use]
    pub fn with_label(mut self, label: usize) -> Self {
        self.label = Some(label);
        self
    }
}

/// One exchange.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LemkePivot {
    /// Number of the exchange on its path, from 1.
    pub index: usize,
    /// Number of the path, from 0: a path that cycles is restarted with another covering vector.
    pub path: usize,
    /// The covering variable t before it: 0 at a solution, and on paths without one. It need not fall from
    /// one exchange to the next.
    pub cover: f64,
}

/// Report on one path.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LemkeReport {
    /// How it ended: [`Solved`](Status::Solved) if each component is to 1e-10 relative to the terms of its row, as checked at the point
    /// returned ([accuracy](crate::complementarity#accuracy)); [`NoSolution`](Status::NoSolution) if the direction v of the ray on which the
    /// path ended ([`Lemke::ray`](super::Lemke::ray)) is, up to rounding, a certificate that no z ≥ 0 has M z + q ≥ 0 (v ≥ 0, Mᵀv ≤ 0,
    /// qᵀv < 0), and exact arithmetic has confirmed that there is none; otherwise [`Ray`](Status::Ray), and there may be a solution: with
    /// many unknowns (more than 5 000 entries, zeros counted, in the rows of v and so in all) only a v whose entries have simple ratios is
    /// confirmed. [`IterationLimit`](Status::IterationLimit) is that on exchanges, and [`Inaccurate`](Status::Inaccurate) says that rounding
    /// destroyed the basis: no exchange with an acceptable pivot, or a solution that does not satisfy the equations.
    pub status: Status,
    /// Exchanges made.
    pub pivots: usize,
    /// How often the inverse was recomputed.
    pub refactorisations: usize,
    /// Natural residual of the point returned.
    pub residual: f64,
}

impl fmt::Display for LemkeReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} after {}, residual {}",
            self.status,
            Count(self.pivots, "exchange", "exchanges"),
            Size(self.residual)
        )
    }
}
