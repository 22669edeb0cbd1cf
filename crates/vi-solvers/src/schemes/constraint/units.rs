//! Units for the rows of a small symmetric matrix whose rows have different dimensions, such as S = G M⁻¹ Gᵀ of
//! constraints. In these units the matrix can be judged and solved as if it were dimensionless.

use nalgebra::{DMatrix, DVector, Dyn, LU, SVD};
use vi_core::binary_exponent;

/// Rows count as dependent if the smallest eigenvalue is below this fraction of the largest, both in these units.
const DEPENDENT: f64 = 1e-9;
/// If rows depend on each other, singular values below this fraction of the largest count as zero.
const SINGULAR: f64 = 1e-10;

/// Units u_i of the rows and columns of a matrix S: powers of two such that S_ii/u_i² is from 1 to 4, up to a common
/// factor. Bodies of any size then have the same S/(u_i u_j), even to the bit if the units of the scene differ by
/// powers of two.
#[derive(Debug, Clone, Default)]
pub(crate) struct Units(Vec<f64>);

impl Units {
    /// Returns the units for the diagonal S_ii ≥ 0.
    pub(crate) fn of(diagonal: &DVector<f64>) -> Self {
        // The exponents of rows of different dimension differ by an even number, so halving their difference is
        // exact.
        let first = diagonal.iter().copied().find(|s| *s > 0.0).map_or(0, binary_exponent);
        let unit =
            |&s: &f64| if s > 0.0 { 2.0_f64.powi((binary_exponent(s) - first).div_euclid(2)) } else { 1.0 };
        Self(diagonal.iter().map(unit).collect())
    }

    /// Returns 1/u_i for each row.
    pub(crate) fn scales(&self) -> Vec<f64> {
        self.0.iter().map(|unit| 1.0 / unit).collect()
    }

    /// Scales x_i ← x_i/u_i.
    pub(crate) fn divide(&self, x: &mut [f64]) {
        x.iter_mut().zip(&self.0).for_each(|(x, unit)| *x /= unit);
    }

    /// Solves S λ = r with S scaled to these units; by least squares if `is_redundant`.
    pub(crate) fn solve(
        &self,
        matrix: DMatrix<f64>,
        rhs: &DVector<f64>,
        is_redundant: bool,
    ) -> Option<DVector<f64>> {
        self.clone().factor(matrix, is_redundant).solve(rhs)
    }

    /// Factors S scaled to these units, for solutions by least squares if `is_redundant`.
    pub(crate) fn factor(self, mut matrix: DMatrix<f64>, is_redundant: bool) -> Factored {
        self.scale(&mut matrix);
        let factor = if is_redundant {
            let limit = SINGULAR * matrix.amax();
            Factor::Redundant(Box::new(matrix.svd(true, true)), limit)
        } else {
            Factor::Independent(Box::new(matrix.lu()))
        };
        Factored { units: self, factor }
    }

    /// Returns whether the rows of the symmetric S ≥ 0 depend on each other.
    pub(crate) fn are_dependent(&self, mut matrix: DMatrix<f64>) -> bool {
        self.scale(&mut matrix);
        let values = matrix.symmetric_eigenvalues();
        values.min() <= DEPENDENT * values.max()
    }

    /// Scales S_ij ← S_ij/(u_i u_j).
    fn scale(&self, matrix: &mut DMatrix<f64>) {
        for (j, mut column) in matrix.column_iter_mut().enumerate() {
            for (i, value) in column.iter_mut().enumerate() {
                *value /= self.0[i] * self.0[j];
            }
        }
    }
}

/// A factored matrix.
pub(crate) struct Factored {
    units: Units,
    factor: Factor,
}

enum Factor {
    Independent(Box<LU<f64, Dyn, Dyn>>),
    /// Singular values below the limit count as zero.
    Redundant(Box<SVD<f64, Dyn, Dyn>>, f64),
}

impl Factored {
    /// Solves S λ = r; `None` if S is singular.
    pub(crate) fn solve(&self, rhs: &DVector<f64>) -> Option<DVector<f64>> {
        let mut rhs = rhs.clone();
        self.units.divide(rhs.as_mut_slice());
        let mut solved = match &self.factor {
            Factor::Independent(factor) => factor.solve(&rhs),
            Factor::Redundant(factor, limit) => factor.solve(&rhs, *limit).ok(),
        }?;
        self.units.divide(solved.as_mut_slice());
        Some(solved)
    }
}
