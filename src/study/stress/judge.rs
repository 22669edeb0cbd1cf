//! Runs one violent scene and judges its results: report, files and state.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use serde_json::Value;
use vi_core::State;
use vi_solvers::Interrupt;

use super::transform::Transform;
use super::violence::Case;
use crate::run::{RunError, Watch, run};
use crate::scene::{GuardAction, SchemeName};
use crate::simulation::{Simulation, TOGETHER};

/// Growth of energy, relative to the energy exchanged, above which a warning is required: the bound of the guard.
/// Theory allows no smaller bound: below its stability limit an explicit scheme conserves a modified energy, about
/// which the true energy oscillates by the fraction (hω)²/4.
const SILENT: f64 = 0.1;

/// Newton's method stops by an estimate of its error from its contraction; this factor allows for the estimate.
const ESTIMATED: f64 = 2.0;

/// Factor on the energy bound. The bound assumes a constant K during a step; crushed and snapping bodies change K by
/// orders of magnitude.
const VIOLENT: f64 = 100.0;

/// Result for a scene.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// The run ended with every invariant within its bounds.
    Done {
        /// Whether steps were cut.
        was_cut: bool,
        /// Whether the guard warned or acted.
        was_guarded: bool,
    },
    /// The run failed with a named error, all results were written and the state is intact.
    Failed(String),
    /// The time limit of the trial ended the run, with all results written.
    OutOfTime,
    /// The scene was refused before the run.
    Refused(String),
    /// A law was violated.
    Forbidden(String),
}

/// Time limits of a scene.
pub(super) struct Clock {
    /// Time allowed for a scene.
    pub(super) limit: Duration,
    /// Set from outside: every scene abandons its current step and ends.
    pub(super) is_ended: Arc<AtomicBool>,
}

/// Stores the last state and checks every step.
struct Witness<'a> {
    deadline: Instant,
    is_ended: &'a Arc<AtomicBool>,
    states: Vec<State>,
    steps: u64,
    wrong: Option<String>,
    /// Whether the state left the number range of frames.
    is_beyond: bool,
}

impl Witness<'_> {
    fn look(&mut self, simulation: &Simulation) {
        self.states = simulation.components().iter().map(|component| component.state().clone()).collect();
        let is_finite = |state: &State| state.q.iter().chain(&state.p).all(|value| value.is_finite());
        if !self.states.iter().all(is_finite) {
            self.wrong = Some("a state is not finite".to_owned());
        }
        let (crossings, pairs) = simulation.crossings();
        if let Some(&[a, b]) = pairs.first() {
            let [a, b] = [a, b].map(|number| simulation.name_of(number));
            let step = simulation.steps();
            self.wrong =
                Some(format!("after step {step} surfaces cross in {crossings} places: '{a}' and '{b}'"));
        }
        self.steps = simulation.steps();
    }
}

impl Watch for Witness<'_> {
    fn start(&mut self, simulation: &Simulation, _: &[String]) {
        self.look(simulation);
    }

    fn step(&mut self, simulation: &Simulation) -> bool {
        // Only the guard goes back. No advance exceeds the number of steps that are made together.
        if simulation.steps() > self.steps + TOGETHER {
            self.wrong = Some(format!("step {} follows step {}", simulation.steps(), self.steps));
        }
        self.look(simulation);
        Instant::now() < self.deadline && !self.is_ended.load(Ordering::Relaxed)
    }

    fn end(&mut self, simulation: &Simulation) {
        let same = simulation.components().iter().zip(&self.states).all(|(component, state)| {
            let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            bits(&component.state().q) == bits(&state.q) && bits(&component.state().p) == bits(&state.p)
        });
        // The guard, or a state out of range, may end a run after a completed step.
        if !same && simulation.steps() == self.steps {
            self.wrong = Some("a failed step has changed the state".to_owned());
        }
    }
}

/// Runs a case and its twin in `directory`, each for at most about `clock.limit`.
pub(super) fn judge(case: &Case, directory: &Path, clock: &Clock) -> Outcome {
    let (outcome, end) = witnessed(case, directory, clock);
    let Some(transform) = case.twin.filter(|_| matches!(outcome, Outcome::Done { .. } | Outcome::Failed(_)))
    else {
        return outcome;
    };
    let scene = match transform.of(&case.scene) {
        Ok(scene) => scene,
        Err(why) => return Outcome::Forbidden(format!("{transform:?}: {why}")),
    };
    let mut twin = Case { scene, ..case.clone() };
    // Frames in single precision cannot store numbers in all units.
    twin.scene.output.interval = None;
    let (of_twin, end_of_twin) = witnessed(&twin, &directory.join("twin"), clock);
    match of_twin {
        Outcome::Forbidden(why) => Outcome::Forbidden(format!("{transform:?}: {why}")),
        Outcome::OutOfTime => outcome,
        _ if matches!(transform, Transform::Moved(_)) => outcome,
        _ => match differs(&outcome, &end, &of_twin, &end_of_twin, &transform) {
            Some(why) => Outcome::Forbidden(format!("{transform:?}: {why}")),
            None => outcome,
        },
    }
}

/// Describes how the end of a scene in other units differs.
fn differs(
    outcome: &Outcome,
    end: &Witness<'_>,
    of_twin: &Outcome,
    end_of_twin: &Witness<'_>,
    transform: &Transform,
) -> Option<String> {
    // Values out of the range of frames end a run that writes frames.
    if end.is_beyond {
        return None;
    }
    if std::mem::discriminant(outcome) != std::mem::discriminant(of_twin) {
        return Some(format!("ended with {of_twin:?} instead of {outcome:?}"));
    }
    if end.steps != end_of_twin.steps {
        return Some(format!("ended after {} steps instead of {}", end_of_twin.steps, end.steps));
    }
    let (length, momentum) = (transform.factor([1, 0, 0]), transform.factor([1, 1, -1]));
    let is_same = end.states.iter().zip(&end_of_twin.states).all(|(own, twin)| {
        let same =
            |own: &[f64], twin: &[f64], factor: f64| own.iter().zip(twin).all(|(a, b)| a * factor == *b);
        same(&own.q, &twin.q, length) && same(&own.p, &twin.p, momentum)
    });
    (!is_same).then(|| "ended in another state".to_owned())
}

/// Runs a case in `directory`, for at most about `clock.limit`.
fn witnessed<'a>(case: &Case, directory: &Path, clock: &'a Clock) -> (Outcome, Witness<'a>) {
    let mut witness = Witness {
        deadline: Instant::now() + clock.limit,
        is_ended: &clock.is_ended,
        states: Vec::new(),
        steps: 0,
        wrong: None,
        is_beyond: false,
    };
    let outcome = run_and_judge(case, directory, &mut witness);
    (outcome, witness)
}

fn run_and_judge(case: &Case, directory: &Path, witness: &mut Witness<'_>) -> Outcome {
    let scene = case.scene.clone().interruptible(Interrupt::from(Arc::clone(witness.is_ended)));
    let ran = catch_unwind(AssertUnwindSafe(|| run(scene, "case", directory, witness)));
    let ran = match ran {
        Ok(ran) => ran,
        Err(payload) => {
            let said = payload.downcast_ref::<String>().map(String::as_str);
            let said = said.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("");
            return Outcome::Forbidden(format!("panic: {said}"));
        }
    };
    if let Some(wrong) = &witness.wrong {
        return Outcome::Forbidden(wrong.clone());
    }
    witness.is_beyond = matches!(ran, Err(RunError::Beyond { .. }));
    let failure = match ran {
        Ok(_) => None,
        Err(RunError::Scene(problems)) => {
            let first = problems.first().map(ToString::to_string).unwrap_or_default();
            return Outcome::Refused(first);
        }
        Err(error) if error.is_failure() => Some(error.to_string()),
        Err(error) => return Outcome::Forbidden(format!("output failed: {error}")),
    };
    match left_behind(case, directory, failure.is_some()) {
        Err(wrong) => Outcome::Forbidden(wrong),
        Ok(report) => match failure {
            Some(failure) => Outcome::Failed(failure),
            None if report["outcome"] == "interrupted" => Outcome::OutOfTime,
            None => Outcome::Done {
                was_cut: report["substeps"]["steps_cut"] != 0,
                was_guarded: report["guard"]["exceeded"] == true
                    || report["guard"]["events"].as_array().is_some_and(|events| !events.is_empty()),
            },
        },
    }
}

/// Reads every file again and compares; returns the report, or the contradiction found.
fn left_behind(case: &Case, directory: &Path, has_failed: bool) -> Result<Value, String> {
    let read = |name: &str| {
        std::fs::read_to_string(directory.join(name)).map_err(|error| format!("{name}: {error}"))
    };
    let report: Value = serde_json::from_str(&read("report.json")?).map_err(|error| error.to_string())?;
    let history = read("history.csv")?;
    let mut lines = history.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let column = |name: &str| names.iter().position(|other| *other == name).unwrap_or(0);
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for line in lines {
        let row: Result<Vec<f64>, _> = line.split(',').map(str::parse).collect();
        let row = row.map_err(|error| format!("history.csv: {error} in {line}"))?;
        // The smallest gap is infinite if no parts are in contact.
        let is_sound = |(name, value): (&&str, &f64)| value.is_finite() || *name == "smallest_gap";
        if row.len() != names.len() || !names.iter().zip(&row).all(is_sound) {
            return Err(format!("history.csv holds {line}"));
        }
        rows.push(row);
    }
    frames(directory)?;
    let steps = report["steps"].as_u64().unwrap_or(u64::MAX);
    let begun = !rows.is_empty();
    if begun && rows.len() as u64 != steps + 1 && !has_failed {
        return Err(format!("{steps} steps left {} rows", rows.len()));
    }
    if !begun && !has_failed {
        return Err("a run without rows".to_owned());
    }
    let h = report["h"].as_f64().unwrap_or(f64::NAN);
    for (n, row) in rows.iter().enumerate() {
        if (row[0] - n as f64 * h).abs() > 1e-9 * h * (n + 1) as f64 {
            return Err(format!("row {n} is at t = {:e}, h = {h:e}", row[0]));
        }
    }
    if begun {
        energy(case, &report, &rows, column)?;
    }
    if !has_failed && case.is_free {
        momentum(case, &report)?;
    }
    Ok(report)
}

/// Returns the relative error of the solution of implicit equations, in the energy norm; zero for explicit schemes.
fn tolerance(case: &Case) -> f64 {
    let asked = case.scene.solver.tolerance;
    let is_explicit = case.scene.time.method().is_some_and(|method| method.facts().is_explicit);
    let may_switch = case.scene.guard.as_ref().is_some_and(|guard| guard.action == GuardAction::Switch);
    match case.scene.time.scheme.unwrap_or(SchemeName::Auto) {
        // Energy–momentum conserves the energy only to first order in this error, so it uses a smaller tolerance.
        SchemeName::EnergyMomentum => 1e-5 * asked,
        _ if !is_explicit => asked,
        _ if may_switch => 1e-5 * asked,
        _ => 0.0,
    }
}

/// Checks that the momentum of a free body is conserved.
///
/// Elastic forces sum to zero, so that every scheme conserves momentum up to round-off and the residual of implicit
/// equations. A stage M w + c f = R with A = M + cK is solved to ‖R‖_{A⁻¹} ≤ η√(cE) for a tolerance η and the energy
/// E, which is at most nine times the initial energy of motion and deformation. K vanishes on rigid motions, so the
/// remaining net impulse, about |ΣR|/√c, is at most √m ‖R‖_{A⁻¹}/√c = η√(mE). This is η√(E/2T) times √(2mT), the
/// largest momentum of a mass m with energy T. In n steps the errors add up to n times this.
fn momentum(case: &Case, report: &Value) -> Result<(), String> {
    let number = |of: &str, name: &str| report[of][name].as_f64().unwrap_or(f64::NAN);
    let kinetic = number("energy", "largest_kinetic");
    // A body at rest moves only by the round-off of its forces, which gives no information on momentum.
    if kinetic <= number("guard", "resolution") {
        return Ok(());
    }
    let given = number("guard", "exchange").max(kinetic);
    let left = ESTIMATED * (4.5_f64).sqrt() * number("work", "steps") * tolerance(case);
    let bound = (1e-12 + left) * (given / kinetic).sqrt();
    let drift = number("momentum", "relative_linear_drift");
    if drift.is_nan() || drift > bound {
        return Err(format!("linear momentum of a free body drifts by {drift:e}, beyond {bound:e}"));
    }
    Ok(())
}

/// Checks, from the rows, whether energy was gained without a warning.
fn energy(
    case: &Case,
    report: &Value,
    rows: &[Vec<f64>],
    column: impl Fn(&str) -> usize,
) -> Result<(), String> {
    let [total, gravity] = ["total", "gravity"].map(&column);
    let (first, last) = (&rows[0], &rows[rows.len() - 1]);
    let was_guarded = report["guard"]["exceeded"] == true || report["guard"]["action"] != "warn";
    if !case.is_driven && !was_guarded {
        let given = rows.iter().map(|row| first[total] - row[gravity]).fold(0.0, f64::max);
        let growth = last[total] - first[total];
        let scale = rows.iter().flat_map(|row| &row[1..5]).fold(0.0_f64, |scale, part| scale.max(part.abs()));
        let noise = 1e-10 * scale + 2.0 * report["guard"]["resolution"].as_f64().unwrap_or(0.0);
        if growth > SILENT * given + noise {
            return Err(format!("energy grew by {growth:e} J of {given:e} J without a warning"));
        }
        // The work of the residuals is at most η√E times the size of the step in the energy norm. Kinetic and strain
        // energy count up to eight times each in this norm, and E is at most nine times the given energy.
        let steps = report["work"]["steps"].as_f64().unwrap_or(f64::NAN);
        let left = VIOLENT * (72.0_f64).sqrt() * steps * tolerance(case);
        if case.scene.time.scheme == Some(SchemeName::EnergyMomentum) && growth.abs() > left * given + noise {
            return Err(format!("energy-momentum: energy changed by {growth:e} J of {given:e} J"));
        }
    }
    Ok(())
}

/// Reads every frame; all numbers must be finite.
fn frames(directory: &Path) -> Result<(), String> {
    for entry in std::fs::read_dir(directory).map_err(|error| error.to_string())? {
        let path = entry.map_err(|error| error.to_string())?.path();
        if path.extension().is_none_or(|ending| ending != "vtu") {
            continue;
        }
        let frame = vi_io::read_mesh(&path).map_err(|error| error.to_string())?;
        let arrays = frame.point_data.iter().chain(&frame.cell_data);
        if arrays.flat_map(|array| &array.values).any(|value| !value.is_finite()) {
            return Err(format!("{} holds a number that is not finite", path.display()));
        }
    }
    Ok(())
}
