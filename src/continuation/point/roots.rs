//! Real roots of binary forms, and of two quadratic forms in three unknowns.

use crate::linear::eigenvalues;
use crate::sparse::{Matrix, dot, norm};

/// Unit vectors along the two roots of a t² + 2 b t s + c s² with a positive discriminant.
pub(super) fn quadratic_roots([a, b, c]: [f64; 3]) -> Vec<[f64; 2]> {
    let root = (b * b - a * c).max(0.0).sqrt();
    // The root without cancellation gives the other one.
    let q = -(b + if b < 0.0 { -root } else { root });
    [[q, a], [c, q]].into_iter().filter_map(unit2).collect()
}

fn unit2(v: [f64; 2]) -> Option<[f64; 2]> {
    let length = v[0].hypot(v[1]);
    (length > 0.0 && length.is_finite()).then(|| v.map(|v| v / length))
}

/// a⁴ Π (tᵢ − tⱼ)² over the pairs of roots of a t³ + b t² + c t + d: positive where all three are real and differ.
pub(super) fn cubic_discriminant([a, b, c, d]: [f64; 4]) -> f64 {
    18.0 * a * b * c * d - 4.0 * b * b * b * d + b * b * c * c - 4.0 * a * c * c * c - 27.0 * a * a * d * d
}

/// Unit vectors along the real roots (t : s) of a t³ + b t² s + c t s² + d s³, all simple: on the half circle the cubic, as a function of the
/// angle, changes its sign at each; its critical angles are the roots of a quadratic form, so that each root is bracketed.
pub(super) fn cubic_roots([a, b, c, d]: [f64; 4]) -> Vec<[f64; 2]> {
    let value = |angle: f64| {
        let (s, t) = angle.sin_cos();
        ((a * t + b * s) * t + c * s * s) * t + d * s * s * s
    };
    // The derivative along the circle is a form of degree 3 again; a grid finer than any two simple roots of moderate size, refined by halving.
    const GRID: usize = 4096;
    let mut roots = Vec::new();
    for k in 0..GRID {
        let at = |k: usize| std::f64::consts::PI * (k as f64 + 0.376) / GRID as f64;
        let (mut low, mut high) = (at(k), at(k + 1));
        let (mut f, g) = (value(low), value(high));
        if f == 0.0 || f * g >= 0.0 {
            continue;
        }
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            let v = value(middle);
            if (v > 0.0) == (f > 0.0) {
                (low, f) = (middle, v);
            } else {
                high = middle;
            }
        }
        let (s, t) = (0.5 * (low + high)).sin_cos();
        roots.push([t, s]);
    }
    roots
}

/// Value of a quadratic form (a₁₁, a₂₂, a₃₃, a₁₂, a₁₃, a₂₃).
fn quadric(q: &[f64; 6], c: &[f64; 3]) -> f64 {
    0.5 * dot(&gradient(q, c), c)
}

pub(super) fn gradient(q: &[f64; 6], c: &[f64; 3]) -> [f64; 3] {
    [
        2.0 * (q[0] * c[0] + q[3] * c[1] + q[4] * c[2]),
        2.0 * (q[3] * c[0] + q[1] * c[1] + q[5] * c[2]),
        2.0 * (q[4] * c[0] + q[5] * c[1] + q[2] * c[2]),
    ]
}

fn cross(a: &[f64; 3], b: &[f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

pub(super) fn solve3(rows: [[f64; 3]; 3], b: [f64; 3]) -> Option<[f64; 3]> {
    let [r, s, t] = &rows;
    let det = dot(r, &cross(s, t));
    let (st, tr, rs) = (cross(s, t), cross(t, r), cross(r, s));
    let x = [0, 1, 2].map(|k| (b[0] * st[k] + b[1] * tr[k] + b[2] * rs[k]) / det);
    x.iter().all(|v| v.is_finite()).then_some(x)
}

/// A root, by Newton's method on the sphere.
pub(super) fn polished(forms: &[[f64; 6]; 2], mut c: [f64; 3]) -> [f64; 3] {
    for _ in 0..6 {
        let rows = [gradient(&forms[0], &c), gradient(&forms[1], &c), c];
        let Some(step) = solve3(rows, [-quadric(&forms[0], &c), -quadric(&forms[1], &c), 0.0]) else {
            return c;
        };
        let moved = [0, 1, 2].map(|k| c[k] + step[k]);
        let length = norm(&moved);
        c = moved.map(|v| v / length);
    }
    c
}

/// The real common roots of two quadratic forms, as unit vectors up to sign; `None` where one is not simple within the error. In generic
/// coordinates, c₃ = 1 say, the resultant in c₁ is a quartic in c₂, whose roots are eigenvalues of its companion matrix.
pub(super) fn common_roots(forms: &[[f64; 6]; 2], error: f64) -> Option<Vec<[f64; 3]>> {
    // A fixed rotation without symmetries.
    const ROTATION: [[f64; 3]; 3] = [
        [0.627_963_030_199_556, -0.540_302_305_868_14, 0.560_044_118_9],
        [0.703, 0.0, -0.711],
        [0.325_057_583_671_868, 0.841_470_984_807_897, 0.431_5],
    ];
    let scale = |q: &[f64; 6]| q.iter().map(|v| v.abs()).fold(0.0, f64::max);
    if forms.iter().any(|q| scale(q) <= 8.0 * error) {
        return None;
    }
    let turned = forms.each_ref().map(|q| {
        let size = scale(q);
        let image = |i: usize, j: usize| {
            let c: [f64; 3] = [0, 1, 2].map(|k| ROTATION[i][k]);
            dot(&gradient(q, &c), &ROTATION[j]) * 0.5 / size
        };
        [
            image(0, 0),
            image(1, 1),
            image(2, 2),
            image(0, 1),
            image(0, 2),
            image(1, 2),
        ]
    });
    // a t² + b(s) t + c(s) in t = c₁, s = c₂.
    let parts = turned.map(|q| (q[0], [2.0 * q[4], 2.0 * q[3]], [q[2], 2.0 * q[5], q[1]]));
    let ((a1, b1, c1), (a2, b2, c2)) = (&parts[0], &parts[1]);
    let first: Vec<f64> = (0..3).map(|k| a1 * c2[k] - a2 * c1[k]).collect();
    let second: Vec<f64> = (0..2).map(|k| a1 * b2[k] - a2 * b1[k]).collect();
    let third = minus(&product(b1, c2), &product(b2, c1));
    let quartic = minus(&product(&first, &first), &product(&second, &third));
    let lead = *quartic.get(4)?;
    let largest = quartic.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    if lead.abs() <= 1e-9 * largest {
        return None;
    }
    let mut companion = vec![vec![0.0; 4]; 4];
    for k in 0..4 {
        companion[k][3] = -quartic[k] / lead;
        if k > 0 {
            companion[k][k - 1] = 1.0;
        }
    }
    let eigen = eigenvalues(&Matrix::from_rows(&companion).ok()?).ok()?;
    let mut roots = Vec::new();
    for (re, im) in eigen {
        if im.abs() > 1e-4 * (1.0 + re.abs()) {
            continue;
        }
        let (d2, d1) = (
            first[0] + re * (first[1] + re * first[2]),
            second[0] + re * second[1],
        );
        let t = -d2 / d1;
        let local = [t, re, 1.0];
        let mut c = [0.0; 3];
        for k in 0..3 {
            c[k] = (0..3).map(|i| local[i] * ROTATION[i][k]).sum();
        }
        let length = norm(&c);
        let c = polished(forms, c.map(|v| v / length));
        let sizes = [scale(&forms[0]), scale(&forms[1])];
        let off = (quadric(&forms[0], &c) / sizes[0])
            .abs()
            .max((quadric(&forms[1], &c) / sizes[1]).abs());
        let (g, h) = (
            gradient(&forms[0], &c).map(|v| v / sizes[0]),
            gradient(&forms[1], &c).map(|v| v / sizes[1]),
        );
        let simple = norm(&cross(&g, &h));
        if simple <= 1e-4 {
            return None;
        }
        if off <= 1e-10 + 8.0 * error {
            let known = |r: &[f64; 3]| norm(&cross(r, &c)) <= 1e-6;
            if !roots.iter().any(known) {
                roots.push(c);
            }
        } else if im == 0.0 {
            return None;
        }
    }
    Some(roots)
}

fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; a.len() + b.len() - 1];
    for (i, a) in a.iter().enumerate() {
        for (j, b) in b.iter().enumerate() {
            out[i + j] += a * b;
        }
    }
    out
}

fn minus(a: &[f64], b: &[f64]) -> Vec<f64> {
    let at = |v: &[f64], k: usize| v.get(k).copied().unwrap_or(0.0);
    (0..a.len().max(b.len())).map(|k| at(a, k) - at(b, k)).collect()
}

#[cfg(test)]
mod tests {
    use super::{common_roots, cross, cubic_discriminant, cubic_roots, polished, quadratic_roots};
    use crate::sparse::norm;

    /// a t² + 2 b t s + c s² with given roots (t : s), also where b is negative, zero or far larger than a and c.
    #[test]
    fn roots_of_binary_forms_are_found() {
        for (p, q) in [
            ([1.0, 2.0], [3.0, -1.0]),
            ([1.0, 2.0], [3.0, 1.0]),
            ([1.0, 1.0], [1.0, -1.0]),
            ([1.0, 1e-9], [1e-9, 1.0]),
        ] {
            // (t p₁ − s p₀)(t q₁ − s q₀) and its negative.
            for sign in [1.0, -1.0] {
                let form =
                    [p[1] * q[1], -0.5 * (p[1] * q[0] + p[0] * q[1]), p[0] * q[0]].map(|c: f64| sign * c);
                let roots = quadratic_roots(form);
                let apart = |r: &[f64; 2], p: [f64; 2]| (r[0] * p[1] - r[1] * p[0]).abs() / norm(&p);
                let has = |p: [f64; 2]| roots.iter().any(|r| apart(r, p) < 1e-15);
                assert!(roots.len() == 2 && has(p) && has(q), "{p:?} {q:?}: {roots:?}");
            }
        }
        // (t − s)(t − 2 s)(t + s); t³ + t s² has one.
        let roots = cubic_roots([1.0, -2.0, -1.0, 2.0]);
        let slopes: Vec<f64> = roots.iter().map(|r| r[0] / r[1]).collect();
        for exact in [1.0, 2.0, -1.0] {
            assert!(slopes.iter().any(|s| (s - exact).abs() < 1e-14), "{slopes:?}");
        }
        assert_eq!((roots.len(), cubic_roots([1.0, 0.0, 1.0, 0.0]).len()), (3, 1));
    }

    /// Integers, so that every product is exact: real roots, one counted twice, and a pair of complex ones m ± i q.
    #[test]
    fn discriminants_of_cubics_are_products_of_differences_of_roots() {
        for a in [1.0, -2.0, 3.0] {
            for (p, q, r) in [
                (1.0, 2.0, -3.0),
                (0.0, 5.0, 7.0),
                (2.0, 2.0, -1.0),
                (-4.0, -1.0, 6.0),
            ] {
                let cubic: [f64; 4] =
                    [1.0, -(p + q + r), p * q + q * r + r * p, -p * q * r].map(|c: f64| a * c);
                let product: f64 = (p - q) * (q - r) * (r - p);
                assert_eq!(cubic_discriminant(cubic), a.powi(4) * product * product);
                // (t − r)((t − p)² + q²): differences 2 i q and (r − p)² + q².
                let (linear, constant) = (-2.0 * p, p * p + q * q);
                let cubic = [1.0, linear - r, constant - r * linear, -r * constant].map(|c: f64| a * c);
                let apart = (r - p) * (r - p) + q * q;
                assert_eq!(
                    cubic_discriminant(cubic),
                    -a.powi(4) * 4.0 * q * q * apart * apart
                );
            }
        }
    }

    /// Pairs of cones with four, two and no common lines, one counted twice, and the same cone twice.
    #[test]
    fn common_lines_of_two_cones_are_found() {
        let sphere = |z: f64| [1.0, 1.0, -z, 0.0, 0.0, 0.0];
        // x² + y² = 2 z² and x² = y²: the lines (±1, ±1, 1).
        let four = [sphere(2.0), [1.0, -1.0, 0.0, 0.0, 0.0, 0.0]];
        let found = common_roots(&four, 1e-15).unwrap();
        assert_eq!(found.len(), 4);
        for exact in [
            [1.0, 1.0, 1.0],
            [1.0, -1.0, 1.0],
            [-1.0, 1.0, 1.0],
            [-1.0, -1.0, 1.0],
        ] {
            assert!(found.iter().any(|r| norm(&cross(r, &exact)) < 1e-12), "{found:?}");
        }
        // x² + y² = z² and (x − 2 z)(x − z / 2) = 0: the second plane meets the cone in two lines.
        let two = [sphere(1.0), [1.0, 0.0, 1.0, 0.0, -1.25, 0.0]];
        let found = common_roots(&two, 1e-15).unwrap();
        assert_eq!(found.len(), 2);
        let height = 0.75_f64.sqrt();
        for exact in [[0.5, height, 1.0], [0.5, -height, 1.0]] {
            assert!(found.iter().any(|r| norm(&cross(r, &exact)) < 1e-12), "{found:?}");
        }
        let none = [sphere(1.0), [1.0, 1.0, 1.0, 0.0, 0.0, 0.0]];
        assert_eq!(common_roots(&none, 1e-15), Some(Vec::new()));
        // (x − z)² touches the cone; the same cone; a form that is all error.
        let touching = [1.0, 0.0, 1.0, 0.0, -1.0, 0.0];
        for (second, error) in [(touching, 1e-15), (sphere(1.0), 1e-15), ([1e-9; 6], 1e-9)] {
            assert_eq!(common_roots(&[sphere(1.0), second], error), None, "{second:?}");
        }
        let near = polished(&four, [0.6, 0.57, 0.56]);
        assert!(
            (near[0] - near[2]).abs() < 1e-15 && (near[1] - near[2]).abs() < 1e-15,
            "{near:?}"
        );
    }
}
