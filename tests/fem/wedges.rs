//! Wedges and pyramids.

use semismooth::contact::{CondensedContact, Frictionless, LoadPath};
use semismooth::fem::{CellKind, Elasticity, FemError, Foundation, Material, Mesh, Mortar, parse_gmsh};

use super::moved;
use crate::dilatation::solved;

/// The block (0, 2) × (0, 1)² in cubes with n of them along y: each cut into two wedges along a diagonal of its bottom, or into six pyramids
/// around its centre.
pub(super) fn cut(n: usize, kind: CellKind) -> Mesh {
    let cubes = Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [2 * n, n, n]).unwrap();
    let mut points = cubes.points().to_vec();
    let mut cells = Vec::new();
    for cube in 0..cubes.num_cells() {
        let nodes = cubes.cell(cube);
        if kind == CellKind::Wedge {
            for half in [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]] {
                cells.push((kind, half.map(|a| nodes[a]).to_vec()));
            }
            continue;
        }
        let centre = points.len();
        points.push(cubes.centre(cube));
        for side in cubes.kind(cube).facets() {
            // Seen from the centre, which is inside.
            let mut own: Vec<_> = side.iter().rev().map(|&a| nodes[a]).collect();
            own.push(centre);
            cells.push((kind, own));
        }
    }
    let mut mesh = Mesh::new(3, points, cells).unwrap();
    for (name, axis, side) in [
        ("left", 0, -1.0),
        ("right", 0, 1.0),
        ("bottom", 2, -1.0),
        ("top", 2, 1.0),
    ] {
        assert!(mesh.mark_boundary(name, |f| f.normal[axis] * side > 0.9) > 0);
    }
    mesh
}

/// Of both kinds, of first and of second order.
fn all(n: usize) -> [Mesh; 4] {
    let [wedges, pyramids] = [CellKind::Wedge, CellKind::Pyramid].map(|kind| cut(n, kind));
    let second = [wedges.serendipity().unwrap(), pyramids.second_order().unwrap()];
    let [a, b] = second;
    [wedges, pyramids, a, b]
}

/// The cells fill the block, also where they share it with cubes and tetrahedra; their facets close it.
#[test]
fn cells_fill_the_body() {
    let kinds = [
        CellKind::Wedge,
        CellKind::Pyramid,
        CellKind::Wedge15,
        CellKind::Pyramid13,
    ];
    for (mesh, kind) in all(2).into_iter().zip(kinds) {
        assert_eq!(mesh.kind(0), kind);
        let area: f64 = mesh.boundary().iter().map(|f| f.measure).sum();
        assert!((area - 10.0).abs() < 1e-13, "{kind}: {area}");
        let body = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap()).floating();
        let system = body.assemble().unwrap();
        let weight: f64 = system.body_force(|_| [0.0, 0.0, 3.0]).unwrap().iter().sum();
        assert!((weight - 6.0).abs() < 1e-13, "{kind}: {weight}");
    }
}

/// A quadratic field without forces inside, div u = 0 and Δu = 0: exact in straight cells of second order, sheared
/// ones, prescribed on the boundary.
#[test]
fn quadratic_displacements_are_exact() {
    for mesh in all(2).into_iter().skip(2) {
        let sheared = moved(&mesh, |[x, y, z]| {
            [x + 0.3 * y - 0.2 * z, y + 0.1 * z, z - 0.15 * x]
        });
        let field = |[x, y, z]: [f64; 3]| [y * z + x * x - y * y, x * z - 2.0 * x * y, -2.0 * x * y];
        let mut body = Elasticity::new(sheared, Material::lame(1.2, 0.9).unwrap());
        for d in 0..3 {
            body = body.prescribe("all", d, move |x| field(x)[d]);
        }
        let system = body.assemble().unwrap();
        assert!(system.num_free() > 0);
        let u = solved(&system, &vec![0.0; system.num_free()]);
        for (node, x) in system.mesh().points().iter().enumerate() {
            for d in 0..3 {
                if let Some(dof) = system.dof(node, d) {
                    let (found, exact) = (u[dof], field(*x)[d]);
                    assert!(
                        (found - exact).abs() < 1e-12,
                        "{}: {found} {exact}",
                        system.mesh().kind(0)
                    );
                }
            }
        }
    }
}

/// Halved, they fill the same body with eight times as many wedges, and with pyramids and tetrahedra; linear fields stay exact.
#[test]
fn refined_cells_fill_the_body() {
    let count = |mesh: &Mesh, kind: CellKind| (0..mesh.num_cells()).filter(|&c| mesh.kind(c) == kind).count();
    let [wedges, pyramids, ..] = all(1);
    let (wedges, pyramids) = (wedges.refined().unwrap(), pyramids.refined().unwrap());
    assert_eq!(count(&wedges, CellKind::Wedge), 2 * 2 * 8);
    assert_eq!(count(&pyramids, CellKind::Pyramid), 12 * 6);
    assert_eq!(count(&pyramids, CellKind::Tetrahedron), 12 * 4);
    for mesh in [wedges, pyramids] {
        let bottom = mesh.facet_group("bottom").unwrap().len();
        assert!(bottom == 16 || bottom == 8, "{bottom}");
        let mixed = moved(&mesh.serendipity().unwrap(), |x| x);
        let field = |[x, y, z]: [f64; 3]| [0.2 * x + 0.1 * y * y - 0.1 * z * z, 0.3 * z, 0.1 * x - 0.4 * y];
        let mut body = Elasticity::new(mixed, Material::lame(1.2, 0.9).unwrap());
        for d in 0..3 {
            body = body.prescribe("all", d, move |x| field(x)[d]);
        }
        let system = body.assemble().unwrap();
        let u = solved(&system, &vec![0.0; system.num_free()]);
        for (node, x) in system.mesh().points().iter().enumerate() {
            for d in 0..3 {
                if let Some(dof) = system.dof(node, d) {
                    assert!((u[dof] - field(*x)[d]).abs() < 1e-12);
                }
            }
        }
    }
}

/// Pressed on a plane, uniformly, on faces of three corners (the bottoms of wedges) and of four (their sides, and pyramids): forces are the
/// pressure times the areas, in all kinds.
#[test]
fn uniform_pressure_passes_through_faces_of_both_kinds() {
    for mesh in all(2) {
        for (side, axis) in [("bottom", 2), ("left", 0)] {
            let opposite = ["right", "", "top"][axis];
            let (mut down, mut up) = ([0.0; 3], [0.0; 3]);
            (down[axis], up[axis]) = (-0.1, 1.0);
            let mut mesh = mesh.clone();
            mesh.mark_nodes("corner", |x| x == [0.0; 3]);
            mesh.mark_nodes("next", |x| x == [0.0, 1.0, 0.0]);
            // Without Poisson's ratio nothing moves along the plane.
            let mut body = Elasticity::new(mesh, Material::isotropic(1.0, 0.0).unwrap());
            for d in (0..3).filter(|&d| d != axis) {
                body = body.fix_component(opposite, d);
            }
            let system = body.floating().assemble().unwrap();
            let ground = Foundation::plane([0.0; 3], up);
            let rows = system.contact(side, &ground).unwrap();
            let load = LoadPath::constant(system.traction(opposite, |_| down).unwrap());
            let contact = semismooth::contact_body(&system, &rows, load).unwrap();
            let problem = CondensedContact::new(contact, Frictionless::space()).unwrap();
            let x = problem.solve(0.0, None).unwrap();
            let kind = system.mesh().kind(0);
            for (i, area) in rows.areas.iter().enumerate() {
                assert!(
                    (x[i] - 0.1 * area).abs() < 1e-12,
                    "{kind} {side}: {} {area}",
                    x[i]
                );
            }
        }
    }
}

/// One block on another across meshes that do not match, wedges above pyramids: a uniform stress passes.
#[test]
fn uniform_stress_passes_between_wedges_and_pyramids() {
    for second in [false, true] {
        let raise = |mesh: Mesh| if second { mesh.serendipity().unwrap() } else { mesh };
        let upper = raise(cut(1, CellKind::Wedge));
        let lower = raise(cut(2, CellKind::Pyramid));
        let shift = upper.num_nodes();
        let below = lower.points().iter().map(|p| [p[0], p[1], p[2] - 1.0]);
        let points: Vec<_> = upper.points().iter().copied().chain(below).collect();
        let of = |mesh: &Mesh, shift: usize| -> Vec<(CellKind, Vec<usize>)> {
            (0..mesh.num_cells())
                .map(|c| (mesh.kind(c), mesh.cell(c).iter().map(|n| n + shift).collect()))
                .collect()
        };
        let mut mesh = Mesh::new(3, points, [of(&upper, 0), of(&lower, shift)].concat()).unwrap();
        for (name, side, height) in [
            ("foot", -1.0, 0.0),
            ("seat", 1.0, 0.0),
            ("top", 1.0, 1.0),
            ("base", -1.0, -1.0),
        ] {
            mesh.mark_boundary(name, |f| {
                f.normal[2] * side > 0.9 && (f.centre[2] - height).abs() < 1e-9
            });
        }
        let body = Elasticity::new(mesh, Material::isotropic(1.0, 0.0).unwrap()).fix("base");
        let system = body
            .fix_component("top", 0)
            .fix_component("top", 1)
            .floating()
            .assemble()
            .unwrap();
        let rows = system
            .contact_between("foot", "seat", &Mortar::default())
            .unwrap();
        let load = LoadPath::constant(system.traction("top", |_| [0.0, 0.0, -0.1]).unwrap());
        let contact = semismooth::contact_body(&system, &rows, load).unwrap();
        let problem = CondensedContact::new(contact, Frictionless::space()).unwrap();
        let x = problem.solve(0.0, None).unwrap();
        for (i, area) in rows.areas.iter().enumerate() {
            assert!((x[i] - 0.1 * area).abs() < 1e-12, "{second}: {} {area}", x[i]);
        }
    }
}

/// Files of Gmsh: nodes of second order in its order of edges, at their places.
#[test]
fn gmsh_orders_edges_in_its_own_way() {
    // Corners, then the ends of the edges in the order of Gmsh's manual.
    let wedge: (&[[f64; 3]], &[[usize; 2]]) = (
        &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, 0.0, 1.0],
            [1.0, 0.0, 1.0],
            [0.0, 1.0, 1.0],
        ],
        &[
            [0, 1],
            [0, 2],
            [0, 3],
            [1, 2],
            [1, 4],
            [2, 5],
            [3, 4],
            [3, 5],
            [4, 5],
        ],
    );
    let pyramid: (&[[f64; 3]], &[[usize; 2]]) = (
        &[
            [0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.5, 0.5, 1.0],
        ],
        &[[0, 1], [0, 3], [0, 4], [1, 2], [1, 4], [2, 3], [2, 4], [3, 4]],
    );
    let kinds = [
        (wedge, [(6, CellKind::Wedge), (18, CellKind::Wedge15)]),
        (pyramid, [(7, CellKind::Pyramid), (19, CellKind::Pyramid13)]),
    ];
    for ((corners, edges), types) in kinds {
        for (number, kind) in types {
            let middle = |[a, b]: &[usize; 2]| -> [f64; 3] {
                std::array::from_fn(|d| 0.5 * (corners[*a][d] + corners[*b][d]))
            };
            let mut points = corners.to_vec();
            if kind.order() == 2 {
                points.extend(edges.iter().map(middle));
            }
            let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", points.len());
            for (k, p) in points.iter().enumerate() {
                text += &format!("{} {} {} {}\n", k + 1, p[0], p[1], p[2]);
            }
            let nodes: Vec<String> = (1..=points.len()).map(|k| k.to_string()).collect();
            text += &format!(
                "$EndNodes\n$Elements\n1\n1 {number} 2 0 1 {}\n$EndElements\n",
                nodes.join(" ")
            );
            let mesh = parse_gmsh(text.as_bytes(), std::path::Path::new("cells.msh")).unwrap();
            assert_eq!(mesh.kind(0), kind);
            // Those of a straight cell raised by ourselves.
            let first: Vec<usize> = (0..kind.num_corners()).collect();
            let low = if kind.num_corners() == 6 {
                CellKind::Wedge
            } else {
                CellKind::Pyramid
            };
            let own = Mesh::new(3, corners.to_vec(), [(low, first)]).unwrap();
            let own = if kind.order() == 2 {
                own.serendipity().unwrap()
            } else {
                own
            };
            for (a, b) in mesh.cell(0).iter().zip(own.cell(0)) {
                assert_eq!(mesh.points()[*a], own.points()[*b], "{kind}");
            }
        }
    }
}

/// Folded and flat cells are refused, and so is what cannot be divided.
#[test]
fn bad_wedges_and_pyramids_are_refused() {
    for (mesh, corner, to) in [
        (cut(1, CellKind::Wedge), 0, [1.6, 0.9, 0.6]),
        (cut(1, CellKind::Pyramid), 0, [0.9, 0.9, 0.9]),
    ] {
        let mut points = mesh.points().to_vec();
        points[mesh.cell(0)[corner]] = to;
        let cells = (0..mesh.num_cells()).map(|c| (mesh.kind(c), mesh.cell(c).to_vec()));
        let found = Mesh::new(3, points, cells);
        assert!(matches!(found, Err(FemError::Jacobian { .. })), "{found:?}");
        assert!(matches!(mesh.simplices(), Err(FemError::Order { .. })));
        let second = mesh.serendipity().unwrap();
        assert!(matches!(second.refined(), Err(FemError::Order { .. })));
    }
}
