//! Quasi-static histories of loading.

use std::fmt;
use std::ops::ControlFlow;

use super::body_state::BodyState;
use super::law::NodeLaw;
use super::tolerances::SOLVED;
use super::{Contact, ContactError, ContactOptions, ContactProgress, ContactSolution};
use crate::InputError;
use crate::continuation::{
    Branch, Continuation, ContinuationError, ContinuationOptions, Direction, Event, Termination,
};
use crate::input::{check_finite, check_vector};
use crate::interface::View;
use crate::options::setters;
use crate::piecewise::PiecewiseSmooth;
use crate::words::Count;

/// Options of [`evolve`]. The defaults suit most problems.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct EvolutionOptions {
    /// Options of the continuation over a step; `parameter_range` is set to the step. Default: [`ContinuationOptions::default`] with
    /// `max_points` = 1000, `max_nodes` = 1000 and `local_starts` = 0: nodes that slipped are at the boundary of their cells when a step
    /// begins, and where neither one directional solve nor a search of some seconds says how they go on, Newton's method solves the level.
    /// With more of both, the branch may be followed nevertheless. `vanishing_distance` = 1e-12: steps begin at solutions that Newton's
    /// method has found to 1e-13, and where friction weakens within a slip of 1e-9, a node that sticks is as near to slipping as that.
    pub continuation: ContinuationOptions,
    /// Options of the search for a solution at a level that the branch does not reach.
    pub contact: ContactOptions,
    /// Whether coefficients of friction that depend on the slip are taken at the increment of slip of each level alone: the history
    /// variables are then not updated, and the result depends on the number of levels. Default `false`.
    pub slip_increments: bool,
}

impl Default for EvolutionOptions {
    fn default() -> Self {
        Self {
            continuation: ContinuationOptions::default()
                .with_max_points(1000)
                .with_max_nodes(1000)
                .with_local_starts(0)
                .with_vanishing_distance(1e-12),
            contact: ContactOptions::default(),
            slip_increments: false,
        }
    }
}

impl EvolutionOptions {
    setters! {
        /// Sets how the branch of a step is followed.
        with_continuation(continuation: ContinuationOptions);
        /// Sets how a solution is searched where the branch does not arrive.
        with_contact(contact: ContactOptions);
        /// Sets whether coefficients of friction are taken at the increments of slip.
        with_slip_increments(slip_increments: bool);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        self.continuation.validate()?;
        self.contact.validate()
    }
}

/// One step of [`evolve`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EvolutionStep {
    /// The load level α at the end of the step.
    pub level: f64,
    /// The solution there, in the variables of the form.
    pub x: Vec<f64>,
    /// The history variables of the law at the end of the step, node by node. With them and the displacements a history of loading can be
    /// continued: [`set_history`](crate::contact::Contact::set_history),
    /// [`set_reference_slip`](crate::contact::Contact::set_reference_slip).
    pub history: Vec<f64>,
    /// States and local quantities; slips are increments of this step.
    pub solution: ContactSolution,
    /// Displacements u_ν, u_t₁[, u_t₂] of the contact nodes: all normal ones first.
    pub displacements: Vec<f64>,
    /// α at the folds on the branch of this step; near a fold solutions are not unique.
    pub folds: Vec<f64>,
    /// Number of transitions passed.
    pub transitions: usize,
    /// How this level was reached.
    pub arrival: Arrival,
    /// Work of the loads in this step, and of the reactions at supports that move: summed over the points of the branch by the
    /// trapezoidal rule.
    pub work: f64,
    /// Change of the elastic energy of the whole body in this step. Where a law changes with its history at the end of a level (a lower
    /// coefficient of friction from the start of the next level), forces jump before the branch begins: the jump is counted in the step
    /// that follows it.
    pub stored: f64,
    /// Dissipation: where the branch was followed ([`Arrival::is_followed`]) ∫ λt · du_t, summed as the work is, so that
    /// work = stored + dissipated up to rounding and the tolerance of the points. Where it was not, Σ λt · Δu_t ≥ 0 of one implicit step:
    /// the balance then has an error of second order in the length of the step, plus the energy that a jump releases.
    ///
    /// On a branch it may be negative, by an amount of second order in the length of the step: see [`returned`](Self::returned).
    pub dissipated: f64,
    /// Work that friction returned on the branch, ≥ 0: minus the sum of the negative contributions to `dissipated`, taken node by node and
    /// from point to point. The law depends on the net slip since the level before: where a node reverses its slip within a step, friction
    /// keeps its direction and does positive work; stick or slip in the other direction follows from the next level on. 0 up to rounding
    /// where no node reverses. Like the error of `dissipated`, this is of first order in the length of the step where a velocity changes
    /// its sign abruptly, and of second order where it changes smoothly. Levels at which it is not small compared with `dissipated` are too
    /// far apart.
    #[cfg_attr(feature = "serde", serde(default))]
    pub returned: f64,
}

/// "level 0.5: followed, 2 transitions; 1 open, 2 stick, 1 slips; …": in one line.
impl fmt::Display for EvolutionStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let transitions = Count(self.transitions, "transition", "transitions");
        write!(f, "level {}: {}, {transitions}", self.level, self.arrival)?;
        if !self.folds.is_empty() {
            write!(f, ", {}", Count(self.folds.len(), "fold", "folds"))?;
        }
        write!(f, "; {}", self.solution)
    }
}

/// How a step of [`evolve`] reached its level.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Arrival {
    /// Along the branch from the step before, without a fold.
    Followed,
    /// The level is that of the step before, so that there is no branch: Newton's method began at the solution there, and ends at
    /// another one only where the law has changed with its history.
    SameLevel,
    /// The branch from the step before turns back at a fold; Newton's method found a solution on another branch (snap-through).
    Jumped,
    /// The branch passes folds and reaches the level after them, but the level was solved by Newton's method, whose solution may be another
    /// one.
    PassedFolds,
    /// The branch ended before the level, for the reason given; Newton's method found a solution.
    Ended(Termination),
    /// The branch could not be followed from the step before (too many nodes at the border of their cells, say); Newton's method found a
    /// solution.
    NotFollowed(
        #[cfg_attr(feature = "serde", serde(with = "crate::continuation::recorded"))] ContinuationError,
    ),
}

impl Arrival {
    /// Whether the branch from the step before reaches the level without a fold.
    #[must_use]
    pub fn is_followed(&self) -> bool {
        *self == Self::Followed
    }
}

impl fmt::Display for Arrival {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Followed => f.write_str("followed"),
            Self::SameLevel => f.write_str("at the level before, solved by Newton's method"),
            Self::Jumped => f.write_str("jumped to another branch"),
            Self::PassedFolds => f.write_str("reached by Newton's method after folds of the branch"),
            Self::Ended(reason) => write!(f, "the branch ended ({reason}), solved by Newton's method"),
            Self::NotFollowed(error) => write!(f, "not followed ({error}), solved by Newton's method"),
        }
    }
}

/// Events that [`evolve_observed`] reports.
#[derive(Debug)]
#[non_exhaustive]
pub enum EvolutionProgress<'a> {
    /// The search for the direction in which a branch leaves the last level, towards this one. It takes long where many nodes are at the
    /// boundary of their cells, and ends at the limits of [`EvolutionOptions::continuation`], of which `max_time` is none by default.
    Start {
        /// The level that is to be reached.
        level: f64,
    },
    /// A point of the branch to the next level.
    Point(&'a Event),
    /// The search for a solution at a level which the branch does not reach.
    Search(&'a ContactProgress),
    /// Work and energies are being summed over the points of the branch to the next level.
    Energy {
        /// Number of points done.
        done: usize,
        /// Number of points in all.
        points: usize,
    },
    /// A level has been reached.
    Step(&'a EvolutionStep),
}

/// Follows a body through a history of load levels: in each step the static law holds for the increments of slip, u_t − u_t^(k−1), and the
/// branch of solutions is followed from the old level to the new one, so that folds are found and not stepped over. At the end of a level
/// laws with a history update it: slip-dependent friction depends on the slip accumulated since the beginning.
///
/// `start` is the solution at the first level (from [`Contact::solve`]); its slips, from the reference that the problem has, enter the
/// history. `levels` are the levels after it. `observe` is called with each step and may stop. The problem keeps its last reference of
/// slips and its history: to begin a new history, [set](Contact::set_reference_slip) both to 0. Time limits in the options apply to each
/// step.
///
/// ```
/// use std::ops::ControlFlow;
/// use semismooth::contact::{
///     ContactBody, EvolutionOptions, FrictionCoefficient, FullContact, LoadPath, PlanarCoulomb, evolve,
/// };
/// use semismooth::sparse::Matrix;
/// // A block on two springs of stiffness 2, pressed by 1 with F = ½, pushed by α: to and fro.
/// let (normal, tangential) = (Matrix::from_rows(&[[1.0, 0.0]])?, Matrix::from_rows(&[[0.0, 1.0]])?);
/// let a = Matrix::from_rows(&[[2.0, 0.0], [0.0, 2.0]])?;
/// let body = ContactBody::new(a, normal, vec![tangential], LoadPath::affine(vec![1.0, 0.0], vec![0.0, 1.0]))?;
/// let mut problem = FullContact::new(body, PlanarCoulomb::new(FrictionCoefficient::nodal(vec![0.5])?))?;
/// let start = problem.solve(0.0, None)?;
/// let options = EvolutionOptions::default();
/// let steps = evolve(&mut problem, &start, &[1.5, 1.0, 0.0], &options, |_| ControlFlow::Continue(()))?;
/// // Beyond ½ it slips by half of the excess; as the push falls it first sticks, and slips back once the spring pulls by more than ½.
/// let slips: Vec<f64> = steps.iter().map(|s| s.displacements[1]).collect();
/// for (slip, exact) in slips.iter().zip([0.5, 0.5, 0.25]) {
///     assert!((slip - exact).abs() < 1e-12, "{slips:?}");
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Complexity
/// The cost of [`Branch::follow`](crate::continuation::Branch::follow), summed over the levels: O(q²) operations for each transition in
/// condensed form with an affine law, O(q³) for each point with another one.
///
/// # Errors
/// A law whose coefficients depend on the slip but has no history, unless [`EvolutionOptions::slip_increments`] is set
/// ([`ContactError::SlipOfLevels`]). Wrong lengths, levels that are not finite, options out of range, levels at which no solution is found;
/// `observe` has been called with the steps before.
pub fn evolve<V: View, L: NodeLaw>(
    problem: &mut Contact<V, L>,
    start: &[f64],
    levels: &[f64],
    options: &EvolutionOptions,
    mut observe: impl FnMut(&EvolutionStep) -> ControlFlow<()>,
) -> Result<Vec<EvolutionStep>, ContactError> {
    evolve_observed(problem, start, levels, options, |progress| match progress {
        EvolutionProgress::Step(step) => observe(step),
        _ => ControlFlow::Continue(()),
    })
}

/// [`evolve`] with an observer that is also called between levels and may stop there: the steps completed are returned, and the problem is
/// left at the last of them.
///
/// # Errors
/// As [`evolve`].
pub fn evolve_observed<V: View, L: NodeLaw>(
    problem: &mut Contact<V, L>,
    start: &[f64],
    levels: &[f64],
    options: &EvolutionOptions,
    mut observe: impl FnMut(&EvolutionProgress<'_>) -> ControlFlow<()>,
) -> Result<Vec<EvolutionStep>, ContactError> {
    evolve_told(problem, start, levels, options, &mut observe)
}

/// Compiled once for all observers.
fn evolve_told<V: View, L: NodeLaw>(
    problem: &mut Contact<V, L>,
    start: &[f64],
    levels: &[f64],
    options: &EvolutionOptions,
    observe: Observer<'_>,
) -> Result<Vec<EvolutionStep>, ContactError> {
    options.validate()?;
    if problem.node_law().depends_on_slip() && !options.slip_increments {
        return Err(ContactError::SlipOfLevels);
    }
    check_finite("the list of load levels", levels)?;
    check_vector("the solution x", start, problem.num_vars())?;
    let mut x = start.to_vec();
    if options.slip_increments {
        let reference = problem.traces(&x)?;
        let reference = problem.tangential(&reference).to_vec();
        problem.set_reference_slip(&reference)?;
    } else {
        problem.end_level(&x)?;
    }
    let mut steps = Vec::new();
    let mut stopped = false;
    for &level in levels {
        let mut see = |progress: &EvolutionProgress<'_>| {
            let flow = observe(progress);
            stopped |= flow.is_break();
            flow
        };
        let step = one_level(problem, &x, level, options, &mut see);
        if stopped {
            break;
        }
        let Some(step) = step? else {
            break;
        };
        if options.slip_increments {
            let reference = problem.tangential(&step.displacements).to_vec();
            problem.set_reference_slip(&reference)?;
        } else {
            problem.end_level(&step.x)?;
        }
        x.clone_from(&step.x);
        let step = EvolutionStep {
            history: problem.history().to_vec(),
            ..step
        };
        let flow = observe(&EvolutionProgress::Step(&step));
        steps.push(step);
        if flow.is_break() {
            break;
        }
    }
    Ok(steps)
}

type Observer<'a> = &'a mut dyn FnMut(&EvolutionProgress<'_>) -> ControlFlow<()>;

/// The step from x to a level; its history is not yet updated. `None`, or an error, once the observer has stopped.
fn one_level<V: View, L: NodeLaw>(
    problem: &Contact<V, L>,
    x: &[f64],
    level: f64,
    options: &EvolutionOptions,
    observe: Observer<'_>,
) -> Result<Option<EvolutionStep>, ContactError> {
    let reached = if level == x[x.len() - 1] {
        Reached {
            way: vec![x.to_vec(), search(problem, x, level, options, observe)?],
            folds: Vec::new(),
            transitions: 0,
            arrival: Arrival::SameLevel,
        }
    } else {
        match reach(problem, x, level, options, observe)? {
            Some(reached) => reached,
            None => return Ok(None),
        }
    };
    let implicit = !reached.arrival.is_followed();
    // Where the law has changed with its history at the end of a level, the branch does not begin at x: the jump from x is counted in this
    // step.
    let (begin, mut last) = (BodyState::at(problem, x)?, ContactForces::at(problem, x)?);
    let (mut state, mut work) = (BodyState::at(problem, x)?, 0.0);
    let (mut dissipated, mut returned) = (0.0, 0.0);
    let mut end = x;
    for (done, x) in reached.way.iter().enumerate() {
        let points = reached.way.len();
        if observe(&EvolutionProgress::Energy { done, points }).is_break() {
            return Ok(None);
        }
        let (next, forces) = (BodyState::at(problem, x)?, ContactForces::at(problem, x)?);
        work += next.work_from(&state);
        for part in forces.dissipated_from(&last, implicit) {
            dissipated += part;
            returned += (-part).max(0.0);
        }
        (state, last, end) = (next, forces, x);
    }
    Ok(Some(EvolutionStep {
        level,
        solution: problem.solution(end)?,
        displacements: problem.traces(end)?,
        folds: reached.folds,
        transitions: reached.transitions,
        arrival: reached.arrival,
        work,
        stored: state.stored() - begin.stored(),
        dissipated,
        returned,
        history: Vec::new(),
        x: end.to_vec(),
    }))
}

/// Tangential forces and slips.
struct ContactForces(Vec<Tangential>);

/// Traction and slip of a node.
type Tangential = ([f64; 2], [f64; 2]);

impl ContactForces {
    fn at<V: View, L: NodeLaw>(problem: &Contact<V, L>, x: &[f64]) -> Result<Self, ContactError> {
        check_vector("the solution x", x, problem.num_vars())?;
        let nodes = problem.nodes(x).into_iter();
        Ok(Self(nodes.map(|v| (v.traction, v.slip)).collect()))
    }

    /// λt · Δu_t of each node with the forces at the end of an implicit step, or the mean of those at both ends.
    fn dissipated_from<'a>(&'a self, before: &'a Self, implicit: bool) -> impl Iterator<Item = f64> + 'a {
        let of_node = move |(after, past): (&Tangential, &Tangential)| -> f64 {
            let ((now, slip), (old, past)) = (after, past);
            let force = |d: usize| if implicit { now[d] } else { 0.5 * (now[d] + old[d]) };
            (0..2).map(|d| force(d) * (slip[d] - past[d])).sum()
        };
        self.0.iter().zip(&before.0).map(of_node)
    }
}

/// Whether the law holds at the end of a branch. Where friction weakens within a slip of 1e-9, a curve may leave the cell of its selection by
/// as little, with forces that are far off: the law of a node that slips, continued to slips in the other direction.
fn holds<V: View, L: NodeLaw>(problem: &Contact<V, L>, x: &[f64]) -> bool {
    problem.solution(x).is_ok_and(|s| s.residuals.largest() <= SOLVED)
}

struct Reached {
    /// Points from the old level to the new one.
    way: Vec<Vec<f64>>,
    folds: Vec<f64>,
    transitions: usize,
    arrival: Arrival,
}

/// A solution at the level by Newton's method from x.
fn search<V: View, L: NodeLaw>(
    problem: &Contact<V, L>,
    x: &[f64],
    level: f64,
    options: &EvolutionOptions,
    observe: Observer<'_>,
) -> Result<Vec<f64>, ContactError> {
    let see = |progress: &ContactProgress| observe(&EvolutionProgress::Search(progress));
    let found = problem.solve_observed(level, Some(x), &options.contact, see);
    found.map(|report| report.x)
}

/// From a solution of the step before to the new level; `None` where the observer stops on the branch.
fn reach<V: View, L: NodeLaw>(
    problem: &Contact<V, L>,
    x: &[f64],
    level: f64,
    options: &EvolutionOptions,
    observe: Observer<'_>,
) -> Result<Option<Reached>, ContactError> {
    let begin = x[x.len() - 1];
    let direction = if level > begin {
        Direction::Increasing
    } else {
        Direction::Decreasing
    };
    let continuation = options
        .continuation
        .clone()
        .with_parameter_range((begin.min(level), begin.max(level)));
    if observe(&EvolutionProgress::Start { level }).is_break() {
        return Ok(None);
    }
    let mut way: Vec<(f64, Vec<f64>)> = Vec::new();
    let mut stopped = false;
    let branch = Continuation::new(problem, x, direction, continuation).and_then(|curve| {
        Branch::collect(curve, |event| {
            if let Event::Point(_) | Event::Transition(_) = event {
                way.push((event.arclength(), event.x().to_vec()));
            }
            let flow = observe(&EvolutionProgress::Point(event));
            stopped |= flow.is_break();
            flow
        })
    });
    // The observer may also stop at the last point of a branch that has ended for another reason.
    if stopped {
        return Ok(None);
    }
    let mut jump = || search(problem, x, level, options, observe).map(|end| vec![x.to_vec(), end]);
    // Nodes that slipped start at the boundary of their cells, many at once: where that start is too degenerate, Newton's method is used
    // instead.
    let branch = match branch {
        Ok(branch) => branch,
        Err(error) => {
            return Ok(Some(Reached {
                way: jump()?,
                folds: Vec::new(),
                transitions: 0,
                arrival: Arrival::NotFollowed(error),
            }));
        }
    };
    let (folds, transitions) = (branch.folds(), branch.transitions.len());
    let arrives = (branch.points.last()).is_some_and(|p| p.parameter() == level && holds(problem, &p.x));
    let arrival = match branch.termination {
        Termination::ParameterRange if arrives && folds.is_empty() => Arrival::Followed,
        Termination::ParameterRange if arrives => Arrival::PassedFolds,
        Termination::ParameterRange => Arrival::Jumped,
        other => Arrival::Ended(other),
    };
    let way = if arrival.is_followed() {
        way.sort_by(|a, b| a.0.total_cmp(&b.0));
        way.into_iter().map(|(_, x)| x).collect()
    } else {
        jump()?
    };
    Ok(Some(Reached {
        way,
        folds,
        transitions,
        arrival,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Forces that fall from 4 to 2 while a node slips from 0.1 to 0.4, across no slip in the other direction: along a branch the mean
    /// force does the work, in an implicit step the last one.
    #[test]
    fn dissipation_is_that_of_the_last_force_or_of_the_mean() {
        let before = ContactForces(vec![([4.0, 1.0], [0.1, -0.2])]);
        let after = ContactForces(vec![([2.0, 3.0], [0.4, -0.2])]);
        let sum = |a: &ContactForces, b, implicit| a.dissipated_from(b, implicit).sum::<f64>();
        assert!((sum(&after, &before, false) - 0.9).abs() < 1e-15);
        assert!((sum(&after, &before, true) - 0.6).abs() < 1e-15);
        assert!((sum(&before, &after, true) + 1.2).abs() < 1e-15);
    }
}
