//! Equilibria of bodies with constraints g(q) = 0, by the method of multipliers (M. R. Hestenes, J. Optim. Theory Appl. 4
//! (1969) 303–320). With the constraints replaced by the potentials
//! ```text
//! λ_i g_i + ½ ρ_i g_i²
//! ```
//! an equilibrium is found as for any other body, then λ_i += ρ_i g_i, until g vanishes. The λ are the forces of the constraints, and
//! each round reduces g by the ratio of the stiffness of the body at the constraint to ρ.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

use vi_core::constraints::QuadraticConstraint;
use vi_core::{Account, HessianKind, Potential, Stencils, System, Traits};

use crate::equilibrium::balance::Balance;
use crate::equilibrium::newton::Solved;
use crate::error::SolverError;
use crate::index::{NONE, free_of};
use crate::schemes::constraint::cluster::curvature;
use crate::vectors;

/// Stiffness of a constraint relative to the inertia that it moves times the largest ω² of the body.
const STIFF: f64 = 10.0;
/// Stiffness of a constraint of bodies without stiffness of their own, relative to the inertia that it moves times the
/// acceleration by the loads over the extent of the bodies.
const STIFF_AGAINST_LOADS: f64 = 1e3;
/// Constraints that are stiff against the loads are made stiffer by `MUCH_STIFFER` if the tangent was not positive definite on the way to an
/// equilibrium, up to `MOST_ATTEMPTS` times in all. Soft ones may give way so far that the bodies pass into another configuration that meets
/// the constraints: two welded boxes 1 m long, with a stiffness of 1e3, turned by 120° under their weight.
const MUCH_STIFFER: f64 = 100.0;
const MOST_ATTEMPTS: u32 = 4;
/// If a round leaves more than this fraction of the defect, constraints are too soft and become stiffer by `STIFFER`.
const SLOW: f64 = 0.1;
const STIFFER: f64 = 10.0;
/// Defects relative to the terms that constraints sum. Below `MET`, constraints are met; below `NEARLY_MET`, they are
/// met if a round no longer reduces the defect, which is then round-off.
const MET: f64 = 1e-14;
const NEARLY_MET: f64 = 1e-11;
/// Largest number of rounds. A rod on a hinge, held by a soft bar, takes 29 Newton iterations of all rounds in four increments.
const MOST_ROUNDS: u32 = 40;

/// The force λ (N, or J for a constraint without dimension) and stiffness ρ of a constraint.
#[derive(Debug, Clone, Copy, Default)]
struct Hold {
    force: f64,
    stiffness: f64,
}

/// A constraint as a potential.
struct Held {
    /// The constraint on its own nodes, numbered from 0, and their numbers in the system.
    constraint: QuadraticConstraint,
    nodes: Vec<u32>,
    /// Whether each of them is a director, whose coordinates are not lengths.
    is_director: Vec<bool>,
    hold: Mutex<Hold>,
}

/// The constraints of a system in a search for equilibria.
pub(crate) struct ConstraintForces {
    held: Vec<Arc<Held>>,
    /// The free coordinate of each coordinate, or [`NONE`].
    free_of: Vec<u32>,
    /// Whether the loads determine the stiffness of the constraints, rather than the stiffness of the bodies.
    is_by_loads: bool,
}

impl Held {
    fn new(constraint: &QuadraticConstraint, system: &System) -> Self {
        let mut nodes: Vec<u32> = constraint.nodes().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let number = |node: u32| nodes.binary_search(&node).unwrap_or(0) as u32;
        let is_director = nodes.iter().map(|&node| system.coordinates().is_director(node)).collect();
        Self { constraint: constraint.renumbered(number), hold: Mutex::default(), is_director, nodes }
    }

    fn hold(&self) -> Hold {
        *self.hold.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set(&self, hold: Hold) {
        *self.hold.lock().unwrap_or_else(PoisonError::into_inner) = hold;
    }

    /// Returns the positions of its nodes.
    fn place(&self, x: &[f64]) -> Vec<f64> {
        self.nodes.iter().flat_map(|&node| &x[3 * node as usize..][..3]).copied().collect()
    }

    /// Returns factor · ∂g/∂y at its own positions y.
    fn gradient(&self, y: &[f64], factor: f64) -> Vec<f64> {
        let mut out = vec![0.0; y.len()];
        self.constraint.add_gradient(y, factor, &mut out);
        out
    }

    /// Returns |g| relative to the terms that it sums, in which points and directors count with at least these sizes.
    fn defect(&self, x: &[f64], sizes: [f64; 2]) -> f64 {
        let y = self.place(x);
        let value = self.constraint.value(&y).abs();
        let size = |node: u32| sizes[usize::from(self.is_director[node as usize])];
        if value == 0.0 { 0.0 } else { value / self.constraint.magnitude(&y, size) }
    }
}

impl Potential for Held {
    fn name(&self) -> &str {
        self.constraint.name()
    }

    fn account(&self) -> Account {
        Account::Elastic
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.nodes.len(), block: 3, nodes: &self.nodes }
    }

    /// Declares time dependence, so that nothing is cached: the force changes without notice.
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: true }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        let (Hold { force, stiffness }, g) = (self.hold(), self.constraint.value(&self.place(x)));
        out[..range.len()].fill(g * (force + 0.5 * stiffness * g));
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        if range.is_empty() {
            return;
        }
        let (Hold { force, stiffness }, y) = (self.hold(), self.place(x));
        let gradient = self.gradient(&y, force + stiffness * self.constraint.value(&y));
        out[..gradient.len()].copy_from_slice(&gradient);
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        if range.is_empty() {
            return;
        }
        let (Hold { force, stiffness }, y) = (self.hold(), self.place(x));
        let factor = force + stiffness * self.constraint.value(&y);
        let along = self.gradient(&y, 1.0);
        let curvature = curvature(std::iter::once((&self.constraint, factor)), y.len());
        let lower = (0..y.len()).flat_map(|i| (0..=i).map(move |j| (i, j)));
        out.iter_mut().zip(lower).for_each(|(out, (i, j))| {
            *out = curvature[(i, j)] + stiffness * along[i] * along[j];
        });
    }
}

impl ConstraintForces {
    /// Returns the constraints of a system, and the system in which potentials replace them; `None` without constraints.
    ///
    /// # Errors
    /// Returns [`SolverError::ConstrainedAnalysis`] if several ranks share the system.
    pub(super) fn of(system: &System) -> Result<Option<(Self, System)>, SolverError> {
        let Some(first) = system.constraints().first() else { return Ok(None) };
        let refused = || SolverError::ConstrainedAnalysis {
            analysis: "a static solve on several ranks",
            constraint: first.name().to_owned(),
        };
        if system.terms().shared().is_some() {
            return Err(refused());
        }
        let held: Vec<Arc<Held>> =
            system.constraints().iter().map(|g| Arc::new(Held::new(g, system))).collect();
        let potentials = held.iter().map(|held| Arc::clone(held) as Arc<dyn Potential>).collect();
        let system = system.with_potentials_for_constraints(potentials).map_err(|_| refused())?;
        let free_of = free_of(system.coordinates());
        Ok(Some((Self { held, free_of, is_by_loads: false }, system)))
    }

    /// Makes the constraints stiff relative to the body and its loads at (q, t), if they are not yet.
    ///
    /// # Errors
    /// Returns the errors of the forces and the tangent there.
    pub(super) fn stiffen(&mut self, balance: &mut Balance, q: &[f64], t: f64) -> Result<(), SolverError> {
        if self.held.iter().any(|held| held.hold().stiffness > 0.0) {
            return Ok(());
        }
        let mut r = vec![0.0; q.len()];
        balance.residual(q, t, &mut r)?;
        let mass = balance.system.free_mass();
        let (square, total) =
            (vectors::sum(q.len(), |k| r[k] * r[k] / mass[k]), vectors::sum(q.len(), |k| mass[k]));
        let by_loads = STIFF_AGAINST_LOADS * (square / total).sqrt() / balance.extent();
        let by_bodies = STIFF * balance.stiffest(q, t)?;
        let stiffest = by_bodies.max(by_loads);
        self.is_by_loads = by_loads >= by_bodies;
        let x = balance.positions(q, t);
        for held in &self.held {
            let along = held.gradient(&held.place(&x), 1.0);
            let dofs = held.nodes.iter().flat_map(|node| 3 * node..3 * node + 3);
            let inverse = |dof: u32| match self.free_of[dof as usize] {
                NONE => 0.0,
                free => 1.0 / mass[free as usize],
            };
            let softness: f64 = dofs.zip(&along).map(|(dof, along)| along * along * inverse(dof)).sum();
            let stiffness = if softness > 0.0 { stiffest / softness } else { 0.0 };
            held.set(Hold { stiffness, ..held.hold() });
        }
        Ok(())
    }

    /// Finds an equilibrium that meets the constraints, from the guess `q`. `solve` finds an equilibrium under the
    /// current forces of the constraints, replaces its guess by it, and returns the positions of all coordinates there.
    /// Where the loads determine the stiffness of constraints and the tangent was not positive definite, this is tried
    /// again with stiffer ones. The forces remain as they were if this fails.
    ///
    /// # Errors
    /// Returns the errors of `solve`, or [`SolverError::ConstraintDefect`] if defects do not vanish.
    pub(super) fn meet(
        &self,
        q: &mut [f64],
        mut solve: impl FnMut(&mut [f64]) -> Result<(Vec<f64>, Solved), SolverError>,
    ) -> Result<Solved, SolverError> {
        let (start, kept) = (q.to_vec(), self.holds());
        let mut best = self.rounds(|| solve(q));
        let mut reached = (q.to_vec(), self.holds());
        for attempt in 1..MOST_ATTEMPTS {
            let is_final = match &best {
                Ok(solved) => solved.stayed_definite,
                Err(error) => error.is_interruption(),
            };
            if is_final || !self.is_by_loads {
                break;
            }
            q.copy_from_slice(&start);
            let factor = MUCH_STIFFER.powi(attempt as i32);
            self.hold_with(kept.iter().map(|hold| Hold { stiffness: factor * hold.stiffness, ..*hold }));
            let next = self.rounds(|| solve(q));
            if next.as_ref().is_ok_and(|solved| solved.stayed_definite || best.is_err()) {
                (best, reached) = (next, (q.to_vec(), self.holds()));
            }
        }
        q.copy_from_slice(&reached.0);
        self.hold_with(if best.is_ok() { reached.1 } else { kept }.into_iter());
        best
    }

    fn holds(&self) -> Vec<Hold> {
        self.held.iter().map(|held| held.hold()).collect()
    }

    fn hold_with(&self, holds: impl Iterator<Item = Hold>) {
        self.held.iter().zip(holds).for_each(|(held, hold)| held.set(hold));
    }

    /// Returns the largest coordinate of points and of directors: all have its round-off, because coordinates near zero are sums.
    fn sizes(&self, x: &[f64]) -> [f64; 2] {
        let mut sizes = [0.0_f64; 2];
        for held in &self.held {
            for (y, &is_director) in held.place(x).chunks_exact(3).zip(&held.is_director) {
                let size = &mut sizes[usize::from(is_director)];
                *size = y.iter().fold(*size, |size, y| size.max(y.abs()));
            }
        }
        sizes
    }

    fn rounds(
        &self,
        mut solve: impl FnMut() -> Result<(Vec<f64>, Solved), SolverError>,
    ) -> Result<Solved, SolverError> {
        let (mut x, mut sum) = solve()?;
        let mut before = f64::INFINITY;
        for _ in 0..MOST_ROUNDS {
            let sizes = self.sizes(&x);
            let defect = self.held.iter().map(|held| held.defect(&x, sizes)).fold(0.0, f64::max);
            if defect <= MET || (defect <= NEARLY_MET && defect >= 0.5 * before) {
                return Ok(sum);
            }
            let factor = if defect > SLOW * before { STIFFER } else { 1.0 };
            for held in &self.held {
                let Hold { force, stiffness } = held.hold();
                let force = force + stiffness * held.constraint.value(&held.place(&x));
                held.set(Hold { force, stiffness: factor * stiffness });
            }
            before = defect;
            let (next, done) = solve()?;
            x = next;
            sum.iterations += done.iterations;
            sum.stayed_definite &= done.stayed_definite;
        }
        let sizes = self.sizes(&x);
        let worst = self.held.iter().max_by(|a, b| a.defect(&x, sizes).total_cmp(&b.defect(&x, sizes)));
        let (constraint, defect) = worst.map_or((String::new(), 0.0), |held| {
            (held.constraint.name().to_owned(), held.constraint.value(&held.place(&x)))
        });
        Err(SolverError::ConstraintDefect { constraint, iterations: MOST_ROUNDS, defect })
    }
}
