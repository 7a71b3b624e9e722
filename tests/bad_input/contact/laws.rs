use semismooth::contact::{
    Cohesive, CondensedContact, ContactBody, ContactError, FrictionCoefficient, FrictionCurve, Frictionless,
    FullContact, GivenBound, LimitedShear, LoadPath, LocalRow, LocalValues, NodeLaw, OrthotropicCoulomb,
    PlanarCoulomb, Worn, check_law,
};
use semismooth::piecewise::Facet;
use semismooth::sparse::Matrix;

use super::{body, condensed};
use crate::table::{BAD, Table};

/// A planar law with the one smooth piece λ = 0 that claims these numbers of pieces, test functions and history variables.
#[derive(Clone, Copy)]
struct Counted {
    pieces: usize,
    tests: usize,
    history: usize,
    cell: &'static [Facet],
}

impl NodeLaw for Counted {
    fn num_tangents(&self) -> usize {
        1
    }
    fn num_pieces(&self) -> usize {
        self.pieces
    }
    fn num_tests(&self) -> usize {
        self.tests
    }
    fn num_history(&self) -> usize {
        self.history
    }
    fn cell(&self, _piece: usize) -> &'static [Facet] {
        self.cell
    }
    fn tests(&self, _v: &LocalValues, _out: &mut [f64]) {}
    fn test_rows(&self, _v: &LocalValues, _rows: &mut [LocalRow]) {}
    fn residual(&self, _piece: usize, v: &LocalValues) -> [f64; 3] {
        [v.pressure, v.traction[0], 0.0]
    }
    fn rows(&self, _piece: usize, _v: &LocalValues) -> [LocalRow; 3] {
        [LocalRow::default(); 3]
    }
}

fn counts(t: &mut Table) {
    const LAW: Counted = Counted {
        pieces: 1,
        tests: 0,
        history: 0,
        cell: &[],
    };
    assert!(check_law(&LAW, 1, 7).is_ok() && CondensedContact::new(body(), LAW).is_ok());
    const BEHIND: &[Facet] = &[Facet::positive(1)];
    for (what, law) in [
        ("history variables", Counted { history: 5, ..LAW }),
        ("test functions", Counted { tests: 7, ..LAW }),
        (
            "test functions",
            Counted {
                tests: 1,
                cell: BEHIND,
                ..LAW
            },
        ),
        ("pieces", Counted { pieces: 0, ..LAW }),
    ] {
        t.refuses("contact::check_law", what, what, || check_law(&law, 1, 7));
        t.refuses("contact::Contact::new", what, what, || {
            CondensedContact::new(body(), law)
        });
    }
    assert!(matches!(
        check_law(&LAW, 2, 7),
        Err(ContactError::Tangents { law: 1, body: 2 })
    ));
}

pub(super) fn laws(t: &mut Table) {
    counts(t);
    let constant = || FrictionCurve::constant(0.3).unwrap();
    for bad in BAD.into_iter().chain([-1.0]) {
        t.refuses(
            "contact::FrictionCurve::constant",
            "the value",
            "friction",
            || FrictionCurve::constant(bad),
        );
        t.refuses("contact::FrictionCurve::exponential", "first", "friction", || {
            FrictionCurve::exponential(bad, 0.1, 1.0)
        });
        t.refuses("contact::FrictionCurve::exponential", "last", "friction", || {
            FrictionCurve::exponential(0.1, bad, 1.0)
        });
        t.refuses(
            "contact::FrictionCurve::exponential",
            "the length",
            "length",
            || FrictionCurve::exponential(0.2, 0.1, bad),
        );
        t.refuses("contact::FrictionCurve::table", "a coefficient", "", || {
            FrictionCurve::table(&[(0.0, bad), (1.0, 0.1)])
        });
        t.refuses("contact::FrictionCurve::table", "a slip", "", || {
            FrictionCurve::table(&[(0.0, 0.3), (bad, 0.1)])
        });
        t.survives("contact::FrictionCurve::value", "the slip", || {
            let table = FrictionCurve::table(&[(0.0, 0.3), (1.0, 0.1)]).unwrap();
            (
                table.value(bad),
                constant().value(bad),
                constant().times(bad).value(bad),
            )
        });
        t.refuses("contact::GivenBound::new", "a bound", "bound", || {
            GivenBound::new(1, vec![bad], vec![[0.3; 2]])
        });
        t.refuses("contact::LimitedShear::new", "a limit", "of shear", || {
            LimitedShear::new(1, vec![0.3], vec![bad])
        });
        t.refuses("contact::Cohesive::new", "a tension", "tension", || {
            Cohesive::new(Frictionless::plane(), vec![bad])
        });
        t.refuses("contact::Worn::new", "a rate", "wear", || {
            Worn::new(Frictionless::plane(), vec![bad])
        });
        t.refuses(
            "contact::ContactBody::with_compliance",
            "a compliance",
            "compliance",
            || body().with_compliance(&[bad], &[0.0]),
        );
        t.refuses(
            "contact::GivenBound::new",
            "a coefficient",
            "bound of friction",
            || GivenBound::new(1, vec![0.1], vec![[bad, 0.3]]),
        );
    }
    t.refuses(
        "contact::FrictionCurve::exponential",
        "no length",
        "length",
        || FrictionCurve::exponential(0.2, 0.1, 0.0),
    );
    t.refuses("contact::FrictionCurve::table", "no points", "", || {
        FrictionCurve::table(&[])
    });
    t.survives("contact::FrictionCurve::table", "one point", || {
        FrictionCurve::table(&[(0.0, 0.3)])
    });
    t.refuses("contact::FrictionCurve::table", "slips out of order", "", || {
        FrictionCurve::table(&[(1.0, 0.3), (0.0, 0.1)])
    });
    t.refuses("contact::FrictionCoefficient::per_node", "no nodes", "", || {
        FrictionCoefficient::per_node(vec![])
    });
    let one = || FrictionCoefficient::per_node(vec![constant()]).unwrap();
    t.survives(
        "contact::FrictionCoefficient::value",
        "a node that is not there",
        || one().value(7, 0.0, 0.0),
    );
    t.survives("contact::Contact::solve", "fewer curves than nodes", || {
        let row = |k: usize| {
            let mut row = [0.0; 4];
            row[k] = 1.0;
            row
        };
        let normal = Matrix::from_rows(&[row(0), row(2)]).unwrap();
        let tangential = Matrix::from_rows(&[row(1), row(3)]).unwrap();
        let two = ContactBody::new(
            Matrix::identity(4),
            normal,
            vec![tangential],
            LoadPath::constant(vec![1.0; 4]),
        )
        .unwrap();
        CondensedContact::new(two, PlanarCoulomb::new(one())).and_then(|c| c.solve(0.0, None))
    });
    for tangents in [0, 3, usize::MAX] {
        t.refuses("contact::GivenBound::new", "tangents", "tangent", || {
            GivenBound::new(tangents, vec![0.1], vec![[0.3; 2]])
        });
    }
    t.refuses("contact::GivenBound::new", "another length", "", || {
        GivenBound::new(1, vec![0.1], vec![])
    });
    t.refuses(
        "contact::CondensedContact::new",
        "a law in space",
        "tangent",
        || {
            let space = OrthotropicCoulomb::isotropic(FrictionCoefficient::uniform(constant()));
            CondensedContact::new(body(), space).map(drop)
        },
    );
    t.refuses("contact::FullContact::new", "a law in space", "tangent", || {
        let space = OrthotropicCoulomb::isotropic(FrictionCoefficient::uniform(constant()));
        FullContact::new(body(), space).map(drop)
    });
    t.refuses("contact::Contact::with_law", "a law in space", "tangent", || {
        let space = OrthotropicCoulomb::isotropic(FrictionCoefficient::uniform(constant()));
        condensed().with_law(space).map(drop)
    });
    t.survives("contact::Contact::with_law", "bounds of other nodes", || {
        let bound = GivenBound::new(1, vec![0.1; 5], vec![[0.3; 2]; 5]).unwrap();
        condensed().with_law(bound).and_then(|c| c.solve(0.0, None))
    });
    for bad in BAD.into_iter().chain([-1.0, 1e300]) {
        t.survives(
            "contact::Contact::solve",
            "a coefficient that is no number",
            || {
                let law = PlanarCoulomb::new(FrictionCoefficient::function(move |_, _, _| [bad, 0.0, 0.0]));
                CondensedContact::new(body(), law).and_then(|c| c.solve(0.0, None))
            },
        );
    }
}
