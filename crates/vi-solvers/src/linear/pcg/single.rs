//! A in single precision by rows, for solves to a loose tolerance.
//!
//! The matrix itself is stored in the order of the assembly, and only its lower triangle. A product gathers its blocks
//! from many places. For a solve of many iterations it is cheaper to copy both triangles in the order of the rows, in
//! single precision: P1 n16, h = 10 ms, one thread, 4.7 ms per product before and 1.0 ms with the copy; 20 steps took
//! 5.4 s before and 3.5 s after, with as many iterations.

use std::ops::Range;

use pulp::Arch;
use rayon::prelude::*;

use crate::linear::matrix::SymmetricMatrix;

/// Number of rows that one task of a product computes.
const ROWS_PER_TASK: usize = 512;

/// Rows of A in single precision.
#[derive(Default)]
pub(super) struct SingleRows {
    /// Row k of these has the blocks `start[k]..start[k + 1]`.
    start: Vec<u32>,
    columns: Vec<u32>,
    /// One block per entry in column-major order, and numbers behind the last block for loads of whole lanes.
    values: Vec<f32>,
}

impl SingleRows {
    /// Returns the bytes of memory held for a matrix with this number of rows and of blocks in the lower triangle.
    pub(super) fn bytes(block: usize, rows: usize, entries: usize) -> usize {
        (2 * entries - rows) * (4 * block * block + 4) + 4 * rows
    }

    /// Copies these rows of A.
    pub(super) fn copy(&mut self, a: &SymmetricMatrix, rows: Range<usize>) {
        let pattern = &*a.pattern;
        if self.start.is_empty() {
            self.start.push(0);
            for row in rows.clone() {
                self.columns.extend(pattern.row(row).map(|entry| pattern.columns[entry]));
                self.columns.extend(pattern.upper(row).map(|(row, _)| row));
                self.start.push(self.columns.len() as u32);
            }
            let area = pattern.block * pattern.block;
            self.values =
                vec![0.0; self.columns.len() * area + pattern.block.next_power_of_two() - pattern.block];
        }
        match pattern.block {
            3 => self.copy_blocks::<3>(a, rows),
            2 => self.copy_blocks::<2>(a, rows),
            _ => self.copy_blocks::<1>(a, rows),
        }
    }

    fn copy_blocks<const B: usize>(&mut self, a: &SymmetricMatrix, rows: Range<usize>) {
        let pattern = &*a.pattern;
        let (values, _) = a.values.as_chunks::<B>();
        let mut rest = &mut self.values[..];
        let mut tasks = Vec::new();
        for first in rows.clone().step_by(ROWS_PER_TASK) {
            let task = first..(first + ROWS_PER_TASK).min(rows.end);
            let blocks = self.start[task.end - rows.start] - self.start[first - rows.start];
            let (own, others) = rest.split_at_mut(blocks as usize * B * B);
            rest = others;
            tasks.push((task, own));
        }
        tasks.into_par_iter().for_each(|(rows, out)| {
            let (out, _) = out.as_chunks_mut::<B>();
            let mut out = out.chunks_exact_mut(B);
            for row in rows {
                let lower = pattern.row(row).map(|entry| (pattern.places[entry], true));
                let upper = pattern.upper(row).map(|(_, place)| (place, false));
                for ((place, is_lower), out) in lower.chain(upper).zip(&mut out) {
                    let block = &values[place as usize * B..][..B];
                    for j in 0..B {
                        for i in 0..B {
                            out[j][i] = if is_lower { block[i][j] } else { block[j][i] } as f32;
                        }
                    }
                }
            }
        });
    }

    /// Computes y = A x at the rows that were copied, in vectors of rows · block entries; `y` has only these rows.
    pub(super) fn multiply(&self, block: usize, x: &[f64], y: &mut [f64]) {
        match block {
            3 => self.multiply_blocks::<3, 4>(x, y),
            2 => self.multiply_blocks::<2, 2>(x, y),
            _ => self.multiply_blocks::<1, 1>(x, y),
        }
    }

    fn multiply_blocks<const B: usize, const W: usize>(&self, x: &[f64], y: &mut [f64]) {
        let (x, _) = x.as_chunks::<B>();
        let (y, _) = y.as_chunks_mut::<B>();
        y.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(|(task, y)| {
            Arch::new().dispatch(|| self.multiply_task::<B, W>(task * ROWS_PER_TASK, x, y));
        });
    }

    /// Multiplies the rows from `first` on, as many as `y` has. The lanes are the coordinates of a row; the lanes after
    /// the last coordinate hold numbers of the next block, which are not used.
    #[inline(always)]
    fn multiply_task<const B: usize, const W: usize>(
        &self,
        first: usize,
        x: &[[f64; B]],
        y: &mut [[f64; B]],
    ) {
        for (row, y) in (first..).zip(y) {
            let mut sum = [0.0; W];
            for entry in self.start[row] as usize..self.start[row + 1] as usize {
                let x = &x[self.columns[entry] as usize];
                let block = &self.values[entry * B * B..][..B * (B - 1) + W];
                for j in 0..B {
                    for lane in 0..W {
                        sum[lane] += f64::from(block[j * B + lane]) * x[j];
                    }
                }
            }
            *y = std::array::from_fn(|i| sum[i]);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::index::NONE;
    use crate::linear::matrix::Pattern;

    /// Returns a symmetric matrix with entries between −1 and 1 in a band, and one prescribed coordinate.
    fn band(block: usize, rows: u32) -> SymmetricMatrix {
        let entries: Vec<(u32, u32)> = (0..rows)
            .flat_map(|row| {
                let columns = (0..=row).filter(move |column| row - column < 3 || (row + column) % 97 == 0);
                columns.map(move |column| (row, column))
            })
            .collect();
        // The assembly has its own order.
        let places = (0..entries.len() as u32).rev().collect();
        let mut free_of: Vec<u32> = (0..rows * block as u32).collect();
        free_of[7] = NONE;
        let mut matrix = SymmetricMatrix::zeros(Arc::new(Pattern::new(block, &entries, places, free_of)));
        let area = block * block;
        for (entry, &(row, column)) in entries.iter().enumerate() {
            let place = (entries.len() - 1 - entry) * area;
            for (i, j) in (0..area).map(|k| (k / block, k % block)) {
                let (a, b) = (row as usize * block + i, column as usize * block + j);
                let value = (0.7 * (a.max(b) * 31 + a.min(b)) as f64).sin();
                matrix.values[place + i * block + j] = if a == 7 || b == 7 { 0.0 } else { value };
            }
        }
        matrix
    }

    #[test]
    fn products_differ_by_the_rounding_of_the_entries() {
        for block in [1, 2, 3] {
            let matrix = band(block, 1200);
            let x: Vec<f64> = (0..1200 * block).map(|k| (0.3 * k as f64).cos()).collect();
            let (mut exact, mut product) = (vec![0.0; x.len()], vec![0.0; x.len()]);
            matrix.multiply_padded(&x, &mut exact);
            let mut single = SingleRows::default();
            // Copies of some rows and of all rows give the same bits.
            single.copy(&matrix, 600..1200);
            let mut half = vec![0.0; 600 * block];
            single.multiply(block, &x, &mut half);
            let mut single = SingleRows::default();
            single.copy(&matrix, 0..1200);
            single.multiply(block, &x, &mut product);
            assert_eq!(half, product[600 * block..]);
            let error = exact.iter().zip(&product).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
            assert!(error > 0.0 && error < 60.0 * f64::from(f32::EPSILON), "{block}: {error}");
        }
    }
}
