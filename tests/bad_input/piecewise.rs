use semismooth::linear::IncompleteLu;
use semismooth::piecewise::check::{CheckOptions, check, check_semismooth};
use semismooth::piecewise::{
    ActiveSet, Assembled, Facet, MatrixFree, MinMap, PiecewiseError, PiecewiseSmooth, Regularity,
    RegularityOptions, Selection, Selections, Semismooth, TestLayout, active_set, b_derivative,
    b_subdifferential, bd_regularity, bd_regularity_semismooth, cd_regularity, cd_regularity_semismooth,
    cell_margin, clarke_element, coherent_orientation, essential_activity, implicit_function, local_index,
    local_uniqueness, local_uniqueness_with, select, select_pieces, value,
};
use semismooth::sparse::{Matrix, Pattern};

use super::table::{BAD, NOT_POSITIVE, Table, rows};

/// x = 0 in two unknowns, with a pattern of another order, an entry in another row, or a value that is NaN or infinite.
struct WrongJacobian {
    order: usize,
    row: usize,
    value: f64,
}
impl Semismooth for WrongJacobian {
    fn num_vars(&self) -> usize {
        2
    }
    fn pattern(&self) -> Pattern {
        Pattern::full(self.order, self.order)
    }
    fn residual(&self, x: &[f64], out: &mut [f64]) {
        out.copy_from_slice(x);
    }
    fn jacobian(&self, _: &[f64], jac: &mut Matrix) {
        jac.add(self.row, 0, self.value);
    }
}

/// min(a, b) = 0 with a = y − α, b = y + α: α = ±y for y ≥ 0.
pub(crate) fn vee() -> impl PiecewiseSmooth + Clone {
    MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0] - x[1];
        b[0] = x[0] + x[1];
    })
}

/// As many equations as variables: min(xᵢ, 1) = 0.
pub(crate) fn square(n: usize) -> impl PiecewiseSmooth + Clone {
    MinMap::new(n, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a.copy_from_slice(x);
        b.fill(1.0);
    })
}

/// A map whose residual is NaN, infinite, or overflows.
pub(crate) fn no_numbers(value: f64) -> impl PiecewiseSmooth + Clone {
    MinMap::curve(1, move |_: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = value;
        b[0] = value;
    })
}

/// The functions about generalised derivatives at a point, on arguments without meaning.
fn notions(t: &mut Table) {
    let (curve, equation) = (vee(), square(2));
    type Verdict = fn(&dyn PiecewiseSmooth, &[f64], f64, u64) -> Result<Regularity, PiecewiseError>;
    let verdicts: [(&'static str, Verdict); 2] = [
        ("piecewise::bd_regularity", |m, x, tolerance, cap| {
            bd_regularity(m, x, tolerance, cap)
        }),
        ("piecewise::cd_regularity", |m, x, tolerance, cap| {
            cd_regularity(m, x, tolerance, cap)
        }),
    ];
    let all = |map: &dyn PiecewiseSmooth, x: &[f64], tolerance: f64| -> Result<usize, PiecewiseError> {
        let elements = b_subdifferential(map, x, tolerance)?;
        Ok(elements.take(10).collect::<Result<Vec<_>, _>>()?.len())
    };
    let first = [(Selection::uniform(2, 0), 1.0)];
    let clarke = |x: &[f64], tolerance: f64| clarke_element(&equation, x, &first, tolerance);
    let lengths = [
        vec![],
        vec![0.5],
        vec![0.5; 3],
        vec![f64::NAN, 0.0],
        vec![0.0, f64::INFINITY],
    ];
    for x in &lengths {
        for (name, f) in verdicts {
            t.refuses(name, "x", "x", || f(&equation, x, 1e-9, 10));
        }
        t.refuses("piecewise::b_subdifferential", "x", "x", || {
            all(&equation, x, 1e-9)
        });
        t.refuses("piecewise::clarke_element", "x", "x", || clarke(x, 1e-9));
        t.refuses("piecewise::local_index", "x", "x", || {
            local_index(&equation, x, 1e-9, 10)
        });
        t.refuses("piecewise::implicit_function", "x", "x", || {
            implicit_function(&curve, x, 1e-9, 10)
        });
        t.refuses("piecewise::bd_regularity_semismooth", "x", "x", || {
            bd_regularity_semismooth(&fine(), x, 1e-9, 10)
        });
        t.refuses("piecewise::cd_regularity_semismooth", "x", "x", || {
            cd_regularity_semismooth(&fine(), x, 1e-9, 10)
        });
        t.refuses("piecewise::check::check_semismooth", "a sample", "", || {
            check_semismooth(&fine(), std::slice::from_ref(x), &CheckOptions::default())
        });
    }
    let at = [0.5, 0.5];
    let small = Listed(rows(&[&[1.0]]));
    t.refuses(
        "piecewise::bd_regularity_semismooth",
        "an element",
        "element",
        || bd_regularity_semismooth(&small, &at, 1e-9, 10),
    );
    t.refuses(
        "piecewise::cd_regularity_semismooth",
        "an element",
        "element",
        || cd_regularity_semismooth(&small, &at, 1e-9, 10),
    );
    t.refuses(
        "piecewise::implicit_function",
        "no parameter",
        "parameter",
        || implicit_function(&equation, &at, 1e-9, 10),
    );
    for bad in BAD {
        for (name, f) in verdicts {
            t.survives(name, "tolerance", || f(&equation, &at, bad, 10));
            t.survives(name, "a residual that is no number", || {
                f(&no_numbers(bad), &at, 1e-9, 10)
            });
            t.survives(name, "limits", || {
                f(&curve, &[0.0; 2], 1e-9, 0).or(f(&curve, &[0.0; 2], 1e-9, u64::MAX))
            });
        }
        t.survives("piecewise::b_subdifferential", "tolerance", || {
            all(&equation, &at, bad)
        });
        let options = RegularityOptions::default().with_tolerance(-bad.abs());
        t.refuses(
            "piecewise::RegularityOptions::validate",
            "tolerance",
            "regularity.tolerance",
            || options.validate(),
        );
        t.survives("piecewise::clarke_element", "tolerance", || clarke(&at, bad));
        t.survives("piecewise::local_index", "tolerance", || {
            local_index(&equation, &at, bad, 0)
        });
        let element = Listed(rows(&[&[bad, 0.0], &[0.0, 1.0]]));
        t.survives("piecewise::bd_regularity_semismooth", "an element", || {
            bd_regularity_semismooth(&element, &at, bad, 10)
        });
        t.survives("piecewise::cd_regularity_semismooth", "an element", || {
            cd_regularity_semismooth(&element, &at, bad, 10)
        });
        t.survives("piecewise::implicit_function", "tolerance", || {
            implicit_function(&curve, &at, bad, 0)
        });
        t.survives(
            "piecewise::implicit_function",
            "a residual that is no number",
            || implicit_function(&no_numbers(bad), &at, 1e-9, u64::MAX),
        );
        t.survives("piecewise::local_index", "a residual that is no number", || {
            local_index(&no_numbers(bad), &at, 1e-9, u64::MAX)
        });
        t.refuses("piecewise::clarke_element", "a weight", "weight", || {
            clarke_element(&equation, &at, &[(Selection::uniform(2, 0), bad)], 1e-9)
        });
        t.refuses(
            "piecewise::check::check_semismooth",
            "tolerance",
            "tolerance",
            || {
                check_semismooth(
                    &fine(),
                    &[at.to_vec()],
                    &CheckOptions::default().with_tolerance(bad),
                )
            },
        );
        t.refuses(
            "piecewise::check::check_semismooth",
            "a derivative that is no number",
            "",
            || {
                let map = WrongJacobian { value: bad, ..fine() };
                check_semismooth(&map, &[at.to_vec()], &CheckOptions::default())
            },
        );
    }
    for huge in [1e160, 1e300, f64::MAX] {
        for (name, f) in verdicts {
            t.survives(name, "huge x", || f(&equation, &[huge; 2], 1e-9, 10));
        }
        t.survives("piecewise::local_index", "huge x", || {
            local_index(&equation, &[huge; 2], 1e-9, 10)
        });
        t.survives("piecewise::check::check_semismooth", "huge x", || {
            check_semismooth(&fine(), &[vec![huge; 2]], &CheckOptions::default())
        });
    }
    t.refuses(
        "piecewise::clarke_element",
        "a selection of another map",
        "selection",
        || clarke_element(&equation, &at, &[(Selection::uniform(2, 7), 1.0)], 1e-9),
    );
    t.refuses(
        "piecewise::check::check_semismooth",
        "no samples",
        "sample",
        || check_semismooth(&fine(), &[], &CheckOptions::default()),
    );
    for (order, row) in [(3, 0), (2, 5)] {
        t.refuses(
            "piecewise::check::check_semismooth",
            "a wrong pattern",
            "pattern",
            || {
                let map = WrongJacobian {
                    order,
                    row,
                    value: 1.0,
                };
                check_semismooth(&map, &[at.to_vec()], &CheckOptions::default())
            },
        );
    }
}

/// The zero map, with one element of the B-subdifferential.
struct Listed(Matrix);
impl Semismooth for Listed {
    fn num_vars(&self) -> usize {
        2
    }
    fn residual(&self, _: &[f64], out: &mut [f64]) {
        out.fill(0.0);
    }
    fn jacobian(&self, _: &[f64], _: &mut Matrix) {}
    fn b_subdifferential(&self, _: &[f64], _: f64, _: u64) -> Option<Vec<Matrix>> {
        Some(vec![self.0.clone()])
    }
}

/// A derivative that is right in its first column only.
fn fine() -> WrongJacobian {
    WrongJacobian {
        order: 2,
        row: 0,
        value: 1.0,
    }
}

#[test]
fn piecewise_maps() {
    let mut t = Table::new("piecewise");
    notions(&mut t);
    let (curve, equation) = (vee(), square(2));
    let at = [0.5, 0.5];
    #[cfg(feature = "autodiff")]
    for (text, said) in [
        ("y + z", "z is unknown"),
        ("(y", "not closed"),
        ("", "expected"),
        ("y^y", "exponent"),
    ] {
        t.refuses("piecewise::Formula::read", text, said, || {
            semismooth::piecewise::Formula::read(&[text], &["y"])
        });
    }
    t.refuses(
        "piecewise::Formula::read_with",
        "a constant",
        "the constant k is inf",
        || semismooth::piecewise::Formula::read_with(&["k*y"], &["y"], &[("k", f64::INFINITY)]),
    );

    for bad in BAD {
        for x in [[bad, 0.0], [0.0, bad]] {
            t.refuses("piecewise::b_derivative", "x", "x[", || {
                b_derivative(&curve, &x, &at, 1e-9, &mut [0.0])
            });
            t.refuses("piecewise::b_derivative", "d", "d[", || {
                b_derivative(&curve, &at, &x, 1e-9, &mut [0.0])
            });
            t.refuses("piecewise::coherent_orientation", "x", "x[", || {
                coherent_orientation(&equation, &x, 1e-9, 10)
            });
            t.refuses("piecewise::essential_activity", "x", "x[", || {
                essential_activity(&curve, &x, &Selection::uniform(1, 0), 1e-9, 20_000)
            });
            t.refuses("piecewise::local_uniqueness", "x", "x[", || {
                local_uniqueness(&curve, &x, &active_set(&curve, &at, 1e-9), &rows(&[&[1.0]]), 10)
            });
            t.refuses("piecewise::local_uniqueness_with", "x", "x[", || {
                let active = active_set(&curve, &at, 1e-9);
                local_uniqueness_with(&curve, &x, &active, |_| rows(&[&[1.0]]), 10)
            });
            t.refuses(
                "piecewise::local_uniqueness_with",
                "a derivative of other rows",
                "derivative",
                || {
                    let active = active_set(&curve, &at, 1e-9);
                    local_uniqueness_with(&curve, &at, &active, |_| rows(&[&[1.0], &[1.0]]), 10)
                },
            );
            t.refuses("piecewise::check::check", "a sample", "", || {
                check(&curve, &[x.to_vec()], &CheckOptions::default())
            });
            t.survives("piecewise::active_set", "x", || active_set(&curve, &x, 1e-9));
            t.survives("piecewise::select", "x", || select(&curve, &x));
            t.survives("piecewise::value", "x", || value(&curve, &x, &mut [0.0]));
        }
        t.survives("piecewise::b_derivative", "tolerance", || {
            b_derivative(&curve, &at, &at, bad, &mut [0.0])
        });
        t.survives("piecewise::coherent_orientation", "tolerance", || {
            coherent_orientation(&equation, &at, bad, 10)
        });
        t.survives("piecewise::active_set", "tolerance", || {
            active_set(&curve, &at, bad)
        });
        for options in [
            CheckOptions::default().with_tolerance(bad),
            CheckOptions::default().with_continuity_tolerance(bad),
        ] {
            t.refuses("piecewise::check::check", "options", "tolerance", || {
                check(&curve, &[at.to_vec()], &options)
            });
            t.refuses(
                "piecewise::check::CheckOptions::validate",
                "options",
                "tolerance",
                || options.validate(),
            );
        }
    }
    for x in [vec![], vec![0.5], vec![0.5; 3]] {
        t.refuses("piecewise::b_derivative", "x of another length", "x", || {
            b_derivative(&curve, &x, &at, 1e-9, &mut [0.0])
        });
        t.refuses("piecewise::b_derivative", "d of another length", "d", || {
            b_derivative(&curve, &at, &x, 1e-9, &mut [0.0])
        });
        t.refuses("piecewise::b_derivative", "out of another length", "out", || {
            b_derivative(&curve, &at, &at, 1e-9, &mut [0.0; 2])
        });
        t.refuses(
            "piecewise::coherent_orientation",
            "x of another length",
            "x",
            || coherent_orientation(&equation, &x, 1e-9, 10),
        );
        t.refuses(
            "piecewise::essential_activity",
            "x of another length",
            "x",
            || essential_activity(&curve, &x, &Selection::uniform(1, 0), 1e-9, 20_000),
        );
        t.refuses("piecewise::local_uniqueness", "x of another length", "x", || {
            local_uniqueness(&curve, &x, &active_set(&curve, &at, 1e-9), &rows(&[&[1.0]]), 10)
        });
        t.refuses(
            "piecewise::check::check",
            "a sample of another length",
            "",
            || check(&curve, std::slice::from_ref(&x), &CheckOptions::default()),
        );
    }
    t.survives("piecewise::coherent_orientation", "a cap of 0", || {
        coherent_orientation(&equation, &[0.0, 0.0], 1e-9, 0)
    });
    t.survives("piecewise::coherent_orientation", "a cap of u64::MAX", || {
        coherent_orientation(&equation, &[0.0, 0.0], 1e-9, u64::MAX)
    });
    t.refuses("piecewise::check::check", "no samples", "sample", || {
        check(&curve, &[], &CheckOptions::default())
    });
    let foreign = [
        Selection::default(),
        Selection::uniform(2, 0),
        Selection::uniform(1, 7),
        Selection::uniform(1, 65535),
    ];
    for selection in &foreign {
        t.refuses(
            "piecewise::essential_activity",
            "a selection of another map",
            "selection",
            || essential_activity(&curve, &at, selection, 1e-9, 20_000),
        );
    }
    let active = |map: &dyn PiecewiseSmooth, x: &[f64]| active_set(map, x, 1e-9);
    t.refuses(
        "piecewise::local_uniqueness",
        "the active set of another map",
        "active",
        || local_uniqueness(&curve, &at, &active(&equation, &at), &rows(&[&[1.0]]), 10),
    );
    t.refuses(
        "piecewise::local_uniqueness",
        "a load of another shape",
        "load",
        || {
            local_uniqueness(
                &curve,
                &at,
                &active(&curve, &at),
                &Matrix::zeros(Pattern::full(3, 1)),
                10,
            )
        },
    );
    for bad in BAD {
        t.refuses(
            "piecewise::local_uniqueness",
            "a load that is no number",
            "",
            || local_uniqueness(&curve, &at, &active(&curve, &at), &rows(&[&[bad]]), 10),
        );
        t.survives(
            "piecewise::local_uniqueness",
            "a residual that is no number",
            || {
                let map = no_numbers(bad);
                local_uniqueness(&map, &at, &active(&map, &at), &rows(&[&[1.0]]), 10)
            },
        );
        t.survives("piecewise::b_derivative", "a residual that is no number", || {
            b_derivative(&no_numbers(bad), &at, &at, 1e-9, &mut [0.0])
        });
        t.refuses(
            "piecewise::check::check",
            "a residual that is no number",
            "",
            || check(&no_numbers(bad), &[at.to_vec()], &CheckOptions::default()),
        );
    }
    for huge in [1e160, 1e300, f64::MAX] {
        t.survives("piecewise::b_derivative", "huge x", || {
            b_derivative(&curve, &[huge; 2], &[huge; 2], 1e-9, &mut [0.0])
        });
        t.survives("piecewise::coherent_orientation", "huge x", || {
            coherent_orientation(&equation, &[huge; 2], 1e-9, 10)
        });
        t.survives("piecewise::check::check", "huge x", || {
            check(&curve, &[vec![huge; 2]], &CheckOptions::default())
        });
        t.survives("piecewise::essential_activity", "huge x", || {
            essential_activity(&curve, &[huge; 2], &Selection::uniform(1, 0), 1e-9, 20_000)
        });
    }
    for n in [0, usize::MAX] {
        t.survives("piecewise::check::check", "absurd limits", || {
            let options = CheckOptions::default()
                .with_max_selections(n)
                .with_max_findings(n);
            check(&curve, &[at.to_vec()], &options)
        });
    }

    let sized = |sizes: Vec<f64>| {
        MinMap::curve(1, |_: &[f64], _: &mut [f64], _: &mut [f64]| {})
            .with_typical_sizes(sizes)
            .map(drop)
    };
    for n in [1, 3] {
        t.refuses(
            "piecewise::MinMap::with_typical_sizes",
            "another length",
            "size",
            || sized(vec![1.0; n]),
        );
    }
    for bad in BAD.into_iter().chain(NOT_POSITIVE) {
        t.refuses("piecewise::MinMap::with_typical_sizes", "a size", "size", || {
            sized(vec![1.0, bad])
        });
    }

    // Functions that only read selections never fail.
    t.survives("piecewise::Selection::piece", "any site", || {
        Selection::uniform(1, 0).piece(usize::MAX)
    });
    t.survives("piecewise::Selection::set", "any site and piece", || {
        Selection::uniform(1, 0).set(usize::MAX, usize::MAX);
    });
    t.survives("piecewise::Selection::from_pieces", "any piece", || {
        Selection::from_pieces([usize::MAX])
    });
    t.survives("piecewise::Selection::copy_from", "another length", || {
        Selection::uniform(1, 0).copy_from(&Selection::uniform(3, 0));
    });
    for selection in &foreign {
        t.survives(
            "piecewise::Selection::display",
            "a selection of another map",
            || selection.display(&curve).to_string(),
        );
        t.survives(
            "piecewise::ActiveSet::contains",
            "a selection of another map",
            || active(&curve, &at).contains(selection),
        );
        t.survives("piecewise::Selections::varying", "any site", || {
            Selections::varying(&curve, selection, [0, 1, usize::MAX]).count()
        });
    }
    t.survives("piecewise::Selections::new", "no choice", || {
        Selections::new(Selection::uniform(1, 0), vec![(0, vec![]), (9, vec![1])]).count()
    });
    t.survives("piecewise::Facet::margin", "too few tests", || {
        Facet::positive(9).margin(&[])
    });
    t.survives("piecewise::cell_margin", "too few tests", || {
        cell_margin(&[Facet::negative(3)], &[1.0])
    });
    let layout = || TestLayout::new(&curve);
    t.survives("piecewise::TestLayout::describes", "another map", || {
        layout().describes(&equation)
    });
    for theta in [vec![], vec![f64::NAN], vec![0.0; 5]] {
        t.survives(
            "piecewise::select_pieces",
            "test functions of another length",
            || select_pieces(&curve, &layout(), &theta, true, 0.0, &mut Selection::default()),
        );
        t.survives(
            "piecewise::ActiveSet::from_tests",
            "test functions of another length",
            || ActiveSet::from_tests(&curve, &layout(), &theta, vec![0, 9]),
        );
    }
    for (order, row, value, names) in [
        (3, 0, 1.0, "expected 2"),
        (1, 0, 1.0, "expected 2"),
        (2, 7, 1.0, "(7, 0)"),
        (2, 0, f64::NAN, "NaN or infinite"),
    ] {
        t.refuses(
            "piecewise::MatrixFree::linearize",
            "a wrong Jacobian",
            names,
            || {
                let map = WrongJacobian { order, row, value };
                Assembled::new(&map, IncompleteLu::default()).linearize(&[0.0; 2])
            },
        );
    }
    t.finish();
}
