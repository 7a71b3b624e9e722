use semismooth::complementarity::{Mcp, McpFunction, McpReport, McpSolver, WithJacobian};
use semismooth::sparse::Matrix;

pub(crate) const INF: f64 = f64::INFINITY;

/// The natural residual, by its definition: max |x − mid(l, u, x − F)|.
pub(crate) fn residual<F: McpFunction>(problem: &Mcp<F>, x: &[f64]) -> f64 {
    let mut f = vec![0.0; x.len()];
    problem.function().value(x, &mut f);
    let mut largest = 0.0_f64;
    for i in 0..x.len() {
        let mid = (x[i] - f[i]).max(problem.lower()[i]).min(problem.upper()[i]);
        let r = (x[i] - mid).abs();
        assert!(!r.is_nan(), "component {i} is {} at {x:?}", f[i]);
        largest = largest.max(r);
    }
    largest
}

/// Solves and checks what every reported success promises.
pub(crate) fn solve<F: McpFunction>(problem: &Mcp<F>, start: &[f64]) -> (Vec<f64>, McpReport) {
    let mut x = start.to_vec();
    let report = McpSolver::default().solve(problem, &mut x).unwrap().clone();
    if report.is_solved() {
        assert!(residual(problem, &x) <= 1e-9, "claimed at {x:?}");
        for i in 0..x.len() {
            assert!(problem.lower()[i] <= x[i] && x[i] <= problem.upper()[i]);
        }
        assert_eq!(report.feasibility, 0.0);
    }
    (x, report)
}

/// A function of one variable with its derivative.
#[allow(clippy::type_complexity)] // closures have no names
pub(crate) fn scalar(
    f: impl Fn(f64) -> f64,
    derivative: impl Fn(f64) -> f64,
) -> WithJacobian<impl Fn(&[f64], &mut [f64]), impl Fn(&[f64], &mut Matrix)> {
    WithJacobian::new(
        1,
        move |x: &[f64], out: &mut [f64]| out[0] = f(x[0]),
        move |x: &[f64], jac: &mut Matrix| jac.add(0, 0, derivative(x[0])),
    )
}

pub(crate) fn matrix(rows: &[Vec<f64>]) -> Matrix {
    Matrix::from_rows(rows).unwrap()
}
