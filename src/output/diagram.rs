use std::borrow::Cow;

use super::plane::{Point, Range};
use super::walk::vertices;
use crate::contact::ContactState;
use crate::continuation::{Branch, Diagram, DiagramEdge, TransitionKind, VertexKind};
use crate::piecewise::Selection;

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

impl Colour {
    /// No contact.
    pub const RED: Self = Self::new(0xd6, 0x27, 0x28);
    /// Stick.
    pub const GREEN: Self = Self::new(0x1a, 0x96, 0x41);
    /// Slip.
    pub const BLUE: Self = Self::new(0x1f, 0x5f, 0xd0);
    /// Grazing.
    pub const GREY: Self = Self::new(0x8c, 0x8c, 0x8c);
    /// Orange.
    pub const ORANGE: Self = Self::new(0xe6, 0x7e, 0x00);
    /// Purple.
    pub const PURPLE: Self = Self::new(0x7b, 0x3f, 0xa0);

    /// A colour from its components.
    #[must_use]
    pub const fn new(red: u8, green: u8, blue: u8) -> Self {
        Self { red, green, blue }
    }
}

/// How the segments of one class are drawn: name in the legend and colour.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SegmentStyle {
    /// Name in the legend; segments of the same name share an entry.
    pub name: Cow<'static, str>,
    /// Colour of the line.
    pub colour: Colour,
    /// Whether the line is dashed: where det ∇_yH < 0, in the pictures of this crate.
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

/// A curve in the plane: a polyline with a style for each segment, and marks.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Curve {
    pub(super) vertices: Vec<Point>,
    pub(super) styles: Vec<SegmentStyle>,
    pub(super) transitions: Vec<Point>,
    pub(super) branchings: Vec<Point>,
    pub(super) smooth_folds: Vec<Point>,
    pub(super) starts: bool,
    /// Without arrows: the curve has no direction of travel.
    pub(super) undirected: bool,
}

impl Curve {
    /// A polyline with all segments alike, without marks.
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

    /// A branch over its parameter: `ordinate` is the scalar of x = (y, α) that is drawn, `style` the class of a segment from its
    /// selection and the sites that graze on it. Marks the start, the transitions, the smooth folds and the branching points.
    pub fn of_branch(
        branch: &Branch,
        ordinate: impl Fn(&[f64]) -> f64,
        style: impl Fn(&Selection, &[usize]) -> SegmentStyle,
    ) -> Self {
        let place = |x: &[f64]| (x.last().copied().unwrap_or(f64::NAN), ordinate(x));
        let walk = vertices(branch);
        let segments = walk.len().saturating_sub(1);
        let (branching, other): (Vec<_>, Vec<_>) = branch
            .transitions
            .iter()
            .partition(|t| t.kind == TransitionKind::Branching);
        let branchings = branching
            .iter()
            .map(|t| place(&t.x))
            .chain(branch.branch_points.iter().map(|b| place(&b.point.x)));
        Self {
            vertices: walk.iter().map(|v| place(v.x)).collect(),
            styles: walk[..segments]
                .iter()
                .map(|v| style(v.selection, v.grazing))
                .collect(),
            transitions: other.iter().map(|t| place(&t.x)).collect(),
            branchings: branchings.collect(),
            smooth_folds: branch.smooth_folds.iter().map(|f| place(&f.point.x)).collect(),
            starts: true,
            undirected: false,
        }
    }

    /// An edge of an explored diagram, without marks and arrows; dashed where det ∇_yH < 0. `ordinate` and `style` as in
    /// [`of_branch`](Self::of_branch).
    pub fn of_edge(
        edge: &DiagramEdge,
        ordinate: impl Fn(&[f64]) -> f64,
        style: impl Fn(&Selection, &[usize]) -> SegmentStyle,
    ) -> Self {
        let points = edge.points.iter();
        let styles = edge.points.windows(2).map(|ends| {
            // Signs are those of a stretch; at a smooth fold, where it changes, the point knows none.
            let signs = ends.iter().map(|p| p.det_sign);
            let negative = signs.flatten().find(|s| *s != 0) == Some(-1);
            style(&ends[0].selection, &ends[0].grazing).with_dashes(negative)
        });
        Self {
            vertices: points.map(|p| (p.parameter(), ordinate(&p.x))).collect(),
            styles: styles.collect(),
            undirected: true,
            ..Self::default()
        }
    }

    /// Marks transitions by circles.
    #[must_use]
    pub fn with_transitions(mut self, points: Vec<(f64, f64)>) -> Self {
        self.transitions = points;
        self
    }

    /// Marks branching points by diamonds.
    #[must_use]
    pub fn with_branchings(mut self, points: Vec<(f64, f64)>) -> Self {
        self.branchings = points;
        self
    }

    /// Marks smooth folds by squares.
    #[must_use]
    pub fn with_smooth_folds(mut self, points: Vec<(f64, f64)>) -> Self {
        self.smooth_folds = points;
        self
    }

    /// Whether arrows show the direction of travel.
    #[must_use]
    pub fn with_arrows(mut self, drawn: bool) -> Self {
        self.undirected = !drawn;
        self
    }

    /// Whether the first vertex is marked by a star.
    #[must_use]
    pub fn with_start(mut self, marked: bool) -> Self {
        self.starts = marked;
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
}

impl Panel {
    /// Empty axes with their labels.
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

    /// Fills a convex polygon, under all curves; neighbours of one colour join without a seam.
    #[must_use]
    pub fn with_region(mut self, corners: Vec<(f64, f64)>, colour: Colour) -> Self {
        self.regions.push((corners, colour));
        self
    }

    /// Adds a class of segments or regions to the legend that no curve has.
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

    /// Adds an explored diagram over its parameter: every edge, ○ at vertices with two arms or fewer, ◆ where more meet, □ at
    /// smooth folds, ✱ at starts. Bounds and limits are not marked.
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
        let mut marks = Curve::default();
        for vertex in diagram.vertices() {
            let place = (vertex.parameter(), ordinate(&vertex.x));
            match vertex.kind {
                VertexKind::Branching | VertexKind::BranchPoint => marks.branchings.push(place),
                VertexKind::Start | VertexKind::Bound | VertexKind::Limit(_) => {}
                _ => marks.transitions.push(place),
            }
            if vertex.is_start {
                let start = Curve::line(vec![place], SegmentStyle::new("", Colour::GREY));
                self.curves.push(start.with_start(true));
            }
        }
        let smooth = diagram.folds().into_iter().filter(|f| f.vertex.is_none());
        marks.smooth_folds = smooth.map(|f| (f.parameter(), ordinate(&f.x))).collect();
        self.with_curve(marks)
    }

    /// Shows this range of the abscissa only; by default all of every curve.
    #[must_use]
    pub fn with_x_range(mut self, lower: f64, upper: f64) -> Self {
        self.ranges.0 = Some((lower, upper));
        self
    }

    /// Shows this range of the ordinate only; by default all of every curve.
    #[must_use]
    pub fn with_y_range(mut self, lower: f64, upper: f64) -> Self {
        self.ranges.1 = Some((lower, upper));
        self
    }
}

/// A branch diagram: solution curves over the parameter, coloured by state, ○ at transitions, □ at smooth folds, ◆ at branching points, ✱ at starts,
/// arrows in the direction of travel, dashes where det ∇_yH < 0 (diagrams), axes, legend. One panel, or several side by side.
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
