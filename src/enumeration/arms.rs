//! All arms of the solution set at a point: the solutions of the directional problem H'(x; τ) = 0.

mod collector;

use collector::Collector;
use std::collections::BTreeSet;

use super::local::{SOLVES, local_selections};
use super::monotone::Complementary;
use super::proven_arms::{FEW, proven_arms};
use super::search::SelectionSearch;
use super::system::System;
use super::table::{Form, Table};
use super::{Completeness, Doubt, EnumerationError, EnumerationOptions, system};
use crate::clock::Deadline;
use crate::input::check_vector;
use crate::piecewise::{
    ActiveSet, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Scaled, ScaledMap, Selection, TestLayout,
};
use crate::sparse::norm;
use crate::tolerances::{GIGABYTE, TANGENTIAL};

/// Selections examined one by one where the table of the search would not fit.
const LARGE: u64 = 4096;
/// Selections listed between two checks of the time limit.
const LOOKS: usize = 1000;

/// An arm: a half-line of directions τ = (ẏ, α̇) with H'(x; τ) = 0.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DirectionalArm {
    /// Unit tangent, pointing away from the point. Its last entry is set to 0 where it is rounding.
    pub tangent: Vec<f64>,
    /// All selections into whose closed cells it points, in lexicographic order; more than one when it runs in a facet.
    pub selections: Vec<Selection>,
    /// For each of them the sign of det ∇_yH^(σ): 0 when singular, `None` when the linear solver provides no determinants.
    pub det_signs: Vec<Option<i8>>,
}

impl DirectionalArm {
    /// α̇, the last entry of the tangent.
    #[must_use]
    pub fn rate(&self) -> f64 {
        self.tangent.last().copied().unwrap_or(0.0)
    }

    /// Whether the arm stays at one α (to first order).
    #[must_use]
    pub fn is_vertical(&self) -> bool {
        self.rate() == 0.0
    }

    /// The local index of the arm: the sign of the determinant, or the mean of two where it runs in one facet.
    fn index(&self) -> Option<i64> {
        match self.det_signs.as_slice() {
            [Some(sign)] if *sign != 0 => Some(i64::from(*sign)),
            [Some(a), Some(b)] if *a != 0 && *b != 0 => Some(i64::from((a + b) / 2)),
            _ => None,
        }
    }
}

/// All arms at a point.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DirectionalArms {
    /// The arms: those with growing α, with falling α, vertical ones.
    pub arms: Vec<DirectionalArm>,
    /// Selections with directions in more than one dimension, or (in lists that are not proven) whose Jacobian has a kernel of dimension
    /// two or more, or is singular with more than 4000 rows: their arms are not decided to first order.
    pub unresolved: Vec<Selection>,
    /// Σ sign det ∇_yH^(σ) over the arms with α̇ > 0 and over those with α̇ < 0. The two are equal: ẏ ↦ H'(x; (ẏ, s)) has no zeros
    /// for s = 0 but ẏ = 0, hence the same degree for s = 1 and s = −1. In an incomplete list, sums that differ prove that arms are
    /// missing; equal ones are evidence that none is. `None` where there are vertical arms, undecided selections, or an arm whose index is
    /// unknown.
    pub orientation: Option<(i64, i64)>,
    /// Whether the list is complete to first order: proven, or else undecided. See [`all_arms`]. Selections count once for each of the runs
    /// α̇ > 0, α̇ < 0, α̇ = 0.
    pub completeness: Completeness,
    /// Nodes of the search: partial selections tried.
    pub nodes: u64,
}

impl DirectionalArms {
    /// Combines the arms of all selections.
    pub(super) fn new(mut arms: Vec<DirectionalArm>, unresolved: Vec<Selection>, nodes: u64) -> Self {
        let group = |a: &DirectionalArm| match a.rate() {
            _ if a.is_vertical() => 2,
            rate if rate > 0.0 => 0,
            _ => 1,
        };
        arms.sort_by_key(group);
        let sum = |which: i32| -> Option<i64> {
            let arms = arms.iter().filter(|a| group(a) == which);
            arms.map(DirectionalArm::index).sum()
        };
        let applies = unresolved.is_empty() && arms.iter().all(|a| group(a) != 2);
        let orientation = if applies { sum(0).zip(sum(1)) } else { None };
        let completeness = match unresolved.len() as u64 {
            0 => Completeness::Complete,
            selections => Completeness::Undecided {
                selections,
                doubt: Doubt::Rounding,
            },
        };
        Self {
            arms,
            unresolved,
            orientation,
            completeness,
            nodes,
        }
    }
}

/// All arms of the solution curves of H(y, α) = 0 at the solution `x` = (y, α). Test functions within `options.tolerance` of their
/// zero set, as a distance relative to 1 + ‖x‖₂, count as vanishing there. The pieces need not be affine.
///
/// For maps that give their [exact coefficients](crate::piecewise::Structure::exact) as functions of α
/// ([`is_affine_in_parameter`](crate::piecewise::ExactPieces::is_affine_in_parameter)), the list is proven to be complete, for the problem
/// that the floating-point numbers define, at the exact point x* approximated by `x`: at x* the equalities of all pieces that are active at
/// `x` within the tolerance hold; unknowns that they leave free, α if it is one, are as in `x`. It is proven that x* exists and is unique,
/// that it lies within `tolerance` of `x`, which pieces are active there, and what arms each selection of these has; by error bounds where
/// these suffice, in rational arithmetic where not. Where conditions are affine in (y, α) together the arms are the solution set itself
/// near x*; where coefficients vary with α they are its directions. The list is [undecided](Completeness::Undecided) where kinks within the
/// tolerance of `x` do not meet in one exact point ([`Doubt::Coincidence`]), at walls and for all other maps ([`Doubt::NoCoefficients`]).
///
/// Where the cap on nodes or the limit of time is reached, or the number of rows times unknowns exceeds 2²⁶ and there are more than 4096 active
/// selections, a local search follows: Newton's method on the directional problem for α̇ = ±1 from random
/// selections and from neighbours of those found. The list is then incomplete, even if no arm is missing.
///
/// # Errors
/// Options out of range, maps that are no curves, wrong length, values that are not finite, [`EnumerationError::Outside`].
///
/// ```
/// use semismooth::complementarity::{AffineFunction, Mcp};
/// use semismooth::enumeration::{EnumerationOptions, all_arms};
/// use semismooth::sparse::Matrix;
/// // 0 ≤ y ⟂ 3 y − 7 α + 1 ≥ 0: y = 0 as long as α ≤ 1/7, which is no floating-point number.
/// let f = AffineFunction::new(Matrix::from_rows(&[[3.0, -7.0]])?, vec![1.0])?;
/// let map = Mcp::new(f, vec![0.0], vec![f64::INFINITY])?;
/// let found = all_arms(&map, &[0.0, 1.0 / 7.0], &EnumerationOptions::default())?;
/// assert!(found.completeness.is_complete());
/// assert_eq!((found.arms.len(), found.orientation), (2, Some((1, 1))));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn all_arms(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    options: &EnumerationOptions,
) -> Result<DirectionalArms, EnumerationError> {
    arms_of(&map, x, options)
}

fn arms_of(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    options: &EnumerationOptions,
) -> Result<DirectionalArms, EnumerationError> {
    options.validate()?;
    let (m, n) = (map.num_vars(), map.num_residuals());
    if m != n + 1 {
        return Err(PiecewiseError::Dimensions {
            vars: m,
            residuals: n,
            expected: "one variable more than residuals (the parameter)",
        }
        .into());
    }
    check_vector("the point x", x, m)?;
    let scaled = Scaled::new(map, &[], (x[n], x[n]))?;
    let mut z = x.to_vec();
    scaled.scale(&mut z);
    let active = active_at(&scaled, &z, options.tolerance)?;
    let deadline = Deadline::after(options.max_time);
    let near = |d: &[f64]| {
        let mut d = d.to_vec();
        scaled.scale(&mut d);
        norm(&d) <= options.tolerance * (1.0 + norm(&z))
    };
    let searched = || searched_arms(&scaled, &z, &active, options, deadline);
    // Where many selections meet, a search in floating-point numbers first shows whether the limits suffice: proofs take longer.
    let sizes = active.degenerate_sites().iter().map(|s| s.1.len() as f64);
    let first = (sizes.product::<f64>() > FEW as f64).then(searched).transpose()?;
    let capped = |f: &DirectionalArms| matches!(f.completeness, Completeness::Incomplete { .. });
    let mut doubt = None;
    if !first.as_ref().is_some_and(capped) {
        match proven_arms(map, x, &active, &near, options, deadline.half()) {
            Ok(proven) => return Ok(proven),
            Err(why) => doubt = Some(why),
        }
    }
    let mut found = first.map_or_else(searched, Ok)?;
    if let Some(doubt) = doubt.filter(|_| found.completeness.is_complete()) {
        found.completeness = Completeness::Undecided { selections: 0, doubt };
    }
    for arm in &mut found.arms {
        if let Some(rate) = arm.tangent.last_mut().filter(|r| r.abs() <= TANGENTIAL) {
            *rate = 0.0;
        }
        scaled.unscale_direction(&mut arm.tangent);
    }
    Ok(found)
}

/// The active index set and the vanishing test functions at a point, within the tolerance.
fn active_at(map: &dyn PiecewiseSmooth, x: &[f64], tolerance: f64) -> Result<ActiveSet, EnumerationError> {
    let layout = TestLayout::new(map);
    let mut theta = vec![0.0; layout.total()];
    map.test_functions(x, &mut theta);
    let mut gradient = vec![0.0; map.num_vars()];
    let mut vanishes = |k: usize| {
        let (site, test) = layout.locate(k);
        map.test_gradient(site, test, x, &mut gradient);
        theta[k].abs() <= tolerance * (1.0 + norm(x)) * norm(&gradient)
    };
    let vanishing = (0..theta.len()).filter(|&k| vanishes(k)).collect();
    let active = ActiveSet::from_tests(map, &layout, &theta, vanishing);
    match active.outside().first() {
        Some(&site) => Err(EnumerationError::Outside {
            site: map.site_name(site).into_owned(),
        }),
        None => Ok(active),
    }
}

/// The arms by a search in floating-point numbers.
fn searched_arms(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    options: &EnumerationOptions,
    deadline: Deadline<'_>,
) -> Result<DirectionalArms, EnumerationError> {
    let mut found = selections(map, x, active, options.max_nodes, deadline)?;
    if !found.complete {
        let local = local_selections(
            map,
            x,
            active,
            options.local_starts,
            SOLVES.saturating_mul(options.local_starts),
            deadline,
        )?;
        found.selections.extend(local);
        found.selections.sort_unstable();
        found.selections.dedup();
    }
    let mut collector = Collector::new(map, x, active)?;
    for selection in &found.selections {
        if deadline.is_over() {
            found.complete = false;
            break;
        }
        collector.examine(selection)?;
    }
    Ok(collector.finish(&found))
}

/// Selections that may have arms at a point.
#[derive(Debug, Clone)]
pub(crate) struct Candidates {
    pub(crate) selections: Vec<Selection>,
    pub(crate) complete: bool,
    examined: f64,
    total: f64,
    pub(super) nodes: u64,
}

/// The active selections that the directional problem does not exclude; `None` where residuals depend on the pieces of so many
/// degenerate sites that none can be excluded early.
pub(crate) fn directional_selections(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    max_nodes: u64,
    deadline: Deadline<'_>,
) -> Result<Option<Candidates>, EnumerationError> {
    directional(map, x, active, &[1.0, -1.0], max_nodes, deadline)
}

/// [`directional_selections`] for the directions with α̇ = 0 alone.
pub(super) fn level_selections(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    max_nodes: u64,
    deadline: Deadline<'_>,
) -> Result<Option<Candidates>, EnumerationError> {
    directional(map, x, active, &[], max_nodes, deadline)
}

/// The selections with directions of the given α̇, and of α̇ = 0.
fn directional(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    rates: &[f64],
    max_nodes: u64,
    deadline: Deadline<'_>,
) -> Result<Option<Candidates>, EnumerationError> {
    let Some(system) = system::directional(map, x, active, deadline)? else {
        return Ok(None);
    };
    let m = map.num_vars();
    // What is found has to be examined, too.
    let mut search = SelectionSearch::new(&system, None, max_nodes, deadline.half());
    let mut found = BTreeSet::new();
    let mut leaf = |pieces: &[usize]| -> Result<Option<Vec<Vec<usize>>>, EnumerationError> {
        let mut selection = active.first().clone();
        for ((site, _), piece) in active.degenerate_sites().iter().zip(pieces) {
            selection.set(*site, *piece);
        }
        found.insert(selection);
        Ok(None)
    };
    let level: Vec<Form> = (map.num_vars() > map.num_residuals())
        .then(|| rate(&system, m, 0.0))
        .into_iter()
        .collect();
    if let Some(unique) = unique_directions(&system, &search, m, rates, &level) {
        let mut nodes = 0;
        for (pieces, pivots) in unique {
            nodes += pivots;
            for choice in products(&pieces, &system) {
                leaf(&choice)?;
            }
        }
        let total = (rates.len() + 1) as f64 * search.total;
        return Ok(Some(Candidates {
            selections: found.into_iter().collect(),
            complete: true,
            examined: total,
            total,
            nodes,
        }));
    }
    let mut runs = 0.0;
    for &sign in rates {
        runs += 1.0;
        match search.root(&[rate(&system, m, -sign)]) {
            Ok(root) => search.run(root, &mut leaf)?,
            Err(_) => search.examined += search.total,
        }
    }
    let roots = VerticalRoots::new(&search, &level);
    runs += roots.total() as f64;
    for root in roots {
        if search.stopped {
            break;
        }
        search.run(root, &mut leaf)?;
    }
    Ok(Some(Candidates {
        selections: found.into_iter().collect(),
        complete: !search.stopped,
        examined: search.examined,
        total: runs * search.total,
        nodes: search.nodes,
    }))
}

/// For each rate α̇ the pieces at the only direction, where it is known that there is one for each and none with α̇ = 0.
fn unique_directions(
    system: &System,
    search: &SelectionSearch<'_>,
    m: usize,
    rates: &[f64],
    level: &[Form],
) -> Option<Vec<(Vec<Vec<usize>>, u64)>> {
    if rates.is_empty() {
        Complementary::new(system, search, &search.root(level).ok()?)?;
    }
    let at = |sign: &f64| {
        let root = search.root(&[rate(system, m, -sign)]).ok()?;
        Complementary::new(system, search, &root)?.solve(search)
    };
    rates.iter().map(at).collect()
}

/// All selections with one of the given pieces at each site of a system, as piece numbers of the map.
fn products(pieces: &[Vec<usize>], system: &System) -> Vec<Vec<usize>> {
    let mut all = vec![vec![0; system.sites.iter().map(|s| s.slots.len()).sum()]];
    for (site, pieces) in system.sites.iter().zip(pieces) {
        let with = |choice: &Vec<usize>, k: usize| {
            let mut choice = choice.clone();
            for (slot, piece) in site.slots.iter().zip(&site.pieces[k].pieces) {
                choice[*slot] = *piece;
            }
            choice
        };
        all = (all.iter())
            .flat_map(|choice| pieces.iter().map(move |&k| with(choice, k)))
            .collect();
    }
    all
}

fn selections(
    map: &dyn PiecewiseSmooth,
    x: &[f64],
    active: &ActiveSet,
    max_nodes: u64,
    deadline: Deadline<'_>,
) -> Result<Candidates, EnumerationError> {
    let limit = match directional_selections(map, x, active, max_nodes, deadline) {
        Ok(Some(found)) => return Ok(found),
        Ok(None) => max_nodes,
        Err(EnumerationError::TooLarge { .. }) => max_nodes.min(LARGE),
        Err(e) => return Err(e),
    };
    let sizes = active.degenerate_sites().iter().map(|s| s.1.len() as f64);
    let total = sizes.product();
    let limit = usize::try_from(limit).unwrap_or(usize::MAX);
    let limit = limit.min(GIGABYTE / map.num_sites().max(1)).max(1);
    let deadline = deadline.half();
    let intime = |s: &(usize, Selection)| !s.0.is_multiple_of(LOOKS) || !deadline.is_over();
    let listed = active.selections().take(limit).enumerate();
    let selections: Vec<Selection> = listed.take_while(intime).map(|s| s.1).collect();
    let examined = selections.len() as f64;
    Ok(Candidates {
        complete: examined >= total,
        nodes: selections.len() as u64,
        selections,
        examined,
        total,
    })
}

/// The form α̇ + constant, α being the last of m variables.
pub(super) fn rate(system: &System, m: usize, constant: f64) -> Form {
    let mut coefficients = vec![0.0; system.unknowns];
    if let Some(last) = coefficients[..m].last_mut() {
        *last = 1.0;
    }
    Form {
        coefficients,
        constant,
        error: f64::EPSILON,
    }
}

/// Root problems that together contain all rays with α̇ = 0, each normalised by an affine condition, generated one at a time. The forms
/// that have one sign in all pieces of their site have a sum ≥ 0, which is 0 only where all of them vanish: so either the sum is 1, or they
/// all vanish and one of the remaining unknowns is ±1, those before it being 0.
struct VerticalRoots {
    normalised: Option<Table>,
    rest: Option<Table>,
    /// The next value of the first remaining unknown.
    value: f64,
}

impl VerticalRoots {
    /// The directions for which the forms of `level` vanish.
    fn new(search: &SelectionSearch<'_>, level: &[Form]) -> Self {
        let mut roots = Self {
            normalised: None,
            rest: None,
            value: 1.0,
        };
        let Ok(flat) = search.root(level) else {
            return roots;
        };
        let implied = search.implied(&flat);
        let mut normalised = flat.clone();
        if normalised.fix_form(&flat.combination(&implied, -1.0)).is_ok() {
            roots.normalised = Some(normalised);
        }
        let mut rest = flat;
        if implied.iter().all(|(var, _)| rest.fix(*var).is_ok()) {
            roots.rest = Some(rest);
        }
        roots
    }

    /// Their number at the beginning.
    fn total(&self) -> usize {
        usize::from(self.normalised.is_some()) + 2 * self.rest.as_ref().map_or(0, Table::dimension)
    }
}

impl Iterator for VerticalRoots {
    type Item = Table;

    fn next(&mut self) -> Option<Table> {
        if let Some(normalised) = self.normalised.take() {
            return Some(normalised);
        }
        let rest = self.rest.as_mut().filter(|rest| rest.dimension() > 0)?;
        let mut root = rest.clone();
        root.set_column(0, self.value);
        if self.value < 0.0 {
            rest.set_column(0, 0.0);
        }
        self.value = -self.value;
        Some(root)
    }
}
