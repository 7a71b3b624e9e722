//! Heuristic search for solutions at a fixed parameter, where there are too many selections to enumerate or pieces are curved.

mod deflation;
mod list;
mod options;

use std::fmt;
use std::ops::ControlFlow;

use self::deflation::Steps;
pub use self::list::{SolutionList, list_solutions};
pub use self::options::SearchOptions;
use super::start::slices;
use super::{ContinuationError, Diagram};
use crate::InputError;
use crate::clock::Clock;
use crate::input::check_vector;
use crate::newton::{Newton, NewtonError, NewtonOptions};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection, active_set, local_index};
use crate::sparse::{distance, norm};
use crate::spread::Random;
use crate::tolerances::SELECTIONS;

/// How a solution was found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum FoundBy {
    /// A start that was given.
    Start,
    /// A random start.
    RandomStart,
    /// The selection of a known solution, changed at one site.
    Neighbour,
    /// A deflated Newton run.
    Deflation,
    /// A curve through a solution found before.
    Continuation,
}

impl FoundBy {
    /// The origin in words.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::RandomStart => "random start",
            Self::Neighbour => "neighbouring selection",
            Self::Deflation => "deflation",
            Self::Continuation => "continuation",
        }
    }
}

impl fmt::Display for FoundBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A solution that was found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FoundSolution {
    /// The point: y, followed by α for a curve.
    pub x: Vec<f64>,
    /// A selection active there.
    pub selection: Selection,
    /// Sign of det ∇_yH^(σ) of that selection: 0 when singular, `None` when the linear solver provides no determinants.
    pub det_sign: Option<i8>,
    /// The [local index](crate::piecewise::local_index), where it is known, of at most 256 active selections.
    pub index: Option<i8>,
    /// How it was found.
    pub by: FoundBy,
}

/// The solutions that a search has found. There may be others: a search never certifies completeness.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FoundSolutions {
    /// The solutions, in the order in which they were found.
    pub solutions: Vec<FoundSolution>,
    /// Σ of the local indices, where all are known. If it is not the degree of the map (+1 for Coulomb friction with F ≥ 0, for P-matrix
    /// and coercive problems) solutions are missing; if it is, the indices of any missing solutions add up to 0.
    pub index_sum: Option<i64>,
    /// Number of Newton runs, deflated ones included.
    pub runs: usize,
    /// Number of them that ended in a solution, known or not.
    pub converged: usize,
    /// Edges that lie at this α as a whole: continua of solutions.
    pub continua: usize,
    /// Rounds done; the last one found nothing new unless a limit or the observer ended the search.
    pub rounds: usize,
}

impl fmt::Display for FoundSolutions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "found {}, complete: unknown", self.solutions.len())?;
        match self.index_sum {
            Some(sum) => write!(f, "; index sum {sum:+}"),
            None => f.write_str("; index sum unknown"),
        }
    }
}

/// Searches for solutions of H(y, α) = 0 at fixed `alpha` (of H(x) = 0 for a map without parameter; `alpha` is then ignored):
/// from the given starts, from random points and selections, from selections next to those of known solutions, by deflation of
/// known solutions, and along the curves through them. For maps of any kind and size; where pieces are affine and sites few,
/// [`all_solutions`](crate::enumeration::all_solutions) gives a list that is complete.
///
/// Starts are points x of the map; their last entry is replaced by `alpha` for a curve. Without starts, 0 is one.
///
/// # Complexity
/// The number of runs is bounded by the options; a run of Newton's method factors ∇_yH in each iteration. Each run's result is compared with
/// the k solutions found so far, and a deflated run takes all of them into each of its steps: O(k² n) beside the factorisations.
///
/// # Errors
/// Options out of range, maps that are neither equation nor curve, starts of the wrong length or not finite, Jacobians outside
/// their pattern. Runs that fail are no errors.
///
/// ```
/// use semismooth::continuation::{SearchOptions, search_solutions};
/// use semismooth::piecewise::MinMap;
/// // min(y³ − y, y + 3) = 0 has the solutions −1, 0 and 1.
/// let map = MinMap::new(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[0] * x[0] * x[0] - x[0];
///     b[0] = x[0] + 3.0;
/// });
/// let none: [[f64; 1]; 0] = [];
/// let found = search_solutions(&map, 0.0, &none, &SearchOptions::default())?;
/// assert_eq!(found.solutions.len(), 3);
/// assert_eq!(found.index_sum, Some(1));
/// assert_eq!(found.to_string(), "found 3, complete: unknown; index sum +1");
/// # Ok::<(), semismooth::continuation::ContinuationError>(())
/// ```
pub fn search_solutions<P: PiecewiseSmooth + ?Sized, S: AsRef<[f64]>>(
    map: &P,
    alpha: f64,
    starts: &[S],
    options: &SearchOptions,
) -> Result<FoundSolutions, ContinuationError> {
    search(&map, alpha, &slices(starts), options, &mut |_| {
        ControlFlow::Continue(())
    })
}

/// [`search_solutions`], reporting to `observe` after every run and every followed diagram; it may end the search.
///
/// # Errors
/// As [`search_solutions`].
pub fn search_solutions_observed<P: PiecewiseSmooth + ?Sized, S: AsRef<[f64]>>(
    map: &P,
    alpha: f64,
    starts: &[S],
    options: &SearchOptions,
    mut observe: impl FnMut(&FoundSolutions) -> ControlFlow<()>,
) -> Result<FoundSolutions, ContinuationError> {
    search(&map, alpha, &slices(starts), options, &mut observe)
}

fn search(
    map: &dyn PiecewiseSmooth,
    alpha: f64,
    starts: &[&[f64]],
    options: &SearchOptions,
    observe: &mut dyn FnMut(&FoundSolutions) -> ControlFlow<()>,
) -> Result<FoundSolutions, ContinuationError> {
    options.validate()?;
    check_vector("the parameter", &[alpha], 1)?;
    let (m, n) = (map.num_vars(), map.num_residuals());
    if n == 0 || (m != n && m != n + 1) {
        return Err(PiecewiseError::Dimensions {
            vars: m,
            residuals: n,
            expected: "as many variables as residuals, or one more (the parameter), and at least one residual",
        }
        .into());
    }
    for start in starts {
        check_vector("a start", start, m)?;
    }
    let mut search = SolutionSearch {
        map,
        alpha,
        options,
        newton: Newton::new(NewtonOptions::default()).in_own_scale(),
        steps: Steps::new(map)?,
        random: Random::new(options.seed),
        found: FoundSolutions::default(),
        followed: 0,
        neighbour: (0, 0, 0),
        observe,
        ended: false,
        clock: Clock::start(),
    };
    let zero = vec![0.0; m];
    let given: Vec<&[f64]> = match starts {
        [] => vec![&zero],
        starts => starts.iter().map(AsRef::as_ref).collect(),
    };
    for start in &given {
        if search.is_over() {
            break;
        }
        search.run(start.to_vec(), FoundBy::Start)?;
    }
    for _ in 0..options.rounds {
        let before = search.found.solutions.len();
        search.round(&given)?;
        search.found.rounds += 1;
        if search.ended || search.found.solutions.len() == before {
            break;
        }
    }
    Ok(search.finish())
}

struct SolutionSearch<'a> {
    map: &'a dyn PiecewiseSmooth,
    alpha: f64,
    options: &'a SearchOptions,
    newton: Newton,
    steps: Steps<'a>,
    random: Random,
    found: FoundSolutions,
    /// Solutions from which curves have been followed.
    followed: usize,
    /// The next neighbouring selection to try: solution, site, piece.
    neighbour: (usize, usize, usize),
    observe: &'a mut dyn FnMut(&FoundSolutions) -> ControlFlow<()>,
    ended: bool,
    clock: Clock,
}

impl SolutionSearch<'_> {
    fn round(&mut self, given: &[&[f64]]) -> Result<(), ContinuationError> {
        for k in 0..self.options.starts {
            if self.is_over() {
                return Ok(());
            }
            // Every other start comes from a selection: with many sites random points lie in the cells of few selections.
            let start = if k % 2 == 0 && self.map.num_sites() > 0 {
                self.random_selection_start()
            } else {
                Some(self.random_point())
            };
            if let Some(x) = start {
                self.run(x, FoundBy::RandomStart)?;
            }
        }
        for _ in 0..self.options.neighbours {
            if self.is_over() {
                return Ok(());
            }
            let Some((mut x, selection)) = self.next_neighbour() else {
                break;
            };
            if self.steps.towards(&selection, &mut x) {
                self.run(x, FoundBy::Neighbour)?;
            }
        }
        for k in 0..self.options.deflations {
            if self.is_over() {
                return Ok(());
            }
            let x = match given.get(k) {
                Some(start) => start.to_vec(),
                None => self.between_known(),
            };
            self.deflate(x)?;
        }
        self.follow()
    }

    fn is_over(&mut self) -> bool {
        self.ended |= self.options.max_time.is_some_and(|t| self.clock.elapsed() >= t);
        self.ended
    }

    /// Size of the known solutions.
    fn unit(&self) -> f64 {
        let n = self.map.num_residuals();
        let entries = self.found.solutions.iter().flat_map(|s| &s.x[..n]);
        1.0 + entries.fold(0.0f64, |m, v| m.max(v.abs()))
    }

    fn at_parameter(&self, mut x: Vec<f64>) -> Vec<f64> {
        let n = self.map.num_residuals();
        if let Some(last) = x.get_mut(n) {
            *last = self.alpha;
        }
        x
    }

    fn random_point(&mut self) -> Vec<f64> {
        let width = self.options.spread * self.unit();
        let m = self.map.num_vars();
        let x = (0..m).map(|_| width * self.random.symmetric()).collect();
        self.at_parameter(x)
    }

    /// A known solution, or 0.
    fn base(&mut self) -> (Vec<f64>, Option<Selection>) {
        let count = self.found.solutions.len();
        if count == 0 {
            let zero = vec![0.0; self.map.num_vars()];
            return (self.at_parameter(zero), None);
        }
        let s = &self.found.solutions[self.random.below(count)];
        (s.x.clone(), Some(s.selection.clone()))
    }

    /// The solution of a random selection, or of that of a known solution with two to four sites changed.
    fn random_selection_start(&mut self) -> Option<Vec<f64>> {
        let sites = self.map.num_sites();
        let (mut x, known) = self.base();
        let selection = match known {
            Some(mut selection) if self.random.below(4) > 0 => {
                for _ in 0..2 + self.random.below(3) {
                    let site = self.random.below(sites);
                    selection.set(site, self.random.below(self.map.num_pieces(site)));
                }
                selection
            }
            _ => {
                let random = &mut self.random;
                Selection::from_pieces((0..sites).map(|s| random.below(self.map.num_pieces(s))))
            }
        };
        self.steps.towards(&selection, &mut x).then_some(x)
    }

    /// The next known solution with a selection that differs at one site.
    fn next_neighbour(&mut self) -> Option<(Vec<f64>, Selection)> {
        loop {
            let (k, site, piece) = self.neighbour;
            let solution = self.found.solutions.get(k)?;
            if site >= self.map.num_sites() {
                self.neighbour = (k + 1, 0, 0);
            } else if piece >= self.map.num_pieces(site) {
                self.neighbour = (k, site + 1, 0);
            } else {
                self.neighbour = (k, site, piece + 1);
                if solution.selection.piece(site) != piece {
                    let mut selection = solution.selection.clone();
                    selection.set(site, piece);
                    return Some((solution.x.clone(), selection));
                }
            }
        }
    }

    /// A random point near the line through two solutions.
    fn between_known(&mut self) -> Vec<f64> {
        let (a, b) = (self.base().0, self.base().0);
        let (t, noise) = (1.5 * self.random.symmetric() + 0.5, 0.1 * self.unit());
        let x = a.iter().zip(&b);
        let x = x.map(|(a, b)| a + t * (b - a)).collect::<Vec<f64>>();
        let x = x
            .into_iter()
            .map(|v| v + noise * self.random.symmetric())
            .collect();
        self.at_parameter(x)
    }

    /// Newton's method from x; a new solution is stored.
    fn run(&mut self, x: Vec<f64>, by: FoundBy) -> Result<(), ContinuationError> {
        if self.ended {
            return Ok(());
        }
        let mut x = self.at_parameter(x);
        self.found.runs += 1;
        match self.newton.solve(self.map, &mut x) {
            Ok(_) => {
                self.found.converged += 1;
                let selection = self.newton.selection().clone();
                self.add(x, selection, by);
            }
            // Random points may lie outside the domain.
            Err(NewtonError::Failed(_) | NewtonError::Linear(_)) => {}
            Err(NewtonError::Map(
                PiecewiseError::Input(InputError::NotFinite { .. }) | PiecewiseError::Linear(_),
            )) => {}
            Err(e) => return Err(e.into()),
        }
        self.report();
        Ok(())
    }

    fn deflate(&mut self, mut x: Vec<f64>) -> Result<(), ContinuationError> {
        if self.ended || self.found.solutions.is_empty() {
            return Ok(());
        }
        let unit = self.unit();
        let known: Vec<&[f64]> = self.found.solutions.iter().map(|s| s.x.as_slice()).collect();
        x = self.at_parameter(x);
        if self.steps.deflated(&known, unit, &mut x) {
            return self.run(x, FoundBy::Deflation);
        }
        self.found.runs += 1;
        self.report();
        Ok(())
    }

    /// Follows the curves through the solutions that are new since the last call, and adds their solutions at α.
    fn follow(&mut self) -> Result<(), ContinuationError> {
        let curve = self.map.num_vars() > self.map.num_residuals();
        let (Some(reach), true, false) = (self.options.reach, curve, self.is_over()) else {
            return Ok(());
        };
        let starts: Vec<Vec<f64>> = (self.found.solutions[self.followed..].iter())
            .map(|s| s.x.clone())
            .collect();
        let width = reach * (1.0 + self.alpha.abs());
        let mut options = self
            .options
            .diagram
            .clone()
            .with_parameter_range((self.alpha - width, self.alpha + width));
        if let Some(left) = self.options.max_time {
            let left = left.saturating_sub(self.clock.elapsed());
            let own = options.continuation.max_time.unwrap_or(left);
            options.continuation.max_time = Some(own.min(left));
        }
        if let Ok(diagram) = Diagram::explore(self.map, &starts, &options) {
            self.gather(&diagram)?;
        } else {
            // One by one where a start is refused: a solution at an end of the domain, or too singular to be recognised.
            for start in &starts {
                if self.is_over() || options.max_edges == 0 || options.max_points == 0 {
                    break;
                }
                if let Ok(diagram) = Diagram::explore(self.map, std::slice::from_ref(start), &options) {
                    options.max_edges = options.max_edges.saturating_sub(diagram.edges().len());
                    options.max_points = options.max_points.saturating_sub(diagram.points_computed());
                    self.gather(&diagram)?;
                }
            }
        }
        self.followed = self.found.solutions.len();
        self.report();
        Ok(())
    }

    fn gather(&mut self, diagram: &Diagram) -> Result<(), ContinuationError> {
        let at = diagram.solutions_at(self.map, self.alpha)?;
        self.found.continua += at.continua.len();
        for s in at.points {
            self.add(s.x, s.selection, FoundBy::Continuation);
        }
        Ok(())
    }

    fn add(&mut self, x: Vec<f64>, selection: Selection, by: FoundBy) {
        let reach = self.options.merge_distance * (1.0 + norm(&x));
        let known = self.found.solutions.iter().any(|s| distance(&s.x, &x) <= reach);
        if known || x.iter().any(|v| !v.is_finite()) {
            return;
        }
        let det_sign = self.steps.det_sign(&selection, &x);
        let active = active_set(self.map, &x, reach);
        let index = match active.is_singleton() {
            true => det_sign.filter(|s| *s != 0),
            false => local_index(self.map, &x, reach, SELECTIONS)
                .ok()
                .flatten()
                .and_then(|index| i8::try_from(index).ok()),
        };
        self.found.solutions.push(FoundSolution {
            x,
            selection,
            det_sign,
            index,
            by,
        });
    }

    fn report(&mut self) {
        let full = self.found.solutions.len() >= self.options.max_solutions;
        if full || (self.observe)(&self.found).is_break() {
            self.ended = true;
        }
    }

    fn finish(mut self) -> FoundSolutions {
        let indices = self.found.solutions.iter().map(|s| s.index.map(i64::from));
        let sum: Option<i64> = indices.sum();
        self.found.index_sum = sum.filter(|_| self.found.continua == 0);
        self.found
    }
}
