//! The curve of static solutions over α.

use std::io::Write;

use semismooth::contact::{CondensedContact, NodeLaw};
use semismooth::continuation::{
    Branch, Continuation, ContinuationOptions, Direction, Termination, Transition,
};
use semismooth::output::{BranchDiagram, Column, Curve, Panel, SegmentStyle, write_csv};
use semismooth::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt};

use super::Case;
use crate::commands::error::CommandError;
use crate::commands::progress::Progress;
use crate::commands::run_file::{create, write_failed};
use crate::commands::text::{counted, short, wrapped};

/// Number of steps of the progress bar.
const POSITIONS: f64 = 1000.0;

pub(super) fn run<L: NodeLaw>(
    case: &Case<'_, CondensedContact<L>>,
    range: [f64; 2],
    out: &mut dyn Write,
) -> Result<(), CommandError> {
    let [from, to] = range;
    let problem = &case.problem;
    let (json, quiet) = (case.arguments.json, case.arguments.quiet);
    let failed = |e| CommandError::failed("the curve of solutions", e);
    let start = problem
        .solve(from, None)
        .map_err(|e| CommandError::failed(format!("the start at α = {from}"), e))?;
    let direction = match from < to {
        true => Direction::Increasing,
        false => Direction::Decreasing,
    };
    let options = ContinuationOptions::default().with_parameter_range((from.min(to), from.max(to)));
    let progress = Progress::new(POSITIONS as u64, quiet || json)?;
    let over = || progress.cancelled();
    let curve = match Continuation::new_until(problem, &start, direction, options, over) {
        Err(_) if progress.cancelled() => {
            return Err(CommandError::Interrupted("before the curve began".to_owned()));
        }
        curve => curve.map_err(failed)?,
    };
    let branch = Branch::collect(curve, |event| {
        let share = (event.parameter() - from) / (to - from);
        progress.at(
            (POSITIONS * share) as u64,
            format!("α = {:.4}", event.parameter()),
        )
    });
    let interrupted = progress.cancelled();
    drop(progress);
    let branch = branch.map_err(failed)?;

    let mut changes = 0;
    for transition in &branch.transitions {
        changes += tell(problem, transition, json, quiet, out)?;
    }
    if json {
        let summary = serde_json::json!({
            "end": branch.termination.name(),
            "changes": changes,
            "folds": branch.folds(),
            "branch points": branch.branch_points.len(),
        });
        writeln!(out, "{summary}")?;
    } else if !quiet {
        let count = counted(changes, "change");
        let end = format!("{count} of state; the curve ends: {}", branch.termination);
        writeln!(out, "{}", wrapped(&end))?;
        for alpha in branch.folds() {
            writeln!(out, "fold at α = {}", short(alpha))?;
        }
    }
    write(case, &branch)?;
    if !json && !quiet {
        let pictures = case.arguments.pictures("curve").join(", ");
        writeln!(out, "written to {}: curve.csv, {pictures}", case.folder.display())?;
    }
    if interrupted && branch.termination == Termination::Interrupted {
        let alpha = branch.points.last().map_or(from, |p| p.parameter());
        return Err(CommandError::Interrupted(format!("at α = {alpha}")));
    }
    Ok(())
}

/// A line for each node that changes its state.
fn tell(
    map: &dyn PiecewiseSmooth,
    transition: &Transition,
    json: bool,
    quiet: bool,
    out: &mut dyn Write,
) -> Result<usize, CommandError> {
    let changed = transition.sites.iter().filter(|c| c.from != c.to);
    let mut count = 0;
    for change in changed {
        count += 1;
        let (from, to) = (
            map.piece_name(change.site, change.from),
            map.piece_name(change.site, change.to),
        );
        let (alpha, kind) = (transition.parameter(), transition.kind.name());
        if json {
            let line = serde_json::json!({
                "parameter": alpha, "node": change.site, "from": from, "to": to, "kind": kind,
            });
            writeln!(out, "{line}")?;
        } else if !quiet {
            writeln!(
                out,
                "α = {:<16}  node {:>4}  {from:>5} → {to:<5}  {kind}",
                short(alpha),
                change.site
            )?;
        }
    }
    Ok(count)
}

/// The resultants of the normal and of the tangential forces over α, as a table and as a picture, and the fields at the end.
fn write<L: NodeLaw>(case: &Case<'_, CondensedContact<L>>, branch: &Branch) -> Result<(), CommandError> {
    let (problem, p) = (&case.problem, case.problem.num_contacts());
    let normal = |x: &[f64]| x[..p].iter().sum::<f64>();
    let tangential = |x: &[f64]| x[p..2 * p].iter().sum::<f64>();
    let path = case.file("curve.csv");
    let mut file = create(&path)?;
    let columns = [
        Column::new("normal force", normal),
        Column::new("tangential force", tangential),
    ];
    let failed = |e| CommandError::failed("the table", e);
    write_csv(&mut file, problem, branch, &columns).map_err(failed)?;
    file.flush().map_err(write_failed(&path))?;
    let panel = |label: &str, force: &dyn Fn(&[f64]) -> f64| {
        let style = |s: &_, _: &[usize]| SegmentStyle::contacts(&problem.states(s));
        Panel::new("α", label).with_curve(Curve::of_branch(branch, force, style))
    };
    let drawn = BranchDiagram::new(panel("sum of normal forces", &normal))
        .with_panel(panel("sum of tangential forces", &tangential))
        .with_size(860, 420);
    case.arguments
        .draw(&case.folder, "curve", |path| drawn.write(path))?;
    match branch.points.last() {
        Some(end) => {
            let failed = |e| CommandError::failed("the fields", e);
            let solution = problem.solution(&end.x).map_err(failed)?;
            case.write_solution("end", &end.x, &solution)
        }
        None => Ok(()),
    }
}
