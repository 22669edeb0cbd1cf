//! Friction of round rigid bodies: balls and capsules, which are points and edges with a radius.
//!
//! Their skeleton does not rotate, but their surface does. In the middle of a step a pair touches at one point z on
//! the axis between the closest points. It lies on the surface of a round body that meets another rigid one (in the
//! middle of the gap if both are round), or at the node or triangle of a deformable body. Each side carries z by
//! fixed weights. For a rigid body with frame (c, d₁, d₂, d₃) they follow from
//! ```text
//! z = c(x_m) + Σ_k y_k d_k(x_m),   x_m = (x₀ + x₁)/2,
//! ```
//! A deformable body carries it by the weights of its closest point. Let w_a be the weights of the first side, and
//! those of the second with the opposite sign. The slip is the part of Σ_a w_a Δx_a normal to the axis, and a
//! traction T exerts −w_a T on node a. As Σ_a w_a x_a(x_m) = z − z = 0, the forces do the work −T·u exactly, without
//! resultant or moment, and act at the point of contact. A step of pure rolling has no slip: by Cayley's map Δd_k = ω
//! × d_k(x_m), so that u = Δc + ω × (z − c). Between equilibria, the force acts at the point of contact in the second one instead, along
//! tangents there, and on directors as [`Spread`] says.

mod change;
mod spread;

use nalgebra::Matrix3;

pub(crate) use spread::Spread;

use super::{Anchor, Anchors, BristleStep, Bristles, Pressed, resolution};
use crate::distance::{Closest, Shape, Vec3, at};
use crate::pairs::{Contact, Partners, StepSettings};

/// A reference direction is kept while the sine of its angle to the normal is above this.
const ACROSS: f64 = 0.3;

/// Friction of one pair over a step, if a side is a round rigid body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RollingPair {
    pub(crate) partners: Partners,
    /// The cell on which the point is measured; zero if there is none.
    pub(crate) cell: u32,
    /// The contact in the middle of the step, which determines the slip.
    middle: Touching,
    /// How the nodes of [`Contact::rolling_nodes`] carry the point of contact.
    pub(crate) spread: Spread,
    /// Slip u of the first side over the second, m.
    #[cfg_attr(not(test), expect(dead_code, reason = "tests compare it with the work"))]
    pub(crate) slip: Vec3,
    /// Orthonormal directions of T, normal to the axis.
    pub(crate) tangents: [Vec3; 2],
    pub(crate) held: BristleStep,
    /// Force that presses the two parts together, N.
    pub(crate) pressing: f64,
    /// Whether the pair slid in the step before.
    pub(crate) slid: bool,
    /// The anchor after the step.
    pub(crate) anchor: Anchor,
}

/// The axis of a pair at one configuration.
#[derive(Debug, Clone, Copy)]
struct Axis {
    /// Unit normal from the second side to the first.
    normal: Vec3,
    /// Closest points of both skeletons, m.
    places: [Vec3; 2],
    /// Weights of these points for the nodes of the pair.
    weights: [f64; 4],
}

/// The axis of a pair at one configuration, with the weights of the point of contact and the tangents there.
#[derive(Debug, Clone, Copy)]
struct Touching {
    axis: Axis,
    weights: [f64; 8],
    tangents: [Vec3; 2],
}

/// The point z where a pair touches: a closest point of one side, or `offset` n before it.
struct Touch {
    /// 0 if it is measured from the closest point of the first side, 1 if it is that of the second.
    side: usize,
    /// Distance from that point, m, and its change with the distance of both points.
    offset: f64,
    share: f64,
}

impl Touch {
    fn place(&self, axis: &Axis) -> Vec3 {
        axis.places[self.side] - axis.normal * self.offset
    }
}

impl Contact<'_> {
    /// Returns the four nodes that carry each side of a pair, repeated if there are fewer.
    pub(crate) fn rolling_nodes(&self, partners: Partners, cell: u32) -> [u32; 8] {
        let surface = self.surface;
        let (nodes, bodies) = (self.axis_nodes(partners, cell), surface.bodies_of(partners));
        let first = partners.first_count();
        let own = match first {
            1 => [[nodes[0]; 4], [nodes[1], nodes[2], nodes[3], nodes[3]]],
            _ => [[nodes[0], nodes[1], nodes[1], nodes[1]], [nodes[2], nodes[3], nodes[3], nodes[3]]],
        };
        let side = |k: usize| surface.frames[bodies[k] as usize].unwrap_or(own[k]);
        let ([a, b, c, d], [e, f, g, h]) = (side(0), side(1));
        [a, b, c, d, e, f, g, h]
    }

    /// Returns the nodes of a pair, which determine its axis, the last one repeated.
    pub(crate) fn axis_nodes(&self, partners: Partners, cell: u32) -> [u32; 4] {
        let surface = self.surface;
        match partners {
            Partners::PointBody(point, _) => {
                let [a, b, c] = surface.cells[cell as usize].nodes;
                [surface.points[point as usize].node, a, b, c]
            }
            Partners::PointPlane(point, plane) => {
                let face = surface.half_spaces[plane as usize].node;
                [surface.points[point as usize].node, face, face, face]
            }
            Partners::Edges(a, b) => self.edge_nodes([a, b]),
        }
    }

    fn axis(&self, partners: Partners, cell: u32, x: &impl Fn(u32) -> Vec3) -> Option<Axis> {
        let nodes = self.axis_nodes(partners, cell);
        let positions = nodes.map(x);
        let closest = match partners {
            Partners::PointPlane(_, plane) => {
                let face = &self.surface.half_spaces[plane as usize];
                let normal = face.normal_at(&face.nodes_with(nodes[0]).map(x));
                let height = normal.dot(&(positions[0] - positions[1]));
                let weights = [1.0, -1.0, 0.0, 0.0];
                Closest { squared: height * height, vector: normal * height, weights }
            }
            Partners::PointBody(..) => self.surface.cells[cell as usize].shape().closest(&positions),
            Partners::Edges(..) => Shape::EdgeEdge.closest(&positions),
        };
        if matches!(partners, Partners::Edges(..)) && closest.support() != 0b1111 {
            // If an end is nearest, it is a point with its own friction.
            return None;
        }
        let distance = closest.distance();
        if distance == 0.0 {
            return None;
        }
        let first = partners.first_count();
        let own: Vec3 = (0..first).map(|a| positions[a] * closest.weights[a]).sum();
        Some(Axis {
            normal: closest.vector / distance,
            places: [own, own - closest.vector],
            weights: closest.weights,
        })
    }

    /// Returns directions that move with the second side: its directors, or the edge that bristles follow, the direction
    /// across it, and the normal of its cell.
    fn directions(&self, partners: Partners, cell: u32, x: &impl Fn(u32) -> Vec3) -> [Vec3; 3] {
        let [_, second] = self.surface.bodies_of(partners);
        if let Some([_, directors @ ..]) = self.surface.frames[second as usize] {
            return directors.map(x);
        }
        let nodes = self.axis_nodes(partners, cell);
        let first = partners.first_count();
        let (a, b) = (x(nodes[first]), x(nodes[first + 1]));
        if first == 2 {
            return [b - a, Vec3::zeros(), Vec3::zeros()];
        }
        let normal = (b - a).cross(&(x(nodes[3]) - a));
        let followed = match partners {
            Partners::PointBody(..) => self.surface.cells[cell as usize].followed,
            _ => [0, 1],
        };
        let [from, to] = followed.map(|place| x(nodes[first + place as usize]));
        let along = to - from;
        [along, normal.cross(&along), normal]
    }

    /// Returns the friction over a step from x₀ to x₁ of one pair that is pressed together.
    pub(crate) fn roll(
        &self,
        partners: Partners,
        pressed: Pressed,
        x: [&[f64]; 2],
        anchors: &Anchors,
        settings: &StepSettings,
    ) -> Option<RollingPair> {
        let law = self.law_of(partners)?;
        let before = anchors.of(partners);
        let cell = match partners {
            Partners::PointBody(point, body) => {
                self.nearest_cell(point, body, x, before.map(|anchor| anchor.cell / 3), settings)?
            }
            _ => 0,
        };
        let start = |node: u32| at(x[0], node);
        let middle = |node: u32| (at(x[0], node) + at(x[1], node)) * 0.5;
        let first = self.axis(partners, cell, &start)?.normal;
        // Choose the direction that the tangents follow at x₀, so that it does not change while a solver varies x₁.
        let across =
            |number: usize, cell: u32| across(self.directions(partners, cell, &start)[number], first);
        // Several directions may be equally good, up to round-off, so the largest sine would be a choice by chance.
        let is_across = |number: &usize| across(*number, cell).norm() > ACROSS;
        let kept = before.map(|anchor| (anchor.cell % 3) as usize);
        let number = kept.filter(is_across).or_else(|| (0..3).find(is_across)).unwrap_or(0);
        let middle = self.touching(partners, cell, number, &middle)?;
        let frame = 3 * cell + number as u32;
        let stretch = match before {
            Some(anchor) if anchor.cell == frame => anchor.stretch,
            Some(anchor) => {
                let direction = |frame: u32| self.directions(partners, frame / 3, &start)[frame as usize % 3];
                carry(anchor.stretch, [direction(anchor.cell), direction(frame)], first)
            }
            None => [0.0; 2],
        };
        let nodes = self.rolling_nodes(partners, cell);
        let moved = nodes.iter().zip(&middle.weights);
        let slip: Vec3 = moved.map(|(&node, &weight)| (at(x[1], node) - at(x[0], node)) * weight).sum();
        let normal = middle.axis.normal;
        let slip = slip - normal * normal.dot(&slip);
        let (acting, spread, slip) = if settings.is_equilibrium() {
            let place = |node: u32| at(x[1], node);
            let end = self.touching(partners, cell, number, &place)?;
            let [first, second] = middle.tangents.map(|tangent| tangent.dot(&slip));
            let slip = end.tangents[0] * first + end.tangents[1] * second;
            let directors = self
                .surface
                .frames_of(partners)
                .map(|frame| frame.map(|[_, directors @ ..]| directors.map(place)));
            (end, Spread::of_turning_bodies(end.weights, directors)?, slip)
        } else {
            (middle, Spread::of_material_points(middle.weights), slip)
        };
        let Touching { weights, tangents, .. } = acting;
        let stiffness = self.surface.bristle_stiffness(partners)?;
        let stored = before.map_or(0.0, |anchor| anchor.energy(stiffness));
        let bristles = Bristles {
            partners,
            stretch,
            stored,
            stiffness,
            coefficient: law.friction,
            response: settings.response(law.damping),
            resolution: resolution(&nodes, x[1]),
            nodes: &nodes,
            weights: &weights,
        };
        let held = BristleStep::new(&bristles, slip, &tangents, pressed);
        let anchor = Anchor { partners, cell: frame, stretch: held.end, slides: held.sliding.is_some() };
        let slid = before.is_some_and(|anchor| anchor.slides);
        Some(RollingPair {
            partners,
            cell,
            middle,
            spread,
            slip,
            tangents,
            held,
            pressing: pressed.force,
            slid,
            anchor,
        })
    }

    /// Returns the contact of a pair at one configuration. Its tangents follow the direction with this number.
    fn touching(
        &self,
        partners: Partners,
        cell: u32,
        direction: usize,
        x: &impl Fn(u32) -> Vec3,
    ) -> Option<Touching> {
        let axis = self.axis(partners, cell, x)?;
        let tangents = tangents(self.directions(partners, cell, x)[direction], axis.normal)?;
        Some(Touching { axis, weights: self.weights(partners, cell, &axis, x)?, tangents })
    }

    fn touch(&self, partners: Partners, axis: &Axis) -> Touch {
        let bodies = self.surface.bodies_of(partners);
        let radii = bodies.map(|body| self.surface.laws.bodies[body as usize].radius);
        let [first, second] = axis.places;
        match self.surface.frames_of(partners) {
            [Some(_), Some(_)] => {
                let gap = axis.normal.dot(&(first - second)) - radii[0] - radii[1];
                let share = match radii.map(|radius| radius > 0.0) {
                    [true, true] => 0.5,
                    [true, false] => 0.0,
                    [false, _] => 1.0,
                };
                Touch { side: 0, offset: radii[0] + share * gap, share }
            }
            [Some(_), None] => Touch { side: 1, offset: 0.0, share: 0.0 },
            [None, _] => Touch { side: 0, offset: 0.0, share: 0.0 },
        }
    }

    /// Returns the weights of the point of contact on both sides, those of the second with the opposite sign.
    fn weights(
        &self,
        partners: Partners,
        cell: u32,
        axis: &Axis,
        x: &impl Fn(u32) -> Vec3,
    ) -> Option<[f64; 8]> {
        let surface = self.surface;
        let frames = surface.frames_of(partners);
        let place = self.touch(partners, axis).place(axis);
        let count = partners.first_count();
        let arity = self.arity(partners, cell);
        let mut weights = [0.0; 8];
        for (k, frame) in frames.into_iter().enumerate() {
            let sign = if k == 0 { 1.0 } else { -1.0 };
            let out = &mut weights[4 * k..4 * k + 4];
            match frame {
                Some([c, directors @ ..]) => {
                    let directors = Matrix3::from_columns(&directors.map(x));
                    let y = directors.try_inverse()? * (place - x(c));
                    out.copy_from_slice(&[sign, sign * y.x, sign * y.y, sign * y.z]);
                }
                None if k == 0 => out[..count].copy_from_slice(&axis.weights[..count]),
                None => out[..arity - count].copy_from_slice(&axis.weights[count..arity]),
            }
        }
        Some(weights)
    }

    fn arity(&self, partners: Partners, cell: u32) -> usize {
        match partners {
            Partners::PointBody(..) => self.surface.cells[cell as usize].shape().arity(),
            Partners::PointPlane(..) => 2,
            Partners::Edges(..) => 4,
        }
    }
}

/// Returns the part of a direction normal to a unit normal, per length of the direction.
fn across(direction: Vec3, normal: Vec3) -> Vec3 {
    let length = direction.norm();
    if length == 0.0 { Vec3::zeros() } else { (direction - normal * normal.dot(&direction)) / length }
}

/// Returns orthonormal directions normal to a unit normal, the first one as near to `direction` as possible.
fn tangents(direction: Vec3, normal: Vec3) -> Option<[Vec3; 2]> {
    let first = across(direction, normal).try_normalize(1e-6)?;
    Some([first, normal.cross(&first)])
}

/// Converts a stretch along the tangents of the first direction to those of the second, with the same length.
fn carry(stretch: [f64; 2], directions: [Vec3; 2], normal: Vec3) -> [f64; 2] {
    let [Some(from), Some(to)] = directions.map(|direction| tangents(direction, normal)) else {
        return [0.0; 2];
    };
    let vector = from[0] * stretch[0] + from[1] * stretch[1];
    to.map(|tangent| tangent.dot(&vector))
}

#[cfg(test)]
mod tests;
