//! The origin of a result: scene, program, machine, time and command. Every JSON file has it in one object, and no
//! other content of the file depends on it.

use std::time::{SystemTime, UNIX_EPOCH};

use serde::Serialize;

use crate::simulation::RankFacts;

/// Origin of a result: scene, program, machine, date and command line.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Provenance {
    /// Name of the scene, or the file.
    pub scene: String,
    /// Number of free coordinates of the scene's own mesh, even if that is refined; 0 if the result does not belong to
    /// one system.
    pub free_coordinates: usize,
    /// Version of the program.
    pub version: &'static str,
    /// Commit that the program was built from, with `+` if files had changed; `None` outside a repository.
    pub commit: Option<&'static str>,
    /// Compiler of the program.
    pub compiler: &'static str,
    /// Operating system and instruction set for which the program was built.
    pub target: String,
    /// Model of the processor.
    pub processor: String,
    /// Hardware threads of the processor.
    pub hardware_threads: usize,
    /// Threads of the thread pool.
    pub threads: usize,
    /// The ranks, if there were several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ranks: Option<RankFacts>,
    /// Date and time in UTC (RFC 3339).
    pub date: String,
    /// The command line.
    pub command: Vec<String>,
}

impl Provenance {
    /// Makes the provenance of a result computed now, in the caller's thread pool.
    pub fn new(scene: &str, free_coordinates: usize) -> Self {
        let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
        Self {
            scene: scene.to_owned(),
            free_coordinates,
            version: env!("CARGO_PKG_VERSION"),
            commit: option_env!("VARIATIONAL_COMMIT"),
            compiler: env!("VARIATIONAL_COMPILER"),
            target: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            processor: processor(),
            hardware_threads: std::thread::available_parallelism().map_or(1, usize::from),
            threads: rayon::current_num_threads(),
            ranks: None,
            date: date(seconds),
            command: std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect(),
        }
    }
}

/// Returns the name of the processor in Linux or Windows; elsewhere its instruction set.
fn processor() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    let model = model.map(|(_, name)| name.trim().to_owned());
    model
        .or_else(|| std::env::var("PROCESSOR_IDENTIFIER").ok())
        .unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}

/// Formats a time (s since 1970 in UTC) as `2026-11-21T23:04:05Z`.
fn date(seconds: u64) -> String {
    let (days, of_day) = (seconds / 86_400, seconds % 86_400);
    let (mut year, mut day) = (1970, days);
    let is_leap =
        |year: u64| year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400));
    while day >= 365 + u64::from(is_leap(year)) {
        day -= 365 + u64::from(is_leap(year));
        year += 1;
    }
    let february = 28 + u64::from(is_leap(year));
    let mut month = 1;
    for length in [31, february, 31, 30, 31, 30, 31, 31, 30, 31, 30] {
        if day < length {
            break;
        }
        day -= length;
        month += 1;
    }
    let (hour, minute, second) = (of_day / 3600, of_day / 60 % 60, of_day % 60);
    format!("{year}-{month:02}-{:02}T{hour:02}:{minute:02}:{second:02}Z", day + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The expected dates are those of `date -u -d @SECONDS`.
    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, expected) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_709_164_800, "2024-02-29T00:00:00Z"),
            (1_735_689_599, "2024-12-31T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(date(seconds), expected);
        }
    }
}
