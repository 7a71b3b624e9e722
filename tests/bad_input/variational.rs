use std::ops::ControlFlow;

use semismooth::complementarity::{AffineFunction, ComplementarityError, McpFunction, WithJacobian};
use semismooth::enumeration::EnumerationOptions;
use semismooth::run::Status;
use semismooth::sparse::Matrix;
use semismooth::variational::{Polyhedron, Projection, Vi, ViSolver};

use super::complementarity::Shape;
use super::table::{BAD, Table, rows};

const INF: f64 = f64::INFINITY;

/// x₁ + x₂ ≤ 1, x₁ = x₂, x ≥ 0.
fn set() -> Polyhedron {
    Polyhedron::boxed(vec![0.0; 2], vec![INF; 2])
        .and_then(|set| set.with_inequalities(rows(&[&[1.0, 1.0]]), vec![1.0]))
        .and_then(|set| set.with_equations(rows(&[&[1.0, -1.0]]), vec![0.0]))
        .unwrap()
}

fn affine(n: usize) -> AffineFunction {
    AffineFunction::new(Matrix::identity(n), vec![-2.0; n]).unwrap()
}

/// x³ − 2 in each component; `spoilt` replaces the first value.
fn curved(spoilt: Option<f64>) -> impl McpFunction {
    WithJacobian::new(
        2,
        move |x: &[f64], out: &mut [f64]| {
            let value = |x: f64| spoilt.unwrap_or(x.powi(3) - 2.0);
            (out[0], out[1]) = (value(x[0]), x[1].powi(3) - 2.0);
        },
        |x: &[f64], jac: &mut Matrix| (0..2).for_each(|i| jac.add(i, i, 3.0 * x[i] * x[i])),
    )
}

/// x − α.
fn parametric() -> impl McpFunction {
    WithJacobian::parametric(
        2,
        |x: &[f64], out: &mut [f64]| (0..2).for_each(|i| out[i] = x[i] - x[2]),
        |_: &[f64], jac: &mut Matrix| {
            (0..2).for_each(|i| {
                jac.add(i, i, 1.0);
                jac.add(i, 2, -1.0);
            });
        },
    )
}

fn polyhedra(t: &mut Table) {
    let boxed = "variational::Polyhedron::boxed";
    t.refuses(
        "variational::Polyhedron::space",
        "no variables",
        "no variables",
        || Polyhedron::space(0),
    );
    t.refuses(boxed, "no variables", "no variables", || {
        Polyhedron::boxed(vec![], vec![])
    });
    t.refuses(boxed, "two lengths", "upper bounds has length 2", || {
        Polyhedron::boxed(vec![0.0], vec![0.0, 1.0])
    });
    for (lower, upper, names) in [
        (f64::NAN, 1.0, "lower"),
        (INF, INF, "lower"),
        (0.0, f64::NAN, "upper"),
        (-INF, -INF, "upper"),
    ] {
        t.refuses(boxed, "bounds that are none", names, || {
            Polyhedron::boxed(vec![-1.0, lower], vec![1.0, upper])
        });
    }
    type With = fn(Polyhedron, Matrix, Vec<f64>) -> Result<Polyhedron, ComplementarityError>;
    for (entry, with, names) in [
        (
            "variational::Polyhedron::with_inequalities",
            Polyhedron::with_inequalities as With,
            [
                "a row of A has length 3, expected 2",
                "b has length 1, expected 2",
                "b[1]",
            ],
        ),
        (
            "variational::Polyhedron::with_equations",
            Polyhedron::with_equations,
            [
                "a row of E has length 3, expected 2",
                "d has length 1, expected 2",
                "d[1]",
            ],
        ),
    ] {
        let plane = || Polyhedron::space(2).unwrap();
        t.refuses(entry, "rows of another length", names[0], || {
            with(plane(), Matrix::identity(3), vec![0.0; 3])
        });
        t.refuses(entry, "a short right-hand side", names[1], || {
            with(plane(), Matrix::identity(2), vec![0.0])
        });
        for bad in BAD {
            t.refuses(entry, "no numbers", names[2], || {
                with(plane(), Matrix::identity(2), vec![0.0, bad])
            });
            t.refuses(entry, "a matrix without numbers", "entry (0, 1)", || {
                with(plane(), rows(&[&[1.0, bad]]), vec![0.0])
            });
        }
    }
    for (entry, run) in [
        (
            "variational::Polyhedron::project",
            (|x| set().project(x).map(|_| ())) as fn(&[f64]) -> _,
        ),
        ("variational::Polyhedron::violation", |x| {
            set().violation(x).map(|_| ())
        }),
    ] {
        for x in [vec![], vec![0.0], vec![0.0; 3]] {
            t.refuses(entry, "another length", "x has length", || run(&x));
        }
        for bad in BAD {
            t.refuses(entry, "no numbers", "x[1]", || run(&[0.0, bad]));
        }
        t.survives(entry, "huge numbers", || run(&[f64::MAX, -f64::MAX]));
    }
}

/// A certificate: multipliers of one sign of rows that add up to 0 ≤ value < 0.
fn is_proof(p: Projection) -> bool {
    matches!(p, Projection::Empty(c) if c.value < 0.0 && c.radius == INF)
}

fn empty_sets(t: &mut Table) {
    let entry = "variational::Polyhedron::project";
    t.holds(entry, "boxes with l > u are proven empty", || {
        let set = Polyhedron::boxed(vec![0.0, 2.0], vec![1.0, 1.0]).unwrap();
        is_proof(set.project(&[0.0; 2]).unwrap())
    });
    t.holds(entry, "rows that contradict each other are proven empty", || {
        let far = set().with_inequalities(rows(&[&[-1.0, -1.0], &[1.0, 0.0]]), vec![-4.0, 1.0]);
        is_proof(far.unwrap().project(&[0.0; 2]).unwrap())
    });
    let nowhere = set().with_inequalities(rows(&[&[1.0, 0.0]]), vec![-1.0]).unwrap();
    t.holds(
        "variational::ViSolver::solve",
        "empty sets are proven empty",
        || {
            let vi = Vi::new(affine(2), nowhere.clone()).unwrap();
            let report = ViSolver::default().solve(&vi, &mut [0.5; 2]).unwrap();
            report.status == Status::EmptySet && report.infeasibility.is_some_and(|c| c.radius == INF)
        },
    );
    t.holds(
        "variational::Vi::all_solutions",
        "empty sets hold no solutions",
        || {
            let vi = Vi::new(affine(2), nowhere).unwrap();
            let all = vi.all_solutions(&EnumerationOptions::default()).unwrap();
            all.solutions.is_empty() && all.continua.is_empty()
        },
    );
}

fn problems(t: &mut Table) {
    let new = "variational::Vi::new";
    t.refuses(
        new,
        "another number of variables",
        "F has length 3, expected 2",
        || Vi::new(affine(3), set()),
    );
    for (vars, values, pattern, names) in [
        (4, 2, (2, 4), "the argument of F has length 4"),
        (2, 2, (3, 2), "a column of the pattern of F has length 3"),
        (2, 2, (2, 3), "a row of the pattern of F has length 3"),
        (3, 2, (2, 2), "a row of the pattern of F has length 2"),
    ] {
        let shape = Shape {
            vars,
            values,
            pattern,
        };
        t.refuses(new, "shapes that do not fit", names, || Vi::new(&shape, set()));
    }
    let with = "variational::Vi::with_parameters";
    t.refuses(with, "fewer variables", "F has length 1, expected 2", || {
        Vi::with_parameters(affine(1), set())
    });
    t.refuses(with, "no variables", "the argument of F has length 1", || {
        let shape = Shape {
            vars: 1,
            values: 2,
            pattern: (2, 1),
        };
        Vi::with_parameters(&shape, set()).map(drop)
    });
    let all = "variational::Vi::all_solutions";
    let o = EnumerationOptions::default;
    t.refuses(all, "F that is curved", "affine", || {
        Vi::new(curved(None), set()).unwrap().all_solutions(&o())
    });
    t.refuses(all, "a parameter", "parameter", || {
        Vi::new(parametric(), set()).unwrap().all_solutions(&o())
    });
    t.refuses(all, "two parameters", "parameter", || {
        let wide = Matrix::from_rows(&[[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]]).unwrap();
        let function = AffineFunction::with_parameters(wide, vec![0.0; 2]).unwrap();
        Vi::with_parameters(function, set()).unwrap().all_solutions(&o())
    });
    t.refuses(
        "variational::ViSolver::solve",
        "two parameters",
        "parameter",
        || {
            let wide = Matrix::from_rows(&[[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 1.0]]).unwrap();
            let function = AffineFunction::with_parameters(wide, vec![0.0; 2]).unwrap();
            let vi = Vi::with_parameters(function, set()).unwrap();
            ViSolver::default().solve(&vi, &mut [0.0; 2]).map(|_| ())
        },
    );
    t.refuses(all, "options out of range", "tolerance", || {
        Vi::new(affine(2), set())
            .unwrap()
            .all_solutions(&o().with_tolerance(f64::NAN))
    });
    t.refuses(
        "variational::Vi::kkt",
        "bounds that cross",
        "above upper[1]",
        || {
            let set = Polyhedron::boxed(vec![0.0, 2.0], vec![1.0, 1.0]).unwrap();
            Vi::new(affine(2), set).unwrap().kkt().map(|_| ())
        },
    );
}

fn solver(t: &mut Table) {
    let entry = "variational::ViSolver::solve";
    let vi = Vi::new(affine(2), set()).unwrap();
    for x in [vec![], vec![0.0], vec![0.0; 3]] {
        t.refuses(entry, "another length", "x has length", || {
            ViSolver::default().solve(&vi, &mut x.clone())
        });
    }
    t.refuses(entry, "a parameter", "parameter", || {
        ViSolver::default().solve(&Vi::new(parametric(), set()).unwrap(), &mut [0.0; 2])
    });
    let stray = Shape {
        vars: 2,
        values: 2,
        pattern: (2, 2),
    };
    t.refuses(entry, "entries outside of the pattern", "pattern", || {
        ViSolver::default().solve(&Vi::new(&stray, set()).unwrap(), &mut [0.0; 2])
    });
    for bad in BAD {
        t.refuses(entry, "no numbers", "x[1]", || {
            ViSolver::default().solve(&vi, &mut [0.0, bad])
        });
        t.refuses(
            "variational::ViSolver::solve_observed",
            "no numbers",
            "x[1]",
            || ViSolver::default().solve_observed(&vi, &mut [0.0, bad], |_| ControlFlow::Continue(())),
        );
        t.holds(
            entry,
            "F that is no number is told, and the start kept in C",
            || {
                let vi = Vi::new(curved(Some(bad)), set()).unwrap();
                let mut x = [3.0, -1.0];
                let report = ViSolver::default().solve(&vi, &mut x).unwrap();
                let told = report.status == Status::EvaluationFailure { component: 0 };
                told && report.residual.is_nan() && set().violation(&x).unwrap() < 1e-12
            },
        );
    }
    t.holds(
        entry,
        "without slope and bound there is a ray and no solution",
        || {
            let flat =
                AffineFunction::new(Matrix::from_rows(&[[0.0; 2]; 2]).unwrap(), vec![-1.0, 0.0]).unwrap();
            let vi = Vi::new(flat, Polyhedron::space(2).unwrap()).unwrap();
            let report = ViSolver::default().solve(&vi, &mut [0.5; 2]).unwrap();
            let ray = report.ray.unwrap();
            report.status == Status::NoSolution && ray.direction[0] > 0.0 && ray.value < 0.0
        },
    );
    t.holds(entry, "without slope, the best vertex is found", || {
        let flat = AffineFunction::new(Matrix::from_rows(&[[0.0; 2]; 2]).unwrap(), vec![-1.0, 0.5]).unwrap();
        let mut x = [0.0; 2];
        let vi = Vi::new(flat, set()).unwrap();
        let report = ViSolver::default().solve(&vi, &mut x).unwrap();
        report.is_solved() && (x[0] - 0.5).abs() + (x[1] - 0.5).abs() < 1e-12
    });
}

#[test]
fn variational_inequalities() {
    let mut t = Table::new("variational");
    polyhedra(&mut t);
    empty_sets(&mut t);
    problems(&mut t);
    solver(&mut t);
    t.finish();
}
