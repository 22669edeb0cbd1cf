//! All components of a simulation over one step of the run, or over several steps without output between them.

use rayon::prelude::*;
use vi_core::{State, StepEnergy, System};
use vi_solvers::{Assembler, HeldWork, Interrupt, SolverError, StepError};

use super::adaptive::{AdaptiveCounts, StepDemand};
use super::march::{self, Course, Cut, Failure, March, march};
use super::pace::{FLOOR, Pace};
use super::{Component, ContactFacts, Simulation};

/// Largest number of steps that are made together, so that a caller can interrupt.
pub(crate) const TOGETHER: u64 = 16;

/// Outcome of one step of all components.
#[derive(Debug, Clone, Copy, Default)]
pub struct Stepped {
    /// Newton iterations.
    pub iterations: u64,
    /// Contributions to the change of energy, J (if the ledger is kept; the prescribed work always).
    pub energy: vi_core::StepEnergy,
    /// Substeps of all components; 0 if no step was divided.
    pub substeps: u64,
    /// Adaptive steps of all components; 0 if steps are equal.
    pub adaptive_steps: u64,
}

impl Simulation {
    /// Advances every component by one step, in substeps if the whole step fails and the scene allows them.
    ///
    /// # Errors
    /// Returns the [`StepError`] of the first component that failed; all states are then as before. This also holds for a step that
    /// was abandoned on request ([`SolverError::Interrupted`]). After
    /// [`Simulation::restore`] of a snapshot from before the step, the next steps have the same bits as without it.
    pub fn step(&mut self) -> Result<Stepped, StepError> {
        if self.load_factor().is_some() {
            return self.step_along_path();
        }
        let (h, is_static) = (self.h, self.scene.statics.is_some());
        let end = (self.steps + 1) as f64 * h;
        // Statics divides its increments itself.
        // Explicit contact is not divided either: each change of a step near its stability limit adds energy.
        let further = self.scene.time.substeps && !is_static && !self.has_explicit_contact();
        // A step that is short anyway is not abandoned between its parts: what steppers remember was not kept.
        let never = Interrupt::NEVER;
        let interrupt = if self.needs_return() { &self.options.interrupt } else { &never };
        let cut = Cut { parts: self.parts, further, interrupt };
        let adaptive = self.adaptive;
        let advance = |component: &mut Component| -> Result<(March, AdaptiveCounts), Failure> {
            let Component {
                system, state, stepper, held, pace, observer, has_domain, demand, driven, ..
            } = component;
            let Some(stepper) = stepper else {
                let energy = hold(held, system, state, end);
                return Ok((March { energy, ..March::default() }, AdaptiveCounts::default()));
            };
            // Not all schemes evaluate the end of a step: implicit midpoint only evaluates its middle.
            let unseen = *has_domain && !is_static && !stepper.sees_end();
            let mut check = |system: &System, state: &State| {
                let assembler = observer.get_or_insert_with(|| Assembler::new(system));
                accepts(assembler, system, state)
            };
            let check: Option<march::Check<'_>> = if unseen { Some(&mut check) } else { None };
            let course = Course { stepper: stepper.as_mut(), system, state, pace };
            match &adaptive {
                Some(rule) => {
                    let demand = demand.get_or_insert_with(|| StepDemand::new(system, driven));
                    rule.advance(course, demand, (h, end), cut, check)
                }
                None => Ok((march(course, h, end, cut, check)?, AdaptiveCounts::default())),
            }
        };
        let mut total = Stepped::default();
        let mut finest = self.parts;
        for (number, result) in on_all(&mut self.components, advance).into_iter().enumerate() {
            let (done, counts) =
                result.map_err(|failure| self.explain(number, failure.error, &failure.from))?;
            total.iterations += done.iterations;
            total.energy += done.energy;
            total.substeps += done.substeps;
            finest = finest.max(done.finest);
            self.longest_since_kept = self.longest_since_kept.max(done.longest);
            total.adaptive_steps += counts.steps;
            self.adaptive_counts.add(counts);
        }
        if total.substeps > 0 {
            self.substeps.steps += 1;
            self.substeps.substeps += total.substeps;
            // Adaptive steps are made in the equal parts of `halve` without being cut.
            self.substeps.halved += u64::from(finest == self.parts && adaptive.is_none());
            self.substeps.finest = self.substeps.finest.max(u64::from(finest));
        }
        total.energy.force += std::mem::take(&mut self.given);
        self.steps += 1;
        self.see_contact(&total.energy);
        Ok(total)
    }

    /// Returns whether the simulation must return to a snapshot if the next step is abandoned on request, because steppers may
    /// then remember a part of it. A single explicit step is abandoned only while it resolves contact, and then undone.
    pub(crate) fn needs_return(&self) -> bool {
        let is_short = self.scene.statics.is_none()
            && self.method.facts().is_explicit
            && !self.switched
            && self.adaptive.is_none()
            && self.parts == 1
            && self.components.iter().all(|component| component.pace.is_whole())
            && (self.scene.contact.is_none() || self.components.len() == 1);
        self.options.interrupt.is_possible() && !is_short
    }

    /// Returns whether the scene has contact and an explicit scheme.
    pub(crate) fn has_explicit_contact(&self) -> bool {
        self.scene.contact.is_some() && self.scene.statics.is_none() && self.method.facts().is_explicit
    }

    /// Returns whether friction or damping may take energy, so that a run backwards does not come back to its start.
    pub(crate) fn may_dissipate(&self) -> bool {
        let contact = self.scene.contact.as_ref();
        let depends =
            |component: &Component| component.system.forces().iter().any(|force| force.depends_on_velocity());
        contact.is_some_and(|contact| contact.has_friction() || contact.is_damped())
            || self.components.iter().any(depends)
    }

    /// Records gaps and forces after a step.
    fn see_contact(&mut self, energy: &vi_core::StepEnergy) {
        self.contact.friction += energy.friction;
        self.contact.damping += energy.contact_damping;
        let needs_forces = self.scene.probes.iter().any(|probe| probe.between.is_some());
        let mut facts = ContactFacts::default();
        for component in &mut self.components {
            let Component { system, state, stepper, contact, .. } = component;
            if let (Some(contact), Some(stepper)) = (contact, stepper) {
                match stepper.take_impulses() {
                    Some(impulses) => contact.enter(impulses, self.h),
                    None if needs_forces => contact.enter_forces_at(&system.positions(state)),
                    None => {}
                }
                // Only a scheme that does not act by discrete gradients leaves the gap to be measured.
                match stepper.take_smallest_gap() {
                    Some(gap) => facts.smallest_gap = facts.smallest_gap.min(gap),
                    None => facts.add(contact, &system.positions(state)),
                }
            }
        }
        self.contact.smallest_gap = self.contact.smallest_gap.min(facts.smallest_gap);
    }

    /// Makes a step along a path of equilibria. One component finds the load factor; the others have no free
    /// coordinate.
    fn step_along_path(&mut self) -> Result<Stepped, StepError> {
        let h = self.h;
        let mut stepped = Stepped::default();
        for number in 0..self.components.len() {
            let Component { system, state, stepper, .. } = &mut self.components[number];
            if let Some(stepper) = stepper {
                let report = match stepper.step(system, state, h) {
                    Ok(report) => report,
                    Err(error) => {
                        let from = state.clone();
                        return Err(self.explain(number, error, &from));
                    }
                };
                stepped.iterations += u64::from(report.iterations);
                stepped.energy += report.energy;
            }
        }
        let load_factor = self.load_factor().unwrap_or_default();
        for Component { system, state, held, .. } in &mut self.components {
            stepped.energy += hold(held, system, state, load_factor);
        }
        stepped.energy.force += std::mem::take(&mut self.given);
        self.steps += 1;
        self.see_contact(&stepped.energy);
        Ok(stepped)
    }

    /// Advances every component by one step, or by up to `most` together if that is cheaper. The results are bitwise
    /// those of [`Simulation::step`].
    ///
    /// # Errors
    /// Returns the errors of [`Simulation::step`].
    pub fn advance(&mut self, most: u64) -> Result<Stepped, StepError> {
        let count = most.min(TOGETHER).min(self.step_count.saturating_sub(self.steps));
        if count > 1 && self.steps_together(count as u32) {
            return Ok(Stepped::default());
        }
        self.step()
    }

    /// Makes `count` steps together; returns false, without changes, if a component does not support this.
    fn steps_together(&mut self, count: u32) -> bool {
        let (h, end) = (self.h, (self.steps + u64::from(count)) as f64 * self.h);
        if self.parts > 1
            || self.given != 0.0
            || self.adaptive.is_some()
            || !self.components.iter().all(joins_steps)
        {
            return false;
        }
        let advance = |component: &mut Component| -> Result<(), ()> {
            let Component { system, state, stepper, pace, .. } = component;
            if let Some(stepper) = stepper {
                stepper.steps(system, state, h, count).ok_or(())?;
                pace.walk(count);
            }
            state.t = end;
            Ok(())
        };
        if on_all(&mut self.components, advance).iter().any(Result::is_err) {
            return false;
        }
        self.steps += u64::from(count);
        self.longest_since_kept = FLOOR;
        true
    }
}

/// Advances every component. If one fails, all are restored; the failed one must be unchanged itself.
fn on_all<T: Send, E: Send>(
    components: &mut [Component],
    advance: impl Fn(&mut Component) -> Result<T, E> + Send + Sync,
) -> Vec<Result<T, E>> {
    if let [component] = components {
        return vec![advance(component)];
    }
    let before: Vec<(State, Pace)> = components.iter().map(|c| (c.state.clone(), c.pace)).collect();
    // Components whose terms other processes share must not be evaluated at the same time.
    let is_shared = |component: &Component| component.system.terms().shared().is_some();
    let results: Vec<_> = if components.iter().any(is_shared) {
        components.iter_mut().map(advance).collect()
    } else {
        components.par_iter_mut().map(advance).collect()
    };
    if results.iter().any(Result::is_err) {
        for (component, before) in components.iter_mut().zip(before) {
            (component.state, component.pace) = before;
        }
    }
    results
}

/// Moves a component without a free coordinate to the time `end`; returns the work on it, J, if it is booked.
fn hold(held: &mut Option<Box<HeldWork>>, system: &System, state: &mut State, end: f64) -> StepEnergy {
    let from = std::mem::replace(&mut state.t, end);
    held.as_mut().map(|held| held.over(system, from, end)).unwrap_or_default()
}

/// Returns whether several steps of a component are cheaper together, without observation of each.
fn joins_steps(component: &Component) -> bool {
    let Component { system, stepper, held, pace, has_domain, .. } = component;
    let Some(stepper) = stepper else { return held.is_none() };
    let unseen = *has_domain && !stepper.sees_end();
    !unseen && pace.is_whole() && stepper.joins_steps(system)
}

/// Checks that all terms have a finite energy at a state. The step to it had a free path.
fn accepts(assembler: &mut Assembler, system: &System, state: &State) -> Result<(), SolverError> {
    let x = system.positions(state);
    if assembler.is_in_domain_after_free_path(&x, state.t) {
        return Ok(());
    }
    Err(match assembler.fault(&x, state.t) {
        Some(term) => SolverError::Term { term, at_start: false },
        None => SolverError::NotFinite { what: "energy", dof: 0, at_start: false },
    })
}
