//! Drawing of diagrams. The only place that knows plotters.

use std::path::Path;

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::OutputError;
use super::diagram::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
use super::plane::{Point, Range, clip, clip_region, drawable, inside, padded_range, tick_label};
use crate::sparse::replace_file;

/// plotters rounds to whole pixels: everything is drawn this much larger and shown smaller.
const SCALE: i32 = 4;
const TEXT: i32 = 15 * SCALE;
const RADIUS: i32 = 5 * SCALE;
/// Beyond this number of transitions of a curve the circles are smaller.
const MANY: usize = 12;
/// Height of a row of the legend.
const ROW: i32 = 22 * SCALE;
/// Length of curve, in pixels, that gets an arrow of its own.
const ARROW_EVERY: f64 = 170.0 * SCALE as f64;
/// A stretch shorter than this gets none.
const ARROW_ROOM: f64 = 34.0 * SCALE as f64;
/// Vertices nearer than this to the one before are left out inside a stretch.
const THIN: i32 = SCALE;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Plane = Cartesian2d<RangedCoordf64, RangedCoordf64>;
type Pixel = (i32, i32);

fn failed(e: impl std::fmt::Display) -> OutputError {
    OutputError::Drawing { what: e.to_string() }
}

impl BranchDiagram {
    /// The picture as SVG; the same diagram gives the same text.
    ///
    /// # Errors
    /// Diagrams without a vertex, coordinates that are NaN, infinite or beyond 1e100, ranges that are no intervals, sizes out of
    /// range.
    pub fn to_svg(&self) -> Result<String, OutputError> {
        draw(self)
    }

    /// Writes the picture to a file, which it replaces in one move.
    ///
    /// # Errors
    /// As [`to_svg`](Self::to_svg); [`OutputError::Io`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), OutputError> {
        let path = path.as_ref();
        let svg = self.to_svg()?;
        replace_file(path, |part| std::fs::write(part, &svg)).map_err(|e| OutputError::Io {
            path: Some(path.to_path_buf()),
            what: e.to_string(),
        })
    }
}

fn draw(diagram: &BranchDiagram) -> Result<String, OutputError> {
    let ranges = check(diagram)?;
    let (width, height) = diagram.size;
    let scale = SCALE as u32;
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (width * scale, height * scale)).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let mut top = 6 * SCALE;
        if !diagram.title.is_empty() {
            let style = text(&root, TEXT + 2 * SCALE, HPos::Center);
            let place = (width as i32 * SCALE / 2, 14 * SCALE);
            root.draw_text(&printable(&diagram.title), &style, place)
                .map_err(failed)?;
            top = 26 * SCALE;
        }
        let rows = legend_rows(diagram);
        // Half of the picture at most.
        let legend_height = (rows.len() as i32 * ROW + 4 * SCALE).min(height as i32 * SCALE / 2);
        let (upper, legend) = root.split_vertically(height as i32 * SCALE - legend_height);
        let area = upper.margin(top, 0, 4 * SCALE, 10 * SCALE);
        let panels = area.split_evenly((1, diagram.panels.len()));
        for ((panel, area), ranges) in diagram.panels.iter().zip(&panels).zip(&ranges) {
            draw_panel(&root, area, panel, *ranges)?;
        }
        draw_legend(&legend, &rows)?;
        root.present().map_err(failed)?;
    }
    let drawn = format!(
        "width=\"{}\" height=\"{}\" viewBox",
        width * scale,
        height * scale
    );
    let shown = format!("width=\"{width}\" height=\"{height}\" viewBox");
    Ok(svg.replacen(&drawn, &shown, 1))
}

/// Checks everything that could go wrong in drawing, and fixes the ranges of the axes.
fn check(diagram: &BranchDiagram) -> Result<Vec<(Range, Range)>, OutputError> {
    let (width, height) = diagram.size;
    let panels = diagram.panels.len();
    let each = width / panels.max(1) as u32;
    if !(160..=10_000).contains(&each) || width > 10_000 || !(160..=10_000).contains(&height) {
        return Err(OutputError::Size {
            width,
            height,
            panels,
        });
    }
    let ranges = diagram.panels.iter().enumerate();
    ranges.map(|(k, panel)| panel_ranges(k, panel)).collect()
}

fn panel_ranges(k: usize, panel: &Panel) -> Result<(Range, Range), OutputError> {
    for (c, curve) in panel.curves.iter().enumerate() {
        let marks = curve.transitions.iter().chain(&curve.branchings);
        let marks = marks.chain(&curve.smooth_folds);
        for points in [
            &mut curve.vertices.iter() as &mut dyn Iterator<Item = _>,
            &mut marks.into_iter(),
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
    let corners = || {
        panel
            .regions
            .iter()
            .enumerate()
            .flat_map(|(k, r)| r.0.iter().map(move |p| (k, p)))
    };
    if let Some((region, &(x, y))) = corners().find(|(_, p)| !drawable(**p)) {
        return Err(OutputError::Region {
            panel: k,
            region,
            x,
            y,
        });
    }
    let vertices = || {
        let corners = panel.regions.iter().flat_map(|r| &r.0);
        panel.curves.iter().flat_map(|c| &c.vertices).chain(corners)
    };
    let axis = |name, given: Option<Range>, found: Option<Range>| match given {
        Some((lower, upper)) if !(lower < upper && drawable((lower, upper))) => Err(OutputError::Range {
            axis: name,
            lower,
            upper,
        }),
        // A range too narrow for its tick marks is widened as data would be.
        Some((lower, upper)) if upper - lower <= 1e-9 * lower.abs().max(upper.abs()) => {
            padded_range([lower, upper].into_iter()).ok_or(OutputError::Empty { what: name })
        }
        Some(range) => Ok(range),
        None => found.ok_or(OutputError::Empty {
            what: "no curve has a vertex and no region a corner",
        }),
    };
    Ok((
        axis("abscissa", panel.ranges.0, padded_range(vertices().map(|p| p.0)))?,
        axis("ordinate", panel.ranges.1, padded_range(vertices().map(|p| p.1)))?,
    ))
}

fn text<'a>(root: &Area<'_>, size: i32, h: HPos) -> TextStyle<'a> {
    ("sans-serif", size)
        .into_text_style(root)
        .pos(Pos::new(h, VPos::Center))
}

/// XML has no way to write control characters.
fn printable(label: &str) -> String {
    label
        .chars()
        .filter(|c| !c.is_control() && !matches!(c, '\u{fffe}' | '\u{ffff}'))
        .collect()
}

fn rgb(c: Colour) -> RGBColor {
    RGBColor(c.red, c.green, c.blue)
}

fn draw_panel(
    root: &Area<'_>,
    area: &Area<'_>,
    panel: &Panel,
    (x, y): (Range, Range),
) -> Result<(), OutputError> {
    let mut builder = ChartBuilder::on(area);
    builder
        .margin_left(4 * SCALE)
        .margin_top(4 * SCALE)
        .x_label_area_size(38 * SCALE)
        .y_label_area_size(58 * SCALE);
    if !panel.caption.is_empty() {
        builder.caption(printable(&panel.caption), ("sans-serif", TEXT));
    }
    let mut chart = builder.build_cartesian_2d(x.0..x.1, y.0..y.1).map_err(failed)?;
    let narrow = area.dim_in_pixel().0 < 420 * SCALE as u32;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(RGBColor(225, 225, 225).stroke_width(SCALE as u32))
        .axis_style(RGBColor(60, 60, 60).stroke_width(SCALE as u32))
        .set_all_tick_mark_size(4 * SCALE)
        .label_style(("sans-serif", TEXT - 2 * SCALE))
        .axis_desc_style(("sans-serif", TEXT))
        .x_labels(if narrow { 6 } else { 10 })
        .y_labels(7)
        .x_label_formatter(&|v| tick_label(*v, x))
        .y_label_formatter(&|v| tick_label(*v, y))
        .x_desc(printable(&panel.labels.0))
        .y_desc(printable(&panel.labels.1))
        .draw()
        .map_err(failed)?;
    let plane: &DrawingArea<SVGBackend<'_>, Plane> = chart.plotting_area();
    let pixel = |p: Point| plane.map_coordinate(&p);
    for (corners, colour) in &panel.regions {
        let corners: Vec<Pixel> = clip_region(corners, x, y).into_iter().map(pixel).collect();
        if corners.len() > 2 {
            // The outline closes the seam between neighbours.
            let outline = corners.iter().copied().chain([corners[0]]).collect::<Vec<_>>();
            let colour = rgb(*colour);
            root.draw(&Polygon::new(corners, colour.filled()))
                .map_err(failed)?;
            root.draw(&PathElement::new(outline, colour.stroke_width(SCALE as u32 / 2)))
                .map_err(failed)?;
        }
    }
    for curve in &panel.curves {
        draw_lines(root, curve, (x, y), &pixel)?;
    }
    let black = BLACK.stroke_width(SCALE as u32 * 5 / 4);
    for curve in &panel.curves {
        let radius = if curve.transitions.len() > MANY {
            RADIUS * 3 / 5
        } else {
            RADIUS
        };
        for &p in curve.transitions.iter().filter(|p| inside(**p, x, y)) {
            root.draw(&Circle::new(pixel(p), radius, black)).map_err(failed)?;
        }
        for &p in curve.smooth_folds.iter().filter(|p| inside(**p, x, y)) {
            draw_square(root, pixel(p))?;
        }
        for &p in curve.branchings.iter().filter(|p| inside(**p, x, y)) {
            draw_diamond(root, pixel(p))?;
        }
        match curve.vertices.first() {
            Some(&p) if curve.starts && inside(p, x, y) => draw_star(root, pixel(p))?,
            _ => {}
        }
    }
    draw_notes(root, panel, (x, y), &pixel)
}

/// A note takes the first corner around its point where it is inside the axes and free of earlier notes.
fn draw_notes(
    root: &Area<'_>,
    panel: &Panel,
    (x, y): (Range, Range),
    pixel: &dyn Fn(Point) -> Pixel,
) -> Result<(), OutputError> {
    let (low, high) = (pixel((x.0, y.0)), pixel((x.1, y.1)));
    let mut taken: Vec<(Pixel, Pixel)> = Vec::new();
    for (at, note) in panel.notes.iter().filter(|n| inside(n.0, x, y)) {
        let place = pixel(*at);
        let note = printable(note);
        let style = text(root, TEXT - SCALE, HPos::Left);
        let (width, height) = root.estimate_text_size(&note, &style).map_err(failed)?;
        let (width, height) = (width as i32, height as i32);
        let corners = [(1, -1), (-1, -1), (1, 1), (-1, 1)].map(|(right, down)| {
            let left = place.0
                + if right > 0 {
                    2 * RADIUS
                } else {
                    -2 * RADIUS - width
                };
            let middle = place.1 + 2 * RADIUS * down;
            let top = middle - height / 2;
            ((left, middle), ((left, top), (left + width, top + height)))
        });
        let fits = |(a, b): (Pixel, Pixel)| {
            let apart = |(c, d): &(Pixel, Pixel)| a.0 > d.0 || c.0 > b.0 || a.1 > d.1 || c.1 > b.1;
            a.0 >= low.0 && b.0 <= high.0 && a.1 >= high.1 && b.1 <= low.1 && taken.iter().all(apart)
        };
        let (start, room) = (corners.iter().find(|c| fits(c.1)).copied()).unwrap_or(corners[0]);
        taken.push(room);
        root.draw_text(&note, &style, start).map_err(failed)?;
    }
    Ok(())
}

fn draw_lines(
    root: &Area<'_>,
    curve: &Curve,
    (x, y): (Range, Range),
    pixel: &dyn Fn(Point) -> Pixel,
) -> Result<(), OutputError> {
    let mut stretch: Vec<Pixel> = Vec::new();
    let mut current: Option<&SegmentStyle> = None;
    let finish = |stretch: &mut Vec<Pixel>, style: Option<&SegmentStyle>| -> Result<(), OutputError> {
        if let (Some(style), true) = (style, stretch.len() > 1) {
            let colour = rgb(style.colour);
            draw_line(root, thinned(stretch), style, 2 * SCALE as u32 + 2)?;
            if !curve.undirected {
                draw_arrows(root, stretch, colour)?;
            }
        }
        stretch.clear();
        Ok(())
    };
    for (ends, style) in curve.vertices.windows(2).zip(&curve.styles) {
        let Some((a, b)) = clip(ends[0], ends[1], x, y) else {
            finish(&mut stretch, current)?;
            continue;
        };
        let (a, b) = (pixel(a), pixel(b));
        if current != Some(style) || stretch.last() != Some(&a) {
            finish(&mut stretch, current)?;
            current = Some(style);
            stretch.push(a);
        }
        if b != a {
            stretch.push(b);
        }
    }
    finish(&mut stretch, current)
}

fn draw_line(root: &Area<'_>, line: Vec<Pixel>, style: &SegmentStyle, width: u32) -> Result<(), OutputError> {
    let stroke = rgb(style.colour).stroke_width(width);
    let drawn = if style.dashed {
        root.draw(&DashedPathElement::new(line, 7 * SCALE, 4 * SCALE, stroke))
    } else {
        root.draw(&PathElement::new(line, stroke))
    };
    drawn.map_err(failed)
}

fn thinned(stretch: &[Pixel]) -> Vec<Pixel> {
    let mut kept: Vec<Pixel> = Vec::with_capacity(stretch.len());
    for (k, &p) in stretch.iter().enumerate() {
        let near = kept
            .last()
            .is_some_and(|q| (q.0 - p.0).abs() <= THIN && (q.1 - p.1).abs() <= THIN);
        if !near || k + 1 == stretch.len() {
            kept.push(p);
        }
    }
    kept
}

/// Arrow heads in the direction of travel, evenly along the stretch.
fn draw_arrows(root: &Area<'_>, stretch: &[Pixel], colour: RGBColor) -> Result<(), OutputError> {
    let length = |a: Pixel, b: Pixel| f64::from(b.0 - a.0).hypot(f64::from(b.1 - a.1));
    let total: f64 = stretch.windows(2).map(|w| length(w[0], w[1])).sum();
    if total < ARROW_ROOM {
        return Ok(());
    }
    let count = (total / ARROW_EVERY).round().max(1.0);
    let mut travelled = 0.0;
    let mut next = 0.5 * total / count;
    for w in stretch.windows(2) {
        let step = length(w[0], w[1]);
        while next < travelled + step {
            let t = (next - travelled) / step;
            let direction = (
                f64::from(w[1].0 - w[0].0) / step,
                f64::from(w[1].1 - w[0].1) / step,
            );
            let at = (
                f64::from(w[0].0) + t * step * direction.0,
                f64::from(w[0].1) + t * step * direction.1,
            );
            let corner = |along: f64, across: f64| {
                let s = f64::from(SCALE);
                (
                    (at.0 + s * (along * direction.0 - across * direction.1)).round() as i32,
                    (at.1 + s * (along * direction.1 + across * direction.0)).round() as i32,
                )
            };
            let head = vec![corner(7.0, 0.0), corner(-5.0, 5.0), corner(-5.0, -5.0)];
            root.draw(&Polygon::new(head, colour.filled())).map_err(failed)?;
            next += total / count;
        }
        travelled += step;
    }
    Ok(())
}

fn draw_diamond(root: &Area<'_>, (x, y): Pixel) -> Result<(), OutputError> {
    let r = RADIUS * 5 / 4;
    let corners = vec![(x + r, y), (x, y + r), (x - r, y), (x, y - r)];
    root.draw(&Polygon::new(corners, BLACK.filled())).map_err(failed)
}

fn draw_square(root: &Area<'_>, (x, y): Pixel) -> Result<(), OutputError> {
    let r = RADIUS * 9 / 10;
    let corners = vec![
        (x - r, y - r),
        (x + r, y - r),
        (x + r, y + r),
        (x - r, y + r),
        (x - r, y - r),
    ];
    let line = BLACK.stroke_width(SCALE as u32 * 5 / 4);
    root.draw(&PathElement::new(corners, line)).map_err(failed)
}

fn draw_star(root: &Area<'_>, (x, y): Pixel) -> Result<(), OutputError> {
    let r = RADIUS * 13 / 10;
    let (c, s) = (r * 866 / 1000, r / 2);
    for (dx, dy) in [(0, r), (c, s), (c, -s)] {
        let ray = PathElement::new(
            vec![(x - dx, y - dy), (x + dx, y + dy)],
            BLACK.stroke_width(2 * SCALE as u32),
        );
        root.draw(&ray).map_err(failed)?;
    }
    Ok(())
}

/// An entry of the legend.
enum Entry<'a> {
    Class(&'a SegmentStyle),
    Negative,
    Transition,
    SmoothFold,
    Branching,
    Start,
}

impl Entry<'_> {
    fn label(&self) -> String {
        match self {
            Self::Class(style) => printable(&style.name),
            Self::Negative => "det < 0".into(),
            Self::Transition => "transition".into(),
            Self::SmoothFold => "smooth fold".into(),
            Self::Branching => "branching".into(),
            Self::Start => "start".into(),
        }
    }

    /// Fonts are not known here: a generous guess.
    fn width(&self) -> i32 {
        (30 + 20) * SCALE + self.label().chars().count() as i32 * 13 * SCALE / 2
    }
}

/// The classes in order of appearance, then the marks in use, in rows.
fn legend_rows(diagram: &BranchDiagram) -> Vec<Vec<Entry<'_>>> {
    let curves = || diagram.panels.iter().flat_map(|p| &p.curves);
    let mut classes: Vec<&SegmentStyle> = Vec::new();
    let named = diagram.panels.iter().flat_map(|p| &p.classes);
    for style in curves().flat_map(|c| &c.styles).chain(named) {
        if !classes.iter().any(|c| c.name == style.name) {
            classes.push(style);
        }
    }
    let mut entries: Vec<Entry<'_>> = classes.into_iter().map(Entry::Class).collect();
    if curves().flat_map(|c| &c.styles).any(|s| s.dashed) {
        entries.push(Entry::Negative);
    }
    if curves().any(|c| !c.transitions.is_empty()) {
        entries.push(Entry::Transition);
    }
    if curves().any(|c| !c.smooth_folds.is_empty()) {
        entries.push(Entry::SmoothFold);
    }
    if curves().any(|c| !c.branchings.is_empty()) {
        entries.push(Entry::Branching);
    }
    if curves().any(|c| c.starts && !c.vertices.is_empty()) {
        entries.push(Entry::Start);
    }
    let available = diagram.size.0 as i32 * SCALE;
    let mut rows: Vec<Vec<Entry<'_>>> = Vec::new();
    let mut used = available;
    for entry in entries {
        if used + entry.width() > available || rows.is_empty() {
            rows.push(Vec::new());
            used = 0;
        }
        used += entry.width();
        if let Some(row) = rows.last_mut() {
            row.push(entry);
        }
    }
    rows
}

fn draw_legend(area: &Area<'_>, rows: &[Vec<Entry<'_>>]) -> Result<(), OutputError> {
    let style = text(area, TEXT - SCALE, HPos::Left);
    let mut y = ROW / 2;
    for row in rows {
        let total: i32 = row.iter().map(Entry::width).sum();
        let mut x = ((area.dim_in_pixel().0 as i32 - total + 20 * SCALE) / 2).max(4 * SCALE);
        for entry in row {
            let centre = (x + 16 * SCALE, y);
            match entry {
                Entry::Class(class) => {
                    let solid = (*class).clone().with_dashes(false);
                    let line = vec![(x, y), (x + 24 * SCALE, y)];
                    draw_line(area, line, &solid, 3 * SCALE as u32)?;
                }
                Entry::Negative => {
                    let dashes = SegmentStyle::new("", Colour::GREY).with_dashes(true);
                    let line = vec![(x, y), (x + 24 * SCALE, y)];
                    draw_line(area, line, &dashes, 3 * SCALE as u32)?;
                }
                Entry::Transition => area
                    .draw(&Circle::new(centre, RADIUS, BLACK.stroke_width(SCALE as u32)))
                    .map_err(failed)?,
                Entry::SmoothFold => draw_square(area, centre)?,
                Entry::Branching => draw_diamond(area, centre)?,
                Entry::Start => draw_star(area, centre)?,
            }
            area.draw_text(&entry.label(), &style, (x + 30 * SCALE, y))
                .map_err(failed)?;
            x += entry.width();
        }
        y += ROW;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
