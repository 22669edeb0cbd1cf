//! From the loads and the damping of a scene to potentials and forces. It must not know how they are
//! summed.

use std::sync::Arc;

use vi_core::{Force, Potential};
use vi_fem::{DeadLoad, MassDamping, Mesh, Pressure, Surface, Viscosity, kelvin_voigt, pressure};

use super::BodyModel;
use crate::scene::{Body, Damping, Fix, Load, Substance, field};

/// What a load or damping adds to a component.
#[derive(Default)]
pub(super) struct Added {
    pub(super) potentials: Vec<Box<dyn Potential>>,
    pub(super) forces: Vec<Arc<dyn Force>>,
}

/// A load on a body, which comes with its mesh in the numbering of the component; `fixes` are those of the body
/// with their nodes.
pub(super) fn load(
    load: &Load,
    index: usize,
    (body, mesh): (&BodyModel, &Mesh),
    fixes: &[(&Fix, &[u32])],
) -> Result<Added, String> {
    let offset = body.node_offset;
    let text = |error: vi_fem::FemError| error.to_string();
    let mut added = Added::default();
    match load {
        Load::Traction { region, traction, amplitude, .. } => {
            let name = format!("load[{index}]: traction");
            let surface = Surface::of_region(mesh, region).map_err(text)?;
            let traction = field(traction).map_err(text)?;
            let term = DeadLoad::traction(mesh, &surface, &traction, amplitude.clone(), offset, &name);
            added.potentials.push(Box::new(term.map_err(text)?));
        }
        Load::Pressure { region, pressure: value, amplitude, .. } => {
            let name = format!("load[{index}]: pressure");
            let surface = Surface::of_region(mesh, region).map_err(text)?;
            // Prescribed nodes that move do not keep the potential.
            let mut fixed = vec![[false; 3]; mesh.points.len()];
            for (fix, nodes) in fixes.iter().filter(|(fix, _)| fix.motion.is_none()) {
                for &node in *nodes {
                    for &axis in &fix.axes {
                        fixed[body.numbering.of(node) as usize][axis as usize] = true;
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
            let node = node.map(|node| node as u32).or_else(nearest).ok_or("the body has no nodes")?;
            let node = body.numbering.of(node);
            let term = DeadLoad::points(mesh, &[(node, *force)], amplitude.clone(), offset, &name);
            added.potentials.push(Box::new(term.map_err(text)?));
        }
        Load::BodyForce { region, force, amplitude, .. } => {
            let name = format!("load[{index}]: body force");
            let elements = match region {
                Some(region) => mesh.region(region).map_err(text)?.elements.clone(),
                None => body.materials.iter().flatten().copied().collect(),
            };
            let force = field(force).map_err(text)?;
            let term = DeadLoad::body_force(mesh, &elements, &force, amplitude.clone(), offset, &name);
            added.potentials.push(Box::new(term.map_err(text)?));
        }
    }
    Ok(added)
}

/// Damping of a body, which comes with its mesh in the numbering of the component; its nodes have these masses (kg).
pub(super) fn damping(
    damping: &Damping,
    scene_body: &Body,
    (body, mesh): (&BodyModel, &Mesh),
    masses: &[f64],
) -> Result<Vec<Arc<dyn Force>>, String> {
    let text = |error: vi_fem::FemError| error.to_string();
    let mut forces: Vec<Arc<dyn Force>> = Vec::new();
    for (entry, elements) in scene_body.material.0.iter().zip(&body.materials) {
        let Substance::Solid(law) = &entry.law else { continue };
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
        let name = format!("{}: mass damping", body.name);
        let force = MassDamping::new(masses, damping.mass_rate, body.node_offset, &name).map_err(text)?;
        forces.push(Arc::new(force));
    }
    Ok(forces)
}
