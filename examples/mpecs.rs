//! Sixteen mathematical programs with equilibrium constraints: leaders who know how followers react.
//! You see, for each problem of the collection MacMPEC and each start, the value found by the bundle method beside the one of the list.
//! Run: cargo run --release --example mpecs
//!
//! The method is local: from some starts it ends at a stationary point that is not the best one. At least one start of each problem leads to
//! the value of the list, to all digits printed there.

#[macro_use]
mod common;
#[path = "common/macmpec.rs"]
mod problems;

use std::process::ExitCode;

use clap::Parser;
use common::Outcome;
use semismooth::optimise::Bundle;

/// Programs with equilibrium constraints of MacMPEC.
#[derive(Parser)]
struct Arguments {}

fn main() -> ExitCode {
    common::exit(run(&common::parse::<Arguments>()))
}

fn run(_: &Arguments) -> Outcome<()> {
    println!("problem         start        value    published  subgradient   radius  evaluations");
    for problem in problems::all() {
        let mut reached = false;
        for start in &problem.starts {
            let (_, report) = (problem.solve)(&Bundle::default(), start)?;
            let unit = 10.0_f64.powi(-(problem.digits as i32));
            let is_it = (report.value - problem.published).abs() <= 0.5 * unit * (1.0 + 1e-6);
            reached |= report.is_solved() && is_it;
            println!(
                "{:13} {:6}  {:11.*}  {:11}  {:11.1e}  {:7.0e}  {:11}  {}",
                problem.name,
                start[0],
                problem.digits,
                report.value,
                problem.published,
                report.subgradient_norm,
                report.radius,
                report.evaluations,
                if report.is_solved() {
                    String::new()
                } else {
                    report.to_string()
                },
            );
        }
        if !reached {
            return Err(format!("no start of {} leads to {}", problem.name, problem.published).into());
        }
    }
    Ok(())
}
