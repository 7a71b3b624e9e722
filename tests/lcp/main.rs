//! Linear complementarity problems: pivoting against complete enumeration.

use std::ops::ControlFlow;

use proptest::prelude::*;
use semismooth::complementarity::active_set::ActiveSetSolver;
use semismooth::complementarity::pivoting::{Lemke, LemkeOptions};
use semismooth::complementarity::{BoundState, Lcp};
use semismooth::enumeration::{EnumerationOptions, SolutionSet, all_solutions};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

#[path = "../common/random.rs"]
mod random;

mod active_set;
mod games;
mod infeasible;
mod sparse;

fn enumerate(lcp: &Lcp) -> SolutionSet {
    all_solutions(lcp.mcp(), 0.0, &EnumerationOptions::default()).unwrap()
}

fn matrix(n: usize, entry: impl Fn(usize, usize) -> f64) -> Matrix {
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    Matrix::from_rows(&rows).unwrap()
}

/// Whether a point is among the enumerated solutions, or lies on one of their continua.
fn listed(set: &SolutionSet, z: &[f64]) -> bool {
    let near = |x: &[f64]| {
        x.iter()
            .zip(z)
            .all(|(a, b)| (a - b).abs() < 1e-7 * (1.0 + a.abs()))
    };
    !set.continua.is_empty() || set.solutions.iter().any(|s| near(&s.x))
}

/// Murty's family: M lower triangular with 1 on the diagonal and 2 below, q = −1; the solution is e₁.
fn murty(n: usize) -> Lcp {
    let m = matrix(n, |i, j| {
        [0.0, 1.0, 2.0][usize::from(i >= j) + usize::from(i > j)]
    });
    Lcp::new(m, vec![-1.0; n]).unwrap()
}

/// Entries −2, −1, 0, 1, 2: ties and degenerate vertices abound.
fn small_integers(len: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec((-2..=2_i8).prop_map(f64::from), len)
}

fn reals(len: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-1.0..1.0, len)
}

const N: usize = 5;

fn lemke(lcp: &Lcp) -> (Status, Vec<f64>, f64) {
    let mut z = vec![f64::NAN; lcp.len()];
    let report = Lemke::default().solve(lcp, &mut z).unwrap();
    (report.status, z, report.residual)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// A P matrix has exactly one solution for every q.
    #[test]
    fn p_matrices(g in reals(N * N), s in reals(N * N), q in reals(N)) {
        // GᵀG + I/10 + skew is positive definite, hence P.
        let lcp = Lcp::new(matrix(N, |i, j| {
            let dot: f64 = (0..N).map(|k| g[k * N + i] * g[k * N + j]).sum();
            dot + if i == j { 0.1 } else { s[i * N + j] - s[j * N + i] }
        }), q).unwrap();
        let set = enumerate(&lcp);
        prop_assert_eq!(set.solutions.len(), 1);
        prop_assert_eq!(set.index_sum, Some(1));
        let (status, z, residual) = lemke(&lcp);
        prop_assert_eq!(status, Status::Solved);
        prop_assert!(residual < 1e-12);
        prop_assert!(listed(&set, &z));
    }

    /// Units of z and of M z + q change nothing.
    #[test]
    fn in_other_units(
        g in reals(N * N), s in reals(N * N), q in reals(N),
        unit in prop::sample::select(vec![1e-9, 1.0, 1e9]), force in prop::sample::select(vec![1e-9, 1.0, 1e9])
    ) {
        let entry = |i: usize, j: usize| {
            let dot: f64 = (0..N).map(|k| g[k * N + i] * g[k * N + j]).sum();
            dot + if i == j { 0.1 } else { s[i * N + j] - s[j * N + i] }
        };
        let (status, known, _) = lemke(&Lcp::new(matrix(N, entry), q.clone()).unwrap());
        prop_assert_eq!(status, Status::Solved);
        let other = q.iter().map(|q| force * q).collect();
        let lcp = Lcp::new(matrix(N, |i, j| force / unit * entry(i, j)), other).unwrap();
        let largest = known.iter().fold(0.0_f64, |a, z| a.max(z.abs()));
        let same = |z: &[f64]| z.iter().zip(&known).all(|(z, k)| (z / unit - k).abs() <= 1e-9 * largest);
        let (status, z, _) = lemke(&lcp);
        prop_assert_eq!(status, Status::Solved);
        prop_assert!(same(&z), "Lemke {:?} {:?}", z, known);
        let mut z = vec![0.0; N];
        let report = ActiveSetSolver::default().solve(&lcp, &mut z).unwrap();
        prop_assert_eq!(report.status, Status::Solved);
        prop_assert!(same(&z), "active sets {:?} {:?}", z, known);
        let set = enumerate(&lcp);
        prop_assert!(set.solutions.len() == 1 && same(&set.solutions[0].x), "{:?} {:?}", set, known);
    }

    /// So do units of each unknown and of each row: rows and columns of a P matrix multiplied by powers of two are another one.
    #[test]
    fn lemke_in_units_of_each_unknown(
        g in reals(N * N), s in reals(N * N), q in reals(N),
        rows in prop::collection::vec(-40i32..=40, N), columns in prop::collection::vec(-40i32..=40, N)
    ) {
        let entry = |i: usize, j: usize| {
            let dot: f64 = (0..N).map(|k| g[k * N + i] * g[k * N + j]).sum();
            dot + if i == j { 0.1 } else { s[i * N + j] - s[j * N + i] }
        };
        let unit = |e: i32| f64::from(e).exp2();
        let (status, known, _) = lemke(&Lcp::new(matrix(N, entry), q.clone()).unwrap());
        prop_assert_eq!(status, Status::Solved);
        let scaled = matrix(N, |i, j| unit(rows[i] - columns[j]) * entry(i, j));
        let q = q.iter().zip(&rows).map(|(q, e)| q * unit(*e)).collect();
        let (status, z, _) = lemke(&Lcp::new(scaled, q).unwrap());
        prop_assert_eq!(status, Status::Solved);
        let largest = known.iter().fold(0.0_f64, |a, z| a.max(z.abs()));
        for ((z, e), known) in z.iter().zip(&columns).zip(&known) {
            prop_assert!((z / unit(*e) - known).abs() <= 1e-9 * largest, "{:?}", known);
        }
    }

    /// Positive semidefinite: solvable exactly if feasible, and Lemke's method decides, with a certificate.
    #[test]
    fn positive_semidefinite(g in small_integers(2 * N), s in small_integers(N * N), q in small_integers(N)) {
        let lcp = Lcp::new(matrix(N, |i, j| {
            let dot: f64 = (0..2).map(|k| g[k * N + i] * g[k * N + j]).sum();
            dot + s[i * N + j] - s[j * N + i]
        }), q).unwrap();
        let set = enumerate(&lcp);
        prop_assert!(set.completeness.is_complete());
        let (status, z, residual) = lemke(&lcp);
        if set.solutions.is_empty() && set.continua.is_empty() {
            prop_assert_eq!(status, Status::NoSolution);
        } else {
            prop_assert_eq!(status, Status::Solved);
            prop_assert!(residual < 1e-12);
            prop_assert!(listed(&set, &z));
        }
    }

    /// Strictly copositive (all entries ≥ 0, positive diagonal): always solvable, often with several solutions.
    #[test]
    fn strictly_copositive(m in prop::collection::vec((0..=4_i8).prop_map(f64::from), N * N), q in small_integers(N)) {
        let lcp = Lcp::new(matrix(N, |i, j| m[i * N + j] + f64::from(u8::from(i == j))), q).unwrap();
        let (status, z, residual) = lemke(&lcp);
        prop_assert_eq!(status, Status::Solved);
        prop_assert!(residual < 1e-12);
        prop_assert!(listed(&enumerate(&lcp), &z));
    }

    /// The sparsity pattern of a matrix does not matter.
    #[test]
    fn sparse_matrices(m in small_integers(N * N), q in reals(N), shift in 4.5..6.0f64) {
        let entry = |i: usize, j: usize| {
            let near = i.abs_diff(j) <= 1;
            f64::from(u8::from(near)) * m[i * N + j] + shift * f64::from(u8::from(i == j))
        };
        let triplets: Vec<_> = (0..N)
            .flat_map(|i| (i.saturating_sub(1)..N.min(i + 2)).map(move |j| (i, j)))
            .map(|(i, j)| (i, j, entry(i, j)))
            .collect();
        let sparse = Lcp::new(Matrix::from_triplets(N, N, &triplets).unwrap(), q.clone()).unwrap();
        let (status, z, residual) = lemke(&sparse);
        prop_assert_eq!(status, Status::Solved);
        prop_assert!(residual < 1e-12);
        let (_, full, _) = lemke(&Lcp::new(matrix(N, entry), q).unwrap());
        prop_assert!(z.iter().zip(&full).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    /// Any matrix: what is reported solved is listed, and a solvable problem never gets a certificate of infeasibility.
    #[test]
    fn any_matrix(m in small_integers(N * N), q in small_integers(N)) {
        let lcp = Lcp::new(matrix(N, |i, j| m[i * N + j]), q).unwrap();
        let set = enumerate(&lcp);
        let none = set.solutions.is_empty() && set.continua.is_empty();
        let (status, z, residual) = lemke(&lcp);
        match status {
            Status::Solved => {
                prop_assert!(residual < 1e-12);
                prop_assert!(listed(&set, &z));
            }
            Status::NoSolution => prop_assert!(none),
            Status::Ray => {}
            other => prop_assert!(false, "{:?}", other),
        }
    }

    /// A finite box has a solution for every matrix.
    #[test]
    fn boxes(m in small_integers(N * N), q in small_integers(N), width in prop::collection::vec(0..4_u8, N)) {
        let upper: Vec<f64> = width.iter().map(|w| f64::from(*w) - 1.0).collect();
        let lcp = Lcp::boxed(matrix(N, |i, j| m[i * N + j]), q, vec![-1.0; N], upper).unwrap();
        let (status, z, residual) = lemke(&lcp);
        prop_assert_eq!(status, Status::Solved);
        prop_assert!(residual < 1e-12);
        prop_assert!(listed(&enumerate(&lcp), &z));
    }
}

/// At the solution all terms of some rows are rounding of the largest component: neither their signs nor their relative sizes mean
/// anything.
#[test]
fn rows_of_rounding_are_rows_of_zeros() {
    let m = [
        [0.0, 0.0, 1.0, 1.0, 0.0],
        [-1.0, -1.0, 0.0, -2.0, 1.0],
        [-1.0, -2.0, -1.0, -2.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [1.0, 1.0, -1.0, 0.0, 1.0],
    ];
    let (lower, upper) = (vec![-1.0; 5], vec![1.0, 1.0, 1.0, 0.0, 1.0]);
    let lcp = Lcp::boxed(
        matrix(5, |i, j| m[i][j]),
        vec![0.0, -1.0, -2.0, -2.0, 0.0],
        lower,
        upper,
    )
    .unwrap();
    let (status, z, residual) = lemke(&lcp);
    assert_eq!(status, Status::Solved);
    assert!(residual <= 1e-14 && listed(&enumerate(&lcp), &z), "{z:?}");
}

#[test]
fn lemke_stops_at_its_limit_on_exponential_families() {
    let lcp = murty(40);
    let mut z = vec![0.0; 40];
    let options = LemkeOptions::default().with_max_pivots(5000);
    let report = Lemke::new(options).solve(&lcp, &mut z).unwrap();
    assert_eq!((report.status, report.pivots), (Status::IterationLimit, 5000));
    let mut covers = Vec::new();
    let stopped = Lemke::default().solve_observed(&lcp, &mut z, |pivot| {
        covers.push(pivot.cover);
        assert_eq!((pivot.index, pivot.path), (covers.len(), 0));
        match covers.len() {
            100 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    });
    let stopped = stopped.unwrap();
    assert_eq!((stopped.status, stopped.pivots), (Status::Interrupted, 100));
    // The problem of a P matrix has one solution for each t, so that t never grows along the path.
    assert!(
        covers.windows(2).all(|t| t[1] <= t[0] && t[1] > 0.0),
        "{covers:?}"
    );
    // The covering vector chooses the path: this one is short.
    let covering = (0..40).map(|i| f64::from(i + 1)).collect();
    let report = Lemke::new(LemkeOptions::default().with_covering(covering))
        .solve(&lcp, &mut z)
        .unwrap();
    assert_eq!(report.status, Status::Solved);
    assert!(z[0] == 1.0 && z[1..].iter().all(|z| *z == 0.0), "{z:?}");
}

/// w₂ = z₁ + z₂ − 1 − e at z₁ = 1: z₂ = e, however small that is compared with the terms.
#[test]
fn small_violations_are_violations() {
    for e in [1e-3, 1e-4, 1e-6, 1e-8] {
        let m = Matrix::from_rows(&[[1.0, 0.0], [1.0, 1.0]]).unwrap();
        let lcp = Lcp::new(m, vec![-1.0, -1.0 - e]).unwrap();
        for start in [[1.0, 0.0], [0.0, 0.0], [1.0, 1.0]] {
            let mut z = start;
            let report = ActiveSetSolver::default().solve(&lcp, &mut z).unwrap();
            assert_eq!(report.status, Status::Solved);
            assert!((z[1] - e).abs() < 1e-15 && z[0] == 1.0, "{e:e} {z:?}");
        }
    }
}

/// The solution of three equations, by Cramer's rule; entries are small integers, so that nonzero numbers are not small.
fn cramer(rows: [[f64; 4]; 3]) -> Option<[f64; 3]> {
    let det = |c: [usize; 3]| -> f64 {
        let at = |i: usize, j: usize| rows[i][c[j]];
        (0..3)
            .map(|j| {
                let (k, l) = ((j + 1) % 3, (j + 2) % 3);
                at(0, j) * (at(1, k) * at(2, l) - at(1, l) * at(2, k))
            })
            .sum()
    };
    let d = det([0, 1, 2]);
    (d != 0.0).then(|| [det([3, 1, 2]) / d, det([0, 3, 2]) / d, det([0, 1, 3]) / d])
}

/// Lemke's method reports infeasibility only where no z ≥ l has M z + q ≥ 0. Three inequalities bound z, so that the set has a vertex if it
/// is nonempty: all are tried.
#[test]
fn what_is_called_infeasible_has_no_feasible_point() {
    let mut random = random::Random::new(14);
    let mut integer = move || random.below(5) as f64 - 2.0;
    let (mut proven, mut others) = (0, 0);
    for case in 0..6000 {
        let m: [[f64; 3]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| integer()));
        let q: [f64; 3] = std::array::from_fn(|_| integer());
        let lower = if case % 2 == 0 { 0.0 } else { -1.0 };
        let rows = matrix(3, |i, j| m[i][j]);
        let lcp = Lcp::boxed(rows, q.to_vec(), vec![lower; 3], vec![f64::INFINITY; 3]).unwrap();
        let infeasible = match lemke(&lcp).0 {
            Status::NoSolution => true,
            Status::Ray => false,
            _ => continue,
        };
        // a·z ≥ b.
        let plane = |k: usize| match k {
            0..3 => [m[k][0], m[k][1], m[k][2], -q[k]],
            _ => std::array::from_fn(|j| match j {
                3 => lower,
                _ => f64::from(u8::from(j == k - 3)),
            }),
        };
        let triples = (0..6).flat_map(|a| (0..a).flat_map(move |b| (0..b).map(move |c| [a, b, c])));
        let feasible = triples.filter_map(|t| cramer(t.map(plane))).any(|z| {
            (0..6).map(plane).all(|[a, b, c, d]| {
                let value = a * z[0] + b * z[1] + c * z[2];
                value >= d - 1e-9
            })
        });
        assert!(!(infeasible && feasible), "{m:?} {q:?} {lower}");
        *(if infeasible { &mut proven } else { &mut others }) += 1;
    }
    assert!(proven > 100 && others > 100, "{proven} {others}");
}
