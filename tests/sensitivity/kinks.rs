//! Kinks: one-sided derivatives, elements of the generalised derivative, kinks that cancel, folds.

use semismooth::complementarity::Lcp;
use semismooth::parametric;
use semismooth::sensitivity::{
    DerivativeDoubt, Differentiability, Directional, Sensitivity, SensitivityError,
};
use semismooth::sparse::Matrix;

use super::random::Random;

/// max(p, 0) + min(p, 0) = p: both kinks are met, and the selections that are met nearby have one derivative.
#[test]
fn kinks_that_cancel_are_differentiable() {
    let map = parametric(1, 1, |x, p| vec![x[0] - p[0].max(0.0) - p[0].min(0.0)]);
    let mut found = Sensitivity::new(map, &[0.0], &[0.0]).unwrap();
    assert!(matches!(
        found.differentiable().unwrap(),
        Differentiability::Yes { margin: 0.0 }
    ));
    assert_eq!(found.derivative().unwrap().get(0, 0), 1.0);
    assert_eq!(found.vjp(&[2.0]).unwrap(), [2.0]);
}

/// A kink in an unknown that the parameter does not move is none of the solution.
#[test]
fn kinks_that_a_parameter_does_not_feel_are_differentiable_in_it() {
    let map = || {
        parametric(2, 2, |x, p| {
            vec![x[0] - 2.0 * p[0], 3.0 * x[1] + x[1].abs() - p[1]]
        })
    };
    let mut found = Sensitivity::new(map(), &[2.0, 0.0], &[1.0, 0.0]).unwrap();
    assert_eq!(found.differentiable().unwrap().known(), Some(false));
    assert_eq!(found.jvp(&[1.0, 0.0]).unwrap(), [2.0, 0.0]);
    assert_eq!(found.jvp(&[0.0, 1.0]).unwrap(), [0.0, 0.25]);
    assert_eq!(found.jvp(&[0.0, -1.0]).unwrap(), [0.0, -0.5]);
    assert_eq!(found.derivative(), Err(SensitivityError::NotDifferentiable));

    let fixed = parametric(2, 1, |x, p| vec![x[0] - 2.0 * p[0], 3.0 * x[1] + x[1].abs()]);
    let mut found = Sensitivity::new(fixed, &[2.0, 0.0], &[1.0]).unwrap();
    assert_eq!(found.differentiable().unwrap().known(), Some(true));
}

/// |x| = p: two solutions for p > 0 and none for p < 0. x³ = p has none of the form x = a p + o(p).
#[test]
fn folds_are_not_called_differentiable() {
    let fold = parametric(1, 1, |x, p| vec![x[0].abs() - p[0]]);
    let mut found = Sensitivity::new(fold, &[0.0], &[0.0]).unwrap();
    assert!(matches!(
        found.differentiable().unwrap(),
        Differentiability::Undecided(DerivativeDoubt::NotUnique(_))
    ));
    let Directional::Branches {
        mut branches,
        complete,
    } = found.directional(&[1.0]).unwrap()
    else {
        panic!("one function");
    };
    branches.sort_by(|a, b| a[0].total_cmp(&b[0]));
    assert_eq!((branches, complete), (vec![vec![-1.0], vec![1.0]], true));
    let back = found.directional(&[-1.0]).unwrap();
    assert_eq!(
        back,
        Directional::Branches {
            branches: Vec::new(),
            complete: true
        }
    );
    assert!(matches!(
        found.jvp(&[1.0]),
        Err(SensitivityError::NotUnique { .. })
    ));
    assert!(matches!(
        found.vjp(&[1.0]),
        Err(SensitivityError::NotUnique { .. })
    ));

    let cubic = parametric(1, 1, |x, p| vec![x[0].powi(3) - p[0]]);
    let error = Sensitivity::new(cubic, &[0.0], &[0.0]).unwrap_err();
    assert!(
        matches!(error, SensitivityError::Irregular { singular_value: Some(s), .. } if s == 0.0),
        "{error}"
    );
}

/// The lexicographic derivative along a frame (m₁, m₂, …) is the derivative at θ + ε m₁ + ε² m₂ + …, where
/// the solution is smooth.
#[test]
fn elements_are_derivatives_at_points_nearby() {
    for seed in 0..40 {
        let random = &mut Random::new(seed);
        let n = 3;
        let mut rows = random.square(n);
        (0..n).for_each(|i| rows[i][i] += 4.0);
        let matrix = Matrix::from_rows(&rows).unwrap();
        // z = 0 = w.
        let lcp = Lcp::new(matrix, vec![0.0; n]).unwrap();
        let map = lcp.in_constants(&Matrix::identity(n)).unwrap();
        let kink = Sensitivity::new(&map, &vec![0.0; n], &vec![0.0; n]).unwrap();
        // The first directions are special ones, so that the later ones decide.
        let mut frame = random.square(n);
        frame[0] = vec![1.0, 0.0, -1.0];
        frame[1] = vec![0.0, random.symmetric(), 1.0];
        let mut element = kink.element(&frame).unwrap();

        let near: Vec<f64> = (0..n)
            .map(|i| (0..n).map(|j| 1e-4_f64.powi(j as i32) * frame[j][i]).sum())
            .collect();
        let mut z = vec![0.0; n];
        let problem = map.at_parameters(&near).unwrap();
        let report = semismooth::complementarity::McpSolver::default()
            .solve(&problem, &mut z)
            .unwrap()
            .clone();
        assert!(report.is_solved());
        let mut smooth = Sensitivity::new(&map, &z, &near).unwrap();
        let (found, expected) = (element.matrix().unwrap(), smooth.derivative().unwrap());
        for (i, j, v) in expected.triplets() {
            assert!((found.get(i, j) - v).abs() < 1e-12, "seed {seed}");
        }
        // Products with the transpose are those of the same matrix.
        let w = random.vector(n, 1.0);
        let mut product = vec![0.0; n];
        expected.mul_transpose_vec(&w, &mut product);
        let vjp = element.vjp(&w).unwrap();
        assert!(
            vjp.iter().zip(&product).all(|(a, b)| (a - b).abs() < 1e-12),
            "seed {seed}"
        );
    }
}

/// The answer does not depend on the units of rows, unknowns and parameters.
#[test]
fn units_do_not_matter() {
    for power in [-8, 0, 8] {
        let s = 10_f64.powi(power);
        // y = max(p, 2 p) in units of 1/s, its row in units of s², beside one in units of 1.
        let map = parametric(2, 2, |x, p| {
            vec![
                s * s * (s * x[0] - p[0].max(2.0 * p[0])),
                x[1] - 3.0 * p[1] - s * x[0],
            ]
        });
        let mut found = Sensitivity::new(map, &[0.0, 3.0], &[0.0, 1.0]).unwrap();
        assert_eq!(found.differentiable().unwrap().known(), Some(false), "10^{power}");
        let v = found.jvp(&[-1.0, 1.0]).unwrap();
        assert!(
            (s * v[0] + 1.0).abs() < 1e-12 && (v[1] - 2.0).abs() < 1e-12,
            "{v:?}"
        );
    }
}

/// A solution that a solver found to 1e-9 is at the kink that its exact counterpart is at; one that is 1e-7
/// away from a kink is not.
#[test]
fn kinks_are_told_from_points_near_them() {
    let map = || parametric(1, 1, |x, p| vec![2.0 * x[0] + x[0].abs() + x[0].powi(3) - p[0]]);
    let mut found = Sensitivity::new(map(), &[1e-9], &[0.0]).unwrap();
    assert_eq!(found.x(), [0.0]);
    assert_eq!(found.differentiable().unwrap().known(), Some(false));
    let mut found = Sensitivity::new(map(), &[0.0], &[2e-7]).unwrap();
    assert_eq!(found.differentiable().unwrap().known(), Some(true));
    assert!((found.jvp(&[1.0]).unwrap()[0] - 1.0 / 3.0).abs() < 1e-10);
}

/// Forty components at their kinks, 2⁴⁰ selections: z(δ) of a definite matrix at z = w = 0 solves the problem of δ
/// itself, and the branch found by pivots is that of the solver.
#[test]
fn many_kinks_are_solved_by_pivots() {
    let n = 40;
    let random = &mut Random::new(7);
    let mut rows = random.square(n);
    (0..n).for_each(|i| rows[i][i] += 20.0);
    let matrix = Matrix::from_rows(&rows).unwrap();
    let lcp = Lcp::new(matrix.clone(), vec![0.0; n]).unwrap();
    let map = lcp.in_constants(&Matrix::identity(n)).unwrap();
    let mut found = Sensitivity::new(map, &vec![0.0; n], &vec![0.0; n]).unwrap();
    let delta = random.vector(n, 1.0);
    let Directional::Branches { branches, complete } = found.directional(&delta).unwrap() else {
        panic!("uniqueness is certified by all selections alone");
    };
    let exact = semismooth::solve_lcp(matrix, &delta).unwrap().x;
    assert!(complete && branches.len() == 1);
    assert!(exact.iter().zip(&branches[0]).all(|(a, b)| (a - b).abs() < 1e-11));
}

/// Kinks of F count as well as those of the bounds: 0 ≤ x ⟂ 2 x + |x − 1| − p ≥ 0 at x = 1, p = 2.
#[test]
fn kinks_of_the_function_of_a_complementarity_problem_count() {
    let free = [f64::INFINITY];
    let map = semismooth::parametric_mcp(
        1,
        |x, p| vec![2.0 * x[0] + (x[0] - 1.0).abs() - p[0]],
        &[0.0],
        &free,
    )
    .unwrap();
    let mut found = Sensitivity::new(map, &[1.0], &[2.0]).unwrap();
    assert_eq!(found.differentiable().unwrap().known(), Some(false));
    assert!((found.jvp(&[1.0]).unwrap()[0] - 1.0 / 3.0).abs() < 1e-14);
    assert!((found.jvp(&[-1.0]).unwrap()[0] + 1.0).abs() < 1e-14);
    assert!(semismooth::parametric_mcp(1, |x, p| vec![x[0] - p[0]], &[1.0], &[0.0]).is_err());
    assert!(semismooth::parametric_mcp(1, |x, p| vec![x[0], p[0]], &[1.0], &free).is_err());
}

/// 0.3 − 0.1 − 0.2 is rounding, −3e-17: a kink in a parameter alone, which no unknown's rounding hides.
#[test]
fn rounding_of_parameters_counts() {
    let map = parametric(1, 1, |x, p| vec![x[0] - (p[0] - 0.1 - 0.2).max(0.0)]);
    let mut found = Sensitivity::new(map, &[0.0], &[0.3]).unwrap();
    assert_eq!(found.differentiable().unwrap().known(), Some(false));
    assert!((found.jvp(&[1.0]).unwrap()[0] - 1.0).abs() < 1e-15);
    assert_eq!(found.jvp(&[-1.0]).unwrap(), [0.0]);
}
