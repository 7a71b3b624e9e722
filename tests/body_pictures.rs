//! Pictures of bodies: what is drawn where, in which colour.
#![cfg(feature = "svg")]

use semismooth::contact::ContactState;
use semismooth::fem::Mesh;
use semismooth::output::{BodyPicture, OutputError, SegmentStyle};

/// The corners of the polygons of a picture, with their colours.
fn polygons(svg: &str) -> Vec<(Vec<(f64, f64)>, String)> {
    let attribute = |element: &str, name: &str| {
        let from = element.split_once(&format!(" {name}=\""))?.1;
        Some(from.split_once('"')?.0.to_owned())
    };
    svg.split("<polygon")
        .skip(1)
        .filter_map(|element| {
            let points = attribute(element, "points")?;
            let corner = |p: &str| {
                p.split_once(',')
                    .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
            };
            Some((
                points.split(' ').filter_map(corner).collect(),
                attribute(element, "fill")?,
            ))
        })
        .collect()
}

fn area(corners: &[(f64, f64)]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    let twice: f64 = corners.iter().zip(next).map(|(a, b)| a.0 * b.1 - a.1 * b.0).sum();
    0.5 * twice.abs()
}

#[test]
fn one_scale_serves_both_directions() {
    let mesh = Mesh::rectangle([0.0, 0.0], [3.0, 1.0], [3, 1]).unwrap();
    let drawn = polygons(&BodyPicture::new(&mesh).to_svg().unwrap());
    assert_eq!(drawn.len(), 3);
    for (corners, _) in &drawn {
        // Cells 1 × 1 are squares in the picture, with two decimals.
        let (a, b, c) = (corners[0], corners[1], corners[2]);
        let (width, height) = ((b.0 - a.0).abs(), (c.1 - b.1).abs());
        assert!((width - height).abs() < 0.03 && width > 100.0, "{width} {height}");
    }
}

#[test]
fn displacements_are_magnified() {
    // A uniform stretch by ½ in the first direction: twice of it doubles the width at the same height.
    let mesh = Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [1, 1]).unwrap();
    let stretch: Vec<f64> = mesh.points().iter().flat_map(|p| [0.5 * p[0], 0.0]).collect();
    let drawn = polygons(
        &BodyPicture::new(&mesh)
            .with_displacements(stretch, 2.0)
            .to_svg()
            .unwrap(),
    );
    let xs = drawn[0].0.iter().map(|p| p.0);
    let ys = drawn[0].0.iter().map(|p| p.1);
    let span = |v: &mut dyn Iterator<Item = f64>| {
        let all: Vec<f64> = v.collect();
        all.iter().copied().fold(f64::MIN, f64::max) - all.iter().copied().fold(f64::MAX, f64::min)
    };
    let (width, height) = (span(&mut { xs }), span(&mut { ys }));
    assert!((width / height - 2.0).abs() < 1e-3, "{width} {height}");
}

#[test]
fn the_least_and_the_greatest_value_have_the_ends_of_the_scale() {
    let mesh = Mesh::rectangle([0.0, 0.0], [4.0, 1.0], [4, 1]).unwrap();
    let values = vec![-2.0, f64::NAN, 6.0, 2.0];
    let svg = BodyPicture::new(&mesh).with_field("p", values).to_svg().unwrap();
    let colours: Vec<String> = polygons(&svg).into_iter().take(4).map(|p| p.1).collect();
    assert_eq!(colours, ["#440154", "#d6dce2", "#fde725", "#21918c"]);
    // The bar has its numbers.
    for tick in [">−2<", ">0<", ">6<", ">p<"] {
        assert!(svg.contains(tick), "{tick}");
    }
}

#[test]
fn a_cube_shows_three_faces_and_nothing_behind_them() {
    let mesh = Mesh::block([0.0; 3], [1.0; 3], [2, 2, 2]).unwrap();
    // From the diagonal the three faces look alike, and the outline is a regular hexagon.
    let elevation = 0.5f64.sqrt().atan().to_degrees();
    let svg = BodyPicture::new(&mesh)
        .with_view(45.0, elevation)
        .to_svg()
        .unwrap();
    let drawn = polygons(&svg);
    assert_eq!(drawn.len(), 12);
    let areas: Vec<f64> = drawn.iter().map(|p| area(&p.0)).collect();
    for a in &areas {
        assert!((a - areas[0]).abs() < 1e-3 * areas[0], "{areas:?}");
    }
    let above = polygons(&BodyPicture::new(&mesh).with_view(0.0, 90.0).to_svg().unwrap());
    // Sides that are seen from their edge have no area, or are not drawn.
    assert_eq!(above.iter().filter(|p| area(&p.0) > 1.0).count(), 4);
}

#[test]
fn what_is_near_is_drawn_last() {
    // Two cubes one behind the other, joined in one mesh by a row of cells, seen along the row.
    let mesh = Mesh::block([0.0; 3], [3.0, 1.0, 1.0], [3, 1, 1]).unwrap();
    let values = vec![0.0, 0.5, 1.0];
    let from_the_right = BodyPicture::new(&mesh)
        .with_field("x", values.clone())
        .with_view(20.0, 30.0);
    let from_the_left = BodyPicture::new(&mesh)
        .with_field("x", values)
        .with_view(200.0, 30.0);
    // The bar's bands come after the cells: 3 tops, 3 sides, 1 end.
    let last_cell = |picture: &BodyPicture<'_>| polygons(&picture.to_svg().unwrap())[6].1.clone();
    assert_eq!(last_cell(&from_the_right), "#fde725");
    assert_eq!(last_cell(&from_the_left), "#440154");
}

#[test]
fn marks_are_named_once() {
    let mesh = Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [2, 2]).unwrap();
    let slip = SegmentStyle::contact(ContactState::SlipPlus, false);
    let picture = BodyPicture::new(&mesh)
        .with_mark(0, slip.clone())
        .with_mark(1, slip)
        .with_mark(2, SegmentStyle::contact(ContactState::Open, false));
    let svg = picture.to_svg().unwrap();
    assert_eq!(svg.matches(">slip<").count(), 1);
    assert_eq!(svg.matches(">no contact<").count(), 1);
    assert_eq!(svg.matches("<circle").count(), 3);
}

#[test]
fn marks_on_the_far_side_are_hidden() {
    let mesh = Mesh::block([0.0; 3], [1.0; 3], [2, 2, 2]).unwrap();
    let class = SegmentStyle::contact(ContactState::Stick, false);
    let middle_of = |z: f64| mesh.points().iter().position(|p| *p == [0.5, 0.5, z]).unwrap();
    let seen = |node: usize, elevation: f64| {
        let picture = BodyPicture::new(&mesh).with_view(-60.0, elevation);
        picture
            .with_mark(node, class.clone())
            .to_svg()
            .unwrap()
            .contains("<circle")
    };
    let (bottom, inside, top) = (middle_of(0.0), middle_of(0.5), middle_of(1.0));
    assert_eq!(
        [seen(bottom, 30.0), seen(inside, 30.0), seen(top, 30.0)],
        [false, false, true]
    );
    assert_eq!(
        [seen(bottom, -30.0), seen(inside, -30.0), seen(top, -30.0)],
        [true, false, false]
    );
}

#[test]
fn bad_pictures_are_refused() {
    let mesh = Mesh::rectangle([0.0, 0.0], [1.0, 1.0], [1, 1]).unwrap();
    let new = || BodyPicture::new(&mesh);
    assert!(matches!(
        new().with_displacements(vec![0.0; 7], 1.0).to_svg(),
        Err(OutputError::Field {
            expected: 8,
            found: 7,
            ..
        })
    ));
    assert!(matches!(
        new().with_field("s", vec![]).to_svg(),
        Err(OutputError::Field {
            expected: 1,
            found: 0,
            ..
        })
    ));
    for wrong in [f64::NAN, f64::INFINITY, 1e200] {
        let mut u = vec![0.0; 8];
        u[5] = wrong;
        assert!(matches!(
            new().with_displacements(u, 1.0).to_svg(),
            Err(OutputError::Node { node: 2 })
        ));
    }
    let error = new()
        .with_displacements(vec![0.0; 8], f64::NAN)
        .to_svg()
        .unwrap_err();
    assert!(error.to_string().contains("magnification"), "{error}");
    let class = SegmentStyle::contact(ContactState::Open, false);
    assert!(matches!(
        new().with_mark(4, class).to_svg(),
        Err(OutputError::Node { node: 4 })
    ));
    assert!(matches!(
        new().with_size(10, 400).to_svg(),
        Err(OutputError::Size { .. })
    ));
    // A field of one value, and a body without an extent in one direction, are drawn.
    assert!(
        new()
            .with_field("one", vec![3.0])
            .to_svg()
            .unwrap()
            .contains(">3.0<")
    );
}
