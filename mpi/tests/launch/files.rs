//! Compares the files of runs.

use std::collections::BTreeMap;
use std::path::Path;

use super::text;

/// Returns a report without clock times, command line and place.
pub(crate) fn timeless(report: &str) -> String {
    let mut is_provenance = false;
    let mut kept = Vec::new();
    for line in report.lines() {
        is_provenance |= line.starts_with("  \"provenance\"");
        if !is_provenance && !line.contains("_seconds\"") {
            kept.push(line);
        }
        is_provenance &= !line.starts_with("  }");
    }
    kept.join("\n")
}

/// Returns the files of a directory by name. Checkpoints, which hold the seconds so far, are left out.
pub(crate) fn files(directory: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in std::fs::read_dir(directory).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let mut bytes = std::fs::read(&path).unwrap();
        if name.ends_with(".vck") {
            continue;
        }
        if name == "report.json" {
            bytes = timeless(&text(&bytes)).into_bytes();
        }
        files.insert(name, bytes);
    }
    files
}

pub(crate) fn assert_same_files(found: &Path, expected: &Path, what: &str) {
    let (found, expected) = (files(found), files(expected));
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&found), names(&expected), "{what}");
    for (name, bytes) in &found {
        if *bytes != expected[name] {
            let (a, b) = (text(bytes), text(&expected[name]));
            let line = a.lines().zip(b.lines()).find(|(a, b)| a != b);
            panic!("{what}: {name} differs: {line:?}");
        }
    }
}

/// Asserts that ranks have built or read only the parts of the bodies that they need.
pub(crate) fn assert_in_parts(directory: &Path) {
    let report = std::fs::read_to_string(directory.join("report.json")).unwrap();
    assert!(report.contains("\"in_parts\": true"), "{report}");
}
