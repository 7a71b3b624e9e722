//! Which test functions vanish together with the one on which a transition was located: those whose zero the curve reaches at the same
//! arclength, to rounding.

use super::units::Units;
use crate::continuation::ContinuationError;
use crate::continuation::engine::Curve;
use crate::continuation::error::if_solved;
use crate::piecewise::{PiecewiseSmooth, Selection, TestLayout, Vanishing};
use crate::sparse::norm;

/// Distance along the curve, relative to 1 + ‖x‖, beyond which zeros do not coincide.
const WIDE: f64 = 1e-6;
/// Bound of rounding errors, in multiples of their estimate.
pub(in crate::continuation) const SAFETY: f64 = 16.0;

impl Curve<'_> {
    /// The test functions that vanish at a transition located on `index`, by position.
    ///
    /// A facet of the followed cell counts if its crossing lies as far along the curve as the located one, to rounding. A facet from which
    /// the curve moves away does not, however near: it was left before, and if it counted, the arm of arrival would seem to leave its
    /// cell. The other test functions of the sites concerned count if their value is within rounding.
    pub(in crate::continuation) fn met_together(
        &mut self,
        index: usize,
    ) -> Result<Vec<Vanishing>, ContinuationError> {
        let mut rates = std::mem::take(&mut self.buffers.rates);
        // On affine pieces they are those of the last step.
        if !self.map.is_piecewise_affine() || rates.len() != self.setup.layout.total() {
            rates = self.rates_at(&self.here);
        }
        let mut facets = self.facets_near(index, &rates);
        let mut others = self.other_tests_near(&facets);
        if facets.len() + others.len() > 1 {
            let rounding = self.rounding_here()?;
            let error = |v: &Vanishing| rounding.of(v);
            // Distance along the curve by which rounding may have moved the located crossing.
            let reach = self.setup.options.vanishing_distance * (1.0 + norm(&self.here.x));
            let located = facets.iter().find(|(v, _)| v.index == index);
            let shift = located.map_or(0.0, |(v, _)| (error(v) / rates[index].abs()).min(reach));
            let meets =
                |v: &Vanishing| self.here.theta[v.index].abs() <= error(v) + shift * rates[v.index].abs();
            facets.retain(|(v, certain)| *certain || meets(v));
            others.retain(|v| facets.iter().any(|(f, _)| f.site == v.site) && meets(v));
        }
        self.buffers.rates = rates;
        let mut list: Vec<Vanishing> = facets.into_iter().map(|(v, _)| v).chain(others).collect();
        list.sort_by_key(|v| v.index);
        let indices: Vec<usize> = list.iter().map(|v| v.index).collect();
        let theta = &mut self.here.theta;
        let (layout, selection) = (&self.setup.layout, &self.path.selection);
        keep_inside(&&self.map, layout, selection, &indices, theta);
        Ok(list)
    }

    /// Facets of the followed cell whose crossings may coincide with that of `index`, and whether they certainly do.
    fn facets_near(&self, index: usize, rates: &[f64]) -> Vec<(Vanishing, bool)> {
        let wide = WIDE * (1.0 + norm(&self.here.x));
        let mut near = Vec::new();
        let mut units = Units::new(&self.map, &self.path.selection, &self.here.x);
        for (k, facet) in self.facets() {
            let certain = k == index || self.is_grazing(k);
            if !certain && (self.here.theta[k].abs() > wide * rates[k].abs() || rates[k].is_nan()) {
                continue;
            }
            let v = self.test_here(k);
            let mut least = || units.least_rate(&v, rates[k], v.gradient_norm, &self.here.t);
            if certain || facet.sign() * rates[k] <= least() {
                near.push((v, certain));
            }
        }
        near
    }

    /// Test functions at the sites of these facets which are no facets of the followed cell and may vanish, too.
    fn other_tests_near(&mut self, facets: &[(Vanishing, bool)]) -> Vec<Vanishing> {
        let wide = WIDE * (1.0 + norm(&self.here.x));
        let affine = self.map.is_piecewise_affine();
        if affine {
            let total = self.setup.layout.total();
            self.buffers.gradient_norms.resize(total, f64::NAN);
        }
        let mut near = Vec::new();
        let mut last = None;
        let mut is_new = |site: usize| last.replace(site) != Some(site);
        for (v, _) in facets.iter().filter(|(v, _)| is_new(v.site)) {
            let cell = self.map.cell(v.site, self.path.selection.piece(v.site));
            let range = self.setup.layout.range(v.site);
            for k in range.clone() {
                if cell.iter().any(|f| range.start + f.test() == k) {
                    continue;
                }
                if affine && self.here.theta[k].abs() > wide * self.buffers.gradient_norms[k] {
                    continue;
                }
                let other = self.test_here(k);
                if affine {
                    self.buffers.gradient_norms[k] = other.gradient_norm;
                }
                if self.here.theta[k].abs() <= wide * other.gradient_norm {
                    near.push(other);
                }
            }
        }
        near
    }

    /// Rounding at `here`, where the curve came from `next`.
    pub(in crate::continuation) fn rounding_here(&mut self) -> Result<Rounding, ContinuationError> {
        let [x, t, before] = [&self.here.x, &self.here.t, &self.next.x].map(Clone::clone);
        self.rounding_at((&x, &t), &before)
    }

    /// Rounding at a point with its tangent, which was computed from the one before and has its rounding errors where it is itself near zero.
    pub(in crate::continuation) fn rounding_at(
        &mut self,
        (x, t): (&[f64], &[f64]),
        before: &[f64],
    ) -> Result<Rounding, ContinuationError> {
        let pairs = x.iter().zip(before);
        let sizes: Vec<f64> = pairs.map(|(a, b)| a.abs().max(b.abs())).collect();
        let at = (self.corrector).linearize_again(&self.map, &self.path.selection, x, Some(t));
        let noise = match if_solved(at)? {
            Some(mut at) => if_solved(at.noise(&self.map, (x, &sizes), t))?,
            None => None,
        };
        Ok(match noise {
            Some(moves) => Rounding::Measured { moves, sizes },
            // The selection is singular here: the point is good to the distance at which test functions count as vanishing.
            None => Rounding::Distance(self.setup.options.vanishing_distance * (1.0 + norm(x))),
        })
    }
}

/// Bounds of the rounding errors of test functions at a located point.
pub(in crate::continuation) enum Rounding {
    Measured { moves: [Vec<f64>; 2], sizes: Vec<f64> },
    Distance(f64),
}

impl Rounding {
    pub(in crate::continuation) fn of(&self, v: &Vanishing) -> f64 {
        match self {
            Self::Distance(distance) => distance * v.gradient_norm,
            Self::Measured { moves, sizes } => {
                let moved = moves.iter().map(|m| v.rate(m).abs()).fold(0.0, f64::max);
                let terms: f64 = v.gradient.iter().zip(sizes).map(|(g, s)| g.abs() * s).sum();
                SAFETY * (moved + f64::EPSILON * terms)
            }
        }
    }
}

/// Facets of the cell of a selection which do not vanish hold on its curve: a θ of the wrong sign is a rounding error.
pub(in crate::continuation) fn keep_inside(
    map: &dyn PiecewiseSmooth,
    layout: &TestLayout,
    selection: &Selection,
    vanishing: &[usize],
    theta: &mut [f64],
) {
    for site in 0..layout.num_sites() {
        let first = layout.range(site).start;
        for facet in map.cell(site, selection.piece(site)) {
            let k = first + facet.test();
            if facet.sign() * theta[k] <= 0.0 && vanishing.binary_search(&k).is_err() {
                theta[k] = facet.sign() * f64::MIN_POSITIVE;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::keep_inside;
    use crate::continuation::testing::{Function, Plane};
    use crate::piecewise::{Facet, Selection, TestLayout};

    #[test]
    fn facets_that_do_not_vanish_hold() {
        let line: Function = |y, _| [y, 1.0, 0.0];
        let mut map = Plane::within(line, &[line; 4]);
        map.cells = vec![vec![Facet::positive(0), Facet::negative(1), Facet::positive(2)]];
        let mut theta = [-1e-17, 0.0, -2e-17, -3.0];
        keep_inside(
            &map,
            &TestLayout::new(&map),
            &Selection::uniform(1, 0),
            &[2],
            &mut theta,
        );
        assert!(theta[0] > 0.0 && theta[0] < 1e-300 && theta[1] < 0.0 && theta[1] > -1e-300);
        // Values that vanish, and those that belong to no facet of the cell, are not changed.
        assert_eq!(theta[2..], [-2e-17, -3.0]);
    }

    /// Along y = 0 to the facet α = 0: of the other tests of its site those vanish there whose zero is the same point, and not those whose
    /// zero is a ten-millionth away.
    #[test]
    fn other_tests_of_a_site_vanish_at_the_same_point() {
        let same: Function = |y, a| [a - 2.0 * y, -2.0, 1.0];
        let behind: Function = |y, a| [a - 2.0 * y - 1e-7, -2.0, 1.0];
        for (other, expected) in [(same, vec![0, 1]), (behind, vec![0])] {
            let map = Plane {
                pieces: vec![|y, _| [y, 1.0, 0.0]; 3],
                tests: vec![|_, a| [-a, 0.0, -1.0], other],
                cells: vec![
                    vec![Facet::positive(0)],
                    vec![Facet::negative(0), Facet::positive(1)],
                    vec![Facet::negative(0), Facet::negative(1)],
                ],
                affine: false,
            };
            let mut run = map.curve(0.0, -0.5);
            let curve = run.curve.erased_mut();
            curve.step_to([0.0, 0.0], [0.0, 1.0]);
            std::mem::swap(&mut curve.here, &mut curve.next);
            let met = curve.met_together(0).unwrap();
            assert_eq!(met.iter().map(|v| v.index).collect::<Vec<_>>(), expected);
        }
    }
}
