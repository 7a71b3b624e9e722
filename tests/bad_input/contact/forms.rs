use std::ops::ControlFlow;

use semismooth::contact::{
    ContactProblem, EvolutionOptions, FixedPointOptions, evolve, evolve_observed, fixed_point,
};
use semismooth::piecewise::PiecewiseSmooth;

use super::{condensed, full};
use crate::table::{BAD, NOT_POSITIVE, Table};

pub(super) fn contacts(t: &mut Table) {
    let (c, f) = (condensed(), full());
    let (m, n) = (c.num_vars(), f.num_vars());
    for len in [0, 1, n + 3] {
        let x = vec![0.5; len];
        t.refuses("interface::Interface::traces", "x of another length", "", || {
            c.traces(&x)
        });
        t.refuses(
            "contact::Contact::displacements",
            "x of another length",
            "",
            || c.displacements(&x),
        );
        t.refuses("contact::Contact::solution", "x of another length", "", || {
            c.solution(&x)
        });
        t.refuses(
            "contact::Contact::solve",
            "a start of another length",
            "start",
            || c.solve(0.0, Some(&x)),
        );
        t.refuses(
            "contact::ContactProblem::solve",
            "a start of another problem",
            "start",
            || {
                let mut problem = ContactProblem::Condensed(Box::new(condensed()));
                let mut start = problem.solve(0.0, None)?;
                start.forces.resize(len, 0.5);
                problem.solve(0.0, Some(&start))
            },
        );
        t.refuses(
            "contact::CondensedContact::point_of_reactions",
            "reactions of another length",
            "",
            || c.point_of_reactions(0.0, &x),
        );
        t.refuses(
            "interface::Interface::restrict",
            "x of another length",
            "",
            || f.restrict(&x),
        );
        t.refuses("contact::Contact::solution", "x of another length", "", || {
            f.solution(&x)
        });
        t.refuses(
            "contact::Contact::solve",
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
            "contact::Contact::set_reference_slip",
            "another length",
            "slip",
            || condensed().set_reference_slip(&vec![0.0; len]),
        );
        t.refuses(
            "contact::Contact::set_reference_slip",
            "another length",
            "slip",
            || full().set_reference_slip(&vec![0.0; len]),
        );
    }
    for len in [1, 2, 5] {
        t.refuses(
            "contact::Contact::set_history",
            "another length",
            "history",
            || condensed().set_history(&vec![0.0; len]),
        );
    }
    for len in [0, 1, n + 3] {
        let x = vec![0.5; len];
        t.refuses("contact::Contact::end_level", "x of another length", "x", || {
            condensed().end_level(&x)
        });
        t.refuses(
            "contact::Contact::support_displacements",
            "x of another length",
            "x",
            || c.support_displacements(&x),
        );
    }
    let start = c.solve(0.0, None).unwrap();
    for bad in BAD {
        let x = vec![bad; m];
        t.refuses("interface::Interface::traces", "x", "[0]", || c.traces(&x));
        t.refuses("contact::Contact::displacements", "x", "[0]", || {
            c.displacements(&x)
        });
        t.refuses("contact::Contact::solution", "x", "[0]", || c.solution(&x));
        t.refuses("contact::Contact::solve", "the start", "[0]", || {
            c.solve(0.0, Some(&x))
        });
        t.refuses("contact::Contact::solve", "alpha", "", || c.solve(bad, None));
        t.refuses("contact::Contact::stick_start", "alpha", "", || {
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
        t.refuses("contact::CondensedContact::free_motion", "alpha", "[0]", || {
            c.free_motion(bad)
        });
        t.refuses("contact::Contact::set_reference_slip", "slip", "slip", || {
            condensed().set_reference_slip(&[bad])
        });
        t.refuses("contact::Contact::set_reference_slip", "slip", "slip", || {
            full().set_reference_slip(&[bad])
        });
        t.refuses("interface::Interface::restrict", "x", "[0]", || {
            f.restrict(&vec![bad; n])
        });
        t.refuses("contact::Contact::solution", "x", "[0]", || {
            f.solution(&vec![bad; n])
        });
        t.refuses("contact::Contact::solve", "the start", "[0]", || {
            f.solve(0.0, Some(&vec![bad; n]))
        });
        t.refuses("contact::Contact::solve", "alpha", "", || f.solve(bad, None));
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
    for bad in BAD {
        t.refuses("contact::evolve_observed", "a level", "[0]", || {
            evolve_observed(
                &mut condensed(),
                &start,
                &[bad],
                &EvolutionOptions::default(),
                |_| ControlFlow::Break(()),
            )
        });
    }
    t.survives("contact::evolve_observed", "stopped at once", || {
        evolve_observed(
            &mut condensed(),
            &start,
            &[0.1],
            &EvolutionOptions::default(),
            |_| ControlFlow::Break(()),
        )
    });
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
        t.survives("contact::Contact::solve", "huge alpha", || c.solve(size, None));
        t.survives("contact::Contact::solve", "huge alpha", || f.solve(-size, None));
        t.survives("contact::Contact::solution", "huge x", || {
            c.solution(&vec![size; m])
        });
        t.survives("contact::Contact::displacements", "huge x", || {
            c.displacements(&vec![-size; m])
        });
        t.survives("contact::Contact::solution", "huge x", || {
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
