//! Energy, gradient and Hessian of a system as sums over the stencils of its terms.

use vi_core::System;

use crate::{SymmetricMatrix, TermFault};

/// The energy of the accounts, J.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Energies {
    /// Strain energy.
    pub elastic: f64,
    /// Weight.
    pub gravity: f64,
    /// Other conservative loads.
    pub load: f64,
}

impl Energies {
    /// V, J.
    pub fn total(&self) -> f64 {
        self.elastic + self.gravity + self.load
    }
}

/// Which Hessian to assemble.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HessianEvaluation {
    /// ∂²V/∂x².
    Exact,
    /// Every stencil's negative eigenvalues set to zero: positive semidefinite.
    Projected,
}

/// Counts of what was evaluated and what was not.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct AssemblyWork {
    /// Energies of the whole system.
    pub energies: u64,
    /// Gradients of the whole system.
    pub gradients: u64,
    /// Hessians of the whole system.
    pub hessians: u64,
}

/// Sums the stencils of a system.
pub struct Assembler {
    work: AssemblyWork,
}

impl Assembler {
    /// Makes the maps of the gradient; those of the Hessian are made at its first call.
    pub fn new(_system: &System) -> Self {
        Self { work: AssemblyWork::default() }
    }

    /// V(x, t) by account, J.
    pub fn energies(&mut self, _system: &System, _x: &[f64], _t: f64) -> Energies {
        unimplemented!()
    }

    /// ∂V/∂x of every coordinate, N; not finite where x is outside the domain of a term.
    pub fn gradient(&mut self, _system: &System, _x: &[f64], _t: f64, _out: &mut [f64]) {
        unimplemented!()
    }

    /// ∂²V/∂q² on the free coordinates, N/m.
    pub fn hessian(
        &mut self,
        _system: &System,
        _x: &[f64],
        _t: f64,
        _kind: HessianEvaluation,
    ) -> &SymmetricMatrix {
        unimplemented!()
    }

    /// Σ V_e F̄_e (m³, row-major) over the stencils around each node; false where no term has it.
    pub fn mean_deformations(&mut self, _system: &System, _x: &[f64], _out: &mut [[f64; 9]]) -> bool {
        unimplemented!()
    }

    /// The first stencil without a finite value.
    pub fn fault(&self, _system: &System, _x: &[f64], _t: f64) -> Option<TermFault> {
        unimplemented!()
    }

    /// What was evaluated so far.
    pub fn work(&self) -> AssemblyWork {
        self.work
    }
}
