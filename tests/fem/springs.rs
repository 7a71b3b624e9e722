//! Groups of nodes, supports and forces there, springs, elastic foundations: by statics.

use semismooth::contact::{CondensedContact, Frictionless, LoadPath};
use semismooth::fem::{
    CellKind, ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh, PlaneModel, PlasticBody,
    Spring, VonMises, parse_gmsh,
};

use crate::dilatation::solved;

const X: [f64; 3] = [1.0, 0.0, 0.0];

fn sum(system: &ElasticSystem, forces: &[f64], component: usize) -> f64 {
    let dim = system.mesh().dim();
    forces.iter().skip(component).step_by(dim).sum()
}

/// A cube on three points, held by as many components as it has rigid motions, under its weight and a wind: reactions by statics.
#[test]
fn reactions_at_three_points_are_those_of_statics() {
    let mut mesh = Mesh::block([0.0; 3], [2.0, 2.0, 1.0], [2, 2, 1]).unwrap();
    for (name, at) in [("a", [0.0; 3]), ("b", [2.0, 0.0, 0.0]), ("c", [0.0, 2.0, 0.0])] {
        assert_eq!(mesh.mark_nodes(name, |x| x == at), 1);
    }
    mesh.mark_nodes("peak", |x| x == [2.0, 2.0, 1.0]);
    let body = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .fix("a")
        .fix_component("b", 1)
        .fix_component("b", 2);
    match body.assemble() {
        Err(FemError::Floating { modes, .. }) => assert_eq!(modes, "rotation about x"),
        other => panic!("{other:?}"),
    }
    let system = body.fix_component("c", 2).assemble().unwrap();
    let weight = system.body_force(|_| [0.0, 0.0, -0.25]).unwrap();
    let wind = system.nodal_force("peak", |_| [0.3, 0.0, -0.1]).unwrap();
    let load: Vec<f64> = weight.iter().zip(&wind).map(|(a, b)| a + b).collect();
    let reactions = system.reactions(&solved(&system, &load), &[]).unwrap();
    let at = |group: &str, d: usize| reactions[3 * system.mesh().node_group(group).unwrap()[0] + d];
    // Weight 1 at (1, 1), and (0.3, 0, −0.1) at (2, 2, 1). Moments about the y axis: 2 b = 1 + 0.2 + 0.3 · 1; about the x axis: 2 c = 1 +
    // 0.2; about the z axis through a: 2 b_y − 0.3 · 2 = 0.
    let exact = [
        (at("a", 0), -0.3),
        (at("b", 2), 0.75),
        (at("c", 2), 0.6),
        (at("a", 2), 1.1 - 0.75 - 0.6),
        (at("b", 1), 0.3),
        (at("a", 1), -0.3),
    ];
    // The weight of the supported nodes themselves is taken by their supports directly: an eighth of each cell.
    let own = 0.25 / 8.0;
    for (k, (found, exact)) in exact.into_iter().enumerate() {
        let direct = if [1, 2, 3].contains(&k) { own } else { 0.0 };
        assert!((found + direct - exact).abs() < 1e-13, "{k}: {found} {exact}");
    }
}

/// Facets, cells and nodes are in a group once, however often and in whatever order of their nodes they are given: loads count each once.
#[test]
fn groups_hold_each_member_once() {
    let mut mesh = Mesh::rectangle([0.0; 2], [2.0, 1.0], [2, 1]).unwrap();
    mesh.mark_boundary("top", |f| f.normal[1] > 0.5);
    mesh.add_facet_group("top", vec![vec![3, 4], vec![4, 3]]).unwrap();
    assert_eq!(mesh.facet_group("top").unwrap().len(), 2);
    for _ in 0..2 {
        assert_eq!(mesh.mark_cells("left half", |x| x[0] < 1.0), 1);
        assert_eq!(mesh.mark_nodes("corner", |x| x == [0.0; 3]), 1);
    }
    mesh.add_cell_group("left half", vec![0, 1, 1]).unwrap();
    assert_eq!(mesh.cell_group("left half").unwrap(), [0, 1]);
    assert_eq!(mesh.node_group("corner").unwrap(), [0]);
    let body = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap()).fix("bottom");
    let system = body.assemble().unwrap();
    let load = system.traction("top", |_| [0.0, -1.0, 0.0]).unwrap();
    assert!((sum(&system, &load, 1) + 2.0).abs() < 1e-15);
}

/// Two bars of stiffness E A / L = 2 with a spring of 5 between them, on a spring of 4 at the left end: 1/4 + 1/2 + 1/5 + 1/2.
#[test]
fn springs_in_series_add_their_compliances() {
    let bar = Mesh::rectangle([0.0; 2], [2.0, 1.0], [2, 1]).unwrap();
    let mut points = bar.points().to_vec();
    points.extend(bar.points().iter().map(|p| [p[0] + 3.0, p[1], 0.0]));
    let n = bar.num_nodes();
    let cells = [0, n].into_iter().flat_map(|shift| {
        let of = |c: usize| bar.cell(c).iter().map(|k| k + shift).collect::<Vec<_>>();
        (0..2).map(of).collect::<Vec<_>>()
    });
    let mut mesh = Mesh::new(2, points, cells.map(|c| (CellKind::Quadrilateral, c))).unwrap();
    for (name, x) in [
        ("begin", 0.0),
        ("left of the gap", 2.0),
        ("right of the gap", 3.0),
    ] {
        assert_eq!(mesh.mark_nodes(name, |p| p[0] == x), 2);
    }
    mesh.mark_boundary("end", |f| f.centre[0] == 5.0);
    mesh.mark_boundary("bottom", |f| f.normal[1] < -0.5);
    // Two nodes at each end share the stiffness.
    let body = Elasticity::new(mesh, Material::isotropic(4.0, 0.0).unwrap())
        .fix_component("bottom", 1)
        .spring("begin", Spring::along([2.0, 0.0, 0.0], 2.0).unwrap())
        .spring_between(
            "left of the gap",
            "right of the gap",
            Spring::axes([2.5, 0.0, 0.0]).unwrap(),
        );
    // The right bar is held by the spring to the left one.
    assert!(matches!(body.assemble(), Err(FemError::Floating { .. })));
    let system = body.floating().assemble().unwrap();
    let load = system.traction("end", |_| X).unwrap();
    let u = system.displacements(&solved(&system, &load), &[]).unwrap();
    for (node, p) in system.mesh().points().iter().enumerate() {
        let exact = match p[0] {
            x if x <= 2.0 => 0.25 + x / 4.0,
            x => 0.25 + 0.5 + 0.2 + (x - 3.0) / 4.0,
        };
        assert!((u[2 * node] - exact).abs() < 1e-14 && u[2 * node + 1].abs() < 1e-14);
    }
    // Blocks of nodes have the entries that springs add between bodies.
    let nodal = system.nodal_stiffness().unwrap();
    assert_eq!(nodal.to_matrix().unwrap(), *system.stiffness());
}

/// A spring pulled by a support that moves: its force is part of the reaction and of the load case.
#[test]
fn springs_pull_at_supports_that_move() {
    let mut mesh = Mesh::rectangle([0.0; 2], [1.0; 2], [1, 1]).unwrap();
    mesh.mark_nodes("corner", |x| x == [1.0, 1.0, 0.0]);
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .fix("left")
        .prescribe("corner", 0, |_| 0.1)
        .prescribe("corner", 1, |_| 0.0)
        .spring("corner", Spring::axes([3.0, 1.0, 0.0]).unwrap())
        .assemble()
        .unwrap();
    let without = {
        let mut mesh = Mesh::rectangle([0.0; 2], [1.0; 2], [1, 1]).unwrap();
        mesh.mark_nodes("corner", |x| x == [1.0, 1.0, 0.0]);
        Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
            .fix("left")
            .prescribe("corner", 0, |_| 0.1)
            .prescribe("corner", 1, |_| 0.0)
            .assemble()
            .unwrap()
    };
    let reaction = |s: &ElasticSystem| {
        s.reactions(&solved(s, &[]), s.supports().displacements())
            .unwrap()
    };
    let difference = reaction(&system)[6] - reaction(&without)[6];
    assert!((difference - 0.3).abs() < 1e-15);
    let moved = system.motion("corner", 0, |_| 1.0).unwrap();
    assert_eq!(moved.displacements()[6], 1.0);
}

/// A rigid block on an elastic foundation under an eccentric load settles and tilts: u = F/(k A) (1 + 12 e x/L²), and forces along the
/// foundation are carried by its tangential stiffness. In the plane and in space, with cells of both orders.
#[test]
fn rigid_blocks_on_elastic_foundations_tilt_by_statics() {
    let plane = Mesh::rectangle([-1.0, 0.0], [1.0, 1.0], [4, 2]).unwrap();
    let solid = Mesh::block([-1.0, 0.0, 0.0], [1.0, 1.0, 1.0], [4, 1, 1]).unwrap();
    for mut mesh in [
        plane.clone(),
        plane.simplices().unwrap().second_order().unwrap(),
        solid.clone(),
        solid.serendipity().unwrap(),
    ] {
        let (dim, up) = (mesh.dim(), mesh.dim() - 1);
        mesh.mark_boundary("below", |f| f.normal[up] < -0.5);
        let body = Elasticity::new(mesh, Material::isotropic(1e6, 0.3).unwrap())
            .with_plane_model(PlaneModel::Stress)
            .elastic_foundation("below", 2.0, 0.5);
        let system = body.assemble().unwrap();
        let mut down = [0.0; 3];
        down[up] = -1.0;
        // A pressure (1 + 3 x/4) on the top, F = 2, F e = ∫ 3/4 x² = 1/2.
        let load = system
            .traction("top", |x| down.map(|d| d * (1.0 + 0.75 * x[0])))
            .unwrap();
        let u = system.displacements(&solved(&system, &load), &[]).unwrap();
        for (node, p) in system
            .mesh()
            .points()
            .iter()
            .enumerate()
            .filter(|p| p.1[up] == 0.0)
        {
            let exact = -0.5 * (1.0 + 0.75 * p[0]);
            assert!(
                (u[dim * node + up] - exact).abs() < 5e-6,
                "{} {exact}",
                u[dim * node + up]
            );
        }
        let pull = system.traction("below", |_| X).unwrap();
        let u = system.displacements(&solved(&system, &pull), &[]).unwrap();
        assert!(
            system
                .mesh()
                .points()
                .iter()
                .enumerate()
                .all(|(node, _)| (u[dim * node] - 2.0).abs() < 5e-6)
        );
    }
}

/// A long beam on an elastic foundation under a force in its middle: the deflection F β/(2 k), β⁴ = k/(4 E I), of Winkler and Zimmermann
/// up to the shear of the beam, which is of order (β h)².
#[test]
fn beams_on_elastic_foundations_have_the_deflection_of_winkler() {
    let error = |beta: f64| {
        let young = 1e3;
        let stiffness = 4.0 * young / 12.0 * beta.powi(4);
        // Half of it, of length 2 π/β.
        let length = std::f64::consts::TAU / beta;
        let mut mesh = Mesh::rectangle([0.0; 2], [length, 1.0], [60, 1])
            .unwrap()
            .second_order()
            .unwrap();
        mesh.mark_nodes("middle", |x| x[0] == 0.0 && x[1] == 0.5);
        let system = Elasticity::new(mesh, Material::isotropic(young, 0.0).unwrap())
            .with_plane_model(PlaneModel::Stress)
            .fix_component("left", 0)
            .elastic_foundation("bottom", stiffness, 0.0)
            .assemble()
            .unwrap();
        // Half of F = 1, spread over the section as in a beam.
        let load = system.traction("left", |_| [0.0, -0.5, 0.0]).unwrap();
        let u = system.displacements(&solved(&system, &load), &[]).unwrap();
        let middle = system.mesh().node_group("middle").unwrap()[0];
        let exact = -beta / (2.0 * stiffness);
        // What the foundation carries is the load.
        let settled = system
            .mesh()
            .points()
            .iter()
            .enumerate()
            .filter(|p| p.1[1] == 0.0);
        let mut carried = 0.0;
        let mut along: Vec<(f64, f64)> = settled.map(|(node, p)| (p[0], u[2 * node + 1])).collect();
        along.sort_by(|a, b| a.0.total_cmp(&b.0));
        for part in along.windows(3).step_by(2) {
            // Simpson's rule is exact for edges of second order.
            carried -= stiffness * (part[2].0 - part[0].0) / 6.0 * (part[0].1 + 4.0 * part[1].1 + part[2].1);
        }
        assert!((carried - 0.5).abs() < 1e-9);
        (u[2 * middle + 1] / exact - 1.0).abs()
    };
    let (thick, thin) = (error(0.2), error(0.1));
    assert!(thick < 0.1 && thin < thick / 3.5, "{thick} {thin}");
}

/// A disc of revolution on an elastic foundation: F = k π R² u; a spring at its rim takes part with the whole ring.
#[test]
fn foundations_of_revolution_are_whole_rings() {
    let mut mesh = Mesh::rectangle([0.0; 2], [2.0, 1.0], [3, 2]).unwrap();
    mesh.mark_nodes("rim", |x| x == [2.0, 0.0, 0.0]);
    let system = Elasticity::new(mesh, Material::isotropic(1e6, 0.3).unwrap())
        .with_plane_model(PlaneModel::Axisymmetric)
        .elastic_foundation("bottom", 1.0, 0.0)
        .assemble()
        .unwrap();
    let load = system.traction("top", |_| [0.0, -1.0, 0.0]).unwrap();
    let u = solved(&system, &load);
    assert!((0..system.mesh().num_nodes()).all(|n| (u[system.dof(n, 1).unwrap()] + 1.0).abs() < 5e-6));
    assert!(
        (sum(&system, &system.displacements(&load, &[]).unwrap(), 1) + 4.0 * std::f64::consts::PI).abs()
            < 1e-12
    );
}

/// A block that contact and a spring alone hold: the spring takes the pull, the ground the weight; condensed, with a regular stiffness
/// matrix.
#[test]
fn springs_hold_bodies_in_contact() {
    let mut mesh = Mesh::rectangle([0.0; 2], [2.0, 1.0], [4, 2]).unwrap();
    mesh.mark_nodes("ends", |x| x[1] == 0.0 && x[0] != 1.0);
    mesh.mark_nodes("handle", |x| x == [2.0, 0.0, 0.0]);
    let soft = Spring::axes([1e-3, 1e-6, 0.0]).unwrap();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .spring("ends", soft)
        .assemble()
        .unwrap();
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let mut load = system.body_force(|_| [0.0, -0.005, 0.0]).unwrap();
    let pull = system.nodal_force("handle", |_| [0.002, 0.0, 0.0]).unwrap();
    load.iter_mut().zip(pull).for_each(|(l, p)| *l += p);
    let body = semismooth::contact_body(&system, &rows, LoadPath::constant(load)).unwrap();
    let problem = CondensedContact::new(body, Frictionless::plane()).unwrap();
    let x = problem.solve(0.0, None).unwrap();
    let u = problem.displacements(&x).unwrap();
    let ends = system.mesh().node_group("ends").unwrap();
    let carried: f64 = ends.iter().map(|&n| 1e-3 * u[system.dof(n, 0).unwrap()]).sum();
    assert!((carried - 0.002).abs() < 1e-12);
    let lifted: f64 = ends.iter().map(|&n| 1e-6 * u[system.dof(n, 1).unwrap()]).sum();
    let [normal, ..] = problem.solution(&x).unwrap().resultant();
    assert!((normal - lifted - 0.01).abs() < 1e-12, "{normal} {lifted}");
}

#[test]
fn groups_of_nodes_stay_with_their_mesh() {
    let mut mesh = Mesh::rectangle([0.0; 2], [1.0; 2], [2, 2]).unwrap();
    mesh.add_node_group("two", vec![8, 4]).unwrap();
    let cut = mesh.simplices().unwrap();
    for other in [
        mesh.refined().unwrap(),
        mesh.second_order().unwrap(),
        cut.clone(),
        cut.serendipity().unwrap(),
    ] {
        assert_eq!(other.node_group("two").unwrap(), [8, 4]);
    }
    let text = serde_json::to_string(&mesh).unwrap();
    assert_eq!(serde_json::from_str::<Mesh>(&text).unwrap(), mesh);
    // Points of Gmsh; the second belongs to no cell.
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n0 3 \"tip\"\n$EndPhysicalNames\n$Nodes\n4\n1 0 0 0\n\
                2 5 5 0\n3 1 0 0\n4 0 1 0\n$EndNodes\n$Elements\n3\n1 15 2 3 1 4\n2 15 2 3 1 2\n3 2 2 9 1 1 3 4\n$EndElements\n";
    let mesh = parse_gmsh(text.as_bytes(), "m.msh".as_ref()).unwrap();
    assert_eq!(mesh.node_group("tip").unwrap(), [2]);
}

#[test]
fn groups_and_springs_that_do_not_serve_are_refused() {
    let mut mesh = Mesh::rectangle([0.0; 2], [1.0; 2], [2, 2]).unwrap();
    mesh.add_node_group("one", vec![0]).unwrap();
    mesh.add_node_group("two", vec![1, 2]).unwrap();
    assert_eq!(
        mesh.add_node_group("two", vec![3, 1]).unwrap_err().to_string(),
        "the group \"two\" of nodes has node 1 already"
    );
    let steel = Material::isotropic(1.0, 0.3).unwrap();
    let body = Elasticity::new(mesh, steel).fix("left");
    let spring = Spring::axes([1.0; 3]).unwrap();
    let told = |body: Elasticity| body.assemble().unwrap_err().to_string();
    assert!(
        told(body.clone().fix("three")).contains("\"three\" of facets or nodes; the mesh has \"bottom\"")
    );
    assert!(told(body.clone().fix("three")).contains("\"two\""));
    assert!(
        told(body.clone().spring("left", spring))
            .contains("\"left\" of nodes; the mesh has \"one\", \"two\"")
    );
    assert!(
        told(body.clone().spring_between("one", "two", spring))
            .contains("the nodes of \"one\" and \"two\" one by one, but these have 1 and 2 nodes")
    );
    assert!(
        told(body.clone().elastic_foundation("top", -1.0, 0.0))
            .contains("= -1: it must be finite and not negative")
    );
    let system = body
        .clone()
        .elastic_foundation("top", 1.0, 1.0)
        .assemble()
        .unwrap();
    let at_rest = vec![0.0; 18];
    assert!(matches!(
        system.forces_by_position(&at_rest),
        Err(FemError::FoundationMoves)
    ));
    let law = VonMises::new(1.0, 0.3, 1.0).unwrap();
    let plastic = Elasticity::new(system.mesh().clone(), law.elastic().clone()).fix("left");
    assert!(PlasticBody::new(&plastic.clone(), law.clone()).is_ok());
    let error = PlasticBody::new(&plastic.spring("one", spring), law).unwrap_err();
    assert!(error.to_string().contains("springs"), "{error}");
}
