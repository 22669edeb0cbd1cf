//! Scene keys of rigid bodies and joints.

use std::f64::consts::PI;
use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_fem::Motion;

/// `[[rigid]]`: a rigid body. Its mass and inertia are given, or follow from a shape. Nodes of bodies that are attached
/// to it (`[[attach]]` with its name as `to`) add theirs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rigid {
    /// Name by which attachments and joints refer to the body. It heads the columns `name.x name.y name.z` (position of
    /// its centre, m) and `name.qw name.qx name.qy name.qz` (orientation) in history.csv.
    pub name: String,
    /// Mass, kg. Alternatives: `density` with a shape, or neither if only attached nodes have mass.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass: Option<f64>,
    /// Density of its shape, kg/m³.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub density: Option<f64>,
    /// Inertia about its centre of mass in its local axes, kg m²: three principal moments, or a symmetric 3 × 3 matrix
    /// by rows. Alternative to a shape.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia: Option<Inertia>,
    /// Shape, which gives the inertia and is shown in frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<RigidShape>,
    /// Initial position of the centre of mass without attached nodes, m; for a mesh, of the origin of its file.
    #[serde(default)]
    pub position: [f64; 3],
    /// Initial orientation of the body's axes (default: along the global axes).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation: Option<Turn>,
    /// Initial velocity of its own centre of mass, m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<[f64; 3]>,
    /// Initial angular velocity in global axes, rad/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angular_velocity: Option<[f64; 3]>,
    /// Whether it is held at its initial position.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub fixed: bool,
    /// Prescribed motion.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
}

/// An inertia.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Inertia {
    /// Principal moments about the body's local axes, kg m².
    Principal([f64; 3]),
    /// A symmetric matrix by rows, kg m².
    Matrix([[f64; 3]; 3]),
}

/// A homogeneous shape centred at the body's position.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum RigidShape {
    /// The half-space below a plane through the body's position: an infinite obstacle, held, or moved and rotated by a
    /// motion. It acts by contact alone and is not drawn.
    Plane {
        /// Direction out of the half-space in the body's local axes, of any length but zero.
        normal: [f64; 3],
    },
    /// A box along the body's axes.
    Box {
        /// Edge lengths, m.
        size: [f64; 3],
    },
    /// A ball.
    Sphere {
        /// Radius, m.
        radius: f64,
    },
    /// A round rod along the body's first axis.
    Rod {
        /// Length, m.
        length: f64,
        /// Radius, m.
        radius: f64,
    },
    /// A cylinder along the body's first axis; another name for `rod`.
    Cylinder {
        /// Length, m.
        length: f64,
        /// Radius, m.
        radius: f64,
    },
    /// A cylinder along the body's first axis with a hemisphere at each end.
    Capsule {
        /// Length of the cylinder without the hemispheres, m.
        length: f64,
        /// Radius, m.
        radius: f64,
    },
    /// The solid within a closed surface of triangles, read from a mesh file of any supported kind; for a mesh of
    /// solids, within its boundary. The body's position is that of the file's origin, and its centre of mass follows.
    Mesh {
        /// The file, relative to the scene.
        file: PathBuf,
        /// Metres per unit of the file (> 0, default 1).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0.0))]
        scale: Option<f64>,
    },
}

impl RigidShape {
    /// Returns whether it is a half-space.
    pub fn is_plane(&self) -> bool {
        matches!(self, Self::Plane { .. })
    }

    /// Returns the volume, m³; infinite for a half-space, NaN for a mesh, whose file must be read.
    pub fn volume(&self) -> f64 {
        match *self {
            Self::Plane { .. } => f64::INFINITY,
            Self::Mesh { .. } => f64::NAN,
            Self::Box { size: [a, b, c] } => a * b * c,
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
            Self::Rod { length, radius } | Self::Cylinder { length, radius } => PI * radius * radius * length,
            Self::Capsule { length, radius } => PI * radius * radius * (length + 4.0 / 3.0 * radius),
        }
    }

    /// Returns the mean squares of the coordinates over the shape, m²: Euler's moments per unit mass. They are zero for
    /// a half-space, which has no mass, and NaN for a mesh.
    pub fn mean_squares(&self) -> [f64; 3] {
        match *self {
            Self::Plane { .. } => [0.0; 3],
            Self::Mesh { .. } => [f64::NAN; 3],
            Self::Box { size } => size.map(|edge| edge * edge / 12.0),
            Self::Sphere { radius } => [radius * radius / 5.0; 3],
            Self::Rod { length, radius } | Self::Cylinder { length, radius } => {
                [length * length / 12.0, radius * radius / 4.0, radius * radius / 4.0]
            }
            Self::Capsule { length, radius } => {
                let (l, r) = (length, radius);
                // The cylinder, and both hemispheres together, as fractions of the volume.
                let ball = 4.0 / 3.0 * r / (l + 4.0 / 3.0 * r);
                let along_ball = r * r / 5.0 + 0.25 * l * l + 0.375 * l * r;
                let along = (1.0 - ball) * l * l / 12.0 + ball * along_ball;
                let across = (1.0 - ball) * r * r / 4.0 + ball * r * r / 5.0;
                [along, across, across]
            }
        }
    }

    /// Returns its smallest thickness, m; NaN for a mesh.
    pub fn thickness(&self) -> f64 {
        match *self {
            Self::Plane { .. } => f64::INFINITY,
            Self::Mesh { .. } => f64::NAN,
            Self::Box { size: [a, b, c] } => a.min(b).min(c),
            Self::Sphere { radius } | Self::Capsule { radius, .. } => 2.0 * radius,
            Self::Rod { length, radius } | Self::Cylinder { length, radius } => length.min(2.0 * radius),
        }
    }

    fn problem(&self) -> Option<&'static str> {
        let is_length = |length: f64| length > 0.0 && length.is_finite();
        let is_sound = match self {
            Self::Plane { normal } => {
                return (!is_direction(*normal)).then_some("its normal must be finite and not zero");
            }
            Self::Mesh { scale, .. } => scale.is_none_or(is_length),
            Self::Box { size } => size.iter().all(|&edge| is_length(edge)),
            Self::Sphere { radius } => is_length(*radius),
            Self::Rod { length, radius }
            | Self::Cylinder { length, radius }
            | Self::Capsule { length, radius } => is_length(*length) && is_length(*radius),
        };
        (!is_sound).then_some("its lengths must be positive and finite, in m")
    }
}

/// A rotation about an axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// The axis, of any length but zero.
    pub axis: [f64; 3],
    /// Right-handed angle about it, rad.
    pub angle: f64,
}

impl Rigid {
    /// Makes a body with this name and without mass.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            mass: None,
            density: None,
            inertia: None,
            shape: None,
            position: [0.0; 3],
            orientation: None,
            velocity: None,
            angular_velocity: None,
            fixed: false,
            motion: None,
        }
    }

    /// Returns whether its motion is prescribed: it is held or moved.
    pub fn is_prescribed(&self) -> bool {
        self.fixed || self.motion.is_some()
    }

    fn plane_problem(&self) -> Option<(&'static str, &'static str)> {
        if !self.is_prescribed() {
            return Some((
                "fixed",
                "a half-space has no end and no mass: write `fixed = true`, or give a `motion`",
            ));
        }
        if self.mass.is_some() || self.density.is_some() || self.inertia.is_some() {
            return Some(("shape", "a half-space has no mass: remove `mass`, `density` and `inertia`"));
        }
        None
    }

    /// Returns the problems of its values, each with the key at fault.
    pub(super) fn problems(&self) -> Vec<(&'static str, String)> {
        let mut problems = Vec::new();
        for (key, value, unit) in [("mass", self.mass, "kg"), ("density", self.density, "kg/m³")] {
            if value.is_some_and(|value| !(value > 0.0 && value.is_finite())) {
                let value = value.unwrap_or_default();
                problems.push((key, format!("must be positive and finite, is {value} {unit}")));
            }
        }
        if let Some(message) = self.shape.as_ref().and_then(RigidShape::problem) {
            problems.push(("shape", message.to_owned()));
        }
        if self.shape.as_ref().is_some_and(RigidShape::is_plane) {
            problems.extend(self.plane_problem().map(|(key, message)| (key, message.to_owned())));
        }
        let given = (self.mass.is_some(), self.density.is_some());
        match (given, self.inertia.is_some(), self.shape.is_some()) {
            ((true, true), ..) => problems.push(("density", "give only one of `mass`, `density`".to_owned())),
            ((_, true), _, false) => problems.push(("density", "needs a `shape` to fill".to_owned())),
            (_, true, true) => problems.push(("inertia", "give only one of `inertia`, `shape`".to_owned())),
            ((false, false), true, _) => problems.push(("inertia", "needs a `mass`".to_owned())),
            ((true, _), false, false) => {
                problems.push(("", "a mass needs an `inertia` or a `shape`".to_owned()));
            }
            _ => {}
        }
        if let Some(inertia) = &self.inertia {
            problems.extend(inertia.problem().map(|message| ("inertia", message)));
        }
        let mut vectors = vec![("position", self.position)];
        vectors.extend(self.velocity.map(|v| ("velocity", v)));
        vectors.extend(self.angular_velocity.map(|v| ("angular_velocity", v)));
        for (key, vector) in vectors {
            if vector.iter().any(|value| !value.is_finite()) {
                problems.push((key, "must be finite".to_owned()));
            }
        }
        if let Some(turn) = self.orientation
            && !(turn.angle.is_finite() && is_direction(turn.axis))
        {
            problems
                .push(("orientation", "needs a finite `angle` and an `axis` that is not zero".to_owned()));
        }
        if self.fixed && self.motion.is_some() {
            problems.push(("fixed", "give only one of `fixed`, `motion`".to_owned()));
        }
        if self.is_prescribed() && (self.velocity.is_some() || self.angular_velocity.is_some()) {
            problems.push(("velocity", "follows from `fixed` or `motion`: remove this key".to_owned()));
        }
        problems.extend(
            self.motion.as_ref().and_then(|m| m.check().err()).map(|error| ("motion", error.to_string())),
        );
        problems
    }
}

/// Returns whether a vector is finite and not zero.
fn is_direction(v: [f64; 3]) -> bool {
    v.iter().all(|value| value.is_finite()) && v != [0.0; 3]
}

impl Inertia {
    /// Returns the inertia as a matrix, kg m².
    pub fn matrix(&self) -> [[f64; 3]; 3] {
        match *self {
            Self::Principal([a, b, c]) => [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]],
            Self::Matrix(matrix) => matrix,
        }
    }

    fn problem(&self) -> Option<String> {
        let i = self.matrix();
        if i.as_flattened().iter().any(|value| !value.is_finite()) {
            return Some("must be finite".to_owned());
        }
        let size = i[0][0] + i[1][1] + i[2][2];
        if (0..3).any(|a| (0..a).any(|b| (i[a][b] - i[b][a]).abs() > 1e-12 * size.abs())) {
            return Some("must be a symmetric matrix".to_owned());
        }
        let matrix = nalgebra::Matrix3::from_fn(|a, b| i[a][b]);
        let moments = matrix.symmetric_eigenvalues();
        // ½ tr I − I_k = ∫ X_k² dm is zero for a flat body, up to the round-off of its moments.
        let least = 0.5 * size - moments.max();
        (moments.min() <= 0.0 || least < -1e-12 * size).then(|| {
            format!(
                "no body has principal moments {:.6e}, {:.6e}, {:.6e}: each must be positive and at most the sum of the \
                 others",
                moments[0], moments[1], moments[2]
            )
        })
    }
}

/// `[[joint]]`: a constraint between a rigid body and another one, or the world.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Joint {
    /// A point that is fixed in both bodies.
    Ball {
        /// The rigid body.
        body: String,
        /// The other body (default: the world).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<String>,
        /// The point at the start, m.
        point: [f64; 3],
    },
    /// A line that is fixed in both bodies.
    Hinge {
        /// The rigid body.
        body: String,
        /// The other body (default: the world).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<String>,
        /// A point of the line at the start, m.
        point: [f64; 3],
        /// Direction at the start, of any length but zero.
        axis: [f64; 3],
    },
    /// The bodies move as one.
    Weld {
        /// The rigid body.
        body: String,
        /// The other body (default: the world).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<String>,
        /// A point of both at the start, m (default: the centre of `body`).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        point: Option<[f64; 3]>,
    },
    /// Two points with a constant distance: a massless rod.
    Distance {
        /// The rigid body.
        body: String,
        /// The other body (default: the world).
        #[serde(default, skip_serializing_if = "Option::is_none")]
        to: Option<String>,
        /// The point of `body` at the start, m.
        point: [f64; 3],
        /// The point of `to` at the start, m.
        to_point: [f64; 3],
    },
}

impl Joint {
    /// Returns the name of the rigid body.
    pub fn body(&self) -> &str {
        match self {
            Self::Ball { body, .. }
            | Self::Hinge { body, .. }
            | Self::Weld { body, .. }
            | Self::Distance { body, .. } => body,
        }
    }

    /// Returns the name of the other body; `None` for the world.
    pub fn to(&self) -> Option<&str> {
        match self {
            Self::Ball { to, .. }
            | Self::Hinge { to, .. }
            | Self::Weld { to, .. }
            | Self::Distance { to, .. } => to.as_deref(),
        }
    }

    /// Returns the problems of its values, each with the key at fault.
    pub(super) fn problems(&self) -> Vec<(&'static str, String)> {
        let mut problems = Vec::new();
        if self.to() == Some(self.body()) {
            problems.push(("to", "a body cannot be joined to itself".to_owned()));
        }
        let points: Vec<[f64; 3]> = match self {
            Self::Ball { point, .. } | Self::Hinge { point, .. } => vec![*point],
            Self::Weld { point, .. } => point.iter().copied().collect(),
            Self::Distance { point, to_point, .. } => vec![*point, *to_point],
        };
        if points.as_flattened().iter().any(|value| !value.is_finite()) {
            problems.push(("point", "must be finite, in m".to_owned()));
        }
        match self {
            Self::Hinge { axis, .. } if !is_direction(*axis) => {
                problems.push(("axis", "must be finite and not zero".to_owned()));
            }
            Self::Distance { point, to_point, .. } if point == to_point => {
                problems
                    .push(("to_point", "is where `point` is; for a distance of zero use a ball".to_owned()));
            }
            _ => {}
        }
        problems
    }
}
