//! Aggregates of neighbouring rows: runs of consecutive rows, cut where they are not connected.
//!
//! Consecutive rows lie close together, because meshes are numbered along a space-filling curve.

use std::ops::Range;

use vi_core::DisjointSets;

use crate::index::{NONE, group_by};
use crate::linear::matrix::Pattern;
use crate::linear::pcg::share::Share;

/// With fewer aggregates a coarse space gains nothing: P1 n4 (425 nodes) takes as many iterations with it.
const FEWEST_AGGREGATES: usize = 4;

/// With fewer rows per aggregate on average, the coarse matrix would cost more than it gains.
const FEWEST_ROWS: usize = 24;

pub(super) struct Aggregates {
    /// Number of all aggregates.
    count: usize,
    /// Number of the first aggregate of this process.
    first: usize,
    /// Aggregate of each row.
    of_row: Vec<u32>,
    /// The rows of aggregate `first` + a, ascending, are `rows[start[a]..start[a + 1]]`.
    start: Vec<u32>,
    rows: Vec<u32>,
}

impl Aggregates {
    /// Returns `None` if there would be too few aggregates, or too small ones.
    pub(super) fn new(pattern: &Pattern, share: &Share) -> Option<Self> {
        let mut own = Vec::with_capacity(share.rows.len());
        let mut own_count = 0;
        for Range { start: first, end } in share.runs.iter().cloned() {
            let length = end - first;
            let mut connected = DisjointSets::new(length);
            for row in first..end {
                for &column in &pattern.columns[pattern.row(row)] {
                    if column as usize >= first {
                        connected.join((row - first) as u32, column - first as u32);
                    }
                }
            }
            let mut aggregate_of_root = vec![NONE; length];
            for row in 0..length {
                let aggregate = &mut aggregate_of_root[connected.root(row as u32) as usize];
                if *aggregate == NONE {
                    *aggregate = own_count;
                    own_count += 1;
                }
                own.push(*aggregate);
            }
        }
        let (count, first) = share.sum(own_count as usize);
        if count < FEWEST_AGGREGATES || count * FEWEST_ROWS > share.row_count() {
            return None;
        }
        let (start, mut rows) = group_by(&own, own_count as usize);
        rows.iter_mut().for_each(|row| *row += share.rows.start as u32);
        let mut of_row = vec![f64::from(NONE); pattern.row_count()];
        for (of_row, &aggregate) in of_row[share.rows.clone()].iter_mut().zip(&own) {
            *of_row = f64::from(first as u32 + aggregate);
        }
        share.exchange_rows(1, &mut of_row);
        let of_row = of_row.iter().map(|&aggregate| aggregate as u32).collect();
        Some(Self { count, first, of_row, start, rows })
    }

    /// Returns the number of all aggregates.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Returns the aggregates of this process.
    pub(super) fn own(&self) -> Range<usize> {
        self.first..self.first + self.start.len() - 1
    }

    /// Returns the aggregate of a row.
    pub(super) fn of(&self, row: usize) -> usize {
        self.of_row[row] as usize
    }

    /// Returns the rows of an aggregate of this process.
    pub(super) fn rows(&self, aggregate: usize) -> &[u32] {
        let aggregate = aggregate - self.first;
        &self.rows[self.start[aggregate] as usize..self.start[aggregate + 1] as usize]
    }
}
