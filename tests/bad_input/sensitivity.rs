use semismooth::piecewise::{MinMap, PiecewiseSmooth, Selection};
use semismooth::sensitivity::{Loaded, Sensitivity, SensitivityError, valid_along};
use semismooth::sparse::Matrix;

use super::table::{BAD, NOT_POSITIVE, Table, rows};

/// min(x, 2 x).
fn plain() -> impl PiecewiseSmooth + Clone {
    MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[0];
        b[0] = 2.0 * x[0];
    })
}

/// min(x, 2 x) = θ.
fn loaded() -> Loaded<impl PiecewiseSmooth + Clone> {
    Loaded::new(plain(), rows(&[&[-1.0]])).unwrap()
}

/// x = θ, with another derivative in x, which may be in a row that there is not.
struct Line {
    value: f64,
    row: usize,
}
impl PiecewiseSmooth for Line {
    fn num_vars(&self) -> usize {
        2
    }
    fn num_residuals(&self) -> usize {
        1
    }
    fn num_sites(&self) -> usize {
        0
    }
    fn num_pieces(&self, _: usize) -> usize {
        1
    }
    fn num_tests(&self, _: usize) -> usize {
        0
    }
    fn cell(&self, _: usize, _: usize) -> &[semismooth::piecewise::Facet] {
        &[]
    }
    fn test_functions(&self, _: &[f64], _: &mut [f64]) {}
    fn residual(&self, _: &Selection, x: &[f64], out: &mut [f64]) {
        out[0] = x[0] - x[1];
    }
    fn jacobian(&self, _: &Selection, _: &[f64], jac: &mut Matrix) {
        jac.add(self.row, 0, self.value);
        jac.add(0, 1, -1.0);
    }
}

#[test]
fn derivatives_of_solutions() {
    let mut t = Table::new("sensitivity");
    let new = "sensitivity::Sensitivity::new";
    let kink = || Sensitivity::new(loaded(), &[0.0], &[0.0]).unwrap();
    for bad in BAD {
        t.refuses(new, "x", "solution x[0]", || {
            Sensitivity::new(loaded(), &[bad], &[0.0]).map(drop)
        });
        t.refuses(new, "θ", "parameters[0]", || {
            Sensitivity::new(loaded(), &[0.0], &[bad]).map(drop)
        });
        t.refuses(new, "a derivative", "derivative", || {
            Sensitivity::new(Line { value: bad, row: 0 }, &[0.0], &[0.0]).map(drop)
        });
        t.refuses("sensitivity::Loaded::new", "an entry", "", || {
            Loaded::new(plain(), rows(&[&[bad]])).map(drop)
        });
        t.refuses("sensitivity::Sensitivity::jvp", "δ", "parameters[0]", || {
            kink().jvp(&[bad])
        });
        t.refuses(
            "sensitivity::Sensitivity::directional",
            "δ",
            "parameters[0]",
            || kink().directional(&[bad]),
        );
        t.refuses("sensitivity::Sensitivity::vjp", "w", "unknowns[0]", || {
            kink().vjp(&[bad])
        });
        t.refuses(
            "sensitivity::Sensitivity::element",
            "a direction",
            "frame[0]",
            || kink().element(&[[bad]]).map(drop),
        );
        t.refuses(
            "sensitivity::Sensitivity::valid_until",
            "δ",
            "parameters[0]",
            || kink().valid_until(&[bad], 1.0),
        );
        t.refuses("sensitivity::Element::jvp", "δ", "parameters[0]", || {
            kink().element(&[[1.0]]).unwrap().jvp(&[bad])
        });
        t.refuses("sensitivity::Element::vjp", "w", "unknowns[0]", || {
            kink().element(&[[1.0]]).unwrap().vjp(&[bad])
        });
    }
    for horizon in BAD.into_iter().chain(NOT_POSITIVE) {
        t.refuses(
            "sensitivity::Sensitivity::valid_until",
            "the horizon",
            "horizon",
            || kink().valid_until(&[1.0], horizon),
        );
    }
    t.refuses("sensitivity::Loaded::new", "other rows", "length 2", || {
        Loaded::new(plain(), Matrix::identity(2)).map(drop)
    });
    t.refuses(new, "x of another length", "length 2", || {
        Sensitivity::new(loaded(), &[0.0; 2], &[0.0]).map(drop)
    });
    t.refuses(new, "θ of another length", "length 0", || {
        Sensitivity::new(loaded(), &[0.0], &[]).map(drop)
    });
    t.refuses(new, "an entry outside of the pattern", "(1, 0)", || {
        Sensitivity::new(Line { value: 1.0, row: 1 }, &[0.0], &[0.0]).map(drop)
    });
    t.refuses(new, "a singular derivative", "singular", || {
        Sensitivity::new(Line { value: 0.0, row: 0 }, &[0.0], &[0.0]).map(drop)
    });
    t.refuses(new, "no solution", "no solution", || {
        Sensitivity::new(loaded(), &[3.0], &[1.0]).map(drop)
    });
    t.refuses(
        "sensitivity::Sensitivity::element",
        "no direction",
        "1 linearly",
        || kink().element::<[f64; 1]>(&[]).map(drop),
    );
    t.refuses(
        "sensitivity::Sensitivity::derivative",
        "a kink",
        "not known",
        || kink().derivative(),
    );
    t.holds(
        "sensitivity::Sensitivity::differentiable",
        "a kink is told",
        || kink().differentiable().is_ok_and(|d| d.known() == Some(false)),
    );
    t.holds("sensitivity::Element::matrix", "an element has a matrix", || {
        kink().element(&[[1.0]]).and_then(|mut e| e.matrix()).is_ok()
    });
    let along = "sensitivity::valid_along";
    let family = |theta: Vec<f64>| move |_: f64| Ok::<_, SensitivityError>((loaded(), theta.clone()));
    for bad in NOT_POSITIVE {
        t.refuses(along, "horizon", "horizon", || {
            valid_along(family(vec![1.0]), &[1.0], bad)
        });
    }
    for bad in BAD {
        t.refuses(along, "x", "x[0]", || valid_along(family(vec![1.0]), &[bad], 1.0));
        t.refuses(along, "θ", "parameters[0]", || {
            valid_along(family(vec![bad]), &[1.0], 1.0)
        });
    }
    t.refuses(along, "few parameters", "parameters", || {
        valid_along(family(vec![]), &[1.0], 1.0)
    });
    t.refuses(along, "no solution", "no solution", || {
        valid_along(family(vec![1.0]), &[3.0], 1.0)
    });
    t.holds(new, "an error has a message", || {
        !SensitivityError::NotDifferentiable.to_string().is_empty()
    });
    t.finish();
}
