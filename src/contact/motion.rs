//! Rigid motions in words.

use super::body::Nodes;
use crate::sparse::Place;
use crate::tolerances::SIX_DIGITS;

/// Parts of a motion, and its deviation from a rigid one, relative to its largest displacement, that may be
/// rounding: motions without energy are found by inverse iteration.
const ROUNDING: f64 = 100.0 * SIX_DIGITS;

/// What a motion with a largest displacement of 1 does to the body: "slides along (1, 0)" or "turns about ...". `None` where it is not one
/// rigid motion of all nodes that move.
pub(super) fn in_words(nodes: &Nodes, z: &[f64]) -> Option<String> {
    let dim = 1 + nodes.displacements.iter().map(|d| d[1]).max()?;
    let mut moves = vec![false; nodes.points.len()];
    for (value, [node, _]) in z.iter().zip(&nodes.displacements) {
        moves[*node] |= value.abs() > SIX_DIGITS;
    }
    let moving: Vec<[f64; 3]> = (0..moves.len())
        .filter(|&n| moves[n])
        .map(|n| nodes.points[n])
        .collect();
    let place = *Place::of(&moving, &vec![0; moving.len()]).first()?;
    let wanted: &[usize] = if dim == 2 { &[0, 1, 5] } else { &[0, 1, 2, 3, 4, 5] };
    let components = || {
        let all = z.iter().zip(&nodes.displacements);
        all.filter(|(_, [node, _])| moves[*node])
            .map(|(value, [node, d])| (value, place.motions(nodes.points[*node]).map(|m| m[*d])))
    };
    let mut system = vec![[0.0; 7]; 6];
    for (value, motions) in components() {
        for &i in wanted {
            wanted
                .iter()
                .for_each(|&j| system[i][j] += motions[i] * motions[j]);
            system[i][6] += motions[i] * value;
        }
    }
    let parts = solved(system, wanted)?;
    for (value, motions) in components() {
        let rigid: f64 = wanted.iter().map(|&i| parts[i] * motions[i]).sum();
        if (rigid - value).abs() > ROUNDING {
            return None;
        }
    }
    Some(told(&place, parts, dim))
}

fn told(place: &Place, parts: [f64; 6], dim: usize) -> String {
    let [t, turn] = [[parts[0], parts[1], parts[2]], [parts[3], parts[4], parts[5]]];
    let length = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let rate = length(turn);
    if rate <= ROUNDING {
        return format!("slides along {}", vector(t.map(|x| x / length(t)), dim));
    }
    // The points at rest, or that move along the axis alone, in units of the body: ω × t/|ω|².
    let cross = [
        turn[1] * t[2] - turn[2] * t[1],
        turn[2] * t[0] - turn[0] * t[2],
        turn[0] * t[1] - turn[1] * t[0],
    ];
    let through = std::array::from_fn(|d| place.centre[d] + place.size() * cross[d] / (rate * rate));
    if dim == 2 {
        return format!("turns about {}", vector(through, 2));
    }
    let along = (0..3).map(|d| t[d] * turn[d]).sum::<f64>().abs() / rate;
    let line = format!(
        "turns about the line through {} along {}",
        vector(through, 3),
        vector(turn.map(|x| x / rate), 3)
    );
    match along <= ROUNDING {
        true => line,
        false => line + ", along which it slides",
    }
}

/// The digits of a motion that are known.
fn vector(v: [f64; 3], dim: usize) -> String {
    // Adding 0 turns −0 into 0.
    let digits: Vec<String> = v[..dim]
        .iter()
        .map(|x| format!("{}", (x * 1e4).round() / 1e4 + 0.0))
        .collect();
    format!("({})", digits.join(", "))
}

/// The solution of the rows and columns `wanted` of a symmetric system with its right-hand side in the last column; others are 0.
fn solved(mut a: Vec<[f64; 7]>, wanted: &[usize]) -> Option<[f64; 6]> {
    let scale = wanted.iter().map(|&i| a[i][i]).fold(0.0, f64::max);
    for (k, &i) in wanted.iter().enumerate() {
        if a[i][i].is_nan() || a[i][i] <= 1e-9 * scale {
            return None;
        }
        for &r in &wanted[k + 1..] {
            let factor = a[r][i] / a[i][i];
            (0..7).for_each(|c| a[r][c] -= factor * a[i][c]);
        }
    }
    let mut x = [0.0; 6];
    for (k, &i) in wanted.iter().enumerate().rev() {
        let known: f64 = wanted[k + 1..].iter().map(|&j| a[i][j] * x[j]).sum();
        x[i] = (a[i][6] - known) / a[i][i];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube's corners under motions that are known, in the plane and in space.
    #[test]
    fn rigid_motions_have_names() {
        let corner = |k: usize| [k & 1, k >> 1 & 1, k >> 2].map(|x| x as f64);
        let named = |dim: usize, u: &dyn Fn([f64; 3]) -> [f64; 3]| {
            let points: Vec<_> = (0..1 << dim).map(corner).collect();
            let displacements = (0..points.len())
                .flat_map(|n| (0..dim).map(move |d| [n, d]))
                .collect();
            let z: Vec<f64> = points.iter().flat_map(|p| u(*p)[..dim].to_vec()).collect();
            in_words(
                &Nodes {
                    points,
                    displacements,
                },
                &z,
            )
        };
        let is = |found: Option<String>, words: &str| assert_eq!(found.as_deref(), Some(words));
        is(named(2, &|_| [-1.0, 0.0, 0.0]), "slides along (-1, 0)");
        is(named(3, &|_| [0.6, 0.0, 0.8]), "slides along (0.6, 0, 0.8)");
        // About (3, −1): u = 0.2 (−(y + 1), x − 3).
        is(
            named(2, &|p| [-0.2 * (p[1] + 1.0), 0.2 * (p[0] - 3.0), 0.0]),
            "turns about (3, -1)",
        );
        is(
            named(3, &|p| [-0.2 * (p[1] + 1.0), 0.2 * (p[0] - 3.0), 0.0]),
            "turns about the line through (3, -1, 0.5) along (0, 0, 1)",
        );
        is(
            named(3, &|p| [-0.2 * (p[1] + 1.0), 0.2 * (p[0] - 3.0), 0.1]),
            "turns about the line through (3, -1, 0.5) along (0, 0, 1), along which it slides",
        );
        assert_eq!(named(2, &|p| [p[0] * p[1], 0.0, 0.0]), None);
    }
}
