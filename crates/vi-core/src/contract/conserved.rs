//! The quantities of Noether's theorem for a state: energy, linear and angular momentum.

use crate::contract::system::{State, System};

/// Returns the kinetic energy T = ½ pᵀM⁻¹p of the free coordinates, J; ½ pᵀW p if the mass is filtered.
pub fn kinetic_energy(system: &System, state: &State) -> f64 {
    match system.kinetic().is_some() || system.filter().is_some() {
        true => 0.5 * state.p.iter().zip(system.velocity(&state.p)).map(|(p, v)| p * v).sum::<f64>(),
        false => 0.5 * state.p.iter().zip(system.free_mass()).map(|(p, m)| p * p / m).sum::<f64>(),
    }
}

/// Returns the linear momentum P = Σ p of points in space (3 coordinates per node), kg m/s. Directors do not contribute.
pub fn linear_momentum(system: &System, state: &State) -> [f64; 3] {
    let mut total = [0.0; 3];
    let coordinates = system.coordinates();
    let mut add = |dof: u32, p: f64| {
        if !coordinates.is_director(dof / 3) {
            total[dof as usize % 3] += p;
        }
    };
    each_momentum(system, state, &mut add);
    total
}

/// Returns the angular momentum L = Σ x × p about the origin for points in space, kg m²/s.
pub fn angular_momentum(system: &System, state: &State) -> [f64; 3] {
    angular_momentum_at(system, state, &system.positions(state))
}

/// Returns the angular momentum L = Σ x × p about the origin for points in space at the known positions x of all
/// coordinates (m), kg m²/s.
pub fn angular_momentum_at(system: &System, state: &State, x: &[f64]) -> [f64; 3] {
    let mut total = [0.0; 3];
    each_momentum(system, state, &mut |dof, p| {
        // p along axis k adds x × e_k p, which has components along the other two axes.
        let (node, k) = (dof as usize / 3 * 3, dof as usize % 3);
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        total[i] += x[node + j] * p;
        total[j] -= x[node + i] * p;
    });
    total
}

/// Calls `give` with the momentum of every coordinate that can move, along the axes of space.
fn each_momentum(system: &System, state: &State, give: &mut impl FnMut(u32, f64)) {
    let coordinates = system.coordinates();
    let free = coordinates.free().iter().zip(&state.p);
    if coordinates.node_axes().is_empty() {
        free.for_each(|(&dof, &p)| give(dof, p));
        return;
    }
    let mut all = vec![0.0; coordinates.dof_count()];
    free.for_each(|(&dof, &p)| all[dof as usize] = p);
    coordinates.to_space(&mut all);
    all.into_iter().enumerate().filter(|(_, p)| *p != 0.0).for_each(|(dof, p)| give(dof as u32, p));
}
