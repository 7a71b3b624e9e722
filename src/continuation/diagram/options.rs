use crate::InputError;
use crate::continuation::ContinuationOptions;
use crate::input::check_options;
use crate::options::setters;

/// Options of [`Diagram::explore`](super::Diagram::explore).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct DiagramOptions {
    /// How curves are followed and in which range of the parameter. `max_time` bounds the whole diagram, all other limits each
    /// curve; the strategy is always [`Strategy::Located`](crate::continuation::Strategy::Located).
    pub continuation: ContinuationOptions,
    /// Largest number of edges. Default 10 000.
    pub max_edges: usize,
    /// Largest number of points on all curves together. Default 1 000 000.
    pub max_points: usize,
    /// Points at most this far apart, relative to 1 + ‖x‖₂, are one vertex, or one solution at an α, unless they lie on curves that are
    /// told apart: beyond their rounding errors, in a plane across them. Default 1e-7.
    pub same_point: f64,
}

impl Default for DiagramOptions {
    fn default() -> Self {
        Self {
            continuation: ContinuationOptions::default(),
            max_edges: 10_000,
            max_points: 1_000_000,
            same_point: 1e-7,
        }
    }
}

impl DiagramOptions {
    setters! {
        /// Sets how curves are followed.
        with_continuation(continuation: ContinuationOptions);
        /// Sets the largest number of edges.
        with_max_edges(max_edges: usize);
        /// Sets the largest number of points on all curves together.
        with_max_points(max_points: usize);
        /// Sets the distance within which points are one vertex.
        with_same_point(same_point: f64);
    }

    /// Sets the interval of the parameter.
    #[must_use]
    pub fn with_parameter_range(mut self, range: (f64, f64)) -> Self {
        self.continuation.parameter_range = range;
        self
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        self.continuation.validate()?;
        let fine = self.same_point > 0.0 && self.same_point < 1e-2;
        check_options(&[("same_point", self.same_point, fine, "in (0, 0.01)")])
    }
}
