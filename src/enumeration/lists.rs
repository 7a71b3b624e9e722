//! Lists of solutions, and how far they are known to be complete.

use std::fmt;

use crate::piecewise::Selection;
use crate::words::{Coordinates, Count};

/// How many are listed if there are more.
pub(super) const NAMED: usize = 64;

/// How far a list is known to be complete.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Completeness {
    /// Every selection was examined or excluded. This is proven for the problem that its floating-point numbers define: each decision is
    /// based on error bounds or exact arithmetic.
    Complete,
    /// The cap was reached.
    Incomplete {
        /// Selections examined or excluded.
        examined: f64,
        /// Selections in all.
        total: f64,
    },
    /// All selections were examined, but in floating-point arithmetic, without proof.
    Undecided {
        /// How many (partial) selections, or sites, rounding left undecided; 0 where no decision was within rounding.
        selections: u64,
        /// Why there is no proof.
        doubt: Doubt,
    },
}

/// Why a list is not proven.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Doubt {
    /// The map does not state its coefficients exactly ([`exact`](crate::piecewise::Structure::exact)), or
    /// has more than 2²¹ of them. Of arms: it does not state them as affine functions of α
    /// ([`is_affine_in_parameter`](crate::piecewise::ExactPieces::is_affine_in_parameter)), has more than 2¹⁸
    /// of them, or the point lies at a wall.
    NoCoefficients,
    /// Kernels of dimension two or more, or decisions within rounding.
    Rounding,
    /// The pieces given do not agree on a facet between them, so that points near it may lie in none or in two.
    Discontinuous,
    /// Of arms: at no exact solution within the tolerance of the point do all test functions vanish that count as vanishing there. A
    /// smaller tolerance separates kinks that are near each other.
    Coincidence,
    /// The search, or that in exact arithmetic, reached its cap.
    Limit,
    /// Listed points or directions do not solve the map: the coefficients that it states are those of another one.
    Contradiction,
    /// Solutions have coordinates, or residuals, above the largest floating-point number. Points with such coordinates are not listed.
    Overflow,
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoCoefficients => "the map does not state its coefficients exactly, or has too many",
            Self::Rounding => "kernels of dimension two or more, or decisions within rounding",
            Self::Discontinuous => "the pieces do not agree on a facet between them",
            Self::Coincidence => "at no exact solution do all test functions vanish that count as vanishing",
            Self::Limit => "the search reached its cap",
            Self::Contradiction => "the coefficients that the map states are not those of its pieces",
            Self::Overflow => "solutions have numbers above the largest floating-point number",
        })
    }
}

impl fmt::Display for Completeness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Complete => f.write_str("complete"),
            Self::Incomplete { examined, total } => write!(
                f,
                "incomplete: {examined} of {total} selections examined or excluded"
            ),
            Self::Undecided { selections: 0, doubt } => write!(f, "not proven: {doubt}"),
            Self::Undecided { selections, doubt } => {
                write!(f, "not proven, {selections} undecided: {doubt}")
            }
        }
    }
}

impl Completeness {
    /// Whether the list is [complete](Self::Complete).
    #[must_use]
    pub fn is_complete(&self) -> bool {
        *self == Self::Complete
    }

    /// Whether selections were omitted or left undecided: `false` for complete lists, and for those that lack only the proof.
    #[must_use]
    pub fn has_gaps(&self) -> bool {
        !matches!(self, Self::Complete | Self::Undecided { selections: 0, .. })
    }
}

/// A solution.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Solution {
    /// The point: y, followed by α for a curve. In complete lists accurate to about eight digits or more in each component that is not
    /// far smaller than the others, even for ill-conditioned solutions.
    pub x: Vec<f64>,
    /// Selections whose only solution is this point, in lexicographic order: all of them, or some of them if there are more than 256. Those
    /// of a continuum that ends here are listed with the continuum.
    pub selections: Vec<Selection>,
    /// How many there are: those in whose closed cells the point lies, without those of continua.
    pub num_selections: f64,
    /// For each of them the sign of det ∇_yH^(σ): 0 when singular, `None` when the linear solver provides no determinants.
    pub det_signs: Vec<Option<i8>>,
    /// Distance to the nearest kink: the smallest signed test function of its cells; 0 at a transition.
    pub margin: f64,
    /// The local index (degree) of the solution: the sign of the determinant where one selection is active, the mean of the two
    /// signs where two are (0: the point is a fold); `None` where this does not determine it, at points of continua, which are not
    /// isolated, and, for maps without exact coefficients, after the time limit.
    pub index: Option<i8>,
    /// The first of the listed continua that the point belongs to (often as an end), by its number in the
    /// list. `None` if it belongs to none of them: in a complete list it is isolated. Always `None` for maps
    /// without exact coefficients.
    pub continuum: Option<usize>,
}

impl Solution {
    /// Puts the selections in order, with their signs.
    pub(super) fn sort(&mut self) {
        let selections = std::mem::take(&mut self.selections).into_iter();
        let mut both: Vec<_> = selections.zip(std::mem::take(&mut self.det_signs)).collect();
        both.sort_by(|a, b| a.0.cmp(&b.0));
        (self.selections, self.det_signs) = both.into_iter().unzip();
    }

    /// The local index, where the list of selections contains all that are active.
    pub(super) fn find_index(&mut self) {
        self.index = match self.det_signs.as_slice() {
            [Some(sign)] if *sign != 0 => Some(*sign),
            // Two selections share a facet with nothing else active: the sum of two half-space maps.
            [Some(a), Some(b)] if *a != 0 && *b != 0 => Some((a + b) / 2),
            _ => None,
        };
    }
}

/// A continuum of solutions at one parameter: a vertical segment, or a larger polyhedron. Faces of others are
/// not listed.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Continuum {
    /// The selections whose solutions it consists of.
    pub selections: Vec<Selection>,
    /// Its dimension; 1 for a segment, a ray or a line. For maps without exact coefficients that of the
    /// solution space of the selection's linear system, whose part in the cell may be smaller.
    pub dimension: usize,
    /// One of its points, inside of it where it is [described](Self::described); empty where none is known
    /// (of dimension two and more, for maps without exact coefficients).
    pub point: Vec<f64>,
    /// The ends of a segment (of a ray: one), the vertices of a polyhedron. Where it contains a line it has
    /// none; of dimension two and more there is then one point of each of its least faces.
    pub ends: Vec<Vec<f64>>,
    /// Directions in which it is unbounded, of largest entry 1 and without α: those of its rays, and for each
    /// line both.
    pub directions: Vec<Vec<f64>>,
    /// Whether it is the set of all points Σ sₖ eₖ + Σ tₖ dₖ with sₖ, tₖ ≥ 0 and Σ sₖ = 1 of its ends e (of
    /// its point, where there are none) and directions d. With more than 256 of them none are listed.
    pub described: bool,
}

/// The ends, or directions, of a segment, a ray or a line.
#[derive(Debug, Clone)]
pub(super) struct Extent<P> {
    pub(super) ends: Vec<P>,
    /// A point in each direction in which it has no end, chosen by a rule that depends on the segment, ray or line alone.
    pub(super) beyond: Vec<P>,
}

impl<P> Extent<P> {
    pub(super) fn agrees(&self, other: &Self, same: impl Fn(&P, &P) -> bool) -> bool {
        let agree = |a: &[P], b: &[P]| a.len() == b.len() && a.iter().all(|p| b.iter().any(|q| same(p, q)));
        agree(&self.ends, &other.ends) && agree(&self.beyond, &other.beyond)
    }
}

/// All solutions of an equation, or of a curve's equation at one parameter.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SolutionSet {
    /// The solutions, ordered by their first selection. Points of continua are among them where a regular selection has them, too.
    pub solutions: Vec<Solution>,
    /// Continua of solutions; empty at regular parameters.
    pub continua: Vec<Continuum>,
    /// Σ of the local indices, where the list is complete, all are known and there are no continua. By degree theory it does not depend on the data
    /// of a class of problems: +1 for friction with F ≥ 0 and for LCPs whose matrix is strictly copositive (or P).
    pub index_sum: Option<i64>,
    /// Whether the lists are complete.
    pub completeness: Completeness,
    /// Nodes of the search: partial selections tried.
    pub nodes: u64,
    /// Exchange steps of all linear programs.
    pub pivots: u64,
}

/// "(1, 0.5), index 1, margin 2.5e-1": in one line.
impl fmt::Display for Solution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", Coordinates(&self.x))?;
        if let Some(index) = self.index {
            write!(f, ", index {index}")?;
        }
        write!(f, ", margin {:.1e}", self.margin)
    }
}

/// "3 solutions, sum of indices 1, complete": in one line.
impl fmt::Display for SolutionSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", Count(self.solutions.len(), "solution", "solutions"))?;
        if !self.continua.is_empty() {
            write!(f, ", {}", Count(self.continua.len(), "continuum", "continua"))?;
        }
        if let Some(sum) = self.index_sum {
            write!(f, ", sum of indices {sum}")?;
        }
        write!(f, ", {}", self.completeness)
    }
}
