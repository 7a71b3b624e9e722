//! The solution of a square linear system between proven bounds.

/// Relative error of each number given, and of each operation on them.
const EPS: f64 = f64::EPSILON;
/// Norm of I − B G up to which B counts as an approximate inverse.
const NEAR: f64 = 0.25;

/// Bounds of what the coefficients of a form, and its constant, are off.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Error {
    pub(super) coefficients: f64,
    pub(super) constant: f64,
}

/// A point and how far in each component the solution of G z + c = 0 may be from it, the numbers of G and c being right to one unit in the
/// last place.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Enclosure {
    pub(super) point: Vec<f64>,
    pub(super) radius: Vec<f64>,
    /// Sign of det G.
    pub(super) sign: i8,
}

impl Enclosure {
    /// `None` where G, given by rows, is not proven to be regular. `errors` bound, row by row, what the coefficients and the constant may be
    /// off beyond their last place; where there are none it is empty.
    pub(super) fn of(matrix: &[f64], constants: &[f64], errors: &[Error]) -> Option<Self> {
        let n = constants.len();
        let error = |i: usize| errors.get(i).copied().unwrap_or_default();
        let factors = Factors::of(matrix, n)?;
        let inverse = factors.inverse();
        let rounding = (n as f64 + 8.0) * EPS;
        let dot = |row: &[f64], column: &dyn Fn(usize) -> f64| {
            row.iter().enumerate().fold((0.0, 0.0), |(sum, size), (k, a)| {
                let term = a * column(k);
                (sum + term, size + term.abs())
            })
        };
        let (mut defect, mut largest) = (0.0f64, 0.0f64);
        for i in 0..n {
            let row = &inverse[i * n..(i + 1) * n];
            let mut sum = 0.0;
            for j in 0..n {
                let (product, size) = dot(row, &|k| matrix[k * n + j]);
                sum += (product - if i == j { 1.0 } else { 0.0 }).abs() + rounding * (size + 1.0);
            }
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
        // The second round removes the rounding of the first.
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

    /// That of the system with the opposite constants.
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
        let rounding = (coefficients.len() as f64 + 8.0) * EPS;
        let error = 1.01 * (reach + rounding * size) + f64::MIN_POSITIVE;
        (value.abs() > error).then_some(if value > 0.0 { 1 } else { -1 })
    }
}

/// The solution of G z = b, improved once; nothing is proven of it.
pub(super) fn solve(matrix: &[f64], b: &[f64]) -> Option<Vec<f64>> {
    let n = b.len();
    let factors = Factors::of(matrix, n)?;
    let mut z = vec![0.0; n];
    for _ in 0..2 {
        let mut d: Vec<f64> = (0..n)
            .map(|i| {
                let row = matrix[i * n..(i + 1) * n].iter();
                b[i] - row.zip(&z).map(|(a, z)| a * z).sum::<f64>()
            })
            .collect();
        factors.solve(&mut d);
        z.iter_mut().zip(&d).for_each(|(z, d)| *z += d);
    }
    Some(z)
}

/// P G = L U with partial pivoting; L below the diagonal.
struct Factors {
    n: usize,
    lu: Vec<f64>,
    order: Vec<usize>,
    sign: i8,
}

impl Factors {
    fn of(matrix: &[f64], n: usize) -> Option<Self> {
        let mut lu = matrix.to_vec();
        let mut order: Vec<usize> = (0..n).collect();
        let mut sign = 1;
        for k in 0..n {
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

    fn inverse(&self) -> Vec<f64> {
        let n = self.n;
        let mut inverse = vec![0.0; n * n];
        let mut column = vec![0.0; n];
        for c in 0..n {
            column.fill(0.0);
            column[c] = 1.0;
            self.solve(&mut column);
            for i in 0..n {
                inverse[i * n + c] = column[i];
            }
        }
        inverse
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
        let mut largest = 0.0f64;
        for i in 0..n {
            let mut sum = 0.0;
            for j in 0..n {
                for k in 0..=i.min(j) {
                    let l = if k == i { 1.0 } else { self.lu[i * n + k].abs() };
                    sum += l * self.lu[k * n + j].abs();
                }
            }
            largest = largest.max(sum);
        }
        (n as f64 + 4.0) * EPS * largest
    }
}

#[cfg(test)]
mod tests {
    use super::{Enclosure, Error};

    #[test]
    fn holds_the_solution() {
        // x + y = 3, x − y = 1, rows exchanged: det = 2.
        let found = Enclosure::of(&[1.0, -1.0, 1.0, 1.0], &[-1.0, -3.0], &[]).unwrap();
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
        let found = Enclosure::of(&[1.0, 1.0, 0.0, 1.0], &[-1.1, -1.0], &[]).unwrap();
        assert!(
            (found.point[0] - 0.1).abs() < 1e-15 && found.radius[0] < 1e-14,
            "{found:?}"
        );
        let found = Enclosure::of(&[2.0, 1.0, 1.0, 2.0], &[-1.5, -1.4], &[]).unwrap();
        assert!((found.point[0] - 1.6 / 3.0).abs() < 1e-15, "{found:?}");
    }

    /// x = c/g for g within 2 ± 0.1 and c within 1 ± 0.05.
    #[test]
    fn errors_of_the_data_widen_it() {
        let off = Error {
            coefficients: 0.1,
            constant: 0.05,
        };
        let found = Enclosure::of(&[2.0], &[-1.0], &[off]).unwrap();
        let (least, most) = (0.95 / 2.1, 1.05 / 1.9);
        assert!(found.point[0] - found.radius[0] <= least && found.point[0] + found.radius[0] >= most);
        assert!(found.radius[0] < 0.06, "{found:?}");
        assert_eq!(found.sign_of(&[1.0], -0.4, Error::default()), Some(1));
        assert_eq!(found.sign_of(&[1.0], -0.4, off), None);
        let singular = Error {
            coefficients: 2.0,
            constant: 0.0,
        };
        assert_eq!(Enclosure::of(&[2.0], &[-1.0], &[singular]), None);
    }

    #[test]
    fn says_nothing_of_singular_matrices() {
        assert_eq!(Enclosure::of(&[1.0, 2.0, 2.0, 4.0], &[1.0, 1.0], &[]), None);
        assert_eq!(Enclosure::of(&[0.1, 0.3, 0.3, 0.9], &[1.0, 1.0], &[]), None);
    }
}
