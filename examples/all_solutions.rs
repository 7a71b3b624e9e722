//! Coulomb friction with few contact nodes: every solution at given parameters, by complete enumeration.
//! You see for each case and α the number of solutions, their states, the signs of det ∇_yH and whether the list is certified complete.
//! Run: cargo run --release --example all_solutions -- [FILE] [--json]   (FILE: cases with A, Bnu, Bt, f0, f1, F0, F1, r, alphas)

#[macro_use]
mod common;

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use semismooth::contact::{CondensedContact, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::enumeration::{Completeness, Doubt, EnumerationOptions, SolutionSet, all_solutions};
use semismooth::piecewise::Selection;
use semismooth::sparse::Matrix;
use serde_json::{Value, json};

/// Prints all solutions of small friction problems at given parameters.
#[derive(Parser)]
struct Arguments {
    /// JSON file with a list `cases`; default: the shipped examples
    file: Option<PathBuf>,
    /// Print a JSON object for each case and parameter instead of a table
    #[arg(long)]
    json: bool,
    /// Largest number of search nodes for one parameter
    #[arg(long, default_value_t = 1_000_000)]
    max_nodes: u64,
}

fn main() -> ExitCode {
    common::exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let seed = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/seed_examples.json");
    let path = arguments.file.clone().unwrap_or_else(|| seed.into());
    let text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    let file: Value = serde_json::from_str(&text).map_err(|e| format!("{}: {e}", path.display()))?;
    let cases = file.get("cases").unwrap_or(&file);
    let one = std::slice::from_ref(cases);
    let options = EnumerationOptions::default().with_max_nodes(arguments.max_nodes);
    let cases = cases.as_array().map_or(one, Vec::as_slice);
    let mut refused = 0;
    for (k, case) in cases.iter().enumerate() {
        let name = case["name"]
            .as_str()
            .map_or_else(|| format!("case {k}"), str::to_owned);
        if let Err(e) = list(case, &name, &options, (arguments.json, arguments.file.is_none())) {
            refused += 1;
            match arguments.json {
                true => println!("{}", json!({"case": name, "error": e.to_string()})),
                false => eprintln!("error: {}, {name}: {e}", path.display()),
            }
        }
    }
    match refused {
        0 => Ok(()),
        _ => Err(format!("{}: {refused} of {} cases refused", path.display(), cases.len()).into()),
    }
}

/// Prints all solutions of one case; those of the shipped ones are complete.
fn list(
    case: &Value,
    name: &str,
    options: &EnumerationOptions,
    (json, shipped): (bool, bool),
) -> Result<(), Box<dyn Error>> {
    let map = problem(case)?.condensed()?;
    for alpha in numbers(case, "alphas")? {
        let set = all_solutions(&map, alpha, options)?;
        if json {
            println!("{}", record(&map, name, alpha, &set));
        } else {
            print(&map, name, alpha, &set);
        }
        if set.completeness.is_complete() && !certified(&map, alpha, &set) {
            return Err(format!("the list at α = {alpha} is complete, but its index sum is not +1").into());
        }
        if shipped && !set.completeness.is_complete() {
            return Err(format!("the list at α = {alpha} is not complete").into());
        }
    }
    Ok(())
}

fn letters(map: &CondensedContact<PlanarCoulomb>, selection: &Selection) -> String {
    map.states(selection).iter().map(|s| s.letter()).collect()
}

/// Proven to be complete. For F ≥ 0 the degree of the problem is one more witness, wherever all local indices are known.
fn certified(map: &CondensedContact<PlanarCoulomb>, alpha: f64, set: &SolutionSet) -> bool {
    let regular = map.friction_at(alpha).iter().all(|f| *f >= 0.0);
    set.completeness.is_complete() && (!regular || set.index_sum.is_none_or(|sum| sum == 1))
}

fn record(map: &CondensedContact<PlanarCoulomb>, name: &str, alpha: f64, set: &SolutionSet) -> Value {
    let names = |list: &[Selection]| -> Vec<String> { list.iter().map(|s| letters(map, s)).collect() };
    let continua: Vec<Value> = set
        .continua
        .iter()
        .map(|c| json!({"states": names(&c.selections), "dimension": c.dimension, "ends": c.ends}))
        .collect();
    json!({
        "case": name,
        "alpha": alpha,
        "count": set.solutions.len(),
        "states": set.solutions.iter().map(|s| letters(map, &s.selections[0])).collect::<Vec<_>>(),
        "all_states": set.solutions.iter().map(|s| names(&s.selections)).collect::<Vec<_>>(),
        "det_signs": set.solutions.iter().map(|s| s.det_signs[0]).collect::<Vec<_>>(),
        "lambda": set.solutions.iter().map(|s| s.x[..s.x.len() - 1].to_vec()).collect::<Vec<_>>(),
        "continua": continua,
        "index_sum": set.index_sum,
        "complete": certified(map, alpha, set),
    })
}

fn print(map: &CondensedContact<PlanarCoulomb>, name: &str, alpha: f64, set: &SolutionSet) {
    let solutions: Vec<String> = set
        .solutions
        .iter()
        .map(|s| {
            let states: Vec<String> = s.selections.iter().map(|x| letters(map, x)).collect();
            let sign = match s.det_signs[0] {
                Some(1) => "det > 0",
                Some(-1) => "det < 0",
                Some(_) => "det = 0",
                None => "det unknown",
            };
            format!("{} ({sign})", states.join("="))
        })
        .collect();
    let mut notes = match set.completeness {
        Completeness::Complete if certified(map, alpha, set) => "complete".to_owned(),
        Completeness::Complete => "complete, but the index sum is not +1".to_owned(),
        Completeness::Incomplete { examined, total } => {
            format!("incomplete: {examined:.0} of {total:.0} selections examined")
        }
        Completeness::Undecided { selections, doubt } => undecided(selections, doubt),
        _ => "completeness unknown".to_owned(),
    };
    if let Some(sum) = set.index_sum {
        notes.push_str(&format!(", index sum {sum:+}"));
    }
    if !set.continua.is_empty() {
        notes.push_str(&format!(
            ", {}",
            common::count(set.continua.len(), "continuum", "continua")
        ));
    }
    println!(
        "{name:16} α = {alpha:<10.6} {:>12}: {}   [{notes}]",
        common::count(set.solutions.len(), "solution", "solutions"),
        solutions.join("  ")
    );
}

fn undecided(selections: u64, doubt: Doubt) -> String {
    let why = match doubt {
        Doubt::NoCoefficients => "the coefficients are not known exactly",
        Doubt::Discontinuous => "the pieces do not agree where they meet",
        Doubt::Contradiction => "the coefficients stated are not those of the pieces",
        Doubt::Limit => "the search in exact arithmetic reached its cap",
        _ => "rounding decides",
    };
    format!("not proven: {why}, {selections} selections undecided")
}

fn numbers(case: &Value, key: &str) -> Result<Vec<f64>, Box<dyn Error>> {
    let list = case[key]
        .as_array()
        .ok_or_else(|| format!("`{key}` is missing or no list"))?;
    let number = |v: &Value| {
        v.as_f64()
            .ok_or_else(|| format!("`{key}` holds {v}, not a number").into())
    };
    list.iter().map(number).collect()
}

fn matrix(case: &Value, key: &str) -> Result<Matrix, Box<dyn Error>> {
    let rows = case[key]
        .as_array()
        .ok_or_else(|| format!("`{key}` is missing or no matrix"))?;
    let row = |r: &Value| -> Result<Vec<f64>, Box<dyn Error>> {
        let list = r
            .as_array()
            .ok_or_else(|| format!("a row of `{key}` is no list"))?;
        let number = |v: &Value| {
            v.as_f64()
                .ok_or_else(|| format!("`{key}` holds {v}, not a number").into())
        };
        list.iter().map(number).collect()
    };
    let rows = rows.iter().map(row).collect::<Result<Vec<_>, _>>()?;
    Ok(Matrix::from_rows(&rows)?)
}

fn problem(case: &Value) -> Result<FullContact<PlanarCoulomb>, Box<dyn Error>> {
    let load = LoadPath::affine(numbers(case, "f0")?, numbers(case, "f1")?);
    let friction = FrictionCoefficient::affine(numbers(case, "F0")?, numbers(case, "F1")?)?;
    let (a, bnu, bt) = (matrix(case, "A")?, matrix(case, "Bnu")?, matrix(case, "Bt")?);
    let r = case["r"].as_f64().unwrap_or(1.0);
    Ok(FullContact::planar(a, bnu, bt, load, friction)?.with_r(r)?)
}
