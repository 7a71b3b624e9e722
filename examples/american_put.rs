//! The price of an American put: at every step in time an obstacle problem, as the holder may exercise whenever that is worth more.
//!
//! You will see the price against a binomial tree, how many factorisations the steps take when each starts from the exercise
//! region of the last (one where that stays), and in `out/american_put.svg` the price below which to exercise over the time to expiry.
//!
//! ```text
//! cargo run --release --example american_put -- --spot 36 --strike 40 --volatility 0.2 --rate 0.06
//! ```

#[macro_use]
mod common;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use common::{Outcome, exit, file_in};
use semismooth::complementarity::active_set::{ActiveSetOptions, ActiveSetSolver, DirectReduced};
use semismooth::complementarity::{BoundState, Lcp};
use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
use semismooth::run::Status;
use semismooth::sparse::Matrix;

#[derive(Parser)]
#[command(about = "An American put by linear complementarity problems in time")]
struct Arguments {
    /// Price of the share (positive).
    #[arg(long, default_value_t = 36.0)]
    spot: f64,
    /// Strike (positive).
    #[arg(long, default_value_t = 40.0)]
    strike: f64,
    /// Rate of interest a year, positive.
    #[arg(long, default_value_t = 0.06)]
    rate: f64,
    /// Volatility a square root of a year (0.02 to 2).
    #[arg(long, default_value_t = 0.2)]
    volatility: f64,
    /// Years to expiry (positive).
    #[arg(long, default_value_t = 1.0)]
    years: f64,
    /// Points of the grid of logarithms (50 to 100000).
    #[arg(long, default_value_t = 800)]
    points: usize,
    /// Steps in time (4 to 100000).
    #[arg(long, default_value_t = 200)]
    steps: usize,
    /// Folder for the picture.
    #[arg(long, default_value = "out")]
    out: PathBuf,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(a: &Arguments) -> Outcome<()> {
    let ranges = [
        ("--spot", a.spot, a.spot > 0.0),
        ("--strike", a.strike, a.strike > 0.0),
        ("--rate", a.rate, a.rate > 0.0 && a.rate < 1.0),
        ("--volatility", a.volatility, (0.02..=2.0).contains(&a.volatility)),
        ("--years", a.years, a.years > 0.0 && a.years < 100.0),
        ("--points", a.points as f64, (50..=100_000).contains(&a.points)),
        ("--steps", a.steps as f64, (4..=100_000).contains(&a.steps)),
    ];
    if let Some((name, value, _)) = ranges.iter().find(|r| !(r.1.is_finite() && r.2)) {
        return Err(format!("{name} {value} is out of range; see --help").into());
    }
    let put = price(a)?;
    let reference = 0.5 * (binomial(a, 2000) + binomial(a, 2001));
    println!(
        "price {:.6}, binomial tree {reference:.6}, difference {:+.1e}",
        put.price,
        put.price - reference
    );
    println!(
        "{} steps, {} factorisations, {} in the first step, at most {} later; largest residual {:.1e}",
        a.steps, put.factorisations, put.first, put.most, put.residual
    );
    let style = SegmentStyle::new("exercise below", Colour::BLUE);
    let panel =
        Panel::new("years to expiry", "price of the share").with_curve(Curve::line(put.boundary, style));
    let path = file_in(&a.out, "american_put.svg")?;
    BranchDiagram::new(panel)
        .with_title("When to exercise an American put")
        .write(&path)?;
    println!("written: {}", path.display());
    if (put.price - reference).abs() > 2e-3 * a.strike {
        return Err("the price is not that of the binomial tree; refine the grid".into());
    }
    Ok(())
}

struct Put {
    price: f64,
    factorisations: usize,
    first: usize,
    most: usize,
    residual: f64,
    /// (time to expiry, price of the share below which to exercise)
    boundary: Vec<(f64, f64)>,
}

/// Crank–Nicolson in the logarithm of the price, the first steps implicit (R. Rannacher, 1984): with the generator A of the process,
/// (I + θ Δt A) v ≥ (I − (1 − θ) Δt A) v_old, v ≥ payoff, complementary.
fn price(a: &Arguments) -> Outcome<Put> {
    let n = a.points;
    let width = 5.0 * a.volatility * a.years.sqrt() + (a.spot / a.strike).ln().abs();
    let h = 2.0 * width / (n + 1) as f64;
    // The strike lies on the grid.
    let share = |i: usize| a.strike * ((i as f64 - (n / 2) as f64) * h).exp();
    let payoff: Vec<f64> = (0..n).map(|i| (a.strike - share(i)).max(0.0)).collect();
    let variance = 0.5 * a.volatility * a.volatility;
    let drift = a.rate - variance;
    let (below, centre, above) = (
        -variance / (h * h) + 0.5 * drift / h,
        2.0 * variance / (h * h) + a.rate,
        -variance / (h * h) - 0.5 * drift / h,
    );
    let dt = a.years / a.steps as f64;
    let system = |theta_dt: f64| -> Outcome<Matrix> {
        let mut entries = Vec::with_capacity(3 * n);
        for i in 0..n {
            entries.push((i, i, 1.0 + theta_dt * centre));
            if i > 0 {
                entries.push((i, i - 1, theta_dt * below));
            }
            if i + 1 < n {
                entries.push((i, i + 1, theta_dt * above));
            }
        }
        Ok(Matrix::from_triplets(n, n, &entries)?)
    };
    // Beyond the grid: exercised on the left, worthless on the right.
    let left = a.strike - share(0) * (-h).exp();
    let mut v = payoff.clone();
    let mut sets = vec![BoundState::Lower; n];
    let mut solver = ActiveSetSolver::with_reduced(ActiveSetOptions::default(), DirectReduced::new());
    let mut put = Put {
        price: 0.0,
        factorisations: 0,
        first: 0,
        most: 0,
        residual: 0.0,
        boundary: Vec::new(),
    };
    let make = |matrix: Matrix| Lcp::boxed(matrix, vec![0.0; n], payoff.clone(), vec![f64::INFINITY; n]);
    let (mut implicit, mut centred) = (make(system(dt)?)?, make(system(0.5 * dt)?)?);
    let mut q = vec![0.0; n];
    for step in 0..a.steps {
        let (lcp, explicit_dt) = if step < 4 {
            (&mut implicit, 0.0)
        } else {
            (&mut centred, 0.5 * dt)
        };
        for i in 0..n {
            let west = if i > 0 { v[i - 1] } else { left };
            let east = if i + 1 < n { v[i + 1] } else { 0.0 };
            q[i] = -v[i] + explicit_dt * (below * west + centre * v[i] + above * east);
        }
        q[0] += (dt - explicit_dt) * below * left;
        lcp.set_q(&q)?;
        let report = if step == 0 {
            solver.solve(lcp, &mut v)?
        } else {
            solver.solve_from_states(lcp, &mut v, &sets)?
        };
        if report.status != Status::Solved {
            return Err(format!("step {step} ended as {}", report.status).into());
        }
        sets.copy_from_slice(solver.states());
        put.factorisations += report.iterations;
        if step == 0 {
            put.first = report.iterations;
        } else {
            put.most = put.most.max(report.iterations);
        }
        put.residual = put.residual.max(report.residual);
        let exercised = sets
            .iter()
            .rposition(|s| *s == BoundState::Lower)
            .filter(|&i| payoff[i] > 0.0);
        if let Some(i) = exercised.filter(|&i| i + 2 < n) {
            // The price departs from the payoff tangentially, on a parabola: its vertex, from the next two points, is the boundary.
            let [near, far] = [i + 1, i + 2].map(|k| v[k] - payoff[k]);
            let bend = far - 2.0 * near;
            let ahead = if bend > 0.0 {
                (0.5 - near / bend).clamp(-0.5, 0.5)
            } else {
                0.0
            };
            let log = (i as f64 + ahead - (n / 2) as f64) * h;
            put.boundary.push(((step + 1) as f64 * dt, a.strike * log.exp()));
        }
    }
    // Cubic interpolation at the requested price.
    let place = (a.spot / a.strike).ln() / h + (n / 2) as f64;
    let base = (place.floor() as usize).clamp(1, n - 3);
    let t = place - base as f64;
    let [p, q0, q1, r] = [v[base - 1], v[base], v[base + 1], v[base + 2]];
    put.price = -t * (t - 1.0) * (t - 2.0) / 6.0 * p + (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0 * q0
        - (t + 1.0) * t * (t - 2.0) / 2.0 * q1
        + (t + 1.0) * t * (t - 1.0) / 6.0 * r;
    Ok(put)
}

/// The tree of Cox, Ross and Rubinstein (1979).
fn binomial(a: &Arguments, steps: usize) -> f64 {
    let dt = a.years / steps as f64;
    let up = (a.volatility * dt.sqrt()).exp();
    let discount = (-a.rate * dt).exp();
    let chance = ((a.rate * dt).exp() - 1.0 / up) / (up - 1.0 / up);
    let payoff = |level: i32| (a.strike - a.spot * up.powi(level)).max(0.0);
    let mut v: Vec<f64> = (0..=steps).map(|k| payoff(2 * k as i32 - steps as i32)).collect();
    for level in (0..steps).rev() {
        for k in 0..=level {
            let kept = discount * (chance * v[k + 1] + (1.0 - chance) * v[k]);
            v[k] = kept.max(payoff(2 * k as i32 - level as i32));
        }
    }
    v[0]
}
