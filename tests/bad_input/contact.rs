use std::ops::ControlFlow;
use std::path::Path;

use semismooth::contact::{
    CondensedContact, CondensedFriction, ContactBody, ContactState, EvolutionOptions, FixedPointOptions,
    FrictionCoefficient, FrictionCurve, FrictionFamily, FrictionMap, FrictionPath, FrictionProblem,
    FrictionStart, FullContact, GivenBound, HildRenard, LoadPath, OrthotropicCoulomb, PlanarCoulomb,
    UniquenessConstants, check_multipliers, critical_friction, evolve, first_point, fixed_point,
    friction_bounds, inf_sup_constant,
};
use semismooth::piecewise::{PiecewiseSmooth, Selection};
use semismooth::sparse::{Matrix, Pattern};

use super::table::{BAD, NOT_POSITIVE, Table, rows};

pub(crate) fn stiffness() -> Matrix {
    rows(&[&[2.0, -1.0], &[-1.0, 2.0]])
}

fn normal() -> Matrix {
    rows(&[&[1.0, 0.0]])
}

fn tangential() -> Matrix {
    rows(&[&[0.0, 1.0]])
}

fn load() -> LoadPath {
    LoadPath::affine(vec![1.5, 7.0], vec![1.0, 0.0])
}

pub(crate) fn problem() -> FrictionProblem {
    FrictionProblem::new(
        stiffness(),
        normal(),
        tangential(),
        load(),
        FrictionPath::constant(vec![0.3]),
    )
    .unwrap()
}

fn body() -> ContactBody {
    ContactBody::new(stiffness(), normal(), vec![tangential()], load()).unwrap()
}

fn law(f: f64) -> PlanarCoulomb {
    PlanarCoulomb::new(FrictionCoefficient::uniform(FrictionCurve::constant(f).unwrap()))
}

pub(crate) fn condensed() -> CondensedContact<PlanarCoulomb> {
    CondensedContact::new(body(), law(0.3)).unwrap()
}

pub(crate) fn full() -> FullContact<PlanarCoulomb> {
    FullContact::new(body(), law(0.3)).unwrap()
}

#[test]
fn friction() {
    let mut t = Table::new("contact");
    bodies(&mut t);
    laws(&mut t);
    planar_problems(&mut t);
    contacts(&mut t);
    measures(&mut t);
    super::searches::searches(&mut t);
    super::delassus::delassus(&mut t);
    t.exempt(&["contact::NodeLaw::check"], "asked by `solution` and `solve`");
    t.exempt(
        &[
            "contact::CondensedContact::solve_reported",
            "contact::FullContact::solve_reported",
        ],
        "called by `solve`",
    );
    t.finish();
}

fn bodies(t: &mut Table) {
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
        t.refuses("contact::CondensedContact::new", input, "", || {
            CondensedContact::new(body.clone(), law(0.3)).map(drop)
        });
        t.survives("contact::FullContact::solve", input, || {
            FullContact::new(body, law(0.3)).and_then(|c| c.solve(0.0, None))
        });
        let p = FrictionProblem::new(
            a,
            normal(),
            tangential(),
            load(),
            FrictionPath::constant(vec![0.3]),
        )
        .unwrap();
        t.refuses("contact::CondensedFriction::new", input, "", || {
            CondensedFriction::new(p).map(drop)
        });
    }
}

fn laws(t: &mut Table) {
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
    t.survives(
        "contact::CondensedContact::solve",
        "fewer curves than nodes",
        || {
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
        },
    );
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
    t.refuses(
        "contact::CondensedContact::with_law",
        "a law in space",
        "tangent",
        || {
            let space = OrthotropicCoulomb::isotropic(FrictionCoefficient::uniform(constant()));
            condensed().with_law(space).map(drop)
        },
    );
    t.survives(
        "contact::CondensedContact::with_law",
        "bounds of other nodes",
        || {
            let bound = GivenBound::new(1, vec![0.1; 5], vec![[0.3; 2]; 5]).unwrap();
            condensed().with_law(bound).and_then(|c| c.solve(0.0, None))
        },
    );
    for bad in BAD.into_iter().chain([-1.0, 1e300]) {
        t.survives(
            "contact::CondensedContact::solve",
            "a coefficient that is no number",
            || {
                let law = PlanarCoulomb::new(FrictionCoefficient::function(move |_, _, _| [bad, 0.0, 0.0]));
                CondensedContact::new(body(), law).and_then(|c| c.solve(0.0, None))
            },
        );
    }
}

fn planar_problems(t: &mut Table) {
    let new = "contact::FrictionProblem::new";
    let p = || FrictionPath::constant(vec![0.3]);
    t.refuses(new, "an oblong A", "A", || {
        FrictionProblem::new(normal(), normal(), tangential(), load(), p())
    });
    t.refuses(new, "Bnu", "", || {
        FrictionProblem::new(stiffness(), rows(&[&[1.0]]), tangential(), load(), p())
    });
    t.refuses(new, "Bt", "", || {
        FrictionProblem::new(stiffness(), normal(), rows(&[&[1.0]]), load(), p())
    });
    let with_r = "contact::FrictionProblem::with_r";
    for bad in BAD.into_iter().chain(NOT_POSITIVE) {
        t.refuses(with_r, "r", "r = ", || problem().with_r(bad));
        t.refuses("contact::CondensedContact::with_r", "r", "r = ", || {
            condensed().with_r(bad).map(drop)
        });
        t.refuses("contact::FullContact::with_r", "r", "r = ", || {
            full().with_r(bad).map(drop)
        });
        t.refuses("contact::HildRenard::new", "mu", "mu", || {
            HildRenard::new(1.0, 1.0, 1.0, bad)
        });
        t.refuses("contact::HildRenard::new", "lambda", "lambda", || {
            HildRenard::new(1.0, 1.0, bad, 1.0)
        });
    }
    for bad in BAD {
        t.refuses(new, "A", "(0, 0)", || {
            FrictionProblem::new(
                rows(&[&[bad, 0.0], &[0.0, 1.0]]),
                normal(),
                tangential(),
                load(),
                p(),
            )
        });
        t.refuses("contact::HildRenard::new", "a force", "not finite", || {
            HildRenard::new(bad, 1.0, 1.0, 1.0)
        });
        t.refuses("contact::FrictionProblem::with_gap", "the gap", "gap[0]", || {
            problem().with_gap(vec![bad])
        });
        t.refuses(
            "contact::FrictionProblem::with_friction",
            "friction",
            "[0]",
            || problem().with_friction(FrictionPath::constant(vec![bad])),
        );
        t.refuses("contact::FrictionProblem::with_load", "the load", "load", || {
            problem().with_load(LoadPath::constant(vec![bad, 0.0]))
        });
        t.refuses("contact::FrictionProblem::check_friction", "alpha", "", || {
            problem().check_friction(bad)
        });
        t.refuses("contact::first_point", "alpha", "", || {
            first_point(&problem(), bad, &FrictionStart::Zero)
        });
        t.refuses("contact::first_point", "the start", "", || {
            first_point(&problem(), 0.0, &FrictionStart::Point(vec![bad; 5]))
        });
        t.refuses("contact::FrictionFamily::new", "the load", "load", || {
            FrictionFamily::new(problem(), vec![bad, 0.0], vec![0.0])
        });
        t.refuses("contact::FrictionFamily::new", "the friction", "friction", || {
            FrictionFamily::new(problem(), vec![0.0; 2], vec![bad])
        });
        t.refuses("contact::CondensedFriction::expand", "x", "[0]", || {
            reduced().expand(&[bad, 0.0, 0.0])
        });
        t.refuses("contact::CondensedFriction::restrict", "x", "[0]", || {
            reduced().restrict(&[bad, 0.0, 0.0, 0.0, 0.0])
        });
        t.survives("contact::FrictionMap::solution", "x", || {
            (problem().solution(&[bad; 5]), reduced().solution(&[bad; 3]))
        });
        t.survives("contact::FrictionMap::displacements", "x", || {
            (
                problem().displacements(&[bad; 5]),
                reduced().displacements(&[bad; 3]),
            )
        });
        t.survives("contact::FrictionProblem::friction_at", "alpha", || {
            problem().friction_at(bad)
        });
        t.survives("contact::FrictionProblem::load_at", "alpha", || {
            problem().load_at(bad)
        });
    }
    t.refuses(
        "contact::FrictionProblem::with_gap",
        "another length",
        "gap",
        || problem().with_gap(vec![]),
    );
    t.refuses(
        "contact::FrictionProblem::with_friction",
        "another length",
        "friction",
        || problem().with_friction(FrictionPath::constant(vec![0.3; 2])),
    );
    t.refuses(
        "contact::FrictionProblem::with_load",
        "another length",
        "load",
        || problem().with_load(LoadPath::constant(vec![])),
    );
    t.refuses(
        "contact::FrictionProblem::load_derivative",
        "nothing but affine loads",
        "",
        || {
            let curved = LoadPath::function(|a, f, df| {
                f.fill(a * a);
                df.fill(2.0 * a);
            });
            CondensedFriction::new(problem().with_load(curved)?).map(drop)
        },
    );
    t.survives("contact::FrictionProblem::load_derivative", "any problem", || {
        problem().load_derivative()
    });
    t.refuses(
        "contact::FrictionProblem::check_friction",
        "negative friction",
        "friction",
        || {
            problem()
                .with_friction(FrictionPath::affine(vec![0.0], vec![1.0]))?
                .check_friction(-1.0)
        },
    );
    t.refuses("contact::first_point", "states of another length", "", || {
        first_point(
            &problem(),
            0.0,
            &FrictionStart::States(vec![ContactState::Open; 3]),
        )
    });
    for n in [0, 1, 4, 9] {
        let x = vec![0.5; n];
        t.refuses("contact::first_point", "a start of another length", "", || {
            first_point(&problem(), 0.0, &FrictionStart::Point(x.clone()))
        });
        t.refuses(
            "contact::FrictionFamily::new",
            "a load of another length",
            "load",
            || FrictionFamily::new(problem(), x.clone(), vec![0.0]),
        );
        t.refuses(
            "contact::CondensedFriction::expand",
            "x of another length",
            "",
            || reduced().expand(&x),
        );
        t.refuses(
            "contact::CondensedFriction::restrict",
            "x of another length",
            "",
            || reduced().restrict(&x),
        );
        t.refuses(
            "contact::FrictionMap::displacements",
            "x of another length",
            "",
            || problem().displacements(&x),
        );
        t.refuses(
            "contact::FrictionMap::displacements",
            "x of another length",
            "",
            || reduced().displacements(&x),
        );
        t.refuses(
            "contact::FrictionMap::solution",
            "x of another length",
            "",
            || problem().solution(&x),
        );
        t.refuses(
            "contact::FrictionMap::solution",
            "x of another length",
            "",
            || reduced().solution(&x),
        );
    }
    t.survives(
        "contact::FrictionMap::states",
        "a selection of another map",
        || {
            [
                Selection::default(),
                Selection::uniform(3, 0),
                Selection::uniform(1, 9),
            ]
            .map(|s| problem().states(&s))
        },
    );
    t.survives(
        "contact::FrictionMap::selection_of",
        "states of another length",
        || problem().selection_of(&[ContactState::Stick; 4]),
    );
    for size in [1e160, 1e300, f64::MAX] {
        t.survives("contact::first_point", "huge parameters", || {
            first_point(&problem(), size, &FrictionStart::Zero)
        });
        t.survives("contact::first_point", "huge starts", || {
            first_point(&problem(), 0.0, &FrictionStart::Point(vec![size; 5]))
        });
        t.survives("contact::HildRenard::problem", "huge moduli", || {
            HildRenard::new(size, size, size, size).and_then(|h| h.problem())
        });
        t.survives("contact::HildRenard::problem", "huge forces", || {
            HildRenard::new(size, -size, 1.0, 1.0)
                .map(|h| (h.branches(), h.solution(ContactState::Stick, f64::NAN)))
        });
    }
    let missing = Path::new("no/such/folder");
    #[cfg(feature = "json")]
    {
        t.refuses("contact::read_folder", "no folder", "no/such/folder", || {
            semismooth::contact::read_folder(missing)
        });
        // 16 GB of friction coefficients, for a trace that does not fit the body.
        let folder = std::env::temp_dir().join(format!("semismooth-rows-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let head = "%%MatrixMarket matrix coordinate real general\n";
        for (name, text) in [
            ("A.mtx", format!("{head}2 2 2\n1 1 1\n2 2 1\n")),
            ("Bnu.mtx", format!("{head}2147483648 1 0\n")),
            ("Bt.mtx", format!("{head}1 2 1\n1 2 1\n")),
            ("meta.json", "{\"friction\": 0.5}".to_owned()),
        ] {
            std::fs::write(folder.join(name), text).unwrap();
        }
        t.refuses(
            "contact::read_folder",
            "very many rows",
            "2147483648 rows",
            || semismooth::contact::read_folder(&folder),
        );
        std::fs::write(folder.join("Bnu.mtx"), format!("{head}10000000 1 0\n")).unwrap();
        t.refuses(
            "contact::read_folder",
            "a trace of another shape",
            "10000000 x 1",
            || semismooth::contact::read_folder(&folder),
        );
        std::fs::remove_dir_all(&folder).unwrap();
        t.refuses("contact::read_delassus", "no file", "no/such/folder", || {
            semismooth::contact::read_delassus(missing)
        });
    }
    let _ = missing;
}

fn reduced() -> CondensedFriction {
    CondensedFriction::new(problem()).unwrap()
}

fn contacts(t: &mut Table) {
    let (c, f) = (condensed(), full());
    let (m, n) = (c.num_vars(), f.num_vars());
    for len in [0, 1, n + 3] {
        let x = vec![0.5; len];
        t.refuses(
            "contact::CondensedContact::contact_displacements",
            "x of another length",
            "",
            || c.contact_displacements(&x),
        );
        t.refuses(
            "contact::CondensedContact::displacements",
            "x of another length",
            "",
            || c.displacements(&x),
        );
        t.refuses(
            "contact::CondensedContact::solution",
            "x of another length",
            "",
            || c.solution(&x),
        );
        t.refuses(
            "contact::CondensedContact::solve",
            "a start of another length",
            "start",
            || c.solve(0.0, Some(&x)),
        );
        t.refuses(
            "contact::CondensedContact::point_of_reactions",
            "reactions of another length",
            "",
            || c.point_of_reactions(0.0, &x),
        );
        t.refuses(
            "contact::FullContact::restrict",
            "x of another length",
            "",
            || f.restrict(&x),
        );
        t.refuses(
            "contact::FullContact::solution",
            "x of another length",
            "",
            || f.solution(&x),
        );
        t.refuses(
            "contact::FullContact::solve",
            "a start of another length",
            "start",
            || f.solve(0.0, Some(&x)),
        );
        t.refuses(
            "contact::fixed_point",
            "a start of another length",
            "solution x",
            || fixed_point(&c, &x, &FixedPointOptions::default()),
        );
        t.refuses(
            "contact::evolve",
            "a start of another length",
            "solution x",
            || {
                evolve(&mut condensed(), &x, &[0.1], &EvolutionOptions::default(), |_| {
                    ControlFlow::Continue(())
                })
            },
        );
    }
    for len in [0, 2, 5] {
        t.refuses(
            "contact::CondensedContact::set_reference_slip",
            "another length",
            "slip",
            || condensed().set_reference_slip(&vec![0.0; len]),
        );
        t.refuses(
            "contact::FullContact::set_reference_slip",
            "another length",
            "slip",
            || full().set_reference_slip(&vec![0.0; len]),
        );
    }
    let start = c.solve(0.0, None).unwrap();
    for bad in BAD {
        let x = vec![bad; m];
        t.refuses(
            "contact::CondensedContact::contact_displacements",
            "x",
            "[0]",
            || c.contact_displacements(&x),
        );
        t.refuses("contact::CondensedContact::displacements", "x", "[0]", || {
            c.displacements(&x)
        });
        t.refuses("contact::CondensedContact::solution", "x", "[0]", || {
            c.solution(&x)
        });
        t.refuses("contact::CondensedContact::solve", "the start", "[0]", || {
            c.solve(0.0, Some(&x))
        });
        t.refuses("contact::CondensedContact::solve", "alpha", "", || {
            c.solve(bad, None)
        });
        t.refuses("contact::CondensedContact::stick_start", "alpha", "", || {
            c.stick_start(bad)
        });
        t.refuses("contact::CondensedContact::delassus", "alpha", "", || {
            c.delassus(bad)
        });
        t.refuses(
            "contact::CondensedContact::point_of_reactions",
            "alpha",
            "",
            || c.point_of_reactions(bad, &[0.0; 2]),
        );
        t.refuses(
            "contact::CondensedContact::point_of_reactions",
            "reactions",
            "[0]",
            || c.point_of_reactions(0.0, &[bad; 2]),
        );
        t.survives("contact::CondensedContact::free_motion", "alpha", || {
            c.free_motion(bad)
        });
        t.refuses(
            "contact::CondensedContact::set_reference_slip",
            "slip",
            "slip",
            || condensed().set_reference_slip(&[bad]),
        );
        t.refuses("contact::FullContact::set_reference_slip", "slip", "slip", || {
            full().set_reference_slip(&[bad])
        });
        t.refuses("contact::FullContact::restrict", "x", "[0]", || {
            f.restrict(&vec![bad; n])
        });
        t.refuses("contact::FullContact::solution", "x", "[0]", || {
            f.solution(&vec![bad; n])
        });
        t.refuses("contact::FullContact::solve", "the start", "[0]", || {
            f.solve(0.0, Some(&vec![bad; n]))
        });
        t.refuses("contact::FullContact::solve", "alpha", "", || f.solve(bad, None));
        t.refuses("contact::fixed_point", "the start", "[0]", || {
            fixed_point(&c, &x, &FixedPointOptions::default())
        });
        t.refuses("contact::evolve", "the start", "[0]", || {
            evolve(&mut condensed(), &x, &[0.1], &EvolutionOptions::default(), |_| {
                ControlFlow::Continue(())
            })
        });
        t.refuses("contact::evolve", "a level", "[1]", || {
            evolve(
                &mut condensed(),
                &start,
                &[0.1, bad],
                &EvolutionOptions::default(),
                |_| ControlFlow::Continue(()),
            )
        });
    }
    t.survives("contact::evolve", "no levels", || {
        evolve(
            &mut condensed(),
            &start,
            &[],
            &EvolutionOptions::default(),
            |_| ControlFlow::Continue(()),
        )
    });
    let o = FixedPointOptions::default;
    for bad in BAD.into_iter().chain(NOT_POSITIVE) {
        t.refuses("contact::fixed_point", "relaxation", "relaxation", || {
            fixed_point(&c, &start, &o().with_relaxation(bad))
        });
        t.refuses(
            "contact::FixedPointOptions::validate",
            "relaxation",
            "relaxation",
            || o().with_relaxation(bad).validate(),
        );
    }
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        t.refuses("contact::fixed_point", "tolerance", "tolerance", || {
            fixed_point(&c, &start, &o().with_tolerance(bad))
        });
    }
    t.refuses(
        "contact::fixed_point",
        "a relaxation above 1",
        "relaxation",
        || fixed_point(&c, &start, &o().with_relaxation(1.5)),
    );
    for limit in [0, usize::MAX] {
        t.survives("contact::fixed_point", "absurd limits", || {
            fixed_point(&c, &start, &o().with_max_iterations(limit))
        });
    }
    for size in [1e160, 1e300, f64::MAX] {
        t.survives("contact::CondensedContact::solve", "huge alpha", || {
            c.solve(size, None)
        });
        t.survives("contact::FullContact::solve", "huge alpha", || {
            f.solve(-size, None)
        });
        t.survives("contact::CondensedContact::solution", "huge x", || {
            c.solution(&vec![size; m])
        });
        t.survives("contact::CondensedContact::displacements", "huge x", || {
            c.displacements(&vec![-size; m])
        });
        t.survives("contact::FullContact::solution", "huge x", || {
            f.solution(&vec![size; n])
        });
        t.survives("contact::evolve", "huge levels", || {
            evolve(
                &mut condensed(),
                &start,
                &[size],
                &EvolutionOptions::default(),
                |_| ControlFlow::Continue(()),
            )
        });
    }
}

fn measures(t: &mut Table) {
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
        "100000 multipliers, but the displacements tell only 1 of",
        || check_multipliers(&one_entry),
    );
    let large = Matrix::identity(LARGE);
    t.refuses(
        "contact::check_multipliers",
        "too many",
        "100000 x 100000",
        || check_multipliers(&large),
    );
    // A displacement that all nodes share makes the Gram matrix full, and tells nothing of their independence.
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
