//! Scene keys of `[static]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_solvers::StaticOptions;

use super::{Axis, Solver, Time};

/// Default of the smallest increment, as a fraction of the end.
const SMALLEST_INCREMENT: f64 = 1e-6;

/// `[static]`: solves the scene for equilibrium at every step of `[time]`, where t is the load factor of amplitudes and
/// motions; the scheme is not used. Steps are cut as needed. With `arc_steps` or `control` the load factor is an
/// unknown, which column `load_factor` of history.csv holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Static {
    /// Relative tolerance in the energy norm, 1e-14 to 0.1 (default 1e-8).
    #[serde(default = "Static::default_tolerance")]
    pub tolerance: f64,
    /// Smallest increment of t before the solve fails (> 0; default: 1e-6 of the end).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smallest_increment: Option<f64>,
    /// Follow the path of equilibria by its arc length, through limit points, until the load factor is `time.end`, in
    /// at most this many arc steps; each is a step of the run. `time.step` is the change of the load factor in the
    /// first arc step, whose length is also the largest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arc_steps: Option<u32>,
    /// If the path becomes unstable, leave it along the critical mode: amplitude of the perturbation, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub push: Option<f64>,
    /// Follow the path of equilibria by a displacement or a volume instead of the load factor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub control: Option<Control>,
}

/// `static.control`: the quantity that changes linearly from its value at t = 0 to `to` at `time.end`. The load factor,
/// which amplitudes and motions depend on, is an unknown.
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
        /// A surface region of its mesh. It is closed, or its edges are clamped or slide in planes x, y or z = const.
        region: String,
        /// Increase of the volume from rest at `time.end`, m³.
        to: f64,
    },
}

impl Control {
    /// Returns the displacement (m) or the increase of the volume (m³) at the end.
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

    /// Returns whether the load factor is an unknown.
    pub fn follows_path(&self) -> bool {
        self.arc_steps.is_some() || self.control.is_some()
    }

    /// Returns the options of the solver. Steps with given load factors set their own end and increments.
    pub fn options(&self, time: &Time, solver: &Solver) -> StaticOptions {
        let increment = time.steps().1;
        StaticOptions {
            end: time.end,
            increment,
            largest_increment: increment,
            tolerance: self.tolerance,
            smallest_increment: self.smallest_increment.unwrap_or(SMALLEST_INCREMENT * time.end),
            arc_steps: self.arc_steps,
            push: self.push,
            linear: solver.linear.solver(),
            interrupt: solver.interrupt.clone(),
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
