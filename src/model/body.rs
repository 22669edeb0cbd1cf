//! Bodies of a scene with their meshes, and sets of their nodes.

use std::sync::Arc;

use vi_fem::{Law, LockingCure};
use vi_mesh::{FarElements, Mesh, Numbering};

use crate::scene::{BodyId, Substance};

/// Nodes of the mesh of one body.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodeSet {
    /// Number of the body.
    pub body: BodyId,
    /// Numbers of nodes of its mesh.
    pub nodes: Vec<u32>,
}

/// A node that stands for a point of a scene, such as a probe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProbeTarget {
    /// Number of the body.
    pub body: BodyId,
    /// Number of a node of its mesh.
    pub node: usize,
}

/// The elements of a body that have one material.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialPart {
    /// The region that the scene names; `None` for all elements that no other material names.
    pub region: Option<String>,
    /// The law and its parameters.
    pub law: Substance,
    /// Numbers of cells of the body's mesh.
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
    /// Treatment of locking near incompressibility, for solids.
    pub locking: LockingCure,
    /// Texture coordinates of a sheet at the corners of every cell of its mesh.
    pub texture: Option<Vec<[[f64; 2]; 3]>>,
    /// Materials, in the order of the scene.
    pub materials: Vec<MaterialPart>,
    /// Number of the component to which the body belongs.
    pub component: usize,
    /// Number of the body's first node in the component.
    pub node_offset: usize,
    /// Numbers of the body's nodes in the component, relative to the first.
    pub numbering: Arc<Numbering>,
    /// The elements, if this process does not hold them. The mesh is then without them, and the body has one material.
    pub(crate) far: Option<Arc<dyn FarElements>>,
    /// The flat pattern of a sheet, m: the corners of every cell.
    pub(crate) pattern: Option<Vec<[[f64; 2]; 3]>>,
}

impl BodyModel {
    /// Returns the number in the component of a node of the mesh.
    pub fn node(&self, node: usize) -> usize {
        self.node_offset + self.numbering.of(node as u32) as usize
    }

    /// Iterates over the elements, material by material. They are cells of the mesh, unless other processes hold them.
    pub fn elements(&self) -> impl Iterator<Item = u32> {
        let far = 0..self.far.as_ref().map_or(0, |far| far.count() as u32);
        far.chain(self.materials.iter().flat_map(|part| part.elements.iter().copied()))
    }

    /// Returns the nodes of an element.
    pub(crate) fn nodes_of(&self, element: u32) -> Vec<u32> {
        let mut nodes = Vec::new();
        match &self.far {
            Some(far) => far.add_nodes(element..element + 1, &mut nodes),
            None => nodes.extend(self.mesh.cell(element as usize).into_iter().flat_map(|(_, nodes)| nodes)),
        }
        nodes
    }

    /// Iterates over its solid materials: the elements and the law of each.
    pub fn solids(&self) -> impl Iterator<Item = (&[u32], &Law)> {
        self.materials.iter().filter_map(|part| match &part.law {
            Substance::Solid(law) => Some((part.elements.as_slice(), law)),
            Substance::Sheet(_) => None,
        })
    }

    /// Returns the number of an element among all cells of its mesh.
    pub(crate) fn cell(&self, element: u32) -> u32 {
        self.far.as_ref().map_or(element, |far| far.cell(element))
    }

    /// Returns why elements that this process does not hold could not be read.
    pub(crate) fn far_fault(&self) -> Option<String> {
        self.far.as_ref()?.fault()
    }

    /// Returns the number of its elements.
    pub fn element_count(&self) -> usize {
        let of_materials = || self.materials.iter().map(|part| part.elements.len()).sum();
        self.far.as_ref().map_or_else(of_materials, |far| far.count())
    }
}
