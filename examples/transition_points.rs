//! Every solution branch of six small Coulomb friction problems with one or two contact nodes (Haslinger, Janovský, Ligurský).
//! You will see each transition point exact and classified, its distance from exact arithmetic, the tables that the talk prints next to the
//! values found here, and a picture of each problem.
//! Run: cargo run --release --example transition_points [-- --out DIR]

#[macro_use]
mod common;
#[path = "common/printed.rs"]
mod printed;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, exit, file_in};
use printed::{Printed, compare, word};
use semismooth::contact::{ContactState, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, TransitionKind};
use semismooth::output::{BranchDiagram, Curve, Panel, SegmentStyle};
use semismooth::piecewise::Selection;
use semismooth::sparse::Matrix;
use serde_json::Value;

/// Follows every branch of six friction problems and prints their transition points.
#[derive(Parser)]
struct Args {
    /// Folder for the pictures.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

/// An example of the talk: the source of its data, the window of α, and a state at α = 10 from which each branch is followed.
struct Example {
    key: &'static str,
    title: &'static str,
    window: (f64, f64),
    starts: &'static [&'static str],
    /// The values that the talk prints for each branch.
    printed: &'static [&'static [Printed]],
}

/// Coefficients of friction F = α must not be negative in contact: windows extend slightly below 0 to show where branches end.
const EXAMPLES: [Example; 6] = [
    Example {
        key: "p1_ex1",
        title: "p = 1, Example 1: f = (1.5, 7), F = α",
        window: (-0.5, 10.0),
        starts: &["K"],
        printed: &[printed::P1_EXAMPLE_1],
    },
    Example {
        key: "p1_ex2",
        title: "p = 1, Example 2: f = (1.5, −4), F = α",
        window: (-0.5, 10.0),
        starts: &["O", "K"],
        printed: &[],
    },
    Example {
        key: "p1_ex3",
        title: "p = 1, Example 3: f = (1, −2), F = α",
        window: (-0.5, 10.0),
        starts: &["O", "K"],
        printed: &[printed::P1_EXAMPLE_3_BRANCH_1, printed::P1_EXAMPLE_3_BRANCH_2],
    },
    Example {
        key: "p1_ex4",
        title: "p = 1, Example 4: f = (1 − 0.08, −2), F = α",
        window: (-0.5, 10.0),
        starts: &["O", "K"],
        printed: &[],
    },
    Example {
        key: "p2_ex1",
        title: "p = 2, Example 1: F = (α, α)",
        window: (-0.5, 10.0),
        starts: &["OO", "KK"],
        printed: &[&[], printed::P2_EXAMPLE_1],
    },
    Example {
        key: "p2_ex2",
        title: "p = 2, Example 2: f = f⁰ + α f¹, F = (4, 4)",
        window: (-6.0, 10.0),
        starts: &["OK"],
        printed: &[],
    },
];

const START: f64 = 10.0;
/// The augmentation parameter of the talk. Solutions do not depend on it; the values of the test functions do.
const R: f64 = 1.0;
/// Steps between which a branch is straight to four decimals.
const SHORT: f64 = 0.02;
const TOLERANCE: f64 = 1e-9;

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

fn run(args: &Args) -> Outcome<()> {
    let text = include_str!(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/tests/data/seed_examples.json"
    ));
    let reference: Value = serde_json::from_str(text)?;
    let begun = Instant::now();
    let mut worst = 0.0_f64;
    for example in &EXAMPLES {
        let case = reference["cases"]
            .as_array()
            .and_then(|cases| cases.iter().find(|c| c["name"] == example.key))
            .ok_or_else(|| format!("no reference for {}", example.key))?;
        worst = worst.max(show(example, case, args)?);
    }
    println!(
        "\nSix examples in {:.0} ms; largest deviation from the exact values {worst:.1e}; pictures in {}",
        begun.elapsed().as_secs_f64() * 1e3,
        args.out.display()
    );
    if worst > TOLERANCE {
        return Err(format!("a deviation of {worst:e} from the exact values").into());
    }
    Ok(())
}

/// Follows all branches of one example; returns the largest deviation from the reference.
fn show(example: &Example, case: &Value, args: &Args) -> Outcome<f64> {
    println!("\n{}  (r = {R})", example.title);
    let map = problem(case)?.with_r(R)?;
    let p = map.num_contacts();
    let options = ContinuationOptions::default()
        .with_parameter_range(example.window)
        .with_max_step(0.2);
    let mut all = Vec::new();
    for start in example.starts {
        let states = states(start);
        let x = map.solve_from_states(START, &states)?;
        // The start lies on the bound of the window: the other direction leaves it at once.
        let branch = Branch::follow(&map, &x, Direction::Decreasing, options.clone())?;
        let events = events(&map, &branch);
        all.push(Followed {
            states,
            x,
            branch,
            events,
        });
    }
    number(&mut all);
    let mut found = vec![false; vertices(case).len()];
    let mut worst = 0.0_f64;
    for (k, followed) in all.iter().enumerate() {
        let branch = &followed.branch;
        let last = branch.polyline().last().map_or(START, |(_, x)| x[x.len() - 1]);
        println!(
            "  branch {}: {} at α = {START}, {} points, to α = {:.4} ({})",
            k + 1,
            words_of(&followed.states),
            branch.points.len(),
            positive_zero(last),
            branch.termination,
        );
        for met in &followed.events {
            let deviation = match nearest(case, &met.x) {
                Some((v, deviation)) => {
                    found[v] = true;
                    deviation
                }
                None => f64::INFINITY,
            };
            worst = worst.max(deviation);
            print_event(&map, met, deviation);
        }
        if let Some(&table) = example.printed.get(k).filter(|table| !table.is_empty()) {
            let fine = Branch::follow(
                &map,
                &followed.x,
                Direction::Decreasing,
                options.clone().with_max_step(SHORT),
            )?;
            compare(&map, &fine, table)?;
        }
    }
    let missing = found.iter().filter(|f| !**f).count();
    if missing > 0 {
        return Err(format!("{}: {missing} transition points were not met", example.key).into());
    }
    picture(example, &map, &all, p).write(file_in(&args.out, &format!("{}.svg", file_name(example)))?)?;
    Ok(worst)
}

fn file_name(example: &Example) -> String {
    example.key.replace("ex", "example")
}

/// A branch with the state at its start and its events.
struct Followed {
    states: Vec<ContactState>,
    x: Vec<f64>,
    branch: Branch,
    events: Vec<Met>,
}

/// A transition or branch point on a branch, with the states of all nodes before and after it.
struct Met {
    /// T1, T2, … of an example.
    number: usize,
    x: Vec<f64>,
    before: Vec<&'static str>,
    after: Vec<&'static str>,
    kind: String,
}

/// Transitions and branch points of a branch, by arclength.
fn events(map: &FullContact<PlanarCoulomb>, branch: &Branch) -> Vec<Met> {
    let mut all = Vec::new();
    for t in &branch.transitions {
        let before = words(map, &t.before, &[]);
        let behind = match t.followed.or((!t.arms.is_empty()).then_some(0)) {
            Some(k) => words(map, &t.arms[k].selection, &t.arms[k].grazing),
            None => before.clone(),
        };
        let kind = match t.kind {
            TransitionKind::Branching => format!("branching, {} arms go on", t.arms.len()),
            kind => kind.to_string(),
        };
        all.push((
            t.arclength,
            Met {
                number: 0,
                x: t.x.clone(),
                before,
                after: behind,
                kind,
            },
        ));
    }
    for b in &branch.branch_points {
        let others = b.arms.iter().enumerate().filter(|(k, _)| Some(*k) != b.followed);
        let others: Vec<_> = others
            .map(|(_, arm)| words(map, &arm.selection, &arm.grazing).join(", "))
            .collect();
        let here = words(map, &b.point.selection, &b.point.grazing);
        let met = Met {
            number: 0,
            x: b.point.x.clone(),
            before: here.clone(),
            after: here,
            kind: format!("branching, leaves along: {}", others.join("; ")),
        };
        all.push((b.point.arclength, met));
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.into_iter().map(|(_, met)| met).collect()
}

/// Numbers the events, from the last branch on as the talk does; a point on two branches has one number.
fn number(all: &mut [Followed]) {
    let mut known: Vec<Vec<f64>> = Vec::new();
    for met in all.iter_mut().rev().flat_map(|followed| &mut followed.events) {
        let same = |x: &Vec<f64>| x.iter().zip(&met.x).all(|(a, b)| (a - b).abs() <= TOLERANCE);
        let place = known.iter().position(same).unwrap_or_else(|| {
            known.push(met.x.clone());
            known.len() - 1
        });
        met.number = place + 1;
    }
}

fn words(map: &FullContact<PlanarCoulomb>, selection: &Selection, grazing: &[usize]) -> Vec<&'static str> {
    let states = map.states(selection).into_iter().enumerate();
    states
        .map(|(node, state)| word(state, grazing.contains(&node)))
        .collect()
}

fn print_event(map: &FullContact<PlanarCoulomb>, met: &Met, deviation: f64) {
    println!(
        "    T{}  {} at α = {:.12}  (deviation from exact arithmetic {deviation:.1e})",
        met.number,
        met.kind,
        positive_zero(met.x.last().copied().unwrap_or(f64::NAN))
    );
    for (i, theta) in map.theta(&met.x).iter().enumerate() {
        println!(
            "      node {}: {:>15} → {:<15}  θ¹ = {:7.4}  θ² = {:8.4}  θ³ = {:8.4}",
            i + 1,
            met.before[i],
            met.after[i],
            positive_zero(theta[0]),
            positive_zero(theta[1]),
            positive_zero(theta[2])
        );
    }
}

/// Rounding errors print as 0, not as −0.
fn positive_zero(v: f64) -> f64 {
    if v.abs() < 5e-13 { 0.0 } else { v }
}

/// One panel a contact node: its tangential displacement over α, coloured by its state.
fn picture(example: &Example, map: &FullContact<PlanarCoulomb>, all: &[Followed], p: usize) -> BranchDiagram {
    let panel = |node: usize| {
        let label = if p == 1 {
            "tangential displacement u_t".to_owned()
        } else {
            format!("tangential displacement u_t, node {}", node + 1)
        };
        let panel = all.iter().fold(Panel::new("α", label), |panel, followed| {
            panel.with_curve(Curve::of_branch(
                &followed.branch,
                |x| x[2 * node + 1],
                |selection, grazing| {
                    let (state, grazing) = (map.states(selection)[node], grazing.contains(&node));
                    let mut style = SegmentStyle::contact(state, grazing);
                    style.name = word(state, grazing).into();
                    style
                },
            ))
        });
        let mut met: Vec<&Met> = all.iter().flat_map(|followed| &followed.events).collect();
        met.sort_by_key(|met| met.number);
        met.dedup_by_key(|met| met.number);
        met.into_iter().fold(panel, |panel, met| {
            let at = (met.x[met.x.len() - 1], met.x[2 * node + 1]);
            panel.with_note(at, format!("T{}", met.number))
        })
    };
    let diagram = (1..p).fold(BranchDiagram::new(panel(0)), |d, node| d.with_panel(panel(node)));
    diagram
        .with_title(example.title)
        .with_size(if p == 1 { 640 } else { 860 }, 420)
}

// The reference: problems and the vertices of their solution graphs, from exact rational arithmetic.

fn numbers(v: &Value) -> Vec<f64> {
    v.as_array()
        .map_or(Vec::new(), |a| a.iter().filter_map(Value::as_f64).collect())
}

fn matrix(v: &Value) -> Outcome<Matrix> {
    let rows: Vec<Vec<f64>> = v
        .as_array()
        .map_or(Vec::new(), |a| a.iter().map(numbers).collect());
    Ok(Matrix::from_rows(&rows)?)
}

fn problem(case: &Value) -> Outcome<FullContact<PlanarCoulomb>> {
    Ok(FullContact::planar(
        matrix(&case["A"])?,
        matrix(&case["Bnu"])?,
        matrix(&case["Bt"])?,
        LoadPath::affine(numbers(&case["f0"]), numbers(&case["f1"])),
        FrictionCoefficient::affine(numbers(&case["F0"]), numbers(&case["F1"]))?,
    )?)
}

/// x = (u, λν, λt, α) of each vertex.
fn vertices(case: &Value) -> Vec<Vec<f64>> {
    let list = case["graph"]["vertices"].as_array();
    list.map_or(Vec::new(), |list| {
        list.iter()
            .map(|v| {
                let parts = [&v["u"], &v["lam_nu"], &v["lam_t"]];
                let mut x: Vec<f64> = parts.iter().flat_map(|p| numbers(p)).collect();
                x.push(v["alpha"].as_f64().unwrap_or(f64::NAN));
                x
            })
            .collect()
    })
}

/// The vertex nearest to x and the largest deviation from it in u, λ or α.
fn nearest(case: &Value, x: &[f64]) -> Option<(usize, f64)> {
    let deviation = |v: &[f64]| x.iter().zip(v).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    vertices(case)
        .iter()
        .map(|v| deviation(v))
        .enumerate()
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

fn states(letters: &str) -> Vec<ContactState> {
    letters
        .chars()
        .map(|c| {
            let state = ContactState::ALL.into_iter().find(|s| s.letter() == c);
            state.unwrap_or(ContactState::Open)
        })
        .collect()
}

fn words_of(states: &[ContactState]) -> String {
    let words: Vec<_> = states.iter().map(|s| word(*s, false)).collect();
    words.join(", ")
}
