//! The areas that nodes represent.
//!
//! Nodes of a deformable body carry a uniform pressure as its elements do: a third of each triangle, and the mean over both ways to
//! cut each quadrilateral, which is a quarter of a parallelogram. Nodes of a rigid body carry it independently of how its faces
//! are cut into triangles: the mixed Voronoi areas of Meyer, Desbrun, Schröder and Barr, "Discrete Differential-Geometry Operators for
//! Triangulated 2-Manifolds" (2003), section 3.3. All four corners of a rectangle represent a quarter of it, along whichever
//! diagonal it is cut. With thirds, a box that falls flat on a floor would turn over.
//!
//! A model of a part of a body is cut off on planes of symmetry and on periodic seams. Nothing presses these faces, so nodes on
//! their rim represent the area of their other faces only. Otherwise a half of a body would press harder along its cut than the
//! whole body does there.

use std::collections::BTreeSet;

use super::{Cell, Surface};
use crate::distance::{Vec3, at};

/// Returns the areas (m²) of the corners of a triangle of a deformable body.
fn thirds(corners: [Vec3; 3]) -> [f64; 3] {
    [area(corners) / 3.0; 3]
}

fn area([a, b, c]: [Vec3; 3]) -> f64 {
    0.5 * (b - a).cross(&(c - a)).norm()
}

/// Returns the mixed Voronoi areas (m²) of the corners of a triangle: of the points nearest to each if no angle is obtuse, otherwise
/// half of the triangle at the obtuse angle and a quarter at the others.
fn voronoi(corners: [Vec3; 3]) -> [f64; 3] {
    let whole = area(corners);
    let sides = |k: usize| [1, 2].map(|by: usize| corners[(k + by) % 3] - corners[k]);
    let dots = [0, 1, 2].map(|k| {
        let [first, second] = sides(k);
        first.dot(&second)
    });
    if let Some(obtuse) = (0..3).find(|&k| dots[k] <= 0.0) {
        return [0, 1, 2].map(|k| if k == obtuse { 0.5 * whole } else { 0.25 * whole });
    }
    // With cot α_k = dots[k]/(2 whole), the area at corner k is ⅛ Σ |side|² cot(angle opposite to it).
    [0, 1, 2].map(|k: usize| {
        let [first, second] = sides(k);
        let opposite = [dots[(k + 2) % 3], dots[(k + 1) % 3]];
        (first.norm_squared() * opposite[0] + second.norm_squared() * opposite[1]) / (16.0 * whole)
    })
}

/// The share of a triangle that a node of it represents.
pub(super) struct Share {
    pub(super) node: u32,
    pub(super) corners: [u32; 3],
    /// m²; negative where the other way to cut a quadrilateral corrects it.
    pub(super) area: f64,
    /// Whether the triangle is part of a cut through the body.
    pub(super) is_cut: bool,
}

/// Calls `each` with all shares of all triangles at rest. Each of the `quadrilaterals` is cut into two cells along the diagonal
/// of its first and third node.
pub(super) fn shares(
    cells: &[Cell],
    quadrilaterals: &[[u32; 4]],
    is_rigid: impl Fn(u32) -> bool,
    rest: &[f64],
    mut each: impl FnMut(Share),
) {
    let cuts: BTreeSet<[u32; 3]> = cells.iter().filter(|cell| cell.is_cut).map(|cell| cell.nodes).collect();
    for &Cell { nodes, is_cut, body, .. } in cells.iter().filter(|cell| cell.count == 3) {
        let corners = nodes.map(|node| at(rest, node));
        let areas = if is_rigid(body) { voronoi(corners) } else { thirds(corners) };
        let share = |(node, area)| Share { node, corners: nodes, area, is_cut };
        nodes.into_iter().zip(areas).for_each(|entry| each(share(entry)));
    }
    for &[a, b, c, d] in quadrilaterals {
        let mut cell = [a, b, c];
        cell.sort_unstable();
        let is_cut = cuts.contains(&cell);
        for (corners, part) in [([a, b, d], 0.5), ([b, c, d], 0.5), ([a, b, c], -0.5), ([a, c, d], -0.5)] {
            let area = part * area(corners.map(|node| at(rest, node))) / 3.0;
            corners.into_iter().for_each(|node| each(Share { node, corners, area, is_cut }));
        }
    }
}

/// Returns the area of each node at rest (m²), `None` for nodes of no triangle or edge: as the head of this file says, and half of the
/// length of each wire times its width. Triangles of a cut through the body count only for nodes that have no others.
pub(super) fn areas(
    cells: &[Cell],
    quadrilaterals: &[[u32; 4]],
    is_rigid: impl Fn(u32) -> bool,
    widths: &[f64],
    rest: &[f64],
) -> Vec<Option<f64>> {
    // Of each node, the area of what can be pressed, and of cuts.
    let mut areas = vec![[None; 2]; rest.len() / 3];
    let mut add = |node: u32, area: f64, is_cut: bool| {
        *areas[node as usize][usize::from(is_cut)].get_or_insert(0.0) += area;
    };
    shares(cells, quadrilaterals, is_rigid, rest, |share| add(share.node, share.area, share.is_cut));
    for cell in cells.iter().filter(|cell| cell.count == 2) {
        let length = (at(rest, cell.nodes[1]) - at(rest, cell.nodes[0])).norm();
        let share = 0.5 * length * widths[cell.body as usize];
        cell.nodes().iter().for_each(|&node| add(node, share, false));
    }
    areas.into_iter().map(|[pressed, of_cuts]| pressed.or(of_cuts)).collect()
}

/// The least cosine between a force on a node and the normal of a face that it presses.
const FACING: f64 = 0.5;

impl Surface {
    /// Returns the area of each node that a force presses (m²), infinite for nodes that represent none: that of the faces whose
    /// normals at positions x (m) are within 60° of the line of the force, and of all its faces if none is.
    ///
    /// The pressure on a node at the edge of a block that stands on a floor is thus that on its base, without the area of the sides.
    pub fn pressed_areas(&self, x: &[f64], force: impl Fn(u32) -> Vec3) -> Vec<f64> {
        let mut pressed = vec![0.0; x.len() / 3];
        let is_rigid = |body: u32| self.frames[body as usize].is_some();
        shares(&self.cells, &self.quadrilaterals, is_rigid, &self.rest, |share| {
            let force = force(share.node);
            if share.is_cut || force == Vec3::zeros() {
                return;
            }
            let [a, b, c] = share.corners.map(|node| at(x, node));
            let normal = (b - a).cross(&(c - a));
            if normal.dot(&force).abs() >= FACING * normal.norm() * force.norm() {
                pressed[share.node as usize] += share.area;
            }
        });
        let mut areas = vec![f64::INFINITY; pressed.len()];
        for point in &self.points {
            let pressed = pressed[point.node as usize];
            areas[point.node as usize] = if pressed > 0.0 { pressed } else { point.area };
        }
        areas
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Numbers;

    fn cell(mut nodes: [u32; 3]) -> Cell {
        nodes.sort_unstable();
        Cell { nodes, count: 3, body: 0, followed: [0, 1], is_cut: false }
    }

    /// The four corners of a rectangle represent equal areas, along whichever diagonal it is cut, whether it is rigid or a face
    /// of an element.
    #[test]
    fn corners_of_a_rectangle_are_equal() {
        let rest = [0.0, 0.0, 0.1, 0.4, 0.0, 0.1, 0.4, 0.3, 0.1, 0.0, 0.3, 0.1];
        for [a, b, c, d] in [[0, 1, 2, 3], [1, 2, 3, 0]] {
            let cells = [cell([a, b, c]), cell([a, c, d])];
            for (is_rigid, quadrilaterals) in [(true, &[][..]), (false, &[[a, b, c, d]][..])] {
                let found = areas(&cells, quadrilaterals, |_| is_rigid, &[0.0], &rest);
                assert!(found.iter().all(|area| (area.unwrap() - 0.03).abs() < 1e-16), "{found:?}");
            }
        }
    }

    /// Areas of a triangle are positive and sum to its own; those of a regular one are equal; and they change continuously where an angle
    /// becomes obtuse.
    #[test]
    fn voronoi_areas_sum_to_the_triangle() {
        let mut numbers = Numbers::new(5);
        for _ in 0..1000 {
            let corners = [(); 3].map(|()| numbers.vector());
            let found = voronoi(corners);
            assert!(found.iter().all(|&share| share > 0.0));
            assert!((found.iter().sum::<f64>() / area(corners) - 1.0).abs() < 1e-9, "{found:?}");
        }
        let right = |by: f64| voronoi([Vec3::zeros(), Vec3::x(), Vec3::new(by, 0.7, 0.0)]);
        (0..3).for_each(|k| assert!((right(1e-9)[k] - right(-1e-9)[k]).abs() < 1e-8));
        let regular = voronoi([Vec3::x(), Vec3::y(), Vec3::z()]);
        (0..3).for_each(|k| assert!((regular[k] - regular[0]).abs() < 1e-15));
    }
}
