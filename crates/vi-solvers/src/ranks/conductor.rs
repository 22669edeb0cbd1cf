//! The stepper of the first of several ranks that make explicit steps together: it looks like the stepper of one process.
//!
//! It hands the state out to all ranks, lets them step, and collects the state. If a step fails on any rank, no state
//! has changed, and the stepper of one process repeats the step: its error names the element that failed.

use std::sync::Arc;

use vi_core::{Coordinates, State, StepEnergy, System};

use crate::assemble::evaluator::TimeDependence;
use crate::error::SolverError;
use crate::memory::{StepperMemory, expect_method};
use crate::options::SolverOptions;
use crate::ranks::command::Command;
use crate::ranks::layout::RankCoordinates;
use crate::ranks::member::Member;
use crate::ranks::partners::Partners;
use crate::schemes::method::{Method, stepper};
use crate::schemes::stepper::{StepError, StepReport, Stepper};
use crate::work::Work;

/// Returns the stepper of a system whose terms `partners` share, for the first rank.
///
/// # Errors
/// Returns the errors of [`stepper`].
pub fn stepper_of_ranks(
    method: &Method,
    system: &System,
    options: &SolverOptions,
    partners: &Arc<Partners>,
) -> Result<Box<dyn Stepper>, SolverError> {
    if !partners.make_steps() {
        return stepper(method, system, options);
    }
    method.check(system)?;
    let memory = StepperMemory { method: method.name().to_owned(), ..StepperMemory::default() };
    Ok(Box::new(Conductor {
        method: *method,
        options: options.clone(),
        partners: Arc::clone(partners),
        coordinates: Arc::clone(system.terms().shared_coordinates()),
        is_autonomous: TimeDependence::of(system).is_none,
        there: None,
        kept: None,
        memory,
        repeated: Work::default(),
        before: Work::default(),
    }))
}

/// Returns 64 bits of a state. A state with one other number has another digest, and states with several others too, but for one
/// in 10¹⁹.
fn digest(state: &State) -> u64 {
    // Each number changes the digest one-to-one: an odd factor has an inverse.
    let mix = |digest: u64, bits: u64| (digest.rotate_left(5) ^ bits).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let both = |[a, b]: [u64; 2], (q, p): (&f64, &f64)| [mix(a, q.to_bits()), mix(b, p.to_bits())];
    let [a, b] = state.q.iter().zip(&state.p).fold([0; 2], both);
    mix(a, b)
}

/// Steps a component by several ranks. It keeps no copy of their state, which takes 48 bytes per node.
struct Conductor {
    method: Method,
    options: SolverOptions,
    partners: Arc<Partners>,
    coordinates: Arc<Coordinates>,
    /// Whether nothing depends on the time.
    is_autonomous: bool,
    /// The digest of the state of the ranks; `None` if they have none yet.
    there: Option<u64>,
    /// The time of the state to which they can go back, s; `None` if they keep none.
    kept: Option<f64>,
    /// The memory that the ranks need together with their next state, as long as they have no state.
    memory: StepperMemory,
    /// Work of steps that were repeated, less that of the member before the last restart.
    repeated: Work,
    before: Work,
}

impl Conductor {
    /// Gives the ranks their portions of a state.
    fn send_state(&mut self, state: &State) -> Result<(), SolverError> {
        let memory = if self.there.is_some() { &StepperMemory::default() } else { &self.memory };
        let x = memory.array("forces.x").ok();
        let evaluated = match x {
            Some(_) => {
                let t = memory.array("forces.t")?.first().copied();
                let t = t.ok_or(SolverError::Memory { missing: "forces.t" })?;
                Some((t, memory.count("forces.gradient")? == 1))
            }
            None => None,
        };
        let of_rank = |held: &RankCoordinates| -> Vec<f64> {
            let count = 2 * held.free().count() + if x.is_some() { held.dofs().count() } else { 0 };
            let mut numbers = Vec::with_capacity(count);
            numbers.extend(held.free().map(|k| state.q[k]));
            numbers.extend(held.free().map(|k| state.p[k]));
            numbers.extend(x.iter().flat_map(|x| held.dofs().map(|dof| x[dof])));
            numbers
        };
        let partners = &self.partners;
        partners.command(Command::Place { evaluated });
        partners.send(partners.held(), of_rank);
        partners.member().place(&of_rank(&partners.held()[0]), evaluated);
        self.there = Some(digest(state));
        self.memory = StepperMemory { method: std::mem::take(&mut self.memory.method), ..Default::default() };
        Ok(())
    }

    /// Lets the ranks make steps, and collects the state; returns false, without changes, if any of them failed.
    fn step_together(&mut self, state: &mut State, h: f64, count: u32) -> Result<bool, SolverError> {
        if self.there != Some(digest(state)) {
            self.send_state(state)?;
        }
        let (t, partners) = (state.t, &self.partners);
        let mut member = partners.member();
        partners.command(Command::Steps { t, h, count });
        if !member.steps(t, h, count) {
            return Ok(false);
        }
        state.t = member.state().t;
        let State { q: all_q, p: all_p, .. } = state;
        self.collect(&member, |k, q, p| (all_q[k], all_p[k]) = (q, p));
        self.there = Some(digest(state));
        Ok(true)
    }

    /// Receives the states of all ranks, which send them; `member` is that of the first. Calls `enter` with the number of each free
    /// coordinate, its value and its momentum.
    fn collect(&self, member: &Member, mut enter: impl FnMut(usize, f64, f64)) {
        let (partners, own) = (&self.partners, member.state());
        let mut enter_all = |held: &RankCoordinates, q: &[f64], p: &[f64]| {
            held.free().zip(q).zip(p).for_each(|((k, &q), &p)| enter(k, q, p));
        };
        enter_all(&partners.held()[0], &own.q, &own.p);
        partners.receive(
            partners.held(),
            |held| 2 * held.free().count(),
            |held, numbers| {
                let (q, p) = numbers.split_at(numbers.len() / 2);
                enter_all(held, q, p);
            },
        );
    }

    fn report(&self, before: Work) -> StepReport {
        StepReport { iterations: 0, energy: StepEnergy::default(), work: self.work() - before }
    }
}

impl Stepper for Conductor {
    fn step(&mut self, system: &System, state: &mut State, h: f64) -> Result<StepReport, StepError> {
        let before = self.work();
        let t = state.t;
        let failed = |cause| StepError { t, h, cause };
        if self.step_together(state, h, 1).map_err(failed)? {
            return Ok(self.report(before));
        }
        let mut alone = stepper(&self.method, system, &self.options).map_err(failed)?;
        alone.restore(system, &self.memory()).map_err(failed)?;
        // One process makes two attempts before it looks for the cause; its counts of work include them.
        let mut result = alone.step(system, state, h);
        for _ in 0..2 {
            result = result.or_else(|_| alone.step(system, state, h));
        }
        self.repeated += alone.work();
        (self.there, self.memory) = (None, alone.memory());
        result
    }

    fn joins_steps(&self, _system: &System) -> bool {
        self.is_autonomous
    }

    fn steps(&mut self, system: &System, state: &mut State, h: f64, count: u32) -> Option<StepReport> {
        let before = self.work();
        let joined = self.joins_steps(system) && self.step_together(state, h, count).unwrap_or(false);
        joined.then(|| self.report(before))
    }

    fn work(&self) -> Work {
        let mut total = self.partners.member().work() - self.before;
        total += self.repeated;
        total
    }

    fn memory(&self) -> StepperMemory {
        if self.there.is_none() {
            return self.memory.clone();
        }
        let mut memory = StepperMemory { method: self.memory.method.clone(), ..StepperMemory::default() };
        let member = self.partners.member();
        if let Some((t, knows)) = member.evaluated() {
            // The ranks have moved the free coordinates to the end of the step, and the others to the time t.
            self.partners.command(Command::State);
            let (mut x, free) = (vec![0.0; self.coordinates.dof_count()], self.coordinates.free());
            self.collect(&member, |k, q, _| x[free[k] as usize] = q);
            self.coordinates.place_prescribed(t, &mut x);
            memory.arrays = vec![("forces.x".into(), x), ("forces.t".into(), vec![t])];
            memory.counts = vec![("forces.gradient".into(), u64::from(knows))];
        }
        memory
    }

    fn restore(&mut self, _system: &System, memory: &StepperMemory) -> Result<(), SolverError> {
        expect_method(memory, self.method.name())?;
        let is_whole = |x: &[f64]| x.len() == self.coordinates.dof_count();
        if !memory.array("forces.x").map_or(true, is_whole) {
            return Err(SolverError::Memory { missing: "forces.x" });
        }
        (self.there, self.memory) = (None, memory.clone());
        (self.repeated, self.before) = (Work::default(), self.partners.member().work());
        Ok(())
    }

    fn keep(&mut self, state: &State) -> Result<bool, SolverError> {
        if self.there != Some(digest(state)) {
            self.send_state(state)?;
        }
        let mut member = self.partners.member();
        self.partners.command(Command::Keep);
        member.keep();
        self.kept = Some(state.t);
        Ok(true)
    }

    fn go_back(&mut self, state: &mut State) -> Result<(), SolverError> {
        state.t = self.kept.ok_or(SolverError::Memory { missing: "a state to go back to" })?;
        let mut member = self.partners.member();
        self.partners.command(Command::GoBack);
        member.go_back();
        let State { q: all_q, p: all_p, .. } = state;
        self.collect(&member, |k, q, p| (all_q[k], all_p[k]) = (q, p));
        let before = member.work();
        drop(member);
        (self.repeated, self.before, self.there) = (Work::default(), before, Some(digest(state)));
        Ok(())
    }

    fn sees_end(&self) -> bool {
        match &self.there {
            Some(_) => self.partners.member().evaluated().is_some_and(|(_, knows)| knows),
            None => self.memory.count("forces.gradient").is_ok_and(|count| count == 1),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The digest tells states apart that differ in a single bit, or in the places of their numbers.
    #[test]
    fn other_states_have_other_digests() {
        let numbers: Vec<f64> = (0..30).map(|k| f64::from(k) / 3.0).collect();
        let state = State { t: 0.0, q: numbers.clone(), p: numbers };
        let mut digests = vec![digest(&state)];
        for k in 0..30 {
            for bit in [0, 1, 31, 52, 63] {
                let flip = |x: &mut f64| *x = f64::from_bits(x.to_bits() ^ 1 << bit);
                let (mut moved, mut pushed) = (state.clone(), state.clone());
                flip(&mut moved.q[k]);
                flip(&mut pushed.p[k]);
                digests.extend([digest(&moved), digest(&pushed)]);
            }
        }
        for k in 1..30 {
            let mut exchanged = state.clone();
            exchanged.q.swap(k - 1, k);
            digests.push(digest(&exchanged));
        }
        let count = digests.len();
        digests.sort_unstable();
        digests.dedup();
        assert_eq!(digests.len(), count);
        assert_eq!(digest(&state), digest(&State { t: 1.0, ..state.clone() }));
    }
}
