//! Discrete problems from folders written by other programs.

use std::path::{Path, PathBuf};

use super::body::check_matrices;
use super::{ContactError, FrictionPath, FrictionProblem, LoadPath};
use crate::sparse::{SparseError, read_matrix_market, read_vector};

/// A discrete problem read from a folder, with the load f(γ) = (1 − γ) f₀ + γ f₁.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct DiscreteFolder {
    /// The folder.
    pub path: PathBuf,
    /// The problem.
    pub problem: FrictionProblem,
}

/// Reads a folder with `A.mtx`, `Bnu.mtx`, `Bt.mtx` (MatrixMarket), `f0.txt`, `f1.txt`, `gap.txt` (one number a line) and
/// `meta.json` with the numbers `friction` (one for all nodes, or a list) and, if it is to be set, `r`.
///
/// # Errors
/// Files that are missing or malformed (file and line are named), and everything [`FrictionProblem::new`] checks.
pub fn read_folder(path: impl AsRef<Path>) -> Result<DiscreteFolder, ContactError> {
    let folder = path.as_ref();
    let a = read_matrix_market(folder.join("A.mtx"))?;
    let bnu = read_matrix_market(folder.join("Bnu.mtx"))?;
    let bt = read_matrix_market(folder.join("Bt.mtx"))?;
    // No vector is made for the rows of a matrix that does not fit.
    check_matrices(&a, &[&bnu, &bt])?;
    let p = bnu.nrows();
    let meta_path = folder.join("meta.json");
    let text = std::fs::read_to_string(&meta_path).map_err(|e| SparseError::Io {
        path: meta_path.clone(),
        what: e.to_string(),
    })?;
    let malformed = |line: usize, what: String| {
        ContactError::File(SparseError::Parse {
            path: meta_path.clone(),
            line,
            what,
        })
    };
    let meta: serde_json::Value =
        serde_json::from_str(&text).map_err(|e| malformed(e.line(), e.to_string()))?;
    let friction = match meta.get("friction") {
        Some(serde_json::Value::Array(list)) => list
            .iter()
            .map(serde_json::Value::as_f64)
            .collect::<Option<Vec<f64>>>(),
        Some(v) => v.as_f64().map(|f| vec![f; p]),
        None => None,
    };
    let friction =
        friction.ok_or_else(|| malformed(1, "`friction` must be a number or a list of numbers".into()))?;
    let r = match meta.get("r") {
        None => None,
        Some(v) => Some(
            v.as_f64()
                .ok_or_else(|| malformed(1, "`r` must be a number".into()))?,
        ),
    };
    let f0 = read_vector(folder.join("f0.txt"))?;
    let f1 = read_vector(folder.join("f1.txt"))?;
    if f0.len() != f1.len() {
        return Err(ContactError::Length {
            what: "the load f1",
            expected: f0.len(),
            found: f1.len(),
        });
    }
    let gap_path = folder.join("gap.txt");
    let gap = if gap_path.exists() {
        read_vector(gap_path)?
    } else {
        vec![0.0; p]
    };
    let problem = FrictionProblem::new(
        a,
        bnu,
        bt,
        LoadPath::between(f0, &f1),
        FrictionPath::constant(friction),
    )?
    .with_gap(gap)?;
    let problem = match r {
        Some(r) => problem.with_r(r)?,
        None => problem,
    };
    Ok(DiscreteFolder {
        path: folder.to_path_buf(),
        problem,
    })
}
