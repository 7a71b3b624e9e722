//! Histories of loading: derivatives of the last state in data of all levels.

use std::ops::ControlFlow;

use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, ContactParameters, EvolutionOptions, FrictionCoefficient,
    FrictionCurve, FullContact, HistorySensitivity, LoadPath, PlanarCoulomb, evolve,
};
use semismooth::fem::{Dilatation, PlaneModel};
use semismooth::interface::View;
use semismooth::sensitivity::SensitivityError;
use semismooth::sparse::Matrix;

use super::dot;
use super::parameters::{Data, Law, close, directions};
use super::random::Random;

/// Levels after the first, by what is added to α.
const LEVELS: [f64; 3] = [0.6, -0.9, 0.4];

/// (λ, α) of all states, and the last (u, λ).
fn states(data: &Data, near: Option<&[f64]>) -> (Vec<Vec<f64>>, Vec<f64>) {
    let mut problem = data.condensed();
    let mut states = vec![problem.solve(data.alpha, near).unwrap()];
    let levels = LEVELS.map(|l| data.alpha + l);
    let options = EvolutionOptions::default();
    let steps = evolve(&mut problem, &states[0], &levels, &options, |_| {
        ControlFlow::Continue(())
    })
    .unwrap();
    states.extend(steps.into_iter().map(|step| step.x));
    let mut last = problem.expand(&states[LEVELS.len()]).unwrap();
    last.truncate(last.len() - 1);
    (states, last)
}

fn checked<V: View>(data: &Data, history: &HistorySensitivity<V, Law>, firsts: &[usize]) {
    let (states, last) = states(data, None);
    assert_eq!(history.differentiable().unwrap(), Some(true));
    let random = &mut Random::new(2);
    let step = 5e-5;
    for (kind, delta) in directions(firsts, random).iter().enumerate() {
        let at = |s: f64| self::states(&data.changed(delta, s * step), Some(&states[0])).1;
        let (a, b, c, d) = (at(-2.0), at(-1.0), at(1.0), at(2.0));
        let differences: Vec<f64> = (0..last.len())
            .map(|i| (8.0 * (c[i] - b[i]) - (d[i] - a[i])) / (12.0 * step))
            .collect();
        let change = history.jvp(delta).unwrap().pop().unwrap();
        let n = change.displacements.len();
        let rate = [change.displacements, change.forces].concat();
        close(&rate, &differences, 1e-7, &format!("parameters {kind}"));
        let w = random.vector(rate.len(), 1.0);
        let adjoint = dot(&history.vjp(&w[..n], &w[n..]).unwrap(), delta);
        let size: f64 = rate.iter().zip(&w).map(|(a, b)| (a * b).abs()).sum();
        let forward = dot(&rate, &w);
        assert!(
            (forward - adjoint).abs() <= 1e-11 * size,
            "{kind}: {forward} {adjoint}"
        );
    }
}

/// A body pushed, pulled back and pushed again: both forms have the derivatives of differences in all data, and exact adjoints.
#[test]
fn derivatives_go_through_all_levels() {
    for data in [
        Data::plane(PlaneModel::Strain, Dilatation::Pointwise, false),
        Data::space([3, 2, 2], true),
    ] {
        let data = data.mixed();
        let (states, _) = states(&data, None);
        let problem = data.condensed();
        let fulls: Vec<Vec<f64>> = states.iter().map(|x| problem.expand(x).unwrap()).collect();
        let mut firsts = Vec::new();
        let parameters: Vec<ContactParameters> = fulls
            .iter()
            .map(|y| {
                let (made, own) = data.parameters(problem.parameters(), y);
                firsts = own;
                made
            })
            .collect();
        let history = problem.history_sensitivity(&states, &parameters).unwrap();
        checked(&data, &history, &firsts);
        let full = FullContact::new(data.body(), data.law(false)).unwrap();
        let history = full.history_sensitivity(&fulls, &parameters).unwrap();
        checked(&data, &history, &firsts);
    }
}

fn one_node(friction: FrictionCoefficient) -> CondensedContact<PlanarCoulomb> {
    let [normal, tangential] = [[1.0, 0.0], [0.0, 1.0]].map(|row| Matrix::from_rows(&[row]).unwrap());
    let load = LoadPath::affine(vec![1.0, 0.0], vec![0.0, 1.0]);
    let body = ContactBody::new(Matrix::identity(2), normal, vec![tangential], load).unwrap();
    CondensedContact::new(body, PlanarCoulomb::new(friction)).unwrap()
}

/// One node of stiffness 1, pressed by 1 and pushed by α: the loads of each level have effects of their own. Under F = 1/4 it slips to
/// 2 − 1/4 at α = 2, and then it sticks at α = 9/4 − 1/2, the limit of sticking.
#[test]
fn levels_have_parameters_of_their_own_and_kinks_have_sides() {
    let problem = one_node(FrictionCoefficient::constant(0.25).unwrap());
    // A load along t at the level alone; two levels, two parameters.
    let at = |level: usize| {
        let loads = Matrix::from_triplets(2, 3, &[(1, level, 1.0)]).unwrap();
        problem.parameters().with_loads(&loads).unwrap()
    };
    let parameters: Vec<_> = (0..3).map(at).collect();
    // λt = α − u: 0; slips to 7/4 with λt = 1/4; sticks with λt = 0.
    let firm = [vec![1.0, 0.0, 0.0], vec![1.0, 0.25, 2.0], vec![1.0, 0.0, 1.75]];
    let history = problem.history_sensitivity(&firm, &parameters).unwrap();
    assert_eq!(history.differentiable().unwrap(), Some(true));
    let gradient = history.vjp(&[0.0, 1.0], &[0.0, 0.0]).unwrap();
    close(&gradient, &[0.0, 1.0, 0.0], 1e-12, "the position");
    let gradient = history.vjp(&[0.0, 0.0], &[0.0, 1.0]).unwrap();
    close(&gradient, &[0.0, -1.0, 1.0], 1e-12, "friction");
    // At the limit of sticking backwards: it follows a pull, and withstands a push.
    let limit = [vec![1.0, 0.0, 0.0], vec![1.0, 0.25, 2.0], vec![1.0, -0.25, 1.5]];
    let history = problem.history_sensitivity(&limit, &parameters).unwrap();
    assert_eq!(history.differentiable().unwrap(), None);
    let rate = |delta: [f64; 3]| history.jvp(&delta).unwrap()[2].displacements[1];
    assert!((rate([0.0, 0.0, -1.0]) + 1.0).abs() < 1e-12 && rate([0.0, 0.0, 1.0]).abs() < 1e-12);
    // A farther slip at the level before has to be pulled back; after a shorter one nothing slips.
    assert!(rate([0.0, 1.0, 0.0]).abs() < 1e-12 && (rate([0.0, -1.0, 0.0]) + 1.0).abs() < 1e-12);
    let refused = history.vjp(&[0.0, 1.0], &[0.0, 0.0]).unwrap_err();
    assert_eq!(refused, ContactError::from(SensitivityError::NotDifferentiable));
}

/// A kink on the way counts, though the last level is none: at α = 1/4 the node is at its limit, at α = 2 it slips.
#[test]
fn kinks_of_earlier_levels_count() {
    let problem = one_node(FrictionCoefficient::constant(0.25).unwrap());
    let loads = problem.parameters().with_loads(&Matrix::identity(2)).unwrap();
    let states = [vec![1.0, 0.0, 0.0], vec![1.0, 0.25, 0.25], vec![1.0, 0.25, 2.0]];
    let parameters = [loads.clone(), loads.clone(), loads];
    let history = problem.history_sensitivity(&states, &parameters).unwrap();
    assert_eq!(history.differentiable().unwrap(), None);
    assert!(history.vjp(&[0.0, 1.0], &[0.0, 0.0]).is_err());
    let firm = [states[0].clone(), vec![1.0, 0.125, 0.125], states[2].clone()];
    let history = problem.history_sensitivity(&firm, &parameters).unwrap();
    assert_eq!(history.differentiable().unwrap(), Some(true));
}

/// Parameters of the body are known at the solution alone: which of them a range is refused for is told by its number, α counted, and
/// one that moves nothing is no mistake.
#[test]
fn ranges_of_the_body_are_refused_by_number() {
    let problem = one_node(FrictionCoefficient::constant(0.25).unwrap());
    let load = Matrix::from_triplets(2, 1, &[(1, 0, 1.0)]).unwrap();
    let columns = Matrix::from_triplets(2, 2, &[(1, 1, 1.0)]).unwrap();
    let parameters = (problem.parameters().with_loads(&load).unwrap())
        .with_body(&columns, None)
        .unwrap()
        .with_alpha();
    let mut found = problem.sensitivity(&[1.0, 0.125, 0.125], &parameters).unwrap();
    assert_eq!(found.jvp(&[0.0, 0.0, 1.0, 0.0]).unwrap().forces, [0.0; 2]);
    // λt = α + θ reaches 1/4.
    for delta in [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]] {
        assert!((found.valid_until(&delta, 1.0).unwrap().until() - 0.125).abs() < 1e-12);
    }
    let refused = found.valid_until(&[0.0, 0.0, 0.0, 1.0], 1.0);
    assert_eq!(refused, Err(SensitivityError::AtSolution { parameter: 3 }));
}

/// Slip-dependent friction has history variables, whose rates are not known.
#[test]
fn history_variables_are_refused() {
    let worn = FrictionCurve::exponential(0.4, 0.2, 1.0).unwrap();
    let problem = one_node(FrictionCoefficient::uniform(worn));
    let loads = problem.parameters().with_loads(&Matrix::identity(2)).unwrap();
    let refused = problem.history_sensitivity(&[vec![1.0, 0.0, 0.0]], &[loads]);
    assert!(matches!(
        refused,
        Err(ContactError::Law {
            what: "history variables",
            found: 1,
            ..
        })
    ));
}
