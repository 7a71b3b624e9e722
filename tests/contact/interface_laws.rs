//! Limits of shear, cohesion, layers that yield, glue: one node in closed form, lists of all solutions, the contract of maps.

use std::ops::ControlFlow;

use semismooth::contact::{
    Bonded, Cohesive, CondensedContact, ContactBody, ContactError, ContactState, EvolutionOptions,
    FixedPointOptions, FrictionCoefficient, FullContact, LimitedShear, LoadPath, NodeLaw, OrthotropicCoulomb,
    PlanarCoulomb, ReducedContact, ReducedOptions, Worn, evolve, fixed_point,
};
use semismooth::continuation::{Branch, Continuation, ContinuationOptions, Direction};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
use semismooth::piecewise::check::{CheckOptions, check};
use semismooth::sparse::Matrix;

fn coulomb(f: f64) -> PlanarCoulomb {
    PlanarCoulomb::new(FrictionCoefficient::constant(f).unwrap())
}

/// One node of stiffness 2 normally and 4 tangentially under f₀ + α f₁ (normal, tangential).
fn node(f0: [f64; 2], f1: [f64; 2]) -> ContactBody {
    let a = Matrix::from_rows(&[[2.0, 0.0], [0.0, 4.0]]).unwrap();
    let [normal, tangential] = [[1.0, 0.0], [0.0, 1.0]].map(|row| Matrix::from_rows(&[row]).unwrap());
    let load = LoadPath::affine(f0.to_vec(), f1.to_vec());
    ContactBody::new(a, normal, vec![tangential], load).unwrap()
}

/// Displacements, forces and state of that node at α; proven to be the only solution where the law states its coefficients.
fn only_solution<L: NodeLaw + Clone + Sync>(
    body: ContactBody,
    law: &L,
    alpha: f64,
    proven: bool,
) -> ([f64; 4], ContactState) {
    let problem = CondensedContact::new(body, law.clone()).unwrap();
    let x = problem.solve(alpha, None).unwrap();
    let u = problem.displacements(&x).unwrap();
    let solution = problem.solution(&x).unwrap();
    let e = solution.energy;
    assert!(e.imbalance().abs() < 1e-13, "{e:?}");
    let set = all_solutions(&problem, alpha, &EnumerationOptions::default()).unwrap();
    assert_eq!(set.solutions.len(), 1);
    assert!((set.solutions[0].x[0] - x[0]).abs() < 1e-12 && (set.solutions[0].x[1] - x[1]).abs() < 1e-12);
    assert_eq!(set.completeness.is_complete(), proven);
    ([u[0], u[1], x[0], x[1]], solution.states[0])
}

fn close(found: [f64; 4], exact: [f64; 4]) {
    assert!(
        found.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-12),
        "{found:?} {exact:?}"
    );
}

/// Pressed by α and pulled by 1.2 α with F = 0.5, T = 0.8: it slips at the bound F α up to α = T / F, then at the limit T.
#[test]
fn shear_has_a_limit() {
    let law = LimitedShear::new(1, vec![0.5], vec![0.8]).unwrap();
    let body = node([0.0; 2], [1.0, 1.2]);
    for (alpha, bound) in [(1.0, 0.5), (2.0, 0.8), (-1.0, 0.0)] {
        let (found, state) = only_solution(body.clone(), &law, alpha, false);
        let exact = match alpha < 0.0 {
            true => [0.5 * alpha, 0.3 * alpha, 0.0, 0.0],
            false => [0.0, (1.2 * alpha - bound) / 4.0, alpha, bound],
        };
        close(found, exact);
        assert_eq!(
            state,
            if alpha < 0.0 {
                ContactState::Open
            } else {
                ContactState::SlipPlus
            }
        );
    }
    let (found, _) = only_solution(node([3.0, -2.0], [0.0; 2]), &law, 0.0, false);
    close(found, [0.0, -1.2 / 4.0, 3.0, -0.8]);
    let problem = CondensedContact::new(body, law).unwrap();
    let start = problem.solve(0.5, None).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.5, 3.0));
    let curve = Continuation::new(&problem, &start, Direction::Increasing, options).unwrap();
    let branch = Branch::collect(curve, |_| ControlFlow::Continue(())).unwrap();
    let changes: Vec<f64> = branch.transitions.iter().map(|t| t.parameter()).collect();
    assert!(
        changes.len() == 1 && (changes[0] - 1.6).abs() < 1e-12,
        "{changes:?}"
    );
    // With F = min(F, T / λν) the fixed-point iteration finds the same.
    let found = fixed_point(
        &problem,
        &problem.solve(0.5, None).unwrap(),
        &FixedPointOptions::default(),
    )
    .unwrap();
    assert!(found.converged && (found.x[1] - 0.25).abs() < 1e-9);
    let end = problem.solve(3.0, None).unwrap();
    let found = fixed_point(&problem, &end, &FixedPointOptions::default()).unwrap();
    assert!(
        found.converged && (found.x[1] - 0.8).abs() < 1e-9,
        "{:?}",
        found.x
    );
    // In space the limit is a circle: pulled along (3, 4) / 5.
    let unit = |d: usize| {
        let mut row = [0.0; 3];
        row[d] = 1.0;
        Matrix::from_rows(&[row]).unwrap()
    };
    let load = LoadPath::constant(vec![3.0, 1.2, 1.6]);
    let body = ContactBody::new(Matrix::identity(3), unit(0), vec![unit(1), unit(2)], load).unwrap();
    for (limit, force) in [(0.8, 0.8), (5.0, 1.5)] {
        let law = LimitedShear::new(2, vec![0.5], vec![limit]).unwrap();
        let problem = CondensedContact::new(body.clone(), law).unwrap();
        let x = problem.solve(0.0, None).unwrap();
        let exact = [3.0, 0.6 * force, 0.8 * force];
        assert!((0..3).all(|k| (x[k] - exact[k]).abs() < 1e-12), "{x:?}");
    }
}

/// F = 0.5 with the tension T = 0.4: the cohesion is 0.2. In tension it sticks or slips at F (λν + T); at the apex it opens and bears T.
#[test]
fn cohesion_reaches_to_the_apex() {
    let law = Cohesive::new(coulomb(0.5), vec![0.4]).unwrap();
    let at = |normal: f64, shear: f64| only_solution(node([normal, shear], [0.0; 2]), &law, 0.0, true);
    let (found, state) = at(0.0, 0.15);
    close(found, [0.0, 0.0, 0.0, 0.15]);
    assert_eq!(state, ContactState::Stick);
    let (found, state) = at(-0.2, 0.3);
    close(found, [0.0, 0.2 / 4.0, -0.2, 0.1]);
    assert_eq!(state, ContactState::SlipPlus);
    let (found, state) = at(-0.6, 0.3);
    close(found, [-0.2 / 2.0, 0.3 / 4.0, -0.4, 0.0]);
    assert_eq!(state, ContactState::Open);
    let (found, _) = at(1.0, -2.0);
    close(found, [0.0, -(2.0 - 0.7) / 4.0, 1.0, -0.7]);
    // No tension: Coulomb's law.
    let none = Cohesive::new(coulomb(0.5), vec![0.0]).unwrap();
    let (found, _) = only_solution(node([1.0, 2.0], [0.0; 2]), &none, 0.0, true);
    close(
        found,
        only_solution(node([1.0, 2.0], [0.0; 2]), &coulomb(0.5), 0.0, true).0,
    );
}

/// Wear with k = 0.1 of a node that the force 6 presses, pushed to and fro by 8 without friction, so that it slips by 2 each time. Under a
/// dead load, w = k p s; on a spring of stiffness 2, p = 6 − 2 w: the explicit rule is w' = w + k (6 − 2 w) s, whose limit is
/// w = 3 (1 − exp(−0.2 s)), approached in first order.
#[test]
fn wear_is_k_p_s() {
    let law = Worn::new(coulomb(0.0), vec![0.1]).unwrap();
    let depths = |stiffness: f64, parts: usize| {
        let a = Matrix::from_rows(&[[stiffness, 0.0], [0.0, 4.0]]).unwrap();
        let [normal, tangential] = [[1.0, 0.0], [0.0, 1.0]].map(|row| Matrix::from_rows(&[row]).unwrap());
        let load = LoadPath::affine(vec![6.0, 0.0], vec![0.0, 1.0]);
        let body = ContactBody::new(a, normal, vec![tangential], load).unwrap();
        let mut problem = FullContact::new(body, law.clone()).unwrap();
        let start = problem.solve(0.0, None).unwrap();
        let levels: Vec<f64> = (1..=2 * parts)
            .map(|k| 8.0 * (1.0 - (k as f64 / parts as f64 - 1.0).abs()))
            .collect();
        let options = EvolutionOptions::default();
        let steps = evolve(&mut problem, &start, &levels, &options, |_| {
            ControlFlow::Continue(())
        })
        .unwrap();
        for pair in steps.windows(2) {
            // A node in contact has sunk to the depth at the end of the level before.
            assert!((pair[1].displacements[0] - pair[0].history[0]).abs() < 1e-12);
        }
        steps.iter().map(|s| s.history[0]).collect::<Vec<_>>()
    };
    for (k, depth) in depths(0.0, 4).iter().enumerate() {
        assert!(
            (depth - 0.1 * 6.0 * 0.5 * (k + 1) as f64).abs() < 1e-12,
            "{k} {depth}"
        );
    }
    let error = |parts: usize| {
        let found = depths(2.0, parts);
        for (k, depth) in found.iter().enumerate() {
            let left = (1.0 - 0.2 * 2.0 / parts as f64).powi(1 + k as i32);
            assert!((depth - 3.0 * (1.0 - left)).abs() < 1e-12, "{parts} {k} {depth}");
        }
        (found.last().unwrap() - 3.0 * (1.0 - (-0.8f64).exp())).abs()
    };
    let ratio = error(16) / error(32);
    assert!((ratio - 2.0).abs() < 0.1, "{ratio}");
}

/// A block pushed to and fro wears off alike in all forms, and its solutions at the end are proven with the gap that it has then.
#[test]
fn worn_surfaces_are_those_of_every_form() {
    let mesh = Mesh::rectangle([0.0; 2], [2.0, 1.0], [6, 3]).unwrap();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| -0.05)
        .assemble()
        .unwrap();
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let load = || {
        let motion = system.motion("top", 0, |_| 0.1).unwrap();
        LoadPath::affine(system.supports().clone(), motion)
    };
    let rates = rows.areas.iter().map(|a| 2.0 / a).collect();
    let law = Worn::new(coulomb(0.3), rates).unwrap();
    let levels = [0.5, 1.0, 0.0, -1.0];
    let go = |_: &_| ControlFlow::Continue(());
    let body = || semismooth::contact_body(&system, &rows, load()).unwrap();
    let options = EvolutionOptions::default();
    let mut condensed = CondensedContact::new(body(), law.clone()).unwrap();
    let start = condensed.solve(0.0, None).unwrap();
    let steps = evolve(&mut condensed, &start, &levels, &options, go).unwrap();
    let mut full = FullContact::new(body(), law.clone()).unwrap();
    let start = full.solve(0.0, None).unwrap();
    let in_full = evolve(&mut full, &start, &levels, &options, go).unwrap();
    let reduced = semismooth::reduced_body(&system, &rows, load()).unwrap();
    let mut reduced = ReducedContact::new(reduced, law, ReducedOptions::default()).unwrap();
    let all = [0.0, 0.5, 1.0, 0.0, -1.0];
    let in_displacements = reduced.evolve(None, &all, |_| ControlFlow::Continue(())).unwrap();
    for (k, step) in steps.iter().enumerate() {
        let others = [&in_full[k].history, &in_displacements[k + 1].history];
        for (i, depth) in step.history.iter().enumerate() {
            for other in others {
                assert!((depth - other[i]).abs() < 1e-9, "{k} {i} {depth} {}", other[i]);
            }
            assert!(k == 0 || *depth >= steps[k - 1].history[i]);
        }
    }
    let deepest = steps[3].history.iter().fold(0.0_f64, |m, w| m.max(*w));
    assert!(deepest > 0.01 && deepest < 0.05, "{deepest}");
    let x = condensed.solve(-0.5, None).unwrap();
    let set = all_solutions(&condensed, -0.5, &EnumerationOptions::default()).unwrap();
    assert!(set.completeness.is_complete());
    assert!(
        set.solutions
            .iter()
            .any(|s| s.x.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-10))
    );
    // What a worn surface has no theory for is refused.
    let error = fixed_point(&condensed, &x, &FixedPointOptions::default()).unwrap_err();
    assert!(error.to_string().contains("worn"), "{error}");
    let parameters = [condensed.parameters()];
    let error = condensed.history_sensitivity(&[x], &parameters).err().unwrap();
    assert!(error.to_string().contains("history variables"), "{error}");
}

/// A layer of normal compliance 0.25 and tangential compliance 0.5: it is pressed in by λν / 4, and slips elastically by λt / 2 before it
/// slips at the bound; what it slipped stays where the force is taken back.
#[test]
fn layers_yield_before_they_slip() {
    let soft = |body: ContactBody| body.with_compliance(&[0.25], &[0.5]).unwrap();
    let law = coulomb(0.5);
    let (found, state) = only_solution(soft(node([3.0, 1.2], [0.0; 2])), &law, 0.0, true);
    // 2 u + λ = 3 with u = λ / 4, and 4 u + λ = 1.2 with u = λ / 2.
    close(found, [0.5, 0.2, 2.0, 0.4]);
    assert_eq!(state, ContactState::Stick);
    let (found, state) = only_solution(soft(node([3.0, 5.0], [0.0; 2])), &law, 0.0, true);
    close(found, [0.5, 1.0, 2.0, 1.0]);
    assert_eq!(state, ContactState::SlipPlus);
    // Pulled by 5 it slips by 1 − ½; let go to 1: 4 (½ + λ / 2) + λ = 1, in the other direction.
    let mut problem = CondensedContact::new(soft(node([3.0, 0.0], [0.0, 1.0])), law).unwrap();
    let start = problem.solve(0.0, None).unwrap();
    let steps = evolve(
        &mut problem,
        &start,
        &[5.0, 1.0],
        &EvolutionOptions::default(),
        |_| ControlFlow::Continue(()),
    )
    .unwrap();
    for (step, force) in steps.iter().zip([1.0, -1.0 / 3.0]) {
        assert!((step.x[1] - force).abs() < 1e-12, "{:?}", step.x);
        assert!(
            (step.work - step.stored - step.dissipated).abs() < 1e-12,
            "{step:?}"
        );
    }
    // The slip of ½ under the force 1.
    assert!((steps[0].dissipated - 0.5).abs() < 1e-12 && steps[1].dissipated.abs() < 1e-12);
}

#[test]
fn glue_holds_in_all_directions() {
    for f in [[3.0, 1.0], [-2.0, 0.5]] {
        let (found, state) = only_solution(node(f, [0.0; 2]), &Bonded::plane(), 0.0, false);
        close(found, [0.0, 0.0, f[0], f[1]]);
        assert_eq!(state, ContactState::Stick);
        // With springs, an elastic bond in both directions.
        let soft = node(f, [0.0; 2]).with_compliance(&[0.25], &[0.5]).unwrap();
        let (found, _) = only_solution(soft, &Bonded::plane(), 0.0, false);
        close(found, [f[0] / 6.0, f[1] / 6.0, f[0] / 1.5, f[1] / 3.0]);
    }
}

fn two_nodes(dim: usize) -> ContactBody {
    let n = 2 * dim;
    let stiff = |i: usize, j: usize| {
        if i == j {
            3.0
        } else {
            1.0 / (2.0 + i as f64 + j as f64)
        }
    };
    let entries: Vec<_> = (0..n * n).map(|k| (k / n, k % n, stiff(k / n, k % n))).collect();
    let trace = |d: usize| {
        let entries = [(0, d, 1.0), (1, dim + d, 1.0)];
        Matrix::from_triplets(2, n, &entries).unwrap()
    };
    let load = LoadPath::affine(vec![1.0; n], (0..n).map(|i| i as f64 - 1.0).collect::<Vec<_>>());
    let a = Matrix::from_triplets(n, n, &entries).unwrap();
    ContactBody::new(a, trace(0), (1..dim).map(trace).collect(), load).unwrap()
}

fn is_piecewise_smooth<L: NodeLaw>(body: ContactBody, law: L) {
    let map = FullContact::new(body, law).unwrap();
    let sample = |k: usize| {
        let entry = |i: usize| ((0.7 + 0.3 * k as f64) * (i + 1) as f64).cos();
        (0..semismooth::piecewise::PiecewiseSmooth::num_vars(&map))
            .map(entry)
            .collect()
    };
    let samples: Vec<Vec<f64>> = (0..6).map(sample).collect();
    let report = check(&map, &samples, &CheckOptions::default()).unwrap();
    assert_eq!(report.points, 6);
}

/// Derivatives, cells and continuity, as the checker of maps sees them.
#[test]
fn laws_obey_the_contract() {
    let soft = |dim: usize| two_nodes(dim).with_compliance(&[0.2, 0.3], &[0.4, 0.1]).unwrap();
    let space = || OrthotropicCoulomb::isotropic(FrictionCoefficient::constant(0.4).unwrap());
    for body in [two_nodes(2), soft(2)] {
        is_piecewise_smooth(
            body.clone(),
            LimitedShear::new(1, vec![0.5; 2], vec![0.3, 0.6]).unwrap(),
        );
        is_piecewise_smooth(body.clone(), Cohesive::new(coulomb(0.5), vec![0.2, 0.0]).unwrap());
        is_piecewise_smooth(body, Bonded::plane());
    }
    for body in [two_nodes(3), soft(3)] {
        is_piecewise_smooth(
            body.clone(),
            LimitedShear::new(2, vec![0.5; 2], vec![0.3, 0.6]).unwrap(),
        );
        is_piecewise_smooth(body.clone(), Cohesive::new(space(), vec![0.2, 0.1]).unwrap());
        is_piecewise_smooth(body, Bonded::space());
    }
}

#[test]
fn wrong_data_are_named() {
    let invalid = |e: ContactError, word: &str| assert!(e.to_string().contains(word), "{e}");
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        invalid(LimitedShear::new(1, vec![0.3], vec![bad]).unwrap_err(), "limit");
        invalid(
            LimitedShear::new(1, vec![bad], vec![0.3]).unwrap_err(),
            "friction",
        );
        invalid(
            Cohesive::new(coulomb(0.3), vec![0.0, bad]).unwrap_err(),
            "tension at contact node 1",
        );
        invalid(
            Worn::new(coulomb(0.3), vec![0.0, bad]).unwrap_err(),
            "rate of wear at contact node 1",
        );
        invalid(
            node([0.0; 2], [0.0; 2])
                .with_compliance(&[bad], &[0.0])
                .unwrap_err(),
            "normal compliance",
        );
        invalid(
            node([0.0; 2], [0.0; 2])
                .with_compliance(&[0.0], &[bad])
                .unwrap_err(),
            "tangential compliance",
        );
    }
    assert!(LimitedShear::new(3, vec![0.3], vec![0.3]).is_err());
    assert!(LimitedShear::new(1, vec![0.3; 2], vec![0.3]).is_err());
    assert!(
        node([0.0; 2], [0.0; 2])
            .with_compliance(&[0.0; 2], &[0.0])
            .is_err()
    );
    let tense = Cohesive::new(coulomb(0.3), vec![0.1]).unwrap();
    let problem = CondensedContact::new(node([1.0; 2], [0.0; 2]), tense).unwrap();
    let start = problem.solve(0.0, None).unwrap();
    invalid(
        fixed_point(&problem, &start, &FixedPointOptions::default()).unwrap_err(),
        "tension",
    );
    let two = Cohesive::new(coulomb(0.3), vec![0.1; 2]).unwrap();
    invalid(
        CondensedContact::new(node([0.0; 2], [0.0; 2]), two).unwrap_err(),
        "length",
    );
}
