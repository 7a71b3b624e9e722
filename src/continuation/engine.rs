use std::collections::VecDeque;
use std::fmt;

use super::error::if_solved;
use super::event::watch::Departure;
use super::step::judge::Regularity;
use super::{ContinuationError, ContinuationOptions, Event, Point, PointKind, Termination};
use crate::clock::{Clock, Deadline};
use crate::linear::LinearSolver;
use crate::newton::MoorePenrose;
use crate::piecewise::{PiecewiseSmooth, Scaled, ScaledMap, Selection, TestLayout, Vanishing};
use crate::sparse::{Matrix, norm};
use crate::tolerances::ROUNDING;

/// |α̇| up to which ∇_yH counts as singular in the reported sign of its determinant.
pub(super) const SINGULAR: f64 = 1e-7;

/// A point of the curve, with its tangent, selection, signs and test functions.
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct State {
    pub(super) x: Vec<f64>,
    pub(super) t: Vec<f64>,
    pub(super) theta: Vec<f64>,
    /// Sign of det [∇H^(σ); tᵀ].
    pub(super) orientation: Option<i8>,
    pub(super) det_sign: Option<i8>,
    /// Sign of α̇ on the curve beyond this point: at a fold that of the arm which leaves it, where α̇ is its own rounding error that of the
    /// points before; 0 on vertical segments. `None` until it is needed.
    #[cfg_attr(feature = "serde", serde(default))]
    pub(super) heading: Option<i8>,
    /// Relative rate at which the regularity of ∇H^(σ) falls along the tangent: the inverse of the distance at which a
    /// singular point is to be expected. `None` at singular points.
    #[cfg_attr(feature = "serde", serde(default))]
    pub(super) decline: Option<f64>,
    /// A point of the curve beyond this one, known to be on this arm and no other, where first steps as long as any may end on another.
    #[cfg_attr(feature = "serde", serde(default))]
    pub(super) probe: Vec<f64>,
    pub(super) residual_norm: f64,
    /// Distance from the last state, along the tangent there.
    pub(super) s: f64,
}

impl State {
    /// Distance of x along the tangent.
    pub(super) fn progress_to(&self, x: &[f64]) -> f64 {
        let chord = x.iter().zip(&self.x).map(|(x, x0)| x - x0);
        self.t.iter().zip(chord).map(|(t, c)| t * c).sum()
    }
}

/// The solver of the corrector, of any type.
pub(super) type Solver<'a> = Box<dyn LinearSolver + Send + 'a>;

/// A function of x = (y, α) that threads may share.
pub(super) type Function<'a> = Box<dyn Fn(&[f64]) -> f64 + Send + Sync + 'a>;

/// Whether the curve is to end, as the user's function says.
pub(super) type Over<'a> = Box<dyn Fn() -> bool + Send + Sync + 'a>;

/// A function of x, and the side of its zero set on which the curve runs.
pub(super) struct Watch<'a> {
    pub(super) name: String,
    pub(super) function: Function<'a>,
    pub(super) stops: bool,
    /// Sign of the function before its next zero; 0 as long as it has vanished exactly. Kept apart from values, which are rounding
    /// errors at a zero that has just been passed.
    pub(super) side: f64,
    /// Whether the sign changes within the step at hand without a zero: at a pole or a jump.
    pub(super) jumped: bool,
}

impl Watch<'_> {
    pub(super) fn value(&self, x: &[f64]) -> f64 {
        (self.function)(x)
    }
}

/// A curve that is being followed. Computations are written for `Curve<'_>`, with the map behind a trait object, and compiled once. The
/// map is stored with its own type, so that a curve can be sent to another thread if its map can be shared; see [`erased`](Curve::erased).
pub(super) struct Curve<'a, M: ?Sized = dyn ScaledMap + 'a> {
    pub(super) options: ContinuationOptions,
    pub(super) layout: TestLayout,
    pub(super) corrector: MoorePenrose<Solver<'a>>,
    pub(super) selection: Selection,
    pub(super) here: State,
    pub(super) next: State,
    /// Test functions in whose zero set the curve runs.
    pub(super) grazing: Vec<Vanishing>,
    /// Selections co-active on a grazing curve, with their orientations at `here`, as far as known.
    pub(super) coactive: Vec<(Selection, Option<i8>)>,
    pub(super) arclength: f64,
    pub(super) h: f64,
    pub(super) size: f64,
    /// Size of the terms of H for affine pieces; for curved ones that of each row.
    pub(super) residual_scale: f64,
    pub(super) row_sizes: Vec<f64>,
    /// Curvature of the last steps: turn of the tangent over length, decaying where the curve straightens.
    pub(super) curvature: f64,
    pub(super) points: usize,
    pub(super) regularity: Regularity,
    /// Number of steps in a row that had to be shortened.
    pub(super) creeping: usize,
    pub(super) queue: VecDeque<Event>,
    pub(super) termination: Option<Termination>,
    /// Whether all arms are wanted at each event, as in a diagram, rather than the one along which the curve goes on.
    pub(super) every_arm: bool,
    pub(super) start: Vec<f64>,
    /// Started if time is limited.
    pub(super) clock: Option<Clock>,
    /// Whether the user wants the curve to end; also checked within a step.
    pub(super) over: Option<Over<'a>>,
    /// Factorisations and corrections before the state was last saved.
    pub(super) earlier: (usize, usize),
    /// Buffers.
    pub(super) rates: Vec<f64>,
    pub(super) departure: Departure,
    /// Norms of the gradients of test functions that are affine, as far as known.
    pub(super) gradient_norms: Vec<f64>,
    pub(super) next_sizes: Vec<f64>,
    pub(super) residual: Vec<f64>,
    /// Monitor functions, and their signs where a saved run ended.
    pub(super) watches: Vec<Watch<'a>>,
    pub(super) saved_sides: Vec<f64>,
    /// The map in scaled variables, in which everything here is computed; events are given in its own.
    pub(super) map: M,
}

impl<'a, M> Curve<'a, Scaled<M>> {
    /// The same curve with its map as another type.
    pub(super) fn with_map<N>(self, map: N) -> Curve<'a, Scaled<N>> {
        Curve {
            map: self.map.with_map(map),
            options: self.options,
            layout: self.layout,
            corrector: self.corrector,
            selection: self.selection,
            here: self.here,
            next: self.next,
            grazing: self.grazing,
            coactive: self.coactive,
            arclength: self.arclength,
            h: self.h,
            size: self.size,
            residual_scale: self.residual_scale,
            row_sizes: self.row_sizes,
            curvature: self.curvature,
            points: self.points,
            regularity: self.regularity,
            creeping: self.creeping,
            queue: self.queue,
            termination: self.termination,
            every_arm: self.every_arm,
            start: self.start,
            clock: self.clock,
            over: self.over,
            earlier: self.earlier,
            rates: self.rates,
            departure: self.departure,
            gradient_norms: self.gradient_norms,
            next_sizes: self.next_sizes,
            residual: self.residual,
            watches: self.watches,
            saved_sides: self.saved_sides,
        }
    }
}

impl<'a, P: PiecewiseSmooth + ?Sized> Curve<'a, Scaled<&'a P>> {
    /// The same curve, its map behind a trait object.
    pub(super) fn erased(&self) -> &Curve<'a> {
        self
    }

    /// The same curve, its map behind a trait object.
    pub(super) fn erased_mut(&mut self) -> &mut Curve<'a> {
        self
    }
}

impl<'a> Curve<'a> {
    /// Why the curve ended, once it has.
    pub(super) fn termination(&self) -> Option<Termination> {
        self.termination
    }

    /// The current point.
    pub(super) fn point(&self) -> Point {
        let mut point = self.point_here(PointKind::Step, 0);
        self.map.unscale_point(&mut point);
        point
    }

    /// Number of factorisations so far.
    pub(super) fn factorisations(&self) -> usize {
        (self.earlier.0).saturating_add(self.corrector.factorisations())
    }

    /// Number of factorisations saved so far by updates, where all pieces are affine.
    pub(super) fn updates(&self) -> usize {
        self.corrector.updates()
    }

    /// Number of correction steps so far.
    pub(super) fn corrections(&self) -> usize {
        (self.earlier.1).saturating_add(self.corrector.iterations())
    }

    /// Ends the curve; the iterator gives what is still in the queue and then nothing.
    pub(super) fn stop(&mut self) {
        self.termination.get_or_insert(Termination::Interrupted);
    }

    /// Sign of det [∇H^(σ)(x); tᵀ], `None` when it is singular or unknown.
    pub(super) fn orientation_of(
        &mut self,
        selection: &Selection,
        x: &[f64],
        t: &[f64],
    ) -> Result<Option<i8>, ContinuationError> {
        let at = if_solved(self.corrector.linearize(&self.map, selection, x, Some(t)))?;
        Ok(at.and_then(|at| at.orientation(t)))
    }

    /// The unit tangent of the followed selection at `here`; `None` where it is singular.
    pub(super) fn tangent_here(&mut self) -> Result<Option<Vec<f64>>, ContinuationError> {
        let at = (self.corrector).linearize(&self.map, &self.selection, &self.here.x, None);
        Ok(if_solved(at)?.map(|at| at.tangent().to_vec()))
    }

    pub(super) fn emit_start(&mut self) {
        let point = self.point_here(PointKind::Start, 0);
        self.emit(Event::Point(point));
    }

    pub(super) fn emit(&mut self, mut event: Event) {
        self.points = self.points.saturating_add(1);
        self.map.unscale_event(&mut event);
        self.queue.push_back(event);
    }

    pub(super) fn point_here(&self, kind: PointKind, corrections: usize) -> Point {
        let mut grazing: Vec<usize> = self.grazing.iter().map(|v| v.site).collect();
        grazing.sort_unstable();
        grazing.dedup();
        Point {
            x: self.here.x.clone(),
            tangent: self.here.t.clone(),
            selection: self.selection.clone(),
            grazing,
            arclength: self.arclength,
            residual_norm: self.here.residual_norm,
            det_sign: self.det_sign_here(),
            corrections,
            kind,
        }
    }

    /// The sign of det ∇_yH = sign det [∇H; tᵀ] · sign α̇; zero at folds and on vertical segments, where α̇ is the rounding error of an
    /// ill-conditioned kernel.
    pub(super) fn det_sign_here(&self) -> Option<i8> {
        let rate = self.here.t.last().copied().unwrap_or(0.0);
        match (self.here.heading, self.here.orientation) {
            (Some(heading), Some(orientation)) if rate != 0.0 => Some(heading * orientation),
            _ => self
                .here
                .det_sign
                .map(|s| if rate.abs() <= SINGULAR { 0 } else { s }),
        }
    }

    /// Deadline of searches for arms.
    pub(super) fn deadline<'s>(
        clock: Option<Clock>,
        options: &ContinuationOptions,
        over: Option<&'s Over<'_>>,
    ) -> Deadline<'s> {
        let deadline = match clock {
            Some(clock) => Deadline::of(clock, options.max_time),
            None => Deadline::after(None),
        };
        match over {
            Some(over) => deadline.or(over),
            None => deadline,
        }
    }

    /// The reason for which the curve has to end here, if there is one.
    pub(super) fn is_over(&self) -> Option<Termination> {
        if self.over.as_ref().is_some_and(|over| over()) {
            return Some(Termination::Interrupted);
        }
        Self::deadline(self.clock, &self.options, None)
            .is_over()
            .then_some(Termination::TimeLimit)
    }

    pub(super) fn limits(&mut self) {
        let over = self.is_over();
        let reason = if self.points >= self.options.max_points {
            Termination::PointLimit
        } else if self.arclength >= self.options.max_arclength {
            Termination::ArclengthLimit
        } else if norm(&self.here.x) > self.options.max_growth * self.size {
            Termination::Unbounded
        } else if let Some(over) = over {
            over
        } else {
            return;
        };
        self.termination = Some(reason);
    }
}

impl fmt::Debug for Curve<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut x = self.here.x.clone();
        self.map.unscale(&mut x);
        f.debug_struct("Continuation")
            .field("x", &x)
            .field("selection", &self.selection)
            .field("arclength", &(self.arclength * self.map.parameter_size()))
            .field("points", &self.points)
            .field("termination", &self.termination)
            .field("options", &self.options)
            .finish_non_exhaustive()
    }
}

/// Refuses a stored point that does not solve the equation of the map, up to this share of its terms: it is one of another map.
pub(super) fn belongs(
    map: &dyn PiecewiseSmooth,
    selection: &Selection,
    x: &[f64],
) -> Result<(), ContinuationError> {
    const FAR: f64 = 1e-5;
    let mut h = vec![0.0; map.num_residuals()];
    map.residual(selection, x, &mut h);
    let mut jac = Matrix::zeros(map.pattern());
    map.jacobian(selection, x, &mut jac);
    let residual = norm(&h);
    let ones = vec![1.0; x.len()];
    if residual <= FAR * term_size(&jac, x, 1.0 + norm(x), &ones) {
        return Ok(());
    }
    Err(ContinuationError::OtherMap {
        parameter: x.last().copied().unwrap_or(f64::NAN),
        residual,
    })
}

/// ‖ |J| (|x| + h |t|) ‖₂: the size of the terms that cancel in H.
pub(super) fn term_size(jac: &Matrix, x: &[f64], h: f64, t: &[f64]) -> f64 {
    let mut sums = vec![0.0; jac.nrows()];
    let sizes: Vec<f64> = x.iter().zip(t).map(|(x, t)| x.abs() + h * t.abs()).collect();
    jac.as_ref().add_term_sizes(&sizes, &mut sums);
    norm(&sums)
}

/// Raises `sizes` (padded with zeros) to the sizes of the terms that cancel in each row of H: the sum of |J_ij| (|x_j| + h |t_j|), and at
/// least a size for which `tolerance` times it corresponds to the rounding error of x as other rows measure x.
pub(super) fn row_sizes(
    jac: &Matrix,
    x: &[f64],
    (h, t): (f64, &[f64]),
    tolerance: f64,
    sizes: &mut Vec<f64>,
) {
    sizes.resize(jac.nrows(), 0.0);
    let lengths: Vec<f64> = x.iter().zip(t).map(|(x, t)| x.abs() + h * t.abs()).collect();
    let (mut terms, mut largest) = (vec![0.0; jac.nrows()], vec![0.0; jac.nrows()]);
    jac.as_ref().add_term_sizes(&lengths, &mut terms);
    jac.as_ref().raise_to_largest(&mut largest);
    let rows = || terms.iter().zip(&largest);
    let lengths = rows().filter(|r| *r.1 > 0.0).map(|r| r.0 / r.1);
    let least = ROUNDING / tolerance * lengths.fold(0.0, f64::max);
    for (size, (&terms, &largest)) in sizes.iter_mut().zip(rows()) {
        *size = size.max(terms).max(least * largest);
    }
}

/// The largest |r_i| relative to the size of its row.
pub(super) fn relative_residual(r: &[f64], sizes: &[f64]) -> f64 {
    (r.iter().zip(sizes)).fold(0.0, |a, (r, size)| {
        let share = r.abs() / (size + f64::MIN_POSITIVE);
        if share > a || share.is_nan() { share } else { a }
    })
}

#[cfg(test)]
mod tests {
    use super::term_size;
    use crate::continuation::testing::Plane;
    use crate::sparse::Matrix;

    /// ‖ |J| (|x| + h |t|) ‖ by hand, whatever the signs.
    #[test]
    fn sizes_of_terms_add_up() {
        let jac = Matrix::from_rows(&[[3.0, -1.0], [0.0, 2.0]]).unwrap();
        for (x, t) in [([1.0, 2.0], [0.5, -0.25]), ([-1.0, -2.0], [-0.5, 0.25])] {
            for (h, rows) in [(0.0, [5.0, 4.0]), (4.0, [12.0, 6.0])] {
                assert_eq!(term_size(&jac, &x, h, &t), f64::hypot(rows[0], rows[1]));
            }
        }
    }

    /// Where α̇ is rounding, so is the sign of det ∇_yH.
    #[test]
    fn determinants_vanish_on_vertical_segments() {
        let map = Plane::within(|y, a| [y - a, 1.0, -1.0], &[]);
        let mut run = map.curve(0.0, 0.0);
        let curve = run.curve.erased_mut();
        assert_eq!(curve.point().det_sign, Some(1));
        for rate in [1e-17, -1e-12, 0.0] {
            curve.here.t = vec![1.0, rate];
            curve.here.heading = Some(0);
            assert_eq!(curve.point().det_sign, Some(0));
        }
    }
}
