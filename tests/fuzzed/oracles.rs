//! What is fuzzed: readers, the MCP solver, friction problems. Each function makes a problem of any bytes and panics if an invariant is
//! violated. The targets of `fuzz/` call them with coverage guidance, `cargo test` with random bytes and with past findings.

use std::path::Path;
use std::time::Duration;

use semismooth::complementarity::{Mcp, McpOptions, McpSolver, WithJacobian};
use semismooth::contact::{FrictionCoefficient, FullContact, LoadPath};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::fem::parse_gmsh;
use semismooth::piecewise::{PiecewiseSmooth, select};
use semismooth::sparse::{Matrix, Pattern, parse_matrix_market, parse_vector};

/// Bytes turned into numbers; zeros at the end.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn byte(&mut self) -> u8 {
        match self.0.split_first() {
            Some((first, rest)) => {
                self.0 = rest;
                *first
            }
            None => 0,
        }
    }

    fn below(&mut self, n: usize) -> usize {
        usize::from(self.byte()) % n
    }

    /// A number on a coarse grid, so that degenerate problems are common; rarely a huge, tiny, infinite or NaN one.
    fn number(&mut self) -> f64 {
        let b = self.byte() as i8;
        match b {
            127 => [1e9, -1e9, 1e-9, 1e300, f64::NAN, f64::INFINITY, -0.0, 1e-300][self.below(8)],
            _ => f64::from(b) / 16.0,
        }
    }

    fn numbers(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.number()).collect()
    }
}

/// Every reader survives any bytes, and what a reader accepts is valid.
pub fn readers(data: &[u8]) {
    let none = Path::new("fuzz");
    if let Ok(mesh) = parse_gmsh(data, none) {
        assert!(mesh.num_cells() > 0 && mesh.points().iter().flatten().all(|c| c.is_finite()));
        let _ = mesh.boundary();
    }
    let text = String::from_utf8_lossy(data);
    if let Ok(matrix) = parse_matrix_market(&text) {
        assert!(matrix.check_finite().is_ok());
        assert!(
            matrix
                .triplets()
                .all(|(i, j, _)| i < matrix.nrows() && j < matrix.ncols())
        );
    }
    if let Ok(vector) = parse_vector(&text) {
        assert!(vector.iter().all(|v| v.is_finite()));
    }
}

/// c + A x + B g(x) with g among powers, exponentials, logarithms, roots and poles.
struct Terms {
    n: usize,
    constant: Vec<f64>,
    linear: Vec<f64>,
    factor: Vec<f64>,
    kind: Vec<usize>,
}

impl Terms {
    fn nonlinear(&self, i: usize, x: &[f64]) -> (f64, f64) {
        let v = x[(i + 1) % self.n];
        match self.kind[i] {
            0 => (0.0, 0.0),
            1 => (v * v, 2.0 * v),
            2 => (v.exp(), v.exp()),
            3 => (v.ln(), 1.0 / v),
            4 => (v.sqrt(), 0.5 / v.sqrt()),
            5 => (v * v * v, 3.0 * v * v),
            6 => (v.sin(), v.cos()),
            _ => (1.0 / v, -1.0 / (v * v)),
        }
    }

    fn value(&self, x: &[f64], out: &mut [f64]) {
        for i in 0..self.n {
            let row = &self.linear[i * self.n..(i + 1) * self.n];
            let sum: f64 = row.iter().zip(x).map(|(a, x)| a * x).sum();
            out[i] = self.constant[i] + sum;
            if self.kind[i] > 0 && self.factor[i] != 0.0 {
                out[i] += self.factor[i] * self.nonlinear(i, x).0;
            }
        }
    }

    fn jacobian(&self, x: &[f64], jac: &mut Matrix) {
        for i in 0..self.n {
            for j in 0..self.n {
                jac.add(i, j, self.linear[i * self.n + j]);
            }
            if self.kind[i] > 0 && self.factor[i] != 0.0 {
                jac.add(i, (i + 1) % self.n, self.factor[i] * self.nonlinear(i, x).1);
            }
        }
    }
}

/// No panic, no endless loop, and what is reported solved is solved.
pub fn mcp(data: &[u8]) {
    let mut bytes = Bytes(data);
    let n = 1 + bytes.below(4);
    let terms = Terms {
        n,
        kind: (0..n).map(|_| bytes.below(8)).collect(),
        constant: bytes.numbers(n),
        linear: bytes.numbers(n * n),
        factor: bytes.numbers(n),
    };
    let (mut lower, mut upper) = (Vec::new(), Vec::new());
    for _ in 0..n {
        let (l, u) = match bytes.below(6) {
            0 => (f64::NEG_INFINITY, f64::INFINITY),
            1 | 2 => (0.0, f64::INFINITY),
            3 => (f64::NEG_INFINITY, bytes.number()),
            4 => (bytes.number(), f64::INFINITY),
            _ => (bytes.number(), bytes.number()),
        };
        lower.push(l);
        upper.push(u);
    }
    let mut x = bytes.numbers(n);
    let f = WithJacobian::new(
        n,
        |x: &[f64], out: &mut [f64]| terms.value(x, out),
        |x: &[f64], jac: &mut Matrix| terms.jacobian(x, jac),
    );
    let Ok(problem) = Mcp::new(f, lower.clone(), upper.clone()) else {
        return;
    };
    let options = McpOptions::default()
        .with_max_iterations(2000)
        .with_max_time(Some(Duration::from_secs(5)));
    let mut solver = McpSolver::new(options);
    let Ok(report) = solver.solve(&problem, &mut x) else {
        return;
    };
    assert!(!report.status.name().is_empty());
    if report.is_solved() {
        for i in 0..n {
            let inside = x[i] >= lower[i] && x[i] <= upper[i];
            assert!(inside, "{i} outside its bounds: {x:?}");
        }
    }
    // Beyond 1e100 terms and their rounding overflow, so that F cannot be evaluated reliably.
    let numbers = [&terms.constant, &terms.linear, &terms.factor, &lower, &upper];
    let extreme = |v: &f64| v.is_finite() && v.abs() > 1e100;
    if report.is_solved() && !numbers.into_iter().flatten().any(extreme) {
        let mut value = vec![0.0; n];
        terms.value(&x, &mut value);
        let mut slopes = Matrix::zeros(Pattern::full(n, n));
        terms.jacobian(&x, &mut slopes);
        for i in 0..n {
            // F may change sign between neighbouring numbers: 1e300 ln x near 1.
            let rounding: f64 = (0..n)
                .map(|j| (slopes.get(i, j) * x[j]).abs())
                .filter(|t| t.is_finite())
                .sum();
            let natural = x[i] - (x[i] - value[i]).clamp(lower[i], upper[i]);
            let size = 1.0 + x[i].abs().max(terms.constant[i].abs());
            assert!(
                natural.abs() <= 1e-4 * size + 4.0 * f64::EPSILON * rounding,
                "natural residual {natural} at {x:?}, F = {value:?}"
            );
        }
    }
}

/// Paths and lists of small friction problems: points on the curve, transitions on their facets, index sums of complete lists.
pub fn friction(data: &[u8]) {
    let mut bytes = Bytes(data);
    let p = 1 + bytes.below(3);
    let n = 2 * p;
    let g = bytes.numbers(n * n);
    let mut a = Matrix::zeros(Pattern::full(n, n));
    for i in 0..n {
        for j in 0..n {
            let sum: f64 = (0..n).map(|k| g[k * n + i] * g[k * n + j]).sum();
            a.add(i, j, sum + f64::from(u8::from(i == j)));
        }
    }
    let rows = |first: usize| {
        let entries: Vec<(usize, usize, f64)> = (0..p).map(|i| (i, 2 * i + first, 1.0)).collect();
        Matrix::from_triplets(p, n, &entries)
    };
    let (Ok(normal), Ok(tangential)) = (rows(0), rows(1)) else {
        return;
    };
    let (first, last) = (bytes.numbers(n), bytes.numbers(n));
    // A direction 1e9 times stiffer than r has its facets within the distance at which they count as met, and loads that differ by 1e9 are
    // distinguished only up to that distance: such problems must end, and need not be solved.
    let ordinary = [&g, &first, &last].into_iter().flatten().all(|v| v.abs() <= 1e3);
    let load = LoadPath::between(first, &last);
    let friction =
        FrictionCoefficient::nodal((0..p).map(|_| f64::from(bytes.byte()) / 32.0).collect()).unwrap();
    let Ok(problem) = FullContact::planar(a, normal, tangential, load, friction) else {
        return;
    };
    let Ok(map) = problem.condensed() else {
        return;
    };
    let Ok(set) = all_solutions(&map, 0.0, &EnumerationOptions::default()) else {
        return;
    };
    if ordinary
        && set.completeness.is_complete()
        && let Some(sum) = set.index_sum
    {
        assert_eq!(sum, 1, "index sum of {} solutions", set.solutions.len());
    }
    let options = ContinuationOptions::default()
        .with_parameter_range((-2.0, 2.0))
        .with_max_points(400)
        .with_max_growth(1e4);
    for solution in &set.solutions {
        for direction in [Direction::Increasing, Direction::Decreasing] {
            let Ok(branch) = Branch::follow(&map, &solution.x, direction, options.clone()) else {
                continue;
            };
            let mut r = vec![0.0; map.num_residuals()];
            for (_, x) in branch.polyline() {
                let selection = select(&map, x);
                map.residual(&selection, x, &mut r);
                let size = 1.0 + x.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                let worst = r.iter().fold(0.0f64, |m, v| m.max(v.abs()));
                assert!(
                    !ordinary || worst <= 1e-6 * size * size,
                    "residual {worst} at {x:?}"
                );
                assert_eq!(map.nodes(x).len(), p);
            }
        }
    }
}
