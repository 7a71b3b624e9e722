//! Optimal control with a bound on the temperature: sources u are to heat a square to a desired state, but nowhere above ψ.
//!
//! −Δy = u in the unit square, y = 0 on its boundary, ½‖y − y_d‖² + ν/2 ‖u‖² minimised over y ≤ ψ, with y_d = sin(2πx₁) sin(2πx₂)
//! e^(2x₁)/6, ν = 1e-5, ψ = 0.1. The multiplier of y ≤ ψ is a measure, not a function; Moreau–Yosida regularisation replaces it by
//! γ (y − ψ)₊, and γ → ∞ is a path (M. Hintermüller, K. Kunisch, SIAM J. Optim. 17 (2006)): y − y_d + γ (y − ψ)₊ + ν Δ²y = 0, a
//! piecewise-smooth map with one site per point, and log₁₀ γ as its parameter. The crate follows it through every change of the active set.
//! On each grid, γ is fixed beforehand.
//!
//! You will see the path with the numbers of active points and by how much ψ is exceeded, which falls like 1/γ; its end compared with the
//! solution of the problem without γ, a complementarity problem; and that Newton steps do not grow with refinement, at γ = 10 from a fixed
//! start and from the coarser grid, at γ = 1e4 from the coarser grid.
//! `out/state_constraints.svg` shows the state (darker: warmer) and where it is at its bound (red).
//!
//! ```text
//! cargo run --release --example state_constraints -- --path 31 --levels 5
//! ```

#[macro_use]
mod common;
#[path = "common/grids.rs"]
mod grids;
#[path = "common/raster.rs"]
mod raster;

use std::f64::consts::{LN_10, PI};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, distance, ensure, exit, file_in, growth};
use grids::{bilinear, five_point};
use raster::{UNIT, blend, raster, square, with_classes};
use semismooth::complementarity::Lcp;
use semismooth::complementarity::active_set::{ActiveSetOptions, ActiveSetSolver, DirectReduced};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::linear::{Cholesky, Prolongation};
use semismooth::newton::{Newton, NewtonOptions};
use semismooth::output::{Colour, Panel};
use semismooth::piecewise::{Derivatives, Facet, PiecewiseSmooth, Selection, Structure};
use semismooth::run::Status;
use semismooth::sparse::{Matrix, Pattern};

#[derive(Parser)]
#[command(about = "Control with a bound on the state: Moreau-Yosida path and mesh independence")]
struct Arguments {
    /// Points a side of the grid of the path, 2ᵏ − 1 (7 to 63).
    #[arg(long, default_value_t = 31)]
    path: usize,
    /// Number of grids at fixed γ, from 15 points a side on (2 to 6).
    #[arg(long, default_value_t = 5)]
    levels: usize,
    /// A path on 15 points a side, four grids.
    #[arg(long)]
    small: bool,
    /// Folder for the picture.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

const NU: f64 = 1e-5;
const BOUND: f64 = 0.1;
/// log₁₀ γ at the ends of the path.
const FIRST: f64 = -2.0;
const LAST: f64 = 8.0;

/// Largest increase of the number of Newton steps from the coarsest to the finest grid.
const GROWTH: usize = 2;

/// H(y, s) = (I + ν Δ²) y − y_d + 10ˢ (y − ψ)₊.
pub(crate) struct Yosida {
    m: usize,
    /// I + ν Δ².
    stiffness: Matrix,
    target: Vec<f64>,
}

impl Yosida {
    pub(crate) fn new(m: usize) -> Outcome<Self> {
        let h = 1.0 / (m + 1) as f64;
        let laplacian = five_point(m)?;
        let columns: Vec<Vec<(usize, f64)>> = {
            let mut columns = vec![Vec::new(); m * m];
            laplacian.triplets().for_each(|(i, j, v)| columns[j].push((i, v)));
            columns
        };
        let mut entries = Vec::with_capacity(26 * m * m);
        for (j, column) in columns.iter().enumerate() {
            entries.push((j, j, 1.0));
            for &(k, v) in column {
                entries.extend(columns[k].iter().map(|&(i, w)| (i, j, NU / h.powi(4) * v * w)));
            }
        }
        let target = |k: usize| {
            let (x, y) = ((k % m + 1) as f64 * h, (k / m + 1) as f64 * h);
            (2.0 * PI * x).sin() * (2.0 * PI * y).sin() * (2.0 * x).exp() / 6.0
        };
        Ok(Self {
            m,
            stiffness: Matrix::from_triplets(m * m, m * m, &entries)?,
            target: (0..m * m).map(target).collect(),
        })
    }

    fn points(&self) -> usize {
        self.m * self.m
    }

    /// min ½ yᵀ (I + ν Δ²) y − y_dᵀ y over y ≤ ψ itself, by active sets.
    fn limit(&self) -> Outcome<Vec<f64>> {
        let n = self.points();
        let q = self.target.iter().map(|d| -d).collect();
        let lcp = Lcp::boxed(
            self.stiffness.clone(),
            q,
            vec![f64::NEG_INFINITY; n],
            vec![BOUND; n],
        )?;
        let mut y = vec![0.0; n];
        let mut solver = ActiveSetSolver::with_reduced(ActiveSetOptions::default(), DirectReduced::new());
        match solver.solve(&lcp, &mut y)?.status {
            Status::Solved => Ok(y),
            other => Err(format!("the problem without γ is not solved: {other}").into()),
        }
    }
}

impl PiecewiseSmooth for Yosida {
    fn num_vars(&self) -> usize {
        self.points() + 1
    }
    fn num_residuals(&self) -> usize {
        self.points()
    }
    fn num_sites(&self) -> usize {
        self.points()
    }
    fn num_pieces(&self, _: usize) -> usize {
        2
    }
    fn num_tests(&self, _: usize) -> usize {
        1
    }
    fn cell(&self, _: usize, piece: usize) -> &[Facet] {
        const CELLS: [[Facet; 1]; 2] = [[Facet::negative(0)], [Facet::positive(0)]];
        &CELLS[piece]
    }
    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        out.iter_mut().zip(x).for_each(|(t, y)| *t = y - BOUND);
    }
    fn residual(&self, s: &Selection, x: &[f64], out: &mut [f64]) {
        let (y, gamma) = (&x[..self.points()], 10_f64.powf(x[self.points()]));
        self.stiffness.mul_vec(y, out);
        for (k, out) in out.iter_mut().enumerate() {
            *out += s.piece(k) as f64 * gamma * (y[k] - BOUND) - self.target[k];
        }
    }
    fn jacobian(&self, s: &Selection, x: &[f64], jac: &mut Matrix) {
        let n = self.points();
        jac.add_block(0, 0, 1.0, &self.stiffness);
        let gamma = 10_f64.powf(x[n]);
        for k in (0..n).filter(|&k| s.piece(k) == 1) {
            jac.add(k, k, gamma);
            jac.add(k, n, LN_10 * gamma * (x[k] - BOUND));
        }
    }
    fn pattern(&self) -> Pattern {
        let n = self.points();
        let entries = self.stiffness.triplets().map(|(i, j, _)| (i, j));
        Pattern::from_entries(n, n + 1, entries.chain((0..n).map(|k| (k, n))))
            .unwrap_or_else(|_| Pattern::full(n, n + 1))
    }
    fn derivatives(&self) -> Option<&dyn Derivatives> {
        Some(self)
    }
    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }
}

impl Derivatives for Yosida {
    fn test_derivatives(&self, _: &[f64], d: &[f64], out: &mut [f64]) {
        out.copy_from_slice(&d[..self.points()]);
    }
    fn test_gradient(&self, site: usize, _: usize, _: &[f64], gradient: &mut [f64]) {
        gradient.fill(0.0);
        gradient[site] = 1.0;
    }
}

impl Structure for Yosida {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.push(site);
    }
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let (path, levels) = match arguments.small {
        true => (15, 4),
        false => (arguments.path, arguments.levels),
    };
    if !(path + 1).is_power_of_two() || !(7..=63).contains(&path) || !(2..=6).contains(&levels) {
        return Err("--path is a power of two less 1 from 7 to 63, --levels goes from 2 to 6".into());
    }
    follow(arguments, path)?;
    // From the fixed start the number grows where γ is large: y − ψ is then as irregular as the multiplier, and the active set shrinks by
    // layers of points. Paths and coarser grids avoid this.
    refine(levels, 1.0, true)?;
    refine(levels, 4.0, false)
}

fn largest_excess(y: &[f64]) -> f64 {
    y.iter().fold(0.0, |m, y| f64::max(m, y - BOUND))
}

/// The path on one grid, from no active point to nearly no violation of the bound.
fn follow(arguments: &Arguments, m: usize) -> Outcome<()> {
    let map = Yosida::new(m)?;
    let n = map.points();
    let mut x = vec![0.0; n + 1];
    x[n] = FIRST;
    Newton::new(NewtonOptions::default()).solve(&map, &mut x)?;
    let targets: Vec<f64> = (FIRST as i32 + 2..LAST as i32)
        .step_by(2)
        .map(f64::from)
        .collect();
    let options = ContinuationOptions::default()
        .with_parameter_range((FIRST, LAST))
        .with_max_step(1.0)
        .with_targets(targets.clone());
    let begin = Instant::now();
    let branch = Branch::follow(&map, &x, Direction::Increasing, options)?;
    let seconds = begin.elapsed().as_secs_f64();
    println!(
        "path on {m} x {m} points: {} points, {} changes of the active set, {} factorisations, {seconds:.2} s; {}",
        branch.points.len(),
        branch.transitions.len(),
        branch.factorisations,
        branch.termination
    );
    println!("    γ       active   largest y − ψ   times γ");
    let mut excesses = Vec::new();
    let ends = branch.points.last().map(|p| p.x[n]);
    for point in &branch.points {
        let s = point.x[n];
        if targets.contains(&s) || Some(s) == ends {
            let y = &point.x[..n];
            let (active, excess) = (y.iter().filter(|y| **y > BOUND).count(), largest_excess(y));
            println!(
                "    1e{s:<+4.1}  {active:6}      {excess:9.2e}  {:8.4}",
                excess * 10_f64.powf(s)
            );
            excesses.push(excess);
        }
    }
    let Some(end) = branch.points.last() else {
        return Err("the path has no points".into());
    };
    let y = &end.x[..n];
    let exact = map.limit()?;
    let off = distance(y, &exact);
    let at_bound = |y: &f64| *y >= BOUND - 1e-12;
    println!(
        "    without γ: {} active; the end of the path differs by {off:.1e}",
        exact.iter().filter(|y| at_bound(y)).count()
    );
    draw(arguments, m, &exact)?;
    ensure((end.x[n] - LAST).abs() < 1e-9, "the path goes to its end")?;
    ensure(
        excesses.windows(2).all(|w| w[1] < w[0]) && excesses.len() > targets.len(),
        "ψ is exceeded by less and less",
    )?;
    ensure(
        off < 1e-6,
        "the path ends at the solution of the problem without γ",
    )
}

/// Newton steps at a fixed log₁₀ γ on finer and finer grids.
fn refine(levels: usize, s: f64, from_zero: bool) -> Outcome<()> {
    println!("γ = 1e{s:.0}   Newton steps");
    println!("    m   from 0  coarser  active   residual  seconds");
    let (mut fixed, mut nested) = (Vec::new(), Vec::new());
    let mut coarse: Option<Vec<f64>> = None;
    let mut m = 15;
    for _ in 0..levels {
        let map = Yosida::new(m)?;
        let n = map.points();
        let mut newton = Newton::with_solver(NewtonOptions::default(), Cholesky::new());
        let mut x = vec![0.0; n + 1];
        x[n] = s;
        let begin = Instant::now();
        newton.solve(&map, &mut x)?;
        let mut seconds = begin.elapsed().as_secs_f64();
        fixed.push(newton.report().history.len() - 1);
        if let Some(coarse) = &coarse {
            Prolongation::new(&bilinear(m)?)?.prolong(coarse, &mut x[..n]);
            let begin = Instant::now();
            newton.solve(&map, &mut x)?;
            seconds = begin.elapsed().as_secs_f64();
            nested.push(newton.report().history.len() - 1);
        }
        println!(
            "{m:5}   {:6}  {:>7}  {:5.2} %  {:8.1e}  {seconds:7.2}",
            fixed[fixed.len() - 1],
            nested.last().map_or("–".to_owned(), usize::to_string),
            100.0 * x[..n].iter().filter(|y| **y > BOUND).count() as f64 / n as f64,
            newton.report().residual_norm(),
        );
        x.truncate(n);
        coarse = Some(x);
        m = 2 * m + 1;
    }
    ensure(
        (!from_zero || growth(&fixed) <= GROWTH) && growth(&nested) <= GROWTH,
        "the number of Newton steps does not grow with refinement",
    )
}

fn draw(arguments: &Arguments, m: usize, y: &[f64]) -> Outcome<()> {
    let least = y.iter().fold(0.0, |a: f64, b| a.min(*b));
    const PALE: Colour = Colour::new(0xf0, 0xf4, 0xfa);
    let shade = |y: f64| match y >= BOUND - 1e-12 {
        true => Colour::RED,
        false => blend(PALE, Colour::BLUE, (y - least) / (BOUND - least)),
    };
    let panel = raster(Panel::new("x", "y"), m, UNIT, |k| Some(shade(y[k])));
    let classes = [
        ("at the bound", Colour::RED),
        ("near the bound", Colour::BLUE),
        ("least", PALE),
    ];
    let path = file_in(&arguments.out, "state_constraints.svg")?;
    square(with_classes(panel, &classes), "The state of the optimal control").write(&path)?;
    println!("{}", path.display());
    Ok(())
}
