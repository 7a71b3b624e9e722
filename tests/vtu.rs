//! VTU and legacy VTK files, read back by a reader of our own and by another library's parser.
#![cfg(feature = "vtk")]

use semismooth::fem::Mesh;
use semismooth::output::{Field, OutputError, write_vtu};

fn folder() -> std::path::PathBuf {
    let folder = std::env::temp_dir().join(format!("semismooth-vtu-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Bytes of the base64 text of an inline binary array.
fn base64(text: &str) -> Vec<u8> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let bytes: Vec<u8> = text.bytes().filter(|c| !c.is_ascii_whitespace()).collect();
    let mut out = Vec::new();
    for chunk in bytes.chunks(4) {
        let n = chunk.iter().filter(|c| **c != b'=').count();
        let word = chunk.iter().fold(0u32, |w, c| {
            w << 6 | u32::from(if *c == b'=' { 0 } else { digit(*c) })
        });
        out.extend(&word.to_be_bytes()[1..n]);
    }
    out
}

/// The array of a name: its attributes and its numbers, as f64 or u64 bytes behind a length of 4 or 8 bytes, or as text.
fn array(xml: &str, name: &str) -> (String, Vec<u8>) {
    let begin = xml
        .find(&format!("Name=\"{name}\""))
        .unwrap_or_else(|| panic!("no {name}"));
    let open = xml[..begin].rfind('<').unwrap();
    let end = open + xml[open..].find('>').unwrap();
    let close = end + xml[end..].find("</DataArray>").unwrap();
    (xml[open..end].to_owned(), base64(&xml[end + 1..close]))
}

#[test]
fn vtu() {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [2, 1]).unwrap();
    let displacement: Vec<f64> = (0..12).map(|k| 0.1 * f64::from(k)).collect();
    let path = folder().join("two.vtu");
    write_vtu(
        &path,
        &mesh,
        &[Field::new("displacement", 2, displacement.clone())],
        &[Field::new("stress", 6, (0..12).map(f64::from).collect())],
    )
    .unwrap();
    let xml = std::fs::read_to_string(&path).unwrap();
    assert!(xml.contains("type=\"UnstructuredGrid\"") && xml.contains("NumberOfPoints=\"6\""));
    assert!(xml.contains("NumberOfCells=\"2\"") && xml.contains("LittleEndian"));
    let header = if xml.contains("header_type=\"UInt64\"") {
        8
    } else {
        4
    };
    let doubles = |name: &str| -> Vec<f64> {
        let (attributes, bytes) = array(&xml, name);
        assert!(
            attributes.contains("Float64") && attributes.contains("binary"),
            "{attributes}"
        );
        bytes[header..]
            .chunks_exact(8)
            .map(|b| f64::from_le_bytes(b.try_into().unwrap()))
            .collect()
    };
    let found = doubles("displacement");
    assert_eq!(found.len(), 18);
    for (node, v) in found.chunks_exact(3).enumerate() {
        assert_eq!(v, [displacement[2 * node], displacement[2 * node + 1], 0.0]);
    }
    assert_eq!(doubles("stress"), (0..12).map(f64::from).collect::<Vec<_>>());
    let (attributes, bytes) = array(&xml, "connectivity");
    assert!(attributes.contains("Int64"), "{attributes}");
    let connectivity: Vec<u64> = bytes[header..]
        .chunks_exact(8)
        .map(|b| u64::from_le_bytes(b.try_into().unwrap()))
        .collect();
    assert_eq!(connectivity, [0, 1, 4, 3, 1, 2, 5, 4]);
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
