//! The arms of one smooth extension, by Lyapunov–Schmidt reduction where the kernel of its Jacobian has more than one dimension: the forms of
//! lowest order in the kernel have the tangents as roots, and each simple root begins one smooth curve (points of the curve solve a regular
//! equation order by order; see E. Allgower and K. Georg, Numerical Continuation Methods, 1990, chapter 8).

use super::arc::{Arc, Value};
use super::extension::Extension;
use super::roots::{
    common_roots, cubic_discriminant, cubic_roots, gradient, polished, quadratic_roots, solve3,
};
use crate::sparse::dot;

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
        Arc::new(terms, 1.0)
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

    pub(super) fn direction(&self, c: &[f64]) -> Vec<f64> {
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

    /// The quadratic form of a kernel of two dimensions at each base, and its discriminant; `None` where it is 0.
    pub(super) fn form(&self) -> (Vec<[f64; 3]>, Option<Value>) {
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
        let discriminant = (size > error).then_some(Value {
            value: b * b - a * c,
            error: 4.0 * size * error,
        });
        (forms, discriminant)
    }

    /// The direction of the kernel along a double root of a form: the eigenvector of the eigenvalue that vanishes.
    pub(super) fn double_root([a, b, c]: [f64; 3]) -> [f64; 2] {
        let along = if a.abs() > c.abs() { [-b, a] } else { [c, -b] };
        let length = along[0].hypot(along[1]);
        along.map(|v| v / length)
    }

    fn in_plane(&self) -> Reduced {
        let (forms, discriminant) = self.form();
        let Some(discriminant) = discriminant else {
            return self.by_cubic();
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
            _ => self.along_double_root(forms[0]),
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
        Some(Arc::new(terms, shift as f64))
    }

    /// A quadratic form of rank one: q t² with t across the double root, and s along it. The Newton polygon of q t² + e s³ + …
    fn along_double_root(&self, [a, b, c]: [f64; 3]) -> Reduced {
        let along = Self::double_root([a, b, c]);
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
                        order: 1.5,
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
                    Arc::new(terms, 2.0)
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
            value: cubic_discriminant([a, b, c, d]),
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
        Some(Arc::new(terms, 1.0))
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
