//! Folders of discrete problems with a broken description: the error names the file, and the line where there is one.
#![cfg(feature = "json")]

use std::path::{Path, PathBuf};

use semismooth::contact::read_folder;
use semismooth::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt};
use semismooth::sparse::read_matrix_market;

/// A copy of a valid folder, removed at the end.
struct Copy(PathBuf);

impl Copy {
    fn new(name: &str) -> Self {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/block_symmetric");
        let to = std::env::temp_dir().join(format!("semismooth_{name}_{}", std::process::id()));
        std::fs::create_dir_all(&to).unwrap();
        for file in std::fs::read_dir(from).unwrap() {
            let file = file.unwrap();
            std::fs::copy(file.path(), to.join(file.file_name())).unwrap();
        }
        Self(to)
    }
}

impl Drop for Copy {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn broken_descriptions_are_named() {
    let copy = Copy::new("meta");
    let whole = read_folder(&copy.0).unwrap();
    let p = whole.num_contacts();
    let read = |text: &str| {
        std::fs::write(copy.0.join("meta.json"), text).unwrap();
        read_folder(&copy.0)
    };
    for (text, words) in [
        (
            "{\n  \"friction\": 0.3,\n  \"r\" 1\n}",
            ["meta.json, line 3", "expected `:`"],
        ),
        ("{\n", ["meta.json, line 2", "EOF"]),
        (
            "{\"r\": 1}",
            ["meta.json", "`friction` must be a number or a list of numbers"],
        ),
        ("{\"friction\": \"low\"}", ["meta.json", "`friction` must be"]),
        ("{\"friction\": [0.1, null]}", ["meta.json", "`friction` must be"]),
        (
            "{\"friction\": 0.3, \"r\": \"one\"}",
            ["meta.json", "`r` must be a number"],
        ),
    ] {
        let error = read(text).unwrap_err().to_string();
        assert!(words.iter().all(|w| error.contains(w)), "{text}: {error}");
    }
    // One number stands for a list of equal ones; r is the problem's own choice unless given.
    let one = read("{\"friction\": 0.25}").unwrap();
    let list = read(&format!("{{\"friction\": {:?}, \"r\": 1}}", vec![0.25; p])).unwrap();
    assert_eq!(one.friction_at(0.5), vec![0.25; p]);
    assert_eq!(one.friction_at(0.5), list.friction_at(0.5));
    // Traces pick single displacements here, whose stiffness is an entry of the diagonal.
    let picked = ["Bnu.mtx", "Bt.mtx"].map(|name| read_matrix_market(copy.0.join(name)).unwrap());
    let columns = picked.iter().flat_map(|b| b.triplets().map(|(_, j, _)| j));
    let diagonal = columns.map(|j| {
        one.operator()
            .triplets()
            .find(|t| (t.0, t.1) == (j, j))
            .unwrap()
            .2
    });
    let quarter = diagonal.sum::<f64>() / (8 * p) as f64;
    assert!((one.r() - quarter).abs() < 1e-9 * quarter && list.r() == 1.0);
    let wrong = read(&format!("{{\"friction\": {:?}}}", vec![0.25; p + 1]));
    assert!(wrong.is_err());
    // A vector that is too short, or an entry that is not a number.
    std::fs::write(copy.0.join("meta.json"), "{\"friction\": 0.25}").unwrap();
    let f1 = std::fs::read_to_string(copy.0.join("f1.txt")).unwrap();
    let mut lines: Vec<&str> = f1.lines().collect();
    lines[1] = "zwei";
    std::fs::write(copy.0.join("f1.txt"), lines.join("\n")).unwrap();
    let error = read_folder(&copy.0).unwrap_err().to_string();
    assert!(error.contains("f1.txt") && error.contains("line 2"), "{error}");
    std::fs::write(copy.0.join("f1.txt"), "1.0\n2.0\n").unwrap();
    let error = read_folder(&copy.0).unwrap_err().to_string();
    assert!(error.contains("the load f1"), "{error}");
    std::fs::write(copy.0.join("f1.txt"), &f1).unwrap();
    // θ¹ = λν + r (u_ν − gap) at 0; without a file of gaps there are none.
    let first_tests = || {
        let problem = read_folder(&copy.0).unwrap().with_r(1.0).unwrap();
        let tests = problem.num_tests(0);
        let mut theta = vec![f64::NAN; tests * p];
        assert!(problem.reported_tests(&vec![0.0; problem.num_vars()], &mut theta));
        theta.into_iter().step_by(tests).collect::<Vec<_>>()
    };
    std::fs::write(copy.0.join("gap.txt"), "0.5\n".repeat(p)).unwrap();
    assert_eq!(first_tests(), vec![-0.5; p]);
    std::fs::remove_file(copy.0.join("gap.txt")).unwrap();
    assert_eq!(first_tests(), vec![0.0; p]);
}

#[test]
fn sizes_that_the_entries_do_not_bear_are_refused_before_anything_is_made() {
    let copy = Copy::new("sizes");
    let whole = read_folder(&copy.0).unwrap();
    let n = whole.num_displacements();
    for (file, text) in [
        ("Bnu.mtx", format!("16777000 {n} 0\n")),
        ("Bnu.mtx", format!("70000000 {n} 1\n1 1 1\n")),
        ("Bt.mtx", format!("16777000 {n} 1\n1 1 1\n")),
        ("A.mtx", "1000000 1000000 1\n1 1 1\n".to_owned()),
    ] {
        let path = copy.0.join(file);
        let own = std::fs::read_to_string(&path).unwrap();
        let head = "%%MatrixMarket matrix coordinate real general\n";
        std::fs::write(&path, format!("{head}{text}")).unwrap();
        let error = read_folder(&copy.0).unwrap_err().to_string();
        let reason = ["entries", "cannot be meant"].iter().any(|r| error.contains(r));
        assert!(error.contains(file) && reason, "{error}");
        std::fs::write(&path, own).unwrap();
    }
    assert!(read_folder(&copy.0).is_ok());
}
