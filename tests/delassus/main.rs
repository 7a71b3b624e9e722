//! Problems in Delassus form u = M r + q against enumeration, constructed solutions, closed forms and invariances.

mod families;
mod large;
mod oracle;
#[path = "../common/random.rs"]
mod random;

use std::ops::ControlFlow;
use std::path::Path;

use proptest::prelude::*;
use random::Random;
use semismooth::InputError;
use semismooth::contact::{
    ContactError, ContactState, DelassusOptions, DelassusPhase, DelassusProblem, DelassusReport,
    DelassusSolver, read_delassus,
};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

const TOLERANCE: f64 = 1e-12;

fn solve(p: &DelassusProblem) -> DelassusReport {
    DelassusSolver::default().solve(p).unwrap()
}

/// Solved, by the independent oracle of these tests.
fn solved(p: &DelassusProblem) -> Result<DelassusReport, String> {
    let report = solve(p);
    let worst = oracle::worst(p, &report.r);
    if report.status != Status::Solved || worst > 1.01 * TOLERANCE {
        return Err(format!("{}, residual {worst:e}", report.status));
    }
    // The reported residual is the measured one, above rounding.
    let told = p.residual(&report.r).unwrap();
    if (told - worst).abs() > 1e-13 + 1e-2 * worst || report.residual != told {
        return Err(format!(
            "{told:e} and {:e} told, {worst:e} found",
            report.residual
        ));
    }
    check_history(&report);
    Ok(report)
}

fn check_history(report: &DelassusReport) {
    for (k, entry) in report.history.iter().enumerate() {
        assert_eq!(entry.index, k);
    }
    let work = |sweeps: bool| {
        let entries = report
            .history
            .iter()
            .filter(|i| (i.phase == DelassusPhase::Sweeps) == sweeps);
        entries.map(|i| i.work).sum::<usize>()
    };
    assert_eq!((report.sweeps, report.factorisations), (work(true), work(false)));
    // Each entry has a residual, and each factorisation of Newton's method a separate point.
    assert!(report.evaluations >= report.history.len());
    let of_newton = report
        .history
        .iter()
        .filter(|i| i.phase == DelassusPhase::Proximal);
    assert!(report.evaluations > of_newton.map(|i| i.work).sum::<usize>());
    // A proximal step that succeeds makes the next weight smaller, one that fails larger, unless another attempt begins.
    let first = report.history.iter().find(|i| i.phase == DelassusPhase::Proximal);
    for pair in report.history.windows(2) {
        let (one, next) = (&pair[0], &pair[1]);
        if one.phase != DelassusPhase::Proximal || next.phase != DelassusPhase::Proximal {
            continue;
        }
        let begins = first.is_some_and(|f| f.alpha == next.alpha);
        let moves = match one.success {
            true => next.alpha < one.alpha || next.alpha <= 1e-14,
            false => next.alpha > one.alpha,
        };
        assert!(moves || begins, "{one:?} {next:?}");
    }
}

fn rows(p: &DelassusProblem) -> Vec<Vec<f64>> {
    let n = p.q().len();
    (0..n)
        .map(|i| (0..n).map(|j| p.matrix().get(i, j)).collect())
        .collect()
}

fn close(a: &[f64], b: &[f64], tolerance: f64) -> bool {
    let size = a.iter().chain(b).fold(0.0_f64, |m, v| m.max(v.abs()));
    a.iter().zip(b).all(|(x, y)| (x - y).abs() <= tolerance * size)
}

#[test]
fn files_are_solved() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/friction");
    let mut names: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    names.sort();
    assert_eq!(names.len(), 11);
    for path in names {
        let p = read_delassus(&path).unwrap();
        let report = solved(&p).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert_eq!(report.states.len(), p.contacts());
        // The velocities of a solution where M is symmetric and semidefinite do not depend on the path of the solver.
        let again = DelassusSolver::default()
            .solve_observed(&p, Some(&report.r), |_| ControlFlow::Continue(()))
            .unwrap();
        assert_eq!(again.iterations(), 0, "{}", path.display());
    }
}

/// One contact in space, sliding, in closed form: M = diag(a, b, b), q = (−p, −c, 0): r_N = p/a, r_T1 = μ r_N, u_T1 = b μ p/a − c.
#[test]
fn one_contact_in_closed_form() {
    let (a, b, pressure) = (2.0, 3.0, 5.0);
    let m = || Matrix::from_rows(&[[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, b]]).unwrap();
    for (mu, push) in [(0.3, 4.0), (0.3, 2.0), (1.5, 7.0), (0.0, 1.0)] {
        let (s, c) = 0.7_f64.sin_cos();
        let p = DelassusProblem::new(3, m(), vec![-pressure, -push * c, -push * s], vec![mu]).unwrap();
        let r = solved(&p).unwrap();
        let normal = pressure / a;
        let friction = (push / b).min(mu * normal);
        assert!(
            close(&r.r, &[normal, friction * c, friction * s], 1e-11),
            "{:?}",
            r.r
        );
        let sticks = push / b < mu * normal;
        assert_eq!(r.states[0] == ContactState::Stick, sticks);
        assert_eq!(r.states[0].is_slip(), !sticks);
        let slip = b * friction - push;
        assert!(close(&r.u, &[0.0, slip * c, slip * s], 1e-11) || sticks);
    }
    let open = DelassusProblem::new(3, m(), vec![0.5, 1.0, 0.0], vec![0.4]).unwrap();
    assert_eq!(solved(&open).unwrap().r, [0.0; 3]);
}

/// r = (t, −t) on an open contact violates the law by its own size, however large t is: nothing is solved where squares overflow.
#[test]
fn forces_beyond_all_squares_are_no_solution() {
    let p = DelassusProblem::new(2, Matrix::identity(2), vec![1.0, 0.5], vec![0.3]).unwrap();
    for t in [1.0, 1e100, 1e150, 1e154, 1e160, 1e300] {
        let told = p.residual(&[t, -t]).unwrap();
        assert!(told > 0.1, "{t:e}: {told:e}");
    }
    assert_eq!(p.residual(&[0.0, 0.0]).unwrap(), 0.0);
}

/// Skew matrices, whose diagonals vanish, have units, too.
#[test]
fn units_of_skew_matrices_do_not_matter() {
    let of = |unit: f64, r: [f64; 2]| {
        let matrix = Matrix::from_rows(&[[0.0, -0.5 * unit], [0.5 * unit, 0.0]]).unwrap();
        let problem = DelassusProblem::new(2, matrix, vec![-0.25, 1.0], vec![0.2]).unwrap();
        (
            problem.residual(&r.map(|r| r / unit)).unwrap(),
            solve(&problem).status,
        )
    };
    let (known, status) = of(1.0, [1.0, 0.125]);
    for exponent in [-60, -10, 10, 60] {
        let (residual, other) = of(2_f64.powi(exponent), [1.0, 0.125]);
        assert!(
            (residual - known).abs() < 1e-14 && other == status,
            "2^{exponent}: {residual}, {known}"
        );
    }
}

/// M (10, 1) = 0, which jams a contact with μ = 0.2: beside reactions of 1e17 in this direction q, an interpenetration, is lost in
/// rounding.
#[test]
fn reactions_that_swallow_the_velocities_are_no_solution() {
    let matrix = Matrix::from_rows(&[[0.75, -7.5], [-0.125, 1.25]]).unwrap();
    let problem = DelassusProblem::new(2, matrix, vec![-0.25, 1.0], vec![0.2]).unwrap();
    for power in [30, 57, 60, 90] {
        let size = 2_f64.powi(power);
        let solver = DelassusSolver::default();
        let go_on = |_: &_| ControlFlow::Continue(());
        let report = solver.solve_observed(&problem, Some(&[10.0 * size, size]), go_on);
        let report = report.unwrap();
        // M r first, as it is computed exactly.
        let normal = (0.75 * report.r[0] - 7.5 * report.r[1]) - 0.25;
        assert!(
            !report.is_solved() || normal >= -1e-6,
            "2^{power}: {report} at {:?}",
            report.r
        );
    }
}

/// However small the pressure compared with the sliding velocity, the contact is closed: r_N = p, u_T = μ p − 1.
#[test]
fn contacts_that_slide_fast_under_little_pressure_are_closed() {
    for p in [1e-2, 1e-4, 1e-6, 1e-8] {
        let problem = DelassusProblem::new(2, Matrix::identity(2), vec![-p, -1.0], vec![0.5]).unwrap();
        let report = solved(&problem).unwrap();
        assert!(close(&report.r, &[p, 0.5 * p], 1e-11) && close(&report.u, &[0.0, 0.5 * p - 1.0], 1e-11));
        assert!(report.states[0].is_slip(), "{p:e}: {:?}", report.states);
    }
}

/// Without friction an open contact has no reaction: the cone is a half-line, and −e_N projects to its apex.
#[test]
fn open_contacts_without_friction_are_solved() {
    let plane = |q: [f64; 2]| DelassusProblem::new(2, Matrix::identity(2), q.to_vec(), vec![0.0]).unwrap();
    let report = solved(&plane([1.0, 0.0])).unwrap();
    assert_eq!(
        (report.r, report.states),
        (vec![0.0; 2], vec![ContactState::Open])
    );
    // Closed and sliding: only the velocity determines the direction.
    let report = solved(&plane([-1.0, -0.5])).unwrap();
    assert_eq!(
        (report.r, report.states),
        (vec![1.0, 0.0], vec![ContactState::SlipMinus])
    );
    let report = solved(&plane([-1.0, 0.5])).unwrap();
    assert_eq!(report.states, [ContactState::SlipPlus]);
    for mu in [0.0, 0.3] {
        let q = vec![1.0, 0.0, 0.0, -1.0, 0.0, 0.0];
        let p = DelassusProblem::new(3, Matrix::identity(6), q, vec![mu; 2]).unwrap();
        let report = solved(&p).unwrap();
        assert_eq!(report.r, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
        assert_eq!(report.states, [ContactState::Open, ContactState::Stick]);
    }
}

/// Packings in which the first proximal steps from interior points all fail: a step that takes all of its iterations must not end the
/// attempt before a larger weight is tried.
#[test]
fn packings_survive_failed_proximal_steps() {
    for seed in [2, 3] {
        let p = families::packing([5, 5, 4], 0.4, 3e-2, 1.0, seed);
        let options = DelassusOptions::default().with_max_factorisations(400);
        let report = DelassusSolver::new(options).solve(&p).unwrap();
        assert!(report.is_solved(), "seed {seed}: {}", report.status);
        assert!(oracle::worst(&p, &report.r) <= 1.01 * TOLERANCE);
    }
}

/// A pebble beside a heavy heap: its motion is rounding in the norm over all contacts, and must be right nevertheless.
#[test]
fn contacts_that_bear_little_are_solved_too() {
    for ratio in [1e-4, 1e-8, 1e-11] {
        let m = Matrix::identity(6);
        let q = vec![-1.0, -0.2, -ratio, -0.2 * ratio, -ratio, -0.9 * ratio];
        let p = DelassusProblem::new(2, m, q, vec![0.3; 3]).unwrap();
        let report = solved(&p).unwrap();
        assert_eq!(
            report.states,
            [ContactState::Stick, ContactState::Stick, ContactState::SlipMinus]
        );
        assert!(close(
            &report.r[2..],
            &[ratio, 0.2 * ratio, ratio, 0.3 * ratio],
            1e-11
        ));
        // Zero reactions of the small contacts are a solution in the norm over all contacts only.
        assert!(p.residual(&[1.0, 0.2, 0.0, 0.0, 0.0, 0.0]).unwrap() > 0.1);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Whatever the units of M and q: the same states, and reactions and velocities that scale. By powers of 4 and 2 nothing is rounded.
    #[test]
    fn units_do_not_matter(
        seed in any::<u64>(),
        nc in 1..8_usize,
        space in any::<bool>(),
        stiff in -12..=12_i32,
        far in -12..=12_i32,
    ) {
        let d = if space { 3 } else { 2 };
        let p = families::random(d, nc, d * nc + 3, 0.3, false, 0.0, seed);
        let first = solved(&p).map_err(TestCaseError::fail)?;
        for (a, b, exact) in [
            (10_f64.powi(stiff), 10_f64.powi(far), false),
            (4_f64.powi(2 * stiff), 2_f64.powi(4 * far), true),
        ] {
            let m: Vec<Vec<f64>> = rows(&p).iter().map(|row| row.iter().map(|v| a * v).collect()).collect();
            let q: Vec<f64> = p.q().iter().map(|v| b * v).collect();
            // Vanishing velocities are rounding relative to q.
            let beside = |u: &[f64]| [u, &q].concat();
            let scaled = DelassusProblem::new(d, Matrix::from_rows(&m).unwrap(), q.clone(), p.friction().to_vec()).unwrap();
            let report = solved(&scaled).map_err(TestCaseError::fail)?;
            prop_assert_eq!(&report.states, &first.states);
            let r: Vec<f64> = first.r.iter().map(|v| v * (b / a)).collect();
            let u: Vec<f64> = first.u.iter().map(|v| v * b).collect();
            if exact {
                prop_assert_eq!((&report.r, &report.u, report.residual), (&r, &u, first.residual));
            } else {
                prop_assert!(close(&report.r, &r, 1e-9), "{:?} {r:?}", report.r);
                prop_assert!(close(&beside(&report.u), &beside(&u), 1e-9), "{:?} {u:?}", report.u);
            }
        }
    }

    /// Planar problems: the solution is one of those found by trying all 4ⁿ choices of pieces.
    #[test]
    fn planar_problems_agree_with_enumeration(seed in any::<u64>(), nc in 1..5_usize, mu in 0.0..0.6_f64) {
        let p = families::random(2, nc, 2 * nc + 2, mu, false, 0.0, seed);
        let all = oracle::planar_solutions(&rows(&p), p.q(), p.friction());
        prop_assume!(!all.is_empty());
        let report = solved(&p).map_err(TestCaseError::fail)?;
        prop_assert!(all.iter().any(|r| close(r, &report.r, 1e-7)), "{:?} not among {all:?}", report.r);
    }

    /// Problems in space made from a solution: r and u of each contact satisfy the law, q = u − M r. M is deficient in rank for
    /// half of them; where it is definite and friction small, the solution is the only one.
    #[test]
    fn constructed_problems_are_solved(seed in any::<u64>(), nc in 1..12_usize, deficient in any::<bool>()) {
        let mut s = Random::new(seed);
        let freedom = if deficient { 2 * nc } else { 3 * nc + 4 };
        let m = rows(&families::random(3, nc, freedom, 0.3, true, 0.0, seed));
        let (mut r, mut u, mut friction) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..nc {
            let mu = s.between(0.05, 0.3);
            let (sin, cos) = s.between(0.0, 6.3).sin_cos();
            let (normal, slip) = (s.between(0.1, 1.0), s.between(0.1, 1.0));
            match s.below(3) {
                0 => { r.extend([0.0; 3]); u.extend([normal, slip * cos, slip * sin]); }
                1 => { r.extend([normal, 0.5 * mu * normal * cos, 0.5 * mu * normal * sin]); u.extend([0.0; 3]); }
                _ => { r.extend([normal, -mu * normal * cos, -mu * normal * sin]); u.extend([0.0, slip * cos, slip * sin]); }
            }
            friction.push(mu);
        }
        let q: Vec<f64> = (0..3 * nc).map(|i| u[i] - m[i].iter().zip(&r).map(|(a, b)| a * b).sum::<f64>()).collect();
        let p = DelassusProblem::new(3, Matrix::from_rows(&m).unwrap(), q, friction).unwrap();
        prop_assert!(oracle::residual(&p, &r) < 1e-14);
        solved(&p).map_err(TestCaseError::fail)?;
    }

    /// r(s q) = s r(q), r for s M is r / s, and the order of the contacts does not matter.
    #[test]
    fn scales_and_order_do_not_matter(seed in any::<u64>(), nc in 1..8_usize, exponent in -40..40_i32) {
        let p = families::random(3, nc, 3 * nc + 3, 0.3, false, 0.0, seed);
        let first = solved(&p).map_err(TestCaseError::fail)?;
        let s = 2.0_f64.powi(exponent);
        let scaled: Vec<f64> = p.q().iter().map(|v| s * v).collect();
        let q_scaled = DelassusProblem::new(3, p.matrix().clone(), scaled, p.friction().to_vec()).unwrap();
        let r = solved(&q_scaled).map_err(TestCaseError::fail)?.r;
        let expected: Vec<f64> = first.r.iter().map(|v| s * v).collect();
        prop_assert!(close(&r, &expected, 1e-8));

        let t = 2.0_f64.powi(exponent);
        let stiffer: Vec<Vec<f64>> = rows(&p).iter().map(|row| row.iter().map(|v| t * v).collect()).collect();
        let m_scaled = DelassusProblem::new(3, Matrix::from_rows(&stiffer).unwrap(), p.q().to_vec(), p.friction().to_vec()).unwrap();
        let r = solved(&m_scaled).map_err(TestCaseError::fail)?.r;
        let expected: Vec<f64> = first.r.iter().map(|v| v / t).collect();
        prop_assert!(close(&r, &expected, 1e-8));

        let m = rows(&p);
        let to = |i: usize| 3 * (nc - 1 - i / 3) + i % 3;
        let turned: Vec<Vec<f64>> = (0..3 * nc).map(|i| (0..3 * nc).map(|j| m[to(i)][to(j)]).collect()).collect();
        let q = (0..3 * nc).map(|i| p.q()[to(i)]).collect();
        let friction = p.friction().iter().rev().copied().collect();
        let reversed = DelassusProblem::new(3, Matrix::from_rows(&turned).unwrap(), q, friction).unwrap();
        let r = solved(&reversed).map_err(TestCaseError::fail)?.r;
        let expected: Vec<f64> = (0..3 * nc).map(|i| first.r[to(i)]).collect();
        prop_assert!(close(&r, &expected, 1e-8));
    }

    /// Without friction only the normal components are left, a linear complementarity problem: 2ⁿ choices.
    #[test]
    fn frictionless_is_complementarity(seed in any::<u64>(), nc in 1..6_usize, space in any::<bool>()) {
        let d = if space { 3 } else { 2 };
        let p = families::random(d, nc, d * nc + 2, 0.0, false, 0.0, seed);
        let report = solved(&p).map_err(TestCaseError::fail)?;
        let m = rows(&p);
        let normal: Vec<Vec<f64>> = (0..nc).map(|i| (0..nc).map(|j| m[d * i][d * j]).collect()).collect();
        let q: Vec<f64> = (0..nc).map(|i| p.q()[d * i]).collect();
        let expected = oracle::lcp(&normal, &q);
        let found: Vec<f64> = (0..nc).map(|i| report.r[d * i]).collect();
        prop_assert!(close(&found, &expected, 1e-9), "{found:?} against {expected:?}");
        prop_assert!((0..d * nc).all(|i| i % d == 0 || report.r[i] == 0.0));
    }
}

/// Far more contact unknowns than degrees of freedom: stacked, leaning, jammed.
#[test]
fn multibody_families_are_solved() {
    let mut problems = Vec::new();
    for mu in [0.1, 0.4, 0.8] {
        problems.push(("wall", families::wall(4, 4, mu, 1e-3, 1)));
        problems.push(("tower", families::tower(5, mu, 1e-3, 1)));
        problems.push(("leaning tower", families::tower(5, mu, 0.1, 2)));
        problems.push(("packing", families::packing([3, 3, 3], mu, 3e-2, 1.0, 1)));
        problems.push(("discs", families::discs(6, 8, mu, 1e-2, 1)));
        problems.push(("planar arch", families::arch(2, 15, mu + 0.2, 2.0)));
        problems.push(("arch", families::arch(3, 15, mu + 0.2, 2.0)));
        problems.push(("rods", families::rods(4, 5, mu, 1e-2, 1e-2, 3)));
        problems.push(("turning wall", families::turning_wall(3, 4, mu, 1e-1, 1e-2, 2)));
        problems.push(("half-space", families::half_space(6, mu, 1)));
    }
    for (name, p) in problems {
        solved(&p).unwrap_or_else(|e| panic!("{name}, μ = {}: {e}", p.friction()[0]));
    }
}

/// Uncoupled contacts are solved by one sweep, and the next one confirms it. Where sweeps are slow, but their states right, one linear
/// system finishes small planar problems, and a few factorisations larger ones.
#[test]
fn small_problems_take_few_sweeps() {
    let q = [-1.0, 0.4];
    let contacts = |nc: usize, coupling: f64| {
        let entry = |i: usize, j: usize| match (i == j, i % 2 == j % 2) {
            (true, _) => 1.0,
            (false, true) => -coupling / (nc - 1) as f64,
            (false, false) => 0.0,
        };
        let row = |i: usize| (0..2 * nc).map(|j| entry(i, j)).collect::<Vec<f64>>();
        let m = Matrix::from_rows(&(0..2 * nc).map(row).collect::<Vec<_>>()).unwrap();
        DelassusProblem::new(2, m, q.repeat(nc), vec![0.6; nc]).unwrap()
    };
    for nc in [1, 32, 33, 100] {
        let report = solve(&contacts(nc, 0.0));
        assert_eq!((report.sweeps, report.factorisations), (2, 0), "{nc}");
    }
    for (nc, sweeps) in [(32, 3), (33, 30)] {
        let report = solve(&contacts(nc, 0.95));
        assert_eq!(report.sweeps, sweeps, "{nc}");
        let last = report.history.last().unwrap();
        match nc {
            32 => assert_eq!((last.phase, report.factorisations), (DelassusPhase::States, 1)),
            _ => assert!((1..=6).contains(&report.factorisations) && last.phase == DelassusPhase::Proximal),
        }
        // All contacts are alike: each bears −q over the sum of a row.
        assert!(report.r.chunks(2).all(|r| close(r, &[20.0, -8.0], 1e-10)));
    }
}

/// Without factorisations a run is Gauss–Seidel, alternately forwards and backwards: one contact at a time, whose states the oracle
/// enumerates, with velocities updated for each.
#[test]
fn sweeps_are_those_of_gauss_and_seidel() {
    let p = families::discs(6, 6, 0.3, 0.4, 3);
    let (m, q, nc) = (rows(&p), p.q(), p.contacts());
    assert!(2 * nc > 64, "states of small problems end sweeps");
    let mut r = vec![0.0; q.len()];
    for sweeps in 1..=8 {
        for k in 0..nc {
            let i = if sweeps % 2 == 0 { nc - 1 - k } else { k };
            let own = 2 * i..2 * i + 2;
            r[own.clone()].fill(0.0);
            let product = |row: &[f64]| row.iter().zip(&r).map(|(a, b)| a * b).sum::<f64>();
            let b: Vec<f64> = own.clone().map(|a| q[a] + product(&m[a])).collect();
            let w: Vec<Vec<f64>> = own.clone().map(|a| m[a][own.clone()].to_vec()).collect();
            r[own].copy_from_slice(&oracle::planar_solutions(&w, &b, &p.friction()[i..=i])[0]);
        }
        let options = DelassusOptions::default()
            .with_max_sweeps(sweeps)
            .with_max_factorisations(0);
        let report = DelassusSolver::new(options).solve(&p).unwrap();
        assert_eq!((report.sweeps, report.factorisations), (sweeps, 0));
        assert!(close(&report.r, &r, 1e-10), "{sweeps}");
    }
}

/// The scale of a contact is at least 1e-12 of that of the largest contact, whatever its place.
#[test]
fn contacts_that_bear_next_to_nothing_count_little() {
    for (q, r) in [
        ([-1.0, 0.0, -1e-14, 0.0], [1.0, 0.0, 0.0, 0.0]),
        ([-1e-14, 0.0, -1.0, 0.0], [0.0, 0.0, 1.0, 0.0]),
    ] {
        let p = DelassusProblem::new(2, Matrix::identity(4), q.to_vec(), vec![0.5; 2]).unwrap();
        assert!((p.residual(&r).unwrap() - 1e-2).abs() < 1e-12);
    }
}

/// However a run ends, residual, velocities and states belong to the reactions returned, which are the best ones found.
#[test]
fn reports_are_about_the_reactions_returned() {
    let mut worse = 0;
    for seed in 0..40 {
        let p = families::random(2 + seed as usize % 2, 20, 30, 1.2, seed % 4 > 1, 0.2, seed);
        let mut least = f64::INFINITY;
        let mut last = 0.0;
        let report = DelassusSolver::default().solve_observed(&p, None, |entry| {
            least = least.min(entry.residual);
            last = entry.residual;
            match last > 2.0 * least {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        let report = report.unwrap();
        worse += usize::from(report.residual < last);
        assert_eq!(report.residual, p.residual(&report.r).unwrap());
        assert_eq!(report.u, p.velocities(&report.r).unwrap());
        let largest = report.r.iter().fold(0.0f64, |m, r| m.max(r.abs()));
        for (k, state) in report.states.iter().enumerate() {
            let force = report.r[p.dimension() * k];
            if force == 0.0 || force > 1e-6 * largest {
                assert_eq!(
                    *state == ContactState::Open,
                    force == 0.0,
                    "seed {seed}, contact {k}"
                );
            }
        }
    }
    assert!(worse > 0);
}

/// A linear system for known states counts as a factorisation, too, where none is allowed.
#[test]
fn no_factorisation_where_none_is_allowed() {
    let couples = [(0, 2), (2, 0), (1, 3), (3, 1)].map(|(i, j)| (i, j, -0.95));
    let ones = (0..4).map(|i| (i, i, 1.0));
    let m = Matrix::from_triplets(4, 4, &ones.chain(couples).collect::<Vec<_>>()).unwrap();
    let p = DelassusProblem::new(2, m, [-1.0, 0.4].repeat(2), vec![0.6; 2]).unwrap();
    assert_eq!(solve(&p).factorisations, 1);
    let none = DelassusSolver::new(DelassusOptions::default().with_max_factorisations(0));
    let report = none.solve(&p).unwrap();
    assert_eq!(
        (report.factorisations, report.status),
        (0, Status::IterationLimit)
    );
}

#[test]
fn no_load_no_reaction() {
    let p = families::random(3, 4, 6, 0.5, true, 0.0, 3);
    let zero = DelassusProblem::new(3, p.matrix().clone(), vec![0.0; 12], p.friction().to_vec()).unwrap();
    let report = solved(&zero).unwrap();
    assert_eq!(report.r, [0.0; 12]);
    assert_eq!(report.residual, 0.0);
    let tiny: Vec<f64> = p.q().iter().map(|v| v * 1e-200).collect();
    let tiny = DelassusProblem::new(3, p.matrix().clone(), tiny, p.friction().to_vec()).unwrap();
    assert!(solve(&tiny).is_solved());
}

/// Contacts between immobile bodies: no reaction changes anything.
#[test]
fn immobile_contacts() {
    let m = Matrix::from_triplets(4, 4, &[(0, 0, 1.0), (1, 1, 1.0)]).unwrap();
    let p = |q: [f64; 4]| DelassusProblem::new(2, m.clone(), q.to_vec(), vec![0.5; 2]).unwrap();
    let report = solved(&p([-1.0, 0.1, 0.3, 1.0])).unwrap();
    assert_eq!(&report.r[2..], [0.0, 0.0]);
    // They are pressed into each other: there is no solution, but the solver returns.
    let report = solve(&p([-1.0, 0.1, -0.3, 1.0]));
    assert!(!report.is_solved());
    assert!(report.residual > 0.01 && report.r.iter().all(|v| v.is_finite()));
    assert!(!report.history.is_empty());
}

#[test]
fn bad_input_is_refused() {
    let eye = || Matrix::identity(6);
    let make = |d, m, q: Vec<f64>, mu: Vec<f64>| DelassusProblem::new(d, m, q, mu).unwrap_err();
    let q = || vec![-1.0; 6];
    assert!(matches!(
        make(4, eye(), q(), vec![0.1; 2]),
        ContactError::Dimension { found: 4 }
    ));
    assert!(matches!(
        make(3, Matrix::identity(0), vec![], vec![]),
        ContactError::Empty { .. }
    ));
    assert!(matches!(
        make(3, eye(), q(), vec![0.1; 3]),
        ContactError::Input(InputError::Shape { rows: 9, .. })
    ));
    assert!(matches!(
        make(3, eye(), vec![0.0; 5], vec![0.1; 2]),
        ContactError::Input(InputError::Length { found: 5, .. })
    ));
    let friction = make(3, eye(), q(), vec![0.1, -0.1]);
    assert!(matches!(
        friction,
        ContactError::NegativeCoefficient { contact: 1, .. }
    ));
    for bad in [f64::NAN, f64::INFINITY] {
        let mut broken = q();
        broken[4] = bad;
        assert!(matches!(
            make(3, eye(), broken, vec![0.1; 2]),
            ContactError::Input(InputError::NotFinite {
                what: "q",
                index: 4,
                ..
            })
        ));
        assert!(matches!(
            make(3, eye(), q(), vec![0.1, bad]),
            ContactError::Input(InputError::NotFinite {
                what: "mu",
                index: 1,
                ..
            })
        ));
        let mut m = eye();
        m.values_mut()[2] = bad;
        assert!(matches!(
            make(3, m, q(), vec![0.1; 2]),
            ContactError::Matrix { .. }
        ));
    }
    let mut m = eye();
    m.values_mut()[3] = -1.0;
    assert!(matches!(
        make(3, m, q(), vec![0.1; 2]),
        ContactError::NegativeDiagonal { index: 3, .. }
    ));

    let p = DelassusProblem::new(3, eye(), q(), vec![0.1; 2]).unwrap();
    let go = |start: &[f64]| {
        DelassusSolver::default().solve_observed(&p, Some(start), |_| ControlFlow::Continue(()))
    };
    assert!(matches!(
        go(&[0.0; 5]),
        Err(ContactError::Input(InputError::Length {
            what: "r",
            found: 5,
            ..
        }))
    ));
    assert!(matches!(
        go(&[f64::NAN; 6]),
        Err(ContactError::Input(InputError::NotFinite { what: "r", .. }))
    ));
    for tolerance in [0.0, -1.0, 1.0, f64::NAN] {
        let options = DelassusOptions::default().with_tolerance(tolerance);
        assert!(matches!(
            DelassusSolver::new(options).solve(&p),
            Err(ContactError::Input(InputError::Option {
                name: "tolerance",
                ..
            }))
        ));
    }
}

#[test]
fn files_with_errors_are_refused() {
    let folder = std::env::temp_dir().join(format!("delassus_files_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("problem.json");
    let mut told = Vec::new();
    for (text, word) in [
        ("{", "EOF"),
        ("[]", "dimension"),
        (
            r#"{"dimension": 2.5, "mu": [0.1], "q": [0, 0], "M": [[1, 0], [0, 1]]}"#,
            "whole number",
        ),
        (
            r#"{"dimension": 2, "q": [0, 0], "M": [[1, 0], [0, 1]]}"#,
            "`mu` is missing",
        ),
        (
            r#"{"dimension": 2, "mu": ["a"], "q": [0, 0], "M": [[1, 0], [0, 1]]}"#,
            "entry 0 of `mu`",
        ),
        (r#"{"dimension": 2, "mu": [0.1], "q": [0, 0]}"#, "`M` is missing"),
        (
            r#"{"dimension": 2, "mu": [0.1], "q": [0, 0], "M": [[1, 0], [0]]}"#,
            "`M`",
        ),
        (
            r#"{"dimension": 2, "mu": [0.1], "nc": 2, "q": [0, 0], "M": [[1, 0], [0, 1]]}"#,
            "`nc` is 2",
        ),
        (
            r#"{"dimension": 2, "mu": [0.1], "q": [0, 0], "M": {"format": "coo"}}"#,
            "coo",
        ),
        (
            r#"{"dimension": 2, "mu": [0.1], "q": [0, 0], "M": {"format": "csc", "indptr": [0, 1, 2], "indices": [0, 2], "data": [1, 1]}}"#,
            "outside",
        ),
        (
            r#"{"dimension": 2, "mu": [0.1], "q": [0, 0], "M": {"format": "csc", "indptr": [0, 3, 2], "indices": [0, 1], "data": [1, 1]}}"#,
            "indptr",
        ),
        ("{\n  \"dimension\": 2,\n  \"mu\": [0.1,]\n}", "line 3"),
        (
            r#"{"dimension": 2, "mu": 0.1, "q": [0, 0], "M": [[1, 0], [0, 1]]}"#,
            "`mu` must be a list",
        ),
        (
            r#"{"dimension": 2, "mu": [0.1], "q": [0, 0], "M": "diagonal"}"#,
            "`M` must be an object or a list",
        ),
        (
            r#"{"dimension": 2, "mu": [0.1], "q": [0, 0], "M": [[1, 0], 1]}"#,
            "row 1 of `M` must be a list of numbers",
        ),
        (
            r#"{"dimension": 2, "mu": [0.1], "q": [0, 0], "M": {"data": [1, 1]}}"#,
            "`M.format` is missing",
        ),
        (
            r#"{"dimension": 2, "mu": [0.1], "q": [0, 0], "M": {"format": "csc", "indptr": [0, 1], "indices": [0, 1], "data": [1, 1]}}"#,
            "`M.indptr` has 2 entries, but `q` has 2",
        ),
        (
            r#"{"dimension": 2, "mu": [0.1], "q": [0, 0], "M": {"format": "csc", "indptr": [0, 1, 2], "indices": [0, 1], "data": [1]}}"#,
            "`M.indices` has 2 entries and `M.data` 1",
        ),
        (
            r#"{"dimension": 2, "mu": [0.1], "q": [0, 0], "M": {"format": "csc", "indptr": [0, 1, 2], "indices": [0, -1], "data": [1, 1]}}"#,
            "entry 1 of `M.indices` is -1",
        ),
    ] {
        std::fs::write(&path, text).unwrap();
        let error = read_delassus(&path).unwrap_err().to_string();
        told.push((
            error.contains(word) && error.contains("problem.json"),
            word,
            error,
        ));
    }
    let missing = read_delassus(folder.join("missing.json")).unwrap_err();
    std::fs::remove_dir_all(&folder).unwrap();
    assert!(matches!(missing, ContactError::Input(InputError::File { .. })));
    assert!(told.iter().all(|t| t.0), "{told:?}");
}

/// The observer sees the history and may stop the run; limits end it; the best reactions are returned.
#[test]
fn runs_can_be_stopped() {
    let p = families::wall(3, 3, 0.3, 1e-2, 1);
    let zero = vec![0.0; p.q().len()];
    let mut seen = Vec::new();
    let report = DelassusSolver::default()
        .solve_observed(&p, None, |entry| {
            seen.push(*entry);
            if seen.len() == 3 {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })
        .unwrap();
    assert_eq!(report.status, Status::Interrupted);
    assert_eq!(report.history, seen);
    let least = seen.iter().map(|e| e.residual).fold(f64::INFINITY, f64::min);
    assert_eq!(report.residual, least);

    let mut seen = Vec::new();
    let report = DelassusSolver::default()
        .solve_observed(&p, None, |entry| {
            seen.push(*entry);
            ControlFlow::Continue(())
        })
        .unwrap();
    assert!(report.is_solved());
    assert_eq!(report.history, seen);

    let options = DelassusOptions::default().with_max_factorisations(2);
    let report = DelassusSolver::new(options).solve(&p).unwrap();
    assert_eq!(report.status, Status::IterationLimit);
    assert!(report.factorisations <= 2);
    let options = DelassusOptions::default().with_max_time(Some(std::time::Duration::ZERO));
    let report = DelassusSolver::new(options).solve(&p).unwrap();
    assert_eq!((report.status, report.iterations()), (Status::TimeLimit, 0));
    assert_eq!(report.r, zero);
    assert_eq!(solve(&p), solve(&p));
}

/// Whatever the coefficients of friction are, a solution has u_N ≥ 0 and r_N u_N = 0, each to its own terms: a large μ hides neither.
#[test]
fn no_velocity_into_the_ground_is_a_solution() {
    let mut random = Random::new(17);
    let (mut solved, mut huge) = (0, 0);
    for case in 0..400 {
        let nc = 1 + random.below(3);
        let n = 2 * nc;
        let rank = random.below(n + 1);
        let factor: Vec<Vec<f64>> = (0..rank)
            .map(|_| (0..n).map(|_| random.below(7) as f64 - 3.0).collect())
            .collect();
        let entry = |i: usize, j: usize| factor.iter().map(|f| f[i] * f[j]).sum::<f64>();
        let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
        let q: Vec<f64> = (0..n).map(|_| random.below(11) as f64 - 5.0).collect();
        let mu: Vec<f64> = (0..nc)
            .map(|_| 10_f64.powi(random.below(13) as i32 - 1))
            .collect();
        let problem =
            DelassusProblem::new(2, Matrix::from_rows(&rows).unwrap(), q.clone(), mu.clone()).unwrap();
        let options = DelassusOptions::default()
            .with_max_factorisations(300)
            .with_max_sweeps(300);
        let report = DelassusSolver::new(options).solve(&problem).unwrap();
        if report.status != Status::Solved {
            continue;
        }
        solved += 1;
        huge += usize::from(mu.iter().any(|mu| *mu > 1e5));
        let r = &report.r;
        for c in 0..nc {
            let i = 2 * c;
            let terms = q[i].abs() + (0..n).map(|j| (rows[i][j] * r[j]).abs()).sum::<f64>();
            let u = q[i] + (0..n).map(|j| rows[i][j] * r[j]).sum::<f64>();
            assert!(
                u >= -1e-11 * terms,
                "case {case}: u_N = {u:e} of {terms:e}, mu {mu:?}"
            );
            assert!(
                r[i] >= 0.0 && r[i + 1].abs() <= mu[c] * r[i] * (1.0 + 1e-9) + 1e-300,
                "case {case}: {r:?}"
            );
        }
    }
    assert!(solved > 100 && huge > 50, "{solved} {huge}");
}

/// Two problems without a solution: the second contact is pulled into the ground by the first, and nothing resists.
#[test]
fn large_coefficients_do_not_solve_what_has_no_solution() {
    let rows = [[1.0, 0.0, -3.0, 0.0], [0.0; 4], [-3.0, 0.0, 9.0, 0.0], [0.0; 4]];
    for mu in [1.0, 1e3, 1e6, 1e9, 1e12] {
        let coupled = DelassusProblem::new(
            2,
            Matrix::from_rows(&rows).unwrap(),
            vec![-4.0, 4.0, 3.0, -1.0],
            vec![1.0, mu],
        )
        .unwrap();
        let zero = Matrix::from_triplets(2, 2, &[]).unwrap();
        let alone = DelassusProblem::new(2, zero, vec![-1.0, -1.0], vec![mu]).unwrap();
        for problem in [coupled, alone] {
            let options = DelassusOptions::default()
                .with_max_factorisations(300)
                .with_max_sweeps(300);
            let report = DelassusSolver::new(options).solve(&problem).unwrap();
            assert_ne!(report.status, Status::Solved, "{mu:e}: {:?}", report.r);
        }
    }
}
