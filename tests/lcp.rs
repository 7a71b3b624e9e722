//! Linear complementarity problems: pivoting against complete enumeration.

use proptest::prelude::*;
use semismooth::complementarity::Lcp;
use semismooth::complementarity::pivoting::{Lemke, LemkeOptions, LemkeStatus};
use semismooth::enumeration::{EnumerationOptions, SolutionSet, all_solutions};
use semismooth::sparse::Matrix;

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

fn lemke(lcp: &Lcp) -> (LemkeStatus, Vec<f64>, f64) {
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
        prop_assert_eq!(status, LemkeStatus::Solved);
        prop_assert!(residual < 1e-12);
        prop_assert!(listed(&set, &z));
    }

    /// Positive semidefinite: solvable exactly if feasible, and Lemke's method tells, with a certificate.
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
            prop_assert_eq!(status, LemkeStatus::Ray { infeasible: true });
        } else {
            prop_assert_eq!(status, LemkeStatus::Solved);
            prop_assert!(residual < 1e-12);
            prop_assert!(listed(&set, &z));
        }
    }

    /// Strictly copositive (all entries ≥ 0, positive diagonal): always solvable, often with several solutions.
    #[test]
    fn strictly_copositive(m in prop::collection::vec((0..=4_i8).prop_map(f64::from), N * N), q in small_integers(N)) {
        let lcp = Lcp::new(matrix(N, |i, j| m[i * N + j] + f64::from(u8::from(i == j))), q).unwrap();
        let (status, z, residual) = lemke(&lcp);
        prop_assert_eq!(status, LemkeStatus::Solved);
        prop_assert!(residual < 1e-12);
        prop_assert!(listed(&enumerate(&lcp), &z));
    }

    /// Any matrix: what is called solved is listed, and a certificate is never given to a solvable problem.
    #[test]
    fn any_matrix(m in small_integers(N * N), q in small_integers(N)) {
        let lcp = Lcp::new(matrix(N, |i, j| m[i * N + j]), q).unwrap();
        let set = enumerate(&lcp);
        let none = set.solutions.is_empty() && set.continua.is_empty();
        let (status, z, residual) = lemke(&lcp);
        match status {
            LemkeStatus::Solved => {
                prop_assert!(residual < 1e-12);
                prop_assert!(listed(&set, &z));
            }
            LemkeStatus::Ray { infeasible } => prop_assert!(none || !infeasible),
            other => prop_assert!(false, "{:?}", other),
        }
    }

    /// A finite box has a solution for every matrix.
    #[test]
    fn boxes(m in small_integers(N * N), q in small_integers(N), width in prop::collection::vec(0..4_u8, N)) {
        let upper: Vec<f64> = width.iter().map(|w| f64::from(*w) - 1.0).collect();
        let lcp = Lcp::boxed(matrix(N, |i, j| m[i * N + j]), q, vec![-1.0; N], upper).unwrap();
        let (status, z, residual) = lemke(&lcp);
        prop_assert_eq!(status, LemkeStatus::Solved);
        prop_assert!(residual < 1e-12);
        prop_assert!(listed(&enumerate(&lcp), &z));
    }
}

#[test]
fn lemke_stops_at_its_limit_on_exponential_families() {
    let lcp = murty(40);
    let mut z = vec![0.0; 40];
    let options = LemkeOptions::default().with_max_pivots(5000);
    let report = Lemke::new(options).solve(&lcp, &mut z).unwrap();
    assert_eq!((report.status, report.pivots), (LemkeStatus::PivotLimit, 5000));
    // The covering vector chooses the path: this one is short.
    let covering = (0..40).map(|i| f64::from(i + 1)).collect();
    let report = Lemke::new(LemkeOptions::default().with_covering(covering))
        .solve(&lcp, &mut z)
        .unwrap();
    assert_eq!(report.status, LemkeStatus::Solved);
    assert!(z[0] == 1.0 && z[1..].iter().all(|z| *z == 0.0), "{z:?}");
}
