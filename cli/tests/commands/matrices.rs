//! Bodies given by matrices in files, and bodies of revolution.

use semismooth::sparse::write_matrix_market;

use super::*;

/// Writes the block of the run file as matrices, with a stiffness that is unsymmetric as if rounded.
fn write_block(folder: &Path) {
    let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [16, 8]).unwrap();
    let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap())
        .prescribe("top", 0, |_| 0.0)
        .prescribe("top", 1, |_| -0.02)
        .assemble()
        .unwrap();
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    write_matrix_market(folder.join("A.mtx"), system.stiffness()).unwrap();
    write_matrix_market(folder.join("Bnu.mtx"), &rows.normal).unwrap();
    write_matrix_market(folder.join("Bt.mtx"), &rows.tangential[0]).unwrap();
    let motion = system.motion("top", 0, |_| 0.05).unwrap();
    for (name, forces) in [
        ("f0.txt", system.supports().forces()),
        ("f1.txt", motion.forces()),
    ] {
        let lines: Vec<String> = forces.iter().map(|f| format!("{f:?}\n")).collect();
        std::fs::write(folder.join(name), lines.concat()).unwrap();
    }
}

/// Replaces the sections of a mesh in the run file by matrices.
fn matrices_file(folder: &Path, changes: &[(&str, &str)]) {
    run_file(folder, &[]);
    let text = std::fs::read_to_string(folder.join("run.toml")).unwrap();
    let run = text.find("[run]").unwrap();
    let mut text = format!(
        "[matrices]\nstiffness = \"A.mtx\"\nnormal = \"Bnu.mtx\"\ntangential = [\"Bt.mtx\"]\nload = \"f0.txt\"\ngrows = \"f1.txt\"\n\
         [contact]\nfriction = 0.4\n{}",
        &text[run..]
    );
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    std::fs::write(folder.join("run.toml"), text).unwrap();
}

/// The same history from a mesh and from its matrices; what belongs to supports, their part of the work, is not in matrices.
#[test]
fn matrices_give_the_history_of_their_mesh() {
    let folder = folder("matrices");
    run_file(&folder, &[]);
    printed(&folder, &["contact", "run.toml", "--out", "mesh"]);
    write_block(&folder);
    matrices_file(&folder, &[]);
    let text = printed(&folder, &["contact", "run.toml"]);
    assert!(
        text.contains("history.csv, history.svg, level_*.csv") && !text.contains("note"),
        "{text}"
    );
    let [own, other] = ["out", "mesh"].map(|f| table(&folder.join(f).join("history.csv")));
    assert_eq!(own.len(), other.len());
    for (a, b) in own.iter().zip(&other) {
        assert_eq!(a[1..6], b[1..6]);
        for k in [6, 7, 11] {
            match (a[k].parse::<f64>(), b[k].parse::<f64>()) {
                (Ok(x), Ok(y)) => assert!((x - y).abs() < 1e-12, "{a:?} {b:?}"),
                _ => assert_eq!(a[k], b[k]),
            }
        }
    }
    let nodes = table(&folder.join("out/level_0008.csv"));
    assert_eq!(nodes.len(), 1 + 17);
    let normal: f64 = nodes[1..].iter().map(|n| n[3].parse::<f64>().unwrap()).sum();
    assert!((normal - own.last().unwrap()[6].parse::<f64>().unwrap()).abs() < 1e-12);
    // The curve, too.
    let levels = "levels = [0.0, 0.25, 0.5, 0.75, 1.0, 0.5, 0.0, -0.5, -1.0]";
    matrices_file(&folder, &[(levels, "follow = [0.0, 1.0]")]);
    printed(&folder, &["contact", "run.toml"]);
    assert!(folder.join("out/curve.csv").exists() && folder.join("out/end.csv").exists());
}

/// A stiffness written with eight digits is told to be unsymmetric.
#[test]
fn rounded_matrices_are_told() {
    let folder = folder("rounded");
    write_block(&folder);
    let text = std::fs::read_to_string(folder.join("A.mtx")).unwrap();
    let rounded: Vec<String> = text
        .lines()
        .map(|line| match line.split_whitespace().collect::<Vec<_>>()[..] {
            [i, j, v] if v.contains('.') && i < j => format!("{i} {j} {:.7e}\n", v.parse::<f64>().unwrap()),
            _ => format!("{line}\n"),
        })
        .collect();
    std::fs::write(folder.join("A.mtx"), rounded.concat()).unwrap();
    matrices_file(&folder, &[]);
    let text = printed(&folder, &["contact", "run.toml"]);
    assert!(
        text.contains("note: the stiffness matrix is not symmetric"),
        "{text}"
    );
}

/// The file of a substructure in place of a Matrix Market file: a spring of two displacements.
#[test]
fn substructures_are_read() {
    let folder = folder("substructure");
    let element = "**\n*USER ELEMENT,NODES=2,LINEAR\n** ELEMENT NODES\n** 17, 5\n1\n2, 2\n*MATRIX,TYPE=STIFFNESS\n2.,\n0., 2.\n";
    std::fs::write(folder.join("A.mtx"), element).unwrap();
    for (name, row) in [("Bnu", "1"), ("Bt", "2")] {
        let text = format!("%%MatrixMarket matrix coordinate real general\n1 2 1\n1 {row} 1.0\n");
        std::fs::write(folder.join(format!("{name}.mtx")), text).unwrap();
    }
    std::fs::write(folder.join("f0.txt"), "1.0\n0.0\n").unwrap();
    std::fs::write(folder.join("f1.txt"), "0.0\n1.0\n").unwrap();
    matrices_file(&folder, &[]);
    printed(&folder, &["contact", "run.toml", "-q"]);
    // Pressed by 1 and pulled by 1 against friction 0.4: it slips by 0.6 / 2.
    let nodes = table(&folder.join("out/level_0004.csv"));
    assert_eq!(nodes[1][1], "slip+");
    let [pressure, traction] = [3, 6].map(|k| nodes[1][k].parse::<f64>().unwrap());
    assert!((pressure - 1.0).abs() < 1e-12 && (traction - 0.4).abs() < 1e-12);
}

#[test]
fn wrong_matrices_are_named_with_their_line() {
    let folder = folder("wrong matrices");
    write_block(&folder);
    for (from, to, words) in [
        (
            "stiffness = \"A.mtx\"",
            "stiffness = \"B.mtx\"",
            &["line 2", "matrices.stiffness", "B.mtx"][..],
        ),
        (
            "normal = \"Bnu.mtx\"",
            "normal = \"A.mtx\"",
            &["line 1", "matrices", "tangential"],
        ),
        (
            "load = \"f0.txt\"",
            "gap = \"f0.txt\"",
            &["line 1", "matrices", "gap"],
        ),
        (
            "friction = 0.4",
            "friction = 0.4\nfacets = \"bottom\"",
            &["contact.facets", "matrices"],
        ),
        (
            "friction = 0.4",
            "friction = 0.4\nfriction_across = 0.4",
            &["friction_across", "plane"],
        ),
        (
            "# route = \"auto\"",
            "route = \"reduced\"",
            &["run.route", "mesh"],
        ),
    ] {
        matrices_file(&folder, &[(from, to)]);
        let message = refused(&folder, &["contact", "run.toml"]);
        assert!(words.iter().all(|w| message.contains(w)), "{message}");
    }
    let both = "[mesh]\nblock = { lower = [0.0, 0.0], upper = [2.0, 1.0], cells = [16, 8] }\n[contact]";
    matrices_file(&folder, &[("[contact]", both)]);
    assert!(refused(&folder, &["contact", "run.toml"]).contains("mesh"));
    std::fs::write(
        folder.join("run.toml"),
        "[contact]\nfriction = 0.4\n[run]\nlevels = [0.0]\n",
    )
    .unwrap();
    assert!(
        refused(&folder, &["contact", "run.toml"]).contains("a mesh and a material are wanted, or matrices")
    );
}

/// One node of stiffness 2 in each direction, pressed by 1 and pulled by α: what each law makes of it.
#[test]
fn laws_are_known_by_their_names() {
    let folder = folder("laws");
    let identity = "%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 2.0\n2 2 2.0\n";
    std::fs::write(folder.join("A.mtx"), identity).unwrap();
    for (name, row) in [("Bnu", "1"), ("Bt", "2")] {
        let text = format!("%%MatrixMarket matrix coordinate real general\n1 2 1\n1 {row} 1.0\n");
        std::fs::write(folder.join(format!("{name}.mtx")), text).unwrap();
    }
    std::fs::write(folder.join("f0.txt"), "1.0\n0.0\n").unwrap();
    std::fs::write(folder.join("f1.txt"), "0.0\n1.0\n").unwrap();
    for (law, forces) in [
        ("friction = 0.4\nshear_limit = 0.3", [1.0, 0.3]),
        ("friction = 0.4\ntension = 0.5", [1.0, 0.6]),
        ("bonded = true", [1.0, 1.0]),
        // From α = ½ on it slips by 0.05 at pressure 1, by 0.145 at 0.9: a depth of 0.1805 at stiffness 2.
        ("friction = 0.4\nwear = 1.0", [0.639, 0.4 * 0.639]),
        ("friction = 0.4\nstiffness = [2.0, 1.0]", [0.5, 0.2]),
        ("bonded = true\nstiffness = [2.0, 1.0]", [0.5, 1.0 / 3.0]),
    ] {
        matrices_file(&folder, &[("friction = 0.4", law)]);
        printed(&folder, &["contact", "run.toml", "-q"]);
        let nodes = table(&folder.join("out/level_0004.csv"));
        let found = [3, 6].map(|k| nodes[1][k].parse::<f64>().unwrap());
        assert!(
            (0..2).all(|k| (found[k] - forces[k]).abs() < 1e-12),
            "{law}: {found:?}"
        );
    }
    for (law, words) in [
        (
            "friction = 0.4\nshear_limit = -0.3",
            ["contact.shear_limit", "limit of shear"],
        ),
        (
            "friction = 0.4\nfriction_across = 0.3\nshear_limit = 0.3",
            ["contact.shear_limit", "one number"],
        ),
        ("friction = 0.4\ntension = -0.3", ["contact.tension", "tension"]),
        ("friction = 0.4\nbonded = true", ["contact.bonded", "friction"]),
        ("bonded = true\nwear = 1.0", ["contact.bonded", "wear"]),
        ("friction = 0.4\nwear = -1.0", ["contact.wear", "rate of wear"]),
        (
            "friction = 0.4\nstiffness = [0.0, 1.0]",
            ["contact.stiffness", "positive"],
        ),
    ] {
        matrices_file(&folder, &[("friction = 0.4", law)]);
        let message = refused(&folder, &["contact", "run.toml"]);
        assert!(words.iter().all(|w| message.contains(w)), "{message}");
    }
}

/// A plate of revolution pressed flat by 0.02: the pressure is that of uniaxial strain, its resultant that of a disc.
#[test]
fn discs_are_pressed_as_a_whole() {
    let folder = folder("disc");
    let plane = "# plane = \"strain\"              #";
    let sides =
        "value = [0.0, -0.02]            # one number a component, 0 if left out\ngrows = [0.05, 0.0]";
    let held = "components = [\"y\"]\nvalue = [-0.02]\ngrows = [-0.01]\n[[support]]\nfacets = \"right\"\ncomponents = [\"x\"]";
    run_file(&folder, &[(plane, "plane = \"axisymmetric\" #"), (sides, held)]);
    let text = printed(&folder, &["contact", "run.toml"]);
    assert!(text.contains("tangents held at 2 contact nodes"), "{text}");
    let rows = table(&folder.join("out/history.csv"));
    let stiff = 0.7 / (1.3 * 0.4);
    let normal: f64 = rows[4][6].parse().unwrap();
    assert!(
        (normal - stiff * 0.03 * std::f64::consts::PI * 4.0).abs() < 1e-12,
        "{normal}"
    );
}
