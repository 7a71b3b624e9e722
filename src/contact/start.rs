use std::ops::ControlFlow;

use super::tries::{Observer, Tries, newton_step, timed};
use super::{
    ContactBody, ContactError, ContactOptions, ContactProgress, ContactReport, ContactState, ContactStrategy,
    FrictionCoefficient, FrictionCurve, FrictionMap, FrictionProblem, FullContact, LoadPath, PlanarCoulomb,
};
use crate::clock::Deadline;
use crate::sparse::Matrix;

/// Where the search for a first point begins.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum FrictionStart {
    /// x = 0.
    #[default]
    Zero,
    /// The solution of the linear problem with all nodes sticking.
    Stick,
    /// The solution of the linear problem with the given states.
    States(Vec<ContactState>),
    /// A given point.
    Point(Vec<f64>),
}

/// A solution at fixed α, by PS-Newton from the start asked for; where that fails, from the other built-in starts and (unless states
/// are given) by the strategies of [`FullContact::solve`].
///
/// # Errors
/// [`ContactError::NegativeFriction`] where F(α) < 0 (unless states are given in which those nodes are open),
/// [`ContactError::NoStart`] with the best iterate when no start converges, wrong lengths.
pub fn first_point<M: FrictionMap + ?Sized>(
    map: &M,
    alpha: f64,
    start: &FrictionStart,
) -> Result<Vec<f64>, ContactError> {
    first_point_observed(map, alpha, start, &ContactOptions::default(), |_| {
        ControlFlow::Continue(())
    })
}

/// [`first_point`] with options, telling `observe` of each attempt and each point on the way; it may stop the search.
///
/// # Errors
/// As [`first_point`], and options out of range; a search stopped by `observe` or by `max_time` is a [`ContactError::NoStart`] with
/// [`Failure::Interrupted`](crate::newton::Failure::Interrupted).
pub fn first_point_observed<M: FrictionMap + ?Sized>(
    map: &M,
    alpha: f64,
    start: &FrictionStart,
    options: &ContactOptions,
    mut observe: impl FnMut(&ContactProgress) -> ControlFlow<()>,
) -> Result<Vec<f64>, ContactError> {
    options.validate()?;
    super::error::check_finite("the parameter", &[alpha])?;
    let problem = map.problem();
    let p = problem.num_contacts();
    if let FrictionStart::States(states) = start {
        if states.len() != p {
            return Err(ContactError::Length {
                what: "the list of states",
                expected: p,
                found: states.len(),
            });
        }
        for (node, value) in problem.friction_at(alpha).into_iter().enumerate() {
            if states[node] != ContactState::Open && value < 0.0 {
                return Err(ContactError::NegativeFriction {
                    node,
                    parameter: alpha,
                    value,
                });
            }
        }
    } else {
        problem.check_friction(alpha)?;
    }
    let m = map.num_vars();
    let zero = || {
        let mut x = vec![0.0; m];
        x[m - 1] = alpha;
        x
    };
    let given = match start {
        FrictionStart::Point(x) => {
            super::error::check_length("the start", x, m)?;
            Some(x.clone())
        }
        FrictionStart::Zero => None,
        FrictionStart::Stick => frozen(map, &vec![ContactState::Stick; p], zero())?,
        FrictionStart::States(states) => frozen(map, states, zero())?,
    };
    let deadline = Deadline::after(options.max_time);
    let mut observe = timed(deadline, &mut observe);
    let mut tries = Tries::new(options, deadline, &mut observe);
    let uniform = |s: ContactState| frozen(map, &vec![s; p], zero());
    let starts = std::iter::once(Ok(given))
        .chain(std::iter::once_with(|| Ok(Some(zero()))))
        .chain(std::iter::once_with(|| uniform(ContactState::Stick)))
        .chain(std::iter::once_with(|| uniform(ContactState::Open)));
    for (k, start) in starts.enumerate() {
        let Some(mut x) = start? else { continue };
        x[m - 1] = alpha;
        let strategy = match k {
            0 => ContactStrategy::Newton,
            _ => ContactStrategy::Restart,
        };
        if tries.run(&map, &mut x, strategy)?.solved {
            return Ok(x);
        }
        if tries.interrupted {
            return Err(tries.no_start(alpha));
        }
    }
    if !matches!(start, FrictionStart::States(_)) {
        let options = options.clone().with_max_time(deadline.left());
        match as_body(problem, alpha, &options, tries.observer()) {
            Ok(found) => {
                let mut x = found.x[found.x.len() - m..].to_vec();
                if tries.run(&map, &mut x, found.strategy())?.solved {
                    return Ok(x);
                }
            }
            Err(e) => tries.interrupted = e.is_interrupted(),
        }
    }
    Err(tries.no_start(alpha))
}

/// The solution at α by the strategies for bodies.
fn as_body(
    problem: &FrictionProblem,
    alpha: f64,
    options: &ContactOptions,
    observe: &mut Observer<'_>,
) -> Result<ContactReport, ContactError> {
    let curves = problem.friction_at(alpha).into_iter();
    let curves = curves.map(FrictionCurve::constant).collect::<Result<_, _>>()?;
    let load = LoadPath::constant(problem.load_at(alpha));
    let traces = [&problem.bnu_t, &problem.bt_t].map(Matrix::transpose);
    let [normal, tangential] = traces;
    let body = ContactBody::new(problem.a.clone(), normal, vec![tangential], load)?;
    let body = body.with_gap(problem.gap.clone())?;
    let law = PlanarCoulomb::new(FrictionCoefficient::per_node(curves)?);
    FullContact::new(body, law)?.solve_observed(alpha, None, options, observe)
}

/// The solution of the linear problem with given states (F does not depend on u), `None` where that is singular.
fn frozen<M: FrictionMap + ?Sized>(
    map: &M,
    states: &[ContactState],
    x: Vec<f64>,
) -> Result<Option<Vec<f64>>, ContactError> {
    newton_step(&map, &map.selection_of(states), x)
}
