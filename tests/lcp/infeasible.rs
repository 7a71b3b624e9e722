//! Problems whose conditions contradict each other: refuted, with multipliers, before long searches.

use super::random::Random;
use semismooth::complementarity::{Lcp, McpSolver};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

/// Whether vᵀ(M z + q) < 0 for all z within the bounds though v is such that it is not negative at solutions,
/// up to rounding.
fn refutes(lcp: &Lcp, v: &[f64]) -> bool {
    let n = lcp.len();
    let (mut sum, mut size) = (0.0, 0.0);
    for (v, q) in v.iter().zip(lcp.q()) {
        (sum, size) = (sum + v * q, size + (v * q).abs());
    }
    let (mut slopes, mut terms) = (vec![0.0; n], vec![0.0; n]);
    for (i, j, a) in lcp.matrix().triplets() {
        slopes[j] += v[i] * a;
        terms[j] += (v[i] * a).abs();
    }
    for j in 0..n {
        let (lower, upper) = (lcp.lower()[j], lcp.upper()[j]);
        let way = match (lower.is_finite(), upper.is_finite()) {
            (true, true) => v[j] == 0.0,
            (true, false) => v[j] >= 0.0,
            (false, true) => v[j] <= 0.0,
            (false, false) => true,
        };
        let bound = if slopes[j] > 0.0 { upper } else { lower };
        if !way || bound.is_infinite() && slopes[j].abs() > 1e-10 * terms[j] {
            return false;
        }
        if bound.is_finite() {
            (sum, size) = (sum + slopes[j] * bound, size + (slopes[j] * bound).abs());
        }
    }
    sum < -1e-12 * size
}

/// Stocks that run out: prices grow by a part in each period and would have to exceed what the last allows.
/// No conditions on signs alone contradict each other: all active sets are ruled out, in a search of few
/// nodes.
fn stocks(periods: usize, growth: f64, slope: f64) -> Lcp {
    let n = 3 * periods;
    let mut entries = Vec::new();
    let mut q = vec![0.0; n];
    for i in 0..periods {
        let (sold, price, left) = (i, periods + i, 2 * periods + i);
        entries.extend([(sold, price, 1.0), (sold, sold, slope), (price, price, growth)]);
        q[sold] = -50.0;
        match i + 1 < periods {
            true => entries.push((price, price + 1, -1.0)),
            false => q[price] = -50.0 * growth,
        }
        entries.extend([(left, left, -1.0), (left, sold, -1.0)]);
        match i {
            0 => q[left] = 0.5,
            _ => entries.push((left, left - 1, 1.0)),
        }
    }
    Lcp::new(Matrix::from_triplets(n, n, &entries).unwrap(), q).unwrap()
}

#[test]
fn stocks_that_run_out_are_refuted_at_once() {
    for periods in [10, 20, 40] {
        let lcp = stocks(periods, 1.05, 0.1);
        let mut x = vec![0.0; lcp.len()];
        let mut solver = McpSolver::default();
        let report = solver.solve(lcp.mcp(), &mut x).unwrap();
        assert_eq!(report.status, Status::NoSolution, "{periods}: {report}");
        let tried = report.fallbacks.len();
        assert!(
            lcp.len() <= 24 || report.iterations < 1000 && tried <= 3,
            "{periods}: {tried} {report}"
        );
        assert!(
            report.certificate.is_empty() || refutes(&lcp, &report.certificate),
            "{report:?}"
        );
    }
}

/// M and q with v ≥ 0 planted such that Mᵀv ≤ 0 and qᵀv < 0: sparse and full, with bounds of all kinds, in
/// units far apart.
#[test]
fn planted_contradictions_are_found() {
    let mut random = Random::new(31);
    let mut refuted = 0;
    for k in 0..60 {
        let n = 4 + random.below(if k % 10 == 0 { 90 } else { 20 });
        let full = k % 2 == 0;
        let mut v: Vec<f64> = (0..n).map(|_| random.symmetric().max(0.0)).collect();
        v[n - 1] = 1.0;
        let mut rows: Vec<Vec<f64>> = (0..n)
            .map(|_| {
                let entry = |random: &mut Random| match full || random.below(4) == 0 {
                    true => random.symmetric(),
                    false => 0.0,
                };
                (0..n).map(|_| entry(&mut random)).collect()
            })
            .collect();
        for j in 0..n {
            let others: f64 = (0..n - 1).map(|i| rows[i][j] * v[i]).sum();
            rows[n - 1][j] = -others - 0.1 * random.unit();
        }
        let mut q = random.vector(n, 1.0);
        q[n - 1] = -(0..n - 1).map(|i| q[i] * v[i]).sum::<f64>() - 0.1;
        let units: Vec<f64> = (0..n)
            .map(|_| (20.0 * random.symmetric()).round().exp2())
            .collect();
        if k % 3 == 0 {
            for i in 0..n {
                rows[i].iter_mut().for_each(|a| *a *= units[i]);
                q[i] *= units[i];
            }
        }
        let (mut lower, mut upper) = (vec![0.0; n], vec![f64::INFINITY; n]);
        if k % 4 == 0 {
            // A bound from above on an unknown, whose row then may have any sign: v is 0 there.
            for i in (0..n).filter(|&i| v[i] == 0.0).take(2) {
                (lower[i], upper[i]) = (0.0, 1.0);
            }
        }
        let lcp = Lcp::boxed(Matrix::from_rows(&rows).unwrap(), q, lower, upper).unwrap();
        let mut x = vec![0.0; n];
        let mut solver = McpSolver::default();
        let report = solver.solve(lcp.mcp(), &mut x).unwrap();
        assert_eq!(report.status, Status::NoSolution, "{k}: {report}");
        let certified = refutes(&lcp, &report.certificate);
        assert!(
            certified || report.fallbacks.len() > 2,
            "{k}: {:?}",
            report.certificate
        );
        refuted += usize::from(report.fallbacks.len() <= 2);
    }
    assert!(refuted >= 59, "{refuted}");
}
