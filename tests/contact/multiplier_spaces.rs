//! One contact problem with forces at nodes, on dual cells and on patches of merged facets.

use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, ContactSolution, FrictionCoefficient, FrictionCurve,
    LoadPath, NodeLaw, OrthotropicCoulomb, PlanarCoulomb, check_multipliers, inf_sup_constant,
};
use semismooth::fem::{
    ContactRows, ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh, MultiplierSpace,
};
use semismooth::sparse::Matrix;

use crate::random::Random;

fn system(dim: usize, n: usize) -> ElasticSystem {
    let mesh = if dim == 2 {
        Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2 * n, n]).unwrap()
    } else {
        Mesh::block([0.0; 3], [1.0; 3], [n; 3]).unwrap()
    };
    Elasticity::new(mesh, Material::isotropic(1.0, 0.277).unwrap())
        .fix("left")
        .assemble()
        .unwrap()
}

fn ground(dim: usize) -> Foundation {
    let mut up = [0.0; 3];
    up[dim - 1] = 1.0;
    Foundation::plane([0.0; 3], up)
}

fn solve<L: NodeLaw>(
    system: &ElasticSystem,
    multipliers: MultiplierSpace,
    law: L,
) -> (ContactSolution, ContactRows) {
    let dim = system.mesh().dim();
    let rows = system.contact_with("bottom", &ground(dim), multipliers).unwrap();
    let mut load = system
        .traction("top", |_| {
            let mut t = [0.0; 3];
            t[dim - 1] = -0.02;
            t
        })
        .unwrap();
    let pull = system.traction("right", |_| [0.01, 0.0, 0.0]).unwrap();
    load.iter_mut().zip(&pull).for_each(|(l, p)| *l += p);
    let tangential = rows.tangential.clone();
    let body = ContactBody::new(
        system.stiffness().clone(),
        rows.normal.clone(),
        tangential,
        LoadPath::constant(load),
    )
    .unwrap()
    .with_gap(rows.gap.clone())
    .unwrap();
    let problem = CondensedContact::new(body, law).unwrap();
    let x = problem.solve(0.0, None).unwrap();
    (problem.solution(&x).unwrap(), rows)
}

fn friction() -> FrictionCoefficient {
    FrictionCoefficient::uniform(FrictionCurve::constant(0.3).unwrap())
}

fn spaces(h: f64) -> [MultiplierSpace; 3] {
    [
        MultiplierSpace::Nodal,
        MultiplierSpace::DualCells,
        MultiplierSpace::Patches { size: 2.0 * h },
    ]
}

/// Resultants of the three spaces approach one another under refinement.
#[test]
fn resultants_converge() {
    let spread = |n: usize| {
        let system = system(2, n);
        let all = spaces(1.0 / n as f64).map(|m| solve(&system, m, PlanarCoulomb::new(friction())).0);
        let resultants = all.each_ref().map(ContactSolution::resultant);
        let mut largest = 0.0f64;
        for r in &resultants {
            assert!(r[0] > 0.0);
            for d in 0..2 {
                largest = largest.max((r[d] - resultants[0][d]).abs() / resultants[0][0]);
            }
        }
        for s in &all {
            assert!(
                s.residuals.largest() < 1e-11 && s.energy.imbalance().abs() < 1e-12 * s.energy.load.abs()
            );
        }
        let stored = all.map(|s| s.energy.stored);
        let energies = stored.map(|e| (e / stored[0] - 1.0).abs());
        (largest, energies[1].max(energies[2]))
    };
    let (coarse, fine) = (spread(4), spread(16));
    assert!(coarse.0 < 0.3 && fine.0 < 0.35 * coarse.0, "{coarse:?} {fine:?}");
    assert!(fine.1 < 0.35 * coarse.1, "{coarse:?} {fine:?}");
}

#[test]
fn in_space() {
    let system = system(3, 6);
    let all = spaces(1.0 / 6.0).map(|m| {
        solve(
            &system,
            m,
            OrthotropicCoulomb::new(friction(), friction().times(0.6)),
        )
    });
    let nodal = all[0].0.resultant();
    assert_eq!(all.each_ref().map(|s| s.0.nodes.len()), [42, 42, 9]);
    for (s, rows) in &all {
        let r = s.resultant();
        assert!(s.residuals.largest() < 1e-11);
        assert!((r[0] - nodal[0]).abs() < 0.1 * nodal[0] && (r[1] - nodal[1]).abs() < 0.1 * nodal[0]);
        // Lumped nodes lack the share of the clamped edge.
        let area = rows.areas.iter().sum::<f64>();
        assert!(
            (area - 1.0).abs() < 1e-12 || (area - 11.0 / 12.0).abs() < 1e-12,
            "{area}"
        );
    }
}

/// The mean of an affine displacement over a cell or patch is its value at the point of the multiplier; the areas sum up to that of the
/// boundary.
#[test]
fn means_of_affine_displacements() {
    for dim in [2, 3] {
        let mesh = if dim == 2 {
            Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [6, 3]).unwrap()
        } else {
            Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [4, 2, 2]).unwrap()
        };
        let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
            .fix("top")
            .assemble()
            .unwrap();
        for multipliers in [MultiplierSpace::DualCells, MultiplierSpace::Patches { size: 1.0 }] {
            let rows = system.contact_with("bottom", &ground(dim), multipliers).unwrap();
            assert!((rows.areas.iter().sum::<f64>() - 2.0).abs() < 1e-13);
            let mut u = vec![0.0; system.num_free()];
            for node in 0..system.mesh().num_nodes() {
                let x = system.mesh().points()[node];
                for d in 0..dim {
                    if let Some(dof) = system.dof(node, d) {
                        u[dof] = [0.1 + 0.3 * x[0], 0.2, 0.4 - 0.2 * x[0]][d];
                    }
                }
            }
            let mut v = vec![0.0; rows.nodes.len()];
            rows.tangential[0].mul_vec(&u, &mut v);
            for (v, (x, t)) in v.iter().zip(rows.points.iter().zip(&rows.tangents)) {
                let along = (0..dim)
                    .map(|d| t[0][d] * [0.1 + 0.3 * x[0], 0.2, 0.4 - 0.2 * x[0]][d])
                    .sum::<f64>();
                assert!((v - along).abs() < 1e-14);
            }
            assert!(check_multipliers(&rows.normal).is_ok());
        }
    }
}

/// The normal of a patch is that of ∫ν: of a curve, whatever the lengths of its facets, it is orthogonal to the chord. Of the dual cell of a
/// node it is that of half of the two facets beside it, which the nodal rows use, too.
#[test]
fn normals_of_patches_are_means_over_their_length() {
    let plain = Mesh::rectangle_graded(&[0.0, 0.1, 0.8, 1.0, 1.7, 2.0], &[0.0, 0.5, 1.0]).unwrap();
    let points: Vec<[f64; 3]> = (plain.points().iter())
        .map(|[x, y, _]| [*x, y + 0.1 * x * x * (1.0 - y), 0.0])
        .collect();
    let cells = (0..plain.num_cells()).map(|c| (plain.kind(c), plain.cell(c).to_vec()));
    let mut mesh = Mesh::new(2, points, cells).unwrap();
    for name in ["bottom", "top"] {
        let facets = plain.facet_group(name).unwrap().to_vec();
        mesh.add_facet_group(name, facets).unwrap();
    }
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .fix("top")
        .assemble()
        .unwrap();
    let rows = |multipliers| {
        let ground = Foundation::gap(|x| x[1]);
        system.contact_with("bottom", &ground, multipliers).unwrap()
    };
    // From (0, 0) to (2, 0.4).
    let whole = rows(MultiplierSpace::Patches { size: 4.0 });
    let chord = 2.0_f64.hypot(0.4);
    assert_eq!(whole.normals.len(), 1);
    let [x, y, _] = whole.normals[0];
    assert!(
        (x - 0.4 / chord).abs() < 1e-15 && (y + 2.0 / chord).abs() < 1e-15,
        "{x} {y}"
    );
    let (nodal, dual) = (rows(MultiplierSpace::Nodal), rows(MultiplierSpace::DualCells));
    assert_eq!(nodal.nodes, dual.nodes);
    for (a, b) in nodal.normals.iter().flatten().zip(dual.normals.iter().flatten()) {
        assert!((a - b).abs() < 1e-15, "{:?} {:?}", nodal.normals, dual.normals);
    }
}

/// Condition (1): more patches than displacements to see them.
#[test]
fn invisible_multipliers_are_refused() {
    let system = system(2, 2);
    let rows = system
        .contact_with("bottom", &ground(2), MultiplierSpace::Patches { size: 0.5 })
        .unwrap();
    let again: Vec<_> = rows
        .normal
        .triplets()
        .chain(rows.normal.triplets().map(|(i, j, v)| (i + 4, j, v)))
        .collect();
    let doubled = |m: &Matrix| Matrix::from_triplets(8, m.ncols(), &again).unwrap();
    let body = ContactBody::new(
        system.stiffness().clone(),
        doubled(&rows.normal),
        vec![doubled(&rows.tangential[0])],
        LoadPath::constant(vec![0.0; system.num_free()]),
    );
    assert_eq!(
        body.unwrap_err(),
        ContactError::InvisibleMultiplier { expected: 8, rank: 4 }
    );
    for size in [0.0, -1.0, f64::NAN] {
        let error = system.contact_with("bottom", &ground(2), MultiplierSpace::Patches { size });
        assert!(matches!(error, Err(FemError::PatchSize { .. })));
    }
    assert!(
        system
            .contact_with("nowhere", &ground(2), MultiplierSpace::DualCells)
            .is_err()
    );
}

/// Means of displacements are linear in the free ones only where those of the supports on a patch vanish.
#[test]
fn patches_next_to_supports_that_move_are_refused() {
    for (moved, fits) in [(0.0, true), (0.1, false)] {
        let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2]).unwrap();
        let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
            .fix_component("left", 0)
            .prescribe("left", 1, move |_| moved)
            .assemble()
            .unwrap();
        for multipliers in [MultiplierSpace::DualCells, MultiplierSpace::Patches { size: 1.0 }] {
            match system.contact_with("bottom", &ground(2), multipliers) {
                Ok(_) => assert!(fits),
                Err(FemError::ContactFixed { direction, .. }) => assert!(!fits && direction == "normal"),
                Err(e) => panic!("{e}"),
            }
        }
    }
}

/// A space compared with itself, its displacements in another order: β = 1, and rounding never makes β exceed 1.
#[test]
fn no_space_is_better_than_its_reference() {
    let mut random = Random::new(4);
    let n = 6;
    for _ in 0..60 {
        let rows: Vec<f64> = (0..n * n).map(|_| random.symmetric()).collect();
        let pairing: Vec<f64> = (0..n).map(|_| random.symmetric()).collect();
        let entry = |i: usize, j: usize| {
            let product: f64 = (0..n).map(|k| rows[i * n + k] * rows[j * n + k]).sum();
            product + if i == j { 1.0 } else { 0.0 }
        };
        let ordered = |at: &dyn Fn(usize) -> usize| {
            let metric: Vec<_> = (0..n * n)
                .map(|k| (k / n, k % n, entry(at(k / n), at(k % n))))
                .collect();
            let pairing: Vec<_> = (0..n).map(|k| (0, k, pairing[at(k)])).collect();
            (
                Matrix::from_triplets(n, n, &metric).unwrap(),
                Matrix::from_triplets(1, n, &pairing).unwrap(),
            )
        };
        let (here, there) = (ordered(&|k| k), ordered(&|k| n - 1 - k));
        let beta = inf_sup_constant((&here.0, &here.1), (&there.0, &there.1)).unwrap();
        assert!(beta <= 1.0 && beta > 1.0 - 1e-9, "{beta:e}");
    }
}
