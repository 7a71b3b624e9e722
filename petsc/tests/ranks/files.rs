//! A body from a Gmsh file on several processes: the displacements in the files that they write, compared with those of one process.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::{Path, PathBuf};

use semismooth::contact::{
    CondensedContact, ContactBody, ContactError, FrictionCoefficient, LoadPath, OrthotropicCoulomb,
    ReducedOptions,
};
use semismooth::fem::{
    CellKind, ContactRows, ElasticSystem, Elasticity, FemError, Foundation, Material, Mesh, read_gmsh,
};
use semismooth_petsc::{DistributedBody, DistributedContact, Error, Part, PartField, World};

const AGREEMENT: f64 = 1e-8;
const GROUPS: [&str; 4] = ["left", "right", "bottom", "top"];

pub fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR"))
}

/// Tetrahedra with a bent bottom, nodes in a shuffled order, as a file.
pub fn write_gmsh(path: &Path) {
    let grid = Mesh::block([0.0; 3], [2.0, 1.0, 1.0], [8, 5, 4]).expect("a grid");
    let n = grid.num_nodes();
    // 71 and n have no common divisor.
    let to = |k: usize| (71 * k + 5) % n;
    let mut points = vec![[0.0; 3]; n];
    for (k, &[x, y, z]) in grid.points().iter().enumerate() {
        let bent = z - 0.1 * (1.0 - z) * ((x - 1.0).powi(2) + (y - 0.5).powi(2));
        points[to(k)] = [x, y, bent];
    }
    let mut text = String::from("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n6\n");
    for (k, name) in GROUPS.iter().enumerate() {
        let _ = writeln!(text, "2 {} \"{name}\"", k + 1);
    }
    let _ = writeln!(text, "3 5 \"soft\"\n3 6 \"hard\"\n$EndPhysicalNames\n$Nodes\n{n}");
    for (k, [x, y, z]) in points.iter().enumerate() {
        let _ = writeln!(text, "{} {x:?} {y:?} {z:?}", k + 1);
    }
    let mut elements = Vec::new();
    let mut cells = Vec::new();
    for c in 0..grid.num_cells() {
        let v = grid.cell(c);
        let group = if grid.centre(c)[0] > 1.3 { 6 } else { 5 };
        for t in [
            [0, 1, 2, 6],
            [0, 2, 3, 6],
            [0, 3, 7, 6],
            [0, 7, 4, 6],
            [0, 4, 5, 6],
            [0, 5, 1, 6],
        ] {
            let nodes = t.map(|a| to(v[a]));
            cells.push((CellKind::Tetrahedron, nodes.to_vec()));
            let [a, b, c, d] = nodes.map(|n| n + 1);
            elements.push(format!("4 2 {group} {group} {a} {b} {c} {d}"));
        }
    }
    let mesh = Mesh::oriented(3, points, cells).expect("a mesh");
    for f in mesh.boundary() {
        let [x, _, z] = f.normal;
        let group = [x < -0.9, x > 0.9, z < -0.5, z > 0.5].iter().position(|b| *b);
        if let Some(group) = group {
            let [a, b, c] = [f.nodes[0] + 1, f.nodes[1] + 1, f.nodes[2] + 1];
            elements.push(format!("2 2 {0} {0} {a} {b} {c}", group + 1));
        }
    }
    let _ = writeln!(text, "$EndNodes\n$Elements\n{}", elements.len());
    for (k, element) in elements.iter().enumerate() {
        let _ = writeln!(text, "{} {element}", k + 1);
    }
    text += "$EndElements\n";
    std::fs::write(path, text).expect("a file");
}

/// Two materials, fixed at the left, pressed by a prescribed displacement of the top, pulled at the right.
fn discretize(mesh: Mesh) -> Result<(ElasticSystem, Vec<f64>, ContactRows), FemError> {
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?)
        .with_material("hard", Material::isotropic(20.0, 0.2)?)
        .fix("left")
        .prescribe("top", 2, |x| -0.01 - 0.004 * x[0])
        .discretize()?;
    let pull = system.traction("right", |_| [0.01, 0.02, 0.0])?;
    let supports = system.supports().forces();
    let load = pull.iter().zip(supports).map(|(a, b)| a + b).collect();
    let rows = system.contact("bottom", &Foundation::gap(|_| 0.001))?;
    Ok((system, load, rows))
}

fn law() -> OrthotropicCoulomb {
    let constant = |f| FrictionCoefficient::constant(f).expect("a coefficient");
    OrthotropicCoulomb::new(constant(0.2), constant(0.6))
}

/// On each process: solves, or lets process 0 solve for the condensed body, and writes `NAME.pvtu` with the displacements and the owners of
/// nodes.
pub fn solve(world: &World, name: &str) -> Result<(), Error> {
    let part = Part::read_gmsh(world, folder().join("body.msh"))?;
    let (system, load, rows) = world.agree(discretize(part.mesh().clone()))?;
    let body = DistributedBody::new(world, &part, &system, &rows)?;
    let (free, states) = match name.starts_with("condensed") {
        true => in_one(world, &body, &load)?,
        false => {
            let options = ReducedOptions::default().with_tolerance(1e-12);
            let mut problem = DistributedContact::new(body, law(), options)?;
            let found = problem.solve(0.0, &load, None)?;
            // Newton's method has changed the matrix of the body: condensing must start from the original one.
            let (free, states) = in_one(world, problem.body(), &load)?;
            let again = problem.solve(0.0, &load, None)?;
            assert!(world.rank() > 0 || states == found.states);
            assert_eq!(again.states, found.states);
            let differ = |other: &[f64]| {
                let pairs = found.displacements.iter().zip(other);
                pairs.fold(0.0f64, |m, (a, b)| m.max((a - b).abs()))
            };
            let differ = world.max([differ(&free), differ(&again.displacements)])?;
            assert!(differ.iter().all(|d| *d <= 0.01 * AGREEMENT), "{differ:?}");
            (found.displacements, found.states)
        }
    };
    let supports = system.supports().displacements();
    let u = world.agree(system.displacements(&free, supports))?;
    let mut owner = vec![f64::NAN; part.mesh().num_nodes()];
    part.own().iter().for_each(|n| owner[*n] = world.rank() as f64);
    let fields = [
        PartField::new("displacement", 3, &u),
        PartField::new("own & owner", 1, &owner),
    ];
    part.write(world, folder().join(name), &fields)?;
    if world.rank() == 0 {
        println!("states {states:?}");
    }
    Ok(())
}

type Found = (Vec<f64>, [usize; 3]);

/// The solution at α = 1 under a constant load plus α times another.
fn in_one(world: &World, body: &DistributedBody<'_>, load: &[f64]) -> Result<Found, Error> {
    let mut condensed = body.condense(Some(1 << 30))?;
    let [some, rest] = [0.3, 0.7].map(|part| load.iter().map(|f| part * f).collect::<Vec<_>>());
    let nodes = condensed.contact_body(&some, &rest)?;
    assert_eq!(nodes.is_some(), world.rank() == 0);
    let solve = |nodes| -> Result<Found, ContactError> {
        let problem = CondensedContact::new(nodes, law())?;
        let mut x = problem.solve(1.0, None)?;
        let found = problem.solution(&x)?;
        x.pop();
        Ok((x, [found.open(), found.stick(), found.slip()]))
    };
    let (forces, states) = world.agree(nodes.map(solve).transpose())?.unwrap_or_default();
    Ok((condensed.displacements(load, &forces)?, states))
}

type Position = [u64; 3];

/// Checks the files and the output of `solve` on a number of processes.
pub fn compare(name: &str, ranks: usize, output: &str) {
    let mesh = read_gmsh(folder().join("body.msh")).expect("a mesh");
    let (system, load, rows) = discretize(mesh.clone()).expect("a body");
    let load = LoadPath::constant(load);
    let body = ContactBody::new(system.stiffness().clone(), rows.normal, rows.tangential, load);
    let body = body.and_then(|b| b.with_gap(rows.gap)).expect("a body");
    let problem = CondensedContact::new(body, law()).expect("a problem");
    let x = problem.solve(0.0, None).expect("a solution");
    let found = problem.solution(&x).expect("a solution");
    let states = format!("states {:?}", [found.open(), found.stick(), found.slip()]);
    assert!(output.contains(&states), "{states}: {output}");
    let free = problem.displacements(&x).expect("displacements");
    let expected = system.displacements(&free, system.supports().displacements());
    let expected = expected.expect("displacements");
    let size = expected.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let number: BTreeMap<Position, usize> = (0..mesh.num_nodes())
        .map(|n| (mesh.points()[n].map(f64::to_bits), n))
        .collect();
    let index = std::fs::read_to_string(folder().join(name)).expect("the file of the pieces");
    let pieces: Vec<&str> = attributes(&index, "Piece", "Source");
    assert_eq!(pieces.len(), ranks);
    assert_eq!(
        attributes(&index, "PDataArray", "Name"),
        ["displacement", "own &amp; owner", "Points"]
    );
    let mut cells = BTreeSet::new();
    let mut owners = BTreeMap::new();
    let mut count = 0;
    for file in pieces {
        let text = std::fs::read_to_string(folder().join(file)).expect("a piece");
        let points = floats(&text, "Points");
        let (u, owner) = (floats(&text, "displacement"), floats(&text, "own &amp; owner"));
        let node = |k: usize| number[&[0, 1, 2].map(|d| points[3 * k + d].to_bits())];
        for k in 0..owner.len() {
            let n = node(k);
            for d in 0..3 {
                assert!((u[3 * k + d] - expected[3 * n + d]).abs() <= AGREEMENT * size);
            }
            assert_eq!(*owners.entry(n).or_insert(owner[k]), owner[k]);
        }
        for cell in integers(&text, "connectivity").chunks_exact(4) {
            let mut nodes: Vec<_> = cell.iter().map(|k| node(*k as usize)).collect();
            nodes.sort_unstable();
            assert!(cells.insert(nodes), "a cell stands in two pieces");
            count += 1;
        }
    }
    assert_eq!((count, owners.len()), (mesh.num_cells(), mesh.num_nodes()));
    let different: BTreeSet<_> = owners.values().map(|o| *o as usize).collect();
    assert!(different.into_iter().eq(0..ranks));
}

/// An attribute of all XML elements with a name.
fn attributes<'t>(text: &'t str, element: &str, attribute: &str) -> Vec<&'t str> {
    let tag = format!("<{element} ");
    let starts = text.match_indices(&tag).map(|(at, _)| &text[at..]);
    let value = |rest: &'t str| {
        let tag = rest.split('>').next()?;
        tag.split(&format!("{attribute}=\"")).nth(1)?.split('"').next()
    };
    starts.filter_map(value).collect()
}

/// The bytes of an array of a piece; their number comes first.
fn bytes(text: &str, name: &str) -> Vec<u8> {
    let after = text.split(&format!("Name=\"{name}\"")).nth(1).expect("an array");
    let from = after.find('>').expect("a tag") + 1;
    let digits = after[from..after.find("</DataArray").expect("an end")].trim();
    let mut out = Vec::new();
    for four in digits.as_bytes().chunks(4) {
        let value = |c: u8| match c {
            b'A'..=b'Z' => u32::from(c - b'A'),
            b'a'..=b'z' => u32::from(c - b'a') + 26,
            b'0'..=b'9' => u32::from(c - b'0') + 52,
            b'+' => 62,
            b'/' => 63,
            _ => 0,
        };
        let word = four.iter().fold(0, |w, c| w << 6 | value(*c));
        let padding = four.iter().filter(|c| **c == b'=').count();
        out.extend_from_slice(&word.to_be_bytes()[1..4 - padding]);
    }
    let (length, rest) = out.split_at(8);
    assert_eq!(
        u64::from_le_bytes(length.try_into().expect("eight bytes")) as usize,
        rest.len()
    );
    rest.to_vec()
}

fn floats(text: &str, name: &str) -> Vec<f64> {
    let bytes = bytes(text, name);
    bytes
        .as_chunks()
        .0
        .iter()
        .map(|b| f64::from_le_bytes(*b))
        .collect()
}

fn integers(text: &str, name: &str) -> Vec<i64> {
    let bytes = bytes(text, name);
    bytes
        .as_chunks()
        .0
        .iter()
        .map(|b| i64::from_le_bytes(*b))
        .collect()
}
