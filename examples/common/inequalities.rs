//! Variational inequalities and cone problems in JSON: `n`, `kind`: `affine` (`M`, `q`) or `expr` (`rows`, `defs` as in
//! `expressions.rs`), `starts` {label: x}; for a polyhedron `A`, `b`, `E`, `d`, `lower`, `upper` (null: no bound). A matrix is a list of
//! rows or {"shape": [m, n], "triplets": [[i, j, v], …]}.
#![allow(dead_code)]

use std::path::Path;

use semismooth::complementarity::{AffineFunction, ComplementarityError, McpFunction};
use semismooth::cones::{Cone, ConeProblem};
use semismooth::sparse::Matrix;
use semismooth::variational::{Polyhedron, Vi};
use serde_json::Value;

use crate::expressions::{Failure, bounds, number, shown, starts, tape, vector};

pub(crate) type Function = Box<dyn McpFunction>;

/// The data common to all files.
pub(crate) struct Problem {
    pub(crate) name: String,
    /// Whether a solution is known to exist.
    pub(crate) solvable: bool,
    /// Label and x.
    pub(crate) starts: Vec<(String, Vec<f64>)>,
    /// Known solutions, where the file lists any, and whether these are all.
    pub(crate) solutions: Vec<Vec<f64>>,
    pub(crate) all: bool,
}

/// Calls `parse` with the object in a file; errors name the file.
fn open<T>(
    path: &Path,
    parse: impl FnOnce(&Value, usize) -> Result<T, Failure>,
) -> Result<(Problem, T), Failure> {
    let text = std::fs::read_to_string(path).map_err(|e| e.to_string());
    let stem = path
        .file_stem()
        .map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let read = |text: &str| {
        let file: Value = serde_json::from_str(text).map_err(|e| e.to_string())?;
        let n = file["n"]
            .as_u64()
            .filter(|n| *n > 0)
            .ok_or("`n` is missing or no positive whole number")?;
        let n = n as usize;
        let known = file["solutions"].as_array().cloned().unwrap_or_default();
        let problem = Problem {
            name: file["name"].as_str().unwrap_or(&stem).to_owned(),
            solvable: file["expect"].as_str() != Some("none"),
            starts: starts(&file, n)?,
            solutions: known.iter().filter_map(|s| vector(&s["x"], n).ok()).collect(),
            all: file["all"].as_bool() == Some(true),
        };
        Ok((problem, parse(&file, n)?))
    };
    text.and_then(|text| read(&text))
        .map_err(|e: Failure| format!("{}: {e}", path.display()))
}

/// Reads a variational inequality over a polyhedron.
pub(crate) fn read_vi(path: &Path) -> Result<(Problem, Vi<Function>), Failure> {
    open(path, |file, n| {
        let told = |e: ComplementarityError| e.to_string();
        let mut set = Polyhedron::boxed(
            bounds(file, "lower", n, f64::NEG_INFINITY)?,
            bounds(file, "upper", n, f64::INFINITY)?,
        )
        .map_err(told)?;
        let (a, b) = rows(file, "A", "b", n)?;
        set = set.with_inequalities(a, b).map_err(told)?;
        let (e, d) = rows(file, "E", "d", n)?;
        set = set.with_equations(e, d).map_err(told)?;
        Vi::new(function(file, n)?, set).map_err(told)
    })
}

/// Reads a cone complementarity problem: `cones` is a list of ["l" | "q" | "f" | "s", number of variables].
pub(crate) fn read_cone(path: &Path) -> Result<(Problem, ConeProblem<Function>), Failure> {
    open(path, |file, n| {
        let list = file["cones"].as_array().ok_or("`cones` is missing or no list")?;
        let mut cones = Vec::with_capacity(list.len());
        for (k, entry) in list.iter().enumerate() {
            let size = entry[1]
                .as_u64()
                .filter(|s| (1..=n as u64).contains(s))
                .map(|s| s as usize);
            cones.push(match (entry[0].as_str(), size) {
                (Some("l"), Some(size)) => Cone::Nonnegative(size),
                (Some("q"), Some(size)) => Cone::SecondOrder(size),
                (Some("f"), Some(size)) => Cone::Free(size),
                (Some("s"), Some(size)) => match (1..=size).find(|k| k * (k + 1) / 2 >= size) {
                    Some(order) if order * (order + 1) / 2 == size => Cone::Semidefinite(order),
                    _ => {
                        return Err(format!(
                            "cones[{k}]: {size} is not k (k + 1)/2, the variables of a matrix of order k"
                        ));
                    }
                },
                _ => {
                    return Err(format!(
                        "cones[{k}]: {} is no cone of 1 to {n} variables",
                        shown(entry)
                    ));
                }
            });
        }
        ConeProblem::new(function(file, n)?, cones).map_err(|e| e.to_string())
    })
}

/// F of a file.
pub(crate) fn function(file: &Value, n: usize) -> Result<Function, Failure> {
    match file["kind"].as_str() {
        Some("affine") => {
            let m = matrix(&file["M"], n).map_err(|e| format!("M: {e}"))?;
            let q = vector(&file["q"], n).map_err(|e| format!("q: {e}"))?;
            if m.nrows() != n {
                return Err(format!("M has {} rows for n = {n}", m.nrows()));
            }
            Ok(Box::new(AffineFunction::new(m, q).map_err(|e| e.to_string())?))
        }
        Some("expr") => Ok(Box::new(tape(file, n)?)),
        _ => Err(format!(
            "`kind` is {}, expected \"affine\" or \"expr\"",
            shown(&file["kind"])
        )),
    }
}

fn rows(file: &Value, matrix_key: &str, right_key: &str, n: usize) -> Result<(Matrix, Vec<f64>), Failure> {
    let a = match &file[matrix_key] {
        Value::Null => Matrix::from_triplets(0, n, &[]).map_err(|e| e.to_string())?,
        value => matrix(value, n).map_err(|e| format!("{matrix_key}: {e}"))?,
    };
    let b = match &file[right_key] {
        Value::Null if a.nrows() == 0 => Vec::new(),
        value => vector(value, a.nrows()).map_err(|e| format!("{right_key}: {e}"))?,
    };
    Ok((a, b))
}

fn matrix(value: &Value, n: usize) -> Result<Matrix, Failure> {
    if let Some(list) = value.as_array() {
        let rows: Vec<Vec<f64>> = list.iter().map(|row| vector(row, n)).collect::<Result<_, _>>()?;
        return match rows.is_empty() {
            true => Matrix::from_triplets(0, n, &[]),
            false => Matrix::from_rows(&rows),
        }
        .map_err(|e| e.to_string());
    }
    let size = |k: usize| value["shape"][k].as_u64().map(|s| s as usize);
    let (Some(m), Some(found)) = (size(0), size(1)) else {
        return Err("neither a list of rows nor an object with shape and triplets".to_owned());
    };
    const MOST: usize = 1_000_000;
    if m > MOST {
        return Err(format!("{m} rows, more than {MOST}"));
    }
    if found != n {
        return Err(format!("{found} columns for n = {n}"));
    }
    let list = value["triplets"]
        .as_array()
        .ok_or("`triplets` is missing or no list")?;
    let index = |v: &Value, limit: usize| {
        let k = v.as_u64().map(|k| k as usize).filter(|k| *k < limit);
        k.ok_or_else(|| format!("{} is no index below {limit}", shown(v)))
    };
    let mut triplets = Vec::with_capacity(list.len());
    for t in list {
        triplets.push((index(&t[0], m)?, index(&t[1], n)?, number(&t[2])?));
    }
    Matrix::from_triplets(m, n, &triplets).map_err(|e| e.to_string())
}
