//! One component over one step of the run: as a whole, or in substeps of h/2, h/4 … h/1024 according to its pace. If bodies are
//! in contact, a substep of h/1024 that fails is divided further, down to h/2¹⁴.

use vi_core::{State, StepEnergy, System};
use vi_solvers::{Budget, Interrupt, SolverError, StepError, StepReport, Stepper};

use super::pace::{FLOOR, Pace, SMALLEST_APART};

/// Course of one step.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct March {
    pub(crate) iterations: u64,
    pub(crate) energy: StepEnergy,
    /// Substeps made; 0 if the step was not divided.
    pub(crate) substeps: u64,
    /// Largest number of equal parts into which the step was divided.
    pub(crate) finest: u32,
    /// Length of the longest substep made, in h/2¹⁴.
    pub(crate) longest: u32,
}

impl March {
    /// Adds the course of another step.
    pub(super) fn add(&mut self, other: Self) {
        self.iterations += other.iterations;
        self.energy += other.energy;
        self.substeps += other.substeps;
        self.finest = self.finest.max(other.finest);
        self.longest = self.longest.max(other.longest);
    }
}

/// Checks that the terms of the potential accept the state at the end of a step.
pub(crate) type Check<'a> = &'a mut dyn FnMut(&System, &State) -> Result<(), SolverError>;

/// Options for making a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cut<'a> {
    /// Initial number of parts, a power of two.
    pub(crate) parts: u32,
    /// Whether a part that fails may be divided; otherwise the step fails with it.
    pub(crate) further: bool,
    /// The request that abandons the step before its next part.
    pub(crate) interrupt: &'a Interrupt,
}

/// A stepper that accepts a step only if its end passes a check.
struct Checked<'a, 'b> {
    stepper: &'a mut dyn Stepper,
    check: Option<Check<'b>>,
}

impl Checked<'_, '_> {
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError> {
        let Some(check) = &mut self.check else { return self.stepper.step(system, state, h) };
        let before = state.clone();
        let report = self.stepper.step(system, state, h)?;
        match check(system, state) {
            Ok(()) => Ok(report),
            Err(cause) => {
                let t = before.t;
                *state = before;
                Err(StepError { t, h, cause })
            }
        }
    }
}

/// Number of new factors inside a substep from which on shorter substeps may cost less.
const DEAR: u64 = 2;

/// Returns whether shorter substeps may cost less than a substep with this report. The factors of contact depend on the
/// pairs that meet rather than on the length of the step.
fn is_expensive(report: &StepReport) -> bool {
    let work = &report.work;
    work.descents > 0 || (work.factorizations_slow >= DEAR && work.pair_forces == 0)
}

/// A step that failed, and the state from which its last part began.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) error: StepError,
    pub(crate) from: Box<State>,
}

/// A component on its course.
pub(crate) struct Course<'a> {
    pub(crate) stepper: &'a mut dyn Stepper,
    pub(crate) system: &'a System,
    pub(crate) state: &'a mut State,
    pub(crate) pace: &'a mut Pace,
}

/// Advances the state by h (s), to the time `end`.
///
/// # Errors
/// Returns the failure of the smallest substep tried; state and pace are then unchanged.
pub(crate) fn march(
    course: Course<'_>,
    h: f64,
    end: f64,
    cut: Cut<'_>,
    check: Option<Check<'_>>,
) -> Result<March, Failure> {
    let Course { stepper, system, state, pace } = course;
    let mut stepper = Checked { stepper, check };
    let mut done = March { finest: 1, ..March::default() };
    let (start, mut next) = (state.t, *pace);
    // A step that fails does not change the state, so a copy is needed only after a successful substep.
    let mut before: Option<State> = None;
    let largest = FLOOR / cut.parts;
    let smallest = if system.terms().live().is_empty() { SMALLEST_APART } else { 1 };
    let mut at = 0;
    while at < FLOOR {
        let size = if cut.further { next.size(largest) } else { largest };
        if size < FLOOR && before.is_none() {
            before = Some(state.clone());
        }
        stepper.stepper.set_budget(if cut.further { next.budget(smallest) } else { Budget::Unlimited });
        let part = h * (f64::from(size) / f64::from(FLOOR));
        let asked = cut.interrupt.check().map_err(|cause| StepError { t: state.t, h: part, cause });
        match asked.and_then(|()| stepper.step(system, state, part)) {
            Ok(report) => {
                done.iterations += u64::from(report.iterations);
                done.energy += report.energy;
                done.substeps += 1;
                done.finest = done.finest.max(FLOOR / size);
                done.longest = done.longest.max(size);
                at += size;
                state.t = start + h * (f64::from(at) / f64::from(FLOOR));
                let cost = match report.iterations {
                    0 => 0.0,
                    _ => stepper.stepper.unit_costs(system).seconds(&report.work),
                };
                next.succeed(at, largest, is_expensive(&report), cost);
            }
            Err(error) if cut.further && error.smaller_step_may_help() && next.fail(smallest) => {}
            Err(error) => {
                let from = match before {
                    Some(before) => std::mem::replace(state, before),
                    None => state.clone(),
                };
                return Err(Failure { error, from: Box::new(from) });
            }
        }
    }
    if done.substeps == 1 {
        done.substeps = 0;
    }
    state.t = end;
    *pace = next;
    Ok(done)
}
