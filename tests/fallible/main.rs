//! The error of a function of the user comes back unchanged through every solver, whichever evaluation fails.

#[path = "../maps/mod.rs"]
mod maps;
mod routes;

use std::error::Error;
use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use semismooth::complementarity::{Mcp, McpFunction, McpOptions, McpSolver};
use semismooth::cones::{Cone, ConeOptions, ConeProblem, ConeSolver};
use semismooth::continuation::{
    Branch, ContinuationOptions, Diagram, DiagramOptions, Direction, SearchOptions, search_solutions,
};
use semismooth::fallible::{Failed, FirstError};
use semismooth::newton::{Newton, NewtonError, NewtonOptions};
use semismooth::piecewise::{PiecewiseSmooth, Selection, Semismooth};
use semismooth::run::Status;
use semismooth::sparse::Matrix;
use semismooth::sweep::sweep;
use semismooth::variational::{Polyhedron, Vi, ViSolver};

use maps::two_pieces;

/// The error of the evaluation with this number.
#[derive(Debug, Clone, PartialEq)]
struct Broken(usize);

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "evaluation {} is broken", self.0)
    }
}

impl Error for Broken {}

/// A function whose evaluation number `at` fails.
struct Counted {
    errors: FirstError<Broken>,
    at: usize,
    calls: AtomicUsize,
}

impl Counted {
    fn new(at: usize) -> Self {
        Self {
            errors: FirstError::new(),
            at,
            calls: AtomicUsize::new(0),
        }
    }

    fn calls(&self) -> usize {
        self.calls.load(Ordering::Relaxed)
    }

    /// Counts one evaluation.
    fn count(&self) -> Result<(), Broken> {
        match self.calls.fetch_add(1, Ordering::Relaxed) {
            k if k == self.at => Err(Broken(k)),
            _ => Ok(()),
        }
    }
}

/// 2 y = α for y < 0, y − y² = α above: a kink at 0, a fold at ½.
struct Curve<'c>(&'c Counted);

impl PiecewiseSmooth for Curve<'_> {
    two_pieces!(self, [negative, positive], 2, 1, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        self.0.errors.values(out, |out| {
            out[0] = x[0];
            self.0.count()
        });
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        self.0.errors.values(out, |out| {
            out[0] = [2.0 * x[0], x[0] - x[0] * x[0]][s.piece(0)] - x[1];
            self.0.count()
        });
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        self.0.errors.matrix(jac, |jac| {
            jac.add(0, 0, [2.0, 1.0 - 2.0 * x[0]][s.piece(0)]);
            jac.add(0, 1, -1.0);
            self.0.count()
        });
    }
}

/// Kojima and Shindo's problem: degenerate, and not solved by Newton's method alone from everywhere.
struct Kojima<'c>(&'c Counted);

impl McpFunction for Kojima<'_> {
    fn num_vars(&self) -> usize {
        4
    }
    fn value(&self, x: &[f64], out: &mut [f64]) {
        self.0.errors.values(out, |out| {
            let [a, b, c, d] = [x[0], x[1], x[2], x[3]];
            out[0] = 3.0 * a * a + 2.0 * a * b + 2.0 * b * b + c + 3.0 * d - 6.0;
            out[1] = 2.0 * a * a + a + b * b + 10.0 * c + 2.0 * d - 2.0;
            out[2] = 3.0 * a * a + a * b + 2.0 * b * b + 2.0 * c + 9.0 * d - 9.0;
            out[3] = a * a + 3.0 * b * b + 2.0 * c + 3.0 * d - 3.0;
            self.0.count()
        });
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        self.0.errors.matrix(jac, |jac| {
            let (a, b) = (x[0], x[1]);
            let rows = [
                [6.0 * a + 2.0 * b, 2.0 * a + 4.0 * b, 1.0, 3.0],
                [4.0 * a + 1.0, 2.0 * b, 10.0, 2.0],
                [6.0 * a + b, a + 4.0 * b, 2.0, 9.0],
                [2.0 * a, 6.0 * b, 2.0, 3.0],
            ];
            (0..16).for_each(|k| jac.add(k / 4, k % 4, rows[k / 4][k % 4]));
            self.0.count()
        });
    }
}

/// x² = 2.
struct Root<'c>(&'c Counted);

impl Semismooth for Root<'_> {
    fn num_vars(&self) -> usize {
        1
    }
    fn residual(&self, x: &[f64], out: &mut [f64]) {
        self.0.errors.values(out, |out| {
            out[0] = x[0] * x[0] - 2.0;
            self.0.count()
        });
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        self.0.errors.matrix(jac, |jac| {
            jac.add(0, 0, 2.0 * x[0]);
            self.0.count()
        });
    }
}

/// Runs `solve` with a function that never fails, then with each of its evaluations failing (some, if there are many): the error is that of
/// this evaluation, and no evaluation follows. `check` compares the results.
fn with_each_failing<R: fmt::Debug>(solve: impl Fn(&Arc<Counted>) -> R, mut check: impl FnMut(&R, &R)) {
    let whole = Arc::new(Counted::new(usize::MAX));
    let reference = whole.errors.run(|| solve(&whole)).unwrap();
    let step = 1 + whole.calls() / 400;
    assert!(whole.calls() > 5);
    for at in (0..whole.calls()).step_by(step) {
        let counted = Arc::new(Counted::new(at));
        let failed = counted.errors.run(|| solve(&counted)).unwrap_err();
        assert_eq!((&failed.error, counted.calls()), (&Broken(at), at + 1));
        assert!(!counted.errors.is_set());
        check(&failed.result, &reference);
    }
}

#[test]
fn newton() {
    let solve = |counted: &Arc<Counted>| {
        let mut x = [3.0, -0.5];
        let result = Newton::default().solve(&Curve(counted), &mut x);
        (result, x)
    };
    with_each_failing(solve, |(result, x), (reference, solution)| {
        assert!(reference.is_ok() && (solution[0] - (1.0 + 3.0_f64.sqrt()) / 2.0).abs() < 1e-14);
        // The best iterate is kept, or the solution where no more than a check of it failed.
        assert!(x.iter().all(|v| v.is_finite()));
        match result {
            Err(NewtonError::Failed(unsolved)) => assert_eq!(unsolved.x, x),
            Err(other) => panic!("{other}"),
            Ok(_) => assert_eq!(x, solution),
        }
    });
    let semismooth = |counted: &Arc<Counted>| {
        let mut x = [5.0];
        Newton::default()
            .solve_semismooth(&Root(counted), &mut x)
            .map(|_| x[0])
    };
    with_each_failing(semismooth, |result, _| assert!(result.is_err()));
}

#[test]
fn complementarity_from_all_strategies() {
    let root = 6.0_f64.sqrt() / 2.0;
    for start in [[0.0; 4], [1.0; 4], [1.0, 0.0, 1.0, -5.0]] {
        let solve = |counted: &Arc<Counted>| {
            let mut x = start;
            let report = McpSolver::new(McpOptions::default())
                .solve(&Mcp::ncp(Kojima(counted)).unwrap(), &mut x)
                .cloned();
            (report.map(|r| r.status), x)
        };
        with_each_failing(solve, |(status, x), (reference, solution)| {
            assert!(reference.as_ref().is_ok_and(|s| s.name() == "solved"));
            assert!(x.iter().all(|v| v.is_finite()), "{x:?} {status:?}");
            let solved = status.as_ref().is_ok_and(|s| s.name() == "solved");
            assert!(!solved || x == solution);
            assert!(solution[0] > 0.9 && solution[0] < root + 1e-9);
        });
    }
}

/// Cones and variational inequalities: half-lines, over which the problem is Kojima and Shindo's, and a cone on top of them.
#[test]
fn cones_and_variational_inequalities() {
    for cones in [
        vec![Cone::Nonnegative(4)],
        vec![Cone::SecondOrder(3), Cone::Nonnegative(1)],
    ] {
        let solve = |counted: &Arc<Counted>| {
            let mut x = [1.0, 0.5, 0.2, 0.1];
            let problem = ConeProblem::new(Kojima(counted), cones.clone()).unwrap();
            let report = ConeSolver::new(ConeOptions::default().with_restarts(1)).solve(&problem, &mut x);
            (report.map(|r| r.status), x)
        };
        with_each_failing(solve, |(status, x), (_, solution)| {
            assert!(x.iter().all(|v| v.is_finite()), "{x:?} {status:?}");
            // A point within the tolerance is returned as a solution, although the next steps failed.
            let near = x.iter().zip(solution).all(|(a, b)| (a - b).abs() < 1e-4);
            assert!(*status != Ok(Status::Solved) || near, "{x:?} {solution:?}");
        });
    }
    let solve = |counted: &Arc<Counted>| {
        let set = Polyhedron::boxed(vec![0.0; 4], vec![f64::INFINITY; 4]).unwrap();
        let cut = Matrix::from_rows(&[[1.0, 1.0, 1.0, 1.0]]).unwrap();
        let problem = Vi::new(Kojima(counted), set.with_inequalities(cut, vec![9.0]).unwrap()).unwrap();
        let mut x = [1.0; 4];
        let report = ViSolver::default().solve(&problem, &mut x);
        (report.map(|r| r.is_solved()), x)
    };
    with_each_failing(solve, |(solved, x), (reference, solution)| {
        assert_eq!(*reference, Ok(true));
        assert!(x.iter().all(|v| v.is_finite()), "{x:?} {solved:?}");
        let near = x.iter().zip(solution).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(*solved != Ok(true) || near, "{x:?} {solution:?}");
    });
}

#[test]
fn followed_curves() {
    let options = || {
        ContinuationOptions::default()
            .with_parameter_range((-1.5, 1.0))
            .with_max_points(60)
    };
    let follow = |counted: &Arc<Counted>| {
        Branch::follow(&Curve(counted), &[-0.5, -1.0], Direction::Increasing, options())
            .map(|branch| branch.polyline().iter().map(|x| x.1.to_vec()).collect::<Vec<_>>())
    };
    with_each_failing(follow, |partial, whole| {
        let whole = whole.as_ref().unwrap();
        assert!(whole.len() > 10);
        // The part of the curve before the error is the same to the last bit.
        if let Ok(partial) = partial {
            assert!(partial.len() <= whole.len() && *partial == whole[..partial.len()]);
        }
    });
}

#[test]
fn diagrams_and_searches() {
    let explore = |counted: &Arc<Counted>| {
        let continuation = ContinuationOptions::default()
            .with_parameter_range((-1.5, 1.0))
            .with_max_points(60);
        let options = DiagramOptions::default().with_continuation(continuation);
        Diagram::explore(&Curve(counted), &[vec![-0.5, -1.0]], &options).map(|d| d.points_computed())
    };
    with_each_failing(explore, |partial, whole| {
        if let Ok(partial) = partial {
            assert!(partial <= whole.as_ref().unwrap());
        }
    });
    let search = |counted: &Arc<Counted>| {
        let options = SearchOptions::default().with_starts(10);
        search_solutions(&Curve(counted), 0.2, &[vec![0.1, 0.2]], &options).map(|f| f.solutions.len())
    };
    with_each_failing(search, |found, all| {
        assert!(found.as_ref().map_or(0, |n| *n) <= *all.as_ref().unwrap())
    });
}

/// Each run of a sweep has its own errors; the other runs are not affected.
#[test]
fn sweeps() {
    let run = |(start, at): &(f64, usize)| -> Result<f64, Broken> {
        let counted = Counted::new(*at);
        let mut x = [*start];
        let solved = counted
            .errors
            .run(|| Newton::default().solve_semismooth(&Root(&counted), &mut x));
        match solved {
            Ok(result) => {
                result.unwrap();
                Ok(x[0])
            }
            Err(Failed { error, .. }) => Err(error),
        }
    };
    let inputs: Vec<(f64, usize)> = (0..40)
        .map(|k| {
            (
                1.0 + f64::from(k),
                if k % 3 == 0 { k as usize / 9 } else { usize::MAX },
            )
        })
        .collect();
    for ((start, at), found) in inputs.iter().zip(sweep(&inputs, run)) {
        match found {
            Err(error) => assert_eq!(error, Broken(*at)),
            Ok(x) => assert_eq!(Ok(x.to_bits()), run(&(*start, usize::MAX)).map(f64::to_bits)),
        }
        assert_eq!(run(&(*start, *at)).is_err(), *at != usize::MAX);
    }
}

#[test]
fn errors_keep_their_source_and_end_observed_runs() {
    let counted = Counted::new(2);
    let mut x = [5.0];
    let options = NewtonOptions::default();
    let failed = counted
        .errors
        .run(|| {
            Newton::new(options).solve_semismooth_observed(&Root(&counted), &mut x, |_| counted.errors.flow())
        })
        .unwrap_err();
    assert_eq!(failed.to_string(), "the function failed: evaluation 2 is broken");
    assert_eq!(failed.source().and_then(|e| e.downcast_ref()), Some(&Broken(2)));
    let Err(NewtonError::Failed(unsolved)) = &failed.result else {
        panic!("{failed:?}");
    };
    assert_eq!(
        (unsolved.status, unsolved.x.as_slice()),
        (Status::Stalled, [5.0].as_slice())
    );
    // An earlier error is forgotten by the next run, but not by evaluations outside a run.
    assert_eq!(counted.errors.attempt(|| Err::<(), _>(Broken(7))), None);
    assert_eq!(
        (counted.errors.attempt(|| Ok(1)), counted.errors.flow()),
        (None, ControlFlow::Break(()))
    );
    assert_eq!(
        counted.errors.run(|| counted.errors.attempt(|| Ok(1))),
        Ok(Some(1))
    );
}
