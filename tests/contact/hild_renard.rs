//! The model with one contact node: closed forms against the conditions written out by hand, and continuation against both.

use crate::dense;
use crate::dense::distance;
use proptest::prelude::*;
use semismooth::contact::{
    ContactState, FullContact, HildRenard, HildRenardBranch, HildRenardCase, PlanarCoulomb,
};
use semismooth::continuation::{Arm, Branch, Continuation, ContinuationOptions, Direction, Termination};

#[derive(Debug, Clone, Copy)]
struct Data {
    f_nu: f64,
    f_t: f64,
    lambda: f64,
    mu: f64,
}

impl Data {
    fn model(&self) -> HildRenard {
        HildRenard::new(self.f_nu, self.f_t, self.lambda, self.mu).unwrap()
    }

    /// Violation of equilibrium and of Signorini's and Coulomb's conditions by (u_ν, u_t, λ_ν, λ_t), relative to the terms involved.
    fn violation(&self, [un, ut, pn, pt]: [f64; 4], friction: f64) -> f64 {
        let (d, c) = (0.5 * (self.lambda + 3.0 * self.mu), 0.5 * (self.lambda + self.mu));
        let force = self.f_nu.abs() + self.f_t.abs() + f64::MIN_POSITIVE;
        let equilibrium = |terms: [f64; 4]| {
            let size: f64 = terms.iter().map(|t| t.abs()).sum();
            terms.iter().sum::<f64>().abs() / size.max(force)
        };
        let length = force / self.mu;
        let bound = friction * pn;
        let mut worst = [
            equilibrium([d * un, -c * ut, pn, -self.f_nu]),
            equilibrium([-c * un, d * ut, pt, -self.f_t]),
            un / length,
            -pn / force,
            un.abs().min(pn.abs() * length / force) / length,
            (pt.abs() - bound) / (force * (1.0 + friction)),
        ]
        .into_iter()
        .fold(0.0, f64::max);
        // Where it slips, the friction force is at its bound and has the sign of the slip.
        if ut.abs() > 1e-12 * length {
            worst = worst.max((pt - ut.signum() * bound).abs() / (force * (1.0 + friction)));
        }
        worst
    }
}

fn data() -> impl Strategy<Value = Data> {
    let load = || prop_oneof![4 => -5.0..5.0_f64, 1 => Just(0.0)];
    (load(), load(), 0.1..4.0_f64, 0.1..4.0_f64).prop_map(|(f_nu, f_t, lambda, mu)| Data {
        f_nu,
        f_t,
        lambda,
        mu,
    })
}

/// Small integers with (λ+3μ) f_ν + (λ+μ) f_t = 0, exactly.
fn bifurcating() -> impl Strategy<Value = Data> {
    (1..8_i32, 1..8_i32, 1..4_i32).prop_map(|(l, m, k)| Data {
        f_nu: f64::from(k * (l + m)),
        f_t: f64::from(-k * (l + 3 * m)),
        lambda: f64::from(l),
        mu: f64::from(m),
    })
}

fn contains(b: &HildRenardBranch, alpha: f64) -> bool {
    b.interval.0 <= alpha && alpha <= b.interval.1
}

proptest! {
    #[test]
    fn closed_forms_solve_the_problem(d in data(), s in 0.0..1.0_f64) {
        for b in d.model().branches() {
            let (lower, upper) = b.interval;
            let upper = upper.min(lower + 10.0);
            for alpha in [lower, lower + s * (upper - lower), upper] {
                let x = d.model().solution(b.state, alpha);
                prop_assert!(d.violation(x, alpha) < 1e-12, "{d:?} {b:?} {alpha} {x:?}");
            }
        }
    }

    /// Conversely, a state whose closed form satisfies the conditions with a margin is listed there.
    #[test]
    fn no_piece_is_missing(d in data(), alpha in 0.0..10.0_f64) {
        let model = d.model();
        for state in ContactState::ALL {
            let x = model.solution(state, alpha);
            let listed = model.branches().iter().any(|b| b.state == state && contains(b, alpha));
            let margins = match state {
                ContactState::Open => vec![-x[0]],
                ContactState::Stick => vec![x[2], alpha * x[2] - x[3].abs()],
                ContactState::SlipPlus => vec![x[2], x[1]],
                ContactState::SlipMinus => vec![x[2], -x[1]],
                state => unreachable!("{state}"),
            };
            if margins.iter().all(|m| *m > 1e-9) {
                prop_assert!(listed, "{d:?} {state} at {alpha}");
            }
            if margins.iter().any(|m| *m < -1e-9) {
                prop_assert!(!listed, "{d:?} {state} at {alpha}");
            }
        }
    }

    #[test]
    fn bifurcating_forms_solve_the_problem(d in bifurcating(), alpha in 0.0..10.0_f64, s in 0.0..1.0_f64) {
        let model = d.model();
        prop_assert_eq!(model.indicator(), 0.0);
        prop_assert_eq!(model.case(), HildRenardCase::OneBifurcating);
        for b in model.branches() {
            if b.state != ContactState::SlipMinus && contains(&b, alpha) {
                prop_assert!(d.violation(model.solution(b.state, alpha), alpha) < 1e-12);
            }
        }
        // The vertical segment: u_t from 0 to −f_ν / c at α = (λ+3μ)/(λ+μ).
        let c = 0.5 * (d.lambda + d.mu);
        let pole = (d.lambda + 3.0 * d.mu) / (d.lambda + d.mu);
        let vertical = model.branches().into_iter().find(|b| b.state == ContactState::SlipMinus).unwrap();
        prop_assert_eq!(vertical.interval, (pole, pole));
        let ut = -s * d.f_nu / c;
        let pressure = d.f_nu + c * ut;
        prop_assert!(d.violation([0.0, ut, pressure, -pole * pressure], pole) < 1e-12);
    }
}

#[test]
fn cases_by_the_analysis() {
    use HildRenardCase::{One, OneBifurcating, Two};
    // λ = μ = 1: the indicator is 4 f_ν + 2 f_t.
    for (f_nu, f_t, case) in [
        (1.0, 0.0, One),
        (1.0, -1.0, One),
        (1.0, -2.0, OneBifurcating),
        (1.0, -2.5, Two),
        (-1.0, 3.0, One),
        (-1.0, 2.0, One),
        (-1.0, 1.0, One),
        (-1.0, -1.0, One),
        (0.0, 0.0, One),
        (0.0, 1.0, One),
        (0.0, -1.0, One),
    ] {
        let model = HildRenard::new(f_nu, f_t, 1.0, 1.0).unwrap();
        assert_eq!(model.case(), case, "({f_nu}, {f_t})");
        let open = model.branches().iter().any(|b| b.state == ContactState::Open);
        assert_eq!(open, 4.0 * f_nu + 2.0 * f_t <= 0.0, "({f_nu}, {f_t})");
    }
}

/// The distinct solutions found by first-point searches from all four states.
fn solutions(problem: &FullContact<PlanarCoulomb>, alpha: f64) -> Vec<Vec<f64>> {
    let mut list: Vec<Vec<f64>> = Vec::new();
    for state in ContactState::ALL {
        let Ok(x) = problem.solve_from_states(alpha, &[state]) else {
            continue;
        };
        if list.iter().all(|y| distance(y, &x) > 1e-8) {
            list.push(x);
        }
    }
    list
}

/// Everything reached from a start, by following both directions and all arms of the points where a curve stops.
struct Component {
    points: Vec<Vec<f64>>,
    transitions: Vec<Vec<f64>>,
}

fn explore(problem: &FullContact<PlanarCoulomb>, start: &[f64], options: &ContinuationOptions) -> Component {
    let mut found = Component {
        points: vec![],
        transitions: vec![],
    };
    let mut arms: Vec<(Vec<f64>, Arm)> = Vec::new();
    let mut add = |branch: Branch, arms: &mut Vec<(Vec<f64>, Arm)>| {
        let fine = matches!(
            branch.termination,
            Termination::ParameterRange | Termination::Branching | Termination::End
        );
        assert!(fine, "{}", branch.termination);
        found.points.extend(branch.points.into_iter().map(|p| p.x));
        for t in branch.transitions {
            if t.followed.is_none() && found.transitions.iter().all(|x| distance(x, &t.x) > 1e-8) {
                arms.extend(t.arms.into_iter().map(|a| (t.x.clone(), a)));
            }
            found.transitions.push(t.x);
        }
        for b in branch.branch_points {
            let x = b.point.x;
            if found.transitions.iter().all(|y| distance(y, &x) > 1e-8) {
                arms.extend(b.arms.into_iter().map(|a| (x.clone(), a)));
            }
            found.transitions.push(x);
        }
    };
    for direction in [Direction::Increasing, Direction::Decreasing] {
        add(
            Branch::follow(problem, start, direction, options.clone()).unwrap(),
            &mut arms,
        );
    }
    while let Some((x, arm)) = arms.pop() {
        let curve = Continuation::along_arm(problem, &x, &arm, options.clone()).unwrap();
        add(
            Branch::collect(curve, |_| std::ops::ControlFlow::Continue(())).unwrap(),
            &mut arms,
        );
    }
    found
}

/// Continuation from every solution at α₀ against the closed forms: the number of branches, every point, every transition.
fn compare(d: Data, alpha_0: f64, alpha_max: f64, expected: usize) -> Result<(), TestCaseError> {
    let model = d.model();
    let problem = model.problem().unwrap();
    let options = ContinuationOptions::default()
        .with_parameter_range((0.0, alpha_max))
        .with_targets(vec![alpha_0]);
    let starts = solutions(&problem, alpha_0);
    let pieces = model.branches();
    let closed: Vec<_> = pieces
        .iter()
        .filter(|b| contains(b, alpha_0))
        .map(|b| [model.solution(b.state, alpha_0).to_vec(), vec![alpha_0]].concat())
        .collect();
    prop_assert_eq!(starts.len(), closed.len());
    for x in &closed {
        prop_assert!(
            starts
                .iter()
                .any(|y| distance(x, y) < 1e-10 * (1.0 + dense::norm(x)))
        );
    }
    let mut left = starts;
    let mut branches = 0;
    while let Some(start) = left.pop() {
        branches += 1;
        let component = explore(&problem, &start, &options);
        left.retain(|x| component.points.iter().all(|y| distance(x, y) > 1e-8));
        for x in component.points.iter().chain(&component.transitions) {
            let alpha = x[4];
            prop_assert!(d.violation([x[0], x[1], x[2], x[3]], alpha) < 1e-11, "{x:?}");
            let on_a_piece = pieces.iter().any(|b| {
                let (lower, upper) = b.interval;
                if lower == upper {
                    // On the vertical segment α is as accurate as the solution of the problem at the pole.
                    return d.violation([x[0], x[1], x[2], x[3]], lower) < 1e-11;
                }
                let slack = 1e-10 * (1.0 + alpha);
                let inside = lower - slack <= alpha && alpha <= upper + slack;
                inside && distance(&x[..4], &model.solution(b.state, alpha)) < 1e-9 * (1.0 + dense::norm(x))
            });
            prop_assert!(on_a_piece, "{x:?} {pieces:?}");
        }
        let ends: Vec<f64> = component.points.iter().map(|x| x[4]).collect();
        prop_assert!(ends.contains(&alpha_max));
        for b in &pieces {
            // An end of a piece inside the range is a transition, exactly there, of the branch that contains the piece.
            let edge = b.interval.0;
            if b.state == ContactState::Stick && edge > 1e-6 && edge < alpha_max - 1e-6 {
                let corner = [model.solution(b.state, edge).to_vec(), vec![edge]].concat();
                let on_this = component
                    .points
                    .iter()
                    .any(|x| distance(&x[..4], &corner[..4]) < 1e-8 && x[4] > edge);
                let met = component
                    .transitions
                    .iter()
                    .any(|x| distance(x, &corner) < 1e-10 * (1.0 + dense::norm(&corner)));
                prop_assert_eq!(on_this, met, "{:?} {:?}", corner, component.transitions);
            }
        }
    }
    prop_assert_eq!(branches, expected);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn continuation_agrees_with_the_analysis(d in data(), s in 0.05..0.95_f64) {
        // In units of the load and the shear modulus the indicator must be bounded away from zero; for zero itself see below.
        let size = (d.lambda + 3.0 * d.mu) * (d.f_nu.abs() + d.f_t.abs());
        prop_assume!(d.model().indicator().abs() > 1e-3 * size);
        // All branches are present beyond the last corner, |f_t| / f_ν.
        let corner = if d.f_nu > 0.0 { d.f_t.abs() / d.f_nu } else { 1.0 };
        prop_assume!(corner < 50.0);
        let alpha_max = 2.0 * corner + 4.0;
        let alpha_0 = corner + (s * (alpha_max - corner)).max(0.05);
        let expected = if d.model().case() == HildRenardCase::Two { 2 } else { 1 };
        compare(d, alpha_0, alpha_max, expected)?;
    }

    #[test]
    fn the_bifurcating_branch_is_one(d in bifurcating(), s in 0.05..0.95_f64) {
        let pole = (d.lambda + 3.0 * d.mu) / (d.lambda + d.mu);
        compare(d, pole + s * 3.0, pole + 4.0, 1)?;
    }
}

/// The vertical segment of this bifurcating problem, −6 ≤ u_t ≤ 0 at the pole α = 57/33, ends where the node opens, at a point that is a
/// transition and a branch point of slip at once.
#[test]
fn the_end_of_the_vertical_segment_is_reported_once() {
    let problem = HildRenard::new(33.0, -57.0, 7.0, 4.0).unwrap().problem().unwrap();
    for alpha in [2.92067556659445, 3.257756315613208] {
        let options = ContinuationOptions::default().with_parameter_range((0.0, 5.0));
        let start = [0.0, 0.0, 33.0, -57.0, alpha];
        let branch = Branch::follow(&problem, &start, Direction::Decreasing, options).unwrap();
        let last = &branch.transitions.last().unwrap().x;
        assert!(
            distance(last, &[0.0, -6.0, 0.0, 0.0, 57.0 / 33.0]) < 1e-10,
            "{last:?}"
        );
        assert!(
            branch.points.iter().all(|p| distance(&p.x, last) > 1e-9),
            "{alpha}"
        );
    }
}
