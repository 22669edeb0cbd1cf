//! Small dense algebra over lanes: 3 × 3 matrices, their singular values and rotations.

pub(crate) mod logarithm;
pub(crate) mod rotation;
pub(crate) mod svd;
pub mod tensor;
