//! Estimates the cost of a tenth of the required error, from the rows of a bench.

use serde::Serialize;

use super::{Measure, Row};

/// Steps that should reach an error aim at this fraction of it.
const SAFETY: f64 = 0.8;
/// Orders below this are no convergence.
const LEAST_ORDER: f64 = 0.8;

/// The cheapest way to a tenth of the required error.
#[derive(Debug, Clone, Serialize)]
pub struct Tenth {
    /// The scheme with its stages.
    pub scheme: String,
    /// Steps.
    pub steps: u64,
    /// Cost by which rows are ranked, s.
    pub seconds: f64,
    /// Whether a row has this error; otherwise steps and cost follow from the orders of the rows.
    pub is_measured: bool,
}

/// Returns the cheapest way to a tenth of `accuracy`; `None` if no row reaches it or shows an order.
pub(super) fn tenth(rows: &[Row], measure: Measure, accuracy: f64) -> Option<Tenth> {
    let ways = rows.iter().filter_map(|row| way(rows, row, measure, 0.1 * accuracy));
    ways.min_by(|a, b| a.seconds.total_cmp(&b.seconds))
}

/// Returns the way to the error `wanted` by the scheme of `row`, from this row and the one with half the steps.
fn way(rows: &[Row], row: &Row, measure: Measure, wanted: f64) -> Option<Tenth> {
    let (error, seconds) = (row.error?, row.cost(measure)?);
    let at = |steps: u64, is_measured| Tenth {
        scheme: row.scheme.clone(),
        steps,
        seconds: seconds * steps as f64 / row.steps as f64,
        is_measured,
    };
    if error <= wanted {
        return Some(at(row.steps, true));
    }
    // Rows with finer steps say more.
    let is_finest = rows
        .iter()
        .all(|other| other.scheme != row.scheme || other.steps <= row.steps || other.error.is_none());
    let order = row.observed_order.filter(|order| *order >= LEAST_ORDER && is_finest)?;
    let finer = (error / (SAFETY * wanted)).powf(1.0 / order);
    Some(at((row.steps as f64 * finer).ceil() as u64, false))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::auto::trial::Choice;
    use crate::scene::SchemeName;

    /// A row of a scheme of order 2 with the error steps^−2 and 1 ms per step.
    fn row(steps: u64) -> Row {
        let choice = Choice { scheme: SchemeName::StormerVerlet, stages: None, steps };
        Row {
            seconds: Some(1e-3 * steps as f64),
            processor_seconds: Some(1e-3 * steps as f64),
            error: Some((steps as f64).powi(-2)),
            observed_order: Some(2.0),
            ..Row::new(choice, 1.0)
        }
    }

    #[test]
    fn the_order_of_the_rows_gives_the_steps_of_a_tenth() {
        let rows = [row(16), row(32)];
        let found = |accuracy| tenth(&rows, Measure::ProcessorTime, accuracy).unwrap();
        // 1/1000 needs √1000 = 31.6 steps, a tenth of it 100.
        let measured = found(1e-2);
        assert!(measured.is_measured && measured.steps == 32 && measured.seconds == 0.032);
        let extrapolated = found(1e-3);
        assert!(!extrapolated.is_measured && (100..=113).contains(&extrapolated.steps), "{extrapolated:?}");
        assert_eq!(extrapolated.seconds, 1e-3 * extrapolated.steps as f64);
        let unordered = Row { observed_order: None, ..row(32) };
        assert!(tenth(&[unordered], Measure::ProcessorTime, 1e-3).is_none());
    }
}
