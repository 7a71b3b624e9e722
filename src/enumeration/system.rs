//! The affine forms behind a piecewise-affine system: common equalities, and for each site the equalities and facets of its pieces.

use super::EnumerationError;
use super::split::{At, split};
use super::table::Form;
use crate::clock::Deadline;
use crate::input::check_vector;
use crate::linear::LinearError;
use crate::piecewise::{ActiveSet, PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout};
use crate::sparse::Matrix;
use crate::tolerances::{GIGABYTE, ROUNDING, SIX_DIGITS};

/// A piecewise-affine system: the common forms vanish, and at every site all conditions of one of its pieces hold.
#[derive(Debug, Clone)]
pub(super) struct System {
    pub(super) unknowns: usize,
    pub(super) common: Vec<Form>,
    pub(super) sites: Vec<Site>,
}

/// A site, or several whose pieces meet in a row, with all combinations of their pieces.
#[derive(Debug, Clone)]
pub(super) struct Site {
    /// Numbers in the map.
    pub(super) sites: Vec<usize>,
    /// Positions among the sites that have a choice.
    pub(super) slots: Vec<usize>,
    pub(super) forms: Vec<Form>,
    pub(super) pieces: Vec<Piece>,
    /// Forms that have one sign in all pieces, with it, where that is known.
    pub(super) implied: Option<Vec<(usize, f64)>>,
}

#[derive(Debug, Clone)]
pub(super) struct Piece {
    /// For each of the sites its number in the map.
    pub(super) pieces: Vec<usize>,
    /// Forms of the site that vanish.
    pub(super) equalities: Vec<usize>,
    /// Forms of the site that have the given sign.
    pub(super) facets: Vec<(usize, f64)>,
}

/// Largest number of combinations of pieces of sites that share rows.
const MAX_COMBINATIONS: usize = 64;

/// Which residuals belong to which choices of pieces.
struct Owners {
    /// For each residual the group on whose pieces it depends, if any.
    rows: Vec<Option<usize>>,
    /// Positions of the choices in each group: sites that occur in the same row belong together.
    groups: Vec<Vec<usize>>,
}

/// The owners of all residuals; `None` where sites that share rows have too many combinations of pieces to be taken as one.
fn owners(map: &dyn PiecewiseSmooth, choices: &[(usize, Vec<usize>)]) -> Option<Owners> {
    let mut first = vec![None; map.num_residuals()];
    // Each choice points to an earlier one of its group, or to itself.
    let mut parent: Vec<usize> = (0..choices.len()).collect();
    let root = |parent: &[usize], mut k: usize| {
        while parent[k] != k {
            k = parent[k];
        }
        k
    };
    let mut rows = Vec::new();
    for (k, (site, _)) in choices.iter().enumerate() {
        map.site_rows(*site, &mut rows);
        for &row in &rows {
            let other = *first.get_mut(row)?.get_or_insert(k);
            let (a, b) = (root(&parent, other), root(&parent, k));
            parent[a.max(b)] = a.min(b);
        }
    }
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut number = vec![0; choices.len()];
    for k in 0..choices.len() {
        let r = root(&parent, k);
        if r == k {
            number[k] = groups.len();
            groups.push(Vec::new());
        }
        number[k] = number[r];
        groups[number[r]].push(k);
    }
    let combinations = |group: &Vec<usize>| {
        let sizes = group.iter().map(|&k| choices[k].1.len());
        sizes.fold(1usize, usize::saturating_mul)
    };
    let small = |g: &Vec<usize>| g.len() == 1 || combinations(g) <= MAX_COMBINATIONS;
    groups.iter().all(small).then(|| Owners {
        rows: first.iter().map(|o| o.map(|k| number[k])).collect(),
        groups,
    })
}

/// All combinations of pieces of the given choices, the last one running fastest.
fn combinations(group: &[usize], choices: &[(usize, Vec<usize>)]) -> Vec<Vec<usize>> {
    group.iter().fold(vec![Vec::new()], |all, &k| {
        let longer = |c: &Vec<usize>| -> Vec<Vec<usize>> {
            let with = |p: &usize| c.iter().copied().chain([*p]).collect();
            choices[k].1.iter().map(with).collect()
        };
        all.iter().flat_map(longer).collect()
    })
}

/// The rows of H^(σ) at `at[0]` as forms of the first `unknowns` variables; the difference of their derivatives at `at[1]` is noise.
pub(super) fn rows(
    map: &dyn PiecewiseSmooth,
    selection: &Selection,
    at: [&[f64]; 2],
    unknowns: usize,
    jac: &mut Matrix,
) -> Result<Vec<Form>, EnumerationError> {
    let n = map.num_residuals();
    let mut constants = vec![0.0; n];
    map.residual(selection, at[0], &mut constants);
    check_vector("the residual", &constants, n)?;
    let mut first = Vec::with_capacity(jac.values().len());
    for x in at {
        first.clear();
        first.extend_from_slice(jac.values());
        jac.clear();
        map.jacobian(selection, x, jac);
        if let Some((row, col)) = jac.stray() {
            return Err(crate::piecewise::PiecewiseError::StrayEntry { row, col }.into());
        }
        if jac.values().iter().any(|v| !v.is_finite()) {
            return Err(LinearError::NotFinite { what: "the Jacobian" }.into());
        }
    }
    let entries = || jac.triplets().zip(&first).filter(|e| e.0.1 < unknowns);
    let mut noise = vec![0.0f64; n];
    for ((i, _, b), a) in entries() {
        noise[i] = noise[i].max((a - b).abs());
    }
    let mut forms: Vec<Form> = constants
        .into_iter()
        .zip(&noise)
        .map(|(constant, noise)| Form {
            coefficients: vec![0.0; unknowns],
            constant,
            error: 4.0 * noise,
        })
        .collect();
    for ((i, j, _), a) in entries() {
        forms[i].coefficients[j] = clean(*a, noise[i]);
    }
    Ok(forms)
}

/// A coefficient, or zero if it is within the noise, which scaling would enlarge.
fn clean(a: f64, noise: f64) -> f64 {
    if a.abs() <= 4.0 * noise { 0.0 } else { a }
}

/// The form with the first coefficients; the difference to the second ones is its error.
fn form(first: &[f64], second: &[f64], constant: f64) -> Form {
    let noise = first
        .iter()
        .zip(second)
        .fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
    Form {
        coefficients: first.iter().map(|a| clean(*a, noise)).collect(),
        constant,
        error: 4.0 * noise,
    }
}

fn size(form: &Form) -> f64 {
    form.coefficients.iter().fold(0.0f64, |m, a| m.max(a.abs()))
}

/// All forms of the given sites and pieces, the derivatives taken at the first point. `tests` says which test functions count. `None` where
/// rows depend on the pieces of too many sites, and not as sums.
fn build(
    map: &dyn PiecewiseSmooth,
    base: &Selection,
    choices: &[(usize, Vec<usize>)],
    at: At<'_>,
    tests: impl Fn(usize, usize) -> bool,
) -> Result<Option<System>, EnumerationError> {
    match owners(map, choices) {
        Some(owners) => owned(map, &owners, base, choices, at, tests).map(Some),
        None => split(map, base, choices, at, tests),
    }
}

/// The same where each row belongs to one group of sites or to none.
fn owned(
    map: &dyn PiecewiseSmooth,
    owners: &Owners,
    base: &Selection,
    choices: &[(usize, Vec<usize>)],
    At {
        points: at, unknowns, ..
    }: At<'_>,
    tests: impl Fn(usize, usize) -> bool,
) -> Result<System, EnumerationError> {
    // Each row of the map is at least one form: a system that cannot fit is refused before a dense table is allocated.
    check_table(map.num_residuals(), unknowns)?;
    let mut system = System {
        unknowns,
        common: Vec::new(),
        sites: Vec::new(),
    };
    let common = owners.rows.iter().filter(|o| o.is_none()).count();
    add_cells(map, &mut system, common, &owners.groups, choices, at, tests)?;
    let mut jac = Matrix::zeros(map.pattern());
    // Rows depend on the pieces of their own group alone: one Jacobian gives the k-th combinations of all groups.
    let rounds = system.sites.iter().map(|s| s.pieces.len()).max();
    let mut selection = base.clone();
    for round in 0..rounds.unwrap_or(1).max(1) {
        for s in &system.sites {
            let combination = &s.pieces[round.min(s.pieces.len() - 1)].pieces;
            for (site, piece) in s.sites.iter().zip(combination) {
                selection.set(*site, *piece);
            }
        }
        let mut found = rows(map, &selection, at, unknowns, &mut jac)?;
        for (g, s) in system.sites.iter_mut().enumerate() {
            if round >= s.pieces.len() {
                continue;
            }
            for (row, _) in owners.rows.iter().enumerate().filter(|o| *o.1 == Some(g)) {
                let new = &found[row];
                // Pieces share rows (three of Coulomb's four have uν = 0): one form represents them all.
                let same = |f: &Form| f.constant == new.constant && f.coefficients == new.coefficients;
                let k = s.forms.iter().position(same).unwrap_or_else(|| {
                    s.forms.push(new.clone());
                    s.forms.len() - 1
                });
                s.pieces[round].equalities.push(k);
            }
        }
        system.check()?;
        if round == 0 {
            let mut own = owners.rows.iter();
            found.retain(|_| own.next().is_some_and(Option::is_none));
            system.common = found;
        }
    }
    system.check()?;
    Ok(system)
}

/// Adds the sites with the facets of their pieces; `count` is the number of forms already present or planned.
pub(super) fn add_cells(
    map: &dyn PiecewiseSmooth,
    system: &mut System,
    mut count: usize,
    groups: &[Vec<usize>],
    choices: &[(usize, Vec<usize>)],
    at: [&[f64]; 2],
    tests: impl Fn(usize, usize) -> bool,
) -> Result<(), EnumerationError> {
    let unknowns = system.unknowns;
    let layout = TestLayout::new(map);
    let mut theta = vec![0.0; layout.total()];
    map.test_functions(at[0], &mut theta);
    check_vector("the test functions", &theta, layout.total())?;
    let mut gradients = [vec![0.0; map.num_vars()], vec![0.0; map.num_vars()]];
    for group in groups {
        let mut forms = Vec::new();
        let mut indices = Vec::with_capacity(group.len());
        for (site, pieces) in group.iter().map(|&k| &choices[k]) {
            let mut index = vec![usize::MAX; map.num_tests(*site)];
            for test in 0..map.num_tests(*site) {
                let of = |&k: &usize| map.cell(*site, k).iter().any(|f| f.test() == test);
                if !tests(*site, test) || !pieces.iter().any(of) {
                    continue;
                }
                for (x, gradient) in at.iter().zip(&mut gradients) {
                    map.test_gradient(*site, test, x, gradient);
                }
                count += 1;
                check_table(count, unknowns)?;
                index[test] = forms.len();
                let value = theta[layout.range(*site).start + test];
                forms.push(form(&gradients[0][..unknowns], &gradients[1][..unknowns], value));
            }
            indices.push(index);
        }
        let piece = |pieces: Vec<usize>| {
            let facets = group.iter().zip(&pieces).zip(&indices);
            let facets = facets.flat_map(|((&k, &piece), index)| {
                let cell = map.cell(choices[k].0, piece).iter();
                cell.filter(|f| index[f.test()] != usize::MAX)
                    .map(|f| (index[f.test()], f.sign()))
            });
            Piece {
                facets: facets.collect(),
                pieces,
                equalities: Vec::new(),
            }
        };
        let all = combinations(group, choices);
        system.sites.push(Site {
            sites: group.iter().map(|&k| choices[k].0).collect(),
            slots: group.clone(),
            pieces: all.into_iter().map(piece).collect(),
            forms,
            implied: None,
        });
    }
    Ok(())
}

/// All pieces of all sites.
pub(super) fn all_choices(map: &dyn PiecewiseSmooth) -> Vec<(usize, Vec<usize>)> {
    let pieces = |s: usize| (s, (0..map.num_pieces(s)).collect());
    (0..map.num_sites()).map(pieces).collect()
}

/// The system of all solutions y at fixed parameter; x = (0, α) is its origin. `None` as for [`build`].
pub(super) fn at_parameter(
    map: &dyn PiecewiseSmooth,
    choices: &[(usize, Vec<usize>)],
    origin: &[f64],
    deadline: Deadline<'_>,
) -> Result<Option<System>, EnumerationError> {
    let n = map.num_residuals();
    let probe = probe(origin, n);
    let base = Selection::uniform(map.num_sites(), 0);
    let at = At {
        points: [origin, &probe],
        unknowns: n,
        homogeneous: false,
        deadline,
    };
    let Some(mut system) = build(map, &base, choices, at, |_, _| true)? else {
        return Ok(None);
    };
    for form in system.common.iter() {
        constant_form(form, || "a row common to all pieces".into())?;
    }
    for s in &system.sites {
        for form in &s.forms {
            constant_form(form, || {
                let names: Vec<_> = s.sites.iter().map(|&site| map.site_name(site)).collect();
                names.join(" and ")
            })?;
        }
    }
    system.scale();
    Ok(Some(system))
}

fn check_table(rows: usize, unknowns: usize) -> Result<(), EnumerationError> {
    match rows.checked_mul(unknowns.saturating_add(1)) {
        Some(total) if total <= GIGABYTE / 2 => Ok(()),
        _ => Err(EnumerationError::TooLarge { rows, unknowns }),
    }
}

/// A point off the origin in general position: derivatives that are the same there count as constant.
pub(super) fn probe(origin: &[f64], unknowns: usize) -> Vec<f64> {
    let mut probe = origin.to_vec();
    for (i, v) in probe.iter_mut().take(unknowns).enumerate() {
        let fraction = ((i * 7919 + 3571) % 1009) as f64 / 1009.0;
        *v += (3.0 * fraction - 1.4) * if i % 2 == 0 { 1.0 } else { -1.7 };
    }
    probe
}

fn constant_form(form: &Form, what: impl Fn() -> String) -> Result<(), EnumerationError> {
    if form.error > 4.0 * SIX_DIGITS * size(form).max(f64::MIN_POSITIVE) && form.error > 1e-9 {
        return Err(EnumerationError::NotAffine { what: what() });
    }
    Ok(())
}

/// The system of all directions (ẏ, α̇) at x: H'(x; τ) = 0, homogeneous. `None` as for [`build`].
pub(super) fn directional(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    deadline: Deadline<'_>,
) -> Result<Option<System>, EnumerationError> {
    // Forms of a site do not depend on the pieces of other sites, unless kinks are nested.
    if map.has_nested_kinks() && active.degenerate_sites().len() > 1 {
        return Ok(None);
    }
    let m = map.num_vars();
    // Differences across a step of rounding size, whatever the units, show only the noise of approximate derivatives.
    let size = |v: f64| if v == 0.0 { 1.0 } else { v.abs() };
    let near: Vec<f64> = x.iter().map(|v| v + 1e-13 * size(*v)).collect();
    let layout = TestLayout::new(map);
    let vanishes = |site: usize, test: usize| {
        active
            .vanishing()
            .binary_search(&(layout.range(site).start + test))
            .is_ok()
    };
    let choices = active.degenerate_sites();
    let at = At {
        points: [x, &near],
        unknowns: m,
        homogeneous: true,
        deadline,
    };
    let Some(mut system) = build(map, active.first(), choices, at, vanishes)? else {
        return Ok(None);
    };
    system.all_forms().for_each(|f| f.constant = 0.0);
    system.scale();
    system.tell_shared_equalities();
    Ok(Some(system))
}

impl System {
    /// All forms, the common ones first.
    pub(super) fn forms(&self) -> impl Iterator<Item = &Form> {
        let sites = self.sites.iter().flat_map(|s| &s.forms);
        self.common.iter().chain(sites)
    }

    fn all_forms(&mut self) -> impl Iterator<Item = &mut Form> {
        let sites = self.sites.iter_mut().flat_map(|s| &mut s.forms);
        self.common.iter_mut().chain(sites)
    }

    pub(super) fn check(&self) -> Result<(), EnumerationError> {
        let rows = self.common.len() + self.sites.iter().map(|s| s.forms.len()).sum::<usize>();
        check_table(rows, self.unknowns)
    }

    /// Scales unknowns and forms by powers of two so that coefficients are of size one, and the constants by one more.
    fn scale(&mut self) {
        let mut columns = vec![0.0f64; self.unknowns];
        for form in self.all_forms() {
            scale_form(form);
            for (c, a) in columns.iter_mut().zip(&form.coefficients) {
                *c = c.max(a.abs());
            }
        }
        let factor = |&c: &f64| if c <= ROUNDING { 0.0 } else { power(c) };
        let factors: Vec<f64> = columns.iter().map(factor).collect();
        let mut largest = 0.0f64;
        for form in self.all_forms() {
            for (a, f) in form.coefficients.iter_mut().zip(&factors) {
                *a *= f;
            }
            scale_form(form);
            if form.coefficients.iter().any(|a| *a != 0.0) {
                largest = largest.max(form.constant.abs());
            }
        }
        let constants = power(largest);
        for form in self.all_forms() {
            let flat = form.coefficients.iter().all(|a| *a == 0.0);
            form.constant *= if flat { power(form.constant) } else { constants };
            form.error += f64::EPSILON;
        }
    }
}

/// The power of two next to 1/v; 1 for v = 0.
fn power(v: f64) -> f64 {
    let v = v.abs();
    if v > 0.0 && v.is_finite() {
        (-v.log2().round()).clamp(-1000.0, 1000.0).exp2()
    } else {
        1.0
    }
}

pub(super) fn scale_form(form: &mut Form) {
    let f = power(size(form));
    form.coefficients.iter_mut().for_each(|a| *a *= f);
    form.constant *= f;
    form.error *= f;
}
