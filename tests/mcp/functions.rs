//! The ways to provide a function agree.

use semismooth::InputError;
use semismooth::complementarity::{
    Autodiff, ComplementarityError, ConstraintKind, Differenced, Mcp, McpFunction, McpSolver, Program,
    SmoothFunction, WithJacobian, check_jacobian, kkt,
};
use semismooth::piecewise::Real;
use semismooth::sparse::{Matrix, Pattern};

use crate::support::{INF, residual, solve};

const N: usize = 40;

/// A chain xᵢ³ + 2xᵢ − xᵢ₋₁ − xᵢ₊₁ + qᵢ.
struct Chain;

impl SmoothFunction for Chain {
    fn num_vars(&self) -> usize {
        N
    }
    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        for i in 0..N {
            out[i] = x[i].powi(3) + x[i] * 2.0 - T::from((i as f64 * 0.9).sin() * 2.0);
            if i > 0 {
                out[i] -= x[i - 1];
            }
            if i + 1 < N {
                out[i] -= x[i + 1];
            }
        }
    }
    fn pattern(&self) -> Pattern {
        let near = (0..N).flat_map(|i| (i.saturating_sub(1)..(i + 2).min(N)).map(move |j| (i, j)));
        Pattern::from_entries(N, N, near).unwrap()
    }
}

#[test]
fn dual_numbers_and_coloured_differences_agree() {
    let exact = Autodiff::new(Chain);
    let differenced =
        Differenced::new(N, |x: &[f64], out: &mut [f64]| Chain.eval(x, out)).with_pattern(Chain.pattern());
    assert_eq!(differenced.num_colors(), 3);
    let x: Vec<f64> = (0..N).map(|i| (i as f64).cos()).collect();
    let (mut a, mut b) = (Matrix::zeros(Chain.pattern()), Matrix::zeros(Chain.pattern()));
    exact.jacobian(&x, &mut a);
    differenced.jacobian(&x, &mut b);
    for (a, b) in a.values().iter().zip(b.values()) {
        assert!((a - b).abs() < 1e-8);
    }
    assert!(check_jacobian(&exact, &x, 1e-7).unwrap().largest_error < 1e-7);

    let bounds = || (vec![0.0; N], vec![0.8; N]);
    let first = Mcp::new(exact, bounds().0, bounds().1).unwrap();
    let second = Mcp::new(differenced, bounds().0, bounds().1).unwrap();
    let (x, report) = solve(&first, &vec![0.5; N]);
    let (y, other) = solve(&second, &vec![0.5; N]);
    assert!(report.is_solved() && other.is_solved());
    for (x, y) in x.iter().zip(&y) {
        assert!((x - y).abs() < 1e-9);
    }
}

#[test]
fn differences_respect_bounds_and_domains() {
    let f = Differenced::new(1, |x: &[f64], out: &mut [f64]| out[0] = x[0].sqrt() + x[0] - 1.0)
        .with_bounds(vec![0.0], vec![1.0])
        .unwrap();
    let mut jac = Matrix::zeros(Pattern::full(1, 1));
    f.jacobian(&[1.0], &mut jac);
    assert!((jac.get(0, 0) - 1.5).abs() < 1e-4);
    jac.clear();
    f.jacobian(&[0.0], &mut jac);
    assert!(jac.get(0, 0).is_finite() && jac.get(0, 0) > 100.0);
    // Where the only admissible side lies outside the domain, no derivative is made up.
    let nowhere = |x: &[f64], out: &mut [f64]| out[0] = if x[0] == 0.0 { 1.0 } else { f64::NAN };
    for bounds in [(0.0, 1.0), (-1.0, 0.0)] {
        let f = Differenced::new(1, nowhere)
            .with_bounds(vec![bounds.0], vec![bounds.1])
            .unwrap();
        jac.clear();
        f.jacobian(&[0.0], &mut jac);
        assert!(jac.get(0, 0).is_nan(), "{bounds:?}");
    }
}

#[test]
fn wrong_derivatives_are_found() {
    let wrong = WithJacobian::new(
        2,
        |x: &[f64], out: &mut [f64]| {
            out[0] = x[0] * x[1];
            out[1] = x[1].exp();
        },
        |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, x[1]);
            jac.add(0, 1, x[0] + 1e-3);
            jac.add(1, 1, x[1].exp());
        },
    );
    let error = check_jacobian(&wrong, &[1.0, 2.0], 1e-5).unwrap_err();
    assert!(
        matches!(
            error,
            ComplementarityError::WrongDerivative { row: 0, col: 1, .. }
        ),
        "{error}"
    );
}

/// Hock and Schittkowski 71: minimise x₀x₃(x₀ + x₁ + x₂) + x₂, x₀x₁x₂x₃ ≥ 25, ‖x‖² = 40, 1 ≤ x ≤ 5.
struct Hs71;

impl Program for Hs71 {
    fn num_vars(&self) -> usize {
        4
    }
    fn num_constraints(&self) -> usize {
        2
    }
    fn gradient(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x[3] * (2.0 * x[0] + x[1] + x[2]);
        out[1] = x[0] * x[3];
        out[2] = x[0] * x[3] + 1.0;
        out[3] = x[0] * (x[0] + x[1] + x[2]);
    }
    fn constraints(&self, x: &[f64], out: &mut [f64]) {
        out[0] = x.iter().product::<f64>() - 25.0;
        out[1] = x.iter().map(|v| v * v).sum::<f64>() - 40.0;
    }
    fn constraint_jacobian(&self, x: &[f64], jac: &mut Matrix) {
        for j in 0..4 {
            let others: f64 = (0..4).filter(|k| *k != j).map(|k| x[k]).product();
            jac.add(0, j, others);
            jac.add(1, j, 2.0 * x[j]);
        }
    }
    fn hessian(&self, x: &[f64], y: &[f64], h: &mut Matrix) {
        h.add(0, 0, 2.0 * x[3]);
        for (i, j, v) in [
            (0, 1, x[3]),
            (0, 2, x[3]),
            (0, 3, 2.0 * x[0] + x[1] + x[2]),
            (1, 3, x[0]),
            (2, 3, x[0]),
        ] {
            h.add(i, j, v);
            h.add(j, i, v);
        }
        for i in 0..4 {
            h.add(i, i, -2.0 * y[1]);
            for j in 0..4 {
                if i != j {
                    let others: f64 = (0..4).filter(|k| *k != i && *k != j).map(|k| x[k]).product();
                    h.add(i, j, -y[0] * others);
                }
            }
        }
    }
}

#[test]
fn first_order_conditions_of_a_program() {
    let kinds = [ConstraintKind::Nonnegative, ConstraintKind::Zero];
    let problem = kkt(Hs71, &kinds, vec![1.0; 4], vec![5.0; 4]).unwrap();
    check_jacobian(problem.function(), &[1.2, 4.0, 3.0, 1.5, 0.3, -0.2], 1e-6).unwrap();
    let mut x = [1.0, 5.0, 5.0, 1.0, 0.0, 0.0];
    let mut solver = McpSolver::default();
    assert!(solver.solve(&problem, &mut x).unwrap().is_solved());
    assert!(residual(&problem, &x) < 1e-9);
    // The optimum of the literature: f = 17.0140173.
    let f = x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2];
    assert!((f - 17.014_017_3).abs() < 1e-6, "{x:?}");
    assert!(matches!(
        kkt(Hs71, &kinds[..1], vec![1.0; 4], vec![INF; 4]),
        Err(ComplementarityError::Input(InputError::Length {
            expected: 2,
            found: 1,
            ..
        }))
    ));
}

/// Of several wrong entries the largest error is reported, wherever it is.
#[test]
fn the_worst_entry_of_a_jacobian_is_reported() {
    for worst in 0..3 {
        let wrong = WithJacobian::new(
            3,
            |x: &[f64], out: &mut [f64]| out.copy_from_slice(x),
            move |_: &[f64], jac: &mut Matrix| {
                for i in 0..3 {
                    jac.add(i, i, if i == worst { 1.1 } else { 1.01 });
                }
            },
        );
        let check = check_jacobian(&wrong, &[0.5, 0.25, 2.0], 1.0).unwrap();
        assert_eq!(check.entry, (worst, worst));
        // Relative to 1 + the larger one.
        assert!((check.largest_error - 0.1 / 2.1).abs() < 1e-6);
    }
}

/// A value that is NaN at every x says nothing about the pattern.
#[test]
fn values_that_are_no_numbers_are_no_lacking_entries() {
    let value = |x: &[f64], out: &mut [f64]| {
        out[0] = x[0] - 1.0;
        out[1] = f64::NAN;
    };
    let pattern = Pattern::from_entries(2, 2, [(0, 0), (1, 1)]).unwrap();
    let function = Differenced::new(2, value).with_pattern(pattern);
    let mut jac = Matrix::zeros(function.pattern());
    function.jacobian(&[0.5, 0.5], &mut jac);
    assert_eq!(jac.stray(), None);
    assert!((jac.get(0, 0) - 1.0).abs() < 1e-9);
}
