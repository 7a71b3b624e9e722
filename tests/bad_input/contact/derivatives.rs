//! Derivatives of contact solutions.

use semismooth::contact::{
    ContactError, ContactParameters, FrictionCoefficient, Frictionless, PlanarCoulomb, ReducedBody,
    ReducedContact, ReducedOptions,
};
use semismooth::sensitivity::SensitivityError;
use semismooth::sparse::{Matrix, NodalMatrix};

use super::{condensed, full, law, load, normal, stiffness, tangential};
use crate::table::{BAD, Table, rows};

/// One load, all gaps.
fn parameters(of: ContactParameters) -> ContactParameters {
    let made = of.with_loads(&rows(&[&[1.0], &[0.0]])).unwrap();
    made.with_gaps(&Matrix::identity(1)).unwrap()
}

pub(super) fn derivatives(t: &mut Table) {
    let empty = || condensed().parameters();
    let with = |t: &mut Table, name: &str, columns: Matrix| {
        t.refuses("contact::ContactParameters::with_loads", name, "loads", || {
            empty().with_loads(&columns)
        });
        t.refuses("contact::ContactParameters::with_gaps", name, "gaps", || {
            empty().with_gaps(&columns)
        });
        t.refuses(
            "contact::ContactParameters::with_law",
            name,
            "second parameter",
            || empty().with_law(law(0.3), &columns),
        );
        t.refuses("contact::ContactParameters::with_body", name, "forces", || {
            empty().with_body(&columns, None)
        });
    };
    with(t, "too many rows", Matrix::identity(3));
    for bad in BAD {
        t.refuses(
            "contact::ContactParameters::with_loads",
            "an entry",
            "loads",
            || empty().with_loads(&rows(&[&[bad], &[0.0]])),
        );
        t.refuses(
            "contact::ContactParameters::with_body",
            "a trace",
            "traces",
            || empty().with_body(&Matrix::identity(2), Some(&rows(&[&[bad, 0.0], &[0.0, 0.0]]))),
        );
    }
    let body = "contact::ContactParameters::with_body";
    t.refuses(body, "fewer traces", "traces", || {
        empty().with_body(&Matrix::identity(2), Some(&rows(&[&[1.0], &[0.0]])))
    });
    let law_of = "contact::ContactParameters::with_law";
    t.refuses(law_of, "a law in space", "tangential", || {
        empty().with_law(Frictionless::space(), &Matrix::identity(1))
    });
    t.refuses(law_of, "two laws", "twice", || {
        let one = empty().with_law(law(0.3), &Matrix::identity(1)).unwrap();
        one.with_law(law(0.3), &Matrix::identity(1))
    });
    solutions(t);
    histories(t);
    reduced(t);
}

fn histories(t: &mut Table) {
    let new = "contact::Contact::history_sensitivity";
    let x = full().solve(0.0, None).unwrap();
    let chosen = || parameters(full().parameters());
    let found = || {
        full()
            .history_sensitivity(std::slice::from_ref(&x), &[chosen()])
            .unwrap()
    };
    t.refuses(new, "no states", "no states", || {
        full().history_sensitivity(&[], &[]).map(drop)
    });
    t.refuses(new, "a short state", "state", || {
        full()
            .history_sensitivity(&[x[1..].to_vec()], &[chosen()])
            .map(drop)
    });
    t.refuses(new, "no list for the second level", "levels", || {
        full()
            .history_sensitivity(&[x.clone(), x.clone()], &[chosen()])
            .map(drop)
    });
    t.refuses(new, "lists of two lengths", "levels", || {
        let lists = [chosen(), full().parameters()];
        full()
            .history_sensitivity(&[x.clone(), x.clone()], &lists)
            .map(drop)
    });
    for bad in BAD {
        t.refuses("contact::HistorySensitivity::jvp", "δ", "parameters[1]", || {
            found().jvp(&[0.0, bad])
        });
        t.refuses(
            "contact::HistorySensitivity::vjp",
            "w",
            "displacements[0]",
            || found().vjp(&[bad, 0.0], &[0.0; 2]),
        );
    }
    t.refuses(
        "contact::HistorySensitivity::differentiable",
        "no solution",
        "no solution",
        || {
            let states = [vec![9.0, 9.0, 9.0, 9.0, 0.0]];
            full()
                .history_sensitivity(&states, &[chosen()])
                .unwrap()
                .differentiable()
        },
    );
}

fn solutions(t: &mut Table) {
    let new = "contact::Contact::sensitivity";
    let x = full().solve(0.0, None).unwrap();
    let found = || full().sensitivity(&x, &parameters(full().parameters())).unwrap();
    t.refuses(new, "no parameters", "no parameters", || {
        full().sensitivity(&x, &full().parameters()).map(drop)
    });
    t.refuses(new, "a point of the other form", "length 3", || {
        full()
            .sensitivity(&x[2..], &parameters(full().parameters()))
            .map(drop)
    });
    t.refuses(new, "no solution", "no solution", || {
        full()
            .sensitivity(&[9.0, 9.0, 9.0, 9.0, 0.0], &parameters(full().parameters()))
            .map(drop)
    });
    t.refuses(new, "another law", "history", || {
        let worn = FrictionCoefficient::uniform(
            semismooth::contact::FrictionCurve::exponential(0.4, 0.2, 1.0).unwrap(),
        );
        let other = PlanarCoulomb::new(worn);
        let parameters = full().parameters().with_law(other, &Matrix::identity(1)).unwrap();
        full().sensitivity(&x, &parameters).map(drop)
    });
    t.refuses(new, "a load that is zero", "does not enter", || {
        let zero = Matrix::zeros(semismooth::sparse::Pattern::from_entries(2, 1, []).unwrap());
        let parameters = full().parameters().with_loads(&zero).unwrap();
        full().sensitivity(&x, &parameters).map(drop)
    });
    for bad in BAD {
        t.refuses(new, "x", "solution", || {
            let mut x = x.clone();
            x[0] = bad;
            full().sensitivity(&x, &parameters(full().parameters())).map(drop)
        });
        t.refuses("contact::ContactSensitivity::jvp", "δ", "parameters[1]", || {
            found().jvp(&[0.0, bad])
        });
        t.refuses(
            "contact::ContactSensitivity::directional",
            "δ",
            "parameters[0]",
            || found().directional(&[bad, 0.0]),
        );
        t.refuses(
            "contact::ContactSensitivity::vjp",
            "w",
            "displacements[0]",
            || found().vjp(&[bad, 0.0], &[0.0; 2]),
        );
        t.refuses(
            "contact::ContactSensitivity::valid_until",
            "δ",
            "parameters[0]",
            || found().valid_until(&[bad, 0.0], 1.0),
        );
    }
    t.refuses(
        "contact::ContactSensitivity::vjp",
        "few forces",
        "length 1",
        || found().vjp(&[0.0; 2], &[0.0]),
    );
    t.refuses(
        "contact::ContactSensitivity::valid_until",
        "a parameter of the body",
        "parameter 2 only to first order",
        || {
            let parameters = parameters(full().parameters());
            let parameters = parameters.with_body(&rows(&[&[1.0], &[0.0]]), None).unwrap();
            let mut found = full().sensitivity(&x, &parameters).unwrap();
            found.valid_until(&[0.0, 0.0, 1.0], 1.0)
        },
    );
    t.holds(
        "contact::ContactSensitivity::differentiable",
        "it is known",
        || found().differentiable().is_ok_and(|d| d.known() == Some(true)),
    );
    t.holds(
        "contact::ContactSensitivity::derivative",
        "rows and columns",
        || {
            found()
                .derivative()
                .is_ok_and(|d| (d.nrows(), d.ncols()) == (4, 2))
        },
    );
}

fn reduced(t: &mut Table) {
    let new = "contact::ReducedContact::sensitivity";
    let problem = || {
        let a = NodalMatrix::new(&stiffness(), vec![[0.0; 3]], &[[0, 0], [0, 1]], 2).unwrap();
        let body = ReducedBody::new(a, &normal(), &[tangential()], load()).unwrap();
        ReducedContact::new(body, law(0.3), ReducedOptions::default()).unwrap()
    };
    let u = problem().solve(0.0, None).unwrap().displacements;
    let chosen = || parameters(problem().parameters());
    t.refuses(new, "no parameters", "no parameters", || {
        let mut problem = problem();
        let none = problem.parameters();
        problem.sensitivity(0.0, &u, &none).map(drop)
    });
    t.refuses(new, "few displacements", "displacements", || {
        problem().sensitivity(0.0, &u[1..], &chosen()).map(drop)
    });
    for bad in BAD {
        t.refuses(new, "α", "parameter", || {
            problem().sensitivity(bad, &u, &chosen()).map(drop)
        });
        t.refuses(new, "u", "displacements", || {
            problem().sensitivity(0.0, &[bad, 0.0], &chosen()).map(drop)
        });
        t.refuses("contact::ReducedSensitivity::jvp", "δ", "parameters[0]", || {
            let mut problem = problem();
            problem.sensitivity(0.0, &u, &chosen()).unwrap().jvp(&[bad, 0.0])
        });
        t.refuses(
            "contact::ReducedSensitivity::directional",
            "δ",
            "parameters[1]",
            || {
                let mut problem = problem();
                let mut found = problem.sensitivity(0.0, &u, &chosen()).unwrap();
                found.directional(&[0.0, bad])
            },
        );
        t.refuses("contact::ReducedSensitivity::vjp", "w", "forces[1]", || {
            let mut problem = problem();
            let mut found = problem.sensitivity(0.0, &u, &chosen()).unwrap();
            found.vjp(&[0.0; 2], &[0.0, bad])
        });
    }
    t.refuses(new, "no solution", "no solution", || {
        problem()
            .sensitivity(0.0, &[u[0] + 0.5, u[1]], &chosen())
            .map(drop)
    });
    // Lifted off by exactly the gap.
    t.holds(
        "contact::ReducedSensitivity::jvp",
        "a kink has the derivatives of both sides",
        || {
            let a = NodalMatrix::new(&stiffness(), vec![[0.0; 3]], &[[0, 0], [0, 1]], 2).unwrap();
            let load = semismooth::contact::LoadPath::constant(vec![0.0; 2]);
            let body = ReducedBody::new(a, &normal(), &[tangential()], load).unwrap();
            let mut problem = ReducedContact::new(body, law(0.3), ReducedOptions::default()).unwrap();
            let parameters = parameters(problem.parameters());
            let mut found = problem.sensitivity(0.0, &[0.0; 2], &parameters).unwrap();
            let sides = [1.0, -1.0].map(|s| found.jvp(&[s, 0.0]).unwrap().forces[0]);
            let is_one = |at: f64| sides.iter().any(|force| (force - at).abs() < 1e-9);
            is_one(0.0) && is_one(1.0)
        },
    );
    t.holds(
        "contact::ReducedSensitivity::differentiable",
        "it is known away from kinks",
        || {
            let mut problem = problem();
            let found = problem.sensitivity(0.0, &u, &chosen());
            found.unwrap().differentiable().unwrap().known() == Some(true)
        },
    );
    t.holds(new, "an error has a message", || {
        !ContactError::from(SensitivityError::NotDifferentiable)
            .to_string()
            .is_empty()
    });
}
