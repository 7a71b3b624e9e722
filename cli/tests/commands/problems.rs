//! Curves, diagrams and lists of equations and of discrete problems, as users start them.

use std::path::Path;

use semismooth::contact::read_folder;
use semismooth::continuation::{Branch, ContinuationOptions, Diagram, DiagramOptions, Direction};
use semismooth::enumeration::EnumerationOptions;
use semismooth::piecewise::PiecewiseSmoothExt;

use super::{folder, printed, refused, run_file_of, table};

const BLOCK: &str = "../examples/data/block_linear_10x20_F0.5";

/// Changes that put a discrete problem in place of the equations.
pub fn discrete() -> [(&'static str, String); 4] {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(BLOCK);
    [
        ("unknowns", "# unknowns".to_owned()),
        ("parameter =", "# parameter =".to_owned()),
        ("equations =", "# equations =".to_owned()),
        (
            "# folder = \"block\"",
            format!("folder = {:?}", path.display().to_string()),
        ),
    ]
}

fn column(rows: &[Vec<String>], name: &str) -> Vec<f64> {
    let k = rows[0].iter().position(|n| n == name).unwrap();
    rows[1..].iter().map(|r| r[k].parse().unwrap()).collect()
}

fn assert_folds(text: &str, expected: [f64; 2]) {
    let lines = text.lines().filter_map(|l| l.strip_prefix("fold at load = "));
    let found: Vec<f64> = lines.map(|l| l.parse().unwrap()).collect();
    assert!(
        found.len() == 2 && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12),
        "{text}"
    );
}

/// y − 1.25 (y − 1)₊ + 10 (y − 3)₊ = load folds at y = 1, load = 1 and y = 3, load = ½, and is at y = 3 + 1.5/9.75 where load = 2.
#[test]
fn the_curve_of_a_beam_turns_at_its_kinks() {
    let folder = folder("beam");
    run_file_of(&folder, "follow", &[]);
    let text = printed(&folder, &["follow", "run.toml"]);
    assert_folds(&text, [1.0, 0.5]);
    assert!(
        text.contains("2 transitions; the curve ends: bound of the parameter"),
        "{text}"
    );
    assert!(text.contains("    0 → y − 1\n"), "{text}");
    let rows = table(&folder.join("out/curve.csv"));
    let (y, load) = (column(&rows, "y"), column(&rows, "parameter"));
    assert!((y.last().unwrap() - (3.0 + 1.5 / 9.75)).abs() < 1e-12);
    // A polygon has a row for each of its corners, and its picture no arcs.
    assert_eq!(y.len(), 4);
    let picture = std::fs::read_to_string(folder.join("out/curve.svg")).unwrap();
    assert!(picture.contains("<polyline") && !picture.contains("<path"));
    for (y, load) in y.iter().zip(&load) {
        let f = y - 1.25 * (y - 1.0).max(0.0) + 10.0 * (y - 3.0).max(0.0);
        assert!((f - load).abs() < 1e-12);
    }
    assert!(
        std::fs::read_to_string(folder.join("out/curve.svg"))
            .unwrap()
            .contains("load")
    );
    let text = printed(&folder, &["follow", "run.toml", "--pdf", "--out", "paper"]);
    assert!(text.contains("curve.csv, curve.svg, curve.pdf\n"), "{text}");
    let picture = std::fs::read(folder.join("paper/curve.pdf")).unwrap();
    assert!(picture.starts_with(b"%PDF-"));
    let [here, there] = ["out/curve.svg", "paper/curve.svg"].map(|f| std::fs::read(folder.join(f)).unwrap());
    assert_eq!(here, there);
    // JSON objects with the same numbers, in another folder; the same curve backwards from the other end.
    let text = printed(&folder, &["follow", "run.toml", "--json", "--out", "json"]);
    let lines: Vec<serde_json::Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert_eq!(lines.len(), 3);
    for (line, (y, load)) in lines.iter().zip([(1.0, 1.0), (3.0, 0.5)]) {
        let found = [&line["x"]["y"], &line["x"]["load"]].map(|v| v.as_f64().unwrap());
        assert!((found[0] - y).abs() < 1e-12 && (found[1] - load).abs() < 1e-12);
        assert_eq!(line["kind"], "fold");
    }
    assert_eq!(lines[2]["folds"].as_array().unwrap().len(), 2);
    assert!(printed(&folder, &["follow", "run.toml", "-q"]).is_empty());
    run_file_of(
        &folder,
        "follow",
        &[
            ("range = [0.0, 2.0]", "range = [2.0, 0.0]"),
            ("# start = [0.0]", "start = [3.2]"),
        ],
    );
    let text = printed(&folder, &["follow", "run.toml"]);
    assert_folds(&text, [0.5, 1.0]);
}

#[test]
fn options_are_those_of_the_library() {
    let folder = folder("options");
    run_file_of(
        &folder,
        "follow",
        &[
            (
                "# [options]\n# max_step = 1.0",
                "[options]\nmax_step = 0.01\ntargets = [1.5]",
            ),
            // Between kinks a polygon has no steps.
            ("y - 1.25*max", "y + 0.01*y^2 - 1.25*max"),
        ],
    );
    printed(&folder, &["follow", "run.toml", "-q"]);
    let rows = table(&folder.join("out/curve.csv"));
    let arclength = column(&rows, "arclength");
    assert!(arclength.windows(2).all(|w| w[1] - w[0] < 0.011));
    assert!(column(&rows, "parameter").contains(&1.5));
    // The printed options can be pasted into a run file.
    for (kind, command) in [
        ("continuation", "follow"),
        ("diagram", "diagram"),
        ("search", "solutions"),
    ] {
        let defaults = printed(&folder, &["options", kind]);
        let mut own = String::from("[options]\n");
        for line in defaults.lines() {
            own += &match line.strip_prefix('[') {
                Some(rest) => format!("[options.{rest}\n"),
                None => format!("{line}\n"),
            };
        }
        let before: &str = if command == "follow" {
            "# [options]\n# max_step = 1.0"
        } else {
            "[output]"
        };
        let own = if command == "follow" {
            own
        } else {
            format!("{own}\n[output]")
        };
        run_file_of(&folder, command, &[(before, &own)]);
        printed(&folder, &[command, "run.toml", "-q"]);
    }
    for kind in ["contact", "delassus", "enumeration", "mcp", "newton"] {
        assert!(printed(&folder, &["options", kind]).contains(" = "));
        let text = printed(&folder, &["options", kind, "--json"]);
        assert!(
            serde_json::from_str::<serde_json::Value>(&text)
                .unwrap()
                .is_object()
        );
    }
}

#[test]
fn a_discrete_problem_has_the_transitions_of_the_library() {
    let folder = folder("block");
    let changes = discrete();
    let mut changes: Vec<_> = changes.iter().map(|(a, b)| (*a, b.as_str())).collect();
    changes.push(("range = [0.0, 2.0]", "range = [0.0, 1.0]"));
    run_file_of(&folder, "follow", &changes);
    let text = printed(&folder, &["follow", "run.toml", "--json"]);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(BLOCK);
    let problem = read_folder(path).unwrap().condensed().unwrap();
    let start = problem.solve(0.0, None).unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let branch = Branch::follow(&problem, &start, Direction::Increasing, options).unwrap();
    assert_eq!(branch.transitions.len(), 36);
    for (line, t) in text.lines().zip(&branch.transitions) {
        let line: serde_json::Value = serde_json::from_str(line).unwrap();
        assert_eq!(line["x"]["α"], t.parameter());
        let expected: Vec<_> = t
            .sites
            .iter()
            .filter(|c| c.from != c.to)
            .map(|c| problem.site_name(c.site).into_owned())
            .collect();
        let changes = line["changes"].as_array().unwrap().iter();
        let found: Vec<_> = changes.map(|c| c["site"].as_str().unwrap().to_owned()).collect();
        assert_eq!(found, expected);
    }
}

/// |x| + y = a, 2 y + min(x, 1) = 0: for x < 0 y = −x/2 and a = −3 x/2, for 0 < x < 1 a = x/2, beyond a = x − ½.
#[test]
fn diagrams_and_lists_hold_every_solution() {
    let folder = folder("diagram");
    run_file_of(&folder, "diagram", &[]);
    let text = printed(&folder, &["diagram", "run.toml"]);
    assert!(
        text.contains("complete within the bounds") || text.contains("nothing else was found"),
        "{text}"
    );
    let rows = table(&folder.join("out/diagram.csv"));
    let (x, a) = (column(&rows, "x"), column(&rows, "parameter"));
    let exact = |x: f64| match x {
        x if x < 0.0 => -1.5 * x,
        x if x < 1.0 => 0.5 * x,
        x => x - 0.5,
    };
    assert!(x.iter().zip(&a).all(|(x, a)| (exact(*x) - a).abs() < 1e-12));
    assert!(x.iter().any(|x| *x < -1.9) && x.iter().any(|x| *x > 3.4));
    let text = std::fs::read_to_string(folder.join("out/diagram.json")).unwrap();
    assert!(serde_json::from_str::<serde_json::Value>(&text).unwrap()["complete"].is_boolean());
    assert!(folder.join("out/diagram.svg").exists());
    // The same from a start.
    run_file_of(
        &folder,
        "diagram",
        &[("sections = ", "# sections = "), ("# starts = ", "starts = ")],
    );
    let text = printed(&folder, &["diagram", "run.toml", "--json"]);
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(summary["folds"], serde_json::json!([0.0]));

    run_file_of(&folder, "solutions", &[]);
    let text = printed(&folder, &["solutions", "run.toml"]);
    assert!(
        text.contains("a = -1: no solution, complete\na = 0.5: 2 solutions, complete\n"),
        "{text}"
    );
    let rows = table(&folder.join("out/solutions.csv"));
    assert_eq!(column(&rows, "a"), [0.5, 0.5, 2.0, 2.0]);
    let mut found = column(&rows, "x");
    found.sort_by(f64::total_cmp);
    let expected = [-2.0 / 1.5, -0.5 / 1.5, 1.0, 2.5];
    assert!(
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12),
        "{found:?}"
    );
    let text = printed(&folder, &["solutions", "run.toml", "--json"]);
    let last: serde_json::Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    assert!(
        last["complete"] == true
            && last["index sum"] == 0
            && last["solutions"].as_array().unwrap().len() == 2
    );
}

#[test]
fn lists_that_are_searched_say_so() {
    let folder = folder("search");
    let cubic = "equations = [\"x^3 - x = a\", \"y = max(x, 0)\"]";
    run_file_of(
        &folder,
        "solutions",
        &[
            ("equations = [\"abs(x) + y = a\", \"2*y + min(x, 1) = 0\"]", cubic),
            ("at = [-1.0, 0.5, 2.0]", "at = [0.0]"),
        ],
    );
    let text = printed(&folder, &["solutions", "run.toml"]);
    assert!(
        text.contains("a = 0: found 3, complete: unknown; index sum +1"),
        "{text}"
    );
    // Without a parameter.
    run_file_of(
        &folder,
        "solutions",
        &[
            ("parameter = \"a\"", "# parameter = \"a\""),
            ("= a\"", "= 2\""),
            ("at = [-1.0, 0.5, 2.0]", "# at ="),
        ],
    );
    let text = printed(&folder, &["solutions", "run.toml"]);
    assert!(text.contains("solutions, complete\n    x = "), "{text}");
}

#[test]
fn diagrams_of_discrete_problems_are_those_of_the_library() {
    let folder = folder("discrete");
    let changes = discrete();
    let mut changes: Vec<_> = changes.iter().map(|(a, b)| (*a, b.as_str())).collect();
    changes.push(("range = [-2.0, 3.0]", "range = [0.2, 0.4]"));
    changes.push(("sections = [-1.0, 0.5, 2.0]", "sections = [0.3]"));
    run_file_of(&folder, "diagram", &changes);
    let text = printed(&folder, &["diagram", "run.toml", "--json"]);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(BLOCK);
    let problem = read_folder(path).unwrap().condensed().unwrap();
    let options = DiagramOptions::default().with_parameter_range((0.2, 0.4));
    let diagram =
        Diagram::explore_sections(&problem, &[0.3], &options, &EnumerationOptions::default()).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!(summary["edges"], diagram.edges().len());
    assert_eq!(summary["complete"], diagram.completeness().is_complete());
}

#[test]
fn what_is_wrong_is_named_with_file_line_and_key() {
    let folder = folder("wrong problems");
    let cases: &[(&str, &str, &str, &[&str])] = &[
        (
            "follow",
            "max(y - 1, 0)",
            "max(y - 1)",
            &[
                "line 9",
                "problem.equations",
                "max takes two",
                "\"max\" behind \"y - 1.25*\"",
            ],
        ),
        (
            "follow",
            "= load\"]",
            "= lode\"]",
            &["line 9", "problem.equations", "lode is unknown", "y, load"],
        ),
        (
            "follow",
            "= load\"]",
            "= load\", \"y = 1\"]",
            &["problem.equations", "2 equations for 1 unknowns"],
        ),
        (
            "follow",
            "parameter = \"load\"",
            "parameter = \"y\"",
            &["line 4", "problem", "two variables \"y\""],
        ),
        ("follow", "parameter = \"load\"\n", "", &["load is unknown"]),
        (
            "follow",
            "unknowns = [\"y\"]\n",
            "",
            &["line 4", "problem", "unknowns and equations"],
        ),
        (
            "follow",
            "# folder = \"block\"",
            "folder = \"block\"",
            &["line 4", "problem", "or a folder"],
        ),
        (
            "follow",
            "range = [0.0, 2.0]",
            "range = [1.0, 1.0]",
            &["line 17", "run.range", "two different"],
        ),
        (
            "follow",
            "range = [0.0, 2.0]",
            "range = [0.0, inf]",
            &["line 17", "run.range"],
        ),
        (
            "follow",
            "range = [0.0, 2.0]\n",
            "",
            &["line 15", "run.range", "wanted"],
        ),
        (
            "follow",
            "# start = [0.0]",
            "start = [0.0, 0.0]",
            &["line 19", "run.start", "2 numbers for 1"],
        ),
        (
            "follow",
            "# plot = [\"y\"]",
            "plot = [\"z\"]",
            &["line 28", "output.plot", "\"z\""],
        ),
        (
            "follow",
            "# [options]\n# max_step = 1.0",
            "[options]\nmax_stepp = 1.0",
            &["line 22", "options", "max_stepp"],
        ),
        (
            "follow",
            "# [options]\n# max_step = 1.0",
            "[options]\nmax_step = -1.0",
            &["max_step"],
        ),
        ("follow", "[run]", "[runn]", &["runn"]),
        (
            "diagram",
            "sections = [-1.0, 0.5, 2.0]",
            "# none",
            &["line 14", "run", "one of starts and sections"],
        ),
        (
            "diagram",
            "sections = [-1.0, 0.5, 2.0]",
            "starts = [[0.0, 0.0]]",
            &["line 18", "run.starts", "2 numbers, expected 3"],
        ),
        (
            "diagram",
            "sections = [-1.0, 0.5, 2.0]",
            "sections = [nan]",
            &["line 18", "run.sections"],
        ),
        (
            "solutions",
            "at = [-1.0, 0.5, 2.0]",
            "at = []",
            &["line 14", "run.at", "wanted"],
        ),
        (
            "solutions",
            "at = [-1.0, 0.5, 2.0]",
            "at = [nan]",
            &["line 16", "run.at", "NaN"],
        ),
        (
            "solutions",
            "parameter = \"a\"",
            "# parameter = \"a\"",
            &["a is unknown"],
        ),
    ];
    for (kind, from, to, expected) in cases {
        run_file_of(&folder, kind, &[(from, to)]);
        let message = refused(&folder, &[kind, "run.toml"]);
        for word in *expected {
            assert!(
                message.contains(word),
                "{from} → {to}: {word} is not in {message}"
            );
        }
    }
    let absent = "folder = \"absent\"";
    run_file_of(
        &folder,
        "follow",
        &[
            ("unknowns", "# unknowns"),
            ("parameter =", "# parameter ="),
            ("equations =", "# equations ="),
            ("# folder = \"block\"", absent),
        ],
    );
    let message = refused(&folder, &["follow", "run.toml"]);
    assert!(
        message.contains("line 13, problem.folder") && message.contains("A.mtx"),
        "{message}"
    );
}

/// |x| + y = a, 2 y + min(x, 1) = 10: no solution for a ≤ 3.
#[test]
fn a_diagram_without_curves_has_tables_and_no_picture() {
    let folder = folder("no_curves");
    run_file_of(&folder, "diagram", &[("min(x, 1) = 0", "min(x, 1) = 10")]);
    let text = printed(&folder, &["diagram", "run.toml"]);
    assert!(text.contains("0 branches, "), "{text}");
    assert!(text.contains("diagram.csv, diagram.json\n"), "{text}");
    assert!(folder.join("out/diagram.json").exists() && !folder.join("out/diagram.svg").exists());
}

#[test]
fn powers_that_are_flat_at_zero_are_not_taken_for_affine() {
    let folder = folder("flat");
    let equations = "equations = [\"abs(x) + y = a\", \"2*y + min(x, 1) = 0\"]";
    let flat = "equations = [\"x^20 = a + 10\", \"y + max(x, 0)^20 = 0\"]";
    run_file_of(
        &folder,
        "solutions",
        &[(equations, flat), ("at = [-1.0, 0.5, 2.0]", "at = [-2.0]")],
    );
    let text = printed(&folder, &["solutions", "run.toml"]);
    assert!(text.starts_with("a = -2: found 2, complete: unknown"), "{text}");
    let root = 8.0_f64.powf(0.05);
    for x in column(&table(&folder.join("out/solutions.csv")), "x") {
        assert!((x.abs() - root).abs() < 1e-9, "{x}");
    }
    // Affine with rounded coefficients.
    let rounded = "equations = [\"sqrt(2)*x + abs(x)/3 = a + 2\", \"y = x\"]";
    run_file_of(&folder, "solutions", &[(equations, rounded)]);
    let text = printed(&folder, &["solutions", "run.toml"]);
    assert!(text.starts_with("a = -1: 1 solution, not proven"), "{text}");
}

#[test]
fn continua_are_no_isolated_solutions_and_options_are_read_before_the_search() {
    let folder = folder("continuum");
    let equations = "equations = [\"abs(x) + y = a\", \"2*y + min(x, 1) = 0\"]";
    run_file_of(
        &folder,
        "solutions",
        &[(equations, "equations = [\"x = y\", \"y = x\"]")],
    );
    let text = printed(&folder, &["solutions", "run.toml"]);
    assert!(
        text.contains("a = 2: no isolated solution, complete\n    and a continuum of solutions\n"),
        "{text}"
    );
    run_file_of(
        &folder,
        "solutions",
        &[("# [options]\n# starts = 100", "[options]\nstart = 100")],
    );
    let error = refused(&folder, &["solutions", "run.toml"]);
    assert!(
        error.contains("options: ") && error.contains("`start`"),
        "{error}"
    );
}
