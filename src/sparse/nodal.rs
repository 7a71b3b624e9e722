use std::collections::BTreeMap;

use super::blocks::{Blocks, Symmetric};
use super::{Matrix, Pattern};
use crate::InputError;
use crate::tolerances::{NONE, OWN_SHARE, SAME};

/// A symmetric matrix of displacements, stored in blocks of 2 × 2 (in the plane) or 3 × 3 entries (in space) for each pair of coupled
/// nodes, with the positions of the nodes.
///
/// The lower triangle is stored, which takes a quarter of the memory of a [`Matrix`], about 0.4 kB a displacement for hexahedra; the
/// positions give multigrid the rigid motions. Unknowns are numbered freely; components of nodes that are no unknowns (prescribed ones) are
/// left out.
///
/// ```
/// use semismooth::sparse::{Matrix, NodalMatrix};
/// // Two nodes in the plane; the second one moves along x alone.
/// let a = Matrix::from_rows(&[[3.0, 1.0, -1.0], [1.0, 2.0, 0.0], [-1.0, 0.0, 4.0]])?;
/// let points = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
/// let nodal = NodalMatrix::new(&a, points, &[[0, 0], [0, 1], [1, 0]], 2)?;
/// assert_eq!((nodal.num_nodes(), nodal.num_unknowns()), (2, 3));
/// assert_eq!(nodal.to_matrix()?.get(2, 0), -1.0);
/// # Ok::<(), semismooth::InputError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct NodalMatrix {
    pub(crate) blocks: NodalBlocks,
    points: Vec<[f64; 3]>,
    /// Where each unknown is: the node's number times the dimension, plus the component.
    places: Vec<u32>,
}

/// Blocks of either dimension.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum NodalBlocks {
    Plane(Symmetric<2>),
    Space(Symmetric<3>),
}

impl NodalMatrix {
    /// From a matrix, the positions of the nodes, and the node and component (0, 1 or 2) of each unknown.
    ///
    /// # Errors
    /// [`InputError::Malformed`] for a dimension other than 2 or 3, a matrix that is not square or not symmetric (beyond 1e-10 of its
    /// largest entry), unknowns that do not exist or are named twice, nodes without an unknown, positions that are not
    /// finite; [`InputError::Entry`].
    pub fn new(
        a: &Matrix,
        points: Vec<[f64; 3]>,
        unknowns: &[[usize; 2]],
        dim: usize,
    ) -> Result<Self, InputError> {
        let malformed = |what: String| Err(InputError::Malformed { what });
        let n = unknowns.len();
        if dim != 2 && dim != 3 {
            return malformed(format!("nodal matrices have dimension 2 or 3, not {dim}"));
        }
        if a.nrows() != n || a.ncols() != n {
            let (rows, cols) = (a.nrows(), a.ncols());
            return malformed(format!("a {rows} x {cols} matrix for {n} unknowns"));
        }
        check_nodes(&points, unknowns, dim)?;
        a.check_finite()?;
        if let Some((row, col, difference)) = a.asymmetry(1e-10) {
            return malformed(format!(
                "entries ({row}, {col}) and ({col}, {row}) differ by {difference:e}; the matrix must be symmetric"
            ));
        }
        let places: Vec<u32> = unknowns.iter().map(|[node, c]| (dim * node + c) as u32).collect();
        let blocks = match dim {
            2 => NodalBlocks::Plane(gather(a, &places, points.len())),
            _ => NodalBlocks::Space(gather(a, &places, points.len())),
        };
        Ok(Self::from_parts(blocks, points, places))
    }

    /// Blocks that are symmetric and whose rows and columns at components that are no unknowns are zero.
    pub(crate) fn from_parts(blocks: NodalBlocks, points: Vec<[f64; 3]>, places: Vec<u32>) -> Self {
        Self {
            blocks,
            points,
            places,
        }
    }

    /// 2 or 3.
    #[must_use]
    pub fn dim(&self) -> usize {
        match self.blocks {
            NodalBlocks::Plane(_) => 2,
            NodalBlocks::Space(_) => 3,
        }
    }

    /// Number of nodes.
    #[must_use]
    pub fn num_nodes(&self) -> usize {
        self.points.len()
    }

    /// Number of unknowns.
    #[must_use]
    pub fn num_unknowns(&self) -> usize {
        self.places.len()
    }

    /// Positions of the nodes.
    #[must_use]
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// Number of stored blocks: those of the lower triangle.
    #[must_use]
    pub fn num_blocks(&self) -> usize {
        match &self.blocks {
            NodalBlocks::Plane(a) => a.len(),
            NodalBlocks::Space(a) => a.len(),
        }
    }

    /// The node and component of each unknown.
    pub(crate) fn unknowns(&self) -> Vec<[usize; 2]> {
        let dim = self.dim();
        let place = |p: &u32| [*p as usize / dim, *p as usize % dim];
        self.places.iter().map(place).collect()
    }

    /// Where each unknown is among all components of all nodes.
    pub(crate) fn places(&self) -> &[u32] {
        &self.places
    }

    /// y ← A x over all components of all nodes.
    pub(crate) fn mul(&self, x: &[f64], y: &mut [f64]) {
        match &self.blocks {
            NodalBlocks::Plane(a) => a.mul(x, y),
            NodalBlocks::Space(a) => a.mul(x, y),
        }
    }

    /// The matrix by columns, one an unknown.
    ///
    /// # Errors
    /// None in practice; the pattern is checked again.
    pub fn to_matrix(&self) -> Result<Matrix, InputError> {
        match &self.blocks {
            NodalBlocks::Plane(a) => scatter(a, &self.places),
            NodalBlocks::Space(a) => scatter(a, &self.places),
        }
    }
}

/// Checks positions of nodes, and the node and component of each unknown.
pub(crate) fn check_nodes(
    points: &[[f64; 3]],
    unknowns: &[[usize; 2]],
    dim: usize,
) -> Result<(), InputError> {
    let malformed = |what: String| Err(InputError::Malformed { what });
    if let Some(node) = points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        return malformed(format!("the position of node {node} is not finite"));
    }
    let mut owner = vec![false; dim * points.len()];
    for (k, &[node, component]) in unknowns.iter().enumerate() {
        if node >= points.len() || component >= dim {
            return malformed(format!("unknown {k} is component {component} of node {node}"));
        }
        if std::mem::replace(&mut owner[dim * node + component], true) {
            return malformed(format!("component {component} of node {node} is two unknowns"));
        }
    }
    match owner.chunks_exact(dim).position(|c| !c.contains(&true)) {
        Some(node) => malformed(format!("node {node} has no unknown")),
        None => Ok(()),
    }
}

/// Of each row of contact traces (normal first) the node whose displacements no other row has, with a share of at least [`OWN_SHARE`] in the
/// normal one: the only node of a row, else the one with the largest share. `node_of` gives the node of an unknown.
///
/// An error is a row without such a node, and what it has instead.
pub(crate) fn own_nodes(
    traces: &[&Matrix],
    node_of: impl Fn(usize) -> usize,
    nodes: usize,
) -> Result<Vec<usize>, (usize, &'static str)> {
    const SHARED: usize = usize::MAX - 1;
    // The row of each node, or that there are several.
    let mut row_of = vec![NONE; nodes];
    let mut shares: Vec<BTreeMap<usize, f64>> =
        vec![BTreeMap::new(); traces.first().map_or(0, |t| t.nrows())];
    for (d, trace) in traces.iter().enumerate() {
        for (i, k, v) in trace.triplets().filter(|t| t.2 != 0.0) {
            let node = node_of(k);
            row_of[node] = if [NONE, i].contains(&row_of[node]) {
                i
            } else {
                SHARED
            };
            *shares[i].entry(node).or_default() += if d == 0 { v * v } else { 0.0 };
        }
    }
    let own = |(i, shares): (usize, &BTreeMap<usize, f64>)| {
        let mut best: Option<(usize, f64)> = None;
        for (&node, &share) in shares.iter().filter(|s| row_of[*s.0] == i) {
            // Nodes with equal shares face each other: the first one, on one side as a rule.
            if best.is_none_or(|b| share > b.1 * (1.0 + SAME)) {
                best = Some((node, share));
            }
        }
        match best {
            Some((node, share)) if shares.len() == 1 || share >= OWN_SHARE * OWN_SHARE => Ok(node),
            _ if shares.len() > 1 => Err((i, "the displacements of several nodes")),
            _ if shares.is_empty() => Err((
                i,
                "vectors that are not orthonormal, or of which components are prescribed",
            )),
            _ => Err((i, "the displacements of another contact node")),
        }
    };
    shares.iter().enumerate().map(own).collect()
}

fn gather<const B: usize>(a: &Matrix, places: &[u32], nodes: usize) -> Symmetric<B> {
    let lower = || {
        a.triplets()
            .filter(|(i, j, _)| places[*i] / B as u32 >= places[*j] / B as u32)
    };
    let mut pairs: Vec<(u32, u32)> = lower()
        .map(|(i, j, _)| (places[i] / B as u32, places[j] / B as u32))
        .collect();
    pairs.extend((0..nodes as u32).map(|i| (i, i)));
    pairs.sort_unstable();
    pairs.dedup();
    let mut blocks = Blocks::new(nodes);
    blocks.start = vec![0; nodes + 1];
    for (i, j) in pairs {
        blocks.start[i as usize + 1] += 1;
        blocks.col.push(j);
    }
    for i in 0..nodes {
        blocks.start[i + 1] += blocks.start[i];
    }
    blocks.value = vec![[[0.0; B]; B]; blocks.col.len()];
    for (i, j, v) in lower() {
        let (p, q) = (places[i] as usize, places[j] as usize);
        if let Some(k) = blocks.slot(p / B, q / B) {
            blocks.value[k][p % B][q % B] += v;
        }
    }
    Symmetric::of(blocks)
}

fn scatter<const B: usize>(a: &Symmetric<B>, places: &[u32]) -> Result<Matrix, InputError> {
    let n = places.len();
    let mut unknown = vec![usize::MAX; B * a.nrows()];
    for (k, place) in places.iter().enumerate() {
        unknown[*place as usize] = k;
    }
    // Of both triangles.
    let entries = || {
        (0..a.nrows()).flat_map(|i| {
            let (cols, values) = a.lower().row(i);
            let unknown = &unknown;
            cols.iter().zip(values).flat_map(move |(&j, block)| {
                let stored = (0..B * B).filter_map(move |e| {
                    let (r, c) = (unknown[B * i + e / B], unknown[B * j as usize + e % B]);
                    (r != usize::MAX && c != usize::MAX).then_some((r, c, block[e / B][e % B]))
                });
                let mirrored = i != j as usize;
                stored.flat_map(move |(r, c, v)| [Some((r, c, v)), mirrored.then_some((c, r, v))])
            })
        })
    };
    let entries = || entries().flatten();
    let mut matrix = Matrix::zeros(Pattern::from_entries(n, n, entries().map(|(r, c, _)| (r, c)))?);
    entries().for_each(|(r, c, v)| matrix.add(r, c, v));
    Ok(matrix)
}
