use super::*;
use crate::spread::Random;

type Five = Series<f64, 5>;

const FACTORIALS: [f64; 5] = [1.0, 1.0, 2.0, 6.0, 24.0];

/// Σ f_k u^k, where u has no constant.
fn composed(f: [f64; 5], u: Five) -> Five {
    let mut power = Five::from(1.0);
    let mut sum = Five::from(0.0);
    for f in f {
        sum += power * f;
        power *= u;
    }
    sum
}

fn assert_near(found: Five, expected: Five, what: &str) {
    for (k, (a, b)) in found.0.iter().zip(expected.0).enumerate() {
        let scale = 1.0_f64.max(b.abs());
        assert!((a - b).abs() <= 1e-12 * scale, "{what}, order {k}: {a} for {b}");
    }
}

fn binomial(p: f64, x: f64) -> [f64; 5] {
    let mut c = 1.0;
    std::array::from_fn(|k| {
        let term = if c == 0.0 { 0.0 } else { c * x.powf(p - k as f64) };
        c *= (p - k as f64) / (k + 1) as f64;
        term
    })
}

type Case = (&'static str, fn(Five) -> Five, fn(f64) -> [f64; 5]);

const CASES: [Case; 14] = [
    ("exp", Five::exp, |x| FACTORIALS.map(|f| x.exp() / f)),
    ("ln", Five::ln, |x| {
        [
            x.ln(),
            1.0 / x,
            -0.5 / x.powi(2),
            1.0 / 3.0 / x.powi(3),
            -0.25 / x.powi(4),
        ]
    }),
    ("sqrt", Five::sqrt, |x| binomial(0.5, x)),
    ("sin", Five::sin, |x| {
        let (s, c) = x.sin_cos();
        [s, c, -s / 2.0, -c / 6.0, s / 24.0]
    }),
    ("cos", Five::cos, |x| {
        let (s, c) = x.sin_cos();
        [c, -s, -c / 2.0, s / 6.0, c / 24.0]
    }),
    ("tan", Five::tan, |x| {
        let t = x.tan();
        let s = 1.0 + t * t;
        [
            t,
            s,
            t * s,
            s * (1.0 + 3.0 * t * t) / 3.0,
            t * s * (2.0 + 3.0 * t * t) / 3.0,
        ]
    }),
    ("atan", Five::atan, |x| {
        let w = 1.0 + x * x;
        [
            x.atan(),
            1.0 / w,
            -x / w.powi(2),
            (3.0 * x * x - 1.0) / 3.0 / w.powi(3),
            (x - x.powi(3)) / w.powi(4),
        ]
    }),
    ("sinh", Five::sinh, |x| {
        let (s, c) = (x.sinh(), x.cosh());
        [s, c, s / 2.0, c / 6.0, s / 24.0]
    }),
    ("cosh", Five::cosh, |x| {
        let (s, c) = (x.sinh(), x.cosh());
        [c, s, c / 2.0, s / 6.0, c / 24.0]
    }),
    ("tanh", Five::tanh, |x| {
        let t = x.tanh();
        let s = 1.0 - t * t;
        [
            t,
            s,
            -t * s,
            s * (3.0 * t * t - 1.0) / 3.0,
            t * s * (2.0 - 3.0 * t * t) / 3.0,
        ]
    }),
    ("x³", |x| x.powi(3), |x| binomial(3.0, x)),
    ("x⁻²", |x| x.powi(-2), |x| binomial(-2.0, x)),
    ("x^2.5", |x| x.powf(2.5), |x| binomial(2.5, x)),
    ("x^-0.5", |x| x.powf(-0.5), |x| binomial(-0.5, x)),
];

#[test]
fn functions_have_their_taylor_coefficients() {
    let mut random = Random::new(1);
    for (name, function, expansion) in CASES {
        for value in [0.3, 0.9, 1.7, 2.5] {
            let variable = Series([value, 1.0, 0.0, 0.0, 0.0]);
            assert_near(function(variable), Series(expansion(value)), name);
            // Along curved arcs, too, and where the first coefficients vanish.
            for start in 1..4 {
                let mut u = [0.0; 5];
                u[start..].fill_with(|| random.symmetric());
                let mut x = u;
                x[0] = value;
                assert_near(function(Series(x)), composed(expansion(value), Series(u)), name);
            }
        }
    }
}

#[test]
fn negative_arguments_too() {
    for (name, function, expansion) in CASES {
        if !["ln", "sqrt", "x^2.5", "x^-0.5", "x³", "x⁻²"].contains(&name) {
            let variable = Series([-1.2, 1.0, 0.0, 0.0, 0.0]);
            assert_near(function(variable), Series(expansion(-1.2)), name);
        }
    }
    let x = Series([-2.0, 1.0, 0.0, 0.0, 0.0]);
    assert_near(x.powi(3), x * x * x, "x³");
    assert_near(x.powi(-2) * x * x, Five::from(1.0), "x⁻²");
    assert_near(x.powf(3.0), x * x * x, "x^3.0");
}

#[test]
fn identities_hold_for_random_series() {
    let mut random = Random::new(2);
    for _ in 0..200 {
        let mut next = || Series(std::array::from_fn::<f64, 5, _>(|_| random.symmetric()));
        let (mut a, b) = (next(), next());
        a.0[0] = a.0[0].abs() + 0.3;
        let one = Five::from(1.0);
        assert_near(a.sin() * a.sin() + a.cos() * a.cos(), one, "sin² + cos²");
        assert_near(a.cosh() * a.cosh() - a.sinh() * a.sinh(), one, "cosh² − sinh²");
        assert_near(a.ln().exp(), a, "exp ln");
        assert_near(a.sqrt() * a.sqrt(), a, "√²");
        assert_near(a.tan().atan(), a, "atan tan");
        assert_near(b / a * a, b, "quotient");
        assert_near(a.tanh() * a.cosh(), a.sinh(), "tanh");
        assert_near(a.powf(1.5) * a.powf(1.5), a.powi(3), "powers");
        assert_near(b.powi(4), b * b * b * b, "fourth power");
        assert_near((b - a).abs(), if b.0[0] < a.0[0] { a - b } else { b - a }, "abs");
    }
}

#[test]
fn polynomials_are_exact() {
    let s = Series([0.0, 1.0, 0.0, 0.0, 0.0]);
    assert_eq!((s - 1.0).powi(4).0, [1.0, -4.0, 6.0, -4.0, 1.0]);
    assert_eq!((s * 3.0 + 2.0).powi(3).0, [8.0, 36.0, 54.0, 27.0, 0.0]);
    assert_eq!(s.powi(3).0, [0.0, 0.0, 0.0, 1.0, 0.0]);
    assert_eq!(s.powi(0).0, [1.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(s.powf(2.0).0, [0.0, 0.0, 1.0, 0.0, 0.0]);
    assert_eq!(((s * s - 2.0) * (s + 1.0) / 2.0).0, [-1.0, -1.0, 0.5, 0.5, 0.0]);
    // 5.5 + s less twice 2 + s/8.
    assert_eq!(((s + 5.5) % (s * 0.125 + 2.0)).0, [1.5, 0.75, 0.0, 0.0, 0.0]);
    assert_eq!(((s + 5.5) % 2.0).0, [1.5, 1.0, 0.0, 0.0, 0.0]);
}

#[test]
fn singular_points_give_what_is_defined() {
    let s = Series([0.0, 1.0, 0.0, 0.0, 0.0]);
    assert!(s.sqrt().0[0] == 0.0 && s.sqrt().0[1..].iter().all(|c| !c.is_finite()));
    let power = s.powf(2.5).0;
    assert_eq!(&power[..4], [0.0, 0.0, 0.0, f64::INFINITY]);
    // A constant has no derivatives, even where the slope is infinite.
    assert_eq!(Five::from(0.0).sqrt().0, [0.0; 5]);
    assert_eq!(Five::from(0.0).powf(0.5).0, [0.0; 5]);
    // Tiny and huge values keep all digits of coefficients that are ordinary numbers.
    assert_near(
        Series([1e-200, 1e-200, 0.0, 0.0, 0.0]).ln() + 460.517_018_598_809_1,
        Series([0.0, 1.0, -0.5, 1.0 / 3.0, -0.25]),
        "ln",
    );
    let far = Series([30.0, 1.0, 0.0, 0.0, 0.0]).tanh().0;
    let slope = 4.0 * (-60.0_f64).exp();
    assert!((far[1] / slope - 1.0).abs() < 1e-14 && (far[2] / slope + 1.0).abs() < 1e-14);
    assert!(Five::from(-1.0).ln().0[0].is_nan());
}
