//! Which of the arms found are one and the same, and whether the points along them are where their expansions say: corrected points at a
//! small distance decide.

use super::coincidence::SAFETY;
use super::search::{ArmSearch, Arms};
use super::units::Units;
use super::{Found, PointDoubt};
use crate::continuation::error::{if_converged, if_solved};
use crate::continuation::step::judge::ARMS;
use crate::linear::LinearSolver;
use crate::piecewise::{PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Scaled, Selection, Vanishing};
use crate::sparse::{distance, dot, norm};
use crate::spread::centred;

/// Distances of the corrected points from the point, in balanced units: the first at which all arms are found and separate serves.
const RADII: [f64; 6] = [3.9e-3, 4.9e-4, 6.1e-5, 7.6e-6, 9.5e-7, 1.2e-7];

/// Share of its distance by which a point on an arm may be off its expansion, or moved by rounding.
const SHARE: f64 = 0.25;

/// Cosine of an angle between arms that are compared with each other; it is no criterion of identity.
const NEAR: f64 = 0.5;

/// Lengths and angles about a point in the sizes of its variables, whatever units they are in.
struct Measure(Vec<f64>);

impl Measure {
    /// With the geometric means of the sizes in the selections of the arms, rounded to powers of two.
    fn of(found: &[Found], variables: usize) -> Self {
        let known = || found.iter().filter(|f| !f.units.is_empty());
        let mean = |j: usize| {
            let logarithms: f64 = known().map(|f| f.units[j].log2()).sum();
            (logarithms / known().count().max(1) as f64).round().exp2()
        };
        Self((0..variables).map(mean).collect())
    }

    fn dot(&self, a: &[f64], b: &[f64]) -> f64 {
        let terms = a.iter().zip(b).zip(&self.0);
        terms.map(|((a, b), unit)| (a / unit) * (b / unit)).sum()
    }

    fn norm(&self, a: &[f64]) -> f64 {
        self.dot(a, a).sqrt()
    }

    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let apart: Vec<f64> = a.iter().zip(b).map(|(a, b)| a - b).collect();
        self.norm(&apart)
    }

    fn cosine(&self, a: &[f64], b: &[f64]) -> f64 {
        self.dot(a, b) / (self.norm(a) * self.norm(b))
    }

    /// The normal, of length 1 in the variables, of the plane that is orthogonal to a direction in these sizes.
    fn normal(&self, t: &[f64]) -> Vec<f64> {
        let mut normal: Vec<f64> = t.iter().zip(&self.0).map(|(t, unit)| t / unit / unit).collect();
        let length = norm(&normal);
        normal.iter_mut().for_each(|n| *n /= length);
        normal
    }
}

impl<P: PiecewiseSmooth + ?Sized, L: LinearSolver> ArmSearch<'_, P, L> {
    /// Moves the arms found to the list: each once, with a corrected point where tangents alone do not tell them apart.
    pub(super) fn settle(&mut self, arms: &mut Arms) -> Result<(), PiecewiseError> {
        let found = std::mem::take(&mut self.found);
        let mut kept = self.outside_continua(found);
        arms.continua = self.solids.iter().map(|s| s.dimension).collect();
        let plain = kept.len() <= 2 && kept.iter().all(|f| f.facets.is_empty() && f.is_simple());
        if !plain {
            let mut settled = false;
            let measure = Measure::of(&kept, self.x.len());
            let unit = kept.iter_mut().map(|f| self.unit(f)).fold(0.0, f64::max);
            // Tangents tell which arm a curve arrived on, unless arms touch each other.
            let within = if touch(&kept, &measure) {
                self.within
            } else {
                f64::INFINITY
            };
            let far = RADII.partition_point(|radius| radius * unit > within);
            for radius in RADII[far..].iter().chain(&RADII[..far]).copied() {
                if let Some(probes) = self.probes(&mut kept, &measure, radius)?
                    && let Some(gone) = repeated(&kept, &probes, &measure)
                {
                    let mut gone = gone.into_iter();
                    kept.retain(|_| !gone.next().unwrap_or(false));
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
    fn probes(
        &mut self,
        found: &mut [Found],
        measure: &Measure,
        radius: f64,
    ) -> Result<Option<Vec<Probe>>, PiecewiseError> {
        let mut probes = Vec::with_capacity(found.len());
        let mut lengths: Vec<f64> = Vec::with_capacity(found.len());
        let units: Vec<f64> = found.iter_mut().map(|f| self.unit(f)).collect();
        for k in 0..found.len() {
            // Arms that may be the same are compared at the same distance, whatever the units of their selections.
            let near = |j: &usize| measure.cosine(&found[*j].arm.tangent, &found[k].arm.tangent) > NEAR;
            let length = (0..k).find(near).map_or(radius * units[k], |j| lengths[j]);
            lengths.push(length);
            let Some(probe) = self.probe(&found[k], measure, length / units[k])? else {
                return Ok(None);
            };
            found[k].arm.probe.clone_from(&probe.point);
            probes.push(probe);
        }
        Ok(Some(probes))
    }

    /// The length of the tangent of an arm in balanced units.
    fn unit(&self, found: &mut Found) -> f64 {
        let arm = &found.arm;
        let find = || Units::new(self.map, &arm.selection, self.x).unit_along(&arm.tangent);
        *found.unit.get_or_insert_with(find)
    }

    /// The corrected point on an arm; `None`, too, where rounding of H may have moved it as far as its distance allows.
    fn probe(
        &mut self,
        found: &Found,
        measure: &Measure,
        radius: f64,
    ) -> Result<Option<Probe>, PiecewiseError> {
        let ahead = match &found.arc {
            Some(arc) => arc.at(radius),
            None => {
                let length = radius * found.unit.unwrap_or(1.0);
                found.arm.tangent.iter().map(|t| length * t).collect()
            }
        };
        let guess: Vec<f64> = self.x.iter().zip(&ahead).map(|(x, a)| x + a).collect();
        let mut y = guess.clone();
        let (selection, mut error) = (&found.arm.selection, 0.0);
        if !self.map.is_piecewise_affine() {
            let (plane, reach) = (measure.normal(&found.arm.tangent), measure.norm(&ahead));
            let s = dot(&plane, &ahead);
            match self.in_plane(selection, (&plane, s), &guess, measure)? {
                Some(probe) if measure.distance(&probe.point, &guess) + probe.error <= SHARE * reach => {
                    (y, error) = (probe.point, probe.error);
                }
                _ => return Ok(None),
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
        Ok((!crossed).then_some(Probe { point: y, error }))
    }

    /// The point of a selection in a plane at a distance from x, next to a guess. Its error is what rounding of H moves it by or, as the
    /// corrector stops at rounding, what a repetition does. All in multiples of the sizes of the variables.
    fn in_plane(
        &mut self,
        selection: &Selection,
        (normal, s): (&[f64], f64),
        guess: &[f64],
        measure: &Measure,
    ) -> Result<Option<Probe>, PiecewiseError> {
        let map = Scaled::with_divisors(&self.map, measure.0.clone())?;
        let scaled = |v: &[f64]| -> Vec<f64> { v.iter().zip(&measure.0).map(|(v, unit)| v / unit).collect() };
        let (anchor, mut point) = (scaled(self.x), scaled(guess));
        // s = normal · (x − anchor) with the length of the normal in these units.
        let mut normal: Vec<f64> = normal.iter().zip(&measure.0).map(|(n, unit)| n * unit).collect();
        let length = norm(&normal);
        normal.iter_mut().for_each(|n| *n /= length);
        let (s, mut t) = (s / length, normal.clone());
        let first =
            (self.corrector).correct_in_plane(&map, selection, (&anchor, &normal, s), &mut point, &mut t);
        if if_converged(first)?.is_none() {
            return Ok(None);
        }
        let before = point.clone();
        let second =
            (self.corrector).correct_in_plane(&map, selection, (&anchor, &normal, s), &mut point, &mut t);
        let Some((_, mut at)) = if_converged(second)? else {
            return Ok(None);
        };
        let mut error = distance(&before, &point);
        for second in [false, true] {
            let along: Vec<f64> = (0..point.len()).map(|j| 2.0 * centred(j + 1, second)).collect();
            let Some(moved) = at.rounding_of(&along, &point, &normal) else {
                return Ok(None);
            };
            error = error.max(SAFETY * moved);
        }
        point.iter_mut().zip(&measure.0).for_each(|(p, unit)| *p *= unit);
        Ok(Some(Probe { point, error }))
    }

    /// The sign of det ∇_yH^(σ) along an arm.
    fn find_sign(&mut self, arm: &mut crate::continuation::Arm) -> Result<(), PiecewiseError> {
        if arm.direction == 0 {
            arm.det_sign = Some(0);
            return Ok(());
        }
        let at = if arm.probe.is_empty() { self.x } else { &arm.probe };
        let at = if_solved((self.corrector).linearize(self.map, &arm.selection, at, Some(&arm.tangent)))?;
        let orientation = at.and_then(|at| at.orientation(&arm.tangent));
        arm.det_sign = orientation.map(|o| o * arm.direction);
        Ok(())
    }
}

impl Found {
    /// Whether the first order decides everything.
    fn is_simple(&self) -> bool {
        self.arm.direction != 0 && self.arc.as_ref().is_none_or(|arc| arc.half.is_none())
    }
}

/// Whether two arms have the same tangent, as far as tangents at singular points are known.
fn touch(found: &[Found], measure: &Measure) -> bool {
    let same = |(i, a): (usize, &Found)| {
        let cosine = |b: &Found| measure.cosine(&a.arm.tangent, &b.arm.tangent);
        found[..i].iter().any(|b| 1.0 - cosine(b) <= ARMS * ARMS)
    };
    found.iter().enumerate().any(same)
}

/// A corrected point, and how far off it may be in the sizes of the variables.
struct Probe {
    point: Vec<f64>,
    error: f64,
}

/// Which arms are in the list already: of two selections that meet in facets in which both arms run, two arms
/// are the same where their points are nearer to each other than half the distance to any other arm of either
/// selection. The one with fewer facets to cross stays. `None` where the errors of the points do not tell the
/// others apart.
fn repeated(found: &[Found], probes: &[Probe], measure: &Measure) -> Option<Vec<bool>> {
    let mut gone = vec![false; found.len()];
    let apart = |i: usize, j: usize| measure.distance(&probes[i].point, &probes[j].point);
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
            let others = (0..found.len()).filter(|&k| {
                let s = &found[k].arm.selection;
                k != i && k != j && (*s == a.selection || *s == b.selection)
            });
            let clear = others
                .map(|k| apart(k, i).min(apart(k, j)))
                .fold(f64::INFINITY, f64::min);
            if a.selection != b.selection
                && shared
                && apart(i, j) <= 0.5 * clear
                && measure.cosine(&a.tangent, &b.tangent) > NEAR
            {
                let worse = if a.grazing.len() < b.grazing.len() { j } else { i };
                gone[worse] = true;
            }
        }
    }
    let kept: Vec<usize> = (0..found.len()).filter(|&k| !gone[k]).collect();
    let resolved = |i: usize, j: usize| apart(i, j) > 2.0 * (probes[i].error + probes[j].error);
    let all = kept
        .iter()
        .enumerate()
        .all(|(k, &i)| kept[..k].iter().all(|&j| resolved(i, j)));
    all.then_some(gone)
}

#[cfg(test)]
mod tests {
    use super::{Found, Measure, Probe, repeated};
    use crate::continuation::Arm;
    use crate::continuation::testing::{Function, Plane};
    use crate::piecewise::Selection;

    fn found(piece: usize, tangent: [f64; 2], grazing: &[usize]) -> Found {
        let selection = Selection::uniform(1, piece);
        Found {
            arm: Arm::along(selection, tangent.to_vec(), grazing.to_vec(), None),
            facets: grazing.to_vec(),
            arc: None,
            units: Vec::new(),
            unit: Some(1.0),
        }
    }

    /// Piece, tangent, facets in which it runs, and a point on it.
    type Known<'a> = (usize, [f64; 2], &'a [usize], [f64; 2]);

    /// Lengths and angles are those of the displacements in multiples of the sizes, whatever the units.
    #[test]
    fn lengths_and_angles_do_not_depend_on_units() {
        let mut arm = found(0, [1.0, 0.0], &[]);
        arm.units = vec![2.0, 0.5];
        let mut other = arm.clone();
        other.units = vec![8.0, 0.125];
        let measure = Measure::of(&[arm, other, found(0, [0.0, 1.0], &[])], 2);
        assert_eq!(measure.0, [4.0, 0.25]);
        assert_eq!(measure.dot(&[8.0, 0.5], &[4.0, 1.0]), 2.0 * 1.0 + 2.0 * 4.0);
        assert_eq!(measure.norm(&[12.0, 1.0]), 5.0);
        assert_eq!(measure.distance(&[13.0, 2.0], &[1.0, 1.0]), 5.0);
        assert_eq!(measure.cosine(&[12.0, 1.0], &[12.0, -1.0]), (9.0 - 16.0) / 25.0);
        // 3·12/16 + 4·1/(1/16) in the direction (12, 1), and nothing across it.
        let normal = measure.normal(&[12.0, 1.0]);
        assert!((normal[0] - 0.75 / 0.75_f64.hypot(16.0)).abs() < 1e-15);
        assert!((normal[0] * 16.0 - normal[1] * 0.75).abs() < 1e-14);
    }

    /// Which of these arms are repeated; errors of points are 1e-3.
    fn gone(arms: &[Known<'_>]) -> Option<Vec<bool>> {
        let list: Vec<Found> = arms.iter().map(|a| found(a.0, a.1, a.2)).collect();
        let probe = |point: [f64; 2]| Probe {
            point: point.to_vec(),
            error: 1e-3,
        };
        let probes: Vec<Probe> = arms.iter().map(|a| probe(a.3)).collect();
        repeated(&list, &probes, &Measure(vec![1.0, 1.0]))
    }

    /// Arms of two pieces are one where both run in the facet between them, their points are nearer to each other than half the distance
    /// to others, and their tangents are; that of fewer facets stays. Points within their errors of each other are not told apart.
    #[test]
    fn arms_in_a_facet_are_found_once() {
        const UP: [f64; 2] = [0.0, 1.0];
        let (site, none): (&[usize], &[usize]) = (&[0], &[]);
        let here = [0.0, 1.0];
        assert_eq!(
            gone(&[(0, UP, site, here), (1, UP, site, here)]),
            Some(vec![false, true])
        );
        assert_eq!(gone(&[(0, UP, none, here), (1, UP, site, here)]), None);
        assert_eq!(gone(&[(0, UP, site, here), (0, UP, site, here)]), None);
        let two: &[usize] = &[0, 0];
        assert_eq!(
            gone(&[(0, UP, two, here), (1, UP, site, here)]),
            Some(vec![true, false])
        );
        for (apart, one) in [(0.49, true), (0.51, false)] {
            let other = (1, UP, none, [0.0, 2.0]);
            let arms = [(0, UP, site, here), (1, UP, site, [0.0, 1.0 - apart]), other];
            assert_eq!(gone(&arms), Some(vec![false, one, false]), "{apart}");
        }
        for (tangent, one) in [([0.8, 0.6], true), ([0.9, 0.43], false)] {
            let arms = [(0, UP, site, here), (1, tangent, site, [0.0, 1.1])];
            assert_eq!(gone(&arms), Some(vec![false, one]), "{tangent:?}");
        }
        for (apart, resolved) in [(3.9e-3, false), (4.1e-3, true)] {
            let arms = [(0, UP, none, here), (0, UP, none, [apart, 1.0])];
            assert_eq!(gone(&arms).is_some(), resolved);
        }
    }

    /// Whether a point is found on the arm along a tangent from a point of a curve.
    fn is_found(map: &Plane, x: [f64; 2], arm: &Found, radius: f64) -> bool {
        let mut run = map.curve(x[0], x[1]);
        let curve = run.curve.erased_mut();
        let vanishing = curve.vanishing_here(&[]);
        let measure = Measure(vec![1.0, 1.0]);
        curve
            .search(&vanishing)
            .probe(arm, &measure, radius)
            .unwrap()
            .is_some()
    }

    /// The corrected point is off its expansion by at most a quarter of its distance, moves α as the arm does, and lies in the cell, but for
    /// facets in which the arm runs.
    #[test]
    fn points_along_arms_confirm_them() {
        let up = found(0, [0.0, 1.0], &[]);
        for (line, on_it) in [
            ((|y, a| [y - 0.24 * a, 1.0, -0.24]) as Function, true),
            (|y, a| [y - 0.26 * a, 1.0, -0.26], false),
        ] {
            assert_eq!(is_found(&Plane::smooth(line), [0.0, 0.0], &up, 1e-3), on_it);
        }
        let line: Function = |y, _| [y, 1.0, 0.0];
        let mut contrary = up.clone();
        contrary.arm.direction = -1;
        assert!(!is_found(&Plane::smooth(line), [0.0, 0.0], &contrary, 1e-3));
        let half = Plane::within(line, &[|_, a| [a, 0.0, 1.0]]);
        let (down, along) = (found(0, [0.0, -1.0], &[]), found(0, [0.0, -1.0], &[0]));
        let found = [&up, &down, &along].map(|arm| is_found(&half, [0.0, 0.0], arm, 1e-3));
        assert_eq!(found, [true, false, true]);
    }

    /// At 2³⁰ rounding of a difference is 2⁻²², times the factor of safety 4e-6: farther away points are found, nearer ones are not.
    #[test]
    fn points_within_rounding_are_not_found() {
        let far = Plane::smooth(|y, a| [y - a, 1.0, -1.0]);
        let along = found(0, [0.5_f64.sqrt(); 2], &[]);
        let at = 2.0_f64.powi(30);
        let found = [1e-3, 1e-4, 4e-6, 1e-7].map(|radius| is_found(&far, [at, at], &along, radius));
        assert_eq!(found, [true, true, false, false]);
    }
}
