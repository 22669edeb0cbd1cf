//! The mass of a system as implicit steps meet it: M v, M⁻¹p, and the matrix M where mass is consistent. Lumped mass
//! costs nothing here.

use std::sync::Arc;

use vi_core::{State, System, Terms, solve_mass};

use crate::assemble::fixed::FixedSum;
use crate::assemble::hessian::HessianEvaluation;
use crate::error::SolverError;
use crate::linear::matrix::SymmetricMatrix;
use crate::memory::StepperMemory;
use crate::work::Work;

/// M of a system, and the velocity of the last state that was asked for: M⁻¹p begins there.
pub(crate) struct Inertia {
    /// M where mass is consistent.
    matrix: Option<Arc<SymmetricMatrix>>,
    /// q̇ = M⁻¹p of the p beside it; empty where mass is lumped.
    velocity: Vec<f64>,
    momentum: Vec<f64>,
}

/// A vector read entry by entry, so that lumped mass needs no pass of its own.
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
}

impl Inertia {
    pub(crate) fn new(system: &System) -> Self {
        let matrix = system.kinetic().map(|kinetic| Arc::new(mass_matrix(kinetic)));
        let n = if matrix.is_some() { system.coordinates().free_count() } else { 0 };
        Self { matrix, velocity: vec![0.0; n], momentum: vec![0.0; n] }
    }

    /// M, where it is not lumped.
    pub(crate) fn matrix(&self) -> Option<&Arc<SymmetricMatrix>> {
        self.matrix.as_ref()
    }

    /// M v; `room` is written where mass is consistent.
    pub(crate) fn momentum<'a>(
        &self,
        system: &'a System,
        v: &'a [f64],
        room: &'a mut Vec<f64>,
    ) -> Entries<'a> {
        match &self.matrix {
            Some(matrix) => {
                room.resize(v.len(), 0.0);
                matrix.multiply(v, room);
                Entries::Stored(room)
            }
            None => Entries::Product(system.free_mass(), v),
        }
    }

    /// Finds M⁻¹p for [`Inertia::velocity`].
    pub(crate) fn open(&mut self, system: &System, p: &[f64], work: &mut Work) {
        if let Some(matrix) = &self.matrix {
            self.momentum.copy_from_slice(p);
            let multiply = |v: &[f64], out: &mut [f64]| matrix.multiply(v, out);
            let iterations = solve_mass(multiply, system.free_mass(), p, &mut self.velocity);
            work.mass_iterations += u64::from(iterations);
        }
    }

    /// M⁻¹p of the p that was opened last.
    pub(crate) fn velocity<'a>(&'a self, system: &'a System, p: &'a [f64]) -> Entries<'a> {
        match self.matrix {
            Some(_) => Entries::Stored(&self.velocity),
            None => Entries::Quotient(p, system.free_mass()),
        }
    }

    /// A step ended with momentum p, after velocities changed by `change`: the next one begins there.
    pub(crate) fn close(&mut self, p: &[f64], change: &[f64]) {
        if self.matrix.is_some() {
            self.momentum.copy_from_slice(p);
            self.velocity.iter_mut().zip(change).for_each(|(v, change)| *v += change);
        }
    }

    /// q̇ at a state, where a step has ended or begun there and mass is consistent.
    pub(crate) fn known_velocity(&self, state: &State) -> Option<&[f64]> {
        (self.matrix.is_some() && self.momentum == state.p).then_some(&self.velocity)
    }

    /// r ← M⁻¹r.
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

    /// Enters where the next solve begins.
    pub(crate) fn save(&self, memory: &mut StepperMemory) {
        if self.matrix.is_some() {
            memory.arrays.push(("inertia.velocity".into(), self.velocity.clone()));
            memory.arrays.push(("inertia.momentum".into(), self.momentum.clone()));
        }
    }

    /// Takes over what [`Inertia::save`] entered.
    ///
    /// # Errors
    /// [`SolverError::Memory`] where the memory is that of another system.
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

/// M from the kinetic energy as terms of the velocities ([`System::kinetic`]).
pub(crate) fn mass_matrix(kinetic: &Terms) -> SymmetricMatrix {
    let at_rest = vec![0.0; kinetic.coordinates().dof_count()];
    FixedSum::new(kinetic.clone(), None).hessian(&at_rest, 0.0, HessianEvaluation::Exact).clone()
}
