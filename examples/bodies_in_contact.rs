//! Two blocks, held on their left side, pressed on the ground and pulled to the right, in the plane and in space: where they stick, slip and lift off.
//! You will see, for each, the numbers of nodes in each state, the forces of the ground against those of the load, and the file of a picture
//! of the deformed body with its stresses. The program fails when the forces do not balance.
//! Run: cargo run --release --example bodies_in_contact [-- --cells 12] [--out DIR]

#[macro_use]
mod common;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use common::{Outcome, exit, file_in};
use semismooth::contact::{
    CondensedContact, FrictionCoefficient, LoadPath, NodeLaw, OrthotropicCoulomb, PlanarCoulomb,
};
use semismooth::contact_body;
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
use semismooth::output::{BodyPicture, SegmentStyle};

/// Forces relative to the load that may be missing in the balance: rounding in the solution of a few thousand equations.
const BALANCE: f64 = 1e-9;

/// Draws two bodies in contact.
#[derive(Parser)]
struct Args {
    /// Cells over the height of the blocks.
    #[arg(long, default_value_t = 12)]
    cells: usize,
    /// Folder for the pictures.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

fn run(args: &Args) -> Outcome<()> {
    if !(2..=40).contains(&args.cells) {
        return Err("--cells must be from 2 to 40".into());
    }
    let n = args.cells;
    let friction = || FrictionCoefficient::constant(0.4);
    let plane = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2 * n, n])?;
    draw("plane", plane, PlanarCoulomb::new(friction()?), args)?;
    let half = n.div_ceil(2);
    let solid = Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [2 * half, half, half])?;
    draw("space", solid, OrthotropicCoulomb::isotropic(friction()?), args)
}

/// Pressed on its top by 0.05 E, and pulled on its right side by 0.01 E to the right and 0.02 E upwards.
fn draw<L: NodeLaw>(name: &str, mesh: Mesh, law: L, args: &Args) -> Outcome<()> {
    let dim = mesh.dim();
    let up = dim - 1;
    let mut normal = [0.0; 3];
    normal[up] = 1.0;
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?)
        .fix("left")
        .assemble()?;
    let press = system.traction("top", |_| normal.map(|n| -0.05 * n))?;
    let lift = system.traction("right", |_| normal.map(|n| 0.02 * n))?;
    let pull = system.traction("right", |_| [0.01, 0.0, 0.0])?;
    let load: Vec<f64> = press
        .iter()
        .zip(&lift)
        .zip(&pull)
        .map(|((a, b), c)| a + b + c)
        .collect();
    let weight: f64 = press.iter().chain(&lift).sum();
    let rows = system.contact("bottom", &Foundation::plane([0.0; 3], normal))?;
    let body = contact_body(&system, &rows, LoadPath::constant(load))?;
    let problem = CondensedContact::new(body, law)?;
    let x = problem.solve(0.0, None)?;
    let solution = problem.solution(&x)?;
    let free = problem.displacements(&x)?;
    let stresses = system.stresses(&free, &[])?;
    let mut picture = BodyPicture::new(system.mesh())
        .with_displacements(system.displacements(&free, &[])?, 3.0)
        .with_view(-60.0, -30.0)
        .with_field("von Mises / E", stresses.iter().map(von_mises).collect());
    for (&node, &state) in rows.nodes.iter().zip(&solution.states) {
        picture = picture.with_mark(node, SegmentStyle::contact(state, false));
    }
    let file = file_in(&args.out, &format!("body_{name}.svg"))?;
    picture.write(&file)?;
    println!("{name}: {solution}");
    let ground = solution.resultant()[0].abs();
    let held: f64 = system.reactions(&free, &[])?.iter().skip(up).step_by(dim).sum();
    println!(
        "  loaded by {:.6}, the ground bears {ground:.6} and the left side {held:.6}; drawn in {}",
        -weight,
        file.display()
    );
    if (weight + ground + held).abs() > BALANCE * weight.abs() {
        return Err("the forces do not balance".into());
    }
    Ok(())
}

/// From the components 11, 22, 33, 12, 23, 13.
fn von_mises(s: &[f64; 6]) -> f64 {
    let [a, b, c, d, e, f] = *s;
    let normal = (a - b).powi(2) + (b - c).powi(2) + (c - a).powi(2);
    (0.5 * normal + 3.0 * (d * d + e * e + f * f)).sqrt()
}
