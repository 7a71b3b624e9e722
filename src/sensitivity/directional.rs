//! Directional derivatives at kinks: the piecewise-linear problem H′((x, θ); (v, δ)) = 0, solved selection by
//! selection.

use std::fmt;

use super::SensitivityError;
use super::element::Element;
use super::parameters::Line;
use super::point::{OTHER, Solved, Verdict, is_too_many};
use crate::continuation::ContinuationError;
use crate::enumeration::{DirectionalArm, EnumerationOptions, all_arms};
use crate::input::check_vector;
use crate::linear::LinearError;
use crate::piecewise::{ActiveSet, PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Selection};
use crate::sparse::max_abs;
use crate::tolerances::{HALF_DIGITS, TANGENTIAL};
use crate::words::Count;

/// Nodes of the search where too many selections are active to examine each: seconds.
const NODES: u64 = 20_000;

/// How a solution moves as the parameters move along a direction δ.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Directional {
    /// The solutions near θ are one function x of the parameters, with this directional derivative x′(θ; δ)
    /// (length n).
    Derivative(Vec<f64>),
    /// It is not certified that they are one function.
    Branches {
        /// The directions v in which solutions leave to first order: x + s v + o(s) at θ + s δ, s > 0. None
        /// at a fold whose curve goes back.
        branches: Vec<Vec<f64>>,
        /// Whether no active selection was singular: then there are no others to first order, but for
        /// rounding.
        complete: bool,
    },
}

impl Directional {
    /// The directional derivative, where there is one solution function.
    #[must_use]
    pub fn derivative(&self) -> Option<&[f64]> {
        match self {
            Self::Derivative(v) => Some(v),
            Self::Branches { .. } => None,
        }
    }
}

impl fmt::Display for Directional {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Derivative(_) => f.write_str("directional derivative of the only solution nearby"),
            Self::Branches { branches, complete } => {
                let count = Count(branches.len(), "one-sided branch", "one-sided branches");
                let least = if *complete { "" } else { "at least " };
                write!(f, "{least}{count}, not known to be one function")
            }
        }
    }
}

/// A solution of the directional problem.
#[derive(Debug, Clone)]
pub(super) struct Branch {
    pub(super) selection: Selection,
    pub(super) rate: Vec<f64>,
    /// How far roundings may have moved each component of the rate.
    errors: Vec<f64>,
    /// How far the direction points into the cell of the selection: the least rate of a test function
    /// relative to its terms.
    margin: f64,
}

impl Solved {
    /// How the solution moves along δ.
    pub(super) fn directional(
        &mut self,
        map: &dyn PiecewiseSmooth,
        delta: &[f64],
    ) -> Result<Directional, SensitivityError> {
        check_vector("the change of the parameters", delta, self.num_parameters())?;
        if let Some(element) = &mut self.smooth {
            return Ok(Directional::Derivative(element.jvp(delta)?));
        }
        if matches!(self.verdict, Some(Verdict::Unique(_))) {
            let branch = self.branch(map, &self.active, delta)?;
            return Ok(Directional::Derivative(branch.rate));
        }
        let (branches, complete) = match is_too_many(self.active.total(), self.n) {
            true => self.searched(map, delta)?,
            false => self.all_branches(map, delta)?,
        };
        Ok(Directional::Branches { branches, complete })
    }

    /// The only branch along δ, of the selections of `active`.
    pub(super) fn branch(
        &self,
        map: &dyn PiecewiseSmooth,
        active: &ActiveSet,
        delta: &[f64],
    ) -> Result<Branch, SensitivityError> {
        let mut best: Option<Branch> = None;
        for selection in active.selections() {
            let found = match self.candidate(map, active, selection, delta) {
                Ok(found) => found,
                // Selections whose cells have no points nearby may be singular.
                Err(SensitivityError::Irregular { .. }) => continue,
                Err(e) => return Err(e),
            };
            let is_better = best.as_ref().is_none_or(|b| found.margin > b.margin);
            if is_better {
                best = Some(found);
            }
            if best.as_ref().is_some_and(|b| b.margin > TANGENTIAL) {
                break;
            }
        }
        (best.filter(|b| b.margin >= -TANGENTIAL)).ok_or(SensitivityError::Rounding)
    }

    /// All branches along δ, and whether the list is complete.
    fn all_branches(
        &self,
        map: &dyn PiecewiseSmooth,
        delta: &[f64],
    ) -> Result<(Vec<Vec<f64>>, bool), SensitivityError> {
        let active = &self.active;
        let (mut list, mut complete): (Vec<Branch>, bool) = (Vec::new(), !self.is_doubtful);
        for selection in active.selections() {
            let found = match self.candidate(map, active, selection, delta) {
                Ok(found) => found,
                Err(SensitivityError::Irregular { .. }) => {
                    complete = false;
                    continue;
                }
                Err(e) => return Err(e),
            };
            // Two branches are those that are shown to differ.
            let is_known = |b: &Branch| {
                let largest = max_abs(&b.rate).max(max_abs(&found.rate));
                let mut errors = b.errors.iter().zip(&found.errors).map(|(a, b)| OTHER * (a + b));
                let near = |(a, b): (&f64, &f64)| {
                    (a - b).abs() <= (HALF_DIGITS * largest).max(errors.next().unwrap_or(0.0))
                };
                b.rate.iter().zip(&found.rate).all(near)
            };
            if found.margin >= -TANGENTIAL && !list.iter().any(is_known) {
                list.push(found);
            }
        }
        Ok((list.into_iter().map(|b| b.rate).collect(), complete))
    }

    /// All branches along δ by the pruned search for arms of the curve H(x, θ + s δ) = 0, or by its pivots where
    /// that problem is a definite complementarity problem in the directions of the degenerate sites.
    fn searched(
        &self,
        map: &dyn PiecewiseSmooth,
        delta: &[f64],
    ) -> Result<(Vec<Vec<f64>>, bool), SensitivityError> {
        let line = Line::new(map, &self.at[self.n..], delta, 1.0)?;
        let mut start = self.at[..self.n].to_vec();
        start.push(0.0);
        let options = EnumerationOptions::default().with_max_nodes(NODES);
        let found = all_arms(&line, &start, &options).map_err(ContinuationError::from)?;
        let ahead = found.arms.iter().filter(|arm| arm.rate() > 0.0);
        let branch = |arm: &DirectionalArm| {
            let along = arm.tangent[..self.n].iter();
            along.map(|t| t / arm.rate()).collect()
        };
        let complete = !found.completeness.has_gaps() && found.unresolved.is_empty();
        Ok((ahead.map(branch).collect(), complete))
    }

    /// What a selection gives along δ, and how far that points into its cell.
    fn candidate(
        &self,
        map: &dyn PiecewiseSmooth,
        active: &ActiveSet,
        selection: Selection,
        delta: &[f64],
    ) -> Result<Branch, SensitivityError> {
        let mut element = Element::new(map, &self.at, &selection)?;
        let rate = match element.jvp(delta) {
            Err(SensitivityError::Map(PiecewiseError::Linear(LinearError::Inaccurate { .. }))) => {
                return Err(SensitivityError::Rounding);
            }
            other => other?,
        };
        let known = element.known_at(map, &self.at, rate, delta)?;
        let (rate, widths) = (known.value, known.widths.into_iter().zip(known.floors));
        let errors: Vec<f64> = widths.map(|(a, b)| a.max(b)).collect();
        let mut d = rate.clone();
        d.extend(delta);
        let mut margin = f64::INFINITY;
        for site in active.degenerate_sites().iter().map(|s| s.0) {
            for facet in map.cell(site, selection.piece(site)) {
                let index = self.layout.range(site).start + facet.test();
                if active.vanishing().binary_search(&index).is_ok() {
                    margin =
                        margin.min(facet.sign() * self.relative_rate(map, &selection, index, (&d, &errors)));
                }
            }
        }
        Ok(Branch {
            selection,
            rate,
            errors,
            margin,
        })
    }

    /// The rate of a vanishing test function along d against the sum of its terms; 0 where it has none, or no more than the errors of the
    /// first components of d explain.
    fn relative_rate(
        &self,
        map: &dyn PiecewiseSmooth,
        selection: &Selection,
        index: usize,
        (d, errors): (&[f64], &[f64]),
    ) -> f64 {
        let position = self.active.vanishing().binary_search(&index);
        let Some(test) = position.ok().and_then(|k| self.vanishing.get(k)) else {
            return 0.0;
        };
        let own = map
            .has_nested_kinks()
            .then(|| test.of_selection(map, &self.layout, selection, &self.at));
        let gradient = &own.as_ref().unwrap_or(test).gradient;
        let terms = gradient.iter().zip(d).map(|(g, d)| g * d);
        let (sum, size) = terms.fold((0.0, 0.0), |(sum, size), t| (sum + t, size + t.abs()));
        let error: f64 = gradient.iter().zip(errors).map(|(g, e)| (g * e).abs()).sum();
        if sum.abs() > error { sum / size } else { 0.0 }
    }

    /// The selections active along x + s v, θ + s δ for small s > 0, where a branch leaves, and test
    /// functions at such a point: those that grow or fall have that sign.
    pub(super) fn narrowed(
        &self,
        map: &dyn PiecewiseSmooth,
        active: &ActiveSet,
        theta: &mut [f64],
        (branch, delta): (&Branch, &[f64]),
    ) -> ActiveSet {
        let mut d = branch.rate.clone();
        d.extend(delta);
        let mut vanishing = Vec::new();
        for &index in active.vanishing() {
            let rate = self.relative_rate(map, &branch.selection, index, (&d, &branch.errors));
            if rate.abs() <= TANGENTIAL {
                vanishing.push(index);
            } else {
                theta[index] = rate;
            }
        }
        ActiveSet::from_tests(map, &self.layout, theta, vanishing)
    }

    /// The element of the generalised derivative by differentiation along a frame of directions, one after
    /// the other.
    pub(super) fn lexicographic<M: AsRef<[f64]>>(
        &self,
        map: &dyn PiecewiseSmooth,
        frame: impl IntoIterator<Item = M>,
    ) -> Result<Element, SensitivityError> {
        match &self.verdict {
            None => {
                if let Some(element) = &self.smooth {
                    return Ok(element.clone());
                }
            }
            Some(Verdict::Unique(_)) => {}
            Some(Verdict::Other(verdict)) => {
                let verdict = Box::new(verdict.clone());
                return Err(SensitivityError::NotUnique { verdict });
            }
        }
        let (mut active, mut theta) = (self.active.clone(), self.theta.clone());
        let mut selection = active.first().clone();
        for delta in frame {
            if active.is_singleton() {
                break;
            }
            let branch = self.branch(map, &active, delta.as_ref())?;
            active = self.narrowed(map, &active, &mut theta, (&branch, delta.as_ref()));
            selection = branch.selection;
        }
        let last = if active.is_singleton() {
            active.first()
        } else {
            &selection
        };
        Element::new(map, &self.at, last)
    }
}
