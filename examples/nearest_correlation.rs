//! Semidefinite complementarity: the correlation matrix nearest to a given one, and the Lovász number of a cycle graph.
//!
//! 1. Correlations that are estimated pair by pair need not form a correlation matrix: A has eigenvalues below zero. The nearest X with
//!    unit diagonal and without such eigenvalues (N. Higham, IMA J. Numer. Anal. 22 (2002)) solves X ⪰ 0 ⟂ X − A − Diag y ⪰ 0, diag X = e:
//!    a [`ConeProblem`] of free multipliers y and one [`Cone::Semidefinite`]. The dual value of y, eᵀy + ½‖A‖² − ½‖(A + Diag y)₊‖², is a
//!    lower bound of the squared distance; both agree at the solution (H. Qi, D. Sun, SIAM J. Matrix Anal. Appl. 28 (2006)).
//! 2. max ⟨eeᵀ, X⟩ with tr X = 1, Xᵢⱼ = 0 on the edges of a cycle of n vertices, n odd, is n cos(π/n)/(1 + cos(π/n)) (L. Lovász, IEEE
//!    Trans. Inf. Theory 25 (1979)): √5 for the pentagon.
//!
//! You will see for each order the steps, the distance, how far the two values differ, and the time.
//!
//! ```text
//! cargo run --release --example nearest_correlation -- --orders 10,20,50
//! ```

#[macro_use]
mod common;

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, Random, ensure, exit};
use semismooth::complementarity::AffineFunction;
use semismooth::cones::{Cone, ConeProblem, ConeSolver, smat, svec};
use semismooth::sparse::Matrix;

#[derive(Parser)]
#[command(about = "Nearest correlation matrices and Lovász numbers by semidefinite complementarity")]
struct Arguments {
    /// Orders of the matrices (2 to 60).
    #[arg(long, value_delimiter = ',', default_values_t = [5, 10, 20])]
    orders: Vec<usize>,
    /// Size of the errors in the correlations (0.01 to 1).
    #[arg(long, default_value_t = 0.3)]
    errors: f64,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    if !arguments.orders.iter().all(|k| (2..=60).contains(k)) || !(0.01..=1.0).contains(&arguments.errors) {
        return Err("--orders go from 2 to 60, --errors from 0.01 to 1".into());
    }
    println!("nearest correlation matrix, errors of {}", arguments.errors);
    println!("order  steps  eigenvalues of A < 0  ½‖X − A‖²     less the dual value  seconds");
    for &order in &arguments.orders {
        nearest(order, arguments.errors)?;
    }
    println!("\nLovász number of a cycle");
    println!("vertices  steps  ϑ            differs from n cos(π/n)/(1 + cos(π/n)) by");
    for n in [5, 7, 9] {
        circle(n)?;
    }
    Ok(())
}

/// Correlations of `order` returns that follow three factors, with errors.
fn estimated(order: usize, errors: f64) -> Vec<Vec<f64>> {
    let mut random = Random::new(order as u64);
    let loads: Vec<[f64; 4]> = (0..order)
        .map(|_| {
            let v = [(); 4].map(|()| random.symmetric());
            let length = v.iter().map(|v| v * v).sum::<f64>().sqrt();
            v.map(|v| v / length)
        })
        .collect();
    let mut rows = vec![vec![1.0; order]; order];
    for j in 0..order {
        for i in 0..j {
            let exact: f64 = loads[i].iter().zip(&loads[j]).map(|(a, b)| a * b).sum();
            rows[i][j] = (exact + errors * random.symmetric()).clamp(-1.0, 1.0);
            rows[j][i] = rows[i][j];
        }
    }
    rows
}

/// Places of the diagonal in the vector of a matrix.
fn diagonal(order: usize) -> impl Iterator<Item = usize> {
    (0..order).map(|k| k * (k + 3) / 2)
}

fn half_square(x: &[f64]) -> f64 {
    0.5 * x.iter().map(|v| v * v).sum::<f64>()
}

fn nearest(order: usize, errors: f64) -> Outcome<()> {
    let given = svec(&estimated(order, errors))?;
    let n = given.len();
    // F = (diag X − e, X − A − Diag y).
    let mut entries: Vec<(usize, usize, f64)> = (0..n).map(|j| (order + j, order + j, 1.0)).collect();
    for (k, place) in diagonal(order).enumerate() {
        entries.extend([(k, order + place, 1.0), (order + place, k, -1.0)]);
    }
    let constants = (0..order).map(|_| -1.0).chain(given.iter().map(|v| -v)).collect();
    let f = AffineFunction::new(Matrix::from_triplets(order + n, order + n, &entries)?, constants)?;
    let cone = Cone::Semidefinite(order);
    let problem = ConeProblem::new(f, vec![Cone::Free(order), cone])?;
    let begun = Instant::now();
    let mut x = vec![0.0; order + n];
    let report = ConeSolver::default().solve(&problem, &mut x)?;
    let seconds = begun.elapsed().as_secs_f64();
    ensure(report.is_solved(), &format!("order {order}: {report}"))?;
    let (y, x) = x.split_at(order);
    let difference: Vec<f64> = x.iter().zip(&given).map(|(x, a)| x - a).collect();
    let value = half_square(&difference);
    let mut shifted = given.clone();
    diagonal(order).zip(y).for_each(|(place, y)| shifted[place] += y);
    cone.project(&mut shifted);
    let dual = y.iter().map(|y| -y).sum::<f64>();
    let gap = value - (half_square(&given) - half_square(&shifted) - dual);
    let wrong = negative(&given)?;
    println!(
        "{order:5}  {:5}  {wrong:20}  {value:<12.8}  {gap:19.1e}  {seconds:7.2}",
        report.iterations
    );
    let off = diagonal(order).map(|k| (x[k] - 1.0).abs()).fold(0.0, f64::max);
    ensure(
        gap.abs() <= 1e-8 * (1.0 + value) && off < 1e-9,
        &format!("order {order}: gap {gap:e}, diagonal off by {off:e}"),
    )
}

/// Number of eigenvalues below zero, by the signs in an LDLᵀ factorisation (Sylvester).
fn negative(x: &[f64]) -> Outcome<usize> {
    let mut rows = smat(x)?;
    let mut count = 0;
    for k in 0..rows.len() {
        let (upper, lower) = rows.split_at_mut(k + 1);
        let pivot = &upper[k];
        count += usize::from(pivot[k] < 0.0);
        for row in lower {
            let factor = row[k] / pivot[k];
            row.iter_mut().zip(pivot).for_each(|(r, p)| *r -= factor * p);
        }
    }
    Ok(count)
}

fn circle(n: usize) -> Outcome<()> {
    let entry = |value: f64, at: &dyn Fn(usize, usize) -> bool| {
        let row = |i: usize| {
            (0..n)
                .map(|j| if at(i, j) { value } else { 0.0 })
                .collect::<Vec<f64>>()
        };
        svec(&(0..n).map(row).collect::<Vec<_>>())
    };
    let mut rows = vec![entry(1.0, &|i, j| i == j)?];
    for k in 0..n {
        let next = (k + 1) % n;
        rows.push(entry(1.0, &|i, j| (i, j) == (k, next) || (j, i) == (k, next))?);
    }
    let cost = entry(-1.0, &|_, _| true)?;
    let (k, m) = (rows.len(), cost.len());
    let mut entries = Vec::new();
    for (r, row) in rows.iter().enumerate() {
        for (j, v) in row.iter().enumerate().filter(|e| *e.1 != 0.0) {
            entries.extend([(r, k + j, *v), (k + j, r, -v)]);
        }
    }
    let mut constants = vec![0.0; k];
    constants[0] = -1.0;
    constants.extend_from_slice(&cost);
    let f = AffineFunction::new(Matrix::from_triplets(k + m, k + m, &entries)?, constants)?;
    let problem = ConeProblem::new(f, vec![Cone::Free(k), Cone::Semidefinite(n)])?;
    let mut x = vec![0.0; k + m];
    let report = ConeSolver::default().solve(&problem, &mut x)?;
    ensure(report.is_solved(), &format!("{n} vertices: {report}"))?;
    let value: f64 = x[k..].iter().zip(&cost).map(|(x, c)| -x * c).sum();
    let cos = (std::f64::consts::PI / n as f64).cos();
    let off = value - n as f64 * cos / (1.0 + cos);
    println!("{n:8}  {:5}  {value:<11.9}  {off:.1e}", report.iterations);
    ensure(off.abs() < 1e-8, &format!("{n} vertices: off by {off:e}"))
}
