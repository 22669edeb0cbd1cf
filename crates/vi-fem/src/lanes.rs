//! SIMD lanes: store eight elements or points side by side, and move their numbers between memory and registers.

pub(crate) mod instructions;
pub(crate) mod pack;
pub(crate) mod places;
pub(crate) mod real;
pub(crate) mod transpose;
