//! Box meshes. It must not know laws or files.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{ElementBlock, ElementKind, FemError, Mesh, Region};

/// A box of cells: `box = { size = [1.0, 0.25, 0.25], cells = [16, 4, 4], element = "tet4" }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BoxMesh {
    /// Extents along x, y, z, m; positive.
    pub size: [f64; 3],
    /// Cells along x, y, z; at least 1 each.
    pub cells: [u32; 3],
    /// The element that cells are made of; a cell is one hexahedron, 2 wedges or 6 tetrahedra.
    #[serde(default = "default_element")]
    pub element: ElementKind,
    /// The corner of smallest coordinates, m.
    #[serde(default)]
    pub origin: [f64; 3],
}

fn default_element() -> ElementKind {
    ElementKind::Tet4
}

/// Kuhn's six tetrahedra of a cube with corners i + 2j + 4k, all around the diagonal 0–7, so that
/// neighbouring cubes match. Ordered and turned as in the reference cases.
const KUHN: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 5, 1, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 6, 4, 7]];

impl BoxMesh {
    /// The mesh: nodes in lattice order, i fastest, node = i + j nx + k nx ny; the volume region
    /// `box` and the surface regions `x-min x-max y-min y-max z-min z-max`.
    ///
    /// # Errors
    /// [`FemError::Parameter`] for a size that is not positive or no cells,
    /// [`FemError::Unsupported`] for a kind that boxes are not made of.
    pub fn build(&self) -> Result<Mesh, FemError> {
        self.check()?;
        let kind = self.element;
        if kind != ElementKind::Tet4 {
            return Err(FemError::Unsupported { kind, used: "elements of a box" });
        }
        let cells = self.cells.map(|count| count as usize);
        let lattice = cells.map(|count| count + 1);
        let node = |i: usize, j: usize, k: usize| (i + lattice[0] * (j + lattice[1] * k)) as u32;
        let at = |axis: usize, index: usize| {
            self.origin[axis] + self.size[axis] * (index as f64 / cells[axis] as f64)
        };
        let mut points = Vec::with_capacity(lattice.iter().product());
        for k in 0..lattice[2] {
            for j in 0..lattice[1] {
                for i in 0..lattice[0] {
                    points.push([at(0, i), at(1, j), at(2, k)]);
                }
            }
        }
        let mut volume = Vec::with_capacity(24 * cells.iter().product::<usize>());
        for k in 0..cells[2] {
            for j in 0..cells[1] {
                for i in 0..cells[0] {
                    let corner = |c: usize| node(i + (c & 1), j + ((c >> 1) & 1), k + ((c >> 2) & 1));
                    volume.extend(KUHN.iter().flatten().map(|&c| corner(c)));
                }
            }
        }
        let volume_count = volume.len() / 4;
        let mut regions =
            vec![Region { name: "box".into(), dimension: 3, elements: (0..volume_count as u32).collect() }];
        let mut facets = Vec::new();
        for (name, axis, far) in [
            ("x-min", 0, false),
            ("x-max", 0, true),
            ("y-min", 1, false),
            ("y-max", 1, true),
            ("z-min", 2, false),
            ("z-max", 2, true),
        ] {
            let first = volume_count + facets.len() / 3;
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            for b in 0..cells[v] {
                for a in 0..cells[u] {
                    let corner = |da: usize, db: usize| {
                        let mut index = [0; 3];
                        index[axis] = if far { cells[axis] } else { 0 };
                        (index[u], index[v]) = (a + da, b + db);
                        node(index[0], index[1], index[2])
                    };
                    // Kuhn's cut of a face is its diagonal from the least to the greatest corner.
                    let [p00, p10, p11, p01] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                    let triangles =
                        if far { [p00, p10, p11, p00, p11, p01] } else { [p00, p11, p10, p00, p01, p11] };
                    facets.extend(triangles);
                }
            }
            let elements = (first as u32..(volume_count + facets.len() / 3) as u32).collect();
            regions.push(Region { name: name.into(), dimension: 2, elements });
        }
        let blocks = vec![
            ElementBlock { kind, nodes: volume },
            ElementBlock { kind: ElementKind::Tri3, nodes: facets },
        ];
        Ok(Mesh { points, blocks, regions })
    }

    fn check(&self) -> Result<(), FemError> {
        for value in self.size {
            if !(value > 0.0 && value.is_finite()) {
                let requirement = "every extent of a box must be positive (m)";
                return Err(FemError::Parameter { key: "size", value, requirement });
            }
        }
        for value in self.origin {
            if !value.is_finite() {
                let requirement = "the origin of a box must be finite (m)";
                return Err(FemError::Parameter { key: "origin", value, requirement });
            }
        }
        let mut nodes: f64 = 1.0;
        for count in self.cells {
            if count == 0 {
                let requirement = "a box needs at least one cell along every axis";
                return Err(FemError::Parameter { key: "cells", value: 0.0, requirement });
            }
            nodes *= 2.0 * f64::from(count) + 1.0;
        }
        if nodes > f64::from(u32::MAX) {
            let requirement = "so many cells need more than 2³² nodes";
            return Err(FemError::Parameter { key: "cells", value: nodes, requirement });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_unit_cube_is_numbered_as_in_the_reference_case() {
        let mesh = BoxMesh { size: [1.0; 3], cells: [1; 3], element: ElementKind::Tet4, origin: [0.0; 3] }
            .build()
            .unwrap();
        assert_eq!(mesh.points[5], [1.0, 0.0, 1.0]);
        assert_eq!(mesh.blocks[0].nodes[..8], [0, 1, 3, 7, 0, 5, 1, 7]);
        mesh.check(3).unwrap();
    }

    #[test]
    fn faces_are_named_and_look_outwards() {
        let mesh = BoxMesh {
            size: [2.0, 1.0, 0.5],
            cells: [4, 3, 2],
            element: ElementKind::Tet4,
            origin: [-1.0, 0.0, 0.25],
        }
        .build()
        .unwrap();
        assert_eq!(mesh.region_nodes("x-max").unwrap().len(), 4 * 3);
        assert_eq!(mesh.region_nodes("box").unwrap().len(), 5 * 4 * 3);
        // ∮ x·n dA = 3 V over the closed surface.
        let mut flux = 0.0;
        for cell in mesh.cells_of_dimension(2) {
            let (_, nodes) = mesh.cell(cell as usize).unwrap();
            let [a, b, c] = [0, 1, 2].map(|k| mesh.points[nodes[k] as usize]);
            flux += crate::tensor::determinant(&[a, b, c]) / 2.0;
        }
        assert!((flux - 3.0).abs() < 1e-14, "{flux}");
    }
}
