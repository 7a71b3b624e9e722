//! Which of the arms found are one and the same, and whether the points along them are where their expansions say: corrected points at a
//! small distance decide.

use super::search::{ArmSearch, Arms};
use super::{Found, PointDoubt};
use crate::linear::LinearSolver;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, Vanishing};
use crate::sparse::{distance, dot, norm};

/// Distances of the corrected points from the point, in balanced units: the first at which all arms are found and separate serves.
const RADII: [f64; 6] = [3.9e-3, 4.9e-4, 6.1e-5, 7.6e-6, 9.5e-7, 1.2e-7];

/// Cosine of an angle between arms that are compared with each other; it is no criterion of identity.
const NEAR: f64 = 0.5;

impl<P: PiecewiseSmooth + ?Sized, L: LinearSolver> ArmSearch<'_, P, L> {
    /// Moves the arms found to the list: each once, with a corrected point where tangents alone do not tell them apart.
    pub(super) fn settle(&mut self, arms: &mut Arms) -> Result<(), PiecewiseError> {
        let found = std::mem::take(&mut self.found);
        let mut kept = self.outside_continua(found);
        arms.continua = self.solids.iter().map(|s| s.dimension).collect();
        let plain = kept.len() <= 2 && kept.iter().all(|f| f.facets.is_empty() && f.is_simple());
        if !plain {
            let mut settled = false;
            for radius in RADII {
                if let Some(probes) = self.probes(&mut kept, radius)? {
                    kept = merged(kept, &probes);
                    settled = true;
                    break;
                }
            }
            if !settled {
                arms.doubt(PointDoubt::Contradiction);
            }
        }
        arms.list = kept.into_iter().map(|f| f.arm).collect();
        for k in 0..arms.list.len() {
            self.find_sign(&mut arms.list[k])?;
        }
        Ok(())
    }

    /// Without the arms that run inside a continuum, along its boundary.
    fn outside_continua(&self, mut found: Vec<Found>) -> Vec<Found> {
        found.retain(|f| {
            let inside = |solid: &super::search::Solid| {
                let mut rest = f.arm.tangent.clone();
                for v in &solid.kernel {
                    let share = dot(&rest, v);
                    rest.iter_mut().zip(v).for_each(|(r, v)| *r -= share * v);
                }
                let apart = solid.selection.differing_sites(&f.arm.selection);
                norm(&rest) <= super::search::RANK.sqrt()
                    && apart.into_iter().all(|site| f.arm.grazing.contains(&site))
            };
            !self.solids.iter().any(inside)
        });
        found
    }

    /// A corrected point on each arm at one distance; `None` where one is not found near its expansion, or lies outside of its cell.
    fn probes(&mut self, found: &mut [Found], radius: f64) -> Result<Option<Vec<Vec<f64>>>, PiecewiseError> {
        let mut probes = Vec::with_capacity(found.len());
        let mut lengths: Vec<f64> = Vec::with_capacity(found.len());
        for k in 0..found.len() {
            // Arms that may be the same are compared at the same distance, whatever the units of their selections.
            let near = |j: &usize| dot(&found[*j].arm.tangent, &found[k].arm.tangent) > NEAR;
            let length = (0..k).find(near).map_or(radius * found[k].unit, |j| lengths[j]);
            lengths.push(length);
            let Some(probe) = self.probe(&found[k], length / found[k].unit)? else {
                return Ok(None);
            };
            found[k].arm.probe.clone_from(&probe);
            probes.push(probe);
        }
        Ok(Some(probes))
    }

    fn probe(&mut self, found: &Found, radius: f64) -> Result<Option<Vec<f64>>, PiecewiseError> {
        let ahead = match &found.arc {
            Some(arc) => arc.at(radius),
            None => found
                .arm
                .tangent
                .iter()
                .map(|t| radius * found.unit * t)
                .collect(),
        };
        let mut y: Vec<f64> = self.x.iter().zip(&ahead).map(|(x, a)| x + a).collect();
        let guess = y.clone();
        let (selection, mut t) = (&found.arm.selection, found.arm.tangent.clone());
        if !self.map.is_piecewise_affine() {
            let normal = found.arm.tangent.clone();
            let s = dot(&normal, &ahead);
            let corrected = self
                .corrector
                .correct_in_plane(self.map, selection, self.x, &normal, s, &mut y, &mut t);
            match corrected {
                Ok(c) if c.converged && distance(&y, &guess) <= 0.25 * norm(&ahead) => {}
                Ok(_) | Err(PiecewiseError::Linear(_)) => return Ok(None),
                Err(e) => return Err(e),
            }
        }
        let last = y.len() - 1;
        let moved = y[last] - self.x[last];
        if f64::from(found.arm.direction) * moved < 0.0 {
            return Ok(None);
        }
        let mut theta = vec![0.0; self.layout.total()];
        self.map.tests_of_selection(selection, &y, None, &mut theta);
        let leaves = |v: &Vanishing| {
            let mut facets = self.map.cell(v.site, selection.piece(v.site)).iter();
            facets.any(|f| f.test() == v.test && f.sign() * theta[v.index] < 0.0)
        };
        // Along facets in which the arm runs the signs are rounding.
        let crossed = self
            .vanishing
            .iter()
            .any(|v| !found.facets.contains(&v.index) && leaves(v));
        Ok((!crossed).then_some(y))
    }

    /// The sign of det ∇_yH^(σ) along an arm.
    fn find_sign(&mut self, arm: &mut crate::continuation::Arm) -> Result<(), PiecewiseError> {
        if arm.direction == 0 {
            arm.det_sign = Some(0);
            return Ok(());
        }
        let at = if arm.probe.is_empty() { self.x } else { &arm.probe };
        arm.det_sign = match self
            .corrector
            .linearize(self.map, &arm.selection, at, Some(&arm.tangent))
        {
            Ok(_) => self
                .corrector
                .orientation(&arm.tangent)
                .map(|o| o * arm.direction),
            Err(PiecewiseError::Linear(_)) => None,
            Err(e) => return Err(e),
        };
        Ok(())
    }
}

impl Found {
    /// Whether the first order decides everything.
    fn is_simple(&self) -> bool {
        self.arm.direction != 0 && self.arc.as_ref().is_none_or(|arc| arc.half.is_none())
    }
}

/// Each arm once: of two selections that meet in facets in which both arms run, two arms are the same where their points are nearer to each
/// other than half the distance to any other arm of either selection. The one with fewer facets to cross stays.
fn merged(found: Vec<Found>, probes: &[Vec<f64>]) -> Vec<Found> {
    let mut gone = vec![false; found.len()];
    for i in 0..found.len() {
        for j in 0..i {
            if gone[i] || gone[j] {
                continue;
            }
            let (a, b) = (&found[i].arm, &found[j].arm);
            let shared = a
                .selection
                .differing_sites(&b.selection)
                .all(|site| a.grazing.contains(&site) && b.grazing.contains(&site));
            let apart = distance(&probes[i], &probes[j]);
            let others = (0..found.len()).filter(|&k| {
                let s = &found[k].arm.selection;
                k != i && k != j && (*s == a.selection || *s == b.selection)
            });
            let clear = others
                .map(|k| distance(&probes[k], &probes[i]).min(distance(&probes[k], &probes[j])))
                .filter(|d| *d > 0.0)
                .fold(f64::INFINITY, f64::min);
            if a.selection != b.selection
                && shared
                && apart <= 0.5 * clear
                && dot(&a.tangent, &b.tangent) > NEAR
            {
                let worse = if a.grazing.len() < b.grazing.len() { j } else { i };
                gone[worse] = true;
            }
        }
    }
    let mut k = 0;
    found
        .into_iter()
        .filter(|_| {
            k += 1;
            !gone[k - 1]
        })
        .collect()
}
