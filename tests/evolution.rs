//! Histories of loading: energy balance, shakedown to a loop, agreement of followed and solved steps.

use std::ops::ControlFlow;

use semismooth::contact::{Arrival, evolve};

#[path = "../examples/common/squares.rs"]
mod squares;

fn levels(steps: usize) -> Vec<f64> {
    let corners = [0.0, 1.0, -1.0, 1.0, -1.0];
    corners
        .windows(2)
        .flat_map(|w| {
            let (a, b) = (w[0], w[1]);
            (1..=steps).map(move |k| a + (b - a) * k as f64 / steps as f64)
        })
        .collect()
}

#[test]
fn energy_and_loop() {
    let mut defects = Vec::new();
    for steps in [4, 8, 16] {
        let mut problem = squares::pushed_block(4, 0.4).unwrap();
        let p = problem.num_contacts();
        let start = problem.solve(0.0, None).unwrap();
        let history = evolve(
            &mut problem,
            &start,
            &levels(steps),
            |_| ControlFlow::Continue(()),
        )
        .unwrap();
        assert_eq!(history.len(), 4 * steps);
        assert!(history.iter().all(|s| s.dissipated >= -1e-15));
        let sum = |f: &dyn Fn(&semismooth::contact::EvolutionStep) -> f64| history.iter().map(f).sum::<f64>();
        let dissipated = sum(&|s| s.dissipated);
        assert!(dissipated > 1e-8, "{dissipated}");
        defects.push((sum(&|s| s.work) - sum(&|s| s.stored) - dissipated).abs() / dissipated);
        // The second cycle repeats the first from the first reversal on.
        let cycle = 2 * steps;
        for k in steps..2 * steps {
            let (a, b) = (&history[k].displacements, &history[k + cycle].displacements);
            let mean = |v: &[f64]| v[p..].iter().sum::<f64>();
            assert!((mean(a) - mean(b)).abs() < 0.05 * mean(a).abs().max(1e-3));
        }
        // How each level was reached agrees with the folds seen on the way.
        for s in &history {
            match &s.arrival {
                Arrival::Followed => assert!(s.folds.is_empty()),
                Arrival::Jumped | Arrival::PassedFolds => assert!(!s.folds.is_empty()),
                _ => {}
            }
        }
        assert!(history.iter().filter(|s| s.arrival.is_followed()).count() * 2 > history.len());
    }
    // The rate of the defect is at least first order in the step.
    assert!(
        defects[2] < 0.6 * defects[1] && defects[1] < 0.6 * defects[0],
        "{defects:?}"
    );
}

/// Without friction there is nothing to dissipate or to remember: levels alone decide.
#[test]
fn no_friction_no_memory() {
    let mut problem = squares::pushed_block(4, 0.0).unwrap();
    let start = problem.solve(0.0, None).unwrap();
    let history = evolve(&mut problem, &start, &[0.5, 1.0, 0.5, 0.0], |_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    assert!(history.iter().all(|s| s.dissipated.abs() < 1e-15));
    let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
    assert!(same(&history[0].displacements, &history[2].displacements));
    assert!(same(&history[3].x, &start));
}
