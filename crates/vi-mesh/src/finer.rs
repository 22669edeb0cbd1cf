//! A mesh made from a coarser one, with the relation between their nodes.

use crate::mesh::Mesh;

/// A mesh whose nodes are weighted sums of the nodes of a coarser one. The coarse nodes come first and keep their
/// numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct FinerMesh {
    /// The finer mesh.
    pub mesh: Mesh,
    /// For each node: the coarse nodes and their weights, whose sum is 1.
    pub parents: Vec<Vec<(u32, f64)>>,
    /// For each cell: the coarse cell to which it belongs.
    pub cells: Vec<u32>,
}

impl FinerMesh {
    /// Returns values at the nodes (3 per node) from those at the coarse nodes.
    pub fn interpolate(&self, coarse: &[f64]) -> Vec<f64> {
        let value = |parents: &Vec<(u32, f64)>, i: usize| -> f64 {
            parents.iter().map(|&(node, weight)| weight * coarse[3 * node as usize + i]).sum()
        };
        self.parents.iter().flat_map(|parents| (0..3).map(move |i| value(parents, i))).collect()
    }

    /// Returns texture coordinates at the corners of every cell from those of the coarse cells. The corners of a
    /// triangle follow from the corners of the triangle to which it belongs; other cells get zero.
    pub fn texture(&self, coarse: &Mesh, corners: &[[[f64; 2]; 3]]) -> Vec<[[f64; 2]; 3]> {
        let of_cell = |(cell, &parent): (usize, &u32)| {
            let mut texture = [[0.0; 2]; 3];
            let old = coarse.cell(parent as usize).map_or(&[][..], |(_, nodes)| nodes);
            let new = self.mesh.cell(cell).map_or(&[][..], |(_, nodes)| nodes);
            for (uv, &node) in texture.iter_mut().zip(new) {
                for &(other, weight) in &self.parents[node as usize] {
                    let corner = old.iter().take(3).position(|&node| node == other);
                    if let Some(at) = corner.map(|k| corners[parent as usize][k]) {
                        (0..2).for_each(|k| uv[k] += weight * at[k]);
                    }
                }
            }
            texture
        };
        self.cells.iter().enumerate().map(of_cell).collect()
    }
}
