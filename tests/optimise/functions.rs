//! Functions of parameters alone, with stationary points in closed form.

use std::ops::ControlFlow;

use semismooth::Cause;
use semismooth::optimise::{Bundle, BundleOptions, BundleReport};
use semismooth::run::Status;
use semismooth::sparse::Matrix;
use semismooth::variational::Polyhedron;

type Value = fn(&[f64], &mut [f64]) -> f64;

fn run(f: Value, set: &Polyhedron, start: &[f64], options: BundleOptions) -> (Vec<f64>, BundleReport) {
    let mut objective = |p: &[f64], g: &mut [f64]| Ok(f(p, g));
    Bundle::new(options).minimise(set, start, &mut objective).unwrap()
}

fn space(n: usize) -> Polyhedron {
    Polyhedron::space(n).unwrap()
}

/// max(x² + y⁴, (2 − x)² + (2 − y)², 2 exp(y − x)) of C. Charalambous and A. R. Conn: 1.952224 at (1.139, 0.900).
fn cb2(p: &[f64], g: &mut [f64]) -> f64 {
    let (x, y) = (p[0], p[1]);
    let parts = [
        (x * x + y.powi(4), [2.0 * x, 4.0 * y.powi(3)]),
        (
            (2.0 - x).powi(2) + (2.0 - y).powi(2),
            [2.0 * (x - 2.0), 2.0 * (y - 2.0)],
        ),
        (2.0 * (y - x).exp(), [-2.0 * (y - x).exp(), 2.0 * (y - x).exp()]),
    ];
    largest(&parts, g)
}

fn largest(parts: &[(f64, [f64; 2])], g: &mut [f64]) -> f64 {
    let best = parts.iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    g.copy_from_slice(&best.1);
    best.0
}

/// 100 (y − x²)² + (1 − x)², smooth and not convex: the minimum is 0 at (1, 1).
fn rosenbrock(p: &[f64], g: &mut [f64]) -> f64 {
    let (x, y) = (p[0], p[1]);
    let r = y - x * x;
    g.copy_from_slice(&[-400.0 * x * r - 2.0 * (1.0 - x), 200.0 * r]);
    100.0 * r * r + (1.0 - x).powi(2)
}

/// −x + 20 max(x² + y² − 1, 0): the minimum is −1 at (1, 0).
fn penalty(p: &[f64], g: &mut [f64]) -> f64 {
    let excess = p[0] * p[0] + p[1] * p[1] - 1.0;
    let w = if excess > 0.0 { 20.0 } else { 0.0 };
    g.copy_from_slice(&[w * 2.0 * p[0] - 1.0, w * 2.0 * p[1]]);
    w * excess - p[0]
}

/// max(|x|, |y|) − ½ min(|x − 1|, 1): kinks that point up as well as down. Between 0 and 1 the slope in x is ½ at least.
fn both(p: &[f64], g: &mut [f64]) -> f64 {
    let (x, y) = (p[0], p[1]);
    if x.abs() >= y.abs() {
        g.copy_from_slice(&[x.signum(), 0.0]);
    } else {
        g.copy_from_slice(&[0.0, y.signum()]);
    }
    if (x - 1.0).abs() < 1.0 {
        g[0] -= 0.5 * (x - 1.0).signum();
    }
    x.abs().max(y.abs()) - 0.5 * (x - 1.0).abs().min(1.0)
}

#[test]
fn functions_with_known_minima() {
    let options = BundleOptions::default;
    let (p, report) = run(cb2, &space(2), &[1.0, -0.1], options());
    assert!(report.is_solved(), "{report}");
    assert!((report.value - 1.952_224_5).abs() < 1e-6, "{p:?} {report}");

    let (p, report) = run(penalty, &space(2), &[-1.0, 2.0], options());
    assert!(
        report.is_solved() && (report.value + 1.0).abs() < 1e-7,
        "{p:?} {report}"
    );

    let (p, report) = run(both, &space(2), &[3.0, -2.0], options());
    assert!(report.is_solved(), "{report}");
    assert!(
        (report.value + 0.5).abs() < 1e-7 && p[0].abs() < 1e-7,
        "{p:?} {report}"
    );
}

/// Smooth valleys are hard for a method of first order: it says that it has not ended, or is near the minimum.
#[test]
fn a_curved_valley() {
    let (p, report) = run(
        rosenbrock,
        &space(2),
        &[-1.2, 1.0],
        BundleOptions::default()
            .with_tolerance(1e-6)
            .with_max_iterations(2000),
    );
    assert!(report.is_solved(), "{report}");
    assert!((p[0] - 1.0).abs() < 1e-2 && report.value < 1e-5, "{p:?} {report}");
}

/// The aggregate, its multipliers and radius are what they say: for a piecewise linear function over a polyhedron they are Karush–Kuhn–Tucker
/// multipliers of the linear program.
#[test]
fn the_certificate() {
    let f: Value = |p, g| {
        let s = if p[0] + p[1] >= 0.0 { 1.0 } else { -1.0 };
        g.copy_from_slice(&[s + 1.0, s]);
        (p[0] + p[1]).abs() + p[0]
    };
    let set = Polyhedron::boxed(vec![-1.0, -5.0], vec![f64::INFINITY; 2])
        .unwrap()
        .with_inequalities(Matrix::from_rows(&[[0.0, 1.0]]).unwrap(), vec![0.5])
        .unwrap();
    let (p, report) = run(f, &set, &[2.0, 0.3], BundleOptions::default());
    assert!(report.is_solved(), "{report}");
    // |x + y| + x over x ≥ −1, y ≤ ½: the least value is −½, at x = −1 … −½ with y = ½ and on.
    assert!((report.value + 0.5).abs() < 1e-8, "{p:?} {report}");
    assert!(set.violation(&p).unwrap() == 0.0);
    let (m, slack) = (&report.multipliers, 0.5 - p[1]);
    assert!(m.inequalities[0] >= 0.0 && m.lower[0] >= 0.0 && m.inequalities[0] * slack <= 1e-8);
    assert!(report.error >= 0.0 && report.subgradient_norm <= 1e-6 * report.gradient_norm);
}

/// Runs end at limits and on request, with the best point so far; the history is monotone.
#[test]
fn ends() {
    let f = |p: &[f64], g: &mut [f64]| Ok::<f64, Cause>(cb2(p, g));
    let limited = Bundle::new(BundleOptions::default().with_max_iterations(2));
    let (_, report) = limited.minimise(&space(2), &[1.0, -0.1], &mut { f }).unwrap();
    assert_eq!((report.status, report.iterations), (Status::IterationLimit, 2));
    let none = Some(std::time::Duration::ZERO);
    let timed = Bundle::new(BundleOptions::default().with_max_time(none));
    let (p, report) = timed.minimise(&space(2), &[1.0, -0.1], &mut { f }).unwrap();
    assert_eq!((report.status, p), (Status::TimeLimit, vec![1.0, -0.1]));
    let mut seen = Vec::new();
    let observed = Bundle::default().minimise_observed(&space(2), &[1.0, -0.1], &mut { f }, |line| {
        seen.push(line.value);
        match seen.len() {
            5 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    });
    assert_eq!(observed.unwrap().1.status, Status::Interrupted);
    assert!(seen.len() == 5 && seen.is_sorted_by(|a, b| a >= b));
}

/// Points without a value are avoided; where there is no other way, the report has the error unchanged.
#[test]
fn values_that_are_missing() {
    #[derive(Debug)]
    struct Beyond(f64);
    impl std::fmt::Display for Beyond {
        fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            write!(f, "beyond at {}", self.0)
        }
    }
    impl std::error::Error for Beyond {}
    let mut f = |p: &[f64], g: &mut [f64]| match p[0] > 0.25 {
        true => Err(Cause::new(Beyond(p[0]))),
        false => {
            g[0] = 2.0 * p[0];
            Ok(p[0] * p[0])
        }
    };
    let (p, report) = Bundle::default().minimise(&space(1), &[-4.0], &mut f).unwrap();
    assert!(report.is_solved() && p[0].abs() < 1e-6, "{report}");
    let mut wall = |p: &[f64], g: &mut [f64]| match p[0] > 0.25 {
        true => Err(Cause::new(Beyond(p[0]))),
        false => {
            g[0] = -1.0;
            Ok(-p[0])
        }
    };
    let (p, report) = Bundle::default().minimise(&space(1), &[-4.0], &mut wall).unwrap();
    assert!(!report.is_solved() && (p[0] - 0.25).abs() < 1e-12, "{report}");
    let trouble = report.trouble.unwrap();
    assert!(trouble.downcast_ref::<Beyond>().is_some_and(|b| b.0 > 0.25));
}
