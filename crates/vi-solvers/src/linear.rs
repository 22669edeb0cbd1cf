//! Sparse matrices and solves with them: Cholesky and LU factors, conjugate gradients, minimal residuals, Lanczos.

pub(crate) mod bicgstab;
pub(crate) mod block_rows;
pub(crate) mod choice;
pub(crate) mod cost;
pub(crate) mod dense_lu;
pub(crate) mod factor;
pub(crate) mod gmres;
pub(crate) mod lanczos;
pub(crate) mod matrix;
pub(crate) mod matrix_sum;
pub(crate) mod minres;
pub(crate) mod model;
pub(crate) mod nodal_matrix;
mod ordering;
pub(crate) mod pcg;
pub(crate) mod pencil;
pub(crate) mod perturbed;
pub(crate) mod refinement;
mod rivalry;
pub(crate) mod trial;
pub(crate) mod unsymmetric;
