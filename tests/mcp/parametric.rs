//! MCPs with a parameter, followed through changes of the active set and folds.

use semismooth::complementarity::{AffineFunction, Mcp, McpFunction, McpSolver, WithJacobian};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, TransitionKind};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::sparse::Matrix;

use crate::support::{INF, matrix, residual};

/// 0 ≤ x ⟂ x² − 2x + α ≥ 0: x = 0 for α ≥ 0, and a parabola of solutions with a smooth fold at (1, 1) that meets x = 0 at α = 0.
fn fold() -> Mcp<impl McpFunction> {
    Mcp::ncp(WithJacobian::parametric(
        1,
        |x: &[f64], out: &mut [f64]| out[0] = x[0] * x[0] - 2.0 * x[0] + x[1],
        |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, 2.0 * x[0] - 2.0);
            jac.add(0, 1, 1.0);
        },
    ))
    .unwrap()
}

#[test]
fn a_curve_passes_a_smooth_and_a_nonsmooth_fold() {
    let options = ContinuationOptions::default().with_parameter_range((-3.0, 3.0));
    let branch = Branch::follow(&fold(), &[3.0, -3.0], Direction::Increasing, options).unwrap();
    // Up the parabola to (1, 1), back to (0, 0), where x reaches its bound, and up again along x = 0.
    assert_eq!(branch.smooth_folds.len(), 1);
    assert!((branch.smooth_folds[0].parameter() - 1.0).abs() < 1e-9);
    assert_eq!(branch.transitions.len(), 1);
    assert_eq!(branch.transitions[0].kind, TransitionKind::Fold);
    assert!(branch.transitions[0].parameter().abs() < 1e-12);
    let last = branch.points.last().unwrap();
    assert!((last.parameter() - 3.0).abs() < 1e-12 && last.x[0] == 0.0);
}

#[test]
fn the_problem_at_a_parameter_agrees_with_the_curve() {
    let problem = fold();
    let options = ContinuationOptions::default().with_parameter_range((-3.0, 3.0));
    let branch = Branch::follow(&problem, &[3.0, -3.0], Direction::Increasing, options).unwrap();
    for point in branch.points.iter().step_by(3) {
        let at = problem.at(point.parameter()).unwrap();
        assert!(residual(&at, &point.x[..1]) < 1e-9);
        let mut x = [point.x[0] + 1e-6];
        assert!(McpSolver::default().solve(&at, &mut x).unwrap().is_solved());
    }
    // Each evaluation is independent of the previous ones.
    let at = problem.at(0.5).unwrap();
    for _ in 0..2 {
        let mut jac = Matrix::zeros(at.jacobian_pattern().clone());
        at.function().jacobian(&[3.0], &mut jac);
        assert_eq!(jac.get(0, 0), 4.0);
    }
    assert!(problem.at(f64::NAN).is_err());
    assert!(problem.at(0.0).unwrap().at(0.0).is_err());
    assert!(McpSolver::default().solve(&problem, &mut [0.0, 0.0]).is_err());
}

/// 0 ≤ x ⟂ M x + q + α c ≥ 0 in another unit: the same points to the last bit, and the same lists.
#[test]
fn units_of_affine_problems_change_nothing() {
    let rows = [
        vec![2.0, -1.0, 0.0, 1.0],
        vec![1.0, 1.0, -2.0, 0.5],
        vec![0.0, 1.0, 1.0, -1.0],
    ];
    let problem = |unit: f64| {
        let scaled: Vec<Vec<f64>> = rows
            .iter()
            .map(|r| [r[..3].to_vec(), vec![unit * r[3]]].concat())
            .collect();
        let q = vec![-unit, 0.5 * unit, 0.25 * unit];
        let function = AffineFunction::new(matrix(&scaled), q).unwrap();
        Mcp::ncp(function).unwrap()
    };
    let follow = |unit: f64| {
        let map = problem(unit);
        let list = all_solutions(&map, -2.0, &EnumerationOptions::default()).unwrap();
        let x = &list.solutions[0].x;
        let options = ContinuationOptions::default().with_parameter_range((-2.0, 3.0));
        let branch = Branch::follow(&map, x, Direction::Increasing, options).unwrap();
        (list.solutions.len(), branch)
    };
    let (count, plain) = follow(1.0);
    assert!(plain.transitions.len() > 1);
    // One factorisation: at each kink one row is updated, that of the component that changes.
    assert!(plain.factorisations <= 2 && plain.updates >= plain.transitions.len());
    for unit in [(-40.0_f64).exp2(), 50.0_f64.exp2()] {
        let (number, branch) = follow(unit);
        assert_eq!((number, branch.termination), (count, plain.termination));
        assert_eq!(branch.points.len(), plain.points.len());
        for (p, q) in branch.points.iter().zip(&plain.points) {
            let back: Vec<f64> = p.x[..3].iter().map(|x| x / unit).collect();
            assert_eq!((&back[..], p.x[3], p.arclength), (&q.x[..3], q.x[3], q.arclength));
        }
        let kinds = |b: &Branch| b.transitions.iter().map(|t| (t.kind, t.x[3])).collect::<Vec<_>>();
        assert_eq!(kinds(&branch), kinds(&plain));
    }
}

#[test]
fn all_equilibria_of_a_coordination_game() {
    // Payoffs diag(1, α) for both: two pure equilibria and a mixed one for α > 0. As an LCP: x, y ≥ 0 with costs K − payoff.
    let k = 3.0;
    let rows = |alpha: f64| {
        let c = [[k - 1.0, k], [k, k - alpha]];
        let mut m = vec![vec![0.0; 5]; 4];
        for i in 0..2 {
            for j in 0..2 {
                m[i][2 + j] = c[i][j];
                m[2 + j][i] = c[i][j];
            }
        }
        m
    };
    let f = AffineFunction::new(matrix(&rows(2.0)), vec![-1.0; 4]).unwrap();
    let problem = Mcp::ncp(f).unwrap();
    let set = all_solutions(&problem, 0.0, &EnumerationOptions::default()).unwrap();
    assert!(set.completeness.is_complete());
    assert_eq!(set.solutions.len(), 3);
    for s in &set.solutions {
        assert!(residual(&problem.at(0.0).unwrap(), &s.x[..4]) < 1e-9);
    }
    assert_eq!(problem.upper(), [INF; 4]);
}
