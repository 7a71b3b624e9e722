use std::borrow::Cow;

use super::scaled::check_sizes;
use super::{Description, Facet, PiecewiseError, PiecewiseSmooth, Selection, Structure};
use crate::sparse::Matrix;

/// The map H(x) = min(a(x), b(x)), component by component, of two smooth functions given by one closure.
///
/// max(a, b) is −min(−a, −b). Component i is site i with the pieces "first" (aᵢ < bᵢ) and "second"; its test function is bᵢ − aᵢ.
/// Jacobians are central differences; for exact ones, or for other compositions, use `Traced` or implement the trait.
///
/// ```
/// use semismooth::{newton::Newton, piecewise::MinMap};
/// // The LCP  0 ≤ x ⟂ M x + q ≥ 0  as min(x, M x + q) = 0.
/// let lcp = MinMap::new(2, |x: &[f64], a: &mut [f64], b: &mut [f64]| {
///     a.copy_from_slice(x);
///     b[0] = 2.0 * x[0] + x[1] - 5.0;
///     b[1] = x[0] + 2.0 * x[1] - 1.0;
/// });
/// let mut x = [0.0, 0.0];
/// Newton::default().solve(&lcp, &mut x)?;
/// assert!((x[0] - 2.5).abs() < 1e-9 && x[1].abs() < 1e-9);
/// # Ok::<(), semismooth::newton::NewtonError>(())
/// ```
#[derive(Debug, Clone)]
pub struct MinMap<F> {
    vars: usize,
    residuals: usize,
    function: F,
    /// Typical sizes of the variables; empty for 1.
    sizes: Vec<f64>,
}

impl<F: Fn(&[f64], &mut [f64], &mut [f64])> MinMap<F> {
    /// An equation in `n` unknowns; `function(x, a, b)` fills a(x) and b(x), both of length n.
    pub fn new(n: usize, function: F) -> Self {
        Self {
            vars: n,
            residuals: n,
            function,
            sizes: Vec::new(),
        }
    }

    /// A curve: `n` residuals of n + 1 variables, the parameter last.
    pub fn curve(n: usize, function: F) -> Self {
        Self {
            vars: n + 1,
            residuals: n,
            function,
            sizes: Vec::new(),
        }
    }

    /// Sets typical sizes of the variables, to which the steps of differences are relative. Default: 1.
    ///
    /// # Errors
    /// Another number of sizes than of variables; sizes that are not positive and finite.
    pub fn with_typical_sizes(mut self, sizes: Vec<f64>) -> Result<Self, PiecewiseError> {
        check_sizes(&sizes, self.vars)?;
        self.sizes = sizes;
        Ok(self)
    }

    fn both(&self, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut a, mut b) = (vec![0.0; self.residuals], vec![0.0; self.residuals]);
        (self.function)(x, &mut a, &mut b);
        (a, b)
    }
}

impl<F: Fn(&[f64], &mut [f64], &mut [f64])> PiecewiseSmooth for MinMap<F> {
    fn num_vars(&self) -> usize {
        self.vars
    }

    fn num_residuals(&self) -> usize {
        self.residuals
    }

    fn num_sites(&self) -> usize {
        self.residuals
    }

    fn num_pieces(&self, _site: usize) -> usize {
        2
    }

    fn num_tests(&self, _site: usize) -> usize {
        1
    }

    fn cell(&self, _site: usize, piece: usize) -> &[Facet] {
        const FIRST: [Facet; 1] = [Facet::positive(0)];
        const SECOND: [Facet; 1] = [Facet::negative(0)];
        if piece == 0 { &FIRST } else { &SECOND }
    }

    fn test_functions(&self, x: &[f64], out: &mut [f64]) {
        let (a, b) = self.both(x);
        for i in 0..self.residuals {
            out[i] = b[i] - a[i];
        }
    }

    fn residual(&self, selection: &Selection, x: &[f64], out: &mut [f64]) {
        let (a, b) = self.both(x);
        for i in 0..self.residuals {
            let chosen = [a[i], b[i]][selection.piece(i).min(1)];
            // What is undefined stays so, whichever piece is selected.
            out[i] = if a[i].is_nan() || b[i].is_nan() {
                f64::NAN
            } else {
                chosen
            };
        }
    }

    fn jacobian(&self, selection: &Selection, x: &[f64], jac: &mut Matrix) {
        let mut y = x.to_vec();
        let mut plus = vec![0.0; self.residuals];
        let mut minus = vec![0.0; self.residuals];
        for j in 0..self.vars {
            let h = 6.055e-6 * (self.sizes.get(j).unwrap_or(&1.0) + x[j].abs());
            y[j] = x[j] + h;
            self.residual(selection, &y, &mut plus);
            y[j] = x[j] - h;
            self.residual(selection, &y, &mut minus);
            y[j] = x[j];
            for i in 0..self.residuals {
                jac.add(i, j, (plus[i] - minus[i]) / (2.0 * h));
            }
        }
    }

    fn structure(&self) -> Option<&dyn Structure> {
        Some(self)
    }

    fn description(&self) -> Option<&dyn Description> {
        Some(self)
    }
}

impl<F: Fn(&[f64], &mut [f64], &mut [f64])> Structure for MinMap<F> {
    fn site_rows(&self, site: usize, rows: &mut Vec<usize>) {
        rows.clear();
        rows.push(site);
    }
}

impl<F: Fn(&[f64], &mut [f64], &mut [f64])> Description for MinMap<F> {
    fn piece_name(&self, _site: usize, piece: usize) -> Cow<'_, str> {
        Cow::Borrowed(if piece == 0 { "first" } else { "second" })
    }

    fn site_name(&self, site: usize) -> Cow<'_, str> {
        Cow::Owned(format!("component {site}"))
    }

    fn typical_sizes(&self, sizes: &mut [f64]) {
        if !self.sizes.is_empty() {
            sizes.copy_from_slice(&self.sizes);
        }
    }
}
