//! Multigrid by smoothed aggregation for elasticity matrices, stored as blocks for pairs of nodes, as a preconditioner.
//!
//! Nodes are gathered into aggregates; on each the rigid motions are interpolated, smoothed by one damped Jacobi step (P. Vaněk, J. Mandel,
//! M. Brezina, Computing 56 (1996); P. Vaněk, M. Brezina, J. Mandel, Numer. Math. 88 (2001)). Components may be fixed at zero and diagonal
//! blocks added to: the aggregates stay then, and those parts of the prolongation and of the coarse matrices that depend on the changed
//! nodes are recomputed, unless the change is slight. The finest level is exact in any case.

mod aggregates;
mod dense;
mod smoother;
mod transfer;

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use self::aggregates::aggregates;
use self::smoother::{Added, Direct, Smoother};
use self::transfer::{Constraints, Modes, Transfer};
use super::LinearError;
use crate::clock::Until;
use crate::parallel;
use crate::sparse::{Blocks, Entry, ROWS, Symmetric, add_product, wide};
use crate::spread::Random;

/// Coarsening stops at this many nodes.
const COARSEST: usize = 120;
/// Levels stop when coarsening gains less than this factor.
const MIN_COARSENING: f64 = 0.6;
/// Couplings below this part of the diagonal blocks are weak, on the finest level; on each further one half as much.
const STRONG: f64 = 0.05;
/// Further sweeps of each smoothing of a coarse level, which cost little there: with them iterations are as few as with backward sweeps on the
/// finest level, each of which reads the matrix twice.
const FURTHER: usize = 1;
/// Most sweeps of a smoothing.
const MOST_SWEEPS: usize = 4;
/// Largest eigenvalues of D⁻¹A beyond which smoothings begin with two and three sweeps: those of hexahedra are 2.8 for ν = 0.28, 3.8 for
/// 0.45 and 4.4 for 0.49, where one sweep takes 45 iterations for 1e-8, two 32 and three 26.
const STIFF: [f64; 2] = [3.7, 4.2];
/// Steps of the power method for the largest eigenvalue of D⁻¹A, and what is added to its result, which is a lower bound.
const POWER_STEPS: usize = 8;
const MARGIN: f64 = 1.05;
/// Damping of the Jacobi step of prolongators against the largest eigenvalue.
const DAMPING: f64 = 4.0 / 3.0;
/// Changes of additions to a diagonal block of A, relative to that block, that are left out of the coarse matrices: with 0.03 some bodies
/// take more iterations.
const SLIGHT: f64 = 0.01;

/// Constraints of the finest level.
#[derive(Debug, Clone)]
struct Fine<const F: usize> {
    /// Components that never were free, a bit each.
    fixed: Vec<u8>,
    /// These and the components fixed at present.
    mask: Vec<u8>,
    added: Added<F>,
    /// The additions that the coarse levels include: slight changes are left out.
    known: Added<F>,
    /// Nodes with fixed components or additions, beside those that never were free.
    constrained: Vec<u32>,
    smoother: Smoother<F>,
}

impl<const F: usize> Constraints<F> for Fine<F> {
    fn constrained(&self, node: usize) -> u8 {
        self.mask[node]
    }

    fn added(&self, node: usize) -> Option<&[[f64; F]; F]> {
        self.known.get(&(node as u32))
    }

    fn inverse(&self, node: usize) -> [[f64; F]; F] {
        self.smoother.inverse[node]
    }
}

impl<const K: usize> Constraints<K> for Smoother<K, f32> {
    fn constrained(&self, _node: usize) -> u8 {
        0
    }

    fn added(&self, _node: usize) -> Option<&[[f64; K]; K]> {
        None
    }

    fn inverse(&self, node: usize) -> [[f64; K]; K] {
        wide(&self.inverse[node])
    }
}

/// A V-cycle for symmetric positive definite matrices of F × F blocks with K near-kernel vectors: F = 2, K = 3 in the plane, F = 3,
/// K = 6 in space.
///
/// Coarse levels are in single precision, in units of the matrix, but for the coarsest matrix. The finest level, whose products Krylov
/// methods use, is in double precision.
#[derive(Debug, Clone)]
pub(crate) struct Aggregation<const F: usize, const K: usize> {
    modes: Modes<F, K>,
    fine: Fine<F>,
    first: Option<Transfer<F, K>>,
    transfers: Vec<Transfer<K, K>>,
    /// Of the coarse levels.
    smoothers: Vec<Smoother<K, f32>>,
    /// Of these but the coarsest.
    matrices: Vec<Symmetric<K, f32>>,
    coarsest: Symmetric<K>,
    direct: Direct,
    /// Sweeps of each smoothing.
    sweeps: usize,
    until: Until,
    /// Nodes whose change was interrupted by the time limit.
    pending: Vec<u32>,
}

impl<const F: usize, const K: usize> Aggregation<F, K> {
    /// The hierarchy of a positive definite matrix of which some components, a bit each, are not free and have zero rows and columns.
    /// `modes` are the near-kernel vectors. Nodes of different classes (all are of one where the list is empty) are not gathered together:
    /// the near-kernel of the whole need not be that of each.
    ///
    /// # Errors
    /// [`LinearError::NotPositiveDefinite`]; [`LinearError::TimeLimit`] once time is over.
    pub(crate) fn new(
        a: &Symmetric<F>,
        modes: Vec<[[f64; K]; F]>,
        (fixed, mut classes): (Vec<u8>, Vec<usize>),
        until: Until,
    ) -> Result<Self, LinearError> {
        let masked = |(mut m, constrained): ([[f64; K]; F], &u8)| {
            dense::mask_rows(&mut m, *constrained);
            m.map(|row| row.map(|v| v as f32))
        };
        let modes: Modes<F, K> = modes.into_iter().zip(&fixed).map(masked).collect();
        let fine = Fine {
            mask: fixed.clone(),
            added: BTreeMap::new(),
            known: BTreeMap::new(),
            constrained: Vec::new(),
            smoother: Smoother::new(a, |i| fixed[i]),
            fixed,
        };
        let dead =
            |i: usize| (0..F).any(|k| fine.mask[i] >> k & 1 == 0 && fine.smoother.inverse[i][k][k] <= 0.0);
        if (0..a.nrows()).any(dead) {
            return Err(LinearError::NotPositiveDefinite);
        }
        let unit = unit_of(a, &fine);
        let (mut first, mut sweeps) = (None, 1);
        let (mut smoothers, mut matrices) = (Vec::<Smoother<K, f32>>::new(), Vec::new());
        let mut transfers = Vec::new();
        let mut coarsest = Symmetric::of(Blocks::new(0));
        if let Some((transfer, mut coarse_modes)) =
            coarsen((a, &modes), (STRONG, unit), &fine, &mut classes, until)?
        {
            coarsest = transfer.galerkin(a, &fine);
            in_time(until)?;
            sweeps += STIFF
                .iter()
                .filter(|limit| DAMPING / transfer.omega > **limit)
                .count();
            first = Some(transfer);
            let mut strong = STRONG;
            loop {
                strong *= 0.5;
                let smoother = Smoother::new(&coarsest, |_| 0);
                let made = coarsen(
                    (&coarsest, &coarse_modes),
                    (strong, 1.0),
                    &smoother,
                    &mut classes,
                    until,
                )?;
                smoothers.push(smoother);
                let (Some((transfer, next)), Some(smoother)) = (made, smoothers.last()) else {
                    break;
                };
                // As it is when it changes.
                let rounded = coarsest.rounded();
                coarsest = transfer.galerkin(&rounded, smoother);
                in_time(until)?;
                coarse_modes = next;
                matrices.push(rounded);
                transfers.push(transfer);
            }
        }
        let mut direct;
        match smoothers.last() {
            Some(smoother) => {
                direct = Direct::new(&coarsest)?;
                direct.factor(&coarsest, smoother)?;
            }
            None => {
                direct = Direct::new(a)?;
                direct.factor(a, &fine)?;
            }
        }
        Ok(Self {
            modes,
            fine,
            first,
            transfers,
            smoothers,
            matrices,
            coarsest,
            direct,
            sweeps,
            until,
            pending: Vec::new(),
        })
    }

    /// Sets when later changes and cycles end, with [`LinearError::TimeLimit`]; checked in each strip of rows.
    pub(crate) fn set_until(&mut self, until: Until) {
        self.until = until;
        self.fine.smoother.until = until;
        if let Some(first) = &mut self.first {
            first.until = until;
        }
        self.smoothers.iter_mut().for_each(|s| s.until = until);
        self.transfers.iter_mut().for_each(|t| t.until = until);
    }

    /// Nodes and stored blocks of each level.
    pub(crate) fn sizes(&self, a: &Symmetric<F>) -> Vec<(usize, usize)> {
        let coarse = self.matrices.iter().map(|a| (a.nrows(), a.len()));
        let last = self
            .first
            .iter()
            .map(|_| (self.coarsest.nrows(), self.coarsest.len()));
        std::iter::once((a.nrows(), a.len()))
            .chain(coarse)
            .chain(last)
            .collect()
    }

    /// Fixes components (unknown by unknown) and adds to diagonal blocks (row, column, value; in the same node), in place of those fixed
    /// and added before. Additions must be symmetric and positive semidefinite.
    pub(crate) fn constrain(
        &mut self,
        a: &Symmetric<F>,
        constrained: &[usize],
        added: &[(usize, usize, f64)],
    ) -> Result<(), LinearError> {
        let mut now: BTreeMap<u32, u8> = BTreeMap::new();
        for &k in constrained {
            *now.entry((k / F) as u32).or_default() |= 1 << (k % F);
        }
        let mut sums: BTreeMap<u32, [[f64; F]; F]> = BTreeMap::new();
        for &(i, j, v) in added {
            sums.entry((i / F) as u32).or_insert([[0.0; F]; F])[i % F][j % F] += v;
        }
        // With a direct solve alone nothing else corrects the difference.
        let slight = if self.first.is_some() { SLIGHT } else { 0.0 };
        let fine = &mut self.fine;
        let mut changed = std::mem::take(&mut self.pending);
        let constrained = collect(now.keys().chain(sums.keys()).copied());
        for i in collect(constrained.iter().chain(&fine.constrained).copied()) {
            let node = i as usize;
            let wanted = fine.fixed[node] | now.get(&i).copied().unwrap_or(0);
            let (before, after) = (fine.added.get(&i), sums.get(&i));
            let other = wanted != fine.mask[node];
            if other || before != after {
                fine.mask[node] = wanted;
                fine.smoother.invert(a, node, wanted, after);
            }
            if other || !is_near(a, node, fine.known.get(&i), after, slight) {
                match after {
                    Some(after) => fine.known.insert(i, *after),
                    None => fine.known.remove(&i),
                };
                changed.push(i);
            }
        }
        (fine.added, fine.constrained) = (sums, constrained);
        let changed = collect(changed.into_iter());
        if changed.is_empty() {
            return Ok(());
        }
        let done = self.propagate(a, &changed);
        if done == Err(LinearError::TimeLimit) {
            self.pending = changed;
        }
        done
    }

    /// Updates all levels for the nodes of the finest one that have changed.
    fn propagate(&mut self, a: &Symmetric<F>, changed: &[u32]) -> Result<(), LinearError> {
        let Some(first) = &mut self.first else {
            return self.direct.factor_nearly(a, &self.fine);
        };
        let smoothed = with_neighbours(a, changed);
        first.resmooth(a, &self.modes, &self.fine, &smoothed);
        in_time(self.until)?;
        let mut affected = columns_of(&first.p, &with_neighbours(a, &smoothed));
        match self.matrices.first_mut() {
            Some(coarse) => first.resum(a, &self.fine, &affected, coarse),
            None => first.resum(a, &self.fine, &affected, &mut self.coarsest),
        }
        in_time(self.until)?;
        let inner = self.matrices.len();
        for (k, smoother) in self.smoothers.iter_mut().enumerate() {
            let (above, below) = self.matrices.split_at_mut(inner.min(k + 1));
            let Some(a) = above.get(k) else {
                let invert = |i: &u32| smoother.invert(&self.coarsest, *i as usize, 0, None);
                affected.iter().for_each(invert);
                break;
            };
            // Columns of rows not affected have changed, their diagonal blocks have not.
            affected
                .iter()
                .for_each(|&i| smoother.invert(a, i as usize, 0, None));
            let transfer = &self.transfers[k];
            affected = columns_of(&transfer.p, &with_neighbours(a, &affected));
            match below.first_mut() {
                Some(coarse) => transfer.resum(a, smoother, &affected, coarse),
                None => transfer.resum(a, smoother, &affected, &mut self.coarsest),
            }
            in_time(self.until)?;
        }
        match self.smoothers.last() {
            Some(smoother) => self.direct.factor_nearly(&self.coarsest, smoother),
            None => Ok(()),
        }
    }

    /// Overwrites b by the cycle's approximation to A⁻¹ b, zero in fixed components; [`LinearError::TimeLimit`] once time is over.
    pub(crate) fn apply(&mut self, a: &Symmetric<F>, b: &mut [f64]) -> Result<(), LinearError> {
        let fine = &mut self.fine.smoother;
        let Some(first) = &mut self.first else {
            for (node, constrained) in self.fine.mask.iter().enumerate() {
                (0..F)
                    .filter(|k| constrained >> k & 1 == 1)
                    .for_each(|k| b[F * node + k] = 0.0);
            }
            fine.b.copy_from_slice(b);
            return self.direct.solve(&fine.b, b);
        };
        in_time(self.until)?;
        fine.b.copy_from_slice(b);
        fine.smooth_before(a, self.sweeps);
        first.restrict(&fine.r, &mut self.smoothers[0].b);
        let levels = self.matrices.iter().zip(&mut self.transfers).enumerate();
        for (k, (a, transfer)) in levels {
            let (above, below) = self.smoothers.split_at_mut(k + 1);
            above[k].smooth_before(a, self.sweeps + FURTHER);
            transfer.restrict(&above[k].r, &mut below[0].b);
        }
        if let Some(bottom) = self.smoothers.last_mut() {
            self.direct.solve(&bottom.b, &mut bottom.x)?;
        }
        for (k, (a, transfer)) in self.matrices.iter().zip(&self.transfers).enumerate().rev() {
            let (above, below) = self.smoothers.split_at_mut(k + 1);
            transfer.prolong(&below[0].x, &mut above[k].x);
            above[k].smooth_after(a, &Added::new(), self.sweeps + FURTHER, true);
        }
        first.prolong(&self.smoothers[0].x, &mut fine.x);
        // GMRES needs no symmetric cycle; one sweep forward reads the matrix once, backward twice.
        fine.smooth_after(a, &self.fine.added, self.sweeps, self.sweeps > 1);
        in_time(self.until)?;
        b.copy_from_slice(&fine.x);
        Ok(())
    }

    /// One more sweep in each smoothing, up to a few: for matrices on which the cycle converges slowly.
    pub(crate) fn smooth_more(&mut self) {
        self.sweeps = (self.sweeps).min(MOST_SWEEPS);
    }

    /// y += A x for the x of the last [`apply`](Self::apply), additions to A included, without a product where the cycle has left its
    /// residual.
    pub(crate) fn add_image(&self, a: &Symmetric<F>, x: &[f64], y: &mut [f64]) {
        if self.first.is_none() {
            return self.add_product(a, x, y);
        }
        let smoother = &self.fine.smoother;
        parallel::parts(y, parallel::GRAIN, &|first, y| {
            let known = smoother.b[first..].iter().zip(&smoother.r[first..]);
            y.iter_mut().zip(known).for_each(|(y, (b, r))| *y += b - r);
        });
    }

    /// y += A x, additions to A included.
    pub(crate) fn add_product(&self, a: &Symmetric<F>, x: &[f64], y: &mut [f64]) {
        let nodes = x.as_chunks::<F>().0;
        parallel::parts(y.as_chunks_mut::<F>().0, ROWS, &|first, y| {
            for (i, y) in (first..).zip(y) {
                y.iter_mut().zip(a.row_product(i, x)).for_each(|(y, s)| *y += s);
                if let Some(added) = self.fine.added.get(&(i as u32)) {
                    add_product(added, &nodes[i], y);
                }
            }
        });
    }
}

/// Ends the work where parts of it ended early for lack of time.
fn in_time(until: Until) -> Result<(), LinearError> {
    if until.is_over() {
        return Err(LinearError::TimeLimit);
    }
    Ok(())
}

/// Whether two additions to a diagonal block of A differ by little, relative to that block; an addition that is removed always counts.
fn is_near<const F: usize>(
    a: &Symmetric<F>,
    node: usize,
    known: Option<&[[f64; F]; F]>,
    now: Option<&[[f64; F]; F]>,
    slight: f64,
) -> bool {
    if known.is_some() && now.is_none() {
        return false;
    }
    let zero = [[0.0; F]; F];
    let (known, now) = (known.unwrap_or(&zero), now.unwrap_or(&zero));
    let own = a.diagonal(node);
    let (mut change, mut size) = (0.0f64, 0.0f64);
    for k in 0..F {
        for l in 0..F {
            change = change.max((now[k][l] - known[k][l]).abs());
            size = size.max(own[k][l].abs());
        }
    }
    change <= slight * size
}

/// A power of two with which the largest diagonal entry is at most one, and more than a half.
fn unit_of<const F: usize>(a: &Symmetric<F>, fine: &Fine<F>) -> f64 {
    let largest = (0..a.nrows()).fold(0.0f64, |most, i| {
        let free = (0..F).filter(|k| fine.mask[i] >> k & 1 == 0);
        free.fold(most, |most, k| most.max(a.diagonal(i)[k][k]))
    });
    // The exponent alone, whose inverse is finite for all but the largest numbers.
    let power = f64::from_bits(largest.to_bits() & !((1 << 52) - 1));
    if power > 0.0 { 0.5 / power } else { 1.0 }
}

/// Aggregates, if they are few enough, with the prolongation and the near-kernel of the coarse level.
fn coarsen<const R: usize, const K: usize>(
    (a, modes): (&Symmetric<R>, &Modes<R, K>),
    (strong, unit): (f64, f64),
    constraints: &impl Constraints<R>,
    classes: &mut Vec<usize>,
    until: Until,
) -> Result<Option<(Transfer<R, K>, Modes<K, K>)>, LinearError> {
    let n = a.nrows();
    if n <= COARSEST {
        return Ok(None);
    }
    in_time(until)?;
    let found = aggregates(a, strong, classes);
    if found.count as f64 * K as f64 > MIN_COARSENING * n as f64 * R as f64 {
        return Ok(None);
    }
    if !classes.is_empty() {
        let mut coarse = vec![0; found.count];
        (found.of.iter().zip(&*classes)).for_each(|(k, class)| coarse[*k as usize] = *class);
        *classes = coarse;
    }
    let omega = DAMPING / largest_eigenvalue(a, constraints, until)?;
    let made = Transfer::new((a, modes), found, (omega, unit), constraints, until);
    in_time(until)?;
    Ok(Some(made))
}

/// The largest eigenvalue of D⁻¹A by the power method, from a start without a pattern.
fn largest_eigenvalue<const B: usize>(
    a: &Symmetric<B>,
    constraints: &impl Constraints<B>,
    until: Until,
) -> Result<f64, LinearError> {
    let mut random = Random::new(1);
    let mut v: Vec<f64> = (0..B * a.nrows()).map(|_| random.symmetric()).collect();
    let mut w = vec![0.0; v.len()];
    let mut value: f64 = 1.0;
    for _ in 0..POWER_STEPS {
        in_time(until)?;
        let size = parallel::product(&v, &v).sqrt();
        a.mul(&v, &mut w);
        parallel::parts(w.as_chunks_mut::<B>().0, ROWS, &|first, w| {
            for (i, w) in (first..).zip(w) {
                let image = std::mem::replace(w, [0.0; B]);
                add_product(&constraints.inverse(i), &image, w);
            }
        });
        value = parallel::product(&w, &w).sqrt() / size;
        std::mem::swap(&mut v, &mut w);
        v.iter_mut().for_each(|v| *v /= value * size);
    }
    Ok(if value.is_finite() && value > 0.0 {
        MARGIN * value
    } else {
        2.0
    })
}

/// The nodes and all they are coupled to.
fn with_neighbours<const B: usize, S: Entry>(a: &Symmetric<B, S>, nodes: &[u32]) -> Vec<u32> {
    let row = |&i: &u32| a.places(i as usize).map(|(j, _)| j as u32);
    collect(nodes.iter().flat_map(row))
}

/// Columns with a block in one of the rows.
fn columns_of<const R: usize, const C: usize>(p: &Blocks<R, C, f32>, rows: &[u32]) -> Vec<u32> {
    collect(rows.iter().flat_map(|&i| p.row(i as usize).0.iter().copied()))
}

fn collect(numbers: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut all: Vec<u32> = numbers.collect();
    all.sort_unstable();
    all.dedup();
    all
}
