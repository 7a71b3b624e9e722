//! The run file of equations or of a discrete friction problem.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::Spanned;

/// A run file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Input {
    pub(super) problem: Spanned<ProblemInput>,
    pub(super) run: Spanned<RunInput>,
    pub(super) options: Option<Spanned<toml::Table>>,
    #[serde(default)]
    pub(super) output: OutputInput,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ProblemInput {
    pub(super) unknowns: Option<Vec<String>>,
    pub(super) parameter: Option<String>,
    /// Numbers with names, for the equations.
    #[serde(default)]
    pub(super) constants: BTreeMap<String, f64>,
    pub(super) equations: Option<Vec<Spanned<String>>>,
    pub(super) folder: Option<Spanned<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RunInput {
    /// The range of the parameter: first and last value.
    pub(super) range: Option<Spanned<[f64; 2]>>,
    pub(super) start: Option<Spanned<Vec<f64>>>,
    /// Points (unknowns, then the parameter) at which curves start.
    pub(super) starts: Option<Vec<Spanned<Vec<f64>>>>,
    /// Parameters at which curves start from all solutions.
    pub(super) sections: Option<Spanned<Vec<f64>>>,
    /// Parameters at which solutions are listed.
    pub(super) at: Option<Spanned<Vec<f64>>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct OutputInput {
    pub(super) folder: String,
    /// Unknowns that are drawn.
    pub(super) plot: Option<Spanned<Vec<String>>>,
}

impl Default for OutputInput {
    fn default() -> Self {
        Self {
            folder: "out".to_owned(),
            plot: None,
        }
    }
}

/// Options of the library by their names.
pub(super) fn options<T: DeserializeOwned>(table: &toml::Table) -> Result<T, toml::de::Error> {
    toml::Value::Table(table.clone()).try_into()
}
