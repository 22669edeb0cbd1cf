//! Quadratic constraints as holonomic constraints on q, for systems with only free coordinates: x = q.

use crate::contract::constraint::{Place, QuadraticConstraint};
use crate::theory::constraints::constraint::Constraint;
use crate::theory::lagrange::lagrangian::Scalar;

impl Constraint for Vec<QuadraticConstraint> {
    fn count(&self) -> usize {
        self.len()
    }
    fn value<D: Scalar>(&self, q: &[D]) -> Vec<D> {
        let value = |constraint: &QuadraticConstraint| {
            let (a, b, value) = constraint.factors();
            let (a, b) = (place(a, q), place(b, q));
            a[0] * b[0] + a[1] * b[1] + a[2] * b[2] - value
        };
        self.iter().map(value).collect()
    }
}

/// Returns the coordinates of a place if the nodes are at positions x, three coordinates per node.
fn place<D: Scalar>(place: &Place, x: &[D]) -> [D; 3] {
    std::array::from_fn(|k| {
        let mut sum = D::from(place.fixed[k]);
        for &(node, weight) in &place.nodes {
            sum += x[3 * node as usize + k] * weight;
        }
        sum
    })
}
