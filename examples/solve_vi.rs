//! Variational inequalities over polyhedra from files: every one is solved from each of its starts. You see one line a start: status,
//! ‖x − P(x − F(x))‖_∞, x, iterations, time, below it the certificate where there is no solution; with --all complete lists of the affine
//! ones. Run: cargo run --release --example solve_vi -- [FILE…] [--all] [--json]
//!
//! The format is described at the head of `examples/common/inequalities.rs`; `tests/data/vi` holds examples.

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
use common::{Outcome, distance, ensure};
use inequalities::{Problem, read_vi};
use semismooth::complementarity::McpOptions;
use semismooth::enumeration::{Completeness, EnumerationOptions};
use semismooth::run::Status;
use semismooth::variational::{Multipliers, ViReport, ViSolutions, ViSolver};
use serde_json::json;

/// Solves variational inequalities over polyhedra from all their starts.
#[derive(Parser)]
struct Arguments {
    /// JSON files, one problem each; the shipped ones when left out
    files: Vec<PathBuf>,
    /// Print one JSON object a start
    #[arg(long)]
    json: bool,
    /// List all solutions of affine problems, too
    #[arg(long)]
    all: bool,
    /// Largest time a start, in seconds
    #[arg(long)]
    max_time: Option<f64>,
}

fn main() -> ExitCode {
    common::exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let options = McpOptions::default().with_max_time(common::time_limit(arguments.max_time)?);
    // All files are read before anything is solved, so that an invalid one is reported at once.
    let files = common::files_or_shipped(&arguments.files, "vi")?;
    let problems = files.iter().map(|f| read_vi(f)).collect::<Result<Vec<_>, _>>()?;
    let mut solver = ViSolver::new(options);
    let (mut right, mut all) = (0, 0);
    for (problem, vi) in &problems {
        for (label, start) in &problem.starts {
            let begun = Instant::now();
            let mut x = start.clone();
            let report = solver
                .solve(vi, &mut x)
                .map_err(|e| format!("{}, start {label}: {e}", problem.name))?;
            all += 1;
            right += usize::from(match report.status {
                Status::Solved => problem.solvable,
                Status::EmptySet | Status::NoSolution => !problem.solvable,
                _ => false,
            });
            print(arguments.json, problem, label, &report, begun.elapsed(), &x);
        }
        if arguments.all {
            let begun = Instant::now();
            match vi.all_solutions(&EnumerationOptions::default()) {
                Ok(list) => {
                    print_all(arguments.json, problem, &list, begun.elapsed());
                    if arguments.files.is_empty() && problem.all {
                        compare(problem, &list)?;
                    }
                }
                Err(e) => println!("{}: no list: {e}", problem.name),
            }
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

fn print(as_json: bool, problem: &Problem, label: &str, report: &ViReport, time: Duration, x: &[f64]) {
    let (status, iterations, seconds) = (report.status.name(), report.mcp.iterations, time.as_secs_f64());
    if as_json {
        let proof = |m: &Multipliers, value: f64, radius: f64| {
            let mut proof = json!({"A": m.inequalities, "E": m.equations, "lower": m.lower, "upper": m.upper, "value": value});
            // JSON has no infinity: without a radius the proof holds everywhere.
            proof["radius"] = json!(Some(radius).filter(|r| r.is_finite()));
            proof
        };
        let ray = report.ray.as_ref().map(|r| {
            let mut ray = proof(&r.multipliers, r.value, r.radius);
            ray["v"] = json!(r.direction);
            ray
        });
        let farkas = report.infeasibility.as_ref();
        let farkas = farkas.map(|c| proof(&c.multipliers, c.value, c.radius));
        let m = &report.multipliers;
        let record = json!({
            "name": problem.name,
            "start": label,
            "status": status,
            "residual": report.residual,
            "x": x,
            "multipliers": {"A": m.inequalities, "E": m.equations, "lower": m.lower, "upper": m.upper},
            "iterations": iterations,
            "seconds": seconds,
            "ray": ray,
            "farkas": farkas,
        });
        println!("{record}");
        return;
    }
    println!(
        "{}, {label}, {status}, {:.1e}, {}, {iterations}, {seconds:.4}",
        problem.name,
        report.residual,
        common::short_list(x)
    );
    let certificate = |name: &str, v: &[f64], m: &Multipliers, value: f64, radius: f64| {
        let lists = [
            ("A", &m.inequalities),
            ("E", &m.equations),
            ("lower", &m.lower),
            ("upper", &m.upper),
        ];
        let lists = lists.iter().filter(|(_, list)| list.iter().any(|v| *v != 0.0));
        let lists: String = lists
            .map(|(name, list)| format!(", {name} {}", common::short_list(list)))
            .collect();
        let v = if v.is_empty() {
            String::new()
        } else {
            format!(", v {}", common::short_list(v))
        };
        println!("    {name}: value {value:.3e}{v}{lists}, radius {radius:.1e}");
    };
    if let Some(r) = &report.ray {
        certificate("ray", &r.direction, &r.multipliers, r.value, r.radius);
    }
    if let Some(c) = &report.infeasibility {
        certificate("empty set", &[], &c.multipliers, c.value, c.radius);
    }
}

fn print_all(as_json: bool, problem: &Problem, list: &ViSolutions, time: Duration) {
    let complete = list.completeness == Completeness::Complete;
    if as_json {
        let record = json!({
            "name": problem.name,
            "all": list.solutions,
            "continua": list.continua.len(),
            "complete": complete,
            "seconds": time.as_secs_f64(),
        });
        println!("{record}");
        return;
    }
    let certainty = match list.completeness {
        Completeness::Complete => "complete",
        Completeness::Undecided { .. } => "complete up to rounding",
        _ => "not complete",
    };
    println!(
        "{}: solutions: {}, continua: {}, {certainty}, {:.4} s",
        problem.name,
        list.solutions.len(),
        list.continua.len(),
        time.as_secs_f64()
    );
    for x in &list.solutions {
        println!("    {}", common::short_list(x));
    }
}

/// The list found against the one in the file.
fn compare(problem: &Problem, list: &ViSolutions) -> Outcome<()> {
    let near = |x: &Vec<f64>| problem.solutions.iter().any(|y| distance(x, y) < 1e-9);
    ensure(
        list.continua.is_empty()
            && list.solutions.len() == problem.solutions.len()
            && list.solutions.iter().all(near),
        &format!("{}: all solutions are those of its file", problem.name),
    )
}
