//! Contact in the displacements alone: multigrid and the elimination of laws, against the condensed form.

mod failures;
mod pieces;

use std::ops::ControlFlow;
use std::time::Duration;

use semismooth::contact::{
    CondensedContact, ContactError, ContactState, ContactStrategy, EvolutionOptions, FrictionCoefficient,
    FrictionCurve, Frictionless, LoadPath, LocalValues, NodeLaw, OrthotropicCoulomb, PlanarCoulomb,
    ReducedBody, ReducedContact, ReducedOptions, ReducedReport, evolve,
};
use semismooth::fem::{ElasticSystem, Elasticity, Foundation, Material, Mesh};

pub(crate) fn block(cells: [usize; 3], material: Material) -> ElasticSystem {
    let mesh = Mesh::block([0.0; 3], [2.0, 2.0, 1.0], cells).unwrap();
    Elasticity::new(mesh, material).fix("left").assemble().unwrap()
}

pub(crate) fn rectangle(cells: [usize; 2]) -> ElasticSystem {
    let mesh = Mesh::rectangle([0.0; 2], [2.0, 1.0], cells).unwrap();
    let material = Material::isotropic(1.0, 0.277).unwrap();
    Elasticity::new(mesh, material).fix("left").assemble().unwrap()
}

pub(crate) fn ground(dim: usize) -> Foundation {
    let mut up = [0.0; 3];
    up[dim - 1] = 1.0;
    Foundation::plane([0.0; 3], up)
}

/// Pressure on top and a pull on the right that grows with α.
pub(crate) fn loads(system: &ElasticSystem) -> LoadPath {
    let dim = system.mesh().dim();
    let press = system.traction("top", |_| {
        if dim == 2 {
            [0.0, -0.01, 0.0]
        } else {
            [0.0, 0.0, -0.01]
        }
    });
    let pull = system.traction("right", |_| [0.01, if dim == 2 { 0.002 } else { 0.003 }, 0.002]);
    LoadPath::affine(press.unwrap(), pull.unwrap())
}

pub(crate) fn reduced_body(system: &ElasticSystem, foundation: &Foundation) -> ReducedBody {
    let rows = system.contact("bottom", foundation).unwrap();
    semismooth::reduced_body(system, &rows, loads(system)).unwrap()
}

/// Solves in both forms at two loads, the second from the first; forces must agree to 1e-8 of the largest.
pub(crate) fn compare<L: NodeLaw + Clone>(body: ReducedBody, law: L, alphas: [f64; 2]) -> ReducedReport {
    let condensed = CondensedContact::new(body.to_contact_body().unwrap(), law.clone()).unwrap();
    let mut problem = ReducedContact::new(body, law, ReducedOptions::default()).unwrap();
    let mut before: Option<(Vec<f64>, ReducedReport)> = None;
    for alpha in alphas {
        let x = condensed
            .solve(alpha, before.as_ref().map(|b| b.0.as_slice()))
            .unwrap();
        let start = before.as_ref().map(|b| b.1.displacements.as_slice());
        let found = problem.solve(alpha, start).unwrap();
        assert!(found.residuals.largest() <= 1e-10);
        let largest = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let worst = found
            .forces
            .iter()
            .zip(&x)
            .fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(worst <= 1e-8 * largest, "{:e}", worst / largest);
        let u = condensed.displacements(&x).unwrap();
        let size = u.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let off = u
            .iter()
            .zip(&found.displacements)
            .fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(off <= 1e-8 * size, "{:e}", off / size);
        let ours = problem.solution(alpha, &found.displacements).unwrap();
        let theirs = condensed.solution(&x).unwrap();
        // The direction in which frictionless nodes slip is rounding.
        let kinds = |s: &[ContactState]| {
            s.iter()
                .map(|s| (*s == ContactState::Open, s.is_slip()))
                .collect::<Vec<_>>()
        };
        assert_eq!(kinds(&ours.states), kinds(&theirs.states));
        assert!(ours.residuals.largest() <= 1e-10);
        assert!((ours.energy.stored - theirs.energy.stored).abs() <= 1e-8 * theirs.energy.stored);
        assert!(ours.energy.imbalance().abs() <= 1e-8 * ours.energy.stored);
        before = Some((x, found));
    }
    before.unwrap().1
}

pub(crate) fn constant(f: f64) -> FrictionCoefficient {
    FrictionCoefficient::constant(f).unwrap()
}

pub(crate) fn weakening(first: f64) -> FrictionCoefficient {
    FrictionCoefficient::uniform(FrictionCurve::exponential(first, 0.5 * first, 0.02).unwrap())
}

/// Multigrid of two levels at least, nodes that stick, slip and lift off.
#[test]
fn forces_of_a_block_in_space_are_those_of_the_condensed_form() {
    let system = block([10, 10, 5], Material::isotropic(1.0, 0.277).unwrap());
    let found = compare(
        reduced_body(&system, &ground(3)),
        OrthotropicCoulomb::isotropic(constant(0.3)),
        [1.0, 1.05],
    );
    let states = found.iterations.last().unwrap().states;
    assert!(states.iter().all(|s| *s > 0), "{states:?}");
}

/// As long as nodes change their state linear systems are solved inexactly; once states are settled Newton's method is superlinear.
#[test]
fn systems_are_solved_inexactly_until_states_settle() {
    let system = block([10, 10, 5], Material::isotropic(1.0, 0.277).unwrap());
    let law = OrthotropicCoulomb::isotropic(constant(0.3));
    let options = ReducedOptions::default();
    let mut problem = ReducedContact::new(reduced_body(&system, &ground(3)), law, options.clone()).unwrap();
    let found = problem.solve(1.0, None).unwrap();
    let steps = &found.iterations;
    assert_eq!(steps[0].forcing, options.forcing);
    let mut changed = 0;
    for pair in steps.windows(2).filter(|pair| pair[0].states != pair[1].states) {
        assert_eq!(pair[1].forcing, options.forcing);
        changed += 1;
    }
    assert!(changed > 1);
    // The fastest decrease of the residual belongs to a system solved accurately.
    let error = |k: usize| steps.get(k).map_or(&found.residuals, |s| &s.residuals).largest();
    let ratio = |k: &usize| error(k + 1) / error(*k);
    let best = (0..steps.len())
        .min_by(|j, k| ratio(j).total_cmp(&ratio(k)))
        .unwrap();
    assert!(ratio(&best) < 0.1 * options.forcing && steps[best].forcing < 0.1 * options.forcing);
}

#[test]
fn laws_in_space_agree_with_the_condensed_form() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let body = || reduced_body(&system, &ground(3));
    compare(body(), Frictionless::space(), [1.0, 2.0]);
    compare(body(), OrthotropicCoulomb::isotropic(constant(0.8)), [0.5, 1.0]);
    compare(
        body(),
        OrthotropicCoulomb::new(constant(0.2), constant(0.6)),
        [1.0, 1.5],
    );
    compare(
        body(),
        OrthotropicCoulomb::new(weakening(0.3), weakening(0.5)),
        [0.8, 1.0],
    );
}

#[test]
fn laws_in_the_plane_agree_with_the_condensed_form() {
    let system = rectangle([48, 24]);
    let body = || reduced_body(&system, &ground(2));
    compare(body(), Frictionless::plane(), [1.0, 2.0]);
    compare(body(), PlanarCoulomb::new(constant(0.3)), [0.5, 1.0]);
    compare(body(), PlanarCoulomb::new(weakening(0.4)), [0.5, 1.0]);
}

/// Where GMRES restarts it multiplies combinations of the directions it has kept: systems are solved as accurately as without.
#[test]
fn restarts_solve_the_same_systems() {
    let system = block([10, 10, 5], Material::isotropic(1.0, 0.277).unwrap());
    let solve = |directions: usize| {
        let options = ReducedOptions::default()
            .with_forcing(1e-6)
            .with_directions(directions);
        let law = OrthotropicCoulomb::isotropic(constant(0.3));
        let mut problem = ReducedContact::new(reduced_body(&system, &ground(3)), law, options).unwrap();
        problem.solve(1.0, None).unwrap()
    };
    let (whole, restarted) = (solve(30), solve(4));
    assert!(whole.krylov() > 5 * whole.newton());
    assert_eq!(restarted.newton(), whole.newton());
    assert!(restarted.krylov() < 2 * whole.krylov());
}

/// Coarse levels are in single precision, whose range is passed by these stiffnesses: in units that are powers of two nothing but the
/// exponents changes.
#[test]
fn units_change_nothing() {
    let solve = |young: f64, length: f64| {
        let mesh = Mesh::block([0.0; 3], [2.0, 2.0, 1.0].map(|l| length * l), [24, 24, 12]).unwrap();
        let material = Material::isotropic(young, 0.277).unwrap();
        let system = Elasticity::new(mesh, material).fix("left").discretize().unwrap();
        let rows = system.contact("bottom", &ground(3)).unwrap();
        let press = system.traction("top", |_| [0.0, 0.0, -0.01 * young]).unwrap();
        let pull = system
            .traction("right", |_| [0.01 * young, 0.003 * young, 0.002 * young])
            .unwrap();
        let load = LoadPath::affine(press, pull);
        let stiffness = system.nodal_stiffness().unwrap();
        let body = ReducedBody::new(stiffness, &rows.normal, &rows.tangential, load).unwrap();
        let law = OrthotropicCoulomb::isotropic(constant(0.3));
        let mut problem =
            ReducedContact::new(body.with_gap(rows.gap).unwrap(), law, ReducedOptions::default()).unwrap();
        assert!(problem.levels().len() > 2);
        let found = problem.solve(1.0, None).unwrap();
        let u: Vec<f64> = found.displacements.iter().map(|u| u / length).collect();
        (u, found.krylov())
    };
    let (u, krylov) = solve(1.0, 1.0);
    let far = 2.0f64.powi(40);
    for (young, length) in [(far, 1.0), (1.0, 1.0 / far), (1.0 / far, far)] {
        assert_eq!(solve(young, length), (u.clone(), krylov), "{young:e} {length:e}");
    }
    let size = u.iter().fold(0.0f64, |m, u| m.max(u.abs()));
    for (young, length) in [(1e12, 1.0), (1e-12, 1e12), (1.0, 1e-12)] {
        let (other, other_krylov) = solve(young, length);
        let off = u
            .iter()
            .zip(&other)
            .fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(off <= 1e-10 * size, "{young:e} {length:e}: {:e}", off / size);
        assert_eq!(other_krylov, krylov);
    }
}

/// A search that was cut short reports the residuals of its best iterate that its displacements have, node by node.
#[test]
fn residuals_of_iterates_are_those_of_their_displacements() {
    fn judge<L: NodeLaw + Clone>(body: &ReducedBody, law: &L) {
        let mut largest = 0.0f64;
        for limit in 1..4 {
            let options = ReducedOptions::default()
                .with_max_iterations(limit)
                .with_max_load_steps(0)
                .with_max_condensed(0);
            let mut problem = ReducedContact::new(body.clone(), law.clone(), options).unwrap();
            let best = match problem.solve(2.0, None) {
                Err(ContactError::NotConverged { best }) => *best,
                other => other.unwrap(),
            };
            let own = problem.solution(2.0, &best.displacements).unwrap();
            for (a, b) in [
                (best.residuals.normal, own.residuals.normal),
                (best.residuals.tangential, own.residuals.tangential),
            ] {
                assert!((a - b).abs() <= 1e-10 + 1e-6 * b, "{limit}: {a:e} {b:e}");
            }
            assert_eq!(best.states[..2], [own.open(), own.stick()], "{limit}");
            largest = largest.max(own.residuals.tangential);
        }
        assert!(largest > 1e-3, "{largest:e}");
    }
    judge(
        &reduced_body(&rectangle([48, 24]), &ground(2)),
        &PlanarCoulomb::new(constant(0.3)),
    );
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let law = OrthotropicCoulomb::isotropic(constant(0.3));
    judge(&reduced_body(&system, &ground(3)), &law);
}

/// A curved foundation turns the frames of the nodes, an anisotropic material couples all directions.
#[test]
fn curved_foundations_and_gaps_agree_with_the_condensed_form() {
    let system = block([8, 6, 4], Material::isotropic(1.0, 0.3).unwrap());
    let bowl = Foundation::gap(|x| 0.004 * ((x[0] - 1.0).powi(2) + (x[1] - 1.0).powi(2)))
        .with_normal(|x| [0.2 * (x[0] - 1.0), 0.3 * (x[1] - 1.0), -1.0]);
    let law = OrthotropicCoulomb::new(constant(0.3), constant(0.5));
    let found = compare(reduced_body(&system, &bowl), law, [0.5, 1.0]);
    assert!(found.iterations.last().unwrap().states[0] > 0);
}

/// Where Newton's method may not take the steps that it needs, the load is applied in steps, then the condensed form is tried, then the
/// best iterate is returned; whatever is reported solved is the same solution.
#[test]
fn what_newton_does_not_solve_the_other_strategies_do() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let solve = |options: ReducedOptions| {
        let law = OrthotropicCoulomb::isotropic(constant(0.3));
        let body = reduced_body(&system, &ground(3));
        ReducedContact::new(body, law, options).unwrap().solve(1.0, None)
    };
    let expected = solve(ReducedOptions::default()).unwrap();
    assert_eq!(expected.strategy, ContactStrategy::Newton);
    let largest = expected.forces.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    assert!(ReducedOptions::default().with_tolerance(1e-14).validate().is_ok());
    let few = ReducedOptions::default().with_max_iterations(expected.newton() - 1);
    let steps = solve(few.clone()).unwrap();
    assert_eq!(steps.strategy, ContactStrategy::LoadSteps);
    assert!(steps.iterations.iter().any(|i| i.load < 1.0));
    let condensed = solve(few.clone().with_max_load_steps(0)).unwrap();
    assert_eq!(condensed.strategy, ContactStrategy::Condensed);
    for found in [&steps, &condensed] {
        assert!(found.residuals.largest() <= 1e-10);
        let pairs = found.forces.iter().zip(&expected.forces);
        assert!(pairs.fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) <= 1e-8 * largest);
    }
    let failed = solve(few.with_max_load_steps(0).with_max_condensed(0));
    let Err(ContactError::NotConverged { best }) = failed else {
        panic!("{failed:?}");
    };
    assert_eq!(best.newton(), expected.newton() - 1);
    // A `main` that returns the error prints a line, whatever the size of the body.
    let told = format!("{:?}", ContactError::NotConverged { best: best.clone() });
    assert!(told.len() < 500 && told.contains("IterationLimit"), "{told}");
    let first = best.iterations[0].residuals.largest();
    assert!(best.residuals.largest() > 1e-10 && best.residuals.largest() < first);
}

/// Factors in the plane have less fill: the condensed form is tried up to ten times as many displacements.
#[test]
fn the_condensed_form_is_tried_up_to_a_size() {
    let cube = block([4, 4, 2], Material::isotropic(1.0, 0.277).unwrap());
    for (system, dim, share) in [(rectangle([24, 12]), 2, 10), (cube, 3, 1)] {
        let solve = |limit: usize| {
            let options = ReducedOptions::default()
                .with_max_iterations(1)
                .with_max_load_steps(0)
                .with_max_condensed(limit);
            let body = reduced_body(&system, &ground(dim));
            let n = body.num_displacements();
            let law = if dim == 2 {
                Frictionless::plane()
            } else {
                Frictionless::space()
            };
            (
                n,
                ReducedContact::new(body, law, options).unwrap().solve(1.0, None),
            )
        };
        let (n, _) = solve(0);
        let (_, found) = solve(n.div_ceil(share));
        let (_, none) = solve(n.div_ceil(share) - 1);
        assert_eq!(found.unwrap().strategy, ContactStrategy::Condensed);
        assert!(matches!(none, Err(ContactError::NotConverged { .. })), "{none:?}");
    }
}

/// Level by level, with slips measured from the level before.
#[test]
fn levels_of_a_history_are_those_of_the_condensed_form() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let law = || OrthotropicCoulomb::isotropic(weakening(0.6));
    let body = reduced_body(&system, &ground(3));
    let mut condensed = CondensedContact::new(body.to_contact_body().unwrap(), law()).unwrap();
    let mut problem = ReducedContact::new(body, law(), ReducedOptions::default()).unwrap();
    let mut u = None;
    for alpha in [0.6, 1.0, 0.2] {
        let x = condensed.solve(alpha, None).unwrap();
        let found = problem.solve(alpha, u.as_deref()).unwrap();
        let largest = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let pairs = found.forces.iter().zip(&x);
        assert!(pairs.fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) <= 1e-8 * largest);
        condensed.end_level(&x).unwrap();
        problem.end_level(alpha, &found.displacements).unwrap();
        u = Some(found.displacements);
    }
}

/// Levels started by extrapolation from those before end where the branch between them leads, and the changes of all nodes are counted.
#[test]
fn histories_are_those_of_the_condensed_form() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let law = || OrthotropicCoulomb::isotropic(constant(0.3));
    let body = reduced_body(&system, &ground(3));
    let mut condensed = CondensedContact::new(body.to_contact_body().unwrap(), law()).unwrap();
    let mut problem = ReducedContact::new(body, law(), ReducedOptions::default()).unwrap();
    let loads = [0.3, 0.6, 0.9, 1.2, 0.8, 0.4];
    let mut seen = 0;
    let levels = problem.evolve(None, &loads, |_| {
        seen += 1;
        std::ops::ControlFlow::Continue(())
    });
    let levels = levels.unwrap();
    assert_eq!((seen, levels.len()), (loads.len(), loads.len()));
    let start = condensed.solve(loads[0], None).unwrap();
    let go_on = |_: &_| std::ops::ControlFlow::Continue(());
    let steps = evolve(
        &mut condensed,
        &start,
        &loads[1..],
        &EvolutionOptions::default(),
        go_on,
    );
    let mut total = 0;
    for (pair, step) in levels.windows(2).zip(&steps.unwrap()) {
        let (before, level) = (&pair[0].solution, &pair[1]);
        let forces = &level.report.forces;
        let largest = step.x[..forces.len()].iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let apart = forces.iter().zip(&step.x).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f64::max) <= 1e-8 * largest, "{}", step.level);
        // The same states except where a node is on the boundary of two states, up to rounding.
        let (own, other) = (&level.solution, &step.solution);
        let largest = |f: fn(&LocalValues) -> f64| other.nodes.iter().map(f).fold(0.0, f64::max);
        let (pressure, slip) = (largest(|v| v.pressure), largest(LocalValues::slip_norm));
        for (i, v) in other
            .nodes
            .iter()
            .enumerate()
            .filter(|(i, _)| own.states[*i] != other.states[*i])
        {
            let small = [
                v.pressure.abs() / pressure,
                v.traction[0].abs() / pressure,
                v.slip_norm() / slip,
            ];
            assert!(small.iter().any(|s| *s <= 1e-7), "{}: {i} {v:?}", step.level);
        }
        let moved = before.states.iter().zip(&own.states).filter(|(a, b)| a != b);
        assert_eq!(level.num_changes(), moved.count());
        total += level.num_changes();
    }
    assert!(total > 0);
    let stopped = problem.evolve(None, &loads, |_| std::ops::ControlFlow::Break(()));
    assert_eq!(stopped.unwrap().len(), 1);
}

/// Without loads and gaps nothing moves, and equilibrium is exact.
#[test]
fn a_body_at_rest_is_in_equilibrium() {
    let system = rectangle([4, 2]);
    let rows = system.contact("bottom", &ground(2)).unwrap();
    let load = LoadPath::constant(vec![0.0; system.num_free()]);
    let stiffness = system.nodal_stiffness().unwrap();
    let body = ReducedBody::new(stiffness, &rows.normal, &rows.tangential, load).unwrap();
    let law = PlanarCoulomb::new(constant(0.3));
    let problem = ReducedContact::new(body, law, ReducedOptions::default()).unwrap();
    let solution = problem.solution(0.0, &vec![0.0; system.num_free()]).unwrap();
    assert_eq!(
        (solution.residuals.equilibrium, solution.residuals.largest()),
        (0.0, 0.0)
    );
}

/// A size at which products, sweeps and sums are split between threads.
#[cfg(feature = "rayon")]
#[test]
fn results_have_the_same_bits_on_any_number_of_threads() {
    let solve = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        pool.install(|| {
            let mesh = Mesh::block([0.0; 3], [2.0, 2.0, 1.0], [24, 20, 11]).unwrap();
            let material = Material::isotropic(1.0, 0.277).unwrap();
            let system = Elasticity::new(mesh, material).fix("left").discretize().unwrap();
            let body = reduced_body(&system, &ground(3));
            let law = OrthotropicCoulomb::isotropic(constant(0.3));
            let options = ReducedOptions::default().with_tolerance(1e-4);
            let found = ReducedContact::new(body, law, options)
                .unwrap()
                .solve(1.0, None)
                .unwrap();
            let bits = |v: &[f64]| v.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            (bits(&found.displacements), bits(&found.forces), found.krylov())
        })
    };
    let one = solve(1);
    assert!(one.0.len() > 1 << 14);
    for threads in [2, 3] {
        assert!(solve(threads) == one, "{threads} threads");
    }
}

/// Where friction weakens, full Newton steps cycle; damped steps converge, and no other strategy is needed.
#[test]
fn damped_steps_lead_to_solutions() {
    let body = || reduced_body(&rectangle([48, 24]), &ground(2));
    for first in [0.8, 1.2] {
        let law = PlanarCoulomb::new(weakening(first));
        let mut problem = ReducedContact::new(body(), law, ReducedOptions::default()).unwrap();
        let report = problem.solve(0.5, None).unwrap();
        assert_eq!(report.strategy, ContactStrategy::Newton, "{first}");
        assert!(report.residuals.largest() <= 1e-10);
        assert!(
            report.iterations.iter().any(|i| 0.0 < i.step && i.step < 1.0),
            "{first}"
        );
    }
}

/// The time of the search in the displacements before the condensed form solved the problem is included.
#[test]
fn times_of_all_strategies_add_up() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let options = ReducedOptions::default()
        .with_max_iterations(2)
        .with_max_load_steps(0);
    let body = reduced_body(&system, &ground(3));
    let law = OrthotropicCoulomb::isotropic(constant(0.3));
    let mut problem = ReducedContact::new(body, law, options).unwrap();
    let (pause, mut slept) = (Duration::from_millis(2), Duration::ZERO);
    let report = problem.solve_observed(1.0, None, |progress| {
        if progress.krylov > 0 {
            std::thread::sleep(pause);
            slept += pause;
        }
        ControlFlow::Continue(())
    });
    let report = report.unwrap();
    assert_eq!(report.strategy, ContactStrategy::Condensed);
    assert!(
        slept > Duration::ZERO && report.times.krylov >= slept,
        "{slept:?}"
    );
}
