use semismooth::interface::{InterfaceProblem, LoadPath};
use semismooth::piecewise::{MinMap, PiecewiseSmooth, Selection};
use semismooth::sparse::{Matrix, Pattern};

use super::piecewise::vee;
use super::table::{BAD, Table, rows};
use crate::maps::two_pieces;

/// 0 ≤ λ ⟂ −v ≥ 0 for p traces, in (v, λ, α).
fn law(p: usize) -> impl PiecewiseSmooth + Clone {
    MinMap::new(p, move |z: &[f64], a: &mut [f64], b: &mut [f64]| {
        for i in 0..a.len() {
            a[i] = z.get(p + i).copied().unwrap_or(0.0);
            b[i] = -z[i];
        }
    })
}

/// The same as a curve of 2p + 1 variables.
#[derive(Debug, Clone)]
struct Unilateral(usize);

impl PiecewiseSmooth for Unilateral {
    two_pieces!(self, [negative, positive], 2 * self.0 + 1, self.0, self.0);
    fn test_functions(&self, z: &[f64], out: &mut [f64]) {
        (0..self.0).for_each(|i| out[i] = z[self.0 + i] + z[i]);
    }
    fn residual(&self, s: &Selection, z: &[f64], out: &mut [f64]) {
        (0..self.0).for_each(|i| out[i] = [z[self.0 + i], -z[i]][s.piece(i)]);
    }
    fn jacobian(&self, s: &Selection, _: &[f64], jac: &mut Matrix) {
        for i in 0..self.0 {
            match s.piece(i) {
                0 => jac.add(i, self.0 + i, 1.0),
                _ => jac.add(i, i, -1.0),
            }
        }
    }
    fn is_piecewise_affine(&self) -> bool {
        true
    }
}

#[test]
fn interfaces() {
    let mut t = Table::new("interface");
    let a = || rows(&[&[2.0, -1.0], &[-1.0, 2.0]]);
    let b = || rows(&[&[1.0, 0.0]]);
    let load = || LoadPath::constant(vec![1.0, 0.0]);
    let new = "interface::InterfaceProblem::from_parts";
    let with =
        |a: Matrix, b: Matrix, load: LoadPath| InterfaceProblem::from_parts(a, &b, load, Unilateral(1));
    t.refuses(new, "an oblong operator", "", || with(b(), b(), load()).map(drop));
    t.refuses(new, "an empty operator", "", || {
        with(
            Matrix::zeros(Pattern::full(0, 0)),
            Matrix::zeros(Pattern::full(0, 0)),
            LoadPath::constant(vec![]),
        )
        .map(drop)
    });
    t.refuses(new, "traces of another width", "", || {
        with(a(), rows(&[&[1.0]]), load()).map(drop)
    });
    t.refuses(new, "a law of other traces", "law", || {
        InterfaceProblem::from_parts(a(), &b(), load(), Unilateral(2)).map(drop)
    });
    t.refuses(new, "a law that is a curve in one trace", "law", || {
        InterfaceProblem::from_parts(a(), &b(), load(), vee()).map(drop)
    });
    t.refuses(new, "a law without the parameter", "law", || {
        InterfaceProblem::from_parts(a(), &b(), load(), law(1)).map(drop)
    });
    for n in [0, 1, 3] {
        t.refuses(new, "a load of another length", "load", || {
            with(a(), b(), LoadPath::constant(vec![1.0; n])).map(drop)
        });
        t.refuses(new, "a slope of another length", "", || {
            with(a(), b(), LoadPath::affine(vec![1.0; 2], vec![1.0; n])).map(drop)
        });
        t.refuses(new, "a case of another length", "", || {
            with(
                a(),
                b(),
                LoadPath::cases(vec![1.0; 2], vec![vec![1.0; n]], |_, _, _| {}),
            )
            .map(drop)
        });
    }
    for bad in BAD {
        t.refuses(new, "A", "(0, 0)", || {
            with(rows(&[&[bad, 0.0], &[0.0, 1.0]]), b(), load()).map(drop)
        });
        t.refuses(new, "B", "(0, 0)", || {
            with(a(), rows(&[&[bad, 0.0]]), load()).map(drop)
        });
        t.refuses(new, "the load", "load", || {
            with(a(), b(), LoadPath::constant(vec![bad, 0.0])).map(drop)
        });
    }
    let condense = "interface::InterfaceProblem::condensed";
    t.refuses(condense, "a singular operator", "positive definite", || {
        with(rows(&[&[1.0, 1.0], &[1.0, 1.0]]), b(), load())?
            .condensed()
            .map(drop)
    });
    t.refuses(condense, "an indefinite operator", "positive definite", || {
        with(rows(&[&[1.0, 2.0], &[2.0, 1.0]]), b(), load())?
            .condensed()
            .map(drop)
    });
    for size in [1e-320, 1e300, f64::MAX] {
        t.survives(condense, "sizes", || {
            let problem = with(rows(&[&[size, 0.0], &[0.0, size]]), rows(&[&[size, 0.0]]), load()).unwrap();
            problem.condensed().map(drop)
        });
    }
    let c = with(a(), b(), load()).unwrap().condensed().unwrap();
    let m = c.num_vars();
    let full = m + 2;
    let selection = Selection::uniform(1, 0);
    for n in [0, m - 1, m + 7] {
        let x = vec![0.5; n];
        t.refuses("interface::Interface::expand", "x of another length", "", || {
            c.expand(&x)
        });
        t.refuses(
            "interface::Interface::restrict",
            "x of another length",
            "",
            || c.restrict(&x),
        );
        t.refuses(
            "interface::CondensedInterface::full_residual",
            "x of another length",
            "",
            || c.full_residual(&selection, &x),
        );
        t.refuses(
            "interface::CondensedInterface::expand_tangent",
            "x of another length",
            "",
            || c.expand_tangent(&x, &vec![0.0; m]),
        );
        t.refuses(
            "interface::CondensedInterface::expand_tangent",
            "t of another length",
            "",
            || c.expand_tangent(&vec![0.5; m], &x),
        );
    }
    for foreign in [
        Selection::default(),
        Selection::uniform(2, 0),
        Selection::uniform(1, 9),
    ] {
        t.refuses(
            "interface::CondensedInterface::full_residual",
            "a selection of another map",
            "selection",
            || c.full_residual(&foreign, &vec![0.5; m]),
        );
    }
    for bad in BAD {
        let x = vec![bad; m];
        t.refuses("interface::Interface::expand", "x", "", || c.expand(&x));
        t.refuses("interface::Interface::restrict", "x", "", || {
            c.restrict(&vec![bad; full])
        });
        t.refuses("interface::CondensedInterface::full_residual", "x", "", || {
            c.full_residual(&selection, &x)
        });
        t.refuses("interface::CondensedInterface::expand_tangent", "x", "", || {
            c.expand_tangent(&x, &vec![0.0; m])
        });
        t.refuses("interface::CondensedInterface::expand_tangent", "t", "", || {
            c.expand_tangent(&vec![0.5; m], &x)
        });
        t.refuses("interface::Interface::load_at", "alpha", "[0]", || {
            c.load_at(&[bad])
        });
        t.refuses(
            "interface::CondensedInterface::free_traces",
            "alpha",
            "[0]",
            || c.free_traces(&[bad]),
        );
        t.refuses("interface::Interface::traces", "x", "[0]", || c.traces(&x));
    }
    t.survives("interface::CondensedInterface::full", "any problem", || c.full());
    t.exempt(&["interface::View::under"], "called by problems of contact");
    t.finish();
}
