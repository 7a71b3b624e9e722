//! The mean dilatation of quadrilaterals and hexahedra.

use semismooth::fem::{Dilatation, ElasticSystem, Elasticity, Material, Mesh, PlaneModel};
use semismooth::linear::{Cholesky, LinearSolver};

/// u = A⁻¹ f of a system under its supports and other forces.
pub fn solved(system: &ElasticSystem, forces: &[f64]) -> Vec<f64> {
    let a = system.stiffness();
    let mut solver = Cholesky::new();
    solver.analyze(a.pattern().as_ref()).unwrap();
    solver.factor(a.as_ref()).unwrap();
    let mut u = system.supports().forces().to_vec();
    u.iter_mut().zip(forces).for_each(|(u, f)| *u += f);
    solver.solve_in_place(&mut u).unwrap();
    u
}

/// Vertical reaction at the top of a block of height 1 on a smooth table, bonded to a plate that presses it down by 0.01.
pub fn resultant(mesh: Mesh, poisson: f64, dilatation: Dilatation) -> f64 {
    let (dim, up) = (mesh.dim(), mesh.dim() - 1);
    let mut body = Elasticity::new(mesh, Material::isotropic(1.0, poisson).unwrap())
        .with_dilatation(dilatation)
        .fix_component("bottom", up);
    for d in 0..dim {
        body = body.prescribe("top", d, move |_| if d == up { -0.01 } else { 0.0 });
    }
    let system = body.assemble().unwrap();
    let reactions = system
        .reactions(&solved(&system, &[]), system.supports().displacements())
        .unwrap();
    let top = system
        .mesh()
        .points()
        .iter()
        .enumerate()
        .filter(|p| p.1[up] > 1.0 - 1e-12);
    -top.map(|(node, _)| reactions[dim * node + up]).sum::<f64>()
}

fn rectangle(n: usize) -> Mesh {
    Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2 * n, n]).unwrap()
}

/// References: quadrilaterals of nine nodes on meshes of 4 to 32 cells, extrapolated (programmed apart); their last two differ by 2e-4.
#[test]
fn nearly_incompressible_blocks_do_not_lock() {
    for (poisson, exact) in [(0.3, 0.023_118_7), (0.49, 0.033_793), (0.4999, 0.034_985)] {
        let error = |d: Dilatation, n: usize| resultant(rectangle(n), poisson, d) / exact - 1.0;
        let (mean, pointwise) = (error(Dilatation::Mean, 8), error(Dilatation::Pointwise, 8));
        assert!(mean.abs() < 0.02, "{poisson}: {mean}");
        // The order is that of the singularities at the corners, between 1 and 2.
        assert!(error(Dilatation::Mean, 16).abs() < 0.6 * mean.abs());
        let automatic = error(Dilatation::Automatic, 8);
        assert_eq!(automatic, if poisson > 0.45 { mean } else { pointwise });
        // Displacements in a subspace make a body too stiff.
        assert!(pointwise > 0.0 && (poisson < 0.45 || pointwise > 3.0 * mean.abs()));
        let simplices = rectangle(4).simplices().unwrap();
        let both =
            [Dilatation::Mean, Dilatation::Pointwise].map(|d| resultant(simplices.clone(), poisson, d));
        assert_eq!(both[0], both[1]);
    }
}

/// A bar of hexahedra that cannot move across is one of quadrilaterals in plane strain: the 33 strain of the mean is part of both.
#[test]
fn hexahedra_in_plane_strain_are_quadrilaterals() {
    let plane = resultant(rectangle(3), 0.499, Dilatation::Mean);
    let block = Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [6, 1, 3]).unwrap();
    let body = Elasticity::new(block, Material::isotropic(1.0, 0.499).unwrap())
        .fix_component("bottom", 2)
        .fix_component("front", 1)
        .fix_component("back", 1)
        .fix_component("top", 0)
        .prescribe("top", 2, |_| -0.01);
    let system = body.assemble().unwrap();
    let reactions = system
        .reactions(&solved(&system, &[]), system.supports().displacements())
        .unwrap();
    let top = system
        .mesh()
        .points()
        .iter()
        .enumerate()
        .filter(|p| p.1[2] == 1.0);
    let space = -top.map(|(node, _)| reactions[3 * node + 2]).sum::<f64>();
    assert!((space - plane).abs() < 1e-12 * plane, "{space} {plane}");
}

/// Uniform strain has the mean for itself: stresses are exact, also in distorted cells; plane stress stays pointwise.
#[test]
fn uniform_strain_is_exact() {
    let points = [
        [0.0, 0.0],
        [1.0, 0.0],
        [2.0, 0.0],
        [0.0, 1.0],
        [1.3, 0.8],
        [2.0, 1.0],
        [0.0, 2.0],
        [0.8, 2.0],
        [2.0, 2.0],
    ];
    let cells = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]];
    let kind = semismooth::fem::CellKind::Quadrilateral;
    let points = points.map(|[x, y]| [x, y, 0.0]).to_vec();
    let mut mesh = Mesh::new(2, points, cells.map(|c| (kind, c.to_vec()))).unwrap();
    mesh.mark_boundary("all", |_| true);
    let material = Material::isotropic(2.0, 0.49).unwrap();
    let field = |d: usize, x: [f64; 3]| [0.01 * x[0] - 0.02 * x[1], 0.005 * x[0] + 0.004 * x[1]][d];
    for plane in [PlaneModel::Strain, PlaneModel::Stress] {
        let body = Elasticity::new(mesh.clone(), material.clone()).with_plane_model(plane);
        let body = body
            .prescribe("all", 0, move |x| field(0, x))
            .prescribe("all", 1, move |x| field(1, x));
        let stresses = |d: Dilatation| {
            let system = body.clone().with_dilatation(d).assemble().unwrap();
            assert_eq!(system.notes().is_empty(), plane == PlaneModel::Stress);
            let u = solved(&system, &[]);
            assert!((u[0] - field(0, [1.3, 0.8, 0.0])).abs() < 1e-15);
            system.stresses(&u, system.supports().displacements()).unwrap()
        };
        let (mean, pointwise) = (stresses(Dilatation::Mean), stresses(Dilatation::Pointwise));
        for (m, p) in mean.iter().flatten().zip(pointwise.iter().flatten()) {
            assert!((m - p).abs() < 1e-13);
        }
    }
}
