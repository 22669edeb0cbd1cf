//! The Hessian of a system with tied nodes, K = SᵀK̂S. K̂ is summed as if tied nodes were free. Then each nodal block
//! is added to the pairs of nodes to which its two nodes are tied, times both weights, through a map that is built
//! once. Blocks of nodes with their own axes are rotated to these, R_a K_ab R_bᵀ. Systems without such nodes do not
//! use this file.

use std::sync::Arc;

use rayon::prelude::*;
use vi_core::Terms;

use crate::index::NONE;
use crate::linear::matrix::{Pattern, SymmetricMatrix};

/// Orthonormal axes of a node, one per row.
type Axes = [[f64; 3]; 3];

/// With fewer entries than this, the calling thread computes the sum alone.
const PARALLEL_ENTRIES: usize = 12_000;

/// The form in which a block is added to an entry of the lower triangle.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Plain,
    Transposed,
    /// Block plus transpose, because both halves belong to the diagonal.
    Both,
}

/// A block of K̂ with its factor.
#[derive(Clone, Copy)]
struct Part {
    place: u32,
    side: Side,
    weight: f64,
}

/// The map from K̂ to K, and K.
pub(crate) struct TiedHessian {
    /// Entry e is the sum of `parts[start[e]..start[e + 1]]`.
    start: Vec<u32>,
    parts: Vec<Part>,
    /// Blocks with rows or columns of prescribed coordinates: entry, row, column.
    masked: Vec<(u32, u32, u32)>,
    /// Blocks of nodes with their own axes: entry, axes of the row's node, axes of the column's node.
    rotated: Vec<(u32, Option<Axes>, Option<Axes>)>,
    matrix: SymmetricMatrix,
}

impl TiedHessian {
    /// Builds the map from the rows `full_row_of` of K̂, which include tied nodes, to the rows without them
    /// (`row_of`, `free_of`). Returns `None` if no node is tied.
    pub(crate) fn new(
        terms: &Terms,
        full: &SymmetricMatrix,
        full_row_of: &[u32],
        row_of: &[u32],
        free_of: Vec<u32>,
    ) -> Option<Self> {
        if terms.coordinates().is_plain() {
            return None;
        }
        let block = full.pattern.block;
        // For each row of K̂, find the rows of K to which it contributes.
        let mut sums: Vec<Vec<(u32, f64)>> = vec![Vec::new(); full.pattern.row_count()];
        for (node, &full_row) in full_row_of.iter().enumerate() {
            if full_row != NONE && row_of[node] != NONE {
                sums[full_row as usize].push((row_of[node], 1.0));
            }
        }
        let split = 3 / block as u32;
        for (node, terms) in terms.coordinates().combinations() {
            for part in 0..split {
                let sum = &mut sums[full_row_of[(node * split + part) as usize] as usize];
                for &(k, weight) in terms {
                    let row = row_of[(k * split + part) as usize];
                    if row != NONE {
                        sum.push((row, weight));
                    }
                }
            }
        }
        let mut touched: Vec<(u64, Part)> = Vec::new();
        let key = |row: u32, column: u32| u64::from(row) << 32 | u64::from(column);
        for row in 0..full.pattern.row_count() {
            for entry in full.pattern.row(row) {
                let (column, place) = (full.pattern.columns[entry] as usize, full.pattern.places[entry]);
                for &(a, w) in &sums[row] {
                    for &(b, v) in &sums[column] {
                        let (weight, diagonal) = (w * v, row == column);
                        let side = match a.cmp(&b) {
                            std::cmp::Ordering::Greater => Side::Plain,
                            std::cmp::Ordering::Equal if diagonal => Side::Plain,
                            std::cmp::Ordering::Equal => Side::Both,
                            // The pair (b, a) of the same block covers it.
                            std::cmp::Ordering::Less if diagonal => continue,
                            std::cmp::Ordering::Less => Side::Transposed,
                        };
                        touched.push((key(a.max(b), a.min(b)), Part { place, side, weight }));
                    }
                }
            }
        }
        // The sort is stable: the parts of an entry stay in the order of K̂.
        touched.par_sort_by_key(|touch| touch.0);
        let row_count = free_of.len() / block;
        let (mut entries, mut start, mut parts) = (Vec::new(), vec![0], Vec::with_capacity(touched.len()));
        let mut next_row = 0;
        let mut diagonals_to =
            |row: u32, entries: &mut Vec<(u32, u32)>, start: &mut Vec<u32>, count: usize| {
                // Add the diagonal even if nothing contributes to it.
                while next_row < row {
                    if entries.last() != Some(&(next_row, next_row)) {
                        entries.push((next_row, next_row));
                        start.push(count as u32);
                    }
                    next_row += 1;
                }
            };
        for group in touched.chunk_by(|a, b| a.0 == b.0) {
            let (row, column) = ((group[0].0 >> 32) as u32, group[0].0 as u32);
            diagonals_to(row, &mut entries, &mut start, parts.len());
            parts.extend(group.iter().map(|touch| touch.1));
            entries.push((row, column));
            start.push(parts.len() as u32);
        }
        diagonals_to(row_count as u32, &mut entries, &mut start, parts.len());
        let partially_free =
            |row: u32| free_of[row as usize * block..(row as usize + 1) * block].contains(&NONE);
        let masked = (0_u32..)
            .zip(&entries)
            .filter(|(_, entry)| partially_free(entry.0) || partially_free(entry.1))
            .map(|(place, &(row, column))| (place, row, column))
            .collect();
        // Only nodes of three coordinates have axes, and then blocks have three rows.
        let mut axes_of: Vec<Option<[[f64; 3]; 3]>> = vec![None; row_count];
        for own in terms.coordinates().node_axes().iter().filter(|_| block == 3) {
            let row = row_of[own.node as usize];
            if row != NONE {
                axes_of[row as usize] = Some(own.axes);
            }
        }
        let axes = |row: u32| axes_of[row as usize];
        let rotated = (0_u32..)
            .zip(&entries)
            .filter(|(_, entry)| axes(entry.0).is_some() || axes(entry.1).is_some())
            .map(|(place, &(row, column))| (place, axes(row), axes(column)))
            .collect();
        let places = (0..entries.len() as u32).collect();
        let matrix = SymmetricMatrix::zeros(Arc::new(Pattern::new(block, &entries, places, free_of)));
        Some(Self { start, parts, masked, rotated, matrix })
    }

    pub(crate) fn matrix(&self) -> &SymmetricMatrix {
        &self.matrix
    }

    pub(crate) fn bytes(&self) -> usize {
        4 * self.start.len() + size_of::<Part>() * self.parts.len() + self.matrix.bytes()
    }

    /// Computes K from K̂.
    pub(crate) fn pull_back(&mut self, full: &SymmetricMatrix) {
        let block = self.matrix.pattern.block;
        let size = block * block;
        let (start, parts, from) = (&self.start, &self.parts, &full.values);
        let sum = |(entry, out): (usize, &mut [f64])| {
            out.fill(0.0);
            for part in &parts[start[entry] as usize..start[entry + 1] as usize] {
                let value = &from[part.place as usize * size..][..size];
                for i in 0..block {
                    for j in 0..block {
                        out[i * block + j] += part.weight
                            * match part.side {
                                Side::Plain => value[i * block + j],
                                Side::Transposed => value[j * block + i],
                                Side::Both => value[i * block + j] + value[j * block + i],
                            };
                    }
                }
            }
        };
        let values = &mut self.matrix.values;
        if start.len() > PARALLEL_ENTRIES {
            values.par_chunks_mut(size).enumerate().for_each(sum);
        } else {
            values.chunks_mut(size).enumerate().for_each(sum);
        }
        for (place, of_row, of_column) in &self.rotated {
            rotate(&mut values[*place as usize * size..][..size], of_row, of_column);
        }
        let free_of = &self.matrix.pattern.free_of;
        let prescribed = |row: u32, k: usize| free_of[row as usize * block + k] == NONE;
        for &(place, row, column) in &self.masked {
            for (k, value) in values[place as usize * size..][..size].iter_mut().enumerate() {
                if prescribed(row, k / block) || prescribed(column, k % block) {
                    *value = 0.0;
                }
            }
        }
    }
}

/// Computes K ← R_a K R_bᵀ. The rows of R are the axes of a node; `None` means the axes of space.
fn rotate(block: &mut [f64], of_row: &Option<[[f64; 3]; 3]>, of_column: &Option<[[f64; 3]; 3]>) {
    if let Some(axes) = of_row {
        for j in 0..3 {
            let column = [0, 1, 2].map(|i| block[3 * i + j]);
            for (i, e) in axes.iter().enumerate() {
                block[3 * i + j] = e[0] * column[0] + e[1] * column[1] + e[2] * column[2];
            }
        }
    }
    if let Some(axes) = of_column {
        for row in block.chunks_exact_mut(3) {
            let values = [row[0], row[1], row[2]];
            for (out, e) in row.iter_mut().zip(axes) {
                *out = e[0] * values[0] + e[1] * values[1] + e[2] * values[2];
            }
        }
    }
}
