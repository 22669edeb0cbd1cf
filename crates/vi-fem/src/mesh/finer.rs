//! A mesh made from a coarser one, and how its nodes follow from the coarse ones. It must not know why.

use super::Mesh;

/// A mesh whose nodes are sums of the nodes of a coarser one; the coarse nodes come first and keep
/// their numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct FinerMesh {
    /// The mesh.
    pub mesh: Mesh,
    /// For each node: coarse nodes and their weights, whose sum is 1.
    pub parents: Vec<Vec<(u32, f64)>>,
    /// For each cell: the coarse cell that it is part of.
    pub cells: Vec<u32>,
}

impl FinerMesh {
    /// Values at the nodes (3 a node) from those at the coarse nodes.
    pub fn interpolate(&self, coarse: &[f64]) -> Vec<f64> {
        let value = |parents: &Vec<(u32, f64)>, i: usize| -> f64 {
            parents.iter().map(|&(node, weight)| weight * coarse[3 * node as usize + i]).sum()
        };
        self.parents.iter().flat_map(|parents| (0..3).map(move |i| value(parents, i))).collect()
    }
}
