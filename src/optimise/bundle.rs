//! The run of the proximal bundle method.

use std::ops::ControlFlow;

use super::model::{Direction, Model, Plane};
use super::units::{self, scaled};
use super::{BundleIteration, BundleOptions, BundleReport, BundleStep, Objective, OptimiseError};
use crate::Cause;
use crate::clock::Clock;
use crate::run::Status;
use crate::sparse::{dot, max_abs, norm};
use crate::tolerances::{HALVINGS, VALUE};
use crate::variational::{Multipliers, Polyhedron, Projection};

/// Part of the predicted decrease that a step to a better point has to reach, part up to which the slope at a new gradient has to come, and
/// the step from which on the first alone suffices: any 0 < a < b < 1 and 0 < c ≤ 1 will do for the theory.
const DECREASE: f64 = 0.01;
const SLOPE: f64 = 0.5;
const LONG: f64 = 0.05;
/// Error of the trapezoidal rule, in units of half of what slopes differ by, up to which f counts as smooth
/// between two points: the error where the curvature grows from 0 in proportion to the distance. A kink
/// between lines has any error up to 1, as it lies at an end or in the middle.
const SMOOTH: f64 = 1.0 / 3.0;
/// Factor by which one change of the weight is limited, and a bound of all of them together.
const CHANGE: f64 = 10.0;
const RANGE: f64 = 1e10;

/// A point with the value and the gradient there.
struct Sample {
    point: Vec<f64>,
    value: f64,
    gradient: Vec<f64>,
}

/// The result of a search along a direction: where to go, with the step there, and a second point whose gradient the model lacks.
struct Found {
    best: Option<(f64, Sample)>,
    ahead: Option<Sample>,
    /// f after the full step, if it was defined there.
    full: Option<f64>,
}

/// In the units of parameters that their bounds give; what is reported is in those of the user.
pub(super) struct Run<'a> {
    set: Polyhedron,
    units: Vec<f64>,
    options: &'a BundleOptions,
    objective: &'a mut dyn Objective,
    clock: Clock,
    here: Sample,
    model: Model,
    /// u, with its first value.
    weight: f64,
    first_weight: f64,
    /// Steps in a row, negative ones that stayed.
    counter: i32,
    /// Bound of the length of steps: CHANGE times the longest one that was good, or the first one.
    reach: f64,
    /// Length of the first step, the unit of θ where θ itself is smaller.
    least_unit: f64,
    /// Why an evaluation was stopped.
    stopped: Option<Status>,
    /// The largest f at a point whose gradient the model has had.
    highest: f64,
    /// The largest |∂ᵢf| of these gradients, the unit of component i: parameters have units of their own.
    slopes: Vec<f64>,
    report: BundleReport,
}

impl<'a> Run<'a> {
    pub(super) fn new(
        set: &'a Polyhedron,
        options: &'a BundleOptions,
        start: &[f64],
        objective: &'a mut dyn Objective,
    ) -> Result<Self, OptimiseError> {
        options.validate()?;
        let clock = Clock::start();
        let units = units::of(set);
        let mut point = match set.project(start)? {
            Projection::Nearest(nearest) => nearest.x,
            Projection::Empty(certificate) => return Err(OptimiseError::EmptySet(Box::new(certificate))),
        };
        point.iter_mut().zip(&units).for_each(|(x, s)| *x /= s);
        let set = scaled(set, &units)?;
        let mut gradient = vec![0.0; point.len()];
        limit_time(objective, options, &clock);
        let value = sampled(objective, &units, &point, &mut gradient);
        let value = value.map_err(|source| OptimiseError::Start { source })?;
        objective.keep();
        let step = first_step(&set, options, &point);
        let mut run = Self {
            set,
            units,
            options,
            objective,
            clock,
            model: Model::new(options.max_bundle, point.len()),
            weight: norm(&gradient) / step,
            first_weight: 0.0,
            counter: 0,
            reach: CHANGE * step,
            least_unit: step,
            stopped: None,
            highest: value,
            slopes: gradient.iter().map(|g| g.abs()).collect(),
            report: BundleReport {
                status: Status::IterationLimit,
                value,
                state: Vec::new(),
                subgradient: Vec::new(),
                subgradient_norm: 0.0,
                gradient_norm: 0.0,
                error: 0.0,
                radius: 0.0,
                multipliers: Multipliers::default(),
                iterations: 0,
                evaluations: 1,
                failures: 0,
                trouble: None,
                history: Vec::new(),
                time: std::time::Duration::ZERO,
            },
            here: Sample {
                point,
                value,
                gradient,
            },
        };
        run.note_slopes();
        run.first_weight = run.weight;
        // A plane from the farthest point that one step reaches counts as off by what the first step
        // promises, |g| times its length.
        run.model.curvature = run.weight / (CHANGE * CHANGE);
        run.model.add(Plane::new(run.here.gradient.clone(), 0.0, 0.0));
        Ok(run)
    }

    /// Runs, and returns the best point with the report.
    pub(super) fn run(
        mut self,
        observe: &mut dyn FnMut(&BundleIteration) -> ControlFlow<()>,
    ) -> Result<(Vec<f64>, BundleReport), OptimiseError> {
        let status = self.iterate(observe)?;
        self.report.status = status;
        self.report.value = self.here.value;
        self.report.time = self.clock.elapsed();
        let point = self.here.point.iter().zip(&self.units).map(|(x, s)| x * s);
        Ok((point.collect(), self.report))
    }

    fn iterate(
        &mut self,
        observe: &mut dyn FnMut(&BundleIteration) -> ControlFlow<()>,
    ) -> Result<Status, OptimiseError> {
        for index in 0..self.options.max_iterations {
            let Some(direction) = self.direction()? else {
                return Ok(Status::Inaccurate);
            };
            self.report.iterations = index + 1;
            self.certify(&direction);
            let mut line = BundleIteration {
                index,
                value: self.here.value,
                subgradient_norm: self.report.subgradient_norm,
                error: direction.error,
                weight: self.weight,
                evaluations: self.report.evaluations,
                step: BundleStep::None,
            };
            let is_stationary = self.is_stationary(&direction);
            let ended = match is_stationary && self.is_short(&direction) {
                true => Err(Status::Solved),
                false => self.search(&direction),
            };
            match ended {
                Ok(found) => line.step = self.take(&direction, found),
                Err(status) => {
                    // Rounding of f may hide what the model still promises.
                    let is_hidden = DECREASE * direction.predicted() <= VALUE * self.here.value.abs();
                    let status = match status {
                        Status::Stalled if is_stationary && is_hidden => Status::Solved,
                        status => status,
                    };
                    self.report.history.push(line);
                    // The observer hears of the last iterate, too.
                    let _ = observe(&line);
                    return Ok(status);
                }
            }
            self.report.history.push(line);
            if observe(&line).is_break() {
                return Ok(Status::Interrupted);
            }
        }
        Ok(Status::IterationLimit)
    }

    /// The minimum of the model; of the plane at the iterate alone where rounding defeats the quadratic program.
    fn direction(&mut self) -> Result<Option<Direction>, OptimiseError> {
        let (n, own) = (self.here.point.len(), norm(&self.here.gradient));
        if own == 0.0 {
            return Ok(Some(Direction::none(n)));
        }
        let planes = self.model.planes.iter().map(|p| norm(&p.gradient));
        let size = own.max(self.options.tolerance * planes.fold(0.0, f64::max));
        for _ in 0..HALVINGS {
            let found = self
                .model
                .minimum(&self.set, &self.here.point, self.weight, size)?;
            let Some(found) = found else {
                if self.model.planes.len() == 1 {
                    break;
                }
                self.model.planes = vec![Plane::new(self.here.gradient.clone(), 0.0, 0.0)];
                continue;
            };
            let length = norm(&found.step);
            if length <= self.reach {
                return Ok(Some(found));
            }
            self.weight *= 2.0 * length / self.reach;
        }
        Ok(None)
    }

    /// Whether the aggregate is small against gradients, and its planes differ little from f against what f differs by, but for rounding.
    fn is_stationary(&self, direction: &Direction) -> bool {
        let (highest, here) = (self.highest, self.here.value);
        let rounding = VALUE * highest.abs().max(here.abs());
        let largest = max_abs(&self.slopes);
        // f may not depend on a component that constraints move.
        let most = |slope: f64| match slope > 0.0 {
            true => self.options.tolerance * slope,
            false => VALUE * largest,
        };
        let mut slopes = direction.subgradient.iter().zip(&self.slopes);
        slopes.all(|(s, slope)| s.abs() <= most(*slope))
            && direction.error <= self.options.value_tolerance * (highest - here) + rounding
    }

    /// Whether the model has its minimum here. A small gradient alone does not tell: against those of a start far away others are all small.
    fn is_short(&self, direction: &Direction) -> bool {
        let mut steps = direction.step.iter().zip(&self.here.point);
        steps.all(|(d, x)| d.abs() <= self.options.tolerance * x.abs().max(self.least_unit))
    }

    fn certify(&mut self, direction: &Direction) {
        let report = &mut self.report;
        let own = |v: &[f64]| {
            v.iter()
                .zip(&self.units)
                .map(|(v, s)| v / s)
                .collect::<Vec<f64>>()
        };
        report.subgradient = own(&direction.subgradient);
        report.subgradient_norm = norm(&report.subgradient);
        report.error = direction.error;
        report.radius = direction.radius;
        report.multipliers.clone_from(&direction.multipliers);
        for bounds in [&mut report.multipliers.lower, &mut report.multipliers.upper] {
            *bounds = own(bounds);
        }
    }

    /// f at θ + t d; `None` where it has no value or gradient.
    fn sample(&mut self, d: &[f64], t: f64) -> Option<Sample> {
        let (lower, upper) = (self.set.lower(), self.set.upper());
        let step = self.here.point.iter().zip(d).map(|(x, d)| x + t * d);
        // Bounds that are met but for rounding are met.
        let at_bound = |x: f64, b: f64| b.is_finite() && (x - b).abs() <= VALUE * b.abs();
        let point: Vec<f64> = (step.zip(lower).zip(upper))
            .map(|((x, l), u)| match () {
                () if x < *l || at_bound(x, *l) => *l,
                () if x > *u || at_bound(x, *u) => *u,
                () => x,
            })
            .collect();
        let mut gradient = vec![0.0; point.len()];
        self.report.evaluations += 1;
        limit_time(self.objective, self.options, &self.clock);
        match sampled(self.objective, &self.units, &point, &mut gradient) {
            Ok(value) => Some(Sample {
                point,
                value,
                gradient,
            }),
            Err(cause) => {
                self.stopped = cause.downcast_ref().and_then(OptimiseError::stopped);
                if self.stopped.is_none() {
                    self.report.failures += 1;
                    self.report.trouble = Some(cause);
                }
                None
            }
        }
    }

    /// Why to search no further.
    fn stop(&self) -> Option<Status> {
        let limit = self.options.max_time;
        let is_over = limit.is_some_and(|limit| self.clock.elapsed() >= limit);
        self.stopped.or(is_over.then_some(Status::TimeLimit))
    }

    /// The two-point search of K. C. Kiwiel (1985) and M. M. Mäkelä, P. Neittaanmäki (1992): a step that decreases f enough, or a gradient
    /// nearby that the model lacks. It ends where f is semismooth.
    fn search(&mut self, direction: &Direction) -> Result<Found, Status> {
        let d = &direction.step;
        let predicted = direction.predicted();
        let (length, here) = (norm(d), self.here.value);
        let (mut low, mut high, mut t) = (0.0, 1.0, 1.0);
        let mut found = Found {
            best: None,
            ahead: None,
            full: None,
        };
        for trial in 0..HALVINGS {
            if self.stop().is_some() {
                break;
            }
            let sample = self.sample(d, t);
            if trial == 0 {
                found.full = sample.as_ref().map(|s| s.value);
            }
            match sample {
                None => high = t,
                Some(sample) if sample.value <= here - DECREASE * t * predicted => {
                    self.objective.keep();
                    let slope = dot(&sample.gradient, d);
                    low = t;
                    found.best = Some((t, sample));
                    if low >= LONG || slope >= -SLOPE * predicted {
                        return Ok(found);
                    }
                }
                Some(sample) => {
                    high = t;
                    let slope = dot(&sample.gradient, d);
                    let centre = found.best.as_ref().map_or(here, |(_, s)| s.value);
                    let error = centre - sample.value + (t - low) * slope;
                    let apart = (t - low) * length;
                    let locality = error.abs().max(self.model.curvature * apart * apart);
                    if slope - locality >= -SLOPE * predicted {
                        found.ahead = Some(sample);
                        return Ok(found);
                    }
                }
            }
            t = 0.5 * (low + high);
            if (high - low) * length <= f64::EPSILON * max_abs(&self.here.point) {
                break;
            }
        }
        // A better point is progress in any case.
        if found.best.is_some() {
            return Ok(found);
        }
        if let Some(status) = self.stop() {
            return Err(status);
        }
        Err(match self.report.failures {
            0 => Status::Stalled,
            _ if found.full.is_none() => Status::EvaluationFailure { component: 0 },
            _ => Status::Stalled,
        })
    }

    /// Moves, and enriches the model.
    fn take(&mut self, direction: &Direction, found: Found) -> BundleStep {
        let predicted = direction.predicted();
        let gained = found.full.map(|f| (self.here.value - f) / predicted);
        let step = match &found.best {
            None => BundleStep::Null,
            Some((t, _)) if *t < LONG => BundleStep::Short,
            Some(_) => BundleStep::Serious,
        };
        if let Some((_, best)) = found.best {
            let d = difference(&best.point, &self.here.point);
            self.reach = self.reach.max(CHANGE * norm(&d));
            self.model.moved(&d, best.value - self.here.value);
            let change = difference(&best.gradient, &self.here.gradient);
            let slopes = [&self.here, &best].map(|s| dot(&s.gradient, &d));
            let curvature = dot(&change, &change) / (slopes[1] - slopes[0]);
            // A curvature by which the first gradient would vanish nearer to what counts as no step than to
            // the first one is that of a kink.
            let steepest = self.first_weight / self.options.tolerance.sqrt();
            if is_smooth(best.value - self.here.value, slopes) && curvature <= steepest {
                self.model.learn(&d, &change, self.weight);
            }
            self.model.add(Plane::new(best.gradient.clone(), 0.0, 0.0));
            self.note(&best);
            self.here = best;
        }
        let mut error = 0.0;
        if let Some(ahead) = found.ahead {
            let d = difference(&ahead.point, &self.here.point);
            error = self.here.value - ahead.value + dot(&ahead.gradient, &d);
            self.note(&ahead);
            self.model.add(Plane::new(ahead.gradient, error, norm(&d)));
        }
        self.reweigh(step, gained, error.abs() > CHANGE * predicted);
        step
    }

    fn note(&mut self, sample: &Sample) {
        self.highest = self.highest.max(sample.value);
        let slopes = self.slopes.iter_mut().zip(&sample.gradient);
        slopes.for_each(|(largest, g)| *largest = largest.max(g.abs()));
        self.note_slopes();
    }

    fn note_slopes(&mut self) {
        let slopes = self.slopes.iter().zip(&self.units).map(|(g, s)| g / s);
        self.report.gradient_norm = norm(&slopes.collect::<Vec<f64>>());
    }

    /// The weight after K. C. Kiwiel, Math. Program. 46 (1990): from a parabola through f at both ends of the full step, which gained that
    /// part of what was predicted.
    fn reweigh(&mut self, step: BundleStep, gained: Option<f64>, is_far: bool) {
        let parabola = gained.map(|gained| 2.0 * self.weight * (1.0 - gained));
        let stays = step == BundleStep::Null;
        let next = match (stays, parabola) {
            (_, None) => CHANGE * self.weight,
            (false, Some(u)) if self.counter > 0 && gained >= Some(SLOPE) => u,
            (false, Some(_)) if self.counter > 3 => 0.5 * self.weight,
            (true, Some(u)) if self.counter < -3 && is_far => u,
            _ => self.weight,
        };
        let (least, most) = (self.first_weight / RANGE, self.first_weight * RANGE);
        let next = next
            .clamp(self.weight / CHANGE, self.weight * CHANGE)
            .max(least)
            .min(most);
        self.counter = match (stays, next == self.weight) {
            (false, true) => self.counter.max(0) + 1,
            (true, true) => self.counter.min(0) - 1,
            (false, false) => 1,
            (true, false) => -1,
        };
        self.weight = next;
    }
}

/// Whether slopes that grow account for the change of f between two points.
fn is_smooth(change: f64, slopes: [f64; 2]) -> bool {
    let half = 0.5 * (slopes[1] - slopes[0]);
    half > 0.0 && (change - 0.5 * (slopes[0] + slopes[1])).abs() <= SMOOTH * half
}

fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

fn limit_time(objective: &mut dyn Objective, options: &BundleOptions, clock: &Clock) {
    if let Some(limit) = options.max_time {
        objective.limit_time(limit.saturating_sub(clock.elapsed()));
    }
}

/// A value and a gradient that are finite, of parameters in these units.
fn sampled(
    objective: &mut dyn Objective,
    units: &[f64],
    point: &[f64],
    gradient: &mut [f64],
) -> Result<f64, Cause> {
    let point: Vec<f64> = point.iter().zip(units).map(|(x, s)| x * s).collect();
    let value = objective.evaluate(&point, gradient)?;
    gradient.iter_mut().zip(units).for_each(|(g, s)| *g *= s);
    match value.is_finite() && gradient.iter().all(|g| g.is_finite()) {
        true => Ok(value),
        false => Err(Cause::new(OptimiseError::NotFinite)),
    }
}

fn first_step(set: &Polyhedron, options: &BundleOptions, point: &[f64]) -> f64 {
    let widths = set.lower().iter().zip(set.upper()).map(|(l, u)| u - l);
    let widest = widths.filter(|w| w.is_finite()).fold(0.0, f64::max);
    let size = max_abs(point);
    options.step.unwrap_or(match () {
        () if widest > 0.0 => 0.1 * widest,
        () if size > 0.0 => 0.1 * size,
        () => 0.1,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The error of the trapezoidal rule is a third of half the difference of the slopes for x³ next to 0,
    /// half of it for x⁴, and |1 − 2τ| of it for a kink at τ.
    #[test]
    fn smooth_is_what_a_cubic_is() {
        let power = |n: i32, a: f64, b: f64| {
            let slopes = [a, b].map(|x| f64::from(n) * x.powi(n - 1) * (b - a));
            is_smooth(b.powi(n) - a.powi(n), slopes)
        };
        assert!(power(2, 0.0, 1.0) && power(3, 0.01, 1.0) && !power(3, -0.01, 1.0) && !power(4, 0.0, 1.0));
        let kink = |at: f64| is_smooth(3.0 * (1.0 - at) - at, [-1.0, 3.0]);
        assert!(kink(0.35) && kink(0.65) && !kink(0.3) && !kink(0.7));
        // Slopes that fall are those of another kind of f.
        assert!(!is_smooth(0.0, [1.0, -1.0]) && !is_smooth(1.0, [1.0, 1.0]));
    }

    /// The locality measure of a plane at the reach of one step is the decrease that the first step promises.
    #[test]
    fn planes_count_within_the_reach_of_a_step() {
        let set = Polyhedron::boxed(vec![-4.0; 2], vec![4.0; 2]).unwrap();
        let mut f = |p: &[f64], g: &mut [f64]| {
            g.copy_from_slice(&[3.0, 4.0]);
            Ok(3.0 * p[0] + 4.0 * p[1])
        };
        for step in [None, Some(0.25)] {
            let options = BundleOptions::default().with_step(step);
            let run = Run::new(&set, &options, &[1.0, 1.0], &mut f).unwrap();
            // A tenth of the width 8 unless given, and ten times as far.
            let step = step.unwrap_or(0.8);
            assert!((run.reach - 10.0 * step).abs() < 1e-14);
            assert!((run.model.curvature * run.reach * run.reach - 5.0 * step).abs() < 1e-13);
        }
    }
}
