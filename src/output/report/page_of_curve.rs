//! The page on a curve of solutions.

use super::body::{OF_SOLUTION, of_solution};
use super::curve::Found;
use super::events::Happening;
use super::page::Page;
use super::words::number;
use super::{ReportOptions, Subject};
use crate::contact::ContactState;
use crate::continuation::{BranchVertex, Termination};
use crate::output::{BranchDiagram, Curve, Marker, OutputError, Panel, SegmentStyle};
use crate::piecewise::Selection;
use crate::words::{Count, Short};

/// Points of a curve up to which all are drawn; of longer ones only some between events.
const MOST_DRAWN: usize = 3000;
/// Rows of the table of the curve.
const MOST_COPIED: usize = 1500;
/// Unknowns up to which all have a column.
const COLUMNS: usize = 6;

type Ordinate<'a> = Box<dyn Fn(&[f64]) -> f64 + 'a>;
/// How the segments on a selection are drawn.
type Style<'a> = Box<dyn Fn(&Selection, &[usize]) -> SegmentStyle + 'a>;

pub(super) fn write(
    subject: &Subject<'_>,
    found: &Found,
    options: &ReportOptions,
) -> Result<String, OutputError> {
    let view = View::new(subject, found, options);
    let mut page = Page::default();
    view.summary(&mut page);
    view.picture(&mut page)?;
    view.events(&mut page);
    view.folds(&mut page);
    view.others(&mut page);
    view.numbers(&mut page)?;
    view.contacts(&mut page)?;
    view.method(&mut page);
    words(&mut page);
    page.section("Tables to copy");
    view.copy(&mut page)?;
    let map = subject.map;
    let subtitle = match subject.contacts {
        Some(contacts) => format!(
            "A body in contact: {}, {}; {} from {} to {}.",
            Count(contacts.num_displacements(), "displacement", "displacements"),
            Count(map.num_sites(), "contact node", "contact nodes"),
            subject.parameter(),
            Short(found.range[0]),
            Short(found.range[1])
        ),
        None => format!(
            "{} with {}; {} from {} to {}.",
            Count(map.num_residuals(), "equation", "equations"),
            Count(map.num_sites(), "kink", "kinks"),
            subject.parameter(),
            Short(found.range[0]),
            Short(found.range[1])
        ),
    };
    Ok(page.finish(&options.title, &subtitle))
}

pub(super) struct View<'a> {
    pub(super) subject: &'a Subject<'a>,
    pub(super) found: &'a Found,
    pub(super) drawn: Vec<usize>,
    /// Unknowns with a column.
    pub(super) columns: Vec<usize>,
    pub(super) vertices: Vec<BranchVertex<'a>>,
}

impl<'a> View<'a> {
    fn new(subject: &'a Subject<'a>, found: &'a Found, options: &ReportOptions) -> Self {
        let n = subject.map.num_residuals();
        let drawn = match options.drawn.is_empty() {
            true => (0..n.min(2)).collect(),
            false => options.drawn.clone(),
        };
        let columns = match n <= COLUMNS {
            true => (0..n).collect(),
            false => drawn.clone(),
        };
        Self {
            subject,
            found,
            drawn,
            columns,
            vertices: found.branch.vertices(),
        }
    }

    pub(super) fn name(&self) -> &str {
        self.subject.parameter()
    }

    /// "load = 0.5".
    pub(super) fn at(&self, parameter: f64) -> String {
        let [from, to] = self.found.range;
        format!(
            "{} = {}",
            self.name(),
            number(parameter, from.abs().max(to.abs()))
        )
    }

    pub(super) fn states(&self, selection: &Selection) -> Vec<ContactState> {
        self.subject
            .contacts
            .map_or_else(Vec::new, |c| c.states(selection))
    }

    pub(super) fn ends(&self) -> Option<[&BranchVertex<'a>; 2]> {
        Some([self.vertices.first()?, self.vertices.last()?])
    }

    fn summary(&self, page: &mut Page) {
        page.section("In short");
        let mut items = vec![self.way()];
        let happenings = self.happenings();
        match happenings.first() {
            Some(first) => items.push(format!(
                "The first event on it is at {}: {}.",
                self.at(parameter(first.x)),
                described(first)
            )),
            None => items.push(
                "Nothing changes on the way: no kink is passed and the load does not turn back.".to_owned(),
            ),
        }
        let folds = self.folding();
        if !folds.is_empty() {
            let at: Vec<String> = folds
                .iter()
                .map(|f| self.at(self.vertices[*f].parameter()))
                .collect();
            items.push(format!(
                "The load turns back at {} ({}). A structure that is loaded across such a point jumps: see below what is known there.",
                Count(folds.len(), "point of the curve, a fold", "points of the curve, folds"),
                shortened(&at)
            ));
        }
        let verdicts = self.found.verdicts();
        let all_one = !verdicts.is_empty()
            && verdicts
                .iter()
                .all(|(_, n, c)| n == "1" && c.starts_with("proven"));
        let remark = self.remark();
        if all_one && self.found.uncounted.is_empty() {
            items.push(format!(
                "At each of {} there is exactly one solution, which is proven for the equations with their numbers as they are stored{remark}.",
                Count(verdicts.len(), "load that was examined", "loads that were examined")
            ));
        } else if !verdicts.is_empty() {
            items.push(format!(
                "Numbers of solutions {}{remark}.",
                self.grouped(&verdicts)
            ));
        }
        if self.found.stopped {
            items.push(
                "The work was stopped before its end: this report has what was found until then.".to_owned(),
            );
        }
        page.list(&items);
    }

    /// "at load = 0, 2: 1 (proven: …); at load = 1: 3 (…)"
    fn grouped(&self, verdicts: &[(f64, String, String)]) -> String {
        let mut groups: Vec<(&String, &String, Vec<f64>)> = Vec::new();
        for (load, number, certainty) in verdicts {
            match groups.iter_mut().find(|g| (g.0, g.1) == (number, certainty)) {
                Some(group) => group.2.push(*load),
                None => groups.push((number, certainty, vec![*load])),
            }
        }
        let words = groups.iter().map(|(n, certainty, loads)| {
            let loads: Vec<String> = loads.iter().map(|load| number(*load, 0.0)).collect();
            format!("at {} = {}: {n} ({certainty})", self.name(), loads.join(", "))
        });
        words.collect::<Vec<_>>().join("; ")
    }

    /// What a problem with held tangents does not say.
    pub(super) fn remark(&self) -> &'static str {
        match self.subject.contacts.is_some_and(|c| c.num_held() > 0) {
            true => ", for symmetric solutions only: tangents are held, as on planes of symmetry",
            false => "",
        }
    }

    /// From where to where the curve goes.
    fn way(&self) -> String {
        let to = self.found.range[1];
        let Some([first, last]) = self.ends() else {
            return "No point of the curve was found.".to_owned();
        };
        let (from, end) = (first.parameter(), last.parameter());
        match self.found.branch.termination {
            Termination::ParameterRange if end == to => {
                format!(
                    "The solution is followed from {} to {}.",
                    self.at(from),
                    self.at(to)
                )
            }
            Termination::ParameterRange => format!(
                "The curve of solutions through the one at {} does not reach {}: it turns back and leaves the range at {}.",
                self.at(from),
                self.at(to),
                self.at(end)
            ),
            why => format!(
                "The curve of solutions from {} is followed as far as {}, not to {}: {why}.",
                self.at(from),
                self.at(end),
                self.at(to)
            ),
        }
    }

    fn ordinates(&self) -> Vec<(String, Ordinate<'a>)> {
        if self.subject.contacts.is_some() {
            let (n, p) = (self.subject.map.num_residuals(), self.subject.map.num_sites());
            let sum =
                |from: usize| -> Ordinate<'a> { Box::new(move |x: &[f64]| x[from..from + p].iter().sum()) };
            let labels = ["normal forces", "tangential forces", "second tangential forces"];
            let labels = labels.iter().zip((0..n).step_by(p.max(1)));
            return labels
                .map(|(label, from)| (format!("sum of {label}"), sum(from)))
                .collect();
        }
        let one = |&k: &usize| -> (String, Ordinate<'a>) {
            (self.subject.names[k].clone(), Box::new(move |x: &[f64]| x[k]))
        };
        self.drawn.iter().map(one).collect()
    }

    fn picture(&self, page: &mut Page) -> Result<(), OutputError> {
        page.section("The curve of solutions");
        let style: Style<'_> = match self.subject.contacts {
            Some(contacts) => {
                Box::new(|s: &Selection, _: &[usize]| SegmentStyle::contacts(&contacts.states(s)))
            }
            None => Box::new(SegmentStyle::by_names(self.subject.map.num_sites(), |site, k| {
                self.subject.piece(site, k)
            })),
        };
        let panels = self.ordinates().into_iter().map(|(label, ordinate)| {
            let panel = Panel::new(self.name(), label);
            match &self.found.diagram {
                Some(diagram) if !diagram.edges().is_empty() => {
                    let start = self.vertices.first().map(|v| (v.parameter(), ordinate(v.x)));
                    let begin = Curve::default().with_marks(Marker::Start, start);
                    // Of the starts of the diagram that of the curve alone is of interest.
                    let panel = panel
                        .with_diagram(diagram, ordinate, &style)
                        .without_marks(Marker::Start);
                    panel.with_curve(begin)
                }
                _ => panel.with_curve(self.curve(&ordinate, &style)),
            }
        });
        let mut figures = Vec::new();
        for panel in panels {
            let caption =
                "Each line is a curve of solutions over the load. Marks are explained below the axes.";
            match BranchDiagram::new(panel).with_size(640, 440).to_svg() {
                Ok(svg) => figures.push((svg, caption.to_owned())),
                // A curve of one point, or numbers beyond what can be drawn.
                Err(OutputError::Empty { .. } | OutputError::NotDrawable { .. }) => {}
                Err(e) => return Err(e),
            }
        }
        page.figures(&figures);
        page.paragraph(
            "Lines are dashed where the determinant of the derivatives with respect to the unknowns is negative, as between the two folds of \
             an S-shaped curve. This is no statement on stability in time, of which these equations know nothing.",
        );
        Ok(())
    }

    fn curve(
        &self,
        ordinate: &dyn Fn(&[f64]) -> f64,
        style: &dyn Fn(&Selection, &[usize]) -> SegmentStyle,
    ) -> Curve {
        if self.vertices.len() <= MOST_DRAWN {
            return Curve::of_branch(&self.found.branch, ordinate, style);
        }
        let kept = thinned(&self.vertices, MOST_DRAWN);
        let place = |v: &BranchVertex<'_>| (v.parameter(), ordinate(v.x));
        let styles = kept.iter().map(|v| style(v.selection, v.grazing));
        let styles: Vec<_> = styles.take(kept.len().saturating_sub(1)).collect();
        let folds = self.folding();
        Curve::segments(kept.iter().map(|v| place(v)).collect(), styles)
            .with_marks(Marker::Fold, folds.iter().map(|k| place(&self.vertices[*k])))
    }

    fn method(&self, page: &mut Page) {
        page.section("How this was computed, and what is not proven");
        let (map, branch) = (self.subject.map, &self.found.branch);
        let residuals = branch.points.iter().map(|p| p.residual_norm);
        let residual = residuals
            .chain(branch.transitions.iter().map(|t| t.residual_norm))
            .fold(0.0, f64::max);
        let mut items = vec![
            format!(
                "semismooth {}: piecewise-smooth continuation. Between kinks the equations are smooth and the curve is followed by predictor \
                 and corrector; at each kink the place and the pieces on both sides are determined. {} in {}; the largest residual of the \
                 equations is {residual:.1e}.",
                env!("CARGO_PKG_VERSION"),
                Count(branch.corrections, "correction", "corrections"),
                Count(self.vertices.len(), "point", "points")
            ),
            match map.is_piecewise_affine() {
                true => "All pieces are affine: the curve is a polygon, and no kink on it can be passed unseen but for rounding.".to_owned(),
                false => "The pieces are curved: what a step may have jumped over is excluded only where this is said here.".to_owned(),
            },
            "The table of numbers of solutions says for each load whether its list is proven; of solutions on other curves nothing is said at \
             other loads."
                .to_owned(),
        ];
        match &self.found.diagram {
            Some(diagram) => items.push(format!(
                "All curves through the solutions listed were followed: {} with {}, {} of them closed and connected to nothing else. How far \
                 this is complete: {}.",
                Count(diagram.branches().len(), "branch", "branches"),
                Count(diagram.folds().len(), "fold", "folds"),
                diagram.isolas().len(),
                diagram.completeness()
            )),
            None if !self.found.no_diagram.is_empty() => {
                items.push(format!("Curves through other solutions were not followed: {}.", self.found.no_diagram));
            }
            None => {}
        }
        let undecided = branch.transitions.iter().filter(|t| !t.complete).count();
        if undecided > 0 {
            items.push(format!(
                "At {} it is not certain that all curves which leave it were found.",
                Count(undecided, "event", "events")
            ));
        }
        items.push("A solution is a state in equilibrium. Whether it is stable, and how fast a jump goes, is not examined.".to_owned());
        page.list(&items);
    }

    fn copy(&self, page: &mut Page) -> Result<(), OutputError> {
        let kept = thinned(&self.vertices, MOST_COPIED);
        let n = self.subject.map.num_residuals();
        let exact = |v: f64| format!("{v:?}");
        let mut head: Vec<String> = ["arclength", self.name(), "event"].map(str::to_owned).to_vec();
        let columns: Vec<usize> = if n <= 20 {
            (0..n).collect()
        } else {
            self.columns.clone()
        };
        match self.subject.contacts {
            Some(_) => head.extend(OF_SOLUTION.map(|h| h.trim_start_matches('#').to_owned())),
            None => head.extend(columns.iter().map(|&c| self.subject.names[c].clone())),
        }
        let mut rows = Vec::with_capacity(kept.len());
        for v in &kept {
            let mut row = vec![exact(v.arclength), exact(v.parameter()), v.event.to_owned()];
            match self.subject.contacts {
                Some(contacts) => row.extend(of_solution(&contacts.solution(v.x)?, &exact)),
                None => row.extend(columns.iter().map(|&c| exact(v.x[c]))),
            }
            rows.push(row);
        }
        let name = match kept.len() == self.vertices.len() {
            true => "The curve".to_owned(),
            false => format!("The curve: {} of its {} points", kept.len(), self.vertices.len()),
        };
        page.copyable(&name, &head, &rows);
        Ok(())
    }
}

/// At most about `most` vertices, folds and both ends among them; events before regular points.
pub(super) fn thinned<'v, 'a>(vertices: &'v [BranchVertex<'a>], most: usize) -> Vec<&'v BranchVertex<'a>> {
    if vertices.len() <= most {
        return vertices.iter().collect();
    }
    let last = vertices.len() - 1;
    let is_event = |v: &BranchVertex<'_>| v.event != "point";
    let events = vertices.iter().filter(|v| is_event(v)).count();
    // Where there is room for them, all events; else some, as of all vertices.
    let all = events <= most / 2;
    let step = match all {
        true => (vertices.len() - events).div_ceil((most - events).max(1)),
        false => vertices.len().div_ceil(most.max(1)),
    };
    let kept = vertices.iter().enumerate().filter(|(k, v)| {
        let fold = matches!(v.event, "fold" | "smooth fold");
        k % step == 0 || *k == last || fold || (all && is_event(v))
    });
    kept.map(|(_, v)| v).collect()
}

pub(super) fn parameter(x: &[f64]) -> f64 {
    x.last().copied().unwrap_or(f64::NAN)
}

pub(super) fn described(h: &Happening<'_>) -> String {
    match h.changes.is_empty() {
        true => h.what.to_owned(),
        false => format!("{} ({})", h.what, shortened(&h.changes)),
    }
}

/// The first of many.
pub(super) fn shortened(items: &[String]) -> String {
    const FIRST: usize = 4;
    match items.len() > FIRST {
        true => format!("{}; and {} more", items[..FIRST].join("; "), items.len() - FIRST),
        false => items.join("; "),
    }
}

/// Words that an engineer need not know.
pub(super) fn words(page: &mut Page) {
    page.section("Words");
    page.list(&[
        "Load: the parameter of the problem, whatever it is: a force, a displacement of a support, a coefficient.".to_owned(),
        "Kink: a point at which the formula changes that holds: a node of contact opens, closes, slips or sticks, a spring meets its stop. \
         The curve goes on, with another slope."
            .to_owned(),
        "Fold: a point of the curve at which the load turns back. Beyond it this curve has no solution.".to_owned(),
        "Snap-through: the jump at a fold where the load is prescribed. Snap-back: the load and the displacement turn back together, so that \
         there is a jump even where the displacement is prescribed."
            .to_owned(),
        "Branch point: a point at which curves of solutions meet.".to_owned(),
    ]);
}
