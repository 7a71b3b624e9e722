//! Three equilibria of economics and transport: oligopolists who choose quantities (Cournot–Nash), prices of a good traded between
//! regions, and routes of drivers in the network of Braess.
//!
//! You will see each equilibrium with a check of what defines it: no firm gains by another quantity, no trader by another shipment, no
//! driver by another route; and Braess' paradox, a new road that makes everybody slower.
//!
//! ```text
//! cargo run --release --example market_and_traffic
//! ```

#[macro_use]
mod common;

use std::process::ExitCode;

use clap::Parser;
use common::{Outcome, exit, list};
use semismooth::complementarity::active_set::ActiveSetSolver;
use semismooth::complementarity::{Autodiff, Block, Lcp, Mcp, McpSolver, SmoothFunction, Variables};
use semismooth::piecewise::Real;
use semismooth::run::Status;
use semismooth::sparse::Matrix;

#[derive(Parser)]
#[command(about = "Cournot-Nash, spatial price and traffic equilibria")]
struct Arguments {
    /// Unit cost of the first of the five firms (positive).
    #[arg(long, default_value_t = 10.0)]
    cost: f64,
    /// Drivers on Braess' network (a paradox from 2.6 to 8.9).
    #[arg(long, default_value_t = 6.0)]
    drivers: f64,
}

fn main() -> ExitCode {
    exit(run(&common::parse::<Arguments>()))
}

fn run(arguments: &Arguments) -> Outcome<()> {
    for (name, value) in [("--cost", arguments.cost), ("--drivers", arguments.drivers)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(format!("{name} {value} is out of range; it must be positive").into());
        }
    }
    cournot_nash(arguments.cost)?;
    spatial_prices()?;
    traffic(arguments.drivers)
}

/// Five firms with marginal costs cᵢ + (xᵢ/5)^(1/βᵢ) and the price (5000/Q)^(1/1.1) (Murphy, Sherali, Soyster, 1982).
struct Oligopoly {
    costs: [f64; 5],
}

const BETA: [f64; 5] = [1.2, 1.1, 1.0, 0.9, 0.8];
const ELASTICITY: f64 = 1.1;

impl Oligopoly {
    fn price(total: f64) -> f64 {
        (5000.0 / total).powf(1.0 / ELASTICITY)
    }

    fn profit(&self, i: usize, own: f64, others: f64) -> f64 {
        let b = BETA[i];
        let cost = self.costs[i] * own + b / (1.0 + b) * 5.0_f64.powf(-1.0 / b) * own.powf((1.0 + b) / b);
        own * Self::price(own + others) - cost
    }
}

impl SmoothFunction for Oligopoly {
    fn num_vars(&self) -> usize {
        5
    }

    /// Minus the derivative of each firm's profit.
    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        let total = x[0] + x[1] + x[2] + x[3] + x[4];
        let price = ((total / 5000.0).ln() * (-1.0 / ELASTICITY)).exp();
        for i in 0..5 {
            let marginal = ((x[i] / 5.0).ln() * (1.0 / BETA[i])).exp() + self.costs[i];
            out[i] = marginal - price + x[i] * price / (total * ELASTICITY);
        }
    }
}

fn cournot_nash(cost: f64) -> Outcome<()> {
    let firms = || Oligopoly {
        costs: [cost, 8.0, 6.0, 4.0, 2.0],
    };
    let game = firms();
    // A logarithm of 0 is not defined: quantities stay just above.
    let problem = Mcp::new(Autodiff::new(firms()), vec![1e-9; 5], vec![f64::INFINITY; 5])?;
    let mut x = [10.0; 5];
    let mut solver = McpSolver::default();
    let report = solver.solve(&problem, &mut x)?;
    let total: f64 = x.iter().sum();
    println!(
        "Cournot-Nash: {} in {} iterations, residual {:.1e}",
        report.status, report.iterations, report.residual
    );
    println!("  firm  quantity   profit   best deviation gains");
    let mut worst = f64::NEG_INFINITY;
    for i in 0..5 {
        let others = total - x[i];
        let here = game.profit(i, x[i], others);
        let best = (1..=3000)
            .map(|k| game.profit(i, 0.05 * f64::from(k), others))
            .fold(f64::NEG_INFINITY, f64::max);
        worst = worst.max(best - here);
        println!("  {i:4} {:9.4} {here:9.3}   {:.1e}", x[i], best - here);
    }
    println!("  price {:.6} at quantity {total:.4}", Oligopoly::price(total));
    check(worst < 1e-6, "a firm gains by another quantity")
}

/// Supply prices that grow with the supply, demand prices that fall with the demand, and costs of transport that grow with the
/// shipment (P. T. Harker, 1986).
fn spatial_prices() -> Outcome<()> {
    const SUPPLY: [(f64, f64); 3] = [(2.0, 0.10), (4.0, 0.05), (9.0, 0.20)];
    const DEMAND: [(f64, f64); 3] = [(25.0, 0.20), (18.0, 0.10), (15.0, 0.40)];
    const COST: [[f64; 3]; 3] = [[1.0, 2.0, 3.0], [2.0, 1.5, 2.5], [4.0, 2.5, 0.5]];
    const CONGESTION: f64 = 0.01;
    // x_ij ≥ 0 ⟂ supply price i + cost of transport − demand price j ≥ 0.
    let entry = |(i, j): (usize, usize), (k, l): (usize, usize)| {
        let supply = if i == k { SUPPLY[i].1 } else { 0.0 };
        let demand = if j == l { DEMAND[j].1 } else { 0.0 };
        supply + demand + if (i, j) == (k, l) { CONGESTION } else { 0.0 }
    };
    let pairs: Vec<(usize, usize)> = (0..9).map(|k| (k / 3, k % 3)).collect();
    let rows: Vec<Vec<f64>> = pairs
        .iter()
        .map(|a| pairs.iter().map(|b| entry(*a, *b)).collect())
        .collect();
    let q = pairs
        .iter()
        .map(|&(i, j)| SUPPLY[i].0 + COST[i][j] - DEMAND[j].0)
        .collect();
    let lcp = Lcp::new(Matrix::from_rows(&rows)?, q)?;
    let mut x = vec![0.0; 9];
    let report = ActiveSetSolver::default().solve(&lcp, &mut x)?;
    println!(
        "\nspatial prices: {} in {} iterations, residual {:.1e}",
        report.status, report.iterations, report.residual
    );
    check(report.status == Status::Solved, "no equilibrium was found")?;
    let supply = |i: usize| SUPPLY[i].0 + SUPPLY[i].1 * x[3 * i..3 * i + 3].iter().sum::<f64>();
    let demand = |j: usize| DEMAND[j].0 - DEMAND[j].1 * (0..3).map(|i| x[3 * i + j]).sum::<f64>();
    let mut worst = 0.0_f64;
    for i in 0..3 {
        let row: Vec<String> = (0..3).map(|j| format!("{:8.3}", x[3 * i + j])).collect();
        println!("  from {i} at price {:7.4}: {}", supply(i), row.join(" "));
        for j in 0..3 {
            let gain = demand(j) - supply(i) - COST[i][j] - CONGESTION * x[3 * i + j];
            // Traders make no profit on shipments, and could make none on those they omit.
            worst = worst.max(if x[3 * i + j] > 0.0 { gain.abs() } else { gain });
        }
    }
    println!(
        "  prices at destinations {:.4} {:.4} {:.4}; largest gain of a trader {worst:.1e}",
        demand(0),
        demand(1),
        demand(2)
    );
    check(worst < 1e-9, "a trader gains by another shipment")
}

/// Routes from start to end, as the links they use: two bridges with cost 10 f, two roads with 50 + f, and the new road 10 + f
/// (D. Braess, 1968).
const ROUTES: [&[usize]; 3] = [&[0, 2], &[1, 3], &[0, 4, 3]];
const LINKS: [(f64, f64); 5] = [(0.0, 10.0), (50.0, 1.0), (50.0, 1.0), (0.0, 10.0), (10.0, 1.0)];

fn traffic(drivers: f64) -> Outcome<()> {
    println!("\ntraffic, {drivers} drivers");
    let before = assignment(drivers, 2)?;
    let after = assignment(drivers, 3)?;
    println!(
        "  the new road changes the time of everybody by {:+.4}",
        after - before
    );
    if drivers == 6.0 {
        // 3 + 3 drivers at 83 minutes, 2 + 2 + 2 at 92.
        check(
            (before - 83.0).abs() < 1e-9 && (after - 92.0).abs() < 1e-9,
            "Braess' times are 83 and 92",
        )?;
    }
    Ok(())
}

/// Flow of each route ≥ 0 ⟂ its time − the least time ≥ 0, and the least time, without bounds, for Σ flows = drivers.
struct Network {
    drivers: f64,
    flow: Block,
    least: Block,
}

impl SmoothFunction for Network {
    fn num_vars(&self) -> usize {
        self.flow.len() + self.least.len()
    }

    fn eval<T: Real>(&self, x: &[T], out: &mut [T]) {
        let (flow, least) = (self.flow.of(x), self.least.of(x)[0]);
        let mut excess = T::from(-self.drivers);
        let mut times = [T::from(0.0); LINKS.len()];
        for (link, (time, (free, slope))) in times.iter_mut().zip(LINKS).enumerate() {
            let on_it = |route: &&[usize]| route.contains(&link);
            let used = ROUTES.iter().zip(flow).filter(|(route, _)| on_it(route));
            *time = used.fold(T::from(0.0), |sum, (_, f)| sum + *f) * slope + free;
        }
        for ((route, f), out) in ROUTES.iter().zip(flow).zip(self.flow.of_mut(out)) {
            *out = route.iter().fold(-least, |sum, link| sum + times[*link]);
            excess += *f;
        }
        self.least.of_mut(out)[0] = excess;
    }
}

/// The least time from start to end where the first `routes` routes are open.
fn assignment(drivers: f64, routes: usize) -> Outcome<f64> {
    let mut variables = Variables::new();
    let flow = variables.add("flow", routes, 0.0, f64::INFINITY)?;
    let least = variables.add("least time", 1, f64::NEG_INFINITY, f64::INFINITY)?;
    let network = Autodiff::new(Network { drivers, flow, least });
    let problem = Mcp::of_variables(network, &variables)?;
    let mut x = vec![drivers / routes as f64; variables.len()];
    let mut solver = McpSolver::default();
    let report = solver.solve(&problem, &mut x)?;
    let x = variables.view(&x)?;
    let (flows, time) = (x.block("flow")?, x.block("least time")?[0]);
    println!(
        "  {routes} routes: {}, flows {}, time {time:.6}, residual {:.1e}",
        report.status,
        list(flows, 6),
        report.residual
    );
    check(report.is_solved(), "no equilibrium was found")?;
    Ok(time)
}

fn check(good: bool, otherwise: &str) -> Outcome<()> {
    if good { Ok(()) } else { Err(otherwise.into()) }
}
