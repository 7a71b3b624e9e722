//! Quasi-static histories of loading.

use std::ops::ControlFlow;

use super::node_law::NodeLaw;
use super::{CondensedContact, ContactError, ContactOptions, ContactSolution};
use crate::continuation::{Branch, ContinuationError, ContinuationOptions, Direction, Termination};
use crate::options::setters;

/// Options of [`evolve`]. The defaults need no touching.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct EvolutionOptions {
    /// How the branch of a step is followed; its `parameter_range` is set to the step. Default: that of [`ContinuationOptions`] with
    /// `max_points` = 1000.
    pub continuation: ContinuationOptions,
    /// How a solution is searched at a level which the branch does not reach.
    pub contact: ContactOptions,
    /// Whether coefficients of friction that depend on the slip are taken at the increment of slip of each level alone, so that they
    /// depend on the number of levels. Default `false`: such a law is refused ([`ContactError::SlipOfLevels`]).
    pub slip_increments: bool,
}

impl Default for EvolutionOptions {
    fn default() -> Self {
        Self {
            continuation: ContinuationOptions::default().with_max_points(1000),
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
    /// [`ContactError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), ContactError> {
        match self.continuation.validate() {
            Err(ContinuationError::Option { name, value, range }) => {
                Err(ContactError::Option { name, value, range })
            }
            _ => self.contact.validate(),
        }
    }
}

/// One step of [`evolve`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EvolutionStep {
    /// The load level α at the end of the step.
    pub level: f64,
    /// The solution there (λν, λt, α).
    pub x: Vec<f64>,
    /// States and local quantities; slips are increments of this step.
    pub solution: ContactSolution,
    /// Displacements of the contact nodes, in the order of [`CondensedContact::compliance`].
    pub displacements: Vec<f64>,
    /// α at the folds which the branch of this step meets: where there are any, solutions are not unique near them.
    pub folds: Vec<f64>,
    /// Number of transitions passed.
    pub transitions: usize,
    /// How this level was reached.
    pub arrival: Arrival,
    /// Work of the loads in this step (trapezoidal rule).
    pub work: f64,
    /// Change of the elastic energy ½ uᵀ A u.
    pub stored: f64,
    /// Dissipation Σ λt · Δu_t ≥ 0 of the implicit step. work − stored − dissipated is of second order in the length of the step.
    pub dissipated: f64,
}

/// How a step of [`evolve`] came to its level.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Arrival {
    /// Along the branch from the step before, without a fold.
    Followed,
    /// The branch from the step before turns back at a fold: Newton's method found a solution on another branch (snap-through).
    Jumped,
    /// The branch passes folds and yet reaches the level: the first solution after them may be told from the one taken by Newton's method.
    PassedFolds,
    /// The branch ended on the way, for the reason given; Newton's method found a solution.
    Ended(Termination),
    /// The branch could not be followed from the step before (too many nodes at the border of their cells, say); Newton's method found a
    /// solution.
    NotFollowed(
        #[cfg_attr(feature = "serde", serde(with = "crate::continuation::extended::error"))]
        ContinuationError,
    ),
}

impl Arrival {
    /// Whether the branch from the step before reaches the level without a fold.
    #[must_use]
    pub fn is_followed(&self) -> bool {
        *self == Self::Followed
    }
}

/// Follows a body through a history of load levels: in each step the static law holds for the increments of slip, u_t − u_t^(k−1), and
/// the branch of solutions is followed from the old level to the new one, so that folds are seen and not jumped.
///
/// `start` is the solution at the first level (from [`CondensedContact::solve`]); `levels` are those that come after. `observe` sees each
/// step and may stop. The problem keeps the last reference of its slips. Limits of time in the options are those of one step.
///
/// # Errors
/// A law whose coefficients depend on the slip, unless [`EvolutionOptions::slip_increments`] is set
/// ([`ContactError::SlipOfLevels`]). Wrong lengths, levels that are not finite, options out of range, levels at which no solution is found: `observe` has seen the steps
/// before.
pub fn evolve<L: NodeLaw>(
    problem: &mut CondensedContact<L>,
    start: &[f64],
    levels: &[f64],
    options: &EvolutionOptions,
    mut observe: impl FnMut(&EvolutionStep) -> ControlFlow<()>,
) -> Result<Vec<EvolutionStep>, ContactError> {
    options.validate()?;
    if problem.law().depends_on_slip() && !options.slip_increments {
        return Err(ContactError::SlipOfLevels);
    }
    super::error::check_finite("the list of load levels", levels)?;
    let p = problem.num_contacts();
    let mut x = start.to_vec();
    let mut held = problem.contact_displacements(&x)?;
    let mut energy = Energy::at(problem, &x)?;
    let mut steps = Vec::new();
    for &level in levels {
        problem.set_reference_slip(&held[p..])?;
        let begin = x[x.len() - 1];
        let mut step = if level == begin {
            Reached {
                x: search(problem, &x, level, options)?,
                folds: Vec::new(),
                transitions: 0,
                arrival: Arrival::Followed,
            }
        } else {
            reach(problem, &x, level, options)?
        };
        x = std::mem::take(&mut step.x);
        let now = problem.contact_displacements(&x)?;
        let next = Energy::at(problem, &x)?;
        let tangential = x[p..x.len() - 1].iter().zip(now[p..].iter().zip(&held[p..]));
        let done = EvolutionStep {
            level,
            solution: problem.solution(&x)?,
            folds: step.folds,
            transitions: step.transitions,
            arrival: step.arrival,
            work: next.work_from(&energy),
            stored: next.stored - energy.stored,
            dissipated: tangential.map(|(l, (u, old))| l * (u - old)).sum(),
            displacements: now.clone(),
            x: x.clone(),
        };
        held = now;
        energy = next;
        let flow = observe(&done);
        steps.push(done);
        if flow.is_break() {
            break;
        }
    }
    Ok(steps)
}

struct Reached {
    x: Vec<f64>,
    folds: Vec<f64>,
    transitions: usize,
    arrival: Arrival,
}

/// A solution at the level, Newton's method beginning at x.
fn search<L: NodeLaw>(
    problem: &CondensedContact<L>,
    x: &[f64],
    level: f64,
    options: &EvolutionOptions,
) -> Result<Vec<f64>, ContactError> {
    let found = problem.solve_observed(level, Some(x), &options.contact, |_| ControlFlow::Continue(()));
    found.map(|report| report.x)
}

/// From a solution of the step before to the new level.
fn reach<L: NodeLaw>(
    problem: &CondensedContact<L>,
    x: &[f64],
    level: f64,
    options: &EvolutionOptions,
) -> Result<Reached, ContactError> {
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
    // Nodes that slipped start at the boundary of their cells, many at once: where that start is too degenerate Newton decides.
    let branch = match Branch::follow(problem, x, direction, continuation) {
        Ok(branch) => branch,
        Err(error) => {
            return Ok(Reached {
                x: search(problem, x, level, options)?,
                folds: Vec::new(),
                transitions: 0,
                arrival: Arrival::NotFollowed(error),
            });
        }
    };
    let (folds, transitions) = (branch.folds(), branch.transitions.len());
    let end = branch.points.into_iter().next_back();
    let end = end.filter(|p| branch.termination == Termination::ParameterRange && p.parameter() == level);
    let (arrival, end) = match end {
        Some(end) if folds.is_empty() => (Arrival::Followed, Some(end.x)),
        Some(_) => (Arrival::PassedFolds, None),
        None if branch.termination == Termination::ParameterRange => (Arrival::Jumped, None),
        None => (Arrival::Ended(branch.termination), None),
    };
    let x = end.map_or_else(|| search(problem, x, level, options), Ok)?;
    Ok(Reached {
        x,
        folds,
        transitions,
        arrival,
    })
}

/// Loads, displacements and elastic energy at a solution.
struct Energy {
    u: Vec<f64>,
    load: Vec<f64>,
    stored: f64,
}

impl Energy {
    fn at<L: NodeLaw>(problem: &CondensedContact<L>, x: &[f64]) -> Result<Self, ContactError> {
        let u = problem.displacements(x)?;
        let body = problem.body();
        let load = body.load_at(x[x.len() - 1]);
        let mut force = vec![0.0; u.len()];
        body.stiffness().mul_vec(&u, &mut force);
        let stored = 0.5 * force.iter().zip(&u).map(|(f, u)| f * u).sum::<f64>();
        Ok(Self { u, load, stored })
    }

    fn work_from(&self, before: &Self) -> f64 {
        let mean = self.load.iter().zip(&before.load).map(|(a, b)| 0.5 * (a + b));
        mean.zip(self.u.iter().zip(&before.u))
            .map(|(f, (a, b))| f * (a - b))
            .sum()
    }
}
