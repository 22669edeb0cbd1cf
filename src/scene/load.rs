//! Scene keys of loads and damping.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_fem::{Amplitude, FemError, VectorField};

use super::Selection;

/// A component of a field: a number, or a formula of `x y z`, the rest position (m).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum FieldComponent {
    /// One value everywhere.
    Number(f64),
    /// A formula such as `"1e3*(1 - y/2)"`.
    Formula(String),
}

/// `[[load]]`: a force on a body. Its `amplitude` is a number, a formula of t (s) or a table
/// `[[t, factor], …]`; in a static solve t is the load factor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Load {
    /// A dead traction on a surface: force per rest area, with a constant direction.
    Traction {
        /// The body.
        body: String,
        /// A part of its surface: a surface region, or the facets whose nodes are all selected.
        #[serde(flatten)]
        on: Selection,
        /// Traction, Pa.
        traction: [FieldComponent; 3],
        /// Time factor (default 1).
        #[serde(default)]
        amplitude: Amplitude,
    },
    /// A pressure that follows the deformed surface.
    Pressure {
        /// The body.
        body: String,
        /// A part of its surface: a surface region, or the facets whose nodes are all selected.
        #[serde(flatten)]
        on: Selection,
        /// Pressure, Pa; positive pushes into the body.
        pressure: f64,
        /// Time factor (default 1).
        #[serde(default)]
        amplitude: Amplitude,
    },
    /// A dead force at one node.
    Point {
        /// The body.
        body: String,
        /// A point, m: the nearest node is loaded.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        point: Option<[f64; 3]>,
        /// A node, instead of a point.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        node: Option<usize>,
        /// Force, N.
        force: [f64; 3],
        /// Time factor (default 1).
        #[serde(default)]
        amplitude: Amplitude,
    },
    /// A total force and moment on a part of a body's surface, or of a sheet's edge: a dead traction that varies
    /// linearly over its rest area (length) and has this resultant and moment. Its direction is constant, so the moment
    /// is that on the body at rest.
    Force {
        /// The body.
        body: String,
        /// A part of its surface: a surface region, the facets whose nodes are all selected, or a region of curves.
        #[serde(flatten)]
        on: Selection,
        /// Total force, N (default zero).
        #[serde(default)]
        force: [f64; 3],
        /// Moment about the point `about`, N m (default zero).
        #[serde(default)]
        moment: [f64; 3],
        /// The point through which the force acts, m (default: the centroid of the part at rest).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        about: Option<[f64; 3]>,
        /// Time factor (default 1).
        #[serde(default)]
        amplitude: Amplitude,
    },
    /// A dead force per rest volume; the volume of a sheet is its thickness times its area.
    BodyForce {
        /// The body.
        body: String,
        /// A volume region of its mesh, for a sheet a surface region (default: the whole body).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        region: Option<String>,
        /// Force per volume, N/m³.
        force: [FieldComponent; 3],
        /// Time factor (default 1).
        #[serde(default)]
        amplitude: Amplitude,
    },
}

impl Load {
    /// Returns the body that it acts on.
    pub fn body(&self) -> &str {
        match self {
            Self::Traction { body, .. }
            | Self::Pressure { body, .. }
            | Self::Point { body, .. }
            | Self::Force { body, .. }
            | Self::BodyForce { body, .. } => body,
        }
    }

    /// Returns the part of the body that it acts on, if it selects one.
    pub(super) fn selection(&self) -> Option<&Selection> {
        match self {
            Self::Traction { on, .. } | Self::Pressure { on, .. } | Self::Force { on, .. } => Some(on),
            Self::Point { .. } | Self::BodyForce { .. } => None,
        }
    }

    /// Returns the selection of the load for changes.
    pub(super) fn selection_mut(&mut self) -> Option<&mut Selection> {
        match self {
            Self::Traction { on, .. } | Self::Pressure { on, .. } | Self::Force { on, .. } => Some(on),
            Self::Point { .. } | Self::BodyForce { .. } => None,
        }
    }

    /// Returns its amplitude.
    pub(crate) fn amplitude(&self) -> &Amplitude {
        let (Self::Traction { amplitude, .. }
        | Self::Pressure { amplitude, .. }
        | Self::Point { amplitude, .. }
        | Self::Force { amplitude, .. }
        | Self::BodyForce { amplitude, .. }) = self;
        amplitude
    }

    /// Returns the problems of its values, each with the key at fault.
    pub(super) fn problems(&self) -> Vec<(&'static str, String)> {
        let mut problems = Vec::new();
        problems.extend(amplitude_problem(self.amplitude()).map(|message| ("amplitude", message)));
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        match self {
            Self::Traction { traction: components, on, .. } => {
                problems.extend(on.problems());
                problems.extend(field(components).err().map(|error| ("traction", error.to_string())));
            }
            Self::BodyForce { force: components, .. } => {
                problems.extend(field(components).err().map(|error| ("force", error.to_string())));
            }
            Self::Pressure { pressure, on, .. } => {
                problems.extend(on.problems());
                if !pressure.is_finite() {
                    problems.push(("pressure", format!("must be finite, is {pressure} Pa")));
                }
            }
            Self::Force { on, force, moment, about, .. } => {
                problems.extend(on.problems());
                for (key, value) in
                    [("force", *force), ("moment", *moment), ("about", about.unwrap_or_default())]
                {
                    if !finite(&value) {
                        problems.push((key, "must be finite".to_owned()));
                    }
                }
                if (*force, *moment) == ([0.0; 3], [0.0; 3]) {
                    problems.push(("", "missing key: give `force` (N), `moment` (N m), or both".to_owned()));
                }
            }
            Self::Point { point, node, force, .. } => {
                if point.is_some() == node.is_some() {
                    problems.push(("", "give one of `point`, `node`".to_owned()));
                }
                if !finite(force) || !finite(&point.unwrap_or_default()) {
                    problems.push(("force", "force and point must be finite".to_owned()));
                }
            }
        }
        problems
    }
}

/// Returns the problem of an amplitude that has no finite value at the start.
pub(super) fn amplitude_problem(amplitude: &Amplitude) -> Option<String> {
    let value = amplitude.at(0.0);
    (!value.is_finite()).then(|| {
        format!("must be finite at all times, is {value} at t = 0 s: write a formula without this gap, or a table [[t, factor], …]")
    })
}

/// Makes the field of three components.
///
/// # Errors
/// Returns an error if a formula does not parse.
pub(crate) fn field(components: &[FieldComponent; 3]) -> Result<VectorField, FemError> {
    let text = components.each_ref().map(|component| match component {
        FieldComponent::Number(value) if value.is_finite() => format!("{value:e}"),
        FieldComponent::Number(value) => value.to_string(),
        FieldComponent::Formula(formula) => formula.clone(),
    });
    // In a formula the sign of a number is a unary minus, which gives the same value to the bit.
    VectorField::expressions([text[0].as_str(), text[1].as_str(), text[2].as_str()])
}

/// `[damping]`: physical damping of all solids, none by default. The ledger books its dissipation.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Damping {
    /// Kelvin–Voigt shear viscosity η, Pa s: S = 2η Ė + ζ tr(Ė) I in the material frame.
    #[serde(default)]
    pub shear_viscosity: f64,
    /// Kelvin–Voigt bulk viscosity ζ, Pa s.
    #[serde(default)]
    pub bulk_viscosity: f64,
    /// Rayleigh's β, s: viscosities β μ and β λ of each material; rigid motion is not damped.
    #[serde(default)]
    pub stiffness_time: f64,
    /// Rayleigh's α, 1/s: f = −α m v, a drag that slows rigid motion too.
    #[serde(default)]
    pub mass_rate: f64,
}
