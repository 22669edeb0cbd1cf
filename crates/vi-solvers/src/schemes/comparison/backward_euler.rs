//! Implicit Euler: û = q₀ + h v₀, c = h². Order 1; each step shrinks the phase area by the factor 1/(1 + z²).

use crate::schemes::one_stage::rule::{MultiplierDirections, Rule};

pub(crate) struct BackwardEuler;

impl Rule for BackwardEuler {
    fn name(&self) -> &'static str {
        "backward-euler"
    }
    fn coefficient(&self, h: f64) -> f64 {
        h * h
    }
    fn time(&self) -> f64 {
        1.0
    }
    fn moves_by_end_forces(&self) -> bool {
        true
    }
    fn offset(&self, _k: usize, v: f64, h: f64) -> f64 {
        h * v
    }
    fn change(&self, _k: usize, v: f64, w: f64, h: f64) -> (f64, f64) {
        (h * v + w, w / h)
    }
    fn multiplier_directions(&self) -> Option<MultiplierDirections> {
        Some(MultiplierDirections::Stage)
    }
}
