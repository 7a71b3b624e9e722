//! A report on the problem of a run file, as one page of HTML.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use semismooth::output::ReportOptions;

use super::error::CommandError;
use super::progress::Progress;
use super::{contact, problem};

/// A report as a page of HTML: the curve, its events, numbers of solutions, pictures
#[derive(Debug, Args)]
pub(super) struct ReportArgs {
    /// A run file of one of the commands contact, follow, diagram and solutions
    pub(super) run: PathBuf,
    /// The page, by default beside the run file, with the ending .html
    #[arg(short, long)]
    output: Option<PathBuf>,
    /// The heading, by default the name of the run file
    #[arg(long)]
    title: Option<String>,
    /// No line, no progress
    #[arg(long, short)]
    pub(super) quiet: bool,
}

impl ReportArgs {
    /// The options, but for what the run file says.
    pub(super) fn options(&self) -> ReportOptions {
        let name = self.run.file_stem().unwrap_or_default().to_string_lossy();
        ReportOptions::default().with_title(self.title.clone().unwrap_or_else(|| name.into_owned()))
    }
}

pub(super) fn run(arguments: &ReportArgs, out: &mut dyn Write) -> Result<(), CommandError> {
    let progress = Progress::new(1, arguments.quiet)?;
    let observe = |doing: &str| progress.message(doing.to_owned());
    let report = match is_contact(&arguments.run) {
        true => contact::report(arguments, observe)?,
        false => problem::report(arguments, observe)?,
    };
    let interrupted = progress.cancelled();
    drop(progress);
    let path = (arguments.output.clone()).unwrap_or_else(|| arguments.run.with_extension("html"));
    report
        .write(&path)
        .map_err(|e| CommandError::failed("the report", e))?;
    if !arguments.quiet {
        writeln!(out, "written: {}", path.display())?;
    }
    match interrupted {
        true => Err(CommandError::Interrupted(
            "before the report was complete; what was found is in it".to_owned(),
        )),
        false => Ok(()),
    }
}

/// Whether a run file has a body, by a mesh or by matrices. One that cannot be read is refused when it is read as a whole.
fn is_contact(path: &Path) -> bool {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    text.parse::<toml::Table>()
        .is_ok_and(|table| ["mesh", "matrices"].iter().any(|key| table.contains_key(*key)))
}
