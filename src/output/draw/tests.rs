use super::*;
use crate::output::diagram::{Curve, SegmentStyle};

fn blue() -> SegmentStyle {
    SegmentStyle::new("blue <&> \"quoted\"", Colour::BLUE)
}

fn diagram(vertices: Vec<Point>) -> BranchDiagram {
    BranchDiagram::new(Panel::new("α <\u{1}>", "y & z").with_curve(Curve::line(vertices, blue())))
}

/// Checks the part of XML well-formedness that matters here: tags nest, attributes are quoted, no bare ampersand.
fn assert_well_formed(svg: &str) {
    let mut open = Vec::new();
    for piece in svg.split('<').skip(1) {
        let (tag, text) = piece.split_once('>').expect("a tag ends");
        assert!(!text.contains('>'), "bare > in {text:?}");
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        for entity in piece.split('&').skip(1) {
            let name = entity.split(';').next().unwrap();
            assert!(["lt", "gt", "amp", "quot", "apos"].contains(&name), "{entity}");
        }
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name));
        } else if !tag.ends_with('/') {
            open.push(tag.split_whitespace().next().unwrap());
        }
    }
    assert!(open.is_empty(), "{open:?}");
    assert!(!svg.chars().any(|c| c.is_control() && c != '\n'));
}

#[test]
fn pictures_are_well_formed_and_the_same_every_time() {
    let curve = Curve::line(vec![(0.0, 0.0), (1.0, 2.0), (0.5, 3.0)], blue())
        .with_marks(Marker::Transition, [(1.0, 2.0), (0.5, 3.0), (9.0, 9.0)])
        .with_marks(Marker::Branching, [(0.2, 0.4)])
        .with_marks(Marker::Start, [(0.0, 0.0)]);
    let d = BranchDiagram::new(Panel::new("α", "y").with_curve(curve).with_caption("a < b"))
        .with_title("R&D \u{0}")
        .with_panel(Panel::new("x", "y").with_curve(Curve::line(vec![(0.0, 0.0)], blue())));
    let svg = d.to_svg().unwrap();
    assert_well_formed(&svg);
    assert_eq!(svg, d.to_svg().unwrap());
    // Two transitions inside the axes, and the legend's.
    assert_eq!(svg.matches("<circle").count(), 3);
    assert!(svg.contains("width=\"640\" height=\"420\" viewBox=\"0 0 640 420\""));
}

#[test]
fn bad_data_give_their_error() {
    use OutputError::{Empty, NotDrawable, Range, Segments, Size};
    assert!(matches!(diagram(vec![]).to_svg(), Err(Empty { .. })));
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e101, f64::MAX] {
        let d = diagram(vec![(0.0, 0.0), (1.0, bad)]);
        assert!(matches!(d.to_svg(), Err(NotDrawable { vertex: 1, .. })));
        let d = diagram(vec![(0.0, 0.0), (1.0, 1.0)]);
        let curve = d.panels[0].curves[0]
            .clone()
            .with_marks(Marker::Transition, [(bad, 0.0)]);
        let d = BranchDiagram::new(Panel::new("", "").with_curve(curve));
        assert!(matches!(d.to_svg(), Err(NotDrawable { vertex: 0, .. })));
    }
    let d =
        BranchDiagram::new(Panel::new("", "").with_curve(Curve::segments(vec![(0.0, 0.0)], vec![blue()])));
    assert!(matches!(d.to_svg(), Err(Segments { .. })));
    let d = diagram(vec![(0.0, 0.0), (1.0, 1.0)]);
    for (w, h) in [(0, 0), (159, 400), (400, 159), (u32::MAX, 400), (400, u32::MAX)] {
        assert!(matches!(d.clone().with_size(w, h).to_svg(), Err(Size { .. })));
    }
    for range in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
        let mut d = d.clone();
        d.panels[0].ranges.1 = Some(range);
        assert!(matches!(d.to_svg(), Err(Range { .. })));
    }
}

#[test]
fn regions_notes_and_folds_are_drawn() {
    let square = vec![(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    let shade = Colour::new(1, 2, 3);
    let panel = || Panel::new("x", "y").with_region(square.clone(), shade);
    let plain = BranchDiagram::new(panel().with_class(SegmentStyle::new("all of it", shade)));
    let svg = plain.to_svg().unwrap();
    assert_well_formed(&svg);
    // The region, and its class in the legend.
    assert!(svg.contains("<polygon") && svg.contains("all of it"));
    let outside = BranchDiagram::new(panel().with_x_range(2.0, 3.0))
        .to_svg()
        .unwrap();
    assert!(!outside.contains("<polygon"));
    let noted = BranchDiagram::new(
        panel()
            .with_note((0.5, 0.5), "T1 & T2")
            .with_note((5.0, 5.0), "far"),
    );
    let svg = noted.to_svg().unwrap();
    assert_well_formed(&svg);
    assert!(svg.contains("T1 &amp; T2") && !svg.contains("far"));
    let curve =
        Curve::line(vec![(0.0, 0.0), (1.0, 1.0)], blue()).with_marks(Marker::SmoothFold, [(0.5, 0.5)]);
    let marked = BranchDiagram::new(Panel::new("x", "y").with_curve(curve));
    assert!(marked.to_svg().unwrap().contains("smooth fold"));
    for bad in [f64::NAN, f64::INFINITY, 1e101] {
        let region = Panel::new("x", "y").with_region(vec![(0.0, bad)], shade);
        assert!(matches!(
            BranchDiagram::new(region).to_svg(),
            Err(OutputError::Region { region: 0, .. })
        ));
        let note = panel().with_note((bad, 0.0), "n");
        assert!(matches!(
            BranchDiagram::new(note).to_svg(),
            Err(OutputError::Note { note: 0, .. })
        ));
    }
}

#[test]
fn degenerate_data_can_be_drawn() {
    let tiny = f64::MIN_POSITIVE;
    for vertices in [
        vec![(1.0, 1.0)],
        vec![(1.0, 1.0), (1.0, 1.0)],
        vec![(1.0, 0.0), (1.0, 5.0)],
        vec![(0.0, 2.0), (1.0, 2.0)],
        vec![(0.0, 0.0), (tiny, tiny)],
        vec![(1e15, 1e15), (1e15 + 1.0, 1e15)],
        vec![(-1e100, 1e100), (1e100, -1e100)],
        vec![(1e-99, 1e99), (2e-99, -1e99)],
    ] {
        for size in [(160, 160), (640, 420), (10_000, 10_000)] {
            let svg = diagram(vertices.clone()).with_size(size.0, size.1).to_svg();
            assert_well_formed(&svg.unwrap());
        }
    }
    let mut narrow = diagram(vec![(0.0, 0.0), (1.0, 1.0)]);
    narrow.panels[0].ranges.0 = Some((1.0, 1.0 + f64::EPSILON));
    assert_well_formed(&narrow.to_svg().unwrap());
}

#[test]
fn vertical_segments_are_drawn() {
    let svg = diagram(vec![(2.0, 0.0), (2.0, 1.0)]).to_svg().unwrap();
    assert!(svg.contains("polyline"));
}

#[test]
fn arrows_are_drawn_when_asked_for() {
    let heads = |arrows: bool| {
        let curve = Curve::line(vec![(0.0, 0.0), (1.0, 1.0)], blue()).with_arrows(arrows);
        let svg = BranchDiagram::new(Panel::new("", "").with_curve(curve)).to_svg();
        svg.unwrap().matches("<polygon").count()
    };
    assert_eq!(heads(false), 0);
    assert!(heads(true) > 0);
}

#[test]
fn labels_are_set_with_their_scripts() {
    let panel = Panel::new("u_t [m]", "λ_ν").with_curve(Curve::line(vec![(0.0, 0.0), (1.0, 2e-7)], blue()));
    let svg = BranchDiagram::new(panel).to_svg().unwrap();
    assert_well_formed(&svg);
    assert!(
        svg.contains(
            ">u<tspan dy=\"3.08\" font-size=\"9.8\">t</tspan><tspan dy=\"-3.08\"> [m]</tspan></text>"
        )
    );
    assert!(svg.contains(">λ<tspan") && svg.contains(">−7</tspan>") && !svg.contains('_'));
}

/// Every kind of mark has its own symbol and its own name.
#[test]
fn marks_differ() {
    let signs: Vec<String> = Marker::ALL
        .iter()
        .map(|kind| format!("{:?}", mark(*kind, (0.0, 0.0), 5.0)))
        .collect();
    let names: Vec<&str> = Marker::ALL.iter().map(|k| k.name()).collect();
    for k in 1..signs.len() {
        assert!(!signs[..k].contains(&signs[k]) && !names[..k].contains(&names[k]));
    }
}

/// Marks of one kind that would cover each other are drawn once.
#[test]
fn marks_do_not_pile_up() {
    let fold = |k: usize| (0.5 + 1e-6 * k as f64, 0.5);
    let curve =
        Curve::line(vec![(0.0, 0.0), (1.0, 1.0)], blue()).with_marks(Marker::Transition, (0..9).map(fold));
    let svg = BranchDiagram::new(Panel::new("", "").with_curve(curve))
        .to_svg()
        .unwrap();
    // The other one is in the legend.
    assert_eq!(svg.matches("<circle").count(), 2);
}

/// y = x³ is a straight line between logarithmic axes.
#[test]
fn powers_are_lines_on_logarithmic_axes() {
    let cubic = |k: i32| (10.0_f64.powi(k), 10.0_f64.powi(3 * k));
    let curve = Curve::line((-2..=2).map(cubic).collect(), blue());
    let panel = Panel::new("x", "y").with_curve(curve).with_log_x().with_log_y();
    let drawn = shapes(&BranchDiagram::new(panel)).unwrap();
    let points = drawn.iter().find_map(|s| match s {
        Shape::Line { points, width, .. } if *width == CURVE => Some(points),
        _ => None,
    });
    let points = points.unwrap();
    assert_eq!(points.len(), 5);
    for w in points.windows(3) {
        assert!((w[2].0 - 2.0 * w[1].0 + w[0].0).abs() < 1e-9);
        assert!((w[2].1 - 2.0 * w[1].1 + w[0].1).abs() < 1e-9);
        assert!(w[1].0 > w[0].0 && w[1].1 < w[0].1);
    }
    for bad in [0.0, -1.0] {
        let curve = Curve::line(vec![(1.0, 1.0), (2.0, bad)], blue());
        let panel = Panel::new("x", "y").with_curve(curve).with_log_y();
        let refused = BranchDiagram::new(panel).to_svg();
        assert_eq!(refused, Err(OutputError::Logarithm { panel: 0, value: bad }));
    }
}

/// Only what lies in the range of the abscissa counts for that of the ordinate.
#[test]
fn ranges_are_those_of_what_is_shown() {
    let curve = Curve::line(vec![(0.0, 0.0), (1.0, 1.0), (2.0, 1000.0)], blue());
    let panel = Panel::new("x", "y").with_curve(curve).with_x_range(-1.0, 1.0);
    let (x, y) = panel_ranges(0, &panel).unwrap();
    assert_eq!(x, (-1.0, 1.0));
    assert!(y.0 < 0.0 && y.1 > 1.0 && y.1 < 1.1, "{y:?}");
}

#[test]
fn notes_keep_clear_of_curves_and_of_each_other() {
    let cross = [vec![(0.0, 0.0), (1.0, 1.0)], vec![(0.0, 1.0), (1.0, 0.0)]];
    let panel = cross.into_iter().fold(Panel::new("", ""), |panel, line| {
        let curve = Curve::line(line, blue()).with_marks(Marker::Branching, [(0.5, 0.5)]);
        panel.with_curve(curve)
    });
    let panel = ["T1", "T2", "T3", "T4"]
        .iter()
        .fold(panel, |panel, note| panel.with_note((0.5, 0.5), *note));
    let drawn = shapes(&BranchDiagram::new(panel)).unwrap();
    let (notes, rest): (Vec<&Shape>, Vec<&Shape>) = drawn.iter().partition(
        |s| matches!(s, Shape::Text { runs, .. } if runs.first().is_some_and(|r| r.1.starts_with('T'))),
    );
    let room = |s: &Shape| match s {
        Shape::Text { at, .. } => ((at.0 - 8.0, at.0 + 8.0), (at.1 - 6.0, at.1 + 6.0)),
        _ => unreachable!(),
    };
    assert_eq!(notes.len(), 4);
    for (k, note) in notes.iter().enumerate() {
        let (x, y) = room(note);
        for other in &notes[..k] {
            let (u, v) = room(other);
            assert!(x.1 <= u.0 || u.1 <= x.0 || y.1 <= v.0 || v.1 <= y.0);
        }
        for shape in &rest {
            if let Shape::Line { points, width, .. } = shape
                && *width == CURVE
            {
                assert!(points.windows(2).all(|w| clip(w[0], w[1], x, y).is_none()));
            }
        }
    }
}

/// The unit circle in eight arcs, from angle 0 on, as many as asked for, with the tangents at their ends.
fn circle(arcs: usize) -> Curve {
    let at = |k: usize| {
        let (s, c) = (std::f64::consts::FRAC_PI_4 * k as f64).sin_cos();
        ((c, s), (-s, c))
    };
    Curve {
        tangents: (0..arcs).map(|k| [at(k).1, at(k + 1).1]).collect(),
        ..Curve::line((0..=arcs).map(|k| at(k).0).collect(), blue())
    }
}

/// The curve of a picture as chords, in the coordinates of its panel, which has the given ranges.
fn drawn(curve: Curve, x: Range, y: Range) -> Vec<Vec<Point>> {
    let panel = Panel::new("x", "y")
        .with_curve(curve)
        .with_x_range(x.0, x.1)
        .with_y_range(y.0, y.1);
    let shapes = shapes(&BranchDiagram::new(panel)).unwrap();
    let frame: Vec<Pixel> = shapes
        .iter()
        .find_map(|s| match s {
            Shape::Line { points, .. } if points.len() == 5 => Some(points.clone()),
            _ => None,
        })
        .unwrap();
    let share = |v: f64, from: f64, to: f64| (v - from) / (to - from);
    let place = |p: Pixel| {
        let (s, t) = (
            share(p.0, frame[0].0, frame[1].0),
            share(p.1, frame[0].1, frame[2].1),
        );
        (x.0 + s * (x.1 - x.0), y.0 + t * (y.1 - y.0))
    };
    let lines = shapes.iter().filter_map(|s| match s {
        Shape::Line {
            points, bends, width, ..
        } if *width == CURVE => Some(shape::flat(points, bends)),
        _ => None,
    });
    lines.map(|l| l.into_iter().map(place).collect()).collect()
}

/// Eight arcs with the tangents at their ends miss a circle by 0.3 % of its radius, chords by 7.6 %; by no
/// more where it looks like an ellipse.
#[test]
fn curves_are_drawn_with_their_tangents() {
    for wide in [1.5, 6.0, 60.0] {
        let lines = drawn(circle(8), (-wide, wide), (-1.2, 1.2));
        assert_eq!(lines.len(), 1);
        assert_eq!(lines[0].len(), 1 + 8 * 16);
        let off = lines[0]
            .iter()
            .map(|p| (p.0.hypot(p.1) - 1.0).abs())
            .fold(0.0, f64::max);
        assert!(off > 1e-4 && off < 3.2e-3, "{off}");
    }
}

/// An arc of y² = x is drawn as it is from any two points and tangents of any length, and one that bends both
/// ways stays between its ends.
#[test]
fn parabolas_are_exact() {
    for (a, b) in [(0.0, 1.0), (-1.0, 2.0), (-0.5, 0.5), (3.0, 3.5)] {
        let at = |y: f64| (40.0 * y * y, 90.0 * y);
        let slope = |y: f64, size: f64| (80.0 * y * size, 90.0 * size);
        let ends = [at(a), at(b)];
        let bend = lines::bend(ends[0], ends[1], [slope(a, 1e-3), slope(b, 7.0)]);
        let chords = shape::flat(&ends, &[bend]);
        assert_eq!(chords.len(), 17);
        for p in chords {
            let y = p.1 / 90.0;
            assert!((p.0 - 40.0 * y * y).abs() < 1e-9, "{p:?}");
        }
    }
    let ends = [(0.0, 0.0), (30.0, 0.0)];
    let both = lines::bend(ends[0], ends[1], [(1.0, 1.0), (1.0, 1.0)]);
    let chords = shape::flat(&ends, &[both]);
    let sum = chords.iter().map(|p| p.1).sum::<f64>();
    assert!(
        sum.abs() < 1e-9 && chords.iter().all(|p| p.1.abs() < 3.0),
        "{chords:?}"
    );
}

#[test]
fn arcs_are_cut_at_the_axes() {
    let lines = drawn(circle(4), (-0.8, 0.8), (0.0, 2.0));
    // The upper half without its ends.
    assert_eq!(lines.len(), 1);
    let points = lines.concat();
    assert!(
        points.iter().all(|p| p.0.abs() <= 0.8 + 1e-9 && p.1 >= -1e-9),
        "{points:?}"
    );
    let off = points
        .iter()
        .map(|p| (p.0.hypot(p.1) - 1.0).abs())
        .fold(0.0, f64::max);
    assert!(off < 5e-3, "{off}");
    assert!((points[0].0 - 0.8).abs() < 1e-9 && (points[points.len() - 1].0 + 0.8).abs() < 1e-9);
}

/// Tangents along the chord leave a line a line, and what has no direction is straight.
#[test]
fn straight_pieces_stay_lines() {
    let chords = |tangents: Vec<[Point; 2]>| {
        let curve = Curve {
            tangents,
            ..Curve::line(vec![(0.0, 0.0), (1.0, 2.0), (1.0, 3.0)], blue())
        };
        BranchDiagram::new(Panel::new("x", "y").with_curve(curve))
            .to_svg()
            .unwrap()
    };
    let plain = chords(Vec::new());
    assert!(plain.contains("<polyline") && !plain.contains("<path"));
    for along in [
        [(1e-9, 2e-9), (1e9, 2e9)],
        [(f64::NAN, 1.0), (1.0, 0.0)],
        [(0.0, 0.0), (1.0, 0.0)],
    ] {
        assert_eq!(chords(vec![along, [(0.0, 1.0); 2]]), plain);
    }
    let bent = chords(vec![[(1.0, 0.0), (0.0, 1.0)], [(0.0, 1.0); 2]]);
    assert_well_formed(&bent);
    // The bend, and the line behind it.
    let path = bent.split(" d=\"").nth(1).unwrap().split('"').next().unwrap();
    let commands: String = path.chars().filter(|c| c.is_alphabetic()).collect();
    assert_eq!(commands, "MCL");
}

/// y = 10^x is straight on a logarithmic ordinate, with or without its tangents.
#[test]
fn tangents_are_those_of_the_axes() {
    let at = |x: f64| (x, 10.0_f64.powf(x));
    let slope = |x: f64| (1.0, std::f64::consts::LN_10 * 10.0_f64.powf(x));
    let curve = Curve {
        tangents: vec![[slope(0.0), slope(1.0)], [slope(1.0), slope(3.0)]],
        ..Curve::line(vec![at(0.0), at(1.0), at(3.0)], blue())
    };
    let picture = |curve, log: bool| {
        let panel = Panel::new("x", "y").with_curve(curve);
        BranchDiagram::new(if log { panel.with_log_y() } else { panel })
            .to_svg()
            .unwrap()
    };
    let polygon = Curve {
        tangents: Vec::new(),
        ..curve.clone()
    };
    assert_eq!(picture(curve.clone(), true), picture(polygon, true));
    assert!(picture(curve, false).contains("<path"));
}

#[path = "../../../tests/support/vision.rs"]
mod vision;

#[test]
fn colours_differ_for_every_reader() {
    let colours = [
        Colour::RED,
        Colour::GREEN,
        Colour::BLUE,
        Colour::GREY,
        Colour::ORANGE,
        Colour::PURPLE,
    ];
    for (k, a) in colours.iter().enumerate() {
        for b in &colours[..k] {
            let [p, q] = [a, b].map(|c| [c.red, c.green, c.blue]);
            assert!(vision::distance(p, q) > 20.0, "{a:?} {b:?}");
        }
    }
}

#[cfg(feature = "pdf")]
mod pages {
    use super::*;

    /// The PDF decodes to streams with balanced operators, and contains the letters of labels in the codes of their fonts.
    #[test]
    fn pages_hold_the_same_picture() {
        let curve = Curve::line(vec![(0.0, 0.0), (1.0, 2.0)], blue())
            .with_marks(Marker::Transition, [(0.5, 1.0)])
            .with_marks(Marker::Fold, [(1.0, 2.0)]);
        let d = BranchDiagram::new(Panel::new("f_ν [kN]", "u").with_curve(curve)).with_title("A (b) €");
        let page = d.to_pdf().unwrap();
        assert_eq!(page, d.to_pdf().unwrap());
        assert!(page.starts_with(b"%PDF-1.7") && page.ends_with(b"%%EOF"));
        let text = String::from_utf8_lossy(&page);
        assert_eq!(text.matches("\nBT\n").count(), text.matches("\nET\n").count());
        assert!(text.contains("/MediaBox [0 0 480 315]"));
        // ν is the letter n of Symbol; a sign that no font has is a question mark.
        assert!(text.contains("(n) Tj") && text.contains("([kN]) Tj") | text.contains("( [kN]) Tj"));
        assert!(text.contains("?) Tj"));
        let circles = |d: &BranchDiagram| {
            let shapes = shapes(d).unwrap();
            shapes
                .iter()
                .filter(|s| matches!(s, Shape::Circle { .. }))
                .count()
        };
        assert_eq!(text.matches(" c\n").count(), 4 * circles(&d));
        let arcs = BranchDiagram::new(Panel::new("x", "y").with_curve(circle(3)));
        let page = arcs.to_pdf().unwrap();
        assert_eq!(String::from_utf8_lossy(&page).matches(" c\n").count(), 3);
    }
}
