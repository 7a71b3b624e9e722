//! Problems given by data take the same course in all units that differ by powers of two, to the last bit, and end alike in others.

use proptest::prelude::*;
use semismooth::complementarity::{AffineFunction, Mcp, McpSolver};
use semismooth::cones::{Cone, ConeProblem, ConeSolver};
use semismooth::contact::{DelassusProblem, DelassusSolver};
use semismooth::sparse::Matrix;
use semismooth::variational::{Polyhedron, Vi, ViSolver};

/// Numbers in (−1, 1) of a linear congruential generator.
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.next()).collect()
    }

    /// Powers of `base` up to `most`.
    fn units(&mut self, n: usize, base: f64, most: f64) -> Vec<f64> {
        (0..n).map(|_| base.powf((most * self.next()).round())).collect()
    }

    /// A A^T of the given rank, plus a skew part.
    fn monotone(&mut self, n: usize, rank: usize) -> Vec<Vec<f64>> {
        let a: Vec<Vec<f64>> = (0..n).map(|_| self.vector(rank)).collect();
        let skew: Vec<Vec<f64>> = (0..n).map(|_| self.vector(n)).collect();
        let entry = |i: usize, j: usize| {
            let product: f64 = a[i].iter().zip(&a[j]).map(|(x, y)| x * y).sum();
            product + 0.5 * (skew[i][j] - skew[j][i])
        };
        (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
    }
}

fn in_units(m: &[Vec<f64>], rows: &[f64], columns: &[f64]) -> Matrix {
    let row = |(row, r): (&Vec<f64>, &f64)| row.iter().zip(columns).map(|(v, c)| v * r * c).collect();
    let rows: Vec<Vec<f64>> = m.iter().zip(rows).map(row).collect();
    Matrix::from_rows(&rows).unwrap()
}

fn times(v: &[f64], units: &[f64]) -> Vec<f64> {
    v.iter().zip(units).map(|(v, u)| v * u).collect()
}

fn over(v: &[f64], units: &[f64]) -> Vec<f64> {
    v.iter().zip(units).map(|(v, u)| v / u).collect()
}

fn ones(n: usize) -> Vec<f64> {
    vec![1.0; n]
}

/// Agreement of points in units that differ by powers of ten.
fn agree(a: &[f64], b: &[f64]) {
    let size = a.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    for (a, b) in a.iter().zip(b) {
        assert!((a - b).abs() <= 1e-9 * (a.abs() + size), "{a:e} {b:e}");
    }
}

type Ended = (String, usize, Vec<f64>);

fn mcp(m: Matrix, q: Vec<f64>, lower: Vec<f64>, upper: Vec<f64>) -> Ended {
    let problem = Mcp::affine(m, q, lower, upper).unwrap();
    let mut x = vec![0.0; problem.len()];
    let mut solver = McpSolver::default();
    let report = solver.solve(&problem, &mut x).unwrap();
    (report.status.to_string(), report.history.len(), x)
}

fn cones(m: Matrix, q: Vec<f64>, cones: &[Cone]) -> Ended {
    let problem = ConeProblem::new(AffineFunction::new(m, q).unwrap(), cones.to_vec()).unwrap();
    let mut x = vec![0.0; problem.len()];
    let report = ConeSolver::default().solve(&problem, &mut x).unwrap();
    (report.status.to_string(), report.history.len(), x)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// One unit of F and one of x; bounds, zeros in M, singular and indefinite M. With units of each row and unknown the verdict is the same.
    #[test]
    fn complementarity_problems(seed in any::<u64>(), n in 1_usize..8, kind in 0..4) {
        let mut random = Numbers(seed);
        let mut m = match kind {
            0 => random.monotone(n, n),
            1 => random.monotone(n, n.div_ceil(2)),
            _ => (0..n).map(|_| random.vector(n)).collect(),
        };
        if kind == 3 {
            m.iter_mut().flatten().filter(|v| v.abs() < 0.5).for_each(|v| *v = 0.0);
        }
        let q = random.vector(n);
        let bound = |v: f64| if v > 0.0 { f64::INFINITY } else { 0.5 - v };
        let upper: Vec<f64> = random.vector(n).into_iter().map(bound).collect();
        let lower = vec![0.0; n];
        let own = mcp(in_units(&m, &ones(n), &ones(n)), q.clone(), lower.clone(), upper.clone());
        let (rows, columns) = (vec![random.units(1, 2.0, 40.0)[0]; n], vec![random.units(1, 2.0, 40.0)[0]; n]);
        let moved = mcp(in_units(&m, &rows, &columns), times(&q, &rows), lower.clone(), over(&upper, &columns));
        prop_assert_eq!(&own, &(moved.0, moved.1, times(&moved.2, &columns)));
        if kind == 0 {
            let (rows, columns) = (random.units(n, 2.0, 10.0), random.units(n, 2.0, 10.0));
            let moved = mcp(in_units(&m, &rows, &columns), times(&q, &rows), lower, over(&upper, &columns));
            prop_assert_eq!(&own.0, &moved.0);
            if own.0 == "solved" {
                agree(&own.2, &times(&moved.2, &columns));
            }
        }
    }

    /// Each cone has its own unit of x, F one more: the same to the last bit. With units of F of its own, too, and in powers of ten, the end
    /// is the same.
    #[test]
    fn cone_problems(seed in any::<u64>(), blocks in 1_usize..4, rank in 1_usize..9) {
        let mut random = Numbers(seed);
        let kind = |k: usize| if (seed >> k) & 1 == 0 { Cone::SecondOrder(3) } else { Cone::Nonnegative(2) };
        let list: Vec<Cone> = (0..blocks).map(kind).collect();
        let owner: Vec<usize> = { list.iter().enumerate() }.flat_map(|(k, c)| std::iter::repeat_n(k, c.len())).collect();
        let n = owner.len();
        let m = random.monotone(n, rank.min(n));
        let q = random.vector(n);
        let own = cones(in_units(&m, &ones(n), &ones(n)), q.clone(), &list);
        let mut spread = |base: f64, most: f64| -> Vec<f64> {
            let units = random.units(blocks, base, most);
            owner.iter().map(|&k| units[k]).collect()
        };
        let (columns, factor) = (spread(2.0, 30.0), spread(2.0, 30.0)[0]);
        let rows: Vec<f64> = columns.iter().map(|c| c * factor).collect();
        let moved = cones(in_units(&m, &rows, &columns), times(&q, &rows), &list);
        prop_assert_eq!(&own, &(moved.0, moved.1, times(&moved.2, &columns)));
        for base in [2.0, 10.0] {
            let (rows, columns) = (spread(base, 6.0), spread(base, 6.0));
            let moved = cones(in_units(&m, &rows, &columns), times(&q, &rows), &list);
            prop_assert_eq!(&own.0, &moved.0);
            if own.0 == "solved" {
                agree(&own.2, &times(&moved.2, &columns));
            }
        }
    }

    /// Each contact has its own unit of reactions, and velocities one more.
    #[test]
    fn friction_problems(seed in any::<u64>(), contacts in 1_usize..5, three in any::<bool>()) {
        let mut random = Numbers(seed);
        let d = if three { 3 } else { 2 };
        let n = d * contacts;
        let h: Vec<Vec<f64>> = (0..n).map(|_| random.vector(n)).collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let m: Vec<Vec<f64>> = h.iter().map(|a| h.iter().map(|b| dot(a, b)).collect()).collect();
        let q: Vec<f64> = { let v = random.vector(n); h.iter().map(|a| dot(a, &v)).collect() };
        let friction: Vec<f64> = random.vector(contacts).iter().map(|v| v.abs()).collect();
        let solve = |m: Matrix, q: Vec<f64>| {
            let problem = DelassusProblem::new(d, m, q, friction.clone()).unwrap();
            let report = DelassusSolver::default().solve(&problem).unwrap();
            (report.status.to_string(), report.history.len(), report.r.clone())
        };
        let own = solve(in_units(&m, &ones(n), &ones(n)), q.clone());
        let each = random.units(contacts, 2.0, 20.0);
        let factor = 2.0_f64.powf((20.0 * random.next()).round());
        let columns: Vec<f64> = (0..n).map(|i| each[i / d]).collect();
        let rows: Vec<f64> = columns.iter().map(|c| c * factor).collect();
        let moved = solve(in_units(&m, &rows, &columns), times(&q, &rows));
        prop_assert_eq!(own, (moved.0, moved.1, times(&moved.2, &columns)));
    }

    /// One unit of x, and of F with it.
    #[test]
    fn variational_inequalities(seed in any::<u64>(), n in 1_usize..6, count in 1_usize..5) {
        let mut random = Numbers(seed);
        let m = random.monotone(n, n);
        let q = random.vector(n);
        let a: Vec<Vec<f64>> = (0..count).map(|_| random.vector(n)).collect();
        let b: Vec<f64> = random.vector(count).iter().map(|v| v + 0.5).collect();
        let solve = |m: Matrix, q: Vec<f64>, a: Matrix, b: Vec<f64>| {
            let set = Polyhedron::boxed(vec![f64::NEG_INFINITY; n], vec![f64::INFINITY; n]).unwrap();
            let set = set.with_inequalities(a, b).unwrap();
            let problem = Vi::new(AffineFunction::new(m, q).unwrap(), set).unwrap();
            let mut x = vec![0.0; n];
            let report = ViSolver::default().solve(&problem, &mut x).unwrap();
            (report.status.to_string(), report.mcp.history.len(), x)
        };
        let length = 2.0_f64.powf((30.0 * random.next()).round());
        let (m, a) = (in_units(&m, &ones(n), &ones(n)), in_units(&a, &ones(count), &ones(n)));
        let own = solve(m.clone(), q.clone(), a.clone(), b.clone());
        let lengths = vec![length; n];
        let right: Vec<f64> = b.iter().map(|b| b / length).collect();
        let moved = solve(m, over(&q, &lengths), a, right);
        prop_assert_eq!(own, (moved.0, moved.1, times(&moved.2, &lengths)));
    }
}
