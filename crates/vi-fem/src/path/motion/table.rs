//! Checks and evaluates a table of displacements.

use super::Table;
use crate::error::FemError;

impl Table {
    pub(super) fn check(&self) -> Result<(), FemError> {
        let invalid = |problem: String| Err(FemError::Invalid { what: "motion table", problem });
        let (times, displacements) = (self.times.len(), self.displacements.len());
        if times != displacements || times == 0 {
            return invalid(format!(
                "{times} times and {displacements} displacements; give as many of one as of the other, and at least one"
            ));
        }
        if let Some(k) = (1..times)
            .find(|&k| self.times[k].partial_cmp(&self.times[k - 1]) != Some(std::cmp::Ordering::Greater))
        {
            return invalid(format!(
                "times must increase, but entry {k} is {} s after {} s",
                self.times[k],
                self.times[k - 1]
            ));
        }
        let values = self.times.iter().chain(self.displacements.iter().flatten());
        match values.into_iter().find(|value| !value.is_finite()) {
            Some(value) => invalid(format!("{value} is not a finite number")),
            None => Ok(()),
        }
    }

    /// Returns the displacement (m) and the velocity (m/s) at time t (s).
    pub(super) fn at(&self, t: f64) -> ([f64; 3], [f64; 3]) {
        let next = self.times.partition_point(|&time| time <= t);
        if next == 0 || next == self.times.len() {
            return (self.displacements[next.saturating_sub(1)], [0.0; 3]);
        }
        let (t0, t1) = (self.times[next - 1], self.times[next]);
        let (a, b) = (self.displacements[next - 1], self.displacements[next]);
        let share = (t - t0) / (t1 - t0);
        ([0, 1, 2].map(|i| a[i] + share * (b[i] - a[i])), [0, 1, 2].map(|i| (b[i] - a[i]) / (t1 - t0)))
    }
}
