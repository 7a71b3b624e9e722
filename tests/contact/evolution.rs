//! Load histories: energy balance, shakedown to a loop, agreement of followed and solved steps.

use crate::maps::same_mechanics;
use crate::squares;
use std::ops::ControlFlow;
use std::time::Duration;

use semismooth::contact::{
    Arrival, CondensedContact, ContactBody, ContactError, ContactOptions, EvolutionOptions,
    EvolutionProgress, EvolutionStep, FrictionCoefficient, FrictionCurve, Frictionless, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb, ReducedBody, ReducedContact, ReducedOptions, evolve, evolve_observed,
};
use semismooth::continuation::{ContinuationOptions, Termination};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
use semismooth::interface::LoadPath;
use semismooth::newton::NewtonOptions;
use semismooth::sparse::Matrix;

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
            &EvolutionOptions::default(),
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
        // How each level was reached agrees with the folds on the way.
        for s in &history {
            match &s.arrival {
                Arrival::Followed => assert!(s.folds.is_empty()),
                Arrival::Jumped | Arrival::PassedFolds => assert!(!s.folds.is_empty()),
                _ => {}
            }
        }
        for s in &history {
            assert!(s.arrival.is_followed(), "{steps}: {:?}", s.arrival);
        }
    }
    // Every level was reached along the curve, so that work = stored + dissipated, however long the steps.
    assert!(defects.iter().all(|d| *d < 1e-11), "{defects:?}");
}

/// A branch limited to two points leaves the step to Newton's method, whose iterations are limited, too; neither limit changes the end of a
/// step without folds.
#[test]
fn limits_of_a_step() {
    let mut problem = squares::pushed_block(4, 0.4).unwrap();
    let start = problem.solve(0.0, None).unwrap();
    let mut follow = |options: &EvolutionOptions| {
        problem
            .set_reference_slip(&vec![0.0; problem.num_contacts()])
            .unwrap();
        evolve(&mut problem, &start, &[0.3, 0.6], options, |_| {
            ControlFlow::Continue(())
        })
    };
    let whole = follow(&EvolutionOptions::default()).unwrap();
    assert!(whole.iter().all(|s| s.arrival == Arrival::Followed));
    let short = ContinuationOptions::default().with_max_points(2).with_step(1e-3);
    let options = EvolutionOptions::default().with_continuation(short);
    let cut = follow(&options).unwrap();
    assert!(
        cut.iter()
            .all(|s| s.arrival == Arrival::Ended(Termination::PointLimit))
    );
    for (a, b) in whole.iter().zip(&cut) {
        let apart = a.x.iter().zip(&b.x).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-10);
    }
    let none = ContactOptions::default().with_max_time(Some(Duration::ZERO));
    let stopped =
        follow(&options.with_contact(none.with_newton(NewtonOptions::default().with_max_iterations(1))));
    assert!(stopped.unwrap_err().is_interrupted());
}

/// An observer stops on the branch to the second level, while its energies are summed, or in the search for a solution at the first, where
/// the branch and Newton's method are cut short; it is not called again, and the levels reached before are returned.
#[test]
fn observers_stop_between_levels() {
    let short = ContinuationOptions::default().with_max_points(2).with_step(1e-3);
    let one = ContactOptions::default().with_newton(NewtonOptions::default().with_max_iterations(1));
    let cut = EvolutionOptions::default()
        .with_continuation(short)
        .with_contact(one);
    for (searched, summed, options) in [
        (false, false, EvolutionOptions::default()),
        (false, true, EvolutionOptions::default()),
        (true, false, cut),
    ] {
        let mut problem = squares::pushed_block(4, 0.4).unwrap();
        let start = problem.solve(0.0, None).unwrap();
        let before: &[f64] = if searched { &[] } else { &[0.3] };
        let whole = evolve(&mut problem.clone(), &start, before, &options, |_| {
            ControlFlow::Continue(())
        });
        let (mut levels, mut stopped) = (0, false);
        let steps = evolve_observed(&mut problem, &start, &[0.3, 0.6], &options, |progress| {
            assert!(!stopped);
            match progress {
                EvolutionProgress::Step(_) => levels += 1,
                EvolutionProgress::Point(_) => stopped = levels == 1 && !searched && !summed,
                EvolutionProgress::Energy { .. } => stopped = levels == 1 && summed,
                EvolutionProgress::Search(_) => stopped = searched,
                _ => {}
            }
            if stopped {
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
        assert!(stopped);
        assert_eq!(steps, whole);
    }
}

/// Wherever an observer stops, it is not called again, and the levels before are those of the whole history; also at the last point of a
/// branch, where nothing is left to follow.
#[test]
fn observers_that_stop_see_nothing_more() {
    let problem = squares::pushed_block(2, 0.4).unwrap();
    let start = problem.solve(0.0, None).unwrap();
    let options = EvolutionOptions::default();
    let (mut events, mut starts) = (0, Vec::new());
    let whole = evolve_observed(&mut problem.clone(), &start, &[0.4, 0.1], &options, |progress| {
        match progress {
            EvolutionProgress::Start { level } => starts.push((events, *level)),
            _ => assert!(events > 0, "the search at the start comes first"),
        }
        events += 1;
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!((starts.len(), starts[0], starts[1].1), (2, (0, 0.4), 0.1));
    for last in 1..=events {
        let mut seen = 0;
        let steps = evolve_observed(&mut problem.clone(), &start, &[0.4, 0.1], &options, |_| {
            seen += 1;
            if seen == last {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })
        .unwrap();
        assert_eq!(seen, last, "of {events}");
        assert_eq!(steps, whole[..steps.len()]);
    }
}

/// Without friction nothing is dissipated or remembered: each state depends on its level alone.
#[test]
fn no_friction_no_memory() {
    let mut problem = squares::pushed_block(4, 0.0).unwrap();
    let start = problem.solve(0.0, None).unwrap();
    let history = evolve(
        &mut problem,
        &start,
        &[0.5, 1.0, 0.5, 0.0],
        &EvolutionOptions::default(),
        |_| ControlFlow::Continue(()),
    )
    .unwrap();
    assert!(history.iter().all(|s| s.dissipated.abs() < 1e-15));
    let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-12);
    assert!(same(&history[0].displacements, &history[2].displacements));
    assert!(same(&history[3].x, &start));
}

/// Frictionless, but declared to depend on the slip, without a history.
#[derive(Clone)]
struct Forgetful(Frictionless);

impl NodeLaw for Forgetful {
    same_mechanics!(0);
    fn depends_on_slip(&self) -> bool {
        true
    }
}

/// Increments of slip depend on the choice of levels, so that they have to be requested.
#[test]
fn slip_of_levels_is_refused() {
    let problem = squares::pushed_block(2, 0.4).unwrap();
    let mut problem = problem.with_law(Forgetful(Frictionless::plane())).unwrap();
    let start = problem.solve(0.0, None).unwrap();
    let mut run = |options: &EvolutionOptions| {
        evolve(&mut problem, &start, &[0.5, 1.0], options, |_| {
            ControlFlow::Continue(())
        })
    };
    assert_eq!(
        run(&EvolutionOptions::default()).unwrap_err(),
        ContactError::SlipOfLevels
    );
    assert!(run(&EvolutionOptions::default().with_slip_increments(true)).is_ok());
    let mesh = Mesh::rectangle([0.0; 2], [2.0, 1.0], [4, 2]).unwrap();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap()).fix("left");
    let system = system.discretize().unwrap();
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let load = LoadPath::constant(vec![0.0; system.num_free()]);
    let stiffness = system.nodal_stiffness().unwrap();
    let body = ReducedBody::new(stiffness, &rows.normal, &rows.tangential, load).unwrap();
    let law = Forgetful(Frictionless::plane());
    let mut problem = ReducedContact::new(body, law, ReducedOptions::default()).unwrap();
    let refused = problem.evolve(None, &[0.5, 1.0], |_| ControlFlow::Continue(()));
    assert_eq!(refused, Err(ContactError::SlipOfLevels));
}

/// A solid block fixed at its top, pressed 0.02 into the ground and moved by (0.007, 0.01) α.
fn solid(n: usize, friction: [f64; 2]) -> CondensedContact<OrthotropicCoulomb> {
    let mesh = Mesh::block([0.0; 3], [2.0, 2.0, 1.0], [n, n, n / 2]).unwrap();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| 0.0)
        .prescribe("top", 2, |_| -0.02)
        .assemble()
        .unwrap();
    let [x, y] = [(0, 0.007), (1, 0.01)].map(|(k, v)| system.motion("top", k, |_| v).unwrap());
    let load = LoadPath::affine(system.supports(), x.plus(y).unwrap());
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]))
        .unwrap();
    let tangential = rows.tangential;
    let body = ContactBody::new(system.stiffness().clone(), rows.normal, tangential, load)
        .unwrap()
        .with_gap(rows.gap)
        .unwrap();
    let [first, second] = friction.map(|f| FrictionCoefficient::constant(f).unwrap());
    CondensedContact::new(body, OrthotropicCoulomb::new(first, second)).unwrap()
}

/// At the beginning of a level each of 49 nodes that slipped may stick or go on slipping: of 2⁴⁹ choices one is right, and is found at
/// once.
#[test]
fn levels_after_those_at_which_a_solid_slipped() {
    let levels = [0.5, 1.0, 0.5, 0.0, -1.0];
    for friction in [[0.2, 0.1], [0.9, 0.05], [0.3, 0.3]] {
        let mut problem = solid(6, friction);
        let start = problem.solve(0.0, None).unwrap();
        let limited = ContinuationOptions::default()
            .with_max_points(1000)
            .with_max_time(Some(Duration::from_secs(60)));
        let options = EvolutionOptions::default().with_continuation(limited);
        let steps = evolve(&mut problem, &start, &levels, &options, |_| {
            ControlFlow::Continue(())
        })
        .unwrap();
        let mut slipped = 0;
        for s in &steps {
            assert_eq!(s.arrival, Arrival::Followed, "{friction:?}, {}", s.level);
            let balance = s.work - s.stored - s.dissipated;
            assert!(balance.abs() < 1e-12 * s.solution.energy.stored, "{balance:e}");
            assert!(s.dissipated > -1e-12 * s.solution.energy.stored);
            slipped = slipped.max(s.solution.slip());
        }
        assert!(slipped > 25, "{slipped}");
        let slips = steps.iter().map(|s| s.transitions).sum::<usize>();
        assert!(slips > 20, "{slips}");
    }
}

/// A node on springs of stiffness 1 under the pressure 1 + α²/2, whose slip within one level is 0.3 (α − 0.1) (0.9 − α): it turns at 0.5.
fn turning() -> CondensedContact<PlanarCoulomb> {
    const F: f64 = 0.4;
    let row = |k: usize| Matrix::from_triplets(1, 2, &[(0, k, 1.0)]).unwrap();
    let load = LoadPath::cases(
        vec![1.0, F],
        [vec![0.5, 0.5 * F], vec![0.0, 0.3]],
        |alpha, a, da| {
            (a[0], da[0]) = (alpha * alpha, 2.0 * alpha);
            (a[1], da[1]) = ((alpha - 0.1) * (0.9 - alpha), 1.0 - 2.0 * alpha);
        },
    );
    let body = ContactBody::new(Matrix::identity(2), row(0), vec![row(1)], load).unwrap();
    let law = PlanarCoulomb::new(FrictionCoefficient::constant(F).unwrap());
    CondensedContact::new(body, law).unwrap()
}

/// Within one level the node slides back with the friction force; from level to level it sticks where the motion turns.
#[test]
fn returned_work_within_a_level_is_reported() {
    let run = |n: u32| {
        let mut problem = turning();
        let start = problem.solve(0.0, None).unwrap();
        let levels: Vec<f64> = (1..=n).map(|k| f64::from(k) / f64::from(n)).collect();
        let short = ContinuationOptions::default().with_max_step(0.002);
        let options = EvolutionOptions::default().with_continuation(short);
        let steps = evolve(&mut problem, &start, &levels, &options, |_| {
            ControlFlow::Continue(())
        })
        .unwrap();
        for s in &steps {
            assert!(s.arrival.is_followed());
            assert!((s.work - s.stored - s.dissipated).abs() < 1e-14);
            assert!(s.returned >= 0.0 && s.dissipated >= -s.returned);
        }
        let sum = |f: fn(&semismooth::contact::EvolutionStep) -> f64| steps.iter().map(f).sum::<f64>();
        (sum(|s| s.dissipated), sum(|s| s.returned))
    };
    // ∫ F λν dδ = 0.12 ∫ (1 + α²/2) (1 − 2α) dα from 0.1 to 0.9, its part from 0.5 on, and its part up to 0.5: the dissipation if the node
    // sticks at the turn.
    let primitive = |a: f64| 0.12 * (a - a * a + a.powi(3) / 6.0 - a.powi(4) / 4.0);
    let (whole, back) = (primitive(0.9) - primitive(0.1), primitive(0.5) - primitive(0.9));
    let right = primitive(0.5) - primitive(0.1);
    let (dissipated, returned) = run(1);
    assert!(
        whole < 0.0 && (dissipated - whole).abs() < 2e-7,
        "{dissipated} {whole}"
    );
    assert!((returned - back).abs() < 2e-7, "{returned} {back}");
    // The turn is smooth: second order.
    let errors = [5, 15, 45].map(|n| {
        let (dissipated, returned) = run(n);
        assert!(returned > 0.0);
        [(dissipated - right).abs(), returned]
    });
    for pair in errors.windows(2) {
        for k in 0..2 {
            let ratio = pair[0][k] / pair[1][k];
            assert!((7.0..11.0).contains(&ratio), "{errors:?}");
        }
    }
}

/// A repeated level has no branch to follow, and nothing happens there.
#[test]
fn a_level_that_comes_again_is_not_followed() {
    let mut problem = squares::pushed_block(4, 0.4).unwrap();
    let start = problem.solve(0.0, None).unwrap();
    let steps = evolve(
        &mut problem,
        &start,
        &[0.0, 0.7, 0.7, 1.0],
        &EvolutionOptions::default(),
        |_| ControlFlow::Continue(()),
    )
    .unwrap();
    use Arrival::{Followed, SameLevel};
    let arrivals: Vec<_> = steps.iter().map(|s| s.arrival.clone()).collect();
    assert_eq!(arrivals, [SameLevel, Followed, SameLevel, Followed]);
    for (again, before) in [(&steps[0].x, &start), (&steps[2].x, &steps[1].x)] {
        assert!(again.iter().zip(before).all(|(a, b)| (a - b).abs() < 1e-12));
    }
    for s in [&steps[0], &steps[2]] {
        assert!([s.work, s.stored, s.dissipated].iter().all(|e| e.abs() < 1e-15));
    }
}

/// A coefficient of friction that falls from 0.6 to 0.2 within a slip far below that of a level: the block slips at once. Few levels end where
/// many do, dissipate as much, and none of them gains energy from friction.
#[test]
fn levels_longer_than_the_slip_that_weakens_agree_with_short_ones() {
    for length in [1e-3, 1e-6, 1e-9] {
        let weakening = FrictionCurve::exponential(0.6, 0.2, length).unwrap();
        let law = PlanarCoulomb::new(FrictionCoefficient::uniform(weakening));
        let run = |levels: usize| {
            let mut problem = squares::moved_block(4, 0.4)
                .unwrap()
                .with_law(law.clone())
                .unwrap();
            let start = problem.solve(0.0, None).unwrap();
            let list: Vec<f64> = (1..=levels).map(|k| 2.0 * k as f64 / levels as f64).collect();
            let options = EvolutionOptions::default();
            evolve(&mut problem, &start, &list, &options, |_| {
                ControlFlow::Continue(())
            })
            .unwrap()
        };
        let fine = run(200);
        let dissipated = |steps: &[EvolutionStep]| steps.iter().map(|s| s.dissipated).sum::<f64>();
        for levels in [1, 2, 5, 10, 50] {
            let coarse = run(levels);
            for (k, step) in coarse.iter().enumerate() {
                let reference = &fine[(k + 1) * fine.len() / levels - 1];
                let size = reference
                    .solution
                    .nodes
                    .iter()
                    .fold(0.0f64, |m, v| m.max(v.pressure));
                for (a, b) in step.solution.nodes.iter().zip(&reference.solution.nodes) {
                    let apart = (a.pressure - b.pressure)
                        .abs()
                        .max((a.traction[0] - b.traction[0]).abs());
                    assert!(
                        apart <= 1e-9 * size,
                        "{length:e}, level {} of {levels}: {apart:e} of {size:e}, {}",
                        k + 1,
                        step.arrival
                    );
                }
                assert!(step.dissipated >= -1e-15 && step.returned <= 1e-15);
            }
            let (few, many) = (dissipated(&coarse), dissipated(&fine));
            assert!(
                (few - many).abs() <= 1e-3 * many,
                "{length:e}, {levels}: {few} {many}"
            );
        }
    }
}
