//! The work of forces in the middle of a step, for the ledger of schemes of order 2 whose stage is elsewhere. Forces F at the stage, at a
//! time t_s, would do work with an error of order 1; those of the last step, F' at t_s', give
//! ```text
//! W = F·Δx + (t_m − t_s)/(t_s − t_s') (F − F')·Δx,   t_m the middle of the step.
//! ```
//! For Newmark's method this is the trapezoidal rule. After a start, a single step is booked with F alone.

use vi_core::System;

use crate::assemble::evaluator::Evaluator;
use crate::error::SolverError;
use crate::memory::StepperMemory;
use crate::schemes::accounts;
use crate::vectors;

/// The works of a step that a ledger enters: of prescribed motion, of forces, and of damping, J.
pub(super) type Works = [f64; 3];

/// The forces at the stage of the last step.
#[derive(Default)]
pub(super) struct LastForces {
    /// Times of the stage and of the end of that step, s; empty before the first step.
    times: Vec<f64>,
    /// ∂V/∂x − f of all coordinates, N; empty if no support moves.
    gradient: Vec<f64>,
    /// Forces without a potential by account, N; empty without such forces.
    by_account: [Vec<f64>; 2],
}

/// Names of the stored forces.
const NAMES: [&str; 4] = ["booked.times", "booked.gradient", "booked.force", "booked.damping"];

impl LastForces {
    /// Returns the works of the forces at the last evaluation along `step` (in the nodes' own axes), as those in the middle of the step
    /// from time `start` to `end` with its stage at that evaluation. Keeps the forces for the next step.
    pub(super) fn book(
        &mut self,
        system: &System,
        evaluator: &Evaluator,
        [start, end]: [f64; 2],
        step: &[f64],
        works: Works,
    ) -> Works {
        let stage = evaluator.time();
        let mut booked = works;
        if let &[last_stage, last_end] = &self.times[..]
            && last_end == start
            && last_stage < stage
        {
            let factor = (0.5 * (start + end) - stage) / (stage - last_stage);
            let [force, damping] =
                self.by_account.each_ref().map(|last| vectors::sum(last.len(), |dof| last[dof] * step[dof]));
            let prescribed = match self.gradient.is_empty() {
                true => 0.0,
                false => accounts::prescribed_work(system, &self.gradient, step),
            };
            for (booked, before) in booked.iter_mut().zip([prescribed, force, damping]) {
                *booked += factor * (*booked - before);
            }
        }
        self.times = vec![stage, end];
        if system.coordinates().is_moving() {
            self.gradient.clear();
            self.gradient.extend_from_slice(evaluator.gradient());
        }
        evaluator.nonconservative(&mut self.by_account);
        booked
    }

    pub(super) fn save(&self, memory: &mut StepperMemory) {
        let [force, damping] = &self.by_account;
        for (name, array) in NAMES.iter().zip([&self.times, &self.gradient, force, damping]) {
            memory.arrays.push(((*name).to_owned(), array.clone()));
        }
    }

    pub(super) fn restore(&mut self, system: &System, memory: &StepperMemory) -> Result<(), SolverError> {
        let mut arrays = [(); 4].map(|()| Vec::new());
        for (array, name) in arrays.iter_mut().zip(NAMES) {
            memory.array(name)?.clone_into(array);
            let is_sound = match name {
                "booked.times" => matches!(array.len(), 0 | 2),
                _ => array.is_empty() || array.len() == system.coordinates().dof_count(),
            };
            if !is_sound {
                return Err(SolverError::Memory { missing: name });
            }
        }
        let [times, gradient, force, damping] = arrays;
        *self = Self { times, gradient, by_account: [force, damping] };
        Ok(())
    }
}
