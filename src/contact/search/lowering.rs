//! Homotopies from a problem with a known solution: the body is lowered onto the foundation.

use std::ops::ControlFlow;
use std::time::Duration;

use super::tries::{Observer, newton_step};
use crate::contact::law::{LocalRow, LocalValues, NodeLaw, of_inner_law};
use crate::contact::{Contact, ContactError, ContactOptions, ContactProgress, ContactState, ContactStrategy};
use crate::continuation::{ContinuationOptions, pursue};
use crate::interface::View;
use crate::newton::Newton;
use crate::piecewise::{Facet, PiecewiseSmooth, Selection};
use crate::sparse::norm;
use crate::spread::golden;
use crate::tolerances::RESULT;

/// Limit on points × unknowns³ of one path, and the least limit on points that follows from it.
const WORK: f64 = 4e12;
const FEWEST: f64 = 300.0;

/// The smallest step: where a coefficient of friction changes steeply with the slip, compared with the
/// stiffness, paths bend within lengths far below the usual steps.
const MIN_STEP: f64 = 1e-13;

/// Largest and smallest increment of the homotopy parameter in [0, 1].
const LARGEST: f64 = 0.25;
const SMALLEST: f64 = 1.0 / 512.0;

/// A homotopy: its strategy, the number of the order in which nodes touch, the largest number of points of a path, and the time that is
/// left.
#[derive(Debug, Clone, Copy)]
pub(in crate::contact) struct Lowering {
    pub(in crate::contact) strategy: ContactStrategy,
    pub(in crate::contact) trial: usize,
    pub(in crate::contact) points: usize,
    pub(in crate::contact) left: Option<Duration>,
}

/// The result of an attempt: the last point, in the variables of the form, and the number of points found.
pub(in crate::contact) struct LoweringEnd {
    pub(in crate::contact) x: Vec<f64>,
    pub(in crate::contact) points: usize,
    pub(in crate::contact) interrupted: bool,
}

/// A law at fixed α whose parameter t lowers the body: the gap is widened by (1 − t) times the initial height of the node.
pub(in crate::contact) struct Lowered<L> {
    law: L,
    alpha: f64,
    distances: Vec<f64>,
}

impl<L: NodeLaw> Lowered<L> {
    fn inner(&self, v: &LocalValues) -> LocalValues {
        LocalValues {
            penetration: v.penetration - (1.0 - v.parameter) * self.distances[v.node],
            parameter: self.alpha,
            ..*v
        }
    }

    fn lower(&self, v: &LocalValues, row: &mut LocalRow) {
        row.parameter = row.penetration * self.distances[v.node];
    }
}

impl<L: NodeLaw> NodeLaw for Lowered<L> {
    of_inner_law!(pieces);

    fn test_rows(&self, v: &LocalValues, rows: &mut [LocalRow]) {
        self.law.test_rows(&self.inner(v), rows);
        rows.iter_mut().for_each(|row| self.lower(v, row));
    }

    fn rows(&self, piece: usize, v: &LocalValues) -> [LocalRow; 3] {
        let mut rows = self.law.rows(piece, &self.inner(v));
        rows.iter_mut().for_each(|row| self.lower(v, row));
        rows
    }

    fn num_history(&self) -> usize {
        self.law.num_history()
    }
}

/// Lowers the body onto the foundation from where no node touches it: in increments, or along the curve of solutions through kinks and
/// folds. `None` where the body is not supported without contact or the path cannot be started.
///
/// Far above the foundation the only solution is that without contact forces, and all solutions of the homotopy are bounded: the energy of
/// the contact forces is at most the work of the load. As the law is continuous, the solutions therefore include a continuum that joins the
/// first problem to the last; for almost all heights of the nodes it is a curve.
pub(in crate::contact) fn lower<V: View>(
    form: &Contact<V, &dyn NodeLaw>,
    alpha: f64,
    lowering: Lowering,
    options: &ContactOptions,
    observe: &mut Observer<'_>,
) -> Result<Option<LoweringEnd>, ContactError> {
    let (m, p) = (form.num_vars(), form.num_sites());
    let displacements = form.leading();
    let open = Selection::uniform(p, 0);
    let Some(mut x) = newton_step(form, &open, form.zero(alpha))? else {
        return Ok(None);
    };
    x[displacements..m - 1].fill(0.0);
    // Above this height λνᵀ (u_ν − gap) + λtᵀ u_t < 0 for all forces of friction with F ≤ 2, so that there are none.
    let height = form
        .nodes(&x)
        .iter()
        .fold(0.0f64, |h, v| h.max(v.penetration.abs()).max(v.slip_norm()));
    if !(height > 0.0 && height.is_finite()) {
        return Ok(None);
    }
    let distance = |i: usize| height * (3.0 + golden((lowering.trial + 1) * (i + 1) + 7 * lowering.trial));
    let law = Lowered {
        law: *form.node_law(),
        alpha,
        distances: (0..p).map(distance).collect(),
    };
    let map = form.at_load(alpha, law)?;
    x[m - 1] = 0.0;
    let mut see = |level: f64, points: usize| {
        observe(&ContactProgress {
            strategy: lowering.strategy,
            points,
            level,
        })
    };
    let arrival = if lowering.strategy == ContactStrategy::Increments {
        Some(increments(&map, x, options, &mut see))
    } else {
        let mut units = vec![height * form.law().stiffness; m];
        let length = norm(&x[..displacements]) / (displacements.max(1) as f64).sqrt();
        units[..displacements].fill(length.max(height));
        units[m - 1] = 1.0;
        let affordable = (WORK / (m as f64).powi(3)).max(FEWEST) as usize;
        let options = ContactOptions {
            max_points: lowering.points.min(affordable),
            max_time: lowering.left,
            ..options.clone()
        };
        follow(&map, &x, units, &options, &mut see)
    };
    Ok(arrival.map(|mut end| {
        end.x[m - 1] = alpha;
        end
    }))
}

/// Newton's method in increments of the parameter from 0 to 1; each begins at the solution before.
fn increments(
    map: &dyn PiecewiseSmooth,
    x: Vec<f64>,
    options: &ContactOptions,
    see: &mut dyn FnMut(f64, usize) -> ControlFlow<()>,
) -> LoweringEnd {
    let last = x.len() - 1;
    let mut newton = Newton::new(options.newton.clone());
    let mut end = LoweringEnd {
        x,
        points: 0,
        interrupted: false,
    };
    let mut step = LARGEST;
    while end.x[last] < 1.0 && step >= SMALLEST && end.points < options.max_increments && !end.interrupted {
        let mut next = end.x.clone();
        next[last] = (next[last] + step).min(1.0);
        let (level, now) = (end.x[last], end.points);
        let solved = newton.solve_observed(map, &mut next, |_| see(level, now));
        if solved.is_ok() {
            end.x = next;
            step = (2.0 * step).min(LARGEST);
        } else {
            step *= 0.5;
        }
        end.points += 1;
        end.interrupted = see(end.x[last], end.points).is_break();
    }
    end
}

/// The end of the curve from x, measured in the given units, or its point with the largest parameter.
fn follow(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    units: Vec<f64>,
    limits: &ContactOptions,
    see: &mut dyn FnMut(f64, usize) -> ControlFlow<()>,
) -> Option<LoweringEnd> {
    let last = x.len() - 1;
    let options = ContinuationOptions::default()
        .with_parameter_range((-0.2, 1.0))
        .with_step(0.1)
        .with_max_step(1.0 + (x.len() as f64).sqrt())
        .with_min_step(MIN_STEP)
        .with_step_tolerance(RESULT)
        .with_max_points(limits.max_points)
        .with_max_nodes(limits.max_nodes)
        .with_max_time(limits.max_time)
        .with_max_growth(1e8)
        .with_typical_sizes(units);
    let left = |points: usize| limits.max_points.saturating_sub(points);
    let mut points = 0;
    let end = pursue(map, x, &options, limits.max_branchings, &left, &mut |event| {
        points += 1;
        see(event.x()[last], points).is_break()
    })?;
    Some(LoweringEnd {
        x: end.x,
        points: end.points,
        interrupted: end.interrupted,
    })
}
