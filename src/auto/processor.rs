//! Processor time used by this process.

use std::ops::{AddAssign, Sub};

use cpu_time::ProcessTime;

/// Times since the start of the process, or between two moments.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Used {
    /// Processor time of all threads, s.
    pub(crate) processor_seconds: f64,
    /// Time for which runnable threads waited for a processor, s, if the system provides it (Linux).
    pub(crate) waited_seconds: Option<f64>,
}

impl Used {
    /// Returns the times since the start of the process, without the waiting time of threads that have ended.
    pub(crate) fn now() -> Self {
        let processor = ProcessTime::try_now().map(|time| time.as_duration().as_secs_f64());
        Self { processor_seconds: processor.unwrap_or(f64::NAN), waited_seconds: waited() }
    }
}

/// Sums the second number of `schedstat` of each thread: its time in the queue of a processor, ns.
fn waited() -> Option<f64> {
    let mut nanoseconds = 0.0;
    for thread in std::fs::read_dir("/proc/self/task").ok()? {
        let text = std::fs::read_to_string(thread.ok()?.path().join("schedstat")).ok()?;
        nanoseconds += text.split_whitespace().nth(1)?.parse::<f64>().ok()?;
    }
    Some(1e-9 * nanoseconds)
}

impl Sub for Used {
    type Output = Self;

    fn sub(self, before: Self) -> Self {
        let waited = self.waited_seconds.zip(before.waited_seconds);
        Self {
            processor_seconds: self.processor_seconds - before.processor_seconds,
            waited_seconds: waited.map(|(now, before)| (now - before).max(0.0)),
        }
    }
}

impl AddAssign for Used {
    fn add_assign(&mut self, other: Self) {
        self.processor_seconds += other.processor_seconds;
        if let Some(waited) = other.waited_seconds {
            *self.waited_seconds.get_or_insert(0.0) += waited;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Work uses processor time, at most the elapsed time of all threads.
    #[test]
    fn work_is_counted_and_sleep_is_not() {
        let before = Used::now();
        std::thread::sleep(std::time::Duration::from_millis(50));
        let asleep = Used::now() - before;
        let begin = std::time::Instant::now();
        let before = Used::now();
        let mut sum = 0_u64;
        while (Used::now() - before).processor_seconds < 0.05 {
            sum = std::hint::black_box(sum.wrapping_mul(31).wrapping_add(7));
            assert!(begin.elapsed().as_secs() < 30, "no processor time passes");
        }
        assert!(
            asleep.processor_seconds.is_finite() && asleep.waited_seconds.is_none_or(|waited| waited >= 0.0)
        );
    }
}
