//! Contact between two bodies in the displacements alone: the trace of a slave node is a variable in place of its displacement.

use semismooth::contact::{
    CondensedContact, ContactError, ContactForm, ContactStrategy, LoadPath, NodeLaw, ReducedContact,
    ReducedOptions,
};
use semismooth::fem::{ContactRows, ElasticSystem, Elasticity, Foundation, Material, Mesh, Mortar};
use semismooth::sparse::Matrix;
use semismooth::{contact_problem, reduced_body};

use crate::two_bodies::{Order, Stack, planar, spatial};

/// Two blocks pressed together, the upper one pulled at its side; they part where x is small.
fn pressed(stack: &Stack, roles: [&str; 2]) -> (ElasticSystem, ContactRows, LoadPath) {
    let mesh = stack.mesh();
    let (dim, up) = (mesh.dim(), mesh.dim() - 1);
    let mut body = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap()).fix("base");
    for d in 0..dim {
        body = body.prescribe("top", d, move |_| if d == up { -0.03 } else { 0.004 });
    }
    let system = body.assemble().unwrap();
    let mortar = Mortar::default().with_gap(|x| 0.05 * (1.0 - x[0]).powi(2));
    let rows = system.contact_between(roles[0], roles[1], &mortar).unwrap();
    let pull = system
        .traction("others", |x| {
            if x[up] > 0.0 {
                [0.03, 0.01 * f64::from(u8::from(dim == 3)), 0.0]
            } else {
                [0.0; 3]
            }
        })
        .unwrap();
    let still = system.supports().clone();
    (system, rows, LoadPath::affine(still, pull))
}

fn size(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |m, v| m.max(v.abs()))
}

fn near(a: &[f64], b: &[f64], tolerance: f64) {
    assert_eq!(a.len(), b.len());
    let far = a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    assert!(far <= tolerance * size(a), "{far:e} of {:e}", size(a));
}

/// The same solution in the three forms, and from the body that the displacements form gives back; the numbers of nodes
/// that are open, stick and slip.
fn agree<L: NodeLaw + Clone + Sync>(stack: &Stack, roles: [&str; 2], law: &L) -> [usize; 3] {
    let (system, rows, load) = pressed(stack, roles);
    assert!(rows.has_own_nodes(&system) && !rows.is_nodal(&system));
    let problem = |form| contact_problem(&system, &rows, load.clone(), law.clone(), form).unwrap();
    let mut problems = [
        ContactForm::Condensed,
        ContactForm::Full,
        ContactForm::Displacements,
    ]
    .map(problem);
    let body = reduced_body(&system, &rows, load.clone()).unwrap();
    let back = CondensedContact::new(body.to_contact_body().unwrap(), law.clone()).unwrap();
    let mut met = [0; 3];
    for alpha in [0.0, 0.7] {
        let found = problems.each_mut().map(|p| p.solve(alpha, None).unwrap());
        for other in &found[1..] {
            // Krylov iterations end at residuals of 1e-10.
            near(&found[0].displacements, &other.displacements, 1e-8);
            near(&found[0].forces, &other.forces, 1e-8);
            assert_eq!(found[0].solution.states, other.solution.states);
            assert!(other.solution.residuals.largest() <= 1e-9);
            let energy = |k: usize| found[k].solution.energy.stored;
            assert!((energy(0) - energy(2)).abs() <= 1e-8 * energy(0));
        }
        let x = back.solve(alpha, None).unwrap();
        near(&found[0].forces, &x[..found[0].forces.len()], 1e-9);
        let states = &found[0].solution;
        let own = [states.open(), states.stick(), states.slip()];
        met = std::array::from_fn(|k| met[k] + own[k]);
    }
    met
}

/// Meshes that match and that do not, inclined, bent, of simplices, either side as slave; and a crack, next to whose tip multipliers act on
/// several nodes of the slave.
#[test]
fn two_bodies_have_one_solution_in_all_forms() {
    let mut met = [0; 3];
    let mut count = |own: [usize; 3]| met = std::array::from_fn(|k| met[k] + own[k]);
    for (cells, slope, simplices) in [([6, 9], 0.0, false), ([9, 5], 0.1, true), ([6, 6], 0.0, false)] {
        let stack = Stack {
            slope,
            simplices,
            ..Stack::new(2, cells)
        };
        for roles in [["upper", "lower"], ["lower", "upper"]] {
            count(agree(&stack, roles, &planar(0.3)));
        }
    }
    for (cells, simplices, bent) in [([3, 4], false, 0.0), ([4, 3], true, 0.4)] {
        let stack = Stack {
            slope: 0.1,
            simplices,
            bent,
            ..Stack::new(3, cells)
        };
        count(agree(&stack, ["upper", "lower"], &spatial(0.3)));
    }
    for dim in [2, 3] {
        let stack = Stack {
            joined_from: 0.75,
            ..Stack::new(dim, [4, 4])
        };
        count(match dim {
            2 => agree(&stack, ["upper", "lower"], &planar(0.3)),
            _ => agree(&stack, ["upper", "lower"], &spatial(0.3)),
        });
    }
    assert!(met.iter().all(|n| *n > 0), "{met:?}");
}

/// Solids whose slave nodes slide freely: each system falls by 1e-8 within 20 iterations of multigrid, as the nodes of each body and the
/// slave nodes are gathered apart. With either distinction alone it takes 24 and more.
#[test]
fn few_iterations_solve_two_bodies() {
    let (system, rows, load) = pressed(&Stack::new(3, [10, 8]), ["lower", "upper"]);
    let body = reduced_body(&system, &rows, load).unwrap();
    assert!(body.is_supported());
    let mut problem = ReducedContact::new(body, spatial(0.0), ReducedOptions::default()).unwrap();
    assert!(problem.levels().len() > 1);
    let found = problem.solve(0.0, None).unwrap();
    assert_eq!(found.strategy, ContactStrategy::Newton);
    let exact: Vec<_> = found.iterations.iter().filter(|i| i.forcing <= 1e-3).collect();
    assert!(!exact.is_empty());
    for step in exact {
        let needed = step.krylov as f64 * 1e-8_f64.ln() / step.forcing.ln();
        assert!(needed <= 20.0, "{step:?}");
    }
}

/// Derivatives in loads and gaps, with their gradients, are those of the condensed form.
#[test]
fn derivatives_between_bodies_are_those_of_the_condensed_form() {
    let (system, rows, load) = pressed(&Stack::new(2, [5, 8]), ["lower", "upper"]);
    let (n, p) = (system.num_free(), rows.nodes.len());
    let body = || semismooth::contact_body(&system, &rows, load.clone()).unwrap();
    let condensed = CondensedContact::new(body(), planar(0.3)).unwrap();
    let x = condensed.solve(0.4, None).unwrap();
    let reduced = reduced_body(&system, &rows, load.clone()).unwrap();
    let options = ReducedOptions::default().with_tolerance(1e-13);
    let mut reduced = ReducedContact::new(reduced, planar(0.3), options).unwrap();
    let found = reduced.solve(0.4, None).unwrap();
    near(&x[..2 * p], &found.forces, 1e-10);
    let columns: Vec<(usize, usize, f64)> = (0..n).map(|k| (k, k % 3, 0.1 + (k % 7) as f64)).collect();
    let loads = Matrix::from_triplets(n, 3, &columns).unwrap();
    let parameters = condensed
        .parameters()
        .with_loads(&loads)
        .unwrap()
        .with_gaps(&Matrix::from_triplets(p, 3, &[(0, 0, 1.0), (p / 2, 1, 1.0), (p - 1, 2, 1.0)]).unwrap())
        .unwrap();
    let mut own = condensed.sensitivity(&x, &parameters).unwrap();
    let mut other = reduced
        .sensitivity(0.4, &found.displacements, &parameters)
        .unwrap();
    let m = own.num_parameters();
    let weights: Vec<f64> = (0..2 * p).map(|k| 1.0 + (k % 4) as f64).collect();
    let mut expected = vec![0.0; m];
    for (k, expected) in expected.iter_mut().enumerate() {
        let mut delta = vec![0.0; m];
        delta[k] = 1.0;
        let (exact, change) = (own.jvp(&delta).unwrap(), other.jvp(&delta).unwrap());
        near(&exact.forces, &change.forces, 1e-7);
        near(&exact.displacements, &change.displacements, 1e-7);
        *expected = (change.forces.iter().zip(&weights).map(|(a, b)| a * b)).sum();
        *expected += change.displacements.iter().sum::<f64>();
    }
    near(&expected, &other.vjp(&vec![1.0; n], &weights).unwrap(), 1e-8);
}

/// A solid large enough for the displacements alone that contact alone holds is condensed.
#[test]
fn bodies_that_contact_holds_are_condensed() {
    let mut mesh = Mesh::block([0.0; 3], [1.0; 3], [12, 12, 12]).unwrap();
    mesh.mark_boundary("corner", |f| {
        f.centre[2] < 0.01 && f.centre[0] < 0.1 && f.centre[1] < 0.1
    });
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .floating()
        .assemble()
        .unwrap();
    let ground = Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]);
    let rows = system.contact("corner", &ground).unwrap();
    let load = LoadPath::constant(vec![0.0; system.num_free()]);
    assert!(!reduced_body(&system, &rows, load.clone()).unwrap().is_supported());
    let problem = contact_problem(&system, &rows, load, spatial(0.3), ContactForm::Auto).unwrap();
    assert_eq!(problem.form(), ContactForm::Condensed);
}

/// On facets of second order neighbouring multipliers share nodes, and none has one for itself.
#[test]
fn facets_of_second_order_are_left_to_the_condensed_form() {
    let stack = Stack {
        order: Order::Second,
        ..Stack::new(2, [3, 4])
    };
    let (system, rows, load) = pressed(&stack, ["upper", "lower"]);
    assert!(!rows.has_own_nodes(&system));
    let refused = reduced_body(&system, &rows, load);
    assert!(matches!(refused, Err(ContactError::NotNodal { .. })));
}
