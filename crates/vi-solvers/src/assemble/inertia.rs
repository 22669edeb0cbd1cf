//! The mass of a system in implicit steps: M v, M⁻¹p, and the matrix M if the mass is consistent. Lumped mass needs
//! no matrix.

use std::sync::Arc;

use vi_core::{State, System, Terms, solve_mass};

use crate::assemble::fixed::FixedSum;
use crate::assemble::hessian::HessianEvaluation;
use crate::error::SolverError;
use crate::linear::matrix::SymmetricMatrix;
use crate::memory::StepperMemory;
use crate::work::Work;

/// M of a system, and the velocity of the last state: the next computation of M⁻¹p starts from it.
pub(crate) struct Inertia {
    /// M, if the mass is consistent.
    matrix: Option<Arc<SymmetricMatrix>>,
    /// q̇ = M⁻¹p for the p in `momentum`; empty if the mass is lumped.
    velocity: Vec<f64>,
    momentum: Vec<f64>,
}

/// A vector that is computed entry by entry, so that lumped mass needs no pass of its own.
#[derive(Clone, Copy)]
pub(crate) enum Entries<'a> {
    /// a_k b_k.
    Product(&'a [f64], &'a [f64]),
    /// a_k / b_k.
    Quotient(&'a [f64], &'a [f64]),
    /// a_k.
    Stored(&'a [f64]),
}

impl Entries<'_> {
    #[inline]
    pub(crate) fn at(&self, k: usize) -> f64 {
        match self {
            Self::Product(a, b) => a[k] * b[k],
            Self::Quotient(a, b) => a[k] / b[k],
            Self::Stored(a) => a[k],
        }
    }

    /// Returns the first `count` entries.
    pub(crate) fn to_vec(self, count: usize) -> Vec<f64> {
        (0..count).map(|k| self.at(k)).collect()
    }
}

impl Inertia {
    pub(crate) fn new(system: &System) -> Self {
        let matrix = system.kinetic().map(|kinetic| Arc::new(mass_matrix(kinetic)));
        let n = if matrix.is_some() { system.coordinates().free_count() } else { 0 };
        Self { matrix, velocity: vec![0.0; n], momentum: vec![0.0; n] }
    }

    /// Returns M if it is not lumped.
    pub(crate) fn matrix(&self) -> Option<&Arc<SymmetricMatrix>> {
        self.matrix.as_ref()
    }

    /// Returns M v; writes it to `scratch` if the mass is consistent.
    pub(crate) fn momentum<'a>(
        &self,
        system: &'a System,
        v: &'a [f64],
        scratch: &'a mut Vec<f64>,
    ) -> Entries<'a> {
        match &self.matrix {
            Some(matrix) => {
                scratch.resize(v.len(), 0.0);
                matrix.multiply(v, scratch);
                Entries::Stored(scratch)
            }
            None => Entries::Product(system.free_mass(), v),
        }
    }

    /// Computes M⁻¹p for [`Inertia::velocity`].
    pub(crate) fn open(&mut self, system: &System, p: &[f64], work: &mut Work) {
        if let Some(matrix) = &self.matrix {
            self.momentum.copy_from_slice(p);
            let multiply = |v: &[f64], out: &mut [f64]| matrix.multiply(v, out);
            let iterations = solve_mass(multiply, system.free_mass(), p, &mut self.velocity);
            work.mass_iterations += u64::from(iterations);
        }
    }

    /// Returns M⁻¹p for the last p given to [`Inertia::open`].
    pub(crate) fn velocity<'a>(&'a self, system: &'a System, p: &'a [f64]) -> Entries<'a> {
        match self.matrix {
            Some(_) => Entries::Stored(&self.velocity),
            None => Entries::Quotient(p, system.free_mass()),
        }
    }

    /// Ends a step with momentum p, in which velocities changed by `change`. The next step starts from this velocity.
    pub(crate) fn close(&mut self, p: &[f64], change: &[f64]) {
        if self.matrix.is_some() {
            self.momentum.copy_from_slice(p);
            self.velocity.iter_mut().zip(change).for_each(|(v, change)| *v += change);
        }
    }

    /// Returns q̇ at a state, if a step has ended or begun there and the mass is consistent.
    pub(crate) fn known_velocity(&self, state: &State) -> Option<&[f64]> {
        (self.matrix.is_some() && self.momentum == state.p).then_some(&self.velocity)
    }

    /// Computes r ← M⁻¹r.
    pub(crate) fn divide(&self, system: &System, r: &mut [f64], work: &mut Work) {
        let lumped = system.free_mass();
        let Some(matrix) = &self.matrix else {
            r.iter_mut().zip(lumped).for_each(|(r, m)| *r /= m);
            return;
        };
        let rhs = r.to_vec();
        r.iter_mut().zip(lumped).for_each(|(r, m)| *r /= m);
        let multiply = |v: &[f64], out: &mut [f64]| matrix.multiply(v, out);
        work.mass_iterations += u64::from(solve_mass(multiply, lumped, &rhs, r));
    }

    /// Records the start of the next solve.
    pub(crate) fn save(&self, memory: &mut StepperMemory) {
        if self.matrix.is_some() {
            memory.arrays.push(("inertia.velocity".into(), self.velocity.clone()));
            memory.arrays.push(("inertia.momentum".into(), self.momentum.clone()));
        }
    }

    /// Restores the start of the next solve, which [`Inertia::save`] recorded.
    ///
    /// # Errors
    /// Returns [`SolverError::Memory`] if the memory belongs to another system.
    pub(crate) fn restore(&mut self, memory: &StepperMemory) -> Result<(), SolverError> {
        if self.matrix.is_some() {
            let [velocity, momentum] =
                ["inertia.velocity", "inertia.momentum"].map(|name| memory.array(name));
            let (velocity, momentum) = (velocity?, momentum?);
            if velocity.len() != self.velocity.len() || momentum.len() != self.momentum.len() {
                return Err(SolverError::Memory { missing: "inertia.velocity" });
            }
            self.velocity.copy_from_slice(velocity);
            self.momentum.copy_from_slice(momentum);
        }
        Ok(())
    }
}

/// Returns M from the kinetic energy given as terms of the velocities ([`System::kinetic`]).
pub(crate) fn mass_matrix(kinetic: &Terms) -> SymmetricMatrix {
    let at_rest = vec![0.0; kinetic.coordinates().dof_count()];
    FixedSum::new(kinetic.clone(), None).hessian(&at_rest, 0.0, HessianEvaluation::Exact).clone()
}
