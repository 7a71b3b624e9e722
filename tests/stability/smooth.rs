use semismooth::continuation::{ContinuationOptions, Direction};
use semismooth::parametric;
use semismooth::piecewise::{Expression, PiecewiseSmooth};
use semismooth::stability::{Dynamics, StabilityBranch, StabilityError};

fn range(from: f64, to: f64) -> ContinuationOptions {
    ContinuationOptions::default().with_parameter_range((from, to))
}

/// y₁′ = a + y₁² y₂ − (b + 1) y₁, y₂′ = b y₁ − y₁² y₂ of I. Prigogine and R. Lefever: the equilibrium (a, b/a) has a Hopf point at b = 1 + a²
/// with ω = a. A third unknown with an algebraic equation changes nothing.
#[test]
fn brusselator() {
    let a = 1.3;
    let plain = parametric(2, 1, |y, b| {
        let rate = y[0] * y[0] * y[1];
        vec![a + rate - (b[0] + 1.0) * y[0], b[0] * y[0] - rate]
    });
    let found = Dynamics::new(&plain)
        .follow(&[a, 0.5 / a, 0.5], Direction::Increasing, range(0.5, 4.0))
        .unwrap();
    let algebraic = parametric(3, 1, |y, b| {
        vec![
            a + y[2] - (b[0] + 1.0) * y[0],
            3.0 * (b[0] * y[0] - y[2]),
            y[0] * y[0] * y[1] - y[2],
        ]
    });
    let dynamics = Dynamics::new(&algebraic).with_mass(vec![1.0, 3.0, 0.0]).unwrap();
    let other = dynamics
        .follow(
            &[a, 0.5 / a, 0.5 * a, 0.5],
            Direction::Increasing,
            range(0.5, 4.0),
        )
        .unwrap();
    for found in [&found, &other] {
        assert_eq!(
            (found.hopf.len(), found.kinks.len(), found.unexplained.len()),
            (1, 0, 0)
        );
        let hopf = &found.hopf[0];
        assert!(
            (hopf.parameter() - (1.0 + a * a)).abs() < 1e-11 && (hopf.frequency - a).abs() < 1e-10,
            "{hopf}"
        );
        for (point, spectrum) in found.branch.points.iter().zip(&found.spectra) {
            let b = point.parameter();
            assert_eq!(spectrum.unstable, if b > 1.0 + a * a { 2 } else { 0 });
            // λ² − (b − 1 − a²) λ + a² = 0.
            let [z, w] = [spectrum.eigenvalues[0], spectrum.eigenvalues[1]];
            assert!((z.0 + w.0 - (b - 1.0 - a * a)).abs() < 1e-11);
            assert!((z.0 * w.0 - z.1 * w.1 - a * a).abs() < 1e-10);
        }
        let change = found
            .stretches
            .windows(2)
            .filter(|w| w[0].unstable != w[1].unstable)
            .count();
        assert_eq!(change, 1);
    }
}

type Rho = for<'a> fn(Expression<'a>) -> Expression<'a>;

/// Uncoupled normal forms of Hopf, z′ = (ρ(α) + iω) z − |z|² z with the given ρ and ω, beside y′ = (α − α₀) y
/// − y³ where α₀ is given.
fn normal_forms(pairs: &'static [(Rho, f64)], real: Option<f64>) -> impl PiecewiseSmooth + Sync {
    parametric(2 * pairs.len() + usize::from(real.is_some()), 1, move |y, a| {
        let mut rates = Vec::new();
        for ((rho, omega), z) in pairs.iter().zip(y.chunks(2)) {
            let rate = rho(a[0]) - z[0] * z[0] - z[1] * z[1];
            rates.extend([rate * z[0] - *omega * z[1], *omega * z[0] + rate * z[1]]);
        }
        if let Some(at) = real {
            let last = y[2 * pairs.len()];
            rates.push((a[0] - at - last * last) * last);
        }
        rates
    })
}

/// Several Hopf points in one step are located, or it is said that some are not: of pairs that cross in the
/// same direction or in opposite ones, of one that crosses twice, and beside a branch point, where a real
/// eigenvalue crosses.
#[test]
fn several_in_one_step() {
    const SAME: &[(Rho, f64)] = &[(|a| a - 0.35, 2.0), (|a| a - 0.62, 5.0)];
    const OPPOSITE: &[(Rho, f64)] = &[(|a| a - 0.35, 2.0), (|a| 0.62 - a, 5.0)];
    const CROSSED: &[(Rho, f64)] = &[(|a| 0.35 - a, 2.0), (|a| a - 0.62, 5.0)];
    const TWICE: &[(Rho, f64)] = &[(|a| (a - 0.35) * (0.62 - a), 2.0)];
    const ONE: &[(Rho, f64)] = &[(|a| a - 0.35, 2.0)];
    const TRIPLE: &[(Rho, f64)] = &[
        (|a| a - 0.35, 2.0),
        (|a| 2.0 * (a - 0.62), 5.0),
        (|a| 0.41 - a, 3.0),
    ];
    type Points = &'static [(f64, f64)];
    let cases: [(_, _, Points); 6] = [
        (SAME, None, &[(0.35, 2.0), (0.62, 5.0)]),
        (OPPOSITE, None, &[(0.35, 2.0), (0.62, 5.0)]),
        (CROSSED, None, &[(0.35, 2.0), (0.62, 5.0)]),
        (TWICE, None, &[(0.35, 2.0), (0.62, 2.0)]),
        (ONE, Some(0.62), &[(0.35, 2.0)]),
        (TRIPLE, None, &[(0.35, 2.0), (0.41, 3.0), (0.62, 5.0)]),
    ];
    for (case, (pairs, real, expected)) in cases.into_iter().enumerate() {
        for step in [1.0, 0.7, 0.3, 0.05] {
            let map = normal_forms(pairs, real);
            let start = vec![0.0; map.num_vars()];
            let options = range(0.0, 1.0).with_step(step).with_max_step(step);
            let found = Dynamics::new(&map)
                .follow(&start, Direction::Increasing, options)
                .unwrap();
            let points: Vec<_> = found.hopf.iter().map(|h| (h.parameter(), h.frequency)).collect();
            // Eigenvalues that exchange their ranks between their crossings may take a long step past some.
            if case == 5 && step > 0.2 && points.len() < expected.len() {
                assert!(!found.unexplained.is_empty(), "step {step}: {points:?}");
                continue;
            }
            assert_eq!(points.len(), expected.len(), "{case}, step {step}: {points:?}");
            for ((at, omega), (exact, exact_omega)) in points.iter().zip(expected) {
                assert!(
                    (at - exact).abs() < 1e-12 && (omega - exact_omega).abs() < 1e-11,
                    "{case}: {points:?}"
                );
            }
            assert_eq!(found.branch.branch_points.len(), usize::from(real.is_some()));
            assert!(
                found.unexplained.is_empty(),
                "{case}, step {step}: {:?}",
                found.unexplained
            );
        }
    }
}

/// ρ = 0.1 − cos 2πα rises and falls between α = 0 and 1, where it is level: a step that long does not find
/// the points in it, and says so.
#[test]
fn steps_that_pass_over_points() {
    const WAVE: &[(Rho, f64)] = &[(|a| 0.1 - (std::f64::consts::TAU * a).cos(), 2.0)];
    let map = normal_forms(WAVE, None);
    let exact = 0.1_f64.acos() / std::f64::consts::TAU;
    for step in [1.0, 0.6, 0.4, 0.2, 0.1] {
        let options = range(0.0, 1.0).with_step(step).with_max_step(step);
        let found = Dynamics::new(&map)
            .follow(&[0.0; 3], Direction::Increasing, options)
            .unwrap();
        let points: Vec<f64> = found.hopf.iter().map(|h| h.parameter()).collect();
        let all = points.len() == 2 && (points[0] - exact).abs() + (points[1] - 1.0 + exact).abs() < 1e-11;
        assert!(all || !found.unexplained.is_empty(), "step {step}: {points:?}");
        assert!(
            step > 0.3 || (all && found.unexplained.is_empty()),
            "step {step}: {points:?}"
        );
    }
}

/// 0 = y₁ does not determine y₂: the system is not of index 1.
#[test]
fn algebraic_equations_must_determine_their_unknowns() {
    let map = parametric(2, 1, |y, a| vec![y[1] - a[0] - y[0], 1.0 * y[0]]);
    let dynamics = Dynamics::new(&map).with_mass(vec![1.0, 0.0]).unwrap();
    assert_eq!(dynamics.spectrum(&[0.0; 3]), Err(StabilityError::Index));
}

/// Two pairs that cross one after the other, a real pair λ, −λ that is none, and folds in between.
#[test]
fn what_is_and_what_is_no_hopf_point() {
    // Pairs (α − 0.3) ± 2i and (0.7 − α) ± 5i at y = 0.
    let two = parametric(4, 1, |y, a| {
        vec![
            (a[0] - 0.3) * y[0] - 2.0 * y[1],
            2.0 * y[0] + (a[0] - 0.3) * y[1],
            (0.7 - a[0]) * y[2] - 5.0 * y[3],
            5.0 * y[2] + (0.7 - a[0]) * y[3],
        ]
    });
    let found = Dynamics::new(&two)
        .follow(&[0.0, 0.0, 0.0, 0.0, 0.0], Direction::Increasing, range(0.0, 1.0))
        .unwrap();
    let points: Vec<_> = found.hopf.iter().map(|h| (h.parameter(), h.frequency)).collect();
    assert_eq!(points.len(), 2, "{points:?}");
    assert!(
        (points[0].0 - 0.3).abs() < 1e-12 && (points[0].1 - 2.0).abs() < 1e-11,
        "{points:?}"
    );
    assert!(
        (points[1].0 - 0.7).abs() < 1e-12 && (points[1].1 - 5.0).abs() < 1e-11,
        "{points:?}"
    );
    assert_eq!(found.spectra.iter().map(|s| s.unstable).max(), Some(4));
    // Eigenvalues 1 and α − 2: at α = 1 their sum vanishes.
    let saddle = parametric(2, 1, |y, a| vec![1.0 * y[0], (a[0] - 2.0) * y[1]]);
    let found = Dynamics::new(&saddle)
        .follow(&[0.0, 0.0, 0.0], Direction::Increasing, range(0.0, 1.5))
        .unwrap();
    assert_eq!((found.branch.monitor_crossings.len(), found.hopf.len()), (0, 0));
    assert!(found.unexplained.is_empty() && found.spectra.iter().all(|s| s.unstable == 1));
    // A fold y₁² = α with the other eigenvalue −1: one side is stable.
    let fold = parametric(2, 1, |y, a| vec![a[0] - y[0] * y[0], -1.0 * y[1]]);
    let found = Dynamics::new(&fold)
        .follow(&[1.0, 0.0, 1.0], Direction::Decreasing, range(-1.0, 2.0))
        .unwrap();
    assert!(found.branch.smooth_folds.len() == 1 && found.unexplained.is_empty());
    for (point, spectrum) in found.branch.points.iter().zip(&found.spectra) {
        if spectrum.undecided == 0 {
            assert_eq!(spectrum.is_stable(), Some(point.x[0] > 0.0));
        }
    }
}

/// Rounding moves k equal eigenvalues with one eigenvector by its k-th root. Blocks of Jordan in turned coordinates: with the eigenvalue 0, and
/// with one that is negative but within that, no sign is told; farther away it is.
#[test]
fn equal_eigenvalues_are_told_from_rounding() {
    // Rows of length 1, orthogonal but for rounding.
    let turn = [[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]];
    for (diagonal, coupled, stable) in [
        ([0.0, 0.0, 0.0], [1.0, 1.0], None),
        ([0.0, 0.0, -1.0], [1.0, 0.0], None),
        ([-1e-8, -1e-8, -1.0], [1.0, 0.0], None),
        ([-1e-6, -1e-6, -1e-6], [1.0, 1.0], None),
        ([-1e-3, -1e-3, -1e-3], [1.0, 1.0], Some(true)),
        ([-1e-6, -2e-6, -1.0], [0.0, 0.0], Some(true)),
        ([1e-3, 1e-3, -1.0], [1.0, 0.0], Some(false)),
    ] {
        let block = |i: usize, j: usize| match j.checked_sub(i) {
            Some(0) => diagonal[i],
            Some(1) => coupled[i],
            _ => 0.0,
        };
        let entry = |i: usize, j: usize| -> f64 {
            let term = |k: usize, l: usize| turn[i][k] * block(k, l) * turn[j][l];
            (0..3).map(|k| (0..3).map(|l| term(k, l)).sum::<f64>()).sum()
        };
        let map = parametric(3, 1, |y, _| {
            (0..3)
                .map(|i| entry(i, 0) * y[0] + entry(i, 1) * y[1] + entry(i, 2) * y[2])
                .collect()
        });
        let found = Dynamics::new(&map).spectrum(&[0.0; 4]).unwrap();
        assert_eq!(found.is_stable(), stable, "{diagonal:?}: {found:?}");
    }
}

/// The chain y′ = tridiag(1, −2, 1) y of n equations has the eigenvalues −4 sin²(kπ / 2(n+1)).
#[test]
fn some_eigenvalues_of_large_systems() {
    let n = 1500;
    let chain = parametric(n, 1, |y, a| {
        let at = |i: usize| y[i];
        (0..n)
            .map(|i| {
                let mut sum = -2.0 * at(i) + 0.0 * a[0];
                if i > 0 {
                    sum += at(i - 1);
                }
                if i + 1 < n {
                    sum += at(i + 1);
                }
                sum
            })
            .collect()
    });
    let x = vec![0.0; n + 1];
    let dynamics = Dynamics::new(&chain);
    assert!(matches!(
        dynamics.spectrum(&x),
        Err(StabilityError::TooLarge { size: 1500, .. })
    ));
    let found = dynamics.nearest(&x, 1e-3, 6).unwrap();
    for (k, ritz) in found.iter().enumerate() {
        let half = std::f64::consts::PI * (k + 1) as f64 / (2 * (n + 1)) as f64;
        let exact = -4.0 * half.sin().powi(2);
        assert!(
            (ritz.value.0 - exact).abs() < 1e-9 * (exact - 1e-3).abs() && ritz.value.1 == 0.0,
            "{k} {ritz:?} {exact}"
        );
        assert!(ritz.change < 1e-6, "{ritz:?}");
    }
}

/// The neural mass model of J. M. Cortes and others (2013) with the parameters of a tutorial of BifurcationKit.jl, whose documentation prints
/// folds at E₀ ≈ −1.46302733 and −1.86522391, and Hopf points in (−1.85012460, −1.85012447) and (−1.15105942, −1.15105934).
#[test]
fn neural_mass() {
    let [alpha, tau, gain, tau_d, u0, tau_f] = [1.5, 0.013, 3.07, 0.2, 0.3, 1.5];
    let map = parametric(3, 1, |z, e0| {
        let input = gain * z[2] * z[1] * z[0] + e0[0];
        let rate = alpha * ((input / alpha).exp() + 1.0).ln();
        vec![
            (rate - z[0]) / tau,
            (1.0 - z[1]) / tau_d - z[2] * z[1] * z[0],
            (u0 - z[2]) / tau_f + u0 * (1.0 - z[2]) * z[0],
        ]
    });
    let start = [0.238616, 0.982747, 0.367876, -2.0];
    let options = range(-4.0, -0.9).with_max_step(0.05);
    let found = Dynamics::new(&map)
        .follow(&start, Direction::Increasing, options)
        .unwrap();
    let folds = found.branch.folds();
    assert_eq!(folds.len(), 2);
    assert!(
        (folds[0] + 1.46302733).abs() < 1e-8 && (folds[1] + 1.86522391).abs() < 1e-8,
        "{folds:?}"
    );
    let mut hopf: Vec<f64> = found.hopf.iter().map(|h| h.parameter()).collect();
    hopf.sort_by(f64::total_cmp);
    assert_eq!(hopf.len(), 2, "{hopf:?}");
    assert!(
        hopf[0] > -1.8501246 - 1e-8 && hopf[0] < -1.85012447 + 1e-8,
        "{hopf:?}"
    );
    assert!(
        hopf[1] > -1.15105942 - 1e-8 && hopf[1] < -1.15105934 + 1e-8,
        "{hopf:?}"
    );
    assert!(found.unexplained.is_empty(), "{:?}", found.unexplained);
    assert_eq!(
        (found.spectra[0].unstable, found.spectra.last().unwrap().unstable),
        (0, 0)
    );
    picture(&found);
}

/// Dashes say unstable, and Hopf points are marked.
#[cfg(feature = "svg")]
fn picture(found: &StabilityBranch) {
    use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
    let curve = Curve::of_stability(found, |x| x[0], &SegmentStyle::new("equilibria", Colour::BLUE));
    let svg = BranchDiagram::new(Panel::new("E0", "E").with_curve(curve))
        .to_svg()
        .unwrap();
    for word in ["unstable", "Hopf point", "smooth fold", "stroke-dasharray"] {
        assert!(svg.contains(word), "{word}");
    }
    assert!(!svg.contains("det &lt; 0") && !svg.contains("det < 0"));
}

#[cfg(not(feature = "svg"))]
fn picture(_: &StabilityBranch) {}
