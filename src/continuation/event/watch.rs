/// A function of x = (y, α) that threads may share.
pub(in crate::continuation) type Function<'a> = Box<dyn Fn(&[f64]) -> f64 + Send + Sync + 'a>;

/// A function of x, and the side of its zero set on which the curve runs.
pub(in crate::continuation) struct Watch<'a> {
    pub(in crate::continuation) name: String,
    pub(in crate::continuation) function: Function<'a>,
    pub(in crate::continuation) stops: bool,
    /// Sign of the function before its next zero; 0 as long as it has vanished exactly. Kept apart from values, which are rounding
    /// errors at a zero that has just been passed.
    pub(in crate::continuation) side: f64,
}

impl Watch<'_> {
    pub(in crate::continuation) fn value(&self, x: &[f64]) -> f64 {
        (self.function)(x)
    }
}
