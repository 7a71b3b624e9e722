//! The solution of a square linear system between proven bounds.

use crate::clock::Deadline;

/// Norm of I − B G up to which B counts as an approximate inverse.
const NEAR: f64 = 0.25;

/// Error bounds of the coefficients of a form, and of its constant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Error {
    pub(super) coefficients: f64,
    pub(super) constant: f64,
}

/// A point and a bound, for each component, of its distance from the solution of G z + c = 0, the numbers of G and c being accurate to one
/// unit in the last place.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Enclosure {
    pub(super) point: Vec<f64>,
    pub(super) radius: Vec<f64>,
    /// Sign of det G.
    pub(super) sign: i8,
}

impl Enclosure {
    /// `None` where G, given by rows, is not proven to be regular. `errors` bound, row by row, the errors of the coefficients and of the
    /// constant beyond their last place; empty if there are none. `None` also after the time limit.
    pub(super) fn of(
        matrix: &[f64],
        constants: &[f64],
        errors: &[Error],
        deadline: Deadline<'_>,
    ) -> Option<Self> {
        let n = constants.len();
        let error = |i: usize| errors.get(i).copied().unwrap_or_default();
        let factors = Factors::of(matrix, n, deadline)?;
        let inverse = factors.inverse(deadline)?;
        let entries = |k: usize| {
            let row = matrix[k * n..(k + 1) * n].iter().copied().enumerate();
            row.filter(|(_, b)| *b != 0.0)
        };
        let rows: Vec<Vec<(usize, f64)>> = (0..n).map(|k| entries(k).collect()).collect();
        let rounding = (n as f64 + 8.0) * f64::EPSILON;
        let dot = |row: &[f64], column: &dyn Fn(usize) -> f64| {
            row.iter().enumerate().fold((0.0, 0.0), |(sum, size), (k, a)| {
                let term = a * column(k);
                (sum + term, size + term.abs())
            })
        };
        let (mut defect, mut largest) = (0.0f64, 0.0f64);
        let (mut products, mut sizes) = (vec![0.0; n], vec![0.0; n]);
        for i in 0..n {
            if deadline.is_over() {
                return None;
            }
            let row = &inverse[i * n..(i + 1) * n];
            products.fill(0.0);
            sizes.fill(1.0);
            products[i] = -1.0;
            for (k, &a) in row.iter().enumerate().filter(|(_, a)| **a != 0.0) {
                for &(j, b) in &rows[k] {
                    let term = a * b;
                    products[j] += term;
                    sizes[j] += term.abs();
                }
            }
            let off = products.iter().zip(&sizes);
            let mut sum: f64 = off.map(|(product, size)| product.abs() + rounding * size).sum();
            sum += n as f64 * dot(row, &|k| error(k).coefficients).1;
            defect = defect.max(sum);
            largest = largest.max(row.iter().map(|v| v.abs()).sum());
        }
        // Between G and the product of its factors all matrices are regular: their determinants agree in sign.
        let sure = 1.01 * (defect + largest * factors.defect()) <= NEAR;
        if !sure {
            return None;
        }
        let mut point = vec![0.0; n];
        let mut miss = vec![(0.0, 0.0); n];
        let measure = |point: &[f64], miss: &mut [(f64, f64)]| {
            for i in 0..n {
                let (value, size) = dot(&matrix[i * n..(i + 1) * n], &|k| point[k]);
                let (c, error) = (constants[i], error(i));
                let reach: f64 = point.iter().map(|p| p.abs()).sum();
                let off = error.coefficients * reach + error.constant;
                miss[i] = (value + c, (value + c).abs() + rounding * (size + c.abs()) + off);
            }
        };
        // The second iteration removes the rounding of the first.
        for _ in 0..2 {
            measure(&point, &mut miss);
            for (i, p) in point.iter_mut().enumerate() {
                *p -= dot(&inverse[i * n..(i + 1) * n], &|k| miss[k].0).0;
            }
        }
        measure(&point, &mut miss);
        let mut radius = Vec::with_capacity(n);
        for i in 0..n {
            radius.push(dot(&inverse[i * n..(i + 1) * n], &|k| miss[k].1).1);
        }
        let worst = radius.iter().fold(0.0f64, |m, b| m.max(*b));
        let spread = defect / (1.0 - defect) * worst;
        radius
            .iter_mut()
            .for_each(|r| *r = 1.01 * (*r + spread) + f64::MIN_POSITIVE);
        let finite = point.iter().chain(&radius).all(|v| v.is_finite());
        finite.then_some(Self {
            point,
            radius,
            sign: factors.sign,
        })
    }

    /// Whether the components are known to ten digits of the largest, and those that are certainly not 0 to eight of their own.
    pub(super) fn is_sharp(&self) -> bool {
        let largest = self.point.iter().fold(0.0f64, |m, p| m.max(p.abs()));
        let known =
            |(p, r): (&f64, &f64)| *r <= 1e-10 * largest && (p.abs() <= 10.0 * r || *r <= 1e-8 * p.abs());
        largest == 0.0 || self.point.iter().zip(&self.radius).all(known)
    }

    /// Bounds of the components of the solution.
    pub(super) fn reach(&self) -> Vec<f64> {
        let both = self.point.iter().zip(&self.radius);
        both.map(|(p, r)| p.abs() + r).collect()
    }

    /// The enclosure for the system with the opposite constants.
    pub(super) fn mirrored(&self) -> Self {
        let mut mirrored = self.clone();
        mirrored.point.iter_mut().for_each(|p| *p = -*p);
        mirrored
    }

    /// The sign of a form in the whole enclosure; `None` where it is not one.
    pub(super) fn sign_of(&self, coefficients: &[f64], constant: f64, error: Error) -> Option<i8> {
        let (mut value, mut size, mut reach) = (constant, constant.abs(), error.constant);
        for ((a, p), r) in coefficients.iter().zip(&self.point).zip(&self.radius) {
            value += a * p;
            size += (a * p).abs();
            reach += a.abs() * r + error.coefficients * (p.abs() + r);
        }
        let rounding = (coefficients.len() as f64 + 8.0) * f64::EPSILON;
        let error = 1.01 * (reach + rounding * size) + f64::MIN_POSITIVE;
        (value.abs() > error).then_some(if value > 0.0 { 1 } else { -1 })
    }
}

/// A square matrix, given by rows, and its factors; nothing is proven of them.
#[derive(Debug)]
pub(super) struct Factored {
    matrix: Vec<f64>,
    factors: Factors,
}

impl Factored {
    pub(super) fn new(matrix: Vec<f64>, n: usize, deadline: Deadline<'_>) -> Option<Self> {
        let factors = Factors::of(&matrix, n, deadline)?;
        Some(Self { matrix, factors })
    }

    /// The solution of G z = b, improved once.
    pub(super) fn solve(&self, b: &[f64]) -> Vec<f64> {
        let n = b.len();
        let mut z = vec![0.0; n];
        for _ in 0..2 {
            let mut d: Vec<f64> = (0..n)
                .map(|i| {
                    let row = self.matrix[i * n..(i + 1) * n].iter();
                    b[i] - row.zip(&z).map(|(a, z)| a * z).sum::<f64>()
                })
                .collect();
            self.factors.solve(&mut d);
            z.iter_mut().zip(&d).for_each(|(z, d)| *z += d);
        }
        z
    }
}

/// P G = L U with partial pivoting; L below the diagonal.
#[derive(Debug)]
struct Factors {
    n: usize,
    lu: Vec<f64>,
    order: Vec<usize>,
    sign: i8,
}

impl Factors {
    fn of(matrix: &[f64], n: usize, deadline: Deadline<'_>) -> Option<Self> {
        let mut lu = matrix.to_vec();
        let mut order: Vec<usize> = (0..n).collect();
        let mut sign = 1;
        for k in 0..n {
            if deadline.is_over() {
                return None;
            }
            let size = |i: &usize| lu[i * n + k].abs();
            let pivot = (k..n).max_by(|a, b| size(a).total_cmp(&size(b)))?;
            if pivot != k {
                for j in 0..n {
                    lu.swap(k * n + j, pivot * n + j);
                }
                order.swap(k, pivot);
                sign = -sign;
            }
            let diagonal = lu[k * n + k];
            if diagonal == 0.0 || !diagonal.is_finite() {
                return None;
            }
            if diagonal < 0.0 {
                sign = -sign;
            }
            for i in k + 1..n {
                let factor = lu[i * n + k] / diagonal;
                lu[i * n + k] = factor;
                if factor != 0.0 {
                    for j in k + 1..n {
                        lu[i * n + j] -= factor * lu[k * n + j];
                    }
                }
            }
        }
        Some(Self { n, lu, order, sign })
    }

    fn inverse(&self, deadline: Deadline<'_>) -> Option<Vec<f64>> {
        let n = self.n;
        let mut inverse = vec![0.0; n * n];
        for (i, &k) in self.order.iter().enumerate() {
            inverse[i * n + k] = 1.0;
        }
        let subtract = |inverse: &mut [f64], i: usize, k: usize| {
            let factor = self.lu[i * n + k];
            if factor != 0.0 {
                let (low, high) = inverse.split_at_mut(i.max(k) * n);
                let (of, from) = if i > k {
                    (&mut high[..n], &low[k * n..(k + 1) * n])
                } else {
                    (&mut low[i * n..(i + 1) * n], &high[..n])
                };
                of.iter_mut().zip(from).for_each(|(a, b)| *a -= factor * b);
            }
        };
        for i in 0..n {
            if deadline.is_over() {
                return None;
            }
            (0..i).for_each(|k| subtract(&mut inverse, i, k));
        }
        for i in (0..n).rev() {
            if deadline.is_over() {
                return None;
            }
            (i + 1..n).for_each(|k| subtract(&mut inverse, i, k));
            let diagonal = self.lu[i * n + i];
            inverse[i * n..(i + 1) * n]
                .iter_mut()
                .for_each(|a| *a /= diagonal);
        }
        Some(inverse)
    }

    /// Overwrites b by the solution.
    fn solve(&self, b: &mut [f64]) {
        let n = self.n;
        let mut z: Vec<f64> = self.order.iter().map(|&i| b[i]).collect();
        for i in 0..n {
            let sum: f64 = (0..i).map(|k| self.lu[i * n + k] * z[k]).sum();
            z[i] -= sum;
        }
        for i in (0..n).rev() {
            let sum: f64 = (i + 1..n).map(|k| self.lu[i * n + k] * z[k]).sum();
            z[i] = (z[i] - sum) / self.lu[i * n + i];
        }
        b.copy_from_slice(&z);
    }

    /// A bound of the norm of P G − L U.
    fn defect(&self) -> f64 {
        let n = self.n;
        let size = |row: &[f64]| row.iter().map(|v| v.abs()).sum::<f64>();
        let upper: Vec<f64> = (0..n).map(|k| size(&self.lu[k * n + k..(k + 1) * n])).collect();
        let of_row = |i: usize| {
            let lower = self.lu[i * n..i * n + i].iter().zip(&upper);
            upper[i] + lower.map(|(l, u)| l.abs() * u).sum::<f64>()
        };
        let largest = (0..n).map(of_row).fold(0.0, f64::max);
        (n as f64 + 4.0) * f64::EPSILON * largest
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::{Enclosure, Error, Factors};
    use crate::clock::Deadline;

    fn enclosed(matrix: &[f64], constants: &[f64], errors: &[Error]) -> Option<Enclosure> {
        Enclosure::of(matrix, constants, errors, Deadline::after(None))
    }

    #[test]
    fn holds_the_solution() {
        // x + y = 3, x − y = 1, rows exchanged: det = 2.
        let found = enclosed(&[1.0, -1.0, 1.0, 1.0], &[-1.0, -3.0], &[]).unwrap();
        assert!((found.point[0] - 2.0).abs() <= found.radius[0]);
        assert!((found.point[1] - 1.0).abs() <= found.radius[1]);
        assert!(found.radius.iter().all(|r| *r < 1e-13));
        assert_eq!(found.sign, 1);
        assert_eq!(found.sign_of(&[1.0, -2.0], 0.0, Error::default()), None);
        assert_eq!(found.sign_of(&[1.0, -2.0], 1e-10, Error::default()), Some(1));
        assert_eq!(found.sign_of(&[1.0, -2.0], -1e-10, Error::default()), Some(-1));
    }

    /// (G⁻¹ c)₁ = 1.1 − 1.0 cancels: the solution is not 0.
    #[test]
    fn small_solutions_of_large_terms_are_found() {
        let found = enclosed(&[1.0, 1.0, 0.0, 1.0], &[-1.1, -1.0], &[]).unwrap();
        assert!(
            (found.point[0] - 0.1).abs() < 1e-15 && found.radius[0] < 1e-14,
            "{found:?}"
        );
        let found = enclosed(&[2.0, 1.0, 1.0, 2.0], &[-1.5, -1.4], &[]).unwrap();
        assert!((found.point[0] - 1.6 / 3.0).abs() < 1e-15, "{found:?}");
    }

    /// x = c/g for g within 2 ± 0.1 and c within 1 ± 0.05.
    #[test]
    fn errors_of_the_data_widen_it() {
        let off = Error {
            coefficients: 0.1,
            constant: 0.05,
        };
        let found = enclosed(&[2.0], &[-1.0], &[off]).unwrap();
        let (least, most) = (0.95 / 2.1, 1.05 / 1.9);
        assert!(found.point[0] - found.radius[0] <= least && found.point[0] + found.radius[0] >= most);
        assert!(found.radius[0] < 0.06, "{found:?}");
        assert_eq!(found.sign_of(&[1.0], -0.4, Error::default()), Some(1));
        assert_eq!(found.sign_of(&[1.0], -0.4, off), None);
        let singular = Error {
            coefficients: 2.0,
            constant: 0.0,
        };
        assert_eq!(enclosed(&[2.0], &[-1.0], &[singular]), None);
    }

    /// By their definitions, one column and one product after the other, for a matrix of which rows are exchanged.
    #[test]
    fn inverses_and_defects_are_those_of_the_factors() {
        let n = 9;
        let matrix: Vec<f64> = (0..n * n).map(|k| ((k * k) as f64).sin()).collect();
        let factors = Factors::of(&matrix, n, Deadline::after(None)).unwrap();
        assert!((0..n).any(|i| factors.order[i] != i));
        let inverse = factors.inverse(Deadline::after(None)).unwrap();
        for c in 0..n {
            let mut column: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == c))).collect();
            factors.solve(&mut column);
            assert!((0..n).all(|i| (inverse[i * n + c] - column[i]).abs() < 1e-12));
            let product = |i: usize| {
                (0..n)
                    .map(|k| inverse[i * n + k] * matrix[k * n + c])
                    .sum::<f64>()
            };
            assert!((0..n).all(|i| (product(i) - f64::from(u8::from(i == c))).abs() < 1e-12));
        }
        let lower = |i: usize, k: usize| if i == k { 1.0 } else { factors.lu[i * n + k].abs() };
        let entry = |i: usize, j: usize| -> f64 {
            let terms = (0..=i.min(j)).map(|k| lower(i, k) * factors.lu[k * n + j].abs());
            terms.sum()
        };
        let row = |i: usize| (0..n).map(|j| entry(i, j)).sum::<f64>();
        let bound = (n as f64 + 4.0) * f64::EPSILON * (0..n).map(row).fold(0.0, f64::max);
        assert!((factors.defect() / bound - 1.0).abs() < 1e-13);
    }

    /// The time limit is checked for each row of the factors, twice for each of the inverse and of the products, and after it the result is
    /// `None`.
    #[test]
    fn ends_where_time_is_over() {
        let n = 20;
        let entry = |k: usize| if k / n == k % n { 7.0 } else { (k as f64).sin() };
        let matrix: Vec<f64> = (0..n * n).map(entry).collect();
        let (looks, limit) = (Cell::new(0), Cell::new(usize::MAX));
        let stop = || {
            looks.set(looks.get() + 1);
            looks.get() > limit.get()
        };
        let found = |most: usize| {
            looks.set(0);
            limit.set(most);
            Enclosure::of(&matrix, &vec![1.0; n], &[], Deadline::after(None).or(&stop)).is_some()
        };
        assert!(found(usize::MAX));
        assert_eq!(looks.get(), 4 * n);
        assert!((0..4 * n).all(|most| !found(most) && looks.get() == most + 1));
    }

    #[test]
    fn says_nothing_of_singular_matrices() {
        assert_eq!(enclosed(&[1.0, 2.0, 2.0, 4.0], &[1.0, 1.0], &[]), None);
        assert_eq!(enclosed(&[0.1, 0.3, 0.3, 0.9], &[1.0, 1.0], &[]), None);
    }
}
