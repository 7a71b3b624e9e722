//! A discrete contact problem from files (an elastic block, 440 displacements, 11 contact nodes) along its load path.
//! You will see every change of state of every contact node as γ goes from 0 to 1, and a picture of the path. The program `semismooth follow`
//! does the same for folders of your own, with tables and JSON.
//! Run: cargo run --release --example follow_load [-- --out DIR]

#[macro_use]
mod common;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use common::{Outcome, ensure, exit, file_in, list, shipped_folder};
use semismooth::contact::{ContactState, read_folder};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
use semismooth::piecewise::PiecewiseSmooth;

/// Follows the load path (1 − γ) f0 + γ f1 of a discrete friction problem from γ = 0 on.
#[derive(Parser)]
struct Args {
    /// Folder for the picture.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&Args::parse()))
}

fn run(args: &Args) -> Outcome<()> {
    let map = read_folder(shipped_folder())?.problem.condensed()?;
    let start = map.solve(0.0, None)?;
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let branch = Branch::follow(&map, &start, Direction::Increasing, options)?;

    let mut changes = 0;
    for t in &branch.transitions {
        for change in t.sites.iter().filter(|c| c.from != c.to) {
            let [from, to] = [change.from, change.to].map(|piece| map.piece_name(change.site, piece));
            let (gamma, node, kind) = (t.parameter(), change.site, t.kind);
            println!("{gamma:<14.10}  node {node:>3}  {from:>5} → {to:<5}  {kind}");
            changes += 1;
        }
    }
    let folds = match branch.folds() {
        none if none.is_empty() => "no folds".to_owned(),
        some => format!("folds at {}", list(&some, 10)),
    };
    println!(
        "\n{changes} changes of state, {folds}, end: {}; {} factorisations",
        branch.termination, branch.factorisations
    );

    let p = map.num_sites();
    let panel = |label: &str, first: usize| {
        let force = |x: &[f64]| x[first..first + p].iter().sum();
        let style = |s: &_, grazing: &[usize]| overall(&map.states(s), !grazing.is_empty());
        Panel::new("share γ of the second load", label).with_curve(Curve::of_branch(&branch, force, style))
    };
    let picture = file_in(&args.out, "follow_load.svg")?;
    BranchDiagram::new(panel("sum of normal forces [unit of the loads]", 0))
        .with_panel(panel("sum of tangential forces [unit of the loads]", p))
        .with_title("A block on the ground from one load to another, friction 0.5")
        .with_size(860, 420)
        .write(&picture)?;
    println!("written: {}", picture.display());
    ensure(
        changes == 36,
        "there are the 36 changes of state of the exact list that comes with the data",
    )
}

/// The state of all nodes together.
fn overall(states: &[ContactState], grazing: bool) -> SegmentStyle {
    let open = states.iter().filter(|s| **s == ContactState::Open).count();
    let stick = states.iter().filter(|s| **s == ContactState::Stick).count();
    if grazing {
        SegmentStyle::new("grazing", Colour::GREY)
    } else if open == states.len() {
        SegmentStyle::new("no contact", Colour::RED)
    } else if open + stick == states.len() {
        SegmentStyle::new("all in contact stick", Colour::GREEN)
    } else if stick == 0 {
        SegmentStyle::new("all in contact slip", Colour::BLUE)
    } else {
        SegmentStyle::new("stick and slip", Colour::PURPLE)
    }
}
