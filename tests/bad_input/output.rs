use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::Path;

use semismooth::continuation::{
    Branch, Continuation, ContinuationOptions, Diagram, DiagramOptions, Direction,
};
use semismooth::output::{Column, CsvWriter, write_csv, write_diagram_csv};
use semismooth::piecewise::MinMap;

use super::piecewise::vee;
use super::table::{BAD, Table};

/// A disk that is full.
struct Full;
impl Write for Full {
    fn write(&mut self, _: &[u8]) -> io::Result<usize> {
        Err(io::Error::other("no space left"))
    }
    fn flush(&mut self) -> io::Result<()> {
        Err(io::Error::other("no space left"))
    }
}

#[test]
fn outputs() {
    let mut t = Table::new("output");
    let map = vee();
    let o = || ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
    let branch = Branch::follow(&map, &[0.5, 0.5], Direction::Decreasing, o()).unwrap();
    let diagram = Diagram::explore(
        &map,
        &[[0.5, 0.5]],
        &DiagramOptions::default().with_continuation(o()),
    )
    .unwrap();
    let mut events = Vec::new();
    let curve = Continuation::new(&map, &[0.5, 0.5], Direction::Decreasing, o()).unwrap();
    Branch::collect(curve, |e| {
        events.push(e.clone());
        ControlFlow::Continue(())
    })
    .unwrap();
    let other = MinMap::curve(3, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
        a.copy_from_slice(&x[..3]);
        b.fill(1.0);
    });
    let columns = || {
        [
            Column::entry("x", usize::MAX),
            Column::new("nan", |_| f64::NAN),
            Column::new("a,\"b\n", |_| 1.0),
        ]
    };

    t.refuses("output::write_csv", "a full disc", "no space left", || {
        write_csv(&mut Full, &map, &branch, &columns())
    });
    t.survives("output::write_csv", "another map", || {
        write_csv(&mut Vec::new(), &other, &branch, &columns())
    });
    t.refuses(
        "output::write_diagram_csv",
        "a full disc",
        "no space left",
        || write_diagram_csv(&mut Full, &map, &diagram, &columns()),
    );
    t.survives("output::write_diagram_csv", "another map", || {
        write_diagram_csv(&mut Vec::new(), &other, &diagram, &columns())
    });
    t.refuses("output::CsvWriter::new", "a full disc", "no space left", || {
        CsvWriter::new(Full, &map, columns().into()).map(drop)
    });
    t.refuses("output::CsvWriter::write", "a full disc", "no space left", || {
        CsvWriter::appending(Full, &map, columns().into()).write(&events[0])
    });
    t.survives("output::CsvWriter::write", "another map", || {
        let mut writer = CsvWriter::new(Vec::new(), &other, columns().into()).unwrap();
        events.iter().for_each(|e| drop(writer.write(e)));
    });
    for column in columns() {
        t.survives("output::Column::value", "any x", || {
            (column.value(&[]), column.value(&[f64::NAN]))
        });
    }
    #[cfg(feature = "json")]
    {
        use semismooth::output::{JsonLinesWriter, write_diagram_json};
        t.refuses(
            "output::write_diagram_json",
            "a full disc",
            "no space left",
            || write_diagram_json(&mut Full, &map, &diagram, &columns()),
        );
        t.survives("output::write_diagram_json", "another map", || {
            write_diagram_json(&mut Vec::new(), &other, &diagram, &columns())
        });
        t.refuses(
            "output::JsonLinesWriter::write",
            "a full disc",
            "no space left",
            || JsonLinesWriter::new(Full, &map).write(&events[0]),
        );
        t.survives("output::JsonLinesWriter::write", "another map", || {
            let mut writer = JsonLinesWriter::new(Vec::new(), &other);
            events.iter().for_each(|e| drop(writer.write(e)));
        });
    }
    #[cfg(feature = "svg")]
    pictures(&mut t, &branch);
    #[cfg(feature = "svg")]
    reports(&mut t);
    {
        use semismooth::fem::Mesh;
        use semismooth::output::{Field, write_pvd, write_vtu};
        let mesh = Mesh::rectangle([0.0; 2], [1.0; 2], [1, 1]).unwrap();
        let missing = Path::new("no/such/file.vtu");
        t.refuses("output::write_vtu", "no folder", "no/such/file.vtu", || {
            write_vtu(missing, &mesh, &[], &[])
        });
        for (components, n) in [(0, 0), (3, 1), (usize::MAX, 1), (1, 3)] {
            t.refuses("output::write_vtu", "a field of another length", "f", || {
                write_vtu(missing, &mesh, &[Field::new("f", components, vec![1.0; n])], &[])
            });
        }
        t.refuses("output::write_vtu", "another ending", ".vtu or .vtk", || {
            write_vtu("field.xyz", &mesh, &[], &[])
        });
        let series = Path::new("no/such/file.pvd");
        t.refuses("output::write_pvd", "no folder", "no/such/file.pvd", || {
            write_pvd(series, &[(0.0, "a.vtu")])
        });
        for bad in BAD {
            t.refuses("output::write_pvd", "a time", "step 1", || {
                write_pvd(series, &[(0.0, "a.vtu"), (bad, "b.vtu")])
            });
        }
    }
    t.finish();
}

/// A square on the ground.
#[cfg(feature = "svg")]
fn block() -> (
    semismooth::contact::CondensedContact<semismooth::contact::PlanarCoulomb>,
    semismooth::fem::ElasticSystem,
    semismooth::fem::ContactRows,
) {
    use semismooth::contact::{CondensedContact, ContactBody, FrictionCoefficient, LoadPath, PlanarCoulomb};
    use semismooth::fem::{Elasticity, Foundation, Material, Mesh};
    let mesh = Mesh::rectangle([0.0; 2], [1.0; 2], [1, 1]).unwrap();
    let elasticity = Elasticity::new(mesh, Material::isotropic(1.0, 0.3).unwrap()).fix("top");
    let system = elasticity.assemble().unwrap();
    let rows = system
        .contact("bottom", &Foundation::plane([0.0; 3], [0.0, 1.0, 0.0]))
        .unwrap();
    let load = LoadPath::constant(vec![0.0; system.num_free()]);
    let tangential = rows.tangential.clone();
    let body = ContactBody::new(system.stiffness().clone(), rows.normal.clone(), tangential, load).unwrap();
    let law = PlanarCoulomb::new(FrictionCoefficient::constant(0.4).unwrap());
    (CondensedContact::new(body, law).unwrap(), system, rows)
}

#[cfg(feature = "svg")]
fn reports(t: &mut Table) {
    use semismooth::output::{Report, ReportOptions};
    let map = vee();
    let of = |names: &[&str], x: &[f64], to: f64, options: &ReportOptions| {
        Report::of_map(&map, names, x, to, options, |_| ControlFlow::Continue(()))
    };
    let default = ReportOptions::default();
    let (names, entry) = (["y", "α"], "output::Report::of_map");
    t.refuses(entry, "names", "1 names for 2 variables", || {
        of(&["y"], &[0.5, 0.5], 1.0, &default)
    });
    t.refuses(entry, "a start", "1 numbers for 2 variables", || {
        of(&names, &[0.5], 1.0, &default)
    });
    t.refuses(entry, "a range", "two different finite values", || {
        of(&names, &[0.5, 0.5], 0.5, &default)
    });
    t.refuses(entry, "a variable", "variable 2 is to be drawn", || {
        of(
            &names,
            &[0.5, 0.5],
            1.0,
            &ReportOptions::default().with_drawn(vec![2]),
        )
    });
    for bad in BAD {
        t.refuses(entry, "a range", "two different finite values", || {
            of(&names, &[0.5, 0.5], bad, &default)
        });
        t.refuses(entry, "a start", "", || of(&names, &[bad, 0.5], 1.0, &default));
        let loads = ReportOptions::default().with_loads(vec![bad]);
        t.refuses(entry, "a load", "the load", || {
            of(&names, &[0.5, 0.5], 1.0, &loads)
        });
        t.refuses("output::ReportOptions::validate", "a load", "the load", || {
            loads.validate()
        });
    }
    let (mut problem, system, rows) = block();
    let mut few = rows.clone();
    few.nodes.clear();
    let observe = |_: &str| ControlFlow::Continue(());
    for (range, body, names) in [
        ([0.0, 0.0], &rows, "two different"),
        ([0.0, 1.0], &few, "0 contact nodes"),
    ] {
        t.refuses("output::Report::of_contact", names, names, || {
            Report::of_contact(&problem, Some((&system, body)), range, &default, observe)
        });
    }
    t.refuses("output::Report::of_history", "one level", "at least two", || {
        Report::of_history(&mut problem, None, &[0.0], &default, observe)
    });
    let report = of(&names, &[0.5, 0.5], 1.0, &default).unwrap();
    t.refuses("output::Report::write", "no folder", "no/such", || {
        report.write("no/such/report.html")
    });
}

#[cfg(feature = "svg")]
fn pictures(t: &mut Table, branch: &Branch) {
    use semismooth::output::{BranchDiagram, Colour, Curve, Marker, Panel, SegmentStyle};
    let svg = "output::BranchDiagram::to_svg";
    let style = || SegmentStyle::new("s", Colour::RED);
    let line = |points: Vec<(f64, f64)>| Panel::new("x", "y").with_curve(Curve::line(points, style()));
    let good = || line(vec![(0.0, 0.0), (1.0, 1.0)]);
    let draw = |panel: Panel| BranchDiagram::new(panel).to_svg();
    t.refuses(svg, "nothing", "nothing to draw", || draw(Panel::new("x", "y")));
    t.survives(svg, "a curve without points", || draw(line(vec![])));
    t.survives(svg, "a point", || draw(line(vec![(1.0, 1.0)])));
    t.survives(svg, "one level", || draw(line(vec![(0.0, 1.0), (1.0, 1.0)])));
    t.refuses(svg, "styles of another number", "styles", || {
        draw(Panel::new("x", "y").with_curve(Curve::segments(vec![(0.0, 0.0), (1.0, 1.0)], vec![style(); 5])))
    });
    #[cfg(feature = "pdf")]
    {
        let pdf = "output::BranchDiagram::to_pdf";
        let page = |panel: Panel| BranchDiagram::new(panel).to_pdf();
        t.refuses(pdf, "nothing", "nothing to draw", || page(Panel::new("x", "y")));
        t.survives(pdf, "letters that no font has", || {
            BranchDiagram::new(good())
                .with_title("\u{1f600} \u{0} 漢字")
                .to_pdf()
        });
        for bad in BAD {
            t.refuses(pdf, "a vertex", "vertex 1", || {
                page(line(vec![(0.0, 0.0), (bad, 1.0)]))
            });
        }
    }
    for bad in [0.0, -1.0] {
        t.refuses(svg, "what has no logarithm", "logarithmic", || {
            draw(line(vec![(1.0, 1.0), (bad, 2.0)]).with_log_x())
        });
    }
    for bad in BAD {
        t.refuses(svg, "a vertex", "vertex 1", || {
            draw(line(vec![(0.0, 0.0), (bad, 1.0)]))
        });
        t.refuses(svg, "a vertex", "vertex 0", || {
            draw(line(vec![(0.0, bad), (1.0, 1.0)]))
        });
        t.refuses(svg, "a range", "range", || draw(good().with_x_range(bad, 1.0)));
        t.refuses(svg, "a range", "range", || draw(good().with_y_range(0.0, bad)));
        t.survives(svg, "a mark", || {
            let curve = Curve::line(vec![(0.0, 0.0), (1.0, 1.0)], style());
            draw(
                Panel::new("x", "y").with_curve(
                    curve
                        .with_marks(Marker::Transition, [(bad, 0.0)])
                        .with_marks(Marker::Branching, [(0.0, bad)]),
                ),
            )
        });
        t.survives(svg, "an ordinate", || {
            draw(Panel::new("x", "y").with_curve(Curve::of_branch(branch, |_| bad, |_, _| style())))
        });
    }
    t.refuses(svg, "an empty range", "range", || {
        draw(good().with_x_range(1.0, 1.0))
    });
    t.refuses(svg, "a range turned round", "range", || {
        draw(good().with_y_range(1.0, 0.0))
    });
    for size in [1e-320, 1e-300, 1e300, f64::MAX] {
        t.survives(svg, "sizes", || draw(line(vec![(-size, size), (size, -size)])));
        t.survives(svg, "sizes", || {
            draw(line(vec![(1.0, size), (1.0 + f64::EPSILON, 2.0 * size)]))
        });
        t.survives(svg, "a range", || draw(good().with_x_range(-size, size)));
    }
    for (width, height) in [(0, 0), (1, 1), (u32::MAX, u32::MAX), (800, 0)] {
        t.survives(svg, "a size", || {
            BranchDiagram::new(good()).with_size(width, height).to_svg()
        });
    }
    let mesh = semismooth::fem::Mesh::rectangle([0.0; 2], [1.0; 2], [1, 1]).unwrap();
    let body = || semismooth::output::BodyPicture::new(&mesh);
    for bad in BAD {
        t.refuses("output::BodyPicture::to_svg", "displacements", "node 0", || {
            body().with_displacements(vec![bad; 8], 1.0).to_svg()
        });
        t.refuses(
            "output::BodyPicture::to_svg",
            "the magnification",
            "magnification",
            || body().with_displacements(vec![1.0; 8], bad).to_svg(),
        );
        t.survives("output::BodyPicture::to_svg", "a field", || {
            body().with_field("field", vec![bad]).to_svg()
        });
    }
    let (_, system, rows) = block();
    let states = vec![semismooth::contact::ContactState::Open; rows.nodes.len()];
    let still = vec![0.0; system.num_free()];
    let drawn = |states: &[_], free: &[f64], magnification| {
        semismooth::output::BodyPicture::of_contact(&system, &rows.nodes, states, [free, &[]], magnification)?
            .to_svg()
    };
    let of_contact = "output::BodyPicture::of_contact";
    t.refuses(of_contact, "free displacements", "free displacements", || {
        drawn(&states, &[], None)
    });
    t.refuses(of_contact, "states of fewer nodes", "states", || {
        drawn(&states[1..], &still, None)
    });
    for bad in BAD {
        t.refuses(of_contact, "the magnification", "magnification", || {
            drawn(&states, &still, Some(bad))
        });
        t.refuses(of_contact, "a displacement", "node", || {
            drawn(&states, &vec![bad; still.len()], None)
        });
    }
    t.refuses(
        "output::BodyPicture::write",
        "no folder",
        "no/such/file.svg",
        || body().write(Path::new("no/such/file.svg")),
    );
    t.refuses(
        "output::BranchDiagram::write",
        "no folder",
        "no/such/file.svg",
        || BranchDiagram::new(good()).write(Path::new("no/such/file.svg")),
    );
}
