//! Gives freed memory back to the operating system.
//!
//! The allocator of glibc keeps freed arrays of up to 32 MB once it has seen such arrays. A rank frees its part of the
//! mesh and the data of the set-up; without this function, the memory would stay with the process. Peak memory of 1 029
//! 000 tetrahedra on four ranks: 242 MiB on the first and 136 on the others before, 222 and 113 with it; the same
//! processor time.

// A call of a function in C.
#![allow(unsafe_code)]

/// Gives arrays of 256 KiB and more back when they are freed. Does nothing with other allocators.
pub(crate) fn give_back_when_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        use std::ffi::c_int;
        unsafe extern "C" {
            fn mallopt(option: c_int, value: c_int) -> c_int;
        }
        // The options M_MMAP_THRESHOLD and M_TRIM_THRESHOLD of malloc.h.
        for option in [-3, -1] {
            // SAFETY: both options take a number of bytes, and no other thread has started yet.
            unsafe { mallopt(option, 1 << 18) };
        }
    }
}
