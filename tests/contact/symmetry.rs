//! Half and quarter models: the contact nodes on planes of symmetry hold tangents, and the solution is that of the whole body.

use std::ops::ControlFlow;

use semismooth::contact::{
    CondensedContact, ContactBody, DelassusSolver, EvolutionOptions, FrictionCoefficient, FrictionCurve,
    Frictionless, FullContact, LoadPath, NodeLaw, OrthotropicCoulomb, PlanarCoulomb, ReducedBody,
    ReducedContact, ReducedOptions, evolve,
};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::fem::{ContactRows, ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh};
use semismooth::piecewise::PiecewiseSmooth;
use semismooth::piecewise::check::{CheckOptions, check};

use crate::random::Random;

/// A body on (−1, 1)^(d−1) × (0, 1), or its part with x_d ≥ 0 in each plane of symmetry, with a bottom that is curved downwards; pressed at
/// the top, whose tangential displacements α = 1 widens: u_x = 0.004 x.
fn body(whole: bool, dim: usize, n: usize) -> ElasticSystem {
    let (low, across) = if whole { (-1.0, 2 * n) } else { (0.0, n) };
    let grid = match dim {
        2 => Mesh::rectangle([low, 0.0], [1.0, 1.0], [across, n]).unwrap(),
        _ => Mesh::block([low, low, 0.0], [1.0; 3], [across, across, n]).unwrap(),
    };
    let up = dim - 1;
    let points = grid.points().iter().map(|p| {
        let mut p = *p;
        let rise: f64 = (0..up).map(|d| 0.05 * p[d] * p[d]).sum();
        p[up] += rise * (1.0 - p[up]);
        p
    });
    let cells = (0..grid.num_cells()).map(|c| (grid.kind(c), grid.cell(c).to_vec()));
    let mut mesh = Mesh::new(dim, points.collect(), cells).unwrap();
    mesh.mark_boundary("bottom", |f| f.normal[up] < -0.5);
    mesh.mark_boundary("top", |f| f.normal[up] > 0.5);
    let mut body =
        Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap()).prescribe("top", up, |_| -0.02);
    if dim == 3 {
        body = body.prescribe("top", 1, |_| 0.0);
    }
    body = body.prescribe("top", 0, |_| 0.0);
    if !whole {
        let mut mesh = body.mesh().clone();
        for d in 0..up {
            mesh.mark_boundary(["x", "y"][d], |f| f.normal[d] < -0.99);
        }
        body = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap());
        for d in 0..up {
            body = body.fix_component(["x", "y"][d], d);
        }
        body = body.prescribe("top", up, |_| -0.02).prescribe("top", 0, |_| 0.0);
        if dim == 3 {
            body = body.prescribe("top", 1, |_| 0.0);
        }
    }
    body.assemble().unwrap()
}

/// Contact rows along the normals of the boundary, with a gap, and the load of the widening.
fn rows(system: &ElasticSystem) -> (ContactRows, LoadPath) {
    let rows = system
        .contact(
            "bottom",
            &Foundation::gap(|x| 0.006 * (x[0] * x[0] + x[1] * x[1])),
        )
        .unwrap();
    let widen = system.motion("top", 0, |x| 0.004 * x[0]).unwrap();
    rows.check_supports(system, &widen).unwrap();
    (rows, LoadPath::affine(system.supports(), widen))
}

fn contact_body((rows, load): &(ContactRows, LoadPath), system: &ElasticSystem) -> ContactBody {
    semismooth::contact_body(system, rows, load.clone()).unwrap()
}

/// Forces of a part against those of the whole body: shared by the parts that meet at a node.
fn compare(part: (&ContactRows, &[f64]), whole: (&ContactRows, &[f64]), dim: usize) -> f64 {
    let (p, all) = (part.0.nodes.len(), whole.0.nodes.len());
    let size = whole.1[..all].iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let mut worst = 0.0f64;
    for (i, at) in part.0.points.iter().enumerate() {
        let near = |q: &[f64; 3]| (0..3).all(|d| (q[d] - at[d]).abs() < 1e-12);
        let j = whole.0.points.iter().position(near).unwrap();
        let share: f64 = (0..dim - 1)
            .map(|d| if at[d] == 0.0 { 0.5 } else { 1.0 })
            .product();
        assert!((part.0.areas[i] - share * whole.0.areas[j]).abs() < 1e-14);
        for d in 0..3 {
            assert!((part.0.normals[i][d] - whole.0.normals[j][d]).abs() < 1e-14);
        }
        for b in 0..dim {
            worst = worst.max((part.1[b * p + i] - share * whole.1[b * all + j]).abs());
        }
    }
    worst / size
}

/// Solves the part and the whole in condensed form at α = 0, then goes to α = 1 level by level; the other forms are solved at α = 1.
fn same_as_whole<L: NodeLaw + Clone>(dim: usize, n: usize, law: impl Fn(usize) -> L) {
    let systems = [false, true].map(|whole| body(whole, dim, n));
    let parts = systems.each_ref().map(rows);
    assert_eq!(parts[1].0.num_held(), 0);
    assert_eq!(parts[0].0.num_held(), if dim == 2 { 1 } else { 2 * n + 1 });
    let levels = [0, 1].map(|k| {
        let body = contact_body(&parts[k], &systems[k]);
        assert_eq!(body.num_held(), parts[k].0.num_held());
        let mut problem = CondensedContact::new(body, law(parts[k].0.nodes.len())).unwrap();
        let mut x = vec![problem.solve(0.0, None).unwrap()];
        let options = EvolutionOptions::default();
        let steps = evolve(&mut problem, &x[0], &[0.5, 1.0], &options, |_| {
            ControlFlow::Continue(())
        })
        .unwrap();
        x.extend(steps.into_iter().map(|s| s.x));
        x
    });
    for (part, whole) in levels[0].iter().zip(&levels[1]) {
        let difference = compare((&parts[0].0, part), (&parts[1].0, whole), dim);
        assert!(difference < 1e-10, "{difference:e}");
    }
    let (own, system) = (&parts[0], &systems[0]);
    let p = own.0.nodes.len();
    let full = FullContact::new(contact_body(own, system), law(p)).unwrap();
    let x = full.solve(0.0, None).unwrap();
    let forces = &x[system.num_free()..];
    assert!(compare((&own.0, forces), (&parts[1].0, &levels[1][0]), dim) < 1e-10);
    let reduced = ReducedBody::new(
        system.nodal_stiffness().unwrap(),
        &own.0.normal,
        &own.0.tangential,
        own.1.clone(),
    );
    let reduced = reduced.unwrap().with_gap(own.0.gap.clone()).unwrap();
    let back = CondensedContact::new(reduced.to_contact_body().unwrap(), law(p)).unwrap();
    let x = back.solve(0.0, None).unwrap();
    assert!(compare((&own.0, &x), (&parts[1].0, &levels[1][0]), dim) < 1e-10);
    let options = ReducedOptions::default().with_tolerance(1e-12);
    let mut reduced = ReducedContact::new(reduced, law(p), options).unwrap();
    let found = reduced.solve(0.0, None).unwrap();
    let nodes = reduced.solution(0.0, &found.displacements).unwrap().nodes;
    let of = |f: fn(&semismooth::contact::LocalValues) -> f64| nodes.iter().map(f).collect::<Vec<_>>();
    let forces = [of(|v| v.pressure), of(|v| v.traction[0]), of(|v| v.traction[1])].concat();
    assert!(compare((&own.0, &forces), (&parts[1].0, &levels[1][0]), dim) < 1e-8);
}

fn coefficient(f: f64) -> FrictionCoefficient {
    FrictionCoefficient::constant(f).unwrap()
}

#[test]
fn half_of_a_plane_body_is_the_whole() {
    for f in [0.0, 0.05, 0.3] {
        same_as_whole(2, 6, |_| PlanarCoulomb::new(coefficient(f)));
    }
    same_as_whole(2, 6, |_| Frictionless::plane());
    let falling = FrictionCurve::exponential(0.3, 0.1, 300.0).unwrap();
    same_as_whole(2, 6, |_| {
        PlanarCoulomb::new(FrictionCoefficient::uniform(falling.clone()))
    });
}

/// The disc of friction becomes an interval where one tangent is held.
#[test]
fn quarter_of_a_solid_is_the_whole() {
    for f in [[0.05, 0.05], [0.3, 0.1]] {
        same_as_whole(3, 3, |_| {
            OrthotropicCoulomb::new(coefficient(f[0]), coefficient(f[1]))
        });
    }
    same_as_whole(3, 3, |_| Frictionless::space());
    let falling = FrictionCurve::exponential(0.3, 0.1, 300.0).unwrap();
    same_as_whole(3, 3, |_| {
        OrthotropicCoulomb::isotropic(FrictionCoefficient::uniform(falling.clone()))
    });
}

/// Both forms have the same proven list of one solution, as has the Delassus form; derivatives of both are those of the map.
#[test]
fn lists_of_half_models_are_proven() {
    let system = body(false, 2, 3);
    let parts = rows(&system);
    let law = || PlanarCoulomb::new(coefficient(0.2));
    let condensed = CondensedContact::new(contact_body(&parts, &system), law()).unwrap();
    let full = FullContact::new(contact_body(&parts, &system), law()).unwrap();
    let options = EnumerationOptions::default();
    let (first, second) = (
        all_solutions(&condensed, 0.5, &options).unwrap(),
        all_solutions(&full, 0.5, &options).unwrap(),
    );
    assert!(first.completeness.is_complete() && first.solutions.len() == 1 && first.continua.is_empty());
    assert!(second.completeness.is_complete() && second.solutions.len() == 1 && second.continua.is_empty());
    let (x, y) = (&first.solutions[0].x, &second.solutions[0].x[system.num_free()..]);
    assert!(x.iter().zip(y).all(|(x, y)| (x - y).abs() < 1e-12));
    let found = DelassusSolver::default()
        .solve(&condensed.delassus(0.5).unwrap())
        .unwrap();
    let z = condensed.point_of_reactions(0.5, &found.r).unwrap();
    assert!(x.iter().zip(&z).all(|(x, z)| (x - z).abs() < 1e-9));
    // The node at x = 0 comes first; its traction is 0 though the point of the check is not a solution.
    assert_eq!(parts.0.held[0], [true, false]);
    assert!(x[parts.0.nodes.len()].abs() < 1e-14);
    for (map, x) in [
        (&condensed as &dyn PiecewiseSmooth, x),
        (&full, &second.solutions[0].x),
    ] {
        let size = x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let mut random = Random::new(3);
        let samples: Vec<Vec<f64>> = (0..20)
            .map(|_| x.iter().map(|v| v + 0.1 * size * random.symmetric()).collect())
            .collect();
        let report = check(map, &samples, &CheckOptions::default()).unwrap();
        assert!(report.points == 20);
    }
}

/// A node whose normal displacement is held leaves contact, and a support that moves along a tangent is no plane of symmetry.
#[test]
fn held_normals_leave_and_moving_supports_are_refused() {
    let mesh = Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [4, 4]).unwrap();
    let material = Material::isotropic(1.0, 0.3).unwrap();
    let ground = Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]);
    let rolling = Elasticity::new(mesh.clone(), material.clone())
        .fix("top")
        .fix_component("left", 1)
        .assemble()
        .unwrap();
    for foundation in [&ground, &Foundation::gap(|_| 0.0)] {
        let rows = rolling.contact("bottom", foundation).unwrap();
        assert_eq!((rows.nodes.len(), rows.num_held()), (4, 0));
        assert!(rows.points.iter().all(|p| p[0] > 0.0));
    }
    let half = Elasticity::new(mesh, material)
        .fix("top")
        .fix_component("left", 0)
        .assemble()
        .unwrap();
    let rows = half.contact("bottom", &ground).unwrap();
    let moved = half.motion("left", 0, |_| 0.1).unwrap();
    assert!(matches!(
        rows.check_supports(&half, &moved),
        Err(FemError::ContactFixed { .. })
    ));
    assert_eq!(rows.check_supports(&half, half.supports()), Ok(()));
}
