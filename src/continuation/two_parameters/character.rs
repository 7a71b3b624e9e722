use super::TransitionSet;
use super::transition_set::Determinants;
use crate::continuation::Branch;
use crate::input::check_vector;
use crate::linear::{AutoSolver, LinearError};
use crate::newton::MoorePenrose;
use crate::piecewise::{
    PiecewiseError, PiecewiseSmooth, PiecewiseSmoothExt, Scaled, ScaledMap, Selection, check_selection,
    check_sizes,
};
use crate::sparse::{dot, norm};
use crate::tolerances::{CHECKED, HALF_DIGITS, HALVINGS};

/// A point of a [`TransitionSet`] where folds begin or end along it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct CharacterChange {
    /// The point (y, α, β).
    pub x: Vec<f64>,
    /// The selection of the family on the side of the facet whose pieces are kept.
    pub selection: Selection,
    /// Whether the transitions before it, in the direction of the curve, are folds.
    pub folds_before: bool,
}

/// Distance in a stretch, relative to its length, over which a determinant's slope is measured; zeros nearer to each other are one.
const DIFFERENCE: f64 = 1e-5;

impl<P: PiecewiseSmooth> TransitionSet<P> {
    /// The points of a followed curve at which its transitions change between folds and pass-throughs, as the
    /// determinant of a piece beside the facet passes zero. Curves of [smooth folds](crate::continuation::FoldSet) end there. Points of codimension
    /// two where a second test function vanishes are transitions of the curve, and not repeated.
    ///
    /// Between neighbouring points of the curve each determinant is taken to have one extremum at most: where steps are longer than that, zeros in
    /// pairs are missed ([`max_step`](crate::continuation::ContinuationOptions::max_step)).
    ///
    /// # Errors
    /// A curve of another map, or one whose points are too far apart to find those in between; failures of the linear solver.
    pub fn character_changes(&self, curve: &Branch) -> Result<Vec<CharacterChange>, PiecewiseError> {
        let nodes = nodes_of(curve);
        for node in &nodes {
            check_vector("a point of the curve", node.x, self.num_vars())?;
            check_selection("the selection of a point of the curve", node.after, self)?;
        }
        let mut sizes = vec![1.0; self.num_vars()];
        self.typical_sizes(&mut sizes);
        check_sizes(&sizes, self.num_vars())?;
        let scaled = Scaled::with_divisors(self, extents(&nodes, &sizes))?;
        let mut tools = Tools {
            corrector: MoorePenrose::new(&scaled, AutoSolver::default())?,
            determinants: self.determinants(),
        };
        let mut changes = Vec::new();
        let mut folds = None;
        for pair in nodes.windows(2) {
            if pair[0].before != pair[0].after {
                folds = None;
            }
            let Some(mut stretch) = Stretch::new(self, &scaled, &mut tools, [&pair[0], &pair[1]])? else {
                continue;
            };
            let mut cuts = stretch.zeros()?;
            cuts.push(stretch.length);
            let mut last = 0.0;
            for cut in cuts {
                let start = std::mem::replace(&mut last, cut);
                if cut - start <= DIFFERENCE * stretch.length {
                    continue;
                }
                let x = stretch.at(0.5 * (start + cut))?;
                let Some(now) = self.folds_at(stretch.selection, &x, &mut stretch.tools.determinants)? else {
                    continue;
                };
                if let Some(before) = folds.replace(now).filter(|b| *b != now) {
                    changes.push(CharacterChange {
                        x: stretch.at(start)?,
                        selection: self.family_selection(stretch.selection),
                        folds_before: before,
                    });
                }
            }
        }
        Ok(changes)
    }
}

/// A point of the curve, or a transition, with the selections on arrival and departure.
struct Node<'c> {
    x: &'c [f64],
    arclength: f64,
    before: &'c Selection,
    after: &'c Selection,
}

/// Points and transitions by arclength.
fn nodes_of(curve: &Branch) -> Vec<Node<'_>> {
    let points = curve.points.iter().map(|p| Node {
        x: &p.x,
        arclength: p.arclength,
        before: &p.selection,
        after: &p.selection,
    });
    let transitions = curve.transitions.iter().map(|t| Node {
        x: &t.x,
        arclength: t.arclength,
        before: &t.before,
        after: &t.after,
    });
    // Stable: at a transition from which the curve starts the point comes first.
    let mut nodes: Vec<Node<'_>> = points.chain(transitions).collect();
    nodes.sort_by(|a, b| a.arclength.total_cmp(&b.arclength));
    nodes
}

/// The range of each variable along the curve: the units in which the hyperplanes are normal to it. Variables that change by rounding alone
/// have the smallest unit.
fn extents(nodes: &[Node<'_>], sizes: &[f64]) -> Vec<f64> {
    let range = |j: usize| {
        let values = nodes.iter().map(|n| n.x[j]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
            (l.min(v), h.max(v))
        })
    };
    let ranges: Vec<_> = (0..sizes.len()).map(range).collect();
    let farthest = |((low, high), s): (&(f64, f64), &f64)| low.abs().max(high.abs()) / s;
    let largest = ranges.iter().zip(sizes).map(farthest).fold(0.0, f64::max);
    let extent = |((low, high), s): (&(f64, f64), &f64)| {
        // Never so short that rounding of the points decides.
        let extent = (high - low).max(HALF_DIGITS * largest * s);
        if extent > 0.0 && extent.is_finite() {
            extent
        } else {
            1.0
        }
    };
    ranges.iter().zip(sizes).map(extent).collect()
}

/// Workspace for all arcs of a curve.
struct Tools {
    corrector: MoorePenrose<AutoSolver>,
    determinants: Determinants,
}

/// The curve between two nodes, and the determinants on both sides of the facet.
struct Stretch<'s, P: PiecewiseSmooth> {
    set: &'s TransitionSet<P>,
    scaled: &'s Scaled<&'s TransitionSet<P>>,
    tools: &'s mut Tools,
    selection: &'s Selection,
    sides: [Selection; 2],
    /// The first node, and the unit vector to the second.
    anchor: Vec<f64>,
    normal: Vec<f64>,
    length: f64,
}

impl<'s, P: PiecewiseSmooth> Stretch<'s, P> {
    /// `None` where the nodes coincide or there is no piece beyond the facet.
    fn new(
        set: &'s TransitionSet<P>,
        scaled: &'s Scaled<&'s TransitionSet<P>>,
        tools: &'s mut Tools,
        [from, to]: [&Node<'s>; 2],
    ) -> Result<Option<Self>, PiecewiseError> {
        let (mut anchor, mut normal) = (from.x.to_vec(), to.x.to_vec());
        scaled.scale(&mut anchor);
        scaled.scale(&mut normal);
        normal.iter_mut().zip(&anchor).for_each(|(n, a)| *n -= a);
        let length = norm(&normal);
        if length == 0.0 {
            return Ok(None);
        }
        normal.iter_mut().for_each(|n| *n /= length);
        let mut stretch = Self {
            set,
            scaled,
            tools,
            selection: from.after,
            sides: [from.after.clone(), from.after.clone()],
            anchor,
            normal,
            length,
        };
        // At the ends other facets may be met.
        let middle = stretch.at(0.5 * length)?;
        let Some(sides) = set.sides(from.after, &middle) else {
            return Ok(None);
        };
        stretch.sides = sides;
        Ok(Some(stretch))
    }

    /// The point (y, α, β) over the chord at distance s from the first node.
    fn at(&mut self, s: f64) -> Result<Vec<f64>, PiecewiseError> {
        let (anchor, mut t) = (self.anchor.clone(), self.normal.clone());
        let found = match self.corrected(&anchor, s, s, &mut t)? {
            Some(z) => Some(z),
            None => self.walk(s)?,
        };
        let mut z = found.ok_or_else(|| LinearError::Solver {
            what: "no point of the curve was found between two neighbours: follow it in shorter steps (max_step)"
                .to_owned(),
        })?;
        self.scaled.unscale(&mut z);
        Ok(z)
    }

    /// The point at s, reached from the first node along tangents, in the longest steps for which the correction converges.
    fn walk(&mut self, s: f64) -> Result<Option<Vec<f64>>, PiecewiseError> {
        let mut t = self.normal.clone();
        let Some(mut z) = self.corrected(&self.anchor.clone(), 0.0, 0.0, &mut t)? else {
            return Ok(None);
        };
        let (mut reached, mut step) = (0.0, 0.5 * s);
        for _ in 0..HALVINGS {
            let next = (reached + step).min(s);
            let mut turned = t.clone();
            match self.corrected(&z, next - reached, next, &mut turned)? {
                Some(found) if next == s => return Ok(Some(found)),
                Some(found) => (z, t, reached, step) = (found, turned, next, 2.0 * step),
                None => step *= 0.5,
            }
        }
        Ok(None)
    }

    /// The point at s, corrected from its prediction along the tangent t at z; t becomes the tangent there.
    fn corrected(
        &mut self,
        z: &[f64],
        distance: f64,
        s: f64,
        t: &mut [f64],
    ) -> Result<Option<Vec<f64>>, PiecewiseError> {
        let along = distance / dot(t, &self.normal);
        let mut z: Vec<f64> = z.iter().zip(&*t).map(|(z, t)| z + along * t).collect();
        let (anchor, normal) = (&self.anchor, &self.normal);
        let (corrected, _) = (self.tools.corrector).correct_in_plane(
            self.scaled,
            self.selection,
            (anchor, normal, s),
            &mut z,
            t,
        )?;
        Ok(corrected.converged.then_some(z))
    }

    fn determinant(&mut self, side: usize, s: f64) -> Result<Option<(i8, f64)>, PiecewiseError> {
        let x = self.at(s)?;
        self.set
            .determinant(&self.sides[side], &x, &mut self.tools.determinants)
    }

    /// Where one of the determinants vanishes, increasing.
    fn zeros(&mut self) -> Result<Vec<f64>, PiecewiseError> {
        let mut zeros = Vec::new();
        for side in 0..2 {
            let ends = (self.determinant(side, 0.0)?, self.determinant(side, self.length)?);
            let (Some(first), Some(last)) = ends else {
                continue;
            };
            zeros.extend(
                [(first, 0.0), (last, self.length)]
                    .iter()
                    .filter(|e| e.0.0 == 0)
                    .map(|e| e.1),
            );
            if first.0 * last.0 == -1 {
                zeros.push(self.zero_between(side, (0.0, self.length), first.0)?);
            } else if first.0 * last.0 == 1
                && let Some(beyond) = self.other_sign(side, first, last)?
            {
                zeros.push(self.zero_between(side, (0.0, beyond), first.0)?);
                zeros.push(self.zero_between(side, (beyond, self.length), -first.0)?);
            }
        }
        zeros.sort_by(f64::total_cmp);
        Ok(zeros)
    }

    /// The zero of a determinant that has the sign given at the lower end, and not at the upper one.
    fn zero_between(
        &mut self,
        side: usize,
        (mut low, mut high): (f64, f64),
        sign: i8,
    ) -> Result<f64, PiecewiseError> {
        for _ in 0..HALVINGS {
            let s = 0.5 * (low + high);
            match self.determinant(side, s)? {
                Some((found, _)) if found == sign => low = s,
                _ => high = s,
            }
        }
        Ok(0.5 * (low + high))
    }

    /// Where a determinant with one sign at both ends has another one: at its extremum, if it falls from either end towards one.
    fn other_sign(
        &mut self,
        side: usize,
        first: (i8, f64),
        last: (i8, f64),
    ) -> Result<Option<f64>, PiecewiseError> {
        let step = DIFFERENCE * self.length;
        let [after, before] = [step, self.length - step].map(|s| self.determinant(side, s));
        let falls = |near: Option<(i8, f64)>, end: f64| near.is_none_or(|n| n.1 < end - CHECKED);
        if !(falls(after?, first.1) && falls(before?, last.1)) {
            return Ok(None);
        }
        let (mut low, mut high) = (0.0, self.length);
        while high - low > step {
            let s = 0.5 * (low + high);
            let (Some(here), Some(next)) = (
                self.determinant(side, s)?,
                self.determinant(side, s + 0.1 * step)?,
            ) else {
                return Ok(None);
            };
            if let Some(found) = [(here, s), (next, s + 0.1 * step)]
                .iter()
                .find(|v| v.0.0 != first.0)
            {
                return Ok(Some(found.1));
            }
            if next.1 < here.1 { low = s } else { high = s }
        }
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A variable that changes, one that changes by 1e-6 about 5, one that changes by rounding, and one that is 0, whatever its unit.
    #[test]
    fn variables_are_measured_by_how_far_they_move() {
        let selection = Selection::uniform(0, 0);
        for unit in [1e-6, 1.0, 1e9] {
            let points = [0.0, 0.7, 1.0].map(|s| {
                let x = [s, 5.0 + 1e-6 * s, 3.0 + 1e-16 * s, 0.0];
                x.map(|x| x * unit)
            });
            let nodes: Vec<_> = (points.iter().enumerate())
                .map(|(k, x)| Node {
                    x,
                    arclength: k as f64,
                    before: &selection,
                    after: &selection,
                })
                .collect();
            let exact = [1.0, 1e-6, 5.000_001e-8, 5.000_001e-8];
            for (found, exact) in extents(&nodes, &[unit; 4]).iter().zip(exact) {
                assert!(
                    (found / unit - exact).abs() < 1e-7 * exact,
                    "{unit:e}: {found:e} {exact:e}"
                );
            }
        }
    }
}
