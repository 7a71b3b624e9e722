//! Vectors, matrices and solvers of PETSc, which free themselves. Calls are collective unless they say otherwise.

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

    /// Not collective. `values` are as many as the vector has in this process.
    fn with<T>(&self, length: usize, work: impl FnOnce(&mut [f64]) -> T) -> Outcome<T> {
        let mut a = null_mut();
        call!(VecGetArray(self.0, &mut a))?;
        let result = if length == 0 {
            work(&mut [])
        } else {
            // SAFETY: PETSc lends the entries of this process until they are restored; the caller knows how many there are.
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

    pub(crate) fn assemble(&mut self) -> Outcome<()> {
        call!(shim_assemble(self.0))
    }

    pub(crate) fn set_definite(&mut self) -> Outcome<()> {
        call!(shim_definite(self.0))
    }

    /// From vectors of as many entries as this process has rows, one after another.
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

    /// That of another matrix.
    pub(crate) fn share_near_kernel(&mut self, a: &Self) -> Outcome<()> {
        call!(shim_share_near_kernel(a.0, self.0))
    }

    pub(crate) fn duplicate(&self) -> Outcome<Self> {
        let mut a = null_mut();
        call!(shim_duplicate(self.0, &mut a))?;
        Ok(Self(a, PhantomData))
    }

    /// The entries of a matrix with the same pattern.
    pub(crate) fn copy_from(&mut self, a: &Self) -> Outcome<()> {
        call!(shim_copy(a.0, self.0))
    }

    /// A row of this process is appended to lists. Not collective.
    pub(crate) fn row(&self, row: Int, cols: &mut Vec<Int>, values: &mut Vec<f64>) -> Outcome<()> {
        let (mut n, mut c, mut v) = (0, null(), null());
        call!(MatGetRow(self.0, row, &mut n, &mut c, &mut v))?;
        if n > 0 {
            // SAFETY: PETSc lends n columns and values until they are restored.
            unsafe {
                cols.extend_from_slice(std::slice::from_raw_parts(c, n as usize));
                values.extend_from_slice(std::slice::from_raw_parts(v, n as usize));
            }
        }
        call!(MatRestoreRow(self.0, row, &mut n, &mut c, &mut v))
    }

    /// Makes rows of this process and their columns those of a diagonal matrix.
    pub(crate) fn hold(&mut self, rows: &[Int], diagonal: f64) -> Outcome<()> {
        call!(shim_hold(self.0, rows.len() as Int, rows.as_ptr(), diagonal))
    }

    pub(crate) fn mul(&self, x: &Vector<'_>, y: &mut Vector<'_>) -> Outcome<()> {
        call!(MatMult(self.0, x.0, y.0))
    }

    /// The Schur complement of the rows that process 0 names, row by row on process 0: all others are eliminated.
    pub(crate) fn eliminate_others(&self, rows: &[Int], schur: &mut [f64]) -> Outcome<()> {
        assert_eq!(schur.len(), rows.len() * rows.len());
        let (n, rows) = (rows.len() as Int, rows.as_ptr());
        call!(shim_eliminate(self.0, n, rows, schur.as_mut_ptr()))
    }

    /// a + b, which is not formed: PETSc counts references to both.
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
    /// ‖b − A x‖₂, as the recurrence has it.
    pub(crate) residual: f64,
    /// PETSc's reason: below 0 where there is no approximation.
    pub(crate) reason: i32,
}

impl<'w> Solver<'w> {
    /// With the options given at the start, and these where they say nothing.
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
