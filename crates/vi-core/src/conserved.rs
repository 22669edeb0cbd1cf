//! What Noether's theorem gives: energy, linear and angular momentum of a state.
//! It must not know how a state came about.

use crate::{State, System};

/// Kinetic energy T = ½ pᵀM⁻¹p of the free coordinates, J.
pub fn kinetic_energy(system: &System, state: &State) -> f64 {
    match system.kinetic() {
        Some(_) => 0.5 * state.p.iter().zip(system.velocity(&state.p)).map(|(p, v)| p * v).sum::<f64>(),
        None => 0.5 * state.p.iter().zip(system.free_mass()).map(|(p, m)| p * p / m).sum::<f64>(),
    }
}

/// Linear momentum P = Σ p of points in space (3 coordinates a node), kg m/s; directors have none.
pub fn linear_momentum(system: &System, state: &State) -> [f64; 3] {
    let mut total = [0.0; 3];
    let coordinates = system.coordinates();
    for (&dof, p) in coordinates.free().iter().zip(&state.p) {
        if !coordinates.is_director(dof / 3) {
            total[dof as usize % 3] += p;
        }
    }
    total
}

/// Angular momentum L = Σ x × p about the origin, points in space, kg m²/s.
pub fn angular_momentum(system: &System, state: &State) -> [f64; 3] {
    let x = system.positions(state);
    let mut total = [0.0; 3];
    for (&dof, &p) in system.coordinates().free().iter().zip(&state.p) {
        // p along axis k adds x × e_k p, whose components are those of the other two axes.
        let (node, k) = (dof as usize / 3 * 3, dof as usize % 3);
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        total[i] += x[node + j] * p;
        total[j] -= x[node + i] * p;
    }
    total
}
