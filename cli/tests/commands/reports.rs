//! Reports from run files of each kind.

use semismooth::continuation::{Branch, ContinuationOptions, Direction};
use semismooth::piecewise::{Formula, Traced};

use crate::{folder, printed, refused, run_file, run_file_of};

/// The last table to copy, as rows of cells.
fn table(html: &str) -> Vec<Vec<String>> {
    let text = html.rsplit_once("<textarea").unwrap().1;
    let text = text
        .split_once(">\n")
        .unwrap()
        .1
        .split_once("</textarea>")
        .unwrap()
        .0;
    text.lines()
        .map(|row| row.split('\t').map(str::to_owned).collect())
        .collect()
}

#[test]
fn the_report_of_a_formula_is_its_curve() {
    let folder = folder("report of a formula");
    run_file_of(
        &folder,
        "follow",
        &[
            (
                "# constants = { k = 10.0, gap = 3.0 }",
                "constants = { k = 10.0, gap = 3.0 }",
            ),
            ("10*max(y - 3, 0)", "k*max(y - gap, 0)"),
        ],
    );
    assert_eq!(printed(&folder, &["report", "run.toml"]), "written: run.html\n");
    let html = std::fs::read_to_string(folder.join("run.html")).unwrap();
    let formula = Formula::read(
        &["y - 1.25*max(y - 1, 0) + 10*max(y - 3, 0) = load"],
        &["y", "load"],
    )
    .unwrap();
    let options = ContinuationOptions::default().with_parameter_range((0.0, 2.0));
    let branch = Branch::follow(&Traced::new(formula), &[0.0, 0.0], Direction::Increasing, options).unwrap();
    let expected = branch
        .vertices()
        .into_iter()
        .map(|v| format!("{:?},{:?},{}", v.x[1], v.x[0], v.event));
    let found = table(&html)
        .into_iter()
        .skip(1)
        .map(|r| format!("{},{},{}", r[1], r[3], r[2]));
    assert_eq!(found.collect::<Vec<_>>(), expected.collect::<Vec<_>>());
    assert!(html.contains("<h1>run</h1>") && html.contains("0 → y − 1"));
}

#[test]
fn run_files_of_diagrams_and_lists_have_reports() {
    let folder = folder("reports of lists");
    for command in ["diagram", "solutions"] {
        run_file_of(&folder, command, &[]);
        let page = format!("{command}.html");
        assert_eq!(
            printed(
                &folder,
                &["report", "run.toml", "-o", &page, "--title", "<A>", "-q"]
            ),
            ""
        );
        let html = std::fs::read_to_string(folder.join(page)).unwrap();
        assert!(html.contains("<h1>&lt;A&gt;</h1>"));
        // As the lists of the other command: none at −1, two at ½ and 2.
        for (load, count) in [("-1", "0"), ("0.5", "2"), ("2", "2")] {
            let row = format!("<td class=\"n\">{load}</td><td class=\"n\">{count}</td><td>proven");
            assert!(html.contains(&row), "{command}: {row}");
        }
    }
}

#[test]
fn a_mesh_has_reports_on_its_curve_and_on_a_history() {
    let folder = folder("reports of a mesh");
    let levels = "levels = [0.0, 0.25, 0.5, 0.75, 1.0, 0.5, 0.0, -0.5, -1.0]";
    run_file(&folder, &[("cells = [16, 8]", "cells = [4, 2]")]);
    printed(&folder, &["report", "run.toml"]);
    printed(&folder, &["contact", "run.toml", "--quiet"]);
    let html = std::fs::read_to_string(folder.join("run.html")).unwrap();
    let history = std::fs::read_to_string(folder.join("out/history.csv")).unwrap();
    let dissipated: Vec<&str> = history
        .lines()
        .skip(1)
        .map(|l| l.rsplit(',').next().unwrap())
        .collect();
    let rows = table(&html);
    let column = rows[0].iter().position(|n| n == "dissipated").unwrap();
    let found: Vec<&str> = rows[1..].iter().map(|r| r[column].as_str()).collect();
    assert_eq!(found, dissipated);
    assert!(
        html.contains("von Mises stress") && html.contains("<h2>First slip and lift-off of each node</h2>")
    );

    run_file(
        &folder,
        &[
            ("cells = [16, 8]", "cells = [4, 2]"),
            (levels, "follow = [0.0, 1.0]"),
        ],
    );
    printed(&folder, &["report", "run.toml"]);
    printed(&folder, &["contact", "run.toml", "--quiet"]);
    let html = std::fs::read_to_string(folder.join("run.html")).unwrap();
    let curve = std::fs::read_to_string(folder.join("out/curve.csv")).unwrap();
    let rows = table(&html);
    let lines = curve.lines().skip(1).map(|l| l.split(',').nth(1).unwrap());
    assert_eq!(
        rows[1..].iter().map(|r| r[1].as_str()).collect::<Vec<_>>(),
        lines.collect::<Vec<_>>()
    );
}

#[test]
fn what_has_no_report_is_said() {
    let folder = folder("no report");
    assert!(refused(&folder, &["report", "none.toml"]).contains("none.toml"));
    run_file_of(&folder, "follow", &[("range = [0.0, 2.0]", "")]);
    assert!(refused(&folder, &["report", "run.toml"]).contains("run.range"));
    run_file_of(
        &folder,
        "follow",
        &[(
            "unknowns = [\"y\"]",
            "unknowns = [\"y\"]\nconstants = { load = 1.0 }",
        )],
    );
    assert!(refused(&folder, &["report", "run.toml"]).contains("\"load\" is a variable and a constant"));
    run_file(&folder, &[("# route = \"auto\"", "route = \"reduced\"")]);
    assert!(
        refused(&folder, &["report", "run.toml"]).contains("run.route: reports need the condensed route")
    );
    assert!(!folder.join("run.html").exists());
}

#[test]
fn misspelt_commands_are_suggested() {
    let folder = folder("misspelt");
    for (word, command) in [
        ("folow", "follow"),
        ("fololw", "follow"),
        ("reprot", "report"),
        ("contct", "contact"),
    ] {
        let message = refused(&folder, &[word, "x"]);
        assert!(message.contains(&format!("did you mean {command}?")), "{message}");
    }
    // Names of problems are none.
    assert!(refused(&folder, &["knapsack"]).contains("knapsack.nl"));
    std::fs::write(folder.join("folow.nl"), "g3 0 1 0\n").unwrap();
    assert!(!refused(&folder, &["folow"]).contains("did you mean"));
}
