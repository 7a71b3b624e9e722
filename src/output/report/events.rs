//! Events on the curve of a report, in words.

use super::body::{Change, MOST_ROWS};
use super::page::Page;
use super::page_of_curve::{View, described, parameter, shortened};
use super::words::{number, of_kind, size};
use crate::continuation::{Transition, TransitionKind, VertexKind};
use crate::sparse::{distance, norm};
use crate::tolerances::{DIRECTION, SIX_DIGITS};
use crate::words::Count;

/// An event of the curve.
pub(super) struct Happening<'a> {
    pub(super) vertex: usize,
    pub(super) x: &'a [f64],
    pub(super) what: &'static str,
    pub(super) changes: Vec<String>,
}

impl<'a> View<'a> {
    pub(super) fn happenings(&self) -> Vec<Happening<'a>> {
        let mut transitions = self.found.branch.transitions.iter();
        let mut out = Vec::new();
        for (k, vertex) in self.vertices.iter().enumerate() {
            let (what, changes) = match vertex.event {
                "point" => continue,
                "smooth fold" => ("fold: the load turns back", Vec::new()),
                "branch point" => ("curves branch", Vec::new()),
                _ => match transitions.next() {
                    Some(t) => (of_kind(t.kind), self.changes(t)),
                    None => continue,
                },
            };
            out.push(Happening {
                vertex: k,
                x: vertex.x,
                what,
                changes,
            });
        }
        out
    }

    /// What changes at a transition, in words.
    fn changes(&self, t: &Transition) -> Vec<String> {
        if self.subject.contacts.is_some() {
            let [before, after] = [&t.before, &t.after].map(|s| self.states(s));
            let changes = Change::between(t.parameter(), &before, &after);
            return changes.iter().map(Change::words).collect();
        }
        let piece = |site: usize, k: usize| self.subject.piece(site, k);
        let changed = t.sites.iter().filter(|c| c.from != c.to);
        changed
            .map(|c| format!("{} → {}", piece(c.site, c.from), piece(c.site, c.to)))
            .collect()
    }

    pub(super) fn events(&self, page: &mut Page) {
        page.section("What happens along the curve");
        let happenings = self.happenings();
        if happenings.is_empty() {
            page.paragraph("Nothing: no kink is passed, and the load does not turn back.");
            return;
        }
        if happenings.len() > MOST_ROWS {
            page.paragraph(&format!(
                "The first {MOST_ROWS} of {} events, and all folds; the table to copy below has the rest.",
                happenings.len()
            ));
        }
        let mut before = self.ends().map(|[first, _]| first.parameter());
        let columns = self.event_columns();
        let rows = happenings.iter().enumerate().filter_map(|(k, h)| {
            let here = parameter(h.x);
            let since = before.replace(here).map_or(0.0, |b| here - b);
            if k >= MOST_ROWS && !h.what.starts_with("fold") {
                return None;
            }
            let largest = size(h.x);
            let mut row = vec![number(here, largest), number(since, largest), described(h)];
            row.extend(columns.iter().map(|&c| number(h.x[c], largest)));
            Some(row)
        });
        let rows: Vec<_> = rows.collect();
        let head = self.head(&["#since the event before", "event"]);
        page.table(&head.iter().map(String::as_str).collect::<Vec<_>>(), &rows);
    }

    /// Positions of folds among the vertices.
    pub(super) fn folding(&self) -> Vec<usize> {
        let all = self.vertices.iter().enumerate();
        all.filter(|(_, v)| matches!(v.event, "fold" | "smooth fold"))
            .map(|(k, _)| k)
            .collect()
    }

    pub(super) fn folds(&self, page: &mut Page) {
        let folds = self.folding();
        if folds.is_empty() {
            return;
        }
        page.section("Folds: where the load turns back");
        for k in folds.iter().take(MOST_ROWS) {
            page.heading(&self.at(self.vertices[*k].parameter()));
            page.paragraph(&self.of_fold(*k));
        }
        if folds.len() > MOST_ROWS {
            page.paragraph(&format!(
                "{} more folds are in the table to copy.",
                folds.len() - MOST_ROWS
            ));
        }
    }

    /// What happens at a fold, in plain words.
    fn of_fold(&self, k: usize) -> String {
        let (vertex, before) = (&self.vertices[k], &self.vertices[k.saturating_sub(1)]);
        let here = vertex.parameter();
        let (size, rises, more) = match before.parameter() < here {
            true => ("largest", "rises", "raised further"),
            false => ("smallest", "falls", "lowered further"),
        };
        let mut out = format!(
            "On this curve the load {rises} to {} and turns back: it is the {size} one in the neighbourhood. If the load is {more}, the \
             curve has no solution near this one, and the state has to jump, which equations of equilibrium do not describe.",
            self.at(here)
        );
        match self
            .found
            .diagram
            .as_ref()
            .map(|d| d.solutions_at(self.subject.map, here))
        {
            Some(Ok(at)) if at.continua.is_empty() => {
                let near = SIX_DIGITS * (1.0 + norm(vertex.x));
                let others = at
                    .points
                    .iter()
                    .map(|p| p.x.as_slice())
                    .chain(at.isolated.iter().map(Vec::as_slice));
                let others: Vec<_> = others.filter(|x| distance(x, vertex.x) > near).collect();
                match others.len() {
                    0 => out.push_str(" No other solution at this load is known."),
                    n => {
                        let known = Count(n, "other solution is", "other solutions are");
                        let places: Vec<_> = others.iter().map(|x| self.point(x)).collect();
                        let places = match self.subject.contacts {
                            Some(_) => String::new(),
                            None => format!(": {}", shortened(&places)),
                        };
                        out.push_str(&format!(
                            " At this load {known} known{places}. Where a jump leads to these equations do not say."
                        ));
                    }
                }
            }
            _ => out.push_str(" Other solutions at this load were not looked for."),
        }
        if let (None, Some(&unknown)) = (self.subject.contacts, self.drawn.first()) {
            let name = &self.subject.names[unknown];
            let (arrives, leaves) = (vertex.tangent_before[unknown], vertex.tangent[unknown]);
            if arrives.abs().min(leaves.abs()) > DIRECTION {
                out.push_str(&match arrives * leaves > 0.0 {
                    true => format!(" {name} goes on in its direction: where {name} is prescribed in place of the load, there is no jump here."),
                    false => format!(" {name} turns back as well (snap-back): there is a jump here even where {name} is prescribed in place of the load."),
                });
            }
        }
        out
    }

    /// "x = 1, y = 2".
    fn point(&self, x: &[f64]) -> String {
        let largest = size(x);
        let pairs = self
            .columns
            .iter()
            .map(|&c| format!("{} = {}", self.subject.names[c], number(x[c], largest)));
        pairs.collect::<Vec<_>>().join(", ")
    }

    /// Events that are not on the curve of the report.
    pub(super) fn others(&self, page: &mut Page) {
        let Some(diagram) = &self.found.diagram else {
            return;
        };
        let happenings = self.happenings();
        let known = |x: &[f64]| {
            happenings
                .iter()
                .any(|h| distance(h.x, x) <= SIX_DIGITS * (1.0 + norm(x)))
        };
        let kinds = diagram.vertices().iter().filter_map(|v| {
            let what = match v.kind {
                VertexKind::PassThrough => of_kind(TransitionKind::PassThrough),
                VertexKind::Fold => of_kind(TransitionKind::Fold),
                VertexKind::Vertical => "a segment of solutions at one load begins or ends",
                VertexKind::Branching | VertexKind::BranchPoint => of_kind(TransitionKind::Branching),
                VertexKind::End => of_kind(TransitionKind::End),
                VertexKind::Isolated => "a solution from which no curve leaves",
                VertexKind::Continuum => "a continuum of solutions",
                VertexKind::Limit(_) => "the curve was not followed further",
                VertexKind::Start | VertexKind::Bound => return None,
            };
            Some((v.x.clone(), what))
        });
        let smooth = diagram.folds().into_iter().filter(|f| f.vertex.is_none());
        let smooth = smooth.map(|f| (f.x, of_kind(TransitionKind::Fold)));
        let mut all: Vec<_> = kinds.chain(smooth).filter(|(x, _)| !known(x)).collect();
        if all.is_empty() {
            return;
        }
        all.sort_by(|a, b| parameter(&a.0).total_cmp(&parameter(&b.0)));
        page.section("Events on other curves");
        if all.len() > MOST_ROWS {
            page.paragraph(&format!("The first {MOST_ROWS} of {}.", all.len()));
        }
        let rows = all.iter().take(MOST_ROWS).map(|(x, what)| {
            let largest = size(x);
            let mut row = vec![number(parameter(x), largest), (*what).to_owned()];
            row.extend(self.event_columns().iter().map(|&c| number(x[c], largest)));
            row
        });
        let rows: Vec<_> = rows.collect();
        let head = self.head(&["event"]);
        page.table(&head.iter().map(String::as_str).collect::<Vec<_>>(), &rows);
    }

    /// Unknowns that are listed beside events.
    fn event_columns(&self) -> &[usize] {
        match self.subject.contacts {
            Some(_) => &[],
            None => &self.columns,
        }
    }

    /// The parameter, other columns, and unknowns.
    fn head(&self, others: &[&str]) -> Vec<String> {
        let columns = self.event_columns().iter();
        let names = columns.map(|&c| format!("#{}", self.subject.names[c]));
        let first = std::iter::once(format!("#{}", self.name()));
        first
            .chain(others.iter().map(|&o| o.to_owned()))
            .chain(names)
            .collect()
    }
}
