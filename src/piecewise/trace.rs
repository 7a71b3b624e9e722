//! Which variables a formula depends on, found by evaluating it over sets of labels instead of derivatives.

use std::ops::Neg;

use num_traits::Signed;

use super::Real;
use super::number::{functions, number, operators};
use crate::sparse::Pattern;

/// Labels that one evaluation distinguishes.
pub(crate) const LABELS: usize = 256;
/// Evaluations beyond which the check of a given pattern lets columns share labels.
const EXACT: usize = 64;
/// Evaluations with shared labels; each overlooks an entry with the probability that its label is in the row already.
const SHARED: usize = 4;

/// A set of labels.
pub(crate) type Labels = [u64; LABELS / 64];

/// A number with the labels of all numbers from which it was computed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Dependence {
    value: f64,
    labels: Labels,
}

fn join(a: Labels, b: Labels) -> Labels {
    std::array::from_fn(|k| a[k] | b[k])
}

fn insert(labels: &mut Labels, label: usize) {
    if let Some(word) = labels.get_mut(label / 64) {
        *word |= 1 << (label % 64);
    }
}

/// The labels of a set, in order.
pub(crate) fn members(labels: &Labels) -> impl Iterator<Item = usize> {
    labels.iter().enumerate().flat_map(|(k, &word)| {
        std::iter::successors(Some(word), |rest| Some(rest & rest.wrapping_sub(1)))
            .take_while(|rest| *rest != 0)
            .map(move |rest| 64 * k + rest.trailing_zeros() as usize)
    })
}

impl Dependence {
    fn new(value: f64, label: Option<usize>) -> Self {
        let mut labels = Labels::default();
        if let Some(label) = label {
            insert(&mut labels, label);
        }
        Self { value, labels }
    }

    /// A value with the labels of both.
    fn with(self, other: Self, value: f64) -> Self {
        Self {
            value,
            labels: join(self.labels, other.labels),
        }
    }

    /// The same labels with another value.
    fn map(self, f: impl FnOnce(f64) -> f64) -> Self {
        Self {
            value: f(self.value),
            ..self
        }
    }
}

impl PartialEq for Dependence {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl From<f64> for Dependence {
    fn from(value: f64) -> Self {
        Self::new(value, None)
    }
}

operators!([] Dependence {
    Add add |a, b| a.with(b, a.value + b.value);
    Sub sub |a, b| a.with(b, a.value - b.value);
    Mul mul |a, b| a.with(b, a.value * b.value);
    Div div |a, b| a.with(b, a.value / b.value);
    Rem rem |a, b| a.with(b, a.value % b.value);
});
number!([] Dependence);

impl Neg for Dependence {
    type Output = Self;
    fn neg(self) -> Self {
        self.map(|v| -v)
    }
}

impl Signed for Dependence {
    fn abs(&self) -> Self {
        self.map(f64::abs)
    }
    fn abs_sub(&self, other: &Self) -> Self {
        (*self - *other).map(|v| v.max(0.0))
    }
    fn signum(&self) -> Self {
        self.map(f64::signum)
    }
    fn is_positive(&self) -> bool {
        self.value.is_sign_positive()
    }
    fn is_negative(&self) -> bool {
        self.value.is_sign_negative()
    }
}

impl Real for Dependence {
    fn value(&self) -> f64 {
        self.value
    }
    functions!(map);

    fn atan2(self, other: Self) -> Self {
        self.with(other, self.value.atan2(other.value))
    }
    fn powi(self, n: i32) -> Self {
        self.map(|v| v.powi(n))
    }
    fn powf(self, p: f64) -> Self {
        self.map(|v| v.powf(p))
    }
    fn joined(self, others: &[Self], label: Option<usize>) -> Self {
        let own = Self::new(self.value, label);
        let labels = others.iter().fold(self.labels, |l, o| join(l, o.labels));
        Self {
            value: self.value,
            labels: join(labels, own.labels),
        }
    }
    fn labels(&self) -> [u64; 4] {
        self.labels
    }
}

/// A function over sets of labels: its arguments, the first index that has a label of its own, and the list of its values.
pub(crate) type Formula<'f> = dyn FnMut(&[Dependence], usize, &mut [Dependence]) + 'f;

/// Which of `indices` things (variables, and what the formula itself labels behind them) each of `count` values depends on at x, as
/// pairs of value and index.
pub(crate) fn structure(
    count: usize,
    indices: usize,
    x: &[f64],
    formula: &mut Formula,
) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    let mut out = vec![Dependence::from(0.0); count];
    for first in (0..indices).step_by(LABELS) {
        let label = |j: usize| j.checked_sub(first).filter(|l| *l < LABELS);
        let arguments = arguments(x, label);
        formula(&arguments, first, &mut out);
        for (i, value) in out.iter().enumerate() {
            let last = (indices - first).min(LABELS);
            let own = members(&value.labels).take_while(|l| *l < last);
            found.extend(own.map(|l| (i, first + l)));
        }
    }
    found
}

fn arguments(x: &[f64], label: impl Fn(usize) -> Option<usize>) -> Vec<Dependence> {
    let labelled = x.iter().enumerate();
    labelled.map(|(j, &v)| Dependence::new(v, label(j))).collect()
}

/// An entry (value, variable) that the formula has at x and the pattern does not. In patterns of very many columns one may be
/// overlooked, with a probability below (entries of the row / 256)⁴.
pub(crate) fn lacking(pattern: &Pattern, x: &[f64], formula: &mut Formula) -> Option<(usize, usize)> {
    if pattern.is_full() {
        return None;
    }
    let windows = x.len().div_ceil(LABELS);
    if windows > EXACT {
        let spread = |j: usize, k: usize| {
            let mixed = (j as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15 ^ (k as u64) << 20 | 1);
            (mixed >> 40) as usize % LABELS
        };
        if (0..SHARED).all(|k| stray_row(pattern, x, 0, &|j| Some(spread(j, k)), formula).is_none()) {
            return None;
        }
    }
    (0..windows).find_map(|w| {
        let first = w * LABELS;
        let label = |j: usize| j.checked_sub(first).filter(|l| *l < LABELS);
        let (row, labels) = stray_row(pattern, x, first, &label, formula)?;
        let label = members(&labels).next()?;
        Some((row, first + label))
    })
}

/// The first value with labels that the columns of its row do not have, and those labels.
fn stray_row(
    pattern: &Pattern,
    x: &[f64],
    first: usize,
    label: &dyn Fn(usize) -> Option<usize>,
    formula: &mut Formula,
) -> Option<(usize, Labels)> {
    let mut known = vec![Labels::default(); pattern.nrows()];
    for j in 0..pattern.ncols() {
        if let Some(l) = label(j) {
            let entries = pattern.col_ptr()[j]..pattern.col_ptr()[j + 1];
            pattern.row_idx()[entries]
                .iter()
                .for_each(|&i| insert(&mut known[i], l));
        }
    }
    let mut out = vec![Dependence::from(0.0); pattern.nrows()];
    formula(&arguments(x, label), first, &mut out);
    out.iter()
        .zip(&known)
        .enumerate()
        .find_map(|(i, (value, known))| {
            let stray: Labels = std::array::from_fn(|k| value.labels[k] & !known[k]);
            (stray != Labels::default()).then_some((i, stray))
        })
}

/// A point in general position near the middle of (0, 1), where roots and logarithms exist.
pub(crate) fn ordinary_point(m: usize) -> Vec<f64> {
    (0..m)
        .map(|j| 0.5 + 0.25 * crate::spread::golden(j + 1))
        .collect()
}
