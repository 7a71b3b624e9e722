//! Away from kinks: differences, the adjoint, and what is refused.

use semismooth::InputError;
use semismooth::piecewise::{Expression, MinMap};
use semismooth::sensitivity::{DerivativeDoubt, Differentiability, Loaded, Sensitivity, SensitivityError};
use semismooth::sparse::Matrix;
use semismooth::{parametric, parametric_mcp};

use super::dot;
use super::random::Random;

/// Derivatives of an equilibrium with bounds are those of differences, and products with the transpose those
/// of products with the matrix.
#[test]
fn derivatives_are_differences_and_the_adjoint_is_exact() {
    fn market<'a>(x: &[Expression<'a>], p: &[Expression<'a>]) -> Vec<Expression<'a>> {
        vec![
            x[0].exp() - p[0] + 0.3 * x[1] * x[2],
            x[1] * x[1] + p[1] * x[0] - 2.0 * p[0] + x[2],
            x[2] + 1.0 + x[0] * p[1],
        ]
    }
    let (lower, upper) = ([0.0; 3], [f64::INFINITY, 2.0, f64::INFINITY]);
    let map = parametric_mcp(2, market, &lower, &upper).unwrap();
    let solve = |p: &[f64]| {
        semismooth::solve_mcp(
            |x| market(x, &[p[0].into(), p[1].into()]),
            &lower,
            &upper,
            &[0.5; 3],
        )
        .unwrap()
        .x
    };
    let p = [3.0, 0.7];
    let x = solve(&p);
    let mut found = Sensitivity::new(&map, &x, &p).unwrap();
    assert_eq!(found.differentiable().unwrap().known(), Some(true));
    let derivative = found.derivative().unwrap();
    for j in 0..2 {
        let step = 1e-5;
        let at = |s: f64| {
            let mut q = p;
            q[j] += s;
            solve(&q)
        };
        let (ahead, behind) = (at(step), at(-step));
        for i in 0..3 {
            let difference = (ahead[i] - behind[i]) / (2.0 * step);
            assert!((derivative.get(i, j) - difference).abs() < 1e-7);
        }
    }
    let random = &mut Random::new(1);
    for _ in 0..10 {
        let (w, delta) = (random.vector(3, 1.0), random.vector(2, 1.0));
        let forward = dot(&found.jvp(&delta).unwrap(), &w);
        let adjoint = dot(&found.vjp(&w).unwrap(), &delta);
        assert!((forward - adjoint).abs() < 1e-14);
    }
}

/// A large sparse problem: the obstacle problem −u″ = θ₁ + θ₂ t, u ≥ 0, whose contact set does not change
/// with small changes; its derivative solves the same equation where u > 0.
#[test]
fn large_sparse_problems_are_differentiated_on_sparse_factors() {
    let n = 2000;
    let h = 1.0 / (n as f64 + 1.0);
    let map = parametric(n, 2, |x, p| {
        let u = |i: usize| x[i];
        (0..n)
            .map(|i| {
                let mut bend = 2.0 * u(i);
                if i > 0 {
                    bend -= u(i - 1);
                }
                if i + 1 < n {
                    bend -= u(i + 1);
                }
                bend - h * h * (p[0] + p[1] * ((i + 1) as f64 * h))
            })
            .collect()
    });
    let exact = |t: f64, p: [f64; 2]| p[0] * t * (1.0 - t) / 2.0 + p[1] * t * (1.0 - t * t) / 6.0;
    let p = [1.0, 2.0];
    let t = |i: usize| (i + 1) as f64 * h;
    // The differences are exact for cubic functions.
    let x: Vec<f64> = (0..n).map(|i| exact(t(i), p)).collect();
    let mut found = Sensitivity::new(map, &x, &p).unwrap();
    let v = found.jvp(&[0.5, -1.0]).unwrap();
    for i in 0..n {
        assert!((v[i] - exact(t(i), [0.5, -1.0])).abs() < 1e-9);
    }
}

/// What is no solution, has no parameters or no derivative is refused by an error that says so.
#[test]
fn errors_name_what_is_wrong() {
    let root = || parametric(1, 1, |x, p| vec![x[0] * x[0] - p[0]]);
    assert!(matches!(
        Sensitivity::new(root(), &[3.0], &[4.0]),
        Err(SensitivityError::NoSolution { variable: 0, .. })
    ));
    let silent = parametric(1, 2, |x, p| vec![x[0] * x[0] - p[0]]);
    assert_eq!(
        Sensitivity::new(silent, &[2.0], &[4.0, 1.0]).unwrap_err(),
        SensitivityError::NotEntering { parameter: 1 }
    );
    let plain = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0];
        b[0] = 2.0 * x[0];
    });
    assert!(matches!(
        Sensitivity::new(&plain, &[0.0], &[]),
        Err(SensitivityError::NoParameters {
            vars: 1,
            residuals: 1
        })
    ));
    assert!(Loaded::new(&plain, Matrix::identity(2)).is_err());
    let steep = parametric(1, 1, |x, p| vec![x[0] - p[0].sqrt()]);
    assert!(matches!(
        Sensitivity::new(steep, &[0.0], &[0.0]),
        Err(SensitivityError::Input(InputError::NotFinite { .. }))
    ));
    let mut found = Sensitivity::new(root(), &[2.0], &[4.0]).unwrap();
    assert!(found.jvp(&[1.0, 1.0]).is_err() && found.vjp(&[f64::NAN]).is_err());
    let singular = found.element(&[[0.0]]).unwrap_err();
    assert_eq!(singular, SensitivityError::Frame { expected: 1 });
}

/// x₀ + x₁ = θ and x₀ + (1 + ε) x₁ = θ: regular, but for small ε rounding of the coefficients may decide that.
#[test]
fn nearly_singular_derivatives_are_doubted() {
    for (epsilon, known) in [(1e-3, Some(true)), (1e-8, Some(true)), (1e-13, None)] {
        let map = parametric(2, 1, |x, p| {
            vec![x[0] + x[1] - p[0], x[0] + (1.0 + epsilon) * x[1] - p[0]]
        });
        let found = Sensitivity::new(map, &[1.0, 0.0], &[1.0])
            .unwrap()
            .differentiable()
            .unwrap();
        assert_eq!(found.known(), known, "{epsilon:e}: {found}");
        let doubted = matches!(
            found,
            Differentiability::Undecided(DerivativeDoubt::IllConditioned { .. })
        );
        assert_eq!(doubted, known.is_none());
    }
}

/// Points that are no solutions are refused whatever the units of parameters: x² = 10⁻¹¹ θ at θ = 2.1·10¹¹ has the solution √2.1, and
/// neither 5 nor 1.45 is near enough.
#[test]
fn large_parameters_do_not_hide_wrong_points() {
    let map = || parametric(1, 1, |x, p| vec![x[0] * x[0] - 1e-11 * p[0]]);
    for wrong in [5.0, 1.45] {
        assert!(matches!(
            Sensitivity::new(map(), &[wrong], &[2.1e11]),
            Err(SensitivityError::NoSolution { variable: 0, .. })
        ));
    }
    let root = 2.1f64.sqrt();
    let mut found = Sensitivity::new(map(), &[root + 1e-8], &[2.1e11]).unwrap();
    assert!((found.x()[0] - root).abs() < 1e-15);
    let slope = found.jvp(&[1e11]).unwrap()[0];
    assert!((slope - 0.5 / root).abs() < 1e-14);
}

/// A point that is off by 1e-6 is corrected until rounding, and the margin is that of the nearest of two kinks.
#[test]
fn points_are_corrected_and_the_nearest_kink_counts() {
    let root = parametric(1, 1, |x, p| vec![x[0] * x[0] - p[0]]);
    let found = Sensitivity::new(root, &[1.0 + 1e-6], &[1.0]).unwrap();
    assert!((found.x()[0] - 1.0).abs() < 1e-15, "{}", found.x()[0]);

    let margin = |far: f64| {
        let map = parametric(1, 1, move |x, p| vec![x[0] - p[0].max(-1.0) - p[0].max(far)]);
        let mut found = Sensitivity::new(map, &[1.0], &[0.5]).unwrap();
        match found.differentiable().unwrap() {
            Differentiability::Yes { margin } => margin,
            other => panic!("{other}"),
        }
    };
    // The tests are 1.5 and 1000.5; what rounding may hide is the same.
    let [near, both] = [-1.0, -1000.0].map(margin);
    assert!(
        both >= near / 4.0 && both <= 4.0 * near && near.is_finite(),
        "{near} {both}"
    );
}

/// Of a point that is no solution the error tells how far off it is, in which unknown, and by which residual: 4 (x₁ − θ) at x₁ = θ − 2.
#[test]
fn errors_tell_how_far_off_points_are() {
    let map = parametric(2, 1, |x, p| vec![x[0] - p[0], 4.0 * (x[1] - p[0])]);
    let Err(SensitivityError::NoSolution {
        variable,
        distance,
        residual,
    }) = Sensitivity::new(map, &[3.0, 1.0], &[3.0])
    else {
        panic!("a solution");
    };
    assert_eq!((variable, distance, residual), (1, 2.0, 8.0));
}
