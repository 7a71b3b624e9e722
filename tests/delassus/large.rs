//! Problems whose order is beyond dense and plain sparse factorisations in the interior-point phase.

use semismooth::contact::{DelassusPhase, DelassusProblem};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

use super::random::Random;
use super::{oracle, solve};

/// Coupling of neighbouring blocks on a grid: (forward, backward) parts.
#[derive(Clone, Copy)]
enum Coupling {
    /// Kᵀ is K.
    Symmetric,
    /// As springs, with a skew part on top: the structure is symmetric, the values are not.
    Turning(f64),
    /// As springs along columns; along rows only neighbours on one side act: not even the structure is symmetric.
    Upwind,
    /// The coupling is entirely skew: the triangle that symmetric solvers read is far from definite.
    Skew(f64),
}

/// Contacts on an `m` × `k` grid (a chain for k = 1) coupled to their neighbours, made from a solution: M has a definite symmetric part
/// that hardly exceeds `shift` on waves across the grid, so that sweeps alone take long. Returns the problem and its solution.
fn grid(
    d: usize,
    [m, k]: [usize; 2],
    coupling: Coupling,
    shift: f64,
    seed: u64,
) -> (DelassusProblem, Vec<f64>) {
    let mut s = Random::new(seed);
    let nc = m * k;
    // One contact against the other: normal and tangents are coupled.
    let block = |a: usize, c: usize| match (a, c) {
        _ if a == c => 1.0,
        (0, 1) | (1, 0) => 0.3,
        _ => 0.1,
    };
    let mut t = Vec::new();
    let mut add = |i: usize, j: usize, factor: f64| {
        for a in 0..d {
            for c in 0..d {
                t.push((d * i + a, d * j + c, factor * block(a, c)));
            }
        }
    };
    for i in 0..nc {
        let links = [(i % m + 1 < m).then_some(i + 1), (i + m < nc).then_some(i + m)];
        for j in links.into_iter().flatten() {
            let (forward, backward) = match coupling {
                Coupling::Symmetric => (-1.0, -1.0),
                Coupling::Turning(turn) => (-1.0 - turn, -1.0 + turn),
                Coupling::Upwind => (if j == i + 1 { 0.0 } else { -1.0 }, -1.0),
                Coupling::Skew(turn) => (-turn, turn),
            };
            let own = f64::from(!matches!(coupling, Coupling::Skew(_)));
            add(i, i, own);
            add(j, j, own);
            if forward != 0.0 {
                add(i, j, forward);
            }
            add(j, i, backward);
        }
        add(i, i, shift);
    }
    let matrix = Matrix::from_triplets(d * nc, d * nc, &t).unwrap();
    let (mut r, mut u, mut friction) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..nc {
        let angle = s.between(0.0, 6.3);
        let along = match d {
            2 => [angle.cos().signum(), 0.0],
            _ => [angle.cos(), angle.sin()],
        };
        let (normal, slip) = (s.between(0.5, 1.0), s.between(0.5, 1.0));
        let mu = if s.below(4) == 0 {
            0.0
        } else {
            s.between(0.05, 0.15)
        };
        let (rn, rt, un, ut) = match s.below(3) {
            0 => (0.0, 0.0, normal, slip),
            1 if mu > 0.0 => (normal, 0.5 * mu * normal, 0.0, 0.0),
            _ => (normal, -mu * normal, 0.0, slip),
        };
        r.push(rn);
        u.push(un);
        for a in &along[..d - 1] {
            r.push(rt * a);
            u.push(ut * a);
        }
        friction.push(mu);
    }
    let mut q = vec![0.0; d * nc];
    matrix.mul_vec(&r, &mut q);
    q.iter_mut().zip(&u).for_each(|(q, u)| *q = u - *q);
    (DelassusProblem::new(d, matrix, q, friction).unwrap(), r)
}

/// All of them need the interior-point phase; friction is small enough for the solution to be unique.
#[test]
fn constructed_problems_of_many_contacts_are_solved() {
    for (d, size, coupling, shift) in [
        (2, [800, 1], Coupling::Symmetric, 1e-2),
        (3, [510, 1], Coupling::Symmetric, 1e-2),
        (2, [28, 28], Coupling::Symmetric, 1e-2),
        (3, [24, 24], Coupling::Symmetric, 1e-2),
        (3, [24, 24], Coupling::Turning(0.2), 1e-2),
        (2, [40, 40], Coupling::Turning(0.05), 1e-2),
        (3, [24, 24], Coupling::Upwind, 1e-2),
        (2, [30, 30], Coupling::Skew(0.6), 1.0),
        (3, [24, 24], Coupling::Skew(0.6), 1.0),
    ] {
        let (p, known) = grid(d, size, coupling, shift, 7);
        assert!(d * p.contacts() >= 1500 && p.friction().contains(&0.0));
        assert!(oracle::residual(&p, &known) < 1e-14);
        let report = solve(&p);
        let residual = oracle::worst(&p, &report.r);
        let interior = report
            .history
            .iter()
            .filter(|e| e.phase == DelassusPhase::Interior);
        let name = format!("d = {d}, {size:?}");
        let off = report
            .r
            .iter()
            .zip(&known)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert_eq!(report.status, Status::Solved, "{name}: {residual:e}");
        assert!(residual < 1.01e-12, "{name}: {residual:e}");
        assert!(off < 1e-9, "{name}: {off:e}");
        assert!(interior.count() > 0, "{name}: sweeps alone solved it");
    }
}
