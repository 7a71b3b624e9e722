use super::*;
use crate::piecewise::{Kinks, NonsmoothFunction, Real, Traced};
use crate::spread::Random;

/// A curve in the plane by its equation, with one kink |f| of weight `kink`.
struct Plane<F, G> {
    equation: F,
    kink: G,
}

trait Formula {
    fn of<T: Real>(&self, y: T, alpha: T) -> T;
}

macro_rules! formula {
    ($name:ident, |$y:ident, $alpha:ident| $value:expr) => {
        struct $name;
        impl Formula for $name {
            fn of<T: Real>(&self, $y: T, $alpha: T) -> T {
                $value
            }
        }
    };
}

formula!(Circle, |y, alpha| y * y + alpha * alpha - 1.0);
formula!(Folds, |y, alpha| y * y * y - y * 0.003 - alpha);
formula!(Parabola, |y, alpha| y * y - alpha);
formula!(Pair, |y, _alpha| y * y - 1e-4);
formula!(Cross, |y, alpha| y * (y - alpha));
formula!(Root, |y, alpha| y.sqrt() - alpha);
formula!(High, |y, _alpha| y - 0.5);
formula!(Tilted, |y, alpha| y + alpha * 0.1 - 0.2);

impl<F: Formula, G: Formula> NonsmoothFunction for Plane<F, G> {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let kink = self.kink.of(x[0], x[1]);
        out[0] = self.equation.of(x[0], x[1]) + (kinks.abs(kink) - kink);
    }
}

fn step<F: Formula, G: Formula>(equation: F, kink: G, from: [f64; 2], to: [f64; 2]) -> Option<StepEnclosure> {
    let map = Traced::new(Plane { equation, kink });
    step_enclosure(&map, &Selection::from_pieces([0]), &from, &to)
}

fn circle(degrees: f64) -> [f64; 2] {
    let (y, alpha) = degrees.to_radians().sin_cos();
    [y, alpha]
}

#[test]
fn a_step_on_a_circle_is_one_curve_up_to_a_third_of_it() {
    for length in [1e-6, 1e-3, 1.0, 20.0, 45.0, 60.0] {
        for start in [0.5, 100.0, 215.0, 318.0] {
            let found = step(Circle, High, circle(start), circle(start + length)).unwrap();
            assert!(found.regular, "{start} {length}");
            // α̇ = −y along increasing angles.
            let [first, last] = [start, start + length].map(|a| -a.to_radians().sin());
            let expected = (first * last > 0.0 && (length < 170.0)).then_some(first.signum());
            if length <= 1.0 {
                assert_eq!(found.rate, expected, "{start} {length}");
            } else {
                assert!(found.rate.is_none() || found.rate == expected);
            }
        }
    }
    assert!(!step(Circle, High, circle(0.0), circle(170.0)).unwrap().regular);
}

/// α̇ has the same sign at both ends, but changes it twice in between.
#[test]
fn two_folds_in_a_step_are_not_overlooked() {
    let at = |y: f64| [y, y * y * y - y * 0.003];
    let found = step(Folds, High, at(-0.2), at(0.2)).unwrap();
    assert!(found.regular && found.rate.is_none());
    for (from, to, rate) in [(0.05, 0.2, 1.0), (-0.05, -0.2, -1.0), (-0.02, 0.02, -1.0)] {
        let found = step(Folds, High, at(from), at(to)).unwrap();
        assert!(found.regular && found.rate == Some(rate), "{from} {to} {found:?}");
    }
}

#[test]
fn other_curves_and_crossings_are_no_single_curve() {
    // The lines y = ± 0.01.
    assert!(step(Pair, High, [0.01, 0.0], [0.01, 0.1]).unwrap().regular);
    assert!(!step(Pair, High, [0.01, 0.0], [-0.01, 0.1]).unwrap().regular);
    // Two lines through 0.
    assert!(step(Cross, High, [0.0, 0.01], [0.0, 0.9]).unwrap().regular);
    assert!(!step(Cross, High, [0.0, -0.01], [0.0, 0.9]).unwrap().regular);
    // √y is not defined left of the start.
    assert_eq!(step(Root, High, [0.0, 0.0], [0.01, 0.1]), None);
    assert!(step(Root, High, [0.04, 0.2], [0.09, 0.3]).unwrap().regular);
}

#[test]
fn facets_are_told_by_ends_or_not() {
    let at = |y: f64| [y, y * y];
    // y − ½ along the parabola.
    for (from, to) in [(0.1, 0.4), (0.4, 0.6), (0.5, 0.6), (0.5, 0.4), (0.6, 0.9)] {
        assert!(
            step(Parabola, High, at(from), at(to))
                .unwrap()
                .facets_told_by_ends,
            "{from} {to}"
        );
    }
    // y + α/10 − 1/5 is zero at y ≈ 0.2 and grows there; along y from −6 to −4 it falls and grows.
    assert!(
        step(Parabola, Tilted, at(0.1), at(0.3))
            .unwrap()
            .facets_told_by_ends
    );
    assert!(
        step(Parabola, Tilted, at(-4.9), at(-4.7))
            .unwrap()
            .facets_told_by_ends
    );
    assert!(
        step(Parabola, Tilted, at(-10.3), at(-10.1))
            .unwrap()
            .facets_told_by_ends
    );
    // α − 0.04 at the vertex of the parabola is met twice between ends where it is positive; α + 0.01 never.
    formula!(Above, |_y, alpha| alpha - 0.04);
    formula!(Below, |_y, alpha| alpha + 0.04);
    assert!(
        !step(Parabola, Above, at(-0.3), at(0.3))
            .unwrap()
            .facets_told_by_ends
    );
    assert!(
        step(Parabola, Below, at(-0.05), at(0.05))
            .unwrap()
            .facets_told_by_ends
    );
}

#[test]
fn regular_radii_end_at_singular_points() {
    let map = Traced::new(Plane {
        equation: Cross,
        kink: High,
    });
    let selection = Selection::from_pieces([0]);
    let mut last = f64::INFINITY;
    for distance in [1.0, 0.1, 1e-3, 1e-6] {
        let radius = regular_radius(&map, &selection, &[0.0, distance], &[0.0, 1.0]).unwrap();
        // ∂H/∂y = 2 y − α vanishes at y = α/2.
        assert!(
            radius <= distance / 3.0 && radius >= distance / 16.0,
            "{distance} {radius}"
        );
        assert!(radius < last);
        last = radius;
    }
    assert_eq!(regular_radius(&map, &selection, &[0.0, 0.0], &[0.0, 1.0]), None);
}

/// Random quadratic curves in space, H(x) = B (x − p(x·e)) with a known curve x = p(s), so that the answers
/// can be compared with it.
struct Space {
    bends: [f64; 4],
    mix: [f64; 4],
}

impl NonsmoothFunction for Space {
    fn num_vars(&self) -> usize {
        3
    }
    fn num_residuals(&self) -> usize {
        2
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let [a, b, c, d] = self.bends;
        let s = x[0];
        let first = x[1] - (s * a).sin() - s * s * b;
        let second = x[2] - s * s * s * c - s * d;
        out[0] = first * self.mix[0] + second * self.mix[1] + first * second;
        out[1] = first * self.mix[2] + second * self.mix[3];
        // Facets without any effect.
        let facet = kinks.abs(x[1] - x[2] * 0.3);
        out[1] += facet * 0.0;
    }
}

/// What is claimed of random steps is true at 200 points of the curve; steps that are short enough are
/// decided.
#[test]
fn claims_hold_along_known_curves() {
    let mut random = Random::new(11);
    let (mut short, mut told) = (0, 0);
    for _ in 0..300 {
        let space = Space {
            bends: std::array::from_fn(|_| 2.0 * random.symmetric()),
            mix: [1.0, 0.5 * random.symmetric(), 0.5 * random.symmetric(), 1.0],
        };
        let [a, b, c, d] = space.bends;
        let at = |s: f64| [s, (s * a).sin() + s * s * b, s * s * s * c + s * d];
        let map = Traced::new(space);
        let start = random.symmetric();
        let h = 0.5 * random.symmetric();
        let selection = Selection::from_pieces([0]);
        let found = step_enclosure(&map, &selection, &at(start), &at(start + h)).unwrap();
        if h.abs() < 0.05 {
            short += 1;
            assert!(found.regular, "{h}");
        }
        let points: Vec<[f64; 3]> = (0..=200).map(|k| at(start + h * k as f64 / 200.0)).collect();
        if let Some(rate) = found.rate {
            told += 1;
            assert!(points.windows(2).all(|w| (w[1][2] - w[0][2]) * rate > 0.0));
        }
        if found.facets_told_by_ends {
            let facet = |p: &[f64; 3]| p[1] - 0.3 * p[2];
            let changes = points
                .windows(2)
                .filter(|w| facet(&w[0]) * facet(&w[1]) < 0.0)
                .count();
            let expected = usize::from(facet(&points[0]) * facet(&points[200]) < 0.0);
            assert_eq!(changes, expected);
        }
    }
    assert!(short > 10 && told > 100, "{short} {told}");
}
