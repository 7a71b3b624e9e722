//! Newton methods for complementarity and friction problems side by side, as papers print them, and iteration by iteration on a few.
//! You will see what each method solves, what it costs and its observed order, a table of all runs and performance profiles (Dolan and
//! Moré 2002) of iterations and of times, with --full orders of McpSolver's strategies chosen on one half of the problems and judged on the
//! other, then residuals, steps and changes of pieces on friction problems and a circuit.
//! Run: cargo run --release --example corrector_convergence [-- --full]

// The circuit comes from another example, with what examples share.
#![allow(clippy::duplicate_mod)]

#[macro_use]
mod common;
#[path = "common/contenders.rs"]
mod contenders;
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
#[allow(dead_code)]
#[path = "state_constraints.rs"]
mod state_constraints;
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
    CONES, Complementarity, DAMPINGS, Friction, FunctionOf, METHODS, Run, random_friction, random_lcp,
};
use inequalities::{read_cone, read_vi};
use profiles::Costs;
use semismooth::complementarity::McpFunction;
use semismooth::contact::{
    FrictionCoefficient, FullContact, HildRenard, LoadPath, PlanarCoulomb, read_folder,
};
use semismooth::newton::{Newton, NewtonOptions};
use semismooth::output::BranchDiagram;
use semismooth::piecewise::{PiecewiseSmooth, Traced, value};
use semismooth::sparse::Matrix;
use state_constraints::Yosida;
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
    /// Points a side of problems with state constraints.
    spaces: &'static [usize],
    /// Random friction problems.
    friction: usize,
}

const SMALL: Sizes = Sizes {
    files: false,
    linear: 40,
    orders: &[5, 10, 20],
    grids: &[15, 31],
    spaces: &[15],
    friction: 120,
};

const FULL: Sizes = Sizes {
    files: true,
    linear: 400,
    orders: &[5, 10, 20],
    grids: &[15, 31, 63],
    spaces: &[15, 31, 63],
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

/// Equations of function spaces, on grids: the Moreau–Yosida regularisation of a state constraint, from 0, at log₁₀ γ = 0 … 8.
fn function_spaces(sizes: &Sizes) -> Outcome<Vec<Friction>> {
    let mut list = Vec::new();
    for &m in sizes.spaces {
        for s in [0.0, 2.0, 4.0, 6.0, 8.0] {
            let map = Box::new(Yosida::new(m)?);
            let mut start = vec![0.0; m * m + 1];
            start[m * m] = s;
            let name = format!("state constraint {m} x {m}, gamma = 1e{s}");
            list.push(Friction { name, map, start });
        }
    }
    Ok(list)
}

/// Variational inequalities over polyhedra by their multiplier conditions, from the starts of their files with multipliers 0.
fn variational() -> Outcome<Vec<Complementarity>> {
    let mut list = Vec::new();
    for file in files_or_shipped(&[], "vi")? {
        let (problem, vi) = read_vi(&file)?;
        if !problem.solvable {
            continue;
        }
        // Its conditions borrow it, and are kept to the end.
        let vi: &'static _ = Box::leak(Box::new(vi));
        let (first, name) = (vi.kkt()?, problem.name);
        let (lower, upper) = (first.lower().to_vec(), first.upper().to_vec());
        let function: Rc<dyn McpFunction> = Rc::new(FunctionOf(first));
        for (label, mut start) in problem.starts {
            start.resize(lower.len(), 0.0);
            list.push(Complementarity {
                name: format!("{name} {label}"),
                function: function.clone(),
                lower: lower.clone(),
                upper: upper.clone(),
                start,
            });
        }
    }
    Ok(list)
}

/// The runs of some methods on problems of one class.
struct Group {
    class: &'static str,
    title: String,
    methods: Vec<&'static str>,
    problems: Vec<String>,
    runs: Vec<Vec<Run>>,
}

impl Group {
    fn new(class: &'static str, title: &str, methods: Vec<&'static str>) -> Self {
        Self {
            class,
            title: title.to_owned(),
            methods,
            problems: Vec::new(),
            runs: Vec::new(),
        }
    }

    fn add(&mut self, problem: &str, row: Vec<Run>) {
        self.problems.push(problem.to_owned());
        self.runs.push(row);
    }

    fn of_complementarity(class: &'static str, title: &str, problems: &[Complementarity]) -> Outcome<Self> {
        let mut group = Self::new(class, title, METHODS.iter().map(|m| m.name).collect());
        for problem in problems {
            let row: Outcome<Vec<Run>> = METHODS.iter().map(|m| problem.run(m)).collect();
            group.add(&problem.name, row?);
        }
        Ok(group)
    }

    fn of_equations(class: &'static str, title: &str, equations: &[Friction]) -> Outcome<Self> {
        let mut group = Self::new(class, title, DAMPINGS.iter().map(|d| d.0).collect());
        for equation in equations {
            let row: Outcome<Vec<Run>> = DAMPINGS.iter().map(|d| equation.run(d.1)).collect();
            group.add(&equation.name, row?);
        }
        Ok(group)
    }

    /// Problems over second-order cones from files, with their starts.
    fn of_cones() -> Outcome<Self> {
        let methods = CONES.iter().map(|m| m.0).collect();
        let mut group = Self::new("cones", "problems over second-order cones", methods);
        for file in files_or_shipped(&[], "cones")? {
            let (problem, cones) = read_cone(&file)?;
            for (label, start) in problem.starts.iter().filter(|_| problem.solvable) {
                let row: Outcome<Vec<Run>> = CONES.iter().map(|m| (m.1)(&cones, start)).collect();
                group.add(&format!("{} {label}", problem.name), row?);
            }
        }
        Ok(group)
    }

    fn index(&self, method: &str) -> Option<usize> {
        self.methods.iter().position(|m| *m == method)
    }

    fn costs(&self) -> [(Costs, &'static str); 2] {
        let (work, time) = (Costs::work, |r: &Run| r.seconds);
        [
            (Costs::new(&self.methods, &self.runs, work), "iterations"),
            (Costs::new(&self.methods, &self.runs, time), "times"),
        ]
    }
}

/// Runs all methods on all problems; prints a line a method, writes the table and the profiles.
fn compare(args: &Args) -> Outcome<()> {
    let sizes = if args.full { &FULL } else { &SMALL };
    let problems = complementarity(sizes)?;
    let groups = [
        Group::of_complementarity(
            "complementarity",
            "complementarity problems with their starts",
            &problems,
        )?,
        Group::of_complementarity(
            "variational",
            "starts of variational inequalities",
            &variational()?,
        )?,
        Group::of_equations("friction", "friction problems", &friction(sizes)?)?,
        Group::of_equations("spaces", "problems on grids", &function_spaces(sizes)?)?,
        Group::of_cones()?,
    ];
    let mut table = String::from(
        "class,problem,method,solved,residual,evaluations,jacobians,iterations,factorisations,seconds,order\r\n",
    );
    for group in &groups {
        summary(group);
        for (problem, row) in group.problems.iter().zip(&group.runs) {
            record(&mut table, group.class, problem, &group.methods, row)?;
        }
    }
    write(&args.out, &table, &groups)?;
    if args.full {
        orders::compare(&problems)?;
    }
    // What the picture says, in sentences that can be false.
    let costs = &groups[0].costs()[0].0;
    let share = |name: &str| groups[0].index(name).map_or(0.0, |k| costs.solved(k));
    let all = share("McpSolver, all strategies");
    ensure(all >= 0.99, "McpSolver solves at least 99 % of the problems")?;
    ensure(
        METHODS.iter().all(|m| share(m.name) <= all),
        "no single method solves more problems than McpSolver with all its strategies",
    )?;
    let exact = groups[0].index("Fischer-Burmeister, full steps");
    let runs = groups[0].runs.iter().filter_map(|row| exact.map(|k| &row[k]));
    let order = median(runs.filter(|r| r.solved).filter_map(|r| r.order).collect());
    ensure(
        order.is_some_and(|o| o > 1.6),
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

fn summary(group: &Group) {
    let [(costs, _), _] = group.costs();
    let runs = &group.runs;
    println!("\n{} {}", runs.len(), group.title);
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

fn write(folder: &Path, table: &str, groups: &[Group]) -> Outcome<()> {
    let path = file_in(folder, "corrector_runs.csv")?;
    std::fs::write(&path, table)?;
    println!("\nwritten: {}", path.display());
    for group in groups.iter().filter(|g| g.methods.len() > 1) {
        for (costs, cost) in group.costs() {
            let mut name = String::from("corrector_profile");
            for (part, usual) in [(group.class, "complementarity"), (cost, "iterations")] {
                if part != usual {
                    write!(name, "_{part}")?;
                }
            }
            let path = file_in(folder, &format!("{name}.svg"))?;
            let caption = format!(
                "{} {}",
                costs.rows.len(),
                group.title.replace(" with their starts", "")
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
