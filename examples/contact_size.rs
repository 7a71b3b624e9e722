//! How large a contact problem may be: an elastic block on the ground, meshed ever finer, condensed onto its contact nodes and solved.
//! You will see displacements, contact nodes, the time of each phase (mesh, assembly, factorisation with condensation, first solve, a
//! further solve at another load), Newton's work done in them, and the peak memory, row by row as the mesh is refined.
//! Run: cargo run --release --example contact_size [-- --plane 999x500] [--solid 40x38x20]

#[macro_use]
mod common;

use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, exit};
use semismooth::contact::{
    CondensedContact, ContactBody, ContactState, FrictionCoefficient, FrictionCurve, LoadPath, NodeLaw,
    OrthotropicCoulomb, PlanarCoulomb,
};
use semismooth::fem::{ElasticSystem, Elasticity, Foundation, Material, Mesh};

/// Times the phases of contact problems on finer and finer meshes.
#[derive(Parser)]
struct Args {
    /// Cells of a plane block, as NXxNY; may be given several times. Default: 16x8, 32x16, 64x32.
    #[arg(long)]
    plane: Vec<String>,
    /// Cells of a solid block, as NXxNYxNZ; may be given several times. Default: 6x6x3, 10x10x5.
    #[arg(long)]
    solid: Vec<String>,
}

fn main() -> ExitCode {
    exit(run(&Args::parse()))
}

fn run(args: &Args) -> Outcome<()> {
    let (mut plane, mut solid) = (args.plane.clone(), args.solid.clone());
    if plane.is_empty() && solid.is_empty() {
        plane = ["16x8", "32x16", "64x32"].map(String::from).to_vec();
        solid = ["6x6x3", "10x10x5"].map(String::from).to_vec();
    }
    println!(
        "             cells       free  contacts    mesh  assembly  condense   solve  further  open stick slip   peak memory"
    );
    for cells in &plane {
        let n = parse::<2>(cells)?;
        let law = PlanarCoulomb::new(FrictionCoefficient::uniform(FrictionCurve::constant(0.3)?));
        let begun = Instant::now();
        let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], n)?;
        measure(cells, mesh, begun, law)?;
    }
    for cells in &solid {
        let n = parse::<3>(cells)?;
        let law = OrthotropicCoulomb::isotropic(FrictionCoefficient::uniform(FrictionCurve::constant(0.3)?));
        let begun = Instant::now();
        let mesh = Mesh::block([0.0; 3], [2.0, 2.0, 1.0], n)?;
        measure(cells, mesh, begun, law)?;
    }
    Ok(())
}

fn parse<const N: usize>(text: &str) -> Outcome<[usize; N]> {
    let numbers: Result<Vec<usize>, _> = text.split('x').map(str::parse).collect();
    numbers
        .ok()
        .and_then(|v| <[usize; N]>::try_from(v).ok())
        .filter(|v| v.iter().all(|n| *n > 0))
        .ok_or_else(|| {
            format!("\"{text}\" is not a number of cells; {N} positive numbers joined by x are wanted").into()
        })
}

fn measure<L: NodeLaw>(cells: &str, mesh: Mesh, mut begun: Instant, law: L) -> Outcome<()> {
    let mut lap = || {
        let seconds = begun.elapsed().as_secs_f64();
        begun = Instant::now();
        seconds
    };
    let dim = mesh.dim();
    let meshed = lap();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.277)?)
        .fix("left")
        .assemble()?;
    let load = loads(&system)?;
    let mut up = [0.0; 3];
    up[dim - 1] = 1.0;
    let rows = system.contact("bottom", &Foundation::plane([0.0; 3], up))?;
    let mut tangential = vec![rows.tangential];
    tangential.extend(rows.tangential2);
    let free = system.num_free();
    let body =
        ContactBody::new(system.stiffness().clone(), rows.normal, tangential, load)?.with_gap(rows.gap)?;
    drop(system);
    let assembled = lap();
    let problem = CondensedContact::new(body, law)?;
    let condensed = lap();
    let x = problem.solve(1.0, None)?;
    let solved = lap();
    let y = problem.solve(1.05, Some(&x))?;
    let further = lap();
    let states = problem.solution(&y)?.states;
    let count = |wanted: &[ContactState]| states.iter().filter(|s| wanted.contains(s)).count();
    println!(
        "{cells:>18} {free:>10} {:>9} {meshed:>7.2} {assembled:>9.2} {condensed:>9.2} {solved:>7.2} {further:>8.2}  {:>4} {:>5} {:>4}  {:>12}",
        problem.num_contacts(),
        count(&[ContactState::Open]),
        count(&[ContactState::Stick]),
        count(&[ContactState::SlipPlus, ContactState::SlipMinus]),
        peak_memory()
    );
    Ok(())
}

/// Pressure on top, a pull on the right that grows with α.
fn loads(system: &ElasticSystem) -> Outcome<LoadPath> {
    let dim = system.mesh().dim();
    let press = system.traction("top", |_| {
        let mut t = [0.0; 3];
        t[dim - 1] = -0.01;
        t
    })?;
    let pull = system.traction("right", |_| [0.01, 0.0, 0.002])?;
    Ok(LoadPath::affine(press, pull))
}

/// The largest resident set so far, where the system tells it.
fn peak_memory() -> String {
    std::fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|status| {
            let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
            let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
            Some(format!("{:.0} MiB", kib / 1024.0))
        })
        .unwrap_or_else(|| "-".into())
}
