//! The state of a run as data.

use std::fmt::{self, Write};
use std::time::Duration;

use super::engine::{Curve, State, belongs};
use super::error::if_solved;
use super::start::{auto_corrector, prepare_at};
use super::{Continuation, ContinuationError, ContinuationOptions, Event, Termination};
use crate::clock::Clock;
use crate::input::{check_length, check_vector};
use crate::piecewise::{PiecewiseSmooth, Scaled, Selection, TestLayout, Vanishing, check_selection};

/// The state of a [`Continuation`] between two events: point, tangent, selection, step size, options, counters, events not yet
/// returned. With the `serde` feature it can be written and read in any format.
///
/// A resumed run continues bit for bit like the run that was saved. Formats must keep every bit of an `f64`: for
/// `serde_json` that is its feature `float_roundtrip` (on with this crate's `json`).
///
/// ```
/// use semismooth::continuation::{Continuation, ContinuationOptions, Direction};
/// use semismooth::piecewise::MinMap;
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[1] - x[0] * x[0];
///     b[0] = x[1] + x[0];
/// });
/// let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
/// let mut curve = Continuation::new(&map, &[0.5, 0.25], Direction::Decreasing, options)?;
/// curve.by_ref().take(3).for_each(drop);
/// let saved = curve.save()?;
/// let resumed: Vec<_> = Continuation::resume(&map, &saved)?.collect();
/// assert_eq!(resumed, curve.collect::<Vec<_>>());
/// # Ok::<(), semismooth::continuation::ContinuationError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SavedRun {
    /// Numbers of residuals and sites of the map.
    residuals: usize,
    sites: usize,
    options: ContinuationOptions,
    selection: Selection,
    here: State,
    grazing: Vec<Vanishing>,
    coactive: Vec<(Selection, Option<i8>)>,
    arclength: f64,
    step: f64,
    size: f64,
    residual_scale: f64,
    row_sizes: Vec<f64>,
    curvature: f64,
    /// The vector by which the regularity of ∇H is measured; empty for a generic vector.
    probe: Vec<f64>,
    points: usize,
    creeping: usize,
    queue: Vec<Event>,
    termination: Option<Termination>,
    start: Vec<f64>,
    elapsed: Option<Duration>,
    factorisations: usize,
    corrections: usize,
    /// Signs of the monitor functions.
    sides: Vec<f64>,
    /// Typical sizes by which points, tangents and lengths are divided; none for no scaling.
    sizes: Vec<f64>,
    /// The point in the variables of the map.
    x: Vec<f64>,
    /// Of all other values but the options: a state that was altered, or saved by another version, is refused.
    checksum: u32,
}

impl SavedRun {
    /// The point x = (y, α).
    #[must_use]
    pub fn x(&self) -> &[f64] {
        &self.x
    }

    /// The parameter α.
    #[must_use]
    pub fn parameter(&self) -> f64 {
        self.x.last().copied().unwrap_or(f64::NAN)
    }

    /// Arclength from the start.
    #[must_use]
    pub fn arclength(&self) -> f64 {
        self.arclength * self.sizes.last().copied().unwrap_or(1.0)
    }

    /// Number of points computed so far.
    #[must_use]
    pub fn points(&self) -> usize {
        self.points
    }

    /// The options. They may be changed before the run is resumed, to raise a limit for example.
    pub fn options_mut(&mut self) -> &mut ContinuationOptions {
        &mut self.options
    }

    /// Clears the termination, so that the run continues once the limit that ended it is raised. No effect on curves that are at
    /// their end (end of a branch, branching, closed).
    #[must_use]
    pub fn reopened(mut self) -> Self {
        use Termination::{Branching, Closed, End};
        if !matches!(self.termination, Some(Branching | Closed | End)) {
            let intact = self.checksum == self.checksum();
            self.termination = None;
            if intact {
                self.checksum = self.checksum();
            }
        }
        self
    }

    /// FNV-1a over the values as `Debug` prints them, floating-point numbers with all digits.
    fn checksum(&self) -> u32 {
        struct Sum(u32);
        impl fmt::Write for Sum {
            fn write_str(&mut self, s: &str) -> fmt::Result {
                self.0 = (s.bytes()).fold(self.0, |h, b| (h ^ u32::from(b)).wrapping_mul(0x0100_0193));
                Ok(())
            }
        }
        let mut state = self.clone();
        (state.options, state.checksum) = (ContinuationOptions::default(), 0);
        let mut sum = Sum(0x811c_9dc5);
        // Writing there cannot fail.
        let _ = write!(sum, "{state:?}");
        sum.0
    }

    /// Checks that the state is as it was saved, and that its lists are as long as those of the map.
    fn check(&self, map: &dyn PiecewiseSmooth) -> Result<(), ContinuationError> {
        if self.checksum != self.checksum() {
            return Err(ContinuationError::Saved);
        }
        let layout = TestLayout::new(map);
        let (residuals, sites) = (map.num_residuals(), map.num_sites());
        check_length("the residual of the saved run", self.residuals, residuals)?;
        check_length("the list of sites of the saved run", self.sites, sites)?;
        let m = map.num_vars();
        check_vector("the saved point", &self.here.x, m)?;
        check_vector("the saved point", &self.x, m)?;
        check_vector("the saved tangent", &self.here.t, m)?;
        check_vector("the saved start", &self.start, m)?;
        check_vector("the saved test functions", &self.here.theta, layout.total())?;
        let located = |v: &Vanishing| layout.locate(v.index) == (v.site, v.test);
        if !self.grazing.iter().all(located) {
            return Err(ContinuationError::Saved);
        }
        let selections = std::iter::once(&self.selection).chain(self.coactive.iter().map(|c| &c.0));
        for selection in selections {
            check_selection("a saved selection", selection, map)?;
        }
        Ok(())
    }
}

impl<'a, P: PiecewiseSmooth + ?Sized> Continuation<'a, P> {
    /// The state of the run, after the events returned so far.
    ///
    /// Stored factorisations are dropped and recomputed, so that this run and one resumed from the state agree to the
    /// last bit; one that is never saved may differ in the last digits where pieces are affine.
    ///
    /// # Errors
    /// Those of the linear solver.
    pub fn save(&mut self) -> Result<SavedRun, ContinuationError> {
        self.curve.erased_mut().save()
    }

    /// Continues from a saved state, bit for bit like the run that was saved. The map must be the same; monitor functions
    /// must be added again, in the same order.
    ///
    /// # Errors
    /// States that do not fit the map, options out of range; [`ContinuationError::Saved`] for a state that was altered,
    /// [`ContinuationError::OtherMap`] for one whose point is not on the curve of the map.
    pub fn resume(map: &'a P, saved: &SavedRun) -> Result<Self, ContinuationError> {
        let mut curve = prepared(&map, saved)?.with_map(map);
        curve.erased_mut().restore(saved)?;
        Ok(Self::of(curve))
    }
}

/// Compiled once for all maps.
fn prepared<'a, 'b>(
    map: &'b dyn PiecewiseSmooth,
    saved: &SavedRun,
) -> Result<Curve<'a, Scaled<&'b dyn PiecewiseSmooth>>, ContinuationError> {
    saved.check(map)?;
    saved.options.validate()?;
    let corrector = auto_corrector(map)?;
    let scaled = Scaled::with_divisors(map, saved.sizes.clone())?;
    prepare_at(scaled, saved.here.x.clone(), saved.options.clone(), corrector)
}

impl Curve<'_> {
    fn save(&mut self) -> Result<SavedRun, ContinuationError> {
        self.told.earlier = (self.factorisations(), self.corrections());
        self.corrector = auto_corrector(&&self.map)?;
        self.renew_factors()?;
        let mut options = self.setup.options.clone();
        self.map.unscale_options(&mut options);
        let mut saved = SavedRun {
            residuals: self.map.num_residuals(),
            sites: self.map.num_sites(),
            options,
            selection: self.path.selection.clone(),
            here: self.here.clone(),
            grazing: self.path.grazing.clone(),
            coactive: self.path.coactive.clone(),
            arclength: self.pace.arclength,
            step: self.pace.h,
            size: self.setup.size,
            residual_scale: self.scale.terms,
            row_sizes: self.scale.rows.clone(),
            curvature: self.pace.curvature,
            probe: self.scale.regularity.probe.clone(),
            points: self.told.points,
            creeping: self.pace.creeping,
            queue: self.told.queue.iter().cloned().collect(),
            termination: self.told.termination,
            start: self.setup.start.clone(),
            elapsed: self.setup.clock.map(|c| c.elapsed()),
            factorisations: self.told.earlier.0,
            corrections: self.told.earlier.1,
            sides: self.monitors.watches.iter().map(|w| w.side).collect(),
            sizes: self.map.divisors().to_vec(),
            x: self.point().x,
            checksum: 0,
        };
        saved.checksum = saved.checksum();
        Ok(saved)
    }

    fn restore(&mut self, saved: &SavedRun) -> Result<(), ContinuationError> {
        self.path.selection = saved.selection.clone();
        self.here = saved.here.clone();
        self.next = saved.here.clone();
        self.path.grazing.clone_from(&saved.grazing);
        self.path.coactive.clone_from(&saved.coactive);
        self.pace.arclength = saved.arclength;
        self.pace.h = saved.step;
        self.setup.size = saved.size;
        self.scale.terms = saved.residual_scale;
        self.scale.rows.clone_from(&saved.row_sizes);
        self.pace.curvature = saved.curvature;
        if !saved.probe.is_empty() {
            self.scale.regularity.probe.clone_from(&saved.probe);
        }
        self.told.points = saved.points;
        self.pace.creeping = saved.creeping;
        self.told.queue = saved.queue.iter().cloned().collect();
        self.told.termination = saved.termination;
        self.setup.start.clone_from(&saved.start);
        self.told.earlier = (saved.factorisations, saved.corrections);
        self.monitors.saved.clone_from(&saved.sides);
        if let (Some(clock), Some(elapsed)) = (&mut self.setup.clock, saved.elapsed) {
            *clock = Clock::resumed(elapsed);
        }
        belongs(&&self.map, &self.path.selection, &self.here.x)?;
        self.corrector = auto_corrector(&&self.map)?;
        self.renew_factors()
    }

    /// Affine pieces are followed with the stored factors; curved ones are refactored in every step.
    fn renew_factors(&mut self) -> Result<(), ContinuationError> {
        if !self.map.is_piecewise_affine() || self.told.termination.is_some() {
            return Ok(());
        }
        let State { x, t, .. } = &self.here;
        if_solved(
            self.corrector
                .linearize(&self.map, &self.path.selection, x, Some(t)),
        )?;
        Ok(())
    }
}
