//! Contact between two deformable boundaries by the mortar method.

use std::ops::ControlFlow;

use semismooth::contact::{
    CondensedContact, ContactBody, ContactState, EvolutionOptions, FrictionCoefficient, LoadPath, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb, evolve,
};
use semismooth::fem::{
    CellKind, ContactRows, ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh, Mortar,
};
use semismooth::sparse::Matrix;

const YOUNG: f64 = 1.0;
const NU: f64 = 0.3;

#[derive(Clone, Copy)]
pub enum Order {
    First,
    Second,
    Serendipity,
}

/// Two blocks with the unit square or cube as horizontal extent, one above the other: heights (0, 1) and (−1, 0), before the interface
/// is tilted to height s x. Cells along the axes of each; `bent` moves nodes of the interface in its plane, so that faces are no
/// parallelograms.
pub struct Stack {
    pub dim: usize,
    pub cells: [usize; 2],
    pub simplices: bool,
    /// First order, second, or serendipity.
    pub order: Order,
    pub slope: f64,
    pub bent: f64,
    /// Nodes with x at least this are shared by both blocks.
    pub joined_from: f64,
}

impl Stack {
    pub fn new(dim: usize, cells: [usize; 2]) -> Self {
        Self {
            dim,
            cells,
            simplices: false,
            order: Order::First,
            slope: 0.0,
            bent: 0.0,
            joined_from: f64::INFINITY,
        }
    }

    pub fn mesh(&self) -> Mesh {
        let mut points: Vec<[f64; 3]> = Vec::new();
        let mut cells: Vec<(CellKind, Vec<usize>)> = Vec::new();
        let (mut facets, up) = ([Vec::new(), Vec::new()], self.dim - 1);
        for (block, &n) in self.cells.iter().enumerate() {
            let low = -(block as f64);
            let mut own = match self.dim {
                2 => Mesh::rectangle([0.0, low], [1.0, low + 1.0], [n, 2]).unwrap(),
                _ => Mesh::block([0.0, 0.0, low], [1.0, 1.0, low + 1.0], [n, n, 2]).unwrap(),
            };
            if self.simplices {
                own = own.simplices().unwrap();
            }
            let side = if block == 0 { -0.9 } else { 0.9 };
            own.mark_boundary("interface", |f| f.normal[up] * side > 0.5);
            let number: Vec<usize> = own
                .points()
                .iter()
                .map(|p| {
                    let mut q = *p;
                    let inside = 1.0 - p[up].abs();
                    let moved = self.bent * inside * (0.5 - block as f64);
                    q[0] += moved * p[0] * (1.0 - p[0]) * (p[1] - 0.3);
                    if self.dim == 3 {
                        q[1] += 1.3 * moved * p[1] * (1.0 - p[1]) * (p[0] - 0.6);
                    }
                    q[up] += self.slope * q[0] * inside;
                    let joined = q[0] >= self.joined_from && p[up] == 0.0;
                    let known = points.iter().position(|r| joined && *r == q);
                    known.unwrap_or_else(|| {
                        points.push(q);
                        points.len() - 1
                    })
                })
                .collect();
            let of = |nodes: &[usize]| nodes.iter().map(|&k| number[k]).collect::<Vec<_>>();
            cells.extend((0..own.num_cells()).map(|c| (own.kind(c), of(own.cell(c)))));
            facets[block] = own
                .facet_group("interface")
                .unwrap()
                .iter()
                .map(|f| of(f))
                .collect();
        }
        let mut mesh = Mesh::new(self.dim, points, cells).unwrap();
        if self.joined_from < 1.0 {
            // Facets of the common part are inside the body.
            let boundary = mesh.boundary();
            let outside = |f: &Vec<usize>| boundary.iter().any(|b| b.nodes == *f);
            facets.iter_mut().for_each(|list| list.retain(outside));
        }
        let [upper, lower] = facets;
        mesh.add_facet_group("upper", upper).unwrap();
        mesh.add_facet_group("lower", lower).unwrap();
        mesh.mark_boundary("top", |f| f.normal[up] > 0.9 && f.centre[up] > 0.99);
        mesh.mark_boundary("base", |f| f.normal[up] < -0.9 && f.centre[up] < -0.99);
        mesh.mark_boundary("left", |f| f.normal[0] < -0.9);
        mesh.mark_boundary("others", |f| {
            let (x, y) = (f.centre[0], f.centre[1]);
            f.normal[0] > 0.9 && x > 0.9
                || self.dim == 3 && f.normal[1].abs() > 0.9 && !(0.1..=0.9).contains(&y)
        });
        match self.order {
            Order::First => mesh,
            Order::Second => mesh.second_order().unwrap(),
            Order::Serendipity => mesh.serendipity().unwrap(),
        }
    }
}

/// u = x (a, b, c), fixed at x = 0, with its stress.
const STRETCH: [f64; 3] = [-0.02, 0.003, 0.002];

fn stress(dim: usize) -> [[f64; 3]; 3] {
    let (mu, lambda) = (
        YOUNG / (2.0 * (1.0 + NU)),
        YOUNG * NU / ((1.0 + NU) * (1.0 - 2.0 * NU)),
    );
    let mut sigma = [[0.0; 3]; 3];
    for d in 0..dim {
        sigma[0][d] += mu * STRETCH[d];
        sigma[d][0] += mu * STRETCH[d];
        sigma[d][d] += lambda * STRETCH[0];
    }
    sigma
}

fn stretched(mesh: Mesh) -> (ElasticSystem, LoadPath) {
    let dim = mesh.dim();
    let mut body = Elasticity::new(mesh, Material::isotropic(YOUNG, NU).unwrap());
    for d in 0..dim {
        for group in ["top", "base"] {
            body = body.prescribe(group, d, move |x| STRETCH[d] * x[0]);
        }
    }
    let system = body.fix("left").assemble().unwrap();
    // Tractions σ n of the sides, facet by facet.
    let sigma = stress(dim);
    let mut forces = vec![0.0; system.num_free()];
    let directions: &[[f64; 3]] = match dim {
        2 => &[[1.0, 0.0, 0.0]],
        _ => &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]],
    };
    for n in directions {
        let t: [f64; 3] = std::array::from_fn(|d| (0..3).map(|e| sigma[d][e] * n[e]).sum());
        let own = system.traction("others", |x| match n {
            [1.0, ..] if x[0] > 1.0 - 1e-9 => t,
            [_, 1.0, _] if x[1] > 1.0 - 1e-9 => t,
            [_, -1.0, _] if x[1] < 1e-9 => t,
            _ => [0.0; 3],
        });
        forces.iter_mut().zip(own.unwrap()).for_each(|(f, t)| *f += t);
    }
    let load = LoadPath::constant(system.supports().clone().plus(forces).unwrap());
    (system, load)
}

fn contact_body(system: &ElasticSystem, rows: &ContactRows, load: LoadPath) -> ContactBody {
    semismooth::contact_body(system, rows, load).unwrap()
}

/// A uniform stress passes through the interface: all tractions are those of the stress, and the displacements are linear.
fn passes<L: NodeLaw>(stack: &Stack, law: L, roles: [&str; 2], tolerance: f64) {
    let (system, load) = stretched(stack.mesh());
    let rows = system
        .contact_between(roles[0], roles[1], &Mortar::default())
        .unwrap();
    assert!(rows.gap.iter().all(|g| g.abs() < 1e-14) && !rows.is_nodal(&system));
    let problem = CondensedContact::new(contact_body(&system, &rows, load), law).unwrap();
    let x = problem.solve(0.0, None).unwrap();
    let (p, sigma) = (rows.nodes.len(), stress(stack.dim));
    let size = x[..p]
        .iter()
        .zip(&rows.areas)
        .fold(0.0f64, |m, (l, a)| m.max(l / a));
    for i in 0..p {
        let nu = rows.normals[i];
        for (d, axis) in [nu, rows.tangents[i][0], rows.tangents[i][1]]
            .iter()
            .enumerate()
            .take(stack.dim)
        {
            // The contact force is −λ along ν and the tangents.
            let exact: f64 = -(0..9)
                .map(|k| axis[k / 3] * sigma[k / 3][k % 3] * nu[k % 3])
                .sum::<f64>();
            let found = x[d * p + i] / rows.areas[i];
            assert!(
                (found - exact).abs() <= tolerance * size,
                "{i} {d}: {found} {exact}"
            );
        }
    }
    let solution = problem.solution(&x).unwrap();
    assert!(solution.states.iter().all(|s| *s == ContactState::Stick));
    let u = problem.displacements(&x).unwrap();
    for (node, at) in system.mesh().points().iter().enumerate() {
        for d in 0..stack.dim {
            let found = system.dof(node, d).map_or(STRETCH[d] * at[0], |k| u[k]);
            assert!((found - STRETCH[d] * at[0]).abs() <= tolerance * 0.02);
        }
    }
}

const ROLES: [[&str; 2]; 2] = [["upper", "lower"], ["lower", "upper"]];

pub fn planar(friction: f64) -> PlanarCoulomb {
    PlanarCoulomb::new(FrictionCoefficient::constant(friction).unwrap())
}

pub fn spatial(friction: f64) -> OrthotropicCoulomb {
    OrthotropicCoulomb::isotropic(FrictionCoefficient::constant(friction).unwrap())
}

#[test]
fn uniform_stress_passes_through_plane_interfaces() {
    for roles in ROLES {
        for (cells, slope, simplices) in [([3, 4], 0.0, false), ([5, 2], 0.2, false), ([2, 7], -0.1, true)] {
            let stack = Stack {
                slope,
                simplices,
                ..Stack::new(2, cells)
            };
            passes(&stack, planar(5.0), roles, 1e-12);
        }
    }
}

/// Linear multipliers at the corners of edges and faces of second order.
#[test]
fn uniform_stress_passes_between_cells_of_second_order() {
    for roles in ROLES {
        for (simplices, order) in [
            (true, Order::Second),
            (false, Order::Second),
            (false, Order::Serendipity),
        ] {
            for (cells, slope) in [([3, 4], 0.0), ([5, 2], 0.2)] {
                let stack = Stack {
                    slope,
                    simplices,
                    order,
                    ..Stack::new(2, cells)
                };
                passes(&stack, planar(5.0), roles, 1e-12);
            }
            let stack = Stack {
                slope: 0.2,
                simplices,
                order,
                ..Stack::new(3, [1, 2])
            };
            passes(&stack, spatial(5.0), roles, 1e-12);
        }
    }
}

#[test]
fn uniform_stress_passes_through_interfaces_in_space() {
    for roles in ROLES {
        for (cells, slope, simplices, bent) in [
            ([2, 3], 0.0, false, 0.0),
            ([3, 2], 0.2, true, 0.0),
            ([2, 3], 0.1, false, 0.4),
        ] {
            let stack = Stack {
                slope,
                simplices,
                bent,
                ..Stack::new(3, cells)
            };
            passes(&stack, spatial(5.0), roles, 1e-12);
        }
    }
}

/// A crack from x = 0 to ½: the node at its tip belongs to both sides and carries no multiplier.
#[test]
fn uniform_stress_passes_through_a_crack() {
    for (dim, n) in [(2, 6), (3, 4)] {
        let stack = Stack {
            slope: 0.1,
            joined_from: 0.5,
            ..Stack::new(dim, [n, n])
        };
        let (system, _) = stretched(stack.mesh());
        let rows = system
            .contact_between("upper", "lower", &Mortar::default())
            .unwrap();
        assert!(rows.points.iter().all(|p| p[0] > 0.0 && p[0] < 0.5 - 1e-9));
        let measure: f64 = rows.areas.iter().sum();
        assert!((measure - 0.5 * 1.01f64.sqrt()).abs() < 1e-13);
        match dim {
            2 => passes(&stack, planar(5.0), ROLES[0], 1e-12),
            _ => passes(&stack, spatial(5.0), ROLES[0], 1e-12),
        }
    }
}

/// Rigid motions of both bodies together change no trace where the interface is flat, even where the slave is covered in part;
/// where nodes match, rows are the sums of those of both sides.
#[test]
fn rows_annihilate_rigid_motions_and_are_those_of_matching_nodes() {
    for (dim, cells) in [(2, [4, 3]), (3, [3, 2]), (2, [3, 3]), (3, [2, 2])] {
        let mesh = Stack::new(dim, cells).mesh();
        // The upper block is moved by 0.3 along x, and by 0.1 across.
        let shift = if cells[0] == cells[1] { 0.0 } else { 0.3 };
        let up = dim - 1;
        let centre = |c: usize| mesh.centre(c)[up];
        let mut moved = mesh.points().to_vec();
        let upper: std::collections::BTreeSet<usize> = (0..mesh.num_cells())
            .filter(|&c| centre(c) > 0.0)
            .flat_map(|c| mesh.cell(c).to_vec())
            .collect();
        for &n in &upper {
            moved[n][0] += shift;
            if dim == 3 {
                moved[n][1] += shift / 3.0;
            }
        }
        let all = (0..mesh.num_cells()).map(|c| (mesh.kind(c), mesh.cell(c).to_vec()));
        let mut other = Mesh::new(dim, moved, all).unwrap();
        for group in ["upper", "lower", "top", "base"] {
            other
                .add_facet_group(group, mesh.facet_group(group).unwrap().to_vec())
                .unwrap();
        }
        let system = Elasticity::new(other, Material::isotropic(YOUNG, NU).unwrap())
            .fix("top")
            .fix("base")
            .assemble()
            .unwrap();
        for roles in ROLES {
            let rows = system
                .contact_between(roles[0], roles[1], &Mortar::default())
                .unwrap();
            let area: f64 = rows.areas.iter().sum();
            let exact = (1.0 - shift) * if dim == 3 { 1.0 - shift / 3.0 } else { 1.0 };
            assert!((area - exact).abs() < 1e-13, "{area} {exact}");
            let traces: Vec<&Matrix> = std::iter::once(&rows.normal).chain(&rows.tangential).collect();
            for motion in 0..if dim == 2 { 3 } else { 6 } {
                let mut u = vec![0.0; system.num_free()];
                for (n, x) in system.mesh().points().iter().enumerate() {
                    let rigid = match (dim, motion) {
                        (2, 2) => [-x[1], x[0], 0.0],
                        (_, 0..=2) => std::array::from_fn(|d| f64::from(u8::from(d == motion))),
                        (_, 3) => [0.0, -x[2], x[1]],
                        (_, 4) => [x[2], 0.0, -x[0]],
                        _ => [-x[1], x[0], 0.0],
                    };
                    (0..dim).for_each(|d| {
                        if let Some(k) = system.dof(n, d) {
                            u[k] = rigid[d];
                        }
                    });
                }
                for trace in &traces {
                    let mut v = vec![0.0; rows.nodes.len()];
                    trace.as_ref().mul_add(1.0, &u, &mut v);
                    assert!(v.iter().all(|v| v.abs() < 1e-12), "{dim} {motion} {v:?}");
                }
            }
            if shift == 0.0 {
                let sides = roles.map(|g| system.contact(g, &Foundation::gap(|_| 0.0)).unwrap());
                let sum = |row: fn(&ContactRows) -> &Matrix, sign: f64| {
                    let second = row(&sides[1]).triplets().map(|(i, j, v)| (i, j, sign * v));
                    let both: Vec<_> = row(&sides[0]).triplets().chain(second).collect();
                    Matrix::from_triplets(rows.nodes.len(), system.num_free(), &both).unwrap()
                };
                let same = |a: &Matrix, b: &Matrix| {
                    let all = b.triplets().chain(a.triplets());
                    all.fold(0.0f64, |m, (i, j, _)| m.max((a.get(i, j) - b.get(i, j)).abs())) < 1e-13
                };
                assert!(same(&rows.normal, &sum(|r| &r.normal, 1.0)));
                // In the plane the tangents of the sides are opposite, in space t₁ is the x axis on both.
                assert!(same(
                    &rows.tangential[0],
                    &sum(|r| &r.tangential[0], if dim == 2 { 1.0 } else { -1.0 })
                ));
            }
        }
    }
}

#[test]
fn boundaries_that_do_not_face_each_other_are_refused() {
    let mesh = Stack::new(2, [3, 4]).mesh();
    let body = |mesh: Mesh| Elasticity::new(mesh, Material::isotropic(YOUNG, NU).unwrap());
    let system = body(mesh.clone()).fix("top").fix("base").assemble().unwrap();
    let refused = |slave, master, mortar: &Mortar| system.contact_between(slave, master, mortar).unwrap_err();
    // Normals in one direction, and facets out of reach.
    assert!(matches!(
        refused("upper", "base", &Mortar::default()),
        FemError::NoneOpposite { .. }
    ));
    assert!(matches!(
        refused("top", "base", &Mortar::default().with_reach(1.9)),
        FemError::NoneOpposite { .. }
    ));
    assert!(matches!(
        refused("upper", "nowhere", &Mortar::default()),
        FemError::NoSuchGroup { .. }
    ));
    assert!(matches!(
        refused("upper", "lower", &Mortar::default().with_gap(|_| f64::NAN)),
        FemError::NotFinite { .. }
    ));
    // The top of the upper block lies behind its own bottom; a reach leaves it out.
    let mut layers = mesh.clone();
    for group in ["lower", "top"] {
        layers
            .add_facet_group("layers", mesh.facet_group(group).unwrap().to_vec())
            .unwrap();
    }
    let layered = body(layers).fix("top").fix("base").assemble().unwrap();
    let both = |mortar: &Mortar| layered.contact_between("upper", "layers", mortar);
    assert!(matches!(
        both(&Mortar::default()),
        Err(FemError::CoveredTwice { .. })
    ));
    let near = both(&Mortar::default().with_reach(0.5)).unwrap();
    assert_eq!(
        near,
        layered
            .contact_between("upper", "lower", &Mortar::default())
            .unwrap()
    );
    // A side that is prescribed as another value than 0, on the slave or the master.
    for (group, value, fits) in [("left", 0.1, false), ("left", 0.0, true)] {
        let moved = body(mesh.clone())
            .fix("top")
            .fix("base")
            .prescribe(group, 0, move |_| value);
        let rows = moved
            .assemble()
            .unwrap()
            .contact_between("upper", "lower", &Mortar::default());
        match rows {
            Ok(rows) => assert!(fits && rows.num_held() == 1),
            Err(e) => assert!(!fits && matches!(e, FemError::ContactFixed { .. }), "{e}"),
        }
    }
}

/// Grid lines from 0 with spacing h up to `inner`, then growing, up to `outer`.
fn axis(h: f64, inner: f64, outer: f64) -> Vec<f64> {
    let mut x: Vec<f64> = (0..=(inner / h).round() as usize).map(|k| k as f64 * h).collect();
    let mut d = h;
    while let Some(last) = x.last().copied().filter(|x| *x < outer) {
        d = (d * 1.15).min(outer - last);
        x.push(last + d);
    }
    x
}

/// Two cylinders of radius 8, E = 200, ν = 0.3, pressed together, then pushed sideways, as half-planes with a parabolic gap. Errors of
/// pressure and traction relative to p₀ and F p₀, three cells or more away from the edges of contact and stick.
fn cattaneo_mindlin(spacing: [f64; 2]) -> [f64; 2] {
    const F: f64 = 0.2;
    const OUTER: f64 = 40.0;
    let (mut points, mut cells) = (Vec::new(), Vec::new());
    for (h, side) in spacing.into_iter().zip([1.0, -1.0]) {
        let (right, up) = (axis(h, 1.0, OUTER), axis(h, 0.6, OUTER));
        let left = right.iter().skip(1).rev().map(|x| -x);
        let across: Vec<f64> = left.chain(right.iter().copied()).collect();
        let base = points.len();
        for x in &across {
            points.extend(up.iter().map(|y| [*x, side * y, 0.0]));
        }
        let node = |a: usize, b: usize| base + a * up.len() + b;
        for i in 0..across.len() - 1 {
            for j in 0..up.len() - 1 {
                let mut quad = vec![node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
                if side < 0.0 {
                    quad.reverse();
                }
                cells.push((CellKind::Quadrilateral, quad));
            }
        }
    }
    let mut mesh = Mesh::new(2, points, cells).unwrap();
    mesh.mark_boundary("top", |f| f.centre[1] > OUTER - 1e-9);
    mesh.mark_boundary("base", |f| f.centre[1] < 1e-9 - OUTER);
    mesh.mark_boundary("upper", |f| {
        f.normal[1] < -0.5 && f.centre[0].abs() < 1.5 && f.centre[1].abs() < 1e-9
    });
    mesh.mark_boundary("lower", |f| {
        f.normal[1] > 0.5 && f.centre[0].abs() < 2.0 && f.centre[1].abs() < 1e-9
    });
    let system = Elasticity::new(mesh, Material::isotropic(200.0, 0.3).unwrap())
        .fix("base")
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| -0.2)
        .assemble()
        .unwrap();
    let mortar = Mortar::default().with_gap(|x| x[0] * x[0] / 8.0);
    let rows = system.contact_between("upper", "lower", &mortar).unwrap();
    let push = system.motion("top", 0, |_| 0.02).unwrap();
    let body = contact_body(&system, &rows, LoadPath::affine(system.supports(), push));
    let law = PlanarCoulomb::new(FrictionCoefficient::constant(F).unwrap());
    let mut problem = CondensedContact::new(body, law).unwrap();
    let x = problem.solve(0.0, None).unwrap();
    let options = EvolutionOptions::default();
    let steps = evolve(&mut problem, &x, &[1.0], &options, |_| ControlFlow::Continue(())).unwrap();
    let nodes = &steps[0].solution.nodes;
    let pressed: f64 = nodes.iter().map(|v| v.pressure).sum();
    let pushed: f64 = nodes.iter().map(|v| v.traction[0]).sum();
    let stiffness = 200.0 / (2.0 * 0.91);
    let a = (4.0 * pressed * 4.0 / (std::f64::consts::PI * stiffness)).sqrt();
    let p0 = 2.0 * pressed / (std::f64::consts::PI * a);
    let c = a * (1.0 - pushed.abs() / (F * pressed)).sqrt();
    let arch = |x: f64, r: f64| (1.0 - (x / r).powi(2)).max(0.0).sqrt();
    let far = 3.0 * spacing[0].max(spacing[1]);
    let mut errors = [0.0f64; 2];
    for (i, v) in nodes.iter().enumerate() {
        let (x, area) = (rows.points[i][0].abs(), rows.areas[i]);
        if (x - a).abs() <= far {
            continue;
        }
        errors[0] = errors[0].max((v.pressure / area / p0 - arch(x, a)).abs());
        if (x - c).abs() > far {
            let exact = arch(x, a) - c / a * arch(x, c);
            errors[1] = errors[1].max((v.traction[0].abs() / area / (F * p0) - exact).abs());
        }
    }
    errors
}

/// Away from the edges errors are of first order, with nodes that match or not, as long as the slave is not much finer than the master.
#[test]
fn cylinders_obey_cattaneo_and_mindlin() {
    for h in [0.05, 0.025] {
        for (spacing, bound) in [([h, h], 0.06), ([h, 0.8 * h], 0.06), ([0.8 * h, h], 0.1)] {
            let found = cattaneo_mindlin(spacing);
            assert!(found.iter().all(|e| *e < bound * h), "{spacing:?} {found:?}");
        }
    }
}
