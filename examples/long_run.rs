//! A long run that may be killed at any moment: the load path of a discrete contact problem, in small steps.
//! You will see a progress bar (on a terminal), a table that grows event by event, and a state from which the run goes on: stop it by
//! Ctrl-C, by kill or with --stop-after, and call it again with --resume.
//! Run: cargo run --release --features serde --example long_run [-- DIR] [--stop-after N] [--resume] [--out DIR]

mod common;
#[path = "common/progress.rs"]
mod progress;

use std::fs::{File, OpenOptions};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use common::{Outcome, exit, file_in, shipped_folder};
use progress::Progress;
use semismooth::contact::{CondensedFriction, FrictionStart, first_point, read_folder};
use semismooth::continuation::{Continuation, ContinuationOptions, Direction, Event, SavedRun, Termination};
use semismooth::output::{Column, CsvWriter};
use semismooth::piecewise::PiecewiseSmooth;

/// Follows the load path of a discrete friction problem with a table and a state on disk.
#[derive(Parser)]
struct Args {
    /// Folder with A.mtx, Bnu.mtx, Bt.mtx, f0.txt, f1.txt, gap.txt and meta.json; default: the one in examples/data.
    folder: Option<PathBuf>,
    /// Goes on from the state in the output folder.
    #[arg(long)]
    resume: bool,
    /// Stops after this number of events.
    #[arg(long)]
    stop_after: Option<usize>,
    /// Number of points at given parameters, besides the transitions.
    #[arg(long, default_value_t = 200)]
    points: u32,
    /// Folder for the table and the state.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&Args::parse()))
}

fn run(args: &Args) -> Outcome<()> {
    let folder = args.folder.clone().unwrap_or_else(shipped_folder);
    let map = CondensedFriction::new(read_folder(&folder)?.problem)?;
    let (table, state) = (
        file_in(&args.out, "long_run.csv")?,
        file_in(&args.out, "long_run.json")?,
    );
    let p = map.num_sites();
    let columns = vec![
        Column::new("normal force", move |x: &[f64]| x[..p].iter().sum()),
        Column::new("tangential force", move |x: &[f64]| x[p..2 * p].iter().sum()),
    ];
    let (mut curve, mut writer, mut written) = if args.resume {
        let text = std::fs::read_to_string(&state).map_err(|e| format!("{}: {e}", state.display()))?;
        let Checkpoint { lines, run } =
            serde_json::from_str(&text).map_err(|e| format!("{}: {e}", state.display()))?;
        // What was written after the state was saved comes again.
        let file = truncated(&table, lines)?;
        (
            Continuation::resume(&map, &run)?,
            CsvWriter::appending(file, &map, columns),
            lines,
        )
    } else {
        let x = first_point(&map, 0.0, &FrictionStart::Zero)?;
        let targets = (1..=args.points)
            .map(|k| f64::from(k) / f64::from(args.points + 1))
            .collect();
        let options = ContinuationOptions::default()
            .with_parameter_range((0.0, 1.0))
            .with_targets(targets)
            .with_max_points(usize::MAX);
        let file = File::create(&table).map_err(|e| format!("cannot write {}: {e}", table.display()))?;
        let curve = Continuation::new(&map, &x, Direction::Increasing, options)?;
        (curve, CsvWriter::new(file, &map, columns)?, 1)
    };
    let progress = Progress::new(1000)?;
    let first = written;
    let mut transitions = 0;
    while let Some(event) = curve.next() {
        let event = event?;
        writer.write(&event)?;
        written += 1;
        transitions += usize::from(matches!(event, Event::Transition(_)));
        save(&mut curve, written, &state)?;
        let position = (1000.0 * event.parameter()).round() as u64;
        let message = format!("{written} lines, {transitions} transitions");
        let full = args.stop_after.is_some_and(|n| written - first >= n);
        if progress.at(position, message).is_break() || full {
            break;
        }
    }
    drop(progress);
    let alpha = curve.point().parameter();
    println!("{} lines in {}, at γ = {alpha}", written, table.display());
    match curve.termination() {
        Some(Termination::ParameterRange) => println!("the load path is complete"),
        Some(reason) => println!("the run ended: {reason}"),
        None => println!("stopped; --resume goes on from {}", state.display()),
    }
    Ok(())
}

/// The state of the run and how many lines of the table belong to it.
#[derive(serde::Serialize, serde::Deserialize)]
struct Checkpoint {
    lines: usize,
    run: SavedRun,
}

/// A new file replaces the old one in one move: there is always a whole state.
fn save(curve: &mut Continuation<'_, CondensedFriction>, lines: usize, path: &Path) -> Outcome<()> {
    let run = curve.save()?;
    let part = path.with_extension("part");
    let failed = |e: std::io::Error| format!("cannot write {}: {e}", path.display());
    std::fs::write(&part, serde_json::to_vec(&Checkpoint { lines, run })?).map_err(failed)?;
    std::fs::rename(&part, path).map_err(failed)?;
    Ok(())
}

/// The table with its first lines only, open at its end.
fn truncated(path: &Path, lines: usize) -> Outcome<File> {
    let failed = |e: std::io::Error| format!("{}: {e}", path.display());
    let text = std::fs::read_to_string(path).map_err(failed)?;
    let kept: usize = text.split_inclusive('\n').take(lines).map(str::len).sum();
    let file = OpenOptions::new().append(true).open(path).map_err(failed)?;
    file.set_len(kept as u64).map_err(failed)?;
    Ok(file)
}
