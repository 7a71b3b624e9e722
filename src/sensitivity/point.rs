//! A solution, the kinks it lies on, and whether the solutions nearby are one function of the parameters.

use super::element::{Element, Known, WIDTH, derivatives, rate};
use super::{DerivativeDoubt, SensitivityError, limit};
use crate::input::{check_length, check_vector};
use crate::linear::{AutoSolver, LinearError};
use crate::piecewise::{
    ActiveSet, LocalUniqueness, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection, TestLayout,
    Vanishing, implicit_verdict, select_pieces,
};
use crate::sparse::{Matrix, max_abs};
use crate::spread::Random;
use crate::tolerances::{ALLOWANCE, HALF_DIGITS, MOVED, ROUNDING};

/// Steps of Newton's method that move the point given to the solution it is an approximation of.
const STEPS: usize = 12;
/// Random directions from which the rounding of test functions is found.
const PROBES: usize = 6;
/// Parameters up to which the derivatives of selections are compared column by column; of more, along random
/// combinations.
const COLUMNS: usize = 64;
const COMBINATIONS: u64 = 8;
/// Multiple of the rounding of two rates from which they differ; they agree up to ALLOWANCE times it.
pub(super) const OTHER: f64 = 1e4;

/// How the derivatives −J_σ⁻¹ ∂_θH^σ of the active selections compare.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Agreement {
    /// They are the same up to rounding.
    Same,
    /// They differ along these changes of the parameters.
    Differ(Vec<Vec<f64>>),
    /// Rounding hides whether they differ.
    Unclear,
}

/// What is known of the solutions near a kink.
#[derive(Debug, Clone)]
pub(super) enum Verdict {
    /// One Lipschitz function of the parameters.
    Unique(Agreement),
    Other(LocalUniqueness),
}

/// A solution with its local data.
#[derive(Debug, Clone)]
pub(super) struct Solved {
    pub(super) n: usize,
    /// (x, θ).
    pub(super) at: Vec<f64>,
    pub(super) layout: TestLayout,
    pub(super) theta: Vec<f64>,
    pub(super) active: ActiveSet,
    pub(super) vanishing: Vec<Vanishing>,
    /// The least test function that does not vanish, in multiples of what rounding may hide.
    pub(super) margin: f64,
    /// The only active selection, away from kinks.
    pub(super) smooth: Option<Element>,
    /// At kinks.
    pub(super) verdict: Option<Verdict>,
    /// Whether an active selection may be singular for all that is known of the derivatives.
    pub(super) is_doubtful: bool,
}

impl Solved {
    pub(super) fn new(
        map: &dyn PiecewiseSmooth,
        x: &[f64],
        parameters: &[f64],
        may_be_idle: bool,
    ) -> Result<Self, SensitivityError> {
        let (m, n) = (map.num_vars(), map.num_residuals());
        if m <= n {
            return Err(SensitivityError::NoParameters {
                vars: m,
                residuals: n,
            });
        }
        check_vector("the solution x", x, n)?;
        check_vector("the parameters", parameters, m - n)?;
        let pattern = map.pattern();
        let entries = pattern.nrows() * pattern.ncols();
        check_length("the declared pattern (rows times columns)", entries, n * m)?;
        let mut at = x.to_vec();
        at.extend(parameters);
        let layout = TestLayout::new(map);
        if !may_be_idle {
            check_entering(map, &at, &layout)?;
        }
        let widths = polish(map, &layout, &mut at)?;
        let theta = tests(map, &layout, &at)?;
        let mut hidden = hidden(map, &layout, &at, &spreads(&at, &widths), None);
        if let Some(own) = map.derivatives() {
            own.test_roundings(&at, &mut hidden);
        }
        let is_vanishing = |&t: &usize| theta[t].abs() <= hidden[t];
        let vanishing: Vec<usize> = (0..theta.len()).filter(is_vanishing).collect();
        let active = ActiveSet::from_tests(map, &layout, &theta, vanishing);
        if let Some(&site) = active.outside().first() {
            let site = map.site_name(site).into_owned();
            return Err(SensitivityError::Outside { site });
        }
        let clear = (0..theta.len()).filter(|t| active.vanishing().binary_search(t).is_err());
        let margin = clear.fold(f64::INFINITY, |least, t| least.min(theta[t].abs() / hidden[t]));
        let gradient = |&t: &usize| Vanishing::new(map, &layout, active.first(), t, &at);
        let mut solved = Self {
            n,
            vanishing: active.vanishing().iter().map(gradient).collect(),
            layout,
            theta,
            margin,
            smooth: None,
            verdict: None,
            is_doubtful: false,
            active,
            at,
        };
        if solved.active.is_singleton() {
            solved.smooth = Some(Element::new(map, &solved.at, solved.active.first())?);
        } else {
            solved.verdict = Some(solved.examined(map)?);
        }
        Ok(solved)
    }

    pub(super) fn num_parameters(&self) -> usize {
        self.at.len() - self.n
    }

    /// Says nothing of the solutions near a kink where an active selection has no larger reciprocal condition.
    pub(super) fn doubt_below(
        &mut self,
        map: &dyn PiecewiseSmooth,
        rcond: f64,
    ) -> Result<(), SensitivityError> {
        let total = self.active.total();
        if self.verdict.is_none() || is_too_many(total, self.n) {
            return Ok(());
        }
        for selection in self.active.selections() {
            match Element::new(map, &self.at, &selection) {
                Ok(mut element) => self.is_doubtful |= element.rcond() <= rcond,
                Err(SensitivityError::Irregular { .. }) => self.is_doubtful = true,
                Err(e) => return Err(e),
            }
        }
        if self.is_doubtful {
            self.verdict = Some(Verdict::Other(unexamined(total)));
        }
        Ok(())
    }

    /// Whether the solutions nearby are one function, and the active selections have one derivative.
    fn examined(&self, map: &dyn PiecewiseSmooth) -> Result<Verdict, SensitivityError> {
        let total = self.active.total();
        if is_too_many(total, self.n) {
            return Ok(Verdict::Other(unexamined(total)));
        }
        let probes = probes(self.num_parameters());
        let mut first: Vec<Known> = Vec::new();
        let (mut differ, mut unclear) = (vec![false; probes.len()], false);
        let mut jacobian = Matrix::zeros(map.pattern());
        let mut compare = |selection: &Selection, solver: &mut AutoSolver| {
            derivatives(map, &self.at, selection, &mut jacobian)?;
            for (k, probe) in probes.iter().enumerate() {
                if differ[k] {
                    continue;
                }
                let found =
                    rate(&jacobian, solver, probe).and_then(|v| Ok(Known::new(&jacobian, solver, v, probe)?));
                match found {
                    Ok(found) if first.len() == k => first.push(found),
                    Ok(found) => match compared(&first[k], &found) {
                        Compared::Same => {}
                        Compared::Differ => differ[k] = true,
                        Compared::Unclear => unclear = true,
                    },
                    Err(PiecewiseError::Linear(LinearError::Inaccurate { .. })) if first.len() > k => {
                        unclear = true;
                    }
                    Err(e) => return Err(e),
                }
            }
            Ok(())
        };
        let verdict = implicit_verdict(map, &self.at, &self.active, limit(self.n), &mut compare)?;
        Ok(match verdict {
            LocalUniqueness::Lipschitz { .. } if differ.contains(&true) => {
                let all = probes.into_iter().zip(differ);
                let list = all.filter_map(|(probe, differ)| differ.then_some(probe));
                Verdict::Unique(Agreement::Differ(list.collect()))
            }
            LocalUniqueness::Lipschitz { .. } if unclear => Verdict::Unique(Agreement::Unclear),
            LocalUniqueness::Lipschitz { .. } => Verdict::Unique(Agreement::Same),
            other => Verdict::Other(other),
        })
    }
}

/// Changes of the parameters that tell derivatives apart.
fn probes(k: usize) -> Vec<Vec<f64>> {
    if k <= COLUMNS {
        let unit = |j: usize| (0..k).map(|i| f64::from(u8::from(i == j))).collect();
        return (0..k).map(unit).collect();
    }
    let random = |seed: u64| {
        let mut spread = Random::new(seed);
        (0..k).map(|_| spread.symmetric()).collect()
    };
    (1..=COMBINATIONS).map(random).collect()
}

pub(super) enum Compared {
    Same,
    Differ,
    Unclear,
}

/// Compares two vectors with the rounding of their components: they are the same as far as that of the rows' terms explains, and differ
/// where that of elimination does not explain it.
pub(super) fn compared(a: &Known, b: &Known) -> Compared {
    let mut unclear = false;
    for i in 0..a.value.len() {
        let (gap, rounding) = ((a.value[i] - b.value[i]).abs(), a.widths[i] + b.widths[i]);
        if gap > OTHER * rounding.max(a.floors[i] + b.floors[i]) {
            return Compared::Differ;
        }
        unclear |= gap > ALLOWANCE * rounding;
    }
    if unclear {
        Compared::Unclear
    } else {
        Compared::Same
    }
}

/// Whether two vectors differ by more than the errors of their components explain.
pub(crate) fn differ(a: &Known, b: &Known) -> bool {
    matches!(compared(a, b), Compared::Differ)
}

/// Why nothing is said of solutions near the origin, where more selections of a map are active than are examined.
pub(crate) fn too_many(map: &dyn PiecewiseSmooth) -> Option<DerivativeDoubt> {
    let layout = TestLayout::new(map);
    let mut theta = vec![0.0; layout.total()];
    map.test_functions(&vec![0.0; map.num_vars()], &mut theta);
    let vanishing = (0..theta.len()).filter(|&t| theta[t] == 0.0).collect();
    let total = ActiveSet::from_tests(map, &layout, &theta, vanishing).total();
    is_too_many(total, map.num_residuals()).then(|| DerivativeDoubt::NotUnique(Box::new(unexamined(total))))
}

pub(super) fn is_too_many(total: Option<u128>, n: usize) -> bool {
    total.is_none_or(|t| t > u128::from(limit(n)))
}

/// The first ones of so many selections say nothing.
fn unexamined(total: Option<u128>) -> LocalUniqueness {
    LocalUniqueness::Undecided {
        examined: 0,
        total,
        at_least: 0.0,
    }
}

/// The values of all test functions, which must be finite.
fn tests(map: &dyn PiecewiseSmooth, layout: &TestLayout, at: &[f64]) -> Result<Vec<f64>, PiecewiseError> {
    let mut theta = vec![0.0; layout.total()];
    map.test_functions(at, &mut theta);
    check_vector("the test functions", &theta, theta.len())?;
    Ok(theta)
}

/// Each parameter must have a place in the derivatives of the equations or of the test functions.
fn check_entering(
    map: &dyn PiecewiseSmooth,
    at: &[f64],
    layout: &TestLayout,
) -> Result<(), SensitivityError> {
    let (pattern, n) = (map.pattern(), map.num_residuals());
    let empty = (n..at.len()).filter(|&j| pattern.col_ptr()[j] == pattern.col_ptr()[j + 1]);
    for j in empty {
        let (mut unit, mut rates) = (vec![0.0; at.len()], vec![0.0; layout.total()]);
        unit[j] = 1.0;
        map.test_derivatives(at, &unit, &mut rates);
        if max_abs(&rates) == 0.0 {
            return Err(SensitivityError::NotEntering { parameter: j - n });
        }
    }
    Ok(())
}

/// Moves a point to the solution it is near, and returns by how much roundings of the equations' terms may
/// move that.
fn polish(
    map: &dyn PiecewiseSmooth,
    layout: &TestLayout,
    at: &mut [f64],
) -> Result<Vec<f64>, SensitivityError> {
    let n = map.num_residuals();
    let start = at.to_vec();
    let mut sizes = vec![1.0; at.len()];
    map.typical_sizes(&mut sizes);
    let largest = max_abs(at);
    let mut selection = Selection::uniform(layout.num_sites(), 0);
    let mut r = vec![0.0; n];
    let mut residual = 0.0;
    let mut noise = None;
    for step in 0..STEPS {
        select_pieces(map, layout, &tests(map, layout, at)?, false, 0.0, &mut selection);
        map.residual(&selection, at, &mut r);
        check_vector("the residual", &r, n)?;
        if step == 0 {
            residual = max_abs(&r);
        }
        let mut element = match Element::new(map, at, &selection) {
            Ok(element) => element,
            // At a kink another selection may be regular.
            Err(SensitivityError::Irregular { .. }) if max_abs(&r) <= ROUNDING * largest => {
                return Ok(vec![0.0; n]);
            }
            Err(e) => return Err(e),
        };
        let d = element.step(&r)?;
        let widths = element.widths(at)?;
        if step == 0 {
            let terms = sizes.iter_mut().zip(&widths);
            terms.for_each(|(s, w)| *s = s.abs().max(w / WIDTH));
        }
        at.iter_mut().zip(&d).for_each(|(x, d)| *x += d);
        let moved = |j: &usize| (at[*j] - start[*j]).abs() / sizes[*j];
        let farthest = (0..n).max_by(|a, b| moved(a).total_cmp(&moved(b))).unwrap_or(0);
        let is_near = moved(&farthest) <= MOVED;
        if !is_near {
            return Err(SensitivityError::NoSolution {
                variable: farthest,
                distance: (at[farthest] - start[farthest]).abs(),
                residual,
            });
        }
        if d.iter().zip(&widths).all(|(d, w)| d.abs() <= *w) {
            return Ok(widths);
        }
        let is_small = d.iter().zip(&sizes).all(|(d, s)| d.abs() <= HALF_DIGITS * s);
        noise = is_small.then(|| d.iter().zip(widths).map(|(d, w)| w.max(d.abs())).collect());
    }
    noise.ok_or(SensitivityError::NoSolution {
        variable: 0,
        distance: f64::INFINITY,
        residual,
    })
}

/// By how much rounding may move each variable.
pub(super) fn spreads(at: &[f64], widths: &[f64]) -> Vec<f64> {
    let own = at.iter().map(|v| ALLOWANCE * f64::EPSILON * v.abs());
    let widths = widths.iter().chain(std::iter::repeat(&0.0));
    own.zip(widths).map(|(own, w)| own + w).collect()
}

/// What each test function may change by where each variable moves by its `spread`: from derivatives along
/// random directions. With a selection those of its own test functions.
pub(super) fn hidden(
    map: &dyn PiecewiseSmooth,
    layout: &TestLayout,
    at: &[f64],
    spread: &[f64],
    selection: Option<&Selection>,
) -> Vec<f64> {
    let mut hidden = vec![0.0_f64; layout.total()];
    let largest = max_abs(spread);
    if largest == 0.0 {
        return hidden;
    }
    let (mut random, mut rates) = (Random::new(2), hidden.clone());
    for _ in 0..PROBES {
        // Of length about 1: differences along far shorter directions would be rounding.
        let d: Vec<f64> = spread.iter().map(|s| s / largest * random.symmetric()).collect();
        match selection {
            Some(selection) => map.tests_of_selection(selection, at, Some(&d), &mut rates),
            None => map.test_derivatives(at, &d, &mut rates),
        }
        for (h, r) in hidden.iter_mut().zip(&rates) {
            *h = h.max(ALLOWANCE * largest * r.abs());
        }
    }
    hidden
}
