use std::fmt;
use std::ops::ControlFlow;

use crate::InputError;
use crate::contact::CondensedContact;
use crate::contact::law::GivenBound;
use crate::contact::law::NodeLaw;
use crate::contact::search::ReducedNewton;
use crate::contact::{ContactError, ContactOptions};
use crate::input::check_vector;
use crate::input::{check_options, not_negative};
use crate::options::setters;
use crate::piecewise::{PiecewiseSmooth, Selection, select};
use crate::sparse::norm;
use crate::tolerances::SAME;
use crate::words::{Size, iterations};

/// Number of iterations without a new smallest change after which the iteration has stagnated.
const STAGNATION: usize = 100;

/// Options of [`fixed_point`]. The defaults suit most problems.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct FixedPointOptions {
    /// ω in (0, 1]: (φ, g) ← (1 − ω)(φ, g) + ω Ψ(φ, g). Default 1.
    pub relaxation: f64,
    /// The iteration ends when λ changes by less than this, relative to its norm. Default 1e-11. Rounding errors of the inner problems may
    /// exceed it; the iteration then [stagnates](FixedPointReport::stagnated).
    pub tolerance: f64,
    /// Largest number of iterations. Default 10 000.
    pub max_iterations: usize,
    /// How the inner problems are solved.
    pub contact: ContactOptions,
}

impl Default for FixedPointOptions {
    fn default() -> Self {
        Self {
            relaxation: 1.0,
            tolerance: 1e-11,
            max_iterations: 10_000,
            contact: ContactOptions::default(),
        }
    }
}

impl FixedPointOptions {
    setters! {
        /// Sets the relaxation ω.
        with_relaxation(relaxation: f64);
        /// Sets the tolerance.
        with_tolerance(tolerance: f64);
        /// Sets the largest number of iterations.
        with_max_iterations(max_iterations: usize);
        /// Sets how the inner problems are solved.
        with_contact(contact: ContactOptions);
    }

    /// Checks the ranges.
    ///
    /// # Errors
    /// [`InputError::Option`] names the option out of range.
    pub fn validate(&self) -> Result<(), InputError> {
        let relaxation = self.relaxation > 0.0 && self.relaxation <= 1.0;
        check_options(&[
            ("relaxation", self.relaxation, relaxation, "in (0, 1]"),
            not_negative("tolerance", self.tolerance),
        ])?;
        self.contact.validate()
    }
}

/// What [`fixed_point`] found.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FixedPointReport {
    /// The last iterate (λν, λt, α).
    pub x: Vec<f64>,
    /// Whether the tolerance was met.
    pub converged: bool,
    /// Whether the iteration ended because its changes, below 1e-9, had no new minimum for 100 iterations: they are rounding.
    #[cfg_attr(feature = "serde", serde(default))]
    pub stagnated: bool,
    /// Relative changes ‖Δλ‖/‖λ‖, one an iteration.
    pub changes: Vec<f64>,
    /// Number of contact nodes whose piece changed, one an iteration.
    #[cfg_attr(feature = "serde", serde(default))]
    pub nodes_changed: Vec<usize>,
}

/// Factor up to which changes above the smallest one count as noise.
const ABOVE_NOISE: f64 = 100.0;
/// Least and largest number of ratios of changes from which a rate is computed.
const RATIOS: [usize; 2] = [3, 10];

/// "converged after 12 iterations, last change 1.0e-13": in one line.
impl fmt::Display for FixedPointReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let how = match (self.converged, self.stagnated) {
            (true, _) => "converged",
            (_, true) => "changes are rounding",
            _ => "not converged",
        };
        write!(f, "{how} after {}", iterations(self.iterations()))?;
        match self.changes.last() {
            Some(change) => write!(f, ", last change {}", Size(*change)),
            None => Ok(()),
        }
    }
}

impl FixedPointReport {
    /// Number of iterations.
    #[must_use]
    pub fn iterations(&self) -> usize {
        self.changes.len()
    }

    /// The observed contraction rate: geometric mean of the last ratios of changes (3 to 10) since a node changed its piece.
    ///
    /// Changes within a factor of 100 of the smallest one are left out as noise once that is below 1e-9. `None` with fewer than three
    /// ratios.
    #[must_use]
    pub fn contraction(&self) -> Option<f64> {
        let begin = (self.nodes_changed.iter())
            .rposition(|n| *n > 0)
            .map_or(0, |k| k + 1);
        let tail = self.changes.get(begin..)?;
        let smallest = tail.iter().copied().fold(f64::INFINITY, f64::min);
        // Problems within the iteration are solved to rounding: what is left of changes that become small is
        // noise.
        let floor = if smallest < SAME {
            ABOVE_NOISE * smallest.max(f64::EPSILON)
        } else {
            0.0
        };
        let above = &tail[..tail.iter().take_while(|c| **c > floor).count()];
        let ratios = above.len().saturating_sub(1).min(RATIOS[1]);
        (ratios >= RATIOS[0]).then(|| {
            let last = above.len() - 1;
            (above[last] / above[last - ratios]).powf(1.0 / ratios as f64)
        })
    }
}

/// The fixed-point iteration of Haslinger, Kučera and Vlach (2008): Ψ(φ, g) = (‖u_t‖, λν) of the problem with friction coefficients
/// F(φ) and given bound g. Each inner problem (Tresca friction) is solved by PS-Newton. The iteration starts with φ and g of `start`.
///
/// # Complexity
/// Each iteration is a [`solve`](CondensedContact::solve) from the solution before.
///
/// # Errors
/// Wrong lengths, options out of range, laws that bear tension, inner problems that cannot be solved. Failure to converge is not an error: see
/// [`FixedPointReport`].
pub fn fixed_point<L: NodeLaw>(
    problem: &CondensedContact<L>,
    start: &[f64],
    options: &FixedPointOptions,
) -> Result<FixedPointReport, ContactError> {
    fixed_point_observed(problem, start, options, |_| ControlFlow::Continue(()))
}

/// [`fixed_point`] with an observer, called after each iteration, that may stop it.
///
/// # Errors
/// As [`fixed_point`]. Being stopped is not an error either.
pub fn fixed_point_observed<L: NodeLaw>(
    problem: &CondensedContact<L>,
    start: &[f64],
    options: &FixedPointOptions,
    mut observe: impl FnMut(&FixedPointReport) -> ControlFlow<()>,
) -> Result<FixedPointReport, ContactError> {
    options.validate()?;
    let omega = options.relaxation;
    let law = problem.node_law();
    if law.num_tests() == 0 || (0..problem.num_contacts()).any(|node| law.tension(node) != 0.0) {
        return Err(ContactError::Invalid {
            what: "the fixed-point iteration needs λν ≥ 0 and ‖λt‖ ≤ F λν: the law bears tension".to_owned(),
        });
    }
    let worn = |node: usize| law.wear(problem.law().history_of(node)) > 0.0;
    if (0..problem.num_contacts()).any(worn) {
        return Err(ContactError::Invalid {
            what: "the fixed-point iteration needs u_ν ≤ gap: nodes are worn; take their depths into the gap"
                .to_owned(),
        });
    }
    let q = problem.num_residuals();
    check_vector("the solution x", start, problem.num_vars())?;
    let begin = problem.nodes(start);
    let alpha = start[q];
    let mut slips: Vec<f64> = begin.iter().map(crate::contact::LocalValues::slip_norm).collect();
    let mut pressures: Vec<f64> = begin.iter().map(|v| v.pressure.max(0.0)).collect();
    let mut nodes = begin;
    let mut inner = problem.with_law(GivenBound::new(
        problem.node_law().num_tangents(),
        vec![0.0; slips.len()],
        vec![[0.0; 2]; slips.len()],
    )?)?;
    let mut report = FixedPointReport {
        x: start.to_vec(),
        converged: false,
        stagnated: false,
        changes: Vec::new(),
        nodes_changed: Vec::new(),
    };
    let (mut smallest, mut since) = (f64::INFINITY, 0);
    let mut pieces: Option<Selection> = None;
    let mut quick = ReducedNewton::default();
    while report.changes.len() < options.max_iterations && !report.converged && !report.stagnated {
        let coefficients = nodes
            .iter()
            .zip(&slips)
            .map(|(v, &phi)| {
                let at = crate::contact::LocalValues {
                    slip: [phi, 0.0],
                    ..*v
                };
                problem.node_law().check(&at)?;
                Ok(problem.node_law().friction(&at))
            })
            .collect::<Result<Vec<_>, ContactError>>()?;
        *inner.node_law_mut() =
            GivenBound::new(problem.node_law().num_tangents(), pressures.clone(), coefficients)?;
        let before = pieces.take().unwrap_or_else(|| select(&inner, &report.x));
        let mut go_on = |_: &_| ControlFlow::Continue(());
        let x = inner
            .solve_again(alpha, Some(&report.x), &options.contact, &mut quick, &mut go_on)?
            .x;
        let change: Vec<f64> = x.iter().zip(&report.x).map(|(a, b)| a - b).collect();
        let change = norm(&change) / norm(&x[..q]).max(f64::MIN_POSITIVE);
        report.changes.push(change);
        report.converged = change <= options.tolerance;
        since = if change < smallest { 0 } else { since + 1 };
        smallest = smallest.min(change);
        report.stagnated = since >= STAGNATION && smallest < SAME && !report.converged;
        let now = select(&inner, &x);
        report.nodes_changed.push(before.differing_sites(&now).count());
        pieces = Some(now);
        report.x = x;
        if observe(&report).is_break() {
            break;
        }
        nodes = problem.nodes(&report.x);
        for (i, v) in nodes.iter().enumerate() {
            slips[i] += omega * (v.slip_norm() - slips[i]);
            pressures[i] += omega * (v.pressure.max(0.0) - pressures[i]);
        }
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::{ContactBody, FrictionCoefficient, FrictionCurve, LoadPath, PlanarCoulomb};
    use crate::sparse::Matrix;

    fn report(changes: Vec<f64>, nodes_changed: Vec<usize>) -> FixedPointReport {
        FixedPointReport {
            x: Vec::new(),
            converged: false,
            stagnated: false,
            changes,
            nodes_changed,
        }
    }

    /// A rate of ½ that ends in noise at 1e-11, with other ratios while nodes change.
    #[test]
    fn rates_are_those_between_the_last_switch_and_noise() {
        let mut changes = vec![1.0, 0.9, 0.3, 0.2];
        changes.extend((0..33).map(|k| 0.1 * 0.5_f64.powi(k)));
        changes.extend([1.1e-11, 1.0e-11, 0.9e-11, 0.95e-11, 0.8e-11]);
        let mut switches = vec![0; changes.len()];
        switches[3] = 2;
        let rate = report(changes.clone(), switches.clone()).contraction().unwrap();
        assert!((rate - 0.5).abs() < 1e-12, "{rate}");
        // Stopped long before noise, all ratios since the last switch count.
        let rate = |n: usize| report(changes[..n].to_vec(), switches[..n].to_vec()).contraction();
        assert!((rate(8).unwrap() - 0.5).abs() < 1e-12);
        assert_eq!(rate(7), None);
        let mut late = switches;
        late[36] = 1;
        assert_eq!(report(changes, late).contraction(), None);
        assert_eq!(report(Vec::new(), Vec::new()).contraction(), None);
    }

    /// A node that slides under the load (3, 5): each traction is F times the bound that its pressures were relaxed to.
    #[test]
    fn bounds_are_relaxed_pressures() {
        let f = 0.3;
        let a = Matrix::from_rows(&[[2.0, -0.5], [-0.5, 1.0]]).unwrap();
        let (normal, tangential) = (Matrix::from_rows(&[[1.0, 0.0]]), Matrix::from_rows(&[[0.0, 1.0]]));
        let load = LoadPath::constant(vec![3.0, 5.0]);
        let body = ContactBody::new(a, normal.unwrap(), vec![tangential.unwrap()], load).unwrap();
        let law = PlanarCoulomb::new(FrictionCoefficient::uniform(FrictionCurve::constant(f).unwrap()));
        let problem = CondensedContact::new(body, law).unwrap();
        for omega in [1.0, 0.5, 0.25] {
            let options = FixedPointOptions {
                relaxation: omega,
                max_iterations: 4,
                tolerance: 0.0,
                ..FixedPointOptions::default()
            };
            let mut bound = 4.0;
            let mut count = 0;
            let observe = |so_far: &FixedPointReport| {
                let [pressure, traction] = [so_far.x[0], so_far.x[1]];
                assert!(
                    (traction.abs() - f * bound).abs() < 1e-13,
                    "{omega}: {traction} {bound}"
                );
                assert!((pressure - bound).abs() > 1e-6);
                bound += omega * (pressure - bound);
                count += 1;
                ControlFlow::Continue(())
            };
            fixed_point_observed(&problem, &[4.0, 0.0, 0.0], &options, observe).unwrap();
            assert_eq!(count, 4);
        }
    }

    /// With tolerance 0 the iteration continues down to rounding, and ends there.
    #[test]
    fn rounding_ends_the_iteration() {
        let a = Matrix::from_rows(&[[2.0, -0.5, 0.1], [-0.5, 1.0, 0.3], [0.1, 0.3, 3.0]]).unwrap();
        let (normal, tangential) = (
            Matrix::from_rows(&[[1.0, 0.0, 0.7]]),
            Matrix::from_rows(&[[0.0, 1.0, 0.3]]),
        );
        let load = LoadPath::constant(vec![3.0, 5.0, 0.1]);
        let body = ContactBody::new(a, normal.unwrap(), vec![tangential.unwrap()], load).unwrap();
        let curve = FrictionCurve::constant(0.3).unwrap();
        let law = PlanarCoulomb::new(FrictionCoefficient::uniform(curve));
        let problem = CondensedContact::new(body, law).unwrap();
        let options = FixedPointOptions::default().with_tolerance(0.0);
        let report = fixed_point(&problem, &[1.0, 0.0, 0.0], &options).unwrap();
        assert!(report.stagnated || report.converged);
        assert!(report.iterations() < 1000);
        let mut h = [0.0; 2];
        problem.residual(&select(&problem, &report.x), &report.x, &mut h);
        assert!(norm(&h) < 1e-12, "{h:?}");
    }

    /// A rate of 0.9 that becomes ½: of many ratios the last ten count.
    #[test]
    fn rates_are_those_of_the_last_ratios() {
        let mut changes: Vec<f64> = (0..20).map(|k| 0.9_f64.powi(k)).collect();
        let last = changes[19];
        changes.extend((1..=12).map(|k| last * 0.5_f64.powi(k)));
        let switches = vec![0; changes.len()];
        let rate = report(changes, switches).contraction().unwrap();
        assert!((rate - 0.5).abs() < 1e-12, "{rate}");
    }
}
