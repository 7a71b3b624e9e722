//! Pictures of bodies: the deformed mesh with a field in colours and marks at nodes.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use super::axis::Axis;
use super::plane::LARGEST;
use super::shape::{Anchor, Pixel, Shape};
use super::{FRAME, SMALL, TEXT, legend, line, svg, text, write_picture};
use crate::contact::ContactState;
use crate::fem::{ElasticSystem, Mesh, von_mises_stress};
use crate::input::{check_length, check_options};
use crate::output::OutputError;
use crate::output::diagram::{Colour, SegmentStyle};
use crate::sparse::dot;

/// Colours of a field from its least to its greatest value, in equal steps: dark blue, blue, green, yellow. They become lighter evenly, so
/// that they can be told apart with colour blindness and in grey, too.
const SCALE: [Colour; 5] = [
    Colour::new(68, 1, 84),
    Colour::new(59, 82, 139),
    Colour::new(33, 145, 140),
    Colour::new(94, 201, 98),
    Colour::new(253, 231, 37),
];
/// Cells without a field, or with a value that is NaN.
const PLAIN: Colour = Colour::new(214, 220, 226);
const UNDEFORMED: Colour = Colour::new(150, 150, 150);
/// Bands of the colour bar.
const BANDS: usize = 64;
/// Cells beyond which their edges would hide the field: each edge is ½ pixel wide, in a picture of 640 × 480 pixels.
const MOST_EDGES: usize = 3000;
/// Size of the largest displacement in a picture, relative to the body.
const SHOWN: f64 = 0.1;

/// A picture of a body: its mesh, moved by magnified displacements and coloured by a field, with marks at nodes.
///
/// Bodies in space are seen from a direction that can be chosen; what lies behind is hidden in the order of the centres of boundary facets,
/// which is right for convex bodies. Coordinates and the field keep their units; the bar shows those of the field.
///
/// ```
/// use semismooth::fem::Mesh;
/// use semismooth::output::BodyPicture;
/// let mesh = Mesh::rectangle([0.0, 0.0], [2.0, 1.0], [4, 2])?;
/// let height: Vec<f64> = (0..mesh.num_cells()).map(|cell| mesh.centre(cell)[1]).collect();
/// let lean: Vec<f64> = mesh.points().iter().flat_map(|p| [0.1 * p[1], 0.0]).collect();
/// let svg = BodyPicture::new(&mesh).with_displacements(lean, 1.0).with_field("height", height).to_svg()?;
/// assert!(svg.starts_with("<svg"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct BodyPicture<'a> {
    mesh: &'a Mesh,
    title: String,
    size: (u32, u32),
    displacements: Vec<f64>,
    magnification: f64,
    field: Option<(String, Vec<f64>)>,
    marks: Vec<(usize, SegmentStyle)>,
    view: (f64, f64),
    /// Whether of a plane body the outline alone is drawn.
    outline: bool,
}

impl<'a> BodyPicture<'a> {
    /// The mesh alone, 640 × 480 pixels, in space seen from an azimuth of −60° and an elevation of 25°.
    #[must_use]
    pub fn new(mesh: &'a Mesh) -> Self {
        Self {
            mesh,
            title: String::new(),
            size: (640, 480),
            displacements: Vec::new(),
            magnification: 1.0,
            field: None,
            marks: Vec::new(),
            view: (-60.0, 25.0),
            outline: false,
        }
    }

    /// A deformed body with the state of each of its contact nodes, cells in the colour of their stress of von Mises. `displacements` are those
    /// that are free and those of the supports, as [`ElasticSystem::displacements`] takes them. Unless a `magnification` is given, the largest
    /// displacement is shown as 4 to 10 % of the body, or to scale where it is larger. Bodies in space are seen from below, where they touch
    /// the ground.
    ///
    /// # Errors
    /// Displacements of the wrong length, and other states than one for each node.
    pub fn of_contact(
        system: &'a ElasticSystem,
        nodes: &[usize],
        states: &[ContactState],
        displacements: [&[f64]; 2],
        magnification: Option<f64>,
    ) -> Result<Self, OutputError> {
        check_length("the states of the contact nodes", states.len(), nodes.len())?;
        let [free, supports] = displacements;
        let moved = system.displacements(free, supports)?;
        let stress = system.stresses(free, supports)?;
        let times = magnification.unwrap_or_else(|| suitable(system.mesh().points(), &moved));
        let mut picture = Self::new(system.mesh())
            .with_view(-60.0, -20.0)
            .with_displacements(moved, times)
            .with_field("von Mises stress", stress.iter().map(von_mises_stress).collect());
        for (&node, &state) in nodes.iter().zip(states) {
            picture = picture.with_mark(node, SegmentStyle::contact(state, false));
        }
        Ok(picture)
    }

    /// By how much displacements are magnified.
    #[must_use]
    pub fn magnification(&self) -> f64 {
        self.magnification
    }

    /// Draws the outline of a plane body, without its cells and the field: a picture of any mesh is then small.
    pub(in crate::output) fn with_outline_alone(mut self) -> Self {
        self.outline = true;
        self.field = None;
        self
    }

    /// Moves the nodes by displacements (node by node, as
    /// [`ElasticSystem::displacements`](crate::fem::ElasticSystem::displacements) gives them) times a magnification. The outline of a plane
    /// body before is drawn in grey.
    #[must_use]
    pub fn with_displacements(mut self, displacements: Vec<f64>, magnification: f64) -> Self {
        self.displacements = displacements;
        self.magnification = magnification;
        self
    }

    /// Colours the cells by a field, one value each; cells whose value is NaN stay grey.
    #[must_use]
    pub fn with_field(mut self, name: impl Into<String>, values: Vec<f64>) -> Self {
        self.field = Some((name.into(), values));
        self
    }

    /// Marks a node by a disc in the colour of a class, which is named in the legend: that of a state of contact is
    /// [`SegmentStyle::contact`]. In space nodes on the far side are hidden: look from below at what stands on the ground.
    #[must_use]
    pub fn with_mark(mut self, node: usize, class: SegmentStyle) -> Self {
        self.marks.push((node, class));
        self
    }

    /// Writes a title above the body.
    #[must_use]
    pub fn with_title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Width and height in pixels, each 160 to 10 000.
    #[must_use]
    pub fn with_size(mut self, width: u32, height: u32) -> Self {
        self.size = (width, height);
        self
    }

    /// The direction from which a body in space is seen: azimuth about the third axis from the first, and elevation above the plane of the
    /// first two, in degrees.
    #[must_use]
    pub fn with_view(mut self, azimuth: f64, elevation: f64) -> Self {
        self.view = (azimuth, elevation);
        self
    }

    /// The picture as SVG; the same body gives the same text.
    ///
    /// # Errors
    /// Meshes without cells, displacements and fields of the wrong length, positions and magnifications that are not finite, marks at nodes
    /// that do not exist, sizes out of range.
    pub fn to_svg(&self) -> Result<String, OutputError> {
        Ok(svg::write(&self.shapes()?, self.size, &self.title))
    }

    /// Writes the picture to a file: PDF where its name ends in `.pdf` (feature `pdf`), SVG otherwise.
    ///
    /// # Errors
    /// As [`to_svg`](Self::to_svg); [`OutputError::Io`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), OutputError> {
        write_picture(path.as_ref(), &self.shapes()?, self.size, &self.title)
    }

    fn check(&self) -> Result<(), OutputError> {
        let (mesh, (width, height)) = (self.mesh, self.size);
        if mesh.num_cells() == 0 {
            return Err(OutputError::Empty {
                what: "the mesh has no cell",
            });
        }
        if !(160..=10_000).contains(&width) || !(160..=10_000).contains(&height) {
            return Err(OutputError::Size {
                width,
                height,
                panels: 1,
            });
        }
        let magnified = self.magnification;
        check_options(&[("magnification", magnified, magnified.is_finite(), "finite")])?;
        let wrong = |name: &str, expected: usize, found: usize| {
            Err(OutputError::Field {
                name: name.to_owned(),
                expected,
                found,
            })
        };
        let all = mesh.dim() * mesh.num_nodes();
        if !self.displacements.is_empty() && self.displacements.len() != all {
            return wrong("displacements", all, self.displacements.len());
        }
        if let Some((name, values)) = &self.field
            && values.len() != mesh.num_cells()
        {
            return wrong(name, mesh.num_cells(), values.len());
        }
        match self.marks.iter().find(|m| m.0 >= mesh.num_nodes()) {
            Some(&(node, _)) => Err(OutputError::Node { node }),
            None => Ok(()),
        }
    }

    /// The points, moved.
    fn moved(&self) -> Result<Vec<[f64; 3]>, OutputError> {
        let dim = self.mesh.dim();
        let mut points = self.mesh.points().to_vec();
        for (node, point) in points.iter_mut().enumerate() {
            if let Some(u) = self.displacements.get(node * dim..(node + 1) * dim) {
                point
                    .iter_mut()
                    .zip(u)
                    .for_each(|(x, u)| *x += self.magnification * u);
            }
            if !point.iter().all(|x| x.abs() <= LARGEST) {
                return Err(OutputError::Node { node });
            }
        }
        Ok(points)
    }

    fn shapes(&self) -> Result<Vec<Shape>, OutputError> {
        self.check()?;
        let points = self.moved()?;
        let view = View::new(self.mesh.dim(), self.view);
        let legend = legend::classes(self.marks.iter().map(|m| &m.1), f64::from(self.size.0));
        let (width, height) = (f64::from(self.size.0), f64::from(self.size.1));
        let bottom = height - (legend.len() as f64 * legend::ROW + 8.0).min(height / 2.0);
        let mut shapes = Vec::new();
        let mut top = 12.0;
        if !self.title.is_empty() {
            shapes.push(text(&self.title, (width / 2.0, 16.0), TEXT + 1.0, Anchor::Middle));
            top = 32.0;
        }
        let range = self.field.as_ref().and_then(|(_, values)| finite_range(values));
        let right = width - if range.is_some() { 110.0 } else { 14.0 };
        let drawn = points.iter().chain(self.mesh.points()).map(|&p| view.flat(p));
        let place = Place::new(drawn, (14.0, top, right, bottom));
        let seen = self.draw_cells(&mut shapes, &points, &view, &place, range);
        let mut marked = HashSet::new();
        for (node, class) in self.marks.iter().filter(|m| seen[m.0]) {
            let centre = place.pixel(view.flat(points[*node]));
            // In an outline discs of one colour that cover each other are drawn once.
            let pair = ((0.5 * centre.0) as i64, (0.5 * centre.1) as i64, class.colour);
            if self.outline && !marked.insert(pair) {
                continue;
            }
            shapes.push(Shape::Circle {
                centre,
                radius: 4.0,
                fill: class.colour,
                outline: Some((super::shape::WHITE, 1.0)),
            });
        }
        if let (Some(range), Some((name, _))) = (range, &self.field) {
            colour_bar(
                &mut shapes,
                name,
                range,
                (right + 24.0, top + 26.0, bottom - 12.0),
            );
        }
        legend::draw(&mut shapes, &legend, width, bottom + 4.0);
        Ok(shapes)
    }

    /// Returns which nodes are seen: those of facets that face the eye.
    fn draw_cells(
        &self,
        shapes: &mut Vec<Shape>,
        points: &[[f64; 3]],
        view: &View,
        place: &Place,
        range: Option<(f64, f64)>,
    ) -> Vec<bool> {
        let pixel = |&node: &usize| place.pixel(view.flat(points[node]));
        let colour = |cell: usize| match (&self.field, range) {
            (Some((_, values)), Some(range)) => in_scale(values[cell], range),
            _ => PLAIN,
        };
        let edges = (self.mesh.num_cells() <= MOST_EDGES).then_some((FRAME, 0.5));
        let polygon = |corners: &[usize], cell: usize| Shape::Polygon {
            corners: corners.iter().map(pixel).collect(),
            fill: colour(cell),
            // Without edges each cell is outlined in its own colour, so that no seam shows.
            outline: edges.or(Some((colour(cell), 0.5))),
        };
        if self.mesh.dim() == 2 {
            let cells = if self.outline { 0 } else { self.mesh.num_cells() };
            for cell in 0..cells {
                let nodes = self.mesh.cell(cell);
                let around = self.mesh.kind(cell).facets().iter().map(|f| nodes[f[0]]);
                shapes.push(polygon(&around.collect::<Vec<_>>(), cell));
            }
            if self.outline {
                // A line for each closed curve: of many facets one by one the picture would be large.
                for around in outlines(self.mesh) {
                    let before = around
                        .iter()
                        .map(|&n| place.pixel(view.flat(self.mesh.points()[n])));
                    shapes.push(line(before.collect(), UNDEFORMED, 0.75));
                    shapes.push(line(around.iter().map(pixel).collect(), FRAME, 1.0));
                }
            } else if !self.displacements.is_empty() {
                for facet in self.mesh.boundary() {
                    let ends = facet
                        .nodes
                        .iter()
                        .take(2)
                        .map(|&n| place.pixel(view.flat(self.mesh.points()[n])));
                    shapes.push(line(ends.collect(), UNDEFORMED, 0.75));
                }
            }
            return vec![true; points.len()];
        }
        let mut seen = vec![false; points.len()];
        let mut facets = Vec::new();
        for facet in self.mesh.boundary() {
            let corners = facet.corners().to_vec();
            let flat: Vec<(f64, f64)> = corners.iter().map(|&n| view.flat(points[n])).collect();
            // Facets that face away, whose corners run clockwise in the picture, are hidden.
            let next = flat.iter().cycle().skip(1);
            if flat
                .iter()
                .zip(next)
                .map(|(a, b)| a.0 * b.1 - a.1 * b.0)
                .sum::<f64>()
                > 0.0
            {
                let depth =
                    corners.iter().map(|&n| view.towards(points[n])).sum::<f64>() / corners.len() as f64;
                corners.iter().for_each(|&n| seen[n] = true);
                facets.push((depth, corners, facet.cell));
            }
        }
        facets.sort_by(|a, b| a.0.total_cmp(&b.0));
        shapes.extend(facets.iter().map(|(_, corners, cell)| polygon(corners, *cell)));
        seen
    }
}

/// 1, 2 or 5 times a power of ten, so that displacements are seen; 1 where they are seen anyway.
fn suitable(points: &[[f64; 3]], moved: &[f64]) -> f64 {
    let extent = |d: usize| {
        let (low, high) = points
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| {
                (l.min(p[d]), h.max(p[d]))
            });
        high - low
    };
    let size = (0..3).map(extent).fold(0.0, f64::max);
    let largest = moved.iter().fold(0.0f64, |m, u| m.max(u.abs()));
    let wanted = SHOWN * size / largest;
    if !(wanted.is_finite() && wanted > 2.0) {
        return 1.0;
    }
    let power = 10f64.powf(wanted.log10().floor());
    let steps = [5.0, 2.0, 1.0];
    power * steps.into_iter().find(|s| s * power <= wanted).unwrap_or(1.0)
}

/// The boundary of a plane mesh as lines of nodes, closed ones beginning and ending at the same node.
fn outlines(mesh: &Mesh) -> Vec<Vec<usize>> {
    let facets = mesh.boundary();
    // Facets leave their nodes in one sense round the body; where bodies touch at a node several leave it.
    let mut leaving: HashMap<usize, Vec<usize>> = HashMap::new();
    for (k, facet) in facets.iter().enumerate().rev() {
        leaving.entry(facet.nodes[0]).or_default().push(k);
    }
    let mut used = vec![false; facets.len()];
    let mut lines = Vec::new();
    for begin in 0..facets.len() {
        if used[begin] {
            continue;
        }
        let mut around = vec![facets[begin].nodes[0]];
        let mut next = Some(begin);
        while let Some(k) = next {
            used[k] = true;
            let end = facets[k].nodes[1];
            around.push(end);
            next = leaving
                .get(&end)
                .and_then(|list| list.iter().copied().find(|&k| !used[k]));
        }
        lines.push(around);
    }
    lines
}

fn finite_range(values: &[f64]) -> Option<(f64, f64)> {
    let finite = values.iter().copied().filter(|v| v.is_finite());
    let range = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
        (a.min(v), b.max(v))
    });
    (range.0 <= range.1 && (range.1 - range.0).is_finite()).then_some(range)
}

fn in_scale(value: f64, (lower, upper): (f64, f64)) -> Colour {
    if value.is_nan() {
        return PLAIN;
    }
    let share = match upper > lower {
        true => ((value - lower) / (upper - lower)).clamp(0.0, 1.0),
        false => 0.5,
    };
    let at = share * (SCALE.len() - 1) as f64;
    let below = (at as usize).min(SCALE.len() - 2);
    let (a, b, t) = (SCALE[below], SCALE[below + 1], at - below as f64);
    let mixed = |a: u8, b: u8| (f64::from(a) + t * (f64::from(b) - f64::from(a))).round() as u8;
    Colour::new(
        mixed(a.red, b.red),
        mixed(a.green, b.green),
        mixed(a.blue, b.blue),
    )
}

/// The bar that explains the colours, between two heights.
fn colour_bar(shapes: &mut Vec<Shape>, name: &str, range: (f64, f64), (left, top, bottom): (f64, f64, f64)) {
    const WIDTH: f64 = 14.0;
    shapes.push(text(name, (left + WIDTH, top - 14.0), SMALL, Anchor::Middle));
    let (lower, upper) = range;
    let each = (bottom - top) / BANDS as f64;
    for band in 0..BANDS {
        let share = (band as f64 + 0.5) / BANDS as f64;
        let (low, high) = (bottom - band as f64 * each, bottom - (band + 1) as f64 * each);
        shapes.push(Shape::Polygon {
            corners: vec![
                (left, low),
                (left + WIDTH, low),
                (left + WIDTH, high),
                (left, high),
            ],
            fill: in_scale(lower + share * (upper - lower), range),
            // So that no seam shows.
            outline: Some((in_scale(lower + share * (upper - lower), range), 0.5)),
        });
    }
    // Where all values are one number up to rounding, tick marks could not be told apart: the bar has that number in the middle.
    if upper - lower <= BANDS as f64 * f64::EPSILON * lower.abs().max(upper.abs()) {
        let at = (left + WIDTH + 7.0, 0.5 * (top + bottom));
        shapes.push(text(&format!("{lower:?}"), at, SMALL, Anchor::Start));
        return;
    }
    let axis = Axis {
        range,
        logarithmic: false,
        ends: (bottom, top),
    };
    for (value, label) in axis.ticks(48.0) {
        let y = axis.pixel(value);
        shapes.push(line(vec![(left + WIDTH, y), (left + WIDTH + 4.0, y)], FRAME, 1.0));
        shapes.push(text(&label, (left + WIDTH + 7.0, y), SMALL, Anchor::Start));
    }
}

/// The directions of a picture: to the right, upwards, and towards the eye.
struct View([[f64; 3]; 3]);

impl View {
    fn new(dim: usize, (azimuth, elevation): (f64, f64)) -> Self {
        if dim == 2 {
            return Self([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        }
        let (sin_a, cos_a) = azimuth.to_radians().sin_cos();
        let (sin_e, cos_e) = elevation.to_radians().sin_cos();
        Self([
            [-sin_a, cos_a, 0.0],
            [-sin_e * cos_a, -sin_e * sin_a, cos_e],
            [cos_e * cos_a, cos_e * sin_a, sin_e],
        ])
    }

    fn flat(&self, p: [f64; 3]) -> (f64, f64) {
        (dot(&self.0[0], &p), dot(&self.0[1], &p))
    }

    fn towards(&self, p: [f64; 3]) -> f64 {
        dot(&self.0[2], &p)
    }
}

/// One scale for both directions, the body in the middle.
struct Place {
    scale: f64,
    centre: (f64, f64),
    middle: Pixel,
}

impl Place {
    fn new(
        points: impl Iterator<Item = (f64, f64)>,
        (left, top, right, bottom): (f64, f64, f64, f64),
    ) -> Self {
        let none = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
        let [a, b, c, d] = points.fold(none, |[a, b, c, d], (x, y)| {
            [a.min(x), b.max(x), c.min(y), d.max(y)]
        });
        let fit = ((right - left) / (b - a)).min((bottom - top) / (d - c));
        Self {
            scale: if fit.is_finite() { fit } else { 1.0 },
            centre: (0.5 * (a + b), 0.5 * (c + d)),
            middle: (0.5 * (left + right), 0.5 * (top + bottom)),
        }
    }

    fn pixel(&self, (x, y): (f64, f64)) -> Pixel {
        (
            self.middle.0 + self.scale * (x - self.centre.0),
            self.middle.1 - self.scale * (y - self.centre.1),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::suitable;

    #[test]
    fn magnifications_are_round_and_show_a_tenth() {
        let points = [[0.0; 3], [2.0, 1.0, 0.0]];
        assert_eq!(suitable(&points, &[0.0, 0.001]), 200.0);
        assert_eq!(suitable(&points, &[0.0, -0.003]), 50.0);
        assert_eq!(suitable(&points, &[0.15, 0.0]), 1.0);
        assert_eq!(suitable(&points, &[0.0, 0.0]), 1.0);
    }
}
