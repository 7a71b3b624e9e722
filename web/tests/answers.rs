//! Answers to the page, compared with the printed tables of the talk, exact arithmetic, closed forms and the crate's own functions.

use proptest::prelude::*;
use semismooth::contact::{HildRenard, HildRenardCase};
use semismooth::fem::{CellKind, Elasticity, Material, Mesh};
use serde_json::{Value, json};

fn ask(question: &Value) -> Value {
    let answer: Value = serde_json::from_str(&semismooth_web::answer(&question.to_string())).unwrap();
    assert!(answer["ok"].is_object(), "{question}: {answer}");
    answer["ok"].clone()
}

fn refused(question: &Value) -> Value {
    let answer: Value = serde_json::from_str(&semismooth_web::answer(&question.to_string())).unwrap();
    assert!(answer["error"]["message"].is_string(), "{question}: {answer}");
    answer["error"].clone()
}

fn numbers(v: &Value) -> Vec<f64> {
    v.as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

fn far(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn problem(case: &Value, range: [f64; 2]) -> Value {
    json!({
        "lambda": 1.0, "mu": 1.0, "load": case["f0"], "rate": case["f1"],
        "friction": case["F0"], "friction_rate": case["F1"], "range": range,
    })
}

/// The six examples of the talk with their ranges.
const EXAMPLES: [(&str, [f64; 2]); 6] = [
    ("p1_ex1", [-0.5, 10.0]),
    ("p1_ex2", [-0.5, 10.0]),
    ("p1_ex3", [-0.5, 10.0]),
    ("p1_ex4", [-0.5, 10.0]),
    ("p2_ex1", [-0.5, 10.0]),
    ("p2_ex2", [-6.0, 10.0]),
];

fn case(name: &str) -> Value {
    let text = include_str!("../../tests/data/seed_examples.json");
    let file: Value = serde_json::from_str(text).unwrap();
    let cases = file["cases"].as_array().unwrap();
    cases.iter().find(|c| c["name"] == name).unwrap().clone()
}

fn diagram(problem: &Value) -> Value {
    ask(&json!({"ask": "diagram", "problem": problem}))
}

#[test]
fn the_six_diagrams_have_the_vertices_of_exact_arithmetic() {
    for (name, range) in EXAMPLES {
        let case = case(name);
        let found = diagram(&problem(&case, range));
        let words = found["completeness"].as_str().unwrap();
        assert!(!words.starts_with("incomplete"), "{name}: {words}");
        let events: Vec<&Value> = (found["vertices"].as_array().unwrap().iter())
            .filter(|v| v["number"].is_number())
            .collect();
        let exact = case["graph"]["vertices"].as_array().unwrap();
        assert_eq!(events.len(), exact.len(), "{name}");
        for vertex in exact {
            let mut x = numbers(&vertex["u"]);
            x.extend(numbers(&vertex["lam_nu"]));
            x.extend(numbers(&vertex["lam_t"]));
            x.push(vertex["alpha"].as_f64().unwrap());
            let nearest = events
                .iter()
                .map(|v| far(&numbers(&v["x"]), &x))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest <= 1e-10, "{name}: {x:?} is {nearest:e} away");
        }
    }
}

#[test]
fn transitions_of_two_nodes_have_the_printed_theta() {
    // p = 2, Example 1: T1, T2, T3, printed with four decimals (truncated), for a load rounded to four decimals.
    let printed = [
        (1, [[0.4, -4.2834, 0.0], [1.3717, -9.4859, 5.2025]]),
        (2, [[0.4, -3.0019, -0.6407], [1.0513, -6.2056, 0.0]]),
        (3, [[0.0, -2.2278, -2.2278], [0.2578, -5.3667, -0.8]]),
    ];
    let pieces = [
        (json!(["stick", "stick"]), json!(["slip-", "stick"])),
        (json!(["slip-", "stick"]), json!(["slip-", "slip-"])),
        (json!(["slip-", "slip-"]), json!(["open", "slip-"])),
    ];
    let found = diagram(&problem(&case("p2_ex1"), [-0.5, 10.0]));
    for ((number, theta), (before, after)) in printed.iter().zip(pieces) {
        let vertices = found["vertices"].as_array().unwrap();
        let vertex = vertices.iter().find(|v| v["number"] == *number).unwrap();
        for (node, row) in theta.iter().enumerate() {
            let far = far(&numbers(&vertex["theta"][node]), row);
            assert!(far < 2.5e-4, "T{number}, node {node}: {far:e}");
        }
        assert_eq!(
            (&vertex["arms"][0], &vertex["arms"][1]),
            (&before, &after),
            "T{number}"
        );
    }
    assert_eq!(found["branches"].as_array().unwrap().len(), 2);
}

#[test]
fn lists_of_all_solutions_are_those_of_exact_arithmetic_and_proven() {
    let mut compared = 0;
    for (name, range) in EXAMPLES {
        let case = case(name);
        for (k, alpha) in numbers(&case["alphas"]).into_iter().enumerate() {
            let problem = problem(&case, range);
            let found = ask(&json!({"ask": "solutions", "problem": problem, "alpha": alpha}));
            let exact = case["solutions"][k].as_array().unwrap();
            // Transitions lie at fractions, which floating-point numbers do not represent exactly.
            let at_transition = exact.iter().any(|s| s["margin"] == 0.0);
            if at_transition || !found["continua"].as_array().unwrap().is_empty() {
                continue;
            }
            compared += 1;
            assert_eq!(found["completeness"], "complete", "{name} at {alpha}");
            let solutions = found["solutions"].as_array().unwrap();
            assert_eq!(solutions.len(), exact.len(), "{name} at {alpha}");
            for solution in exact {
                let u = numbers(&solution["u"]);
                let near = |s: &&Value| far(&numbers(&s["x"])[..u.len()], &u) < 1e-10;
                let same = solutions
                    .iter()
                    .find(near)
                    .unwrap_or_else(|| panic!("{name} at {alpha}: {u:?}"));
                assert!(same["det"].as_array().unwrap().contains(&solution["det_sign"]));
            }
        }
    }
    assert!(compared >= 30, "{compared}");
}

#[test]
fn the_vertical_segment_is_a_continuum() {
    let problem = problem(&case("p1_ex3"), [-0.5, 10.0]);
    let found = ask(&json!({"ask": "solutions", "problem": problem, "alpha": 2.0}));
    assert_eq!(found["continua"][0]["dimension"], 1);
    let edges = diagram(&problem);
    let vertical = |e: &&Value| e["vertical"] == true;
    assert_eq!(
        edges["edges"].as_array().unwrap().iter().filter(vertical).count(),
        1
    );
}

#[test]
fn points_are_described_by_the_problem() {
    let problem = problem(&case("p1_ex1"), [-0.5, 10.0]);
    // Slip at F = 3, from the reference: u = (0, 0.5), λ = (2, 6).
    let at = ask(&json!({"ask": "point", "problem": problem, "x": [0.0, 0.5, 2.0, 6.0, 3.0]}));
    assert_eq!(at["pieces"], json!(["slip+"]));
    assert!(far(&numbers(&at["theta"][0]), &[2.0, 0.5, 12.5]) < 1e-12);
    assert!(at["residual"].as_f64().unwrap() < 1e-12);
    let off = ask(&json!({"ask": "point", "problem": problem, "x": [0.0, 0.6, 2.0, 6.0, 3.0]}));
    assert!(off["residual"].as_f64().unwrap() > 0.05);
}

/// Corners of the triangles that the page draws, contact nodes first: (−1, 0) and (0, 0), or (0, 0) alone.
#[test]
fn the_drawn_triangles_have_the_stiffness_of_the_models() {
    let (lambda, mu) = (1.7, 0.6);
    let one = (
        1,
        vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        vec![vec![0, 1, 2]],
    );
    let mut corners = one.1.clone();
    corners.insert(0, [-1.0, 0.0, 0.0]);
    let two = (2, corners, vec![vec![0, 1, 3], vec![1, 2, 3]]);
    for (nodes, corners, triangles) in [one, two] {
        let cells = triangles.into_iter().map(|t| (CellKind::Triangle, t));
        let mut mesh = Mesh::new(2, corners, cells).unwrap();
        mesh.mark_boundary("clamped", |f| f.centre[0] > 0.4 && f.centre[1] > 0.4);
        let system = Elasticity::new(mesh, Material::lame(lambda, mu).unwrap())
            .fix("clamped")
            .assemble()
            .unwrap();
        let stiffness = system.stiffness();
        assert_eq!(system.num_free(), 2 * nodes);
        // u_ν = −u_y, u_t = u_x.
        let place = |k: usize| match k % 2 {
            0 => (system.dof(k / 2, 1).unwrap(), -1.0),
            _ => (system.dof(k / 2, 0).unwrap(), 1.0),
        };
        for k in 0..2 * nodes {
            // Open nodes: u_ν < 0, and A u is the load.
            let mut u: Vec<f64> = (0..2 * nodes)
                .map(|i| if i % 2 == 0 { -1.0 } else { 0.3 })
                .collect();
            u[k] -= 0.5;
            let load: Vec<f64> = (0..2 * nodes)
                .map(|i| {
                    let entry = |j: usize| {
                        let ((row, a), (column, b)) = (place(i), place(j));
                        a * b * stiffness.get(row, column) * u[j]
                    };
                    (0..2 * nodes).map(entry).sum()
                })
                .collect();
            let problem = json!({
                "lambda": lambda, "mu": mu, "load": load, "rate": vec![0.0; 2 * nodes],
                "friction": vec![0.5; nodes], "friction_rate": vec![0.0; nodes], "range": [0.0, 1.0],
            });
            let found = ask(&json!({"ask": "solutions", "problem": problem, "alpha": 0.5}));
            let same = |s: &Value| far(&numbers(&s["x"])[..2 * nodes], &u) < 1e-12;
            let solutions = found["solutions"].as_array().unwrap();
            assert!(solutions.iter().any(same), "{nodes} nodes, {u:?}: {solutions:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// One node compared with the closed forms of Hild and Renard: the same number of branches, and every point on one of them.
    #[test]
    fn diagrams_of_one_node_are_those_of_hild_and_renard(
        normal in -3.0..3.0, tangential in -6.0..6.0, lambda in 0.2..4.0, mu in 0.2..4.0,
    ) {
        let model = HildRenard::new(normal, tangential, lambda, mu).unwrap();
        let problem = json!({
            "lambda": lambda, "mu": mu, "load": [normal, tangential], "rate": [0.0, 0.0],
            "friction": [0.0], "friction_rate": [1.0], "range": [0.01, 12.0],
        });
        let found = diagram(&problem);
        let expected = model.branches();
        for edge in found["edges"].as_array().unwrap() {
            for point in edge["points"].as_array().unwrap() {
                let x = numbers(point);
                let near = expected.iter().any(|b| {
                    let y = model.solution(b.state, x[4]);
                    let inside = (b.interval.0 - 1e-9..=b.interval.1 + 1e-9).contains(&x[4]);
                    inside && far(&x[..4], &y) <= 1e-7 * (1.0 + y.iter().fold(0.0, |m: f64, v| m.max(v.abs())))
                });
                prop_assert!(near, "{x:?} is on none of {expected:?}");
            }
        }
        let two = model.case() == HildRenardCase::Two;
        let at_end = |b: &&Value| {
            let edges = b["edges"].as_array().unwrap();
            edges.iter().any(|e| !found["edges"][e.as_u64().unwrap() as usize]["points"].as_array().unwrap().is_empty())
        };
        let branches = found["branches"].as_array().unwrap().iter().filter(at_end).count();
        prop_assert!(branches == 1 || two, "{branches} branches");
    }

    /// Every question has an answer.
    #[test]
    fn nothing_panics(
        load in prop::collection::vec(-1e3..1e3, 0..6), friction in prop::collection::vec(-9.0..9.0, 0..4),
        range in (-3.0..3.0, -3.0..3.0), alpha in -5.0..5.0, lambda in -1.0..3.0, ask in 0..3,
    ) {
        let problem = json!({
            "lambda": lambda, "mu": 1.0, "load": load, "rate": load, "friction": friction,
            "friction_rate": friction, "range": [range.0, range.1],
        });
        let question = match ask {
            0 => json!({"ask": "diagram", "problem": problem}),
            1 => json!({"ask": "solutions", "problem": problem, "alpha": alpha}),
            _ => json!({"ask": "point", "problem": problem, "x": load}),
        };
        let answer: Value = serde_json::from_str(&semismooth_web::answer(&question.to_string())).unwrap();
        prop_assert!(answer["ok"].is_object() || answer["error"]["message"].is_string());
    }
}

#[test]
fn transition_sets_are_the_known_lines() {
    // λ = μ = 1, f_ν = 1.5: contact is lost where f_t = −2 f_ν, sliding begins where |f_t| = F f_ν, and at f_t = −3 all F ≥ 2 are
    // transitions; an open node never slides.
    let plane = json!({
        "lambda": 1.0, "mu": 1.0, "base": [1.5, 0.0], "direction": [0.0, 1.0], "weights": [1.0],
        "load": [-8.0, 8.0], "friction": [0.0, 6.0],
    });
    let found = ask(&json!({"ask": "transition_set", "plane": plane}));
    assert_eq!(found["notes"], json!([]));
    let lines = found["lines"].as_array().unwrap();
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    for line in lines {
        for point in line["points"].as_array().unwrap() {
            let [load, friction] = numbers(point).try_into().unwrap();
            let slides = load.abs() - 1.5 * friction;
            assert!(
                slides.abs() < 1e-8 || (load + 3.0).abs() < 1e-8,
                "({load}, {friction}) {line}"
            );
            if slides.abs() < 1e-8 {
                (left, right) = (left.min(load), right.max(load));
            }
        }
    }
    assert!(
        left < -7.9 && right > 7.9,
        "the lines reach from {left} to {right}"
    );
    // The line of lost contact runs along the axis of F.
    let lost = |line: &&Value| line["test"] == 0 && (numbers(&line["points"][0])[0] + 3.0).abs() < 1e-8;
    assert!(lines.iter().any(|l| lost(&l)), "{lines:?}");
    // Where F > 2 and f_t < 0 two solutions meet on the line.
    let folds = |line: &&Value| line["folds"].as_array().unwrap().iter().any(|f| *f == true);
    assert!(lines.iter().any(|l| folds(&l)));
    let mut seen: Vec<String> = Vec::new();
    for line in lines {
        let text = line["points"].to_string();
        assert!(!seen.contains(&text), "a line is given twice");
        seen.push(text);
    }
}

fn formula(equations: &[&str], at: f64) -> Value {
    json!({"ask": "formula", "formula": {"equations": equations, "range": [-1.0, 2.0], "at": at, "reach": 3.0, "diagram": true}})
}

#[test]
fn affine_formulas_are_listed_with_a_proof() {
    let found = ask(&formula(&["abs(x) = a", ""], 0.5));
    assert_eq!(found["unknowns"], 1);
    assert_eq!(found["solutions"]["completeness"], "complete");
    let mut x: Vec<f64> = found["solutions"]["solutions"]
        .as_array()
        .unwrap()
        .iter()
        .map(|s| numbers(&s["x"])[0])
        .collect();
    x.sort_by(f64::total_cmp);
    assert_eq!(x, [-0.5, 0.5]);
    // The fold is the kink at 0.
    assert!(far(&numbers(&found["diagram"]["folds"]), &[0.0]) < 1e-14);
    let vertices = found["diagram"]["vertices"].as_array().unwrap();
    let fold = vertices.iter().find(|v| v["kind"] == "fold").unwrap();
    assert_eq!(fold["number"], 1);
    let pieces: Vec<&Value> = fold["arms"].as_array().unwrap().iter().map(|a| &a[0]).collect();
    assert!(
        pieces.contains(&&json!("x ≥ 0")) && pieces.contains(&&json!("x ≤ 0")),
        "{pieces:?}"
    );
}

#[test]
fn constants_stand_for_numbers() {
    let with = |constants: Value| {
        let mut question = formula(&["k*max(x, gap) = a", ""], 2.0);
        question["formula"]["constants"] = constants;
        question
    };
    let found = ask(&with(json!({"k": 4.0, "gap": 0.25, "unused": 1.0})));
    assert_eq!(numbers(&found["solutions"]["solutions"][0]["x"]), [0.5, 2.0]);
    // Where a name is missing, it is named.
    assert!(
        refused(&with(json!({"k": 4.0})))["message"]
            .as_str()
            .unwrap()
            .contains("gap")
    );
    let many: serde_json::Map<_, _> = (0..13).map(|k| (format!("c{k}"), json!(1.0))).collect();
    refused(&with(Value::Object(many)));
    refused(&with(json!({"k": 1e300, "gap": 0.0})));
}

#[test]
fn formulas_within_each_other_are_read_as_they_are_meant() {
    // Precedence, right-associative powers, signs before powers, several arguments: (equation, its solution at a = 2).
    for (text, x) in [
        ("x = -2^2", -4.0),
        ("x = 2^3^2 - 500", 12.0),
        ("x = 8 / 4 / 2 - 1 * 3", -2.0),
        ("x = 2**-1", 0.5),
        ("x = max(1, a, 0.5) - min(3, 1e0, a)", 1.0),
        ("x = abs(max(-3, -a) - 1)", 3.0),
        ("x = 2 × (a − 1) · 1.5", 3.0),
        (
            "x - sqrt(a^2) = exp(ln(3)) - tan(pi/4) - cos(0) * sin(π/2) + tanh(0) - 1.5",
            1.5,
        ),
    ] {
        let found = ask(&formula(&[text, ""], 2.0));
        let solutions = found["solutions"]["solutions"].as_array().unwrap();
        assert_eq!(solutions.len(), 1, "{text}: {solutions:?}");
        assert!(
            (numbers(&solutions[0]["x"])[0] - x).abs() < 1e-12,
            "{text}: {solutions:?}"
        );
    }
}

#[test]
fn curved_formulas_are_searched_and_say_so() {
    // x³ − x = a folds at a = ±2/√27; with y = max(x, 0).
    let found = ask(&formula(&["x^3 - x = a", "y = max(x, 0)"], 0.0));
    assert_eq!(found["unknowns"], 2);
    assert_eq!(found["solutions"]["complete"], false);
    let words = found["solutions"]["completeness"].as_str().unwrap();
    assert!(words.starts_with("found 3, complete: unknown"), "{words}");
    let mut folds = numbers(&found["diagram"]["folds"]);
    folds.sort_by(f64::total_cmp);
    let exact = 2.0 / 27_f64.sqrt();
    assert!(far(&folds, &[-exact, exact]) < 1e-9, "{folds:?}");
    // The kink where x passes 0, at a = 0.
    let vertices = found["diagram"]["vertices"].as_array().unwrap();
    let kink = vertices.iter().find(|v| v["kind"] == "pass-through").unwrap();
    assert!(far(&numbers(&kink["x"]), &[0.0, 0.0, 0.0]) < 1e-9);
}

#[test]
fn mistakes_are_shown_where_they_are() {
    for (first, second, equation, from, to, words) in [
        ("x + ", "", 0, 4, 4, "expected at the end"),
        ("x = max(x", "", 0, 7, 8, "( is not closed"),
        ("2x", "", 0, 1, 2, "operator is missing before x"),
        ("x)", "", 0, 1, 2, "nothing was opened"),
        ("x = y", "", 0, 4, 5, "y is unknown"),
        ("x", "y = foo(x)", 1, 4, 7, "foo is unknown"),
        ("x", "y # 2", 1, 2, 3, "# has no meaning"),
        ("x = 𝜆", "", 0, 4, 6, "unknown"),
        ("x^a", "", 0, 2, 3, "exponent is a number"),
        ("max(x) = 1", "", 0, 0, 3, "two arguments"),
        ("abs(x, 1)", "", 0, 0, 3, "one argument"),
        ("abs x", "", 0, 0, 3, "in parentheses"),
        ("|x|", "", 0, 0, 1, "abs("),
        ("x = 1 = a", "", 0, 6, 7, "one sign ="),
        ("x, a", "", 0, 1, 2, "comma"),
        ("x = 1.2.3", "", 0, 7, 9, "operator is missing"),
        ("x * / 2", "", 0, 4, 5, "expected before /"),
        ("", "y", 0, 0, 0, "expected at the end"),
    ] {
        let error = refused(&formula(&[first, second], 0.0));
        let message = error["message"].as_str().unwrap();
        assert!(message.contains(words), "{first:?}, {second:?}: {message}");
        let place = [&error["equation"], &error["from"], &error["to"]].map(|v| v.as_u64().unwrap());
        assert_eq!(place, [equation, from, to], "{first:?}, {second:?}: {message}");
    }
    let deep = "(".repeat(3000);
    assert!(
        refused(&formula(&[&deep, ""], 0.0))["message"]
            .as_str()
            .unwrap()
            .contains("400")
    );
    refused(&formula(&[&"(".repeat(300), ""], 0.0));
    refused(&formula(&[&"-".repeat(399), ""], 0.0));
    // Eleven kinks; equal ones would be one.
    let kinks: Vec<String> = (1..12).map(|k| format!("max(x,{k}*a)")).collect();
    refused(&formula(&[&kinks.join("+"), ""], 0.0));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn every_text_is_read_or_refused(text in "[xyaz0-9.e()+*/^,= maxbs|π𝜆-]{0,24}") {
        let answer = semismooth_web::answer(&formula(&[&text, "y = 0"], 0.0).to_string());
        let answer: Value = serde_json::from_str(&answer).unwrap();
        if let Some(from) = answer["error"]["from"].as_u64() {
            let to = answer["error"]["to"].as_u64().unwrap();
            prop_assert!(from <= to && to <= text.encode_utf16().count() as u64);
        } else {
            prop_assert!(answer["ok"].is_object() || answer["error"]["message"].is_string());
        }
    }
}

#[test]
fn questions_of_others_are_refused() {
    for question in [
        "",
        "{",
        "[]",
        r#"{"ask":"weather"}"#,
        r#"{"ask":"diagram"}"#,
        r#"{"ask":"solutions","problem":{},"alpha":1}"#,
    ] {
        let answer: Value = serde_json::from_str(&semismooth_web::answer(question)).unwrap();
        let message = answer["error"]["message"].as_str().unwrap();
        assert!(
            message.starts_with("the question is not understood: "),
            "{message}"
        );
    }
    let mut problem = problem(&case("p1_ex1"), [-0.5, 10.0]);
    problem["mu"] = json!(0.0);
    let error = refused(&json!({"ask": "diagram", "problem": problem}));
    assert_eq!(error["message"], "μ is 0; it must be between 1e-6 and 1e6");
}
