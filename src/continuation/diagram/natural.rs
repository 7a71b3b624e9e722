//! Diagrams in the variables of the map, explored in scaled ones.

use super::{Diagram, DiagramCompleteness, DiagramOptions, Progress, SolutionsAt};
use crate::continuation::{Certainty, Point};
use crate::piecewise::ScaledMap;
use std::ops::ControlFlow;

impl Diagram {
    pub(super) fn scale(&mut self, map: &dyn ScaledMap) {
        self.convert(
            |x| map.scale(x),
            |t| map.scale_direction(t),
            map.parameter_size().recip(),
        );
    }

    pub(super) fn unscale(&mut self, map: &dyn ScaledMap) {
        self.convert(
            |x| map.unscale(x),
            |t| map.unscale_direction(t),
            map.parameter_size(),
        );
        self.sizes = map.divisors().to_vec();
    }

    fn convert(&mut self, position: impl Fn(&mut [f64]), direction: impl Fn(&mut [f64]), length: f64) {
        self.range.0 *= length;
        self.range.1 *= length;
        let convert = |p: &mut Point| {
            position(&mut p.x);
            direction(&mut p.tangent);
            p.arclength *= length;
        };
        self.edges
            .iter_mut()
            .flat_map(|e| &mut e.points)
            .for_each(convert);
        if let DiagramCompleteness::UpToSteps { step } = &mut self.completeness {
            *step *= length;
        }
        for vertex in &mut self.vertices {
            position(&mut vertex.x);
            if let Certainty::Within { radius } = &mut vertex.certainty {
                *radius *= length;
            }
            for a in &mut vertex.arms {
                direction(&mut a.arm.tangent);
                position(&mut a.arm.probe);
            }
        }
    }
}

impl SolutionsAt {
    pub(super) fn unscale(&mut self, map: &dyn ScaledMap) {
        self.points.iter_mut().for_each(|s| map.unscale(&mut s.x));
        self.isolated.iter_mut().for_each(|x| map.unscale(x));
    }
}

/// Starts in scaled variables.
pub(super) fn scaled_starts<S: AsRef<[f64]>>(map: &dyn ScaledMap, starts: &[S]) -> Vec<Vec<f64>> {
    let scaled = |s: &S| {
        let mut z = s.as_ref().to_vec();
        map.scale(&mut z);
        z
    };
    starts.iter().map(scaled).collect()
}

/// Options in scaled variables, for a map that is scaled already.
pub(super) fn scaled_options(map: &dyn ScaledMap, options: &DiagramOptions) -> DiagramOptions {
    let mut options = options.clone();
    map.scale_options(&mut options.continuation);
    options.continuation.typical_sizes.clear();
    options
}

/// An observer that sees events in the variables of the map.
pub(super) fn natural_observer<'s>(
    map: &'s dyn ScaledMap,
    mut observe: impl FnMut(&Progress<'_>) -> ControlFlow<()> + 's,
) -> impl FnMut(&Progress<'_>) -> ControlFlow<()> + 's {
    move |progress| {
        if map.divisors().is_empty() {
            return observe(progress);
        }
        let mut event = progress.event.clone();
        map.unscale_event(&mut event);
        observe(&Progress {
            event: &event,
            ..*progress
        })
    }
}
