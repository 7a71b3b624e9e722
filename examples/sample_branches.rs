//! Two contact nodes with Coulomb friction, F = (α, α): is it true that there are at most two solution branches?
//! You will see, over random loads and Lamé coefficients, how often each number of branches and of solutions occurs, and the
//! problems with the largest numbers found. Every list of solutions comes from a complete enumeration.
//! Ctrl-C ends it early and prints what was found so far.
//! Run: cargo run --release --example sample_branches [-- --samples N --seed S]

#[macro_use]
mod common;
#[path = "common/progress.rs"]
mod progress;

use std::collections::BTreeMap;
use std::process::ExitCode;

use clap::Parser;
use common::{Interrupted, Outcome, Random, ensure, exit, list};
use progress::Progress;
use semismooth::contact::{CondensedContact, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::continuation::{Diagram, DiagramOptions};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::sparse::Matrix;

/// Counts solutions and branches of two contact nodes for samples of loads and coefficients.
#[derive(Parser)]
struct Args {
    /// Number of problems drawn.
    #[arg(long, default_value_t = 500)]
    samples: u64,
    /// Loads tried near each load with several solutions.
    #[arg(long, default_value_t = 2)]
    neighbours: u64,
    /// Values of α at which all solutions are listed.
    #[arg(long, default_value_t = 16)]
    alphas: usize,
    /// Seed of the random numbers.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// A problem: μ = 1 and ‖f‖ = 1 without loss of generality (solutions scale with both).
#[derive(Clone, Copy)]
struct Sample {
    lambda: f64,
    load: [f64; 4],
}

/// What was found for a sample.
#[derive(Clone, Copy)]
struct Count {
    solutions: usize,
    at: f64,
    branches: usize,
    components: usize,
    certified: bool,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Args>()))
}

/// The stiffness matrix of the model for (uν1, ut1, uν2, ut2).
fn stiffness(lambda: f64, mu: f64) -> Outcome<Matrix> {
    let (a, b, c, d) = (
        0.5 * mu,
        0.5 * lambda,
        0.5 * (lambda + 2.0 * mu),
        lambda + 3.0 * mu,
    );
    let rows = [
        [a, 0.0, -a, -a],
        [0.0, c, -b, -c],
        [-a, -b, d, 0.0],
        [-a, -c, 0.0, d],
    ];
    Ok(Matrix::from_rows(&rows)?)
}

fn problem(sample: &Sample) -> Outcome<CondensedContact<PlanarCoulomb>> {
    let normal = Matrix::from_rows(&[[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])?;
    let tangential = Matrix::from_rows(&[[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])?;
    let load = LoadPath::constant(sample.load.to_vec());
    let friction = FrictionCoefficient::affine(vec![0.0; 2], vec![1.0; 2])?;
    let stiffness = stiffness(sample.lambda, 1.0)?;
    let problem = FullContact::planar(stiffness, normal, tangential, load, friction)?;
    Ok(problem.condensed()?)
}

fn draw(random: &mut Random) -> Sample {
    let lambda = 10f64.powf(2.0 * random.symmetric());
    let load = [0.0; 4].map(|_: f64| random.symmetric());
    normalised(lambda, load)
}

/// A load (and λ) at a distance of 1e-3 to 1.
fn neighbour(sample: &Sample, random: &mut Random) -> Sample {
    let far = 10f64.powf(1.5 * (random.symmetric() - 1.0));
    let lambda = sample.lambda * 10f64.powf(far * random.symmetric());
    normalised(lambda, sample.load.map(|f| f + far * random.symmetric()))
}

fn normalised(lambda: f64, mut load: [f64; 4]) -> Sample {
    let length = load.iter().map(|f| f * f).sum::<f64>().sqrt();
    load.iter_mut().for_each(|f| *f /= length);
    Sample { lambda, load }
}

fn count(sample: &Sample, alphas: &[f64]) -> Outcome<Count> {
    let map = problem(sample)?;
    let options = EnumerationOptions::default();
    let (mut most, mut at, mut certified) = (0, f64::NAN, true);
    for &alpha in alphas {
        let set = all_solutions(&map, alpha, &options)?;
        let own = set.completeness.is_complete() && set.index_sum == Some(1);
        ensure(
            !own || set.solutions.len() % 2 == 1,
            "regular solutions whose indices sum up to +1 are odd in number",
        )?;
        certified &= own;
        if set.solutions.len() > most {
            (most, at) = (set.solutions.len(), alpha);
        }
    }
    // Solutions that are unique at every sampled α form one branch.
    let (mut branches, mut components) = (1, 1);
    if most > 1 {
        let bounds = DiagramOptions::default().with_parameter_range((1e-3, 1e3));
        let diagram = Diagram::explore_sections(&map, alphas, &bounds, &options)?;
        // The lists at the sampled α are complete; in between nothing may have been given up.
        certified &= !diagram.completeness().is_limited();
        (branches, components) = (diagram.branches().len(), diagram.components().len());
        ensure(
            (1..=branches).contains(&components),
            "a component consists of branches",
        )?;
    }
    Ok(Count {
        solutions: most,
        at,
        branches,
        components,
        certified,
    })
}

fn run(args: &Args) -> Outcome<()> {
    if args.alphas == 0 {
        return Err("--alphas must be at least 1".into());
    }
    let mut random = Random::new(args.seed);
    // Friction from 0.05 to 50, evenly in its logarithm.
    let alphas: Vec<f64> = (0..args.alphas)
        .map(|k| 0.05 * 1000f64.powf((k as f64 + 0.5) / args.alphas as f64))
        .collect();
    let mut by_branches: BTreeMap<usize, u64> = BTreeMap::new();
    let mut by_solutions: BTreeMap<usize, u64> = BTreeMap::new();
    let mut records: [Option<(Sample, Count)>; 2] = [None; 2];
    let mut uncertified = 0;
    let (mut drawn, mut near) = (0, Vec::new());
    let progress = Progress::new(args.samples)?;
    loop {
        let most = records[0].map_or(0, |r: (Sample, Count)| r.1.branches);
        if progress.at(drawn, format!("{most} branches at most")).is_break() {
            break;
        }
        let (sample, is_drawn) = match near.pop() {
            Some(sample) => (sample, false),
            None if drawn == args.samples => break,
            None => {
                drawn += 1;
                (draw(&mut random), true)
            }
        };
        let found = count(&sample, &alphas)?;
        *by_branches.entry(found.branches).or_default() += 1;
        *by_solutions.entry(found.solutions).or_default() += 1;
        uncertified += u64::from(!found.certified);
        if records[0].is_none_or(|r| found.branches > r.1.branches) {
            records[0] = Some((sample, found));
        }
        if records[1].is_none_or(|r: (Sample, Count)| found.solutions > r.1.solutions) {
            records[1] = Some((sample, found));
        }
        if is_drawn && found.solutions > 1 {
            near.extend((0..args.neighbours).map(|_| neighbour(&sample, &mut random)));
        }
    }
    let interrupted = progress.cancelled();
    drop(progress);
    if interrupted {
        println!(
            "interrupted after {drawn} of {} problems; up to there:",
            args.samples
        );
    }
    println!(
        "{} problems drawn, {} near them, {} values of α each, seed {}",
        drawn,
        by_branches.values().sum::<u64>().saturating_sub(drawn),
        args.alphas,
        args.seed
    );
    println!("{:>10}  {:>10}", "branches", "problems");
    for (n, times) in &by_branches {
        println!("{n:>10}  {times:>10}");
    }
    println!("{:>10}  {:>10}", "solutions", "problems");
    for (n, times) in &by_solutions {
        println!("{n:>10}  {times:>10}");
    }
    for (what, record) in ["branches", "solutions at one α"].iter().zip(&records) {
        let Some((sample, found)) = record else { continue };
        let number = if *what == "branches" {
            found.branches
        } else {
            found.solutions
        };
        println!(
            "most {what}: {number}, for λ/μ = {}, f = ({})",
            sample.lambda,
            list(&sample.load, 6)
        );
        println!(
            "    {} branches in {} components, {} solutions at α = {:.6}",
            found.branches, found.components, found.solutions, found.at
        );
    }
    println!(
        "not certified complete (a degenerate point among the samples, or a limit): {uncertified} problems"
    );
    ensure(
        uncertified * 50 <= by_branches.values().sum::<u64>(),
        "hardly a sample has a degenerate point",
    )?;
    if interrupted {
        let what = format!("{drawn} of {} problems were drawn", args.samples);
        return Err(Interrupted(what).into());
    }
    Ok(())
}
