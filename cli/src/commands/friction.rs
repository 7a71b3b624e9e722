//! Frictional contact problems in Delassus form.

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use semismooth::InputError;
use semismooth::contact::{
    ContactError, DelassusOptions, DelassusProblem, DelassusReport, DelassusSolver, read_delassus,
};

use super::error::CommandError;
use super::progress::Progress;
use super::run_file::{create, write_failed};
use super::text::quoted;

/// Largest residual at a contact for which a problem counts as solved.
const TOLERANCE: f64 = 1e-12;

/// Frictional contact problems in Delassus form, u = M r + q, to 1e-12 at every contact
#[derive(Debug, Args)]
pub struct FrictionArgs {
    /// JSON files with dimension, mu, q and M (compressed columns)
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// One JSON object per file, with r and u contact by contact (N, T1[, T2])
    #[arg(long)]
    json: bool,
    /// No table, no progress
    #[arg(long, short)]
    quiet: bool,
    /// Folder for problems.csv, a line per file, and a table of contacts each
    #[arg(long)]
    out: Option<PathBuf>,
    /// Time limit for each problem, in seconds
    #[arg(long, default_value_t = 300.0)]
    seconds: f64,
}

/// How a problem ended.
struct Outcome {
    name: String,
    status: &'static str,
    solved: bool,
    residual: f64,
    seconds: f64,
    report: DelassusReport,
}

pub(super) fn run(arguments: &FrictionArgs, out: &mut dyn Write) -> Result<(), CommandError> {
    let prints = !arguments.json && !arguments.quiet;
    if prints {
        writeln!(
            out,
            "{:<32} {:>8} {:>15} {:>9} {:>8} {:>5} {:>5} {:>5}",
            "problem", "contacts", "status", "residual", "seconds", "open", "stick", "slip"
        )?;
    }
    let mut table = arguments.out.as_deref().map(Table::new).transpose()?;
    let progress = Progress::new(arguments.files.len() as u64, !prints)?;
    let mut unsolved = 0;
    for (k, file) in arguments.files.iter().enumerate() {
        let (problem, outcome) = solve(file, k, arguments.seconds, &progress)?;
        unsolved += usize::from(!outcome.solved);
        if let Some(table) = &mut table {
            table.add(&problem, &outcome)?;
        }
        progress.suspend(|| tell(arguments, &outcome, out))?;
        if progress.cancelled() {
            return Err(CommandError::Interrupted(format!("at {}", file.display())));
        }
    }
    drop(progress);
    if let (Some(folder), true) = (&arguments.out, prints) {
        let folder = folder.display();
        writeln!(out, "written to {folder}: problems.csv, and contacts_0000.csv on")?;
    }
    match unsolved {
        0 => Ok(()),
        _ => Err(CommandError::Unsolved {
            unsolved,
            all: arguments.files.len(),
        }),
    }
}

fn solve(
    file: &Path,
    position: usize,
    seconds: f64,
    progress: &Progress,
) -> Result<(DelassusProblem, Outcome), CommandError> {
    let failed = |e| CommandError::failed(file.display().to_string(), e);
    // Errors of reading name the file themselves: only their text is kept.
    let problem = read_delassus(file).map_err(|e| match e {
        ContactError::Input(InputError::File { what, .. }) => {
            CommandError::failed(file.display().to_string(), what)
        }
        e => failed(e),
    })?;
    let limit = Duration::try_from_secs_f64(seconds)
        .map_err(|e| CommandError::failed(format!("--seconds {seconds}"), e))?;
    let begun = Instant::now();
    let report = DelassusSolver::new(DelassusOptions::default().with_max_time(Some(limit)))
        .solve_observed(&problem, None, |now| {
            progress.at(position as u64, format!("residual {:.1e}", now.residual))
        })
        .map_err(failed)?;
    let seconds = begun.elapsed().as_secs_f64();
    // Evaluated here, independently of the solver.
    let residual = problem.residual(&report.r).map_err(failed)?;
    let solved = residual <= TOLERANCE && report.is_solved();
    let status = match report.is_solved() {
        true if !solved => "inaccurate",
        _ => report.status.name(),
    };
    let name = file
        .file_stem()
        .unwrap_or_else(|| OsStr::new("problem"))
        .to_string_lossy()
        .into_owned();
    let outcome = Outcome {
        name,
        status,
        solved,
        residual,
        seconds,
        report,
    };
    Ok((problem, outcome))
}

fn tell(arguments: &FrictionArgs, outcome: &Outcome, out: &mut dyn Write) -> Result<(), CommandError> {
    let Outcome {
        name,
        status,
        residual,
        seconds,
        report,
        ..
    } = outcome;
    let [contacts, open, stick, slip] = [report.states.len(), report.open(), report.stick(), report.slip()];
    if arguments.json {
        let line = serde_json::json!({
            "name": name, "contacts": contacts, "status": status, "residual": residual, "seconds": seconds,
            "open": open, "stick": stick, "slip": slip, "r": report.r, "u": report.u,
        });
        writeln!(out, "{line}")?;
    } else if !arguments.quiet {
        writeln!(
            out,
            "{name:<32.32} {contacts:>8} {status:>15} {residual:>9.1e} {seconds:>8.3} {open:>5} {stick:>5} {slip:>5}"
        )?;
    }
    Ok(())
}

/// Results as files.
struct Table<'a> {
    folder: &'a Path,
    path: PathBuf,
    lines: std::io::BufWriter<std::fs::File>,
    /// Number of problems written so far.
    count: usize,
}

impl<'a> Table<'a> {
    fn new(folder: &'a Path) -> Result<Self, CommandError> {
        std::fs::create_dir_all(folder).map_err(write_failed(folder))?;
        let path = folder.join("problems.csv");
        let mut lines = create(&path)?;
        writeln!(
            lines,
            "problem,contacts,status,residual,seconds,open,stick,slip\r"
        )
        .map_err(write_failed(&path))?;
        Ok(Self {
            folder,
            path,
            lines,
            count: 0,
        })
    }

    /// Writes a row for the problem, and a separate table of its contacts.
    fn add(&mut self, problem: &DelassusProblem, outcome: &Outcome) -> Result<(), CommandError> {
        let report = &outcome.report;
        let line = writeln!(
            self.lines,
            "{},{},{},{:?},{:?},{},{},{}\r",
            quoted(&outcome.name),
            problem.contacts(),
            outcome.status,
            outcome.residual,
            outcome.seconds,
            report.open(),
            report.stick(),
            report.slip()
        );
        line.and_then(|()| self.lines.flush())
            .map_err(write_failed(&self.path))?;
        let path = self.folder.join(format!("contacts_{:04}.csv", self.count));
        self.count += 1;
        contacts(&mut create(&path)?, problem.dimension(), report).map_err(write_failed(&path))
    }
}

/// A line for each contact.
fn contacts(out: &mut impl Write, dimension: usize, report: &DelassusReport) -> std::io::Result<()> {
    let axes = &["N", "T1", "T2"][..dimension];
    write!(out, "contact,state")?;
    for name in ["r", "u"] {
        for axis in axes {
            write!(out, ",{name} {axis}")?;
        }
    }
    write!(out, "\r\n")?;
    let pairs = report.r.chunks(dimension).zip(report.u.chunks(dimension));
    for (k, (state, (r, u))) in report.states.iter().zip(pairs).enumerate() {
        write!(out, "{k},{state}")?;
        for value in r.iter().chain(u) {
            write!(out, ",{value:?}")?;
        }
        write!(out, "\r\n")?;
    }
    out.flush()
}
