use num_traits::{One, Zero};

use super::super::series::Series;
use super::*;
use crate::spread::Random;

fn over(low: f64, high: f64) -> Interval {
    Interval::new(low, high)
}

fn assert_inside(value: f64, interval: Interval, what: &str) {
    let (low, high) = interval.ends();
    assert!(
        low <= value && value <= high,
        "{what}: {value:e} not in [{low:e}, {high:e}]"
    );
}

/// A whole number below 2¹⁰⁰ with 53 significant bits, which is a floating-point number.
fn whole(random: &mut Random) -> f64 {
    (random.symmetric() * 2.0_f64.powi(53)).trunc() * 2.0_f64.powi(random.below(47) as i32)
}

/// Sums, products and quotients against integers: the ends are next to each other, or one exact number.
#[test]
fn arithmetic_is_rounded_outward_to_the_next_number() {
    let mut random = Random::new(1);
    let mut inexact = [0; 4];
    for _ in 0..10_000 {
        let (a, b) = (whole(&mut random), whole(&mut random));
        let short = (random.symmetric() * 2.0_f64.powi(53)).trunc();
        let (exact_a, exact_b) = (a as i128, b as i128);
        let [x, y] = [a, b].map(Interval::from);
        let mut check = |k: usize, found: Interval, encloses: bool| {
            assert!(encloses && found.high <= found.low.next_up(), "{k} {found:?}");
            inexact[k] += i32::from(!found.is_point());
        };
        // Sums in a small unit, so that errors are far below 1.
        let unit = 2.0_f64.powi(-200);
        let sum = x * unit + y * unit;
        let [low, high] = [sum.low, sum.high].map(|end| (end / unit) as i128);
        check(0, sum, low <= exact_a + exact_b && exact_a + exact_b <= high);
        let first = (random.symmetric() * 2.0_f64.powi(53)).trunc();
        let product = Interval::from(first) * short;
        let exact = first as i128 * short as i128;
        check(
            1,
            product,
            product.low as i128 <= exact && exact <= product.high as i128,
        );
        // Quotients from 2²⁴ on have at most 28 binary places, roots from 2²⁶ on 26.
        let (a, divisor) = (first.abs() + 1.0, (short.abs() / 2.0_f64.powi(30)).trunc() + 1.0);
        if a / divisor >= 2.0_f64.powi(24) {
            let quotient = Interval::from(a) / divisor;
            let times = |end: f64| (end * 2.0_f64.powi(28)) as i128 * divisor as i128;
            let exact = (a as i128) << 28;
            check(
                2,
                quotient,
                times(quotient.low) <= exact && exact <= times(quotient.high),
            );
        }
        if a >= 2.0_f64.powi(52) {
            let root = Interval::from(a).sqrt();
            let squared = |end: f64| ((end * 2.0_f64.powi(26)) as i128).pow(2);
            let exact = (a as i128) << 52;
            check(3, root, squared(root.low) <= exact && exact <= squared(root.high));
        }
    }
    assert!(inexact.iter().all(|k| *k > 1000), "{inexact:?}");
    // The same with ends of either sign.
    let third = Interval::from(1.0) / Interval::from(-3.0);
    assert!(third.low < third.high && third.high == third.low.next_up());
    assert!((third * 3.0).contains(-1.0) && (Interval::from(2.0).sqrt().powi(2)).contains(2.0));
    assert!(Interval::from(9.0).sqrt().is_point() && (Interval::from(0.1) * -0.0).vanishes());
    assert!((Interval::from(0.1) - 0.1).vanishes() && (Interval::from(0.3) * 1.0).is_point());
}

/// Where numbers underflow or overflow, the ends still enclose.
#[test]
fn extreme_numbers() {
    let tiny = f64::from_bits(1);
    let product = Interval::from(1e-200) * 1e-200;
    assert_eq!(product.ends(), (0.0, tiny));
    let product = Interval::from(-1e-200) * 1e-200;
    assert_eq!(product.ends(), (-tiny, 0.0));
    assert!(!(Interval::from(1e-320) / 3.0).is_point());
    let quotient = Interval::from(tiny) / -3.0;
    assert_eq!(quotient.ends(), (-tiny, 0.0));
    // 3.75 and 4.28 times the smallest number, with remainders that underflow.
    for divisor in [0.8, 0.7] {
        let quotient = Interval::from(3.0 * tiny) / divisor;
        let (low, high) = if divisor == 0.8 { (3.0, 4.0) } else { (4.0, 5.0) };
        assert_eq!(quotient.ends(), (low * tiny, high * tiny));
    }
    assert_eq!((Interval::from(3.0 * tiny) * 0.3).ends(), (0.0, tiny));
    assert_eq!((Interval::from(3.0 * tiny) * 0.6).ends(), (tiny, 2.0 * tiny));
    let large = Interval::from(f64::MAX) + f64::MAX;
    assert_eq!(large.ends(), (f64::MAX, f64::INFINITY));
    assert_eq!((large - large).ends(), (f64::NEG_INFINITY, f64::INFINITY));
    assert_eq!(
        (Interval::from(1e300) * -1e300).ends(),
        (f64::NEG_INFINITY, f64::MIN)
    );
    assert_eq!((large * 0.0).ends(), (0.0, 0.0));
    assert_eq!((Interval::from(1.0) / large).low, 0.0);
    assert_eq!((large / large).ends(), (0.0, f64::INFINITY));
    assert_eq!((-large / large).ends(), (f64::NEG_INFINITY, 0.0));
    let far = Interval::from(1e300).sin();
    assert_eq!(
        (far.ends(), Interval::from(1e300).cos().ends()),
        ((-1.0, 1.0), (-1.0, 1.0))
    );
    assert!(Interval::from(1e300).tan().is_undefined());
    assert_inside(0.0, Interval::from(-800.0).exp(), "e⁻⁸⁰⁰");
    assert_eq!(Interval::from(800.0).exp().high, f64::INFINITY);
    assert!(Interval::from(800.0).exp().low.is_finite());
    assert_eq!(Interval::from(f64::INFINITY).ends(), (f64::MAX, f64::INFINITY));
}

/// eˣ, sin x, cos x, sinh x and cosh x from their series in whole numbers, in units of 2⁻¹⁰⁰: no other place
/// of the library is asked.
#[test]
fn functions_of_the_library_are_enclosed() {
    let unit = 2.0_f64.powi(100);
    for k in (1_i128..1 << 20).step_by(997) {
        let x = k as f64 / 2.0_f64.powi(20);
        let mut sums = [0_i128; 5];
        let mut term = 1_i128 << 100;
        for n in 0..30 {
            let sign = if n % 4 < 2 { term } else { -term };
            let (odd, even) = (n % 2, 1 - n % 2);
            for (sum, term) in sums
                .iter_mut()
                .zip([term, odd * sign, even * sign, odd * term, even * term])
            {
                *sum += term;
            }
            term = term * k / (n + 1) / (1 << 20);
        }
        let point = Interval::from(x);
        let found = [point.exp(), point.sin(), point.cos(), point.sinh(), point.cosh()];
        for (sum, found) in sums.iter().zip(found) {
            // Every term was rounded to a unit.
            let (low, high) = ((found.low * unit) as i128, (found.high * unit) as i128);
            assert!(low + 100 < *sum && *sum < high - 100, "{x}: {found:?}");
        }
    }
}

#[test]
fn extrema_inside_an_interval_count() {
    let near = |found: Interval, low: f64, high: f64| {
        let (a, b) = found.ends();
        assert!(
            a <= low && high <= b && low - a < 1e-14 && b - high < 1e-14,
            "{found:?}"
        );
    };
    near(over(1.0, 2.0).sin(), 2.0_f64.sin().min(1.0_f64.sin()), 1.0);
    near(over(-2.0, 1.0).sin(), -1.0, 1.0_f64.sin());
    near(over(4.0, 5.0).sin(), -1.0, 4.0_f64.sin());
    near(over(2.0, 4.0).sin(), 4.0_f64.sin(), 2.0_f64.sin());
    near(over(-1.0, 2.0).cos(), 2.0_f64.cos(), 1.0);
    near(over(3.0, 4.0).cos(), -1.0, 4.0_f64.cos());
    near(over(1.0, 9.0).cos(), -1.0, 1.0);
    near(over(0.5, 1.0).cos(), 1.0_f64.cos(), 0.5_f64.cos());
    near(over(-1.5, 1.5).tan(), -1.5_f64.tan(), 1.5_f64.tan());
    near(over(2.0, 4.0).tan(), 2.0_f64.tan(), 4.0_f64.tan());
    near(over(-1.0, 2.0).cosh(), 1.0, 2.0_f64.cosh());
    near(over(-3.0, -2.0).cosh(), 2.0_f64.cosh(), 3.0_f64.cosh());
    near(over(-1.0, 2.0).powi(2), 0.0, 4.0);
    near(over(-1.0, 2.0).powi(3), -1.0, 8.0);
    near(over(-2.0, -1.0).powi(-2), 0.25, 1.0);
    near(over(-2.0, -1.0).powi(-3), -1.0, -0.125);
    near(over(4.0, 9.0).powf(-0.5), 1.0 / 3.0, 0.5);
    near(over(0.0, 4.0).powf(1.5), 0.0, 8.0);
    near(over(-1.0, 2.0).powf(2.0), 0.0, 4.0);
    near(over(-3.0, 2.0).abs(), 0.0, 3.0);
    near(over(7.25, 7.75) % 2.0, 1.25, 1.75);
    near(over(-2.0, 3.0) * over(-5.0, 4.0), -15.0, 12.0);
    near(over(-2.0, 3.0) / over(-4.0, -2.0), -1.5, 1.0);
}

/// What is undefined at one point of an interval stays so, whatever is done with it.
#[test]
fn undefined_values_stay_undefined() {
    let undefined = [
        Interval::from(1.0) / over(-1.0, 1.0),
        Interval::from(1.0) / over(0.0, 1.0),
        over(-1.0, 1.0).sqrt(),
        over(-1.0, 1.0).ln(),
        over(0.0, 1.0).ln(),
        over(0.0, 1.5).asin(),
        over(-1.5, 0.0).acos(),
        over(-1.0, 1.0).ln_1p(),
        over(-1.0, 1.0).atan2(Interval::from(-1.0)),
        over(-1.0, 1.0).atan2(over(-1.0, 1.0)),
        over(1.0, 2.0).tan(),
        over(-1.0, 1.0).powi(-1),
        over(-1.0, 1.0).powf(0.5),
        over(0.0, 1.0).powf(-0.5),
        over(7.5, 8.5) % 2.0,
        Interval::from(f64::NAN),
        over(2.0, 1.0),
    ];
    for u in undefined {
        let later = [
            u,
            u * 0.0,
            u.powi(0),
            u.atan(),
            u.sin(),
            u.tanh(),
            u.abs(),
            u - u,
            -u,
            u.cosh(),
            u % 1.0,
        ];
        assert!(
            later
                .iter()
                .all(|v| v.is_undefined() && v.ends() == (f64::NEG_INFINITY, f64::INFINITY))
        );
        assert!(Series([u, Interval::from(1.0)]).atan().0[1].is_undefined());
    }
    // |x| has a value at 0, but no derivative.
    let Series([value, slope]) = Series([over(-1.0, 2.0), Interval::from(1.0)]).abs();
    assert!(value.ends() == (0.0, 2.0) && slope.is_undefined());
}

#[test]
fn branches_on_values_are_noticed() {
    let branches: [fn(Interval) -> bool; 6] = [
        |x| x.value() > 0.0,
        |x| x == Interval::from(0.0),
        |x| x.is_zero(),
        |x| x.is_positive(),
        |x| x.is_negative(),
        |x| x.signum().is_one(),
    ];
    for branch in branches {
        assert_eq!(without_branches(|| branch(over(-1.0, 1.0))), None);
        assert!(without_branches(|| branch(Interval::from(1.0))).is_some());
    }
    // Values of one interval on one side are no reason for doubt, but a value itself is.
    assert_eq!(without_branches(|| over(1.0, 2.0).is_positive()), Some(true));
    assert_eq!(without_branches(|| over(1.0, 2.0) == over(3.0, 4.0)), Some(false));
    assert_eq!(without_branches(|| over(1.0, 2.0).value()), None);
    // One doubt inside another evaluation is a doubt of this one only.
    let outer = without_branches(|| without_branches(|| over(1.0, 2.0).value()));
    assert_eq!(outer, Some(None));
}

/// One step of a random formula, on the values found before it.
fn step<T: Real>(kind: usize, a: T, b: T) -> T {
    match kind {
        0 => a + b,
        1 => a - b,
        2 => a * b,
        3 => a / b,
        4 => a.sqrt(),
        5 => a.exp(),
        6 => a.ln(),
        7 => a.sin(),
        8 => a.cos(),
        9 => a.tan(),
        10 => a.atan(),
        11 => a.sinh(),
        12 => a.cosh(),
        13 => a.tanh(),
        14 => a.powi(2),
        15 => a.powi(3),
        16 => a.powi(-1),
        17 => a.powi(-2),
        18 => a.powf(1.5),
        19 => a.powf(-0.3),
        20 => a.abs(),
        21 => a * 0.7 - 0.2,
        22 => (a - b) / 3.0,
        23 => a.asin(),
        24 => a.acos(),
        25 => a.ln_1p(),
        26 => a.exp_m1(),
        27 => a.cbrt(),
        28 => a.atan2(b),
        _ => a % 2.5,
    }
}
const KINDS: usize = 30;

struct Program(Vec<[usize; 3]>);

impl Program {
    fn random(random: &mut Random) -> Self {
        let length = 1 + random.below(6);
        let steps = (0..length).map(|k| [random.below(KINDS), random.below(k + 2), random.below(k + 2)]);
        Self(steps.collect())
    }

    fn run<T: Real>(&self, x: [T; 2]) -> T {
        let mut values = x.to_vec();
        for &[kind, a, b] in &self.0 {
            values.push(step(kind, values[a], values[b]));
        }
        values[values.len() - 1]
    }
}

/// The two variables over a box, along a direction.
fn lines(centre: [f64; 2], radius: f64, direction: [f64; 2]) -> [Series<Interval, 5>; 2] {
    std::array::from_fn(|j| {
        let mut line = Series::from(0.0);
        line.0[0] = Interval::ball(centre[j], radius);
        line.0[1] = Interval::from(direction[j]);
        line
    })
}

/// Values and four derivatives at points of a box lie in the enclosures over it, and these in those over
/// larger boxes.
#[test]
fn enclosures_hold_what_formulas_give() {
    let mut random = Random::new(7);
    let mut compared = 0;
    for _ in 0..10_000 {
        let program = Program::random(&mut random);
        let centre: [f64; 2] = std::array::from_fn(|_| 3.0 * random.symmetric());
        let direction: [f64; 2] = std::array::from_fn(|_| random.symmetric());
        let radius = 10.0_f64.powi(-(random.below(16) as i32));
        let enclosed = program.run(lines(centre, radius, direction)).0;
        let outer = program.run(lines(centre, 1.5 * radius, direction)).0;
        for (inner, outer) in enclosed.iter().zip(outer) {
            // Functions of the library need not grow in their last places.
            let slack = 1e-14 * outer.low.abs().max(outer.high.abs());
            assert!(
                outer.is_undefined() || (outer.low - slack <= inner.low && inner.high <= outer.high + slack),
                "{:?} {inner:?} {outer:?}",
                program.0
            );
        }
        if enclosed[0].is_undefined() {
            continue;
        }
        for _ in 0..4 {
            let x: [Series<f64, 5>; 2] = std::array::from_fn(|j| {
                Series([
                    centre[j] + radius * random.symmetric(),
                    direction[j],
                    0.0,
                    0.0,
                    0.0,
                ])
            });
            for (value, interval) in program.run(x).0.into_iter().zip(enclosed) {
                if value.is_finite() && !interval.is_undefined() {
                    compared += 1;
                    assert_inside(value, interval, &format!("{:?} at {x:?}", program.0));
                }
            }
        }
    }
    assert!(compared > 50_000, "{compared}");
}

/// The enclosure of one function over a short interval is as wide as its range.
#[test]
fn enclosures_shrink_with_the_box() {
    for kind in 4..KINDS {
        for value in [0.3, 1.2, 2.2] {
            // The inverse functions of sine and cosine live on [−1, 1].
            let value = if (23..25).contains(&kind) {
                0.4 * value
            } else {
                value
            };
            let slope = step(kind, Series([value, 1.0]), Series([0.1, 0.0])).0[1];
            for radius in [1e-3, 1e-5, 1e-7] {
                let found = step(kind, Interval::ball(value, radius), Interval::from(0.1));
                let width = (found.high - found.low) / (2.0 * radius);
                let error = (width - slope.abs()).abs();
                assert!(
                    error <= 20.0 * radius + 1e-15 / radius * (1.0 + slope.abs()),
                    "{kind} {value} {radius}: {width} {slope}"
                );
            }
        }
    }
}

/// Narrow and wide intervals, near 0 and far out.
#[test]
fn waves_far_out() {
    let mut random = Random::new(8);
    for _ in 0..10_000 {
        let size = 10.0_f64.powi(random.below(18) as i32);
        let centre = size * random.symmetric();
        let x = Interval::ball(centre, 10.0_f64.powi(-(random.below(6) as i32)) * 2.0);
        for _ in 0..4 {
            let part = 0.5 + 0.5 * random.symmetric();
            let at = (x.low + part * (x.high - x.low)).clamp(x.low, x.high);
            assert_inside(at.sin(), x.sin(), "sin");
            assert_inside(at.cos(), x.cos(), "cos");
            assert_inside(at.tan(), x.tan(), "tan");
        }
    }
}

/// Between two neighbouring numbers on either side of a pole, tan is undefined, however near to a multiple of
/// the rounded π/2 they are.
#[test]
fn poles_between_neighbouring_numbers() {
    for k in (1..20_000).step_by(2) {
        let mut before = f64::from(k) * FRAC_PI_2;
        while before.tan() < 0.0 {
            before = before.next_down();
        }
        while before.next_up().tan() > 0.0 {
            before = before.next_up();
        }
        assert!(over(before, before.next_up()).tan().is_undefined(), "{k}");
        assert!(!over(before - 1.0, before - 1e-9).tan().is_undefined(), "{k}");
    }
}
