//! Integrators that are not variational, for comparison runs only: they gain or lose energy by
//! themselves, and the ledger shows it as the scheme's part.

mod backward_euler;
mod bdf2;
mod forward_euler;
mod generalized_alpha;
mod newmark;

use vi_core::{State, System};

use crate::forces::Forces;
use crate::inertia::Inertia;
use crate::{SolverError, StepperMemory};

pub(crate) use backward_euler::BackwardEuler;
pub(crate) use bdf2::Bdf2;
pub(crate) use forward_euler::ForwardEuler;
pub(crate) use generalized_alpha::GeneralizedAlpha;
pub(crate) use newmark::Newmark;

/// Is `state` where the last step ended? Its time may differ in the last bits.
fn continues(last: &State, state: &State, h: f64) -> bool {
    (last.t - state.t).abs() <= 1e-6 * h && last.q == state.q && last.p == state.p
}

/// The acceleration that Newmark's family carries from step to step, with the state it belongs to.
#[derive(Default)]
struct CarriedAcceleration {
    state: Option<State>,
    a: Vec<f64>,
}

impl CarriedAcceleration {
    /// At a state where no step has ended, M⁻¹ (f − ∂V/∂q).
    fn open(
        &mut self,
        system: &System,
        forces: &mut Forces,
        inertia: &Inertia,
        state: &State,
        h: f64,
    ) -> Result<(), SolverError> {
        if self.state.as_ref().is_some_and(|last| continues(last, state, h)) {
            return Ok(());
        }
        if forces.has_nonconservative() {
            let v = inertia.velocity(system, &state.p);
            let q_dot: Vec<f64> = (0..state.p.len()).map(|k| v.at(k)).collect();
            forces.set_velocities(system, &q_dot, state.t, 0.0);
        }
        forces.evaluate(system, &state.q, state.t, true)?;
        let gradient = forces.gradient();
        self.a.clear();
        self.a.extend(system.coordinates().free().iter().map(|&dof| -gradient[dof as usize]));
        inertia.divide(system, &mut self.a, &mut forces.work);
        self.state = Some(state.clone());
        Ok(())
    }

    fn close(&mut self, after: &State, next: impl Fn(usize, f64) -> f64) {
        for (k, a) in self.a.iter_mut().enumerate() {
            *a = next(k, *a);
        }
        self.state = Some(after.clone());
    }

    fn remember(&self, memory: &mut StepperMemory) {
        if let Some(State { t, q, p }) = &self.state {
            memory.arrays.push(("carried.t".into(), vec![*t]));
            memory.arrays.push(("carried.q".into(), q.clone()));
            memory.arrays.push(("carried.p".into(), p.clone()));
            memory.arrays.push(("carried.a".into(), self.a.clone()));
        }
    }

    fn restore(&mut self, memory: &StepperMemory) {
        *self = Self::default();
        let arrays = ["carried.t", "carried.q", "carried.p", "carried.a"].map(|name| memory.array(name));
        if let [Ok(&[t]), Ok(q), Ok(p), Ok(a)] = arrays {
            self.state = Some(State { t, q: q.to_vec(), p: p.to_vec() });
            self.a = a.to_vec();
        }
    }
}
