//! Load paths of contact problems on finer and finer meshes: a vee-shaped body and a block with Coulomb friction on the ground.
//! You will see, for each, the number of transitions, what was factored and updated for them, and the time of each phase.
//! Run: cargo run --release --example families [-- --small] [--json]

#[macro_use]
mod common;
#[path = "common/families.rs"]
mod problems;

use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use common::{Outcome, exit};
use semismooth::contact::{FullContact, PlanarCoulomb};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination, Transition};
use serde_json::json;

/// Least time of the repetitions, so that the processor reaches its full speed.
const LEAST: Duration = Duration::from_millis(250);

/// Follows five load paths γ = 0 … 1 and prints what they cost, set-up included.
#[derive(Parser)]
struct Args {
    /// The two coarse meshes only.
    #[arg(long)]
    small: bool,
    /// One JSON object a line instead of a table.
    #[arg(long)]
    json: bool,
    /// Runs of each problem, at least; the fastest counts.
    #[arg(long, default_value_t = 3)]
    runs: usize,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

/// Costs of one load path, times in seconds.
struct Cost {
    condensation: f64,
    start: f64,
    path: f64,
    branch: Branch,
}

impl Cost {
    fn total(&self) -> f64 {
        self.condensation + self.start + self.path
    }
}

fn run(args: &Args) -> Outcome<()> {
    if args.runs == 0 {
        return Err("--runs must be at least 1".into());
    }
    let mut problems = vec![("vee", problems::vee(0)?), ("block", problems::block([10, 20])?)];
    if !args.small {
        problems.push(("vee", problems::vee(2)?));
        problems.push(("vee", problems::vee(3)?));
        problems.push(("block", problems::block([160, 64])?));
    }
    if !args.json {
        println!(
            "problem    dofs  nodes  transitions  folds  factorised  updated  corrected  condense/ms  start/ms  path/ms  all/ms"
        );
    }
    let mut rates = Vec::new();
    for (name, problem) in problems {
        let (n, p) = (problem.num_displacements(), problem.num_contacts());
        let mut best: Option<Cost> = None;
        let (begun, mut runs) = (Instant::now(), 0);
        while runs < args.runs || begun.elapsed() < LEAST {
            runs += 1;
            let cost = follow(problem.clone())?;
            if best.as_ref().is_none_or(|b| cost.total() < b.total()) {
                best = Some(cost);
            }
        }
        let Some(cost) = best else { continue };
        let branch = &cost.branch;
        let transitions: usize = branch.transitions.iter().map(changes).sum();
        let folds = branch.folds().len();
        let complete = branch.termination == Termination::ParameterRange;
        if args.json {
            println!(
                "{}",
                json!({
                    "problem": name,
                    "dofs": n,
                    "nodes": p,
                    "transitions": transitions,
                    "folds": folds,
                    "end": branch.termination.name(),
                    // The Cholesky factorisation of the stiffness, and those of condensed systems.
                    "factorisations": 1 + branch.factorisations,
                    "updates": branch.updates,
                    "corrections": branch.corrections,
                    "condensation_seconds": cost.condensation,
                    "start_seconds": cost.start,
                    "path_seconds": cost.path,
                })
            );
        } else {
            println!(
                "{name:<7}{n:>8}{p:>7}{transitions:>13}{folds:>7}{:>12}{:>9}{:>11}{:>13.3}{:>10.3}{:>9.3}{:>8.2}",
                format!("1 + {}", branch.factorisations),
                branch.updates,
                branch.corrections,
                cost.condensation * 1e3,
                cost.start * 1e3,
                cost.path * 1e3,
                cost.total() * 1e3,
            );
        }
        if !complete {
            return Err(format!("{name} with {p} nodes ended: {}", branch.termination).into());
        }
        rates.push((p as f64, cost.path / transitions.max(1) as f64));
    }
    if !args.json {
        let ((small, fast), (large, slow)) = match (rates.first(), rates.last()) {
            (Some(first), Some(last)) if first.0 < last.0 => (*first, *last),
            _ => return Ok(()),
        };
        println!(
            "\none transition: {:.1} µs with {small} nodes, {:.1} µs with {large}: grows like p^{:.2}",
            fast * 1e6,
            slow * 1e6,
            (slow / fast).ln() / (large / small).ln()
        );
    }
    Ok(())
}

/// Sites that change their piece at a transition: two sites may do so at one γ, as far as rounding can tell.
fn changes(t: &Transition) -> usize {
    t.sites.iter().filter(|c| c.from != c.to).count().max(1)
}

fn follow(problem: FullContact<PlanarCoulomb>) -> Outcome<Cost> {
    let begun = Instant::now();
    let map = problem.condensed()?;
    let condensation = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let x = map.solve(0.0, None)?;
    let start = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let branch = Branch::follow(&map, &x, Direction::Increasing, options)?;
    let path = begun.elapsed().as_secs_f64();
    Ok(Cost {
        condensation,
        start,
        path,
        branch,
    })
}
