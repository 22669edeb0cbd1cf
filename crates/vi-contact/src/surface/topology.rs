//! Computes the areas of points and edges, and how sharply the surface bends at each edge at rest.

use std::collections::BTreeMap;

use super::{Cell, Edge};
use crate::distance::{Vec3, at};

/// 1 − cos 30°: an edge with a larger angle between the normals of its triangles is sharp.
const SHARP: f64 = 0.133_974_596_215_561_35;

/// Returns the edges of cells, and the area of each node: a third of its triangles, half of its wires' length times
/// width.
pub(super) fn edges_and_areas(
    cells: &[Cell],
    widths: &[f64],
    rest: &[f64],
) -> (Vec<Edge>, BTreeMap<u32, f64>) {
    let mut areas = BTreeMap::new();
    let mut at_edge: BTreeMap<(u32, [u32; 2]), (f64, Vec<Vec3>)> = BTreeMap::new();
    for cell in cells {
        let nodes = cell.nodes();
        let x = |k: usize| at(rest, nodes[k]);
        match nodes.len() {
            3 => {
                let area = 0.5 * (x(1) - x(0)).cross(&(x(2) - x(0))).norm();
                nodes.iter().for_each(|&node| *areas.entry(node).or_insert(0.0) += area / 3.0);
                for [i, j, k] in [[0, 1, 2], [0, 2, 1], [1, 2, 0]] {
                    let along = (x(j) - x(i)).normalize();
                    let side = x(k) - x(i);
                    let side = side - along * side.dot(&along);
                    let entry = at_edge.entry((cell.body, [nodes[i], nodes[j]])).or_default();
                    entry.0 += area / 3.0;
                    entry.1.push(side.normalize());
                }
            }
            2 => {
                let area = (x(1) - x(0)).norm() * widths[cell.body as usize];
                nodes.iter().for_each(|&node| *areas.entry(node).or_insert(0.0) += 0.5 * area);
                at_edge.entry((cell.body, [nodes[0], nodes[1]])).or_default().0 += area;
            }
            _ => {}
        }
    }
    let edges = at_edge.into_iter().map(|((body, nodes), (area, sides))| {
        // The side vectors of two coplanar triangles are opposite. Rims, wires and forks count as sharp.
        let sharpness = match sides.as_slice() {
            [first, second] => ((1.0 + first.dot(second)) / SHARP).clamp(0.0, 1.0),
            _ => 1.0,
        };
        let square = (at(rest, nodes[1]) - at(rest, nodes[0])).norm_squared();
        Edge { nodes, body, area, sharpness, square }
    });
    (edges.collect(), areas)
}

/// Returns the median over the triangles of their shortest edge at rest, m. A tenth of it is the usual activation
/// distance d̂. Long cells count with their short side, so that the layer stays thin compared with them.
pub fn median_edge(triangles: &[[u32; 3]], rest: &[f64]) -> Option<f64> {
    let length = |a: u32, b: u32| (at(rest, a) - at(rest, b)).norm();
    let shortest = |&[a, b, c]: &[u32; 3]| length(a, b).min(length(b, c)).min(length(c, a));
    let mut lengths: Vec<f64> = triangles.iter().map(shortest).collect();
    let middle = lengths.len() / 2;
    (!lengths.is_empty()).then(|| *lengths.select_nth_unstable_by(middle, f64::total_cmp).1)
}
