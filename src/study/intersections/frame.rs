//! The surfaces of a frame: positions, the triangles of sheets and of the boundaries of solids, and lines.
//!
//! Quadratic sides become four triangles or more through their midpoints, the linear proxy that contact uses too.

use std::collections::HashMap;

use vi_io::{CellKind, MeshFile};

/// What can cross in a frame.
pub(crate) struct FrameSurface {
    pub(crate) points: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) wires: Vec<[u32; 2]>,
}

/// Sides of volumes by their corners, in VTK's numbering.
const TETRAHEDRON: &[&[usize]] = &[&[0, 1, 2], &[0, 1, 3], &[1, 2, 3], &[0, 2, 3]];
const HEXAHEDRON: &[&[usize]] =
    &[&[0, 3, 7, 4], &[1, 2, 6, 5], &[0, 1, 5, 4], &[3, 2, 6, 7], &[0, 1, 2, 3], &[4, 5, 6, 7]];
const WEDGE: &[&[usize]] = &[&[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5], &[0, 1, 2], &[3, 4, 5]];
const PYRAMID: &[&[usize]] = &[&[0, 1, 2, 3], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];

/// Ends of the edges in the order of their midpoints.
const TETRAHEDRON_EDGES: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
const HEXAHEDRON_EDGES: &[[usize; 2]] =
    &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
const WEDGE_EDGES: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]];
const PYRAMID_EDGES: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4]];
const TRIANGLE_EDGES: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 0]];
const QUAD_EDGES: &[[usize; 2]] = &[[0, 1], [1, 2], [2, 3], [3, 0]];

/// The corners, sides and edges of a kind; a surface is its own side.
struct Layout {
    corners: usize,
    sides: &'static [&'static [usize]],
    edges: &'static [[usize; 2]],
    has_midpoints: bool,
    /// The first centre of a side, and how many sides have one.
    centres: (usize, usize),
}

fn layout(kind: CellKind) -> Option<Layout> {
    let new = |corners, sides, edges, has_midpoints, centres| {
        Some(Layout { corners, sides, edges, has_midpoints, centres })
    };
    match kind {
        CellKind::Triangle3 => new(3, &[&[0, 1, 2]], TRIANGLE_EDGES, false, (0, 0)),
        CellKind::Triangle6 => new(3, &[&[0, 1, 2]], TRIANGLE_EDGES, true, (0, 0)),
        CellKind::Quad4 => new(4, &[&[0, 1, 2, 3]], QUAD_EDGES, false, (0, 0)),
        CellKind::Quad8 => new(4, &[&[0, 1, 2, 3]], QUAD_EDGES, true, (0, 0)),
        CellKind::Quad9 => new(4, &[&[0, 1, 2, 3]], QUAD_EDGES, true, (8, 1)),
        CellKind::Tetra4 => new(4, TETRAHEDRON, TETRAHEDRON_EDGES, false, (0, 0)),
        CellKind::Tetra10 => new(4, TETRAHEDRON, TETRAHEDRON_EDGES, true, (0, 0)),
        CellKind::Hexahedron8 => new(8, HEXAHEDRON, HEXAHEDRON_EDGES, false, (0, 0)),
        CellKind::Hexahedron20 => new(8, HEXAHEDRON, HEXAHEDRON_EDGES, true, (0, 0)),
        CellKind::Hexahedron27 => new(8, HEXAHEDRON, HEXAHEDRON_EDGES, true, (20, 6)),
        CellKind::Wedge6 => new(6, WEDGE, WEDGE_EDGES, false, (0, 0)),
        CellKind::Wedge15 => new(6, WEDGE, WEDGE_EDGES, true, (0, 0)),
        CellKind::Wedge18 => new(6, WEDGE, WEDGE_EDGES, true, (15, 3)),
        CellKind::Pyramid5 => new(5, PYRAMID, PYRAMID_EDGES, false, (0, 0)),
        CellKind::Pyramid13 => new(5, PYRAMID, PYRAMID_EDGES, true, (0, 0)),
        _ => None,
    }
}

impl FrameSurface {
    /// The surfaces of a frame, whose points are at rest and have an array `displacement`, or are where they are.
    pub(crate) fn new(frame: &MeshFile) -> Self {
        let mut points = frame.points.clone();
        let displacement =
            frame.point_data.iter().find(|data| data.name == "displacement" && data.components == 3);
        if let Some(data) = displacement {
            for (point, moved) in points.iter_mut().zip(data.values.chunks_exact(3)) {
                (0..3).for_each(|k| point[k] += moved[k]);
            }
        }
        let (mut triangles, mut wires) = (Vec::new(), Vec::new());
        // Sides of solids by their corners: those that one cell has are the boundary.
        let mut sides: HashMap<Vec<u32>, Option<Vec<[u32; 3]>>> = HashMap::new();
        for (kind, nodes) in frame.cells() {
            match kind {
                CellKind::Line2 => wires.push([nodes[0], nodes[1]]),
                CellKind::Line3 => wires.extend([[nodes[0], nodes[2]], [nodes[2], nodes[1]]]),
                _ => {}
            }
            let Some(layout) = layout(kind) else { continue };
            for (number, side) in layout.sides.iter().enumerate() {
                let parts = split(&layout, number, side, nodes);
                if kind.dimension() == 2 {
                    triangles.extend(parts);
                    continue;
                }
                let mut key: Vec<u32> = side.iter().map(|&corner| nodes[corner]).collect();
                key.sort_unstable();
                sides.entry(key).and_modify(|seen| *seen = None).or_insert(Some(parts));
            }
        }
        let mut boundary: Vec<[u32; 3]> = sides.into_values().flatten().flatten().collect();
        boundary.sort_unstable();
        triangles.extend(boundary);
        Self { points, triangles, wires }
    }
}

/// Triangles of a side: through its centre if it has one, else through its midpoints, else through its corners.
fn split(layout: &Layout, number: usize, side: &[usize], nodes: &[u32]) -> Vec<[u32; 3]> {
    let count = side.len();
    let corner = |k: usize| nodes[side[k % count]];
    let middle = |k: usize| {
        let ends = [side[k % count], side[(k + 1) % count]];
        let edge = layout.edges.iter().position(|edge| *edge == ends || *edge == [ends[1], ends[0]]);
        nodes[layout.corners + edge.unwrap_or_default()]
    };
    let (first, centres) = layout.centres;
    if !layout.has_midpoints {
        return (1..count - 1).map(|k| [corner(0), corner(k), corner(k + 1)]).collect();
    }
    if number < centres {
        let centre = nodes[first + number];
        return (0..count)
            .flat_map(|k| [[corner(k), middle(k), centre], [middle(k), corner(k + 1), centre]])
            .collect();
    }
    let mut triangles: Vec<[u32; 3]> =
        (0..count).map(|k| [middle(k + count - 1), corner(k), middle(k)]).collect();
    triangles.extend((1..count - 1).map(|k| [middle(0), middle(k), middle(k + 1)]));
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surface_of_every_solid_is_closed_and_uses_all_of_its_boundary() {
        for &kind in CellKind::ALL.iter().filter(|kind| kind.dimension() == 3) {
            let count = kind.node_count() as u32;
            let block = vi_io::CellBlock { kind, nodes: (0..count).collect() };
            let points = vec![[0.0; 3]; count as usize];
            let surface = FrameSurface::new(&MeshFile { points, blocks: vec![block], ..MeshFile::default() });
            let mut edges: HashMap<[u32; 2], i32> = HashMap::new();
            for &[a, b, c] in &surface.triangles {
                for (a, b) in [(a, b), (b, c), (c, a)] {
                    *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
                }
            }
            assert!(edges.values().all(|&triangles| triangles == 2), "{}", kind.name());
            let mut used: Vec<u32> = surface.triangles.concat();
            used.sort_unstable();
            used.dedup();
            // The centre of the biquadratic hexahedron is inside.
            let inside = u32::from(kind == CellKind::Hexahedron27);
            assert_eq!(used.len() as u32, count - inside, "{}", kind.name());
        }
    }
}
