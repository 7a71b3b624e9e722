//! Active set methods: sets, iterations and linear solvers of large problems.

use super::random::Random;
use super::*;
use semismooth::complementarity::active_set::{
    ActiveSetOptions, ActiveSetSolver, DirectReduced, GmresReduced, MultigridReduced, Nested, ReducedSolver,
};
use semismooth::linear::{LinearError, Preconditioner, Prolongation};
use semismooth::run::Status;
use semismooth::sparse::MatrixRef;

fn solve(lcp: &Lcp) -> (Status, Vec<f64>, f64, usize) {
    let mut z = vec![0.0; lcp.len()];
    let report = ActiveSetSolver::default().solve(lcp, &mut z).unwrap();
    (report.status, z, report.residual, report.iterations)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// For P matrices the method terminates at the solution from any start and active sets.
    #[test]
    fn p_matrices(
        g in reals(N * N),
        s in reals(N * N),
        q in reals(N),
        start in reals(N),
        width in prop::collection::vec(0.0..2.0, N),
    ) {
        let m = matrix(N, |i, j| {
            let dot: f64 = (0..N).map(|k| g[k * N + i] * g[k * N + j]).sum();
            dot + if i == j { 0.05 } else { 4.0 * (s[i * N + j] - s[j * N + i]) }
        });
        let lcp = Lcp::boxed(m, q, vec![-0.5; N], width.iter().map(|w: &f64| w - 0.5).collect()).unwrap();
        let mut z = start;
        let report = ActiveSetSolver::default().solve(&lcp, &mut z).unwrap();
        prop_assert_eq!(report.status, Status::Solved);
        prop_assert!(report.residual < 1e-12);
        let set = enumerate(&lcp);
        prop_assert!(listed(&set, &z), "{z:?} {:?} {lcp:?} {set:?}", lcp.q());
        let (status, by_lemke, _) = lemke(&lcp);
        prop_assert_eq!(status, Status::Solved);
        for (a, b) in z.iter().zip(&by_lemke) {
            prop_assert!((a - b).abs() < 1e-10);
        }
    }

    /// Unknowns whose rows contain nothing else and have no load are zero: rounding from pivots of other rows is no solution of rows
    /// without other terms.
    #[test]
    fn unloaded_unknowns_are_zero(a in reals(4), b in reals(4), c in reals(4), q in reals(2)) {
        let definite = |g: &[f64], i: usize, j: usize| {
            g[i] * g[j] + g[2 + i] * g[2 + j] + if i == j { 0.1 } else { 0.0 }
        };
        let m = matrix(4, |i, j| match (i / 2, j / 2) {
            (0, 0) => definite(&a, i, j),
            (1, 0) => 50.0 * b[2 * (i - 2) + j],
            (1, 1) => definite(&c, i - 2, j - 2),
            _ => 0.0,
        });
        let load = vec![0.0, 0.0, q[0], q[1]];
        let lcp = Lcp::boxed(m, load, vec![-40.0; 4], vec![40.0; 4]).unwrap();
        let (status, z, residual, _) = solve(&lcp);
        prop_assert_eq!(status, Status::Solved);
        prop_assert!(residual < 1e-11);
        prop_assert_eq!(&z[..2], &[0.0, 0.0]);
        prop_assert!(listed(&enumerate(&lcp), &z), "{z:?}");
    }

    /// Whatever the matrix, what is reported solved is a solution.
    #[test]
    fn any_matrix(m in small_integers(N * N), q in small_integers(N)) {
        let lcp = Lcp::new(matrix(N, |i, j| m[i * N + j]), q).unwrap();
        let mut z = vec![0.0; N];
        let options = ActiveSetOptions::default().with_max_iterations(50);
        let report = ActiveSetSolver::new(options).solve(&lcp, &mut z).unwrap();
        if report.status == Status::Solved {
            prop_assert!(lcp.natural_residual(&z, &mut z.clone()).unwrap() < 1e-12);
        }
    }
}

/// A string over a flat obstacle, 2 z₁ − z₂ = 1, … , in units of rows and unknowns up to 2⁸⁰ apart, from starts up to the ends of the range
/// of numbers: z = (1/4, 1/2, 3/4, 0, 0) with the upper bound 3/4 of the third unknown active and the load −3 on the last.
#[test]
fn neither_units_nor_starts_far_out_change_the_solution() {
    let n = 5;
    let q = [0.0, 0.0, -1.5, 0.0, 3.0];
    let exact = [0.25, 0.5, 0.75, 0.0, 0.0];
    let upper = [f64::INFINITY, f64::INFINITY, 0.75, 0.0, f64::INFINITY];
    let entry = |i: usize, j: usize| match i.abs_diff(j) {
        0 => 2.0,
        1 => -1.0,
        _ => 0.0,
    };
    let mut exponent = (0..).map(|k: i32| k * 37 % 81 - 40);
    for far in [0.0, 1.0, 1e12, 1e199, f64::MAX] {
        for _ in 0..40 {
            let mut unit = || f64::exp2(f64::from(exponent.next().unwrap()));
            let (rows, columns): (Vec<f64>, Vec<f64>) = (0..n).map(|_| (unit(), unit())).unzip();
            let m = matrix(n, |i, j| rows[i] * entry(i, j) / columns[j]);
            let scaled =
                |v: &[f64], units: &[f64]| -> Vec<f64> { v.iter().zip(units).map(|(v, u)| v * u).collect() };
            let lcp = Lcp::boxed(m, scaled(&q, &rows), vec![0.0; n], scaled(&upper, &columns)).unwrap();
            let mut z: Vec<f64> = (0..n).map(|i| if i % 2 == 0 { far } else { -far }).collect();
            let report = ActiveSetSolver::default().solve(&lcp, &mut z).unwrap();
            assert_eq!(report.status, Status::Solved, "{far:e} {rows:?} {columns:?}");
            for ((z, exact), unit) in z.iter().zip(exact).zip(&columns) {
                assert!((z / unit - exact).abs() < 1e-14, "{far:e} {rows:?} {columns:?}");
            }
        }
    }
}

/// Unknowns whose units differ by up to 1e12, iterative linear solves: what is reported solved is so relative to the terms of each row.
#[test]
fn iterative_solves_know_the_units_of_each_unknown() {
    let mut random = Random::new(16);
    let (n, mut solved) = (3, 0);
    for _ in 0..3000 {
        let units: Vec<f64> = (0..n).map(|_| 10f64.powf(random.between(-6.0, 6.0))).collect();
        let mut entry = |i: usize, j: usize| random.between(-1.0, 1.0) + if i == j { 3.0 } else { 0.0 };
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| (0..n).map(|j| units[j] * entry(i, j)).collect())
            .collect();
        let q: Vec<f64> = (0..n).map(|_| random.between(-2.0, 2.0)).collect();
        let mut bound = |j: usize| match random.below(5) < 2 {
            true => random.between(0.1, 1.0) / units[j],
            false => f64::INFINITY,
        };
        let upper: Vec<f64> = (0..n).map(&mut bound).collect();
        let lcp = Lcp::boxed(
            matrix(n, |i, j| rows[i][j]),
            q.clone(),
            vec![0.0; n],
            upper.clone(),
        )
        .unwrap();
        let mut z = vec![0.0; n];
        let reduced = GmresReduced::default();
        let report = ActiveSetSolver::with_reduced(ActiveSetOptions::default(), reduced).solve(&lcp, &mut z);
        if report.is_ok_and(|r| r.status == Status::Solved) {
            solved += 1;
            for i in 0..n {
                let terms: Vec<f64> = (0..n).map(|j| rows[i][j] * z[j]).chain([q[i]]).collect();
                let f: f64 = terms.iter().sum();
                let size: f64 = terms.iter().map(|t| t.abs()).sum();
                let held = (z[i] == 0.0 && f >= 0.0) || (z[i] == upper[i] && f <= 0.0);
                assert!(held || f.abs() <= 1e-9 * size, "{rows:?} {q:?} {upper:?} {z:?}");
            }
        }
    }
    assert!(solved > 2900, "{solved}");
}

/// Entries and starts of any floating-point size: nothing panics, and what is reported solved is a solution.
#[test]
fn sizes_at_the_ends_of_the_range_are_survived() {
    let told = Lcp::new(
        matrix(2, |i, j| [[-1e-176, 1e150], [1.0, 1.0]][i][j]),
        vec![-5e-324, 1e150],
    )
    .unwrap();
    let mut random = Random::new(26);
    let mut size = |e: f64| {
        let sign = if random.below(2) == 0 { 1.0 } else { -1.0 };
        sign * 10f64.powf(random.between(-e, e))
    };
    let drawn = (0..4000).map(|case| {
        let (n, e) = (2 + case % 3, [100.0, 150.0, 200.0, 300.0][case % 4]);
        let entries: Vec<f64> = (0..n * n).map(|_| size(e)).collect();
        let q = (0..n).map(|_| size(e)).collect();
        let start: Vec<f64> = (0..n).map(|_| size(e)).collect();
        (Lcp::new(matrix(n, |i, j| entries[i * n + j]), q).unwrap(), start)
    });
    for (lcp, start) in std::iter::once((told, vec![1e-308, f64::MAX])).chain(drawn) {
        let mut z = start.clone();
        let report = ActiveSetSolver::default().solve(&lcp, &mut z);
        if report.is_ok_and(|r| r.status == Status::Solved) {
            assert!(
                z.iter().all(|z| *z >= 0.0 && z.is_finite()),
                "{lcp:?} {start:?} {z:?}"
            );
        }
    }
}

#[test]
fn murty_and_fathi_take_few_iterations() {
    let (status, z, _, iterations) = solve(&murty(40));
    assert_eq!(status, Status::Solved);
    assert!(z[0] == 1.0 && z[1..].iter().all(|z| *z == 0.0));
    assert!(iterations <= 100, "{iterations}");
    // Fathi: M = L Lᵀ with Murty's L, q = −1; Lemke's method needs 2ⁿ − 1 exchanges, Newton's few.
    let n = 120;
    let l = |i: usize, j: usize| [0.0, 1.0, 2.0][usize::from(i >= j) + usize::from(i > j)];
    let fathi = matrix(n, |i, j| (0..n).map(|k| l(i, k) * l(j, k)).sum());
    let (status, z, residual, iterations) = solve(&Lcp::new(fathi, vec![-1.0; n]).unwrap());
    assert_eq!(status, Status::Solved);
    assert!(residual < 1e-10 && z[0] == 1.0, "{residual:e}");
    assert!(iterations <= 100, "{iterations}");
}

#[test]
fn a_right_start_takes_one_iteration() {
    let lcp = Lcp::new(
        matrix(3, |i, j| if i == j { 2.0 } else { -0.5 }),
        vec![-1.0, 1.0, 2.0],
    )
    .unwrap();
    let mut solver = ActiveSetSolver::default();
    let mut z = [0.0; 3];
    solver.solve(&lcp, &mut z).unwrap();
    let (sets, solution) = (solver.states().to_vec(), z);
    assert_eq!(sets, [BoundState::Interior, BoundState::Lower, BoundState::Lower]);
    let report = solver.solve(&lcp, &mut z).unwrap();
    assert_eq!(report.iterations, 1);
    let mut far = [7.0; 3];
    let report = solver.solve_from_states(&lcp, &mut far, &sets).unwrap();
    assert_eq!((report.iterations, far), (1, solution));
}

/// w vanishes together with z at a bound, up to rounding: that is no reason to leave the bound, whatever else has to change.
#[test]
fn degenerate_components_stay_at_their_bounds() {
    let mut below = 0;
    for k in 1..60 {
        let (c, d) = (0.01 * f64::from(k), [5.0, 10.0, 13.0][k as usize % 3]);
        // z₁ = 1/d as rounded, w₂ = c − d c z₁, w₃ = 1.
        let entry = |i: usize, j: usize| [[d, 0.0, 0.0], [-d * c, 1.0, 0.0], [0.0, 0.0, 1.0]][i][j];
        let lcp = Lcp::new(matrix(3, entry), vec![-1.0, c, 1.0]).unwrap();
        for wrong in [BoundState::Lower, BoundState::Interior] {
            let mut z = [0.0; 3];
            let sets = [BoundState::Interior, BoundState::Lower, wrong];
            let mut solver = ActiveSetSolver::default();
            let report = solver.solve_from_states(&lcp, &mut z, &sets).unwrap();
            let expected = 1 + usize::from(wrong == BoundState::Interior);
            assert_eq!((report.status, report.iterations), (Status::Solved, expected));
            assert_eq!(z, [1.0 / d, 0.0, 0.0], "{c} {d}");
            assert_eq!(solver.states()[1..], [BoundState::Lower; 2]);
        }
        below += usize::from(-d * c * (1.0 / d) + c < 0.0);
    }
    assert!(below > 10, "{below}");
}

/// A free component that lies on its bound up to rounding has no reason to be fixed there.
#[test]
fn free_components_may_rest_on_their_bounds() {
    let mut below = 0;
    for k in 1..60 {
        let (c, d) = (0.01 * f64::from(k), [3.0, 6.0, 19.0][k as usize % 3]);
        // z₁ = 1/d as rounded, z₂ = d c z₁ − c, and z₃ = −1 where that is free.
        let entry = |i: usize, j: usize| [[d, 0.0, 0.0], [-d * c, 1.0, 0.0], [0.0, 0.0, 1.0]][i][j];
        let lcp = Lcp::new(matrix(3, entry), vec![-1.0, c, 1.0]).unwrap();
        let (mut z, mut solver) = ([0.0; 3], ActiveSetSolver::default());
        let report = solver
            .solve_from_states(&lcp, &mut z, &[BoundState::Interior; 3])
            .unwrap();
        assert_eq!((report.status, report.iterations), (Status::Solved, 2));
        let sets = [BoundState::Interior, BoundState::Interior, BoundState::Lower];
        assert_eq!(solver.states(), sets, "{c} {d}");
        below += usize::from(d * c * (1.0 / d) - c < 0.0);
    }
    assert!(below > 10, "{below}");
}

#[test]
fn a_singular_matrix_is_reported() {
    let lcp = Lcp::new(matrix(2, |_, _| 1.0), vec![-1.0, -2.0]).unwrap();
    assert_eq!(solve(&lcp).0, Status::Singular);
    let mut short = [0.0];
    assert!(ActiveSetSolver::default().solve(&lcp, &mut short).is_err());
    assert!(
        ActiveSetSolver::default()
            .solve(&lcp, &mut [f64::NAN, 0.0])
            .is_err()
    );
}

/// −Δu + b·∇u = 0.3 on the unit square, upwind differences on m × m points, between a bump below and a roof above.
fn membrane_in_a_stream(m: usize, [bx, by]: [f64; 2]) -> Lcp {
    let h = 1.0 / (m + 1) as f64;
    let (n, mut entries) = (m * m, Vec::new());
    let (mut lower, mut upper) = (Vec::new(), Vec::new());
    for j in 0..m {
        for i in 0..m {
            let k = j * m + i;
            let to = [
                (i > 0, 1, false, 1.0 + bx * h),
                (i + 1 < m, 1, true, 1.0),
                (j > 0, m, false, 1.0 + by * h),
                (j + 1 < m, m, true, 1.0),
            ];
            entries.push((k, k, to.iter().map(|t| t.3).sum()));
            for (inside, step, forward, weight) in to {
                if inside {
                    entries.push((k, if forward { k + step } else { k - step }, -weight));
                }
            }
            let (x, y) = ((i + 1) as f64 * h, (j + 1) as f64 * h);
            lower.push(0.04 - 2.0 * ((x - 0.3).powi(2) + (y - 0.4).powi(2)));
            upper.push(0.045);
        }
    }
    let matrix = Matrix::from_triplets(n, n, &entries).unwrap();
    Lcp::boxed(matrix, vec![-0.3 * h * h; n], lower, upper).unwrap()
}

/// Diagonal preconditioner.
#[derive(Default)]
struct Jacobi(Vec<f64>);

impl Preconditioner for Jacobi {
    fn prepare(&mut self, a: MatrixRef<'_>) -> Result<(), LinearError> {
        self.0.clear();
        self.0.resize(a.pattern.ncols, 0.0);
        for j in 0..a.pattern.ncols {
            for k in a.pattern.col_ptr[j]..a.pattern.col_ptr[j + 1] {
                if a.pattern.row_idx[k] == j {
                    self.0[j] = a.values[k];
                }
            }
        }
        Ok(())
    }

    fn apply(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        b.iter_mut().zip(&self.0).for_each(|(b, d)| *b /= d);
        Ok(())
    }
}

#[test]
fn iterative_and_direct_routes_agree_on_unsymmetric_systems() {
    fn run<R: ReducedSolver>(lcp: &Lcp, reduced: R) -> (Vec<f64>, Vec<BoundState>, usize) {
        let mut solver = ActiveSetSolver::with_reduced(ActiveSetOptions::default(), reduced);
        let mut z = vec![0.0; lcp.len()];
        let report = solver.solve(lcp, &mut z).unwrap();
        assert_eq!(report.status, Status::Solved);
        // Iterative solves are required to reach 1e-11 relative to the sizes of rows and of z.
        assert!(lcp.natural_residual(&z, &mut z.clone()).unwrap() < 1e-11);
        (z, solver.states().to_vec(), report.linear_iterations)
    }
    for stream in [[0.0, 0.0], [20.0, 5.0], [300.0, 0.0]] {
        let lcp = membrane_in_a_stream(31, stream);
        let (z, states, none) = run(&lcp, DirectReduced::new());
        assert_eq!(none, 0);
        for state in [BoundState::Lower, BoundState::Interior] {
            assert!(states.contains(&state), "{stream:?} has no {state:?}");
        }
        let (by_factors, _, with_factors) = run(&lcp, GmresReduced::default());
        let (by_diagonal, _, with_diagonal) = run(&lcp, GmresReduced::new(Jacobi::default()));
        for other in [by_factors, by_diagonal] {
            assert!(z.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-9));
        }
        // Incomplete factors pay off.
        assert!(0 < with_factors && 2 * with_factors < with_diagonal);
    }
}

#[test]
fn a_preconditioner_that_fails_is_not_hidden() {
    /// Maps everything to zero, so that no direction is left.
    struct Nothing;
    impl Preconditioner for Nothing {
        fn prepare(&mut self, _: MatrixRef<'_>) -> Result<(), LinearError> {
            Ok(())
        }
        fn apply(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
            b.fill(0.0);
            Ok(())
        }
    }
    let lcp = membrane_in_a_stream(7, [20.0, 5.0]);
    let mut solver = ActiveSetSolver::with_reduced(ActiveSetOptions::default(), GmresReduced::new(Nothing));
    let report = solver.solve(&lcp, &mut vec![0.0; 49]).unwrap();
    assert_eq!(report.status, Status::Inaccurate);
}

/// Limits on iterations end the run, and no unsolved point is reported as a solution.
#[test]
fn iterative_solves_end_at_their_limits() {
    let lcp = membrane_in_a_stream(15, [0.0, 0.0]);
    let status = |limit: usize, gmres: bool| {
        let mut z = vec![0.0; lcp.len()];
        let o = ActiveSetOptions::default();
        let report = if gmres {
            let reduced = GmresReduced::default().with_max_iterations(limit);
            ActiveSetSolver::with_reduced(o, reduced).solve(&lcp, &mut z)
        } else {
            let reduced = MultigridReduced::algebraic().with_max_iterations(limit);
            ActiveSetSolver::with_reduced(o, reduced).solve(&lcp, &mut z)
        };
        report.unwrap().status
    };
    for gmres in [false, true] {
        for limit in [0, 1] {
            assert_eq!(status(limit, gmres), Status::Inaccurate, "{limit} {gmres}");
        }
        assert_eq!(status(100, gmres), Status::Solved);
    }
}

/// −u″ = load on a line of n points above an obstacle.
fn string(n: usize, obstacle: impl Fn(f64) -> f64) -> Lcp {
    let mut entries = Vec::new();
    for i in 0..n {
        entries.push((i, i, 2.0));
        if i > 0 {
            entries.push((i, i - 1, -1.0));
            entries.push((i - 1, i, -1.0));
        }
    }
    let h = 1.0 / (n + 1) as f64;
    let lower = (1..=n).map(|i| obstacle(i as f64 * h)).collect();
    let m = Matrix::from_triplets(n, n, &entries).unwrap();
    Lcp::boxed(m, vec![0.0; n], lower, vec![f64::INFINITY; n]).unwrap()
}

fn halving(n: usize) -> Prolongation {
    let mut entries = Vec::new();
    for c in 0..n / 2 {
        entries.push((2 * c, c, 0.5));
        entries.push((2 * c + 1, c, 1.0));
        if 2 * c + 2 < n {
            entries.push((2 * c + 2, c, 0.5));
        }
    }
    Prolongation::new(&Matrix::from_triplets(n, n / 2, &entries).unwrap()).unwrap()
}

/// The taut string over a parabola: tangent lines from the ends, contact between; three routes.
#[test]
fn string_over_a_parabola() {
    let n = 1023;
    // The tangents from (0, 0) and (1, 0) touch 1/4 − 4 (x − 1/2)² at x = √12/8 and 1 − √12/8.
    let obstacle = |x: f64| 0.25 - 4.0 * (x - 0.5) * (x - 0.5);
    let lcp = string(n, obstacle);
    let touch = 12.0_f64.sqrt() / 8.0;
    let exact = |x: f64| {
        let x = x.min(1.0 - x);
        if x < touch {
            x * obstacle(touch) / touch
        } else {
            obstacle(x)
        }
    };
    let mut nested = Nested::new(lcp.clone());
    for size in [1023, 511, 255, 127, 63, 31] {
        nested = nested.coarsen(halving(size)).unwrap();
    }
    let mut by_levels = vec![0.0; n];
    let report = nested
        .solve(&ActiveSetOptions::default(), &mut by_levels)
        .unwrap();
    assert_eq!(report.status(), Status::Solved);
    assert!(report.levels.iter().all(|l| l.report.iterations <= 6));
    let mut by_cholesky = vec![0.0; n];
    let mut solver = ActiveSetSolver::with_reduced(ActiveSetOptions::default(), DirectReduced::new());
    assert_eq!(
        solver.solve(&lcp, &mut by_cholesky).unwrap().status,
        Status::Solved
    );
    let mut by_aggregates = vec![0.0; n];
    let mut solver =
        ActiveSetSolver::with_reduced(ActiveSetOptions::default(), MultigridReduced::algebraic());
    assert_eq!(
        solver.solve(&lcp, &mut by_aggregates).unwrap().status,
        Status::Solved
    );
    for i in 0..n {
        let x = (i + 1) as f64 / (n + 1) as f64;
        assert!(
            (by_cholesky[i] - exact(x)).abs() < 1e-5,
            "{i}: {} {}",
            by_cholesky[i],
            exact(x)
        );
        assert!((by_cholesky[i] - by_levels[i]).abs() < 1e-8);
        assert!((by_cholesky[i] - by_aggregates[i]).abs() < 1e-8);
    }
}

/// Bounds on some unknowns only: coarse levels, which have bounds where their representatives do, must not pass them on to the others.
#[test]
fn unknowns_without_bounds_inherit_none() {
    let mut random = Random::new(4);
    let whole = membrane_in_a_stream(40, [0.0, 0.0]);
    let n = whole.len();
    let (lower, upper): (Vec<f64>, Vec<f64>) = (0..n)
        .map(|_| match random.below(4) {
            0 => (random.symmetric(), f64::INFINITY),
            1 => (f64::NEG_INFINITY, random.symmetric()),
            _ => (f64::NEG_INFINITY, f64::INFINITY),
        })
        .unzip();
    let lcp = Lcp::boxed(whole.matrix().clone(), vec![0.0; n], lower, upper).unwrap();
    let (_, by_cholesky) = run(&lcp, DirectReduced::new(), &vec![0.0; n]);
    let (status, by_aggregates) = run(&lcp, MultigridReduced::algebraic(), &vec![0.0; n]);
    assert_eq!(status, Status::Solved);
    for (a, b) in by_cholesky.iter().zip(&by_aggregates) {
        assert!((a - b).abs() < 1e-8);
    }
}

/// Without load and obstacle a string is straight: iterative solves, too, end at 0 from any start.
#[test]
fn a_free_string_comes_to_rest() {
    let n = 255;
    let lcp = string(n, |_| f64::NEG_INFINITY);
    for far in [1.0, 1e12, 1e300] {
        let mut random = Random::new(7);
        let start: Vec<f64> = (0..n).map(|_| far * random.symmetric()).collect();
        for end in [
            run(&lcp, MultigridReduced::algebraic(), &start),
            run(&lcp, DirectReduced::new(), &start),
        ] {
            assert_eq!(end, (Status::Solved, vec![0.0; n]));
        }
    }
}

fn run<R: ReducedSolver>(lcp: &Lcp, reduced: R, start: &[f64]) -> (Status, Vec<f64>) {
    let mut z = start.to_vec();
    let mut solver = ActiveSetSolver::with_reduced(ActiveSetOptions::default(), reduced);
    let report = solver.solve(lcp, &mut z).unwrap();
    (report.status, z)
}

/// Conjugate gradients reject a diagonal that is not positive, instead of leaving the unknown out.
#[test]
fn a_free_unknown_without_positive_diagonal_is_singular() {
    let n = 15;
    let mut entries: Vec<_> = string(n, |_| -1.0).matrix().triplets().collect();
    entries
        .iter_mut()
        .filter(|t| t.0 == 4 && t.1 == 4)
        .for_each(|t| t.2 = -2.0);
    let matrix = Matrix::from_triplets(n, n, &entries).unwrap();
    let lcp = Lcp::boxed(
        matrix,
        vec![-1.0; n],
        vec![f64::NEG_INFINITY; n],
        vec![f64::INFINITY; n],
    )
    .unwrap();
    let reduced = MultigridReduced::with_prolongations(vec![std::sync::Arc::new(halving(n))]);
    let mut solver = ActiveSetSolver::with_reduced(ActiveSetOptions::default(), reduced);
    let report = solver.solve(&lcp, &mut vec![0.0; n]).unwrap();
    assert_eq!(report.status, Status::Singular);
}

#[test]
fn prolongations_are_checked() {
    let lcp = string(15, |_| -1.0);
    assert!(Nested::new(lcp.clone()).coarsen(halving(17)).is_err());
    assert!(
        Nested::new(lcp.clone())
            .with_coarser(string(9, |_| -1.0), halving(15))
            .is_err()
    );
    assert!(Prolongation::new(&Matrix::identity(3)).is_err());
    assert!(Prolongation::new(&Matrix::from_triplets(3, 2, &[(0, 0, 1.0)]).unwrap()).is_err());
    assert!(halving(15).with_offset(vec![0.0; 3]).is_err());
    assert!(halving(15).with_offset(vec![f64::NAN; 15]).is_err());
    let rediscretised = Nested::new(lcp)
        .with_coarser(string(7, |_| -1.0), halving(15))
        .unwrap();
    let mut z = vec![1.0; 15];
    let report = rediscretised.solve(&ActiveSetOptions::default(), &mut z).unwrap();
    assert_eq!(report.status(), Status::Solved);
    assert!(z.iter().all(|z| z.abs() < 1e-9));
}
