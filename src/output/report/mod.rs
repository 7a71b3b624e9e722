//! Reports: one page of HTML on a problem with a parameter, for readers who know nothing of nonsmooth analysis.

mod body;
mod curve;
mod events;
mod history;
mod page;
mod page_of_curve;
mod solutions;
mod words;

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use self::body::{Contacts, Figures};
use super::OutputError;
use crate::contact::{CondensedContact, EvolutionStep, NodeLaw};
use crate::continuation::{Branch, ContinuationOptions, Diagram, SolutionList};
use crate::fem::{ContactRows, ElasticSystem};
use crate::options::setters;
use crate::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt};
use crate::sparse::replace_file;

/// Options of a [`Report`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct ReportOptions {
    /// The heading. Default "Report".
    pub title: String,
    /// How the curve is followed. The range of the parameter is that of the report, and the time is limited by `max_time`.
    pub continuation: ContinuationOptions,
    /// Loads (values of the parameter) at which solutions are counted. Default none: five equidistant ones in the range, and one between
    /// any two neighbouring folds.
    pub loads: Vec<f64>,
    /// Positions in x of the unknowns that are drawn over the load; of contact problems the resultants of the contact forces are.
    /// Default none: the first two.
    pub drawn: Vec<usize>,
    /// Names of the pieces, site by site. Default none: those that the map gives them.
    pub pieces: Vec<Vec<String>>,
    /// Time for each of three parts: the curve, the lists of solutions, all curves through them. Default 20 s.
    pub max_time: Duration,
}

impl Default for ReportOptions {
    fn default() -> Self {
        Self {
            title: "Report".to_owned(),
            continuation: ContinuationOptions::default(),
            loads: Vec::new(),
            drawn: Vec::new(),
            pieces: Vec::new(),
            max_time: Duration::from_secs(20),
        }
    }
}

impl ReportOptions {
    setters! {
        /// Sets the heading.
        with_title(title: String);
        /// Sets how the curve is followed.
        with_continuation(continuation: ContinuationOptions);
        /// Sets the loads at which solutions are counted.
        with_loads(loads: Vec<f64>);
        /// Sets the unknowns that are drawn.
        with_drawn(drawn: Vec<usize>);
        /// Sets the names of the pieces.
        with_pieces(pieces: Vec<Vec<String>>);
        /// Sets the time for each part.
        with_max_time(max_time: Duration);
    }
}

impl ReportOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    /// [`OutputError::Input`] names the option of the curve out of range, [`OutputError::Report`] a load that is not finite.
    pub fn validate(&self) -> Result<(), OutputError> {
        self.continuation.validate()?;
        match self.loads.iter().find(|load| !load.is_finite()) {
            Some(load) => Err(OutputError::Report {
                what: format!("the load {load} at which solutions are counted is not finite"),
            }),
            None => Ok(()),
        }
    }
}

/// The body of a contact problem with its contact nodes, for pictures and positions.
pub type ReportBody<'a> = (&'a ElasticSystem, &'a ContactRows);

/// Called with what is being done; may end it. What was found until then is reported.
type Observer<'a> = &'a mut dyn FnMut(&str) -> ControlFlow<()>;

/// A report on a problem with a parameter, the load: the curve of solutions with its events, folds and what happens there, the numbers of
/// solutions at some loads and how far they are known, distances to the nearest kink; of bodies in contact the first slip and lift-off of
/// each node, reactions, energies and pictures; how all this was computed, and what is not proven.
///
/// One page of HTML without references to other files, of less than 2 MB, with tables to copy; printed on paper it is as complete but for
/// these tables. The same problem gives the same page, unless a limit of time was reached.
///
/// ```
/// use semismooth::output::{Report, ReportOptions};
/// use semismooth::piecewise::MinMap;
/// // A beam that softens at y = 1: load = min(y, 5/4 − y/4).
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[0] - x[1];
///     b[0] = 1.25 - 0.25 * x[0] - x[1];
/// });
/// let report = Report::of_map(&map, &["y", "load"], &[0.0, 0.0], 2.0, &ReportOptions::default(), |_| {
///     std::ops::ControlFlow::Continue(())
/// })?;
/// assert_eq!(report.branch().map(|b| b.folds().len()), Some(1));
/// assert!(report.to_html().contains("fold: the load turns back"));
/// # Ok::<(), semismooth::output::OutputError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    html: String,
    branch: Option<Branch>,
    diagram: Option<Diagram>,
    lists: Vec<(f64, SolutionList)>,
    steps: Vec<EvolutionStep>,
}

/// What a report is on.
struct Subject<'a> {
    map: &'a dyn PiecewiseSmooth,
    /// Of the pieces, where they are not those of the map.
    pieces: &'a [Vec<String>],
    /// Of the variables, the parameter last.
    names: Vec<String>,
    contacts: Option<&'a dyn Contacts>,
    body: Option<ReportBody<'a>>,
}

impl Subject<'_> {
    fn parameter(&self) -> &str {
        self.names.last().map_or("", String::as_str)
    }

    fn piece(&self, site: usize, piece: usize) -> Cow<'_, str> {
        match self.pieces.get(site).and_then(|names| names.get(piece)) {
            Some(name) => Cow::Borrowed(name),
            None => self.map.piece_name(site, piece),
        }
    }

    fn figures<'a>(&'a self) -> Option<Figures<'a>> {
        let (system, rows) = self.body?;
        Some(Figures::new(system, rows))
    }
}

impl Report {
    /// A report on the curve of solutions of H(y, α) = 0 from the start `x` = (y, α), which may be an estimate, to `to`, another value of the
    /// parameter; where there is no solution near the start, from one at the first of the `loads` in the options that has any. `names` are
    /// those of the variables, the parameter last. `observe` is called with what is being done, and may end it.
    ///
    /// # Errors
    /// Wrong numbers of names, positions to be drawn that do not exist, a range that is empty or not finite; those of
    /// [`Branch::follow`].
    pub fn of_map<P: PiecewiseSmooth + ?Sized>(
        map: &P,
        names: &[&str],
        x: &[f64],
        to: f64,
        options: &ReportOptions,
        mut observe: impl FnMut(&str) -> ControlFlow<()>,
    ) -> Result<Self, OutputError> {
        let subject = Subject {
            map: &map,
            pieces: &options.pieces,
            names: names.iter().map(|&n| n.to_owned()).collect(),
            contacts: None,
            body: None,
        };
        Self::of_subject(&subject, x, to, options, &mut observe)
    }

    /// A report on the curve of static solutions of a body in contact, from a solution at the first value of the parameter in `range` to the
    /// second. With its `body` there are positions of nodes, and pictures.
    ///
    /// # Errors
    /// As [`of_map`](Self::of_map); that no solution is found at the first value; a `body` with other nodes than the problem.
    pub fn of_contact<L: NodeLaw>(
        problem: &CondensedContact<L>,
        body: Option<ReportBody<'_>>,
        range: [f64; 2],
        options: &ReportOptions,
        mut observe: impl FnMut(&str) -> ControlFlow<()>,
    ) -> Result<Self, OutputError> {
        check_range(range[0], range[1])?;
        let x = problem.solve(range[0], None)?;
        Self::of_subject(&of_contacts(problem, body)?, &x, range[1], options, &mut observe)
    }

    /// A report on a history of loading, from a solution at the first of the levels through the others, with the work, the elastic energy and
    /// the dissipation of each step. The problem is left at the end of the history.
    ///
    /// # Errors
    /// Fewer than two levels; as [`evolve`](crate::contact::evolve); that no solution is found at the first level; a `body` with other nodes
    /// than the problem.
    pub fn of_history<L: NodeLaw>(
        problem: &mut CondensedContact<L>,
        body: Option<ReportBody<'_>>,
        levels: &[f64],
        options: &ReportOptions,
        mut observe: impl FnMut(&str) -> ControlFlow<()>,
    ) -> Result<Self, OutputError> {
        options.validate()?;
        let &[first, _, ..] = levels else {
            return Err(OutputError::Report {
                what: format!("{} levels; a history has at least two", levels.len()),
            });
        };
        let start = problem.solve(first, None)?;
        let before = problem.solution(&start)?;
        let run = history::run(problem, start, before, &levels[1..], &mut observe)?;
        history::report(&of_contacts(problem, body)?, run, options)
    }

    /// The page.
    #[must_use]
    pub fn to_html(&self) -> &str {
        &self.html
    }

    /// Writes the page to a file, which is replaced atomically.
    ///
    /// # Errors
    /// [`OutputError::Io`].
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), OutputError> {
        let path = path.as_ref();
        replace_file(path, |part| std::fs::write(part, &self.html)).map_err(|e| OutputError::Io {
            path: Some(path.to_path_buf()),
            source: e.into(),
        })
    }

    /// The curve of solutions; `None` for a history.
    #[must_use]
    pub fn branch(&self) -> Option<&Branch> {
        self.branch.as_ref()
    }

    /// All curves through the solutions that were listed, where they were followed: in problems of at most 200 unknowns.
    #[must_use]
    pub fn diagram(&self) -> Option<&Diagram> {
        self.diagram.as_ref()
    }

    /// The loads at which solutions were counted, and what was found there.
    #[must_use]
    pub fn lists(&self) -> &[(f64, SolutionList)] {
        &self.lists
    }

    /// The steps of a history.
    #[must_use]
    pub fn steps(&self) -> &[EvolutionStep] {
        &self.steps
    }
}

fn check_range(from: f64, to: f64) -> Result<(), OutputError> {
    match from.is_finite() && to.is_finite() && from != to {
        true => Ok(()),
        false => Err(OutputError::Report {
            what: format!("the parameter goes from {from} to {to}; two different finite values are wanted"),
        }),
    }
}

fn of_contacts<'a, L: NodeLaw>(
    problem: &'a CondensedContact<L>,
    body: Option<ReportBody<'a>>,
) -> Result<Subject<'a>, OutputError> {
    let (p, d) = (problem.num_contacts(), problem.body().num_tangents());
    if let Some((_, rows)) = body
        && rows.nodes.len() != p
    {
        return Err(OutputError::Report {
            what: format!("the body has {} contact nodes, the problem {p}", rows.nodes.len()),
        });
    }
    let kinds = ["normal force", "tangential force", "second tangential force"];
    let forces = kinds[..=d].iter();
    let mut names: Vec<String> = forces
        .flat_map(|kind| (0..p).map(move |i| format!("{kind} {i}")))
        .collect();
    names.push("α".to_owned());
    Ok(Subject {
        map: problem,
        pieces: &[],
        names,
        contacts: Some(problem),
        body,
    })
}
