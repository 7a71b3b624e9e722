use super::{PiecewiseSmooth, TestLayout};
use crate::sparse::{dot, norm};

/// A vanishing test function at a point.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Vanishing {
    /// Its position in the layout.
    pub(crate) index: usize,
    pub(crate) site: usize,
    /// Its number in the site.
    pub(crate) test: usize,
    pub(crate) gradient: Vec<f64>,
    pub(crate) gradient_norm: f64,
}

impl Vanishing {
    pub(crate) fn new<P: PiecewiseSmooth + ?Sized>(
        map: &P,
        layout: &TestLayout,
        index: usize,
        x: &[f64],
    ) -> Self {
        let (site, test) = layout.locate(index);
        let mut gradient = vec![0.0; x.len()];
        map.test_gradient(site, test, x, &mut gradient);
        let gradient_norm = norm(&gradient);
        Self {
            index,
            site,
            test,
            gradient,
            gradient_norm,
        }
    }

    /// Its rate along a direction.
    pub(crate) fn rate(&self, direction: &[f64]) -> f64 {
        dot(&self.gradient, direction)
    }
}
