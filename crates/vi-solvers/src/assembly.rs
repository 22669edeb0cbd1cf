//! Energy, gradient and Hessian of a list of terms as sums over their stencils, and the count of what was evaluated.
//! The sums themselves are made in `energy.rs`, `gather.rs`, `hessian.rs` and, for live terms, `live.rs`.

use vi_core::{Fault, Terms};

use crate::energy::{Energies, EnergySum};
use crate::error::{SolverError, TermFault};
use crate::gather::{self, Gather, common_block};
use crate::hessian::HessianSum;
use crate::live::LiveSum;
use crate::matrix::SymmetricMatrix;

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
    /// How often live terms were asked for new stencils.
    pub live_renewals: u64,
    /// How often the pattern of the sum of Hessians was made for them.
    pub live_patterns: u64,
}

/// Evaluates what has changed of the Hessian of the fixed terms.
fn sum_hessians<'a>(
    terms: &Terms,
    block: usize,
    hessian: &'a mut Option<HessianSum>,
    work: &mut AssemblyWork,
    (x, t, kind): (&[f64], f64, HessianEvaluation),
) -> &'a SymmetricMatrix {
    let hessian = hessian.get_or_insert_with(|| HessianSum::new(terms, block));
    work.hessian_skipped_stencils = hessian.skipped_stencils() as u64;
    if hessian.evaluate(terms, x, t, kind) {
        work.hessians += 1;
    }
    hessian.matrix()
}

/// Sums the terms of a list; all methods give the same bits on any number of threads and allocate nothing after their
/// first call, unless live terms change their stencils.
pub struct Assembler {
    terms: Terms,
    energy: EnergySum,
    gather: Gather,
    hessian: Option<HessianSum>,
    live: Option<Box<LiveSum>>,
    work: AssemblyWork,
}

impl Assembler {
    /// Of the terms of V, for a system. Makes the maps of energy and gradient; those of the Hessian are made at its
    /// first call.
    pub fn new(terms: &impl AsRef<Terms>) -> Self {
        Self::of(terms.as_ref().clone(), None)
    }

    /// The same with `block` coordinates a node of the nodal arrays, which divides those of all terms; none for the
    /// largest.
    pub(crate) fn of(terms: Terms, block: Option<usize>) -> Self {
        let block = block.unwrap_or_else(|| common_block(&terms));
        let gather = Gather::new(&terms, block);
        let work =
            AssemblyWork { constant_stencils: gather.constant_stencils() as u64, ..Default::default() };
        let live = LiveSum::new(&terms, block, false).map(Box::new);
        Self { energy: EnergySum::new(&terms), gather, hessian: None, live, work, terms }
    }

    /// From here on live terms with a discrete gradient act by that alone, between the ends of a step.
    pub(crate) fn split_live(&mut self) {
        self.live = LiveSum::new(&self.terms, self.block(), true).map(Box::new);
    }

    /// What is summed.
    pub fn terms(&self) -> &Terms {
        &self.terms
    }

    /// V(x, t) by account, J.
    pub fn energies(&mut self, x: &[f64], t: f64) -> Energies {
        self.work.energies += 1;
        let mut energies = self.energy.evaluate(&self.terms, x, t);
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
        self.work.gradients += 1;
        self.gather.gradient(&self.terms, x, t, out);
        self.terms.coordinates().pull_back(out);
        if let Some(live) = &mut self.live {
            live.add_gradient(x, t, out);
        }
    }

    /// The first half of [`Assembler::gradient`] of lists without live terms; the sums over nodes are left to who passes
    /// over them.
    pub(crate) fn sum_chunks(&mut self, x: &[f64], t: f64) {
        self.work.gradients += 1;
        self.gather.sum_chunks(&self.terms, x, t);
    }

    pub(crate) fn gather(&self) -> &Gather {
        &self.gather
    }

    /// The live terms, to be looked at.
    pub(crate) fn shared_live(&self) -> Option<&LiveSum> {
        self.live.as_deref()
    }

    /// The live terms.
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

    /// The same where a step between two `ends` has its stage at x: with the tangents of discrete gradients.
    pub(crate) fn hessian_over(
        &mut self,
        x: &[f64],
        t: f64,
        kind: HessianEvaluation,
        ends: Option<[&[f64]; 2]>,
    ) -> Result<&SymmetricMatrix, SolverError> {
        let Self { terms, gather, hessian, live, work, .. } = self;
        let fixed = sum_hessians(terms, gather.block(), hessian, work, (x, t, kind));
        match live {
            Some(live) => live.hessian(fixed, x, t, kind, ends),
            None => Ok(fixed),
        }
    }

    /// The Hessian of the fixed terms alone.
    pub(crate) fn sum_hessians(&mut self, x: &[f64], t: f64, kind: HessianEvaluation) -> &SymmetricMatrix {
        let Self { terms, gather, hessian, work, .. } = self;
        sum_hessians(terms, gather.block(), hessian, work, (x, t, kind))
    }

    /// Σ V_e F̄_e (m³, row-major) over the stencils around each node; false where no term has it.
    pub fn mean_deformations(&mut self, x: &[f64], out: &mut [[f64; 9]]) -> bool {
        self.gather.node_tensors(&self.terms, x, out)
    }

    /// The first stencil without a finite energy or gradient, by term and stencil order.
    pub fn fault(&self, x: &[f64], t: f64) -> Option<TermFault> {
        for (term, potential) in self.terms.fixed().iter().enumerate() {
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
        self.live.as_ref().and_then(|live| live.fault(x, t))
    }

    /// What was evaluated so far.
    pub fn work(&self) -> AssemblyWork {
        let [live_renewals, live_patterns] = self.live.as_ref().map_or([0; 2], |live| live.counts());
        AssemblyWork { live_renewals, live_patterns, ..self.work }
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
