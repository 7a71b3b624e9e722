//! Newton methods for complementarity and friction problems side by side, as papers print them, and iteration by iteration on a few.
//! You will see what each method solves, what it costs and its observed order, a table of all runs and performance profiles (Dolan and
//! Moré 2002), then residuals, steps and changes of pieces on friction problems and a circuit.
//! Run: cargo run --release --example corrector_convergence [-- --full]

// The circuit comes from another example, with what examples share.
#![allow(clippy::duplicate_mod)]

#[macro_use]
mod common;
#[path = "common/contenders.rs"]
mod contenders;
#[path = "common/expressions.rs"]
mod expressions;
#[path = "common/obstacles.rs"]
mod obstacles;
#[path = "common/profiles.rs"]
mod profiles;
#[allow(dead_code)]
#[path = "your_own_problem.rs"]
mod your_own_problem;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::rc::Rc;

use clap::Parser;
use common::{Outcome, Random, ensure, exit, file_in, files_or_shipped, shipped_folder};
use contenders::{
    Complementarity, DAMPINGS, Friction, FunctionOf, METHODS, Run, random_friction, random_lcp,
};
use profiles::Costs;
use semismooth::complementarity::McpFunction;
use semismooth::contact::{
    FrictionCoefficient, FullContact, HildRenard, LoadPath, PlanarCoulomb, read_folder,
};
use semismooth::newton::{Newton, NewtonOptions};
use semismooth::output::BranchDiagram;
use semismooth::piecewise::{PiecewiseSmooth, Traced, value};
use semismooth::sparse::Matrix;
use your_own_problem::TunnelDiode;

/// Compares Newton methods on problems from files and at random; histories of the corrector on contact problems and a circuit.
#[derive(Parser)]
struct Args {
    /// More and larger problems: a minute or two in place of seconds
    #[arg(long)]
    full: bool,
    /// Folder for the table and the pictures
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&Args::parse()))
}

fn run(args: &Args) -> Outcome<()> {
    compare(args)?;
    histories()
}

/// How much of each kind there is.
struct Sizes {
    /// Whether the files of the tests are solved, too.
    files: bool,
    /// Random linear problems, and their orders.
    linear: usize,
    orders: &'static [usize],
    /// Points a side of obstacle problems.
    grids: &'static [usize],
    /// Random friction problems.
    friction: usize,
}

const SMALL: Sizes = Sizes {
    files: false,
    linear: 40,
    orders: &[5, 10, 20],
    grids: &[15, 31],
    friction: 120,
};

const FULL: Sizes = Sizes {
    files: true,
    linear: 400,
    orders: &[5, 10, 20],
    grids: &[15, 31, 63],
    friction: 1000,
};

fn complementarity(sizes: &Sizes) -> Outcome<Vec<Complementarity>> {
    let mut list = Vec::new();
    let mut files = files_or_shipped(&[], "complementarity")?;
    if sizes.files {
        files.extend(files_or_shipped(&[], "mcp")?);
    }
    for file in files {
        let expressions::Problem {
            name,
            solvable,
            mcp,
            starts,
            ..
        } = expressions::read(&file)?;
        if !solvable {
            continue;
        }
        let (lower, upper) = (mcp.lower().to_vec(), mcp.upper().to_vec());
        let function: Rc<dyn McpFunction> = Rc::new(FunctionOf(mcp));
        for (label, start) in starts {
            list.push(Complementarity {
                name: format!("{name} {label}"),
                function: function.clone(),
                lower: lower.clone(),
                upper: upper.clone(),
                start,
            });
        }
    }
    for &m in sizes.grids {
        for kind in [
            obstacles::Problem::Mcplib,
            obstacles::Problem::Hemisphere,
            obstacles::Problem::Torsion,
        ] {
            let lcp = kind.lcp(m)?;
            list.push(Complementarity {
                name: format!("obstacle {} {m} x {m}", kind.name()),
                function: Rc::new(lcp.mcp().function().clone()),
                lower: lcp.lower().to_vec(),
                upper: lcp.upper().to_vec(),
                start: vec![0.0; m * m],
            });
        }
    }
    let mut random = Random::new(1);
    for k in 0..sizes.linear {
        let n = sizes.orders[k / 4 % sizes.orders.len()];
        list.push(random_lcp(n, k, &mut random, &format!("LCP {k}, n = {n}"))?);
    }
    Ok(list)
}

fn friction(sizes: &Sizes) -> Outcome<Vec<Friction>> {
    let mut list = Vec::new();
    let at = |map: Box<dyn PiecewiseSmooth>, name: &str, parameter: f64| {
        let mut start = vec![0.0; map.num_vars()];
        start[map.num_vars() - 1] = parameter;
        let name = format!("{name}, at {parameter}");
        Friction { name, map, start }
    };
    for k in 0..8 {
        let parameter = 0.5 + 0.5 * f64::from(k);
        let one = HildRenard::new(1.5, 7.0, 1.0, 1.0)?.problem()?;
        list.push(at(Box::new(one), "one node of Hild and Renard", parameter));
        list.push(at(Box::new(two_nodes()?), "two nodes", parameter));
        let block = read_folder(shipped_folder())?.problem.condensed()?;
        list.push(at(Box::new(block), "elastic block", parameter / 4.0));
    }
    let mut random = Random::new(2);
    for k in 0..sizes.friction {
        let p = 1 + k % 6;
        list.push(random_friction(
            p,
            &mut random,
            format!("random body {k}, {p} nodes"),
        )?);
    }
    Ok(list)
}

/// Runs all methods on all problems; prints a line a method, writes the table and the profiles.
fn compare(args: &Args) -> Outcome<()> {
    let sizes = if args.full { &FULL } else { &SMALL };
    let mut table = String::from(
        "class,problem,method,solved,residual,evaluations,jacobians,iterations,factorisations,seconds,order\r\n",
    );
    let problems = complementarity(sizes)?;
    let (mut costs, mut runs) = (Costs::new(METHODS.iter().map(|m| m.name).collect()), Vec::new());
    for problem in &problems {
        let row = METHODS
            .iter()
            .map(|m| problem.run(m))
            .collect::<Outcome<Vec<Run>>>()?;
        record(&mut table, "complementarity", &problem.name, &costs.methods, &row)?;
        costs.add(&row);
        runs.push(row);
    }
    summary(
        &format!("{} complementarity problems with their starts", problems.len()),
        &costs,
        &runs,
    );
    let bodies = friction(sizes)?;
    let names = DAMPINGS.iter().map(|d| d.0).collect();
    let (mut contact, mut pushed) = (Costs::new(names), Vec::new());
    for body in &bodies {
        let row = DAMPINGS
            .iter()
            .map(|d| body.run(d.1))
            .collect::<Outcome<Vec<Run>>>()?;
        record(&mut table, "friction", &body.name, &contact.methods, &row)?;
        contact.add(&row);
        pushed.push(row);
    }
    summary(&format!("{} friction problems", bodies.len()), &contact, &pushed);
    write(&args.out, &table, &costs, &contact)?;
    // What the picture says, in sentences that can be false.
    let share = |name: &str| {
        costs
            .methods
            .iter()
            .position(|m| *m == name)
            .map_or(0.0, |k| costs.solved(k))
    };
    let all = share("McpSolver, all strategies");
    ensure(all >= 0.99, "McpSolver solves at least 99 % of the problems")?;
    ensure(
        METHODS.iter().all(|m| share(m.name) <= all),
        "no single method solves more problems than McpSolver with all its strategies",
    )?;
    let orders = |k: usize| {
        median(
            runs.iter()
                .filter(|r| r[k].solved)
                .filter_map(|r| r[k].order)
                .collect(),
        )
    };
    let exact = METHODS
        .iter()
        .position(|m| m.name == "Fischer-Burmeister, full steps")
        .and_then(orders);
    ensure(
        exact.is_some_and(|o| o > 1.6),
        "Fischer-Burmeister's method with full steps converges superlinearly, in the median",
    )
}

fn record(table: &mut String, class: &str, problem: &str, methods: &[&str], row: &[Run]) -> Outcome<()> {
    for (method, r) in methods.iter().zip(row) {
        let order = r.order.map_or_else(String::new, |o| format!("{o:.3}"));
        write!(
            table,
            "{class},\"{problem}\",\"{method}\",{},{:e},{},{},{},{},{:.3e},{order}\r\n",
            r.solved, r.residual, r.evaluations, r.jacobians, r.iterations, r.factorisations, r.seconds
        )?;
    }
    Ok(())
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn summary(title: &str, costs: &Costs, runs: &[Vec<Run>]) {
    println!("\n{title}");
    println!(
        "  {:44} {:>8} {:>8} {:>10} {:>7} {:>9}",
        "method", "solved", "best", "iterations", "order", "seconds"
    );
    for (k, method) in costs.methods.iter().enumerate() {
        let own = || runs.iter().map(|row| &row[k]);
        let middle = |values: Vec<f64>| median(values).map_or_else(|| "-".to_owned(), |v| format!("{v:.1}"));
        println!(
            "  {:44} {:>6.1} % {:>6.1} % {:>10} {:>7} {:>9.3}",
            method,
            100.0 * costs.solved(k),
            100.0 * costs.best(k),
            middle(own().filter(|r| r.solved).map(|r| r.iterations as f64).collect()),
            middle(own().filter(|r| r.solved).filter_map(|r| r.order).collect()),
            own().map(|r| r.seconds).sum::<f64>()
        );
    }
    println!(
        "  (solved; needs the least work, iterations or factorisations; medians of the runs that solve; all runs)"
    );
}

fn write(folder: &Path, table: &str, costs: &Costs, contact: &Costs) -> Outcome<()> {
    let path = file_in(folder, "corrector_runs.csv")?;
    std::fs::write(&path, table)?;
    println!("\nwritten: {}", path.display());
    for (costs, title, name) in [
        (costs, "complementarity problems", "corrector_profile.svg"),
        (contact, "friction problems", "corrector_profile_friction.svg"),
    ] {
        let path = file_in(folder, name)?;
        let caption = format!("{} {title}", costs.rows.len());
        BranchDiagram::new(costs.panel(caption, "iterations", 7.0))
            .with_size(900, 520)
            .write(&path)?;
        println!("written: {}", path.display());
    }
    Ok(())
}

fn histories() -> Outcome<()> {
    let one_node = HildRenard::new(1.5, 7.0, 1.0, 1.0)?.problem()?;
    history("one contact node, F = 1", &one_node, 1.0)?;
    history("two contact nodes, F = 4", &two_nodes()?, 4.0)?;
    let block = read_folder(shipped_folder())?.problem;
    history("elastic block, 11 contact nodes, full form, γ = 0.5", &block, 0.5)?;
    let condensed = block.condensed()?;
    history(
        "elastic block, 11 contact nodes, condensed, γ = 0.5",
        &condensed,
        0.5,
    )?;
    let circuit = Traced::new(TunnelDiode);
    history(
        "tunnel diode at 0.8 V: smooth pieces that are not affine",
        &circuit,
        0.8,
    )
}

/// Solves at a fixed parameter, from zero, and prints every iteration.
fn history<P: PiecewiseSmooth>(title: &str, map: &P, parameter: f64) -> Outcome<()> {
    let mut x = vec![0.0; map.num_vars()];
    x[map.num_vars() - 1] = parameter;
    let mut newton = Newton::new(NewtonOptions::default());
    let convergence = newton.solve(map, &mut x)?;
    let report = newton.report();
    println!(
        "\n{title} ({} unknowns, {} sites)",
        map.num_residuals(),
        map.num_sites()
    );
    println!("    k    residual        step     damping  sites changed");
    for i in &report.history {
        println!(
            "  {:>3}  {:10.3e}  {:10.3e}  {:10.3e}  {:>13}",
            i.index, i.residual_norm, i.step_norm, i.damping, i.sites_changed
        );
    }
    let floor = 1e-13 * report.history.first().map_or(1.0, |i| i.residual_norm);
    match report.observed_order(floor) {
        Some(order) if !map.is_piecewise_affine() => {
            println!("  observed order {order:.2} ({convergence:?})")
        }
        _ => println!("  finite termination: the last step solves the right piece exactly ({convergence:?})"),
    }
    let mut residual = vec![0.0; map.num_residuals()];
    value(map, &x, &mut residual);
    let worst = residual.iter().fold(0.0_f64, |a, r| a.max(r.abs()));
    let first = report.history.first().map_or(1.0, |i| i.residual_norm);
    ensure(
        worst <= 1e-9 * first.max(1.0),
        "the residual at the solution vanishes",
    )
}

/// The model with two contact nodes of Haslinger, Janovský and Ligurský, λ = μ = 1.
fn two_nodes() -> Outcome<FullContact<PlanarCoulomb>> {
    let stiffness = [
        [0.5, 0.0, -0.5, -0.5],
        [0.0, 1.5, -0.5, -1.5],
        [-0.5, -0.5, 4.0, 0.0],
        [-0.5, -1.5, 0.0, 4.0],
    ];
    Ok(FullContact::planar(
        Matrix::from_rows(&stiffness)?,
        Matrix::from_rows(&[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])?,
        Matrix::from_rows(&[[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])?,
        LoadPath::constant(vec![0.4, -2.1417, 1.3717, -2.1417]),
        FrictionCoefficient::affine(vec![0.0; 2], vec![1.0; 2])?,
    )?)
}
