//! The parts of a square system that determine their unknowns together.

use super::Columns;
use crate::linear::{
    AutoSolver, LinearError, LinearSolver, TruncatedMultigrid, WORTH, aggregation_hierarchy,
};
use crate::sparse::{Matrix, max_abs};
use crate::tolerances::NONE;

/// The strongly connected components of the pattern of a square matrix, row i belonging to unknown i.
///
/// Whatever rows are matched with unknowns in place of the diagonal, the parts of a regular matrix are unions of its irreducible blocks.
#[derive(Debug, Clone, Default)]
pub(crate) struct Parts {
    /// The part of each unknown; those left out have none.
    part: Vec<usize>,
    /// The unknowns part by part, and where each part begins.
    order: Vec<usize>,
    starts: Vec<usize>,
    search: Search,
}

/// What the search for parts needs, kept for the next one.
#[derive(Debug, Clone, Default)]
struct Search {
    below: Vec<Vec<usize>>,
    number: Vec<usize>,
    low: Vec<usize>,
    stack: Vec<usize>,
    path: Vec<(usize, usize)>,
}

impl Parts {
    /// Finds the parts of the unknowns that are `open` (R. Tarjan, SIAM J. Comput. 1 (1972)).
    pub(crate) fn find(&mut self, matrix: Columns<'_>, n: usize, open: &dyn Fn(usize) -> bool) {
        self.part.clear();
        self.part.resize(n, NONE);
        self.order.clear();
        self.starts.clear();
        self.starts.push(0);
        let Search {
            below,
            number,
            low,
            stack,
            path,
        } = &mut self.search;
        below.resize_with(n, Vec::new);
        below.iter_mut().for_each(Vec::clear);
        for v in [&mut *number, &mut *low] {
            v.clear();
            v.resize(n, NONE);
        }
        stack.clear();
        path.clear();
        let mut count = 0;
        for (j, below) in below.iter_mut().enumerate().filter(|e| open(e.0)) {
            matrix.each(j, |i, v| {
                if i != j && v != 0.0 && open(i) {
                    below.push(i);
                }
            });
        }
        for root in (0..n).filter(|j| open(*j)) {
            if number[root] != NONE {
                continue;
            }
            path.push((root, 0));
            while let Some((j, next)) = path.pop() {
                if next == 0 {
                    (number[j], low[j]) = (count, count);
                    count += 1;
                    stack.push(j);
                } else {
                    low[j] = low[j].min(low[below[j][next - 1]]);
                }
                let mut at = next;
                let child = loop {
                    let Some(&i) = below[j].get(at) else { break None };
                    at += 1;
                    if number[i] == NONE {
                        break Some(i);
                    }
                    // Only those still on the stack have no part.
                    if self.part[i] == NONE {
                        low[j] = low[j].min(number[i]);
                    }
                };
                if let Some(i) = child {
                    path.push((j, at));
                    path.push((i, 0));
                } else if low[j] == number[j] {
                    let first = stack.iter().rposition(|i| *i == j).unwrap_or(0);
                    let (begin, part) = (self.order.len(), self.starts.len() - 1);
                    self.order.extend(stack.drain(first..));
                    self.order[begin..].sort_unstable();
                    self.order[begin..].iter().for_each(|&i| self.part[i] = part);
                    self.starts.push(self.order.len());
                }
            }
        }
    }

    /// The part of an unknown that is open.
    pub(crate) fn of(&self, i: usize) -> Option<usize> {
        self.part.get(i).copied().filter(|p| *p != NONE)
    }

    pub(crate) fn members(&self, part: usize) -> &[usize] {
        &self.order[self.starts[part]..self.starts[part + 1]]
    }

    pub(crate) fn len(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Whether the rows and columns of a part form a matrix that is regular beyond rounding, in any units.
    pub(crate) fn is_regular(&self, part: usize, matrix: Columns<'_>) -> bool {
        let members = self.members(part);
        if let [j] = *members {
            let mut sum = 0.0;
            matrix.each(j, |i, v| sum += if i == j { v } else { 0.0 });
            return sum != 0.0 && f64::is_finite(sum);
        }
        let mut entries = Vec::new();
        for (c, &j) in members.iter().enumerate() {
            matrix.each(j, |i, v| {
                if self.of(i) == Some(part)
                    && let Ok(r) = members.binary_search(&i)
                {
                    entries.push((r, c, v));
                }
            });
        }
        let k = members.len();
        let Ok(block) = Matrix::from_triplets(k, k, &entries) else {
            return false;
        };
        if is_monotone(&block) {
            return true;
        }
        let mut solver = AutoSolver::new();
        solver.analyze(block.pattern().as_ref()).is_ok()
            && match solver.factor(block.as_ref()) {
                Ok(()) => true,
                // Entries may have been rounded, one unit in the last place a row and a column.
                Err(LinearError::Singular { rcond }) => rcond > 4.0 * f64::EPSILON * k as f64,
                Err(_) => false,
            }
    }
}

/// Whether a large matrix is shown to be a non-singular M matrix, well enough conditioned in the largest norm.
///
/// No entry off its diagonal is positive, and A v ≥ δ > 0 for some v > 0: then ‖A⁻¹‖∞ ≤ ‖v‖∞ / δ (A. Berman, R. J. Plemmons, Nonnegative
/// Matrices in the Mathematical Sciences, 1979, chapter 6, I₂₇). v is a rough solution of A v = 1 by conjugate gradients; whatever it is, it
/// is checked. `false` where that does not succeed, for matrices that are not symmetric among others.
fn is_monotone(a: &Matrix) -> bool {
    /// Iterations of conjugate gradients after which factors are no slower.
    const MOST: usize = 60;
    let n = a.nrows();
    if n < WORTH
        || a.triplets()
            .any(|(i, j, v)| if i == j { v <= 0.0 } else { v > 0.0 })
    {
        return false;
    }
    let rough = || {
        let (prolongations, matrices) = aggregation_hierarchy(a.as_ref())?;
        let mut multigrid = TruncatedMultigrid::new(&matrices, &prolongations)?;
        let (mut ones, mut v) = (vec![1.0; n], vec![0.0; n]);
        // No component of the residual is above a half where its norm √n has fallen by that.
        let rough = 0.5 / (n as f64).sqrt();
        multigrid.solve(&mut ones, &mut v, rough, MOST).map(|_| v)
    };
    let Ok(v) = rough() else { return false };
    let (mut image, mut rows) = (vec![0.0; n], vec![0.0; n]);
    a.as_ref().mul_add(1.0, &v, &mut image);
    a.triplets().for_each(|(i, _, v)| rows[i] += v.abs());
    let least = image.iter().fold(f64::INFINITY, |m, y| m.min(*y));
    // The bound on the condition is that of factors. NaN fails.
    v.iter().all(|v| *v > 0.0) && least > 4.0 * f64::EPSILON * n as f64 * max_abs(&rows) * max_abs(&v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spread::Random;

    /// Against the definition: two unknowns are in one part where each reaches the other.
    #[test]
    fn parts_are_those_of_mutual_reach() {
        let mut random = Random::new(3);
        for case in 0..300 {
            let n = 1 + case % 9;
            let dense = 0.1 + 0.02 * (case % 10) as f64;
            let mut reach = vec![vec![false; n]; n];
            let mut entries = Vec::new();
            let open: Vec<bool> = (0..n).map(|_| random.symmetric() > -0.8).collect();
            for i in 0..n {
                for j in 0..n {
                    if random.symmetric().abs() < dense {
                        entries.push((i, j, 1.0));
                        reach[j][i] = open[i] && open[j];
                    }
                }
                reach[i][i] = true;
            }
            for k in 0..n {
                for i in 0..n {
                    for j in 0..n {
                        reach[i][j] |= reach[i][k] && reach[k][j];
                    }
                }
            }
            let matrix = Matrix::from_triplets(n, n, &entries).unwrap();
            let mut parts = Parts::default();
            parts.find(Columns::Long(matrix.as_ref()), n, &|i| open[i]);
            for i in 0..n {
                assert_eq!(parts.of(i).is_some(), open[i]);
                for j in (0..n).filter(|j| open[i] && open[*j]) {
                    let together = parts.of(i) == parts.of(j);
                    assert_eq!(together, reach[i][j] && reach[j][i], "case {case}: {i} {j}");
                }
            }
        }
    }

    /// Laplace's equation on a square is monotone with one value given at a corner; with none it is singular, which is not overlooked; and a
    /// matrix with a positive entry beside its diagonal, or that is not symmetric, is left to factors.
    #[test]
    fn large_laplacians_are_monotone_where_a_value_is_given() {
        let k = 72;
        let laplacian = |corner: f64, entry: Option<(usize, usize, f64)>| {
            let mut entries = vec![(0, 0, corner)];
            for i in 0..k * k {
                let beside = [(i % k + 1 < k).then_some(i + 1), (i + k < k * k).then_some(i + k)];
                for j in beside.into_iter().flatten() {
                    entries.extend([(i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)]);
                }
            }
            entries.extend(entry);
            Matrix::from_triplets(k * k, k * k, &entries).unwrap()
        };
        assert!(is_monotone(&laplacian(1.0, None)));
        assert!(is_monotone(&laplacian(1e-3, None)));
        assert!(!is_monotone(&laplacian(0.0, None)));
        assert!(!is_monotone(&laplacian(-1e-3, None)));
        assert!(!is_monotone(&laplacian(1.0, Some((0, k * k - 1, 1e-3)))));
        assert!(!is_monotone(&laplacian(0.0, Some((0, k * k - 1, -1.0)))));
    }

    /// Tiny and huge rows are regular, dependent ones are not, nor are those that depend but for rounding.
    #[test]
    fn regularity_does_not_depend_on_units() {
        for (rows, regular) in [
            ([[1e-20, 0.0], [1.0, -1.0]], true),
            ([[1e-20, 2e10], [1e200, 3e190]], true),
            ([[1.0, -1.0], [-1.0, 1.0]], false),
            ([[0.1, 0.3], [0.2, 0.6]], false),
            ([[0.1, 0.1 + 0.2], [1e9, 3e9]], false),
        ] {
            let matrix = Matrix::from_rows(&rows).unwrap();
            let columns = Columns::Long(matrix.as_ref());
            let mut parts = Parts::default();
            parts.find(columns, 2, &|_| true);
            let all = (0..parts.len()).all(|p| parts.is_regular(p, columns));
            assert_eq!(all, regular, "{rows:?}");
        }
    }
}
