use super::{ActiveSet, PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout, cell_margin};
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

/// Of the active pieces of each degenerate site, the one into whose cell a direction d points most.
pub(crate) fn pointed_into(
    map: &dyn PiecewiseSmooth,
    layout: &TestLayout,
    active: &ActiveSet,
    x: &[f64],
    d: &[f64],
) -> Selection {
    let mut rates = vec![0.0; layout.total()];
    map.test_derivatives(x, d, &mut rates);
    let mut selection = entered(map, layout, active, &rates);
    if map.has_nested_kinks() {
        // Outer kinks depend on inner ones: as many rounds as kinks are nested determine all.
        for _ in active.degenerate_sites() {
            map.tests_of_selection(&selection, x, Some(d), &mut rates);
            let next = entered(map, layout, active, &rates);
            if next == selection {
                break;
            }
            selection = next;
        }
    }
    selection
}

/// The selection by given rates of the test functions.
fn entered(map: &dyn PiecewiseSmooth, layout: &TestLayout, active: &ActiveSet, rates: &[f64]) -> Selection {
    let mut selection = active.first().clone();
    for (site, pieces) in active.degenerate_sites() {
        let range = layout.range(*site);
        let mut best = f64::NEG_INFINITY;
        for &piece in pieces {
            let facets: Vec<_> = map
                .cell(*site, piece)
                .iter()
                .filter(|f| {
                    active
                        .vanishing()
                        .binary_search(&(range.start + f.test()))
                        .is_ok()
                })
                .copied()
                .collect();
            let margin = cell_margin(&facets, &rates[range.clone()]);
            if margin > best {
                best = margin;
                selection.set(*site, piece);
            }
        }
    }
    selection
}
