//! Ties periodic pairs of nodes. The translation between two parts of a body gives the partners, which are tied by
//! x_b = x_a + (X_b − X_a). The constant vector is a director, which translations do not change.

use std::collections::BTreeMap;

use vi_mesh::Mesh;

use super::select::{self, ON_PLANE};
use crate::scene::Periodic;

/// Returns each node of `to` with its partner in `from`, as (from, to).
///
/// # Errors
/// Returns a problem with its key if the two parts do not match.
pub(super) fn partners(periodic: &Periodic, mesh: &Mesh) -> Result<Vec<(u32, u32)>, (String, String)> {
    let select =
        |side: &str, on| select::nodes(mesh, on).map_err(|(key, message)| (format!("{side}.{key}"), message));
    let from = select("from", &periodic.from)?;
    let to = select("to", &periodic.to)?;
    if from.len() != to.len() {
        let message = format!(
            "`from` has {} nodes and `to` has {}; the meshes of the two parts must be alike, node by node",
            from.len(),
            to.len()
        );
        return Err((String::new(), message));
    }
    let centre = |nodes: &[u32]| {
        let sum = |i: usize| nodes.iter().map(|&node| mesh.points[node as usize][i]).sum::<f64>();
        [0, 1, 2].map(|i| sum(i) / nodes.len() as f64)
    };
    let (c, d) = (centre(&from), centre(&to));
    let translation = [0, 1, 2].map(|i| d[i] - c[i]);
    let reach = ON_PLANE * select::extent(mesh);
    // Sorts the nodes of `from` into the cells of a grid, so that not all pairs are compared.
    let cell = |x: [f64; 3]| x.map(|x| (x / (4.0 * reach)).round() as i64);
    let mut grid: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
    for &node in &from {
        grid.entry(cell(mesh.points[node as usize])).or_default().push(node);
    }
    let mut pairs = Vec::with_capacity(to.len());
    for &node in &to {
        let x = mesh.points[node as usize];
        let origin = [0, 1, 2].map(|i| x[i] - translation[i]);
        let [i, j, k] = cell(origin);
        let near =
            (-1..=1).flat_map(|a| (-1..=1).flat_map(move |b| (-1..=1).map(move |c| [i + a, j + b, k + c])));
        let distance = |&other: &u32| {
            let y = mesh.points[other as usize];
            (0..3).map(|i| (y[i] - origin[i]).powi(2)).sum::<f64>().sqrt()
        };
        let candidates = near.filter_map(|cell| grid.get(&cell)).flatten().copied();
        let best = candidates.min_by(|a, b| distance(a).total_cmp(&distance(b)));
        match best.filter(|best| distance(best) <= reach) {
            Some(other) => pairs.push((other, node)),
            None => {
                let message = format!(
                    "node {node} of `to` has no partner in `from`: none lies at {origin:?} m, by the translation \
                     {translation:?} m between the two parts; their meshes must be alike, node by node"
                );
                return Err((String::new(), message));
            }
        }
    }
    pairs.retain(|(a, b)| a != b);
    if pairs.is_empty() && !to.is_empty() {
        let message = "`from` and `to` are the same nodes: name two opposite parts, or remove this table";
        return Err((String::new(), message.to_owned()));
    }
    Ok(pairs)
}

/// Returns each tied node with the node that it follows. No node is tied twice, and none follows a tied one: at the
/// edges of a body that is periodic in several directions, nodes follow one at a corner.
pub(super) fn leaders(pairs: impl IntoIterator<Item = (u32, u32)>) -> BTreeMap<u32, u32> {
    let mut leader: BTreeMap<u32, u32> = BTreeMap::new();
    let root = |leader: &BTreeMap<u32, u32>, mut node: u32| {
        while let Some(&next) = leader.get(&node) {
            node = next;
        }
        node
    };
    for (a, b) in pairs {
        let (a, b) = (root(&leader, a), root(&leader, b));
        if a != b {
            leader.insert(b, a);
        }
    }
    let nodes: Vec<u32> = leader.keys().copied().collect();
    nodes.into_iter().map(|node| (node, root(&leader, node))).collect()
}
