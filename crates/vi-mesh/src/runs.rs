//! The runs of elements along a curve, and the processes that compute them.

use std::ops::Range;

/// Elements along a curve in runs of one length, of which the last may be shorter, and the runs that each process computes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Runs {
    elements: usize,
    length: usize,
    of_processes: Vec<Range<usize>>,
}

impl Runs {
    /// Returns the runs of `elements` elements, `length` (> 0) per run. `of_processes` are those of each process: together they are all
    /// runs, in order.
    pub fn new(elements: usize, length: usize, of_processes: Vec<Range<usize>>) -> Self {
        Self { elements, length, of_processes }
    }

    /// Returns runs of which process k of P computes those from ⌈k n / P⌉ to ⌈(k + 1) n / P⌉, of n runs.
    pub fn in_equal_shares(elements: usize, length: usize, processes: usize) -> Self {
        let first = |process: usize| (process * elements.div_ceil(length)).div_ceil(processes);
        Self::new(elements, length, (0..processes).map(|k| first(k)..first(k + 1)).collect())
    }

    /// Returns the number of runs.
    pub(crate) fn count(&self) -> usize {
        self.elements.div_ceil(self.length)
    }

    /// Returns the number of elements per run.
    pub fn length(&self) -> usize {
        self.length
    }

    /// Returns the number of processes.
    pub fn process_count(&self) -> usize {
        self.of_processes.len()
    }

    /// Returns the process that computes a run.
    pub(crate) fn process_of(&self, run: usize) -> usize {
        self.of_processes.partition_point(|runs| runs.end <= run)
    }

    /// Returns the positions on the curve of the elements that a process computes.
    pub(crate) fn positions_of(&self, process: usize) -> Range<usize> {
        let Range { start, end } = self.of_processes[process];
        (start * self.length).min(self.elements)..(end * self.length).min(self.elements)
    }

    /// Returns the numbers of the runs of a part, each with its process.
    pub(crate) fn listed(&self, is_in_part: impl Fn(usize) -> bool) -> Vec<(u32, u32)> {
        let in_part = (0..self.count()).filter(|&run| is_in_part(run));
        in_part.map(|run| (run as u32, self.process_of(run) as u32)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Runs;

    #[test]
    fn every_run_belongs_to_the_process_that_has_its_positions() {
        let equal = [(1, 8, 3), (100, 8, 3), (104, 8, 13), (37, 5, 4), (40, 5, 20)];
        let all =
            equal.map(|(elements, length, processes)| Runs::in_equal_shares(elements, length, processes));
        let others = [Runs::new(100, 8, vec![0..2, 2..2, 2..9, 9..13]), Runs::new(7, 8, vec![0..1, 1..1])];
        for runs in all.into_iter().chain(others) {
            let mut next = 0;
            for process in 0..runs.process_count() {
                let positions = runs.positions_of(process);
                assert_eq!(positions.start, next);
                assert!(
                    positions.clone().all(|position| runs.process_of(position / runs.length()) == process)
                );
                next = positions.end;
            }
            assert_eq!(next, runs.elements);
        }
    }
}
