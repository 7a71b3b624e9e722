//! How the constants that guarantee a unique solution of the friction problem depend on the mesh (Haslinger, Kučera, Vlach 2008).
//! You will see the two parts of the Lipschitz constant of the fixed-point map grow as the mesh is refined (in the plane and in space), the
//! guaranteed and the first critical coefficient of friction, the inf-sup constants of three spaces of multipliers, C = max{C1, C2} and the
//! critical slope of a law that weakens with the slip, the observed contraction rates with their bounds, and a picture of the growth.
//! Run: cargo run --release --example uniqueness [-- --finest 32] [--cube 8] [--out DIR]

#[macro_use]
mod common;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use common::bars::bar2d;
use common::squares::{Multipliers, cube, inf_sup, plane, plane_mesh, traces};
use common::{Outcome, ensure, exit, file_in};
use semismooth::contact::{
    FixedPointOptions, FrictionCoefficient, FrictionCurve, Frictionless, PlanarCoulomb, UniquenessConstants,
    critical_friction, fixed_point, friction_bounds, pressure_norm,
};
use semismooth::output::{BranchDiagram, Colour, Curve, Marker, Panel, SegmentStyle};

/// Prints constants of uniqueness under refinement.
#[derive(Parser)]
struct Args {
    /// Cells a unit length, finest: a power of two (4 to 64).
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
    exit(run(&common::parse::<Args>()))
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
        let critical = critical_friction(&problem)?;
        ensure(
            critical.is_none_or(|f| f > c.guaranteed_friction()),
            "solutions are unique up to the coefficient that is guaranteed",
        )?;
        let critical = critical.map_or("none".into(), |f| format!("{f:.4}"));
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
        let kinds = [
            Multipliers::Nodal,
            Multipliers::Constant(1),
            Multipliers::Constant(2),
        ];
        let [nodal, faces, merged] = [
            inf_sup(n, kinds[0], &reference)?,
            inf_sup(n, kinds[1], &reference)?,
            inf_sup(n, kinds[2], &reference)?,
        ];
        println!("  {n:>4} {nodal:>7.3} {faces:>11.3} {merged:>12.3}");
        ensure(
            [nodal, faces, merged].iter().all(|b| (0.0..=1.0).contains(b)),
            "inf-sup constants in the norm of the dual lie between 0 and 1",
        )?;
        ensure(
            nodal > 0.75 && merged > 0.75,
            "β of nodal multipliers, and of those on pairs of faces, does not fall with the mesh",
        )?;
    }
    weakening()?;
    contraction(args.finest)?;
    draw(&growth, &solid, args)
}

fn order(last: Option<f64>, now: f64) -> String {
    last.map_or("      ".into(), |l| format!("{:>6.2}", (now / l).log2()))
}

/// C = max{C1, C2} of the bar whose friction weakens with the slip, at ζ = 1.4 and in the ball of its sticking solution, and the slope
/// and coefficient below which the parts are less than 1.
fn weakening() -> Outcome<()> {
    let zeta = 1.4;
    println!(
        "\nbar with weakening friction (example nonuniqueness) at ζ = {zeta}: Lipschitz constant of Ψ in the ball of one solution"
    );
    println!(
        "   mesh    ‖g‖      C1   C2 (φ → λν)   C2 (with φ → φ′)       C   F_crit     L_crit   L of the law"
    );
    for nx in [20, 40] {
        let bar = bar2d(nx)?;
        let constants = UniquenessConstants::new(&bar.problem, &bar.rows.areas)?;
        let x = bar.problem.solve(zeta, Some(&bar.problem.stick_start(zeta)?))?;
        let pressure = pressure_norm(&bar.rows.areas, &x[..bar.rows.areas.len()])?;
        let (kappa, slope) = friction_bounds(&bar.problem, zeta, 0.05, 10_001)?;
        let largest = zeta * common::bars::weakening().value(0.0).0;
        let bound = constants.lipschitz(largest, slope, kappa, pressure);
        let slip_free = slope * kappa * pressure * constants.c2();
        if !(bound.c2 > slip_free && bound.c() == bound.c1.max(bound.c2)) {
            return Err(format!("the parts of C do not fit: {bound:?}").into());
        }
        println!(
            "  {nx:>2} × {:<2} {pressure:>6.4} {:>7.2} {slip_free:>13.1} {:>18.1} {:>7.1} {:>8.4} {:>10.4} {slope:>14.2}",
            nx / 10,
            bound.c1,
            bound.c2,
            bound.c(),
            1.0 / (constants.c_t * (constants.c_inv + constants.c_t)),
            constants.critical_slope(kappa, pressure),
        );
    }
    Ok(())
}

/// Observed rates of the fixed-point iteration with their bounds F C1.
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
            ensure(
                report.contraction().is_none_or(|rate| rate <= bound),
                "no rate is above its bound F C1",
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
            let vertices: Vec<_> = points.iter().map(|p| (p.0, pick(p))).collect();
            Curve::line(vertices.clone(), SegmentStyle::new(name, colour)).with_marks(Marker::Value, vertices)
        };
        Panel::new("1/h", label)
            .with_log_x()
            .with_log_y()
            .with_curve(curve(flat, "plane", Colour::BLUE))
            .with_curve(curve(solid, "cube", Colour::ORANGE))
    };
    let picture = file_in(&args.out, "uniqueness.svg")?;
    BranchDiagram::new(panel("C_1/F", &|p| p.1))
        .with_panel(panel("C_2/(L‖g‖)", &|p| p.2))
        .with_title("Growth of the constants under refinement")
        .with_size(860, 420)
        .write(&picture)?;
    println!("\nwritten: {}", picture.display());
    Ok(())
}
