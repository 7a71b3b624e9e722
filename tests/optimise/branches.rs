//! Solutions that are not unique: each branch is a problem of its own.

use std::ops::ControlFlow;

use semismooth::complementarity::Lcp;
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::optimise::{Bundle, OptimiseError};
use semismooth::run::Status;
use semismooth::sensitivity::SensitivityError;
use semismooth::sparse::Matrix;
use semismooth::variational::Polyhedron;
use semismooth::{Solution, SolveError, minimise};

/// 0 ≤ z ⟂ p − z ≥ 0 has the solutions 0 and, for p ≥ 0, also p: (z − 2)² is stationary anywhere on the first branch, and at p = 2 on the other.
fn from(z: f64, p: f64) -> Result<Solution<semismooth::optimise::BundleReport>, String> {
    let found = minimise(
        |z, _| (z[0] - 2.0).powi(2),
        |z, p| vec![p[0] - z[0]],
        [&[0.0], &[f64::INFINITY]],
        &Polyhedron::boxed(vec![0.0], vec![3.0]).unwrap(),
        (&[z], &[p]),
    );
    found.map_err(|e| match e {
        SolveError::Refused(OptimiseError::Start { source }) => {
            let inner = source.downcast_ref::<OptimiseError>();
            assert!(matches!(
                inner,
                Some(OptimiseError::Sensitivity(SensitivityError::NotUnique { .. }))
            ));
            source.to_string()
        }
        other => panic!("{other}"),
    })
}

#[test]
fn the_list_gives_the_starts() {
    let lcp = Lcp::new(Matrix::from_rows(&[[-1.0]]).unwrap(), vec![1.0]).unwrap();
    let list = all_solutions(lcp.mcp(), 0.0, &EnumerationOptions::default()).unwrap();
    assert!(list.completeness.is_complete());
    let mut values: Vec<f64> = list
        .solutions
        .iter()
        .map(|s| from(s.x[0], 1.0).unwrap().report.value)
        .collect();
    values.sort_by(f64::total_cmp);
    assert!(values[0].abs() < 1e-12 && values[1] == 4.0, "{values:?}");
    // Where the branches meet, at p = 0, there is no element of a generalised derivative, and the error says why.
    let text = from(0.0, 0.0).unwrap_err();
    assert!(text.contains("one function"), "{text}");
}

/// An observer of the solves may end one: the run ends with its best point, whose x solves the problem there.
/// f(p) = (x − 2)² + p with x = p/2.
#[test]
fn observers_of_solves_end_runs() {
    for most in 0..12 {
        let mut f = semismooth::implicit(
            |z, p| (z[0] - 2.0).powi(2) + p[0],
            |z, p| vec![z[0].powi(3) - (p[0] * 0.5).powi(3)],
            [&[0.5], &[f64::INFINITY]],
            &[1.0],
            1,
        )
        .unwrap();
        let mut left = 20 * most;
        let mut observe = |_: &semismooth::complementarity::McpIteration| match left {
            0 => ControlFlow::Break(()),
            _ => {
                left -= 1;
                ControlFlow::Continue(())
            }
        };
        let set = Polyhedron::boxed(vec![1.0], vec![9.0]).unwrap();
        let found = Bundle::default().minimise(&set, &[8.0], &mut f.observed(&mut observe));
        let (p, report) = match found {
            Ok(found) => found,
            Err(e) => {
                assert!(most == 0 && e.stopped() == Some(Status::Interrupted), "{e}");
                continue;
            }
        };
        assert!(
            report.is_solved() || report.status == Status::Interrupted,
            "{report}"
        );
        assert!((report.state[0] - 0.5 * p[0]).abs() < 1e-9);
        assert!((report.value - (report.state[0] - 2.0).powi(2) - p[0]).abs() < 1e-12);
        if report.is_solved() {
            // (p/2 − 2)² + p has its minimum at p = 2.
            assert!((p[0] - 2.0).abs() < 1e-3, "{p:?}");
        }
    }
}

/// A parameter that only the objective depends on, and one that only the problem does.
#[test]
fn parameters_of_the_objective_alone() {
    let found = minimise(
        |z, p| (z[0] - p[1]).abs() + (p[1] - 0.5).powi(2),
        |z, p| vec![2.0 * z[0] - p[0]],
        [&[0.0], &[f64::INFINITY]],
        &Polyhedron::boxed(vec![0.0; 2], vec![4.0; 2]).unwrap(),
        (&[1.0], &[3.0, 3.0]),
    )
    .unwrap();
    // The least value is 0, and f grows by the square of the distance in one direction.
    assert!(found.report.value < 1e-8, "{}", found.report);
    assert!((found.x[0] - 1.0).abs() < 1e-3 && (found.x[1] - 0.5).abs() < 1e-3);
    assert!((found.report.state[0] - 0.5 * found.x[0]).abs() < 1e-12);
}
