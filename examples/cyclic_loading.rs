//! A block pressed on the ground, its top moved to and fro (displacement control): friction depends on the history (hysteresis).
//! You will see, for each position of the top, how many nodes stick and slip, the horizontal force that moves it, the energy balance
//! (work = stored + dissipated), and a picture of the hysteresis loop. The program fails when the balance does not close where the curve of
//! solutions was followed.
//! Run: cargo run --release --example cyclic_loading [-- --steps 20] [--cells 8] [--out DIR]

#[macro_use]
mod common;

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use common::squares::moved_block;
use common::{Outcome, exit, file_in};
use semismooth::contact::{Arrival, ContactState, EvolutionOptions, evolve};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};

/// Two cycles of a horizontal motion of a block with Coulomb friction.
#[derive(Parser)]
struct Args {
    /// Steps a quarter of a cycle.
    #[arg(long, default_value_t = 10)]
    steps: usize,
    /// Cells a unit length; the block is 2 × 1.
    #[arg(long, default_value_t = 8)]
    cells: usize,
    /// Coefficient of friction.
    #[arg(long, default_value_t = 0.2)]
    friction: f64,
    /// Folder for the picture.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

fn run(args: &Args) -> Outcome<()> {
    if args.steps == 0 || args.cells < 2 {
        return Err("--steps must be at least 1 and --cells at least 2".into());
    }
    let mut problem = moved_block(args.cells, args.friction)?;
    let quarter =
        |from: f64, to: f64| (1..=args.steps).map(move |k| from + (to - from) * k as f64 / args.steps as f64);
    let corners = [0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0];
    let levels: Vec<f64> = corners.windows(2).flat_map(|w| quarter(w[0], w[1])).collect();
    let start = problem.solve(0.0, None)?;
    let force = problem.solution(&start)?.resultant()[1];
    let mut path = vec![(0.0, force)];
    let mut worst = 0.0f64;
    println!("  top/0.02  open stick slip      force     transitions      work      stored  dissipated");
    let steps = evolve(&mut problem, &start, &levels, &EvolutionOptions::default(), |s| {
        let count = |wanted: &[ContactState]| s.solution.states.iter().filter(|x| wanted.contains(x)).count();
        let force = s.solution.resultant()[1];
        println!(
            "  {:>8.3}  {:>4} {:>5} {:>4}  {:>10.3e}  {:>6}{}  {:>10.3e} {:>10.3e} {:>10.3e}",
            s.level,
            count(&[ContactState::Open]),
            count(&[ContactState::Stick]),
            count(&[ContactState::SlipPlus, ContactState::SlipMinus]),
            force,
            s.transitions,
            arrival(&s.arrival),
            s.work,
            s.stored,
            s.dissipated
        );
        path.push((0.02 * s.level, force));
        if s.arrival.is_followed() {
            let size = s.solution.energy.stored;
            worst = worst.max((s.work - s.stored - s.dissipated).abs() / size);
        }
        ControlFlow::Continue(())
    })?;
    let sum = |f: &dyn Fn(&semismooth::contact::EvolutionStep) -> f64| steps.iter().map(f).sum::<f64>();
    let (work, stored, dissipated) = (sum(&|s| s.work), sum(&|s| s.stored), sum(&|s| s.dissipated));
    println!(
        "\nsums: work {work:.6e} = stored {stored:.6e} + dissipated {dissipated:.6e} + {:.1e}",
        work - stored - dissipated
    );
    let cycle = 4 * args.steps;
    let style = |name: &'static str, colour| SegmentStyle::new(name, colour);
    let picture = file_in(&args.out, "cyclic_loading.svg")?;
    BranchDiagram::new(
        Panel::new(
            "horizontal displacement of the top [block heights]",
            "horizontal force [E × height]",
        )
        .with_curve(
            Curve::line(path[..=cycle].to_vec(), style("first cycle", Colour::BLUE)).with_arrows(true),
        )
        .with_curve(Curve::line(
            path[cycle..].to_vec(),
            style("second cycle", Colour::ORANGE),
        )),
    )
    .with_title("Hysteresis of a block with friction")
    .with_size(640, 480)
    .write(&picture)?;
    println!("written: {}", picture.display());
    if worst > 1e-10 {
        return Err(format!("the energy balance does not close: {worst:e} of the elastic energy").into());
    }
    Ok(())
}

/// How a level was reached, where that was not along the branch from the level before.
fn arrival(arrival: &Arrival) -> &'static str {
    match arrival {
        Arrival::Followed => "        ",
        Arrival::Jumped => " jumped ",
        Arrival::PassedFolds => " folds  ",
        Arrival::Ended(_) => " ended  ",
        _ => " Newton ",
    }
}
