//! Why a command ended without a result.

use std::error::Error;
use std::io;

use thiserror::Error;

type Source = Box<dyn Error + Send + Sync>;

/// Why a command ended without a result.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CommandError {
    /// A file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// The file.
        path: String,
        /// Why not.
        source: io::Error,
    },
    /// A run file that is not TOML, has unknown keys, or values of the wrong type; the message has the line.
    #[error("{path}: {source}")]
    Toml {
        /// The file.
        path: String,
        /// What is wrong, and where.
        source: Box<toml::de::Error>,
    },
    /// An invalid value in a run file.
    #[error("{path}, line {line}, {key}: {source}")]
    Value {
        /// The file.
        path: String,
        /// The line, from 1.
        line: usize,
        /// The table or key.
        key: String,
        /// What is wrong with it.
        source: Source,
    },
    /// A computation that failed, or a result that cannot be written.
    #[error("{what}: {source}")]
    Failed {
        /// The computation or output that failed.
        what: String,
        /// Why it failed.
        source: Source,
    },
    /// Some problems of several were not solved.
    #[error("{unsolved} of {all} problems are not solved")]
    Unsolved {
        /// Number of unsolved problems.
        unsolved: usize,
        /// Number of all problems.
        all: usize,
    },
    /// The user interrupted the run.
    #[error("interrupted {0}")]
    Interrupted(String),
    /// The result could not be printed.
    #[error("standard output: {0}")]
    Output(#[from] io::Error),
}

impl CommandError {
    pub(super) fn failed(what: impl Into<String>, source: impl Into<Source>) -> Self {
        Self::Failed {
            what: what.into(),
            source: source.into(),
        }
    }

    /// Whether the reader of the output has closed the pipe (`| head`), which is no failure.
    #[must_use]
    pub fn is_closed_pipe(&self) -> bool {
        matches!(self, Self::Output(e) if e.kind() == io::ErrorKind::BrokenPipe)
    }

    /// The exit code: 130 if the user interrupted the run, else 1.
    #[must_use]
    pub fn code(&self) -> u8 {
        match self {
            Self::Interrupted(_) => 130,
            _ => 1,
        }
    }
}
