//! Coulomb friction with few contact nodes: every solution at given parameters, by complete enumeration.
//! You see for each case and α the number of solutions, their states, the signs of det ∇_yH and whether the list is certified complete. The
//! program `semismooth solutions` does the same for problems of your own, with tables and JSON.
//! Run: cargo run --release --example all_solutions

#[macro_use]
mod common;

use std::error::Error;
use std::process::ExitCode;

use clap::Parser;
use semismooth::contact::{CondensedContact, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::enumeration::{EnumerationOptions, SolutionSet, all_solutions};
use semismooth::piecewise::Selection;
use semismooth::sparse::Matrix;
use serde_json::Value;

/// Prints all solutions of nine small friction problems at given parameters.
#[derive(Parser)]
struct Arguments {}

fn main() -> ExitCode {
    Arguments::parse();
    common::exit(run())
}

/// The problems are lists of numbers: A, Bnu, Bt, f0, f1, F0, F1, and the parameters.
fn run() -> Result<(), Box<dyn Error>> {
    let text = include_str!("../tests/data/seed_examples.json");
    let file: Value = serde_json::from_str(text)?;
    let options = EnumerationOptions::default();
    for case in file["cases"].as_array().into_iter().flatten() {
        let name = case["name"].as_str().unwrap_or_default();
        let map = problem(case)?.condensed()?;
        for alpha in numbers(case, "alphas")? {
            print(&map, name, alpha, &all_solutions(&map, alpha, &options)?);
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
    let mut notes = match set.completeness.is_complete() && !certified(map, alpha, set) {
        true => "complete, but the index sum is not +1".to_owned(),
        false => set.completeness.to_string(),
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
