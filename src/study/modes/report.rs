//! The modes of a scene as a table, as JSON and as a chart. This file solves nothing.

use std::fmt::Write as _;

use serde::Serialize;

use super::found::{SceneMode, SceneModes};
use crate::chart::{Chart, Scale, Series, Style};
use crate::run::provenance::Provenance;
use crate::scene::MassKind;

/// Computed modes.
#[derive(Debug, Clone, Serialize)]
pub struct ModesReport {
    /// Origin of the result.
    pub provenance: Provenance,
    /// The mass matrix.
    pub mass: MassKind,
    /// Mass that can move along x, y and z, kg.
    pub free_mass: [f64; 3],
    /// The modes, by ascending ω².
    pub modes: Vec<ModeFacts>,
    /// Notes for the reader, for example on missing modes.
    pub notes: Vec<String>,
}

/// Data of one mode.
#[derive(Debug, Clone, Serialize)]
pub struct ModeFacts {
    /// Number of the component that vibrates.
    pub component: usize,
    /// ω/2π, Hz; zero if ω² is not positive.
    pub frequency: f64,
    /// ω², 1/s²; negative if the state is unstable.
    pub omega_squared: f64,
    /// Whether the mode is a rigid motion without strain.
    pub is_rigid: bool,
    /// Residual of the eigenproblem, relative.
    pub residual: f64,
    /// Effective modal mass along x, y and z, kg: (φᵀMe)²/(φᵀMφ).
    pub effective_mass: [f64; 3],
    /// Sum of the effective masses of this mode and all lower ones, divided by the free mass: 1 if all modes are
    /// included.
    pub cumulative_share: [f64; 3],
}

impl ModeFacts {
    /// Returns √|ω²|/2π with the sign of ω², Hz.
    pub(super) fn signed_frequency(&self) -> f64 {
        self.omega_squared.signum() * self.omega_squared.abs().sqrt() / std::f64::consts::TAU
    }
}

impl ModesReport {
    pub(super) fn new(provenance: Provenance, mass: MassKind, found: &SceneModes) -> Self {
        let mut sum = [0.0; 3];
        let facts = |SceneMode { component, mode }: &SceneMode| {
            let effective_mass = mode.participation.map(|factor| factor * factor);
            (0..3).for_each(|axis| sum[axis] += effective_mass[axis]);
            ModeFacts {
                component: *component,
                frequency: mode.frequency(),
                omega_squared: mode.omega_squared,
                is_rigid: mode.is_rigid,
                residual: mode.residual,
                effective_mass,
                cumulative_share: [0, 1, 2].map(|axis| share(sum[axis], found.free_mass[axis])),
            }
        };
        let modes = found.modes.iter().map(facts).collect();
        Self { provenance, mass, free_mass: found.free_mass, modes, notes: Vec::new() }
    }

    pub(super) fn with_notes(self, notes: Vec<String>) -> Self {
        Self { notes, ..self }
    }

    /// Returns the table for a terminal, with effective masses as fractions of the free mass.
    pub fn table(&self) -> String {
        let mut text = format!(
            "{:>4} {:>16}    {:^23}   {:^23}\n{:>4} {:>16}    {:>7} {:>7} {:>7}   {:>7} {:>7} {:>7}\n",
            "", "frequency", "effective mass (%)", "sum (%)", "mode", "(Hz)", "x", "y", "z", "x", "y", "z"
        );
        for (number, mode) in self.modes.iter().enumerate() {
            let own = [0, 1, 2].map(|axis| 100.0 * share(mode.effective_mass[axis], self.free_mass[axis]));
            let sum = mode.cumulative_share.map(|share| 100.0 * share);
            let name = match (mode.is_rigid, mode.omega_squared < 0.0) {
                (true, _) => "  rigid",
                (false, true) => "  unstable",
                (false, false) => "",
            };
            // Writing into a string cannot fail.
            let _ = writeln!(
                text,
                "{number:4} {:16.9}    {:7.2} {:7.2} {:7.2}   {:7.2} {:7.2} {:7.2}{name}",
                mode.frequency, own[0], own[1], own[2], sum[0], sum[1], sum[2]
            );
        }
        let [x, y, z] = self.free_mass;
        let _ = writeln!(text, "mass that can move along x, y, z: {x:.6e}, {y:.6e}, {z:.6e} kg");
        text
    }

    /// Returns one row per mode.
    pub fn csv(&self) -> String {
        let mut text = String::from("mode,component,omega_squared,frequency,rigid,residual");
        for column in ["effective_mass", "effective_share", "cumulative_share"] {
            ["x", "y", "z"].iter().for_each(|axis| text.push_str(&format!(",{column}_{axis}")));
        }
        text.push('\n');
        for (number, mode) in self.modes.iter().enumerate() {
            let _ = write!(
                text,
                "{number},{},{:.16e},{:.16e},{},{:.3e}",
                mode.component, mode.omega_squared, mode.frequency, mode.is_rigid, mode.residual
            );
            let shares = [0, 1, 2].map(|axis| share(mode.effective_mass[axis], self.free_mass[axis]));
            for value in mode.effective_mass.iter().chain(&shares).chain(&mode.cumulative_share) {
                let _ = write!(text, ",{value:.16e}");
            }
            text.push('\n');
        }
        text
    }

    /// Returns the report as JSON.
    pub(super) fn json(&self) -> String {
        format!("{:#}\n", serde_json::json!(self))
    }

    /// Returns effective masses over frequencies, as SVG.
    pub fn chart(&self) -> String {
        let unit = format!(
            "of {} modes, {} mass",
            self.modes.len(),
            serde_json::json!(self.mass).as_str().unwrap_or("")
        );
        let labels = ["frequency (Hz)", "effective mass (share of what can move)"];
        let mut chart = Chart::new(&self.provenance.scene, unit, labels, [Scale::Linear; 2]);
        for (axis, name) in ["along x", "along y", "along z"].into_iter().enumerate() {
            let own =
                |mode: &ModeFacts| (mode.frequency, share(mode.effective_mass[axis], self.free_mass[axis]));
            chart.series.push(Series {
                name: name.to_owned(),
                points: self.modes.iter().map(own).collect(),
                style: Style::Stems,
                hollow: Vec::new(),
            });
        }
        chart.svg()
    }
}

/// Returns part/whole, or zero if nothing can move.
fn share(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}
