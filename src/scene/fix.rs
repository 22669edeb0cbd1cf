//! Scene keys of prescribed coordinates: which nodes, along which directions, on which path.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_fem::Motion;

use super::{Axis, Selection};

/// A direction along which nodes are held.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum HeldAxis {
    /// A global axis: "x", "y" or "z".
    Space(Axis),
    /// A direction that differs from node to node.
    Local(LocalAxis),
    /// A direction in space, of any length but zero.
    Vector([f64; 3]),
}

impl From<Axis> for HeldAxis {
    fn from(axis: Axis) -> Self {
        Self::Space(axis)
    }
}

impl From<LocalAxis> for HeldAxis {
    fn from(axis: LocalAxis) -> Self {
        Self::Local(axis)
    }
}

impl From<[f64; 3]> for HeldAxis {
    fn from(direction: [f64; 3]) -> Self {
        Self::Vector(direction)
    }
}

/// A direction that differs from node to node, at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LocalAxis {
    /// The normal of the selected surface: the mean of its facets at the node, by area.
    Normal,
    /// Both directions tangent to that surface; with `about` and no axis, both tangent to the sphere.
    Tangent,
    /// Away from the axis of the cylinder `about`, or from the centre of the sphere.
    Radial,
    /// Around the axis of the cylinder, right-handed.
    Hoop,
    /// Along the axis of the cylinder.
    Axial,
}

/// The cylinder or sphere that defines radial, hoop, axial and tangential directions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// The centre of the sphere, or a point on the axis of the cylinder, m (default: the origin).
    #[serde(default)]
    pub point: [f64; 3],
    /// The axis of the cylinder, of any length but zero; without it, `about` is a sphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 3]>,
}

/// `[[fix]]`: nodes whose coordinates are prescribed: held at their initial positions, or moved on a path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fix {
    /// The body.
    pub body: String,
    /// The held nodes.
    #[serde(flatten)]
    pub on: Selection,
    /// Directions that are held (default: `["x", "y", "z"]`): global axes "x", "y", "z"; "normal" and "tangent" of the
    /// selected surface; "radial", "hoop", "axial" of the cylinder `about`, "radial" and "tangent" of the sphere; or
    /// vectors such as `[1.0, 1.0, 0.0]`. All refer to the body at rest.
    #[serde(default = "Fix::all_axes")]
    pub axes: Vec<HeldAxis>,
    /// The cylinder or sphere for "radial", "hoop" and "axial".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<About>,
    /// Prescribed motion (default: at rest).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
    /// Clamp a sheet: hold the normal at its boundary edges between these nodes as in the mesh.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub rotation: bool,
    /// The nodes lie in a mirror plane, whose normal is the one direction in `axes`: boundary edges of a sheet between
    /// them bend as if the sheet continued as its mirror image. (A solid needs only `axes`.)
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub symmetry: bool,
}

impl Fix {
    fn all_axes() -> Vec<HeldAxis> {
        [Axis::X, Axis::Y, Axis::Z].map(HeldAxis::Space).to_vec()
    }

    /// Returns the global axes along which the nodes are held, as 0, 1 and 2, or `None` if they are held along any
    /// other direction.
    pub(crate) fn space_axes(&self) -> Option<Vec<usize>> {
        let axis = |axis: &HeldAxis| match axis {
            HeldAxis::Space(axis) => Some(*axis as usize),
            HeldAxis::Local(_) | HeldAxis::Vector(_) => None,
        };
        self.axes.iter().map(axis).collect()
    }

    /// Holds a selection of nodes.
    pub fn on(body: impl Into<String>, on: Selection) -> Self {
        Self {
            body: body.into(),
            on,
            axes: Self::all_axes(),
            about: None,
            motion: None,
            rotation: false,
            symmetry: false,
        }
    }

    /// Holds a region.
    pub fn region(body: impl Into<String>, region: impl Into<String>) -> Self {
        Self::on(body, Selection::region(region))
    }

    /// Holds the nodes whose rest positions lie in a box.
    pub fn within(body: impl Into<String>, min: [f64; 3], max: [f64; 3]) -> Self {
        Self::on(body, Selection::within(min, max))
    }

    /// Holds a list of nodes, from 0.
    pub fn nodes(body: impl Into<String>, nodes: Vec<usize>) -> Self {
        Self::on(body, Selection::nodes(nodes))
    }

    /// Holds along these directions only.
    pub fn axes<A: Into<HeldAxis> + Copy>(mut self, axes: &[A]) -> Self {
        self.axes = axes.iter().map(|&axis| axis.into()).collect();
        self
    }

    /// Sets the cylinder (with an axis) or sphere of radial directions.
    pub fn about(mut self, point: [f64; 3], axis: Option<[f64; 3]>) -> Self {
        self.about = Some(About { point, axis });
        self
    }

    /// Declares that the nodes lie in a mirror plane, whose normal is the one direction that is held.
    pub fn symmetry(mut self) -> Self {
        self.symmetry = true;
        self
    }

    /// Moves them on a path.
    pub fn motion(mut self, motion: Motion) -> Self {
        self.motion = Some(motion);
        self
    }

    /// Clamps a sheet: holds the normal at its boundary edges between these nodes.
    pub fn rotation(mut self) -> Self {
        self.rotation = true;
        self
    }

    /// Returns all problems of its values except those of its motion, each with the key within it.
    pub(super) fn problems(&self) -> Vec<(String, String)> {
        let mut problems: Vec<(String, String)> =
            self.on.problems().into_iter().map(|(key, message)| (key.to_owned(), message)).collect();
        let mut say = |key: &str, message: &str| problems.push((key.to_owned(), message.to_owned()));
        if self.axes.is_empty() {
            say("axes", "contains no axis: remove this key to prescribe all three");
        }
        for (i, axis) in self.axes.iter().enumerate() {
            if self.axes[..i].contains(axis) {
                say("axes", "names an axis twice");
            }
            if let HeldAxis::Vector(direction) = axis
                && !(direction.iter().all(|value| value.is_finite()) && *direction != [0.0; 3])
            {
                say(&format!("axes[{i}]"), "a direction must be finite and not zero");
            }
        }
        let has = |of: &[LocalAxis]| {
            self.axes.iter().any(|axis| matches!(axis, HeldAxis::Local(local) if of.contains(local)))
        };
        let of_cylinder = has(&[LocalAxis::Hoop, LocalAxis::Axial]);
        match &self.about {
            None => {
                if has(&[LocalAxis::Radial]) || of_cylinder {
                    let message = "missing key `about`: the axis of the cylinder, e.g. { point = [0, 0, 0], axis = [0, 0, 1] }, \
                               or without `axis` the centre of a sphere, that \"radial\", \"hoop\", \"axial\" belong to";
                    say("about", message);
                }
            }
            Some(about) => {
                if about.point.iter().any(|value| !value.is_finite()) {
                    say("about", "`point` must be finite, in m");
                }
                if about.axis.is_some_and(|axis| !axis.iter().all(|a| a.is_finite()) || axis == [0.0; 3]) {
                    say("about", "`axis` must be finite and not zero");
                }
                if about.axis.is_none() && of_cylinder {
                    let message = "\"hoop\" and \"axial\" are directions of a cylinder: give its `axis` too";
                    say("about", message);
                }
                let of_about = [LocalAxis::Radial, LocalAxis::Tangent, LocalAxis::Hoop, LocalAxis::Axial];
                if !has(&of_about) {
                    let message = "is only used by \"radial\", \"tangent\", \"hoop\" and \"axial\" in `axes`; remove this key";
                    say("about", message);
                }
                if about.axis.is_some() && has(&[LocalAxis::Tangent]) {
                    let message = "\"tangent\" applies to a surface or a sphere; for a cylinder write \"hoop\" and \"axial\"";
                    say("axes", message);
                }
            }
        }
        if self.symmetry {
            let is_plane = matches!(self.axes[..], [HeldAxis::Space(_) | HeldAxis::Vector(_)]);
            if !is_plane {
                let message = "needs the normal of the mirror plane as the one direction in `axes`, e.g. axes = [\"x\"]";
                say("symmetry", message);
            }
            if self.rotation {
                say(
                    "rotation",
                    "edges on a mirror plane are free to rotate within it: give `rotation` or `symmetry`, not both",
                );
            }
            if self.motion.is_some() {
                say("motion", "a mirror plane does not move: remove this key, or `symmetry`");
            }
        }
        problems
    }
}
