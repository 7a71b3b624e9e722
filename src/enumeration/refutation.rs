//! Contradictions among the conditions that hold whatever pieces are chosen, proven by enclosures of their
//! multipliers: unlike bounds of what a rounded row may miss, these need no bounds of the unknowns.

use super::certificate::Certificates;
use super::enclosure::{Enclosure, Error};
use super::search::SelectionSearch;
use super::stated::{Scaling, Stated, stated_conditions};
use super::system::System;
use super::table::Table;
use crate::clock::Deadline;
use crate::exact::Exact;
use crate::piecewise::{ExactConditions, PiecewiseSmooth};
use crate::tolerances::MAX_COEFFICIENTS;

/// A combination of conditions that cannot hold together: for each form, the factor with which it enters. The
/// sum of all is a negative constant, though each term is zero or positive at every solution. Forms are the
/// common ones, then those of the sites, in their order.
pub(super) type Multipliers = Vec<(usize, f64)>;

/// The multipliers of the contradiction in the row of a variable; `None` where the signs of the exact ones
/// are not certain.
///
/// The row says that a form is a constant and a combination of other forms. Its exact coefficients solve a
/// linear system, one equation for each unknown, which is square and regular unless the combination is
/// degenerate.
pub(super) fn multipliers(
    system: &System,
    table: &Table,
    var: usize,
    deadline: Deadline<'_>,
) -> Option<Multipliers> {
    let forms: Vec<_> = system.forms().collect();
    let own = forms.get(var)?;
    let (_, all, _, _) = table.identity(var)?;
    let solve = |support: &[usize], rows: &[usize]| {
        let coefficient = |v: usize, k: usize| match forms.get(v) {
            Some(form) => form.coefficients[k],
            None => f64::from(u8::from(v - forms.len() == k)),
        };
        let entries = rows
            .iter()
            .flat_map(|&k| support.iter().map(move |&v| coefficient(v, k)));
        let matrix: Vec<f64> = entries.collect();
        let right: Vec<f64> = rows.iter().map(|&k| -own.coefficients[k]).collect();
        Enclosure::of(&matrix, &right, &[], deadline)
    };
    let every: Vec<usize> = (0..system.unknowns).collect();
    if all.len() != every.len() {
        return None;
    }
    let mut support = all.to_vec();
    let mut found = solve(&support, &every)?;
    let certain = found.point.iter().zip(&found.radius).map(|(a, r)| a.abs() > *r);
    let certain: Vec<bool> = certain.collect();
    if certain.contains(&false) {
        // Coefficients may be zero by the places of zeros alone: then the others satisfy all equations in
        // which one of them occurs.
        let mut kept = certain.iter();
        support.retain(|_| kept.next() == Some(&true));
        let columns: Vec<_> = support
            .iter()
            .map(|&v| forms.get(v).copied())
            .collect::<Option<_>>()?;
        let occurs =
            |k: &usize| own.coefficients[*k] != 0.0 || columns.iter().any(|f| f.coefficients[*k] != 0.0);
        let rows: Vec<usize> = every.into_iter().filter(occurs).collect();
        if rows.len() != support.len() {
            return None;
        }
        found = solve(&support, &rows)?;
    }
    let columns: Vec<_> = support
        .iter()
        .map(|&v| forms.get(v).copied())
        .collect::<Option<_>>()?;
    let constants: Vec<f64> = columns.iter().map(|f| -f.constant).collect();
    let rest = found.sign_of(&constants, own.constant, Error::default())?;
    // The form has the sign of its own condition, and each term the opposite one: the constant must not have
    // the former.
    let sign = table.sign(var).factor();
    if sign * f64::from(rest) >= 0.0 {
        return None;
    }
    let mut all = vec![(var, sign)];
    for ((&v, a), radius) in support.iter().zip(&found.point).zip(&found.radius) {
        let term = -sign * a;
        let certain = a.abs() > *radius && term * table.sign(v).factor() > 0.0;
        if !certain && !table.is_fixed(v) {
            return None;
        }
        all.push((v, term));
    }
    Some(all)
}

/// The contradiction of the conditions that hold for all selections of a map, if there is one and the map
/// states its coefficients: for each site and form of it the factor, in the units of the map.
pub(crate) fn refutation(
    map: &dyn PiecewiseSmooth,
    alpha: f64,
    deadline: Deadline<'_>,
) -> Option<Vec<(usize, usize, f64)>> {
    let conditions = stated_conditions(map, alpha, MAX_COEFFICIENTS)?;
    let stated = Stated::new(&conditions);
    if !stated.keeps_zeros {
        return None;
    }
    // The rows of the table remain identities between forms.
    let certificates = Certificates::new(&stated.system, stated.radii.clone());
    let search = SelectionSearch::new(&stated.system, Some(&certificates), 1, deadline);
    let found = search.contradiction(|root, var| multipliers(&stated.system, root, var, deadline))?;
    Some(unscaled(&conditions, &stated.scaling, &found))
}

/// Multipliers of the forms of sites as they are stated.
fn unscaled(
    conditions: &ExactConditions,
    scaling: &Scaling,
    found: &Multipliers,
) -> Vec<(usize, usize, f64)> {
    let mut place = vec![None; conditions.common.len()];
    for (site, s) in conditions.sites.iter().enumerate() {
        place.extend((0..s.forms.len()).map(|form| Some((site, form))));
    }
    let factor = |form: usize, v: f64| Some(Exact::new(v)?.scaled(scaling.row(form)));
    let each = found.iter().filter_map(|&(form, v)| {
        let (site, own) = place[form]?;
        Some((site, own, factor(form, v)?))
    });
    each.collect()
}
