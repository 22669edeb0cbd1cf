//! The areas that nodes represent.
//!
//! Nodes of a deformable body carry a uniform pressure as its elements do: a third of each triangle, and the mean over both ways to
//! cut each quadrilateral, which is a quarter of a parallelogram. Nodes of a rigid body carry it independently of how its faces
//! are cut into triangles: the mixed Voronoi areas of Meyer, Desbrun, Schröder and Barr, "Discrete Differential-Geometry Operators for
//! Triangulated 2-Manifolds" (2003), section 3.3. All four corners of a rectangle represent a quarter of it, along whichever
//! diagonal it is cut. With thirds, a box that falls flat on a floor would turn over.

use super::Cell;
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

/// Returns the area of each node at rest (m²), `None` for nodes of no triangle or edge: as the head of this file says, and half of the
/// length of each wire times its width. Each of the `quadrilaterals` is cut into two cells along the diagonal of its first and third
/// node.
pub(super) fn areas(
    cells: &[Cell],
    quadrilaterals: &[[u32; 4]],
    is_rigid: impl Fn(u32) -> bool,
    widths: &[f64],
    rest: &[f64],
) -> Vec<Option<f64>> {
    let mut areas = vec![None; rest.len() / 3];
    let mut add = |node: u32, area: f64| *areas[node as usize].get_or_insert(0.0) += area;
    for cell in cells {
        let corners = cell.nodes.map(|node| at(rest, node));
        match cell.count {
            3 => {
                let shares = if is_rigid(cell.body) { voronoi(corners) } else { thirds(corners) };
                cell.nodes.iter().zip(shares).for_each(|(&node, share)| add(node, share));
            }
            2 => {
                let share = 0.5 * (corners[1] - corners[0]).norm() * widths[cell.body as usize];
                cell.nodes().iter().for_each(|&node| add(node, share));
            }
            _ => {}
        }
    }
    for &[a, b, c, d] in quadrilaterals {
        let third = |nodes: [u32; 3]| area(nodes.map(|node| at(rest, node))) / 3.0;
        let cut = |nodes: [u32; 3], share: f64| nodes.map(|node| (node, share * third(nodes)));
        let changes = [cut([a, b, d], 0.5), cut([b, c, d], 0.5), cut([a, b, c], -0.5), cut([a, c, d], -0.5)];
        changes.into_iter().flatten().for_each(|(node, change)| add(node, change));
    }
    areas
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Numbers;

    fn cell(mut nodes: [u32; 3]) -> Cell {
        nodes.sort_unstable();
        Cell { nodes, count: 3, body: 0, followed: [0, 1] }
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
