//! The arms of one smooth extension, by Lyapunov–Schmidt reduction where the kernel of its Jacobian has more than one dimension: the forms of
//! lowest order in the kernel have the tangents as roots, and each simple root begins one smooth curve (points of the curve solve a regular
//! equation order by order; see E. Allgower and K. Georg, Numerical Continuation Methods, 1990, chapter 8).

use super::arc::{Arc, Value};
use super::extension::Extension;
use crate::linear::eigenvalues;
use crate::sparse::{Matrix, dot, norm};

/// What is known of the arms of an extension, whichever cell they lie in.
pub(super) enum Reduced {
    /// All arms; each computed from all bases of the extension.
    Arms(Vec<Vec<Arc>>),
    /// The forms decide nothing up to the order computed.
    Degenerate,
    /// The kernel has too many dimensions.
    Large,
}

/// Terms of smooth arms: enough for the first three orders of functions along them.
const TERMS: usize = 3;

impl Extension<'_> {
    /// All arms of the extension, for pieces that are not affine (for these, where the kernel is a line).
    pub(super) fn reduced(&self) -> Reduced {
        match (self.dimension(), self.cokernel().len()) {
            (1, 0) => {
                let tangent = self.kernel()[0].clone();
                let arcs: Vec<Arc> = (0..self.num_bases()).map(|b| self.smooth(b, &tangent)).collect();
                Reduced::Arms(both_ways(arcs))
            }
            (2, 1) => self.in_plane(),
            (3, 2) => self.in_space(),
            _ => Reduced::Large,
        }
    }

    /// The curve along a one-dimensional kernel.
    fn smooth(&self, base: usize, tangent: &[f64]) -> Arc {
        let mut terms = vec![self.kernel_near(base, tangent)];
        while terms.len() < TERMS && !self.frame.map.is_piecewise_affine() {
            let r = self.rest(base, &terms);
            terms.push(self.solve(base, &r));
        }
        Arc::new(terms)
    }

    /// The coefficient of H that the next term of an arc has to cancel.
    fn rest(&self, base: usize, terms: &[Vec<f64>]) -> Vec<f64> {
        let order = terms.len() + 1;
        let known: Vec<&[f64]> = terms.iter().map(Vec::as_slice).collect();
        self.along(base, &known, order).residual.swap_remove(order)
    }

    /// The terms, completed by particular solutions up to a number of them.
    fn completed(&self, base: usize, mut terms: Vec<Vec<f64>>, number: usize) -> Vec<Vec<f64>> {
        while terms.len() < number {
            let r = self.rest(base, &terms);
            terms.push(self.solve(base, &r));
        }
        terms
    }

    /// The part of the next coefficient of H outside the range of its Jacobian.
    fn obstruction(&self, base: usize, terms: &[Vec<f64>]) -> Vec<f64> {
        let r = self.rest(base, terms);
        self.cokernel().iter().map(|u| dot(u, &r)).collect()
    }

    fn direction(&self, c: &[f64]) -> Vec<f64> {
        let mut v = vec![0.0; self.units.len()];
        for (basis, c) in self.kernel().iter().zip(c) {
            v.iter_mut().zip(basis).for_each(|(v, b)| *v += c * b);
        }
        v
    }

    /// A number computed from every base, with its error.
    fn measured(&self, number: impl Fn(usize) -> f64) -> Value {
        let own = number(0);
        let apart = (1..self.num_bases())
            .map(|b| (number(b) - own).abs())
            .fold(0.0, f64::max);
        Value {
            value: own,
            error: 8.0 * apart + self.resolution(),
        }
    }

    /// The quadratic form of a kernel of two dimensions and one equation: (q₁₁, q₁₂, q₂₂).
    fn quadratic(&self, base: usize, row: usize) -> impl Fn(&[f64]) -> f64 + '_ {
        move |c| self.obstruction(base, &[self.direction(c)])[row]
    }

    fn in_plane(&self) -> Reduced {
        let form = |b: usize| -> [f64; 3] {
            let q = self.quadratic(b, 0);
            let (a, c) = (q(&[1.0, 0.0]), q(&[0.0, 1.0]));
            [a, 0.5 * (q(&[1.0, 1.0]) - a - c), c]
        };
        let forms: Vec<[f64; 3]> = (0..self.num_bases()).map(form).collect();
        let entry = |k: usize| self.measured(|b| forms[b][k]);
        let entries = [entry(0), entry(1), entry(2)];
        let [a, b, c] = entries.map(|e| e.value);
        let error = entries.iter().map(|e| e.error).fold(0.0, f64::max);
        let size = a.abs().max(b.abs()).max(c.abs());
        if size <= error {
            return self.by_cubic();
        }
        let discriminant = Value {
            value: b * b - a * c,
            error: 4.0 * size * error,
        };
        match discriminant.sign() {
            -1 => Reduced::Arms(Vec::new()),
            1 => {
                let mut arms = Vec::new();
                for root in quadratic_roots(forms[0]) {
                    let of_base = |b: usize| {
                        let near = nearest(&quadratic_roots(forms[b]), &root)?;
                        self.through_root(b, &near, 1)
                    };
                    let Some(arcs) = (0..self.num_bases()).map(of_base).collect::<Option<Vec<Arc>>>() else {
                        return Reduced::Degenerate;
                    };
                    arms.extend(both_ways(arcs));
                }
                Reduced::Arms(arms)
            }
            _ => self.along_double_root([a, b, c]),
        }
    }

    /// The arm along a simple root c of the form of lowest order; `shift` is how many orders later an equation determines the component
    /// of a term across the root.
    fn through_root(&self, base: usize, c: &[f64; 2], shift: usize) -> Option<Arc> {
        let across = self.direction(&[-c[1], c[0]]);
        let mut terms = vec![self.kernel_near(base, &self.direction(c))];
        while terms.len() < TERMS && terms.len() + shift < super::extension::ORDER {
            let r = self.rest(base, &terms);
            terms.push(self.solve(base, &r));
            let at = |beta: f64| {
                let mut moved = terms.clone();
                let last = moved.len() - 1;
                moved[last]
                    .iter_mut()
                    .zip(&across)
                    .for_each(|(w, a)| *w += beta * a);
                let number = moved.len() + shift - 1;
                self.obstruction(base, &self.completed(base, moved, number))[0]
            };
            // Linear in the component across the root.
            let (zero, one) = (at(0.0), at(1.0));
            let beta = -zero / (one - zero);
            if !beta.is_finite() {
                return None;
            }
            let last = terms.len() - 1;
            terms[last]
                .iter_mut()
                .zip(&across)
                .for_each(|(w, a)| *w += beta * a);
        }
        Some(Arc::new(terms))
    }

    /// A quadratic form of rank one: q t² with t across the double root, and s along it. The Newton polygon of q t² + e s³ + …
    fn along_double_root(&self, [a, b, c]: [f64; 3]) -> Reduced {
        // The eigenvector of the eigenvalue that vanishes.
        let along = if a.abs() > c.abs() { [-b, a] } else { [c, -b] };
        let length = along[0].hypot(along[1]);
        let along = along.map(|v| v / length);
        let across = [-along[1], along[0]];
        let q = a + c;
        let tangent = self.direction(&along);
        let near = |base: usize| self.kernel_near(base, &tangent);
        let cubic =
            self.measured(|base| self.obstruction(base, &self.completed(base, vec![near(base)], 2))[0]);
        match cubic.sign() {
            0 => self.beside_double_root(&tangent, &self.direction(&across), q),
            _ => {
                // t² = −(e/q) s³: a cusp on the side where that is positive.
                let ratio = -cubic.value / q;
                let side = ratio.signum();
                let half = ratio.abs().sqrt();
                let arm = |sign: f64| {
                    let arc = |base: usize| Arc {
                        terms: vec![near(base).iter().map(|t| side * t).collect()],
                        half: Some(self.direction(&across).iter().map(|v| sign * half * v).collect()),
                    };
                    (0..self.num_bases()).map(arc).collect()
                };
                Reduced::Arms(vec![arm(1.0), arm(-1.0)])
            }
        }
    }

    /// q t² + c₁ t s² + d s⁴: two curves that touch, t = w s² with the roots w, or none.
    fn beside_double_root(&self, tangent: &[f64], across: &[f64], q: f64) -> Reduced {
        let at = |base: usize, w: f64| {
            let mut terms = self.completed(base, vec![self.kernel_near(base, tangent)], 2);
            terms[1].iter_mut().zip(across).for_each(|(t, a)| *t += w * a);
            self.obstruction(base, &self.completed(base, terms, 3))[0]
        };
        let coefficients = |base: usize| {
            let (minus, zero, plus) = (at(base, -1.0), at(base, 0.0), at(base, 1.0));
            [q, 0.25 * (plus - minus), zero]
        };
        let all: Vec<[f64; 3]> = (0..self.num_bases()).map(coefficients).collect();
        let (b, d) = (self.measured(|k| all[k][1]), self.measured(|k| all[k][2]));
        let discriminant = Value {
            value: b.value * b.value - q * d.value,
            error: 2.0 * b.value.abs() * b.error + q.abs() * d.error + b.error * b.error,
        };
        match discriminant.sign() {
            0 => Reduced::Degenerate,
            -1 => Reduced::Arms(Vec::new()),
            _ => {
                let root = |base: usize, sign: f64| {
                    let [q, b, d] = all[base];
                    (-b + sign * (b * b - q * d).max(0.0).sqrt()) / q
                };
                let arc = |base: usize, sign: f64| {
                    let mut terms = self.completed(base, vec![self.kernel_near(base, tangent)], 2);
                    let w = root(base, sign);
                    terms[1].iter_mut().zip(across).for_each(|(t, a)| *t += w * a);
                    Arc::new(terms)
                };
                let of = |sign: f64| both_ways((0..self.num_bases()).map(|b| arc(b, sign)).collect());
                Reduced::Arms([of(1.0), of(-1.0)].concat())
            }
        }
    }

    /// No quadratic part: the roots of the binary cubic.
    fn by_cubic(&self) -> Reduced {
        const AT: [[f64; 2]; 4] = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]];
        let cubic = |base: usize| -> [f64; 4] {
            let value =
                |c: &[f64; 2]| self.obstruction(base, &self.completed(base, vec![self.direction(c)], 2))[0];
            let [a, d, plus, minus] = AT.each_ref().map(value);
            // a + b + c + d and a − b + c − d at the last two.
            let (even, odd) = (0.5 * (plus + minus), 0.5 * (plus - minus));
            [a, odd - d, even - a, d]
        };
        let all: Vec<[f64; 4]> = (0..self.num_bases()).map(cubic).collect();
        let entries = [0, 1, 2, 3].map(|k| self.measured(|b| all[b][k]));
        let size = entries.iter().map(|e| e.value.abs()).fold(0.0, f64::max);
        let error = entries.iter().map(|e| e.error).fold(0.0, f64::max);
        if size <= 8.0 * error {
            return Reduced::Degenerate;
        }
        let [a, b, c, d] = all[0].map(|v| v / size);
        let discriminant = Value {
            value: 18.0 * a * b * c * d - 4.0 * b * b * b * d + b * b * c * c
                - 4.0 * a * c * c * c
                - 27.0 * a * a * d * d,
            error: 64.0 * error / size,
        };
        if discriminant.sign() == 0 {
            return Reduced::Degenerate;
        }
        let mut arms = Vec::new();
        for root in cubic_roots(all[0]) {
            let of_base = |b: usize| self.through_root(b, &nearest(&cubic_roots(all[b]), &root)?, 2);
            let Some(arcs) = (0..self.num_bases()).map(of_base).collect::<Option<Vec<Arc>>>() else {
                return Reduced::Degenerate;
            };
            arms.extend(both_ways(arcs));
        }
        Reduced::Arms(arms)
    }

    /// Two quadratic forms in three unknowns: their common roots, all of which have to be simple.
    fn in_space(&self) -> Reduced {
        let forms = |base: usize| -> [[f64; 6]; 2] {
            let mut both = [[0.0; 6]; 2];
            for (row, form) in both.iter_mut().enumerate() {
                let q = self.quadratic(base, row);
                let unit = |i: usize, j: usize| {
                    let mut c = [0.0; 3];
                    (c[i], c[j]) = (1.0, 1.0);
                    q(&c)
                };
                let d = [unit(0, 0), unit(1, 1), unit(2, 2)];
                let mixed = |i: usize, j: usize| 0.5 * (unit(i, j) - d[i] - d[j]);
                *form = [d[0], d[1], d[2], mixed(0, 1), mixed(0, 2), mixed(1, 2)];
            }
            both
        };
        let all: Vec<[[f64; 6]; 2]> = (0..self.num_bases()).map(forms).collect();
        let error = (0..12)
            .map(|k| self.measured(|b| all[b][k / 6][k % 6]).error)
            .fold(0.0, f64::max);
        let Some(roots) = common_roots(&all[0], error) else {
            return Reduced::Degenerate;
        };
        let mut arms = Vec::new();
        for root in roots {
            let arc = |b: usize| self.through_point(b, &polished(&all[b], root), &all[b]);
            let Some(arcs) = (0..self.num_bases()).map(arc).collect::<Option<Vec<Arc>>>() else {
                return Reduced::Degenerate;
            };
            arms.extend(both_ways(arcs));
        }
        Reduced::Arms(arms)
    }

    /// The arm along a simple common root of two quadratic forms: its second term solves two linear equations.
    fn through_point(&self, base: usize, c: &[f64; 3], forms: &[[f64; 6]; 2]) -> Option<Arc> {
        let mut terms = self.completed(base, vec![self.kernel_near(base, &self.direction(c))], 2);
        let rest = self.obstruction(base, &terms);
        // The obstruction grows by 2 Q(c, β) with the component β of the second term in the kernel; β is orthogonal to c.
        let rows = [gradient(&forms[0], c), gradient(&forms[1], c), *c];
        let beta = solve3(rows, [-rest[0], -rest[1], 0.0])?;
        let moved = self.direction(&beta);
        terms[1].iter_mut().zip(&moved).for_each(|(t, m)| *t += m);
        Some(Arc::new(terms))
    }
}

/// The arms of a curve in both directions.
fn both_ways(arcs: Vec<Arc>) -> Vec<Vec<Arc>> {
    let back = arcs.iter().map(Arc::reversed).collect();
    vec![arcs, back]
}

fn nearest(roots: &[[f64; 2]], root: &[f64; 2]) -> Option<[f64; 2]> {
    let along = |r: &[f64; 2]| r[0] * root[0] + r[1] * root[1];
    let best = roots
        .iter()
        .max_by(|p, q| along(p).abs().total_cmp(&along(q).abs()))?;
    Some(best.map(|v| v * along(best).signum()))
}

/// Unit vectors along the two roots of a t² + 2 b t s + c s² with a positive discriminant.
fn quadratic_roots([a, b, c]: [f64; 3]) -> Vec<[f64; 2]> {
    let root = (b * b - a * c).max(0.0).sqrt();
    // The root without cancellation gives the other one.
    let q = -(b + if b < 0.0 { -root } else { root });
    [[q, a], [c, q]].into_iter().filter_map(unit2).collect()
}

fn unit2(v: [f64; 2]) -> Option<[f64; 2]> {
    let length = v[0].hypot(v[1]);
    (length > 0.0 && length.is_finite()).then(|| v.map(|v| v / length))
}

/// Unit vectors along the real roots (t : s) of a t³ + b t² s + c t s² + d s³, all simple: on the half circle the cubic, as a function of the
/// angle, changes its sign at each; its critical angles are the roots of a quadratic form, so that each root is bracketed.
fn cubic_roots([a, b, c, d]: [f64; 4]) -> Vec<[f64; 2]> {
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

fn gradient(q: &[f64; 6], c: &[f64; 3]) -> [f64; 3] {
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

fn solve3(rows: [[f64; 3]; 3], b: [f64; 3]) -> Option<[f64; 3]> {
    let [r, s, t] = &rows;
    let det = dot(r, &cross(s, t));
    let (st, tr, rs) = (cross(s, t), cross(t, r), cross(r, s));
    let x = [0, 1, 2].map(|k| (b[0] * st[k] + b[1] * tr[k] + b[2] * rs[k]) / det);
    x.iter().all(|v| v.is_finite()).then_some(x)
}

/// A root, by Newton's method on the sphere.
fn polished(forms: &[[f64; 6]; 2], mut c: [f64; 3]) -> [f64; 3] {
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
fn common_roots(forms: &[[f64; 6]; 2], error: f64) -> Option<Vec<[f64; 3]>> {
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
    use super::{common_roots, cross, cubic_roots, polished, quadratic_roots};
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
