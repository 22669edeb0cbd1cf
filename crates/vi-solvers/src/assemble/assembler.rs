//! Computes energy, gradient and Hessian of a list of terms: the sum of its fixed terms (`fixed.rs`) and its live
//! ones (`live.rs`).

use vi_core::Terms;

use crate::assemble::energy::Energies;
use crate::assemble::fixed::{AssemblyWork, FixedSum};
use crate::assemble::gather::Gather;
use crate::assemble::hessian::{HessianEvaluation, Place};
use crate::assemble::live::LiveSum;
use crate::assemble::spans::Span;
use crate::error::{SolverError, TermFault};
use crate::linear::matrix::SymmetricMatrix;

/// Sums the terms of a list. All methods give the same bits on any number of threads. After their first call they
/// allocate nothing, unless live terms change their stencils.
pub struct Assembler {
    fixed: FixedSum,
    live: Option<Box<LiveSum>>,
}

impl Assembler {
    /// Builds the sum of the terms of V of a system. It builds the maps of energy and gradient; those of the Hessian
    /// are built at its first call.
    pub fn new(terms: &impl AsRef<Terms>) -> Self {
        let fixed = FixedSum::new(terms.as_ref().clone(), None);
        let live = LiveSum::new(fixed.terms(), fixed.block(), false).map(Box::new);
        Self { fixed, live }
    }

    /// Returns the sum of the terms that a rank of several computes, with the maps of its gradient.
    pub(crate) fn of_portion(terms: Terms, gather: Gather) -> Self {
        Self { fixed: FixedSum::of_portion(terms, gather), live: None }
    }

    /// Makes live terms that have a discrete gradient act by it alone from now on, between the ends of a step.
    pub(crate) fn split_live(&mut self) {
        self.live = LiveSum::new(self.fixed.terms(), self.fixed.block(), true).map(Box::new);
    }

    /// Returns another sum of the live terms, in which those with a discrete gradient are kept apart.
    pub(crate) fn new_split_live(&self) -> Option<LiveSum> {
        LiveSum::new(self.fixed.terms(), self.fixed.block(), true)
    }

    /// Returns the list of terms.
    pub fn terms(&self) -> &Terms {
        self.fixed.terms()
    }

    /// Returns V(x, t) by account, J.
    pub fn energies(&mut self, x: &[f64], t: f64) -> Energies {
        let mut energies = self.fixed.energies(x, t);
        if let Some(live) = &mut self.live {
            energies += live.energies(x, t);
        }
        energies
    }

    /// Returns whether the terms that may leave their domain on a free path have finite energies: all fixed terms, and the live
    /// ones that are not [finite there](vi_core::Live::is_finite_on_free_paths).
    pub fn is_in_domain_after_free_path(&mut self, x: &[f64], t: f64) -> bool {
        let energies = if self.terms().is_live_part_finite_on_free_paths() {
            self.fixed.energies(x, t)
        } else {
            self.energies(x, t)
        };
        energies.total().is_finite()
    }

    /// Writes ∂V/∂x of every coordinate, N, pulled back from tied nodes (whose entries are zero). It is not finite if
    /// x is outside the domain of a term.
    ///
    /// Gradients that never change (affine terms without t, stencils with fixed coordinates only) are evaluated at
    /// the first call only.
    pub fn gradient(&mut self, x: &[f64], t: f64, out: &mut [f64]) {
        self.fixed.gradient(x, t, out);
        if let Some(live) = &mut self.live {
            live.add_gradient(x, t, out);
        }
    }

    /// Replaces the positions x by ∂V/∂x as [`Assembler::gradient`] writes it. If several processes share the terms,
    /// this needs no further memory.
    pub(crate) fn replace_by_gradient(&mut self, x: &mut [f64], t: f64) {
        if self.live.is_some() {
            let at = x.to_vec();
            self.gradient(&at, t, x);
        } else {
            self.fixed.replace_by_gradient(x, t);
        }
    }

    /// Performs the first phase of [`Assembler::gradient`] for lists without live terms. The caller then sums over
    /// nodes by [`Assembler::gather`].
    pub(crate) fn sum_chunks(&mut self, x: &[f64], t: f64) {
        self.fixed.sum_chunks(x, t);
    }

    /// Returns the maps of the gradient; `None` if several processes compute it for this one.
    pub(crate) fn gather(&self) -> Option<&Gather> {
        self.fixed.gather()
    }

    /// Returns the energy of each span of the fixed terms, as the sum and its error.
    pub(crate) fn energies_of_spans(&self, spans: &[Span], x: &[f64], t: f64) -> Vec<[f64; 2]> {
        self.fixed.energies_of_spans(spans, x, t)
    }

    /// Removes the live terms from all further sums.
    pub(crate) fn drop_live(&mut self) {
        self.live = None;
    }

    /// Returns the sum of the live terms for reading.
    pub(crate) fn shared_live(&self) -> Option<&LiveSum> {
        self.live.as_deref()
    }

    /// Returns the sum of the live terms.
    pub(crate) fn live(&mut self) -> Option<&mut LiveSum> {
        self.live.as_deref_mut()
    }

    /// Returns ∂²V/∂q² on the free coordinates, N/m.
    ///
    /// Terms with a constant Hessian are evaluated at the first call only.
    ///
    /// # Errors
    /// Returns an error if the Hessians of live and fixed terms cannot be summed into one matrix.
    pub fn hessian(
        &mut self,
        x: &[f64],
        t: f64,
        kind: HessianEvaluation,
    ) -> Result<&SymmetricMatrix, SolverError> {
        self.hessian_over(Place { x, t, ends: None }, kind, None)
    }

    /// Returns [`Assembler::hessian`] with the tangents of forces over a step, and of discrete gradients for a step between two
    /// `ends` with its stage at that place.
    pub(crate) fn hessian_over(
        &mut self,
        at: Place<'_>,
        kind: HessianEvaluation,
        ends: Option<[&[f64]; 2]>,
    ) -> Result<&SymmetricMatrix, SolverError> {
        let fixed = self.fixed.hessian_at(at, kind);
        match &mut self.live {
            Some(live) => live.hessian(fixed, at.x, at.t, kind, ends),
            None => Ok(fixed),
        }
    }

    /// Calls `each` with the Hessians whose sum is ∂²V/∂q² without the terms that act by discrete gradients.
    pub(crate) fn for_each_hessian(
        &mut self,
        x: &[f64],
        t: f64,
        each: &mut dyn FnMut(f64, &SymmetricMatrix),
    ) {
        each(1.0, self.fixed.hessian(x, t, HessianEvaluation::Exact));
        if let Some(hessian) = self.live.as_mut().and_then(|live| live.plain_hessian(x, t)) {
            each(1.0, hessian);
        }
    }

    /// Returns whether a term may limit a displacement. If not, [`Assembler::largest_step`] is 1.
    pub(crate) fn limits_steps(&self) -> bool {
        self.live.is_some() || self.terms().fixed().iter().any(|term| term.limits_steps())
    }

    /// Returns the largest fraction in (0, 1] of the change `dx` from x that all terms allow. Terms that act by a
    /// discrete gradient check `end` = (end of the step, its change) instead, if it is given.
    pub(crate) fn largest_step(&mut self, x: &[f64], dx: &[f64], end: Option<[&[f64]; 2]>) -> f64 {
        let fixed = self.terms().fixed().iter().filter(|term| term.limits_steps());
        let fixed = fixed.map(|term| term.largest_step(x, dx)).fold(1.0, f64::min);
        fixed.min(self.live.as_mut().map_or(1.0, |live| live.largest_step(x, dx, end)))
    }

    /// Writes Σ V_e F̄_e (m³, row-major) over the stencils around each node; returns false if no term provides it.
    pub fn mean_deformations(&mut self, x: &[f64], out: &mut [[f64; 9]]) -> bool {
        self.fixed.mean_deformations(x, out)
    }

    /// Returns the first stencil without a finite energy or gradient, in the order of terms and stencils.
    pub fn fault(&self, x: &[f64], t: f64) -> Option<TermFault> {
        self.fixed.fault(x, t).or_else(|| self.live.as_ref()?.fault(x, t))
    }

    /// Returns the first of these spans with a stencil without a finite energy or gradient, and the stencil in it.
    pub(crate) fn fault_in_spans(&self, spans: &[Span], x: &[f64], t: f64) -> Option<(usize, usize)> {
        self.fixed.fault_in_spans(spans, x, t)
    }

    /// Returns the counts of evaluations so far.
    pub fn work(&self) -> AssemblyWork {
        let [live_renewals, live_patterns] = self.live.as_ref().map_or([0; 2], |live| live.counts());
        AssemblyWork { live_renewals, live_patterns, ..self.fixed.work() }
    }

    /// Returns the number of coordinates per node of the nodal arrays: the largest of 3, 2, 1 that divides the block
    /// of every term.
    pub fn block(&self) -> usize {
        self.fixed.block()
    }

    /// Returns the size of maps and buffers in bytes, without the terms' own data.
    pub fn bytes(&self) -> usize {
        self.fixed.bytes()
    }
}
