//! Diagrams from all solutions at given parameters.

use super::{Diagram, DiagramOptions, Limit};
use crate::continuation::ContinuationError;
use crate::enumeration::{EnumerationOptions, all_solutions};
use crate::piecewise::PiecewiseSmooth;

impl Diagram {
    /// Explores from all solutions at each of the parameters `alphas`, as [`all_solutions`] finds them: whatever crosses one of
    /// these values is in the diagram, isolas included. For maps that are piecewise affine in y at fixed α (in α they need not
    /// be).
    ///
    /// [`completeness`](Self::completeness) tells of an α whose solutions could not all be found.
    ///
    /// # Errors
    /// As [`explore`](Self::explore) and [`all_solutions`].
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
    /// assert!(diagram.completeness().is_complete());
    /// assert_eq!((diagram.isolas().len(), diagram.folds().len()), (1, 2));
    /// # Ok::<(), semismooth::continuation::ContinuationError>(())
    /// ```
    pub fn explore_sections<P: PiecewiseSmooth + ?Sized>(
        map: &P,
        alphas: &[f64],
        options: &DiagramOptions,
        enumeration: &EnumerationOptions,
    ) -> Result<Self, ContinuationError> {
        Self::explore_sections_of(&map, alphas, options, enumeration)
    }

    fn explore_sections_of(
        map: &dyn PiecewiseSmooth,
        alphas: &[f64],
        options: &DiagramOptions,
        enumeration: &EnumerationOptions,
    ) -> Result<Self, ContinuationError> {
        let mut starts = Vec::new();
        let mut unknown = Vec::new();
        for &alpha in alphas {
            let set = all_solutions(map, alpha, enumeration)?;
            let open = set.continua.iter().any(|c| c.ends.is_empty());
            if open || set.completeness.has_gaps() {
                unknown.push(Limit::Solutions { parameter: alpha });
            }
            starts.extend(set.solutions.into_iter().map(|s| s.x));
            starts.extend(set.continua.into_iter().flat_map(|c| c.ends));
        }
        let mut diagram = Self::explore(map, &starts, options)?;
        for limit in unknown {
            diagram.completeness.add(limit);
        }
        Ok(diagram)
    }
}
