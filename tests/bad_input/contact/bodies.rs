use semismooth::contact::{
    CondensedContact, ContactBody, FrictionCoefficient, FullContact, GivenBound, LoadPath,
    UniquenessConstants, check_multipliers, critical_friction, friction_bounds, friction_derivative,
    inf_sup_constant, pressure_norm,
};
use semismooth::piecewise::Selection;
use semismooth::sparse::{Matrix, Pattern};

use super::{body, condensed, law, load, normal, stiffness, tangential};
use crate::table::{BAD, NOT_POSITIVE, Table, rows};

pub(super) fn bodies(t: &mut Table) {
    let new = "contact::ContactBody::new";
    let with = |a: Matrix, n: Matrix, b: Vec<Matrix>| ContactBody::new(a, n, b, load());
    let none = |m, n| Matrix::zeros(Pattern::full(m, n));
    t.refuses(new, "no displacements", "empty", || {
        with(none(0, 0), none(0, 0), vec![none(0, 0)])
    });
    t.refuses(new, "no contacts", "", || {
        with(stiffness(), none(0, 2), vec![none(0, 2)])
    });
    t.refuses(new, "an oblong A", "A", || {
        with(normal(), normal(), vec![tangential()])
    });
    t.refuses(new, "normal rows of another width", "", || {
        with(stiffness(), rows(&[&[1.0]]), vec![tangential()])
    });
    t.refuses(new, "tangential rows of another width", "", || {
        with(stiffness(), normal(), vec![rows(&[&[1.0]])])
    });
    t.refuses(new, "too many tangents", "", || {
        with(stiffness(), normal(), vec![tangential(); 3])
    });
    t.refuses(new, "no tangents", "", || with(stiffness(), normal(), vec![]));
    for bad in BAD {
        t.refuses(new, "A", "(0, 0)", || {
            with(rows(&[&[bad, 0.0], &[0.0, 1.0]]), normal(), vec![tangential()])
        });
        t.refuses(new, "normal rows", "(0, 0)", || {
            with(stiffness(), rows(&[&[bad, 0.0]]), vec![tangential()])
        });
        t.refuses(new, "tangential rows", "(0, 1)", || {
            with(stiffness(), normal(), vec![rows(&[&[0.0, bad]])])
        });
        t.refuses(new, "the load", "load", || {
            ContactBody::new(
                stiffness(),
                normal(),
                vec![tangential()],
                LoadPath::constant(vec![bad, 0.0]),
            )
        });
        t.refuses("contact::ContactBody::with_gap", "the gap", "gap[0]", || {
            body().with_gap(vec![bad])
        });
        t.refuses("contact::ContactBody::with_load", "the load", "[0]", || {
            body().with_load(LoadPath::constant(vec![bad, 0.0]))
        });
        t.survives("contact::ContactBody::load_at", "alpha", || body().load_at(bad));
    }
    for n in [0, 1, 3] {
        t.refuses(new, "a load of another length", "load", || {
            ContactBody::new(
                stiffness(),
                normal(),
                vec![tangential()],
                LoadPath::constant(vec![1.0; n]),
            )
        });
    }
    let exported = "contact::ContactBody::exported";
    let given = |a: Matrix, n: Matrix, b: Vec<Matrix>| ContactBody::exported(a, n, b, load());
    t.refuses(exported, "an oblong A", "A", || {
        given(normal(), normal(), vec![tangential()])
    });
    t.refuses(exported, "no tangent", "tangential", || {
        given(stiffness(), normal(), vec![])
    });
    for bad in BAD {
        t.refuses(exported, "A", "stiffness", || {
            given(rows(&[&[bad, 0.0], &[0.0, 2.0]]), normal(), vec![tangential()])
        });
    }
    let nodes = "contact::ContactBody::with_nodes";
    let at = |x: f64, places: &[[usize; 2]]| body().with_nodes(vec![[x, 0.0, 0.0]], places);
    t.refuses(nodes, "a displacement too few", "nodes of displacements", || {
        at(0.0, &[[0, 0]])
    });
    t.refuses(nodes, "a node that does not exist", "node 1", || {
        at(0.0, &[[0, 0], [1, 0]])
    });
    t.refuses(nodes, "a component of space", "component 2", || {
        at(0.0, &[[0, 0], [0, 2]])
    });
    t.refuses(nodes, "a component twice", "two unknowns", || {
        at(0.0, &[[0, 1], [0, 1]])
    });
    t.refuses(nodes, "a position", "not finite", || {
        at(f64::NAN, &[[0, 0], [0, 1]])
    });
    t.refuses("contact::ContactBody::with_gap", "another length", "gap", || {
        body().with_gap(vec![])
    });
    // A, B and loads of any size.
    for size in [1e-320, 1e-300, 1e160, 1e300, f64::MAX] {
        t.survives("contact::CondensedContact::new", "sizes", || {
            let a = rows(&[&[size, 0.0], &[0.0, size]]);
            let body =
                ContactBody::new(a, normal(), vec![tangential()], LoadPath::constant(vec![size; 2])).unwrap();
            let full = FullContact::new(body.clone(), law(0.3)).and_then(|c| c.solve(0.0, None));
            let condensed = CondensedContact::new(body, law(0.3)).and_then(|c| c.solve(0.0, None));
            (full, condensed)
        });
    }
    for (input, a) in [
        ("singular", rows(&[&[1.0, -1.0], &[-1.0, 1.0]])),
        ("indefinite", rows(&[&[1.0, 2.0], &[2.0, 1.0]])),
        ("zero", rows(&[&[0.0, 0.0], &[0.0, 0.0]])),
    ] {
        let body = ContactBody::new(a.clone(), normal(), vec![tangential()], load()).unwrap();
        let condensed = || CondensedContact::new(body.clone(), law(0.3));
        if input == "singular" {
            // Contact may hold it.
            t.survives("contact::CondensedContact::new", input, || {
                condensed().and_then(|c| c.solve(0.0, None))
            });
        } else {
            t.refuses("contact::CondensedContact::new", input, "", || {
                condensed().map(drop)
            });
        }
        t.survives("contact::Contact::solve", input, || {
            FullContact::new(body, law(0.3)).and_then(|c| c.solve(0.0, None))
        });
        let p = FullContact::planar(
            a,
            normal(),
            tangential(),
            load(),
            FrictionCoefficient::nodal(vec![0.3]).unwrap(),
        )
        .unwrap();
        t.refuses("contact::CondensedContact<PlanarCoulomb>::new", input, "", || {
            p.condensed().map(drop)
        });
    }
}

pub(super) fn measures(t: &mut Table) {
    let c = condensed();
    for bad in BAD.into_iter().chain(NOT_POSITIVE) {
        t.refuses("contact::friction_bounds", "the largest slip", "slip", || {
            friction_bounds(&c, 0.0, bad, 10)
        });
        t.refuses("contact::UniquenessConstants::new", "an area", "", || {
            UniquenessConstants::new(&c, &[bad])
        });
    }
    for bad in BAD {
        t.survives("contact::friction_bounds", "alpha", || {
            friction_bounds(&c, bad, 1.0, 10)
        });
    }
    for bad in BAD {
        t.refuses("contact::pressure_norm", "a force", "force", || {
            pressure_norm(&[1.0], &[bad])
        });
        t.refuses("contact::pressure_norm", "an area", "area", || {
            pressure_norm(&[bad], &[1.0])
        });
        t.refuses("contact::friction_derivative", "x", "x", || {
            friction_derivative(&c, &Selection::uniform(1, 0), &[bad; 3])
        });
    }
    t.refuses("contact::pressure_norm", "areas of another length", "", || {
        pressure_norm(&[1.0, 1.0], &[1.0])
    });
    t.refuses(
        "contact::friction_derivative",
        "another selection",
        "selection",
        || friction_derivative(&c, &Selection::uniform(2, 0), &[0.0; 3]),
    );
    for samples in [0, 1] {
        t.refuses("contact::friction_bounds", "too few samples", "samples", || {
            friction_bounds(&c, 0.0, 1.0, samples)
        });
    }
    for n in [0, 2] {
        t.refuses(
            "contact::UniquenessConstants::new",
            "areas of another length",
            "area",
            || UniquenessConstants::new(&c, &vec![1.0; n]),
        );
    }
    t.survives("contact::critical_friction", "another law", || {
        let given = condensed().with_law(GivenBound::new(1, vec![0.1], vec![[0.3; 2]]).unwrap())?;
        critical_friction(&given)
    });
    let q = rows(&[&[1.0, 0.0]]);
    t.refuses(
        "contact::check_multipliers",
        "a multiplier that is not seen",
        "",
        || check_multipliers(&rows(&[&[0.0, 0.0]])),
    );
    const LARGE: usize = 100_000;
    let one_entry = Matrix::from_triplets(LARGE, 3, &[(5, 1, 2.0)]).unwrap();
    t.refuses(
        "contact::check_multipliers",
        "many multipliers that are not seen",
        "100000 multipliers, but their pairing with the displacements has rank 1 only",
        || check_multipliers(&one_entry),
    );
    let large = Matrix::identity(LARGE);
    t.refuses(
        "contact::check_multipliers",
        "too many",
        "100000 x 100000",
        || check_multipliers(&large),
    );
    // A displacement in all traces makes the Gram matrix full, which says nothing about their linear independence.
    let shared: Vec<_> = (0..30_000)
        .flat_map(|i| [(i, i, 1.0), (i, 30_000, 1.0)])
        .collect();
    let shared = Matrix::from_triplets(30_000, 30_001, &shared).unwrap();
    t.survives(
        "contact::ContactBody::new",
        "a displacement that all nodes share",
        || {
            let load = LoadPath::constant(vec![0.0; 30_001]);
            let (a, bt) = (Matrix::identity(30_001), shared.clone());
            ContactBody::new(a, shared.clone(), vec![bt], load).unwrap()
        },
    );
    t.survives("contact::check_multipliers", "nothing", || {
        check_multipliers(&Matrix::zeros(Pattern::full(0, 0)))
    });
    let (k, one) = (stiffness(), rows(&[&[1.0]]));
    t.refuses("contact::inf_sup_constant", "another shape", "", || {
        inf_sup_constant((&k, &one), (&k, &q))
    });
    t.refuses(
        "contact::inf_sup_constant",
        "another number of multipliers",
        "",
        || inf_sup_constant((&k, &q), (&k, &k)),
    );
    t.refuses("contact::inf_sup_constant", "an indefinite metric", "", || {
        inf_sup_constant((&rows(&[&[1.0, 2.0], &[2.0, 1.0]]), &q), (&k, &q))
    });
    for bad in BAD {
        t.refuses("contact::check_multipliers", "no numbers", "", || {
            check_multipliers(&rows(&[&[bad, 0.0]]))
        });
        t.refuses("contact::inf_sup_constant", "no numbers", "", || {
            inf_sup_constant((&rows(&[&[bad, 0.0], &[0.0, 1.0]]), &q), (&k, &q))
        });
    }
}
