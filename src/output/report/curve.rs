//! A report on the curve of solutions through a start.

use std::cell::{Cell, RefCell};
use std::time::Duration;

use super::body::Change;
use super::words::of_list;
use super::{Observer, Report, ReportOptions, Subject, check_range};
use crate::continuation::{
    Branch, Continuation, Diagram, DiagramOptions, Direction, SearchOptions, SolutionList, list_solutions,
};
use crate::enumeration::EnumerationOptions;
use crate::output::OutputError;
use crate::piecewise::{Selection, TestLayout, cell_margin};
use crate::words::Short;

/// Unknowns up to which all curves through the listed solutions are followed.
const MOST_FOR_DIAGRAMS: usize = 200;
/// Solutions from which they are followed at most.
const MOST_STARTS: usize = 100;
/// Equidistant loads at which solutions are counted.
const LOADS: usize = 5;
/// Stretches between folds in which solutions are counted, too.
const MOST_STRETCHES: usize = 5;

/// What was computed for a report.
pub(super) struct Found {
    pub(super) branch: Branch,
    pub(super) lists: Vec<(f64, SolutionList)>,
    /// Loads at which solutions could not be counted, and why.
    pub(super) uncounted: Vec<(f64, String)>,
    pub(super) diagram: Option<Diagram>,
    /// Why there is no diagram.
    pub(super) no_diagram: String,
    /// Whether the observer ended the work.
    pub(super) stopped: bool,
    pub(super) range: [f64; 2],
}

impl Report {
    pub(super) fn of_subject(
        subject: &Subject<'_>,
        x: &[f64],
        to: f64,
        options: &ReportOptions,
        observe: Observer<'_>,
    ) -> Result<Self, OutputError> {
        options.validate()?;
        check(subject, x, options)?;
        let from = x[x.len() - 1];
        check_range(from, to)?;
        let found = find(subject, x, [from, to], options, observe)?;
        let html = super::page_of_curve::write(subject, &found, options)?;
        Ok(Self {
            html,
            branch: Some(found.branch),
            diagram: found.diagram,
            lists: found.lists,
            steps: Vec::new(),
        })
    }
}

fn check(subject: &Subject<'_>, x: &[f64], options: &ReportOptions) -> Result<(), OutputError> {
    let (m, wrong) = (subject.map.num_vars(), |what: String| {
        Err(OutputError::Report { what })
    });
    if subject.names.len() != m {
        return wrong(format!("{} names for {m} variables", subject.names.len()));
    }
    if x.len() != m || m == 0 {
        return wrong(format!("a start of {} numbers for {m} variables", x.len()));
    }
    match options.drawn.iter().find(|&&k| k >= m) {
        Some(k) => wrong(format!("variable {k} is to be drawn; the last one is {}", m - 1)),
        None => Ok(()),
    }
}

fn find(
    subject: &Subject<'_>,
    x: &[f64],
    [from, to]: [f64; 2],
    options: &ReportOptions,
    observe: Observer<'_>,
) -> Result<Found, OutputError> {
    let range = (from.min(to), from.max(to));
    let continuation = options.continuation.clone().with_parameter_range(range);
    let continuation = continuation.with_max_time(Some(options.max_time));
    let name = subject.parameter();
    let mut stopped = false;
    let begin = |x: &[f64]| {
        let direction = match from < to {
            true => Direction::Increasing,
            false => Direction::Decreasing,
        };
        Continuation::new(subject.map, x, direction, continuation.clone())
    };
    let curve = match begin(x) {
        Ok(curve) => curve,
        // Where there is no solution at the start there may be some at the loads asked for.
        Err(error) => match first_solution(subject, options) {
            Some(x) => begin(&x)?,
            None => return Err(error.into()),
        },
    };
    let branch = Branch::collect(curve, |event| {
        let flow = observe(&format!("the curve, {name} = {}", Short(event.parameter())));
        stopped |= flow.is_break();
        flow
    })?;
    let mut found = Found {
        branch,
        lists: Vec::new(),
        uncounted: Vec::new(),
        diagram: None,
        no_diagram: String::new(),
        stopped,
        range: [from, to],
    };
    if !found.stopped {
        found.count(subject, options, observe);
    }
    if !found.stopped {
        found.explore(subject, options, observe);
    }
    Ok(found)
}

/// A solution at one of the loads of the options.
fn first_solution(subject: &Subject<'_>, options: &ReportOptions) -> Option<Vec<f64>> {
    let enumeration = EnumerationOptions::default().with_max_time(Some(options.max_time));
    let search = SearchOptions::default().with_max_time(Some(options.max_time));
    let lists = options.loads.iter().map(|&load| {
        let list = list_solutions(subject.map, load, &enumeration, &search, &|| false);
        list.ok().and_then(|list| points(&list).into_iter().next())
    });
    lists.flatten().next()
}

impl Found {
    /// The loads at which solutions are counted.
    fn loads(&self, options: &ReportOptions) -> Vec<f64> {
        if !options.loads.is_empty() {
            return options.loads.clone();
        }
        let [from, to] = self.range;
        let share = |k: usize| k as f64 / (LOADS - 1) as f64;
        let mut loads: Vec<f64> = (0..LOADS).map(|k| from + share(k) * (to - from)).collect();
        // Rounding shall not move the last one.
        loads[LOADS - 1] = to;
        let mut folds = self.branch.folds();
        folds.sort_by(f64::total_cmp);
        let apart = 1e-9 * (to - from).abs();
        let stretches = folds.windows(2).filter(|f| f[1] - f[0] > apart);
        loads.extend(stretches.take(MOST_STRETCHES).map(|f| 0.5 * (f[0] + f[1])));
        loads.sort_by(f64::total_cmp);
        if from > to {
            loads.reverse();
        }
        loads
    }

    fn count(&mut self, subject: &Subject<'_>, options: &ReportOptions, observe: Observer<'_>) {
        let loads = self.loads(options);
        let each = options.max_time / loads.len() as u32;
        let each = each.max(Duration::from_millis(1));
        let enumeration = EnumerationOptions::default().with_max_time(Some(each));
        let search = SearchOptions::default().with_max_time(Some(each));
        let (told, stopped) = (RefCell::new(observe), Cell::new(false));
        for load in loads {
            let doing = format!("solutions at {} = {}", subject.parameter(), Short(load));
            let stop = || {
                stopped.set(stopped.get() || told.borrow_mut()(&doing).is_break());
                stopped.get()
            };
            if stop() {
                break;
            }
            match list_solutions(subject.map, load, &enumeration, &search, &stop) {
                Ok(list) => self.lists.push((load, list)),
                Err(e) => self.uncounted.push((load, e.to_string())),
            }
        }
        self.stopped |= stopped.get();
    }

    fn explore(&mut self, subject: &Subject<'_>, options: &ReportOptions, observe: Observer<'_>) {
        if subject.map.num_residuals() > MOST_FOR_DIAGRAMS {
            self.no_diagram = format!("they are followed for at most {MOST_FOR_DIAGRAMS} unknowns");
            return;
        }
        let listed = self.lists.iter().flat_map(|(_, list)| points(list));
        let begin = self.branch.points.first().map(|p| p.x.clone());
        let starts: Vec<Vec<f64>> = begin.into_iter().chain(listed).take(MOST_STARTS).collect();
        let [from, to] = self.range;
        let continuation = options.continuation.clone().with_max_time(Some(options.max_time));
        let diagram = DiagramOptions::default()
            .with_continuation(continuation.with_targets(Vec::new()))
            .with_parameter_range((from.min(to), from.max(to)));
        let mut stopped = false;
        let explored = Diagram::explore_observed(subject.map, &starts, &diagram, |now| {
            let flow = observe(&format!(
                "all curves, {} = {}",
                subject.parameter(),
                Short(now.event.parameter())
            ));
            stopped |= flow.is_break();
            flow
        });
        self.stopped |= stopped;
        match explored {
            Ok(diagram) => self.diagram = Some(diagram),
            Err(e) => self.no_diagram = e.to_string(),
        }
    }

    /// For each load the number of solutions, and how far it is known.
    pub(super) fn verdicts(&self) -> Vec<(f64, String, String)> {
        let lists = self.lists.iter().map(|(load, list)| {
            let (number, certainty) = of_list(list);
            (*load, number, certainty)
        });
        lists.collect()
    }

    /// Changes of states of contact nodes along the curve.
    pub(super) fn changes(&self, subject: &Subject<'_>) -> Vec<Change> {
        let Some(contacts) = subject.contacts else {
            return Vec::new();
        };
        let transitions = self.branch.transitions.iter();
        transitions
            .flat_map(|t| {
                let [before, after] = [&t.before, &t.after].map(|s| contacts.states(s));
                Change::between(t.parameter(), &before, &after)
            })
            .collect()
    }
}

/// The points of a list, the ends of continua included.
fn points(list: &SolutionList) -> Vec<Vec<f64>> {
    match list {
        SolutionList::Enumerated(set) => {
            let isolated = set.solutions.iter().map(|s| s.x.clone());
            let ends = set.continua.iter().flat_map(|c| c.ends.iter().cloned());
            isolated.chain(ends).collect()
        }
        SolutionList::Searched(found) => found.solutions.iter().map(|s| s.x.clone()).collect(),
    }
}

/// The solutions of a list with a selection each.
pub(super) fn solutions(list: &SolutionList) -> Vec<(&[f64], Option<&Selection>)> {
    match list {
        SolutionList::Enumerated(set) => {
            let all = set.solutions.iter();
            all.map(|s| (s.x.as_slice(), s.selections.first())).collect()
        }
        SolutionList::Searched(found) => {
            let all = found.solutions.iter();
            all.map(|s| (s.x.as_slice(), Some(&s.selection))).collect()
        }
    }
}

/// The site whose switching functions are nearest to a change, and their least value.
pub(super) fn nearest_kink(subject: &Subject<'_>, selection: &Selection, x: &[f64]) -> Option<(usize, f64)> {
    let map = subject.map;
    let layout = TestLayout::new(map);
    let mut tests = vec![0.0; layout.total()];
    map.test_functions(x, &mut tests);
    let margin = |site: usize| cell_margin(map.cell(site, selection.piece(site)), &tests[layout.range(site)]);
    let all = (0..map.num_sites()).map(|site| (site, margin(site)));
    all.filter(|(_, m)| m.is_finite())
        .min_by(|a, b| a.1.total_cmp(&b.1))
}
