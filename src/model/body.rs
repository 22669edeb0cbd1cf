//! Bodies of a scene with their meshes, and nodes of them.

use vi_fem::{Law, LockingCure};
use vi_mesh::{Mesh, Numbering};

use crate::scene::{BodyId, Substance};

/// Nodes of the mesh of one body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodeSet {
    /// The body.
    pub body: BodyId,
    /// Nodes of its mesh.
    pub nodes: Vec<u32>,
}

/// A probe at a node, or another point of a scene that is a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProbeTarget {
    /// The body.
    pub body: BodyId,
    /// Node of its mesh.
    pub node: usize,
}

/// The elements of a body that are of one material.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialPart {
    /// The region that the scene names; none for all elements that no other material names.
    pub region: Option<String>,
    /// The law and its parameters.
    pub law: Substance,
    /// Cells of the body's mesh.
    pub elements: Vec<u32>,
}

/// A body of a scene with its mesh.
#[derive(Debug)]
pub struct BodyModel {
    /// Number of the body.
    pub id: BodyId,
    /// Name of the body.
    pub name: String,
    /// Mesh at rest.
    pub mesh: Mesh,
    /// Dimension of its elements: 3 for a solid, 2 for a sheet.
    pub dimension: usize,
    /// Cure of a solid's locking near incompressibility.
    pub locking: LockingCure,
    /// Texture coordinates of a sheet: the corners of every cell of its mesh.
    pub texture: Option<Vec<[[f64; 2]; 3]>>,
    /// Materials, in the order of the scene.
    pub materials: Vec<MaterialPart>,
    /// Number of the component that it is part of.
    pub component: usize,
    /// First node of the body among the nodes of the component.
    pub node_offset: usize,
    /// Numbers of the body's nodes in the component, relative to the first.
    pub numbering: Numbering,
    /// The flat pattern that a sheet is cut from, m: the corners of every cell.
    pub(crate) pattern: Option<Vec<[[f64; 2]; 3]>>,
}

impl BodyModel {
    /// Number among the nodes of the component of a node of the mesh.
    pub fn node(&self, node: usize) -> usize {
        self.node_offset + self.numbering.of(node as u32) as usize
    }

    /// Elements, material by material.
    pub fn elements(&self) -> impl Iterator<Item = u32> {
        self.materials.iter().flat_map(|part| part.elements.iter().copied())
    }

    /// The elements of each of its solid materials, with the law.
    pub fn solids(&self) -> impl Iterator<Item = (&[u32], &Law)> {
        self.materials.iter().filter_map(|part| match &part.law {
            Substance::Solid(law) => Some((part.elements.as_slice(), law)),
            Substance::Sheet(_) => None,
        })
    }

    /// Number of its elements.
    pub fn element_count(&self) -> usize {
        self.materials.iter().map(|part| part.elements.len()).sum()
    }
}
