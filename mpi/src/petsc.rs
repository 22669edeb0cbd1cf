//! The linear solver of PETSc: conjugate gradients with smoothed aggregation (GAMG) and rigid motions. `petsc.c` calls PETSc.
//!
//! Options of PETSc in the variable PETSC_OPTIONS, for example `-pc_gamg_threshold 0.02 -ksp_monitor`, replace the defaults.

// The calls of functions in C.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_char, c_int, c_uint};
use std::ptr::{null, null_mut};

use mpi::topology::{Communicator, SimpleCommunicator};
use variational::core::{BlockRows, RankSolver};

/// Exit code of all ranks if PETSc cannot go on, that of a failure outside of the program.
const FAILED: i32 = 5;

/// The objects of PETSc.
#[repr(C)]
struct Handle {
    private: [u8; 0],
}

unsafe extern "C" {
    fn variational_petsc_message() -> *const c_char;
    fn variational_petsc_finish() -> c_int;
    fn variational_petsc_free(solver: *mut Handle);
    fn variational_petsc_prepare(
        solver: *mut *mut Handle,
        block: c_int,
        rows: c_int,
        starts: *const c_uint,
        columns: *const c_uint,
        values: *const f64,
        positions: *const f64,
    ) -> c_int;
    fn variational_petsc_solve(
        solver: *mut Handle,
        load: *const f64,
        solution: *mut f64,
        tolerance: f64,
        most: c_int,
        iterations: *mut c_int,
        reason: *mut *const c_char,
    ) -> c_int;
}

/// A matrix in PETSc and its solver; empty before the first matrix.
pub(crate) struct Petsc {
    handle: *mut Handle,
    /// Coordinates per row of blocks, and number of own coordinates.
    block: usize,
    length: usize,
}

// SAFETY: PETSc keeps nothing per thread; MPI was initialised for calls from one thread at a time.
unsafe impl Send for Petsc {}

impl Default for Petsc {
    fn default() -> Self {
        Self { handle: null_mut(), block: 0, length: 0 }
    }
}

impl Drop for Petsc {
    fn drop(&mut self) {
        // SAFETY: the handle is null, or one that `prepare` returned.
        unsafe { variational_petsc_free(self.handle) }
    }
}

impl RankSolver for Petsc {
    fn prepare(&mut self, rows: &BlockRows) {
        let count = rows.starts.len() - 1;
        let blocks = rows.starts[count] as usize;
        let length = count * rows.block;
        assert_eq!(rows.columns.len(), blocks, "one column per block");
        assert_eq!(rows.values.len(), blocks * rows.block * rows.block, "all numbers of all blocks");
        assert_eq!(rows.positions.len(), length, "one position per coordinate");
        assert!(self.handle.is_null() || (self.block, self.length) == (rows.block, length), "one pattern");
        (self.block, self.length) = (rows.block, length);
        // SAFETY: the arrays have the lengths that PETSc reads, as asserted.
        let error = unsafe {
            variational_petsc_prepare(
                &raw mut self.handle,
                rows.block as c_int,
                count as c_int,
                rows.starts.as_ptr(),
                rows.columns.as_ptr(),
                rows.values.as_ptr(),
                rows.positions.as_ptr(),
            )
        };
        check(error);
    }

    fn solve(
        &mut self,
        b: &[f64],
        x: &mut [f64],
        tolerance: f64,
        max_iterations: u32,
    ) -> Result<u32, String> {
        assert!(!self.handle.is_null(), "a matrix before a solve");
        assert_eq!((b.len(), x.len()), (self.length, self.length), "one number per coordinate");
        let (mut iterations, mut reason) = (0, null());
        // SAFETY: the handle is not null, and the arrays have the length of the matrix, as asserted.
        let error = unsafe {
            let most = max_iterations.try_into().unwrap_or(c_int::MAX);
            let (out, outcome) = (&raw mut iterations, &raw mut reason);
            variational_petsc_solve(self.handle, b.as_ptr(), x.as_mut_ptr(), tolerance, most, out, outcome)
        };
        check(error);
        if reason.is_null() {
            return Ok(iterations as u32);
        }
        // SAFETY: the reason is a name of PETSc's own table.
        Err(unsafe { CStr::from_ptr(reason) }.to_string_lossy().into_owned())
    }
}

/// Ends the use of PETSc, before that of MPI. All ranks must call it.
pub(crate) fn finish() {
    // SAFETY: no solver is in use any more.
    check(unsafe { variational_petsc_finish() });
}

/// Ends all ranks if PETSc reports an error, for example that memory is exhausted: other ranks may wait for this one.
fn check(error: c_int) {
    if error != 0 {
        // SAFETY: the text is a static array.
        let text = unsafe { CStr::from_ptr(variational_petsc_message()) };
        eprintln!("error: PETSc, error {error}: {}", text.to_string_lossy());
        SimpleCommunicator::world().abort(FAILED);
    }
}
