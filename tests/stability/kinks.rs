use semismooth::continuation::{ContinuationOptions, Direction};
use semismooth::parametric;
use semismooth::stability::{BoundaryKind, Dynamics};

fn range(from: f64, to: f64) -> ContinuationOptions {
    ContinuationOptions::default().with_parameter_range((from, to))
}

/// The eigenvalues of one side are ρ ± i, of the other −ρ ± 2i: the equilibrium goes on through the kink at α = 0, where two eigenvalues jump
/// across the axis and a cycle may be born, but there is no Hopf point.
#[test]
fn kinked_hopf() {
    let rho = 0.2;
    // y′ = A y + (B − A) max(y₁, 0)-column − α e: continuous across y₁ = 0.
    let map = parametric(2, 1, |y, a| {
        let (plus, minus) = (y[0].max(0.0), y[0].min(0.0));
        // Companion forms: tr = −2ρ, det = ρ² + 4 on the left; tr = 2ρ, det = ρ² + 1 on the right.
        vec![
            -2.0 * rho * minus + 2.0 * rho * plus + y[1],
            -(rho * rho + 4.0) * minus - (rho * rho + 1.0) * plus + a[0],
        ]
    });
    let found = Dynamics::new(&map)
        .follow(
            &[-1.0 / (rho * rho + 4.0), -2.0 * rho / (rho * rho + 4.0), -1.0],
            Direction::Increasing,
            range(-1.0, 1.0),
        )
        .unwrap();
    assert_eq!(
        (found.hopf.len(), found.kinks.len(), found.unexplained.len()),
        (0, 1, 0)
    );
    let kink = &found.kinks[0];
    assert_eq!(kink.kind, BoundaryKind::Persistence);
    assert!(kink.transition.parameter().abs() < 1e-14);
    assert_eq!((kink.before.unstable, kink.after.unstable), (0, 2));
    let (z, w) = (kink.before.eigenvalues[0], kink.after.eigenvalues[0]);
    assert!((z.0 + rho).abs() < 1e-14 && (z.1 - 2.0).abs() < 1e-14, "{z:?}");
    assert!((w.0 - rho).abs() < 1e-14 && (w.1 - 1.0).abs() < 1e-14, "{w:?}");
}

/// y₁′ = α − |y₁|, y₂′ = −y₂: a node and a saddle meet at α = 0 and vanish; det A changes its sign.
#[test]
fn nonsmooth_fold() {
    let map = parametric(2, 1, |y, a| vec![a[0] - y[0].abs(), -1.0 * y[1]]);
    let found = Dynamics::new(&map)
        .follow(&[1.0, 0.0, 1.0], Direction::Decreasing, range(-1.0, 1.0))
        .unwrap();
    assert_eq!(found.kinks.len(), 1);
    let kink = &found.kinks[0];
    assert_eq!(kink.kind, BoundaryKind::NonsmoothFold);
    assert_eq!((kink.before.unstable, kink.after.unstable), (0, 1));
    assert!(
        found
            .stretches
            .iter()
            .all(|s| (s.unstable == 0) == (s.ends[0][0] + s.ends[1][0] > 0.0))
    );
}

/// The circuit of L. O. Chua with its piecewise linear diode, x′ = α (y − x − f(x)), y′ = x − y + z, z′ = −β y, f(x) = b x + (a − b)/2 (|x + 1| − |x −
/// 1|), driven by a constant: the curve of equilibria in the drive crosses all three pieces, and eigenvalues are roots of λ³ + (1 + α + α c) λ² +
/// (β + α c) λ + α β (1 + c) with the slope c of f.
#[test]
fn chua_circuit() {
    let (alpha, beta, inner, outer) = (9.0, 100.0 / 7.0, -8.0 / 7.0, -5.0 / 7.0);
    let map = parametric(3, 1, |y, drive| {
        let f = outer * y[0] + 0.5 * (inner - outer) * ((y[0] + 1.0).abs() - (y[0] - 1.0).abs());
        vec![
            alpha * (y[1] - y[0] - f),
            y[0] - y[1] + y[2] + drive[0],
            -beta * y[1],
        ]
    });
    // y = 0, f(x) = −x, z = −x − drive: at equilibria of the free circuit x = ±3/2 or 0 whatever the drive, which moves z alone.
    let outer_point = [1.5, 0.0, -1.5, 0.0];
    let cubic = |c: f64, z: (f64, f64)| {
        let mul = |a: (f64, f64), b: (f64, f64)| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
        let (z2, z3) = (mul(z, z), mul(z, mul(z, z)));
        let k = [
            1.0 + alpha + alpha * c,
            beta + alpha * c,
            alpha * beta * (1.0 + c),
        ];
        let sum = |p: fn((f64, f64)) -> f64, constant: f64| p(z3) + k[0] * p(z2) + k[1] * p(z) + constant;
        sum(|z| z.0, k[2]).hypot(sum(|z| z.1, 0.0))
    };
    let dynamics = Dynamics::new(&map);
    for (x, c, unstable) in [
        (outer_point, outer, 2),
        ([0.0; 4], inner, 1),
        ([-1.5, 0.0, 1.5, 0.0], outer, 2),
    ] {
        let found = dynamics.spectrum(&x).unwrap();
        assert_eq!(found.unstable, unstable, "{found:?}");
        for z in &found.eigenvalues {
            assert!(cubic(c, *z) < 1e-11, "{z:?}");
        }
    }
    // With a source at the diode, 0 = y − x − f(x) + drive, the equilibria run through all pieces: two non-smooth folds at x = ±1.
    let driven = parametric(3, 1, |y, drive| {
        let f = outer * y[0] + 0.5 * (inner - outer) * ((y[0] + 1.0).abs() - (y[0] - 1.0).abs());
        vec![
            alpha * (y[1] - y[0] - f + drive[0]),
            y[0] - y[1] + y[2],
            -beta * y[1],
        ]
    });
    let found = Dynamics::new(&driven)
        .follow(&[1.5, 0.0, -1.5, 0.0], Direction::Decreasing, range(-1.0, 1.0))
        .unwrap();
    let kinds: Vec<_> = found
        .kinks
        .iter()
        .map(|k| (k.kind, k.before.unstable, k.after.unstable))
        .collect();
    assert_eq!(
        kinds,
        [
            (BoundaryKind::NonsmoothFold, 2, 1),
            (BoundaryKind::NonsmoothFold, 1, 2)
        ]
    );
    for (kink, sign) in found.kinks.iter().zip([1.0, -1.0]) {
        // f(±1) = ±a, so that the drive is ±(1 + a) = ∓1/7.
        assert!((kink.transition.parameter() - sign * (1.0 + inner)).abs() < 1e-14);
        assert!((kink.transition.x[0] - sign).abs() < 1e-14);
    }
    assert!(found.unexplained.is_empty());
}
