//! The contract by which a kind of strain energy is built from elements.

use vi_core::Potential;

use crate::solid::element::contract::Element;
use crate::solid::element::kernel::Solids;
use crate::solid::law_kernels::LawKernels;

/// Builds the potential of elements: it defines how their strain energy follows from their deformation.
pub(crate) trait Build: 'static {
    fn build<E: Element<N, Q>, const N: usize, const Q: usize>(
        solids: Solids<E, N, Q>,
        law: Box<dyn LawKernels>,
        elements: Vec<u32>,
        name: String,
    ) -> Box<dyn Potential>;
}
