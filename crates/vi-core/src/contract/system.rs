//! A Lagrangian system L = T − V and its state (q, p).

use std::borrow::Cow;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::contract::constraint::QuadraticConstraint;
use crate::contract::coordinates::Coordinates;
use crate::contract::dense;
use crate::contract::filter::MassFilter;
use crate::contract::force::Force;
use crate::contract::inertia;
use crate::contract::potential::{HessianKind, Potential};
use crate::contract::shared::SharedTerms;
use crate::contract::terms::{Live, Terms, check_stencils};
use crate::error::CoreError;

/// The Lagrangian L(q, q̇, t) = ½ q̇ᵀM q̇ − Σ V(x(q, t), t), with lumped (diagonal) mass M unless set by
/// [`System::with_consistent_mass`] or [`System::with_filter`].
///
/// Prescribed coordinates do not enter the kinetic energy; they act through V(x(q, t), t). Forces without a potential
/// are listed separately: M q̈ = −∂V/∂q + Σ f(x, ẋ, t). So are constraints g(x) = 0, whose multipliers add
/// −(∂g/∂q)ᵀλ.
pub struct System {
    /// The lumped mass of the free coordinates, kg.
    free_mass: Vec<f64>,
    other_mass: OtherMass,
    /// V.
    potential: Terms,
    /// T as a function of the velocities of all coordinates, if the mass is consistent.
    kinetic: Option<Terms>,
    /// The filter of the lumped mass, if it is filtered.
    filter: Option<MassFilter>,
    forces: Vec<Arc<dyn Force>>,
    constraints: Vec<QuadraticConstraint>,
}

/// The lumped mass of coordinates besides `free_mass`, kg. No mass is stored twice: on the first of several processes,
/// the masses of all nodes take a sixth of the memory of the whole body.
#[derive(Clone)]
enum OtherMass {
    /// The masses of the coordinates that are not free, in ascending order of coordinates.
    OfOthers(Vec<f64>),
    /// The masses of all coordinates. `free_mass` differs from them if nodes are tied, because free coordinates carry
    /// the mass of tied ones.
    OfAll(Vec<f64>),
}

/// Parts the masses of all coordinates into those of the free ones and of the others.
fn parted(mut mass: Vec<f64>, free: &[u32]) -> (Vec<f64>, Vec<f64>) {
    let (mut others, mut is_free) = (Vec::new(), free.iter().peekable());
    for dof in 0..mass.len() {
        if is_free.next_if(|&&free| free as usize == dof).is_none() {
            others.push(mass[dof]);
        }
    }
    // Free coordinates ascend, so that none is overwritten before it is read.
    (0..).zip(free).for_each(|(k, &dof): (usize, _)| mass[k] = mass[dof as usize]);
    mass.truncate(free.len());
    mass.shrink_to_fit();
    (mass, others)
}

impl System {
    /// Returns a system with the lumped mass of every coordinate x_i (kg), potentials and coordinates.
    ///
    /// # Errors
    /// Returns an error if lengths differ, a free coordinate has no mass, or a stencil refers to a missing node.
    pub fn new(
        mass: Vec<f64>,
        potentials: Vec<Box<dyn Potential>>,
        coordinates: Coordinates,
    ) -> Result<Self, CoreError> {
        let count = coordinates.dof_count();
        if mass.len() != count {
            return Err(CoreError::Length { what: "mass", expected: count, found: mass.len() });
        }
        let (free_mass, other_mass) = match coordinates.tied_mass(&mass)? {
            Some(free) => (free, OtherMass::OfAll(mass)),
            None => {
                let (free, others) = parted(mass, coordinates.free());
                (free, OtherMass::OfOthers(others))
            }
        };
        for (&dof, &value) in coordinates.free().iter().zip(&free_mass) {
            if !(value > 0.0 && value.is_finite()) {
                return Err(CoreError::Mass { dof: dof as usize, mass: value });
            }
        }
        let potentials = potentials.into_iter().map(Arc::from).collect();
        let potential = Terms::new(Arc::new(coordinates), potentials)?;
        let (forces, constraints) = (Vec::new(), Vec::new());
        Ok(Self { free_mass, other_mass, potential, kinetic: None, filter: None, forces, constraints })
    }

    /// Adds potentials to the system.
    ///
    /// # Errors
    /// Returns [`CoreError::Stencil`] if a stencil refers to a missing node.
    pub fn add_potentials(mut self, more: Vec<Box<dyn Potential>>) -> Result<Self, CoreError> {
        self.potential = self.potential.with_more(more.into_iter().map(Arc::from).collect())?;
        Ok(self)
    }

    /// Adds forces to the system.
    ///
    /// # Errors
    /// Returns [`CoreError::Stencil`] if a stencil refers to a missing node.
    pub fn add_forces(self, more: Vec<Arc<dyn Force>>) -> Result<Self, CoreError> {
        let all = self.forces.iter().cloned().chain(more).collect();
        self.with_forces(all)
    }

    /// Returns the system with these live terms in addition to its potentials.
    #[must_use]
    pub fn with_live(mut self, live: Vec<Arc<dyn Live>>) -> Self {
        self.potential = self.potential.with_live(live);
        self
    }

    /// Returns the system with potentials that several processes sum together.
    #[must_use]
    pub fn with_shared(mut self, shared: Arc<dyn SharedTerms>) -> Self {
        self.potential = self.potential.with_shared(shared);
        self
    }

    /// Returns a system with the same coordinates and lumped mass, without potentials, forces and constraints.
    #[must_use]
    pub fn without_terms(&self) -> Self {
        let Self { free_mass, other_mass, .. } = self;
        let coordinates = Arc::clone(self.potential.shared_coordinates());
        Self {
            free_mass: free_mass.clone(),
            other_mass: other_mass.clone(),
            potential: Terms::of_nothing(coordinates),
            kinetic: None,
            filter: None,
            forces: Vec::new(),
            constraints: Vec::new(),
        }
    }

    /// Returns the system with the kinetic energy T(ẋ) that these terms define. They are potentials of the velocities
    /// and quadratic: their Hessians are the blocks of M. Norms and preconditioners still use the lumped mass. With
    /// an empty list the mass remains lumped.
    ///
    /// # Errors
    /// Returns [`CoreError::ConsistentMass`] if coordinates are moved, there are constraints, or a term is not
    /// quadratic; [`CoreError::Stencil`] if a stencil refers to a missing node.
    pub fn with_consistent_mass(mut self, terms: Vec<Arc<dyn Potential>>) -> Result<Self, CoreError> {
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
        self.kinetic = Some(Terms::new(Arc::new(self.coordinates().held()), terms)?);
        Ok(self)
    }

    /// Returns the kinetic energy T, if the mass is consistent, as a sum of terms whose coordinates are the
    /// velocities. Their Hessian is M.
    pub fn kinetic(&self) -> Option<&Terms> {
        self.kinetic.as_ref()
    }

    /// Returns the system with the kinetic energy ½ pᵀW p of a filtered mass. Its momenta are then p = W⁻¹q̇.
    ///
    /// # Errors
    /// Returns [`CoreError::FilteredMass`] if the mass is consistent, coordinates are moved, tied or along axes of their
    /// own, there are constraints, or nodes do not have three coordinates.
    pub fn with_filter(mut self, filter: MassFilter) -> Result<Self, CoreError> {
        let obstacles = [
            (self.kinetic.is_some(), "it is consistent already"),
            (self.coordinates().is_moving(), "supports move"),
            (!self.constraints.is_empty() || !self.coordinates().directors().is_empty(), CONSTRAINED),
            (!self.coordinates().is_plain(), "nodes are tied, or supports are not along x, y or z"),
            (!self.coordinates().dof_count().is_multiple_of(3), "nodes do not have three coordinates"),
        ];
        if let Some((_, reason)) = obstacles.into_iter().find(|(is_there, _)| *is_there) {
            return Err(CoreError::FilteredMass { reason });
        }
        self.filter = Some(filter);
        Ok(self)
    }

    /// Returns the filter of the mass, if it is filtered.
    pub fn filter(&self) -> Option<&MassFilter> {
        self.filter.as_ref()
    }

    /// Returns the system with these forces, in place of earlier ones.
    ///
    /// # Errors
    /// Returns [`CoreError::Stencil`] if a stencil refers to a missing node.
    pub fn with_forces(mut self, forces: Vec<Arc<dyn Force>>) -> Result<Self, CoreError> {
        for force in &forces {
            check_stencils(force.name(), force.stencils(), self.coordinates().dof_count())?;
        }
        self.forces = forces;
        Ok(self)
    }

    /// Returns the system on the surface g(x) = 0 of these constraints. In a constraint, tied nodes are replaced by
    /// their sums.
    ///
    /// # Errors
    /// Returns [`CoreError::Stencil`] if a constraint refers to a missing node, [`CoreError::Constraint`] if it
    /// contains no free coordinate, [`CoreError::ConsistentMass`] or
    /// [`CoreError::FilteredMass`] if the mass is not lumped.
    pub fn with_constraints(mut self, constraints: Vec<QuadraticConstraint>) -> Result<Self, CoreError> {
        if self.kinetic.is_some() && !constraints.is_empty() {
            return Err(CoreError::ConsistentMass { reason: CONSTRAINED });
        }
        if self.filter.is_some() && !constraints.is_empty() {
            return Err(CoreError::FilteredMass { reason: CONSTRAINED });
        }
        let resolved =
            constraints.into_iter().map(|constraint| constraint.resolved(self.potential.coordinates()));
        self.constraints = resolved.collect::<Result<_, _>>()?;
        Ok(self)
    }

    /// Returns a copy with these potentials in place of its constraints.
    ///
    /// # Errors
    /// Returns [`CoreError::Stencil`] if a stencil refers to a missing node.
    pub fn with_potentials_for_constraints(&self, more: Vec<Arc<dyn Potential>>) -> Result<Self, CoreError> {
        let potential = self.potential.clone().with_more(more)?;
        Ok(Self { potential, forces: self.forces.clone(), ..self.without_terms() })
    }

    /// Returns the constraints, in which no node is tied.
    pub fn constraints(&self) -> &[QuadraticConstraint] {
        &self.constraints
    }

    /// Returns the lumped mass of every coordinate x_i, kg. Tied nodes still have their own mass here.
    /// If coordinates are prescribed, every call makes the list.
    pub fn mass(&self) -> Cow<'_, [f64]> {
        match &self.other_mass {
            OtherMass::OfAll(all) => Cow::Borrowed(all),
            OtherMass::OfOthers(others) if others.is_empty() => Cow::Borrowed(&self.free_mass),
            OtherMass::OfOthers(others) => {
                let (mut free, mut of_free) =
                    (self.coordinates().free().iter().peekable(), self.free_mass.iter());
                let mut others = others.iter();
                let mass = |dof: u32| match free.next_if_eq(&&dof) {
                    Some(_) => of_free.next(),
                    None => others.next(),
                };
                (0..self.coordinates().dof_count() as u32).filter_map(mass).copied().collect()
            }
        }
    }

    /// Returns the lumped mass of every free coordinate q_k, kg: the diagonal of M, unless the mass is consistent or
    /// filtered.
    pub fn free_mass(&self) -> &[f64] {
        &self.free_mass
    }

    /// Returns V as a sum of terms.
    pub fn terms(&self) -> &Terms {
        &self.potential
    }

    /// Returns the terms of V whose stencils never change.
    pub fn potentials(&self) -> &[Arc<dyn Potential>] {
        self.potential.fixed()
    }

    /// Returns the forces without a potential.
    pub fn forces(&self) -> &[Arc<dyn Force>] {
        &self.forces
    }

    /// Returns the map x(q, t).
    pub fn coordinates(&self) -> &Coordinates {
        self.potential.coordinates()
    }

    /// Returns the state with positions x (m) and velocities v (m/s) of all coordinates at time t (s). Entries of
    /// prescribed coordinates are ignored.
    ///
    /// # Errors
    /// Returns [`CoreError::Length`] if x or v does not have one entry per coordinate.
    pub fn state(&self, t: f64, x: &[f64], v: &[f64]) -> Result<State, CoreError> {
        let expected = self.coordinates().dof_count();
        for (what, array) in [("positions", x), ("velocities", v)] {
            if array.len() != expected {
                return Err(CoreError::Length { what, expected, found: array.len() });
            }
        }
        let mut q = vec![0.0; self.coordinates().free_count()];
        let mut p = q.clone();
        self.coordinates().coordinates_of(x, &mut q);
        self.coordinates().coordinates_of(v, &mut p);
        Ok(State { t, q, p: self.momentum_of(p) })
    }

    /// Returns p = M q̇, kg m/s, for velocities of the free coordinates, m/s.
    pub fn momentum(&self, q_dot: &[f64]) -> Vec<f64> {
        self.momentum_of(q_dot.to_vec())
    }

    /// Returns p = M q̇, kg m/s, in the memory of the velocities q̇ if M is diagonal.
    fn momentum_of(&self, mut q_dot: Vec<f64>) -> Vec<f64> {
        match (&self.kinetic, &self.filter) {
            (Some(kinetic), _) => inertia::momentum(kinetic, &q_dot),
            (_, Some(filter)) => filter.momentum(self.coordinates(), &q_dot),
            _ => {
                q_dot.iter_mut().zip(self.free_mass()).for_each(|(v, m)| *v *= m);
                q_dot
            }
        }
    }

    /// Returns q̇ = M⁻¹p, m/s, to round-off.
    pub fn velocity(&self, p: &[f64]) -> Vec<f64> {
        match (&self.kinetic, &self.filter) {
            (Some(kinetic), _) => {
                let mut q_dot: Vec<f64> = p.iter().zip(self.free_mass()).map(|(p, m)| p / m).collect();
                let multiply =
                    |v: &[f64], out: &mut [f64]| out.copy_from_slice(&inertia::momentum(kinetic, v));
                inertia::solve_mass(multiply, self.free_mass(), p, &mut q_dot);
                q_dot
            }
            (_, Some(filter)) => filter.velocity(self.coordinates(), p),
            _ => p.iter().zip(self.free_mass()).map(|(p, m)| p / m).collect(),
        }
    }

    /// Returns M, n × n for n free coordinates, kg: for small systems.
    pub fn dense_mass(&self) -> DMatrix<f64> {
        match (&self.kinetic, &self.filter) {
            (Some(kinetic), _) => {
                let full = dense::hessian(kinetic, &vec![0.0; self.coordinates().dof_count()], 0.0);
                let free = self.coordinates().free();
                DMatrix::from_fn(free.len(), free.len(), |i, j| full[(free[i] as usize, free[j] as usize)])
            }
            (_, Some(_)) => {
                let n = self.free_mass().len();
                let unit = |k: usize| (0..n).map(|i| f64::from(i == k)).collect::<Vec<_>>();
                let columns: Vec<_> = (0..n).map(|k| DVector::from_vec(self.momentum(&unit(k)))).collect();
                DMatrix::from_columns(&columns)
            }
            _ => DMatrix::from_diagonal(&DVector::from_column_slice(self.free_mass())),
        }
    }

    /// Returns the positions x(q, t) of all coordinates, m.
    pub fn positions(&self, state: &State) -> Vec<f64> {
        self.coordinates().positions(&state.q, state.t)
    }

    /// Returns the velocities ẋ of all coordinates, m/s: M⁻¹p for free ones, those of the path for prescribed ones.
    pub fn velocities(&self, state: &State) -> Vec<f64> {
        let mut x_dot = vec![0.0; self.coordinates().dof_count()];
        self.coordinates().embed_velocity(&self.velocity(&state.p), state.t, &mut x_dot);
        x_dot
    }
}

const CONSTRAINED: &str = "constraints hold rigid bodies or joints";

impl AsRef<Terms> for System {
    /// Returns the terms of V.
    fn as_ref(&self) -> &Terms {
        &self.potential
    }
}

/// A point of phase space: positions and momenta at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct State {
    /// Time, s.
    pub t: f64,
    /// Free coordinates, m.
    pub q: Vec<f64>,
    /// Momenta ∂L/∂q̇ = M q̇ of the free coordinates, kg m/s.
    pub p: Vec<f64>,
}
