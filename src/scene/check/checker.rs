//! Collects the problems of a scene, and provides the checks of numbers that several keys use.

use crate::scene::problem::Problem;

/// The problems found so far, each with its key.
#[derive(Default)]
pub(super) struct Checker {
    pub(super) problems: Vec<Problem>,
}

impl Checker {
    pub(super) fn say(&mut self, key: impl Into<String>, message: impl Into<String>) {
        self.problems.push(Problem::new(key, message));
    }

    pub(super) fn positive(&mut self, key: impl Into<String>, value: f64, unit: &str) {
        if !(value > 0.0 && value.is_finite()) {
            self.say(key, format!("must be positive and finite, is {value} {unit}"));
        }
    }

    pub(super) fn finite(&mut self, key: impl Into<String>, values: &[f64]) {
        if let Some(value) = values.iter().find(|value| !value.is_finite()) {
            self.say(key, format!("must be finite, holds {value}"));
        }
    }

    pub(super) fn at_most_one_of(&mut self, key: &str, given: &[(&str, bool)], needed: bool) {
        let count = given.iter().filter(|(_, is_given)| *is_given).count();
        let names: Vec<_> = given.iter().map(|(name, _)| format!("`{name}`")).collect();
        let names = names.join(", ");
        if count > 1 {
            self.say(key, format!("give only one of {names}"));
        } else if count == 0 && needed {
            self.say(key, format!("missing key: give one of {names}"));
        }
    }
}
