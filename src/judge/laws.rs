//! Laws that are checked as laws: Coulomb friction.

/// A quotient of sizes; 0 where there is nothing to divide, infinite where there is nothing to divide by, or the size overflows.
fn share(part: f64, size: f64) -> f64 {
    match () {
        () if part == 0.0 => 0.0,
        () if size.is_finite() => part / size,
        () => f64::INFINITY,
    }
}

fn length(v: &[f64]) -> f64 {
    v.iter().fold(0.0, |m: f64, v| m.hypot(*v))
}

/// The largest violation of Coulomb's law at one contact, each part of it relative to its own size: r_N ≥ 0 and ‖r_T‖ ≤ μ r_N to the size
/// of the reaction, u_N ≥ 0 to the terms that cancel in u_N, r_N or u_N = 0 to either, and r_T = −μ r_N u_T/‖u_T‖ where u_T is more than a
/// rounding of its terms. Components are (N, T1[, T2]); `terms` belong to u, `size` to r.
///
/// The cone alone would divide u_N by μ: in the dual of K_μ a velocity with a large ‖u_T‖ may have any u_N.
pub(crate) fn coulomb<const D: usize>(
    mu: f64,
    r: &[f64; D],
    u: &[f64; D],
    terms: &[f64; D],
    size: f64,
) -> f64 {
    if r.iter().chain(u).any(|v| !v.is_finite()) {
        return f64::INFINITY;
    }
    let (traction, bound) = (length(&r[1..]), mu * r[0].max(0.0));
    let penetration = share((-u[0]).max(0.0), terms[0]);
    let tension = share((-r[0]).max(0.0), size);
    let outside = share((traction - bound).max(0.0), size);
    let both = share(r[0].max(0.0), size).min(share(u[0].abs(), terms[0]));
    // r_T is the projection of r_T − ρ u_T on the disc of radius μ r_N for any ρ > 0: one that makes both of one size.
    let tangential = length(&terms[1..]);
    let rho = if tangential > 0.0 { size / tangential } else { 0.0 };
    let moved: [f64; D] = std::array::from_fn(|k| if k == 0 { 0.0 } else { r[k] - rho * u[k] });
    let reach = length(&moved);
    let cut = if reach > bound { bound / reach } else { 1.0 };
    let apart: [f64; D] = std::array::from_fn(|k| if k == 0 { 0.0 } else { r[k] - cut * moved[k] });
    let direction = share(length(&apart), size);
    [tension, outside, both, direction]
        .into_iter()
        .fold(penetration, f64::max)
}

#[cfg(test)]
mod tests {
    use super::coulomb;

    /// Open, stick and slip, and each part of the law violated by itself, with coefficients from 1e-6 to 1e12.
    #[test]
    fn each_part_of_the_law_counts_by_itself() {
        for mu in [1e-6, 0.3, 1e6, 1e12] {
            let size = 1.0 + mu;
            let law = |r: [f64; 3], u: [f64; 3]| coulomb(mu, &r, &u, &[2.0; 3], size);
            assert_eq!(law([0.0; 3], [1.0, 0.3, -0.2]), 0.0);
            assert_eq!(law([1.0, 0.5 * mu, 0.0], [0.0; 3]), 0.0);
            assert!(law([1.0, -0.6 * mu, 0.8 * mu], [0.0, 0.3, -0.4]) < 1e-15);
            // u_N < 0, r_N < 0, both positive, against the slip, outside the cone, slip inside of it.
            assert_eq!(law([0.0; 3], [-1.0, 1.0, 0.0]), 0.5);
            assert!(law([-1.0, 0.0, 0.0], [0.0; 3]) >= 1.0 / size);
            assert!(law([1.0, 0.0, 0.0], [1.0, 0.0, 0.0]) >= 0.5_f64.min(1.0 / size));
            assert!(law([1.0, mu, 0.0], [0.0, 1.0, 0.0]) >= 0.3 * mu / size);
            assert!(law([1.0, 2.0 * mu, 0.0], [0.0; 3]) >= 0.9 * mu / size);
            assert!(law([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]) >= 0.3 * mu.min(1.0));
        }
        assert_eq!(
            coulomb(0.5, &[0.0; 2], &[f64::NAN, 0.0], &[1.0; 2], 1.0),
            f64::INFINITY
        );
        assert_eq!(coulomb(0.5, &[0.0; 2], &[0.0; 2], &[0.0; 2], 0.0), 0.0);
    }
}
