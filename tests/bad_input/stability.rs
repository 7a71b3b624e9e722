use std::ops::ControlFlow;

use semismooth::continuation::{ContinuationOptions, Direction};
use semismooth::piecewise::{MinMap, PiecewiseSmooth, Selection};
use semismooth::stability::Dynamics;

use super::table::{BAD, Table};

/// y′ = min(α − y, 9).
fn map() -> impl PiecewiseSmooth + Sync {
    MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a[0] = x[1] - x[0];
        b[0] = 9.0;
    })
}

#[test]
fn stability() {
    let mut t = Table::new("stability");
    let (map, options) = (map(), ContinuationOptions::default);
    let dynamics = || Dynamics::new(&map);
    let sites = Selection::uniform(1, 0);
    for bad in BAD {
        t.refuses(
            "stability::Dynamics::with_mass",
            "an entry",
            "diagonal of M[0]",
            || dynamics().with_mass(vec![bad]),
        );
        t.refuses("stability::Dynamics::spectrum", "x", "x[1]", || {
            dynamics().spectrum(&[0.0, bad])
        });
        t.refuses("stability::Dynamics::spectrum_in", "x", "x[0]", || {
            dynamics().spectrum_in(&sites, &[bad, 0.0])
        });
        t.refuses("stability::Dynamics::nearest", "the shift", "shift", || {
            dynamics().nearest(&[0.0; 2], bad, 1)
        });
        t.refuses("stability::Dynamics::follow", "the start", "x[0]", || {
            dynamics().follow(&[bad, 0.0], Direction::Increasing, options())
        });
        t.refuses(
            "stability::Dynamics::follow_observed",
            "the start",
            "x[0]",
            || {
                dynamics().follow_observed(&[bad, 0.0], Direction::Increasing, options(), |_| {
                    ControlFlow::Continue(())
                })
            },
        );
    }
    t.refuses(
        "stability::Dynamics::with_mass",
        "zeros only",
        "different from 0",
        || dynamics().with_mass(vec![0.0]),
    );
    t.refuses("stability::Dynamics::with_mass", "a length", "length 2", || {
        dynamics().with_mass(vec![1.0; 2])
    });
    t.refuses("stability::Dynamics::spectrum", "a length", "length 1", || {
        dynamics().spectrum(&[0.0])
    });
    t.refuses(
        "stability::Dynamics::spectrum_in",
        "another selection",
        "sites",
        || dynamics().spectrum_in(&Selection::uniform(2, 0), &[0.0; 2]),
    );
    // The shift is the only eigenvalue.
    t.refuses(
        "stability::Dynamics::nearest",
        "a shift that is an eigenvalue",
        "singular",
        || dynamics().nearest(&[0.0; 2], -1.0, 1),
    );
    t.finish();
}
