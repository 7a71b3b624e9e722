use std::ops::ControlFlow;
use std::time::Duration;

use semismooth::contact::{FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb};
use semismooth::continuation::{
    Arm, BlackBoxCurve, Branch, Continuation, ContinuationOptions, Diagram, DiagramOptions, Direction,
    FoldSet, SearchOptions, TransitionSet, arms_at, certify, certify_with, list_solutions, search_solutions,
};
use semismooth::enumeration::EnumerationOptions;
use semismooth::linear::AutoSolver;
use semismooth::piecewise::{MinMap, PiecewiseSmooth, Selection};

use super::piecewise::{no_numbers, square, vee};
use super::table::{BAD, NOT_POSITIVE, Table, rows};

const ON: [f64; 2] = [0.5, 0.5];

fn o() -> ContinuationOptions {
    ContinuationOptions::default().with_parameter_range((-1.0, 1.0))
}

fn bad_options() -> Vec<(&'static str, ContinuationOptions)> {
    let mut all = vec![
        ("max_points", o().with_max_points(0)),
        ("max_nodes", o().with_max_nodes(0)),
        ("parameter_range", o().with_parameter_range((1.0, 1.0))),
        ("parameter_range", o().with_parameter_range((1.0, -1.0))),
        ("parameter_range", o().with_parameter_range((f64::NAN, 1.0))),
        ("targets", o().with_targets(vec![f64::NAN])),
        ("targets", o().with_targets(vec![f64::INFINITY])),
    ];
    let mut set = |name, f: &dyn Fn(&mut ContinuationOptions)| {
        let mut options = o();
        f(&mut options);
        all.push((name, options));
    };
    for bad in [f64::NAN, 0.0, -1.0] {
        set("step", &|o| o.step = bad);
        set("min_step", &|o| o.min_step = bad);
        set("max_step", &|o| o.max_step = bad);
        set("growth", &|o| o.growth = bad);
        set("shrink", &|o| o.shrink = bad);
        set("min_cos", &|o| o.min_cos = bad);
        set("residual_tolerance", &|o| o.residual_tolerance = bad);
        set("step_tolerance", &|o| o.step_tolerance = bad);
        set("vanishing_distance", &|o| o.vanishing_distance = bad);
        set("max_arclength", &|o| o.max_arclength = bad);
        set("max_growth", &|o| o.max_growth = bad);
    }
    set("max_corrections", &|o| o.max_corrections = 0);
    set("max_selections", &|o| o.max_selections = 0);
    all
}

/// A contact node with F = α + β under a load that grows with α.
fn family() -> FullContact<PlanarCoulomb> {
    let problem = FullContact::planar(
        rows(&[&[2.0, -1.0], &[-1.0, 2.0]]),
        rows(&[&[1.0, 0.0]]),
        rows(&[&[0.0, 1.0]]),
        LoadPath::affine(vec![1.5, 7.0], vec![1.0, 0.0]),
        FrictionCoefficient::affine(vec![0.0], vec![1.0]).unwrap(),
    );
    let problem = problem.unwrap();
    let friction = FrictionCoefficient::affine(vec![0.0], vec![1.0]).unwrap();
    let law = PlanarCoulomb::new(friction.with_second(vec![1.0]).unwrap());
    problem.with_second_parameter(vec![0.0; 2], law).unwrap()
}

#[test]
fn curves() {
    let mut t = Table::new("continuation");
    let map = vee();
    let arm = || arms_at(&map, &ON, &o()).unwrap().arms[0].clone();
    let with_arm = |change: &dyn Fn(&mut Arm)| {
        let mut arm = arm();
        change(&mut arm);
        arm
    };

    for (name, options) in bad_options() {
        let validate = "continuation::ContinuationOptions::validate";
        t.refuses(validate, name, name, || options.validate());
        t.refuses("continuation::Continuation::new", name, name, || {
            Continuation::new(&map, &ON, Direction::Increasing, options.clone()).map(drop)
        });
        t.refuses("continuation::Continuation::new_until", name, name, || {
            Continuation::new_until(&map, &ON, Direction::Increasing, options.clone(), || false).map(drop)
        });
        t.refuses("continuation::Continuation::with_solver", name, name, || {
            Continuation::with_solver(
                &map,
                &ON,
                Direction::Increasing,
                options.clone(),
                AutoSolver::new(),
            )
            .map(drop)
        });
        t.refuses("continuation::BlackBoxCurve::follow", name, name, || {
            BlackBoxCurve::new(&map, &ON, Direction::Increasing, options.clone()).follow()
        });
        t.refuses("continuation::BlackBoxCurve::follow_observed", name, name, || {
            BlackBoxCurve::new(&map, &ON, Direction::Increasing, options.clone())
                .follow_observed(|_| ControlFlow::Continue(()))
        });
        t.refuses("continuation::Continuation::along_arm", name, name, || {
            Continuation::along_arm(&map, &ON, &arm(), options.clone()).map(drop)
        });
        t.refuses("continuation::Branch::follow", name, name, || {
            Branch::follow(&map, &ON, Direction::Increasing, options.clone())
        });
        t.refuses("continuation::Branch::follow_arm", name, name, || {
            Branch::follow_arm(&map, &ON, &arm(), options.clone())
        });
        t.refuses("continuation::arms_at", name, name, || {
            arms_at(&map, &ON, &options)
        });
        t.refuses("continuation::certify", name, name, || {
            certify(&map, &ON, &rows(&[&[1.0]]), &options)
        });
        t.refuses("continuation::certify_with", name, name, || {
            certify_with(&map, &ON, |_| rows(&[&[1.0]]), &options)
        });
        let diagram = DiagramOptions::default().with_continuation(options.clone());
        t.refuses("continuation::Diagram::explore", name, name, || {
            Diagram::explore(&map, &[ON], &diagram)
        });
        t.refuses("continuation::Diagram::explore_sections", name, name, || {
            Diagram::explore_sections(&map, &[0.5], &diagram, &EnumerationOptions::default())
        });
        let sections = "continuation::Diagram::explore_sections_observed";
        t.refuses(sections, name, name, || {
            let lists = EnumerationOptions::default();
            Diagram::explore_sections_observed(&map, &[0.5], &diagram, &lists, |_| {
                std::ops::ControlFlow::Continue(())
            })
        });
        t.refuses("continuation::search_solutions", name, name, || {
            search_solutions(
                &map,
                0.5,
                &[ON],
                &SearchOptions::default().with_diagram(diagram.clone()),
            )
        });
        let mut running = Continuation::new(&map, &ON, Direction::Increasing, o()).unwrap();
        let mut saved = running.save().unwrap();
        *saved.options_mut() = options.clone();
        t.refuses("continuation::Continuation::resume", name, name, || {
            Continuation::resume(&map, &saved).map(drop)
        });
    }

    let follow = |x: &[f64], d: Direction| Branch::follow(&map, x, d, o());
    for x in [vec![], vec![0.5], vec![0.5; 3]] {
        t.refuses("continuation::Branch::follow", "x of another length", "x", || {
            follow(&x, Direction::Increasing)
        });
        t.refuses(
            "continuation::Branch::follow",
            "a direction of another length",
            "direction",
            || follow(&ON, Direction::Along(x.clone())),
        );
        t.refuses(
            "continuation::Branch::follow_arm",
            "x of another length",
            "x",
            || Branch::follow_arm(&map, &x, &arm(), o()),
        );
        t.refuses(
            "continuation::Branch::follow_arm",
            "a tangent of another length",
            "tangent",
            || Branch::follow_arm(&map, &ON, &with_arm(&|a| a.tangent = x.clone()), o()),
        );
        t.refuses("continuation::arms_at", "x of another length", "x", || {
            arms_at(&map, &x, &o())
        });
        t.refuses("continuation::certify", "x of another length", "x", || {
            certify(&map, &x, &rows(&[&[1.0]]), &o())
        });
        t.refuses("continuation::certify_with", "x of another length", "x", || {
            certify_with(&map, &x, |_| rows(&[&[1.0]]), &o())
        });
        t.refuses(
            "continuation::Diagram::explore",
            "a start of another length",
            "",
            || Diagram::explore(&map, std::slice::from_ref(&x), &DiagramOptions::default()),
        );
        t.refuses(
            "continuation::search_solutions",
            "a start of another length",
            "",
            || search_solutions(&map, 0.5, std::slice::from_ref(&x), &SearchOptions::default()),
        );
        t.refuses("continuation::FoldSet::new", "x of another length", "x", || {
            FoldSet::new(family(), &x).map(drop)
        });
    }
    for selection in [
        Selection::default(),
        Selection::uniform(2, 0),
        Selection::uniform(1, 9),
    ] {
        t.refuses(
            "continuation::Branch::follow_arm",
            "a selection of another map",
            "selection",
            || Branch::follow_arm(&map, &ON, &with_arm(&|a| a.selection = selection.clone()), o()),
        );
    }
    for bad in BAD {
        for x in [[bad, 0.5], [0.5, bad]] {
            t.refuses("continuation::Branch::follow", "x", "x[", || {
                follow(&x, Direction::Increasing)
            });
            t.refuses(
                "continuation::Branch::follow",
                "the direction",
                "direction[",
                || follow(&ON, Direction::Along(x.to_vec())),
            );
            t.refuses(
                "continuation::Branch::follow_arm",
                "the tangent",
                "tangent",
                || Branch::follow_arm(&map, &ON, &with_arm(&|a| a.tangent = x.to_vec()), o()),
            );
            t.refuses("continuation::arms_at", "x", "x[", || arms_at(&map, &x, &o()));
            t.refuses("continuation::certify", "x", "x[", || {
                certify(&map, &x, &rows(&[&[1.0]]), &o())
            });
            t.refuses("continuation::Diagram::explore", "a start", "", || {
                Diagram::explore(&map, &[x], &DiagramOptions::default())
            });
            t.refuses("continuation::search_solutions", "a start", "", || {
                search_solutions(&map, 0.5, &[x], &SearchOptions::default())
            });
            t.refuses("continuation::FoldSet::new", "x", "", || {
                FoldSet::new(&map, &x).map(drop)
            });
        }
        t.refuses("continuation::certify", "the load", "", || {
            certify(&map, &ON, &rows(&[&[bad]]), &o())
        });
        t.refuses("continuation::search_solutions", "the parameter", "", || {
            search_solutions(&map, bad, &[ON], &SearchOptions::default())
        });
        t.refuses("continuation::list_solutions", "the parameter", "", || {
            let (enumeration, search) = (EnumerationOptions::default(), SearchOptions::default());
            list_solutions(&map, bad, &enumeration, &search, &|| false)
        });
        t.refuses(
            "continuation::Diagram::explore_sections",
            "the parameter",
            "",
            || {
                Diagram::explore_sections(
                    &map,
                    &[bad],
                    &DiagramOptions::default(),
                    &EnumerationOptions::default(),
                )
            },
        );
        t.refuses(
            "continuation::Branch::follow",
            "a residual that is no number",
            "",
            || Branch::follow(&no_numbers(bad), &ON, Direction::Increasing, o()),
        );
        t.refuses(
            "continuation::BlackBoxCurve::follow",
            "a residual that is no number",
            "",
            || BlackBoxCurve::new(&no_numbers(bad), &ON, Direction::Increasing, o()).follow(),
        );
        t.survives(
            "continuation::BlackBoxCurve::follow",
            "a monitor that becomes no number",
            || {
                let monitor = move |x: &[f64]| if x[0] > 0.25 { -1.0 } else { bad };
                BlackBoxCurve::new(&map, &ON, Direction::Decreasing, o())
                    .with_monitor("m", monitor)
                    .follow()
            },
        );
        t.survives("continuation::arms_at", "a residual that is no number", || {
            arms_at(&no_numbers(bad), &ON, &o())
        });
        t.survives(
            "continuation::Continuation::with_monitor",
            "a monitor that is no number",
            || {
                let curve = Continuation::new(&map, &ON, Direction::Increasing, o()).unwrap();
                Branch::collect(curve.with_monitor("m", move |_| bad), |_| {
                    ControlFlow::Continue(())
                })
            },
        );
        t.survives(
            "continuation::Continuation::with_monitor",
            "a monitor that becomes no number",
            || {
                let curve = Continuation::new(&map, &ON, Direction::Decreasing, o()).unwrap();
                let monitor = move |x: &[f64]| if x[0] > 0.25 { -1.0 } else { bad };
                Branch::collect(curve.with_monitor("m", monitor), |_| ControlFlow::Continue(()))
            },
        );
    }
    t.refuses("continuation::certify", "a load of another shape", "load", || {
        certify(&map, &ON, &rows(&[&[1.0], &[1.0]]), &o())
    });
    // Square systems, empty maps and maps with two parameters define no curve.
    t.refuses(
        "continuation::BlackBoxCurve::follow",
        "an equation",
        "variable",
        || BlackBoxCurve::new(&square(1), &[0.0], Direction::Increasing, o()).follow(),
    );
    t.refuses("continuation::Branch::follow", "an equation", "variable", || {
        Branch::follow(&square(1), &[0.0], Direction::Increasing, o())
    });
    t.refuses("continuation::Branch::follow", "an empty map", "variable", || {
        Branch::follow(&square(0), &[], Direction::Increasing, o())
    });
    t.refuses("continuation::arms_at", "an equation", "variable", || {
        arms_at(&square(1), &[0.0], &o())
    });
    t.refuses(
        "continuation::Diagram::explore",
        "an equation",
        "variable",
        || Diagram::explore(&square(1), &[[0.0]], &DiagramOptions::default()),
    );
    t.refuses(
        "continuation::TransitionSet::new",
        "one parameter",
        "variables",
        || TransitionSet::new(vee(), 0, 0).map(drop),
    );
    for (site, test) in [(1, 0), (0, 9), (usize::MAX, usize::MAX)] {
        t.refuses(
            "continuation::TransitionSet::new",
            "a test function that is not there",
            "",
            || TransitionSet::new(family(), site, test).map(drop),
        );
    }

    // Starts far off the curve, extreme limits.
    for huge in [1e160, 1e300, f64::MAX] {
        t.survives("continuation::Branch::follow", "a huge start", || {
            follow(&[huge, huge], Direction::Increasing)
        });
        t.survives("continuation::Branch::follow", "a huge direction", || {
            follow(&ON, Direction::Along(vec![huge, huge]))
        });
        t.survives("continuation::arms_at", "a huge point", || {
            arms_at(&map, &[huge, huge], &o())
        });
        t.survives("continuation::Branch::follow", "huge steps", || {
            let mut options = o().with_step(huge).with_max_step(huge).with_max_points(20);
            options.parameter_range = (-f64::MAX, f64::MAX);
            Branch::follow(&map, &ON, Direction::Increasing, options)
        });
    }
    for n in [1, 2, usize::MAX] {
        t.survives("continuation::Branch::follow", "absurd limits", || {
            let mut options = o().with_max_points(n).with_max_nodes(u64::MAX);
            options.max_selections = u64::MAX;
            options.max_corrections = n.min(1000);
            Branch::follow(&map, &ON, Direction::Decreasing, options)
        });
        t.survives("continuation::Diagram::explore", "absurd limits", || {
            let options = DiagramOptions::default()
                .with_continuation(o())
                .with_max_edges(n)
                .with_max_points(n);
            Diagram::explore(&map, &[ON], &options)
        });
    }
    t.survives("continuation::Branch::follow", "no time", || {
        Branch::follow(
            &map,
            &ON,
            Direction::Decreasing,
            o().with_max_time(Some(Duration::ZERO)),
        )
    });
    t.survives("continuation::Branch::follow", "all the time there is", || {
        Branch::follow(
            &map,
            &ON,
            Direction::Decreasing,
            o().with_max_time(Some(Duration::MAX)),
        )
    });
    for range in [(-1.0, 0.4), (0.6, 2.0), (-1.0, 0.5 - 1e-9), (0.5 + 1e-9, 2.0)] {
        let options = DiagramOptions::default().with_parameter_range(range);
        let outside = "start = 0.5";
        t.refuses(
            "continuation::Diagram::explore",
            "a start outside",
            outside,
            || Diagram::explore(&map, &[ON], &options),
        );
    }
    t.survives("continuation::Diagram::explore", "no start", || {
        Diagram::explore::<_, [f64; 2]>(&map, &[], &DiagramOptions::default())
    });
    for bad in [f64::NAN, f64::INFINITY, -1.0] {
        t.refuses(
            "continuation::Diagram::explore",
            "same_point",
            "same_point",
            || {
                let options = DiagramOptions::default()
                    .with_continuation(o())
                    .with_same_point(bad);
                Diagram::explore(&map, &[ON], &options)
            },
        );
    }

    // The search.
    let s = || SearchOptions::default().with_diagram(DiagramOptions::default().with_continuation(o()));
    let mut searches = Vec::new();
    for bad in [f64::NAN, f64::INFINITY].into_iter().chain(NOT_POSITIVE) {
        searches.push(("spread", s().with_spread(bad)));
        searches.push(("reach", s().with_reach(Some(bad))));
        searches.push(("merge_distance", s().with_merge_distance(bad)));
        let diagram = DiagramOptions::default().with_same_point(bad);
        t.refuses(
            "continuation::DiagramOptions::validate",
            "same_point",
            "same_point",
            || diagram.validate(),
        );
        searches.push(("same_point", s().with_diagram(diagram)));
    }
    searches.push(("max_solutions", s().with_max_solutions(0)));
    for (name, options) in searches {
        t.refuses("continuation::SearchOptions::validate", name, name, || {
            options.validate()
        });
        t.refuses("continuation::search_solutions", name, name, || {
            search_solutions(&map, 0.5, &[ON], &options)
        });
    }
    t.survives("continuation::search_solutions", "no effort", || {
        let options = s()
            .with_starts(0)
            .with_rounds(0)
            .with_deflations(0)
            .with_neighbours(0);
        search_solutions(&map, 0.5, &[ON], &options)
    });

    // Records of one map used with another.
    let branch = follow(&ON, Direction::Decreasing).unwrap();
    let diagram = Diagram::explore(&map, &[ON], &DiagramOptions::default().with_continuation(o())).unwrap();
    let other = MinMap::curve(3, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a.copy_from_slice(&x[..3]);
        b.fill(1.0);
    });
    t.refuses("continuation::Branch::certify", "another map", "", || {
        branch.certify(&other, &rows(&[&[1.0]]), &o())
    });
    t.refuses(
        "continuation::Branch::certify",
        "a load of another shape",
        "load",
        || branch.certify(&map, &rows(&[&[1.0], &[1.0]]), &o()),
    );
    for transition in &branch.transitions {
        t.refuses("continuation::Transition::certify", "another map", "", || {
            transition.certify(&other, &rows(&[&[1.0]]), &o())
        });
    }
    t.refuses("continuation::Diagram::solutions_at", "another map", "", || {
        diagram.solutions_at(&other, 0.5)
    });
    for bad in BAD {
        t.refuses("continuation::Diagram::solutions_at", "the parameter", "", || {
            diagram.solutions_at(&map, bad)
        });
    }
    t.refuses("continuation::Diagram::resume", "another map", "", || {
        diagram
            .clone()
            .resume(&other, &[[0.5; 4]], &DiagramOptions::default())
    });
    let saved = Continuation::new(&map, &ON, Direction::Increasing, o())
        .unwrap()
        .save()
        .unwrap();
    t.refuses("continuation::Continuation::resume", "another map", "", || {
        Continuation::resume(&other, &saved).map(drop)
    });
    let set = TransitionSet::new(family(), 0, 0).unwrap();
    let m = set.num_vars();
    for selection in [
        Selection::default(),
        Selection::uniform(2, 0),
        Selection::uniform(1, 9),
    ] {
        t.refuses(
            "continuation::TransitionSet::is_fold",
            "a selection of another map",
            "selection",
            || set.is_fold(&selection, &vec![0.5; m]),
        );
        t.survives(
            "continuation::TransitionSet::family_selection",
            "a selection of another map",
            || set.family_selection(&selection),
        );
    }
    let own = Selection::uniform(set.num_sites(), 0);
    for n in [0, m - 1, m + 1] {
        t.refuses(
            "continuation::TransitionSet::is_fold",
            "x of another length",
            "x",
            || set.is_fold(&own, &vec![0.5; n]),
        );
    }
    for bad in BAD {
        t.refuses("continuation::TransitionSet::is_fold", "x", "x[0]", || {
            set.is_fold(&own, &vec![bad; m])
        });
        t.refuses("continuation::FoldSet::new", "x", "x[0]", || {
            FoldSet::new(family(), &vec![bad; m]).map(drop)
        });
    }
    t.refuses("continuation::FoldSet::new", "one parameter", "variables", || {
        FoldSet::new(&map, &ON).map(drop)
    });
    t.refuses(
        "continuation::TransitionSet::character_changes",
        "a curve of another map",
        "",
        || set.character_changes(&branch),
    );
    t.exempt(
        &[
            "continuation::Diagram::explore_observed",
            "continuation::Diagram::resume_observed",
            "continuation::search_solutions_observed",
        ],
        "called by the functions without a callback",
    );
    t.exempt(
        &[
            "continuation::Branch::collect",
            "continuation::Continuation::save",
        ],
        "the curve is checked when it begins",
    );
    t.finish();
}
