use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use semismooth::complementarity::active_set::{
    ActiveSetOptions, ActiveSetSolver, AutoReduced, DirectReduced, GmresReduced, MultigridReduced, Nested,
    ReducedSolver,
};
use semismooth::complementarity::pivoting::{Lemke, LemkeOptions};
use semismooth::complementarity::{
    AffineFunction, BoundState, ConstraintKind, Differenced, FischerBurmeister, Lcp, Mcp, McpFunction,
    McpOptions, McpSolver, Program, Variables, WithJacobian, check_jacobian, kkt, strong_regularity,
};
use semismooth::linear::{IncompleteLu, Prolongation};
use semismooth::piecewise::RegularityOptions;
use semismooth::sparse::{Matrix, Pattern};

use super::table::{BAD, NOT_POSITIVE, Table, rows};

const INF: f64 = f64::INFINITY;

fn definite() -> Matrix {
    rows(&[&[2.0, -1.0], &[-1.0, 2.0]])
}

/// F(x) = c x with c of any size, and a Jacobian to match.
fn times(c: f64) -> impl McpFunction + Clone {
    WithJacobian::new(
        2,
        move |x: &[f64], out: &mut [f64]| out.iter_mut().zip(x).for_each(|(f, x)| *f = c * x - 1.0),
        move |_: &[f64], jac: &mut Matrix| (0..2).for_each(|i| jac.add(i, i, c)),
    )
}

/// A function with arbitrary claims about its shape.
#[derive(Clone)]
pub(crate) struct Shape {
    pub(crate) vars: usize,
    pub(crate) values: usize,
    pub(crate) pattern: (usize, usize),
}
impl McpFunction for Shape {
    fn num_vars(&self) -> usize {
        self.vars
    }
    fn num_values(&self) -> usize {
        self.values
    }
    fn pattern(&self) -> Pattern {
        Pattern::full(self.pattern.0, self.pattern.1)
    }
    fn value(&self, _: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
    fn jacobian(&self, _: &[f64], jac: &mut Matrix) {
        jac.add(7, 7, 1.0);
    }
}

/// The default pattern, 640 GB here, is not built where another one is given.
#[test]
fn patterns_of_differences_are_built_on_demand() {
    let n = 200_000;
    let f = Differenced::new(n, |x: &[f64], out: &mut [f64]| out.copy_from_slice(x));
    assert_eq!(f.num_colors(), n);
    let f = f.with_pattern(Matrix::identity(n).pattern().clone());
    assert_eq!((f.num_colors(), f.pattern().nnz()), (1, n));
}

/// min c x² / 2 subject to x ≥ 1.
struct Square(f64);
impl Program for Square {
    fn num_vars(&self) -> usize {
        1
    }
    fn num_constraints(&self) -> usize {
        1
    }
    fn gradient(&self, x: &[f64], out: &mut [f64]) {
        out[0] = self.0 * x[0];
    }
    fn constraints(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] - 1.0;
    }
    fn constraint_jacobian(&self, _: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, 1.0);
    }
    fn hessian(&self, _: &[f64], _: &[f64], hessian: &mut Matrix) {
        hessian.add(0, 0, self.0);
    }
}

fn named() -> Variables {
    let mut variables = Variables::new();
    variables.add("flow", 2, 0.0, INF).unwrap();
    variables
}

fn variables(t: &mut Table) {
    t.refuses(
        "complementarity::Variables::add",
        "a name twice",
        "\"flow\"",
        || named().add("flow", 1, 0.0, 1.0),
    );
    t.refuses(
        "complementarity::Variables::add",
        "no variables",
        "no variables",
        || named().add("price", 0, 0.0, 1.0),
    );
    for (lower, upper, names) in [(f64::NAN, 1.0, "NaN"), (INF, INF, "inf"), (2.0, 1.0, "above")] {
        t.refuses("complementarity::Variables::add", names, names, || {
            named().add("price", 1, lower, upper)
        });
    }
    t.refuses(
        "complementarity::Variables::block",
        "another name",
        "\"flow\"",
        || named().block("price"),
    );
    t.refuses("complementarity::Variables::block", "no blocks", "none", || {
        Variables::new().block("price")
    });
    t.refuses(
        "complementarity::Variables::set_bounds",
        "another name",
        "\"price\"",
        || named().set_bounds("price", &[0.0], &[1.0]),
    );
    t.refuses(
        "complementarity::Variables::set_bounds",
        "too few",
        "length 1",
        || named().set_bounds("flow", &[0.0], &[1.0]),
    );
    t.refuses("complementarity::Variables::view", "too few", "length 1", || {
        named().view(&[0.0]).map(drop)
    });
    t.refuses(
        "complementarity::VariablesView::block",
        "another name",
        "\"price\"",
        || named().view(&[0.0; 2]).unwrap().block("price").map(drop),
    );
    t.refuses(
        "complementarity::Mcp::of_variables",
        "more variables",
        "length 3",
        || {
            Mcp::of_variables(times(1.0), &{
                let mut more = named();
                more.add("price", 1, 0.0, 1.0).unwrap();
                more
            })
            .map(drop)
        },
    );
}

#[test]
fn problems() {
    let mut t = Table::new("complementarity");
    variables(&mut t);
    let empty = || Matrix::zeros(Pattern::full(0, 0));

    for (new, name) in [
        (
            (|m, q| AffineFunction::new(m, q).map(drop)) as fn(Matrix, Vec<f64>) -> _,
            "complementarity::AffineFunction::new",
        ),
        (|m, q| Lcp::new(m, q).map(drop), "complementarity::Lcp::new"),
        (
            |m, q| Lcp::boxed(m, q, vec![0.0; 2], vec![1.0; 2]).map(drop),
            "complementarity::Lcp::boxed",
        ),
        (
            |m, q| Mcp::affine(m, q, vec![0.0; 2], vec![1.0; 2]).map(drop),
            "complementarity::Mcp::affine",
        ),
    ] {
        t.refuses(name, "q of another length", "q", || new(definite(), vec![1.0]));
        t.refuses(name, "an oblong matrix", "", || {
            new(Matrix::zeros(Pattern::full(2, 4)), vec![1.0; 2])
        });
        for bad in BAD {
            t.refuses(name, "q", "q[1]", || new(definite(), vec![1.0, bad]));
            t.refuses(name, "the matrix", "(0, 1)", || {
                new(rows(&[&[1.0, bad], &[0.0, 1.0]]), vec![1.0; 2])
            });
        }
    }
    let parametric = "complementarity::AffineFunction::with_parameters";
    t.refuses(parametric, "more rows than columns", "parameters", || {
        AffineFunction::with_parameters(rows(&[&[1.0], &[1.0]]), vec![1.0; 2])
    });
    t.refuses(parametric, "q of another length", "q", || {
        AffineFunction::with_parameters(definite(), vec![1.0])
    });
    t.refuses(parametric, "no unknowns", "no variables", || {
        AffineFunction::with_parameters(empty(), vec![])
    });
    t.refuses("complementarity::Lcp::new", "no unknowns", "no variables", || {
        Lcp::new(empty(), vec![])
    });
    t.refuses(
        "complementarity::Mcp::affine",
        "no unknowns",
        "no variables",
        || Mcp::affine(empty(), vec![], vec![], vec![]),
    );
    let bounds: [(&str, Vec<f64>, Vec<f64>); 8] = [
        ("lower", vec![0.0], vec![1.0; 2]),
        ("upper", vec![0.0; 2], vec![]),
        ("lower[1]", vec![0.0, f64::NAN], vec![1.0; 2]),
        ("lower[0]", vec![INF, 0.0], vec![INF; 2]),
        ("upper[0]", vec![0.0; 2], vec![f64::NAN, 1.0]),
        ("upper[1]", vec![-INF; 2], vec![1.0, -INF]),
        ("lower[1] = 2", vec![0.0, 2.0], vec![1.0; 2]),
        ("upper[0] = -2", vec![-1.0; 2], vec![-2.0, 1.0]),
    ];
    for (names, lower, upper) in bounds {
        let b = || (lower.clone(), upper.clone());
        t.refuses("complementarity::Variables::set_bounds", names, names, || {
            named().set_bounds("flow", &lower, &upper)
        });
        t.refuses("complementarity::Mcp::new", names, names, || {
            Mcp::new(times(1.0), b().0, b().1).map(drop)
        });
        t.refuses("complementarity::Mcp::affine", names, names, || {
            Mcp::affine(definite(), vec![1.0; 2], b().0, b().1)
        });
        t.refuses("complementarity::Lcp::boxed", names, names, || {
            Lcp::boxed(definite(), vec![1.0; 2], b().0, b().1)
        });
        t.survives("complementarity::Differenced::with_bounds", names, || {
            Differenced::new(2, |_: &[f64], _: &mut [f64]| {})
                .with_bounds(b().0, b().1)
                .is_ok()
        });
    }
    t.refuses(
        "complementarity::Differenced::with_bounds",
        "a lower bound of another length",
        "lower",
        || {
            Differenced::new(2, |_: &[f64], _: &mut [f64]| {})
                .with_bounds(vec![0.0], vec![1.0; 2])
                .map(drop)
        },
    );
    for (vars, values, pattern, names) in [
        (0, 0, (0, 0), "no variables"),
        (4, 2, (2, 4), "4 variables"),
        (1, 2, (2, 1), "1 variables"),
        (2, 2, (3, 3), "pattern"),
    ] {
        let f = || Shape {
            vars,
            values,
            pattern,
        };
        t.refuses("complementarity::Mcp::ncp", names, names, || {
            Mcp::ncp(f()).map(drop)
        });
        t.refuses("complementarity::Mcp::equations", names, names, || {
            Mcp::equations(f()).map(drop)
        });
    }
    let parametric = || {
        Mcp::ncp(Differenced::parametric(1, |x: &[f64], out: &mut [f64]| {
            out[0] = x[0] - x[1]
        }))
        .unwrap()
    };
    let fixed = || Mcp::ncp(times(1.0)).unwrap();
    t.refuses("complementarity::Mcp::at", "no parameter", "", || {
        fixed().at(0.0).map(drop)
    });
    t.refuses(
        "complementarity::Mcp::at_parameters",
        "too many",
        "parameters",
        || parametric().at_parameters(&[0.0; 2]).map(drop),
    );
    t.refuses("complementarity::Mcp::with_parameters", "bounds", "lower", || {
        Mcp::with_parameters(times(1.0), vec![0.0], vec![INF; 2]).map(drop)
    });
    t.refuses(
        "complementarity::Lcp::in_constants",
        "other rows",
        "columns C",
        || {
            let lcp = Lcp::new(Matrix::identity(2), vec![1.0; 2]).unwrap();
            lcp.in_constants(&Matrix::identity(3)).map(drop)
        },
    );
    for bad in BAD {
        t.refuses("complementarity::Mcp::at", "the parameter", "parameter", || {
            parametric().at(bad).map(drop)
        });
        t.refuses(
            "complementarity::Mcp::at_parameters",
            "a parameter",
            "parameters",
            || parametric().at_parameters(&[bad]).map(drop),
        );
        t.survives("complementarity::Mcp::project", "x", || {
            fixed().project(&mut [bad, bad])
        });
        t.survives("complementarity::Mcp::natural_residual", "x", || {
            fixed().natural_residual(&[bad, 0.0], &mut [0.0; 2])
        });
        let problem = Mcp::ncp(times(1.0)).unwrap();
        t.refuses("complementarity::strong_regularity", "x", "x", || {
            strong_regularity(&problem, &[bad, 0.0], 1e-9, 10)
        });
        t.refuses(
            "complementarity::strong_regularity",
            "x of another length",
            "x",
            || strong_regularity(&problem, &[0.0], 1e-9, 10),
        );
        t.survives("complementarity::strong_regularity", "tolerance", || {
            strong_regularity(&problem, &[0.0; 2], bad, 0)
        });
        t.survives(
            "complementarity::strong_regularity",
            "a matrix that is no number",
            || strong_regularity(&Mcp::ncp(times(bad)).unwrap(), &[0.0; 2], 1e-9, u64::MAX),
        );
        t.refuses("complementarity::check_jacobian", "x", "x[0]", || {
            check_jacobian(&times(1.0), &[bad, 0.0], 1e-6)
        });
        t.refuses(
            "complementarity::FischerBurmeister::penalised",
            "lambda",
            "lambda",
            || FischerBurmeister::penalised(&fixed(), bad).map(drop),
        );
        t.refuses("complementarity::Lcp::set_q", "q", "q[0]", || {
            lcp().set_q(&[bad, 0.0])
        });
        t.refuses("complementarity::Lcp::set_values", "values", "", || {
            lcp().set_values(&[bad, 0.0, 0.0, 0.0])
        });
        t.survives("complementarity::Lcp::natural_residual", "z", || {
            lcp().natural_residual(&[bad, bad], &mut [0.0; 2])
        });
    }
    for n in [0, 1, 3] {
        let x = vec![0.5; n];
        t.refuses(
            "complementarity::Mcp::natural_residual",
            "x of another length",
            "x",
            || fixed().natural_residual(&x, &mut [0.0; 2]),
        );
        t.refuses(
            "complementarity::Mcp::natural_residual",
            "out of another length",
            "out",
            || fixed().natural_residual(&[0.0; 2], &mut x.clone()),
        );
        t.refuses(
            "complementarity::check_jacobian",
            "x of another length",
            "x",
            || check_jacobian(&times(1.0), &x, 1e-6),
        );
        t.refuses("complementarity::Lcp::set_q", "another length", "q", || {
            lcp().set_q(&x)
        });
        t.refuses(
            "complementarity::Lcp::set_values",
            "another length",
            "values",
            || lcp().set_values(&x),
        );
        t.survives("complementarity::Mcp::project", "another length", || {
            fixed().project(&mut x.clone())
        });
        t.survives("complementarity::Lcp::natural_residual", "another length", || {
            lcp().natural_residual(&x, &mut x.clone())
        });
    }
    t.refuses(
        "complementarity::FischerBurmeister::new",
        "a parametric problem",
        "",
        || FischerBurmeister::new(&parametric()).map(drop),
    );
    for bad in [0.0, -1.0, 1.5] {
        t.refuses(
            "complementarity::FischerBurmeister::penalised",
            "lambda",
            "lambda",
            || FischerBurmeister::penalised(&fixed(), bad).map(drop),
        );
    }
    t.refuses("complementarity::check_jacobian", "a wrong Jacobian", "0", || {
        let wrong = WithJacobian::new(
            1,
            |x: &[f64], out: &mut [f64]| out[0] = x[0] * x[0],
            |_: &[f64], jac: &mut Matrix| jac.add(0, 0, 7.0),
        );
        check_jacobian(&wrong, &[1.0], 1e-6)
    });
    t.refuses(
        "complementarity::check_jacobian",
        "a Jacobian that leaves its pattern",
        "(7, 7)",
        || {
            check_jacobian(
                &Shape {
                    vars: 2,
                    values: 2,
                    pattern: (2, 2),
                },
                &[0.0; 2],
                1e-6,
            )
        },
    );
    let kinds = [ConstraintKind::Nonnegative];
    t.refuses("complementarity::kkt", "no kinds", "", || {
        kkt(Square(1.0), &[], vec![-INF], vec![INF]).map(drop)
    });
    t.refuses(
        "complementarity::kkt",
        "bounds of another length",
        "lower",
        || kkt(Square(1.0), &kinds, vec![], vec![INF]).map(drop),
    );
    t.refuses("complementarity::kkt", "crossed bounds", "lower[0]", || {
        kkt(Square(1.0), &kinds, vec![2.0], vec![1.0]).map(drop)
    });

    solvers(&mut t);
    t.finish();
}

fn lcp() -> Lcp {
    Lcp::new(definite(), vec![-1.0, 1.0]).unwrap()
}

fn solvers(t: &mut Table) {
    let mut options = vec![
        ("max_iterations", McpOptions::default().with_max_iterations(0)),
        ("max_attempt", McpOptions::default().with_max_attempt(0)),
        ("strategies", McpOptions::default().with_strategies(Vec::new())),
    ];
    for bad in [f64::NAN, INF, -1.0] {
        options.push(("tolerance", McpOptions::default().with_tolerance(bad)));
        options.push(("acceptable", McpOptions::default().with_acceptable(bad)));
        let regularity = Some(RegularityOptions::default().with_tolerance(bad));
        options.push((
            "regularity.tolerance",
            McpOptions::default().with_regularity(regularity),
        ));
    }
    let problem = || Mcp::ncp(times(1.0)).unwrap();
    for (name, o) in options {
        t.refuses("complementarity::McpOptions::validate", name, name, || {
            o.validate()
        });
        t.refuses("complementarity::McpSolver::solve", name, name, || {
            McpSolver::new(o.clone())
                .solve(&problem(), &mut [0.0; 2])
                .map(drop)
        });
    }
    let mut solver = McpSolver::new(McpOptions::default());
    let parametric = Mcp::ncp(Differenced::parametric(1, |x: &[f64], out: &mut [f64]| {
        out[0] = x[0] - x[1]
    }))
    .unwrap();
    t.refuses(
        "complementarity::McpSolver::solve",
        "a parametric problem",
        "",
        || solver.solve(&parametric, &mut [0.0; 2]).map(drop),
    );
    for x in [vec![], vec![0.0], vec![0.0; 3]] {
        t.refuses(
            "complementarity::McpSolver::solve",
            "x of another length",
            "x",
            || solver.solve(&problem(), &mut x.clone()).map(drop),
        );
        t.refuses(
            "complementarity::McpSolver::solve_from_states",
            "states of another length",
            "active set",
            || {
                solver
                    .solve_from_states(&problem(), &mut [0.0; 2], &vec![BoundState::Lower; x.len()])
                    .map(drop)
            },
        );
    }
    for bad in BAD {
        t.refuses("complementarity::McpSolver::solve", "x", "x[1]", || {
            solver.solve(&problem(), &mut [0.0, bad]).map(drop)
        });
        t.refuses(
            "complementarity::McpSolver::solve_from_states",
            "x",
            "x[1]",
            || {
                solver
                    .solve_from_states(&problem(), &mut [0.0, bad], &[BoundState::Lower; 2])
                    .map(drop)
            },
        );
        t.survives(
            "complementarity::McpSolver::solve_from_states",
            "states that are no bounds",
            || {
                let free = Mcp::equations(times(1.0)).unwrap();
                solver
                    .solve_from_states(&free, &mut [0.0; 2], &[BoundState::Upper; 2])
                    .map(drop)
            },
        );
    }
    t.refuses(
        "complementarity::McpSolver::solve",
        "a Jacobian that leaves its pattern",
        "(7, 7)",
        || {
            let f = Shape {
                vars: 2,
                values: 2,
                pattern: (2, 2),
            };
            let shifted = Mcp::new(f, vec![-1.0; 2], vec![1.0; 2])?;
            solver.solve(&shifted, &mut [0.5; 2]).map(drop)
        },
    );
    // Whatever the values, the solver ends in bounded time; if it reports a solution, the residual is small.
    for c in [0.0, -1.0, 1e-300, 1e160, 1e300, f64::MAX, f64::NAN, INF, -INF] {
        for (lower, upper) in [(0.0, INF), (-INF, INF), (0.0, 1.0), (1.0, 1.0), (-1e300, 1e300)] {
            t.holds(
                "complementarity::McpSolver::solve",
                &format!("the report of F = {c} x - 1 over [{lower}, {upper}] is true"),
                || {
                    let Ok(problem) = Mcp::new(times(c), vec![lower; 2], vec![upper; 2]) else {
                        return false;
                    };
                    let mut x = [0.5; 2];
                    let mut out = [0.0; 2];
                    match McpSolver::new(McpOptions::default()).solve(&problem, &mut x) {
                        Err(_) => true,
                        Ok(report) if report.is_solved() => {
                            problem.natural_residual(&x, &mut out).is_ok_and(|r| r <= 1e-6)
                        }
                        Ok(report) => !report.history.is_empty() || report.iterations == 0,
                    }
                },
            );
        }
    }
    for time in [Duration::ZERO, Duration::MAX] {
        t.survives("complementarity::McpSolver::solve", "absurd time", || {
            let o = McpOptions::default()
                .with_max_time(Some(time))
                .with_restarts(0)
                .with_max_path_size(usize::MAX);
            McpSolver::new(o).solve(&problem(), &mut [3.0; 2]).map(drop)
        });
    }
    for n in [1, usize::MAX] {
        t.survives("complementarity::McpSolver::solve", "absurd limits", || {
            let o = McpOptions::default().with_max_iterations(n).with_max_attempt(n);
            McpSolver::new(o).solve(&problem(), &mut [3.0; 2]).map(drop)
        });
    }

    let mut options = vec![(
        "max_iterations",
        ActiveSetOptions::default().with_max_iterations(0),
    )];
    for bad in [f64::NAN, INF, 0.0, -1.0] {
        options.push(("tolerance", ActiveSetOptions::default().with_tolerance(bad)));
    }
    for (name, o) in options {
        t.refuses(
            "complementarity::active_set::ActiveSetOptions::validate",
            name,
            name,
            || o.validate(),
        );
        t.refuses(
            "complementarity::active_set::ActiveSetSolver::solve",
            name,
            name,
            || ActiveSetSolver::new(o.clone()).solve(&lcp(), &mut [0.0; 2]),
        );
        t.refuses("complementarity::active_set::Nested::solve", name, name, || {
            Nested::new(lcp()).solve(&o, &mut [0.0; 2])
        });
    }
    let o = ActiveSetOptions::default;
    for n in [0, 1, 3] {
        t.refuses(
            "complementarity::active_set::ActiveSetSolver::solve",
            "z of another length",
            "the start",
            || ActiveSetSolver::new(o()).solve(&lcp(), &mut vec![0.0; n]),
        );
        t.refuses(
            "complementarity::active_set::ActiveSetSolver::solve_from_states",
            "sets of another length",
            "set",
            || {
                ActiveSetSolver::new(o()).solve_from_states(
                    &lcp(),
                    &mut [0.0; 2],
                    &vec![BoundState::Lower; n],
                )
            },
        );
        t.refuses(
            "complementarity::active_set::Nested::solve",
            "z of another length",
            "the point",
            || Nested::new(lcp()).solve(&o(), &mut vec![0.0; n]),
        );
        t.refuses(
            "complementarity::pivoting::Lemke::solve",
            "z of another length",
            "the point",
            || Lemke::new(LemkeOptions::default()).solve(&lcp(), &mut vec![0.0; n]),
        );
        t.refuses(
            "complementarity::pivoting::Lemke::solve_observed",
            "z of another length",
            "the point",
            || Lemke::default().solve_observed(&lcp(), &mut vec![0.0; n], |_| ControlFlow::Continue(())),
        );
    }
    let matrices = [
        ("singular", rows(&[&[1.0, 1.0], &[1.0, 1.0]])),
        ("zero", Matrix::zeros(Pattern::full(2, 2))),
        ("indefinite", rows(&[&[1.0, 2.0], &[2.0, 1.0]])),
        ("unsymmetric", rows(&[&[0.0, 1.0], &[-1.0, 0.0]])),
        (
            "no diagonal",
            Matrix::from_triplets(2, 2, &[(0, 1, 1.0)]).unwrap(),
        ),
        ("huge", rows(&[&[1e300, 1e300], &[1e300, 1e308]])),
        ("tiny", rows(&[&[1e-300, 0.0], &[0.0, 1e-320]])),
    ];
    for (input, m) in &matrices {
        for q in [[-1.0, -1.0], [1e300, -1e300], [f64::MAX, -f64::MAX]] {
            let problem = || Lcp::new(m.clone(), q.to_vec()).unwrap();
            let boxed = || Lcp::boxed(m.clone(), q.to_vec(), vec![-1.0; 2], vec![1.0; 2]).unwrap();
            for lcp in [problem(), boxed()] {
                let mut run = |name: &'static str, call: &dyn Fn(&mut [f64])| {
                    t.survives(name, input, || call(&mut [0.0; 2]));
                };
                run("complementarity::pivoting::Lemke::solve", &|z| {
                    drop(Lemke::new(LemkeOptions::default()).solve(&lcp, z));
                });
                let active = "complementarity::active_set::ActiveSetSolver::solve";
                run(active, &|z| {
                    drop(ActiveSetSolver::with_reduced(o(), AutoReduced::new()).solve(&lcp, z))
                });
                run(active, &|z| {
                    drop(ActiveSetSolver::with_reduced(o(), DirectReduced::new()).solve(&lcp, z))
                });
                run(active, &|z| {
                    drop(
                        ActiveSetSolver::with_reduced(o(), GmresReduced::new(IncompleteLu::default()))
                            .solve(&lcp, z),
                    )
                });
                run(active, &|z| {
                    drop(ActiveSetSolver::with_reduced(o(), MultigridReduced::algebraic()).solve(&lcp, z))
                });
                run("complementarity::active_set::Nested::solve", &|z| {
                    drop(Nested::new(lcp.clone()).solve(&o(), z))
                });
            }
        }
    }
    for bad in BAD {
        t.survives(
            "complementarity::active_set::ActiveSetSolver::solve",
            "a start that is no number",
            || ActiveSetSolver::new(o()).solve(&lcp(), &mut [bad; 2]),
        );
        t.refuses(
            "complementarity::pivoting::Lemke::solve",
            "a covering vector",
            "covering",
            || Lemke::new(LemkeOptions::default().with_covering(vec![1.0, bad])).solve(&lcp(), &mut [0.0; 2]),
        );
    }
    for bad in NOT_POSITIVE {
        t.refuses(
            "complementarity::pivoting::Lemke::solve",
            "a covering vector",
            "covering",
            || Lemke::new(LemkeOptions::default().with_covering(vec![bad, 1.0])).solve(&lcp(), &mut [0.0; 2]),
        );
    }
    t.refuses(
        "complementarity::pivoting::Lemke::solve",
        "a covering vector of another length",
        "covering",
        || Lemke::new(LemkeOptions::default().with_covering(vec![1.0])).solve(&lcp(), &mut [0.0; 2]),
    );
    for n in [0, usize::MAX] {
        t.survives("complementarity::pivoting::Lemke::solve", "absurd limits", || {
            Lemke::new(LemkeOptions::default().with_max_pivots(n)).solve(&lcp(), &mut [0.0; 2])
        });
        t.survives(
            "complementarity::active_set::ActiveSetSolver::solve",
            "absurd limits",
            || {
                ActiveSetSolver::new(o().with_patience(n).with_max_iterations(n.max(1)))
                    .solve(&lcp(), &mut [0.0; 2])
            },
        );
    }
    let prolongation = || Prolongation::new(&rows(&[&[1.0], &[1.0]])).unwrap();
    let other = || Prolongation::new(&rows(&[&[1.0], &[1.0], &[1.0]])).unwrap();
    t.refuses(
        "complementarity::active_set::Nested::coarsen",
        "another size",
        "",
        || Nested::new(lcp()).coarsen(other()),
    );
    t.refuses(
        "complementarity::active_set::Nested::with_coarser",
        "another size",
        "",
        || Nested::new(lcp()).with_coarser(Lcp::new(rows(&[&[1.0]]), vec![1.0]).unwrap(), other()),
    );
    t.refuses(
        "complementarity::active_set::Nested::with_coarser",
        "a coarse problem of another size",
        "",
        || Nested::new(lcp()).with_coarser(lcp(), prolongation()),
    );
    t.refuses(
        "complementarity::active_set::ReducedSolver::load",
        "prolongations of another size",
        "",
        || MultigridReduced::with_prolongations(vec![Arc::new(other())]).load(&definite()),
    );
    // Reduced solvers are public: here they are called out of order, with arguments that do not fit.
    type Make = fn() -> Box<dyn ReducedSolver>;
    let reduced: [(&str, Make); 4] = [
        ("AutoReduced", || Box::new(AutoReduced::new())),
        ("DirectReduced", || Box::new(DirectReduced::new())),
        ("GmresReduced", || {
            Box::new(GmresReduced::new(IncompleteLu::default()))
        }),
        ("MultigridReduced", || Box::new(MultigridReduced::algebraic())),
    ];
    for (name, new) in reduced {
        t.survives("complementarity::active_set::ReducedSolver::load", name, || {
            new().load(&rows(&[&[1.0, 2.0]]))
        });
        t.survives("complementarity::active_set::ReducedSolver::select", name, || {
            new().select(&definite(), &[true, true])
        });
        t.survives("complementarity::active_set::ReducedSolver::select", name, || {
            let mut solver = new();
            solver.load(&definite())?;
            solver.select(&definite(), &[true])
        });
        t.survives("complementarity::active_set::ReducedSolver::solve", name, || {
            new().solve(&mut [1.0; 2], &mut [0.0; 2], 1e-9)
        });
        t.survives("complementarity::active_set::ReducedSolver::solve", name, || {
            let mut solver = new();
            solver.load(&definite())?;
            solver.select(&definite(), &[true, true])?;
            solver.solve(&mut [1.0], &mut [0.0], f64::NAN)
        });
        t.survives(
            "complementarity::active_set::ReducedSolver::coarse_start",
            name,
            || new().coarse_start(&lcp(), &o()),
        );
    }
    t.exempt(
        &[
            "complementarity::McpSolver::solve_observed",
            "complementarity::active_set::ActiveSetSolver::solve_observed",
        ],
        "called by the functions without a callback",
    );
}
