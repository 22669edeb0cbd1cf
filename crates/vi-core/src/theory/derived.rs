//! A potential given by its energy alone. Automatic differentiation computes gradients and Hessians: they are exact,
//! but slower than derivatives written by hand.

use std::ops::Range;

use num_dual::{Dual64, HyperDual64};

use crate::contract::potential::{Account, HessianKind, Potential, Stencils, Traits, packed_len};
use crate::theory::lagrange::lagrangian::Scalar;

/// The energy V_s (J) of one local term of N coordinates, generic over numbers that may carry derivatives.
pub trait LocalEnergy<const N: usize>: Send + Sync {
    /// Returns V_s of stencil number `stencil` at its coordinates x, m. In products and sums, write numbers of type
    /// f64 on the right of `*` and `+`.
    fn value<D: Scalar>(&self, stencil: usize, x: &[D; N]) -> D;
}

/// The potential Σ V_s of a local energy of points in space, with N/3 nodes per stencil.
pub struct Derived<const N: usize, E> {
    name: String,
    nodes: Vec<u32>,
    energy: E,
}

impl<const N: usize, E: LocalEnergy<N>> Derived<N, E> {
    /// Returns the potential for the nodes of all stencils, one stencil after the other. `name` appears in reports
    /// and errors.
    pub fn new(name: impl Into<String>, nodes: Vec<u32>, energy: E) -> Self {
        const { assert!(N > 0 && N.is_multiple_of(3), "a node has three coordinates") };
        Self { name: name.into(), nodes, energy }
    }

    fn local(&self, stencil: usize, x: &[f64]) -> [f64; N] {
        let nodes = &self.nodes[stencil * N / 3..];
        std::array::from_fn(|k| x[3 * nodes[k / 3] as usize + k % 3])
    }
}

impl<const N: usize, E: LocalEnergy<N>> Potential for Derived<N, E> {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        Account::Load
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: N / 3, block: 3, nodes: &self.nodes }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out) {
            *out = self.energy.value(stencil, &self.local(stencil, x));
        }
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(N)) {
            let mut local = self.local(stencil, x).map(Dual64::from_re);
            for (k, out) in out.iter_mut().enumerate() {
                local[k].eps = 1.0;
                *out = self.energy.value(stencil, &local).eps;
                local[k].eps = 0.0;
            }
        }
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(packed_len(N))) {
            let mut local = self.local(stencil, x).map(HyperDual64::from_re);
            for i in 0..N {
                local[i].eps1 = 1.0;
                for j in 0..=i {
                    local[j].eps2 = 1.0;
                    out[packed_len(i) + j] = self.energy.value(stencil, &local).eps1eps2;
                    local[j].eps2 = 0.0;
                }
                local[i].eps1 = 0.0;
            }
        }
    }
}
