//! The affine forms of a map that gives them exactly, rounded for the search.

use super::enclosure::Error;
use super::system::{Piece, Site, System};
use super::table::Form;
use crate::exact::Exact;
use crate::piecewise::{
    ExactConditions, ExactForm, ExactSite, PiecewiseSmooth, PiecewiseSmoothExt, TestLayout,
};

/// Radius up to which the scaled forms, and with them unbounded unknowns, are searched; the region beyond is searched as directions.
const FAR: f64 = 131_072.0;

/// The exact conditions of a map's pieces, unless they have more than the given number of coefficients.
pub(super) fn stated_conditions(
    map: &dyn PiecewiseSmooth,
    alpha: f64,
    limit: usize,
) -> Option<ExactConditions> {
    let (n, rows) = (
        map.num_residuals(),
        map.num_residuals() + TestLayout::new(map).total(),
    );
    if n.saturating_mul(rows) > limit {
        return None;
    }
    let conditions = map.exact()?.conditions(alpha)?;
    let unknowns = conditions.unknowns;
    if unknowns.saturating_mul(forms(&conditions).count()) > limit {
        return None;
    }
    let fits = |f: &ExactForm| f.coefficients.len() == unknowns;
    let sites = conditions.sites.len() == map.num_sites()
        && conditions.sites.iter().enumerate().all(|(site, s)| {
            let known = |form: usize| form < s.forms.len();
            let signed = |f: &(usize, i8)| known(f.0) && matches!(f.1, 1 | -1);
            let pieces = s.pieces.iter().all(|p| {
                p.piece < map.num_pieces(site)
                    && p.equalities.iter().all(|e| e.0 < unknowns && known(e.1))
                    && p.facets.iter().all(signed)
            });
            pieces && s.implied.iter().all(signed) && s.forms.iter().all(fits)
        });
    let fit = unknowns >= n && conditions.common.iter().all(fits) && sites;
    fit.then_some(conditions)
}

/// Powers of two by which forms, unknowns and constants are multiplied so that all are of size one: y_k = 2^(columns_k − constants) z_k.
#[derive(Debug, Clone, Default)]
pub(super) struct Scaling {
    rows: Vec<i64>,
    columns: Vec<i64>,
    constants: i64,
}

/// The system of the search, for exact conditions.
#[derive(Debug, Clone)]
pub(super) struct Stated {
    pub(super) system: System,
    pub(super) scaling: Scaling,
    /// Bounds of the unknowns z within which the search finds all solutions.
    pub(super) radii: Vec<f64>,
    /// The search beyond these bounds, if solutions there are not excluded.
    pub(super) beyond: Option<Beyond>,
    /// Whether the bounds hold for all solutions, or `beyond` covers the rest.
    pub(super) bounded: bool,
    /// Whether the numbers that are zero are so exactly: none has become too small to be told from it.
    pub(super) keeps_zeros: bool,
    /// Errors of the forms' numbers beyond rounding: of the common ones, then of those of the sites. Empty if there are none.
    errors: Vec<Error>,
    /// Where the forms of each site begin.
    offsets: Vec<usize>,
}

/// All forms, the common ones first.
pub(super) fn forms(conditions: &ExactConditions) -> impl Iterator<Item = &ExactForm> {
    let sites = conditions.sites.iter().flat_map(|s| &s.forms);
    conditions.common.iter().chain(sites)
}

impl Scaling {
    pub(super) fn of(conditions: &ExactConditions) -> Self {
        let mut columns = vec![None; conditions.unknowns];
        for form in forms(conditions) {
            let magnitudes = || form.coefficients.iter().map(Exact::magnitude);
            let Some(largest) = magnitudes().flatten().max() else {
                continue;
            };
            for (column, m) in columns.iter_mut().zip(magnitudes()) {
                *column = (*column).max(m.map(|m| m - largest));
            }
        }
        let columns: Vec<i64> = columns.into_iter().map(|c| -c.unwrap_or(0)).collect();
        let row = |form: &ExactForm| {
            let terms = form.coefficients.iter().zip(&columns);
            let largest = terms.filter_map(|(a, c)| Some(a.magnitude()? + c)).max();
            -largest.or(form.constant.magnitude()).unwrap_or(0)
        };
        let rows: Vec<i64> = forms(conditions).map(row).collect();
        let flat = |form: &ExactForm| form.coefficients.iter().all(Exact::is_zero);
        let constants = forms(conditions)
            .zip(&rows)
            .filter(|(f, _)| !flat(f))
            .filter_map(|(f, r)| Some(f.constant.magnitude()? + r))
            .max();
        Self {
            rows,
            columns,
            constants: -constants.unwrap_or(0),
        }
    }

    pub(super) fn form(&self, k: usize, form: &ExactForm) -> Form {
        let row = self.rows[k];
        let terms = form.coefficients.iter().zip(&self.columns);
        let coefficients: Vec<f64> = terms.map(|(a, c)| a.scaled(row + c)).collect();
        let flat = form.coefficients.iter().all(Exact::is_zero);
        Form {
            constant: form.constant.scaled(row + if flat { 0 } else { self.constants }),
            coefficients,
            error: f64::EPSILON,
        }
    }

    /// The power of two by which a form is multiplied.
    pub(super) fn row(&self, form: usize) -> i64 {
        self.rows[form]
    }

    /// The power of two s with y_k = 2^s z_k.
    pub(super) fn shift(&self, k: usize) -> i64 {
        self.columns[k] - self.constants
    }

    /// The power of two by which the coefficient of a product y_j y_l in form k is multiplied.
    pub(super) fn product(&self, k: usize, [j, l]: [usize; 2]) -> i64 {
        self.rows[k] + self.columns[j] + self.shift(l)
    }

    /// y of z.
    pub(super) fn unscaled(&self, z: &[f64]) -> Vec<f64> {
        let y = |(k, z): (usize, &f64)| Some(Exact::new(*z)?.scaled(self.shift(k)));
        let all = z.iter().enumerate();
        all.map(|v| y(v).unwrap_or(f64::NAN)).collect()
    }
}

fn site(k: usize, exact: &ExactSite, forms: Vec<Form>) -> Site {
    let signed = |list: &[(usize, i8)]| list.iter().map(|&(f, s)| (f, f64::from(s))).collect();
    Site {
        sites: vec![k],
        slots: vec![k],
        forms,
        pieces: exact
            .pieces
            .iter()
            .map(|p| Piece {
                pieces: vec![p.piece],
                equalities: p.equalities.iter().map(|e| e.1).collect(),
                facets: signed(&p.facets),
            })
            .collect(),
        implied: Some(signed(&exact.implied)),
    }
}

impl Stated {
    pub(super) fn new(conditions: &ExactConditions) -> Self {
        let scaling = Scaling::of(conditions);
        let mut scaled = forms(conditions).enumerate().map(|(k, f)| scaling.form(k, f));
        let common: Vec<Form> = scaled.by_ref().take(conditions.common.len()).collect();
        let sites = conditions.sites.iter().enumerate();
        let sites = sites.map(|(k, s)| site(k, s, scaled.by_ref().take(s.forms.len()).collect()));
        let system = System {
            unknowns: conditions.unknowns,
            sites: sites.collect(),
            common,
        };
        let known = |k: usize| -> Option<f64> {
            let bound = conditions.bounds.get(k)?.as_ref()?;
            let value = 1.001 * bound.scaled(-scaling.shift(k));
            value.is_finite().then_some(value)
        };
        let known: Vec<Option<f64>> = (0..conditions.unknowns).map(known).collect();
        let (radii, beyond, bounded) = if let Some(all) = known.iter().copied().collect::<Option<Vec<f64>>>()
        {
            (all, None, true)
        } else {
            let found = far(&system, &known);
            let bounded = found.is_some();
            let everywhere = || (vec![FAR; conditions.unknowns], None);
            let (radii, beyond) = found.map_or_else(everywhere, |(radii, beyond)| (radii, Some(beyond)));
            (radii, beyond, bounded)
        };
        let ends = conditions.sites.iter().scan(conditions.common.len(), |next, s| {
            *next += s.forms.len();
            Some(*next - s.forms.len())
        });
        Self {
            keeps_zeros: keeps_zeros(conditions, &system),
            system,
            scaling,
            radii,
            beyond,
            bounded,
            errors: Vec::new(),
            offsets: ends.collect(),
        }
    }

    /// With error bounds of the numbers of each form.
    pub(super) fn with_errors(mut self, conditions: &ExactConditions, bounds: &[ExactForm]) -> Self {
        let error = |(k, (form, bound)): (usize, (&ExactForm, &ExactForm))| {
            let mut whole = form.clone();
            whole.constant.clone_from(&bound.constant);
            let constant = self.scaling.form(k, &whole).constant;
            let coefficients = self.scaling.form(k, bound).coefficients;
            Error {
                coefficients: 1.001 * coefficients.into_iter().fold(0.0, f64::max),
                constant: 1.001 * constant,
            }
        };
        self.errors = forms(conditions).zip(bounds).enumerate().map(error).collect();
        self
    }

    /// The errors of a common form, and of a form of a site.
    pub(super) fn common_error(&self, form: usize) -> Error {
        self.errors.get(form).copied().unwrap_or_default()
    }

    pub(super) fn error(&self, site: usize, form: usize) -> Error {
        self.common_error(self.offsets[site] + form)
    }

    /// Whether the numbers are exact up to rounding.
    pub(super) fn is_exact(&self) -> bool {
        self.errors.is_empty()
    }
}

fn keeps_zeros(conditions: &ExactConditions, system: &System) -> bool {
    forms(conditions).zip(system.forms()).all(|(exact, rounded)| {
        let mut both = exact.coefficients.iter().zip(&rounded.coefficients);
        let constant = exact.constant.is_zero() == (rounded.constant == 0.0);
        constant && both.all(|(a, b)| a.is_zero() == (*b == 0.0))
    })
}

/// A form of one unknown alone that has one sign at all solutions: (variable, coefficient made positive, constant, sign).
fn bounding(system: &System, unknown: usize) -> Option<(&Form, f64)> {
    system.sites.iter().find_map(|site| {
        let implied = site.implied.iter().flatten();
        implied
            .map(|&(f, sign)| (&site.forms[f], sign))
            .find(|(form, _)| {
                let mut others = form.coefficients.iter().enumerate();
                form.coefficients[unknown] != 0.0 && others.all(|(k, a)| k == unknown || *a == 0.0)
            })
    })
}

/// The region beyond the radii of a search, divided by the largest of all forms that are nonnegative at solutions.
#[derive(Debug, Clone)]
pub(super) struct Beyond {
    system: System,
    radii: Vec<f64>,
    /// For each of these forms, the condition that it is the largest.
    largest: Vec<Form>,
}

impl Beyond {
    /// Systems with their radii, one for each form as the largest one: if none of them has a point, no solution lies beyond.
    pub(super) fn systems(&self) -> impl Iterator<Item = (System, &[f64])> {
        self.largest.iter().map(|form| {
            let mut system = self.system.clone();
            system.common.push(form.clone());
            (system, self.radii.as_slice())
        })
    }
}

/// Where each unbounded unknown has a nonnegative form of its own, it suffices to bound the largest M of all nonnegative forms. Gives the
/// radii of the unknowns for M ≤ FAR, and the system of y / M, with the unknown t = 1/M ≤ 1/FAR.
fn far(system: &System, known: &[Option<f64>]) -> Option<(Vec<f64>, Beyond)> {
    let m = system.unknowns;
    let (mut radii, mut directions) = (vec![0.0; m], vec![0.0; m + 1]);
    for k in 0..m {
        if let Some(bound) = known[k] {
            (radii[k], directions[k]) = (bound, bound / FAR);
            continue;
        }
        let (form, _) = bounding(system, k)?;
        let (a, c) = (form.coefficients[k], form.constant);
        radii[k] = 1.001 * (FAR + c.abs()) / a.abs();
        directions[k] = 1.001 * (1.0 + c.abs()) / a.abs();
    }
    directions[m] = 1.001 / FAR;
    let mut beyond = system.clone();
    beyond.unknowns = m + 1;
    beyond.common.iter_mut().for_each(|f| *f = homogeneous(f));
    let (mut limits, mut largest) = (Vec::new(), Vec::new());
    for site in &mut beyond.sites {
        site.forms.iter_mut().for_each(|f| *f = homogeneous(f));
        let implied: Vec<(usize, f64)> = site.implied.iter().flatten().copied().collect();
        for (k, &(f, sign)) in implied.iter().enumerate() {
            let vanishes =
                implied.contains(&(f, -sign)) || site.forms[f].coefficients.iter().all(|a| *a == 0.0);
            if vanishes {
                continue;
            }
            limits.push(less(1.0, [(&site.forms[f], sign)]));
            largest.push(less(1.0, [(&site.forms[f], sign)]));
            // Of two forms one vanishes in each piece: neither is larger than 1, nor is their sum.
            for &(g, other) in &implied[k + 1..] {
                let either = |p: &Piece| p.equalities.contains(&f) || p.equalities.contains(&g);
                if g != f && site.pieces.iter().all(either) {
                    let both = [(&site.forms[f], sign), (&site.forms[g], other)];
                    let terms = both.iter().flat_map(|b| b.0.coefficients.iter().zip(&directions));
                    let size: f64 = terms.map(|(a, r)| a.abs() * r).sum();
                    // Coefficients that cancel are no more accurate than their terms.
                    limits.push(less(1.0 + 8.0 * f64::EPSILON * size, both));
                }
            }
        }
    }
    // 0 ≤ t ≤ 1/FAR.
    let time = homogeneous(&Form {
        coefficients: vec![0.0; m],
        constant: 1.0,
        error: f64::EPSILON,
    });
    limits.push(less(1.0 / FAR, [(&time, 1.0)]));
    limits.push(time);
    let facets: Vec<(usize, f64)> = (0..limits.len()).map(|k| (k, 1.0)).collect();
    let last = beyond.sites.len();
    beyond.sites.push(Site {
        sites: vec![last],
        slots: vec![last],
        forms: limits,
        pieces: vec![Piece {
            pieces: vec![0],
            equalities: Vec::new(),
            facets: facets.clone(),
        }],
        implied: Some(facets),
    });
    let beyond = Beyond {
        system: beyond,
        radii: directions,
        largest,
    };
    Some((radii, beyond))
}

/// The form with its constant as the coefficient of one more unknown.
fn homogeneous(form: &Form) -> Form {
    let mut coefficients = form.coefficients.clone();
    coefficients.push(form.constant);
    Form {
        coefficients,
        constant: 0.0,
        error: form.error,
    }
}

/// A number less some forms, with signs.
fn less<const N: usize>(constant: f64, forms: [(&Form, f64); N]) -> Form {
    let mut rest = Form {
        coefficients: vec![0.0; forms[0].0.coefficients.len()],
        constant,
        error: f64::EPSILON,
    };
    for (form, sign) in forms {
        for (r, a) in rest.coefficients.iter_mut().zip(&form.coefficients) {
            *r -= sign * a;
        }
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::piecewise::ExactPiece;

    /// 2^a y = 2^b with |y| ≤ 2^(b − a): the search reaches its solution, whatever the units.
    #[test]
    fn radii_hold_what_bounds_allow() {
        for (a, b) in [(0, 0), (3, -5), (-70, 40), (200, 300)] {
            let power = |e: i64| Exact::one().shifted(e);
            let mut form = ExactForm::zero(1);
            form.coefficients[0] = power(a);
            form.constant = -&power(b);
            let conditions = ExactConditions {
                unknowns: 1,
                common: Vec::new(),
                sites: vec![ExactSite {
                    forms: vec![form],
                    pieces: vec![ExactPiece {
                        piece: 0,
                        equalities: vec![(0, 0)],
                        facets: Vec::new(),
                    }],
                    implied: Vec::new(),
                }],
                bounds: vec![Some(power(b - a))],
            };
            let stated = Stated::new(&conditions);
            let solution = power(b - a).scaled(-stated.scaling.shift(0));
            assert!(stated.bounded && stated.beyond.is_none());
            assert!(stated.radii[0] >= solution && solution > 0.0, "{a} {b}");
        }
    }
}
