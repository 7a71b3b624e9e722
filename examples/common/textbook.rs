//! Newton's method with a nonmonotone line search and the method of Levenberg and Marquardt for Φ(x) = 0, as textbooks state them.

use semismooth::linear::{AutoSolver, LinearSolver};
use semismooth::piecewise::Semismooth;
use semismooth::sparse::Matrix;

use crate::common::Outcome;
use crate::contenders::Told;

/// Sufficient decrease of the line search, and the shortest step.
const SIGMA: f64 = 1e-4;
const SHORTEST: f64 = 1e-10;
/// d is a direction of descent where ∇ψᵀd ≤ −ρ ‖d‖ᵖ.
const RHO: f64 = 1e-8;
const POWER: f64 = 2.1;
const ITERATIONS: usize = 100;
/// ‖Φ‖₂ relative to that at the start, at which the methods stop.
const SMALL: f64 = 1e-13;

/// How directions are found.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Direction {
    /// Φ′ d = −Φ (T. De Luca, F. Facchinei, C. Kanzow, Math. Program. 75 (1996)).
    Newton,
    /// (Φ′ᵀ Φ′ + ‖Φ‖ I) d = −Φ′ᵀ Φ (F. Facchinei, C. Kanzow, Math. Program. 76 (1997); J. Fan, Y. Yuan, Computing 74 (2005)).
    Marquardt,
}

/// Minimises ψ = ½‖Φ‖². A step along d, or along −∇ψ where d does not descend, takes ψ below the largest of its last `memory` values
/// (L. Grippo, F. Lampariello, S. Lucidi, SIAM J. Numer. Anal. 23 (1986)); with a memory of 1 the line search is monotone.
pub(crate) fn minimise(map: &dyn Semismooth, x: &mut [f64], direction: Direction, memory: usize) -> Told {
    let n = x.len();
    let (mut phi, mut gradient, mut d) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut jacobian = Matrix::zeros(map.pattern());
    map.residual(x, &mut phi);
    // ‖Φ‖ of the iterates, and whether a full step along d led there.
    let mut history = vec![(norm(&phi), true)];
    let mut told = Told {
        evaluations: 1,
        ..Told::default()
    };
    let mut solver = None;
    for _ in 0..ITERATIONS {
        let size = history[history.len() - 1].0;
        if !size.is_finite() || size <= SMALL * history[0].0 {
            break;
        }
        jacobian.clear();
        map.jacobian(x, &mut jacobian);
        jacobian.mul_transpose_vec(&phi, &mut gradient);
        told.factorisations += 1;
        let solved = step(&mut solver, &jacobian, &phi, direction, &mut d).is_ok();
        let slope = |d: &[f64]| -> f64 { gradient.iter().zip(d).map(|(g, d)| g * d).sum() };
        let descends = solved && slope(&d) <= -RHO * norm(&d).powf(POWER);
        if !descends {
            d.iter_mut().zip(&gradient).for_each(|(d, g)| *d = -g);
        }
        let recent = &history[history.len().saturating_sub(memory)..];
        let reference = recent.iter().fold(0.0, |a: f64, b| a.max(b.0));
        let (slope, start) = (slope(&d), x.to_vec());
        let mut t = 1.0;
        loop {
            (0..n).for_each(|i| x[i] = start[i] + t * d[i]);
            map.residual(x, &mut phi);
            told.evaluations += 1;
            if norm(&phi).powi(2) <= reference * reference + 2.0 * SIGMA * t * slope {
                break;
            }
            t *= 0.5;
            if t < SHORTEST {
                x.copy_from_slice(&start);
                return told;
            }
        }
        told.iterations += 1;
        history.push((norm(&phi), descends && t == 1.0));
        told.order = order(&history);
    }
    told
}

/// From the last three norms above rounding, where full steps lead from one to the next.
fn order(history: &[(f64, bool)]) -> Option<f64> {
    let floor = SMALL * history[0].0;
    let above = history.iter().take_while(|h| h.0 > floor).count();
    let [.., a, b, c] = history[..above] else {
        return None;
    };
    (b.1 && c.1 && b.0 < a.0 && c.0 < b.0).then(|| (c.0 / b.0).ln() / (b.0 / a.0).ln())
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// d, by a solver that is created for the first of the matrices with one pattern.
fn step(
    solver: &mut Option<AutoSolver>,
    j: &Matrix,
    phi: &[f64],
    direction: Direction,
    d: &mut [f64],
) -> Outcome<()> {
    let n = phi.len();
    let mut solution: Vec<f64> = phi.iter().map(|r| -r).collect();
    let damped;
    let matrix = match direction {
        Direction::Newton => j,
        // [I, Φ′; Φ′ᵀ, −μ I] (r, d) = (−Φ, 0) does not square the condition of Φ′.
        Direction::Marquardt => {
            let mu = norm(phi);
            let identities = (0..n).flat_map(|i| [(i, i, 1.0), (n + i, n + i, -mu)]);
            let blocks = j.triplets().flat_map(|(i, k, v)| [(i, n + k, v), (n + k, i, v)]);
            let entries: Vec<_> = identities.chain(blocks).collect();
            solution.resize(2 * n, 0.0);
            damped = Matrix::from_triplets(2 * n, 2 * n, &entries)?;
            &damped
        }
    };
    let solver = match solver {
        Some(solver) => solver,
        None => {
            let mut new = AutoSolver::new();
            new.analyze(matrix.pattern().as_ref())?;
            solver.insert(new)
        }
    };
    solver.factor(matrix.as_ref())?;
    solver.solve_in_place(&mut solution)?;
    d.copy_from_slice(&solution[solution.len() - n..]);
    Ok(())
}
