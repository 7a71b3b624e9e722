//! Data that go through files: they are read back unchanged, and edited files are checked like values made by a program.
#![cfg(feature = "serde")]

use std::fmt::Debug;

use semismooth::complementarity::Lcp;
use semismooth::contact::DelassusProblem;
use semismooth::fem::{CellKind, Material, Mesh};
use semismooth::sparse::{Matrix, Pattern};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

/// A value is read back from its JSON unchanged.
fn round_trip<T: Serialize + DeserializeOwned + PartialEq + Debug>(value: &T) -> Value {
    let text = serde_json::to_string(value).unwrap();
    assert_eq!(&serde_json::from_str::<T>(&text).unwrap(), value, "{text}");
    serde_json::from_str(&text).unwrap()
}

/// The file with another value at one place is refused with a message that contains these words.
fn refuses<T: DeserializeOwned + Debug>(file: &Value, place: &str, value: Value, words: &str) {
    let mut file = file.clone();
    *file.pointer_mut(place).expect(place) = value;
    let e = serde_json::from_value::<T>(file).unwrap_err().to_string();
    assert!(e.contains(words), "{place}: {e}");
}

fn matrix() -> Matrix {
    Matrix::from_triplets(2, 2, &[(0, 0, 2.0), (1, 0, -1.0 / 3.0), (1, 1, 1e-300)]).unwrap()
}

#[test]
fn patterns() {
    let file = round_trip(&Pattern::from_entries(4, 3, [(3, 0), (1, 2), (0, 2)]).unwrap());
    round_trip(&Pattern::full(2, 3));
    refuses::<Pattern>(&file, "/nrows", json!(3), "outside a 3 x 3 matrix");
    refuses::<Pattern>(&file, "/ncols", json!(usize::MAX), "column pointers");
    refuses::<Pattern>(&file, "/col_ptr/1", json!(usize::MAX), "out of order");
    refuses::<Pattern>(&file, "/col_ptr/3", json!(2), "3 entries");
    refuses::<Pattern>(&file, "/row_idx", json!([3, 1, 1]), "strictly increasing");
}

#[test]
fn matrices() {
    let mut a = matrix();
    let file = round_trip(&a);
    refuses::<Matrix>(&file, "/values", json!([1.0]), "array of values");
    refuses::<Matrix>(&file, "/values/0", Value::Null, "a number");
    refuses::<Matrix>(&file, "/pattern/col_ptr/0", json!(1), "column pointers");
    a.values_mut()[0] = f64::NEG_INFINITY;
    round_trip(&a);
    a.add(0, 1, 1.0);
    let e = serde_json::to_string(&a).unwrap_err();
    assert!(e.to_string().contains("(0, 1)"), "{e}");
}

#[test]
fn complementarity_problems() {
    let bounds = (vec![f64::NEG_INFINITY, 0.0], vec![1.0, f64::INFINITY]);
    let file = round_trip(&Lcp::boxed(matrix(), vec![0.1, -7.0], bounds.0, bounds.1).unwrap());
    round_trip(&Lcp::new(matrix(), vec![0.1, -7.0]).unwrap());
    refuses::<Lcp>(&file, "/q", json!([1.0]), "length");
    refuses::<Lcp>(&file, "/lower/0", json!(2.0), "2");
    refuses::<Lcp>(&file, "/lower/0", json!("nan"), "bound");
    refuses::<Lcp>(&file, "/lower/0", json!("low"), "low");
    refuses::<Lcp>(&file, "/matrix/values/0", json!("inf"), "finite");
    refuses::<Lcp>(&file, "/matrix/pattern/nrows", json!(9), "square");
}

#[test]
fn contact_problems() {
    let problem = DelassusProblem::new(2, matrix(), vec![-1.0, 0.2], vec![0.3]).unwrap();
    let file = round_trip(&problem);
    refuses::<DelassusProblem>(&file, "/dimension", json!(4), "dimension 4");
    refuses::<DelassusProblem>(&file, "/friction/0", json!(-0.3), "negative");
    refuses::<DelassusProblem>(&file, "/friction", json!([]), "no contacts");
    refuses::<DelassusProblem>(&file, "/q", json!([1.0]), "length");
    refuses::<DelassusProblem>(&file, "/matrix/values/0", json!(-2.0), "negative");
}

#[test]
fn materials() {
    let incompressible = Material::lame(1e20, 1.0).unwrap();
    round_trip(&incompressible);
    let file = round_trip(&Material::isotropic(211.9, 0.277).unwrap());
    let mut c = Material::lame(1.0, 1.0).unwrap().components();
    c[0][0][0][0] = 4.0;
    round_trip(&Material::tensor(&c).unwrap());
    refuses::<Material>(&file, "/matrix/0/1", json!(1.0), "not symmetric");
    refuses::<Material>(&file, "/matrix/3/3", json!(-1.0), "not positive definite");
    refuses::<Material>(&file, "/matrix/0", json!([1.0]), "length 6");
}

#[test]
fn meshes() {
    let mut mesh = Mesh::rectangle([0.0; 2], [0.3, 1.0], [3, 2]).unwrap();
    mesh.mark_boundary("foot", |f| f.normal[1] < -0.5);
    mesh.mark_cells("soft", |c| c[0] < 0.15);
    mesh.mark_cells("none", |_| false);
    round_trip(&mesh.clone().into_part());
    let file = round_trip(&mesh);
    let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.5]];
    let cells = [(CellKind::Tetrahedron, vec![0, 1, 2, 3])];
    round_trip(&Mesh::new(3, points, cells).unwrap());
    refuses::<Mesh>(&file, "/dim", json!(5), "dimension 2 or 3");
    refuses::<Mesh>(&file, "/dim", json!(3), "does not fit");
    refuses::<Mesh>(&file, "/nodes/0", json!(99), "node 99");
    refuses::<Mesh>(&file, "/nodes", json!([0, 1, 4]), "nodes of all cells");
    refuses::<Mesh>(&file, "/kinds/0", json!("Prism"), "Prism");
    refuses::<Mesh>(&file, "/points/0", json!([9.0, 9.0, 0.0]), "Jacobian");
    refuses::<Mesh>(&file, "/facet_groups/foot/0", json!([0, 99]), "node 99");
    refuses::<Mesh>(&file, "/facet_groups/foot/0", json!([0, 0]), "facet 0");
    refuses::<Mesh>(&file, "/cell_groups/soft/0", json!(6), "cell 6");
}
