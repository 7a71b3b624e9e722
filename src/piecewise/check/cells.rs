//! Cells, and what happens on their boundaries.

use super::FindingKind;
use super::session::{Place, Session};
use crate::piecewise::{ActiveSet, PiecewiseSmoothExt, Selection, cell_margin};
use crate::sparse::Matrix;
use crate::tolerances::RESULT;

/// Each sample is joined to this many samples after it in the search for boundaries.
const NEIGHBOURS: usize = 6;

impl Session<'_> {
    /// Whether the cells tile at a sample; the selection there, unless it lies outside the domain or no selection is known.
    pub(super) fn cells(&mut self, point: usize) -> Option<Selection> {
        let theta = self.theta(&self.samples[point]);
        let map = self.map;
        if let Some(k) = theta.iter().position(|t| !t.is_finite()) {
            let (site, test) = self.layout.locate(k);
            let place = Place::at(point).site(site);
            let what = format!("test function {test}");
            self.find(FindingKind::NotFinite, place, 0.0, theta[k], &what);
            return None;
        }
        let mut selection = Selection::uniform(map.num_sites(), 0);
        let (mut outside, mut known) = (false, true);
        for site in 0..map.num_sites() {
            let tests = &theta[self.layout.range(site)];
            let pieces = 0..map.num_pieces(site);
            let margins: Vec<f64> = pieces.map(|p| cell_margin(map.cell(site, p), tests)).collect();
            let mut inside = (0..margins.len()).filter(|&p| margins[p] > 0.0);
            let place = Place::at(point).site(site);
            match (inside.next(), inside.next()) {
                (Some(piece), None) => selection.set(site, piece),
                (Some(first), Some(second)) => {
                    let what = format!("pieces there ({} is another)", map.piece_name(site, first));
                    let count = margins.iter().filter(|m| **m > 0.0).count();
                    self.find(
                        FindingKind::Overlap,
                        place.piece(second),
                        1.0,
                        count as f64,
                        &what,
                    );
                    known = false;
                }
                (None, _) => {
                    let walled = |p: usize| {
                        let mut facets = map.cell(site, p).iter();
                        facets.all(|f| f.is_wall() || f.margin(tests) > 0.0)
                    };
                    if (0..margins.len()).any(walled) {
                        outside = true;
                    } else if let Some(piece) = margins.iter().position(|m| *m == 0.0) {
                        selection.set(site, piece);
                    } else {
                        self.find(
                            FindingKind::Gap,
                            place,
                            1.0,
                            0.0,
                            "pieces in whose cell the point lies",
                        );
                        known = false;
                    }
                }
            }
        }
        if outside {
            self.report.outside += 1;
            return None;
        }
        self.report.points += 1;
        known.then_some(selection)
    }

    /// Looks for kinks between samples in different cells and compares the selections that meet there.
    pub(super) fn continuity(&mut self, inside: &[(usize, Selection)]) {
        for (i, (point, from)) in inside.iter().enumerate() {
            for (other, to) in inside.iter().skip(i + 1).take(NEIGHBOURS) {
                let (a, b) = (&self.samples[*point], &self.samples[*other]);
                let (ta, tb) = (self.theta(a), self.theta(b));
                let (ra, rb) = (self.residual(from, a), self.residual(to, b));
                let size: Vec<f64> = ra.iter().zip(&rb).map(|(a, b)| a.abs().max(b.abs())).collect();
                for site in from.differing_sites(to) {
                    for k in self.layout.range(site) {
                        if ta[k] * tb[k] >= 0.0 {
                            continue;
                        }
                        if let Some(y) = self.boundary(a, b, k) {
                            self.compare(*point, site, k, &y, &size);
                        }
                        if self.full() {
                            return;
                        }
                    }
                }
            }
        }
    }

    /// A point between a and b where test function k vanishes, by bisection.
    fn boundary(&self, a: &[f64], b: &[f64], k: usize) -> Option<Vec<f64>> {
        let on = |s: f64| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a + s * (b - a)).collect() };
        let positive = self.theta(a)[k] > 0.0;
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            let theta = self.theta(&on(middle))[k];
            if theta.is_nan() {
                return None;
            }
            if (theta > 0.0) == positive {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(on(high))
    }

    /// Compares the residuals of the pieces of `site` that meet where test function k vanishes.
    fn compare(&mut self, point: usize, site: usize, k: usize, y: &[f64], size: &[f64]) {
        let theta = self.theta(y);
        let active = ActiveSet::from_tests(self.map, &self.layout, &theta, vec![k]);
        let Some((_, pieces)) = active.degenerate_sites().iter().find(|d| d.0 == site) else {
            return;
        };
        if !active.outside().is_empty() {
            return;
        }
        self.report.boundaries += 1;
        let first = self.residual(active.first(), y);
        for &piece in &pieces[1..] {
            let mut selection = active.first().clone();
            selection.set(site, piece);
            let second = self.residual(&selection, y);
            for i in 0..first.len() {
                let scale = size[i].max(first[i].abs()).max(second[i].abs());
                let jump = (second[i] - first[i]).abs();
                if jump > self.options.continuity_tolerance * scale || jump.is_nan() {
                    let what = format!(
                        "residual {i} where test function {} vanishes, of piece {} and of this one",
                        self.layout.locate(k).1,
                        self.map.piece_name(site, pieces[0]),
                    );
                    let place = Place::at(point).site(site).piece(piece);
                    self.find(FindingKind::Discontinuity, place, first[i], second[i], &what);
                }
            }
        }
    }

    /// Rows outside `site_rows` must not depend on the piece of the site; the others must agree with those of the whole Jacobian.
    pub(super) fn site_rows(&mut self, point: usize, here: &Selection) {
        let (map, x) = (self.map, &self.samples[point]);
        let n = map.num_residuals();
        let differs = |a: f64, b: f64| (a - b).abs() > RESULT * a.abs().max(b.abs());
        let base = self.residual(here, x);
        let mut rows = Vec::new();
        let mut jac = Matrix::zeros(map.pattern());
        map.jacobian(here, x, &mut jac);
        let mut other = jac.clone();
        for site in 0..map.num_sites() {
            map.site_rows(site, &mut rows);
            let mut foreign = vec![true; n];
            rows.iter().for_each(|&r| foreign[r] = false);
            other.clear();
            if map.site_jacobian(site, here, x, &mut other) {
                let place = Place::at(point).site(site);
                for ((i, j, a), &b) in jac.triplets().zip(other.values()) {
                    let expected = if foreign[i] { 0.0 } else { a };
                    if differs(expected, b) {
                        self.find(
                            FindingKind::SiteRows,
                            place.entry(i, j),
                            expected,
                            b,
                            "site_jacobian",
                        );
                    }
                }
            }
            if !foreign.contains(&true) {
                continue;
            }
            for piece in (0..map.num_pieces(site)).filter(|&p| p != here.piece(site)) {
                let mut selection = here.clone();
                selection.set(site, piece);
                let place = Place::at(point).site(site).piece(piece);
                let kind = FindingKind::SiteRows;
                let r = self.residual(&selection, x);
                for i in (0..n).filter(|&i| foreign[i] && differs(r[i], base[i])) {
                    self.find(kind, place, base[i], r[i], &format!("residual {i}"));
                }
                other.clear();
                map.jacobian(&selection, x, &mut other);
                for ((i, j, a), b) in jac.triplets().zip(other.values()) {
                    if foreign[i] && differs(a, *b) {
                        self.find(kind, place.entry(i, j), a, *b, "Jacobian");
                    }
                }
            }
        }
    }
}
