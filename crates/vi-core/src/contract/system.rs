//! A Lagrangian system L = T − V and its state (q, p).

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::contract::constraint::QuadraticConstraint;
use crate::contract::coordinates::Coordinates;
use crate::contract::dense;
use crate::contract::force::Force;
use crate::contract::inertia;
use crate::contract::potential::{HessianKind, Potential};
use crate::contract::terms::{Live, Terms, check_stencils};
use crate::error::CoreError;

/// The Lagrangian L(q, q̇, t) = ½ q̇ᵀM q̇ − Σ V(x(q, t), t), with lumped (diagonal) mass M unless
/// [`System::with_consistent_mass`].
///
/// Prescribed coordinates leave the kinetic energy; they act through V(x(q, t), t). Forces that no
/// potential gives are listed apart: M q̈ = −∂V/∂q + Σ f(x, ẋ, t). So are constraints g(x) = 0, whose
/// multipliers add −(∂g/∂q)ᵀλ.
pub struct System {
    mass: Vec<f64>,
    free_mass: Vec<f64>,
    /// V.
    potential: Terms,
    /// T as a function of the velocities of all coordinates, where mass is consistent.
    kinetic: Option<Terms>,
    forces: Vec<Arc<dyn Force>>,
    constraints: Vec<QuadraticConstraint>,
}

impl System {
    /// A system from the lumped mass of every coordinate x_i (kg), its potentials and coordinates.
    ///
    /// # Errors
    /// Where lengths differ, a free coordinate has no mass, or a stencil names a missing node.
    pub fn new(
        mass: Vec<f64>,
        potentials: Vec<Box<dyn Potential>>,
        coordinates: Coordinates,
    ) -> Result<Self, CoreError> {
        let count = coordinates.dof_count();
        if mass.len() != count {
            return Err(CoreError::Length { what: "mass", expected: count, found: mass.len() });
        }
        let free_mass = coordinates.free_mass(&mass)?;
        for (&dof, &value) in coordinates.free().iter().zip(&free_mass) {
            if !(value > 0.0 && value.is_finite()) {
                return Err(CoreError::Mass { dof: dof as usize, mass: value });
            }
        }
        let potentials = potentials.into_iter().map(Arc::from).collect();
        let potential = Terms::new(Arc::new(coordinates), potentials)?;
        let (forces, constraints) = (Vec::new(), Vec::new());
        Ok(Self { mass, free_mass, potential, kinetic: None, forces, constraints })
    }

    /// The system with these potentials besides those that it has.
    ///
    /// # Errors
    /// [`CoreError::Stencil`] where a stencil names a missing node.
    pub fn add_potentials(mut self, more: Vec<Box<dyn Potential>>) -> Result<Self, CoreError> {
        self.potential = self.potential.with_more(more.into_iter().map(Arc::from).collect())?;
        Ok(self)
    }

    /// The system with these forces besides those that it has.
    ///
    /// # Errors
    /// [`CoreError::Stencil`] where a stencil names a missing node.
    pub fn add_forces(self, more: Vec<Arc<dyn Force>>) -> Result<Self, CoreError> {
        let all = self.forces.iter().cloned().chain(more).collect();
        self.with_forces(all)
    }

    /// The system with these live terms besides its potentials.
    #[must_use]
    pub fn with_live(mut self, live: Vec<Arc<dyn Live>>) -> Self {
        self.potential = self.potential.with_live(live);
        self
    }

    /// A system with the same coordinates and lumped mass on which nothing acts.
    #[must_use]
    pub fn without_terms(&self) -> Self {
        let Self { mass, free_mass, .. } = self;
        let coordinates = Arc::clone(self.potential.shared_coordinates());
        Self {
            mass: mass.clone(),
            free_mass: free_mass.clone(),
            potential: Terms::of_nothing(coordinates),
            kinetic: None,
            forces: Vec::new(),
            constraints: Vec::new(),
        }
    }

    /// The system with the kinetic energy T(ẋ) that these terms give as potentials of the velocities,
    /// quadratic: their Hessians are the blocks of M. The lumped mass stays, as what norms and
    /// preconditioners take. No terms: the mass stays lumped.
    ///
    /// # Errors
    /// [`CoreError::ConsistentMass`] where coordinates are moved, where there are constraints, or where a
    /// term is not quadratic; [`CoreError::Stencil`] where a stencil names a missing node.
    pub fn with_consistent_mass(mut self, terms: Vec<Box<dyn Potential>>) -> Result<Self, CoreError> {
        if terms.is_empty() {
            return Ok(self);
        }
        if self.coordinates().is_moving() {
            return Err(CoreError::ConsistentMass { reason: "coordinates follow a path that moves" });
        }
        if !self.constraints.is_empty() {
            return Err(CoreError::ConsistentMass { reason: CONSTRAINED });
        }
        let is_quadratic = |term: &dyn Potential| {
            let traits = term.traits();
            traits.hessian == HessianKind::Constant && !traits.time_dependent
        };
        if !terms.iter().all(|term| is_quadratic(term.as_ref())) {
            return Err(CoreError::ConsistentMass { reason: "a term of it is not quadratic" });
        }
        let terms = terms.into_iter().map(Arc::from).collect();
        self.kinetic = Some(Terms::new(Arc::new(self.coordinates().held()), terms)?);
        Ok(self)
    }

    /// Where mass is consistent: the kinetic energy T as a sum of terms whose coordinates are the velocities. Their
    /// Hessian is M.
    pub fn kinetic(&self) -> Option<&Terms> {
        self.kinetic.as_ref()
    }

    /// The system with these forces besides its potentials.
    ///
    /// # Errors
    /// [`CoreError::Stencil`] where a stencil names a missing node.
    pub fn with_forces(mut self, forces: Vec<Arc<dyn Force>>) -> Result<Self, CoreError> {
        for force in &forces {
            check_stencils(force.name(), force.stencils(), self.mass.len())?;
        }
        self.forces = forces;
        Ok(self)
    }

    /// The system on the surface g(x) = 0 of these constraints; what they say of tied nodes they say
    /// of the nodes those are tied to.
    ///
    /// # Errors
    /// [`CoreError::Stencil`] where a constraint names a missing node, [`CoreError::Constraint`] where
    /// it reads no free coordinate, [`CoreError::ConsistentMass`] where mass is not lumped.
    pub fn with_constraints(mut self, constraints: Vec<QuadraticConstraint>) -> Result<Self, CoreError> {
        if self.kinetic.is_some() && !constraints.is_empty() {
            return Err(CoreError::ConsistentMass { reason: CONSTRAINED });
        }
        let resolved =
            constraints.into_iter().map(|constraint| constraint.resolved(self.potential.coordinates()));
        self.constraints = resolved.collect::<Result<_, _>>()?;
        Ok(self)
    }

    /// The constraints, on nodes that are not tied.
    pub fn constraints(&self) -> &[QuadraticConstraint] {
        &self.constraints
    }

    /// Lumped mass of every coordinate x_i, kg: that of tied nodes is theirs.
    pub fn mass(&self) -> &[f64] {
        &self.mass
    }

    /// Lumped mass of every free coordinate q_k, kg: the diagonal M, unless mass is consistent.
    pub fn free_mass(&self) -> &[f64] {
        &self.free_mass
    }

    /// V as a sum of terms.
    pub fn terms(&self) -> &Terms {
        &self.potential
    }

    /// The terms of V whose stencils never change.
    pub fn potentials(&self) -> &[Arc<dyn Potential>] {
        self.potential.fixed()
    }

    /// The forces that no potential gives.
    pub fn forces(&self) -> &[Arc<dyn Force>] {
        &self.forces
    }

    /// The map x(q, t).
    pub fn coordinates(&self) -> &Coordinates {
        self.potential.coordinates()
    }

    /// The state with positions x (m) and velocities v (m/s) of all coordinates at time t (s);
    /// entries of prescribed coordinates are ignored.
    ///
    /// # Errors
    /// [`CoreError::Length`] where x or v has not one entry a coordinate.
    pub fn state(&self, t: f64, x: &[f64], v: &[f64]) -> Result<State, CoreError> {
        let expected = self.coordinates().dof_count();
        for (what, array) in [("positions", x), ("velocities", v)] {
            if array.len() != expected {
                return Err(CoreError::Length { what, expected, found: array.len() });
            }
        }
        let mut q = vec![0.0; self.coordinates().free_count()];
        let mut q_dot = q.clone();
        self.coordinates().coordinates_of(x, &mut q);
        self.coordinates().coordinates_of(v, &mut q_dot);
        Ok(State { t, q, p: self.momentum(&q_dot) })
    }

    /// p = M q̇, kg m/s, of the velocities of the free coordinates, m/s.
    pub fn momentum(&self, q_dot: &[f64]) -> Vec<f64> {
        match &self.kinetic {
            Some(kinetic) => inertia::momentum(kinetic, q_dot),
            None => q_dot.iter().zip(&self.free_mass).map(|(v, m)| v * m).collect(),
        }
    }

    /// q̇ = M⁻¹p, m/s, to round-off.
    pub fn velocity(&self, p: &[f64]) -> Vec<f64> {
        match &self.kinetic {
            Some(kinetic) => {
                let mut q_dot: Vec<f64> = p.iter().zip(&self.free_mass).map(|(p, m)| p / m).collect();
                let multiply =
                    |v: &[f64], out: &mut [f64]| out.copy_from_slice(&inertia::momentum(kinetic, v));
                inertia::solve_mass(multiply, &self.free_mass, p, &mut q_dot);
                q_dot
            }
            None => p.iter().zip(&self.free_mass).map(|(p, m)| p / m).collect(),
        }
    }

    /// M, n × n for n free coordinates, kg: for small systems.
    pub fn dense_mass(&self) -> DMatrix<f64> {
        match &self.kinetic {
            Some(kinetic) => {
                let full = dense::hessian(kinetic, &vec![0.0; self.mass.len()], 0.0);
                let free = self.coordinates().free();
                DMatrix::from_fn(free.len(), free.len(), |i, j| full[(free[i] as usize, free[j] as usize)])
            }
            None => DMatrix::from_diagonal(&DVector::from_column_slice(&self.free_mass)),
        }
    }

    /// Positions x(q, t) of all coordinates, m.
    pub fn positions(&self, state: &State) -> Vec<f64> {
        let mut x = vec![0.0; self.coordinates().dof_count()];
        self.coordinates().embed(&state.q, state.t, &mut x);
        x
    }

    /// Velocities ẋ of all coordinates, m/s: M⁻¹p where free, the path's where prescribed.
    pub fn velocities(&self, state: &State) -> Vec<f64> {
        let mut x_dot = vec![0.0; self.coordinates().dof_count()];
        self.coordinates().embed_velocity(&self.velocity(&state.p), state.t, &mut x_dot);
        x_dot
    }
}

const CONSTRAINED: &str = "constraints hold rigid bodies or joints";

impl AsRef<Terms> for System {
    /// V.
    fn as_ref(&self) -> &Terms {
        &self.potential
    }
}

/// A point of phase space: never two old positions.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Time, s.
    pub t: f64,
    /// Free coordinates, m.
    pub q: Vec<f64>,
    /// Their momenta ∂L/∂q̇ = M q̇, kg m/s.
    pub p: Vec<f64>,
}
