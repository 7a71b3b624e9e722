//! Which arm of a vertex an arm, or a curve that arrives, is.

use std::ops::ControlFlow;

use super::VertexArm;
use super::arc::Arc;
use super::explore::{Explorer, Progress};
use super::split::Stretch;
use crate::continuation::event::singular::mirrored_tangent;
use crate::continuation::start::solver;
use crate::continuation::{Arm, Point};
use crate::newton::MoorePenrose;
use crate::piecewise::PiecewiseSmooth;
use crate::sparse::{distance, dot};

/// Cosine of the angle up to which the nearest arm of a vertex may be the one with a given tangent: that of a right angle by far.
const NEAR: f64 = 0.5;

impl<O: FnMut(&Progress<'_>) -> ControlFlow<()>> Explorer<'_, O> {
    /// The arm of a vertex that is this one, added if there is none: the nearest by the corrected points of both, or else by the tangents.
    pub(super) fn slot(&mut self, v: usize, arm: &Arm) -> usize {
        let vertex = &mut self.diagram.vertices[v];
        let far = |k: &usize| {
            let own = &vertex.arms[*k].arm;
            match (own.probe.is_empty(), arm.probe.is_empty()) {
                (false, false) => distance(&own.probe, &arm.probe) / distance(&own.probe, &vertex.x),
                _ => distance(&own.tangent, &arm.tangent),
            }
        };
        let nearest = (0..vertex.arms.len()).min_by(|i, j| far(i).total_cmp(&far(j)));
        let ahead = |k: &usize| dot(&vertex.arms[*k].arm.tangent, &arm.tangent) > NEAR;
        match nearest.filter(ahead) {
            Some(k) => k,
            None => {
                vertex.arms.push(VertexArm::new(arm.clone()));
                vertex.arms.len() - 1
            }
        }
    }

    /// The arm of a known vertex along which an arc arrives.
    pub(super) fn slot_of_arrival(&mut self, v: usize, arc: &Arc, point: &Point, incoming: &Arm) -> usize {
        let vertex = &self.diagram.vertices[v];
        let mut nearest: Option<(f64, usize)> = None;
        for (k, slot) in vertex.arms.iter().enumerate() {
            let probe = &slot.arm.probe;
            let radius = if probe.is_empty() {
                0.0
            } else {
                distance(probe, &vertex.x)
            };
            let point = (radius > 0.0)
                .then(|| behind(self.map, arc, point, radius))
                .flatten();
            let far = match point {
                Some(point) => distance(probe, &point) / radius,
                None => distance(&slot.arm.tangent, &incoming.tangent),
            };
            if dot(&slot.arm.tangent, &incoming.tangent) > NEAR && nearest.is_none_or(|n| far < n.0) {
                nearest = Some((far, k));
            }
        }
        match nearest {
            Some((_, k)) => k,
            None => self.slot(v, incoming),
        }
    }
}

/// The point of an arc at a distance before its end.
fn behind(map: &dyn PiecewiseSmooth, arc: &Arc, end: &Point, radius: f64) -> Option<Vec<f64>> {
    let far = |p: &Point| distance(&p.x, &end.x);
    let last = arc.points.iter().rposition(|p| far(p) > 0.0)?;
    let Some(k) = arc.points.iter().rposition(|p| far(p) > radius) else {
        return Some(arc.points[last].x.clone());
    };
    let mut corrector = MoorePenrose::new(map, solver()).ok()?;
    let before = &arc.points[k];
    let after = if k < last { &arc.points[k + 1] } else { end };
    // Where curves cross the tangent at the end is any one between theirs.
    let after = &Point {
        tangent: match k < last {
            true => after.tangent.clone(),
            false => mirrored_tangent((&before.x, &before.tangent), &end.x),
        },
        ..after.clone()
    };
    let share = (far(before) - radius) / (far(before) - far(after));
    let found = Stretch::new(before, after)?
        .at(map, &mut corrector, share)
        .ok()??;
    Some(found.0)
}
