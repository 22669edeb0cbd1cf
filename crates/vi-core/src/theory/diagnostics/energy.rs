//! The envelope of a quantity over a long run. Comparing its extremes in the first and the last part distinguishes an
//! oscillation from a drift.

/// Extremes of a value over equal windows of a run of known length.
#[derive(Debug, Clone, PartialEq)]
pub struct Envelope {
    window: usize,
    seen: usize,
    extremes: Vec<(f64, f64)>,
}

impl Envelope {
    /// Returns an envelope with windows of `window` values each.
    pub fn new(window: usize) -> Self {
        Self { window: window.max(1), seen: 0, extremes: Vec::new() }
    }

    /// Enters the next value of the run.
    pub fn enter(&mut self, value: f64) {
        if self.seen.is_multiple_of(self.window) {
            self.extremes.push((value, value));
        }
        self.seen += 1;
        if let Some((low, high)) = self.extremes.last_mut() {
            *low = low.min(value);
            *high = high.max(value);
        }
    }

    /// Returns (smallest, largest) value of each window.
    pub fn extremes(&self) -> &[(f64, f64)] {
        &self.extremes
    }

    /// Returns the largest minus the smallest value of the whole run.
    pub fn spread(&self) -> f64 {
        let low = self.extremes.iter().map(|e| e.0).fold(f64::INFINITY, f64::min);
        let high = self.extremes.iter().map(|e| e.1).fold(f64::NEG_INFINITY, f64::max);
        high - low
    }

    /// Returns the mid-range of the last complete window minus that of the first.
    pub fn drift(&self) -> f64 {
        let complete = self.seen / self.window;
        if complete == 0 {
            return 0.0;
        }
        let middle = |(low, high): (f64, f64)| 0.5 * (low + high);
        middle(self.extremes[complete - 1]) - middle(self.extremes[0])
    }
}
