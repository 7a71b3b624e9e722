//! A comparison of Newton methods, as papers print them: on complementarity problems, variational inequalities, friction, equations of
//! function spaces and problems over cones; and iteration by iteration on a few. You will see what each method solves, what it costs and
//! its observed order, a table of all runs and performance profiles (Dolan and Moré 2002) of iterations and of times, with --full orders of
//! McpSolver's and ConeSolver's strategies chosen on one half of the families of problems and judged on the other, then residuals, steps
//! and changes of pieces on friction problems and a circuit.
//! Run: cargo run --release --example corrector_convergence [-- --full]

// The function spaces and the circuit come from other examples, with their common modules.
#![allow(clippy::duplicate_mod)]

#[macro_use]
mod common;
#[path = "common/classes.rs"]
mod classes;
#[path = "common/cones.rs"]
mod cones;
#[path = "common/contenders.rs"]
mod contenders;
#[path = "common/equations.rs"]
mod equations;
#[path = "common/expressions.rs"]
mod expressions;
#[path = "common/inequalities.rs"]
mod inequalities;
#[path = "common/obstacles.rs"]
mod obstacles;
#[path = "common/orders.rs"]
mod orders;
#[path = "common/profiles.rs"]
mod profiles;
#[path = "common/textbook.rs"]
mod textbook;
#[allow(dead_code)]
#[path = "your_own_problem.rs"]
mod your_own_problem;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::rc::Rc;

use clap::Parser;
use classes::{Class, Sizes, classes, complementarity, over_cones, two_nodes, variational};
use common::{Outcome, ensure, exit, file_in, shipped_folder};
use cones::OnCones;
use contenders::{Complementarity, Run, solver};
use profiles::Costs;
use semismooth::complementarity::{McpOptions, McpStrategy};
use semismooth::cones::ConeOptions;
use semismooth::contact::{HildRenard, read_folder};
use semismooth::newton::{Newton, NewtonOptions};
use semismooth::output::BranchDiagram;
use semismooth::piecewise::{PiecewiseSmooth, Traced, value};
use your_own_problem::TunnelDiode;

/// Compares Newton methods on problems from files, on grids and at random.
#[derive(Parser)]
struct Args {
    /// More and larger problems, and orders of strategies: some minutes
    #[arg(long)]
    full: bool,
    /// Folder for the table and the pictures
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

fn run(args: &Args) -> Outcome<()> {
    compare(args)?;
    histories()
}

/// The runs of all methods of a class on its problems: row by problem.
struct Group {
    class: Class,
    runs: Vec<Vec<Run>>,
}

impl Group {
    fn of(class: Class) -> Outcome<Self> {
        let methods = 0..class.methods.len();
        let row = |(_, run): &(String, _)| methods.clone().map(run).collect();
        let runs: Outcome<_> = class.problems.iter().map(row).collect();
        Ok(Self { runs: runs?, class })
    }

    fn costs(&self) -> [(Costs, &'static str); 2] {
        let (methods, time) = (&self.class.methods, |r: &Run| r.seconds);
        [
            (Costs::new(methods, &self.runs, Costs::work), "iterations"),
            (Costs::new(methods, &self.runs, time), "times"),
        ]
    }

    /// The share of the problems that a method solves.
    fn solved(&self, method: &str) -> f64 {
        let place = self.class.methods.iter().position(|m| *m == method);
        place.map_or(0.0, |k| self.costs()[0].0.solved(k))
    }

    /// The median of the observed orders of a method.
    fn order(&self, method: &str) -> Option<f64> {
        let place = self.class.methods.iter().position(|m| *m == method)?;
        let runs = self.runs.iter().map(|row| &row[place]);
        median(runs.filter(|r| r.solved).filter_map(|r| r.order).collect())
    }
}

const SMALL: Sizes = Sizes {
    files: false,
    linear: 40,
    orders: &[5, 10, 20],
    grids: &[15],
    friction: [120, 30],
    bar: 20,
    contacts: 30,
    states: &[15],
    controls: &[15, 31],
    pixels: &[16],
    pipes: &[1, 2],
    plastic: &[0],
};

const FULL: Sizes = Sizes {
    files: true,
    linear: 400,
    orders: &[5, 10, 20],
    grids: &[15, 31, 63],
    friction: [1000, 200],
    bar: 40,
    contacts: 100,
    states: &[15, 31],
    controls: &[15, 31, 63, 127],
    pixels: &[16, 32, 64],
    pipes: &[1, 2, 3, 4],
    plastic: &[0, 1],
};

/// Runs all methods on all problems; prints a line a method, writes the table and the profiles.
fn compare(args: &Args) -> Outcome<()> {
    let sizes = if args.full { &FULL } else { &SMALL };
    let (mut problems, inequalities) = (complementarity(sizes)?, variational()?);
    let mut table = String::from(
        "class,problem,method,solved,first_residual,residual,evaluations,jacobians,iterations,factorisations,linear_iterations,seconds,order\r\n",
    );
    let mut groups = Vec::new();
    for class in classes(sizes, &problems, &inequalities)? {
        let group = Group::of(class)?;
        summary(&group);
        for ((problem, _), row) in group.class.problems.iter().zip(&group.runs) {
            record(&mut table, &group.class, problem, row)?;
        }
        groups.push(group);
    }
    write(&args.out, &table, &groups)?;
    if args.full {
        problems.extend(inequalities);
        orders_of_strategies(&problems, &over_cones(sizes)?)?;
    }
    groups.iter().try_for_each(check)
}

/// Whether other orders of strategies are better than the default ones.
fn orders_of_strategies(problems: &[Rc<Complementarity>], over_cones: &[(String, OnCones)]) -> Outcome<()> {
    let mut orders = orders::candidates(&McpOptions::default().strategies);
    // Restarts are made of the others.
    orders.retain(|o| !o[..2].contains(&McpStrategy::Restart));
    let families: Vec<&str> = problems.iter().map(|p| p.family.as_str()).collect();
    orders::compare("McpSolver", &orders, &families, &|k, order| {
        problems[k].run_with(|p, x| solver(p, x, order))
    })?;
    let orders = orders::candidates(&ConeOptions::default().strategies);
    let families: Vec<&str> = over_cones.iter().map(|p| p.0.as_str()).collect();
    orders::compare("ConeSolver", &orders, &families, &|k, order| {
        over_cones[k].1.run_with(&|p, x| cones::solver(p, x, order))
    })
}

/// Statements on the pictures, which are checked.
fn check(group: &Group) -> Outcome<()> {
    let all = |method: &str| {
        ensure(
            group.solved(method) == 1.0,
            &format!("{method} solves all of {}", group.class.title),
        )
    };
    match group.class.name {
        "complementarity" | "variational" => {
            all("McpSolver, all strategies")?;
            ensure(
                group
                    .order("Fischer-Burmeister, full steps")
                    .is_some_and(|o| o > 1.6),
                "Fischer-Burmeister's method with full steps converges superlinearly, in the median",
            )
        }
        "cones" => all("ConeSolver"),
        "delassus" => all("DelassusSolver"),
        "friction" => ensure(
            group.solved("Newton, line search on trouble") >= 0.95,
            "Newton's method solves 95 % of the friction problems",
        ),
        _ => all("Newton, full steps"),
    }
}

fn record(table: &mut String, class: &Class, problem: &str, row: &[Run]) -> Outcome<()> {
    for (method, r) in class.methods.iter().zip(row) {
        let order = r.order.map_or_else(String::new, |o| format!("{o:.3}"));
        write!(
            table,
            "{},\"{problem}\",\"{method}\",{},{:e},{:e},{},{},{},{},{},{:.3e},{order}\r\n",
            class.name,
            r.solved,
            r.first,
            r.residual,
            r.evaluations,
            r.jacobians,
            r.iterations,
            r.factorisations,
            r.linear_iterations,
            r.seconds
        )?;
    }
    Ok(())
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

fn summary(group: &Group) {
    let [(costs, _), _] = group.costs();
    let runs = &group.runs;
    println!("\n{} {}", runs.len(), group.class.title);
    println!(
        "  {:44} {:>8} {:>8} {:>10} {:>7} {:>9}",
        "method", "solved", "best", "iterations", "order", "seconds"
    );
    for (k, method) in costs.methods.iter().enumerate() {
        let own = || runs.iter().map(|row| &row[k]);
        let middle = |values: Vec<f64>| median(values).map_or_else(|| "-".to_owned(), |v| format!("{v:.1}"));
        println!(
            "  {:44} {:>6.1} % {:>6.1} % {:>10} {:>7} {:>9.3}{}",
            method,
            100.0 * costs.solved(k),
            100.0 * costs.best(k),
            middle(own().filter(|r| r.solved).map(|r| r.iterations as f64).collect()),
            middle(own().filter(|r| r.solved).filter_map(|r| r.order).collect()),
            own().map(|r| r.seconds).sum::<f64>(),
            if *method == group.class.usual { " *" } else { "" }
        );
    }
    println!(
        "  (solved; needs the least work, iterations or factorisations; medians of the runs that solve; all runs; *: unless told otherwise)"
    );
}

fn write(folder: &Path, table: &str, groups: &[Group]) -> Outcome<()> {
    let path = file_in(folder, "corrector_runs.csv")?;
    std::fs::write(&path, table)?;
    println!("\nwritten: {}", path.display());
    for group in groups {
        for (costs, cost) in group.costs() {
            let mut name = String::from("corrector_profile");
            for (part, usual) in [(group.class.name, "complementarity"), (cost, "iterations")] {
                if part != usual {
                    write!(name, "_{part}")?;
                }
            }
            let path = file_in(folder, &format!("{name}.svg"))?;
            let caption = format!(
                "{} {}",
                costs.rows.len(),
                group.class.title.replace(" with their starts", "")
            );
            BranchDiagram::new(costs.panel(caption, cost, 7.0))
                .with_size(900, 520)
                .write(&path)?;
            println!("written: {}", path.display());
        }
    }
    Ok(())
}

fn histories() -> Outcome<()> {
    let one_node = HildRenard::new(1.5, 7.0, 1.0, 1.0)?.problem()?;
    history("one contact node, F = 1", &one_node, 1.0)?;
    history("two contact nodes, F = 4", &two_nodes()?, 4.0)?;
    let block = read_folder(shipped_folder())?;
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
            println!("  observed order {order:.2} ({convergence})")
        }
        _ => println!("  finite termination: the last step solves the right piece exactly ({convergence})"),
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
