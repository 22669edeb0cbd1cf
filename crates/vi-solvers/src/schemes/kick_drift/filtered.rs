//! Steps with a filtered mass, whose drifts are q += a h W p.

use vi_core::{MassFilter, State, System};

use crate::error::SolverError;
use crate::schemes::accounts::{self, PotentialEnergies};
use crate::schemes::kick_drift::KickDrift;
use crate::schemes::kick_drift::splitting::Splitting;

impl KickDrift {
    /// Makes plain steps as [`KickDrift::advance_swept`] does. After the pass that sums the forces and kicks, the filter
    /// makes two more.
    pub(super) fn advance_filtered(
        &mut self,
        system: &System,
        filter: &MassFilter,
        state: &State,
        (h, count): (f64, u32),
    ) -> Result<bool, SolverError> {
        let Some(filtered) = &mut self.filtered else { return Ok(false) };
        let Splitting { kicks, drifts } = &self.coefficients;
        if kicks[0] == 0.0 {
            self.evaluator.go_to(system, &state.q, state.t);
        } else {
            self.evaluator.evaluate(system, &state.q, state.t, true)?;
        }
        self.p.copy_from_slice(&state.p);
        let last = h * kicks[drifts.len()];
        let (mut begins, mut closing) = (true, 0.0);
        for _ in 0..count {
            let mut elapsed = 0.0;
            for (kick, drift) in kicks.iter().zip(drifts) {
                let kick = kick * h;
                let sums = !begins && (closing != 0.0 || kick != 0.0);
                if sums {
                    self.evaluator.sum_chunks(system, state.t + elapsed * h);
                }
                let arrays = (&mut self.q[..], &mut self.p[..]);
                let kicks = [closing, kick];
                let is_sound =
                    self.evaluator.sweep_to_velocity(&self.sweep, sums, kicks, arrays, filtered.unfiltered());
                if !(is_sound && self.evaluator.drift_filtered(filter, filtered, drift * h)) {
                    return Ok(false);
                }
                elapsed += drift;
                (begins, closing) = (false, 0.0);
            }
            closing = last;
        }
        let sums = last != 0.0;
        if sums {
            self.evaluator.sum_chunks(system, state.t + h);
        }
        let arrays = (&mut self.q[..], &mut self.p[..]);
        Ok(self.evaluator.sweep(&self.sweep, None, sums, [0.0, last], 0.0, arrays))
    }

    /// Makes a kick and a drift; returns the same value as [`KickDrift::kick_drift`]. In the ledger, the work of a kick is
    /// along W p̄, where p̄ is the mean of the momenta before and after it: exactly the change of ½ pᵀW p.
    pub(super) fn filtered_kick_drift(
        &mut self,
        system: &System,
        filter: &MassFilter,
        kick: f64,
        drift: f64,
    ) -> f64 {
        let Some(filtered) = &mut self.filtered else { return 0.0 };
        let (free, gradient, p) = (system.coordinates().free(), self.evaluator.gradient(), &mut self.p);
        let mut work = 0.0;
        if kick != 0.0 {
            if self.ledger {
                let mean = |k: usize| p[k] - 0.5 * kick * gradient[free[k] as usize];
                self.x_dot.clear();
                self.x_dot.resize(gradient.len(), 0.0);
                filtered.drift_of((system, filter), mean, 1.0, &mut self.x_dot);
                let x_dot = &self.x_dot;
                work -= kick * accounts::free_work(system, gradient, |k| x_dot[free[k] as usize]);
                if PotentialEnergies::counts_work(system, &self.evaluator) {
                    self.potential_energies.add_work(system, &self.evaluator, kick, x_dot);
                }
            }
            for (p, &dof) in p.iter_mut().zip(free) {
                *p -= kick * gradient[dof as usize];
            }
        }
        if drift != 0.0 {
            self.x_dot.resize(gradient.len(), 0.0);
            system.coordinates().embed(&self.q, 0.0, &mut self.x_dot);
            filtered.drift_of((system, filter), |k| p[k], drift, &mut self.x_dot);
            system.coordinates().coordinates_of(&self.x_dot, &mut self.q);
        }
        work
    }
}
