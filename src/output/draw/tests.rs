use super::*;

fn blue() -> SegmentStyle {
    SegmentStyle::new("blue <&> \"quoted\"", Colour::BLUE)
}

fn diagram(vertices: Vec<Point>) -> BranchDiagram {
    BranchDiagram::new(Panel::new("α <\u{1}>", "y & z").with_curve(Curve::line(vertices, blue())))
}

/// Tags open and close in order, attributes are quoted, no bare ampersand: enough of XML for what is written here.
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
        .with_transitions(vec![(1.0, 2.0), (0.5, 3.0), (9.0, 9.0)])
        .with_branchings(vec![(0.2, 0.4)])
        .with_start(true);
    let d = BranchDiagram::new(Panel::new("α", "y").with_curve(curve).with_caption("a < b"))
        .with_title("R&D \u{0}")
        .with_panel(Panel::new("x", "y").with_curve(Curve::line(vec![(0.0, 0.0)], blue()).with_start(true)));
    let svg = d.to_svg().unwrap();
    assert_well_formed(&svg);
    assert_eq!(svg, d.to_svg().unwrap());
    // Two transitions inside the axes, and the legend's.
    assert_eq!(svg.matches("<circle").count(), 3);
    assert!(svg.contains("width=\"640\" height=\"420\" viewBox=\"0 0 2560 1680\""));
    assert!(svg.contains("font-family=\"sans-serif\""));
}

#[test]
fn bad_data_give_their_error() {
    use OutputError::{Empty, NotDrawable, Range, Segments, Size};
    assert!(matches!(diagram(vec![]).to_svg(), Err(Empty { .. })));
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e101, f64::MAX] {
        let d = diagram(vec![(0.0, 0.0), (1.0, bad)]);
        assert!(matches!(d.to_svg(), Err(NotDrawable { vertex: 1, .. })));
        let d = diagram(vec![(0.0, 0.0), (1.0, 1.0)]);
        let curve = d.panels[0].curves[0].clone().with_transitions(vec![(bad, 0.0)]);
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
    let curve = Curve::line(vec![(0.0, 0.0), (1.0, 1.0)], blue()).with_arrows(false);
    let marked =
        BranchDiagram::new(Panel::new("x", "y").with_curve(curve.with_smooth_folds(vec![(0.5, 0.5)])));
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
