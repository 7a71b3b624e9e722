//! All solutions at given parameters.

use std::io::Write;

use semismooth::continuation::{FoundSolutions, SearchOptions, SolutionList, list_solutions};
use semismooth::enumeration::{EnumerationOptions, SolutionSet};
use semismooth::piecewise::{PiecewiseSmoothExt, Selection};

use super::{Case, MAX_TIME};
use crate::commands::error::CommandError;
use crate::commands::progress::Progress;
use crate::commands::run_file::{create, write_failed};
use crate::commands::text::{counted, fitted, quoted, wrapped};

/// A list at one value of the parameter.
struct List {
    solutions: Vec<Listed>,
    continua: usize,
    index_sum: Option<i64>,
    complete: bool,
    /// What is known of the completeness of the list, in words.
    verdict: String,
    /// The same with the number of solutions.
    words: String,
}

struct Listed {
    x: Vec<f64>,
    selections: Vec<Selection>,
    det_sign: Option<i8>,
    index: Option<i8>,
}

pub(super) fn run(case: &Case<'_>, out: &mut dyn Write) -> Result<(), CommandError> {
    let (path, map) = (case.path("solutions.csv"), case.problem.map());
    let mut table = create(&path)?;
    let names: Vec<_> = case.problem.names.iter().map(|n| quoted(n)).collect();
    let sites: Vec<_> = (0..map.num_sites()).map(|s| quoted(&map.site_name(s))).collect();
    let head = ["list", "det", "index"].into_iter().map(str::to_owned);
    let head: Vec<String> = head.chain(names).chain(sites).collect();
    writeln!(table, "{}\r", head.join(",")).map_err(write_failed(&path))?;
    let values = parameters(case)?;
    let mut options: SearchOptions = case.file.options()?;
    options.max_time.get_or_insert(MAX_TIME);
    let progress = Progress::new(values.len() as u64, !case.prints())?;
    for (k, alpha) in values.into_iter().enumerate() {
        if progress.at(k as u64, format!("{alpha}")).is_break() {
            break;
        }
        let list = find(case, alpha, &options, &progress)?;
        for solution in &list.solutions {
            writeln!(table, "{}\r", row(case, k, solution)).map_err(write_failed(&path))?;
        }
        progress.suspend(|| tell(case, alpha, &list, out))?;
    }
    let interrupted = progress.cancelled();
    drop(progress);
    table.flush().map_err(write_failed(&path))?;
    if case.prints() {
        writeln!(out, "written to {}: solutions.csv", case.folder.display())?;
    }
    match interrupted {
        true => Err(CommandError::Interrupted(
            "before the list was complete".to_owned(),
        )),
        false => Ok(()),
    }
}

/// The values of the parameter; a single dummy value if there is no parameter.
fn parameters(case: &Case<'_>) -> Result<Vec<f64>, CommandError> {
    let run = &case.file.input.run;
    let with = case.problem.map().num_vars() > case.problem.map().num_residuals();
    match (&run.get_ref().at, with) {
        (None, false) => Ok(vec![0.0]),
        (Some(at), true) if !at.get_ref().is_empty() => match at.get_ref().iter().find(|v| !v.is_finite()) {
            Some(value) => Err(case.file.wrong(at, "run.at", format!("{value} is not finite"))),
            None => Ok(at.get_ref().clone()),
        },
        (Some(at), false) => Err(case.file.wrong(at, "run.at", "the problem has no parameter")),
        (_, true) => Err(case
            .file
            .wrong(run, "run.at", "values of the parameter are wanted")),
    }
}

/// All solutions if the pieces are affine, else those that a search finds.
fn find(
    case: &Case<'_>,
    alpha: f64,
    options: &SearchOptions,
    progress: &Progress,
) -> Result<List, CommandError> {
    let (map, remark) = (case.problem.map(), case.problem.remark());
    let enumeration = EnumerationOptions::default().with_max_time(options.max_time);
    let list = list_solutions(map, alpha, &enumeration, options, &|| progress.cancelled())
        .map_err(|e| CommandError::failed("the list of solutions", e))?;
    match list {
        SolutionList::Enumerated(found) => Ok(enumerated(found, remark)),
        SolutionList::Searched(found) => Ok(searched(found, remark)),
        _ => Err(CommandError::failed(
            "the list of solutions",
            "a kind of list that is not known",
        )),
    }
}

fn enumerated(found: SolutionSet, remark: &str) -> List {
    let listed = |s: semismooth::enumeration::Solution| Listed {
        det_sign: s.det_signs.iter().copied().next().flatten(),
        index: s.index,
        x: s.x,
        selections: s.selections,
    };
    List {
        continua: found.continua.len(),
        index_sum: found.index_sum,
        complete: found.completeness.is_complete(),
        verdict: format!("{}{remark}", found.completeness),
        words: match found.solutions.len() {
            0 if !found.continua.is_empty() => {
                format!("no isolated solution, {}{remark}", found.completeness)
            }
            0 => format!("no solution, {}{remark}", found.completeness),
            n => format!("{}, {}{remark}", counted(n, "solution"), found.completeness),
        },
        solutions: found.solutions.into_iter().map(listed).collect(),
    }
}

fn searched(found: FoundSolutions, remark: &str) -> List {
    let verdict = format!("{found}{remark}");
    let one = |s: semismooth::continuation::FoundSolution| Listed {
        x: s.x,
        selections: vec![s.selection],
        det_sign: s.det_sign,
        index: s.index,
    };
    List {
        continua: 0,
        index_sum: found.index_sum,
        complete: false,
        words: verdict.clone(),
        verdict,
        solutions: found.solutions.into_iter().map(one).collect(),
    }
}

fn sign(value: Option<i8>) -> String {
    value.map_or_else(String::new, |v| format!("{v:+}"))
}

fn row(case: &Case<'_>, list: usize, solution: &Listed) -> String {
    let mut cells = vec![list.to_string(), sign(solution.det_sign), sign(solution.index)];
    cells.extend(solution.x.iter().map(|v| format!("{v:?}")));
    let pieces = solution.selections.first().map(|s| case.pieces(s));
    cells.extend(pieces.into_iter().flatten().map(|p| quoted(&p)));
    cells.join(",")
}

fn tell(case: &Case<'_>, alpha: f64, list: &List, out: &mut dyn Write) -> Result<(), CommandError> {
    let with = case.problem.map().num_vars() > case.problem.map().num_residuals();
    if case.arguments.json {
        let solutions: Vec<_> = (list.solutions.iter())
            .map(|s| {
                serde_json::json!({
                    "x": case.object(&s.x), "det": s.det_sign, "index": s.index,
                    "pieces": s.selections.iter().map(|s| case.pieces(s)).collect::<Vec<_>>(),
                })
            })
            .collect();
        let line = serde_json::json!({
            "parameter": with.then_some(alpha), "solutions": solutions, "continua": list.continua,
            "index sum": list.index_sum, "complete": list.complete, "verdict": list.verdict,
        });
        return Ok(writeln!(out, "{line}")?);
    }
    if !case.prints() {
        return Ok(());
    }
    if with {
        let verdict = format!("{} = {alpha}: {}", case.problem.parameter(), list.words);
        writeln!(out, "{}", wrapped(&verdict))?;
    } else {
        writeln!(out, "{}", wrapped(&list.words))?;
    }
    let n = case.problem.map().num_residuals();
    for solution in &list.solutions {
        let index = solution
            .index
            .map_or_else(String::new, |i| format!("   index {i:+}"));
        let line = format!("    {}", case.words(&solution.x[..n]));
        writeln!(out, "{}", fitted(&line, &index))?;
    }
    match list.continua {
        0 => {}
        1 => writeln!(out, "    and a continuum of solutions")?,
        many => writeln!(out, "    and {many} continua of solutions")?,
    }
    Ok(())
}
