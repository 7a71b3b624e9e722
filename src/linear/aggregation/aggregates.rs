//! Aggregation of nodes.

use crate::sparse::Symmetric;

/// Fewest nodes of an aggregate that is not merged: rigid motions are not independent on fewer.
const FEW: usize = 3;

/// The aggregate of each node, and their number.
#[derive(Debug, Clone)]
pub(super) struct Aggregates {
    pub(super) of: Vec<u32>,
    pub(super) count: usize,
}

pub(super) const NONE: u32 = u32::MAX;

/// Gathers nodes with their strong neighbours (P. Vaněk, J. Mandel, M. Brezina, 1996): nodes i, j with
/// ‖A_ij‖² > θ² ‖A_ii‖ ‖A_jj‖, in Frobenius norms. Those of different classes are not gathered.
pub(super) fn aggregates<const B: usize>(a: &Symmetric<B>, theta: f64, classes: &[usize]) -> Aggregates {
    let together = |i: usize, j: usize| classes.is_empty() || classes[i] == classes[j];
    let n = a.nrows();
    let norms: Vec<f64> = (0..n).map(|i| square(a.diagonal(i)).sqrt()).collect();
    // Squares of the strengths, 0 for weak neighbours; single precision suffices for comparisons.
    let mut strength = vec![0.0f32; a.len()];
    for i in 0..n {
        let (cols, values) = a.lower().row(i);
        for ((&j, block), k) in cols.iter().zip(values).zip(a.lower().start[i]..) {
            let j = j as usize;
            let relative = square(block) / (norms[i] * norms[j]);
            if j != i && relative > theta * theta && together(i, j) {
                strength[k] = relative as f32;
            }
        }
    }
    let strong = |i: usize| {
        let pairs = a.places(i).map(|(j, k)| (j, strength[k]));
        pairs.filter(|p| p.1 > 0.0)
    };
    let mut of = vec![NONE; n];
    let mut count = 0u32;
    for i in 0..n {
        if of[i] != NONE || strong(i).next().is_none() || strong(i).any(|(j, _)| of[j] != NONE) {
            continue;
        }
        of[i] = count;
        strong(i).for_each(|(j, _)| of[j] = count);
        count += 1;
    }
    let roots = of.clone();
    for i in (0..n).filter(|&i| roots[i] == NONE) {
        of[i] = strongest(strong(i).filter(|(j, _)| roots[*j] != NONE)).map_or(NONE, |j| roots[j]);
    }
    for i in 0..n {
        if of[i] != NONE {
            continue;
        }
        of[i] = count;
        for (j, _) in strong(i) {
            if of[j] == NONE {
                of[j] = count;
            }
        }
        count += 1;
    }
    merge_small(a, &mut of, count as usize, together)
}

/// Merges each small aggregate with that of the neighbour it is most strongly coupled to.
fn merge_small<const B: usize>(
    a: &Symmetric<B>,
    of: &mut [u32],
    count: usize,
    together: impl Fn(usize, usize) -> bool,
) -> Aggregates {
    let mut size = vec![0u32; count];
    of.iter().for_each(|k| size[*k as usize] += 1);
    for i in 0..of.len() {
        let own = of[i];
        if size[own as usize] as usize >= FEW {
            continue;
        }
        let values = &a.lower().value;
        let others = a.places(i).map(|(j, k)| (j, square(&values[k]) as f32));
        if let Some(j) = strongest(others.filter(|(j, s)| of[*j] != own && *s > 0.0 && together(i, *j))) {
            size[own as usize] -= 1;
            of[i] = of[j];
            size[of[i] as usize] += 1;
        }
    }
    // In the order of their first nodes: near aggregates have near numbers.
    let mut number = vec![NONE; count];
    let mut next = 0;
    for own in of.iter_mut() {
        let number = &mut number[*own as usize];
        if *number == NONE {
            *number = next;
            next += 1;
        }
        *own = *number;
    }
    Aggregates {
        of: of.to_vec(),
        count: next as usize,
    }
}

fn strongest(neighbours: impl Iterator<Item = (usize, f32)>) -> Option<usize> {
    let mut best = (None, 0.0);
    for (j, s) in neighbours {
        if s > best.1 {
            best = (Some(j), s);
        }
    }
    best.0
}

fn square<const B: usize>(m: &[[f64; B]; B]) -> f64 {
    m.iter().flatten().map(|v| v * v).sum()
}
