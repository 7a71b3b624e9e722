use semismooth::enumeration::{EnumerationOptions, all_arms, all_solutions, all_solutions_until};

use super::piecewise::{no_numbers, square, vee};
use super::table::{BAD, Table};

#[test]
fn enumerations() {
    let mut t = Table::new("enumeration");
    let o = EnumerationOptions::default;
    for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        for (name, options) in [
            ("tolerance", o().with_tolerance(bad)),
            ("merge_distance", o().with_merge_distance(bad)),
        ] {
            t.refuses("enumeration::EnumerationOptions::validate", name, name, || {
                options.validate()
            });
            t.refuses("enumeration::all_solutions", name, name, || {
                all_solutions(&vee(), 1.0, &options)
            });
            t.refuses("enumeration::all_solutions_until", name, name, || {
                all_solutions_until(&vee(), 1.0, &options, &|| true)
            });
            t.refuses("enumeration::all_arms", name, name, || {
                all_arms(&vee(), &[0.5, 0.5], &options)
            });
        }
    }
    let none = o().with_max_nodes(0);
    t.refuses(
        "enumeration::EnumerationOptions::validate",
        "no nodes",
        "max_nodes",
        || none.validate(),
    );
    for limit in [1, u64::MAX] {
        t.survives("enumeration::all_solutions", "absurd limits", || {
            all_solutions(&vee(), 1.0, &o().with_max_nodes(limit))
        });
        t.survives("enumeration::all_arms", "absurd limits", || {
            all_arms(&vee(), &[0.0, 0.0], &o().with_max_nodes(limit))
        });
    }
    t.survives("enumeration::all_arms", "no local starts", || {
        all_arms(&vee(), &[0.0, 0.0], &o().with_local_starts(0))
    });
    for bad in BAD {
        t.refuses("enumeration::all_solutions", "the parameter", "", || {
            all_solutions(&vee(), bad, &o())
        });
        t.refuses("enumeration::all_solutions_until", "the parameter", "", || {
            all_solutions_until(&vee(), bad, &o(), &|| true)
        });
        t.refuses("enumeration::all_arms", "x", "[0]", || {
            all_arms(&vee(), &[bad, 0.0], &o())
        });
        t.refuses(
            "enumeration::all_solutions",
            "a residual that is no number",
            "",
            || all_solutions(&no_numbers(bad), 1.0, &o()),
        );
        t.survives("enumeration::all_arms", "a residual that is no number", || {
            all_arms(&no_numbers(bad), &[0.0, 0.0], &o())
        });
    }
    for x in [vec![], vec![0.5], vec![0.5; 3]] {
        t.refuses("enumeration::all_arms", "x of another length", "x", || {
            all_arms(&vee(), &x, &o())
        });
    }
    t.refuses("enumeration::all_arms", "an equation", "variables", || {
        all_arms(&square(1), &[0.5], &o())
    });
    t.survives("enumeration::all_solutions", "an empty map", || {
        all_solutions(&square(0), 0.0, &o())
    });
    for huge in [1e160, 1e300, f64::MAX] {
        t.survives("enumeration::all_solutions", "huge parameters", || {
            all_solutions(&vee(), huge, &o())
        });
        t.survives("enumeration::all_arms", "huge x", || {
            all_arms(&vee(), &[huge, huge], &o())
        });
    }
    t.finish();
}
