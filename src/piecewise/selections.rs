use std::fmt;

use super::{PiecewiseSmooth, PiecewiseSmoothExt, Selection};

impl Selection {
    /// A form that prints the pieces by name, e.g. `[stick, slip+]`.
    pub fn display<'a, P: PiecewiseSmooth + ?Sized>(&'a self, map: &'a P) -> impl fmt::Display + 'a {
        Named { selection: self, map }
    }
}

struct Named<'a, P: ?Sized> {
    selection: &'a Selection,
    map: &'a P,
}

impl<P: PiecewiseSmooth + ?Sized> fmt::Display for Named<'_, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("[")?;
        for (site, piece) in self.selection.pieces().enumerate() {
            if site > 0 {
                f.write_str(", ")?;
            }
            f.write_str(&self.map.piece_name(site, piece))?;
        }
        f.write_str("]")
    }
}

/// A lazy enumeration of selections: a base selection in which some sites run through lists of pieces.
///
/// The order is lexicographic, the last varying site running fastest; nothing but one selection is stored.
///
/// ```
/// use semismooth::piecewise::{Selection, Selections};
/// let all = Selections::new(Selection::uniform(3, 0), vec![(0, vec![0, 1]), (2, vec![4, 5, 6])]);
/// assert_eq!(all.total(), Some(6));
/// let last = all.last().unwrap();
/// assert_eq!(last, Selection::from_pieces([1, 0, 6]));
/// ```
#[derive(Debug, Clone)]
pub struct Selections {
    current: Selection,
    choices: Vec<(usize, Vec<usize>)>,
    counters: Vec<usize>,
    exhausted: bool,
}

impl Selections {
    /// All selections that agree with `base` except at the given sites, which run through the given pieces.
    #[must_use]
    pub fn new(base: Selection, choices: Vec<(usize, Vec<usize>)>) -> Self {
        let mut current = base;
        for (site, pieces) in &choices {
            if let Some(&first) = pieces.first() {
                current.set(*site, first);
            }
        }
        Self {
            exhausted: choices.iter().any(|c| c.1.is_empty()),
            counters: vec![0; choices.len()],
            current,
            choices,
        }
    }

    /// All selections of a map (kᵖ of them for p sites of k pieces: enumerate lazily, stop early).
    #[must_use]
    pub fn all<P: PiecewiseSmooth + ?Sized>(map: &P) -> Self {
        let sites = 0..map.num_sites();
        Self::varying(map, &Selection::uniform(map.num_sites(), 0), sites)
    }

    /// All selections that agree with `base` outside the given sites.
    #[must_use]
    pub fn varying<P: PiecewiseSmooth + ?Sized>(
        map: &P,
        base: &Selection,
        sites: impl IntoIterator<Item = usize>,
    ) -> Self {
        let choices = sites
            .into_iter()
            .map(|s| (s, (0..map.num_pieces(s)).collect()))
            .collect();
        Self::new(base.clone(), choices)
    }

    /// How many selections there are in all (from the start), unless the number overflows.
    #[must_use]
    pub fn total(&self) -> Option<u128> {
        self.choices
            .iter()
            .try_fold(1u128, |n, c| n.checked_mul(c.1.len() as u128))
    }
}

impl Iterator for Selections {
    type Item = Selection;

    fn next(&mut self) -> Option<Selection> {
        if self.exhausted {
            return None;
        }
        let item = self.current.clone();
        self.exhausted = true;
        for (k, (site, pieces)) in self.choices.iter().enumerate().rev() {
            self.counters[k] += 1;
            if self.counters[k] < pieces.len() {
                self.current.set(*site, pieces[self.counters[k]]);
                self.exhausted = false;
                break;
            }
            self.counters[k] = 0;
            self.current.set(*site, pieces[0]);
        }
        Some(item)
    }
}
