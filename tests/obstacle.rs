//! Obstacle problems large enough for coarse levels found by aggregation, against direct solves.

use std::cell::RefCell;
use std::rc::Rc;

use semismooth::complementarity::active_set::{
    ActiveSetOptions, ActiveSetSolver, AutoReduced, DirectReduced, MultigridReduced, ReducedSolver, Start,
};
use semismooth::complementarity::{BoundState, ComplementarityError, Lcp};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

/// The five-point Laplacian on an m × m grid of the unit square, times h², less `shift` on the diagonal.
fn laplacian(m: usize, shift: f64) -> Matrix {
    let mut t = Vec::new();
    for k in 0..m * m {
        t.push((k, k, 4.0 - shift));
        let links = [(k % m + 1 < m).then_some(k + 1), (k + m < m * m).then_some(k + m)];
        for other in links.into_iter().flatten() {
            t.extend([(k, other, -1.0), (other, k, -1.0)]);
        }
    }
    Matrix::from_triplets(m * m, m * m, &t).unwrap()
}

fn point(m: usize, k: usize) -> [f64; 2] {
    let h = 1.0 / (m + 1) as f64;
    [(k % m + 1) as f64 * h, (k / m + 1) as f64 * h]
}

/// −Δu = load with |u| at most the distance from the boundary: elastic–plastic torsion of a square bar, one half of it turned
/// against the other.
fn torsion(m: usize, load: f64) -> Lcp {
    let h = 1.0 / (m + 1) as f64;
    let distance = |k| {
        let [x, y] = point(m, k);
        x.min(1.0 - x).min(y).min(1.0 - y)
    };
    let q = (0..m * m).map(|k| if point(m, k)[0] < 0.4 { -load } else { load } * h * h);
    let upper: Vec<f64> = (0..m * m).map(distance).collect();
    let lower = upper.iter().map(|d| -d).collect();
    Lcp::boxed(laplacian(m, 0.0), q.collect(), lower, upper).unwrap()
}

/// Delegates to `inner` and records the start from coarser levels.
struct Watched<R> {
    inner: R,
    start: Rc<RefCell<Option<Start>>>,
}

impl<R: ReducedSolver> ReducedSolver for Watched<R> {
    fn load(&mut self, matrix: &Matrix) -> Result<(), ComplementarityError> {
        self.inner.load(matrix)
    }
    fn select(&mut self, matrix: &Matrix, free: &[bool]) -> Result<(), ComplementarityError> {
        self.inner.select(matrix, free)
    }
    fn solve(&mut self, r: &mut [f64], d: &mut [f64], tolerance: f64) -> Result<usize, ComplementarityError> {
        self.inner.solve(r, d, tolerance)
    }
    fn is_direct(&self) -> bool {
        self.inner.is_direct()
    }
    fn coarse_start(
        &mut self,
        lcp: &Lcp,
        options: &ActiveSetOptions,
    ) -> Result<Option<Start>, ComplementarityError> {
        let start = self.inner.coarse_start(lcp, options)?;
        self.start.borrow_mut().clone_from(&start);
        Ok(start)
    }
}

struct Run {
    z: Vec<f64>,
    states: Vec<BoundState>,
    start: Option<Start>,
    linear_iterations: usize,
}

fn solve<R: ReducedSolver>(lcp: &Lcp, inner: R) -> Run {
    let start = Rc::default();
    let watched = Watched {
        inner,
        start: Rc::clone(&start),
    };
    let mut solver = ActiveSetSolver::with_reduced(ActiveSetOptions::default(), watched);
    let mut z = vec![0.0; lcp.len()];
    let report = solver.solve(lcp, &mut z).unwrap();
    assert_eq!(report.status, Status::Solved);
    Run {
        z,
        states: solver.states().to_vec(),
        start: start.take(),
        linear_iterations: report.linear_iterations,
    }
}

/// Far from the solution the aggregation levels give a start; active sets and solution are those of exact solves.
#[test]
fn starts_from_aggregation_lead_to_the_solution_of_direct_solves() {
    for (m, auto) in [(50, false), (80, true)] {
        let lcp = torsion(m, 40.0);
        let direct = solve(&lcp, DirectReduced::new());
        assert_eq!(direct.linear_iterations, 0);
        assert!(direct.start.is_none());
        for state in [BoundState::Lower, BoundState::Interior, BoundState::Upper] {
            assert!(
                direct.states.iter().filter(|s| **s == state).count() > m,
                "{state:?}"
            );
        }
        let other = match auto {
            true => solve(&lcp, AutoReduced::new()),
            false => solve(&lcp, MultigridReduced::algebraic()),
        };
        assert!(other.linear_iterations > 0);
        assert_eq!(other.states, direct.states);
        let largest = |a: &[f64]| {
            let off = a.iter().zip(&direct.z).map(|(a, b)| (a - b).abs());
            off.fold(0.0, f64::max)
        };
        assert!(largest(&other.z) < 1e-8, "{:e}", largest(&other.z));
        // The start approximates the solution, whose largest value is about 1/4, on a coarse level: nine in ten components have the right
        // state.
        let start = other.start.unwrap();
        assert!(largest(&start.z) < 0.1, "{:e}", largest(&start.z));
        let wrong = start
            .states
            .iter()
            .zip(&direct.states)
            .filter(|(a, b)| a != b)
            .count();
        assert!(10 * wrong < m * m, "{wrong} of {}", m * m);
    }
}

/// Where nothing can be coarsened there is no start, and the iterative route is plain relaxation.
#[test]
fn what_does_not_coarsen_has_no_start() {
    let n = 80;
    let q: Vec<f64> = (0..n).map(|i| (i as f64 - 30.5) / 10.0).collect();
    let lcp = Lcp::new(Matrix::identity(n), q.clone()).unwrap();
    let mut reduced = MultigridReduced::algebraic();
    reduced.load(lcp.matrix()).unwrap();
    assert_eq!(
        reduced.coarse_start(&lcp, &ActiveSetOptions::default()).unwrap(),
        None
    );
    let z = solve(&lcp, reduced).z;
    assert!(z.iter().zip(&q).all(|(z, q)| (z - (-q).max(0.0)).abs() < 1e-12));
}

/// Conjugate gradients encounter a direction of negative curvature; the direct solver takes over, and a Cholesky factorisation is replaced
/// by LU. No bound is active, so that the solution is that of M z + q = 0.
#[test]
fn indefinite_symmetric_matrices_are_solved_directly() {
    for m in [12, 72] {
        // Eigenvalues of the Laplacian are 4 − 2 cos(iπh) − 2 cos(jπh); 0.7 lies among them, far inside.
        let matrix = laplacian(m, 0.7);
        let n = m * m;
        let known: Vec<f64> = (0..n).map(|k| (1.3 * k as f64).sin()).collect();
        let mut q = vec![0.0; n];
        matrix.mul_vec(&known, &mut q);
        q.iter_mut().for_each(|q| *q = -*q);
        let unbounded = |v: f64| vec![v; n];
        let lcp = Lcp::boxed(matrix, q, unbounded(f64::NEG_INFINITY), unbounded(f64::INFINITY)).unwrap();
        let z = solve(&lcp, AutoReduced::new()).z;
        let off = z
            .iter()
            .zip(&known)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(off < 1e-9, "{m}: {off:e}");
    }
}

/// Of two membranes on their obstacles the one without load stays there, with each component degenerate, while the other is lifted.
#[test]
fn a_membrane_at_rest_on_its_obstacle_stays_there() {
    let m = 24;
    let n = m * m;
    let one = laplacian(m, 0.0);
    let two: Vec<_> = one
        .triplets()
        .flat_map(|(i, j, v)| [(i, j, v), (n + i, n + j, v)])
        .collect();
    let two = Matrix::from_triplets(2 * n, 2 * n, &two).unwrap();
    for at in [BoundState::Lower, BoundState::Upper] {
        let sign = if at == BoundState::Lower { 1.0 } else { -1.0 };
        let load = |k: usize| match k < n {
            true => 0.0,
            false if point(m, k - n)[0] < 0.5 => -sign,
            false => 10.0 * sign,
        };
        let (lower, upper) = if sign > 0.0 { (0.0, 1e9) } else { (-1e9, 0.0) };
        let q = (0..2 * n).map(load).collect();
        let lcp = Lcp::boxed(two.clone(), q, vec![lower; 2 * n], vec![upper; 2 * n]).unwrap();
        let mut solver =
            ActiveSetSolver::with_reduced(ActiveSetOptions::default(), MultigridReduced::algebraic());
        let mut z = vec![0.0; 2 * n];
        let report = solver.solve_from_states(&lcp, &mut z, &vec![at; 2 * n]).unwrap();
        assert_eq!(report.status, Status::Solved);
        assert!(z[..n].iter().all(|z| *z == 0.0) && z[n..].iter().any(|z| sign * z > 1.0));
        assert!(solver.states()[..n].iter().all(|s| *s == at), "{at:?}");
    }
}
