//! The extent of the surfaces of a component: how far bodies can fall or fly before they meet others.
//!
//! Each body counts as the ball about its centre that contains it. So the extent follows the scene when that is shifted,
//! turned or given in other units, and it does not depend on how finely surfaces are divided. Directors, which are unit
//! vectors, are no places and do not count.

use nalgebra::Vector3;

use super::{BodyModel, RigidModel};
use crate::scene::RigidShape;

/// A ball that contains a body.
struct Ball {
    centre: Vector3<f64>,
    radius: f64,
}

impl Ball {
    /// Returns the ball about `centre` that contains balls of this radius (m) at all `points`.
    fn about(centre: Vector3<f64>, points: impl Iterator<Item = Vector3<f64>>, radius: f64) -> Self {
        let farthest = points.map(|point| (point - centre).norm()).fold(0.0, f64::max);
        Self { centre, radius: radius + farthest }
    }
}

/// Returns the extent of the surfaces of component number `component` at positions `x` of its nodes, m: the largest distance
/// between points of the balls that contain the bodies, or of such a point from the face of a half-space.
pub(super) fn extent(component: usize, bodies: &[BodyModel], rigids: &[RigidModel], x: &[f64]) -> f64 {
    let place = |node: usize| Vector3::from_column_slice(&x[3 * node..3 * node + 3]);
    let of_body = |body: &BodyModel| {
        let count = body.mesh.points.len();
        let places = || (0..count).map(|node| place(body.node(node)));
        Ball::about(places().sum::<Vector3<f64>>() / count.max(1) as f64, places(), 0.0)
    };
    let of_rigid = |rigid: &RigidModel| {
        Ball::about(rigid.pose(x).position.into(), rigid.surface_nodes().map(place), rigid.radius)
    };
    let (mut balls, mut faces) = (Vec::new(), Vec::new());
    balls.extend(bodies.iter().filter(|body| body.component == component).map(of_body));
    for rigid in rigids.iter().filter(|rigid| rigid.component == component) {
        match rigid.shape {
            Some(RigidShape::Plane { normal }) => {
                let normal = Vector3::from(rigid.directions_at_start(x, normal)).normalize();
                faces.push((place(rigid.node), normal));
            }
            Some(_) => balls.push(of_rigid(rigid)),
            None => {}
        }
    }
    let mut extent = 0.0_f64;
    for (number, ball) in balls.iter().enumerate() {
        let others = balls[number..].iter().map(|other| (other.centre - ball.centre).norm() + other.radius);
        let heights = faces.iter().map(|(origin, normal)| normal.dot(&(ball.centre - origin)));
        extent = others.chain(heights).fold(extent, |extent, length| extent.max(length + ball.radius));
    }
    extent
}
