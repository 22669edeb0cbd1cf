//! Names parts of surfaces in messages, by the numbers of the bodies' own meshes.

use super::{BodyModel, RigidModel};
use crate::scene::RigidShape;

/// Returns the nodes of a component in words: "nodes 3, 4, 7 of 'cloth'", "vertex 2 of 'box'", "the half-space 'floor'".
/// They belong to one body.
pub(crate) fn part_in_words(
    bodies: &[BodyModel],
    rigids: &[RigidModel],
    component: usize,
    nodes: &[u32],
) -> String {
    let list = |one: &str, more: &str, numbers: Vec<usize>, name: &str| {
        let kind = if numbers.len() == 1 { one } else { more };
        let numbers: Vec<String> = numbers.iter().map(usize::to_string).collect();
        format!("{kind} {} of '{name}'", numbers.join(", "))
    };
    for rigid in rigids.iter().filter(|rigid| rigid.component == component) {
        if !nodes.iter().all(|node| rigid.nodes().contains(node)) {
            continue;
        }
        if rigid.shape.as_ref().is_some_and(RigidShape::is_plane) {
            return format!("the half-space '{}'", rigid.name);
        }
        if rigid.radius > 0.0 {
            return format!("the round body '{}'", rigid.name);
        }
        let first = rigid.surface_nodes().start;
        let numbers = nodes.iter().map(|&node| (node as usize).saturating_sub(first)).collect();
        return list("vertex", "vertices", numbers, &rigid.name);
    }
    for body in bodies.iter().filter(|body| body.component == component) {
        let number = |&node: &u32| {
            let own = (node as usize).checked_sub(body.node_offset)?;
            body.numbering.node(own as u32).map(|node| node as usize)
        };
        if let Some(numbers) = nodes.iter().map(number).collect::<Option<Vec<usize>>>() {
            return list("node", "nodes", numbers, &body.name);
        }
    }
    format!("nodes {nodes:?}")
}
