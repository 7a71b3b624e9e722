//! How the constants that guarantee a unique solution of the friction problem depend on the mesh (Haslinger, Kučera, Vlach 2008).
//! You will see the two parts of the Lipschitz constant of the fixed-point map grow as the mesh is refined (in the plane and in space),
//! the guaranteed and the first critical coefficient of friction, the inf-sup constants of three spaces of multipliers, the contraction
//! rates observed beside their bounds, and a picture of the growth.
//! Run: cargo run --release --example uniqueness [-- --finest 32] [--cube 8] [--out DIR]

mod common;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use common::squares::{Multipliers, cube, inf_sup, plane, plane_mesh, traces};
use common::{Outcome, exit, file_in};
use semismooth::contact::{
    FixedPointOptions, FrictionCoefficient, FrictionCurve, Frictionless, PlanarCoulomb, UniquenessConstants,
    critical_friction, fixed_point,
};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};

/// Prints constants of uniqueness under refinement.
#[derive(Parser)]
struct Args {
    /// Finest plane mesh, cells a unit length: a power of two, at least 4, at most 64.
    #[arg(long, default_value_t = 32)]
    finest: usize,
    /// Finest mesh of the cube, cells an edge, at most 16.
    #[arg(long, default_value_t = 8)]
    cube: usize,
    /// Folder for the picture.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&Args::parse()))
}

fn run(args: &Args) -> Outcome<()> {
    if !args.finest.is_power_of_two() || !(4..=64).contains(&args.finest) {
        return Err(format!("--finest is {}; it must be 4, 8, 16, 32 or 64", args.finest).into());
    }
    if !(2..=16).contains(&args.cube) {
        return Err(format!("--cube is {}; it must lie between 2 and 16", args.cube).into());
    }
    println!("(0, 2) × (0, 1), plane strain, E = 1, ν = 0.277, clamped at x = 0, nodal multipliers");
    println!("   1/h   C1/F   order   C2/(L‖g‖)   F guaranteed   F critical (all slip)");
    let mut growth = Vec::new();
    let mut last: Option<f64> = None;
    for n in (2..).map(|k| 1usize << k).take_while(|n| *n <= args.finest) {
        let (problem, rows) = plane(n, Frictionless::plane())?;
        let c = UniquenessConstants::new(&problem, &rows.areas)?;
        let critical = critical_friction(&problem)?.map_or("none".into(), |f| format!("{f:.4}"));
        println!(
            "  {n:>4} {:>7.3} {} {:>10.3} {:>14.5}   {critical}",
            c.c1(),
            order(last, c.c1()),
            c.c2(),
            c.guaranteed_friction()
        );
        last = Some(c.c1());
        growth.push((n as f64, c.c1(), c.c2()));
    }
    println!("\nunit cube, contact on z = 0");
    println!("   1/h   C1/F   C2/(L‖g‖)   F guaranteed");
    let mut solid = Vec::new();
    for n in [2, 4, 8, 12, 16].into_iter().filter(|n| *n <= args.cube) {
        let (problem, rows) = cube(n, Frictionless::space())?;
        let c = UniquenessConstants::new(&problem, &rows.areas)?;
        println!(
            "  {n:>4} {:>7.3} {:>10.2} {:>14.5}",
            c.c1(),
            c.c2(),
            c.guaranteed_friction()
        );
        solid.push((n as f64, c.c1(), c.c2()));
    }
    println!("\ninf-sup constants β against the traces of 256 × 128 cells, metric of H¹");
    let fine = plane_mesh(128)?;
    let reference = traces(&fine)?;
    println!("   1/h   nodal   P0, H = h   P0, H = 2h");
    for n in (2..)
        .map(|k| 1usize << k)
        .take_while(|n| *n <= args.finest.min(32))
    {
        println!(
            "  {n:>4} {:>7.3} {:>11.3} {:>12.3}",
            inf_sup(n, Multipliers::Nodal, &reference)?,
            inf_sup(n, Multipliers::Constant(1), &reference)?,
            inf_sup(n, Multipliers::Constant(2), &reference)?
        );
    }
    contraction(args.finest)?;
    draw(&growth, &solid, args)
}

fn order(last: Option<f64>, now: f64) -> String {
    last.map_or("      ".into(), |l| format!("{:>6.2}", (now / l).log2()))
}

/// Observed rates of the fixed-point iteration beside F C1.
fn contraction(finest: usize) -> Outcome<()> {
    println!(
        "\nfixed-point iteration under the load (0, −1) on top and (0.4, 0) on the right: observed rate, and its bound F C1"
    );
    println!("     F   {:>18} {:>18}", "1/h = 4", format!("1/h = {finest}"));
    for f in [0.05, 0.1, 0.2, 0.4] {
        let mut line = format!("  {f:>4}   ");
        for n in [4, finest] {
            let law = PlanarCoulomb::new(FrictionCoefficient::uniform(FrictionCurve::constant(f)?));
            let (problem, rows) = plane(n, law)?;
            let bound = f * UniquenessConstants::new(&problem, &rows.areas)?.c1();
            let start = problem.stick_start(0.0)?;
            let report = fixed_point(
                &problem,
                &start,
                &FixedPointOptions::default().with_max_iterations(500),
            )?;
            let rate = report.contraction().map_or("-".into(), |r| format!("{r:.3}"));
            line += &format!(" {:>18}", format!("{rate} ≤ {bound:.3}"));
        }
        println!("{line}");
    }
    Ok(())
}

type Growth = [(f64, f64, f64)];

fn draw(flat: &Growth, solid: &Growth, args: &Args) -> Outcome<()> {
    let panel = |label: &str, pick: &dyn Fn(&(f64, f64, f64)) -> f64| {
        let curve = |points: &Growth, name: &'static str, colour| {
            let vertices = points.iter().map(|p| (p.0.log2(), pick(p).log2())).collect();
            Curve::line(vertices, SegmentStyle::new(name, colour))
        };
        Panel::new("log2 1/h", label)
            .with_curve(curve(flat, "plane", Colour::BLUE))
            .with_curve(curve(solid, "cube", Colour::ORANGE))
    };
    let picture = file_in(&args.out, "uniqueness.svg")?;
    BranchDiagram::new(panel("log2 C1/F", &|p| p.1))
        .with_panel(panel("log2 C2/(L‖g‖)", &|p| p.2))
        .with_title("Growth of the constants under refinement")
        .with_size(860, 420)
        .write(&picture)?;
    println!("\nwritten: {}", picture.display());
    Ok(())
}
