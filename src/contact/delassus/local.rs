//! One contact on its own, exactly: the step of the nonsmooth Gauss–Seidel iteration.

use super::cone::tangential_norm;
use super::scaled::Block;
use super::tolerances::SLIP_STEPS;

/// The reaction of a single contact with u = W r + b.
///
/// Open if b_N ≥ 0. Else it sticks with r = −W⁻¹ b where that lies in the cone. Else it slips, u_N = 0 and u_T = −s r_T with an
/// s > 0 at which μ r_N = ‖r_T‖; with S the Schur complement of W_NN,
///
/// r_T(s) = −(S + s I)⁻¹ (b_T − W_TN b_N / W_NN),  r_N(s) = −(b_N + W_NT r_T) / W_NN.
///
/// At s = 0 the reaction is outside the cone, and inside for s → ∞, where r_N → −b_N / W_NN > 0: a bracket for every positive semidefinite
/// W, symmetric or not. In the plane the sign of r_T is that of −(b_T − W_TN b_N / W_NN) for every s, and the remaining equation is linear.
pub(super) fn solve_contact<const D: usize>(w: &Block<D>, b: &[f64; D], mu: f64) -> [f64; D] {
    let mut r = [0.0; D];
    if b[0] >= 0.0 {
        return r;
    }
    let wn = w[0][0];
    if wn <= 0.0 {
        return r;
    }
    let mut schur = [[0.0; 2]; 2];
    let mut c = [0.0; 2];
    for a in 1..D {
        c[a - 1] = b[a] - w[a][0] * b[0] / wn;
        for e in 1..D {
            schur[a - 1][e - 1] = w[a][e] - w[a][0] * w[0][e] / wn;
        }
    }
    if mu == 0.0 || c == [0.0; 2] {
        r[0] = -b[0] / wn;
        return r;
    }
    if D == 2 {
        schur[1][1] = 1.0;
        let traction = -c[0] / schur[0][0];
        let normal = -(b[0] + w[0][1] * traction) / wn;
        // False, as infinite or NaN, where S vanishes.
        if mu * normal - traction.abs() >= 0.0 {
            return std::array::from_fn(|k| if k == 0 { normal } else { traction });
        }
        let against = -mu * c[0].signum();
        let pivot = wn + w[0][1] * against;
        if pivot > 0.0 {
            r[0] = -b[0] / pivot;
            r[1] = against * r[0];
            return r;
        }
    }
    let mut at = |s: f64| -> f64 {
        let (p, q) = (schur[0][0] + s, schur[1][1] + s);
        let det = p * q - schur[0][1] * schur[1][0];
        let t = [
            -(q * c[0] - schur[0][1] * c[1]) / det,
            -(p * c[1] - schur[1][0] * c[0]) / det,
        ];
        let mut normal = b[0];
        for a in 1..D {
            r[a] = t[a - 1];
            normal += w[0][a] * t[a - 1];
        }
        r[0] = -normal / wn;
        // ≥ 0 inside the cone; nearly linear in s.
        mu * r[0] / tangential_norm(&r) - 1.0
    };
    // A singular S gives infinities or NaN at s = 0.
    let stick = at(0.0);
    if stick >= 0.0 {
        return r;
    }
    let (mut low, mut f_low) = (0.0, stick);
    let mut high = schur[0][0].abs().max(schur[1][1].abs()).max(f64::MIN_POSITIVE);
    let mut f_high = at(high);
    while f_high.is_nan() || f_high < 0.0 {
        (low, f_low) = (high, f_high);
        high *= 10.0;
        if high > 1e100 {
            return [0.0; D];
        }
        f_high = at(high);
    }
    // Regula falsi (Illinois), with bisection where it is slow.
    let mut side = 0;
    for step in 0..SLIP_STEPS {
        if high - low <= 1e-15 * high || f_high.abs() < 1e-15 {
            break;
        }
        let secant = (low * f_high - high * f_low) / (f_high - f_low);
        let s = match step % 4 {
            3 if low > 0.0 => (low * high).sqrt(),
            3 => 1e-3 * high,
            _ if secant > low && secant < high => secant,
            _ => 0.5 * (low + high),
        };
        let f = at(s);
        if f >= 0.0 {
            (high, f_high) = (s, f);
            if side == 1 {
                f_low *= 0.5;
            }
            side = 1;
        } else {
            low = s;
            f_low = if f.is_nan() { -1.0 } else { f };
            if side == -1 {
                f_high *= 0.5;
            }
            side = -1;
        }
    }
    at(high);
    r
}

#[cfg(test)]
mod tests {
    use super::solve_contact;
    use crate::spread::Random;

    /// W = B Bᵀ and any b: open, stick or slip, by the law itself.
    fn laws_hold<const D: usize>() {
        let mut rng = Random::new(D as u64);
        let mut states = [0; 3];
        for _ in 0..600 {
            let factor: [[f64; D]; D] = std::array::from_fn(|_| std::array::from_fn(|_| rng.symmetric()));
            let product = |i: usize, j: usize| (0..D).map(|k| factor[i][k] * factor[j][k]).sum::<f64>();
            let w: [[f64; D]; D] = std::array::from_fn(|i| {
                std::array::from_fn(|j| product(i, j) + if i == j { 0.1 } else { 0.0 })
            });
            let b: [f64; D] = std::array::from_fn(|_| rng.symmetric());
            let mu = 0.2 + rng.symmetric().abs();
            let r = solve_contact(&w, &b, mu);
            let u: [f64; D] = std::array::from_fn(|i| b[i] + (0..D).map(|j| w[i][j] * r[j]).sum::<f64>());
            let traction = r[1..].iter().map(|t| t * t).sum::<f64>().sqrt();
            let slip = u[1..].iter().map(|v| v * v).sum::<f64>().sqrt();
            if b[0] >= 0.0 {
                states[0] += 1;
                assert_eq!(r, [0.0; D]);
                continue;
            }
            assert!(r[0] > 0.0 && u[0].abs() < 1e-12, "{r:?} {u:?}");
            assert!(traction <= mu * r[0] + 1e-12);
            states[if slip > 1e-9 { 2 } else { 1 }] += 1;
            if slip > 1e-9 {
                assert!((traction - mu * r[0]).abs() < 1e-10);
                let against: f64 = u[1..].iter().zip(&r[1..]).map(|(u, r)| u * r).sum();
                assert!((against + slip * traction).abs() < 1e-10);
            }
            // Without friction the pressure alone acts.
            let smooth = solve_contact(&w, &b, 0.0);
            assert!((w[0][0] * smooth[0] + b[0]).abs() < 1e-14 && smooth[1..].iter().all(|t| *t == 0.0));
        }
        assert!(states.iter().all(|n| *n > 10), "{states:?}");
    }

    /// In the plane, W = (1, c)(1, c)ᵀ, with which only a traction at the bound is in equilibrium: u_N = 0 and ‖r_T‖ = μ r_N determine one
    /// reaction, by the signs of c and of the slip.
    #[test]
    fn contacts_without_stiffness_of_their_own_slip() {
        for c in [-0.8, -0.1, 0.0, 0.3, 1.5] {
            for slip in [-2.0, 0.5] {
                let (mu, bn) = (0.4, -1.5);
                // With u_N = 0 the slip is b_T − c b_N.
                let r = solve_contact(&[[1.0, c], [c, c * c]], &[bn, slip + c * bn], mu);
                let normal = 1.5 / (1.0 - f64::signum(slip) * mu * c);
                assert!((r[0] - normal).abs() < 1e-14 * normal, "{r:?} {c} {slip}");
                assert!(
                    (r[1] + f64::signum(slip) * mu * normal).abs() < 1e-14 * normal,
                    "{r:?} {c} {slip}"
                );
            }
        }
    }

    #[test]
    fn single_contacts_obey_the_law() {
        laws_hold::<2>();
        laws_hold::<3>();
    }
}
