//! Finds the quantity that controls a path of equilibria, from `static.arc_steps` and `static.control`.

use vi_core::{Potential, State, System};
use vi_fem::{Amplitude, DeadLoad, Pressure, pressure};
use vi_mesh::Surface;
use vi_solvers::{PathControl, PathFunction};

use super::body::{BodyModel, ProbeTarget};
use super::resolve::ControlTarget;
use crate::scene::{BodyId, Problem, Scene};

/// Returns the quantity that controls the path of a scene, in the only system with free coordinates.
pub(crate) fn path_control(
    scene: &Scene,
    target: Option<&ControlTarget>,
    bodies: &[BodyModel],
    components: &[(System, State)],
) -> Result<PathControl, Problem> {
    let free = |number: &usize| components[*number].0.coordinates().free_count() > 0;
    let moving: Vec<usize> = (0..components.len()).filter(free).collect();
    let &[component] = moving.as_slice() else {
        let message = match moving.as_slice() {
            [] => "no coordinate of the scene is free, so that there is no path to follow".to_owned(),
            several => format!(
                "follows one path, and the bodies of this scene form {} systems that do not act on each other: \
                 give each a scene of its own",
                several.len()
            ),
        };
        let key =
            if scene.statics.as_ref().is_some_and(|s| s.control.is_some()) { "control" } else { "arc_steps" };
        return Err(Problem::new(format!("static.{key}"), message));
    };
    let Some(control) = scene.statics.as_ref().and_then(|statics| statics.control.as_ref()) else {
        return Ok(PathControl::Arc);
    };
    let (at, terms) = match target {
        Some(ControlTarget::Displacement(target, axis)) => displacement(bodies, *target, *axis)?,
        Some(ControlTarget::Volume(body, region)) => volume(bodies, components, *body, region)?,
        // The checks of the scene refuse a control whose names do not exist.
        None => {
            return Err(Problem::new(
                "static.control",
                "refers to a probe or region that this scene does not have",
            ));
        }
    };
    if at != component {
        return Err(Problem::new(
            "static.control",
            "refers to a body without free coordinates: choose another",
        ));
    }
    let (system, _) = &components[component];
    let mut rest = vec![[0.0; 3]; system.coordinates().dof_count() / 3];
    for body in bodies.iter().filter(|body| body.component == component) {
        for (node, point) in body.mesh.points.iter().enumerate() {
            rest[body.node(node)] = *point;
        }
    }
    let function = PathFunction::new(system, terms, rest.as_flattened())
        .map_err(|error| Problem::new("static.control", error.to_string()))?;
    Ok(PathControl::Function { function: Box::new(function), to: control.to(), steps: scene.time.steps().0 })
}

type Terms = (usize, Vec<Box<dyn Potential>>);

/// Returns u·e of a probe as a potential: minus the potential of a unit force along e.
fn displacement(bodies: &[BodyModel], target: ProbeTarget, axis: usize) -> Result<Terms, Problem> {
    let wrong = |message: String| Problem::new("static.control.probe", message);
    let body = &bodies[target.body.index()];
    let mesh = body.numbering.mesh(&body.mesh);
    let mut force = [0.0; 3];
    force[axis] = -1.0;
    let node = body.numbering.of(target.node as u32);
    let term = DeadLoad::points(&mesh, &[(node, force)], Amplitude::default(), body.node_offset, "control");
    let term = term.map_err(|error| wrong(error.to_string()))?;
    Ok((body.component, vec![Box::new(term)]))
}

/// Returns the volume on the side of a surface where a positive pressure acts: the potential of a pressure of −1 Pa.
fn volume(
    bodies: &[BodyModel],
    components: &[(System, State)],
    body: BodyId,
    region: &str,
) -> Result<Terms, Problem> {
    let wrong = |message: String| Problem::new("static.control.region", message);
    let body = &bodies[body.index()];
    let mesh = body.numbering.mesh(&body.mesh);
    let surface = Surface::of_region(&mesh, region).map_err(|error| wrong(error.to_string()))?;
    let coordinates = components[body.component].0.coordinates();
    let mut fixed = vec![false; coordinates.dof_count()];
    for group in coordinates.prescribed().iter().filter(|group| group.path.is_fixed()) {
        group.dofs.iter().for_each(|&dof| fixed[dof as usize] = true);
    }
    let is_fixed = |node: u32| [0, 1, 2].map(|k| fixed[3 * (body.node_offset + node as usize) + k]);
    match pressure(&mesh, &surface, -1.0, &Amplitude::default(), is_fixed, body.node_offset, "control") {
        Pressure::Potential(terms) => Ok((body.component, terms)),
        Pressure::Force(_) => Err(wrong(format!(
            "surface '{region}' encloses no volume: close it, or hold its edges, clamped or in planes x, y or z = const"
        ))),
    }
}
