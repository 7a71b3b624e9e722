//! Curves whose Jacobians are nearly singular throughout: points are accurate to fewer digits than are stored, and this must not cost more
//! steps.

use super::maps::two_pieces;
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination};
use semismooth::piecewise::{PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

/// Order of the Hilbert matrix B, whose condition number is 5·10⁸.
const ORDER: usize = 7;
const KINKS: usize = 20;

/// B (y − α² e) + Σ_k max(y_j − l_k, 0) B e = 0 with e = (1, …, 1), j = k modulo the order: all y are equal, α² = y + Σ_k max(y − l_k, 0).
struct Hilbert;

fn entry(i: usize, j: usize) -> f64 {
    1.0 / (1 + i + j) as f64
}

fn row_sum(i: usize) -> f64 {
    (0..ORDER).map(|j| entry(i, j)).sum()
}

fn level(k: usize) -> f64 {
    0.1 * (k + 1) as f64
}

impl PiecewiseSmooth for Hilbert {
    two_pieces!(self, [negative, positive], ORDER + 1, ORDER, KINKS);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        for (k, theta) in out.iter_mut().enumerate() {
            *theta = x[k % ORDER] - level(k);
        }
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let alpha = x[ORDER];
        for (i, r) in out.iter_mut().enumerate() {
            let plain: f64 = (0..ORDER).map(|j| entry(i, j) * (x[j] - alpha * alpha)).sum();
            let above = (0..KINKS).filter(|&k| s.piece(k) == 1);
            let kinks: f64 = above.map(|k| x[k % ORDER] - level(k)).sum();
            *r = plain + kinks * row_sum(i);
        }
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        for i in 0..ORDER {
            (0..ORDER).for_each(|j| jac.add(i, j, entry(i, j)));
            for k in (0..KINKS).filter(|&k| s.piece(k) == 1) {
                jac.add(i, k % ORDER, row_sum(i));
            }
            jac.add(i, ORDER, -2.0 * x[ORDER] * row_sum(i));
        }
    }
}

#[test]
fn factors_are_reused_where_corrections_are_rounding() {
    let start = [vec![0.01; ORDER], vec![0.1]].concat();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 5.0));
    let branch = Branch::follow(&Hilbert, &start, Direction::Increasing, options).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    assert_eq!(branch.transitions.len(), KINKS);
    for (k, t) in branch.transitions.iter().enumerate() {
        let exact = level(k) + (0..k).map(|i| level(k) - level(i)).sum::<f64>();
        let alpha = t.x[ORDER];
        assert!((alpha * alpha - exact).abs() < 1e-5, "{k}: {alpha}");
    }
    // Three or four for the step to a transition, one or two each for the facet, the tangent there and the arms.
    let events = KINKS + branch.points.len();
    assert!(
        branch.factorisations <= 10 * events,
        "{} factorisations for {events} events",
        branch.factorisations
    );
}
