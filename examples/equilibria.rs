//! A market with several equilibria as a mixed complementarity problem with a parameter.
//! You will see how the single equilibrium of an exchange economy splits into three as endowments shrink, where consumers stop buying
//! a good, prices and determinants at one parameter, and a bifurcation diagram.
//! Run: cargo run --release --example equilibria [-- --out DIR] [--at R]
//!
//! Shapley and Shubik's economy (1977; Mas-Colell, Whinston and Green 1995, example 15.B.2): two goods, two consumers with the utilities
//! x₁₁ − x₂₁⁻⁸/8 and x₂₂ − x₁₂⁻⁸/8, endowments (2, r) and (r, 2). With the first price 1 and the second p, consumption and λ of each
//! consumer, and p, are the unknowns; consumption is nonnegative.

#[macro_use]
mod common;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use common::{Outcome, count, ensure, exit, file_in};
use semismooth::complementarity::{Autodiff, Mcp, McpSolver, SmoothFunction};
use semismooth::continuation::{ContinuationOptions, Diagram, DiagramOptions, VertexKind};
use semismooth::output::{BranchDiagram, Colour, Panel, SegmentStyle};
use semismooth::piecewise::{PiecewiseSmoothExt, Real, Selection};

/// x = (x₁₁, x₂₁, λ₁, x₁₂, x₂₂, λ₂, p, r).
struct Economy;

impl SmoothFunction for Economy {
    fn num_vars(&self) -> usize {
        8
    }

    fn num_values(&self) -> usize {
        7
    }

    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        let [a1, a2, la, b1, b2, lb, p, r] = [x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]];
        // First consumer: marginal cost less marginal utility of each good, and the budget.
        out[0] = la - 1.0;
        out[1] = la * p - a2.powi(-9);
        out[2] = p * r + 2.0 - a1 - p * a2;
        // Second consumer.
        out[3] = lb - b1.powi(-9);
        out[4] = lb * p - 1.0;
        out[5] = r + p * 2.0 - b1 - p * b2;
        // Excess supply of the second good.
        out[6] = r + 2.0 - a2 - b2;
    }
}

/// Follows all equilibria of a market over a parameter.
#[derive(Parser)]
struct Arguments {
    /// Folder for the picture
    #[arg(long, default_value = "out")]
    out: PathBuf,
    /// Endowment r at which equilibria are listed, in (0.25, 1.5)
    #[arg(long, default_value_t = 0.6)]
    at: f64,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let (free, none) = (f64::NEG_INFINITY, f64::INFINITY);
    let market = Mcp::new(
        Autodiff::new(Economy),
        vec![0.0, 0.0, free, 0.0, 0.0, free, 0.0],
        vec![none; 7],
    )?;

    // One equilibrium, from prices and quantities of 1.
    let r = 1.5;
    let mut x = [1.0; 7];
    let mut solver = McpSolver::default();
    let report = solver.solve(&market.at(r)?, &mut x)?;
    println!(
        "r = {r}: {}, residual {:.1e}, price {:.6}",
        report.status, report.residual, x[6]
    );
    if !report.is_solved() {
        return Err("there is no equilibrium to start from".into());
    }

    // All equilibria connected to it.
    let mut start = x.to_vec();
    start.push(r);
    // Prices go up to thousands, λ up to 0.25⁻⁹.
    let steps = ContinuationOptions::default().with_max_step(1e3);
    let options = DiagramOptions::default()
        .with_continuation(steps)
        .with_parameter_range((0.25, 1.5));
    let diagram = Diagram::explore(&market, &[start], &options)?;
    let names = ["x11", "x21", "λ1", "x12", "x22", "λ2", "p"];
    for vertex in diagram.vertices() {
        if !matches!(vertex.kind, VertexKind::Bound | VertexKind::Start) {
            let at_bound: Vec<&str> = (0..7)
                .filter(|&i| vertex.x[i].abs() < 1e-9)
                .map(|i| names[i])
                .collect();
            println!(
                "r = {:.6}, p = {:.6}: {}{}",
                vertex.x[7],
                vertex.x[6],
                vertex.kind,
                if at_bound.is_empty() {
                    String::new()
                } else {
                    format!(", {} reaches 0", at_bound.join(" and "))
                }
            );
        }
    }
    let complete = !diagram.completeness().is_limited();
    println!(
        "{}, {}",
        count(diagram.edges().len(), "piece of curve", "pieces of curve"),
        if complete { "complete" } else { "incomplete" }
    );
    ensure(
        complete,
        "all equilibria connected to the first one were followed",
    )?;
    let equilibria = diagram.solutions_at(&market, arguments.at)?;
    let found = count(equilibria.points.len(), "equilibrium", "equilibria");
    println!("r = {}: {found}", arguments.at);
    for s in &equilibria.points {
        println!("  p = {:.9}, sign det {:+}", s.x[6], s.det_sign.unwrap_or(0));
    }
    if let Some(sum) = equilibria.index_sum() {
        println!("  index sum {sum:+}");
        ensure(sum == 1, "the indices of a market's equilibria sum up to +1")?;
    }

    let at_bound = |s: &Selection| {
        (s.pieces().enumerate()).any(|(site, piece)| market.piece_name(site, piece) == "lower")
    };
    let style = |selection: &Selection, _: &[usize]| match at_bound(selection) {
        true => SegmentStyle::new("a consumer does without a good", Colour::ORANGE),
        false => SegmentStyle::new("both consume both goods", Colour::BLUE),
    };
    let panel = Panel::new("endowment r", "price p")
        .with_diagram(&diagram, |x: &[f64]| x[6], style)
        .with_log_y();
    let picture = file_in(&arguments.out, "equilibria.svg")?;
    BranchDiagram::new(panel)
        .with_title("Equilibria of a market with two consumers")
        .write(&picture)?;
    println!("written: {}", picture.display());
    Ok(())
}
