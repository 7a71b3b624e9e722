//! All solution branches of friction problems, as diagrams: a bifurcation with a vertical segment, five branches of which four are
//! closed and connected to nothing (isolas), and a symmetric block with six branches in one point.
//! You will see the vertices and edges of each diagram, the numbers of solutions, the folds, and pictures; dashes mean det ∇_yH < 0.
//! The program `semismooth diagram` writes tables and JSON, too.
//! Run: cargo run --release --example diagram [-- --out DIR]

#[macro_use]
mod common;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use common::{Outcome, ensure, exit, file_in, five_branches};
use semismooth::contact::{CondensedContact, ContactState, HildRenard, PlanarCoulomb, read_folder};
use semismooth::continuation::{Diagram, DiagramOptions, DiagramVertex, SolutionsAt, VertexKind};
use semismooth::enumeration::EnumerationOptions;
use semismooth::output::{BranchDiagram, Colour, Panel, SegmentStyle};
use semismooth::piecewise::PiecewiseSmooth;

/// Explores the solution sets of three friction problems and draws them.
#[derive(Parser)]
struct Args {
    /// Folder for the pictures.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

fn run(args: &Args) -> Outcome<()> {
    let sections = EnumerationOptions::default();
    let window = |lower, upper| DiagramOptions::default().with_parameter_range((lower, upper));

    // Example 3 of the talk: at F = 2 a branch bifurcates from a vertical segment.
    let map = HildRenard::new(1.0, -2.0, 1.0, 1.0)?.problem()?.condensed()?;
    let diagram = Diagram::explore_sections(&map, &[1.0, 3.0], &window(0.0, 5.0), &sections)?;
    let panels: [Ordinate; 2] = [("λ_ν", &|x| x[0]), ("λ_t", &|x| x[1])];
    report(
        "bifurcation",
        &map,
        &diagram,
        &[1.0, 2.0, 3.0],
        &panels,
        (0.0, 5.0),
        &args.out,
    )?;
    let bifurcates = |v: &DiagramVertex| {
        matches!(v.kind, VertexKind::Branching | VertexKind::BranchPoint)
            && (v.parameter() - 2.0).abs() < 1e-9
    };
    ensure(
        diagram.vertices().iter().any(bifurcates),
        "a branch bifurcates at F = 2",
    )?;

    // Three nodes: all solutions at α = 0 give starts on all branches, isolas included.
    let map = five_branches()?.condensed()?;
    let diagram = Diagram::explore_sections(&map, &[0.0], &window(-4.0, 4.0), &sections)?;
    let force = |x: &[f64]| {
        x[..3]
            .iter()
            .zip([1.0, 0.6, 0.3])
            .map(|(l, w)| l * w)
            .sum::<f64>()
    };
    let slip = |x: &[f64]| {
        map.nodes(x)
            .iter()
            .zip([1.0, 0.6, 0.3])
            .map(|(v, w)| v.slip[0] * w)
            .sum::<f64>()
    };
    let panels: [Ordinate; 2] = [("λ_ν, weighted sum", &force), ("u_t, weighted sum", &slip)];
    report(
        "isolas",
        &map,
        &diagram,
        &[-0.25, 0.0, 0.25],
        &panels,
        (-0.3, 0.3),
        &args.out,
    )?;
    ensure(
        diagram.isolas().len() == 4,
        "four of the five branches are isolas",
    )?;
    ensure(
        diagram.solutions_at(&map, 0.0)?.count() == Some(17),
        "there are 17 solutions at 0",
    )?;

    // A symmetric block under the load (1 − γ) f0 + γ f1 with f0 = −f1: at γ = 0.5 it is unloaded and all nodes graze.
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/block_symmetric");
    let map = read_folder(folder)?.condensed()?;
    let p = map.num_sites();
    let mut unloaded = vec![0.0; map.num_vars()];
    unloaded[2 * p] = 0.5;
    let diagram = Diagram::explore(&map, &[unloaded], &window(0.0, 1.0))?;
    let normal = |x: &[f64]| x[..p].iter().sum();
    let tangential = |x: &[f64]| x[p..2 * p].iter().sum();
    let panels: [Ordinate; 2] = [
        ("sum of normal forces", &normal),
        ("sum of tangential forces", &tangential),
    ];
    report(
        "block",
        &map,
        &diagram,
        &[0.25, 0.75],
        &panels,
        (0.0, 1.0),
        &args.out,
    )?;
    let most = diagram.vertices().iter().map(|v| v.arms.len()).max();
    ensure(most == Some(6), "six branches meet where the block is unloaded")
}

/// What is drawn: a label and a scalar of x.
type Ordinate<'a> = (&'a str, &'a dyn Fn(&[f64]) -> f64);

fn report(
    name: &str,
    map: &CondensedContact<PlanarCoulomb>,
    diagram: &Diagram,
    alphas: &[f64],
    panels: &[Ordinate; 2],
    view: (f64, f64),
    out: &Path,
) -> Outcome<()> {
    println!("{name}: {diagram}");
    for &alpha in alphas {
        let at = diagram.solutions_at(map, alpha)?;
        println!("at {alpha}: {}", solutions(map, &at));
        // The degree of the map of a friction problem is 1.
        ensure(
            at.index_sum().is_none_or(|sum| sum == 1),
            "the indices of all solutions add up to 1",
        )?;
    }
    let folds: Vec<String> = diagram
        .folds()
        .iter()
        .map(|f| format!("{:.9}", f.parameter()))
        .collect();
    println!(
        "folds: {}",
        if folds.is_empty() {
            "none".into()
        } else {
            folds.join(", ")
        }
    );
    println!("isolas: {}", diagram.isolas().len());

    let panel = |(label, ordinate): Ordinate| {
        Panel::new("α", label)
            .with_x_range(view.0, view.1)
            .with_diagram(diagram, ordinate, |s, grazing| style(&map.states(s), grazing))
    };
    let picture = file_in(out, &format!("diagram_{name}.svg"))?;
    BranchDiagram::new(panel(panels[0]))
        .with_panel(panel(panels[1]))
        .with_title(name)
        .with_size(960, 460)
        .write(&picture)?;
    println!("written: {}\n", picture.display());
    Ok(())
}

fn solutions(map: &CondensedContact<PlanarCoulomb>, at: &SolutionsAt) -> String {
    let names: Vec<String> = at
        .points
        .iter()
        .map(|s| {
            let sign = match s.det_sign {
                Some(1) => "+",
                Some(-1) => "-",
                Some(_) => "0",
                None => "?",
            };
            let letters: String = map.states(&s.selection).iter().map(|c| c.letter()).collect();
            format!("{letters} ({sign})")
        })
        .collect();
    let mut text = match at.count() {
        Some(1) => "1 solution".into(),
        Some(n) => format!("{n} solutions"),
        None => format!("{} continuum of solutions", at.continua.len()),
    };
    if let Some(sum) = at.index_sum() {
        text.push_str(&format!(", index sum {sum:+}"));
    }
    if !names.is_empty() {
        text.push_str(": ");
        text.push_str(&names.join(" "));
    }
    text
}

/// The state of all nodes together.
fn style(states: &[ContactState], grazing: &[usize]) -> SegmentStyle {
    let count = |state| states.iter().filter(|s| **s == state).count();
    let (open, stick) = (count(ContactState::Open), count(ContactState::Stick));
    if !grazing.is_empty() {
        SegmentStyle::new("grazing", Colour::GREY)
    } else if open == states.len() {
        SegmentStyle::new("no contact", Colour::RED)
    } else if open + stick == states.len() {
        SegmentStyle::new("all in contact stick", Colour::GREEN)
    } else if stick == 0 {
        SegmentStyle::new("all in contact slip", Colour::BLUE)
    } else {
        SegmentStyle::new("stick and slip", Colour::PURPLE)
    }
}
