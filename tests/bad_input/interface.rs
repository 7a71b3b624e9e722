use semismooth::interface::{CondensedInterface, InterfaceLoad, InterfaceProblem};
use semismooth::piecewise::{MinMap, PiecewiseSmooth, Selection};
use semismooth::sparse::{Matrix, Pattern};

use super::piecewise::vee;
use super::table::{BAD, Table, rows};

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
    fn num_vars(&self) -> usize {
        2 * self.0 + 1
    }
    fn num_residuals(&self) -> usize {
        self.0
    }
    fn num_sites(&self) -> usize {
        self.0
    }
    fn num_pieces(&self, _: usize) -> usize {
        2
    }
    fn num_tests(&self, _: usize) -> usize {
        1
    }
    fn cell(&self, _: usize, piece: usize) -> &[semismooth::piecewise::Facet] {
        use semismooth::piecewise::Facet;
        const CELLS: [[Facet; 1]; 2] = [[Facet::negative(0)], [Facet::positive(0)]];
        &CELLS[piece]
    }
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
    let load = || InterfaceLoad::constant(vec![1.0, 0.0]);
    let new = "interface::InterfaceProblem::new";
    let with = |a: Matrix, b: Matrix, load: InterfaceLoad| InterfaceProblem::new(a, b, load, Unilateral(1));
    t.refuses(new, "an oblong operator", "", || with(b(), b(), load()).map(drop));
    t.refuses(new, "an empty operator", "", || {
        with(
            Matrix::zeros(Pattern::full(0, 0)),
            Matrix::zeros(Pattern::full(0, 0)),
            InterfaceLoad::constant(vec![]),
        )
        .map(drop)
    });
    t.refuses(new, "traces of another width", "", || {
        with(a(), rows(&[&[1.0]]), load()).map(drop)
    });
    t.refuses(new, "a law of other traces", "law", || {
        InterfaceProblem::new(a(), b(), load(), Unilateral(2)).map(drop)
    });
    t.refuses(new, "a law that is a curve in one trace", "law", || {
        InterfaceProblem::new(a(), b(), load(), vee()).map(drop)
    });
    t.refuses(new, "a law without the parameter", "law", || {
        InterfaceProblem::new(a(), b(), load(), law(1)).map(drop)
    });
    for n in [0, 1, 3] {
        t.refuses(new, "a load of another length", "load", || {
            with(a(), b(), InterfaceLoad::constant(vec![1.0; n])).map(drop)
        });
        t.refuses(new, "a slope of another length", "", || {
            with(a(), b(), InterfaceLoad::affine(vec![1.0; 2], vec![1.0; n])).map(drop)
        });
        t.refuses(new, "a case of another length", "", || {
            with(
                a(),
                b(),
                InterfaceLoad::cases(vec![1.0; 2], vec![vec![1.0; n]], |_, _, _| {}),
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
            with(a(), b(), InterfaceLoad::constant(vec![bad, 0.0])).map(drop)
        });
    }
    let condense = "interface::CondensedInterface::new";
    t.refuses(condense, "a singular operator", "positive definite", || {
        CondensedInterface::new(with(rows(&[&[1.0, 1.0], &[1.0, 1.0]]), b(), load())?).map(drop)
    });
    t.refuses(condense, "an indefinite operator", "positive definite", || {
        CondensedInterface::new(with(rows(&[&[1.0, 2.0], &[2.0, 1.0]]), b(), load())?).map(drop)
    });
    for size in [1e-320, 1e300, f64::MAX] {
        t.survives(condense, "sizes", || {
            let problem = with(rows(&[&[size, 0.0], &[0.0, size]]), rows(&[&[size, 0.0]]), load()).unwrap();
            CondensedInterface::new(problem).map(drop)
        });
    }
    let c = CondensedInterface::new(with(a(), b(), load()).unwrap()).unwrap();
    let m = c.num_vars();
    let full = m + 2;
    let selection = Selection::uniform(1, 0);
    for n in [0, m - 1, m + 7] {
        let x = vec![0.5; n];
        t.refuses(
            "interface::CondensedInterface::expand",
            "x of another length",
            "",
            || c.expand(&x),
        );
        t.refuses(
            "interface::CondensedInterface::restrict",
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
        t.refuses("interface::CondensedInterface::expand", "x", "", || c.expand(&x));
        t.refuses("interface::CondensedInterface::restrict", "x", "", || {
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
        t.survives("interface::InterfaceProblem::load_at", "alpha", || {
            with(a(), b(), load()).unwrap().load_at(bad)
        });
    }
    t.finish();
}
