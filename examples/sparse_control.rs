//! Optimal control with a sparse control: heat sources u that act on small parts of a square only.
//!
//! −Δy = u in the unit square, y = 0 on its boundary, and J = ½‖y − y_d‖² + ν/2 ‖u‖² + β ‖u‖_L¹ is minimised over −30 ≤ u ≤ 30, with
//! y_d = sin(2πx₁) sin(2πx₂) e^(2x₁)/6, ν = 1e-5, β = 1e-3 (G. Stadler, Comput. Optim. Appl. 44 (2009), Example 1). With the adjoint state
//! A p = y − y_d the control is u = mid(−30, −(p − mid(−β, p, β))/ν, 30): a semismooth equation in (y, p), solved by inexact Newton steps,
//! MINRES and multigrid on nested grids.
//!
//! You will see that the numbers of Newton steps do not grow as the grid is refined, from a fixed start and from the coarser grid;
//! J, ‖u‖_L¹, where u = 0, and in `out/sparse_control.svg` the control itself (red: source, blue: sink, grey: nothing). The coarsest
//! level is compared with an accelerated proximal gradient method (FISTA; Beck, Teboulle 2009).
//!
//! ```text
//! cargo run --release --example sparse_control -- --coarsest 63 --levels 4
//! ```

#[macro_use]
mod common;
#[path = "common/grids.rs"]
mod grids;
#[path = "common/raster.rs"]
mod raster;

use std::f64::consts::PI;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, distance, ensure, exit, file_in, growth};
use grids::{apply_five_point, bilinear, five_point, nested_grids};
use raster::{UNIT, blend, raster, square, with_classes};
use semismooth::linear::{
    Cholesky, KrylovMethod, LinearError, LinearOperator, LinearSolver, Multigrid, Preconditioner,
    Prolongation,
};
use semismooth::newton::{NewtonKrylov, NewtonKrylovOptions, Report};
use semismooth::output::{Colour, Panel};
use semismooth::piecewise::MatrixFree;
use semismooth::sparse::Matrix;

#[derive(Parser)]
#[command(about = "Sparse optimal control of a Poisson equation on nested grids")]
struct Arguments {
    /// Points a side of the coarsest grid, 2ᵏ − 1 (7 to 1023).
    #[arg(long, default_value_t = 63)]
    coarsest: usize,
    /// Number of grids, each with twice the lines.
    #[arg(long, default_value_t = 5)]
    levels: usize,
    /// Four grids from 15 points a side on.
    #[arg(long)]
    small: bool,
    /// Folder for the picture.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

const NU: f64 = 1e-5;
const BETA: f64 = 1e-3;
const BOUND: f64 = 30.0;

/// Largest increase of the number of Newton steps from the coarsest to the finest grid.
const GROWTH: usize = 2;

/// The control that belongs to an adjoint state.
fn control(p: f64) -> f64 {
    (-(p - p.clamp(-BETA, BETA)) / NU).clamp(-BOUND, BOUND)
}

/// The optimality conditions in x = (y, p/√ν), with K = −√ν Δ: y − y_d − K p/√ν = 0 and √ν u(p) − K y = 0. Scaled so, their derivative
/// [I, −K; −K, −D] is symmetric; D is 1 where u is neither 0 nor at a bound. diag(I, (K + D)²) is spectrally close to the blocks
/// diag(I, K² + D) of a block elimination, uniformly in ν and h (J. W. Pearson, A. J. Wathen, 2012).
pub(crate) struct Control {
    m: usize,
    target: Vec<f64>,
    /// √ν/h².
    scale: f64,
    free: Vec<bool>,
    /// K + D, and where its diagonal is.
    near: Matrix,
    diagonal: Vec<usize>,
    multigrid: Multigrid,
}

impl Control {
    pub(crate) fn new(m: usize) -> Outcome<Self> {
        let h = 1.0 / (m + 1) as f64;
        let scale = NU.sqrt() / (h * h);
        let mut near = five_point(m)?;
        near.values_mut().iter_mut().for_each(|v| *v *= scale);
        let place = |k| near.pattern().slot(k, k).ok_or("no diagonal");
        let diagonal = (0..m * m).map(place).collect::<Result<_, _>>()?;
        let point = |k: usize| ((k % m + 1) as f64 * h, (k / m + 1) as f64 * h);
        let target = |(x, y): (f64, f64)| (2.0 * PI * x).sin() * (2.0 * PI * y).sin() * (2.0 * x).exp() / 6.0;
        Ok(Self {
            m,
            target: (0..m * m).map(|k| target(point(k))).collect(),
            scale,
            free: vec![false; m * m],
            near,
            diagonal,
            multigrid: Multigrid::with_prolongations(nested_grids(m)?),
        })
    }

    fn points(&self) -> usize {
        self.m * self.m
    }

    /// J, ‖u‖_L¹ and the share of points with u = 0, of a state and a control.
    fn values(&self, y: &[f64], u: &[f64]) -> (f64, f64, f64) {
        let area = 1.0 / ((self.m + 1) * (self.m + 1)) as f64;
        let misfit: f64 = y.iter().zip(&self.target).map(|(y, d)| (y - d).powi(2)).sum();
        let (square, size) = u.iter().fold((0.0, 0.0), |(s, t), u| (s + u * u, t + u.abs()));
        let zeros = u.iter().filter(|u| **u == 0.0).count();
        let j = area * (0.5 * misfit + 0.5 * NU * square + BETA * size);
        (j, area * size, zeros as f64 / u.len() as f64)
    }

    fn control(&self, x: &[f64]) -> Vec<f64> {
        x[self.points()..]
            .iter()
            .map(|p| control(p * NU.sqrt()))
            .collect()
    }
}

impl LinearOperator for Control {
    fn order(&self) -> usize {
        2 * self.points()
    }

    fn product(&mut self, v: &[f64], out: &mut [f64]) {
        let (y, p) = v.split_at(self.points());
        let (first, second) = out.split_at_mut(self.points());
        apply_five_point(self.m, -self.scale, p, first);
        first.iter_mut().zip(y).for_each(|(out, y)| *out += y);
        apply_five_point(self.m, -self.scale, y, second);
        for ((out, p), free) in second.iter_mut().zip(p).zip(&self.free) {
            *out -= if *free { *p } else { 0.0 };
        }
    }

    fn transpose_product(&mut self, v: &[f64], out: &mut [f64]) -> bool {
        self.product(v, out);
        true
    }

    fn precondition(&mut self, b: &mut [f64]) -> Result<(), LinearError> {
        let second = &mut b[self.m * self.m..];
        self.multigrid.apply(second)?;
        self.multigrid.apply(second)
    }
}

impl MatrixFree for Control {
    fn residual(&mut self, x: &[f64], out: &mut [f64]) {
        let (y, p) = x.split_at(self.points());
        let (first, second) = out.split_at_mut(self.points());
        apply_five_point(self.m, -self.scale, p, first);
        for ((out, y), d) in first.iter_mut().zip(y).zip(&self.target) {
            *out += y - d;
        }
        apply_five_point(self.m, -self.scale, y, second);
        for (out, p) in second.iter_mut().zip(p) {
            *out += NU.sqrt() * control(p * NU.sqrt());
        }
    }

    fn linearize(&mut self, x: &[f64]) -> Result<(), LinearError> {
        let p = &x[self.m * self.m..];
        for ((free, p), &slot) in self.free.iter_mut().zip(p).zip(&self.diagonal) {
            let size = (p * NU.sqrt()).abs();
            *free = size > BETA && size < BETA + NU * BOUND;
            self.near.values_mut()[slot] = 4.0 * self.scale + f64::from(*free);
        }
        self.multigrid.prepare(self.near.as_ref())
    }
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let (coarsest, levels) = match arguments.small {
        true => (15, 4),
        false => (arguments.coarsest, arguments.levels),
    };
    let finest = (coarsest + 1) << levels.saturating_sub(1);
    if !(coarsest + 1).is_power_of_two() || coarsest < 7 || levels == 0 || finest > 4096 {
        return Err(format!("--coarsest {coarsest} --levels {levels}: a power of two less 1, at least 7; the finest grid has at most 4095 points a side").into());
    }
    println!("             from 0        from the coarser                                       share of");
    println!("    m   Newton  MINRES  Newton  MINRES  residual            J    ‖u‖_L¹     u = 0   seconds");
    let (mut fixed, mut nested, mut costs) = (Vec::new(), Vec::new(), Vec::new());
    let mut coarse: Option<Vec<f64>> = None;
    let mut m = coarsest;
    for level in 0..levels {
        let mut problem = Control::new(m)?;
        let mut newton = NewtonKrylov::new(
            NewtonKrylovOptions::default()
                .with_method(KrylovMethod::Minres)
                .with_first_forcing(0.1)
                .with_relative_tolerance(1e-10),
        );
        let mut x = vec![0.0; problem.order()];
        let begin = Instant::now();
        newton.solve(&mut problem, &mut x)?;
        let mut seconds = begin.elapsed().as_secs_f64();
        let from_zero = count(newton.report());
        let mut line = format!("{m:5}   {:6}  {:6}", from_zero.0, from_zero.1);
        fixed.push(from_zero.0);
        if let Some(coarse) = coarse {
            let mut start = prolong(m, &coarse)?;
            let begin = Instant::now();
            newton.solve(&mut problem, &mut start)?;
            seconds = begin.elapsed().as_secs_f64();
            let from_coarse = count(newton.report());
            line += &format!("  {:6}  {:6}", from_coarse.0, from_coarse.1);
            nested.push(from_coarse.0);
            let (one, two) = (problem.control(&x), problem.control(&start));
            ensure(distance(&one, &two) < 1e-3, "both starts lead to one control")?;
            x = start;
        } else {
            line += "               –";
        }
        let u = problem.control(&x);
        let (j, size, zeros) = problem.values(&x[..m * m], &u);
        println!(
            "{line}  {:8.1e}  {j:.8}  {size:.6}  {:6.2} %  {seconds:8.2}",
            newton.report().residual_norm(),
            100.0 * zeros
        );
        costs.push(j);
        if level == 0 {
            compare(&problem, &u, j)?;
        }
        if level + 1 == levels {
            draw(arguments, m, &u)?;
        } else {
            m = 2 * m + 1;
        }
        coarse = Some(x);
    }
    ensure(
        growth(&fixed) <= GROWTH && growth(&nested) <= GROWTH,
        "the number of Newton steps does not grow with refinement",
    )?;
    let steps: Vec<f64> = costs.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    ensure(
        steps.windows(2).all(|w| w[1] < 0.5 * w[0]),
        "J converges as the grid is refined",
    )
}

/// Newton steps, and iterations of the Krylov method in all of them.
fn count(report: &Report) -> (usize, usize) {
    let linear = report.history.iter().map(|i| i.linear_iterations).sum();
    (report.history.len() - 1, linear)
}

/// State and adjoint state on the next finer grid.
fn prolong(m: usize, coarse: &[f64]) -> Outcome<Vec<f64>> {
    let p = Prolongation::new(&bilinear(m)?)?;
    let mut fine = vec![0.0; 2 * m * m];
    for (fine, coarse) in fine
        .chunks_exact_mut(m * m)
        .zip(coarse.chunks_exact(coarse.len() / 2))
    {
        p.prolong(coarse, fine);
    }
    Ok(fine)
}

/// The problem in u alone by accelerated proximal gradients, with a factorisation of the matrix: another method for the same control.
fn compare(problem: &Control, u: &[f64], j: f64) -> Outcome<()> {
    let m = problem.m;
    let h2 = 1.0 / ((m + 1) * (m + 1)) as f64;
    let a = five_point(m)?;
    let mut poisson = Cholesky::new();
    poisson.analyze(a.pattern().as_ref())?;
    poisson.factor(a.as_ref())?;
    let mut solve = |v: &mut [f64]| -> Outcome<()> {
        v.iter_mut().for_each(|v| *v *= h2);
        Ok(poisson.solve_in_place(v)?)
    };
    // The least eigenvalue of −Δ on this grid.
    let least = 8.0 / h2 * (0.5 * PI * h2.sqrt()).sin().powi(2);
    let lipschitz = 1.0 / (least * least) + NU;
    let momentum = (lipschitz.sqrt() - NU.sqrt()) / (lipschitz.sqrt() + NU.sqrt());
    let (mut v, mut old) = (vec![0.0; m * m], vec![0.0; m * m]);
    let mut steps = 0;
    let y = loop {
        let mut y = v.clone();
        solve(&mut y)?;
        let mut p: Vec<f64> = y.iter().zip(&problem.target).map(|(y, d)| y - d).collect();
        solve(&mut p)?;
        let mut change = 0.0_f64;
        for k in 0..m * m {
            let step = v[k] - (p[k] + NU * v[k]) / lipschitz;
            let shrunk = step - step.clamp(-BETA / lipschitz, BETA / lipschitz);
            let new = shrunk.clamp(-BOUND, BOUND);
            change = change.max((new - old[k]).abs());
            v[k] = new + momentum * (new - old[k]);
            old[k] = new;
        }
        steps += 1;
        if change < 1e-9 || steps == 5000 {
            y = old.clone();
            solve(&mut y)?;
            break y;
        }
    };
    let other = problem.values(&y, &old).0;
    println!(
        "      FISTA on this grid: {steps} steps, J differs by {:.1e}, u by at most {:.1e}",
        (j - other).abs(),
        distance(u, &old)
    );
    ensure(
        (j - other).abs() < 1e-10 * j && distance(u, &old) < 1e-5,
        "FISTA leads to the same control",
    )
}

fn draw(arguments: &Arguments, m: usize, u: &[f64]) -> Outcome<()> {
    const NOTHING: Colour = Colour::new(0xf0, 0xf0, 0xf0);
    let shade = |u: f64| match u {
        0.0 => NOTHING,
        _ => blend(
            NOTHING,
            if u > 0.0 { Colour::RED } else { Colour::BLUE },
            0.2 + 0.8 * u.abs() / BOUND,
        ),
    };
    let panel = raster(Panel::new("x", "y"), m, UNIT, |k| Some(shade(u[k])));
    let classes = [
        ("source, to the bound", Colour::RED),
        ("sink, to the bound", Colour::BLUE),
        ("no control", NOTHING),
    ];
    let path = file_in(&arguments.out, "sparse_control.svg")?;
    square(
        with_classes(panel, &classes),
        "Sparse control of a Poisson equation",
    )
    .write(&path)?;
    println!("{}", path.display());
    Ok(())
}
