//! A long run that may be killed at any moment: the load path of a discrete contact problem, in small steps.
//! You will see a progress bar (on a terminal), a table that grows event by event, and a saved state from which the run can be resumed:
//! stop it by Ctrl-C, by kill or with --stop-after, and call it again with --resume.
//! Run: cargo run --release --features serde --example long_run [-- DIR] [--stop-after N] [--resume] [--out DIR]

#[macro_use]
mod common;
#[path = "common/progress.rs"]
mod progress;

use std::cell::Cell;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::rc::Rc;

use clap::Parser;
use common::{Interrupted, Outcome, exit, file_in, shipped_folder};
use progress::Progress;
use semismooth::contact::{CondensedContact, PlanarCoulomb, read_folder};
use semismooth::continuation::{Continuation, ContinuationOptions, Direction, Event, SavedRun, Termination};
use semismooth::output::{Column, CsvWriter};
use semismooth::piecewise::PiecewiseSmooth;

/// Follows the load path of a discrete friction problem with a table and a state on disk.
#[derive(Parser)]
struct Args {
    /// Folder as `read_folder` takes it; default: in examples/data.
    folder: Option<PathBuf>,
    /// Resumes from the state in the output folder.
    #[arg(long)]
    resume: bool,
    /// Stops after this number of events.
    #[arg(long)]
    stop_after: Option<usize>,
    /// Points at given parameters, besides the transitions.
    #[arg(long, default_value_t = 200)]
    points: u32,
    /// Folder for the table and the state.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

fn run(args: &Args) -> Outcome<()> {
    let folder = args.folder.clone().unwrap_or_else(shipped_folder);
    let map = read_folder(&folder)?.condensed()?;
    let (table, state) = (
        file_in(&args.out, "long_run.csv")?,
        file_in(&args.out, "long_run.json")?,
    );
    let p = map.num_sites();
    let columns = vec![
        Column::new("normal force", move |x: &[f64]| x[..p].iter().sum()),
        Column::new("tangential force", move |x: &[f64]| x[p..2 * p].iter().sum()),
    ];
    let tally = Rc::new(Cell::new(Tally::default()));
    let saved = if args.resume {
        Checkpoint::read(&state)?
    } else {
        None
    };
    let (mut curve, mut writer, mut written) = if let Some(Checkpoint { table: own, run }) = saved {
        // Lines written after the state was saved are written again.
        let file = Counted::appending(&table, &own, &tally)?;
        (
            Continuation::resume(&map, &run)?,
            CsvWriter::appending(file, &map, columns),
            own.tally.lines,
        )
    } else {
        if args.resume {
            eprintln!("no state in {}: the run begins", args.out.display());
        }
        let x = map.solve(0.0, None)?;
        let targets = (1..=args.points)
            .map(|k| f64::from(k) / f64::from(args.points + 1))
            .collect();
        let options = ContinuationOptions::default()
            .with_parameter_range((0.0, 1.0))
            .with_targets(targets)
            .with_max_points(usize::MAX);
        let curve = Continuation::new(&map, &x, Direction::Increasing, options)?;
        // A state of an earlier run must not outlive its table.
        remove(&state)?;
        let file = Counted::new(&table, &tally)?;
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
        let own = TableState::new(&table, tally.get());
        save(&mut curve, own, &state)?;
        let position = (1000.0 * event.parameter()).round() as u64;
        let message = format!("{written} lines, {transitions} transitions");
        let full = args.stop_after.is_some_and(|n| written - first >= n);
        if progress.at(position, message).is_break() || full {
            break;
        }
    }
    let interrupted = progress.cancelled();
    drop(progress);
    let alpha = curve.point().parameter();
    println!("{} lines in {}, at γ = {alpha}", written, table.display());
    match curve.termination() {
        // A path may fold back to the α at which it began.
        Some(Termination::ParameterRange) if alpha > 0.5 => println!("the load path is complete"),
        Some(reason) => {
            return Err(format!("the whole load was not reached: {reason}, at γ = {alpha}").into());
        }
        None if interrupted => {
            return Err(Interrupted(format!("at γ = {alpha}, {written} lines")).into());
        }
        None => println!("stopped; --resume goes on from {}", state.display()),
    }
    Ok(())
}

/// The state of the run, and which part of which table belongs to it.
#[derive(serde::Serialize, serde::Deserialize)]
struct Checkpoint {
    table: TableState,
    run: SavedRun,
}

impl Checkpoint {
    /// Reads the file; `None` where there is none.
    fn read(path: &Path) -> Outcome<Option<Self>> {
        match std::fs::read_to_string(path) {
            Err(e) if e.kind() == ErrorKind::NotFound => Ok(None),
            Err(e) => Err(format!("{}: {e}", path.display()).into()),
            Ok(text) => match serde_json::from_str(&text) {
                Ok(found) => Ok(Some(found)),
                Err(e) => Err(format!("{}: {e}", path.display()).into()),
            },
        }
    }
}

/// The name of a table, and the tally of what was written to it.
#[derive(serde::Serialize, serde::Deserialize)]
struct TableState {
    file: String,
    tally: Tally,
}

impl TableState {
    fn new(path: &Path, tally: Tally) -> Self {
        let file = path
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        Self { file, tally }
    }
}

/// Lines and bytes written, with a checksum of them (FNV-1a).
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
struct Tally {
    lines: usize,
    bytes: u64,
    checksum: u64,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            lines: 0,
            bytes: 0,
            checksum: 0xcbf2_9ce4_8422_2325,
        }
    }
}

impl Tally {
    fn add(&mut self, bytes: &[u8]) {
        self.bytes += bytes.len() as u64;
        for byte in bytes {
            self.lines += usize::from(*byte == b'\n');
            self.checksum = (self.checksum ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

/// A table whose tally is kept.
struct Counted {
    file: File,
    tally: Rc<Cell<Tally>>,
}

impl Counted {
    fn new(path: &Path, tally: &Rc<Cell<Tally>>) -> Outcome<Self> {
        let file = File::create(path).map_err(|e| format!("cannot write {}: {e}", path.display()))?;
        Ok(Self {
            file,
            tally: Rc::clone(tally),
        })
    }

    /// A table cut to the length stored in the state, opened for appending.
    fn appending(path: &Path, state: &TableState, tally: &Rc<Cell<Tally>>) -> Outcome<Self> {
        let failed = |e: std::io::Error| format!("{}: {e}", path.display());
        let own = TableState::new(path, state.tally);
        if own.file != state.file {
            return Err(format!(
                "the state belongs to the table {}, not to {}",
                state.file, own.file
            )
            .into());
        }
        let mut begin = Vec::new();
        let file = File::open(path).map_err(failed)?;
        file.take(state.tally.bytes)
            .read_to_end(&mut begin)
            .map_err(failed)?;
        let mut found = Tally::default();
        found.add(&begin);
        if found != state.tally {
            return Err(format!(
                "{} is not the table of the state, which has {} lines ({} bytes) of other content; run without --resume",
                path.display(),
                state.tally.lines,
                state.tally.bytes
            )
            .into());
        }
        let file = OpenOptions::new().append(true).open(path).map_err(failed)?;
        file.set_len(found.bytes).map_err(failed)?;
        tally.set(found);
        Ok(Self {
            file,
            tally: Rc::clone(tally),
        })
    }
}

impl Write for Counted {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let count = self.file.write(bytes)?;
        let mut tally = self.tally.get();
        tally.add(&bytes[..count]);
        self.tally.set(tally);
        Ok(count)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

fn remove(path: &Path) -> Outcome<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != ErrorKind::NotFound => Err(format!("{}: {e}", path.display()).into()),
        _ => Ok(()),
    }
}

/// A new file replaces the old one atomically: there is always a complete state.
fn save(
    curve: &mut Continuation<'_, CondensedContact<PlanarCoulomb>>,
    table: TableState,
    path: &Path,
) -> Outcome<()> {
    let run = curve.save()?;
    let part = path.with_extension("part");
    let failed = |e: std::io::Error| format!("cannot write {}: {e}", path.display());
    std::fs::write(&part, serde_json::to_vec(&Checkpoint { table, run })?).map_err(failed)?;
    std::fs::rename(&part, path).map_err(failed)?;
    Ok(())
}
