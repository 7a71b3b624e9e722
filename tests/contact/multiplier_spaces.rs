//! One contact problem with forces at nodes, on dual cells and of P_s on partitions of the boundary.

use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, ContactSolution, FrictionCoefficient, FrictionCurve,
    LoadPath, NodeLaw, OrthotropicCoulomb, PlanarCoulomb, check_multipliers, inf_sup_constant,
};
use semismooth::fem::{
    CellKind, ContactRows, Degree, ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh,
    MultiplierSpace, Partition,
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

fn merged(k: usize, degree: Degree) -> MultiplierSpace {
    let partition = Partition::Merged(k);
    MultiplierSpace::Piecewise { partition, degree }
}

fn spaces() -> [MultiplierSpace; 5] {
    [
        MultiplierSpace::Nodal,
        MultiplierSpace::DualCells,
        merged(2, Degree::Constant),
        merged(2, Degree::Linear),
        merged(2, Degree::Continuous),
    ]
}

/// Resultants of the spaces approach one another under refinement.
#[test]
fn resultants_converge() {
    let spread = |n: usize| {
        let system = system(2, n);
        let all = spaces().map(|m| solve(&system, m, PlanarCoulomb::new(friction())).0);
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
        (largest, energies.into_iter().fold(0.0, f64::max))
    };
    let (coarse, fine) = (spread(4), spread(16));
    assert!(coarse.0 < 0.3 && fine.0 < 0.35 * coarse.0, "{coarse:?} {fine:?}");
    assert!(fine.1 < 0.35 * coarse.1, "{coarse:?} {fine:?}");
}

#[test]
fn in_space() {
    let system = system(3, 6);
    let all = spaces().map(|m| {
        solve(
            &system,
            m,
            OrthotropicCoulomb::new(friction(), friction().times(0.6)),
        )
    });
    let nodal = all[0].0.resultant();
    assert_eq!(all.each_ref().map(|s| s.0.nodes.len()), [42, 42, 9, 36, 16]);
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
        for multipliers in spaces().into_iter().skip(1) {
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
    let whole = rows(merged(5, Degree::Constant));
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
        .contact_with("bottom", &ground(2), merged(1, Degree::Constant))
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
        for multipliers in spaces().into_iter().skip(1) {
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

const DEGREES: [Degree; 3] = [Degree::Constant, Degree::Linear, Degree::Continuous];

fn held_above(mesh: Mesh) -> ElasticSystem {
    let body = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap());
    body.fix("top").assemble().unwrap()
}

fn on_coarse(mesh: &Mesh, degree: Degree) -> MultiplierSpace {
    let partition = Partition::Coarse {
        mesh: Box::new(mesh.clone()),
        facets: "bottom".into(),
    };
    MultiplierSpace::Piecewise { partition, degree }
}

/// The same T_H as a coarser mesh, as groups of facets, and as merged facets.
#[test]
fn partitions_are_the_same_however_they_are_given() {
    for dim in [2, 3] {
        let coarse = match dim {
            2 => Mesh::rectangle_graded(&[0.0, 0.5, 1.2, 2.0], &[0.0, 1.0]),
            _ => Mesh::block_graded(&[0.0, 0.5, 1.2], &[0.0, 0.4, 1.0], &[0.0, 1.0]),
        };
        let coarse = coarse.unwrap();
        let mut fine = coarse.refined().unwrap();
        // Each facet of the coarse mesh is divided into the next 2 or 4 of the fine one.
        let facets = fine.facet_group("bottom").unwrap().to_vec();
        let names: Vec<String> = (0..facets.len() >> (dim - 1))
            .map(|k| format!("element {k}"))
            .collect();
        for (name, own) in names.iter().zip(facets.chunks(1 << (dim - 1))) {
            fine.add_facet_group(name, own.to_vec()).unwrap();
        }
        let system = held_above(fine);
        for degree in DEGREES {
            let rows = |partition| {
                let space = MultiplierSpace::Piecewise { partition, degree };
                system.contact_with("bottom", &ground(dim), space).unwrap()
            };
            let first = rows(Partition::Merged(2));
            let facets = "bottom".into();
            let mesh = Box::new(coarse.clone());
            for other in [
                rows(Partition::Groups(names.clone())),
                rows(Partition::Coarse { mesh, facets }),
            ] {
                assert_eq!(first.nodes, other.nodes);
                let dense = |rows: &ContactRows| {
                    let n = system.num_free();
                    let mut all = rows.areas.clone();
                    for m in std::iter::once(&rows.normal).chain(&rows.tangential) {
                        (0..m.nrows() * n).for_each(|k| all.push(m.get(k / n, k % n)));
                    }
                    all
                };
                for (a, b) in dense(&first).iter().zip(dense(&other)) {
                    assert!((a - b).abs() < 1e-14, "{dim} {degree:?} {a} {b}");
                }
            }
        }
    }
}

/// ∫ψ u_ν for elements that cut facets, against Simpson's rule between all lines of both meshes, which is exact for products of linear
/// functions; in space for products of those in x and in y.
#[test]
fn elements_may_cut_facets() {
    let (fine, coarse) = ([0.0, 0.3, 0.7, 1.1, 1.6, 2.0], [0.0, 0.55, 1.3, 2.0]);
    let hat = |lines: &[f64], k: usize, x: f64| -> f64 {
        let up = |a: f64, b: f64| (x - a) / (b - a);
        match k {
            _ if k > 0 && x <= lines[k] => up(lines[k - 1], lines[k]).max(0.0),
            _ if k + 1 < lines.len() && x >= lines[k] => up(lines[k + 1], lines[k]).max(0.0),
            _ => f64::from(x == lines[k]),
        }
    };
    let mut all = [&fine[..], &coarse].concat();
    all.sort_by(f64::total_cmp);
    let integral = |f: &dyn Fn(f64) -> f64| -> f64 {
        let between = |w: &[f64]| (w[1] - w[0]) / 6.0 * (f(w[0]) + 4.0 * f(0.5 * (w[0] + w[1])) + f(w[1]));
        all.windows(2).map(between).sum()
    };
    // The displacement down, of the nodes.
    let value = |x: f64| (2.3 * x).sin() + 0.4 * x * x;
    let u = |x: f64| {
        (0..fine.len())
            .map(|k| value(fine[k]) * hat(&fine, k, x))
            .sum::<f64>()
    };
    let one: Vec<f64> = (0..coarse.len())
        .map(|i| integral(&|x| hat(&coarse, i, x)))
        .collect();
    let mean: Vec<f64> = (0..coarse.len())
        .map(|i| integral(&|x| hat(&coarse, i, x) * u(x)) / one[i])
        .collect();
    for dim in [2, 3] {
        let meshes = [&fine[..], &coarse].map(|lines| match dim {
            2 => Mesh::rectangle_graded(lines, &[0.0, 1.0]).unwrap(),
            _ => Mesh::block_graded(lines, lines, &[0.0, 1.0]).unwrap(),
        });
        let system = held_above(meshes[0].clone());
        let rows = system
            .contact_with("bottom", &ground(dim), on_coarse(&meshes[1], Degree::Continuous))
            .unwrap();
        let mut displacements = vec![0.0; system.num_free()];
        for (node, x) in system.mesh().points().iter().enumerate() {
            if let Some(dof) = system.dof(node, dim - 1) {
                displacements[dof] = -(0..dim - 1).map(|d| value(x[d])).product::<f64>();
            }
        }
        let mut normal = vec![0.0; rows.nodes.len()];
        rows.normal.mul_vec(&displacements, &mut normal);
        // In the order of the centroids, by x, then y.
        for (i, found) in normal.iter().enumerate() {
            let (a, b) = match dim {
                2 => (i, None),
                _ => (i / coarse.len(), Some(i % coarse.len())),
            };
            let exact = mean[a] * b.map_or(1.0, |b| mean[b]);
            let area = one[a] * b.map_or(1.0, |b| one[b]);
            assert!((found - exact).abs() < 1e-14, "{dim} {i}: {found} {exact}");
            assert!((rows.areas[i] - area).abs() < 1e-14);
        }
    }
}

/// On a curve the pairing has the normal of each facet: ∫u_ν over an element is the flux of a linear displacement through its chords.
#[test]
fn pairings_on_curves_are_exact() {
    let angles = [0.0, 0.1, 0.35, 0.5, 0.8];
    let at = |r: f64, a: f64| [r * a.sin(), 2.0 - r * a.cos(), 0.0];
    let points: Vec<[f64; 3]> = [2.0, 1.0]
        .iter()
        .flat_map(|r| angles.map(|a| at(*r, a)))
        .collect();
    let cells = (0..4).map(|k| (CellKind::Quadrilateral, vec![k, k + 1, k + 6, k + 5]));
    let mut mesh = Mesh::new(2, points.clone(), cells).unwrap();
    mesh.add_facet_group("bottom", (0..4).map(|k| vec![k, k + 1]).collect())
        .unwrap();
    mesh.add_facet_group("top", (5..9).map(|k| vec![k + 1, k]).collect())
        .unwrap();
    let system = held_above(mesh);
    let ground = Foundation::gap(|_| 0.0);
    let rows = system
        .contact_with("bottom", &ground, merged(2, Degree::Constant))
        .unwrap();
    let displacement = |x: [f64; 3]| [0.2 + 0.3 * x[0] - x[1], 0.7 * x[0] + 0.5 * x[1]];
    let mut u = vec![0.0; system.num_free()];
    for (node, x) in points.iter().enumerate() {
        (0..2).for_each(|d| {
            if let Some(dof) = system.dof(node, d) {
                u[dof] = displacement(*x)[d];
            }
        });
    }
    for (m, turned) in [(&rows.normal, false), (&rows.tangential[0], true)] {
        let mut mean = vec![0.0; 2];
        m.mul_vec(&u, &mut mean);
        for (i, (mean, area)) in mean.iter().zip(&rows.areas).enumerate() {
            let exact: f64 = (2 * i..2 * i + 2)
                .map(|k| {
                    let (p, q) = (points[k], points[k + 1]);
                    let v = displacement([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), 0.0]);
                    let way = [q[0] - p[0], q[1] - p[1]];
                    match turned {
                        false => v[0] * way[1] - v[1] * way[0],
                        true => v[0] * way[0] + v[1] * way[1],
                    }
                })
                .sum();
            assert!(
                (mean * area - exact).abs() < 1e-14,
                "{i} {turned}: {} {exact}",
                mean * area
            );
        }
    }
}

/// Elements for which linear functions have no meaning have constants.
#[test]
fn groups_of_any_shape_are_elements_for_constants() {
    let mut mesh = Mesh::block([0.0; 3], [3.0, 3.0, 1.0], [3, 3, 1]).unwrap();
    let facets = mesh.facet_group("bottom").unwrap().to_vec();
    // An L of five facets, and the square of four that it leaves.
    let is_l = |k: usize| k.is_multiple_of(3) || k < 3;
    for (name, wanted) in [("L", true), ("square", false)] {
        let own = (0..9).filter(|k| is_l(*k) == wanted).map(|k| facets[k].clone());
        mesh.add_facet_group(name, own.collect()).unwrap();
    }
    let system = held_above(mesh);
    let rows = |degree| {
        let partition = Partition::Groups(vec!["L".into(), "square".into()]);
        system.contact_with(
            "bottom",
            &ground(3),
            MultiplierSpace::Piecewise { partition, degree },
        )
    };
    let mut areas = rows(Degree::Constant).unwrap().areas;
    areas.sort_by(f64::total_cmp);
    assert!((areas[0] - 4.0).abs() < 1e-14 && (areas[1] - 5.0).abs() < 1e-14);
    let error = rows(Degree::Linear).unwrap_err().to_string();
    assert!(
        error.contains("element 0") && error.contains("constants alone"),
        "{error}"
    );
}
