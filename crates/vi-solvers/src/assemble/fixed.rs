//! Energy, gradient and Hessian of the terms whose stencils never change, as sums over their stencils, and counts of
//! the evaluations. The sums themselves are computed in `energy.rs`, `gather.rs` and `hessian.rs`.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Fault, Potential, SharedTerms, Terms};

use crate::assemble::energy::{Energies, EnergySum, energies_of_spans};
use crate::assemble::gather::{Gather, node_tensors};
use crate::assemble::hessian::{HessianEvaluation, HessianSum, Place};
use crate::assemble::spans::{Span, common_block, spans};
use crate::error::{SolverError, TermFault};
use crate::linear::matrix::SymmetricMatrix;

/// Counts of what was evaluated and what was skipped.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct AssemblyWork {
    /// Energies of the whole system.
    pub energies: u64,
    /// Gradients of the whole system.
    pub gradients: u64,
    /// Hessians of the whole system, not counting calls in which nothing could have changed.
    pub hessians: u64,
    /// Stencils whose gradient is computed once: V is affine, or none of their coordinates ever moves.
    pub constant_stencils: u64,
    /// Stencils without a Hessian on free coordinates: V is affine, or all their coordinates are prescribed.
    pub hessian_skipped_stencils: u64,
    /// Number of times that new stencils of live terms were requested.
    pub live_renewals: u64,
    /// Number of times that the pattern of the sum of Hessians was built for live terms.
    pub live_patterns: u64,
}

/// The way to the gradient.
enum GradientSum {
    /// This process computes it, or its share of it.
    Here(Box<Gather>),
    /// Several processes compute it.
    Shared(Arc<dyn SharedTerms>),
}

/// The sum of the fixed terms of a list; its live terms are left out.
pub(crate) struct FixedSum {
    terms: Terms,
    /// Number of coordinates per node of the nodal arrays.
    block: usize,
    energy: EnergySum,
    gradient: GradientSum,
    hessian: Option<HessianSum>,
    work: AssemblyWork,
}

impl FixedSum {
    /// Builds the maps of energy and gradient; the maps of the Hessian are built at its first call. The nodal arrays
    /// have `block` coordinates per node, which must divide the blocks of all terms. Without `block`, the largest
    /// such number is used.
    pub(crate) fn new(terms: Terms, block: Option<usize>) -> Self {
        let block = block.unwrap_or_else(|| common_block(&terms));
        let gradient = match terms.shared() {
            Some(shared) => GradientSum::Shared(Arc::clone(shared)),
            None => GradientSum::Here(Box::new(Gather::new(&terms, block).in_order_of_nodes())),
        };
        let constant_stencils = match &gradient {
            GradientSum::Here(gather) => gather.constant_stencils() as u64,
            GradientSum::Shared(_) => 0,
        };
        let work = AssemblyWork { constant_stencils, ..Default::default() };
        Self { energy: EnergySum::new(&terms), block, gradient, hessian: None, work, terms }
    }

    /// Returns the sum of the terms that a rank of several computes, with the maps of its gradient.
    pub(crate) fn of_portion(terms: Terms, gather: Gather) -> Self {
        let (energy, block, work) = (EnergySum::new(&terms), gather.block(), AssemblyWork::default());
        Self { energy, block, gradient: GradientSum::Here(Box::new(gather)), hessian: None, work, terms }
    }

    /// Replaces the terms by others with the same stencils.
    pub(crate) fn exchange(&mut self, terms: Vec<Arc<dyn Potential>>) -> Result<(), SolverError> {
        let coordinates = Arc::clone(self.terms.shared_coordinates());
        self.terms = Terms::new(coordinates, terms)
            .map_err(|_| SolverError::Memory { missing: "stencils of the live terms" })?;
        Ok(())
    }

    pub(crate) fn terms(&self) -> &Terms {
        &self.terms
    }

    /// Returns V(x, t) by account, J.
    pub(crate) fn energies(&mut self, x: &[f64], t: f64) -> Energies {
        self.work.energies += 1;
        let known = match &self.gradient {
            GradientSum::Here(_) => Vec::new(),
            GradientSum::Shared(shared) => shared.energies(x, t),
        };
        self.energy.evaluate(&self.terms, x, t, &known)
    }

    /// Returns the energy of each span, as the sum and its error.
    pub(crate) fn energies_of_spans(&self, spans: &[Span], x: &[f64], t: f64) -> Vec<[f64; 2]> {
        energies_of_spans(spans, &self.terms, x, t)
    }

    /// Writes ∂V/∂x of every coordinate, N, pulled back from tied nodes.
    pub(crate) fn gradient(&mut self, x: &[f64], t: f64, out: &mut [f64]) {
        match &mut self.gradient {
            GradientSum::Here(gather) => {
                self.work.gradients += 1;
                let located = self.terms.at(x);
                gather.gradient(located.as_ref().unwrap_or(&self.terms), x, t, out);
                self.terms.coordinates().pull_back(out);
            }
            GradientSum::Shared(_) => {
                out.copy_from_slice(x);
                self.replace_by_gradient(out, t);
            }
        }
    }

    /// Replaces x by ∂V/∂x as [`FixedSum::gradient`] writes it. If several processes share the terms, this needs no
    /// further memory.
    pub(crate) fn replace_by_gradient(&mut self, x: &mut [f64], t: f64) {
        match &self.gradient {
            GradientSum::Here(_) => {
                let at = x.to_vec();
                self.gradient(&at, t, x);
            }
            GradientSum::Shared(shared) => {
                self.work.gradients += 1;
                shared.gradient(x, t);
                self.terms.coordinates().pull_back(x);
            }
        }
    }

    /// Performs the first phase of [`FixedSum::gradient`]; the caller then sums over nodes by [`FixedSum::gather`].
    pub(crate) fn sum_chunks(&mut self, x: &[f64], t: f64) {
        self.work.gradients += 1;
        if let GradientSum::Here(gather) = &mut self.gradient {
            gather.sum_chunks(&self.terms, x, t);
        }
    }

    /// Returns the maps of the gradient; `None` if several processes compute it for this one.
    pub(crate) fn gather(&self) -> Option<&Gather> {
        match &self.gradient {
            GradientSum::Here(gather) => Some(gather),
            GradientSum::Shared(_) => None,
        }
    }

    /// Returns ∂²V/∂q² on the free coordinates, N/m. Evaluates only what has changed.
    pub(crate) fn hessian(&mut self, x: &[f64], t: f64, kind: HessianEvaluation) -> &SymmetricMatrix {
        self.hessian_at(Place { x, t, ends: None }, kind)
    }

    /// Returns [`FixedSum::hessian`], with the tangents of forces over a step if there are ends.
    pub(crate) fn hessian_at(&mut self, at: Place<'_>, kind: HessianEvaluation) -> &SymmetricMatrix {
        let Self { terms, block, hessian, work, .. } = self;
        let hessian = hessian.get_or_insert_with(|| HessianSum::new(terms, *block));
        work.hessian_skipped_stencils = hessian.skipped_stencils() as u64;
        let located = terms.at(at.x);
        if hessian.evaluate(located.as_ref().unwrap_or(terms), at, kind) {
            work.hessians += 1;
        }
        hessian.matrix()
    }

    /// Returns the result of the last call of [`FixedSum::hessian`].
    pub(crate) fn last_hessian(&self) -> Option<&SymmetricMatrix> {
        self.hessian.as_ref().map(HessianSum::matrix)
    }

    /// Writes Σ V_e F̄_e (m³, row-major) over the stencils around each node; returns false if no term provides it.
    pub(crate) fn mean_deformations(&mut self, x: &[f64], out: &mut [[f64; 9]]) -> bool {
        node_tensors(&self.terms, self.block, x, out)
    }

    /// Returns the first stencil without a finite energy or gradient, in the order of terms and stencils.
    pub(crate) fn fault(&self, x: &[f64], t: f64) -> Option<TermFault> {
        let is_far = self.terms.fixed().iter().any(|term| term.elsewhere().is_some());
        let far = self.terms.shared().filter(|_| is_far).and_then(|shared| shared.first_fault(x, t));
        for (term, potential) in self.terms.fixed().iter().enumerate() {
            let name = || Box::from(potential.name());
            if let (Some(elsewhere), Some((_, stencil))) =
                (potential.elsewhere(), far.filter(|&(other, _)| other == term))
            {
                let few = (elsewhere.make)(&[stencil]);
                let (_, fault) = first_fault(few.term.as_ref(), 0..1, &few.positions(x), t)?;
                return Some(TermFault {
                    term: name(),
                    fault: Fault { element: few.elements[0] as usize, ..fault },
                });
            }
            let mut spans = spans(term, potential.as_ref());
            let fault = spans.find_map(|span| first_fault(potential.as_ref(), span.stencils, x, t));
            if let Some((_, fault)) = fault {
                return Some(TermFault { term: name(), fault });
            }
        }
        None
    }

    /// Returns the first of these spans with a stencil without a finite energy or gradient, and the stencil in it.
    pub(crate) fn fault_in_spans(&self, spans: &[Span], x: &[f64], t: f64) -> Option<(usize, usize)> {
        spans.iter().enumerate().find_map(|(number, span)| {
            let potential = self.terms.fixed()[span.term].as_ref();
            let (stencil, _) = first_fault(potential, span.stencils.clone(), x, t)?;
            Some((number, stencil - span.stencils.start))
        })
    }

    pub(crate) fn work(&self) -> AssemblyWork {
        self.work
    }

    /// Returns the number of coordinates per node of the nodal arrays.
    pub(crate) fn block(&self) -> usize {
        self.block
    }

    /// Returns the size of maps and buffers in bytes, without the terms' own data.
    pub(crate) fn bytes(&self) -> usize {
        self.gather().map_or(0, Gather::bytes) + self.hessian.as_ref().map_or(0, HessianSum::bytes)
    }
}

/// Returns the first of some stencils without a finite energy or gradient, and why.
fn first_fault(
    potential: &dyn Potential,
    stencils: Range<usize>,
    x: &[f64],
    t: f64,
) -> Option<(usize, Fault)> {
    let size = potential.stencils().size();
    let mut energies = vec![0.0; stencils.len()];
    let mut gradients = vec![0.0; stencils.len() * size];
    potential.energies(stencils.clone(), x, t, &mut energies);
    potential.gradients(stencils.clone(), x, t, &mut gradients);
    stencils.enumerate().find_map(|(k, stencil)| {
        let force = gradients[k * size..(k + 1) * size].iter().find(|value| !value.is_finite());
        let (quantity, value) = match (energies[k].is_finite(), force) {
            (false, _) => ("energy", energies[k]),
            (true, Some(&value)) => ("force", value),
            (true, None) => return None,
        };
        let element = potential.element(stencil);
        let unexplained = Fault { element, quantity, value, domain: "must be finite", at_any_state: false };
        Some((stencil, potential.fault(stencil, x, t).unwrap_or(unexplained)))
    })
}
