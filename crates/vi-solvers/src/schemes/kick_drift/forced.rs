//! Kicks with forces without a potential, and their entries in the energy ledger.
//!
//! If a drift changes momenta, by constraints or collisions, the mean of the velocities before and after a kick is not the velocity
//! of the motion: of a body at rest on a floor, half kicks and impulses move the momenta to and fro. The work of forces is then
//! booked by the displacement of the drift next to the kick. Without impulses, both sums are equal up to the first and last kick.

use vi_core::{StepEnergy, System};

use crate::assemble::evaluator::Evaluator;
use crate::assemble::force_sum::ForceSum;
use crate::error::SolverError;
use crate::schemes::accounts::{self, PotentialEnergies};
use crate::schemes::kick_drift::KickDrift;
use crate::vectors;

/// The forces of a kick, whose work waits for the displacement of a drift.
pub(super) struct DeferredWork {
    /// Duration b h of the kick, s.
    kick: f64,
    /// Forces without a potential on all coordinates by account, N: (force, damping), in the nodes' own axes; empty without such forces.
    forces: Vec<(f64, f64)>,
    /// Gradient of the terms that change with time, N; empty without such terms.
    changing: Vec<f64>,
}

impl DeferredWork {
    fn new(system: &System, evaluator: &Evaluator, forces: Option<&ForceSum>, kick: f64) -> Self {
        let count = system.coordinates().dof_count();
        let forces =
            forces.map_or_else(Vec::new, |forces| (0..count).map(|dof| forces.by_account(dof)).collect());
        let changing = match PotentialEnergies::counts_work(system, evaluator) {
            true => accounts::gradient_of_changing(system, evaluator),
            false => Vec::new(),
        };
        Self { kick, forces, changing }
    }
}

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
            let mut predicted: Vec<f64> = (0..p.len())
                .map(|k| {
                    let dof = free[k] as usize;
                    p[k] + kick * (forces.total(dof) - gradient[dof])
                })
                .collect();
            if let Some(manifold) = &mut self.manifold {
                // The reaction of constraints in the kick is as large as the forces: without it, the order would be 1.
                manifold.project_momenta(system, &self.q, &mut predicted, t)?;
            }
            vectors::update(&mut predicted, |k, p| *p /= mass[k]);
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
            let is_deferred = self.defers_work();
            if !is_deferred && PotentialEnergies::counts_work(system, &self.evaluator) {
                self.potential_energies.add_work(system, &self.evaluator, kick, &self.x_dot);
            }
            system.coordinates().to_own_axes(&mut self.x_dot);
            let (force, damping) = forces.work(&self.x_dot);
            if is_deferred {
                work += kick * force + kick * damping;
            } else {
                energy.force += kick * force;
                energy.damping += kick * damping;
            }
            if system.coordinates().is_moving() {
                let x_dot = &self.x_dot;
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

    /// Returns whether the work of forces is booked by displacements.
    pub(super) fn defers_work(&self) -> bool {
        self.ledger && (self.manifold.is_some() || self.collisions.is_some())
    }

    /// Returns the work of the last evaluated forces in a kick, to be booked.
    pub(super) fn defer_work(&self, system: &System, kick: f64) -> DeferredWork {
        DeferredWork::new(system, &self.evaluator, self.nonconservative.as_ref(), kick)
    }

    /// Books the work of forces along the mean velocity of a drift, m/s; returns minus the work of those without a potential.
    pub(super) fn book_work(
        &mut self,
        system: &System,
        deferred: &DeferredWork,
        velocity: &[f64],
        energy: &mut StepEnergy,
    ) -> f64 {
        let DeferredWork { kick, forces, changing } = deferred;
        self.potential_energies.add(kick * vectors::sum(changing.len(), |dof| changing[dof] * velocity[dof]));
        let mut along = velocity.to_vec();
        system.coordinates().to_own_axes(&mut along);
        let force = kick * vectors::sum(forces.len(), |dof| forces[dof].0 * along[dof]);
        let damping = kick * vectors::sum(forces.len(), |dof| forces[dof].1 * along[dof]);
        energy.force += force;
        energy.damping += damping;
        -(force + damping)
    }
}
