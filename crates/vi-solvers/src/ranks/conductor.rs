//! The stepper of the first of several ranks: it looks like the stepper of one process.
//!
//! It hands the state out to all ranks, lets them step, and collects the state. If a step fails on any rank, no state
//! has changed, and the stepper of one process repeats the step: its error names the element that failed.

use std::sync::Arc;

use vi_core::{Coordinates, Exchange, Message, State, StepEnergy, System};

use crate::error::SolverError;
use crate::memory::StepperMemory;
use crate::ranks::command::Command;
use crate::ranks::member::{Held, Member};
use crate::schemes::method::Method;
use crate::schemes::stepper::{StepError, StepReport, Stepper};
use crate::work::Work;

/// Steps a component by several ranks.
pub struct Conductor {
    /// The stepper of one process.
    alone: Box<dyn Stepper>,
    member: Member,
    /// The coordinates of each rank.
    held: Vec<Held>,
    exchange: Arc<dyn Exchange>,
    /// Number of the component.
    component: usize,
    coordinates: Arc<Coordinates>,
    /// The state of the ranks; `None` if they have none yet.
    there: Option<State>,
    /// What the ranks must know beside their next state, if they have none.
    memory: StepperMemory,
    /// Work of steps that were repeated, less that of the member before the last restart.
    repeated: Work,
    before: Work,
}

impl Conductor {
    /// Returns the stepper of component number `component`. `alone` is the stepper of one process for the same system
    /// and method.
    ///
    /// # Errors
    /// Returns [`SolverError::Ranks`] if several ranks cannot step the system by this method.
    pub fn new(
        alone: Box<dyn Stepper>,
        (component, system, start): (usize, &System, &State),
        (method, keeps_ledger): (&Method, bool),
        exchange: Arc<dyn Exchange>,
    ) -> Result<Self, SolverError> {
        let (member, held) = Member::with_held(system, start, (method, keeps_ledger), Arc::clone(&exchange))?;
        let memory = StepperMemory { method: method.name().to_owned(), ..StepperMemory::default() };
        let coordinates = Arc::clone(system.terms().shared_coordinates());
        let (repeated, before) = (Work::default(), Work::default());
        Ok(Self {
            alone,
            member,
            held,
            exchange,
            component,
            coordinates,
            there: None,
            memory,
            repeated,
            before,
        })
    }

    /// Returns the number of bytes that the first rank sends to others per evaluation of forces.
    pub fn bytes_sent(&mut self) -> usize {
        self.member.bytes_sent()
    }

    fn command(&self, command: Command) {
        self.exchange.pieces(&command.encode(self.component));
    }

    /// Exchanges messages with all other ranks that hold something: sends what `send` gives for a rank, and receives as
    /// many numbers as `receive` says.
    fn talk(&self, send: impl Fn(&Held) -> Vec<f64>, receive: impl Fn(&Held) -> usize) -> Vec<Message> {
        let message = |(rank, held): (usize, &Held)| Message {
            rank,
            send: send(held),
            receive: vec![0.0; receive(held)],
        };
        let mut messages: Vec<Message> = self.held.iter().enumerate().skip(1).map(message).collect();
        self.exchange.slots(&mut messages, &mut || {});
        messages
    }

    /// Gives the ranks their portions of a state.
    fn hand_out(&mut self, state: &State) -> Result<(), SolverError> {
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
        let of_rank = |held: &Held| -> Vec<f64> {
            let of = |values: &[f64]| -> Vec<f64> { held.free.iter().map(|&k| values[k as usize]).collect() };
            let x = x.map_or_else(Vec::new, |x| held.dofs().map(|dof| x[dof]).collect());
            [of(&state.q), of(&state.p), x].concat()
        };
        let own = of_rank(&self.held[0]);
        self.command(Command::Place { evaluated });
        self.talk(of_rank, |_| 0);
        self.member.place(&own, evaluated);
        self.there = Some(state.clone());
        self.memory = StepperMemory { method: std::mem::take(&mut self.memory.method), ..Default::default() };
        Ok(())
    }

    /// Lets the ranks make steps, and collects the state; returns false, without changes, if any of them failed.
    fn together(&mut self, state: &mut State, h: f64, count: u32) -> Result<bool, SolverError> {
        if !self.there.as_ref().is_some_and(|there| there.q == state.q && there.p == state.p) {
            self.hand_out(state)?;
        }
        let t = state.t;
        self.command(Command::Steps { t, h, count });
        if !self.member.steps(t, h, count) {
            return Ok(false);
        }
        let messages = self.talk(|_| Vec::new(), |held| 2 * held.free.len());
        let own = self.member.state();
        let portions = std::iter::once((&own.q[..], &own.p[..]))
            .chain(messages.iter().map(|message| message.receive.split_at(message.receive.len() / 2)));
        for (held, (q, p)) in self.held.iter().zip(portions) {
            for ((&k, &q), &p) in held.free.iter().zip(q).zip(p) {
                (state.q[k as usize], state.p[k as usize]) = (q, p);
            }
        }
        state.t = own.t;
        if let Some(there) = &mut self.there {
            there.clone_from(state);
        }
        Ok(true)
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
        if self.together(state, h, 1).map_err(failed)? {
            return Ok(self.report(before));
        }
        self.alone.restore(system, &self.memory()).map_err(failed)?;
        let result = self.alone.step(system, state, h);
        self.repeated += self.alone.work();
        (self.there, self.memory) = (None, self.alone.memory());
        result
    }

    fn joins_steps(&self, system: &System) -> bool {
        self.alone.joins_steps(system)
    }

    fn steps(&mut self, system: &System, state: &mut State, h: f64, count: u32) -> Option<StepReport> {
        let before = self.work();
        let joined = self.joins_steps(system) && self.together(state, h, count).unwrap_or(false);
        joined.then(|| self.report(before))
    }

    fn work(&self) -> Work {
        let mut total = self.member.work() - self.before;
        total += self.repeated;
        total
    }

    fn memory(&self) -> StepperMemory {
        let Some(there) = &self.there else { return self.memory.clone() };
        let mut memory = StepperMemory { method: self.memory.method.clone(), ..StepperMemory::default() };
        if let Some((t, knows)) = self.member.evaluated() {
            // The ranks have moved the free coordinates to the end of the step, and the others to the time t.
            let mut x = vec![0.0; self.coordinates.dof_count()];
            self.coordinates.embed(&there.q, t, &mut x);
            memory.arrays = vec![("forces.x".into(), x), ("forces.t".into(), vec![t])];
            memory.counts = vec![("forces.gradient".into(), u64::from(knows))];
        }
        memory
    }

    fn restore(&mut self, system: &System, memory: &StepperMemory) -> Result<(), SolverError> {
        let name = self.memory.method.clone();
        if memory.method != name {
            return Err(SolverError::Memory { missing: "method of the ranks" });
        }
        self.alone.restore(system, memory)?;
        (self.there, self.memory) = (None, memory.clone());
        (self.repeated, self.before) = (Work::default(), self.member.work());
        Ok(())
    }

    fn sees_end(&self) -> bool {
        match &self.there {
            Some(_) => self.member.evaluated().is_some_and(|(_, knows)| knows),
            None => self.alone.sees_end(),
        }
    }

    fn spans_ranks(&self) -> bool {
        true
    }
}
