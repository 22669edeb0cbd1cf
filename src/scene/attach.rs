//! Attachments and seams, as a scene says them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_fem::Motion;

use super::Selection;

/// `[[attach]]`: nodes of a body held, each to the nearest point of another body's surface, or to the place
/// where it starts, which may move. With `stiffness` by springs, V = ½ k (|x − y| − L)² a node; without it
/// exactly: x = y is eliminated, and the mass of x shared by the nodes of y.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Attach {
    /// The body whose nodes are attached.
    pub body: String,
    /// Nodes that are attached.
    #[serde(flatten)]
    pub on: Selection,
    /// The body whose surface holds them; without it, they are held in space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
    /// A surface region of that body (default: its whole boundary).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub surface: Option<String>,
    /// Motion of the places in space, without `to` (default: at rest).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<Motion>,
    /// Stiffness k of each node's spring, N/m (> 0); without it the nodes, which must lie on the surface
    /// `to`, are held there exactly.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<f64>,
    /// Length L at which a spring has no force, m (≥ 0; default: the distance at the start).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
}

impl Attach {
    /// Returns the problems of its values, each with the key at fault.
    pub(super) fn problems(&self) -> Vec<(&'static str, String)> {
        let mut problems = spring_problems(self.stiffness, self.length);
        if self.stiffness.is_none() && self.to.is_none() {
            let message = "missing key: places in space hold by springs; for exact places take [[fix]]";
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
                let message = "places move by themselves or with the body `to`; give one of them";
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
        problems.push(("length", "is that of springs, which need a `stiffness`".to_owned()));
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

/// `[[seam]]`: two edges sewn together: with `stiffness` by springs of length zero, or of `length`; without
/// it exactly, the nodes of the one being where the other is.
///
/// By `region` and `to_region`, curves of the two meshes, every node of the one with more nodes is sewn to
/// the point of the other at the same part of its length. By `nodes` and `to_nodes` they are sewn in pairs.
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
    /// Run along the second curve against the direction that brings the ends nearest.
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
    /// The second body.
    pub fn to_body(&self) -> &str {
        self.to.as_deref().unwrap_or(&self.body)
    }

    /// Returns the problems of its values, each with the key at fault.
    pub(super) fn problems(&self) -> Vec<(&'static str, String)> {
        let mut problems = spring_problems(self.stiffness, self.length);
        match (&self.region, &self.to_region, &self.nodes, &self.to_nodes) {
            (Some(_), Some(_), None, None) => {}
            (None, None, Some(nodes), Some(to_nodes)) => {
                if nodes.len() != to_nodes.len() {
                    let (count, other) = (nodes.len(), to_nodes.len());
                    problems
                        .push(("to_nodes", format!("{other} nodes for the {count} of `nodes`: give pairs")));
                }
                if self.reverse {
                    let message = "turns a curve; pairs of nodes are sewn as they are given";
                    problems.push(("reverse", message.to_owned()));
                }
            }
            _ => problems.push(("", "give `region` and `to_region`, or `nodes` and `to_nodes`".to_owned())),
        }
        problems
    }
}

/// `[[periodic]]`: two parts of a body that move alike, as if copies of it lay side by side: each node of `to` has
/// the displacement of its partner in `from`. The parts are the same nodes but for a translation; node by node the
/// forces on both sides add up, and nothing holds their common motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Periodic {
    /// The body.
    pub body: String,
    /// The one part.
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
