//! The complete state of a simulation, apart from its scene, on which the next steps depend. Returning to a snapshot,
//! or continuing from it, gives bitwise the same results.

use vi_core::State;
use vi_solvers::{Method, SolverError, SolverOptions, StepperMemory, Work};

use super::adaptive::AdaptiveCounts;
use super::contact::ContactTotals;
use super::pace::{FLOOR, Pace};
use super::{Component, Simulation};
use crate::record::{self, Damage, record};

const MAGIC: &[u8; 8] = b"VI-STATE";
/// Version of the record; increase it with every change of the record.
const FORMAT: u64 = 13;

/// Largest number of parts into which [`Simulation::halve`] divides a step.
const MOST_PARTS: u32 = 1024;

/// Counts of steps that were cut into substeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Substeps {
    /// Steps that were cut.
    pub steps: u64,
    /// Number of substeps of these steps.
    pub substeps: u64,
    /// The smallest substep was h divided by this; 1 if no step was cut.
    pub finest: u64,
    /// Number of those cut steps that were only divided into the equal parts of [`Simulation::halve`], and not because
    /// they were hard to solve.
    pub halved: u64,
    /// Number of times that the step or the scheme of all further steps was changed after the start.
    pub changes: u64,
}

/// The state of a simulation between two steps.
#[derive(Debug, Clone, PartialEq)]
pub struct Snapshot {
    pub(super) steps: u64,
    pub(super) parts: u64,
    /// Length of the longest part of a step since the state that a run can go back to, in h/2¹⁴.
    pub(super) longest: u64,
    pub(super) switched: bool,
    pub(super) components: Vec<(State, Option<StepperMemory>)>,
    pub(super) paces: Vec<Pace>,
    pub(super) work: Work,
    pub(super) substeps: Substeps,
    pub(super) adaptive: AdaptiveCounts,
    /// Energy from [`Simulation::set_motion`] that no step has booked yet, J.
    pub(super) given: f64,
    pub(super) contact: ContactTotals,
}

record!(Substeps { steps: u64, substeps: u64, finest: u64, halved: u64, changes: u64 });
record!(Snapshot {
    steps: u64,
    parts: u64,
    longest: u64,
    switched: bool,
    components: Vec<(State, Option<StepperMemory>)>,
    paces: Vec<Pace>,
    work: Work,
    substeps: Substeps,
    adaptive: AdaptiveCounts,
    given: f64,
    contact: ContactTotals,
});

impl Snapshot {
    /// Steps made.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// Returns the snapshot as bytes, with a checksum.
    pub fn to_bytes(&self) -> Vec<u8> {
        record::seal(MAGIC, FORMAT, self)
    }

    /// Reads a snapshot from the bytes of [`Snapshot::to_bytes`].
    ///
    /// # Errors
    /// Returns [`Damage`] if the bytes are damaged or from another version of the program.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Damage> {
        record::unseal(MAGIC, FORMAT, bytes)
    }
}

impl Simulation {
    /// Returns the complete state, apart from the scene, on which the next steps depend.
    pub fn snapshot(&self) -> Snapshot {
        let of = |component: &Component| {
            (component.state.clone(), component.stepper.as_ref().map(|stepper| stepper.memory()))
        };
        self.snapshot_of(self.components.iter().map(of).collect())
    }

    /// Returns a snapshot for [`Simulation::go_back`] alone, which replaces an earlier one. It is without the states that other processes
    /// keep ([`vi_solvers::Stepper::keep`]).
    ///
    /// # Errors
    /// Returns the errors of [`vi_solvers::Stepper::keep`].
    pub(crate) fn keep(&mut self) -> Result<Snapshot, SolverError> {
        let of = |component: &mut Component| {
            let Component { state, stepper, .. } = component;
            let is_elsewhere = stepper.as_mut().map_or(Ok(false), |stepper| stepper.keep(state))?;
            Ok(match is_elsewhere {
                true => (State { t: state.t, q: Vec::new(), p: Vec::new() }, None),
                false => (state.clone(), stepper.as_ref().map(|stepper| stepper.memory())),
            })
        };
        let components = self.components.iter_mut().map(of).collect::<Result<_, SolverError>>()?;
        self.longest_since_kept = 0;
        Ok(self.snapshot_of(components))
    }

    fn snapshot_of(&self, components: Vec<(State, Option<StepperMemory>)>) -> Snapshot {
        Snapshot {
            steps: self.steps,
            parts: u64::from(self.parts),
            longest: u64::from(self.longest_since_kept),
            switched: self.switched,
            components,
            paces: self.components.iter().map(|component| component.pace).collect(),
            work: self.work(),
            substeps: self.substeps,
            adaptive: self.adaptive_counts,
            given: self.given,
            contact: self.contact,
        }
    }

    /// Sets the state to that of an equal simulation; the next steps are bitwise the same.
    ///
    /// # Errors
    /// Returns [`SolverError`] if the snapshot belongs to another scene; the simulation must not be used afterwards.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), SolverError> {
        let count = self.components.len();
        if snapshot.components.len() != count || snapshot.paces.len() != count {
            return Err(SolverError::Memory { missing: "number of systems" });
        }
        if !snapshot.paces.iter().all(Pace::is_sound) {
            return Err(SolverError::Memory { missing: "lengths of substeps" });
        }
        let parts = u32::try_from(snapshot.parts).ok().filter(|&parts| {
            parts.is_power_of_two() && parts <= MOST_PARTS && snapshot.steps <= self.step_count
        });
        self.parts = parts.ok_or(SolverError::Memory { missing: "number of steps" })?;
        let longest = u32::try_from(snapshot.longest).ok().filter(|&longest| longest <= FLOOR);
        self.longest_since_kept = longest.ok_or(SolverError::Memory { missing: "lengths of substeps" })?;
        if snapshot.switched != self.switched {
            let method = if snapshot.switched { Method::EnergyMomentum } else { self.method };
            self.set_steppers(method)?;
            self.switched = snapshot.switched;
        }
        for (component, &pace) in self.components.iter_mut().zip(&snapshot.paces) {
            component.pace = pace;
        }
        for (component, (state, memory)) in self.components.iter_mut().zip(&snapshot.components) {
            if let (Some(stepper), None) = (&mut component.stepper, memory) {
                // Other processes keep the state, or the snapshot belongs to another scene.
                stepper.go_back(&mut component.state)?;
                continue;
            }
            if [&state.q, &state.p].iter().any(|values| values.len() != component.state.q.len()) {
                return Err(SolverError::Memory { missing: "state of this system" });
            }
            component.state = state.clone();
            match (&mut component.stepper, memory) {
                (Some(stepper), Some(memory)) => stepper.restore(&component.system, memory)?,
                (None, None) => {}
                _ => return Err(SolverError::Memory { missing: "stepper" }),
            }
        }
        self.steps = snapshot.steps;
        self.earlier_work = snapshot.work;
        self.substeps = snapshot.substeps;
        self.adaptive_counts = snapshot.adaptive;
        self.given = snapshot.given;
        self.contact = snapshot.contact;
        Ok(())
    }

    /// Returns a snapshot of [`Simulation::keep`] with the states that other processes keep, so that it can be written to a file.
    ///
    /// # Errors
    /// Returns the errors of [`Simulation::restore`].
    pub(crate) fn completed(&mut self, kept: Snapshot) -> Result<Snapshot, SolverError> {
        let mut components = self.components.iter().zip(&kept.components);
        if components.all(|(component, (_, memory))| component.stepper.is_some() == memory.is_some()) {
            return Ok(kept);
        }
        let now = self.snapshot();
        self.restore(&kept)?;
        let whole = self.snapshot();
        self.restore(&now)?;
        Ok(whole)
    }

    /// Returns to a snapshot; the work of the discarded steps remains counted, and the longest of their parts known to
    /// [`Simulation::halve`].
    ///
    /// # Errors
    /// Returns the errors of [`Simulation::restore`].
    pub(crate) fn go_back(&mut self, snapshot: &Snapshot) -> Result<(), SolverError> {
        let (work, longest) = (self.work(), self.longest_since_kept);
        self.restore(snapshot)?;
        (self.earlier_work, self.longest_since_kept) = (work, longest);
        Ok(())
    }

    /// Divides every further step into parts that are half as long as the longest part made since the start, or since the state
    /// that a run can go back to: parts of the same length would only repeat its steps. Returns false if parts are already h/1024.
    pub fn halve(&mut self) -> bool {
        let longest = match self.longest_since_kept {
            0 => FLOOR / self.parts,
            made => made.min(FLOOR / self.parts),
        };
        let can = self.parts < MOST_PARTS;
        self.parts = (2 * FLOOR / longest).min(MOST_PARTS);
        self.substeps.changes += u64::from(self.steps > 0);
        can
    }

    /// Returns the current step, s: h, or its part after [`Simulation::halve`].
    pub fn part(&self) -> f64 {
        self.h / f64::from(self.parts)
    }

    /// Switches to the scheme `energy-momentum`.
    ///
    /// # Errors
    /// Returns [`SolverError`] if a force of the scene does not allow this; nothing has then changed.
    pub fn switch(&mut self) -> Result<(), SolverError> {
        let work = self.work();
        self.set_steppers(Method::EnergyMomentum)?;
        self.earlier_work = work;
        self.switched = true;
        self.substeps.changes += u64::from(self.steps > 0);
        Ok(())
    }

    /// Returns whether the simulation was switched to `energy-momentum`.
    pub fn is_switched(&self) -> bool {
        self.switched
    }

    fn set_steppers(&mut self, method: Method) -> Result<(), SolverError> {
        let make = |component: &Component| {
            let needed = component.stepper.is_some();
            let options = SolverOptions { ledger: component.keeps_ledger, ..self.options.clone() };
            needed.then(|| vi_solvers::stepper(&method, &component.system, &options)).transpose()
        };
        let steppers = self.components.iter().map(make).collect::<Result<Vec<_>, _>>()?;
        for (component, stepper) in self.components.iter_mut().zip(steppers) {
            component.stepper = stepper;
        }
        Ok(())
    }
}
