//! Whether formulas are affine apart from their kinks is found by tracing them, and their curves are polygons
//! then.

use semismooth::continuation::{Branch, ContinuationOptions, Direction, TransitionKind};
use semismooth::enumeration::{EnumerationOptions, all_solutions};
use semismooth::piecewise::check::{CheckError, CheckOptions, FindingKind, check};
use semismooth::piecewise::{Kinks, NonsmoothFunction, PiecewiseSmooth, PiecewiseSmoothExt, Real, Traced};

/// g(y, α) for the formula of the given number; y is x₀ and α is x₁.
struct Formula(usize);

/// The formulas, and whether they are affine on each piece.
const FORMULAS: [(&str, bool); 43] = [
    ("x + 3 a - 1", true),
    ("x/2 - a/3", true),
    ("x (2 + 3^2/exp(1)) - a", true),
    ("x^1 - a", true),
    ("x^1.0 - a", true),
    ("x^0 + x^0.0 - a", true),
    ("max(x, 1) + min(a, x) - abs(x - a)", true),
    ("project(-1, x, 1 + a)", true),
    ("switch(x, x, -x) - a", true),
    ("switch(x - 1, 2 x - 1, x) - a", true),
    ("switch(a, x, x) - a", true),
    ("max(1, 2) x - a", true),
    ("0 x a + x", true),
    ("max(x, a) 0 a + x", true),
    ("0.1 + 0.2 - x + a", true),
    ("x, where a kink without effect has affine tests", true),
    ("2 if the number 1 is positive, else x a", true),
    ("x + a + 1e-300 x a", false),
    ("(x + 1)^2 - x^2 - a", false),
    ("x a - x a + x", false),
    ("x^2 - a", false),
    ("x^1.5 - a", false),
    ("x^-1 - a", false),
    ("1/x - a", false),
    ("x/a", false),
    ("sqrt x - a", false),
    ("0 sqrt x - a", false),
    ("tanh x - a", false),
    ("(ln x)^0 + x", false),
    ("max(1, 0/0) x - a", false),
    ("|x| without a kink - a", false),
    ("sign of x without a kink - a", false),
    ("x % 2 - a", false),
    ("max(x a, 1)", false),
    ("switch(x^2 - 1, x, x) - a", false),
    ("switch(x, a, 1) x", false),
    ("switch(x, 2, 3) x - a", false),
    ("switch(x, x + 1, x) - a", false),
    ("x, where a kink without effect has curved tests", false),
    ("x or 2 x, as x is positive or not", false),
    ("x or x^2, as x equals 0 or not", false),
    ("x or 2 x, as exp x is above 1 or not", false),
    ("x/switch(a, 0, 1)", false),
];

impl NonsmoothFunction for Formula {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, v: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let (x, a) = (v[0], v[1]);
        let number = |v: f64| T::from(v);
        out[0] = match FORMULAS[self.0].0 {
            "x + 3 a - 1" => x + a * 3.0 - 1.0,
            "x/2 - a/3" => x / 2.0 - a / 3.0,
            "x (2 + 3^2/exp(1)) - a" => x * (number(2.0) + number(3.0).powi(2) / number(1.0).exp()) - a,
            "x^1 - a" => x.powi(1) - a,
            "x^1.0 - a" => x.powf(1.0) - a,
            "x^0 + x^0.0 - a" => x.powi(0) + x.powf(0.0) - a,
            "max(x, 1) + min(a, x) - abs(x - a)" => {
                kinks.max(x, number(1.0)) + kinks.min(a, x) - kinks.abs(x - a)
            }
            "project(-1, x, 1 + a)" => kinks.project(number(-1.0), x, a + 1.0),
            "switch(x, x, -x) - a" => kinks.switch(x, x, -x) - a,
            "switch(x, 2, 3) x - a" => kinks.switch(x, number(2.0), number(3.0)) * x - a,
            "switch(x - 1, 2 x - 1, x) - a" => kinks.switch(x - 1.0, x * 2.0 - 1.0, x) - a,
            "switch(a, x, x) - a" => kinks.switch(a, x, x) - a,
            "switch(x, x + 1, x) - a" => kinks.switch(x, x + 1.0, x) - a,
            "max(1, 2) x - a" => kinks.max(number(1.0), number(2.0)) * x - a,
            "0 x a + x" => number(0.0) * x * a + x,
            "max(x, a) 0 a + x" => kinks.max(x, a) * 0.0 * a + x,
            "0.1 + 0.2 - x + a" => number(0.1) + 0.2 - x + a,
            "x, where a kink without effect has affine tests" => {
                kinks.abs(x - 1.0);
                x
            }
            "2 if the number 1 is positive, else x a" => {
                if number(1.0).is_positive() {
                    number(2.0)
                } else {
                    x * a
                }
            }
            "x + a + 1e-300 x a" => x + a + x * 1e-300 * a,
            "(x + 1)^2 - x^2 - a" => (x + 1.0).powi(2) - x.powi(2) - a,
            "x a - x a + x" => {
                let product = x * a;
                product - x * a + x
            }
            "x^2 - a" => x * x - a,
            "x^1.5 - a" => x.powf(1.5) - a,
            "x^-1 - a" => x.powi(-1) - a,
            "1/x - a" => number(1.0) / x - a,
            "x/a" => x / a,
            "sqrt x - a" => x.sqrt() - a,
            "0 sqrt x - a" => x.sqrt() * 0.0 - a,
            "tanh x - a" => x.tanh() - a,
            "(ln x)^0 + x" => x.ln().powi(0) + x,
            "max(1, 0/0) x - a" => kinks.max(number(1.0), number(f64::NAN)) * x - a,
            "|x| without a kink - a" => x.abs() - a,
            "sign of x without a kink - a" => x.signum() - a,
            "x % 2 - a" => x % 2.0 - a,
            "max(x a, 1)" => kinks.max(x * a, number(1.0)),
            "switch(x^2 - 1, x, x) - a" => kinks.switch(x * x - 1.0, x, x) - a,
            "switch(x, a, 1) x" => kinks.switch(x, a, number(1.0)) * x,
            "x, where a kink without effect has curved tests" => {
                kinks.abs(x * x - 1.0);
                x
            }
            "x or 2 x, as x is positive or not" => match x.value() > 0.0 {
                true => x,
                false => x * 2.0,
            },
            "x or x^2, as x equals 0 or not" => match x == number(0.0) {
                true => x,
                false => x * x,
            },
            "x or 2 x, as exp x is above 1 or not" => match x.exp().value() > 1.0 {
                true => x,
                false => x * 2.0,
            },
            _ => x / kinks.switch(a, number(0.0), number(1.0)),
        };
    }
}

#[test]
fn affine_formulas_are_recognised_and_no_others() {
    for (k, (formula, affine)) in FORMULAS.iter().enumerate() {
        assert_eq!(
            Traced::new(Formula(k)).is_piecewise_affine(),
            *affine,
            "{formula}"
        );
    }
}

/// What the evaluation over forms did not see of a branch on x or eˣ is not claimed: no coefficients are
/// given.
#[test]
fn formulas_that_branch_on_values_have_no_exact_coefficients() {
    for (k, (formula, _)) in FORMULAS.iter().enumerate() {
        let branches = formula.contains(" or ") && formula.contains("x");
        let exact = Traced::new(Formula(k))
            .exact()
            .and_then(|e| e.conditions(0.5))
            .is_some();
        assert!(!(branches && exact), "{formula}");
    }
    // A branch on a number is one and the same everywhere, with or without rounding.
    let list = all_solutions(&Traced::new(ByNumber), 0.0, &EnumerationOptions::default()).unwrap();
    assert!(
        list.completeness.is_complete() && list.solutions.len() == 1,
        "{list}"
    );
}

/// x − 1, by way of a branch on a number with rounding.
struct ByNumber;

impl NonsmoothFunction for ByNumber {
    fn num_vars(&self) -> usize {
        1
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], _: &mut Kinks<'_, T>, out: &mut [T]) {
        out[0] = match T::from(2.0).sqrt().value() > 1.4 {
            true => x[0] - 1.0,
            false => x[0] * x[0],
        };
    }
}

/// A formula with an answer of its own.
struct Declared {
    formula: Formula,
    affine: bool,
}

impl NonsmoothFunction for Declared {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        self.formula.eval(x, kinks, out);
    }
    fn is_piecewise_affine(&self) -> bool {
        self.affine
    }
}

#[test]
fn wrong_declarations_are_found_by_the_checker() {
    let samples: Vec<Vec<f64>> = (0..8)
        .map(|k| vec![0.3 + 0.7 * f64::from(k), 2.0 - 0.4 * f64::from(k)])
        .collect();
    let declared = |name: &str, affine| {
        Traced::new(Declared {
            formula: Formula(FORMULAS.iter().position(|f| f.0 == name).unwrap()),
            affine,
        })
    };
    for name in ["x^2 - a", "x + a + 1e-300 x a", "max(x a, 1)"] {
        let map = declared(name, true);
        let told = check(&map, &samples, &CheckOptions::default());
        // A term that is lost in the rounding of the others changes no derivative.
        let lost = name.contains("1e-300");
        match told {
            Ok(_) => assert!(lost, "{name}"),
            Err(CheckError::Findings(found)) => {
                assert!(
                    !lost && found.iter().all(|f| f.kind == FindingKind::Affine),
                    "{name}: {found:?}"
                );
            }
            Err(other) => panic!("{name}: {other}"),
        }
    }
    check(
        &declared("max(x, 1) + min(a, x) - abs(x - a)", true),
        &samples,
        &CheckOptions::default(),
    )
    .unwrap();
    assert!(!declared("x + 3 a - 1", false).is_piecewise_affine());
}

/// Springs in a row between a wall and a plate that is pulled with the force α; x = (places of their ends,
/// α). Each of the first is three times as stiff beyond its own limit.
struct Row {
    springs: usize,
    bent: usize,
    /// Coefficient of y₀ α in the first row.
    product: f64,
}

impl Row {
    /// The limits lie in (0.1, 1), in no particular order and no two at one force.
    fn limit(&self, k: usize) -> f64 {
        0.1 + 0.9 * (0.618_033_988_749_894_8 * (k + 1) as f64).fract()
    }

    /// The last end of the springs under a force.
    fn end(&self, force: f64) -> f64 {
        let stretch = |k: usize| force.min(self.limit(k)) + (force - self.limit(k)).max(0.0) / 3.0;
        (0..self.springs)
            .map(|k| if k < self.bent { stretch(k) } else { force })
            .sum()
    }
}

impl NonsmoothFunction for Row {
    fn num_vars(&self) -> usize {
        self.springs + 1
    }
    fn num_residuals(&self) -> usize {
        self.springs
    }
    fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
        let mut before = T::from(0.0);
        for k in 0..self.springs {
            let stretch = x[k] - before;
            let mut force = stretch;
            if k < self.bent {
                force += kinks.positive_part(stretch - self.limit(k)) * 2.0;
            }
            out[k] = force;
            if k > 0 {
                out[k - 1] -= force;
            }
            before = x[k];
        }
        out[self.springs - 1] -= x[self.springs];
        out[0] += x[0] * self.product * x[self.springs];
    }
}

/// 2 000 unknowns with 293 kinks along the path: each step ends at a kink, none needs a correction, and the
/// last end lies where the sum of the elongations has it.
#[test]
fn curves_of_affine_formulas_go_from_kink_to_kink() {
    let row = |product| Row {
        springs: 2000,
        bent: 293,
        product,
    };
    let map = Traced::new(row(0.0));
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let branch = Branch::follow(&map, &[0.0; 2001], Direction::Increasing, options).unwrap();
    assert_eq!((branch.points.len(), branch.transitions.len()), (2, 293));
    assert!(branch.points.iter().all(|p| p.corrections == 0));
    assert!(
        branch
            .transitions
            .iter()
            .all(|t| t.kind == TransitionKind::PassThrough && t.complete)
    );
    let mut limits: Vec<f64> = (0..293).map(|k| map.function().limit(k)).collect();
    limits.sort_by(f64::total_cmp);
    for (t, limit) in branch.transitions.iter().zip(&limits) {
        assert!((t.parameter() - limit).abs() < 1e-13, "{} {limit}", t.parameter());
        // The condition number of a row of n springs is about n².
        let end = map.function().end(*limit);
        assert!((t.x[1999] - end).abs() < 2000.0_f64.powi(2) * f64::EPSILON * end);
    }
    assert!(!Traced::new(row(1e-12)).is_piecewise_affine());
}

/// A tiny product makes a formula curved: points between the kinks show that the curve was followed in steps.
#[test]
fn curves_of_other_formulas_are_followed_in_steps() {
    let options = || ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    for (product, polygon) in [(0.0, true), (1e-12, false)] {
        let map = Traced::new(Row {
            springs: 5,
            bent: 5,
            product,
        });
        let branch = Branch::follow(&map, &[0.0; 6], Direction::Increasing, options()).unwrap();
        assert_eq!(branch.transitions.len(), 5);
        assert_eq!(branch.points.len() == 2, polygon, "{}", branch.points.len());
    }
}
