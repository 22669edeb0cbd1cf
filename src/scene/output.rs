//! Scene keys of the files that a run writes, and of assertions at its end.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_fem::ElementField;

/// A field for the frames. Only fields that are named are computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Field {
    /// Displacement from rest, m (points).
    Displacement,
    /// Velocity, m/s (points).
    Velocity,
    /// Acceleration M⁻¹(f − ∂V/∂x), m/s²; for prescribed coordinates that of their path (points).
    Acceleration,
    /// Force of weight, loads and wind, N; weight acts on the lumped mass (points).
    ExternalForce,
    /// Force that holds the prescribed coordinates, N; zero elsewhere (points). The inertia of accelerating prescribed
    /// coordinates is not included.
    ReactionForce,
    /// Cauchy stress, Pa, 9 components by rows (cells).
    Stress,
    /// Von Mises stress, Pa (cells).
    VonMises,
    /// Green–Lagrange strain, 9 components by rows (cells).
    Strain,
    /// Volume ratio det F (cells).
    #[serde(rename = "J")]
    J,
    /// Strain energy per rest volume, J/m³ (cells).
    EnergyDensity,
    /// Cauchy stress smoothed to the nodes, Pa, 9 components by rows (points).
    NodalStress,
    /// Von Mises stress of the smoothed stress, Pa (points).
    NodalVonMises,
    /// Green–Lagrange strain smoothed to the nodes, 9 components by rows (points).
    NodalStrain,
    /// Volume ratio det F smoothed to the nodes (points).
    #[serde(rename = "nodal_J")]
    NodalJ,
    /// Strain energy per rest volume smoothed to the nodes, J/m³ (points).
    NodalEnergyDensity,
    /// Contact force per area without friction, Pa (points).
    ContactTraction,
    /// Its size on the side of the point where it is larger, Pa: a sheet may be pressed from both sides (points).
    ContactPressure,
    /// Tangential velocity of the surface relative to the nearest opposite one, m/s; zero without contact (points).
    Slip,
    /// Gap to the opposite surface, m; the thickness d̂ of the contact layer if the point has no contact (points).
    Gap,
    /// Number of the body in the scene, from 0 (cells).
    BodyId,
    /// Number of the material entry of the body, from 0 (cells).
    MaterialId,
}

impl Field {
    /// All fields.
    pub const ALL: &'static [Self] = &[
        Self::Displacement,
        Self::Velocity,
        Self::Acceleration,
        Self::ExternalForce,
        Self::ReactionForce,
        Self::Stress,
        Self::VonMises,
        Self::Strain,
        Self::J,
        Self::EnergyDensity,
        Self::NodalStress,
        Self::NodalVonMises,
        Self::NodalStrain,
        Self::NodalJ,
        Self::NodalEnergyDensity,
        Self::ContactTraction,
        Self::ContactPressure,
        Self::Slip,
        Self::Gap,
        Self::BodyId,
        Self::MaterialId,
    ];

    /// Returns the name in scenes and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Displacement => "displacement",
            Self::Velocity => "velocity",
            Self::Acceleration => "acceleration",
            Self::ExternalForce => "external_force",
            Self::ReactionForce => "reaction_force",
            Self::Stress => "stress",
            Self::VonMises => "von_mises",
            Self::Strain => "strain",
            Self::J => "J",
            Self::EnergyDensity => "energy_density",
            Self::NodalStress => "nodal_stress",
            Self::NodalVonMises => "nodal_von_mises",
            Self::NodalStrain => "nodal_strain",
            Self::NodalJ => "nodal_J",
            Self::NodalEnergyDensity => "nodal_energy_density",
            Self::ContactTraction => "contact_traction",
            Self::ContactPressure => "contact_pressure",
            Self::Slip => "slip",
            Self::Gap => "gap",
            Self::BodyId => "body_id",
            Self::MaterialId => "material_id",
        }
    }

    /// Returns the number of values per node or element: 3 for a vector, 9 for a tensor, 0 for an identifier such as
    /// `body_id`.
    pub fn component_count(self) -> usize {
        match (self.of_elements(), self) {
            (Some((field, _)), _) => field.component_count(),
            (None, Self::BodyId | Self::MaterialId) => 0,
            (None, Self::ContactPressure | Self::Gap) => 1,
            (None, _) => 3,
        }
    }

    /// Returns whether it needs a scene with contact.
    pub fn is_of_contact(self) -> bool {
        matches!(self, Self::ContactTraction | Self::ContactPressure | Self::Slip | Self::Gap)
    }

    /// Returns whether it is a nodal force, which can be summed.
    pub fn is_force(self) -> bool {
        matches!(self, Self::ExternalForce | Self::ReactionForce)
    }

    /// Returns the field of solid elements that it shows, if any, and whether it is smoothed to the nodes.
    pub fn of_elements(self) -> Option<(ElementField, bool)> {
        Some(match self {
            Self::Stress => (ElementField::Stress, false),
            Self::VonMises => (ElementField::VonMises, false),
            Self::Strain => (ElementField::Strain, false),
            Self::J => (ElementField::J, false),
            Self::EnergyDensity => (ElementField::EnergyDensity, false),
            Self::NodalStress => (ElementField::Stress, true),
            Self::NodalVonMises => (ElementField::VonMises, true),
            Self::NodalStrain => (ElementField::Strain, true),
            Self::NodalJ => (ElementField::J, true),
            Self::NodalEnergyDensity => (ElementField::EnergyDensity, true),
            _ => return None,
        })
    }
}

/// Precision of the frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// 32 bits, for viewing.
    #[default]
    F32,
    /// 64 bits: a frame can start another run.
    F64,
}

/// Storage of arrays in the frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Encoding {
    /// Appended raw, zlib.
    #[default]
    Raw,
    /// Inline base64, zlib: for readers that cannot read appended data.
    Base64,
}

/// Format of surfaces for animation programs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Cache {
    /// A PC2 point cache per body, with one OBJ file that has its triangles and texture coordinates.
    Pc2,
    /// As "pc2", and at the end of the run an MDD point cache per body with the same points.
    Mdd,
    /// An OBJ file per body and frame.
    Obj,
    /// A binary PLY file per body and frame.
    Ply,
}

impl Cache {
    /// Returns whether each body has one file with all samples.
    pub(crate) fn is_point_cache(self) -> bool {
        matches!(self, Self::Pc2 | Self::Mdd)
    }
}

/// When frames are due.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Schedule {
    /// At the steps nearest to the multiples of this time, s.
    Interval(f64),
    /// At the multiples of 1/rate, s, also between steps.
    Rate(f64),
}

impl Schedule {
    /// Returns the time between frames, s.
    pub(crate) fn interval(self) -> f64 {
        match self {
            Self::Interval(interval) => interval,
            Self::Rate(rate) => 1.0 / rate,
        }
    }

    /// Returns the time of frame number `frame`, s.
    pub(crate) fn time(self, frame: usize) -> f64 {
        match self {
            Self::Interval(interval) => frame as f64 * interval,
            Self::Rate(rate) => frame as f64 / rate,
        }
    }

    /// Returns whether frame number `frame` is due at the end of step `steps`, of h (s) each.
    pub(crate) fn is_due(self, frame: usize, steps: u64, h: f64) -> bool {
        let end = steps as f64 * h;
        match self {
            Self::Interval(_) => end + 0.5 * h > self.time(frame),
            // A frame within round-off of the end of a step belongs to this step.
            Self::Rate(_) => end + ROUND_OFF * h >= self.time(frame),
        }
    }

    /// Returns whether frame number `frame` lies before the end of step `steps`, so that its state must be
    /// interpolated.
    pub(crate) fn is_within(self, frame: usize, steps: u64, h: f64) -> bool {
        matches!(self, Self::Rate(_)) && self.time(frame) < (steps as f64 - ROUND_OFF) * h
    }
}

/// Fraction of a step below which two times count as equal: far above round-off, far below what is visible.
const ROUND_OFF: f64 = 1e-6;

/// `[output]`: the files of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Output {
    /// Directory, relative to the working directory (default `out/<scene>`); `--out` overrides.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "super::path_as_text")]
    pub directory: Option<PathBuf>,
    /// Time between frames, s (> 0); without it there are no frames. A frame is written at the nearest step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<f64>,
    /// Frames per second (> 0), instead of `interval`: at the times 0, 1/fps, 2/fps … for any step. Between steps,
    /// states are interpolated (docs/files.md); no step is changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fps: Option<f64>,
    /// Also write the surface of every body for animation programs, at `fps`: "pc2" (a point cache and one OBJ file),
    /// "mdd" (as "pc2", and an MDD file at the end), "obj" or "ply" (a sequence).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cache: Option<Cache>,
    /// Write a row of history.csv every n steps, and always the first and the last (default 1; 0: those two only).
    #[serde(default = "Output::default_history")]
    pub history: u64,
    /// Fields of the frames; only these are computed.
    #[serde(default = "Output::default_fields")]
    pub fields: Vec<Field>,
    /// Precision of the frames.
    #[serde(default)]
    pub precision: Precision,
    /// Encoding of the frames.
    #[serde(default)]
    pub encoding: Encoding,
    /// Largest number of points of a frame in one file (≥ 1; default 50 000 000). A larger frame is a .pvtu file and pieces of
    /// at most this many points.
    #[serde(default = "Output::default_piece_points")]
    pub piece_points: u64,
    /// Keep the full energy ledger: the work, scheme error and residual work of every step, each computed on its own.
    /// It costs an energy evaluation per step, and an extra residual in implicit steps. Default: if external work is
    /// done on a body (moving supports, wind, damping, loads that follow or change), because without the ledger that
    /// work would look like drift.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ledger: Option<bool>,
    /// Draw the energies over time as `energy.svg` when the run ends (default false; `run --chart`).
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub chart: bool,
}

impl Output {
    /// Returns the times at which frames are due; `None` without frames.
    pub(crate) fn schedule(&self) -> Option<Schedule> {
        self.fps.map(Schedule::Rate).or(self.interval.map(Schedule::Interval))
    }

    fn default_history() -> u64 {
        1
    }

    fn default_piece_points() -> u64 {
        50_000_000
    }

    fn default_fields() -> Vec<Field> {
        vec![Field::Displacement]
    }
}

impl Default for Output {
    fn default() -> Self {
        Self {
            directory: None,
            interval: None,
            fps: None,
            cache: None,
            history: Self::default_history(),
            fields: Self::default_fields(),
            precision: Precision::default(),
            encoding: Encoding::default(),
            piece_points: Self::default_piece_points(),
            ledger: None,
            chart: false,
        }
    }
}

/// `[assert]`: makes a scene a test; exit code 3 if an assertion is broken.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Assert {
    /// Largest |H − H₀ − work of moving supports, forces and damping| over the largest kinetic energy.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub energy_drift: Option<f64>,
    /// Largest change of linear momentum over the largest Σ m|v| (free bodies without gravity).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub momentum_drift: Option<f64>,
    /// Largest change of angular momentum over the largest Σ m|x||v| (free bodies without gravity).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angular_momentum_drift: Option<f64>,
    /// Smallest gap allowed between surfaces in contact, at the start and after every step, m (≥ 0, needs `[contact]`). Surfaces
    /// that cross in a row of history.csv have none, those of bodies with prescribed motion too.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub smallest_gap: Option<f64>,
    /// Largest number allowed of edges that cross triangles of other bodies or of the same body, and of points within
    /// half-spaces, in any row of history.csv, found by exact predicates (needs `[contact]`). Bodies with prescribed motion
    /// count.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intersections: Option<u64>,
}
