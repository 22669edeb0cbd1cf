//! Bodies and what is attached to them, as a scene says it.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};
use vi_fem::{BoxMesh, Law, Motion};

/// `[[body]]`: a deformable body from a mesh file or a generated shape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Its name, by which fixes, probes and springs refer to it.
    pub name: String,
    /// Mesh file (.msh, .vtk, .vtu), relative to the scene file. Point data `displacement` (m) and
    /// `velocity` (m/s) in it are the initial state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mesh: Option<PathBuf>,
    /// A box, instead of a mesh. Regions: `box`, `x-min`, `x-max`, `y-min` … `z-max`.
    #[serde(rename = "box", default, skip_serializing_if = "Option::is_none")]
    pub box_shape: Option<BoxMesh>,
    /// What it is made of: one material, or a list of them by region.
    pub material: Materials,
    /// Factor on the coordinates of the mesh, e.g. 0.001 for a mesh in millimetres (> 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Translation of the mesh after scaling, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub translate: Option<[f64; 3]>,
    /// Initial velocity, m/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<[f64; 3]>,
    /// Initial angular velocity about the centre of mass, rad/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angular_velocity: Option<[f64; 3]>,
}

impl Body {
    fn new(name: impl Into<String>, material: Law) -> Self {
        Self {
            name: name.into(),
            mesh: None,
            box_shape: None,
            material: Materials(vec![MaterialEntry { region: None, law: material }]),
            scale: None,
            translate: None,
            velocity: None,
            angular_velocity: None,
        }
    }

    /// A body from a mesh file, of one material.
    pub fn from_mesh(name: impl Into<String>, mesh: impl Into<PathBuf>, material: Law) -> Self {
        Self { mesh: Some(mesh.into()), ..Self::new(name, material) }
    }

    /// A generated box of one material.
    pub fn from_box(name: impl Into<String>, shape: BoxMesh, material: Law) -> Self {
        Self { box_shape: Some(shape), ..Self::new(name, material) }
    }

    /// Sets the initial velocity, m/s.
    pub fn velocity(mut self, velocity: [f64; 3]) -> Self {
        self.velocity = Some(velocity);
        self
    }

    /// Sets the initial angular velocity about the centre of mass, rad/s.
    pub fn angular_velocity(mut self, angular_velocity: [f64; 3]) -> Self {
        self.angular_velocity = Some(angular_velocity);
        self
    }

    /// Translates the mesh, m.
    pub fn translate(mut self, translate: [f64; 3]) -> Self {
        self.translate = Some(translate);
        self
    }
}

/// One material for the whole body, or one a region.
#[derive(Debug, Clone, PartialEq)]
pub struct Materials(pub Vec<MaterialEntry>);

/// A material and the volume region that it fills (none: all that no other entry names).
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialEntry {
    /// The region.
    pub region: Option<String>,
    /// The law and its parameters.
    pub law: Law,
}

impl Serialize for MaterialEntry {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut value = serde_json::to_value(&self.law).map_err(serde::ser::Error::custom)?;
        if let (Some(region), Some(table)) = (&self.region, value.as_object_mut()) {
            table.insert("region".to_owned(), region.as_str().into());
        }
        value.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for MaterialEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        use serde::de::Error;
        let mut table = serde_json::Map::deserialize(deserializer)?;
        let region = match table.remove("region") {
            None => None,
            Some(serde_json::Value::String(name)) => Some(name),
            Some(other) => return Err(D::Error::custom(format!("region: expected a string, found {other}"))),
        };
        let law = Law::deserialize(serde_json::Value::Object(table)).map_err(D::Error::custom)?;
        Ok(Self { region, law })
    }
}

impl Serialize for Materials {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0.as_slice() {
            [one] if one.region.is_none() => one.serialize(serializer),
            many => many.serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for Materials {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OneOrMany;
        impl<'de> serde::de::Visitor<'de> for OneOrMany {
            type Value = Materials;
            fn expecting(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
                formatter.write_str("a material table, or a list of them with `region`")
            }
            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Materials, A::Error> {
                let one = MaterialEntry::deserialize(serde::de::value::MapAccessDeserializer::new(map))?;
                Ok(Materials(vec![one]))
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, seq: A) -> Result<Materials, A::Error> {
                Vec::deserialize(serde::de::value::SeqAccessDeserializer::new(seq)).map(Materials)
            }
        }
        deserializer.deserialize_any(OneOrMany)
    }
}

impl JsonSchema for Materials {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Materials".into()
    }

    fn json_schema(generator: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let law = generator.subschema_for::<Law>();
        schemars::json_schema!({
            "description": "One material, or a list of materials with `region`, the volume region that each fills.",
            "anyOf": [law, { "type": "array", "items": { "allOf": [law], "properties": { "region": { "type": "string" } } } }]
        })
    }
}

/// A coordinate axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// First.
    X,
    /// Second.
    Y,
    /// Third.
    Z,
}

/// An axis-aligned box in space that selects the nodes at rest inside it, borders included.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxRegion {
    /// Least coordinates, m.
    pub min: [f64; 3],
    /// Greatest coordinates, m.
    pub max: [f64; 3],
}

/// `[[fix]]`: nodes whose coordinates are prescribed: held where they start, or moved on a path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fix {
    /// The body.
    pub body: String,
    /// A named region of its mesh …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<String>,
    /// … or the nodes in a box …
    #[serde(rename = "box", default, skip_serializing_if = "Option::is_none")]
    pub within: Option<BoxRegion>,
    /// … or a list of nodes, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<Vec<usize>>,
    /// Which coordinates (default: all).
    #[serde(default = "Fix::all_axes")]
    pub axes: Vec<Axis>,
    /// How they move (default: not at all).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
}

impl Fix {
    fn all_axes() -> Vec<Axis> {
        vec![Axis::X, Axis::Y, Axis::Z]
    }

    fn new(body: impl Into<String>) -> Self {
        Self {
            body: body.into(),
            region: None,
            within: None,
            nodes: None,
            axes: Self::all_axes(),
            motion: None,
        }
    }

    /// Holds a region.
    pub fn region(body: impl Into<String>, region: impl Into<String>) -> Self {
        Self { region: Some(region.into()), ..Self::new(body) }
    }

    /// Holds the nodes at rest in a box.
    pub fn within(body: impl Into<String>, min: [f64; 3], max: [f64; 3]) -> Self {
        Self { within: Some(BoxRegion { min, max }), ..Self::new(body) }
    }

    /// Holds a list of nodes, from 0.
    pub fn nodes(body: impl Into<String>, nodes: Vec<usize>) -> Self {
        Self { nodes: Some(nodes), ..Self::new(body) }
    }

    /// Holds only these axes.
    pub fn axes(mut self, axes: &[Axis]) -> Self {
        self.axes = axes.to_vec();
        self
    }

    /// Moves them on a path.
    pub fn motion(mut self, motion: Motion) -> Self {
        self.motion = Some(motion);
        self
    }
}

/// One end of a spring.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpringEnd {
    /// A body: give `node` or `point` too. Without a body, `point` is a place fixed in space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// The node nearest to this point at rest, m; without a body, the place itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point: Option<[f64; 3]>,
    /// A node of the body, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<usize>,
}

/// `[[spring]]`: V = ½ k (|x_b − x_a| − L)².
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    /// One end, on a body.
    pub from: SpringEnd,
    /// The other end, on a body or in space.
    pub to: SpringEnd,
    /// Stiffness k, N/m (> 0).
    pub stiffness: f64,
    /// Length at rest L, m (≥ 0; default: the distance of the ends at rest).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
}

/// `[[strike]]`: an impulse at t = 0, shared by the nodes of a region in proportion to their mass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Strike {
    /// The body.
    pub body: String,
    /// A named region of its mesh.
    pub region: String,
    /// Impulse, N s.
    pub impulse: [f64; 3],
}

/// `[[probe]]`: a node whose position and displacement go to history.csv.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// Prefix of its columns: name.x name.y name.z (position, m), name.ux name.uy name.uz (displacement, m).
    pub name: String,
    /// The body.
    pub body: String,
    /// The node nearest to this point at rest, m …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point: Option<[f64; 3]>,
    /// … or a node, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<usize>,
    /// Find the pitch (frequency of the strongest oscillation, Hz) of this axis' displacement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pitch: Option<Axis>,
}

impl Probe {
    /// The node nearest to a point at rest, m.
    pub fn at(name: impl Into<String>, body: impl Into<String>, point: [f64; 3]) -> Self {
        Self { name: name.into(), body: body.into(), point: Some(point), node: None, pitch: None }
    }

    /// A node, from 0.
    pub fn node(name: impl Into<String>, body: impl Into<String>, node: usize) -> Self {
        Self { name: name.into(), body: body.into(), point: None, node: Some(node), pitch: None }
    }
}
