//! Makes Lagrangian systems from a scene. `resolve.rs` reads the meshes and finds what the scene names. `assemble.rs`
//! makes masses, terms and initial states of the components, each of which holds bodies that act on each other.

mod assemble;
mod body;
mod component;
mod contact;
mod control;
mod cuts;
mod directions;
mod extent;
mod import;
mod initial;
mod loads;
mod mass;
mod matter;
mod meeting;
mod naming;
mod outline;
pub(crate) mod parted;
mod parting;
mod partition;
pub(crate) mod parts;
mod periodic;
#[cfg(any(feature = "cli", test))]
pub(crate) mod pieces;
mod prescribe;
mod read;
mod regions;
mod resolve;
mod rigid;
mod rigid_mesh;
mod select;
mod shape;
mod sheets;
mod shells;
mod size;
mod spacing;
mod strikes;
mod ties;

pub(crate) use assemble::Model;
pub use body::{BodyModel, MaterialPart, NodeSet, ProbeTarget};
pub(crate) use contact::ContactModel;
pub(crate) use control::path_control;
pub(crate) use mass::kinetic_terms;
pub(crate) use meeting::{Meeting, name_of};
pub(crate) use naming::part_in_words;
pub(crate) use outline::Outline;
pub(crate) use parting::Parted;
use read::Reading;
pub(crate) use read::Share;
pub use regions::RegionProbe;
pub use rigid::{Pose, RigidModel};

#[cfg(feature = "cli")]
use crate::scene::Parsed;
use crate::scene::{Problem, Scene};

/// The data of the bodies that a process holds in memory.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Holding {
    /// Everything.
    Whole,
    /// Everything but the shapes of elements, because it evaluates only portions of the terms.
    Portions,
    /// Everything but elements ([`parts::needs_no_elements`]).
    Nodes,
}

/// Reads all meshes of a scene and builds all systems.
///
/// # Errors
/// Returns all problems of the meshes and of the names that refer to them; if there are none, all problems of the
/// systems.
pub(crate) fn build(scene: &Scene, holding: Holding) -> Result<Model, Vec<Problem>> {
    let reading = if holding == Holding::Nodes { Reading::Nodes } else { Reading::Whole };
    assemble::assemble(scene, resolve::resolve(scene, reading)?, holding != Holding::Whole)
}

/// Returns all problems of a scene that could not be parsed without problems: those of its text, and those of its
/// meshes and of the names that refer to them, in the order of lines. Returns none if the text has none.
#[cfg(feature = "cli")]
pub fn all_problems(parsed: &Parsed) -> Vec<Problem> {
    let mut problems = parsed.problems.clone();
    if let Some(scene) = parsed.scene.as_ref().filter(|_| !problems.is_empty()) {
        let found = parsed.relevant(resolve::resolve(scene, Reading::Whole).err().unwrap_or_default());
        // If the text already has a problem at this key, the name that it contains cannot be resolved: do not report it
        // twice.
        let is_new = |problem: &Problem| !parsed.problems.iter().any(|known| known.key == problem.key);
        problems.extend(found.into_iter().filter(is_new));
    }
    problems.sort_by_key(|problem| problem.line);
    problems
}
