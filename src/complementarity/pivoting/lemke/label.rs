//! Paths that begin at a solution with an unknown that grows: the method of Lemke and Howson.

use super::{Lemke, Side, Var};
use crate::complementarity::{ComplementarityError, Lcp};

impl Lemke {
    /// Whether all pairs are complementary once this variable has left the basis.
    pub(super) fn is_last(&self, leaving: Var) -> bool {
        match self.options.label {
            Some(k) => leaving == Var::Slack(k) || leaving == Var::Point(k),
            None => leaving == Var::Cover,
        }
    }

    /// The variable after which zₖ enters, for a path that begins with it.
    pub(super) fn check_label(&self, lcp: &Lcp, label: usize) -> Result<Var, ComplementarityError> {
        let solved = self
            .basic
            .iter()
            .zip(&self.side)
            .zip(&self.value)
            .all(|((var, side), v)| match (var, side) {
                (Var::Slack(_), Side::Lower) => *v >= 0.0,
                (Var::Slack(_), Side::Upper) => *v <= 0.0,
                _ => true,
            });
        let unsuitable = |reason: &str| ComplementarityError::Unsuitable {
            method: "the method of Lemke and Howson",
            reason: reason.to_owned(),
        };
        if !solved {
            return Err(unsuitable(
                "z at its bounds is no solution (of a game: M = −[0 A; Bᵀ 0] with A > 0, B > 0, and q = 1)",
            ));
        }
        match lcp.lower()[label].is_finite() != lcp.upper()[label].is_finite() {
            true => Ok(Var::Slack(label)),
            false => Err(unsuitable("the unknown of the label has to have just one bound")),
        }
    }
}
