//! Prescribed displacements and supports that move: energies, work, reactions and fields, each against independent sums.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use semismooth::contact::{
    CondensedContact, ContactBody, ContactOptions, EvolutionOptions, FrictionCoefficient, FrictionCurve,
    FullContact, LoadCase, LoadPath, OrthotropicCoulomb, PlanarCoulomb, evolve,
};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination};
use semismooth::fem::{ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh};
use semismooth::sparse::Matrix;

const NU: f64 = 0.3;

/// A block (0, 2) × (0, 1) of triangles, E = 1, its top pressed down by 0.02; α moves the top 0.03 to the right.
fn sheared_block(n: usize) -> (Mesh, ElasticSystem, ContactBody) {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2 * n, n]).unwrap();
    let mesh = mesh.simplices().unwrap();
    let system = Elasticity::new(mesh.clone(), Material::isotropic(1.0, NU).unwrap())
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| -0.02)
        .assemble()
        .unwrap();
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let shear = system.motion("top", 0, |_| 0.03).unwrap();
    let load = LoadPath::affine(system.supports(), shear);
    let a = system.stiffness().clone();
    let body = ContactBody::new(a, rows.normal, rows.tangential, load).unwrap();
    (mesh, system, body.with_gap(rows.gap).unwrap())
}

fn law() -> PlanarCoulomb {
    PlanarCoulomb::new(FrictionCoefficient::constant(0.4).unwrap())
}

/// The strain energy in plane strain, triangle by triangle, of nodal displacements.
fn strain_energy(mesh: &Mesh, u: &[f64]) -> f64 {
    let mu = 1.0 / (2.0 * (1.0 + NU));
    let lambda = NU / ((1.0 + NU) * (1.0 - 2.0 * NU));
    let of_cell = |c: usize| {
        let nodes = mesh.cell(c);
        let [p, q, r] = [0, 1, 2].map(|k| mesh.points()[nodes[k]]);
        let twice = (q[0] - p[0]) * (r[1] - p[1]) - (r[0] - p[0]) * (q[1] - p[1]);
        let gradient = [
            [q[1] - r[1], r[0] - q[0]],
            [r[1] - p[1], p[0] - r[0]],
            [p[1] - q[1], q[0] - p[0]],
        ];
        let mut h = [[0.0; 2]; 2];
        for (k, g) in gradient.iter().enumerate() {
            for d in 0..2 {
                for e in 0..2 {
                    h[d][e] += u[2 * nodes[k] + d] * g[e] / twice;
                }
            }
        }
        let shear = 0.5 * (h[0][1] + h[1][0]);
        let squares = h[0][0].powi(2) + h[1][1].powi(2) + 2.0 * shear.powi(2);
        0.5 * twice.abs() * (0.5 * lambda * (h[0][0] + h[1][1]).powi(2) + mu * squares)
    };
    (0..mesh.num_cells()).map(of_cell).sum()
}

#[test]
fn energies_are_those_of_the_whole_body() {
    let (mesh, system, body) = sheared_block(4);
    let condensed = CondensedContact::new(body.clone(), law()).unwrap();
    let full = FullContact::new(body, law()).unwrap();
    for alpha in [0.0, 0.3, 1.0] {
        let x = condensed.solve(alpha, None).unwrap();
        let (free, supports) = (
            condensed.displacements(&x).unwrap(),
            condensed.support_displacements(&x).unwrap(),
        );
        let u = system.displacements(&free, &supports).unwrap();
        for &node in mesh.facet_group("top").unwrap().iter().flatten() {
            assert_eq!([u[2 * node], u[2 * node + 1]], [0.03 * alpha, -0.02]);
        }
        let exact = strain_energy(&mesh, &u);
        let stresses = system.stresses(&free, &supports).unwrap();
        // ½ Σ area σ : ε with ε from σ.
        let by_stress: f64 = (0..mesh.num_cells())
            .map(|c| {
                let [a, b, t] = [0, 1, 3].map(|k| stresses[c][k]);
                let density = (1.0 - NU * NU) * (a * a + b * b) - 2.0 * NU * (1.0 + NU) * a * b
                    + 2.0 * (1.0 + NU) * t * t;
                let [p, q, r] = [0, 1, 2].map(|k| mesh.points()[mesh.cell(c)[k]]);
                0.25 * ((q[0] - p[0]) * (r[1] - p[1]) - (r[0] - p[0]) * (q[1] - p[1])).abs() * density
            })
            .sum();
        assert!((by_stress - exact).abs() < 1e-12 * exact, "{by_stress} {exact}");
        // The reactions balance the contact forces.
        let reactions = system.reactions(&free, &supports).unwrap();
        let solution = condensed.solution(&x).unwrap();
        let [normal, tangential, _] = solution.resultant();
        let sum = |d: usize| reactions.iter().skip(d).step_by(2).sum::<f64>();
        assert!((sum(0) - tangential).abs() < 1e-12 && (sum(1) + normal).abs() < 1e-12);
        let work: f64 = reactions.iter().zip(&supports).map(|(r, g)| r * g).sum();
        let y = [free, x].concat();
        for e in [solution.energy, full.solution(&y).unwrap().energy] {
            assert!((e.stored - exact).abs() < 1e-12 * exact, "{} {exact}", e.stored);
            assert!((e.load - work).abs() < 1e-12 * exact, "{} {work}", e.load);
            assert!(e.imbalance().abs() < 1e-12 * exact);
        }
    }
}

#[test]
fn reactions_in_space_balance_the_contact_forces() {
    let mesh = Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [4, 2, 2]).unwrap();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, NU).unwrap())
        .prescribe("top", 0, |_| 0.004)
        .prescribe("top", 1, |_| -0.007)
        .prescribe("top", 2, |_| -0.02)
        .assemble()
        .unwrap();
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]))
        .unwrap();
    let tangential = rows.tangential;
    let load = LoadPath::constant(system.supports());
    let body = ContactBody::new(system.stiffness().clone(), rows.normal, tangential, load).unwrap();
    let law = OrthotropicCoulomb::isotropic(FrictionCoefficient::constant(0.4).unwrap());
    let condensed = CondensedContact::new(body.with_gap(rows.gap).unwrap(), law).unwrap();
    let x = condensed.solve(0.0, None).unwrap();
    let reactions = system
        .reactions(
            &condensed.displacements(&x).unwrap(),
            &condensed.support_displacements(&x).unwrap(),
        )
        .unwrap();
    let sum = |d: usize| reactions.iter().skip(d).step_by(3).sum::<f64>();
    let [normal, first, second] = condensed.solution(&x).unwrap().resultant();
    for (d, force) in [first, second, -normal].into_iter().enumerate() {
        assert!(
            force.abs() > 1e-3 && (sum(d) - force).abs() < 1e-12,
            "{d}: {} {force}",
            sum(d)
        );
    }
}

#[test]
fn work_of_supports_that_move() {
    let (mesh, system, body) = sheared_block(4);
    let mut problem = CondensedContact::new(body, law()).unwrap();
    let start = problem.solve(0.0, None).unwrap();
    let levels: Vec<f64> = (1..=40).map(|k| f64::from(k) / 40.0).collect();
    let energy = |problem: &CondensedContact<PlanarCoulomb>, x: &[f64]| {
        let supports = problem.support_displacements(x).unwrap();
        let u = system.displacements(&problem.displacements(x).unwrap(), &supports);
        strain_energy(&mesh, &u.unwrap())
    };
    let mut before = (
        energy(&problem, &start),
        problem.solution(&start).unwrap().resultant()[1],
    );
    let (mut work, mut exact) = (0.0, 0.0);
    let history = evolve(
        &mut problem,
        &start,
        &levels,
        &EvolutionOptions::default(),
        |_| ControlFlow::Continue(()),
    )
    .unwrap();
    for s in &history {
        let now = (energy(&problem, &s.x), s.solution.resultant()[1]);
        let size = before.0 + now.0;
        assert!((s.stored - (now.0 - before.0)).abs() < 1e-12 * size);
        if s.arrival.is_followed() {
            let defect = s.work - s.stored - s.dissipated;
            assert!(defect.abs() < 1e-10 * size, "{defect:e} at {}", s.level);
        }
        work += s.work;
        exact += 0.5 * (now.1 + before.1) * 0.03 / 40.0;
        before = now;
    }
    assert!((work - exact).abs() < 2e-3 * exact, "{work} {exact}");
    assert!(history.iter().map(|s| s.dissipated).sum::<f64>() > 0.1 * work);
}

/// Two amplitudes: both cases of the supports count, and so does their interaction.
#[test]
fn several_cases_with_amplitudes() {
    let (mesh, system, body) = sheared_block(3);
    let press = system.motion("top", 1, |x| -0.01 - 0.002 * x[0]).unwrap();
    let shear = system.motion("top", 0, |_| 0.03).unwrap();
    let push = system.traction("right", |_| [0.002, 0.0, 0.0]).unwrap();
    let shear = shear.plus(push).unwrap();
    let load = LoadPath::cases(system.supports(), [press, shear], |a, value, rate| {
        (value[0], value[1]) = (a * a, a.sin());
        (rate[0], rate[1]) = (2.0 * a, a.cos());
    });
    let body = body.with_load(load).unwrap();
    let full = FullContact::new(body, law()).unwrap();
    let condensed = full.condensed().unwrap();
    let x = condensed.solve(0.0, None).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.5));
    let branch = Branch::follow(&condensed, &x, Direction::Increasing, options.clone()).unwrap();
    assert_eq!(branch.termination, Termination::ParameterRange);
    let y = condensed.expand(&x).unwrap();
    let other = Branch::follow(&full, &y, Direction::Increasing, options).unwrap();
    assert!(!branch.transitions.is_empty());
    assert_eq!(branch.transitions.len(), other.transitions.len());
    for (a, b) in branch.transitions.iter().zip(&other.transitions) {
        assert!((a.parameter() - b.parameter()).abs() < 1e-9);
    }
    let end = &branch.points.last().unwrap().x;
    let supports = condensed.support_displacements(end).unwrap();
    let u = system
        .displacements(&condensed.displacements(end).unwrap(), &supports)
        .unwrap();
    for &node in mesh.facet_group("top").unwrap().iter().flatten() {
        let along = mesh.points()[node][0];
        assert!((u[2 * node] - 0.03 * 1.5f64.sin()).abs() < 1e-15);
        assert!((u[2 * node + 1] + 0.02 + 2.25 * (0.01 + 0.002 * along)).abs() < 1e-15);
    }
    let (energy, exact) = (condensed.solution(end).unwrap().energy, strain_energy(&mesh, &u));
    assert!((energy.stored - exact).abs() < 1e-12 * exact);
    assert!(energy.imbalance().abs() < 1e-12 * exact);
}

/// A node on a spring of stiffness 1, pulled by a spring of stiffness 9 over the ground, F(ξ) = 0.2 + 0.6 exp(−10 ξ): under a prescribed
/// force the curve folds and the body jumps; with the end of the stiff spring prescribed it does not.
#[test]
fn displacement_control_where_a_force_jumps() {
    let row = |r| Matrix::from_rows(&[r]).unwrap();
    let friction = |xi: f64| 0.2 + 0.6 * (-10.0 * xi).exp();
    let problem = |stiffness: f64, slope: LoadCase| {
        let a = Matrix::from_rows(&[[1.0, 0.0], [0.0, stiffness]]).unwrap();
        let load = LoadPath::affine(vec![1.0, 0.0], slope);
        let body = ContactBody::new(a, row([1.0, 0.0]), vec![row([0.0, 1.0])], load).unwrap();
        let curve = FrictionCurve::exponential(0.8, 0.2, 0.1).unwrap();
        CondensedContact::new(body, PlanarCoulomb::new(FrictionCoefficient::uniform(curve))).unwrap()
    };
    let levels: Vec<f64> = (1..=50).map(|k| 0.043 * f64::from(k)).collect();
    let run = |mut problem: CondensedContact<PlanarCoulomb>| {
        let start = problem.solve(0.0, None).unwrap();
        evolve(
            &mut problem,
            &start,
            &levels,
            &EvolutionOptions::default(),
            |_| ControlFlow::Continue(()),
        )
        .unwrap()
    };
    let by_force = run(problem(1.0, vec![0.0, 1.0].into()));
    let jumps = by_force.iter().filter(|s| !s.arrival.is_followed());
    assert!(jumps.clone().count() >= 1 && jumps.clone().all(|s| !s.folds.is_empty()));
    let spring = LoadCase::of_supports(vec![1.0], vec![0.0, 9.0], vec![9.0]).unwrap();
    let moved = run(problem(10.0, spring));
    assert!(moved.iter().all(|s| s.arrival.is_followed()));
    // The force at the support rises, falls while friction does, and rises again.
    let mut forces = Vec::new();
    for s in &moved {
        let u = s.displacements[1];
        let reaction = 9.0 * (s.level - u);
        let ground = s.solution.nodes[0].traction[0];
        assert!((u + ground - reaction).abs() < 1e-10);
        if u > 1e-9 {
            assert!((ground - friction(u)).abs() < 1e-9, "{ground} {}", friction(u));
        }
        forces.push(reaction);
    }
    assert!(forces.windows(2).any(|w| w[1] < w[0]) && forces.last() > forces.first());
}

#[test]
fn what_does_not_belong_to_supports_is_refused() {
    let (_, system, body) = sheared_block(2);
    let e = system.motion("bottom", 0, |_| 1.0).unwrap_err();
    assert!(matches!(e, FemError::NotPrescribed { component: 0, .. }), "{e}");
    assert!(matches!(
        system.motion("top", 2, |_| 1.0),
        Err(FemError::Component { .. })
    ));
    assert!(matches!(
        system.motion("top", 0, |_| f64::NAN),
        Err(FemError::NotFinite { .. })
    ));
    // Displacements without those of the supports would be wrong.
    let free = vec![0.0; system.num_free()];
    for e in [
        system.displacements(&free, &[]).unwrap_err(),
        system.stresses(&free, &[]).unwrap_err().clone(),
    ] {
        assert!(e.to_string().contains("supports"), "{e}");
    }
    let n = body.num_displacements();
    let short = LoadCase::of_supports(vec![0.0; 3], vec![0.0; n], vec![0.0; 3]).unwrap();
    assert!(
        body.with_load(LoadPath::affine(system.supports(), short))
            .is_err()
    );
    assert!(LoadCase::of_supports(vec![0.0; 3], vec![0.0; n], vec![0.0; 2]).is_err());
    assert!(system.supports().clone().plus(vec![0.0; 1]).is_err());
}

/// Forces beside supports that move, in either order, and those of two motions add up.
#[test]
fn sums_of_load_cases_keep_their_supports() {
    let (_, system, _) = sheared_block(2);
    let (pressed, sheared) = (system.supports(), system.motion("top", 0, |_| 0.03).unwrap());
    let forces = vec![0.25; system.num_free()];
    let with = |case: LoadCase, other: &LoadCase| case.plus(other).unwrap();
    let sums = [
        with(pressed.clone(), &forces.clone().into()),
        with(forces.clone().into(), pressed),
    ];
    assert_eq!(sums[0], sums[1]);
    assert_eq!(sums[0].displacements(), pressed.displacements());
    let both = with(pressed.clone(), &sheared);
    let terms = pressed.displacements().iter().zip(sheared.displacements());
    assert!(
        both.displacements()
            .iter()
            .eq(terms.map(|(a, b)| a + b).collect::<Vec<_>>().iter())
    );
    let terms = pressed.forces().iter().zip(sheared.forces());
    assert!(
        both.forces()
            .iter()
            .eq(terms.map(|(a, b)| a + b).collect::<Vec<_>>().iter())
    );
}

/// A coefficient of friction that varies within slips far below those of the problem, on which Newton's method cycles: the observer is
/// called within each attempt (80 000 evaluations of the coefficient, at most 2 500 between two calls), and not again once it stops.
#[test]
fn observers_are_called_within_long_attempts() {
    let evaluations = Arc::new(AtomicUsize::new(0));
    let counted = evaluations.clone();
    let friction = FrictionCoefficient::function(move |_, slip, _| {
        counted.fetch_add(1, Ordering::Relaxed);
        let phase = 1e9 * slip;
        [0.5 + 0.4 * phase.sin(), 4e8 * phase.cos(), 0.0]
    });
    let (_, _, body) = sheared_block(4);
    let problem = CondensedContact::new(body, PlanarCoulomb::new(friction)).unwrap();
    let search = |limit: usize| {
        let (mut most, mut before, mut looks) = (0, 0, 0);
        evaluations.store(0, Ordering::Relaxed);
        let found = problem.solve_observed(1.0, None, &ContactOptions::default(), |_| {
            let now = evaluations.load(Ordering::Relaxed);
            (most, before, looks) = (most.max(now - before), now, looks + 1);
            match looks < limit {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            }
        });
        let all = evaluations.load(Ordering::Relaxed);
        (found, most.max(all - before), looks, all)
    };
    let (found, most, looks, all) = search(usize::MAX);
    assert!(found.is_ok() && all > 10_000 && most <= 2_500, "{most} of {all}");
    for limit in [1, 2, looks / 3, looks / 2, looks - 1] {
        let (stopped, most, seen, _) = search(limit);
        assert!(
            stopped.unwrap_err().is_interrupted() && seen == limit && most <= 2_500,
            "{limit}"
        );
    }
}
