//! Continua of a proven list, what belongs to them, and points within their bounds.

use super::{Gathered, Pieces};
use crate::enumeration::exhaustive::{self, ExactPoint};
use crate::enumeration::lists::{Continuum, Extent};
use crate::enumeration::shape::Shape;
use crate::piecewise::{ExactForm, ExactSite, Selection};

impl Gathered<'_> {
    pub(super) fn continuum(
        &mut self,
        pieces: &[usize],
        (dimension, extent): (usize, Option<Extent<ExactPoint>>),
        shape: Option<Shape>,
    ) {
        let selection = Selection::from_pieces(pieces.iter().copied());
        let agrees = |other: &Option<Extent<ExactPoint>>| {
            let both = extent.as_ref().zip(other.as_ref());
            both.is_some_and(|(own, other)| own.agrees(other, |a, b| a == b))
        };
        if let Some(k) = self.extents.iter().position(agrees) {
            return self.continua[k].selections.push(selection);
        }
        let at = |p: &ExactPoint| self.full(self.within(pieces, p.to_f64()));
        let ends = shape.iter().flat_map(|s| &s.ends).map(at).collect();
        let known = self.known;
        self.continua.push(Continuum {
            selections: vec![selection],
            dimension,
            point: shape.as_ref().map_or_else(Vec::new, |s| at(&s.point)),
            ends,
            directions: shape
                .as_ref()
                .map_or_else(Vec::new, |s| s.directions_to_f64(known)),
            described: shape.as_ref().is_some_and(|s| s.described),
        });
        self.extents.push(extent);
        self.shapes.push(shape);
    }

    /// Drops continua that are faces of others, or the same. A point inside of one lies in the other, if it
    /// does so at each site.
    pub(super) fn drop_faces(&mut self) {
        let first = |c: &Continuum| -> Vec<usize> { c.selections[0].pieces().collect() };
        let pieces: Vec<Vec<usize>> = self.continua.iter().map(first).collect();
        let active = |s: &Option<Shape>| s.as_ref().map(|s| exhaustive::active(self.conditions, &s.point));
        let active: Vec<Option<Pieces>> = self.shapes.iter().map(active).collect();
        let lies_in = |inner: usize, outer: usize| {
            let meets = |a: &Pieces| a.iter().zip(&pieces[outer]).all(|(a, p)| a.contains(p));
            active[inner].as_ref().is_some_and(meets)
                && self.shapes[inner]
                    .as_ref()
                    .is_some_and(|s| s.lies_in(self.conditions, &pieces[outer]))
        };
        let mut dropped = vec![false; self.continua.len()];
        let mut merged = Vec::new();
        for inner in 0..dropped.len() {
            let mut others = (0..dropped.len()).filter(|&o| o != inner && !dropped[o]);
            if let Some(outer) = others.find(|&outer| lies_in(inner, outer)) {
                dropped[inner] = true;
                if self.continua[inner].dimension == self.continua[outer].dimension {
                    merged.push((inner, outer));
                }
            }
        }
        for (inner, outer) in merged {
            let selections = std::mem::take(&mut self.continua[inner].selections);
            self.continua[outer].selections.extend(selections);
        }
        let mut next = dropped.iter();
        self.continua.retain(|_| next.next() == Some(&false));
        let mut next = dropped.iter();
        self.extents.retain(|_| next.next() == Some(&false));
        let mut next = dropped.iter();
        self.shapes.retain(|_| next.next() == Some(&false));
    }

    /// For each solution the first continuum to which it belongs. One found by error bounds alone lies in the
    /// interior of its cell.
    pub(super) fn on_continua(&self) -> Vec<Option<usize>> {
        let own = |c: &Continuum| c.selections.iter().map(|s| s.pieces().collect()).collect();
        let pieces: Vec<Pieces> = self.continua.iter().map(own).collect();
        let of = |p: &ExactPoint| {
            let inside = |own: &Pieces| own.iter().any(|h| exhaustive::contains(self.conditions, h, p));
            pieces.iter().position(inside)
        };
        self.points.iter().map(|p| p.as_ref().and_then(of)).collect()
    }

    /// Drops points that are solutions of singular selections only, where they belong to a continuum of
    /// another one.
    pub(in crate::enumeration) fn drop_points_of_continua(&mut self) {
        let on_continua = self.on_continua();
        let kept = self.solutions.iter().zip(on_continua).map(|(s, continuum)| {
            let singular = s.det_signs.iter().all(|d| *d == Some(0));
            !(singular && continuum.is_some())
        });
        let kept: Vec<bool> = kept.collect();
        let mut next = kept.iter();
        self.solutions.retain(|_| next.next() == Some(&true));
        let mut next = kept.iter();
        self.points.retain(|_| next.next() == Some(&true));
    }

    /// A rounded point of the cell of a selection within the conditions of the cell on single unknowns: no
    /// point lies beyond a bound.
    pub(super) fn within(&self, pieces: &[usize], mut y: Vec<f64>) -> Vec<f64> {
        for (site, bounds) in self.bounds.iter().enumerate().filter(|b| !b.1.is_empty()) {
            let Some(piece) = exhaustive::piece_of(self.conditions, site, pieces[site]) else {
                continue;
            };
            for &(form, k, bound) in bounds {
                let rises = self.conditions.sites[site].forms[form].coefficients[k].sign();
                if piece.equalities.iter().any(|e| e.1 == form) {
                    y[k] = bound;
                }
                for facet in piece.facets.iter().filter(|f| f.0 == form) {
                    y[k] = match facet.1 * rises > 0 {
                        true => y[k].max(bound),
                        false => y[k].min(bound),
                    };
                }
            }
        }
        y
    }
}

/// The forms of a site that are those of one unknown alone: the form, the unknown, and where it vanishes.
pub(super) fn bounds_of(site: &ExactSite) -> Vec<(usize, usize, f64)> {
    let single = |(form, f): (usize, &ExactForm)| {
        let mut used = f.coefficients.iter().enumerate().filter(|c| !c.1.is_zero());
        let (k, factor) = used.next()?;
        // Bounds of −0 and 0 are the same.
        let bound = 0.0 - f.constant.to_f64() / factor.to_f64();
        (used.next().is_none() && bound.is_finite()).then_some((form, k, bound))
    };
    site.forms.iter().enumerate().filter_map(single).collect()
}
