//! Finite elements: patch tests, observed orders, rigid motions, refinement, bad input, plasticity.

mod axisymmetric;
mod dilatation;
mod integrals;
mod plastic;
#[path = "../common/random.rs"]
mod random;
mod second_order;
mod springs;
mod wedges;

use random::Random;
use semismooth::fem::{
    CellKind, Elasticity, FemError, Foundation, Material, Mesh, MultiplierSpace, PlaneModel,
};
use semismooth::linear::{Cholesky, DenseLu, LinearSolver};
use semismooth::sparse::Matrix;

fn solve(system: &semismooth::fem::ElasticSystem, load: &[f64]) -> Vec<f64> {
    let mut solver = Cholesky::default();
    solver.analyze(system.stiffness().pattern().as_ref()).unwrap();
    solver.factor(system.stiffness().as_ref()).unwrap();
    let mut u: Vec<f64> = load
        .iter()
        .zip(system.supports().forces())
        .map(|(f, l)| f + l)
        .collect();
    solver.solve_in_place(&mut u).unwrap();
    system
        .displacements(&u, system.supports().displacements())
        .unwrap()
}

/// Meshes of each kind of cell of first order: (0, 2) × (0, 1) with n cells along y, (0, 2) × (0, 1)² with n along y and z.
fn first_order(n: usize) -> Vec<Mesh> {
    let plane = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [n + 1, n]).unwrap();
    let solid = Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [n + 1, n, n]).unwrap();
    vec![
        plane.simplices().unwrap(),
        plane,
        solid.simplices().unwrap(),
        solid,
    ]
}

/// The same of each kind of second order: P2, Q2, P2 in space, Q2 in space, serendipity in the plane and in space.
fn raised(meshes: &[Mesh]) -> Vec<Mesh> {
    let full = meshes.iter().map(|m| m.second_order().unwrap());
    let thin = meshes.iter().skip(1).step_by(2).map(|m| m.serendipity().unwrap());
    full.chain(thin).collect()
}

/// A mesh with its nodes moved, and its whole boundary as the group "all".
fn moved(mesh: &Mesh, to: impl Fn([f64; 3]) -> [f64; 3]) -> Mesh {
    let points = mesh.points().iter().map(|p| to(*p)).collect();
    let cells = (0..mesh.num_cells()).map(|c| (mesh.kind(c), mesh.cell(c).to_vec()));
    let mut bent = Mesh::new(mesh.dim(), points, cells).unwrap();
    bent.mark_boundary("all", |_| true);
    bent
}

/// A distorted mesh of each kind of first order.
fn meshes() -> Vec<Mesh> {
    let bend = |[x, y, z]: [f64; 3]| {
        [
            x + 0.1 * y * z + 0.05 * y * y,
            y + 0.1 * x * x,
            z * (1.0 + 0.1 * x),
        ]
    };
    let plane = Mesh::rectangle([0.0, 0.0], [1.0, 1.5], [3, 4]).unwrap();
    let solid = Mesh::block([0.0; 3], [1.0, 1.5, 0.8], [2, 3, 2]).unwrap();
    let all = [
        plane.simplices().unwrap(),
        plane,
        solid.simplices().unwrap(),
        solid,
    ];
    all.iter().map(|m| moved(m, bend)).collect()
}

/// A distorted mesh of each kind, those of second order with curved edges and faces.
fn all_meshes() -> Vec<Mesh> {
    let bend = |[x, y, z]: [f64; 3]| {
        let wave = 0.03 * (7.0 * x + 5.0 * y - 3.0 * z).sin();
        [x + wave, y - 0.7 * wave, z + 0.4 * wave]
    };
    let plane = Mesh::rectangle([0.0, 0.0], [1.0, 1.5], [2, 3]).unwrap();
    let solid = Mesh::block([0.0; 3], [1.0, 1.5, 0.8], [2, 2, 1]).unwrap();
    let all = [
        plane.simplices().unwrap(),
        plane,
        solid.simplices().unwrap(),
        solid,
    ];
    let cut = [CellKind::Wedge, CellKind::Pyramid].map(|kind| wedges::cut(2, kind));
    let cut = cut
        .iter()
        .flat_map(|m| [moved(m, bend), moved(&m.serendipity().unwrap(), bend)]);
    let cut = cut.collect::<Vec<_>>();
    let second = raised(&all).iter().map(|m| moved(m, bend)).collect::<Vec<_>>();
    meshes().into_iter().chain(second).chain(cut).collect()
}

/// Linear displacements are reproduced exactly, for every kind of cell, with a general anisotropic tensor.
#[test]
fn patch() {
    // A random positive definite matrix with the symmetries of an elasticity tensor.
    let mut c = Material::isotropic(3.0, 0.3).unwrap().components();
    let bump = [0.3, 0.1, -0.2, 0.25, 0.15, -0.1];
    let place = |i: usize, j: usize| [[0, 3, 5], [3, 1, 4], [5, 4, 2]][i][j];
    for i in 0..3 {
        for j in 0..3 {
            for k in 0..3 {
                for l in 0..3 {
                    c[i][j][k][l] += bump[place(i, j)] * bump[place(k, l)];
                }
            }
        }
    }
    let gradient = [[0.3, -0.2, 0.1], [0.15, 0.4, -0.3], [0.2, 0.1, -0.25]];
    for mesh in all_meshes() {
        let dim = mesh.dim();
        let value = move |x: [f64; 3], d: usize| (0..dim).map(|e| gradient[d][e] * x[e]).sum::<f64>();
        let mut body = Elasticity::new(mesh.clone(), Material::tensor(&c).unwrap());
        for d in 0..dim {
            body = body.prescribe("all", d, move |x| value(x, d));
        }
        let system = body.assemble().unwrap();
        let u = solve(&system, &vec![0.0; system.num_free()]);
        for (node, x) in mesh.points().iter().enumerate() {
            for d in 0..dim {
                assert!((u[dim * node + d] - value(*x, d)).abs() < 1e-13);
            }
        }
    }
}

/// Rigid motions, translations and rotations, cost no force: K r = 0, seen from the supports (K_ff r_f + K_fs r_s = 0).
#[test]
fn rigid_motions() {
    for mesh in all_meshes() {
        let dim = mesh.dim();
        let spin = if dim == 2 {
            [0.0, 0.0, 0.7]
        } else {
            [0.3, -0.5, 0.7]
        };
        let motion = move |x: [f64; 3]| {
            [
                0.2 + spin[1] * x[2] - spin[2] * x[1],
                -0.1 + spin[2] * x[0] - spin[0] * x[2],
                0.4 + spin[0] * x[1] - spin[1] * x[0],
            ]
        };
        let mut body = Elasticity::new(mesh.clone(), Material::lame(1.3, 0.8).unwrap());
        for d in 0..dim {
            body = body.prescribe("all", d, move |x| motion(x)[d]);
        }
        let system = body.assemble().unwrap();
        let mut residual: Vec<f64> = system.supports().forces().iter().map(|l| -l).collect();
        let mut r = vec![0.0; system.num_free()];
        for (node, x) in mesh.points().iter().enumerate() {
            for d in 0..dim {
                if let Some(dof) = system.dof(node, d) {
                    r[dof] = motion(*x)[d];
                }
            }
        }
        system.stiffness().as_ref().mul_add(1.0, &r, &mut residual);
        assert!(residual.iter().all(|v| v.abs() < 1e-13));
        // The matrix is symmetric to the last bit.
        let transpose = system.stiffness().transpose();
        assert_eq!(system.stiffness().values(), transpose.values());
    }
}

/// A manufactured solution u = (sin πx sin πy, …): nodal errors in the mean decrease as h².
#[test]
fn observed_order() {
    use std::f64::consts::PI;
    let (lambda, mu) = (1.2, 0.9);
    let force = move |x: [f64; 3]| {
        // −div σ of u = (s, 0.5 s), s = sin πx sin πy.
        let s = (PI * x[0]).sin() * (PI * x[1]).sin();
        let c = (PI * x[0]).cos() * (PI * x[1]).cos();
        let along =
            |own: f64, other: f64| PI * PI * ((lambda + 3.0 * mu) * own * s - (lambda + mu) * other * c);
        [along(1.0, 0.5), along(0.5, 1.0), 0.0]
    };
    for triangles in [false, true] {
        let errors: Vec<f64> = [16usize, 32, 64]
            .iter()
            .map(|&n| {
                let mut mesh = Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [n, n]).unwrap();
                if triangles {
                    mesh = mesh.simplices().unwrap();
                }
                mesh.mark_boundary("all", |_| true);
                let system = Elasticity::new(mesh.clone(), Material::lame(lambda, mu).unwrap())
                    .fix("all")
                    .assemble()
                    .unwrap();
                let u = solve(&system, &system.body_force(force).unwrap());
                let sum: f64 = mesh
                    .points()
                    .iter()
                    .enumerate()
                    .map(|(k, p)| {
                        let s = (PI * p[0]).sin() * (PI * p[1]).sin();
                        (u[2 * k] - s).powi(2) + (u[2 * k + 1] - 0.5 * s).powi(2)
                    })
                    .sum();
                (sum / mesh.num_nodes() as f64).sqrt()
            })
            .collect();
        for pair in errors.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!((1.9..2.1).contains(&order), "{order} {errors:?}");
        }
    }
}

/// Uniaxial tension: axial strain E⁻¹ σ, transverse −ν E⁻¹ σ in plane stress; stiffer in plane strain; exact in space.
#[test]
fn tension() {
    let (young, poisson) = (2.5, 0.3);
    let material = Material::isotropic(young, poisson).unwrap();
    let pull = |mesh: Mesh, plane: PlaneModel| {
        let dim = mesh.dim();
        let mut body = Elasticity::new(mesh, material.clone())
            .with_plane_model(plane)
            .fix_component("left", 0)
            .fix_component("bottom", dim - 1);
        if dim == 3 {
            body = body.fix_component("front", 1);
        }
        let system = body.assemble().unwrap();
        let u = solve(&system, &system.traction("right", |_| [0.5, 0.0, 0.0]).unwrap());
        let far = system
            .mesh()
            .points()
            .iter()
            .position(|p| p[..dim].iter().all(|x| (x - 1.0).abs() < 1e-12))
            .unwrap();
        (u[dim * far], u[dim * far + dim - 1])
    };
    let strain = 0.5 / young;
    let square = || Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [2, 3]).unwrap();
    let cases = [
        (pull(square(), PlaneModel::Stress), (strain, -poisson * strain)),
        (
            pull(square(), PlaneModel::Strain),
            (
                strain * (1.0 - poisson * poisson),
                -strain * poisson * (1.0 + poisson),
            ),
        ),
        (
            pull(
                Mesh::block([0.0; 3], [1.0; 3], [2, 1, 3]).unwrap(),
                PlaneModel::Strain,
            ),
            (strain, -poisson * strain),
        ),
    ];
    for (found, expected) in cases {
        assert!((found.0 - expected.0).abs() < 1e-13 && (found.1 - expected.1).abs() < 1e-13);
    }
}

/// Two materials by group against the mixture rule of springs in series.
#[test]
fn materials_by_group() {
    let mut mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2]).unwrap();
    assert_eq!(mesh.mark_cells("soft", |c| c[0] > 1.0), 4);
    let system = Elasticity::new(mesh, Material::isotropic(2.0, 0.0).unwrap())
        .with_material("soft", Material::isotropic(0.5, 0.0).unwrap())
        .fix_component("left", 0)
        .fix_component("bottom", 1)
        .assemble()
        .unwrap();
    let u = solve(&system, &system.traction("right", |_| [1.0, 0.0, 0.0]).unwrap());
    assert!((u[2 * 4] - (1.0 / 2.0 + 1.0 / 0.5)).abs() < 1e-13);
}

/// Where groups of cells overlap, the material given last holds: springs in series of stiffness 2, 1/2 and 4.
#[test]
fn of_materials_of_one_cell_the_last_one_holds() {
    let mut mesh = Mesh::rectangle([0.0, 0.0], [3.0, 1.0], [3, 1]).unwrap();
    assert_eq!(mesh.mark_cells("right half", |c| c[0] > 1.0), 2);
    assert_eq!(mesh.mark_cells("end", |c| c[0] > 2.0), 1);
    let material = |young: f64| Material::isotropic(young, 0.0).unwrap();
    let system = Elasticity::new(mesh, material(2.0))
        .with_material("right half", material(0.5))
        .with_material("end", material(4.0))
        .fix_component("left", 0)
        .fix_component("bottom", 1)
        .assemble()
        .unwrap();
    let u = solve(&system, &system.traction("right", |_| [1.0, 0.0, 0.0]).unwrap());
    assert!((u[2 * 3] - (1.0 / 2.0 + 1.0 / 0.5 + 1.0 / 4.0)).abs() < 1e-13);
}

/// In plane stress a plate of any material has the strains of a body without forces on its faces: those of the compliance in space for the
/// stresses (σ₁₁, σ₂₂, 0, σ₁₂, 0, 0), whose other strains are free.
#[test]
fn plates_in_plane_stress_are_free_of_forces_on_their_faces() {
    const PLACES: [[usize; 2]; 6] = [[0, 0], [1, 1], [2, 2], [0, 1], [1, 2], [0, 2]];
    let mut c = Material::isotropic(3.0, 0.3).unwrap().components();
    let bump = [[0.3, 0.25, -0.4], [0.25, 0.1, 0.35], [-0.4, 0.35, -0.2]];
    for k in 0..81 {
        let [i, j, k, l] = [k / 27, k / 9 % 3, k / 3 % 3, k % 3];
        c[i][j][k][l] += bump[i][j] * bump[k][l];
    }
    let gradient = [[0.3, -0.2], [0.15, 0.4]];
    let mut body = Elasticity::new(meshes().swap_remove(0), Material::tensor(&c).unwrap())
        .with_plane_model(PlaneModel::Stress);
    for (d, row) in gradient.into_iter().enumerate() {
        body = body.prescribe("all", d, move |x| row[0] * x[0] + row[1] * x[1]);
    }
    let system = body.assemble().unwrap();
    let mut free = system.supports().forces().to_vec();
    let mut solver = Cholesky::default();
    solver.analyze(system.stiffness().pattern().as_ref()).unwrap();
    solver.factor(system.stiffness().as_ref()).unwrap();
    solver.solve_in_place(&mut free).unwrap();
    let rows = PLACES.map(|[i, j]| PLACES.map(|[k, l]| c[i][j][k][l]));
    let stiffness = Matrix::from_rows(&rows).unwrap();
    let mut compliance = DenseLu::new();
    compliance.analyze(stiffness.pattern().as_ref()).unwrap();
    compliance.factor(stiffness.as_ref()).unwrap();
    for mut strain in system.stresses(&free, system.supports().displacements()).unwrap() {
        assert_eq!([strain[2], strain[4], strain[5]], [0.0; 3]);
        compliance.solve_in_place(&mut strain).unwrap();
        let shear = gradient[0][1] + gradient[1][0];
        for (k, expected) in [(0, gradient[0][0]), (1, gradient[1][1]), (3, shear)] {
            assert!((strain[k] - expected).abs() < 1e-13, "{strain:?}");
        }
    }
}

/// σ = Σ over five symmetric b of b (b : ε), each with a common sixth component beside its own one: some strain costs no energy, which
/// rounding does not hide.
#[test]
fn tensors_with_a_strain_without_energy_are_refused() {
    let mut random = Random::new(8);
    for _ in 0..40 {
        let mut c = [[[[0.0; 3]; 3]; 3]; 3];
        for [i, j] in [[0, 0], [1, 1], [2, 2], [0, 1], [1, 2]] {
            let mut b = [[0.0; 3]; 3];
            let (own, common) = (random.between(0.5, 1.5), random.between(0.5, 1.5));
            (b[i][j], b[j][i]) = (own, own);
            (b[0][2], b[2][0]) = (common, common);
            for k in 0..81 {
                let [i, j, k, l] = [k / 27, k / 9 % 3, k / 3 % 3, k % 3];
                c[i][j][k][l] += b[i][j] * b[k][l];
            }
        }
        let found = Material::tensor(&c);
        assert!(
            matches!(found, Err(FemError::TensorDefinite { pivot: 5, .. })),
            "{found:?}"
        );
    }
}

/// Tetrahedra refined four times, those inside cut along the shortest diagonal, keep their shape: an edge is at most this many times as long
/// as the cube root of the volume.
#[test]
fn refined_tetrahedra_do_not_degenerate() {
    let slender = |mesh: &Mesh| -> f64 {
        let of_cell = |cell: usize| {
            let [p, q, r, s] = [0, 1, 2, 3].map(|k| mesh.points()[mesh.cell(cell)[k]]);
            let from = |a: [f64; 3], b: [f64; 3]| [0, 1, 2].map(|d| b[d] - a[d]);
            let [u, v, w] = [from(p, q), from(p, r), from(p, s)];
            let volume = (0..3)
                .map(|d| u[d] * (v[(d + 1) % 3] * w[(d + 2) % 3] - v[(d + 2) % 3] * w[(d + 1) % 3]))
                .sum::<f64>()
                / 6.0;
            let edges = [u, v, w, from(q, r), from(q, s), from(r, s)];
            let longest = edges.iter().map(|e| e.iter().map(|v| v * v).sum::<f64>().sqrt());
            longest.fold(0.0, f64::max) / volume.cbrt()
        };
        (0..mesh.num_cells()).map(of_cell).fold(0.0, f64::max)
    };
    let mut mesh = Mesh::block([0.0; 3], [1.0; 3], [1; 3])
        .unwrap()
        .simplices()
        .unwrap();
    let first = slender(&mesh);
    for level in 1..5 {
        mesh = mesh.refined().unwrap();
        let found = slender(&mesh);
        assert!(found <= first * (1.0 + 1e-12), "{level}: {found} {first}");
    }
}

/// Refinement keeps volumes, groups and boundaries, and gives the energy of nested spaces: displacement under a load grows.
#[test]
fn refinement() {
    for mesh in meshes() {
        let fine = mesh.refined().unwrap();
        let children = if mesh.dim() == 2 { 4 } else { 8 };
        assert_eq!(fine.num_cells(), children * mesh.num_cells());
        let faces = if mesh.dim() == 2 { 2 } else { 4 };
        assert_eq!(fine.boundary().len(), faces * mesh.boundary().len());
        assert_eq!(
            fine.facet_group("all").unwrap().len(),
            faces * mesh.facet_group("all").unwrap().len()
        );
        let area = |m: &Mesh| -> [f64; 3] {
            let mut sum = [0.0; 3];
            for f in m.boundary() {
                (0..3).for_each(|d| sum[d] += f.normal[d] * f.measure);
            }
            sum
        };
        // Boundaries are closed.
        for m in [&mesh, &fine] {
            assert!(area(m).iter().all(|a| a.abs() < 1e-12));
        }
        let work = |m: &Mesh| {
            let mut m = m.clone();
            m.mark_boundary("foot", |f| f.normal[1] < -0.8);
            m.mark_boundary("head", |f| f.normal[1] > 0.8);
            let system = Elasticity::new(m, Material::lame(1.0, 1.0).unwrap())
                .fix("foot")
                .assemble()
                .unwrap();
            let load = system.body_force(|_| [1.0, 0.5, 0.2]).unwrap();
            let mut solver = Cholesky::default();
            solver.analyze(system.stiffness().pattern().as_ref()).unwrap();
            solver.factor(system.stiffness().as_ref()).unwrap();
            let mut u = load.clone();
            solver.solve_in_place(&mut u).unwrap();
            u.iter().zip(&load).map(|(u, f)| u * f).sum::<f64>()
        };
        if matches!(mesh.kind(0), CellKind::Triangle | CellKind::Tetrahedron) {
            let (coarse, finer) = (work(&mesh), work(&fine));
            assert!(finer > coarse && finer < 2.5 * coarse, "{coarse} {finer}");
        }
    }
}

#[test]
fn contact_frames() {
    let mesh = Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [2, 2, 1]).unwrap();
    let system = Elasticity::new(mesh, Material::lame(1.0, 1.0).unwrap())
        .fix("left")
        .assemble()
        .unwrap();
    let ground = Foundation::plane([0.0, 0.0, -0.25], [0.0, 0.0, 2.0]).with_tangent(|_| [1.0, 1.0, 5.0]);
    let rows = system.contact("bottom", &ground).unwrap();
    assert_eq!(rows.nodes.len(), 6);
    assert!((rows.areas.iter().sum::<f64>() - 1.5).abs() < 1e-14); // the clamped nodes carry the rest
    let s = 0.5f64.sqrt();
    for i in 0..6 {
        assert_eq!(rows.normals[i], [0.0, 0.0, -1.0]);
        assert!((rows.gap[i] - 0.25).abs() < 1e-15);
        let [t1, t2] = rows.tangents[i];
        for (t, expected) in [(t1, [s, s, 0.0]), (t2, [-s, s, 0.0])] {
            assert!((0..3).all(|d| (t[d] - expected[d]).abs() < 1e-15), "{t:?}");
        }
    }
}

#[test]
fn bad_input() {
    let square = || Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [2, 2]).unwrap();
    let steel = || Material::isotropic(1.0, 0.3).unwrap();
    // Geometry.
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let quad = |nodes: [usize; 4]| vec![(CellKind::Quadrilateral, nodes.to_vec())];
    assert!(matches!(
        Mesh::new(2, points.clone(), quad([0, 3, 2, 1])),
        Err(FemError::Jacobian { cell: 0, .. })
    ));
    assert!(Mesh::oriented(2, points.clone(), quad([0, 3, 2, 1])).is_ok());
    assert!(matches!(
        Mesh::oriented(2, points.clone(), quad([0, 2, 1, 3])),
        Err(FemError::Jacobian { .. })
    ));
    assert!(matches!(
        Mesh::new(2, points.clone(), quad([0, 1, 2, 7])),
        Err(FemError::NoSuchNode { node: 7, .. })
    ));
    assert!(matches!(
        Mesh::new(2, points.clone(), vec![(CellKind::Triangle, vec![0, 1, 2])]),
        Err(FemError::LooseNode { node: 3 })
    ));
    let mut flawed = points.clone();
    flawed[2][1] = f64::NAN;
    assert!(matches!(
        Mesh::new(2, flawed, quad([0, 1, 2, 3])),
        Err(FemError::Coordinate { node: 2, .. })
    ));
    assert!(matches!(
        Mesh::new(2, vec![], vec![]),
        Err(FemError::Empty { .. })
    ));
    assert!(matches!(
        Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [0, 2]),
        Err(FemError::Empty { .. } | FemError::Grading { .. })
    ));
    assert!(matches!(
        Mesh::rectangle_graded(&[0.0, 0.5, 0.5], &[0.0, 1.0]),
        Err(FemError::Grading {
            axis: "x",
            line: 2,
            ..
        })
    ));
    // Materials.
    for (young, poisson) in [
        (0.0, 0.3),
        (f64::NAN, 0.3),
        (1.0, 0.5),
        (1.0, -1.0),
        (1.0, f64::NAN),
    ] {
        assert!(Material::isotropic(young, poisson).is_err());
    }
    let mut c = steel().components();
    c[0][1][0][1] += 0.1;
    assert!(matches!(
        Material::tensor(&c),
        Err(FemError::TensorSymmetry { .. })
    ));
    let c = Material::lame(1.0, 1.0)
        .unwrap()
        .components()
        .map(|a| a.map(|b| b.map(|d| d.map(|e| -e))));
    assert!(matches!(
        Material::tensor(&c),
        Err(FemError::TensorDefinite { .. })
    ));
    // Supports and groups.
    let error = Elasticity::new(square(), steel())
        .fix("ground")
        .assemble()
        .unwrap_err();
    assert!(error.to_string().contains("\"bottom\""), "{error}");
    let mut empty = square();
    empty.mark_boundary("nowhere", |_| false);
    assert!(matches!(
        Elasticity::new(empty, steel()).fix("nowhere").assemble(),
        Err(FemError::EmptyGroup { .. })
    ));
    for (body, modes) in [
        (
            Elasticity::new(square(), steel()),
            "translation along x, translation along y, rotation about z",
        ),
        (
            Elasticity::new(square(), steel()).fix_component("bottom", 1),
            "translation along x",
        ),
    ] {
        match body.assemble() {
            Err(FemError::Floating { modes: found, node }) => assert_eq!((found.as_str(), node), (modes, 0)),
            other => panic!("{other:?}"),
        }
    }
    // Two separate squares, one of them supported: the other one is named by its first node.
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let points = [0.0, 2.0]
        .map(|at| corners.map(|[x, y]| [x + at, y, 0.0]))
        .concat();
    let cells = [0, 4].map(|n| (CellKind::Quadrilateral, vec![n, n + 1, n + 2, n + 3]));
    let mut apart = Mesh::new(2, points, cells).unwrap();
    apart.add_facet_group("first", vec![vec![3, 0]]).unwrap();
    apart.add_facet_group("second", vec![vec![7, 4]]).unwrap();
    let body = Elasticity::new(apart, steel()).fix("first");
    match body.assemble() {
        Err(FemError::Floating { node, modes }) => assert!(node == 4 && modes.contains("1 of 2"), "{modes}"),
        other => panic!("{other:?}"),
    }
    assert!(body.fix_component("second", 0).assemble().is_err());
    assert!(matches!(
        Elasticity::new(square(), steel())
            .fix_component("bottom", 2)
            .assemble(),
        Err(FemError::Component { component: 2, dim: 2 })
    ));
    let body = Elasticity::new(square(), steel());
    assert!(matches!(
        body.clone().prescribe("bottom", 0, |_| f64::NAN).assemble(),
        Err(FemError::NotFinite { .. })
    ));
    let system = body.fix("top").assemble().unwrap();
    assert!(matches!(
        system.traction("left", |_| [f64::INFINITY, 0.0, 0.0]),
        Err(FemError::NotFinite { .. })
    ));
    assert!(system.body_force(|_| [0.0, f64::NAN, 0.0]).is_err());
    assert!(matches!(
        system.contact("top", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0])),
        Err(FemError::EmptyGroup { .. })
    ));
    assert!(matches!(
        system.contact("bottom", &Foundation::plane([0.0; 3], [0.0; 3])),
        Err(FemError::Frame { .. })
    ));
    // The normal of the ground points up, to the body.
    for multipliers in [MultiplierSpace::Nodal, MultiplierSpace::DualCells] {
        let turned = Foundation::plane([0.0; 3], [0.0, -1.0, 0.0]);
        let error = system.contact_with("bottom", &turned, multipliers).unwrap_err();
        assert!(error.to_string().contains("points into the body"), "{error}");
    }
    // A support that moves along the tangent, and axes oblique to a component that is held.
    let sliding = |value: f64| {
        let body = Elasticity::new(square(), steel()).fix("top");
        body.prescribe("left", 0, move |_| value).assemble().unwrap()
    };
    assert!(matches!(
        sliding(0.1).contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0])),
        Err(FemError::ContactFixed {
            direction: "tangential",
            ..
        })
    ));
    assert!(matches!(
        sliding(0.0).contact("bottom", &Foundation::plane([0.0; 3], [0.6, 0.8, 0.0])),
        Err(FemError::ObliqueAxis {
            direction: "normal",
            ..
        })
    ));
}

/// Nodes whose cells all belong to one part of a body have the same rows, loads and contact rows in the part; the part may float and have
/// empty groups.
#[test]
fn parts() {
    let whole = Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [4, 2, 2]).unwrap();
    let half = Mesh::block([1.0, 0.0, 0.0], [2.0, 1.0, 1.0], [2, 2, 2]).unwrap();
    let cells = (0..half.num_cells()).map(|c| (half.kind(c), half.cell(c).to_vec()));
    let mut part = Mesh::new(3, half.points().to_vec(), cells).unwrap();
    part.add_facet_group("left", Vec::new()).unwrap();
    for name in ["bottom", "top"] {
        let facets = half.facet_group(name).unwrap().to_vec();
        part.add_facet_group(name, facets).unwrap();
    }
    let material = || Material::isotropic(1.0, 0.3).unwrap();
    let on = |mesh: Mesh| Elasticity::new(mesh, material()).fix("left").assemble();
    assert!(matches!(on(part.clone()), Err(FemError::EmptyGroup { .. })));
    assert!(matches!(
        Elasticity::new(part.clone(), material()).assemble(),
        Err(FemError::Floating { .. })
    ));
    let (whole, part) = (on(whole).unwrap(), on(part.into_part()).unwrap());
    let place = |node: usize| {
        let at = part.mesh().points()[node];
        let found = whole.mesh().points().iter().position(|p| *p == at).unwrap();
        (found, at[0] > 1.25)
    };
    let ground = Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]);
    let rows = [&whole, &part].map(|s| s.contact("bottom", &ground).unwrap());
    let loads = [&whole, &part].map(|s| s.traction("top", |x| [x[1], 0.1, x[0]]).unwrap());
    let mut compared = 0;
    for (node, d) in (0..part.mesh().num_nodes()).flat_map(|n| (0..3).map(move |d| (n, d))) {
        let (other, inside) = place(node);
        if !inside {
            continue;
        }
        let (k, l) = (part.dof(node, d).unwrap(), whole.dof(other, d).unwrap());
        assert!((loads[1][k] - loads[0][l]).abs() < 1e-15);
        for (m, e) in (0..part.mesh().num_nodes()).flat_map(|n| (0..3).map(move |d| (n, d))) {
            let (i, j) = (part.dof(m, e).unwrap(), whole.dof(place(m).0, e).unwrap());
            assert!((part.stiffness().get(k, i) - whole.stiffness().get(l, j)).abs() < 1e-14);
            compared += 1;
        }
        let row = |which: usize, node: usize| rows[which].nodes.iter().position(|n| *n == node);
        if let Some(i) = row(1, node) {
            let j = row(0, other).unwrap();
            assert!((rows[1].areas[i] - rows[0].areas[j]).abs() < 1e-15);
            assert_eq!(rows[1].normals[i], rows[0].normals[j]);
        }
    }
    assert_eq!(compared, (18 * 3) * (27 * 3));
    // Far from the ground, and all of it fixed.
    let mut top = Mesh::block([0.0; 3], [1.0; 3], [1, 1, 1]).unwrap();
    top.add_facet_group("ground", Vec::new()).unwrap();
    let fixed = Elasticity::new(top.into_part(), material())
        .fix("bottom")
        .fix("top");
    let system = fixed.assemble().unwrap();
    assert_eq!((system.num_free(), system.stiffness().nrows()), (0, 0));
    assert!(system.contact("ground", &ground).unwrap().nodes.is_empty());
}
