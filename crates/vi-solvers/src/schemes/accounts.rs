//! Work over one step for the energy ledger, by definitions that all schemes share.
//!
//! A gradient g = ∂V/∂x that acts along a displacement d does the work g·d on the potential. On prescribed
//! coordinates this work comes from the prescribed motion; on free coordinates it comes from the kinetic energy.

use vi_core::System;

use crate::assemble::evaluator::Evaluator;
use crate::memory::StepperMemory;
use crate::vectors;

/// Returns Σ g_i d_i over the free coordinates; `along(k)` is d for free coordinate q_k.
pub(crate) fn free_work(system: &System, gradient: &[f64], along: impl Fn(usize) -> f64 + Sync) -> f64 {
    let free = system.coordinates().free();
    vectors::sum(free.len(), |k| gradient[free[k] as usize] * along(k))
}

/// Returns Σ g_i d_i over the prescribed coordinates; `along` holds d of all coordinates in the nodes' own axes.
pub(crate) fn prescribed_work(system: &System, gradient: &[f64], along: &[f64]) -> f64 {
    let groups = system.coordinates().prescribed().iter();
    groups.flat_map(|group| &group.dofs).map(|&dof| gradient[dof as usize] * along[dof as usize]).sum()
}

/// Potential energy before and after a step, and the work of loads that change with time.
pub(crate) struct PotentialEnergies {
    /// V at the start, J.
    pub(crate) start: f64,
    x: Vec<f64>,
    t: f64,
    kept: Option<f64>,
}

impl PotentialEnergies {
    pub(crate) fn new() -> Self {
        Self { start: 0.0, x: Vec::new(), t: 0.0, kept: None }
    }

    /// Records the energy at the end of the last step.
    pub(crate) fn save(&self, memory: &mut StepperMemory) {
        if let Some(kept) = self.kept {
            memory.arrays.push(("potentials.end".into(), vec![kept]));
        }
    }

    /// Restores what [`PotentialEnergies::save`] recorded.
    pub(crate) fn restore(memory: &StepperMemory) -> Self {
        let kept = memory.array("potentials.end").ok().and_then(|array| array.first().copied());
        Self { kept, ..Self::new() }
    }

    /// Forgets the energy at the end of a step that was given up.
    pub(crate) fn forget(&mut self) {
        self.kept = None;
    }

    /// Opens a step at (q, t). The energy is already known if the last step ended there.
    pub(crate) fn open(&mut self, system: &System, evaluator: &mut Evaluator, q: &[f64], t: f64) {
        let known = self.kept.take().filter(|_| evaluator.is_at(system, q, t));
        self.start = known.unwrap_or_else(|| evaluator.energy(system, q, t));
        self.t = t;
        if evaluator.is_time_dependent() {
            self.x.clear();
            self.x.extend_from_slice(evaluator.positions());
        }
    }

    /// Closes the step at (q, t). Returns ΔV and the part of it that is the work of loads that change with time, ½ Σ
    /// over both ends x of V(x, t₁) − V(x, t₀).
    pub(crate) fn close(
        &mut self,
        system: &System,
        evaluator: &mut Evaluator,
        q: &[f64],
        t: f64,
    ) -> (f64, f64) {
        let end = evaluator.energy(system, q, t);
        self.kept = Some(end);
        let mut loads = 0.0;
        if evaluator.is_time_dependent() {
            let x = evaluator.positions().to_vec();
            let start_later = evaluator.energy_of_positions(&self.x, t);
            let end_earlier = evaluator.energy_of_positions(&x, self.t);
            loads = 0.5 * ((start_later - self.start) + (end - end_earlier));
        }
        (end - self.start, loads)
    }
}
