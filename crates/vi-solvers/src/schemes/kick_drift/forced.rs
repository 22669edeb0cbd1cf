//! Kicks with forces without a potential, and their entries in the energy ledger.

use vi_core::{StepEnergy, System};

use crate::error::SolverError;
use crate::schemes::accounts::{self, PotentialEnergies};
use crate::schemes::kick_drift::KickDrift;
use crate::vectors;

impl KickDrift {
    /// Evaluates the forces without a potential at the positions of the last gradient, before a kick (b h = `kick`)
    /// or, if `closes`, at the velocity that the closing kick of a symmetric scheme uses.
    pub(super) fn evaluate_nonconservative(
        &mut self,
        system: &System,
        t: f64,
        kick: f64,
        closes: bool,
    ) -> Result<(), SolverError> {
        let Some(forces) = &mut self.nonconservative else { return Ok(()) };
        let (mass, free) = (system.free_mass(), system.coordinates().free());
        let gradient = self.evaluator.gradient();
        let count = gradient.len();
        self.net.resize(count, 0.0);
        self.x_dot.resize(count, 0.0);
        let p = &self.p;
        let velocity: Vec<f64> = p.iter().zip(mass).map(|(p, m)| p / m).collect();
        system.coordinates().embed_velocity(&velocity, t, &mut self.x_dot);
        forces.evaluate(self.evaluator.positions(), &self.x_dot, t);
        if closes && forces.depends_on_velocity() {
            let predicted: Vec<f64> = (0..p.len())
                .map(|k| {
                    let dof = free[k] as usize;
                    (p[k] + kick * (forces.total(dof) - gradient[dof])) / mass[k]
                })
                .collect();
            system.coordinates().embed_velocity(&predicted, t, &mut self.x_dot);
            forces.evaluate(self.evaluator.positions(), &self.x_dot, t);
        }
        for dof in 0..count {
            self.net[dof] = forces.total(dof) - gradient[dof];
        }
        if vectors::all_finite(&self.net) {
            return Ok(());
        }
        let dof = self.net.iter().position(|f| !f.is_finite()).unwrap_or(0);
        Err(SolverError::NotFinite { what: "force without a potential", dof, at_start: false })
    }

    /// Makes a kick and a drift with forces without a potential; returns the same value as [`KickDrift::kick_drift`].
    pub(super) fn forced_kick_drift(
        &mut self,
        system: &System,
        t: f64,
        kick: f64,
        drift: f64,
        energy: &mut StepEnergy,
    ) -> f64 {
        let (mass, free) = (system.free_mass(), system.coordinates().free());
        let inverse_mass = self.sweep.inverse_mass();
        let mut work = 0.0;
        if self.ledger
            && kick != 0.0
            && let Some(forces) = &self.nonconservative
        {
            let gradient = self.evaluator.gradient();
            let mean: Vec<f64> = (0..self.p.len())
                .map(|k| (self.p[k] + 0.5 * kick * self.net[free[k] as usize]) / mass[k])
                .collect();
            work -= kick * accounts::free_work(system, gradient, |k| mean[k]);
            // Forces do work on prescribed coordinates too; the prescribed motion provides the rest.
            self.x_dot.resize(gradient.len(), 0.0);
            system.coordinates().embed_velocity(&mean, t, &mut self.x_dot);
            if PotentialEnergies::counts_work(system, &self.evaluator) {
                self.potential_energies.add_work(system, &self.evaluator, kick, &self.x_dot);
            }
            system.coordinates().to_own_axes(&mut self.x_dot);
            let x_dot = &self.x_dot;
            energy.force += kick * vectors::sum(x_dot.len(), |dof| forces.by_account(dof).0 * x_dot[dof]);
            energy.damping += kick * vectors::sum(x_dot.len(), |dof| forces.by_account(dof).1 * x_dot[dof]);
            if system.coordinates().is_moving() {
                let moved = kick * accounts::prescribed_work(system, gradient, x_dot);
                let negative: Vec<f64> = self.net.iter().map(|net| -net).collect();
                energy.prescribed += kick * accounts::prescribed_work(system, &negative, x_dot);
                work -= moved;
            }
        }
        let net = &self.net;
        vectors::update_pair(&mut self.q, &mut self.p, |k, q, p| {
            if kick != 0.0 {
                *p += kick * net[free[k] as usize];
            }
            *q += drift * (*p * inverse_mass[k]);
        });
        work
    }
}
