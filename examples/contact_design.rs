//! Friction of a ground from displacements of the surface above it, and a shape that evens out contact stresses under Coulomb friction.
//! You see the coefficients found from displacements with errors beside the true ones, and the decrease of the unevenness on three meshes.
//! Run: cargo run --release --example contact_design
//!
//! Both are minimised by a bundle method, with gradients by one adjoint solve for each contact problem; the second is in the manner of
//! P. Beremlijski, J. Haslinger, M. Kočvara and J. V. Outrata, SIAM J. Optim. 13 (2002).

#[macro_use]
mod common;
#[path = "common/design.rs"]
mod design;

use std::process::ExitCode;

use clap::Parser;
use common::Outcome;
use design::{Identification, LEVELS, Shape};
use semismooth::Cause;

/// Friction from displacements, and a shape that evens out contact stresses.
#[derive(Parser)]
struct Arguments {}

fn main() -> ExitCode {
    common::exit(run(&common::parse::<Arguments>()))
}

fn run(_: &Arguments) -> Outcome<()> {
    tables().map_err(|cause| cause.to_string().into())
}

fn tables() -> Result<(), Cause> {
    let truth = [0.2, 0.45, 0.3];
    let mut problem = Identification::new([12, 6], 3)?;
    println!("errors of displacements  coefficients found         iterations, at the loads {LEVELS:?}");
    for errors in [0.0, 1e-4, 1e-3] {
        problem.data = problem
            .response(&truth)?
            .into_iter()
            .map(|(_, _, seen)| seen)
            .collect();
        let largest = problem.data.iter().flatten().fold(0.0_f64, |m, u| m.max(u.abs()));
        // Errors of either sign, in no particular order.
        for (i, u) in problem.data.iter_mut().flatten().enumerate() {
            *u += errors * largest * (1.7 * (i * i) as f64).sin();
        }
        let (found, report) = problem.identify(&[0.5; 3])?;
        println!(
            "{errors:23}  {:.4}, {:.4}, {:.4}  {:10}",
            found[0], found[1], found[2], report.iterations
        );
        if !report.is_solved() || report.value > problem.misfit(&truth, &mut [0.0; 3])? * (1.0 + 1e-9) + 1e-12
        {
            return Err(wrong(format!("the coefficients do not fit: {report}")));
        }
    }
    println!("cells    unevenness: flat, best, ratio  heights");
    for cells in [[8, 4], [16, 8], [32, 16]] {
        let (first, heights, report) = Shape::new(cells, 5)?.equalise(5, 0.1)?;
        let ratio = report.value / first;
        println!(
            "{:3} × {:2}  {first:.6}, {:.6}, {ratio:.3}  {heights:.4?}",
            cells[0], cells[1], report.value
        );
        if !report.is_solved() || (ratio - 0.69).abs() > 0.01 {
            return Err(wrong(format!("the decrease depends on the mesh: {report}")));
        }
    }
    Ok(())
}

fn wrong(what: String) -> Cause {
    Cause::from(std::io::Error::other(what))
}
