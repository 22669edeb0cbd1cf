//! Springs from nodes to nodes or to points of space, as potentials.

use std::ops::Range;

use vi_core::{Account, HessianKind, Potential, Stencils, Traits};

use crate::error::FemError;
use crate::small::tensor::dot;

fn position(x: &[f64], node: u32) -> [f64; 3] {
    let start = 3 * node as usize;
    [x[start], x[start + 1], x[start + 2]]
}

/// The other end of a spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SpringEnd {
    /// A node of the system.
    Node(u32),
    /// A point of space, m.
    Anchor([f64; 3]),
}

/// A spring V = k/2 (|x_a − y| − L)² between a node and another node or a fixed point y. If the rest length L is
/// zero, its Hessian is constant.
#[derive(Debug, Clone)]
pub struct PointSpring {
    name: String,
    nodes: Vec<u32>,
    anchor: Option<[f64; 3]>,
    stiffness: f64,
    rest_length: f64,
}

impl PointSpring {
    /// Returns a spring of stiffness k (N/m, positive) and rest length L (m, not negative).
    ///
    /// # Errors
    /// Returns [`FemError::Parameter`] for k ≤ 0 or L < 0; [`FemError::Invalid`] for a spring from a node to itself.
    pub fn new(
        name: &str,
        node: u32,
        end: SpringEnd,
        stiffness: f64,
        rest_length: f64,
    ) -> Result<Self, FemError> {
        if !(stiffness > 0.0 && stiffness.is_finite()) {
            let requirement = "the stiffness of a spring must be positive (N/m)";
            return Err(FemError::Parameter { key: "stiffness", value: stiffness, requirement });
        }
        if !(rest_length >= 0.0 && rest_length.is_finite()) {
            let requirement = "the rest length of a spring must not be negative (m)";
            return Err(FemError::Parameter { key: "rest_length", value: rest_length, requirement });
        }
        let (nodes, anchor) = match end {
            SpringEnd::Anchor(point) => (vec![node], Some(point)),
            SpringEnd::Node(other) if other != node => (vec![node, other], None),
            SpringEnd::Node(_) => {
                let problem = format!("node {node} is at both ends: choose two nodes");
                return Err(FemError::Invalid { what: "spring", problem });
            }
        };
        Ok(Self { name: name.into(), nodes, anchor, stiffness, rest_length })
    }

    /// Returns d = x_a − y and |d|, m.
    fn extension(&self, x: &[f64]) -> ([f64; 3], f64) {
        let from = position(x, self.nodes[0]);
        let to = self.anchor.unwrap_or_else(|| position(x, self.nodes[self.nodes.len() - 1]));
        let d = [0, 1, 2].map(|i| from[i] - to[i]);
        (d, dot(d, d).sqrt())
    }
}

impl Potential for PointSpring {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        Account::Elastic
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.nodes.len(), block: 3, nodes: &self.nodes }
    }

    fn traits(&self) -> Traits {
        let hessian = if self.rest_length == 0.0 { HessianKind::Constant } else { HessianKind::Varying };
        Traits { hessian, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        if !range.is_empty() {
            let (_, length) = self.extension(x);
            out[0] = 0.5 * self.stiffness * (length - self.rest_length).powi(2);
        }
    }

    /// Writes k (1 − L/|d|) d. If |d| = 0 the direction is undefined, and the force is set to zero.
    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        if range.is_empty() {
            return;
        }
        let (d, length) = self.extension(x);
        let factor = self.stiffness * if length > 0.0 { 1.0 - self.rest_length / length } else { 0.0 };
        for i in 0..3 {
            out[i] = factor * d[i];
            if self.anchor.is_none() {
                out[3 + i] = -factor * d[i];
            }
        }
    }

    /// Writes k (1 − L/|d|) I + k L/|d|³ d ⊗ d, with the signs + − + for two nodes; k I if |d| = 0.
    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        if range.is_empty() {
            return;
        }
        let (d, length) = self.extension(x);
        let slack = if length > 0.0 { self.rest_length / length } else { 0.0 };
        let mut k = 0;
        for row in 0..3 * self.nodes.len() {
            for column in 0..=row {
                let (i, j) = (row % 3, column % 3);
                let straight = if i == j { 1.0 - slack } else { 0.0 };
                let along = if length > 0.0 { slack * d[i] * d[j] / (length * length) } else { 0.0 };
                let sign = if row / 3 == column / 3 { 1.0 } else { -1.0 };
                out[k] = sign * self.stiffness * (straight + along);
                k += 1;
            }
        }
    }
}
