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
        if own_gradient(map, layout, selection, self.index, x, &mut own.gradient) {
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
    if !own_gradient(map, layout, selection, index, x, gradient) {
        let (site, test) = layout.locate(index);
        map.test_gradient(site, test, x, gradient);
    }
}

/// The same, where test functions depend on the selection.
fn own_gradient<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    layout: &TestLayout,
    selection: &Selection,
    index: usize,
    x: &[f64],
    gradient: &mut [f64],
) -> bool {
    if !map.has_nested_kinks() {
        return false;
    }
    let (mut unit, mut rates) = (vec![0.0; x.len()], vec![0.0; layout.total()]);
    for (j, g) in gradient.iter_mut().enumerate() {
        unit[j] = 1.0;
        map.tests_of_selection(selection, x, Some(&unit), &mut rates);
        unit[j] = 0.0;
        *g = rates[index];
    }
    true
}

#[cfg(all(test, feature = "autodiff"))]
mod tests {
    use super::*;
    use crate::piecewise::{Kinks, NonsmoothFunction, Real, Traced};

    /// ||y| − 2 y| − α: the argument of the outer kink has the slopes −1 for y > 0 and −3 for y < 0.
    struct Nested;

    impl NonsmoothFunction for Nested {
        fn num_vars(&self) -> usize {
            2
        }
        fn num_residuals(&self) -> usize {
            1
        }
        fn eval<T: Real>(&self, x: &[T], kinks: &mut Kinks<'_, T>, out: &mut [T]) {
            let inner = kinks.abs(x[0]);
            out[0] = kinks.abs(inner - x[0] * 2.0) - x[1];
        }
    }

    #[test]
    fn gradients_are_those_of_the_selection() {
        let map = Traced::new(Nested);
        let layout = TestLayout::new(&map);
        let outer = layout.range(1).start;
        // On either side of the kink, wherever rounding has left the point.
        for y in [0.0, 1e-17, -1e-17] {
            let x = [y, 0.0];
            let of = |inner: usize| {
                let selection = Selection::from_pieces([inner, 0]);
                Vanishing::new(&map, &layout, &selection, outer, &x)
            };
            let (first, second) = (of(0), of(1));
            let mut slopes = [first.gradient[0], second.gradient[0]];
            let turned = Selection::from_pieces([1, 0]);
            assert_eq!(first.of_selection(&map, &layout, &turned, &x), second);
            assert_eq!([first.gradient_norm, second.gradient_norm], slopes.map(f64::abs));
            slopes.sort_by(f64::total_cmp);
            assert_eq!(slopes, [-3.0, -1.0]);
        }
    }
}
