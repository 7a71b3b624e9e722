use std::ops::ControlFlow;

use semismooth::complementarity::{AffineFunction, WithJacobian};
use semismooth::cones::{Cone, ConeMap, ConeOptions, ConePieces, ConeProblem, ConeSolver, smat, svec};
use semismooth::piecewise::Semismooth;
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use super::complementarity::Shape;
use super::table::{BAD, Table};

fn identity(n: usize) -> AffineFunction {
    AffineFunction::new(Matrix::identity(n), vec![0.5; n]).unwrap()
}

fn problems(t: &mut Table) {
    let new = "cones::ConeProblem::new";
    t.refuses(new, "no cones", "no variables", || {
        ConeProblem::new(identity(3), vec![])
    });
    let none = [
        Cone::Free(0),
        Cone::Nonnegative(0),
        Cone::SecondOrder(0),
        Cone::Semidefinite(0),
    ];
    for cone in none {
        t.refuses(new, "a cone without variables", "cone 1 has no variables", || {
            ConeProblem::new(identity(3), vec![Cone::SecondOrder(3), cone])
        });
        t.refuses(new, "nothing else", "cone 0 has no variables", || {
            ConeProblem::new(identity(3), vec![cone])
        });
    }
    for huge in [
        Cone::Free(usize::MAX),
        Cone::Nonnegative(usize::MAX),
        Cone::SecondOrder(usize::MAX),
        Cone::Semidefinite(usize::MAX),
    ] {
        t.refuses(
            new,
            "more variables than a usize counts",
            "up to number 1",
            || ConeProblem::new(identity(3), vec![huge, Cone::Free(4)]),
        );
        let named = format!("F has length 3, expected {}", usize::MAX);
        t.refuses(new, "more variables than F has", &named, || {
            ConeProblem::new(identity(3), vec![huge])
        });
    }
    t.holds(new, "orders up to 6e9 are counted", || {
        let order = 6_000_000_000_u64;
        let counted = |order: u64| usize::try_from(u128::from(order) * u128::from(order + 1) / 2);
        [order, order + 1].iter().all(|&order| {
            let len = usize::try_from(order).map(|order| Cone::Semidefinite(order).len());
            len.is_err() || counted(order).is_ok_and(|counted| len == Ok(counted))
        })
    });
    for (vars, values, pattern, names) in [
        (3, 2, (2, 3), "F has length 2, expected 3"),
        (4, 3, (3, 4), "the argument of F has length 4, expected 3"),
        (
            3,
            3,
            (2, 3),
            "a column of the pattern of F has length 2, expected 3",
        ),
        (3, 3, (3, 4), "a row of the pattern of F has length 4, expected 3"),
    ] {
        let shape = Shape {
            vars,
            values,
            pattern,
        };
        t.refuses(new, "shapes that do not fit", names, || {
            ConeProblem::new(&shape, vec![Cone::SecondOrder(3)])
        });
    }
}

fn points(t: &mut Table) {
    let problem = ConeProblem::new(identity(3), vec![Cone::SecondOrder(3)]).unwrap();
    for n in [0, 2, 4] {
        let mut x = vec![0.0; n];
        t.refuses("cones::ConeProblem::project", "another length", "x has", || {
            problem.project(&mut x)
        });
        let residual = "cones::ConeProblem::natural_residual";
        t.refuses(residual, "x of another length", "x has", || {
            problem.natural_residual(&x, &mut [0.0; 3])
        });
        t.refuses(residual, "out of another length", "out has", || {
            problem.natural_residual(&[0.0; 3], &mut x)
        });
        t.refuses(
            "cones::ConeSolver::solve",
            "another length",
            "the start has",
            || ConeSolver::default().solve(&problem, &mut x),
        );
    }
    for bad in BAD {
        let mut x = [0.0, bad, 0.0];
        t.survives("cones::ConeProblem::project", "no numbers", || {
            problem.project(&mut x.clone())
        });
        t.holds(
            "cones::ConeProblem::natural_residual",
            "what is no number has no finite residual",
            || !problem.natural_residual(&x, &mut [0.0; 3]).unwrap().is_finite(),
        );
        t.refuses("cones::ConeSolver::solve", "no numbers", "[1]", || {
            ConeSolver::default().solve(&problem, &mut x)
        });
        t.refuses("cones::ConeSolver::solve_observed", "no numbers", "[1]", || {
            ConeSolver::default().solve_observed(&problem, &mut x, |_| ControlFlow::Continue(()))
        });
    }
    let none = ConeOptions::default().with_strategies(Vec::new());
    t.refuses(
        "cones::ConeOptions::validate",
        "no strategies",
        "strategies",
        || none.validate(),
    );
    t.refuses("cones::ConeSolver::solve", "no strategies", "strategies", || {
        ConeSolver::new(none.clone()).solve(&problem, &mut [0.0; 3])
    });
    for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0, 1e-17, 1.0] {
        let options = ConeOptions::default().with_tolerance(bad);
        t.refuses("cones::ConeOptions::validate", "tolerance", "tolerance", || {
            options.validate()
        });
        t.refuses("cones::ConeSolver::solve", "tolerance", "tolerance", || {
            ConeSolver::new(options.clone()).solve(&problem, &mut [0.0; 3])
        });
    }
}

/// F and Jacobians that are NaN or infinite at the start, on each kind of cone.
fn functions(t: &mut Table) {
    let solve = "cones::ConeSolver::solve";
    let kinds = [
        vec![Cone::Free(3)],
        vec![Cone::Nonnegative(3)],
        vec![Cone::SecondOrder(3)],
        vec![Cone::Semidefinite(2)],
    ];
    for cones in kinds {
        for bad in BAD {
            for in_value in [true, false] {
                let function = WithJacobian::new(
                    3,
                    move |x: &[f64], out: &mut [f64]| {
                        out.copy_from_slice(x);
                        out[1] = if in_value { bad } else { 1.0 };
                    },
                    move |_: &[f64], jac: &mut Matrix| {
                        (0..3).for_each(|i| jac.add(i, i, if in_value { 1.0 } else { bad }));
                    },
                );
                let problem = ConeProblem::new(function, cones.clone()).unwrap();
                t.holds(solve, "the start, projected, is kept, and the end told", || {
                    let mut x = [1.0, 0.5, 2.0];
                    let mut projected = x;
                    problem.project(&mut projected).unwrap();
                    let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
                    let component = usize::from(in_value);
                    x == projected && report.status == Status::EvaluationFailure { component }
                });
            }
        }
    }
    let stray = Shape {
        vars: 3,
        values: 3,
        pattern: (3, 3),
    };
    let problem = ConeProblem::new(&stray, vec![Cone::SecondOrder(3)]).unwrap();
    t.refuses(solve, "entries outside of the pattern", "(7, 7)", || {
        ConeSolver::default().solve(&problem, &mut [1.0, 0.0, 0.0])
    });
    for limits in [
        ConeOptions::default().with_max_iterations(0),
        ConeOptions::default().with_restarts(0),
        ConeOptions::default().with_max_time(Some(std::time::Duration::ZERO)),
    ] {
        t.survives(solve, "absurd limits", || {
            let problem = ConeProblem::new(identity(3), vec![Cone::SecondOrder(3)]).unwrap();
            ConeSolver::new(limits).solve(&problem, &mut [1.0, 2.0, 3.0])
        });
    }
}

fn maps(t: &mut Table) {
    let problem = ConeProblem::new(identity(3), vec![Cone::SecondOrder(3)]).unwrap();
    t.exempt(
        &[
            "cones::ConeMap::natural",
            "cones::ConeMap::normal",
            "cones::ConeMap::fischer_burmeister",
        ],
        "the problem has been checked",
    );
    for mu in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        t.refuses(
            "cones::ConeMap::smoothed",
            "no number, or none above 0",
            "mu",
            || ConeMap::smoothed(&problem, mu),
        );
    }
    for lambda in [f64::NAN, f64::INFINITY, 0.0, -1.0, 1.1] {
        t.refuses("cones::ConeMap::penalised", "not in (0, 1]", "lambda", || {
            ConeMap::penalised(&problem, lambda)
        });
    }
    for bad in BAD {
        let map = ConeMap::fischer_burmeister(&problem).unwrap();
        t.survives("cones::ConeMap::fischer_burmeister", "no numbers", || {
            let mut jac = Matrix::zeros(map.pattern());
            map.jacobian(&[1.0, bad, 0.0], &mut jac);
            map.residual(&[bad, 0.0, 0.0], &mut [0.0; 3]);
        });
    }
}

fn matrices(t: &mut Table) {
    t.refuses("cones::smat", "5 numbers", "length 5, expected 6", || {
        smat(&[1.0; 5])
    });
    t.refuses("cones::svec", "a short row", "length 1, expected 2", || {
        svec(&[vec![1.0, 2.0], vec![1.0]])
    });
    t.holds("cones::svec", "the matrix of order 0 has no entries", || {
        svec::<Vec<f64>>(&[]).unwrap() == smat(&[]).unwrap().concat()
    });
}

#[test]
fn cones() {
    let mut t = Table::new("cones");
    problems(&mut t);
    points(&mut t);
    functions(&mut t);
    maps(&mut t);
    matrices(&mut t);
    pieces(&mut t);
    t.finish();
}

fn pieces(t: &mut Table) {
    let new = "cones::ConePieces::new";
    t.refuses(new, "no cones", "no variables", || {
        ConePieces::new(identity(3), vec![])
    });
    t.refuses(new, "a cone without variables", "cone 1", || {
        ConePieces::new(identity(3), vec![Cone::Free(3), Cone::SecondOrder(0)])
    });
    t.refuses(new, "more variables than can be counted", "cone", || {
        ConePieces::new(identity(3), vec![Cone::Free(usize::MAX), Cone::Nonnegative(2)])
    });
    t.refuses(new, "matrices", "semidefinite", || {
        ConePieces::new(identity(3), vec![Cone::Semidefinite(2)])
    });
    t.refuses(new, "F of other values", "F has length 3, expected 2", || {
        ConePieces::new(identity(3), vec![Cone::SecondOrder(2)])
    });
}
