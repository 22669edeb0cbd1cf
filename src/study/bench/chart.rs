//! A bench as a chart: run time over error, both logarithmic, with the Pareto front marked. This file measures
//! nothing.

use super::{BenchReport, Row};
use crate::chart::{Chart, Scale, Series, Style};

impl BenchReport {
    /// Returns run time over error as SVG.
    pub fn chart(&self, title: &str) -> String {
        let shown: Vec<&Row> = self
            .rows
            .iter()
            .filter(|row| row.error.is_some_and(|error| error > 0.0 && error < 3.0))
            .collect();
        let subtitle = format!(
            "{} over error at the end, {} thread{}; errors against {} in {} steps (±{:.0e})",
            self.ranked_by,
            self.provenance.threads,
            if self.provenance.threads == 1 { "" } else { "s" },
            self.reference.scheme,
            self.reference.steps,
            self.reference.difference,
        );
        let labels = ["relative error at the end", &format!("{} (s)", self.ranked_by)];
        let mut chart = Chart::new(title, subtitle, labels, [Scale::Logarithmic; 2]);
        chart.bound = Some(("wanted".to_owned(), self.accuracy));
        let place = |row: &Row| (row.error.unwrap_or(f64::NAN), self.cost(row).unwrap_or(f64::NAN));
        let mut front: Vec<(f64, f64)> =
            shown.iter().filter(|row| row.on_front).map(|row| place(row)).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        chart.band = Some(("Pareto front".to_owned(), front));
        let present = shown.iter().filter(|row| row.is_present);
        chart.marks = present.map(|row| ("now".to_owned(), place(row))).collect();
        let mut names: Vec<&str> = Vec::new();
        for row in &shown {
            if !names.contains(&row.scheme.as_str()) {
                names.push(&row.scheme);
            }
        }
        for name in names {
            let mut own: Vec<&&Row> = shown.iter().filter(|row| row.scheme == *name).collect();
            own.sort_by_key(|row| row.steps);
            chart.series.push(Series {
                name: name.to_owned(),
                points: own.iter().map(|row| place(row)).collect(),
                style: Style::Marked,
                // Errors no larger than that of the reference are drawn hollow.
                hollow: (0..own.len()).filter(|&k| own[k].at_reference).collect(),
            });
        }
        chart.svg()
    }
}
