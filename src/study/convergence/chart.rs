//! A convergence study as a chart: the distance of each quantity from its limit, over the size of elements or steps,
//! both logarithmic; an order appears as a slope. This file measures nothing.

use super::{ConvergenceReport, Row, Verdict};
use crate::chart::{Chart, Scale, Series, Style};

impl ConvergenceReport {
    /// Returns the distance from the limit over the size, as SVG.
    pub fn chart(&self, title: &str) -> String {
        let order =
            self.formal_order.map(|order| format!("; the scheme is of order {order}")).unwrap_or_default();
        let is_zero = |row: &&Row| row.extrapolation.verdict == Verdict::IsZero;
        let zeros = self.studies.iter().flat_map(|study| &study.rows).filter(is_zero).count();
        let left_out = match zeros {
            0 => String::new(),
            count => format!("; {count} zero to round-off not drawn"),
        };
        let subtitle = format!("differences from Richardson's limit, relative to it{order}{left_out}");
        let labels = ["size of elements or steps, over that of the scene", "relative difference"];
        let mut chart = Chart::new(title, subtitle, labels, [Scale::Logarithmic; 2]);
        for study in &self.studies {
            let coarsest = study.levels.first().map_or(1.0, |level| level.step);
            let size = |level: &super::Level| match study.of {
                "space" => 0.5_f64.powi(level.refined as i32),
                _ => level.step / coarsest,
            };
            for row in study.rows.iter().filter(|row| !is_zero(row)) {
                let limit = row.extrapolation.value;
                let points = study.levels.iter().zip(&row.values);
                let points = points.map(|(level, value)| (size(level), ((value - limit) / limit).abs()));
                chart.series.push(Series {
                    name: format!("{}: {}", study.of, row.quantity),
                    points: points.collect(),
                    style: Style::Marked,
                    hollow: Vec::new(),
                });
            }
        }
        chart.svg()
    }
}
