//! The first point and the first direction of a curve, from the user's start.

use super::engine::{Buffers, Curve, Pace, Path, Scale, Setup, Solver, State, Told, term_size};
use super::error::{if_converged, if_solved};
use super::event::monitor::Monitors;
use super::point::{Arms, PointDoubt};
use super::step::judge::Regularity;
use super::{Arm, Continuation, ContinuationError, ContinuationOptions, Strategy};
use crate::InputError;
use crate::clock::Clock;
use crate::input::check_options;
use crate::input::{check_finite, check_vector};
use crate::linear::{AutoSolver, LinearSolver};
use crate::newton::{MoorePenrose, Newton, NewtonOptions};
use crate::piecewise::{
    ActiveSet, PiecewiseError, PiecewiseSmooth, Scaled, ScaledMap, Selection, TestLayout, Vanishing, select,
};
use crate::sparse::{Matrix, distance};
use crate::sparse::{dot, norm};
use crate::tolerances::{CHECKED, HALF_DIGITS, RESULT, ROUNDING, SAME};

/// The direction in which to leave the start.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Direction {
    /// With increasing α.
    Increasing,
    /// With decreasing α.
    Decreasing,
    /// Along the arm nearest to the given vector (length n + 1), which must not be orthogonal to it.
    Along(Vec<f64>),
}

/// The start, moved onto the bound of its parameter where rounding put it beyond; starts further outside are refused.
pub(super) fn inside(x: &[f64], (lower, upper): (f64, f64)) -> Result<Vec<f64>, ContinuationError> {
    let mut inside = x.to_vec();
    if let Some(alpha) = inside.last_mut() {
        let value = *alpha;
        *alpha = value.max(lower).min(upper);
        let fine = (value - *alpha).abs() <= CHECKED * (1.0 + value.abs());
        check_options(&[("start", value, fine, "inside the range of the parameter")])?;
    }
    Ok(inside)
}

/// Whether every row of H = `r` is small against its own terms: the norm sees only those in the largest units.
fn rows_vanish(jac: &Matrix, x: &[f64], r: &[f64]) -> bool {
    let mut terms = vec![0.0; r.len()];
    let length = norm(x);
    for (i, j, v) in jac.triplets() {
        terms[i] += v.abs() * (SAME * x[j].abs()).max(RESULT * length);
    }
    r.iter().zip(terms).all(|(r, terms)| r.abs() <= terms)
}

/// Whether rows of the Jacobian `jac` at x vanish relative to those a `step` away and H = `r` does, too: at a branch point H has no other
/// scale, and Newton's method would move x along or off the curve.
fn is_branch_point(
    map: &dyn PiecewiseSmooth,
    selection: &Selection,
    (jac, x, r): (&Matrix, &[f64], &[f64]),
    step: f64,
) -> bool {
    let away: Vec<f64> = x.iter().map(|v| v + step).collect();
    let mut there = Matrix::zeros(map.pattern());
    map.jacobian(selection, &away, &mut there);
    let mut sums = vec![(0.0, 0.0, 0.0); r.len()];
    for ((i, j, near), (_, _, far)) in jac.triplets().zip(there.triplets()) {
        sums[i].0 += near.abs();
        sums[i].1 += far.abs();
        sums[i].2 += near.abs().max(far.abs()) * away[j].abs().max(step);
    }
    let singular = sums.iter().any(|s| s.0 <= HALF_DIGITS * s.1);
    singular && r.iter().zip(&sums).all(|(r, s)| r.abs() <= 0.1 * RESULT * s.2)
}

/// Solves at fixed α unless x is a solution already.
pub(super) fn onto_curve(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    options: &ContinuationOptions,
) -> Result<Vec<f64>, ContinuationError> {
    let mut x = x.to_vec();
    let selection = select(map, &x);
    let mut r = vec![0.0; map.num_residuals()];
    map.residual(&selection, &x, &mut r);
    let mut jac = Matrix::zeros(map.pattern());
    map.jacobian(&selection, &x, &mut jac);
    if let Some((row, col)) = jac.stray() {
        return Err(PiecewiseError::StrayEntry { row, col }.into());
    }
    let size = term_size(&jac, &x, 0.0, &x);
    let tolerance = match options.strategy {
        Strategy::Located => 1e-13 * size,
        Strategy::Switching => options.residual_tolerance,
    };
    if norm(&r) <= tolerance && rows_vanish(&jac, &x, &r) {
        return Ok(x);
    }
    if options.strategy == Strategy::Located && is_branch_point(map, &selection, (&jac, &x, &r), options.step)
    {
        return Ok(x);
    }
    let given = x.clone();
    let mut newton = Newton::new(NewtonOptions::default()).in_own_scale();
    let solved = newton.solve(map, &mut x);
    match solved {
        Ok(_) => Ok(x),
        // At folds and on vertical segments ∇_yH is singular: a start accurate to the tolerance is used unchanged.
        Err(_) if norm(&r) <= options.residual_tolerance * size => Ok(given),
        Err(e) => Err(e.into()),
    }
}

fn choose_start<'b>(arms: &'b Arms, direction: &Direction) -> Result<&'b Arm, ContinuationError> {
    let rate = |a: &Arm| a.tangent.last().copied().unwrap_or(0.0);
    let (found, wanted) = match direction {
        Direction::Increasing => (
            arms.list.iter().find(|a| rate(a) > CHECKED),
            "increasing parameter",
        ),
        Direction::Decreasing => (
            arms.list.iter().find(|a| rate(a) < -CHECKED),
            "decreasing parameter",
        ),
        Direction::Along(v) => {
            let length = norm(v);
            let unit: Vec<f64> = v.iter().map(|c| c / length).collect();
            let nearest = arms
                .list
                .iter()
                .min_by(|a, b| distance(&a.tangent, &unit).total_cmp(&distance(&b.tangent, &unit)));
            let ahead = nearest.filter(|a| dot(&a.tangent, &unit) > 0.0);
            (ahead, "a positive component along the given vector")
        }
    };
    found.ok_or_else(|| no_arm(arms, wanted))
}

fn no_arm(arms: &Arms, wanted: &'static str) -> ContinuationError {
    let found = arms.list.len();
    if arms.complete {
        return ContinuationError::NoArm { wanted, found };
    }
    let (kernel, variables, reason) = match &arms.undecided {
        Some(doubt @ PointDoubt::Kernel { dimension, variables }) => (
            *dimension,
            variables.clone(),
            format!(
                "{doubt}, to rounding. There the solutions at this parameter are not unique, or rows of H depend on each other: choose among \
                 them by a small regularisation (ε x_j added to the rows of these variables), or drop unknowns that do not matter. Or units of \
                 the unknowns lie so far apart that rounding hides what is regular: give `typical_sizes`"
            ),
        ),
        Some(doubt) if *doubt != PointDoubt::Budget => (0, Vec::new(), format!("{doubt}; start elsewhere")),
        _ => (
            0,
            Vec::new(),
            "a limit ended the search (a stop, max_time, max_nodes, max_selections, or a kernel of more than 600 rows): raise it, or start \
             elsewhere"
                .to_owned(),
        ),
    };
    ContinuationError::UndecidedArms {
        wanted,
        found,
        kernel,
        variables,
        reason,
    }
}

impl<'a, P: PiecewiseSmooth + ?Sized> Continuation<'a, P> {
    /// Starts at `x` = (y, α), which is corrected onto the curve at its α if need be, in the given direction.
    ///
    /// # Errors
    /// Options out of range, maps that are no curves, starts of the wrong length or not finite, outside the domain, or from which
    /// Newton's method finds no solution; [`ContinuationError::NoArm`] when no arm leaves in the direction,
    /// [`ContinuationError::UndecidedArms`] when none was found and the search was not complete.
    pub fn new(
        map: &'a P,
        x: &[f64],
        direction: Direction,
        options: ContinuationOptions,
    ) -> Result<Self, ContinuationError> {
        Self::with_solver(map, x, direction, options, solver())
    }

    /// [`new`](Self::new), and the curve ends once `over` returns true: it is called wherever [`max_time`](ContinuationOptions::max_time)
    /// is checked, also in searches for arms, which may take far longer than a step. Such a curve is
    /// [`Interrupted`](super::Termination::Interrupted).
    ///
    /// # Errors
    /// As [`new`](Self::new); [`ContinuationError::UndecidedArms`] where `over` returns true before an arm was found.
    pub fn new_until(
        map: &'a P,
        x: &[f64],
        direction: Direction,
        options: ContinuationOptions,
        over: impl Fn() -> bool + Send + Sync + 'a,
    ) -> Result<Self, ContinuationError> {
        let mut curve = Curve::prepare(map, x, options, Box::new(solver()))?;
        let own = curve.erased_mut();
        own.setup.over = Some(Box::new(over));
        own.leave_towards(direction)?;
        Ok(Self::of(curve))
    }

    /// Starts at `x` along a given arm (of a transition or branch point, or from [`arms_at`](crate::continuation::arms_at)).
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn along_arm(
        map: &'a P,
        x: &[f64],
        arm: &Arm,
        options: ContinuationOptions,
    ) -> Result<Self, ContinuationError> {
        let mut curve = Curve::prepare(map, x, options, Box::new(solver()))?;
        curve.erased_mut().leave_along(arm)?;
        Ok(Self::of(curve))
    }
}

impl<'a, P: PiecewiseSmooth + ?Sized, L: LinearSolver + Send + 'a> Continuation<'a, P, L> {
    /// [`new`](Continuation::new) with a linear solver of your own. Branch points inside curved pieces are detected by the sign of a
    /// determinant: not at all with a solver whose [`log_det`](LinearSolver::log_det) is `None`, as that of [`AutoSolver::new`] may be for
    /// large systems.
    ///
    /// # Errors
    /// As [`new`](Continuation::new).
    pub fn with_solver(
        map: &'a P,
        x: &[f64],
        direction: Direction,
        options: ContinuationOptions,
        solver: L,
    ) -> Result<Self, ContinuationError> {
        let mut curve = Curve::prepare(map, x, options, Box::new(solver))?;
        curve.erased_mut().leave_towards(direction)?;
        Ok(Self::of(curve))
    }
}

/// Starts of any type as slices.
pub(super) fn slices<S: AsRef<[f64]>>(starts: &[S]) -> Vec<&[f64]> {
    starts.iter().map(AsRef::as_ref).collect()
}

/// The crate's own solver for curves, with determinants at any size: without them a point has no orientation, by which singular points
/// are recognised, and rows of a selection cannot be replaced in the stored factors.
pub(super) fn solver() -> AutoSolver {
    AutoSolver::with_determinants()
}

impl<'a> Curve<'a> {
    fn leave_towards(&mut self, mut direction: Direction) -> Result<(), ContinuationError> {
        if let Direction::Along(v) = &mut direction {
            check_vector("the direction", v, self.map.num_vars())?;
            self.map.scale_direction(v);
        }
        let vanishing = self.met_here()?;
        let rate = match &direction {
            Direction::Increasing => Some(1.0),
            Direction::Decreasing => Some(-1.0),
            Direction::Along(_) => None,
        };
        let mut arms = self.arms_with(&vanishing, rate)?;
        let found = |curve: &Self, arms: &Arms| {
            vanishing.is_empty() || choose_start(arms, &direction).is_ok_and(|arm| curve.is_tangent(arm))
        };
        if let Some(rate) = rate
            && !found(self, &arms)
        {
            if let Some((arm, beside)) = self.arm_beside(rate, &arms)? {
                return self.leave_from_beside(&arm, beside);
            }
            arms = self.all_arms(&vanishing)?;
        }
        let arm = choose_start(&arms, &direction)?;
        self.adopt(arm, &vanishing)?;
        self.doubt_orientation(arm)?;
        self.emit_start();
        Ok(())
    }

    fn leave_along(&mut self, arm: &Arm) -> Result<(), ContinuationError> {
        check_vector("the tangent of the arm", &arm.tangent, self.map.num_vars())?;
        if arm.selection.len() != self.map.num_sites() {
            return Err(PiecewiseError::Input(InputError::Length {
                what: "the selection of the arm",
                expected: self.map.num_sites(),
                found: arm.selection.len(),
            })
            .into());
        }
        let mut arm = arm.clone();
        self.map.scale_direction(&mut arm.tangent);
        self.map.scale(&mut arm.probe);
        let vanishing = self.vanishing_here(&[]);
        self.adopt(&arm, &vanishing)?;
        self.doubt_orientation(&arm)?;
        self.emit_start();
        Ok(())
    }

    /// The vanishing test functions at a start. One that does not vanish to rounding counts only if a curve across its facet passes as
    /// near: with directions of very different stiffness it may be far away.
    pub(super) fn met_here(&mut self) -> Result<Vec<Vanishing>, ContinuationError> {
        let found = self.vanishing_here(&[]);
        let mut met = Vec::with_capacity(found.len());
        for v in found {
            let rounding = ROUNDING * v.gradient_norm * (1.0 + norm(&self.here.x));
            if self.here.theta[v.index].abs() <= rounding || self.passes_across(&v)? {
                met.push(v);
            }
        }
        Ok(met)
    }

    fn passes_across(&mut self, v: &Vanishing) -> Result<bool, ContinuationError> {
        const NEAR: f64 = 10.0;
        let x = self.here.x.clone();
        let reach = NEAR * self.setup.options.vanishing_distance * (1.0 + norm(&x));
        let active = ActiveSet::from_tests(&self.map, &self.setup.layout, &self.here.theta, vec![v.index]);
        for selection in active.selections().filter(|s| *s != self.path.selection) {
            let at = if_solved(self.corrector.linearize(&self.map, &selection, &x, None))?;
            let Some(tangent) = at.map(|at| at.tangent().to_vec()) else {
                return Ok(true);
            };
            let (mut y, mut t) = (x.clone(), tangent.clone());
            let corrected =
                self.corrector
                    .correct_in_plane(&self.map, &selection, (&x, &tangent, 0.0), &mut y, &mut t);
            if if_converged(corrected)?.is_none() || distance(&x, &y) <= reach {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// A corrector with the crate's own solver.
pub(super) fn auto_corrector<'a>(
    map: &dyn PiecewiseSmooth,
) -> Result<MoorePenrose<Solver<'a>>, PiecewiseError> {
    MoorePenrose::new(map, Box::new(solver()) as Solver<'_>)
}

/// A corrector, and the point of the curve at the α of the start.
fn corrected_start<'a>(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    options: &ContinuationOptions,
    solver: Solver<'a>,
) -> Result<(MoorePenrose<Solver<'a>>, Vec<f64>), ContinuationError> {
    let corrector = MoorePenrose::new(map, solver)?;
    check_vector("the start x", x, map.num_vars())?;
    let z = onto_curve(map, &inside(x, options.parameter_range)?, options)?;
    Ok((corrector, z))
}

/// A curve from x, corrected onto it. Here and below the map is a trait object, so that this is compiled once.
fn prepared<'a, 'b>(
    map: &'b dyn PiecewiseSmooth,
    x: &[f64],
    options: ContinuationOptions,
    solver: Solver<'a>,
) -> Result<Curve<'a, Scaled<&'b dyn PiecewiseSmooth>>, ContinuationError> {
    options.validate()?;
    let scaled = Scaled::new(map, &options.typical_sizes, options.parameter_range)?;
    let (corrector, mut z) = corrected_start(map, x, &options, solver)?;
    scaled.scale(&mut z);
    prepare_at(scaled, z, options, corrector)
}

/// A curve from x, which lies on it.
pub(super) fn prepared_on<'a, 'b>(
    map: &'b dyn PiecewiseSmooth,
    x: &[f64],
    options: ContinuationOptions,
) -> Result<Curve<'a, Scaled<&'b dyn PiecewiseSmooth>>, ContinuationError> {
    let scaled = Scaled::new(map, &options.typical_sizes, options.parameter_range)?;
    let corrector = auto_corrector(map)?;
    let mut z = x.to_vec();
    scaled.scale(&mut z);
    prepare_at(scaled, z, options, corrector)
}

/// At a point z in scaled variables; options are in those of the map.
pub(super) fn prepare_at<'a, 'b>(
    map: Scaled<&'b dyn PiecewiseSmooth>,
    x: Vec<f64>,
    mut options: ContinuationOptions,
    corrector: MoorePenrose<Solver<'a>>,
) -> Result<Curve<'a, Scaled<&'b dyn PiecewiseSmooth>>, ContinuationError> {
    (&map as &dyn ScaledMap).scale_options(&mut options);
    let layout = TestLayout::new(&map);
    let mut theta = vec![0.0; layout.total()];
    map.test_functions(&x, &mut theta);
    check_finite("the vector of test functions at the start", &theta)?;
    let (n, t) = (map.num_residuals(), vec![0.0; x.len()]);
    let here = State {
        x: x.clone(),
        t,
        theta,
        ..State::default()
    };
    Ok(Curve {
        path: Path {
            selection: select(&map, &x),
            ..Path::default()
        },
        pace: Pace {
            h: options.step.min(options.max_step),
            ..Pace::default()
        },
        scale: Scale {
            terms: 0.0,
            rows: Vec::new(),
            regularity: Regularity::new(n),
        },
        setup: Setup {
            layout,
            every_arm: false,
            size: 1.0 + norm(&x),
            start: x.clone(),
            clock: options.max_time.map(|_| Clock::start()),
            over: None,
            options,
        },
        here: here.clone(),
        next: here,
        corrector,
        monitors: Monitors::default(),
        told: Told::default(),
        buffers: Buffers {
            residual: vec![0.0; n],
            ..Buffers::default()
        },
        map,
    })
}

impl<'a, P: PiecewiseSmooth + ?Sized> Curve<'a, Scaled<&'a P>> {
    pub(super) fn prepare(
        map: &'a P,
        x: &[f64],
        options: ContinuationOptions,
        solver: Solver<'a>,
    ) -> Result<Self, ContinuationError> {
        Ok(prepared(&map, x, options, solver)?.with_map(map))
    }

    /// [`along_arm`](Continuation::along_arm) from a point known to lie on the curve. It is not corrected: at a fold or branch point
    /// Newton's method at fixed α may end on another branch. At a `singular` point signs of determinants are rounding noise. The options are
    /// those of a diagram, known to be valid.
    pub(super) fn along_arm_from(
        map: &'a P,
        x: &[f64],
        arm: &Arm,
        singular: bool,
        options: ContinuationOptions,
    ) -> Result<Self, ContinuationError> {
        let mut this = prepared_on(&map, x, options)?.with_map(map);
        this.setup.every_arm = true;
        this.erased_mut().leave_along(arm)?;
        if singular && arm.probe.is_empty() {
            this.here.forget_signs();
        }
        Ok(this)
    }
}

#[cfg(test)]
mod tests {
    use super::onto_curve;
    use crate::continuation::ContinuationOptions;
    use crate::continuation::testing::Plane;
    use crate::piecewise::MinMap;

    /// 1e12 (y₁ − α) = 0 hides that 1e-6 (y₂ − 2 α) is not: each row is judged by itself.
    #[test]
    fn a_row_in_small_units_is_solved() {
        let rows = |x: &[f64], out: &mut [f64]| {
            (out[0], out[1]) = (1e12 * (x[0] - x[2]), 1e-6 * (x[1] - 2.0 * x[2]))
        };
        let map = MinMap::curve(2, move |x: &[f64], a: &mut [f64], b: &mut [f64]| {
            rows(x, a);
            b.fill(1e20);
        });
        let x = onto_curve(&map, &[1.0, 1.0, 1.0], &ContinuationOptions::default()).unwrap();
        assert!((x[0] - 1.0).abs() < 1e-9 && (x[1] - 2.0).abs() < 1e-9, "{x:?}");
    }

    /// At a branch point there is nothing to correct: ∇H vanishes, and H is its rounding error.
    #[test]
    fn a_start_at_a_branch_point_stays() {
        let map = Plane::within(
            |y, a| {
                let v = a - 1.0 / 7.0;
                [
                    y * y - 2.0 / 3.0 * y + 1.0 / 9.0 - v * v,
                    2.0 * y - 2.0 / 3.0,
                    -2.0 * v,
                ]
            },
            &[],
        );
        for last in [0, 1, 2, 3] {
            let y = f64::from_bits((1.0_f64 / 3.0).to_bits() + last);
            let x = onto_curve(&map, &[y, 1.0 / 7.0], &ContinuationOptions::default()).unwrap();
            assert_eq!(x, [y, 1.0 / 7.0]);
        }
    }
}
