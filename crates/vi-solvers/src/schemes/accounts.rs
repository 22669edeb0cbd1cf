//! Work over one step for the energy ledger, by definitions that all schemes share.
//!
//! A gradient g = ∂V/∂x that acts along a displacement d does the work g·d on the potential. On prescribed
//! coordinates this work comes from the prescribed motion; on free coordinates it comes from the kinetic energy.

use vi_core::{Potential, System};

use crate::assemble::evaluator::Evaluator;
use crate::memory::StepperMemory;
use crate::vectors;

/// Returns Σ g_i d_i over the free coordinates; `along(k)` is d for free coordinate q_k.
pub(crate) fn free_work(system: &System, gradient: &[f64], along: impl Fn(usize) -> f64 + Sync) -> f64 {
    let free = system.coordinates().free();
    vectors::sum(free.len(), |k| gradient[free[k] as usize] * along(k))
}

/// Returns the numbers of the prescribed coordinates in x, always in the same order.
pub(crate) fn prescribed_dofs(system: &System) -> impl Iterator<Item = usize> {
    let groups = system.coordinates().prescribed().iter();
    groups.flat_map(|group| &group.dofs).map(|&dof| dof as usize)
}

/// Returns Σ g_i d_i over the prescribed coordinates; `along` holds d of all coordinates in the nodes' own axes.
pub(crate) fn prescribed_work(system: &System, gradient: &[f64], along: &[f64]) -> f64 {
    prescribed_dofs(system).map(|dof| gradient[dof] * along[dof]).sum()
}

/// Returns the terms of the potential that change with time.
pub(crate) fn changing(system: &System) -> impl Iterator<Item = &dyn Potential> {
    system.potentials().iter().map(AsRef::as_ref).filter(|term| term.traits().time_dependent)
}

/// Returns the energy of a term, J.
pub(crate) fn energy_of(term: &dyn Potential, x: &[f64], t: f64) -> f64 {
    term.energy(x, t).unwrap_or_else(|| {
        let mut energies = vec![0.0; term.stencil_count()];
        term.energies(0..energies.len(), x, t, &mut energies);
        energies.iter().sum()
    })
}

/// Returns the power ∂V/∂x·ẋ of a term, W, for the velocities `x_dot` of all coordinates (m/s).
pub(crate) fn power_on(term: &dyn Potential, x: &[f64], t: f64, x_dot: &[f64]) -> f64 {
    let stencils = term.stencils();
    let (count, size, block) = (stencils.count(), stencils.size(), stencils.block);
    let mut gradients = vec![0.0; count * size];
    term.gradients(0..count, x, t, &mut gradients);
    let nodes = (0..count).flat_map(|stencil| stencils.of(stencil));
    let along = nodes.zip(gradients.chunks_exact(block)).map(|(&node, gradient)| {
        let x_dot = &x_dot[node as usize * block..][..block];
        gradient.iter().zip(x_dot).map(|(gradient, x_dot)| gradient * x_dot).sum::<f64>()
    });
    along.sum()
}

/// Adds ∂V/∂x of a term at (x, t), N.
pub(crate) fn add_gradient(term: &dyn Potential, x: &[f64], t: f64, sum: &mut [f64]) {
    let stencils = term.stencils();
    let (count, block) = (stencils.count(), stencils.block);
    let mut gradients = vec![0.0; count * stencils.size()];
    term.gradients(0..count, x, t, &mut gradients);
    let nodes = (0..count).flat_map(|stencil| stencils.of(stencil));
    for (&node, gradient) in nodes.zip(gradients.chunks_exact(block)) {
        let sum = &mut sum[node as usize * block..][..block];
        sum.iter_mut().zip(gradient).for_each(|(sum, gradient)| *sum += gradient);
    }
}

/// Returns the gradient of the terms that change with time at the last configuration of the evaluator, N.
pub(crate) fn gradient_of_changing(system: &System, evaluator: &Evaluator) -> Vec<f64> {
    let mut sum = vec![0.0; system.coordinates().dof_count()];
    for term in changing(system) {
        add_gradient(term, evaluator.positions(), evaluator.time(), &mut sum);
    }
    sum
}

/// Potential energy before and after a step, and the work of loads that change with time.
///
/// The terms that change with time, C(x, t), receive the work ∫ ∂C/∂t dt = ΔC − ∫ ∂C/∂x·ẋ dt from outside. A scheme
/// with several stages books the last integral with its own nodes and weights, so that the error of this account has
/// the order of the scheme, and jumps of C in time are booked as they are. For a scheme whose forces act at the middle
/// t_m of a step, this work is C(x₁, t₁) − C(x₁, t_m) + C(x₀, t_m) − C(x₀, t₀). With it the energy–momentum method,
/// which takes the discrete gradient of C(x, t_m), keeps the balance to round-off.
pub(crate) struct PotentialEnergies {
    /// V at the start, J.
    pub(crate) start: f64,
    x: Vec<f64>,
    t: f64,
    kept: Option<f64>,
    /// Work on the terms that change with time in the open step, Σ b_i h ∂C/∂x·ẋ, J.
    work: f64,
}

impl PotentialEnergies {
    pub(crate) fn new() -> Self {
        Self { start: 0.0, x: Vec::new(), t: 0.0, kept: None, work: 0.0 }
    }

    /// Records the energy at the end of the last step.
    pub(crate) fn save(&self, memory: &mut StepperMemory) {
        if let Some(kept) = self.kept {
            memory.arrays.push(("potentials.end".into(), vec![kept]));
        }
    }

    /// Restores the energy that [`PotentialEnergies::save`] recorded.
    pub(crate) fn restore(memory: &StepperMemory) -> Self {
        let kept = memory.array("potentials.end").ok().and_then(|array| array.first().copied());
        Self { kept, ..Self::new() }
    }

    /// Discards the energy at the end of a step that was given up.
    pub(crate) fn forget(&mut self) {
        self.kept = None;
    }

    /// Opens a step at (q, t). The energy is already known if the last step ended there.
    pub(crate) fn open(&mut self, system: &System, evaluator: &mut Evaluator, q: &[f64], t: f64) {
        let known = self.kept.take().filter(|_| evaluator.is_at(system, q, t));
        self.start = known.unwrap_or_else(|| evaluator.energy(system, q, t));
        (self.t, self.work) = (t, 0.0);
        if evaluator.is_time_dependent() {
            self.x.clear();
            self.x.extend_from_slice(evaluator.positions());
        }
    }

    /// Returns whether the scheme books the work on terms that change with time, by [`PotentialEnergies::add_work`]. If ranks share
    /// the terms, none knows all of them.
    pub(crate) fn counts_work(system: &System, evaluator: &Evaluator) -> bool {
        evaluator.is_time_dependent() && system.terms().shared().is_none()
    }

    /// Adds the work on the terms that change with time while coordinates move with `x_dot` (m/s) for `duration` (s) at the last
    /// configuration of the evaluator.
    pub(crate) fn add_work(&mut self, system: &System, evaluator: &Evaluator, duration: f64, x_dot: &[f64]) {
        let power = |term| power_on(term, evaluator.positions(), evaluator.time(), x_dot);
        self.work += duration * changing(system).map(power).sum::<f64>();
    }

    /// Adds work on the terms that change with time, J.
    pub(crate) fn add(&mut self, work: f64) {
        self.work += work;
    }

    /// Closes the step at (q, t), whose stages have booked the work on terms that change with time. Returns ΔV and the part of it
    /// that is the work of these terms.
    pub(crate) fn close_with_work(
        &mut self,
        system: &System,
        evaluator: &mut Evaluator,
        q: &[f64],
        t: f64,
    ) -> (f64, f64) {
        if !Self::counts_work(system, evaluator) {
            return self.close(system, evaluator, q, t);
        }
        let end = evaluator.energy(system, q, t);
        self.kept = Some(end);
        let change = |term| energy_of(term, evaluator.positions(), t) - energy_of(term, &self.x, self.t);
        (end - self.start, changing(system).map(change).sum::<f64>() - self.work)
    }

    /// Closes the step at (q, t), in which forces act as at its middle. Returns ΔV and the part of it that is the work of loads that
    /// change with time.
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
            let (x, middle) = (evaluator.positions().to_vec(), self.t + 0.5 * (t - self.t));
            let start_later = evaluator.energy_of_positions(&self.x, middle);
            let end_earlier = evaluator.energy_of_positions(&x, middle);
            loads = (start_later - self.start) + (end - end_earlier);
        }
        (end - self.start, loads)
    }
}
