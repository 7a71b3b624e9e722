//! Bodies without supports, held by contact and friction alone.

use semismooth::contact::{
    ContactBody, ContactError, FrictionCoefficient, Frictionless, FullContact, LoadPath, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb,
};
use semismooth::fem::{ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh, Mortar};
use semismooth::sparse::Matrix;

use crate::random::Random;

const WEIGHT: f64 = 0.01;

fn coefficient(f: f64) -> FrictionCoefficient {
    FrictionCoefficient::constant(f).unwrap()
}

fn floating(mesh: Mesh) -> ElasticSystem {
    Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .floating()
        .assemble()
        .unwrap()
}

/// On a table, under its weight per volume and α times a pull.
fn on_table<L: NodeLaw>(mesh: Mesh, pull: [f64; 3], law: L) -> FullContact<L> {
    let (system, up) = (floating(mesh), [0.0, 1.0, 0.0]);
    let dim = system.mesh().dim();
    let up = if dim == 2 { up } else { [0.0, 0.0, 1.0] };
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], up))
        .unwrap();
    let weight = system.body_force(|_| up.map(|u| -WEIGHT * u)).unwrap();
    let load = LoadPath::affine(weight, system.body_force(|_| pull).unwrap());
    let tangential = rows.tangential;
    let body = ContactBody::new(system.stiffness().clone(), rows.normal, tangential, load).unwrap();
    FullContact::new(body, law).unwrap()
}

fn is_unbalanced(found: Result<Vec<f64>, ContactError>) {
    assert!(
        matches!(found, Err(ContactError::Unbalanced { work, .. }) if work > 0.0),
        "{found:?}"
    );
}

/// A block pulled by less than friction bears stays, its forces as statics has them; pulled by more, a motion that lifts it while it slides
/// proves that nothing balances the load.
#[test]
fn a_block_on_a_table_is_held_by_friction() {
    let mesh = || Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2]).unwrap();
    let problem = on_table(mesh(), [WEIGHT, 0.0, 0.0], PlanarCoulomb::new(coefficient(0.5)));
    for alpha in [0.0, 0.3, 0.45] {
        let x = problem.solve(alpha, None).unwrap();
        let solution = problem.solution(&x).unwrap();
        let [normal, tangential, _] = solution.resultant();
        assert!((normal - 2.0 * WEIGHT).abs() < 1e-10 && (tangential - 2.0 * WEIGHT * alpha).abs() < 1e-10);
        // The pull acts at half the height: its moment is that of the pressures about the middle.
        let p = solution.nodes.len();
        let lever = |i: usize| solution.nodes[i].pressure * (2.0 * i as f64 / (p - 1) as f64 - 1.0);
        let moment: f64 = (0..p).map(lever).sum();
        assert!((moment - WEIGHT * alpha).abs() < 1e-10, "{moment}");
    }
    is_unbalanced(problem.solve(0.55, None));
    is_unbalanced(problem.solve(-0.55, None));
    // With much friction it tips over before it slips: at α = 2.
    let problem = on_table(mesh(), [WEIGHT, 0.0, 0.0], PlanarCoulomb::new(coefficient(5.0)));
    assert!(problem.solve(1.5, None).is_ok());
    is_unbalanced(problem.solve(2.1, None));
}

/// The motion that proves it has a name where positions of nodes are known: along a smooth table, and down a smooth slope.
#[test]
fn the_motion_that_nothing_resists_is_named() {
    for (dim, slope, words) in [
        (2, 0.0, "the body slides along (1, 0)"),
        (2, 0.75, "the body slides along (0.8, -0.6)"),
        (3, 0.0, "the body slides along (1, 0, 0)"),
    ] {
        let mesh = match dim {
            2 => Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2]).unwrap(),
            _ => Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [2, 1, 1]).unwrap(),
        };
        let system = floating(mesh);
        let mut up = [0.0; 3];
        (up[0], up[dim - 1]) = (slope, 1.0);
        let ground = Foundation::plane([0.0; 3], up).with_normal(move |_| up.map(|u| -u));
        let rows = system.contact("bottom", &ground).unwrap();
        let mut down = [if slope == 0.0 { WEIGHT } else { 0.0 }, 0.0, 0.0];
        down[dim - 1] = -WEIGHT;
        let load = system.body_force(|_| down).unwrap();
        let body = semismooth::contact_body(&system, &rows, LoadPath::constant(load)).unwrap();
        let found = match dim {
            2 => FullContact::new(body, Frictionless::plane())
                .unwrap()
                .solve(0.0, None),
            _ => FullContact::new(body, Frictionless::space())
                .unwrap()
                .solve(0.0, None),
        };
        match found {
            Err(e @ ContactError::Unbalanced { .. }) => assert!(e.to_string().contains(words), "{e}"),
            other => panic!("{other:?}"),
        }
    }
}

/// Two forces on the upper side of a block on a table, random ones and vertical ones out of the middle: contact holds the block exactly where
/// statics says so, N > 0 ≥ |T| − F N, N between both ends of the table, and then with that resultant and moment; elsewhere a motion proves
/// that nothing does.
#[test]
fn a_block_is_held_where_statics_says_so() {
    let mut mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2]).unwrap();
    mesh.mark_nodes("middle", |x| x == [1.0, 1.0, 0.0]);
    mesh.mark_nodes("corner", |x| x == [2.0, 1.0, 0.0]);
    let system = floating(mesh);
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let random = &mut Random::new(3);
    let mut counts = [0; 2];
    for k in 0..120 {
        let f = [0.0, 0.1, 0.5, 1.0][k % 4];
        let mut uniform = |size: f64| random.between(-size, size);
        let mut middle = [uniform(1.0), uniform(0.8) - 0.4];
        let mut corner = [uniform(0.5), uniform(0.5)];
        // Without friction nothing holds the block along the table, where nothing pushes it.
        if k % 8 < 4 && f > 0.0 {
            (middle[0], corner[0]) = (0.0, 0.0);
        }
        let (normal, tangential) = (-(middle[1] + corner[1]), middle[0] + corner[0]);
        let moment = (middle[0] - middle[1]) + (corner[0] - 2.0 * corner[1]);
        let slacks = [
            normal,
            f * normal - tangential.abs(),
            moment,
            2.0 * normal - moment,
        ];
        let least = slacks.into_iter().fold(f64::INFINITY, f64::min);
        if least.abs() < 1e-3 {
            continue;
        }
        let force = |group: &str, of: [f64; 2]| {
            system
                .nodal_force(group, |_| [WEIGHT * of[0], WEIGHT * of[1], 0.0])
                .unwrap()
        };
        let (a, b) = (force("middle", middle), force("corner", corner));
        let load = a.iter().zip(&b).map(|(a, b)| a + b).collect::<Vec<f64>>();
        let body = semismooth::contact_body(&system, &rows, LoadPath::constant(load)).unwrap();
        let problem = FullContact::new(body, PlanarCoulomb::new(coefficient(f))).unwrap();
        let found = problem.solve(0.0, None);
        if least < 0.0 {
            counts[0] += 1;
            is_unbalanced(found);
            continue;
        }
        counts[1] += 1;
        let x = found.unwrap_or_else(|e| panic!("{f} {middle:?} {corner:?}: {e}"));
        let nodes = problem.solution(&x).unwrap().nodes;
        let sums = nodes.iter().enumerate().fold([0.0; 3], |sum, (i, node)| {
            let pressure = node.pressure / WEIGHT;
            [
                sum[0] + pressure,
                sum[1] + node.traction[0] / WEIGHT,
                sum[2] + rows.points[i][0] * pressure,
            ]
        });
        assert!(
            (sums[0] - normal).abs() < 1e-8 && (sums[2] - moment).abs() < 1e-8,
            "{sums:?}"
        );
        assert!(
            (sums[1].abs() - tangential.abs()).abs() < 1e-8,
            "{sums:?} {tangential}"
        );
    }
    assert!(counts.iter().all(|c| *c > 20), "{counts:?}");
}

#[test]
fn a_cube_is_held_in_all_directions() {
    let mesh = Mesh::block([0.0; 3], [1.0; 3], [2, 2, 2]).unwrap();
    let law = OrthotropicCoulomb::new(coefficient(0.5), coefficient(0.25));
    // Along (2, 1): ‖F⁻¹ λt‖ = √((2 / 0.5)² + (1 / 0.25)²) = 4 √2 times the pull.
    let problem = on_table(mesh, [2.0 * WEIGHT, WEIGHT, 0.0], law);
    let limit = 1.0 / (4.0 * 2.0f64.sqrt());
    let x = problem.solve(0.8 * limit, None).unwrap();
    let [normal, first, second] = problem.solution(&x).unwrap().resultant();
    assert!((normal - WEIGHT).abs() < 1e-10);
    assert!(
        (first.abs() - 1.6 * limit * WEIGHT).abs() < 1e-10
            && (second.abs() - 0.8 * limit * WEIGHT).abs() < 1e-10
    );
    is_unbalanced(problem.solve(1.2 * limit, None));
}

/// One block on another on a table: both stay while the pull on the upper one is below the lesser of the bounds of both interfaces.
#[test]
fn stacks_stand_by_friction() {
    let lower = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2]).unwrap();
    let upper = Mesh::rectangle([0.5, 1.0], [1.5, 1.5], [3, 2]).unwrap();
    let shift = lower.num_nodes();
    let points = [lower.points(), upper.points()].concat();
    let mut cells: Vec<_> = (0..lower.num_cells())
        .map(|c| (lower.kind(c), lower.cell(c).to_vec()))
        .collect();
    cells.extend((0..upper.num_cells()).map(|c| {
        let nodes = upper.cell(c).iter().map(|n| n + shift).collect();
        (upper.kind(c), nodes)
    }));
    let mut mesh = Mesh::new(2, points, cells).unwrap();
    let facets = |of: &Mesh, name: &str, shift: usize| -> Vec<Vec<usize>> {
        let group = of.facet_group(name).unwrap().iter();
        group.map(|f| f.iter().map(|n| n + shift).collect()).collect()
    };
    mesh.add_facet_group("table", facets(&lower, "bottom", 0))
        .unwrap();
    mesh.add_facet_group("seat", facets(&lower, "top", 0)).unwrap();
    mesh.add_facet_group("foot", facets(&upper, "bottom", shift))
        .unwrap();
    let refused = Elasticity::new(mesh.clone(), Material::isotropic(1.0, 0.3).unwrap()).assemble();
    assert!(matches!(refused, Err(FemError::Floating { .. })));
    let system = floating(mesh);
    let ground = system
        .contact("table", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let between = system
        .contact_between("foot", "seat", &Mortar::default())
        .unwrap();
    let stacked = |a: &Matrix, b: &Matrix| {
        let below = b.triplets().map(|(i, j, v)| (a.nrows() + i, j, v));
        let entries: Vec<_> = a.triplets().chain(below).collect();
        Matrix::from_triplets(a.nrows() + b.nrows(), a.ncols(), &entries).unwrap()
    };
    let weight = system.body_force(|_| [0.0, -WEIGHT, 0.0]).unwrap();
    let pull = system
        .body_force(|x| [if x[1] > 1.0 { WEIGHT } else { 0.0 }, 0.0, 0.0])
        .unwrap();
    let normal = stacked(&ground.normal, &between.normal);
    let tangential = stacked(&ground.tangential[0], &between.tangential[0]);
    let load = LoadPath::affine(weight, pull);
    let body = ContactBody::new(system.stiffness().clone(), normal, vec![tangential], load).unwrap();
    let p = ground.nodes.len();
    let mut friction = vec![0.3; p];
    friction.extend(vec![0.4; between.nodes.len()]);
    let law = PlanarCoulomb::new(FrictionCoefficient::nodal(friction).unwrap());
    let problem = FullContact::new(body, law).unwrap();
    let x = problem.solve(0.3, None).unwrap();
    let nodes = problem.solution(&x).unwrap().nodes;
    let sum = |of: &dyn Fn(usize) -> f64, nodes: std::ops::Range<usize>| nodes.map(of).sum::<f64>();
    let (count, upper, all) = (nodes.len(), 0.5 * WEIGHT, 2.5 * WEIGHT);
    assert!((sum(&|i| nodes[i].pressure, 0..p) - all).abs() < 1e-10);
    assert!((sum(&|i| nodes[i].pressure, p..count) - upper).abs() < 1e-10);
    assert!((sum(&|i| nodes[i].traction[0], 0..p) - 0.3 * upper).abs() < 1e-10);
    assert!((sum(&|i| nodes[i].traction[0], p..count) - 0.3 * upper).abs() < 1e-10);
    // The upper block slides off at 0.4 of its weight.
    is_unbalanced(problem.solve(0.45, None));
}
