//! Builds meshes from arrays of points and node numbers.

use crate::check::volume_of_round_off;
use crate::error::MeshError;
use crate::mesh::{CellBlock, Mesh, Region};
use crate::volume::Volumes;

/// Number of inverted cells that an error lists.
const NAMED: usize = 5;

impl Mesh {
    /// Returns a mesh of these points (m) and cells, without regions. The nodes of a cell are in VTK's order
    /// ([`CellKind`](crate::CellKind)); cells are numbered consecutively through all blocks.
    ///
    /// # Errors
    /// Returns every problem found: node lists whose length is not a whole number of cells, node numbers out of range,
    /// coordinates that are not finite, and volume cells that are mirrored or have no volume.
    ///
    /// # Examples
    /// ```
    /// use vi_mesh::{CellBlock, CellKind, Mesh, MeshError};
    ///
    /// let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    /// let cells = |kind, nodes: &[u32]| CellBlock { kind, nodes: nodes.to_vec() };
    /// let blocks = vec![cells(CellKind::Tet4, &[0, 1, 2, 3]), cells(CellKind::Tri3, &[0, 2, 1])];
    /// let mesh = Mesh::from_arrays(points.clone(), blocks).unwrap().with_region("floor", &[1]).unwrap();
    /// assert_eq!(mesh.region_nodes("floor").unwrap(), [0, 1, 2]);
    ///
    /// let mirrored = Mesh::from_arrays(points, vec![cells(CellKind::Tet4, &[0, 2, 1, 3])]);
    /// assert!(matches!(mirrored.unwrap_err()[..], [MeshError::Inverted { count: 1, .. }]));
    /// ```
    pub fn from_arrays(points: Vec<[f64; 3]>, blocks: Vec<CellBlock>) -> Result<Self, Vec<MeshError>> {
        let mesh = Self { points, blocks, regions: Vec::new() };
        let mut problems = mesh.index_problems();
        problems.extend(mesh.coordinate_problems());
        if problems.is_empty() {
            problems.extend(mesh.mirrored_cells());
        }
        if problems.is_empty() { Ok(mesh) } else { Err(problems) }
    }

    /// Returns the mesh with one more region of these cells, which must have the same dimension. A volume region can
    /// have its own material; a surface, curve or point region is a part of the boundary.
    ///
    /// # Errors
    /// Returns [`MeshError::Invalid`] without cells or for cells of several dimensions; [`MeshError::OutOfRange`] for a
    /// cell that does not exist.
    pub fn with_region(mut self, name: impl Into<String>, cells: &[u32]) -> Result<Self, MeshError> {
        let name = name.into();
        let mut dimensions = Vec::with_capacity(cells.len());
        for &cell in cells {
            dimensions.push(self.element(cell, "region, cell")?.0.dimension());
        }
        dimensions.dedup();
        let &[dimension] = &dimensions[..] else {
            let problem = match dimensions[..] {
                [] => format!("'{name}' has no cells: name at least one"),
                _ => format!("'{name}' has cells of several dimensions: make one region for each dimension"),
            };
            return Err(MeshError::Invalid { what: "region", problem });
        };
        let mut cells = cells.to_vec();
        cells.sort_unstable();
        cells.dedup();
        self.regions.push(Region { name, dimension, cells });
        Ok(self)
    }

    fn mirrored_cells(&self) -> Option<MeshError> {
        let mut volumes = Volumes::default();
        let (mut count, mut total, mut first) = (0, 0, Vec::new());
        let mut x = Vec::new();
        for (cell, (kind, nodes)) in self.cells().enumerate().filter(|(_, (kind, _))| kind.dimension() == 3) {
            x.clear();
            x.extend(nodes.iter().map(|&node| self.points[node as usize]));
            total += 1;
            let volume = volumes.of(kind, &x);
            if volume <= volume_of_round_off(x.iter().copied()) {
                count += 1;
                if first.len() < NAMED {
                    first.push((cell, volume));
                }
            }
        }
        (count > 0).then_some(MeshError::Inverted { count, total, first })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::CellKind;

    fn block(kind: CellKind, nodes: impl IntoIterator<Item = u32>) -> CellBlock {
        CellBlock { kind, nodes: nodes.into_iter().collect() }
    }

    #[test]
    fn every_solid_kind_is_taken_and_its_mirror_image_refused() {
        for &kind in CellKind::ALL.iter().filter(|kind| kind.dimension() == 3) {
            let points = kind.reference_nodes().to_vec();
            let nodes = || vec![block(kind, 0..points.len() as u32)];
            Mesh::from_arrays(points.clone(), nodes()).unwrap();
            let mirrored = points.iter().map(|x| [-x[0], x[1], x[2]]).collect();
            let problems = Mesh::from_arrays(mirrored, nodes()).unwrap_err();
            assert!(matches!(problems[..], [MeshError::Inverted { count: 1, total: 1, .. }]), "{kind}");
            let flat = points.iter().map(|x| [x[0], x[1], 1e9]).collect();
            assert!(Mesh::from_arrays(flat, nodes()).is_err(), "{kind}");
        }
    }

    #[test]
    fn problems_are_named_at_once() {
        let points = vec![[0.0; 3], [1.0, f64::NAN, 0.0], [0.0, 1.0, 0.0]];
        let blocks = vec![block(CellKind::Tri3, [0, 1, 2, 0]), block(CellKind::Line2, [0, 7])];
        let problems: Vec<String> =
            Mesh::from_arrays(points, blocks).unwrap_err().iter().map(ToString::to_string).collect();
        assert_eq!(problems.len(), 3, "{problems:?}");
        assert!(problems[0].contains("block 0 of tri3 cells: 4 node numbers are not a multiple of 3"));
        assert!(problems[1].contains("element 1: node 7 is out of range (there are 3)"));
        assert!(problems[2].contains("not a finite number (first: [1])"));
    }

    #[test]
    fn a_region_has_cells_of_one_dimension() {
        let points = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let blocks = vec![block(CellKind::Tri3, 0..3), block(CellKind::Line2, [0, 1])];
        let mesh = Mesh::from_arrays(points, blocks).unwrap();
        let message = |cells: &[u32]| mesh.clone().with_region("side", cells).unwrap_err().to_string();
        assert!(message(&[0, 1]).contains("several dimensions"));
        assert!(message(&[]).contains("no cells"));
        assert!(message(&[2]).contains("cell 2 is out of range"));
        let region = mesh.with_region("side", &[1, 1]).unwrap().regions[0].clone();
        assert_eq!((region.dimension, region.cells), (1, vec![1]));
    }
}
