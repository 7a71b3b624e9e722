//! Cells of second order.

use std::f64::consts::FRAC_PI_2;

use semismooth::contact::{CondensedContact, Frictionless, LoadPath};
use semismooth::fem::{
    BoundaryFacet, CellKind, Degree, Dilatation, ElasticSystem, Elasticity, FemError, Foundation, Material,
    Mesh, MultiplierSpace, Partition, parse_gmsh,
};

use super::{first_order, moved, raised};
use crate::dilatation::{resultant, solved};

const LAMBDA: f64 = 1.2;
const MU: f64 = 0.9;

fn material() -> Material {
    Material::lame(LAMBDA, MU).unwrap()
}

/// Quadratic displacements are exact on straight cells, boxes being sheared: prescribed on the boundary, with the volume force that balances
/// their stresses.
#[test]
fn quadratic_displacements_are_exact() {
    // u_d = Σ q[d][i][j] x_i x_j.
    let q = [
        [[1.0, 1.5, -0.4], [0.0, 0.2, 0.3], [0.0, 0.0, 0.7]],
        [[0.0, -0.5, 0.8], [0.0, 2.0, 0.1], [0.0, 0.0, -0.6]],
        [[0.3, 0.2, 0.4], [0.0, -0.9, 1.1], [0.0, 0.0, 0.5]],
    ];
    for mesh in raised(&first_order(2)) {
        let dim = mesh.dim();
        let sheared = moved(&mesh, |[x, y, z]| {
            [x + 0.3 * y - 0.2 * z, y + 0.1 * z, z - 0.15 * x]
        });
        let field = move |d: usize, x: [f64; 3]| -> f64 {
            let term = |k: usize| q[d][k / dim][k % dim] * x[k / dim] * x[k % dim];
            (0..dim * dim).map(term).sum()
        };
        // f = −(λ + μ) ∇ div u − μ Δu.
        let force: [f64; 3] = std::array::from_fn(|d| {
            let second = |e: usize, i: usize, j: usize| q[e][i][j] + q[e][j][i];
            let div: f64 = (0..dim).map(|e| second(e, e, d)).sum();
            let laplace: f64 = (0..dim).map(|i| second(d, i, i)).sum();
            -(LAMBDA + MU) * div - MU * laplace
        });
        let mut body = Elasticity::new(sheared, material());
        for d in 0..dim {
            body = body.prescribe("all", d, move |x| field(d, x));
        }
        let system = body.assemble().unwrap();
        let u = solved(&system, &system.body_force(|_| force).unwrap());
        for (node, at) in system.mesh().points().iter().enumerate() {
            for d in 0..dim {
                if let Some(dof) = system.dof(node, d) {
                    let (found, exact) = (u[dof], field(d, *at));
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

/// u = (φ, 0, 0) with φ = Π x (1 − x²) on the unit square and cube, held at the boundary: a(u, u) − a(u_h, u_h) is the square of the error
/// in the norm of the energy, which is of second order at least.
#[test]
fn errors_of_energy_are_of_fourth_order() {
    let unit = |n: usize| {
        let plane = Mesh::rectangle([0.0; 2], [1.0; 2], [n, n]).unwrap();
        let solid = Mesh::block([0.0; 3], [1.0; 3], [n, n, n]).unwrap();
        let all = [
            plane.simplices().unwrap(),
            plane,
            solid.simplices().unwrap(),
            solid,
        ];
        raised(&all)
    };
    let errors = |n: usize| {
        let error = |mesh: Mesh| {
            let dim = mesh.dim();
            let (bubble, slope) = (|x: f64| x * (1.0 - x * x), |x: f64| 1.0 - 3.0 * x * x);
            let force = |x: [f64; 3]| {
                // Derivatives of φ along two axes.
                let second = |i: usize, j: usize| -> f64 {
                    let factor = |d: usize| match (d == i, d == j) {
                        (true, true) => -6.0 * x[d],
                        (false, false) => bubble(x[d]),
                        _ => slope(x[d]),
                    };
                    (0..dim).map(factor).product()
                };
                // −(λ + μ) ∂₁∂_d φ − μ Δφ for the first component.
                let laplace: f64 = (0..dim).map(|e| second(e, e)).sum();
                let mixed = |d: usize| if d < dim { second(0, d) } else { 0.0 };
                std::array::from_fn(|d| -(LAMBDA + MU) * mixed(d) - if d == 0 { MU * laplace } else { 0.0 })
            };
            let fixed = moved(&mesh, |x| x);
            let system = Elasticity::new(fixed, material()).fix("all").assemble().unwrap();
            let load = system.body_force(force).unwrap();
            let u = solved(&system, &load);
            let found: f64 = u.iter().zip(&load).map(|(u, f)| u * f).sum();
            // ∫ (∂_d φ)², the integrals of the squares of slope and function being 4/5 and 8/105.
            let exact = (LAMBDA + (dim as f64 + 1.0) * MU) * 0.8 * (8.0f64 / 105.0).powi(dim as i32 - 1);
            (mesh.kind(0), (exact - found) / exact)
        };
        unit(n).into_iter().map(error).collect::<Vec<_>>()
    };
    for ((kind, coarse), (_, fine)) in errors(3).into_iter().zip(errors(5)) {
        let order = (coarse / fine).ln() / (5.0f64 / 3.0).ln();
        assert!(
            fine > 0.0 && coarse < 0.2 && order > 3.6,
            "{kind}: {order} {coarse:e}"
        );
    }
}

fn rectangle(n: usize) -> [Mesh; 3] {
    let boxes = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2 * n, n]).unwrap();
    [
        boxes.simplices().unwrap().second_order().unwrap(),
        boxes.second_order().unwrap(),
        boxes.serendipity().unwrap(),
    ]
}

/// The block of `dilatation.rs`: there is no locking, and at ν = 0.3 errors are those of the singular corners.
#[test]
fn cells_of_second_order_do_not_lock() {
    for (poisson, exact) in [(0.3, 0.023_118_7), (0.49, 0.033_793), (0.4999, 0.034_985)] {
        let errors =
            |n: usize| rectangle(n).map(|m| resultant(m, poisson, Dilatation::Automatic) / exact - 1.0);
        for (coarse, fine) in errors(4).into_iter().zip(errors(8)) {
            assert!(
                fine > 0.0 && fine < 0.03 && fine < 0.7 * coarse,
                "{poisson}: {coarse} {fine}"
            );
        }
        let mean = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [16, 8]).unwrap();
        let mean = resultant(mean, poisson, Dilatation::Mean) / exact - 1.0;
        assert!((errors(8)[1] - mean).abs() < 0.02, "{poisson}");
    }
}

/// In space hexahedra of second order, those of first order with the mean dilatation and tetrahedra of second order agree up to their
/// errors, which are of first order because of the singular edges; tetrahedra of first order lock.
#[test]
fn cubes_of_second_order_do_not_lock() {
    let block = |n: usize| Mesh::block([0.0; 3], [1.0; 3], [n, n, n]).unwrap();
    let of = |mesh: Mesh| resultant(mesh, 0.4999, Dilatation::Automatic);
    let [full, thin] = [block(4).second_order(), block(4).serendipity()].map(|m| of(m.unwrap()));
    assert!((of(block(8)) / full - 1.0).abs() < 0.04 && (thin / full - 1.0).abs() < 1e-3);
    let simplices = block(4).simplices().unwrap();
    let (first, second) = (of(simplices.clone()), of(simplices.second_order().unwrap()));
    assert!(
        (second / full - 1.0).abs() < 0.02 && first > 3.0 * full,
        "{first} {second} {full}"
    );
}

fn law(dim: usize) -> Frictionless {
    if dim == 2 {
        Frictionless::plane()
    } else {
        Frictionless::space()
    }
}

fn pressed(mesh: Mesh) -> ElasticSystem {
    let up = mesh.dim() - 1;
    let mut body = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .fix_component("left", 0)
        .prescribe("top", up, |_| -0.01);
    if up == 2 {
        body = body.fix_component("front", 1);
    }
    body.assemble().unwrap()
}

/// Two elements that cut facets, in space two by two.
fn on_coarse(dim: usize, degree: Degree) -> MultiplierSpace {
    let (x, y) = ([0.0, 0.9, 2.0], [0.0, 0.35, 1.0]);
    let mesh = match dim {
        2 => Mesh::rectangle_graded(&x, &y),
        _ => Mesh::block_graded(&x, &y, &[0.0, 1.0]),
    };
    let partition = Partition::Coarse {
        mesh: Box::new(mesh.unwrap()),
        facets: "bottom".into(),
    };
    MultiplierSpace::Piecewise { partition, degree }
}

/// Uniform pressure on a flat foundation, for each kind of cell and each space of multipliers: linear between corners it is exact nodewise;
/// the nodes on planes of symmetry hold their tangents.
#[test]
fn uniform_pressure_is_exact() {
    for mesh in raised(&first_order(2)) {
        let (dim, up) = (mesh.dim(), mesh.dim() - 1);
        let system = pressed(mesh);
        let mut normal = [0.0; 3];
        normal[up] = 1.0;
        let ground = Foundation::plane([0.0; 3], normal);
        let exact = match dim {
            2 => 0.01 / (1.0 - 0.3 * 0.3),
            _ => 0.01,
        };
        for multipliers in [
            MultiplierSpace::Nodal,
            MultiplierSpace::DualCells,
            on_coarse(dim, Degree::Constant),
            on_coarse(dim, Degree::Linear),
            on_coarse(dim, Degree::Continuous),
        ] {
            let is_nodal = multipliers == MultiplierSpace::Nodal;
            let rows = system.contact_with("bottom", &ground, multipliers).unwrap();
            assert!((rows.areas.iter().sum::<f64>() - 2.0).abs() < 1e-14);
            if is_nodal {
                let (nodes, held) = if dim == 2 { (4, 1) } else { (12, 6) };
                assert_eq!((rows.nodes.len(), rows.num_held()), (nodes, held));
            }
            let load = LoadPath::constant(system.supports().clone());
            let body = semismooth::contact_body(&system, &rows, load).unwrap();
            let pressures = CondensedContact::new(body, law(dim)).unwrap().solve(0.0, None);
            for (pressure, area) in pressures.unwrap().iter().zip(&rows.areas) {
                let error = (pressure / area - exact).abs();
                assert!(
                    error < 1e-12 * exact * 10.0,
                    "{} {error:e}",
                    system.mesh().kind(0)
                );
            }
        }
    }
}

/// A quarter of a disc with the middles of its outer edges on the circle: its moment is of fourth order in their size.
#[test]
fn curved_edges_are_of_fourth_order() {
    let error = |n: usize| {
        let angle = |k: f64| FRAC_PI_2 * k / n as f64;
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
        moment(&system, &system.body_force(|_| [1.0, 0.0, 0.0]).unwrap()) - 1.0 / 3.0
    };
    let (coarse, fine) = (error(4).abs(), error(8).abs());
    assert!(fine < coarse / 14.0 && coarse < 1e-3, "{coarse:e} {fine:e}");
}

/// Σ f_x x over the nodes.
fn moment(system: &ElasticSystem, load: &[f64]) -> f64 {
    let points = system.mesh().points().iter().enumerate();
    points
        .filter_map(|(n, p)| system.dof(n, 0).map(|d| load[d] * p[0]))
        .sum()
}

/// An eighth of a hollow ball, mapped from a block of each kind in space: volume and area are of fourth order at least.
#[test]
fn curved_faces_are_of_fourth_order() {
    let errors = |n: usize| {
        let block = Mesh::block([0.0; 3], [1.0; 3], [n, n, n]).unwrap();
        let kinds = [
            block.simplices().unwrap().second_order().unwrap(),
            block.second_order().unwrap(),
            block.serendipity().unwrap(),
        ];
        kinds.map(|mesh| {
            // Longitude and height on the unit sphere: areas are π/2 times those of the square.
            let ball = |[x, y, z]: [f64; 3]| {
                let (r, s) = (1.0 + z, (1.0 - 0.64 * y * y).sqrt());
                [
                    r * s * (FRAC_PI_2 * x).cos(),
                    r * s * (FRAC_PI_2 * x).sin(),
                    0.8 * r * y,
                ]
            };
            let mut mesh = moved(&mesh, ball);
            let radius = |x: [f64; 3]| x.iter().map(|x| x * x).sum::<f64>().sqrt();
            let along = |f: &BoundaryFacet| (0..3).map(|d| f.normal[d] * f.centre[d]).sum::<f64>();
            mesh.mark_boundary("outer", |f| along(f) > 0.9 * radius(f.centre));
            let system = Elasticity::new(mesh, material()).floating().discretize().unwrap();
            let sum = |load: Vec<f64>| load.iter().sum::<f64>();
            let volume = sum(system.body_force(|_| [1.0, 0.0, 0.0]).unwrap());
            let area = sum(system.traction("outer", |_| [0.0, 1.0, 0.0]).unwrap());
            let exact = 0.8 * FRAC_PI_2;
            [
                (volume / (exact * 7.0 / 3.0) - 1.0).abs(),
                (area / (exact * 4.0) - 1.0).abs(),
            ]
        })
    };
    for (coarse, fine) in errors(2).iter().zip(errors(4)) {
        for d in 0..2 {
            assert!(
                fine[d] < coarse[d] / 11.0 && coarse[d] < 5e-3,
                "{coarse:?} {fine:?}"
            );
        }
    }
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
    let second = squares.second_order().unwrap();
    assert!(matches!(second.simplices(), Err(FemError::Order { .. })));
    assert_eq!(second.second_order().unwrap(), second);
    let mut other = mesh.clone();
    assert!(other.add_facet_group("x", vec![vec![0, 1]]).is_ok());
    assert_eq!(other.facet_group("x").unwrap(), [vec![0, 1, 3]]);
    assert!(other.add_facet_group("x", vec![vec![0, 1, 4]]).is_err());
    assert!(squares.clone().add_facet_group("x", vec![vec![0, 1, 2]]).is_err());
}

/// One reference cell of each kind of second order in space, with Gmsh's numbers of its edges and faces (from its manual), and all faces as
/// a group: nodes are where they belong, also if the cell is turned round.
#[test]
fn gmsh_orders_nodes_in_its_own_way() {
    let hexahedron = [
        [0, 1],
        [0, 3],
        [0, 4],
        [1, 2],
        [1, 5],
        [2, 3],
        [2, 6],
        [3, 7],
        [4, 5],
        [4, 7],
        [5, 6],
        [6, 7],
    ];
    let faces = [
        [0, 3, 2, 1],
        [0, 1, 5, 4],
        [0, 4, 7, 3],
        [1, 2, 6, 5],
        [2, 3, 7, 6],
        [4, 5, 6, 7],
    ];
    let tetrahedron = [[0, 1], [1, 2], [2, 0], [3, 0], [2, 3], [1, 3]];
    let cube = [
        [0, 0, 0],
        [1, 0, 0],
        [1, 1, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 0, 1],
        [1, 1, 1],
        [0, 1, 1],
    ];
    let simplex = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]];
    for (kind, number, face) in [
        (CellKind::Tetrahedron10, 11, 9),
        (CellKind::Hexahedron20, 17, 16),
        (CellKind::Hexahedron27, 12, 10),
    ] {
        let is_simplex = kind == CellKind::Tetrahedron10;
        let (corners, edges): (&[[i32; 3]], &[[usize; 2]]) = match is_simplex {
            true => (&simplex, &tetrahedron),
            false => (&cube, &hexahedron),
        };
        let mut groups: Vec<Vec<usize>> = (0..corners.len()).map(|k| vec![k]).collect();
        groups.extend(edges.iter().map(|e| e.to_vec()));
        if kind == CellKind::Hexahedron27 {
            groups.extend(faces.iter().map(|f| f.to_vec()));
            groups.push((0..8).collect());
        }
        let mean = |group: &Vec<usize>, d: usize| {
            group.iter().map(|&k| f64::from(corners[k][d])).sum::<f64>() / group.len() as f64
        };
        for turned in [1.0, -1.0] {
            let points: Vec<[f64; 3]> = groups
                .iter()
                .map(|g| [turned * mean(g, 0), mean(g, 1), mean(g, 2)])
                .collect();
            let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", points.len());
            for (n, [x, y, z]) in points.iter().enumerate() {
                text += &format!("{} {x} {y} {z}\n", n + 1);
            }
            // Faces by their corners, then the middles of their edges, then that of the face.
            let own: Vec<[usize; 4]> = match is_simplex {
                true => vec![[0, 1, 2, 0]],
                false => faces.to_vec(),
            };
            text += &format!("$EndNodes\n$Elements\n{}\n1 {number} 2 7 1", own.len() + 1);
            (1..=points.len()).for_each(|n| text += &format!(" {n}"));
            let place = |group: &[usize]| {
                let sorted = |g: &[usize]| g.iter().copied().collect::<std::collections::BTreeSet<_>>();
                groups.iter().position(|g| sorted(g) == sorted(group))
            };
            for (k, f) in own.iter().enumerate() {
                let f = &f[..if is_simplex { 3 } else { 4 }];
                let round = (0..f.len()).filter_map(|a| place(&[f[a], f[(a + 1) % f.len()]]));
                let all = f.iter().copied().chain(round).chain(place(f));
                text += &format!("\n{} {face} 2 8 1", k + 2);
                all.for_each(|n| text += &format!(" {}", n + 1));
            }
            text += "\n$EndElements\n";
            let mesh = parse_gmsh(text.as_bytes(), "m.msh".as_ref()).unwrap();
            assert_eq!(mesh.kind(0), kind);
            let at = |n: usize| mesh.points()[n];
            for facet in kind.facets() {
                let nodes: Vec<usize> = facet.iter().map(|&a| mesh.cell(0)[a]).collect();
                let k = if is_simplex { 3 } else { 4 };
                for (a, &middle) in nodes[k..2 * k].iter().enumerate() {
                    let (p, q) = (at(nodes[a]), at(nodes[(a + 1) % k]));
                    assert!((0..3).all(|d| at(middle)[d] == 0.5 * (p[d] + q[d])));
                }
                if let Some(&centre) = nodes.get(8) {
                    let (p, q) = (at(nodes[0]), at(nodes[2]));
                    assert!((0..3).all(|d| at(centre)[d] == 0.5 * (p[d] + q[d])));
                }
            }
            let found = mesh.facet_group("physical 8").unwrap();
            assert!(found.len() == own.len() && found.iter().all(|f| f.len() == kind.facets()[0].len()));
            // Normals point outwards.
            assert!(mesh.boundary().iter().all(|f| {
                let away = |d: usize| f.normal[d] * (f.centre[d] - mesh.centre(0)[d]);
                (0..3).map(away).sum::<f64>() > 0.0
            }));
        }
    }
}

/// Cells with positive determinants at all nodes that fold between them, or are almost flat there; neighbours that do not fit.
#[test]
fn folded_cells_are_refused() {
    let triangle = |x: [[f64; 2]; 6]| {
        let points = x.map(|[x, y]| [x, y, 0.0]).to_vec();
        Mesh::new(2, points, [(CellKind::Triangle6, (0..6).collect())])
    };
    let straight = [
        [0.0, 0.0],
        [1.0, 0.0],
        [0.0, 1.0],
        [0.5, 0.0],
        [0.5, 0.5],
        [0.0, 0.5],
    ];
    assert!(triangle(straight).is_ok());
    // x = ξ + 4 c ξ η with the edge's middle at ½ + c: the determinant 1 + 4 c η vanishes at η = 1 for c = −1/4.
    for (c, fits) in [(-0.24, true), (-0.25, false), (-0.26, false)] {
        let mut x = straight;
        x[4][0] += c;
        match triangle(x) {
            Err(FemError::Jacobian { at, determinant, .. }) => {
                assert!(!fits && (determinant - (1.0 + 4.0 * c)).abs() < 1e-14 && at == [0.0, 1.0, 0.0]);
            }
            found => assert!(fits && found.is_ok()),
        }
    }
    // Found by a search: determinants are above 0.56 at all nodes, and -0.0496 at (1/4, 0).
    let mut x = straight;
    x[3..].copy_from_slice(&[[0.18, 0.25], [0.8, 0.85], [-0.14, 0.18]]);
    let folded = |found: Result<Mesh, FemError>| match found {
        Err(FemError::Jacobian {
            cell: 0, determinant, ..
        }) => assert!(determinant < 0.0, "{determinant}"),
        other => panic!("{other:?}"),
    };
    folded(triangle(x));
    // As a side of a hexahedron and a tetrahedron: swept, and with a fourth corner above.
    let mut solid: Vec<[f64; 3]> = [x[0], x[1], x[2]].iter().map(|p| [p[0], p[1], 0.0]).collect();
    solid.push([0.3, 0.3, 1.0]);
    solid.extend(x[3..].iter().map(|p| [p[0], p[1], 0.0]));
    solid.extend([0, 1, 2].map(|k| [0.5 * (x[k][0] + 0.3), 0.5 * (x[k][1] + 0.3), 0.5]));
    folded(Mesh::new(
        3,
        solid,
        [(CellKind::Tetrahedron10, (0..10).collect())],
    ));
    let block = Mesh::block([0.0; 3], [1.0; 3], [1, 1, 1])
        .unwrap()
        .second_order()
        .unwrap();
    let swept = |depth: f64| {
        let points = block.points().iter().map(|p| {
            // x runs back between the nodes at 0, ½ and 1 where the slope at ¼ is negative.
            let wave = depth * (p[1] - 0.5) * if p[0] == 0.5 { 1.0 } else { 0.0 };
            [p[0] + wave, p[1], p[2]]
        });
        Mesh::new(3, points.collect(), [(block.kind(0), block.cell(0).to_vec())])
    };
    // dx/dξ = 1 + 4 (1 − 2 ξ) wave is least at an end: 1 − 2 |depth| there.
    assert!(swept(0.49).is_ok());
    folded(swept(0.51));
    // Of first order, found by a search: above 0.14 at all corners, and −13/64 in the middle of the edge upwards from the second.
    let hexahedron = [
        [-0.5, -2.0, -1.5],
        [1.5, 0.0, -2.0],
        [1.0, 0.5, -1.0],
        [0.0, 0.5, -0.5],
        [-0.5, -0.5, 1.0],
        [0.0, -0.5, 0.0],
        [2.0, 0.0, 1.5],
        [-1.5, 1.0, 1.5],
    ];
    folded(Mesh::new(
        3,
        hexahedron.to_vec(),
        [(CellKind::Hexahedron, (0..8).collect())],
    ));
    let square = Mesh::rectangle([0.0; 2], [1.0; 2], [2, 1]).unwrap();
    let mut cells = vec![(CellKind::Quadrilateral, square.cell(0).to_vec())];
    let second = square.second_order().unwrap();
    cells.push((CellKind::Quadrilateral9, second.cell(1).to_vec()));
    let used: Vec<usize> = cells.iter().flat_map(|c| c.1.clone()).collect();
    let mut number: Vec<usize> = used.clone();
    number.sort_unstable();
    number.dedup();
    let points = number.iter().map(|&n| second.points()[n]).collect();
    let new = |n: &usize| number.binary_search(n).unwrap();
    let cells = cells
        .iter()
        .map(|(k, nodes)| (*k, nodes.iter().map(new).collect()));
    assert!(matches!(
        Mesh::new(2, points, cells.collect::<Vec<_>>()),
        Err(FemError::Neighbours { cells: [0, 1], at }) if at == [0.5, 0.5, 0.0]
    ));
}
