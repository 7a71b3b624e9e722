//! Bars on the ground whose coefficient of friction falls with the slip: several solutions for one load (Haslinger, Kučera, Vlach 2008).
//! You will see the branch over the scale ζ of friction with its two folds, all its solutions at ζ = 1.4, how the fixed-point iteration
//! jumps from one to another (plane problem), and pictures: the S-curve; displacements, stresses, friction and slips along the ground,
//! in space on the whole contact surface.
//! Run: cargo run --release --example nonuniqueness [-- --problem bar2d|bar3d|bar3d-orthotropic] [--nx 40] [--json] [--out DIR]

#[macro_use]
mod common;
#[path = "common/ground.rs"]
mod ground;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::{Parser, ValueEnum};
use common::bars::{Bar, bar2d, bar3d};
use common::{Outcome, ensure, exit, file_in};
use ground::{QUANTITIES, along_the_ground, surface};
use semismooth::contact::{ContactSolution, FixedPointOptions, LocalValues, NodeLaw, fixed_point};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, PointKind};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
use serde_json::json;

/// ζ at which all solutions of the branch are wanted.
const WANTED: f64 = 1.4;

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum Problem {
    /// In the plane.
    Bar2d,
    /// In space.
    Bar3d,
    /// In space, with friction diag(F, 0.6 F).
    Bar3dOrthotropic,
}

/// Follows the scale of friction ζ through both folds of a bar with slip-weakening friction.
#[derive(Parser)]
struct Args {
    /// The bar.
    #[arg(long, value_enum, default_value_t = Problem::Bar2d)]
    problem: Problem,
    /// Cells along the bar, a multiple of 10; default 40 (plane) or 20.
    #[arg(long)]
    nx: Option<usize>,
    /// One JSON object instead of text.
    #[arg(long)]
    json: bool,
    /// Folder for the pictures.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

fn run(args: &Args) -> Outcome<()> {
    let begun = Instant::now();
    match args.problem {
        Problem::Bar2d => {
            let bar = bar2d(args.nx.unwrap_or(40))?;
            let found = study(&bar, "bar2d", begun, args)?;
            if !args.json {
                fixed_points(&bar, &found)?;
            }
        }
        Problem::Bar3d => {
            study(&bar3d(args.nx.unwrap_or(20), false)?, "bar3d", begun, args)?;
        }
        Problem::Bar3dOrthotropic => {
            study(
                &bar3d(args.nx.unwrap_or(20), true)?,
                "bar3d-orthotropic",
                begun,
                args,
            )?;
        }
    }
    Ok(())
}

struct Found {
    /// (ζ, whether it is a kink), by arclength.
    folds: Vec<(f64, bool)>,
    /// Solutions at [`WANTED`] by slip of the end: x and sign of the determinant.
    solutions: Vec<(Vec<f64>, Option<i8>)>,
}

fn study<L: NodeLaw>(bar: &Bar<L>, name: &str, begun: Instant, args: &Args) -> Outcome<Found> {
    let problem = &bar.problem;
    let zeta = 3.2;
    let start = problem.solve(zeta, Some(&problem.stick_start(zeta)?))?;
    let options = ContinuationOptions::default()
        .with_parameter_range((0.5, 1.1 * zeta))
        .with_targets(vec![WANTED]);
    let branch = Branch::follow(problem, &start, Direction::Decreasing, options)?;
    let end = end_node(bar);
    let slip = |x: &[f64]| -> Outcome<f64> { Ok(end_slip(&problem.solution(x)?, end)) };
    let kinks = branch.transitions.iter().filter(|t| t.is_fold());
    let mut folds: Vec<(f64, f64, bool)> = kinks
        .map(|t| (t.arclength, t.parameter(), true))
        .chain(
            branch
                .smooth_folds
                .iter()
                .map(|f| (f.arclength, f.parameter(), false)),
        )
        .collect();
    folds.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut solutions = Vec::new();
    for p in &branch.points {
        if p.kind == PointKind::Target && p.parameter() == WANTED {
            solutions.push((slip(&p.x)?, p.x.clone(), p.det_sign));
        }
    }
    solutions.sort_by(|a, b| a.0.total_cmp(&b.0));
    let seconds = begun.elapsed().as_secs_f64();
    let list: Vec<_> = solutions
        .iter()
        .map(|(ut, x, sign)| {
            let values = problem.solution(x).map(|s| s.nodes[end].slip);
            let components = values.map(|s| s[..problem.node_law().num_tangents()].to_vec());
            json!({"ut_end": ut, "ut_end_components": components.unwrap_or_default(), "det_sign": sign})
        })
        .collect();
    if args.json {
        let folds: Vec<_> = folds
            .iter()
            .map(|f| json!({"zeta": f.1, "kind": if f.2 { "kink" } else { "smooth" }}))
            .collect();
        println!(
            "{}",
            json!({"folds": folds, "solutions_at_1.4": list, "seconds": seconds})
        );
    } else {
        println!(
            "{name}: {} free displacements, {} contact nodes, {} points, {} transitions, end: {}; {seconds:.2} s",
            bar.system.num_free(),
            bar.rows.nodes.len(),
            branch.points.len(),
            branch.transitions.len(),
            branch.termination
        );
        println!("\nfolds along the branch, from ζ = {zeta} on the sticking side:");
        for f in &folds {
            println!("  ζ = {:<18.13} {}", f.1, if f.2 { "kink" } else { "smooth" });
        }
        println!("\nsolutions at ζ = {WANTED}:");
        println!(
            "  {:>3}  {:>20}  {:>8}  open stick slip",
            "", "u_t at the end [m]", "sign det"
        );
        for (k, (ut, x, sign)) in solutions.iter().enumerate() {
            let s = problem.solution(x)?;
            let count = |letter: &str| s.states.iter().filter(|s| s.name().starts_with(letter)).count();
            println!(
                "  {:>3}  {ut:>20.13e}  {:>8}  {:>4} {:>5} {:>4}",
                k + 1,
                sign.map_or("?".into(), |s| format!("{s:+}")),
                count("open"),
                count("stick"),
                count("slip")
            );
        }
    }
    let found = Found {
        folds: folds.into_iter().map(|f| (f.1, f.2)).collect(),
        solutions: solutions.into_iter().map(|s| (s.1, s.2)).collect(),
    };
    draw(bar, name, &branch, &found, args)?;
    let indices: Option<Vec<i8>> = found.solutions.iter().map(|s| s.1).collect();
    let sum: Option<i32> = indices.map(|all| all.iter().map(|s| i32::from(*s)).sum());
    ensure(
        sum.is_none_or(|s| s == 1),
        "the indices of all solutions at ζ = 1.4 add up to 1",
    )?;
    Ok(found)
}

/// The contact node at x = 10, y = 0.
fn end_node<L>(bar: &Bar<L>) -> usize {
    let far = bar.rows.points.last().map_or(0.0, |p| p[0]);
    bar.rows.points.iter().position(|p| p[0] == far).unwrap_or(0)
}

fn end_slip(solution: &ContactSolution, end: usize) -> f64 {
    let v = &solution.nodes[end];
    if v.slip[1] == 0.0 {
        v.slip[0]
    } else {
        v.slip_norm()
    }
}

fn draw<L: NodeLaw>(bar: &Bar<L>, name: &str, branch: &Branch, found: &Found, args: &Args) -> Outcome<()> {
    let problem = &bar.problem;
    let end = end_node(bar);
    let ordinate = |x: &[f64]| problem.solution(x).map_or(f64::NAN, |s| 1e3 * end_slip(&s, end));
    let style = |_: &_, _: &[usize]| SegmentStyle::new("solutions", Colour::BLUE);
    let s_curve = file_in(&args.out, &format!("{name}_s_curve.svg"))?;
    BranchDiagram::new(
        Panel::new("ζ", "slip of the end [mm]").with_curve(Curve::of_branch(branch, ordinate, style)),
    )
    .with_title(format!("{name}: solutions over the scale of friction"))
    .with_size(720, 480)
    .write(&s_curve)?;

    let mut written = vec![s_curve];
    let solutions = found.solutions.iter().map(|(x, _)| problem.solution(x));
    let nodes: Vec<Vec<LocalValues>> = solutions.map(|s| s.map(|s| s.nodes)).collect::<Result<_, _>>()?;
    let title = format!("{name}: solutions at ζ = {WANTED}");
    written.extend(along_the_ground(bar, &nodes, &title, &|part| {
        file_in(&args.out, &format!("{name}_{part}.svg"))
    })?);
    if problem.node_law().num_tangents() == 2 {
        for (part, quantity) in QUANTITIES.iter().enumerate() {
            let path = file_in(&args.out, &format!("{name}_surface_{}.svg", part + 1))?;
            surface(bar, &nodes, quantity, &title).write(&path)?;
            written.push(path);
        }
    }
    fields(bar, name, found, args)?;
    if !args.json {
        println!("\npictures:");
        written.iter().for_each(|path| println!("  {}", path.display()));
    }
    Ok(())
}

/// The solutions as fields on the mesh, for ParaView.
fn fields<L: NodeLaw>(bar: &Bar<L>, name: &str, found: &Found, args: &Args) -> Outcome<()> {
    use semismooth::output::{Field, write_vtu};
    let (system, rows) = (&bar.system, &bar.rows);
    let mesh = system.mesh();
    let (dim, n) = (mesh.dim(), mesh.num_nodes());
    for (k, (x, _)) in found.solutions.iter().enumerate() {
        let free = bar.problem.displacements(x)?;
        let solution = bar.problem.solution(x)?;
        // −1 off the ground; tractions are forces by area, vectors in space.
        let (mut state, mut pressure) = (vec![-1.0; n], vec![0.0; n]);
        let (mut traction, mut slip) = (vec![0.0; 3 * n], vec![0.0; 3 * n]);
        for (i, &node) in rows.nodes.iter().enumerate() {
            let v = &solution.nodes[i];
            state[node] = f64::from(solution.states[i].piece() as u32);
            pressure[node] = v.pressure / rows.areas[i];
            for d in 0..3 {
                for (t, axis) in rows.tangents[i].iter().enumerate() {
                    traction[3 * node + d] -= v.traction[t] / rows.areas[i] * axis[d];
                    slip[3 * node + d] += v.slip[t] * axis[d];
                }
                traction[3 * node + d] -= pressure[node] * rows.normals[i][d];
            }
        }
        let stress = system.stresses(&free, &[])?.into_iter().flatten().collect();
        let path = file_in(&args.out, &format!("{name}_solution_{}.vtu", k + 1))?;
        let at_nodes = [
            Field::new("displacement", dim, system.displacements(&free, &[])?),
            Field::new("contact state", 1, state),
            Field::new("pressure", 1, pressure),
            Field::new("traction", 3, traction),
            Field::new("slip", 3, slip),
        ];
        write_vtu(path, mesh, &at_nodes, &[Field::new("stress", 6, stress)])?;
    }
    Ok(())
}

/// The fixed-point iteration from stick, on both sides of the lower fold.
fn fixed_points<L: NodeLaw>(bar: &Bar<L>, found: &Found) -> Outcome<()> {
    let Some(fold) = found.folds.iter().map(|f| f.0).reduce(f64::min) else {
        return Ok(());
    };
    let problem = &bar.problem;
    let end = end_node(bar);
    println!("\nfixed point (φ, g) ← (‖u_t‖, λν), each time from stick; lower fold at {fold:.9}:");
    println!(
        "  {:>12}  {:>10}  {:>20}  contraction",
        "ζ", "iterations", "u_t at the end [m]"
    );
    let digits = 1e7;
    let above = (fold * digits).ceil() / digits;
    for zeta in [2.0, 1.4, above, above - 1.0 / digits, 1.3, 1.0] {
        let start = problem.stick_start(zeta)?;
        let report = fixed_point(problem, &start, &FixedPointOptions::default())?;
        let ut = end_slip(&problem.solution(&report.x)?, end);
        println!(
            "  {zeta:>12.7}  {:>10}  {ut:>20.10e}  {}{}",
            report.iterations(),
            report.contraction().map_or("-".into(), |c| format!("{c:.4}")),
            match report {
                _ if report.converged => String::new(),
                _ if report.stagnated => {
                    let last = report.changes.last().copied().unwrap_or(f64::NAN);
                    format!("  no further: changes of {last:.0e}")
                }
                _ => "  not converged".into(),
            }
        );
    }
    Ok(())
}
