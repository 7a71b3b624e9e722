use proptest::prelude::*;
use semismooth::complementarity::{AffineFunction, FischerBurmeister, Mcp, McpFunction, WithJacobian};
use semismooth::piecewise::{Semismooth, check};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use crate::random::Random;
use crate::support::{INF, matrix, residual, solve};

/// Whether 0 ≤ x ⟂ M x + q ≥ 0 has a solution, by trying all 2ⁿ active sets (nondegenerate M).
fn enumerate(rows: &[Vec<f64>], q: &[f64]) -> Vec<Vec<f64>> {
    let n = q.len();
    let mut found = Vec::new();
    for set in 0..1_u32 << n {
        let free: Vec<usize> = (0..n).filter(|i| set >> i & 1 == 1).collect();
        let Some(part) = eliminate(rows, q, &free) else {
            continue;
        };
        let mut x = vec![0.0; n];
        for (k, &i) in free.iter().enumerate() {
            x[i] = part[k];
        }
        let fits = (0..n).all(|i| {
            let f = q[i] + rows[i].iter().zip(&x).map(|(m, x)| m * x).sum::<f64>();
            x[i] >= -1e-9 && f >= -1e-9
        });
        if fits {
            found.push(x);
        }
    }
    found
}

fn eliminate(rows: &[Vec<f64>], q: &[f64], free: &[usize]) -> Option<Vec<f64>> {
    let k = free.len();
    let mut a: Vec<Vec<f64>> = free
        .iter()
        .map(|&i| free.iter().map(|&j| rows[i][j]).chain([-q[i]]).collect())
        .collect();
    for c in 0..k {
        let p = (c..k).max_by(|&p, &r| a[p][c].abs().total_cmp(&a[r][c].abs()))?;
        if a[p][c].abs() < 1e-9 {
            return None;
        }
        a.swap(c, p);
        for r in 0..k {
            if r != c {
                let factor = a[r][c] / a[c][c];
                for j in c..=k {
                    a[r][j] -= factor * a[c][j];
                }
            }
        }
    }
    Some((0..k).map(|c| a[c][k] / a[c][c]).collect())
}

fn lcp(rows: &[Vec<f64>], q: &[f64]) -> Mcp<AffineFunction> {
    Mcp::affine(matrix(rows), q.to_vec(), vec![0.0; q.len()], vec![INF; q.len()]).unwrap()
}

/// A cubic perturbation of an affine map whose solution is known, with every kind of bound.
pub(crate) struct Known {
    rows: Vec<Vec<f64>>,
    shift: Vec<f64>,
    cubic: Vec<f64>,
}

impl McpFunction for Known {
    fn num_vars(&self) -> usize {
        self.rows.len()
    }
    fn value(&self, x: &[f64], out: &mut [f64]) {
        for i in 0..x.len() {
            let linear: f64 = self.rows[i].iter().zip(x).map(|(m, x)| m * x).sum();
            out[i] = linear + self.cubic[i] * x[i].powi(3) + self.shift[i];
        }
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        for i in 0..x.len() {
            for j in 0..x.len() {
                jac.add(i, j, self.rows[i][j]);
            }
            jac.add(i, i, 3.0 * self.cubic[i] * x[i] * x[i]);
        }
    }
}

/// A monotone problem with the solution from which it was built.
pub(crate) fn known(seed: u64, n: usize) -> (Mcp<Known>, Vec<f64>) {
    let mut rng = Random::new(seed);
    let b = rng.square(n);
    let s = rng.square(n);
    let rows: Vec<Vec<f64>> = (0..n)
        .map(|i| {
            (0..n)
                .map(|j| {
                    let psd: f64 = (0..n).map(|k| b[i][k] * b[j][k]).sum();
                    psd + s[i][j] - s[j][i] + 0.1 * f64::from(u8::from(i == j))
                })
                .collect()
        })
        .collect();
    let (mut lower, mut upper, mut x, mut target) = (vec![], vec![], vec![], vec![]);
    for i in 0..n {
        let (a, w) = (rng.symmetric() * 2.0, 0.5 + (rng.symmetric() + 1.0));
        let (l, u) = [(a, INF), (-INF, a + w), (a, a + w), (-INF, INF), (a, a)][i % 5];
        // At a bound (strictly or not), or between.
        let (value, f) = match (rng.symmetric() > 0.0, l.is_finite(), u.is_finite()) {
            (_, true, true) if l == u => (l, rng.symmetric()),
            (true, true, _) => (l, rng.symmetric().max(0.0)),
            (_, _, true) => (u, rng.symmetric().min(0.0)),
            (false, true, false) => (l + w / 2.0, 0.0),
            _ => (a, 0.0),
        };
        lower.push(l);
        upper.push(u);
        x.push(value);
        target.push(f);
    }
    let cubic: Vec<f64> = (0..n).map(|_| (rng.symmetric() + 1.0) * 0.5).collect();
    let mut function = Known {
        rows,
        cubic,
        shift: vec![0.0; n],
    };
    let mut f = vec![0.0; n];
    function.value(&x, &mut f);
    function.shift = target.iter().zip(&f).map(|(t, f)| t - f).collect();
    (Mcp::new(function, lower, upper).unwrap(), x)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn p_matrix_problems_have_the_enumerated_solution(seed in 1_u64.., n in 1_usize..7, far in 0.0..1e3) {
        let mut rng = Random::new(seed);
        // Diagonally dominant rows with a positive diagonal: a P-matrix.
        let mut rows = rng.square(n);
        for i in 0..n {
            rows[i][i] = 0.1 + rows[i].iter().map(|v| v.abs()).sum::<f64>();
        }
        let q: Vec<f64> = (0..n).map(|_| 3.0 * rng.symmetric()).collect();
        let all = enumerate(&rows, &q);
        prop_assert!(!all.is_empty());
        let (x, report) = solve(&lcp(&rows, &q), &vec![far; n]);
        prop_assert!(report.is_solved(), "{:?}", report.status);
        for (x, y) in x.iter().zip(&all[0]) {
            prop_assert!((x - y).abs() < 1e-7);
        }
    }

    #[test]
    fn positive_semidefinite_problems_are_solved_exactly_if_feasible(seed in 1_u64.., n in 2_usize..7, rank in 1_usize..4) {
        let mut rng = Random::new(seed);
        // Products of numbers with few digits are exact: M has the intended rank, and no distant solution by rounding.
        let b: Vec<Vec<f64>> = rng.square(n).iter().map(|r| r.iter().map(|v| (v * 1024.0).round() / 1024.0).collect()).collect();
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| (0..n).map(|j| (0..rank.min(n)).map(|k| b[i][k] * b[j][k]).sum()).collect())
            .collect();
        let q: Vec<f64> = (0..n).map(|_| rng.symmetric()).collect();
        // Solvable exactly if feasible; a solution exists at a regular active set then, which enumeration finds.
        let solvable = !enumerate(&rows, &q).is_empty();
        let (_, report) = solve(&lcp(&rows, &q), &vec![1.0; n]);
        prop_assert_eq!(report.is_solved(), solvable, "{:?}", report.status);
        if !solvable {
            prop_assert_eq!(report.status, Status::NoSolution);
        }
    }

    #[test]
    fn arbitrary_small_problems_are_never_claimed_wrongly(seed in 1_u64.., n in 1_usize..6, start in -10.0..10.0) {
        let mut rng = Random::new(seed);
        let rows = rng.square(n);
        let q: Vec<f64> = (0..n).map(|_| rng.symmetric()).collect();
        let solvable = !enumerate(&rows, &q).is_empty();
        let (x, report) = solve(&lcp(&rows, &q), &vec![start; n]);
        prop_assert!(!report.is_solved() || solvable, "{:?} claimed", x);
        prop_assert!(report.is_solved() || !solvable, "missed: {:?}", report.status);
    }

    #[test]
    fn copositive_problems_with_nonnegative_entries_are_solved(seed in 1_u64.., n in 1_usize..7) {
        // M > 0 is strictly copositive: a solution exists for every q.
        let mut rng = Random::new(seed);
        let rows: Vec<Vec<f64>> = rng.square(n).iter().map(|r| r.iter().map(|v| v.abs() + 0.01).collect()).collect();
        let q: Vec<f64> = (0..n).map(|_| 2.0 * rng.symmetric()).collect();
        let (_, report) = solve(&lcp(&rows, &q), &vec![0.0; n]);
        prop_assert!(report.is_solved(), "{:?}", report.status);
    }

    #[test]
    fn constructed_solutions_are_found(seed in 1_u64.., n in 1_usize..12, start in -20.0..20.0) {
        let (problem, exact) = known(seed, n);
        prop_assert!(residual(&problem, &exact) < 1e-10);
        let (x, report) = solve(&problem, &vec![start; n]);
        prop_assert!(report.is_solved(), "{:?}", report.status);
        // Strongly monotone: the solution is unique.
        for (x, y) in x.iter().zip(&exact) {
            prop_assert!((x - y).abs() < 1e-7);
        }
    }

    #[test]
    fn permuting_and_scaling_do_not_matter(seed in 1_u64.., n in 2_usize..8, decades in -4_i32..5) {
        let (problem, exact) = known(seed, n);
        let f = problem.function();
        // y_i = x_{p(i)} / c_i, G_i = r_i F_{p(i)}.
        let p = |i: usize| (i + 1) % n;
        let c = |i: usize| 10_f64.powi((i as i32 * 3 + seed as i32 % 5) % 7 - 3);
        let r = |i: usize| 10_f64.powi(decades * (i as i32 % 2));
        let point = |y: &[f64]| {
            let mut x = vec![0.0; n];
            (0..n).for_each(|i| x[p(i)] = y[i] * c(i));
            x
        };
        let scaled = WithJacobian::new(
            n,
            |y: &[f64], out: &mut [f64]| {
                let mut v = vec![0.0; n];
                f.value(&point(y), &mut v);
                (0..n).for_each(|i| out[i] = r(i) * v[p(i)]);
            },
            |y: &[f64], jac: &mut Matrix| {
                let mut full = Matrix::zeros(f.pattern());
                f.jacobian(&point(y), &mut full);
                for i in 0..n {
                    for j in 0..n {
                        jac.add(i, j, r(i) * full.get(p(i), p(j)) * c(j));
                    }
                }
            },
        );
        let bound = |b: &[f64]| (0..n).map(|i| b[p(i)] / c(i)).collect::<Vec<f64>>();
        let other = Mcp::new(scaled, bound(problem.lower()), bound(problem.upper())).unwrap();
        let mut y: Vec<f64> = (0..n).map(|i| (exact[p(i)] + 3.0) / c(i)).collect();
        let mut solver = semismooth::complementarity::McpSolver::default();
        let report = solver.solve(&other, &mut y).unwrap();
        prop_assert!(report.is_solved(), "{:?}", report.status);
        for (x, e) in point(&y).iter().zip(&exact) {
            prop_assert!((x - e).abs() < 1e-5, "{x} {e}");
        }
    }

    #[test]
    fn fischer_burmeister_and_natural_residual_vanish_together(seed in 1_u64.., n in 1_usize..12, off in 1e-6..1.0) {
        let (problem, exact) = known(seed, n);
        let fb = FischerBurmeister::new(&problem).unwrap();
        let norms = |x: &[f64]| {
            let mut phi = vec![0.0; n];
            fb.residual(x, &mut phi);
            (phi.iter().fold(0.0_f64, |m, v| m.max(v.abs())), residual(&problem, x))
        };
        let (a, b) = norms(&exact);
        prop_assert!(a < 1e-9 && b < 1e-9);
        // (2 − √2)|min(a, b)| ≤ |φ(a, b)| ≤ (2 + √2)|min(a, b)| (Tseng 1996); twice in a row for two bounds.
        let moved: Vec<f64> = exact.iter().enumerate().map(|(i, x)| x + off * ((i as f64) * 1.7).sin()).collect();
        let (a, b) = norms(&moved);
        prop_assert!(a >= 0.3 * b - 1e-9 && a <= 12.0 * b + 1e-9, "{a} {b}");
    }

    #[test]
    fn natural_maps_keep_the_contract(seed in 1_u64.., n in 1_usize..7) {
        let (problem, exact) = known(seed, n);
        let mut rng = Random::new(seed);
        let points: Vec<Vec<f64>> = (0..4).map(|_| exact.iter().map(|x| x + rng.symmetric()).collect()).collect();
        let options = check::CheckOptions::default();
        prop_assert!(check::check(&problem, &points, &options).is_ok());
    }
}

/// The mirrored problem: z = −x, G(z) = −F(−z), bounds −u, −l.
pub(crate) struct Mirrored<F>(F);

impl<F: McpFunction> McpFunction for Mirrored<F> {
    fn num_vars(&self) -> usize {
        self.0.num_vars()
    }
    fn value(&self, x: &[f64], out: &mut [f64]) {
        let y: Vec<f64> = x.iter().map(|v| -v).collect();
        self.0.value(&y, out);
        out.iter_mut().for_each(|v| *v = -*v);
    }
    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        let y: Vec<f64> = x.iter().map(|v| -v).collect();
        self.0.jacobian(&y, jac);
    }
}

pub(crate) fn mirrored<F: McpFunction>(function: F, problem: &Mcp<impl McpFunction>) -> Mcp<Mirrored<F>> {
    let turn = |v: &[f64]| v.iter().map(|v| -v).collect::<Vec<_>>();
    Mcp::new(Mirrored(function), turn(problem.upper()), turn(problem.lower())).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Monotone problems with every kind of bound, both small and large enough for sparse and blocked linear solves: upper bounds only are
    /// lower bounds only in the mirrored problem.
    #[test]
    fn mirrored_problems_have_mirrored_solutions(seed in 1_u64.., n in prop::sample::select(vec![3_usize, 7, 45, 130]), far in -30.0..30.0) {
        let (problem, expected) = known(seed, n);
        let (again, _) = known(seed, n);
        let other = mirrored(again.function(), &problem);
        let (x, report) = solve(&problem, &vec![far; n]);
        let (z, turned) = solve(&other, &vec![-far; n]);
        prop_assert!(report.is_solved() && turned.is_solved(), "{:?} {:?}", report.status, turned.status);
        for i in 0..n {
            prop_assert!((x[i] - expected[i]).abs() < 1e-6, "{} {}", x[i], expected[i]);
            prop_assert!((z[i] + expected[i]).abs() < 1e-6, "{} {}", z[i], expected[i]);
        }
    }
}

/// Problems that Newton's method alone does not solve, with upper bounds only and mirrored.
#[test]
fn hard_problems_bounded_above() {
    // 0 ≤ x ⟂ F ≥ 0 with F from logarithms that start near the edge of their domain, and a cubic whose derivative changes sign.
    let logarithm = || crate::support::scalar(|x| (3.0 + x).ln() - 1.0, |x| 1.0 / (3.0 + x));
    let cubic = || {
        WithJacobian::new(
            2,
            |x: &[f64], out: &mut [f64]| {
                out[0] = x[0] * x[0] * x[0] - 3.0 * x[0] + x[1] - 1.0;
                out[1] = x[1] - 0.5 * x[0] + 0.25;
            },
            |x: &[f64], jac: &mut Matrix| {
                jac.add(0, 0, 3.0 * x[0] * x[0] - 3.0);
                jac.add(0, 1, 1.0);
                jac.add(1, 0, -0.5);
                jac.add(1, 1, 1.0);
            },
        )
    };
    for start in [-2.9, 0.0, 50.0] {
        let below = Mcp::new(logarithm(), vec![-2.999], vec![INF]).unwrap();
        let above = mirrored(logarithm(), &below);
        let e = std::f64::consts::E;
        let (x, report) = solve(&below, &[start]);
        let (z, turned) = solve(&above, &[-start]);
        assert!(report.is_solved() && turned.is_solved());
        assert!((x[0] - (e - 3.0)).abs() < 1e-8 && (z[0] + (e - 3.0)).abs() < 1e-8);
    }
    for start in [[0.0, 0.0], [1.0, 1.0], [-1.0, 4.0], [0.9, -8.0]] {
        let below = Mcp::new(cubic(), vec![0.0; 2], vec![INF; 2]).unwrap();
        let above = mirrored(cubic(), &below);
        let (_, report) = solve(&below, &start);
        let (_, turned) = solve(&above, &start.map(|v| -v));
        assert!(report.is_solved(), "{start:?} {:?}", report.status);
        assert!(turned.is_solved(), "{start:?} {:?}", turned.status);
    }
}
