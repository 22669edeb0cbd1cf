//! Quadratic constraints on points in space: g(x) = a(x)·b(x) − value, where a and b are weighted sums of nodes. In
//! natural coordinates all constraints of rigid bodies and joints have this form:
//! ```text
//! rigid body    d_i·d_j − δ_ij = 0                    (6)
//! ball joint    r_A − r_B = 0                         (3)       r = c + X₁ d₁ + X₂ d₂ + X₃ d₃
//! hinge         ball joint, n_A·m_B = n_A·m'_B = 0    (3 + 2)   n ∥ the axis, m and m' normal to it
//! weld          ball joint, three such products       (3 + 3)
//! rod           |r_A − r_B|² − L² = 0                 (1)
//! ```
//! The Hessian of g is constant. Its gradient at the middle of a step gives its exact difference:
//! ∂g/∂x(½(x₀ + x₁))·(x₁ − x₀) = g(x₁) − g(x₀). So multipliers at the middle do no work (O. Gonzalez, "Mechanical
//! systems subject to holonomic constraints", Physica D 132 (1999) 165–174).

use crate::contract::coordinates::Coordinates;
use crate::error::CoreError;

/// A point or vector in space as a sum: r = fixed + Σ w x_k over nodes (k, w).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Place {
    /// Pairs (node, weight).
    pub nodes: Vec<(u32, f64)>,
    /// Fixed part, m.
    pub fixed: [f64; 3],
}

impl Place {
    /// Returns the position of a node.
    pub fn node(node: u32) -> Self {
        Self { nodes: vec![(node, 1.0)], fixed: [0.0; 3] }
    }

    /// Returns a point or direction fixed in space.
    pub fn fixed(fixed: [f64; 3]) -> Self {
        Self { nodes: Vec::new(), fixed }
    }

    /// Returns a weighted sum of nodes.
    pub fn sum(nodes: Vec<(u32, f64)>) -> Self {
        Self { nodes, fixed: [0.0; 3] }
    }

    /// Returns the difference of this place and `other`.
    pub fn minus(&self, other: &Self) -> Self {
        let negative = other.nodes.iter().map(|&(node, weight)| (node, -weight));
        Self {
            nodes: self.nodes.iter().copied().chain(negative).collect(),
            fixed: std::array::from_fn(|k| self.fixed[k] - other.fixed[k]),
        }
    }
}

impl Place {
    /// Returns the value of the sum at positions x, three coordinates per node.
    fn at(&self, x: &[f64]) -> [f64; 3] {
        std::array::from_fn(|k| {
            let mut sum = self.fixed[k];
            for &(node, weight) in &self.nodes {
                sum += x[3 * node as usize + k] * weight;
            }
            sum
        })
    }

    /// Returns the sum of the norms of all summands at x, m. The position of a node counts with at least
    /// `size(node)`.
    fn magnitude(&self, x: &[f64], size: &dyn Fn(u32) -> f64) -> f64 {
        let norm = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let of_node = |&(node, weight): &(u32, f64)| {
            norm(&x[3 * node as usize..3 * node as usize + 3]).max(size(node)) * weight.abs()
        };
        norm(&self.fixed) + self.nodes.iter().map(of_node).sum::<f64>()
    }

    /// Returns a copy with nodes renumbered.
    fn renumbered(&self, number: &impl Fn(u32) -> u32) -> Self {
        Self { nodes: self.nodes.iter().map(|&(node, weight)| (number(node), weight)).collect(), ..*self }
    }

    /// Returns a copy with tied nodes replaced by the nodes that they are tied to; weights of equal nodes are added up.
    fn resolved(&self, coordinates: &Coordinates) -> Self {
        let mut nodes: Vec<(u32, f64)> = Vec::new();
        let mut add = |node: u32, weight: f64| match nodes.iter_mut().find(|term| term.0 == node) {
            Some(term) => term.1 += weight,
            None => nodes.push((node, weight)),
        };
        for &(node, weight) in &self.nodes {
            match coordinates.combination(node) {
                Some(terms) => terms.iter().for_each(|&(k, share)| add(k, weight * share)),
                None => add(node, weight),
            }
        }
        nodes.retain(|term| term.1 != 0.0);
        Self { nodes, ..*self }
    }
}

/// One constraint g(x) = a(x)·b(x) − value = 0.
///
/// The two factors are stored separately. A difference of points far from the origin then has the absolute accuracy
/// of the points; products of the points themselves would lose twice as many digits.
#[derive(Debug, Clone, PartialEq)]
pub struct QuadraticConstraint {
    name: String,
    a: Place,
    b: Place,
    value: f64,
}

impl QuadraticConstraint {
    /// Returns the constraint a·b = value. `name` appears in messages.
    pub fn product(name: impl Into<String>, a: &Place, b: &Place, value: f64) -> Self {
        Self { name: name.into(), a: a.clone(), b: b.clone(), value }
    }

    /// Returns a = b as three constraints, one per axis.
    pub fn coincidence(name: &str, a: &Place, b: &Place) -> [Self; 3] {
        let gap = a.minus(b);
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
            .map(|axis| Self::product(name, &gap, &Place::fixed(axis), 0.0))
    }

    /// Returns |a − b| = length, in the form |a − b|²/2 = length²/2.
    pub fn distance(name: &str, a: &Place, b: &Place, length: f64) -> Self {
        let gap = a.minus(b);
        let half = Place {
            nodes: gap.nodes.iter().map(|&(node, weight)| (node, 0.5 * weight)).collect(),
            fixed: gap.fixed.map(|x| 0.5 * x),
        };
        Self::product(name, &gap, &half, 0.5 * length * length)
    }

    /// Returns the six constraints of three directors, d_i·d_j = δ_ij.
    pub fn orthonormal(name: &str, directors: [u32; 3]) -> [Self; 6] {
        [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].map(|(i, j): (usize, usize)| {
            let (a, b) = (Place::node(directors[i]), Place::node(directors[j]));
            Self::product(name, &a, &b, f64::from(u8::from(i == j)))
        })
    }

    /// Returns the name of the constraint, for messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the nodes in the sums of both factors, with repetitions.
    pub fn nodes(&self) -> impl Iterator<Item = u32> + '_ {
        self.a.nodes.iter().chain(&self.b.nodes).map(|term| term.0)
    }

    /// Returns the constraint with its nodes renumbered.
    #[must_use]
    pub fn renumbered(&self, number: impl Fn(u32) -> u32) -> Self {
        let (a, b) = (self.a.renumbered(&number), self.b.renumbered(&number));
        Self { name: self.name.clone(), a, b, value: self.value }
    }

    /// Returns g at positions x, three coordinates per node.
    pub fn value(&self, x: &[f64]) -> f64 {
        let (a, b) = (self.a.at(x), self.b.at(x));
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2] - self.value
    }

    /// Returns the factors a and b, and the required value of their product.
    pub(crate) fn factors(&self) -> (&Place, &Place, f64) {
        (&self.a, &self.b, self.value)
    }

    /// Returns the size of the summands of g at x; the position of node k counts with at least `size(k)`. The
    /// round-off in g is this size times the unit of round-off.
    pub fn magnitude(&self, x: &[f64], size: impl Fn(u32) -> f64) -> f64 {
        let norm = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let (a, b) = (norm(self.a.at(x)), norm(self.b.at(x)));
        self.value.abs() + a * self.b.magnitude(x, &size) + b * self.a.magnitude(x, &size)
    }

    /// Adds λ ∂g/∂x to `out`.
    pub fn add_gradient(&self, x: &[f64], lambda: f64, out: &mut [f64]) {
        for (factor, other) in [(&self.a, self.b.at(x)), (&self.b, self.a.at(x))] {
            for &(node, weight) in &factor.nodes {
                for k in 0..3 {
                    out[3 * node as usize + k] += lambda * weight * other[k];
                }
            }
        }
    }

    /// Returns the constraint with tied nodes replaced by their sums.
    pub(crate) fn resolved(self, coordinates: &Coordinates) -> Result<Self, CoreError> {
        let count = coordinates.dof_count() / 3;
        let missing = self.nodes().find(|&node| node as usize >= count);
        if let Some(node) = missing {
            let node = node as usize;
            return Err(CoreError::Stencil { term: self.name, stencil: 0, node, count });
        }
        let (a, b) = (self.a.resolved(coordinates), self.b.resolved(coordinates));
        let resolved = Self { a, b, ..self };
        let is_free = |node: u32| (0..3).any(|k| coordinates.free().binary_search(&(3 * node + k)).is_ok());
        if resolved.nodes().any(is_free) {
            Ok(resolved)
        } else {
            Err(CoreError::Constraint { constraint: resolved.name })
        }
    }
}
