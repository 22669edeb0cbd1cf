//! The tables of a sweep, gathered from the directories of its points: `sweep.csv`, whose bytes do not depend on how
//! the sweep was run, and `sweep-times.csv` with clock times. This file runs nothing.

use std::fmt::Write as _;

use serde_json::Value;

use super::error::SweepError;
use super::options::SweepOptions;
use super::point::{End, Identities, Point, write_whole};

/// Results found in the directory of a point.
struct Found {
    end: Option<End>,
    /// Name, last, smallest and largest value of each column of history.csv.
    columns: Vec<(String, [String; 3])>,
    report: Value,
}

/// Writes both tables; returns how many points are done, and how many of these ended with an error.
///
/// Tasks that end at the same time each write the whole table: the last one to write has seen the points of all
/// tasks.
pub(super) fn write(
    options: &SweepOptions,
    points: &[Point],
    identities: &Identities,
) -> Result<(usize, usize), SweepError> {
    loop {
        let found: Vec<Found> = points.iter().map(|point| find(point, identities)).collect();
        let done = found.iter().filter(|found| found.end.is_some()).count();
        let path = options.directory.join("sweep.csv");
        write_whole(&path, &results(options, points, &found)).map_err(SweepError::files(&path))?;
        let path = options.directory.join("sweep-times.csv");
        write_whole(&path, &times(points, &found)).map_err(SweepError::files(&path))?;
        if points.iter().filter(|point| point.end(identities).is_some()).count() == done {
            let failed = found.iter().filter(|found| found.end.as_ref().is_some_and(|end| end.exit != 0));
            return Ok((done, failed.count()));
        }
    }
}

fn find(point: &Point, identities: &Identities) -> Found {
    let end = point.end(identities);
    // The files in the directory of a refused or skipped point belong to another scene.
    if end.as_ref().is_none_or(|end| end.exit == 2) {
        return Found { end, columns: Vec::new(), report: Value::Null };
    }
    let text = |name: &str| std::fs::read_to_string(point.directory.join(name)).unwrap_or_default();
    Found {
        end,
        columns: extremes(&text("history.csv")),
        report: serde_json::from_str(&text("report.json")).unwrap_or_default(),
    }
}

/// Returns name, last, smallest and largest value of each column, as text from the file.
fn extremes(history: &str) -> Vec<(String, [String; 3])> {
    let mut lines = history.lines();
    let names = lines.next().into_iter().flat_map(|line| line.split(','));
    let mut columns: Vec<(String, [String; 3])> =
        names.map(|name| (name.to_owned(), Default::default())).collect();
    for line in lines {
        for (cell, (_, [last, low, high])) in line.split(',').zip(&mut columns) {
            *last = cell.to_owned();
            let Ok(value) = cell.parse::<f64>() else { continue };
            if !low.parse::<f64>().is_ok_and(|low| low <= value) {
                cell.clone_into(low);
            }
            if !high.parse::<f64>().is_ok_and(|high| high >= value) {
                cell.clone_into(high);
            }
        }
    }
    columns
}

fn results(options: &SweepOptions, points: &[Point], found: &[Found]) -> String {
    let mut names: Vec<&str> = Vec::new();
    let mut works: Vec<&str> = Vec::new();
    for found in found {
        for (name, _) in &found.columns {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        for name in found.report["work"].as_object().into_iter().flat_map(|work| work.keys()) {
            if !works.contains(&name.as_str()) {
                works.push(name);
            }
        }
    }
    let mut text = String::from("point");
    // Writing to a string cannot fail.
    options.axes.iter().for_each(|axis| text.push_str(&format!(",{}", cell(&axis.key))));
    text.push_str(",exit,reason,steps");
    for name in &names {
        let _ = write!(text, ",{name},{name}.min,{name}.max");
    }
    works.iter().for_each(|name| text.push_str(&format!(",work.{name}")));
    text.push('\n');
    for (point, found) in points.iter().zip(found) {
        let _ = write!(text, "{}", point.number);
        point.values.iter().for_each(|value| text.push_str(&format!(",{}", cell(value))));
        let _ = match &found.end {
            Some(end) => write!(text, ",{},{}", end.exit, cell(&end.reason)),
            None => write!(text, ",,not run yet"),
        };
        let _ = write!(text, ",{}", number(&found.report["steps"]));
        for name in &names {
            let column = found.columns.iter().find(|(other, _)| other == name);
            let [last, low, high] = column.map_or(Default::default(), |(_, values)| values.clone());
            let _ = write!(text, ",{last},{low},{high}");
        }
        for name in &works {
            let _ = write!(text, ",{}", number(&found.report["work"][*name]));
        }
        text.push('\n');
    }
    text
}

fn times(points: &[Point], found: &[Found]) -> String {
    let phases = ["setup_seconds", "stepping_seconds", "output_seconds"];
    let mut text = format!("point,{}\n", phases.join(","));
    for (point, found) in points.iter().zip(found) {
        let _ = write!(text, "{}", point.number);
        for phase in phases {
            let _ = write!(text, ",{}", number(&found.report[phase]));
        }
        text.push('\n');
    }
    text
}

fn number(value: &Value) -> String {
    if value.is_null() { String::new() } else { value.to_string() }
}

/// Formats a text as a cell (RFC 4180) on one line.
fn cell(text: &str) -> String {
    let line = text.replace(['\n', '\r'], " ");
    if line.contains([',', '"']) { format!("\"{}\"", line.replace('"', "\"\"")) } else { line }
}
