//! The vibration modes of a scene about its initial or static state, to files. It must not know how
//! eigenpairs are found.

use std::fmt::Write as _;
use std::path::Path;

use vi_core::Potential;
use vi_fem::consistent_mass;
use vi_solvers::{Mode, ModeOptions, SolverError};

use crate::auto::stand_in;
use crate::claim::Claim;
use crate::frames::FrameWriter;
use crate::run::{RunError, inputs_among};
use crate::scene::{MassKind, Problem, Scene, Substance};
use crate::simulation::Simulation;

/// A mode and the component that vibrates.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneMode {
    /// Number of the component.
    pub component: usize,
    /// The mode.
    pub mode: Mode,
}

/// The lowest `count` modes of each component, by ascending frequency. A scene with `[static]` is first
/// brought to equilibrium at the end of its time, so that modes are those of the loaded body. Where the scene
/// itself names the mass (`solver.mass`), that is taken.
///
/// # Errors
/// [`RunError`] where the scene, the equilibrium or the eigenproblem fails.
pub fn scene_modes(
    simulation: &mut Simulation,
    count: usize,
    mass: MassKind,
) -> Result<Vec<SceneMode>, RunError> {
    if simulation.scene().statics.is_some() {
        while !simulation.is_done() {
            let step = simulation.steps() + 1;
            simulation.step().map_err(|source| RunError::Step { step, source })?;
        }
    }
    let fail = |error: SolverError| RunError::Scene(vec![Problem::new("modes", error.to_string())]);
    let mut found = Vec::new();
    for (number, component) in simulation.components().iter().enumerate() {
        if component.system().coordinates().free_count() == 0 {
            continue;
        }
        let mut kinetic: Vec<Box<dyn Potential>> = Vec::new();
        let asked = simulation.scene().solver.mass;
        if asked.unwrap_or(mass) == MassKind::Consistent && component.system().kinetic().is_none() {
            let bodies = simulation.bodies().iter().zip(&simulation.scene().bodies);
            for (body, of_scene) in bodies.filter(|(body, _)| body.component == number) {
                let mesh = body.numbering.mesh(&body.mesh);
                for (entry, elements) in of_scene.material.0.iter().zip(&body.materials) {
                    let Substance::Solid(law) = &entry.law else {
                        let message = format!(
                            "'{}' is a sheet: name the mass by `[solver] mass` of the scene",
                            body.name
                        );
                        return Err(RunError::Scene(vec![Problem::new("modes", message)]));
                    };
                    let density = law.density();
                    let terms = consistent_mass(&mesh, elements, density, body.node_offset, &body.name)
                        .map_err(|error| RunError::Scene(vec![Problem::new("modes", error.to_string())]))?;
                    kinetic.extend(terms);
                }
            }
        }
        let options = ModeOptions { count, ..ModeOptions::default() };
        let modes =
            vi_solvers::modes(component.system(), component.state(), kinetic, &options).map_err(fail)?;
        found.extend(modes.into_iter().map(|mode| SceneMode { component: number, mode }));
    }
    found.sort_by(|a, b| a.mode.omega_squared.total_cmp(&b.mode.omega_squared));
    Ok(found)
}

/// Writes `modes.csv` and, for each mode, `mode_000.vtu` with its shape as `displacement`, scaled so that
/// the largest entry is 1 m. `mass` counts before that of the scene; without both it is consistent.
///
/// # Errors
/// [`RunError`] where the scene cannot be solved or a file cannot be written.
pub fn write_modes(
    scene: Scene,
    directory: &Path,
    count: usize,
    mass: Option<MassKind>,
) -> Result<Vec<SceneMode>, RunError> {
    let mut scene = scene;
    scene.solver.mass = mass.or(scene.solver.mass);
    let mut simulation = Simulation::new(stand_in(&scene)).map_err(RunError::Scene)?;
    let modes = scene_modes(&mut simulation, count, MassKind::Consistent)?;
    let output = |path: &Path| {
        let path = path.to_owned();
        move |source| RunError::Output { path, source }
    };
    let _claim = Claim::new(directory)?;
    let shape_file = |number: usize| format!("mode_{number:03}.vtu");
    let files: Vec<_> = (0..modes.len()).map(|number| directory.join(shape_file(number))).collect();
    let problems = inputs_among(simulation.scene(), &files);
    if !problems.is_empty() {
        return Err(RunError::Scene(problems));
    }
    let mut table = String::from("mode,component,omega_squared,frequency,rigid,residual\n");
    let frames = FrameWriter::create(directory, "modes", &simulation, 1.0)?;
    for (number, SceneMode { component, mode }) in modes.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = writeln!(
            table,
            "{number},{component},{:.16e},{:.16e},{},{:.3e}",
            mode.omega_squared,
            mode.frequency(),
            mode.is_rigid,
            mode.residual
        );
        let system = simulation.components()[*component].system();
        let largest = mode.shape.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let mut shape = vec![0.0; system.coordinates().dof_count()];
        for (&dof, value) in system.coordinates().free().iter().zip(&mode.shape) {
            shape[dof as usize] = value / largest;
        }
        for (node, terms) in system.coordinates().combinations() {
            for axis in 0..3 {
                let along = terms.iter().map(|&(k, weight)| weight * shape[3 * k as usize + axis]);
                shape[3 * node as usize + axis] = along.sum();
            }
        }
        let mut displacement = Vec::new();
        for body in simulation.bodies() {
            let nodes = 0..body.mesh.points.len();
            let (shape, _) = shape.as_chunks::<3>();
            match body.component == *component {
                true => displacement.extend(nodes.flat_map(|node| shape[body.node(node)])),
                false => displacement.resize(displacement.len() + 3 * nodes.len(), 0.0),
            }
        }
        frames.write_shape(&shape_file(number), &displacement)?;
    }
    let path = directory.join("modes.csv");
    std::fs::write(&path, table).map_err(output(&path))?;
    Ok(modes)
}
