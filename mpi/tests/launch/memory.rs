//! Finds the ranks of a run, and the memory that they take.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

use super::{PROGRAM, start, text};

/// Returns the processes that run `scene`, without the launcher and its helpers.
pub(crate) fn ranks_of(scene: &Path) -> Vec<u32> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir("/proc").unwrap().flatten() {
        let Ok(pid) = entry.file_name().to_string_lossy().parse::<u32>() else { continue };
        let words = std::fs::read(entry.path().join("cmdline")).unwrap_or_default();
        let words: Vec<String> = words.split(|&byte| byte == 0).map(text).collect();
        if words[0] == PROGRAM && words.iter().any(|word| Path::new(word) == scene) {
            found.push(pid);
        }
    }
    found.sort_unstable();
    found
}

/// Returns the largest memory that each rank held while it ran a scene, in MiB, largest first.
pub(crate) fn peaks(ranks: usize, scene: &Path, out: &Path) -> Vec<f64> {
    let mut child = start(ranks, scene, out);
    let mut peaks: BTreeMap<u32, f64> = BTreeMap::new();
    while child.try_wait().unwrap().is_none() {
        for rank in ranks_of(scene) {
            let status = std::fs::read_to_string(format!("/proc/{rank}/status")).unwrap_or_default();
            let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
            if let Some(kilobytes) = peak.and_then(|peak| peak.split_whitespace().next()?.parse::<f64>().ok())
            {
                peaks.insert(rank, kilobytes / 1024.0);
            }
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(child.wait().unwrap().success());
    let mut peaks: Vec<f64> = peaks.into_values().collect();
    assert_eq!(peaks.len(), ranks);
    peaks.sort_by(|a, b| b.total_cmp(a));
    peaks
}
