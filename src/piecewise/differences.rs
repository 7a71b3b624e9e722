//! Central differences of test functions, for maps that do not give derivatives.

use super::{PiecewiseSmooth, PiecewiseSmoothExt, TestLayout};
use crate::sparse::max_abs;
use crate::tolerances::CENTRAL;

pub(super) fn test_derivatives(map: &dyn PiecewiseSmooth, x: &[f64], d: &[f64], out: &mut [f64]) {
    let norm_d = max_abs(d);
    if norm_d == 0.0 || !norm_d.is_finite() {
        out.fill(if norm_d == 0.0 { 0.0 } else { f64::NAN });
        return;
    }
    let sizes = sizes(map, x.len());
    let relative = |v: &[f64]| {
        v.iter()
            .zip(&sizes)
            .fold(0.0_f64, |a, (v, s)| a.max((v / s).abs()))
    };
    let h = CENTRAL * (1.0 + relative(x)) / relative(d);
    let shifted = |s: f64| -> Vec<f64> { x.iter().zip(d).map(|(x, d)| x + s * d).collect() };
    let mut minus = vec![0.0; out.len()];
    map.test_functions(&shifted(h), out);
    map.test_functions(&shifted(-h), &mut minus);
    for (o, m) in out.iter_mut().zip(&minus) {
        *o = (*o - m) / (2.0 * h);
    }
}

pub(super) fn test_gradient(
    map: &dyn PiecewiseSmooth,
    site: usize,
    test: usize,
    x: &[f64],
    gradient: &mut [f64],
) {
    let layout = TestLayout::new(map);
    let index = layout.range(site).start + test;
    let mut y = x.to_vec();
    let mut theta = vec![0.0; layout.total()];
    let sizes = sizes(map, x.len());
    for j in 0..x.len() {
        let h = CENTRAL * (sizes[j] + x[j].abs());
        let mut at = |v: f64| {
            y[j] = v;
            map.test_functions(&y, &mut theta);
            theta[index]
        };
        let (plus, minus) = (at(x[j] + h), at(x[j] - h));
        gradient[j] = (plus - minus) / (2.0 * h);
        y[j] = x[j];
    }
}

/// Typical sizes of the variables, to which steps are relative.
fn sizes(map: &dyn PiecewiseSmooth, m: usize) -> Vec<f64> {
    let mut sizes = vec![1.0; m];
    map.typical_sizes(&mut sizes);
    sizes
}
