//! The functions of `shim.c`, and those of PETSc that need no shim. Static assertions in `shim.c` check the types.

use std::ffi::{c_char, c_int, c_longlong, c_void};

/// `PetscInt`.
#[cfg(not(petsc_int64))]
pub type Int = i32;
/// `PetscInt`.
#[cfg(petsc_int64)]
pub type Int = i64;
pub type Code = c_int;
pub type Handle = *mut c_void;

unsafe extern "C" {
    pub fn shim_start(options: *const c_char) -> Code;
    pub fn shim_finish() -> Code;
    pub fn shim_trim();
    pub fn shim_abort(code: c_int);
    pub fn shim_world(rank: *mut c_int, size: *mut c_int);
    pub fn shim_vote(own: c_int, limit: c_int, patience: f64, smallest: *mut c_int, late: *mut c_int)
    -> Code;
    pub fn shim_broadcast(text: *mut c_char, length: c_int, root: c_int) -> Code;
    pub fn shim_sum(v: *mut f64, n: c_int) -> Code;
    pub fn shim_max(v: *mut f64, n: c_int) -> Code;
    pub fn shim_send(bytes: *const c_char, n: c_longlong, to: c_int) -> Code;
    pub fn shim_receive(bytes: *mut c_char, n: c_longlong, from: c_int) -> Code;
    pub fn shim_offset(own: c_longlong, before: *mut c_longlong, total: *mut c_longlong) -> Code;
    pub fn shim_fetch(
        width: Int,
        own: Int,
        values: *const f64,
        count: Int,
        rows: *const Int,
        out: *mut f64,
    ) -> Code;

    pub fn shim_vector(local: Int, block: Int, v: *mut Handle) -> Code;
    pub fn shim_matrix(local: Int, block: Int, own: *const Int, other: *const Int, a: *mut Handle) -> Code;
    pub fn shim_add_block_row(a: Handle, row: Int, n: Int, cols: *const Int, values: *const f64) -> Code;
    pub fn shim_add_row(a: Handle, row: Int, n: Int, cols: *const Int, values: *const f64) -> Code;
    pub fn shim_assemble(a: Handle) -> Code;
    pub fn shim_definite(a: Handle) -> Code;
    pub fn shim_among(a: Handle, n: Int, rows: *const Int, again: c_int, part: *mut Handle) -> Code;
    pub fn shim_replace_row(a: Handle, row: Int, n: Int, cols: *const Int, values: *const f64) -> Code;
    pub fn shim_subtract(a: Handle, b: Handle) -> Code;
    pub fn shim_triple(a: Handle, p: Handle, again: c_int, product: *mut Handle) -> Code;
    pub fn shim_hold(a: Handle, n: Int, rows: *const Int, diagonal: f64) -> Code;
    pub fn shim_both(a: Handle, b: Handle, sum: *mut Handle) -> Code;
    pub fn shim_near_kernel(a: Handle, local: Int, block: Int, count: c_int, values: *const f64) -> Code;

    pub fn shim_eliminate(a: Handle, n: Int, rows: *const Int, schur: *mut f64) -> Code;

    pub fn shim_default(name: *const c_char, value: *const c_char) -> Code;
    pub fn shim_solver(k: *mut Handle) -> Code;
    pub fn shim_operators(k: Handle, a: Handle, p: Handle) -> Code;
    pub fn shim_multigrid(k: Handle, is: *mut c_int) -> Code;
    pub fn shim_hierarchy(
        k: Handle,
        n: Int,
        rows: *const Int,
        interpolation: *mut Handle,
        coarse: *mut Handle,
    ) -> Code;
    pub fn shim_update(k: Handle, a: Handle, p: Handle, coarse: Handle, change: Handle, again: c_int)
    -> Code;
    pub fn shim_solve(
        k: Handle,
        b: Handle,
        x: Handle,
        tolerance: f64,
        most: Int,
        iterations: *mut Int,
        residual: *mut f64,
        reason: *mut c_int,
    ) -> Code;

    pub fn PetscGetFlops(count: *mut f64) -> Code;
    pub fn PetscErrorMessage(code: Code, text: *mut *const c_char, specific: *mut *mut c_char) -> Code;
    pub fn VecDestroy(v: *mut Handle) -> Code;
    pub fn VecGetArray(v: Handle, a: *mut *mut f64) -> Code;
    pub fn VecRestoreArray(v: Handle, a: *mut *mut f64) -> Code;
    pub fn MatDestroy(a: *mut Handle) -> Code;
    pub fn MatMult(a: Handle, x: Handle, y: Handle) -> Code;
    pub fn MatGetRow(
        a: Handle,
        row: Int,
        n: *mut Int,
        cols: *mut *const Int,
        values: *mut *const f64,
    ) -> Code;
    pub fn MatRestoreRow(
        a: Handle,
        row: Int,
        n: *mut Int,
        cols: *mut *const Int,
        values: *mut *const f64,
    ) -> Code;
    pub fn KSPDestroy(k: *mut Handle) -> Code;
}
