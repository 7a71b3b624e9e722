//! AMPL's .sol files (D. M. Gay, 1997: "Hooking your solver to AMPL").

use std::fmt::{self, Write};

use crate::nl::Header;

/// The result of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// The message for the user.
    pub message: String,
    /// AMPL's `solve_result_num`: 0 to 99 solved, 100 to 199 in doubt, 200 to 299 infeasible, 300 to 399 unbounded, 400 to 499 stopped by a
    /// limit, 500 to 599 failed.
    pub code: u16,
    /// The values of the variables.
    pub x: Vec<f64>,
    /// The multipliers of the rows; empty for complementarity problems, which have none.
    pub duals: Vec<f64>,
    /// The objective that was used, from 0.
    pub objective: usize,
}

impl Solution {
    /// The text of the file.
    #[must_use]
    pub fn to_sol(&self, header: &Header) -> String {
        let mut out = String::new();
        // Writing to a string cannot fail.
        let _ = self.write(header, &mut out);
        out
    }

    fn write(&self, header: &Header, out: &mut String) -> fmt::Result {
        for line in self.message.lines() {
            // An empty line would end the message.
            writeln!(out, "{}", if line.is_empty() { " " } else { line })?;
        }
        writeln!(out)?;
        if !header.options.is_empty() {
            // With a tolerance after the options, readers expect a count that is larger by two.
            let count = header.options.len() + if header.tolerance.is_some() { 2 } else { 0 };
            writeln!(out, "Options\n{count}")?;
            for option in &header.options {
                writeln!(out, "{option}")?;
            }
        } else {
            writeln!(out, "Options\n0")?;
        }
        for count in [header.rows, self.duals.len(), header.variables, self.x.len()] {
            writeln!(out, "{count}")?;
        }
        if let Some(tolerance) = header.tolerance {
            writeln!(out, "{tolerance:?}")?;
        }
        for value in self.duals.iter().chain(&self.x) {
            writeln!(out, "{value:?}")?;
        }
        writeln!(out, "objno {} {}", self.objective, self.code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_is_as_its_readers_expect() {
        let mut header = Header {
            options: vec![1, 1, 0],
            variables: 2,
            rows: 1,
            ..Header::default()
        };
        let solution = Solution {
            message: "solved\n\nwell".into(),
            code: 0,
            x: vec![1e-9, 2.5],
            duals: vec![-1.0],
            objective: 0,
        };
        assert_eq!(
            solution.to_sol(&header),
            "solved\n \nwell\n\nOptions\n3\n1\n1\n0\n1\n1\n2\n2\n-1.0\n1e-9\n2.5\nobjno 0 0\n"
        );
        header.options = vec![1, 3, 0];
        header.tolerance = Some(1e-7);
        let text = solution.to_sol(&header);
        assert!(
            text.contains("Options\n5\n1\n3\n0\n1\n1\n2\n2\n1e-7\n-1.0\n"),
            "{text}"
        );
    }
}
