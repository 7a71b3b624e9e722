//! A body in contact with friction, from a mesh to tables and pictures.

mod fields;
mod follow;
mod history;
mod input;
mod model;

use std::io::Write;
use std::path::PathBuf;

use semismooth::contact::{CondensedContact, ContactState, NodeLaw};
use semismooth::fem::{ContactRows, ElasticSystem};

use self::model::{Plan, RunFile};
use super::error::CommandError;
use super::run_file::RunArgs;

/// A run file to begin with.
pub const TEMPLATE: &str = include_str!("template.toml");

/// A problem with what is needed to show its solutions.
struct Case<'a, L> {
    problem: CondensedContact<L>,
    system: &'a ElasticSystem,
    rows: ContactRows,
    folder: PathBuf,
    fields: bool,
    arguments: &'a RunArgs,
}

pub(super) fn run(arguments: &RunArgs, out: &mut dyn Write) -> Result<(), CommandError> {
    let file = RunFile::read(&arguments.run)?;
    let plan = file.plan()?;
    let (system, motion) = file.system()?;
    if system.mesh().dim() == 2 {
        let (problem, rows) = file.problem(&system, motion, file.planar()?)?;
        work(&file, arguments, &system, problem, rows, &plan, out)
    } else {
        let (problem, rows) = file.problem(&system, motion, file.orthotropic()?)?;
        work(&file, arguments, &system, problem, rows, &plan, out)
    }
}

fn work<L: NodeLaw>(
    file: &RunFile,
    arguments: &RunArgs,
    system: &ElasticSystem,
    problem: CondensedContact<L>,
    rows: ContactRows,
    plan: &Plan,
    out: &mut dyn Write,
) -> Result<(), CommandError> {
    let folder = file.results(arguments.out.as_ref(), &file.input.output.folder)?;
    let case = Case {
        problem,
        system,
        rows,
        folder,
        fields: file.input.output.fields,
        arguments,
    };
    match plan {
        Plan::History(levels) => history::run(case, levels, out),
        Plan::Follow(range) => follow::run(&case, *range, out),
    }
}

impl<L> Case<'_, L> {
    fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }
}

/// Contact nodes that are open, stick and slip.
fn counts(states: &[ContactState]) -> [usize; 3] {
    let count = |wanted: fn(&ContactState) -> bool| states.iter().filter(|s| wanted(s)).count();
    let open = count(|s| *s == ContactState::Open);
    let stick = count(|s| *s == ContactState::Stick);
    [open, stick, states.len() - open - stick]
}
