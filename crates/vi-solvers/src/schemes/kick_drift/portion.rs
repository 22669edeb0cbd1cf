//! Explicit steps of the portion of a system that one of several ranks computes.

use vi_core::{Exchange, State, System, Traffic};

use crate::assemble::assembler::Assembler;
use crate::assemble::evaluator::{Evaluator, TimeDependence};
use crate::assemble::gather::Gather;
use crate::assemble::sweep::Sweep;
use crate::error::SolverError;
use crate::memory::StepperMemory;
use crate::schemes::accounts::PotentialEnergies;
use crate::schemes::kick_drift::KickDrift;
use crate::schemes::kick_drift::splitting::Splitting;
use crate::schemes::live_impulses::LiveImpulses;
use crate::work::Work;

impl KickDrift {
    /// Returns the stepper of the portion `system` of a system that depends on the time in this way. `gather` sums it with the other
    /// ranks. It keeps no energy ledger.
    pub(crate) fn of_portion(
        name: &'static str,
        coefficients: Splitting,
        (system, depends): (&System, TimeDependence),
        gather: Gather,
    ) -> Self {
        let n = system.coordinates().free_count();
        let mut evaluator = Evaluator::of_portion(system, gather, depends);
        Self {
            name,
            coefficients,
            sweep: Sweep::new(system, evaluator.assembler().gather()),
            evaluator,
            potential_energies: PotentialEnergies::new(),
            ledger: false,
            q: vec![0.0; n],
            p: vec![0.0; n],
            x_dot: Vec::new(),
            nonconservative: None,
            net: Vec::new(),
            impulses: Vec::new(),
            manifold: None,
            filtered: None,
            collisions: None,
            live_impulses: LiveImpulses::new(false),
        }
    }

    /// Makes `count` steps together with the other ranks. If a number of any rank is not finite, returns false, and
    /// nothing but counts of evaluations has changed. All ranks must call it with the same arguments.
    pub(crate) fn steps_of_portion(
        &mut self,
        system: &System,
        state: &mut State,
        (h, count): (f64, u32),
        exchange: &dyn Exchange,
    ) -> bool {
        let (before, knew) = (self.evaluator.work, self.evaluator.knows_gradient_of(state.t));
        let is_sound = self.advance_swept(system, state, h, count).unwrap_or(false);
        if exchange.any(!is_sound) {
            self.evaluator.forget();
            if knew {
                self.evaluator.evaluate(system, &state.q, state.t, true).ok();
            }
            self.evaluator.work = before;
            return false;
        }
        std::mem::swap(&mut state.q, &mut self.q);
        std::mem::swap(&mut state.p, &mut self.p);
        state.t += f64::from(count) * h;
        self.evaluator.work.steps += u64::from(count);
        true
    }

    /// Places the evaluator where that of one process was ([`StepperMemory`]).
    ///
    /// # Errors
    /// Returns [`SolverError::Memory`] if the memory belongs to another system.
    pub(crate) fn restore_place(&mut self, memory: &StepperMemory) -> Result<(), SolverError> {
        self.evaluator.forget();
        self.evaluator.restore(memory)
    }

    /// Returns the place of the evaluator, for [`KickDrift::restore_place`].
    pub(crate) fn place(&self) -> StepperMemory {
        let mut memory = StepperMemory::default();
        self.evaluator.save(&mut memory);
        memory
    }

    /// Returns the time of the last evaluation, s, and whether its gradient is known, if there was one.
    pub(crate) fn evaluated(&self) -> Option<(f64, bool)> {
        let evaluator = &self.evaluator;
        (!evaluator.is_blank()).then(|| (evaluator.time(), evaluator.known_gradient().is_some()))
    }

    /// Returns the counts of its work.
    pub(crate) fn counted(&self) -> Work {
        self.evaluator.work
    }

    /// Returns the sums of the terms of the portion.
    pub(crate) fn assembler(&mut self) -> &mut Assembler {
        self.evaluator.assembler()
    }

    /// Returns the messages from this rank to others per evaluation of forces.
    pub(crate) fn traffic(&mut self) -> Traffic {
        self.evaluator.assembler().gather().map_or_else(Traffic::default, Gather::traffic)
    }
}
