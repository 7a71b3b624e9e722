//! The solutions of a report: lists at loads, contact nodes, forces and energies, pictures.

use super::body::{self, MOST_PICTURES, MOST_ROWS, OF_SOLUTION, of_solution};
use super::curve::{nearest_kink, solutions};
use super::page::Page;
use super::page_of_curve::{View, described, thinned};
use super::words::{number, size};
use crate::continuation::BranchVertex;
use crate::output::OutputError;
use crate::piecewise::{PiecewiseSmoothExt, Selection};

/// Solutions listed at one load.
const MOST_SOLUTIONS: usize = 12;

impl View<'_> {
    /// What a point of the curve is, in a word.
    fn place(&self, vertex: &BranchVertex<'_>) -> String {
        let ends = self.ends().map(|ends| ends.map(|v| std::ptr::eq(v.x, vertex.x)));
        let word = match (vertex.event, ends) {
            ("point", Some([true, _])) => "start",
            ("point", Some([_, true])) => "end",
            ("point", _) => "between events",
            ("pass-through", _) => "kink",
            (event, _) => event,
        };
        word.to_owned()
    }

    pub(super) fn numbers(&self, page: &mut Page) -> Result<(), OutputError> {
        page.section("Numbers of solutions, and distances to the nearest kink");
        let verdicts = self.found.verdicts();
        let mut rows: Vec<Vec<String>> = verdicts
            .iter()
            .map(|(load, n, c)| vec![number(*load, 0.0), n.clone(), c.clone()])
            .collect();
        for (load, why) in &self.found.uncounted {
            rows.push(vec![number(*load, 0.0), "not counted".to_owned(), why.clone()]);
        }
        if rows.is_empty() {
            page.paragraph("Solutions were not counted: the work was stopped before.");
            return Ok(());
        }
        let load = format!("#{}", self.name());
        page.table(&[&load, "#number of solutions", "how far this is known"], &rows);
        if !self.remark().is_empty() {
            page.paragraph(&format!("All this is{}.", self.remark().trim_start_matches(',')));
        }
        let compliance = match self.subject.contacts {
            Some(_) => ", the compliance of the body among them, which is computed and thus rounded itself",
            None => "",
        };
        page.paragraph(&format!(
            "“Proven” refers to the equations with their numbers as they are stored{compliance}; with other data, measured or rounded, the \
             numbers of solutions may be others. The distance to the nearest kink is the value of the function that decides there, in its \
             unit: 0 at the kink, and the larger the safer."
        ));
        let mut rows = Vec::new();
        for (load, list) in &self.found.lists {
            let all = solutions(list);
            for (x, selection) in all.iter().take(MOST_SOLUTIONS) {
                rows.push(self.solution_row(*load, x, *selection)?);
            }
            if all.len() > MOST_SOLUTIONS {
                let mut row = vec![number(*load, 0.0)];
                row.push(format!("and {} more", all.len() - MOST_SOLUTIONS));
                rows.push(row);
            }
        }
        let names: Vec<String> = self
            .columns
            .iter()
            .map(|&c| format!("#{}", self.subject.names[c]))
            .collect();
        let mut head = vec![load.as_str()];
        match self.subject.contacts {
            Some(_) => head.extend(OF_SOLUTION),
            None => head.extend(names.iter().map(String::as_str)),
        }
        head.extend(["#distance to the nearest kink", "which"]);
        if !rows.is_empty() {
            page.heading("The solutions");
            page.table(&head, &rows);
        }
        Ok(())
    }

    fn solution_row(
        &self,
        load: f64,
        x: &[f64],
        selection: Option<&Selection>,
    ) -> Result<Vec<String>, OutputError> {
        let largest = size(x);
        let mut row = vec![number(load, 0.0)];
        match self.subject.contacts {
            Some(contacts) => row.extend(of_solution(&contacts.solution(x)?, &|v| number(v, largest))),
            None => row.extend(self.columns.iter().map(|&c| number(x[c], largest))),
        }
        match selection.and_then(|s| nearest_kink(self.subject, s, x)) {
            Some((site, margin)) => {
                row.push(number(margin.max(0.0), largest));
                row.push(self.subject.map.site_name(site).into_owned());
            }
            None => row.extend(["–".to_owned(), "–".to_owned()]),
        }
        Ok(row)
    }

    pub(super) fn contacts(&self, page: &mut Page) -> Result<(), OutputError> {
        let (Some(contacts), Some([first, last])) = (self.subject.contacts, self.ends()) else {
            return Ok(());
        };
        let changes = self.found.changes(self.subject);
        page.section("First slip and lift-off of each node");
        let [begin, end] = [first, last].map(|v| contacts.states(v.selection));
        body::nodes(page, self.subject, &changes, [&begin, &end]);
        page.section("Reactions and energies");
        page.paragraph(
            "Sums over the contact nodes, at the start, at events, and at the end. Friction × slip is the sum of the tangential forces times \
             the slips from the state without load, as if it were reached in one step.",
        );
        let kept = thinned(&self.vertices, MOST_ROWS);
        let shown = kept
            .iter()
            .filter(|v| v.event != "point" || v.x == first.x || v.x == last.x);
        let mut rows = Vec::new();
        for vertex in shown.take(MOST_ROWS) {
            let solution = contacts.solution(vertex.x)?;
            let mut row = vec![number(vertex.parameter(), 0.0), self.place(vertex)];
            row.extend(of_solution(&solution, &|v| number(v, size(vertex.x))));
            rows.push(row);
        }
        let load = format!("#{}", self.name());
        let mut head = vec![load.as_str(), "where"];
        head.extend(OF_SOLUTION);
        page.table(&head, &rows);
        page.section("Friction and uniqueness");
        page.list(&contacts.uniqueness(self.found.range[0], body::areas(self.subject.body)));
        self.bodies(page)
    }

    fn bodies(&self, page: &mut Page) -> Result<(), OutputError> {
        let (Some(contacts), Some(mut figures)) = (self.subject.contacts, self.subject.figures()) else {
            return Ok(());
        };
        if self.vertices.is_empty() {
            return Ok(());
        }
        let happenings = self.happenings();
        // The most telling events first: what is left out for want of room comes last.
        let named = |word: &'static str| {
            happenings
                .iter()
                .find(move |h| h.changes.iter().any(|c| c.contains(word)))
        };
        let told = [named("slip"), named("lifts off"), named("contact")]
            .into_iter()
            .flatten();
        let folds = happenings.iter().filter(|h| h.what.starts_with("fold"));
        // Then some of the others, all along the curve.
        let step = happenings.len().div_ceil(MOST_PICTURES).max(1);
        let events = told
            .chain(folds)
            .chain(happenings.iter().step_by(step))
            .map(|h| (h.vertex, described(h)));
        let ends = [
            (0, "the start".to_owned()),
            (self.vertices.len() - 1, "the end".to_owned()),
        ];
        for (k, caption) in ends.into_iter().chain(events) {
            let vertex = &self.vertices[k];
            let displacements = contacts.displacements(vertex.x)?;
            let caption = format!("{}: {caption}", self.at(vertex.parameter()));
            figures.add(
                (k, vertex.x),
                &contacts.states(vertex.selection),
                &displacements,
                &caption,
            )?;
            if figures.is_full() {
                break;
            }
        }
        figures.section(page);
        Ok(())
    }
}
