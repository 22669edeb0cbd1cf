//! Finds the boundary of a body that has no named surfaces: for a solid the faces that belong to one element only,
//! for a sheet the sheet itself.

use std::collections::HashMap;

use crate::cell::{CellKind, Side};
use crate::error::MeshError;
use crate::facet::{Surface, turn_over};
use crate::mesh::Mesh;

/// Returns whether a facet with these corners, a face of the element `nodes`, faces into that element.
///
/// The corners decide, not positions: the centre of a thin curved element may lie on the other side of its faces.
fn looks_inwards(faces: &[Side], nodes: &[u32], corners: &[u32]) -> bool {
    let of_face = |face: &Side| face.nodes[..face.kind.corner_count()].to_vec();
    let is_face = |face: &Vec<usize>| {
        face.len() == corners.len() && face.iter().all(|&local| corners.contains(&nodes[local]))
    };
    faces.iter().map(of_face).find(is_face).is_some_and(|face| {
        let first = face.iter().position(|&local| nodes[local] == corners[0]).unwrap_or(0);
        nodes[face[(first + 1) % face.len()]] != corners[1]
    })
}

impl Surface {
    /// Reverses the facets that face into the solid element that they bound.
    pub(crate) fn look_outwards(&mut self, mesh: &Mesh) {
        let mut facet_of: HashMap<u32, Vec<(usize, usize)>> = HashMap::new();
        for (b, block) in self.blocks.iter().enumerate() {
            for (f, nodes) in block.facets().enumerate() {
                facet_of.entry(nodes[0]).or_default().push((b, f));
            }
        }
        let mut turn = Vec::new();
        for solid in mesh.blocks.iter().filter(|block| block.kind.dimension() == 3) {
            for cell in solid.cells() {
                let candidates = cell.iter().filter_map(|node| facet_of.get(node)).flatten();
                for &(b, f) in candidates {
                    let block = &self.blocks[b];
                    let corners = &block.nodes[f * block.arity()..][..block.kind.corner_count()];
                    if looks_inwards(solid.kind.sides(), cell, corners) {
                        turn.push((b, f));
                    }
                }
            }
        }
        for (b, f) in turn {
            let block = &mut self.blocks[b];
            let arity = block.arity();
            turn_over(block.kind, &mut block.nodes[f * arity..][..arity]);
        }
    }

    /// Returns the boundary of the elements of `dimension`: for 3 the faces that belong to one element only, facing
    /// outwards; for 2 all elements with their own orientation.
    ///
    /// # Errors
    /// Returns [`MeshError::Unsupported`] for cells that are not surfaces or volumes.
    pub fn of_body(mesh: &Mesh, dimension: usize) -> Result<Self, MeshError> {
        let mut blocks: Vec<(CellKind, Vec<u32>)> = Vec::new();
        let mut add = |kind: CellKind, nodes: &[u32]| {
            let index = blocks.iter().position(|block| block.0 == kind).unwrap_or_else(|| {
                blocks.push((kind, Vec::new()));
                blocks.len() - 1
            });
            blocks[index].1.extend(nodes);
        };
        // List the faces in the order of their elements, and count how often their corners occur.
        let mut all: Vec<(CellKind, Vec<u32>, Vec<u32>)> = Vec::new();
        let mut count: HashMap<Vec<u32>, u32> = HashMap::new();
        for cell in mesh.cells_of_dimension(dimension) {
            let Some((kind, nodes)) = mesh.cell(cell as usize) else { continue };
            if dimension == 2 {
                add(kind, nodes);
                continue;
            }
            for side in kind.sides() {
                let face: Vec<u32> = side.nodes.iter().map(|&k| nodes[k]).collect();
                let mut key = face[..side.kind.corner_count()].to_vec();
                key.sort_unstable();
                *count.entry(key.clone()).or_default() += 1;
                all.push((side.kind, face, key));
            }
        }
        for (kind, face, key) in &all {
            if count[key] == 1 {
                add(*kind, face);
            }
        }
        Surface::from_blocks("boundary", blocks)
    }
}

impl Surface {
    /// Returns triangles that cover the facets and use all of their nodes: a quadrilateral is cut in two, a quadratic
    /// facet at its midpoints.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        self.parts(|kind| kind.triangles())
    }

    /// Returns the quadrilaterals that [`Surface::triangles`] cuts along the diagonal from their first to their third node although the
    /// other one would do as well.
    pub fn cut_quadrilaterals(&self) -> Vec<[u32; 4]> {
        self.parts(|kind| kind.cut_quadrilaterals())
    }

    /// Returns the nodes of parts of all facets, which are given as local node numbers.
    fn parts<const N: usize>(&self, of: impl Fn(CellKind) -> &'static [[usize; N]]) -> Vec<[u32; N]> {
        let facets = self.blocks.iter().flat_map(|block| block.facets().map(|nodes| (block.kind, nodes)));
        let parts = |(kind, nodes): (CellKind, &[u32])| -> Vec<[u32; N]> {
            of(kind).iter().map(|part| part.map(|k| nodes[k])).collect()
        };
        facets.flat_map(parts).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::box_mesh::BoxMesh;

    #[test]
    fn a_box_has_the_surface_of_a_box() {
        for element in BoxMesh::elements() {
            let size = [1.0, 2.0, 3.0];
            let mesh = BoxMesh { size, cells: [2, 2, 3], element, origin: [0.0; 3] }.build().unwrap();
            let surface = Surface::of_body(&mesh, 3).unwrap();
            assert!((surface.area(&mesh) - 22.0).abs() < 1e-12, "{element}");
            // ∮ x·n dA = 3 V holds if all faces face outwards and the midpoints are in place.
            assert!((surface.enclosed_volume(&mesh) - 6.0).abs() < 1e-12, "{element}");
            let triangles = surface.triangles();
            let of = |[a, b, c]: [u32; 3]| {
                let [a, b, c] = [a, b, c].map(|node| mesh.points[node as usize]);
                let n = crate::vector::cross(b, c);
                (0..3).map(|k| a[k] * n[k]).sum::<f64>() / 6.0
            };
            let volume: f64 = triangles.iter().map(|&triangle| of(triangle)).sum();
            assert!((volume - 6.0).abs() < 1e-12, "{element}: {volume}");
            let nodes = |all: &mut Vec<u32>| {
                all.sort_unstable();
                all.dedup();
                all.len()
            };
            let mut of_facets: Vec<u32> =
                surface.blocks.iter().flat_map(|block| block.nodes.clone()).collect();
            assert_eq!(nodes(&mut triangles.into_flattened()), nodes(&mut of_facets), "{element}");
        }
    }

    /// Named surfaces face outwards, however thin and curved the elements are; together they are the boundary.
    #[test]
    fn named_faces_of_a_thin_curved_element_look_outwards() {
        for element in [CellKind::Hex20, CellKind::Hex27] {
            let shape = BoxMesh { size: [1.0; 3], cells: [1, 1, 1], element, origin: [0.0; 3] };
            let mut mesh = shape.build().unwrap();
            for x in &mut mesh.points {
                let (radius, angle) = (1.0 + 0.02 * x[0], std::f64::consts::FRAC_PI_2 * x[1]);
                *x = [radius * angle.cos(), radius * angle.sin(), x[2]];
            }
            let named = ["x-min", "x-max", "y-min", "y-max", "z-min", "z-max"];
            let of = |name: &str| Surface::of_region(&mesh, name).unwrap().enclosed_volume(&mesh);
            let sum: f64 = named.map(of).iter().sum();
            let whole = Surface::of_body(&mesh, 3).unwrap().enclosed_volume(&mesh);
            assert!(whole > 0.0 && (sum - whole).abs() < 1e-12, "{element}: {sum} {whole}");
        }
    }
}
