//! Solid elements of which only portions are evaluated. The shapes at rest, which take most of the memory of a solid, are
//! computed for a portion when it is made.

use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

use pulp::Arch;
use vi_core::{Account, Fault, HessianKind, Patch, Potential, Stencils, Traits};

use crate::solid::elastic::build::Build;
use crate::solid::element::contract::Element;
use crate::solid::element::kernel::Solids;
use crate::solid::law_kernels::kernels_of;
use crate::solid::material::Law;

/// Elements without their shapes at rest. Every evaluation makes the portion that it needs.
pub(super) struct Deferred<B, E, const N: usize, const Q: usize> {
    pub(super) arch: Arch,
    /// The nodes of the mesh at rest, m.
    pub(super) points: Vec<[f64; 3]>,
    /// Number of the first of these nodes in the system.
    pub(super) node_offset: u32,
    /// The nodes of the elements in the system, N each.
    pub(super) nodes: Vec<u32>,
    /// The caller's number of each element.
    pub(super) elements: Vec<u32>,
    pub(super) run_length: usize,
    pub(super) law: Law,
    pub(super) name: String,
    pub(super) form: PhantomData<fn() -> (B, E)>,
}

impl<B: Build, E: Element<N, Q>, const N: usize, const Q: usize> Deferred<B, E, N, Q> {
    fn made(&self, range: Range<usize>) -> Box<dyn Potential> {
        let nodes = &self.nodes[range.start * N..range.end * N];
        let nodes = nodes.iter().map(|node| node - self.node_offset).collect();
        let mut solids = Solids::<E, N, Q>::new(self.arch, &self.points, nodes)
            .unwrap_or_else(|inverted| panic!("{}: {} elements have no volume", self.name, inverted.len()));
        solids.shift_nodes(self.node_offset);
        B::build(solids, kernels_of(&self.law), self.elements[range].to_vec(), self.name.clone())
    }
}

impl<B: Build, E: Element<N, Q>, const N: usize, const Q: usize> Potential for Deferred<B, E, N, Q> {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        Account::Elastic
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: N, block: 3, nodes: &self.nodes }
    }

    fn run_length(&self) -> usize {
        self.run_length
    }

    fn traits(&self) -> Traits {
        let hessian =
            if kernels_of(&self.law).is_linear() { HessianKind::Constant } else { HessianKind::Varying };
        Traits { hessian, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.made(range.clone()).energies(0..range.len(), x, t, out);
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.made(range.clone()).gradients(0..range.len(), x, t, out);
    }

    fn adds_gradients(&self) -> bool {
        !self.elements.is_empty() && self.made(0..1).adds_gradients()
    }

    fn add_gradients(&self, range: Range<usize>, t: f64, patch: Patch<'_>) {
        self.made(range.clone()).add_gradients(0..range.len(), t, patch);
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.made(range.clone()).hessians(0..range.len(), x, t, out);
    }

    fn projected_hessians(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        self.made(range.clone()).projected_hessians(0..range.len(), x, t, out);
    }

    fn mean_deformations(&self, range: Range<usize>, x: &[f64], out: &mut [f64]) -> bool {
        self.made(range.clone()).mean_deformations(0..range.len(), x, out)
    }

    fn portion(&self, range: Range<usize>) -> Option<Arc<dyn Potential>> {
        Some(self.made(range).into())
    }

    fn element(&self, stencil: usize) -> usize {
        self.elements.get(stencil).map_or(stencil, |&element| element as usize)
    }

    fn fault(&self, stencil: usize, x: &[f64], t: f64) -> Option<Fault> {
        self.made(stencil..stencil + 1).fault(0, x, t)
    }
}
