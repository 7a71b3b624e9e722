//! All curves of solutions connected to given starts.

use std::io::Write;

use semismooth::continuation::{Diagram, DiagramCompleteness, DiagramOptions, Limit, SectionProgress};
use semismooth::enumeration::EnumerationOptions;
use semismooth::output::{Panel, SegmentStyle, write_diagram_csv, write_diagram_json};

use super::curve::picture;
use super::{Case, MAX_TIME};
use crate::commands::error::CommandError;
use crate::commands::progress::Progress;
use crate::commands::run_file::create;
use crate::commands::text::{counted, fitted, wrapped};

pub(super) fn run(case: &Case<'_>, out: &mut dyn Write) -> Result<(), CommandError> {
    let [from, to] = case.file.range(&case.problem)?;
    let mut options: DiagramOptions = case.file.options()?;
    options.continuation.max_time.get_or_insert(MAX_TIME);
    let options = options.with_parameter_range((from.min(to), from.max(to)));
    let progress = Progress::new(1, !case.prints())?;
    let diagram = explore(case, &options, &progress);
    drop(progress);
    let diagram = diagram?;
    let stopped = |c: &DiagramCompleteness| matches!(c, DiagramCompleteness::Limited(list) if list.contains(&Limit::Interrupted));
    tell(case, &diagram, out)?;
    let interrupted = || CommandError::Interrupted("before the diagram was complete".to_owned());
    if diagram.edges().is_empty() && stopped(diagram.completeness()) {
        return Err(interrupted());
    }
    let failed = |e| CommandError::failed("the table", e);
    let (map, columns) = (case.problem.map(), case.columns());
    let mut table = create(&case.path("diagram.csv"))?;
    write_diagram_csv(&mut table, map, &diagram, &columns).map_err(failed)?;
    let mut object = create(&case.path("diagram.json"))?;
    write_diagram_json(&mut object, map, &diagram, &columns).map_err(failed)?;
    let panels = case.file.plotted(&case.problem)?.into_iter().map(|k| {
        let panel = Panel::new(case.problem.parameter(), case.problem.names[k].clone());
        panel.with_diagram(
            &diagram,
            |x: &[f64]| x[k],
            SegmentStyle::by_pieces(case.problem.map()),
        )
    });
    // A problem without solutions has no picture.
    let drawn = !diagram.edges().is_empty() || !diagram.vertices().is_empty();
    if drawn {
        picture(case, panels, "diagram")?;
    }
    if case.prints() {
        let mut files = vec!["diagram.csv".to_owned(), "diagram.json".to_owned()];
        files.extend(
            drawn
                .then(|| case.arguments.pictures("diagram"))
                .into_iter()
                .flatten(),
        );
        writeln!(out, "written to {}: {}", case.folder.display(), files.join(", "))?;
    }
    match stopped(diagram.completeness()) {
        true => Err(interrupted()),
        false => Ok(()),
    }
}

/// The diagram from the given starts, or from all solutions at the sections.
fn explore(case: &Case<'_>, options: &DiagramOptions, progress: &Progress) -> Result<Diagram, CommandError> {
    let run = &case.file.input.run;
    let (map, failed) = (case.problem.map(), |e| CommandError::failed("the diagram", e));
    let name = case.problem.parameter();
    let curves = |now: &semismooth::continuation::Progress<'_>| {
        // Known so far: edges that are finished, the current one, and arms still to be followed.
        let known = now.edges + 1 + now.pending;
        progress.of(known as u64);
        progress.at(now.edges as u64, format!("{name} = {:.4}", now.event.parameter()))
    };
    match (&run.get_ref().starts, &run.get_ref().sections) {
        (Some(starts), None) if !starts.is_empty() => {
            let m = map.num_vars();
            if let Some(wrong) = starts.iter().find(|s| s.get_ref().len() != m) {
                let what = format!(
                    "{} numbers, expected {m}, the parameter last",
                    wrong.get_ref().len()
                );
                return Err(case.file.wrong(wrong, "run.starts", what));
            }
            let starts: Vec<&Vec<f64>> = starts.iter().map(toml::Spanned::get_ref).collect();
            Diagram::explore_observed(map, &starts, options, curves).map_err(failed)
        }
        (None, Some(sections)) => {
            let observe = |now: &SectionProgress<'_>| match now {
                SectionProgress::Curves(now) => curves(now),
                SectionProgress::Solutions(alpha) => progress.at(0, format!("all at {name} = {alpha}")),
                _ => progress.flow(),
            };
            let enumeration = EnumerationOptions::default().with_max_time(options.continuation.max_time);
            let found =
                Diagram::explore_sections_observed(map, sections.get_ref(), options, &enumeration, observe);
            found.map_err(|e| case.file.wrong(sections, "run.sections", e))
        }
        _ => {
            let what = "one of starts and sections is wanted";
            Err(case.file.wrong(run, "run", what))
        }
    }
}

fn tell(case: &Case<'_>, diagram: &Diagram, out: &mut dyn Write) -> Result<(), CommandError> {
    let completeness = diagram.completeness();
    let folds = diagram.folds();
    if case.arguments.json {
        let summary = serde_json::json!({
            "vertices": diagram.vertices().len(), "edges": diagram.edges().len(), "branches": diagram.branches().len(),
            "isolas": diagram.isolas().len(), "folds": folds.iter().map(|f| f.parameter()).collect::<Vec<_>>(),
            "complete": completeness.is_complete(), "completeness": completeness.to_string(),
        });
        return Ok(writeln!(out, "{summary}")?);
    }
    if !case.prints() {
        return Ok(());
    }
    for vertex in diagram.vertices() {
        let line = format!("{:<18} {}", vertex.kind.name(), case.words(&vertex.x));
        writeln!(out, "{}", fitted(&line, ""))?;
    }
    for fold in folds.iter().filter(|f| f.vertex.is_none()) {
        let line = format!("{:<18} {}", "smooth fold", case.words(&fold.x));
        writeln!(out, "{}", fitted(&line, ""))?;
    }
    let end = format!(
        "{}, {} closed and connected to nothing else; {completeness}{}",
        counted(diagram.branches().len(), "branch"),
        diagram.isolas().len(),
        case.problem.remark()
    );
    Ok(writeln!(out, "{}", wrapped(&end))?)
}
