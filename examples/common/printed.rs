//! The values of the test functions that the talk of Haslinger, Janovský and Ligurský prints, and their comparison with a branch.

use semismooth::contact::{ContactState, FullContact, PlanarCoulomb};
use semismooth::continuation::{Branch, Transition};

use crate::common::Outcome;

/// The digits printed are truncated to four decimals, and the load of the model with two nodes is rounded to as many.
const TOLERANCE: f64 = 2.5e-4;

/// Where on the branch a printed point lies.
#[derive(Clone, Copy)]
pub(crate) enum Place {
    /// Before transition k, counted from 0.
    Before(usize),
    /// At transition k.
    At(usize),
    /// Between transition k and the next.
    After(usize),
    /// Anywhere.
    Along,
}

/// A point of a printed run: its index there, where it lies, and θ¹, θ², θ³ of every node.
pub(crate) struct Printed {
    index: usize,
    place: Place,
    theta: &'static [[f64; 3]],
}

const fn printed(index: usize, place: Place, theta: &'static [[f64; 3]]) -> Printed {
    Printed { index, place, theta }
}

use Place::{After, Along, At, Before};

/// p = 1, Example 1.
pub(crate) const P1_EXAMPLE_1: &[Printed] = &[
    printed(12, Before(0), &[[1.5, -3.7695, 17.7695]]),
    printed(15, Before(0), &[[1.5, -0.1754, 14.1754]]),
    printed(25, At(0), &[[1.5, 0.0, 14.0]]),
    printed(1, After(0), &[[1.5128, 0.0128, 13.9613]]),
    printed(2, After(0), &[[1.5299, 0.0299, 13.9102]]),
];

/// p = 1, Example 3: the grazing branch, reached along branch 1 (indices 15, 19) and from the vertical segment (3, 5).
pub(crate) const P1_EXAMPLE_3_BRANCH_1: &[Printed] = &[
    printed(15, Along, &[[0.0, -1.0, -1.0]]),
    printed(19, Along, &[[0.0, -1.0, -1.0]]),
    printed(3, Along, &[[0.0, -1.0, -1.0]]),
    printed(5, Along, &[[0.0, -1.0, -1.0]]),
];

/// p = 1, Example 3, branch 2: along the vertical segment and at its end.
pub(crate) const P1_EXAMPLE_3_BRANCH_2: &[Printed] = &[
    printed(9, After(0), &[[0.3669, -2.1007, -0.6331]]),
    printed(14, After(0), &[[0.0001, -1.0004, -0.9999]]),
    printed(18, At(1), &[[0.0, -1.0, -0.9999]]),
];

/// p = 2, Example 1, branch 2: the transition points T1, T2, T3.
pub(crate) const P2_EXAMPLE_1: &[Printed] = &[
    printed(
        17,
        Before(0),
        &[[0.4, -4.2838, 0.0005], [1.3717, -9.4874, 5.2041]],
    ),
    printed(19, At(0), &[[0.4, -4.2834, 0.0], [1.3717, -9.4859, 5.2025]]),
    printed(
        21,
        After(0),
        &[[0.4, -4.2542, -0.0146], [1.3644, -9.3940, 5.0668]],
    ),
    printed(
        36,
        Before(1),
        &[[0.4, -3.0020, -0.6407], [1.0513, -6.2058, 0.0003]],
    ),
    printed(38, At(1), &[[0.4, -3.0019, -0.6407], [1.0513, -6.2056, 0.0]]),
    printed(
        40,
        After(1),
        &[[0.3918, -2.9950, -0.6689], [1.0372, -6.1748, -0.0165]],
    ),
    printed(
        89,
        Before(2),
        &[[0.0002, -2.2294, -2.2265], [0.2584, -5.3652, -0.7997]],
    ),
    printed(94, At(2), &[[0.0, -2.2278, -2.2278], [0.2578, -5.3667, -0.8]]),
    printed(
        96,
        After(2),
        &[[-0.0024, -2.2302, -2.2302], [0.2554, -5.3595, -0.8024]],
    ),
];

/// A state in the terms of the talk.
pub(crate) fn word(state: ContactState, grazing: bool) -> &'static str {
    match state {
        _ if grazing => "grazing contact",
        ContactState::Open => "no contact",
        ContactState::Stick => "contact-stick",
        _ => "contact-slip",
    }
}

/// Prints the table of the talk next to the values of `branch`, followed with short steps.
///
/// # Errors
/// A value that is not the printed one.
pub(crate) fn compare(map: &FullContact<PlanarCoulomb>, branch: &Branch, table: &[Printed]) -> Outcome<()> {
    println!("    beside the values printed in the talk (4 decimals, truncated):");
    println!(
        "      index            node   {:>17}   {:>17}   {:>17}",
        "θ¹ printed, here", "θ² printed, here", "θ³ printed, here"
    );
    let mut worst = 0.0_f64;
    for point in table {
        let (name, found) = locate(map, branch, point)?;
        for (node, (theta, printed)) in found.iter().zip(point.theta).enumerate() {
            let columns: Vec<String> = theta
                .iter()
                .zip(printed)
                .map(|(t, p)| format!("{p:9.4}{:9.4}", if t.abs() < 5e-5 { 0.0 } else { *t }))
                .collect();
            let index = if node == 0 {
                point.index.to_string()
            } else {
                String::new()
            };
            let name = if node == 0 { name.as_str() } else { "" };
            println!(
                "      {index:>5} {name:<10} {:>4}  {}",
                node + 1,
                columns.join("  ")
            );
        }
        worst = worst.max(deviation(&found, point.theta));
    }
    println!("      largest difference {worst:.1e}");
    if worst > TOLERANCE {
        return Err(format!("a printed value is missed by {worst:.1e}, more than {TOLERANCE:.1e}").into());
    }
    Ok(())
}

fn deviation(found: &[[f64; 3]], printed: &[[f64; 3]]) -> f64 {
    let pairs = found.iter().flatten().zip(printed.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The name of the place and the test functions there: at a transition its own, elsewhere those of the nearest point of that piece
/// of the branch.
fn locate(
    map: &FullContact<PlanarCoulomb>,
    branch: &Branch,
    point: &Printed,
) -> Outcome<(String, Vec<[f64; 3]>)> {
    let transition = |k: usize| -> Outcome<&Transition> {
        let missing = || format!("transition T{} was not met", k + 1);
        Ok(branch.transitions.get(k).ok_or_else(missing)?)
    };
    let arclength = |k: usize| branch.transitions.get(k).map_or(f64::INFINITY, |t| t.arclength);
    let (name, from, to) = match point.place {
        At(k) => return Ok((format!("at T{}", k + 1), map.theta(&transition(k)?.x))),
        Along => ("along it".to_owned(), 0.0, f64::INFINITY),
        Before(0) => ("before T1".to_owned(), 0.0, arclength(0)),
        Before(k) => (format!("before T{}", k + 1), arclength(k - 1), arclength(k)),
        After(k) => (format!("after T{}", k + 1), arclength(k), arclength(k + 1)),
    };
    let walk: Vec<Vec<[f64; 3]>> = branch
        .polyline()
        .iter()
        .filter(|(s, _)| (from..=to).contains(s))
        .map(|(_, x)| map.theta(x))
        .collect();
    let candidates = walk
        .windows(2)
        .map(|ends| nearest(&ends[0], &ends[1], point.theta));
    let best = candidates.min_by(|a, b| deviation(a, point.theta).total_cmp(&deviation(b, point.theta)));
    Ok((
        name.clone(),
        best.ok_or_else(|| format!("there is no branch {name}"))?,
    ))
}

/// The point of a segment nearest to `target`.
fn nearest(a: &[[f64; 3]], b: &[[f64; 3]], target: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let flat = |v: &[[f64; 3]]| v.concat();
    let (a, b, target) = (flat(a), flat(b), flat(target));
    let along: f64 = (0..a.len()).map(|i| (b[i] - a[i]) * (target[i] - a[i])).sum();
    let length: f64 = (0..a.len()).map(|i| (b[i] - a[i]).powi(2)).sum();
    let u = if length > 0.0 {
        (along / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let place = |i: usize| a[i] + u * (b[i] - a[i]);
    (0..a.len() / 3)
        .map(|node| [0, 1, 2].map(|k| place(3 * node + k)))
        .collect()
}
