//! Variational inequalities over polyhedra: projections, certificates, solutions checked by definition.

mod projections;
#[path = "../common/random.rs"]
mod random;

use proptest::prelude::*;
use random::Random;
use semismooth::complementarity::{
    AffineFunction, Mcp, McpFunction, McpOptions, McpSolver, McpStrategy, NormalMap, WithJacobian,
};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::enumeration::{Completeness, EnumerationOptions};
use semismooth::newton::Newton;
use semismooth::piecewise::check::{CheckOptions, check};
use semismooth::run::Status;
use semismooth::sparse::Matrix;
use semismooth::variational::{
    Infeasibility, Multipliers, Polyhedron, Projection, Vi, ViSolutions, ViSolver,
};

const INF: f64 = f64::INFINITY;

fn matrix(rows: &[Vec<f64>], n: usize) -> Matrix {
    match rows.is_empty() {
        true => Matrix::from_triplets(0, n, &[]).unwrap(),
        false => Matrix::from_rows(rows).unwrap(),
    }
}

/// Data of a polyhedron, kept to check its claims.
#[derive(Debug, Clone)]
struct Data {
    a: Vec<Vec<f64>>,
    b: Vec<f64>,
    e: Vec<Vec<f64>>,
    d: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl Data {
    fn set(&self) -> Polyhedron {
        let n = self.lower.len();
        Polyhedron::boxed(self.lower.clone(), self.upper.clone())
            .unwrap()
            .with_inequalities(matrix(&self.a, n), self.b.clone())
            .unwrap()
            .with_equations(matrix(&self.e, n), self.d.clone())
            .unwrap()
    }

    /// Aᵀy + Eᵀw − ρₗ + ρᵤ.
    fn combination(&self, m: &Multipliers) -> Vec<f64> {
        let n = self.lower.len();
        let part =
            |rows: &[Vec<f64>], y: &[f64], j: usize| rows.iter().zip(y).map(|(r, y)| r[j] * y).sum::<f64>();
        (0..n)
            .map(|j| {
                part(&self.a, &m.inequalities, j) + part(&self.e, &m.equations, j) - m.lower[j] + m.upper[j]
            })
            .collect()
    }

    fn proves_empty(&self, c: &Infeasibility) -> bool {
        let m = &c.multipliers;
        let product = |b: &[f64], y: &[f64]| {
            b.iter()
                .zip(y)
                .filter(|p| *p.1 != 0.0)
                .map(|(b, y)| b * y)
                .sum::<f64>()
        };
        let value = product(&self.b, &m.inequalities) + product(&self.d, &m.equations)
            - product(&self.lower, &m.lower)
            + product(&self.upper, &m.upper);
        let signs = [&m.inequalities, &m.lower, &m.upper];
        value < 0.0
            && signs.iter().all(|v| v.iter().all(|v| *v >= 0.0))
            && self
                .combination(m)
                .iter()
                .all(|r| r.abs() <= 1e-10 * (1.0 - value))
    }
}

/// All solutions of an affine problem, proven complete.
fn complete_list(f: AffineFunction, set: Polyhedron) -> ViSolutions {
    let list = Vi::new(f, set)
        .unwrap()
        .all_solutions(&EnumerationOptions::default())
        .unwrap();
    assert_eq!(list.completeness, Completeness::Complete);
    list
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Small integers, so that constraints are often linearly dependent and vertices degenerate.
fn polyhedra(n: usize) -> impl Strategy<Value = Data> {
    let entry = || (-2..=2_i8).prop_map(f64::from);
    let rows = move |most: usize| prop::collection::vec(prop::collection::vec(entry(), n), 0..=most);
    let bound = || prop_oneof![3 => Just(None), 1 => (-2..=2_i8).prop_map(|v| Some(f64::from(v)))];
    (rows(5), rows(2), prop::collection::vec((bound(), bound()), n)).prop_flat_map(move |(a, e, bounds)| {
        let right = |len: usize| prop::collection::vec((-2..=3_i8).prop_map(f64::from), len);
        let (m, k) = (a.len(), e.len());
        (Just((a, e, bounds)), right(m), right(k)).prop_map(|((a, e, bounds), b, d)| Data {
            a,
            b,
            e,
            d,
            lower: bounds.iter().map(|p| p.0.unwrap_or(-INF)).collect(),
            upper: bounds.iter().map(|p| p.1.unwrap_or(INF)).collect(),
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// The nearest point is feasible and satisfies the optimality conditions; emptiness is proven by Farkas' lemma.
    #[test]
    fn projections_are_nearest_points_or_proofs(data in polyhedra(4), x in prop::collection::vec(-5.0..5.0, 4)) {
        let set = data.set();
        match set.project(&x).unwrap() {
            Projection::Nearest(nearest) => {
                let y = &nearest.x;
                prop_assert!(set.violation(y).unwrap() <= 1e-12);
                let m = &nearest.multipliers;
                for (r, (y, x)) in data.combination(m).iter().zip(y.iter().zip(&x)) {
                    prop_assert!((y - x + r).abs() <= 1e-11);
                }
                for (row, (b, l)) in data.a.iter().zip(data.b.iter().zip(&m.inequalities)) {
                    prop_assert!(*l >= 0.0 && (l * (dot(row, y) - b)).abs() <= 1e-11);
                }
                for j in 0..4 {
                    prop_assert!(m.lower[j] >= 0.0 && (m.lower[j] == 0.0 || y[j] == data.lower[j]));
                    prop_assert!(m.upper[j] >= 0.0 && (m.upper[j] == 0.0 || y[j] == data.upper[j]));
                }
            }
            Projection::Empty(certificate) => prop_assert!(data.proves_empty(&certificate)),
            other => prop_assert!(false, "{other:?}"),
        }
    }

    /// Strongly monotone problems over nonempty sets have one solution, found from any start and listed alone; x − F(x) projects on it
    /// and is a zero of Robinson's normal map.
    #[test]
    fn monotone_problems_have_one_solution(
        data in polyhedra(3),
        g in prop::collection::vec(-1.0..1.0, 18),
        x in prop::collection::vec(-9.0..9.0, 3),
    ) {
        let entry = |i: usize, j: usize| {
            let gram: f64 = (0..3).map(|k| g[3 * k + i] * g[3 * k + j]).sum();
            gram + g[9 + i] * f64::from(u8::from(j > i)) - g[9 + j] * f64::from(u8::from(i > j)) + f64::from(u8::from(i == j))
        };
        let rows: Vec<Vec<f64>> = (0..3).map(|i| (0..3).map(|j| entry(i, j)).collect()).collect();
        let f = AffineFunction::new(matrix(&rows, 3), g[12..15].to_vec()).unwrap();
        let vi = Vi::new(&f, data.set()).unwrap();
        let mut x = x;
        let report = ViSolver::default().solve(&vi, &mut x).unwrap();
        if report.status == Status::EmptySet {
            prop_assert!(data.proves_empty(&report.infeasibility.unwrap()));
            return Ok(());
        }
        prop_assert!(report.is_solved(), "{:?}", report.status);
        let mut value = vec![0.0; 3];
        f.value(&x, &mut value);
        let moved: Vec<f64> = x.iter().zip(&value).map(|(x, f)| x - f).collect();
        let Projection::Nearest(nearest) = data.set().project(&moved).unwrap() else { panic!("not empty") };
        for (p, x) in nearest.x.iter().zip(&x) {
            prop_assert!((p - x).abs() <= 1e-9);
        }
        prop_assert!(report.residual <= 1e-9);
        // z = x + Aᵀλ + Eᵀμ − ρₗ + ρᵤ is x − F(x), and a zero of F(P(z)) + z − P(z).
        let z: Vec<f64> = x.iter().zip(data.combination(&report.multipliers)).map(|(x, r)| x + r).collect();
        let Projection::Nearest(nearest) = data.set().project(&z).unwrap() else { panic!("not empty") };
        let mut normal = vec![0.0; 3];
        f.value(&nearest.x, &mut normal);
        for i in 0..3 {
            prop_assert!((z[i] - moved[i]).abs() <= 1e-8 && (nearest.x[i] - x[i]).abs() <= 1e-8);
            prop_assert!((normal[i] + z[i] - nearest.x[i]).abs() <= 1e-7);
        }
        let list = vi.all_solutions(&EnumerationOptions::default()).unwrap();
        if list.completeness == Completeness::Complete {
            prop_assert_eq!(list.solutions.len() + list.continua.len(), 1, "{:?}", list);
            for (a, b) in list.solutions.iter().flatten().zip(&x) {
                prop_assert!((a - b).abs() <= 1e-7);
            }
        }
    }
}

/// Minimise cᵀx over a set that is unbounded in the direction of −c: a ray proves that nothing solves.
#[test]
fn unbounded_programs_are_refuted_by_a_ray() {
    let f = AffineFunction::new(
        Matrix::zeros(Matrix::identity(2).pattern().clone()),
        vec![-1.0, -2.0],
    )
    .unwrap();
    let rows = vec![vec![1.0, -1.0], vec![-1.0, 0.0]];
    let set = Polyhedron::space(2)
        .unwrap()
        .with_inequalities(matrix(&rows, 2), vec![1.0, 0.0])
        .unwrap();
    let vi = Vi::new(f, set).unwrap();
    let mut x = [3.0, -4.0];
    let report = ViSolver::default().solve(&vi, &mut x).unwrap();
    assert_eq!(report.status, Status::NoSolution);
    let ray = report.ray.unwrap();
    let v = &ray.direction;
    assert!(rows.iter().all(|row| dot(row, v) <= 1e-12));
    assert!(-v[0] - 2.0 * v[1] < 0.0 && ray.value < 0.0 && ray.radius > 1e10);
}

/// With equations, bounds and F(x) = M x + q that varies along the set, each property in the definition of a ray holds.
#[test]
fn rays_satisfy_their_definition() {
    let q = [-9.0, 1.0, 0.5, -9.0, 0.0];
    let rows = vec![vec![1.0, 1.0, -1.0, 0.0, 0.0], vec![0.0, 1.0, 0.0, -1.0, 0.0]];
    let (zero, twice) = (vec![0.0; 5], rows[1].iter().map(|v| 2.0 * v).collect());
    let m = vec![zero.clone(), zero.clone(), rows[0].clone(), twice, zero];
    let data = Data {
        a: vec![vec![-1.0, 0.0, 0.0, 0.0, 1.0]],
        b: vec![3.0],
        e: rows,
        d: vec![1.0, 2.0],
        lower: vec![-INF, 1.0, -INF, -INF, 0.0],
        upper: vec![INF, INF, INF, INF, 1.0],
    };
    let f = AffineFunction::new(matrix(&m, 5), q.to_vec()).unwrap();
    let vi = Vi::new(f, data.set()).unwrap();
    let report = ViSolver::default().solve(&vi, &mut [0.0; 5]).unwrap();
    assert_eq!(report.status, Status::NoSolution);
    let ray = report.ray.unwrap();
    let (v, by) = (&ray.direction, &ray.multipliers);
    let small = 1e-9 * (1.0 + v.iter().fold(0.0_f64, |m, v| m.max(v.abs())));
    assert!(data.a.iter().all(|row| dot(row, v) <= small));
    assert!(data.e.iter().all(|row| dot(row, v).abs() <= small));
    let lists = [&by.inequalities, &by.lower, &by.upper];
    assert!(lists.iter().all(|list| list.iter().all(|y| *y >= 0.0)));
    let mut value = dot(&q, v) + dot(&data.b, &by.inequalities) + dot(&data.d, &by.equations);
    for j in 0..5 {
        let along: f64 = (0..5).map(|i| m[i][j] * v[i]).sum();
        let of_rows = data.a[0][j] * by.inequalities[0]
            + data.e[0][j] * by.equations[0]
            + data.e[1][j] * by.equations[1];
        assert!(
            (along - of_rows + by.lower[j] - by.upper[j]).abs() <= small,
            "{j}"
        );
        for (bound, rho, sign) in [
            (data.lower[j], by.lower[j], -1.0),
            (data.upper[j], by.upper[j], 1.0),
        ] {
            assert!(bound.is_finite() || rho == 0.0);
            assert!(!bound.is_finite() || sign * v[j] <= small);
            value += if bound.is_finite() {
                sign * bound * rho
            } else {
                0.0
            };
        }
    }
    assert!((value - ray.value).abs() <= small && ray.value < 0.0);
}

/// 3 x₁ − 2 x₂ ≤ −2, x₂ − 3 x₃ ≤ 3 and twice the sum of these rows bounded from below: on a strip of width δ there is a solution, one of
/// width −δ is empty, from near and far starts, for small and large F; exact arithmetic decides both.
#[test]
fn nearly_feasible_empty_sets_have_no_solution() {
    let rows = [vec![3.0, -2.0, 0.0], vec![0.0, 1.0, -3.0], vec![-6.0, 2.0, 6.0]];
    for exponent in 24..=38 {
        for (sign, far, size) in [-1.0, 1.0]
            .into_iter()
            .flat_map(|sign| [0.0, 1.0, 1e3].map(|far| [1e-6, 1.0, 1e6].map(|size| (sign, far, size))))
            .flatten()
        {
            let delta = sign * f64::exp2(-f64::from(exponent));
            let set = Polyhedron::space(3)
                .unwrap()
                .with_inequalities(matrix(&rows, 3), vec![-2.0, 3.0, -2.0 + delta])
                .unwrap();
            let scaled = |v: [f64; 3]| v.map(|v| v * size).to_vec();
            let m = [[3.0, 1.0, 0.0], [1.0, 2.0, 1.0], [0.0, 1.0, 4.0]].map(scaled);
            let f = AffineFunction::new(matrix(&m, 3), scaled([7.0, -5.0, 8.0])).unwrap();
            let mut x = [far, -0.7 * far, 0.3 * far];
            let report = ViSolver::default()
                .solve(&Vi::new(f, set).unwrap(), &mut x)
                .unwrap();
            if sign > 0.0 {
                assert!(report.is_solved(), "{delta:e} {far} {size}: {report}");
            } else {
                assert_eq!(report.status, Status::EmptySet, "{delta:e} {far} {size}");
                assert_eq!(report.infeasibility.unwrap().radius, INF);
            }
        }
    }
}

/// Battle of the sexes: two pure equilibria and (3/5, 2/5; 2/5, 3/5), each with its multipliers of the two simplices.
#[test]
fn all_equilibria_of_a_bimatrix_game() {
    let (a, b) = ([[3.0, 0.0], [0.0, 2.0]], [[2.0, 0.0], [0.0, 3.0]]);
    let rows: Vec<Vec<f64>> = vec![
        vec![0.0, 0.0, -a[0][0], -a[0][1]],
        vec![0.0, 0.0, -a[1][0], -a[1][1]],
        vec![-b[0][0], -b[1][0], 0.0, 0.0],
        vec![-b[0][1], -b[1][1], 0.0, 0.0],
    ];
    let f = AffineFunction::new(matrix(&rows, 4), vec![0.0; 4]).unwrap();
    let sums = matrix(&[vec![1.0, 1.0, 0.0, 0.0], vec![0.0, 0.0, 1.0, 1.0]], 4);
    let set = Polyhedron::boxed(vec![0.0; 4], vec![INF; 4])
        .unwrap()
        .with_equations(sums, vec![1.0; 2])
        .unwrap();
    let list = complete_list(f, set);
    assert!(list.continua.is_empty());
    let mut found = list.solutions;
    found.sort_by(|x, y| x[0].total_cmp(&y[0]));
    let expected = [[0.0, 1.0, 0.0, 1.0], [0.6, 0.4, 0.4, 0.6], [1.0, 0.0, 1.0, 0.0]];
    assert_eq!(found.len(), 3);
    for (x, y) in found.iter().zip(&expected) {
        assert!(x.iter().zip(y).all(|(a, b)| (a - b).abs() < 1e-14), "{x:?}");
    }
}

/// The projection of (α, 1/4) on the triangle x ≥ 0, x₁ + x₂ ≤ 1 as a curve: faces change at α = 0, 3/4 and 5/4.
#[test]
fn parametric_problems_are_followed_through_every_face() {
    let f = WithJacobian::parametric(
        2,
        |x: &[f64], out: &mut [f64]| {
            out[0] = x[0] - x[2];
            out[1] = x[1] - 0.25;
        },
        |_: &[f64], jac: &mut Matrix| {
            jac.add(0, 0, 1.0);
            jac.add(0, 2, -1.0);
            jac.add(1, 1, 1.0);
        },
    );
    let set = Polyhedron::boxed(vec![0.0; 2], vec![INF; 2])
        .unwrap()
        .with_inequalities(matrix(&[vec![1.0, 1.0]], 2), vec![1.0])
        .unwrap();
    let vi = Vi::new(f, set.clone()).unwrap();
    let conditions = vi.kkt().unwrap();
    let options = ContinuationOptions::default().with_parameter_range((-1.0, 3.0));
    let branch = Branch::follow(
        &conditions,
        &[0.0, 0.25, 0.0, -1.0],
        Direction::Increasing,
        options,
    )
    .unwrap();
    let at: Vec<f64> = branch.transitions.iter().map(|t| t.x[3]).collect();
    assert_eq!(at.len(), 3, "{at:?}");
    for (a, b) in at.iter().zip([0.0, 0.75, 1.25]) {
        assert!((a - b).abs() < 1e-12);
    }
    for point in &branch.points {
        let Projection::Nearest(nearest) = set.project(&[point.x[3], 0.25]).unwrap() else {
            panic!()
        };
        assert!(nearest.x.iter().zip(&point.x).all(|(a, b)| (a - b).abs() < 1e-9));
    }
}

/// A zero of the normal map is a solution of the MCP, and the contract of maps holds on both sides of each facet.
#[test]
fn zeros_of_the_normal_map_solve_the_problem() {
    let rows: Vec<Vec<f64>> = (0..4_usize)
        .map(|i| {
            (0..4_usize)
                .map(|j| ((i * 5 + j * 3) % 4) as f64 - 1.5 + 4.0 * f64::from(u8::from(i == j)))
                .collect()
        })
        .collect();
    let lower = vec![0.0, -INF, -1.0, 2.0];
    let upper = vec![INF, 1.0, 1.0, 2.0];
    let mcp = Mcp::affine(matrix(&rows, 4), vec![1.0, -8.0, 0.5, -1.0], lower, upper).unwrap();
    let map = NormalMap::new(&mcp);
    let points: Vec<Vec<f64>> = (0..30_usize)
        .map(|k| {
            (0..4_usize)
                .map(|i| ((k * 13 + i * 5) % 11) as f64 * 0.5 - 2.5)
                .collect()
        })
        .collect();
    check(&map, &points, &CheckOptions::default()).unwrap();
    let mut z = vec![0.5; 4];
    Newton::default().solve(&map, &mut z).unwrap();
    let x = map.point(&z);
    let mut residual = vec![0.0; 4];
    assert!(mcp.natural_residual(&x, &mut residual).unwrap() < 1e-13);
    let mut y = vec![0.0; 4];
    assert!(McpSolver::default().solve(&mcp, &mut y).unwrap().is_solved());
    assert!(x.iter().zip(&y).all(|(a, b)| (a - b).abs() < 1e-12));
}

/// −x₂ = 0 among rows that are stored in full: at x₂ = 0 all terms of the row vanish, which does not mean that F has become flat.
#[test]
fn an_equation_of_one_unknown_is_solved() {
    let rows = [
        vec![4.0, 0.4, 0.8, 0.0, 0.0],
        vec![-1.0, 3.0, -0.4, 2.0, 1.0],
        vec![1.0, 0.5, 2.0, -1.0, 0.0],
        vec![0.0, -2.0, 1.0, 0.0, 0.0],
        vec![0.0, -1.0, 0.0, 0.0, 0.0],
    ];
    let q = vec![0.7, -0.5, -0.4, 3.0, 0.0];
    let upper = vec![INF, INF, -1.0, INF, INF];
    let mcp = Mcp::affine(matrix(&rows, 5), q, vec![-INF; 5], upper).unwrap();
    for k in 0..40_u32 {
        let mut x = vec![f64::from(k) / 7.0, -0.04, -3.0, f64::from(k % 5) / 3.0, 0.1];
        let mut solver = McpSolver::default();
        let report = solver.solve(&mcp, &mut x).unwrap();
        assert!(
            report.is_solved() && report.iterations < 50,
            "{k}: {:?}",
            report.status
        );
        assert!(x[1].abs() < 1e-15 && (x[2] + 3.0).abs() < 1e-15);
    }
}

/// F = 1 − 2x on x ≥ 0, s x ≤ s: a solution at either end and one between, whatever the unit of the row.
#[test]
fn units_of_rows_merge_no_solutions() {
    for s in [1.0, 1e-6, 1e-9, 1e-12, 1e9] {
        let f = AffineFunction::new(matrix(&[vec![-2.0]], 1), vec![1.0]).unwrap();
        let set = Polyhedron::boxed(vec![0.0], vec![INF])
            .unwrap()
            .with_inequalities(matrix(&[vec![s]], 1), vec![s])
            .unwrap();
        let list = complete_list(f, set);
        let mut found: Vec<f64> = list.solutions.iter().map(|x| x[0]).collect();
        found.sort_by(f64::total_cmp);
        assert_eq!(found, [0.0, 0.5, 1.0], "s = {s:e}");
        assert!(list.continua.is_empty());
    }
}

/// F = t (x₂ − 5, 0) on s x₁ ≤ s, 0 ≤ x₂ ≤ 1: all (1, x₂) are solutions, and the multiplier t (5 − x₂) / s changes along them.
#[test]
fn units_of_rows_hide_no_continua() {
    for (t, s) in [1.0, 1e-6, 1e-10, 1e-14, 1e10]
        .into_iter()
        .flat_map(|s| [1.0, 1e-5, 3e7].map(|t| (t, s)))
    {
        let f = AffineFunction::new(matrix(&[vec![0.0, t], vec![0.0, 0.0]], 2), vec![-5.0 * t, 0.0]).unwrap();
        let set = Polyhedron::boxed(vec![-INF, 0.0], vec![INF, 1.0])
            .unwrap()
            .with_inequalities(matrix(&[vec![s, 0.0]], 2), vec![s])
            .unwrap();
        let list = complete_list(f, set);
        assert_eq!(list.solutions, Vec::<Vec<f64>>::new(), "{t:e}, {s:e}");
        let [continuum] = &list.continua[..] else {
            panic!("{t:e}, {s:e}: {:?}", list.continua);
        };
        assert!(!continuum.ends.is_empty());
        for end in &continuum.ends {
            let expected = t * (5.0 - end[1]) / s;
            assert!(
                (end[2] - expected).abs() < 1e-12 * expected,
                "{t:e}, {s:e}: {end:?}"
            );
        }
    }
}

/// F = 1 on x ≥ 0, −s x ≤ 0: bound and row are both active at the solution 0, and their multipliers are not unique.
#[test]
fn units_of_rows_move_no_multipliers() {
    for (t, s) in [(1.0, 1.0), (5e11, 4096.0), (5e11, 1e-12), (1e-12, 5e11)] {
        let f = AffineFunction::new(matrix(&[vec![0.0]], 1), vec![t]).unwrap();
        let set = Polyhedron::boxed(vec![0.0], vec![INF])
            .unwrap()
            .with_inequalities(matrix(&[vec![-s]], 1), vec![0.0])
            .unwrap();
        let list = complete_list(f, set);
        assert_eq!(
            (list.solutions, list.continua),
            (vec![vec![0.0]], Vec::new()),
            "{t:e}, {s:e}"
        );
    }
}

/// F = x on 3 x₂ + 2 x₃ = −2, (3 − δ) x₂ + 2 x₃ = −2, x₃ ≥ −1: the nearly parallel equations leave (0, 0, −1) alone, where the inequality
/// makes the multipliers a ray. For δ = 0 the solution is the point of the plane nearest to 0.
#[test]
fn nearly_parallel_rows_let_no_solution_move() {
    for delta in [1.0, 1e-6, 2_f64.powi(-44), 0.0] {
        let f = AffineFunction::new(Matrix::identity(3), vec![0.0; 3]).unwrap();
        let equations = [vec![0.0, 3.0, 2.0], vec![0.0, 3.0 - delta, 2.0]];
        let set = Polyhedron::space(3)
            .unwrap()
            .with_equations(matrix(&equations, 3), vec![-2.0; 2])
            .unwrap()
            .with_inequalities(matrix(&[vec![0.0, 0.0, -1.0]], 3), vec![1.0])
            .unwrap();
        let list = complete_list(f, set);
        let expected = match delta > 0.0 {
            true => [0.0, 0.0, -1.0],
            false => [0.0, -6.0 / 13.0, -4.0 / 13.0],
        };
        let [x] = &list.solutions[..] else {
            panic!("{delta:e}: {list:?}");
        };
        assert!(
            x.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12),
            "{delta:e}: {x:?}"
        );
        assert!(list.continua.is_empty(), "{delta:e}: {:?}", list.continua);
    }
}

/// A piecewise linear path solves the problem by itself, without a factorisation of Newton's method, beyond the size up to which curved
/// paths are followed: where F is strongly monotone it ends at the solution that all strategies find.
#[test]
fn one_path_solves_a_large_affine_problem() {
    let (n, m) = (240, 120);
    let mut random = Random::new(9);
    let mut entries = Vec::new();
    for i in 0..n {
        entries.push((i, i, 2.5));
        if i + 1 < n {
            entries.extend([(i, i + 1, -0.2), (i + 1, i, -1.9)]);
        }
    }
    let rows: Vec<_> = (0..4 * m)
        .map(|k| (k / 4, random.below(n), random.symmetric()))
        .collect();
    let set = Polyhedron::boxed(vec![-1.0; n], vec![1.0; n])
        .unwrap()
        .with_inequalities(
            Matrix::from_triplets(m, n, &rows).unwrap(),
            (0..m).map(|_| 0.3 * random.unit()).collect(),
        )
        .unwrap();
    let matrix = Matrix::from_triplets(n, n, &entries).unwrap();
    let problem = Vi::new(AffineFunction::new(matrix, random.vector(n, 3.0)).unwrap(), set).unwrap();
    let alone = McpOptions::default().with_strategies(vec![McpStrategy::JosephyNewton]);
    assert!(n + m > alone.max_path_size);
    let (mut path, mut other) = (vec![0.0; n], vec![0.0; n]);
    let report = ViSolver::new(alone).solve(&problem, &mut path).unwrap();
    assert!(
        report.is_solved() && report.mcp.strategy == McpStrategy::JosephyNewton,
        "{report}"
    );
    assert_eq!(report.mcp.factorisations, 0);
    assert!(
        ViSolver::default()
            .solve(&problem, &mut other)
            .unwrap()
            .is_solved()
    );
    assert!(path.iter().zip(&other).all(|(a, b)| (a - b).abs() < 1e-9));
}

/// F₁ = −x₁ − 8 for x₁ ≤ −1, and x₂ fixed by two dependent constraints, so that multipliers are not unique: two solutions, whose first
/// components differ by any part of the second one, as units may.
#[test]
fn solutions_that_differ_in_a_component_in_small_units_are_two() {
    for exponent in [0, 20, 40, 60] {
        let small = f64::from(-exponent).exp2();
        let f = AffineFunction::new(
            matrix(&[vec![-1.0, 0.0], vec![0.0, 0.0]], 2),
            vec![-8.0 * small, 0.0],
        )
        .unwrap();
        let set = Polyhedron::boxed(vec![-INF, -INF], vec![INF, 2.0])
            .and_then(|set| set.with_inequalities(matrix(&[vec![1.0, 0.0]], 2), vec![-small]))
            .and_then(|set| set.with_equations(matrix(&[vec![0.0, 1.0]], 2), vec![2.0]));
        let vi = Vi::new(f, set.unwrap()).unwrap();
        let all = vi.all_solutions(&EnumerationOptions::default()).unwrap();
        assert_eq!(all.completeness, Completeness::Complete);
        let mut first: Vec<f64> = all.solutions.iter().map(|x| x[0] / small).collect();
        first.sort_by(f64::total_cmp);
        assert_eq!(first, [-8.0, -1.0], "2^-{exponent}: {all:?}");
    }
}

/// Supplies and demands that balance in decimals do not in binary numbers: the transport is found, and said to hold within rounding.
#[test]
fn transport_that_balances_in_decimals_has_a_plan() {
    for d in [
        [0.4, 0.8, 0.8, 0.0, 2.0],
        [0.4, 0.8, 0.8, 0.1, 1.9],
        [0.1, 0.2, 0.3, 0.3, 0.3],
        [0.1, 0.7, 0.7, 0.8, 0.7],
    ] {
        let mut rows = vec![vec![0.0; 6]; 5];
        for (i, j) in (0..3).flat_map(|i| [(i, 0), (i, 1)]) {
            rows[i][2 * i + j] = 1.0;
            rows[3 + j][2 * i + j] = 1.0;
        }
        let set = Polyhedron::boxed(vec![0.0; 6], vec![INF; 6]).unwrap();
        let set = set.with_equations(matrix(&rows, 6), d.to_vec()).unwrap();
        let plan = AffineFunction::new(Matrix::identity(6), vec![0.0; 6]).unwrap();
        let mut x = [0.0; 6];
        let report = ViSolver::default()
            .solve(&Vi::new(plan, set).unwrap(), &mut x)
            .unwrap();
        assert_eq!(report.status, Status::Solved, "{d:?}");
        for (row, d) in rows.iter().zip(d) {
            let sum: f64 = row.iter().zip(&x).map(|(a, x)| a * x).sum();
            assert!(
                (sum - d).abs() < 1e-12 && x.iter().all(|x| *x >= 0.0),
                "{d:?} {x:?}"
            );
        }
    }
}

/// 0.1 + 0.2 = 0.3 is meant, although no binary numbers are so; x ≤ 0 with x ≥ 1e-15 is not, nor is a sum of integers that is wrong.
#[test]
fn only_constants_that_may_have_been_rounded_give_way() {
    let sum = |right: [f64; 3]| {
        let rows = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(Vec::from);
        Polyhedron::boxed(vec![-INF; 2], vec![INF; 2])
            .unwrap()
            .with_equations(matrix(&rows, 2), right.to_vec())
            .unwrap()
    };
    for (right, within_rounding) in [
        ([0.1, 0.2, 0.3], true),
        ([0.5, 0.25, 0.75], false),
        ([1.0, 2.0, 3.0], false),
    ] {
        match sum(right).project(&[0.0, 0.0]).unwrap() {
            Projection::Nearest(found) => assert_eq!(found.within_rounding, within_rounding, "{right:?}"),
            empty => panic!("{right:?} {empty:?}"),
        }
    }
    let least = f64::EPSILON;
    for right in [
        [1.0, 2.0, 3.0 + 4.0 * least],
        [0.5, 0.25, 0.75 + 4.0 * least],
        [0.1, 0.2, 0.3 - 4.0 * least],
    ] {
        assert!(
            matches!(sum(right).project(&[0.0, 0.0]).unwrap(), Projection::Empty(_)),
            "{right:?}"
        );
    }
    // By one digit: as a bound and a row of either sign and size, an equation, and two rows.
    for (lower, upper) in [(1e-15, 0.0), (3.0 + 2.0 * least, 3.0), (-3.0, -3.0 - 2.0 * least)] {
        let bounded = |l: f64, u: f64| Polyhedron::boxed(vec![l], vec![u]).unwrap();
        let row = |v: f64| matrix(&[vec![v]], 1);
        for set in [
            bounded(lower, INF)
                .with_inequalities(row(1.0), vec![upper])
                .unwrap(),
            bounded(lower, INF)
                .with_inequalities(row(4.0), vec![4.0 * upper])
                .unwrap(),
            bounded(-INF, upper)
                .with_inequalities(row(-2.0), vec![-2.0 * lower])
                .unwrap(),
            bounded(lower, INF).with_equations(row(1.0), vec![upper]).unwrap(),
            bounded(-INF, upper)
                .with_equations(row(-2.0), vec![-2.0 * lower])
                .unwrap(),
            bounded(-INF, INF)
                .with_inequalities(matrix(&[vec![1.0], vec![-1.0]], 1), vec![upper, -lower])
                .unwrap(),
        ] {
            match set.project(&[0.3]).unwrap() {
                Projection::Empty(proof) => assert!(proof.value < 0.0 && proof.radius == INF),
                found => panic!("{lower:e} {upper:e} {set:?} {found:?}"),
            }
        }
        // The other way round there are points.
        let set = bounded(upper, INF)
            .with_inequalities(row(1.0), vec![lower])
            .unwrap();
        assert!(matches!(set.project(&[0.3]).unwrap(), Projection::Nearest(_)));
    }
    // 3 x ≤ 1 and x ≥ 1/3 rounded: the quotient is the bound, and what contradicts is its rounding.
    let third = Polyhedron::boxed(vec![1.0 / 3.0], vec![INF]).unwrap();
    let set = third
        .with_inequalities(matrix(&[vec![3.0]], 1), vec![1.0])
        .unwrap();
    assert!(matches!(set.project(&[0.0]).unwrap(), Projection::Nearest(_)));
}

/// The same problem without a solution in other units, by powers of two and of ten.
#[test]
fn a_problem_without_a_solution_has_none_in_other_units() {
    let rows = [[0.0, -3.0, 1.0], [0.0, 0.0, 1.0], [0.0, -3.0, 3.0]];
    for unit in [1.0, 2.0_f64.powi(-20), 1e-6, 1e6, 1e-12] {
        let m: Vec<Vec<f64>> = rows
            .iter()
            .map(|r| r.iter().map(|v| v * unit).collect())
            .collect();
        let f = AffineFunction::new(
            Matrix::from_rows(&m).unwrap(),
            [4.0, 3.0, 0.0].map(|q| q * unit).to_vec(),
        )
        .unwrap();
        let set = Polyhedron::boxed(vec![-INF; 3], vec![INF; 3]).unwrap();
        let set = set
            .with_inequalities(matrix(&[vec![-4.0, 0.0, -4.0]], 3), vec![-2.0])
            .unwrap();
        let mut x = [0.0; 3];
        let report = ViSolver::default()
            .solve(&Vi::new(f, set).unwrap(), &mut x)
            .unwrap();
        assert!(!report.is_solved(), "{unit:e} {x:?}");
    }
}
