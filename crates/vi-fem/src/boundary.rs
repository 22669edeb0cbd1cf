//! The boundary of a body without names: the faces that one element has alone; of a sheet, the sheet. It
//! must not know loads or what is done with the boundary.

use std::collections::HashMap;

use crate::facet::{Surface, turn_over};
use crate::{ElementKind, FemError, Mesh};

/// Corners of the faces, outward, then what lies on edges and faces.
struct Faces {
    corners: &'static [&'static [u32]],
    /// Ends of the edges whose midpoints follow the corners.
    edges: &'static [[u32; 2]],
    /// Number of corners of the element.
    corner_count: u32,
    /// Does each quadrilateral face have a node in its middle, after those of the edges?
    has_middles: bool,
}

const TET: &[&[u32]] = &[&[0, 1, 3], &[1, 2, 3], &[2, 0, 3], &[0, 2, 1]];
const HEX: &[&[u32]] =
    &[&[0, 4, 7, 3], &[1, 2, 6, 5], &[0, 1, 5, 4], &[3, 7, 6, 2], &[0, 3, 2, 1], &[4, 5, 6, 7]];
const WEDGE: &[&[u32]] = &[&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]];
const TET_EDGES: &[[u32; 2]] = &[[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];
const HEX_EDGES: &[[u32; 2]] =
    &[[0, 1], [1, 2], [2, 3], [3, 0], [4, 5], [5, 6], [6, 7], [7, 4], [0, 4], [1, 5], [2, 6], [3, 7]];
const WEDGE_EDGES: &[[u32; 2]] = &[[0, 1], [1, 2], [2, 0], [3, 4], [4, 5], [5, 3], [0, 3], [1, 4], [2, 5]];

fn faces(kind: ElementKind) -> Option<Faces> {
    let (corners, edges, corner_count, has_middles) = match kind {
        ElementKind::Tet4 => (TET, &[][..], 4, false),
        ElementKind::Tet10 => (TET, TET_EDGES, 4, false),
        ElementKind::Hex8 => (HEX, &[][..], 8, false),
        ElementKind::Hex20 => (HEX, HEX_EDGES, 8, false),
        ElementKind::Hex27 => (HEX, HEX_EDGES, 8, true),
        ElementKind::Wedge6 => (WEDGE, &[][..], 6, false),
        ElementKind::Wedge15 => (WEDGE, WEDGE_EDGES, 6, false),
        ElementKind::Wedge18 => (WEDGE, WEDGE_EDGES, 6, true),
        _ => return None,
    };
    Some(Faces { corners, edges, corner_count, has_middles })
}

impl Faces {
    /// Kind and local nodes of face number f.
    fn face(&self, f: usize) -> (ElementKind, Vec<u32>) {
        let corners = self.corners[f];
        let mut nodes = corners.to_vec();
        for k in 0..corners.len() {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            let middle = self.edges.iter().position(|&[p, q]| (p, q) == (a, b) || (p, q) == (b, a));
            nodes.extend(middle.map(|edge| self.corner_count + edge as u32));
        }
        if self.has_middles && corners.len() == 4 {
            let triangles = self.corners.iter().filter(|corners| corners.len() == 3).count();
            nodes.push(self.corner_count + (self.edges.len() + f - triangles) as u32);
        }
        let kind = match (corners.len(), nodes.len()) {
            (3, 3) => ElementKind::Tri3,
            (3, _) => ElementKind::Tri6,
            (_, 4) => ElementKind::Quad4,
            (_, 8) => ElementKind::Quad8,
            _ => ElementKind::Quad9,
        };
        (kind, nodes)
    }
}

/// Does a facet with these corners, a face of the element `nodes`, look into that element?
///
/// The corners decide, not places: the middle of a thin curved element may lie on the other side of its faces.
fn looks_inwards(faces: &Faces, nodes: &[u32], corners: &[u32]) -> bool {
    let face = faces.corners.iter().find(|face| {
        face.len() == corners.len() && face.iter().all(|&local| corners.contains(&nodes[local as usize]))
    });
    face.is_some_and(|face| {
        let first = face.iter().position(|&local| nodes[local as usize] == corners[0]).unwrap_or(0);
        nodes[face[(first + 1) % face.len()] as usize] != corners[1]
    })
}

impl Surface {
    /// Turns facets over that look into the solid element that they bound.
    pub(crate) fn look_outwards(&mut self, mesh: &Mesh) {
        let corner_count = |kind| if matches!(kind, ElementKind::Tri3 | ElementKind::Tri6) { 3 } else { 4 };
        let mut facet_of: HashMap<u32, Vec<(usize, usize)>> = HashMap::new();
        for (b, block) in self.blocks.iter().enumerate() {
            for (f, nodes) in block.facets().enumerate() {
                facet_of.entry(nodes[0]).or_default().push((b, f));
            }
        }
        let mut turn = Vec::new();
        for solid in mesh.blocks.iter().filter(|block| block.kind.dimension() == 3) {
            let Some(faces) = faces(solid.kind) else { continue };
            for cell in solid.nodes.chunks_exact(solid.kind.node_count()) {
                let candidates = cell.iter().filter_map(|node| facet_of.get(node)).flatten();
                for &(b, f) in candidates {
                    let block = &self.blocks[b];
                    let corners = &block.nodes[f * block.arity()..][..corner_count(block.kind)];
                    if looks_inwards(&faces, cell, corners) {
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

    /// The boundary of the elements of `dimension`: for 3 the faces that belong to one element alone,
    /// looking outwards; for 2 all elements, as they look.
    ///
    /// # Errors
    /// [`FemError::Unsupported`] for elements whose faces are not known.
    pub fn of_body(mesh: &Mesh, dimension: usize) -> Result<Self, FemError> {
        let mut blocks: Vec<(ElementKind, Vec<u32>)> = Vec::new();
        let mut add = |kind: ElementKind, nodes: &[u32]| {
            let index = blocks.iter().position(|block| block.0 == kind).unwrap_or_else(|| {
                blocks.push((kind, Vec::new()));
                blocks.len() - 1
            });
            blocks[index].1.extend(nodes);
        };
        // Faces in the order of their elements, with how often their corners occur.
        let mut all: Vec<(ElementKind, Vec<u32>, Vec<u32>)> = Vec::new();
        let mut count: HashMap<Vec<u32>, u32> = HashMap::new();
        for cell in mesh.cells_of_dimension(dimension) {
            let Some((kind, nodes)) = mesh.cell(cell as usize) else { continue };
            if dimension == 2 {
                add(kind, nodes);
                continue;
            }
            let faces = faces(kind).ok_or(FemError::Unsupported { kind, used: "elements with faces" })?;
            for (f, corners) in faces.corners.iter().enumerate() {
                let (kind, local) = faces.face(f);
                let face: Vec<u32> = local.iter().map(|&k| nodes[k as usize]).collect();
                let mut key = face[..corners.len()].to_vec();
                key.sort_unstable();
                *count.entry(key.clone()).or_default() += 1;
                all.push((kind, face, key));
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
    /// Triangles that cover the facets and use all of their nodes: a quadrilateral is cut in two, a quadratic facet
    /// at its midpoints.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let facets = self.blocks.iter().flat_map(|block| block.facets().map(|nodes| (block.kind, nodes)));
        let cut = |(kind, nodes): (ElementKind, &[u32])| -> Vec<[u32; 3]> {
            let local: &[[usize; 3]] = match kind {
                ElementKind::Tri3 => &[[0, 1, 2]],
                ElementKind::Tri6 => &[[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
                ElementKind::Quad4 => &[[0, 1, 2], [0, 2, 3]],
                ElementKind::Quad8 => &[[0, 4, 7], [4, 1, 5], [5, 2, 6], [6, 3, 7], [4, 5, 6], [4, 6, 7]],
                // Around the node in the middle.
                _ => {
                    &[[8, 0, 4], [8, 4, 1], [8, 1, 5], [8, 5, 2], [8, 2, 6], [8, 6, 3], [8, 3, 7], [8, 7, 0]]
                }
            };
            local.iter().map(|triangle| triangle.map(|k| nodes[k])).collect()
        };
        facets.flat_map(cut).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BoxMesh;

    #[test]
    fn a_box_has_the_surface_of_a_box() {
        for element in [
            ElementKind::Tet4,
            ElementKind::Tet10,
            ElementKind::Hex8,
            ElementKind::Hex20,
            ElementKind::Hex27,
            ElementKind::Wedge6,
            ElementKind::Wedge15,
            ElementKind::Wedge18,
        ] {
            let size = [1.0, 2.0, 3.0];
            let Ok(mesh) = (BoxMesh { size, cells: [2, 2, 3], element, origin: [0.0; 3] }).build() else {
                continue;
            };
            let surface = Surface::of_body(&mesh, 3).unwrap();
            assert!((surface.area(&mesh) - 22.0).abs() < 1e-12, "{element}");
            // ∮ x·n dA = 3 V says that all faces look outwards and midpoints are in their places.
            assert!((surface.enclosed_volume(&mesh) - 6.0).abs() < 1e-12, "{element}");
            let triangles = surface.triangles();
            let of = |[a, b, c]: [u32; 3]| {
                let [a, b, c] = [a, b, c].map(|node| mesh.points[node as usize]);
                let n = crate::tensor::cross(b, c);
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

    /// Named surfaces look outwards however thin and curved the elements are: together they are the boundary.
    #[test]
    fn named_faces_of_a_thin_curved_element_look_outwards() {
        for element in [ElementKind::Hex20, ElementKind::Hex27] {
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
