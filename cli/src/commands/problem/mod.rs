//! Equations with kinks, and discrete friction problems from folders: curves, diagrams and lists of their solutions.

mod curve;
mod graph;
mod input;
mod list;
mod model;

use std::io::Write;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

use semismooth::output::{Column, Report};
use semismooth::piecewise::{PiecewiseSmoothExt, Selection};

use self::model::{Problem, RunFile};
use super::error::CommandError;
use super::report::ReportArgs;
use super::run_file::RunArgs;
use super::text::{rounded, short};

/// The run files that `init` writes.
pub(super) const FOLLOW: &str = include_str!("follow.toml");
pub(super) const DIAGRAM: &str = include_str!("diagram.toml");
pub(super) const SOLUTIONS: &str = include_str!("solutions.toml");

/// Time after which a curve, a diagram or a list ends, unless `max_time` in the run file's options says otherwise.
const MAX_TIME: Duration = Duration::from_secs(60);

/// A problem, and the settings for output of its solutions.
struct Case<'a> {
    file: RunFile,
    problem: Problem,
    folder: PathBuf,
    arguments: &'a RunArgs,
}

pub(super) fn follow(arguments: &RunArgs, out: &mut dyn Write) -> Result<(), CommandError> {
    curve::run(&Case::new(arguments)?, out)
}

pub(super) fn diagram(arguments: &RunArgs, out: &mut dyn Write) -> Result<(), CommandError> {
    graph::run(&Case::new(arguments)?, out)
}

pub(super) fn solutions(arguments: &RunArgs, out: &mut dyn Write) -> Result<(), CommandError> {
    list::run(&Case::new(arguments)?, out)
}

/// A report on the curve of a run file of any of the three commands.
pub(super) fn report(
    arguments: &ReportArgs,
    observe: impl FnMut(&str) -> ControlFlow<()>,
) -> Result<Report, CommandError> {
    let file = RunFile::read(&arguments.run)?;
    let problem = file.problem()?;
    let run = file.input.run.get_ref();
    let listed = run.at.as_ref().or(run.sections.as_ref());
    let loads = listed.map(|l| l.get_ref().clone()).unwrap_or_default();
    let range = match (&run.range, least_and_greatest(&loads)) {
        // Lists of solutions have no range but that of their loads.
        (None, Some(range)) if problem.has_parameter() => range,
        _ => file.range(&problem)?,
    };
    let mut options = arguments
        .options()
        .with_loads(loads)
        .with_drawn(file.plotted(&problem)?);
    if run.at.is_none() && run.sections.is_none() && run.starts.is_none() {
        options = options.with_continuation(file.options()?);
    }
    let report = match problem.friction() {
        Some(problem) => Report::of_contact(problem, None, range, &options, observe),
        None => {
            let start = match (&run.start, run.starts.iter().flatten().next()) {
                (None, Some(start)) if start.get_ref().len() == problem.map().num_vars() => {
                    start.get_ref().clone()
                }
                _ => curve::start(&file, &problem, range[0])?,
            };
            let names: Vec<&str> = problem.names.iter().map(String::as_str).collect();
            Report::of_map(problem.map(), &names, &start, range[1], &options, observe)
        }
    };
    report.map_err(|e| CommandError::failed("the report", e))
}

fn least_and_greatest(loads: &[f64]) -> Option<[f64; 2]> {
    let least = loads.iter().copied().min_by(f64::total_cmp)?;
    let greatest = loads.iter().copied().max_by(f64::total_cmp)?;
    (least < greatest).then_some([least, greatest])
}

impl<'a> Case<'a> {
    fn new(arguments: &'a RunArgs) -> Result<Self, CommandError> {
        let file = RunFile::read(&arguments.run)?;
        let problem = file.problem()?;
        let folder = file.results(arguments.out.as_ref(), &file.input.output.folder)?;
        Ok(Self {
            file,
            problem,
            folder,
            arguments,
        })
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Whether a table is printed.
    fn prints(&self) -> bool {
        !self.arguments.json && !self.arguments.quiet
    }

    /// The unknowns as columns.
    fn columns(&self) -> Vec<Column<'_>> {
        let count = self.problem.map().num_residuals();
        let names = self.problem.names.iter().take(count).enumerate();
        names.map(|(k, name)| Column::entry(name.as_str(), k)).collect()
    }

    /// A point as "x = 1, y = 2": 0 where a number is rounding beside the others.
    fn words(&self, x: &[f64]) -> String {
        let largest = x.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let pairs = self.problem.names.iter().zip(x);
        let pairs: Vec<String> = pairs
            .map(|(n, v)| format!("{n} = {}", short(rounded(*v, largest))))
            .collect();
        pairs.join(", ")
    }

    /// A point as an object.
    fn object(&self, x: &[f64]) -> serde_json::Value {
        let pairs = self.problem.names.iter().zip(x);
        pairs
            .map(|(n, v)| (n.clone(), (*v).into()))
            .collect::<serde_json::Map<_, _>>()
            .into()
    }

    /// The active pieces.
    fn pieces(&self, selection: &Selection) -> Vec<String> {
        let map = self.problem.map();
        let pieces = selection.pieces().enumerate();
        pieces
            .map(|(site, k)| map.piece_name(site, k).into_owned())
            .collect()
    }
}
