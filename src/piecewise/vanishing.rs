use super::{PiecewiseSmooth, Selection, TestLayout};
use crate::sparse::{dot, norm};

/// A vanishing test function of a selection at a point.
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
        selection: &Selection,
        index: usize,
        x: &[f64],
    ) -> Self {
        let (site, test) = layout.locate(index);
        let mut gradient = vec![0.0; x.len()];
        gradient_of(map, layout, selection, index, x, &mut gradient);
        let gradient_norm = norm(&gradient);
        Self {
            index,
            site,
            test,
            gradient,
            gradient_norm,
        }
    }

    /// The same as a test function of another selection.
    pub(crate) fn of_selection<P: PiecewiseSmooth + ?Sized>(
        &self,
        map: &P,
        layout: &TestLayout,
        selection: &Selection,
        x: &[f64],
    ) -> Self {
        let mut own = self.clone();
        if map.has_nested_kinks() {
            gradient_of(map, layout, selection, self.index, x, &mut own.gradient);
            own.gradient_norm = norm(&own.gradient);
        }
        own
    }

    /// Its rate along a direction.
    pub(crate) fn rate(&self, direction: &[f64]) -> f64 {
        dot(&self.gradient, direction)
    }
}

/// The gradient of a test function of a selection.
pub(crate) fn gradient_of<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    layout: &TestLayout,
    selection: &Selection,
    index: usize,
    x: &[f64],
    gradient: &mut [f64],
) {
    if !map.has_nested_kinks() {
        let (site, test) = layout.locate(index);
        return map.test_gradient(site, test, x, gradient);
    }
    let (mut unit, mut rates) = (vec![0.0; x.len()], vec![0.0; layout.total()]);
    for (j, g) in gradient.iter_mut().enumerate() {
        unit[j] = 1.0;
        map.tests_of_selection(selection, x, Some(&unit), &mut rates);
        unit[j] = 0.0;
        *g = rates[index];
    }
}
