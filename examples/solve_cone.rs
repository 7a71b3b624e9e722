//! Complementarity problems over cones from files: every one is solved from each of its starts.
//! You see one line a start: status, ‖x − P(x − F(x))‖_∞, x, iterations, time, below it the certificate where there is no solution.
//! Run: cargo run --release --example solve_cone -- [FILE…] [--json]
//!
//! The format is described at the head of `examples/common/inequalities.rs`; `tests/data/cones` holds examples.

#[macro_use]
mod common;
#[path = "common/expressions.rs"]
mod expressions;
#[path = "common/inequalities.rs"]
mod inequalities;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use common::{Outcome, ensure};
use inequalities::{Problem, read_cone};
use semismooth::cones::{ConeOptions, ConeReport, ConeSolver};
use semismooth::run::Status;
use serde_json::json;

/// Solves complementarity problems over cones from all their starts.
#[derive(Parser)]
struct Arguments {
    /// JSON files, one problem each; the shipped ones when left out
    files: Vec<PathBuf>,
    /// Print one JSON object a start
    #[arg(long)]
    json: bool,
    /// Largest time a start, in seconds
    #[arg(long)]
    max_time: Option<f64>,
}

fn main() -> ExitCode {
    common::exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let options = ConeOptions::default().with_max_time(common::time_limit(arguments.max_time)?);
    // All files are read before anything is solved, so that an invalid one is reported at once.
    let files = common::files_or_shipped(&arguments.files, "cones")?;
    let problems = files
        .iter()
        .map(|f| read_cone(f))
        .collect::<Result<Vec<_>, _>>()?;
    let solver = ConeSolver::new(options);
    let (mut right, mut all) = (0, 0);
    for (problem, cones) in &problems {
        for (label, start) in &problem.starts {
            let begun = Instant::now();
            let mut x = start.clone();
            let report = solver
                .solve(cones, &mut x)
                .map_err(|e| format!("{}, start {label}: {e}", problem.name))?;
            all += 1;
            right += usize::from(match report.status {
                Status::Solved => problem.solvable,
                Status::NoSolution => !problem.solvable,
                _ => false,
            });
            print(arguments.json, problem, label, &report, begun.elapsed(), &x);
        }
    }
    if !arguments.json {
        println!("{right} of {all} starts solved, or proven to have no solution");
    }
    if arguments.files.is_empty() {
        ensure(
            right == all,
            "every shipped problem ends as its file says, from every start",
        )?;
    }
    Ok(())
}

fn print(as_json: bool, problem: &Problem, label: &str, report: &ConeReport, time: Duration, x: &[f64]) {
    let (iterations, seconds) = (report.iterations, time.as_secs_f64());
    if as_json {
        let ray = report
            .ray
            .as_ref()
            .map(|r| json!({"v": r.direction, "value": r.value, "radius": Some(r.radius).filter(|r| r.is_finite())}));
        let record = json!({
            "name": problem.name,
            "start": label,
            "status": report.status.name(),
            "residual": report.residual,
            "error": report.error,
            "x": x,
            "iterations": iterations,
            "seconds": seconds,
            "ray": ray,
        });
        println!("{record}");
        return;
    }
    println!(
        "{}, {label}, {}, {:.1e}, {}, {iterations}, {seconds:.4}",
        problem.name,
        report.status.name(),
        report.residual,
        common::short_list(x)
    );
    if let Some(r) = &report.ray {
        let v = common::short_list(&r.direction);
        println!("    ray: value {:.3e}, v {v}, radius {:.1e}", r.value, r.radius);
    }
}
