//! Owned vectors, matrices and solvers of PETSc. Calls are collective unless stated otherwise.

use std::ffi::{CString, c_int};
use std::marker::PhantomData;
use std::ptr::{null, null_mut};

use crate::World;
use crate::ffi::{self, Handle, Int};
use crate::world::{PetscError, call};

type Outcome<T> = Result<T, PetscError>;

macro_rules! owned {
    ($name:ident, $destroy:ident) => {
        #[derive(Debug)]
        pub(crate) struct $name<'w>(Handle, PhantomData<&'w World>);

        impl Drop for $name<'_> {
            fn drop(&mut self) {
                // SAFETY: created once, destroyed once, while the world is running.
                unsafe { ffi::$destroy(&mut self.0) };
            }
        }
    };
}
owned!(Vector, VecDestroy);
owned!(Matrix, MatDestroy);
owned!(Solver, KSPDestroy);

impl<'w> Vector<'w> {
    pub(crate) fn new(_: &'w World, local: usize, block: usize) -> Outcome<Self> {
        let mut v = null_mut();
        call!(shim_vector(local as Int, block as Int, &mut v))?;
        Ok(Self(v, PhantomData))
    }

    /// Not collective. `values` has as many entries as the vector on this process.
    fn with<T>(&self, length: usize, work: impl FnOnce(&mut [f64]) -> T) -> Outcome<T> {
        let mut a = null_mut();
        call!(VecGetArray(self.0, &mut a))?;
        let result = if length == 0 {
            work(&mut [])
        } else {
            // SAFETY: the pointer to the entries of this process is valid until they are restored; the caller gives their number.
            work(unsafe { std::slice::from_raw_parts_mut(a, length) })
        };
        call!(VecRestoreArray(self.0, &mut a))?;
        Ok(result)
    }

    pub(crate) fn set(&mut self, values: &[f64]) -> Outcome<()> {
        self.with(values.len(), |v| v.copy_from_slice(values))
    }

    pub(crate) fn get(&self, values: &mut [f64]) -> Outcome<()> {
        self.with(values.len(), |v| values.copy_from_slice(v))
    }
}

impl<'w> Matrix<'w> {
    /// `own` and `other`: for each block row, the number of blocks in columns of this process and of others.
    pub(crate) fn new(_: &'w World, block: usize, own: &[Int], other: &[Int]) -> Outcome<Self> {
        let mut a = null_mut();
        let local = (own.len() * block) as Int;
        assert_eq!(own.len(), other.len());
        call!(shim_matrix(
            local,
            block as Int,
            own.as_ptr(),
            other.as_ptr(),
            &mut a
        ))?;
        Ok(Self(a, PhantomData))
    }

    /// Adds a block row of this process, row by row. Not collective.
    pub(crate) fn add_block_row(&mut self, row: Int, cols: &[Int], values: &[f64]) -> Outcome<()> {
        let (n, cols, values) = (cols.len() as Int, cols.as_ptr(), values.as_ptr());
        call!(shim_add_block_row(self.0, row, n, cols, values))
    }

    /// Adds to a row of this process. Not collective.
    pub(crate) fn add_row(&mut self, row: Int, cols: &[Int], values: &[f64]) -> Outcome<()> {
        assert_eq!(cols.len(), values.len());
        let (n, cols, values) = (cols.len() as Int, cols.as_ptr(), values.as_ptr());
        call!(shim_add_row(self.0, row, n, cols, values))
    }

    /// To be called after rows were added to or replaced, and between replacing and adding.
    pub(crate) fn assemble(&self) -> Outcome<()> {
        call!(shim_assemble(self.0))
    }

    pub(crate) fn set_definite(&mut self) -> Outcome<()> {
        call!(shim_definite(self.0))
    }

    /// `vectors` has `count` vectors with as many entries as this process has rows, one after another.
    pub(crate) fn set_near_kernel(&mut self, block: usize, count: usize, vectors: &[f64]) -> Outcome<()> {
        let local = vectors.len() / count.max(1);
        call!(shim_near_kernel(
            self.0,
            local as Int,
            block as Int,
            count as c_int,
            vectors.as_ptr()
        ))
    }

    /// The submatrix of some rows and the same columns, renumbered through all processes; `rows` are those of this process in increasing
    /// order.
    pub(crate) fn among(&self, rows: &[Int]) -> Outcome<Self> {
        let mut part = null_mut();
        call!(shim_among(self.0, rows.len() as Int, rows.as_ptr(), 0, &mut part))?;
        Ok(Self(part, PhantomData))
    }

    /// As [`among`](Self::among), into its earlier result for the same rows.
    pub(crate) fn among_again(&self, rows: &[Int], part: &mut Self) -> Outcome<()> {
        call!(shim_among(
            self.0,
            rows.len() as Int,
            rows.as_ptr(),
            1,
            &mut part.0
        ))
    }

    /// Replaces entries of a row of this process. Not collective. Takes `&self`, since PETSc's matrices are shared by reference; only the
    /// owner of the matrix may call it.
    pub(crate) fn replace_row(&self, row: Int, cols: &[Int], values: &[f64]) -> Outcome<()> {
        assert_eq!(cols.len(), values.len());
        let (n, cols, values) = (cols.len() as Int, cols.as_ptr(), values.as_ptr());
        call!(shim_replace_row(self.0, row, n, cols, values))
    }

    /// Subtracts a matrix of the same pattern.
    pub(crate) fn subtract(&mut self, a: &Self) -> Outcome<()> {
        call!(shim_subtract(self.0, a.0))
    }

    /// Pᵀ A P; an earlier product of matrices with the same patterns is overwritten.
    pub(crate) fn triple(&self, p: &Self, before: Option<Self>) -> Outcome<Self> {
        let again = c_int::from(before.is_some());
        let mut product = before.unwrap_or(Self(null_mut(), PhantomData));
        call!(shim_triple(self.0, p.0, again, &mut product.0))?;
        Ok(product)
    }

    /// Appends a row of this process to lists. Not collective.
    pub(crate) fn row(&self, row: Int, cols: &mut Vec<Int>, values: &mut Vec<f64>) -> Outcome<()> {
        let (mut n, mut c, mut v) = (0, null(), null());
        call!(MatGetRow(self.0, row, &mut n, &mut c, &mut v))?;
        if n > 0 {
            // SAFETY: the pointers to n columns and n values are valid until the row is restored.
            unsafe {
                cols.extend_from_slice(std::slice::from_raw_parts(c, n as usize));
                values.extend_from_slice(std::slice::from_raw_parts(v, n as usize));
            }
        }
        call!(MatRestoreRow(self.0, row, &mut n, &mut c, &mut v))
    }

    /// Replaces rows of this process and their columns by those of a diagonal matrix.
    pub(crate) fn hold(&mut self, rows: &[Int], diagonal: f64) -> Outcome<()> {
        call!(shim_hold(self.0, rows.len() as Int, rows.as_ptr(), diagonal))
    }

    pub(crate) fn mul(&self, x: &Vector<'_>, y: &mut Vector<'_>) -> Outcome<()> {
        call!(MatMult(self.0, x.0, y.0))
    }

    /// The Schur complement on the rows given by process 0, stored row by row on process 0: all other rows are eliminated.
    pub(crate) fn eliminate_others(&self, rows: &[Int], schur: &mut [f64]) -> Outcome<()> {
        assert_eq!(schur.len(), rows.len() * rows.len());
        let (n, rows) = (rows.len() as Int, rows.as_ptr());
        call!(shim_eliminate(self.0, n, rows, schur.as_mut_ptr()))
    }

    /// a + b as an operator, without forming the sum: PETSc counts references to both.
    pub(crate) fn both(a: &Self, b: &Self) -> Outcome<Self> {
        let mut sum = null_mut();
        call!(shim_both(a.0, b.0, &mut sum))?;
        Ok(Self(sum, PhantomData))
    }
}

/// How a solve ended.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Solved {
    pub(crate) iterations: usize,
    /// ‖b − A x‖₂ from the recurrence of the method, not evaluated.
    pub(crate) residual: f64,
    /// PETSc's `KSPConvergedReason`; negative if there is no approximation, 0 at the limit of iterations.
    pub(crate) reason: i32,
}

impl<'w> Solver<'w> {
    /// A solver with the options given at the start; `defaults` apply where those say nothing.
    pub(crate) fn new(_: &'w World, defaults: &[(&str, &str)]) -> Outcome<Self> {
        for (name, value) in defaults {
            let text = |s: &str| CString::new(s).unwrap_or_default();
            let (name, value) = (text(name), text(value));
            call!(shim_default(name.as_ptr(), value.as_ptr()))?;
        }
        let mut k = null_mut();
        call!(shim_solver(&mut k))?;
        Ok(Self(k, PhantomData))
    }

    pub(crate) fn set(&mut self, a: &Matrix<'_>, preconditioned: &Matrix<'_>) -> Outcome<()> {
        call!(shim_operators(self.0, a.0, preconditioned.0))
    }

    /// Whether the preconditioner is GAMG with aggregates that are reused.
    pub(crate) fn is_multigrid(&self) -> Outcome<bool> {
        let mut is = 0;
        call!(shim_multigrid(self.0, &mut is))?;
        Ok(is != 0)
    }

    /// From the hierarchy made by [`set`](Self::set): the given rows of the interpolation to the finest level, and the matrix of the level
    /// below; `None` if there is only one level.
    pub(crate) fn hierarchy(&mut self, rows: &[Int]) -> Outcome<Option<[Matrix<'w>; 2]>> {
        let (mut interpolation, mut coarse) = (null_mut(), null_mut());
        call!(shim_hierarchy(
            self.0,
            rows.len() as Int,
            rows.as_ptr(),
            &mut interpolation,
            &mut coarse
        ))?;
        let owned = [interpolation, coarse].map(|m| Matrix(m, PhantomData));
        Ok((!interpolation.is_null()).then_some(owned))
    }

    /// As [`set`](Self::set), but reuses the hierarchy: the matrix below the finest level becomes `coarse` + `change`. `again` is false at
    /// the first call.
    pub(crate) fn update(
        &mut self,
        a: &Matrix<'_>,
        preconditioned: &Matrix<'_>,
        coarse: &Matrix<'_>,
        change: &Matrix<'_>,
        again: bool,
    ) -> Outcome<()> {
        call!(shim_update(
            self.0,
            a.0,
            preconditioned.0,
            coarse.0,
            change.0,
            c_int::from(again)
        ))
    }

    pub(crate) fn solve(
        &mut self,
        b: &Vector<'_>,
        x: &mut Vector<'_>,
        tolerance: f64,
        most: usize,
    ) -> Outcome<Solved> {
        let (mut iterations, mut residual, mut reason) = (0, 0.0, 0);
        call!(shim_solve(
            self.0,
            b.0,
            x.0,
            tolerance,
            most as Int,
            &mut iterations,
            &mut residual,
            &mut reason,
        ))?;
        Ok(Solved {
            iterations: iterations as usize,
            residual,
            reason,
        })
    }
}
