//! Critical points: the load factor at which the lowest eigenvalue crosses zero, and the step onto the branch that
//! starts there.

use vi_core::State;

use crate::equilibrium::lowest_mode::lowest;
use crate::equilibrium::newton::{self, Solved};
use crate::equilibrium::options::{CriticalKind, CriticalPoint};
use crate::equilibrium::search::Search;
use crate::error::SolverError;
use crate::vectors;

impl Search<'_> {
    /// Finds the load factor between two equilibria at which the lowest eigenvalue changes its sign, and records it. Does
    /// nothing if the sign is the same at both, or if a negative eigenvalue is round-off: a body that may move freely has
    /// eigenvalues that are zero.
    pub(super) fn find_critical(&mut self, before: &State, after: &State) -> Result<(), SolverError> {
        let (first, _) = lowest(&mut self.balance, &before.q, before.t)?;
        let (last, mode) = lowest(&mut self.balance, &after.q, after.t)?;
        let noise = 64.0 * f64::EPSILON * self.balance.stiffest(&after.q, after.t)?;
        if (first < -noise) == (last < -noise) {
            return Ok(());
        }
        let (mut low, mut high) = ((before.t, first), (after.t, last));
        let mut q = before.q.clone();
        // Regula falsi on λ(t), which is nearly linear near a critical load (Illinois variant).
        let (mut f_low, mut f_high) = (first, last);
        for _ in 0..30 {
            if f_low * f_high >= 0.0 || (high.0 - low.0).abs() <= 1e-9 * high.0.abs().max(low.0.abs()) {
                break;
            }
            let t = low.0 - f_low * (high.0 - low.0) / (f_high - f_low);
            let along = (t - before.t) / (after.t - before.t);
            for k in 0..q.len() {
                q[k] = before.q[k] + along * (after.q[k] - before.q[k]);
            }
            let mut stop = self.stop;
            let moved = self.balance.check_move(before, &q, t);
            match moved.and_then(|()| newton::solve(&mut self.balance, &mut q, t, &mut stop)) {
                Ok(_) => {}
                Err(error) if error.is_interruption() => return Err(error),
                Err(_) => break,
            }
            let (value, _) = lowest(&mut self.balance, &q, t)?;
            if value.abs() <= 1e-9 * first.abs().max(last.abs()) {
                (low, high) = ((t, value), (t, value));
                break;
            }
            if value * f_low > 0.0 {
                low = (t, value);
                f_low = value;
                f_high *= 0.5;
            } else {
                high = (t, value);
                f_high = value;
                f_low *= 0.5;
            }
        }
        let load_factor = match (low.1, high.1) {
            // One of them is zero up to round-off.
            (a, b) if a * b >= 0.0 => {
                if a.abs() <= b.abs() {
                    low.0
                } else {
                    high.0
                }
            }
            (a, b) => low.0 - a * (high.0 - low.0) / (b - a),
        };
        let kind = self.kind_of(&mode, after)?;
        let error = (high.0 - low.0).abs();
        self.report.critical.push(CriticalPoint { kind, load_factor, error, eigenvalues: [first, last] });
        Ok(())
    }

    /// Returns the kind of a critical point. At a limit point the load acts on the critical mode, φᵀ ∂r/∂t ≠ 0; at a
    /// bifurcation it does not.
    pub(super) fn kind_of(&mut self, mode: &[f64], state: &State) -> Result<CriticalKind, SolverError> {
        let n = mode.len();
        let (mut here, mut there) = (vec![0.0; n], vec![0.0; n]);
        let e = 1e-5 * state.t.abs().max(1e-3 * self.options.end.abs());
        self.balance.residual(&state.q, state.t - e, &mut here)?;
        self.balance.residual(&state.q, state.t + e, &mut there)?;
        let mass = self.balance.system.free_mass();
        // Divide both sides by √mass, so that the ratio is dimensionless.
        let load = vectors::sum(n, |k| (there[k] - here[k]).powi(2) / mass[k]).sqrt();
        let felt = vectors::sum(n, |k| mode[k] * (there[k] - here[k])).abs();
        Ok(if felt > 1e-4 * load { CriticalKind::Limit } else { CriticalKind::Bifurcation })
    }

    /// Perturbs the unstable equilibrium (q, t) along its critical mode and descends to a minimum of V at the same load.
    ///
    /// # Errors
    /// Returns [`SolverError::Branch`] if no minimum is found, or [`SolverError::Interrupted`].
    pub(super) fn leave_branch(&mut self, q: &[f64], t: f64, push: f64) -> Result<Vec<f64>, SolverError> {
        let (lowest, mode) = lowest(&mut self.balance, q, t)?;
        let largest = vectors::max_abs(mode.len(), |k| mode[k]);
        let step: Vec<f64> = mode.iter().map(|mode| push * mode / largest).collect();
        let longest = self.balance.largest_step(q, t, &step);
        let mut q: Vec<f64> = q.iter().zip(&step).map(|(q, step)| q + longest * step).collect();
        let mut stop = newton::Stop { max_iterations: 10 * self.stop.max_iterations, ..self.stop };
        let Self { balance, constraints, .. } = self;
        let descended = match constraints {
            None => newton::descend(balance, &mut q, t, &mut stop),
            Some(constraints) => constraints.meet(&mut q, |q| {
                let solved = newton::descend(balance, q, t, &mut stop)?;
                // It ends where the tangent is definite.
                Ok((balance.positions(q, t), Solved { stayed_definite: true, ..solved }))
            }),
        };
        match descended {
            Ok(_) => Ok(q),
            Err(error) if error.is_interruption() => Err(error),
            Err(cause) => Err(SolverError::Branch { load_factor: t, lowest, push, cause: Box::new(cause) }),
        }
    }
}
