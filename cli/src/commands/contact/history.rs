//! A history of loading.

use std::io::Write;
use std::path::PathBuf;

use semismooth::contact::{
    Arrival, CondensedContact, ContactSolution, EvolutionOptions, EvolutionStep, LocalValues, NodeLaw,
    evolve_observed,
};
use semismooth::output::{BranchDiagram, write_pvd};

use super::{Case, counts};
use crate::commands::error::CommandError;
use crate::commands::progress::Progress;
use crate::commands::run_file::{create, write_failed};
use crate::commands::text::{result, short};

pub(super) const COLUMNS: &str = "level,open,stick,slip,transitions,arrival,normal force,tangential force 1,tangential force 2,\
work,stored,dissipated";

pub(super) fn run<L: NodeLaw>(
    mut case: Case<'_, CondensedContact<L>>,
    levels: &[f64],
    out: &mut dyn Write,
) -> Result<(), CommandError> {
    let first = levels[0];
    let failed = |level: f64| move |e| CommandError::failed(format!("the level α = {level}"), e);
    let mut x = case.problem.solve(first, None).map_err(failed(first))?;
    let (json, quiet) = (case.arguments.json, case.arguments.quiet);
    let path = case.file("history.csv");
    let mut table = create(&path)?;
    (writeln!(table, "{COLUMNS}").and_then(|()| table.flush())).map_err(write_failed(&path))?;
    if !json && !quiet {
        writeln!(
            out,
            "     level  open stick  slip changes arrival        normal  tangential        work  dissipated"
        )?;
    }
    let mut series = Vec::new();
    let begin = case.problem.solution(&x).map_err(failed(first))?;
    let mut forces = vec![(first, begin.resultant())];
    case.write_level(&x, &begin, &mut series)?;
    let mut energy = 0.0;
    if !json && !quiet {
        let [normal, tangential] = resultants(&begin);
        let level = short(first);
        let [open, stick, slip] = counts(&begin.states);
        writeln!(
            out,
            "{level:>10}  {open:>4} {stick:>5} {slip:>5}         start    {normal:>11} {tangential:>11}"
        )?;
    }
    let progress = Progress::new(levels.len() as u64, quiet || json)?;
    let options = EvolutionOptions::default();
    for &level in &levels[1..] {
        if progress.advance(format!("α = {level}")).is_break() {
            break;
        }
        let steps = evolve_observed(&mut case.problem, &x, &[level], &options, |_| progress.flow())
            .map_err(failed(level))?;
        for step in steps {
            line(&mut table, &step).map_err(write_failed(&path))?;
            forces.push((step.level, step.solution.resultant()));
            case.write_level(&step.x, &step.solution, &mut series)?;
            progress.suspend(|| match (json, quiet) {
                (true, _) => writeln!(out, "{}", record(&step)),
                (_, true) => Ok(()),
                _ => print(out, &step, &mut energy),
            })?;
            x = step.x;
        }
    }
    let drawn = BranchDiagram::of_history(&forces);
    case.arguments
        .draw(&case.folder, "history", |path| drawn.write(path))?;
    if case.fields && case.mesh.is_some() {
        write_pvd(case.file("history.pvd"), &series).map_err(|e| CommandError::failed("the fields", e))?;
    }
    if !json && !quiet {
        let fields = case.series_written();
        let pictures = case.arguments.pictures("history").join(", ");
        writeln!(
            out,
            "written to {}: history.csv, {pictures}{fields}",
            case.folder.display()
        )?;
    }
    if progress.cancelled() {
        let alpha = x.last().copied().unwrap_or(first);
        return Err(CommandError::Interrupted(format!("after the level α = {alpha}")));
    }
    Ok(())
}

impl<L: NodeLaw> Case<'_, CondensedContact<L>> {
    fn write_level(
        &self,
        x: &[f64],
        solution: &ContactSolution,
        series: &mut Series,
    ) -> Result<(), CommandError> {
        self.write_solution(&level_name(series), x, solution)?;
        add_level(series);
        Ok(())
    }

    /// Writes the fields and the picture of a solution, whose states and slips are given: at the end of a level
    /// the problem measures slips from there.
    pub(super) fn write_solution(
        &self,
        name: &str,
        x: &[f64],
        solution: &ContactSolution,
    ) -> Result<(), CommandError> {
        let failed = |e| CommandError::failed("the fields", e);
        let free = self.problem.displacements(x).map_err(failed)?;
        let supports = self.problem.support_displacements(x).map_err(failed)?;
        self.write_body(name, solution, [&free, &supports], x[x.len() - 1])
    }
}

/// Fields of the levels of a history, in turn.
pub(super) type Series = Vec<(f64, PathBuf)>;

/// Levels are numbered, since a history may visit the same one twice.
pub(super) fn level_name(series: &Series) -> String {
    format!("level_{:04}", series.len())
}

pub(super) fn add_level(series: &mut Series) {
    let name = level_name(series);
    series.push((series.len() as f64, format!("{name}.vtu").into()));
}

impl<P> Case<'_, P> {
    /// What is written for each level, in words.
    pub(super) fn series_written(&self) -> String {
        let fields = match (self.fields, &self.mesh) {
            (true, Some(_)) => ", history.pvd",
            (true, None) => ", level_*.csv",
            _ => "",
        };
        let pictures = match (self.pictures, &self.mesh) {
            (true, Some(_)) => self.arguments.pictures("level_*"),
            _ => Vec::new(),
        };
        pictures.iter().fold(fields.to_owned(), |all, p| all + ", " + p)
    }
}

fn line(table: &mut impl Write, step: &EvolutionStep) -> std::io::Result<()> {
    let [open, stick, slip] = counts(&step.solution.states);
    let [normal, first, second] = step.solution.resultant();
    writeln!(
        table,
        "{},{open},{stick},{slip},{},{},{normal:?},{first:?},{second:?},{:?},{:?},{:?}",
        step.level,
        step.transitions,
        arrival(&step.arrival),
        step.work,
        step.stored,
        step.dissipated
    )?;
    // What is written is whole, whatever ends the run.
    table.flush()
}

fn record(step: &EvolutionStep) -> serde_json::Value {
    let [open, stick, slip] = counts(&step.solution.states);
    let [normal, first, second] = step.solution.resultant();
    serde_json::json!({
        "level": step.level,
        "open": open,
        "stick": stick,
        "slip": slip,
        "transitions": step.transitions,
        "arrival": arrival(&step.arrival),
        "folds": step.folds,
        "normal": normal,
        "tangential": [first, second],
        "work": step.work,
        "stored": step.stored,
        "dissipated": step.dissipated,
        "returned": step.returned,
    })
}

/// A row of the table in the terminal; `energy` is the largest one so far.
fn print(out: &mut dyn Write, step: &EvolutionStep, energy: &mut f64) -> std::io::Result<()> {
    let [open, stick, slip] = counts(&step.solution.states);
    let [normal, tangential] = resultants(&step.solution);
    let energies = [step.work, step.stored, step.dissipated];
    *energy = energies.iter().fold(*energy, |largest, e| largest.max(e.abs()));
    writeln!(
        out,
        "{:>10}  {open:>4} {stick:>5} {slip:>5} {:>7} {:<8} {normal:>11} {tangential:>11} {:>11} {:>11}",
        short(step.level),
        step.transitions,
        arrival(&step.arrival),
        result(step.work, *energy),
        result(step.dissipated, *energy)
    )
}

/// The normal and the tangential resultant for the terminal, with a sign in the plane.
pub(super) fn resultants(solution: &ContactSolution) -> [String; 2] {
    let [normal, first, second] = solution.resultant();
    let forces = |v: &LocalValues| v.pressure.abs() + v.traction[0].hypot(v.traction[1]);
    let all = solution.nodes.iter().map(forces).sum();
    let tangential = if second == 0.0 { first } else { first.hypot(second) };
    [normal, tangential].map(|force| result(force, all))
}

/// How a level was reached.
fn arrival(arrival: &Arrival) -> &'static str {
    match arrival {
        Arrival::Followed => "followed",
        Arrival::SameLevel => "same",
        Arrival::Jumped => "jumped",
        Arrival::PassedFolds => "folds",
        Arrival::Ended(_) => "ended",
        _ => "Newton",
    }
}
