//! A history of loading of a large body, solved at its levels in the displacements.

use std::io::Write;
use std::ops::ControlFlow;

use semismooth::contact::{NodeLaw, ReducedContact, ReducedLevel};
use semismooth::output::{BranchDiagram, write_pvd};

use super::Case;
use super::history::{COLUMNS, Series, add_level, level_name, resultants};
use crate::commands::error::CommandError;
use crate::commands::progress::Progress;
use crate::commands::run_file::{create, write_failed};
use crate::commands::text::{counted, result, short};

pub(super) fn run<L: NodeLaw>(
    case: &Case<'_, ()>,
    mut problem: ReducedContact<L>,
    levels: &[f64],
    out: &mut dyn Write,
) -> Result<(), CommandError> {
    let shown = !case.arguments.json && !case.arguments.quiet;
    let path = case.file("history.csv");
    let mut table = create(&path)?;
    (writeln!(table, "{COLUMNS}").and_then(|()| table.flush())).map_err(write_failed(&path))?;
    if shown {
        let body = problem.body();
        let nodes = counted(body.num_contacts(), "contact node");
        let count = counted(body.num_displacements(), "displacement");
        writeln!(
            out,
            "{count}, {nodes}: solved at each level, not followed between levels"
        )?;
        writeln!(
            out,
            "     level  open stick  slip changes Newton   GMRES      normal  tangential      stored  dissipated"
        )?;
    }
    let progress = Progress::new(levels.len() as u64, !shown)?;
    let (mut done, mut failure) = (Done::default(), None);
    let reached = problem.evolve_observed(
        None,
        levels,
        |now| progress.message(format!("Newton step {}", now.newton + 1)),
        |level| {
            let told = case.level_done(level, &mut done, &mut table, &progress, out);
            match told {
                Ok(()) => progress.advance(format!("α = {}", level.level)),
                Err(e) => {
                    failure = Some(e);
                    ControlFlow::Break(())
                }
            }
        },
    );
    let interrupted = progress.cancelled();
    drop(progress);
    if let Some(e) = failure {
        return Err(e);
    }
    let at = levels.get(done.count).copied().unwrap_or(f64::NAN);
    reached.map_err(|e| CommandError::failed(format!("the level α = {at}"), e))?;
    if !done.forces.is_empty() {
        let drawn = BranchDiagram::of_history(&done.forces);
        case.arguments
            .draw(&case.folder, "history", |path| drawn.write(path))?;
    }
    if case.fields {
        let failed = |e| CommandError::failed("the fields", e);
        write_pvd(case.file("history.pvd"), &done.series).map_err(failed)?;
    }
    if shown {
        let fields = case.series_written();
        let pictures = case.arguments.pictures("history").join(", ");
        writeln!(
            out,
            "written to {}: history.csv, {pictures}{fields}",
            case.folder.display()
        )?;
    }
    match (interrupted, done.count) {
        (false, _) => Ok(()),
        (_, 0) => Err(CommandError::Interrupted("before the first level".to_owned())),
        (_, k) => {
            let alpha = levels[k - 1];
            Err(CommandError::Interrupted(format!("after the level α = {alpha}")))
        }
    }
}

/// Results of the levels solved so far.
#[derive(Default)]
struct Done {
    count: usize,
    /// The elastic energy at the last level.
    stored: f64,
    /// The largest energy so far.
    energy: f64,
    series: Series,
    /// Levels and resultants of the contact forces.
    forces: Vec<(f64, [f64; 3])>,
}

impl Case<'_, ()> {
    fn level_done(
        &self,
        level: &ReducedLevel,
        done: &mut Done,
        table: &mut impl Write,
        progress: &Progress,
        out: &mut dyn Write,
    ) -> Result<(), CommandError> {
        let (s, alpha) = (&level.solution, level.level);
        let displacements = [&level.report.displacements[..], &level.supports];
        self.write_body(&level_name(&done.series), s, displacements, alpha)?;
        add_level(&mut done.series);
        let (open, stick, slip) = (s.open(), s.stick(), s.slip());
        let [normal, first, second] = s.resultant();
        done.forces.push((alpha, s.resultant()));
        let (stored, dissipated) = (s.energy.stored - done.stored, s.energy.dissipated);
        (done.stored, done.count) = (s.energy.stored, done.count + 1);
        done.energy = done.energy.max(stored.abs()).max(dissipated.abs());
        // The first level is the start of the history and has no row, as in the condensed form.
        if done.count > 1 {
            let changes = level.num_changes();
            writeln!(
                table,
                "{alpha},{open},{stick},{slip},{changes},solved,{normal:?},{first:?},{second:?},,{stored:?},{dissipated:?}"
            )
            // What is written is whole, whatever ends the run.
            .and_then(|()| table.flush())
            .map_err(write_failed(&self.file("history.csv")))?;
        }
        let (newton, krylov) = (level.report.newton(), level.report.krylov());
        progress.suspend(|| match (self.arguments.json, self.arguments.quiet) {
            (true, _) => {
                let record = serde_json::json!({
                    "level": alpha, "open": open, "stick": stick, "slip": slip, "transitions": level.num_changes(),
                    "arrival": "solved", "normal": normal, "tangential": [first, second], "stored": stored,
                    "dissipated": dissipated, "newton": newton, "krylov": krylov,
                    "residual": level.report.residuals.largest(),
                });
                writeln!(out, "{record}")
            }
            (_, true) => Ok(()),
            _ => {
                let ([normal, tangential], level_shown) = (resultants(s), short(alpha));
                writeln!(
                    out,
                    "{level_shown:>10}  {open:>4} {stick:>5} {slip:>5} {:>7} {newton:>6} {krylov:>7} {normal:>11} {tangential:>11} {:>11} {:>11}",
                    level.num_changes(),
                    result(stored, done.energy),
                    result(dissipated, done.energy),
                )
            }
        })?;
        Ok(())
    }
}
