use std::fmt;

use super::{Dynamics, Spectrum, StabilityError};
use crate::continuation::{
    Branch, Continuation, ContinuationOptions, Direction, Point, Transition, TransitionKind,
};
use crate::piecewise::PiecewiseSmooth;
use crate::words::{Count, at_parameter};

/// A point at which a pair of complex eigenvalues crosses the imaginary axis.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Hopf {
    /// The point, located to rounding.
    pub point: Point,
    /// ω of the pair ± iω.
    pub frequency: f64,
    /// The eigenvalues there.
    pub spectrum: Spectrum,
}

impl Hopf {
    /// The parameter α.
    #[must_use]
    pub fn parameter(&self) -> f64 {
        self.point.parameter()
    }
}

impl fmt::Display for Hopf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        at_parameter(f, &"Hopf point", self.parameter())?;
        write!(f, ", frequency {}", self.frequency)
    }
}

/// What happens to an equilibrium at a kink.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum BoundaryKind {
    /// It goes on into another cell as the parameter goes on: one equilibrium on either side of the parameter.
    Persistence,
    /// Two equilibria of two cells meet and vanish: the parameter turns.
    NonsmoothFold,
    /// More than two arms meet, the curve ends, or runs at a constant parameter.
    Other,
}

/// A boundary equilibrium bifurcation: an equilibrium at a kink of H.
///
/// The eigenvalues are those of both sides. Of the equilibrium at the kink itself they do not say everything: with three variables and more it
/// may be unstable though both sides are stable.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BoundaryEquilibrium {
    /// The transition on the curve.
    pub transition: Transition,
    /// Its kind.
    pub kind: BoundaryKind,
    /// The eigenvalues on arrival.
    pub before: Spectrum,
    /// The eigenvalues on departure.
    pub after: Spectrum,
}

impl fmt::Display for BoundaryEquilibrium {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = match self.kind {
            BoundaryKind::Persistence => "persistence",
            BoundaryKind::NonsmoothFold => "non-smooth fold",
            BoundaryKind::Other => self.transition.kind.name(),
        };
        at_parameter(f, &kind, self.transition.parameter())?;
        write!(f, "; {}, then {}", self.before, self.after)
    }
}

/// A part of a curve between two of its points, of one stability.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Stretch {
    /// Its ends, x = (y, α).
    pub ends: [Vec<f64>; 2],
    /// How many eigenvalues have positive real parts between them.
    pub unstable: usize,
}

/// A curve of equilibria with its stability.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct StabilityBranch {
    /// The curve. Its monitor crossings are the zeros of the test function: Hopf points and neutral saddles, where λ and −λ are both real.
    pub branch: Branch,
    /// The eigenvalues at each of its points.
    pub spectra: Vec<Spectrum>,
    /// The Hopf points, by arclength.
    pub hopf: Vec<Hopf>,
    /// The equilibria at kinks, one for each transition.
    pub kinks: Vec<BoundaryEquilibrium>,
    /// The curve from point to point, events among them, with the stability between.
    pub stretches: Vec<Stretch>,
    /// Arclengths of points between which the number of unstable eigenvalues changes without an event that explains it: two events in one
    /// step, say. Smaller steps resolve them.
    pub unexplained: Vec<(f64, f64)>,
}

/// "1 Hopf point, 2 kinks; 12 points stable, 30 unstable": in one line.
impl fmt::Display for StabilityBranch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let stable = self
            .spectra
            .iter()
            .filter(|s| s.is_stable() == Some(true))
            .count();
        write!(
            f,
            "{}, {}; {} stable, {} not",
            Count(self.hopf.len(), "Hopf point", "Hopf points"),
            Count(self.kinks.len(), "kink", "kinks"),
            Count(stable, "point", "points"),
            self.spectra.len() - stable
        )
    }
}

impl<P: PiecewiseSmooth + Sync + ?Sized> Dynamics<'_, P> {
    /// Follows the curve of equilibria through a point, with eigenvalues at all its points.
    ///
    /// # Complexity
    /// Besides the curve itself all eigenvalues once a step, and some ten times at each Hopf point.
    ///
    /// # Errors
    /// As [`spectrum`](Self::spectrum) and [`Branch::follow`].
    pub fn follow(
        &self,
        x: &[f64],
        direction: Direction,
        options: ContinuationOptions,
    ) -> Result<StabilityBranch, StabilityError> {
        self.spectrum(x)?;
        let test = |x: &[f64]| self.spectrum(x).map_or(f64::NAN, |s| s.hopf_test());
        let curve = Continuation::new(self.map, x, direction, options)?.with_monitor("Hopf", test);
        let branch = Branch::collect(curve, |_| std::ops::ControlFlow::Continue(()))?;
        self.examined(branch)
    }

    fn examined(&self, branch: Branch) -> Result<StabilityBranch, StabilityError> {
        let spectra = branch.points.iter().map(|p| self.spectrum_in(&p.selection, &p.x));
        let spectra: Vec<Spectrum> = spectra.collect::<Result<_, _>>()?;
        let mut hopf = Vec::new();
        for crossing in &branch.monitor_crossings {
            let spectrum = self.spectrum_in(&crossing.point.selection, &crossing.point.x)?;
            if let Some(frequency) = spectrum.frequency() {
                hopf.push(Hopf {
                    point: crossing.point.clone(),
                    frequency,
                    spectrum,
                });
            }
        }
        let kinks = branch.transitions.iter().map(|t| {
            Ok(BoundaryEquilibrium {
                transition: t.clone(),
                kind: match t.kind {
                    TransitionKind::PassThrough => BoundaryKind::Persistence,
                    TransitionKind::Fold => BoundaryKind::NonsmoothFold,
                    _ => BoundaryKind::Other,
                },
                before: self.spectrum_in(&t.before, &t.x)?,
                after: self.spectrum_in(&t.after, &t.x)?,
            })
        });
        let kinks = kinks.collect::<Result<Vec<_>, StabilityError>>()?;
        let stretches = self.stretches(&branch, &spectra, &hopf)?;
        Ok(StabilityBranch {
            unexplained: unexplained(&branch, &spectra, &hopf),
            spectra,
            hopf,
            kinks,
            stretches,
            branch,
        })
    }

    /// The curve from point to point: of two neighbours one that is no event tells the stability between them, else the point halfway.
    fn stretches(
        &self,
        branch: &Branch,
        spectra: &[Spectrum],
        hopf: &[Hopf],
    ) -> Result<Vec<Stretch>, StabilityError> {
        let mut walk: Vec<(f64, &[f64], Option<usize>)> = Vec::new();
        let points = branch.points.iter().zip(spectra);
        walk.extend(points.map(|(p, s)| {
            (
                p.arclength,
                p.x.as_slice(),
                (s.undecided == 0).then_some(s.unstable),
            )
        }));
        walk.extend(
            branch
                .transitions
                .iter()
                .map(|t| (t.arclength, t.x.as_slice(), None)),
        );
        let located = branch.smooth_folds.iter();
        let located = located.chain(branch.branch_points.iter().map(|b| &b.point));
        let located = located.chain(hopf.iter().map(|h| &h.point));
        walk.extend(located.map(|p| (p.arclength, p.x.as_slice(), None)));
        walk.sort_by(|a, b| a.0.total_cmp(&b.0));
        let stretch = |pair: &[(f64, &[f64], Option<usize>)]| {
            let [from, to] = [pair[0].1, pair[1].1];
            let unstable = match (pair[0].2, pair[1].2) {
                (Some(unstable), _) | (_, Some(unstable)) => unstable,
                _ => {
                    let halfway: Vec<f64> = from.iter().zip(to).map(|(a, b)| 0.5 * (a + b)).collect();
                    self.spectrum(&halfway)?.unstable
                }
            };
            Ok(Stretch {
                ends: [from.to_vec(), to.to_vec()],
                unstable,
            })
        };
        walk.windows(2).map(stretch).collect()
    }
}

/// Pairs of neighbouring points whose numbers of unstable eigenvalues differ by what no event between them accounts for: kinks may change any
/// number, folds and branch points one, Hopf points two each.
fn unexplained(branch: &Branch, spectra: &[Spectrum], hopf: &[Hopf]) -> Vec<(f64, f64)> {
    let count = |lengths: &mut dyn Iterator<Item = f64>, span: (f64, f64)| {
        lengths.filter(|s| (span.0..=span.1).contains(s)).count()
    };
    let mut found = Vec::new();
    for (points, spectra) in branch.points.windows(2).zip(spectra.windows(2)) {
        let span = (points[0].arclength, points[1].arclength);
        let change = spectra[0].unstable.abs_diff(spectra[1].unstable);
        let hidden = spectra[0].undecided + spectra[1].undecided;
        let kinks = count(&mut branch.transitions.iter().map(|t| t.arclength), span);
        let folds = count(&mut branch.smooth_folds.iter().map(|f| f.arclength), span)
            + count(&mut branch.branch_points.iter().map(|b| b.point.arclength), span);
        let pairs = count(&mut hopf.iter().map(|h| h.point.arclength), span);
        let most = folds + 2 * pairs;
        if kinks == 0 && (change > most + hidden || (hidden == 0 && (most - change) % 2 == 1)) {
            found.push(span);
        }
    }
    found
}
