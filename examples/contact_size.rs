//! How large a contact problem may be: an elastic block on the ground, meshed ever finer and solved, either condensed onto its contact
//! nodes (one Cholesky factorisation) or in its displacements with multigrid, whichever is faster at that size. A Gmsh mesh may replace the
//! block: its groups of facets are "left" (clamped), "top" (pressed), "right" (pulled) and "bottom", flat or curved, on a foundation of the
//! same shape (`examples/data/curved_block.geo` is one).
//! You will see displacements, contact nodes, the route, the time of each phase (mesh, assembly, factorisation or multigrid, first solve,
//! a further solve at another load), Newton steps and Krylov iterations, the states of the nodes, and the peak memory, row by row.
//! With --follow the load path of condensed problems is followed from α = 1 down to 0: the number of transitions, of nodes that change
//! their state, and how often a matrix was factored; --transitions writes the transitions to a file: α, node, state before and after.
//! With --levels problems in the displacements go through so many load levels up to α = 1: steps, changes of state and time of each.
//! With --derivative the solutions of problems in the displacements are differentiated in α and in a gap common to all nodes: time and
//! iterations of one solve, and of one with the transposed system, to the same tolerance.
//! Run: cargo run --release --example contact_size [-- --plane 999x500] [--solid 40x38x20] [--mesh body.msh] [--friction 0.8]
//! [--route displacements] [--follow] [--transitions transitions.csv] [--levels 10] [--derivative]

#[macro_use]
mod common;

use std::collections::BTreeSet;
use std::fs::OpenOptions;
use std::io::{BufWriter, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, ensure, exit};
use semismooth::contact::{
    CondensedContact, ContactError, ContactForm, ContactSolution, FrictionCoefficient, FrictionCurve,
    LoadPath, NodeLaw, OrthotropicCoulomb, PlanarCoulomb, ReducedContact, ReducedOptions,
};
use semismooth::continuation::{Continuation, ContinuationOptions, Direction, Event};
use semismooth::fem::{ElasticSystem, Elasticity, Foundation, Material, Mesh, read_gmsh};
use semismooth::piecewise::PiecewiseSmoothExt;
use semismooth::sparse::Matrix;

/// Times the phases of contact problems on finer and finer meshes.
#[derive(Parser)]
struct Args {
    /// Cells of plane blocks, NXxNY each. Default: 16x8, 32x16, 64x32.
    #[arg(long)]
    plane: Vec<String>,
    /// Cells of solid blocks, NXxNYxNZ each. Default: 6x6x3, 10x10x5.
    #[arg(long)]
    solid: Vec<String>,
    /// Gmsh files with the groups "left", "right", "bottom" and "top".
    #[arg(long)]
    mesh: Vec<PathBuf>,
    /// Coefficient of friction.
    #[arg(long, default_value_t = 0.3)]
    friction: f64,
    /// "condensed", "displacements", or "auto": by size.
    #[arg(long, default_value = "auto")]
    route: String,
    /// Follows the load path of condensed problems from α = 1 down to 0.
    #[arg(long)]
    follow: bool,
    /// File for the transitions of load paths, those of one body after the other.
    #[arg(long, value_name = "FILE", requires = "follow")]
    transitions: Option<PathBuf>,
    /// Number of load levels that problems in the displacements go through.
    #[arg(long, default_value_t = 0)]
    levels: usize,
    /// Differentiates solutions of problems in the displacements.
    #[arg(long)]
    derivative: bool,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

fn run(args: &Args) -> Outcome<()> {
    if let Some(path) = &args.transitions {
        std::fs::write(path, "alpha,node,from,to\n")?;
    }
    let (mut plane, mut solid) = (args.plane.clone(), args.solid.clone());
    if plane.is_empty() && solid.is_empty() && args.mesh.is_empty() {
        plane = ["16x8", "32x16", "64x32"].map(String::from).to_vec();
        solid = ["6x6x3", "10x10x5"].map(String::from).to_vec();
    }
    println!(
        "         cells     free  nodes         route    mesh assembly   setup   solve further Newton  Krylov"
    );
    let friction = || {
        Ok::<_, ContactError>(FrictionCoefficient::uniform(FrictionCurve::constant(
            args.friction,
        )?))
    };
    let ground = |dim: usize| {
        let mut up = [0.0; 3];
        up[dim - 1] = 1.0;
        Foundation::plane([0.0; 3], up)
    };
    for cells in &plane {
        let n = parse::<2>(cells)?;
        let begun = Instant::now();
        let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], n)?;
        measure(
            cells,
            mesh,
            &ground(2),
            begun,
            PlanarCoulomb::new(friction()?),
            args,
        )?;
    }
    for cells in &solid {
        let n = parse::<3>(cells)?;
        let begun = Instant::now();
        let mesh = Mesh::block([0.0; 3], [2.0, 2.0, 1.0], n)?;
        let law = OrthotropicCoulomb::isotropic(friction()?);
        measure(cells, mesh, &ground(3), begun, law, args)?;
    }
    for path in &args.mesh {
        let begun = Instant::now();
        let mesh = read_gmsh(path)?;
        let name = path
            .file_name()
            .map_or_else(String::new, |n| n.to_string_lossy().into());
        let bed = Foundation::gap(|_| 0.0);
        if mesh.dim() == 2 {
            measure(&name, mesh, &bed, begun, PlanarCoulomb::new(friction()?), args)?;
        } else {
            let law = OrthotropicCoulomb::isotropic(friction()?);
            measure(&name, mesh, &bed, begun, law, args)?;
        }
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

/// Measures the seconds since its last call.
struct Lap(Instant);

impl Lap {
    fn seconds(&mut self) -> f64 {
        let seconds = self.0.elapsed().as_secs_f64();
        self.0 = Instant::now();
        seconds
    }
}

fn measure<L: NodeLaw>(
    name: &str,
    mesh: Mesh,
    foundation: &Foundation,
    begun: Instant,
    law: L,
    args: &Args,
) -> Outcome<()> {
    let mut lap = Lap(begun);
    let dim = mesh.dim();
    let meshed = lap.seconds();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.277)?)
        .fix("left")
        .discretize()?;
    let free = system.num_free();
    let form = match args.route.as_str() {
        "condensed" => ContactForm::Condensed,
        "displacements" => ContactForm::Displacements,
        "auto" => ContactForm::Auto,
        other => {
            return Err(format!("there is no route \"{other}\": auto, condensed or displacements").into());
        }
    };
    let mut row = match form.suited(dim, free, true) {
        ContactForm::Displacements => reduce(system, foundation, law, args, &mut lap)?,
        _ => condense(system, foundation, law, args, &mut lap)?,
    };
    row.times[0] = meshed;
    row.print(name, free);
    for line in &row.more {
        println!("    {line}");
    }
    Ok(())
}

fn condense<L: NodeLaw>(
    system: ElasticSystem,
    foundation: &Foundation,
    law: L,
    args: &Args,
    lap: &mut Lap,
) -> Outcome<Row> {
    let (load, rows) = (loads(&system)?, system.contact("bottom", foundation)?);
    let body = semismooth::contact_body(&system, &rows, load)?;
    drop(system);
    let assembled = lap.seconds();
    let problem = CondensedContact::new(body, law)?;
    let setup = lap.seconds();
    let x = problem.solve(1.0, None)?;
    let solved = lap.seconds();
    let y = problem.solve(1.05, Some(&x))?;
    let further = lap.seconds();
    Ok(Row {
        route: "condensed",
        times: [0.0, assembled, setup, solved, further],
        iterations: ["-".into(), "-".into()],
        more: match args.follow {
            true => vec![follow(&problem, &x, args.transitions.as_deref(), lap)?],
            false => Vec::new(),
        },
        solution: problem.solution(&y)?,
    })
}

/// Follows the load path from the solution at α = 1 down to α = 0; for the default bodies its end must be the solution computed there from
/// scratch.
fn follow<L: NodeLaw>(
    problem: &CondensedContact<L>,
    start: &[f64],
    out: Option<&Path>,
    lap: &mut Lap,
) -> Outcome<String> {
    let contacts = problem.num_contacts();
    let options = ContinuationOptions::default()
        .with_parameter_range((0.0, 1.0))
        .with_max_points(20 * contacts + 100);
    let mut file = match out {
        Some(path) => Some(BufWriter::new(OpenOptions::new().append(true).open(path)?)),
        None => None,
    };
    let mut curve = Continuation::new(problem, start, Direction::Decreasing, options)?;
    let (mut transitions, mut folds, mut nodes) = (0, 0, BTreeSet::new());
    // Event by event: a branch keeps several vectors of all unknowns for each transition.
    for event in curve.by_ref() {
        match event? {
            Event::Transition(t) => {
                transitions += 1;
                folds += usize::from(t.is_fold());
                nodes.extend(t.sites.iter().map(|s| s.site));
                let Some(file) = &mut file else { continue };
                for s in t.sites.iter().filter(|s| s.from != s.to) {
                    let [from, to] = [s.from, s.to].map(|piece| problem.piece_name(s.site, piece));
                    writeln!(file, "{},{},{from},{to}", t.parameter(), s.site)?;
                }
            }
            Event::SmoothFold(_) => folds += 1,
            _ => {}
        }
    }
    let (seconds, end) = (lap.seconds(), curve.point());
    if let Some(file) = &mut file {
        file.flush()?;
    }
    ensure(end.parameter() == 0.0, "the path ends at α = 0")?;
    if contacts <= 200 {
        let found = problem.solve(0.0, None)?;
        let size = found.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let same = (end.x.iter().zip(&found)).all(|(a, b)| (a - b).abs() <= 1e-9 * size);
        ensure(same, "the path ends in the solution at α = 0")?;
    }
    Ok(format!(
        "path down to α = 0: {seconds:.2} s, {transitions} transitions at {} nodes, {folds} folds, {} factorisations, peak memory {}",
        nodes.len(),
        curve.factorisations(),
        peak_memory()
    ))
}

fn reduce<L: NodeLaw>(
    system: ElasticSystem,
    foundation: &Foundation,
    law: L,
    args: &Args,
    lap: &mut Lap,
) -> Outcome<Row> {
    let (load, rows) = (loads(&system)?, system.contact("bottom", foundation)?);
    let body = semismooth::reduced_body(&system, &rows, load)?;
    drop(system);
    let assembled = lap.seconds();
    let mut problem = ReducedContact::new(body, law, ReducedOptions::default())?;
    let setup = lap.seconds();
    let first = problem.solve(1.0, None)?;
    let solved = lap.seconds();
    let second = problem.solve(1.05, Some(&first.displacements))?;
    let further = lap.seconds();
    let solution = problem.solution(1.05, &second.displacements)?;
    let mut more = history(&mut problem, args.levels)?;
    if args.derivative {
        more.push(derivative(&mut problem, 1.05, &second.displacements)?);
    }
    Ok(Row {
        route: "displacements",
        times: [0.0, assembled, setup, solved, further],
        iterations: [
            format!("{}+{}", first.newton(), second.newton()),
            format!("{}+{}", first.krylov(), second.krylov()),
        ],
        more,
        solution,
    })
}

/// One solve for the derivative of a solution along a change of α and of all gaps, and one for the gradient of a function of the solution: by
/// either the function has the same rate.
fn derivative<L: NodeLaw>(problem: &mut ReducedContact<L>, alpha: f64, u: &[f64]) -> Outcome<String> {
    let (n, p, dim) = (u.len(), problem.body().num_contacts(), problem.body().dim());
    let ones: Vec<_> = (0..p).map(|i| (i, 0, 1.0)).collect();
    let parameters = problem.parameters().with_alpha();
    let parameters = parameters.with_gaps(&Matrix::from_triplets(p, 1, &ones)?)?;
    let mut lap = Lap(Instant::now());
    let mut found = problem.sensitivity(alpha, u, &parameters)?;
    let (margin, begun) = (found.margin(), lap.seconds());
    let delta = [1.0, 1e-3];
    let change = found.jvp(&delta)?;
    let (forward, iterations) = (lap.seconds(), found.iterations());
    let w: Vec<f64> = (0..n).map(|i| ((i % 7) as f64 - 3.0) / n as f64).collect();
    lap.seconds();
    let gradient = found.vjp(&w, &vec![0.0; dim * p])?;
    let (transposed, others) = (lap.seconds(), found.iterations());
    let rate: f64 = change.displacements.iter().zip(&w).map(|(u, w)| u * w).sum();
    let size: f64 = change
        .displacements
        .iter()
        .zip(&w)
        .map(|(u, w)| (u * w).abs())
        .sum();
    let same = (rate - gradient[0] * delta[0] - gradient[1] * delta[1]).abs();
    ensure(same <= 1e-8 * size, "the gradient has the rate of the derivative")?;
    Ok(format!(
        "derivative (margin {margin:.1e}, {begun:.2} s): {forward:.2} s and {iterations} iterations, transposed {transposed:.2} s and {others}: \
         {:.2} times as long; they agree to {:.0e}",
        transposed / forward,
        same / size
    ))
}

/// Load levels up to α = 1, from rest: steps and time of each, and how many nodes changed their state in it.
fn history<L: NodeLaw>(problem: &mut ReducedContact<L>, levels: usize) -> Outcome<Vec<String>> {
    if levels == 0 {
        return Ok(Vec::new());
    }
    let mut lines = vec![
        "     α Newton Krylov    time  open stick  slip changes  o→st  o→sl  st→o st→sl  sl→o sl→st  turn"
            .to_owned(),
    ];
    let loads: Vec<f64> = (1..=levels).map(|k| k as f64 / levels as f64).collect();
    let mut lap = Lap(Instant::now());
    problem.evolve(None, &loads, |level| {
        let (r, s, [open, stick, slip]) = (&level.report, &level.solution, level.changes);
        lines.push(format!(
            "{:>6.3} {:>6} {:>6} {:>7.2} {:>5} {:>5} {:>5} {:>7} {:>5} {:>5} {:>5} {:>5} {:>5} {:>5} {:>5}",
            level.level,
            r.newton(),
            r.krylov(),
            lap.seconds(),
            s.open(),
            s.stick(),
            s.slip(),
            level.num_changes(),
            open[1],
            open[2],
            stick[0],
            stick[2],
            slip[0],
            slip[1],
            slip[2]
        ));
        ControlFlow::Continue(())
    })?;
    Ok(lines)
}

/// Results for a body.
struct Row {
    route: &'static str,
    /// Mesh, assembly, setup, first solve, a further one.
    times: [f64; 5],
    iterations: [String; 2],
    solution: ContactSolution,
    /// Results for its load path or levels.
    more: Vec<String>,
}

impl Row {
    fn print(&self, cells: &str, free: usize) {
        let [meshed, assembled, setup, solved, further] = self.times;
        let ([newton, krylov], s) = (&self.iterations, &self.solution);
        println!(
            "{cells:>14} {free:>8} {:>6} {:>13} {meshed:>7.2} {assembled:>8.2} {setup:>7.2} {solved:>7.2} {further:>7.2} {newton:>6} {krylov:>7}",
            s.nodes.len(),
            self.route,
        );
        let (open, stick, slip) = (s.open(), s.stick(), s.slip());
        println!(
            "    open {open}, stick {stick}, slip {slip}; peak memory {}",
            peak_memory()
        );
    }
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

/// The largest resident set so far, where the operating system reports it.
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
