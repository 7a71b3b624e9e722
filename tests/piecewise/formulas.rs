//! Formulas from closures and from text.

use semismooth::complementarity::{Autodiff, Mcp, McpSolver};
use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::piecewise::{
    Expression, Formula, Kinks, NonsmoothFunction, PiecewiseSmooth, PiecewiseSmoothExt, Real, Traced, value,
};
use semismooth::sparse::Matrix;

/// The same formula, written over scalars.
struct Written;
impl NonsmoothFunction for Written {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        3
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let (a, b) = (x[0], x[1]);
        let larger = kinks.max(a * 2.0, b - 1.0);
        let length = kinks.abs(a);
        out[0] = larger / (b * b + 1.0) - a.powi(3) + length;
        let bound = kinks.positive_part(b);
        out[1] = kinks.project(-bound, a, bound) + (b.tanh() + a.sin()).exp();
        out[2] = kinks.switch(a - 1.0, a * 3.0 - 2.0, a * a) + kinks.min(a, T::from(0.25));
    }
}

fn recorded() -> Formula {
    Formula::named(["a", "b"], |x| {
        let [a, b] = [x[0], x[1]];
        let first = (2.0 * a).max(b - 1.0) / (1.0 + b * b) - a.powi(3) + a.abs();
        let bound = b.positive_part();
        let second = a.project(-bound, bound) + (b.tanh() + a.sin()).exp();
        let third = (a - 1.0).switch(3.0 * a - 2.0, a * a) + a.min(0.25);
        vec![first, second, third]
    })
}

const POINTS: [[f64; 2]; 6] = [
    [0.3, 0.7],
    [-1.5, 2.0],
    [4.0, -3.0],
    [-0.2, -0.1],
    [1.5, 0.4],
    [0.1, 9.0],
];

fn value_and_jacobian(map: &dyn PiecewiseSmooth, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let mut out = vec![0.0; map.num_residuals()];
    value(map, x, &mut out);
    let mut jac = Matrix::zeros(map.pattern());
    map.jacobian(&semismooth::piecewise::select(map, x), x, &mut jac);
    let entries = (0..out.len()).flat_map(|i| (0..x.len()).map(move |j| (i, j)));
    (out, entries.map(|(i, j)| jac.get(i, j)).collect())
}

#[test]
fn a_closure_is_the_map_that_is_written_over_scalars() {
    let (written, recorded) = (Traced::new(Written), Traced::new(recorded()));
    assert_eq!(recorded.num_sites(), written.num_sites());
    for x in POINTS {
        let (v, j) = value_and_jacobian(&written, &x);
        let (w, k) = value_and_jacobian(&recorded, &x);
        for (a, b) in v.iter().chain(&j).zip(w.iter().chain(&k)) {
            assert!(
                (a - b).abs() <= 4.0 * f64::EPSILON * (1.0 + a.abs()),
                "{x:?}: {a} {b}"
            );
        }
    }
}

#[test]
fn text_is_the_same_formula_as_a_closure() {
    let read = Formula::read(
        &[
            "max(2*a, b − 1)/(1 + b^2) - a^3 + abs(a)",
            "exp(tanh(b) + sin(a)) = min(a, 1/4)",
        ],
        &["a", "b"],
    );
    let closure = Formula::named(["a", "b"], |x| {
        let [a, b] = [x[0], x[1]];
        vec![
            (2.0 * a).max(b - 1.0) / (1.0 + b.powi(2)) - a.powi(3) + a.abs(),
            (b.tanh() + a.sin()).exp() - a.min(0.25),
        ]
    });
    let (read, closure) = (Traced::new(read.unwrap()), Traced::new(closure));
    for x in POINTS {
        assert_eq!(value_and_jacobian(&read, &x), value_and_jacobian(&closure, &x));
    }
    let names = |map: &dyn PiecewiseSmooth| (0..3).map(|s| map.site_name(s).into_owned()).collect::<Vec<_>>();
    assert_eq!(names(&read), ["2*a | b − 1", "a ≥ 0 | a ≤ 0", "a | 1/4"]);
    assert_eq!(names(&closure), ["2*a | b − 1", "a ≥ 0 | a ≤ 0", "a | 0.25"]);
}

#[test]
fn equal_kinks_are_one_site_and_kinks_without_effect_are_none() {
    let formula = Formula::new(2, |x| {
        let _without_effect = x[1].abs();
        vec![(x[0] - 1.0).max(0.0) + x[1], 2.0 * (x[0] - 1.0).max(0.0)]
    });
    let map = Traced::new(formula);
    assert_eq!(map.num_sites(), 1);
    assert_eq!(map.site_name(0), "x₀ − 1 | 0");
    let twice = Formula::read(&["max(y - 1, 0) + max(y - 1, 0)"], &["y"]).unwrap();
    assert_eq!(Traced::new(twice).num_sites(), 1);
}

#[test]
fn names_keep_the_parentheses_that_matter() {
    let names = |text: &str| {
        let map = Traced::new(Formula::read(&[text.replace('−', "-")], &["y", "z"]).unwrap());
        map.piece_name(0, 0).into_owned()
    };
    for text in [
        "y − (z − 1)",
        "y/(2*z)",
        "(y + z)*3",
        "−(y + z)",
        "(−y)^2",
        "(y*z)^3",
        "y^−2",
        "sqrt(y) + z*sin(y − z)",
        "(y/z)^0.5",
        "y − 1e−7",
        "−y*z",
        "y − z − 1",
        "(y + 1)/z/2",
    ] {
        assert_eq!(names(&format!("max({text}, 0)")), text);
    }
    // What is too long for a table has the name of its kind.
    let long = vec!["y"; 40].join(" + ");
    assert_eq!(names(&format!("max({long}, 0)")), "first");
    let deep = vec!["y"; 190].join("+");
    assert_eq!(names(&format!("max({deep}, 0)")), "first");
}

#[test]
fn long_formulas_are_evaluated_like_short_ones() {
    // Σ k |x − k| for k = 1 … n has n kinks and 3 n nodes or more.
    let sum = |n: usize| {
        Formula::new(1, move |x| {
            vec![
                (1..=n)
                    .map(|k| (x[0] - k as f64).abs() * k as f64)
                    .sum::<Expression<'_>>(),
            ]
        })
    };
    for n in [3, 12, 40] {
        let map = Traced::new(sum(n));
        assert_eq!(map.num_sites(), n);
        let (v, j) = value_and_jacobian(&map, &[7.25]);
        let expected: f64 = (1..=n).map(|k| k as f64 * (7.25 - k as f64).abs()).sum();
        let slope: f64 = (1..=n).map(|k| k as f64 * (7.25 - k as f64).signum()).sum();
        assert_eq!((v, j), (vec![expected], vec![slope]));
    }
}

#[test]
fn numbers_alone_are_numbers() {
    let formula = Formula::new(1, |x| {
        let c = Expression::from(2.0);
        let nan = Expression::from(f64::NAN);
        vec![
            (c * 3.0).max(1.0) - c.min(0.5)
                + c.project(0.0, 1.0)
                + (-c).abs()
                + c.powi(2)
                + c.sqrt() * c.powf(0.5),
            nan.max(1.0),
            Expression::from(1.0).min(nan),
            Expression::from(0.0).switch(1.0, 2.0),
            x[0],
        ]
    });
    let mut out = [0.0; 5];
    value(&Traced::new(formula), &[4.0], &mut out);
    assert!((out[0] - (6.0 - 0.5 + 1.0 + 2.0 + 4.0 + 2.0)).abs() < 1e-14);
    assert!(out[1].is_nan() && out[2].is_nan());
    assert_eq!(out[3..], [1.0, 4.0]);
}

#[test]
fn formulas_have_exact_coefficients_curves_and_complementarity_problems() {
    let kinked = Traced::new(Formula::new(1, |x| vec![x[0].abs() + 0.5 * x[0] - 3.0]));
    let list = all_solutions(&kinked, 0.0, &EnumerationOptions::default()).unwrap();
    assert!(list.completeness.is_complete());
    let mut points: Vec<f64> = list.solutions.iter().map(|s| s.x[0]).collect();
    points.sort_by(f64::total_cmp);
    assert_eq!(points, [-6.0, 2.0]);

    let beam = Formula::read(
        &["y - 1.25*max(y - 1, 0) + 10*max(y - 3, 0) = load"],
        &["y", "load"],
    )
    .unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
    let branch = Branch::follow(&Traced::new(beam), &[0.0, 0.0], Direction::Increasing, options).unwrap();
    assert_eq!(branch.folds().len(), 2);
    assert!((branch.folds()[0] - 1.0).abs() < 1e-14 && (branch.folds()[1] - 0.5).abs() < 1e-14);

    // 0 ≤ x ⟂ |x − 2| + x − 3 ≥ 0: x = 2.5.
    let formula = Formula::new(1, |x| vec![(x[0] - 2.0).abs() + x[0] - 3.0]);
    let problem = Mcp::new(Autodiff::new(formula), vec![0.0], vec![f64::INFINITY]).unwrap();
    let mut x = [4.0];
    let mut solver = McpSolver::default();
    assert!(solver.solve(&problem, &mut x).unwrap().is_solved());
    assert!((x[0] - 2.5).abs() < 1e-12);
}

#[test]
fn mistakes_are_found_where_they_are() {
    let e = Formula::read(&["y", "y + ζ*2"], &["y"]).unwrap_err();
    assert_eq!((e.equation, e.from, e.to), (1, 4, 5));
    let e = Formula::read(&["max(y)"], &["y"]).unwrap_err();
    assert_eq!(
        (e.from, e.to, e.to_string().as_str()),
        (0, 3, "max takes two arguments or more")
    );
    let e = Formula::read(&["y = 1 = 2"], &["y"]).unwrap_err();
    assert!(e.to_string().contains("one sign ="));
}

#[test]
fn what_is_undefined_stays_so() {
    let texts = [
        "max(x + 2, ln(x))",
        "max(ln(x), 5)",
        "min(ln(x), x)",
        "min(-9, ln(x))",
        "abs(ln(x))",
        "ln(x)^0",
    ];
    let map = Traced::new(Formula::read(&texts, &["x"]).unwrap());
    let mut out = [0.0; 6];
    value(&map, &[-2.0], &mut out);
    assert!(out.iter().all(|v| v.is_nan()), "{out:?}");
    value(&map, &[1.0], &mut out);
    assert_eq!(out, [3.0, 5.0, 0.0, -9.0, 0.0, 1.0]);
}
