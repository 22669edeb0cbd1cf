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
pub(super) struct StageForces {
    /// Times of the stage and of the end of that step, s; `None` before the first step.
    times: Option<[f64; 2]>,
    /// ∂V/∂x − f of the [prescribed coordinates](accounts::prescribed_dofs), N; empty if no support moves.
    prescribed: Vec<f64>,
    /// Forces without a potential by account, N; empty without such forces.
    by_account: [Vec<f64>; 2],
}

/// Names of the stored forces.
const NAMES: [&str; 4] = ["booked.times", "booked.prescribed", "booked.force", "booked.damping"];

impl StageForces {
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
        if let Some([last_stage, last_end]) = self.times
            && last_end == start
            && last_stage < stage
        {
            let factor = (0.5 * (start + end) - stage) / (stage - last_stage);
            let [force, damping] =
                self.by_account.each_ref().map(|last| vectors::sum(last.len(), |dof| last[dof] * step[dof]));
            let prescribed = self.prescribed.iter().zip(accounts::prescribed_dofs(system));
            let prescribed = prescribed.map(|(force, dof)| force * step[dof]).sum();
            for (booked, before) in booked.iter_mut().zip([prescribed, force, damping]) {
                *booked += factor * (*booked - before);
            }
        }
        self.times = Some([stage, end]);
        if system.coordinates().is_moving() {
            let gradient = evaluator.gradient();
            self.prescribed.clear();
            self.prescribed.extend(accounts::prescribed_dofs(system).map(|dof| gradient[dof]));
        }
        evaluator.nonconservative(&mut self.by_account);
        booked
    }

    pub(super) fn save(&self, memory: &mut StepperMemory) {
        let times: Vec<f64> = self.times.iter().flatten().copied().collect();
        let [force, damping] = &self.by_account;
        for (name, array) in NAMES.iter().zip([&times, &self.prescribed, force, damping]) {
            memory.arrays.push(((*name).to_owned(), array.clone()));
        }
    }

    pub(super) fn restore(&mut self, system: &System, memory: &StepperMemory) -> Result<(), SolverError> {
        let all = system.coordinates().dof_count();
        let counts = [2, accounts::prescribed_dofs(system).count(), all, all];
        let mut arrays: [&[f64]; 4] = [&[]; 4];
        for ((array, name), count) in arrays.iter_mut().zip(NAMES).zip(counts) {
            *array = memory.array(name)?;
            if !array.is_empty() && array.len() != count {
                return Err(SolverError::Memory { missing: name });
            }
        }
        let [times, prescribed, force, damping] = arrays;
        *self = Self {
            times: times.try_into().ok(),
            prescribed: prescribed.to_vec(),
            by_account: [force, damping].map(<[f64]>::to_vec),
        };
        Ok(())
    }
}
