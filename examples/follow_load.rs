//! A discrete contact problem from files (an elastic block, 440 displacements, 11 contact nodes) along its load path.
//! You will see every change of state of every contact node as γ goes from 0 to 1, a CSV table and a picture of the path.
//! Run: cargo run --release --example follow_load [-- DIR] [--json] [--out DIR]

#[macro_use]
mod common;

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, count, ensure, exit, file_in, list, shipped_folder};
use semismooth::contact::{CondensedContact, ContactState, PlanarCoulomb, read_folder};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Termination, Transition};
use semismooth::output::{BranchDiagram, Colour, Column, Curve, Panel, SegmentStyle, write_csv};
use semismooth::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt};
use serde_json::json;

/// Follows the load path (1 − γ) f0 + γ f1 of a discrete friction problem from γ = 0 on.
#[derive(Parser)]
struct Args {
    /// Folder as `read_folder` takes it; default: the one in examples/data.
    folder: Option<PathBuf>,
    /// One JSON object a line instead of text.
    #[arg(long)]
    json: bool,
    /// Folder for the table and the picture.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

fn run(args: &Args) -> Outcome<()> {
    let folder = args.folder.clone().unwrap_or_else(shipped_folder);
    let problem = read_folder(&folder)?;
    let begun = Instant::now();
    let map = problem.condensed()?;
    let start = map.solve(0.0, None)?;
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let branch = Branch::follow(&map, &start, Direction::Increasing, options)?;
    let seconds = begun.elapsed().as_secs_f64();

    let end = branch.points.last().map_or(f64::NAN, |p| p.parameter());
    let mut transitions = 0;
    for t in &branch.transitions {
        transitions += print_transition(&map, t, args.json);
    }
    for b in &branch.branch_points {
        let (parameter, arms) = (b.point.parameter(), b.arms.len());
        if args.json {
            println!(
                "{}",
                json!({"event": "branch point", "parameter": parameter, "arms": arms})
            );
        } else {
            println!(
                "{parameter:<14.10}  branch point, {}",
                count(arms, "arm goes on", "arms go on")
            );
        }
    }
    if args.json {
        let summary = json!({"summary": {
            "transitions": transitions,
            "folds": branch.folds(),
            "end": branch.termination.name(),
            "end_parameter": end,
            "factorisations": branch.factorisations,
            "seconds": seconds,
        }});
        println!("{summary}");
    } else {
        let folds = match branch.folds() {
            none if none.is_empty() => "no folds".to_owned(),
            some => format!("folds at {}", list(&some, 10)),
        };
        println!(
            "\n{transitions} transitions, {folds}, end: {} at γ = {end}; {} factorisations, {:.1} ms",
            branch.termination,
            branch.factorisations,
            seconds * 1e3,
        );
    }
    write_results(&map, &branch, &folder, args)?;
    if args.folder.is_none() {
        ensure(
            transitions == 36,
            "the shipped problem has the 36 transitions of the exact list",
        )?;
    }
    if branch.termination == Termination::ParameterRange && end > 0.5 {
        return Ok(());
    }
    Err(format!(
        "the whole load was not reached: {}, at γ = {end}",
        branch.termination
    )
    .into())
}

/// One line a site that changes its piece (or, where the curve stops, a site at its boundary); returns their number.
fn print_transition(map: &CondensedContact<PlanarCoulomb>, t: &Transition, json: bool) -> usize {
    let changed = t.sites.iter().filter(|c| c.from != c.to).count();
    let lines = if changed > 0 { changed } else { t.sites.len() };
    for change in &t.sites[..lines] {
        let (site, parameter) = (change.site, t.parameter());
        let from = map.piece_name(site, change.from);
        let to = map.piece_name(site, change.to);
        let kind = t.kind.name();
        if json {
            let line = json!({
                "event": "transition",
                "parameter": parameter,
                "site": site,
                "from": from,
                "to": to,
                "kind": kind,
            });
            println!("{line}");
        } else {
            println!("{parameter:<14.10}  node {site:>3}  {from:>5} → {to:<5}  {kind}");
        }
    }
    lines
}

/// The sums of the normal and of the tangential forces over γ, as a table and as a picture.
fn write_results(
    map: &CondensedContact<PlanarCoulomb>,
    branch: &Branch,
    folder: &std::path::Path,
    args: &Args,
) -> Outcome<()> {
    let p = map.num_sites();
    let normal = |x: &[f64]| x[..p].iter().sum::<f64>();
    let tangential = |x: &[f64]| x[p..2 * p].iter().sum::<f64>();
    let table = file_in(&args.out, "follow_load.csv")?;
    let file = File::create(&table).map_err(|e| format!("cannot write {}: {e}", table.display()))?;
    let columns = [
        Column::new("normal force", normal),
        Column::new("tangential force", tangential),
    ];
    write_csv(&mut BufWriter::new(file), map, branch, &columns)?;

    let panel = |label: &str, force: &dyn Fn(&[f64]) -> f64| {
        let style = |s: &_, grazing: &[usize]| overall(&map.states(s), !grazing.is_empty());
        Panel::new("γ", label).with_curve(Curve::of_branch(branch, force, style))
    };
    let name = folder.file_name().map(|n| n.to_string_lossy().into_owned());
    let picture = file_in(&args.out, "follow_load.svg")?;
    BranchDiagram::new(panel("sum of normal forces", &normal))
        .with_panel(panel("sum of tangential forces", &tangential))
        .with_title(name.unwrap_or_default())
        .with_size(860, 420)
        .write(&picture)?;
    if !args.json {
        println!("written: {}, {}", table.display(), picture.display());
    }
    Ok(())
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
