use std::ops::ControlFlow;
use std::time::Duration;

use semismooth::contact::{DelassusOptions, DelassusProblem, DelassusSolver};
use semismooth::sparse::{Matrix, Pattern};

use super::stiffness;
use crate::table::{BAD, Table, rows};

pub(super) fn delassus(t: &mut Table) {
    let new = "contact::DelassusProblem::new";
    let make =
        |dimension, matrix: Matrix, q: Vec<f64>, mu: Vec<f64>| DelassusProblem::new(dimension, matrix, q, mu);
    for dimension in [0, 1, 4, usize::MAX] {
        t.refuses(new, "dimension", "dimension", || {
            make(dimension, stiffness(), vec![0.0; 2], vec![0.3])
        });
    }
    t.refuses(new, "no contacts", "no contacts", || {
        make(2, Matrix::zeros(Pattern::full(0, 0)), vec![], vec![])
    });
    t.refuses(new, "q of another length", "q", || {
        make(2, stiffness(), vec![0.0], vec![0.3])
    });
    t.refuses(new, "M of another order", "M", || {
        make(2, rows(&[&[1.0]]), vec![0.0; 2], vec![0.3])
    });
    t.refuses(new, "friction of another length", "", || {
        make(2, stiffness(), vec![0.0; 2], vec![0.3; 2])
    });
    t.survives(new, "an unsymmetric M", || {
        make(2, rows(&[&[1.0, 1.0], &[0.0, 1.0]]), vec![0.0; 2], vec![0.3])
    });
    t.refuses(new, "a negative diagonal", "", || {
        make(2, rows(&[&[-1.0, 0.0], &[0.0, 1.0]]), vec![0.0; 2], vec![0.3])
    });
    t.refuses(new, "negative friction", "friction", || {
        make(2, stiffness(), vec![0.0; 2], vec![-0.3])
    });
    let problem = || make(2, stiffness(), vec![-1.0, 0.5], vec![0.3]).unwrap();
    let o = DelassusOptions::default;
    for bad in BAD {
        t.refuses(new, "q", "q[0]", || {
            make(2, stiffness(), vec![bad, 0.0], vec![0.3])
        });
        t.refuses(new, "friction", "mu[0]", || {
            make(2, stiffness(), vec![0.0; 2], vec![bad])
        });
        t.refuses(new, "M", "(0, 0)", || {
            make(2, rows(&[&[bad, 0.0], &[0.0, 1.0]]), vec![0.0; 2], vec![0.3])
        });
        t.refuses("contact::DelassusProblem::residual", "r", "[0]", || {
            problem().residual(&[bad, 0.0])
        });
        t.refuses("contact::DelassusProblem::velocities", "r", "[0]", || {
            problem().velocities(&[bad, 0.0])
        });
        t.refuses(
            "contact::DelassusSolver::solve_observed",
            "the start",
            "[0]",
            || {
                DelassusSolver::new(o())
                    .solve_observed(&problem(), Some(&[bad, 0.0]), |_| ControlFlow::Continue(()))
            },
        );
    }
    for n in [0, 1, 3] {
        let r = vec![0.5; n];
        t.refuses("contact::DelassusProblem::residual", "another length", "", || {
            problem().residual(&r)
        });
        t.refuses(
            "contact::DelassusProblem::velocities",
            "another length",
            "",
            || problem().velocities(&r),
        );
        t.refuses(
            "contact::DelassusSolver::solve_observed",
            "a start of another length",
            "",
            || DelassusSolver::new(o()).solve_observed(&problem(), Some(&r), |_| ControlFlow::Continue(())),
        );
    }
    for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        t.refuses(
            "contact::DelassusOptions::validate",
            "tolerance",
            "tolerance",
            || o().with_tolerance(bad).validate(),
        );
        t.refuses("contact::DelassusSolver::solve", "tolerance", "tolerance", || {
            DelassusSolver::new(o().with_tolerance(bad)).solve(&problem())
        });
    }
    for limit in [0, usize::MAX] {
        t.survives("contact::DelassusSolver::solve", "absurd limits", || {
            DelassusSolver::new(o().with_max_factorisations(limit)).solve(&problem())
        });
    }
    for time in [Duration::ZERO, Duration::MAX] {
        t.survives("contact::DelassusSolver::solve", "absurd time", || {
            DelassusSolver::new(o().with_max_time(Some(time))).solve(&problem())
        });
    }
    // The solver ends in bounded time; if it reports a solution, the residual is small.
    let zero = rows(&[&[0.0, 0.0], &[0.0, 0.0]]);
    let singular = rows(&[&[1.0, 1.0], &[1.0, 1.0]]);
    for (input, m) in [("zero", zero), ("singular", singular), ("definite", stiffness())] {
        for (q, mu) in [
            (-1.0, 0.0),
            (-1.0, 1e300),
            (1e160, 0.3),
            (-1e300, 0.3),
            (f64::MAX, f64::MAX),
            (-1e-320, 0.3),
        ] {
            t.holds(
                "contact::DelassusSolver::solve",
                &format!("the report of M {input}, q {q:e}, mu {mu:e} is true"),
                || {
                    let Ok(problem) = make(2, m.clone(), vec![q, 0.5 * q], vec![mu]) else {
                        return true;
                    };
                    match DelassusSolver::new(o()).solve(&problem) {
                        Ok(report) if report.is_solved() => {
                            problem.residual(&report.r).is_ok_and(|r| r <= 1e-6)
                        }
                        Ok(report) => report.r.len() == 2,
                        Err(_) => true,
                    }
                },
            );
        }
    }
    t.refuses("contact::DelassusReport::solution", "another problem", "", || {
        let report = DelassusSolver::new(o()).solve(&problem())?;
        let other = make(3, Matrix::identity(3), vec![0.0; 3], vec![0.3])?;
        report.solution(&other)
    });
}
