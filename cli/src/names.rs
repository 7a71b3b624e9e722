//! Names of variables and rows, which AMPL (`option auxfiles rc`) and Pyomo (`symbolic_solver_labels=True`) write beside a problem.

use std::fs;
use std::path::Path;

/// Names by number, as far as they are known.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Names {
    variables: Vec<String>,
    rows: Vec<String>,
}

impl Names {
    /// The names in the files beside a problem, one per line: variables in FILE.col, rows in FILE.row. Files that do not exist or have
    /// the wrong number of lines give no names.
    #[must_use]
    pub fn beside(problem: &Path, variables: usize, rows: usize) -> Self {
        // Objectives follow after the rows.
        let names = |extension: &str, count: usize| {
            let text = fs::read_to_string(problem.with_extension(extension)).unwrap_or_default();
            let names: Vec<String> = text.lines().map(|l| l.trim().to_owned()).collect();
            if names.len() >= count { names } else { Vec::new() }
        };
        Self {
            variables: names("col", variables),
            rows: names("row", rows),
        }
    }

    /// The name of a variable, for messages.
    #[must_use]
    pub fn variable(&self, number: usize) -> String {
        label("variable", &self.variables, number)
    }

    /// The name of a row, for messages.
    #[must_use]
    pub fn row(&self, number: usize) -> String {
        label("row", &self.rows, number)
    }
}

fn label(what: &str, names: &[String], number: usize) -> String {
    match names.get(number) {
        Some(name) => format!("{what} {name}"),
        None => format!("{what} {number} (from 0)"),
    }
}
