//! Equations of the user: one or two of them in x, y and the parameter a.

use std::collections::BTreeMap;

use semismooth::continuation::{Diagram, SearchOptions, search_solutions};
use semismooth::enumeration::{EnumerationError, EnumerationOptions};
use semismooth::piecewise::{self, PiecewiseSmooth, PiecewiseSmoothExt, Selection, Traced};
use serde::{Deserialize, Serialize};

use crate::drawing::{Drawing, Words};
use crate::error::{Error, interval, within};
use crate::friction::{Solutions, listed, options, sections};

/// Largest number of named constants.
const MOST_CONSTANTS: usize = 12;
/// Largest number of kinks in all equations together.
const MOST_SITES: usize = 10;

/// Equations, the range of the parameter, the value at which solutions are listed, and the distance from 0 up to which they are searched.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Formula {
    equations: Vec<String>,
    /// Names that stand for numbers in the equations.
    #[serde(default)]
    constants: BTreeMap<String, f64>,
    range: [f64; 2],
    at: f64,
    reach: f64,
    /// Whether to compute the diagram besides the solutions.
    diagram: bool,
}

/// The results for a formula.
#[derive(Debug, Serialize)]
pub(crate) struct Explored {
    /// Number of unknowns: 1 (x) or 2 (x, y).
    unknowns: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    diagram: Option<Drawing>,
    solutions: Listed,
}

#[derive(Debug, Serialize)]
#[serde(untagged)]
enum Listed {
    /// All solutions, if the pieces are affine.
    All(Solutions),
    /// Else those that a search from many starts has found.
    Found(Found),
}

#[derive(Debug, Serialize)]
struct Found {
    solutions: Vec<FoundSolution>,
    index_sum: Option<i64>,
    /// Always false: a search cannot prove completeness.
    complete: bool,
    /// What is known of the completeness, in the words of the library.
    completeness: String,
}

#[derive(Debug, Serialize)]
struct FoundSolution {
    x: Vec<f64>,
    pieces: Vec<String>,
    det: Vec<Option<i8>>,
    index: Option<i8>,
}

/// The pieces of each site, as text of the formula.
struct Pieces(Vec<[String; 2]>);

impl Words for Pieces {
    fn pieces(&self, selection: &Selection, _grazing: &[usize]) -> Vec<String> {
        let named = self.0.iter().zip(selection.pieces());
        named
            .map(|(names, k)| names.get(k).cloned().unwrap_or_default())
            .collect()
    }

    fn theta(&self, _x: &[f64]) -> Vec<[f64; 3]> {
        Vec::new()
    }
}

impl Formula {
    pub(crate) fn explore(&self) -> Result<Explored, Error> {
        interval("the range of a", self.range)?;
        within("a", self.at, (self.range[0], self.range[1]), "inside its range")?;
        within("the reach", self.reach, (1e-3, 1e6), "between 1e-3 and 1e6")?;
        let (map, pieces) = self.map()?;
        let solutions = match listed(&map, &pieces, self.at) {
            Ok(solutions) => Listed::All(solutions),
            Err(EnumerationError::NotAffine { .. }) => Listed::Found(self.found(&map, &pieces)?),
            Err(e) => return Err(e.into()),
        };
        let diagram = match self.diagram {
            true => Some(Drawing::new(&self.curves(&map, &solutions)?, &pieces)),
            false => None,
        };
        Ok(Explored {
            unknowns: map.num_residuals(),
            diagram,
            solutions,
        })
    }

    fn curves(&self, map: &Traced<piecewise::Formula>, solutions: &Listed) -> Result<Diagram, Error> {
        let options = options(self.range);
        let continuation = options.continuation.clone();
        let reach = self.range[1] - self.range[0] + self.reach;
        let options = options.with_continuation(continuation.with_max_arclength(20.0 * reach));
        let sections = sections(self.range);
        let mut starts: Vec<Vec<f64>> = match solutions {
            Listed::Found(found) => found.solutions.iter().map(|s| s.x.clone()).collect(),
            Listed::All(_) => {
                let enumeration = EnumerationOptions::default();
                return Ok(Diagram::explore_sections(map, &sections, &options, &enumeration)?);
            }
        };
        for alpha in sections {
            let more = search_solutions(map, alpha, &starts, &self.search())?;
            starts.extend(more.solutions.into_iter().map(|s| s.x));
        }
        Ok(Diagram::explore(map, &starts, &options)?)
    }

    /// Few starts, since the page waits for the result.
    fn search(&self) -> SearchOptions {
        SearchOptions::default()
            .with_starts(30)
            .with_neighbours(40)
            .with_deflations(4)
            .with_rounds(2)
            .with_spread(self.reach)
            .with_max_solutions(50)
            .with_reach(None)
    }

    fn found(&self, map: &Traced<piecewise::Formula>, pieces: &Pieces) -> Result<Found, Error> {
        let none: [[f64; 1]; 0] = [];
        let found = search_solutions(map, self.at, &none, &self.search())?;
        Ok(Found {
            completeness: found.to_string(),
            solutions: (found.solutions.into_iter())
                .map(|s| FoundSolution {
                    pieces: pieces.pieces(&s.selection, &[]),
                    det: vec![s.det_sign],
                    index: s.index,
                    x: s.x,
                })
                .collect(),
            index_sum: found.index_sum,
            complete: false,
        })
    }

    fn map(&self) -> Result<(Traced<piecewise::Formula>, Pieces), Error> {
        let given: Vec<&String> = match self.equations.as_slice() {
            [first, second] if second.trim().is_empty() => vec![first],
            list => list.iter().collect(),
        };
        within(
            "the number of equations",
            given.len() as f64,
            (1.0, 2.0),
            "1 (in x and a) or 2 (in x, y and a)",
        )?;
        let variables: &[&str] = match given.len() {
            1 => &["x", "a"],
            _ => &["x", "y", "a"],
        };
        within(
            "the number of constants",
            self.constants.len() as f64,
            (0.0, MOST_CONSTANTS as f64),
            "at most 12",
        )?;
        for (name, value) in &self.constants {
            within(name, *value, (-1e9, 1e9), "between -1e9 and 1e9")?;
        }
        let constants: Vec<(&str, f64)> = self.constants.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        let map = Traced::new(piecewise::Formula::read_with(&given, variables, &constants)?);
        let name = |site, piece| map.piece_name(site, piece).into_owned();
        let pieces = Pieces(
            (0..map.num_sites())
                .map(|site| [name(site, 0), name(site, 1)])
                .collect(),
        );
        within(
            "the number of kinks (max, min, abs)",
            pieces.0.len() as f64,
            (0.0, MOST_SITES as f64),
            "at most 10",
        )?;
        Ok((map, pieces))
    }
}
