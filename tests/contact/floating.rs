//! Bodies without supports, held by contact and friction alone.

use std::ops::ControlFlow;
use std::time::Duration;

use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, ContactOptions, ContactParameters, ContactSolution,
    ContactState, EvolutionOptions, FrictionCoefficient, Frictionless, FullContact, LoadPath, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb, UniquenessConstants, critical_friction, evolve,
};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::fem::{ContactRows, ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh, Mortar};
use semismooth::piecewise::PiecewiseSmooth;
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

/// A block on a table, with its middle and a corner of its upper side.
fn block_on_table() -> (ElasticSystem, ContactRows) {
    let mut mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2]).unwrap();
    mesh.mark_nodes("middle", |x| x == [1.0, 1.0, 0.0]);
    mesh.mark_nodes("corner", |x| x == [2.0, 1.0, 0.0]);
    let system = floating(mesh);
    let table = Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]);
    let rows = system.contact("bottom", &table).unwrap();
    (system, rows)
}

/// Forces there, in multiples of the weight of a unit volume.
fn pushed(system: &ElasticSystem, middle: [f64; 2], corner: [f64; 2]) -> LoadPath {
    let [a, b] = [("middle", middle), ("corner", corner)].map(|(group, [x, y])| {
        let force = |_| [WEIGHT * x, WEIGHT * y, 0.0];
        system.nodal_force(group, force).unwrap()
    });
    LoadPath::constant(a.iter().zip(&b).map(|(a, b)| a + b).collect::<Vec<_>>())
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
    // So it is where there is no time for a search.
    let hurried = ContactOptions::default().with_max_time(Some(Duration::ZERO));
    let found = problem.solve_observed(0.55, None, &hurried, |_| ControlFlow::Continue(()));
    is_unbalanced(found.map(|report| report.x));
    let found = problem.solve_observed(0.45, None, &hurried, |_| ControlFlow::Continue(()));
    assert!(found.is_err_and(|e| e.is_interrupted()));
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
    let (system, rows) = block_on_table();
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
        let body = semismooth::contact_body(&system, &rows, pushed(&system, middle, corner)).unwrap();
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

/// One block on another on a table: both stay while the pull on the upper one is below the lesser of the bounds of both interfaces, in both
/// forms alike.
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
    let (problem, condensed, motions) = both(&body, law);
    assert_eq!(motions, 6);
    for alpha in [0.0, 0.1, -0.2, 0.3] {
        same_solution(&problem, &condensed, alpha, &format!("stack, {alpha}"));
    }
    is_unbalanced(condensed.solve(0.45, None));
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

/// The same body in both forms, with the numbers of unknowns c.
fn both<L: NodeLaw + Clone>(body: &ContactBody, law: L) -> (FullContact<L>, CondensedContact<L>, usize) {
    let full = FullContact::new(body.clone(), law.clone()).unwrap();
    let condensed = CondensedContact::new(body.clone(), law).unwrap();
    let motions = condensed.num_traces() - full.num_traces();
    (full, condensed, motions)
}

/// Displacements, forces and energies are those of the full form, and so is each residual at its solution.
fn same_solution<L: NodeLaw>(
    full: &FullContact<L>,
    condensed: &CondensedContact<L>,
    alpha: f64,
    hint: &str,
) -> [f64; 3] {
    let x = full
        .solve(alpha, None)
        .unwrap_or_else(|e| panic!("full, {hint}: {e}"));
    let y = condensed
        .solve(alpha, None)
        .unwrap_or_else(|e| panic!("condensed, {hint}: {e}"));
    let expanded = condensed.expand(&y).unwrap();
    let (n, q) = (full.num_displacements(), full.num_traces());
    let largest = |v: &[f64]| v.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    for block in [0..n, n..n + q] {
        let size = largest(&x[block.clone()]);
        for k in block {
            assert!(
                (x[k] - expanded[k]).abs() < 1e-10 * size,
                "{hint}: {k}: {} {} of {size}",
                x[k],
                expanded[k]
            );
        }
    }
    let (one, other) = (full.solution(&x).unwrap(), condensed.solution(&y).unwrap());
    assert_eq!(one.states, other.states, "{hint}");
    assert!(other.residuals.largest() < 1e-10, "{hint}: {}", other.residuals);
    let energies = |s: &ContactSolution| [s.energy.stored, s.energy.load, s.energy.friction];
    for (a, b) in energies(&one).into_iter().zip(energies(&other)) {
        assert!((a - b).abs() < 1e-9 * one.energy.load.abs(), "{hint}: {a} {b}");
    }
    other.resultant()
}

/// A block on a table, by friction alone: three motions without energy in the plane, six in space. Their amplitudes follow the forces among
/// the unknowns, and the rows of balance the law; forces are those of the full form and of statics.
#[test]
fn bodies_on_friction_condense() {
    for (dim, motions) in [(2, 3), (3, 6)] {
        let mesh = match dim {
            2 => Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2]).unwrap(),
            _ => Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [3, 2, 2]).unwrap(),
        };
        let (system, mut up) = (floating(mesh), [0.0; 3]);
        up[dim - 1] = 1.0;
        let rows = system
            .contact("bottom", &Foundation::plane([0.0; 3], up))
            .unwrap();
        let weight = system.body_force(|_| up.map(|u| -WEIGHT * u)).unwrap();
        let pull = system.body_force(|_| [WEIGHT, 0.0, 0.0]).unwrap();
        let body = semismooth::contact_body(&system, &rows, LoadPath::affine(weight, pull)).unwrap();
        match dim {
            2 => held(&body, PlanarCoulomb::new(coefficient(0.5)), motions),
            _ => held(&body, OrthotropicCoulomb::isotropic(coefficient(0.5)), motions),
        }
    }
}

/// The block weighs and is pulled by 2 WEIGHT (1, α); F = 0.5.
fn held<L: NodeLaw + Clone>(body: &ContactBody, law: L, motions: usize) {
    let (full, condensed, found) = both(body, law);
    assert_eq!(found, motions);
    for alpha in [0.0, 0.3, -0.4] {
        let [normal, tangential, _] = same_solution(&full, &condensed, alpha, "a block");
        assert!((normal - 2.0 * WEIGHT).abs() < 1e-12, "{normal}");
        assert!(
            (tangential.abs() - 2.0 * WEIGHT * alpha.abs()).abs() < 1e-12,
            "{tangential}"
        );
    }
    is_unbalanced(condensed.solve(0.55, None));
}

/// Two forces at random on a block: both forms find the same, or the same reason why there is nothing to be found.
#[test]
fn both_forms_agree_on_random_loads() {
    let (system, rows) = block_on_table();
    let random = &mut Random::new(11);
    let mut counts = [0; 2];
    for k in 0..60 {
        let f = [0.2, 0.5, 1.0][k % 3];
        let mut uniform = |size: f64| random.between(-size, size);
        let (a, b) = ([uniform(0.5), uniform(0.4) - 0.8], [uniform(0.3), uniform(0.5)]);
        let body = semismooth::contact_body(&system, &rows, pushed(&system, a, b)).unwrap();
        let (full, condensed, _) = both(&body, PlanarCoulomb::new(coefficient(f)));
        match full.solve(0.0, None) {
            Ok(_) => {
                counts[0] += 1;
                same_solution(&full, &condensed, 0.0, &format!("{k}"));
            }
            Err(ContactError::Unbalanced { motion, work, .. }) => {
                counts[1] += 1;
                match condensed.solve(0.0, None) {
                    Err(ContactError::Unbalanced {
                        motion: m, work: w, ..
                    }) => assert_eq!((m, w), (motion, work)),
                    other => panic!("{k}: {other:?}"),
                }
            }
            Err(e) => panic!("{k}: {e}"),
        }
    }
    assert!(counts.iter().all(|c| *c > 10), "{counts:?}");
}

/// The map: derivatives are those of its residuals, determinants have the sign of those in full form, and with exact coefficients the lists
/// of all solutions are those of the full form.
#[test]
fn the_condensed_map_of_a_floating_body_is_that_of_the_full_form() {
    let system = floating(Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [2, 1]).unwrap());
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let weight = system.body_force(|_| [0.0, -WEIGHT, 0.0]).unwrap();
    let pull = system.body_force(|_| [WEIGHT, 0.0, 0.0]).unwrap();
    let body = semismooth::contact_body(&system, &rows, LoadPath::affine(weight, pull)).unwrap();
    let (full, condensed, motions) = both(&body, PlanarCoulomb::new(coefficient(0.4)));
    let (m, vars) = (condensed.num_residuals(), condensed.num_vars());
    assert_eq!((m, vars, motions), (9, 10, 3));
    let random = &mut Random::new(5);
    for states in [
        [ContactState::Stick; 3],
        [ContactState::Stick, ContactState::SlipPlus, ContactState::Stick],
        [ContactState::Open, ContactState::Stick, ContactState::Stick],
    ] {
        let selection = condensed.selection_of(&states);
        let x: Vec<f64> = (0..vars).map(|_| random.between(-1.0, 1.0)).collect();
        let mut jac = Matrix::zeros(condensed.pattern());
        condensed.jacobian(&selection, &x, &mut jac);
        let at = |x: &[f64]| {
            let mut h = vec![0.0; m];
            condensed.residual(&selection, x, &mut h);
            h
        };
        for j in 0..vars {
            let (mut low, mut high) = (x.clone(), x.clone());
            (low[j], high[j]) = (x[j] - 0.5, x[j] + 0.5);
            for (i, (low, high)) in at(&low).into_iter().zip(at(&high)).enumerate() {
                assert!((high - low - jac.get(i, j)).abs() < 1e-12, "{states:?} {i} {j}");
            }
        }
        let sign = |map: &dyn PiecewiseSmooth, x: &[f64]| {
            let mut jac = Matrix::zeros(map.pattern());
            map.jacobian(&selection, x, &mut jac);
            determinant_sign(&jac, map.num_residuals())
        };
        let expanded = condensed.expand(&x).unwrap();
        let point = [&expanded[..full.num_displacements()], &x[..2 * 3], &x[vars - 1..]].concat();
        assert_eq!(sign(&condensed, &x), sign(&full, &point), "{states:?}");
    }
    for alpha in [0.0, 0.3] {
        let list =
            |map: &dyn PiecewiseSmooth| all_solutions(map, alpha, &EnumerationOptions::default()).unwrap();
        let (of_full, of_condensed) = (list(&full), list(&condensed));
        assert!(of_full.completeness.is_complete() && of_condensed.completeness.is_complete());
        assert_eq!(of_full.solutions.len(), of_condensed.solutions.len());
        for (a, b) in of_full.solutions.iter().zip(&of_condensed.solutions) {
            let expanded = condensed.expand(&b.x).unwrap();
            let size = expanded.iter().fold(1.0f64, |m, v| m.max(v.abs()));
            for (u, v) in a.x.iter().zip(&expanded).take(full.num_displacements() + 6) {
                assert!((u - v).abs() < 1e-10 * size, "{alpha}: {u} {v}");
            }
        }
    }
}

/// Larger bodies have exact coefficients of their stored compliance, in which motions without energy have none: no solution lies at rounding's
/// reciprocal, where the smallest eigenvalue of a stiffness matrix would put the open body.
#[test]
fn lists_of_floating_bodies_are_those_of_exactly_rigid_motions() {
    let system = floating(Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2]).unwrap());
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let weight = system.body_force(|_| [0.0, -WEIGHT, 0.0]).unwrap();
    let pull = system.body_force(|_| [WEIGHT, 0.0, 0.0]).unwrap();
    let body = semismooth::contact_body(&system, &rows, LoadPath::affine(weight, pull)).unwrap();
    let law = PlanarCoulomb::new(coefficient(0.4));
    let condensed = CondensedContact::new(body, law).unwrap();
    let x = condensed.solve(0.3, None).unwrap();
    let found = all_solutions(&condensed, 0.3, &EnumerationOptions::default()).unwrap();
    assert!(found.completeness.is_complete(), "{found}");
    let distance = |y: &[f64]| {
        let apart = x.iter().zip(y).map(|(a, b)| (a - b).abs());
        apart.fold(0.0f64, f64::max)
    };
    assert!(found.solutions.iter().any(|s| distance(&s.x) < 1e-10), "{found}");
    assert!(found.solutions.iter().all(|s| distance(&s.x) < 1.0), "{found}");
}

/// The sign of the determinant of the first columns, by elimination.
fn determinant_sign(jac: &Matrix, n: usize) -> i32 {
    let mut a: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| jac.get(i, j)).collect()).collect();
    let mut sign = 1;
    for k in 0..n {
        let pivot = (k..n)
            .max_by(|i, j| a[*i][k].abs().total_cmp(&a[*j][k].abs()))
            .unwrap();
        if pivot != k {
            a.swap(pivot, k);
            sign = -sign;
        }
        sign *= a[k][k].signum() as i32;
        for i in k + 1..n {
            let factor = a[i][k] / a[k][k];
            let row = a[k].clone();
            a[i].iter_mut().zip(&row).for_each(|(v, r)| *v -= factor * r);
        }
    }
    sign
}

/// Derivatives of a body that friction alone holds, by the full form and by the system bordered by its motions: in α, in loads, in the
/// gap and in the coefficient of friction; those of histories through the slips of levels before, too.
#[test]
fn derivatives_of_floating_bodies_are_those_of_the_full_form() {
    let (system, rows) = block_on_table();
    let weight = system.body_force(|_| [0.0, -WEIGHT, 0.0]).unwrap();
    let pull = system.body_force(|_| [WEIGHT, 0.0, 0.0]).unwrap();
    let load = LoadPath::affine(weight, pull);
    let body = || semismooth::contact_body(&system, &rows, load.clone()).unwrap();
    let law = PlanarCoulomb::new(coefficient(0.4));
    let mut condensed = CondensedContact::new(body(), law.clone()).unwrap();
    let mut full = FullContact::new(body(), law).unwrap();
    let (n, p) = (system.num_free(), rows.nodes.len());
    let dense = |rows: usize, values: &dyn Fn(usize) -> f64| {
        let entries: Vec<_> = (0..rows).map(|i| (i, 0, values(i))).collect();
        Matrix::from_triplets(rows, 1, &entries).unwrap()
    };
    let (loads, ones) = (dense(n, &|i| WEIGHT * (1.7 * i as f64).sin()), dense(p, &|_| 1.0));
    let gaps = dense(p, &|i| 0.01 * (i as f64).cos());
    let parameters = |empty: ContactParameters| {
        let law = PlanarCoulomb::new(coefficient(0.4).with_second(vec![1.0; p]).unwrap());
        let made = empty.with_alpha().with_loads(&loads).unwrap();
        made.with_gaps(&gaps).unwrap().with_law(law, &ones).unwrap()
    };
    let close = |a: &[f64], b: &[f64]| {
        let size = a.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        assert!(size > 0.0 && a.len() == b.len());
        assert!(
            a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9 * size),
            "{a:?} {b:?}"
        );
    };
    let (x, y) = (
        full.solve(0.35, None).unwrap(),
        condensed.solve(0.35, None).unwrap(),
    );
    let states = condensed.solution(&y).unwrap().states;
    assert!(
        states.iter().any(|s| s.is_slip()) && states.contains(&ContactState::Stick),
        "{states:?}"
    );
    let mut of_full = full.sensitivity(&x, &parameters(full.parameters())).unwrap();
    let mut of_condensed = condensed
        .sensitivity(&y, &parameters(condensed.parameters()))
        .unwrap();
    for j in 0..4 {
        let mut delta = [0.0; 4];
        delta[j] = 1.0;
        let (a, b) = (of_full.jvp(&delta).unwrap(), of_condensed.jvp(&delta).unwrap());
        close(&a.displacements, &b.displacements);
        close(&a.forces, &b.forces);
    }
    let of_u: Vec<f64> = (0..n).map(|i| (0.3 * i as f64).cos()).collect();
    let of_forces: Vec<f64> = (0..2 * p).map(|i| (0.9 * i as f64).sin()).collect();
    close(
        &of_full.vjp(&of_u, &of_forces).unwrap(),
        &of_condensed.vjp(&of_u, &of_forces).unwrap(),
    );
    let levels = [0.2, 0.35, 0.1];
    let options = EvolutionOptions::default();
    let go = |_: &_| ControlFlow::Continue(());
    let (x, y) = (
        full.solve(0.0, None).unwrap(),
        condensed.solve(0.0, None).unwrap(),
    );
    let (fresh_full, fresh_condensed) = (full.clone(), condensed.clone());
    let (mut xs, mut ys) = (vec![x.clone()], vec![y.clone()]);
    xs.extend(
        evolve(&mut full, &x, &levels, &options, go)
            .unwrap()
            .into_iter()
            .map(|s| s.x),
    );
    ys.extend(
        evolve(&mut condensed, &y, &levels, &options, go)
            .unwrap()
            .into_iter()
            .map(|s| s.x),
    );
    let of_levels = |empty: ContactParameters| vec![parameters(empty); 4];
    let a = fresh_full
        .history_sensitivity(&xs, &of_levels(full.parameters()))
        .unwrap();
    let b = fresh_condensed
        .history_sensitivity(&ys, &of_levels(condensed.parameters()))
        .unwrap();
    let delta = [0.1, 0.5, 0.2, 0.3];
    for (a, b) in a.jvp(&delta).unwrap().iter().zip(b.jvp(&delta).unwrap()) {
        close(&a.displacements, &b.displacements);
        close(&a.forces, &b.forces);
    }
    assert_eq!(a.differentiable().unwrap(), b.differentiable().unwrap());
    if a.differentiable().unwrap() == Some(true) {
        close(
            &a.vjp(&of_u, &of_forces).unwrap(),
            &b.vjp(&of_u, &of_forces).unwrap(),
        );
    }
}

/// A body that contact does not see cannot be held; bounds that need a definite compliance are refused.
#[test]
fn what_contact_cannot_hold_is_refused_in_condensed_form() {
    // Two springs without support, of which one node may touch, and the same with the other node apart.
    let a = Matrix::from_rows(&[
        [1.0, -1.0, 0.0, 0.0],
        [-1.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 0.0],
    ])
    .unwrap();
    let normal = Matrix::from_rows(&[[1.0, 0.0, 0.0, 0.0]]).unwrap();
    let tangential = Matrix::from_rows(&[[0.0, 0.0, 1.0, 0.0]]).unwrap();
    let load = LoadPath::constant(vec![1.0, 1.0, 0.0, 0.0]);
    let body = ContactBody::new(a, normal, vec![tangential], load).unwrap();
    let found = CondensedContact::new(body, Frictionless::plane()).map(|_| ());
    assert!(
        matches!(found, Err(ContactError::Unsupported { .. })),
        "{found:?}"
    );
    let system = floating(Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [2, 1]).unwrap());
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let weight = system.body_force(|_| [0.0, -WEIGHT, 0.0]).unwrap();
    let body = semismooth::contact_body(&system, &rows, LoadPath::constant(weight)).unwrap();
    let condensed = CondensedContact::new(body, PlanarCoulomb::new(coefficient(0.4))).unwrap();
    let refused = [
        condensed.delassus(0.0).map(|_| ()),
        UniquenessConstants::new(&condensed, &rows.areas).map(|_| ()),
        critical_friction(&condensed).map(|_| ()),
    ];
    for found in refused {
        assert!(
            matches!(found, Err(ContactError::Unsupported { .. })),
            "{found:?}"
        );
    }
}
