//! What pieces and variables are called in tables, legends and messages.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use semismooth::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Selection};
use serde::{Deserialize, Serialize};

use crate::continuation::Problem;

/// Sites up to which pictures distinguish pieces.
const FEW: usize = 2;

/// Names of the pieces, site by site, and of the variables.
#[derive(Serialize, Deserialize)]
pub(crate) struct Names {
    pieces: Vec<Vec<String>>,
    /// What legends call the pieces, where there are few sites.
    labels: Vec<Vec<String>>,
    /// Empty where none are given.
    pub(crate) variables: Vec<String>,
}

impl Names {
    pub(crate) fn of(map: &dyn PiecewiseSmooth) -> Self {
        let site = |s| {
            (0..map.num_pieces(s))
                .map(|p| map.piece_name(s, p).into_owned())
                .collect()
        };
        let pieces: Vec<Vec<String>> = (0..map.num_sites()).map(site).collect();
        Self {
            labels: pieces.iter().take(FEW).cloned().collect(),
            pieces,
            variables: Vec::new(),
        }
    }

    /// With names of the variables, and formulas in the place of "first" and "second" in legends.
    pub(crate) fn with(mut self, problem: &Problem, variables: Vec<String>) -> Self {
        if let (Problem::Map(map), true) = (problem, self.pieces.len() <= FEW) {
            for (site, labels) in self.labels.iter_mut().enumerate() {
                for (piece, label) in labels.iter_mut().enumerate() {
                    if let Some(text) = map.get().label(site, piece, &variables) {
                        *label = text;
                    }
                }
            }
        }
        self.variables = variables;
        self
    }

    pub(crate) fn selection(&self, selection: &Selection) -> Vec<&str> {
        let pieces = self.pieces.iter().zip(selection.pieces());
        pieces
            .map(|(names, p)| names.get(p).map_or("", String::as_str))
            .collect()
    }

    pub(crate) fn owned(&self, selection: &Selection) -> Vec<String> {
        self.selection(selection).into_iter().map(str::to_owned).collect()
    }

    /// The label of each piece by its name, site by site.
    pub(crate) fn legend(&self) -> Vec<Vec<(&str, &str)>> {
        let sites = self.pieces.iter().zip(&self.labels);
        let mut legend = Vec::new();
        for (names, labels) in sites {
            let pairs = names.iter().zip(labels);
            legend.push(
                pairs
                    .map(|(name, label)| (name.as_str(), label.as_str()))
                    .collect(),
            );
        }
        legend
    }
}

/// The names given to m variables.
pub(crate) fn variables(given: Option<Vec<String>>, m: usize) -> PyResult<Vec<String>> {
    match given {
        Some(names) if names.len() != m => Err(PyValueError::new_err(format!(
            "there are {} names for {m} variables, the parameter among them",
            names.len()
        ))),
        names => Ok(names.unwrap_or_default()),
    }
}

/// A number with the digits that mean something: ten, and 0 where it is rounding beside the numbers that it stands with.
pub(crate) fn number(value: f64, beside: &[f64]) -> String {
    let largest = beside.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    if value.abs() <= 64.0 * f64::EPSILON * largest && value.abs() < largest {
        return "0.0".to_owned();
    }
    let rounded = format!("{value:.9e}").parse().unwrap_or(value);
    format!("{rounded:?}")
}

/// The size of an error.
pub(crate) fn size(value: f64) -> String {
    match value {
        0.0 => "0".to_owned(),
        v if (1.0..9.95).contains(&v.abs()) => format!("{v:.1}"),
        v => format!("{v:.1e}"),
    }
}
