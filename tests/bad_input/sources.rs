//! Errors that come from the operating system or from another library keep the original as their source.
#![cfg(feature = "json")]

use std::error::Error;
use std::io;
use std::path::PathBuf;

use semismooth::Cause;
use semismooth::InputError;
use semismooth::contact::{read_delassus, read_folder};
use semismooth::continuation::{Branch, ContinuationOptions, Direction, Event};
use semismooth::fem::{Mesh, read_gmsh};
use semismooth::linear::{LinearError, LinearSolver};
use semismooth::output::{JsonLinesWriter, write_csv, write_vtu};
use semismooth::sparse::{
    Matrix, MatrixRef, PatternRef, read_matrix_market, read_vector, write_matrix_market,
};

const MISSING: &str = "no/such/folder/file.vtu";

/// The first error of a type along the chain of sources.
fn along<'a, T: Error + 'static>(e: &'a (dyn Error + 'static)) -> Option<&'a T> {
    let e = e.source()?;
    e.downcast_ref().or_else(|| along(e))
}

fn has_kind<T>(made: Result<T, impl Error + 'static>, kind: io::ErrorKind) {
    let e = made.err().expect("refused");
    let source = along::<io::Error>(&e).unwrap_or_else(|| panic!("{e} has no source of the system"));
    assert_eq!(source.kind(), kind, "{e}");
    assert!(e.to_string().contains(&source.to_string()), "{e}");
}

#[test]
fn files_that_are_missing_come_with_the_error_of_the_system() {
    use io::ErrorKind::{InvalidInput, NotFound};
    let mesh = Mesh::rectangle([0.0; 2], [1.0; 2], [1, 1]).unwrap();
    has_kind(read_matrix_market(MISSING), NotFound);
    has_kind(read_vector(MISSING), NotFound);
    has_kind(write_matrix_market(MISSING, &Matrix::identity(1)), NotFound);
    has_kind(read_gmsh(MISSING), NotFound);
    has_kind(read_folder(MISSING), NotFound);
    has_kind(read_delassus(MISSING), NotFound);
    has_kind(write_vtu(MISSING, &mesh, &[], &[]), NotFound);
    has_kind(write_vtu("mesh.txt", &mesh, &[], &[]), InvalidInput);
}

#[test]
fn a_full_disk_is_recognised_by_its_kind() {
    struct Full;
    impl io::Write for Full {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::StorageFull.into())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let map = super::piecewise::vee();
    let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    let branch = Branch::follow(&map, &[0.5, 0.5], Direction::Decreasing, options).unwrap();
    has_kind(
        write_csv(&mut Full, &map, &branch, &[]),
        io::ErrorKind::StorageFull,
    );
    let mut lines = JsonLinesWriter::new(Full, &map);
    has_kind(
        lines.write(&Event::Point(branch.points[0].clone())),
        io::ErrorKind::StorageFull,
    );
}

fn file(name: &str, text: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("semismooth-{}-{name}", std::process::id()));
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn bad_json_comes_with_its_line() {
    let path = file("delassus.json", "{\n  \"dimension\": 2,\n  \"mu\": [0.3,,]\n}");
    let e = read_delassus(&path).unwrap_err();
    assert_eq!(
        along::<serde_json::Error>(&e).map(serde_json::Error::line),
        Some(3),
        "{e}"
    );
    std::fs::remove_file(path).unwrap();
}

#[test]
fn matrices_in_files_keep_what_is_wrong_with_them() {
    let path = file(
        "entries.json",
        r#"{"dimension": 2, "mu": [0.3], "q": [0.0, 0.0], "M": {"format": "csc", "indptr": [0, 1, 1], "indices": [7], "data": [1.0]}}"#,
    );
    let e = read_delassus(&path).unwrap_err();
    let outside = Some(&InputError::OutOfBounds {
        row: 7,
        col: 0,
        nrows: 2,
        ncols: 2,
    });
    assert_eq!(along(&e), outside, "{e}");
    std::fs::remove_file(path).unwrap();
}

/// A solver whose library has an error type of its own.
struct Foreign;

impl LinearSolver for Foreign {
    fn analyze(&mut self, _: PatternRef<'_>) -> Result<(), LinearError> {
        Ok(())
    }
    fn factor(&mut self, _: MatrixRef<'_>) -> Result<(), LinearError> {
        let source = Cause::new("x".parse::<f64>().unwrap_err());
        Err(LinearError::External { source })
    }
    fn solve_in_place(&mut self, _: &mut [f64]) -> Result<(), LinearError> {
        Ok(())
    }
    fn solve_transpose_in_place(&mut self, _: &mut [f64]) -> Result<(), LinearError> {
        Ok(())
    }
}

#[test]
fn solvers_of_the_user_pass_on_their_own_errors() {
    let e = Foreign.factor(Matrix::identity(1).as_ref()).unwrap_err();
    assert!(along::<std::num::ParseFloatError>(&e).is_some(), "{e}");
}

#[test]
fn causes_are_compared_by_kind_and_message() {
    let of = |kind, what: &str| Cause::from(io::Error::new(kind, what));
    let denied = of(io::ErrorKind::PermissionDenied, "no");
    assert_eq!(denied, denied.clone());
    assert_ne!(denied, of(io::ErrorKind::NotFound, "no"));
    assert_ne!(denied, of(io::ErrorKind::PermissionDenied, "yes"));
}
