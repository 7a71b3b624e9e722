//! The commands as users start them: run files, results, exit codes.

mod large;
mod matrices;
mod problems;
mod reports;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use semismooth::contact::{
    CondensedContact, ContactBody, EvolutionOptions, FrictionCoefficient, PlanarCoulomb, evolve,
};
use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
use semismooth::interface::LoadPath;

/// An empty folder for each test.
fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("commands").join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

fn semismooth(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_semismooth"));
    command.args(arguments).current_dir(folder).output().unwrap()
}

/// The output of a command that succeeds.
fn printed(folder: &Path, arguments: &[&str]) -> String {
    let output = semismooth(folder, arguments);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(output.stderr.is_empty());
    String::from_utf8(output.stdout).unwrap()
}

/// The message of a command that fails.
fn refused(folder: &Path, arguments: &[&str]) -> String {
    let output = semismooth(folder, arguments);
    assert_eq!(output.status.code(), Some(1));
    String::from_utf8(output.stderr).unwrap()
}

/// The run file that `init` writes for a body in contact, changed.
fn run_file(folder: &Path, changes: &[(&str, &str)]) {
    run_file_of(folder, "contact", changes);
}

/// The run file that `init` writes for a command, changed.
fn run_file_of(folder: &Path, command: &str, changes: &[(&str, &str)]) {
    let _ = std::fs::remove_file(folder.join("run.toml"));
    printed(folder, &["init", command, "run.toml"]);
    let mut text = std::fs::read_to_string(folder.join("run.toml")).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    std::fs::write(folder.join("run.toml"), text).unwrap();
}

fn table(path: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(path).unwrap();
    let words = |l: &str| l.split(',').map(str::to_owned).collect();
    text.lines().map(words).collect()
}

/// The block of the run file, built with the library.
fn block(friction: f64) -> CondensedContact<PlanarCoulomb> {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [16, 8]).unwrap();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| -0.02)
        .assemble()
        .unwrap();
    let load = LoadPath::affine(system.supports(), system.motion("top", 0, |_| 0.05).unwrap());
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let body = ContactBody::new(system.stiffness().clone(), rows.normal, rows.tangential, load)
        .unwrap()
        .with_gap(rows.gap)
        .unwrap();
    let law = PlanarCoulomb::new(FrictionCoefficient::constant(friction).unwrap());
    CondensedContact::new(body, law).unwrap()
}

#[test]
fn a_history_is_that_of_the_library() {
    let folder = folder("history");
    run_file(&folder, &[]);
    let text = printed(&folder, &["contact", "run.toml"]);
    assert!(text.lines().all(|l| l.chars().count() <= 100), "{text}");
    let mut problem = block(0.4);
    let start = problem.solve(0.0, None).unwrap();
    let levels = [0.25, 0.5, 0.75, 1.0, 0.5, 0.0, -0.5, -1.0];
    let steps = evolve(
        &mut problem,
        &start,
        &levels,
        &EvolutionOptions::default(),
        |_| ControlFlow::Continue(()),
    )
    .unwrap();
    let rows = table(&folder.join("out/history.csv"));
    assert_eq!(rows.len(), 1 + steps.len());
    let column = |name: &str| rows[0].iter().position(|n| n == name).unwrap();
    let mut dissipated = 0.0;
    for (row, step) in rows[1..].iter().zip(&steps) {
        let number = |name: &str| row[column(name)].parse::<f64>().unwrap();
        assert_eq!(number("level"), step.level);
        assert_eq!(number("slip"), step.solution.slip() as f64);
        assert_eq!(number("tangential force 1"), step.solution.resultant()[1]);
        assert_eq!(number("work"), step.work);
        let balance = number("work") - number("stored") - number("dissipated");
        assert!(row[column("arrival")] != "followed" || balance.abs() < 1e-12 * step.solution.energy.stored);
        dissipated += number("dissipated");
    }
    assert!(dissipated > 1e-5, "{dissipated:e}");
    let series = std::fs::read_to_string(folder.join("out/history.pvd")).unwrap();
    assert_eq!(series.matches("level_").count(), 9);
    assert!(folder.join("out/level_0008.vtu").exists());
    // Each level has a picture with the states of its nodes.
    assert!(text.contains("history.pvd, level_*.svg"), "{text}");
    for (k, step) in steps.iter().enumerate() {
        let picture = folder.join(format!("out/level_{:04}.svg", k + 1));
        let picture = std::fs::read_to_string(picture).unwrap();
        let (stick, slip) = (step.solution.stick() > 0, step.solution.slip() > 0);
        assert_eq!(
            (picture.contains(">stick<"), picture.contains(">slip<")),
            (stick, slip)
        );
        assert!(picture.contains(&format!("α = {}, displacements × ", step.level)));
    }
    // Objects with the same numbers.
    let text = printed(&folder, &["contact", "run.toml", "--json", "--out", "elsewhere"]);
    let last: serde_json::Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    assert_eq!(last["dissipated"], steps[7].dissipated);
    assert!(folder.join("elsewhere/history.csv").exists());
    assert!(printed(&folder, &["contact", "run.toml", "-q"]).is_empty());
}

#[test]
fn friction_may_fall_with_the_slip_that_has_gone_before() {
    let folder = folder("weakening");
    let mut forces = Vec::new();
    for friction in [
        "friction = 0.4\n",
        "friction_by_slip = [[0.0, 0.4], [0.1, 0.1]]\n",
        "friction = 0.1\n",
    ] {
        run_file(
            &folder,
            &[
                ("friction = 0.4\n", friction),
                ("# fields = true ", "fields = false "),
                ("# pictures = true ", "pictures = false "),
            ],
        );
        printed(&folder, &["contact", "run.toml"]);
        let rows = table(&folder.join("out/history.csv"));
        forces.push(rows[4][7].parse::<f64>().unwrap());
    }
    assert!(!folder.join("out/history.pvd").exists() && !folder.join("out/level_0000.svg").exists());
    // At the level α = 1 the friction force lies between those of the initial and of the final coefficient.
    assert!(forces[0] > forces[1] && forces[1] > forces[2], "{forces:?}");
}

#[test]
fn a_curve_lists_every_change_of_state() {
    let folder = folder("curve");
    let follow = [("levels = ", "# levels = "), ("# follow = ", "follow = ")];
    run_file(&folder, &follow);
    let text = printed(&folder, &["contact", "run.toml"]);
    let problem = block(0.4);
    let start = problem.solve(0.0, None).unwrap();
    use semismooth::continuation::{Branch, ContinuationOptions, Direction};
    let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
    let branch = Branch::follow(&problem, &start, Direction::Increasing, options).unwrap();
    let changes: usize = branch
        .transitions
        .iter()
        .map(|t| t.sites.iter().filter(|s| s.from != s.to).count())
        .sum();
    assert!(changes > 5);
    assert_eq!(text.lines().filter(|l| l.starts_with("α = ")).count(), changes);
    assert!(text.contains(&format!(
        "{changes} changes of state; the curve ends: bound of the parameter"
    )));
    for file in ["curve.csv", "curve.svg", "end.vtu", "end.svg"] {
        assert!(folder.join("out").join(file).exists(), "{file}");
    }
}

/// A block in space, with another coefficient across, sheared across: it slips where the isotropic one sticks.
#[test]
fn bodies_in_space_have_two_tangents() {
    let folder = folder("space");
    let mut slips = Vec::new();
    for across in ["", "friction_across = 0.05\n"] {
        run_file(
            &folder,
            &[
                (
                    "lower = [0.0, 0.0], upper = [2.0, 1.0], cells = [16, 8]",
                    "lower = [0, 0, 0], upper = [2, 2, 1], cells = [4, 4, 2]",
                ),
                ("value = [0.0, -0.02]", "value = [0.0, 0.0, -0.02]"),
                ("grows = [0.05, 0.0]", "grows = [0.0, 0.01, 0.0]"),
                (
                    "point = [0.0, 0.0]\nnormal = [0.0, 1.0]",
                    "point = [0.0, 0.0, 0.0]\nnormal = [0.0, 0.0, 1.0]",
                ),
                ("friction = 0.4\n", &format!("friction = 0.9\n{across}")),
            ],
        );
        printed(&folder, &["contact", "run.toml"]);
        let rows = table(&folder.join("out/history.csv"));
        slips.push(rows[4][3].parse::<usize>().unwrap());
    }
    assert!(slips[0] < 25 && slips[1] == 25, "{slips:?}");
}

#[test]
fn what_is_wrong_is_named_with_file_line_and_key() {
    let folder = folder("wrong");
    let cases: &[(&str, &str, &[&str])] = &[
        (
            "facets = \"bottom\"",
            "facets = \"botom\"",
            &["line 59", "contact", "botom", "\"bottom\""],
        ),
        (
            "facets = \"top\"",
            "facets = \"roof\"",
            &["line 29", "support", "roof"],
        ),
        (
            "levels = [0.0, 0.25",
            "levels = [nan, 0.25",
            &["line 82", "run.levels", "NaN is not finite"],
        ),
        (
            "value = [0.0, -0.02]",
            "value = [inf, -0.02]",
            &["line 29", "support.value", "inf is not finite"],
        ),
        ("young = 1.0\n", "young = -1.0\n", &["line 12", "material", "-1"]),
        ("young = 1.0\n", "young = \"a\"\n", &["line 13", "young"]),
        ("young = 1.0\n", "jung = 1.0\n", &["line 13", "jung", "young"]),
        ("young = 1.0\n", "", &["line 12", "missing", "young"]),
        (
            "value = [0.0, -0.02]",
            "value = [0.0]",
            &["line 29", "support.value", "1 numbers, expected 2"],
        ),
        (
            "# components = [\"x\", \"y\"]",
            "components = [\"z\", \"y\"]",
            &["support.components", "no z"],
        ),
        ("cells = [16, 8]", "cells = [16]", &["line 8", "mesh.block"]),
        (
            "cells = [16, 8]",
            "cells = [0, 8]",
            &["line 8", "mesh.block", "at least one cell"],
        ),
        (
            "normal = [0.0, 1.0]",
            "normal = [0.0, 0.0]",
            &["line 59", "contact"],
        ),
        (
            "point = [0.0, 0.0]\n",
            "",
            &["line 59", "contact", "a point and a normal"],
        ),
        (
            "friction = 0.4\n",
            "",
            &["line 59", "one of friction and friction_by_slip"],
        ),
        (
            "friction = 0.4\n",
            "friction = -0.4\n",
            &["line 59", "contact.friction", "-0.4"],
        ),
        (
            "friction = 0.4\n",
            "friction = 0.4\nfriction_across = 0.1\n",
            &["one tangent"],
        ),
        ("levels = [0.0,", "levels = [nan,", &["NaN"]),
        (
            "levels = ",
            "# levels = ",
            &["line 82", "run", "one of levels and follow"],
        ),
        ("[[support]]", "[[tension]]", &["tension"]),
        (
            "# file = \"body.msh\"",
            "file = \"body.msh\"",
            &["mesh", "one of file and block"],
        ),
        (
            "block = { lower = [0.0, 0.0], upper = [2.0, 1.0], cells = [16, 8] }",
            "file = \"none.msh\"",
            &["line 8", "mesh.file", "none.msh"],
        ),
        (
            "# components = [\"x\", \"y\"]",
            "components = [\"y\"]",
            &["support.value"],
        ),
        ("# order = 1", "order = 3", &["mesh.order", "1 or 2"]),
        (
            "# [[point]]\n# name = \"corner\"\n# at = [2.0, 0.0]",
            "[[point]]\nname = \"corner\"\nat = [2.0, 0.1]",
            &["point.at", "no node", "[2.0, 0.125]"],
        ),
        (
            "facets = \"top\"",
            "nodes = \"top\"",
            &["support", "no group \"top\" of nodes"],
        ),
        (
            "# [[spring]]\n# nodes = \"corner\"\n# to = \"other corner\"\n# stiffness = [1.0, 0.0]",
            "[[spring]]\nnodes = \"edge\"\nstiffness = [1.0, 0.0]",
            &["spring", "no group \"edge\" of nodes"],
        ),
        (
            "# [[elastic_foundation]]\n# facets = \"right\"\n# normal = 1.0",
            "[[elastic_foundation]]\nfacets = \"right\"\nnormal = -1.0",
            &["elastic_foundation", "-1"],
        ),
        (
            "# [[force]]\n# nodes = \"corner\"",
            "[[force]]\nnodes = \"edge\"",
            &["force.value", "no group \"edge\" of nodes"],
        ),
        ("[run]", "[run", &["line 82"]),
    ];
    for (from, to, expected) in cases {
        run_file(&folder, &[(from, to)]);
        let message = refused(&folder, &["contact", "run.toml"]);
        assert!(
            message.starts_with("semismooth: run.toml") || message.contains("NaN"),
            "{message}"
        );
        for word in *expected {
            assert!(
                message.contains(word),
                "{from} → {to}: {word} is not in {message}"
            );
        }
    }
    // The supports leave a translation along x.
    run_file(
        &folder,
        &[(
            "# components = [\"x\", \"y\"]       # all\nvalue = [0.0, -0.02]            # one number a component, 0 if left out\ngrows = [0.05, 0.0]",
            "components = [\"y\"]",
        )],
    );
    let message = refused(&folder, &["contact", "run.toml"]);
    assert!(message.contains("the body on its supports"), "{message}");
    assert!(refused(&folder, &["contact", "absent.toml"]).contains("absent.toml"));
    // Existing files are not overwritten.
    assert!(refused(&folder, &["init", "contact", "run.toml"]).contains("run.toml"));
    assert_eq!(semismooth(&folder, &["contact"]).status.code(), Some(2));
}

#[test]
fn friction_problems_are_judged_by_their_residuals() {
    let folder = folder("friction");
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/data/NESpheres_30_1.json");
    let shipped = shipped.display().to_string();
    assert!(printed(&folder, &["friction", &shipped]).contains("solved"));
    let text = printed(&folder, &["friction", "--json", &shipped]);
    let found: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(found["status"] == "solved" && found["residual"].as_f64().unwrap() <= 1e-12);
    // Quiet runs print nothing.
    assert!(printed(&folder, &["friction", "-q", &shipped]).is_empty());
    // Tables with the same numbers, complementary at each contact.
    printed(&folder, &["friction", "--out", "tables", &shipped, &shipped]);
    let rows = table(&folder.join("tables/problems.csv"));
    assert!(rows.len() == 3 && rows[1][2] == "solved", "{rows:?}");
    let contacts = table(&folder.join("tables/contacts_0001.csv"));
    assert_eq!(
        contacts[0],
        ["contact", "state", "r N", "r T1", "r T2", "u N", "u T1", "u T2"]
    );
    assert_eq!(contacts.len(), 1 + found["r"].as_array().unwrap().len() / 3);
    let count = |state: &str| contacts[1..].iter().filter(|c| c[1].starts_with(state)).count();
    for state in ["open", "stick", "slip"] {
        assert_eq!(found[state], count(state));
    }
    for (k, row) in contacts[1..].iter().enumerate() {
        let [r, u] = [2, 5].map(|c| row[c].parse::<f64>().unwrap());
        assert_eq!(
            (found["r"][3 * k].as_f64(), found["u"][3 * k].as_f64()),
            (Some(r), Some(u))
        );
        assert!(row[1] == "open" || u.abs() < 1e-12, "{row:?}");
        assert!(row[1] != "open" || r.abs() < 1e-12, "{row:?}");
    }
    let message = refused(&folder, &["friction", "--seconds", "0", &shipped, &shipped]);
    assert!(message.contains("2 of 2 problems are not solved"), "{message}");
    assert!(refused(&folder, &["friction", "absent.json"]).contains("absent.json"));
    assert!(refused(&folder, &["friction", "--seconds", "nan", &shipped]).contains("--seconds NaN"));
}

/// The block in the plane has 26 unknowns: rows of its tables are cut or wrapped.
#[test]
fn nothing_is_wider_than_a_hundred_columns() {
    let folder = folder("columns");
    let narrow = |text: &str| {
        let wide = text.lines().find(|l| l.chars().count() > 100);
        assert_eq!(wide, None);
    };
    narrow(&printed(&folder, &["--help"]));
    for kind in [
        "contact",
        "continuation",
        "delassus",
        "diagram",
        "enumeration",
        "mcp",
        "newton",
        "search",
    ] {
        narrow(&printed(&folder, &["options", kind]));
    }
    for command in ["follow", "diagram", "solutions"] {
        run_file_of(&folder, command, &[]);
        narrow(&printed(&folder, &[command, "run.toml"]));
        let discrete = problems::discrete();
        let mut changes: Vec<(&str, &str)> = discrete.iter().map(|(a, b)| (*a, b.as_str())).collect();
        match command {
            "follow" => {}
            "diagram" => changes.extend([
                ("sections = [-1.0, 0.5, 2.0]", "sections = [0.5]"),
                ("range = [-2.0, 3.0]", "range = [0.4, 0.6]"),
            ]),
            _ => changes.push(("at = [-1.0, 0.5, 2.0]", "at = [0.5]")),
        }
        run_file_of(&folder, command, &changes);
        let text = printed(&folder, &[command, "run.toml"]);
        narrow(&text);
        assert!(command == "follow" || text.contains(" …"), "{text}");
    }
}

/// Nothing is printed in colours, even if the environment requests them; this satisfies NO_COLOR.
#[test]
#[cfg(target_os = "linux")]
fn no_colours_are_printed() {
    let folder = folder("colours");
    run_file_of(&folder, "follow", &[]);
    let program = env!("CARGO_BIN_EXE_semismooth");
    for line in [
        "follow run.toml",
        "follow absent.toml",
        "--help",
        "follow --help",
        "follow --wrong",
    ] {
        for (name, value) in [("NO_COLOR", "1"), ("CLICOLOR_FORCE", "1")] {
            // `script` provides a terminal, in which the progress bar is drawn.
            let output = Command::new("script")
                .args([
                    "--quiet",
                    "--return",
                    "--command",
                    &format!("{program} {line}"),
                    "/dev/null",
                ])
                .env("TERM", "xterm-256color")
                .env(name, value)
                .current_dir(&folder)
                .output()
                .expect("`script` of util-linux");
            let text = String::from_utf8_lossy(&output.stdout);
            assert!(!text.is_empty());
            // "ESC [ numbers m" sets colours and weights.
            for sequence in text.split("\u{1b}[").skip(1) {
                let end = sequence.trim_start_matches(|c: char| c.is_ascii_digit() || c == ';');
                assert!(!end.starts_with('m'), "{line}: {text:?}");
            }
        }
    }
}

#[test]
fn shells_and_manuals_know_the_commands() {
    let folder = folder("help");
    let commands = semismooth_cli::commands::names();
    assert_eq!(commands.len(), 10);
    for arguments in [
        &["help"][..],
        &["--help"],
        &["completions", "bash"],
        &["completions", "zsh"],
        &["man"],
    ] {
        let text = printed(&folder, arguments);
        for word in &commands {
            assert!(text.contains(word), "{arguments:?}: {word}");
        }
    }
    // The manual has the options that each command has.
    let manual = printed(&folder, &["man"]).replace('\\', "");
    for command in &commands {
        let text = printed(&folder, &[command, "--help"]);
        assert!(text.lines().all(|l| l.chars().count() <= 100), "{text}");
        let title = format!(".SH \"SEMISMOOTH {}\"", command.to_uppercase());
        let section = manual.split(&title).nth(1).unwrap();
        let section = section.split(".SH \"").next().unwrap();
        let options = text.split_whitespace().filter(|w| w.starts_with("--"));
        for option in options {
            assert!(
                section.contains(option),
                "{command}: {option} is not in {section}"
            );
        }
    }
    // And the keys of their run files.
    for command in ["contact", "follow", "diagram", "solutions"] {
        printed(&folder, &["init", command]);
        let template = std::fs::read_to_string(folder.join(format!("{command}.toml"))).unwrap();
        for line in template.lines() {
            assert!(line.chars().count() <= 100, "{line}");
            assert!(manual.contains(&format!("&{line}\n")), "{command}: {line}");
        }
    }
    // A problem from AMPL may have the name of a command.
    let message = refused(&folder, &["contact", "-AMPL"]);
    assert!(message.contains("contact.nl"), "{message}");
}

/// Two squares in one Gmsh file, with one edge of the upper and two of the lower at their interface. Rollers at the left, where the
/// interface ends, leave a uniform stress σ = E ε/(1 − ν²).
#[test]
fn two_bodies_from_one_mesh_press_each_other() {
    let folder = folder("two_bodies");
    let points = [
        (0, 1),
        (2, 1),
        (2, 2),
        (0, 2),
        (0, 0),
        (1, 0),
        (2, 0),
        (0, 1),
        (1, 1),
        (2, 1),
    ];
    let mut text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n6\n".to_owned();
    for (number, name) in ["upper", "lower", "top", "base", "left"].iter().enumerate() {
        text += &format!("1 {} \"{name}\"\n", number + 1);
    }
    text += "2 6 \"all\"\n$EndPhysicalNames\n$Nodes\n10\n";
    for (k, (x, y)) in points.iter().enumerate() {
        text += &format!("{} {x} {y} 0\n", k + 1);
    }
    let edges = [
        (1, 1, 2),
        (2, 9, 8),
        (2, 10, 9),
        (3, 3, 4),
        (4, 5, 6),
        (4, 6, 7),
        (5, 4, 1),
        (5, 8, 5),
    ];
    text += "$EndNodes\n$Elements\n11\n";
    for (k, (group, a, b)) in edges.iter().enumerate() {
        text += &format!("{} 1 2 {group} {group} {a} {b}\n", k + 1);
    }
    text += "9 3 2 6 6 1 2 3 4\n10 3 2 6 6 5 6 9 8\n11 3 2 6 6 6 7 10 9\n$EndElements\n";
    std::fs::write(folder.join("two.msh"), text).unwrap();
    let roller = |facets: &str, component: &str| {
        format!("[[support]]\nfacets = \"{facets}\"\ncomponents = [\"{component}\"]\n\n")
    };
    let supports = format!("{}{}[contact]\n", roller("base", "y"), roller("left", "x"));
    run_file(
        &folder,
        &[
            (
                "block = { lower = [0.0, 0.0], upper = [2.0, 1.0], cells = [16, 8] }",
                "file = \"two.msh\"",
            ),
            (
                "# components = [\"x\", \"y\"]       # all\nvalue = [0.0, -0.02]",
                "components = [\"y\"]\nvalue = [-0.02]",
            ),
            ("grows = [0.05, 0.0]", "grows = [-0.02]"),
            ("[contact]\n", &supports),
            ("facets = \"bottom\"", "facets = \"upper\"\nagainst = \"lower\""),
            ("point = [0.0, 0.0]\nnormal = [0.0, 1.0]\n", ""),
            (
                "levels = [0.0, 0.25, 0.5, 0.75, 1.0, 0.5, 0.0, -0.5, -1.0]",
                "levels = [0.0, 1.0]",
            ),
        ],
    );
    let exact = 2.0 * 0.02 / (1.0 - 0.3 * 0.3);
    let condensed = std::fs::read_to_string(folder.join("run.toml")).unwrap();
    for route in ["auto", "reduced"] {
        let own = condensed.replace("[run]\n", &format!("[run]\nroute = \"{route}\"\n"));
        std::fs::write(folder.join("run.toml"), own).unwrap();
        let text = printed(&folder, &["contact", "run.toml"]);
        assert!(
            text.starts_with(
                "tangents held at 1 contact node, as on planes of symmetry: symmetric solutions only\n"
            ),
            "{text}"
        );
        let rows = table(&folder.join("out/history.csv"));
        let column = rows[0].iter().position(|n| n == "normal force").unwrap();
        let force: f64 = rows.last().unwrap()[column].parse().unwrap();
        assert!((force - exact).abs() < 1e-9, "{route}: {force} {exact}");
    }
}

/// A block of second order, of Young's modulus 1, on a smooth table (ν = 0): springs of stiffness 2 at two corners and an elastic foundation
/// of 3 per length at the right, pulled at a corner, carry what is pulled.
#[test]
fn springs_and_foundations_carry_what_is_pulled() {
    let folder = folder("springs");
    run_file(
        &folder,
        &[
            ("# order = 1", "order = 2"),
            (
                "# [[point]]\n# name = \"corner\"\n# at = [2.0, 0.0]",
                "[[point]]\nname = \"corner\"\nat = [2.0, 0.0]\n[[point]]\nname = \"other corner\"\nat = [2.0, 1.0]",
            ),
            (
                "# components = [\"x\", \"y\"]       # all\nvalue = [0.0, -0.02]",
                "components = [\"y\"]\nvalue = [-0.02]",
            ),
            ("grows = [0.05, 0.0]", ""),
            (
                "# [[spring]]\n# nodes = \"corner\"\n# to = \"other corner\"\n# stiffness = [1.0, 0.0]",
                "[[spring]]\nnodes = \"corner\"\nstiffness = [2.0, 0.0]\n[[spring]]\nnodes = \"other corner\"\nstiffness = [2.0, 0.0]",
            ),
            (
                "# [[elastic_foundation]]\n# facets = \"right\"\n# normal = 1.0",
                "[[elastic_foundation]]\nfacets = \"right\"\nnormal = 3.0",
            ),
            (
                "# [[force]]\n# nodes = \"corner\"\n# value = [0.0, 0.0]\n# grows = [0.01, 0.0]",
                "[[force]]\nnodes = \"other corner\"\ngrows = [0.01, 0.0]",
            ),
            ("poisson = 0.3\n# plane", "poisson = 0.0\n# plane"),
            ("friction = 0.4\n", "friction = 0.0001\n"),
            (
                "levels = [0.0, 0.25, 0.5, 0.75, 1.0, 0.5, 0.0, -0.5, -1.0]",
                "levels = [0.0, 1.0]",
            ),
        ],
    );
    printed(&folder, &["contact", "run.toml"]);
    let rows = table(&folder.join("out/history.csv"));
    let number = |name: &str| {
        let column = rows[0].iter().position(|n| n == name).unwrap();
        rows.last().unwrap()[column].parse::<f64>().unwrap()
    };
    // The weight of the press, E ε, and friction at its bound, against the pull.
    assert!((number("normal force") - 0.04).abs() < 1e-4 && number("slip") == 17.0);
    assert!((number("tangential force 1").abs() - 1e-4 * number("normal force")).abs() < 1e-12);
}
