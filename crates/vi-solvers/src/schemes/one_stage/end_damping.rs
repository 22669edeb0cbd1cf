//! Dampers that act on the velocities at the end of a step, by an implicit Euler step at fixed positions:
//! ```text
//! M (v' − v) = B μ − Gᵀλ,   μ_i = −h c_i b_i·v',   G (v' − v) = 0.
//! ```
//! The columns of B are the covectors b_i of the dampers. It is stable for any c and never adds energy. With P the projection of
//! momenta onto the tangent space of the constraints, conjugate gradients solve
//! ```text
//! (Bᵀ M⁻¹ P B + diag 1/(h c)) μ = −Bᵀv
//! ```
//! for the impulses μ, which have neither a resultant nor a moment. So both momenta are kept to round-off, whatever the error of the
//! iteration is.

use vi_core::{Damper, Impulse, System};

use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::schemes::constraint::manifold::ConstraintManifold;
use crate::vectors;
use crate::work::Work;

/// Relative error at which the iteration ends.
const TOLERANCE: f64 = 1e-12;
/// Largest number of iterations. In exact arithmetic there are no more than dampers or coordinates. Ten blocks in a stack (120
/// coordinates) take 20 to 40.
const MOST_ITERATIONS: u32 = 1000;

/// The effects of the dampers on momenta, energies and impulses.
pub(super) struct Damped {
    /// M (v' − v) and v' − v of the free coordinates.
    pub(super) momentum: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    /// Dissipated energy, J (≥ 0).
    pub(super) dissipated: f64,
    /// Work of prescribed motion against the dampers and constraints, J.
    pub(super) prescribed: f64,
    /// The impulses between parts, N s.
    pub(super) impulses: Vec<Impulse>,
}

/// The dampers of a system at the end of a step.
pub(super) struct EndDampers<'a> {
    pub(super) system: &'a System,
    pub(super) inertia: &'a Inertia,
    /// The constraints with their directions there, if there are any.
    pub(super) manifold: Option<&'a ConstraintManifold>,
    pub(super) dampers: &'a [Damper],
    /// Time, s.
    pub(super) t: f64,
}

impl EndDampers<'_> {
    /// Damps the velocities v of the free coordinates over h (s), where `x_dot` holds those of all coordinates.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if constraints depend on each other where they did not before.
    pub(super) fn damp(
        &self,
        v: &[f64],
        mut x_dot: Vec<f64>,
        h: f64,
        work: &mut Work,
    ) -> Result<Damped, SolverError> {
        let coordinates = self.system.coordinates();
        let count = self.dampers.len();
        let mut r: Vec<f64> = self.dampers.iter().map(|damper| -damper.rate(&x_dot)).collect();
        let softness: Vec<f64> = self.dampers.iter().map(|damper| 1.0 / (h * damper.coefficient)).collect();
        let mut impulses = vec![0.0; count];
        let mut z: Vec<f64> = (0..count).map(|i| r[i] / softness[i]).collect();
        let mut direction = z.clone();
        let mut size = vectors::dot(&r, &z);
        let enough = TOLERANCE * TOLERANCE * size;
        for _ in 0..MOST_ITERATIONS {
            if size <= enough {
                break;
            }
            let (_, moved, _) = self.respond(&direction, work)?;
            coordinates.embed_change(&moved, &mut x_dot);
            let along = |i: usize| self.dampers[i].rate(&x_dot) + softness[i] * direction[i];
            let applied: Vec<f64> = (0..count).map(along).collect();
            let step = size / vectors::dot(&direction, &applied);
            vectors::update(&mut impulses, |i, value| *value += step * direction[i]);
            vectors::update(&mut r, |i, r| *r -= step * applied[i]);
            vectors::fill(&mut z, |i| r[i] / softness[i]);
            let next = vectors::dot(&r, &z);
            vectors::update(&mut direction, |i, value| *value = z[i] + next / size * *value);
            size = next;
        }
        let (momentum, velocity, of_constraints) = self.respond(&impulses, work)?;
        let kinetic = vectors::sum(v.len(), |k| momentum[k] * (v[k] + 0.5 * velocity[k]));
        let mut prescribed = 0.0;
        if coordinates.is_moving() {
            coordinates.embed_velocity(&vec![0.0; v.len()], self.t, &mut x_dot);
            let along = self.dampers.iter().map(|damper| damper.rate(&x_dot));
            prescribed =
                of_constraints - along.zip(&impulses).map(|(rate, impulse)| rate * impulse).sum::<f64>();
        }
        let exchanged = |(damper, impulse): (&Damper, &f64)| Impulse {
            between: damper.between,
            value: damper.on_first.map(|b| impulse * b),
        };
        let impulses = self.dampers.iter().zip(&impulses).map(exchanged).collect();
        Ok(Damped { momentum, velocity, dissipated: prescribed - kinetic, prescribed, impulses })
    }

    /// Returns P B μ, M⁻¹ P B μ, and the work of prescribed motion against the constraints.
    fn respond(&self, impulses: &[f64], work: &mut Work) -> Result<(Vec<f64>, Vec<f64>, f64), SolverError> {
        let coordinates = self.system.coordinates();
        let mut x = vec![0.0; coordinates.dof_count()];
        self.dampers.iter().zip(impulses).for_each(|(damper, &impulse)| damper.add_covector(impulse, &mut x));
        coordinates.pull_back(&mut x);
        let mut momentum = vec![0.0; coordinates.free_count()];
        coordinates.restrict(&x, &mut momentum);
        let of_constraints =
            self.manifold.map_or(Ok(0.0), |manifold| manifold.project_covector(&mut momentum))?;
        let mut velocity = momentum.clone();
        self.inertia.divide(self.system, &mut velocity, work);
        Ok((momentum, velocity, of_constraints))
    }
}

#[cfg(test)]
mod tests {
    use vi_core::{Coordinates, Path, Prescribed};

    use super::*;

    /// Three nodes of masses 1, 2 and 3 kg in a row along x, of which the third one is prescribed if `moves`, and two dampers
    /// between neighbours, one of them much stiffer than inertia resists.
    fn chain(moves: bool) -> (System, [Damper; 2]) {
        struct Uniform;
        impl Path for Uniform {
            fn position(&self, t: f64, out: &mut [f64]) {
                out.copy_from_slice(&[0.3 * t, 0.0, 0.0]);
            }
            fn velocity(&self, _t: f64, out: &mut [f64]) {
                out.copy_from_slice(&[0.3, 0.0, 0.0]);
            }
        }
        let prescribed = Prescribed { dofs: vec![6, 7, 8], path: Box::new(Uniform) };
        let coordinates = Coordinates::new(9, if moves { vec![prescribed] } else { Vec::new() }).unwrap();
        let masses = [1.0, 2.0, 3.0].iter().flat_map(|mass| [*mass; 3]).collect();
        let between = |first: u32, coefficient: f64| Damper {
            coefficient,
            covector: vec![(first, [1.0, 0.0, 0.0]), (first + 1, [-1.0, 0.0, 0.0])],
            between: [first, first + 1],
            on_first: [1.0, 0.0, 0.0],
        };
        (System::new(masses, Vec::new(), coordinates).unwrap(), [between(0, 5.0), between(1, 1e9)])
    }

    #[test]
    fn it_makes_an_implicit_step_that_keeps_momentum_and_accounts_for_energy() {
        let h = 0.1;
        for moves in [false, true] {
            let (system, dampers) = chain(moves);
            let n = system.free_mass().len();
            let v: Vec<f64> = (0..n).map(|k| (1.7 * k as f64).sin()).collect();
            let inertia = Inertia::new(&system);
            let ends =
                EndDampers { system: &system, inertia: &inertia, manifold: None, dampers: &dampers, t: 0.0 };
            let mut x_dot = vec![0.0; 9];
            system.coordinates().embed_velocity(&v, 0.0, &mut x_dot);
            let damped = ends.damp(&v, x_dot, h, &mut Work::default()).unwrap();
            let after: Vec<f64> = (0..n).map(|k| v[k] + damped.velocity[k]).collect();
            let third = if moves { 0.3 } else { after[6] };
            let rates = [after[0] - after[3], after[3] - third];
            let forces = [0, 1].map(|k: usize| dampers[k].coefficient * rates[k]);
            let mut expected = vec![0.0; n];
            (expected[0], expected[3]) = (-h * forces[0], h * (forces[0] - forces[1]));
            if !moves {
                expected[6] = h * forces[1];
                assert!((0..3).map(|node| damped.momentum[3 * node]).sum::<f64>().abs() < 1e-15);
            }
            for k in 0..n {
                assert!((damped.momentum[k] - expected[k]).abs() < 1e-6, "{k}: {:?}", damped.momentum);
            }
            let kinetic = |v: &[f64]| -> f64 {
                v.iter().zip(system.free_mass()).map(|(v, mass)| 0.5 * mass * v * v).sum()
            };
            let work = if moves { -h * forces[1] * 0.3 } else { 0.0 };
            assert!((damped.prescribed - work).abs() < 1e-6, "{} {work}", damped.prescribed);
            let balance = kinetic(&after) - kinetic(&v) + damped.dissipated - damped.prescribed;
            assert!(balance.abs() < 1e-14 && damped.dissipated > 0.0, "{balance:e}");
        }
    }
}
