use std::path::Path;

use semismooth::contact::{
    CondensedFriction, ContactState, FrictionFamily, FrictionMap, FrictionPath, FrictionProblem,
    FrictionStart, HildRenard, LoadPath, first_point,
};
use semismooth::piecewise::Selection;

use super::{condensed, full, load, normal, problem, stiffness, tangential};
use crate::table::{BAD, NOT_POSITIVE, Table, rows};

fn reduced() -> CondensedFriction {
    CondensedFriction::new(problem()).unwrap()
}

pub(super) fn planar_problems(t: &mut Table) {
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
