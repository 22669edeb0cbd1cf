//! Quadratic constraints on points in space: g(x) = c + Σ a_j·x_j + Σ k x_a·x_b, with vectors a_j and
//! numbers k. In natural coordinates everything that rigid bodies and joints ask is of this form:
//! ```text
//! rigid body    d_i·d_j − δ_ij = 0                    (6)
//! ball joint    r_A − r_B = 0                         (3)       r = c + X₁ d₁ + X₂ d₂ + X₃ d₃
//! hinge         ball joint, n_A·m_B = n_A·m'_B = 0    (3 + 2)   n ∥ the axis, m and m' beside it
//! weld          ball joint, three such products       (3 + 3)
//! rod           |r_A − r_B|² − L² = 0                 (1)
//! ```
//! Its Hessian is constant and its gradient at the middle of a step is exactly its difference,
//! ∂g/∂x(½(x₀ + x₁))·(x₁ − x₀) = g(x₁) − g(x₀): so multipliers at the middle do no work (O. Gonzalez,
//! "Mechanical systems subject to holonomic constraints", Physica D 132 (1999) 165–174).
//! This room must not know a time step.

use super::Constraint;
use crate::lagrange::Scalar;
use crate::{Coordinates, CoreError};

/// A point or a vector in space as a sum: r = place + Σ w x_k over nodes (k, w).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Place {
    /// Nodes with weights.
    pub nodes: Vec<(u32, f64)>,
    /// What is fixed, m.
    pub fixed: [f64; 3],
}

impl Place {
    /// A node.
    pub fn node(node: u32) -> Self {
        Self { nodes: vec![(node, 1.0)], fixed: [0.0; 3] }
    }

    /// A place or direction fixed in space.
    pub fn fixed(fixed: [f64; 3]) -> Self {
        Self { nodes: Vec::new(), fixed }
    }

    /// A weighted sum of nodes.
    pub fn sum(nodes: Vec<(u32, f64)>) -> Self {
        Self { nodes, fixed: [0.0; 3] }
    }

    /// This minus `other`.
    pub fn minus(&self, other: &Self) -> Self {
        let negative = other.nodes.iter().map(|&(node, weight)| (node, -weight));
        Self {
            nodes: self.nodes.iter().copied().chain(negative).collect(),
            fixed: std::array::from_fn(|k| self.fixed[k] - other.fixed[k]),
        }
    }
}

/// One constraint g(x) = 0.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadraticConstraint {
    name: String,
    constant: f64,
    linear: Vec<(u32, [f64; 3])>,
    products: Vec<(u32, u32, f64)>,
}

impl QuadraticConstraint {
    /// a·b = value. `name` is for messages.
    pub fn product(name: impl Into<String>, a: &Place, b: &Place, value: f64) -> Self {
        let constant = (0..3).map(|k| a.fixed[k] * b.fixed[k]).sum::<f64>() - value;
        let mut linear = Vec::new();
        for (sum, fixed) in [(a, b.fixed), (b, a.fixed)] {
            if fixed != [0.0; 3] {
                linear.extend(sum.nodes.iter().map(|&(node, weight)| (node, fixed.map(|x| x * weight))));
            }
        }
        let products =
            a.nodes.iter().flat_map(|&(i, w)| b.nodes.iter().map(move |&(j, v)| (i, j, w * v))).collect();
        Self { name: name.into(), constant, linear, products }
    }

    /// a = b: three constraints, one an axis.
    pub fn coincidence(name: &str, a: &Place, b: &Place) -> [Self; 3] {
        let gap = a.minus(b);
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|axis| Self::product(name, &gap, &Place::fixed(axis), 0.0))
    }

    /// |a − b| = length, as |a − b|²/2 = length²/2.
    pub fn distance(name: &str, a: &Place, b: &Place, length: f64) -> Self {
        let gap = a.minus(b);
        let half = Place {
            nodes: gap.nodes.iter().map(|&(node, weight)| (node, 0.5 * weight)).collect(),
            fixed: gap.fixed.map(|x| 0.5 * x),
        };
        Self::product(name, &gap, &half, 0.5 * length * length)
    }

    /// The six constraints of three directors: d_i·d_j = δ_ij.
    pub fn orthonormal(name: &str, directors: [u32; 3]) -> [Self; 6] {
        [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|(i, j): (usize, usize)| {
            let (a, b) = (Place::node(directors[i]), Place::node(directors[j]));
            Self::product(name, &a, &b, f64::from(u8::from(i == j)))
        })
    }

    /// Its name, for messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Nodes that it reads, each as often as it is named.
    pub fn nodes(&self) -> impl Iterator<Item = u32> + '_ {
        self.linear.iter().map(|term| term.0).chain(self.products.iter().flat_map(|term| [term.0, term.1]))
    }

    /// The same of nodes with other numbers.
    #[must_use]
    pub fn renumbered(&self, number: impl Fn(u32) -> u32) -> Self {
        Self {
            name: self.name.clone(),
            constant: self.constant,
            linear: self.linear.iter().map(|&(node, a)| (number(node), a)).collect(),
            products: self.products.iter().map(|&(a, b, k)| (number(a), number(b), k)).collect(),
        }
    }

    /// g at positions x, three coordinates a node.
    pub fn value<D: Scalar>(&self, x: &[D]) -> D {
        let mut value = D::from(self.constant);
        for &(node, a) in &self.linear {
            for k in 0..3 {
                value += x[3 * node as usize + k] * a[k];
            }
        }
        for &(i, j, factor) in &self.products {
            for k in 0..3 {
                value += x[3 * i as usize + k] * x[3 * j as usize + k] * factor;
            }
        }
        value
    }

    /// The sum of the sizes of what g adds up at x, where a linear term is taken at `size` (m) at least:
    /// g is good to this times the unit of round-off.
    pub fn magnitude(&self, x: &[f64], size: f64) -> f64 {
        let at = |node: u32, k: usize| x[3 * node as usize + k].abs();
        let linear = self
            .linear
            .iter()
            .map(|&(node, a)| (0..3).map(|k| at(node, k).max(size) * a[k].abs()).sum::<f64>());
        let norm = |node: u32| (0..3).map(|k| at(node, k).powi(2)).sum::<f64>().sqrt();
        let products = self.products.iter().map(|&(i, j, factor)| norm(i) * norm(j) * factor.abs());
        self.constant.abs() + linear.sum::<f64>() + products.sum::<f64>()
    }

    /// Adds λ ∂g/∂x to `out`.
    pub fn add_gradient(&self, x: &[f64], lambda: f64, out: &mut [f64]) {
        for &(node, a) in &self.linear {
            for k in 0..3 {
                out[3 * node as usize + k] += lambda * a[k];
            }
        }
        for &(i, j, factor) in &self.products {
            for k in 0..3 {
                let (i, j) = (3 * i as usize + k, 3 * j as usize + k);
                out[i] += lambda * factor * x[j];
                out[j] += lambda * factor * x[i];
            }
        }
    }

    /// The same constraint on nodes that are not tied.
    pub(crate) fn resolved(self, coordinates: &Coordinates) -> Result<Self, CoreError> {
        let count = coordinates.dof_count() / 3;
        let missing = self.nodes().find(|&node| node as usize >= count);
        if let Some(node) = missing {
            let node = node as usize;
            return Err(CoreError::Stencil { term: self.name, stencil: 0, node, count });
        }
        let sum = |node: u32| match coordinates.combination(node) {
            Some(terms) => terms.to_vec(),
            None => vec![(node, 1.0)],
        };
        let mut linear = Vec::new();
        for &(node, a) in &self.linear {
            linear.extend(sum(node).into_iter().map(|(k, weight)| (k, a.map(|a| a * weight))));
        }
        let mut products = Vec::new();
        for &(i, j, factor) in &self.products {
            for (a, w) in sum(i) {
                products.extend(sum(j).into_iter().map(|(b, v)| (a, b, factor * w * v)));
            }
        }
        let resolved = Self { linear, products, ..self };
        let is_free = |node: u32| (0..3).any(|k| coordinates.free().binary_search(&(3 * node + k)).is_ok());
        if resolved.nodes().any(is_free) {
            Ok(resolved)
        } else {
            Err(CoreError::Constraint { constraint: resolved.name })
        }
    }
}

/// As constraints on q, for systems whose coordinates are all free: x = q.
impl Constraint for Vec<QuadraticConstraint> {
    fn count(&self) -> usize {
        self.len()
    }
    fn value<D: Scalar>(&self, q: &[D]) -> Vec<D> {
        self.iter().map(|constraint| constraint.value(q)).collect()
    }
}
