//! Derivatives against difference quotients.

use super::FindingKind;
use super::session::{Place, Session};
use crate::piecewise::{PiecewiseSmoothExt, Selection};
use crate::sparse::Matrix;
use crate::tolerances::CENTRAL;

/// Difference quotients of a vector function with a bound of their error, column by column.
pub(super) struct Quotients {
    values: Vec<f64>,
    errors: Vec<f64>,
    rows: usize,
}

impl Quotients {
    /// Richardson extrapolation of central differences: the two steps give the truncation error, the values the rounding error.
    pub(super) fn new(rows: usize, x: &[f64], steps: &[f64], f: impl Fn(&[f64]) -> Vec<f64>) -> Self {
        let (mut values, mut errors) = (Vec::new(), Vec::new());
        let mut y = x.to_vec();
        for (j, &h) in steps.iter().enumerate() {
            let mut at = |s: f64| {
                y[j] = x[j] + s;
                let value = f(&y);
                y[j] = x[j];
                value
            };
            let (p, m, pp, mm) = (at(h), at(-h), at(2.0 * h), at(-2.0 * h));
            for i in 0..rows {
                let near = (p[i] - m[i]) / (2.0 * h);
                let far = (pp[i] - mm[i]) / (4.0 * h);
                let noise = 8.0 * f64::EPSILON * (p[i].abs() + m[i].abs() + x[j].abs() * near.abs()) / h;
                values.push((4.0 * near - far) / 3.0);
                errors.push((near - far).abs() + noise);
            }
        }
        Self { values, errors, rows }
    }

    pub(super) fn get(&self, i: usize, j: usize) -> (f64, f64) {
        (self.values[j * self.rows + i], self.errors[j * self.rows + i])
    }

    pub(super) fn is_finite(&self) -> bool {
        self.values.iter().all(|v| v.is_finite())
    }

    /// Size of the terms |∂f_i/∂x_j x_j| that may cancel in row i.
    pub(super) fn row_size(&self, i: usize, x: &[f64]) -> f64 {
        (0..x.len()).map(|j| (self.get(i, j).0 * x[j]).abs()).sum()
    }
}

impl Session<'_> {
    fn quotients(&self, rows: usize, x: &[f64], f: impl Fn(&[f64]) -> Vec<f64>) -> Quotients {
        let mut q = Quotients::new(rows, x, &self.steps, f);
        for i in 0..rows {
            let noise = 8.0 * f64::EPSILON * q.row_size(i, x);
            for (j, h) in self.steps.iter().enumerate() {
                q.errors[j * rows + i] += noise / h;
            }
        }
        q
    }

    fn agrees(&self, (quotient, error): (f64, f64), value: f64) -> bool {
        (value - quotient).abs() <= self.options.tolerance * quotient.abs().max(value.abs()) + error
    }

    /// The piece at fault: that of the only site in which a selection differs from the one at the point, if there is only one.
    fn blame(&self, place: Place, here: &Selection, selection: &Selection) -> Place {
        let mut sites = here.differing_sites(selection);
        match (sites.next(), sites.next(), self.map.num_sites()) {
            (Some(site), None, _) => place.site(site).piece(selection.piece(site)),
            (_, _, 1) => place.site(0).piece(selection.piece(0)),
            _ => place,
        }
    }

    /// Jacobians of the selections at a point.
    pub(super) fn derivatives(&mut self, point: usize, here: &Selection) {
        let (map, x) = (self.map, &self.samples[point]);
        let n = map.num_residuals();
        let mut jac = Matrix::zeros(map.pattern());
        for selection in self.selections(here) {
            if self.full() {
                return;
            }
            let place = self.blame(Place::at(point), here, &selection);
            let quotients = self.quotients(n, x, |y| self.residual(&selection, y));
            jac.clear();
            map.jacobian(&selection, x, &mut jac);
            let residual = self.residual(&selection, x);
            let named = format!("in selection {}", selection.display(map));
            let entry = jac.triplets().find(|t| !t.2.is_finite());
            let row = residual.iter().position(|r| !r.is_finite());
            if entry.is_some() || row.is_some() || !quotients.is_finite() {
                // Far from its cell a selection need not be defined.
                if selection != *here {
                    continue;
                }
                if let Some((i, j, v)) = entry {
                    self.find(FindingKind::NotFinite, place.entry(i, j), 0.0, v, "Jacobian");
                } else if let Some(i) = row {
                    let what = format!("residual {i}");
                    self.find(FindingKind::NotFinite, place, 0.0, residual[i], &what);
                } else {
                    let what = "residual close to the point";
                    self.find(FindingKind::NotFinite, place, 0.0, f64::NAN, what);
                }
                continue;
            }
            self.report.selections += 1;
            if let Some((i, j)) = jac.stray() {
                // A missing entry is reported once.
                self.find(FindingKind::StrayEntry, place.entry(i, j), 0.0, 1.0, &named);
                continue;
            }
            for j in 0..x.len() {
                for i in 0..n {
                    let (quotient, value) = (quotients.get(i, j), jac.get(i, j));
                    if !self.agrees(quotient, value) {
                        self.find(
                            FindingKind::Jacobian,
                            place.entry(i, j),
                            quotient.0,
                            value,
                            &named,
                        );
                    }
                }
            }
        }
    }

    /// `test_derivatives` and `test_gradient` at a point.
    pub(super) fn test_derivatives(&mut self, point: usize) {
        let (map, x) = (self.map, &self.samples[point]);
        let total = self.layout.total();
        let quotients = self.quotients(total, x, |y| self.theta(y));
        // A direction without symmetries, in the units of the variables.
        let d: Vec<f64> = (0..x.len())
            .map(|j| self.steps[j] / CENTRAL * (1.0 + 0.37 * j as f64).cos())
            .collect();
        let mut rates = vec![0.0; total];
        map.test_derivatives(x, &d, &mut rates);
        let mut gradient = vec![0.0; x.len()];
        for k in 0..total {
            let (site, test) = self.layout.locate(k);
            let place = Place::at(point).site(site);
            gradient.fill(0.0);
            map.test_gradient(site, test, x, &mut gradient);
            for (j, &value) in gradient.iter().enumerate() {
                let quotient = quotients.get(k, j);
                if !self.agrees(quotient, value) {
                    let place = place.entry(test, j);
                    self.find(
                        FindingKind::TestGradient,
                        place,
                        quotient.0,
                        value,
                        "component of the gradient",
                    );
                }
            }
            let (mut rate, mut bound) = (0.0, 0.0);
            for (j, dj) in d.iter().enumerate() {
                let (value, error) = quotients.get(k, j);
                rate += value * dj;
                bound += (error + self.options.tolerance * value.abs()) * dj.abs();
            }
            if (rates[k] - rate).abs() > bound || rates[k].is_nan() {
                let what = format!("rate of test function {test}");
                self.find(FindingKind::TestDerivatives, place, rate, rates[k], &what);
            }
        }
    }

    /// `tests_of_selection` at a point in the cell of `here`: smooth for every selection, and there those of `test_functions`.
    pub(super) fn selection_tests(&mut self, point: usize, here: &Selection) {
        let (map, x, total) = (self.map, &self.samples[point], self.layout.total());
        if !map.has_nested_kinks() {
            return;
        }
        let of = |selection: &Selection, x: &[f64], d: Option<&[f64]>| {
            let mut out = vec![0.0; total];
            map.tests_of_selection(selection, x, d, &mut out);
            out
        };
        let (natural, own) = (self.theta(x), of(here, x, None));
        for k in 0..total {
            let size = self.options.tolerance * natural[k].abs().max(own[k].abs());
            let same = (natural[k] - own[k]).abs() <= size;
            if !same {
                let (site, test) = self.layout.locate(k);
                let what = format!("value of test function {test}");
                let place = Place::at(point).site(site).piece(here.piece(site));
                self.find(FindingKind::SelectionTests, place, natural[k], own[k], &what);
            }
        }
        for selection in self.selections(here) {
            if self.full() {
                return;
            }
            let quotients = self.quotients(total, x, |y| of(&selection, y, None));
            let mut unit = vec![0.0; x.len()];
            for j in 0..x.len() {
                unit[j] = 1.0;
                let rates = of(&selection, x, Some(&unit));
                unit[j] = 0.0;
                for (k, &rate) in rates.iter().enumerate() {
                    let quotient = quotients.get(k, j);
                    if quotient.0.is_finite() && !self.agrees(quotient, rate) {
                        let (site, test) = self.layout.locate(k);
                        let place = self.blame(Place::at(point).site(site).entry(test, j), here, &selection);
                        let what = format!("rate in selection {}", selection.display(map));
                        self.find(FindingKind::SelectionTests, place, quotient.0, rate, &what);
                    }
                }
            }
        }
    }

    /// Derivatives of a piecewise-affine map are the same at all points.
    pub(super) fn affine(&mut self, inside: &[(usize, Selection)]) {
        let map = self.map;
        let Some((first, here)) = inside.first().filter(|_| map.is_piecewise_affine()) else {
            return;
        };
        let mut reference = Matrix::zeros(map.pattern());
        let mut jac = reference.clone();
        for selection in self.selections(here) {
            reference.clear();
            map.jacobian(&selection, &self.samples[*first], &mut reference);
            for (point, _) in &inside[1..] {
                jac.clear();
                map.jacobian(&selection, &self.samples[*point], &mut jac);
                let place = self.blame(Place::at(*point), here, &selection);
                for ((i, j, a), b) in reference.triplets().zip(jac.values()) {
                    if (a - b).abs() > self.options.tolerance * a.abs().max(b.abs()) {
                        let what = format!("Jacobian against that at sample {first}");
                        self.find(FindingKind::Affine, place.entry(i, j), a, *b, &what);
                    }
                }
            }
        }
        let gradients = |x: &[f64]| self.quotients(self.layout.total(), x, |y| self.theta(y));
        let reference = gradients(&self.samples[*first]);
        for (point, _) in &inside[1..] {
            let other = self.quotients(self.layout.total(), &self.samples[*point], |y| self.theta(y));
            for k in 0..self.layout.total() {
                for j in 0..map.num_vars() {
                    let ((a, e), (b, f)) = (reference.get(k, j), other.get(k, j));
                    if !self.agrees((a, e + f), b) {
                        let (site, test) = self.layout.locate(k);
                        let place = Place::at(*point).site(site).entry(test, j);
                        let what = format!("test gradient against that at sample {first}");
                        self.find(FindingKind::Affine, place, a, b, &what);
                    }
                }
            }
        }
    }
}
