//! A market with a capacity: how prices and quantities move with demand and cost, and where their derivative
//! ends to exist.
//! You see, at five levels of demand, the equilibrium, whether it is differentiable, its one-sided derivatives, and how far each holds.
//! Run: cargo run --release --example sensitivity
//!
//! A firm sells q at the price d − q, at the cost c a unit, up to a capacity of 2: with the price μ of
//! capacity, 0 ≤ q ⟂ c + 2 q + μ − d ≥ 0 and 0 ≤ μ ⟂ 2 − q ≥ 0. So q = 0 for d ≤ c, (d − c)/2 up to d = c +
//! 4, and then 2. At d = c and d = c + 4 the derivatives to both sides differ; every number of the table is
//! compared with these formulas.

#[macro_use]
mod common;

use std::process::ExitCode;

use clap::Parser;
use common::Outcome;
use semismooth::piecewise::Expression;
use semismooth::{parametric_mcp, solve_mcp};

/// A market with a capacity, its derivatives and their ranges.
#[derive(Parser)]
struct Arguments {}

fn main() -> ExitCode {
    common::exit(run(&common::parse::<Arguments>()))
}

const COST: f64 = 1.0;
const CAPACITY: f64 = 2.0;

/// (q, μ) of the formulas above.
fn exact(demand: f64) -> [f64; 2] {
    let free = ((demand - COST) / 2.0).max(0.0);
    [free.min(CAPACITY), (demand - COST - 2.0 * CAPACITY).max(0.0)]
}

/// F(x, p) for x = (q, μ) and p = (d, c).
fn market<'a>(x: &[Expression<'a>], p: &[Expression<'a>]) -> Vec<Expression<'a>> {
    vec![p[1] + 2.0 * x[0] + x[1] - p[0], CAPACITY - x[0]]
}

fn run(_: &Arguments) -> Outcome<()> {
    let (lower, upper) = ([0.0; 2], [f64::INFINITY; 2]);
    println!(
        "demand  quantity  capacity's price  differentiable  derivative of q: up, down  holds: up, down"
    );
    for demand in [0.0, COST, 3.0, COST + 2.0 * CAPACITY, 6.0] {
        let p = [demand, COST];
        let solution = solve_mcp(|x| market(x, &p.map(Expression::from)), &lower, &upper, &[1.0; 2])?;
        let x = &solution.x;
        let map = parametric_mcp(2, market, &lower, &upper)?;
        let mut found = solution.sensitivity(map, &p)?;
        let known = found.differentiable()?.known();
        let sides = [[1.0, 0.0], [-1.0, 0.0]];
        let mut rates = Vec::new();
        let mut ranges = Vec::new();
        let mut right = true;
        for delta in sides {
            let rate = found.jvp(&delta)?;
            // The map is affine on each piece: the ranges are exact, whatever the horizon.
            let range = found.valid_until(&delta, 1.0)?.until();
            let step = range.min(1.0);
            let ahead = exact(demand + step * delta[0]);
            let gap = |i: usize| (x[i] + step * rate[i] - ahead[i]).abs();
            right &= gap(0).max(gap(1)) < 1e-9;
            rates.push(rate[0]);
            ranges.push(range);
        }
        let told = known.map_or("not known", |known| if known { "yes" } else { "no" });
        println!(
            "{demand:6.1}  {:8.4}  {:16.4}  {told:>14}  {:15.4}, {:8.4}  {:9.4}, {:4.1}",
            x[0].abs(),
            x[1].abs(),
            rates[0] + 0.0,
            rates[1] + 0.0,
            ranges[0],
            ranges[1]
        );
        let at_kink = demand == COST || demand == COST + 2.0 * CAPACITY;
        if !right || known != Some(!at_kink) {
            return Err(
                format!("the derivatives at the demand {demand} are not those of the formulas").into(),
            );
        }
    }
    Ok(())
}
