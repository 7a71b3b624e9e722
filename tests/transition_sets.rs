//! Transition sets of the model with one contact node (Hild and Renard 2005), against the analytic lines.

use semismooth::contact::{FrictionFamily, FrictionPath, FrictionProblem, LoadPath};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination, TransitionSet};
use semismooth::piecewise::PiecewiseSmooth;
use semismooth::piecewise::check::CheckOptions;
use semismooth::sparse::Matrix;

fn node(load: LoadPath, friction: FrictionPath) -> FrictionProblem {
    FrictionProblem::new(
        Matrix::from_rows(&[[2.0, -1.0], [-1.0, 2.0]]).unwrap(),
        Matrix::from_rows(&[[1.0, 0.0]]).unwrap(),
        Matrix::from_rows(&[[0.0, 1.0]]).unwrap(),
        load,
        friction,
    )
    .unwrap()
}

/// x = (u_ν, u_t, λ_ν, λ_t, f_ν, f_t) at constant F.
fn load_plane(friction: f64) -> FrictionFamily {
    let load = LoadPath::affine(vec![0.0, 0.0], vec![1.0, 0.0]);
    let problem = node(load, FrictionPath::constant(vec![friction]));
    FrictionFamily::new(problem, vec![0.0, 1.0], vec![0.0]).unwrap()
}

/// x = (u_ν, u_t, λ_ν, λ_t, F, f_t) at f_ν = 1.5.
fn friction_plane() -> FrictionFamily {
    let problem = node(
        LoadPath::constant(vec![1.5, 0.0]),
        FrictionPath::affine(vec![0.0], vec![1.0]),
    );
    FrictionFamily::new(problem, vec![0.0, 1.0], vec![0.0]).unwrap()
}

fn follow<P: PiecewiseSmooth>(set: &TransitionSet<P>, x: &[f64], range: (f64, f64)) -> Branch {
    let options = ContinuationOptions::default()
        .with_parameter_range(range)
        .with_max_step(0.1);
    Branch::follow(set, x, Direction::Increasing, options).unwrap()
}

#[test]
fn families_and_their_sets_keep_the_contract() {
    let samples: Vec<Vec<f64>> = (0..60)
        .map(|k| {
            (0..6)
                .map(|j| (f64::from(k * 7 + j * 13) * 0.37).sin() * 2.0 + if j >= 4 { 2.5 } else { 0.0 })
                .collect()
        })
        .collect();
    for family in [load_plane(1.5), friction_plane()] {
        semismooth::piecewise::check::check(&family, &samples, &CheckOptions::default()).unwrap();
    }
}

#[test]
fn stick_and_slip_meet_where_the_traction_is_the_bound() {
    for friction in [1.0, 3.0] {
        let set = TransitionSet::new(load_plane(friction), 0, 2).unwrap();
        let line = follow(
            &set,
            &[0.0, 0.0, 2.0, -2.0 * friction, 2.0, -2.0 * friction],
            (-1e3, 5.0),
        );
        // The line ends at the apex f = 0, where all test functions vanish.
        assert_eq!(line.termination, Termination::End);
        assert!(line.transitions[0].x.iter().all(|v| v.abs() < 1e-12));
        for point in &line.points {
            let (normal, tangential) = (point.x[4], point.x[5]);
            assert!((friction * normal - tangential.abs()).abs() < 1e-11);
        }
        // It is a line of folds where the slope of slip is negative: F > (λ+3μ)/(λ+μ) = 2.
        let p = &line.points[0];
        assert_eq!(set.is_fold(&p.selection, &p.x).unwrap(), Some(friction > 2.0));
    }
}

#[test]
fn contact_is_lost_on_the_line_of_bifurcations() {
    for friction in [1.0, 3.0] {
        let set = TransitionSet::new(load_plane(friction), 0, 0).unwrap();
        let line = follow(&set, &[0.0, -1.0, 0.0, 0.0, 1.0, -2.0], (-3.0, 2.0));
        assert_eq!(line.termination, Termination::ParameterRange);
        // One point of codimension two: the apex, between slip− and slip+.
        assert_eq!(line.transitions.len(), 1);
        assert!(line.transitions[0].x.iter().all(|v| v.abs() < 1e-12));
        for p in &line.points {
            let (normal, tangential) = (p.x[4], p.x[5]);
            assert!((4.0 * normal + 2.0 * tangential).abs() < 1e-11);
            let fold = set.is_fold(&p.selection, &p.x).unwrap();
            if normal.abs() > 1e-9 {
                assert_eq!(
                    fold,
                    Some(normal > 0.0 && friction > 2.0),
                    "{normal} {tangential}"
                );
            }
        }
    }
}

#[test]
fn lines_of_the_plane_of_friction_and_load() {
    let set = TransitionSet::new(friction_plane(), 0, 2).unwrap();
    let line = follow(&set, &[0.0, 0.0, 1.5, -6.0, 4.0, -6.0], (-7.0, -0.5));
    assert_eq!(line.termination, Termination::ParameterRange);
    for p in &line.points {
        let (friction, tangential) = (p.x[4], p.x[5]);
        assert!((1.5 * friction - tangential.abs()).abs() < 1e-11);
        if (friction - 2.0).abs() > 1e-6 {
            assert_eq!(set.is_fold(&p.selection, &p.x).unwrap(), Some(friction > 2.0));
        }
    }
    // The bifurcation stands at f_t = −(λ+3μ)/(λ+μ) f_ν = −3, whatever F.
    let set = TransitionSet::new(friction_plane(), 0, 0).unwrap();
    let along = Direction::Along(vec![0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let options = ContinuationOptions::default().with_max_arclength(5.0);
    let line = Branch::follow(&set, &[0.0, -1.5, 0.0, 0.0, 0.5, -3.0], along, options).unwrap();
    let last = &line.points.last().unwrap().x;
    assert!((last[4] - 5.5).abs() < 1e-9 && (last[5] + 3.0).abs() < 1e-12);
}
