//! The velocity with which the two parts of a pair slide over each other.

use nalgebra::Matrix3;

use super::ContactPotential;
use crate::distance::{Vec3, at};
use crate::pairs::ActivePair;

impl ContactPotential {
    /// Returns the tangential velocity (m/s) of the first part of an acting pair relative to the second, with the node
    /// velocities v (m/s) at positions x.
    ///
    /// A round body contributes its velocity at the point where friction acts, so that rolling is not sliding: at the
    /// other surface if that is deformable, in the middle of the gap between two round bodies, and on its own surface
    /// otherwise.
    pub fn sliding(&self, pair: &ActivePair, x: &[f64], v: &[f64]) -> [f64; 3] {
        let (distance, count) = (pair.closest.distance(), pair.partners.first_count());
        let normal = pair.closest.vector / distance;
        let bodies = self.surface.bodies_of(pair.partners);
        let parts = [0..count, count..pair.shape.arity()];
        // The weights of each part sum to one, with opposite signs.
        let mean = |values: &[f64], part: usize| -> Vec3 {
            let sign = if part == 0 { 1.0 } else { -1.0 };
            let nodes = parts[part].clone();
            nodes.map(|k| at(values, pair.nodes[k]) * (sign * pair.closest.weights[k])).sum()
        };
        let arm = |own: u32, other: u32| {
            let [own_radius, other_radius] = [own, other].map(|body| self.surface.radius(body));
            match self.surface.frames[other as usize] {
                None => distance,
                Some(_) if self.surface.is_round(other) => 0.5 * (distance + own_radius - other_radius),
                Some(_) => own_radius,
            }
        };
        let velocity = |part: usize| {
            let (own, other) = (bodies[part], bodies[1 - part]);
            let frame = self.surface.frames[own as usize].filter(|_| self.surface.is_round(own));
            let Some([origin, a, b, c]) = frame else { return mean(v, part) };
            let directors = |values: &[f64]| Matrix3::from_columns(&[a, b, c].map(|node| at(values, node)));
            let towards_other = if part == 0 { -normal } else { normal };
            let place = mean(x, part) + towards_other * arm(own, other);
            let local = directors(x).lu().solve(&(place - at(x, origin))).unwrap_or_default();
            at(v, origin) + directors(v) * local
        };
        let relative = velocity(0) - velocity(1);
        (relative - normal * normal.dot(&relative)).into()
    }
}
