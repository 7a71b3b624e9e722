use super::*;
use crate::spread::Random;

/// A root of forms with random coefficients, its first two forms fixed, and the same with each coefficient off by a rounding error.
fn roots(random: &mut Random, rows: usize, columns: usize) -> [Table; 2] {
    let mut forms: [Vec<Form>; 2] = [Vec::new(), Vec::new()];
    for _ in 0..rows {
        let numbers: Vec<f64> = (0..=columns).map(|_| random.symmetric()).collect();
        let off: Vec<f64> = numbers
            .iter()
            .map(|a| a + f64::EPSILON * random.symmetric())
            .collect();
        for (forms, numbers) in forms.iter_mut().zip([numbers, off]) {
            forms.push(Form {
                constant: numbers[0],
                coefficients: numbers[1..].to_vec(),
                error: f64::EPSILON,
            });
        }
    }
    forms.map(|forms| {
        let mut root = Table::new(columns, forms.iter());
        assert!(root.fix(0).is_ok() && root.fix(1).is_ok());
        root.compact()
    })
}

/// A column is bounded by its own sign constraint, and by rows.
#[test]
fn columns_are_bounded_by_their_own_sign_and_by_rows() {
    let form = |constant: f64, rate: f64| Form {
        constant,
        coefficients: vec![rate],
        error: f64::EPSILON,
    };
    // y and 1 − y.
    let forms = [form(0.0, 1.0), form(1.0, -1.0)];
    let mut table = Table::new(1, forms.iter());
    table.exchange(0, 0);
    assert!(!table.is_bounded(0, Sign::Positive) && !table.is_bounded(0, Sign::Negative));
    assert!(table.constrain(0, Sign::Positive).is_ok());
    assert!(table.is_bounded(0, Sign::Positive) && !table.is_bounded(0, Sign::Negative));
}

/// 0 y − v ≥ 0 is a contradiction where v is more than what the error of the coefficient makes of unknowns up to 1e4.
#[test]
fn contradictions_are_clearer_than_what_is_not_known() {
    for (violation, error, clear) in [
        (1e-8, 0.0, true),
        (1e-10, 0.0, false),
        (1e-6, 1e-14, true),
        (1e-9, 1e-14, false),
        (1e-4, 1e-11, true),
        (1e-6, 1e-11, false),
    ] {
        let form = Form {
            constant: -violation,
            coefficients: vec![0.0],
            error,
        };
        let mut table = Table::new(1, [form].iter());
        table.constrain(0, Sign::Positive).unwrap();
        assert_eq!(
            table.repair(Deadline::after(None)).is_err(),
            clear,
            "{violation:e} {error:e}"
        );
    }
}

/// After the time limit −1 ≥ 0 is no contradiction: nothing that depends on it is reported.
#[test]
fn there_is_no_verdict_once_time_is_over() {
    let form = Form {
        constant: -1.0,
        coefficients: vec![0.0],
        error: f64::EPSILON,
    };
    let mut table = Table::new(1, [form].iter());
    table.constrain(0, Sign::Positive).unwrap();
    assert_eq!(table.repair(Deadline::after(None).or(&|| true)), Ok(()));
    assert!(table.repair(Deadline::after(None).or(&|| false)).is_err());
}

/// y₀ or y₁ could make 1e-6 y₀ + y₁ − 1 positive. If y₁ does, no digits are lost, whether their signs are given or not.
#[test]
fn rows_are_repaired_by_large_coefficients() {
    for signed in [false, true] {
        let forms = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 1e-6, 1.0]].map(|a| Form {
            constant: a[0],
            coefficients: a[1..].to_vec(),
            error: f64::EPSILON,
        });
        let mut table = Table::new(2, forms.iter());
        (0..2).for_each(|k| table.exchange(k, k));
        for k in 0..3 {
            if signed || k == 2 {
                table.constrain(k, Sign::Positive).unwrap();
            }
        }
        table.repair(Deadline::after(None)).unwrap();
        assert!(table.value(2) >= 0.0 && table.largest_error() < 1e-14, "{signed}");
    }
}

/// Exchanges there and back accumulate the error bounds of all of them. A recomputed dictionary has the same rows, and bounds that
/// cover, with the safety factor, the effect of rounding errors of the root on its rows, and are not much larger.
#[test]
fn dictionaries_made_anew_forget_the_way() {
    let mut random = Random::new(3);
    let (rows, columns) = (100, 40);
    for _ in 0..10 {
        let [root, off] = roots(&mut random, rows, columns);
        let mut table = root.compact();
        for _ in 0..300 {
            let (r, c) = (random.below(table.rows.len()), random.below(table.active));
            if table.row(r)[1 + c].abs() > 0.3 {
                table.exchange(r, c);
            }
        }
        let third = (0..rows).find(|&v| matches!(table.place(v), Place::Row(_)));
        table.fix(third.unwrap()).unwrap();
        let (anew, other) = (table.reinverted(&root).unwrap(), table.reinverted(&off).unwrap());
        assert!(anew.largest_error() < 1e-3 * table.largest_error());
        let mut worst = 0.0f64;
        for var in 0..rows {
            let (Some(old), Some(new)) = (table.form(var), anew.form(var)) else {
                assert_eq!(table.place(var) == Place::Gone, anew.place(var) == Place::Gone);
                continue;
            };
            let beside = other.form(var).unwrap();
            let mut pairs = vec![(old.constant, new.constant, beside.constant)];
            for (c, &column) in table.active_columns().iter().enumerate() {
                let (Place::Column(k), Place::Column(l)) = (anew.place(column), other.place(column)) else {
                    panic!("{column} is no column");
                };
                pairs.push((old.coefficients[c], new.coefficients[k], beside.coefficients[l]));
            }
            for (old, new_value, beside_value) in pairs {
                assert!((old - new_value).abs() <= 1e-6 * (1.0 + new_value.abs()));
                let apart = (new_value - beside_value).abs();
                assert!(apart <= SAFETY * new.error, "{apart:e}, {:e}", new.error);
                worst = worst.max(apart);
            }
        }
        assert!(
            anew.largest_error() <= 1e3 * worst,
            "{:e}, {worst:e}",
            anew.largest_error()
        );
    }
}

/// −y₀ + a y₁ with y₀ ≥ 0 and any y₁ is bounded by 0 where a is rounding of the row, and known to be so where the row is known well.
#[test]
fn rows_are_bounded_by_what_is_known_of_them() {
    for (a, error, bounded) in [
        (0.0, f64::EPSILON, true),
        (0.0, 1e-3, false),
        (1e-9, 1e-10, true),
        (1e-7, 1e-10, false),
    ] {
        let form = |coefficients: [f64; 2], error: f64| Form {
            constant: 0.0,
            coefficients: coefficients.to_vec(),
            error,
        };
        let forms = [
            form([1.0, 0.0], f64::EPSILON),
            form([0.0, 1.0], f64::EPSILON),
            form([-1.0, a], error),
        ];
        let mut table = Table::new(2, forms.iter());
        (0..2).for_each(|k| table.exchange(k, k));
        table.constrain(0, Sign::Positive).unwrap();
        assert_eq!(table.is_bounded(2, Sign::Negative), bounded, "{a:e} {error:e}");
        assert!(!table.is_bounded(2, Sign::Positive));
    }
}
