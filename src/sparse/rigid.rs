//! Rigid motions, and which of them are not resisted.

use crate::tolerances::RESULT;

/// Translations, then rotations about the axes.
const NAMES: [&str; 6] = [
    "translation along x",
    "translation along y",
    "translation along z",
    "rotation about x",
    "rotation about y",
    "rotation about z",
];

/// Position of a piece of a body, for motions about its centre in units of its size.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Place {
    pub(crate) centre: [f64; 3],
    size: f64,
}

impl Place {
    /// Of the points of each piece; `piece` numbers them.
    pub(crate) fn of(points: &[[f64; 3]], piece: &[usize]) -> Vec<Self> {
        let mut places = vec![Self::default(); piece.iter().max().map_or(0, |m| m + 1)];
        let mut count = vec![0.0; places.len()];
        for (p, &own) in points.iter().zip(piece) {
            count[own] += 1.0;
            (0..3).for_each(|d| places[own].centre[d] += p[d]);
        }
        for (place, n) in places.iter_mut().zip(&count) {
            place.centre = place.centre.map(|x| x / n);
        }
        for (p, &own) in points.iter().zip(piece) {
            let place = &mut places[own];
            let square: f64 = (0..3).map(|d| (p[d] - place.centre[d]).powi(2)).sum();
            place.size = place.size.max(square.sqrt());
        }
        places
    }

    /// The length by which rotations are measured.
    pub(crate) fn size(&self) -> f64 {
        if self.size > 0.0 { self.size } else { 1.0 }
    }

    /// The displacements at x of the motions, by motion.
    pub(crate) fn motions(&self, x: [f64; 3]) -> [[f64; 3]; 6] {
        let x: [f64; 3] = std::array::from_fn(|d| (x[d] - self.centre[d]) / self.size());
        [
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, -x[2], x[1]],
            [x[2], 0.0, -x[0]],
            [-x[1], x[0], 0.0],
        ]
    }
}

/// The Gram matrix of the resisting forces, over the motions.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Resistance([[f64; 6]; 6]);

impl Resistance {
    /// Adds a resistance by its force for each of the motions.
    pub(crate) fn add(&mut self, force: &[f64; 6]) {
        for (row, f) in self.0.iter_mut().zip(force) {
            row.iter_mut().zip(force).for_each(|(g, h)| *g += f * h);
        }
    }

    /// The motions without resistance, beyond those named before them.
    pub(crate) fn free(&self, dim: usize) -> Vec<&'static str> {
        self.free_among(if dim == 2 { &[0, 1, 5] } else { &[0, 1, 2, 3, 4, 5] })
    }

    /// The same among some of the motions.
    pub(crate) fn free_among(&self, wanted: &[usize]) -> Vec<&'static str> {
        let mut g = self.0;
        let scale = wanted.iter().map(|&i| g[i][i]).fold(0.0, f64::max);
        let mut free = Vec::new();
        for (k, &i) in wanted.iter().enumerate() {
            if scale == 0.0 || g[i][i] <= RESULT * scale {
                free.push(NAMES[i]);
                continue;
            }
            for &r in &wanted[k + 1..] {
                let factor = g[r][i] / g[i][i];
                for &c in &wanted[k..] {
                    g[r][c] -= factor * g[i][c];
                }
            }
        }
        free
    }
}

/// Pieces of a graph of `n` nodes: the number of that of each node, counted in the order of their first nodes. `connect` calls its argument
/// with lists of connected nodes.
pub(crate) fn pieces(
    n: usize,
    connect: impl FnOnce(&mut dyn FnMut(&mut dyn Iterator<Item = usize>)),
) -> Vec<usize> {
    fn root(parent: &mut [usize], mut n: usize) -> usize {
        while parent[n] != n {
            parent[n] = parent[parent[n]];
            n = parent[n];
        }
        n
    }
    let mut parent: Vec<usize> = (0..n).collect();
    connect(&mut |nodes| {
        let Some(first) = nodes.next() else {
            return;
        };
        let first = root(&mut parent, first);
        for n in nodes {
            let other = root(&mut parent, n);
            parent[other] = first;
        }
    });
    let mut number = vec![usize::MAX; n];
    let mut count = 0;
    (0..n)
        .map(|n| {
            let r = root(&mut parent, n);
            if number[r] == usize::MAX {
                number[r] = count;
                count += 1;
            }
            number[r]
        })
        .collect()
}
