//! Draws the energies of a run over time from its history.

use std::io;
use std::path::Path;

use crate::chart::{Chart, Scale, Series, Style};

/// Largest number of points in a chart. Of a longer series the minimum and maximum of each stretch are drawn.
const MOST_POINTS: usize = 2000;

/// Writes `energy.svg` beside history.csv.
///
/// # Errors
/// Returns an error if a file cannot be read or written.
pub(super) fn write(directory: &Path, title: &str, scheme: &str) -> io::Result<()> {
    let history = std::fs::read_to_string(directory.join("history.csv"))?;
    std::fs::write(directory.join("energy.svg"), draw(&history, title, scheme))
}

fn draw(history: &str, title: &str, scheme: &str) -> String {
    let mut lines = history.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let column = |name: &str| -> Option<Vec<f64>> {
        let at = names.iter().position(|other| *other == name)?;
        rows.iter().map(|row| row.get(at)?.parse().ok()).collect()
    };
    let labels = ["t (s)", "energy (J)"];
    let mut chart = Chart::new(title, scheme.to_owned(), labels, [Scale::Linear; 2]);
    let times = column("t").unwrap_or_default();
    for name in ["total", "kinetic", "elastic", "gravity", "load"] {
        let Some(values) = column(name) else { continue };
        if name == "total" || values.iter().any(|value| *value != 0.0) {
            let points: Vec<(f64, f64)> = times.iter().copied().zip(values).collect();
            let (points, style, hollow) = (thinned(&points), Style::Line, Vec::new());
            chart.series.push(Series { name: name.to_owned(), points, style, hollow });
        }
    }
    chart.svg()
}

/// Returns the lowest and the highest point of each stretch of points, in order; all points if there are few.
fn thinned(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= MOST_POINTS {
        return points.to_vec();
    }
    let stretch = (2 * points.len()).div_ceil(MOST_POINTS);
    let mut kept = Vec::with_capacity(MOST_POINTS);
    for part in points.chunks(stretch) {
        let by_value = |&a: &usize, &b: &usize| part[a].1.total_cmp(&part[b].1);
        let (low, high) = ((0..part.len()).min_by(by_value), (0..part.len()).max_by(by_value));
        if let (Some(low), Some(high)) = (low, high) {
            kept.push(part[low.min(high)]);
            kept.push(part[low.max(high)]);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thinned_line_keeps_its_extremes_and_its_order() {
        let wave = |k: usize| (k as f64, (k as f64 * 0.37).sin() * if k == 12_345 { 9.0 } else { 1.0 });
        let points: Vec<(f64, f64)> = (0..50_000).map(wave).collect();
        let kept = thinned(&points);
        assert!(kept.len() <= MOST_POINTS && kept.windows(2).all(|pair| pair[0].0 <= pair[1].0));
        let extremes = |points: &[(f64, f64)]| {
            points.iter().fold((f64::MAX, f64::MIN), |(low, high), p| (low.min(p.1), high.max(p.1)))
        };
        assert_eq!(extremes(&points), extremes(&kept));
    }
}
