//! Denoising of images by total variation (L. Rudin, S. Osher, E. Fatemi, Physica D 60 (1992)).
//!
//! For a noisy picture f on the unit square, u minimises ½∫(u − f)² + λ∫|∇u|. The dual variable q, with |q| ≤ λ and u = f + div q, is
//! bounded by the semismooth equation max(t, |∇u|) q = λ ∇u in each pixel, where t ≪ 1 is a threshold below which |∇u| counts as 0; a
//! primal–dual Newton method solves for both (Hintermüller, Stadler 2006), the systems in u alone by factorisation. The gap between the
//! primal and the dual value bounds the distance from the exact solution of the problem without t. A first-order method (A. Chambolle,
//! T. Pock, J. Math. Imaging Vis. 40 (2011), algorithm 2) is run to the same gap.
//!
//! The picture is rendered: balls, a box, a chequered table and a papered wall (`examples/data/still_life.pgm`), the noise comes from a
//! generator of random numbers. You will see, as t falls, Newton steps from the solution before, gaps, times and those of the other method
//! to the same gap, and the PSNR. First-order steps are cheap and suffice for viewing; each further digit costs them more and more. Then,
//! with a small term −μΔu, without which the number of Newton steps depends on the number of pixels, one noisy picture on grids of 32 to
//! 256 pixels a side. `out/total_variation.svg` has the picture, the noisy one and the denoised one.
//!
//! ```text
//! cargo run --release --example total_variation -- --pixels 256 --lambda 6e-4
//! ```

#[macro_use]
mod common;
#[path = "common/raster.rs"]
mod raster;
#[path = "common/yielding.rs"]
mod yielding;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use common::{Outcome, Random, distance, ensure, exit, file_in, growth};
use raster::{UNIT, blend, raster, with_classes};
use semismooth::linear::{KrylovMethod, LinearOperator};
use semismooth::newton::{Damping, NewtonKrylov, NewtonKrylovOptions};
use semismooth::output::{BranchDiagram, Colour, Panel};
use yielding::{Element, Weights, Yielding};

#[derive(Parser)]
#[command(about = "Denoising by total variation: semismooth Newton against Chambolle and Pock")]
struct Arguments {
    /// Pixels a side of the picture (16 to 1024, a multiple of 8).
    #[arg(long, default_value_t = 128)]
    pixels: usize,
    /// Weight of the total variation, for sides of length 1.
    #[arg(long, default_value_t = 6e-4)]
    lambda: f64,
    /// A picture of 48 pixels a side.
    #[arg(long)]
    small: bool,
    /// Folder for the pictures.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

/// Standard deviation of the noise; grey values go from 0 to 1.
const NOISE: f64 = 0.1;

/// Gradients below which |∇u| counts as 0, one after the other.
const THRESHOLDS: [f64; 5] = [1e-1, 1e-2, 1e-3, 1e-4, 1e-5];

/// Size of −μΔu where grids are refined; it makes the number of Newton steps independent of the number of pixels.
const VISCOSITY: f64 = 1e-4;
const THRESHOLD: f64 = 1e-1;
/// Squares of noise a side, where grids are refined.
const NOISY: usize = 64;
/// Largest increase of the number of Newton steps from the first grid to any other.
const GROWTH: usize = 2;

/// Grey values of `examples/data/still_life.pgm`, rows from below; `still_life.py` beside it has made it.
fn still_life() -> Outcome<(usize, Vec<f64>)> {
    let file = include_bytes!("data/still_life.pgm");
    let malformed = || "still_life.pgm is not a square picture of 8 bits in the format P5";
    let (head, rows) = file.split_at_checked(15).ok_or_else(malformed)?;
    let words: Vec<&str> = std::str::from_utf8(head)?.split_whitespace().collect();
    let ["P5", width, height, "255"] = words[..] else {
        return Err(malformed().into());
    };
    let m: usize = width.parse()?;
    if width != height || rows.len() != m * m {
        return Err(malformed().into());
    }
    let from_below = rows.chunks(m).rev().flatten();
    Ok((m, from_below.map(|v| f64::from(*v) / 255.0).collect()))
}

/// Means of n × n values over the pixels of an m × m grid on the same square.
fn resampled(values: &[f64], n: usize, m: usize) -> Vec<f64> {
    // The cells that pixel i meets, with their parts of it.
    let parts = |i: usize| {
        let (begin, end) = (i * n / m, ((i + 1) * n).div_ceil(m));
        (begin..end).map(move |k| {
            let (low, high) = ((k * m).max(i * n), ((k + 1) * m).min((i + 1) * n));
            (k, (high - low) as f64 / n as f64)
        })
    };
    let mean = |k: usize| -> f64 {
        let rows = parts(k / m);
        rows.map(|(row, a)| {
            parts(k % m)
                .map(|(col, b)| a * b * values[row * n + col])
                .sum::<f64>()
        })
        .sum()
    };
    (0..m * m).map(mean).collect()
}

/// Forward differences on m × m pixels, none across the sides.
pub(crate) struct Picture {
    m: usize,
    noisy: Vec<f64>,
    lambda: f64,
    viscosity: f64,
}

impl Picture {
    fn h(&self) -> f64 {
        1.0 / self.m as f64
    }

    pub(crate) fn equations(&self, threshold: f64) -> Outcome<Yielding> {
        let (m, h) = (self.m, self.h());
        let element = |k: usize| {
            let right = (k % m + 1 < m).then(|| k + 1);
            let above = (k / m + 1 < m).then(|| k + m);
            let side = |there: bool| if there { 1.0 / h } else { 0.0 };
            Element {
                corners: [Some(k), right, above],
                gradients: [
                    [-side(right.is_some()), -side(above.is_some())],
                    [1.0 / h, 0.0],
                    [0.0, 1.0 / h],
                ],
                area: h * h,
            }
        };
        let weights = Weights {
            mass: h * h,
            viscosity: self.viscosity,
            yield_stress: self.lambda,
            threshold,
        };
        let load = self.noisy.iter().map(|f| h * h * f).collect();
        Yielding::new((0..m * m).map(element).collect(), load, weights)
    }

    /// The value of u, and how far it lies above that of q scaled back into |q| ≤ λ, relative to it; both in units of a pixel.
    fn gap(&self, equations: &Yielding, u: &[f64], q: &[[f64; 2]]) -> (f64, f64) {
        let area = self.h() * self.h();
        let half_square =
            |a: &[f64], b: &[f64]| 0.5 * a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let mut of_dual = vec![0.0; u.len()];
        let mut variation = 0.0;
        for (element, q) in equations.elements.iter().zip(q) {
            let g = element.gradient(u);
            variation += g[0].hypot(g[1]);
            let back = (q[0].hypot(q[1]) / self.lambda).max(1.0) * area;
            element.add_divergence(q.map(|q| q / back), &mut of_dual);
        }
        let primal = half_square(u, &self.noisy) + self.lambda * variation;
        let zero = vec![0.0; u.len()];
        let dual = half_square(&self.noisy, &zero) - half_square(&self.noisy, &of_dual);
        (primal, (primal - dual) / primal)
    }

    /// ½∫(u − f)² + ½μ∫|∇u|² + λ∫|∇u|.
    fn energy(&self, equations: &Yielding, u: &[f64]) -> f64 {
        let squares: f64 = u.iter().zip(&self.noisy).map(|(u, f)| (u - f) * (u - f)).sum();
        let of_gradient = |element: &Element| {
            let g = element.gradient(u);
            let length = g[0].hypot(g[1]);
            0.5 * self.viscosity * length * length + self.lambda * length
        };
        let gradients: f64 = equations.elements.iter().map(of_gradient).sum();
        self.h() * self.h() * (0.5 * squares + gradients)
    }

    /// Chambolle and Pock's accelerated method to a gap; its iterations, u and the gap reached.
    fn first_order(&self, equations: &Yielding, gap: f64) -> (usize, Vec<f64>, f64) {
        const LIMIT: usize = 100_000;
        let (h, n) = (self.h(), self.noisy.len());
        let norm = 8.0 / (h * h);
        /// Found by trial.
        const TAU: f64 = 0.35;
        let (mut tau, mut sigma) = (TAU, 1.0 / (norm * TAU));
        let (mut u, mut beyond) = (self.noisy.clone(), self.noisy.clone());
        let mut q = vec![[0.0; 2]; n];
        let mut of_dual = vec![0.0; n];
        for iteration in 1..=LIMIT {
            of_dual.fill(0.0);
            for (element, q) in equations.elements.iter().zip(&mut q) {
                let g = element.gradient(&beyond);
                let p = [0, 1].map(|i| q[i] + sigma * g[i]);
                let back = (p[0].hypot(p[1]) / self.lambda).max(1.0);
                *q = p.map(|p| p / back);
                element.add_divergence(*q, &mut of_dual);
            }
            let theta = 1.0 / (1.0 + 2.0 * tau).sqrt();
            for k in 0..n {
                let new = (u[k] + tau * (self.noisy[k] - of_dual[k] / (h * h))) / (1.0 + tau);
                beyond[k] = new + theta * (new - u[k]);
                u[k] = new;
            }
            tau *= theta;
            sigma /= theta;
            if iteration % 20 == 0 || iteration == LIMIT {
                let reached = self.gap(equations, &u, &q).1;
                if reached <= gap || iteration == LIMIT {
                    return (iteration, u, reached);
                }
            }
        }
        (LIMIT, u, f64::INFINITY)
    }
}

/// The picture without noise, and with noise.
pub(crate) fn example(pixels: usize, lambda: f64) -> Outcome<(Vec<f64>, Picture)> {
    let (m, values) = still_life()?;
    let original = resampled(&values, m, pixels);
    let mut random = Random::new(1);
    // The sum of twelve uniform numbers is nearly normal.
    let mut noise = || 0.5 * (0..12).map(|_| random.symmetric()).sum::<f64>() * NOISE;
    let picture = Picture {
        m: pixels,
        noisy: original.iter().map(|g| g + noise()).collect(),
        lambda,
        viscosity: 0.0,
    };
    Ok((original, picture))
}

/// Means of neighbours for u, and q of the pixel around, on twice as many pixels a side.
fn prolonged(u: &[f64], q: &[[f64; 2]], n: usize) -> Vec<f64> {
    let m = 2 * n;
    // The nearer of two coarse pixels counts three times.
    let near = |i: usize| {
        let other = if i.is_multiple_of(2) {
            (i / 2).saturating_sub(1)
        } else {
            (i / 2 + 1).min(n - 1)
        };
        [(i / 2, 0.75), (other, 0.25)]
    };
    let mean = |k: usize| -> f64 {
        let pairs = near(k / m).into_iter().flat_map(|a| near(k % m).map(|b| (a, b)));
        pairs.map(|((row, a), (col, b))| a * b * u[row * n + col]).sum()
    };
    let around = |k: usize| q[k / m / 2 * n + k % m / 2];
    (0..m * m).map(mean).chain((0..m * m).flat_map(around)).collect()
}

/// Newton steps from 0 and from the solution on the grid before, for one noisy picture on finer and finer grids.
fn refine(finest: usize, levels: u32, lambda: f64) -> Outcome<()> {
    // A function that does not change with the grid: its noise comes in squares.
    let (size, still_life) = still_life()?;
    let (means, picture) = example(NOISY, lambda)?;
    let noise: Vec<f64> = picture.noisy.iter().zip(&means).map(|(n, m)| n - m).collect();
    let mut noisy = resampled(&still_life, size, finest);
    let noise = resampled(&noise, NOISY, finest);
    noisy.iter_mut().zip(&noise).for_each(|(g, n)| *g += n);
    println!("with −μΔu, μ = {VISCOSITY:.0e}, threshold {THRESHOLD:.0e}");
    println!("pixels  steps from 0  from coarser  residual           J  seconds");
    let (mut fixed, mut nested) = (Vec::new(), Vec::new());
    let mut coarse: Option<(usize, Yielding, Vec<f64>)> = None;
    for m in (0..levels).rev().map(|k| finest >> k) {
        let picture = Picture {
            m,
            noisy: resampled(&noisy, finest, m),
            lambda,
            viscosity: VISCOSITY,
        };
        let mut equations = picture.equations(THRESHOLD)?;
        let mut newton = solver();
        let mut x = vec![0.0; equations.order()];
        let begin = Instant::now();
        newton.solve(&mut equations, &mut x)?;
        let mut seconds = begin.elapsed().as_secs_f64();
        fixed.push(newton.report().history.len() - 1);
        if let Some((n, before, solution)) = &coarse {
            let (u, q) = before.split(solution);
            let mut y = prolonged(u, q, *n);
            let begin = Instant::now();
            newton.solve(&mut equations, &mut y)?;
            seconds = begin.elapsed().as_secs_f64();
            nested.push(newton.report().history.len() - 1);
            ensure(
                distance(&x[..m * m], &y[..m * m]) < 1e-8,
                "both starts lead to the same picture",
            )?;
        }
        println!(
            "{m:6}  {:12}  {:>12}  {:8.1e}  {:10.6}  {seconds:7.2}",
            fixed[fixed.len() - 1],
            nested.last().map_or("–".to_owned(), usize::to_string),
            newton.report().residual_norm(),
            picture.energy(&equations, &x[..m * m]),
        );
        coarse = Some((m, equations, x));
    }
    ensure(
        growth(&fixed) <= GROWTH && growth(&nested) <= GROWTH,
        "the number of Newton steps does not grow with refinement",
    )
}

/// With full steps: the residual rises in early iterations, as edges appear, and steps of a derivative made definite need not reduce it.
fn solver() -> NewtonKrylov {
    NewtonKrylov::new(
        NewtonKrylovOptions::default()
            .with_method(KrylovMethod::Gmres { directions: 10 })
            .with_damping(Damping::Never)
            .with_first_forcing(1e-2)
            .with_relative_tolerance(1e-12),
    )
}

/// 10 log₁₀ of 1 over the mean square of the difference.
fn psnr(u: &[f64], original: &[f64]) -> f64 {
    let square: f64 = u.iter().zip(original).map(|(u, o)| (u - o) * (u - o)).sum();
    -10.0 * (square / u.len() as f64).log10()
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    let (pixels, finest, levels) = match arguments.small {
        true => (48, 64, 2),
        false => (arguments.pixels, 256, 4),
    };
    let positive = arguments.lambda > 0.0 && arguments.lambda.is_finite();
    if !(16..=1024).contains(&pixels) || !positive {
        return Err("--pixels goes from 16 to 1024; --lambda is positive".into());
    }
    let (original, picture) = example(pixels, arguments.lambda)?;
    let mut newton = solver();
    println!("             Newton, from the line before                   Chambolle and Pock");
    println!(
        "threshold  steps  residual       gap  seconds  PSNR dB  iterations       gap  seconds  PSNR dB"
    );
    let mut x = Vec::new();
    let (mut total, mut gaps) = (0.0, Vec::new());
    for threshold in THRESHOLDS {
        let mut equations = picture.equations(threshold)?;
        x.resize(equations.order(), 0.0);
        let begin = Instant::now();
        newton.solve(&mut equations, &mut x)?;
        total += begin.elapsed().as_secs_f64();
        let (u, q) = equations.split(&x);
        let (value, gap) = picture.gap(&equations, u, q);
        let begin = Instant::now();
        let (iterations, other, reached) = picture.first_order(&equations, gap);
        println!(
            "{threshold:9.0e}  {:5}  {:8.1e}  {gap:8.2e}  {total:7.2}  {:7.3}  {iterations:10}  {reached:8.2e}  {:7.2}  {:7.3}",
            newton.report().history.len() - 1,
            newton.report().residual_norm(),
            psnr(u, &original),
            begin.elapsed().as_secs_f64(),
            psnr(&other, &original),
        );
        ensure(reached <= gap, "the first-order method reaches the gap")?;
        // By strong convexity each lies within √(2 gap) of the solution.
        let square: f64 = u.iter().zip(&other).map(|(a, b)| (a - b) * (a - b)).sum();
        ensure(
            square.sqrt() <= 2.0 * (2.0 * gap * value).sqrt(),
            "both methods lead to the same picture, as near as their gaps say",
        )?;
        gaps.push(gap);
    }
    let u = &x[..pixels * pixels];
    println!(
        "PSNR with noise {:.3}, without {:.3} dB",
        psnr(&picture.noisy, &original),
        psnr(u, &original)
    );
    draw(
        arguments,
        pixels,
        &[
            ("original", &original),
            ("noisy", &picture.noisy),
            ("denoised", u),
        ],
    )?;
    ensure(
        gaps.windows(2).all(|g| g[1] < 0.5 * g[0]) && gaps[gaps.len() - 1] < 1e-6,
        "the gap closes as the threshold falls",
    )?;
    ensure(
        psnr(u, &original) > psnr(&picture.noisy, &original) + 3.0,
        "the noise is reduced by 3 dB",
    )?;
    refine(finest, levels, arguments.lambda)
}

fn draw(arguments: &Arguments, m: usize, pictures: &[(&str, &[f64])]) -> Outcome<()> {
    const BLACK: Colour = Colour::new(0, 0, 0);
    const WHITE: Colour = Colour::new(255, 255, 255);
    let panels = pictures.iter().map(|(name, values)| {
        let panel = Panel::new("x", "y").with_caption(*name);
        raster(panel, m, UNIT, |k| Some(blend(BLACK, WHITE, values[k])))
    });
    let classes = [("0", BLACK), ("½", blend(BLACK, WHITE, 0.5))];
    let mut panels = panels.map(|panel| with_classes(panel, &classes));
    let first = panels.next().ok_or("no picture")?;
    let path = file_in(&arguments.out, "total_variation.svg")?;
    panels
        .fold(BranchDiagram::new(first), BranchDiagram::with_panel)
        .with_title("Denoising by total variation; white is 1")
        .with_size(340 * pictures.len() as u32, 400)
        .write(&path)?;
    println!("{}", path.display());
    Ok(())
}
