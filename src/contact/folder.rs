//! Discrete problems from folders written by other programs.

use std::path::Path;

use super::body::check_matrices;
use super::{ContactBody, ContactError, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use crate::Cause;
use crate::InputError;
use crate::input::check_length;
use crate::sparse::{Announced, Matrix, read_matrix_if, read_vector};

/// Reads a discrete problem with the load f(γ) = (1 − γ) f₀ + γ f₁ from a folder with `A.mtx`, `Bnu.mtx`, `Bt.mtx` (MatrixMarket), `f0.txt`, `f1.txt`, `gap.txt` (one number a line) and
/// `meta.json` with the numbers `friction` (one for all nodes, or a list) and, if it is to be set, `r`.
///
/// # Errors
/// Files that are missing or malformed (file and line are named), matrices with fewer entries than rows, and everything
/// [`ContactBody::new`] checks. Memory is proportional to the number of bytes read.
pub fn read_folder(path: impl AsRef<Path>) -> Result<FullContact<PlanarCoulomb>, ContactError> {
    let folder = path.as_ref();
    let a = read(&folder.join("A.mtx"), None, 0)?;
    let bnu = read(&folder.join("Bnu.mtx"), None, a.nrows())?;
    let bt = read(&folder.join("Bt.mtx"), Some(bnu.nrows()), a.nrows())?;
    // Nothing of the length of a row count is allocated before the matrix is known to fit.
    check_matrices(&a, &[&bnu, &bt])?;
    let p = bnu.nrows();
    let meta_path = folder.join("meta.json");
    let text = std::fs::read_to_string(&meta_path).map_err(|e| InputError::Io {
        path: meta_path.clone(),
        source: e.into(),
    })?;
    let malformed = |line: usize, what: String, source: Option<Cause>| {
        ContactError::Input(InputError::Parse {
            path: meta_path.clone(),
            line,
            what,
            source,
        })
    };
    let meta: serde_json::Value =
        serde_json::from_str(&text).map_err(|e| malformed(e.line(), e.to_string(), Some(Cause::new(e))))?;
    let friction = match meta.get("friction") {
        Some(serde_json::Value::Array(list)) => list
            .iter()
            .map(serde_json::Value::as_f64)
            .collect::<Option<Vec<f64>>>(),
        Some(v) => v.as_f64().map(|f| vec![f; p]),
        None => None,
    };
    let friction = friction
        .ok_or_else(|| malformed(1, "`friction` must be a number or a list of numbers".into(), None))?;
    let r = match meta.get("r") {
        None => None,
        Some(v) => Some(
            v.as_f64()
                .ok_or_else(|| malformed(1, "`r` must be a number".into(), None))?,
        ),
    };
    let f0 = read_vector(folder.join("f0.txt"))?;
    let f1 = read_vector(folder.join("f1.txt"))?;
    check_length("the load f1", f1.len(), f0.len())?;
    let gap_path = folder.join("gap.txt");
    let gap = if gap_path.exists() {
        read_vector(gap_path)?
    } else {
        vec![0.0; p]
    };
    let body = ContactBody::new(a, bnu, vec![bt], LoadPath::between(f0, f1))?.with_gap(gap)?;
    check_length("the list of coefficients of friction", friction.len(), p)?;
    let problem = FullContact::new(body, PlanarCoulomb::new(FrictionCoefficient::nodal(friction)?))?;
    match r {
        Some(r) => problem.with_r(r),
        None => Ok(problem),
    }
}

/// Reads a matrix and refuses more rows than entries (or than the number given) and more columns than A has, so that memory stays
/// proportional to the bytes read.
fn read(path: &Path, rows: Option<usize>, displacements: usize) -> Result<Matrix, ContactError> {
    let accept = |found: Announced| {
        let most = found.entries.max(rows.unwrap_or(0));
        if found.rows > most {
            return Err(format!(
                "{} rows with {} entries: every row needs an entry",
                found.rows, found.entries
            ));
        }
        if found.cols > found.entries.max(displacements) {
            return Err(format!(
                "{} columns for {displacements} displacements, with {} entries",
                found.cols, found.entries
            ));
        }
        Ok(())
    };
    Ok(read_matrix_if(path, accept)?)
}
