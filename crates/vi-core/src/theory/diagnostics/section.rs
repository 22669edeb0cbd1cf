//! Poincaré sections: the states at which a run crosses q_k = level.

use crate::contract::system::State;

/// The section q_k = level, crossed with increasing q_k.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Section {
    /// The coordinate k.
    pub coordinate: usize,
    /// Value of the coordinate on the section.
    pub level: f64,
}

impl Section {
    /// Returns the state on the section, if the run crosses it between two successive states. `rate(state)` gives
    /// (q̇, ṗ). Each entry follows its Hermite cubic between the two states, with an error of order h⁴.
    pub fn crossing(
        &self,
        before: &State,
        after: &State,
        rate: impl Fn(&State) -> (Vec<f64>, Vec<f64>),
    ) -> Option<State> {
        let k = self.coordinate;
        if !(before.q[k] < self.level && after.q[k] >= self.level) {
            return None;
        }
        let h = after.t - before.t;
        let (rate_0, rate_1) = (rate(before), rate(after));
        let cubic = |a: f64, da: f64, b: f64, db: f64, s: f64| {
            let d = 1.0 - s;
            a * d * d * (1.0 + 2.0 * s) + h * da * s * d * d + b * s * s * (3.0 - 2.0 * s)
                - h * db * s * s * d
        };
        let height = |s: f64| cubic(before.q[k], rate_0.0[k], after.q[k], rate_1.0[k], s) - self.level;
        // Bisection: the sign changes between 0 and 1, and the cubic is cheap to evaluate.
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if height(middle) < 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        let blend = |a: &[f64], da: &[f64], b: &[f64], db: &[f64]| -> Vec<f64> {
            (0..a.len()).map(|i| cubic(a[i], da[i], b[i], db[i], high)).collect()
        };
        Some(State {
            t: before.t + high * h,
            q: blend(&before.q, &rate_0.0, &after.q, &rate_1.0),
            p: blend(&before.p, &rate_0.1, &after.p, &rate_1.1),
        })
    }
}
