//! The runs of elements along a curve, and the processes that compute them.

use std::ops::Range;

/// Elements along a curve in runs of one length, of which the last may be shorter. Run k belongs to process
/// ⌊k · number of processes / number of runs⌋.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Runs {
    /// Number of elements.
    pub(crate) elements: usize,
    /// Number of elements per run.
    pub(crate) length: usize,
    /// Number of processes.
    pub(crate) processes: usize,
}

impl Runs {
    /// Returns the number of runs.
    pub(crate) fn count(&self) -> usize {
        self.elements.div_ceil(self.length)
    }

    /// Returns the process that computes a run.
    pub(crate) fn process_of(&self, run: usize) -> usize {
        run * self.processes / self.count()
    }

    /// Returns the positions on the curve of the elements that a process computes.
    pub(crate) fn positions_of(&self, process: usize) -> Range<usize> {
        let first = |process: usize| (process * self.count()).div_ceil(self.processes) * self.length;
        first(process).min(self.elements)..first(process + 1).min(self.elements)
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
        for (elements, length, processes) in [(1, 8, 3), (100, 8, 3), (104, 8, 13), (37, 5, 4), (40, 5, 20)] {
            let runs = Runs { elements, length, processes };
            let mut next = 0;
            for process in 0..processes {
                let positions = runs.positions_of(process);
                assert_eq!(positions.start, next);
                assert!(positions.clone().all(|position| runs.process_of(position / length) == process));
                next = positions.end;
            }
            assert_eq!(next, elements);
        }
    }
}
