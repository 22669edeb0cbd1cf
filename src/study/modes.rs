//! The vibration modes of a scene about its initial or static state, written to files. The eigenvalue solver is
//! elsewhere.

mod found;
mod report;

use std::path::Path;

use vi_io::PvdSeries;
use vi_mesh::Bounds;
use vi_solvers::{ModeOptions, SolverError};

use crate::auto::stand_in;
use crate::model::kinetic_terms;
use crate::run::claim::Claim;
use crate::run::frames::FrameWriter;
use crate::run::provenance::Provenance;
use crate::run::{RunError, inputs_among};
use crate::scene::{MassKind, Problem, Scene, Schedule};
use crate::simulation::Simulation;
use crate::study::hinged::hinge_notes;

pub use found::{SceneMode, SceneModes};
pub use report::{ModeFacts, ModesReport};

/// Largest displacement of a mode shape in the files, relative to the largest extent of the vibrating bodies.
const SHAPE_SIZE: f64 = 0.1;

/// Files whose names do not contain the scene: they belong to the last scene with computed modes.
const TABLES: [&str; 3] = ["modes.csv", "modes.json", "modes.svg"];

/// Returns the lowest `count` modes of each component, by ascending frequency. A scene with `[static]` is first
/// brought to equilibrium at the end of its time, so that the modes are those of the loaded body. The mass matrix is
/// the one given by the scene (`solver.mass`), if any.
///
/// # Errors
/// Returns [`RunError`] if the scene, the equilibrium or the eigenproblem fails, or the interrupt of the scene stops them.
pub fn scene_modes(
    simulation: &mut Simulation,
    count: usize,
    mass: MassKind,
) -> Result<SceneModes, RunError> {
    if simulation.scene().statics.is_some() {
        while !simulation.is_done() {
            let step = simulation.steps() + 1;
            simulation.step().map_err(|source| match source.is_interruption() {
                true => RunError::Stopped,
                false => RunError::Step { step, source },
            })?;
        }
    }
    let fail = |error: String| RunError::Scene(vec![Problem::new("modes", error)]);
    let mass = of_scene(simulation.scene()).unwrap_or(mass);
    let mut found = SceneModes { modes: Vec::new(), free_mass: [0.0; 3] };
    for (number, component) in simulation.components().iter().enumerate() {
        let (system, state) = (component.system(), component.state());
        if system.coordinates().free_count() == 0 {
            continue;
        }
        let kinetic = if mass == MassKind::Consistent && system.kinetic().is_none() {
            kinetic_terms(simulation.bodies(), number).map_err(|error| fail(error.to_string()))?
        } else {
            Vec::new()
        };
        let interrupt = simulation.scene().solver.interrupt.clone();
        let options = ModeOptions { count, interrupt, ..ModeOptions::default() };
        let own = vi_solvers::modes(system, state, kinetic, &options).map_err(|error| match error {
            SolverError::Interrupted => RunError::Stopped,
            error => fail(error.to_string()),
        })?;
        for axis in 0..3 {
            found.free_mass[axis] += own.free_mass[axis];
        }
        found.modes.extend(own.modes.into_iter().map(|mode| SceneMode { component: number, mode }));
    }
    found.modes.sort_by(|a, b| a.mode.omega_squared.total_cmp(&b.mode.omega_squared));
    Ok(found)
}

/// Returns the mass of the modes of a scene, if it names one. A filter of the mass belongs to the motion alone.
fn of_scene(scene: &Scene) -> Option<MassKind> {
    scene.solver.mass.filter(|mass| *mass != MassKind::Filtered)
}

/// Writes `modes.csv`, `modes.json`, `modes.svg` and, for each mode, `<name>_mode_000.vtu` with its shape as
/// `displacement`; its largest vector is a tenth of the largest extent of the vibrating bodies. `<name>_modes.pvd` is
/// a series of these files with the frequency as time. Existing tables of another scene are renamed to
/// `<other>.modes.csv` and so on. `mass` has priority over that of the scene; without both, the mass is consistent.
///
/// # Errors
/// Returns [`RunError`] if the scene cannot be solved or a file cannot be written.
pub fn write_modes(
    scene: Scene,
    name: &str,
    directory: &Path,
    count: usize,
    mass: Option<MassKind>,
) -> Result<ModesReport, RunError> {
    let mut scene = scene;
    let wanted = mass.or(of_scene(&scene)).unwrap_or(MassKind::Consistent);
    // The motion may require lumped mass even if the modes do not.
    if of_scene(&scene) != Some(MassKind::Consistent) || wanted == MassKind::Lumped {
        scene.solver.mass = (wanted == MassKind::Lumped).then_some(MassKind::Lumped);
    }
    let mut simulation = Simulation::new(stand_in(&scene)).map_err(RunError::Scene)?;
    let found = scene_modes(&mut simulation, count, wanted)?;
    let provenance = Provenance::new(name, simulation.free_coordinates());
    let mut notes = notes(&simulation, &found, count);
    notes.extend(hinge_notes(simulation.scene()));
    let report = ModesReport::new(provenance, wanted, &found).with_notes(notes);
    let output = |path: &Path| {
        let path = path.to_owned();
        move |source| RunError::Output { path, source }
    };
    let _claim = Claim::new(directory)?;
    let shape_file = |number: usize| format!("{name}_mode_{number:03}.vtu");
    let files: Vec<_> = (0..found.modes.len()).map(|number| directory.join(shape_file(number))).collect();
    let problems = inputs_among(simulation.scene(), &files);
    if !problems.is_empty() {
        return Err(RunError::Scene(problems));
    }
    let frames = FrameWriter::create(directory, "modes", &simulation, Schedule::Interval(1.0))?;
    rename_results_of_others(directory, name).map_err(output(directory))?;
    let mut series = PvdSeries::new(&directory.join(format!("{name}_modes.pvd")));
    for (number, (found, facts)) in found.modes.iter().zip(&report.modes).enumerate() {
        let file = shape_file(number);
        // Viewers show one file per time, so rigid modes need distinct times.
        let last = series.frames().last().map_or(f64::NEG_INFINITY, |frame| frame.0);
        let time = facts.signed_frequency().max(last.next_up());
        let data: [(&str, &[f64]); 3] = [
            ("frequency", &[facts.frequency]),
            ("omega_squared", &[facts.omega_squared]),
            ("effective_mass", &facts.effective_mass),
        ];
        frames.write_shape(&file, &shape(&simulation, found), time, &data)?;
        series.push(time, &file)?;
    }
    // Remove shapes of an earlier call that computed more modes.
    for path in (found.modes.len()..).map(|number| directory.join(shape_file(number))) {
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => break,
            removed => removed.map_err(output(&path))?,
        }
    }
    for (file, text) in TABLES.into_iter().zip([report.csv(), report.json(), report.chart()]) {
        let path = directory.join(file);
        std::fs::write(&path, text).map_err(output(&path))?;
    }
    Ok(report)
}

/// Returns a note for each component that has fewer modes than the `count` that was asked for.
fn notes(simulation: &Simulation, found: &SceneModes, count: usize) -> Vec<String> {
    let of = |number: usize| found.modes.iter().filter(|mode| mode.component == number).count();
    let components = 0..simulation.components().len();
    let fewer = components.map(|number| (number, of(number))).filter(|&(_, own)| own > 0 && own < count);
    let words = fewer.map(|(number, own)| {
        let bodies = simulation.bodies().iter().filter(|body| body.component == number);
        let names: Vec<String> = bodies.map(|body| format!("'{}'", body.name)).collect();
        format!(
            "{} {} only {own} modes, one for each free coordinate; {count} were asked for",
            names.join(", "),
            if names.len() == 1 { "has" } else { "have together" }
        )
    });
    words.collect()
}

/// Returns the displacement of every node of every body in a mode, m.
fn shape(simulation: &Simulation, SceneMode { component, mode }: &SceneMode) -> Vec<f64> {
    let coordinates = simulation.components()[*component].system().coordinates();
    let mut all = vec![0.0; coordinates.dof_count()];
    for (&dof, value) in coordinates.free().iter().zip(&mode.shape) {
        all[dof as usize] = *value;
    }
    coordinates.to_space(&mut all);
    coordinates.complete(&mut all);
    let mut displacement: Vec<[f64; 3]> = Vec::new();
    for body in simulation.bodies() {
        let moves = body.component == *component;
        for node in 0..body.mesh.points.len() {
            let at = body.node(node);
            displacement.push(if moves { [0, 1, 2].map(|k| all[3 * at + k]) } else { [0.0; 3] });
        }
    }
    let moving = simulation.bodies().iter().filter(|body| body.component == *component);
    let extent = Bounds::of(moving.flat_map(|body| body.mesh.points.iter().copied())).longest_side();
    let length = |u: &[f64; 3]| u.iter().map(|u| u * u).sum::<f64>().sqrt();
    let largest = displacement.iter().map(length).fold(0.0, f64::max);
    let factor = if largest > 0.0 { SHAPE_SIZE * extent / largest } else { 0.0 };
    displacement.into_iter().flatten().map(|u| factor * u).collect()
}

/// Renames the tables of another scene's modes after that scene.
fn rename_results_of_others(directory: &Path, name: &str) -> std::io::Result<()> {
    let table = std::fs::read(directory.join("modes.json")).ok();
    let table = table.and_then(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).ok());
    let other = table.and_then(|table| Some(table["provenance"]["scene"].as_str()?.to_owned()));
    // Only a valid file name is accepted.
    let is_name = |other: &String| Path::new(other).file_name() == Some(other.as_ref());
    let Some(other) = other.filter(|other| other != name).filter(is_name) else { return Ok(()) };
    for file in TABLES {
        match std::fs::rename(directory.join(file), directory.join(format!("{other}.{file}"))) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
            renamed => renamed?,
        }
    }
    Ok(())
}
