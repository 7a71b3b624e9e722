//! A body in contact with friction, from a mesh to tables and pictures.

mod fields;
mod follow;
mod history;
mod input;
mod law;
mod matrices;
mod model;
mod reduced;

use std::io::Write;
use std::ops::ControlFlow;
use std::path::PathBuf;

use semismooth::contact::{CondensedContact, ContactState, LoadCase, NodeLaw};
use semismooth::fem::{ContactRows, ElasticSystem};
use semismooth::output::{Report, ReportBody, ReportOptions};

use self::model::{Plan, RunFile};
use super::error::CommandError;
use super::report::ReportArgs;
use super::run_file::RunArgs;
use super::text::{counted, wrapped};

/// The run file that `init` writes.
pub const TEMPLATE: &str = include_str!("template.toml");

/// A problem, and the settings for output of its solutions.
struct Case<'a, P> {
    problem: P,
    /// None where the body is given by matrices.
    mesh: Option<(&'a ElasticSystem, ContactRows)>,
    folder: PathBuf,
    fields: bool,
    pictures: bool,
    arguments: &'a RunArgs,
}

pub(super) fn run(arguments: &RunArgs, out: &mut dyn Write) -> Result<(), CommandError> {
    let file = RunFile::read(&arguments.run)?;
    let plan = file.plan()?;
    if let Some(place) = &file.input.matrices {
        return matrices::run(&file, place, &plan, arguments, out);
    }
    let (system, motion) = file.system()?;
    let run = Run {
        plan: file.routed(plan, &system)?,
        file,
        arguments,
        system,
    };
    run.work(motion, out)
}

/// A report on the history or the curve in a run file.
pub(super) fn report(
    arguments: &ReportArgs,
    observe: impl FnMut(&str) -> ControlFlow<()>,
) -> Result<Report, CommandError> {
    let file = RunFile::read(&arguments.run)?;
    let plan = file.plan()?;
    let options = arguments.options();
    if let Some(place) = &file.input.matrices {
        let (problem, ..) = matrices::problem(&file, place)?;
        return report_of(problem, None, plan, &options, observe);
    }
    let (system, motion) = file.system()?;
    let plan = file.routed(plan, &system)?;
    if let Plan::Levels(_) = plan {
        let what = "reports need the condensed route, for which this body is too large by default; \
                    write route = \"condensed\" where there is memory for it";
        return Err(file.wrong(&file.input.run, "run.route", what));
    }
    let traces = file.contact(&system, motion)?;
    let law = file.law(system.mesh().dim(), traces.areas())?;
    let (problem, rows) = file.condensed(&system, traces, law)?;
    report_of(problem, Some((&system, &rows)), plan, &options, observe)
}

fn report_of<L: NodeLaw>(
    mut problem: CondensedContact<L>,
    body: Option<ReportBody<'_>>,
    plan: Plan,
    options: &ReportOptions,
    observe: impl FnMut(&str) -> ControlFlow<()>,
) -> Result<Report, CommandError> {
    let report = match plan {
        Plan::Follow(range) => Report::of_contact(&problem, body, range, options, observe),
        Plan::History(levels) | Plan::Levels(levels) => {
            Report::of_history(&mut problem, body, &levels, options, observe)
        }
    };
    report.map_err(|e| CommandError::failed("the report", e))
}

/// A body, and what is to be computed.
struct Run<'a> {
    file: RunFile,
    arguments: &'a RunArgs,
    system: ElasticSystem,
    plan: Plan,
}

impl Run<'_> {
    fn work(&self, motion: Option<LoadCase>, out: &mut dyn Write) -> Result<(), CommandError> {
        let contact = self.file.contact(&self.system, motion)?;
        let law = self.file.law(self.system.mesh().dim(), contact.areas())?;
        let told = !self.arguments.json && !self.arguments.quiet;
        for note in self.system.notes().iter().filter(|_| told) {
            writeln!(out, "{}", wrapped(&format!("note: {note}")))?;
        }
        if told {
            tell_held(contact.num_held(), out)?;
        }
        match &self.plan {
            Plan::Levels(levels) => {
                let (problem, rows) = self.file.reduced(&self.system, contact, law)?;
                reduced::run(&self.case((), rows)?, problem, levels, out)
            }
            Plan::History(levels) => {
                let (problem, rows) = self.file.condensed(&self.system, contact, law)?;
                history::run(self.case(problem, rows)?, levels, out)
            }
            Plan::Follow(range) => {
                let (problem, rows) = self.file.condensed(&self.system, contact, law)?;
                follow::run(&self.case(problem, rows)?, *range, out)
            }
        }
    }

    fn case<P>(&self, problem: P, rows: ContactRows) -> Result<Case<'_, P>, CommandError> {
        let output = &self.file.input.output;
        Ok(Case {
            problem,
            mesh: Some((&self.system, rows)),
            folder: self.file.results(self.arguments.out.as_ref(), &output.folder)?,
            fields: output.fields,
            pictures: output.pictures,
            arguments: self.arguments,
        })
    }
}

fn tell_held(held: usize, out: &mut dyn Write) -> Result<(), CommandError> {
    if held > 0 {
        let nodes = counted(held, "contact node");
        writeln!(
            out,
            "tangents held at {nodes}, as on planes of symmetry: symmetric solutions only"
        )?;
    }
    Ok(())
}

impl<P> Case<'_, P> {
    fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }
}

/// Numbers of contact nodes that are open, stick and slip.
fn counts(states: &[ContactState]) -> [usize; 3] {
    let count = |wanted: fn(&ContactState) -> bool| states.iter().filter(|s| wanted(s)).count();
    let open = count(|s| *s == ContactState::Open);
    let stick = count(|s| *s == ContactState::Stick);
    [open, stick, states.len() - open - stick]
}
