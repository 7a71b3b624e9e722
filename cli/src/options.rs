//! Options, as AMPL's solvers take them: `name=value`, from the environment and the command line.

use std::time::Duration;

use semismooth::complementarity::McpOptions;
use thiserror::Error;

/// Options of a run.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// Options of the solver.
    pub solver: McpOptions,
    /// 0: nothing is printed; 1: the result; 2: iterations, too. Default 1.
    pub outlev: u32,
    /// Sum of 1: write a .sol file, also without -AMPL; 2: print the variables; 4: print the multipliers; 8: do not print the result.
    /// Default 0.
    pub wantsol: u32,
    /// The objective, from 1; 0 for none. Default 1.
    pub objno: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            solver: McpOptions::default(),
            outlev: 1,
            wantsol: 0,
            objno: 1,
        }
    }
}

/// An option that cannot be understood.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum OptionError {
    /// No option of this name.
    #[error("there is no option {0:?}; -= lists all")]
    Unknown(String),
    /// An option without a value.
    #[error("option {0} needs a value: {0}=…")]
    NoValue(String),
    /// A value out of its range.
    #[error("option {name}={value} is out of range; it must be {range}")]
    Value {
        /// Name of the option.
        name: String,
        /// The value given.
        value: String,
        /// The range.
        range: &'static str,
    },
}

/// Names and meanings of all options.
pub const OPTIONS: [(&str, &str); 8] = [
    (
        "acceptable",
        "error that counts as solved where tol is out of reach (1e-8)",
    ),
    ("max_attempt", "largest number of iterations of one attempt (200)"),
    (
        "max_iter",
        "largest number of iterations over all attempts (20000)",
    ),
    ("max_time", "largest time in seconds (none)"),
    ("objno", "objective to use, from 1; 0 for none (1)"),
    (
        "outlev",
        "0: nothing is printed, 1: the result, 2: iterations (1)",
    ),
    (
        "tol",
        "largest error of a solution relative to the terms of its rows (1e-10)",
    ),
    (
        "wantsol",
        "sum of 1: write FILE.sol, 2: print variables, 4: print multipliers, 8: no result (0)",
    ),
];

impl Options {
    /// Sets options in the order of the text: `name=value`, `name = value` or `name value`, separated by blanks.
    ///
    /// # Errors
    /// The first option that cannot be understood.
    ///
    /// ```
    /// use semismooth_cli::options::Options;
    /// let mut options = Options::default();
    /// options.take("tol=1e-8  max_iter = 50 outlev 0").unwrap();
    /// assert_eq!((options.solver.tolerance, options.solver.max_iterations, options.outlev), (1e-8, 50, 0));
    /// assert!(options.take("tol=-1").is_err());
    /// ```
    pub fn take(&mut self, text: &str) -> Result<(), OptionError> {
        let spaced = text.replace('=', " = ");
        let mut words = spaced.split_whitespace().peekable();
        while let Some(name) = words.next() {
            words.next_if_eq(&"=");
            if !OPTIONS.iter().any(|(known, _)| *known == name) {
                return Err(OptionError::Unknown(name.into()));
            }
            let value = words.next().ok_or_else(|| OptionError::NoValue(name.into()))?;
            self.set(name, value).ok_or_else(|| OptionError::Value {
                name: name.into(),
                value: value.into(),
                range: range(name),
            })?;
        }
        Ok(())
    }

    fn set(&mut self, name: &str, value: &str) -> Option<()> {
        let positive = || value.parse().ok().filter(|v: &f64| *v > 0.0 && v.is_finite());
        let count = || value.parse().ok().filter(|v: &usize| *v > 0);
        let solver = &mut self.solver;
        match name {
            "acceptable" => solver.acceptable = positive()?,
            "max_attempt" => solver.max_attempt = count()?,
            "max_iter" => solver.max_iterations = count()?,
            "max_time" => solver.max_time = Some(Duration::try_from_secs_f64(positive()?).ok()?),
            "objno" => self.objno = value.parse().ok()?,
            "outlev" => self.outlev = value.parse().ok().filter(|v| *v <= 2)?,
            "tol" => solver.tolerance = positive()?,
            _ => self.wantsol = value.parse().ok().filter(|v| *v <= 15)?,
        }
        Some(())
    }
}

fn range(name: &str) -> &'static str {
    match name {
        "max_attempt" | "max_iter" => "an integer of at least 1",
        "objno" => "an integer of at least 0",
        "outlev" => "0, 1 or 2",
        "wantsol" => "an integer from 0 to 15",
        _ => "positive and finite",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_listed_option_can_be_set_and_refuses_nonsense() {
        for (name, _) in OPTIONS {
            let mut options = Options::default();
            options.take(&format!("{name}=2")).unwrap();
            assert_ne!(options, Options::default(), "{name}");
            for value in ["-1", "x", "nan", "99999999999999999999999"] {
                let error = Options::default().take(&format!("{name}={value}"));
                let allowed = matches!((name, value), ("tol" | "acceptable", "99999999999999999999999"));
                assert_eq!(error.is_ok(), allowed, "{name} {value}");
            }
            assert_eq!(
                Options::default().take(name),
                Err(OptionError::NoValue(name.into()))
            );
        }
        assert_eq!(
            Options::default().take("colour=blue"),
            Err(OptionError::Unknown("colour".into()))
        );
    }
}
