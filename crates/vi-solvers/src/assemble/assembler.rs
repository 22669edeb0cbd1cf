//! Energy, gradient and Hessian of a list of terms: the sum of its fixed terms (`fixed.rs`) and of its live ones
//! (`live.rs`).

use vi_core::Terms;

use crate::assemble::energy::Energies;
use crate::assemble::fixed::{AssemblyWork, FixedSum};
use crate::assemble::gather::Gather;
use crate::assemble::hessian::HessianEvaluation;
use crate::assemble::live::LiveSum;
use crate::error::{SolverError, TermFault};
use crate::linear::matrix::SymmetricMatrix;

/// Sums the terms of a list; all methods give the same bits on any number of threads and allocate nothing after their
/// first call, unless live terms change their stencils.
pub struct Assembler {
    fixed: FixedSum,
    live: Option<Box<LiveSum>>,
}

impl Assembler {
    /// Of the terms of V, for a system. Makes the maps of energy and gradient; those of the Hessian are made at its
    /// first call.
    pub fn new(terms: &impl AsRef<Terms>) -> Self {
        let fixed = FixedSum::new(terms.as_ref().clone(), None);
        let live = LiveSum::new(fixed.terms(), fixed.block(), false).map(Box::new);
        Self { fixed, live }
    }

    /// From here on live terms with a discrete gradient act by that alone, between the ends of a step.
    pub(crate) fn split_live(&mut self) {
        self.live = LiveSum::new(self.fixed.terms(), self.fixed.block(), true).map(Box::new);
    }

    /// What is summed.
    pub fn terms(&self) -> &Terms {
        self.fixed.terms()
    }

    /// V(x, t) by account, J.
    pub fn energies(&mut self, x: &[f64], t: f64) -> Energies {
        let mut energies = self.fixed.energies(x, t);
        if let Some(live) = &mut self.live {
            energies += live.energies(x, t);
        }
        energies
    }

    /// ∂V/∂x of every coordinate, N, pulled back from tied nodes (whose entries are zero); not finite
    /// where x is outside the domain of a term.
    ///
    /// What never changes (affine terms without t, stencils whose coordinates are all fixed) is
    /// evaluated at the first call only.
    pub fn gradient(&mut self, x: &[f64], t: f64, out: &mut [f64]) {
        self.fixed.gradient(x, t, out);
        if let Some(live) = &mut self.live {
            live.add_gradient(x, t, out);
        }
    }

    /// The first phase of [`Assembler::gradient`] for lists without live terms; the caller then sums over nodes from
    /// [`Assembler::gather`].
    pub(crate) fn sum_chunks(&mut self, x: &[f64], t: f64) {
        self.fixed.sum_chunks(x, t);
    }

    pub(crate) fn gather(&self) -> &Gather {
        self.fixed.gather()
    }

    /// The sum of the live terms, to be read.
    pub(crate) fn shared_live(&self) -> Option<&LiveSum> {
        self.live.as_deref()
    }

    /// The sum of the live terms.
    pub(crate) fn live(&mut self) -> Option<&mut LiveSum> {
        self.live.as_deref_mut()
    }

    /// ∂²V/∂q² on the free coordinates, N/m.
    ///
    /// Terms whose Hessian is constant are evaluated at the first call only.
    ///
    /// # Errors
    /// Where live terms and fixed ones cannot be summed into one matrix.
    pub fn hessian(
        &mut self,
        x: &[f64],
        t: f64,
        kind: HessianEvaluation,
    ) -> Result<&SymmetricMatrix, SolverError> {
        self.hessian_over(x, t, kind, None)
    }

    /// As [`Assembler::hessian`], with the tangents of discrete gradients, for a step between two `ends` that has its
    /// stage at x.
    pub(crate) fn hessian_over(
        &mut self,
        x: &[f64],
        t: f64,
        kind: HessianEvaluation,
        ends: Option<[&[f64]; 2]>,
    ) -> Result<&SymmetricMatrix, SolverError> {
        let fixed = self.fixed.hessian(x, t, kind);
        match &mut self.live {
            Some(live) => live.hessian(fixed, x, t, kind, ends),
            None => Ok(fixed),
        }
    }

    /// Must a term be asked how far the body may move? Without such terms [`Assembler::largest_step`] is 1.
    pub(crate) fn limits_steps(&self) -> bool {
        self.live.is_some() || self.terms().fixed().iter().any(|term| term.limits_steps())
    }

    /// The largest part of the change `dx` from x that all terms allow, in (0, 1]. Terms that act by a discrete
    /// gradient are asked for `end` = (end of the step, its change) instead, if that is given.
    pub(crate) fn largest_step(&mut self, x: &[f64], dx: &[f64], end: Option<[&[f64]; 2]>) -> f64 {
        let fixed = self.terms().fixed().iter().filter(|term| term.limits_steps());
        let fixed = fixed.map(|term| term.largest_step(x, dx)).fold(1.0, f64::min);
        fixed.min(self.live.as_mut().map_or(1.0, |live| live.largest_step(x, dx, end)))
    }

    /// Σ V_e F̄_e (m³, row-major) over the stencils around each node; false where no term has it.
    pub fn mean_deformations(&mut self, x: &[f64], out: &mut [[f64; 9]]) -> bool {
        self.fixed.mean_deformations(x, out)
    }

    /// The first stencil without a finite energy or gradient, by term and stencil order.
    pub fn fault(&self, x: &[f64], t: f64) -> Option<TermFault> {
        self.fixed.fault(x, t).or_else(|| self.live.as_ref()?.fault(x, t))
    }

    /// What was evaluated so far.
    pub fn work(&self) -> AssemblyWork {
        let [live_renewals, live_patterns] = self.live.as_ref().map_or([0; 2], |live| live.counts());
        AssemblyWork { live_renewals, live_patterns, ..self.fixed.work() }
    }

    /// Coordinates per node of the nodal arrays: the largest of 3, 2, 1 that divides the block of every term.
    pub fn block(&self) -> usize {
        self.fixed.block()
    }

    /// Bytes of maps and buffers, beyond what the terms hold.
    pub fn bytes(&self) -> usize {
        self.fixed.bytes()
    }
}
