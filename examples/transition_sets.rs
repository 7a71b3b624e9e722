//! One contact node with Coulomb friction: where the number of solutions changes, in two planes of parameters (Hild and Renard 2005).
//! You will see the followed transition lines, folds in orange, over the regions with one, two and three solutions, as two pictures.
//! Run: cargo run --release --example transition_sets [-- --out DIR]

#[macro_use]
mod common;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use common::{Outcome, ensure, exit, file_in};
use semismooth::contact::{
    FrictionCoefficient, FullContact, HildRenard, HildRenardCase, LoadPath, PlanarCoulomb,
};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, TransitionSet};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};

/// Follows and draws the transition sets of the model with one contact node.
#[derive(Parser)]
struct Args {
    /// Folder for the pictures.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

/// Test functions of the node.
const CONTACT: usize = 0;
const SLIP_PLUS: usize = 1;
const SLIP_MINUS: usize = 2;

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

fn run(args: &Args) -> Outcome<()> {
    let loads = load_plane()?;
    loads.write(file_in(&args.out, "transition_sets_load.svg")?)?;
    let friction = friction_plane()?;
    friction.write(file_in(&args.out, "transition_sets_friction.svg")?)?;
    println!("Pictures in {}", args.out.display());
    Ok(())
}

/// The plane (f_ν, f_t) at F = 3.
fn load_plane() -> Outcome<BranchDiagram> {
    const F: f64 = 3.0;
    println!("(f_ν, f_t) at F = {F}");
    let problem = HildRenard::new(0.0, 0.0, 1.0, 1.0)?.problem()?;
    let problem = problem
        .with_load(LoadPath::affine(vec![0.0, 0.0], vec![1.0, 0.0]))?
        .with_law(PlanarCoulomb::new(FrictionCoefficient::nodal(vec![F])?))?;
    let family = problem.with_second_parameter(vec![0.0, 1.0], problem.node_law().clone())?;
    let mut panel = regions(
        Panel::new("f_ν", "f_t"),
        (-2.0, 4.0),
        (-8.0, 8.0),
        |normal, tangential| {
            let model = HildRenard::new(normal, tangential, 1.0, 1.0)?;
            Ok(match model.case() {
                HildRenardCase::Two => ("two branches over F", TWO),
                _ => ("one branch over F", ONE),
            })
        },
    )?;
    // Each line starts at one of its points that is known.
    let starts = [
        (SLIP_MINUS, [0.0, 0.0, 2.0, -6.0, 2.0, -6.0]),
        (SLIP_PLUS, [0.0, 0.0, 2.0, 6.0, 2.0, 6.0]),
        (CONTACT, [0.0, -1.0, 0.0, 0.0, 1.0, -2.0]),
    ];
    for (test, x) in starts {
        for direction in [Direction::Decreasing, Direction::Increasing] {
            panel = panel.with_curve(line(&family, test, &x, direction, false)?);
        }
    }
    let panel = panel.with_x_range(-2.0, 4.0).with_y_range(-8.0, 8.0);
    Ok(BranchDiagram::new(panel)
        .with_title("Transition sets at F = 3")
        .with_size(680, 460))
}

/// The plane (f_t, F) at f_ν = 1.5.
fn friction_plane() -> Outcome<BranchDiagram> {
    println!("(f_t, F) at f_ν = 1.5");
    let problem = HildRenard::new(1.5, 0.0, 1.0, 1.0)?.problem()?;
    let family = problem.with_second_parameter(vec![0.0, 1.0], problem.node_law().clone())?;
    let mut panel = regions(
        Panel::new("f_t", "F"),
        (-8.0, 8.0),
        (0.0, 6.0),
        |tangential, friction| {
            let model = HildRenard::new(1.5, tangential, 1.0, 1.0)?;
            let holds = |b: &semismooth::contact::HildRenardBranch| {
                (b.interval.0..=b.interval.1).contains(&friction) && b.interval.0 < b.interval.1
            };
            Ok(match model.branches().iter().filter(|b| holds(b)).count() {
                3 => ("three solutions", THREE),
                2 => ("two solutions", TWO),
                _ => ("one solution", ONE),
            })
        },
    )?;
    let starts = [
        (SLIP_MINUS, [0.0, 0.0, 1.5, -6.0, 4.0, -6.0]),
        (SLIP_PLUS, [0.0, 0.0, 1.5, 6.0, 4.0, 6.0]),
    ];
    for (test, x) in starts {
        for direction in [Direction::Decreasing, Direction::Increasing] {
            panel = panel.with_curve(line(&family, test, &x, direction, true)?);
        }
    }
    for rate in [1.0, -1.0] {
        let along = Direction::Along(vec![0.0, 0.0, 0.0, 0.0, rate, 0.0]);
        let x = [0.0, -1.5, 0.0, 0.0, 3.0, -3.0];
        panel = panel.with_curve(line(&family, CONTACT, &x, along, true)?);
    }
    let panel = panel.with_x_range(-8.0, 8.0).with_y_range(0.0, 6.0);
    Ok(BranchDiagram::new(panel)
        .with_title("Transition sets at f_ν = 1.5")
        .with_size(680, 460))
}

const ONE: Colour = Colour::new(0xe4, 0xe9, 0xf2);
const TWO: Colour = Colour::new(0xf6, 0xdc, 0xb8);
const THREE: Colour = Colour::new(0xf1, 0xc4, 0xc4);

/// Fills regions of the plane by their class, sampled in small steps.
fn regions(
    mut panel: Panel,
    x: (f64, f64),
    y: (f64, f64),
    class: impl Fn(f64, f64) -> Outcome<(&'static str, Colour)>,
) -> Outcome<Panel> {
    const COLUMNS: usize = 240;
    const ROWS: usize = 320;
    let at = |range: (f64, f64), k: usize, n: usize| range.0 + (range.1 - range.0) * k as f64 / n as f64;
    let mut classes: Vec<(&'static str, Colour)> = Vec::new();
    for i in 0..COLUMNS {
        let (left, right) = (at(x, i, COLUMNS), at(x, i + 1, COLUMNS));
        let here = |j: usize| class(0.5 * (left + right), 0.5 * (at(y, j, ROWS) + at(y, j + 1, ROWS)));
        let mut from = 0;
        while from < ROWS {
            let found = here(from)?;
            let mut to = from + 1;
            while to < ROWS && here(to)? == found {
                to += 1;
            }
            let (low, high) = (at(y, from, ROWS), at(y, to, ROWS));
            let corners = vec![(left, low), (right, low), (right, high), (left, high)];
            panel = panel.with_region(corners, found.1);
            if !classes.contains(&found) {
                classes.push(found);
            }
            from = to;
        }
    }
    let named = |panel: Panel, (name, colour)| panel.with_class(SegmentStyle::new(name, colour));
    Ok(classes.into_iter().fold(panel, named))
}

/// Whether x lies on a line known in closed form (λ = μ = 1): the free body touches the ground where f_t = −2 f_ν and does not slide
/// where f_ν = −2 f_t; in contact it begins to slide where |f_t| = F f_ν.
fn is_known(test: usize, x: &[f64], friction_second: bool) -> bool {
    let (normal, tangential, friction) = match friction_second {
        true => (1.5, x[5], x[4]),
        false => (x[4], x[5], 3.0),
    };
    let distances = match test {
        CONTACT => [tangential + 2.0 * normal; 2],
        _ => [tangential.abs() - friction * normal, normal + 2.0 * tangential],
    };
    distances.iter().any(|d| d.abs() < 1e-8)
}

/// A transition line in the plane of the parameters, coloured by what happens to the solution when it is crossed.
fn line(
    family: &FullContact<PlanarCoulomb>,
    test: usize,
    x: &[f64],
    direction: Direction,
    swapped: bool,
) -> Outcome<Curve> {
    let set = TransitionSet::new(family, 0, test)?;
    let options = ContinuationOptions::default()
        .with_parameter_range((-8.0, 8.0))
        .with_max_arclength(12.0)
        .with_max_step(0.1);
    let branch = Branch::follow(&set, x, direction, options)?;
    let place = |x: &[f64]| {
        let (a, b) = (x[4], x[5]);
        if swapped { (b, a) } else { (a, b) }
    };
    let mut vertices: Vec<(f64, f64)> = Vec::new();
    let mut styles = Vec::new();
    let walk = branch.polyline();
    for pair in walk.windows(2) {
        let middle: Vec<f64> = pair[0]
            .1
            .iter()
            .zip(pair[1].1)
            .map(|(a, b)| 0.5 * (a + b))
            .collect();
        let selection = semismooth::piecewise::select(&set, &middle);
        let style = match (set.is_fold(&selection, &middle)?, test) {
            (Some(true), _) => SegmentStyle::new("fold", Colour::ORANGE),
            (_, CONTACT) => SegmentStyle::new("contact is lost", Colour::RED),
            _ => SegmentStyle::new("stick and slip", Colour::GREEN),
        };
        styles.push(style);
    }
    vertices.extend(walk.iter().map(|(_, x)| place(x)));
    let known = walk.iter().all(|(_, x)| is_known(test, x, swapped));
    ensure(known, "the transition lines are those of Hild and Renard")?;
    for t in &branch.transitions {
        let (a, b) = place(&t.x);
        println!("  two test functions vanish at ({a:.6}, {b:.6}): {}", t.kind);
    }
    Ok(Curve::segments(vertices, styles).with_tangents(&branch, place))
}
