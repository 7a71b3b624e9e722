//! Directional problems that are linear complementarity problems with a positive definite matrix: their solution is unique.
//!
//! Where each open site has two pieces, on one of which a form p ≥ 0 vanishes and on the other a form w ≥ 0, and where the forms p determine
//! all others, w = M p + q: a linear complementarity problem. With D M positive definite for some positive diagonal matrix D it has exactly one
//! solution for every q (Cottle, Pang, Stone 1992, theorem 3.1.6 for the rows of D w), for q = 0 this is 0, and principal pivots lead to it
//! (Murty 1974). Bodies in contact with a moderate coefficient of friction give such problems at nodes that slipped before: a search would
//! try thousands of pieces.

use nalgebra::{Cholesky, DMatrix};

use super::search::SelectionSearch;
use super::system::System;
use super::table::{Place, Sign, Table};
use crate::tolerances::HALF_DIGITS;

/// Largest number of sites at which both forms vanish, so that either piece may be chosen: 2 to this number of selections.
const MAX_TIES: usize = 10;

/// A linear complementarity problem for the forms of the open sites.
pub(super) struct Complementary<'a> {
    system: &'a System,
    root: Table,
    /// For each site the variables that vanish on its two pieces.
    pairs: Vec<[usize; 2]>,
}

impl<'a> Complementary<'a> {
    /// The problem at a root, where it is one with a positive definite matrix.
    pub(super) fn new(system: &'a System, search: &SelectionSearch<'_>, root: &Table) -> Option<Self> {
        let mut wanted = vec![false; root.variables()];
        let mut pairs = Vec::with_capacity(system.sites.len());
        for (s, site) in system.sites.iter().enumerate() {
            let [first, second] = site.pieces.as_slice() else {
                return None;
            };
            let vanishing = |equalities: &[usize]| {
                let all = equalities.iter().map(|&f| search.variable(s, f));
                let mut left = all.filter(|&v| root.place(v) != Place::Gone);
                let one = left.next().filter(|&v| root.sign(v) != Sign::Free)?;
                left.next().is_none().then_some(one)
            };
            let pair = [vanishing(&first.equalities)?, vanishing(&second.equalities)?];
            wanted[pair[0]] = true;
            pairs.push(pair);
        }
        let root = root.with_columns(&wanted)?;
        let problem = Self { system, root, pairs };
        problem.is_definite().then_some(problem)
    }

    /// Whether D M is positive definite, beyond rounding, for the D that makes it as nearly symmetric as possible.
    fn is_definite(&self) -> bool {
        let k = self.pairs.len();
        let mut matrix = DMatrix::zeros(k, k);
        let mut errors = Vec::with_capacity(k);
        for (i, &[_, w]) in self.pairs.iter().enumerate() {
            let Some(form) = self.root.form(w) else {
                return false;
            };
            errors.push(form.error);
            for (j, &[p, _]) in self.pairs.iter().enumerate() {
                let Place::Column(c) = self.root.place(p) else {
                    return false;
                };
                matrix[(i, j)] = self.sign(w) * form.coefficients[c] * self.sign(p);
            }
        }
        let factors = symmetrizing(&matrix);
        for (mut row, factor) in matrix.row_iter_mut().zip(&factors) {
            row *= *factor;
        }
        let sizes = matrix.diagonal();
        if !sizes.iter().all(|d| d.is_finite() && *d > 0.0) {
            return false;
        }
        // The symmetric part, with unit diagonal, minus a bound of its errors.
        let rows = errors.iter().zip(&factors).zip(&sizes);
        let rows: f64 = rows.map(|((e, f), size)| (e * f).powi(2) / size).sum();
        let columns: f64 = sizes.iter().map(|size| 1.0 / size).sum();
        let margin = (rows * columns).sqrt().max(HALF_DIGITS);
        let scaled = DMatrix::from_fn(k, k, |i, j| {
            let mean = (matrix[(i, j)] + matrix[(j, i)]) / (2.0 * (sizes[i] * sizes[j]).sqrt());
            mean - if i == j { margin } else { 0.0 }
        });
        Cholesky::new(scaled).is_some()
    }

    fn sign(&self, var: usize) -> f64 {
        self.root.sign(var).factor()
    }

    /// The pieces of all sites at the solution, both pieces of a site where either may be chosen, and the number of exchanges. `None`
    /// where rounding hides the solution, or where it satisfies the equalities of pieces but not their facets.
    pub(super) fn solve(&self, search: &SelectionSearch<'_>) -> Option<(Vec<Vec<usize>>, u64)> {
        let mut table = self.root.compact();
        let most = 20 * self.pairs.len() + 20;
        for step in 0.. {
            // The most violated sign first, then the least index, which terminates.
            let violated = (self.pairs.iter()).filter_map(|pair| {
                let &basic = pair.iter().find(|v| matches!(table.place(**v), Place::Row(_)))?;
                let value = self.sign(basic) * table.value(basic);
                (value < -table.doubt(basic)).then_some((value, pair))
            });
            let chosen = if step < self.pairs.len() * 2 {
                violated.min_by(|a, b| a.0.total_cmp(&b.0))
            } else {
                violated.into_iter().next()
            };
            let Some((_, &[p, w])) = chosen else { break };
            if step == most || !table.exchange_variables(p, w) {
                return None;
            }
        }
        let table = table.reinverted(&self.root)?;
        let mut pieces = Vec::with_capacity(self.pairs.len());
        for (s, pair) in self.pairs.iter().enumerate() {
            let vanishes = |&&k: &&usize| table.value(pair[k]).abs() <= table.doubt(pair[k]);
            let of_site: Vec<usize> = [0, 1].iter().filter(vanishes).copied().collect();
            let inside = |k: &usize| {
                let mut facets = self.system.sites[s].pieces[*k].facets.iter();
                facets.all(|&(f, sign)| {
                    let var = search.variable(s, f);
                    sign * table.value(var) >= -table.doubt(var)
                })
            };
            let wrong = |v: usize| self.sign(v) * table.value(v) < -table.doubt(v);
            if of_site.is_empty() || !of_site.iter().all(inside) || pair.iter().any(|&v| wrong(v)) {
                return None;
            }
            pieces.push(of_site);
        }
        let ties = pieces.iter().filter(|p| p.len() > 1).count();
        (ties <= MAX_TIES).then_some((pieces, table.pivots))
    }
}

/// Powers of two d with dᵢ Mᵢⱼ near dⱼ Mⱼᵢ, along the largest entries that reach all rows.
fn symmetrizing(matrix: &DMatrix<f64>) -> Vec<f64> {
    let k = matrix.nrows();
    let mut factors = vec![0.0; k];
    let mut strength = vec![0.0f64; k];
    let mut through: Vec<Option<usize>> = vec![None; k];
    for _ in 0..k {
        let open = (0..k).filter(|&i| factors[i] == 0.0);
        let Some(next) = open.max_by(|&a, &b| strength[a].total_cmp(&strength[b])) else {
            break;
        };
        factors[next] = through[next].map_or(1.0, |i| {
            let ratio = factors[i] * (matrix[(i, next)] / matrix[(next, i)]).abs();
            ratio.log2().round().clamp(-500.0, 500.0).exp2()
        });
        for j in 0..k {
            let diagonal = (matrix[(j, j)] * matrix[(next, next)]).abs();
            let product = (matrix[(j, next)] * matrix[(next, j)]).abs() / diagonal;
            if product > strength[j] {
                (strength[j], through[j]) = (product, Some(next));
            }
        }
    }
    factors
}

#[cfg(test)]
mod tests {
    use super::super::arms::{directional_selections, level_selections, rate};
    use super::super::search::SelectionSearch;
    use super::super::{EnumerationError, EnumerationOptions, all_arms, system};
    use crate::clock::Deadline;
    use crate::complementarity::pivoting::Lemke;
    use crate::complementarity::{AffineFunction, Lcp, Mcp};
    use crate::piecewise::{Selection, active_set};
    use crate::sparse::Matrix;
    use crate::spread::Random;

    /// A definite matrix times a number plus a skew one, with individual units for each row and column, and a vector.
    fn problem(random: &mut Random, k: usize, definite: f64) -> (Vec<Vec<f64>>, Vec<f64>) {
        let mut draw = || -> Vec<Vec<f64>> {
            let row = |_| (0..k).map(|_| random.symmetric()).collect();
            (0..k).map(row).collect()
        };
        let (b, s) = (draw(), draw());
        let mut unit = || 4.0f64.powf((5.0 * random.symmetric()).round());
        let units: Vec<[f64; 2]> = (0..k).map(|_| [unit(), unit()]).collect();
        let entry = |i: usize, j: usize| {
            let square: f64 = b.iter().map(|row| row[i] * row[j]).sum();
            let diagonal = if i == j { 0.3 } else { 0.0 };
            let m = definite * (square / k as f64 + diagonal) + 0.2 * (s[i][j] - s[j][i]) / k as f64;
            units[i][0] * m * units[j][1]
        };
        let m = (0..k).map(|i| (0..k).map(|j| entry(i, j)).collect()).collect();
        let q = units.iter().map(|u| u[0] * random.symmetric()).collect();
        (m, q)
    }

    /// 0 ≤ y ⟂ M y + q α ≥ 0: at the origin all sites are degenerate.
    fn with_parameter(m: &[Vec<f64>], q: &[f64]) -> Mcp<AffineFunction> {
        let k = q.len();
        let rows: Vec<Vec<f64>> = (m.iter().zip(q))
            .map(|(row, q)| [row.as_slice(), &[*q]].concat())
            .collect();
        let f = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), vec![0.0; k]).unwrap();
        Mcp::new(f, vec![0.0; k], vec![f64::INFINITY; k]).unwrap()
    }

    fn searched(map: &Mcp<AffineFunction>, k: usize) -> (Vec<Selection>, u64) {
        let (x, forever) = (vec![0.0; k + 1], Deadline::after(None));
        let active = active_set(map, &x, 1e-12);
        let found = directional_selections(map, &x, &active, 100_000, forever);
        let found = found.unwrap().unwrap();
        assert!(found.complete);
        let level = level_selections(map, &x, &active, 100_000, forever);
        let level = level.unwrap().unwrap();
        assert!(level.complete);
        let mut all = [found.selections, level.selections].concat();
        all.sort_unstable();
        all.dedup();
        (all, found.nodes.max(level.nodes))
    }

    /// The selection of the direction with a given α̇, by Lemke's method.
    fn at_rate(map: &Mcp<AffineFunction>, m: &[Vec<f64>], q: &[f64], rate: f64) -> Selection {
        let lcp = Lcp::new(
            Matrix::from_rows(m).unwrap(),
            q.iter().map(|q| rate * q).collect(),
        )
        .unwrap();
        let mut point = vec![0.0; q.len()];
        Lemke::default().solve(&lcp, &mut point).unwrap();
        point.push(rate);
        active_set(map, &point, 1e-12).first().clone()
    }

    /// Of 2⁴⁰ selections two have directions: those that Lemke's method finds for α̇ = ±1.
    #[test]
    fn definite_problems_are_solved() {
        let (mut random, k) = (Random::new(5), 40);
        for _ in 0..20 {
            let (m, q) = problem(&mut random, k, 1.0);
            let map = with_parameter(&m, &q);
            let mut wanted: Vec<Selection> = [1.0, -1.0].map(|sign| at_rate(&map, &m, &q, sign)).to_vec();
            wanted.sort_unstable();
            let (found, nodes) = searched(&map, k);
            assert_eq!(found, wanted);
            assert!(nodes <= 1000, "{nodes} nodes");
        }
    }

    /// The search itself finds the only direction with α̇ = 1, of 2¹⁴ selections, in few nodes, whatever the units: tables are recomputed
    /// before rounding hides contradictions or produces false ones.
    #[test]
    fn a_search_in_any_units_finds_the_same() {
        let (mut random, k) = (Random::new(5), 14);
        for case in 0..40 {
            let (m, q) = problem(&mut random, k, 1.0);
            let map = with_parameter(&m, &q);
            let active = active_set(&map, &vec![0.0; k + 1], 1e-12);
            let system = system::directional(&map, &vec![0.0; k + 1], &active, Deadline::after(None));
            let system = system.unwrap().unwrap();
            let mut search = SelectionSearch::new(&system, None, 100_000, Deadline::after(None));
            let root = search.root(&[rate(&system, k + 1, -1.0)]).unwrap();
            let mut leaves = Vec::new();
            let run = search.run(root, &mut |pieces: &[usize]| {
                leaves.push(pieces.to_vec());
                Ok::<_, EnumerationError>(None)
            });
            assert!(
                run.is_ok() && !search.stopped && leaves.len() <= 20,
                "case {case}: {}",
                leaves.len()
            );
            let wanted: Vec<usize> = at_rate(&map, &m, &q, 1.0).pieces().collect();
            assert!(leaves.contains(&wanted), "case {case}");
        }
    }

    /// Indefinite problems may have no direction or several: all that exact arithmetic proves are found.
    #[test]
    fn no_direction_of_others_is_lost() {
        let (mut random, k) = (Random::new(7), 5);
        let mut several = 0;
        for case in 0..60 {
            let (m, q) = problem(&mut random, k, [1.0, 0.03, -1.0][case % 3]);
            let q = if case % 3 == 2 {
                q.iter().map(|q| q.abs()).collect()
            } else {
                q
            };
            let map = with_parameter(&m, &q);
            let proven = all_arms(&map, &vec![0.0; k + 1], &EnumerationOptions::default()).unwrap();
            assert!(proven.completeness.is_complete());
            let mut wanted: Vec<Selection> = proven.arms.iter().flat_map(|a| a.selections.clone()).collect();
            several += usize::from(proven.arms.len() > 2);
            wanted.sort_unstable();
            wanted.dedup();
            let found = searched(&map, k).0;
            assert!(
                wanted.iter().all(|w| found.contains(w)),
                "case {case}: {found:?}, {wanted:?}"
            );
            assert!(
                case % 3 > 0 || found == wanted,
                "case {case}: {found:?}, {wanted:?}"
            );
        }
        assert!(several > 10, "{several}");
    }

    /// Where q vanishes in some rows, the direction lies in the cells of both pieces of these sites.
    #[test]
    fn ties_are_listed_with_both_pieces() {
        let m: Vec<Vec<f64>> = (0..6)
            .map(|i| (0..6).map(|j| if i == j { 2.0 } else { 0.0 }).collect())
            .collect();
        let map = with_parameter(&m, &[-1.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(searched(&map, 6).0.len(), 16);
    }

    /// A weighted graph Laplacian: M is singular up to rounding, and all y with equal entries are directions with α̇ = 0.
    #[test]
    fn what_is_definite_by_rounding_alone_is_searched() {
        let (mut random, k) = (Random::new(11), 5);
        for _ in 0..20 {
            let mut m = vec![vec![0.0; k]; k];
            for (i, j) in (0..k).flat_map(|i| (0..i).map(move |j| (i, j))) {
                let weight = 1.1 + random.symmetric();
                (m[i][j], m[j][i]) = (-weight, -weight);
                m[i][i] += weight;
                m[j][j] += weight;
            }
            let map = with_parameter(&m, &[1.0, -0.5, 0.3, 0.2, -1.1]);
            let active = active_set(&map, &vec![0.0; k + 1], 1e-12);
            let level = level_selections(&map, &vec![0.0; k + 1], &active, 10_000, Deadline::after(None));
            let inside = active_set(&map, &[1.0, 1.0, 1.0, 1.0, 1.0, 0.0], 1e-9)
                .first()
                .clone();
            assert!(level.unwrap().unwrap().selections.contains(&inside));
        }
    }
}
