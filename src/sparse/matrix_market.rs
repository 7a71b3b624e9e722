use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use super::{Matrix, Pattern};
use crate::Cause;
use crate::InputError;
use crate::tolerances::MAX_DIMENSION;

/// The path in errors of text that is not read from a file.
const NO_FILE: &str = "<text>";

/// Reads a real matrix in MatrixMarket form (`coordinate` or `array`; `general`, `symmetric` or `skew-symmetric`).
///
/// Values may be `real` or `integer`; repeated coordinates sum up. Refused are: a dimension above 2³¹; more columns than the length of the
/// file in bytes plus 2²⁰, and more rows than 64 times that length plus 2²⁴, so that neither the matrix nor its transpose takes memory out
/// of proportion to the file (apart from 128 MB); and every value that is not finite.
///
/// # Errors
/// [`InputError::Io`] or [`InputError::Parse`] with the line.
pub fn read_matrix_market(path: impl AsRef<Path>) -> Result<Matrix, InputError> {
    let path = path.as_ref();
    parse_matrix(&read(path)?, path, |_| Ok(()))
}

/// The header of a file.
#[cfg(feature = "json")]
#[derive(Debug, Clone, Copy)]
pub(crate) struct Announced {
    pub(crate) rows: usize,
    pub(crate) cols: usize,
    pub(crate) entries: usize,
}

/// [`read_matrix_market`], unless `accept` refuses what the header announces, before anything is allocated.
#[cfg(feature = "json")]
pub(crate) fn read_matrix_if(
    path: &Path,
    accept: impl FnOnce(Announced) -> Result<(), String>,
) -> Result<Matrix, InputError> {
    parse_matrix(&read(path)?, path, |[rows, cols, entries]| {
        accept(Announced { rows, cols, entries })
    })
}

/// As [`read_matrix_market`], from text; errors give the path as `<text>`.
///
/// ```
/// use semismooth::sparse::parse_matrix_market;
/// let text = "%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 4.0\n2 1 -1.5\n";
/// let a = parse_matrix_market(text)?;
/// assert_eq!((a.get(0, 0), a.get(0, 1), a.get(1, 0)), (4.0, -1.5, -1.5));
/// # Ok::<(), semismooth::InputError>(())
/// ```
///
/// # Errors
/// [`InputError::Parse`] with the line.
pub fn parse_matrix_market(text: &str) -> Result<Matrix, InputError> {
    parse_matrix(text, Path::new(NO_FILE), |_| Ok(()))
}

/// Writes a matrix as `coordinate real general` with 17 significant digits, so that reading it back gives the same values.
///
/// # Errors
/// [`InputError::Entry`] (the format knows no NaN) or [`InputError::Io`].
pub fn write_matrix_market(path: impl AsRef<Path>, matrix: &Matrix) -> Result<(), InputError> {
    matrix.check_finite()?;
    let path = path.as_ref();
    let mut text = String::from("%%MatrixMarket matrix coordinate real general\n");
    let (m, n, nnz) = (matrix.nrows(), matrix.ncols(), matrix.values().len());
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{m} {n} {nnz}");
    for (i, j, v) in matrix.triplets() {
        let _ = writeln!(text, "{} {} {v:.16e}", i + 1, j + 1);
    }
    replace_file(path, |part| fs::write(part, &text)).map_err(|e| io_error(path, e))
}

/// Writes a file next to `path` and moves it there, so that a run that is killed leaves the old file or the new one, never a part of it.
pub(crate) fn replace_file(
    path: &Path,
    write: impl FnOnce(&Path) -> std::io::Result<()>,
) -> std::io::Result<()> {
    // Pipes and devices are no files to be replaced.
    if fs::metadata(path).is_ok_and(|m| !m.is_file()) {
        return write(path);
    }
    let Some(stem) = path.file_stem() else {
        return write(path);
    };
    // The extension stays: it may determine the format.
    let mut name = stem.to_os_string();
    name.push(".part");
    if let Some(ending) = path.extension() {
        name.push(".");
        name.push(ending);
    }
    let part = path.with_file_name(name);
    write(&part)
        .and_then(|()| fs::rename(&part, path))
        .inspect_err(|_| {
            // The partial file is of no use; whether it can be removed changes nothing.
            let _ = fs::remove_file(&part);
        })
}

/// Reads a vector: one number a line (several on a line are taken in order), blank lines and `#` or `%` comments skipped.
///
/// # Errors
/// [`InputError::Io`] or [`InputError::Parse`] with the line.
pub fn read_vector(path: impl AsRef<Path>) -> Result<Vec<f64>, InputError> {
    let path = path.as_ref();
    parse_numbers(&read(path)?, path)
}

/// As [`read_vector`], from text; errors give the path as `<text>`.
///
/// # Errors
/// [`InputError::Parse`] with the line.
pub fn parse_vector(text: &str) -> Result<Vec<f64>, InputError> {
    parse_numbers(text, Path::new(NO_FILE))
}

pub(super) fn read(path: &Path) -> Result<String, InputError> {
    fs::read_to_string(path).map_err(|e| io_error(path, e))
}

fn io_error(path: &Path, e: std::io::Error) -> InputError {
    InputError::Io {
        path: path.to_owned(),
        source: e.into(),
    }
}

fn parse_numbers(text: &str, path: &Path) -> Result<Vec<f64>, InputError> {
    let mut numbers = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let data = line.split(['#', '%']).next().unwrap_or_default();
        for word in data.split_whitespace() {
            let value = number(word).map_err(|what| parse_error(path, k + 1, what))?;
            numbers.push(value);
        }
    }
    Ok(numbers)
}

pub(super) fn parse_error(path: &Path, line: usize, what: String) -> InputError {
    InputError::Parse {
        path: path.to_owned(),
        line,
        what,
        source: None,
    }
}

pub(super) fn number(word: &str) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(v) if v.is_finite() => Ok(v),
        Ok(_) => Err(format!("`{}` is not a finite number", shorten(word))),
        Err(_) => Err(format!("`{}` is not a number", shorten(word))),
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Symmetry {
    General,
    Symmetric,
    Skew,
}

/// The banner: whether entries carry coordinates, and what the entries given imply about the others.
fn parse_banner(line: &str) -> Result<(bool, Symmetry), String> {
    let words: Vec<String> = line.split_whitespace().map(str::to_lowercase).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let ["%%matrixmarket", object, format, field, symmetry] = words.as_slice() else {
        return Err(format!(
            "expected `%%MatrixMarket matrix <format> <field> <symmetry>`, found `{}`",
            shorten(line)
        ));
    };
    if *object != "matrix" {
        return Err(format!("`{}` is not supported, only `matrix`", shorten(object)));
    }
    let coordinate = match *format {
        "coordinate" => true,
        "array" => false,
        other => {
            return Err(format!(
                "format `{}` is not `coordinate` or `array`",
                shorten(other)
            ));
        }
    };
    if !matches!(*field, "real" | "integer" | "double") {
        return Err(format!(
            "field `{}` is not supported, only `real` and `integer`",
            shorten(field)
        ));
    }
    let symmetry = match *symmetry {
        "general" => Symmetry::General,
        "symmetric" => Symmetry::Symmetric,
        "skew-symmetric" => Symmetry::Skew,
        other => {
            return Err(format!(
                "symmetry `{}` is not supported, only `general`, `symmetric` and `skew-symmetric`",
                shorten(other)
            ));
        }
    };
    Ok((coordinate, symmetry))
}

/// The head of a line that may be of any length.
fn shorten(line: &str) -> String {
    line.chars().take(60).collect()
}

/// `accept` sees the numbers of rows, columns and entries announced.
fn parse_matrix(
    text: &str,
    path: &Path,
    accept: impl FnOnce([usize; 3]) -> Result<(), String>,
) -> Result<Matrix, InputError> {
    let mut lines = text.lines().enumerate().map(|(k, line)| (k + 1, line));
    let fail = |line: usize, what: String| parse_error(path, line, what);
    let (_, banner) = lines
        .next()
        .ok_or_else(|| fail(1, "the file is empty".to_owned()))?;
    let (coordinate, symmetry) = parse_banner(banner).map_err(|what| fail(1, what))?;
    let last = text.lines().count();
    let mut lines = lines.filter(|(_, l)| !l.trim_start().starts_with('%') && !l.trim().is_empty());
    let (at, sizes) = lines
        .next()
        .ok_or_else(|| fail(last, "the line with the sizes is missing".to_owned()))?;
    let sizes = parse_sizes(sizes, if coordinate { 3 } else { 2 }).map_err(|what| fail(at, what))?;
    let (m, n) = (sizes[0], sizes[1]);
    check_sizes(m, n, symmetry, text.len()).map_err(|what| fail(at, what))?;
    let expected = match (coordinate, symmetry) {
        (true, _) => sizes[2],
        (false, Symmetry::General) => m.saturating_mul(n),
        (false, Symmetry::Symmetric) => n.saturating_mul(n + 1) / 2,
        (false, Symmetry::Skew) => n.saturating_mul(n.saturating_sub(1)) / 2,
    };
    accept([m, n, expected]).map_err(|what| fail(at, what))?;
    // An entry takes two bytes at least, whatever the header says.
    let mut entries: Vec<(usize, usize, f64)> = Vec::with_capacity(expected.min(text.len() / 2));
    let mut cursor = (usize::from(symmetry == Symmetry::Skew), 0);
    for (line, words) in lines {
        if coordinate {
            let entry = parse_entry(words, m, n, symmetry).map_err(|what| fail(line, what))?;
            entries.push(entry);
        } else {
            for word in words.split_whitespace() {
                let value = number(word).map_err(|what| fail(line, what))?;
                entries.push((cursor.0, cursor.1, value));
                cursor.0 += 1;
                if cursor.0 >= m {
                    let below = match symmetry {
                        Symmetry::General => 0,
                        Symmetry::Symmetric => cursor.1 + 1,
                        Symmetry::Skew => cursor.1 + 2,
                    };
                    cursor = (below, cursor.1 + 1);
                }
            }
        }
        if entries.len() > expected {
            return Err(fail(line, format!("more than the {expected} entries announced")));
        }
    }
    if entries.len() < expected {
        let what = format!("{} entries found, {expected} announced", entries.len());
        return Err(fail(last, what));
    }
    build(m, n, coordinate, symmetry, entries).map_err(|e| match e {
        InputError::Entry { row, col, .. } => fail(
            last,
            format!("entries at ({}, {}) sum up to infinity", row + 1, col + 1),
        ),
        e => InputError::Parse {
            path: path.to_owned(),
            line: last,
            what: e.to_string(),
            source: Some(Cause::new(e)),
        },
    })
}

fn parse_sizes(line: &str, count: usize) -> Result<Vec<usize>, String> {
    let sizes: Result<Vec<usize>, _> = line.split_whitespace().map(str::parse).collect();
    match sizes {
        Ok(sizes) if sizes.len() == count => Ok(sizes),
        _ => Err(format!("expected {count} sizes, found `{}`", shorten(line))),
    }
}

fn check_sizes(m: usize, n: usize, symmetry: Symmetry, length: usize) -> Result<(), String> {
    if m > MAX_DIMENSION || n > MAX_DIMENSION {
        return Err(format!("{m} x {n} is larger than {MAX_DIMENSION} in a direction"));
    }
    // Rows cost nothing here, but a transpose or a vector of them does.
    if m > length.saturating_mul(64).saturating_add(1 << 24) {
        return Err(format!("{m} rows cannot be meant in a file of {length} bytes"));
    }
    // Column pointers are the one array that grows with the header alone.
    if n > length.saturating_add(1 << 20) {
        return Err(format!("{n} columns cannot be meant in a file of {length} bytes"));
    }
    if symmetry != Symmetry::General && m != n {
        return Err(format!("a symmetric matrix cannot be {m} x {n}"));
    }
    Ok(())
}

fn parse_entry(line: &str, m: usize, n: usize, symmetry: Symmetry) -> Result<(usize, usize, f64), String> {
    let mut words = line.split_whitespace();
    let (Some(i), Some(j), Some(v), None) = (words.next(), words.next(), words.next(), words.next()) else {
        return Err(format!("expected `row column value`, found `{}`", shorten(line)));
    };
    let index = |word: &str, size: usize, what: &str| match word.parse::<usize>() {
        Ok(k) if (1..=size).contains(&k) => Ok(k - 1),
        Ok(k) => Err(format!("{what} {k} is outside 1..={size}")),
        Err(_) => Err(format!("`{}` is not a {what}", shorten(word))),
    };
    let (i, j, v) = (index(i, m, "row")?, index(j, n, "column")?, number(v)?);
    match symmetry {
        Symmetry::Skew if i == j && v != 0.0 => {
            Err("the diagonal of a skew-symmetric matrix is zero".to_owned())
        }
        Symmetry::Symmetric | Symmetry::Skew if i < j => {
            Err("only the lower triangle of a symmetric matrix may be given".to_owned())
        }
        _ => Ok((i, j, v)),
    }
}

fn build(
    m: usize,
    n: usize,
    coordinate: bool,
    symmetry: Symmetry,
    mut entries: Vec<(usize, usize, f64)>,
) -> Result<Matrix, InputError> {
    if symmetry != Symmetry::General {
        let sign = if symmetry == Symmetry::Skew { -1.0 } else { 1.0 };
        for k in 0..entries.len() {
            let (i, j, v) = entries[k];
            if i != j {
                entries.push((j, i, sign * v));
            }
        }
    }
    let matrix = if coordinate || symmetry == Symmetry::Skew {
        Matrix::from_triplets(m, n, &entries)?
    } else {
        let mut full = Matrix::zeros(Pattern::full(m, n));
        entries.iter().for_each(|&(i, j, v)| full.add(i, j, v));
        full
    };
    matrix.check_finite()?;
    Ok(matrix)
}
