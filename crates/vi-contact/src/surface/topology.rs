//! Computes the areas of edges, and how sharply the surface bends at each edge at rest.

use super::{Cell, Edge};
use crate::distance::at;

/// 1 − cos 30°: an edge with a larger angle between the normals of its triangles is sharp.
const SHARP: f64 = 0.133_974_596_215_561_35;

/// Returns the edges of cells. An edge represents a third of its triangles, or the length of a wire times its width.
///
/// Beyond a cut through the body, the surface continues as the mirror image of its own side: exactly on a plane of symmetry,
/// and on a seam of a periodic body if the surface meets it at a right angle.
pub(super) fn edges(cells: &[Cell], widths: &[f64], rest: &[f64]) -> Vec<Edge> {
    let corner = |cell: &Cell, k: usize| at(rest, cell.nodes[k]);
    let area_of = |cell: &Cell| match cell.count {
        3 => 0.5 * (corner(cell, 1) - corner(cell, 0)).cross(&(corner(cell, 2) - corner(cell, 0))).norm(),
        2 => (corner(cell, 1) - corner(cell, 0)).norm() * widths[cell.body as usize],
        _ => 0.0,
    };
    // The edges of all cells, each with its cell and the corner opposite to it.
    let mut sides: Vec<(u32, [u32; 2], u32, u8)> = Vec::new();
    for (number, cell) in (0..).zip(cells).filter(|(_, cell)| cell.count > 1) {
        let edges: &[[u8; 3]] =
            if cell.count == 3 { &[[0, 1, 2], [0, 2, 1], [1, 2, 0]] } else { &[[0, 1, 2]] };
        sides.extend(edges.iter().map(|&[i, j, k]| {
            let nodes = [i, j].map(|place| cell.nodes[place as usize]);
            (cell.body, nodes, number, k)
        }));
    }
    sides.sort_unstable();
    let edge = |sides: &[(u32, [u32; 2], u32, u8)]| {
        let (body, nodes, ..) = sides[0];
        let [first, second] = nodes.map(|node| at(rest, node));
        let along = (second - first).normalize();
        let (mut area, mut towards, mut cut) = (0.0, Vec::new(), None);
        let is_cut = |side: &(u32, [u32; 2], u32, u8)| cells[side.2 as usize].is_cut;
        // An edge within a cut has the area of its triangles there.
        let is_inside_cut = sides.iter().all(is_cut);
        for side @ &(_, _, cell, opposite) in sides {
            let cell = &cells[cell as usize];
            if is_cut(side) && !is_inside_cut {
                let [a, b, c] = [0, 1, 2].map(|k| corner(cell, k));
                cut = Some((b - a).cross(&(c - a)).normalize());
            } else if cell.count == 3 {
                area += area_of(cell) / 3.0;
                let side = corner(cell, opposite as usize) - first;
                towards.push((side - along * side.dot(&along)).normalize());
            } else {
                area += area_of(cell);
            }
        }
        if let (Some(normal), &[side]) = (cut, towards.as_slice()) {
            towards.push(side - normal * (2.0 * side.dot(&normal)));
        }
        // The side vectors of two coplanar triangles are opposite. Rims, wires and forks count as sharp.
        let sharpness = match towards.as_slice() {
            [first, second] => ((1.0 + first.dot(second)) / SHARP).clamp(0.0, 1.0),
            _ => 1.0,
        };
        Edge { nodes, body, area, sharpness, square: (second - first).norm_squared() }
    };
    sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)).map(edge).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    /// An edge between a flat base and a plane of symmetry is as blunt as the middle of the whole base; between the base and a side
    /// it is sharp.
    #[test]
    fn a_plane_of_symmetry_makes_no_sharp_edge() {
        let rest = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.5, 1.0];
        for is_cut in [false, true] {
            let cell = |nodes, is_cut| Cell { nodes, count: 3, body: 0, followed: [0, 1], is_cut };
            let found = edges(&[cell([0, 1, 2], false), cell([0, 1, 3], is_cut)], &[0.0], &rest);
            let shared = found.iter().find(|edge| edge.nodes == [0, 1]).unwrap();
            assert_eq!(shared.sharpness, if is_cut { 0.0 } else { 1.0 });
            let thirds = if is_cut { 1.0 } else { 2.0 };
            assert!((shared.area - thirds / 6.0).abs() < 1e-15);
        }
    }
}
