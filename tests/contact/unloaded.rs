//! Bodies without forces, up to rounding: all forms solve them, and judge them by the terms that cancel.

use std::ops::ControlFlow;

use semismooth::contact::{
    CondensedContact, ContactSolution, EvolutionOptions, FrictionCoefficient, Frictionless, FullContact,
    LoadPath, NodeLaw, OrthotropicCoulomb, PlanarCoulomb, ReducedBody, ReducedContact, ReducedOptions,
    evolve,
};
use semismooth::fem::{ElasticSystem, Elasticity, Foundation, Material, Mesh};

const YOUNG: f64 = 210.0;

/// A block held at its top, `lift` above the ground.
struct Block {
    system: ElasticSystem,
    dim: usize,
}

/// What a form found: displacements, and the solution at the nodes.
type Found = (Vec<f64>, ContactSolution);

impl Block {
    fn new(dim: usize, lift: f64) -> Self {
        let mesh = match dim {
            2 => Mesh::rectangle([0.0, lift], [2.0, 1.0 + lift], [6, 3]).unwrap(),
            _ => Mesh::block([0.0, 0.0, lift], [2.0, 1.0, 1.0 + lift], [4, 2, 2]).unwrap(),
        };
        let elastic = Elasticity::new(mesh, Material::isotropic(YOUNG, 0.3).unwrap()).fix("top");
        let system = elastic.discretize().unwrap();
        Self { system, dim }
    }

    fn unloaded(&self) -> Vec<f64> {
        vec![0.0; self.system.num_free()]
    }

    /// The solutions in full form, condensed, and in the displacements alone.
    fn solve<L: NodeLaw + Clone>(&self, load: &LoadPath, alpha: f64, law: &L, what: &str) -> [Found; 3] {
        let mut up = [0.0; 3];
        up[self.dim - 1] = 1.0;
        let rows = self
            .system
            .contact("bottom", &Foundation::plane([0.0; 3], up))
            .unwrap();
        let tangential = rows.tangential;
        let stiffness = self.system.nodal_stiffness().unwrap();
        let reduced = ReducedBody::new(stiffness, &rows.normal, &tangential, load.clone()).unwrap();
        let reduced = reduced.with_gap(rows.gap).unwrap();
        let body = reduced.to_contact_body().unwrap();

        let full = FullContact::new(body.clone(), law.clone()).unwrap();
        let x = full
            .solve(alpha, None)
            .unwrap_or_else(|e| panic!("{what}, full: {e}"));
        let first = (full.displacements(&x).unwrap(), full.solution(&x).unwrap());
        let condensed = CondensedContact::new(body, law.clone()).unwrap();
        let x = condensed
            .solve(alpha, None)
            .unwrap_or_else(|e| panic!("{what}, condensed: {e}"));
        let second = (
            condensed.displacements(&x).unwrap(),
            condensed.solution(&x).unwrap(),
        );
        let mut reduced = ReducedContact::new(reduced, law.clone(), ReducedOptions::default()).unwrap();
        let report = reduced.solve(alpha, None);
        let u = report
            .unwrap_or_else(|e| panic!("{what}, reduced: {e}"))
            .displacements;
        let solution = reduced.solution(alpha, &u).unwrap();
        [first, second, (u, solution)]
    }
}

/// Evaluates an expression with each of some laws of a dimension.
macro_rules! for_all_laws {
    ($dim:expr, $law:ident => $body:expr) => {
        let friction = |f| FrictionCoefficient::constant(f).unwrap();
        if $dim == 2 {
            for friction in [friction(0.5), friction(4.0)] {
                let $law = &PlanarCoulomb::new(friction);
                $body;
            }
            let $law = &Frictionless::plane();
            $body;
        } else {
            for [first, second] in [[0.5, 0.5], [2.0, 0.1]] {
                let $law = &OrthotropicCoulomb::new(friction(first), friction(second));
                $body;
            }
            let $law = &Frictionless::space();
            $body;
        }
    };
}

fn largest(v: impl IntoIterator<Item = f64>) -> f64 {
    v.into_iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Forces and displacements from the ground are below `force` and `length`, and the solution is judged to be one.
fn rests(found: &[Found; 3], force: f64, length: f64, what: &str) {
    for ((_, solution), form) in found.iter().zip(["full", "condensed", "reduced"]) {
        assert!(
            solution.residuals.largest() <= 1e-10,
            "{what}, {form}: {}",
            solution.residuals
        );
        let forces = solution
            .nodes
            .iter()
            .flat_map(|v| [v.pressure, v.traction[0], v.traction[1]]);
        let forces = largest(forces);
        assert!(forces <= force, "{what}, {form}: {forces:e}");
        let depth = largest(solution.nodes.iter().map(|v| v.penetration.max(0.0)));
        assert!(depth <= length, "{what}, {form}: {depth:e}");
    }
}

/// All nodes touch the ground, and none is said to stick or to slip.
fn touches_without_force(found: &[Found; 3], what: &str) {
    for ((_, solution), form) in found.iter().zip(["full", "condensed", "reduced"]) {
        let nodes = solution.nodes.len();
        let words = format!("{nodes} open ({nodes} touch without force), 0 stick, 0 slip;");
        assert!(
            solution.to_string().starts_with(&words),
            "{what}, {form}: {solution}"
        );
        assert_eq!((solution.touching, solution.open()), (nodes, nodes));
    }
}

/// The laws are cones: without a gap solutions under tiny loads are multiples of that under the load, as long as numbers have all digits.
#[test]
fn solutions_under_tiny_loads_are_multiples() {
    fn check<L: NodeLaw + Clone>(block: &Block, law: &L) {
        let push = block.system.traction("right", |_| [5.0, -3.0, -2.0]).unwrap();
        let load = LoadPath::affine(block.unloaded(), push);
        let whole = block.solve(&load, 1.0, law, "whole");
        let size = largest(whole[0].0.iter().copied());
        for part in [0.0, 1e-310, 1e-300, 1e-150, 1e-18, 1e-8] {
            let what = format!("in {} dimensions, {part:e} of the load", block.dim);
            let found = block.solve(&load, part, law, &what);
            rests(
                &found,
                10.0 * part,
                1e-12 * size * part + f64::MIN_POSITIVE,
                &what,
            );
            match part {
                0.0 => touches_without_force(&found, &what),
                _ => assert!(found.iter().all(|f| f.1.touching < f.1.nodes.len()), "{what}"),
            }
            // Below 1e-300 numbers lose digits.
            for ((u, _), (v, _)) in found.iter().zip(&whole).filter(|_| part > 1e-301) {
                let apart = largest(u.iter().zip(v).map(|(u, v)| u - part * v));
                assert!(apart <= 1e-9 * part * size, "{what}: {apart:e}");
            }
        }
    }
    for dim in [2, 3] {
        let block = Block::new(dim, 0.0);
        for_all_laws!(dim, law => check(&block, law));
    }
}

/// Two load cases cancel up to the last digit, and forces of 1e-17 on every component.
#[test]
fn a_body_whose_loads_cancel_rests() {
    for dim in [2, 3] {
        let block = Block::new(dim, 0.0);
        let push = block.system.traction("right", |_| [5.0, -3.0, -2.0]).unwrap();
        let opposite: Vec<f64> = push.iter().map(|v| -0.3 * v).collect();
        let cancelling = LoadPath::affine(opposite, push);
        let noise = (0..block.system.num_free()).map(|i| 1e-17 * ((i * i) as f64).sin());
        let noise = LoadPath::constant(noise.collect::<Vec<_>>());
        for_all_laws!(dim, law => {
            let what = format!("loads that cancel in {dim} dimensions");
            // 0.1 + 0.2 exceeds 0.3 by the last digit.
            let found = block.solve(&cancelling, 0.1 + 0.2, law, &what);
            rests(&found, 1e-15, 1e-15 / YOUNG, &what);
            touches_without_force(&found, &what);
            let what = format!("noise in {dim} dimensions");
            rests(&block.solve(&noise, 0.0, law, &what), 1e-15, 1e-15 / YOUNG, &what);
        });
    }
}

/// A body moves with its supports, down to the ground that it just touches, and along: forces are the rounding of stiffness times these
/// displacements.
#[test]
fn a_body_moved_with_its_supports_rests() {
    for dim in [2, 3] {
        for lift in [0.1, 0.3, 1e-3, 0.0] {
            let block = Block::new(dim, lift);
            for along in [0.0, 0.7, 1e3, -1e-3] {
                let [down, side] = [(dim - 1, -lift), (0, along)]
                    .map(|(component, v)| block.system.motion("top", component, |_| v).unwrap());
                let load = LoadPath::affine(block.unloaded(), down.plus(side).unwrap());
                // Rounding, times the condition of the stiffness matrix.
                let moved = lift + f64::abs(along);
                let (force, length) = (1e-12 * YOUNG * moved, 1e-12 * moved);
                for_all_laws!(dim, law => {
                    let what = format!("moved by {lift} and {along} in {dim} dimensions");
                    let found = block.solve(&load, 1.0, law, &what);
                    rests(&found, force, length, &what);
                    touches_without_force(&found, &what);
                });
            }
        }
    }
}

/// Its supports move a solid that rests on the ground without load to and fro: at each turn all nodes are at the tip of the cone of friction,
/// up to rounding, and a search for all the ways on would be one through 3¹⁵ selections.
#[test]
fn an_unloaded_solid_is_moved_to_and_fro() {
    let block = Block::new(3, 0.0);
    let motion = block.system.motion("top", 0, |_| 0.05).unwrap();
    let rows = block
        .system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 0.0, 1.0]))
        .unwrap();
    let tangential = rows.tangential;
    let load = LoadPath::affine(block.unloaded(), motion);
    let stiffness = block.system.nodal_stiffness().unwrap();
    let body = ReducedBody::new(stiffness, &rows.normal, &tangential, load).unwrap();
    let law = OrthotropicCoulomb::isotropic(FrictionCoefficient::constant(0.4).unwrap());
    let mut problem = CondensedContact::new(body.to_contact_body().unwrap(), law).unwrap();
    let start = problem.solve(0.0, None).unwrap();
    let levels = [0.5, 1.0, 0.5, 0.0, -0.5, 0.0];
    let options = EvolutionOptions::default();
    let steps = evolve(&mut problem, &start, &levels, &options, |_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(steps.len(), levels.len());
    for step in steps {
        let what = format!("level {}", step.level);
        let nodes = step.solution.nodes.iter();
        let forces = largest(nodes.flat_map(|v| [v.pressure, v.traction[0], v.traction[1]]));
        assert!(forces <= 1e-12 * YOUNG * 0.05, "{what}: {forces:e}");
        assert!(
            step.solution.residuals.largest() <= 1e-10,
            "{what}: {}",
            step.solution.residuals
        );
        // The whole body moves with its supports.
        let p = step.displacements.len() / 3;
        let along = &step.displacements[p..2 * p];
        assert!(
            along.iter().all(|u| (u - 0.05 * step.level).abs() <= 1e-13),
            "{what}"
        );
    }
}
