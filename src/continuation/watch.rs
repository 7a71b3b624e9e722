/// A function of x = (y, α) that threads may share.
pub(super) type Function<'a> = Box<dyn Fn(&[f64]) -> f64 + Send + Sync + 'a>;

/// A function of x, and the side of its zero set on which the curve runs.
pub(super) struct Watch<'a> {
    pub(super) name: String,
    pub(super) function: Function<'a>,
    pub(super) stops: bool,
    /// Sign of the function before its next zero; 0 as long as it has vanished exactly. Kept apart from values, which are rounding
    /// errors at a zero that has just been passed.
    pub(super) side: f64,
}

impl Watch<'_> {
    pub(super) fn value(&self, x: &[f64]) -> f64 {
        (self.function)(x)
    }
}
