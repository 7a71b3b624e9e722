//! Large bodies, solved in the displacements, and interrupted runs.

use std::path::Path;

use crate::{folder, printed, refused, run_file, table};

/// A solid in place of the rectangle.
const SOLID: [(&str, &str); 4] = [
    (
        "lower = [0.0, 0.0], upper = [2.0, 1.0], cells = [16, 8]",
        "lower = [0, 0, 0], upper = [2, 2, 1], cells = [6, 6, 3]",
    ),
    ("value = [0.0, -0.02]", "value = [0.0, 0.0, -0.02]"),
    ("grows = [0.05, 0.0]", "grows = [0.05, 0.02, 0.0]"),
    (
        "point = [0.0, 0.0]\nnormal = [0.0, 1.0]",
        "point = [0.0, 0.0, 0.0]\nnormal = [0.0, 0.0, 1.0]",
    ),
];

/// Under growing forces both routes give the same levels; quantities that only one of them computes are missing in the other.
#[test]
fn both_routes_have_the_same_forces() {
    let folder = folder("routes");
    let levels = (
        "levels = [0.0, 0.25, 0.5, 0.75, 1.0, 0.5, 0.0, -0.5, -1.0]",
        "levels = [0.0, 0.2, 0.5, 1.0]",
    );
    for solid in [false, true] {
        let mut tables = Vec::new();
        for route in ["condensed", "reduced"] {
            let own = format!("route = \"{route}\"");
            let mut changes = vec![levels, ("# route = \"auto\"", own.as_str())];
            changes.extend(SOLID.iter().filter(|_| solid));
            run_file(&folder, &changes);
            let text = printed(&folder, &["contact", "run.toml"]);
            assert!(text.lines().all(|l| l.chars().count() <= 100), "{text}");
            assert_eq!(
                text.contains("not followed between levels"),
                route == "reduced",
                "{text}"
            );
            assert!(folder.join("out/level_0003.vtu").exists());
            tables.push(table(&folder.join("out/history.csv")));
        }
        let [condensed, reduced] = tables.try_into().unwrap();
        assert_eq!((&condensed[0], condensed.len()), (&reduced[0], reduced.len()));
        assert_eq!(condensed.len(), 4);
        let column = |name: &str| condensed[0].iter().position(|n| n == name).unwrap();
        for (a, b) in condensed[1..].iter().zip(&reduced[1..]) {
            let number = |row: &[String], name: &str| row[column(name)].parse::<f64>().unwrap();
            assert_eq!(a[column("level")], b[column("level")]);
            assert_eq!(
                (b[column("arrival")].as_str(), b[column("work")].as_str()),
                ("solved", "")
            );
            let size = number(a, "normal force");
            for name in ["normal force", "tangential force 1", "tangential force 2"] {
                let apart = (number(a, name) - number(b, name)).abs();
                assert!(apart <= 1e-8 * size, "{name}: {apart:e} of {size:e}");
            }
            let apart = (number(a, "stored") - number(b, "stored")).abs();
            assert!(apart <= 1e-8 * 0.02 * size, "{apart:e}");
        }
    }
    // Curves need the condensed route.
    run_file(
        &folder,
        &[
            (
                "levels = [0.0, 0.25, 0.5, 0.75, 1.0, 0.5, 0.0, -0.5, -1.0]",
                "follow = [0.0, 1.0]",
            ),
            ("# route = \"auto\"", "route = \"reduced\""),
        ],
    );
    let message = refused(&folder, &["contact", "run.toml"]);
    assert!(
        message.contains("run.toml, line") && message.contains("run.route"),
        "{message}"
    );
}

/// A single Ctrl-C during a search for all solutions of forty equations with kinks: the run stops and reports it.
#[cfg(target_os = "linux")]
#[test]
fn one_interrupt_ends_a_search_for_all_solutions() {
    let n = 40;
    let names: Vec<String> = (0..n).map(|i| format!("\"x{i}\"")).collect();
    let equations: Vec<String> = (0..n)
        .map(|i| {
            let term = |k: usize| {
                let factor = ((i * 17 + k * 29 + i * k) % 19) as f64 / 9.0 - 1.0;
                format!("{factor:.1}*abs(x{})", (i * 5 + k * 3) % n)
            };
            let terms: Vec<String> = (0..14).map(term).collect();
            let constant = (i * 7 % 11) as f64 / 5.0 - 1.0;
            format!("\"x{i} + {} = a + {constant:.1}\"", terms.join(" + "))
        })
        .collect();
    let problem = format!(
        "[problem]\nunknowns = [{}]\nparameter = \"a\"\nequations = [{}]\n",
        names.join(", "),
        equations.join(",\n")
    );
    for (command, run) in [
        ("diagram", "range = [-1.0, 1.0]\nsections = [0.0]"),
        ("solutions", "at = [0.0]"),
    ] {
        let folder = folder(&format!("interrupted {command}"));
        std::fs::write(folder.join("run.toml"), format!("{problem}\n[run]\n{run}\n")).unwrap();
        let output = signalled(&folder, &[command, "run.toml"], ("INT", 2));
        let message = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(130), "{message}");
        assert!(message.contains("interrupted before the"), "{message}");
    }
}

/// A signal to terminate ends a history like Ctrl-C: its table has whole rows, and its picture is drawn.
#[cfg(target_os = "linux")]
#[test]
fn termination_leaves_whole_tables() {
    let folder = folder("terminated");
    let levels: Vec<String> = (0..100_000)
        .map(|k| format!("{:.1}", f64::from(k % 2) * 0.1))
        .collect();
    let changed = format!("levels = [{}]", levels.join(", "));
    run_file(
        &folder,
        &[
            (
                "levels = [0.0, 0.25, 0.5, 0.75, 1.0, 0.5, 0.0, -0.5, -1.0]",
                &changed,
            ),
            ("# fields = true ", "fields = false #"),
        ],
    );
    let output = signalled(&folder, &["contact", "run.toml", "--quiet"], ("TERM", 15));
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(130), "{message}");
    assert!(message.contains("interrupted after the level"), "{message}");
    let text = std::fs::read_to_string(folder.join("out/history.csv")).unwrap();
    let rows = table(&folder.join("out/history.csv"));
    assert!(text.ends_with('\n') && rows.iter().all(|row| row.len() == rows[0].len()));
    assert!(rows.len() > 1 && rows.len() < levels.len(), "{}", rows.len());
    assert!(folder.join("out/history.svg").exists());
}

/// The output of a command that gets a signal, by its name and number, a tenth of a second after it begins to handle it.
#[cfg(target_os = "linux")]
fn signalled(folder: &Path, arguments: &[&str], (name, number): (&str, u32)) -> std::process::Output {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};

    // Signal n is bit n − 1 of the mask.
    let handles = |id: u32| {
        let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap_or_default();
        let caught = status.lines().find_map(|l| l.strip_prefix("SigCgt:"));
        let mask = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
        mask.is_some_and(|m| m >> (number - 1) & 1 == 1)
    };
    let mut child = Command::new(env!("CARGO_BIN_EXE_semismooth"))
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let begun = Instant::now();
    while !handles(child.id()) && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(10));
    }
    std::thread::sleep(Duration::from_millis(100));
    assert!(
        child.try_wait().unwrap().is_none(),
        "{arguments:?}: it has ended by itself"
    );
    let signal = Command::new("kill")
        .args([&format!("-{name}"), &child.id().to_string()])
        .status();
    assert!(signal.unwrap().success());
    while child.try_wait().unwrap().is_none() {
        if begun.elapsed() > Duration::from_secs(120) {
            child.kill().unwrap();
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.wait_with_output().unwrap()
}
