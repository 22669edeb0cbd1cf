//! The work of prescribed motion and of forces along a path of equilibria, by definitions that dynamics shares.
//!
//! Between two equilibria, g = ∂V/∂x − f does the work ½ (g₀ + g₁)·Δx on prescribed coordinates, and forces f without a
//! potential do ½ (f₀ + f₁)·Δx. Loads that change with the load factor t do ½ Σ (V(x, t₁) − V(x, t₀)) over both ends x. On
//! free coordinates g is zero, unless a path begins out of equilibrium: then forces that lead the bodies to equilibrium do the
//! work ½ (g₀ + g₁)·Δx. The rest of ΔV is the error of this quadrature.

use vi_core::{StepEnergy, System};

use crate::schemes::accounts;
use crate::vectors;

/// The place that a path has reached, with its forces, and the work so far.
pub(crate) struct WorkDone {
    x: Vec<f64>,
    t: f64,
    gradient: Vec<f64>,
    forces: Vec<f64>,
    energy: StepEnergy,
}

impl WorkDone {
    /// Begins at the positions x of all coordinates, with g = `gradient` and f = `forces` there (N); an empty f means
    /// zero.
    pub(crate) fn begin(x: &[f64], t: f64, gradient: &[f64], forces: Vec<f64>) -> Self {
        Self { x: x.to_vec(), t, gradient: gradient.to_vec(), forces, energy: StepEnergy::default() }
    }

    /// Returns the work so far, J.
    pub(crate) fn energy(&self) -> StepEnergy {
        self.energy
    }

    /// Adds the work from the last positions to x at load factor t, with g = `gradient` and f = `forces` there (N).
    pub(crate) fn go_to(
        &mut self,
        system: &System,
        (x, t): (&[f64], f64),
        gradient: &[f64],
        forces: Vec<f64>,
    ) {
        let mut moved: Vec<f64> = x.iter().zip(&self.x).map(|(x, before)| x - before).collect();
        system.coordinates().to_own_axes(&mut moved);
        let mean: Vec<f64> = self.gradient.iter().zip(gradient).map(|(a, b)| 0.5 * (a + b)).collect();
        self.energy.prescribed += accounts::prescribed_work(system, &mean, &moved);
        let free = system.coordinates().free();
        let lead = accounts::free_work(system, &mean, |k| moved[free[k] as usize]);
        let own = vectors::sum(forces.len(), |dof| 0.5 * (self.forces[dof] + forces[dof]) * moved[dof]);
        let change = |x: &[f64]| time_dependent(system, x, t) - time_dependent(system, x, self.t);
        self.energy.force += lead + own + 0.5 * (change(&self.x) + change(x));
        self.x.copy_from_slice(x);
        self.gradient.copy_from_slice(gradient);
        (self.t, self.forces) = (t, forces);
    }
}

/// Returns the energy of the terms that change with time, J.
fn time_dependent(system: &System, x: &[f64], t: f64) -> f64 {
    accounts::changing(system).map(|term| accounts::energy_of(term, x, t)).sum()
}
