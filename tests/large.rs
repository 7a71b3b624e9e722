//! Contact in the displacements alone: multigrid and the elimination of laws, against the condensed form.

use std::time::Duration;

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, ContactState, EvolutionOptions, FrictionCoefficient,
    FrictionCurve, Frictionless, FullContact, KrylovOutcome, LoadPath, LocalRow, LocalValues, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb, ReducedBody, ReducedContact, ReducedError, ReducedNodes,
    ReducedOptions, ReducedProgress, ReducedReport, ReducedStep, ReducedStrategy, ReducedSystem, evolve,
    solve_reduced,
};
use semismooth::fem::{ElasticSystem, Elasticity, Foundation, Material, Mesh};
use semismooth::linear::LinearError;
use semismooth::sparse::{Matrix, NodalMatrix, SparseError};

fn block(cells: [usize; 3], material: Material) -> ElasticSystem {
    let mesh = Mesh::block([0.0; 3], [2.0, 2.0, 1.0], cells).unwrap();
    Elasticity::new(mesh, material).fix("left").assemble().unwrap()
}

fn rectangle(cells: [usize; 2]) -> ElasticSystem {
    let mesh = Mesh::rectangle([0.0; 2], [2.0, 1.0], cells).unwrap();
    let material = Material::isotropic(1.0, 0.277).unwrap();
    Elasticity::new(mesh, material).fix("left").assemble().unwrap()
}

fn ground(dim: usize) -> Foundation {
    let mut up = [0.0; 3];
    up[dim - 1] = 1.0;
    Foundation::plane([0.0; 3], up)
}

/// Pressure on top and a pull on the right that grows with α.
fn loads(system: &ElasticSystem) -> LoadPath {
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

fn reduced_body(system: &ElasticSystem, foundation: &Foundation) -> ReducedBody {
    let rows = system.contact("bottom", foundation).unwrap();
    let tangential: Vec<_> = std::iter::once(rows.tangential).chain(rows.tangential2).collect();
    ReducedBody::new(
        system.nodal_stiffness().unwrap(),
        &rows.normal,
        &tangential,
        loads(system),
    )
    .unwrap()
    .with_gap(rows.gap)
    .unwrap()
}

/// Solves in both forms at two loads, the second from the first; forces must agree to 1e-8 of the largest.
fn compare<L: NodeLaw + Clone>(body: ReducedBody, law: L, alphas: [f64; 2]) -> ReducedReport {
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
        // The side to which frictionless nodes slip is rounding.
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

fn constant(f: f64) -> FrictionCoefficient {
    FrictionCoefficient::constant(f).unwrap()
}

fn weakening(first: f64) -> FrictionCoefficient {
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

/// As long as nodes change their state linear systems are solved roughly; once they have come to rest Newton's method is superlinear.
#[test]
fn systems_are_solved_no_further_than_states_are_known() {
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
    // The quickest fall of the residual is that of a system solved well.
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

/// What a search that was cut short says of its best iterate is what the iterate's displacements say, node by node.
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

/// Where Newton's method is not given the steps that it needs, the load goes on step by step, then the condensed form is asked, then the
/// best iterate comes back; all that is called solved is the same solution.
#[test]
fn what_newton_does_not_solve_the_other_strategies_do() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let solve = |options: ReducedOptions| {
        let law = OrthotropicCoulomb::isotropic(constant(0.3));
        let body = reduced_body(&system, &ground(3));
        ReducedContact::new(body, law, options).unwrap().solve(1.0, None)
    };
    let expected = solve(ReducedOptions::default()).unwrap();
    assert_eq!(expected.strategy, ReducedStrategy::Newton);
    let largest = expected.forces.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    assert!(ReducedOptions::default().with_tolerance(1e-14).validate().is_ok());
    let few = ReducedOptions::default().with_max_iterations(expected.newton() - 1);
    let steps = solve(few.clone()).unwrap();
    assert_eq!(steps.strategy, ReducedStrategy::LoadSteps);
    assert!(steps.iterations.iter().any(|i| i.load < 1.0));
    let condensed = solve(few.clone().with_max_load_steps(0)).unwrap();
    assert_eq!(condensed.strategy, ReducedStrategy::Condensed);
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
    let first = best.iterations[0].residuals.largest();
    assert!(best.residuals.largest() > 1e-10 && best.residuals.largest() < first);
}

/// Factors in the plane are thinner: the condensed form is asked with ten times as many displacements.
#[test]
fn the_condensed_form_is_asked_up_to_a_size() {
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
        assert_eq!(found.unwrap().strategy, ReducedStrategy::Condensed);
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

/// Levels from the line through those before end where the branch between them leads, and the changes of all nodes are counted.
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
        // The same states but where a node is on the border of two, up to rounding.
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

/// The free displacements of a system: node and component of each, among nodes with the positions returned.
fn places(system: &ElasticSystem) -> (Vec<[usize; 2]>, Vec<[f64; 3]>) {
    let mut place = vec![[0; 2]; system.num_free()];
    let mut points = Vec::new();
    for node in 0..system.mesh().num_nodes() {
        let own: Vec<_> = (0..3).filter_map(|d| Some((d, system.dof(node, d)?))).collect();
        own.iter().for_each(|(d, k)| place[*k] = [points.len(), *d]);
        if !own.is_empty() {
            points.push(system.mesh().points()[node]);
        }
    }
    (place, points)
}

/// Copies of a body beside one another, each without a part of the layer of cells that holds it, and with something on its diagonal.
fn pieces(system: &ElasticSystem, layer: &ElasticSystem, without: &[f64], more: f64) -> NodalMatrix {
    let n = system.num_free();
    let ((place, points), (lost, lost_points)) = (places(system), places(layer));
    let same = |p: &[f64; 3], q: &[f64; 3]| (0..3).all(|d| (p[d] - q[d]).abs() < 1e-9);
    let unknown: Vec<usize> = lost
        .iter()
        .map(|[node, d]| {
            let at = points.iter().position(|p| same(p, &lost_points[*node])).unwrap();
            place.iter().position(|q| *q == [at, *d]).unwrap()
        })
        .collect();
    let (mut entries, mut unknowns, mut all) = (Vec::new(), Vec::new(), Vec::new());
    for (copy, part) in without.iter().enumerate() {
        let mut add = |i: usize, j: usize, v: f64| entries.push((copy * n + i, copy * n + j, v));
        system.stiffness().triplets().for_each(|(i, j, v)| add(i, j, v));
        (0..n).for_each(|i| add(i, i, more));
        for (i, j, v) in layer.stiffness().triplets() {
            add(unknown[i], unknown[j], -part * v);
        }
        unknowns.extend(place.iter().map(|p| [copy * points.len() + p[0], p[1]]));
        all.extend(points.iter().map(|p| [p[0] + 10.0 * copy as f64, p[1], p[2]]));
    }
    let a = Matrix::from_triplets(without.len() * n, without.len() * n, &entries).unwrap();
    NodalMatrix::new(&a, all, &unknowns, 3).unwrap()
}

/// Floating and half-held bodies, one of two pieces that floats, and matrices of negative stiffness in what is smooth, where each node by
/// itself resists: told when the problem is made, before anything is solved, in both forms.
#[test]
fn what_nothing_holds_is_refused() {
    let material = || Material::isotropic(1.0, 0.277).unwrap();
    let system = block([8, 6, 4], material());
    let mesh = Mesh::block([0.0; 3], [0.25, 2.0, 1.0], [1, 6, 4]).unwrap();
    let left = Elasticity::new(mesh, material()).fix("left").assemble().unwrap();
    let make = |system: &ElasticSystem, stiffness: NodalMatrix| {
        let rows = system.contact("bottom", &ground(3)).unwrap();
        let n = stiffness.num_unknowns();
        let wide =
            |t: &Matrix| Matrix::from_triplets(t.nrows(), n, &t.triplets().collect::<Vec<_>>()).unwrap();
        let tangential = [wide(&rows.tangential), wide(rows.tangential2.as_ref().unwrap())];
        let load = LoadPath::constant(vec![0.0; n]);
        let body = ReducedBody::new(stiffness, &wide(&rows.normal), &tangential, load).unwrap();
        let law = || OrthotropicCoulomb::isotropic(constant(0.3));
        let condensed = CondensedContact::new(body.to_contact_body().unwrap(), law());
        let reduced = ReducedContact::new(body, law(), ReducedOptions::default());
        (reduced.err(), condensed.err())
    };
    let held = |without: &[f64], more: f64| make(&system, pieces(&system, &left, without, more));
    assert_eq!(held(&[0.0], 0.0), (None, None));
    assert_eq!(held(&[0.999, 0.5], 0.0), (None, None));
    let indefinite = Some(ContactError::Linear(LinearError::NotPositiveDefinite));
    assert_eq!(held(&[0.0], -0.02), (indefinite.clone(), indefinite.clone()));

    let modes = |found: &Option<ContactError>| match found {
        Some(ContactError::Unsupported {
            displacement,
            at,
            modes,
        }) => (*displacement, *at, modes.clone()),
        other => panic!("{other:?}"),
    };
    let all = "translation along x, translation along y, translation along z, rotation about x, rotation about y, rotation about z";
    let (reduced, condensed) = held(&[1.0], 0.0);
    assert_eq!((modes(&reduced).2.as_str(), &reduced), (all, &condensed));
    // The second of two pieces; what is left of it begins behind the layer.
    let (reduced, condensed) = held(&[0.0, 1.0], 0.0);
    assert_eq!(reduced, condensed);
    let (displacement, at, names) = modes(&reduced);
    assert!(
        displacement >= system.num_free() && at.unwrap()[0] >= 10.0,
        "{at:?}"
    );
    assert_eq!(names, all);
    // A body held from above alone, after what held it at one end has gone.
    let under = |from: f64, cells: usize| {
        let mesh = Mesh::block([from, 0.0, 0.0], [2.0, 2.0, 1.0], [cells, 6, 4]).unwrap();
        let body = Elasticity::new(mesh, material())
            .fix("right")
            .fix_component("top", 2);
        body.assemble().unwrap()
    };
    let (slides, right) = (under(0.0, 8), under(1.75, 1));
    assert_eq!(make(&slides, pieces(&slides, &right, &[0.0], 0.0)), (None, None));
    let (reduced, condensed) = make(&slides, pieces(&slides, &right, &[1.0], 0.0));
    assert_eq!(reduced, condensed);
    let names = modes(&reduced).2;
    assert_eq!(
        names,
        "translation along x, translation along y, rotation about z"
    );
}

/// Without positions the condensed form names a displacement that moves: a bar of two springs that floats, alone and beside one that is held,
/// one that turns about its end, and one of negative stiffness, in which nothing moves without forces.
#[test]
fn motions_are_told_without_positions() {
    let refused = |entries: &[(usize, usize, f64)], n: usize| {
        let a = Matrix::from_triplets(n, n, entries).unwrap();
        let row = |k: usize| Matrix::from_triplets(1, n, &[(0, k, 1.0)]).unwrap();
        let load = LoadPath::constant(vec![0.0; n]);
        let body = ContactBody::new(a, row(0), vec![row(1)], load).unwrap();
        CondensedContact::new(body, PlanarCoulomb::new(constant(0.3))).err()
    };
    let unsupported = |displacement: usize, modes: &str| {
        Some(ContactError::Unsupported {
            displacement,
            at: None,
            modes: modes.into(),
        })
    };
    let spring = |i: usize, j: usize, k: f64| [(i, i, k), (j, j, k), (i, j, -k), (j, i, -k)];
    // Two motions of one piece, u₀ + c u₁ = 0 among them: the second node moves more.
    let lever = [(0, 0, 1.0), (0, 1, 0.5), (1, 0, 0.5), (1, 1, 0.25)];
    assert_eq!(
        refused(&lever, 2),
        unsupported(0, "a motion in which displacement 1 moves most")
    );
    let held = [(0, 0, 1.0), (1, 1, 1.0)];
    let beside = [&held[..], &spring(2, 3, 5.0)].concat();
    match refused(&beside, 4) {
        Some(ContactError::Unsupported {
            displacement: 2,
            modes,
            ..
        }) => {
            assert!(modes.starts_with("a motion in which displacement"), "{modes}");
        }
        other => panic!("{other:?}"),
    }
    let loose = [&held[..], &[(2, 2, 0.0)]].concat();
    assert_eq!(
        refused(&loose, 3),
        unsupported(2, "a motion in which displacement 2 moves most")
    );
    let negative = [&held[..], &[(2, 2, 1.0), (3, 3, 1.0), (2, 3, 2.0), (3, 2, 2.0)]].concat();
    assert_eq!(refused(&negative, 4), unsupported(2, ""));
    assert_eq!(
        refused(&[(0, 0, 1.0), (1, 1, 1.0), (0, 1, 2.0), (1, 0, 2.0)], 2),
        Some(ContactError::Linear(LinearError::NotPositiveDefinite))
    );
}

/// A block that nothing holds and that is pulled off the ground: nothing balances that, and the work of the load in that motion is its
/// resultant. Pressed, and pushed against friction, it stays.
#[test]
fn loads_that_nothing_balances_are_told() {
    let system = block([4, 3, 2], Material::isotropic(1.0, 0.277).unwrap());
    let mesh = Mesh::block([0.0; 3], [0.5, 2.0, 1.0], [1, 3, 2]).unwrap();
    let layer = Elasticity::new(mesh, Material::isotropic(1.0, 0.277).unwrap()).fix("left");
    let floating = pieces(&system, &layer.assemble().unwrap(), &[1.0], 0.0);
    let rows = system.contact("bottom", &ground(3)).unwrap();
    let tangential = [rows.tangential, rows.tangential2.unwrap()];
    let (place, points) = places(&system);
    let solve = |traction: [f64; 3], friction: f64| {
        // A load that does no work in rotations: the same force on each node.
        let load: Vec<f64> = place.iter().map(|[_, d]| traction[*d]).collect();
        let body = ContactBody::new(
            floating.to_matrix().unwrap(),
            rows.normal.clone(),
            tangential.to_vec(),
            LoadPath::constant(load),
        );
        let body = body.unwrap().with_nodes(points.clone(), &place).unwrap();
        let law = OrthotropicCoulomb::isotropic(constant(friction));
        FullContact::new(body, law).unwrap().solve(0.0, None)
    };
    let unbalanced = |found: Result<Vec<f64>, ContactError>, component: usize, force: f64| match found {
        Err(ContactError::Unbalanced {
            displacement,
            at,
            work,
            ..
        }) => {
            assert_eq!(place[displacement][1], component);
            assert_eq!(at, Some(points[place[displacement][0]]));
            let total = force * points.len() as f64;
            // Nodes count by their stiffness: it is not quite a translation.
            assert!((work - total).abs() <= 1e-3 * total, "{work} {total}");
        }
        other => panic!("{other:?}"),
    };
    unbalanced(solve([0.0, 0.0, 1e-4], 0.3), 2, 1e-4);
    assert!(solve([2e-5, 0.0, -1e-4], 0.3).is_ok());
}

/// Contact holds what supports do not, in the full form: a block that floats, pressed on the ground by less friction than it is pulled with.
#[test]
fn the_full_form_takes_pieces_that_contact_alone_holds() {
    let system = block([4, 3, 2], Material::isotropic(1.0, 0.277).unwrap());
    let mesh = Mesh::block([0.0; 3], [0.5, 2.0, 1.0], [1, 3, 2]).unwrap();
    let layer = Elasticity::new(mesh, Material::isotropic(1.0, 0.277).unwrap()).fix("left");
    let floating = pieces(&system, &layer.assemble().unwrap(), &[1.0], 0.0);
    let rows = system.contact("bottom", &ground(3)).unwrap();
    let tangential = [rows.tangential, rows.tangential2.unwrap()];
    let press = system.traction("top", |_| [0.0, 0.0, -0.01]).unwrap();
    let pull = system.traction("top", |_| [0.002, 0.0, 0.0]).unwrap();
    let sum = |v: &[f64]| v.iter().sum::<f64>();
    let (weight, drag) = (-sum(&press), sum(&pull));
    let load: Vec<f64> = press.iter().zip(&pull).map(|(a, b)| a + b).collect();
    let body = ContactBody::new(
        floating.to_matrix().unwrap(),
        rows.normal,
        tangential.to_vec(),
        LoadPath::constant(load),
    );
    let law = OrthotropicCoulomb::isotropic(constant(0.3));
    let problem = FullContact::new(body.unwrap(), law).unwrap();
    let x = problem.solve(0.0, None).unwrap();
    let (n, p) = (system.num_free(), rows.nodes.len());
    let total = |d: usize| x[n + d * p..n + (d + 1) * p].iter().sum::<f64>();
    for (found, expected) in [(total(0), weight), (total(1), drag), (total(2), 0.0)] {
        assert!((found - expected).abs() <= 1e-10 * weight, "{found} {expected}");
    }
}

/// An observer ends a search wherever it is asked, within a linear solve, too, and is not asked again; from the best iterate, which comes back,
/// the search goes on to the same solution.
#[test]
fn observers_stop_searches() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let problem = |options: ReducedOptions| {
        let law = OrthotropicCoulomb::isotropic(constant(0.3));
        ReducedContact::new(reduced_body(&system, &ground(3)), law, options).unwrap()
    };
    let mut seen: Vec<ReducedProgress> = Vec::new();
    let expected = problem(ReducedOptions::default()).solve_observed(1.0, None, |p| {
        seen.push(*p);
        ControlFlow::Continue(())
    });
    let expected = expected.unwrap();
    let starts: Vec<usize> = (0..seen.len()).filter(|k| seen[*k].krylov == 0).collect();
    let steps: Vec<usize> = expected.iterations.iter().map(|i| i.krylov).collect();
    assert!(steps.iter().all(|k| *k > 1), "{steps:?}");
    assert_eq!(seen[1].residual, expected.iterations[0].residuals.largest());
    let largest = expected.forces.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    // In the middle of the last step but one, and before the first iteration of the last one: what later ones reach may be a solution.
    let last = starts.len();
    for stop in [0, 1, 3, starts[last - 4] + 1, starts[last - 2]] {
        let (mut calls, mut stopping) = (0, problem(ReducedOptions::default()));
        let found = stopping.solve_observed(1.0, None, |_| {
            calls += 1;
            match calls > stop {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        let Err(ContactError::Interrupted { best }) = found else {
            panic!("{stop}: {found:?}");
        };
        assert_eq!((calls, best.newton()), (stop + 1, seen[stop].newton));
        assert!(best.residuals.largest() > 1e-10);
        let own = stopping.solution(1.0, &best.displacements).unwrap();
        assert!((own.residuals.equilibrium - best.residuals.equilibrium).abs() <= 1e-10);
        let again = stopping.solve(1.0, Some(&best.displacements)).unwrap();
        let pairs = again.forces.iter().zip(&expected.forces);
        assert!(pairs.fold(0.0f64, |m, (a, b)| m.max((a - b).abs())) <= 1e-8 * largest);
    }
    // In the attempts of the condensed form, which come where steps and load steps have ended.
    let few = expected.newton() - 1;
    let options = ReducedOptions::default()
        .with_max_iterations(few)
        .with_max_load_steps(0);
    let mut ends = 0;
    let found = problem(options).solve_observed(1.0, None, |p| {
        ends += usize::from((p.newton, p.krylov) == (few, 0));
        match ends {
            2 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        }
    });
    assert!(
        matches!(found, Err(ContactError::Interrupted { .. })),
        "{found:?}"
    );
}

/// A history stopped on the way to a level keeps the levels before, and goes on from there as if nothing had been.
#[test]
fn histories_stopped_on_the_way_go_on() {
    let system = rectangle([24, 12]);
    let problem = || {
        let law = PlanarCoulomb::new(constant(0.3));
        ReducedContact::new(reduced_body(&system, &ground(2)), law, ReducedOptions::default()).unwrap()
    };
    let levels = [0.4, 0.8, 1.2];
    let whole = problem()
        .evolve(None, &levels, |_| ControlFlow::Continue(()))
        .unwrap();
    let (mut stopping, done) = (problem(), AtomicUsize::new(0));
    let before = stopping.evolve_observed(
        None,
        &levels,
        |_| match done.load(Ordering::Relaxed) {
            2 => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        },
        |_| {
            done.fetch_add(1, Ordering::Relaxed);
            ControlFlow::Continue(())
        },
    );
    let before = before.unwrap();
    assert_eq!(before.len(), 2);
    for (a, b) in before.iter().zip(&whole) {
        assert_eq!(a.report.displacements, b.report.displacements);
    }
    let last = stopping
        .solve(levels[2], Some(&before[1].report.displacements))
        .unwrap();
    let largest = last.forces.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    for (a, b) in last.forces.iter().zip(&whole[2].report.forces) {
        assert!((a - b).abs() <= 1e-8 * largest);
    }
    // From the beginning again, once slips and histories are forgotten.
    stopping
        .set_reference_slip(&vec![0.0; stopping.body().num_contacts()])
        .unwrap();
    stopping.set_history(&[]).unwrap();
    let first = stopping.solve(levels[0], None).unwrap();
    for (a, b) in first.forces.iter().zip(&whole[0].report.forces) {
        assert!((a - b).abs() <= 1e-8 * largest);
    }
}

/// Without loads and gaps nothing moves, and nothing is missing of equilibrium.
#[test]
fn a_body_at_rest_is_in_equilibrium() {
    let system = rectangle([4, 2]);
    let rows = system.contact("bottom", &ground(2)).unwrap();
    let load = LoadPath::constant(vec![0.0; system.num_free()]);
    let stiffness = system.nodal_stiffness().unwrap();
    let body = ReducedBody::new(stiffness, &rows.normal, &[rows.tangential], load).unwrap();
    let law = PlanarCoulomb::new(constant(0.3));
    let problem = ReducedContact::new(body, law, ReducedOptions::default()).unwrap();
    let solution = problem.solution(0.0, &vec![0.0; system.num_free()]).unwrap();
    assert_eq!(
        (solution.residuals.equilibrium, solution.residuals.largest()),
        (0.0, 0.0)
    );
}

/// A diagonal matrix whose system breaks down at a given solve, or whose products are NaN from a given one on.
struct Brittle {
    diagonal: Vec<f64>,
    constrained: Vec<usize>,
    added: Vec<(usize, usize, f64)>,
    solves: usize,
    products: usize,
    /// The share of the right-hand side that its solves leave.
    left: f64,
}

impl Brittle {
    const NODES: ReducedNodes<'static> = ReducedNodes {
        components: &[0],
        first: 0,
        gap: &[10.0],
        reference: &[],
        history: &[],
        r: 1.0,
        parameter: 0.0,
    };

    fn new(solves: usize, products: usize, left: f64) -> Self {
        Self {
            diagonal: vec![2.0, 4.0, 1.0, 1.0],
            constrained: Vec::new(),
            added: Vec::new(),
            solves,
            products,
            left,
        }
    }
}

impl ReducedSystem for Brittle {
    type Error = LinearError;

    fn len(&self) -> usize {
        self.diagonal.len()
    }

    fn mul(&mut self, u: &[f64], out: &mut [f64]) -> Result<(), LinearError> {
        self.products = self.products.saturating_sub(1);
        for ((out, u), a) in out.iter_mut().zip(u).zip(&self.diagonal) {
            *out = if self.products == 0 { f64::NAN } else { a * u };
        }
        Ok(())
    }

    fn select(&mut self, step: &ReducedStep<'_>) -> Result<(), LinearError> {
        (self.constrained, self.added) = (step.constrained.to_vec(), step.added.to_vec());
        Ok(())
    }

    /// A share of what is left: Newton's method takes a few steps.
    fn solve(&mut self, r: &[f64], d: &mut [f64], _: f64) -> Result<KrylovOutcome, LinearError> {
        self.solves = self.solves.saturating_sub(1);
        if self.solves == 0 {
            return Err(LinearError::NotFactored);
        }
        for (k, d) in d.iter_mut().enumerate() {
            let more = self.added.iter().filter(|a| (a.0, a.1) == (k, k)).map(|a| a.2);
            *d = (1.0 - self.left) * r[k] / (self.diagonal[k] + more.sum::<f64>());
        }
        self.constrained.iter().for_each(|k| d[*k] = 0.0);
        Ok(KrylovOutcome::new(1, self.left))
    }

    fn sum(&self, _: &mut [f64]) -> Result<(), LinearError> {
        Ok(())
    }

    fn max(&self, _: &mut [f64]) -> Result<(), LinearError> {
        Ok(())
    }
}

/// A system that breaks down leaves the best iterate before with its history and forces; products that are NaN are no solution, though
/// no residual is larger than any number.
#[test]
fn breakdowns_leave_the_best_iterate() {
    let solve = |solves: usize, products: usize, left: f64| {
        let mut system = Brittle::new(solves, products, left);
        let law = PlanarCoulomb::new(constant(0.3));
        let load = [1.0, 0.5, 3.0, -1.0];
        let options = ReducedOptions::default().with_max_load_steps(0);
        solve_reduced(&mut system, &Brittle::NODES, &law, &load, vec![0.0; 4], &options)
    };
    let mut before = f64::INFINITY;
    for solves in 1..6 {
        let Err(ReducedError::System { source, best }) = solve(solves, usize::MAX, 0.25) else {
            panic!("{solves}");
        };
        assert_eq!((source, best.newton()), (LinearError::NotFactored, solves));
        // Each step leaves a quarter of what is missing of u = (1/2, 1/8, 3, −1), which touches nothing.
        let left = 0.25f64.powi(solves as i32 - 1);
        for (u, exact) in best.displacements.iter().zip([0.5, 0.125, 3.0, -1.0]) {
            // The open node keeps some 1e-9 of r as stiffness.
            assert!((u - (1.0 - left) * exact).abs() <= 1e-8);
        }
        assert!((best.residuals.equilibrium - left).abs() <= 1e-8);
        assert!((best.forces[0] - left).abs() <= 1e-8 && best.residuals.largest() < before);
        before = best.residuals.largest();
    }
    match solve(usize::MAX, 1, 0.25) {
        Err(ReducedError::Contact(ContactError::NotConverged { best })) => {
            assert_eq!(best.residuals.largest(), f64::INFINITY);
        }
        other => panic!("{other:?}"),
    }
    // Steps that leave most of the right-hand side are not taken.
    match solve(usize::MAX, usize::MAX, 0.75) {
        Err(ReducedError::Contact(ContactError::NotConverged { best })) => {
            assert_eq!(best.displacements, [0.0; 4]);
            assert!(best.iterations.iter().all(|i| i.step == 0.0 && i.krylov == 1));
            assert_eq!((best.newton(), best.residuals.equilibrium), (1, 1.0));
        }
        other => panic!("{other:?}"),
    }
}

/// Coulomb's law, but that nodes which have slipped prescribe their slip and no force.
#[derive(Clone)]
struct Driven(PlanarCoulomb);

impl NodeLaw for Driven {
    fn num_tangents(&self) -> usize {
        1
    }
    fn tests(&self, v: &LocalValues, out: &mut [f64]) {
        self.0.tests(v, out);
    }
    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        self.0.test_rows(v, rows);
    }
    fn residual(&self, piece: usize, v: &LocalValues) -> [f64; 3] {
        let h = self.0.residual(piece, v);
        if piece < 2 || v.slip[0] == 0.0 {
            h
        } else {
            [h[0], v.slip[0] - 1.0, 0.0]
        }
    }
    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        let rows = self.0.rows(piece, v);
        if piece < 2 || v.slip[0] == 0.0 {
            rows
        } else {
            [rows[0], LocalRow::of_slip(0), rows[2]]
        }
    }
}

/// A law that cannot be eliminated ends the solve with the steps before, and the forces there.
#[test]
fn laws_that_do_not_determine_forces_leave_the_best_iterate() {
    let system = rectangle([8, 4]);
    let body = reduced_body(&system, &ground(2));
    let law = Driven(PlanarCoulomb::new(constant(0.3)));
    let mut problem = ReducedContact::new(body, law, ReducedOptions::default()).unwrap();
    match problem.solve(0.0, None) {
        Err(ContactError::NotReducible { node, piece, best }) => {
            assert!(node < system.contact("bottom", &ground(2)).unwrap().nodes.len());
            assert!(piece.starts_with("slip"), "{piece}");
            assert_eq!(best.displacements.len(), system.num_free());
            assert!(best.newton() > 0 && best.residuals.largest() < f64::INFINITY);
            let solution = problem.solution(0.0, &best.displacements).unwrap();
            let p = solution.nodes.len();
            for (k, v) in solution.nodes.iter().enumerate() {
                assert_eq!([v.pressure, v.traction[0]], [best.forces[k], best.forces[p + k]]);
            }
        }
        other => panic!("{other:?}"),
    }
}

/// Time that is over before the hierarchy is made is told.
#[test]
fn time_ends_the_making_of_a_problem() {
    let options = ReducedOptions::default().with_max_time(Some(Duration::ZERO));
    let body = reduced_body(
        &block([6, 6, 3], Material::isotropic(1.0, 0.3).unwrap()),
        &ground(3),
    );
    let made = ReducedContact::new(body, OrthotropicCoulomb::isotropic(constant(0.3)), options);
    assert_eq!(made.err(), Some(ContactError::Linear(LinearError::Interrupted)));
}

/// A matrix beyond the range of numbers is told as such, not as one that is indefinite.
#[test]
fn stiffness_beyond_the_range_of_numbers_is_refused() {
    let system = block([6, 6, 3], Material::isotropic(1e308, 0.3).unwrap());
    let rows = system.contact("bottom", &ground(3)).unwrap();
    let tangential = [rows.tangential, rows.tangential2.unwrap()];
    let load = LoadPath::constant(vec![0.0; system.num_free()]);
    let body = ReducedBody::new(system.nodal_stiffness().unwrap(), &rows.normal, &tangential, load);
    match body.err() {
        Some(ContactError::Matrix {
            source: SparseError::NotFinite { row, col, value },
            ..
        }) => assert!(!value.is_finite() && row.max(col) < system.num_free()),
        other => panic!("{other:?}"),
    }
}

/// Both forms say what they need and are refused one byte below it; the condensed form is not tried where it would not fit beside
/// multigrid.
#[test]
fn memory_is_told_before_it_is_taken() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let law = || OrthotropicCoulomb::isotropic(constant(0.3));
    let body = || reduced_body(&system, &ground(3));
    let options = || {
        ReducedOptions::default()
            .with_max_iterations(1)
            .with_max_load_steps(0)
    };
    let contact = || body().to_contact_body().unwrap();
    let needed = contact().condensed_memory().unwrap();
    assert!(CondensedContact::within(contact(), law(), Some(needed), None).is_ok());
    let refused = CondensedContact::within(contact(), law(), Some(needed - 1), None).err();
    assert_eq!(
        refused,
        Some(ContactError::Memory {
            needed,
            limit: needed - 1
        })
    );
    // C, its half, and a Jacobian with its factors at least.
    let traces = 3 * body().num_contacts() as u64;
    assert!(needed > 8 * 5 * traces * traces);

    let own = body().memory(&options());
    let made = |limit: u64| ReducedContact::new(body(), law(), options().with_max_memory(Some(limit)));
    let refused = made(own - 1).err();
    assert_eq!(
        refused,
        Some(ContactError::Memory {
            needed: own,
            limit: own - 1
        })
    );
    let tight = made(own + needed).unwrap().solve(1.0, None);
    assert!(
        matches!(tight, Err(ContactError::NotConverged { .. })),
        "{tight:?}"
    );
    let wide = made(own + 2 * needed + (64 << 20))
        .unwrap()
        .solve(1.0, None)
        .unwrap();
    assert_eq!(wide.strategy, ReducedStrategy::Condensed);
}

/// Loads beyond the range of numbers and laws without a solution in reach end with the best iterate, which is finite.
#[test]
fn failures_carry_finite_iterates() {
    let system = block([6, 6, 3], Material::isotropic(1.0, 0.277).unwrap());
    let rows = system.contact("bottom", &ground(3)).unwrap();
    let tangential = [rows.tangential, rows.tangential2.unwrap()];
    for pressure in [1e150, 1e290, 1e307, 1e308] {
        let press = system.traction("top", |_| [0.0, 0.0, -pressure]).unwrap();
        let load = LoadPath::constant(press);
        let body = ReducedBody::new(system.nodal_stiffness().unwrap(), &rows.normal, &tangential, load);
        let law = OrthotropicCoulomb::isotropic(constant(0.3));
        let options = ReducedOptions::default();
        match ReducedContact::new(body.unwrap(), law, options)
            .unwrap()
            .solve(0.0, None)
        {
            Ok(found) => {
                assert!(found.residuals.largest() <= 1e-10);
                assert!(
                    found
                        .displacements
                        .iter()
                        .chain(&found.forces)
                        .all(|u| u.is_finite())
                );
            }
            Err(ContactError::NotConverged { best } | ContactError::StepFailed { best, .. }) => {
                assert!(best.displacements.iter().all(|u| u.is_finite()));
            }
            Err(e) => panic!("{pressure:e}: {e}"),
        }
    }
}

/// A size at which products, sweeps and sums are split.
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

/// Where friction weakens, whole steps of Newton's method lead back and forth; parts of them lead on, and no other strategy is needed.
#[test]
fn parts_of_steps_lead_to_solutions() {
    let body = || reduced_body(&rectangle([48, 24]), &ground(2));
    for first in [0.8, 1.2] {
        let law = PlanarCoulomb::new(weakening(first));
        let mut problem = ReducedContact::new(body(), law, ReducedOptions::default()).unwrap();
        let report = problem.solve(0.5, None).unwrap();
        assert_eq!(report.strategy, ReducedStrategy::Newton, "{first}");
        assert!(report.residuals.largest() <= 1e-10);
        assert!(
            report.iterations.iter().any(|i| 0.0 < i.step && i.step < 1.0),
            "{first}"
        );
    }
}

/// What the search in the displacements took before the condensed form solved the problem is part of the account.
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
    assert_eq!(report.strategy, ReducedStrategy::Condensed);
    assert!(
        slept > Duration::ZERO && report.times.krylov >= slept,
        "{slept:?}"
    );
}
