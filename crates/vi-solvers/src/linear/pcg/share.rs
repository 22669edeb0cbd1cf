//! The rows that this process computes, out of those that several processes share.
//!
//! The rows are cut into runs, whose number depends on the number of all rows alone, and runs are joined to domains. Each
//! process computes whole domains. It also knows those rows of others that have entries with its own.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Alone, Exchange, Message};

use crate::index::NONE;
use crate::linear::matrix::Pattern;

/// Number of rows per run; the coarse space has an aggregate per run. Two steps of P1 n64 (1.1 million nodes) by implicit
/// midpoint with h = 10 ms take 44 s with 256 and 49 s with 128 rows; n32 takes 123 and 111 iterations in three steps, and
/// 536 without a coarse space.
const ROWS_PER_RUN: usize = 256;

/// Number of rows per domain: a smaller number gives more parallelism and more iterations. P1 of 96 × 24 × 24 cells (60 000
/// rows), three steps by implicit midpoint with h = 10 ms: 82 iterations, and 77 with at most eight domains.
const ROWS_PER_DOMAIN: usize = 2500;

/// The rows of a process.
pub(crate) struct Share {
    exchange: Arc<dyn Exchange>,
    /// Number of rows of all processes.
    row_count: usize,
    /// Rows of this process, in its own numbers.
    pub(super) rows: Range<usize>,
    /// Domains of this process, as ranges of its own rows.
    pub(super) domains: Vec<Range<usize>>,
    /// Runs of this process, as ranges of its own rows.
    pub(super) runs: Vec<Range<usize>>,
    /// The number of each free coordinate of this process among those of all processes; empty if the numbers are the same.
    free: Vec<u32>,
    links: Vec<Link>,
}

/// The rows whose values this process and another one exchange.
struct Link {
    rank: usize,
    /// Own rows that have entries with rows of the other.
    send: Vec<u32>,
    /// Rows of the other that have entries with own rows.
    receive: Vec<u32>,
}

/// Returns the first row of a run.
fn start_of_run(row_count: usize, run: usize) -> usize {
    row_count * run / run_count(row_count)
}

fn run_count(row_count: usize) -> usize {
    (row_count / ROWS_PER_RUN).max(1)
}

/// Returns the runs of each domain.
fn domains(row_count: usize) -> impl Iterator<Item = Range<usize>> {
    let (count, runs) = ((row_count / ROWS_PER_DOMAIN).max(1), run_count(row_count));
    (0..count).map(move |domain| runs * domain / count..runs * (domain + 1) / count)
}

/// Returns the runs of each of `size` processes.
fn runs_of_ranks(row_count: usize, size: usize) -> Vec<Range<usize>> {
    let domains: Vec<Range<usize>> = domains(row_count).collect();
    let count = domains.len();
    let end = |rank: usize| domains[..count * rank / size].last().map_or(0, |domain| domain.end);
    (0..size).map(|rank| end(rank)..end(rank + 1)).collect()
}

/// Returns the rows of each of `size` processes, out of `row_count`.
pub(crate) fn rows_of_ranks(row_count: usize, size: usize) -> Vec<Range<usize>> {
    let runs = runs_of_ranks(row_count, size);
    runs.iter().map(|runs| start_of_run(row_count, runs.start)..start_of_run(row_count, runs.end)).collect()
}

impl Share {
    /// Returns the share of a process that computes all rows of a pattern.
    pub(super) fn whole(pattern: &Pattern) -> Self {
        let rows: Vec<u32> = (0..pattern.row_count() as u32).collect();
        Self::new(pattern, Arc::new(Alone), &rows, rows.len(), Vec::new())
    }

    /// Returns the share of this rank of `exchange`. The rows of its pattern are the rows `numbers`, ascending, out of
    /// `row_count`; its own rows must be among them, with all their entries. `free` are the numbers of its free coordinates
    /// among those of all processes.
    pub(crate) fn new(
        pattern: &Pattern,
        exchange: Arc<dyn Exchange>,
        numbers: &[u32],
        row_count: usize,
        free: Vec<u32>,
    ) -> Self {
        let (rank, size) = (exchange.rank(), exchange.size());
        let owned = rows_of_ranks(row_count, size);
        let place = |row: usize| numbers.partition_point(|&number| (number as usize) < row);
        let rows = place(owned[rank].start)..place(owned[rank].end);
        let first = owned[rank].start;
        let own_runs = runs_of_ranks(row_count, size)[rank].clone();
        let at = |run: usize| start_of_run(row_count, run) - first + rows.start;
        let runs = own_runs.clone().map(|run| at(run)..at(run + 1)).collect();
        let of_rank =
            domains(row_count).filter(|runs| own_runs.start <= runs.start && runs.end <= own_runs.end);
        let domains =
            of_rank.filter(|runs| !runs.is_empty()).map(|runs| at(runs.start)..at(runs.end)).collect();

        let owner = |row: u32| {
            let number = numbers[row as usize] as usize;
            owned.partition_point(|rows| rows.end <= number)
        };
        let mut links: Vec<(Vec<u32>, Vec<u32>)> = vec![Default::default(); size];
        if size > 1 {
            for row in rows.clone() {
                let lower = pattern.columns[pattern.row(row)].iter().copied();
                let upper = pattern.upper(row).map(|(row, _)| row);
                for other in lower.chain(upper).filter(|&other| !rows.contains(&(other as usize))) {
                    let (send, receive) = &mut links[owner(other)];
                    send.push(row as u32);
                    receive.push(other);
                }
            }
        }
        let link = |(rank, (mut send, mut receive)): (usize, (Vec<u32>, Vec<u32>))| {
            for rows in [&mut send, &mut receive] {
                rows.sort_unstable();
                rows.dedup();
            }
            Link { rank, send, receive }
        };
        let links = links.into_iter().enumerate().map(link).filter(|link| !link.send.is_empty()).collect();
        Self { exchange, row_count, rows, domains, runs, free, links }
    }

    /// Returns the number of rows of all processes.
    pub(super) fn row_count(&self) -> usize {
        self.row_count
    }

    /// Returns the range of the entries of its rows in a vector with `width` entries per row.
    pub(super) fn entries(&self, width: usize) -> Range<usize> {
        self.rows.start * width..self.rows.end * width
    }

    /// Receives the values at rows of others, `width` per row.
    pub(super) fn exchange_rows(&self, width: usize, values: &mut [f64]) {
        if self.links.is_empty() {
            return;
        }
        let message = |Link { rank, send, receive }: &Link| Message {
            rank: *rank,
            send: send.iter().flat_map(|&row| &values[row as usize * width..][..width]).copied().collect(),
            receive: vec![0.0; receive.len() * width],
        };
        let mut messages: Vec<Message> = self.links.iter().map(message).collect();
        self.exchange.slots(&mut messages, &mut || {});
        for (Link { receive, .. }, message) in self.links.iter().zip(&messages) {
            for (&row, received) in receive.iter().zip(message.receive.chunks_exact(width)) {
                values[row as usize * width..][..width].copy_from_slice(received);
            }
        }
    }

    /// Returns the numbers of all processes, in their order.
    pub(super) fn gather(&self, own: &[f64]) -> Vec<f64> {
        if self.exchange.size() == 1 {
            return own.to_vec();
        }
        let bytes: Vec<u8> = own.iter().flat_map(|value| value.to_le_bytes()).collect();
        let pieces = self.exchange.pieces(&bytes);
        pieces
            .iter()
            .flat_map(|piece| piece.as_chunks::<8>().0)
            .map(|&bytes| f64::from_le_bytes(bytes))
            .collect()
    }

    /// Returns the sum of a count over all processes, and over those before this one.
    pub(super) fn sum(&self, own: usize) -> (usize, usize) {
        let counts = self.gather(&[own as f64]);
        let sum = |counts: &[f64]| counts.iter().sum::<f64>() as usize;
        (sum(&counts), sum(&counts[..self.exchange.rank()]))
    }

    /// Returns whether any process passes true.
    pub(super) fn any(&self, flag: bool) -> bool {
        self.exchange.any(flag)
    }

    /// Returns the first free coordinate that any process reports by `own`, as its number among the free coordinates of
    /// all processes; 0 if none reports one.
    pub(super) fn first_free(&self, own: Option<u32>) -> usize {
        let number = own.map(|free| self.free.get(free as usize).map_or(free, |&number| number));
        let found = self.gather(&number.map_or(Vec::new(), |number| vec![f64::from(number)]));
        found.first().map_or(0, |&free| free as usize)
    }

    /// Returns a free coordinate of a row, in the numbers of this process.
    pub(super) fn free_in_row(pattern: &Pattern, row: usize) -> Option<u32> {
        let coordinates = &pattern.free_of[row * pattern.block..(row + 1) * pattern.block];
        coordinates.iter().copied().find(|&free| free != NONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_share_all_rows_in_whole_domains() {
        for row_count in [1, 255, 4999, 5000, 123_456] {
            for size in [1, 2, 3, 7, 100] {
                let ranges = rows_of_ranks(row_count, size);
                assert_eq!((ranges[0].start, ranges[size - 1].end), (0, row_count));
                assert!(ranges.windows(2).all(|pair| pair[0].end == pair[1].start));
                let starts: Vec<usize> =
                    domains(row_count).map(|runs| start_of_run(row_count, runs.start)).collect();
                let starts_domain = |rows: &Range<usize>| rows.is_empty() || starts.contains(&rows.start);
                assert!(ranges.iter().all(starts_domain), "{row_count} {size}");
            }
        }
    }
}
