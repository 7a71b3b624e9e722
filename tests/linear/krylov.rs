//! Krylov methods against elimination, against each other, and where they break down.

use super::random::Random;
use proptest::prelude::*;
use semismooth::linear::{
    BlockDiagonal, DenseLu, IncompleteLu, Krylov, LinearError, LinearOperator, LinearSolver, Multigrid,
    Preconditioned, Preconditioner, Prolongation,
};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

fn norm(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |n: f64, v| n.hypot(*v))
}

fn true_residual(a: &Matrix, x: &[f64], b: &[f64]) -> f64 {
    let mut r = vec![0.0; b.len()];
    a.mul_vec(x, &mut r);
    r.iter_mut().zip(b).for_each(|(r, b)| *r -= b);
    norm(&r) / norm(b)
}

fn from_full(n: usize, entry: impl Fn(usize, usize) -> f64) -> Matrix {
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    Matrix::from_rows(&rows).unwrap()
}

/// A matrix with another one as preconditioner, applied by elimination.
struct With<'a> {
    a: &'a Matrix,
    near: DenseLu,
}

impl<'a> With<'a> {
    fn new(a: &'a Matrix, p: &Matrix) -> Self {
        let mut near = DenseLu::new();
        near.analyze(p.pattern().as_ref()).unwrap();
        near.factor(p.as_ref()).unwrap();
        Self { a, near }
    }
}

impl LinearOperator for With<'_> {
    fn order(&self) -> usize {
        self.a.nrows()
    }
    fn product(&mut self, x: &[f64], y: &mut [f64]) {
        self.a.mul_vec(x, y);
    }
    fn precondition(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.near.solve_in_place(b)
    }
}

/// n, entries of a symmetric matrix (indefinite as a rule), of a factor of a definite one, and a right-hand side.
fn systems() -> impl Strategy<Value = (usize, Vec<f64>, Vec<f64>, Vec<f64>)> {
    (2..=10_usize).prop_flat_map(|n| {
        let entries = || prop::collection::vec(-1.0..1.0_f64, n * n);
        (
            Just(n),
            entries(),
            entries(),
            prop::collection::vec(0.1..1.0_f64, n),
        )
    })
}

fn symmetric(n: usize, e: &[f64]) -> Matrix {
    from_full(n, |i, j| e[n * i.min(j) + i.max(j)])
}

fn definite(n: usize, e: &[f64]) -> Matrix {
    let product = |i: usize, j: usize| (0..n).map(|k| e[n * i + k] * e[n * j + k]).sum::<f64>();
    from_full(n, |i, j| product(i, j) + if i == j { 0.5 } else { 0.0 })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn reported_residuals_are_the_true_ones_at_every_iteration((n, e, f, b) in systems()) {
        let (spd, indefinite, p) = (definite(n, &e), symmetric(n, &f), definite(n, &f));
        for limit in 1..=n {
            for (a, method) in [
                (&spd, Krylov::cg()),
                (&spd, Krylov::minres()),
                (&indefinite, Krylov::minres()),
                (&indefinite, Krylov::gmres(4)),
                (&indefinite, Krylov::flexible_gmres(4)),
            ] {
                let mut x = b.clone();
                let report = method
                    .with_max_iterations(limit)
                    .solve(&mut With::new(a, &p), &mut x, 1e-13)
                    .unwrap();
                let size = 1.0 + norm(&x) / norm(&b);
                prop_assert!((true_residual(a, &x, &b) - report.residual).abs() < 1e-11 * size, "{:?}", report);
            }
        }
    }

    #[test]
    fn minimal_residuals_are_those_of_gmres((n, _, f, b) in systems()) {
        let mut a = symmetric(n, &f);
        for limit in 1..=n {
            let mut of = |method: Krylov| {
                let mut x = b.clone();
                method.with_max_iterations(limit).solve(&mut a, &mut x, 1e-12).unwrap().residual
            };
            // Lanczos vectors lose their orthogonality only once a Ritz value has converged.
            let (short, long) = (of(Krylov::minres()), of(Krylov::gmres(n)));
            prop_assert!((short - long).abs() < 1e-6, "{} {}", short, long);
        }
    }

    #[test]
    fn definite_systems_are_solved_within_their_order((n, e, f, b) in systems()) {
        let (a, p) = (definite(n, &e), definite(n, &f));
        let mut exact = b.clone();
        With::new(&b_identity(n), &a).precondition(&mut exact).unwrap();
        for method in [Krylov::cg(), Krylov::minres(), Krylov::gmres(n), Krylov::flexible_gmres(n)] {
            let mut x = b.clone();
            let report = method.clone().solve(&mut With::new(&a, &p), &mut x, 1e-12).unwrap();
            prop_assert!(report.is_solved() && report.iterations <= 2 * n, "{:?} {:?}", method.method(), report);
            prop_assert!(x.iter().zip(&exact).all(|(x, y)| (x - y).abs() < 1e-9 * (1.0 + norm(&exact))));
        }
    }
}

fn b_identity(n: usize) -> Matrix {
    Matrix::identity(n)
}

/// Scales by another factor in each call.
struct Fickle {
    a: Matrix,
    calls: usize,
}

impl LinearOperator for Fickle {
    fn order(&self) -> usize {
        self.a.nrows()
    }
    fn product(&mut self, x: &[f64], y: &mut [f64]) {
        self.a.mul_vec(x, y);
    }
    fn precondition(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        self.calls += 1;
        for (i, b) in b.iter_mut().enumerate() {
            *b /= 1.0 + ((i + self.calls) % 3) as f64;
        }
        Ok(())
    }
}

#[test]
fn only_the_flexible_method_bears_a_preconditioner_that_changes() {
    let a = from_full(12, |i, j| match i.abs_diff(j) {
        0 => 4.0 + i as f64,
        1 => -1.5,
        _ => 0.0,
    });
    let b = vec![1.0; 12];
    let run = |mut method: Krylov| {
        let mut x = b.clone();
        let mut fickle = Fickle {
            a: a.clone(),
            calls: 0,
        };
        let report = method.solve(&mut fickle, &mut x, 1e-11).unwrap();
        (report, true_residual(&a, &x, &b))
    };
    let (report, residual) = run(Krylov::flexible_gmres(12));
    assert!(report.is_solved() && residual < 1e-10, "{report:?} {residual}");
    assert!(run(Krylov::gmres(12)).1 > 1e-3);
}

#[test]
fn breakdowns_are_reported_and_keep_the_best_iterate() {
    let mut saddle = Matrix::from_rows(&[[1.0, 0.0], [0.0, -1.0]]).unwrap();
    let mut x = [1.0, 1.0];
    let report = Krylov::cg().solve(&mut saddle, &mut x, 1e-10).unwrap();
    assert_eq!(
        (report.status, report.residual, x),
        (Status::Singular, 1.0, [0.0; 2])
    );
    // The least-squares solution of a singular system, with the remaining residual: (1, 0) for (1, 1).
    let mut singular = Matrix::from_rows(&[[1.0, 0.0], [0.0, 0.0]]).unwrap();
    for mut method in [Krylov::minres(), Krylov::gmres(5), Krylov::flexible_gmres(5)] {
        let mut x = [1.0, 1.0];
        let report = method.solve(&mut singular, &mut x, 1e-10).unwrap();
        assert_eq!(report.status, Status::Singular, "{:?}", method.method());
        assert!((report.residual - 0.5_f64.sqrt()).abs() < 1e-14);
        assert!((x[0] - 1.0).abs() < 1e-14);
    }
    // A preconditioner that is not definite.
    let identity = Matrix::identity(2);
    for mut method in [Krylov::cg(), Krylov::minres()] {
        let report = method
            .solve(&mut With::new(&identity, &saddle), &mut [1.0, 2.0], 1e-10)
            .unwrap();
        assert_eq!(report.status, Status::Singular);
    }
    let mut x = [1.0, 1.0];
    let few = Krylov::gmres(1).with_max_iterations(1).solve(
        &mut Matrix::from_rows(&[[1.0, 0.0], [0.0, 2.0]]).unwrap(),
        &mut x,
        1e-10,
    );
    assert_eq!(few.unwrap().status, Status::IterationLimit);
    assert_eq!(
        Krylov::minres()
            .solve(&mut saddle, &mut [0.0; 2], 1e-10)
            .unwrap()
            .iterations,
        0
    );
}

/// Singular inconsistent systems, and products near the ends of the range of numbers: recurrences drift away from the true residual, which
/// is computed; no x is worse than 0, and none is infinite.
#[test]
fn reported_residuals_are_those_of_x() {
    let mut random = Random::new(11);
    for round in 0..400 {
        let n = 2 + round % 5;
        let scale = [1.0, 1e-150, 1e150][round % 3];
        let (mut directions, e) = (Vec::<Vec<f64>>::new(), random.vector(n * n, 1.0));
        for v in e.chunks_exact(n) {
            let mut v = v.to_vec();
            for u in directions.iter().chain(&directions) {
                let part: f64 = u.iter().zip(&v).map(|(u, v)| u * v).sum();
                v.iter_mut().zip(u).for_each(|(v, u)| *v -= part * u);
            }
            let length = norm(&v);
            v.iter_mut().for_each(|v| *v /= length);
            directions.push(v);
        }
        let weights: Vec<f64> = (0..n)
            .map(|k| [1.0, -1.0, 0.0][random.below(3)] * 10_f64.powf(-8.0 * k as f64 / n as f64))
            .collect();
        let mut a = from_full(n, |i, j| {
            scale
                * (0..n)
                    .map(|k| weights[k] * directions[k][i] * directions[k][j])
                    .sum::<f64>()
        });
        let b = random.vector(n, 1.0);
        for method in [
            Krylov::cg(),
            Krylov::minres(),
            Krylov::gmres(3),
            Krylov::flexible_gmres(n),
        ] {
            let mut x = b.clone();
            let tolerance = 1e-6;
            let report = method
                .with_max_iterations(100)
                .solve(&mut a, &mut x, tolerance)
                .unwrap();
            assert!(x.iter().all(|x| x.is_finite()));
            let rounding = 1e-14 * (1.0 + scale * n as f64 * norm(&x) / norm(&b));
            let truth = true_residual(&a, &x, &b);
            assert!(
                (truth - report.residual).abs() <= rounding,
                "{round} {report:?} {truth}"
            );
            assert!(report.residual <= 1.0 && report.is_solved() == (report.residual <= tolerance));
        }
    }
    // The solution is 10³⁵⁰.
    let mut x = [1e200];
    let mut small = Matrix::from_rows(&[[1e-150]]).unwrap();
    for mut method in [Krylov::cg(), Krylov::minres(), Krylov::gmres(3)] {
        let result = method.solve(&mut small, &mut x, 1e-6);
        assert!(matches!(result, Err(LinearError::NotFinite { .. })) && x == [0.0]);
        x = [1e200];
    }
}

/// Blocks [0 a; b 0] with the zeros stored: pivots that vanish are replaced by small ones, and nothing is left out of the factors, which are
/// those of a matrix close to the given one.
#[test]
fn incomplete_factors_replace_pivots_that_vanish() {
    let off = [2.0, -1.0, 0.5, 3.0, -4.0, -0.25];
    let entries: Vec<_> = (0..6).flat_map(|i| [(i, i, 0.0), (i, i ^ 1, off[i])]).collect();
    let a = Matrix::from_triplets(6, 6, &entries).unwrap();
    let b = [1.0, -2.0, 3.0, 0.5, 0.25, -1.0];
    let (mut near, mut y) = (IncompleteLu::default(), b);
    near.prepare(a.as_ref()).unwrap();
    near.apply(&mut y).unwrap();
    for i in 0..6 {
        assert!((off[i] * y[i ^ 1] - b[i]).abs() < 1e-6, "{y:?}");
    }
}

/// Finite for this number of products.
struct Breaking(usize);

impl LinearOperator for Breaking {
    fn order(&self) -> usize {
        20
    }
    fn product(&mut self, x: &[f64], y: &mut [f64]) {
        for i in 0..x.len() {
            y[i] = (1.0 + i as f64) * x[i] / if self.0 == 0 { 0.0 } else { 1.0 };
        }
        self.0 = self.0.saturating_sub(1);
    }
}

#[test]
fn numbers_that_are_none_end_a_solve_at_the_last_finite_point() {
    let b: Vec<f64> = (0..20).map(|i| 1.0 + (i as f64).sin()).collect();
    let a = from_full(20, |i, j| if i == j { 1.0 + i as f64 } else { 0.0 });
    for mut method in [
        Krylov::cg(),
        Krylov::minres(),
        Krylov::gmres(10),
        Krylov::flexible_gmres(10),
    ] {
        let mut x = b.clone();
        let error = method.solve(&mut Breaking(5), &mut x, 1e-12).unwrap_err();
        assert!(matches!(error, LinearError::NotFinite { .. }), "{error}");
        let left = true_residual(&a, &x, &b);
        assert!(left < 0.3, "{:?} {left}", method.method());
    }
}

fn laplacian(m: usize, reaction: impl Fn(usize) -> f64) -> Matrix {
    let mut entries = vec![];
    for k in 0..m * m {
        entries.push((k, k, 4.0 + reaction(k)));
        if k % m > 0 {
            entries.extend([(k, k - 1, -1.0), (k - 1, k, -1.0)]);
        }
        if k >= m {
            entries.extend([(k, k - m, -1.0), (k - m, k, -1.0)]);
        }
    }
    Matrix::from_triplets(m * m, m * m, &entries).unwrap()
}

/// Bilinear interpolation from every second line of m × m points, m odd.
fn interpolation(m: usize) -> Prolongation {
    let coarse = m / 2;
    let near = |a: usize| [(2 * a, 0.5), (2 * a + 1, 1.0), (2 * a + 2, 0.5)];
    let mut weights = vec![];
    for (a, b) in (0..coarse).flat_map(|b| (0..coarse).map(move |a| (a, b))) {
        for (j, v) in near(b) {
            weights.extend(near(a).map(|(i, u)| (j * m + i, b * coarse + a, u * v)));
        }
    }
    Prolongation::new(&Matrix::from_triplets(m * m, coarse * coarse, &weights).unwrap()).unwrap()
}

#[test]
fn multigrid_takes_as_many_iterations_on_every_grid() {
    let run = |m: usize, mut multigrid: Multigrid, change: f64| {
        let a = laplacian(m, |_| 0.0);
        multigrid.prepare(a.as_ref()).unwrap();
        // Other values on the same pattern, with a jump.
        let a = laplacian(m, |k| if k % m < m / 3 { change } else { 0.0 });
        multigrid.prepare(a.as_ref()).unwrap();
        let b: Vec<f64> = (0..m * m).map(|k| ((k * k) as f64).cos()).collect();
        let mut x = b.clone();
        let mut system = Preconditioned::new(&a, &mut multigrid);
        let report = Krylov::cg().solve(&mut system, &mut x, 1e-11).unwrap();
        assert!(report.is_solved() && true_residual(&a, &x, &b) < 2e-11);
        report.iterations
    };
    let nested = |mut m: usize| {
        let mut all = vec![];
        while m > 3 {
            all.push(interpolation(m));
            m /= 2;
        }
        Multigrid::with_prolongations(all)
    };
    for change in [0.0, 0.01, 3.0] {
        let counts = [15, 31, 63].map(|m| run(m, nested(m), change));
        assert!(
            counts.iter().all(|c| *c <= 14) && counts[2] <= counts[1] + 1,
            "{counts:?}"
        );
        let found = [15, 31, 63].map(|m| run(m, Multigrid::algebraic(), change));
        assert!(found.iter().all(|c| *c <= 30), "{found:?}");
    }
}

#[test]
fn new_values_over_a_pattern_serve_as_a_fresh_preconditioner_does() {
    let (first, second) = (laplacian(15, |_| 0.0), laplacian(15, |k| k as f64));
    let (mut kept, mut fresh) = (
        Multigrid::with_prolongations(vec![interpolation(15), interpolation(7)]),
        Multigrid::with_prolongations(vec![interpolation(15), interpolation(7)]),
    );
    kept.prepare(first.as_ref()).unwrap();
    kept.prepare(second.as_ref()).unwrap();
    fresh.prepare(second.as_ref()).unwrap();
    let mut both = [vec![1.0; 225], vec![1.0; 225]];
    kept.apply(&mut both[0]).unwrap();
    fresh.apply(&mut both[1]).unwrap();
    assert!(both[0].iter().zip(&both[1]).all(|(a, b)| (a - b).abs() < 1e-14));
    assert_eq!(kept.levels(), [225, 49, 9]);
}

#[test]
fn block_diagonals_are_their_blocks() {
    let a = laplacian(4, |k| k as f64);
    let mut blocks = BlockDiagonal::new()
        .with_block(10, IncompleteLu::default())
        .with_block(6, IncompleteLu::default());
    blocks.prepare(laplacian(4, |_| 0.0).as_ref()).unwrap();
    blocks.prepare(a.as_ref()).unwrap();
    let mut b: Vec<f64> = (0..16).map(|i| i as f64 - 7.0).collect();
    let mut expected = b.clone();
    for (from, to) in [(0, 10), (10, 16)] {
        let part = from_full(to - from, |i, j| a.get(from + i, from + j));
        // Full patterns drop nothing, those of the blocks do.
        let block = Matrix::from_triplets(
            to - from,
            to - from,
            &part.triplets().filter(|t| t.2 != 0.0).collect::<Vec<_>>(),
        )
        .unwrap();
        let mut ilu = IncompleteLu::default();
        ilu.prepare(block.as_ref()).unwrap();
        ilu.apply(&mut expected[from..to]).unwrap();
    }
    blocks.apply(&mut b).unwrap();
    assert!(b.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-13));
}
