use std::collections::VecDeque;
use std::fmt;
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use super::{Dynamics, Spectrum, StabilityError};
use crate::continuation::{
    Branch, BranchVertex, Continuation, ContinuationOptions, Direction, Event, Point, Transition,
    TransitionKind,
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
    /// The curve. Its monitor crossings are the Hopf points, two of them at each: those of both eigenvalues
    /// of the pair.
    pub branch: Branch,
    /// The eigenvalues at each of its points.
    pub spectra: Vec<Spectrum>,
    /// The Hopf points, by arclength.
    pub hopf: Vec<Hopf>,
    /// The equilibria at kinks, one for each transition.
    pub kinks: Vec<BoundaryEquilibrium>,
    /// The curve from point to point, events among them, with the stability between.
    pub stretches: Vec<Stretch>,
    /// Arclengths of the ends of stretches in which an eigenvalue seems to cross the axis without an event:
    /// the real parts at both ends and halfway, each time of the nearest eigenvalue, differ in sign, or a
    /// parabola through them crosses zero. The step may have passed over events there; smaller steps resolve
    /// them.
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
    /// The real parts by rank, largest first, are continuous along the curve whichever eigenvalues cross.
    /// Each is watched for itself, so that several Hopf points in one step are located where values and
    /// slopes at its ends tell of them. Where eigenvalues at both ends and halfway tell of others,
    /// [`unexplained`](StabilityBranch::unexplained) says so.
    ///
    /// # Complexity
    /// Besides the curve itself all eigenvalues some ten times a step, and as often at each Hopf point.
    ///
    /// # Errors
    /// As [`spectrum`](Self::spectrum) and [`Branch::follow`].
    pub fn follow(
        &self,
        x: &[f64],
        direction: Direction,
        options: ContinuationOptions,
    ) -> Result<StabilityBranch, StabilityError> {
        self.follow_observed(x, direction, options, |_| ControlFlow::Continue(()))
    }

    /// [`follow`](Self::follow), reporting each event of the curve to `observe`, which may stop it.
    ///
    /// # Errors
    /// As [`follow`](Self::follow).
    pub fn follow_observed(
        &self,
        x: &[f64],
        direction: Direction,
        options: ContinuationOptions,
        mut observe: impl FnMut(&Event) -> ControlFlow<()>,
    ) -> Result<StabilityBranch, StabilityError> {
        let ranks = self.spectrum(x)?.eigenvalues.len();
        let recent = &Recent::default();
        let mut curve = Continuation::new(self.map, x, direction, options)?;
        for rank in 0..ranks {
            curve = curve.with_monitor(HOPF, move |x| recent.get(x, || self.spectrum(x).ok(), rank));
        }
        // Eigenvalues come with the points, so that a run that is stopped ends at once.
        let mut walk = Walk::default();
        let mut failed = None;
        let branch = Branch::collect(curve, |event| match self.walk_on(&mut walk, event) {
            Ok(()) => observe(event),
            Err(e) => {
                failed = Some(e);
                ControlFlow::Break(())
            }
        })?;
        match failed {
            Some(error) => Err(error),
            None => self.examined(branch, walk),
        }
    }

    fn examined(&self, branch: Branch, walk: Walk) -> Result<StabilityBranch, StabilityError> {
        let mut hopf = Vec::new();
        for crossing in &branch.monitor_crossings {
            let spectrum = self.spectrum_in(&crossing.point.selection, &crossing.point.x)?;
            // Of a pair the eigenvalue above the axis.
            let frequency = spectrum.eigenvalues.get(crossing.monitor).map_or(0.0, |z| z.1);
            if frequency > 0.0 {
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
        Ok(StabilityBranch {
            branch,
            spectra: walk.spectra,
            hopf,
            kinks,
            stretches: walk.stretches,
            unexplained: walk.unexplained,
        })
    }

    /// The stretch that ends at the next point of the curve.
    fn walk_on(&self, walk: &mut Walk, event: &Event) -> Result<(), StabilityError> {
        if let Event::Point(point) = event {
            walk.spectra.push(self.spectrum_in(&point.selection, &point.x)?);
        }
        let Some(last) = walk.last.replace(event.clone()) else {
            return Ok(());
        };
        let (from, to) = (BranchVertex::from(&last), BranchVertex::from(event));
        // Both eigenvalues of a pair cross where it does.
        if from.event == HOPF && to.event == HOPF && from.x == to.x {
            return Ok(());
        }
        let at = |x: &[f64]| self.spectrum_in(from.selection, x);
        let (a, middle, b) = (at(from.x)?, at(&halfway(&from, &to))?, at(to.x)?);
        let decided = [
            (&middle, true),
            (&a, from.event == POINT),
            (&b, to.event == POINT),
        ];
        let decided = decided.iter().find(|(s, tells)| *tells && s.undecided == 0);
        walk.stretches.push(Stretch {
            ends: [from.x.to_vec(), to.x.to_vec()],
            unstable: decided.map_or(middle.unstable, |(s, _)| s.unstable),
        });
        let (first, second) = (a.nearest_in(&middle), middle.nearest_in(&b));
        let [a, middle, b] = [(&a, from.event), (&middle, POINT), (&b, to.event)].map(|(s, event)| {
            let crosses = event == HOPF || event == SMOOTH_FOLD || event == BRANCH_POINT;
            s.signed_parts(crosses)
        });
        let mut paths = a.iter().zip(first).map(|(a, k)| (*a, middle[k], b[second[k]]));
        if paths.any(|(a, m, b)| may_cross(a, m, b)) {
            walk.unexplained.push((from.arclength, to.arclength));
        }
        Ok(())
    }
}

/// What is known of a curve up to a point.
#[derive(Default)]
struct Walk {
    last: Option<Event>,
    spectra: Vec<Spectrum>,
    stretches: Vec<Stretch>,
    unexplained: Vec<(f64, f64)>,
}

/// Names of [`BranchVertex::event`], the first one that of the monitors.
const HOPF: &str = "Hopf";
const POINT: &str = "point";
const SMOOTH_FOLD: &str = "smooth fold";
const BRANCH_POINT: &str = "branch point";

/// Whether a function with these values at both ends of an interval and in its middle, 0 standing for no
/// sign, has zeros inside: values of both signs, or a parabola through them with a least size of the other
/// sign.
fn may_cross(a: f64, m: f64, b: f64) -> bool {
    if a * m < 0.0 || m * b < 0.0 || a * b < 0.0 {
        return true;
    }
    let (slope, bend) = (4.0 * m - 3.0 * a - b, 2.0 * (a - 2.0 * m + b));
    let place = -0.5 * slope / bend;
    place > 0.0 && place < 1.0 && (a + 0.5 * slope * place) * m < 0.0
}

/// The middle of the cubic curve with the tangents of two points.
fn halfway(from: &BranchVertex<'_>, to: &BranchVertex<'_>) -> Vec<f64> {
    let eighth = 0.125 * (to.arclength - from.arclength);
    let tangents = from.tangent.iter().zip(to.tangent_before);
    let ends = from.x.iter().zip(to.x).zip(tangents);
    ends.map(|((x, y), (s, t))| 0.5 * (x + y) + eighth * (s - t))
        .collect()
}

/// Spectra at the points computed last: the monitors of all ranks ask for the same ones.
#[derive(Default)]
struct Recent(Mutex<VecDeque<(Vec<f64>, Option<Spectrum>)>>);

impl Recent {
    /// Points around which a monitor is sampled in turn, and one to spare.
    const KEPT: usize = 8;

    fn get(&self, x: &[f64], compute: impl FnOnce() -> Option<Spectrum>, rank: usize) -> f64 {
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if !kept.iter().any(|(at, _)| at == x) {
            kept.truncate(Self::KEPT - 1);
            kept.push_front((x.to_vec(), compute()));
        }
        let found = kept.iter().find(|(at, _)| at == x);
        let spectrum = found.and_then(|(_, spectrum)| spectrum.as_ref());
        spectrum.map_or(f64::NAN, |s| s.crossing(rank))
    }
}
