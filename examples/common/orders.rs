//! Orders of the strategies of `McpSolver`, chosen on one half of the problems and judged on the other.

use semismooth::complementarity::{McpOptions, McpStrategy};

use crate::common::Outcome;
use crate::contenders::{Complementarity, Run, solver};

/// Solves of a problem, of whose times the least counts, unless one takes longer than `QUICK` seconds.
const REPEATED: usize = 3;
const QUICK: f64 = 1e-3;

/// The default order first; then those in which another strategy comes first, or second.
fn candidates() -> Vec<Vec<McpStrategy>> {
    let usual = McpOptions::default().strategies;
    let mut list = vec![usual.clone()];
    for place in [0, 1] {
        for (k, strategy) in usual.iter().enumerate().skip(place + 1) {
            // Restarts are made of the others.
            if *strategy != McpStrategy::Restart {
                let mut order = usual.clone();
                order.remove(k);
                order.insert(place, *strategy);
                list.push(order);
            }
        }
    }
    list
}

/// The geometric mean, over a half of the problems that both orders solve, of costs over those of the default; and what is not solved.
struct Score {
    ratio: f64,
    failed: usize,
}

fn score(order: &[Run], usual: &[Run], half: usize, cost: fn(&Run) -> f64) -> Score {
    let (mut sum, mut count, mut failed) = (0.0, 0, 0);
    for (a, b) in order.iter().zip(usual).skip(half).step_by(2) {
        failed += usize::from(!a.solved);
        if a.solved && b.solved {
            sum += (cost(a) / cost(b)).ln();
            count += 1;
        }
    }
    Score {
        ratio: (sum / f64::from(count)).exp(),
        failed,
    }
}

/// Prints the costs of all orders on either half; the best of one half is what counts on the other.
pub(crate) fn compare(problems: &[Complementarity]) -> Outcome<()> {
    let orders = candidates();
    let mut runs = Vec::with_capacity(orders.len());
    for order in &orders {
        let mut row = Vec::with_capacity(problems.len());
        for problem in problems {
            let mut run = problem.run_with(|p, x| solver(p, x, order))?;
            let repeated = if run.seconds < QUICK { REPEATED } else { 1 };
            for _ in 1..repeated {
                run.seconds = run
                    .seconds
                    .min(problem.run_with(|p, x| solver(p, x, order))?.seconds);
            }
            row.push(run);
        }
        runs.push(row);
    }
    println!(
        "\norders of McpSolver's strategies on the halves of {} problems",
        problems.len()
    );
    println!(
        "  {:64} {:>16} {:>16} {:>9}",
        "(time and work over those of the default)", "first half", "second half", "unsolved"
    );
    let work = |r: &Run| r.iterations.max(r.factorisations).max(1) as f64;
    let costs: [fn(&Run) -> f64; 2] = [|r| r.seconds, work];
    let scores: Vec<[[Score; 2]; 2]> = runs
        .iter()
        .map(|row| [0, 1].map(|half| costs.map(|cost| score(row, &runs[0], half, cost))))
        .collect();
    for (order, [a, b]) in orders.iter().zip(&scores) {
        let names: Vec<_> = order.iter().take(3).map(|s| s.name()).collect();
        println!(
            "  {:64} {:>7.3} {:>8.3} {:>7.3} {:>8.3} {:>4} {:>4}",
            names.join(", "),
            a[0].ratio,
            a[1].ratio,
            b[0].ratio,
            b[1].ratio,
            a[0].failed,
            b[0].failed
        );
    }
    for (k, cost) in ["time", "work"].iter().enumerate() {
        for half in [0, 1] {
            let key = |s: &[[Score; 2]; 2]| (s[half][k].failed, s[half][k].ratio);
            let best = (0..orders.len()).min_by(|&i, &j| {
                let (a, b) = (key(&scores[i]), key(&scores[j]));
                a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
            });
            let best = best.unwrap_or(0);
            let judged = &scores[best][1 - half][k];
            println!(
                "  by {cost}, chosen on half {}: {} first, {} next; on the other half {:.3} of the default, {} unsolved (default {})",
                half + 1,
                orders[best][0],
                orders[best][1],
                judged.ratio,
                judged.failed,
                scores[0][1 - half][k].failed
            );
        }
    }
    Ok(())
}
