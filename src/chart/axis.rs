//! An axis of a chart: its range, the positions of values on it, and its ticks. This file draws nothing.

/// Spacing of values along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Scale {
    /// Linear spacing.
    Linear,
    /// Logarithmic spacing, by powers of ten.
    Logarithmic,
}

/// An axis from position `from` to position `to` with the values `low` and `high` (their logarithms on a logarithmic
/// axis).
pub(super) struct Axis {
    scale: Scale,
    from: f64,
    to: f64,
    low: f64,
    high: f64,
}

impl Axis {
    /// Returns an axis whose range covers all values that its scale can represent.
    pub(super) fn over(scale: Scale, values: impl Iterator<Item = f64>, from: f64, to: f64) -> Self {
        let shown = values.filter_map(|value| scale.coordinate(value));
        let (low, high) = shown
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        let (low, high) = match (scale, low.is_finite()) {
            (_, false) => (0.0, 1.0),
            // The range extends to whole powers of ten.
            (Scale::Logarithmic, _) => {
                let low = (low - 0.05).floor();
                (low, (high + 0.05).ceil().max(low + 1.0))
            }
            (Scale::Linear, _) => {
                let room = 0.04 * (high - low).max(1e-3 * high.abs()).max(f64::MIN_POSITIVE);
                let is_based = low == 0.0;
                (if is_based { 0.0 } else { low - room }, high + room)
            }
        };
        Self { scale, from, to, low, high }
    }

    /// Returns the position of a value, or `None` if the axis cannot show it.
    pub(super) fn at(&self, value: f64) -> Option<f64> {
        let share = (self.scale.coordinate(value)? - self.low) / (self.high - self.low);
        Some(self.from + share.clamp(0.0, 1.0) * (self.to - self.from))
    }

    /// Returns the labels (SVG text) and positions of the ticks.
    pub(super) fn ticks(&self) -> Vec<(String, f64)> {
        let power = |power: f64| format!("10<tspan dy=\"-5\" font-size=\"10\">{power}</tspan>");
        let span = self.high - self.low;
        let step = match self.scale {
            // At most 12 powers of ten fit.
            Scale::Logarithmic => (span / 12.0).ceil().max(1.0),
            Scale::Linear => {
                let rough = span / 5.0;
                let decade = 10.0_f64.powf(rough.log10().floor());
                let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|factor| factor * decade >= rough);
                factor.unwrap_or(10.0) * decade
            }
        };
        let first = (self.low / step).ceil();
        let count = ((self.high / step).floor() - first) as i64;
        let tick = |k: i64| {
            let value = (first + k as f64) * step;
            let label = match self.scale {
                Scale::Logarithmic => power(value),
                Scale::Linear => linear_label(value, step, self.low.abs().max(self.high.abs())),
            };
            (label, self.from + (value - self.low) / span * (self.to - self.from))
        };
        (0..=count.clamp(0, 100)).map(tick).collect()
    }
}

impl Scale {
    fn coordinate(self, value: f64) -> Option<f64> {
        let coordinate = match self {
            Self::Linear => value,
            Self::Logarithmic if value > 0.0 => value.log10(),
            Self::Logarithmic => return None,
        };
        coordinate.is_finite().then_some(coordinate)
    }
}

/// Formats a multiple of `step` with as many digits as are needed to distinguish it from its neighbours.
fn linear_label(value: f64, step: f64, largest: f64) -> String {
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    if (1e-3..1e5).contains(&largest) {
        return format!("{value:.decimals$}");
    }
    let digits = (largest.log10().floor() - step.log10().floor()).clamp(0.0, 15.0) as usize;
    format!("{value:.digits$e}")
}
