//! Scene keys of attachments and seams.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_fem::Motion;

use super::Selection;

/// `[[attach]]`: attaches nodes of a body, each to the nearest point of another body's surface, or to its initial
/// position, which may move. With `stiffness` they are attached by springs, V = ½ k (|x − y| − L)² per node. Without it
/// they are attached exactly: x = y is eliminated, and the nodes of y share the mass of x.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Attach {
    /// The body whose nodes are attached.
    pub body: String,
    /// Nodes that are attached.
    #[serde(flatten)]
    pub on: Selection,
    /// The body to whose surface they are attached; without it, they are attached to points in space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
    /// A surface region of that body (default: its whole boundary).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<String>,
    /// Motion of the points in space, without `to` (default: at rest).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
    /// Stiffness k of each node's spring, N/m (> 0). Without it the nodes, which must lie on the surface `to`, are held
    /// there exactly.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Length L of a spring without force, m (≥ 0; default: the initial distance).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
}

impl Attach {
    /// Returns the problems of its values, each with the key at fault.
    pub(super) fn problems(&self) -> Vec<(&'static str, String)> {
        let mut problems = spring_problems(self.stiffness, self.length);
        if self.stiffness.is_none() && self.to.is_none() {
            let message = "missing key: points in space hold nodes by springs only; to prescribe positions exactly, use [[fix]]";
            problems.push(("stiffness", message.to_owned()));
        }
        problems.extend(self.on.problems());
        if self.to.as_ref() == Some(&self.body) {
            problems.push(("to", "a body cannot be attached to itself; sew it with [[seam]]".to_owned()));
        }
        if self.surface.is_some() && self.to.is_none() {
            problems.push(("surface", "is a region of the body `to`, which is missing".to_owned()));
        }
        if let Some(motion) = &self.motion {
            if self.to.is_some() {
                let message =
                    "the points move either as prescribed or with the body `to`; give only one of these keys";
                problems.push(("motion", message.to_owned()));
            }
            problems.extend(motion.check().err().map(|error| ("motion", error.to_string())));
        }
        problems
    }
}

fn spring_problems(stiffness: Option<f64>, length: Option<f64>) -> Vec<(&'static str, String)> {
    let mut problems = Vec::new();
    if stiffness.is_none() && length.is_some() {
        problems
            .push(("length", "applies to springs only: give a `stiffness`, or remove this key".to_owned()));
    }
    if let Some(stiffness) = stiffness
        && !(stiffness > 0.0 && stiffness.is_finite())
    {
        problems.push(("stiffness", format!("must be positive and finite, is {stiffness} N/m")));
    }
    if length.is_some_and(|length| !(length >= 0.0 && length.is_finite())) {
        problems.push(("length", "must be zero or positive, in m".to_owned()));
    }
    problems
}

/// `[[seam]]`: sews two edges together. With `stiffness` they are joined by springs of length zero, or of `length`;
/// without it exactly, so that the nodes of one edge lie on the other.
///
/// By `region` and `to_region`, curves of the two meshes, every node of the curve with more nodes is sewn to the point
/// of the other curve at the same fraction of its length. By `nodes` and `to_nodes` they are sewn in pairs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Seam {
    /// The first body.
    pub body: String,
    /// A curve region of its mesh …
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<String>,
    /// … or a list of nodes, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nodes: Option<Vec<usize>>,
    /// The second body (default: the first).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
    /// A curve region of its mesh, with `region`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_region: Option<String>,
    /// A list of as many nodes, with `nodes`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_nodes: Option<Vec<usize>>,
    /// Reverse the direction of the second curve. Without this key it is the direction in which the ends are nearest.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub reverse: bool,
    /// Stiffness k of each stitch, N/m (> 0); without it the edges, which must meet, are joined exactly.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Length L of a stitch without force, m (≥ 0; default 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
}

impl Seam {
    /// Returns the name of the second body.
    pub fn to_body(&self) -> &str {
        self.to.as_deref().unwrap_or(&self.body)
    }

    /// Returns the problems of its values, each with the key at fault.
    pub(super) fn problems(&self) -> Vec<(&'static str, String)> {
        let mut problems = spring_problems(self.stiffness, self.length);
        match (&self.region, &self.to_region, &self.nodes, &self.to_nodes) {
            (Some(_), Some(_), None, None) => {}
            (None, None, Some(nodes), Some(to_nodes)) => {
                if nodes.is_empty() {
                    problems
                        .push(("nodes", "lists no node: write at least one, or remove the table".to_owned()));
                }
                if nodes.len() != to_nodes.len() {
                    let (count, other) = (nodes.len(), to_nodes.len());
                    problems.push((
                        "to_nodes",
                        format!("has {other} nodes, but `nodes` has {count}: give pairs"),
                    ));
                }
                if self.reverse {
                    let message = "reverses a curve; pairs of nodes are sewn as they are listed";
                    problems.push(("reverse", message.to_owned()));
                }
            }
            _ => problems.push(("", "give `region` and `to_region`, or `nodes` and `to_nodes`".to_owned())),
        }
        problems
    }
}

/// `[[periodic]]`: gives two parts of a body equal displacements, as if copies of the body lay side by side. Each node
/// of `to` has the displacement of its partner in `from`. The parts have the same nodes up to a translation. At each
/// pair of nodes the forces on both sides are added, and rigid translation is free.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Periodic {
    /// The body.
    pub body: String,
    /// One part.
    pub from: Selection,
    /// The other part: the same nodes, translated.
    pub to: Selection,
}

impl Periodic {
    /// Returns the problems of its values, each with the key at fault.
    pub(super) fn problems(&self) -> Vec<(String, String)> {
        let keyed = |side: &str, (key, message): (&str, String)| match key {
            "" => (side.to_owned(), message),
            _ => (format!("{side}.{key}"), message),
        };
        let from = self.from.problems().into_iter().map(|problem| keyed("from", problem));
        from.chain(self.to.problems().into_iter().map(|problem| keyed("to", problem))).collect()
    }
}
