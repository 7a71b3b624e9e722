use super::Selection;

/// Taylor expansions of the pieces of a map along arcs.
///
/// Maps of formulas (`Traced`) have them. A map of your own that knows its higher derivatives returns this
/// from [`expansions`](crate::piecewise::Derivatives::expansions): where Jacobians are singular, the branches
/// that meet are then found from derivatives without errors of differences.
pub trait Expansions {
    /// Coefficients of H^(σ)(x(s)) and of the test functions along x(s) = Σ arc\[k\] sᵏ, k = 0 … 4, at s = 0;
    /// those of the selection where kinks are [nested](crate::piecewise::Derivatives::has_nested_kinks).
    /// `arc` holds at most 5 vectors of length m, and those it lacks are zero. Entry 5 i + k of `residual`
    /// (length 5 n) and of `tests` (5 times the number of test functions) is the coefficient of sᵏ. What is
    /// undefined is NaN or infinite.
    fn along(&self, selection: &Selection, arc: &[&[f64]], residual: &mut [f64], tests: &mut [f64]);

    /// Enclosures (lower and upper ends, rounding included) of ∇H^(σ) and of the gradients of the test
    /// functions at all points of the box |x − centre| ≤ radius, component by component: entry m i + j
    /// belongs to row i and column j. Returns whether there are such enclosures: not where a function is
    /// undefined at a point of the box. Default: `false`.
    fn jacobian_within(
        &self,
        _selection: &Selection,
        _centre: &[f64],
        _radius: &[f64],
        _jacobian: &mut [(f64, f64)],
        _tests: &mut [(f64, f64)],
    ) -> bool {
        false
    }

    /// Enclosures of the coefficients that [`along`](Self::along) gives for the lines x + s·direction through
    /// all points x of the box |x − centre| ≤ radius: entry 5 i + k encloses the values, for k = 0, or the
    /// k-th derivatives divided by k!. Returns whether there are such enclosures. Default: `false`.
    fn derivatives_within(
        &self,
        _selection: &Selection,
        _centre: &[f64],
        _radius: &[f64],
        _direction: &[f64],
        _residual: &mut [(f64, f64)],
        _tests: &mut [(f64, f64)],
    ) -> bool {
        false
    }
}
