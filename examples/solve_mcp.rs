//! Mixed complementarity problems from files: every one is solved from each of its starts.
//! You see one line a start: status, natural residual, iterations, evaluations of F, time, and the strategy that finished.
//! Run: cargo run --release --example solve_mcp -- [FILE…] [--json]
//!
//! The format is described at the head of `examples/common/expressions.rs`; `tests/data/complementarity` holds examples.

#[macro_use]
mod common;
#[path = "common/expressions.rs"]
mod expressions;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::Outcome;
use expressions::{Problem, read};
use semismooth::complementarity::{McpOptions, McpReport, McpSolver};
use serde_json::json;

/// Solves mixed complementarity problems from all their starts.
#[derive(Parser)]
struct Arguments {
    /// JSON files, one problem each; default: those shipped
    files: Vec<PathBuf>,
    /// Print one JSON object a start
    #[arg(long)]
    json: bool,
    /// Bound on the natural residual
    #[arg(long, default_value_t = McpOptions::default().tolerance)]
    tolerance: f64,
    /// Largest number of iterations a start
    #[arg(long, default_value_t = McpOptions::default().max_iterations)]
    max_iterations: usize,
    /// Largest time a start, in seconds
    #[arg(long)]
    max_time: Option<f64>,
}

fn main() -> ExitCode {
    common::exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let options = McpOptions::default()
        .with_tolerance(arguments.tolerance)
        .with_max_iterations(arguments.max_iterations)
        .with_max_time(common::time_limit(arguments.max_time)?);
    options.validate()?;
    // All files are read before anything is solved, so that an invalid one is reported at once.
    let files = common::files_or_shipped(&arguments.files, "complementarity")?;
    let problems = files.iter().map(|f| read(f)).collect::<Result<Vec<_>, _>>()?;
    let mut solver = McpSolver::new(options);
    let (mut solved, mut all) = (0, 0);
    for problem in &problems {
        for (label, start) in &problem.starts {
            let begun = Instant::now();
            let mut x = start.clone();
            let report = solver
                .solve(&problem.mcp, &mut x)
                .map_err(|e| format!("{}, start {label}: {e}", problem.name))?;
            let seconds = begun.elapsed().as_secs_f64();
            all += 1;
            solved += usize::from(report.is_solved());
            print(arguments.json, problem, label, report, seconds, &x);
        }
    }
    if !arguments.json {
        println!("{solved} of {all} starts solved");
    }
    if arguments.files.is_empty() {
        common::ensure(solved == all, "every shipped problem is solved from every start")?;
    }
    Ok(())
}

fn print(as_json: bool, problem: &Problem, label: &str, report: &McpReport, seconds: f64, x: &[f64]) {
    if as_json {
        let record = json!({
            "problem": problem.name,
            "start": label,
            "status": report.status.name(),
            "residual": report.residual,
            "iterations": report.iterations,
            "evaluations": report.evaluations,
            "seconds": seconds,
            "x": x,
            "strategy": report.strategy.name(),
            "message": report.status.to_string(),
        });
        println!("{record}");
        return;
    }
    let tried: Vec<&str> = report.fallbacks.iter().map(|f| f.strategy.name()).collect();
    let after = match tried.is_empty() || !report.is_solved() {
        true => String::new(),
        false => format!(" (after {})", tried.join(", ")),
    };
    println!(
        "{:18} {:10} {:11} residual {:8.1e} iterations {:4} evaluations {:5} {:9.2e} s  {}{}",
        problem.name,
        label,
        report.status.name(),
        report.residual,
        report.iterations,
        report.evaluations,
        seconds,
        report.strategy,
        after
    );
    if !report.is_solved() {
        println!("    {}", report.status);
    }
}
