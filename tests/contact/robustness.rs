//! Every contact problem with a positive definite matrix and a continuous law has a solution, which must be found whatever the body, the
//! law and the augmentation parameter. Solutions are checked against the conditions themselves, without the crate's residuals.

mod bodies;

use std::collections::BTreeSet;
use std::ops::ControlFlow;
use std::time::Duration;

use crate::random::Random;
use bodies::{Body, curve};
use proptest::prelude::*;
use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, ContactOptions, ContactProgress, ContactReport,
    ContactStrategy, FrictionCoefficient, FrictionCurve, Frictionless, FullContact, GivenBound, LoadPath,
    NodeLaw, OrthotropicCoulomb, PlanarCoulomb,
};
use semismooth::newton::{NewtonError, NewtonOptions};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

/// Largest violation of equilibrium, Signorini's conditions, the cone of friction and maximal dissipation, relative to the largest force
/// and displacement. `bounds` are those of given friction.
fn violation(
    b: &Body,
    u: &[f64],
    forces: &[f64],
    friction: &dyn Fn(f64) -> [f64; 2],
    bounds: Option<&[f64]>,
) -> f64 {
    let p = b.gap.len();
    let largest = |v: &[f64]| v.iter().fold(0.0f64, |m, x| m.max(x.abs()));
    let mut residual: Vec<f64> = b.load.iter().map(|f| -f).collect();
    let mut force = largest(&b.load).max(largest(forces));
    for (i, j, a) in b.body.stiffness().triplets() {
        residual[i] += a * u[j];
        force = force.max((a * u[j]).abs());
    }
    let mut moved = vec![[0.0; 3]; p];
    for (d, trace) in b.traces.iter().enumerate() {
        for (i, j, t) in trace.triplets() {
            residual[j] += t * forces[d * p + i];
            moved[i][d] += t * u[j];
        }
    }
    let compliance = 1.0 / largest(b.body.stiffness().values());
    let length = largest(u).max(largest(&b.gap)).max(force * compliance);
    let mut worst = largest(&residual) / force;
    for (i, [normal, ut @ ..]) in moved.into_iter().enumerate() {
        let (open, pressure) = ((b.gap[i] - normal) / length, forces[i] / force);
        worst = worst.max(-open).max(-pressure).max(open.min(pressure));
        let traction = [1, 2].map(|d| forces.get(d * p + i).copied().unwrap_or(0.0) / force);
        let f = friction(ut[0].hypot(ut[1]));
        let bound = bounds.map_or(pressure, |g| g[i] / force);
        let s = [0, 1].map(|d| traction[d] / f[d]);
        let w = [0, 1].map(|d| f[d] * ut[d] / length);
        let excess = f[0].min(f[1]) * (s[0].hypot(s[1]) - bound);
        let lost = bound * w[0].hypot(w[1]) - s[0] * w[0] - s[1] * w[1];
        worst = worst.max(excess).max(lost.abs());
    }
    worst
}

/// Solves both forms with r times `factor`; returns the strategies that succeeded.
fn both<L: NodeLaw + Clone>(
    b: &Body,
    options: &ContactOptions,
    law: &L,
    factor: f64,
    friction: &dyn Fn(f64) -> [f64; 2],
    bounds: Option<&[f64]>,
) -> [ContactStrategy; 2] {
    let q = b.gap.len() * b.traces.len();
    let ignore = |_: &ContactProgress| ControlFlow::Continue(());
    let full = FullContact::new(b.body.clone(), law.clone()).unwrap();
    let r = factor * full.r();
    let full = full.with_r(r).unwrap();
    let found = full.solve_observed(0.0, None, options, ignore).unwrap();
    let (u, forces) = found.x.split_at(b.load.len());
    let error = violation(b, u, &forces[..q], friction, bounds);
    assert!(error <= 1e-8, "full form: {error:e}");

    let condensed = CondensedContact::new(b.body.clone(), law.clone()).unwrap();
    let r = factor * condensed.r();
    let condensed = condensed.with_r(r).unwrap();
    let other = condensed.solve_observed(0.0, None, options, ignore).unwrap();
    let u = condensed.displacements(&other.x).unwrap();
    let error = violation(b, &u, &other.x[..q], friction, bounds);
    assert!(error <= 1e-8, "condensed form: {error:e}");
    for report in [&found, &other] {
        let (last, before) = report.attempts.split_last().unwrap();
        assert!(last.failure.is_none() && before.iter().all(|a| a.failure.is_some()));
    }
    keeps_limits(found.strategy(), &mut |options, observe| {
        full.solve_observed(0.0, None, options, observe)
    });
    keeps_limits(other.strategy(), &mut |options, observe| {
        condensed.solve_observed(0.0, None, options, observe)
    });
    [found.strategy(), other.strategy()]
}

type Observe<'a> = dyn FnMut(&ContactProgress) -> ControlFlow<()> + 'a;

/// Repeats with limits a search that needed more than Newton's method: no strategy exceeds its limit, and none that is switched off is
/// tried.
fn keeps_limits(
    strategy: ContactStrategy,
    search: &mut dyn FnMut(&ContactOptions, &mut Observe<'_>) -> Result<ContactReport, ContactError>,
) {
    if strategy < ContactStrategy::Increments {
        return;
    }
    for (increments, paths, points) in [(0, 0, 1), (3, 0, 1), (0, 2, 5)] {
        let mut counts = [0; 2];
        let mut lengths: Vec<usize> = Vec::new();
        let options = ContactOptions::default()
            .with_max_increments(increments)
            .with_max_paths(paths)
            .with_max_points(points);
        let result = search(&options, &mut |p| {
            match p.strategy {
                ContactStrategy::Increments if p.level < 1.0 => counts[0] = counts[0].max(p.points),
                ContactStrategy::Path if p.level < 1.0 => {
                    counts[1] += 1;
                    // Attempts of Newton's method are reported with level 1.
                    match lengths.last_mut() {
                        Some(last) if p.points > 1 => *last = p.points,
                        _ => lengths.push(p.points),
                    }
                }
                _ => {}
            }
            ControlFlow::Continue(())
        });
        assert!(
            counts[0] <= increments && (counts[0] > 0) == (increments > 0),
            "{counts:?}"
        );
        assert!(counts[1] == 0 || paths > 0);
        assert!(counts[1] > 0 || paths == 0 || strategy < ContactStrategy::Path);
        assert!(
            lengths.len() <= paths && lengths.iter().all(|l| *l <= points),
            "{lengths:?}"
        );
        if increments + paths == 0 {
            assert!(!result.unwrap_err().is_interrupted());
        }
    }
    let two = NewtonOptions::default().with_max_iterations(2);
    let options = ContactOptions::default()
        .with_newton(two)
        .with_max_increments(0)
        .with_max_paths(0);
    assert!(search(&options, &mut |_| ControlFlow::Continue(())).is_err());
    let none = ContactOptions::default().with_max_time(Some(Duration::ZERO));
    assert!(
        search(&none, &mut |_| ControlFlow::Continue(()))
            .unwrap_err()
            .is_interrupted()
    );
}

/// The problem with the given seed.
fn problem(seed: u64) -> [ContactStrategy; 2] {
    problem_within(&ContactOptions::default(), seed)
}

fn problem_within(options: &ContactOptions, seed: u64) -> [ContactStrategy; 2] {
    let mut rng = Random::new(seed.wrapping_mul(0x123_4567));
    let dim = 2 + rng.below(2);
    let b = match rng.below(5) < 3 {
        true => Body::elastic(&mut rng, dim),
        false => Body::dense(&mut rng, dim),
    };
    let p = b.gap.len();
    let factor = match rng.below(3) {
        0 => 10f64.powf(rng.between(-3.0, 3.0)),
        _ => 1.0,
    };
    let largest = [0.3, 0.6, 1.2][rng.below(3)];
    let first = curve(&mut rng, b.length, largest);
    let uniform = FrictionCoefficient::uniform;
    if rng.below(8) == 0 {
        let bounds: Vec<f64> = (0..p).map(|_| b.length * rng.unit()).collect();
        let mut f = [0, 1].map(|_| rng.between(0.05, 1.0));
        if dim == 2 {
            f[1] = f[0];
        }
        let law = GivenBound::new(dim - 1, bounds.clone(), vec![f; p]).unwrap();
        return both(&b, options, &law, factor, &|_| f, Some(&bounds));
    }
    if dim == 2 {
        let law = PlanarCoulomb::new(uniform(first.clone()));
        return both(&b, options, &law, factor, &|slip| [first.value(slip).0; 2], None);
    }
    if rng.below(2) == 0 {
        let law = OrthotropicCoulomb::isotropic(uniform(first.clone()));
        return both(&b, options, &law, factor, &|slip| [first.value(slip).0; 2], None);
    }
    let second = match rng.below(2) {
        0 => first.times(rng.between(0.2, 1.0)),
        _ => curve(&mut rng, b.length, largest),
    };
    let law = OrthotropicCoulomb::new(uniform(first.clone()), uniform(second.clone()));
    let friction = |slip: f64| [first.value(slip).0, second.value(slip).0];
    both(&b, options, &law, factor, &friction, None)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn every_body(seed in any::<u64>()) {
        problem(seed);
    }

    #[test]
    fn every_planar_problem(seed in any::<u64>()) {
        planar(seed);
    }
}

/// A planar problem with the coefficients of friction as a path, with r times a factor, full and condensed.
fn planar(seed: u64) {
    let mut rng = Random::new(seed.wrapping_mul(0x123_4567));
    let b = match rng.below(2) {
        0 => Body::elastic(&mut rng, 2),
        _ => Body::dense(&mut rng, 2),
    };
    let (n, p) = (b.load.len(), b.gap.len());
    let f = rng.between(0.0, 1.5);
    let factor = 10f64.powf(rng.between(-3.0, 3.0));
    let r = factor
        * FullContact::new(b.body.clone(), Frictionless::plane())
            .unwrap()
            .r();
    let problem = FullContact::planar(
        b.body.stiffness().clone(),
        b.traces[0].clone(),
        b.traces[1].clone(),
        LoadPath::constant(b.load.clone()),
        FrictionCoefficient::nodal(vec![f; p]).unwrap(),
    )
    .unwrap()
    .with_gap(b.gap.clone())
    .unwrap()
    .with_r(r)
    .unwrap();
    let x = problem.solve(0.0, None).unwrap();
    // Cones of friction need f > 0 to be put as below.
    let friction = |_| [f.max(1e-12); 2];
    let error = violation(&b, &x[..n], &x[n..n + 2 * p], &friction, None);
    assert!(error <= 1e-8, "full form: {error:e}");
    let condensed = problem.condensed().unwrap();
    let y = condensed.solve(0.0, None).unwrap();
    let u = condensed.displacements(&y).unwrap();
    let error = violation(&b, &u, &y[..2 * p], &friction, None);
    assert!(error <= 1e-8, "condensed form: {error:e}");
}

/// Problems on which Newton's method cycles from all its starts: the fallback strategies find their solutions.
#[test]
fn where_newton_cycles() {
    const SEEDS: [u64; 23] = [
        50, 99, 163, 262, 310, 392, 471, 605, 684, 779, 821, 850, 931, 1247, 1351, 1364, 1511, 1556, 1563,
        1565, 1591, 1770, 2231,
    ];
    let found: BTreeSet<ContactStrategy> = SEEDS.into_iter().flat_map(problem).collect();
    for strategy in [
        ContactStrategy::Stiffer,
        ContactStrategy::Increments,
        ContactStrategy::Path,
    ] {
        assert!(found.contains(&strategy), "{strategy}");
    }
}

/// Where a path winds, following it longer does not help: it is cut off, and Newton's method finds the solution from the point of the path
/// at which the body is lowered furthest, or from a path with another order of touching nodes. (In full form increments of the load solve the
/// problem before.)
#[test]
fn paths_that_wind_are_cut_off() {
    for points in [125, 250] {
        let found = problem_within(&ContactOptions::default().with_max_points(points), 189);
        assert_eq!(found[1], ContactStrategy::Path);
    }
}

/// In the first problem, in condensed form, paths with another order of touching nodes are short; in the second all are long, the first one
/// has 4220 points.
#[test]
fn paths_that_wind_lead_to_solutions() {
    assert_eq!(problem(189)[1], ContactStrategy::Path);
    assert_eq!(problem(2_247_245_699_728_832_447), [ContactStrategy::Path; 2]);
}

/// A coefficient of friction that rises within a thousandth of the slips: the path of the lowered body bends within lengths of 1e-9, which
/// the shortest step has to resolve.
#[test]
fn steep_coefficients_of_friction() {
    let found = problem(9_911_927_845_062_130_942);
    assert_eq!(found[1], ContactStrategy::Path);
}

/// Hardening in the plane: a slip coefficient continued to negative slip must not let a node lie in the cells of both slip directions, and
/// be solved in the wrong one.
#[test]
fn sides_of_slip_exclude_each_other() {
    problem(4_097_660_770_967_802_826);
}

/// Coefficients that fall at different rates along t₁ and t₂ are taken at one slip: an equation with several roots for it would jump
/// between them, and Newton's method would take the jump for rounding.
#[test]
fn oblique_slip_is_no_jump() {
    problem(12_484_323_139_738_361_259);
}

/// A search that is stopped, and one that cannot succeed, return the best iterate and its history.
#[test]
fn failures_leave_the_best_iterate() {
    // Pulled off the ground, without any support.
    let a = Matrix::from_rows(&[[0.0, 0.0], [0.0, 1.0]]).unwrap();
    let unit = |k: usize| Matrix::from_triplets(1, 2, &[(0, k, 1.0)]).unwrap();
    let loose = ContactBody::new(a, unit(0), vec![unit(1)], LoadPath::constant(vec![-1.0, 0.5])).unwrap();
    let curve = FrictionCurve::constant(0.3).unwrap();
    let law = PlanarCoulomb::new(FrictionCoefficient::uniform(curve));
    let problem = FullContact::new(loose, law).unwrap();
    let failed = |error: ContactError| match error {
        ContactError::NoStart { source, .. } => match *source {
            NewtonError::Failed(unsolved) => *unsolved,
            other => panic!("{other}"),
        },
        other => panic!("{other}"),
    };
    let unsolved = failed(problem.solve(0.0, None).unwrap_err());
    assert_eq!(unsolved.x.len(), 5);
    assert!(!unsolved.report.history.is_empty() && unsolved.residual_norm > 0.0);
    let mut seen = 0;
    let stopped = problem.solve_observed(0.0, None, &ContactOptions::default(), |_| {
        seen += 1;
        ControlFlow::Break(())
    });
    assert_eq!(failed(stopped.unwrap_err()).status, Status::Interrupted);
    assert_eq!(seen, 1);
    let none = ContactOptions::default().with_max_time(Some(Duration::ZERO));
    let late = problem.solve_observed(0.0, None, &none, |_| ControlFlow::Continue(()));
    assert_eq!(failed(late.unwrap_err()).status, Status::TimeLimit);
}

/// Among the failed starts of a search for a first point the best is kept, each is reported, and the search may be stopped at each.
#[test]
fn first_points_are_searched_as_long_as_allowed() {
    let a = Matrix::from_rows(&[[0.0, 0.0], [0.0, 1.0]]).unwrap();
    let unit = |k: usize| Matrix::from_triplets(1, 2, &[(0, k, 1.0)]).unwrap();
    let load = LoadPath::constant(vec![-1.0, 0.5]);
    let problem = FullContact::planar(
        a,
        unit(0),
        unit(1),
        load,
        FrictionCoefficient::nodal(vec![0.3]).unwrap(),
    )
    .unwrap();
    let search = |options: &ContactOptions, limit: usize| {
        let mut seen = 0;
        let found = problem.solve_observed(0.0, None, options, |_| {
            seen += 1;
            match seen < limit {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            }
        });
        (found.unwrap_err(), seen)
    };
    let (failed, all) = search(&ContactOptions::default(), usize::MAX);
    assert!(!failed.is_interrupted() && all > 3, "{all}");
    assert_eq!(problem.solve(0.0, None).unwrap_err(), failed);
    for limit in 1..=all {
        let (stopped, seen) = search(&ContactOptions::default(), limit);
        assert!(stopped.is_interrupted() && seen == limit, "{limit}: {stopped}");
    }
    let none = ContactOptions::default().with_max_time(Some(Duration::ZERO));
    let (stopped, seen) = search(&none, usize::MAX);
    assert!(stopped.is_interrupted() && seen == 1);
}
