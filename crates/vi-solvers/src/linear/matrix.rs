//! A sparse symmetric matrix on the free coordinates, in dense nodal blocks.
//!
//! Rows are the nodes with at least one free coordinate. The lower triangle is stored, with one full block per entry
//! and each value once. The values are in the order of the assembly (what one chunk of stencils writes is
//! contiguous); rows find them through `places`. At a node with free coordinates, a prescribed coordinate has zero
//! rows and columns.

use std::ops::Range;
use std::sync::Arc;

use rayon::prelude::*;

use crate::index::{NONE, group_by};
use crate::linear::ordering::Graph;
use crate::scratch::with_scratch;

/// Number of rows that one task of a product computes.
const ROWS_PER_TASK: usize = 512;

/// With fewer block entries than this, the calling thread computes a product alone.
const PARALLEL_ENTRIES: usize = 12_000;

/// The positions of the entries of a matrix, shared by all matrices of a system.
pub(crate) struct Pattern {
    /// Number of coordinates per node.
    pub(crate) block: usize,
    pub(crate) free_count: usize,
    /// Row r has the entries `row_start[r]..row_start[r + 1]`, with ascending columns and the diagonal last.
    pub(crate) row_start: Vec<u32>,
    pub(crate) columns: Vec<u32>,
    /// Entry e has its block at `places[e]` of the values.
    pub(crate) places: Vec<u32>,
    /// The entries below the diagonal by column, as rows and places.
    upper_start: Vec<u32>,
    upper_rows: Vec<u32>,
    upper_places: Vec<u32>,
    /// Index of the free coordinate `row · block + k`, or `NONE`.
    pub(crate) free_of: Vec<u32>,
    /// Whether any node has both free and prescribed coordinates.
    pub(crate) has_partial_nodes: bool,
}

impl Pattern {
    /// Builds a pattern from the lower-triangle entries (row, column), sorted and with all diagonal entries, from
    /// their places, and from the free index (or `NONE`) of each coordinate of each row.
    pub(crate) fn new(block: usize, entries: &[(u32, u32)], places: Vec<u32>, free_of: Vec<u32>) -> Self {
        let row_count = free_of.len() / block;
        let mut row_start = vec![0_u32; row_count + 1];
        for &(row, _) in entries {
            row_start[row as usize + 1] += 1;
        }
        for row in 0..row_count {
            row_start[row + 1] += row_start[row];
        }
        let columns: Vec<u32> = entries.iter().map(|entry| entry.1).collect();
        let below: Vec<usize> = (0..entries.len()).filter(|&e| entries[e].0 != entries[e].1).collect();
        let keys: Vec<u32> = below.iter().map(|&e| entries[e].1).collect();
        let (upper_start, order) = group_by(&keys, row_count);
        let upper_rows = order.iter().map(|&k| entries[below[k as usize]].0).collect();
        let upper_places = order.iter().map(|&k| places[below[k as usize]]).collect();
        let free_count = free_of.iter().filter(|&&free| free != NONE).count();
        let has_partial_nodes = free_count != free_of.len();
        Self {
            block,
            free_count,
            row_start,
            columns,
            places,
            upper_start,
            upper_rows,
            upper_places,
            free_of,
            has_partial_nodes,
        }
    }

    pub(crate) fn row_count(&self) -> usize {
        self.row_start.len() - 1
    }

    /// Returns the entries of a row, the diagonal last.
    pub(crate) fn row(&self, row: usize) -> Range<usize> {
        self.row_start[row] as usize..self.row_start[row + 1] as usize
    }

    /// Returns the entries above the diagonal of the row `column`, stored as (row, place) of the lower triangle with
    /// row > column.
    pub(crate) fn upper(&self, column: usize) -> impl Iterator<Item = (u32, u32)> + '_ {
        let range = self.upper_start[column] as usize..self.upper_start[column + 1] as usize;
        range.map(|k| (self.upper_rows[k], self.upper_places[k]))
    }

    /// Returns the entries in row order, as rows, columns and indices.
    pub(crate) fn entries(&self) -> impl Iterator<Item = (u32, u32, usize)> + '_ {
        let rows = 0..self.row_count();
        rows.flat_map(move |row| self.row(row).map(move |entry| (row as u32, self.columns[entry], entry)))
    }

    /// Returns the index of the entry at a row and a column that is not after it, if there is one.
    pub(crate) fn entry(&self, row: usize, column: usize) -> Option<usize> {
        let range = self.row(row);
        let found = self.columns[range.clone()].binary_search(&(column as u32)).ok()?;
        Some(range.start + found)
    }

    /// Returns the place of the diagonal block of a row.
    pub(crate) fn diagonal_place(&self, row: usize) -> usize {
        self.places[self.row_start[row + 1] as usize - 1] as usize
    }

    /// Returns the entries of the diagonal that belong to free coordinates: their place among the values, and the coordinate.
    pub(crate) fn free_diagonal(&self) -> impl Iterator<Item = (usize, usize)> {
        let block = self.block;
        (0..self.row_count()).flat_map(move |row| {
            let place = self.diagonal_place(row) * block * block;
            let free = self.free_of[row * block..][..block].iter().enumerate();
            let free = free.filter(|(_, free)| **free != NONE);
            free.map(move |(k, &free)| (place + k * block + k, free as usize))
        })
    }

    /// Spreads the free coordinates of a vector over rows · block entries, with zeros between.
    pub(crate) fn spread(&self, free: &[f64], padded: &mut [f64]) {
        for (value, &k) in padded.iter_mut().zip(&self.free_of) {
            *value = if k == NONE { 0.0 } else { free[k as usize] };
        }
    }

    /// Collects the free coordinates again: the inverse of `spread`.
    pub(crate) fn collect(&self, padded: &[f64], free: &mut [f64]) {
        for (value, &k) in padded.iter().zip(&self.free_of) {
            if k != NONE {
                free[k as usize] = *value;
            }
        }
    }

    /// Returns the graph of the rows, with an edge between two nodes that share an entry.
    pub(crate) fn graph(&self) -> Graph {
        let block = self.block;
        let (mut start, mut neighbours) = (vec![0], Vec::new());
        let mut weights = Vec::new();
        for row in 0..self.row_count() {
            let lower = self.row(row);
            neighbours.extend(self.columns[lower.start..lower.end - 1].iter().map(|&column| column as i32));
            let upper = self.upper_start[row] as usize..self.upper_start[row + 1] as usize;
            neighbours.extend(self.upper_rows[upper].iter().map(|&row| row as i32));
            start.push(neighbours.len() as i32);
            let free = self.free_of[row * block..(row + 1) * block].iter().filter(|&&k| k != NONE);
            weights.push(free.count() as i32);
        }
        Graph { start, neighbours, weights }
    }

    fn bytes(&self) -> usize {
        4 * (self.row_start.len() + 2 * self.columns.len() + self.upper_start.len())
            + 4 * (2 * self.upper_rows.len() + self.free_of.len())
    }
}

/// A symmetric matrix on the free coordinates q.
#[derive(Clone)]
pub struct SymmetricMatrix {
    pub(crate) pattern: Arc<Pattern>,
    /// block × block numbers per place, row-major; a diagonal block also stores its transposed part.
    pub(crate) values: Vec<f64>,
}

impl SymmetricMatrix {
    /// Returns the zero matrix of a pattern.
    pub(crate) fn zeros(pattern: Arc<Pattern>) -> Self {
        let values = vec![0.0; pattern.columns.len() * pattern.block * pattern.block];
        Self { pattern, values }
    }

    /// Returns the number of rows and columns.
    pub fn free_count(&self) -> usize {
        self.pattern.free_count
    }

    /// Returns the number of entries of the whole matrix that are stored, zero or not.
    pub fn nnz(&self) -> usize {
        let rows = self.pattern.row_count();
        (2 * self.pattern.columns.len() - rows) * self.pattern.block * self.pattern.block
    }

    /// Returns the size of pattern and values in bytes.
    pub fn bytes(&self) -> usize {
        self.pattern.bytes() + 8 * self.values.len()
    }

    /// Returns whether both matrices have the same pattern, so that a factor for one can hold the other.
    pub fn has_pattern_of(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.pattern, &other.pattern)
    }

    /// Returns the stored entries of the lower triangle as (row, column, value) with row ≥ column, in no particular
    /// order.
    pub fn lower_triangle(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        let pattern = &*self.pattern;
        let block = pattern.block;
        let rows = (0..pattern.row_count()).flat_map(|row| pattern.row(row).map(move |entry| (row, entry)));
        rows.flat_map(move |(row, entry)| {
            let (column, place) = (pattern.columns[entry] as usize, pattern.places[entry] as usize);
            (0..block * block).filter_map(move |k| {
                let (i, j) = (row * block + k / block, column * block + k % block);
                let (i, j) = (pattern.free_of[i], pattern.free_of[j]);
                let is_lower = i != NONE && j != NONE && i >= j;
                is_lower.then(|| (i as usize, j as usize, self.values[place * block * block + k]))
            })
        })
    }

    /// Returns whether all entries are zero.
    pub(crate) fn is_zero(&self) -> bool {
        self.values.iter().all(|value| *value == 0.0)
    }

    /// Writes the diagonal.
    pub fn diagonal(&self, out: &mut [f64]) {
        for (place, free) in self.pattern.free_diagonal() {
            out[free] = self.values[place];
        }
    }

    /// Sets self = diag(mass) + c·k on the pattern of k; an empty `mass` means zero.
    pub(crate) fn set_shifted(&mut self, mass: &[f64], c: f64, k: &Self) {
        debug_assert!(self.has_pattern_of(k));
        const PIECE: usize = 1 << 16;
        let scale = |(out, k): (&mut [f64], &[f64])| {
            for (out, k) in out.iter_mut().zip(k) {
                *out = c * k;
            }
        };
        if k.values.len() > 2 * PIECE {
            self.values.par_chunks_mut(PIECE).zip(k.values.par_chunks(PIECE)).for_each(scale);
        } else {
            scale((&mut self.values, &k.values));
        }
        if mass.is_empty() {
            return;
        }
        for (place, free) in self.pattern.free_diagonal() {
            self.values[place] += mass[free];
        }
    }

    /// Multiplies the row and the column of each free coordinate by its factor.
    pub(crate) fn scale(&mut self, factors: &[f64]) {
        let Self { pattern, values } = self;
        let block = pattern.block;
        with_scratch(pattern.free_of.len(), |padded| {
            pattern.spread(factors, padded);
            for row in 0..pattern.row_count() {
                for entry in pattern.row(row) {
                    let (column, place) = (pattern.columns[entry] as usize, pattern.places[entry] as usize);
                    let of_columns = &padded[column * block..][..block];
                    let values = values[place * block * block..][..block * block].chunks_exact_mut(block);
                    for (values, of_row) in values.zip(&padded[row * block..][..block]) {
                        values
                            .iter_mut()
                            .zip(of_columns)
                            .for_each(|(value, of_column)| *value *= of_row * of_column);
                    }
                }
            }
        });
    }

    /// Computes y = K x.
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        if !self.pattern.has_partial_nodes {
            return self.multiply_padded(x, y);
        }
        let length = self.pattern.free_of.len();
        with_scratch(2 * length, |scratch| {
            let (x_padded, y_padded) = scratch.split_at_mut(length);
            self.pattern.spread(x, x_padded);
            self.multiply_padded(x_padded, y_padded);
            self.pattern.collect(y_padded, y);
        });
    }

    /// Computes y = K x in vectors of rows · block entries.
    pub(crate) fn multiply_padded(&self, x: &[f64], y: &mut [f64]) {
        self.multiply_rows(0..self.pattern.row_count(), x, y);
    }

    /// Computes y = K x at some rows, in vectors of rows · block entries.
    pub(crate) fn multiply_rows(&self, rows: Range<usize>, x: &[f64], y: &mut [f64]) {
        let y = &mut y[rows.start * self.pattern.block..rows.end * self.pattern.block];
        match self.pattern.block {
            3 => self.multiply_blocks::<3>(rows.start, x, y),
            2 => self.multiply_blocks::<2>(rows.start, x, y),
            _ => self.multiply_blocks::<1>(rows.start, x, y),
        }
    }

    /// Computes the rows of K x from `first` on, as many as fit in `y`.
    fn multiply_blocks<const B: usize>(&self, first: usize, x: &[f64], y: &mut [f64]) {
        let pattern = &*self.pattern;
        let (values, _) = self.values.as_chunks::<B>();
        let (x, _) = x.as_chunks::<B>();
        let (y, _) = y.as_chunks_mut::<B>();
        let product = |(task, out): (usize, &mut [[f64; B]])| {
            for (row, out) in (first + task * ROWS_PER_TASK..).zip(out) {
                let mut sum = [0.0; B];
                for entry in pattern.row(row) {
                    let place = pattern.places[entry] as usize * B;
                    let (a, x) = (&values[place..place + B], &x[pattern.columns[entry] as usize]);
                    for i in 0..B {
                        for j in 0..B {
                            sum[i] += a[i][j] * x[j];
                        }
                    }
                }
                for k in pattern.upper_start[row] as usize..pattern.upper_start[row + 1] as usize {
                    let place = pattern.upper_places[k] as usize * B;
                    let (a, x) = (&values[place..place + B], &x[pattern.upper_rows[k] as usize]);
                    for j in 0..B {
                        for i in 0..B {
                            sum[i] += a[j][i] * x[j];
                        }
                    }
                }
                *out = sum;
            }
        };
        if pattern.columns.len() >= PARALLEL_ENTRIES {
            y.par_chunks_mut(ROWS_PER_TASK).enumerate().for_each(product);
        } else {
            y.chunks_mut(ROWS_PER_TASK).enumerate().for_each(product);
        }
    }
}
