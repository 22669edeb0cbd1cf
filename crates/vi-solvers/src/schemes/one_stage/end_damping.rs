//! Dampers and friction that act on the velocities at the end of a step, by an implicit Euler step at fixed positions:
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
//!
//! Friction is a damper whose c depends on its rate of slip and on the impulses of the dampers that press its pair, both at v'
//! ([`DryFriction`]). They are found by repeated substitution, each time with a c that only dissipates. Friction of the step that is
//! taken back brings energy, at most what the step has dissipated: otherwise nothing is taken back. At the rim of a body, where a
//! normal is inclined to the direction of sliding, what is taken back may open pairs further, so that more is taken back, without end.

use std::collections::BTreeMap;

use vi_core::{Damper, DryFriction, EndForces, Impulse, System};

use crate::assemble::inertia::Inertia;
use crate::error::SolverError;
use crate::schemes::constraint::manifold::ConstraintManifold;
use crate::unit_of_mass::per_unit_of_mass;
use crate::vectors;
use crate::work::Work;

/// Relative error at which the iteration ends.
const TOLERANCE: f64 = 1e-12;
/// Largest number of iterations. In exact arithmetic there are no more than dampers or coordinates. Ten blocks in a stack (120
/// coordinates) take 20 to 40.
const MOST_ITERATIONS: u32 = 1000;
/// Change of the impulses of friction, relative to Coulomb's limit, at which substitution ends.
const ENOUGH: f64 = 1e-4;
/// Largest number of substitutions.
const MOST_SUBSTITUTIONS: u32 = 30;

/// The effects of the dampers on momenta, energies and impulses.
pub(super) struct Damped {
    /// M (v' − v) and v' − v of the free coordinates.
    pub(super) momentum: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    /// Energy that dampers dissipate, J, and that of friction where pairs slide.
    pub(super) dissipated: f64,
    pub(super) friction: f64,
    /// Work of prescribed motion against the dampers and constraints, J.
    pub(super) prescribed: f64,
    /// The impulses between parts, N s.
    pub(super) impulses: Vec<Impulse>,
    /// The nodes of each damper, and its impulses there with the sign of a gradient, N s.
    pub(super) nodal: Vec<(Vec<u32>, Vec<f64>)>,
}

/// The forces on velocities at the end of a step of a system.
pub(super) struct EndDampers<'a> {
    pub(super) system: &'a System,
    pub(super) inertia: &'a Inertia,
    /// The constraints with their directions there, if there are any.
    pub(super) manifold: Option<&'a ConstraintManifold>,
    pub(super) forces: &'a EndForces,
    /// Time, s.
    pub(super) t: f64,
    /// Duration of the step, s.
    pub(super) h: f64,
}

/// A solution μ for given coefficients.
struct Solution {
    /// μ, N s, and b·v', m/s, of each damper.
    impulses: Vec<f64>,
    rates: Vec<f64>,
    response: Response,
}

/// Momenta P B μ, velocities M⁻¹ P B μ, and the work of prescribed motion against the constraints.
struct Response {
    momentum: Vec<f64>,
    velocity: Vec<f64>,
    of_constraints: f64,
}

impl EndDampers<'_> {
    /// Damps the velocities v of the free coordinates over the step, where `x_dot` holds those of all coordinates. Friction and
    /// damping have `dissipated` this energy over the step, J.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstraintDefect`] if constraints depend on each other where they did not before.
    pub(super) fn damp(
        &self,
        v: &[f64],
        x_dot: &[f64],
        dissipated: f64,
        work: &mut Work,
    ) -> Result<Damped, SolverError> {
        let EndForces { dampers, friction } = self.forces;
        let dampers: Vec<&Damper> =
            dampers.iter().chain(friction.iter().flat_map(|friction| &friction.along)).collect();
        let rates: Vec<f64> = dampers.iter().map(|damper| damper.rate(x_dot)).collect();
        let whole = self.substitute(&dampers, &rates, true, work)?;
        let damped = self.account(&dampers, v, &rates, whole);
        if damped.dissipated + damped.friction + dissipated >= 0.0 {
            return Ok(damped);
        }
        let dissipative = self.substitute(&dampers, &rates, false, work)?;
        Ok(self.account(&dampers, v, &rates, dissipative))
    }

    /// Finds the impulses of dampers and friction, where the dampers have these rates before. Friction of the step is taken back if
    /// `takes_back`.
    fn substitute(
        &self,
        dampers: &[&Damper],
        rates: &[f64],
        takes_back: bool,
        work: &mut Work,
    ) -> Result<Solution, SolverError> {
        let none = vec![0.0; dampers.len()];
        let mut taken_back = none.clone();
        let mut coefficients = self.coefficients(rates, &taken_back);
        let mut solution = self.solve(dampers, &coefficients, &taken_back, rates, work)?;
        for _ in 0..MOST_SUBSTITUTIONS {
            let back = if takes_back { self.taken_back(&solution.impulses) } else { none.clone() };
            let next = (self.coefficients(&solution.rates, &solution.impulses), back);
            let enough = ENOUGH * self.limit(&solution.impulses);
            let change = |k: usize| {
                next.1[k] - taken_back[k] - self.h * (next.0[k] - coefficients[k]) * solution.rates[k]
            };
            if self.size_of_friction(change) <= enough {
                break;
            }
            (coefficients, taken_back) = next;
            let next = self.solve(dampers, &coefficients, &taken_back, rates, work)?;
            let last = std::mem::replace(&mut solution, next);
            if self.size_of_friction(|k| solution.impulses[k] - last.impulses[k]) <= enough {
                break;
            }
        }
        Ok(solution)
    }

    /// Returns the effects of a solution on velocities v with these rates.
    fn account(&self, dampers: &[&Damper], v: &[f64], rates: &[f64], solution: Solution) -> Damped {
        let Solution { impulses, rates: after, response } = solution;
        let Response { momentum, velocity, of_constraints } = response;
        let kinetic = vectors::sum(v.len(), |k| momentum[k] * (v[k] + 0.5 * velocity[k]));
        let coordinates = self.system.coordinates();
        let mut prescribed = 0.0;
        if coordinates.is_moving() {
            let mut x_dot = vec![0.0; coordinates.dof_count()];
            coordinates.embed_velocity(&vec![0.0; v.len()], self.t, &mut x_dot);
            let along = dampers.iter().map(|damper| damper.rate(&x_dot));
            prescribed =
                of_constraints - along.zip(&impulses).map(|(rate, impulse)| rate * impulse).sum::<f64>();
        }
        let sliding = self.forces.friction.iter().enumerate().filter(|(_, friction)| friction.slides());
        let work = |k: usize| 0.5 * impulses[k] * (rates[k] + after[k]);
        let friction = -sliding.flat_map(|(i, _)| self.places(i)).map(work).sum::<f64>();
        let exchanged = |(damper, impulse): (&&Damper, &f64)| Impulse {
            between: damper.between,
            value: damper.on_first.map(|b| impulse * b),
        };
        let nodal = |(damper, impulse): (&&Damper, &f64)| {
            let nodes = damper.covector.iter().map(|(node, _)| *node).collect();
            (nodes, damper.covector.iter().flat_map(|(_, b)| b.map(|b| -impulse * b)).collect())
        };
        let nodal = dampers.iter().zip(&impulses).map(nodal).collect();
        let impulses = dampers.iter().zip(&impulses).map(exchanged).collect();
        Damped {
            momentum,
            velocity,
            dissipated: prescribed - kinetic - friction,
            friction,
            prescribed,
            impulses,
            nodal,
        }
    }

    /// Returns the places of the dampers of a pair with friction.
    fn places(&self, friction: usize) -> [usize; 2] {
        let first = self.forces.dampers.len() + 2 * friction;
        [first, first + 1]
    }

    /// Returns the coefficients of all dampers at these rates (m/s) and impulses (N s).
    fn coefficients(&self, rates: &[f64], impulses: &[f64]) -> Vec<f64> {
        let EndForces { dampers, friction } = self.forces;
        let of_pairs = friction.iter().zip(self.pressing(impulses)).enumerate();
        let of_friction = of_pairs.flat_map(|(i, (friction, pressing))| {
            let [a, b] = self.places(i).map(|k| rates[k]);
            [friction.coefficient_at(a.hypot(b), pressing); 2]
        });
        dampers.iter().map(|damper| damper.coefficient).chain(of_friction).collect()
    }

    /// Returns the impulses (N s) that take back friction of the step, where dampers have these impulses.
    fn taken_back(&self, impulses: &[f64]) -> Vec<f64> {
        let pairs = self.forces.friction.iter().zip(self.pressing(impulses));
        let of_friction = pairs.flat_map(|(pair, force)| pair.taken_back(force).map(|force| self.h * force));
        std::iter::repeat_n(0.0, self.forces.dampers.len()).chain(of_friction).collect()
    }

    /// Returns for each pair with friction the force of the dampers that press it, N.
    fn pressing(&self, impulses: &[f64]) -> Vec<f64> {
        let mut pressing = BTreeMap::<u64, f64>::new();
        for (damper, impulse) in self.forces.dampers.iter().zip(impulses) {
            *pressing.entry(damper.pair).or_default() += impulse / self.h;
        }
        let of_pair = |friction: &DryFriction| pressing.get(&friction.along[0].pair).copied().unwrap_or(0.0);
        self.forces.friction.iter().map(of_pair).collect()
    }

    /// Returns the sum of Coulomb's limits, N s.
    fn limit(&self, impulses: &[f64]) -> f64 {
        let pairs = self.forces.friction.iter().zip(self.pressing(impulses));
        pairs.map(|(pair, force)| self.h * pair.friction * (pair.pressing + force).max(0.0)).sum()
    }

    /// Returns Σ |(s_a, s_b)| over the pairs with friction, where a and b are the places of their dampers.
    fn size_of_friction(&self, s: impl Fn(usize) -> f64) -> f64 {
        let places = (0..self.forces.friction.len()).map(|friction| self.places(friction));
        places.map(|[a, b]| s(a).hypot(s(b))).sum()
    }

    /// Finds the impulses for given coefficients next to `given` impulses, where the dampers have these rates before. With s = √(h c)
    /// and the rates a after the given impulses, it solves (1 + s Bᵀ M⁻¹ P B s) ν = −s a for ν, and μ = s ν. Roots are taken
    /// in a unit of mass u, with s/√u in place of s and ν/√u in place of ν; then μ = u (s/√u)(ν/√u).
    fn solve(
        &self,
        dampers: &[&Damper],
        coefficients: &[f64],
        given: &[f64],
        rates: &[f64],
        work: &mut Work,
    ) -> Result<Solution, SolverError> {
        let count = dampers.len();
        let per_unit = per_unit_of_mass(self.system.free_mass());
        let scale: Vec<f64> = coefficients.iter().map(|c| (per_unit * (self.h * c)).sqrt()).collect();
        let mut rates = rates.to_vec();
        if given.iter().any(|&impulse| impulse != 0.0) {
            let changes = self.changes(dampers, &self.respond(dampers, given, work)?);
            vectors::update(&mut rates, |i, rate| *rate += changes[i]);
        }
        let mut r: Vec<f64> = (0..count).map(|i| -scale[i] * rates[i]).collect();
        let (mut scaled, mut direction) = (vec![0.0; count], r.clone());
        let mut size = vectors::dot(&r, &r);
        let enough = TOLERANCE * TOLERANCE * size;
        let mut impulses = vec![0.0; count];
        for _ in 0..MOST_ITERATIONS {
            if size <= enough {
                break;
            }
            vectors::fill(&mut impulses, |i| scale[i] * direction[i] / per_unit);
            let changes = self.changes(dampers, &self.respond(dampers, &impulses, work)?);
            let applied: Vec<f64> = (0..count).map(|i| direction[i] + scale[i] * changes[i]).collect();
            let step = size / vectors::dot(&direction, &applied);
            vectors::update(&mut scaled, |i, value| *value += step * direction[i]);
            vectors::update(&mut r, |i, r| *r -= step * applied[i]);
            let next = vectors::dot(&r, &r);
            vectors::update(&mut direction, |i, value| *value = r[i] + next / size * *value);
            size = next;
        }
        vectors::fill(&mut impulses, |i| scale[i] * scaled[i] / per_unit);
        let changes = self.changes(dampers, &self.respond(dampers, &impulses, work)?);
        vectors::update(&mut rates, |i, rate| *rate += changes[i]);
        vectors::update(&mut impulses, |i, impulse| *impulse += given[i]);
        let response = self.respond(dampers, &impulses, work)?;
        Ok(Solution { impulses, rates, response })
    }

    /// Returns the changes b·(v' − v) of the rates.
    fn changes(&self, dampers: &[&Damper], response: &Response) -> Vec<f64> {
        let coordinates = self.system.coordinates();
        let mut x_dot = vec![0.0; coordinates.dof_count()];
        coordinates.embed_change(&response.velocity, &mut x_dot);
        dampers.iter().map(|damper| damper.rate(&x_dot)).collect()
    }

    fn respond(
        &self,
        dampers: &[&Damper],
        impulses: &[f64],
        work: &mut Work,
    ) -> Result<Response, SolverError> {
        let coordinates = self.system.coordinates();
        let mut x = vec![0.0; coordinates.dof_count()];
        dampers.iter().zip(impulses).for_each(|(damper, &impulse)| damper.add_covector(impulse, &mut x));
        coordinates.pull_back(&mut x);
        let mut momentum = vec![0.0; coordinates.free_count()];
        coordinates.restrict(&x, &mut momentum);
        let of_constraints =
            self.manifold.map_or(Ok(0.0), |manifold| manifold.project_covector(&mut momentum))?;
        let mut velocity = momentum.clone();
        self.inertia.divide(self.system, &mut velocity, work);
        Ok(Response { momentum, velocity, of_constraints })
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
            pair: u64::from(first),
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
            let forces = EndForces { dampers: dampers.to_vec(), friction: Vec::new() };
            let ends =
                EndDampers { system: &system, inertia: &inertia, manifold: None, forces: &forces, t: 0.0, h };
            let mut x_dot = vec![0.0; 9];
            system.coordinates().embed_velocity(&v, 0.0, &mut x_dot);
            let damped = ends.damp(&v, &x_dot, 0.0, &mut Work::default()).unwrap();
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

    /// A mass of 2 kg is pressed in z at 1 m/s by a stiff damper, or held back by −4 N, and slides in x: the impulse of friction is μ
    /// times that of the damper, at most what stops the mass, and negative where the damper holds back.
    #[test]
    fn friction_follows_the_impulse_of_the_dampers() {
        let system = System::new(vec![2.0; 3], Vec::new(), Coordinates::new(3, Vec::new()).unwrap()).unwrap();
        let inertia = Inertia::new(&system);
        let (h, friction) = (0.1, 0.3);
        let damper = |axis: usize, coefficient: f64| {
            let b = std::array::from_fn(|k| f64::from(u8::from(k == axis)));
            Damper { pair: 7, coefficient, covector: vec![(0, b)], between: [0, 1], on_first: b }
        };
        let sliding = DryFriction {
            along: [damper(0, 0.0), damper(1, 0.0)],
            coefficient: f64::INFINITY,
            reserve: 0.0,
            friction,
            pressing: 40.0,
            direction: [1.0, 0.0],
        };
        for (v, c) in [([3.0, 0.0, -1.0], 1e6), ([0.1, 0.0, -1.0], 1e6), ([3.5, 0.0, 1.0], 4.0)] {
            let forces = EndForces { dampers: vec![damper(2, c)], friction: vec![sliding.clone()] };
            let ends =
                EndDampers { system: &system, inertia: &inertia, manifold: None, forces: &forces, t: 0.0, h };
            let damped = ends.damp(&v, &v, 1e3, &mut Work::default()).unwrap();
            let [along, _, pressing] = [0, 1, 2].map(|k: usize| damped.momentum[k]);
            let expected = (-friction * pressing).max(-2.0 * v[0]);
            assert!((along - expected).abs() < 2e-4 * friction * 40.0 * h, "{along} {expected}");
            let lost = |from: f64, to: f64| from * from - to * to;
            let after = [0, 2].map(|k: usize| v[k] + damped.velocity[k]);
            assert!((damped.friction - lost(v[0], after[0])).abs() < 1e-12, "{}", damped.friction);
            assert!((damped.dissipated - lost(v[2], after[1])).abs() < 1e-12, "{}", damped.dissipated);
            // Without anything dissipated before, friction that would bring energy is not taken back.
            let damped = ends.damp(&v, &v, 0.0, &mut Work::default()).unwrap();
            let expected = if v[2] > 0.0 { 0.0 } else { along };
            assert_eq!(damped.momentum[0], expected);
            assert!(damped.dissipated > 0.0 && damped.friction >= 0.0, "{}", damped.friction);
        }
    }
}
