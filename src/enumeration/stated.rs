//! The affine forms of a map that states them exactly, rounded for the search.

use super::enclosure::Error;
use super::system::{Piece, Site, System};
use super::table::Form;
use crate::exact::Exact;
use crate::piecewise::{ExactConditions, ExactForm, ExactSite};

/// How far the scaled forms, and with them unbounded unknowns, are searched; what is beyond is searched as directions.
const FAR: f64 = 131_072.0;

/// Powers of two by which forms, unknowns and constants are multiplied so that all are of size one: y_k = 2^(columns_k − constants) z_k.
#[derive(Debug, Clone, Default)]
pub(super) struct Scaling {
    rows: Vec<i64>,
    columns: Vec<i64>,
    constants: i64,
}

/// The system of the search, for what is stated exactly.
#[derive(Debug, Clone)]
pub(super) struct Stated {
    pub(super) system: System,
    pub(super) scaling: Scaling,
    /// Bounds of the unknowns z inside of which the search finds all solutions.
    pub(super) radii: Vec<f64>,
    /// The directions of what lies beyond, if anything may, and their bounds.
    pub(super) beyond: Option<(System, Vec<f64>)>,
    /// Whether the bounds hold for all solutions, or `beyond` tells of the rest.
    pub(super) bounded: bool,
    /// What the numbers of the forms may be off beyond rounding: of the common ones, then of those of the sites. Empty where nothing.
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

    /// The power of two s with y_k = 2^s z_k.
    pub(super) fn shift(&self, k: usize) -> i64 {
        self.columns[k] - self.constants
    }

    /// That by which what form k has of a product y_j y_l is multiplied.
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
            system,
            scaling,
            radii,
            beyond,
            bounded,
            errors: Vec::new(),
            offsets: ends.collect(),
        }
    }

    /// With bounds of what the numbers of each form may be off.
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

    /// What a common form may be off, and a form of a site.
    pub(super) fn common_error(&self, form: usize) -> Error {
        self.errors.get(form).copied().unwrap_or_default()
    }

    pub(super) fn error(&self, site: usize, form: usize) -> Error {
        self.common_error(self.offsets[site] + form)
    }

    /// Whether the numbers are known but for rounding.
    pub(super) fn is_exact(&self) -> bool {
        self.errors.is_empty()
    }
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

/// A system with the radii of its unknowns.
type Bounded = (System, Vec<f64>);

/// Where each unbounded unknown has a form of its own that is nonnegative, their sum S is what the search has to bound. The radii of the
/// unknowns for S ≤ FAR; and the system of y / S, with the unknown t = 1/S ≤ 1/FAR, and the radii of its unknowns.
fn far(system: &System, known: &[Option<f64>]) -> Option<(Vec<f64>, Bounded)> {
    let m = system.unknowns;
    let mut sum = Form {
        coefficients: vec![0.0; m + 1],
        constant: -1.0,
        error: f64::EPSILON,
    };
    let (mut radii, mut directions) = (vec![0.0; m], vec![0.0; m + 1]);
    for k in 0..m {
        if let Some(bound) = known[k] {
            (radii[k], directions[k]) = (bound, bound / FAR);
            continue;
        }
        let (form, sign) = bounding(system, k)?;
        let (a, c) = (form.coefficients[k], form.constant);
        sum.coefficients[k] += sign * a;
        sum.coefficients[m] += sign * c;
        radii[k] = 1.001 * (FAR + c.abs()) / a.abs();
        directions[k] = 1.001 * (1.0 + c.abs()) / a.abs();
    }
    directions[m] = 1.001 / FAR;
    let homogeneous = |form: &Form| {
        let mut coefficients = form.coefficients.clone();
        coefficients.push(form.constant);
        Form {
            coefficients,
            constant: 0.0,
            error: form.error,
        }
    };
    let mut beyond = system.clone();
    beyond.unknowns = m + 1;
    beyond.common.iter_mut().for_each(|f| *f = homogeneous(f));
    for site in &mut beyond.sites {
        site.forms.iter_mut().for_each(|f| *f = homogeneous(f));
    }
    beyond.common.push(sum);
    // 0 ≤ t ≤ 1/FAR, at a site of its own.
    let mut time = Form {
        coefficients: vec![0.0; m + 1],
        constant: 0.0,
        error: f64::EPSILON,
    };
    time.coefficients[m] = 1.0;
    let mut rest = time.clone();
    (rest.coefficients[m], rest.constant) = (-1.0, 1.0 / FAR);
    let facets = vec![(0, 1.0), (1, 1.0)];
    let last = beyond.sites.len();
    beyond.sites.push(Site {
        sites: vec![last],
        slots: vec![last],
        forms: vec![time, rest],
        pieces: vec![Piece {
            pieces: vec![0],
            equalities: Vec::new(),
            facets: facets.clone(),
        }],
        implied: Some(facets),
    });
    Some((radii, (beyond, directions)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::piecewise::ExactPiece;

    /// 2^a y = 2^b with |y| ≤ 2^(b − a): the search reaches its solution, in whatever units.
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
