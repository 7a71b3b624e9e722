//! Integrals over cells and facets against those of polynomials.

use super::{first_order, raised};
use semismooth::fem::{
    CellKind, ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh, TraceSpace,
};

/// A mesh of each kind.
fn meshes() -> Vec<Mesh> {
    let first = first_order(2);
    let second = raised(&first);
    first.into_iter().chain(second).collect()
}

fn clamped(mesh: Mesh) -> Result<ElasticSystem, FemError> {
    Elasticity::new(mesh, Material::lame(1.0, 1.0)?)
        .fix("left")
        .assemble()
}

/// ∫ f·v for forces and displacements that are affine, where v vanishes on the supports: the product is of degree two.
#[test]
fn work_of_affine_forces_on_affine_displacements_is_exact() {
    for mesh in meshes() {
        let system = clamped(mesh).unwrap();
        let (mesh, dim) = (system.mesh(), system.mesh().dim());
        let work = |load: &[f64]| -> f64 {
            (0..mesh.num_nodes())
                .flat_map(|node| (0..dim).map(move |d| (node, d)))
                .filter_map(|(node, d)| {
                    Some(load[system.dof(node, d)?] * [1.0, -2.0, 3.0][d] * mesh.points()[node][0])
                })
                .sum()
        };
        let force = |[x, y, z]: [f64; 3]| [1.0 + 2.0 * x - y, 0.5 - x + 3.0 * y, z - x];
        // v = (x, −2 x, 3 x): ∫ x (1 + 2 x − y) − 2 x (½ − x + 3 y) + 3 x (z − x) over the body, and over x = 2.
        let plane = 2.0 + 16.0 / 3.0 - 1.0 - 2.0 * (1.0 - 8.0 / 3.0 + 3.0);
        let edge = 2.0 * (5.0 - 0.5) - 4.0 * (0.5 - 2.0 + 1.5);
        let [whole, side] = match dim {
            2 => [plane, edge],
            _ => [plane + 3.0 * (1.0 - 8.0 / 3.0), edge + 6.0 * (0.5 - 2.0)],
        };
        let found = [
            work(&system.body_force(force).unwrap()),
            work(&system.traction("right", force).unwrap()),
        ];
        for (found, exact) in found.into_iter().zip([whole, side]) {
            assert!((found - exact).abs() < 1e-13, "{found} {exact}");
        }
    }
}

/// ∫ |∇u|² + u² of u = 1 + x − 2 y.
#[test]
fn squares_of_affine_functions_are_integrated_exactly() {
    for mesh in meshes() {
        let space = TraceSpace::new(&mesh, "bottom", None).unwrap();
        let u: Vec<f64> = mesh.points().iter().map(|[x, y, _]| 1.0 + x - 2.0 * y).collect();
        let mut image = vec![0.0; u.len()];
        space.gram().mul_vec(&u, &mut image);
        let square: f64 = u.iter().zip(&image).map(|(u, v)| u * v).sum();
        // ∫ u² = ∫ (1 + x)² − 4 y (1 + x) + 4 y².
        let exact = 5.0 * 2.0 + 26.0 / 3.0 - 2.0 * 4.0 + 8.0 / 3.0;
        assert!((square - exact).abs() < 1e-12, "{square} {exact}");
    }
}

/// The areas of the nodes are integrals of their shape functions, so that Σ aᵢ xᵢ = ∫ x: here of the trapezoid between (0, 0), (2, 0), (1,
/// 1) and (0, 1), whose corners have different shares.
#[test]
fn areas_of_nodes_have_the_centroid_of_the_facet() {
    let corners = [[0.0, 0.0], [2.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let points = [0.0, 1.0].map(|z| corners.map(|[x, y]| [x, y, z])).concat();
    let mut mesh = Mesh::new(3, points, [(CellKind::Hexahedron, (0..8).collect())]).unwrap();
    mesh.mark_boundary("bottom", |f| f.normal[2] < -0.9);
    mesh.mark_boundary("top", |f| f.normal[2] > 0.9);
    let system = Elasticity::new(mesh, Material::lame(1.0, 1.0).unwrap())
        .fix("top")
        .assemble()
        .unwrap();
    let ground = Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]);
    let rows = system.contact("bottom", &ground).unwrap();
    let moment = |power: &dyn Fn([f64; 3]) -> f64| -> f64 {
        rows.areas
            .iter()
            .zip(&rows.points)
            .map(|(a, x)| a * power(*x))
            .sum()
    };
    let found = [moment(&|_| 1.0), moment(&|x| x[0]), moment(&|x| x[1])];
    for (found, exact) in found.into_iter().zip([1.5, 7.0 / 6.0, 2.0 / 3.0]) {
        assert!((found - exact).abs() < 1e-14, "{found} {exact}");
    }
}

/// Resultants of forces that are monomials, over one reference cell: quadrature of simplices of second order is exact to degree 4 and 5,
/// that of boxes to degree 5 in each coordinate.
#[test]
fn monomials_are_integrated_exactly() {
    let simplex = |dim: usize| {
        let kind = if dim == 2 {
            CellKind::Triangle
        } else {
            CellKind::Tetrahedron
        };
        let corner = |k: usize| std::array::from_fn(|d| if k == d + 1 { 1.0 } else { 0.0 });
        Mesh::new(
            dim,
            (0..=dim).map(corner).collect(),
            [(kind, (0..=dim).collect())],
        )
        .unwrap()
    };
    let factorial = |n: u32| (1..=n).product::<u32>() as f64;
    let square = Mesh::rectangle([0.0; 2], [1.0; 2], [1, 1]).unwrap();
    let cube = Mesh::block([0.0; 3], [1.0; 3], [1, 1, 1]).unwrap();
    for mesh in raised(&[simplex(2), square, simplex(3), cube]) {
        let (dim, kind) = (mesh.dim(), mesh.kind(0));
        let is_simplex = matches!(kind, CellKind::Triangle6 | CellKind::Tetrahedron10);
        let system = Elasticity::new(mesh, Material::lame(1.0, 1.0).unwrap())
            .floating()
            .discretize()
            .unwrap();
        let most = if kind == CellKind::Triangle6 { 4 } else { 5 };
        for (a, b, c) in
            (0..=most).flat_map(|a| (0..=most).flat_map(move |b| (0..=most).map(move |c| (a, b, c))))
        {
            if dim == 2 && c > 0 || is_simplex && a + b + c > most {
                continue;
            }
            let power = |[x, y, z]: [f64; 3]| x.powi(a as i32) * y.powi(b as i32) * z.powi(c as i32);
            let load = system.body_force(|x| [power(x), 0.0, 0.0]).unwrap();
            let exact = match is_simplex {
                true => factorial(a) * factorial(b) * factorial(c) / factorial(a + b + c + dim as u32),
                false => 1.0 / f64::from((a + 1) * (b + 1) * (c + 1)),
            };
            let found: f64 = load.iter().sum();
            assert!(
                (found - exact).abs() < 1e-15,
                "{} {a} {b} {c}: {found} {exact}",
                kind.name()
            );
        }
    }
}
