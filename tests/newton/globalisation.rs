//! The line search, its tolerance of growth, and the least-index rule: what they must solve, and what they must not take for a solution.

use std::ops::ControlFlow;

use semismooth::newton::{Damping, Newton, NewtonError, NewtonOptions, Step};
use semismooth::piecewise::{PiecewiseSmooth, Selection};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use crate::maps::two_pieces;
use crate::problems::{Lcp, Smooth, close, cycling, scalar};

/// x − 1 = 0 with the slope 5/2 instead of 1: each step leaves 3/5 of the error, so that steps are small long before the residual is.
#[test]
fn slow_convergence_is_followed_to_its_end() {
    let map = scalar(|x| x - 1.0, |_| 2.5);
    for start in [1.0 + 1e-6, 1.0 - 1e-8] {
        let mut x = [start];
        Newton::default().solve(&map, &mut x).unwrap();
        // 1e-13 of the term 2.5 x.
        assert!((x[0] - 1.0).abs() <= 2.5e-13, "{start}: {:e}", x[0] - 1.0);
    }
}

/// arctan (x − y) = 0, whose full steps diverge, beside (x + y)⁵ = 1, for which they are right: the line search takes both into account, in
/// any units.
#[test]
fn a_row_in_large_units_does_not_hide_another_from_the_line_search() {
    for unit in [1e-12, 1.0, 1e6, 1e12] {
        let map = Smooth {
            n: 2,
            f: |x: &[f64], out: &mut [f64]| {
                out[0] = (x[0] - x[1]).atan();
                out[1] = unit * ((x[0] + x[1]).powi(5) - 1.0);
            },
            j: |x: &[f64], jac: &mut Matrix| {
                let (s, t) = (x[0] - x[1], x[0] + x[1]);
                for (j, sign) in [1.0, -1.0].into_iter().enumerate() {
                    jac.add(0, j, sign / (1.0 + s * s));
                    jac.add(1, j, 5.0 * unit * t.powi(4));
                }
            },
        };
        let mut x = [7.5, 2.5];
        let options = NewtonOptions::default().with_damping(Damping::Always);
        Newton::new(options).solve(&map, &mut x).unwrap();
        assert!(close(&x, &[0.5, 0.5], 1e-12), "{unit:e}: {x:?}");
    }
}

/// A run that cycles and is stopped by its observer returns the point of least residual, not the last one.
#[test]
fn a_run_that_is_stopped_gives_its_best_point() {
    let lcp = cycling();
    let norm = |x: &[f64]| {
        let h = (0..3).map(|i| x[i].min(lcp.w(x, i)));
        h.map(|h| h * h).sum::<f64>().sqrt()
    };
    let mut grown = 0;
    for k in 0..8_u32 {
        for last in 1..6 {
            let mut x: Vec<f64> = (0..3).map(|i| if k >> i & 1 == 1 { 2.0 } else { 0.0 }).collect();
            let start = norm(&x);
            let options = NewtonOptions::default().with_damping(Damping::Never);
            let mut newton = Newton::new(options);
            let stopped = newton.solve_observed(&lcp, &mut x, |i| match i.index == last {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            });
            let Err(NewtonError::Failed(failed)) = stopped else {
                continue;
            };
            assert_eq!(failed.status, Status::Interrupted);
            let history = failed.report.history.iter().map(|i| i.residual_norm);
            let least = history.fold(start, f64::min);
            assert!(norm(&x) <= least, "{k} {last}: {} after {least}", norm(&x));
            assert!((norm(&x) - failed.residual_norm).abs() <= 1e-15 * start);
            grown += usize::from(failed.report.history[last].residual_norm > least);
        }
    }
    assert!(grown > 0, "no run has been stopped where the residual was larger");
}

/// A skew matrix with 1 on its diagonal, row by row above it: a P-matrix.
fn skew(n: usize, above: &[f64], q: &[f64]) -> Lcp {
    let mut m = vec![vec![0.0; n]; n];
    let mut entries = above.iter();
    for i in 0..n {
        m[i][i] = 1.0;
        for j in i + 1..n {
            m[i][j] = *entries.next().unwrap();
            m[j][i] = -m[i][j];
        }
    }
    Lcp::new(m, q.to_vec())
}

/// Where a line search changes pieces back and forth with ever shorter steps, the least-index rule ends at the solution.
#[test]
fn a_line_search_without_progress_gives_way() {
    let lcp = skew(4, &[15.0, 18.0, -15.0, 15.0, 24.0, 6.0], &[3.0, -5.0, 2.0, 3.0]);
    let mut x = [-2.0, 4.0, -2.0, -1.0];
    Newton::default().solve(&lcp, &mut x).unwrap();
    let exact = lcp.enumerate();
    assert!(exact.len() == 1 && close(&x, &exact[0], 1e-12), "{x:?} {exact:?}");
}

/// The least-index rule changes one piece at a time, also where the search for a solution has evaluated other pieces.
#[test]
fn the_least_index_rule_takes_its_time() {
    let problems = [
        (
            [3.0, 12.0, -24.0, 15.0, -12.0, 18.0],
            [-4.0, 0.0, -1.0, 0.0],
            [0.0, -2.0, 0.0, 3.0],
        ),
        (
            [-21.0, -18.0, -6.0, 12.0, 15.0, -21.0],
            [-4.0, 5.0, 1.0, 4.0],
            [0.0, 0.0, 3.0, -4.0],
        ),
        (
            [6.0, 12.0, -6.0, 9.0, -18.0, -9.0],
            [-5.0, -1.0, -2.0, 1.0],
            [2.0, -1.0, 1.0, 1.0],
        ),
    ];
    for (above, q, mut x) in problems {
        let lcp = skew(4, &above, &q);
        let mut newton = Newton::default();
        newton.solve(&lcp, &mut x).unwrap();
        assert!(close(&x, &lcp.enumerate()[0], 1e-12), "{above:?} {x:?}");
        let steps = newton.report().history.iter();
        assert!(
            steps
                .filter(|i| i.step == Step::LeastIndex)
                .all(|i| i.sites_changed <= 1)
        );
    }
}

/// A growing residual alone is no failure: where full steps do not revisit a selection, no line search starts.
#[test]
fn growth_alone_starts_no_line_search() {
    let problems = [
        ([21.0, 12.0, -12.0], [1.0, -2.0, -1.0], [-2.0, -2.0, -2.0]),
        ([-3.0, -18.0, 24.0], [-3.0, 5.0, -3.0], [4.0, 4.0, -1.0]),
        ([-12.0, 12.0, -3.0], [5.0, 2.0, -4.0], [0.0, 0.0, -2.0]),
        ([18.0, -21.0, -12.0], [-4.0, 1.0, 1.0], [0.0, -1.0, -1.0]),
    ];
    for (above, q, start) in problems {
        let lcp = skew(3, &above, &q);
        let mut undamped = Newton::new(NewtonOptions::default().with_damping(Damping::Never));
        let (mut x, mut y) = (start, start);
        undamped.solve(&lcp, &mut x).unwrap();
        let mut newton = Newton::default();
        newton.solve(&lcp, &mut y).unwrap();
        let history = &newton.report().history;
        assert!(
            history
                .windows(2)
                .any(|w| w[1].residual_norm > w[0].residual_norm)
        );
        assert_eq!((y, history), (x, &undamped.report().history), "{above:?}");
    }
}

/// An [`Lcp`] in the unknowns 1, 2, … with a first site whose two pieces are the same function, 3 x₀ = c Σ xᵢ: the place of its kink is a
/// matter of rounding.
struct WithNoise(Lcp, f64);

impl WithNoise {
    fn noisy(&self, x: &[f64]) -> [f64; 2] {
        let sum: f64 = x[1..].iter().sum();
        [3.0 * x[0] - self.1 * sum, 3.0 * (x[0] - self.1 / 3.0 * sum)]
    }
}

impl PiecewiseSmooth for WithNoise {
    two_pieces!(
        self,
        [positive, negative],
        self.0.q.len() + 1,
        self.num_vars(),
        self.num_vars()
    );
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        let [a, b] = self.noisy(x);
        out[0] = b - a;
        self.0.test_functions(&x[1..], &mut out[1..]);
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        out[0] = self.noisy(x)[s.piece(0)];
        let rest = Selection::from_pieces(s.pieces().skip(1));
        self.0.residual(&rest, &x[1..], &mut out[1..]);
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, 3.0);
        for i in 1..x.len() {
            jac.add(0, i, -self.1);
            match s.piece(i) {
                0 => jac.add(i, i, 1.0),
                _ => (1..x.len()).for_each(|j| jac.add(i, j, self.0.m[i - 1][j - 1])),
            }
        }
    }
}

/// The least-index rule examines one site at a time; that this one is solved says nothing about the others.
#[test]
fn a_site_that_changes_by_rounding_does_not_end_the_least_index_rule() {
    let problems = [
        ([15.0, 15.0, 21.0], [-1.0, 2.0, 4.0], [2.0, 3.0, -4.0]),
        ([-6.0, 6.0, -24.0], [-2.0, -4.0, -3.0], [-2.0, -1.0, 3.0]),
        ([9.0, -15.0, -9.0], [1.0, 5.0, -4.0], [-2.0, -2.0, -2.0]),
        ([18.0, -9.0, -6.0], [2.0, 5.0, -1.0], [1.0, -4.0, -2.0]),
        ([-18.0, -9.0, -18.0], [5.0, 4.0, -1.0], [-4.0, -2.0, -4.0]),
    ];
    let mut solved_one_by_one = 0;
    for (above, q, start) in problems {
        for k in 1..64 {
            let map = WithNoise(skew(3, &above, &q), f64::from(k) / 7.0);
            let mut x = [0.0, start[0], start[1], start[2]];
            let mut newton = Newton::default();
            // Some runs cycle between the pieces of the first site, and report it.
            if newton.solve(&map, &mut x).is_ok() {
                assert!(
                    close(&x[1..], &map.0.enumerate()[0], 1e-11),
                    "{above:?} {k}: {x:?}"
                );
                let steps = &newton.report().history;
                solved_one_by_one += usize::from(steps.iter().any(|i| i.step == Step::LeastIndex));
            }
        }
    }
    assert!(solved_one_by_one > 10, "{solved_one_by_one}");
}
