//! Small linear complementarity problems: the one of PATH's README, solved by four methods and by complete enumeration, each answer
//! verified; then the families of Murty and Fathi, on which pivoting methods may need exponentially many exchanges.
//!
//! You will see the same verified solution from every method, Lemke's method stop at its limit where active sets need a few dozen
//! iterations, and a certificate for a problem without solution.
//!
//! ```text
//! cargo run --release --example lcp_pivoting -- --n 200
//! ```

#[macro_use]
mod common;

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, exit, list};
use semismooth::complementarity::active_set::ActiveSetSolver;
use semismooth::complementarity::pivoting::{Lemke, LemkeOptions};
use semismooth::complementarity::{Lcp, McpSolver};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

#[derive(Parser)]
#[command(about = "Pivoting, active sets and enumeration for linear complementarity problems")]
struct Arguments {
    /// Unknowns of the families of Murty and Fathi (2 to 2000).
    #[arg(long, default_value_t = 60)]
    n: usize,
    /// Exchanges after which Lemke's method stops.
    #[arg(long, default_value_t = 5000)]
    limit: usize,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    if !(2..=2000).contains(&arguments.n) {
        return Err(format!("--n {} is out of range; it must be 2 to 2000", arguments.n).into());
    }
    readme_of_path()?;
    for (name, family) in [("Murty", murty(arguments.n)?), ("Fathi", fathi(arguments.n)?)] {
        exponential(name, &family, arguments.limit)?;
    }
    without_solution()
}

/// 0 ≤ z ≤ 10; a version of PATH gave wrong answers here, so each answer is checked.
fn readme_of_path() -> Outcome<()> {
    println!("PATH's README: 4 unknowns in [0, 10]");
    let matrix = Matrix::from_rows(&[
        [0.0, 0.0, -1.0, -1.0],
        [0.0, 0.0, 1.0, -2.0],
        [1.0, -1.0, 2.0, -2.0],
        [1.0, 2.0, -2.0, 4.0],
    ])?;
    let lcp = Lcp::boxed(matrix, vec![2.0, 2.0, -2.0, -6.0], vec![0.0; 4], vec![10.0; 4])?;
    let mut z = vec![0.0; 4];
    let report = Lemke::default().solve(&lcp, &mut z)?;
    show("Lemke", &lcp, &z, &format!("exchanges: {}", report.pivots))?;
    let mut z = vec![0.0; 4];
    // M has a zero block, so reduced systems may be singular: the status reports this.
    let report = ActiveSetSolver::default().solve(&lcp, &mut z)?;
    match report.status {
        Status::Solved => show(
            "active sets",
            &lcp,
            &z,
            &format!("iterations: {}", report.iterations),
        )?,
        other => println!("  {:12} {other}: M is no P matrix", "active sets"),
    }
    let mut z = vec![0.0; 4];
    let mut solver = McpSolver::default();
    let iterations = solver.solve(lcp.mcp(), &mut z)?.iterations;
    show("Newton", &lcp, &z, &format!("iterations: {iterations}"))?;
    let set = all_solutions(lcp.mcp(), 0.0, &EnumerationOptions::default())?;
    for solution in &set.solutions {
        show(
            "enumeration",
            &lcp,
            &solution.x,
            &format!("complete: {}", set.completeness.is_complete()),
        )?;
    }
    println!(
        "  {} solution(s), {} continua",
        set.solutions.len(),
        set.continua.len()
    );
    Ok(())
}

fn show(method: &str, lcp: &Lcp, z: &[f64], effort: &str) -> Outcome<()> {
    let residual = lcp.natural_residual(z, &mut vec![0.0; z.len()])?;
    let digits: Vec<String> = z.iter().map(|z| format!("{z:.6}")).collect();
    println!(
        "  {method:12} z = ({}), natural residual {residual:.1e}, {effort}",
        digits.join(", ")
    );
    if residual < 1e-9 {
        Ok(())
    } else {
        Err(format!("the answer of {method} is no solution: residual {residual:e}").into())
    }
}

/// 1 on the diagonal, 2 below; the solution is the first unit vector (K. G. Murty, 1978).
fn murty_entry(i: usize, j: usize) -> f64 {
    match i.cmp(&j) {
        std::cmp::Ordering::Less => 0.0,
        std::cmp::Ordering::Equal => 1.0,
        std::cmp::Ordering::Greater => 2.0,
    }
}

fn family(n: usize, entry: impl Fn(usize, usize) -> f64) -> Outcome<Lcp> {
    let rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
    Ok(Lcp::new(Matrix::from_rows(&rows)?, vec![-1.0; n])?)
}

fn murty(n: usize) -> Outcome<Lcp> {
    family(n, murty_entry)
}

/// L Lᵀ with Murty's L: symmetric positive definite (Y. Fathi, 1979).
fn fathi(n: usize) -> Outcome<Lcp> {
    family(n, |i, j| {
        let k = i.min(j) as f64;
        4.0 * k + if i == j { 1.0 } else { 2.0 }
    })
}

fn exponential(name: &str, lcp: &Lcp, limit: usize) -> Outcome<()> {
    println!("{name}, n = {}", lcp.len());
    let mut z = vec![0.0; lcp.len()];
    let begin = Instant::now();
    let report = Lemke::new(LemkeOptions::default().with_max_pivots(limit)).solve(lcp, &mut z)?;
    println!(
        "  Lemke        {} after {} exchanges, {:.1?}",
        report.status,
        report.pivots,
        begin.elapsed()
    );
    z.fill(0.0);
    let begin = Instant::now();
    let report = ActiveSetSolver::default().solve(lcp, &mut z)?;
    println!(
        "  active sets  {} after {} iterations, residual {:.1e}, {:.1?}",
        report.status,
        report.iterations,
        report.residual,
        begin.elapsed()
    );
    if report.status != Status::Solved || (z[0] - 1.0).abs() > 1e-9 {
        return Err(format!("{name}'s problem was not solved").into());
    }
    Ok(())
}

/// A positive semidefinite matrix, but no z ≥ 0 with M z + q ≥ 0.
fn without_solution() -> Outcome<()> {
    let lcp = Lcp::new(Matrix::from_rows(&[[1.0, -1.0], [-1.0, 1.0]])?, vec![-1.0, -1.0])?;
    let mut z = vec![0.0; 2];
    let mut solver = Lemke::default();
    let report = solver.solve(&lcp, &mut z)?;
    println!("a problem without solution");
    println!(
        "  Lemke        {}, certificate v = ({}): v ≥ 0, Mᵀv ≤ 0, qᵀv < 0",
        report.status.name(),
        list(solver.ray().unwrap_or_default(), 3)
    );
    match report.status {
        Status::NoSolution => Ok(()),
        other => Err(format!("no certificate: {other}").into()),
    }
}
