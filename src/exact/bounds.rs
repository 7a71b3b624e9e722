use super::Exact;

/// Bounds of |y_k| for all y with Σ y_k (L y + l)_k ≤ 0, where the symmetric part of L is positive definite; `None` where floating-point
/// arithmetic does not prove that it is. Rows are given as the constant l_k and the coefficients.
///
/// With units that make the diagonal one, μ = D⁻¹y, λ_min ‖μ‖² ≤ μᵀ(D L D)μ ≤ ‖D l‖ ‖μ‖. That λ_min > s − rounding is shown by a Cholesky
/// factorisation of the matrix less s that runs to its end (Rump, BIT 46, 2006).
pub(crate) fn passive_bounds(rows: &[(&Exact, &[Exact])]) -> Option<Vec<Exact>> {
    let q = rows.len();
    let halved = |k: usize| -> Option<i64> {
        let diagonal = &rows[k].1[k];
        let magnitude = diagonal.magnitude().filter(|_| diagonal.sign() > 0)?;
        Some(-magnitude.div_euclid(2))
    };
    let units: Vec<i64> = (0..q).map(halved).collect::<Option<_>>()?;
    let entry = |i: usize, j: usize| rows[i].1[j].scaled(units[i] + units[j]);
    let mut symmetric = vec![0.0; q * q];
    let mut trace = 0.0;
    for i in 0..q {
        for j in 0..=i {
            symmetric[i * q + j] = 0.5 * (entry(i, j) + entry(j, i));
        }
        trace += symmetric[i * q + i];
    }
    let n = q as f64;
    let rounding = 2.0 * (n + 4.0) * f64::EPSILON * (trace + n * max_abs(&symmetric));
    let shift = (1..40).map(|k| f64::powi(2.0, -k)).find(|s| {
        let mut factor = symmetric.clone();
        s * 0.25 > rounding && cholesky(&mut factor, q, *s)
    })?;
    let loads = || rows.iter().zip(&units);
    let largest = loads().filter_map(|(r, d)| r.0.magnitude().map(|m| m + d)).max();
    let Some(largest) = largest else {
        return Some(vec![Exact::default(); q]);
    };
    let load: f64 = loads().map(|(r, d)| r.0.scaled(d - largest).powi(2)).sum();
    let bound = Exact::new(1.001 * load.sqrt() / (0.5 * shift))?;
    Some(units.iter().map(|d| bound.clone().shifted(d + largest)).collect())
}

fn max_abs(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Whether the Cholesky factorisation of the lower triangle less `shift` runs to its end.
fn cholesky(a: &mut [f64], n: usize, shift: f64) -> bool {
    for j in 0..n {
        for i in j..n {
            let mut sum = a[i * n + j] - if i == j { shift } else { 0.0 };
            for k in 0..j {
                sum -= a[i * n + k] * a[j * n + k];
            }
            if i > j {
                a[i * n + j] = sum / a[j * n + j];
            } else if sum > 0.0 && sum.is_finite() {
                a[j * n + j] = sum.sqrt();
            } else {
                return false;
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Diagonal entries 1, all others 1 − d, so that d is the least eigenvalue; the loads are 1.
    fn bounds(n: usize, d: f64) -> Option<Vec<Exact>> {
        let exact = |v: f64| Exact::new(v).unwrap();
        let entry = |i: usize, j: usize| exact(if i == j { 1.0 } else { 1.0 - d });
        let rows: Vec<(Exact, Vec<Exact>)> = (0..n)
            .map(|i| (exact(1.0), (0..n).map(|j| entry(i, j)).collect()))
            .collect();
        let rows: Vec<_> = rows.iter().map(|(l, r)| (l, r.as_slice())).collect();
        passive_bounds(&rows)
    }

    /// Σ y_k (L y + l)_k ≤ 0 holds for y = −t e_0 with t ≤ 1, and for nothing beyond ‖l‖/d.
    #[test]
    fn bounds_hold_what_is_passive() {
        for (n, d) in [(1, 1.0), (3, 0.5), (40, 1e-3), (60, 1e-6)] {
            let found = bounds(n, d).unwrap();
            let most = (n as f64).sqrt() / d;
            assert!(
                found
                    .iter()
                    .all(|b| b.scaled(0) >= 1.0 && b.scaled(0) <= 5.0 * most),
                "{n} {d}"
            );
        }
        // y = (1, −1) t: 2 d t² may not exceed the loads' work 2 t.
        let exact = |v: f64| Exact::new(v).unwrap();
        let l = [exact(-1.0), exact(1.0)];
        let rows = [[exact(1.0), exact(0.5)], [exact(0.5), exact(1.0)]];
        let found = passive_bounds(&[(&l[0], &rows[0]), (&l[1], &rows[1])]).unwrap();
        assert!(found.iter().all(|b| b.scaled(0) >= 2.0));
    }

    /// A factorisation that succeeds bounds an eigenvalue only up to its rounding errors, at most (n + 4) n ε times the trace here.
    #[test]
    fn eigenvalues_below_rounding_prove_nothing() {
        assert!(bounds(120, 1e-8).is_some());
        for d in [5e-12, 3e-12, 0.0, -1e-12] {
            assert!(bounds(120, d).is_none(), "{d:e}");
        }
    }
}
