//! A potential from one function that gives energy, gradient and Hessian of a local term.

use std::ops::Range;

use crate::contract::potential::{Account, HessianKind, Potential, Stencils, Traits, packed_len};

/// Energy V_s (J), gradient (N) and Hessian (N/m) of one local term of N coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jet<const N: usize> {
    /// Energy V_s, J.
    pub energy: f64,
    /// Gradient ∂V_s/∂x, N.
    pub gradient: [f64; N],
    /// Hessian ∂²V_s/∂x², N/m; symmetric.
    pub hessian: [[f64; N]; N],
}

/// A potential with all local terms given by `jet(stencil, local coordinates)`.
pub struct Term<const N: usize, J> {
    /// Name of the term in reports.
    pub name: &'static str,
    /// Coordinates per node.
    pub block: usize,
    /// Node numbers, N / block per stencil.
    pub nodes: Vec<u32>,
    /// Structure of the Hessian.
    pub hessian: HessianKind,
    /// The function `jet(stencil, local coordinates)` that gives one local term.
    pub jet: J,
}

impl<const N: usize, J: Fn(usize, &[f64; N]) -> Jet<N>> Term<N, J> {
    fn at(&self, stencil: usize, x: &[f64]) -> Jet<N> {
        let arity = N / self.block;
        let mut local = [0.0; N];
        for a in 0..arity {
            let node = self.nodes[stencil * arity + a] as usize;
            local[a * self.block..(a + 1) * self.block]
                .copy_from_slice(&x[node * self.block..(node + 1) * self.block]);
        }
        (self.jet)(stencil, &local)
    }
}

impl<const N: usize, J: Fn(usize, &[f64; N]) -> Jet<N> + Send + Sync> Potential for Term<N, J> {
    fn name(&self) -> &str {
        self.name
    }

    fn account(&self) -> Account {
        Account::Elastic
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: N / self.block, block: self.block, nodes: &self.nodes }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: self.hessian, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out) {
            *out = self.at(stencil, x).energy;
        }
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(N)) {
            out.copy_from_slice(&self.at(stencil, x).gradient);
        }
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (stencil, out) in range.zip(out.chunks_exact_mut(packed_len(N))) {
            let jet = self.at(stencil, x);
            for i in 0..N {
                out[packed_len(i)..packed_len(i + 1)].copy_from_slice(&jet.hessian[i][..=i]);
            }
        }
    }
}
