//! Weight as a potential.

use std::ops::Range;

use vi_core::{Account, Fault, HessianKind, Potential, Stencils, Traits};

use crate::path::amplitude::Amplitude;
use crate::small::tensor::dot;

/// Weight: V = −a(t) Σ_a m_a g·x_a, one stencil per node that has mass.
#[derive(Debug, Clone)]
pub struct Gravity {
    /// a(t).
    amplitude: Amplitude,
    nodes: Vec<u32>,
    /// m_a, kg.
    masses: Vec<f64>,
    /// g, m/s².
    g: [f64; 3],
}

impl Gravity {
    /// Returns the weight of nodes with these masses (kg) in the field g (m/s²).
    pub fn new(masses: &[f64], g: [f64; 3]) -> Self {
        Self::with_amplitude(masses, g, Amplitude::default())
    }

    /// Returns the weight of nodes with these masses (kg) in the field a(t) g (m/s²).
    pub fn with_amplitude(masses: &[f64], g: [f64; 3], amplitude: Amplitude) -> Self {
        let count = masses.iter().filter(|mass| **mass != 0.0).count();
        let (mut nodes, mut own) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for (node, &mass) in masses.iter().enumerate().filter(|(_, mass)| **mass != 0.0) {
            nodes.push(node as u32);
            own.push(mass);
        }
        Self { amplitude, nodes, masses: own, g }
    }

    /// Returns −m_a g of a stencil, N.
    fn gradient(&self, stencil: usize) -> [f64; 3] {
        self.g.map(|g| -self.masses[stencil] * g)
    }
}

impl Potential for Gravity {
    fn name(&self) -> &str {
        "gravity"
    }

    fn account(&self) -> Account {
        Account::Gravity
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: 1, block: 3, nodes: &self.nodes }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Zero, time_dependent: !self.amplitude.is_constant() }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], t: f64, out: &mut [f64]) {
        let factor = self.amplitude.at(t);
        for (out, stencil) in out.iter_mut().zip(range) {
            *out = factor * dot(self.gradient(stencil), position(x, self.nodes[stencil]));
        }
    }

    fn gradients(&self, range: Range<usize>, _x: &[f64], t: f64, out: &mut [f64]) {
        let factor = self.amplitude.at(t);
        for (out, stencil) in out.chunks_exact_mut(3).zip(range) {
            for (out, gradient) in out.iter_mut().zip(self.gradient(stencil)) {
                *out = factor * gradient;
            }
        }
    }

    fn hessians(&self, range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out[..6 * range.len()].fill(0.0);
    }

    fn fault(&self, stencil: usize, _x: &[f64], t: f64) -> Option<Fault> {
        self.amplitude.fault(stencil, t)
    }
}

fn position(x: &[f64], node: u32) -> [f64; 3] {
    let start = 3 * node as usize;
    [x[start], x[start + 1], x[start + 2]]
}
