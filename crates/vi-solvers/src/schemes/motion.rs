//! Frequencies of a motion, which adaptive steps follow. They depend on the state alone, do not change if its velocity is reversed,
//! and are the same for observers who move past each other: a body that flies vibrates as it does at rest.

use nalgebra::{Matrix3, Vector3};
use vi_core::{State, System};

use crate::assemble::carried::Carried;
use crate::error::SolverError;
use crate::schemes::damping_rate::DampingOperator;
use crate::schemes::lanczos::normalize;
use crate::schemes::stability::{Differences, Operator, highest};
use crate::vectors;

/// Relative error of λ_max for steps that keep a distance from their limit.
const ROUGH: f64 = 0.1;
/// A motion relative to a flight that is slower than this fraction of it counts as none. What Newton's method leaves of a beam of 220
/// coordinates that falls for 4 s, or flies at 300 m/s, stays below it with six schemes at the default tolerance.
const STILL: f64 = 1e-6;
/// A vibration whose amplitude is below this number of round-offs of the coordinates counts as none. When drag has
/// stopped a steel-like cube of 1 m, its noise has an amplitude of 90 of them, and would require a million steps.
const NOISE: f64 = 1e3;

/// The frequency of the motion of a state, and the weight of the state in means of frequencies.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motion {
    /// The square of the mean angular frequency, (rad/s)².
    pub square: f64,
    /// Twice the kinetic energy of the motion relative to the flight, in J, uᵀMu.
    pub weight: f64,
}

/// Frequencies of a system at states of its motion.
pub struct Frequencies {
    operator: Operator,
    /// The forces that depend on velocity, if there are any.
    damping: Option<DampingOperator>,
    carried: Carried,
}

impl Frequencies {
    /// Prepares for the states of a system.
    pub fn new(system: &System) -> Self {
        let (operator, damping) = (Operator::new(system), DampingOperator::new(system));
        Self { operator, damping, carried: Carried::new(system) }
    }

    /// Returns a bound of the highest angular frequency about a state, rad/s: at most a tenth too high.
    ///
    /// # Errors
    /// Returns the errors of [`highest_frequency`](crate::highest_frequency).
    pub fn highest(&mut self, system: &System, state: &State) -> Result<f64, SolverError> {
        Ok(highest(&mut self.operator, system, state, ROUGH, Differences::OneSided)?.omega)
    }

    /// Returns the highest rate at which velocities decay by damping about a state whose highest frequency is `omega` (rad/s), 1/s. Zero
    /// if no force depends on velocity.
    ///
    /// # Errors
    /// Returns [`SolverError::NotFinite`] if a force of velocity is not finite.
    pub fn damping_rate(&mut self, system: &System, state: &State, omega: f64) -> Result<f64, SolverError> {
        self.damping.as_mut().map_or(Ok(0.0), |damping| damping.highest(system, state, omega))
    }

    /// Returns the mean angular frequency of the motion of a state: ω² = |uᵀKu|/uᵀMu + Ω². u is the velocity relative to
    /// that with which each connected part is carried along: of its centre of mass if nothing holds it, of its supports if these
    /// move equally. Ω is the larger of two rates: at which a part turns about its centre of mass, and at which the fastest
    /// direction in a rigid body turns. Zero at rest.
    ///
    /// Rotations remain in u, because no scheme makes them exactly. Without them, a steel bar of 1 m that spins at 10
    /// rad/s would require steps of its stretching, whose amplitude is 4e-7 of its length, at 1.6e4 rad/s: for a
    /// thousand times as many.
    ///
    /// # Errors
    /// Returns the errors of [`highest_frequency`](crate::highest_frequency).
    pub fn of_motion(&mut self, system: &System, state: &State) -> Result<Motion, SolverError> {
        self.operator.place(system, state, Differences::Central)?;
        if state.p.iter().all(|p| *p == 0.0) {
            return Ok(Motion::default());
        }
        let turning = turning_rate(system, state, &self.carried).max(director_rate(system, state));
        let Motion { square, weight } = self.deformation(system, state)?;
        Ok(Motion { square: square + turning.powi(2), weight })
    }

    /// Returns the rate at which forces of velocity slow a motion, rad/s: |v·f|/v·Mv with these forces f, or with all forces if that is
    /// less, as where a load balances drag. Zero at rest.
    ///
    /// # Errors
    /// Returns the errors of the forces.
    pub fn of_drag(&mut self, system: &System, state: &State) -> Result<f64, SolverError> {
        let Some(damping) = &mut self.damping else { return Ok(0.0) };
        let velocity = system.velocity(&state.p);
        let square = vectors::dot(&velocity, &state.p);
        if square == 0.0 {
            return Ok(0.0);
        }
        let [drag, forces] = damping.powers(system, state, &velocity)?;
        let gradient = self.operator.gradient_at(system, state)?;
        let free = system.coordinates().free();
        let potential = vectors::sum(velocity.len(), |k| velocity[k] * gradient[free[k] as usize]);
        Ok(drag.abs().min((forces - potential).abs()) / square)
    }

    /// Returns |uᵀKu|/uᵀMu, 1/s², and uᵀMu.
    fn deformation(&mut self, system: &System, state: &State) -> Result<Motion, SolverError> {
        let (n, mass) = (system.coordinates().free_count(), system.free_mass());
        let velocity = system.velocity(&state.p);
        let square = |v: &[f64]| vectors::sum(n, |k| mass[k] * (v[k] * v[k]));
        let mut relative = velocity.clone();
        let is_carried = self.carried.subtract(system, state.t, &mut relative);
        let weight = square(&relative);
        let still = Motion { square: 0.0, weight };
        if is_carried && weight <= STILL * STILL * square(&velocity) {
            return Ok(still);
        }
        let mut direction: Vec<f64> =
            relative.iter().enumerate().map(|(k, v)| v * self.operator.root_mass(system, k)).collect();
        if n == 0 || normalize(&mut direction) == 0.0 {
            return Ok(still);
        }
        let mut out = vec![0.0; n];
        self.operator.apply(system, state, &direction, &mut out)?;
        let found = vectors::sum(n, |k| direction[k] * out[k]).abs();
        let [_, reach] = system.coordinates().extent_and_reach(&system.positions(state));
        let amplitude = NOISE * f64::EPSILON * reach;
        if weight <= amplitude * amplitude * found * vectors::sum(n, |k| mass[k]) {
            return Ok(still);
        }
        if system.filter().is_none() {
            return Ok(Motion { square: found, weight });
        }
        // With a filtered mass, twice the kinetic energy of u is uᵀW⁻¹u instead of uᵀM u. W⁻¹ and M have equal products with the
        // velocity of a part that nothing holds.
        let momentum = |k: usize| state.p[k] - mass[k] * (velocity[k] - relative[k]);
        let filtered = vectors::sum(n, |k| relative[k] * momentum(k));
        Ok(Motion { square: found * weight / filtered, weight: filtered })
    }
}

/// Returns the largest rate at which the nodes of a part turn about their centre of mass, |I⁻¹L|, rad/s.
fn turning_rate(system: &System, state: &State, carried: &Carried) -> f64 {
    let coordinates = system.coordinates();
    let (x, v, mass) = (system.positions(state), system.velocities(state), system.mass());
    let at = |values: &[f64], node: usize| Vector3::from_column_slice(&values[3 * node..3 * node + 3]);
    let nodes = || (0..carried.node_count()).filter(|&node| !coordinates.is_director(node as u32));
    let mut sums = vec![(0.0, Vector3::zeros(), Vector3::zeros()); carried.count()];
    for node in nodes() {
        let (total, centre, momentum) = &mut sums[carried.part(node)];
        *total += mass[3 * node];
        *centre += mass[3 * node] * at(&x, node);
        *momentum += mass[3 * node] * at(&v, node);
    }
    let mut turns = vec![(Vector3::zeros(), Matrix3::zeros()); carried.count()];
    for node in nodes() {
        let (total, centre, momentum) = &sums[carried.part(node)];
        if *total > 0.0 {
            let (m, arm) = (mass[3 * node], at(&x, node) - centre / *total);
            let (spin, inertia) = &mut turns[carried.part(node)];
            *spin += m * arm.cross(&(at(&v, node) - momentum / *total));
            *inertia += m * (arm.norm_squared() * Matrix3::identity() - arm * arm.transpose());
        }
    }
    let rate = |(spin, inertia): (Vector3<f64>, Matrix3<f64>)| {
        // A straight body has no inertia about its line.
        let size = inertia.trace();
        inertia.pseudo_inverse(1e-12 * size).map_or(0.0, |inverse| (inverse * spin).norm())
    };
    turns.into_iter().map(rate).fold(0.0, f64::max)
}

/// Returns the largest rate |ḋ|/|d| of the directors d of rigid bodies, rad/s: at least √(2/3) of the rate at which the fastest body
/// turns.
fn director_rate(system: &System, state: &State) -> f64 {
    let coordinates = system.coordinates();
    if coordinates.directors().is_empty() {
        return 0.0;
    }
    let (x, v) = (system.positions(state), system.velocities(state));
    let length =
        |values: &[f64], node: usize| Vector3::from_column_slice(&values[3 * node..3 * node + 3]).norm();
    let rates =
        coordinates.directors().iter().map(|&node| length(&v, node as usize) / length(&x, node as usize));
    rates.filter(|rate| rate.is_finite()).fold(0.0, f64::max)
}
