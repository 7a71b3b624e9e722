//! Friction identified from displacements, and a shape that evens out contact stresses.

#[path = "../../examples/common/design.rs"]
mod design;

use design::{Identification, Shape};
use semismooth::sparse::Matrix;
use semismooth::variational::Polyhedron;

use crate::random::Random;

const TRUE: [f64; 3] = [0.2, 0.45, 0.3];

fn observed(problem: &mut Identification, friction: &[f64]) {
    problem.data = problem
        .response(friction)
        .unwrap()
        .into_iter()
        .map(|(_, _, seen)| seen)
        .collect();
}

fn largest(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Central differences of order four of a function of s at 0.
fn difference(f: impl Fn(f64) -> f64, s: f64) -> f64 {
    (8.0 * (f(s) - f(-s)) - (f(2.0 * s) - f(-2.0 * s))) / (12.0 * s)
}

#[test]
fn gradients_of_both_designs() {
    let mut problem = Identification::new([12, 6], 3).unwrap();
    observed(&mut problem, &TRUE);
    let (at, mut g) = ([0.3, 0.3, 0.4], [0.0; 3]);
    problem.misfit(&at, &mut g).unwrap();
    let shape = Shape::new([8, 4], 3).unwrap();
    let (heights, mut h) = ([0.004, 0.01, 0.02], [0.0; 3]);
    shape.unevenness(&heights, &mut h).unwrap();
    for k in 0..3 {
        let moved = |mut at: [f64; 3], s: f64| {
            at[k] += s;
            at
        };
        let misfit = |s| problem.misfit(&moved(at, s), &mut [0.0; 3]).unwrap();
        let uneven = |s| shape.unevenness(&moved(heights, s), &mut [0.0; 3]).unwrap();
        assert!(
            (g[k] - difference(misfit, 1e-3)).abs() < 1e-9 * largest(&g),
            "{k}"
        );
        assert!(
            (h[k] - difference(uneven, 1e-5)).abs() < 1e-7 * largest(&h),
            "{k}"
        );
    }
}

/// One coefficient from exact displacements comes back; so do three, as far as the displacements depend on them.
#[test]
fn friction_from_exact_displacements() {
    let mut one = Identification::new([12, 6], 1).unwrap();
    observed(&mut one, &[0.35]);
    let (found, report) = one.identify(&[0.1]).unwrap();
    assert!(
        report.is_solved() && (found[0] - 0.35).abs() < 1e-6,
        "{found:?} {report}"
    );
    let mut three = Identification::new([12, 6], 3).unwrap();
    observed(&mut three, &TRUE);
    let (found, report) = three.identify(&[0.5; 3]).unwrap();
    assert!(report.is_solved(), "{report}");
    assert!(
        found.iter().zip(TRUE).all(|(f, t)| (f - t).abs() < 5e-3),
        "{found:?}"
    );
}

/// With errors the coefficients fit better than the true ones, and are off by what linear regression says.
#[test]
fn friction_from_displacements_with_errors() {
    let mut problem = Identification::new([12, 6], 3).unwrap();
    observed(&mut problem, &TRUE);
    let (random, size) = (&mut Random::new(11), largest(&problem.data[1]));
    let noise: Vec<Vec<f64>> = problem
        .data
        .iter()
        .map(|d| random.vector(d.len(), 1e-4 * size))
        .collect();
    for (data, noise) in problem.data.iter_mut().zip(&noise) {
        data.iter_mut().zip(noise).for_each(|(d, n)| *d += n);
    }
    let (found, report) = problem.identify(&[0.5; 3]).unwrap();
    let of_true = problem.misfit(&TRUE, &mut [0.0; 3]).unwrap();
    assert!(
        report.is_solved() && report.value <= of_true,
        "{report} {of_true}"
    );
    // J by differences, then (JᵀJ)⁻¹ Jᵀ n.
    let noise: Vec<f64> = noise.concat();
    let columns: Vec<Vec<f64>> = (0..3)
        .map(|k| {
            let seen = |s: f64| {
                let mut at = TRUE;
                at[k] += s;
                let levels = problem.response(&at).unwrap().into_iter();
                levels.flat_map(|(_, _, seen)| seen).collect::<Vec<f64>>()
            };
            let (a, b) = (seen(1e-4), seen(-1e-4));
            a.iter().zip(&b).map(|(a, b)| (a - b) / 2e-4).collect()
        })
        .collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let normal: Vec<[f64; 3]> = (0..3)
        .map(|i| [0, 1, 2].map(|j| dot(&columns[i], &columns[j])))
        .collect();
    let right: Vec<f64> = columns.iter().map(|c| -dot(c, &noise)).collect();
    let predicted = semismooth::solve_qp(
        Matrix::from_rows(&normal).unwrap(),
        &right,
        Polyhedron::space(3).unwrap(),
    )
    .unwrap()
    .x;
    let off: Vec<f64> = found.iter().zip(TRUE).map(|(f, t)| f - t).collect();
    let apart: Vec<f64> = off.iter().zip(&predicted).map(|(a, b)| a - b).collect();
    println!("{off:?} {predicted:?} {report} {of_true}");
    assert!(
        largest(&apart) < 0.2 * largest(&predicted),
        "{off:?} {predicted:?}"
    );
}

/// The contact stresses of the block with the best shape are less uneven by the same part on three meshes, and the shapes agree.
#[test]
fn one_shape_on_three_meshes() {
    let found = [[8, 4], [16, 8], [32, 16]].map(|cells| {
        let (first, best, report) = Shape::new(cells, 5).unwrap().equalise(5, 0.1).unwrap();
        assert!(report.is_solved(), "{cells:?}: {report}");
        (report.value / first, best)
    });
    for (ratio, heights) in &found {
        assert!((ratio - 0.69).abs() < 0.01, "{ratio}");
        let apart: Vec<f64> = heights.iter().zip(&found[2].1).map(|(a, b)| a - b).collect();
        assert!(largest(&apart) < 0.02 * 0.1, "{heights:?}");
    }
}
