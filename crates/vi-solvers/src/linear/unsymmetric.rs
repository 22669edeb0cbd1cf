//! Solves with any sparse matrix, such as a tangent with constraints, by LU factors with partial pivoting. Tangents without
//! constraints have faster factors (`factor/lu.rs`). Rows and columns are scaled first,
//! because equations of motion and constraints have different units: equations with an entry on the diagonal so that this entry
//! becomes ±1, rows and columns of constraints, which have none, so that their largest entry becomes one. The inertia of a grain of .1 mm
//! against rotation is 1e-17 of the entries of constraints. If rows were scaled by their largest entries, it would be lost.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::lu::{LuRef, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par};

use crate::error::SolverError;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::refinement::solve_refined;
use crate::vectors::per_unit;

/// A square matrix, most of whose entries are zero.
#[derive(Default)]
pub(crate) struct Unsymmetric {
    columns: Vec<Column>,
    /// The last pattern that was factored. Its elimination order serves all matrices with the same pattern.
    pattern: Option<Pattern>,
    /// The scaled matrix of the last factors, if there are any.
    scaled: Option<Scaled>,
    /// The last factors. The next ones are stored in the same memory.
    numeric: NumericLu<u32, f64>,
}

/// The entries of a matrix in the order of its pattern, after rows and columns were multiplied by factors.
struct Scaled {
    rows: Vec<f64>,
    columns: Vec<f64>,
    values: Vec<f64>,
}

/// The places of the entries that are not zero, by columns, with their elimination order.
struct Pattern {
    starts: Vec<u32>,
    rows: Vec<u32>,
    symbolic: SymbolicLu<u32>,
}

/// The entries of one column by ascending rows.
#[derive(Default)]
struct Column {
    rows: Vec<u32>,
    values: Vec<f64>,
}

impl Column {
    /// Returns the place of the entry of a row; a new entry is zero.
    fn place_of(&mut self, row: u32) -> usize {
        // Most entries come by ascending rows.
        let is_last = self.rows.last().is_none_or(|last| *last < row);
        let found = if is_last { Err(self.rows.len()) } else { self.rows.binary_search(&row) };
        found.unwrap_or_else(|place| {
            self.rows.insert(place, row);
            self.values.insert(place, 0.0);
            place
        })
    }
}

impl Unsymmetric {
    /// Sets all entries to zero, and the number of rows to `size`.
    pub(crate) fn clear(&mut self, size: usize) {
        self.columns.resize_with(size, Column::default);
        for Column { rows, values } in &mut self.columns {
            rows.clear();
            values.clear();
        }
    }

    /// Adds a value to an entry.
    pub(crate) fn add(&mut self, row: u32, column: u32, value: f64) {
        let column = &mut self.columns[column as usize];
        let place = column.place_of(row);
        column.values[place] += value;
    }

    /// Adds factor · a ⊗ b, where a and b are lists of places and values.
    pub(crate) fn add_outer(&mut self, factor: f64, a: &[(u32, f64)], b: &[(u32, f64)]) {
        for &(column, b) in b {
            let column = &mut self.columns[column as usize];
            let mut next = 0;
            for &(row, a) in a {
                // The coordinates of a node follow each other, mostly also among the entries of the column.
                let place = if column.rows.get(next) == Some(&row) { next } else { column.place_of(row) };
                column.values[place] += factor * a * b;
                next = place + 1;
            }
        }
    }

    /// Adds factor · S to the leading rows and columns. The first matrix after [`Unsymmetric::clear`] costs the least.
    pub(crate) fn add_symmetric(&mut self, factor: f64, matrix: &SymmetricMatrix) {
        for (row, column, value) in matrix.lower_triangle() {
            let (row, column, value) = (row as u32, column as u32, factor * value);
            self.add(row, column, value);
            if row != column {
                self.add(column, row, value);
            }
        }
    }

    /// Factors the matrix for [`Unsymmetric::solve`].
    ///
    /// # Errors
    /// Returns [`SolverError::Singular`] if the matrix is singular or not finite.
    pub(crate) fn factor(&mut self) -> Result<(), SolverError> {
        self.scaled = None;
        let [rows, columns] = self.scales()?;
        let values = self.factor_scaled(&rows, &columns)?;
        self.scaled = Some(Scaled { rows, columns, values });
        Ok(())
    }

    /// Replaces b by the solution of A x = b with the matrix A that was factored last.
    ///
    /// # Errors
    /// Returns [`SolverError::Singular`] if there are no factors, or if the solution is not finite.
    pub(crate) fn solve(&self, b: &mut [f64]) -> Result<(), SolverError> {
        let (Some(pattern), Some(scaled)) = (&self.pattern, &self.scaled) else {
            return Err(SolverError::Singular { rows: b.len() });
        };
        let factored = Factored { pattern, values: &scaled.values, numeric: &self.numeric };
        b.iter_mut().zip(&scaled.rows).for_each(|(b, scale)| *b *= scale);
        solve_refined(b, |b| factored.solve(b), |x, rest| factored.subtract_product(x, rest))?;
        b.iter_mut().zip(&scaled.columns).for_each(|(x, scale)| *x *= scale);
        Ok(())
    }

    /// Returns factors of rows, then of columns; see the head of this file.
    fn scales(&self) -> Result<[Vec<f64>; 2], SolverError> {
        let size = self.columns.len();
        let diagonal = |(k, column): (usize, &Column)| {
            let place = column.rows.binary_search(&(k as u32));
            place.map_or(0.0, |place| larger(0.0, column.values[place]))
        };
        let diagonal: Vec<f64> = self.columns.iter().enumerate().map(diagonal).collect();
        // Take roots in a unit that is a power of two, so that the factors do not depend on units.
        let first = diagonal.iter().copied().find(|entry| *entry != 0.0);
        let per_unit = first.map_or(1.0, per_unit);
        let of_columns: Vec<f64> = diagonal
            .iter()
            .map(|&entry| if entry == 0.0 { 1.0 } else { 1.0 / (per_unit * entry).sqrt() })
            .collect();
        let of_rows: Vec<f64> = of_columns
            .iter()
            .zip(&diagonal)
            .map(|(&factor, &entry)| if entry == 0.0 { 1.0 } else { per_unit * factor })
            .collect();
        let (mut rows, mut columns) = (vec![0.0_f64; size], vec![0.0_f64; size]);
        for (j, column) in self.columns.iter().enumerate() {
            for (&i, &value) in column.rows.iter().zip(&column.values) {
                let i = i as usize;
                rows[i] = larger(rows[i], value * of_columns[j]);
                columns[j] = larger(columns[j], value * of_rows[i]);
            }
        }
        let is_sound = |value: &f64| value.is_finite() && *value > 0.0;
        if !rows.iter().chain(&columns).all(is_sound) {
            return Err(SolverError::Singular { rows: size });
        }
        for (largest, of_motion) in [(&mut rows, &of_rows), (&mut columns, &of_columns)] {
            for (k, value) in largest.iter_mut().enumerate() {
                *value = if diagonal[k] == 0.0 { 1.0 / *value } else { of_motion[k] };
            }
        }
        Ok([rows, columns])
    }

    /// Factors the scaled matrix; returns its entries.
    fn factor_scaled(&mut self, of_rows: &[f64], of_columns: &[f64]) -> Result<Vec<f64>, SolverError> {
        let size = self.columns.len();
        let fault = || SolverError::Singular { rows: size };
        let (mut starts, mut rows, mut values) = (vec![0_u32], Vec::new(), Vec::new());
        for (column, scale) in self.columns.iter().zip(of_columns) {
            let entries = column.rows.iter().zip(&column.values);
            for (&row, &value) in entries.filter(|(_, value)| **value != 0.0) {
                rows.push(row);
                values.push(value * (of_rows[row as usize] * scale));
            }
            starts.push(rows.len() as u32);
        }
        self.pattern.take_if(|kept| kept.starts != starts || kept.rows != rows);
        let pattern = match &mut self.pattern {
            Some(pattern) => pattern,
            none => none.insert(Pattern::new(starts, rows).ok_or_else(fault)?),
        };
        let numeric = &mut self.numeric;
        let scratch = pattern.symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| fault())?;
        let matrix = SparseColMatRef::new(places(&pattern.starts, &pattern.rows), &values);
        let stack = MemStack::new(&mut memory);
        pattern
            .symbolic
            .factorize_numeric_lu(numeric, matrix, Par::Seq, stack, Default::default())
            .map_err(|_| fault())?;
        Ok(values)
    }
}

impl Pattern {
    /// Chooses the elimination order; `None` if memory does not suffice.
    fn new(starts: Vec<u32>, rows: Vec<u32>) -> Option<Self> {
        let symbolic = factorize_symbolic_lu(places(&starts, &rows), Default::default()).ok()?;
        Some(Self { starts, rows, symbolic })
    }
}

/// Returns the pattern of a square matrix as the solver of linear systems takes it.
fn places<'a>(starts: &'a [u32], rows: &'a [u32]) -> SymbolicSparseColMatRef<'a, u32> {
    let size = starts.len() - 1;
    SymbolicSparseColMatRef::new_checked(size, size, starts, None, rows)
}

/// Returns the larger size; a value that is not a number counts as infinite.
fn larger(size: f64, value: f64) -> f64 {
    if value.is_nan() { f64::INFINITY } else { size.max(value.abs()) }
}

/// A matrix by columns, with its factors.
struct Factored<'a> {
    pattern: &'a Pattern,
    values: &'a [f64],
    numeric: &'a NumericLu<u32, f64>,
}

impl Factored<'_> {
    /// Replaces b by the solution of A x = b.
    fn solve(&self, b: &mut [f64]) -> Result<(), SolverError> {
        let scratch = self.pattern.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq);
        let size = b.len();
        let fault = || SolverError::Singular { rows: size };
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| fault())?;
        let column = MatMut::from_column_major_slice_mut(b, size, 1);
        let factor = LuRef::new_unchecked(&self.pattern.symbolic, self.numeric);
        factor.solve_in_place_with_conj(Conj::No, column, Par::Seq, MemStack::new(&mut memory));
        match b.iter().all(|value| value.is_finite()) {
            true => Ok(()),
            false => Err(fault()),
        }
    }

    /// Subtracts A x from `rest`.
    fn subtract_product(&self, x: &[f64], rest: &mut [f64]) {
        let Pattern { starts, rows, .. } = self.pattern;
        for (column, x) in x.iter().enumerate() {
            for entry in starts[column] as usize..starts[column + 1] as usize {
                rest[rows[entry] as usize] -= self.values[entry] * x;
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
        let mut matrix = Unsymmetric::default();
        matrix.clear(size as usize);
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
        matrix.factor().unwrap();
        matrix.solve(&mut b).unwrap();
        let error = (0..size).map(|k| (b[k as usize] - x[k as usize]).abs() * unit(k)).fold(0.0, f64::max);
        assert!(error < 1e-12, "{error:e}");
    }

    /// The second system has other values and a further entry; the third one has the pattern of the second.
    #[test]
    fn a_kept_pattern_serves_other_values() {
        let size = 30_u32;
        let mut matrix = Unsymmetric::default();
        for round in 0..3_u32 {
            matrix.clear(size as usize);
            let mut rows = vec![vec![0.0; size as usize]; size as usize];
            for i in 0..size {
                let next = (i + 1) % size;
                let further = if round > 0 { (i + 7) % size } else { i };
                for (j, value) in [(i, 3.0), (next, f64::from(i + round).sin()), (further, 0.3)] {
                    matrix.add(i, j, value);
                    rows[i as usize][j as usize] += value;
                }
            }
            let x: Vec<f64> = (0..size).map(|k| f64::from(k + round).cos()).collect();
            let product = |row: &Vec<f64>| row.iter().zip(&x).map(|(a, x)| a * x).sum::<f64>();
            let mut b: Vec<f64> = rows.iter().map(product).collect();
            matrix.factor().unwrap();
            matrix.solve(&mut b).unwrap();
            let error = b.iter().zip(&x).map(|(b, x)| (b - x).abs()).fold(0.0, f64::max);
            assert!(error < 1e-13, "{round}: {error:e}");
        }
    }

    /// The tangent of a body with inertia a against turns, of which `constraints` with entries of one leave some free: [a I, Gᵀ; G, 0].
    #[test]
    fn small_inertia_beside_constraints_is_not_lost() {
        for inertia in [1.0, 1e-8, 1e-17, 1e-30] {
            let mut matrix = Unsymmetric::default();
            let (size, free) = (9_u32, 6_u32);
            matrix.clear(size as usize);
            for i in 0..free {
                matrix.add(i, i, inertia * f64::from(i + 1));
                for c in free..size {
                    let entry = f64::from(7 * i * c + i).sin();
                    matrix.add(i, c, entry);
                    matrix.add(c, i, entry);
                }
            }
            let x: Vec<f64> =
                (0..size).map(|k| f64::from(k).cos() * if k < free { 1.0 } else { inertia }).collect();
            let mut b = vec![0.0; size as usize];
            for (j, column) in matrix.columns.iter().enumerate() {
                column.rows.iter().zip(&column.values).for_each(|(&i, value)| b[i as usize] += value * x[j]);
            }
            matrix.factor().unwrap();
            matrix.solve(&mut b).unwrap();
            let error = (0..free as usize).map(|k| (b[k] - x[k]).abs()).fold(0.0, f64::max);
            assert!(error < 1e-13, "{inertia:e}: {error:e}");
        }
    }

    #[test]
    fn a_singular_matrix_is_an_error() {
        let mut matrix = Unsymmetric::default();
        matrix.clear(2);
        matrix.add(0, 0, 1.0);
        assert!(matrix.factor().is_err());
        assert!(matrix.solve(&mut [1.0, 1.0]).is_err());
    }
}
