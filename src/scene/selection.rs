//! Scene keys that select nodes of a body, common to all tables that act on a part of a body.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// Selects nodes of a body by their rest positions, by exactly one of these keys.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Selection {
    /// A named region of its mesh …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<String>,
    /// … or the nodes in a box …
    #[serde(rename = "box", default, skip_serializing_if = "Option::is_none")]
    pub within: Option<BoxRegion>,
    /// … or the nodes on a plane …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plane: Option<PlaneRegion>,
    /// … or the nodes in a ball …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sphere: Option<SphereRegion>,
    /// … or a list of nodes, from 0 …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<Vec<usize>>,
    /// … or the nodes that a text file lists, relative to the scene file: numbers from 0, separated by blanks, commas
    /// or line ends; text after a # in a line is ignored.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node_file: Option<PathBuf>,
}

/// An axis-aligned box that selects the nodes whose rest positions lie inside it, borders included.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxRegion {
    /// Smallest coordinates, m; -inf along an axis without a lower bound (default: all axes).
    #[serde(default = "BoxRegion::without_min", deserialize_with = "BoxRegion::read_min")]
    pub min: [f64; 3],
    /// Largest coordinates, m; inf along an axis without an upper bound (default: all axes).
    #[serde(default = "BoxRegion::without_max", deserialize_with = "BoxRegion::read_max")]
    pub max: [f64; 3],
}

impl BoxRegion {
    fn without_min() -> [f64; 3] {
        [f64::NEG_INFINITY; 3]
    }

    fn without_max() -> [f64; 3] {
        [f64::INFINITY; 3]
    }

    /// Reads the lower bounds; JSON represents an infinite number as null.
    fn read_min<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 3], D::Error> {
        Ok(<[Option<f64>; 3]>::deserialize(from)?.map(|bound| bound.unwrap_or(f64::NEG_INFINITY)))
    }

    fn read_max<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 3], D::Error> {
        Ok(<[Option<f64>; 3]>::deserialize(from)?.map(|bound| bound.unwrap_or(f64::INFINITY)))
    }

    /// Returns the problem of its bounds, if any.
    fn problem(&self) -> Option<String> {
        let Self { min, max } = self;
        if let Some(k) = (0..3).find(|&k| min[k] == f64::INFINITY || max[k] == f64::NEG_INFINITY) {
            let axis = ["x", "y", "z"][k];
            return Some(format!(
                "contains nothing along {axis}: for an open box use -inf in `min` or inf in `max`"
            ));
        }
        let is_ordered = (0..3).all(|k| min[k] <= max[k]);
        (!is_ordered).then(|| "`min` must not exceed `max`, and neither may be nan".to_owned())
    }
}

/// A plane that selects the nodes whose rest positions lie on it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlaneRegion {
    /// A point of the plane, m.
    pub point: [f64; 3],
    /// Normal, of any length but zero.
    pub normal: [f64; 3],
    /// Largest distance of a node from the plane, m (≥ 0; default: 1e-6 of the body's extent).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance: Option<f64>,
}

/// A ball that selects the nodes whose rest positions lie inside it, its surface included.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SphereRegion {
    /// Centre, m.
    pub centre: [f64; 3],
    /// Radius, m (> 0).
    pub radius: f64,
}

impl Selection {
    /// Selects a named region of the mesh.
    pub fn region(region: impl Into<String>) -> Self {
        Self { region: Some(region.into()), ..Self::default() }
    }

    /// Selects the nodes whose rest positions lie in a box; infinite bounds leave it open.
    pub fn within(min: [f64; 3], max: [f64; 3]) -> Self {
        Self { within: Some(BoxRegion { min, max }), ..Self::default() }
    }

    /// Selects the nodes whose rest positions lie on a plane.
    pub fn plane(point: [f64; 3], normal: [f64; 3]) -> Self {
        Self { plane: Some(PlaneRegion { point, normal, distance: None }), ..Self::default() }
    }

    /// Selects the nodes whose rest positions lie in a ball.
    pub fn sphere(centre: [f64; 3], radius: f64) -> Self {
        Self { sphere: Some(SphereRegion { centre, radius }), ..Self::default() }
    }

    /// Selects a list of nodes, from 0.
    pub fn nodes(nodes: Vec<usize>) -> Self {
        Self { nodes: Some(nodes), ..Self::default() }
    }

    /// Selects the nodes that a file lists.
    pub fn node_file(path: impl Into<PathBuf>) -> Self {
        Self { node_file: Some(path.into()), ..Self::default() }
    }

    fn given(&self) -> [(&'static str, bool); 6] {
        [
            ("region", self.region.is_some()),
            ("box", self.within.is_some()),
            ("plane", self.plane.is_some()),
            ("sphere", self.sphere.is_some()),
            ("nodes", self.nodes.is_some()),
            ("node_file", self.node_file.is_some()),
        ]
    }

    /// Returns whether none of its keys is set.
    pub fn is_empty(&self) -> bool {
        self.given().iter().all(|(_, given)| !given)
    }

    /// Returns the key that is set, for messages.
    pub(crate) fn key(&self) -> &'static str {
        self.given().iter().find(|(_, given)| *given).map_or("region", |(key, _)| key)
    }

    /// Returns all problems of its values, each with the key within it.
    pub(super) fn problems(&self) -> Vec<(&'static str, String)> {
        let mut problems = Vec::new();
        let given = self.given();
        let names: Vec<String> = given.iter().map(|(key, _)| format!("`{key}`")).collect();
        match given.iter().filter(|(_, given)| *given).count() {
            0 => problems.push(("", format!("missing key: give one of {}", names.join(", ")))),
            1 => {}
            _ => problems.push(("", format!("give only one of {}", names.join(", ")))),
        }
        if self.nodes.as_ref().is_some_and(Vec::is_empty) {
            problems.push(("nodes", "lists no node: write at least one, or remove the table".to_owned()));
        }
        problems.extend(self.within.as_ref().and_then(BoxRegion::problem).map(|message| ("box", message)));
        if let Some(PlaneRegion { point, normal, distance }) = &self.plane {
            let is_finite = point.iter().chain(normal).all(|value| value.is_finite());
            if !is_finite || *normal == [0.0; 3] {
                problems
                    .push(("plane", "needs a finite `point`, and a `normal` that is not zero".to_owned()));
            }
            if distance.is_some_and(|distance| !(distance >= 0.0 && distance.is_finite())) {
                problems.push(("plane", "`distance` must be zero or positive, in m".to_owned()));
            }
        }
        if let Some(SphereRegion { centre, radius }) = &self.sphere
            && !(centre.iter().all(|value| value.is_finite()) && *radius > 0.0 && radius.is_finite())
        {
            problems.push(("sphere", "needs a finite `centre` and a positive `radius`, in m".to_owned()));
        }
        problems
    }
}
