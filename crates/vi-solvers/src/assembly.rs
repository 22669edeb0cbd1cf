//! Energy, gradient and Hessian of a system as sums over the stencils of its terms: the front desk of
//! the rooms that sum each of them, and the count of what was asked. It must not know how they sum.

use vi_core::{Fault, System};

use crate::energy::{Energies, EnergySum};
use crate::gather::{self, Gather};
use crate::hessian::HessianSum;
use crate::{SymmetricMatrix, TermFault};

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
    /// Hessians of the whole system, not counting calls where nothing could have changed.
    pub hessians: u64,
    /// Stencils whose gradient is made once: V is affine, or none of their coordinates ever moves.
    pub constant_stencils: u64,
    /// Stencils without a Hessian on free coordinates: V is affine, or all their coordinates are prescribed.
    pub hessian_skipped_stencils: u64,
}

/// Sums the stencils of a system; all methods give the same bits on any number of threads and allocate
/// nothing after their first call.
pub struct Assembler {
    energy: EnergySum,
    gather: Gather,
    hessian: Option<HessianSum>,
    work: AssemblyWork,
}

impl Assembler {
    /// Makes the maps of energy and gradient; those of the Hessian are made at its first call.
    pub fn new(system: &System) -> Self {
        let gather = Gather::new(system);
        let work =
            AssemblyWork { constant_stencils: gather.constant_stencils() as u64, ..Default::default() };
        Self { energy: EnergySum::new(system), gather, hessian: None, work }
    }

    /// V(x, t) by account, J.
    pub fn energies(&mut self, system: &System, x: &[f64], t: f64) -> Energies {
        self.work.energies += 1;
        self.energy.evaluate(system, x, t)
    }

    /// ∂V/∂x of every coordinate, N, pulled back from tied nodes (whose entries are zero); not finite
    /// where x is outside the domain of a term.
    ///
    /// What never changes (affine terms without t, stencils whose coordinates are all fixed) is
    /// evaluated at the first call only.
    pub fn gradient(&mut self, system: &System, x: &[f64], t: f64, out: &mut [f64]) {
        self.work.gradients += 1;
        self.gather.gradient(system, x, t, out);
        system.coordinates().pull_back(out);
    }

    /// The first half of [`Assembler::gradient`]; the sums over nodes are left to who passes over them.
    pub(crate) fn sum_chunks(&mut self, system: &System, x: &[f64], t: f64) {
        self.work.gradients += 1;
        self.gather.sum_chunks(system, x, t);
    }

    pub(crate) fn gather(&self) -> &Gather {
        &self.gather
    }

    /// ∂²V/∂q² on the free coordinates, N/m.
    ///
    /// Terms whose Hessian is constant are evaluated at the first call only.
    pub fn hessian(
        &mut self,
        system: &System,
        x: &[f64],
        t: f64,
        kind: HessianEvaluation,
    ) -> &SymmetricMatrix {
        let hessian = self.hessian.get_or_insert_with(|| HessianSum::new(system));
        self.work.hessian_skipped_stencils = hessian.skipped_stencils() as u64;
        if hessian.evaluate(system, x, t, kind) {
            self.work.hessians += 1;
        }
        hessian.matrix()
    }

    /// Σ V_e F̄_e (m³, row-major) over the stencils around each node; false where no term has it.
    pub fn mean_deformations(&mut self, system: &System, x: &[f64], out: &mut [[f64; 9]]) -> bool {
        self.gather.node_tensors(system, x, out)
    }

    /// The first stencil without a finite energy or gradient, by term and stencil order.
    pub fn fault(&self, system: &System, x: &[f64], t: f64) -> Option<TermFault> {
        for (term, potential) in system.potentials().iter().enumerate() {
            let size = potential.stencils().size();
            for span in gather::spans(term, potential.as_ref()) {
                let mut energies = vec![0.0; span.stencils.len()];
                let mut gradients = vec![0.0; span.stencils.len() * size];
                potential.energies(span.stencils.clone(), x, t, &mut energies);
                potential.gradients(span.stencils.clone(), x, t, &mut gradients);
                for (k, stencil) in span.stencils.enumerate() {
                    let force = gradients[k * size..(k + 1) * size].iter().find(|value| !value.is_finite());
                    let (quantity, value) = match (energies[k].is_finite(), force) {
                        (false, _) => ("energy", energies[k]),
                        (true, Some(&value)) => ("force", value),
                        (true, None) => continue,
                    };
                    let element = potential.element(stencil);
                    let unexplained = Fault { element, quantity, value, domain: "must be finite" };
                    let fault = potential.fault(stencil, x, t).unwrap_or(unexplained);
                    return Some(TermFault { term: potential.name().to_owned(), fault });
                }
            }
        }
        None
    }

    /// What was evaluated so far.
    pub fn work(&self) -> AssemblyWork {
        self.work
    }

    /// Coordinates a node of the nodal arrays: the largest of 3, 2, 1 that divides the block of every term.
    pub fn block(&self) -> usize {
        self.gather.block()
    }

    /// Bytes of maps and buffers, beyond what the terms hold.
    pub fn bytes(&self) -> usize {
        self.gather.bytes() + self.hessian.as_ref().map_or(0, HessianSum::bytes)
    }
}
