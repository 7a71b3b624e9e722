//! The doors from a mesh: the same solution in all forms, and the form that suits a body.

use semismooth::InputError;
use semismooth::contact::{
    ContactError, ContactForm, ContactProblem, ContactState, FrictionCoefficient, LoadPath, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb,
};
use semismooth::fem::{
    ContactRows, Degree, ElasticSystem, Elasticity, Foundation, Material, Mesh, MultiplierSpace, Partition,
};
use semismooth::{contact_problem, reduced_body};

/// A clamped block beside the ground, pressed and pulled, with gaps that open and close.
fn block(dim: usize) -> (ElasticSystem, Foundation, LoadPath) {
    let mesh = match dim {
        2 => Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [6, 3]).unwrap(),
        _ => Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [4, 2, 2]).unwrap(),
    };
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.277).unwrap())
        .fix("left")
        .assemble()
        .unwrap();
    let along = |own: f64, up: f64| {
        let mut t = [own, 0.1 * own, 0.0];
        t[dim - 1] = up;
        t
    };
    let press = system.traction("top", |x| along(0.0, -0.02 * x[0])).unwrap();
    let pull = system.traction("right", |_| along(0.02, 0.0)).unwrap();
    let ground = Foundation::gap(|x| 0.05 * (1.5 - x[0]) * (1.5 - x[0]));
    (system, ground, LoadPath::affine(press, pull))
}

/// Nodes without friction among others, in plane and space: the forms agree, such nodes carry no traction, and are in the limit of small
/// coefficients.
#[test]
fn single_nodes_may_be_without_friction() {
    for dim in [2, 3] {
        let (system, ground, load) = block(dim);
        let rows = system.contact("bottom", &ground).unwrap();
        let p = rows.nodes.len();
        let smooth = |i: usize| i.is_multiple_of(3);
        let coefficient = |least: f64| {
            let values = (0..p).map(|i| if smooth(i) { least } else { 0.4 }).collect();
            FrictionCoefficient::nodal(values).unwrap()
        };
        let solve = |least: f64| {
            let (form, load) = (ContactForm::Condensed, load.clone());
            let found = match dim {
                2 => contact_problem(&system, &rows, load, PlanarCoulomb::new(coefficient(least)), form)
                    .unwrap()
                    .solve(0.6, None),
                _ => {
                    let law = OrthotropicCoulomb::isotropic(coefficient(least));
                    contact_problem(&system, &rows, load, law, form)
                        .unwrap()
                        .solve(0.6, None)
                }
            };
            found.unwrap()
        };
        let (none, little) = (solve(0.0), solve(1e-7));
        let mut pressed = 0;
        for i in (0..p).filter(|&i| smooth(i)) {
            assert!((1..dim).all(|d| none.forces[d * p + i] == 0.0));
            pressed += usize::from(none.forces[i] > 0.0);
            assert!(none.solution.states[i] != ContactState::Stick);
        }
        assert!(pressed > 0);
        for (a, b) in none.displacements.iter().zip(&little.displacements) {
            assert!((a - b).abs() < 1e-8);
        }
        match dim {
            2 => agree(2, PlanarCoulomb::new(coefficient(0.0))),
            _ => agree(3, OrthotropicCoulomb::isotropic(coefficient(0.0))),
        }
    }
}

fn agree<L: NodeLaw + Clone + Sync>(dim: usize, law: L) {
    let (system, ground, load) = block(dim);
    let rows = system.contact("bottom", &ground).unwrap();
    let forms = [
        ContactForm::Condensed,
        ContactForm::Full,
        ContactForm::Displacements,
    ];
    let mut problems =
        forms.map(|form| contact_problem(&system, &rows, load.clone(), law.clone(), form).unwrap());
    let mut starts = [None, None, None];
    for alpha in [0.0, 0.6, 1.2] {
        let found: Vec<_> = problems
            .iter_mut()
            .zip(&starts)
            .map(|(problem, start)| problem.solve(alpha, start.as_ref()).unwrap())
            .collect();
        let size = |v: &[f64]| v.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let near = |a: &[f64], b: &[f64]| {
            assert_eq!(a.len(), b.len());
            let far = a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
            // Krylov iterations end at residuals of 1e-10.
            assert!(far <= 1e-8 * size(a), "{far:e}");
        };
        for (other, form) in found.iter().zip(forms) {
            assert_eq!(
                (other.parameter, other.displacements.len()),
                (alpha, system.num_free())
            );
            near(&found[0].displacements, &other.displacements);
            near(&found[0].forces, &other.forces);
            assert_eq!(found[0].solution.states, other.solution.states, "{form:?}");
        }
        let states = &found[0].solution;
        assert!(states.open() > 0 && states.open() < rows.nodes.len(), "{states}");
        starts = found
            .into_iter()
            .map(Some)
            .collect::<Vec<_>>()
            .try_into()
            .unwrap();
    }
    for (problem, form) in problems.iter().zip(forms) {
        assert_eq!(problem.form(), form);
        // Displacements alone are no piecewise-smooth map of this crate.
        assert_eq!(problem.map().is_some(), form != ContactForm::Displacements);
    }
    let start = starts[0].take().map(|mut start| {
        start.forces.pop();
        start
    });
    assert!(matches!(
        problems[0].solve(0.0, start.as_ref()),
        Err(ContactError::Input(InputError::Length { .. }))
    ));
}

#[test]
fn all_forms_have_one_solution() {
    let friction = || FrictionCoefficient::constant(0.3).unwrap();
    agree(2, PlanarCoulomb::new(friction()));
    agree(3, OrthotropicCoulomb::isotropic(friction()));
}

fn auto(system: &ElasticSystem, rows: &ContactRows) -> ContactForm {
    ContactForm::Auto.suited(system.mesh().dim(), 10_000_000, rows.is_nodal(system))
}

/// However large the body is: forces on patches are none of single nodes, and are condensed.
#[test]
fn large_bodies_are_solved_in_their_displacements_where_contact_is_nodal() {
    let (system, ground, load) = block(3);
    let rows = system.contact("bottom", &ground).unwrap();
    assert_eq!(auto(&system, &rows), ContactForm::Displacements);
    let merged = MultiplierSpace::Piecewise {
        partition: Partition::Merged(2),
        degree: Degree::Constant,
    };
    let patches = system.contact_with("bottom", &ground, merged).unwrap();
    assert_eq!(auto(&system, &patches), ContactForm::Condensed);
    let refused = reduced_body(&system, &patches, load.clone());
    assert!(matches!(refused, Err(ContactError::NotNodal { .. })));
    // A solid of this size is small.
    let law = OrthotropicCoulomb::isotropic(FrictionCoefficient::constant(0.3).unwrap());
    let problem = contact_problem(&system, &rows, load, law, ContactForm::Auto).unwrap();
    assert!(matches!(problem, ContactProblem::Condensed(_)));
}
