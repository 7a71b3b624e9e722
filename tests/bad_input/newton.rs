use std::ops::ControlFlow;

use semismooth::linear::{AutoSolver, DenseLu, KrylovMethod, LinearError, LinearOperator};
use semismooth::newton::{
    Damping, Forcing, MoorePenrose, Newton, NewtonError, NewtonKrylov, NewtonKrylovOptions, NewtonOptions,
};
use semismooth::piecewise::{MatrixFree, MinMap, PiecewiseSmooth, RegularityOptions, Selection, Semismooth};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, Pattern};

use super::piecewise::{no_numbers, square, vee};
use super::table::{BAD, Table};

/// x² + 1 = 0: no solution.
struct NoRoot(f64);
impl Semismooth for NoRoot {
    fn num_vars(&self) -> usize {
        1
    }
    fn residual(&self, x: &[f64], out: &mut [f64]) {
        out[0] = self.0 * (x[0] * x[0] + 1.0);
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, self.0 * 2.0 * x[0]);
    }
}

/// 2 x = s in one unknown, with a wrong order or an error on request.
struct Line {
    s: f64,
    order: usize,
    refuses: bool,
}
impl LinearOperator for Line {
    fn order(&self) -> usize {
        self.order
    }
    fn product(&mut self, x: &[f64], y: &mut [f64]) {
        y.iter_mut().zip(x).for_each(|(y, x)| *y = 2.0 * x);
    }
}
impl MatrixFree for Line {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(x).for_each(|(r, x)| *r = 2.0 * x - self.s);
    }
    fn linearize(&mut self, _: &[f64]) -> Result<(), LinearError> {
        match self.refuses {
            true => Err(LinearError::Solver {
                what: "no preconditioner".to_owned(),
            }),
            false => Ok(()),
        }
    }
}

fn inexact(t: &mut Table) {
    let line = |order, s| Line {
        s,
        order,
        refuses: false,
    };
    let validate = "newton::NewtonKrylovOptions::validate";
    let mut bad = vec![
        (
            "max_iterations",
            NewtonKrylovOptions::default().with_max_iterations(0),
        ),
        (
            "max_linear_iterations",
            NewtonKrylovOptions::default().with_max_linear_iterations(0),
        ),
        (
            "method.directions",
            NewtonKrylovOptions::default().with_method(KrylovMethod::Gmres { directions: 0 }),
        ),
    ];
    for v in [f64::NAN, f64::INFINITY, -1.0, 1.5, 3.0] {
        let forcing = |f| NewtonKrylovOptions::default().with_forcing(f);
        bad.push(("forcing", forcing(Forcing::Constant(v))));
        bad.push((
            "forcing.gamma",
            forcing(Forcing::Decrease { gamma: v, alpha: 2.0 }),
        ));
        if v != 1.5 {
            bad.push((
                "forcing.alpha",
                forcing(Forcing::Decrease { gamma: 0.9, alpha: v }),
            ));
        }
        bad.push((
            "first_forcing",
            NewtonKrylovOptions::default().with_first_forcing(v),
        ));
        let o = NewtonKrylovOptions::default;
        bad.push(("max_forcing", o().with_max_forcing(v)));
        bad.push(("armijo", o().with_armijo(v)));
        bad.push(("min_damping", o().with_min_damping(v)));
    }
    for v in [f64::NAN, f64::INFINITY, -1.0] {
        let o = NewtonKrylovOptions::default();
        bad.push(("absolute_tolerance", o.clone().with_absolute_tolerance(v)));
        bad.push(("relative_tolerance", o.with_relative_tolerance(v)));
    }
    let (solve, observed) = (
        "newton::NewtonKrylov::solve",
        "newton::NewtonKrylov::solve_observed",
    );
    for (name, o) in bad {
        t.refuses(validate, name, name, || o.validate());
        t.refuses(solve, name, name, || {
            NewtonKrylov::new(o.clone()).solve(&mut line(1, 1.0), &mut [1.0])
        });
        t.refuses(observed, name, name, || {
            NewtonKrylov::new(o.clone())
                .solve_observed(&mut line(1, 1.0), &mut [1.0], |_| ControlFlow::Continue(()))
        });
    }
    for x in [vec![], vec![1.0; 2]] {
        t.refuses(solve, "x of another length", "x", || {
            NewtonKrylov::default().solve(&mut line(1, 1.0), &mut x.clone())
        });
    }
    t.refuses(solve, "an empty map", "at least 1", || {
        NewtonKrylov::default().solve(&mut line(0, 1.0), &mut [])
    });
    for v in BAD {
        t.refuses(solve, "x", "x[0]", || {
            NewtonKrylov::default().solve(&mut line(1, 1.0), &mut [v])
        });
        t.refuses(solve, "a residual that is no number", "not finite", || {
            NewtonKrylov::default().solve(&mut line(1, v), &mut [1.0])
        });
    }
    for huge in [1e160, 1e300, f64::MAX] {
        t.survives(solve, "huge numbers", || {
            NewtonKrylov::default().solve(&mut line(2, huge), &mut [-huge, 1e-300])
        });
    }
    t.refuses(
        solve,
        "a map that cannot be linearized",
        "no preconditioner",
        || {
            let mut line = line(1, 1.0);
            line.refuses = true;
            NewtonKrylov::default().solve(&mut line, &mut [1.0])
        },
    );
}

#[test]
fn correctors() {
    let mut t = Table::new("newton");
    inexact(&mut t);
    let validate = "newton::NewtonOptions::validate";
    let mut options = vec![("max_iterations", NewtonOptions::default().with_max_iterations(0))];
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        options.push((
            "absolute_tolerance",
            NewtonOptions::default().with_tolerances(bad, 0.0),
        ));
        options.push((
            "relative_tolerance",
            NewtonOptions::default().with_tolerances(0.0, bad),
        ));
    }
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        let regularity = Some(RegularityOptions::default().with_tolerance(bad));
        options.push((
            "regularity.tolerance",
            NewtonOptions::default().with_regularity(regularity),
        ));
    }
    for bad in [f64::NAN, f64::INFINITY, 0.0, 1.0, -1.0] {
        let mut armijo = NewtonOptions::default();
        armijo.armijo = bad;
        options.push(("armijo", armijo));
        let mut damping = NewtonOptions::default();
        damping.min_damping = bad;
        options.push(("min_damping", damping));
    }
    for (name, o) in options {
        t.refuses(validate, name, name, || o.validate());
        t.refuses("newton::Newton::solve", name, name, || {
            Newton::new(o.clone()).solve(&square(1), &mut [1.0])
        });
        t.refuses("newton::Newton::solve_semismooth", name, name, || {
            Newton::new(o.clone()).solve_semismooth(&NoRoot(1.0), &mut [1.0])
        });
    }
    let mut newton = Newton::new(NewtonOptions::default());
    for x in [vec![], vec![1.0; 2]] {
        t.refuses("newton::Newton::solve", "x of another length", "x", || {
            newton.solve(&square(1), &mut x.clone())
        });
        t.refuses(
            "newton::Newton::solve_semismooth",
            "x of another length",
            "x",
            || newton.solve_semismooth(&NoRoot(1.0), &mut x.clone()),
        );
    }
    t.survives("newton::Newton::solve", "an empty map", || {
        newton.solve(&square(0), &mut [])
    });
    for bad in BAD {
        t.refuses("newton::Newton::solve", "x", "x[0]", || {
            newton.solve(&square(1), &mut [bad])
        });
        t.refuses("newton::Newton::solve_semismooth", "x", "x[0]", || {
            newton.solve_semismooth(&NoRoot(1.0), &mut [bad])
        });
        let map = MinMap::new(1, move |_: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = bad;
            b[0] = bad;
        });
        t.refuses(
            "newton::Newton::solve",
            "a residual that is no number",
            "",
            || newton.solve(&map, &mut [1.0]),
        );
        t.refuses(
            "newton::Newton::solve_semismooth",
            "a residual that is no number",
            "",
            || newton.solve_semismooth(&NoRoot(bad), &mut [1.0]),
        );
    }
    // A failed solve returns its best iterate and its history.
    for size in [1e-300, 1.0, 1e150, 1e300] {
        for damping in [Damping::OnTrouble, Damping::Always, Damping::Never] {
            t.holds(
                "newton::Newton::solve_semismooth",
                "a failure has its iterate and history",
                || {
                    let mut newton = Newton::new(NewtonOptions::default().with_damping(damping));
                    let mut x = [3.0];
                    match newton.solve_semismooth(&NoRoot(size), &mut x) {
                        Err(NewtonError::Failed(unsolved)) => {
                            unsolved.x.iter().all(|v| v.is_finite())
                                && unsolved.x.len() == 1
                                && (!unsolved.report.history.is_empty()
                                    || matches!(unsolved.status, Status::EvaluationFailure { .. }))
                        }
                        _ => false,
                    }
                },
            );
        }
    }
    for huge in [1e160, 1e300, f64::MAX] {
        t.survives("newton::Newton::solve", "huge x", || {
            newton.solve(&square(1), &mut [huge])
        });
    }

    let moore = || MoorePenrose::new(&vee(), DenseLu::new()).unwrap();
    t.refuses("newton::MoorePenrose::new", "an equation", "", || {
        MoorePenrose::new(&square(1), AutoSolver::new())
    });
    t.refuses("newton::MoorePenrose::new", "an empty map", "", || {
        MoorePenrose::new(&square(0), AutoSolver::new())
    });
    let choose = |_: &[f64], _: &mut Selection| {};
    let good = Selection::uniform(1, 0);
    for x in [vec![], vec![0.5], vec![0.5; 3]] {
        t.refuses(
            "newton::MoorePenrose::correct",
            "x of another length",
            "x",
            || {
                moore()
                    .correct(
                        &vee(),
                        &mut good.clone(),
                        choose,
                        &mut x.clone(),
                        &mut [1.0, 0.0],
                        (1e-9, 1e-9),
                        5,
                    )
                    .map(drop)
            },
        );
        t.refuses(
            "newton::MoorePenrose::correct",
            "t of another length",
            "t",
            || {
                moore()
                    .correct(
                        &vee(),
                        &mut good.clone(),
                        choose,
                        &mut [0.5; 2],
                        &mut x.clone(),
                        (1e-9, 1e-9),
                        5,
                    )
                    .map(drop)
            },
        );
        t.refuses(
            "newton::MoorePenrose::correct_in_plane",
            "x of another length",
            "x",
            || {
                moore()
                    .correct_in_plane(
                        &vee(),
                        &good,
                        (&[0.5; 2], &[1.0, 0.0], 0.1),
                        &mut x.clone(),
                        &mut [1.0, 0.0],
                    )
                    .map(drop)
            },
        );
        t.refuses(
            "newton::MoorePenrose::correct_in_plane",
            "t of another length",
            "t",
            || {
                moore()
                    .correct_in_plane(
                        &vee(),
                        &good,
                        (&[0.5; 2], &[1.0, 0.0], 0.1),
                        &mut [0.5; 2],
                        &mut x.clone(),
                    )
                    .map(drop)
            },
        );
        t.refuses(
            "newton::MoorePenrose::correct_in_plane",
            "an anchor of another length",
            "anchor",
            || {
                moore()
                    .correct_in_plane(
                        &vee(),
                        &good,
                        (&x, &[1.0, 0.0], 0.1),
                        &mut [0.5; 2],
                        &mut [1.0, 0.0],
                    )
                    .map(drop)
            },
        );
        t.refuses(
            "newton::MoorePenrose::correct_in_plane",
            "a normal of another length",
            "normal",
            || {
                moore()
                    .correct_in_plane(
                        &vee(),
                        &good,
                        (&[0.5; 2], &x, 0.1),
                        &mut [0.5; 2],
                        &mut [1.0, 0.0],
                    )
                    .map(drop)
            },
        );
        t.refuses(
            "newton::MoorePenrose::linearize",
            "x of another length",
            "x",
            || moore().linearize(&vee(), &good, &x, None).map(drop),
        );
        t.refuses(
            "newton::MoorePenrose::linearize",
            "a hint of another length",
            "hint",
            || moore().linearize(&vee(), &good, &[0.5; 2], Some(&x)).map(drop),
        );
    }
    t.refuses(
        "newton::MoorePenrose::linearize",
        "a map with other variables",
        "variables of the map",
        || moore().linearize(&square(1), &good, &[0.5; 2], None).map(drop),
    );
    for selection in [
        Selection::default(),
        Selection::uniform(2, 0),
        Selection::uniform(1, 9),
    ] {
        t.refuses(
            "newton::MoorePenrose::linearize",
            "a selection of another map",
            "selection",
            || moore().linearize(&vee(), &selection, &[0.5; 2], None).map(drop),
        );
        t.refuses(
            "newton::MoorePenrose::correct",
            "a selection of another map",
            "selection",
            || {
                moore()
                    .correct(
                        &vee(),
                        &mut selection.clone(),
                        choose,
                        &mut [0.5; 2],
                        &mut [1.0, 0.0],
                        (1e-9, 1e-9),
                        5,
                    )
                    .map(drop)
            },
        );
        t.refuses(
            "newton::MoorePenrose::correct_in_plane",
            "a selection of another map",
            "selection",
            || {
                moore()
                    .correct_in_plane(
                        &vee(),
                        &selection,
                        (&[0.5; 2], &[1.0, 0.0], 0.1),
                        &mut [0.5; 2],
                        &mut [1.0, 0.0],
                    )
                    .map(drop)
            },
        );
    }
    for bad in BAD {
        t.survives("newton::MoorePenrose::correct", "x", || {
            moore()
                .correct(
                    &vee(),
                    &mut good.clone(),
                    choose,
                    &mut [bad, 0.5],
                    &mut [1.0, 0.0],
                    (1e-9, 1e-9),
                    5,
                )
                .map(drop)
        });
        t.survives("newton::MoorePenrose::correct_in_plane", "s", || {
            moore()
                .correct_in_plane(
                    &vee(),
                    &good,
                    (&[0.5; 2], &[1.0, 0.0], bad),
                    &mut [0.5; 2],
                    &mut [1.0, 0.0],
                )
                .map(drop)
        });
        t.survives("newton::MoorePenrose::linearize", "no numbers", || {
            moore()
                .linearize(&no_numbers(bad), &good, &[bad, 0.5], None)
                .map(drop)
        });
    }
    let solve = |r: &[f64], t: &[f64], x: &mut [f64]| {
        let mut corrector = moore();
        corrector
            .linearize(&vee(), &good, &[0.5; 2], None)
            .unwrap()
            .solve(r, t, x)
    };
    let name = "newton::Linearisation::solve";
    for bad in [vec![], vec![1.0; 3]] {
        t.refuses(name, "r of another length", "right-hand side", || {
            solve(&bad, &[1.0, 0.0], &mut [0.0; 2])
        });
        t.refuses(name, "t of another length", "last row", || {
            solve(&[1.0], &bad, &mut [0.0; 2])
        });
        t.refuses(name, "x of another length", "solution", || {
            solve(&[1.0], &[1.0, 0.0], &mut bad.clone())
        });
    }
    t.refuses(name, "no row t", "", || solve(&[1.0], &[0.0; 2], &mut [0.0; 2]));
    for bad in BAD {
        t.survives(name, "r", || solve(&[bad], &[1.0, 0.0], &mut [0.0; 2]));
        t.refuses(name, "t", "", || solve(&[1.0], &[bad, 0.0], &mut [0.0; 2]));
    }
    t.refuses("newton::MoorePenrose::linearize", "another map", "", || {
        let wide = MinMap::curve(3, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a.copy_from_slice(&x[..3]);
            b.fill(1.0);
        });
        assert_eq!(wide.pattern(), Pattern::full(3, 4));
        moore()
            .linearize(&wide, &Selection::uniform(3, 0), &[0.5; 4], None)
            .map(drop)
    });
    t.exempt(
        &[
            "newton::Newton::solve_observed",
            "newton::Newton::solve_semismooth_observed",
        ],
        "what `solve` and `solve_semismooth` call",
    );
    t.finish();
}
