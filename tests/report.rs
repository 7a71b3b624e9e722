//! Reports: what they state is what the solvers return, and a page needs nothing but itself.
#![cfg(all(feature = "autodiff", feature = "svg"))]

use std::ops::ControlFlow;

use semismooth::contact::{
    CondensedContact, ContactBody, EvolutionOptions, FrictionCoefficient, LoadPath, PlanarCoulomb, evolve,
};
use semismooth::continuation::{
    Branch, ContinuationOptions, Direction, SearchOptions, SolutionList, list_solutions,
};
use semismooth::enumeration::EnumerationOptions;
use semismooth::fem::{ContactRows, ElasticSystem, Elasticity, Foundation, Material, Mesh};
use semismooth::output::{OutputError, Report, ReportOptions};
use semismooth::piecewise::{Formula, MinMap, PiecewiseSmooth, Traced};

fn go_on(_: &str) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// load = min(y, 5/4 − y/4) for y ≤ 3, and beyond a stop holds: folds at (1, 1) and (3, ½).
fn beam() -> impl PiecewiseSmooth {
    let text = "y - 1.25*max(y - 1, 0) + 10*max(y - 3, 0) = load";
    Traced::new(Formula::read(&[text], &["y", "load"]).unwrap())
}

fn unescaped(text: &str) -> String {
    let signs = [
        ("&lt;", "<"),
        ("&gt;", ">"),
        ("&quot;", "\""),
        ("&#39;", "'"),
        ("&amp;", "&"),
    ];
    signs
        .iter()
        .fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
}

/// The tables to copy, as rows of cells.
fn tables(html: &str) -> Vec<Vec<Vec<String>>> {
    let found = html.split("<textarea").skip(1).map(|t| {
        let text = t
            .split_once(">\n")
            .unwrap()
            .1
            .split_once("</textarea>")
            .unwrap()
            .0;
        let cells = |row: &str| row.split('\t').map(unescaped).collect();
        text.lines().map(cells).collect()
    });
    found.collect()
}

fn column(table: &[Vec<String>], name: &str) -> Vec<String> {
    let k = table[0].iter().position(|n| n == name).unwrap();
    table[1..].iter().map(|row| row[k].clone()).collect()
}

fn numbers(table: &[Vec<String>], name: &str) -> Vec<f64> {
    column(table, name).iter().map(|v| v.parse().unwrap()).collect()
}

/// A page has no reference to anything outside it, and no element that is not closed.
fn stands_alone(html: &str) {
    let outside = html.replace("http://www.w3.org/2000/svg", "");
    for word in ["http:", "https:", "src=", "@import", "url("] {
        assert!(!outside.contains(word), "{word}");
    }
    for element in [
        "section", "table", "tr", "td", "ul", "li", "p", "figure", "svg", "textarea", "div",
    ] {
        let opened =
            html.matches(&format!("<{element}>")).count() + html.matches(&format!("<{element} ")).count();
        assert_eq!(
            opened,
            html.matches(&format!("</{element}>")).count(),
            "{element}"
        );
    }
    assert!(html.len() <= 2_000_000, "{}", html.len());
}

#[test]
fn the_page_states_the_curve_and_its_folds() {
    let map = beam();
    let options = ReportOptions::default();
    let report = Report::of_map(&map, &["y", "load"], &[0.0, 0.0], 2.0, &options, go_on).unwrap();
    let range = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
    let range = range.with_max_time(Some(options.max_time));
    let branch = Branch::follow(&map, &[0.0, 0.0], Direction::Increasing, range).unwrap();
    assert_eq!(report.branch(), Some(&branch));
    let html = report.to_html();
    stands_alone(html);
    let all = tables(html);
    let curve = all.last().unwrap();
    let vertices = branch.vertices();
    assert_eq!(
        numbers(curve, "load"),
        vertices.iter().map(|v| v.x[1]).collect::<Vec<_>>()
    );
    assert_eq!(
        numbers(curve, "y"),
        vertices.iter().map(|v| v.x[0]).collect::<Vec<_>>()
    );
    assert_eq!(
        column(curve, "event"),
        vertices.iter().map(|v| v.event.to_owned()).collect::<Vec<_>>()
    );
    // Up to the fold at (1, 1), back to that at (3, ½): y grows all the way, so that prescribing it avoids the jumps.
    assert!(
        branch
            .folds()
            .iter()
            .zip([1.0, 0.5])
            .all(|(a, b)| (a - b).abs() < 1e-9),
        "{:?}",
        branch.folds()
    );
    assert!(html.contains("the load rises to load = 1 and turns back"));
    assert!(html.contains("the load falls to load = 0.5 and turns back"));
    assert_eq!(html.matches("y goes on in its direction").count(), 2);
    // At the fold the stop holds, too: y = 3 + (1 − ½)/9.75.
    assert!(html.contains("1 other solution is known: y = 3.05128."), "{html}");
}

#[test]
fn where_the_displacement_turns_back_with_the_load_there_is_a_snap_back() {
    // Arclength is |t|: (y, α) = (t, t) up to t = 1, then (y, α) = (1 − (t − 1)/2, 2 − t): both turn back.
    let map = MinMap::curve(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        // y = min(t, (3 − t)/2), α = min(t, 2 − t).
        (a[0], b[0]) = (x[0] - x[1], 1.5 - 0.5 * x[0] - x[1]);
        (a[1], b[1]) = (x[0] - x[2], 2.0 - x[0] - x[2]);
    });
    let options = ReportOptions::default().with_drawn(vec![1]);
    let report = Report::of_map(&map, &["t", "y", "α"], &[0.0, 0.0, 0.0], 2.0, &options, go_on).unwrap();
    let html = report.to_html();
    assert!(html.contains("y turns back as well (snap-back)"), "{html}");
    assert!(html.contains("does not reach α = 2: it turns back and leaves the range at α = 0"));
}

/// The words beside a number of solutions are those of the list from which it comes.
#[test]
fn numbers_of_solutions_are_those_of_the_lists() {
    let map = beam();
    let options = ReportOptions::default().with_loads(vec![0.25, 0.75]);
    let report = Report::of_map(&map, &["y", "load"], &[0.0, 0.0], 2.0, &options, go_on).unwrap();
    assert_eq!(report.lists().len(), 2);
    for ((load, list), count) in report.lists().iter().zip([1, 3]) {
        let time = Some(options.max_time / 2);
        let (enumeration, search) = (
            EnumerationOptions::default().with_max_time(time),
            SearchOptions::default().with_max_time(time),
        );
        let own = list_solutions(&map, *load, &enumeration, &search, &|| false).unwrap();
        assert_eq!(&own, list);
        let (number, certainty) = match list {
            SolutionList::Enumerated(set) if set.completeness.is_complete() => {
                (set.solutions.len(), "proven")
            }
            SolutionList::Enumerated(set) => (set.solutions.len(), "without proof"),
            SolutionList::Searched(found) => (found.solutions.len(), "others are not excluded"),
            _ => unreachable!(),
        };
        assert_eq!(number, count);
        let row = report.to_html().split("<tr>").find(|r| {
            r.contains(&format!(
                "<td class=\"n\">{load}</td><td class=\"n\">{number}</td>"
            ))
        });
        assert!(row.is_some_and(|r| r.contains(certainty)), "{row:?}");
    }
}

#[test]
fn the_same_problem_gives_the_same_page_and_names_are_text() {
    let map = beam();
    let make = |name: &str| {
        let options = ReportOptions::default().with_title(name.to_owned());
        Report::of_map(&map, &[name, "load"], &[0.0, 0.0], 2.0, &options, go_on).unwrap()
    };
    assert_eq!(make("y").to_html(), make("y").to_html());
    let html = make("<script>alert('y')</script> & \"z\"").to_html().to_owned();
    stands_alone(&html);
    assert_eq!(html.matches("<script>").count(), 1);
    assert!(html.contains("&lt;script&gt;alert(&#39;y&#39;)&lt;/script&gt; &amp; &quot;z&quot;"));
}

/// A block on the ground, pushed aside at its top.
fn block(cells: [usize; 2]) -> (CondensedContact<PlanarCoulomb>, ElasticSystem, ContactRows) {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], cells).unwrap();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| -0.02)
        .assemble()
        .unwrap();
    let load = LoadPath::affine(system.supports(), system.motion("top", 0, |_| 0.05).unwrap());
    let ground = Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]);
    let rows = system.contact("bottom", &ground).unwrap();
    let body = ContactBody::new(
        system.stiffness().clone(),
        rows.normal.clone(),
        rows.tangential.clone(),
        load,
    );
    let body = body.unwrap().with_gap(rows.gap.clone()).unwrap();
    let law = PlanarCoulomb::new(FrictionCoefficient::constant(0.4).unwrap());
    (CondensedContact::new(body, law).unwrap(), system, rows)
}

#[test]
fn nodes_reactions_and_energies_are_those_of_the_solutions() {
    let (problem, system, rows) = block([8, 4]);
    let options = ReportOptions::default().with_loads(vec![1.0]);
    let report = Report::of_contact(&problem, Some((&system, &rows)), [0.0, 1.0], &options, go_on).unwrap();
    let html = report.to_html();
    stands_alone(html);
    let branch = report.branch().unwrap();
    let [nodes, curve] = tables(html).try_into().unwrap();
    for (row, vertex) in curve[1..].iter().zip(branch.vertices()) {
        let solution = problem.solution(vertex.x).unwrap();
        let [normal, tangential, _] = solution.resultant();
        let expected = [vertex.arclength, vertex.x[18], normal, tangential];
        let energies = [solution.energy.stored, solution.energy.dissipated];
        let found: Vec<f64> = [0, 1, 6, 7, 8, 9]
            .iter()
            .map(|&k| row[k].parse().unwrap())
            .collect();
        assert_eq!(found, [&expected[..], &energies].concat());
        assert_eq!(
            row[3..6],
            [solution.open(), solution.stick(), solution.slip()].map(|n| n.to_string())
        );
    }
    // The load of the first slip of a node is that of the first transition after which it slips.
    let first = column(&nodes, "first slip");
    for (node, told) in first.iter().enumerate() {
        let slips = |s| problem.states(s)[node].is_slip();
        let expected = match branch.points.first().is_some_and(|p| slips(&p.selection)) {
            true => "from the start".to_owned(),
            false => match branch.transitions.iter().find(|t| slips(&t.after)) {
                Some(t) => format!("{:?}", t.parameter()),
                None => "–".to_owned(),
            },
        };
        assert_eq!(told, &expected, "node {node}");
    }
    // Two panels of the curve, and the body at the start, at the end and at events.
    assert!(html.matches("<svg").count() > 4 && html.contains("von Mises"));
    assert!(html.contains("F_crit = ") && html.contains("Below the coefficient "));
    let without = Report::of_contact(&problem, None, [0.0, 1.0], &options, go_on).unwrap();
    assert_eq!(without.branch(), report.branch());
    assert!(!without.to_html().contains("Pictures of the body"));
}

#[test]
fn a_history_is_that_of_evolve() {
    let (mut problem, system, rows) = block([8, 4]);
    let (mut other, ..) = block([8, 4]);
    let levels = [0.0, 0.5, 1.0, 0.0];
    let options = ReportOptions::default();
    let report = Report::of_history(&mut problem, Some((&system, &rows)), &levels, &options, go_on).unwrap();
    let start = other.solve(0.0, None).unwrap();
    let steps = evolve(
        &mut other,
        &start,
        &levels[1..],
        &EvolutionOptions::default(),
        |_| ControlFlow::Continue(()),
    );
    assert_eq!(report.steps(), steps.unwrap());
    stands_alone(report.to_html());
    let table = tables(report.to_html()).pop().unwrap();
    for (name, value) in [("work", 0), ("stored", 1), ("dissipated", 2)] {
        let expected: Vec<f64> = report
            .steps()
            .iter()
            .map(|s| [s.work, s.stored, s.dissipated][value])
            .collect();
        assert_eq!(numbers(&table, name), expected);
    }
}

/// Pictures and tables leave out what has no room, and say so.
#[test]
fn a_large_mesh_is_a_small_page() {
    let (problem, system, rows) = block([150, 75]);
    let options = ReportOptions::default().with_loads(vec![0.0]);
    let options = options.with_max_time(std::time::Duration::from_millis(100));
    let report = Report::of_contact(&problem, Some((&system, &rows)), [0.0, 1e-3], &options, go_on).unwrap();
    stands_alone(report.to_html());
    assert!(report.to_html().contains("<svg"));
    assert!(report.to_html().contains("the table to copy below has all 151"));
}

#[test]
fn what_was_found_before_a_stop_is_reported() {
    let map = beam();
    let mut calls = 0;
    let report = Report::of_map(
        &map,
        &["y", "load"],
        &[0.0, 0.0],
        2.0,
        &ReportOptions::default(),
        |_| {
            calls += 1;
            match calls {
                1 => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            }
        },
    )
    .unwrap();
    assert!(report.lists().is_empty() && report.diagram().is_none());
    assert!(report.to_html().contains("The work was stopped before its end"));
    stands_alone(report.to_html());
}

#[test]
fn a_start_without_a_solution_is_exchanged_for_one_at_the_loads() {
    // |y| = α has none below 0.
    let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        (a[0], b[0]) = (x[1] - x[0], x[1] + x[0]);
    });
    let report = |loads: Vec<f64>| {
        let options = ReportOptions::default().with_loads(loads);
        Report::of_map(&map, &["y", "α"], &[0.0, -1.0], 2.0, &options, go_on)
    };
    assert!(matches!(report(vec![-0.5]), Err(OutputError::Curve(_))));
    let found = report(vec![-0.5, 1.0]).unwrap();
    assert_eq!(found.branch().unwrap().points[0].parameter(), 1.0);
    assert_eq!(found.lists().len(), 2);
}
