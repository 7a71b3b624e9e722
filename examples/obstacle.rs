//! Obstacle problems on a square: a membrane between two obstacles (MCPLIB), over a hemisphere with a known solution, and
//! elastic-plastic torsion, as complementarity problems with m² unknowns.
//!
//! You will see a table of the levels with their iterations, times and, for the hemisphere, the error against the exact solution;
//! and in `out/contact_*.svg` the contact set (where the lower obstacle is met: red, the upper: blue).
//!
//! ```text
//! cargo run --release --example obstacle -- --m 400 --problem hemisphere --nested
//! ```

#[macro_use]
mod common;
#[path = "common/obstacles.rs"]
mod obstacles;
#[path = "common/raster.rs"]
mod raster;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, exit, file_in};
use obstacles::{Grid, Problem, exact, nested};
use raster::{raster, square, with_classes};
use semismooth::complementarity::BoundState;
use semismooth::complementarity::active_set::{
    ActiveSetIteration, ActiveSetOptions, ActiveSetReport, ActiveSetSolver, DirectReduced,
};
use semismooth::output::{BranchDiagram, Colour, Panel};
use semismooth::run::Status;

#[derive(Parser)]
#[command(about = "Obstacle problems and elastic-plastic torsion on an m x m grid")]
struct Arguments {
    /// Interior points a side (3 to 4000).
    #[arg(long, default_value_t = 60)]
    m: usize,
    /// Which problem; all three by default.
    #[arg(long, value_enum)]
    problem: Option<Problem>,
    /// Solve coarse grids first, and start from their solutions
    #[arg(long)]
    nested: bool,
    /// Solve reduced systems by Cholesky factorisation whatever their size.
    #[arg(long, conflicts_with = "nested")]
    direct: bool,
    /// Print every iteration.
    #[arg(long)]
    verbose: bool,
    /// Folder for the pictures.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let m = arguments.m;
    if !(3..=4000).contains(&m) {
        return Err(format!("--m {m} is out of range; it must be 3 to 4000").into());
    }
    let problems = match arguments.problem {
        Some(problem) => vec![problem],
        None => vec![Problem::Mcplib, Problem::Hemisphere, Problem::Torsion],
    };
    println!("problem       level unknowns iterations linear   residual  seconds");
    for problem in problems {
        let (z, activity) = solve(problem, arguments)?;
        if problem == Problem::Hemisphere {
            let grid = Grid::new(problem, m);
            let errors = grid
                .points()
                .zip(&z)
                .map(|((x, y), z)| (z - exact(x.hypot(y))).abs());
            println!(
                "largest error against the exact solution {:.2e}",
                errors.fold(0.0, f64::max)
            );
        }
        let path = file_in(&arguments.out, &format!("contact_{}.svg", problem.name()))?;
        picture(problem, m, &activity).write(&path)?;
    }
    Ok(())
}

fn solve(problem: Problem, arguments: &Arguments) -> Outcome<(Vec<f64>, Vec<BoundState>)> {
    let m = arguments.m;
    let options = ActiveSetOptions::default();
    let mut z = vec![0.0; m * m];
    if arguments.nested {
        let begin = Instant::now();
        let hierarchy = nested(problem, m)?;
        let set_up = begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let report = hierarchy.solve(&options, &mut z)?;
        let seconds = begin.elapsed().as_secs_f64();
        for (k, level) in report.levels.iter().enumerate() {
            let last = (k + 1 == report.levels.len()).then_some(seconds);
            line(problem, k, level.unknowns, &level.report, last);
            list(arguments.verbose, &level.history);
        }
        println!("set-up of the hierarchy {set_up:.3} s");
        check(report.status())?;
        return Ok((z, report.states));
    }
    let lcp = problem.lcp(m)?;
    for (z, l) in z.iter_mut().zip(lcp.lower()) {
        *z = l.max(0.0);
    }
    let begin = Instant::now();
    if arguments.direct {
        let mut solver = ActiveSetSolver::with_reduced(options, DirectReduced::new());
        let report = solver.solve(&lcp, &mut z)?;
        line(problem, 0, m * m, &report, Some(begin.elapsed().as_secs_f64()));
        list(arguments.verbose, solver.history());
        check(report.status)?;
        return Ok((z, solver.states().to_vec()));
    }
    let mut solver = ActiveSetSolver::new(options);
    let report = solver.solve(&lcp, &mut z)?;
    line(problem, 0, m * m, &report, Some(begin.elapsed().as_secs_f64()));
    list(arguments.verbose, solver.history());
    check(report.status)?;
    Ok((z, solver.states().to_vec()))
}

fn check(status: Status) -> Outcome<()> {
    match status {
        Status::Solved => Ok(()),
        other => Err(format!("not solved: {other}").into()),
    }
}

fn line(problem: Problem, level: usize, unknowns: usize, report: &ActiveSetReport, seconds: Option<f64>) {
    let time = seconds.map_or(String::new(), |s| format!("{s:8.3}"));
    println!(
        "{:12} {level:6} {unknowns:8} {:10} {:6} {:10.1e} {time}",
        problem.name(),
        report.iterations,
        report.linear_iterations,
        report.residual
    );
}

fn list(verbose: bool, history: &[ActiveSetIteration]) {
    for step in history.iter().filter(|_| verbose) {
        println!(
            "    residual {:.1e}  changes {:6}  inactive {:7}  linear {}",
            step.residual, step.changes, step.inactive, step.linear_iterations
        );
    }
}

fn picture(problem: Problem, m: usize, activity: &[BoundState]) -> BranchDiagram {
    let [low, high] = problem.window();
    let panel = raster(Panel::new("x", "y"), m, [low, high], |k| match activity[k] {
        BoundState::Lower => Some(Colour::RED),
        BoundState::Upper => Some(Colour::BLUE),
        _ => None,
    });
    let mut classes = Vec::new();
    for (state, class) in [
        (BoundState::Lower, ("on the lower obstacle", Colour::RED)),
        (BoundState::Upper, ("on the upper obstacle", Colour::BLUE)),
    ] {
        if activity.contains(&state) {
            classes.push(class);
        }
    }
    square(
        with_classes(panel, &classes),
        &format!("Contact set, problem {}", problem.name()),
    )
}
