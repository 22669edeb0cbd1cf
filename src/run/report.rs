//! Writes report.json: the scene that ran, the duration of each phase, the counted work, and the energy balance.

use std::io;
use std::path::Path;

use serde::Serialize;
use serde_json::{Map, Value, json};
use vi_solvers::SolverError;

use crate::run::provenance::Provenance;
use crate::run::results::Results;
use crate::scene::Scene;
use crate::simulation::Simulation;
use crate::simulation::stability::{self, StabilityNote};

/// A note reports steps that stopped short if they are more than one in this many.
const FEW_SHORT: u64 = 20;

/// Reason for the end of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Outcome {
    /// The run reached its end.
    Done,
    /// The user interrupted it after a step.
    Interrupted,
    /// A step failed.
    Failed(String),
}

/// The report of a run. Equal runs have equal reports except for `provenance` and the clock times, whose names end in
/// `_seconds`.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Origin of the result: besides clock times, all that may differ between equal runs.
    pub provenance: Provenance,
    /// Name of the scene.
    pub name: String,
    /// The scene of the run, with all settings.
    pub scene: Scene,
    /// Name of the scheme; `None` in statics.
    pub scheme: Option<&'static str>,
    /// Whether the scheme is variational (symplectic).
    pub variational: Option<bool>,
    /// The step, adjusted to land on the end, s; with adaptive steps the length of an interval; in statics the increment of the time that loads depend on.
    pub h: f64,
    /// Number of steps made; with adaptive steps, of intervals.
    pub steps: u64,
    /// Reason for the end of the run.
    pub outcome: Option<Outcome>,
    /// Number of nodes of all bodies.
    pub node_count: usize,
    /// Number of elements of all bodies.
    pub element_count: usize,
    /// Number of free coordinates.
    pub free_coordinates: usize,
    /// Number of independent systems, and of those without a free coordinate.
    pub components: Value,
    /// Stability limit of an explicit scheme.
    pub stability: Value,
    /// Repairs and omissions in meshes, and warnings.
    pub notes: Vec<String>,
    /// Time spent on building systems, s.
    pub setup_seconds: f64,
    /// Time spent on stepping alone, s.
    pub stepping_seconds: f64,
    /// Time spent on history and frames, s.
    pub output_seconds: f64,
    /// Time spent on companions of the error estimate, s; part of the output.
    pub estimating_seconds: f64,
    /// Reasons of `auto` for this scheme and step, if the scene left them open.
    pub auto: Value,
    /// Estimated errors of the probes at the end.
    pub estimate: Map<String, Value>,
    /// Number of steps that were cut, of their substeps, and the smallest substep, s.
    pub substeps: Value,
    /// With `step = "adaptive"`: the intervals, and the steps made in them.
    pub adaptive: Value,
    /// Growth of energy without a source, and the actions of the guard.
    pub guard: Value,
    /// Counted work.
    pub work: Map<String, Value>,
    /// The linear solver of each system with equations to solve; `--explain` gives the reasons.
    pub linear_solvers: Vec<String>,
    /// Number of frames written.
    pub frames: usize,
    /// The energy ledger, J.
    pub energy: Value,
    /// The momentum ledger.
    pub momentum: Value,
    /// Counts of the contact search and the smallest gap; null in a scene without contact.
    pub contact: Value,
    /// Pitch of the probes with `pitch`, Hz.
    pub pitch: Map<String, Value>,
    /// Largest displacement and stress, reactions, extremes of probes.
    pub results: Results,
    /// Asserts of the scene that do not hold.
    pub broken: Vec<String>,
    /// Energy gained in spite of the guard, as a message.
    #[serde(skip)]
    pub warning: Option<String>,
    /// Energy drift relative to the largest kinetic energy.
    #[serde(skip)]
    pub energy_drift: f64,
}

impl Report {
    pub(crate) fn new(
        simulation: &Simulation,
        auto: Value,
        name: &str,
        found: &Result<Option<StabilityNote>, SolverError>,
    ) -> Self {
        let scene = simulation.scene();
        let method = simulation.method();
        let is_moving = scene.statics.is_none();
        let components = simulation.components();
        let idle = components.iter().filter(|component| component.stepper().is_none()).count();
        let mut notes = simulation.notes().to_vec();
        notes.extend(stability::warning(found, method));
        notes.extend(auto["warning"].as_str().map(str::to_owned));
        Self {
            provenance: Provenance {
                ranks: simulation.ranks().cloned(),
                ..Provenance::new(name, simulation.free_coordinates())
            },
            name: name.to_owned(),
            scene: scene.clone(),
            scheme: is_moving.then(|| method.name()),
            variational: is_moving.then(|| method.facts().is_variational()),
            h: simulation.step_size(),
            steps: 0,
            outcome: None,
            node_count: simulation.bodies().iter().map(|body| body.mesh.points.len()).sum(),
            element_count: simulation.bodies().iter().map(|body| body.element_count()).sum(),
            free_coordinates: simulation.free_coordinates(),
            components: json!({ "count": components.len(), "without_free_coordinates": idle }),
            stability: match found {
                Ok(Some(note)) => {
                    json!({ "highest_frequency": note.highest_frequency, "damping_rate": note.damping_rate,
                            "step_limit": note.step_limit, "exceeded": note.warning().is_some() })
                }
                Ok(None) => Value::Null,
                Err(error) => json!({ "unknown": error.to_string() }),
            },
            notes,
            setup_seconds: 0.0,
            stepping_seconds: 0.0,
            output_seconds: 0.0,
            estimating_seconds: 0.0,
            auto,
            estimate: Map::new(),
            substeps: Value::Null,
            adaptive: Value::Null,
            guard: Value::Null,
            work: Map::new(),
            linear_solvers: Vec::new(),
            frames: 0,
            energy: Value::Null,
            momentum: Value::Null,
            contact: Value::Null,
            pitch: Map::new(),
            results: Results::default(),
            broken: Vec::new(),
            warning: None,
            energy_drift: 0.0,
        }
    }

    /// Enters the end of the run and its work; the observers report the rest.
    pub(crate) fn close(&mut self, simulation: &Simulation, outcome: Outcome) {
        self.steps = simulation.steps();
        self.outcome = Some(outcome);
        self.work = simulation.work().iter().map(|(name, count)| (name.to_owned(), count.into())).collect();
        if let Some(counts) = simulation.adaptive_counts() {
            let h = simulation.step_size();
            self.adaptive = json!({
                "interval": h, "intervals": simulation.steps(), "steps": counts.steps,
                "smallest_step": h / counts.most.max(1) as f64,
                "largest_step": h / counts.fewest.clamp(1, counts.most.max(1)) as f64,
                "intervals_repeated": counts.repeated,
            });
        }
        let cut = simulation.substeps();
        let is_symmetric = simulation.method().facts().is_symmetric
            && simulation.scene().statics.is_none()
            && !simulation.may_dissipate();
        let was_hard = cut.steps > cut.halved;
        self.substeps = json!({ "steps_cut": cut.steps, "substeps": cut.substeps,
                                "steps_halved_by_guard": cut.halved,
                                "smallest": simulation.step_size() / cut.finest as f64,
                                "time_symmetry_lost": is_symmetric && (was_hard || cut.changes > 0) });
        self.notes.extend(self.lost_symmetry());
        self.notes.extend(self.stopped_short());
        let steppers = simulation.components().iter().filter_map(|component| component.stepper());
        // Drop the reason: only the run that chose the solver has it, and a continued run must report the same.
        let name = |reason: &str| reason.split(':').next().map(str::to_owned);
        self.linear_solvers = steppers.filter_map(|stepper| stepper.linear_solver().and_then(name)).collect();
        self.contact = simulation.contact_report();
        let assert = &simulation.scene().assert;
        let crossing = simulation.first_crossing();
        if let Some(bound) = assert.smallest_gap {
            let gap = simulation.smallest_gap();
            if let Some(crossing) = &crossing {
                self.broken
                    .push(format!("smallest_gap: {crossing}, the scene asserts at least {bound:.3e} m"));
            } else if gap < bound {
                self.broken
                    .push(format!("smallest_gap is {gap:.3e} m, the scene asserts at least {bound:.3e} m"));
            }
        }
        if let Some(bound) = assert.intersections
            && simulation.intersections() > bound
        {
            let found = simulation.intersections();
            let first = crossing.map_or(String::new(), |crossing| format!("; first, {crossing}"));
            self.broken.push(format!(
                "intersections are {found} in a row, the scene asserts at most {bound}{first}"
            ));
        }
    }

    /// Records a broken assert if a value exceeds the bound that the scene asserts.
    pub(crate) fn assert_at_most(&mut self, name: &str, bound: Option<f64>, value: f64) {
        if let Some(bound) = bound
            && (value > bound || value.is_nan())
        {
            self.broken.push(format!("{name} is {value:.3e}, the scene asserts at most {bound:.3e}"));
        }
    }

    /// Returns a note if steps were not equal although the scheme is symmetric in time.
    pub(crate) fn lost_symmetry(&self) -> Option<String> {
        let scheme = self.scheme.filter(|_| self.substeps["time_symmetry_lost"] == true)?;
        let count = |key: &str| self.substeps[key].as_u64().unwrap_or(0);
        let hard = count("steps_cut") - count("steps_halved_by_guard");
        let (what, remedy) = match hard {
            0 => (
                "the energy guard changed the step during the run".to_owned(),
                "a step that is short enough from the start is not changed",
            ),
            _ => (
                format!("{hard} of {} steps were cut where they were hard to solve", self.steps),
                "a smaller step is not cut, and `time.substeps = false` forbids it",
            ),
        };
        Some(format!(
            "{what}: run backwards from its end, this run comes back to its start only to the error of these steps, and not to \
             round-off as {scheme} does with equal steps; {remedy}"
        ))
    }

    /// Returns a note if many steps of a fixed number of linear solves ended far from convergence.
    pub(crate) fn stopped_short(&self) -> Option<String> {
        let count = |name: &str| self.work.get(name).and_then(Value::as_u64).unwrap_or(0);
        let (short, steps) = (count("stopped_short"), count("steps"));
        (short * FEW_SHORT > steps).then(|| {
            format!(
                "{short} of {steps} steps had no more linear solves far from convergence: their last correction still had more than \
                 1 % of the energy that the step exchanged, so bodies look softer and slower than they are; raise `time.solves`, \
                 shorten `time.step`, or use scheme = \"backward-euler\""
            )
        })
    }

    /// Lists the work done, in counts.
    #[cfg(feature = "cli")]
    pub(crate) fn account(&self) -> String {
        crate::run::explain::account(&self.work)
    }

    /// Writes report.json as a whole; it exists only after the run has ended.
    pub(crate) fn write(&self, path: &Path) -> io::Result<()> {
        let mut text = serde_json::to_string_pretty(self)?;
        text.push('\n');
        let temporary = path.with_extension("json.tmp");
        let written = std::fs::write(&temporary, text).and_then(|()| std::fs::rename(&temporary, path));
        if written.is_err() {
            // The first error is reported; the temporary file may not exist.
            let _ = std::fs::remove_file(&temporary);
        }
        written
    }
}
