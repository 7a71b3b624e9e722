use std::path::Path;

use semismooth::fem::{
    CellKind, Degree, Elasticity, Foundation, Material, MaterialConstant, Mesh, Mortar, MultiplierSpace,
    Partition, PlaneModel, PlasticBody, Spring, TraceSpace, VonMises, parse_gmsh, read_gmsh,
};
use semismooth::interface::LoadCase;

use super::table::{BAD, NOT_POSITIVE, Table};

fn square() -> Mesh {
    let mut mesh = Mesh::rectangle([0.0; 2], [1.0; 2], [2, 2]).unwrap();
    mesh.mark_boundary("bottom", |f| f.centre[1] == 0.0);
    mesh.mark_boundary("top", |f| f.centre[1] == 1.0);
    mesh.mark_boundary("none", |_| false);
    mesh
}

fn body() -> Elasticity {
    Elasticity::new(square(), Material::isotropic(1.0, 0.3).unwrap()).fix("top")
}

#[test]
fn finite_elements() {
    let mut t = Table::new("fem");
    meshes(&mut t);
    materials(&mut t);
    bodies(&mut t);
    plastic(&mut t);
    readers(&mut t);
    derivatives(&mut t);
    t.finish();
}

fn meshes(t: &mut Table) {
    let points = || vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for (name, new) in [
        (
            "fem::Mesh::new",
            Mesh::new as fn(usize, Vec<[f64; 3]>, Vec<(CellKind, Vec<usize>)>) -> _,
        ),
        ("fem::Mesh::oriented", Mesh::oriented),
    ] {
        let triangle = |nodes: Vec<usize>| vec![(CellKind::Triangle, nodes)];
        for dim in [0, 1, 4, usize::MAX] {
            t.refuses(name, "dimension", "dimension", || {
                new(dim, points(), triangle(vec![0, 1, 2]))
            });
        }
        t.refuses(name, "nothing", "empty", || new(2, vec![], vec![]));
        t.refuses(name, "no cells", "", || new(2, points(), vec![]));
        t.refuses(name, "too few nodes", "cell 0", || {
            new(2, points(), triangle(vec![0, 1]))
        });
        t.refuses(name, "a node that is not there", "node 7", || {
            new(2, points(), triangle(vec![0, 1, 7]))
        });
        t.refuses(name, "usize::MAX", "node", || {
            new(2, points(), triangle(vec![0, 1, usize::MAX]))
        });
        t.refuses(name, "a node twice", "", || {
            new(2, points(), triangle(vec![0, 1, 1]))
        });
        t.refuses(name, "a cell of another dimension", "cell 0", || {
            new(3, points(), triangle(vec![0, 1, 2]))
        });
        t.refuses(name, "a solid in the plane", "cell 0", || {
            new(
                2,
                vec![[0.0; 3]; 4],
                vec![(CellKind::Tetrahedron, vec![0, 1, 2, 3])],
            )
        });
        t.refuses(name, "a loose node", "node 3", || {
            new(2, [points(), vec![[5.0; 3]]].concat(), triangle(vec![0, 1, 2]))
        });
        t.refuses(name, "a flat cell", "cell 0", || {
            new(
                2,
                vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
                triangle(vec![0, 1, 2]),
            )
        });
        for bad in BAD {
            t.refuses(name, "a coordinate", "node 1", || {
                new(
                    2,
                    vec![[0.0; 3], [bad, 0.0, 0.0], [0.0, 1.0, 0.0]],
                    triangle(vec![0, 1, 2]),
                )
            });
        }
        for size in [1e-320, 1e-160, 1e160, 1e300, f64::MAX] {
            t.survives(name, "sizes", || {
                new(
                    2,
                    vec![[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0]],
                    triangle(vec![0, 1, 2]),
                )
                .and_then(|mut m| {
                    m.mark_boundary("all", |_| true);
                    let material = Material::isotropic(1.0, 0.3)?;
                    m.refined()?;
                    Elasticity::new(m, material).fix_component("all", 0).assemble()
                })
            });
        }
    }
    t.refuses("fem::Mesh::new", "a cell turned round", "cell 0", || {
        Mesh::new(2, points(), vec![(CellKind::Triangle, vec![0, 2, 1])])
    });
    for bad in BAD {
        t.refuses("fem::Mesh::rectangle", "a corner", "", || {
            Mesh::rectangle([0.0, bad], [1.0; 2], [1, 1])
        });
        t.refuses("fem::Mesh::block", "a corner", "", || {
            Mesh::block([0.0; 3], [1.0, bad, 1.0], [1; 3])
        });
        t.refuses("fem::Mesh::rectangle_graded", "a line", "line 1", || {
            Mesh::rectangle_graded(&[0.0, bad], &[0.0, 1.0])
        });
        t.refuses("fem::Mesh::block_graded", "a line", "line 1", || {
            Mesh::block_graded(&[0.0, 1.0], &[0.0, 1.0], &[0.0, bad])
        });
    }
    for n in [0, usize::MAX, 1 << 40] {
        t.refuses("fem::Mesh::rectangle", "numbers of cells", "", || {
            Mesh::rectangle([0.0; 2], [1.0; 2], [n, 1])
        });
        t.refuses("fem::Mesh::rectangle", "numbers of cells", "", || {
            Mesh::rectangle([0.0; 2], [1.0; 2], [1, n])
        });
        t.refuses("fem::Mesh::block", "numbers of cells", "", || {
            Mesh::block([0.0; 3], [1.0; 3], [1, n, 1])
        });
    }
    t.refuses(
        "fem::Mesh::block",
        "numbers of cells whose product overflows",
        "",
        || Mesh::block([0.0; 3], [1.0; 3], [1 << 25; 3]),
    );
    // Each of these would take several hundred GB.
    t.refuses("fem::Mesh::rectangle", "too many cells", "[40000, 40000]", || {
        Mesh::rectangle([0.0; 2], [1.0; 2], [40_000, 40_000])
    });
    t.refuses("fem::Mesh::rectangle", "many lines, no cells", "empty", || {
        Mesh::rectangle([0.0; 2], [1.0; 2], [2_000_000_000, 0])
    });
    let many: Vec<f64> = (0..=40_000).map(f64::from).collect();
    t.refuses(
        "fem::Mesh::rectangle_graded",
        "too many lines",
        "[40000, 40000]",
        || Mesh::rectangle_graded(&many, &many),
    );
    t.refuses(
        "fem::Mesh::block_graded",
        "too many planes",
        "[40000, 40000, 1]",
        || Mesh::block_graded(&many, &many, &[0.0, 1.0]),
    );
    t.refuses("fem::Mesh::rectangle", "corners turned round", "", || {
        Mesh::rectangle([1.0; 2], [0.0; 2], [1, 1])
    });
    t.refuses("fem::Mesh::block", "corners turned round", "", || {
        Mesh::block([1.0; 3], [0.0; 3], [1; 3])
    });
    for lines in [vec![], vec![0.0], vec![0.0, 0.0], vec![1.0, 0.0]] {
        t.refuses("fem::Mesh::rectangle_graded", "lines", "", || {
            Mesh::rectangle_graded(&lines, &[0.0, 1.0])
        });
        t.refuses("fem::Mesh::block_graded", "lines", "", || {
            Mesh::block_graded(&[0.0, 1.0], &lines, &[0.0, 1.0])
        });
    }
    t.refuses("fem::Mesh::cell_group", "an unknown name", "\"x\"", || {
        square().cell_group("x").map(drop)
    });
    t.refuses("fem::Mesh::facet_group", "an unknown name", "\"x\"", || {
        square().facet_group("x").map(drop)
    });
    for facet in [vec![], vec![0], vec![0, 99], vec![0, 0], vec![0, 1, 2, 3, 4]] {
        t.refuses("fem::Mesh::add_facet_group", "a facet", "", || {
            square().add_facet_group("g", vec![facet.clone()])
        });
    }
    t.survives("fem::Mesh::add_facet_group", "a facet of no cell", || {
        let mut mesh = square();
        mesh.add_facet_group("g", vec![vec![0, 8]])?;
        let system = Elasticity::new(mesh, Material::isotropic(1.0, 0.3)?)
            .fix("top")
            .assemble()?;
        system.contact("g", &Foundation::gap(|_| 0.0))
    });
    t.survives("fem::Mesh::add_facet_group", "no facets", || {
        square().add_facet_group("g", vec![])
    });
    for cell in [square().num_cells(), usize::MAX] {
        t.refuses("fem::Mesh::add_cell_group", "a cell", "does not exist", || {
            square().add_cell_group("g", vec![0, cell])
        });
    }
    t.survives("fem::Mesh::refined", "any mesh", || square().refined());
    t.survives("fem::Mesh::simplices", "any mesh", || square().simplices());
}

fn materials(t: &mut Table) {
    for bad in BAD.into_iter().chain(NOT_POSITIVE) {
        t.refuses("fem::Material::isotropic", "E", "E", || {
            Material::isotropic(bad, 0.3)
        });
        t.refuses("fem::Material::lame", "mu", "mu", || Material::lame(1.0, bad));
    }
    for bad in BAD.into_iter().chain([0.5, -1.0, 2.0]) {
        t.refuses("fem::Material::isotropic", "nu", "Poisson", || {
            Material::isotropic(1.0, bad)
        });
    }
    for bad in BAD.into_iter().chain([-1.0]) {
        t.refuses("fem::Material::lame", "lambda", "lambda", || {
            Material::lame(bad, 1.0)
        });
        t.refuses("fem::Material::tensor", "an entry", "tensor", || {
            let mut c = Material::isotropic(1.0, 0.3).unwrap().components();
            c[0][0][0][0] = bad;
            Material::tensor(&c)
        });
    }
    t.refuses("fem::Material::tensor", "no symmetry", "symmetric", || {
        let mut c = Material::isotropic(1.0, 0.3).unwrap().components();
        c[0][1][0][0] = 0.5;
        Material::tensor(&c)
    });
    t.refuses("fem::Material::tensor", "nothing", "positive definite", || {
        Material::tensor(&[[[[0.0; 3]; 3]; 3]; 3])
    });
    for size in [1e-320, 1e-300, 1e300, f64::MAX] {
        t.survives("fem::Material::isotropic", "sizes", || {
            let material = Material::isotropic(size, 0.3)?;
            Elasticity::new(square(), material).fix("top").assemble()
        });
    }
}

fn plastic(t: &mut Table) {
    let law = || VonMises::new(1.0, 0.3, 0.1).unwrap();
    for bad in BAD.into_iter().chain(NOT_POSITIVE) {
        t.refuses("fem::VonMises::new", "a yield stress", "yield", || {
            VonMises::new(1.0, 0.3, bad)
        });
        t.refuses("fem::VonMises::new", "E", "E", || VonMises::new(bad, 0.3, 1.0));
    }
    for bad in BAD.into_iter().chain([-1.0]) {
        t.refuses("fem::VonMises::with_hardening", "isotropic", "isotropic", || {
            law().with_hardening(bad, 0.0)
        });
        t.refuses("fem::VonMises::with_hardening", "kinematic", "kinematic", || {
            law().with_hardening(0.0, bad)
        });
    }
    let new = "fem::PlasticBody::new";
    t.refuses(new, "another material", "elastic", || {
        PlasticBody::new(&body(), VonMises::new(2.0, 0.3, 0.1)?)
    });
    t.refuses(new, "plane stress", "plane stress", || {
        PlasticBody::new(&body().with_plane_model(PlaneModel::Stress), law())
    });
    let virgin = PlasticBody::new(&body(), law()).unwrap();
    let (free, all) = (virgin.system().num_free(), 2 * virgin.system().mesh().num_nodes());
    let vectors = |len: usize| {
        let values = BAD.into_iter().map(move |bad| vec![bad; len]);
        values.chain([vec![], vec![0.0; len + 1]])
    };
    for x in vectors(free) {
        t.refuses("fem::PlasticBody::set_load", "a load", "load", || {
            virgin.clone().set_load(&x)
        });
        t.refuses(
            "fem::PlasticBody::commit",
            "displacements",
            "displacements",
            || virgin.clone().commit(&x),
        );
        t.refuses(
            "fem::PlasticBody::stresses",
            "displacements",
            "displacements",
            || virgin.stresses(&x),
        );
    }
    for x in vectors(all) {
        t.refuses(
            "fem::PlasticBody::set_supports",
            "displacements",
            "supports",
            || virgin.clone().set_supports(&x),
        );
    }
    for size in [1e-320, 1e-300, 1e300, f64::MAX] {
        t.survives("fem::VonMises::new", "sizes", || {
            let law = VonMises::new(size, 0.3, size)?.with_hardening(size, size)?;
            let supported = Elasticity::new(square(), law.elastic().clone()).fix("top");
            let mut body = PlasticBody::new(&supported, law)?;
            body.commit(&vec![1e-3; free])
        });
    }
}

fn bodies(t: &mut Table) {
    let assemble = "fem::Elasticity::assemble";
    let material = || Material::isotropic(1.0, 0.3).unwrap();
    t.refuses(assemble, "an unknown group", "\"x\"", || {
        body().fix("x").assemble()
    });
    t.survives(assemble, "an empty group", || body().fix("none").assemble());
    t.refuses(assemble, "an unknown group of cells", "\"x\"", || {
        body().with_material("x", material()).assemble()
    });
    for component in [2, usize::MAX] {
        t.refuses(assemble, "a component that is not there", "component", || {
            body().fix_component("top", component).assemble()
        });
        t.refuses(assemble, "a component that is not there", "component", || {
            body().prescribe("top", component, |_| 0.0).assemble()
        });
    }
    t.refuses(assemble, "nothing free", "prescribed", || {
        let mut mesh = square();
        mesh.mark_boundary("all", |_| true);
        let mut one = Mesh::rectangle([0.0; 2], [1.0; 2], [1, 1])?;
        one.mark_boundary("all", |_| true);
        Elasticity::new(one, material()).fix("all").assemble()
    });
    t.refuses("fem::Elasticity::discretize", "a floating body", "floats", || {
        Elasticity::new(square(), Material::isotropic(1.0, 0.3).unwrap()).discretize()
    });
    t.holds(
        "fem::ElasticSystem::nodal_stiffness",
        "it is the stiffness",
        || {
            let system = body().discretize().unwrap();
            let nodal = system.nodal_stiffness().unwrap().to_matrix().unwrap();
            nodal == *system.stiffness() && system.num_free() == nodal.nrows()
        },
    );
    let system = body().assemble().unwrap();
    let n = system.num_free();
    for bad in BAD {
        t.refuses(assemble, "a value", "", || {
            body().prescribe("bottom", 0, move |_| bad).assemble()
        });
        t.refuses("fem::ElasticSystem::body_force", "a force", "", || {
            system.body_force(|_| [0.0, bad, 0.0])
        });
        t.refuses("fem::ElasticSystem::traction", "a traction", "", || {
            system.traction("bottom", |_| [bad, 0.0, 0.0])
        });
        t.survives("fem::ElasticSystem::displacements", "no numbers", || {
            system.displacements(&vec![bad; n], &[])
        });
        t.refuses("fem::ElasticSystem::motion", "no numbers", "", || {
            system.motion("left", 0, |_| bad)
        });
        t.survives("fem::ElasticSystem::reactions", "no numbers", || {
            system.reactions(&vec![bad; n], &[])
        });
        t.survives("fem::ElasticSystem::stresses", "no numbers", || {
            system.stresses(&vec![bad; n], &[])
        });
        t.refuses("fem::ElasticSystem::contact", "a gap", "", || {
            system.contact("bottom", &Foundation::gap(move |_| bad))
        });
        t.refuses("fem::ElasticSystem::contact", "a normal", "", || {
            system.contact(
                "bottom",
                &Foundation::gap(|_| 0.0).with_normal(move |_| [0.0, bad, 0.0]),
            )
        });
        t.refuses("fem::ElasticSystem::contact", "a plane", "", || {
            system.contact("bottom", &Foundation::plane([0.0, bad, 0.0], [0.0, 1.0, 0.0]))
        });
        t.refuses("fem::ElasticSystem::contact_between", "a gap", "", || {
            system.contact_between("bottom", "top", &Mortar::default().with_gap(move |_| bad))
        });
        t.refuses("fem::ElasticSystem::contact_between", "a reach", "", || {
            system.contact_between("bottom", "top", &Mortar::default().with_reach(bad.min(0.0)))
        });
        t.survives("fem::ElasticSystem::contact", "a tangent", || {
            system.contact(
                "bottom",
                &Foundation::gap(|_| 0.0).with_tangent(move |_| [bad, 0.0, 0.0]),
            )
        });
    }
    for size in [0.0, 1e-320, 1e300, f64::MAX] {
        t.survives("fem::ElasticSystem::contact", "normals of any length", || {
            system.contact(
                "bottom",
                &Foundation::gap(|_| 0.0).with_normal(move |_| [0.0, -size, 0.0]),
            )
        });
        t.survives("fem::ElasticSystem::contact", "tangents of any length", || {
            system.contact(
                "bottom",
                &Foundation::gap(|_| 0.0).with_tangent(move |_| [size, 0.0, 0.0]),
            )
        });
        t.survives(
            "fem::ElasticSystem::contact",
            "planes with normals of any length",
            || system.contact("bottom", &Foundation::plane([0.0; 3], [0.0, size, 0.0])),
        );
        t.survives("fem::ElasticSystem::traction", "sizes", || {
            system.traction("bottom", |_| [size, size, size])
        });
    }
    for len in [0, 1, n + 1] {
        t.refuses("fem::ElasticSystem::displacements", "another length", "", || {
            system.displacements(&vec![0.0; len], &[])
        });
        t.refuses("fem::ElasticSystem::stresses", "another length", "", || {
            system.stresses(&vec![0.0; len], &[])
        });
    }
    // Found by a search: determinants are positive at the corners, and negative between them.
    let folded = || {
        let points = [
            [-0.5, 0.3, -0.4],
            [0.8, 0.0, 0.5],
            [1.0, 1.0, 0.3],
            [0.5, 0.9, 0.5],
            [0.5, -0.3, 0.5],
            [0.5, 0.6, 1.4],
            [1.6, 1.6, 1.1],
            [0.0, 0.8, 0.9],
        ];
        Mesh::new(3, points.to_vec(), [(CellKind::Hexahedron, (0..8).collect())])
    };
    t.refuses("fem::Mesh::second_order", "a folded cell", "folded", || {
        folded()?.second_order()
    });
    t.refuses("fem::Mesh::serendipity", "a folded cell", "folded", || {
        folded()?.serendipity()
    });
    t.refuses(
        "fem::Mesh::add_node_group",
        "a node that does not exist",
        "node 99",
        || {
            let mut mesh = Mesh::rectangle([0.0; 2], [1.0; 2], [1; 2])?;
            mesh.add_node_group("x", vec![99])
        },
    );
    for stiffness in [-1.0, f64::NAN, f64::INFINITY] {
        t.refuses("fem::Spring::axes", "a stiffness", "spring", || {
            Spring::axes([0.0, stiffness, 1.0])
        });
        t.refuses("fem::Spring::along", "a stiffness", "spring", || {
            Spring::along([1.0; 3], stiffness)
        });
    }
    t.refuses("fem::Spring::along", "no direction", "direction", || {
        Spring::along([0.0; 3], 1.0)
    });
    for group in ["x", "none"] {
        t.refuses("fem::Mesh::node_group", group, group, || {
            system.mesh().node_group(group).map(drop)
        });
        t.refuses("fem::ElasticSystem::nodal_force", group, group, || {
            system.nodal_force(group, |_| [0.0; 3])
        });
        t.refuses("fem::ElasticSystem::contact", group, group, || {
            system.contact(group, &Foundation::gap(|_| 0.0))
        });
        t.refuses("fem::ElasticSystem::contact_with", group, group, || {
            system.contact_with(group, &Foundation::gap(|_| 0.0), MultiplierSpace::DualCells)
        });
        t.refuses("fem::ElasticSystem::contact_between", group, group, || {
            system.contact_between("bottom", group, &Mortar::default())
        });
        t.refuses("fem::ContactRows::check_supports", group, "", || {
            let rows = system.contact("bottom", &Foundation::gap(|_| 0.0))?;
            rows.check_supports(
                &system,
                &LoadCase::of_supports(vec![1.0], vec![0.0], vec![0.0]).unwrap(),
            )
        });
        t.refuses("fem::TraceSpace::new", group, group, || {
            TraceSpace::new(system.mesh(), group, None).map(drop)
        });
    }
    t.refuses(
        "fem::ElasticSystem::traction",
        "an unknown group",
        "\"x\"",
        || system.traction("x", |_| [0.0; 3]),
    );
    t.refuses("fem::ElasticSystem::contact", "a fixed boundary", "", || {
        system.contact("top", &Foundation::gap(|_| 0.0))
    });
    let on = |partition: Partition, degree| {
        let space = MultiplierSpace::Piecewise { partition, degree };
        system.contact_with("bottom", &Foundation::gap(|_| 0.0), space)
    };
    let coarse = |mesh: Mesh, facets: &str| Partition::Coarse {
        mesh: Box::new(mesh),
        facets: facets.into(),
    };
    let plate = |x: [f64; 2]| Mesh::rectangle([x[0], 0.0], [x[1], 1.0], [1, 1]).unwrap();
    for (what, named, partition) in [
        ("none merged", "\"bottom\"", Partition::Merged(0)),
        (
            "elements larger than the boundary",
            "larger than the boundary",
            Partition::Merged(99),
        ),
        ("an unknown element", "\"x\"", Partition::Groups(vec!["x".into()])),
        ("no elements", "no element", Partition::Groups(Vec::new())),
        (
            "an element twice",
            "in two elements",
            Partition::Groups(vec!["bottom".into(), "bottom".into()]),
        ),
        (
            "an element elsewhere",
            "\"top\"",
            Partition::Groups(vec!["bottom".into(), "top".into()]),
        ),
        (
            "half a boundary",
            "no element",
            coarse(plate([0.0, 0.25]), "bottom"),
        ),
        ("the other side", "no element", coarse(plate([0.0, 1.0]), "top")),
        (
            "more than the boundary",
            "reaches beyond",
            coarse(plate([0.0, 9.0]), "bottom"),
        ),
        (
            "an unknown group of a coarse mesh",
            "\"x\"",
            coarse(plate([0.0, 1.0]), "x"),
        ),
        (
            "a coarse mesh in space",
            "3",
            coarse(Mesh::block([0.0; 3], [1.0; 3], [1; 3]).unwrap(), "bottom"),
        ),
    ] {
        t.refuses("fem::ElasticSystem::contact_with", what, named, || {
            on(partition.clone(), Degree::Continuous)
        });
    }
    t.survives("fem::ElasticSystem::dof", "any node", || {
        system.dof(usize::MAX, usize::MAX)
    });
    t.refuses(
        "fem::TraceSpace::new",
        "an unknown group that is fixed",
        "\"x\"",
        || TraceSpace::new(system.mesh(), "bottom", Some("x")).map(drop),
    );
    let space = || TraceSpace::new(system.mesh(), "bottom", None).unwrap();
    t.survives("fem::TraceSpace::lumped_pairing", "any space", || {
        space().lumped_pairing()
    });
    t.survives("fem::TraceSpace::pairing", "no functions", || {
        space().pairing(0, |_, _| {})
    });
    t.refuses(
        "fem::TraceSpace::pairing",
        "a function that is not there",
        "",
        || space().pairing(1, |_, out| out.push((5, 1.0))),
    );
    for bad in BAD {
        t.refuses("fem::TraceSpace::pairing", "a value", "", || {
            space().pairing(1, |_, out| out.push((0, bad)))
        });
    }
}

/// Triangles of one entity, in MSH 4.1, that belongs to many physical groups.
fn in_groups(groups: usize, elements: usize) -> String {
    let tags: String = (1..=groups).map(|k| format!(" {k}")).collect();
    let triangles: String = (1..=elements).map(|k| format!("{k} 1 2 3\n")).collect();
    format!(
        "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n\
         $Entities\n0 0 1 0\n1 0 0 0 1 1 0 {groups}{tags} 0\n$EndEntities\n\
         $Nodes\n1 3 1 3\n2 1 0 3\n1\n2\n3\n0 0 0\n1 0 0\n0 1 0\n$EndNodes\n\
         $Elements\n1 {elements} 1 {elements}\n2 1 2 {elements}\n{triangles}$EndElements\n"
    )
}

fn readers(t: &mut Table) {
    t.refuses(
        "fem::parse_gmsh",
        "all elements in many groups",
        "physical groups",
        || parse_gmsh(in_groups(2000, 2000).as_bytes(), Path::new("x.msh")),
    );
    t.holds("fem::parse_gmsh", "a cell may be in many groups", || {
        let mesh = parse_gmsh(in_groups(2000, 1).as_bytes(), Path::new("x.msh"));
        mesh.is_ok_and(|m| m.cell_group("physical 2000").is_ok_and(|cells| cells == [0]))
    });
    let path = Path::new("given.msh");
    // Where a section is missing, there is no line to report.
    let file = |input: &str| match input {
        "nothing" | "no text" | "no nodes" => "the file",
        _ => "given.msh",
    };
    let node_lines = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n";
    let hostile: Vec<(&str, Vec<u8>)> = vec![
        ("nothing", vec![]),
        ("no text", vec![0xff; 64]),
        ("another format", b"$MeshFormat\n9.9 0 8\n$EndMeshFormat\n".to_vec()),
        ("no nodes", node_lines.as_bytes().to_vec()),
        ("10^15 blocks of nodes", format!("{node_lines}$Nodes\n1000000000000000 1000000000000000 1 1000000000000000\n").into()),
        ("10^15 nodes in a block", format!("{node_lines}$Nodes\n1 1000000000000000 1 1000000000000000\n2 1 0 1000000000000000\n1\n").into()),
        ("more than usize", format!("{node_lines}$Nodes\n99999999999999999999 1 1 1\n").into()),
        ("usize::MAX nodes", format!("{node_lines}$Nodes\n1 18446744073709551615 1 1\n2 1 0 18446744073709551615\n1\n0 0 0\n$EndNodes\n").into()),
        ("10^15 nodes, format 2", b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1000000000000000\n1 0 0 0\n".to_vec()),
        ("10^15 elements, format 2", b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n$EndNodes\n$Elements\n1000000000000000\n1 2 0 1 1 1\n".to_vec()),
        ("10^9 tags", b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 0 0 0\n$EndNodes\n$Elements\n1\n1 2 1000000000 1 1 1\n$EndElements\n".to_vec()),
        ("10^15 names", b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1000000000000000\n1 1 \"a\"\n".to_vec()),
        ("binary with 10^15 blocks", [b"$MeshFormat\n4.1 1 8\n\x01\x00\x00\x00\n$EndMeshFormat\n$Nodes\n".to_vec(), 1_000_000_000_000_000u64.to_le_bytes().repeat(4)].concat()),
        ("binary with usize::MAX nodes", [b"$MeshFormat\n4.1 1 8\n\x01\x00\x00\x00\n$EndMeshFormat\n$Nodes\n".to_vec(), 1u64.to_le_bytes().to_vec(), u64::MAX.to_le_bytes().to_vec(), 1u64.to_le_bytes().to_vec(), u64::MAX.to_le_bytes().to_vec(), vec![2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0], u64::MAX.to_le_bytes().to_vec()].concat()),
        ("coordinates that are no numbers", b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n1\n1 nan inf 0\n$EndNodes\n".to_vec()),
    ];
    for (input, bytes) in &hostile {
        t.refuses("fem::parse_gmsh", input, file(input), || parse_gmsh(bytes, path));
    }
    let missing = Path::new("no/such/file");
    t.refuses("fem::read_gmsh", "no file", "no/such/file", || read_gmsh(missing));
}

fn derivatives(t: &mut Table) {
    let system = body().assemble().unwrap();
    let all = 2 * system.mesh().num_nodes();
    let by_material = "fem::ElasticSystem::forces_by_material";
    let young = MaterialConstant::Young;
    t.refuses(by_material, "free displacements alone", "length", || {
        system.forces_by_material(&vec![0.0; system.num_free()], young, None)
    });
    t.refuses(by_material, "no such group", "nowhere", || {
        system.forces_by_material(&vec![0.0; all], young, Some("nowhere"))
    });
    t.refuses(
        by_material,
        "a material that is not isotropic",
        "isotropic",
        || {
            let mut c = Material::isotropic(1.0, 0.3).unwrap().components();
            c[0][0][0][0] += 0.5;
            let other = Elasticity::new(square(), Material::tensor(&c).unwrap()).fix("top");
            let system = other.assemble().unwrap();
            system.forces_by_material(&vec![0.0; all], young, None)
        },
    );
    let by_position = "fem::ElasticSystem::forces_by_position";
    t.refuses(by_position, "free displacements alone", "length", || {
        system.forces_by_position(&vec![0.0; system.num_free()])
    });
    let plane = Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]);
    let rows = system.contact("bottom", &plane).unwrap();
    for bad in BAD {
        t.refuses(by_material, "a displacement", "displacement", || {
            system.forces_by_material(&vec![bad; all], young, None)
        });
        t.refuses(by_position, "a displacement", "displacement", || {
            system.forces_by_position(&vec![bad; all])
        });
        t.refuses(
            "fem::ContactRows::traces_by_position",
            "a gradient",
            "gap",
            || rows.traces_by_position(&system, |_| [bad; 3]),
        );
    }
    t.refuses("fem::MaterialConstant::from_name", "another name", "", || {
        "density".parse::<MaterialConstant>()
    });
}
