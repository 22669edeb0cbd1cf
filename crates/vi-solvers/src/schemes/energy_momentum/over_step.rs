//! Sums the corrections of the terms that have forces over a step of their own ([`Potential::corrections_over_step`]). To an assembler,
//! they are gradients, so the terms are wrapped as potentials that read both ends of the step from one array.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Account, HessianKind, Potential, Stencils, System, Terms, Traits};

use crate::assemble::fixed::FixedSum;

/// Returns whether a term has forces over a step.
pub(super) fn has_forces_over_step(term: &dyn Potential) -> bool {
    term.corrections_over_step(0..0, [&[]; 2], &mut [])
}

/// A term whose gradient is its corrections over a step.
struct Term(Arc<dyn Potential>);

impl Potential for Term {
    fn name(&self) -> &str {
        self.0.name()
    }

    fn account(&self) -> Account {
        self.0.account()
    }

    fn stencils(&self) -> Stencils<'_> {
        self.0.stencils()
    }

    /// Declares time dependence, so that nothing is cached as constant.
    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: true }
    }

    fn energies(&self, range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out[..range.len()].fill(0.0);
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        self.0.corrections_over_step(range, x.split_at(x.len() / 2).into(), out);
    }

    /// Corrections have no tangents: Newton's method uses those of the gradients.
    fn hessians(&self, _range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
    }
}

/// The sum of the corrections of a system.
pub(super) struct Corrections {
    sum: FixedSum,
    /// Positions of all coordinates at the start of the step, then at its end, m.
    ends: Vec<f64>,
    total: Vec<f64>,
}

impl Corrections {
    /// Returns the sum; `None` if no term has forces over a step.
    pub(super) fn new(system: &System) -> Option<Self> {
        let terms = system.potentials().iter().filter(|term| has_forces_over_step(term.as_ref()));
        let terms: Vec<Arc<dyn Potential>> =
            terms.map(|term| Arc::new(Term(Arc::clone(term))) as Arc<dyn Potential>).collect();
        if terms.is_empty() {
            return None;
        }
        let count = system.coordinates().dof_count();
        // Their stencils were accepted as parts of `system`.
        let terms = Terms::new(Arc::clone(system.terms().shared_coordinates()), terms).ok()?;
        Some(Self { sum: FixedSum::new(terms, None), ends: vec![0.0; 2 * count], total: vec![0.0; count] })
    }

    /// Returns the corrections of every coordinate for a step between two ends, N, pulled back from tied nodes.
    pub(super) fn evaluate(&mut self, [start, end]: [&[f64]; 2], t: f64) -> &[f64] {
        let (first, second) = self.ends.split_at_mut(start.len());
        first.copy_from_slice(start);
        second.copy_from_slice(end);
        self.sum.gradient(&self.ends, t, &mut self.total);
        &self.total
    }
}
