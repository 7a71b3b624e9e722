//! Two routes to the same run: a smooth map without sites, and the same as a semismooth map; and the cost of a run.

use std::cell::Cell;

use semismooth::newton::{Convergence, Damping, Newton, NewtonError, NewtonOptions};
use semismooth::piecewise::{PiecewiseSmooth, Selection, Semismooth};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use crate::maps::one_piece;
use crate::problems::scalar;

type Function = fn(f64) -> [f64; 2];

/// f(x) = 0 for one f given with its derivative; counts its evaluations.
struct Plain {
    f: Function,
    evaluations: Cell<usize>,
}

impl Plain {
    fn new(f: Function) -> Self {
        Self {
            f,
            evaluations: Cell::new(0),
        }
    }

    fn at(&self, x: &[f64], out: &mut [f64]) {
        self.evaluations.set(self.evaluations.get() + 1);
        out[0] = (self.f)(x[0])[0];
    }
}

impl PiecewiseSmooth for Plain {
    one_piece!(self, 1, 1);
    fn residual(&self, _: &Selection, x: &[f64], out: &mut [f64]) {
        self.at(x, out);
    }
    fn jacobian(&self, _: &Selection, x: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, (self.f)(x[0])[1]);
    }
}

impl Semismooth for Plain {
    fn num_vars(&self) -> usize {
        1
    }
    fn residual(&self, x: &[f64], out: &mut [f64]) {
        self.at(x, out);
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, (self.f)(x[0])[1]);
    }
}

/// Functions with a simple root, one around which full steps cycle, a double root, none beside a minimum, none with a bounded slope.
const FUNCTIONS: [Function; 5] = [
    |x| [x * x * x - 2.0 * x - 5.0, 3.0 * x * x - 2.0],
    |x| [x * x * x - 2.0 * x + 2.0, 3.0 * x * x - 2.0],
    |x| [(x - 1.0) * (x - 1.0), 2.0 * (x - 1.0)],
    |x| [x * x + 1.0, 2.0 * x],
    |x| [x.exp() + 1.0, x.exp()],
];

#[test]
fn a_map_without_sites_runs_as_a_semismooth_one() {
    let mut failed = 0;
    for f in FUNCTIONS {
        for damping in [Damping::OnTrouble, Damping::Always, Damping::Never] {
            for start in [-2.0, 0.1, 0.9, 3.0] {
                let options = NewtonOptions::default()
                    .with_damping(damping)
                    .with_max_iterations(60);
                let (mut x, mut y) = ([start], [start]);
                let (mut newton, mut other) = (Newton::new(options.clone()), Newton::new(options));
                let end = newton.solve(&Plain::new(f), &mut x);
                assert_eq!(end, other.solve_semismooth(&Plain::new(f), &mut y));
                let (a, b) = (newton.report(), other.report());
                assert_eq!((x, a), (y, b), "{damping:?} {start}");
                failed += usize::from(end.is_err());
            }
        }
    }
    assert!(failed > 10);
}

#[test]
fn full_steps_cost_one_evaluation_each() {
    for start in [2.0, 3.0, 10.0] {
        let map = Plain::new(FUNCTIONS[0]);
        let mut newton = Newton::new(NewtonOptions::default().with_damping(Damping::Never));
        newton.solve(&map, &mut [start]).unwrap();
        // The last entry is the solution.
        assert_eq!(map.evaluations.get(), newton.report().history.len());
    }
}

/// 3 x − 1, never smaller than 20 ε relative to its terms: that is the floor, reached at the first iterate that no longer decreases.
#[test]
fn residuals_that_rest_at_rounding_are_solved() {
    let floor = 20.0 * f64::EPSILON;
    let resting = |unit: f64| {
        let f = move |x: f64| {
            if (3.0 * x - 1.0).abs() < 1e-12 {
                floor
            } else {
                3.0 * x - 1.0
            }
        };
        scalar(move |x| unit * f(x), move |_| 3.0 * unit)
    };
    for unit in [1e-6, 1.0, 1e6] {
        let options = NewtonOptions::default()
            .with_tolerances(0.0, 0.0)
            .with_damping(Damping::Never)
            .with_max_iterations(30);
        let mut newton = Newton::new(options);
        let mut x = [5.0];
        assert_eq!(
            newton.solve(&resting(unit), &mut x),
            Ok(Convergence::Rounding),
            "{unit:e}"
        );
        assert!((x[0] - 1.0 / 3.0).abs() < 1e-14 && newton.report().history.len() <= 5);
    }
    // A residual that stagnates ten times higher is not rounding.
    let high = scalar(|x| 1e-12_f64.max((3.0 * x - 1.0).abs()), |_| 3.0);
    let options = NewtonOptions::default()
        .with_tolerances(0.0, 0.0)
        .with_damping(Damping::Never)
        .with_max_iterations(30);
    let end = Newton::new(options).solve(&high, &mut [5.0]);
    assert!(
        matches!(&end, Err(NewtonError::Failed(left)) if left.status == Status::IterationLimit),
        "{end:?}"
    );
}
