//! The linear systems of Newton's method in the displacements, and their solver.

use std::cell::{Cell, RefCell};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use super::ReducedBody;
use crate::clock::Until;
use crate::linear::{Aggregation, Gmres, KrylovReport, LinearError};
use crate::parallel;
use crate::run::Status;
use crate::sparse::{NodalBlocks, Symmetric};

/// The operations on a body that Newton's method in the displacements needs: products with its stiffness matrix A and solves with matrices
/// that differ from A in few rows.
///
/// Vectors hold all components of all nodes; components of contact nodes are those along ν, t₁[, t₂]. Where a body is distributed over
/// several processes, slices hold the part of each, indices are local, and all methods are collective: the loop makes the same decisions
/// everywhere, as these depend only on [`sum`](Self::sum) and [`max`](Self::max). [`ReducedContact`](super::ReducedContact) contains an
/// implementation for one process.
pub trait ReducedSystem {
    /// The error type.
    type Error;

    /// Number of components in this process.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// `out` ← A u.
    ///
    /// # Errors
    /// Those of the implementation.
    fn mul(&mut self, u: &[f64], out: &mut [f64]) -> Result<(), Self::Error>;

    /// Sets the matrix of subsequent [solves](Self::solve).
    ///
    /// # Errors
    /// Those of the implementation; a matrix that is singular.
    fn select(&mut self, step: &ReducedStep<'_>) -> Result<(), Self::Error>;

    /// `d` ← an approximate solution for the right-hand side `r` (which is 0 at prescribed components, as d is), with a residual below
    /// `tolerance` ‖r‖₂ if that is reached within the limits of the implementation.
    ///
    /// # Errors
    /// Those of the implementation.
    fn solve(&mut self, r: &[f64], d: &mut [f64], tolerance: f64) -> Result<KrylovReport, Self::Error>;

    /// [`solve`](Self::solve), which calls `observe` before each iteration with the number of those done and, where that breaks, ends with
    /// the iterate reached. By default it is not called, so that a search can only be stopped between Newton steps.
    ///
    /// # Errors
    /// Those of the implementation.
    fn solve_observed(
        &mut self,
        r: &[f64],
        d: &mut [f64],
        tolerance: f64,
        _observe: &mut KrylovObserver<'_>,
    ) -> Result<KrylovReport, Self::Error> {
        self.solve(r, d, tolerance)
    }

    /// Sums over all processes, entry by entry.
    ///
    /// # Errors
    /// Those of the implementation.
    fn sum(&self, values: &mut [f64]) -> Result<(), Self::Error>;

    /// Maxima over all processes, entry by entry.
    ///
    /// # Errors
    /// Those of the implementation.
    fn max(&self, values: &mut [f64]) -> Result<(), Self::Error>;
}

/// Called with the number of iterations of a linear solve, which it may end. It may be called from a worker thread.
pub type KrylovObserver<'a> = dyn FnMut(usize) -> ControlFlow<()> + Send + 'a;

/// A matrix in terms of the stiffness matrix A: rows and columns of `constrained` components become those of the identity, the rest is
/// A + `added` + `beside` + `combined`.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct ReducedStep<'a> {
    /// Components whose values are prescribed.
    pub constrained: &'a [usize],
    /// (row, column, value) in diagonal blocks of contact nodes: symmetric, positive semidefinite, to be preconditioned with A.
    pub added: &'a [(usize, usize, f64)],
    /// (row, column, value), not included in the preconditioner.
    pub beside: &'a [(usize, usize, f64)],
    /// (i, j, c): row i += c · row j of A, not included in the preconditioner; i and j belong to one node, and j is constrained.
    pub combined: &'a [(usize, usize, f64)],
}

/// Factor of the residual per iteration above which the cycle is given more smoothing.
const SLOW: f64 = 0.54;
/// Number of iterations of a solve from which its reduction factor is meaningful.
const TELLING: usize = 6;

/// One process: GMRES, preconditioned by smoothed aggregation.
#[derive(Debug)]
pub(super) struct SerialSystem {
    body: Arc<ReducedBody>,
    hierarchy: Hierarchy,
    gmres: Gmres,
    max_iterations: usize,
    constrained: Vec<usize>,
    beside: Vec<(usize, usize, f64)>,
    combined: Vec<(usize, usize, f64)>,
}

#[derive(Debug)]
enum Hierarchy {
    Plane(Box<Aggregation<2, 3>>),
    Space(Box<Aggregation<3, 6>>),
}

impl SerialSystem {
    pub(super) fn new(
        body: Arc<ReducedBody>,
        directions: usize,
        max_iterations: usize,
        until: Until,
    ) -> Result<Self, LinearError> {
        let nodes = (body.fixed(), body.classes());
        let hierarchy = match &body.stiffness.blocks {
            NodalBlocks::Plane(a) => {
                let modes = body.rigid_modes([0, 1, 5]);
                Hierarchy::Plane(Box::new(Aggregation::new(a, modes, nodes, until)?))
            }
            NodalBlocks::Space(a) => {
                let modes = body.rigid_modes([0, 1, 2, 3, 4, 5]);
                Hierarchy::Space(Box::new(Aggregation::new(a, modes, nodes, until)?))
            }
        };
        Ok(Self {
            body,
            hierarchy,
            gmres: Gmres::flexible(directions),
            max_iterations,
            constrained: Vec::new(),
            beside: Vec::new(),
            combined: Vec::new(),
        })
    }

    /// Sets the limits of subsequent solves.
    pub(super) fn limit(&mut self, directions: usize, max_iterations: usize) {
        self.gmres = Gmres::flexible(directions);
        self.max_iterations = max_iterations;
    }

    /// Sets the time limit of subsequent changes of the hierarchy and cycles, which end early when it is reached.
    pub(super) fn set_time_limit(&mut self, limit: Option<Duration>) {
        let until = Until::after(limit);
        match &mut self.hierarchy {
            Hierarchy::Plane(h) => h.set_until(until),
            Hierarchy::Space(h) => h.set_until(until),
        }
    }

    /// Nodes and blocks of each level.
    pub(super) fn levels(&self) -> Vec<(usize, usize)> {
        match (&self.hierarchy, &self.body.stiffness.blocks) {
            (Hierarchy::Plane(h), NodalBlocks::Plane(a)) => h.sizes(a),
            (Hierarchy::Space(h), NodalBlocks::Space(a)) => h.sizes(a),
            _ => Vec::new(),
        }
    }
}

impl SerialSystem {
    /// The body.
    pub(super) fn body(&self) -> &ReducedBody {
        &self.body
    }

    /// As [`solve_observed`](ReducedSystem::solve_observed) for the transposed system, with the same preconditioner.
    pub(super) fn solve_transposed(
        &mut self,
        r: &[f64],
        d: &mut [f64],
        tolerance: f64,
    ) -> Result<KrylovReport, LinearError> {
        d.copy_from_slice(r);
        let rows = Rows {
            constrained: &self.constrained,
            beside: &self.beside,
            combined: &self.combined,
        };
        let (hierarchy, gmres) = (&mut self.hierarchy, &mut self.gmres);
        let limits = (tolerance, self.max_iterations);
        let blocks = &self.body.stiffness.blocks;
        parallel::within(|| match (hierarchy, blocks) {
            (Hierarchy::Plane(h), NodalBlocks::Plane(a)) => rows.solve_transposed(a, h, gmres, d, limits),
            (Hierarchy::Space(h), NodalBlocks::Space(a)) => rows.solve_transposed(a, h, gmres, d, limits),
            _ => Err(LinearError::NotAnalyzed),
        })
    }
}

impl ReducedSystem for SerialSystem {
    type Error = LinearError;

    fn len(&self) -> usize {
        self.body.len()
    }

    fn mul(&mut self, u: &[f64], out: &mut [f64]) -> Result<(), LinearError> {
        self.body.stiffness.mul(u, out);
        Ok(())
    }

    fn select(&mut self, step: &ReducedStep<'_>) -> Result<(), LinearError> {
        self.constrained.clear();
        self.constrained.extend_from_slice(step.constrained);
        self.beside.clear();
        self.beside.extend_from_slice(step.beside);
        self.combined.clear();
        self.combined.extend_from_slice(step.combined);
        let changed = match (&mut self.hierarchy, &self.body.stiffness.blocks) {
            (Hierarchy::Plane(h), NodalBlocks::Plane(a)) => h.constrain(a, step.constrained, step.added),
            (Hierarchy::Space(h), NodalBlocks::Space(a)) => h.constrain(a, step.constrained, step.added),
            _ => Err(LinearError::NotAnalyzed),
        };
        match changed {
            // The next solve then ends before its first iteration.
            Err(LinearError::TimeLimit) => Ok(()),
            changed => changed,
        }
    }

    fn solve(&mut self, r: &[f64], d: &mut [f64], tolerance: f64) -> Result<KrylovReport, LinearError> {
        self.solve_observed(r, d, tolerance, &mut |_| ControlFlow::Continue(()))
    }

    fn solve_observed(
        &mut self,
        r: &[f64],
        d: &mut [f64],
        tolerance: f64,
        observe: &mut KrylovObserver<'_>,
    ) -> Result<KrylovReport, LinearError> {
        d.copy_from_slice(r);
        let rows = Rows {
            constrained: &self.constrained,
            beside: &self.beside,
            combined: &self.combined,
        };
        let (hierarchy, gmres) = (&mut self.hierarchy, &mut self.gmres);
        let limits = (tolerance, self.max_iterations);
        let blocks = &self.body.stiffness.blocks;
        let outcome = parallel::within(|| match (hierarchy, blocks) {
            (Hierarchy::Plane(h), NodalBlocks::Plane(a)) => rows.solve(a, h, gmres, d, limits, observe),
            (Hierarchy::Space(h), NodalBlocks::Space(a)) => rows.solve(a, h, gmres, d, limits, observe),
            _ => Err(LinearError::NotAnalyzed),
        })?;
        let rate = outcome.residual.powf(1.0 / outcome.iterations.max(1) as f64);
        if outcome.iterations >= TELLING && rate > SLOW {
            match &mut self.hierarchy {
                Hierarchy::Plane(h) => h.smooth_more(),
                Hierarchy::Space(h) => h.smooth_more(),
            }
        }
        Ok(outcome)
    }

    fn sum(&self, _values: &mut [f64]) -> Result<(), LinearError> {
        Ok(())
    }

    fn max(&self, _values: &mut [f64]) -> Result<(), LinearError> {
        Ok(())
    }
}

/// The part of the current matrix that is neither in A nor in the hierarchy.
struct Rows<'a> {
    constrained: &'a [usize],
    beside: &'a [(usize, usize, f64)],
    combined: &'a [(usize, usize, f64)],
}

impl Rows<'_> {
    fn solve<const F: usize, const K: usize>(
        &self,
        a: &Symmetric<F>,
        hierarchy: &mut Aggregation<F, K>,
        gmres: &mut Gmres,
        d: &mut [f64],
        (tolerance, limit): (f64, usize),
        observe: &mut KrylovObserver<'_>,
    ) -> Result<KrylovReport, LinearError> {
        let hierarchy = RefCell::new(hierarchy);
        let (mut iterations, mut stopped) = (0, false);
        // Between restarts GMRES multiplies the result of the last cycle, for which the cycle has computed the product with A.
        let known = Cell::new(false);
        let solved = gmres.solve(
            |x, y| {
                match known.replace(false) {
                    true => hierarchy.borrow().add_image(a, x, y),
                    false => hierarchy.borrow().add_product(a, x, y),
                }
                for &(i, j, v) in self.beside {
                    y[i] += v * x[j];
                }
                // Rows j are those of prescribed components, to which nothing else is added.
                for &(i, j, c) in self.combined {
                    y[i] += c * y[j];
                }
                self.constrained.iter().for_each(|&k| y[k] = 0.0);
            },
            |z| {
                stopped = stopped || observe(iterations).is_break();
                iterations += 1;
                if stopped {
                    // Any error ends GMRES, which keeps the iterate reached.
                    return Err(LinearError::TimeLimit);
                }
                let done = hierarchy.borrow_mut().apply(a, z);
                known.set(true);
                if done == Err(LinearError::TimeLimit) {
                    // The time limit is reported to the caller.
                    let _ = observe(iterations);
                    stopped = true;
                }
                done
            },
            d,
            tolerance,
            limit,
        );
        if stopped {
            return Ok(KrylovReport::new(Status::Interrupted, iterations - 1, 1.0));
        }
        solved
    }

    /// The transpose: rows that are combined in the system become components that are moved together.
    fn solve_transposed<const F: usize, const K: usize>(
        &self,
        a: &Symmetric<F>,
        hierarchy: &mut Aggregation<F, K>,
        gmres: &mut Gmres,
        d: &mut [f64],
        (tolerance, limit): (f64, usize),
    ) -> Result<KrylovReport, LinearError> {
        let hierarchy = RefCell::new(hierarchy);
        // As in `solve`: the image of what the last cycle gave is known.
        let known = Cell::new(false);
        gmres.solve(
            |x, y| {
                match known.replace(false) {
                    true => hierarchy.borrow().add_image(a, x, y),
                    false => hierarchy.borrow().add_product(a, x, y),
                }
                for &(i, j, c) in self.combined {
                    let (node, d, moved) = (j / F, j % F, c * x[i]);
                    a.each(node, |other, block| {
                        let own = y[F * other..F * (other + 1)].iter_mut();
                        own.zip(&block[d]).for_each(|(y, v)| *y += v * moved);
                    });
                }
                for &(i, j, v) in self.beside {
                    y[j] += v * x[i];
                }
                self.constrained.iter().for_each(|&k| y[k] = 0.0);
            },
            |z| {
                let done = hierarchy.borrow_mut().apply(a, z);
                known.set(true);
                done
            },
            d,
            tolerance,
            limit,
        )
    }
}
