//! Easy problems on which a globalisation can fail; the first strategy solves them.

use semismooth::complementarity::{Autodiff, Mcp, McpOptions, McpReport, McpSolver, SmoothFunction};
use semismooth::piecewise::Real;

use crate::support::{INF, residual, scalar};

fn first_strategy<F: semismooth::complementarity::McpFunction>(
    problem: &Mcp<F>,
    start: &[f64],
) -> (Vec<f64>, McpReport) {
    let mut x = start.to_vec();
    let mut solver = McpSolver::new(McpOptions::default().with_fallbacks(false));
    let report = solver.solve(problem, &mut x).unwrap().clone();
    assert!(report.is_solved(), "{} from {start:?} at {x:?}", report.status);
    assert!(residual(problem, &x) <= 1e-9);
    (x, report)
}

/// KKT system of min (x + 10 y)² + (x − 2)⁴ subject to x + y ≥ 1, x² + y² ≤ 5, x, y ≥ 0.
struct Quartic;

impl SmoothFunction for Quartic {
    fn num_vars(&self) -> usize {
        4
    }

    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        let (a, b, p, q) = (x[0], x[1], x[2], x[3]);
        let two = T::from(2.0);
        out[0] = two * (a + b * T::from(10.0)) + T::from(4.0) * (a - two).powi(3) - p + two * a * q;
        out[1] = T::from(20.0) * (a + b * T::from(10.0)) - p + two * b * q;
        out[2] = a + b - T::one();
        out[3] = T::from(5.0) - a * a - b * b;
    }
}

#[test]
fn a_step_undone_by_the_projection_is_none() {
    // From 0 the steps of the natural map lead to (1, 0, 0, 0), where the multiplier of the first constraint is at a tie and its
    // step leads out of the bounds.
    let problem = Mcp::ncp(Autodiff::new(Quartic)).unwrap();
    for start in [[0.0; 4], [1.0; 4], [3.0, 1.0, 0.0, 0.0]] {
        let (x, report) = first_strategy(&problem, &start);
        // With y = 0 and no constraint active: x + 2 (x − 2)³ = 0.
        assert!((x[0] + 2.0 * (x[0] - 2.0).powi(3)).abs() < 1e-9 && x[1..] == [0.0; 3]);
        assert!(report.iterations <= 20, "{}", report.iterations);
    }
}

/// KKT system of Hock and Schittkowski (1981), problem 71.
pub(crate) struct Hs71;

impl SmoothFunction for Hs71 {
    fn num_vars(&self) -> usize {
        6
    }

    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        let (a, b, c, d, p, e) = (x[0], x[1], x[2], x[3], x[4], x[5]);
        let two = T::from(2.0);
        out[0] = d * (two * a + b + c) - p * b * c * d - two * e * a;
        out[1] = a * d - p * a * c * d - two * e * b;
        out[2] = a * d + T::one() - p * a * b * d - two * e * c;
        out[3] = a * (a + b + c) - p * a * b * c - two * e * d;
        out[4] = a * b * c * d - T::from(25.0);
        out[5] = a * a + b * b + c * c + d * d - T::from(40.0);
    }
}

#[test]
fn huge_multipliers_do_not_hide_in_the_scaling() {
    let lower = vec![1.0, 1.0, 1.0, 1.0, 0.0, -INF];
    let upper = vec![5.0, 5.0, 5.0, 5.0, INF, INF];
    let problem = Mcp::new(Autodiff::new(Hs71), lower, upper).unwrap();
    for start in [[1.0, 5.0, 5.0, 1.0, 0.0, 0.0], [1.0; 6], [10.0; 6], [0.0; 6]] {
        let (x, _) = first_strategy(&problem, &start);
        // There are KKT points with and without the first constraint active.
        assert!((x[..4].iter().map(|v| v * v).sum::<f64>() - 40.0).abs() < 1e-8);
        assert!(x[..4].iter().product::<f64>() > 25.0 - 1e-8);
    }
}

#[test]
fn overlong_nonmonotone_steps_lead_back_to_the_best_point() {
    // Newton's method for x/√(1 + x²) maps x to −x³: after two full steps no line search recovers.
    for start in [1.5, 2.0, -3.0, 5.0] {
        let f = scalar(|x| x / (1.0 + x * x).sqrt(), |x| (1.0 + x * x).powf(-1.5));
        let problem = Mcp::new(f, vec![-INF], vec![INF]).unwrap();
        let (x, _) = first_strategy(&problem, &[start]);
        assert!(x[0].abs() < 1e-9);
    }
}

/// ln(x/(w − x)) from x = 0, where it is not finite: a domain of any width w is entered, and x = w/2 is found.
#[test]
fn domains_of_any_width_are_entered() {
    for w in [1e-5, 1e-4, 1e-2, 1.0, 100.0] {
        let function = scalar(move |x| (x / (w - x)).ln(), move |x| x.recip() + (w - x).recip());
        let problem = Mcp::new(function, vec![0.0], vec![INF]).unwrap();
        let mut x = [0.0];
        let mut solver = McpSolver::default();
        let report = solver.solve(&problem, &mut x).unwrap();
        assert!(report.is_solved(), "{w:e}: {}", report.status);
        assert!((x[0] - 0.5 * w).abs() <= 1e-9 * w, "{w:e}: {x:?}");
    }
}
