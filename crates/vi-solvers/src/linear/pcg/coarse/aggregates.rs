//! Aggregates of neighbouring rows: runs of consecutive rows, cut where they are not connected.
//!
//! Consecutive rows lie close together, because meshes are numbered along a space-filling curve.

use vi_core::DisjointSets;

use crate::index::{NONE, group_by};
use crate::linear::matrix::Pattern;

/// Number of rows per aggregate. Two steps of P1 n64 (1.1 million nodes) by implicit midpoint with h = 10 ms take 44 s with
/// 256 and 49 s with 128 rows; n32 takes 123 and 111 iterations in three steps, and 536 without a coarse space.
const ROWS_PER_AGGREGATE: usize = 256;

/// With fewer aggregates a coarse space gains nothing: P1 n4 (425 nodes) takes as many iterations with it.
const FEWEST_AGGREGATES: usize = 4;

/// With fewer rows per aggregate on average, the coarse matrix would cost more than it gains.
const FEWEST_ROWS: usize = 24;

pub(super) struct Aggregates {
    /// Aggregate of each row.
    of_row: Vec<u32>,
    /// The rows of aggregate a, ascending, are `rows[start[a]..start[a + 1]]`.
    start: Vec<u32>,
    rows: Vec<u32>,
}

impl Aggregates {
    /// Returns `None` if there would be too few aggregates, or too small ones.
    pub(super) fn new(pattern: &Pattern) -> Option<Self> {
        let row_count = pattern.row_count();
        let runs = (row_count / ROWS_PER_AGGREGATE).max(1);
        let mut of_row = vec![NONE; row_count];
        let mut count = 0;
        for run in 0..runs {
            let first = row_count * run / runs;
            let length = row_count * (run + 1) / runs - first;
            let mut connected = DisjointSets::new(length);
            for row in first..first + length {
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
                    *aggregate = count;
                    count += 1;
                }
                of_row[first + row] = *aggregate;
            }
        }
        let count = count as usize;
        if count < FEWEST_AGGREGATES || count * FEWEST_ROWS > row_count {
            return None;
        }
        let (start, rows) = group_by(&of_row, count);
        Some(Self { of_row, start, rows })
    }

    pub(super) fn count(&self) -> usize {
        self.start.len() - 1
    }

    /// Returns the aggregate of a row.
    pub(super) fn of(&self, row: usize) -> usize {
        self.of_row[row] as usize
    }

    /// Returns the rows of an aggregate.
    pub(super) fn rows(&self, aggregate: usize) -> &[u32] {
        &self.rows[self.start[aggregate] as usize..self.start[aggregate + 1] as usize]
    }

    pub(super) fn bytes(&self) -> usize {
        4 * (self.of_row.len() + self.start.len() + self.rows.len())
    }
}
