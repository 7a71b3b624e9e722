//! Newton's method for piecewise-smooth equations on friction problems (1 to 11 contact nodes, full and condensed) and on a circuit.
//! You will see residuals, steps, how many sites change their piece in each iteration, and the observed order of convergence.
//! Run: cargo run --release --example corrector_convergence

// The circuit comes from another example, with what examples share.
#![allow(clippy::duplicate_mod)]

#[macro_use]
mod common;
#[allow(dead_code)]
#[path = "your_own_problem.rs"]
mod your_own_problem;

use std::process::ExitCode;

use clap::Parser;
use common::{Outcome, ensure, exit, shipped_folder};
use semismooth::contact::{
    FrictionCoefficient, FullContact, HildRenard, LoadPath, PlanarCoulomb, read_folder,
};
use semismooth::newton::{Newton, NewtonOptions};
use semismooth::piecewise::{PiecewiseSmooth, Traced, value};
use semismooth::sparse::Matrix;
use your_own_problem::TunnelDiode;

/// Prints the history of the corrector on contact problems and on a circuit, each from zero at a fixed parameter.
#[derive(Parser)]
struct Args {}

fn main() -> ExitCode {
    Args::parse();
    exit(run())
}

fn run() -> Outcome<()> {
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
