//! SIMD lanes: eight elements or points side by side, and how their numbers come from memory and go back.

pub(crate) mod instructions;
pub(crate) mod pack;
pub(crate) mod real;
pub(crate) mod transpose;
