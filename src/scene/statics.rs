//! `[static]`, as a scene says it. Nothing here knows how equilibria are found.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_solvers::StaticOptions;

use super::{Axis, Time};

/// Smallest increment by default, as a part of the end.
const SMALLEST_INCREMENT: f64 = 1e-6;

/// `[static]`: the scene is solved for equilibrium at every step of `[time]`, t being the load factor
/// that amplitudes and motions read; the scheme is not used. Every step is cut further as it needs.
/// With `arc_steps` or `control` the load factor is not given but found, and column `load_factor` of
/// history.csv holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Static {
    /// Relative tolerance in the energy norm, 1e-14 to 0.1 (default 1e-8).
    #[serde(default = "Static::default_tolerance")]
    pub tolerance: f64,
    /// Smallest increment of t before the solve has failed (> 0; default: 1e-6 of the end).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smallest_increment: Option<f64>,
    /// Follow the path of equilibria by its arc length, through limit points, until the load factor is `time.end`,
    /// in at most so many arc steps; each is a step of the run. `time.step` is the change of the load factor in the
    /// first, and the longest of them are as long.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arc_steps: Option<u32>,
    /// Where the path becomes unstable, leave it along the critical mode: amplitude of the push, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub push: Option<f64>,
    /// Follow the path of equilibria by a displacement or a volume instead of the load factor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub control: Option<Control>,
}

/// `static.control`: what goes evenly from where it is at t = 0 to `to` at `time.end`. The load factor, which
/// amplitudes and motions read, is found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Control {
    /// The displacement of a probe along an axis.
    Displacement {
        /// Name of the probe.
        probe: String,
        /// Axis.
        axis: Axis,
        /// Displacement at `time.end`, m.
        to: f64,
    },
    /// The volume that a surface encloses on the side where a pressure on it acts, e.g. a cavity.
    Volume {
        /// The body.
        body: String,
        /// A surface region of its mesh; it is closed, or its edges are clamped or slide in planes x, y or z = const.
        region: String,
        /// Growth of the volume from rest at `time.end`, m³.
        to: f64,
    },
}

impl Control {
    /// Displacement (m) or growth of the volume (m³) at the end.
    pub fn to(&self) -> f64 {
        match self {
            Self::Displacement { to, .. } | Self::Volume { to, .. } => *to,
        }
    }
}

impl Static {
    fn default_tolerance() -> f64 {
        StaticOptions::default().tolerance
    }

    /// Is the load factor found instead of given?
    pub fn follows_path(&self) -> bool {
        self.arc_steps.is_some() || self.control.is_some()
    }

    /// The options of the solver. Steps between load factors that are given set their own end and increments.
    pub fn options(&self, time: &Time) -> StaticOptions {
        let increment = time.steps().1;
        StaticOptions {
            end: time.end,
            increment,
            largest_increment: increment,
            tolerance: self.tolerance,
            smallest_increment: self.smallest_increment.unwrap_or(SMALLEST_INCREMENT * time.end),
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
            smallest_increment: None,
            arc_steps: None,
            push: None,
            control: None,
        }
    }
}
