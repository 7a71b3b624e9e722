//! Proofs by error bounds that selections excluded by a rounded simplex table are infeasible.

use std::cell::OnceCell;

use super::enclosure::Factored;
use super::system::System;
use super::table::{Form, Table};
use crate::clock::Deadline;

/// Far below all numbers of size one: accounts for underflow.
const UNDERFLOW: f64 = 1e-290;

/// The forms of the unknowns that the variables of a table represent, and bounds of the unknowns.
///
/// A row of a table, v = c + Σ aⱼ vⱼ, is an identity between forms up to rounding. Its error is found by inserting the forms; where the
/// unknowns are bounded, the error has a bound, too, and so have the terms whose signs are not known.
#[derive(Debug, Clone)]
pub(super) struct Certificates {
    forms: Vec<Form>,
    /// Bounds of the unknowns.
    radii: Vec<f64>,
    /// Bounds of the forms.
    reach: Vec<f64>,
    floor: f64,
}

/// The columns of one table as forms of the unknowns, factored once a row has to be recomputed.
#[derive(Debug)]
pub(super) struct Basis<'a> {
    factored: OnceCell<Option<Factored>>,
    deadline: Deadline<'a>,
}

impl<'a> Basis<'a> {
    /// After the time limit nothing is proven.
    pub(super) fn until(deadline: Deadline<'a>) -> Self {
        Self {
            factored: OnceCell::new(),
            deadline,
        }
    }
}

impl Certificates {
    pub(super) fn new(system: &System, radii: Vec<f64>) -> Self {
        let forms: Vec<Form> = system.forms().cloned().collect();
        let reach = forms.iter().map(|f| {
            let terms = f.coefficients.iter().zip(&radii);
            let sum: f64 = terms.filter(|t| *t.0 != 0.0).map(|(a, r)| a.abs() * r).sum();
            1.0001 * (sum + f.constant.abs())
        });
        Self {
            reach: reach.collect(),
            floor: UNDERFLOW * (1.0 + radii.iter().filter(|r| r.is_finite()).sum::<f64>()),
            forms,
            radii,
        }
    }

    /// Whether a variable has the sign of its row's constant, and is not 0, wherever the conditions decided in the table hold. `basis` can
    /// be used for all variables of this table.
    pub(super) fn proves(&self, table: &Table, var: usize, basis: &Basis<'_>) -> bool {
        let (Some((constant, columns, active, coefficients)), Some(own)) =
            (table.identity(var), self.forms.get(var))
        else {
            return false;
        };
        let row = Identity {
            table,
            own,
            constant,
            columns,
            active,
            coefficients,
        };
        if self.holds(&row) {
            return true;
        }
        // The rows of this table contain the rounding errors of all exchanges before it: recomputed without them, the row may suffice.
        self.anew(own, columns, basis)
            .is_some_and(|(fresh, coefficients)| {
                let row = Identity {
                    constant: fresh,
                    coefficients: &coefficients,
                    ..row
                };
                fresh * constant > 0.0 && self.holds(&row)
            })
    }

    /// A form as a constant and coefficients over the given variables, from the forms alone.
    fn anew(&self, own: &Form, columns: &[usize], basis: &Basis<'_>) -> Option<(f64, Vec<f64>)> {
        let m = own.coefficients.len();
        let factored = (basis.factored).get_or_init(|| self.factored(m, columns, basis.deadline));
        let coefficients = factored.as_ref()?.solve(&own.coefficients);
        let constants = columns.iter().zip(&coefficients);
        let rest: f64 = constants
            .filter_map(|(v, a)| Some(a * self.forms.get(*v)?.constant))
            .sum();
        Some((own.constant - rest, coefficients))
    }

    fn factored(&self, m: usize, columns: &[usize], deadline: Deadline<'_>) -> Option<Factored> {
        if columns.len() != m {
            return None;
        }
        let mut matrix = vec![0.0; m * m];
        for (j, &v) in columns.iter().enumerate() {
            match self.forms.get(v) {
                Some(form) => (0..m).for_each(|k| matrix[k * m + j] = form.coefficients[k]),
                None => matrix[(v - self.forms.len()) * m + j] = 1.0,
            }
        }
        Factored::new(matrix, m, deadline)
    }

    fn holds(&self, row: &Identity<'_>) -> bool {
        // What the terms may add to a value of the other sign.
        let mut slack = self.floor;
        let (own, constant) = (row.own, row.constant);
        let (mut missing, mut size) = (own.constant - constant, own.constant.abs() + constant.abs());
        let mut rest: Vec<(f64, f64)> = own.coefficients.iter().map(|a| (*a, a.abs())).collect();
        for (j, (&v, &a)) in row.columns.iter().zip(row.coefficients).enumerate() {
            if a == 0.0 {
                continue;
            }
            let reach = if let Some(form) = self.forms.get(v) {
                missing -= a * form.constant;
                size += (a * form.constant).abs();
                for ((r, s), b) in rest.iter_mut().zip(&form.coefficients) {
                    *r -= a * b;
                    *s += (a * b).abs();
                }
                self.reach[v]
            } else {
                let (r, s) = &mut rest[v - self.forms.len()];
                *r -= a;
                *s += a.abs();
                self.radii[v - self.forms.len()]
            };
            let sign = row.table.sign(v).factor();
            let recedes = sign != 0.0 && a * sign * constant >= 0.0;
            if j < row.active && !recedes {
                slack += a.abs() * reach;
            }
        }
        let rounding = (row.columns.len() as f64 + 8.0) * f64::EPSILON;
        slack += missing.abs() + rounding * size;
        for ((r, s), radius) in rest.iter().zip(&self.radii) {
            if *s != 0.0 {
                slack += (r.abs() + rounding * s) * radius;
            }
        }
        constant.abs() > 1.001 * slack
    }
}

/// A form as a constant and a combination of columns, the active ones first.
struct Identity<'a> {
    table: &'a Table,
    own: &'a Form,
    constant: f64,
    columns: &'a [usize],
    active: usize,
    coefficients: &'a [f64],
}

#[cfg(test)]
mod tests {
    use super::super::table::Sign;
    use super::*;
    use crate::spread::Random;

    fn form(constant: f64, coefficients: &[f64]) -> Form {
        Form {
            constant,
            coefficients: coefficients.to_vec(),
            error: f64::EPSILON,
        }
    }

    /// Whether the sign of the last of these forms of (y, z), y ≥ 0 and |y|, |z| ≤ 1, is proven where the first vanishes.
    fn proven(forms: &[Form], radius: f64) -> bool {
        let system = System {
            unknowns: 2,
            common: forms.to_vec(),
            sites: Vec::new(),
        };
        let mut table = Table::new(2, forms.iter());
        table.keep_fixed();
        assert!(table.constrain(forms.len(), Sign::Positive).is_ok() && table.fix(0).is_ok());
        Certificates::new(&system, vec![radius; 2]).proves(
            &table,
            forms.len() - 1,
            &Basis::until(Deadline::after(None)),
        )
    }

    /// Where z = 1: 2 z + y is positive for y ≥ 0, and 2 z − y for y < 2.
    #[test]
    fn a_column_that_may_undo_the_constant_counts() {
        let fixed = form(-1.0, &[0.0, 1.0]);
        assert!(proven(&[fixed.clone(), form(0.0, &[1.0, 2.0])], 1e6));
        assert!(!proven(&[fixed.clone(), form(0.0, &[-1.0, 2.0])], 1e6));
        assert!(!proven(&[fixed.clone(), form(0.0, &[-1.0, 2.0])], 2.0));
        assert!(proven(&[fixed, form(0.0, &[-1.0, 2.0])], 1.9));
    }

    /// Recomputed rows are identities: v = c + Σ aⱼ vⱼ for all unknowns, whether the columns are forms or unknowns.
    #[test]
    fn rows_made_anew_are_identities() {
        let mut random = Random::new(1);
        let mut number = || random.symmetric();
        let forms: Vec<Form> = (0..3).map(|_| form(number(), &[number(), number()])).collect();
        let system = System {
            unknowns: 2,
            common: forms.clone(),
            sites: Vec::new(),
        };
        let certificates = Certificates::new(&system, vec![1.0; 2]);
        // The unknowns come after the forms.
        for columns in [[0, 1], [1, 3], [4, 0], [3, 4]] {
            let (constant, coefficients) = certificates
                .anew(&forms[2], &columns, &Basis::until(Deadline::after(None)))
                .unwrap();
            for unknowns in [[0.0, 0.0], [1.0, 0.0], [0.3, -0.7]] {
                let value = |v: usize| match forms.get(v) {
                    Some(f) => f.constant + f.coefficients[0] * unknowns[0] + f.coefficients[1] * unknowns[1],
                    None => unknowns[v - forms.len()],
                };
                let sum: f64 = columns
                    .iter()
                    .zip(&coefficients)
                    .map(|(&v, a)| a * value(v))
                    .sum();
                assert!((value(2) - constant - sum).abs() < 1e-13, "{columns:?}");
            }
        }
    }

    /// a (z + c) vanishes where z + c does, up to the rounding of a c: the remainder of constants that cancel has no sign.
    #[test]
    fn what_rounding_leaves_of_constants_has_no_sign() {
        for k in 1..200 {
            let a = 0.1 + 0.37 * f64::from(k);
            for c in [0.7, 1.3, 5.9, 77.7] {
                let fixed = form(c, &[0.0, 1.0]);
                assert!(!proven(&[fixed.clone(), form(c * a, &[0.0, a])], 1e-9), "{a} {c}");
                // Each constant and each coefficient may have a rounding error of its own.
                for off in [
                    f64::EPSILON,
                    -f64::EPSILON,
                    2.0 * f64::EPSILON,
                    -2.0 * f64::EPSILON,
                ] {
                    let own = form(c * a * (1.0 + off), &[0.0, a]);
                    assert!(!proven(&[fixed.clone(), own], 1e-9), "{a} {c} {off:e}");
                }
            }
        }
    }
}
