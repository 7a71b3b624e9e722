//! What a report says of numbers, events and lists, for readers who know nothing of nonsmooth analysis.

use crate::contact::ContactState;
use crate::continuation::{SolutionList, TransitionKind};
use crate::enumeration::Completeness;
use crate::tolerances::RESULT;
use crate::words::{Count, Short};

/// A number of six digits; 0 for what is a rounding error beside `size`.
pub(super) fn number(value: f64, size: f64) -> String {
    match value.abs() <= RESULT * size {
        true => "0".to_owned(),
        false => Short(value).to_string(),
    }
}

/// The largest entry.
pub(super) fn size(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |m, v| v.abs().max(m))
}

/// What happens where the active pieces change.
pub(super) const fn of_kind(kind: TransitionKind) -> &'static str {
    match kind {
        TransitionKind::PassThrough => "kink: the curve goes on",
        TransitionKind::Fold => "fold: the load turns back",
        TransitionKind::VerticalBegin => "a segment of solutions at one load begins",
        TransitionKind::VerticalEnd => "a segment of solutions at one load ends",
        TransitionKind::Branching => "curves branch",
        TransitionKind::End => "the curve ends",
        TransitionKind::Undecided => "how the curve goes on is undecided",
    }
}

/// What a contact node does when its state changes.
pub(super) fn of_states(from: ContactState, to: ContactState) -> &'static str {
    use ContactState::{Open, Stick};
    match (from, to) {
        (Open, Stick) => "comes into contact and sticks",
        (Open, _) => "comes into contact and slips",
        (_, Open) => "lifts off",
        (Stick, _) => "begins to slip",
        (_, Stick) => "stops slipping",
        _ => "slips in the other direction",
    }
}

/// The number of solutions, and how far that number is known.
pub(super) fn of_list(list: &SolutionList) -> (String, String) {
    match list {
        SolutionList::Enumerated(set) => {
            let isolated = set.solutions.iter().filter(|s| s.continuum.is_none()).count();
            let number = match set.continua.len() {
                0 => isolated.to_string(),
                n => format!("{}, and {isolated} isolated", Count(n, "continuum", "continua")),
            };
            match set.completeness {
                Completeness::Complete if number == "0" => (number, "proven: there is none".to_owned()),
                Completeness::Complete => (number, "proven: there are no others".to_owned()),
                Completeness::Undecided {
                    selections: 0, doubt, ..
                } => (
                    number,
                    format!("all combinations were examined, without proof ({doubt})"),
                ),
                // The curve of the report may have solutions that this list did not come to.
                _ if number == "0" => (
                    "not counted".to_owned(),
                    "the search for all solutions reached its limit before it found any; the curve has those that are known".to_owned(),
                ),
                other => (format!("at least {number}"), of_gap(other)),
            }
        }
        SolutionList::Searched(found) => {
            let number = match found.continua {
                0 => found.solutions.len().to_string(),
                n => format!("{}, and {n} continua", found.solutions.len()),
            };
            (number, "found by a search: others are not excluded".to_owned())
        }
    }
}

/// Why a list is not known to hold all solutions.
fn of_gap(completeness: Completeness) -> String {
    match completeness {
        Completeness::Incomplete { .. } => "others are not excluded: the search reached its limit".to_owned(),
        other => format!("others are not excluded: {other}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_is_zero_and_small_numbers_are_not() {
        assert_eq!(number(3e-37, 1.0), "0");
        assert_eq!(number(3e-37, 0.0), "3.00000e-37");
        assert_eq!(number(-2.0 / 3.0, 5.0), "-0.666667");
        assert_eq!(number(1e-9, 1.0), "1.00000e-9");
        assert_eq!(number(123_456.7, 1.0), "123457");
    }
}
