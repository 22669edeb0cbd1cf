//! The projection A_c = Zᵀ A Z of a matrix on the rigid motions of aggregates.

use std::ops::Range;

use rayon::prelude::*;

use super::aggregates::Aggregates;
use super::rigid_motions;
use crate::linear::matrix::{Pattern, SymmetricMatrix};
use crate::linear::pcg::share::Share;

/// Returns the block of A_c for aggregates with `motion_count` motions, and the number of its rows per aggregate. Blocks have at
/// most three coordinates.
fn layout(motion_count: usize) -> (usize, usize) {
    let block = motion_count.min(3);
    (block, motion_count / block)
}

/// Returns the pattern of A_c.
pub(super) fn pattern(fine: &Pattern, aggregates: &Aggregates, share: &Share) -> Pattern {
    let motion_count = rigid_motions::count(fine.block);
    let (block, rows_each) = layout(motion_count);
    let mut pairs: Vec<(usize, usize)> = share
        .rows
        .clone()
        .flat_map(|row| fine.row(row).map(move |entry| (row, entry)))
        .map(|(row, entry)| (aggregates.of(row), aggregates.of(fine.columns[entry] as usize)))
        .collect();
    pairs.sort_unstable();
    pairs.dedup();
    let numbers: Vec<f64> = pairs.iter().flat_map(|&(row, column)| [row as f64, column as f64]).collect();
    let all = share.gather(&numbers);
    let mut pairs: Vec<(usize, usize)> =
        all.as_chunks::<2>().0.iter().map(|&[row, column]| (row as usize, column as usize)).collect();
    pairs.sort_unstable();
    let mut entries = Vec::new();
    for (row, column) in pairs {
        for i in row * rows_each..(row + 1) * rows_each {
            let columns = column * rows_each..(column + 1) * rows_each;
            entries.extend(columns.filter(|&j| j <= i).map(|j| (i as u32, j as u32)));
        }
    }
    entries.sort_unstable();
    let places = (0..entries.len() as u32).collect();
    let free_of = (0..(aggregates.count() * motion_count) as u32).collect();
    Pattern::new(block, &entries, places, free_of)
}

/// Computes `out` = Zᵀ A Z. Dependent motions, whose columns of Z are zero, get a unit diagonal.
///
/// An entry of A lies in the lower triangle, and an aggregate comes after those of the rows before it that it is
/// connected with, so each aggregate writes its own rows of A_c.
pub(super) fn project<const B: usize, const M: usize>(
    a: &SymmetricMatrix,
    aggregates: &Aggregates,
    motions: &[[f64; M]],
    dependent: &[[bool; M]],
    share: &Share,
    out: &mut SymmetricMatrix,
) {
    let (block, rows_each) = layout(M);
    let coarse = &*out.pattern;
    let entries_of = |k: usize| -> Range<usize> {
        coarse.row_start[k * rows_each] as usize..coarse.row_start[(k + 1) * rows_each] as usize
    };
    let (own, area) = (aggregates.own(), block * block);
    let start_of = |k: usize| coarse.row_start[k * rows_each] as usize * area;
    let range = start_of(own.start)..start_of(own.end);
    let mut rest = &mut out.values[range.clone()];
    let mut parts = Vec::with_capacity(own.len());
    for k in own.clone() {
        let (part, others) = rest.split_at_mut(entries_of(k).len() * block * block);
        parts.push(part);
        rest = others;
    }
    parts.into_par_iter().zip(own.clone()).for_each(|(part, k)| {
        let neighbours: Vec<usize> = coarse.columns[coarse.row(k * rows_each)]
            .iter()
            .step_by(rows_each)
            .map(|&column| column as usize / rows_each)
            .collect();
        let mut sums = sums::<B, M>(a, aggregates, motions, k, &neighbours);
        if let Some(diagonal) = sums.last_mut() {
            (0..M).filter(|&m| dependent[k - own.start][m]).for_each(|m| diagonal[m][m] = 1.0);
        }
        let mut values = part.iter_mut();
        for i in 0..rows_each {
            for &column in &coarse.columns[coarse.row(k * rows_each + i)] {
                let neighbour = neighbours.partition_point(|&other| other < column as usize / rows_each);
                let first = column as usize % rows_each * block;
                for m in 0..block {
                    for (n, value) in (first..first + block).zip(&mut values) {
                        *value = sums[neighbour][i * block + m][n];
                    }
                }
            }
        }
    });
    out.values = share.gather(&out.values[range]);
}

/// Returns Z_kᵀ A Z_b for each neighbour b of aggregate k; the last neighbour is k itself.
fn sums<const B: usize, const M: usize>(
    a: &SymmetricMatrix,
    aggregates: &Aggregates,
    motions: &[[f64; M]],
    k: usize,
    neighbours: &[usize],
) -> Vec<[[f64; M]; M]> {
    let pattern = &*a.pattern;
    let (values, _) = a.values.as_chunks::<B>();
    let mut sums = vec![[[0.0; M]; M]; neighbours.len()];
    for row in aggregates.rows(k).iter().map(|&row| row as usize) {
        let z_row = &motions[row * B..(row + 1) * B];
        for entry in pattern.row(row) {
            let column = pattern.columns[entry] as usize;
            let place = pattern.places[entry] as usize * B;
            let z_column = &motions[column * B..(column + 1) * B];
            let mut product = [[0.0; M]; B];
            for (product, values) in product.iter_mut().zip(&values[place..place + B]) {
                for (value, z) in values.iter().zip(z_column) {
                    (0..M).for_each(|m| product[m] += value * z[m]);
                }
            }
            let other = aggregates.of(column);
            let sum = &mut sums[neighbours.partition_point(|&neighbour| neighbour < other)];
            let is_mirrored = other == k && row != column;
            for (z, product) in z_row.iter().zip(&product) {
                for m in 0..M {
                    for n in 0..M {
                        sum[m][n] += z[m] * product[n];
                        if is_mirrored {
                            sum[n][m] += z[m] * product[n];
                        }
                    }
                }
            }
        }
    }
    sums
}
