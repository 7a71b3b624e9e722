//! Bodies of revolution: exact states, tubes under pressure and fitted onto each other after Lamé, a punch after Hertz.

use std::f64::consts::{PI, TAU};

use semismooth::contact::{CondensedContact, ContactBody, Frictionless, LoadPath};
use semismooth::fem::{
    ContactRows, Dilatation, ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh, Mortar,
    MultiplierSpace, PlaneModel,
};

use super::dilatation::solved;

fn revolved(mesh: Mesh, young: f64, poisson: f64) -> Elasticity {
    let material = Material::isotropic(young, poisson).unwrap();
    Elasticity::new(mesh, material).with_plane_model(PlaneModel::Axisymmetric)
}

/// The mesh with its nodes moved, of the same groups.
fn moved(mesh: &Mesh, to: impl Fn([f64; 3]) -> [f64; 3]) -> Mesh {
    let points = mesh.points().iter().map(|p| to(*p)).collect();
    let cells: Vec<_> = (0..mesh.num_cells())
        .map(|c| (mesh.kind(c), mesh.cell(c).to_vec()))
        .collect();
    let mut other = Mesh::new(mesh.dim(), points, cells).unwrap();
    for name in ["left", "right", "bottom", "top"] {
        let facets = mesh.facet_group(name).unwrap().to_vec();
        other.add_facet_group(name, facets).unwrap();
    }
    other
}

/// A rectangle from a radius on, in each kind of cell.
fn kinds(inner: f64, outer: f64, n: usize) -> [Mesh; 3] {
    let boxes = Mesh::rectangle([inner, 0.0], [outer, 1.0], [n, n]).unwrap();
    let triangles = boxes.simplices().unwrap();
    let second = triangles.second_order().unwrap();
    [boxes, triangles, second]
}

fn displacements(system: &ElasticSystem, free: &[f64]) -> Vec<f64> {
    system
        .displacements(free, system.supports().displacements())
        .unwrap()
}

/// u = (c r, d z) has uniform strains, around the axis as along the radius: solved to rounding in distorted cells, with and without the
/// axis and the mean dilatation, under the tractions of its stresses.
#[test]
fn uniform_strains_are_exact() {
    let (young, poisson, c, d) = (3.0, 0.3, 0.02, -0.01);
    let lame = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
    let mu = young / (2.0 * (1.0 + poisson));
    let radial = lame * (2.0 * c + d) + 2.0 * mu * c;
    let axial = lame * (2.0 * c + d) + 2.0 * mu * d;
    for inner in [0.0, 0.7] {
        for straight in kinds(inner, inner + 1.5, 3) {
            let within = |x: [f64; 3]| (x[0] - inner) * (inner + 1.5 - x[0]) * x[1] * (1.0 - x[1]);
            let mesh = moved(&straight, |x| {
                [x[0] + 0.4 * within(x), x[1] - 0.3 * within(x), 0.0]
            });
            for dilatation in [Dilatation::Pointwise, Dilatation::Mean] {
                let body = revolved(mesh.clone(), young, poisson).with_dilatation(dilatation);
                let system = body.fix_component("bottom", 1).assemble().unwrap();
                let mut load = system.traction("right", |_| [radial, 0.0, 0.0]).unwrap();
                for (group, traction) in [("top", [0.0, axial, 0.0]), ("left", [-radial, 0.0, 0.0])] {
                    let forces = system.traction(group, |_| traction).unwrap();
                    load.iter_mut().zip(forces).for_each(|(l, f)| *l += f);
                }
                let free = solved(&system, &load);
                let u = displacements(&system, &free);
                for (node, x) in mesh.points().iter().enumerate() {
                    assert!((u[2 * node] - c * x[0]).abs() < 1e-14, "{x:?}");
                    assert!((u[2 * node + 1] - d * x[1]).abs() < 1e-14, "{x:?}");
                }
                let stresses = system.stresses(&free, &[]).unwrap();
                for s in stresses {
                    let exact = [radial, axial, radial, 0.0, 0.0, 0.0];
                    assert!((0..6).all(|k| (s[k] - exact[k]).abs() < 1e-13), "{s:?}");
                }
            }
        }
    }
}

/// Forces are those of the whole ring: of gravity, of a pressure on the end and on the side, of contact areas in each space of multipliers.
#[test]
fn resultants_are_those_of_the_rings() {
    for inner in [0.0, 0.5] {
        let outer = inner + 1.25;
        let section = PI * (outer * outer - inner * inner);
        for mesh in kinds(inner, outer, 4) {
            let system = revolved(mesh, 1.0, 0.3)
                .fix_component("top", 1)
                .assemble()
                .unwrap();
            let upwards = |load: &[f64]| -> f64 {
                let nodes = 0..system.mesh().num_nodes();
                nodes.filter_map(|n| system.dof(n, 1)).map(|k| load[k]).sum()
            };
            let gravity = system.body_force(|_| [0.0, 2.0, 0.0]).unwrap();
            let held: f64 = 2.0 * section;
            // What acts on the supports is not among the forces: linear functions of the height take it up.
            let height = system.mesh().points().iter().enumerate();
            let work: f64 = height
                .filter_map(|(n, x)| Some(gravity[system.dof(n, 1)?] * (1.0 - x[1])))
                .sum();
            assert!((work - 0.5 * held).abs() < 1e-13);
            let end = system.traction("bottom", |_| [0.0, 3.0, 0.0]).unwrap();
            assert!((upwards(&end) - 3.0 * section).abs() < 1e-13);
            let side = system.traction("right", |x| [0.0, 1.0 - x[1], 0.0]).unwrap();
            let moment: f64 = system
                .mesh()
                .points()
                .iter()
                .enumerate()
                .filter_map(|(n, x)| Some(side[system.dof(n, 1)?] * (1.0 - x[1])))
                .sum();
            assert!((moment - TAU * outer / 3.0).abs() < 1e-12);
            let ground = Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]);
            for space in [MultiplierSpace::Nodal, MultiplierSpace::DualCells] {
                let rows = system.contact_with("bottom", &ground, space).unwrap();
                assert!((rows.areas.iter().sum::<f64>() - section).abs() < 1e-13);
                assert!(rows.areas.iter().all(|a| *a > 0.0));
            }
        }
    }
}

/// Lamé's tube under inner pressure between smooth plates (plane strain).
struct Tube {
    inner: f64,
    outer: f64,
    poisson: f64,
    pressure: f64,
}

impl Tube {
    /// With E = 1.
    fn displacement(&self, r: f64) -> f64 {
        let [a, b] = [self.inner, self.outer].map(|x| x * x);
        (1.0 + self.poisson) * self.pressure * a / (b - a) * ((1.0 - 2.0 * self.poisson) * r + b / r)
    }

    /// Of the displacements, root mean square over the nodes against that of the inner side; of the stresses around the axis, the largest.
    fn errors(&self, mesh: Mesh, dilatation: Dilatation) -> [f64; 2] {
        let body = revolved(mesh, 1.0, self.poisson).with_dilatation(dilatation);
        let system = body
            .fix_component("bottom", 1)
            .fix_component("top", 1)
            .assemble()
            .unwrap();
        let load = system.traction("left", |_| [self.pressure, 0.0, 0.0]).unwrap();
        let free = solved(&system, &load);
        let (u, scale) = (displacements(&system, &free), self.displacement(self.inner));
        let points = system.mesh().points().iter().enumerate();
        let error = |(n, x): (usize, &[f64; 3])| ((u[2 * n] - self.displacement(x[0])) / scale).powi(2);
        let [a, b] = [self.inner, self.outer].map(|x| x * x);
        let stresses = system.stresses(&free, &[]).unwrap();
        let hoop = |(cell, s): (usize, &[f64; 6])| {
            let r = system.mesh().centre(cell)[0];
            (s[2] - self.pressure * a / (b - a) * (1.0 + b / (r * r))).abs()
        };
        [
            (points.map(error).sum::<f64>() / system.mesh().num_nodes() as f64).sqrt(),
            stresses.iter().enumerate().map(hoop).fold(0.0, f64::max),
        ]
    }
}

/// Second order in the displacements for linear cells, third at least for those of second order; stresses around the axis converge.
#[test]
fn tubes_converge_to_lame() {
    let tube = Tube {
        inner: 1.0,
        outer: 2.0,
        poisson: 0.3,
        pressure: 0.1,
    };
    for kind in 0..3 {
        let [coarse, fine] = [8, 16].map(|n| {
            let mesh = kinds(tube.inner, tube.outer, n)[kind].clone();
            tube.errors(mesh, Dilatation::Automatic)
        });
        let order = (coarse[0] / fine[0]).log2();
        assert!(order > [1.9, 1.9, 2.9][kind], "{kind}: {coarse:?} {fine:?}");
        assert!(fine[0] < [1e-3, 2e-3, 1e-5][kind], "{kind}: {fine:?}");
        assert!(fine[1] < 0.7 * coarse[1], "{kind}: {coarse:?} {fine:?}");
    }
}

/// The radial motion of an incompressible tube, c / r, is not among the functions of bilinear cells: these lock, but not with the mean.
#[test]
fn the_mean_dilatation_keeps_rubber_tubes_from_locking() {
    let tube = Tube {
        inner: 1.0,
        outer: 2.0,
        poisson: 0.4999,
        pressure: 0.1,
    };
    let error = |d: Dilatation| tube.errors(kinds(1.0, 2.0, 8)[0].clone(), d)[0];
    let (mean, pointwise) = (error(Dilatation::Mean), error(Dilatation::Pointwise));
    assert!(mean < 0.01 && pointwise > 0.3, "{mean} {pointwise}");
    assert_eq!(error(Dilatation::Automatic), mean);
}

/// A hub on a shaft (G. Lamé 1852) between smooth plates: the interference presses them together with p = δ / (c (S_hub + S_shaft)),
/// S_hub = ((b² + c²) / (b² − c²) + ν') / E', S_shaft = (1 − ν') / E', E' = E / (1 − ν²), ν' = ν / (1 − ν). Meshes do not match.
#[test]
fn a_press_fit_has_the_pressure_of_lame() {
    let (c, b, fit) = (1.0, 2.0, 1e-3);
    let [shaft, hub] = [(2.0, 0.3), (1.0, 0.25)];
    let exact = {
        let [(e, nu), (e_hub, nu_hub)] = [shaft, hub].map(|(e, nu)| (e / (1.0 - nu * nu), nu / (1.0 - nu)));
        let of_hub = ((b * b + c * c) / (b * b - c * c) + nu_hub) / e_hub;
        fit / (c * (of_hub + (1.0 - nu) / e))
    };
    let pressures = |n: usize| -> (Vec<f64>, f64) {
        let inner = Mesh::rectangle([0.0, 0.0], [c, 1.0], [n, 2 * n]).unwrap();
        let outer = Mesh::rectangle([c, 0.0], [b, 1.0], [2 * n, 3 * n]).unwrap();
        let shift = inner.num_nodes();
        let points = [inner.points(), outer.points()].concat();
        let mut cells: Vec<_> = (0..inner.num_cells())
            .map(|k| (inner.kind(k), inner.cell(k).to_vec()))
            .collect();
        cells.extend((0..outer.num_cells()).map(|k| {
            let nodes = outer.cell(k).iter().map(|n| n + shift).collect();
            (outer.kind(k), nodes)
        }));
        let mut mesh = Mesh::new(2, points, cells).unwrap();
        let facets = |of: &Mesh, name: &str, shift: usize| -> Vec<Vec<usize>> {
            let group = of.facet_group(name).unwrap().iter();
            group.map(|f| f.iter().map(|n| n + shift).collect()).collect()
        };
        mesh.add_facet_group("shaft", facets(&inner, "right", 0)).unwrap();
        mesh.add_facet_group("hub", facets(&outer, "left", shift))
            .unwrap();
        mesh.mark_boundary("plates", |f| (f.centre[1] - 0.5).abs() > 0.5 - 1e-9);
        mesh.mark_cells("outer", |x| x[0] > c);
        let body = revolved(mesh, shaft.0, shaft.1)
            .with_material("outer", Material::isotropic(hub.0, hub.1).unwrap())
            .fix_component("plates", 1);
        let system = body.assemble().unwrap();
        let mortar = Mortar::default().with_gap(move |_| -fit);
        let rows = system.contact_between("shaft", "hub", &mortar).unwrap();
        assert!((rows.areas.iter().sum::<f64>() - TAU * c).abs() < 1e-12);
        let (problem, rows) = frictionless(&system, rows, vec![0.0; system.num_free()]);
        let x = problem.solve(0.0, None).unwrap();
        let p = rows.nodes.len();
        let total: f64 = x[..p].iter().sum();
        ((0..p).map(|i| x[i] / rows.areas[i]).collect(), total)
    };
    let error = |n: usize| {
        let (all, total) = pressures(n);
        let worst = all.iter().map(|p| (p / exact - 1.0).abs()).fold(0.0, f64::max);
        assert!((total / (TAU * c) - all[0]).abs() < 1e-11 * exact);
        worst
    };
    let (coarse, fine) = (error(3), error(6));
    assert!(coarse < 0.01 && fine < 0.27 * coarse, "{coarse} {fine}");
}

fn frictionless(
    system: &ElasticSystem,
    rows: ContactRows,
    load: Vec<f64>,
) -> (CondensedContact<Frictionless>, ContactRows) {
    let path = LoadPath::constant(system.supports().clone().plus(load).unwrap());
    let body = ContactBody::new(
        system.stiffness().clone(),
        rows.normal.clone(),
        rows.tangential.clone(),
        path,
    )
    .and_then(|body| body.with_gap(rows.gap.clone()))
    .unwrap();
    (CondensedContact::new(body, Frictionless::plane()).unwrap(), rows)
}

/// A paraboloid of radius R pressed by F has, after H. Hertz (J. reine angew. Math. 92 (1881)), the pressure p₀ (1 − r²/a²)^½ on the
/// circle of radius a, a³ = 3 F R (1 − ν²) / (4 E), p₀ = 3 F / (2 π a²). The body is 16 a wide and high. Pressures at nodes are of second
/// order, but of first order at the axis, where few and small cells carry the force of a node.
#[test]
fn a_sphere_on_a_plane_converges_to_hertz() {
    let (radius, poisson) = (1.0, 0.3);
    let [coarse, fine] = [8usize, 16].map(|n| {
        // Cells of the size 0.1 / n up to 0.2, then in geometric progression.
        let mut grid: Vec<f64> = (0..=2 * n).map(|k| 0.1 * k as f64 / n as f64).collect();
        let mut step = 0.1 / n as f64;
        while *grid.last().unwrap() < 1.6 {
            step *= 1.0 + 1.2 / n as f64;
            grid.push(grid.last().unwrap() + step);
        }
        let mesh = Mesh::rectangle_graded(&grid, &grid).unwrap();
        let body = revolved(mesh, 1.0, poisson).prescribe("top", 1, |_| -0.01);
        let system = body.fix_component("top", 0).assemble().unwrap();
        let gap = move |x: [f64; 3]| x[0] * x[0] / (2.0 * radius);
        let foundation = Foundation::gap(gap).with_normal(|_| [0.0, -1.0, 0.0]);
        let rows = system.contact("bottom", &foundation).unwrap();
        let (problem, rows) = frictionless(&system, rows, vec![0.0; system.num_free()]);
        // On the axis there is no radial displacement.
        assert_eq!(rows.num_held(), 1);
        let x = problem.solve(0.0, None).unwrap();
        let p = rows.nodes.len();
        let force: f64 = x[..p].iter().sum();
        let a = (0.75 * force * radius * (1.0 - poisson * poisson)).cbrt();
        assert!(a > 0.08 && a < 0.12, "{a}");
        let p0 = 1.5 * force / (PI * a * a);
        let hertz = |r: f64| p0 * (1.0 - r * r / (a * a)).max(0.0).sqrt();
        let error = |i: usize| (x[i] / rows.areas[i] - hertz(rows.points[i][0])).abs() / p0;
        // Away from the axis and from the rim, where the slope is infinite.
        let inside = (0..p).filter(|i| rows.points[*i][0] > 0.24 * a && rows.points[*i][0] < 0.8 * a);
        [error(0), inside.map(error).fold(0.0, f64::max)]
    });
    assert!(fine[0] < 0.02 && fine[0] < 0.6 * coarse[0], "{coarse:?} {fine:?}");
    assert!(fine[1] < 2e-3 && fine[1] < 0.3 * coarse[1], "{coarse:?} {fine:?}");
}

#[test]
fn bodies_that_do_not_revolve_are_refused() {
    let strip = |inner: f64| Mesh::rectangle([inner, 0.0], [2.0, 1.0], [3, 2]).unwrap();
    let assembled = |body: Elasticity| body.assemble().unwrap_err();
    let found = assembled(revolved(strip(-0.5), 1.0, 0.3).fix("top"));
    assert!(matches!(found, FemError::Radius { node: 0, .. }), "{found}");
    let found = assembled(revolved(strip(0.0), 1.0, 0.3).prescribe("top", 0, |_| 0.1));
    assert!(matches!(found, FemError::OnAxis { .. }), "{found}");
    let found = assembled(revolved(strip(0.0), 1.0, 0.3).fix_component("right", 0));
    let FemError::Floating { modes, .. } = &found else {
        panic!("{found}");
    };
    assert_eq!(modes, "translation along y");
    let mut c = Material::isotropic(1.0, 0.3).unwrap().components();
    for [i, j, k, l] in [[0, 0, 1, 2], [0, 0, 2, 1], [1, 2, 0, 0], [2, 1, 0, 0]] {
        c[i][j][k][l] = 0.05;
    }
    let twisted = Elasticity::new(strip(0.0), Material::tensor(&c).unwrap());
    let found = assembled(twisted.with_plane_model(PlaneModel::Axisymmetric).fix("top"));
    assert!(
        matches!(found, FemError::Material { value, .. } if value == 0.05),
        "{found}"
    );
    let system = revolved(strip(0.0), 1.0, 0.3).fix("top").assemble().unwrap();
    let found = system.motion("top", 0, |_| 0.1).unwrap_err();
    assert!(matches!(found, FemError::OnAxis { .. }), "{found}");
    assert!(system.motion("top", 0, |x| 0.1 * x[0]).is_ok());
}
