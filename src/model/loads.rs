//! Makes potentials and forces from the loads and the damping of a scene.

use std::collections::HashSet;
use std::sync::Arc;

use vi_core::{Force, Potential};
use vi_fem::{
    ConsistentMassDamping, DeadLoad, FemError, MassDamping, Pressure, Resultant, Sheet, Viscosity,
    kelvin_voigt, pressure,
};
use vi_mesh::{Mesh, MeshError, Surface};

use super::body::{BodyModel, MaterialPart};
use super::import::Imported;
use super::resolve::ResolvedFix;
use super::select;
use crate::scene::{Damping, HeldAxis, Load, Selection, Substance, field};

/// The terms that a load or damping adds to a component.
#[derive(Default)]
pub(super) struct Added {
    pub(super) potentials: Vec<Box<dyn Potential>>,
    pub(super) forces: Vec<Arc<dyn Force>>,
}

/// The body that a load acts on.
pub(super) struct Target<'a> {
    pub(super) body: &'a BodyModel,
    /// The mesh in the numbering of the component.
    pub(super) read: &'a Imported,
    /// The fixes of the scene.
    pub(super) fixes: &'a [ResolvedFix<'a>],
}

impl Target<'_> {
    /// Returns the selected surface, in the numbering of the component.
    fn surface(&self, on: &Selection) -> Result<Surface, Problem> {
        let surface = select::surface(&self.body.mesh, self.body.dimension, on)?;
        Ok(surface.renumbered(|node| self.body.numbering.of(node)))
    }
}

/// The key at fault and the message of a problem.
type Problem = (&'static str, String);

/// Returns the terms of load number `index` of the scene.
///
/// # Errors
/// Returns a problem with the key at fault.
pub(super) fn load(load: &Load, index: usize, target: &Target) -> Result<Added, Problem> {
    let (body, mesh) = (target.body, &target.read.mesh);
    let offset = body.node_offset;
    let text = |error: vi_fem::FemError| ("", error.to_string());
    let mut added = Added::default();
    match load {
        Load::Traction { on, traction, amplitude, .. } => {
            let name = format!("load[{index}]: traction");
            let surface = target.surface(on)?;
            let traction = field(traction).map_err(text)?;
            let term = DeadLoad::traction(mesh, &surface, &traction, amplitude.clone(), offset, &name);
            added.potentials.push(Box::new(term.map_err(text)?));
        }
        Load::Force { on, force, moment, about, amplitude, .. } => {
            let name = format!("load[{index}]: force");
            // Selects in the numbering of the file, which the load refers to.
            let spread = select::spread(&body.mesh, target.body.dimension, on)?;
            let spread = spread.renumbered(|node| body.numbering.of(node));
            let resultant = Resultant { force: *force, moment: *moment, about: *about };
            let term = DeadLoad::resultant_on(mesh, &spread, &resultant, amplitude.clone(), offset, &name);
            added.potentials.push(Box::new(term.map_err(|error| ("moment", error.to_string()))?));
        }
        Load::Pressure { on, pressure: value, amplitude, .. } => {
            let name = format!("load[{index}]: pressure");
            let surface = target.surface(on)?;
            // With moving prescribed nodes the pressure has no potential.
            let mut fixed = vec![[false; 3]; mesh.points.len()];
            let of_body = target.fixes.iter().filter(|held| held.on.body == body.id);
            for held in of_body.filter(|held| held.fix.motion.is_none()) {
                for &node in &held.on.nodes {
                    for axis in &held.fix.axes {
                        if let HeldAxis::Space(axis) = axis {
                            fixed[body.numbering.of(node) as usize][*axis as usize] = true;
                        }
                    }
                }
            }
            let is_fixed = |node: u32| fixed[node as usize];
            match pressure(mesh, &surface, *value, amplitude, is_fixed, offset, &name) {
                Pressure::Potential(terms) => added.potentials.extend(terms),
                Pressure::Force(forces) => added.forces.extend(forces),
            }
        }
        Load::Point { point, node, force, amplitude, .. } => {
            let name = format!("load[{index}]: point");
            let nearest = || point.and_then(|point| body.mesh.nearest_node(point));
            let node = node
                .map(|node| node as u32)
                .or_else(nearest)
                .ok_or(("", "the body has no nodes".to_owned()))?;
            let node = body.numbering.of(node);
            let term = DeadLoad::points(mesh, &[(node, *force)], amplitude.clone(), offset, &name);
            added.potentials.push(Box::new(term.map_err(text)?));
        }
        Load::BodyForce { region, force, amplitude, .. } => {
            let name = format!("load[{index}]: body force");
            let elements = match region {
                Some(region) => mesh.region(region).map_err(|error| ("", error.to_string()))?.cells.clone(),
                None => body.elements().collect(),
            };
            let field = field(force).map_err(|error| ("force", error.to_string()))?;
            let amplitude = amplitude.clone();
            let term = if target.body.dimension == 3 {
                DeadLoad::body_force(mesh, &elements, &field, amplitude, offset, &name)
            } else {
                let volumes = sheet_volumes(target, &elements).map_err(text)?;
                DeadLoad::body_force_on_sheet(mesh, &volumes, &field, amplitude, offset, &name)
            };
            added.potentials.push(Box::new(term.map_err(|error| ("region", error.to_string()))?));
        }
    }
    Ok(added)
}

/// Returns the rest volumes of the triangles of a sheet that are among `elements`, m³.
fn sheet_volumes(target: &Target, elements: &[u32]) -> Result<Vec<(u32, f64)>, FemError> {
    let Target { body, read, .. } = target;
    let mut volumes = Vec::new();
    for MaterialPart { law, elements: own, .. } in &body.materials {
        let Substance::Sheet(law) = law else { continue };
        let sheet = Sheet {
            pattern: read.pattern.as_deref(),
            fields: &read.fields,
            ..Sheet::new(&read.mesh, own, law, body.node_offset, &body.name)
        };
        volumes.extend(sheet.volumes()?);
    }
    let wanted: HashSet<u32> = elements.iter().copied().collect();
    volumes.retain(|(cell, _)| wanted.contains(cell));
    match volumes.is_empty() {
        true => Err(MeshError::NoElements { dimension: 2 }.into()),
        false => Ok(volumes),
    }
}

/// Returns the damping of a body, whose mesh is in the numbering of the component and whose nodes have these masses
/// (kg).
pub(super) fn damping(
    damping: &Damping,
    (body, mesh): (&BodyModel, &Mesh),
    masses: &[f64],
    kinetic: &[Arc<dyn Potential>],
) -> Result<Vec<Arc<dyn Force>>, String> {
    let text = |error: vi_fem::FemError| error.to_string();
    let mut forces: Vec<Arc<dyn Force>> = Vec::new();
    for (elements, law) in body.solids() {
        let (lambda, mu) = law.parameters().lame();
        let viscosity = Viscosity {
            shear: damping.shear_viscosity + damping.stiffness_time * mu,
            bulk: damping.bulk_viscosity + damping.stiffness_time * lambda,
        };
        if (viscosity.shear, viscosity.bulk) != (0.0, 0.0) && !elements.is_empty() {
            let name = format!("{}: Kelvin-Voigt damping", body.name);
            forces.extend(kelvin_voigt(mesh, elements, viscosity, body.node_offset, &name).map_err(text)?);
        }
    }
    if damping.mass_rate != 0.0 {
        let (name, rate) = (format!("{}: mass damping", body.name), damping.mass_rate);
        if kinetic.is_empty() {
            let force = MassDamping::new(masses, rate, body.node_offset, &name).map_err(text)?;
            forces.push(Arc::new(force));
        }
        for term in kinetic {
            let force = ConsistentMassDamping::new(Arc::clone(term), rate, &name).map_err(text)?;
            forces.push(Arc::new(force));
        }
    }
    Ok(forces)
}
