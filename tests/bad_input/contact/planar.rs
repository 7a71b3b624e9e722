use std::path::Path;

use semismooth::contact::{
    CondensedContact, ContactState, FrictionCoefficient, FrictionCurve, FullContact, HildRenard, LoadCase,
    LoadPath, MultiplierCoulomb, PlanarCoulomb,
};
use semismooth::piecewise::Selection;

use super::{condensed, full, law, load, normal, problem, stiffness, tangential};
use crate::table::{BAD, NOT_POSITIVE, Table, rows};

fn reduced() -> CondensedContact<PlanarCoulomb> {
    problem().condensed().unwrap()
}

pub(super) fn planar_problems(t: &mut Table) {
    let new = "contact::FullContact::planar";
    let p = || FrictionCoefficient::nodal(vec![0.3]).unwrap();
    t.refuses(new, "an oblong A", "A", || {
        FullContact::planar(normal(), normal(), tangential(), load(), p())
    });
    t.refuses(new, "Bnu", "", || {
        FullContact::planar(stiffness(), rows(&[&[1.0]]), tangential(), load(), p())
    });
    t.refuses(new, "Bt", "", || {
        FullContact::planar(stiffness(), normal(), rows(&[&[1.0]]), load(), p())
    });
    let with_r = "contact::Contact::with_r";
    for bad in BAD.into_iter().chain(NOT_POSITIVE) {
        t.refuses(with_r, "r", "r = ", || problem().with_r(bad));
        t.refuses("contact::Contact::with_r", "r", "r = ", || {
            condensed().with_r(bad).map(drop)
        });
        t.refuses("contact::Contact::with_r", "r", "r = ", || {
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
            FullContact::planar(
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
        t.refuses("contact::FullContact::with_gap", "the gap", "gap[0]", || {
            problem().with_gap(vec![bad])
        });
        t.refuses("contact::FrictionCoefficient::nodal", "friction", "[0]", || {
            FrictionCoefficient::nodal(vec![bad])
        });
        t.refuses("contact::FrictionCoefficient::affine", "friction", "[0]", || {
            FrictionCoefficient::affine(vec![0.0], vec![bad])
        });
        t.refuses(
            "contact::FrictionCoefficient::with_second",
            "friction",
            "[0]",
            || p().with_second(vec![bad]),
        );
        t.refuses("contact::FrictionCoefficient::constant", "friction", "", || {
            FrictionCoefficient::constant(bad)
        });
        t.refuses("contact::FullContact::with_load", "the load", "load", || {
            problem().with_load(LoadPath::constant(vec![bad, 0.0]))
        });

        t.refuses("contact::Contact::solve", "alpha", "", || {
            problem().solve(bad, None)
        });
        t.refuses("contact::Contact::solve", "the start", "", || {
            problem().solve(0.0, Some(&[bad; 5]))
        });
        t.refuses(
            "contact::Contact::with_second_parameter",
            "the load",
            "load",
            || problem().with_second_parameter(vec![bad, 0.0], law(0.3)),
        );

        t.refuses("interface::Interface::expand", "x", "[0]", || {
            reduced().expand(&[bad, 0.0, 0.0])
        });
        t.refuses("interface::Interface::restrict", "x", "[0]", || {
            reduced().restrict(&[bad, 0.0, 0.0, 0.0, 0.0])
        });
        t.survives("contact::Contact::solution", "x", || {
            (problem().solution(&[bad; 5]), reduced().solution(&[bad; 3]))
        });
        t.survives("contact::Contact::displacements", "x", || {
            (
                problem().displacements(&[bad; 5]),
                reduced().displacements(&[bad; 3]),
            )
        });
        t.survives("contact::FullContact::friction_at", "alpha", || {
            problem().friction_at(bad)
        });
        t.refuses("interface::Interface::load_at", "alpha", "[0]", || {
            problem().load_at(&[bad])
        });
    }
    t.refuses("contact::FullContact::with_gap", "another length", "gap", || {
        problem().with_gap(vec![])
    });
    t.refuses("contact::Contact::with_law", "another length", "friction", || {
        problem().with_law(PlanarCoulomb::new(
            FrictionCoefficient::nodal(vec![0.3; 2]).unwrap(),
        ))
    });
    t.refuses(
        "contact::FullContact::with_load",
        "another length",
        "load",
        || problem().with_load(LoadPath::constant(vec![])),
    );

    t.survives("contact::Contact::load_derivative", "any problem", || {
        problem().load_derivative()
    });
    t.refuses("contact::Contact::solve", "negative friction", "friction", || {
        let friction = FrictionCoefficient::affine(vec![0.0], vec![1.0]).unwrap();
        problem()
            .with_law(PlanarCoulomb::new(friction))?
            .solve(-1.0, None)
    });
    t.refuses(
        "contact::MultiplierCoulomb::new",
        "friction that depends on the slip",
        "slip",
        || {
            let curve = FrictionCurve::exponential(0.5, 0.3, 0.1).unwrap();
            MultiplierCoulomb::new(FrictionCoefficient::uniform(curve))
        },
    );
    t.refuses("contact::Contact::solve", "states of another length", "", || {
        problem().solve_from_states(0.0, &[ContactState::Open; 3])
    });
    for n in [0, 1, 4, 9] {
        let x = vec![0.5; n];
        t.refuses("contact::Contact::solve", "a start of another length", "", || {
            problem().solve(0.0, Some(&x.clone()))
        });
        t.refuses(
            "contact::Contact::with_second_parameter",
            "a load of another length",
            "load",
            || problem().with_second_parameter(x.clone(), law(0.3)),
        );
        t.refuses("interface::Interface::expand", "x of another length", "", || {
            reduced().expand(&x)
        });
        t.refuses(
            "interface::Interface::restrict",
            "x of another length",
            "",
            || reduced().restrict(&x),
        );
        t.refuses(
            "contact::Contact::displacements",
            "x of another length",
            "",
            || problem().displacements(&x),
        );
        t.refuses(
            "contact::Contact::displacements",
            "x of another length",
            "",
            || reduced().displacements(&x),
        );
        t.refuses("contact::Contact::solution", "x of another length", "", || {
            problem().solution(&x)
        });
        t.refuses("contact::Contact::solution", "x of another length", "", || {
            reduced().solution(&x)
        });
    }
    t.refuses(
        "contact::Contact::start_with",
        "states of another length",
        "states",
        || problem().start_with(0.0, &[]),
    );
    t.refuses(
        "contact::Contact::solve_from_states",
        "states of another length",
        "states",
        || problem().solve_from_states(0.0, &[ContactState::Stick; 2]),
    );
    let case = || LoadCase::from(vec![0.0; 2]);
    t.refuses(
        "contact::LoadCase::plus",
        "a case of another length",
        "load",
        || case().plus(vec![0.0; 3]),
    );
    t.refuses(
        "contact::LoadCase::of_supports",
        "reactions of another length",
        "reactions",
        || LoadCase::of_supports(vec![0.0; 2], vec![0.0; 2], vec![0.0; 3]),
    );
    t.survives("contact::Contact::states", "a selection of another map", || {
        [
            Selection::default(),
            Selection::uniform(3, 0),
            Selection::uniform(1, 9),
        ]
        .map(|s| problem().states(&s))
    });
    t.survives(
        "contact::Contact::selection_of",
        "states of another length",
        || problem().selection_of(&[ContactState::Stick; 4]),
    );
    for size in [1e160, 1e300, f64::MAX] {
        t.survives("contact::Contact::solve", "huge parameters", || {
            problem().solve(size, None)
        });
        t.survives("contact::Contact::solve", "huge starts", || {
            problem().solve(0.0, Some(&[size; 5]))
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
        // 16 GB of friction coefficients, for a trace of the wrong size.
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
            "rows without an entry",
            "10000000 rows",
            || semismooth::contact::read_folder(&folder),
        );
        std::fs::remove_dir_all(&folder).unwrap();
        t.refuses("contact::read_delassus", "no file", "no/such/folder", || {
            semismooth::contact::read_delassus(missing)
        });
    }
    let _ = missing;
}
