//! The curve of solutions through a start.

use std::io::Write;

use semismooth::continuation::{Branch, Continuation, ContinuationOptions, Direction, Termination};
use semismooth::output::{BranchDiagram, Curve, Panel, SegmentStyle, write_csv};
use semismooth::piecewise::PiecewiseSmoothExt;

use super::model::{Problem, RunFile};
use super::{Case, MAX_TIME};
use crate::commands::error::CommandError;
use crate::commands::progress::Progress;
use crate::commands::run_file::create;
use crate::commands::text::{counted, fitted, short, wrapped};

/// Number of steps of the progress bar.
const POSITIONS: f64 = 1000.0;

pub(super) fn run(case: &Case<'_>, out: &mut dyn Write) -> Result<(), CommandError> {
    let problem = &case.problem;
    let [from, to] = case.file.range(problem)?;
    let start = start(&case.file, problem, from)?;
    let direction = match from < to {
        true => Direction::Increasing,
        false => Direction::Decreasing,
    };
    let mut options: ContinuationOptions = case.file.options()?;
    options.max_time.get_or_insert(MAX_TIME);
    let options = options.with_parameter_range((from.min(to), from.max(to)));
    let failed = |e| CommandError::failed("the curve of solutions", e);
    let progress = Progress::new(POSITIONS as u64, !case.prints())?;
    let over = || progress.cancelled();
    let curve = match Continuation::new_until(problem.map(), &start, direction, options, over) {
        Err(_) if progress.cancelled() => {
            return Err(CommandError::Interrupted("before the curve began".to_owned()));
        }
        curve => curve.map_err(failed)?,
    };
    let name = problem.parameter();
    let branch = Branch::collect(curve, |event| {
        let share = ((event.parameter() - from) / (to - from)).clamp(0.0, 1.0);
        progress.at(
            (POSITIONS * share) as u64,
            format!("{name} = {:.4}", event.parameter()),
        )
    });
    let interrupted = progress.cancelled();
    drop(progress);
    let branch = branch.map_err(failed)?;
    tell(case, &branch, out)?;
    write(case, &branch)?;
    if case.prints() {
        let pictures = case.arguments.pictures("curve").join(", ");
        writeln!(out, "written to {}: curve.csv, {pictures}", case.folder.display())?;
    }
    if interrupted && branch.termination == Termination::Interrupted {
        let alpha = branch.points.last().map_or(from, |p| p.parameter());
        return Err(CommandError::Interrupted(format!("at {name} = {alpha}")));
    }
    Ok(())
}

/// The unknowns in the run file, else a solution that the problem finds, else zeros.
pub(super) fn start(file: &RunFile, problem: &Problem, from: f64) -> Result<Vec<f64>, CommandError> {
    let n = problem.map().num_residuals();
    let mut x = match &file.input.run.get_ref().start {
        Some(start) if start.get_ref().len() == n => start.get_ref().clone(),
        Some(start) => {
            let what = format!("{} numbers for {n} unknowns", start.get_ref().len());
            return Err(file.wrong(start, "run.start", what));
        }
        None => match problem.solve(from) {
            Some(found) => return found,
            None => vec![0.0; n],
        },
    };
    x.push(from);
    Ok(x)
}

/// A line for each transition, then the folds and the end.
fn tell(case: &Case<'_>, branch: &Branch, out: &mut dyn Write) -> Result<(), CommandError> {
    let (json, map) = (case.arguments.json, case.problem.map());
    for transition in &branch.transitions {
        let sites = transition.sites.iter().filter(|c| c.from != c.to);
        let changes: Vec<_> = sites
            .map(|c| {
                let piece = |k: usize| map.piece_name(c.site, k);
                (map.site_name(c.site), piece(c.from), piece(c.to))
            })
            .collect();
        if json {
            let changes: Vec<_> = (changes.iter())
                .map(|(site, from, to)| serde_json::json!({"site": site, "from": from, "to": to}))
                .collect();
            let line = serde_json::json!({
                "event": "transition", "kind": transition.kind.name(), "x": case.object(&transition.x), "changes": changes,
            });
            writeln!(out, "{line}")?;
        } else if case.prints() {
            writeln!(
                out,
                "{} = {:<20}  {}",
                case.problem.parameter(),
                short(transition.parameter()),
                transition.kind.name()
            )?;
            for (_, from, to) in changes {
                writeln!(out, "{}", fitted(&format!("    {from} → {to}"), ""))?;
            }
        }
    }
    if json {
        let folds = branch.folds();
        let line = serde_json::json!({
            "event": "end", "why": branch.termination.name(), "transitions": branch.transitions.len(), "folds": folds,
            "branch points": branch.branch_points.len(), "points": branch.points.len(),
        });
        return Ok(writeln!(out, "{line}")?);
    }
    if case.prints() {
        for fold in branch.folds() {
            writeln!(out, "fold at {} = {}", case.problem.parameter(), short(fold))?;
        }
        let count = counted(branch.transitions.len(), "transition");
        let end = format!("{count}; the curve ends: {}", branch.termination);
        writeln!(out, "{}", wrapped(&end))?;
    }
    Ok(())
}

fn write(case: &Case<'_>, branch: &Branch) -> Result<(), CommandError> {
    let mut table = create(&case.path("curve.csv"))?;
    write_csv(&mut table, case.problem.map(), branch, &case.columns())
        .map_err(|e| CommandError::failed("the table", e))?;
    let panels = case.file.plotted(&case.problem)?.into_iter().map(|k| {
        let curve = Curve::of_branch(
            branch,
            |x: &[f64]| x[k],
            SegmentStyle::by_pieces(case.problem.map()),
        );
        Panel::new(case.problem.parameter(), case.problem.names[k].clone()).with_curve(curve)
    });
    picture(case, panels, "curve")
}

/// Panels side by side.
pub(super) fn picture(
    case: &Case<'_>,
    panels: impl Iterator<Item = Panel>,
    name: &str,
) -> Result<(), CommandError> {
    let mut panels = panels;
    let Some(first) = panels.next() else {
        return Ok(());
    };
    let (mut drawn, mut count) = (BranchDiagram::new(first), 1);
    for panel in panels {
        drawn = drawn.with_panel(panel);
        count += 1;
    }
    let drawn = drawn.with_size(430 * count, 420);
    case.arguments.draw(&case.folder, name, |path| drawn.write(path))
}
