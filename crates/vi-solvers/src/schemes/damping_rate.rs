//! Estimates the highest rate at which velocities decay by the forces that depend on them, which limits the step of an explicit scheme
//! as the highest frequency does. It uses Lanczos' method on M^{-1/2} D M^{-1/2} with D = −∂f/∂ẋ, and D v from differences of forces.

use vi_core::{State, System};

use crate::assemble::force_sum::ForceSum;
use crate::error::SolverError;
use crate::schemes::lanczos::{self, SymmetricOperator, normalize};
use crate::vectors;

/// Relative error of the rate.
const ACCURACY: f64 = 0.01;
/// Change of velocity of a difference, relative to the velocities of the state. Its square and the round-off that it amplifies
/// (1e-16/1e-6) are far below [`ACCURACY`].
const DIFFERENCE: f64 = 1e-6;

/// The operator v ↦ M^{-1/2} D M^{-1/2} v about a state.
pub(super) struct DampingOperator {
    forces: ForceSum,
    x: Vec<f64>,
    q_dot: Vec<f64>,
    x_dot: Vec<f64>,
    ahead: Vec<f64>,
    roots: Vec<f64>,
    /// Change of velocity of a difference, m/s.
    change: f64,
    t: f64,
}

impl DampingOperator {
    /// Returns the operator of a system; `None` if no force depends on velocity.
    pub(super) fn new(system: &System) -> Option<Self> {
        let forces = ForceSum::new(system).filter(ForceSum::depends_on_velocity)?;
        let roots = system.free_mass().iter().map(|mass| mass.sqrt()).collect();
        let count = system.coordinates().dof_count();
        Some(Self {
            forces,
            x: vec![0.0; count],
            q_dot: Vec::new(),
            x_dot: vec![0.0; count],
            ahead: vec![0.0; count],
            roots,
            change: 0.0,
            t: 0.0,
        })
    }

    /// Returns the highest rate d (1/s) about a state, at which its velocity decays if no other force acts. `omega` (rad/s) is the highest
    /// frequency there.
    ///
    /// # Errors
    /// Returns [`SolverError::NotFinite`] if a force is not finite.
    pub(super) fn highest(&mut self, system: &System, state: &State, omega: f64) -> Result<f64, SolverError> {
        if state.q.is_empty() {
            return Ok(0.0);
        }
        let coordinates = system.coordinates();
        self.t = state.t;
        self.x = system.positions(state);
        self.q_dot = system.velocity(&state.p);
        self.x_dot = system.velocities(state);
        // A body at rest would move at this speed if it vibrated at its highest frequency. Forces that are not linear, as of wind, depend
        // on the size of the change, and linear ones do not.
        let vibrating = coordinates.extent_and_reach(&self.x)[0] * omega;
        let fastest = vectors::max_abs(self.x_dot.len(), |k| self.x_dot[k]).max(vibrating);
        self.change = DIFFERENCE * if fastest > 0.0 { fastest } else { 1.0 };
        let mut about = About { operator: self, system };
        // The square root of the largest eigenvalue.
        let root = lanczos::highest(&mut about, state.q.len(), ACCURACY)?.omega;
        Ok(root * root)
    }

    /// Returns the powers of the forces at a state with the velocities q̇ of the free coordinates, W: of what depends on velocity, and of
    /// all forces.
    pub(super) fn powers(
        &mut self,
        system: &System,
        state: &State,
        q_dot: &[f64],
    ) -> Result<[f64; 2], SolverError> {
        let (x, free) = (system.positions(state), system.coordinates().free());
        let x_dot = system.velocities(state);
        let mut power = |x_dot: &[f64]| {
            self.forces.evaluate(&x, x_dot, state.t);
            vectors::sum(q_dot.len(), |k| q_dot[k] * self.forces.total(free[k] as usize))
        };
        let (all, of_rest) = (power(&x_dot), power(&vec![0.0; x_dot.len()]));
        match (all - of_rest).is_finite() {
            true => Ok([all - of_rest, all]),
            false => {
                Err(SolverError::NotFinite { what: "force without a potential", dof: 0, at_start: false })
            }
        }
    }
}

/// The operator about the state at which it was placed.
struct About<'a> {
    operator: &'a mut DampingOperator,
    system: &'a System,
}

impl SymmetricOperator for About<'_> {
    fn apply(&mut self, v: &[f64], out: &mut [f64]) -> Result<(), SolverError> {
        let coordinates = self.system.coordinates();
        let DampingOperator { forces, x, q_dot, x_dot, ahead, roots, change, t } = &mut *self.operator;
        let epsilon = *change / vectors::max_abs(v.len(), |k| v[k] / roots[k]);
        let mut force = |sign: f64, sum: &mut [f64]| {
            let moved: Vec<f64> = (0..v.len()).map(|k| q_dot[k] + sign * epsilon * v[k] / roots[k]).collect();
            coordinates.embed_velocity(&moved, *t, x_dot);
            forces.evaluate(x, x_dot, *t);
            vectors::fill(sum, |dof| forces.total(dof));
        };
        let mut behind = vec![0.0; x.len()];
        force(1.0, ahead);
        force(-1.0, &mut behind);
        let free = coordinates.free();
        vectors::fill(out, |k| {
            let dof = free[k] as usize;
            (behind[dof] - ahead[dof]) / (2.0 * epsilon) / roots[k]
        });
        match vectors::all_finite(out) {
            true => Ok(()),
            false => {
                Err(SolverError::NotFinite { what: "force without a potential", dof: 0, at_start: true })
            }
        }
    }

    fn product(&self, a: &[f64], v: &[f64]) -> f64 {
        vectors::dot(a, v)
    }

    fn normalize(&mut self, v: &mut [f64]) -> f64 {
        normalize(v)
    }
}
