//! Units of the rows of a small symmetric matrix whose rows have different dimensions, such as S = G M⁻¹ Gᵀ of
//! constraints: in them the matrix is judged and solved as if it had none.

use nalgebra::{DMatrix, DVector};
use vi_core::binary_exponent;

/// Rows depend on each other where the smallest eigenvalue is below this part of the largest, both in these units.
const DEPENDENT: f64 = 1e-9;
/// Singular values below this part of the largest are taken for zero where rows depend on each other.
const SINGULAR: f64 = 1e-10;

/// Units u_i of the rows and columns of a matrix S, powers of two with S_ii/u_i² from 1 to 4 but for a common
/// factor: bodies of any size then have the same S/(u_i u_j), to the bit in units that are powers of two.
#[derive(Debug, Clone, Default)]
pub(crate) struct Units(Vec<f64>);

impl Units {
    /// Those of the diagonal S_ii ≥ 0.
    pub(crate) fn of(diagonal: &DVector<f64>) -> Self {
        // Exponents of rows of different dimension differ by an even number: their difference is halved exactly.
        let first = diagonal.iter().copied().find(|s| *s > 0.0).map_or(0, binary_exponent);
        let unit =
            |&s: &f64| if s > 0.0 { 2.0_f64.powi((binary_exponent(s) - first).div_euclid(2)) } else { 1.0 };
        Self(diagonal.iter().map(unit).collect())
    }

    /// Solves S λ = r, S in the rows and columns of these units; in the least-squares sense where `is_redundant`.
    pub(crate) fn solve(
        &self,
        mut matrix: DMatrix<f64>,
        rhs: &DVector<f64>,
        is_redundant: bool,
    ) -> Option<DVector<f64>> {
        self.scale(&mut matrix);
        let rhs = DVector::from_fn(rhs.len(), |i, _| rhs[i] / self.0[i]);
        let solved = if is_redundant {
            let limit = SINGULAR * matrix.amax();
            matrix.svd(true, true).solve(&rhs, limit).ok()
        } else {
            matrix.lu().solve(&rhs)
        };
        solved.map(|solved| DVector::from_fn(rhs.len(), |i, _| solved[i] / self.0[i]))
    }

    /// Do rows and columns of the symmetric S ≥ 0 depend on each other?
    pub(crate) fn are_dependent(&self, mut matrix: DMatrix<f64>) -> bool {
        self.scale(&mut matrix);
        let values = matrix.symmetric_eigenvalues();
        values.min() <= DEPENDENT * values.max()
    }

    /// S_ij ← S_ij/(u_i u_j).
    fn scale(&self, matrix: &mut DMatrix<f64>) {
        for (j, mut column) in matrix.column_iter_mut().enumerate() {
            for (i, value) in column.iter_mut().enumerate() {
                *value /= self.0[i] * self.0[j];
            }
        }
    }
}
