//! Computes vibration modes about a state: the lowest eigenpairs of K φ = ω² M φ, with rigid motions marked.

use std::sync::Arc;

use vi_core::{Potential, State, System, Terms, binary_exponent};

use crate::assemble::finite::check_state;
use crate::assemble::hessian::HessianEvaluation;
use crate::assemble::inertia::mass_matrix;
use crate::equilibrium::balance::{Balance, refuse_constraints};
use crate::equilibrium::circulation::{Circulation, circulatory};
use crate::error::SolverError;
use crate::interrupt::Interrupt;
use crate::linear::lanczos::lowest_pairs;
use crate::linear::matrix::SymmetricMatrix;
use crate::linear::pencil::Pencil;
use crate::options::LinearSolver;
use crate::vectors;

/// Number and accuracy of the modes.
#[derive(Debug, Clone, PartialEq)]
pub struct ModeOptions {
    /// Number of modes, including rigid ones.
    pub count: usize,
    /// Largest residual ‖A⁻¹Mφ − θφ‖_M/θ of the shifted and inverted problem; eigenvalues are accurate to its square.
    pub tolerance: f64,
    /// The request that ends the search.
    pub interrupt: Interrupt,
}

impl Default for ModeOptions {
    fn default() -> Self {
        Self { count: 12, tolerance: 1e-7, interrupt: Interrupt::NEVER }
    }
}

/// A mode of vibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Mode {
    /// ω², 1/s²; negative if the state is unstable.
    pub omega_squared: f64,
    /// The shape φ on the free coordinates, normalised to φᵀMφ = 1 (kg^(−1/2)).
    pub shape: Vec<f64>,
    /// Whether the mode is a motion of the whole body without strain.
    pub is_rigid: bool,
    /// The residual ‖Kφ − ω²Mφ‖ / ((|ω²| + σ) ‖Mφ‖) in the norm of the inverse lumped mass; σ is the shift.
    pub residual: f64,
    /// Participation factors Γ_k = φᵀMe_k of the translations e_k along x, y and z, √kg. Γ_k² is the effective modal
    /// mass; its sum over all modes of a system is [`Modes::free_mass`]. Zero if the coordinates are not those of
    /// points in space.
    pub participation: [f64; 3],
}

/// The lowest modes of a system.
#[derive(Debug, Clone, PartialEq)]
pub struct Modes {
    /// The modes in ascending order of ω².
    pub modes: Vec<Mode>,
    /// e_kᵀMe_k of the translations e_k of the free coordinates along x, y and z, kg: the mass that can move in that
    /// direction.
    pub free_mass: [f64; 3],
}

impl Mode {
    /// Returns ω/2π, Hz; zero if ω² is not positive.
    pub fn frequency(&self) -> f64 {
        self.omega_squared.max(0.0).sqrt() / std::f64::consts::TAU
    }
}

/// Largest part of the tangent that may be unsymmetric, relative to a mode: ω² changes by no larger a fraction.
const UNSYMMETRIC: f64 = 1e-5;

/// Returns the lowest modes about `state` in ascending order of ω². The tangent is that of V and of the forces
/// without a potential, which must be symmetric. `mass` gives the kinetic energy as quadratic local terms of the velocities,
/// whose Hessians are blocks of M (consistent mass). If it is empty, M is the system's own mass.
///
/// # Errors
/// Returns [`SolverError::Option`] for a count of zero; [`SolverError::Circulatory`] if the tangent is not symmetric; an error of a term or a factor; [`SolverError::NoConvergence`];
/// [`SolverError::Interrupted`].
pub fn modes(
    system: &System,
    state: &State,
    mass: Vec<Box<dyn Potential>>,
    options: &ModeOptions,
) -> Result<Modes, SolverError> {
    if options.count == 0 {
        let allowed = "must be at least 1";
        return Err(SolverError::Option { option: "modes.count", value: 0.0, allowed });
    }
    refuse_constraints("a search for modes", system)?;
    check_state(state, system)?;
    let mut balance = Balance::new(system, LinearSolver::Cholesky, &options.interrupt);
    let mut residual = vec![0.0; state.q.len()];
    balance.residual(&state.q, state.t, &mut residual)?;
    let stiffness = balance.tangent(&state.q, state.t, HessianEvaluation::Exact)?;
    let consistent = match (mass.is_empty(), system.kinetic()) {
        (true, own) => own.map(mass_matrix),
        (false, _) => Some(matrix_of(system, mass)?),
    };
    // Norms with the mass take square roots. Their digits do not depend on the units of a scene if masses are
    // measured in a power of two near the largest of them. The same holds for shifts and the stiffness.
    let mut diagonal = vec![0.0; state.q.len()];
    stiffness.diagonal(&mut diagonal);
    let (unit_of_mass, unit_of_stiffness) = (binary_unit(system.free_mass()), binary_unit(&diagonal));
    let stiffness = scaled(stiffness, 1.0 / unit_of_stiffness);
    let lumped = system.free_mass().iter().map(|mass| mass / unit_of_mass).collect();
    let consistent = consistent.map(|mass| scaled(&mass, 1.0 / unit_of_mass));
    let mut pencil = match consistent {
        None => Pencil::lumped(stiffness, lumped)?,
        Some(mass) => Pencil::consistent(stiffness, lumped, mass)?,
    }
    .interruptible(&options.interrupt);
    let count = options.count.min(state.q.len());
    let pairs = lowest_pairs(&mut pencil, count, options.tolerance)?;
    let rigid = rigid_motions(system, state, &mut pencil);
    let translations = [0, 1, 2].map(|axis| translation(system, axis));
    let scale = pairs.iter().map(|pair| pair.value.abs()).fold(0.0, f64::max);
    let n = state.q.len();
    let mut modes = Vec::with_capacity(pairs.len());
    for pair in pairs {
        let residual = pencil.residual(&pair.vector, pair.value);
        let mut weighted = vec![0.0; n];
        pencil.multiply_mass(&pair.vector, &mut weighted);
        let participation =
            translations.each_ref().map(|motion| vectors::sum(n, |k| motion[k] * weighted[k]));
        let overlap: f64 =
            rigid.iter().map(|motion| vectors::sum(n, |k| motion[k] * weighted[k]).powi(2)).sum();
        // If all modes of a body are rigid, the shift is the only value to compare with.
        let is_zero = pair.value.abs() <= 1e-6 * scale.max(pencil.shift);
        modes.push(Mode {
            omega_squared: pair.value * unit_of_stiffness / unit_of_mass,
            shape: pair.vector.iter().map(|value| value / unit_of_mass.sqrt()).collect(),
            is_rigid: is_zero && overlap > 0.999,
            residual,
            participation: participation.map(|factor| factor * unit_of_mass.sqrt()),
        });
    }
    let shift = pencil.shift * unit_of_stiffness / unit_of_mass;
    refuse_circulation(system, state, &modes, shift)?;
    let free_mass = translations.each_ref().map(|motion| unit_of_mass * pencil.mass_product(motion, motion));
    Ok(Modes { modes, free_mass })
}

/// Refuses modes that the unsymmetric part of the tangent would change. `shift` is a scale of ω², 1/s².
fn refuse_circulation(system: &System, state: &State, modes: &[Mode], shift: f64) -> Result<(), SolverError> {
    let (Some(force), Some(mut circulation)) = (circulatory(system), Circulation::new(system)) else {
        return Ok(());
    };
    let (x, mass) = (system.positions(state), system.free_mass());
    let mut size = 0.0_f64;
    for Mode { omega_squared, shape, .. } in modes {
        let part = circulation.along(system, (&x, state.t), shape);
        let square = vectors::sum(part.len(), |k| part[k] * part[k] / mass[k]);
        let inertia = vectors::sum(part.len(), |k| mass[k] * shape[k] * shape[k]);
        // Modes without a stiffness of their own, such as rigid motions, are measured by the shift.
        size = size.max((square / inertia).sqrt() / omega_squared.abs().max(0.01 * shift));
    }
    if size <= UNSYMMETRIC {
        return Ok(());
    }
    Err(SolverError::Circulatory { force: force.to_owned(), size })
}

/// Returns the power of two at or below the largest absolute value; 1 if all values are zero.
fn binary_unit(values: &[f64]) -> f64 {
    2.0_f64.powi(binary_exponent(values.iter().fold(0.0, |largest, value| value.abs().max(largest))))
}

/// Returns `factor` × `matrix`.
fn scaled(matrix: &SymmetricMatrix, factor: f64) -> SymmetricMatrix {
    let mut scaled = matrix.clone();
    scaled.set_shifted(&[], factor, matrix);
    scaled
}

/// Returns M, assembled from its local terms.
fn matrix_of(system: &System, terms: Vec<Box<dyn Potential>>) -> Result<SymmetricMatrix, SolverError> {
    let mismatch = |_| SolverError::Memory { missing: "mass of this system" };
    let coordinates = Arc::new(system.coordinates().held());
    let terms = terms.into_iter().map(Arc::from).collect();
    Ok(mass_matrix(&Terms::new(coordinates, terms).map_err(mismatch)?))
}

/// Returns the translation of the free coordinates along an axis; zero for systems that are not points in space.
fn translation(system: &System, axis: usize) -> Vec<f64> {
    let coordinates = system.coordinates();
    let count = coordinates.dof_count();
    let moves =
        |dof: usize| count.is_multiple_of(3) && dof % 3 == axis && !coordinates.is_director(dof as u32 / 3);
    let mut all: Vec<f64> = (0..count).map(|dof| f64::from(u8::from(moves(dof)))).collect();
    coordinates.to_own_axes(&mut all);
    let mut free = vec![0.0; coordinates.free_count()];
    coordinates.restrict(&all, &mut free);
    free
}

/// Returns the translations and infinitesimal rotations of the free coordinates about `state`, M-orthonormal; empty
/// for systems that are not points in space.
fn rigid_motions(system: &System, state: &State, pencil: &mut Pencil) -> Vec<Vec<f64>> {
    let coordinates = system.coordinates();
    if !coordinates.dof_count().is_multiple_of(3) {
        return Vec::new();
    }
    let x = system.positions(state);
    let n = coordinates.free_count();
    let mut motions: Vec<Vec<f64>> = Vec::new();
    for kind in 0..6 {
        let axis = kind % 3;
        let mut motion = if kind < 3 {
            translation(system, axis)
        } else {
            // Velocity of a unit rotation, e_axis × x.
            let rotate = |dof: usize| {
                let (node, k) = (dof / 3 * 3, dof % 3);
                let (next, last) = ((axis + 1) % 3, (axis + 2) % 3);
                match k {
                    k if k == last => x[node + next],
                    k if k == next => -x[node + last],
                    _ => 0.0,
                }
            };
            let mut all: Vec<f64> = (0..x.len()).map(rotate).collect();
            coordinates.to_own_axes(&mut all);
            let mut motion = vec![0.0; n];
            coordinates.restrict(&all, &mut motion);
            motion
        };
        let size = pencil.mass_product(&motion, &motion).sqrt();
        for _ in 0..2 {
            for other in &motions {
                let along = pencil.mass_product(other, &motion);
                for (value, other) in motion.iter_mut().zip(other) {
                    *value -= along * other;
                }
            }
        }
        let rest = pencil.mass_product(&motion, &motion).sqrt();
        if n > 0 && rest > 1e-6 * size {
            motion.iter_mut().for_each(|value| *value /= rest);
            motions.push(motion);
        }
    }
    motions
}
