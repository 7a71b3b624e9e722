//! Stiffness matrices of substructures as Abaqus and CalculiX write them.

use std::path::Path;

use super::Matrix;
use super::matrix_market::{number, parse_error, read};
use crate::InputError;

/// The stiffness of a substructure on the displacements that it retains.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Substructure {
    /// Symmetric, n × n.
    pub stiffness: Matrix,
    /// Label of the node and component, counted from 1, of each of the n displacements, in the order of the matrix. Components 4 to 6 are
    /// rotations.
    pub displacements: Vec<[usize; 2]>,
}

/// Reads the stiffness from the `.mtx` file that Abaqus and CalculiX write under `*SUBSTRUCTURE MATRIX OUTPUT`: a linear `*USER ELEMENT` with the labels of its nodes in comments, components by node, then `*MATRIX, TYPE=STIFFNESS` with the lower triangle row
/// by row. Other matrices of the file are left out.
///
/// # Errors
/// [`InputError::Io`], or [`InputError::Parse`] with the line: another kind of file, numbers of nodes, components and entries that do not
/// agree, values that are not finite.
pub fn read_substructure(path: impl AsRef<Path>) -> Result<Substructure, InputError> {
    let path = path.as_ref();
    parse(&read(path)?, path)
}

/// As [`read_substructure`], from text; errors give the path as `<text>`.
///
/// ```
/// use semismooth::sparse::parse_substructure;
/// let text = "*USER ELEMENT, NODES=2, LINEAR\n** ELEMENT NODES\n** 17, 5\n1, 2\n2, 2\n*MATRIX,TYPE=STIFFNESS\n4.0\n1.0, 3.0\n0.5, 0.25, 2.0\n";
/// let found = parse_substructure(text)?;
/// assert_eq!(found.displacements, [[17, 1], [17, 2], [5, 2]]);
/// assert_eq!((found.stiffness.get(2, 1), found.stiffness.get(1, 2)), (0.25, 0.25));
/// # Ok::<(), semismooth::InputError>(())
/// ```
///
/// # Errors
/// [`InputError::Parse`] with the line.
pub fn parse_substructure(text: &str) -> Result<Substructure, InputError> {
    parse(text, Path::new("<text>"))
}

/// The part of the file that a line belongs to.
#[derive(Clone, Copy, PartialEq)]
enum Section {
    Other,
    Element,
    Stiffness,
}

fn parse(text: &str, path: &Path) -> Result<Substructure, InputError> {
    let fail = |line: usize, what: String| parse_error(path, line, what);
    let (mut section, mut labels_follow, mut triangular_at) = (Section::Other, false, 0);
    let (mut announced, mut labels, mut components, mut entries) = (None, Vec::new(), Vec::new(), Vec::new());
    for (at, line) in text.lines().enumerate().map(|(k, line)| (k + 1, line.trim())) {
        if let Some(comment) = line.strip_prefix("**") {
            let comment = comment.trim();
            let list = integers(comment).ok().filter(|l| !l.is_empty());
            match (labels_follow, list) {
                (true, Some(list)) => labels.extend(list),
                _ => labels_follow = comment.to_uppercase().starts_with("ELEMENT NODES"),
            }
            continue;
        }
        labels_follow = false;
        if line.starts_with('*') {
            let words: String = line.to_uppercase().split_whitespace().collect();
            section = match words.as_str() {
                w if w.starts_with("*USERELEMENT") => {
                    let count = w.split(',').find_map(|p| p.strip_prefix("NODES="));
                    announced = Some(
                        count
                            .and_then(|c| c.parse::<usize>().ok())
                            .ok_or_else(|| fail(at, format!("`{line}` does not say its number of nodes")))?,
                    );
                    Section::Element
                }
                w if w.starts_with("*MATRIX") && w.contains("TYPE=STIFFNESS") => {
                    triangular_at = at;
                    Section::Stiffness
                }
                _ => Section::Other,
            };
            continue;
        }
        match section {
            Section::Element if !line.is_empty() => {
                components.push((at, integers(line).map_err(|what| fail(at, what))?));
            }
            Section::Stiffness => {
                for word in line.split(',').map(str::trim).filter(|w| !w.is_empty()) {
                    entries.push(number(word).map_err(|what| fail(at, what))?);
                }
            }
            _ => {}
        }
    }
    let last = text.lines().count();
    let nodes = announced.ok_or_else(|| fail(last, "there is no *USER ELEMENT".to_owned()))?;
    if labels.len() != nodes {
        let what = format!(
            "{} labels of nodes below `** ELEMENT NODES`, {nodes} announced",
            labels.len()
        );
        return Err(fail(last, what));
    }
    let displacements = displacements(&labels, &components).map_err(|(at, what)| fail(at, what))?;
    let n = displacements.len();
    if triangular_at == 0 {
        return Err(fail(last, "there is no *MATRIX, TYPE=STIFFNESS".to_owned()));
    }
    if entries.len() != n * (n + 1) / 2 {
        let what = format!(
            "{} entries of the stiffness; a lower triangle for {n} displacements has {}",
            entries.len(),
            n * (n + 1) / 2
        );
        return Err(fail(triangular_at, what));
    }
    let mut triplets = Vec::with_capacity(n * n);
    let places = (0..n).flat_map(|i| (0..=i).map(move |j| (i, j)));
    for ((i, j), v) in places.zip(entries) {
        triplets.push((i, j, v));
        if i != j {
            triplets.push((j, i, v));
        }
    }
    Ok(Substructure {
        stiffness: Matrix::from_triplets(n, n, &triplets)?,
        displacements,
    })
}

fn integers(line: &str) -> Result<Vec<usize>, String> {
    let words = line.split(',').map(str::trim).filter(|w| !w.is_empty());
    words
        .map(|w| w.parse().map_err(|_| format!("`{w}` is not a whole number")))
        .collect()
}

/// Node and component of each displacement: the first line lists the components of the first node, each further one the place of a node,
/// from 1, and the components from that node on.
fn displacements(
    labels: &[usize],
    lines: &[(usize, Vec<usize>)],
) -> Result<Vec<[usize; 2]>, (usize, String)> {
    let mut of_node: Vec<&[usize]> = vec![&[]; labels.len()];
    let mut before = 0;
    for (k, (at, list)) in lines.iter().enumerate() {
        let (first, components) = match (k, list.split_first()) {
            (0, _) => (1, list.as_slice()),
            (_, Some((first, rest))) => (*first, rest),
            (_, None) => continue,
        };
        if first <= before || first > labels.len() {
            let what = format!(
                "components from node {first} on; nodes are in order, and there are {}",
                labels.len()
            );
            return Err((*at, what));
        }
        if let Some(wrong) = components.iter().find(|c| !(1..=6).contains(*c)) {
            return Err((*at, format!("component {wrong} is none of 1 to 6")));
        }
        of_node[first - 1..].fill(components);
        before = first;
    }
    let pairs = labels.iter().zip(of_node);
    Ok(pairs
        .flat_map(|(label, components)| components.iter().map(|c| [*label, *c]))
        .collect())
}
