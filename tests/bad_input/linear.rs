use semismooth::linear::{
    AutoSolver, BlockDiagonal, Bordered, Cholesky, Condensation, DenseLu, IncompleteLu, Krylov, LinearError,
    LinearOperator, LinearSolver, Multigrid, Preconditioned, Preconditioner, Prolongation, SparseLu,
    eigenvalues, generalized_eigenvalues, null_space, symmetric_eigenvalues,
};
use semismooth::sparse::{Matrix, MatrixRef, Pattern, PatternRef};

use super::table::{BAD, Table, rows};

fn solvers(t: &mut Table, name: &str, new: fn() -> Box<dyn LinearSolver>, definite: bool) {
    let good = || rows(&[&[2.0, -1.0], &[-1.0, 2.0]]);
    let factored = |a: &Matrix| -> Result<Box<dyn LinearSolver>, LinearError> {
        let mut solver = new();
        solver.analyze(a.pattern().as_ref())?;
        solver.factor(a.as_ref())?;
        Ok(solver)
    };
    let solved = |a: &Matrix, b: f64| -> Result<Vec<f64>, LinearError> {
        let mut x = vec![b; a.nrows()];
        factored(a)?.solve_in_place(&mut x)?;
        match x.iter().all(|v| v.is_finite()) {
            true => Ok(x),
            false => panic!("{name} hands out {x:?}"),
        }
    };
    let factor = "linear::LinearSolver::factor";
    let analyze = "linear::LinearSolver::analyze";
    t.refuses(analyze, name, "1 x 2", || factored(&rows(&[&[1.0, 2.0]])));
    t.refuses(factor, name, "analyze", || new().factor(good().as_ref()));
    t.refuses(factor, name, "", || {
        let mut solver = new();
        solver.analyze(Pattern::full(3, 3).as_ref())?;
        solver.factor(good().as_ref())
    });
    let what = if definite { "positive definite" } else { "singular" };
    t.refuses(factor, &format!("{name}, singular"), what, || {
        solved(&rows(&[&[1.0, 2.0], &[2.0, 4.0]]), 1.0)
    });
    t.refuses(factor, &format!("{name}, zero"), what, || {
        solved(&rows(&[&[0.0, 0.0], &[0.0, 0.0]]), 1.0)
    });
    t.refuses(factor, &format!("{name}, no entries"), what, || {
        solved(&Matrix::from_triplets(2, 2, &[]).unwrap(), 1.0)
    });
    if definite {
        t.refuses(factor, name, what, || {
            solved(&rows(&[&[1.0, 2.0], &[2.0, 1.0]]), 1.0)
        });
    }
    for bad in BAD {
        t.refuses(factor, name, "NaN or infinite", || {
            factored(&rows(&[&[2.0, bad], &[bad, 2.0]]))
        });
        t.survives("linear::LinearSolver::solve_in_place", name, || {
            factored(&good()).unwrap().solve_in_place(&mut [bad, 1.0])
        });
        t.survives("linear::LinearSolver::solve_transpose_in_place", name, || {
            factored(&good())
                .unwrap()
                .solve_transpose_in_place(&mut [bad, 1.0])
        });
    }
    t.refuses("linear::LinearSolver::solve_in_place", name, "factor", || {
        new().solve_in_place(&mut [1.0])
    });
    t.refuses(
        "linear::LinearSolver::solve_transpose_in_place",
        name,
        "factor",
        || new().solve_transpose_in_place(&mut [1.0]),
    );
    t.refuses("linear::LinearSolver::solve_in_place", name, "expected", || {
        factored(&good())?.solve_in_place(&mut [1.0])
    });
    t.refuses(
        "linear::LinearSolver::solve_transpose_in_place",
        name,
        "expected",
        || factored(&good())?.solve_transpose_in_place(&mut [1.0; 3]),
    );
    for size in [1e-320, 1e-300, 1e300, f64::MAX] {
        let scaled =
            Matrix::from_rows(&[vec![2.0 * (size / 2.0), -size / 2.0], vec![-size / 2.0, size]]).unwrap();
        t.survives(factor, &format!("{name}, entries of size {size:e}"), || {
            solved(&scaled, 1.0)
        });
        t.survives(
            factor,
            &format!("{name}, right-hand side of size {size:e}"),
            || solved(&good(), size).is_ok(),
        );
    }
    t.survives(factor, &format!("{name}, empty"), || {
        solved(&Matrix::from_triplets(0, 0, &[]).unwrap(), 1.0)
    });
    // Views are public structs: their parts need not fit.
    for (nrows, ncols, col_ptr, row_idx, values) in [
        (2, 2, vec![], vec![], vec![]),
        (2, 2, vec![0, 1], vec![0], vec![1.0]),
        (2, 2, vec![0, 1, 9], vec![0, 1], vec![1.0, 1.0]),
        (2, 2, vec![0, 1, 2], vec![0, 7], vec![1.0, 1.0]),
        (2, 2, vec![0, 2, 1], vec![0, 1], vec![1.0, 1.0]),
        (2, 2, vec![0, 1, 2], vec![0, 1], vec![1.0]),
        (usize::MAX, usize::MAX, vec![0, 1, 2], vec![0, 1], vec![1.0, 1.0]),
    ] {
        let pattern = PatternRef {
            nrows,
            ncols,
            col_ptr: &col_ptr,
            row_idx: &row_idx,
        };
        let a = MatrixRef {
            pattern,
            values: &values,
        };
        t.refuses(analyze, &format!("{name}, a view {pattern:?}"), "", || {
            let mut solver = new();
            solver.analyze(pattern)?;
            solver.factor(a)
        });
    }
}

#[test]
fn linear_algebra() {
    let mut t = Table::new("linear");
    solvers(&mut t, "DenseLu", || Box::new(DenseLu::new()), false);
    solvers(&mut t, "SparseLu", || Box::new(SparseLu::new()), false);
    solvers(
        &mut t,
        "SparseLu with determinants",
        || Box::new(SparseLu::with_determinants()),
        false,
    );
    solvers(&mut t, "AutoSolver", || Box::new(AutoSolver::new()), false);
    solvers(&mut t, "Cholesky", || Box::new(Cholesky::new()), true);

    let spd = || rows(&[&[2.0, -1.0], &[-1.0, 2.0]]);
    let jacobian = || rows(&[&[1.0, 0.0, 1.0], &[0.0, 1.0, 1.0]]);
    let bordered = || Bordered::new(jacobian().pattern(), DenseLu::new());
    t.refuses("linear::Bordered::new", "a square pattern", "", || {
        Bordered::new(&Pattern::full(2, 2), DenseLu::new())
    });
    t.refuses("linear::Bordered::new", "an empty pattern", "", || {
        Bordered::new(&Pattern::full(0, 0), DenseLu::new())
    });
    t.refuses("linear::Bordered::factor", "another shape", "", || {
        bordered()?.factor(&spd(), None)
    });
    t.refuses(
        "linear::Bordered::factor",
        "a hint of another length",
        "hint",
        || bordered()?.factor(&jacobian(), Some(&[1.0])),
    );
    for bad in BAD {
        t.refuses("linear::Bordered::factor", "no numbers", "", || {
            bordered()?.factor(&rows(&[&[1.0, 0.0, bad], &[0.0, 1.0, 1.0]]), None)
        });
        t.survives("linear::Bordered::factor", "a hint that is no number", || {
            bordered().unwrap().factor(&jacobian(), Some(&[bad, 0.0, 1.0]))
        });
    }
    t.refuses("linear::Bordered::factor", "rank 0", "", || {
        bordered()?.factor(&Matrix::zeros(Pattern::full(2, 3)), None)
    });
    let ready = || {
        let mut b = bordered().unwrap();
        b.factor(&jacobian(), None).unwrap();
        b
    };
    t.refuses("linear::Bordered::solve", "no factors", "factor", || {
        bordered()?.solve(&[1.0; 2], &[1.0; 3], 0.0, &mut [0.0; 3])
    });
    for (r, tangent, x, name) in [(1, 3, 3, "r"), (2, 2, 3, "t"), (2, 3, 1, "x")] {
        t.refuses("linear::Bordered::solve", name, "expected", || {
            ready().solve(&vec![1.0; r], &vec![1.0; tangent], 0.0, &mut vec![0.0; x])
        });
    }
    t.refuses(
        "linear::Bordered::solve_transpose",
        "no factors",
        "factor",
        || bordered()?.solve_transpose(&[1.0; 3], &[1.0; 3], &mut [0.0; 2]),
    );
    for (g, tangent, y) in [(1, 3, 2), (3, 1, 2), (3, 3, 1)] {
        t.refuses(
            "linear::Bordered::solve_transpose",
            "another length",
            "expected",
            || ready().solve_transpose(&vec![1.0; g], &vec![1.0; tangent], &mut vec![0.0; y]),
        );
    }
    t.survives("linear::Bordered::orientation", "another length", || {
        ready().orientation(&[1.0])
    });

    let b = || rows(&[&[1.0, 0.0]]);
    t.refuses("linear::Condensation::new", "oblong A", "", || {
        Condensation::new(&b(), &b())
    });
    t.refuses("linear::Condensation::memory", "oblong A", "", || {
        Condensation::memory(&b(), &b())
    });
    t.refuses("linear::Condensation::memory", "B of another width", "", || {
        Condensation::memory(&spd(), &rows(&[&[1.0]]))
    });
    t.survives("linear::Condensation::memory", "empty", || {
        let empty = Matrix::zeros(Pattern::full(0, 0));
        Condensation::memory(&empty, &empty)
    });
    t.refuses("linear::Condensation::new", "B of another width", "", || {
        Condensation::new(&spd(), &rows(&[&[1.0]]))
    });
    t.refuses(
        "linear::Condensation::new",
        "indefinite A",
        "positive definite",
        || Condensation::new(&rows(&[&[1.0, 2.0], &[2.0, 1.0]]), &b()),
    );
    t.survives("linear::Condensation::new", "empty", || {
        Condensation::new(
            &Matrix::zeros(Pattern::full(0, 0)),
            &Matrix::zeros(Pattern::full(0, 0)),
        )
    });
    for bad in BAD {
        t.refuses("linear::Condensation::new", "no numbers in A", "", || {
            Condensation::new(&rows(&[&[bad, 0.0], &[0.0, 1.0]]), &b())
        });
        t.refuses("linear::Condensation::new", "no numbers in B", "", || {
            Condensation::new(&spd(), &rows(&[&[bad, 0.0]]))
        });
    }
    let condensed = || Condensation::new(&spd(), &b()).unwrap();
    t.refuses("linear::Condensation::expand", "lambda", "expected", || {
        condensed().expand(&[], &mut [0.0; 2])
    });
    t.refuses("linear::Condensation::expand", "f", "expected", || {
        condensed().expand(&[0.0], &mut [0.0])
    });
    t.refuses(
        "linear::Condensation::traces_of_solution",
        "f",
        "expected",
        || condensed().traces_of_solution(&[0.0]),
    );

    for (name, call) in [
        (
            "linear::eigenvalues",
            (|a| eigenvalues(a).map(drop)) as fn(&Matrix) -> Result<(), LinearError>,
        ),
        ("linear::symmetric_eigenvalues", |a| {
            symmetric_eigenvalues(a).map(drop)
        }),
        ("linear::generalized_eigenvalues", |a| {
            generalized_eigenvalues(a, a).map(drop)
        }),
    ] {
        t.refuses(name, "an oblong matrix", "1 x 2", || call(&b()));
        for bad in BAD {
            t.refuses(name, "no numbers", "NaN or infinite", || {
                call(&rows(&[&[1.0, bad], &[bad, 1.0]]))
            });
        }
        t.survives(name, "an empty matrix", || {
            call(&Matrix::zeros(Pattern::full(0, 0)))
        });
        t.survives(name, "huge entries", || {
            call(&rows(&[&[1e300, 1e300], &[1e300, 1e308]]))
        });
    }
    t.refuses("linear::generalized_eigenvalues", "two sizes", "expected", || {
        generalized_eigenvalues(&spd(), &rows(&[&[1.0]]))
    });
    t.refuses(
        "linear::generalized_eigenvalues",
        "a singular B",
        "positive definite",
        || generalized_eigenvalues(&spd(), &rows(&[&[1.0, 1.0], &[1.0, 1.0]])),
    );
    for bad in BAD {
        t.refuses("linear::null_space", "no numbers", "NaN or infinite", || {
            null_space(&rows(&[&[bad, 1.0]]), 1e-12)
        });
        t.survives("linear::null_space", "a tolerance that is no number", || {
            null_space(&b(), bad)
        });
    }
    // 28.8 GB each.
    const LARGE: usize = 60_000;
    let sparse = Matrix::from_triplets(LARGE, LARGE, &[(7, 7, 1.0)]).unwrap();
    let row = Matrix::from_triplets(1, LARGE, &[(0, 7, 1.0)]).unwrap();
    let identity = Matrix::identity(LARGE);
    let large = "60000 x 60000";
    for a in [&sparse, &row, &row.transpose()] {
        t.refuses("linear::null_space", "a large sparse matrix", large, || {
            null_space(a, 1e-12)
        });
    }
    t.refuses(
        "linear::symmetric_eigenvalues",
        "a large sparse matrix",
        large,
        || symmetric_eigenvalues(&sparse),
    );
    t.refuses("linear::eigenvalues", "a large sparse matrix", large, || {
        eigenvalues(&sparse)
    });
    t.refuses(
        "linear::generalized_eigenvalues",
        "large sparse matrices",
        large,
        || generalized_eigenvalues(&sparse, &identity),
    );
    t.refuses(
        "linear::LinearSolver::analyze",
        "a large sparse matrix",
        large,
        || DenseLu::new().analyze(sparse.pattern().as_ref()),
    );
    t.refuses(
        "linear::LinearSolver::factor",
        "a pattern that was refused",
        "analyze",
        || {
            let mut solver = DenseLu::new();
            let _ = solver.analyze(identity.pattern().as_ref());
            solver.factor(identity.as_ref())
        },
    );
    t.refuses("linear::Condensation::new", "many rows", large, || {
        Condensation::new(&identity, &identity)
    });
    t.survives("linear::null_space", "an empty matrix", || {
        null_space(&Matrix::zeros(Pattern::full(0, 0)), 1e-12)
    });
    t.survives("linear::null_space", "huge entries", || {
        null_space(&rows(&[&[1e300, 1e308]]), 1e-12)
    });

    t.refuses("linear::Prolongation::new", "a square matrix", "2 x 2", || {
        Prolongation::new(&spd())
    });
    t.refuses("linear::Prolongation::new", "no columns", "", || {
        Prolongation::new(&Matrix::zeros(Pattern::full(2, 0)))
    });
    t.refuses("linear::Prolongation::new", "an empty column", "column 0", || {
        Prolongation::new(&Matrix::from_triplets(2, 1, &[]).unwrap())
    });
    let p = || Prolongation::new(&rows(&[&[1.0], &[0.5]])).unwrap();
    t.refuses(
        "linear::Prolongation::with_offset",
        "another length",
        "offset",
        || p().with_offset(vec![1.0]),
    );
    for bad in BAD {
        t.refuses("linear::Prolongation::new", "no numbers", "prolongation", || {
            Prolongation::new(&rows(&[&[bad], &[1.0]]))
        });
        t.refuses(
            "linear::Prolongation::with_offset",
            "no numbers",
            "offset",
            || p().with_offset(vec![1.0, bad]),
        );
    }
    for n in [0, 1, 3] {
        t.survives("linear::Prolongation::inherit", "another length", || {
            p().inherit(&vec![1; n], 0)
        });
    }

    let mut ilu = IncompleteLu::default();
    t.refuses("linear::Preconditioner::apply", "nothing prepared", "", || {
        ilu.apply(&mut [1.0])
    });
    t.refuses(
        "linear::Preconditioner::prepare",
        "an oblong matrix",
        "1 x 2",
        || IncompleteLu::default().prepare(b().as_ref()),
    );
    for bad in BAD {
        t.survives("linear::Preconditioner::prepare", "no numbers", || {
            IncompleteLu::default().prepare(rows(&[&[bad, 1.0], &[1.0, 1.0]]).as_ref())
        });
    }
    t.survives("linear::Preconditioner::prepare", "no diagonal", || {
        IncompleteLu::default().prepare(
            Matrix::from_triplets(2, 2, &[(0, 1, 1.0), (1, 0, 1.0)])
                .unwrap()
                .as_ref(),
        )
    });
    t.refuses(
        "linear::Preconditioner::apply",
        "another length",
        "expected",
        || {
            let mut ilu = IncompleteLu::default();
            ilu.prepare(spd().as_ref())?;
            ilu.apply(&mut [1.0])
        },
    );
    krylov(&mut t);
    t.finish();
}

fn krylov(t: &mut Table) {
    let spd = || rows(&[&[2.0, -1.0], &[-1.0, 2.0]]);
    let solve = "linear::Krylov::solve";
    for new in [
        Krylov::cg,
        Krylov::minres,
        || Krylov::gmres(0),
        || Krylov::flexible_gmres(0),
    ] {
        for n in [0, 1, 3] {
            t.refuses(solve, "b of another length", "expected", || {
                new().solve(&mut spd(), &mut vec![1.0; n], 1e-10)
            });
        }
        for bad in BAD {
            t.refuses(solve, "b that is no number", "NaN or infinite", || {
                new().solve(&mut spd(), &mut [1.0, bad], 1e-10)
            });
            t.refuses(solve, "a matrix without numbers", "NaN or infinite", || {
                new().solve(&mut rows(&[&[bad, 0.0], &[0.0, 1.0]]), &mut [1.0, 1.0], 1e-10)
            });
            t.survives(solve, "a tolerance that is no number", || {
                new().solve(&mut spd(), &mut [1.0, 2.0], bad)
            });
        }
        for size in [1e-320, 1e-200, 1e200, 1e300] {
            t.holds(solve, "the size of b does not matter", || {
                let mut b = [size, -size];
                let report = new().solve(&mut spd(), &mut b, 1e-10).unwrap();
                report.is_solved() && (b[0] / size - 1.0 / 3.0).abs() < 1e-2
            });
        }
        t.survives(solve, "an empty matrix", || {
            new().solve(&mut Matrix::zeros(Pattern::full(0, 0)), &mut [], 1e-10)
        });
        t.survives(solve, "an oblong matrix", || {
            new().solve(&mut rows(&[&[1.0, 2.0]]), &mut [1.0], 1e-10)
        });
    }
    t.refuses(
        "linear::LinearOperator::precondition",
        "nothing prepared",
        "factor",
        || Preconditioned::new(&spd(), &mut Multigrid::algebraic()).precondition(&mut [1.0; 2]),
    );
    let prepare = "linear::Preconditioner::prepare";
    let blocks = || {
        BlockDiagonal::new()
            .with_block(1, IncompleteLu::default())
            .with_block(1, IncompleteLu::default())
    };
    let wide = || {
        let p = Matrix::from_triplets(5, 2, &[(0, 0, 1.0), (4, 1, 1.0)]).unwrap();
        Multigrid::with_prolongations(vec![Prolongation::new(&p).unwrap()])
    };
    type Prepare = fn(&Matrix) -> Result<(), LinearError>;
    let all: [Prepare; 2] = [
        |a| Multigrid::algebraic().prepare(a.as_ref()),
        |a| {
            BlockDiagonal::new()
                .with_block(2, IncompleteLu::default())
                .prepare(a.as_ref())
        },
    ];
    for make in all {
        t.refuses(prepare, "an oblong matrix", "1 x 2", || {
            make(&rows(&[&[1.0, 2.0]]))
        });
        for bad in BAD {
            t.refuses(prepare, "no numbers", "NaN or infinite", || {
                make(&rows(&[&[bad, 0.0], &[0.0, 1.0]]))
            });
        }
    }
    t.refuses(
        prepare,
        "a diagonal that is not positive",
        "positive definite",
        || Multigrid::algebraic().prepare(rows(&[&[1.0, 0.0], &[0.0, -1.0]]).as_ref()),
    );
    t.refuses(prepare, "no diagonal", "positive definite", || {
        Multigrid::algebraic().prepare(Matrix::from_triplets(2, 2, &[(0, 1, 1.0)]).unwrap().as_ref())
    });
    t.refuses(prepare, "prolongations of another size", "expected", || {
        wide().prepare(spd().as_ref())
    });
    t.refuses(prepare, "blocks of another size", "expected", || {
        blocks().prepare(rows(&[&[1.0]]).as_ref())
    });
    t.refuses(
        "linear::Preconditioner::apply",
        "another length",
        "expected",
        || {
            let mut p = blocks();
            p.prepare(spd().as_ref())?;
            p.apply(&mut [1.0])
        },
    );
    t.refuses(
        "linear::Preconditioner::apply",
        "another length",
        "expected",
        || {
            let mut p = Multigrid::algebraic();
            p.prepare(spd().as_ref())?;
            p.apply(&mut [1.0])
        },
    );
}
