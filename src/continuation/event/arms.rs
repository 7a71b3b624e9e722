//! The arms of the solution set at a point: for each active selection the kernel of its Jacobian, kept where it points into the
//! selection's cell.

use super::branch_point::BranchSystem;
use super::units::Units;
use crate::clock::Deadline;
use crate::continuation::engine::{Curve, Solver};
use crate::continuation::{Arm, ContinuationError, ContinuationOptions};
use crate::enumeration::{EnumerationError, directional_selections, local_selections};
use crate::linear::{LinearError, LinearSolver, null_space};
use crate::newton::MoorePenrose;
use crate::piecewise::{
    ActiveSet, PiecewiseError, PiecewiseSmooth, Scaled, Selection, TestLayout, Vanishing,
};
use crate::sparse::{Matrix, distance};
use crate::sparse::{dot, max_abs, norm};
use crate::spread::centred;

/// Two unit tangents closer than this are one arm.
const SAME_ARM: f64 = 1e-7;
/// Singular values below this, relative to the largest, count as zero in the branching equation.
pub(in crate::continuation) const RANK: f64 = 1e-9;
/// How many times as far as its rates tell a test function moves by rounding alone.
pub(in crate::continuation) const UNEXPLAINED: f64 = 1e3;
/// Up to so many active selections all are tried; beyond, the pruned search rules out most of them first.
const PLAIN: u128 = 16;
/// How much smaller than ‖∇θ‖ the largest of two directional derivatives may be.
const SPREAD: f64 = 1e5;
/// Largest number of residuals whose kernels are found by singular values; beyond, next to simple branch points only.
const MAX_BRANCHING: usize = 600;

/// The vanishing test functions at x: those within `distance`·(1 + ‖x‖) of their facet, and those `forced`.
pub(in crate::continuation) fn vanishing_at<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    layout: &TestLayout,
    selection: &Selection,
    x: &[f64],
    theta: &[f64],
    distance: f64,
    forced: &[usize],
) -> Vec<Vanishing> {
    let reach = distance * (1.0 + norm(x));
    let sizes = gradient_sizes(map, selection, x, theta.len());
    let mut list = Vec::new();
    for (index, value) in theta.iter().enumerate() {
        let is_forced = forced.contains(&index);
        if !is_forced && value.abs() > SPREAD * reach * sizes[index] {
            continue;
        }
        let candidate = Vanishing::new(map, layout, selection, index, x);
        if is_forced || value.abs() <= reach * candidate.gradient_norm {
            list.push(candidate);
        }
    }
    list
}

/// Sizes of the gradients of all test functions, by two directional derivatives: gradients are dear. They are hardly ever too small by
/// more than [`SPREAD`].
fn gradient_sizes<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    selection: &Selection,
    x: &[f64],
    tests: usize,
) -> Vec<f64> {
    let mut sizes = vec![0.0f64; tests];
    let (mut rates, mut direction) = (vec![0.0; tests], vec![0.0; x.len()]);
    for second in [false, true] {
        for (j, d) in direction.iter_mut().enumerate() {
            *d = centred(j + 1, second);
        }
        map.tests_of_selection(selection, x, Some(&direction), &mut rates);
        for (size, rate) in sizes.iter_mut().zip(&rates) {
            *size = size.max(rate.abs());
        }
    }
    sizes
}

/// The arms found at a point.
#[derive(Debug, Clone, Default)]
pub(in crate::continuation) struct Arms {
    pub(in crate::continuation) list: Vec<Arm>,
    /// Whether every active selection was examined and its kernel understood.
    pub(in crate::continuation) complete: bool,
    /// The first selection whose kernel was not, if there is one.
    pub(in crate::continuation) undecided: Option<UndecidedKernel>,
}

/// A kernel of ∇H^(σ) of two dimensions or more, in which the first derivatives do not tell the arms.
#[derive(Debug, Clone)]
pub(in crate::continuation) struct UndecidedKernel {
    pub(in crate::continuation) dimension: usize,
    /// The variables that take part in it, those that do most first.
    pub(in crate::continuation) variables: Vec<usize>,
}

impl UndecidedKernel {
    /// That of an orthonormal basis, if it has two vectors or more.
    fn of(basis: &[Vec<f64>]) -> Option<Self> {
        const NAMED: f64 = 1e-6;
        let (first, rest) = basis.split_first().filter(|b| !b.1.is_empty())?;
        let part = |j: usize| rest.iter().fold(first[j].powi(2), |sum, v| sum + v[j].powi(2));
        let parts: Vec<f64> = (0..first.len()).map(part).collect();
        let mut variables: Vec<usize> = (0..parts.len()).filter(|&j| parts[j] > NAMED * NAMED).collect();
        variables.sort_by(|&a, &b| parts[b].total_cmp(&parts[a]));
        Some(Self {
            dimension: basis.len(),
            variables,
        })
    }
}

pub(in crate::continuation) struct ArmSearch<'a, P: ?Sized, L> {
    pub(in crate::continuation) map: &'a P,
    pub(in crate::continuation) corrector: &'a mut MoorePenrose<L>,
    pub(in crate::continuation) options: &'a ContinuationOptions,
    pub(in crate::continuation) x: &'a [f64],
    pub(in crate::continuation) vanishing: &'a [Vanishing],
    /// Number of all test functions of the map.
    pub(in crate::continuation) tests: usize,
    /// A selection known to be singular at (or within rounding of) x, where its kernel is a chance mixture.
    pub(in crate::continuation) singular: Option<Selection>,
    pub(in crate::continuation) deadline: Deadline<'static>,
    /// Whether any selection may be singular at x: at a start nothing is known of them.
    pub(in crate::continuation) unknown: bool,
    /// Whether a kernel was found by a dense decomposition, which takes far longer than a step.
    pub(in crate::continuation) decomposed: bool,
}

impl<P: PiecewiseSmooth + ?Sized, L: LinearSolver> ArmSearch<'_, P, L> {
    /// All arms of the active selections at x.
    pub(in crate::continuation) fn all(&mut self, active: &ActiveSet) -> Result<Arms, PiecewiseError> {
        let mut arms = Arms {
            complete: true,
            ..Arms::default()
        };
        if active.total().is_none_or(|total| total > PLAIN) && !self.map.has_nested_kinks() {
            let limit = self.options.max_nodes;
            let found = directional_selections(&self.map, self.x, active, limit, self.deadline);
            match found {
                Ok(Some(found)) => {
                    arms.complete = found.complete;
                    self.of_selections(found.selections.iter(), &mut arms)?;
                    if !found.complete {
                        self.locally(active, &mut arms)?;
                    }
                    return Ok(arms);
                }
                // Rows that depend on several sites, or too large a table: one by one.
                Ok(None) | Err(EnumerationError::TooLarge { .. }) => {}
                Err(EnumerationError::Map(e)) => return Err(e),
                Err(_) => arms.complete = false,
            }
        }
        for (examined, selection) in active.selections().enumerate() {
            if examined as u64 == self.options.max_selections || self.is_late(examined) {
                arms.complete = false;
                self.locally(active, &mut arms)?;
                break;
            }
            self.of_selection(&selection, None, &mut arms)?;
        }
        Ok(arms)
    }

    /// Where not all selections can be examined: those that a local search finds.
    fn locally(&mut self, active: &ActiveSet, arms: &mut Arms) -> Result<(), PiecewiseError> {
        let starts = self.options.local_starts;
        // A search takes no longer than a few hundred steps of the curve.
        let each = if self.map.num_residuals() > MAX_BRANCHING {
            4
        } else {
            80
        };
        let found = local_selections(&self.map, self.x, active, starts, each * starts, self.deadline);
        match found {
            Ok(selections) => self.of_selections(selections.iter(), arms),
            Err(EnumerationError::Map(e)) => Err(e),
            Err(_) => Ok(()),
        }
    }

    /// The arms of a list of selections, as far as time allows.
    fn of_selections<'s>(
        &mut self,
        selections: impl Iterator<Item = &'s Selection>,
        arms: &mut Arms,
    ) -> Result<(), PiecewiseError> {
        for (examined, selection) in selections.enumerate() {
            if self.is_late(examined) {
                arms.complete = false;
                break;
            }
            self.of_selection(selection, None, arms)?;
        }
        Ok(())
    }

    /// Whether time is over. Regular points are examined in any time.
    fn is_late(&self, examined: usize) -> bool {
        (examined as u128 >= PLAIN || self.decomposed) && self.deadline.is_over()
    }

    /// The arms of one selection, appended to `arms`.
    pub(in crate::continuation) fn of_selection(
        &mut self,
        selection: &Selection,
        hint: Option<&[f64]>,
        arms: &mut Arms,
    ) -> Result<(), PiecewiseError> {
        if self.singular.as_ref() == Some(selection)
            && let Ok(directions) = self.branching_directions(selection)?
        {
            for d in &directions {
                self.both_ways(selection, d, arms);
            }
            return Ok(());
        }
        if self.unknown && self.is_singular(selection)? {
            return self.at_singular_point(selection, arms);
        }
        match self.corrector.linearize(self.map, selection, self.x, hint) {
            Ok(tangent) => {
                let tangent = tangent.to_vec();
                self.both_ways(selection, &tangent, arms);
                Ok(())
            }
            Err(PiecewiseError::Linear(LinearError::Kernel { .. } | LinearError::Singular { .. })) => {
                self.at_singular_point(selection, arms)
            }
            Err(e) => Err(e),
        }
    }

    /// The arms of a selection that is singular at x, if its branching equation tells them.
    fn at_singular_point(&mut self, selection: &Selection, arms: &mut Arms) -> Result<(), PiecewiseError> {
        match self.branching_directions(selection)? {
            Ok(directions) => {
                for d in &directions {
                    self.both_ways(selection, d, arms);
                }
            }
            Err(undecided) => {
                arms.complete = false;
                arms.undecided = arms.undecided.take().or(undecided);
            }
        }
        Ok(())
    }

    /// Whether ∇H^(σ) is singular within rounding of x.
    pub(in crate::continuation) fn is_singular(
        &mut self,
        selection: &Selection,
    ) -> Result<bool, PiecewiseError> {
        let sizes = self.row_sizes(selection)?;
        let least = (self.corrector).least_singular_value(self.map, selection, self.x, &sizes)?;
        Ok(least <= RANK)
    }

    /// The largest entry of each row of ∇H^(σ), or its change over the distance 1 + ‖x‖: at branch points rows may vanish but for rounding.
    fn row_sizes(&mut self, selection: &Selection) -> Result<Vec<f64>, PiecewiseError> {
        const NEAR: f64 = 1e-4;
        let mut jacobian_at = |s: f64| {
            let moved = self.x.iter().enumerate();
            let moved: Vec<f64> = moved.map(|(j, x)| x + s * centred(j + 1, false)).collect();
            self.corrector.assemble(self.map, selection, &moved)?;
            Ok::<_, PiecewiseError>(self.corrector.jacobian().clone())
        };
        let distance = NEAR * (1.0 + norm(self.x));
        let (ahead, behind, here) = (jacobian_at(distance)?, jacobian_at(-distance)?, jacobian_at(0.0)?);
        let mut sizes = vec![0.0f64; self.map.num_residuals()];
        let changes = ahead
            .values()
            .iter()
            .zip(behind.values())
            .map(|(a, b)| (a - b).abs());
        for ((i, _, v), change) in here.triplets().zip(changes) {
            sizes[i] = sizes[i].max(v.abs()).max(change / (2.0 * NEAR));
        }
        let rest = sizes.iter_mut().filter(|size| **size == 0.0);
        rest.for_each(|size| *size = 1.0);
        Ok(sizes)
    }

    fn both_ways(&self, selection: &Selection, tangent: &[f64], arms: &mut Arms) {
        for sign in [1.0, -1.0] {
            let direction: Vec<f64> = tangent.iter().map(|t| sign * t).collect();
            let Some(grazing) = self.enters(selection, &direction) else {
                continue;
            };
            let arm = Arm {
                selection: selection.clone(),
                tangent: direction,
                grazing,
            };
            let same = arms
                .list
                .iter_mut()
                .find(|a| distance(&a.tangent, &arm.tangent) < SAME_ARM);
            match same {
                Some(known) if known.grazing.len() > arm.grazing.len() => *known = arm,
                Some(_) => {}
                None => arms.list.push(arm),
            }
        }
    }

    /// Whether a direction leads into the closed cell of a selection; if so, the sites in whose boundary it stays.
    fn enters(&self, selection: &Selection, direction: &[f64]) -> Option<Vec<usize>> {
        const AHEAD: f64 = 1e-4;
        let (mut own, mut sizes) = (Vec::new(), Vec::new());
        if self.map.has_nested_kinks() {
            own.resize(self.tests, 0.0);
            self.map
                .tests_of_selection(selection, self.x, Some(direction), &mut own);
            sizes = gradient_sizes(self.map, selection, self.x, self.tests);
        }
        let curved = !self.vanishing.is_empty() && !self.map.is_piecewise_affine();
        let (mut step, mut theta, mut rates) = (0.0, Vec::new(), Vec::new());
        if curved {
            step = AHEAD * (1.0 + norm(self.x));
            theta.resize(self.tests, 0.0);
            rates.resize(self.tests, 0.0);
            let ahead: Vec<f64> = self.x.iter().zip(direction).map(|(x, d)| x + step * d).collect();
            self.map.tests_of_selection(selection, &ahead, None, &mut theta);
            self.map
                .tests_of_selection(selection, &ahead, Some(direction), &mut rates);
        }
        let mut grazing = Vec::new();
        let mut units = Units::new(self.map, selection, self.x);
        for v in self.vanishing {
            let (rate, size) = match sizes.get(v.index) {
                Some(&size) => (own[v.index], size),
                None => (v.rate(direction), v.gradient_norm),
            };
            // Nothing but rounding next to its change over the distance 1 + ‖x‖: then the second derivative decides, unless it is rounding, too.
            let flat = curved && size <= RANK * AHEAD.recip() * (rates[v.index] - rate).abs();
            let least = units.least_rate(v, rate, size, direction);
            let cell = self.map.cell(v.site, selection.piece(v.site));
            for facet in cell.iter().filter(|f| f.test() == v.test) {
                let rate = facet.sign() * rate;
                let leaves = if flat {
                    let explained = theta[v.index].abs() <= UNEXPLAINED * step * rates[v.index].abs();
                    explained && facet.sign() * theta[v.index] < 0.0
                } else {
                    rate < -least
                };
                if leaves {
                    return None;
                }
                if (flat || rate <= least) && !grazing.contains(&v.site) {
                    grazing.push(v.site);
                }
            }
        }
        grazing.sort_unstable();
        Some(grazing)
    }

    /// The directions of the curves through a point where ∇H^(σ) has a two-dimensional kernel: with the kernel spanned by
    /// n₁, n₂ and the left kernel by ψ, the roots of Σ ψᵀH''(nᵢ, nⱼ) aᵢ aⱼ = 0 (Keller 1977). `Err` when this does not decide, with the
    /// kernel unless the problem is too large for it.
    fn branching_directions(
        &mut self,
        selection: &Selection,
    ) -> Result<Result<Vec<Vec<f64>>, Option<UndecidedKernel>>, PiecewiseError> {
        let (right, left, scale) = if self.map.num_residuals() > MAX_BRANCHING {
            let away = 0.01 * (1.0 + norm(self.x));
            let from = self.x.iter().enumerate();
            let from: Vec<f64> = from.map(|(j, x)| x + away * centred(j + 1, false)).collect();
            let kernels = BranchSystem::new(self.map, selection, &from, self.x).kernels(self.x)?;
            self.corrector.assemble(self.map, selection, self.x)?;
            match kernels {
                Some(k) => {
                    let scale = max_abs(self.corrector.jacobian().values());
                    (k.right.to_vec(), vec![k.left], scale)
                }
                None => return Ok(Err(None)),
            }
        } else {
            self.decomposed = true;
            let sizes = self.row_sizes(selection)?;
            let mut jac = self.corrector.jacobian().clone();
            let factors: Vec<f64> = jac.triplets().map(|(i, ..)| sizes[i].recip()).collect();
            let values = jac.values_mut().iter_mut();
            values.zip(factors).for_each(|(v, f)| *v *= f);
            let largest = max_abs(jac.values()).max(f64::MIN_POSITIVE);
            let mut kernel = null_space(&jac, (RANK / largest).clamp(RANK, 1.0))?;
            for psi in &mut kernel.left {
                psi.iter_mut().zip(&sizes).for_each(|(w, size)| *w /= size);
            }
            (kernel.right, kernel.left, 1.0)
        };
        let ([n1, n2], [psi]) = (right.as_slice(), left.as_slice()) else {
            return Ok(Err(UndecidedKernel::of(&right)));
        };
        let mut shifted = self.corrector.jacobian().clone();
        let mut second =
            |a: &[f64], b: &[f64]| second_derivative(self.map, selection, self.x, a, b, psi, &mut shifted);
        let (b11, b12, b22) = (second(n1, n1), second(n1, n2), second(n2, n2));
        let size = b11.abs().max(b12.abs()).max(b22.abs());
        let discriminant = b12 * b12 - b11 * b22;
        if size <= 1e-7 * scale.max(f64::MIN_POSITIVE) || discriminant.abs() <= 1e-7 * size * size {
            return Ok(Err(UndecidedKernel::of(&right)));
        }
        if discriminant < 0.0 {
            return Ok(Ok(Vec::new()));
        }
        let root = discriminant.sqrt();
        // The root without cancellation gives the other one; q ≠ 0 as the discriminant is positive.
        let q = -(b12 + b12.signum() * root);
        let pairs = [(q, b11), (b22, q)];
        let combine = |(a, b): (f64, f64)| -> Vec<f64> {
            let v: Vec<f64> = n1.iter().zip(n2).map(|(x, y)| a * x + b * y).collect();
            let length = norm(&v);
            v.into_iter().map(|c| c / length).collect()
        };
        Ok(Ok(pairs.into_iter().map(combine).collect()))
    }
}

impl<'a> Curve<'a> {
    pub(in crate::continuation) fn vanishing_here(&self, forced: &[usize]) -> Vec<Vanishing> {
        let distance = self.options.vanishing_distance;
        let mut list = vanishing_at(
            &self.map,
            &self.layout,
            &self.selection,
            &self.here.x,
            &self.here.theta,
            distance,
            forced,
        );
        let mut units = Units::new(&self.map, &self.selection, &self.here.x);
        list.retain(|v| forced.contains(&v.index) || units.is_near(v, self.here.theta[v.index], distance));
        list
    }

    pub(in crate::continuation) fn active_here(
        &self,
        vanishing: &[Vanishing],
    ) -> Result<ActiveSet, ContinuationError> {
        let indices = vanishing.iter().map(|v| v.index).collect();
        Ok(ActiveSet::from_tests(
            &self.map,
            &self.layout,
            &self.here.theta,
            indices,
        ))
    }

    pub(in crate::continuation) fn all_arms(
        &mut self,
        vanishing: &[Vanishing],
    ) -> Result<Arms, ContinuationError> {
        let active = self.active_here(vanishing)?;
        if let Some(&site) = active.outside().first() {
            return Err(ContinuationError::Outside {
                site: self.map.site_name(site).into_owned(),
            });
        }
        let mut search = self.search(vanishing);
        search.unknown = !search.map.is_piecewise_affine();
        Ok(search.all(&active)?)
    }

    pub(in crate::continuation) fn search<'s>(
        &'s mut self,
        vanishing: &'s [Vanishing],
    ) -> ArmSearch<'s, Scaled<dyn PiecewiseSmooth + 'a>, Solver<'a>> {
        ArmSearch {
            map: &self.map,
            corrector: &mut self.corrector,
            options: &self.options,
            x: &self.here.x,
            vanishing,
            tests: self.layout.total(),
            singular: None,
            unknown: false,
            deadline: self.clock.map_or(Deadline::after(None), |clock| {
                Deadline::of(clock, self.options.max_time)
            }),
            decomposed: false,
        }
    }
}

/// ψᵀ H^(σ)''(x)(a, b) by central differences, of fourth order, of the Jacobian along a.
fn second_derivative<P: PiecewiseSmooth + ?Sized>(
    map: &P,
    selection: &Selection,
    x: &[f64],
    a: &[f64],
    b: &[f64],
    psi: &[f64],
    jac: &mut Matrix,
) -> f64 {
    let h = 1e-4 * (1.0 + norm(x));
    let mut image = vec![0.0; psi.len()];
    let mut at = |s: f64| {
        let y: Vec<f64> = x.iter().zip(a).map(|(x, a)| x + s * a).collect();
        jac.clear();
        map.jacobian(selection, &y, jac);
        jac.mul_vec(b, &mut image);
        dot(psi, &image)
    };
    (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h)
}

#[cfg(test)]
mod tests {
    use super::vanishing_at;
    use crate::continuation::testing::Plane;
    use crate::piecewise::{Selection, TestLayout};

    /// θ = 10 y next to its zero: within the distance, which is one of x, or where it is known to vanish.
    #[test]
    fn facets_within_the_distance_vanish_and_those_that_are_forced() {
        let map = Plane::within(|y, _| [y, 1.0, 0.0], &[|y, _| [10.0 * y, 10.0, 0.0]]);
        let (layout, selection) = (TestLayout::new(&map), Selection::uniform(1, 0));
        let count = |y: f64, distance: f64, forced: &[usize]| {
            vanishing_at(
                &map,
                &layout,
                &selection,
                &[y, 0.0],
                &[10.0 * y],
                distance,
                forced,
            )
            .len()
        };
        for y in [1e-9, 1e-6, 0.5] {
            assert_eq!(
                (count(y, 0.99 * y / (1.0 + y), &[]), count(y, 1.01 * y, &[])),
                (0, 1),
                "{y}"
            );
            assert_eq!((count(y, 1e-15, &[0]), count(-y, 1e-15, &[0])), (1, 1), "{y}");
        }
    }
}
