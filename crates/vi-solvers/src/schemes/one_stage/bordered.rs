//! Solves the equations of a tangent A with few constraints, [A, B; C, 0] (x, λ) = (r, s), by factors of A alone: x = A⁻¹(r − B λ)
//! with the Schur complement (C A⁻¹ B) λ = C A⁻¹ r − s. Each constraint costs one solution per factor.
//!
//! Coordinates of rigid bodies have different units. Factors are those of A_ij/(u_i u_j) in units u of the diagonal, so that the
//! choice of pivots does not depend on the units of the scene.

use nalgebra::{DMatrix, DVector};

use crate::error::SolverError;
use crate::linear::factor::lu::Lu;
use crate::linear::nodal_matrix::{Covector, NodalMatrix};
use crate::linear::refinement::solve_refined;
use crate::schemes::constraint::units::{Factored, Units};

/// The constraints of a tangent, with the factors of their Schur complement. All matrices are scaled to the units of A.
pub(super) struct Border {
    units: Units,
    /// C by rows.
    rows: Vec<Vec<(u32, f64)>>,
    /// B by columns.
    columns: Vec<Vec<f64>>,
    /// The columns of A⁻¹ B.
    responses: Vec<Vec<f64>>,
    /// The factors of C A⁻¹ B.
    complement: Factored,
}

/// Scales a matrix A to units of its diagonal; returns the units.
pub(super) fn scale_to_units(matrix: &mut NodalMatrix) -> Units {
    let units = Units::of(&DVector::from_vec(matrix.diagonal()).abs());
    matrix.scale(&units.scales());
    units
}

impl Border {
    /// Factors the Schur complement of the constraints with these rows of C and columns of B, which are not scaled yet, for the matrix A
    /// that is scaled to these units and has these factors.
    ///
    /// # Errors
    /// Returns the errors of [`Lu::solve`].
    pub(super) fn new(
        matrix: &NodalMatrix,
        factors: &Lu,
        units: Units,
        mut rows: Vec<Vec<(u32, f64)>>,
        mut columns: Vec<Vec<f64>>,
    ) -> Result<Self, SolverError> {
        let scales = units.scales();
        rows.iter_mut().flatten().for_each(|(free, value)| *value *= scales[*free as usize]);
        columns.iter_mut().for_each(|column| units.divide(column));
        let mut responses = columns.clone();
        for response in &mut responses {
            factors.solve(matrix, response)?;
        }
        let size = rows.len();
        let complement = DMatrix::from_fn(size, size, |i, j| along(&rows[i], &responses[j]));
        let of_complement = Units::of(&complement.diagonal().abs());
        let complement = of_complement.factor(complement, false);
        Ok(Self { units, rows, columns, responses, complement })
    }

    /// Replaces (r, s) by the solution (x, λ).
    ///
    /// # Errors
    /// Returns the errors of [`Lu::solve`], and [`SolverError::Singular`] if constraints depend on each other.
    pub(super) fn solve(
        &self,
        matrix: &NodalMatrix,
        factors: &Lu,
        rhs: &mut [f64],
    ) -> Result<(), SolverError> {
        let free_count = rhs.len() - self.rows.len();
        self.units.divide(&mut rhs[..free_count]);
        solve_refined(
            rhs,
            |rhs| self.eliminate(matrix, factors, rhs),
            |solution, rest| self.subtract_product(matrix, solution, rest),
        )?;
        self.units.divide(&mut rhs[..free_count]);
        match rhs.iter().all(|value| value.is_finite()) {
            true => Ok(()),
            false => Err(SolverError::Singular { rows: rhs.len() }),
        }
    }

    /// Replaces (r, s) by the solution (x, λ) without refinement.
    fn eliminate(&self, matrix: &NodalMatrix, factors: &Lu, rhs: &mut [f64]) -> Result<(), SolverError> {
        let size = rhs.len();
        let (x, lambda) = rhs.split_at_mut(size - self.rows.len());
        factors.solve(matrix, x)?;
        let defect = DVector::from_iterator(
            lambda.len(),
            self.rows.iter().zip(&*lambda).map(|(row, s)| along(row, x) - s),
        );
        let solved = self.complement.solve(&defect).ok_or(SolverError::Singular { rows: size })?;
        lambda.copy_from_slice(solved.as_slice());
        Self::subtract(&self.responses, lambda, x);
        Ok(())
    }

    /// Subtracts (A x + B λ, C x) from `rest`.
    fn subtract_product(&self, matrix: &NodalMatrix, solution: &[f64], rest: &mut [f64]) {
        let free_count = solution.len() - self.rows.len();
        let (x, lambda) = solution.split_at(free_count);
        let mut forces = vec![0.0; free_count];
        matrix.multiply(x, &mut forces);
        let (forces_left, defects_left) = rest.split_at_mut(free_count);
        forces_left.iter_mut().zip(&forces).for_each(|(rest, force)| *rest -= force);
        Self::subtract(&self.columns, lambda, forces_left);
        defects_left.iter_mut().zip(&self.rows).for_each(|(rest, row)| *rest -= along(row, x));
    }

    /// Subtracts a sum of columns with factors λ from x.
    fn subtract(columns: &[Vec<f64>], lambda: &[f64], x: &mut [f64]) {
        for (column, lambda) in columns.iter().zip(lambda) {
            x.iter_mut().zip(column).for_each(|(x, value)| *x -= lambda * value);
        }
    }
}

/// Returns the product of a row of C and a vector.
fn along(row: &Covector, x: &[f64]) -> f64 {
    row.iter().map(|&(free, value)| value * x[free as usize]).sum()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::linear::matrix::{Pattern, SymmetricMatrix};

    /// Three nodes that outer products join, with two constraints whose units differ by 1e9.
    #[test]
    fn equations_and_constraints_are_solved() {
        let pattern = Pattern::new(3, &[(0, 0), (1, 1), (2, 2)], vec![0, 1, 2], (0..9).collect());
        let zero = SymmetricMatrix::zeros(Arc::new(pattern));
        let vector = |seed: u32| -> Vec<(u32, f64)> {
            (0..9).map(|k| (k, (f64::from(k * seed) + f64::from(seed)).sin())).collect()
        };
        let products = [(vector(2), vector(3)), (vector(5), vector(7))];
        let couplings =
            |each: &mut dyn FnMut(&Covector, &Covector)| products.iter().for_each(|(a, b)| each(a, b));
        let (mut matrix, _) = NodalMatrix::covering(None, &[&zero], couplings, false).unwrap();
        matrix.add_diagonal(&(1..10).map(f64::from).collect::<Vec<_>>());
        couplings(&mut |a, b| matrix.add_outer(0.5, a, b));
        let units = scale_to_units(&mut matrix);
        let mut factors = Lu::new(matrix.pattern()).unwrap();
        factors.factorize(&matrix).unwrap();
        let rows = vec![vec![(0, 1.0), (4, -2.0)], vec![(5, 3e9), (8, 1e9)]];
        let columns: Vec<Vec<f64>> = [(vector(11), 1.0), (vector(13), 1e9)]
            .iter()
            .map(|(entries, unit)| entries.iter().map(|(_, value)| unit * value).collect())
            .collect();
        let border = Border::new(&matrix, &factors, units, rows.clone(), columns.clone()).unwrap();
        let rhs: Vec<f64> = (0..11).map(|k| f64::from(k).cos()).collect();
        let mut solution = rhs.clone();
        border.solve(&matrix, &factors, &mut solution).unwrap();
        let (x, lambda) = solution.split_at(9);
        let mut forces = vec![0.0; 9];
        let scales = border.units.scales();
        let scaled: Vec<f64> = x.iter().zip(&scales).map(|(x, scale)| x / scale).collect();
        matrix.multiply(&scaled, &mut forces);
        forces.iter_mut().zip(&scales).for_each(|(force, scale)| *force /= scale);
        for k in 0..9 {
            let found = forces[k] + lambda[0] * columns[0][k] + lambda[1] * columns[1][k];
            assert!((found - rhs[k]).abs() < 1e-12, "{k}: {found:e}, {:e}", rhs[k]);
        }
        assert!((along(&rows[0], x) - rhs[9]).abs() < 1e-12);
        assert!((along(&rows[1], x) - rhs[10]).abs() < 1e-12 * 1e9);
    }
}
