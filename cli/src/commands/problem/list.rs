//! All solutions at given parameters.

use std::io::Write;

use semismooth::continuation::{SearchOptions, search_solutions_observed};
use semismooth::enumeration::{
    Completeness, Doubt, EnumerationError, EnumerationOptions, SolutionSet, all_solutions_until,
};
use semismooth::piecewise::{PiecewiseSmooth, Selection};
use semismooth::sparse::Matrix;

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
    let failed = |e| CommandError::failed("the list of solutions", e);
    let listed = |s: semismooth::enumeration::Solution| Listed {
        det_sign: s.det_signs.iter().copied().next().flatten(),
        index: s.index,
        x: s.x,
        selections: s.selections,
    };
    let enumeration = EnumerationOptions::default().with_max_time(options.max_time);
    match all_solutions_until(map, alpha, &enumeration, &|| progress.cancelled()) {
        Ok(found) if !is_curved(map, alpha, &found) => Ok(List {
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
        }),
        Ok(_) | Err(EnumerationError::NotAffine { .. }) => {
            let none: [Vec<f64>; 0] = [];
            let found = search_solutions_observed(map, alpha, &none, options, |_| progress.flow())
                .map_err(|e| CommandError::failed("the search", e))?;
            let verdict = format!("{found}{remark}");
            let one = |s: semismooth::continuation::FoundSolution| Listed {
                x: s.x,
                selections: vec![s.selection],
                det_sign: s.det_sign,
                index: s.index,
            };
            Ok(List {
                continua: 0,
                index_sum: found.index_sum,
                complete: false,
                words: verdict.clone(),
                verdict,
                solutions: found.solutions.into_iter().map(one).collect(),
            })
        }
        Err(e) => Err(failed(e)),
    }
}

/// Whether pieces that the map cannot state as affine have other derivatives far from 0 than at 0. Near 0, where lists are tested, x²⁰ looks
/// constant.
fn is_curved(map: &dyn PiecewiseSmooth, alpha: f64, found: &SolutionSet) -> bool {
    let unstated = matches!(
        found.completeness,
        Completeness::Undecided {
            doubt: Doubt::NoCoefficients,
            ..
        }
    );
    if !unstated
        || map
            .exact()
            .is_some_and(|pieces| pieces.conditions(alpha).is_some())
    {
        return false;
    }
    let n = map.num_residuals();
    let at = |y: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..map.num_vars())
            .map(|i| if i < n { y(i) } else { alpha })
            .collect()
    };
    let points = [at(&|_| 0.0), at(&|i| ((i * 7919 + 3571) % 1009) as f64 - 504.5)];
    let mut both = [Matrix::zeros(map.pattern()), Matrix::zeros(map.pattern())];
    let mut differs = |selection: &Selection| {
        for (jac, x) in both.iter_mut().zip(&points) {
            jac.clear();
            map.jacobian(selection, x, jac);
        }
        let mut entries = both[0].triplets().zip(both[1].triplets());
        // In this form NaN differs.
        let same = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs().max(b.abs());
        entries.any(|((_, j, a), (.., b))| j < n && !same(a, b))
    };
    let base = Selection::uniform(map.num_sites(), 0);
    let other = |(site, piece): (usize, usize)| {
        let mut selection = base.clone();
        selection.set(site, piece);
        selection
    };
    let mut sites = (0..map.num_sites()).flat_map(|site| (1..map.num_pieces(site)).map(move |k| (site, k)));
    differs(&base) || sites.any(|place| differs(&other(place)))
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
