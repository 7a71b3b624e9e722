//! Continua of dimension two and more: vertices, directions, a point inside, and no faces of others; and what
//! lists begin with.

use semismooth::complementarity::Lcp;
use semismooth::enumeration::{Continuum, EnumerationOptions, SolutionSet, all_solutions};
use semismooth::sparse::Matrix;

use super::list;
use crate::random::Random;

const INFINITE: f64 = f64::INFINITY;

fn zeros(n: usize) -> Matrix {
    Matrix::from_triplets(n, n, &[]).unwrap()
}

fn sorted(points: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut points = points.to_vec();
    points.sort_by(|a, b| a.partial_cmp(b).unwrap());
    points
}

/// The only continuum of a list.
fn only(set: &SolutionSet) -> &Continuum {
    assert!(set.completeness.is_complete(), "{set}");
    let [continuum] = set.continua.as_slice() else {
        panic!("{set:?}");
    };
    continuum
}

/// Where F = 0 everywhere the solutions are the box: its corners are vertices, each infinite bound is a
/// direction, and its faces and corners are no continua of their own.
#[test]
fn boxes_are_described_by_their_corners_and_directions() {
    for kinds in [
        &[2_usize][..],
        &[0],
        &[3],
        &[2, 2],
        &[0, 2],
        &[0, 0],
        &[1, 0],
        &[3, 2],
        &[3, 3],
        &[2, 0, 1, 2],
        &[3, 2, 0],
    ] {
        let n = kinds.len();
        let low = |kind: usize| if kind % 2 == 1 { -INFINITE } else { -1.0 };
        let high = |kind: usize| if kind == 0 || kind == 3 { INFINITE } else { 2.0 };
        let (lower, upper) = (
            kinds.iter().map(|k| low(*k)).collect(),
            kinds.iter().map(|k| high(*k)).collect(),
        );
        let lcp = Lcp::boxed(zeros(n), vec![0.0; n], lower, upper).unwrap();
        let set = list(lcp.mcp(), 0.0);
        let found = only(&set);
        assert!(found.described && found.dimension == n, "{kinds:?}: {found:?}");
        // Corners of the components that have any: the others are the same in all of them.
        let bounded: Vec<usize> = (0..n).filter(|&i| kinds[i] != 3).collect();
        let ends = found
            .ends
            .iter()
            .map(|e| bounded.iter().map(|&i| e[i]).collect::<Vec<f64>>());
        let mut corners = vec![Vec::new()];
        for &i in &bounded {
            let each = [low(kinds[i]), high(kinds[i])]
                .into_iter()
                .filter(|v| v.is_finite());
            let longer = |v: f64| corners.iter().map(move |c: &Vec<f64>| [&c[..], &[v]].concat());
            corners = each.flat_map(longer).collect();
        }
        if n > 1 || !bounded.is_empty() {
            assert_eq!(sorted(&ends.collect::<Vec<_>>()), sorted(&corners), "{kinds:?}");
        }
        let axis = |i: usize, sign: f64| {
            (0..n)
                .map(|j| if j == i { sign } else { 0.0 })
                .collect::<Vec<f64>>()
        };
        let mut ways = Vec::new();
        for (i, &kind) in kinds.iter().enumerate() {
            ways.extend((kind % 2 == 1).then(|| axis(i, -1.0)));
            ways.extend((kind == 0 || kind == 3).then(|| axis(i, 1.0)));
        }
        assert_eq!(sorted(&found.directions), sorted(&ways), "{kinds:?}");
        let inside = |(i, x): (usize, &f64)| *x > low(kinds[i]) && *x < high(kinds[i]);
        assert!(
            found.point.iter().enumerate().all(inside),
            "{kinds:?}: {:?}",
            found.point
        );
        // Corners that are listed as points, since regular selections have them, are marked.
        assert!(
            set.solutions
                .iter()
                .all(|s| s.continuum == Some(0) && s.index.is_none()),
            "{set:?}"
        );
    }
}

/// Positive semidefinite M of rank r < n, and q such that a point z is a solution.
fn monotone(random: &mut Random, n: usize, rank: usize) -> Lcp {
    let factor: Vec<Vec<f64>> = (0..rank)
        .map(|_| (0..n).map(|_| random.below(5) as f64 - 2.0).collect())
        .collect();
    let gram = |i: usize, j: usize| factor.iter().map(|f| f[i] * f[j]).sum::<f64>();
    let mut rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| gram(i, j)).collect()).collect();
    for i in 0..n {
        for j in i + 1..n {
            let skew = random.below(3) as f64 - 1.0;
            rows[i][j] += skew;
            rows[j][i] -= skew;
        }
    }
    let z: Vec<f64> = (0..n).map(|_| random.below(3) as f64).collect();
    let w: Vec<f64> = z
        .iter()
        .map(|z| if *z > 0.0 { 0.0 } else { random.below(2) as f64 })
        .collect();
    let q = (0..n).map(|i| w[i] - (0..n).map(|j| rows[i][j] * z[j]).sum::<f64>());
    Lcp::new(Matrix::from_rows(&rows).unwrap(), q.collect()).unwrap()
}

/// The rank of some vectors of small numbers, by elimination with pivots.
fn rank(mut vectors: Vec<Vec<f64>>) -> usize {
    let mut found = 0;
    let width = vectors.first().map_or(0, Vec::len);
    for column in 0..width {
        let size = |v: &[f64]| v[column].abs();
        let Some(pivot) =
            (found..vectors.len()).max_by(|a, b| size(&vectors[*a]).total_cmp(&size(&vectors[*b])))
        else {
            break;
        };
        if size(&vectors[pivot]) < 1e-9 {
            continue;
        }
        vectors.swap(found, pivot);
        let (above, below) = vectors.split_at_mut(found + 1);
        for row in below {
            let factor = row[column] / above[found][column];
            row.iter_mut()
                .zip(&above[found])
                .for_each(|(a, b)| *a -= factor * b);
        }
        found += 1;
    }
    found
}

fn residual(lcp: &Lcp, x: &[f64]) -> f64 {
    lcp.natural_residual(x, &mut vec![0.0; x.len()]).unwrap()
}

/// The solutions of a monotone problem form one polyhedron: a point, or one continuum. Its points, combined
/// of ends and directions at random, are solutions, none lies beyond a bound, and they span its dimension.
#[test]
fn monotone_problems_have_one_polyhedron() {
    let (mut random, mut large) = (Random::new(2), 0);
    for k in 0..120 {
        let n = 2 + random.below(5);
        let rank_of = random.below(n.min(3));
        let lcp = monotone(&mut random, n, rank_of);
        let set = list(lcp.mcp(), 0.0);
        assert!(set.completeness.is_complete(), "{k}: {set}");
        for s in &set.solutions {
            assert!(s.x.iter().all(|v| *v >= 0.0), "{k}: {:?}", s.x);
        }
        if set.continua.is_empty() {
            assert_eq!(set.solutions.len(), 1, "{k}: {set:?}");
            continue;
        }
        let found = only(&set);
        assert!(
            set.solutions.iter().all(|s| s.continuum == Some(0)),
            "{k}: {set:?}"
        );
        assert!(found.described && !found.ends.is_empty(), "{k}: {found:?}");
        large += usize::from(found.dimension > 1);
        let size = found.ends.iter().flatten().fold(1.0_f64, |m, v| m.max(v.abs()));
        for _ in 0..10 {
            let shares: Vec<f64> = found.ends.iter().map(|_| random.unit()).collect();
            let sum: f64 = shares.iter().sum();
            let mut x = vec![0.0; n];
            for (end, share) in found.ends.iter().zip(&shares) {
                x.iter_mut().zip(end).for_each(|(x, e)| *x += share / sum * e);
            }
            for direction in &found.directions {
                let step = 3.0 * random.unit();
                x.iter_mut().zip(direction).for_each(|(x, d)| *x += step * d);
            }
            assert!(
                residual(&lcp, &x) <= 1e-11 * size * n as f64,
                "{k}: {x:?} {found:?}"
            );
        }
        let points = found.ends.iter().chain([&found.point]);
        assert!(points.flatten().all(|v| *v >= 0.0), "{k}: {found:?}");
        assert!(
            residual(&lcp, &found.point) <= 1e-11 * size * n as f64,
            "{k}: {found:?}"
        );
        let first = &found.ends[0];
        let apart = found
            .ends
            .iter()
            .map(|e| e.iter().zip(first).map(|(a, b)| a - b).collect());
        let spanned = rank(apart.chain(found.directions.iter().cloned()).collect());
        assert_eq!(spanned, found.dimension, "{k}: {found:?}");
    }
    assert!(large > 5, "{large}");
}

/// Continua of problems that are not monotone: none is a face of another, no point is listed twice, and all
/// points lie within the bounds.
#[test]
fn lists_of_degenerate_problems_hold_nothing_twice() {
    let mut random = Random::new(7);
    for k in 0..150 {
        let n = 2 + random.below(4);
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|_| (0..n).map(|_| random.below(3) as f64 - 1.0).collect())
            .collect();
        let q = (0..n).map(|_| random.below(3) as f64 - 1.0).collect();
        let upper = if k % 2 == 0 { INFINITE } else { 1.0 };
        let lcp = Lcp::boxed(Matrix::from_rows(&rows).unwrap(), q, vec![0.0; n], vec![upper; n]).unwrap();
        let set = list(lcp.mcp(), 0.0);
        assert!(set.completeness.is_complete(), "{k}: {set}");
        for (i, s) in set.solutions.iter().enumerate() {
            assert!(
                set.solutions[..i].iter().all(|other| other.x != s.x),
                "{k}: {set:?}"
            );
            assert!(s.x.iter().all(|v| (0.0..=upper).contains(v)), "{k}: {:?}", s.x);
        }
        for (i, c) in set.continua.iter().enumerate() {
            assert!(c.described && residual(&lcp, &c.point) <= 1e-12, "{k}: {c:?}");
            for (j, other) in set.continua.iter().enumerate().filter(|o| o.0 != i) {
                // Ends and directions of a face are among those of the whole.
                let among = |own: &[Vec<f64>], others: &[Vec<f64>]| own.iter().all(|p| others.contains(p));
                let face = among(&c.ends, &other.ends) && among(&c.directions, &other.directions);
                assert!(!face, "{k}: {i} of {j} in {set:?}");
            }
        }
    }
}

/// min cᵀx, A x ≥ b, x ≥ 0, its multipliers free of sign where rows are equations: rounded points keep to the
/// bounds.
#[test]
fn no_point_lies_beyond_a_bound() {
    let (mut random, mut listed) = (Random::new(14), 0);
    for k in 0..60 {
        let (rows, n) = (1 + random.below(3), 3 + random.below(3));
        let mut entries = Vec::new();
        for i in 0..rows {
            for j in 0..n {
                let a = random.unit();
                entries.extend([(n + i, j, a), (j, n + i, -a)]);
            }
        }
        let free = if k % 2 == 0 { -INFINITE } else { 0.0 };
        let lower = [vec![0.0; n], vec![free; rows]].concat();
        let q = [vec![1.0; n], vec![-1.0; rows]].concat();
        let matrix = Matrix::from_triplets(n + rows, n + rows, &entries).unwrap();
        let lcp = Lcp::boxed(matrix, q, lower.clone(), vec![INFINITE; n + rows]).unwrap();
        let set = list(lcp.mcp(), 0.0);
        assert!(set.completeness.is_complete(), "{k}: {set}");
        listed += set.solutions.len() + set.continua.len();
        let ends = set.continua.iter().flat_map(|c| c.ends.iter().chain([&c.point]));
        for x in set.solutions.iter().map(|s| &s.x).chain(ends) {
            assert!(x.iter().zip(&lower).all(|(x, l)| x >= l), "{k}: {x:?}");
        }
    }
    assert!(listed > 40, "{listed}");
}

/// Stocks qᵢ at prices λᵢ = 50 − qᵢ/10 that the next must not exceed by more than a part: a large continuum,
/// which a search of few nodes does not reach. The list begins with one of its points.
#[test]
fn lists_that_end_at_a_limit_begin_with_a_solution() {
    for periods in [2, 5, 10, 20] {
        let n = 3 * periods;
        let mut entries = Vec::new();
        let mut q = vec![0.0; n];
        for i in 0..periods {
            let (stock, price, rest) = (i, periods + i, 2 * periods + i);
            entries.extend([(stock, price, 1.0), (stock, stock, 0.1)]);
            q[stock] = -50.0;
            entries.extend([(price, rest, -1.0), (price, stock, -1.0)]);
            entries.push((rest, price, 1.05));
            match i {
                0 => q[price] = 0.5,
                _ => entries.push((price, rest - 1, 1.0)),
            }
            match i + 1 < periods {
                true => entries.push((rest, price + 1, -1.0)),
                false => q[rest] = -52.5,
            }
        }
        let lcp = Lcp::new(Matrix::from_triplets(n, n, &entries).unwrap(), q).unwrap();
        for nodes in [1, 10, 1000] {
            let options = EnumerationOptions::default().with_max_nodes(nodes);
            let set = all_solutions(lcp.mcp(), 0.0, &options).unwrap();
            let continua = set.continua.iter().map(|c| &c.point);
            let points: Vec<&Vec<f64>> = set.solutions.iter().map(|s| &s.x).chain(continua).collect();
            assert!(!points.is_empty(), "{periods} {nodes}: {set}");
            for x in points {
                assert!(residual(&lcp, x) <= 1e-11, "{periods} {nodes}: {x:?}");
            }
        }
    }
}
