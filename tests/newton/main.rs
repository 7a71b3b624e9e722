//! The corrector: against enumeration, on problems where Newton's method cycles, and at the limits of rounding.

#[path = "../dense/mod.rs"]
mod dense;
#[path = "../maps/mod.rs"]
mod maps;

mod globalisation;
mod krylov;
mod limits;
mod problems;
mod replay;
mod routes;

use std::cell::Cell;
use std::ops::ControlFlow;

use proptest::prelude::*;
use semismooth::complementarity::{AffineFunction, Mcp};
use semismooth::linear::AutoSolver;
use semismooth::newton::{Damping, MoorePenrose, Newton, NewtonError, NewtonOptions, Step};
use semismooth::piecewise::{MinMap, PiecewiseError, PiecewiseSmooth, Selection, Selections, Semismooth};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, Pattern};

use maps::{one_piece, two_pieces};
use problems::{Lcp, Smooth, close, cycling, p_matrix, scalar};

fn p_lcp() -> impl Strategy<Value = (Lcp, Vec<f64>)> {
    (1..=8_usize).prop_flat_map(|n| {
        let entries = prop::collection::vec(-2.0..2.0_f64, n * n);
        let q = prop::collection::vec(-5.0..5.0_f64, n);
        let start = prop::collection::vec(-5.0..5.0_f64, n);
        (entries, q, start, 0.05..2.0_f64)
            .prop_map(move |(e, q, x, shift)| (Lcp::new(p_matrix(n, &e, shift), q), x))
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn p_matrix_lcps_agree_with_enumeration((lcp, start) in p_lcp()) {
        let solutions = lcp.enumerate();
        prop_assert!(!solutions.is_empty());
        let mut newton = Newton::default();
        let mut x = start.clone();
        newton.solve(&lcp, &mut x).unwrap();
        prop_assert!(close(&x, &solutions[0], 1e-7), "{:?} {:?}", x, solutions);
        // The selection at the end belongs to the solution.
        let mut r = vec![0.0; x.len()];
        lcp.residual(newton.selection(), &x, &mut r);
        prop_assert!(r.iter().all(|r| r.abs() < 1e-9));
    }

    #[test]
    fn solutions_do_not_depend_on_units(
        (lcp, start) in p_lcp(),
        units in prop::collection::vec((-1..=1_i32, -1..=1_i32), 8),
    ) {
        let mut plain = start.clone();
        Newton::default().solve(&lcp, &mut plain).unwrap();
        let mut scaled = lcp.clone();
        for i in 0..lcp.q.len() {
            scaled.row[i] = 1e9_f64.powi(units[i].0);
            scaled.col[i] = 1e9_f64.powi(units[i].1);
        }
        let mut x: Vec<f64> = start.iter().zip(&scaled.col).map(|(x, c)| x / c).collect();
        Newton::default().solve(&scaled, &mut x).unwrap();
        let back: Vec<f64> = x.iter().zip(&scaled.col).map(|(x, c)| x * c).collect();
        prop_assert!(close(&back, &plain, 1e-7), "{:?} {:?}", back, plain);
    }

    #[test]
    fn two_runs_give_the_same_bits((lcp, start) in p_lcp()) {
        let mut newton = Newton::default();
        let (mut a, mut b) = (start.clone(), start);
        newton.solve(&lcp, &mut a).unwrap();
        let first = newton.report().clone();
        newton.solve(&lcp, &mut b).unwrap();
        prop_assert_eq!(a, b);
        prop_assert_eq!(&first, newton.report());
    }

    #[test]
    fn any_lcp_ends_with_a_solution_or_a_consistent_failure(
        n in 1..=5_usize,
        entries in prop::collection::vec(-2.0..2.0_f64, 25),
        q in prop::collection::vec(-3.0..3.0_f64, 5),
        start in prop::collection::vec(-3.0..3.0_f64, 5),
    ) {
        let m = (0..n).map(|i| entries[i * n..(i + 1) * n].to_vec()).collect();
        let lcp = Lcp::new(m, q[..n].to_vec());
        let norm = |x: &[f64]| {
            let h: Vec<f64> = (0..n).map(|i| x[i].min(lcp.w(x, i))).collect();
            h.iter().map(|h| h * h).sum::<f64>().sqrt()
        };
        let mut x = start[..n].to_vec();
        let before = norm(&x);
        match Newton::default().solve(&lcp, &mut x) {
            Ok(_) => prop_assert!(norm(&x) <= 1e-9 * (1.0 + x.iter().map(|v| v.abs()).sum::<f64>())),
            Err(NewtonError::Failed(u)) => {
                prop_assert_eq!(&u.x, &x);
                prop_assert!((norm(&x) - u.residual_norm).abs() <= 1e-12 * (1.0 + norm(&x)));
                // No worse than the start, by the solver's own residuals: this formula and the solver's may differ by rounding. (Later
                // entries of the history may belong to a piece outside of its cell.)
                let first = u.report.history[0].residual_norm;
                prop_assert!((first - before).abs() <= 1e-12 * (1.0 + before));
                prop_assert!(u.residual_norm <= first);
            }
            Err(e) => prop_assert!(false, "{e}"),
        }
    }
}

#[test]
fn an_affine_problem_ends_after_one_step_in_the_right_cell() {
    let lcp = Lcp::new(vec![vec![2.0, 1.0], vec![1.0, 2.0]], vec![-5.0, -1.0]);
    let mut newton = Newton::default();
    let mut x = [3.0, 0.0];
    newton.solve(&lcp, &mut x).unwrap();
    assert!(close(&x, &[2.5, 0.0], 1e-14));
    assert_eq!(newton.report().history.len(), 2);
    assert_eq!(newton.report().factorisations, 1);
}

#[test]
fn a_cycle_of_full_steps_is_left() {
    let lcp = cycling();
    let exact = lcp.enumerate();
    assert_eq!(exact.len(), 1);
    let undamped = NewtonOptions::default().with_damping(Damping::Never);
    let mut cycles = 0;
    for k in 0..8_u32 {
        let start: Vec<f64> = (0..3).map(|i| if k >> i & 1 == 1 { 2.0 } else { 0.0 }).collect();
        let mut x = start.clone();
        let plain = Newton::new(undamped.clone()).solve(&lcp, &mut x);
        let mut newton = Newton::default();
        let mut x = start;
        newton.solve(&lcp, &mut x).unwrap();
        assert!(close(&x, &exact[0], 1e-12));
        if let Err(NewtonError::Failed(failed)) = plain {
            assert_eq!(failed.status, Status::IterationLimit);
            cycles += 1;
            let out = newton.report().history.iter();
            let ways = out.filter(|i| {
                i.step != Step::Newton && i.step != Step::None || (0.0 < i.damping && i.damping < 1.0)
            });
            assert!(ways.count() > 0, "the way out must show in the report");
        }
    }
    assert!(
        cycles > 0,
        "no start cycles: the problem does not test what it should"
    );
}

#[test]
fn a_singular_start_is_left() {
    // x² = 4 from x = 0 has gradient 0: stationary. The second equation moves the first off it.
    let map = Smooth {
        n: 2,
        f: |x: &[f64], out: &mut [f64]| {
            out[0] = x[0] * x[1] - 2.0;
            out[1] = x[0] + x[1] - 3.0;
        },
        j: |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, x[1]);
            jac.add(0, 1, x[0]);
            jac.add(1, 0, 1.0);
            jac.add(1, 1, 1.0);
        },
    };
    let mut newton = Newton::default();
    let mut x = [1.0 + 1e-3, 1.0 + 1e-3];
    // On the diagonal the Jacobian is singular and stays so along least-squares steps, by symmetry.
    match newton.solve(&map, &mut x) {
        Ok(_) => assert!((x[0] * x[1] - 2.0).abs() < 1e-12),
        Err(NewtonError::Failed(u)) => assert!((u.x[0] - u.x[1]).abs() < 1e-12),
        Err(e) => panic!("{e}"),
    }
    assert_eq!(newton.report().history[0].step, Step::Gradient);
    // A singular start from which steps lead away.
    let map = Smooth {
        n: 2,
        f: |x: &[f64], out: &mut [f64]| {
            out[0] = x[0] * x[0] + x[1] - 3.0;
            out[1] = x[1] + x[0] * x[1] - 2.0 + x[0] * x[0];
        },
        j: |x: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, 2.0 * x[0]);
            jac.add(0, 1, 1.0);
            jac.add(1, 0, x[1] + 2.0 * x[0]);
            jac.add(1, 1, 1.0 + x[0]);
        },
    };
    let mut x = [0.0, 0.0];
    newton.solve(&map, &mut x).unwrap();
    assert_eq!(newton.report().history[0].step, Step::Gradient);
    let mut r = [0.0; 2];
    map.residual(&Selection::default(), &x, &mut r);
    assert!(r.iter().all(|r| r.abs() < 1e-12), "{x:?}");
    // Without damping the run fails.
    let never = NewtonOptions::default().with_damping(Damping::Never);
    match Newton::new(never).solve(&map, &mut [0.0, 0.0]) {
        Err(NewtonError::Failed(u)) => assert_eq!(u.status, Status::Singular),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_consistent_rank_deficient_system_is_solved() {
    let m = vec![vec![1.0, 1.0], vec![1.0, 1.0]];
    let lcp = Lcp::new(m, vec![-2.0, -2.0]);
    let mut x = [0.4, 0.3];
    Newton::default().solve(&lcp, &mut x).unwrap();
    assert!((x[0] + x[1] - 2.0).abs() < 1e-12 && x[0] > 0.0 && x[1] > 0.0);
}

#[test]
fn an_observer_sees_every_iteration_and_may_stop() {
    let map = scalar(|x| x * x - 2.0, |x| 2.0 * x);
    let seen = Cell::new(0);
    let mut newton = Newton::default();
    let end = newton.solve_observed(&map, &mut [100.0], |i| {
        assert_eq!(i.index, seen.get());
        seen.set(seen.get() + 1);
        ControlFlow::Continue(())
    });
    assert!(end.is_ok());
    assert_eq!(newton.report().history.len(), seen.get());
    let mut x = [100.0];
    let stop = |i: &semismooth::newton::Iteration| match i.index {
        2 => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    match newton.solve_observed(&map, &mut x, stop) {
        Err(NewtonError::Failed(u)) => {
            assert_eq!(u.status, Status::Interrupted);
            assert_eq!(u.report.history.len(), 3);
            assert!(u.residual_norm < 1e4 && u.x == x);
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn convergence_on_a_smooth_piece_is_quadratic() {
    let map = MinMapExp;
    let mut newton = Newton::default();
    let mut x = [4.0];
    newton.solve(&map, &mut x).unwrap();
    assert!((x[0] - 3.0_f64.ln()).abs() < 1e-14);
    let order = newton.report().observed_order(1e-11).unwrap();
    assert!((1.8..2.2).contains(&order), "{order}");
}

/// min(exp x − 3, 60).
struct MinMapExp;

impl PiecewiseSmooth for MinMapExp {
    two_pieces!(self, [positive, negative], 1, 1, 1);
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out[0] = 63.0 - x[0].exp();
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        out[0] = [x[0].exp() - 3.0, 60.0][s.piece(0)];
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        jac.add(0, 0, [x[0].exp(), 0.0][s.piece(0)]);
    }
}

#[test]
fn a_curve_is_solved_at_a_fixed_parameter() {
    let curve = MinMap::curve(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0];
        a[1] = x[1];
        b[0] = 2.0 * x[0] + x[1] - x[2];
        b[1] = x[0] + 2.0 * x[1] - 1.0;
    });
    for alpha in [-1.0, 0.3, 5.0] {
        let mut x = [0.7, 0.2, alpha];
        Newton::default().solve(&curve, &mut x).unwrap();
        assert_eq!(x[2].to_bits(), f64::to_bits(alpha));
        for i in 0..2 {
            let w = [2.0 * x[0] + x[1] - alpha, x[0] + 2.0 * x[1] - 1.0][i];
            assert!(x[i].min(w).abs() < 1e-9);
        }
    }
}

/// Fischer–Burmeister for an LCP.
struct FischerBurmeister(Lcp, Pattern);

impl Semismooth for FischerBurmeister {
    fn num_vars(&self) -> usize {
        self.0.q.len()
    }
    fn residual(&self, x: &[f64], out: &mut [f64]) {
        for i in 0..x.len() {
            let w = self.0.w(x, i);
            out[i] = x[i] + w - x[i].hypot(w);
        }
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        for i in 0..x.len() {
            let w = self.0.w(x, i);
            let norm = x[i].hypot(w);
            let (a, b) = if norm > 0.0 {
                (x[i] / norm, w / norm)
            } else {
                (0.0, 0.0)
            };
            jac.add(i, i, 1.0 - a);
            for j in 0..x.len() {
                if self.0.m[i][j] != 0.0 {
                    jac.add(i, j, (1.0 - b) * self.0.m[i][j]);
                }
            }
        }
    }
    fn pattern(&self) -> Pattern {
        self.1.clone()
    }
}

#[test]
fn fischer_burmeister_agrees_with_the_minimum_and_a_solver_is_reused() {
    let n = 4;
    let chain = |a: f64, far: bool| {
        let mut m = vec![vec![0.0; n]; n];
        for i in 0..n {
            m[i][i] = 2.5;
            let j = if far { (i + 2) % n } else { (i + 1) % n };
            m[i][j] = a;
        }
        let entries = (0..n * n)
            .map(|k| (k / n, k % n))
            .filter(|&(i, j)| m[i][j] != 0.0);
        let pattern = Pattern::from_entries(n, n, entries).unwrap();
        FischerBurmeister(Lcp::new(m, vec![-1.0, 2.0, -3.0, 0.5]), pattern)
    };
    // One solver over maps of one size with different patterns, back and forth.
    let mut newton = Newton::default();
    for (a, far) in [(1.0, false), (-1.0, true), (0.5, false), (2.0, true)] {
        let map = chain(a, far);
        let mut x = vec![1.0; n];
        newton.solve_semismooth(&map, &mut x).unwrap();
        assert!(close(&x, &map.0.enumerate()[0], 1e-7), "{x:?}");
        let mut y = vec![1.0; n];
        newton.solve(&map.0, &mut y).unwrap();
        assert!(close(&x, &y, 1e-7));
    }
    let empty = FischerBurmeister(Lcp::new(vec![], vec![]), Pattern::full(0, 0));
    assert!(matches!(
        newton.solve_semismooth(&empty, &mut []),
        Err(NewtonError::Map(PiecewiseError::Dimensions { .. }))
    ));
}

#[test]
fn a_semismooth_map_without_pieces_is_damped_too() {
    /// arctan x = 0, on which full steps from 3 diverge.
    struct Arctan;
    impl Semismooth for Arctan {
        fn num_vars(&self) -> usize {
            1
        }
        fn residual(&self, x: &[f64], out: &mut [f64]) {
            out[0] = x[0].atan();
        }
        fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
            jac.add(0, 0, 1.0 / (1.0 + x[0] * x[0]));
        }
    }
    let mut x = [3.0];
    Newton::default().solve_semismooth(&Arctan, &mut x).unwrap();
    assert!(x[0].abs() < 1e-12, "{x:?}");
}

#[test]
fn the_cycling_example_is_a_p_matrix() {
    // Determinants of all selections positive: all principal minors are.
    let lcp = cycling();
    for s in Selections::all(&lcp) {
        let mut jac = Matrix::zeros(lcp.pattern());
        lcp.jacobian(&s, &[0.0; 3], &mut jac);
        let m = |i, j| jac.get(i, j);
        let det = m(0, 0) * (m(1, 1) * m(2, 2) - m(1, 2) * m(2, 1))
            - m(0, 1) * (m(1, 0) * m(2, 2) - m(1, 2) * m(2, 0))
            + m(0, 2) * (m(1, 0) * m(2, 1) - m(1, 1) * m(2, 0));
        assert!(det > 0.0);
    }
}

/// The data that a solver keeps of a map are not reused for another one of the same size with other sites.
#[test]
fn a_solver_goes_from_map_to_map_of_one_size() {
    let smooth = scalar(|x| x * x - 4.0, |x| 2.0 * x);
    let lcp = Lcp::new(vec![vec![2.0]], vec![-1.0]);
    let mut newton = Newton::default();
    for _ in 0..2 {
        let mut x = [5.0];
        newton.solve(&smooth, &mut x).unwrap();
        assert!((x[0] - 2.0).abs() < 1e-14);
        let mut x = [-5.0];
        newton.solve(&lcp, &mut x).unwrap();
        assert_eq!(x, [0.5]);
    }
}

/// What a linearisation tells belongs to the point that it names, which is not that of the last correction:
/// after one correction from (1, 0.5) towards y² + α² = 4 the kernel is still across (1, 0.5). Solutions and
/// signs are those of the same point.
#[test]
fn linearisations_belong_to_the_point_they_name() {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        (a[0], b[0]) = (x[0] * x[0] + x[1] * x[1] - 4.0, 1e9);
    });
    let mut corrector = MoorePenrose::new(&map, AutoSolver::new()).unwrap();
    let guess = [1.0, 0.5];
    let normal = [0.8, 0.6];
    for most in [0, 1, 4] {
        let (mut x, mut t, mut selection) = (guess, normal, Selection::uniform(1, 0));
        let free = (0.0, 0.0);
        let found = corrector.correct(&map, &mut selection, |_, _| {}, &mut x, &mut t, free, most);
        let (correction, mut at) = found.unwrap();
        assert_eq!(correction.iterations, most);
        assert_eq!(at.selection(), &selection);
        let point: [f64; 2] = at.point().unwrap().try_into().unwrap();
        assert_eq!(point == guess, most < 2);
        assert_eq!(x == guess, most == 0);
        // ∇H = 2 point, by differences of H: to 1e-7.
        let across = |v: &[f64]| 2.0 * (point[0] * v[0] + point[1] * v[1]);
        let tangent = at.tangent().to_vec();
        assert!(across(&tangent).abs() < 1e-6, "{tangent:?}");
        assert!((tangent[0].hypot(tangent[1]) - 1.0).abs() < 1e-15);
        for v in [normal, [-1.0, 2.0], [0.3, -0.7]] {
            let det = 2.0 * (point[0] * v[1] - point[1] * v[0]);
            assert_eq!(at.orientation(&v), Some(det.signum() as i8));
            let mut moved = [0.0; 2];
            at.solve(&[3.0], &v, &mut moved).unwrap();
            assert!((across(&moved) - 3.0).abs() < 1e-5 && (v[0] * moved[0] + v[1] * moved[1]).abs() < 1e-12);
        }
        assert_eq!(at.orientation(&[1.0]), None);
        assert_eq!(at.det_sign(), Some(point[0].signum() as i8));
        let size = 2.0 * point[0].hypot(point[1]);
        assert!((at.log_det().unwrap() - size.ln()).abs() < 1e-6);
        assert!(at.rcond().is_some_and(|r| (r - 1.0).abs() < 1e-12));
    }
}

/// Affine pieces have one linearisation at every point; one of another selection is made by replacing rows,
/// and is as right.
#[test]
fn linearisations_of_affine_pieces_belong_to_every_point() {
    let rows = [[2.0, 1.0, -1.0], [0.5, -3.0, 2.0]];
    let f = AffineFunction::new(Matrix::from_rows(&rows).unwrap(), vec![1.0, -1.0]).unwrap();
    let map = Mcp::new(f, vec![0.0; 2], vec![f64::INFINITY; 2]).unwrap();
    let mut corrector = MoorePenrose::new(&map, AutoSolver::with_determinants()).unwrap();
    for pieces in [[0, 0], [0, 1], [1, 1], [1, 0], [0, 0]] {
        let selection = Selection::from_pieces(pieces);
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(&selection, &[0.0; 3], &mut jac);
        let det = jac.get(0, 0) * jac.get(1, 1) - jac.get(0, 1) * jac.get(1, 0);
        let replaced = corrector.updates();
        let mut at = corrector
            .linearize(&map, &selection, &[0.4, 0.3, 0.2], None)
            .unwrap();
        assert_eq!((at.selection(), at.point()), (&selection, None));
        let (tangent, mut product) = (at.tangent().to_vec(), [0.0; 2]);
        jac.mul_vec(&tangent, &mut product);
        assert!(product.iter().all(|p| p.abs() < 1e-14), "{product:?}");
        assert_eq!(at.det_sign(), Some(det.signum() as i8), "{pieces:?}");
        let (last, sign) = (tangent[2], at.orientation(&tangent).unwrap());
        assert_eq!(at.det_sign(), Some(sign * last.signum() as i8));
        // By Cramer's rule: |det ∇_yH| = |α̇| |det [∇H; τᵀ]|.
        assert!((at.log_det().unwrap() + last.abs().ln() - det.abs().ln()).abs() < 1e-12);
        let mut moved = [0.0; 3];
        at.solve(&[1.0, -2.0], &[0.0, 0.0, 1.0], &mut moved).unwrap();
        jac.mul_vec(&moved, &mut product);
        assert!((product[0] - 1.0).abs() + (product[1] + 2.0).abs() + moved[2].abs() < 1e-13);
        let first = corrector
            .linearize(&map, &selection, &[9.0; 3], None)
            .unwrap()
            .tangent()
            == tangent;
        assert!(first && corrector.updates() <= replaced + 1);
    }
    assert_eq!(corrector.factorisations(), 1);
}

/// The circle y² + α² = R² and the line α = 0.6 R meet at y = 0.8 R, whatever the unit of lengths: a last correction has the size of the
/// rounding of R, not of 1/R.
#[test]
fn points_in_a_plane_are_exact_in_any_unit() {
    for radius in [1e-9, 1e-6, 1.0, 1e6] {
        let map = MinMap::curve(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = (x[0] / radius).powi(2) + (x[1] / radius).powi(2) - 1.0;
            b[0] = 1e9;
        });
        let mut corrector = MoorePenrose::new(&map, AutoSolver::new()).unwrap();
        let selection = Selection::uniform(1, 0);
        let (anchor, normal) = ([0.9 * radius, 0.6 * radius], [0.0, 1.0]);
        let (mut x, mut t) = (anchor, [0.0, 1.0]);
        let found = corrector.correct_in_plane(&map, &selection, (&anchor, &normal, 0.0), &mut x, &mut t);
        let missed = (x[0] / radius - 0.8).abs();
        assert!(
            found.unwrap().0.converged && missed < 1e-14,
            "{radius:e} {missed:e}"
        );
    }
}

/// y² + c = 0 has no point in the plane α = 0, however small c: stagnating corrections are no success.
#[test]
fn a_curve_that_misses_the_plane_is_not_met() {
    for c in [1e-4, 1e-7, 1e-9, 1e-11] {
        let map = MinMap::curve(1, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            a[0] = x[0] * x[0] + c;
            b[0] = 1e9;
        });
        let mut corrector = MoorePenrose::new(&map, AutoSolver::new()).unwrap();
        let selection = Selection::uniform(1, 0);
        for start in [1e-1, 1e-3, 1e-5] {
            let (mut x, mut t) = ([start, 0.0], [0.0, 1.0]);
            let plane = ([start, 0.0], [0.0, 1.0]);
            let found =
                corrector.correct_in_plane(&map, &selection, (&plane.0, &plane.1, 0.0), &mut x, &mut t);
            assert!(
                found.is_err() || !found.unwrap().0.converged,
                "{c:e} {start:e} {x:?}"
            );
        }
    }
}

/// In units in which every residual is small, the tolerance of steps controls the distance to the curve y² = α.
#[test]
fn corrections_end_by_their_steps_as_well() {
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = 1e-9 * (x[0] * x[0] - x[1]);
        b[0] = 1e9;
    });
    let mut corrector = MoorePenrose::new(&map, AutoSolver::new()).unwrap();
    for (tolerance, missed) in [(1e-2, 1e-3), (1e-10, 1e-14)] {
        let mut selection = Selection::uniform(1, 0);
        let (mut x, mut t) = ([2.0, 1.0], [0.5, 1.0]);
        let tolerances = (1e-8, tolerance);
        let found = corrector.correct(&map, &mut selection, |_, _| {}, &mut x, &mut t, tolerances, 20);
        let (found, _) = found.unwrap();
        assert!(found.converged && found.step_norm < tolerance, "{found:?}");
        assert!((x[0] * x[0] - x[1]).abs() < missed, "{x:?}");
    }
}

/// y + 20 y² = α for each of this number of y.
struct Parabolas(usize);

impl PiecewiseSmooth for Parabolas {
    one_piece!(self, self.0 + 1, self.0);
    fn residual(&self, _: &Selection, x: &[f64], out: &mut [f64]) {
        let alpha = x[self.0];
        out.iter_mut()
            .zip(x)
            .for_each(|(h, y)| *h = y + 20.0 * y * y - alpha);
    }
    fn jacobian(&self, _: &Selection, x: &[f64], jac: &mut Matrix) {
        for (i, y) in x[..self.0].iter().enumerate() {
            jac.add(i, i, 1.0 + 40.0 * y);
            jac.add(i, self.0, -1.0);
        }
    }
}

/// Corrections continue with the first factors, count as those of Newton's method, and end with the tangent at the point.
#[test]
fn large_corrections_go_on_by_chords() {
    let n = 201;
    let map = Parabolas(n);
    let mut corrector = MoorePenrose::new(&map, AutoSolver::new()).unwrap();
    let mut selection = Selection::default();
    let mut x = vec![0.0; n + 1];
    let mut t = corrector
        .linearize(&map, &selection, &x, None)
        .unwrap()
        .tangent()
        .to_vec();
    let along = t[n].signum();
    x.iter_mut().zip(&mut t).for_each(|(x, t)| {
        *t *= along;
        *x += *t;
    });
    let before = corrector.factorisations();
    let tolerances = (1e-9, 1e-9);
    let found = corrector.correct(&map, &mut selection, |_, _| {}, &mut x, &mut t, tolerances, 20);
    let (found, _) = found.unwrap();
    assert!(found.converged);
    assert_eq!((found.iterations, corrector.factorisations() - before), (3, 1));
    for y in &x[..n] {
        assert!((y + 20.0 * y * y - x[n]).abs() < 1e-12);
    }
    let there = corrector.linearize(&map, &selection, &x, Some(&t)).unwrap();
    let sign = there.tangent()[n].signum();
    assert!(
        there
            .tangent()
            .iter()
            .zip(&t)
            .all(|(a, b)| (sign * a - b).abs() < 1e-12)
    );
}
