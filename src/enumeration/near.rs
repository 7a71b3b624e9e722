//! The exact point approximated by a rounded one: where all forms that count as vanishing do vanish, and which others do.

use super::Doubt;
use super::enclosure::{Enclosure, Error};
use super::exhaustive::{self, ExactPoint};
use super::stated::{Scaling, forms, stated_conditions};
use crate::clock::Deadline;
use crate::exact::{Dictionary, Exact, Halt};
use crate::piecewise::{
    ExactConditions, ExactForm, ExactPiece, ExactSite, PiecewiseSmooth, PiecewiseSmoothExt,
};

/// Coefficients up to which arms are proven: error bounds need dense matrices.
const MAX_COEFFICIENTS: usize = 1 << 18;

/// The conditions of a curve as polynomials of d, the difference of (y, α) to the point given.
pub(super) struct Near {
    /// Forms of d. Where coefficients depend on α those of the products of d_α with the other components follow.
    conditions: ExactConditions,
    /// How many of the unknowns are those of the map.
    pub(super) known: usize,
}

/// The exact point.
pub(super) struct Point {
    /// Bounds of |d|.
    pub(super) reach: Vec<f64>,
    /// d, where it had to be found exactly.
    exact: Option<ExactPoint>,
    /// Signs of the forms of each site, as far as they are decided.
    signs: Vec<Vec<Option<i8>>>,
}

/// The conditions of the directions (ẏ, α̇) at a point: forms of ẏ for α̇ = 1.
pub(super) struct Directions {
    pub(super) conditions: ExactConditions,
    /// Error bounds of the numbers of the forms; empty where they are exact.
    pub(super) errors: Vec<ExactForm>,
}

impl Near {
    /// Sizes of the unknowns in which the conditions are balanced.
    pub(super) fn units(&self) -> Vec<f64> {
        Scaling::of(&self.conditions).unscaled(&vec![1.0; self.conditions.unknowns])
    }

    /// `None` where the map does not state its conditions as functions of α.
    pub(super) fn new(map: &dyn PiecewiseSmooth, x: &[f64]) -> Option<Self> {
        if !map.exact()?.is_affine_in_parameter() {
            return None;
        }
        let (alpha, y) = x.split_last()?;
        let known = y.len();
        let mut conditions = stated_conditions(map, *alpha, MAX_COEFFICIENTS)?;
        let y = extended(&conditions, y)?;
        // α less the power of two below it is a floating-point number.
        let shift = Exact::new(*alpha)?.magnitude().map_or(0, |m| m - 1);
        let step = Exact::one().shifted(shift).to_f64().copysign(*alpha);
        let before = stated_conditions(map, alpha - step, MAX_COEFFICIENTS)?;
        let same = |(a, b): (&ExactSite, &ExactSite)| a.forms.len() == b.forms.len();
        if conditions.common.len() != before.common.len()
            || !conditions.sites.iter().zip(&before.sites).all(same)
        {
            return None;
        }
        let rate = |a: &Exact, b: &Exact| {
            let rate = (a - b).shifted(-shift);
            if step < 0.0 { -&rate } else { rate }
        };
        let moved = |form: &ExactForm, before: &ExactForm| {
            let both = form.coefficients.iter().zip(&before.coefficients);
            let bends: Vec<Exact> = both.map(|(a, b)| rate(a, b)).collect();
            let constant = at(&form.constant, &form.coefficients, &y);
            let slope = at(&rate(&form.constant, &before.constant), &bends, &y);
            let mut coefficients = form.coefficients.clone();
            coefficients.push(slope);
            if bends.iter().any(|b| !b.is_zero()) {
                coefficients.extend(bends);
            }
            ExactForm {
                constant,
                coefficients,
            }
        };
        let all = |list: &mut Vec<ExactForm>, before: &[ExactForm]| {
            for (form, before) in list.iter_mut().zip(before) {
                *form = moved(form, before);
            }
        };
        all(&mut conditions.common, &before.common);
        for (site, before) in conditions.sites.iter_mut().zip(&before.sites) {
            all(&mut site.forms, &before.forms);
        }
        conditions.unknowns += 1;
        conditions.bounds.clear();
        Some(Self { conditions, known })
    }

    /// Bounds of the distance from the point given, in the variables of the map.
    pub(super) fn distance(&self, point: &Point) -> Vec<f64> {
        let mut reach = point.reach[..self.known].to_vec();
        reach.extend(point.reach.last());
        reach
    }

    /// Whether the pieces of a site agree where they meet.
    pub(super) fn is_continuous(&self, site: usize) -> bool {
        exhaustive::is_continuous(&self.conditions, site)
    }

    fn bends(&self, form: &ExactForm) -> Vec<Exact> {
        form.coefficients[self.conditions.unknowns..].to_vec()
    }

    /// The point at which all equalities of the given pieces hold, found exactly if requested.
    pub(super) fn point(
        &self,
        active: &[Vec<usize>],
        exactly: bool,
        deadline: Deadline<'_>,
    ) -> Result<Option<Point>, Doubt> {
        let common = (0..self.conditions.common.len()).collect::<Vec<usize>>();
        let (mut rows, mut vanishing) = (common, Vec::new());
        let mut next = rows.len();
        for (site, (exact, pieces)) in self.conditions.sites.iter().zip(active).enumerate() {
            let mut zero: Vec<usize> = Vec::new();
            for piece in pieces {
                let piece = exhaustive::piece_of(&self.conditions, site, *piece);
                zero.extend(piece.iter().flat_map(|p| p.equalities.iter().map(|e| e.1)));
            }
            zero.sort_unstable();
            zero.dedup();
            let kept = match pieces.len() {
                1 => zero.clone(),
                _ => self.independent(exact, &zero).map_err(|_| Doubt::Coincidence)?,
            };
            rows.extend(kept.iter().map(|k| next + k));
            vanishing.push(zero);
            next += exact.forms.len();
        }
        if exactly {
            return self.exact_point(&rows, &vanishing, deadline).map(Some);
        }
        Ok(self.enclosed_point(&rows, &vanishing, deadline))
    }

    /// An independent subset of some forms of a site: where these vanish, all do.
    fn independent(&self, site: &ExactSite, zero: &[usize]) -> Result<Vec<usize>, Halt> {
        let m = self.conditions.unknowns;
        let width = site.forms.iter().map(|f| f.coefficients.len()).max().unwrap_or(m);
        let wide = |form: &ExactForm| {
            let mut form = form.clone();
            form.coefficients.resize(width, Exact::default());
            form
        };
        // Forms that do not depend on α come first: they vanish times d_α, too.
        let (mut order, later): (Vec<usize>, Vec<usize>) = zero
            .iter()
            .partition(|k| site.forms[**k].coefficients[m - 1..].iter().all(Exact::is_zero));
        let level = order.len();
        order.extend(later);
        let mut rows: Vec<ExactForm> = order.iter().map(|k| wide(&site.forms[*k])).collect();
        if width > m {
            for k in 0..level {
                let mut product = ExactForm::zero(width);
                product.coefficients[m - 1].clone_from(&rows[k].constant);
                product.coefficients[m..].clone_from_slice(&rows[k].coefficients[..m - 1]);
                rows.push(product);
            }
        }
        let given = rows.iter().map(|f| (&f.constant, f.coefficients.as_slice()));
        let mut table = Dictionary::new(width, given);
        let mut kept = Vec::new();
        for (row, &form) in order.iter().enumerate() {
            if table.fix(row)?.is_some() {
                kept.push(form);
                if row < level && width > m {
                    table.fix(order.len() + row)?;
                }
            }
        }
        Ok(kept)
    }

    /// The point between error bounds, where these prove that there is one and only one.
    fn enclosed_point(
        &self,
        rows: &[usize],
        vanishing: &[Vec<usize>],
        deadline: Deadline<'_>,
    ) -> Option<Point> {
        let m = self.conditions.unknowns;
        let scaling = Scaling::of(&self.conditions);
        let all: Vec<&ExactForm> = forms(&self.conditions).collect();
        // The coefficients in form k of products of d_α with other components, scaled.
        let products = |k: usize| -> Vec<f64> {
            let bends = all[k].coefficients[m..].iter().enumerate();
            bends
                .map(|(j, b)| b.scaled(scaling.product(k, [j, m - 1])).abs())
                .collect()
        };
        let (mut matrix, mut constants) = (Vec::new(), Vec::new());
        for &k in rows {
            let form = scaling.form(k, all[k]);
            matrix.extend(form.coefficients);
            constants.push(form.constant);
        }
        if rows.len() == m - 1 {
            // One condition less than unknowns: the curve at this α.
            matrix.extend((0..m).map(|j| f64::from(u8::from(j == m - 1))));
            constants.push(0.0);
        }
        if constants.len() != m {
            return None;
        }
        let mut found = Enclosure::of(&matrix, &constants, &[], deadline)?;
        let bent = |k: &usize| all[*k].coefficients.len() > m;
        if rows.iter().any(bent) {
            // For d in this box the products perturb the coefficients by this much: a solution in it exists (Brouwer) and is unique.
            let within: Vec<f64> = found.reach().iter().map(|r| 2.0 * r).collect();
            let error = |k: &usize| {
                let b = products(*k);
                let along = b.iter().fold(0.0f64, |a, b| a.max(b * within[m - 1]));
                let across: f64 = b.iter().zip(&within).map(|(b, r)| b * r).sum();
                Error {
                    coefficients: 1.001 * along.max(across),
                    constant: 0.0,
                }
            };
            let errors: Vec<Error> = rows.iter().map(error).collect();
            found = Enclosure::of(&matrix, &constants, &errors, deadline)?;
            if found.reach().iter().zip(&within).any(|(r, w)| r > w) {
                return None;
            }
        }
        let reach = found.reach();
        let sign = |k: usize| {
            let form = scaling.form(k, all[k]);
            let products = products(k);
            if !products.is_empty() && form.coefficients.iter().all(|a| *a == 0.0) {
                return None;
            }
            let across: f64 = products.iter().zip(&reach).map(|(b, r)| b * r).sum();
            let error = Error {
                coefficients: 0.0,
                constant: 1.001 * across * reach[m - 1],
            };
            found.sign_of(&form.coefficients, form.constant, error)
        };
        let unscaled = scaling.unscaled(&reach);
        unscaled.iter().all(|r| r.is_finite()).then(|| Point {
            reach: unscaled,
            exact: None,
            signs: self.signs(vanishing, sign),
        })
    }

    fn exact_point(
        &self,
        rows: &[usize],
        vanishing: &[Vec<usize>],
        deadline: Deadline<'_>,
    ) -> Result<Point, Doubt> {
        let m = self.conditions.unknowns;
        let all: Vec<&ExactForm> = forms(&self.conditions).collect();
        let linear = |k: &usize| ExactForm {
            constant: all[*k].constant.clone(),
            coefficients: all[*k].coefficients[..m].to_vec(),
        };
        let system = ExactConditions {
            unknowns: m,
            common: rows.iter().map(linear).collect(),
            ..ExactConditions::default()
        };
        let point = exhaustive::common_point(&system, deadline).map_err(|halt| match halt {
            Halt::Late => Doubt::Limit,
            Halt::Infeasible => Doubt::Coincidence,
        })?;
        let bent = all.iter().any(|f| f.coefficients.len() > m);
        if bent && !point.coordinate(m - 1).0.is_zero() {
            return Err(Doubt::Rounding);
        }
        Ok(Point {
            reach: point.to_f64().iter().map(|d| d.abs()).collect(),
            signs: self.signs(vanishing, |k| Some(point.sign_of(all[k]))),
            exact: Some(point),
        })
    }

    /// Signs of the forms of all sites, of which some are known to vanish.
    fn signs(&self, vanishing: &[Vec<usize>], sign: impl Fn(usize) -> Option<i8>) -> Vec<Vec<Option<i8>>> {
        let mut next = self.conditions.common.len();
        let site = |(exact, zero): (&ExactSite, &Vec<usize>)| {
            let first = next;
            next += exact.forms.len();
            let one = |form: usize| {
                if zero.contains(&form) {
                    Some(0)
                } else {
                    sign(first + form)
                }
            };
            (0..exact.forms.len()).map(one).collect()
        };
        self.conditions.sites.iter().zip(vanishing).map(site).collect()
    }

    /// The pieces of each site that are active at a point; `None` where that is not decided.
    pub(super) fn active(&self, point: &Point) -> Option<Vec<Vec<usize>>> {
        let holds = |signs: &[Option<i8>], piece: &ExactPiece| {
            let zero = piece.equalities.iter().map(|e| (e.1, 0));
            let all = zero.chain(piece.facets.iter().copied());
            let met = |(form, wanted): (usize, i8)| signs[form].map(|s: i8| s == 0 || s == wanted);
            let each: Vec<Option<bool>> = all.map(met).collect();
            if each.contains(&Some(false)) {
                return Some(false);
            }
            (!each.contains(&None)).then_some(true)
        };
        let site = |(exact, signs): (&ExactSite, &Vec<Option<i8>>)| -> Option<Vec<usize>> {
            let mut active = Vec::new();
            for piece in &exact.pieces {
                if holds(signs, piece)? {
                    active.push(piece.piece);
                }
            }
            Some(active)
        };
        self.conditions.sites.iter().zip(&point.signs).map(site).collect()
    }

    /// The directional problem of the given pieces at a point.
    pub(super) fn directions(&self, point: &Point, active: &[Vec<usize>]) -> Directions {
        let n = self.conditions.unknowns - 1;
        let values = point
            .exact
            .as_ref()
            .map(|p| (0..n).map(|k| p.coordinate(k)).collect::<Vec<_>>());
        let unit = values
            .as_ref()
            .and_then(|v| v.first())
            .map_or_else(Exact::one, |v| v.1.clone());
        let gradient = |form: &ExactForm| {
            let linear = ExactForm {
                constant: form.coefficients[n].clone(),
                coefficients: form.coefficients[..n].to_vec(),
            };
            let Some(values) = values.as_ref().filter(|_| form.coefficients.len() > n + 1) else {
                return linear;
            };
            // Times the denominator, which is positive.
            let mut whole = ExactForm::zero(n).plus(&unit, &linear);
            for (bend, (value, _)) in self.bends(form).iter().zip(values) {
                whole.constant = &whole.constant + &(bend * value);
            }
            whole
        };
        let bound = |r: &f64| Exact::new(1.001 * r).unwrap_or_default();
        let reach: Vec<Exact> = point.reach.iter().map(bound).collect();
        let error = |form: &ExactForm| {
            let mut error = ExactForm::zero(n);
            for (j, bend) in self.bends(form).iter().enumerate() {
                let bend = bend.abs();
                error.constant = &error.constant + &(&bend * &reach[j]);
                error.coefficients[j] = &bend * &reach[n];
            }
            error
        };
        let bent = forms(&self.conditions).any(|f| f.coefficients.len() > n + 1);
        let errors = if bent && values.is_none() {
            forms(&self.conditions).map(error).collect()
        } else {
            Vec::new()
        };
        let site = |(k, exact): (usize, &ExactSite)| {
            let vanishes = |form: usize| point.signs[k][form] == Some(0);
            directional(exact, &active[k], vanishes, gradient)
        };
        Directions {
            conditions: ExactConditions {
                unknowns: n,
                common: self.conditions.common.iter().map(gradient).collect(),
                sites: self.conditions.sites.iter().enumerate().map(site).collect(),
                bounds: Vec::new(),
            },
            errors,
        }
    }
}

/// The site of the directional problem: the active pieces, and those of their facets on which the point lies.
pub(super) fn directional(
    exact: &ExactSite,
    active: &[usize],
    vanishes: impl Fn(usize) -> bool,
    gradient: impl Fn(&ExactForm) -> ExactForm,
) -> ExactSite {
    let pieces = exact.pieces.iter().filter(|p| active.contains(&p.piece));
    let bounded = |list: &[(usize, i8)]| list.iter().copied().filter(|f| vanishes(f.0)).collect();
    ExactSite {
        forms: exact.forms.iter().map(gradient).collect(),
        pieces: pieces
            .map(|p| ExactPiece {
                piece: p.piece,
                equalities: p.equalities.clone(),
                facets: bounded(&p.facets),
            })
            .collect(),
        implied: bounded(&exact.implied),
    }
}

/// A point given in the unknowns of the map, with the auxiliary unknowns computed from them one after the other, rounded.
fn extended(conditions: &ExactConditions, y: &[f64]) -> Option<Vec<Exact>> {
    let mut all: Vec<Exact> = y.iter().map(|v| Exact::new(*v)).collect::<Option<_>>()?;
    if all.len() == conditions.unknowns {
        return Some(all);
    }
    let used = |row: usize| {
        let equalities = conditions
            .sites
            .iter()
            .flat_map(|s| &s.pieces)
            .flat_map(|p| &p.equalities);
        equalities.into_iter().any(|e| e.0 == row)
    };
    // The common rows are those that no equality of a piece replaces.
    let mut common = (0..conditions.unknowns)
        .filter(|row| !used(*row))
        .zip(&conditions.common);
    let mut given: Vec<Option<&ExactForm>> = vec![None; conditions.unknowns];
    common.by_ref().for_each(|(row, form)| given[row] = Some(form));
    for k in all.len()..conditions.unknowns {
        let form = given[k].or_else(|| {
            let inside = |site: &&ExactSite, p: &&ExactPiece| {
                let met = |f: &(usize, i8)| {
                    at(&site.forms[f.0].constant, &site.forms[f.0].coefficients, &all).sign() * f.1 >= 0
                };
                p.facets.iter().all(met)
            };
            conditions.sites.iter().find_map(|site| {
                let own = |p: &ExactPiece| p.equalities.iter().find(|e| e.0 == k).map(|e| e.1);
                let piece = site
                    .pieces
                    .iter()
                    .find(|p| own(p).is_some() && inside(&site, p))?;
                Some(&site.forms[own(piece)?])
            })
        })?;
        let rest = at(&form.constant, &form.coefficients[..k], &all);
        all.push(Exact::new(-rest.to_f64() / form.coefficients[k].to_f64())?);
    }
    Some(all)
}

/// constant + Σ coefficients · y.
fn at(constant: &Exact, coefficients: &[Exact], y: &[Exact]) -> Exact {
    let terms = coefficients.iter().zip(y).filter(|t| !t.0.is_zero());
    terms.fold(constant.clone(), |sum, (a, y)| &sum + &(a * y))
}
