//! `variational convergence`: runs a scene on finer meshes and with smaller steps, and estimates the exact solution.
//!
//! The space study halves every element repeatedly. The time study halves the step on the scene's own mesh. Static
//! scenes have no time study; with `modes`, the space study considers the frequencies of vibration. Explicit schemes
//! use the smallest step of the study on all meshes, so that it is stable on the finest.

mod chart;
mod extrapolate;
mod tables;
mod theory;

use std::ops::Range;
use std::time::Instant;

use serde::Serialize;
use vi_solvers::StepError;

use crate::auto::trial::{Choice, TrialWatch};
use crate::auto::{SettleError, settle, stand_in};
use crate::run::RunError;
use crate::run::provenance::Provenance;
use crate::scene::{Load, MassKind, Problem, Refine, Scene, SpringEnd};
use crate::simulation::{Observation, Simulation};
use crate::study::hinged::hinge_notes;
use crate::study::modes::scene_modes;

pub use extrapolate::{Extrapolation, Verdict, extrapolate};

/// Options of a convergence study.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvergenceOptions {
    /// Name of the scene, for the report.
    pub name: String,
    /// Number of meshes or steps, 2 to 6; at least 3 show an order.
    pub levels: u32,
    /// Whether the mesh is refined.
    pub space: bool,
    /// Whether the step is refined.
    pub time: bool,
    /// Number of vibration frequencies to study in place of the end of the run.
    pub modes: Option<usize>,
}

impl Default for ConvergenceOptions {
    fn default() -> Self {
        Self { name: String::new(), levels: 3, space: true, time: true, modes: None }
    }
}

/// One run of a study.
#[derive(Debug, Clone, Serialize)]
pub struct Level {
    /// Number of times that the elements of the scene were halved.
    pub refined: u32,
    /// Nodes of all bodies.
    pub nodes: usize,
    /// Steps.
    pub steps: u64,
    /// Step, s.
    pub step: f64,
    /// Run time, s.
    pub seconds: f64,
    /// The quantities, in the order of [`Study::rows`].
    #[serde(skip)]
    pub values: Vec<f64>,
}

/// One quantity on all levels.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Name: for example `tip.ux` (m) for probes, `kinetic`, `elastic`, `total` (J), `mode 7` (Hz), each at the end
    /// of the scene.
    pub quantity: String,
    /// Values, starting with the coarsest level.
    pub values: Vec<f64>,
    /// Evaluation of the values.
    #[serde(flatten)]
    pub extrapolation: Extrapolation,
}

/// A study in space or in time.
#[derive(Debug, Clone, Serialize)]
pub struct Study {
    /// `space` or `time`.
    pub of: &'static str,
    /// Runs of the study.
    pub levels: Vec<Level>,
    /// Quantities of the study.
    pub rows: Vec<Row>,
}

/// The exact value of a quantity, as estimated by the studies.
#[derive(Debug, Clone, Serialize)]
pub struct Estimate {
    /// The quantity.
    pub quantity: String,
    /// Estimate and error bar: the value on the finest mesh, corrected in space and in time.
    #[serde(flatten)]
    pub extrapolation: Extrapolation,
}

/// The outcome.
#[derive(Debug, Clone, Serialize)]
pub struct ConvergenceReport {
    /// Origin of the study, with the free coordinates of the scene's own mesh.
    pub provenance: Provenance,
    /// The scheme; `None` for statics and modes.
    pub scheme: Option<String>,
    /// Order in time.
    pub formal_order: Option<usize>,
    /// The studies.
    pub studies: Vec<Study>,
    /// The estimates.
    pub estimates: Vec<Estimate>,
    /// Notes on the estimates, for example that elements lock.
    pub notes: Vec<String>,
}

/// Error that prevents a study.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConvergenceError {
    /// The scene is invalid.
    #[error("the scene is invalid")]
    Scene(Vec<Problem>),
    /// A run failed.
    #[error("{what}: {source}")]
    Step {
        /// Description of the run.
        what: String,
        /// Error.
        source: Box<StepError>,
    },
    /// The modes could not be computed.
    #[error("{what}: {source}")]
    Modes {
        /// Description of the run.
        what: String,
        /// Error.
        source: Box<RunError>,
    },
    /// The caller asked to stop.
    #[error("stopped")]
    Stopped,
    /// There is nothing to refine.
    #[error("{0}")]
    Nothing(String),
}

impl From<SettleError> for ConvergenceError {
    fn from(error: SettleError) -> Self {
        match error {
            SettleError::Scene(problems) => Self::Scene(problems),
            SettleError::Stopped => Self::Stopped,
        }
    }
}

/// Studies a scene.
///
/// # Errors
/// Returns [`ConvergenceError`] if the scene is invalid, a run fails, the caller asks to stop or there is nothing to
/// refine.
pub fn convergence(
    scene: &Scene,
    options: &ConvergenceOptions,
    watch: &mut dyn TrialWatch,
) -> Result<ConvergenceReport, ConvergenceError> {
    let scene = match options.modes {
        Some(_) => stand_in(scene),
        None => settle(scene.clone(), watch)?.0,
    };
    let first = Simulation::new(scene).map_err(ConvergenceError::Scene)?;
    // This scene has a fixed scheme and step, and points are replaced by the nodes of the scene's mesh.
    let scene = by_nodes(&first);
    let moves = scene.statics.is_none() && options.modes.is_none();
    if options.modes.is_none() && scene.probes.is_empty() && !moves {
        let problem = "the scene has no probe: add a [[probe]], whose displacement is studied";
        return Err(ConvergenceError::Nothing(problem.to_owned()));
    }
    let choice = Choice::of(&scene);
    let facts = choice.method().facts();
    let finest = options.levels - 1;
    let quantities = quantities(&scene, options);
    let locking = theory::locking_bodies(&first);
    // Values of explicit runs and of modes have no solver error.
    let tolerance =
        if options.modes.is_some() || moves && facts.is_explicit { 0.0 } else { scene.solver.tolerance };
    let extrapolated = |of: &str, quantity: &str, values: &[f64], noise: f64| match of {
        "time" => extrapolate(values, facts.order as f64, noise),
        _ => {
            let found = extrapolate(values, theory::order_in_space(&first, quantity), noise);
            if locking.is_empty() { found } else { found.locked() }
        }
    };
    let mut studies = Vec::new();
    let steps = |halved: u32| choice.steps << if moves { halved } else { 0 };
    let mut study = |of: &'static str, runs: &mut dyn Iterator<Item = (u32, u64)>| {
        let mut levels = Vec::new();
        for (refined, steps) in runs {
            let mut run = Choice { steps, ..choice }.apply(&scene);
            for body in &mut run.bodies {
                let refine = body.refine.take().unwrap_or(Refine::Levels(0));
                let levels = refine.levels() + refined;
                body.refine = Some(refine.with_levels(levels));
            }
            levels.push(level(run, refined, options, watch)?);
        }
        let rows = rows(&quantities, &levels, tolerance, |quantity, values, noise| {
            extrapolated(of, quantity, values, noise)
        });
        studies.push(Study { of, rows, levels });
        Ok::<(), ConvergenceError>(())
    };
    if options.space {
        // The step for all meshes.
        let count = steps(if facts.is_explicit { finest } else { 0 });
        study("space", &mut (0..options.levels).map(|refined| (refined, count)))?;
    }
    if options.time && moves {
        study("time", &mut (0..options.levels).map(|halved| (0, steps(halved))))?;
    }
    if studies.is_empty() {
        let problem = "statics and modes have no time study: leave --time out";
        return Err(ConvergenceError::Nothing(problem.to_owned()));
    }
    Ok(ConvergenceReport {
        provenance: Provenance::new(&options.name, first.free_coordinates()),
        scheme: moves.then(|| choice.label()),
        formal_order: moves.then_some(facts.order),
        estimates: estimates(&studies),
        notes: locking.iter().map(|body| locking_note(body)).chain(hinge_notes(&scene)).collect(),
        studies,
    })
}

fn locking_note(body: &str) -> String {
    format!(
        "body '{body}' is nearly incompressible, where linear elements lock: no error bars are given in space; use \
         locking = \"mean-dilation\" (hex8, wedge6) or order = 2"
    )
}

/// Returns the scene with points replaced by nodes, so that finer meshes use the same positions.
fn by_nodes(simulation: &Simulation) -> Scene {
    let mut scene = simulation.scene().clone();
    let bodies = simulation.bodies();
    let settle = |name: &str, point: &mut Option<[f64; 3]>, node: &mut Option<usize>| {
        let body = bodies.iter().find(|body| body.name == name);
        if let (Some(place), Some(body)) = (*point, body)
            && let Some(nearest) = body.mesh.nearest_node(place)
        {
            (*point, *node) = (None, Some(nearest as usize));
        }
    };
    for probe in &mut scene.probes {
        settle(&probe.body, &mut probe.point, &mut probe.node);
    }
    for load in &mut scene.loads {
        if let Load::Point { body, point, node, .. } = load {
            settle(body, point, node);
        }
    }
    for spring in &mut scene.springs {
        for SpringEnd { body, point, node } in [&mut spring.from, &mut spring.to] {
            if let Some(body) = body {
                settle(body, point, node);
            }
        }
    }
    scene
}

/// Relative round-off of a value, compared with the largest value of its group. Components across a bar were at most
/// 6e-15 of its displacement after 1600 explicit steps, and 5e-14 after 80 implicit ones.
const ROUND_OFF: f64 = 1e-12;

/// A studied quantity.
struct Quantity {
    name: String,
    /// The quantities that set the scale of its round-off: the components of its vector, or the parts of the energy.
    peers: Range<usize>,
    /// Whether it is a component of a vector, so that its solver error is relative to the whole vector.
    is_component: bool,
}

/// Returns the quantities in the order of the values of a level.
fn quantities(scene: &Scene, options: &ConvergenceOptions) -> Vec<Quantity> {
    if let Some(count) = options.modes {
        let mode =
            |mode| Quantity { name: format!("mode {mode}"), peers: mode..mode + 1, is_component: false };
        return (0..count).map(mode).collect();
    }
    let mut all = Vec::new();
    for probe in scene.node_probes() {
        let peers = all.len()..all.len() + 3;
        for axis in ["ux", "uy", "uz"] {
            let name = format!("{}.{axis}", probe.name);
            all.push(Quantity { name, peers: peers.clone(), is_component: true });
        }
    }
    let peers = all.len()..all.len() + 4;
    for energy in ["kinetic", "elastic", "load", "total"] {
        all.push(Quantity { name: energy.to_owned(), peers: peers.clone(), is_component: false });
    }
    all
}

/// Runs a scene to its end.
fn level(
    scene: Scene,
    refined: u32,
    options: &ConvergenceOptions,
    watch: &mut dyn TrialWatch,
) -> Result<Level, ConvergenceError> {
    let begin = Instant::now();
    let mut simulation = Simulation::new(scene).map_err(ConvergenceError::Scene)?;
    let nodes: usize = simulation.bodies().iter().map(|body| body.mesh.points.len()).sum();
    let what = format!("{nodes} nodes, {} steps", simulation.step_count());
    watch.next(&what);
    if !watch.go_on() {
        return Err(ConvergenceError::Stopped);
    }
    let values = if let Some(count) = options.modes {
        let modes = scene_modes(&mut simulation, count, MassKind::Consistent);
        let modes = modes.map_err(|source| match source {
            RunError::Stopped => ConvergenceError::Stopped,
            source => ConvergenceError::Modes { what, source: Box::new(source) },
        })?;
        modes.modes.iter().take(count).map(|found| found.mode.frequency()).collect()
    } else {
        while !simulation.is_done() {
            let stepped = simulation.advance(u64::MAX);
            stepped.map_err(|source| match source.is_interruption() {
                true => ConvergenceError::Stopped,
                false => ConvergenceError::Step { what: what.clone(), source: Box::new(source) },
            })?;
            if !watch.go_on() {
                return Err(ConvergenceError::Stopped);
            }
        }
        values(&simulation.observe())
    };
    Ok(Level {
        refined,
        nodes,
        steps: simulation.step_count(),
        step: simulation.step_size(),
        seconds: begin.elapsed().as_secs_f64(),
        values,
    })
}

/// Returns the values of the quantities for a state, in the order of their names.
fn values(seen: &Observation) -> Vec<f64> {
    let probes = seen.probes.iter().flat_map(|probe| probe.displacement);
    probes.chain([seen.kinetic, seen.elastic, seen.load, seen.total()]).collect()
}

/// Returns the quantities that are not zero on all levels, with the evaluation of their values. `tolerance` is that
/// of the solver.
fn rows(
    quantities: &[Quantity],
    levels: &[Level],
    tolerance: f64,
    extrapolated: impl Fn(&str, &[f64], f64) -> Extrapolation,
) -> Vec<Row> {
    let largest = |range: Range<usize>| {
        let values = levels.iter().flat_map(|level| level.values.get(range.clone()).unwrap_or_default());
        values.fold(0.0_f64, |most, value| most.max(value.abs()))
    };
    let row = |(k, quantity): (usize, &Quantity)| {
        let values: Option<Vec<f64>> = levels.iter().map(|level| level.values.get(k).copied()).collect();
        let values = values?;
        if values.iter().all(|value| *value == 0.0) {
            return None;
        }
        let solved = if quantity.is_component { quantity.peers.clone() } else { k..k + 1 };
        let is_alone = quantity.peers.len() == 1;
        let round_off = if is_alone { 0.0 } else { ROUND_OFF * largest(quantity.peers.clone()) };
        let noise = round_off.max(tolerance * largest(solved));
        let extrapolation = extrapolated(&quantity.name, &values, noise);
        Some(Row { quantity: quantity.name.clone(), extrapolation, values })
    };
    quantities.iter().enumerate().filter_map(row).collect()
}

/// Returns the values on the finest mesh, corrected by the remaining error in space and, at its step, in time.
fn estimates(studies: &[Study]) -> Vec<Estimate> {
    let find = |of: &str| studies.iter().find(|study| study.of == of);
    let (space, time) = (find("space"), find("time"));
    let Some(leading) = space.or(time) else { return Vec::new() };
    let estimate = |row: &Row| {
        let mut extrapolation = row.extrapolation;
        if let (Some(space), Some(time)) = (space, time)
            && let Some(same) = time.rows.iter().find(|other| other.quantity == row.quantity)
            && let Some(level) = time.levels.iter().position(|level| level.steps == space.levels[0].steps)
        {
            extrapolation = extrapolation.with_time(&same.extrapolation, same.values[level]);
        }
        Estimate { quantity: row.quantity.clone(), extrapolation }
    };
    leading.rows.iter().map(estimate).collect()
}
