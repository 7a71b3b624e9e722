//! The directions of an affine piece that stay in its cell: the part of its kernel in a polyhedral cone.

use crate::sparse::{dot, norm};

/// The cone {c : bᵢ·c ≥ 0} in the kernel.
pub(super) enum Cone {
    /// A point, or rays and lines: unit vectors in the kernel.
    Rays(Vec<Vec<f64>>),
    /// At least two dimensions.
    Solid(usize),
    /// Too many facets to be examined.
    Large,
}

/// Most subsets of facets; more are not even begun, as each takes time that grows with the cube of the dimension.
const MOST: usize = 20_000;
/// Components of unit vectors up to this size are rounding errors of kernels computed by orthogonal transformations.
const ROUNDING: f64 = 1e-10;

/// Of the facets, given by their unit normals in coordinates of the kernel (those that vanish there left out).
pub(super) fn cone(dimension: usize, normals: &[Vec<f64>]) -> Cone {
    let lines = complement(dimension, normals);
    if lines.len() >= 2 {
        return Cone::Solid(lines.len());
    }
    let Some(mut rays) = extreme_rays(dimension, lines.len(), normals, &lines) else {
        return Cone::Large;
    };
    let span = dimension - complement(dimension, &rays).len() + lines.len();
    if span > 1 {
        return Cone::Solid(span);
    }
    for line in lines {
        rays.push(line.iter().map(|v| -v).collect());
        rays.push(line);
    }
    Cone::Rays(rays)
}

/// Orthonormal basis of the complement of the span of some vectors.
fn complement(dimension: usize, vectors: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    for v in vectors {
        if let Some(v) = remainder(v, &basis) {
            basis.push(v);
        }
    }
    let known = basis.len();
    for k in 0..dimension {
        let unit: Vec<f64> = (0..dimension).map(|j| f64::from(u8::from(j == k))).collect();
        if basis.len() < dimension
            && let Some(v) = remainder(&unit, &basis)
        {
            basis.push(v);
        }
    }
    basis.split_off(known)
}

/// The unit vector along the part of v outside a span.
fn remainder(v: &[f64], basis: &[Vec<f64>]) -> Option<Vec<f64>> {
    let mut rest = v.to_vec();
    for _ in 0..2 {
        for b in basis {
            let share = dot(&rest, b);
            rest.iter_mut().zip(b).for_each(|(r, b)| *r -= share * b);
        }
    }
    let length = norm(&rest);
    // The second pass of the first loop has removed rounding: what is left is a direction of its own.
    (length > ROUNDING.sqrt() * norm(v)).then(|| rest.iter().map(|r| r / length).collect())
}

/// Rays orthogonal to `lines` on which all but one of the remaining dimensions are fixed by facets.
fn extreme_rays(
    dimension: usize,
    lines: usize,
    normals: &[Vec<f64>],
    known: &[Vec<f64>],
) -> Option<Vec<Vec<f64>>> {
    let pick = dimension - lines - 1;
    let mut rays: Vec<Vec<f64>> = Vec::new();
    let mut chosen: Vec<usize> = (0..pick).collect();
    if pick > normals.len() {
        return Some(rays);
    }
    if combinations(normals.len(), pick).is_none_or(|count| count > MOST) {
        return None;
    }
    loop {
        let mut fixed: Vec<Vec<f64>> = chosen.iter().map(|&k| normals[k].clone()).collect();
        fixed.extend(known.iter().cloned());
        if let [ray] = complement(dimension, &fixed).as_slice() {
            for sign in [1.0, -1.0] {
                let ray: Vec<f64> = ray.iter().map(|v| sign * v).collect();
                let inside = normals.iter().all(|n| dot(n, &ray) >= -ROUNDING);
                if inside && !rays.iter().any(|r| dot(r, &ray) > 1.0 - ROUNDING) {
                    rays.push(ray);
                }
            }
        }
        // The next combination in lexicographic order.
        let Some(k) = (0..pick).rev().find(|&k| chosen[k] < normals.len() - pick + k) else {
            return Some(rays);
        };
        chosen[k] += 1;
        for j in k + 1..pick {
            chosen[j] = chosen[j - 1] + 1;
        }
    }
}

/// The number of ways to choose `pick` of `all`, if it can be counted.
fn combinations(all: usize, pick: usize) -> Option<usize> {
    let pick = pick.min(all.checked_sub(pick)?);
    (0..pick).try_fold(1_usize, |count, k| Some(count.checked_mul(all - k)? / (k + 1)))
}

#[cfg(test)]
mod tests {
    use super::{Cone, combinations, cone};

    fn normals<const N: usize>(list: &[[f64; N]]) -> Vec<Vec<f64>> {
        let unit = |v: &[f64; N]| -> Vec<f64> { v.iter().map(|x| x / crate::sparse::norm(v)).collect() };
        list.iter().map(unit).collect()
    }

    fn rays(found: Cone) -> usize {
        match found {
            Cone::Rays(rays) => rays.len(),
            Cone::Solid(_) | Cone::Large => usize::MAX,
        }
    }

    /// Half-planes in the plane: a wedge, a ray, a line, the origin.
    #[test]
    fn cones_in_the_plane() {
        assert!(matches!(cone(2, &[]), Cone::Solid(2)));
        assert!(matches!(cone(2, &normals(&[[1.0, 0.0]])), Cone::Solid(2)));
        assert!(matches!(
            cone(2, &normals(&[[1.0, 0.0], [-1.0, 1e-3]])),
            Cone::Solid(2)
        ));
        let line = cone(2, &normals(&[[1.0, 2.0], [-1.0, -2.0]]));
        assert_eq!(rays(line), 2);
        let ray = cone(2, &normals(&[[1.0, 2.0], [-1.0, -2.0], [1.0, 0.0]]));
        assert_eq!(rays(ray), 1);
        let origin = cone(2, &normals(&[[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]]));
        assert_eq!(rays(origin), 0);
    }

    /// Pascal's triangle; what would take for ever is not begun.
    #[test]
    fn subsets_are_counted_before_they_are_examined() {
        for n in 1..30 {
            for k in 1..n {
                let above = combinations(n - 1, k - 1).unwrap() + combinations(n - 1, k).unwrap();
                assert_eq!(combinations(n, k).unwrap(), above, "{n} {k}");
            }
        }
        assert_eq!(combinations(200, 100), None);
        let facets: Vec<Vec<f64>> = (0..120_usize)
            .map(|k| {
                (0..60_usize)
                    .map(|j| (((k * 61 + 1) * (j * 7 + 3)) as f64).sin())
                    .collect()
            })
            .collect();
        let unit = |v: &Vec<f64>| v.iter().map(|x| x / crate::sparse::norm(v)).collect();
        let facets: Vec<Vec<f64>> = facets.iter().map(unit).collect();
        assert!(matches!(cone(60, &facets), Cone::Large));
    }

    /// A wedge as narrow as the root of rounding, 1e-5, allows has an interior.
    #[test]
    fn narrow_wedges_have_an_interior() {
        for angle in [1e-1, 2e-5] {
            let wedge = cone(2, &normals(&[[1.0, 0.0], [-1.0, angle]]));
            assert!(matches!(wedge, Cone::Solid(2)), "{angle}");
        }
    }

    /// The edges of an octant bound a cone of three dimensions; opposite facets leave a face or an edge of it.
    #[test]
    fn cones_in_space() {
        let octant = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        assert!(matches!(cone(3, &normals(&octant)), Cone::Solid(3)));
        let face = [octant[0], octant[1], octant[2], [-1.0, 0.0, 0.0]];
        assert!(matches!(cone(3, &normals(&face)), Cone::Solid(2)));
        let edge = [octant[0], octant[1], octant[2], [-1.0, -1.0, 0.0]];
        assert_eq!(rays(cone(3, &normals(&edge))), 1);
        let line = [octant[0], [-1.0, 0.0, 0.0], octant[1], [0.0, -1.0, 0.0]];
        assert_eq!(rays(cone(3, &normals(&line))), 2);
    }
}
