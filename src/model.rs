//! From a scene to Lagrangian systems: meshes are read, masses and potentials made, coordinates
//! prescribed, and bodies that act on each other joined. It must not know how time is stepped.

mod assemble;
mod control;
mod directions;
mod initial;
mod load;
mod loads;
mod mass;
mod periodic;
mod prescribe;
mod regions;
mod rigid;
mod select;
mod shape;
mod sheets;
mod size;
mod ties;

use vi_core::{State, System};
use vi_fem::{Mesh, Numbering};

pub(crate) use control::path_control;
pub(crate) use mass::kinetic_terms;
pub use regions::RegionProbe;
pub use rigid::{Pose, RigidModel};
pub(crate) use shape::surface;

use crate::scene::{Problem, Scene};

/// A body of a scene with its mesh.
#[derive(Debug)]
pub struct BodyModel {
    /// Its name.
    pub name: String,
    /// Its mesh at rest.
    pub mesh: Mesh,
    /// Texture coordinates of a sheet: the corners of every cell of its mesh.
    pub texture: Option<Vec<[[f64; 2]; 3]>>,
    /// The elements of each of its material entries.
    pub materials: Vec<Vec<u32>>,
    /// Number of the component that it is part of.
    pub component: usize,
    /// Its first node among the nodes of the component.
    pub node_offset: usize,
    /// How the component numbers its nodes, from there on.
    pub numbering: Numbering,
    /// The flat pattern that a sheet is cut from, m: the corners of every cell.
    pub(crate) pattern: Option<Vec<[[f64; 2]; 3]>>,
}

impl BodyModel {
    /// Number among the nodes of the component of a node of the mesh.
    pub fn node(&self, node: usize) -> usize {
        self.node_offset + self.numbering.of(node as u32) as usize
    }

    /// Number of its elements.
    pub fn element_count(&self) -> usize {
        self.materials.iter().map(Vec::len).sum()
    }
}

/// A probe with its node found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ProbeTarget {
    /// Number of the body.
    pub body: usize,
    /// Node of the body's mesh.
    pub node: usize,
}

/// A scene as systems.
pub(crate) struct Model {
    pub(crate) bodies: Vec<BodyModel>,
    pub(crate) rigids: Vec<RigidModel>,
    pub(crate) probes: Vec<ProbeTarget>,
    /// For each fix: number of the body and nodes of its mesh.
    pub(crate) fixes: Vec<(usize, Vec<u32>)>,
    pub(crate) region_probes: Vec<RegionProbe>,
    pub(crate) components: Vec<(System, State)>,
    pub(crate) notes: Vec<String>,
}

impl Model {
    /// Reads all meshes and builds all systems.
    pub(crate) fn build(scene: &Scene) -> Result<Self, Vec<Problem>> {
        let (loaded, problems) = load::load(scene);
        if !problems.is_empty() {
            return Err(problems);
        }
        assemble::assemble(scene, loaded)
    }
}

/// Everything that is wrong with the meshes of a scene and what refers to them.
#[cfg(feature = "cli")]
pub(crate) fn mesh_problems(scene: &Scene) -> Vec<Problem> {
    load::load(scene).1
}
