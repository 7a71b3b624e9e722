//! Exact conditions in few unknowns that are nonnegative at all solutions, so that a search is bounded.

use std::collections::BTreeSet;

use super::exhaustive::MAX_WORK;
use crate::clock::Deadline;
use crate::exact::{Dictionary, Exact, Halt, Place};
use crate::piecewise::{ExactConditions, ExactForm, ExactPiece, ExactSite};

/// With other constants.
pub(super) fn with_constants(
    conditions: &ExactConditions,
    constant: impl Fn(&Exact) -> Exact,
) -> ExactConditions {
    let mut other = conditions.clone();
    let sites = other.sites.iter_mut().flat_map(|s| &mut s.forms);
    for form in other.common.iter_mut().chain(sites) {
        form.constant = constant(&form.constant);
    }
    other
}

/// The form with α̇ as its last unknown, of size one.
fn homogeneous(form: &ExactForm) -> Vec<Exact> {
    let all = || form.coefficients.iter().chain([&form.constant]);
    let size = all().filter_map(Exact::magnitude).max().unwrap_or(0);
    all().map(|a| a.clone().shifted(-size)).collect()
}

/// The directional problem in few unknowns: the conditions of sites with a single piece are eliminated, and forms of one sign become
/// unknowns where possible, so that the search is bounded. `None` where α̇ is not free, or the limits of time and work are reached.
pub(super) fn reduced_directions(
    conditions: &ExactConditions,
    deadline: Deadline<'_>,
) -> Option<ExactConditions> {
    reduced(conditions, implied, deadline)
}

/// The same for the solutions at a parameter. `None` where the common conditions contradict each other, or the limits of time
/// and work are reached.
pub(super) fn reduced_solutions(
    conditions: &ExactConditions,
    deadline: Deadline<'_>,
) -> Option<ExactConditions> {
    reduced(conditions, |site| site.implied.clone(), deadline)
}

/// With the constants as coefficients of one more unknown, which is not eliminated.
fn reduced(
    conditions: &ExactConditions,
    implied: impl Fn(&ExactSite) -> Vec<(usize, i8)>,
    deadline: Deadline<'_>,
) -> Option<ExactConditions> {
    let (n, zero) = (conditions.unknowns, Exact::default());
    let rows: Vec<Vec<Exact>> = super::stated::forms(conditions).map(homogeneous).collect();
    let mut table = Dictionary::new(n + 1, rows.iter().map(|r| (&zero, r.as_slice())))
        .until(deadline)
        .within(MAX_WORK);
    let rate = rows.len() + n;
    let fix = |table: &mut Dictionary, var: usize| -> Option<()> {
        table.fix_among(var, |column| column != rate).ok()?;
        (table.place(var) == Place::Gone).then_some(())
    };
    for var in 0..conditions.common.len() {
        fix(&mut table, var)?;
    }
    let mut sites = conditions.sites.clone();
    let mut first = conditions.common.len();
    let mut signed = Vec::new();
    for site in &mut sites {
        if let [one] = site.pieces.as_mut_slice() {
            for (_, form) in std::mem::take(&mut one.equalities) {
                fix(&mut table, first + form)?;
            }
        }
        if deadline.is_over() {
            return None;
        }
        site.implied = implied(site);
        let entries = |form: usize| rows[first + form].iter().filter(|a| !a.is_zero()).count();
        signed.extend(site.implied.iter().map(|f| (entries(f.0), first + f.0)));
        first += site.forms.len();
    }
    // Forms of few unknowns first.
    signed.sort_unstable();
    for (_, var) in signed {
        table
            .enter(var, |column| column >= rows.len() && column != rate)
            .ok()?;
    }
    let Place::Column(rate) = table.place(rate) else {
        return None;
    };
    // The table scales forms to integers: the new unknowns are rescaled to size one.
    let size = |var: &usize| {
        let row = rows.get(*var).into_iter().flatten();
        -row.filter_map(Exact::granularity).min().unwrap_or(0)
    };
    let sizes: Vec<i64> = table.columns().iter().map(size).collect();
    let mut next = conditions.common.len();
    for site in &mut sites {
        if deadline.is_over() {
            return None;
        }
        for form in &mut site.forms {
            let entries = table.entries(next).into_iter().skip(1).zip(&sizes);
            let mut coefficients: Vec<Exact> = entries.map(|(e, size)| Exact::of(e, *size)).collect();
            let constant = coefficients.remove(rate);
            *form = ExactForm {
                constant,
                coefficients,
            };
            next += 1;
        }
    }
    Some(ExactConditions {
        unknowns: table.columns().len() - 1,
        common: Vec::new(),
        sites,
        bounds: Vec::new(),
    })
}

/// Forms of a site that have one sign in all its pieces: those declared as such, if it holds for the directions, too.
fn implied(site: &ExactSite) -> Vec<(usize, i8)> {
    let signed = site.pieces.iter().flat_map(|p| p.facets.iter().copied());
    let zero = site.pieces.iter().flat_map(|p| &p.equalities);
    let both = zero.flat_map(|e| [(e.1, 1), (e.1, -1)]);
    let all: BTreeSet<(usize, i8)> = signed.chain(both).chain(site.implied.iter().copied()).collect();
    let every = |f: &(usize, i8)| site.pieces.iter().all(|p| entails(site, p, *f));
    all.into_iter().filter(every).collect()
}

/// Whether a form has the given sign in all directions of a piece.
fn entails(site: &ExactSite, piece: &ExactPiece, (form, sign): (usize, i8)) -> bool {
    if piece.facets.contains(&(form, sign)) || piece.equalities.iter().any(|e| e.1 == form) {
        return true;
    }
    let zero = Exact::default();
    let one = if sign > 0 { Exact::one() } else { -&Exact::one() };
    let rows: Vec<Vec<Exact>> = site.forms.iter().map(homogeneous).collect();
    // The form takes the other sign, if it can, at ±1.
    let all = rows.iter().map(|r| (&zero, r.as_slice()));
    let other = [(&one, rows[form].as_slice())];
    let mut table = Dictionary::new(rows[form].len(), all.chain(other));
    let mut reached = || -> Result<(), Halt> {
        for &(facet, sign) in &piece.facets {
            table.constrain(facet, sign)?;
        }
        for &(_, form) in &piece.equalities {
            table.fix(form)?;
        }
        table.fix(rows.len())?;
        table.repair()
    };
    reached().is_err()
}

/// The directions with α̇ = 0 whose signed forms sum up to 1: where each unknown is one of these, all but 0.
pub(super) fn normalised(reduced: &ExactConditions) -> Option<ExactConditions> {
    let mut level = with_constants(reduced, |_| Exact::default());
    let mut sum = ExactForm::zero(level.unknowns);
    sum.constant = -&Exact::one();
    for k in 0..level.unknowns {
        let own = level.sites.iter().flat_map(|s| {
            let form = |f: &(usize, i8)| (&s.forms[f.0], f.1);
            s.implied.iter().map(form)
        });
        let alone = |form: &ExactForm| {
            let mut entries = form.coefficients.iter().enumerate();
            entries.all(|(j, a)| (j == k) != a.is_zero())
        };
        let (form, sign) = own.into_iter().find(|(form, _)| alone(form))?;
        let sign = if sign > 0 { Exact::one() } else { -&Exact::one() };
        sum = sum.plus(&sign, form);
    }
    level.common.push(sum);
    Some(level)
}
