//! Layout of diagrams as a list of shapes, which `svg` and `pdf` write.

mod axis;
mod body;
mod label;
mod legend;
mod lines;
mod notes;
#[cfg(feature = "pdf")]
mod pdf;
pub(in crate::output) mod plane;
mod shape;
mod svg;

use std::path::Path;

use super::OutputError;
use super::diagram::{BranchDiagram, Colour, Marker, Panel};
use crate::sparse::replace_file;
use axis::Axis;
pub use body::BodyPicture;
use plane::{Point, Range, clip, clip_region, drawable, inside, padded_range};
use shape::{Anchor, BLACK, Pixel, Shape, WHITE};

const TEXT: f64 = 14.0;
const SMALL: f64 = 12.5;
const LINE: f64 = 1.25;
const CURVE: f64 = 2.5;
/// Number of marks of a kind beyond which they are drawn smaller.
const MANY: usize = 12;
const GRID: Colour = Colour::new(225, 225, 225);
const FRAME: Colour = Colour::new(60, 60, 60);

impl BranchDiagram {
    /// The picture as SVG; the same diagram gives the same text.
    ///
    /// # Errors
    /// Diagrams without a vertex, coordinates that are NaN, infinite, beyond 1e100, or not positive on a logarithmic axis, ranges with
    /// lower ≥ upper, sizes out of range.
    pub fn to_svg(&self) -> Result<String, OutputError> {
        Ok(svg::write(&shapes(self)?, self.size, &self.title))
    }

    /// The picture as a page of PDF in the standard fonts: Latin and Greek letters and common signs; other characters become "?".
    ///
    /// # Errors
    /// As [`to_svg`](Self::to_svg).
    #[cfg(feature = "pdf")]
    pub fn to_pdf(&self) -> Result<Vec<u8>, OutputError> {
        Ok(pdf::write(&shapes(self)?, self.size))
    }

    /// Writes the picture to a file, which is replaced atomically: PDF where its name ends in `.pdf` (feature `pdf`), SVG otherwise.
    ///
    /// # Errors
    /// As [`to_svg`](Self::to_svg); [`OutputError::Io`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), OutputError> {
        write_picture(path.as_ref(), &shapes(self)?, self.size, &self.title)
    }
}

fn write_picture(path: &Path, shapes: &[Shape], size: (u32, u32), title: &str) -> Result<(), OutputError> {
    let picture = match path.extension() {
        #[cfg(feature = "pdf")]
        Some(extension) if extension.eq_ignore_ascii_case("pdf") => pdf::write(shapes, size),
        _ => svg::write(shapes, size, title).into_bytes(),
    };
    replace_file(path, |part| std::fs::write(part, &picture)).map_err(|e| OutputError::Io {
        path: Some(path.to_path_buf()),
        source: e.into(),
    })
}

fn shapes(diagram: &BranchDiagram) -> Result<Vec<Shape>, OutputError> {
    let panels = on_axes(diagram)?;
    let ranges = check(&panels, diagram.size)?;
    let (width, height) = (f64::from(diagram.size.0), f64::from(diagram.size.1));
    let mut shapes = Vec::new();
    let mut top = 8.0;
    if !diagram.title.is_empty() {
        shapes.push(text(
            &diagram.title,
            (width / 2.0, 16.0),
            TEXT + 1.0,
            Anchor::Middle,
        ));
        top = 30.0;
    }
    let rows = legend::rows(diagram);
    // Half of the picture at most.
    let bottom = height - (rows.len() as f64 * legend::ROW + 4.0).min(height / 2.0);
    let each = width / panels.len() as f64;
    for (k, (panel, ranges)) in panels.iter().zip(&ranges).enumerate() {
        let left = k as f64 * each;
        let room = (left + 6.0, top, left + each - 14.0, bottom);
        draw_panel(&mut shapes, panel, *ranges, room);
    }
    legend::draw(&mut shapes, &rows, width, bottom);
    Ok(shapes)
}

/// Panels in the coordinates of their axes: logarithms to base 10 on logarithmic axes.
fn on_axes(diagram: &BranchDiagram) -> Result<Vec<Panel>, OutputError> {
    let panels = diagram.panels.iter().enumerate();
    panels
        .map(|(k, panel)| {
            let mut panel = panel.clone();
            panel
                .on_axes()
                .map_err(|value| OutputError::Logarithm { panel: k, value })?;
            Ok(panel)
        })
        .collect()
}

/// Validates a panel and determines the ranges of its axes.
fn check(panels: &[Panel], (width, height): (u32, u32)) -> Result<Vec<(Range, Range)>, OutputError> {
    let each = width / panels.len().max(1) as u32;
    if !(160..=10_000).contains(&each) || width > 10_000 || !(160..=10_000).contains(&height) {
        return Err(OutputError::Size {
            width,
            height,
            panels: panels.len(),
        });
    }
    let ranges = panels.iter().enumerate();
    ranges.map(|(k, panel)| panel_ranges(k, panel)).collect()
}

fn panel_ranges(k: usize, panel: &Panel) -> Result<(Range, Range), OutputError> {
    for (c, curve) in panel.curves.iter().enumerate() {
        let mut marks = curve.marks.iter().map(|m| &m.1);
        for points in [
            &mut curve.vertices.iter() as &mut dyn Iterator<Item = _>,
            &mut marks,
        ] {
            if let Some((vertex, &(x, y))) = points.enumerate().find(|(_, p)| !drawable(**p)) {
                return Err(OutputError::NotDrawable {
                    panel: k,
                    curve: c,
                    vertex,
                    x,
                    y,
                });
            }
        }
        if curve.styles.len() != curve.vertices.len().saturating_sub(1) {
            return Err(OutputError::Segments {
                vertices: curve.vertices.len(),
                styles: curve.styles.len(),
            });
        }
    }
    if let Some((note, &((x, y), _))) = panel.notes.iter().enumerate().find(|(_, n)| !drawable(n.0)) {
        return Err(OutputError::Note { panel: k, note, x, y });
    }
    let regions = panel.regions.iter().enumerate();
    let mut corners = regions.flat_map(|(k, r)| r.0.iter().map(move |p| (k, p)));
    if let Some((region, &(x, y))) = corners.find(|(_, p)| !drawable(**p)) {
        return Err(OutputError::Region {
            panel: k,
            region,
            x,
            y,
        });
    }
    let (given_x, given_y) = panel.ranges;
    let (given_x, given_y) = (given("abscissa", given_x)?, given("ordinate", given_y)?);
    // The default range of one axis depends on the range of the other.
    let everything = (-plane::LARGEST, plane::LARGEST);
    let mut shown = visible(
        panel,
        (given_x.unwrap_or(everything), given_y.unwrap_or(everything)),
    );
    if shown.is_empty() {
        shown = visible(panel, (everything, everything));
    }
    let nothing = OutputError::Empty {
        what: "no curve has a vertex and no region a corner",
    };
    let found = |pick: fn(&Point) -> f64| padded_range(shown.iter().map(pick));
    Ok((
        given_x.or_else(|| found(|p| p.0)).ok_or(nothing.clone())?,
        given_y.or_else(|| found(|p| p.1)).ok_or(nothing)?,
    ))
}

/// The range set by the caller; one too narrow for tick marks is widened like that of data.
fn given(axis: &'static str, range: Option<Range>) -> Result<Option<Range>, OutputError> {
    match range {
        Some((lower, upper)) if !(lower < upper && drawable((lower, upper))) => {
            Err(OutputError::Range { axis, lower, upper })
        }
        Some((lower, upper)) if upper - lower <= 1e-9 * lower.abs().max(upper.abs()) => {
            Ok(padded_range([lower, upper].into_iter()))
        }
        range => Ok(range),
    }
}

/// The ends of all segments and the corners of all regions, clipped to the ranges.
fn visible(panel: &Panel, (x, y): (Range, Range)) -> Vec<Point> {
    let mut shown = Vec::new();
    for curve in &panel.curves {
        shown.extend(curve.vertices.first().filter(|p| inside(**p, x, y)));
        for ends in curve.vertices.windows(2) {
            if let Some((a, b)) = clip(ends[0], ends[1], x, y) {
                shown.extend([a, b]);
            }
        }
    }
    for (corners, _) in &panel.regions {
        shown.extend(clip_region(corners, x, y));
    }
    shown
}

fn text(label: &str, at: Pixel, size: f64, anchor: Anchor) -> Shape {
    Shape::Text {
        at,
        size,
        anchor,
        upwards: false,
        runs: label::runs(label),
    }
}

fn line(points: Vec<Pixel>, colour: Colour, width: f64) -> Shape {
    Shape::Line {
        points,
        bends: Vec::new(),
        colour,
        width,
        dashed: false,
    }
}

/// The position of a panel, and the map from its coordinates to pixels.
struct Frame {
    x: Axis,
    y: Axis,
}

impl Frame {
    fn pixel(&self, p: Point) -> Pixel {
        (self.x.pixel(p.0), self.y.pixel(p.1))
    }

    fn clip(&self, a: Point, b: Point) -> Option<(Pixel, Pixel)> {
        clip(a, b, self.x.range, self.y.range).map(|(a, b)| (self.pixel(a), self.pixel(b)))
    }

    fn holds(&self, p: Point) -> bool {
        inside(p, self.x.range, self.y.range)
    }
}

fn draw_panel(
    shapes: &mut Vec<Shape>,
    panel: &Panel,
    (x, y): (Range, Range),
    (left, mut top, right, bottom): (f64, f64, f64, f64),
) {
    let middle = 0.5 * (left + right);
    if !panel.caption.is_empty() {
        shapes.push(text(&panel.caption, (middle, top + 9.0), TEXT, Anchor::Middle));
        top += 22.0;
    }
    let below = bottom - 44.0;
    let y = Axis {
        range: y,
        logarithmic: panel.logarithmic.1,
        ends: (below, top + 6.0),
    };
    let marks = y.ticks(48.0);
    let widest = marks
        .iter()
        .map(|t| label::width(&t.1, SMALL))
        .fold(0.0, f64::max);
    let beside = left + 24.0 + widest.min(0.3 * (right - left)) + 8.0;
    let frame = Frame {
        x: Axis {
            range: x,
            logarithmic: panel.logarithmic.0,
            ends: (beside, right),
        },
        y,
    };
    let (low, high) = (frame.y.ends.0, frame.y.ends.1);
    let mut previous = f64::NEG_INFINITY;
    for (at, label) in frame.x.ticks(64.0) {
        let at = frame.x.pixel(at);
        shapes.push(line(vec![(at, low), (at, high)], GRID, 1.0));
        shapes.push(line(vec![(at, low), (at, low + 4.0)], FRAME, 1.0));
        // Labels that would touch the one before are left out.
        let half = 0.5 * label::width(&label, SMALL);
        if at - half > previous + 4.0 {
            shapes.push(text(&label, (at, low + 14.0), SMALL, Anchor::Middle));
            previous = at + half;
        }
    }
    for (at, label) in marks {
        let at = frame.y.pixel(at);
        shapes.push(line(vec![(beside, at), (right, at)], GRID, 1.0));
        shapes.push(line(vec![(beside - 4.0, at), (beside, at)], FRAME, 1.0));
        shapes.push(text(&label, (beside - 7.0, at), SMALL, Anchor::End));
    }
    for (corners, colour) in &panel.regions {
        let corners: Vec<Pixel> = clip_region(corners, x, frame.y.range)
            .into_iter()
            .map(|p| frame.pixel(p))
            .collect();
        if corners.len() > 2 {
            // The outline closes the seam between adjacent regions.
            shapes.push(Shape::Polygon {
                corners,
                fill: *colour,
                outline: Some((*colour, 1.0)),
            });
        }
    }
    let corners = [
        (beside, low),
        (right, low),
        (right, high),
        (beside, high),
        (beside, low),
    ];
    shapes.push(line(corners.to_vec(), FRAME, 1.0));
    let centre = 0.5 * (beside + right);
    shapes.push(text(&panel.labels.0, (centre, low + 33.0), TEXT, Anchor::Middle));
    shapes.push(Shape::Text {
        at: (left + 9.0, 0.5 * (low + high)),
        size: TEXT,
        anchor: Anchor::Middle,
        upwards: true,
        runs: label::runs(&panel.labels.1),
    });
    let first = shapes.len();
    for curve in &panel.curves {
        lines::draw(shapes, curve, &frame);
    }
    draw_marks(shapes, panel, &frame);
    let notes = notes::place(panel, &frame, &shapes[first..]);
    shapes.extend(notes);
}

fn distance(a: Pixel, b: Pixel) -> f64 {
    (b.0 - a.0).hypot(b.1 - a.1)
}

/// The marks of all curves by kind, so that marks of the same kind at the same place are drawn once.
fn draw_marks(shapes: &mut Vec<Shape>, panel: &Panel, frame: &Frame) {
    for kind in Marker::ALL {
        let marks = panel.curves.iter().flat_map(|c| &c.marks);
        let places: Vec<Pixel> = marks
            .filter(|m| m.0 == kind && frame.holds(m.1))
            .map(|m| frame.pixel(m.1))
            .collect();
        let radius = if places.len() > MANY { 3.0 } else { 5.0 };
        let mut drawn: Vec<Pixel> = Vec::new();
        for p in places {
            if drawn.iter().all(|q| distance(p, *q) > 0.5 * radius) {
                shapes.extend(mark(kind, p, radius));
                drawn.push(p);
            }
        }
    }
}

/// The symbol of a kind of point.
fn mark(kind: Marker, (x, y): Pixel, r: f64) -> Vec<Shape> {
    let outline = Some((BLACK, LINE));
    let circle = |radius: f64, fill: Colour| Shape::Circle {
        centre: (x, y),
        radius,
        fill,
        outline,
    };
    let polygon = |corners: &[Pixel], fill: Colour| Shape::Polygon {
        corners: corners.iter().map(|(dx, dy)| (x + r * dx, y + r * dy)).collect(),
        fill,
        outline,
    };
    let ray = |dx: f64, dy: f64, width: f64| {
        let (dx, dy) = (r * dx, r * dy);
        line(vec![(x - dx, y - dy), (x + dx, y + dy)], BLACK, width)
    };
    const DIAMOND: [Pixel; 4] = [(1.25, 0.0), (0.0, 1.25), (-1.25, 0.0), (0.0, -1.25)];
    match kind {
        Marker::Transition => vec![circle(r, WHITE)],
        Marker::Fold => vec![polygon(&[(0.0, -1.25), (1.15, 0.85), (-1.15, 0.85)], WHITE)],
        Marker::SmoothFold => vec![polygon(
            &[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
            WHITE,
        )],
        Marker::Vertical => vec![polygon(&DIAMOND, WHITE)],
        Marker::Branching => vec![polygon(&DIAMOND, BLACK)],
        Marker::End => vec![ray(0.9, 0.9, 2.0), ray(0.9, -0.9, 2.0)],
        Marker::Isolated => vec![circle(0.7 * r, BLACK)],
        Marker::Undecided => vec![circle(1.1 * r, WHITE), ray(0.7, 0.7, LINE), ray(0.7, -0.7, LINE)],
        Marker::Hopf => vec![circle(1.1 * r, WHITE), circle(0.5 * r, BLACK)],
        Marker::Start => vec![ray(0.0, 1.3, 2.0), ray(1.13, 0.65, 2.0), ray(1.13, -0.65, 2.0)],
        Marker::Value => vec![ray(1.1, 0.0, LINE), ray(0.0, 1.1, LINE)],
    }
}

#[cfg(test)]
mod tests;
