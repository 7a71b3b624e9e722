//! Square roots in the Jordan algebra of a second-order cone, and the Fischer–Burmeister function that is made of them.

use crate::sparse::norm;
use crate::tolerances::SUM;

/// The eigenvalues of z = (x² + y² + 2 μ² e)^½, which belong to the idempotents ½ (1, w) and ½ (1, −w), ‖w‖ = 1.
#[derive(Clone, Copy)]
struct Root {
    large: f64,
    small: f64,
}

impl Root {
    /// w is written to `axis[1..]`. The smaller eigenvalue is ‖x₁ − x₀ w‖² + ‖y₁ − y₀ w‖² + 2 μ², squared, which does not cancel.
    fn new(mu: f64, x: &[f64], y: &[f64], axis: &mut [f64]) -> Self {
        let shift = 2.0 * mu * mu;
        let squares = x.iter().chain(y).map(|v| v * v).sum::<f64>() + shift;
        let n = x.len();
        if n == 1 {
            let root = squares.sqrt();
            return Self {
                large: root,
                small: root,
            };
        }
        for i in 1..n {
            axis[i] = 2.0 * (x[0] * x[i] + y[0] * y[i]);
        }
        let length = norm(&axis[1..]);
        if length >= f64::MIN_POSITIVE {
            axis[1..].iter_mut().for_each(|w| *w /= length);
        } else {
            axis[1..].fill(0.0);
            axis[1] = 1.0;
        }
        let across = |a: &[f64]| -> f64 { (1..n).map(|i| (a[i] - a[0] * axis[i]).powi(2)).sum() };
        Self {
            large: (squares + length).sqrt(),
            small: (across(x) + across(y) + shift).sqrt(),
        }
    }
}

/// x + y − (x² + y² + 2 μ² e)^½.
pub(super) fn fischer_burmeister(mu: f64, x: &[f64], y: &[f64], out: &mut [f64]) {
    let Root { large, small } = Root::new(mu, x, y, out);
    for i in 0..x.len() {
        let root = match i {
            0 => 0.5 * (large + small),
            _ => 0.5 * (large - small) * out[i],
        };
        out[i] = x[i] + y[i] - root;
    }
}

/// Its derivatives by x and by y, n × n row by row: I − L_z⁻¹ L_x and I − L_z⁻¹ L_y, where L_a b = a ∘ b.
///
/// Where x² + y² lies on the boundary and μ = 0 there is no derivative: then their limits along (x + t e, y + t `rate`), t ↓ 0, which is
/// inside for small t. `room` has length 3 n.
pub(super) fn derivatives(
    mu: f64,
    [x, y]: [&[f64]; 2],
    rate: Option<&[f64]>,
    by: [&mut [f64]; 2],
    room: &mut [f64],
) {
    let n = x.len();
    let rate = |i: usize| rate.map_or(0.0, |r| r[i]);
    let unit = |i: usize| f64::from(u8::from(i == 0));
    let (axis, rest) = room.split_at_mut(n);
    let (turned_x, turned_y) = rest.split_at_mut(n);
    let root = Root::new(mu, x, y, axis);
    if root.large <= f64::MIN_POSITIVE {
        // The derivative is the same all along the ray from the origin.
        let (x, y): (Vec<f64>, Vec<f64>) = (0..n).map(|i| (unit(i), rate(i))).unzip();
        return derivatives(0.0, [&x, &y], None, by, room);
    }
    // (a₁ − a₀ w)/λ for the smaller eigenvalue λ, or the limits.
    let boundary = root.small <= SUM * root.large;
    let squares = x[0] * x[0] + y[0] * y[0];
    let along = |d: &dyn Fn(usize) -> f64| -> f64 { (1..n).map(|i| axis[i] * d(i)).sum() };
    let (along_x, along_y) = (along(&unit), along(&rate));
    for i in 1..n {
        if boundary {
            let axis_rate =
                (x[0] * (unit(i) - along_x * axis[i]) + y[0] * (rate(i) - along_y * axis[i])) / squares;
            turned_x[i] = unit(i) - unit(0) * axis[i] - x[0] * axis_rate;
            turned_y[i] = rate(i) - rate(0) * axis[i] - y[0] * axis_rate;
        } else {
            turned_x[i] = (x[i] - x[0] * axis[i]) / root.small;
            turned_y[i] = (y[i] - y[0] * axis[i]) / root.small;
        }
    }
    if boundary {
        let length = norm(&turned_x[1..]).hypot(norm(&turned_y[1..]));
        let both = turned_x[1..].iter_mut().chain(&mut turned_y[1..]);
        both.for_each(|v| *v /= length);
    }
    for ((a, by), turned) in [x, y].into_iter().zip(by).zip([turned_x, turned_y]) {
        quotient(root, axis, a, turned, by);
        for (k, v) in by.iter_mut().enumerate() {
            *v = f64::from(u8::from(k % (n + 1) == 0)) - *v;
        }
    }
}

/// L_z⁻¹ L_a by the spectral decomposition of L_z, with `turned` the limit of (a₁ − a₀ w)/λ.
fn quotient(root: Root, axis: &[f64], a: &[f64], turned: &[f64], out: &mut [f64]) {
    let n = a.len();
    if n == 1 {
        out[0] = a[0] / root.large;
        return;
    }
    let dot = |v: &[f64]| -> f64 { (1..n).map(|i| axis[i] * v[i]).sum() };
    let (along, turned_along) = (dot(a), dot(turned));
    let (first, middle) = (0.5 / root.large, 2.0 / (root.large + root.small));
    for i in 0..n {
        for j in 0..n {
            let of_large = if j == 0 {
                a[0] + along
            } else {
                a[j] + a[0] * axis[j]
            };
            let of_small = if j == 0 { -turned_along } else { turned[j] };
            let (sign, between) = match (i, j) {
                (0, _) => (1.0, 0.0),
                (i, 0) => (axis[i], a[i] - axis[i] * along),
                (i, j) => (axis[i], a[0] * (f64::from(u8::from(i == j)) - axis[i] * axis[j])),
            };
            let opposite = if i == 0 { 1.0 } else { -axis[i] };
            out[i * n + j] = first * sign * of_large + middle * between + 0.5 * opposite * of_small;
        }
    }
}
