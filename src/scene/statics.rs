//! `[static]`, as a scene says it. It must not know how equilibria are found.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_solvers::StaticOptions;

/// `[static]`: the scene is solved for equilibrium at every step of `[time]`, t being the load factor
/// that amplitudes and motions read; the scheme is not used. Every step is cut further as it needs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Static {
    /// Relative tolerance in the energy norm, 1e-14 to 0.1 (default 1e-8).
    #[serde(default = "Static::default_tolerance")]
    pub tolerance: f64,
    /// Smallest increment of t before the solve has failed (default 1e-6).
    #[serde(default = "Static::default_smallest_increment")]
    pub smallest_increment: f64,
    /// Follow the path of equilibria by its arc length, in at most so many steps between rows.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arc_steps: Option<u32>,
    /// Where the path becomes unstable, leave it along the critical mode: amplitude of the push, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub push: Option<f64>,
}

impl Static {
    fn default_tolerance() -> f64 {
        StaticOptions::default().tolerance
    }

    fn default_smallest_increment() -> f64 {
        StaticOptions::default().smallest_increment
    }

    /// The options of the solver.
    pub fn options(&self) -> StaticOptions {
        StaticOptions {
            tolerance: self.tolerance,
            smallest_increment: self.smallest_increment,
            arc_steps: self.arc_steps,
            push: self.push,
            ..StaticOptions::default()
        }
    }
}

impl Default for Static {
    fn default() -> Self {
        Self {
            tolerance: Self::default_tolerance(),
            smallest_increment: Self::default_smallest_increment(),
            arc_steps: None,
            push: None,
        }
    }
}
