use std::ops::ControlFlow;
use std::time::Duration;

use semismooth::contact::{
    ContactOptions, EvolutionOptions, FixedPointOptions, evolve, fixed_point_observed,
};
use semismooth::continuation::ContinuationOptions;
use semismooth::newton::NewtonOptions;

use super::{condensed, full};
use crate::table::Table;

/// Options of searches at fixed α.
pub(super) fn searches(t: &mut Table) {
    let o = ContactOptions::default;
    let no_newton = o().with_newton(NewtonOptions::default().with_max_iterations(0));
    let wrong = [
        ("no iterations", "max_iterations", no_newton),
        ("no points", "max_points", o().with_max_points(0)),
        ("no nodes", "max_nodes", o().with_max_nodes(0)),
    ];
    let start = condensed().solve(0.0, None).unwrap();
    for (case, name, bad) in &wrong {
        let bad = || bad.clone();
        t.refuses("contact::ContactOptions::validate", case, name, || {
            bad().validate()
        });
        t.refuses("contact::Contact::solve_observed", case, name, || {
            condensed().solve_observed(0.0, None, &bad(), |_| ControlFlow::Continue(()))
        });
        t.refuses("contact::Contact::solve_observed", case, name, || {
            full().solve_observed(0.0, None, &bad(), |_| ControlFlow::Continue(()))
        });
        let evolution = || EvolutionOptions::default().with_contact(bad());
        t.refuses("contact::EvolutionOptions::validate", case, name, || {
            evolution().validate()
        });
        t.refuses("contact::evolve", case, name, || {
            evolve(&mut condensed(), &start, &[0.1], &evolution(), |_| {
                ControlFlow::Continue(())
            })
        });
        let inner = || FixedPointOptions::default().with_contact(bad());
        t.refuses("contact::fixed_point_observed", case, name, || {
            fixed_point_observed(&condensed(), &start, &inner(), |_| ControlFlow::Continue(()))
        });
    }
    t.refuses(
        "contact::EvolutionOptions::validate",
        "a step of 0",
        "step",
        || {
            let none = ContinuationOptions::default().with_step(0.0);
            EvolutionOptions::default().with_continuation(none).validate()
        },
    );
    let most = o()
        .with_max_increments(usize::MAX)
        .with_max_paths(usize::MAX)
        .with_max_points(usize::MAX)
        .with_max_branchings(usize::MAX)
        .with_max_nodes(u64::MAX)
        .with_max_time(Some(Duration::MAX));
    let none = o()
        .with_max_increments(0)
        .with_max_paths(0)
        .with_max_branchings(0)
        .with_max_time(Some(Duration::ZERO));
    for options in [most, none] {
        t.survives("contact::Contact::solve_observed", "absurd limits", || {
            condensed().solve_observed(0.0, None, &options, |_| ControlFlow::Continue(()))
        });
        t.survives("contact::Contact::solve_observed", "absurd limits", || {
            full().solve_observed(0.0, None, &options, |_| ControlFlow::Continue(()))
        });
    }
}
