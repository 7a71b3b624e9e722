//! Diagrams from all solutions at given parameters.

use std::cell::{Cell, RefCell};
use std::ops::ControlFlow;

use super::{Diagram, DiagramOptions, Limit, Progress};
use crate::continuation::ContinuationError;
use crate::enumeration::{EnumerationOptions, all_solutions_until};
use crate::piecewise::PiecewiseSmooth;

/// What [`Diagram::explore_sections_observed`] reports.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum SectionProgress<'a> {
    /// All solutions at this parameter are being searched for; reported often.
    Solutions(f64),
    /// An event on a curve through them.
    Curves(Progress<'a>),
}

impl Diagram {
    /// Explores from all solutions at each of the parameters `alphas`, as [`all_solutions`](crate::enumeration::all_solutions) finds them: whatever crosses one of
    /// these values is in the diagram, isolas included. For maps that are piecewise affine in y at fixed α (in α they need not
    /// be).
    ///
    /// [`completeness`](Self::completeness) names each α whose solutions are not known to be all found.
    ///
    /// # Errors
    /// As [`explore`](Self::explore) and [`all_solutions`](crate::enumeration::all_solutions).
    ///
    /// ```
    /// use semismooth::continuation::{Diagram, DiagramOptions};
    /// use semismooth::enumeration::EnumerationOptions;
    /// use semismooth::piecewise::MinMap;
    /// // min(y, 1 − y) = α² − ¼: a closed curve, α² < ¾.
    /// let map = MinMap::curve(1, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
    ///     a[0] = x[0] + 0.25 - x[1] * x[1];
    ///     b[0] = 1.25 - x[0] - x[1] * x[1];
    /// });
    /// let diagram = Diagram::explore_sections(&map, &[0.0], &DiagramOptions::default(), &EnumerationOptions::default())?;
    /// assert!(!diagram.completeness().is_limited());
    /// assert_eq!((diagram.isolas().len(), diagram.folds().len()), (1, 2));
    /// # Ok::<(), semismooth::continuation::ContinuationError>(())
    /// ```
    pub fn explore_sections<P: PiecewiseSmooth + ?Sized>(
        map: &P,
        alphas: &[f64],
        options: &DiagramOptions,
        enumeration: &EnumerationOptions,
    ) -> Result<Self, ContinuationError> {
        Self::explore_sections_of(&map, alphas, options, enumeration, &mut |_| {
            ControlFlow::Continue(())
        })
    }

    /// [`explore_sections`](Self::explore_sections), reporting to `observe`, which may stop. If it stops while solutions
    /// are searched for, the curves through those found so far are not followed.
    ///
    /// # Errors
    /// As [`explore_sections`](Self::explore_sections).
    pub fn explore_sections_observed<P: PiecewiseSmooth + ?Sized>(
        map: &P,
        alphas: &[f64],
        options: &DiagramOptions,
        enumeration: &EnumerationOptions,
        mut observe: impl FnMut(&SectionProgress<'_>) -> ControlFlow<()>,
    ) -> Result<Self, ContinuationError> {
        Self::explore_sections_of(&map, alphas, options, enumeration, &mut observe)
    }

    fn explore_sections_of(
        map: &dyn PiecewiseSmooth,
        alphas: &[f64],
        options: &DiagramOptions,
        enumeration: &EnumerationOptions,
        observe: &mut dyn FnMut(&SectionProgress<'_>) -> ControlFlow<()>,
    ) -> Result<Self, ContinuationError> {
        let mut starts = Vec::new();
        let mut unknown = Vec::new();
        let (told, stopped) = (RefCell::new(&mut *observe), Cell::new(false));
        for &alpha in alphas {
            let stop = || {
                stopped
                    .set(stopped.get() || told.borrow_mut()(&SectionProgress::Solutions(alpha)).is_break());
                stopped.get()
            };
            let set = match stop() {
                true => None,
                false => Some(all_solutions_until(map, alpha, enumeration, &stop)?),
            };
            let Some(set) = set.filter(|_| !stopped.get()) else {
                starts.clear();
                unknown.push(Limit::Interrupted);
                break;
            };
            let open = set.continua.iter().any(|c| c.dimension > 1 || c.ends.is_empty());
            if open || set.completeness.has_gaps() {
                unknown.push(Limit::Solutions { parameter: alpha });
            }
            starts.extend(set.solutions.into_iter().map(|s| s.x));
            starts.extend(set.continua.into_iter().flat_map(|c| c.ends));
        }
        let mut diagram = Self::explore_observed(map, &starts, options, |progress| {
            observe(&SectionProgress::Curves(*progress))
        })?;
        for limit in unknown {
            diagram.completeness.add(limit);
        }
        Ok(diagram)
    }
}
