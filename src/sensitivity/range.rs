//! How far along a direction the piece holds on which a derivative is based.

use std::fmt;

use super::SensitivityError;
use super::directional::Branch;
use super::element::Element;
use super::family::Place;
use super::parameters::Line;
use super::point::{Solved, Verdict, hidden, spreads};
use crate::continuation::{
    Continuation, ContinuationOptions, Direction, Event, Termination, Transition, TransitionKind,
};
use crate::input::check_vector;
use crate::input::{check_options, positive};
use crate::piecewise::{PiecewiseSmooth, PiecewiseSmoothExt};
use crate::sparse::max_abs;
use crate::tolerances::SAME;

/// How far along a direction δ the solutions x(θ + s δ), s > 0, stay on one smooth piece.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Validity {
    /// Up to this s, exactly but for rounding: the map is affine on each piece and the solutions are x + s
    /// x′(θ; δ). Infinite where they never meet a kink.
    Exact(f64),
    /// Up to this s, where the first kink, fold or branch point was met along the curve of solutions, which
    /// is followed in steps.
    Followed(f64),
    /// No kink was met up to this s, the horizon of the search.
    Beyond(f64),
    /// The curve could not be followed beyond this s; no kink was met up to it.
    Lost(f64, Termination),
}

impl Validity {
    /// That s: up to it no kink is met.
    #[must_use]
    pub fn until(&self) -> f64 {
        match self {
            Self::Exact(s) | Self::Followed(s) | Self::Beyond(s) | Self::Lost(s, _) => *s,
        }
    }
}

impl fmt::Display for Validity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Exact(s) => write!(f, "up to {s}"),
            Self::Followed(s) => write!(f, "up to {s}, followed in steps"),
            Self::Beyond(s) => write!(f, "beyond {s}, followed in steps"),
            Self::Lost(s, why) => write!(f, "at least up to {s}, where the curve was lost: {why}"),
        }
    }
}

impl Solved {
    pub(super) fn valid_until(
        &mut self,
        map: &dyn PiecewiseSmooth,
        delta: &[f64],
        horizon: f64,
    ) -> Result<Validity, SensitivityError> {
        check_vector("the change of the parameters", delta, self.num_parameters())?;
        check_options(&[positive("horizon", horizon)])?;
        if let Some(Verdict::Other(verdict)) = &self.verdict {
            let verdict = Box::new(verdict.clone());
            return Err(SensitivityError::NotUnique { verdict });
        }
        if max_abs(delta) == 0.0 {
            return Ok(Validity::Exact(f64::INFINITY));
        }
        match map.is_piecewise_affine() {
            true => {
                let branch = self.branch(map, &self.active, delta)?;
                self.ratio(map, &branch, delta).map(Validity::Exact)
            }
            false => self.followed(map, delta, horizon),
        }
    }

    /// The ratio test over the facets of the cell that a branch of an affine map runs in.
    fn ratio(
        &self,
        map: &dyn PiecewiseSmooth,
        branch: &Branch,
        delta: &[f64],
    ) -> Result<f64, SensitivityError> {
        let selection = &branch.selection;
        let mut d = branch.rate.clone();
        d.extend(delta);
        let widths = Element::new(map, &self.at, selection)?.widths(&d)?;
        let mut rates = vec![0.0; self.theta.len()];
        map.tests_of_selection(selection, &self.at, Some(&d), &mut rates);
        // What rounding hides of these rates counts as none.
        let noise = hidden(
            map,
            &self.layout,
            &self.at,
            &spreads(&d, &widths),
            Some(selection),
        );
        let mut until = f64::INFINITY;
        for site in 0..self.layout.num_sites() {
            for facet in map.cell(site, selection.piece(site)) {
                let t = self.layout.range(site).start + facet.test();
                let (value, rate) = (facet.sign() * self.theta[t], facet.sign() * rates[t]);
                let is_met = rate < -noise[t] && self.active.vanishing().binary_search(&t).is_err();
                if is_met {
                    until = until.min(value.max(0.0) / -rate);
                }
            }
        }
        Ok(until)
    }

    /// The first event along the curve of solutions of H(x, θ + s δ) = 0.
    fn followed(
        &self,
        map: &dyn PiecewiseSmooth,
        delta: &[f64],
        horizon: f64,
    ) -> Result<Validity, SensitivityError> {
        let line = Line::new(map, &self.at[self.n..], delta, horizon)?;
        let mut start = self.at[..self.n].to_vec();
        start.push(0.0);
        let options = ContinuationOptions::default().with_parameter_range((0.0, 1.0));
        let mut curve = Continuation::new(&line, &start, Direction::Increasing, options)?;
        let (mut reached, mut met) = (0.0, None::<(f64, Transition)>);
        for event in curve.by_ref() {
            let event = event?;
            reached = event.parameter();
            if let Some((at, transition)) = met.take() {
                let is_left = reached - at <= SAME.sqrt()
                    || !self.goes_on(map, (delta, horizon), &transition, event.x())?;
                if is_left {
                    return Ok(Validity::Followed(horizon * at));
                }
            }
            // Those at the start are the kink that the solution is on.
            let is_kink = !matches!(event, Event::Point(_) | Event::Monitor(_)) && reached > SAME;
            match event {
                Event::Transition(own) if is_kink && own.kind == TransitionKind::PassThrough => {
                    met = Some((reached, own));
                }
                _ if is_kink => return Ok(Validity::Followed(horizon * reached)),
                _ => {}
            }
        }
        if let Some((at, _)) = met {
            return Ok(Validity::Followed(horizon * at));
        }
        Ok(match curve.termination() {
            None | Some(Termination::ParameterRange) => Validity::Beyond(horizon),
            Some(why) => Validity::Lost(horizon * reached, why),
        })
    }
    /// Whether the piece on which a curve arrives at a transition is still its piece from there to a later point: where two pieces have one
    /// solution along the curve, which runs on the kink between them, rounding alone tells which of them is followed.
    fn goes_on(
        &self,
        map: &dyn PiecewiseSmooth,
        (delta, horizon): (&[f64], f64),
        transition: &Transition,
        later: &[f64],
    ) -> Result<bool, SensitivityError> {
        let place = |s: f64, near: &[f64]| {
            let moved = self.at[self.n..].iter().zip(delta);
            let theta: Vec<f64> = moved.map(|(t, d)| t + s * horizon * d).collect();
            Place::new(map, &theta, &transition.before, &self.layout, near)
        };
        let (from, to) = (transition.parameter(), later[self.n]);
        let (Some(here), Some(there)) = (
            place(from, &transition.x[..self.n])?,
            place(to, &later[..self.n])?,
        ) else {
            return Ok(false);
        };
        let half: Vec<f64> = here
            .x()
            .iter()
            .zip(there.x())
            .map(|(a, b)| 0.5 * (a + b))
            .collect();
        let half = place(0.5 * (from + to), &half)?;
        Ok(there.was_near() && half.is_some_and(|half| here.holds_to(&half, &there)))
    }
}
