use std::path::{Path, PathBuf};

use semismooth::complementarity::{McpSolver, check_jacobian};

use crate::expressions::{Problem, parse, read};
use crate::support::residual;

fn files(folder: &str) -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/data")
        .join(folder);
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    files.sort();
    files
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn solutions_of(problem: &Problem, solver: &mut McpSolver) -> Vec<Vec<f64>> {
    let mut found: Vec<Vec<f64>> = Vec::new();
    for (label, start) in &problem.starts {
        let mut x = start.clone();
        let report = solver.solve(&problem.mcp, &mut x).unwrap();
        let place = format!("{}, start {label}", problem.name);
        assert!(report.is_solved(), "{place}: {:?}", report.status);
        let r = residual(&problem.mcp, &x);
        assert!(r <= 1e-9, "{place}: residual {r:e}");
        assert!((r - report.residual).abs() <= 1e-12 * (1.0 + r), "{place}");
        for i in 0..x.len() {
            assert!(
                problem.mcp.lower()[i] <= x[i] && x[i] <= problem.mcp.upper()[i],
                "{place}"
            );
        }
        if !found.iter().any(|s| distance(s, &x) <= 1e-5) {
            found.push(x);
        }
    }
    found
}

#[test]
fn every_start_of_every_file_is_solved() {
    let mut solver = McpSolver::default();
    let files = files("complementarity");
    assert_eq!(files.len(), 15);
    for file in files {
        let problem = read(&file).unwrap();
        assert!(problem.solvable, "{}", problem.name);
        let found = solutions_of(&problem, &mut solver);
        // Problems with a continuum list only some of its points; the third solution of coulomb_node is the end of a continuum.
        let isolated = !["mathiesen", "transmcp", "coulomb_node"].contains(&problem.name.as_str());
        for x in found {
            let known = problem
                .solutions
                .iter()
                .any(|s| distance(s, &x) <= 1e-4 * (1.0 + distance(s, &vec![0.0; s.len()])));
            assert!(known || !isolated, "{}: {x:?} is not on the list", problem.name);
        }
    }
}

#[test]
fn more_problems_of_the_literature_from_far_starts() {
    let mut solver = McpSolver::default();
    for file in files("mcp") {
        let problem = read(&file).unwrap();
        if problem.solvable {
            solutions_of(&problem, &mut solver);
            continue;
        }
        for (label, start) in &problem.starts {
            let report = solver.solve(&problem.mcp, &mut start.clone()).unwrap();
            assert!(
                !report.is_solved(),
                "{}, start {label}, has no solution",
                problem.name
            );
        }
    }
}

#[test]
fn distinct_solutions_are_found_from_distinct_starts() {
    let mut solver = McpSolver::default();
    for (name, least) in [("coulomb_node", 2), ("kojshin", 2)] {
        let path =
            Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/data/complementarity/{name}.json"));
        let found = solutions_of(&read(&path).unwrap(), &mut solver);
        assert!(found.len() >= least, "{name}: {found:?}");
    }
}

#[test]
fn derivatives_of_expressions_are_right() {
    for file in files("complementarity") {
        let problem = read(&file).unwrap();
        let x: Vec<f64> = (0..problem.mcp.len())
            .map(|i| 0.7 + 0.13 * (i % 7) as f64)
            .collect();
        check_jacobian(problem.mcp.function(), &x, 1e-6).unwrap();
    }
    let all = r#"{"n": 2, "lower": [0, null], "upper": [null, 5],
        "defs": [["*", ["v", 0], ["exp", ["v", 1]]], ["+", ["d", 0], ["sin", ["d", 0]]]],
        "rows": [["+", ["d", 1], ["/", ["v", 0], ["sqrt", ["v", 1]]], ["pow", ["v", 0], ["v", 1]], ["neg", ["cos", ["v", 0]]]],
                 ["+", ["^", ["d", 1], 1.5], ["log", ["d", 0]], ["lin", 1, [0, 1], [2, -3]], ["*", ["v", 0], ["v", 0], ["v", 1]]]],
        "starts": {"a": [1, 1]}}"#;
    let problem = parse(all, "all").unwrap();
    check_jacobian(problem.mcp.function(), &[0.8, 0.6], 1e-6).unwrap();
}

#[test]
fn malformed_files_are_refused_by_name() {
    let good =
        r#"{"n": 1, "lower": [0], "upper": [null], "defs": [], "rows": [["v", 0]], "starts": {"a": [1]}}"#;
    assert!(parse(good, "").is_ok());
    for (from, to, word) in [
        (r#""n": 1"#, r#""n": 0"#, "`n`"),
        (r#""n": 1"#, r#""n": 2"#, "lower"),
        (r#"[0], "upper""#, r#"["x"], "upper""#, "lower[0]"),
        (r#"[0], "upper": [null]"#, r#"[2], "upper": [1]"#, "lower[0] = 2"),
        (r#"["v", 0]"#, r#"["v", 1]"#, "rows[0]"),
        (r#"["v", 0]"#, r#"["foo", 1]"#, "foo"),
        (r#"["v", 0]"#, r#"["d", 0]"#, "defs"),
        (r#"["v", 0]"#, r#"["/", 1]"#, "arguments"),
        (r#"["v", 0]"#, r#"["lin", 1, [0], []]"#, "lin"),
        (r#""rows""#, r#""row""#, "`rows`"),
        (r#"{"a": [1]}"#, r#"{"a": [1, 2]}"#, "starts.a"),
        (r#"{"a": [1]}"#, "{}", "starts"),
        (r#"{"a": [1]}}"#, r#"{"a": [1]}"#, "EOF"),
    ] {
        let text = good.replace(from, to);
        let error = parse(&text, "")
            .err()
            .unwrap_or_else(|| panic!("{text} was accepted"));
        assert!(error.contains(word), "{text}: {error}");
    }
}

#[test]
fn shared_expressions_are_read_once_each() {
    use semismooth::complementarity::McpFunction;
    // A chain of sums that doubles 60 times: 2⁶⁰ x if it were written out.
    let defs: Vec<String> = (0..60).map(|k| format!(r#"["+",["d",{k}],["d",{k}]]"#)).collect();
    let text = format!(
        r#"{{"n":1,"lower":[0.0],"upper":[null],"defs":[["v",0],{}],"rows":[["d",60]],"starts":{{"a":[1.0]}}}}"#,
        defs.join(",")
    );
    let problem = parse(&text, "chain").unwrap();
    let function = problem.mcp.function();
    assert!(function.is_affine());
    let mut f = [0.0];
    function.value(&[3.0], &mut f);
    assert_eq!(f[0], 3.0 * 60f64.exp2());
    // A product of very many constants and one variable is affine, of two it is not.
    for (factors, affine) in [(r#"["v",0]"#, true), (r#"["v",0],["v",0]"#, false)] {
        let text = format!(
            r#"{{"n":1,"lower":[0.0],"upper":[null],"rows":[["*",{}{factors}]],"starts":{{"a":[1.0]}}}}"#,
            "1.0,".repeat(300)
        );
        assert_eq!(parse(&text, "").unwrap().mcp.function().is_affine(), affine);
    }
    // Whatever the error, the message does not repeat the text at length.
    let long = format!(r#"["{}"]"#, "x".repeat(200_000));
    let text = format!(r#"{{"n":1,"lower":[0.0],"upper":[null],"rows":[{long}],"starts":{{"a":[1.0]}}}}"#);
    assert!(parse(&text, "").err().unwrap().len() < 300);
}
