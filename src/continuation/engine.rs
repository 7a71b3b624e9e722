use std::collections::VecDeque;
use std::fmt;

use super::error::if_solved;
use super::event::monitor::Monitors;
use super::event::watch::Departure;
use super::step::judge::Regularity;
use super::{ContinuationError, ContinuationOptions, Event, Point, PointKind, Termination};
use crate::clock::{Clock, Deadline};
use crate::linear::LinearSolver;
use crate::newton::{Linearisation, MoorePenrose};
use crate::piecewise::{
    ActiveSet, Facet, PiecewiseSmooth, PiecewiseSmoothExt, Scaled, ScaledMap, Selection, TestLayout,
    Vanishing,
};
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
    /// The power of the distance with which the regularity grows on leaving a singular point, where that is known to be more than 1.
    #[cfg_attr(feature = "serde", serde(default))]
    pub(super) order: f64,
    /// A corrected point of the arm on which the curve leaves this one, told apart from all other arms there; empty where none was needed.
    /// The first step from a singular point ends there, as one of another length may end on another arm.
    #[cfg_attr(feature = "serde", serde(default))]
    pub(super) probe: Vec<f64>,
    pub(super) residual_norm: f64,
    /// Distance from the last state, along the tangent there.
    pub(super) s: f64,
}

impl State {
    /// The point at a distance along the tangent.
    pub(super) fn ahead(&self, s: f64) -> Vec<f64> {
        self.x.iter().zip(&self.t).map(|(x, t)| x + s * t).collect()
    }

    /// Makes this the point at a distance along the tangent at another state, with that tangent.
    pub(super) fn predict(&mut self, from: &Self, s: f64) {
        for (x, (x0, t)) in self.x.iter_mut().zip(from.x.iter().zip(&from.t)) {
            *x = x0 + s * t;
        }
        self.t.copy_from_slice(&from.t);
    }

    /// Takes the signs of determinants from a linearisation; `None` where ∇H is singular.
    pub(super) fn take_signs<L: LinearSolver>(&mut self, at: Option<&Linearisation<'_, L>>) {
        self.orientation = at.and_then(|at| at.orientation(&self.t));
        self.det_sign = at.and_then(|at| at.det_sign());
    }

    /// Leaves open what a singular ∇H does not tell.
    pub(super) fn forget_signs(&mut self) {
        (self.orientation, self.det_sign, self.decline) = (None, None, None);
    }

    /// Distance of x along the tangent.
    pub(super) fn progress_to(&self, x: &[f64]) -> f64 {
        let chord = x.iter().zip(&self.x).map(|(x, x0)| x - x0);
        self.t.iter().zip(chord).map(|(t, c)| t * c).sum()
    }

    /// Sets the values of the test functions.
    pub(super) fn find_tests(&mut self, map: &dyn ScaledMap, selection: &Selection) {
        map.tests_of_selection(selection, &self.x, None, &mut self.theta);
    }
}

/// The solver of the corrector, of any type.
pub(super) type Solver<'a> = Box<dyn LinearSolver + Send + 'a>;

/// Whether the curve is to end, as the user's function says.
pub(super) type Over<'a> = Box<dyn Fn() -> bool + Send + Sync + 'a>;

/// What is decided before the curve leaves its start, and written no more.
pub(super) struct Setup<'a> {
    pub(super) options: ContinuationOptions,
    pub(super) layout: TestLayout,
    /// Whether all arms are wanted at each event, as in a diagram, rather than the one along which the curve
    /// goes on.
    pub(super) every_arm: bool,
    pub(super) start: Vec<f64>,
    /// 1 + ‖x‖ at the start.
    pub(super) size: f64,
    /// Started if time is limited.
    pub(super) clock: Option<Clock>,
    /// Whether the user wants the curve to end; also checked within a step.
    pub(super) over: Option<Over<'a>>,
}

impl Setup<'_> {
    /// Deadline of searches for arms.
    pub(super) fn deadline(&self) -> Deadline<'_> {
        match &self.over {
            Some(over) => self.time_limit().or(over),
            None => self.time_limit(),
        }
    }

    fn time_limit(&self) -> Deadline<'_> {
        match self.clock {
            Some(clock) => Deadline::of(clock, self.options.max_time),
            None => Deadline::after(None),
        }
    }

    /// The reason of the user for which the curve has to end, if there is one.
    pub(super) fn is_over(&self) -> Option<Termination> {
        if self.over.as_ref().is_some_and(|over| over()) {
            return Some(Termination::Interrupted);
        }
        (self.time_limit().is_over()).then_some(Termination::TimeLimit)
    }
}

/// The piece on which the curve goes on.
#[derive(Default)]
pub(super) struct Path {
    pub(super) selection: Selection,
    /// Test functions in whose zero set the curve runs.
    pub(super) grazing: Vec<Vanishing>,
    /// Selections co-active on a grazing curve, with their orientations at the point, as far as known.
    pub(super) coactive: Vec<(Selection, Option<i8>)>,
}

/// How far the curve has come, and how fast it goes on.
#[derive(Default)]
pub(super) struct Pace {
    pub(super) arclength: f64,
    pub(super) h: f64,
    /// Curvature of the last steps: turn of the tangent over length, decaying where the curve straightens.
    pub(super) curvature: f64,
    /// Number of steps in a row that had to be shortened.
    pub(super) creeping: usize,
}

/// By what residuals and ∇H are measured: the size of the terms of H for affine pieces, for curved ones that
/// of each row.
pub(super) struct Scale {
    pub(super) terms: f64,
    pub(super) rows: Vec<f64>,
    pub(super) regularity: Regularity,
}

/// What is told of the curve.
#[derive(Default)]
pub(super) struct Told {
    pub(super) queue: VecDeque<Event>,
    pub(super) points: usize,
    /// Factorisations and corrections before the state was last saved.
    pub(super) earlier: (usize, usize),
    pub(super) termination: Option<Termination>,
}

#[derive(Default)]
pub(super) struct Buffers {
    pub(super) rates: Vec<f64>,
    pub(super) residual: Vec<f64>,
    /// Sizes of the terms of each row of H at the end of the step.
    pub(super) sizes: Vec<f64>,
    pub(super) departure: Departure,
    /// Norms of the gradients of test functions that are affine, as far as known.
    pub(super) gradient_norms: Vec<f64>,
}

/// A curve that is being followed. Computations are written for `Curve<'_>`, with the map behind a trait
/// object, and compiled once. The map is stored with its own type, so that a curve can be sent to another
/// thread if its map can be shared; see [`erased`](Curve::erased).
pub(super) struct Curve<'a, M: ?Sized = dyn ScaledMap + 'a> {
    pub(super) setup: Setup<'a>,
    pub(super) corrector: MoorePenrose<Solver<'a>>,
    pub(super) here: State,
    /// The end of the step that is being tried; once it has been made, its start.
    pub(super) next: State,
    pub(super) path: Path,
    pub(super) pace: Pace,
    pub(super) scale: Scale,
    pub(super) monitors: Monitors<'a>,
    pub(super) told: Told,
    pub(super) buffers: Buffers,
    /// The map in scaled variables, in which everything here is computed; events are given in its own.
    pub(super) map: M,
}

impl<'a, M> Curve<'a, Scaled<M>> {
    /// The same curve with its map as another type.
    pub(super) fn with_map<N>(self, map: N) -> Curve<'a, Scaled<N>> {
        Curve {
            map: self.map.with_map(map),
            setup: self.setup,
            corrector: self.corrector,
            here: self.here,
            next: self.next,
            path: self.path,
            pace: self.pace,
            scale: self.scale,
            monitors: self.monitors,
            told: self.told,
            buffers: self.buffers,
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
        self.told.termination
    }

    /// The current point.
    pub(super) fn point(&self) -> Point {
        let mut point = self.point_here(PointKind::Step, 0);
        self.map.unscale_point(&mut point);
        point
    }

    /// Number of factorisations so far.
    pub(super) fn factorisations(&self) -> usize {
        (self.told.earlier.0).saturating_add(self.corrector.factorisations())
    }

    /// Number of factorisations saved so far by updates, where all pieces are affine.
    pub(super) fn updates(&self) -> usize {
        self.corrector.updates()
    }

    /// Number of correction steps so far.
    pub(super) fn corrections(&self) -> usize {
        (self.told.earlier.1).saturating_add(self.corrector.iterations())
    }

    /// Ends the curve; the iterator gives what is still in the queue and then nothing.
    pub(super) fn stop(&mut self) {
        self.told.termination.get_or_insert(Termination::Interrupted);
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
        let at = (self.corrector).linearize(&self.map, &self.path.selection, &self.here.x, None);
        Ok(if_solved(at)?.map(|at| at.tangent().to_vec()))
    }

    /// Facets of the cell that is followed, each with the position of its test function among all.
    pub(super) fn facets(&self) -> impl Iterator<Item = (usize, Facet)> + '_ {
        let layout = &self.setup.layout;
        (0..layout.num_sites()).flat_map(move |site| {
            let first = layout.range(site).start;
            let cell = self.map.cell(site, self.path.selection.piece(site));
            cell.iter().map(move |facet| (first + facet.test(), *facet))
        })
    }

    pub(super) fn is_grazing(&self, index: usize) -> bool {
        self.path.grazing.iter().any(|v| v.index == index)
    }

    /// A test function at `here`.
    pub(super) fn test_here(&self, index: usize) -> Vanishing {
        let (layout, selection) = (&self.setup.layout, &self.path.selection);
        Vanishing::new(&self.map, layout, selection, index, &self.here.x)
    }

    /// Rates of the test functions along the tangent at a state.
    pub(super) fn rates_at(&self, state: &State) -> Vec<f64> {
        let mut rates = vec![0.0; self.setup.layout.total()];
        let (selection, t) = (&self.path.selection, Some(&state.t[..]));
        self.map.tests_of_selection(selection, &state.x, t, &mut rates);
        rates
    }

    /// The selections that meet at `here`, where these test functions vanish, by the side on which the curve
    /// arrived.
    pub(super) fn active_beside(&self, vanishing: &[Vanishing]) -> ActiveSet {
        let indices = vanishing.iter().map(|v| v.index).collect();
        let (layout, selection) = (&self.setup.layout, &self.path.selection);
        ActiveSet::beside(&self.map, layout, &self.here.theta, indices, selection)
    }

    pub(super) fn emit_start(&mut self) {
        let point = self.point_here(PointKind::Start, 0);
        self.emit(Event::Point(point));
    }

    pub(super) fn emit(&mut self, mut event: Event) {
        self.told.points = self.told.points.saturating_add(1);
        self.map.unscale_event(&mut event);
        self.told.queue.push_back(event);
    }

    pub(super) fn point_here(&self, kind: PointKind, corrections: usize) -> Point {
        let mut grazing: Vec<usize> = self.path.grazing.iter().map(|v| v.site).collect();
        grazing.sort_unstable();
        grazing.dedup();
        Point {
            x: self.here.x.clone(),
            tangent: self.here.t.clone(),
            selection: self.path.selection.clone(),
            grazing,
            arclength: self.pace.arclength,
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

    pub(super) fn limits(&mut self) {
        let over = self.setup.is_over();
        let reason = if self.told.points >= self.setup.options.max_points {
            Termination::PointLimit
        } else if self.pace.arclength >= self.setup.options.max_arclength {
            Termination::ArclengthLimit
        } else if norm(&self.here.x) > self.setup.options.max_growth * self.setup.size {
            Termination::Unbounded
        } else if let Some(over) = over {
            over
        } else {
            return;
        };
        self.told.termination = Some(reason);
    }
}

impl fmt::Debug for Curve<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut x = self.here.x.clone();
        self.map.unscale(&mut x);
        f.debug_struct("Continuation")
            .field("x", &x)
            .field("selection", &self.path.selection)
            .field("arclength", &(self.pace.arclength * self.map.parameter_size()))
            .field("points", &self.told.points)
            .field("termination", &self.told.termination)
            .field("options", &self.setup.options)
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
