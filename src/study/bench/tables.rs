//! A bench in words: the table for the terminal, CSV, and the recommendation. This file measures nothing.

use std::fmt::Write;

use super::{BenchReport, Row, Tenth};

/// Returns the cheapest row within the required error, and the recommendation in words.
pub(super) fn recommend(report: &BenchReport) -> (Option<usize>, String) {
    let wanted = percent(report.accuracy);
    let good = |row: &Row| row.error.is_some_and(|error| error <= report.accuracy);
    let seconds = |row: &Row| report.cost(row).unwrap_or(f64::INFINITY);
    let found = report
        .rows
        .iter()
        .enumerate()
        .filter(|(_, row)| good(row))
        .min_by(|(_, a), (_, b)| seconds(a).total_cmp(&seconds(b)));
    let Some((index, best)) = found else {
        let nearest = report.rows.iter().filter(|row| row.error.is_some());
        let nearest = nearest.min_by(|a, b| a.error.unwrap_or(1.0).total_cmp(&b.error.unwrap_or(1.0)));
        let said = match nearest {
            Some(row) => format!(
                "{} reaches {wanted}; nearest is {}, h = {}, with {} in {}",
                match report.interrupted {
                    true => "nothing that was measured before the interruption",
                    false => "nothing within the budget",
                },
                row.scheme,
                engineering(row.step, "s"),
                percent(row.error.unwrap_or(f64::NAN)),
                engineering(seconds(row), "s")
            ),
            None if report.interrupted => "interrupted before a combination was measured".to_owned(),
            None => "every combination failed".to_owned(),
        };
        return (None, said);
    };
    let mut said = format!(
        "{}, h = {} ({} steps) reaches your {wanted} (error {:.1e}) in {}",
        best.scheme,
        engineering(best.step, "s"),
        best.steps,
        best.error.unwrap_or(f64::NAN),
        engineering(seconds(best), "s"),
    );
    if let Some(now) = report.rows.iter().find(|row| row.is_present) {
        let present = format!("{}, h = {}", now.scheme, engineering(now.step, "s"));
        let _ = match (&now.failure, now.error) {
            (Some(failure), _) => {
                write!(said, "; the current choice of the scene ({present}) fails: {failure}")
            }
            (None, Some(_)) if now.choice == best.choice => write!(said, ": the current choice of the scene"),
            (None, Some(error)) if error <= report.accuracy => {
                let ratio = seconds(now) / seconds(best);
                write!(said, ", {ratio:.1} × cheaper than now ({present}, error {error:.1e})")
            }
            (None, Some(error)) => {
                let spent = engineering(seconds(now), "s");
                write!(
                    said,
                    "; the current choice of the scene ({present}) has {} in {spent}",
                    percent(error)
                )
            }
            (None, None) => Ok(()),
        };
    }
    if report.interrupted {
        said.push_str("; the bench was interrupted, and another combination may be cheaper");
    }
    (Some(index), said)
}

impl BenchReport {
    /// Returns the table for a terminal, with the most accurate row last.
    pub fn table(&self) -> String {
        let mut text = format!(
            "{:<20} {:>8} {:>10} {:>10} {:>10} {:>9} {:>6} {:>9} {:>8} {:>7}\n",
            "scheme", "steps", "h (s)", "time (s)", "cpu (s)", "error", "order", "dE", "forces", "factors"
        );
        let mut rows: Vec<&Row> = self.rows.iter().collect();
        let key = |row: &Row| row.error.unwrap_or(f64::INFINITY);
        rows.sort_by(|a, b| key(b).total_cmp(&key(a)));
        for row in rows {
            let mark = match (row.on_front, row.is_present) {
                (true, true) => " ← front, now",
                (true, false) => " ← front",
                (false, true) => " ← now",
                (false, false) => "",
            };
            let count = |name: &str| row.work.get(name).map_or(String::new(), ToString::to_string);
            let _ = write!(text, "{:<20} {:>8} {:>10.3e} ", row.scheme, row.steps, row.step);
            let _ = match &row.failure {
                Some(failure) => write!(text, "failed: {failure}"),
                None => write!(
                    text,
                    "{:>10.3} {:>10.3} {:>8.1e}{} {:>6} {:>9.1e} {:>8} {:>7}",
                    row.seconds.unwrap_or(f64::NAN),
                    row.processor_seconds.unwrap_or(f64::NAN),
                    row.error.unwrap_or(f64::NAN),
                    if row.at_reference { "≈" } else { " " },
                    row.observed_order.map_or(String::new(), |order| format!("{order:.1}")),
                    row.energy_drift.unwrap_or(f64::NAN),
                    count("gradients"),
                    count("factorizations"),
                ),
            };
            let _ = writeln!(text, "{mark}");
        }
        let reference = &self.reference;
        let _ = writeln!(
            text,
            "errors are against {} in {} steps, which differs by {:.1e} from {} steps{}",
            reference.scheme,
            reference.steps,
            reference.difference,
            reference.coarser_steps,
            if self.rows.iter().any(|row| row.at_reference) {
                "; ≈: the error is of the size of this difference, and not known better"
            } else {
                ""
            }
        );
        let _ = writeln!(text, "ranked by {}", self.ranked_by);
        if let Some(Tenth { scheme, steps, seconds, is_measured }) = &self.tenth {
            let _ = writeln!(
                text,
                "a tenth of the error, {}, would take {} {scheme}, {steps} steps, {}",
                percent(0.1 * self.accuracy),
                if *is_measured { "(measured)" } else { "(by the orders of the rows)" },
                engineering(*seconds, "s"),
            );
        }
        text
    }

    /// Returns all rows as CSV. A count of work with the name of another column gets the prefix `work_`.
    pub fn csv(&self) -> String {
        const OWN: &str = "scheme,steps,step,seconds,processor_seconds,repeats,error,observed_order,energy_drift,on_front,is_present,\
                           at_reference,failure";
        let mut text = OWN.to_owned();
        let names: Vec<&String> = self
            .rows
            .iter()
            .find(|row| !row.work.is_empty())
            .map_or(Vec::new(), |row| row.work.keys().collect());
        for name in &names {
            let is_taken = OWN.split(',').any(|own| own == name.as_str());
            let _ = write!(text, ",{}{name}", if is_taken { "work_" } else { "" });
        }
        text.push('\n');
        for row in &self.rows {
            let number = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:e}"));
            let failure =
                row.failure.as_deref().unwrap_or("").replace('"', "\"\"").replace(['\n', '\r'], " ");
            let _ = write!(
                text,
                "{},{},{:e},{},{},{},{},{},{},{},{},{},\"{}\"",
                row.scheme,
                row.steps,
                row.step,
                number(row.seconds),
                number(row.processor_seconds),
                row.repeats,
                number(row.error),
                number(row.observed_order),
                number(row.energy_drift),
                row.on_front,
                row.is_present,
                row.at_reference,
                failure
            );
            for name in &names {
                let count = row.work.get(*name).map_or(String::new(), ToString::to_string);
                let _ = write!(text, ",{count}");
            }
            text.push('\n');
        }
        text
    }
}

/// Formats 0.01 as `1 %`, and small errors as powers of ten.
fn percent(value: f64) -> String {
    if (1e-3..1.0).contains(&value) {
        let text = format!("{:.2}", 100.0 * value);
        format!("{} %", text.trim_end_matches('0').trim_end_matches('.'))
    } else {
        format!("{value:.0e}")
    }
}

/// Formats 0.004 s as `4 ms`.
fn engineering(value: f64, unit: &str) -> String {
    let (scale, prefix) = match value {
        v if v >= 1.0 || v == 0.0 => (1.0, ""),
        v if v >= 1e-3 => (1e3, "m"),
        v if v >= 1e-6 => (1e6, "µ"),
        _ => (1e9, "n"),
    };
    let scaled = value * scale;
    let digits = if scaled >= 100.0 {
        0
    } else if scaled >= 10.0 {
        1
    } else {
        2
    };
    let text = format!("{scaled:.digits$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    format!("{text} {prefix}{unit}")
}
