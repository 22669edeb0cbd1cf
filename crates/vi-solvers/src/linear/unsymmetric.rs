//! Solves with a sparse matrix that is not symmetric, by LU factors with partial pivoting. Rows and columns are scaled first,
//! because equations of motion and constraints have different units.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par};

use crate::error::SolverError;
use crate::linear::matrix::SymmetricMatrix;

/// Number of times that the residual of a solution is solved for. One refinement makes the residual of every row small
/// relative to its own entries.
const REFINEMENTS: u32 = 1;

/// A square matrix of moderate size, most of whose entries are zero. All entries are stored, because rigid bodies add to the
/// same few ones thousands of times.
pub(crate) struct Unsymmetric {
    size: usize,
    /// The entries by columns.
    entries: Vec<f64>,
}

impl Unsymmetric {
    /// Returns the zero matrix with this number of rows.
    pub(crate) fn zeros(size: usize) -> Self {
        Self { size, entries: vec![0.0; size * size] }
    }

    /// Adds a value to an entry.
    pub(crate) fn add(&mut self, row: u32, column: u32, value: f64) {
        self.entries[column as usize * self.size + row as usize] += value;
    }

    /// Adds factor · S to the leading rows and columns.
    pub(crate) fn add_symmetric(&mut self, factor: f64, matrix: &SymmetricMatrix) {
        for (row, column, value) in matrix.lower_triangle() {
            let (row, column, value) = (row as u32, column as u32, factor * value);
            self.add(row, column, value);
            if row != column {
                self.add(column, row, value);
            }
        }
    }

    /// Replaces b by the solution of A x = b.
    ///
    /// # Errors
    /// Returns [`SolverError::Singular`] if the matrix is singular or not finite.
    pub(crate) fn solve(mut self, b: &mut [f64]) -> Result<(), SolverError> {
        let [rows, columns] = self.scales()?;
        for (column, scale) in self.entries.chunks_exact_mut(self.size).zip(&columns) {
            column.iter_mut().zip(&rows).for_each(|(value, row)| *value *= row * scale);
        }
        let factored = Factored::new(&self)?;
        let mut rest: Vec<f64> = b.iter().zip(&rows).map(|(b, scale)| b * scale).collect();
        b.fill(0.0);
        for refinement in 0..=REFINEMENTS {
            let mut change = rest.clone();
            factored.solve(&mut change)?;
            b.iter_mut().zip(&change).for_each(|(x, change)| *x += change);
            if refinement < REFINEMENTS {
                factored.subtract_product(&change, &mut rest);
            }
        }
        b.iter_mut().zip(&columns).for_each(|(x, scale)| *x *= scale);
        Ok(())
    }

    /// Returns factors of rows, then of columns, by which the largest entries of columns become one and those of rows at most
    /// one.
    fn scales(&self) -> Result<[Vec<f64>; 2], SolverError> {
        let is_sound = |value: &f64| value.is_finite() && *value > 0.0;
        let inverse = |largest: Vec<f64>| match largest.iter().all(is_sound) {
            true => Ok(largest.iter().map(|value| 1.0 / value).collect::<Vec<f64>>()),
            false => Err(SolverError::Singular { rows: self.size }),
        };
        let mut largest = vec![0.0_f64; self.size];
        for column in self.entries.chunks_exact(self.size) {
            largest.iter_mut().zip(column).for_each(|(largest, value)| *largest = larger(*largest, *value));
        }
        let rows = inverse(largest)?;
        let of_column = |column: &[f64]| {
            column.iter().zip(&rows).fold(0.0, |largest, (value, row)| larger(largest, value * row))
        };
        let columns = inverse(self.entries.chunks_exact(self.size).map(of_column).collect())?;
        Ok([rows, columns])
    }
}

/// Returns the larger size; a value that is not a number counts as infinite.
fn larger(size: f64, value: f64) -> f64 {
    if value.is_nan() { f64::INFINITY } else { size.max(value.abs()) }
}

/// A matrix by columns, with its factors.
struct Factored {
    starts: Vec<u32>,
    rows: Vec<u32>,
    values: Vec<f64>,
    symbolic: SymbolicLu<u32>,
    numeric: NumericLu<u32, f64>,
}

impl Factored {
    fn new(Unsymmetric { size, entries }: &Unsymmetric) -> Result<Self, SolverError> {
        let size = *size;
        let fault = || SolverError::Singular { rows: size };
        let (mut starts, mut rows, mut values) = (vec![0_u32], Vec::new(), Vec::new());
        for column in entries.chunks_exact(size) {
            for (row, value) in column.iter().enumerate().filter(|(_, value)| **value != 0.0) {
                rows.push(row as u32);
                values.push(*value);
            }
            starts.push(rows.len() as u32);
        }
        let pattern = SymbolicSparseColMatRef::new_checked(size, size, &starts, None, &rows);
        let symbolic = factorize_symbolic_lu(pattern, Default::default()).map_err(|_| fault())?;
        let mut numeric = NumericLu::new();
        let scratch = symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| fault())?;
        let matrix = SparseColMatRef::new(pattern, &values);
        let stack = MemStack::new(&mut memory);
        symbolic
            .factorize_numeric_lu(&mut numeric, matrix, Par::Seq, stack, Default::default())
            .map_err(|_| fault())?;
        Ok(Self { starts, rows, values, symbolic, numeric })
    }

    /// Replaces b by the solution of A x = b.
    fn solve(&self, b: &mut [f64]) -> Result<(), SolverError> {
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq);
        let size = b.len();
        let fault = || SolverError::Singular { rows: size };
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| fault())?;
        let column = MatMut::from_column_major_slice_mut(b, size, 1);
        let factor = LuRef::new_unchecked(&self.symbolic, &self.numeric);
        factor.solve_in_place_with_conj(Conj::No, column, Par::Seq, MemStack::new(&mut memory));
        match b.iter().all(|value| value.is_finite()) {
            true => Ok(()),
            false => Err(fault()),
        }
    }

    /// Subtracts A x from `rest`.
    fn subtract_product(&self, x: &[f64], rest: &mut [f64]) {
        for (column, x) in x.iter().enumerate() {
            for entry in self.starts[column] as usize..self.starts[column + 1] as usize {
                rest[self.rows[entry] as usize] -= self.values[entry] * x;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A matrix of 40 rows with a border, zeros on its diagonal, and units that differ by 1e12.
    #[test]
    fn a_bordered_matrix_of_different_units_is_solved() {
        let (size, inner) = (40_u32, 30_u32);
        let unit = |k: u32| if k < inner { 1e-6 } else { 1e6 };
        let entry = |i: u32, j: u32| match (i < inner, j < inner) {
            (false, false) => 0.0,
            _ if i % inner == j % inner => 4.0,
            _ => (f64::from(7 * i + 13 * j)).sin() / f64::from(1 + i.abs_diff(j)),
        };
        let x: Vec<f64> = (0..size).map(|k| f64::from(k).cos() / unit(k)).collect();
        let mut matrix = Unsymmetric::zeros(size as usize);
        let mut b = vec![0.0; size as usize];
        for i in 0..size {
            for j in 0..size {
                // Two summands per entry.
                let value = unit(i) * entry(i, j) * unit(j);
                matrix.add(i, j, 0.25 * value);
                matrix.add(i, j, 0.75 * value);
                b[i as usize] += value * x[j as usize];
            }
        }
        matrix.solve(&mut b).unwrap();
        let error = (0..size).map(|k| (b[k as usize] - x[k as usize]).abs() * unit(k)).fold(0.0, f64::max);
        assert!(error < 1e-12, "{error:e}");
    }

    #[test]
    fn a_singular_matrix_is_an_error() {
        let mut matrix = Unsymmetric::zeros(2);
        matrix.add(0, 0, 1.0);
        assert!(matrix.solve(&mut [1.0, 1.0]).is_err());
    }
}
