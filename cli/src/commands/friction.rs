//! Frictional contact problems in Delassus form.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use semismooth::contact::{DelassusOptions, DelassusSolver, read_delassus};

use super::error::CommandError;

/// Residual at every contact up to which a problem is solved.
const TOLERANCE: f64 = 1e-12;

/// Frictional contact problems in Delassus form, u = M r + q, to 1e-12 at every contact
#[derive(Debug, Args)]
pub struct FrictionArgs {
    /// JSON files with dimension, mu, q and M (compressed columns)
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// One JSON object a file, with r and u contact by contact (N, T1[, T2])
    #[arg(long)]
    json: bool,
    /// Seconds after which a problem is given up
    #[arg(long, default_value_t = 300.0)]
    seconds: f64,
}

pub(super) fn run(arguments: &FrictionArgs, out: &mut dyn Write) -> Result<(), CommandError> {
    if !arguments.json {
        writeln!(
            out,
            "{:<32} {:>8} {:>10} {:>9} {:>8} {:>5} {:>5} {:>5}",
            "problem", "contacts", "status", "residual", "seconds", "open", "stick", "slip"
        )?;
    }
    let mut unsolved = 0;
    for file in &arguments.files {
        unsolved += usize::from(!solve(file, arguments, out)?);
    }
    match unsolved {
        0 => Ok(()),
        _ => Err(CommandError::Unsolved {
            unsolved,
            all: arguments.files.len(),
        }),
    }
}

fn solve(file: &Path, arguments: &FrictionArgs, out: &mut dyn Write) -> Result<bool, CommandError> {
    let failed = |e| CommandError::failed(file.display().to_string(), e);
    let problem = read_delassus(file).map_err(failed)?;
    let limit = Duration::try_from_secs_f64(arguments.seconds)
        .map_err(|e| CommandError::failed(format!("--seconds {}", arguments.seconds), e))?;
    let begun = Instant::now();
    let report = DelassusSolver::new(DelassusOptions::default().with_max_time(Some(limit)))
        .solve(&problem)
        .map_err(failed)?;
    let seconds = begun.elapsed().as_secs_f64();
    // By an evaluation of its own.
    let residual = problem.residual(&report.r).map_err(failed)?;
    let solved = residual <= TOLERANCE && report.is_solved();
    let status = match report.is_solved() {
        true if !solved => "inaccurate",
        _ => report.status.name(),
    };
    let name = file
        .file_stem()
        .map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    let [contacts, open, stick, slip] = [problem.contacts(), report.open(), report.stick(), report.slip()];
    if arguments.json {
        let line = serde_json::json!({
            "name": name, "contacts": contacts, "status": status, "residual": residual, "seconds": seconds,
            "open": open, "stick": stick, "slip": slip, "r": report.r, "u": report.u,
        });
        writeln!(out, "{line}")?;
    } else {
        writeln!(
            out,
            "{name:<32} {contacts:>8} {status:>10} {residual:>9.1e} {seconds:>8.3} {open:>5} {stick:>5} {slip:>5}"
        )?;
    }
    Ok(solved)
}
