//! Vertices, directions and lines of a polyhedron given by inequalities, in exact arithmetic: the double
//! description method (T. Motzkin, H. Raiffa, G. Thompson, R. Thrall, 1953; adjacency as in K. Fukuda, A.
//! Prodon, 1996).

use crate::tolerances::SELECTIONS;
use num_bigint::BigInt;
use num_traits::{One, Signed, Zero};

/// In homogeneous coordinates (t, y), of which each vector has no common divisor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Generators {
    /// Vertices y/t for t > 0 (points of the least faces, where there are lines), directions y for t = 0.
    pub(super) rays: Vec<Vec<BigInt>>,
    /// Directions whose opposites belong to the polyhedron as well.
    pub(super) lines: Vec<Vec<BigInt>>,
}

#[derive(Debug, Clone)]
struct Ray {
    at: Vec<BigInt>,
    /// Bits of the inequalities, in their order, that hold with equality.
    tight: Vec<u64>,
}

impl Ray {
    fn new(at: Vec<BigInt>, inequalities: usize) -> Self {
        Self {
            at: reduced(at),
            tight: vec![0; inequalities.div_ceil(64)],
        }
    }

    fn touches(&mut self, k: usize) {
        self.tight[k / 64] |= 1 << (k % 64);
    }
}

/// The generators of {y : c + aᵀy ≥ 0 for all rows (c, a)}, which must not be empty; `None` where there are
/// too many. Work is counted in numbers written.
pub(super) fn generators(dimension: usize, rows: &[Vec<BigInt>], work: &mut u64) -> Option<Generators> {
    let unit = |k: usize| -> Vec<BigInt> {
        let entry = |j: usize| if j == k { BigInt::one() } else { BigInt::zero() };
        (0..=dimension).map(entry).collect()
    };
    let later = unit(0);
    let inequalities: Vec<&[BigInt]> = std::iter::once(later.as_slice())
        .chain(rows.iter().map(Vec::as_slice))
        .collect();
    let mut lines: Vec<Vec<BigInt>> = (0..=dimension).map(unit).collect();
    let mut rays: Vec<Ray> = Vec::new();
    for (k, row) in inequalities.iter().enumerate() {
        *work += ((lines.len() + rays.len()) * (dimension + 1)) as u64;
        match lines.iter().position(|l| !dot(row, l).is_zero()) {
            Some(place) => halve(&mut lines, &mut rays, place, (k, row), inequalities.len()),
            None => cut(&mut rays, (k, row), work),
        }
        if rays.len() > SELECTIONS as usize {
            return None;
        }
    }
    let rays = rays.into_iter().map(|r| r.at).collect();
    Some(Generators { rays, lines })
}

/// A line that the k-th inequality cuts becomes a ray; all other generators are moved along it until the
/// inequality holds with equality.
fn halve(
    lines: &mut Vec<Vec<BigInt>>,
    rays: &mut Vec<Ray>,
    place: usize,
    (k, row): (usize, &[BigInt]),
    inequalities: usize,
) {
    let mut line = lines.remove(place);
    let mut rate = dot(row, &line);
    if rate.is_negative() {
        line.iter_mut().for_each(|v| *v = -std::mem::take(v));
        rate = -rate;
    }
    let moved = |at: &[BigInt]| {
        let value = dot(row, at);
        reduced(
            at.iter()
                .zip(&line)
                .map(|(a, l)| a * &rate - l * &value)
                .collect(),
        )
    };
    lines.iter_mut().for_each(|other| *other = moved(other));
    for ray in rays.iter_mut() {
        ray.at = moved(&ray.at);
        ray.touches(k);
    }
    let mut own = Ray::new(line, inequalities);
    (0..k).for_each(|earlier| own.touches(earlier));
    rays.push(own);
}

/// Rays beyond the k-th inequality are replaced by those on it between adjacent rays on either side.
fn cut(rays: &mut Vec<Ray>, (k, row): (usize, &[BigInt]), work: &mut u64) {
    let values: Vec<BigInt> = rays.iter().map(|r| dot(row, &r.at)).collect();
    let mut between = Vec::new();
    for (p, inside) in values.iter().enumerate().filter(|v| v.1.is_positive()) {
        for (n, outside) in values.iter().enumerate().filter(|v| v.1.is_negative()) {
            let (a, b) = (&rays[p], &rays[n]);
            let common: Vec<u64> = a.tight.iter().zip(&b.tight).map(|(a, b)| a & b).collect();
            let holds_all = |r: &Ray| r.tight.iter().zip(&common).all(|(r, c)| r & c == *c);
            *work += 1;
            let adjacent = (0..rays.len()).all(|other| other == p || other == n || !holds_all(&rays[other]));
            if adjacent {
                let at = a.at.iter().zip(&b.at).map(|(a, b)| b * inside - a * outside);
                let at = reduced(at.collect());
                let mut ray = Ray { at, tight: common };
                ray.touches(k);
                between.push(ray);
            }
        }
    }
    let mut kept = values.iter();
    rays.retain(|_| kept.next().is_some_and(|v| !v.is_negative()));
    let zero = values.iter().filter(|v| !v.is_negative()).map(Zero::is_zero);
    let on: Vec<bool> = zero.collect();
    rays.iter_mut()
        .zip(on)
        .filter(|r| r.1)
        .for_each(|(ray, _)| ray.touches(k));
    rays.append(&mut between);
}

fn dot(a: &[BigInt], b: &[BigInt]) -> BigInt {
    let terms = a.iter().zip(b).filter(|(a, b)| !a.is_zero() && !b.is_zero());
    terms.map(|(a, b)| a * b).sum()
}

/// Without common divisor.
fn reduced(mut at: Vec<BigInt>) -> Vec<BigInt> {
    let divisor = at.iter().fold(BigInt::zero(), |mut a, v| {
        // Euclid's algorithm; the numbers are short.
        let mut b = v.abs();
        while !b.is_zero() {
            let rest = &a % &b;
            a = std::mem::replace(&mut b, rest);
        }
        a
    });
    if !divisor.is_zero() && !divisor.is_one() {
        at.iter_mut().for_each(|v| *v = &*v / &divisor);
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spread::Random;

    fn of(dimension: usize, rows: &[&[i64]]) -> (Vec<Vec<i64>>, usize) {
        let rows: Vec<Vec<BigInt>> = rows
            .iter()
            .map(|r| r.iter().map(|v| BigInt::from(*v)).collect())
            .collect();
        let found = generators(dimension, &rows, &mut 0).unwrap();
        let number = |v: &BigInt| i64::try_from(v).unwrap();
        let mut rays: Vec<Vec<i64>> = found
            .rays
            .iter()
            .map(|r| r.iter().map(number).collect())
            .collect();
        rays.sort();
        (rays, found.lines.len())
    }

    #[test]
    fn vertices_directions_and_lines_of_known_polyhedra() {
        // The unit square, one inequality of it twice, and one that touches it in a vertex.
        let square: [&[i64]; 6] = [
            &[0, 1, 0],
            &[0, 0, 1],
            &[1, -1, 0],
            &[1, 0, -1],
            &[2, -2, 0],
            &[2, -1, -1],
        ];
        let corners = vec![vec![1, 0, 0], vec![1, 0, 1], vec![1, 1, 0], vec![1, 1, 1]];
        assert_eq!(of(2, &square), (corners, 0));
        // x ≥ 0, x + y ≥ ½: one vertex, two directions.
        let wedge = of(2, &[&[0, 1, 0], &[-1, 2, 2]]);
        assert_eq!(wedge, (vec![vec![0, 0, 1], vec![0, 1, -1], vec![2, 0, 1]], 0));
        // A strip 0 ≤ y ≤ 3 in space has two lines.
        let (rays, lines) = of(3, &[&[0, 0, 1, 0], &[3, 0, -1, 0]]);
        assert_eq!((rays.len(), lines), (2, 2));
        assert_eq!(of(2, &[]), (vec![vec![1, 0, 0]], 2));
    }

    /// The cube has 2ᵈ vertices, its dual, the cross-polytope, 2 d.
    #[test]
    fn cubes_and_their_duals_have_the_right_number_of_vertices() {
        for d in 1..=5 {
            let mut cube = Vec::new();
            for k in 0..d {
                for sign in [1, -1] {
                    let mut row = vec![0; d + 1];
                    (row[0], row[1 + k]) = (1, sign);
                    cube.push(row);
                }
            }
            let rows: Vec<&[i64]> = cube.iter().map(Vec::as_slice).collect();
            assert_eq!(of(d, &rows).0.len(), 1 << d);
            let dual: Vec<Vec<i64>> = (0..1_usize << d)
                .map(|bits| {
                    let sign = |k: usize| if bits >> k & 1 == 1 { 1 } else { -1 };
                    std::iter::once(1).chain((0..d).map(sign)).collect()
                })
                .collect();
            let rows: Vec<&[i64]> = dual.iter().map(Vec::as_slice).collect();
            assert_eq!(of(d, &rows).0.len(), 2 * d);
        }
    }

    /// Each generator satisfies all inequalities and has as many independent equalities as a vertex or an
    /// extreme direction has; and the vertices of a bounded polygon are those at which two of its lines meet.
    #[test]
    fn vertices_of_random_polygons_are_those_of_pairs_of_lines() {
        let mut random = Random::new(4);
        for _ in 0..100 {
            let mut rows: Vec<Vec<i64>> = vec![vec![9, 1, 0], vec![9, -1, 0], vec![9, 0, 1], vec![9, 0, -1]];
            for _ in 0..random.below(6) {
                let mut entry = |n: f64| (n * random.symmetric()).round() as i64;
                // 0 is inside.
                rows.push(vec![5 + entry(4.0), entry(3.0), entry(3.0)]);
            }
            let mut pairs: Vec<Vec<i64>> = Vec::new();
            for a in &rows {
                for b in &rows {
                    let det = a[1] * b[2] - a[2] * b[1];
                    if det <= 0 {
                        continue;
                    }
                    let at = [det, a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
                    let inside = rows
                        .iter()
                        .all(|r| r.iter().zip(&at).map(|(r, x)| r * x).sum::<i64>() >= 0);
                    if inside {
                        let at: Vec<BigInt> = at.iter().map(|v| BigInt::from(*v)).collect();
                        pairs.push(reduced(at).iter().map(|v| i64::try_from(v).unwrap()).collect());
                    }
                }
            }
            pairs.sort();
            pairs.dedup();
            let slices: Vec<&[i64]> = rows.iter().map(Vec::as_slice).collect();
            assert_eq!(of(2, &slices), (pairs, 0), "{rows:?}");
        }
    }
}
