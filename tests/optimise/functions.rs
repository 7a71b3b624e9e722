//! Functions of parameters alone, with stationary points in closed form.

use std::ops::ControlFlow;
use std::time::Duration;

use semismooth::Cause;
use semismooth::optimise::{Bundle, BundleOptions, BundleReport, Objective, OptimiseError};
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

/// A gradient that is small against that of the start says nothing: x⁴ + |x − 1| and eˣ − x have their minima at 4⁻¹ᐟ³ and 0 wherever the
/// search begins.
#[test]
fn starts_far_away() {
    let quartic: Value = |p, g| {
        g[0] = 4.0 * p[0].powi(3) + (p[0] - 1.0).signum();
        p[0].powi(4) + (p[0] - 1.0).abs()
    };
    let exponential: Value = |p, g| {
        g[0] = p[0].exp() - 1.0;
        p[0].exp() - p[0]
    };
    // A second parameter has its own course.
    let both: Value = |p, g| {
        g.copy_from_slice(&[p[0].exp() - 1.0, 2.0 * p[1]]);
        p[0].exp() - p[0] + p[1] * p[1]
    };
    let (p, report) = run(both, &space(2), &[40.0, 1.0], BundleOptions::default());
    assert!(!report.is_solved() || p[1].abs() < 1e-5, "{p:?} {report}");
    for (f, best, starts) in [
        (quartic, 0.25f64.cbrt(), [10.0, 1e3]),
        (exponential, 0.0, [10.0, 40.0]),
    ] {
        for start in starts {
            let (p, report) = run(f, &space(1), &[start], BundleOptions::default());
            // The unit of parameters is that of the first step, a tenth of the start.
            assert!(report.is_solved(), "{start}: {report}");
            assert!((p[0] - best).abs() < 1e-6 * start, "{start}: {p:?} {report}");
        }
    }
}

/// Parameters have units of their own: in one of them a slope is not small because that in another one is large.
#[test]
fn slopes_are_compared_one_by_one() {
    let sum: Value = |p, g| {
        g.copy_from_slice(&[p[0].signum(), 1e6 * p[1].signum()]);
        p[0].abs() + 1e6 * p[1].abs()
    };
    let squares: Value = |p, g| {
        g.copy_from_slice(&[2.0 * p[0], 2e6 * p[1]]);
        p[0] * p[0] + 1e6 * p[1] * p[1]
    };
    let shifted: Value = |p, g| {
        g.copy_from_slice(&[2.0 * p[0], p[1].signum()]);
        1e6 + p[0] * p[0] + p[1].abs()
    };
    // The long valley of the first one is another matter: it may not be walked to its end, but then no minimum is claimed.
    for (f, start, ends) in [
        (sum, [1.0, 0.7], false),
        (squares, [1.0, 0.7], true),
        (shifted, [5e5, 3e5], true),
    ] {
        let least = f(&[0.0, 0.0], &mut [0.0; 2]);
        let (p, report) = run(f, &space(2), &start, BundleOptions::default());
        assert!(report.is_solved() || !ends, "{report}");
        let excess = report.value - least;
        assert!(
            !report.is_solved() || excess < 1e-4 * (1.0 + least.sqrt()),
            "{p:?} {report}"
        );
    }
}

/// Bounds tell the units: a coefficient of friction beside Young's modulus in Pa, 2 |F − 0.37| + |F − 0.37 + E/E₀ − 1| + (E/E₀ − 1)². The course
/// is that of E in units of a power of two, to the last bit, and so are the multipliers, where E has a bound.
#[test]
fn bounds_give_units() {
    let f = |unit: f64, p: &[f64], g: &mut [f64]| {
        let (a, b) = (p[0] - 0.37, p[1] / unit - 1.0);
        let (s, t) = (1.0f64.copysign(a), 1.0f64.copysign(a + b));
        g.copy_from_slice(&[2.0 * s + t, (t + 2.0 * b) / unit]);
        Ok::<f64, Cause>(2.0 * a.abs() + (a + b).abs() + b * b)
    };
    let found = |unit: f64, most: f64| {
        let set = Polyhedron::boxed(vec![0.0, 0.25 * unit], vec![1.0, most * unit]).unwrap();
        let mut f = |p: &[f64], g: &mut [f64]| f(unit, p, g);
        Bundle::default()
            .minimise(&set, &[0.8, 0.3 * unit], &mut f)
            .unwrap()
    };
    let e = 2.0f64.powi(37);
    for (most, best, force) in [(1.5, 1.0, 0.0), (0.75, 0.75, 0.75)] {
        let [(p, report), (q, scaled)] = [found(1.0, most), found(e, most)];
        assert!(report.is_solved() && scaled.is_solved(), "{report}\n{scaled}");
        assert!((p[0] - 0.37).abs() < 1e-6 && (p[1] - best).abs() < 1e-6, "{p:?}");
        assert_eq!(q, [p[0], e * p[1]]);
        assert!(force == 0.0 || report.multipliers.upper[1] > force, "{report:?}");
        assert_eq!(scaled.multipliers.upper[1] * e, report.multipliers.upper[1]);
        assert_eq!(scaled.subgradient[1] * e, report.subgradient[1]);
    }
}

/// The least value may be 0, and the start a point that has it: |3 x − 0.3| + |y − 0.3| at (0.1, 0.3), where 3 x is not 0.3.
#[test]
fn starts_at_the_minimum() {
    let f: Value = |p, g| {
        let (a, b) = (3.0 * p[0] - 0.3, p[1] - 0.3);
        g.copy_from_slice(&[3.0f64.copysign(a), 1.0f64.copysign(b)]);
        a.abs() + b.abs()
    };
    let (p, report) = run(f, &space(2), &[0.1, 0.3], BundleOptions::default());
    assert!(report.is_solved() && report.value < 1e-15, "{p:?} {report}");
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

/// An evaluation that a limit or an observer ends is no point without a value: the run ends there, at the
/// best point so far, which need not be where its last iteration began.
#[test]
fn evaluations_that_are_stopped() {
    struct Stopping {
        evaluations: usize,
        most: usize,
        status: Status,
        kept: f64,
        last: f64,
        told: bool,
    }
    impl Objective for Stopping {
        fn evaluate(&mut self, p: &[f64], g: &mut [f64]) -> Result<f64, Cause> {
            if self.evaluations == self.most {
                return Err(Cause::new(OptimiseError::Unsolved(self.status)));
            }
            self.evaluations += 1;
            self.last = cb2(p, g);
            Ok(self.last)
        }
        fn limit_time(&mut self, left: Duration) {
            self.told |= left <= Duration::from_secs(3600);
        }
        fn keep(&mut self) {
            self.kept = self.last;
        }
    }
    for status in [Status::TimeLimit, Status::Interrupted] {
        for most in 0..25 {
            let mut f = Stopping {
                evaluations: 0,
                most,
                status,
                kept: f64::NAN,
                last: f64::NAN,
                told: false,
            };
            let hour = BundleOptions::default().with_max_time(Some(Duration::from_secs(3600)));
            let found = Bundle::new(hour).minimise(&space(2), &[1.0, -0.1], &mut f);
            assert!(f.told);
            if most == 0 {
                assert_eq!(found.unwrap_err().stopped(), Some(status));
                continue;
            }
            let (p, report) = found.unwrap();
            if !report.is_solved() {
                assert_eq!((report.status, report.failures), (status, 0), "{most}: {report}");
                assert!(report.trouble.is_none());
            }
            assert_eq!((report.value, f.kept), (f.kept, cb2(&p, &mut [0.0; 2])), "{most}");
        }
    }
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
