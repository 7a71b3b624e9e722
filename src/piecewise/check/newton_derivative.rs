//! Newton derivatives of semismooth maps against their values.

use super::derivatives::Quotients;
use super::session::steps;
use super::{CheckError, CheckOptions, Finding, FindingKind};
use crate::InputError;
use crate::input::check_vector;
use crate::piecewise::Semismooth;
use crate::sparse::Matrix;
use crate::spread::Random;
use crate::tolerances::CENTRAL;

/// Directions tried at a sample.
const DIRECTIONS: usize = 8;
/// Distances: from 2⁻⁶ to 2⁻²⁰ of the sizes of the variables.
const HALVINGS: std::ops::RangeInclusive<i32> = 6..=20;
/// Ratio of the steps of two difference quotients that are to agree.
const FINER: f64 = 8.0;
/// A remainder below this multiple of the rounding of its terms is not used.
const NOISE: f64 = 30.0;
/// Smallest number of distances that determine an order.
const FEWEST: usize = 4;
/// Orders below this one, measured over few distances, are none.
const NO_ORDER: f64 = 0.1;

/// See [`check_semismooth`](super::check_semismooth).
pub(super) fn check_map(
    map: &dyn Semismooth,
    samples: &[Vec<f64>],
    options: &CheckOptions,
) -> Result<Vec<Option<f64>>, CheckError> {
    options.validate()?;
    let n = map.num_vars();
    for (point, x) in samples.iter().enumerate() {
        check_vector("the point", x, n).map_err(|source| CheckError::Sample { point, source })?;
    }
    if samples.is_empty() {
        return Err(CheckError::NoSamples { outside: 0 });
    }
    let pattern = map.pattern();
    if (pattern.nrows(), pattern.ncols()) != (n, n) {
        let source = InputError::Length {
            what: "the declared pattern (rows times columns)",
            expected: n * n,
            found: pattern.nrows() * pattern.ncols(),
        };
        return Err(CheckError::Sample { point: 0, source });
    }
    let mut check = Check {
        map,
        options,
        steps: steps(samples, n),
        jac: Matrix::zeros(pattern),
        findings: Vec::new(),
    };
    let mut orders = Vec::new();
    for (point, x) in samples.iter().enumerate() {
        orders.push(check.point(point, x));
        if check.findings.len() >= options.max_findings {
            break;
        }
    }
    match check.findings.is_empty() {
        true => Ok(orders),
        false => Err(CheckError::Findings(check.findings)),
    }
}

struct Check<'a> {
    map: &'a dyn Semismooth,
    options: &'a CheckOptions,
    steps: Vec<f64>,
    jac: Matrix,
    findings: Vec<Finding>,
}

impl Check<'_> {
    fn value(&self, x: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; x.len()];
        self.map.residual(x, &mut out);
        out
    }

    fn jacobian(&mut self, x: &[f64]) {
        self.jac.clear();
        self.map.jacobian(x, &mut self.jac);
    }

    fn find(
        &mut self,
        kind: FindingKind,
        point: usize,
        entry: Option<(usize, usize)>,
        (expected, found): (f64, f64),
        what: String,
    ) {
        let known = self
            .findings
            .iter()
            .any(|f| f.kind == kind && f.entry == entry && f.what == what);
        if !known && self.findings.len() < self.options.max_findings {
            self.findings.push(Finding {
                kind,
                point: Some(point),
                site: None,
                piece: None,
                entry,
                expected,
                found,
                what,
            });
        }
    }

    /// The checks at a sample; returns the order found there.
    fn point(&mut self, point: usize, x: &[f64]) -> Option<f64> {
        let here = self.value(x);
        self.jacobian(x);
        if let Some(i) = here.iter().position(|v| !v.is_finite()) {
            self.find(
                FindingKind::NotFinite,
                point,
                None,
                (0.0, here[i]),
                format!("residual {i}"),
            );
            return None;
        }
        let entry = self.jac.triplets().find(|t| !t.2.is_finite());
        if let Some((i, j, v)) = entry {
            self.find(
                FindingKind::NotFinite,
                point,
                Some((i, j)),
                (0.0, v),
                "Newton derivative".into(),
            );
            return None;
        }
        let mut random = Random::new(2 * point as u64 + 1);
        let directions: Vec<Vec<f64>> = (0..DIRECTIONS)
            .map(|_| {
                self.steps
                    .iter()
                    .map(|s| s / CENTRAL * random.symmetric())
                    .collect()
            })
            .collect();
        for d in &directions {
            let largest = (-f64::from(*HALVINGS.start())).exp2();
            self.entries(point, &moved(x, d, largest));
        }
        // Consequences of wrong entries are not reported again.
        let wrong: Vec<usize> = self
            .findings
            .iter()
            .filter_map(|f| f.entry)
            .map(|e| e.0)
            .collect();
        self.orders(point, x, &here, &directions, &wrong)
    }

    /// Entries of the derivative at a point in general position, where the map is differentiable.
    fn entries(&mut self, point: usize, y: &[f64]) {
        let n = y.len();
        let coarse = self.steps.clone();
        let fine: Vec<f64> = coarse.iter().map(|h| h / FINER).collect();
        let quotients = [&coarse, &fine].map(|steps| (steps, Quotients::new(n, y, steps, |z| self.value(z))));
        self.jacobian(y);
        if let Some(entry) = self.jac.stray() {
            // A missing entry is reported once.
            let what = "Newton derivative".to_owned();
            self.find(FindingKind::StrayEntry, point, Some(entry), (0.0, 1.0), what);
            return;
        }
        if !quotients.iter().all(|q| q.1.is_finite()) {
            return;
        }
        let tolerance = self.options.tolerance;
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let value = self.jac.get(i, j);
            let [(quotient, error), other] = quotients.each_ref().map(|(steps, q)| {
                let (quotient, error) = q.get(i, j);
                (quotient, error + 8.0 * f64::EPSILON * q.row_size(i, y) / steps[j])
            });
            // NaN does not agree.
            let agree =
                |a: f64, b: f64, error: f64| (a - b).abs() <= tolerance * a.abs().max(b.abs()) + error;
            // The quotients of steps that are too long for the map disagree and are not used.
            let resolved = agree(quotient, other.0, error + other.1);
            if resolved && !agree(value, quotient, error) {
                let what = "entry of the Newton derivative next to the sample".to_owned();
                self.find(
                    FindingKind::Jacobian,
                    point,
                    Some((i, j)),
                    (quotient, value),
                    what,
                );
            }
        }
    }

    /// The least order of the rows, from how fast the remainders fall.
    fn orders(
        &mut self,
        point: usize,
        x: &[f64],
        here: &[f64],
        directions: &[Vec<f64>],
        wrong: &[usize],
    ) -> Option<f64> {
        // Of each row: ln t, ln of the largest remainder over t, the size of the terms; from large t to small.
        let mut seen: Vec<Vec<(f64, f64, f64)>> = vec![Vec::new(); x.len()];
        let mut blind = vec![false; x.len()];
        for k in HALVINGS {
            let t = (-f64::from(k)).exp2();
            let mut largest = vec![(0.0_f64, 0.0_f64, 0.0_f64); x.len()];
            for d in directions {
                let y = moved(x, d, t);
                let there = self.value(&y);
                self.jacobian(&y);
                self.remainders(x, &y, here, &there, &mut largest);
            }
            for (row, (remainder, noise, terms)) in largest.into_iter().enumerate() {
                if remainder > NOISE * noise {
                    let point = (t.ln(), (remainder / t).ln(), (terms / t).ln());
                    seen[row].extend((!blind[row]).then_some(point));
                } else {
                    // Remainders that rise again below the noise level are noise.
                    blind[row] = !seen[row].is_empty();
                }
            }
        }
        let mut least = None::<f64>;
        for (row, seen) in seen.iter().enumerate() {
            let tail = &seen[seen.len() / 2..];
            if tail.len() < FEWEST {
                continue;
            }
            let order = slope(tail);
            least = Some(least.map_or(order, |l| l.min(order)));
            let (_, ratio, terms) = tail[tail.len() - 1];
            let stays = ratio - terms > self.options.tolerance.ln();
            if order < NO_ORDER && stays && !blind[row] && !wrong.contains(&row) {
                let what = format!("‖H(x + d) − H(x) − J(x + d) d‖ / ‖d‖ in row {row}");
                self.find(FindingKind::Semismooth, point, None, (0.0, ratio.exp()), what);
            }
        }
        least
    }

    /// |H(y) − H(x) − J(y) (y − x)| of each row, with the rounding and the size of its terms, where it is larger than what is known.
    fn remainders(&self, x: &[f64], y: &[f64], here: &[f64], there: &[f64], largest: &mut [(f64, f64, f64)]) {
        let mut sums: Vec<(f64, f64, f64)> = (here.iter().zip(there))
            .map(|(a, b)| (b - a, a.abs() + b.abs(), 0.0))
            .collect();
        for (i, j, v) in self.jac.triplets() {
            let term = v * (y[j] - x[j]);
            sums[i].0 -= term;
            sums[i].1 += (v * y[j]).abs();
            sums[i].2 += term.abs();
        }
        for ((remainder, size, terms), largest) in sums.into_iter().zip(largest) {
            // NaN is skipped.
            if remainder.abs() >= largest.0 && remainder.is_finite() {
                *largest = (remainder.abs(), f64::EPSILON * size, terms);
            }
        }
    }
}

fn moved(x: &[f64], d: &[f64], t: f64) -> Vec<f64> {
    x.iter().zip(d).map(|(x, d)| x + t * d).collect()
}

/// Slope of the least-squares line.
fn slope(points: &[(f64, f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let (mean_t, mean_r) = (
        points.iter().map(|p| p.0).sum::<f64>() / count,
        points.iter().map(|p| p.1).sum::<f64>() / count,
    );
    let products = points
        .iter()
        .map(|p| (p.0 - mean_t) * (p.1 - mean_r))
        .sum::<f64>();
    products / points.iter().map(|p| (p.0 - mean_t).powi(2)).sum::<f64>()
}
