//! The parts of bodies that one of several processes needs. Boxes are generated part by part, so that a process never holds
//! the elements of the others. Of parted meshes it reads the pieces that it needs. Meshes of other files are read whole, and dropped
//! before anything is built but the part.

use vi_core::{State, System};
use vi_fem::LockingCure;

use super::parted::IN_PARTS;
use super::read::{Reading, Share};
use super::{assemble, parted, resolve};
use crate::scene::{Body, Fix, HeldAxis, Probe, Problem, Scene, Selection};

/// The part of a component. For every term: the numbers of its runs of elements in the whole component, and the processes that
/// compute them.
pub(crate) type ComponentPart = (System, State, Runs);

/// The runs of every term.
pub(crate) type Runs = Vec<Vec<(u32, u32)>>;

/// Returns whether the systems of a scene can be built in parts: an explicit scheme, and bodies that do not act on each other,
/// each a box or a mesh file, of one material and one kind of elements with nodes at their corners, held by regions, with nothing
/// else that acts on them but constant gravity. Whether a file has elements of one kind is known when it is read.
pub(crate) fn is_separable(scene: &Scene) -> bool {
    let acts = [
        !scene.rigids.is_empty(),
        !scene.joints.is_empty(),
        !scene.springs.is_empty(),
        !scene.attachments.is_empty(),
        !scene.seams.is_empty(),
        !scene.periodics.is_empty(),
        !scene.loads.is_empty(),
        scene.gravity_amplitude.is_some(),
        scene.wind.is_some(),
        scene.damping.is_some(),
        scene.contact.is_some(),
        scene.statics.is_some(),
        scene.solver.mass.is_some(),
    ];
    let is_explicit = scene.time.method().is_some_and(|method| method.facts().is_explicit);
    let are_plain = scene.bodies.iter().all(is_plain) && scene.fixes.iter().all(is_of_region);
    is_explicit && are_plain && !acts.contains(&true)
}

/// Returns whether the first process needs no elements of a separable scene: all bodies are boxes or parted meshes, and nothing names
/// volumes or elements.
pub(crate) fn needs_no_elements(scene: &Scene) -> bool {
    let volumes: Option<Vec<_>> = scene.bodies.iter().map(volumes).collect();
    let Some(volumes) = volumes.map(|volumes| volumes.concat()) else { return false };
    let names_volume = |on: &Selection| on.region.as_ref().is_some_and(|name| volumes.contains(name));
    let are_of_nodes = scene.probes.iter().all(Probe::is_node);
    let on_nodes = !scene.fixes.iter().any(|fix| names_volume(&fix.on))
        && !scene.strikes.iter().any(|strike| names_volume(&strike.on));
    let is_smoothed =
        scene.output.fields.iter().filter_map(|field| field.of_elements()).any(|(_, nodal)| nodal);
    are_of_nodes && on_nodes && !is_smoothed && scene.output.cache.is_none()
}

/// Returns the names of the regions of volumes of a body whose elements a process can do without.
fn volumes(body: &Body) -> Option<Vec<String>> {
    if body.box_shape.is_some() {
        return Some(vec!["box".to_owned()]);
    }
    let parted = parted::open(body)?.ok()?;
    let solids = parted.pieces().regions.iter().filter(|(_, dimension)| *dimension == 3);
    Some(solids.map(|(name, _)| name.clone()).collect())
}

/// Returns those problems that concern the files of parted meshes. No other process could read them either.
pub(crate) fn of_parted_meshes(scene: &Scene, problems: Vec<Problem>) -> Vec<Problem> {
    let is_parted = |body: &Body| parted::open(body).is_some_and(|opened| opened.is_ok());
    let parted = scene.bodies.iter().enumerate().filter(|(_, body)| is_parted(body));
    let keys: Vec<String> = parted.map(|(number, _)| format!("body[{number}].mesh")).collect();
    problems.into_iter().filter(|problem| keys.contains(&problem.key)).collect()
}

fn is_plain(body: &Body) -> bool {
    let has_kind = match &body.box_shape {
        Some(shape) => IN_PARTS.contains(&shape.element),
        None => body.mesh.is_some() && body.dimension() == 3,
    };
    let has_one_material = matches!(&body.material.0[..], [entry] if entry.region.is_none());
    let is_as_generated = body.order.is_none() && body.refine.is_none() && body.locking == LockingCure::None;
    has_kind && has_one_material && is_as_generated
}

fn is_of_region(fix: &Fix) -> bool {
    let on = Selection { region: fix.on.region.clone(), ..Selection::default() };
    let has_axes = fix.axes.iter().all(|axis| matches!(axis, HeldAxis::Space(_)));
    fix.on.region.is_some() && fix.on == on && has_axes && fix.motion.is_none() && !fix.symmetry
}

/// Builds the part of every component that a process needs. The scene must be separable ([`is_separable`]), and have been built
/// as a whole without problems by another process. Velocities are left out.
///
/// # Errors
/// Returns the problems of the systems.
pub(crate) fn build_parts(scene: &Scene, share: Share) -> Result<Vec<ComponentPart>, Vec<Problem>> {
    let mut scene = scene.clone();
    scene.probes.clear();
    scene.strikes.clear();
    for body in &mut scene.bodies {
        (body.velocity, body.angular_velocity) = (None, None);
    }
    let resolved = resolve::resolve(&scene, Reading::Part(share))?;
    let runs: Vec<Vec<(u32, u32)>> = resolved.bodies.iter().map(|body| body.runs()).collect();
    let model = assemble::assemble(&scene, resolved, true)?;
    // Every body is a component. Its first term is its strain energy, the other one gravity.
    let parts = model.components.into_iter().zip(runs);
    Ok(parts.map(|((system, state), runs)| (system, state, vec![runs])).collect())
}
