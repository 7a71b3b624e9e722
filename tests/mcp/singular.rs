//! Singular systems: without solutions they are never solved, however far out; regular ones are, however far out their solution is.

use proptest::prelude::*;
use semismooth::complementarity::active_set::ActiveSetSolver;
use semismooth::complementarity::{Autodiff, Lcp, Mcp, McpFunction, McpSolver, SmoothFunction, WithJacobian};
use semismooth::newton::Newton;
use semismooth::piecewise::Real;
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use crate::random::Random;
use crate::support::{INF, matrix};

/// A x = b, given as data and as functions that are not known to be affine.
fn systems(a: &[Vec<f64>], b: &[f64]) -> (Lcp, Mcp<impl McpFunction + use<>>) {
    let (n, minus): (usize, Vec<f64>) = (b.len(), b.iter().map(|b| -b).collect());
    let lcp = Lcp::boxed(matrix(a), minus, vec![-INF; n], vec![INF; n]).unwrap();
    let (rows, right, same) = (a.to_vec(), b.to_vec(), a.to_vec());
    let function = WithJacobian::new(
        n,
        move |x: &[f64], out: &mut [f64]| {
            for (i, out) in out.iter_mut().enumerate() {
                *out = rows[i].iter().zip(x).map(|(a, x)| a * x).sum::<f64>() - right[i];
            }
        },
        move |_: &[f64], jac: &mut Matrix| {
            for (i, row) in same.iter().enumerate() {
                row.iter().enumerate().for_each(|(j, a)| jac.add(i, j, *a));
            }
        },
    );
    (lcp, Mcp::equations(function).unwrap())
}

/// What each solver calls solved from a start.
fn found(a: &[Vec<f64>], b: &[f64], start: &[f64]) -> Vec<(&'static str, Vec<f64>)> {
    let (lcp, own) = systems(a, b);
    let mut found = Vec::new();
    let mut note = |name, solved: bool, x: &[f64]| {
        if solved {
            found.push((name, x.to_vec()));
        }
    };
    let mut x = start.to_vec();
    let solved = McpSolver::default().solve(lcp.mcp(), &mut x).unwrap().is_solved();
    note("affine", solved, &x);
    x.copy_from_slice(start);
    let solved = McpSolver::default().solve(&own, &mut x).unwrap().is_solved();
    note("own", solved, &x);
    x.copy_from_slice(start);
    let report = ActiveSetSolver::default().solve(&lcp, &mut x).unwrap();
    note("active set", report.status == Status::Solved, &x);
    x.copy_from_slice(start);
    let solved = Newton::default().solve(&own, &mut x).is_ok();
    note("newton", solved, &x);
    found
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None, ..ProptestConfig::default() })]

    /// The last row but one is a combination of those before it with another right-hand side; one row with an unknown of its own is beside
    /// them, coupled or not. Integers, so that they contradict each other as stored.
    #[test]
    fn contradictory_equations_are_never_solved(seed in 1_u64.., n in 2_usize..6, off in 0_i32..7, far in 0_i32..16) {
        let mut rng = Random::new(seed);
        let mut integer = |bound: usize| rng.below(2 * bound + 1) as f64 - bound as f64;
        let mut a: Vec<Vec<f64>> = (0..n).map(|_| (0..=n).map(|j| if j < n { integer(4) } else { integer(1) }).collect()).collect();
        let mut b: Vec<f64> = (0..n).map(|_| integer(5)).collect();
        let factors: Vec<f64> = (0..n - 1).map(|_| integer(2)).collect();
        let mut last = vec![0.0; n + 1];
        let mut right = 2.0_f64.powi(-3 * off);
        for (k, f) in factors.iter().enumerate() {
            last.iter_mut().zip(&a[k]).for_each(|(l, a)| *l += f * a);
            right += f * b[k];
        }
        (a[n - 1], b[n - 1]) = (last, right);
        let mut own = vec![0.0; n + 1];
        own[n] = 1.0;
        a.push(own);
        b.push(1.0);
        let start: Vec<f64> = (0..=n).map(|_| 10_f64.powi(far) * rng.symmetric()).collect();
        for (name, x) in found(&a, &b, &start) {
            prop_assert!(false, "{} solves {:?} {:?} at {:?}", name, a, b, x);
        }
    }

    /// A triangle with entries from 1e-20 to 1e20, some unknowns of which are far out: every solver finds them.
    #[test]
    fn regular_equations_are_solved_however_far_out(seed in 1_u64.., n in 1_usize..6) {
        let mut rng = Random::new(seed);
        let mut a = vec![vec![0.0; n]; n];
        for i in 0..n {
            for j in 0..=i {
                a[i][j] = if i == j { 10_f64.powf(20.0 * rng.symmetric()) } else { rng.symmetric() };
            }
        }
        let b: Vec<f64> = (0..n).map(|_| 1.0 + rng.unit()).collect();
        let mut exact = vec![0.0; n];
        for i in 0..n {
            let known: f64 = (0..i).map(|j| a[i][j] * exact[j]).sum();
            exact[i] = (b[i] - known) / a[i][i];
        }
        let (lcp, _) = systems(&a, &b);
        let mut x = vec![0.0; n];
        let report = McpSolver::default().solve(lcp.mcp(), &mut x).unwrap().clone();
        prop_assert!(report.is_solved(), "{:?} {:?}", report.status, a);
        for (x, e) in x.iter().zip(&exact) {
            prop_assert!((x - e).abs() <= 1e-9 * e.abs(), "{:?} {:?}", x, e);
        }
    }
}

/// x₀ = 1e20, and x₁ one less, which is no other number.
#[test]
fn a_solution_beyond_the_digits_of_its_constants_is_found() {
    let (a, b) = ([vec![1e-20, 0.0], vec![1.0, -1.0]], [1.0, 1.0]);
    let found = found(&a, &b, &[0.0, 0.0]);
    // Of functions that are not known to be affine McpSolver keeps iterates within 1e10 of the start.
    let names: Vec<_> = found.iter().map(|f| f.0).filter(|name| *name != "own").collect();
    assert_eq!(names, ["affine", "active set", "newton"], "{found:?}");
    for (name, x) in found {
        assert!(x.iter().all(|x| (x / 1e20 - 1.0).abs() < 1e-12), "{name}: {x:?}");
    }
}

/// x₀ − x₁ + e^{x₂} = 2, x₁ − x₀ = 1, e^{x₂} = 1: the first two add up to e^{x₂} = 3. With x₁ − x₀ = −1 they are solvable.
struct Coupled(f64);

impl SmoothFunction for Coupled {
    fn num_vars(&self) -> usize {
        3
    }
    fn num_values(&self) -> usize {
        3
    }
    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        out[0] = x[0] - x[1] + x[2].exp() - 2.0;
        out[1] = x[1] - x[0] - self.0;
        out[2] = x[2].exp() - 1.0;
    }
}

#[test]
fn a_coupled_curved_row_does_not_excuse_a_contradiction() {
    for start in [
        [0.0, 0.0, 0.5],
        [1e9, 1e9, 0.5],
        [1e14, -1e14, 0.0],
        [3.0, 1e17, 1.0],
    ] {
        let mut x = start;
        let problem = Mcp::equations(Autodiff::new(Coupled(1.0))).unwrap();
        let report = McpSolver::default().solve(&problem, &mut x).unwrap().clone();
        assert!(!report.is_solved(), "{start:?}: {x:?}");
    }
    let mut x = [0.0, 0.0, 0.5];
    let problem = Mcp::equations(Autodiff::new(Coupled(-1.0))).unwrap();
    let report = McpSolver::default().solve(&problem, &mut x).unwrap().clone();
    assert!(report.is_solved() && (x[0] - x[1] - 1.0).abs() < 1e-9 && x[2].abs() < 1e-9);
}

/// A body without forces: what is left of a start of size 1 is rounding, and 0 is a solution.
#[test]
fn equations_without_constants_are_solved_at_zero() {
    let a = [vec![2.0, -1.0, 0.0], vec![-1.0, 2.0, -1.0], vec![0.0, -1.0, 2.0]];
    for start in [[1.0, -2.0, 0.7], [1e9, 0.3, -1e-9], [0.0; 3]] {
        let found = found(&a, &[0.0; 3], &start);
        assert_eq!(found.len(), 4, "{start:?}: {found:?}");
        for (name, x) in found {
            let most = start.iter().fold(0.0_f64, |m, s| m.max(s.abs()));
            assert!(
                x.iter().all(|x| x.abs() <= 1e-12 * most),
                "{name} from {start:?}: {x:?}"
            );
        }
    }
}

/// At 1e13 the sums of these rows are rounded by more than the 1/64 by which the last one contradicts the others: their residual is exactly 0
/// there, below any absolute tolerance.
#[test]
fn residuals_that_rounding_makes_zero_solve_nothing() {
    let rows = [
        [2.0, 2.0, -4.0, -3.0],
        [-1.0, -2.0, 0.0, -3.0],
        [-3.0, -3.0, 3.0, 0.0],
        [9.0, 11.0, -11.0, 0.0],
    ];
    let mut a: Vec<Vec<f64>> = rows.iter().map(|row| row.to_vec()).collect();
    a.iter_mut()
        .zip([0.0, -1.0, -1.0, 3.0])
        .for_each(|(row, own)| row.push(own));
    a.push(vec![0.0, 0.0, 0.0, 0.0, 1.0]);
    let b = [5.0, 2.0, 3.0, 3.015625, 1.0];
    let start = [
        -66280784142676.484,
        -71930649585497.95,
        42804695044126.38,
        -76162738580585.84,
        69323299482529.89,
    ];
    assert_eq!(found(&a, &b, &start), []);
}
