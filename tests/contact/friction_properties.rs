//! Random frictional problems: every branch, followed from every solution, against conditions and determinants computed independently here.

use crate::dense::{det_sign, distance, dot, eliminate, norm};
use proptest::prelude::*;
use semismooth::contact::{
    CondensedContact, Contact, ContactState, FrictionCoefficient, FullContact, LoadPath, MultiplierCoulomb,
    NodeLaw, PlanarCoulomb,
};
use semismooth::continuation::{
    Branch, ContinuationOptions, Direction, PointKind, Termination, Transition, TransitionKind,
};
use semismooth::interface::View;
use semismooth::sparse::Matrix;

/// The window of the parameter.
const WINDOW: (f64, f64) = (0.0, 4.0);
/// Relative distance from zero that inequalities and pivots of a regular sample keep.
const MARGIN: f64 = 1e-6;

/// x, the states, and sign det ∇_yH.
type Solution = (Vec<f64>, Vec<ContactState>, i32);

#[derive(Debug, Clone)]
struct Sample {
    a: Vec<Vec<f64>>,
    bnu: Vec<Vec<f64>>,
    bt: Vec<Vec<f64>>,
    gap: Vec<f64>,
    load: [Vec<f64>; 2],
    friction: [Vec<f64>; 2],
    r: f64,
}

fn vector(n: usize, bound: f64) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(-bound..bound, n)
}

fn matrix(rows: usize, cols: usize) -> impl Strategy<Value = Vec<Vec<f64>>> {
    prop::collection::vec(vector(cols, 1.0), rows)
}

fn sample() -> impl Strategy<Value = Sample> {
    let sizes = (prop_oneof![3 => 1..3_usize, 1 => 3..5_usize], 0..4_usize);
    sizes.prop_flat_map(|(p, extra)| {
        let n = 2 * p + extra;
        let traces = (matrix(n, n), matrix(2 * p, n), any::<bool>());
        let friction = (
            prop::collection::vec(0.1..3.0_f64, p),
            prop::collection::vec(0.1..3.0_f64, p),
            any::<bool>(),
        );
        let others = (
            prop_oneof![Just(vec![0.0; p]), prop::collection::vec(-0.2..1.0_f64, p)],
            prop_oneof![Just(1.0), 0.2..5.0_f64],
        );
        (traces, vector(n, 4.0), vector(n, 2.0), friction, others).prop_map(
            move |((g, rows, picking), f0, f1, (start, end, constant), (gap, r))| {
                let a = (0..n)
                    .map(|i| {
                        (0..n)
                            .map(|j| dot(&g[i], &g[j]) + 0.3 * f64::from(i == j))
                            .collect()
                    })
                    .collect();
                let unit = |k: usize| (0..n).map(|j| f64::from(j == k)).collect::<Vec<f64>>();
                let row = |k: usize| if picking { unit(k) } else { rows[k].clone() };
                let slope = |i: usize| (end[i] - start[i]) / (WINDOW.1 - WINDOW.0);
                Sample {
                    a,
                    bnu: (0..p).map(|i| row(2 * i)).collect(),
                    bt: (0..p).map(|i| row(2 * i + 1)).collect(),
                    gap,
                    load: [f0, f1],
                    friction: [
                        start.clone(),
                        (0..p).map(|i| if constant { 0.0 } else { slope(i) }).collect(),
                    ],
                    r,
                }
            },
        )
    })
}

impl Sample {
    fn n(&self) -> usize {
        self.a.len()
    }

    fn p(&self) -> usize {
        self.bnu.len()
    }

    fn problem(&self) -> FullContact<PlanarCoulomb> {
        let rows = |m: &[Vec<f64>]| Matrix::from_rows(m).unwrap();
        let [f0, f1] = self.load.clone();
        let [c0, c1] = self.friction.clone();
        FullContact::planar(
            rows(&self.a),
            rows(&self.bnu),
            rows(&self.bt),
            LoadPath::affine(f0, f1),
            FrictionCoefficient::affine(c0, c1).unwrap(),
        )
        .unwrap()
        .with_gap(self.gap.clone())
        .unwrap()
        .with_r(self.r)
        .unwrap()
    }

    /// The same with the bound F λν.
    fn by_multiplier(&self) -> FullContact<MultiplierCoulomb> {
        let [c0, c1] = self.friction.clone();
        let law = MultiplierCoulomb::new(FrictionCoefficient::affine(c0, c1).unwrap()).unwrap();
        self.problem().with_law(law).unwrap()
    }

    /// The same problem in other units.
    fn in_units(&self, force: f64, length: f64) -> Self {
        let scaled = |v: &[f64], s: f64| v.iter().map(|x| s * x).collect::<Vec<f64>>();
        Self {
            a: self.a.iter().map(|row| scaled(row, force / length)).collect(),
            gap: scaled(&self.gap, length),
            load: self.load.each_ref().map(|f| scaled(f, force)),
            r: self.r * force / length,
            ..self.clone()
        }
    }

    /// The size of rounding where all terms vanish, relative to the load.
    fn floor(&self) -> f64 {
        1e-4 * (norm(&self.load[0]) + WINDOW.1 * norm(&self.load[1])) + f64::MIN_POSITIVE
    }

    fn friction_at(&self, i: usize, alpha: f64) -> f64 {
        self.friction[0][i] + alpha * self.friction[1][i]
    }

    /// The violation of the conditions at x = (u, λν, λt, α), with projections; each row relative to the size of its terms.
    fn violation(&self, x: &[f64]) -> f64 {
        let (n, p) = (self.n(), self.p());
        let (u, pn, pt, alpha) = (&x[..n], &x[n..n + p], &x[n + p..n + 2 * p], x[n + 2 * p]);
        let floor = self.floor();
        let size = |terms: &[f64]| floor + terms.iter().map(|t| t.abs()).sum::<f64>();
        let mut worst: f64 = 0.0;
        for i in 0..n {
            let mut terms: Vec<f64> = (0..n).map(|j| self.a[i][j] * u[j]).collect();
            terms.extend((0..p).flat_map(|k| [self.bnu[k][i] * pn[k], self.bt[k][i] * pt[k]]));
            terms.extend([-self.load[0][i], -alpha * self.load[1][i]]);
            worst = worst.max(terms.iter().sum::<f64>().abs() / size(&terms));
        }
        for i in 0..p {
            let lengths: Vec<f64> = (0..n).map(|j| self.bnu[i][j] * u[j]).collect();
            let shears: Vec<f64> = (0..n).map(|j| self.bt[i][j] * u[j]).collect();
            let un = lengths.iter().sum::<f64>() - self.gap[i];
            let ut = shears.iter().sum::<f64>();
            let g = self.friction_at(i, alpha) * pn[i].max(0.0);
            let scale = size(&lengths) + size(&shears) + self.gap[i].abs() + pn[i].abs() + pt[i].abs() + g;
            let normal = pn[i] - (pn[i] + un).max(0.0);
            let tangential = pt[i] - (pt[i] + ut).clamp(-g, g);
            worst = worst.max(normal.abs().max(tangential.abs()) / scale);
        }
        worst
    }

    /// ∇H of the frozen states at x: n + 2p rows, n + 2p + 1 columns.
    fn jacobian(&self, states: &[ContactState], pressure: &[f64], alpha: f64) -> Vec<Vec<f64>> {
        let (n, p) = (self.n(), self.p());
        let m = n + 2 * p;
        let mut jac = vec![vec![0.0; m + 1]; m];
        for i in 0..n {
            jac[i][..n].copy_from_slice(&self.a[i]);
            for k in 0..p {
                jac[i][n + k] = self.bnu[k][i];
                jac[i][n + p + k] = self.bt[k][i];
            }
            jac[i][m] = -self.load[1][i];
        }
        for k in 0..p {
            let (normal, tangential) = (n + k, n + p + k);
            match states[k] {
                ContactState::Open => jac[normal][normal] = 1.0,
                _ => (0..n).for_each(|j| jac[normal][j] = -self.bnu[k][j]),
            }
            let slip = match states[k] {
                ContactState::SlipPlus => 1.0,
                ContactState::SlipMinus => -1.0,
                _ => 0.0,
            };
            if states[k] == ContactState::Stick {
                (0..n).for_each(|j| jac[tangential][j] = -self.bt[k][j]);
            } else {
                jac[tangential][tangential] = 1.0;
                jac[tangential][normal] = -slip * self.friction_at(k, alpha);
                jac[tangential][m] = -slip * self.friction[1][k] * pressure[k];
            }
        }
        jac
    }

    /// sign det ∇_yH, with the smallest relative pivot.
    fn det_y(&self, states: &[ContactState], alpha: f64) -> (i32, f64) {
        let jac = self.jacobian(states, &vec![0.0; self.p()], alpha);
        let square: Vec<Vec<f64>> = jac.iter().map(|r| r[..r.len() - 1].to_vec()).collect();
        det_sign(&square)
    }

    /// sign det [∇H; τᵀ], with the smallest relative pivot.
    fn orientation(&self, states: &[ContactState], x: &[f64], tangent: &[f64]) -> (i32, f64) {
        let (n, p) = (self.n(), self.p());
        let mut bordered = self.jacobian(states, &x[n..n + p], x[n + 2 * p]);
        bordered.push(tangent.to_vec());
        det_sign(&bordered)
    }

    /// All solutions at α with their states, by enumeration of the 4ᵖ linear systems; `None` if one of them is too close to singular or to
    /// the boundary of its cell.
    fn solutions(&self, alpha: f64) -> Option<Vec<Solution>> {
        let (n, p) = (self.n(), self.p());
        let m = n + 2 * p;
        let mut found = Vec::new();
        for code in 0..4_usize.pow(p as u32) {
            let states: Vec<ContactState> = (0..p)
                .map(|k| ContactState::ALL[code / 4_usize.pow(k as u32) % 4])
                .collect();
            let jac = self.jacobian(&states, &vec![0.0; p], alpha);
            let square: Vec<Vec<f64>> = jac.iter().map(|r| r[..m].to_vec()).collect();
            let mut rhs = vec![0.0; m];
            for i in 0..n {
                rhs[i] = self.load[0][i] + alpha * self.load[1][i];
            }
            for k in 0..p {
                if states[k] != ContactState::Open {
                    rhs[n + k] = -self.gap[k];
                }
            }
            let (sign, pivot, y) = eliminate(&square, &rhs);
            if pivot < MARGIN {
                return None;
            }
            let y = y?;
            let size = 1.0 + norm(&y);
            let worst = (0..p)
                .map(|k| {
                    let un = dot(&self.bnu[k], &y[..n]) - self.gap[k];
                    let ut = dot(&self.bt[k], &y[..n]);
                    let (pn, pt) = (y[n + k], y[n + p + k]);
                    match states[k] {
                        ContactState::Open => -un,
                        ContactState::Stick => pn.min(self.friction_at(k, alpha) * pn - pt.abs()),
                        ContactState::SlipPlus => pn.min(ut),
                        ContactState::SlipMinus => pn.min(-ut),
                        state => unreachable!("{state}"),
                    }
                })
                .fold(f64::INFINITY, f64::min);
            if worst.abs() < MARGIN * size {
                return None;
            }
            if worst > 0.0 {
                found.push(([y, vec![alpha]].concat(), states, sign));
            }
        }
        Some(found)
    }
}

fn options(targets: &[f64]) -> ContinuationOptions {
    ContinuationOptions::default()
        .with_parameter_range(WINDOW)
        .with_targets(targets.to_vec())
        .with_max_growth(100.0)
}

/// The transitions of a branch in order: (α, states before, states after).
fn changes<V: View, L: NodeLaw>(
    map: &Contact<V, L>,
    transitions: &[Transition],
) -> Vec<(f64, Vec<ContactState>, Vec<ContactState>)> {
    transitions
        .iter()
        .map(|t| (t.parameter(), map.states(&t.before), map.states(&t.after)))
        .filter(|(_, before, after)| before != after)
        .collect()
}

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * (1.0 + a.abs().max(b.abs()))
}

/// Residuals, transitions and orientation along one branch.
fn check_branch(
    s: &Sample,
    problem: &FullContact<PlanarCoulomb>,
    branch: &Branch,
) -> Result<(), TestCaseError> {
    let m = s.n() + 2 * s.p();
    let mut orientation = None;
    let mut oriented = |states: &[ContactState], x: &[f64], t: &[f64]| -> Result<(), TestCaseError> {
        let (sign, pivot) = s.orientation(states, x, t);
        let (det, pivot_y) = s.det_y(states, x[m]);
        if pivot > 1e-9 {
            prop_assert_eq!(
                *orientation.get_or_insert(sign),
                sign,
                "orientation changes at {:?}",
                x
            );
            if pivot_y > 1e-9 {
                prop_assert_eq!((t[m] > 0.0, t[m] < 0.0), (sign * det > 0, sign * det < 0));
            }
        }
        Ok(())
    };
    for point in &branch.points {
        let violation = s.violation(&point.x);
        prop_assert!(violation <= 1e-10, "violation {violation:e} at {:?}", point.x);
        oriented(&problem.states(&point.selection), &point.x, &point.tangent)?;
    }
    for t in &branch.transitions {
        let violation = s.violation(&t.x);
        prop_assert!(
            violation <= 1e-10,
            "violation {violation:e} at transition {:?}",
            t.x
        );
        let (before, after) = (problem.states(&t.before), problem.states(&t.after));
        for states in [&before, &after] {
            let residual = frozen_violation(s, states, &t.x);
            prop_assert!(residual <= 1e-10, "{residual:e} in {states:?} at {:?}", t.x);
        }
        prop_assert!(t.complete);
        oriented(&before, &t.x, &t.tangent_before)?;
        oriented(&after, &t.x, &t.tangent_after)?;
        let ((d1, p1), (d2, p2)) = (s.det_y(&before, t.parameter()), s.det_y(&after, t.parameter()));
        if p1.min(p2) > 1e-9 {
            prop_assert_eq!(t.kind == TransitionKind::Fold, d1 * d2 < 0);
            prop_assert_eq!(t.kind == TransitionKind::PassThrough, d1 * d2 > 0);
        }
    }
    Ok(())
}

/// Residual of the equations of frozen states at x, relative to the size of the terms.
fn frozen_violation(s: &Sample, states: &[ContactState], x: &[f64]) -> f64 {
    let (n, p) = (s.n(), s.p());
    let m = n + 2 * p;
    let jac = s.jacobian(states, &x[n..n + p], x[m]);
    let mut worst: f64 = 0.0;
    for i in 0..m {
        let constant = match i {
            i if i < n => -s.load[0][i] - x[m] * s.load[1][i],
            i if i < n + p && states[i - n] != ContactState::Open => s.gap[i - n],
            _ => 0.0,
        };
        let terms: Vec<f64> = (0..m).map(|j| jac[i][j] * x[j]).collect();
        let size: f64 = terms.iter().map(|t| t.abs()).sum::<f64>() + constant.abs() + s.floor();
        worst = worst.max((terms.iter().sum::<f64>() + constant).abs() / size);
    }
    worst
}

fn follow<V: View, L: NodeLaw>(
    map: &Contact<V, L>,
    x: &[f64],
    direction: Direction,
    targets: &[f64],
) -> Branch {
    Branch::follow(map, x, direction, options(targets)).unwrap()
}

/// A curve in general position neither branches nor ends inside the window.
fn check_end(branch: &Branch) -> Result<(), TestCaseError> {
    let fine = matches!(
        branch.termination,
        Termination::ParameterRange | Termination::Unbounded | Termination::Closed
    );
    prop_assert!(fine, "{}", branch.termination);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, max_global_rejects: 40000, ..ProptestConfig::default() })]

    #[test]
    fn branches_of_random_problems(s in sample(), alpha in 0.3..3.7_f64, target in 0.1..3.9_f64) {
        let (Some(starts), Some(others)) = (s.solutions(alpha), s.solutions(target)) else {
            return Err(TestCaseError::reject("degenerate"));
        };
        let n = s.n();
        for list in [&starts, &others] {
            prop_assert_eq!(list.iter().map(|x| x.2).sum::<i32>(), 1);
        }
        let full = s.problem();
        let condensed = full.condensed().unwrap();
        let multiplier = s.by_multiplier();
        for (x, states, _) in &starts {
            prop_assert!(s.violation(x) <= 1e-12);
            for direction in [Direction::Increasing, Direction::Decreasing] {
                let branch = follow(&full, x, direction.clone(), &[target]);
                check_end(&branch)?;
                check_branch(&s, &full, &branch)?;
                prop_assert_eq!(&full.states(&branch.points[0].selection), states);
                // At the target the branch passes through one of the solutions there, and hits it exactly.
                let hits = branch.points.iter().filter(|p| p.kind == PointKind::Target);
                for hit in hits.filter(|p| p.x[n + 2 * s.p()] == target) {
                    let known = others.iter().find(|y| distance(&y.0, &hit.x) <= 1e-9 * (1.0 + norm(&y.0)));
                    prop_assert!(known.is_some(), "{:?} {others:?}", hit.x);
                    prop_assert_eq!(&known.unwrap().1, &full.states(&hit.selection));
                }
                same_in_condensed_form(&condensed, &branch, x, direction.clone(), target)?;
                // The other form of the bound: the same states at the same parameters.
                let other = follow(&multiplier, x, direction.clone(), &[target]);
                let (a, b) = (changes(&full, &branch.transitions), changes(&multiplier, &other.transitions));
                prop_assert_eq!(a.len(), b.len(), "{:?} {:?}", a, b);
                for (a, b) in a.iter().zip(&b) {
                    prop_assert!(close(a.0, b.0, 1e-10) && (&a.1, &a.2) == (&b.1, &b.2), "{a:?} {b:?}");
                }
                there_and_back(&full, &branch, x, alpha)?;
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, max_global_rejects: 40000, ..ProptestConfig::default() })]

    #[test]
    fn units_change_no_branch(
        s in sample(), alpha in 0.3..3.7_f64,
        units in prop::sample::select(vec![(1e9, 1.0), (1e-9, 1.0), (1.0, 1e9), (1.0, 1e-9), (1e9, 1e3), (1e-6, 1e6)])
    ) {
        let Some(starts) = s.solutions(alpha) else {
            return Err(TestCaseError::reject("degenerate"));
        };
        let (n, p) = (s.n(), s.p());
        let (force, length) = units;
        let other = s.in_units(force, length);
        for (x, ..) in &starts {
            let mut y = x.clone();
            y[..n].iter_mut().for_each(|u| *u *= length);
            y[n..n + 2 * p].iter_mut().for_each(|l| *l *= force);
            same_in_other_units(&s.problem(), &other.problem(), (x, &y))?;
            same_in_other_units(&s.by_multiplier(), &other.by_multiplier(), (x, &y))?;
        }
    }
}

/// Curves from one start in both units, in full and condensed form.
fn same_in_other_units<L: NodeLaw + Clone>(
    first: &FullContact<L>,
    full: &FullContact<L>,
    (x, y): (&[f64], &[f64]),
) -> Result<(), TestCaseError> {
    let condensed = full.condensed().unwrap();
    let z = condensed.restrict(y).unwrap();
    for direction in [Direction::Increasing, Direction::Decreasing] {
        let known = follow(first, x, direction.clone(), &[]);
        // The limit on the growth of ‖x‖ cuts curves at different points.
        if known.termination == Termination::Unbounded {
            continue;
        }
        let known = changes(first, &known.transitions);
        let generous = options(&[]).with_max_growth(1e6);
        let full_branch = Branch::follow(full, y, direction.clone(), generous.clone()).unwrap();
        let condensed_branch = Branch::follow(&condensed, &z, direction, generous).unwrap();
        for found in [
            changes(full, &full_branch.transitions),
            changes(&condensed, &condensed_branch.transitions),
        ] {
            prop_assert_eq!(found.len(), known.len(), "{:?} {:?}", found, known);
            for (a, b) in found.iter().zip(&known) {
                prop_assert!(
                    close(a.0, b.0, 1e-9) && (&a.1, &a.2) == (&b.1, &b.2),
                    "{a:?} {b:?}"
                );
            }
        }
    }
    Ok(())
}

fn same_in_condensed_form(
    condensed: &CondensedContact<PlanarCoulomb>,
    branch: &Branch,
    x: &[f64],
    direction: Direction,
    target: f64,
) -> Result<(), TestCaseError> {
    let start = condensed.restrict(x).unwrap();
    let other = follow(condensed, &start, direction, &[target]);
    check_end(&other)?;
    // The limit on the growth of ‖x‖ cuts the two forms at different points, possibly on different sides of a transition.
    let cut = branch.termination == Termination::Unbounded || other.termination == Termination::Unbounded;
    if !cut {
        prop_assert_eq!(branch.transitions.len(), other.transitions.len());
    }
    for (a, b) in branch.transitions.iter().zip(&other.transitions) {
        let expanded = condensed.expand(&b.x).unwrap();
        prop_assert!(distance(&a.x, &expanded) <= 1e-10 * (1.0 + norm(&a.x)));
        prop_assert_eq!((&a.before, &a.after, a.kind), (&b.before, &b.after, b.kind));
    }
    let targets = |b: &Branch| {
        let hits = b.points.iter().filter(|p| p.kind == PointKind::Target);
        hits.map(|p| p.x.clone()).collect::<Vec<_>>()
    };
    for (a, b) in targets(branch).iter().zip(&targets(&other)) {
        prop_assert!(distance(a, &condensed.expand(b).unwrap()) <= 1e-10 * (1.0 + norm(a)));
    }
    Ok(())
}

/// From the end of a branch back to its start: the same transitions in reverse order, the states before and after exchanged.
fn there_and_back(
    map: &FullContact<PlanarCoulomb>,
    branch: &Branch,
    x: &[f64],
    alpha: f64,
) -> Result<(), TestCaseError> {
    let end = branch.points.last().unwrap();
    // A curve cut on its way to infinity ends in the middle of a step that may be arbitrarily ill-conditioned.
    if branch.termination != Termination::ParameterRange {
        return Ok(());
    }
    let back: Vec<f64> = end.tangent.iter().map(|t| -t).collect();
    // The limit on the growth of ‖x‖ is relative to this new start, where x may be small.
    let options = options(&[alpha]).with_max_growth(1e5);
    let returned = Branch::follow(map, &end.x, Direction::Along(back), options).unwrap();
    let expected = branch.transitions.iter().rev();
    prop_assert!(returned.transitions.len() >= branch.transitions.len());
    for (a, b) in expected.zip(&returned.transitions) {
        prop_assert!(distance(&a.x, &b.x) <= 1e-9 * (1.0 + norm(&a.x)));
        prop_assert_eq!((&a.before, &a.after), (&b.after, &b.before));
    }
    let home = returned
        .points
        .iter()
        .any(|p| distance(&p.x, x) <= 1e-9 * (1.0 + norm(x)));
    prop_assert!(home, "the way back misses the start {x:?}");
    Ok(())
}
