//! Orders of the strategies of a solver, chosen on one half of the families of problems and judged on the other.

use std::fmt::Display;

use crate::common::{Outcome, Random};
use crate::contenders::Run;
use crate::profiles::Costs;

/// Solves of a problem, of which the fastest counts, unless one takes longer than `QUICK` seconds.
const REPEATED: usize = 3;
const QUICK: f64 = 1e-3;

/// The default order first; then those in which another strategy comes first, or second.
pub(crate) fn candidates<S: Copy + PartialEq>(usual: &[S]) -> Vec<Vec<S>> {
    let mut list = vec![usual.to_vec()];
    for place in [0, 1] {
        for strategy in usual.iter().skip(place + 1) {
            let mut order = usual.to_vec();
            order.retain(|s| s != strategy);
            order.insert(place, *strategy);
            list.push(order);
        }
    }
    list
}

/// The performance of an order on one family, relative to the default: the mean of the logarithms of the ratio of costs, over the problems
/// that both solve, and how many it does not solve.
#[derive(Clone, Copy, Default)]
struct Score {
    logarithm: f64,
    failed: usize,
}

type Cost = fn(&Run) -> f64;

/// Scores by family, so that many problems of one kind count as one.
fn by_family(order: &[Run], usual: &[Run], families: &[usize], cost: Cost) -> Vec<Score> {
    let count = families.iter().max().map_or(0, |k| k + 1);
    let (mut scores, mut solved) = (vec![Score::default(); count], vec![0.0; count]);
    for ((a, b), &k) in order.iter().zip(usual).zip(families) {
        scores[k].failed += usize::from(!a.solved);
        if a.solved && b.solved {
            scores[k].logarithm += (cost(a) / cost(b)).ln();
            solved[k] += 1.0;
        }
    }
    for (score, solved) in scores.iter_mut().zip(solved) {
        score.logarithm /= f64::max(solved, 1.0);
    }
    scores
}

/// Of the families chosen: how many problems are not solved, and the geometric mean of the ratios.
fn total(scores: &[Score], chosen: &[bool]) -> (usize, f64) {
    let of_chosen = || scores.iter().zip(chosen).filter(|s| *s.1).map(|s| s.0);
    let mean = of_chosen().map(|s| s.logarithm).sum::<f64>() / of_chosen().count().max(1) as f64;
    (of_chosen().map(|s| s.failed).sum(), mean.exp())
}

/// Runs all orders on so many problems: a row for each order.
fn runs<S>(
    orders: &[Vec<S>],
    problems: usize,
    run: &dyn Fn(usize, &[S]) -> Outcome<Run>,
) -> Outcome<Vec<Vec<Run>>> {
    let mut runs = Vec::with_capacity(orders.len());
    for order in orders {
        let mut row = Vec::with_capacity(problems);
        for problem in 0..problems {
            let mut best = run(problem, order)?;
            let repeated = if best.seconds < QUICK { REPEATED } else { 1 };
            for _ in 1..repeated {
                best.seconds = best.seconds.min(run(problem, order)?.seconds);
            }
            row.push(best);
        }
        runs.push(row);
    }
    Ok(runs)
}

/// Prints the costs of all orders of a solver on problems of these families, the default order first; chooses the best on one half of the
/// families and judges it on the other, for many halves at random. `run` solves the problem with a number.
pub(crate) fn compare<S: Display>(
    solver: &str,
    orders: &[Vec<S>],
    of: &[&str],
    run: &dyn Fn(usize, &[S]) -> Outcome<Run>,
) -> Outcome<()> {
    let mut names = of.to_vec();
    names.sort_unstable();
    names.dedup();
    let families: Vec<usize> = of.iter().map(|f| names.binary_search(f).unwrap_or(0)).collect();
    let runs = runs(orders, of.len(), run)?;
    println!(
        "\norders of {solver}'s strategies on {} problems of {} families",
        of.len(),
        names.len()
    );
    println!(
        "  {:64} {:>8} {:>8} {:>9}",
        "(geometric means over families, relative to the default)", "time", "work", "unsolved"
    );
    let costs: [(&str, Cost); 2] = [("time", |r| r.seconds), ("work", Costs::work)];
    let scores = costs.map(|(_, cost)| -> Vec<Vec<Score>> {
        let of = |row: &Vec<Run>| by_family(row, &runs[0], &families, cost);
        runs.iter().map(of).collect()
    });
    let all = vec![true; names.len()];
    for (k, order) in orders.iter().enumerate() {
        let first: Vec<_> = order.iter().take(3).map(S::to_string).collect();
        let [time, work] = [0, 1].map(|c| total(&scores[c][k], &all));
        println!(
            "  {:64} {:>8.3} {:>8.3} {:>9}",
            first.join(", "),
            time.1,
            work.1,
            work.0
        );
    }
    for ((name, _), scores) in costs.iter().zip(&scores) {
        halves(name, orders, scores);
    }
    Ok(())
}

/// Halves of the families at random.
const HALVES: usize = 1000;

fn halves<S: Display>(cost: &str, orders: &[Vec<S>], scores: &[Vec<Score>]) {
    let mut random = Random::new(5);
    let (mut chosen, mut judged) = (vec![0; orders.len()], Vec::with_capacity(HALVES));
    let mut better = 0;
    for _ in 0..HALVES {
        let half: Vec<bool> = scores[0].iter().map(|_| random.symmetric() < 0.0).collect();
        let other: Vec<bool> = half.iter().map(|h| !h).collect();
        let totals: Vec<_> = scores.iter().map(|s| total(s, &half)).collect();
        // The first of equals, which is the default if it is among them.
        let best = (0..orders.len())
            .min_by(|&i, &j| {
                let (a, b) = (totals[i], totals[j]);
                a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
            })
            .unwrap_or(0);
        let (failed, ratio) = total(&scores[best], &other);
        chosen[best] += 1;
        better += usize::from(ratio < 1.0 && failed <= total(&scores[0], &other).0);
        judged.push(ratio);
    }
    judged.sort_by(f64::total_cmp);
    let percent = |count: usize| 100.0 * count as f64 / HALVES as f64;
    println!("  by {cost}, chosen on half of the families and judged on the other, {HALVES} times:");
    for (order, count) in orders.iter().zip(&chosen).filter(|c| *c.1 > 0) {
        println!(
            "    {:5.1} % choose {} first, {} next",
            percent(*count),
            order[0],
            order[1]
        );
    }
    println!(
        "    on the other half {:.3} of the default in the median, {:.3} to {:.3} in nine of ten; less in {:.1} %",
        judged[HALVES / 2],
        judged[HALVES / 20],
        judged[HALVES - 1 - HALVES / 20],
        percent(better)
    );
}
