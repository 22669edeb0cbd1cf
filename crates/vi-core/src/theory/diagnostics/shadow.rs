//! Shadow Hamiltonians: the Hamiltonian that a symplectic step of length h conserves, to second order in h (Hairer,
//! Lubich & Wanner 2006, §IX.3, §IX.8). Its remaining variation is O(h⁴).

use nalgebra::DVector;

use crate::contract::conserved::kinetic_energy;
use crate::contract::dense;
use crate::contract::system::{State, System};
use crate::theory::lagrange::expansion::Expand;

/// Returns the parts of both corrections: H, q̇ᵀ∇²V q̇ and ∇Vᵀ M⁻¹ ∇V.
fn parts(system: &System, state: &State) -> (f64, f64, f64) {
    let v = DVector::from_vec(system.velocity(&state.p));
    let at = system.expansion(state.t, &state.q, v.as_slice());
    let force = at.d_q.dot(&DVector::from_vec(system.velocity(at.d_q.as_slice())));
    let energy = kinetic_energy(system, state) + dense::energy(system, &system.positions(state), state.t);
    (energy, -v.dot(&(&at.qq * &v)), force)
}

/// Returns the shadow Hamiltonian of Störmer–Verlet (kick-drift-kick), H + h² (q̇ᵀ∇²V q̇/12 − ∇VᵀM⁻¹∇V/24), J.
pub fn verlet_shadow(system: &System, state: &State, h: f64) -> f64 {
    let (energy, curvature, force) = parts(system, state);
    energy + h * h * (curvature / 12.0 - force / 24.0)
}

/// Returns the shadow Hamiltonian of implicit midpoint, H − (h²/24) H''(f, f) with f = J∇H, J. For H = T + V,
/// H''(f, f) = q̇ᵀ∇²V q̇ + ∇VᵀM⁻¹∇V.
pub fn midpoint_shadow(system: &System, state: &State, h: f64) -> f64 {
    let (energy, curvature, force) = parts(system, state);
    energy - h * h / 24.0 * (curvature + force)
}
