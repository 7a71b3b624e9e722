use std::fmt;
use std::marker::PhantomData;

use super::engine::Curve;
use super::{ContinuationError, Event, Point, Termination};
use crate::linear::AutoSolver;
use crate::piecewise::{PiecewiseSmooth, Scaled};

/// Follows a solution curve of H(x) = 0, x = (y, α), through its kinks: an iterator of [events](Event).
///
/// Between transitions the selection σ is frozen and the Moore–Penrose corrector of H^(σ) converges as for a smooth curve. The
/// first facet crossed is located to rounding on the curve of σ. There the arms are found: the kernel vectors of the active selections,
/// each pointing into the cell of its selection. A curve continues along the only arm, or straight on where several leave; it stops where
/// several leave and none is straight.
///
/// A step is rejected when its corrected point is too far from the prediction, when the tangent turns too far, or when the
/// orientation sign det [∇H; τᵀ] flips without an event to account for it.
///
/// ```
/// use semismooth::continuation::{Continuation, ContinuationOptions, Direction, Event, TransitionKind};
/// use semismooth::piecewise::MinMap;
/// // α = |y|: a non-smooth fold at 0.
/// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a[0] = x[1] - x[0];
///     b[0] = x[1] + x[0];
/// });
/// let options = ContinuationOptions::default().with_parameter_range((-1.0, 1.0));
/// let curve = Continuation::new(&map, &[0.5, 0.5], Direction::Decreasing, options)?;
/// let folds: Vec<_> = curve
///     .filter_map(|event| match event { Ok(Event::Transition(t)) => Some(t), _ => None })
///     .collect();
/// assert_eq!(folds.len(), 1);
/// assert_eq!(folds[0].kind, TransitionKind::Fold);
/// assert!(folds[0].parameter().abs() < 1e-12);
/// # Ok::<(), semismooth::continuation::ContinuationError>(())
/// ```
pub struct Continuation<'a, P: ?Sized, L = AutoSolver> {
    pub(super) curve: Curve<'a, Scaled<&'a P>>,
    solver: PhantomData<L>,
}

impl<'a, P: PiecewiseSmooth + ?Sized, L> Continuation<'a, P, L> {
    pub(super) fn of(curve: Curve<'a, Scaled<&'a P>>) -> Self {
        Self {
            curve,
            solver: PhantomData,
        }
    }

    /// The map being followed.
    #[must_use]
    pub fn map(&self) -> &P {
        self.curve.map.map()
    }

    /// Why the curve ended, once it has.
    #[must_use]
    pub fn termination(&self) -> Option<Termination> {
        self.curve.erased().termination()
    }

    /// The current point.
    #[must_use]
    pub fn point(&self) -> Point {
        self.curve.erased().point()
    }

    /// Number of factorisations so far.
    #[must_use]
    pub fn factorisations(&self) -> usize {
        self.curve.erased().factorisations()
    }

    /// Number of factorisations saved so far by updates, where all pieces are affine.
    #[must_use]
    pub fn updates(&self) -> usize {
        self.curve.erased().updates()
    }

    /// Number of correction steps so far.
    #[must_use]
    pub fn corrections(&self) -> usize {
        self.curve.erased().corrections()
    }

    /// Ends the curve; the iterator gives the events already found and then ends.
    pub fn stop(&mut self) {
        self.curve.erased_mut().stop();
    }
}

impl<P: PiecewiseSmooth + ?Sized, L> fmt::Debug for Continuation<'_, P, L> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.curve.erased().fmt(f)
    }
}

impl<P: PiecewiseSmooth + ?Sized, L> Iterator for Continuation<'_, P, L> {
    type Item = Result<Event, ContinuationError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.curve.erased_mut().next_event()
    }
}
