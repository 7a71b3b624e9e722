//! Markets and games with several equilibria, followed in a parameter: an economy of T. J. Kehoe with three equilibria, and the
//! problem of Kojima and Shindo with two.
//!
//! You will see the graph of all equilibria connected to one that is known: where activities start and stop, where equilibria
//! appear and vanish in pairs (folds), how many there are at given parameters, and two pictures.
//!
//! ```text
//! cargo run --release --example parametric_mcp
//! ```

#[macro_use]
mod common;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use common::{Outcome, count, exit, file_in};
use semismooth::complementarity::{Autodiff, Mcp, McpFunction, McpSolver, SmoothFunction};
use semismooth::continuation::{ContinuationOptions, Diagram, DiagramOptions};
use semismooth::output::{BranchDiagram, Colour, Panel, SegmentStyle};
use semismooth::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt, Real};

#[derive(Parser)]
#[command(about = "Several equilibria in a parameter: Kehoe's economy, Kojima-Shindo")]
struct Arguments {
    /// Folder for the pictures.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    kehoe(arguments)?;
    kojima_shindo(arguments)
}

/// Four goods and consumers, two activities (T. J. Kehoe, 1985). Unknowns: activity levels y₀, y₁ and prices p₀ … p₃, p₀ = 1; the
/// parameter is the endowment of consumer 2 with good 2.
struct Kehoe;

/// Part of its income that a consumer (row) spends on a good (column).
const SHARES: [[f64; 4]; 4] = [
    [0.52, 0.4, 0.04, 0.04],
    [0.86, 0.1, 0.02, 0.02],
    [0.5, 0.2, 0.2975, 0.0025],
    [0.06, 0.25, 0.0025, 0.6875],
];
const ENDOWMENT: [f64; 4] = [50.0, 50.0, 400.0, 400.0];
const ACTIVITIES: [[f64; 4]; 2] = [[6.0, -1.0, -4.0, -1.0], [-1.0, 3.0, -1.0, -1.0]];

impl SmoothFunction for Kehoe {
    fn num_vars(&self) -> usize {
        7
    }

    fn num_values(&self) -> usize {
        6
    }

    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        let (y, p, endowment) = (&x[..2], &x[2..6], x[6]);
        // An activity runs where it makes no loss: y ≥ 0 ⟂ −profit ≥ 0.
        for (k, activity) in ACTIVITIES.iter().enumerate() {
            out[k] = -(p[0] * activity[0] + p[1] * activity[1] + p[2] * activity[2] + p[3] * activity[3]);
        }
        // A price is positive where demand meets supply: p ≥ 0 ⟂ supply − demand ≥ 0.
        for j in 0..4 {
            let own = |i: usize| {
                if i == 2 {
                    endowment
                } else {
                    p[i] * 0.0 + ENDOWMENT[i]
                }
            };
            let mut supply = own(j) + y[0] * ACTIVITIES[0][j] + y[1] * ACTIVITIES[1][j];
            for i in 0..4 {
                supply -= p[i] * own(i) * SHARES[i][j] / p[j];
            }
            out[2 + j] = supply;
        }
    }
}

fn kehoe(arguments: &Arguments) -> Outcome<()> {
    let inf = f64::INFINITY;
    let lower = vec![0.0, 0.0, 1.0, 1e-3, 1e-3, 1e-3];
    let upper = vec![inf, inf, 1.0, inf, inf, inf];
    let map = Mcp::new(Autodiff::new(Kehoe), lower, upper)?;
    // All prices 1, levels 52 and 69 at the endowment 400: an equilibrium in whole numbers.
    let start = [52.0, 69.0, 1.0, 1.0, 1.0, 1.0, 400.0];
    println!("Kehoe's economy over the endowment with good 2");
    let diagram = explore(&map, &[start.to_vec()], (200.0, 800.0))?;
    let at = diagram.solutions_at(&map, 400.0)?;
    for s in &at.points {
        let numbers: Vec<String> = s.x[..6].iter().map(|v| format!("{v:.4}")).collect();
        println!(
            "  at 400: y = ({}), p = ({}), index {}",
            numbers[..2].join(", "),
            numbers[2..].join(", "),
            s.det_sign
                .map_or("unknown".to_owned(), |sign| format!("{sign:+}"))
        );
    }
    println!("  {} equilibria at 400", at.points.len());
    report(&map, &diagram);
    draw(
        arguments,
        "kehoe",
        &diagram,
        "Kehoe's economy: equilibria",
        ["endowment with good 2", "price of good 3"],
        5,
    )?;
    if at.points.len() != 3 {
        return Err(format!(
            "Kehoe's economy has 3 equilibria at 400, found {}",
            at.points.len()
        )
        .into());
    }
    Ok(())
}

/// M. Kojima, S. Shindo (1986), with the constant of the third row as parameter (9 in the original).
struct KojimaShindo;

impl SmoothFunction for KojimaShindo {
    fn num_vars(&self) -> usize {
        5
    }

    fn num_values(&self) -> usize {
        4
    }

    fn eval<T: Real>(&self, v: &[T], out: &mut [T]) {
        let [a, b, c, d, constant] = [v[0], v[1], v[2], v[3], v[4]];
        out[0] = a * a * 3.0 + a * b * 2.0 + b * b * 2.0 + c + d * 3.0 - 6.0;
        out[1] = a * a * 2.0 + b * b + a + c * 10.0 + d * 2.0 - 2.0;
        out[2] = a * a * 3.0 + a * b + b * b * 2.0 + c * 2.0 + d * 9.0 - constant;
        out[3] = a * a + b * b * 3.0 + c * 2.0 + d * 3.0 - 3.0;
    }
}

fn kojima_shindo(arguments: &Arguments) -> Outcome<()> {
    println!("Kojima and Shindo over the constant of the third row");
    let map = Mcp::new(Autodiff::new(KojimaShindo), vec![0.0; 4], vec![f64::INFINITY; 4])?;
    // Equilibria at fixed parameters start the curves.
    let mut starts: Vec<Vec<f64>> = Vec::new();
    for constant in [3.0, 9.0] {
        for first in [
            [0.0; 4],
            [1.0, 0.0, 1.0, 0.0],
            [1.0, 0.0, 0.0, 0.5],
            [1.0, 0.0, 3.0, 0.0],
        ] {
            let mut x = first.to_vec();
            let problem = map.at(constant)?;
            if McpSolver::default().solve(&problem, &mut x)?.is_solved() {
                x.push(constant);
                let near = |s: &Vec<f64>| s.iter().zip(&x).all(|(a, b)| (a - b).abs() < 1e-6);
                if !starts.iter().any(near) {
                    starts.push(x);
                }
            }
        }
    }
    let diagram = explore(&map, &starts, (0.0, 12.0))?;
    for constant in [1.0, 6.0, 8.5] {
        let at = diagram.solutions_at(&map, constant)?;
        println!(
            "  at {constant}: {}",
            count(at.points.len(), "solution", "solutions")
        );
    }
    report(&map, &diagram);
    draw(
        arguments,
        "kojima_shindo",
        &diagram,
        "Kojima and Shindo's problem: solutions",
        ["constant of the third row", "x₂"],
        2,
    )
}

fn explore<F: McpFunction>(map: &Mcp<F>, starts: &[Vec<f64>], range: (f64, f64)) -> Outcome<Diagram> {
    let continuation = ContinuationOptions::default().with_max_step(0.02 * (range.1 - range.0));
    let options = DiagramOptions::default()
        .with_continuation(continuation)
        .with_parameter_range(range);
    Ok(Diagram::explore(map, starts, &options)?)
}

fn report<P: PiecewiseSmooth>(map: &P, diagram: &Diagram) {
    for vertex in diagram.vertices() {
        println!("  vertex at {:10.5}: {}", vertex.parameter(), vertex.kind.name());
    }
    for fold in diagram.folds() {
        println!("  fold   at {:10.5}", fold.parameter());
    }
    println!(
        "  {} branches, {} points, sites such as {}",
        diagram.branches().len(),
        diagram.points_computed(),
        map.site_name(0)
    );
}

/// One entry of x over the parameter; dashed where the index is −1.
fn draw(
    arguments: &Arguments,
    name: &str,
    diagram: &Diagram,
    title: &str,
    axes: [&str; 2],
    entry: usize,
) -> Outcome<()> {
    let style = |_: &_, _: &[usize]| SegmentStyle::new("solutions", Colour::BLUE);
    let panel = Panel::new(axes[0], axes[1]).with_diagram(diagram, |x| x[entry], style);
    let path = file_in(&arguments.out, &format!("{name}.svg"))?;
    BranchDiagram::new(panel).with_title(title).write(&path)?;
    println!("  written: {}", path.display());
    Ok(())
}
