//! The acceleration that Newmark and generalised-α carry from step to step.

use vi_core::{State, StepSpan, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::memory::StepperMemory;

/// Returns whether `state` is the end of the last step. Its time may differ in the last bits.
pub(super) fn continues(last: &State, state: &State, h: f64) -> bool {
    (last.t - state.t).abs() <= 1e-6 * h && last.q == state.q && last.p == state.p
}

/// The acceleration that Newmark's family carries from step to step, with the state to which it belongs.
#[derive(Default)]
pub(super) struct CarriedAcceleration {
    state: Option<State>,
    pub(super) a: Vec<f64>,
}

impl CarriedAcceleration {
    /// Computes M⁻¹ (f − ∂V/∂q) for a step of `span` from this state, unless a step has ended there.
    ///
    /// Friction between bodies acts between two places. It is that of a step of the same length that arrives here with the velocity of
    /// the state: between equal places there is no slip.
    pub(super) fn open(
        &mut self,
        system: &System,
        evaluator: &mut Evaluator,
        inertia: &Inertia,
        state: &State,
        span: StepSpan,
    ) -> Result<(), SolverError> {
        if self.state.as_ref().is_some_and(|last| continues(last, state, span.duration)) {
            return Ok(());
        }
        let v = inertia.velocity(system, &state.p);
        let q_dot: Vec<f64> = (0..state.p.len()).map(|k| v.at(k)).collect();
        if evaluator.has_nonconservative() {
            evaluator.set_velocities(system, &q_dot, state.t, 0.0);
        }
        if system.terms().live().iter().any(|term| term.dissipates()) {
            evaluator.arrive(system, (&state.q, state.t), &q_dot, span)?;
        } else if evaluator.acts_over_steps() {
            evaluator.set_ends(system, (&state.q, state.t), (&state.q, state.t));
        }
        evaluator.evaluate(system, &state.q, state.t, true)?;
        let gradient = evaluator.gradient();
        self.a.clear();
        self.a.extend(system.coordinates().free().iter().map(|&dof| -gradient[dof as usize]));
        inertia.divide(system, &mut self.a, &mut evaluator.work);
        self.state = Some(state.clone());
        Ok(())
    }

    pub(super) fn close(&mut self, after: &State, next: impl Fn(usize, f64) -> f64) {
        for (k, a) in self.a.iter_mut().enumerate() {
            *a = next(k, *a);
        }
        self.state = Some(after.clone());
    }

    pub(super) fn save(&self, memory: &mut StepperMemory) {
        if let Some(State { t, q, p }) = &self.state {
            memory.arrays.push(("carried.t".into(), vec![*t]));
            memory.arrays.push(("carried.q".into(), q.clone()));
            memory.arrays.push(("carried.p".into(), p.clone()));
            memory.arrays.push(("carried.a".into(), self.a.clone()));
        }
    }

    pub(super) fn restore(&mut self, memory: &StepperMemory) {
        *self = Self::default();
        let arrays = ["carried.t", "carried.q", "carried.p", "carried.a"].map(|name| memory.array(name));
        if let [Ok(&[t]), Ok(q), Ok(p), Ok(a)] = arrays {
            self.state = Some(State { t, q: q.to_vec(), p: p.to_vec() });
            self.a = a.to_vec();
        }
    }
}
