//! "Solved" means a small residual at the point returned, relative to the terms of its rows, in all units.

use std::path::Path;

use proptest::prelude::*;
use semismooth::complementarity::{
    Autodiff, Mcp, McpFunction, McpOptions, McpReport, McpSolver, WithJacobian,
};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, Pattern};

use crate::expressions::read;
use crate::globalisation::Hs71;
use crate::properties::known;
use crate::random::Random;
use crate::support::{INF, matrix, scalar};

/// G(y) = R F(C y).
struct Scaled<F> {
    inner: F,
    row: Vec<f64>,
    col: Vec<f64>,
}

impl<F: McpFunction> Scaled<F> {
    fn point(&self, y: &[f64]) -> Vec<f64> {
        y.iter().zip(&self.col).map(|(y, c)| y * c).collect()
    }
}

impl<F: McpFunction> McpFunction for Scaled<F> {
    fn num_vars(&self) -> usize {
        self.inner.num_vars()
    }
    fn value(&self, y: &[f64], out: &mut [f64]) {
        self.inner.value(&self.point(y), out);
        out.iter_mut().zip(&self.row).for_each(|(f, r)| *f *= r);
    }
    fn jacobian(&self, y: &[f64], jac: &mut Matrix) {
        let mut own = Matrix::zeros(jac.pattern().clone());
        self.inner.jacobian(&self.point(y), &mut own);
        for (i, j, v) in own.triplets().filter(|t| t.2 != 0.0) {
            jac.add(i, j, self.row[i] * v * self.col[j]);
        }
    }
    fn pattern(&self) -> Pattern {
        self.inner.pattern()
    }
    fn is_affine(&self) -> bool {
        self.inner.is_affine()
    }
}

fn scaled<'a, F: McpFunction>(problem: &'a Mcp<F>, row: &[f64], col: &[f64]) -> Mcp<Scaled<&'a F>> {
    let bounds = |b: &[f64]| b.iter().zip(col).map(|(b, c)| b / c).collect::<Vec<_>>();
    let function = Scaled {
        inner: problem.function(),
        row: row.to_vec(),
        col: col.to_vec(),
    };
    Mcp::new(function, bounds(problem.lower()), bounds(problem.upper())).unwrap()
}

/// The largest error relative to the terms of rows, by definition; without directions to infinity.
fn error<F: McpFunction>(problem: &Mcp<F>, x: &[f64]) -> f64 {
    let n = x.len();
    let (mut f, mut jac) = (vec![0.0; n], Matrix::zeros(problem.jacobian_pattern().clone()));
    problem.function().value(x, &mut f);
    problem.function().jacobian(x, &mut jac);
    let terms: Vec<f64> = (0..n)
        .map(|i| {
            let products = (0..n).map(|j| jac.get(i, j) * x[j]);
            let (sum, size) = products.fold((0.0, 0.0), |(s, t), p| (s + p, t + p.abs()));
            size + (f[i] - sum).abs()
        })
        .collect();
    let part = |a: f64, b: f64| if a == 0.0 { 0.0 } else { a / b };
    let errors = (0..n).map(|i| {
        let (l, u) = (problem.lower()[i], problem.upper()[i]);
        assert!(l <= x[i] && x[i] <= u);
        if l == u || (x[i] == l && f[i] >= 0.0) || (x[i] == u && f[i] <= 0.0) {
            return 0.0;
        }
        part(f[i].abs(), terms[i])
    });
    errors.fold(0.0, f64::max)
}

fn run<F: McpFunction>(problem: &Mcp<F>, start: &[f64]) -> (Vec<f64>, McpReport) {
    let mut x = start.to_vec();
    let report = McpSolver::default().solve(problem, &mut x).unwrap().clone();
    if report.is_solved() {
        let e = error(problem, &x);
        // 1e-8 is the tolerance where no strategy reaches 1e-10.
        assert!(e <= 1e-8, "claimed with error {e:e} at {x:?}");
        assert!((report.error - e).abs() <= 1e-12, "{:e} {e:e}", report.error);
    }
    (x, report)
}

#[test]
fn an_infeasible_row_is_infeasible_in_all_units() {
    // c (1 + x) ≥ 0 with c < 0 and x ≥ 0: affine, a black box, and next to a row with huge terms.
    for c in [-1.0, -1e-8, -1e-12, -1e-30, -1e12] {
        let affine = Mcp::affine(matrix(&[vec![c]]), vec![c], vec![0.0], vec![INF]).unwrap();
        assert_eq!(run(&affine, &[1.0]).1.status, Status::NoSolution, "{c:e}");
        let box_ = Mcp::ncp(scalar(move |x| c * (1.0 + x), move |_| c)).unwrap();
        for start in [0.0, 1.0, 1e6] {
            let (x, report) = run(&box_, &[start]);
            assert!(!report.is_solved() && report.error >= 0.5, "{c:e} at {x:?}");
        }
        let rows = [vec![1.0, 0.0], vec![0.0, c]];
        let two = Mcp::affine(matrix(&rows), vec![-1e14, c], vec![0.0; 2], vec![INF; 2]).unwrap();
        assert!(!run(&two, &[0.0; 2]).1.is_solved(), "{c:e}");
    }
}

/// A bound of 2⁶⁴ on a multiplier: the terms are 1e19, so that a residual of 65 536 is their rounding. The constraint Σ xᵢ² = 40 and the
/// symmetry of what is left determine the unknowns, and the equations are regular there: each start leads to xᵢ = √10 with the other multiplier
/// −5·2⁶⁴ (from 10 √10 λ₁ + 2 √10 λ₂ = 0), whatever the residual says.
#[test]
fn beside_huge_terms_a_solution_is_one_row_by_row() {
    let lower = vec![1.0, 1.0, 1.0, 1.0, 2.0_f64.powi(64), -INF];
    let upper = vec![5.0, 5.0, 5.0, 5.0, INF, INF];
    let problem = Mcp::new(Autodiff::new(Hs71), lower, upper).unwrap();
    for start in [[0.0; 6], [1.0; 6], [10.0; 6], [5.0; 6]] {
        let (x, report) = run(&problem, &start);
        assert!(report.is_solved(), "{start:?}: {:?}", report.status);
        for x in &x[..4] {
            assert!((x - 10.0_f64.sqrt()).abs() <= 1e-13, "{start:?}: {x}");
        }
        assert!(
            x[4] == 2.0_f64.powi(64) && (x[5] / 2.0_f64.powi(64) + 5.0).abs() <= 1e-10,
            "{start:?}: {x:?}"
        );
    }
}

#[test]
fn residuals_along_a_direction_of_no_change_are_not_rounding() {
    // x − y + 1 = 0 and y − x = 0: far out, the residual 1 is an arbitrarily small fraction of the terms.
    let f = WithJacobian::new(
        2,
        |x: &[f64], out: &mut [f64]| {
            out[0] = x[0] - x[1] + 1.0;
            out[1] = x[1] - x[0];
        },
        |_: &[f64], jac: &mut Matrix| {
            for (i, j, v) in [(0, 0, 1.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)] {
                jac.add(i, j, v);
            }
        },
    );
    let problem = Mcp::equations(f).unwrap();
    for far in [0.0, 1e9, 1e11, 1e13, 1e15, 1e17, 1e20] {
        let (x, report) = run(&problem, &[far, far]);
        assert!(!report.is_solved(), "{far:e}: {x:?}");
    }
    // The same beside z − 1 = 0, whose constant is large.
    let rows = [[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let problem = Mcp::affine(
        matrix(&rows.map(Vec::from)),
        vec![1.0, 0.0, -1.0],
        vec![-INF; 3],
        vec![INF; 3],
    );
    let problem = problem.unwrap();
    for far in [0.0, 1e9, 1e11, 1e13] {
        let (x, report) = run(&problem, &[far, far, 1.0]);
        assert!(!report.is_solved(), "{far:e}: {x:?}");
    }
}

/// The search for the kernel of a Jacobian with entries of 1e19 and 1 must not end in NaN.
#[test]
fn jacobians_of_all_sizes_do_not_panic() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/mcp_extreme/thun5lo.json");
    let problem = read(&path).unwrap();
    let start = &problem.starts[0].1;
    let options = McpOptions::default().with_restarts(0);
    let status = McpSolver::new(options)
        .solve(&problem.mcp, &mut start.clone())
        .map(|r| r.status);
    assert_ne!(status, Ok(Status::Solved));
}

/// Random affine problems, many of them without solution, by trying all active sets.
fn arbitrary(seed: u64, n: usize) -> Mcp<impl McpFunction> {
    let mut rng = Random::new(seed);
    let rows = rng.square(n);
    let q = (0..n).map(|_| rng.symmetric()).collect();
    Mcp::affine(matrix(&rows), q, vec![0.0; n], vec![INF; n]).unwrap()
}

/// Powers of ten, up to ±12 for rows and ±3 for unknowns.
fn units(seed: u64, n: usize) -> (Vec<f64>, Vec<f64>) {
    let mut rng = Random::new(seed ^ 0x5555);
    let mut power = |most: f64| 10_f64.powi((most * rng.symmetric()).round() as i32);
    (0..n).map(|_| (power(12.0), power(3.0))).unzip()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn units_do_not_decide_what_is_solved(seed in 1_u64.., n in 1_usize..6) {
        let (row, col) = units(seed, n);
        let problem = arbitrary(seed, n);
        let start = vec![1.0; n];
        let scaled_start: Vec<f64> = col.iter().map(|c| 1.0 / c).collect();
        let (_, plain) = run(&problem, &start);
        for (row, col, start) in [
            (vec![1e12; n], vec![1.0; n], start.clone()),
            (vec![1e-12; n], vec![1.0; n], start.clone()),
            (row.clone(), vec![1.0; n], start.clone()),
            (row, col, scaled_start),
        ] {
            let (_, other) = run(&scaled(&problem, &row, &col), &start);
            prop_assert_eq!(plain.is_solved(), other.is_solved(), "{:?} {:?} in {:?} {:?}", plain.status, other.status, row, col);
        }
    }

    #[test]
    fn nonlinear_problems_are_solved_in_all_units(seed in 1_u64.., n in 1_usize..12, off in -3.0..3.0) {
        let (problem, exact) = known(seed, n);
        let (row, col) = units(seed, n);
        let other = scaled(&problem, &row, &col);
        let start: Vec<f64> = exact.iter().zip(&col).map(|(x, c)| (x + off) / c).collect();
        let (y, report) = run(&other, &start);
        prop_assert!(report.is_solved(), "{:?}", report.status);
        for ((y, c), x) in y.iter().zip(&col).zip(&exact) {
            prop_assert!((y * c - x).abs() < 1e-6, "{} {x}", y * c);
        }
    }
}

#[test]
fn the_corpus_is_solved_in_all_units() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/complementarity");
    for file in std::fs::read_dir(folder).unwrap() {
        let problem = read(&file.unwrap().path()).unwrap();
        let n = problem.mcp.len();
        let ones = vec![1.0; n];
        let (row, _) = units(n as u64, n);
        for (label, start) in &problem.starts {
            for row in [&vec![1e12; n], &vec![1e-12; n], &row] {
                let (_, report) = run(&scaled(&problem.mcp, row, &ones), start);
                assert!(
                    report.is_solved(),
                    "{} {label}: {:?}",
                    problem.name,
                    report.status
                );
            }
        }
    }
}

/// Near a singularity F is determined by the last digits of x: large terms there say nothing about a solution elsewhere.
#[test]
fn no_point_beside_a_singularity_is_a_solution() {
    fn is_solved<F: McpFunction>(function: F, start: f64, solution: f64) -> bool {
        let mut x = [start];
        let problem = Mcp::equations(function).unwrap();
        let report = McpSolver::default().solve(&problem, &mut x).unwrap().clone();
        assert!(
            !report.is_solved() || (x[0] - solution).abs() < 1e-9,
            "from {start}: {x:?}"
        );
        report.is_solved()
    }
    let mut solved = 0;
    for unit in [1.0, 1e-20, 1e20] {
        for exponent in 10..=14 {
            let apart = 10_f64.powi(-exponent);
            let logarithm = scalar(|x| unit * ((x + 2.0).ln() - 1.0), |x| unit / (x + 2.0));
            solved += usize::from(is_solved(logarithm, apart - 2.0, 1_f64.exp() - 2.0));
            let pole = scalar(|x| unit * (5.0 - 1.0 / (2.0 - x)), |x| -unit / (2.0 - x).powi(2));
            solved += usize::from(is_solved(pole, 2.0 - apart, 1.8));
        }
    }
    assert!(solved > 0);
}

/// x − y + 1 = 0 and y − x = 0 contradict each other: far out, where the constants are less than the rounding of the terms, that and no more
/// is said. With the right-hand sides −1 and 1 they agree, and from the same starts a solution is found.
#[test]
fn a_contradiction_far_out_is_at_rounding() {
    for (right, is_solvable) in [([1.0, 0.0], false), ([-1.0, 1.0], true)] {
        let f = WithJacobian::new(
            2,
            move |x: &[f64], out: &mut [f64]| {
                out[0] = x[0] - x[1] + right[0];
                out[1] = x[1] - x[0] + right[1];
            },
            |_: &[f64], jac: &mut Matrix| {
                for (i, j, v) in [(0, 0, 1.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)] {
                    jac.add(i, j, v);
                }
            },
        );
        let problem = Mcp::equations(f).unwrap();
        for far in [1e16, 1e17, 1e20] {
            let (x, report) = run(&problem, &[3.0 * far, far]);
            if is_solvable {
                assert!(
                    report.is_solved() && (x[0] - x[1] - 1.0).abs() < 1e-9,
                    "{far:e}: {x:?}"
                );
            } else {
                assert_eq!(report.status, Status::AtRounding, "{far:e}: {x:?}");
                assert_eq!(report.status.name(), "at rounding");
            }
        }
    }
}

/// ln y/16 = 0 with y ≤ 1/16, beside an unknown of ordinary size: there is no solution, and none near y = 0, where the row's derivative is
/// huge, its terms small beside that, and its residual of order one.
#[test]
fn logarithms_near_minus_infinity_are_no_zeros() {
    for (start, scale) in [(1e-300, 1.0), (1e-200, 16.0), (1e-50, 1e6), (0.01, 1.0)] {
        let function = WithJacobian::new(
            2,
            move |x: &[f64], out: &mut [f64]| {
                out[0] = x[0] - scale;
                out[1] = x[1].ln() / 16.0;
            },
            |x: &[f64], jac: &mut Matrix| {
                jac.add(0, 0, 1.0);
                jac.add(1, 1, 1.0 / (16.0 * x[1]));
                jac.add(1, 0, 0.0);
            },
        );
        let problem = Mcp::new(function, vec![-INF; 2], vec![INF, 1.0 / 16.0]).unwrap();
        let free = |x: &[f64]| x[1] < 1.0 / 16.0;
        let mut x = [0.0, start];
        let mut solver = McpSolver::default();
        let report = solver.solve(&problem, &mut x).unwrap();
        assert!(!(report.is_solved() && free(&x)), "{start:e}: {report} at {x:?}");
    }
}

/// The same row beside others that are coupled, whose unknowns are of order ten: random bytes made this problem, and a point with a residual
/// of 30 was called solved. It has no solution, since ln x₃ = 0 needs x₃ = 1.
#[test]
fn coupled_rows_do_not_excuse_logarithms() {
    let linear = [
        [-8.0, 6.75, -7.6875, 0.0],
        [7.875, 5.5625, -4.9375, 0.0],
        [0.0; 4],
        [0.3125, 0.0, 0.0, 0.0],
    ];
    let function = WithJacobian::new(
        4,
        move |x: &[f64], out: &mut [f64]| {
            for (out, row) in out.iter_mut().zip(&linear) {
                *out = row.iter().zip(x).map(|(a, x)| a * x).sum();
            }
            out[0] += 0.6875 + 0.0625 * x[1].exp();
            out[1] += 0.125 * x[2].ln();
            out[2] += 0.0625 * x[3].ln();
            out[3] -= 8.0 / x[0];
        },
        move |x: &[f64], jac: &mut Matrix| {
            for (i, row) in linear.iter().enumerate() {
                row.iter().enumerate().for_each(|(j, a)| jac.add(i, j, *a));
            }
            jac.add(0, 1, 0.0625 * x[1].exp());
            jac.add(1, 2, 0.125 / x[2]);
            jac.add(2, 3, 0.0625 / x[3]);
            jac.add(3, 0, 8.0 / (x[0] * x[0]));
        },
    );
    let (lower, upper) = (vec![0.0, 0.0, -INF, -INF], vec![INF, INF, INF, 1.0 / 16.0]);
    let problem = Mcp::new(function, lower, upper).unwrap();
    let mut x = [0.0, 2.625, 6.4375, 1e-300];
    let mut solver = McpSolver::new(McpOptions::default().with_max_iterations(2000));
    let report = solver.solve(&problem, &mut x).unwrap();
    assert!(!report.is_solved() && report.error > 1e-3, "{report} at {x:?}");
}
