use std::borrow::Cow;

use super::draw::plane::{Point, Range};
use crate::contact::ContactState;
use crate::continuation::{Branch, Diagram, DiagramEdge, Point as CurvePoint, TransitionKind, VertexKind};
use crate::piecewise::Selection;
use crate::sparse::distance;
use crate::stability::StabilityBranch;

/// An sRGB colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Colour {
    /// Red.
    pub red: u8,
    /// Green.
    pub green: u8,
    /// Blue.
    pub blue: u8,
}

/// The constants can be distinguished with red–green colour blindness: under simulation of it, and without, any two are at least 20 apart
/// in CIELAB.
impl Colour {
    /// Vermilion: no contact.
    pub const RED: Self = Self::new(0xd5, 0x5e, 0x00);
    /// Bluish green: stick.
    pub const GREEN: Self = Self::new(0x1a, 0xa8, 0x73);
    /// Slip.
    pub const BLUE: Self = Self::new(0x00, 0x72, 0xb2);
    /// Dark grey: grazing.
    pub const GREY: Self = Self::new(0x55, 0x55, 0x55);
    /// Yellowish orange.
    pub const ORANGE: Self = Self::new(0xff, 0xb0, 0x00);
    /// Light reddish purple.
    pub const PURPLE: Self = Self::new(0xdd, 0x8f, 0xbd);

    /// A colour from its components.
    #[must_use]
    pub const fn new(red: u8, green: u8, blue: u8) -> Self {
        Self { red, green, blue }
    }
}

/// Style of a class of segments: name in the legend, colour, dashes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SegmentStyle {
    /// Name in the legend; segments of the same name share an entry.
    pub name: Cow<'static, str>,
    /// Colour of the line.
    pub colour: Colour,
    /// Whether the line is dashed: where det ∇_yH < 0, in the pictures of this crate, and in those of stability where it is unstable.
    pub dashed: bool,
}

impl SegmentStyle {
    /// A class of segments with solid lines.
    pub fn new(name: impl Into<Cow<'static, str>>, colour: Colour) -> Self {
        Self {
            name: name.into(),
            colour,
            dashed: false,
        }
    }

    /// Sets whether the line is dashed.
    #[must_use]
    pub fn with_dashes(mut self, dashed: bool) -> Self {
        self.dashed = dashed;
        self
    }

    /// The colours of Haslinger, Janovský and Ligurský for a contact node: red no contact, green stick, blue slip, grey grazing.
    #[must_use]
    pub fn contact(state: ContactState, grazing: bool) -> Self {
        match state {
            _ if grazing => Self::new("grazing", Colour::GREY),
            ContactState::Open => Self::new("no contact", Colour::RED),
            ContactState::Stick => Self::new("stick", Colour::GREEN),
            ContactState::SlipPlus | ContactState::SlipMinus => Self::new("slip", Colour::BLUE),
        }
    }
}

/// Kinds of marked points, each with its own symbol.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Marker {
    /// ○ The active selection changes.
    Transition,
    /// △ It changes, and the parameter turns.
    Fold,
    /// □ The parameter turns inside a piece.
    SmoothFold,
    /// ◇ A vertical segment begins or ends.
    Vertical,
    /// ◆ Curves branch.
    Branching,
    /// × The curve ends.
    End,
    /// ● An isolated solution.
    Isolated,
    /// ⊗ An event that is not resolved.
    Undecided,
    /// ◉ A pair of eigenvalues crosses the imaginary axis.
    Hopf,
    /// ✱ The curve starts.
    Start,
    /// ＋ A computed or measured value, on curves that join such values.
    Value,
}

impl Marker {
    pub(super) const ALL: [Self; 11] = [
        Self::Transition,
        Self::Fold,
        Self::SmoothFold,
        Self::Vertical,
        Self::Branching,
        Self::End,
        Self::Isolated,
        Self::Undecided,
        Self::Hopf,
        Self::Start,
        Self::Value,
    ];

    /// Its name in the legend.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Transition => "transition",
            Self::Fold => "fold",
            Self::SmoothFold => "smooth fold",
            Self::Vertical => "vertical segment",
            Self::Branching => "branching",
            Self::End => "end",
            Self::Isolated => "isolated solution",
            Self::Undecided => "undecided",
            Self::Hopf => "Hopf point",
            Self::Start => "start",
            Self::Value => "value",
        }
    }
}

impl From<TransitionKind> for Marker {
    fn from(kind: TransitionKind) -> Self {
        match kind {
            TransitionKind::PassThrough => Self::Transition,
            TransitionKind::Fold => Self::Fold,
            TransitionKind::VerticalBegin | TransitionKind::VerticalEnd => Self::Vertical,
            TransitionKind::Branching => Self::Branching,
            TransitionKind::End => Self::End,
            TransitionKind::Undecided => Self::Undecided,
        }
    }
}

/// Whether det ∇_yH < 0 between two points of a stretch; at a smooth fold, where the sign changes, the point itself has none.
fn is_negative(ends: [Option<i8>; 2]) -> bool {
    ends.into_iter().flatten().find(|s| *s != 0) == Some(-1)
}

/// The direction in the plane in which a curve leaves x along `tangent`, or, for a negative step, arrives
/// there: the one-sided difference quotient of second order over that step in x.
fn direction(place: &impl Fn(&[f64]) -> Point, x: &[f64], tangent: &[f64], step: f64) -> Point {
    let at = |s: f64| {
        place(
            &x.iter()
                .zip(tangent)
                .map(|(x, t)| x + s * t)
                .collect::<Vec<f64>>(),
        )
    };
    let (here, near, far) = (place(x), at(step), at(2.0 * step));
    let rate = |pick: fn(Point) -> f64| (4.0 * pick(near) - 3.0 * pick(here) - pick(far)) / (2.0 * step);
    (rate(|p| p.0), rate(|p| p.1))
}

/// The directions at both ends of a segment, given as points with their tangents on departure and on arrival.
fn directions(place: &impl Fn(&[f64]) -> Point, [(x0, t0), (x1, t1)]: [(&[f64], &[f64]); 2]) -> [Point; 2] {
    // Far enough for the rounding of the coordinates, and near enough for their curvature, to turn the
    // direction by less than is seen.
    let step = 1e-4 * distance(x0, x1);
    [direction(place, x0, t0, step), direction(place, x1, t1, -step)]
}

/// A curve in the plane, with a style for each segment, and marks. Curves of branches and edges are drawn
/// with their tangents, smooth between kinks; others are polylines.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    pub(super) vertices: Vec<Point>,
    /// Directions at both ends of each segment, of any length; none for a polyline.
    pub(super) tangents: Vec<[Point; 2]>,
    pub(super) styles: Vec<SegmentStyle>,
    pub(super) marks: Vec<(Marker, Point)>,
    /// Whether arrows show the orientation.
    pub(super) arrows: bool,
    /// Whether dashes say unstable.
    pub(super) by_stability: bool,
}

impl Curve {
    /// A polyline with one style for all segments, without marks.
    #[must_use]
    pub fn line(vertices: Vec<(f64, f64)>, style: SegmentStyle) -> Self {
        let styles = vec![style; vertices.len().saturating_sub(1)];
        Self::segments(vertices, styles)
    }

    /// A polyline with one style a segment, without marks.
    #[must_use]
    pub fn segments(vertices: Vec<(f64, f64)>, styles: Vec<SegmentStyle>) -> Self {
        Self {
            vertices,
            styles,
            ..Self::default()
        }
    }

    /// A branch over its parameter: `ordinate` is the scalar function of x = (y, α) to draw; `style` gives the class of a segment from its
    /// selection and its grazing sites. Dashed where det ∇_yH < 0; the start and all events except those of monitors are marked.
    pub fn of_branch(
        branch: &Branch,
        ordinate: impl Fn(&[f64]) -> f64,
        style: impl Fn(&Selection, &[usize]) -> SegmentStyle,
    ) -> Self {
        let place = |x: &[f64]| (x.last().copied().unwrap_or(f64::NAN), ordinate(x));
        let mark = |kind: Marker| move |point: &CurvePoint| (kind, place(&point.x));
        let walk = branch.vertices();
        let styles = walk.windows(2).map(|ends| {
            let negative = is_negative([ends[0].det_sign, ends[1].sign_before]);
            style(ends[0].selection, ends[0].grazing).with_dashes(negative)
        });
        let transitions = branch.transitions.iter();
        let folds = branch.smooth_folds.iter();
        let crossings = branch.branch_points.iter().map(|b| &b.point);
        let marks = transitions
            .map(|t| (Marker::from(t.kind), place(&t.x)))
            .chain(folds.map(mark(Marker::SmoothFold)))
            .chain(crossings.map(mark(Marker::Branching)))
            .chain(branch.points.first().map(mark(Marker::Start)));
        Self {
            vertices: walk.iter().map(|v| place(v.x)).collect(),
            styles: styles.collect(),
            marks: marks.collect(),
            ..Self::default()
        }
        .with_tangents(branch, place)
    }

    /// A curve of equilibria over its parameter, solid where it is stable and dashed where not, with marks at its events, Hopf points among
    /// them. The line is a polyline through the points of the curve.
    pub fn of_stability(
        found: &StabilityBranch,
        ordinate: impl Fn(&[f64]) -> f64,
        style: &SegmentStyle,
    ) -> Self {
        let place = |x: &[f64]| (x.last().copied().unwrap_or(f64::NAN), ordinate(x));
        let stretches = &found.stretches;
        let last = stretches.last().map(|s| place(&s.ends[1]));
        let vertices = stretches.iter().map(|s| place(&s.ends[0])).chain(last);
        let styles = stretches
            .iter()
            .map(|s| style.clone().with_dashes(s.unstable > 0));
        let of_branch = Self::of_branch(&found.branch, &ordinate, |_, _| style.clone());
        Self {
            by_stability: true,
            marks: of_branch.marks,
            ..Self::segments(vertices.collect(), styles.collect())
        }
        .with_marks(Marker::Hopf, found.hopf.iter().map(|h| place(&h.point.x)))
    }

    /// An edge of an explored diagram, without marks; dashed where det ∇_yH < 0. `ordinate` and `style` as in
    /// [`of_branch`](Self::of_branch).
    pub fn of_edge(
        edge: &DiagramEdge,
        ordinate: impl Fn(&[f64]) -> f64,
        style: impl Fn(&Selection, &[usize]) -> SegmentStyle,
    ) -> Self {
        let styles = edge.points.windows(2).map(|ends| {
            let negative = is_negative([ends[0].det_sign, ends[1].det_sign]);
            style(&ends[0].selection, &ends[0].grazing).with_dashes(negative)
        });
        let place = |x: &[f64]| (x.last().copied().unwrap_or(f64::NAN), ordinate(x));
        let vertices = edge.points.iter().map(|p| place(&p.x));
        let tangents = edge.points.windows(2).map(|w| {
            let ends = [&w[0], &w[1]].map(|p| (p.x.as_slice(), p.tangent.as_slice()));
            directions(&place, ends)
        });
        Self {
            tangents: tangents.collect(),
            ..Self::segments(vertices.collect(), styles.collect())
        }
    }

    /// Draws the line through all points of a branch ([`Branch::vertices`], [`Branch::polyline`]) with the
    /// tangents there, smooth between kinks: `place` is the map from x to the plane that gave the vertices of
    /// this curve.
    #[must_use]
    pub fn with_tangents(mut self, branch: &Branch, place: impl Fn(&[f64]) -> (f64, f64)) -> Self {
        let walk = branch.vertices();
        let segments = walk.windows(2);
        self.tangents = segments
            .map(|w| directions(&place, [(w[0].x, w[0].tangent), (w[1].x, w[1].tangent_before)]))
            .collect();
        self
    }

    /// Marks points of one kind.
    #[must_use]
    pub fn with_marks(mut self, kind: Marker, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.marks.extend(points.into_iter().map(|p| (kind, p)));
        self
    }

    /// The same curve without marks.
    #[must_use]
    pub fn without_marks(mut self) -> Self {
        self.marks.clear();
        self
    }

    /// Whether arrows show the direction of travel; by default they do not.
    #[must_use]
    pub fn with_arrows(mut self, drawn: bool) -> Self {
        self.arrows = drawn;
        self
    }
}

/// One pair of axes with curves.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Panel {
    pub(super) labels: (String, String),
    pub(super) caption: String,
    pub(super) curves: Vec<Curve>,
    pub(super) classes: Vec<SegmentStyle>,
    pub(super) regions: Vec<(Vec<Point>, Colour)>,
    pub(super) notes: Vec<(Point, String)>,
    pub(super) ranges: (Option<Range>, Option<Range>),
    pub(super) logarithmic: (bool, bool),
}

impl Panel {
    /// Empty axes with their labels. In labels, captions, notes, names and titles, `_` and `^` after a single letter or a bracket, and `^`
    /// after a number, make what follows a subscript or superscript: `u_t`, `10^-3`, `‖u‖_{L¹}`.
    pub fn new(x_label: impl Into<String>, y_label: impl Into<String>) -> Self {
        Self {
            labels: (x_label.into(), y_label.into()),
            ..Self::default()
        }
    }

    /// Writes a caption above the axes.
    #[must_use]
    pub fn with_caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Adds a curve.
    #[must_use]
    pub fn with_curve(mut self, curve: Curve) -> Self {
        self.curves.push(curve);
        self
    }

    /// Fills a convex polygon, under all curves; adjacent polygons of one colour join without a seam.
    #[must_use]
    pub fn with_region(mut self, corners: Vec<(f64, f64)>, colour: Colour) -> Self {
        self.regions.push((corners, colour));
        self
    }

    /// Adds a class of segments or regions to the legend, whether or not a curve has it.
    #[must_use]
    pub fn with_class(mut self, style: SegmentStyle) -> Self {
        self.classes.push(style);
        self
    }

    /// Writes a short text beside a point, for example the name of a transition.
    #[must_use]
    pub fn with_note(mut self, at: (f64, f64), text: impl Into<String>) -> Self {
        self.notes.push((at, text.into()));
        self
    }

    /// Adds an explored diagram over its parameter: every edge, and a [`Marker`] at each vertex except bounds and limits.
    #[must_use]
    pub fn with_diagram(
        mut self,
        diagram: &Diagram,
        ordinate: impl Fn(&[f64]) -> f64,
        style: impl Fn(&Selection, &[usize]) -> SegmentStyle,
    ) -> Self {
        let edges = diagram.edges().iter();
        self.curves
            .extend(edges.map(|e| Curve::of_edge(e, &ordinate, &style)));
        let mut marks = Vec::new();
        for vertex in diagram.vertices() {
            let place = (vertex.parameter(), ordinate(&vertex.x));
            let kind = match vertex.kind {
                VertexKind::PassThrough => Some(Marker::Transition),
                VertexKind::Fold => Some(Marker::Fold),
                VertexKind::Vertical => Some(Marker::Vertical),
                VertexKind::Branching | VertexKind::BranchPoint | VertexKind::Continuum => {
                    Some(Marker::Branching)
                }
                VertexKind::End => Some(Marker::End),
                VertexKind::Isolated => Some(Marker::Isolated),
                VertexKind::Start | VertexKind::Bound | VertexKind::Limit(_) => None,
            };
            marks.extend(kind.map(|k| (k, place)));
            if vertex.is_start {
                marks.push((Marker::Start, place));
            }
        }
        let smooth = diagram.folds().into_iter().filter(|f| f.vertex.is_none());
        marks.extend(smooth.map(|f| (Marker::SmoothFold, (f.parameter(), ordinate(&f.x)))));
        self.with_curve(Curve {
            marks,
            ..Curve::default()
        })
    }

    /// Draws the abscissa on a logarithmic axis: all of it must be positive.
    #[must_use]
    pub fn with_log_x(mut self) -> Self {
        self.logarithmic.0 = true;
        self
    }

    /// Draws the ordinate on a logarithmic axis: all of it must be positive.
    #[must_use]
    pub fn with_log_y(mut self) -> Self {
        self.logarithmic.1 = true;
        self
    }

    /// Removes all marks of one kind.
    pub(super) fn without_marks(mut self, kind: Marker) -> Self {
        self.curves
            .iter_mut()
            .for_each(|c| c.marks.retain(|m| m.0 != kind));
        self
    }

    /// Takes logarithms to base 10 where an axis is logarithmic.
    ///
    /// # Errors
    /// A finite value that is not positive.
    pub(super) fn on_axes(&mut self) -> Result<(), f64> {
        let log = |value: &mut f64, logarithmic: bool| {
            // Values that are not finite are detected later.
            if !logarithmic || !value.is_finite() {
                return Ok(());
            }
            if *value <= 0.0 {
                return Err(*value);
            }
            *value = value.log10();
            Ok(())
        };
        let (log_x, log_y) = self.logarithmic;
        // Values that are not positive are refused below.
        let slope = |rate: &mut f64, value: f64, logarithmic: bool| {
            if logarithmic {
                *rate /= value * std::f64::consts::LN_10;
            }
        };
        for curve in &mut self.curves {
            for (ends, rates) in curve.vertices.windows(2).zip(&mut curve.tangents) {
                for (place, rate) in ends.iter().zip(rates) {
                    slope(&mut rate.0, place.0, log_x);
                    slope(&mut rate.1, place.1, log_y);
                }
            }
        }
        let curves = self.curves.iter_mut();
        let of_curves =
            curves.flat_map(|c| c.vertices.iter_mut().chain(c.marks.iter_mut().map(|m| &mut m.1)));
        let of_regions = self.regions.iter_mut().flat_map(|r| &mut r.0);
        let of_notes = self.notes.iter_mut().map(|n| &mut n.0);
        for (x, y) in of_curves.chain(of_regions).chain(of_notes) {
            log(x, log_x)?;
            log(y, log_y)?;
        }
        for (range, logarithmic) in [(&mut self.ranges.0, log_x), (&mut self.ranges.1, log_y)] {
            if let Some((lower, upper)) = range {
                log(lower, logarithmic)?;
                log(upper, logarithmic)?;
            }
        }
        Ok(())
    }

    /// Sets the range of the abscissa; by default the range of the data that lie in the range of the ordinate.
    #[must_use]
    pub fn with_x_range(mut self, lower: f64, upper: f64) -> Self {
        self.ranges.0 = Some((lower, upper));
        self
    }

    /// Sets the range of the ordinate; by default the range of the data that lie in the range of the abscissa.
    #[must_use]
    pub fn with_y_range(mut self, lower: f64, upper: f64) -> Self {
        self.ranges.1 = Some((lower, upper));
        self
    }
}

/// A branch diagram: solution curves over the parameter, coloured by state, dashed where det ∇_yH < 0, with a [`Marker`] at each event,
/// axes and legend. One panel, or several side by side. Written as SVG, or as PDF with the feature `pdf`.
///
/// ```
/// use semismooth::output::{BranchDiagram, Colour, Curve, Panel, SegmentStyle};
/// let curve = Curve::line(vec![(0.0, 0.0), (1.0, 1.0)], SegmentStyle::new("solid", Colour::BLUE));
/// let svg = BranchDiagram::new(Panel::new("α", "y").with_curve(curve)).to_svg()?;
/// assert!(svg.starts_with("<svg"));
/// # Ok::<(), semismooth::output::OutputError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct BranchDiagram {
    pub(super) size: (u32, u32),
    pub(super) title: String,
    pub(super) panels: Vec<Panel>,
}

impl BranchDiagram {
    /// A diagram of 640 × 420 pixels with one panel.
    #[must_use]
    pub fn new(panel: Panel) -> Self {
        Self {
            size: (640, 420),
            title: String::new(),
            panels: vec![panel],
        }
    }

    /// Adds a panel to the right.
    #[must_use]
    pub fn with_panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Sets the title.
    #[must_use]
    pub fn with_title(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Sets the size in pixels.
    #[must_use]
    pub fn with_size(mut self, width: u32, height: u32) -> Self {
        self.size = (width, height);
        self
    }
}
