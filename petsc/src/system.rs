use semismooth::contact::{ReducedStep, ReducedSystem};
use semismooth::linear::KrylovReport;
use semismooth::run::Status;
use thiserror::Error;

use crate::DistributedBody;
use crate::ffi::Int;
use crate::handles::{Matrix, Solver, Vector};
use crate::stiffness::Stiffness;
use crate::world::{Error, PetscError, World};

/// Errors of a linear solver.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SolverError {
    /// A call of PETSc failed.
    #[error(transparent)]
    Petsc(#[from] PetscError),
    /// There is no approximate solution: the preconditioner broke down, or values are not finite.
    #[error("PETSc's linear solver stopped after {iterations} iterations for its reason {reason}")]
    Diverged {
        /// KSPConvergedReason.
        reason: i32,
        /// Number of iterations.
        iterations: usize,
    },
}

/// The solver chosen by options; by default GMRES with algebraic multigrid.
pub(crate) fn krylov(world: &World, directions: usize) -> Result<Solver<'_>, PetscError> {
    let directions = directions.to_string();
    let defaults = [
        // The multigrid cycle is a fixed linear operator: flexible GMRES is not needed. With right preconditioning, residuals are those of
        // the system.
        ("-ksp_type", "gmres"),
        ("-ksp_pc_side", "right"),
        ("-ksp_gmres_restart", directions.as_str()),
        ("-pc_type", "gamg"),
        // The aggregates are reused when nodes change state; matrices of coarse levels are recomputed.
        ("-pc_gamg_reuse_interpolation", "true"),
    ];
    Solver::new(world, &defaults)
}

/// The linear systems of Newton's method, by PETSc.
#[derive(Debug)]
pub(crate) struct System<'w> {
    pub(crate) body: DistributedBody<'w>,
    /// The operator: the matrix that is preconditioned (A with constrained rows and the symmetric part of the laws), plus the other rows.
    sum: Option<Matrix<'w>>,
    solver: Solver<'w>,
    coarse: Option<Coarse<'w>>,
    x: Vector<'w>,
    y: Vector<'w>,
    max_iterations: usize,
    constrained: Vec<usize>,
}

impl<'w> System<'w> {
    pub(crate) fn new(
        body: DistributedBody<'w>,
        directions: usize,
        max_iterations: usize,
    ) -> Result<Self, PetscError> {
        let world = body.world;
        let solver = krylov(world, directions)?;
        Ok(Self {
            sum: None,
            solver,
            coarse: None,
            x: Vector::new(world, body.len, body.dim)?,
            y: Vector::new(world, body.len, body.dim)?,
            max_iterations,
            constrained: Vec::new(),
            body,
        })
    }

    fn global(&self, component: usize) -> Int {
        (self.body.dim * self.body.first + component) as Int
    }

    fn product(&mut self, u: &[f64], out: &mut [f64]) -> Result<(), PetscError> {
        let (x, y) = (&mut self.x, &mut self.y);
        self.body.stiffness.mul(u, x, y, out)
    }

    fn choose(&mut self, step: &ReducedStep<'_>) -> Result<(), PetscError> {
        self.constrained.clear();
        self.constrained.extend_from_slice(step.constrained);
        let diagonal = self.body.node_stiffness;
        if self.sum.is_none() {
            self.body.world.trim();
        }
        // The hierarchy is built with the components constrained at first, without the terms of the laws: these may exceed A by orders of
        // magnitude and change from step to step.
        if self.sum.is_none() && self.solver.is_multigrid()? {
            self.body.stiffness.change(step.constrained, diagonal, &[])?;
            self.coarse = Coarse::new(&mut self.solver, &self.body.stiffness)?;
        }
        self.body
            .stiffness
            .change(step.constrained, diagonal, step.added)?;
        let beside = self.beside(step)?;
        let now = self.body.stiffness.now();
        let sum = Matrix::both(now, &beside)?;
        match &mut self.coarse {
            Some(coarse) => coarse.update(&mut self.solver, &self.body.stiffness, &sum)?,
            None => self.solver.set(&sum, now)?,
        }
        self.sum = Some(sum);
        Ok(())
    }

    /// The terms in few rows that are left out of the preconditioner.
    fn beside(&self, step: &ReducedStep<'_>) -> Result<Matrix<'w>, PetscError> {
        let mut rows: Vec<(usize, Vec<Int>, Vec<f64>)> = Vec::new();
        for &(i, j, c) in step.combined {
            let (mut cols, mut values) = (Vec::new(), Vec::new());
            self.body.stiffness.row(j, &mut cols, &mut values)?;
            values.iter_mut().for_each(|v| *v *= c);
            rows.push((i, cols, values));
        }
        for &(i, j, v) in step.beside {
            rows.push((i, vec![self.global(j)], vec![v]));
        }
        let (mut own, mut other) = (vec![0; self.body.len], vec![0; self.body.len]);
        let here = self.global(0)..self.global(self.body.len);
        for (i, cols, _) in &rows {
            let inside = cols.iter().filter(|c| here.contains(c)).count() as Int;
            own[*i] = (own[*i] + inside).min(self.body.len as Int);
            other[*i] += cols.len() as Int - inside;
        }
        let mut matrix = Matrix::new(self.body.world, 1, &own, &other)?;
        for (i, cols, values) in &rows {
            matrix.add_row(self.global(*i), cols, values)?;
        }
        matrix.assemble()?;
        Ok(matrix)
    }

    fn direction(&mut self, r: &[f64], d: &mut [f64], tolerance: f64) -> Result<KrylovReport, SolverError> {
        let mut size = [r.iter().map(|r| r * r).sum()];
        self.body.world.add(&mut size)?;
        let size = size[0].sqrt();
        if size == 0.0 {
            d.fill(0.0);
            return Ok(KrylovReport::new(Status::Solved, 0, 0.0));
        }
        self.x.set(r)?;
        let solved = self
            .solver
            .solve(&self.x, &mut self.y, tolerance, self.max_iterations)?;
        if solved.reason < 0 {
            return Err(SolverError::Diverged {
                reason: solved.reason,
                iterations: solved.iterations,
            });
        }
        self.y.get(d)?;
        // The solution is zero at constrained components; interpolation may leave small values.
        self.constrained.iter().for_each(|k| d[*k] = 0.0);
        let residual = solved.residual / size;
        let met = residual <= tolerance;
        let status = if met {
            Status::Solved
        } else {
            Status::IterationLimit
        };
        Ok(KrylovReport::new(status, solved.iterations, residual))
    }
}

/// GAMG's matrix on the level below the finest, Pᵀ A P: A changes near contact nodes alone, so Pᵀ (A' − A) P, a small product, is added to it.
/// PETSc would recompute all of it, which takes up to two thirds of the time of a Newton step and, on several processes, more memory than
/// A.
#[derive(Debug)]
struct Coarse<'w> {
    /// The rows of P near contact nodes.
    interpolation: Matrix<'w>,
    matrix: Matrix<'w>,
    /// A near contact nodes, at the setup of the hierarchy.
    near: Matrix<'w>,
    /// A' − A near contact nodes, and Pᵀ (A' − A) P.
    difference: Option<[Matrix<'w>; 2]>,
}

impl<'w> Coarse<'w> {
    /// Sets up the solver for the current matrix; `None` if there are no coarse levels.
    fn new(solver: &mut Solver<'w>, stiffness: &Stiffness<'w>) -> Result<Option<Self>, PetscError> {
        solver.set(stiffness.now(), stiffness.now())?;
        let Some([interpolation, matrix]) = solver.hierarchy(stiffness.near())? else {
            return Ok(None);
        };
        Ok(Some(Self {
            interpolation,
            matrix,
            near: stiffness.now_near(None)?,
            difference: None,
        }))
    }

    fn update(
        &mut self,
        solver: &mut Solver<'w>,
        stiffness: &Stiffness<'w>,
        sum: &Matrix<'w>,
    ) -> Result<(), PetscError> {
        let again = self.difference.is_some();
        let (difference, product) = match self.difference.take() {
            Some([difference, product]) => (Some(difference), Some(product)),
            None => (None, None),
        };
        let mut difference = stiffness.now_near(difference)?;
        difference.subtract(&self.near)?;
        let product = difference.triple(&self.interpolation, product)?;
        solver.update(sum, stiffness.now(), &self.matrix, &product, again)?;
        self.difference = Some([difference, product]);
        Ok(())
    }
}

impl ReducedSystem for System<'_> {
    type Error = Error;

    fn len(&self) -> usize {
        self.body.len
    }

    fn mul(&mut self, u: &[f64], out: &mut [f64]) -> Result<(), Error> {
        let done = self.product(u, out);
        self.body.world.agree(done)
    }

    fn select(&mut self, step: &ReducedStep<'_>) -> Result<(), Error> {
        let done = self.choose(step);
        self.body.world.agree(done)
    }

    fn solve(&mut self, r: &[f64], d: &mut [f64], tolerance: f64) -> Result<KrylovReport, Error> {
        let done = self.direction(r, d, tolerance);
        self.body.world.agree(done)
    }

    fn sum(&self, values: &mut [f64]) -> Result<(), Error> {
        let done = self.body.world.add(values);
        self.body.world.agree(done)
    }

    fn max(&self, values: &mut [f64]) -> Result<(), Error> {
        let done = self.body.world.largest(values);
        self.body.world.agree(done)
    }
}
