//! The program as AMPL starts it: arguments, environment, files, exit codes.

mod common;

use common::{header, to_binary};
use std::path::PathBuf;
use std::process::{Command, Output};

/// A separate folder for each test.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).unwrap();
    path
}

fn semismooth(arguments: &[&str], environment: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_semismooth"));
    command.args(arguments).env("semismooth_options", environment);
    command.output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// 0 ≤ x ⟂ x² − 2 ≥ 0.
fn root() -> String {
    header([1, 1, 0, 0, 1, 0, 0]) + "C0\no0\no5\nv0\nn2\nn-2\nr\n5 1 1\nb\n2 0\nk0\nJ0 1\n0 0\nx1\n0 1\n"
}

#[test]
fn a_stub_with_and_without_extension_is_solved_into_a_sol_file() {
    let folder = folder("stub");
    let stub = folder.join("root.of.two");
    std::fs::write(folder.join("root.of.two.nl"), root()).unwrap();
    for argument in [stub.display().to_string(), format!("{}.nl", stub.display())] {
        let _ = std::fs::remove_file(folder.join("root.of.two.sol"));
        let output = semismooth(&[&argument, "-AMPL", "tol=1e-11"], "outlev=0 max_iter=100");
        assert!(output.status.success() && output.stdout.is_empty() && output.stderr.is_empty());
        let sol = std::fs::read_to_string(folder.join("root.of.two.sol")).unwrap();
        let lines: Vec<&str> = sol.lines().collect();
        assert!(
            lines[0].starts_with("semismooth ") && lines[0].contains("Solved"),
            "{sol}"
        );
        assert_eq!(lines[1..10], ["", "Options", "3", "1", "1", "0", "1", "0", "1"]);
        assert_eq!((lines[10], lines[12]), ("1", "objno 0 0"));
        assert!((lines[11].parse::<f64>().unwrap() - 2.0_f64.sqrt()).abs() < 1e-10);
    }
}

#[test]
fn without_ampl_the_result_is_printed_and_no_file_written() {
    let folder = folder("print");
    let path = folder.join("a.nl");
    std::fs::write(&path, to_binary(&root(), false)).unwrap();
    let path = path.display().to_string();
    let output = semismooth(&[&path, "wantsol=2"], "");
    assert!(text(&output.stdout).contains("Solved: complementarity problem"));
    assert!(text(&output.stdout).contains("\nx[0] = 1.41421356"));
    assert!(!folder.join("a.sol").exists());
    let output = semismooth(&[&path], "wantsol 1 outlev 2");
    assert!(folder.join("a.sol").exists());
    assert!(text(&output.stdout).contains("  residual "));
    let output = semismooth(&["-s", &path], "wantsol=8");
    assert!(output.stdout.is_empty());
}

#[test]
fn what_is_not_understood_ends_in_exit_code_1_with_a_message() {
    let folder = folder("errors");
    let path = |name: &str| folder.join(name).display().to_string();
    std::fs::write(path("good.nl"), root()).unwrap();
    std::fs::write(path("bad.nl"), root().replace("o5", "o999")).unwrap();
    std::fs::write(
        path("integer.nl"),
        root().replace(" 0 0 0 0 0\n 1 0", " 1 0 0 0 0\n 1 0"),
    )
    .unwrap();
    std::fs::write(path("free.nl"), root().replace("5 1 1", "3")).unwrap();
    std::fs::write(
        path("logical.nl"),
        root().replacen(" 1 1 0 0 0 0", " 1 1 0 0 0 1", 1) + "L0\no23\nv0\nn1\n",
    )
    .unwrap();
    let (good, bad) = (path("good.nl"), path("bad.nl"));
    let table: [(&[&str], &str, &str); 12] = [
        (&[], "", "which problem?"),
        (&["-x", &good], "", "-x is not known"),
        (&[&path("none.nl"), "-AMPL"], "", "none.nl: "),
        (&[&bad, "-AMPL"], "", "bad.nl: line 13: operator o999"),
        (&[&good, "colour=blue"], "", "no option \"colour\""),
        (&[&good, "tol="], "", "option tol needs a value"),
        (&[&good, "tol=0"], "", "option tol=0 is out of range"),
        (
            &[&good],
            "max_iter=none",
            "in $semismooth_options: option max_iter=none",
        ),
        (&[&good, "objno=2"], "", "the problem has 0 objectives"),
        (&[&path("integer.nl")], "", "1 variables are integer"),
        (
            &[&path("free.nl")],
            "",
            "1 variables, 0 complementarities and 0 equations",
        ),
        (&[&path("logical.nl")], "", "1 constraints are logical"),
    ];
    for (arguments, environment, message) in table {
        let output = semismooth(arguments, environment);
        assert_eq!(output.status.code(), Some(1), "{arguments:?}");
        let error = text(&output.stderr);
        assert!(
            error.starts_with("semismooth: ") && error.contains(message),
            "{arguments:?}: {error}"
        );
        assert!(output.stdout.is_empty());
    }
    let left = std::fs::read_dir(&folder).unwrap();
    assert!(
        left.map(|e| e.unwrap().path())
            .all(|p| p.extension().unwrap() == "nl")
    );
}

#[test]
fn version_and_help_are_printed() {
    let version = text(&semismooth(&["-v"], "").stdout);
    assert_eq!(version.trim(), concat!("semismooth ", env!("CARGO_PKG_VERSION")));
    for flag in ["-=", "--help"] {
        let help = text(&semismooth(&[flag], "").stdout);
        for (name, _) in semismooth_cli::options::OPTIONS {
            assert!(help.contains(&format!("\n  {name} ")), "{name}");
        }
        assert!(help.lines().all(|l| l.chars().count() <= 100));
    }
}

#[test]
fn an_equation_that_a_bound_contradicts_is_not_solved() {
    let folder = folder("contradiction");
    let path = folder.join("a.nl");
    // x² = 2 with x fixed elsewhere, below, above; and where the bound is the root.
    for (bounds, code) in [
        ("4 3", 500),
        ("0 -1 1", 500),
        ("2 1.5", 500),
        ("0 0 1.5", 0),
        ("4 1.4142135623730951", 0),
    ] {
        let text = root()
            .replace("5 1 1", "4 0")
            .replace("b\n2 0", &format!("b\n{bounds}"));
        std::fs::write(&path, text).unwrap();
        let output = semismooth(&[&path.display().to_string(), "-AMPL"], "");
        assert!(output.status.success());
        let sol = std::fs::read_to_string(folder.join("a.sol")).unwrap();
        assert!(sol.ends_with(&format!("objno 0 {code}\n")), "{bounds}: {sol}");
        assert_eq!(sol.contains("Solved: system of equations"), code == 0, "{sol}");
    }
}

#[test]
fn a_fixed_variable_leaves_the_sign_that_its_condition_names() {
    let folder = folder("fixed");
    let path = folder.join("a.nl");
    // x = 1 with x² − 2 < 0: right at an upper bound, in doubt at a lower one alone.
    for (named, code) in [(1, 100), (2, 0), (3, 0)] {
        let text = root()
            .replace("5 1 1", &format!("5 {named} 1"))
            .replace("b\n2 0", "b\n4 1");
        std::fs::write(&path, text).unwrap();
        semismooth(&[&path.display().to_string(), "-AMPL"], "");
        let sol = std::fs::read_to_string(folder.join("a.sol")).unwrap();
        assert!(
            sol.ends_with(&format!("\n1.0\nobjno 0 {code}\n")),
            "{named}: {sol}"
        );
    }
}

#[test]
fn an_unnamed_bound_at_a_solution_is_told() {
    let folder = folder("doubt");
    let path = folder.join("a.nl");
    std::fs::write(&path, root().replace("b\n2 0", "b\n0 0 1")).unwrap();
    let output = semismooth(&[&path.display().to_string(), "-AMPL"], "");
    assert!(output.status.success());
    assert!(
        text(&output.stdout).contains("In doubt: variable 0 (from 0) rests at a bound that row 0 (from 0), ")
    );
    let sol = std::fs::read_to_string(folder.join("a.sol")).unwrap();
    assert!(sol.ends_with("\n1.0\nobjno 0 100\n"), "{sol}");
}

#[test]
fn variables_and_rows_are_called_by_their_names() {
    let folder = folder("names");
    let path = folder.join("a.nl");
    let argument = path.display().to_string();
    std::fs::write(folder.join("a.col"), "price[oil]\n").unwrap();
    std::fs::write(folder.join("a.row"), "market\n").unwrap();
    std::fs::write(&path, root().replace("b\n2 0", "b\n0 0 1")).unwrap();
    let message = text(&semismooth(&[&argument], "").stdout);
    assert!(
        message.contains("variable price[oil] rests at a bound that row market, "),
        "{message}"
    );
    std::fs::write(&path, root().replace("5 1 1", "2 0")).unwrap();
    let message = text(&semismooth(&[&argument], "").stderr);
    assert!(
        message.contains("1 inequalities complement no variable (the first is row market)"),
        "{message}"
    );
    // A logarithm of what is negative at every x.
    std::fs::write(&path, root().replace("o0\no5\nv0\nn2\nn-2", "o43\no1\nn-1\nv0")).unwrap();
    let message = text(&semismooth(&[&argument], "").stdout);
    assert!(
        message.contains("cannot be evaluated") && message.contains("belongs to row market"),
        "{message}"
    );
}

#[test]
fn limits_and_proofs_have_their_codes() {
    let folder = folder("codes");
    let path = folder.join("a.nl");
    let argument = path.display().to_string();
    // x ⟂ −1 has no solution; the limits are tested with the problem for √2.
    let nothing = root().replace("o0\no5\nv0\nn2\nn-2", "n-1");
    for (content, option, code) in [
        (root(), "max_iter=1", 400),
        (root(), "max_time=1e-9", 401),
        (nothing, "tol=1e-9", 200),
    ] {
        std::fs::write(&path, content).unwrap();
        let output = semismooth(&[&argument, "-AMPL", option], "");
        assert!(output.status.success());
        assert!(text(&output.stdout).contains("Not solved: "));
        let sol = std::fs::read_to_string(folder.join("a.sol")).unwrap();
        assert!(sol.ends_with(&format!("objno 0 {code}\n")), "{option}: {sol}");
    }
}

#[test]
fn points_where_an_operand_is_undefined_are_no_solutions() {
    let folder = folder("undefined");
    let path = folder.join("a.nl");
    let argument = path.display().to_string();
    let equation = root().replace("5 1 1", "4 0").replace("b\n2 0", "b\n3");
    // x + (√(x − 2) < 1) = 0 and x + √(x − 2)⁰ = 0, whose left sides are positive where they are defined; constants that are no numbers.
    for (body, code) in [
        ("o0\nv0\no22\no39\no1\nv0\nn2\nn1", 500),
        ("o0\nv0\no5\no39\no1\nv0\nn2\nn0", 500),
        ("o0\nv0\no43\nn-1", 503),
        ("o43\nn-1", 503),
        ("o2\no43\nn-1\nv0", 503),
    ] {
        std::fs::write(&path, equation.replace("o0\no5\nv0\nn2\nn-2", body)).unwrap();
        let output = semismooth(&[&argument, "-AMPL"], "");
        assert!(output.status.success(), "{}", text(&output.stderr));
        let sol = std::fs::read_to_string(folder.join("a.sol")).unwrap();
        assert!(sol.ends_with(&format!("objno 0 {code}\n")), "{body}: {sol}");
    }
}

/// x mod (⅓ mod x) + 2 x = ⅚: below x = ⅓ the slope is as large as 1 / (⅓ − x), but the left side is below ⅔ there, and ⅔ at x = ⅓.
#[test]
fn a_row_with_jumps_is_not_solved_by_its_slopes() {
    let folder = folder("jumps");
    let path = folder.join("a.nl");
    let argument = path.display().to_string();
    let text = header([1, 1, 0, 0, 1, 0, 0])
        + "C0\no4\nv0\no4\nn0.3333333333333333\nv0\nr\n4 0.8333333333333334\nb\n3\nk0\nJ0 1\n0 2\nx1\n0 -0.02\n";
    std::fs::write(&path, text).unwrap();
    semismooth(&[&argument, "-AMPL"], "");
    let sol = std::fs::read_to_string(folder.join("a.sol")).unwrap();
    assert!(sol.ends_with("objno 0 100\n"), "{sol}");
    assert!(sol.contains("row 0 (from 0), which has kinks or jumps"), "{sol}");
}

/// stackelberg1 of MacMPEC: min ½ x² + ½ x y − 95 x with 0 ≤ y ⟂ 2 y + ½ x − 100 ≥ 0 and 0 ≤ x ≤ 200 has x = 280/3, y = 80/3. With another row on
/// both variables it is refused.
#[test]
fn programs_with_equilibrium_constraints() {
    let folder = folder("mpec");
    let objective = "O0 0\no0\no2\nn0.5\no5\nv0\nn2\no2\nn0.5\no2\nv0\nv1\n";
    let bounds = "b\n0 0 200\n2 0\nk1\n";
    let rest = "J0 2\n0 0.5\n1 2\nG0 2\n0 -95\n1 0\nx2\n0 50\n1 1\n";
    let plain =
        header([2, 1, 1, 0, 2, 2, 0]) + "C0\nn-100\n" + objective + "r\n5 1 2\n" + bounds + "1\n" + rest;
    std::fs::write(folder.join("a.nl"), plain).unwrap();
    let path = folder.join("a.nl").display().to_string();
    let output = semismooth(&[&path, "-AMPL"], "");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let sol = std::fs::read_to_string(folder.join("a.sol")).unwrap();
    assert!(
        sol.contains("Stationary in the sense of Clarke") && sol.contains("has not been decided"),
        "{sol}"
    );
    let lines: Vec<&str> = sol.lines().collect();
    assert_eq!(lines.last(), Some(&"objno 0 0"));
    let values: Vec<f64> = lines[lines.len() - 3..lines.len() - 1]
        .iter()
        .map(|v| v.parse().unwrap())
        .collect();
    assert!(
        (values[0] - 280.0 / 3.0).abs() < 1e-4 && (values[1] - 80.0 / 3.0).abs() < 1e-4,
        "{sol}"
    );
    // The limit of time holds within solves of the lower level, too, the first one included.
    assert!(
        semismooth(&[&path, "-AMPL", "max_time=1e-9"], "")
            .status
            .success()
    );
    let sol = std::fs::read_to_string(folder.join("a.sol")).unwrap();
    assert!(
        sol.contains("the start, which is returned") && sol.ends_with("objno 0 401\n"),
        "{sol}"
    );
    // x + y ≤ 100.
    let coupled = header([2, 2, 1, 0, 4, 2, 0])
        + "C0\nn-100\nC1\nn0\n"
        + objective
        + "r\n5 1 2\n1 100\n"
        + bounds
        + "2\n"
        + "J1 2\n0 1\n1 1\n"
        + rest;
    std::fs::write(folder.join("b.nl"), coupled).unwrap();
    let output = semismooth(&[&folder.join("b.nl").display().to_string(), "-AMPL"], "");
    let error = text(&output.stderr);
    assert!(
        !output.status.success() && error.contains("MPEC") && error.contains("row 1"),
        "{error}"
    );
}
