//! Triangles of second order.

use semismooth::contact::{CondensedContact, ContactBody, FrictionCoefficient, LoadPath, PlanarCoulomb};
use semismooth::fem::{
    CellKind, Dilatation, ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh, parse_gmsh,
};

use crate::dilatation::{resultant, solved};

fn triangles(n: usize) -> Mesh {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2 * n, n]).unwrap();
    mesh.simplices().unwrap().second_order().unwrap()
}

/// Quadratic displacements are exact: prescribed on the boundary, with the volume force that balances their stresses.
#[test]
fn quadratic_displacements_are_exact() {
    let mut mesh = triangles(3);
    mesh.mark_boundary("all", |_| true);
    let (young, poisson) = (2.0, 0.3);
    let (mu, lambda) = (
        young / (2.0 * (1.0 + poisson)),
        young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson)),
    );
    // u = (x² + 3 x y, 2 y² − x y): div u = 2 x + 3 y + 4 y − x.
    let field = |d: usize, x: [f64; 3]| [x[0] * x[0] + 3.0 * x[0] * x[1], 2.0 * x[1] * x[1] - x[0] * x[1]][d];
    // f = −(λ + μ) ∇ div u − μ Δu.
    let force = [-(lambda + mu) - 2.0 * mu, -7.0 * (lambda + mu) - 4.0 * mu, 0.0];
    let system = Elasticity::new(mesh, Material::isotropic(young, poisson).unwrap())
        .prescribe("all", 0, move |x| field(0, x))
        .prescribe("all", 1, move |x| field(1, x))
        .assemble()
        .unwrap();
    let u = solved(&system, &system.body_force(|_| force).unwrap());
    for (node, at) in system.mesh().points().iter().enumerate() {
        for d in 0..2 {
            if let Some(dof) = system.dof(node, d) {
                assert!((u[dof] - field(d, *at)).abs() < 1e-12);
            }
        }
    }
}

/// The block of `dilatation.rs`: there is no locking, and at ν = 0.3 errors are those of the singular corners.
#[test]
fn triangles_of_second_order_do_not_lock() {
    for (poisson, exact) in [(0.3, 0.023_118_7), (0.49, 0.033_793), (0.4999, 0.034_985)] {
        let error = |n: usize| resultant(triangles(n), poisson, Dilatation::Automatic) / exact - 1.0;
        let (coarse, fine) = (error(4), error(8));
        assert!(
            fine > 0.0 && fine < 0.03 && fine < 0.7 * coarse,
            "{poisson}: {coarse} {fine}"
        );
    }
}

fn pressed(mesh: Mesh) -> ElasticSystem {
    Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .fix_component("left", 0)
        .prescribe("top", 1, |_| -0.01)
        .assemble()
        .unwrap()
}

/// Uniform pressure on a flat foundation: multipliers are linear between corners, and exact; the corner at the left holds its tangent.
#[test]
fn uniform_pressure_is_exact() {
    let system = pressed(triangles(2));
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    assert_eq!((rows.nodes.len(), rows.num_held()), (5, 1));
    assert!((rows.areas.iter().sum::<f64>() - 2.0).abs() < 1e-14);
    let load = LoadPath::constant(system.supports().clone());
    let body = ContactBody::new(system.stiffness().clone(), rows.normal, rows.tangential, load).unwrap();
    let law = PlanarCoulomb::new(FrictionCoefficient::constant(0.0).unwrap());
    let problem = CondensedContact::new(body, law).unwrap();
    let x = problem.solve(0.0, None).unwrap();
    let exact = 0.01 / (1.0 - 0.3 * 0.3);
    for (pressure, area) in x.iter().zip(&rows.areas) {
        assert!((pressure / area - exact).abs() < 1e-12 * exact * 10.0);
    }
}

/// A quarter of a disc with the middles of its outer edges on the circle: its moment is of fourth order in their size.
#[test]
fn curved_edges_are_of_fourth_order() {
    let error = |n: usize| {
        let angle = |k: f64| std::f64::consts::FRAC_PI_2 * k / n as f64;
        let at = |r: f64, k: f64| [r * angle(k).cos(), r * angle(k).sin(), 0.0];
        let mut points = vec![[0.0; 3]];
        (0..=2 * n).for_each(|k| points.push(at(1.0, 0.5 * k as f64)));
        (0..=n).for_each(|k| points.push(at(0.5, k as f64)));
        let cells = (0..n).map(|k| {
            let outer = 1 + 2 * k;
            let middle = 2 + 2 * n + k;
            (
                CellKind::Triangle6,
                vec![0, outer, outer + 2, middle, outer + 1, middle + 1],
            )
        });
        let mut mesh = Mesh::new(2, points, cells).unwrap();
        mesh.mark_boundary("rim", |f| f.centre[0].hypot(f.centre[1]) > 0.9);
        mesh.mark_boundary("left", |f| f.centre[0] < 1e-9);
        let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
            .fix("left")
            .assemble()
            .unwrap();
        assert_eq!(system.mesh().facet_group("rim").unwrap()[0].len(), 3);
        // ∫ x over the area is 1/3.
        let load = system.body_force(|_| [1.0, 0.0, 0.0]).unwrap();
        let points = system.mesh().points().iter().enumerate();
        let work: f64 = points
            .filter_map(|(n, p)| system.dof(n, 0).map(|d| load[d] * p[0]))
            .sum();
        (work - 1.0 / 3.0).abs()
    };
    let (coarse, fine) = (error(4), error(8));
    assert!(fine < coarse / 14.0 && coarse < 1e-3, "{coarse:e} {fine:e}");
}

#[test]
fn second_order_is_read_and_refused_where_it_has_no_meaning() {
    let text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n2\n1 1 \"base\"\n2 2 \"all\"\n$EndPhysicalNames\n$Nodes\n6\n\
                1 0 0 0\n2 2 0 0\n3 0 2 0\n4 1 0 0\n5 1 1 0\n6 0 1 0\n$EndNodes\n$Elements\n2\n1 8 2 1 1 1 2 4\n\
                2 9 2 2 2 1 3 2 6 5 4\n$EndElements\n";
    let mesh = parse_gmsh(text.as_bytes(), "m.msh".as_ref()).unwrap();
    // The clockwise triangle is turned round.
    assert_eq!(
        (mesh.kind(0), mesh.cell(0)),
        (CellKind::Triangle6, &[0, 1, 2, 3, 4, 5][..])
    );
    assert_eq!(mesh.facet_group("base").unwrap(), [vec![0, 1, 3]]);
    assert!(matches!(mesh.refined(), Err(FemError::Order { .. })));
    let squares = Mesh::rectangle([0.0; 2], [1.0; 2], [1, 1]).unwrap();
    assert!(matches!(squares.second_order(), Err(FemError::Order { .. })));
    let mut other = mesh.clone();
    assert!(other.add_facet_group("x", vec![vec![0, 1]]).is_ok());
    assert_eq!(other.facet_group("x").unwrap(), [vec![0, 1, 3]]);
    assert!(other.add_facet_group("x", vec![vec![0, 1, 4]]).is_err());
    assert!(squares.clone().add_facet_group("x", vec![vec![0, 1, 2]]).is_err());
}
