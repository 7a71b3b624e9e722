//! The Coulomb cone of one contact, components (N, T1[, T2]).

/// Euclidean projection onto K_μ = { z : ‖z_T‖ ≤ μ z_N }.
pub(super) fn project<const D: usize>(mu: f64, z: [f64; D]) -> [f64; D] {
    let t = tangential_norm(&z);
    // The apex first: for μ = 0 and z_T = 0 the other test holds on both halves of the normal.
    if mu * t <= -z[0] {
        return [0.0; D];
    }
    if t <= mu * z[0] {
        return z;
    }
    // t > 0 here: t = 0 falls into one of the two cases above, up to z_N = NaN.
    let normal = (z[0] + mu * t) / (1.0 + mu * mu);
    let scale = mu * normal / t;
    let mut p = z.map(|v| scale * v);
    p[0] = normal;
    p
}

/// û = u + μ‖u_T‖ e_N (G. De Saxcé, Z.-Q. Feng 1991): with it the Coulomb law is K* ∋ û ⟂ r ∈ K.
pub(super) fn de_saxce<const D: usize>(mu: f64, mut u: [f64; D]) -> [f64; D] {
    u[0] += mu * tangential_norm(&u);
    u
}

pub(super) fn tangential_norm<const D: usize>(z: &[f64; D]) -> f64 {
    match D {
        2 => z[1].abs(),
        // Overflow is no concern here: problems are scaled before they are solved.
        _ => z[1..].iter().map(|v| v * v).sum::<f64>().sqrt(),
    }
}

/// Squared norm of r − P_K(r − ρ û).
pub(super) fn natural_residual<const D: usize>(mu: f64, rho: f64, r: &[f64; D], u: &[f64; D]) -> f64 {
    let shifted = de_saxce(mu, *u);
    let mut z = *r;
    for k in 0..D {
        z[k] -= rho * shifted[k];
    }
    let p = project(mu, z);
    (0..D).map(|k| (r[k] - p[k]) * (r[k] - p[k])).sum()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Moreau: z = P_K(z) − P_K*(−z), and K* = K_{1/μ}.
        #[test]
        fn projection_is_moreau(mu in 1e-3..10.0_f64, z in prop::array::uniform3(-5.0..5.0_f64)) {
            let p = project(mu, z);
            let d = project(1.0 / mu, z.map(|v| -v));
            let product: f64 = (0..3).map(|k| p[k] * d[k]).sum();
            prop_assert!(product.abs() < 1e-12);
            for k in 0..3 {
                prop_assert!((p[k] - d[k] - z[k]).abs() < 1e-12);
            }
            prop_assert!(tangential_norm(&p) <= mu * p[0] + 1e-12);
            prop_assert!(tangential_norm(&d) <= d[0] / mu + 1e-12);
        }
    }

    #[test]
    fn frictionless_cone_is_a_half_line() {
        assert_eq!(project(0.0, [2.0, 1.0, -1.0]), [2.0, 0.0, 0.0]);
        assert_eq!(project(0.0, [-2.0, 1.0]), [0.0, 0.0]);
        assert_eq!(project(0.0, [-2.0, 0.0]), [0.0, 0.0]);
        assert_eq!(project(0.0, [-2.0, 0.0, 0.0]), [0.0; 3]);
        assert_eq!(project(0.0, [2.0, 0.0]), [2.0, 0.0]);
        assert_eq!(project(0.0, [0.0, 0.0]), [0.0, 0.0]);
    }
}
