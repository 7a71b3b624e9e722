//! Whether a restored state is one of a run of the map.

use super::engine::{Curve, relative_residual, row_sizes};
use super::{ContinuationError, SavedRun, Strategy};
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Selection, TestLayout, select};
use crate::sparse::{distance, norm};

/// Agreement required of values stored exactly, or recomputed.
const EXACT: f64 = 1e-9;
/// Residual of a point, relative to the terms of its rows, up to which it counts as on the curve, unless the run has a larger tolerance.
const ON_CURVE: f64 = 1e-8;
/// Distance, relative to 1 + ‖x‖, between facets as stored and as computed.
const FACET: f64 = 1e-7;
/// Angle between tangents as stored and as computed.
const TANGENT: f64 = 1e-4;

/// Refuses a state in which something deviates by more than `allowed`.
fn agree(what: &'static str, deviation: f64, allowed: f64) -> Result<(), ContinuationError> {
    if deviation <= allowed {
        return Ok(());
    }
    Err(ContinuationError::Saved { what, deviation })
}

fn relative(a: f64, b: f64) -> f64 {
    (a - b).abs() / b.abs().max(f64::MIN_POSITIVE)
}

impl SavedRun {
    /// Refuses scalars that no run can have.
    pub(super) fn check_scalars(&self, map: &dyn PiecewiseSmooth) -> Result<(), ContinuationError> {
        let positive = |v: f64| if v > 0.0 { 0.0 } else { f64::INFINITY };
        agree("the step length", positive(self.step), 0.0)?;
        agree(
            "the size of the start",
            relative(self.size, 1.0 + norm(&self.start)),
            EXACT,
        )?;
        let negative = [self.arclength, self.residual_scale, self.curvature]
            .into_iter()
            .chain(self.row_sizes.iter().copied())
            .fold(0.0f64, |a, v| a.max(-v));
        agree("a length", negative, 0.0)?;
        let finite = self.row_sizes.iter().all(|v| v.is_finite());
        let rows = if map.is_piecewise_affine() {
            0
        } else {
            map.num_residuals()
        };
        let fits = self.row_sizes.len() == rows && finite && self.curvature.is_finite();
        agree(
            "the list of row sizes",
            if fits { 0.0 } else { f64::INFINITY },
            0.0,
        )?;
        let sides = self.sides.iter().all(|s| [-1.0, 0.0, 1.0].contains(s));
        agree(
            "the side of a monitor",
            if sides { 0.0 } else { f64::INFINITY },
            0.0,
        )?;
        let exact = self.sizes.iter().all(|s| s.log2().fract() == 0.0);
        agree("a typical size", if exact { 0.0 } else { f64::INFINITY }, 0.0)?;
        let layout = TestLayout::new(map);
        for v in &self.grazing {
            let known = layout.locate(v.index) == (v.site, v.test);
            agree("a facet grazed", if known { 0.0 } else { f64::INFINITY }, 0.0)?;
            agree(
                "its gradient",
                relative(v.gradient_norm, norm(&v.gradient)),
                EXACT,
            )?;
        }
        Ok(())
    }
}

impl Curve<'_> {
    /// Compares the state with the map: point and start on the curve, test functions, the cell of the selection, tangent and signs.
    pub(super) fn check_restored(&mut self, saved: &SavedRun) -> Result<(), ContinuationError> {
        let mut x = self.here.x.clone();
        self.map.unscale(&mut x);
        let off = (x.iter().zip(&saved.x)).map(|(a, b)| if a == b { 0.0 } else { relative(*a, *b) });
        agree("the point in scaled variables", off.fold(0.0, f64::max), EXACT)?;
        let here = self.here.x.clone();
        self.check_on_curve("the point", &here, &self.selection.clone())?;
        let start = self.start.clone();
        self.check_on_curve("the start", &start, &select(&self.map, &start))?;
        self.check_facets()?;
        if self.termination.is_none() {
            agree(
                "the length of the tangent",
                (norm(&self.here.t) - 1.0).abs(),
                EXACT,
            )?;
            if let Some(heading) = self.here.heading {
                let rate = self.here.t.last().copied().unwrap_or(0.0);
                let fits = (-1..=1).contains(&heading) && f64::from(heading) * rate >= -TANGENT;
                agree("the direction of the parameter", f64::from(u8::from(!fits)), 0.0)?;
            }
            self.check_direction()?;
        }
        Ok(())
    }

    fn check_on_curve(
        &mut self,
        what: &'static str,
        x: &[f64],
        selection: &Selection,
    ) -> Result<(), ContinuationError> {
        const MARGIN: f64 = 1e3;
        const LEAST: f64 = 1e-4;
        let mut sizes = Vec::new();
        let t = self.here.t.clone();
        let ahead: Vec<f64> = x.iter().zip(&t).map(|(x, t)| x + self.h * t).collect();
        // Rows of variables that are zero have no terms but rounding errors.
        let least = LEAST * (1.0 + norm(x));
        let reach: Vec<f64> = x.iter().map(|x| x.abs() + least).collect();
        for at in [&ahead[..], x] {
            self.corrector.assemble(&self.map, selection, at)?;
            let tolerance = self.options.residual_tolerance;
            row_sizes(
                self.corrector.jacobian(),
                &reach,
                (self.h, &t),
                tolerance,
                &mut sizes,
            );
        }
        let mut r = vec![0.0; self.map.num_residuals()];
        self.map.residual(selection, x, &mut r);
        let tolerance = MARGIN * self.options.residual_tolerance;
        if self.options.strategy == Strategy::Switching && norm(&r) <= tolerance {
            return Ok(());
        }
        agree(what, relative_residual(&r, &sizes), tolerance.max(ON_CURVE))
    }

    /// Sizes of the gradients of the test functions, estimated from their rates in a few directions.
    fn gradient_sizes(&self) -> Vec<f64> {
        const DIRECTIONS: u64 = 4;
        let (m, total) = (self.here.x.len(), self.layout.total());
        let mut sizes = vec![0.0f64; total];
        let mut rates = vec![0.0; total];
        for k in 0..DIRECTIONS {
            let phase = |j: usize| (1.0 + 0.618_034 * k as f64) * (j as f64 + 1.0);
            let mut d: Vec<f64> = (0..m).map(|j| 1.0 + (7.0 * phase(j)).sin()).collect();
            let length = norm(&d) / (m as f64).sqrt();
            for (j, d) in d.iter_mut().enumerate() {
                *d *= (13.0 * phase(j)).cos().signum() / length;
            }
            self.map
                .tests_of_selection(&self.selection, &self.here.x, Some(&d), &mut rates);
            for (size, rate) in sizes.iter_mut().zip(&rates) {
                *size = size.max(rate.abs());
            }
        }
        sizes
    }

    fn check_facets(&self) -> Result<(), ContinuationError> {
        const GRAZING: f64 = 1e3;
        let total = self.layout.total();
        let mut theta = vec![0.0; total];
        self.map
            .tests_of_selection(&self.selection, &self.here.x, None, &mut theta);
        let sizes = self.gradient_sizes();
        let length = 1.0 + norm(&self.here.x);
        let reach: Vec<f64> = (sizes.iter().zip(&theta))
            .map(|(size, theta)| FACET * size * length + EXACT * theta.abs())
            .collect();
        for k in 0..total {
            let off = (theta[k] - self.here.theta[k]).abs();
            agree("a test function", off, reach[k])?;
        }
        if self.termination.is_some() {
            return Ok(());
        }
        for v in &self.grazing {
            let near =
                GRAZING * self.options.vanishing_distance * length * v.gradient_norm.min(sizes[v.index]);
            agree("a facet grazed", theta[v.index].abs(), near.max(reach[v.index]))?;
        }
        // The algorithm of the talk switches within its smallest step.
        let slack = match self.options.strategy {
            Strategy::Located => 10.0,
            Strategy::Switching => 10.0 + 10.0 * self.options.min_step / FACET,
        };
        for site in 0..self.layout.num_sites() {
            let first = self.layout.range(site).start;
            for facet in self.map.cell(site, self.selection.piece(site)) {
                let k = first + facet.test();
                if !self.grazing.iter().any(|v| v.index == k) {
                    agree("the selection", -facet.sign() * theta[k], slack * reach[k])?;
                }
            }
        }
        Ok(())
    }

    /// Tangent and orientations, where the Jacobians are regular.
    fn check_direction(&mut self) -> Result<(), ContinuationError> {
        let selection = self.selection.clone();
        let (x, t) = (self.here.x.clone(), self.here.t.clone());
        let coactive = self.coactive.clone();
        if self.here.orientation.is_some() && self.is_regular(&selection)? {
            let rcond = self.corrector.rcond().unwrap_or(1.0);
            let allowed = TANGENT.max(self.options.step_tolerance) + 1e3 * f64::EPSILON / rcond;
            let found = self.corrector.tangent();
            let back: Vec<f64> = found.iter().map(|v| -v).collect();
            agree(
                "the tangent",
                distance(found, &t).min(distance(&back, &t)),
                allowed,
            )?;
        }
        let signs = std::iter::once((selection, self.here.orientation)).chain(coactive);
        for (selection, sign) in signs {
            if let Some(sign) = sign
                && self.is_regular(&selection)?
                && let Some(found) = self.orientation_of(&selection, &x, &t)?
            {
                agree(
                    "an orientation",
                    f64::from((found - sign.clamp(-2, 2)).abs()),
                    0.0,
                )?;
            }
        }
        Ok(())
    }

    /// Whether ∇H^(σ) has full rank at `here`, well above rounding.
    fn is_regular(&mut self, selection: &Selection) -> Result<bool, ContinuationError> {
        const POOR: f64 = 1e-10;
        if self.is_singular_here(selection)? {
            return Ok(false);
        }
        let (x, t) = (self.here.x.clone(), self.here.t.clone());
        match self.corrector.linearize(&self.map, selection, &x, Some(&t)) {
            Ok(_) => Ok(self.corrector.rcond().is_none_or(|r| r > POOR)),
            Err(PiecewiseError::Linear(_)) => Ok(false),
            Err(e) => Err(e.into()),
        }
    }
}
