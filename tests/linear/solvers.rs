//! General solvers: each answer is checked by its residual, each failure by its error.

use crate::random::Random;
use crate::support::{check_solves, dense, factored, general_solvers, laplacian, residual, sparse};
use proptest::prelude::*;
use semismooth::linear::{Cholesky, DenseLu, LinearError, LinearSolver, SparseLu};
use semismooth::sparse::{Matrix, Pattern};

#[test]
fn all_solvers_reconstruct_random_right_hand_sides() {
    let mut rng = Random::new(7);
    for n in [1, 2, 3, 4, 5, 13, 49, 50, 51, 120, 230] {
        for a in [dense(n, &mut rng), sparse(n, 3, 4.0, &mut rng)] {
            for (name, solver) in general_solvers() {
                let mut solver = factored(solver, &a).unwrap_or_else(|e| panic!("{name} {n}: {e}"));
                check_solves(&mut solver, &a, 1, &mut rng, 1e-13);
                check_solves(&mut solver, &a, 37, &mut rng, 1e-13);
            }
        }
    }
}

#[test]
fn singular_matrices_are_named_singular() {
    let mut rng = Random::new(3);
    for n in [2, 3, 4, 5, 10, 49, 50, 90] {
        for _ in 0..20 {
            // The product of n × (n - 1) and (n - 1) × n factors.
            let (p, q) = (rng.vector(n * (n - 1), 1.0), rng.vector(n * (n - 1), 1.0));
            let mut a = Matrix::zeros(Pattern::full(n, n));
            for i in 0..n {
                for j in 0..n {
                    for k in 0..n - 1 {
                        a.add(i, j, p[i * (n - 1) + k] * q[k * n + j]);
                    }
                }
            }
            for (name, solver) in general_solvers() {
                let e = factored(solver, &a).map(|_| ()).unwrap_err();
                let named = matches!(e, LinearError::Singular { rcond } if rcond < 1e-14);
                assert!(named, "{name} {n}: {e}");
            }
        }
    }
    for m in [2, 5, 12, 40] {
        let a = laplacian(m, true);
        for (name, solver) in general_solvers() {
            if m == 40 && name == "dense" {
                continue;
            }
            let e = factored(solver, &a).map(|_| ()).unwrap_err();
            assert!(matches!(e, LinearError::Singular { .. }), "{name} {m}: {e}");
        }
    }
}

#[test]
fn structurally_singular_matrices_are_named_singular() {
    let mut rng = Random::new(11);
    for n in [3, 10, 60, 300] {
        // Two columns with one and the same single row.
        let mut t: Vec<_> = (0..n).map(|j| (j, j, 2.0 + rng.symmetric())).collect();
        t[1] = (0, 1, 1.0);
        t.extend((2..n).map(|j| (1, j, rng.symmetric())));
        t.extend((2..n).map(|j| ((j * 7) % n, j, rng.symmetric())));
        let a = Matrix::from_triplets(n, n, &t).unwrap();
        for (name, solver) in general_solvers() {
            let e = factored(solver, &a).map(|_| ()).unwrap_err();
            assert!(matches!(e, LinearError::Singular { .. }), "{name} {n}: {e}");
        }
    }
}

#[test]
fn units_do_not_make_a_matrix_singular() {
    let mut rng = Random::new(5);
    for n in [2, 4, 6, 60] {
        let base = sparse(n, 2, 3.0, &mut rng);
        let mut a = base.clone();
        // Small matrices in extreme units, larger ones in two systems of units (GPa and m against Pa and nm).
        let mut units = |up: bool| match (n < 10, up) {
            (true, _) => 10_f64.powf(12.0 * rng.symmetric()),
            (false, true) => 1e9,
            (false, false) => 1e-9,
        };
        let rows: Vec<f64> = (0..n).map(|i| units(i < n / 2)).collect();
        let cols: Vec<f64> = (0..n).map(|j| units(j % 2 == 0)).collect();
        let scaled: Vec<f64> = base.triplets().map(|(i, j, v)| v * rows[i] * cols[j]).collect();
        a.values_mut().copy_from_slice(&scaled);
        for (name, solver) in general_solvers() {
            let mut solver = factored(solver, &a).unwrap_or_else(|e| panic!("{name} {n}: {e}"));
            // In the unscaled unknowns the error is small componentwise, whatever the condition number in these units.
            let y = rng.vector(n, 1.0);
            let mut b = vec![0.0; n];
            base.mul_vec(&y, &mut b);
            b.iter_mut().zip(&rows).for_each(|(b, r)| *b *= r);
            solver.solve_in_place(&mut b).unwrap();
            for i in 0..n {
                assert!((b[i] * cols[i] - y[i]).abs() < 1e-12, "{name} {n}");
            }
        }
    }
    let diagonal = Matrix::from_triplets(2, 2, &[(0, 0, 1.0), (1, 1, 1e-12)]).unwrap();
    assert!(factored(DenseLu::new(), &diagonal).is_ok());
    assert!(factored(Cholesky::new(), &diagonal).is_ok());
}

/// Units of equations and unknowns make no well-conditioned matrix look ill-conditioned, nor the reverse.
#[test]
fn condition_numbers_do_not_depend_on_units() {
    let mut rng = Random::new(41);
    let in_units = |a: &Matrix, rng: &mut Random| {
        let mut units = |k: usize| -> Vec<f64> {
            let unit = |_| 10_f64.powf(12.0 * rng.symmetric());
            (0..k).map(unit).collect()
        };
        let (rows, cols) = (units(a.nrows()), units(a.ncols()));
        let scaled: Vec<f64> = a.triplets().map(|(i, j, v)| v * rows[i] * cols[j]).collect();
        let mut other = a.clone();
        other.values_mut().copy_from_slice(&scaled);
        other
    };
    let rcond = |name: &str, a: &Matrix| {
        let solver = general_solvers().into_iter().find(|s| s.0 == name).unwrap().1;
        match factored(solver, a) {
            Ok(mut solver) => solver.rcond().unwrap(),
            Err(LinearError::Singular { rcond }) => rcond,
            Err(e) => panic!("{name}: {e}"),
        }
    };
    let names: Vec<&str> = general_solvers().into_iter().map(|s| s.0).collect();
    let (mut well, mut ill) = (0, 0);
    for n in [2, 3, 5, 6, 12, 60, 230] {
        for round in 0..20 {
            let a = match round % 2 {
                0 => sparse(n, 2, 3.0, &mut rng),
                _ => dense(n, &mut rng),
            };
            let other = in_units(&a, &mut rng);
            for name in &names {
                if rcond(name, &a) > 1e-3 {
                    let found = rcond(name, &other);
                    assert!(found >= 1e-6, "{name} {n}: {found:e}");
                    well += 1;
                }
            }
        }
    }
    for n in [8, 10] {
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| (0..n).map(|j| 1.0 / (i + j + 1) as f64).collect())
            .collect();
        let hilbert = Matrix::from_rows(&rows).unwrap();
        for _ in 0..20 {
            let other = in_units(&hilbert, &mut rng);
            for name in &names {
                let found = rcond(name, &other);
                assert!(found < 1e-6, "{name} {n}: {found:e}");
                ill += 1;
            }
        }
    }
    assert!(well > 200 && ill == 160);
}

#[test]
fn hilbert_is_an_error_or_a_small_residual() {
    for n in [6, 9, 12, 14] {
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| (0..n).map(|j| 1.0 / (i + j + 1) as f64).collect())
            .collect();
        let a = Matrix::from_rows(&rows).unwrap();
        for (name, solver) in general_solvers() {
            match factored(solver, &a) {
                Ok(mut s) => {
                    let mut x = vec![1.0; n];
                    s.solve_in_place(&mut x).unwrap();
                    assert!(residual(&a, &x, &vec![1.0; n], false) < 1e-14, "{name} {n}");
                    assert!(s.rcond().unwrap() < 1e-5);
                }
                Err(LinearError::Singular { rcond }) => assert!(n >= 11 && rcond < 1e-14),
                Err(e) => panic!("{name} {n}: {e}"),
            }
        }
    }
}

#[test]
fn growth_of_pivots_gives_no_silent_wrong_answer() {
    // Wilkinson's matrix: entries grow to 2^(n-1).
    for n in [45, 70] {
        let mut a = Matrix::zeros(Pattern::full(n, n));
        for i in 0..n {
            for j in 0..i {
                a.add(i, j, -1.0);
            }
            a.add(i, i, 1.0);
            if i + 1 < n {
                a.add(i, n - 1, 1.0);
            }
        }
        let mut rng = Random::new(23);
        for (name, solver) in general_solvers() {
            let b = rng.vector(n, 1.0);
            let mut x = b.clone();
            let done = factored(solver, &a).and_then(|mut s| s.solve_in_place(&mut x));
            let wrong = done.is_ok() && residual(&a, &x, &b, false) > 1e-9;
            assert!(!wrong, "{name} {n}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn solvers_agree_under_permutations(seed in 1_u64..u64::MAX, n in 1_usize..30) {
        let mut rng = Random::new(seed);
        let a = sparse(n, 2, 3.5, &mut rng);
        // Reversing rows and rotating columns permutes right-hand side and solution.
        let triplets: Vec<_> = a
            .triplets()
            .map(|(i, j, v)| (n - 1 - i, (j + 1) % n, v))
            .collect();
        let p = Matrix::from_triplets(n, n, &triplets).unwrap();
        let b = rng.vector(n, 1.0);
        let reversed: Vec<f64> = b.iter().rev().copied().collect();
        for (_, solver) in general_solvers() {
            let mut x = b.clone();
            let mut y = reversed.clone();
            factored(solver, &a).unwrap().solve_in_place(&mut x).unwrap();
            factored(DenseLu::new(), &p).unwrap().solve_in_place(&mut y).unwrap();
            for j in 0..n {
                prop_assert!((x[j] - y[(j + 1) % n]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn no_matrix_makes_a_solver_panic(
        n in 1_usize..12,
        entries in prop::collection::vec((0_usize..12, 0_usize..12, prop::num::f64::ANY), 0..60),
    ) {
        let entries: Vec<_> = entries.into_iter().map(|(i, j, v)| (i % n, j % n, v)).collect();
        let a = Matrix::from_triplets(n, n, &entries).unwrap();
        let mut solvers = general_solvers();
        solvers.push(("cholesky", Box::new(Cholesky::new())));
        for (name, solver) in solvers {
            let mut x = vec![1.0; n];
            if let Ok(mut solver) = factored(solver, &a)
                && name != "cholesky"
                && solver.solve_in_place(&mut x).is_ok()
            {
                let finite = x.iter().all(|v| v.is_finite());
                prop_assert!(finite, "{name}");
            }
        }
    }
}

#[test]
fn blocked_elimination_meets_structural_singularity_and_nan() {
    let mut rng = Random::new(53);
    for round in 0..60 {
        let n = 20 + round;
        // A few columns have entries in too few rows; the rest is dense enough to be eliminated by blocks.
        let (crowd, rows) = (2 + round % 7, 1 + round % 5);
        let crowd = crowd.max(rows + 1);
        let mut t = Vec::new();
        for j in 0..n {
            for i in 0..n {
                let inside = if j % 3 == 0 && j / 3 < crowd {
                    i % 11 < 1 && i / 11 < rows
                } else {
                    rng.symmetric() > -0.4
                };
                if inside {
                    t.push((i, j, rng.symmetric()));
                }
            }
        }
        let a = Matrix::from_triplets(n, n, &t).unwrap();
        for solver in [SparseLu::new(), SparseLu::with_determinants()] {
            let e = factored(solver, &a).map(|_| ()).unwrap_err();
            assert!(matches!(e, LinearError::Singular { .. }), "{n}: {e}");
        }
    }
    // With blocked elimination the determinant is unknown, unless it is requested.
    let a = dense(300, &mut rng);
    assert_eq!(factored(SparseLu::new(), &a).unwrap().log_det(), None);
    assert!(
        factored(SparseLu::with_determinants(), &a)
            .unwrap()
            .log_det()
            .is_some()
    );
    let mut bad = a.clone();
    bad.values_mut()[777] = f64::NAN;
    let e = factored(SparseLu::new(), &bad).map(|_| ()).unwrap_err();
    assert!(matches!(e, LinearError::NotFinite { .. }));
}

/// Rows of a diagonally dominant matrix in another order, which pivoting undoes: solutions by construction, and the determinant by the
/// elimination of the matrix in its own order and the sign of the permutation. All cores work from order 1024 on.
#[test]
fn large_dense_factors_pivot_across_panels() {
    let n = 1100;
    let entry = |i: usize, j: usize| {
        let v = ((i * 31 + j * 17) % 23) as f64 / 23.0 - 0.4;
        if i == j { v + 900.0 } else { v }
    };
    // A cycle through all rows, which moves them across panels: odd for an even order.
    let row = |i: usize| (i * 7 + 3) % n;
    let build = |of: &dyn Fn(usize) -> usize| {
        let values = (0..n).flat_map(|j| (0..n).map(move |i| (i, j)));
        let values = values.map(|(i, j)| entry(of(i), j)).collect();
        Matrix::from_values(Pattern::full(n, n), values).unwrap()
    };
    let (plain, mixed) = (build(&|i| i), build(&row));
    let mut lu = DenseLu::new();
    let exact: Vec<f64> = (0..n).map(|k| 1.0 + (k % 5) as f64).collect();
    lu.analyze(mixed.pattern().as_ref()).unwrap();
    lu.factor(mixed.as_ref()).unwrap();
    let (sign, log) = lu.log_det().unwrap();
    let mut x = vec![0.0; n];
    mixed.mul_vec(&exact, &mut x);
    lu.solve_in_place(&mut x).unwrap();
    assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-11));
    let transposed = mixed.transpose();
    transposed.mul_vec(&exact, &mut x);
    lu.solve_transpose_in_place(&mut x).unwrap();
    assert!(x.iter().zip(&exact).all(|(x, e)| (x - e).abs() < 1e-11));
    let mut seen = vec![false; n];
    let mut odd = false;
    for first in 0..n {
        let mut k = first;
        let mut length = 0;
        while !std::mem::replace(&mut seen[k], true) {
            (k, length) = (row(k), length + 1);
        }
        odd ^= length > 0 && length % 2 == 0;
    }
    lu.factor(plain.as_ref()).unwrap();
    let (own_sign, own_log) = lu.log_det().unwrap();
    assert_eq!(own_sign, 1);
    assert_eq!(sign, if odd { -1 } else { 1 });
    assert!((log - own_log).abs() < 1e-9 * log.abs());
    // Each panel's exchanges count: two rows of one panel, of different ones, of the last.
    for (a, b) in [(0, 1), (0, 700), (n - 2, n - 1)] {
        let exchanged = build(&|i| match i {
            i if i == a => b,
            i if i == b => a,
            i => i,
        });
        lu.factor(exchanged.as_ref()).unwrap();
        let (sign, log) = lu.log_det().unwrap();
        assert_eq!(sign, -1, "rows {a} and {b}");
        assert!((log - own_log).abs() < 1e-9 * own_log.abs());
    }
    #[cfg(feature = "rayon")]
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let again = pool.install(|| {
            let mut lu = DenseLu::new();
            lu.analyze(mixed.pattern().as_ref()).unwrap();
            lu.factor(mixed.as_ref()).unwrap();
            let mut x = exact.clone();
            lu.solve_in_place(&mut x).unwrap();
            x
        });
        lu.factor(mixed.as_ref()).unwrap();
        let mut x = exact.clone();
        lu.solve_in_place(&mut x).unwrap();
        assert_eq!(again, x);
    }
}
