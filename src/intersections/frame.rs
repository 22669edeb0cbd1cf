//! The surfaces of a frame: positions, the triangles of sheets and of the boundaries of solids, and lines.
//!
//! Quadratic sides become four or more triangles through their mid-side nodes, the same linear approximation as in
//! contact.

use std::collections::HashMap;

use vi_io::MeshFile;
use vi_mesh::CellKind;

/// Edges and triangles of a frame.
pub(crate) struct FrameSurface {
    pub(crate) points: Vec<[f64; 3]>,
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) wires: Vec<[u32; 2]>,
}

impl FrameSurface {
    /// Returns the surfaces of a frame. Its points are either the positions at rest, with an array `displacement`, or
    /// the current positions.
    pub(crate) fn new(frame: &MeshFile) -> Self {
        let mut points = frame.mesh.points.clone();
        let displacement =
            frame.point_data.iter().find(|data| data.name == "displacement" && data.components == 3);
        if let Some(data) = displacement {
            for (point, moved) in points.iter_mut().zip(data.values.chunks_exact(3)) {
                (0..3).for_each(|k| point[k] += moved[k]);
            }
        }
        let (mut triangles, mut wires) = (Vec::new(), Vec::new());
        // Sides of solids are identified by their corners: those of only one cell form the boundary.
        let mut sides: HashMap<Vec<u32>, Option<Vec<[u32; 3]>>> = HashMap::new();
        for (kind, nodes) in frame.mesh.cells() {
            match kind.dimension() {
                1 if kind.is_linear() => wires.push([nodes[0], nodes[1]]),
                1 => wires.extend([[nodes[0], nodes[2]], [nodes[2], nodes[1]]]),
                2 => triangles.extend(cut(kind, nodes)),
                3 => {
                    for side in kind.sides() {
                        let nodes: Vec<u32> = side.nodes.iter().map(|&node| nodes[node]).collect();
                        let mut key = nodes[..side.kind.corner_count()].to_vec();
                        key.sort_unstable();
                        let parts = cut(side.kind, &nodes);
                        sides.entry(key).and_modify(|seen| *seen = None).or_insert(Some(parts));
                    }
                }
                _ => {}
            }
        }
        let mut boundary: Vec<[u32; 3]> = sides.into_values().flatten().flatten().collect();
        boundary.sort_unstable();
        triangles.extend(boundary);
        Self { points, triangles, wires }
    }
}

/// Returns the triangles of a cell of a surface.
fn cut(kind: CellKind, nodes: &[u32]) -> Vec<[u32; 3]> {
    kind.triangles().iter().map(|triangle| triangle.map(|node| nodes[node])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surface_of_every_solid_is_closed_and_uses_all_of_its_boundary() {
        for &kind in CellKind::ALL.iter().filter(|kind| kind.dimension() == 3) {
            let count = kind.node_count() as u32;
            let mut file = MeshFile::default();
            file.mesh.points = vec![[0.0; 3]; count as usize];
            file.mesh.push_cell(kind, &Vec::from_iter(0..count));
            let surface = FrameSurface::new(&file);
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
            // The centre node of the biquadratic hexahedron is inside.
            let inside = u32::from(kind == CellKind::Hex27);
            assert_eq!(used.len() as u32, count - inside, "{}", kind.name());
        }
    }
}
