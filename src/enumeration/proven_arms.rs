//! Lists of arms that are proven: the solutions of the directional problem at the exact point behind the one given.

use std::collections::BTreeSet;

use super::EnumerationOptions;
use super::arms::{DirectionalArm, DirectionalArms};
use super::exhaustive::{self, Held};
use super::lists::Doubt;
use super::near::{Directions, Near};
use super::proof::{self, Candidates, Gathered};
use super::stated::Stated;
use crate::clock::Deadline;
use crate::exact::{Dictionary, Exact, Infeasible, Place};
use crate::piecewise::{
    ActiveSet, ExactConditions, ExactForm, ExactPiece, ExactSite, PiecewiseSmooth, Selection, Selections,
};

/// Active selections up to which all are examined without a search.
const FEW: u128 = 256;

/// The arms at the exact point where all holds that `active` takes for given; `near` says whether a point, given by bounds of its
/// distance in each variable, is near enough.
pub(super) fn proven_arms(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    near: &dyn Fn(&[f64]) -> bool,
    options: &EnumerationOptions,
    deadline: Deadline,
) -> Result<DirectionalArms, Doubt> {
    let given = Near::new(map, x).ok_or(Doubt::NoCoefficients)?;
    if meets_wall(map, active) {
        return Err(Doubt::NoCoefficients);
    }
    let mut supposed: Vec<Vec<usize>> = active.first().pieces().map(|p| vec![p]).collect();
    for (site, pieces) in active.degenerate_sites() {
        supposed[*site].clone_from(pieces);
    }
    let mut doubt = Doubt::Rounding;
    // Between error bounds, or exactly where these leave anything open.
    for exactly in [false, true] {
        match at_point(&given, &supposed, exactly, near, options, deadline) {
            Ok(Some(found)) => return Ok(found),
            Ok(None) => {}
            Err(Doubt::Rounding) if !exactly => {}
            Err(why) => {
                doubt = why;
                break;
            }
        }
    }
    Err(doubt)
}

fn at_point(
    given: &Near,
    supposed: &[Vec<usize>],
    exactly: bool,
    near: &dyn Fn(&[f64]) -> bool,
    options: &EnumerationOptions,
    deadline: Deadline,
) -> Result<Option<DirectionalArms>, Doubt> {
    let Some(point) = given.point(supposed, exactly)? else {
        return Ok(None);
    };
    if !near(&point.reach) {
        return Err(Doubt::Coincidence);
    }
    let Some(pieces) = given.active(&point) else {
        return Ok(None);
    };
    if pieces.iter().any(Vec::is_empty) {
        return Err(Doubt::Coincidence);
    }
    let mut several = (0..pieces.len()).filter(|site| pieces[*site].len() > 1);
    if !several.all(|site| given.is_continuous(site)) {
        return Err(Doubt::Discontinuous);
    }
    let arms = Arms::new(given.directions(&point, &pieces), &pieces);
    arms.find(options, deadline).map(Some)
}

/// Whether a test function of a wall counts as vanishing: there the conditions may change.
fn meets_wall(map: &dyn PiecewiseSmooth, active: &ActiveSet) -> bool {
    let layout = crate::piecewise::TestLayout::new(map);
    active.vanishing().iter().any(|&k| {
        let (site, test) = layout.locate(k);
        let cells = (0..map.num_pieces(site)).flat_map(|piece| map.cell(site, piece));
        cells.into_iter().any(|f| f.is_wall() && f.test() == test)
    })
}

/// The directions with α̇ = 1, −1 and 0, and what is found of them.
struct Arms<'p> {
    pieces: &'p [Vec<usize>],
    /// In this order.
    conditions: [ExactConditions; 3],
    stated: [Stated; 3],
}

/// α̇ of the directions.
const RATES: [f64; 3] = [1.0, -1.0, 0.0];

impl<'p> Arms<'p> {
    fn new(directions: Directions, pieces: &'p [Vec<usize>]) -> Self {
        let Directions { conditions, errors } = directions;
        let back = with_constants(&conditions, |c| -c);
        let level = with_constants(&conditions, |_| Exact::default());
        let conditions = [conditions, back, level];
        let stated = conditions.each_ref().map(|c| {
            let stated = Stated::new(c);
            if errors.is_empty() {
                stated
            } else {
                stated.with_errors(c, &errors)
            }
        });
        Self {
            pieces,
            conditions,
            stated,
        }
    }

    fn find(&self, options: &EnumerationOptions, deadline: Deadline) -> Result<DirectionalArms, Doubt> {
        let mut budget = proof::budget(options);
        let candidates = self.candidates(options, deadline, &mut budget)?;
        let each = |k: usize| Gathered::new(Some(RATES[k]), &self.conditions[k], &self.stated[k]);
        let mut found = [each(0), each(1), each(2)];
        let mut unresolved = BTreeSet::new();
        for pieces in &candidates.selections {
            if deadline.is_over() {
                return Err(Doubt::Limit);
            }
            self.examine(pieces, &mut found, &mut unresolved, &mut budget)?;
        }
        let mut arms = Vec::new();
        for gathered in &mut found {
            gathered.drop_points_of_continua();
            let continua = gathered.continua.iter().flat_map(|c| &c.selections);
            unresolved.extend(continua.cloned());
            arms.extend(std::mem::take(&mut gathered.solutions));
        }
        let arms = arms.into_iter().map(|s| DirectionalArm {
            tangent: unit(s.x),
            selections: s.selections,
            det_signs: s.det_signs,
        });
        let unresolved: Vec<Selection> = unresolved.into_iter().collect();
        Ok(DirectionalArms::new(arms.collect(), unresolved, candidates.nodes))
    }

    /// The selections that may have arms.
    fn candidates(
        &self,
        options: &EnumerationOptions,
        deadline: Deadline,
        budget: &mut u64,
    ) -> Result<Candidates, Doubt> {
        let base = Selection::from_pieces(self.pieces.iter().map(|p| p[0]));
        let several = self.pieces.iter().enumerate().filter(|p| p.1.len() > 1);
        let all = Selections::new(base, several.map(|(s, p)| (s, p.clone())).collect());
        if let Some(total) = all.total().filter(|t| *t <= FEW) {
            if total > u128::from(options.max_nodes) {
                return Err(Doubt::Limit);
            }
            return Ok(Candidates::listed(all.map(|s| s.pieces().collect()).collect()));
        }
        if !self.stated[0].is_exact() {
            return Err(Doubt::Rounding);
        }
        let reduced = reduced(&self.conditions[0]).ok_or(Doubt::Limit)?;
        let mut found = Candidates::complete(&reduced, options, deadline, budget)?;
        let back = with_constants(&reduced, |c| -c);
        let other = Candidates::complete(&back, options, deadline, budget)?;
        if !found.bounded {
            let level = normalised(&reduced).ok_or(Doubt::Limit)?;
            let anything = vec![None; level.sites.len()];
            let mut leaf = |pieces| {
                found.selections.insert(pieces);
            };
            if !exhaustive::search(&level, &anything, budget, &mut leaf) {
                return Err(Doubt::Limit);
            }
        }
        found.selections.extend(other.selections);
        found.nodes += other.nodes;
        Ok(found)
    }

    fn examine(
        &self,
        pieces: &[usize],
        found: &mut [Gathered<'_>; 3],
        unresolved: &mut BTreeSet<Selection>,
        budget: &mut u64,
    ) -> Result<(), Doubt> {
        let [ahead, back, level] = found;
        let enclosure = ahead.enclosure(pieces);
        if let Some(one) = &enclosure {
            let other = one.mirrored();
            if let (Some(a), Some(b)) = (ahead.inside(pieces, one), back.inside(pieces, &other)) {
                if a {
                    ahead.add(pieces, one);
                }
                if b {
                    back.add(pieces, &other);
                }
                return Ok(());
            }
        }
        if !self.stated[0].is_exact() {
            return Err(Doubt::Rounding);
        }
        if !(ahead.decide(pieces, budget) && back.decide(pieces, budget)) {
            return Err(Doubt::Limit);
        }
        if enclosure.is_some() {
            return Ok(());
        }
        match exhaustive::decide(&self.conditions[2], pieces, budget) {
            None => return Err(Doubt::Limit),
            Some(Held::Continuum {
                ends,
                direction: Some(direction),
                ..
            }) => {
                if ends.is_empty() {
                    level.point(pieces, direction.clone().opposite(), 0, 0.0);
                }
                level.point(pieces, direction, 0, 0.0);
            }
            Some(Held::Continuum { .. }) => {
                unresolved.insert(Selection::from_pieces(pieces.iter().copied()));
            }
            Some(_) => {}
        }
        Ok(())
    }
}

fn with_constants(conditions: &ExactConditions, constant: impl Fn(&Exact) -> Exact) -> ExactConditions {
    let mut other = conditions.clone();
    let sites = other.sites.iter_mut().flat_map(|s| &mut s.forms);
    for form in other.common.iter_mut().chain(sites) {
        form.constant = constant(&form.constant);
    }
    other
}

/// A vector of length one; no component becomes 0.
fn unit(mut v: Vec<f64>) -> Vec<f64> {
    for _ in 0..2 {
        // Squares of large components overflow.
        let largest = crate::sparse::max_abs(&v);
        let size = if largest > 1e100 {
            largest
        } else {
            crate::sparse::norm(&v)
        };
        for a in v.iter_mut().filter(|a| **a != 0.0) {
            let scaled = *a / size;
            *a = if scaled == 0.0 {
                f64::MIN_POSITIVE.copysign(*a)
            } else {
                scaled
            };
        }
    }
    v
}

/// The form with α̇ as its last unknown, of size one.
fn homogeneous(form: &ExactForm) -> Vec<Exact> {
    let all = || form.coefficients.iter().chain([&form.constant]);
    let size = all().filter_map(Exact::magnitude).max().unwrap_or(0);
    all().map(|a| a.clone().shifted(-size)).collect()
}

/// The directional problem in few unknowns: what has no choice is eliminated, and what has one sign becomes an unknown where it can, so that
/// the search is bounded. `None` where α̇ has no choice.
fn reduced(conditions: &ExactConditions) -> Option<ExactConditions> {
    let (n, zero) = (conditions.unknowns, Exact::default());
    let rows: Vec<Vec<Exact>> = super::stated::forms(conditions).map(homogeneous).collect();
    let mut table = Dictionary::new(n + 1, rows.iter().map(|r| (&zero, r.as_slice())));
    for var in 0..conditions.common.len() {
        table.fix(var).ok()?;
    }
    let mut sites = conditions.sites.clone();
    let mut first = conditions.common.len();
    let mut signed = Vec::new();
    for site in &mut sites {
        if let [one] = site.pieces.as_mut_slice() {
            for (_, form) in std::mem::take(&mut one.equalities) {
                table.fix(first + form).ok()?;
            }
        }
        site.implied = implied(site);
        let entries = |form: usize| rows[first + form].iter().filter(|a| !a.is_zero()).count();
        signed.extend(site.implied.iter().map(|f| (entries(f.0), first + f.0)));
        first += site.forms.len();
    }
    let rate = rows.len() + n;
    // Forms of few unknowns first.
    signed.sort_unstable();
    for (_, var) in signed {
        table.enter(var, |column| column >= rows.len() && column != rate);
    }
    let Place::Column(rate) = table.place(rate) else {
        return None;
    };
    // The table makes forms integer: the new unknowns are of size one again.
    let size = |var: &usize| {
        let row = rows.get(*var).into_iter().flatten();
        -row.filter_map(Exact::granularity).min().unwrap_or(0)
    };
    let sizes: Vec<i64> = table.columns().iter().map(size).collect();
    let mut next = conditions.common.len();
    for site in &mut sites {
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

/// Forms of a site that have one sign in all its pieces: those of which that is said, if it holds for the directions, too.
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
    let mut reached = || -> Result<(), Infeasible> {
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
fn normalised(reduced: &ExactConditions) -> Option<ExactConditions> {
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
