//! Quasi-variational inequalities, whose sets depend on the solution: contact with Coulomb friction, and games with shared constraints.
//!
//! QVI(G, K): find x ∈ K(x) with G(x)ᵀ(y − x) ≥ 0 for all y ∈ K(x). In its Karush–Kuhn–Tucker conditions constraints are differentiated
//! with respect to y alone (F. Facchinei, C. Kanzow, S. Sagratella, Math. Program. 144 (2014)), which makes them mixed complementarity
//! problems.
//!
//! 1. Forces λ = (λν, λt) of contact with friction: G(λ) = C λ − w with the compliance C and the free displacement w, and K(λ) = {μν ≥ 0,
//!    |μt| ≤ F λν}. A body on the ground is solved as a QVI through these conditions, by a sequence of VIs over fixed K(λ), and by the
//!    crate's own methods for contact; and a problem of three nodes has as many solutions as its proven list. Over the fixed set {|μt| ≤ F
//!    μν}, the VI is another problem: slip lifts the body.
//! 2. Generalised Nash equilibria: no player gains by another decision that satisfies the shared constraints, given the decisions of the
//!    others. Variational ones, at which all players share the multipliers too, solve one VI; the others depend on weights of the players
//!    (J. B. Rosen, Econometrica 33 (1965)). Each point is certified by solving every player's own problem, whose multipliers tell the
//!    kind.
//!
//! You will see the differences of the routes, the residuals of the conditions, and both kinds of equilibria of the game of two players of
//! Facchinei and Kanzow (Ann. Oper. Res. 175 (2010), example 1) and of three factories at a river (A. Haurie, J. Krawczyk, Environ. Model.
//! Assess. 2 (1997)), whose variational equilibrium is published.
//!
//! ```text
//! cargo run --release --example quasi_variational -- --cells 8
//! ```

#[macro_use]
mod common;

use std::process::ExitCode;

use clap::Parser;
use common::squares::plane;
use common::{Outcome, Random, distance, ensure, exit, five_branches, list, short_list};
use semismooth::complementarity::{AffineFunction, Mcp, McpSolver};
use semismooth::contact::{
    CondensedContact, FixedPointOptions, FrictionCoefficient, FrictionCurve, PlanarCoulomb, fixed_point,
};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::sparse::Matrix;
use semismooth::variational::{Polyhedron, Vi, ViSolver};

#[derive(Parser)]
#[command(about = "Friction and games as quasi-variational inequalities")]
struct Arguments {
    /// Cells a unit length of the body (2 to 32).
    #[arg(long, default_value_t = 8)]
    cells: usize,
    /// Coefficient of friction (0.01 to 0.5).
    #[arg(long, default_value_t = 0.3)]
    friction: f64,
    /// Random starts for the problem of three nodes.
    #[arg(long, default_value_t = 400)]
    starts: usize,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    if !(2..=32).contains(&arguments.cells) || !(0.01..=0.5).contains(&arguments.friction) {
        return Err("--cells goes from 2 to 32, --friction from 0.01 to 0.5".into());
    }
    body(arguments)?;
    three_nodes(arguments.starts)?;
    two_players()?;
    river()
}

/// Forces of contact with friction at p nodes: C, w less the gap, F.
struct Forces {
    p: usize,
    compliance: Matrix,
    free: Vec<f64>,
    friction: Vec<f64>,
}

impl Forces {
    fn new(problem: &CondensedContact<PlanarCoulomb>, alpha: f64) -> Outcome<Self> {
        let p = problem.num_contacts();
        let mut free = problem.free_motion(alpha)?;
        free.iter_mut()
            .zip(problem.body().gap())
            .for_each(|(w, gap)| *w -= gap);
        Ok(Self {
            p,
            compliance: problem.compliance().clone(),
            free,
            friction: problem.friction_at(alpha),
        })
    }

    /// G(λ) = C λ − w.
    fn function(&self) -> Outcome<AffineFunction> {
        let q = self.free.iter().map(|w| -w).collect();
        Ok(AffineFunction::new(self.compliance.clone(), q)?)
    }

    /// The conditions in (λν, λt, m⁺, m⁻): 0 ≤ λν ⟂ Gν, Gt + m⁺ − m⁻ = 0, 0 ≤ m± ⟂ F λν ∓ λt.
    fn conditions(&self) -> Outcome<Mcp<AffineFunction>> {
        let p = self.p;
        let mut entries: Vec<_> = self.compliance.triplets().collect();
        for i in 0..p {
            for (sign, m) in [(1.0, 2 * p + i), (-1.0, 3 * p + i)] {
                entries.extend([(p + i, m, sign), (m, p + i, -sign), (m, i, self.friction[i])]);
            }
        }
        let mut q: Vec<f64> = self.free.iter().map(|w| -w).collect();
        q.resize(4 * p, 0.0);
        let matrix = Matrix::from_triplets(4 * p, 4 * p, &entries)?;
        let mut lower = vec![0.0; 4 * p];
        lower[p..2 * p].fill(f64::NEG_INFINITY);
        let function = AffineFunction::new(matrix, q)?;
        Ok(Mcp::new(function, lower, vec![f64::INFINITY; 4 * p])?)
    }

    /// A start of the conditions from forces.
    fn start(&self, forces: &[f64]) -> Vec<f64> {
        let mut slip = self.free[self.p..].to_vec();
        let mut product = vec![0.0; 2 * self.p];
        self.compliance.mul_vec(forces, &mut product);
        slip.iter_mut().zip(&product[self.p..]).for_each(|(w, c)| *w -= c);
        let mut x = forces.to_vec();
        x.extend(slip.iter().map(|s| s.max(0.0)));
        x.extend(slip.iter().map(|s| (-s).max(0.0)));
        x
    }

    /// ‖λ − P(λ − G(λ))‖∞ with the projection P on K(λ), the natural residual of a QVI.
    fn residual(&self, forces: &[f64]) -> f64 {
        let mut g = vec![0.0; 2 * self.p];
        self.compliance.mul_vec(forces, &mut g);
        g.iter_mut().zip(&self.free).for_each(|(g, w)| *g -= w);
        let gap = |i: usize| match i < self.p {
            true => forces[i] - (forces[i] - g[i]).max(0.0),
            false => {
                let bound = (self.friction[i - self.p] * forces[i - self.p]).max(0.0);
                forces[i] - (forces[i] - g[i]).clamp(-bound, bound)
            }
        };
        (0..2 * self.p).map(|i| gap(i).abs()).fold(0.0, f64::max)
    }

    /// Solves the VI over fixed K(λ), Tresca friction, repeatedly; returns how often.
    fn by_given_bounds(&self, forces: &mut [f64]) -> Outcome<usize> {
        let mut solver = ViSolver::default();
        for count in 1..=1000 {
            let bound = |i: usize| self.friction[i] * forces[i].max(0.0);
            let mut lower = vec![0.0; self.p];
            lower.extend((0..self.p).map(|i| -bound(i)));
            let mut upper = vec![f64::INFINITY; self.p];
            upper.extend((0..self.p).map(bound));
            let set = Polyhedron::boxed(lower, upper)?;
            let mut next = forces.to_vec();
            let report = solver.solve(&Vi::new(self.function()?, set)?, &mut next)?;
            ensure(report.is_solved(), "friction of Tresca has a solution")?;
            let change = distance(&next, forces);
            forces.copy_from_slice(&next);
            if change <= 1e-13 * forces.iter().fold(0.0, |m: f64, f| m.max(f.abs())) {
                return Ok(count);
            }
        }
        Err("the sequence of VIs over fixed sets does not converge".into())
    }
}

fn body(arguments: &Arguments) -> Outcome<()> {
    let friction = FrictionCurve::constant(arguments.friction)?;
    let law = PlanarCoulomb::new(FrictionCoefficient::uniform(friction));
    let (problem, _) = plane(arguments.cells, law)?;
    let forces = Forces::new(&problem, 0.0)?;
    let p = forces.p;
    println!("friction: {p} contact nodes, F = {}", arguments.friction);

    let own = problem.solve_reported(0.0, None)?.x;
    let largest = own.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
    let start = problem.stick_start(0.0)?;
    let limits = FixedPointOptions::default().with_max_iterations(1000);
    let iterated = fixed_point(&problem, &start, &limits)?;

    let mut x = vec![0.0; 4 * p];
    let mut solver = McpSolver::default();
    let conditions = solver.solve(&forces.conditions()?, &mut x)?;
    ensure(conditions.is_solved(), "the conditions of the QVI are solved")?;
    let mut sets = vec![0.0; 2 * p];
    let count = forces.by_given_bounds(&mut sets)?;

    println!("  route                                  steps   off by  residual");
    let routes = [
        (
            "conditions of the QVI, MCP solver",
            conditions.iterations,
            &x[..2 * p],
        ),
        ("VIs over one set after the other", count, &sets[..]),
        (
            "the crate's fixed point",
            iterated.iterations(),
            &iterated.x[..2 * p],
        ),
    ];
    println!(
        "  {:37}  {:>5}  {:>7}  {:8.1e}",
        "the crate's contact",
        "",
        "",
        forces.residual(&own[..2 * p])
    );
    for (name, steps, found) in routes {
        let off = distance(found, &own[..2 * p]) / largest;
        let residual = forces.residual(found);
        println!("  {name:37}  {steps:5}  {off:7.1e}  {residual:8.1e}");
        // The fixed-point iteration ends where its changes are 1e-10 or rounding.
        ensure(
            off < 1e-8 && residual < 1e-8 * largest,
            "contact with friction is its QVI",
        )?;
    }

    // The same cones, fixed.
    let rows = (0..p).flat_map(|i| {
        let f = forces.friction[i];
        [
            (2 * i, p + i, 1.0),
            (2 * i, i, -f),
            (2 * i + 1, p + i, -1.0),
            (2 * i + 1, i, -f),
        ]
    });
    let rows = Matrix::from_triplets(2 * p, 2 * p, &rows.collect::<Vec<_>>())?;
    let set = Polyhedron::space(2 * p)?.with_inequalities(rows, vec![0.0; 2 * p])?;
    let mut cone = vec![0.0; 2 * p];
    let report = ViSolver::default().solve(&Vi::new(forces.function()?, set)?, &mut cone)?;
    let off = distance(&cone, &own[..2 * p]) / largest;
    println!("  the VI over the fixed cones: off by {off:.1e}");
    ensure(
        report.is_solved() && off > 1e-3,
        "the VI over the fixed cones is another problem",
    )
}

/// Seventeen solutions.
fn three_nodes(starts: usize) -> Outcome<()> {
    let problem = five_branches()?.condensed()?;
    let forces = Forces::new(&problem, 0.0)?;
    let list = all_solutions(&problem, 0.0, &EnumerationOptions::default())?;
    let n = 2 * forces.p;
    let conditions = forces.conditions()?;
    let mut solver = McpSolver::default();
    let (mut worst, mut kept) = (0.0_f64, 0);
    for solution in &list.solutions {
        let known = &solution.x[..n];
        worst = worst.max(forces.residual(known));
        let mut x = forces.start(known);
        let report = solver.solve(&conditions, &mut x)?;
        kept += usize::from(report.is_solved() && distance(&x[..n], known) < 1e-9);
    }
    // Any solution that is found must be on the list.
    let mut random = Random::new(1);
    let mut met = vec![false; list.solutions.len()];
    let (mut solved, mut unknown) = (0, 0);
    for _ in 0..starts {
        let mut x = forces.start(&(0..n).map(|_| 5.0 * random.symmetric()).collect::<Vec<_>>());
        if !solver.solve(&conditions, &mut x)?.is_solved() {
            continue;
        }
        solved += 1;
        match list
            .solutions
            .iter()
            .position(|s| distance(&s.x[..n], &x[..n]) < 1e-6)
        {
            Some(k) => met[k] = true,
            None => unknown += 1,
        }
    }
    println!(
        "friction of three nodes: {} solutions, {}; residuals of the QVI at most {worst:.1e}; {kept} kept by its conditions",
        list.solutions.len(),
        list.completeness
    );
    println!(
        "  from {starts} random starts {solved} solved, {} of the solutions met, {unknown} others",
        met.iter().filter(|m| **m).count()
    );
    ensure(
        list.solutions.len() == 17 && kept == 17 && worst < 1e-12 && unknown == 0,
        "the QVI has the seventeen solutions of the contact problem and no other",
    )
}

/// A game: player i pays ½ qᵢᵢ xᵢ² + xᵢ (cᵢ + Σ_{j≠i} qᵢⱼ xⱼ) for xᵢ ≥ 0, and A x ≤ b is shared.
struct Game<const N: usize> {
    q: [[f64; N]; N],
    c: [f64; N],
    a: Vec<[f64; N]>,
    b: Vec<f64>,
}

/// A generalised Nash equilibrium, or how far from one.
struct Verdict {
    /// Largest distance of a player from the best answer to the others.
    off: f64,
    /// Of each player, for each shared constraint.
    multipliers: Vec<Vec<f64>>,
}

impl Verdict {
    fn is_equilibrium(&self) -> bool {
        self.off < 1e-9
    }

    /// Whether all players have the same multipliers.
    fn is_variational(&self) -> bool {
        let first = &self.multipliers[0];
        let scale = self.multipliers.iter().flatten().fold(0.0, |m: f64, v| m.max(*v));
        self.multipliers
            .iter()
            .all(|m| distance(m, first) <= 1e-8 * scale)
    }

    fn kind(&self) -> &'static str {
        match (self.is_equilibrium(), self.is_variational()) {
            (false, _) => "no equilibrium",
            (true, true) => "variational",
            (true, false) => "not variational",
        }
    }
}

impl<const N: usize> Game<N> {
    /// The equilibrium at which the multipliers of player i are those of the VI over weightᵢ.
    fn solve(&self, weights: [f64; N]) -> Outcome<[f64; N]> {
        let rows: Vec<[f64; N]> = (0..N).map(|i| self.q[i].map(|q| weights[i] * q)).collect();
        let c = (0..N).map(|i| weights[i] * self.c[i]).collect();
        let function = AffineFunction::new(Matrix::from_rows(&rows)?, c)?;
        let set = Polyhedron::boxed(vec![0.0; N], vec![f64::INFINITY; N])?
            .with_inequalities(Matrix::from_rows(&self.a)?, self.b.clone())?;
        let mut x = [1.0; N];
        let report = ViSolver::default().solve(&Vi::new(function, set)?, &mut x)?;
        ensure(
            report.is_solved(),
            "the game has the equilibrium of these weights",
        )?;
        Ok(x)
    }

    /// Solves each player's own problem with the decisions of the others fixed.
    fn judge(&self, x: &[f64; N]) -> Outcome<Verdict> {
        let mut verdict = Verdict {
            off: 0.0,
            multipliers: Vec::new(),
        };
        for i in 0..N {
            let others = |row: &[f64; N]| (0..N).filter(|j| *j != i).map(|j| row[j] * x[j]).sum::<f64>();
            let own = Matrix::from_rows(&[[self.q[i][i]]])?;
            let function = AffineFunction::new(own, vec![self.c[i] + others(&self.q[i])])?;
            let rows: Vec<[f64; 1]> = self.a.iter().map(|row| [row[i]]).collect();
            let left = self
                .a
                .iter()
                .zip(&self.b)
                .map(|(row, b)| b - others(row))
                .collect();
            let set = Polyhedron::boxed(vec![0.0], vec![f64::INFINITY])?
                .with_inequalities(Matrix::from_rows(&rows)?, left)?;
            let mut best = [x[i]];
            let report = ViSolver::default().solve(&Vi::new(function, set)?, &mut best)?;
            ensure(report.is_solved(), "a player has a best answer")?;
            verdict.off = verdict.off.max((best[0] - x[i]).abs());
            verdict.multipliers.push(report.multipliers.inequalities);
        }
        Ok(verdict)
    }

    fn print(&self, weights: &str, x: &[f64; N]) -> Outcome<Verdict> {
        let verdict = self.judge(x)?;
        let first: Vec<f64> = verdict.multipliers.iter().map(|m| m[0]).collect();
        println!(
            "  {weights:12}  {:32}  {:8.1e}  {:32}  {}",
            short_list(x),
            verdict.off,
            short_list(&first),
            verdict.kind()
        );
        Ok(verdict)
    }
}

const HEAD: &str =
    "  weights       decisions                         off by     multipliers of the first constraint";

/// (x₁ − 1)² and (x₂ − ½)² with x₁ + x₂ ≤ 1: the equilibria are (s, 1 − s) with ½ ≤ s ≤ 1, the variational one has s = ¾.
fn two_players() -> Outcome<()> {
    let game = Game {
        q: [[2.0, 0.0], [0.0, 2.0]],
        c: [-2.0, -1.0],
        a: vec![[1.0, 1.0]],
        b: vec![1.0],
    };
    println!("two players with a shared constraint\n{HEAD}");
    for weights in [[1.0, 1.0], [1.0, 3.0], [4.0, 1.0]] {
        let x = game.solve(weights)?;
        let verdict = game.print(&list(&weights, 0), &x)?;
        let s = (2.0 * weights[0] + weights[1]) / (2.0 * weights[0] + 2.0 * weights[1]);
        ensure(
            (x[0] - s).abs() < 1e-12 && (x[1] - (1.0 - s)).abs() < 1e-12 && verdict.is_equilibrium(),
            "the equilibrium of these weights is the one in closed form",
        )?;
        ensure(
            verdict.is_variational() == (weights[0] == weights[1]),
            "the equilibrium is variational where the weights are equal, and nowhere else",
        )?;
    }
    let outside = game.print("none", &[0.4, 0.6])?;
    ensure(!outside.is_equilibrium(), "(s, 1 − s) with s < ½ is none")
}

/// Three factories at a river: profits (3 − 0.01 Σx) xⱼ − (cⱼ + dⱼ xⱼ) xⱼ, and two limits of pollution.
fn river() -> Outcome<()> {
    let (cost, growth) = ([0.1, 0.12, 0.15], [0.01, 0.05, 0.01]);
    let emitted = [0.5, 0.25, 0.75];
    let decay = [[6.5, 5.0, 5.5], [4.583, 6.25, 3.75]];
    let slope = |i: usize, j: usize| if i == j { 0.02 + 2.0 * growth[i] } else { 0.01 };
    let game = Game {
        q: std::array::from_fn(|i| std::array::from_fn(|j| slope(i, j))),
        c: cost.map(|c| c - 3.0),
        a: decay
            .map(|row| std::array::from_fn(|j| row[j] * emitted[j]))
            .to_vec(),
        b: vec![100.0; 2],
    };
    println!("three factories at a river\n{HEAD}");
    for weights in [[1.0; 3], [2.0, 1.0, 1.0], [1.0, 1.0, 5.0]] {
        let x = game.solve(weights)?;
        let verdict = game.print(&list(&weights, 0), &x)?;
        ensure(verdict.is_equilibrium(), "no factory gains by another decision")?;
        ensure(
            verdict.is_variational() == (weights == [1.0; 3]),
            "the equilibrium is variational where the weights are equal, and nowhere else",
        )?;
        if weights == [1.0; 3] {
            // The published solution has an error of the method that found it.
            ensure(
                distance(&x, &[21.149, 16.028, 2.722]) < 1e-2,
                "the variational equilibrium is the published one",
            )?;
        }
    }
    Ok(())
}
