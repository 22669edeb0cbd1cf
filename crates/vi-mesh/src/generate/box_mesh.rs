//! Boxes of solid cells.

use super::box_cells::{LatticePoint, elements, facets};
use crate::cell::CellKind;
use crate::error::MeshError;
use crate::mesh::{CellBlock, Mesh, Region};

/// A box of cells: `box = { size = [1.0, 0.25, 0.25], cells = [16, 4, 4], element = "tet4" }`.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct BoxMesh {
    /// Extents along x, y, z, m; positive.
    pub size: [f64; 3],
    /// Cells along x, y, z; at least 1 each.
    #[cfg_attr(feature = "serde", schemars(inner(range(min = 1))))]
    pub cells: [u32; 3],
    /// The kind of element. A cell is one hexahedron, 2 wedges or 6 tetrahedra. A mesh that is no body may also have 6 pyramids
    /// per cell.
    #[cfg_attr(
        feature = "serde",
        serde(default = "default_element"),
        schemars(schema_with = "element_schema")
    )]
    pub element: CellKind,
    /// The corner of smallest coordinates, m.
    #[cfg_attr(feature = "serde", serde(default))]
    pub origin: [f64; 3],
}

#[cfg(feature = "serde")]
fn default_element() -> CellKind {
    CellKind::Tet4
}

/// Returns the schema of the kinds of cells of which a box can consist.
#[cfg(feature = "serde")]
fn element_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
    let names: Vec<&str> = BoxMesh::elements().map(CellKind::name).collect();
    schemars::json_schema!({ "type": "string", "enum": names })
}

/// The faces of a box: name, the axis that is normal to it, and whether it is the far one.
pub(super) const FACES: [(&str, usize, bool); 6] = [
    ("x-min", 0, false),
    ("x-max", 0, true),
    ("y-min", 1, false),
    ("y-max", 1, true),
    ("z-min", 2, false),
    ("z-max", 2, true),
];

/// The lattice of half cells of a box, and the node numbers of its points.
struct Lattice {
    /// Number of points along each axis, 2 · cells + 1.
    counts: [usize; 3],
    numbers: Vec<u32>,
}

impl Lattice {
    fn index(&self, cell: [usize; 3], point: LatticePoint) -> usize {
        let [i, j, k] = [0, 1, 2].map(|axis| 2 * cell[axis] + point[axis]);
        i + self.counts[0] * (j + self.counts[1] * k)
    }
}

/// Returns all cells (i, j, k) with i fastest; `held` = (axis, index) restricts them to one layer.
pub(super) fn cells_of(counts: [usize; 3], held: Option<(usize, usize)>) -> impl Iterator<Item = [usize; 3]> {
    let range = move |axis: usize| match held {
        Some((held_axis, index)) if held_axis == axis => index..index + 1,
        _ => 0..counts[axis],
    };
    range(2).flat_map(move |k| range(1).flat_map(move |j| range(0).map(move |i| [i, j, k])))
}

impl BoxMesh {
    /// Returns the kinds of cells of which a box can consist.
    pub fn elements() -> impl Iterator<Item = CellKind> {
        CellKind::ALL.iter().copied().filter(|&kind| elements(kind).is_some())
    }

    /// Returns the number of elements of the box; 0 for a kind of which a box cannot consist.
    pub fn element_count(&self) -> f64 {
        let in_cell = elements(self.element).map_or(0, |elements| elements.len());
        in_cell as f64 * self.cells.map(f64::from).iter().product::<f64>()
    }

    /// Builds the mesh. Nodes are in lattice order with i fastest (for elements without middle nodes, node = i + j nx
    /// + k nx ny). The volume region is `box`; the surface regions are `x-min x-max y-min y-max z-min z-max`.
    ///
    /// # Errors
    /// Returns [`MeshError::Parameter`] for a size that is not positive or for no cells; [`MeshError::Unsupported`] for
    /// a kind of which a box cannot consist.
    pub fn build(&self) -> Result<Mesh, MeshError> {
        self.check()?;
        let kind = self.element;
        let Some(elements) = elements(kind) else {
            return Err(MeshError::Unsupported { kind, used: "elements of a box" });
        };
        let counts = self.cells.map(|count| count as usize);
        let mut lattice = Lattice { counts: counts.map(|count| 2 * count + 1), numbers: Vec::new() };
        let points = self.number_nodes(&mut lattice, &elements);
        let number = |cell, point: &LatticePoint| lattice.numbers[lattice.index(cell, *point)];

        let in_cell = |cell| elements.iter().flatten().map(move |point| number(cell, point));
        let per_cell: usize = elements.iter().map(Vec::len).sum();
        let mut nodes: Vec<u32> = Vec::with_capacity(counts.iter().product::<usize>() * per_cell);
        nodes.extend(cells_of(counts, None).flat_map(in_cell));
        let mut cell_count = nodes.len() / kind.node_count();
        let all = (0..cell_count as u32).collect();
        let mut regions = vec![Region { name: "box".into(), dimension: 3, cells: all }];
        let mut blocks = vec![CellBlock { kind, nodes }];
        for (name, axis, far) in FACES {
            let (facet_kind, facets) = facets(kind, &elements, axis, far);
            let held = Some((axis, if far { counts[axis] - 1 } else { 0 }));
            let on_face = |cell| facets.iter().flatten().map(move |point| number(cell, point));
            let nodes: Vec<u32> = cells_of(counts, held).flat_map(on_face).collect();
            let next = cell_count + nodes.len() / facet_kind.node_count();
            let cells = (cell_count as u32..next as u32).collect();
            regions.push(Region { name: name.into(), dimension: 2, cells });
            cell_count = next;
            match blocks.last_mut() {
                Some(block) if block.kind == facet_kind => block.nodes.extend(nodes),
                _ => blocks.push(CellBlock { kind: facet_kind, nodes }),
            }
        }
        Ok(Mesh { points, blocks, regions })
    }

    /// Numbers the lattice points that elements use, in lattice order; returns their positions.
    fn number_nodes(&self, lattice: &mut Lattice, elements: &[Vec<LatticePoint>]) -> Vec<[f64; 3]> {
        let counts = self.cells.map(|count| count as usize);
        let mut used = vec![false; lattice.counts.iter().product()];
        for cell in cells_of(counts, None) {
            for &point in elements.iter().flatten() {
                used[lattice.index(cell, point)] = true;
            }
        }
        let mut points = Vec::new();
        lattice.numbers = vec![u32::MAX; used.len()];
        for (index, _) in used.iter().enumerate().filter(|(_, used)| **used) {
            lattice.numbers[index] = points.len() as u32;
            let [nx, ny, _] = lattice.counts;
            let at = [index % nx, index / nx % ny, index / (nx * ny)];
            points.push([0, 1, 2].map(|axis| self.place(axis, at[axis])));
        }
        points
    }

    /// Returns a coordinate of the points of the lattice whose index along an axis is `index`, m.
    pub(super) fn place(&self, axis: usize, index: usize) -> f64 {
        self.origin[axis] + self.size[axis] * (index as f64 / f64::from(2 * self.cells[axis]))
    }

    pub(super) fn check(&self) -> Result<(), MeshError> {
        for value in self.size {
            if !(value > 0.0 && value.is_finite()) {
                let requirement = "every size of a box must be positive (m)";
                return Err(MeshError::Parameter { key: "size", value, requirement });
            }
        }
        for value in self.origin {
            if !value.is_finite() {
                let requirement = "the origin of a box must be finite (m)";
                return Err(MeshError::Parameter { key: "origin", value, requirement });
            }
        }
        let mut nodes: f64 = 1.0;
        for count in self.cells {
            if count == 0 {
                let requirement = "a box needs at least one cell along every axis";
                return Err(MeshError::Parameter { key: "cells", value: 0.0, requirement });
            }
            nodes *= 2.0 * f64::from(count) + 1.0;
        }
        if nodes > f64::from(u32::MAX) {
            let requirement = "so many cells need more than 2³² nodes: use fewer";
            return Err(MeshError::Parameter { key: "cells", value: nodes, requirement });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::facet::Surface;

    #[test]
    fn the_unit_cube_is_numbered_as_in_the_reference_case() {
        let mesh = BoxMesh { size: [1.0; 3], cells: [1; 3], element: CellKind::Tet4, origin: [0.0; 3] }
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
            element: CellKind::Tet4,
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
            flux += crate::vector::determinant([a, b, c]) / 2.0;
        }
        assert!((flux - 3.0).abs() < 1e-14, "{flux}");
    }

    #[test]
    fn boxes_of_all_elements_are_sound_and_share_their_middle_nodes() {
        for element in BoxMesh::elements() {
            let size = [1.0, 2.0, 0.5];
            let shape = BoxMesh { size, cells: [2, 3, 1], element, origin: [0.0; 3] };
            let mesh = shape.build().unwrap();
            mesh.check(3).unwrap();
            assert!(mesh.region_nodes("z-max").unwrap().len() >= 12, "{element}");
            if [CellKind::Tet4, CellKind::Hex8, CellKind::Wedge6].contains(&element) {
                assert_eq!(mesh.points.len(), 3 * 4 * 2);
            }
            if element == CellKind::Hex27 || element == CellKind::Tet10 {
                assert_eq!(mesh.points.len(), 5 * 7 * 3);
            }
            let solids = mesh.cells_of_dimension(3);
            assert_eq!(solids.len() as f64, shape.element_count());
            let volumes: Vec<f64> = solids.iter().map(|&cell| mesh.volume(cell as usize).unwrap()).collect();
            assert!(volumes.iter().all(|&volume| volume > 0.0), "{element}");
            assert!((volumes.iter().sum::<f64>() - 1.0).abs() < 1e-13, "{element}");
            // The named faces are those that belong to one element only.
            let boundary = Surface::of_body(&mesh, 3).unwrap();
            let named = |name| Surface::of_region(&mesh, name).unwrap().blocks()[0].facets().count();
            let count: usize = FACES.iter().map(|(name, ..)| named(name)).sum();
            assert_eq!(boundary.blocks().iter().map(|block| block.facets().count()).sum::<usize>(), count);
        }
    }
}
