//! Histories against independent runs: steps by elimination, step lengths by halving, residuals from the formula.

use proptest::prelude::*;
use semismooth::newton::{Convergence, Damping, Newton, NewtonError, NewtonOptions, Step};
use semismooth::piecewise::{PiecewiseSmooth, Selection};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use super::dense::{eliminate, norm};
use super::maps::two_pieces;
use super::problems::{Lcp, Smooth, p_matrix, scalar};

/// min(x, M x + q + c x³).
struct Cubic {
    lcp: Lcp,
    c: f64,
}

impl Cubic {
    fn w(&self, x: &[f64], i: usize) -> f64 {
        self.lcp.w(x, i) + self.c * x[i].powi(3)
    }

    fn selection(&self, x: &[f64]) -> Selection {
        Selection::from_pieces((0..x.len()).map(|i| usize::from(self.w(x, i) < x[i])))
    }

    fn jacobian_rows(&self, s: &Selection, x: &[f64]) -> Vec<Vec<f64>> {
        let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
        let entry = |i: usize, j: usize| match s.piece(i) {
            0 => unit(i, j),
            _ => self.lcp.m[i][j] + 3.0 * self.c * x[i] * x[i] * unit(i, j),
        };
        (0..x.len())
            .map(|i| (0..x.len()).map(|j| entry(i, j)).collect())
            .collect()
    }
}

impl PiecewiseSmooth for Cubic {
    two_pieces!(
        self,
        [positive, negative],
        self.lcp.q.len(),
        self.lcp.q.len(),
        self.lcp.q.len()
    );
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for i in 0..x.len() {
            out[i] = self.w(x, i) - x[i];
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        for i in 0..x.len() {
            out[i] = [x[i], self.w(x, i)][s.piece(i)];
        }
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        for (i, row) in self.jacobian_rows(s, x).iter().enumerate() {
            for (j, v) in row.iter().enumerate().filter(|v| *v.1 != 0.0) {
                jac.add(i, j, *v);
            }
        }
    }
}

fn is_halving(damping: f64) -> bool {
    (0..60).any(|k| damping == 0.5_f64.powi(k))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 64, ..ProptestConfig::default() })]

    /// Up to the first step that is not a Newton step.
    #[test]
    fn entries_are_those_of_newton_steps(
        n in 1..=6_usize,
        entries in prop::collection::vec(-2.0..2.0_f64, 36),
        q in prop::collection::vec(-5.0..5.0_f64, 6),
        start in prop::collection::vec(-5.0..5.0_f64, 6),
        c in prop::sample::select(vec![0.0, 0.3]),
        always in any::<bool>(),
    ) {
        let lcp = Lcp::new(p_matrix(n, &entries, 0.5), q[..n].to_vec());
        let map = Cubic { lcp, c };
        let damping = if always { Damping::Always } else { Damping::OnTrouble };
        let mut newton = Newton::new(NewtonOptions::default().with_damping(damping));
        let mut x = start[..n].to_vec();
        let end = newton.solve(&map, &mut x);
        let report = newton.report();
        let residual = |x: &[f64]| {
            let mut r = vec![0.0; n];
            map.residual(&map.selection(x), x, &mut r);
            r
        };
        let mut here = start[..n].to_vec();
        let mut best = here.clone();
        let mut before = map.selection(&here);
        for (k, entry) in report.history.iter().enumerate() {
            if norm(&residual(&here)) < norm(&residual(&best)) {
                best.clone_from(&here);
            } else if norm(&residual(&here)) > entry.residual_norm * (1.0 + 1e-6) {
                // Before line searches the run returns to the best iterate.
                before = map.selection(&here);
                here.clone_from(&best);
            }
            let (selection, r) = (map.selection(&here), residual(&here));
            let size = 1.0 + norm(&here);
            prop_assert_eq!(entry.index, k);
            prop_assert!((entry.residual_norm - norm(&r)).abs() <= 1e-7 * size);
            prop_assert_eq!((entry.linear_iterations, entry.forcing), (0, 0.0));
            if entry.residual_norm > 1e-6 {
                let changed = (0..n).filter(|&i| selection.piece(i) != before.piece(i)).count();
                prop_assert_eq!(entry.sites_changed, changed);
            }
            if entry.step == Step::None {
                prop_assert_eq!((k + 1, entry.step_norm, entry.damping), (report.history.len(), 0.0, 0.0));
                prop_assert_eq!(entry.rcond, None);
                prop_assert!(end.is_ok() && norm(&minus(&here, &x)) <= 1e-7 * size);
            }
            if entry.step != Step::Newton {
                break;
            }
            prop_assert!(entry.rcond.is_some_and(|r| r > 0.0 && r <= 1.0));
            prop_assert!(is_halving(entry.damping));
            let (_, _, d) = eliminate(&map.jacobian_rows(&selection, &here), &r);
            let d = d.unwrap();
            prop_assert!((entry.step_norm - entry.damping * norm(&d)).abs() <= 1e-6 * size);
            here.iter_mut().zip(&d).for_each(|(x, d)| *x -= entry.damping * d);
            before = selection;
        }
    }
}

pub(super) fn minus(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// f = atan (x − 1): steps and lengths of Armijo's rule, and where tolerances end them.
#[test]
fn a_line_search_halves_until_the_residual_falls_enough() {
    let f = |x: f64| (x - 1.0).atan();
    let df = |x: f64| 1.0 / (1.0 + (x - 1.0).powi(2));
    let map = scalar(f, df);
    let mut halved = 0;
    for armijo in [1e-4, 0.3] {
        for (absolute, relative) in [(0.0, 1e-10), (1e-3, 0.0), (0.0, 1e-4), (0.2, 0.0)] {
            for k in 0..12 {
                let start = 1.7 + 2.3 * f64::from(k);
                let options = NewtonOptions::default()
                    .with_damping(Damping::Always)
                    .with_armijo(armijo)
                    .with_tolerances(absolute, relative);
                let mut newton = Newton::new(options);
                let mut x = [start];
                assert_eq!(newton.solve(&map, &mut x).unwrap(), Convergence::Tolerance);
                let mut here = start;
                let (last, steps) = newton.report().history.split_last().unwrap();
                for entry in steps {
                    let size = (df(here) * here).abs();
                    assert!(f(here).abs() > absolute && f(here).abs() > relative * size);
                    let d = -f(here) / df(here);
                    let mut t = 1.0;
                    while f(here + t * d).abs() > (1.0 - armijo * t) * f(here).abs() {
                        t *= 0.5;
                    }
                    halved += usize::from(t < 1.0);
                    assert_eq!((entry.damping, entry.step), (t, Step::Newton));
                    assert_eq!(entry.rcond, Some(1.0));
                    assert!((entry.step_norm - (t * d).abs()).abs() <= 1e-12 * d.abs());
                    here += t * d;
                }
                assert!((here - x[0]).abs() < 1e-12);
                assert!((last.residual_norm - f(here).abs()).abs() < 1e-12);
                let size = (df(here) * here).abs();
                assert!(f(here).abs() <= absolute.max(relative * size));
                assert_eq!(newton.report().factorisations, steps.len());
            }
        }
    }
    assert!(halved > 100, "{halved}");
}

/// Both rows are x₁ + x₂ minus a number: the step is that of least squares, −(r₁ + r₂)/4 in each variable, and (r₁ − r₂)/√2 is left.
#[test]
fn steps_at_singular_jacobians_are_those_of_least_squares() {
    for (c, r) in [
        ([2.0, 2.0], 0.0),
        ([1.0, 3.0], 2.0_f64.sqrt()),
        ([-5.0, 1.0], 18.0_f64.sqrt()),
    ] {
        let map = Smooth {
            n: 2,
            f: |x: &[f64], out: &mut [f64]| {
                out[0] = x[0] + x[1] - c[0];
                out[1] = x[0] + x[1] - c[1];
            },
            j: |_: &[f64], jac: &mut Matrix| {
                for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    jac.add(i, j, 1.0);
                }
            },
        };
        let start = [7.0, 0.5];
        let d = -((7.5 - c[0]) + (7.5 - c[1])) / 4.0;
        let mut newton = Newton::default();
        let mut x = start;
        let end = newton.solve(&map, &mut x);
        let report = newton.report();
        assert!((x[0] - start[0] - d).abs() < 1e-13 && (x[1] - start[1] - d).abs() < 1e-13);
        let first = report.history[0];
        assert_eq!((first.step, first.damping), (Step::Gradient, 1.0));
        assert!((first.step_norm - (2.0 * d * d).sqrt()).abs() < 1e-13);
        assert_eq!(report.history.len(), 2);
        assert!((report.residual_norm() - r).abs() < 1e-13);
        match end {
            Ok(_) => assert_eq!(r, 0.0),
            Err(NewtonError::Failed(u)) => {
                assert!(
                    matches!(u.status, Status::Stationary { gradient_norm } if gradient_norm < 1e-12),
                    "{:?}",
                    u.status
                );
                assert!(r > 0.0 && (u.residual_norm - r).abs() < 1e-13 && u.x == x);
            }
            Err(e) => panic!("{e}"),
        }
    }
}
