//! A convergence study as text and as CSV. This file measures nothing.

use std::fmt::Write as _;

use super::{ConvergenceReport, Extrapolation, Study, Verdict};

impl ConvergenceReport {
    /// Returns tables for a reader.
    pub fn table(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        for study in &self.studies {
            table_of(study, &mut text);
            if let (Some(order), "time") = (self.formal_order, study.of) {
                let _ = writeln!(text, "The scheme is of order {order}.");
            }
            text.push('\n');
        }
        let width = self.estimates.iter().map(|estimate| estimate.quantity.len()).max().unwrap_or(0);
        let _ = writeln!(text, "Estimates of the exact values:");
        for estimate in &self.estimates {
            let Extrapolation { value, .. } = estimate.extrapolation;
            let _ = writeln!(
                text,
                "{:width$}  {value:>18.10e} {}",
                estimate.quantity,
                bar(&estimate.extrapolation)
            );
        }
        for note in &self.notes {
            let _ = writeln!(text, "note: {note}");
        }
        text
    }

    /// Returns one row per run: study, refined, nodes, steps, step (s), seconds, and the quantities.
    pub fn csv(&self) -> String {
        let mut text = String::new();
        for study in &self.studies {
            let _ = write!(text, "study,refined,nodes,steps,step,seconds");
            for row in &study.rows {
                let _ = write!(text, ",{}", row.quantity);
            }
            text.push('\n');
            for (k, level) in study.levels.iter().enumerate() {
                let _ = write!(
                    text,
                    "{},{},{},{},{:.16e},{:.3e}",
                    study.of, level.refined, level.nodes, level.steps, level.step, level.seconds
                );
                for row in &study.rows {
                    let _ = write!(text, ",{:.16e}", row.values[k]);
                }
                text.push('\n');
            }
        }
        text
    }
}

/// Returns the error bar of a limit in words.
fn bar(found: &Extrapolation) -> String {
    let bar = found.error.map_or(String::new(), |error| format!("± {error:.1e}"));
    match found.verdict {
        Verdict::Converges | Verdict::IsExact => bar,
        Verdict::IsZero => format!("{bar} (zero to round-off)"),
        Verdict::Alternates => format!("{bar} (alternates)"),
        Verdict::FallsByChance => format!("{bar} (falls faster than theory allows)"),
        Verdict::TwoLevels => format!("{bar} (two levels show no order)"),
        Verdict::NotYet => "does not converge yet".to_owned(),
        Verdict::MayLock => "no bar: its elements lock".to_owned(),
    }
}

fn table_of(study: &Study, text: &mut String) {
    let width = study.rows.iter().map(|row| row.quantity.len()).max().unwrap_or(0).max(8);
    let _ = write!(text, "{:width$}", study.of);
    for level in &study.levels {
        let head = match study.of {
            "space" => format!("{} nodes", level.nodes),
            _ => format!("{} steps", level.steps),
        };
        let _ = write!(text, "  {head:>17}");
    }
    let _ = writeln!(text, "  {:>6}  {:>17}  {:>9}", "order", "limit", "");
    for row in &study.rows {
        let _ = write!(text, "{:width$}", row.quantity);
        for value in &row.values {
            let _ = write!(text, "  {value:>17.9e}");
        }
        let found = &row.extrapolation;
        let order = found.observed_order.map_or("-".to_owned(), |order| format!("{order:.2}"));
        let _ = writeln!(text, "  {order:>6}  {:>17.9e}  {}", found.value, bar(found));
    }
}
