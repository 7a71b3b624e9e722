//! Problems from JSON files.

use std::error::Error;
use std::path::Path;

use serde_json::Value;

use super::DelassusProblem;
use crate::Cause;
use crate::InputError;
use crate::contact::ContactError;
use crate::sparse::Matrix;

/// Reads a problem from a JSON file: an object with `dimension` (2 or 3), `mu` (one coefficient a contact), `q`, and `M` as
/// `{"format": "csc", "indptr": […], "indices": […], "data": […]}` (compressed columns, indices from 0) or as a list of rows.
/// `nc` and `n`, where given, are checked; other members are ignored.
///
/// # Errors
/// [`InputError::File`] where the file cannot be read or a member is missing or malformed, and everything
/// [`DelassusProblem::new`] checks.
pub fn read_delassus(path: impl AsRef<Path>) -> Result<DelassusProblem, ContactError> {
    let path = path.as_ref();
    let failed = |Flaw { what, source }| {
        ContactError::Input(InputError::File {
            path: path.to_path_buf(),
            what,
            source,
        })
    };
    let text = std::fs::read_to_string(path).map_err(|e| failed(Flaw::of(e)))?;
    let json: Value = serde_json::from_str(&text).map_err(|e| failed(Flaw::of(e)))?;
    parse(&json).map_err(failed)?
}

/// An error in the format of the file.
struct Flaw {
    what: String,
    source: Option<Cause>,
}

impl Flaw {
    fn of(error: impl Error + Send + Sync + 'static) -> Self {
        Self {
            what: error.to_string(),
            source: Some(Cause::new(error)),
        }
    }

    fn of_matrix(error: InputError) -> Self {
        Self {
            what: format!("`M`: {error}"),
            ..Self::of(error)
        }
    }
}

impl<T: Into<String>> From<T> for Flaw {
    fn from(what: T) -> Self {
        Self {
            what: what.into(),
            source: None,
        }
    }
}

/// The outer error is one of format, the inner one of content.
fn parse(json: &Value) -> Result<Result<DelassusProblem, ContactError>, Flaw> {
    let dimension = whole(json, "dimension")?.ok_or("`dimension` is missing")?;
    let friction = floats(json, "mu")?;
    let q = floats(json, "q")?;
    for (name, found) in [("nc", friction.len()), ("n", q.len())] {
        if let Some(told) = whole(json, name)?
            && told != found
        {
            return Err(format!("`{name}` is {told}, but the lists have {found}").into());
        }
    }
    let n = q.len();
    let m = json.get("M").ok_or("`M` is missing")?;
    let matrix = match m {
        Value::Array(rows) => {
            let rows = (rows.iter().enumerate())
                .map(|(i, row)| numbers(row, &format!("row {i} of `M`")))
                .collect::<Result<Vec<_>, _>>()?;
            Matrix::from_rows(&rows).map_err(Flaw::of_matrix)?
        }
        Value::Object(_) => compressed(m, n)?,
        _ => return Err("`M` must be an object or a list of rows".into()),
    };
    Ok(DelassusProblem::new(dimension, matrix, q, friction))
}

fn compressed(m: &Value, n: usize) -> Result<Matrix, Flaw> {
    match m.get("format").and_then(Value::as_str) {
        Some("csc") => {}
        Some(other) => return Err(format!("`M.format` is \"{other}\", expected \"csc\"").into()),
        None => return Err("`M.format` is missing, expected \"csc\"".into()),
    }
    let ptr = wholes(m, "indptr")?;
    let rows = wholes(m, "indices")?;
    let values = floats(m, "data")?;
    if ptr.len() != n + 1 {
        return Err(format!(
            "`M.indptr` has {} entries, but `q` has {n}: n + 1 are needed",
            ptr.len()
        )
        .into());
    }
    if rows.len() != values.len() {
        return Err(format!(
            "`M.indices` has {} entries and `M.data` {}; the lengths must agree",
            rows.len(),
            values.len()
        )
        .into());
    }
    if ptr[0] != 0 || ptr[n] != rows.len() || ptr.windows(2).any(|w| w[0] > w[1]) {
        return Err(format!(
            "`M.indptr` must rise from 0 to the number of entries, {}",
            rows.len()
        )
        .into());
    }
    let mut triplets = Vec::with_capacity(rows.len());
    for j in 0..n {
        triplets.extend((ptr[j]..ptr[j + 1]).map(|k| (rows[k], j, values[k])));
    }
    Matrix::from_triplets(n, n, &triplets).map_err(Flaw::of_matrix)
}

fn whole(json: &Value, name: &str) -> Result<Option<usize>, String> {
    match json.get(name) {
        None | Some(Value::Null) => Ok(None),
        Some(v) => match v.as_u64().and_then(|v| usize::try_from(v).ok()) {
            Some(v) => Ok(Some(v)),
            None => Err(format!("`{name}` is {v}, expected a whole number")),
        },
    }
}

fn list<'a>(json: &'a Value, name: &str) -> Result<&'a [Value], String> {
    match json.get(name) {
        Some(Value::Array(list)) => Ok(list),
        Some(_) => Err(format!("`{name}` must be a list")),
        None => Err(format!("`{name}` is missing")),
    }
}

fn floats(json: &Value, name: &str) -> Result<Vec<f64>, String> {
    list(json, name)?;
    numbers(&json[name], &format!("`{name}`"))
}

fn numbers(list: &Value, what: &str) -> Result<Vec<f64>, String> {
    let Value::Array(list) = list else {
        return Err(format!("{what} must be a list of numbers"));
    };
    (list.iter().enumerate())
        .map(|(i, v)| {
            v.as_f64()
                .ok_or_else(|| format!("entry {i} of {what} is {v}, expected a number"))
        })
        .collect()
}

fn wholes(json: &Value, name: &str) -> Result<Vec<usize>, String> {
    (list(json, name)?.iter().enumerate())
        .map(|(i, v)| {
            (v.as_u64().and_then(|v| usize::try_from(v).ok()))
                .ok_or_else(|| format!("entry {i} of `M.{name}` is {v}, expected a whole number"))
        })
        .collect()
}
