//! Files for ParaView, read back by a strict reader written for these tests.

use std::collections::BTreeMap;

use semismooth::fem::Mesh;
use semismooth::output::{Field, OutputError, write_pvd, write_vtu};

fn folder() -> std::path::PathBuf {
    let folder = std::env::temp_dir().join(format!("semismooth-vtu-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// An element of an XML file.
#[derive(Debug, Default)]
struct Element {
    name: String,
    attributes: BTreeMap<String, String>,
    children: Vec<Element>,
    text: String,
}

impl Element {
    fn child(&self, name: &str) -> &Element {
        let found: Vec<&Element> = self.children.iter().filter(|c| c.name == name).collect();
        assert_eq!(found.len(), 1, "elements {name} in {}", self.name);
        found[0]
    }

    fn array(&self, name: &str) -> &Element {
        let arrays = self.children.iter().filter(|c| c.name == "DataArray");
        let found: Vec<&Element> = arrays.filter(|c| c.attributes["Name"] == name).collect();
        assert_eq!(found.len(), 1, "arrays {name} in {}", self.name);
        found[0]
    }

    /// The bytes after their length prefix.
    fn bytes(&self, kind: &str) -> Vec<u8> {
        assert_eq!(self.attributes["type"], kind);
        assert_eq!(self.attributes["format"], "binary");
        let bytes = base64(self.text.trim());
        let (length, rest) = bytes.split_at(8);
        assert_eq!(u64::from_le_bytes(length.try_into().unwrap()), rest.len() as u64);
        rest.to_vec()
    }

    fn doubles(&self) -> Vec<f64> {
        let bytes = self.bytes("Float64");
        assert_eq!(bytes.len() % 8, 0);
        let words = bytes.chunks_exact(8);
        words.map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect()
    }

    fn integers(&self) -> Vec<i64> {
        let bytes = self.bytes("Int64");
        assert_eq!(bytes.len() % 8, 0);
        let words = bytes.chunks_exact(8);
        words.map(|b| i64::from_le_bytes(b.try_into().unwrap())).collect()
    }
}

fn unescape(text: &str) -> String {
    assert!(!text.contains('<'), "{text}");
    let mut parts = text.split('&');
    let mut out = parts.next().unwrap().to_owned();
    for part in parts {
        let (entity, rest) = part.split_once(';').expect("an entity has an end");
        out.push(match entity {
            "amp" => '&',
            "lt" => '<',
            "gt" => '>',
            "quot" => '"',
            number => char::from_u32(number.strip_prefix('#').unwrap().parse().unwrap()).unwrap(),
        });
        out.push_str(rest);
    }
    out
}

/// Name and attributes between `<` and `>`.
fn tag(inside: &str) -> Element {
    let (name, mut rest) = inside.split_once(' ').unwrap_or((inside, ""));
    let mut element = Element {
        name: name.to_owned(),
        ..Element::default()
    };
    while let Some((key, after)) = rest.trim_start().split_once("=\"") {
        let (value, after) = after.split_once('"').expect("a value has an end");
        assert!(
            key.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'),
            "{key}"
        );
        assert!(
            element
                .attributes
                .insert(key.to_owned(), unescape(value))
                .is_none()
        );
        rest = after;
    }
    assert!(rest.trim().is_empty(), "{inside}");
    element
}

/// The root of an XML file of elements, attributes and text; anything else is an error.
fn parse(xml: &str) -> Element {
    let mut rest = xml.strip_prefix("<?xml version=\"1.0\"?>").unwrap();
    let mut open = vec![Element::default()];
    while let Some((text, after)) = rest.split_once('<') {
        open.last_mut().unwrap().text.push_str(&unescape(text));
        let (inside, after) = after.split_once('>').expect("a tag has an end");
        rest = after;
        if let Some(name) = inside.strip_prefix('/') {
            let done = open.pop().unwrap();
            assert_eq!(done.name, name);
            open.last_mut().unwrap().children.push(done);
        } else if let Some(inside) = inside.strip_suffix('/') {
            open.last_mut().unwrap().children.push(tag(inside));
        } else {
            open.push(tag(inside));
        }
    }
    assert!(rest.trim().is_empty() && open.len() == 1, "{rest}");
    let mut root = open.pop().unwrap();
    assert!(root.text.trim().is_empty() && root.children.len() == 1);
    root.children.pop().unwrap()
}

/// Bytes of base64 text, padded at the end only.
fn base64(text: &str) -> Vec<u8> {
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let digit = |c: u8| digits.iter().position(|d| *d == c).expect("a digit") as u32;
    assert_eq!(text.len() % 4, 0);
    let bare = text.trim_end_matches('=');
    assert!(text.len() - bare.len() <= 2);
    let mut out = Vec::new();
    for chunk in bare.as_bytes().chunks(4) {
        let word = chunk.iter().fold(0, |w, c| w << 6 | digit(*c)) << (6 * (4 - chunk.len()));
        out.extend(&word.to_be_bytes()[1..chunk.len()]);
    }
    out
}

#[test]
fn vtu() {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2, 1]).unwrap();
    let displacement: Vec<f64> = (0..12).map(|k| 0.1 * f64::from(k)).collect();
    let mut stress: Vec<f64> = (0..12).map(f64::from).collect();
    stress[3] = f64::NAN;
    stress[4] = f64::NEG_INFINITY;
    stress[5] = f64::MIN_POSITIVE / 3.0;
    let path = folder().join("two.vtu");
    let name = "u \"<&>\"\n";
    write_vtu(
        &path,
        &mesh,
        &[
            Field::new(name, 2, displacement.clone()),
            Field::new("height", 1, vec![1.5; 6]),
        ],
        &[Field::new("stress", 6, stress.clone())],
    )
    .unwrap();
    let file = parse(&std::fs::read_to_string(&path).unwrap());
    assert_eq!(file.name, "VTKFile");
    assert_eq!(file.attributes["type"], "UnstructuredGrid");
    assert_eq!(file.attributes["byte_order"], "LittleEndian");
    assert_eq!(file.attributes["header_type"], "UInt64");
    let piece = file.child("UnstructuredGrid").child("Piece");
    assert_eq!(piece.attributes["NumberOfPoints"], "6");
    assert_eq!(piece.attributes["NumberOfCells"], "2");
    let found = piece.child("PointData").array(name);
    assert_eq!(found.attributes["NumberOfComponents"], "3");
    let found = found.doubles();
    assert_eq!(found.len(), 18);
    for (node, v) in found.chunks_exact(3).enumerate() {
        assert_eq!(v, [displacement[2 * node], displacement[2 * node + 1], 0.0]);
    }
    assert_eq!(piece.child("PointData").array("height").doubles(), [1.5; 6]);
    let bits = |values: &[f64]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
    let found = piece.child("CellData").array("stress");
    assert_eq!(found.attributes["NumberOfComponents"], "6");
    assert_eq!(bits(&found.doubles()), bits(&stress));
    let points: Vec<f64> = mesh.points().iter().flatten().copied().collect();
    assert_eq!(piece.child("Points").array("Points").doubles(), points);
    let cells = piece.child("Cells");
    assert_eq!(cells.array("connectivity").integers(), [0, 1, 4, 3, 1, 2, 5, 4]);
    assert_eq!(cells.array("offsets").integers(), [4, 8]);
    assert_eq!(cells.array("types").bytes("UInt8"), [9, 9]);
}

#[test]
fn kinds_of_cells() {
    let square = Mesh::rectangle([0.0; 2], [1.0; 2], [1, 1]).unwrap();
    let triangles = square.simplices().unwrap();
    let boxes = Mesh::block([0.0; 3], [1.0; 3], [1, 1, 1]).unwrap();
    let tetrahedra = boxes.simplices().unwrap();
    for (name, mesh, kinds, nodes) in [
        ("triangles", &triangles, vec![5, 5], 6),
        ("box", &boxes, vec![12], 8),
        ("triangles6", &triangles.second_order().unwrap(), vec![22, 22], 12),
        ("quadrilateral8", &square.serendipity().unwrap(), vec![23], 8),
        ("quadrilateral9", &square.second_order().unwrap(), vec![28], 9),
        (
            "tetrahedra10",
            &tetrahedra.second_order().unwrap(),
            vec![24; 6],
            60,
        ),
        ("box20", &boxes.serendipity().unwrap(), vec![25], 20),
        ("box27", &boxes.second_order().unwrap(), vec![29], 27),
    ] {
        let path = folder().join(format!("{name}.vtu"));
        write_vtu(&path, mesh, &[], &[]).unwrap();
        let file = parse(&std::fs::read_to_string(&path).unwrap());
        let cells = file.child("UnstructuredGrid").child("Piece").child("Cells");
        assert_eq!(cells.array("types").bytes("UInt8"), kinds);
        assert_eq!(cells.array("connectivity").integers().len(), nodes);
    }
}

#[test]
fn legacy_vtk() {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2, 1]).unwrap();
    let path = folder().join("two.vtk");
    let height = Field::new("the height", 1, (0..6).map(|k| f64::from(k) / 3.0).collect());
    write_vtu(
        &path,
        &mesh,
        &[height],
        &[Field::new("v", 2, vec![1.0, 2.0, 3.0, 4.0])],
    )
    .unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(text.starts_with("# vtk DataFile Version 3.0\nsemismooth\nASCII\nDATASET UNSTRUCTURED_GRID\n"));
    let after = |begin: &str, count: usize| -> Vec<f64> {
        let rest = text.split_once(begin).unwrap_or_else(|| panic!("no {begin}")).1;
        let words = rest.split_ascii_whitespace().take(count);
        words.map(|w| w.parse().unwrap()).collect()
    };
    let points: Vec<f64> = mesh.points().iter().flatten().copied().collect();
    assert_eq!(after("\nPOINTS 6 double\n", 18), points);
    let cells = [4.0, 0.0, 1.0, 4.0, 3.0, 4.0, 1.0, 2.0, 5.0, 4.0];
    assert_eq!(after("\nCELLS 2 10\n", 10), cells);
    assert_eq!(after("\nCELL_TYPES 2\n", 2), [9.0, 9.0]);
    let heights: Vec<f64> = (0..6).map(|k| f64::from(k) / 3.0).collect();
    let begin = "\nPOINT_DATA 6\nFIELD FieldData 1\nthe_height 1 6 double\n";
    assert_eq!(after(begin, 6), heights);
    let begin = "\nCELL_DATA 2\nFIELD FieldData 1\nv 3 2 double\n";
    assert_eq!(after(begin, 6), [1.0, 2.0, 0.0, 3.0, 4.0, 0.0]);
}

#[test]
fn series() {
    let path = folder().join("history.pvd");
    write_pvd(&path, &[(0.0, "a.vtu"), (0.1 + 0.2, "b & c.vtu")]).unwrap();
    let file = parse(&std::fs::read_to_string(&path).unwrap());
    assert_eq!(file.attributes["type"], "Collection");
    let steps: Vec<(f64, &str)> = (file.child("Collection").children.iter())
        .map(|set| {
            assert_eq!(set.name, "DataSet");
            let time = set.attributes["timestep"].parse().unwrap();
            (time, set.attributes["file"].as_str())
        })
        .collect();
    assert_eq!(steps, [(0.0, "a.vtu"), (0.1 + 0.2, "b & c.vtu")]);
    assert!(matches!(
        write_pvd(&path, &[(f64::NAN, "a.vtu")]),
        Err(OutputError::Time { index: 0, .. })
    ));
    // A series that is refused leaves the old one unchanged.
    let again = parse(&std::fs::read_to_string(&path).unwrap());
    assert_eq!(again.child("Collection").children.len(), 2);
}

#[test]
fn bad_fields() {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2, 1]).unwrap();
    let short = Field::new("short", 2, vec![0.0; 5]);
    assert!(matches!(
        write_vtu(folder().join("bad.vtu"), &mesh, &[short], &[]),
        Err(OutputError::Field {
            expected: 12,
            found: 5,
            ..
        })
    ));
    assert!(matches!(
        write_vtu("/no/such/folder/a.vtu", &mesh, &[], &[]),
        Err(OutputError::Io { .. })
    ));
    assert!(write_vtu(folder().join("a.xyz"), &mesh, &[], &[]).is_err());
}
