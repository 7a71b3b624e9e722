//! Gmsh files of both versions, text and binary of either byte order: one mesh in eight formats.

use semismooth::InputError;
use semismooth::fem::{CellKind, FemError, Mesh, parse_gmsh};

/// Writes numbers as text or as bytes.
struct Writer {
    out: Vec<u8>,
    binary: bool,
    big: bool,
}

impl Writer {
    fn new(version: &str, binary: bool, big: bool) -> Self {
        let mut w = Self {
            out: format!("$MeshFormat\n{version} {} 8\n", i32::from(binary)).into_bytes(),
            binary,
            big,
        };
        if binary {
            w.int(1);
        }
        w.text("\n$EndMeshFormat\n$PhysicalNames\n3\n1 1 \"the foot\"\n2 1 \"left half\"\n2 2 \"right half\"\n$EndPhysicalNames\n");
        w
    }

    fn text(&mut self, s: &str) {
        self.out.extend(s.as_bytes());
    }

    fn put<const N: usize>(&mut self, mut bytes: [u8; N], text: String) {
        if self.binary {
            if self.big {
                bytes.reverse();
            }
            self.out.extend(bytes);
        } else {
            self.text(&text);
            self.text(" ");
        }
    }

    fn int(&mut self, v: i32) {
        self.put(v.to_le_bytes(), v.to_string());
    }

    fn size(&mut self, v: u64) {
        self.put(v.to_le_bytes(), v.to_string());
    }

    fn double(&mut self, v: f64) {
        self.put(v.to_le_bytes(), format!("{v:?}"));
    }
}

/// Two squares side by side (the second one clockwise), the first edges at the bottom named, a node that belongs to nothing.
const POINTS: [[f64; 2]; 7] = [
    [0.0, 0.0],
    [1.0, 0.0],
    [2.0, 0.0],
    [0.0, 1.0],
    [1.0, 1.0],
    [2.0, 1.5],
    [9.0, 9.0],
];
const QUADS: [[u64; 4]; 2] = [[1, 2, 5, 4], [6, 5, 2, 3]];
const LINES: [[u64; 2]; 2] = [[1, 2], [2, 3]];

fn version_2(binary: bool, big: bool) -> Vec<u8> {
    let mut w = Writer::new("2.2", binary, big);
    w.text("$Nodes\n7\n");
    for (k, p) in POINTS.iter().enumerate() {
        w.int(k as i32 + 1);
        [p[0], p[1], 0.5].into_iter().for_each(|x| w.double(x));
    }
    w.text("\n$EndNodes\n$Elements\n4\n");
    let header = |w: &mut Writer, kind: i32, count: i32| {
        if binary {
            [kind, count, 2].into_iter().for_each(|v| w.int(v));
        }
    };
    let begin = |w: &mut Writer, tag: i32, kind: i32, group: i32| {
        w.int(tag);
        if !binary {
            w.int(kind);
            w.int(2);
        }
        w.int(group);
        w.int(77);
    };
    header(&mut w, 1, 2);
    for (k, l) in LINES.iter().enumerate() {
        begin(&mut w, k as i32 + 1, 1, 1);
        l.iter().for_each(|n| w.int(*n as i32));
    }
    header(&mut w, 3, 2);
    for (k, q) in QUADS.iter().enumerate() {
        begin(&mut w, k as i32 + 3, 3, k as i32 + 1);
        q.iter().for_each(|n| w.int(*n as i32));
    }
    w.text("\n$EndElements\n");
    w.out
}

fn version_4(binary: bool, big: bool) -> Vec<u8> {
    let mut w = Writer::new("4.1", binary, big);
    w.text("$Entities\n");
    [0, 1, 2, 0].into_iter().for_each(|v| w.size(v));
    let entity = |w: &mut Writer, tag: i32, physical: i32| {
        w.int(tag);
        (0..6).for_each(|_| w.double(0.0));
        w.size(1);
        w.int(physical);
        w.size(1);
        w.int(-1);
    };
    entity(&mut w, 4, 1);
    entity(&mut w, 8, 1);
    entity(&mut w, 9, 2);
    w.text("\n$EndEntities\n$Nodes\n");
    [2, 7, 1, 7].into_iter().for_each(|v| w.size(v));
    for (dim, tag, range) in [(1, 4, 0..3), (2, 8, 3..7)] {
        [dim, tag, 0].into_iter().for_each(|v| w.int(v));
        w.size(range.len() as u64);
        range.clone().for_each(|k| w.size(k as u64 + 1));
        for p in &POINTS[range] {
            [p[0], p[1], 0.5].into_iter().for_each(|x| w.double(x));
        }
    }
    w.text("\n$EndNodes\n$Elements\n");
    [3, 4, 1, 4].into_iter().for_each(|v| w.size(v));
    [1, 4, 1].into_iter().for_each(|v| w.int(v));
    w.size(2);
    for (k, l) in LINES.iter().enumerate() {
        w.size(k as u64 + 1);
        l.iter().for_each(|n| w.size(*n));
    }
    for (k, q) in QUADS.iter().enumerate() {
        [2, 8 + k as i32, 3].into_iter().for_each(|v| w.int(v));
        w.size(1);
        w.size(k as u64 + 3);
        q.iter().for_each(|n| w.size(*n));
    }
    w.text("\n$EndElements\n");
    w.out
}

fn expected(mesh: &Mesh) {
    assert_eq!((mesh.dim(), mesh.num_nodes(), mesh.num_cells()), (2, 6, 2));
    assert_eq!(mesh.kind(0), CellKind::Quadrilateral);
    assert_eq!(mesh.points()[5], [2.0, 1.5, 0.0]);
    assert_eq!(mesh.facet_group("the foot").unwrap(), [[0, 1], [1, 2]]);
    assert_eq!(mesh.cell_group("left half").unwrap(), [0]);
    assert_eq!(mesh.cell_group("right half").unwrap(), [1]);
    let area: f64 = mesh
        .boundary()
        .iter()
        .map(|f| f.centre[0] * f.normal[0] * f.measure)
        .sum();
    assert!((area - 2.25).abs() < 1e-14); // ∫ x n_x = area
}

#[test]
fn one_mesh_many_ways() {
    for (binary, big) in [(false, false), (true, false), (true, true)] {
        expected(&parse_gmsh(&version_2(binary, big), "two.msh".as_ref()).unwrap());
        expected(&parse_gmsh(&version_4(binary, big), "two.msh".as_ref()).unwrap());
    }
}

/// Every way to cut a file short is an error, not a panic and not a mesh with other groups.
#[test]
fn truncated_files() {
    for file in [
        version_2(false, false),
        version_2(true, false),
        version_4(false, false),
        version_4(true, false),
    ] {
        for end in 0..file.len() - 2 {
            assert!(
                parse_gmsh(&file[..end], "cut.msh".as_ref()).is_err() || end > file.len() - 3,
                "{end}"
            );
        }
    }
}

#[test]
fn bad_files() {
    let parse = |text: &str| parse_gmsh(text.as_bytes(), "bad.msh".as_ref());
    let text = String::from_utf8(version_2(false, false)).unwrap();
    for (from, to, word) in [
        ("2.2 0 8", "3.0 0 8", "version 3.0"),
        ("2.2 0 8", "2.2 0 4", "4 bytes"),
        ("1 1 2 1 77 1 2", "1 26 2 1 77 1 2", "type 26"),
        ("1 1 2 1 77 1 2", "1 1 2 1 77 1 99", "node 99"),
        ("2.0 1.5 0.5", "2.0 nan 0.5", "finite"),
        ("2.0 1.5 0.5", "2.0 zwei 0.5", "zwei"),
        ("2.0 1.5 0.5", "2.0 1.5 0.7", "plane"),
        ("2.0 1.5 0.5", "1.2 -1.0 0.5", "element 4"),
        ("\"the foot\"", "the foot", "physical name"),
        ("2 1.0 0.0 0.5", "1 1.0 0.0 0.5", "node 1 is defined twice"),
    ] {
        assert!(text.contains(from), "{from}");
        let error = parse(&text.replacen(from, to, 1)).unwrap_err();
        assert!(error.to_string().contains(word), "{word}: {error}");
    }
    assert!(matches!(
        parse("$Nodes\n1\n1 0 0 0\n$EndNodes\n"),
        Err(FemError::Input(InputError::Parse { .. }))
    ));
    assert!(matches!(parse(""), Err(FemError::Empty { .. })));
}

/// Six times the volume of the tetrahedron (a, b, c, d).
fn volume([a, b, c, d]: [[f64; 3]; 4]) -> f64 {
    let [u, v, w] = [b, c, d].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
    u[0] * (v[1] * w[2] - v[2] * w[1]) - u[1] * (v[0] * w[2] - v[2] * w[0])
        + u[2] * (v[0] * w[1] - v[1] * w[0])
}

/// Elements that are inside out in the file are reoriented: the same nodes, a positive Jacobian at the first one.
#[test]
fn elements_inside_out_are_turned() {
    let points = "1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n5 0 0 1\n6 1 0 1\n7 1 1 1\n8 0 1 1";
    let file = |elements: &str| {
        format!(
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n8\n{points}\n$EndNodes\n$Elements\n1\n{elements}\n$EndElements\n"
        )
    };
    for (elements, kind, right) in [
        ("1 4 0 1 2 4 5", CellKind::Tetrahedron, true),
        ("1 4 0 1 4 2 5", CellKind::Tetrahedron, false),
        ("1 5 0 1 2 3 4 5 6 7 8", CellKind::Hexahedron, true),
        ("1 5 0 1 4 3 2 5 8 7 6", CellKind::Hexahedron, false),
    ] {
        let mesh = parse_gmsh(file(elements).as_bytes(), "solid.msh".as_ref()).unwrap();
        assert_eq!((mesh.dim(), mesh.num_cells(), mesh.kind(0)), (3, 1, kind));
        let nodes = mesh.cell(0);
        let at = |k: usize| mesh.points()[nodes[k]];
        // The edges that leave the first node.
        let edges = if kind == CellKind::Tetrahedron {
            [1, 2, 3]
        } else {
            [1, 3, 4]
        };
        let own = volume([at(0), at(edges[0]), at(edges[1]), at(edges[2])]);
        assert!((own - 1.0).abs() < 1e-15, "{elements}: {own}");
        // Every face of the boundary is one of the solid: four triangles or six squares with all nodes in a plane.
        let faces = mesh.boundary();
        assert_eq!(faces.len(), if kind == CellKind::Tetrahedron { 4 } else { 6 });
        if kind == CellKind::Hexahedron {
            for face in &faces {
                let flat = (0..3).any(|k| {
                    let first = mesh.points()[face.nodes[0]][k];
                    face.nodes.iter().all(|&n| mesh.points()[n][k] == first)
                });
                assert!(flat, "{elements}: {:?}", face.nodes);
            }
        }
        let told: Vec<usize> = elements
            .split(' ')
            .skip(3)
            .map(|w| w.parse::<usize>().unwrap() - 1)
            .collect();
        let positions: Vec<[f64; 3]> = (0..nodes.len()).map(at).collect();
        if right {
            let given = |n: usize| {
                [
                    [0., 0., 0.],
                    [1., 0., 0.],
                    [1., 1., 0.],
                    [0., 1., 0.],
                    [0., 0., 1.],
                    [1., 0., 1.],
                    [1., 1., 1.],
                    [0., 1., 1.],
                ][n]
            };
            let expected: Vec<[f64; 3]> = told.iter().map(|&n| given(n)).collect();
            assert_eq!(positions, expected);
        }
    }
}

#[test]
fn a_wrong_mark_of_the_byte_order() {
    let mut file = version_2(true, false);
    let mark = b"2.2 1 8\n";
    let at = file.windows(mark.len()).position(|w| w == mark).unwrap() + mark.len();
    file[at] = 7;
    let error = parse_gmsh(&file, "bad.msh".as_ref()).unwrap_err().to_string();
    assert!(
        error.contains("bad.msh") && error.contains("byte order"),
        "{error}"
    );
    let mut text = version_2(false, false);
    let at = text.windows(6).position(|w| w == b"$Nodes").unwrap() + 9;
    text[at] = 0xff;
    let error = parse_gmsh(&text, "bad.msh".as_ref()).unwrap_err().to_string();
    assert!(error.contains("bad.msh"), "{error}");
}

#[test]
fn messages_are_short_whatever_the_file_holds() {
    let long = "x".repeat(200_000);
    let head = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
    let files = [
        format!("$MeshFormat\n{long} 0 8\n$EndMeshFormat\n"),
        format!("{head}$PhysicalNames\n1\n{long}\n$EndPhysicalNames\n"),
        format!("{head}$Nodes\n{long}\n$EndNodes\n"),
        format!("{head}${long}\n1\n"),
    ];
    for file in files {
        let error = parse_gmsh(file.as_bytes(), "long.msh".as_ref()).unwrap_err();
        assert!(error.to_string().len() < 300, "{}", error.to_string().len());
    }
    let mesh = format!(
        "{head}$PhysicalNames\n1\n1 7 \"{long}\"\n$EndPhysicalNames\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n\
         $Elements\n2\n1 1 2 7 1 1 2\n2 2 2 9 1 1 2 3\n$EndElements\n"
    );
    let mesh = parse_gmsh(mesh.as_bytes(), "long.msh".as_ref()).unwrap();
    assert!(mesh.facet_group("foot").unwrap_err().to_string().len() < 300);
}
