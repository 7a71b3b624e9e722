//! Laws with a history: friction that falls with the accumulated slip, however the load path is divided into levels.

use std::ops::ControlFlow;

use semismooth::contact::{
    Arrival, CondensedContact, Contact, ContactBody, EvolutionOptions, EvolutionStep, FrictionCoefficient,
    FrictionCurve, FullContact, LoadPath, NodeLaw, OrthotropicCoulomb, PlanarCoulomb, evolve,
};
use semismooth::interface::View;
use semismooth::sparse::Matrix;

fn weakening() -> FrictionCoefficient {
    FrictionCoefficient::uniform(FrictionCurve::exponential(0.5, 0.3, 0.1).unwrap())
}

/// F(ξ) of `weakening`, and its integral from 0.
fn friction(xi: f64) -> f64 {
    0.3 + 0.2 * (-10.0 * xi).exp()
}

fn dissipation(xi: f64) -> f64 {
    0.3 * xi + 0.02 * (1.0 - (-10.0 * xi).exp())
}

/// A node on a normal spring of stiffness 1 and tangential springs of stiffness 3, above the slope of friction (2); pressed by 1 and pulled
/// over a plane by 3 α along t₁.
fn body(tangents: usize) -> ContactBody {
    let n = 1 + tangents;
    let row = |k: usize| Matrix::from_triplets(1, n, &[(0, k, 1.0)]).unwrap();
    let mut a = Matrix::identity(n);
    a.values_mut()[1..].fill(3.0);
    let (mut press, mut pull) = (vec![0.0; n], vec![0.0; n]);
    (press[0], pull[1]) = (1.0, 3.0);
    let tangential = (1..n).map(row).collect();
    ContactBody::new(a, row(0), tangential, LoadPath::affine(press, pull)).unwrap()
}

fn run<V: View, L: NodeLaw>(problem: &mut Contact<V, L>, levels: &[f64]) -> Vec<EvolutionStep> {
    let start = problem.solve(0.0, None).unwrap();
    evolve(problem, &start, levels, &EvolutionOptions::default(), |_| {
        ControlFlow::Continue(())
    })
    .unwrap()
}

fn levels(n: usize) -> Vec<f64> {
    (1..=n).map(|k| k as f64 / n as f64).collect()
}

/// u with 3 u + F(u) = 3 α, by bisection.
fn slip(alpha: f64) -> f64 {
    let (mut low, mut high) = (0.0, alpha);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if 3.0 * middle + friction(middle) < 3.0 * alpha {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// The end of a pull, and the energy along it, do not depend on the number of levels.
fn check_pull<V: View, L: NodeLaw>(problem: impl Fn() -> Contact<V, L>) {
    let exact = slip(1.0);
    for n in [1, 10, 1000] {
        let history = run(&mut problem(), &levels(n));
        let end = history.last().unwrap();
        let node = &end.solution.nodes[0];
        let u = end.displacements[1];
        assert!((u - exact).abs() < 1e-9, "{n} levels: {u} {exact}");
        assert!((node.traction[0] - friction(exact)).abs() < 1e-9);
        assert!((end.history[0] - exact).abs() < 1e-9, "{:?}", end.history);
        let sum = |f: &dyn Fn(&EvolutionStep) -> f64| history.iter().map(f).sum::<f64>();
        let (work, stored, dissipated) = (sum(&|s| s.work), sum(&|s| s.stored), sum(&|s| s.dissipated));
        assert!(
            history
                .iter()
                .all(|s| s.arrival.is_followed() && s.dissipated >= -1e-15)
        );
        assert!((work - stored - dissipated).abs() < 1e-10 * work, "{n} levels");
        let area = dissipation(exact);
        assert!(
            (dissipated - area).abs() < 5e-3 * area,
            "{n}: {dissipated} {area}"
        );
    }
}

#[test]
fn the_number_of_levels_does_not_count() {
    let plane = || PlanarCoulomb::new(weakening());
    check_pull(|| CondensedContact::new(body(1), plane()).unwrap());
    check_pull(|| FullContact::new(body(1), plane()).unwrap());
    let space = || OrthotropicCoulomb::isotropic(weakening());
    check_pull(|| CondensedContact::new(body(2), space()).unwrap());
}

/// On a spring softer than friction falls, the node leaves stick at a fold, from which the branch runs back to a second one. The level is
/// reached along this branch, but a body does not follow it: it jumps.
#[test]
fn a_level_behind_folds_is_not_followed() {
    let a = Matrix::identity(2);
    let row = |k: usize| Matrix::from_triplets(1, 2, &[(0, k, 1.0)]).unwrap();
    let load = LoadPath::affine(vec![1.0, 0.0], vec![0.0, 2.0]);
    let body = ContactBody::new(a, row(0), vec![row(1)], load).unwrap();
    let mut problem = CondensedContact::new(body, PlanarCoulomb::new(weakening())).unwrap();
    let history = run(&mut problem, &[1.0]);
    assert!(matches!(history[0].arrival, Arrival::PassedFolds));
    // F (0) / 2, and the smallest α with u + F(u) = 2 α, where F' = −1.
    let slow = 0.1 * 2.0f64.ln();
    let expected = [0.25, 0.5 * (slow + friction(slow))];
    assert_eq!(history[0].folds.len(), 2);
    for (fold, expected) in history[0].folds.iter().zip(expected) {
        assert!((fold - expected).abs() < 1e-9, "{fold} {expected}");
    }
    let u = history[0].displacements[1];
    assert!((u + friction(u) - 2.0).abs() < 1e-9);
}

/// The slip of the initial solution counts, too: a history begun midway goes on as one begun before.
#[test]
fn the_slip_of_the_start_counts() {
    fn check<V: View, L: NodeLaw>(problem: impl Fn() -> Contact<V, L>) {
        let whole = run(&mut problem(), &[0.7, 0.72, 1.0]);
        let mut later = problem();
        let start = later.solve(0.7, None).unwrap();
        let rest = evolve(
            &mut later,
            &start,
            &[0.72, 1.0],
            &EvolutionOptions::default(),
            |_| ControlFlow::Continue(()),
        )
        .unwrap();
        for (a, b) in rest.iter().zip(&whole[1..]) {
            let u = a.displacements[1];
            assert!((u - slip(a.level)).abs() < 1e-9, "{u} {}", slip(a.level));
            assert!((a.history[0] - u).abs() < 1e-9, "{:?}", a.history);
            assert!((a.work - b.work).abs() < 1e-9 && (a.dissipated - b.dissipated).abs() < 1e-9);
        }
    }
    check(|| CondensedContact::new(body(1), PlanarCoulomb::new(weakening())).unwrap());
    check(|| FullContact::new(body(2), OrthotropicCoulomb::isotropic(weakening())).unwrap());
}

/// Back and forth: slip accumulates whatever its direction.
#[test]
fn slip_to_and_fro_adds_up() {
    let way: Vec<f64> = [1.0, -1.0, 1.0]
        .iter()
        .scan(0.0, |from: &mut f64, to| {
            let begin = std::mem::replace(from, *to);
            Some((1..=20).map(move |k| begin + (to - begin) * f64::from(k) / 20.0))
        })
        .flatten()
        .collect();
    let mut problem = CondensedContact::new(body(1), PlanarCoulomb::new(weakening())).unwrap();
    let history = run(&mut problem, &way);
    let (mut path, mut last) = (0.0, 0.0);
    for s in &history {
        path += (s.displacements[1] - last).abs();
        last = s.displacements[1];
        let node = &s.solution.nodes[0];
        assert!((s.history[0] - path).abs() < 1e-10);
        assert!(node.traction[0].abs() < friction(path) + 1e-9);
        if node.slip[0].abs() > 1e-9 {
            assert!((node.traction[0].abs() - friction(path)).abs() < 1e-9);
        }
    }
    assert!(path > 3.0 * last.abs());
}

/// A history goes on from the data of its last step, and the law forgets its history on request.
#[test]
fn a_history_is_taken_up_again() {
    let problem = || CondensedContact::new(body(1), PlanarCoulomb::new(weakening())).unwrap();
    let whole = run(&mut problem(), &levels(10));
    let mut later = problem();
    later.set_history(&whole[4].history).unwrap();
    later.set_reference_slip(&whole[4].displacements[1..]).unwrap();
    let rest = evolve(
        &mut later,
        &whole[4].x,
        &levels(10)[5..],
        &EvolutionOptions::default(),
        |_| ControlFlow::Continue(()),
    )
    .unwrap();
    for (a, b) in rest.iter().zip(&whole[5..]) {
        assert_eq!(a, b);
    }
    assert!(later.set_history(&[0.0; 2]).is_err() && later.set_history(&[f64::NAN]).is_err());
    // Increments of each level, by option: friction is that of the last increment alone.
    let mut problem = problem();
    let start = problem.solve(0.0, None).unwrap();
    let options = EvolutionOptions::default().with_slip_increments(true);
    let forgetful = evolve(&mut problem, &start, &levels(10), &options, |_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let node = &forgetful[9].solution.nodes[0];
    assert!((node.traction[0] - friction(node.slip[0])).abs() < 1e-9);
    assert!(node.traction[0] > whole[9].solution.nodes[0].traction[0] + 0.01);
}

/// The history of a law counts at any scale in which Newton's method works.
#[test]
fn a_history_counts_under_any_augmentation_parameter() {
    let problem = || CondensedContact::new(body(1), PlanarCoulomb::new(weakening())).unwrap();
    for worn in [0.0, 0.05, 0.3] {
        let mut plain = problem();
        plain.set_history(&[worn]).unwrap();
        let exact = plain.solve(1.0, None).unwrap();
        let traction = plain.solution(&exact).unwrap().nodes[0].traction[0];
        let slip = plain.solution(&exact).unwrap().nodes[0].slip[0];
        assert!((traction - friction(worn + slip)).abs() < 1e-9);
        for r in [0.1, 0.7, 5.0] {
            let mut other = problem().with_r(r).unwrap();
            other.set_history(&[worn]).unwrap();
            let x = other.solve(1.0, None).unwrap();
            assert!(x.iter().zip(&exact).all(|(a, b)| (a - b).abs() < 1e-9), "r = {r}");
        }
    }
}
