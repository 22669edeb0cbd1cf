//! The forces over a step, pair by pair, with complete tangents. Those of normal forces are dQ/dd₁ N ⊗ ∂d₁/∂x₁. Those of
//! friction, which depends on pressure, are products that are not symmetric.

use vi_core::Acting;

use super::ContactPotential;
use crate::distance::Vec3;
use crate::friction::{FrictionPair, Pressed, Step};
use crate::pairs::{Contact, Group, StepPair, in_order};
use crate::surface::Gauge;

/// The fraction of the stiffness of bristles below which the layer is stiffer than it is: see
/// [`ContactPotential::for_each_acting`]. With a stiffer layer from the start, steps that fail only by the kink of friction take
/// more iterations.
const SOFT: f64 = 1e-2;

/// Returns the nodes, each with its vector times `factor`.
fn covector<'a>(
    nodes: &'a [u32],
    vectors: &'a [Vec3],
    factor: f64,
) -> impl Iterator<Item = (u32, [f64; 3])> + 'a {
    nodes.iter().zip(vectors).map(move |(&node, vector)| (node, (vector * factor).into()))
}

/// Returns the force that presses a group of pairs together, N.
pub(super) fn pressing(pairs: &[StepPair]) -> f64 {
    pairs.iter().map(StepPair::force).sum::<Vec3>().norm()
}

/// The data of the tangents of a friction force.
pub(super) struct Sliding<'a> {
    pub(super) nodes: &'a [u32],
    /// Covectors g¹ and g² with Σ_a gᵏ_a·Δx_a = t_k·u.
    pub(super) along: [&'a [Vec3]; 2],
    /// Derivatives of t_k·u with respect to x₁, and the nodes to which they belong.
    pub(super) change_nodes: &'a [u32],
    pub(super) change: [&'a [Vec3]; 2],
    /// Stiffness k of the traction, N/m.
    pub(super) stiffness: f64,
    /// Components of the direction of the traction along t₁ and t₂ if the pair slides; `None` if it sticks.
    pub(super) direction: Option<[f64; 2]>,
    /// Coefficient of friction μ.
    pub(super) coefficient: f64,
}

impl Sliding<'_> {
    /// Adds the tangents of friction under the normal force of `pairs`.
    pub(super) fn add_tangents(&self, pairs: &[StepPair], out: &mut Acting) {
        let Self { nodes, stiffness, change_nodes, .. } = *self;
        let combined = |[first, second]: [&[Vec3]; 2], a: f64, b: f64| -> Vec<Vec3> {
            first.iter().zip(second).map(|(first, second)| first * a + second * b).collect()
        };
        let Some([a, b]) = self.direction else {
            for (k, (along, change)) in self.along.into_iter().zip(self.change).enumerate() {
                let mut direction = [0.0; 2];
                direction[k] = stiffness;
                let right = covector(change_nodes, change, 1.0);
                out.add_friction_tangent(direction, covector(nodes, along, stiffness), right);
            }
            return;
        };
        // If a pair slides, its traction rotates with the slip and grows with the pressure.
        let [across, change] = [self.along, self.change].map(|vectors| combined(vectors, -b, a));
        let direction = [-stiffness * b, stiffness * a];
        out.add_friction_tangent(
            direction,
            covector(nodes, &across, stiffness),
            covector(change_nodes, &change, 1.0),
        );
        let traction = combined(self.along, a, b);
        let force: Vec3 = pairs.iter().map(StepPair::force).sum();
        let pressure = force.norm();
        if pressure == 0.0 {
            return;
        }
        for pair in pairs {
            pair.each_tangent(|along, change| {
                let on_first: Vec3 = along[..pair.partners.first_count()].iter().sum();
                let factor = -force.dot(&on_first) / pressure;
                out.add_friction_tangent(
                    [self.coefficient * a, self.coefficient * b],
                    covector(nodes, &traction, self.coefficient),
                    covector(&pair.nodes, change, factor),
                );
            });
        }
    }
}

impl ContactPotential {
    /// Adds the forces between x₀ and x₁ and their tangents.
    pub(super) fn add_acting(&self, x: [&[f64]; 2], out: &mut Acting) {
        self.for_each_acting(x, out, |pairs, out| {
            // Between equilibria, the normal force is that of the potential, which acts separately.
            if !self.settings().is_equilibrium() {
                self.add_normal(pairs, x, out);
            }
            self.add_friction(pairs, x, out);
        });
    }

    /// Calls `each` with each group of pairs of equal partners that act between x₀ and x₁. Appends the results in the
    /// order of the groups.
    ///
    /// While the bristles have less than the fraction [`SOFT`] of their stiffness, the layer is stiffer by the rest of the
    /// factor. Hard blows that bring many pairs very close at once are then found from gaps that are all wide, and become
    /// narrower together, as on the central path of interior-point methods.
    ///
    /// If forces act at the end of the step, the pairs are those that act at x₁. Between equilibria, they have the layer that they have.
    pub(super) fn for_each_acting(
        &self,
        x: [&[f64]; 2],
        out: &mut Acting,
        each: impl Fn(&[StepPair], &mut Acting) + Sync,
    ) {
        let settings = self.settings();
        let x = settings.places(x);
        let neighbours = self.neighbours.near_path(&self.surface, x, Gauge::reach);
        let contact = Contact { surface: &self.surface, neighbours: &neighbours };
        let near = neighbours.near();
        let empty = out.part();
        let layer = if settings.is_equilibrium() { 1.0 } else { (SOFT / out.stiffness).max(1.0) };
        let chunk = |pairs: &mut [StepPair], out: &mut Vec<Acting>| {
            if layer != 1.0 {
                pairs.iter_mut().for_each(|pair| pair.scale(layer));
            }
            if out.is_empty() {
                out.push(empty.part());
            }
            if let Some(acting) = out.last_mut() {
                pairs.chunk_by(|a, b| a.partners == b.partners).for_each(|pairs| each(pairs, acting));
            }
        };
        let space = || (Group::new(), Vec::new());
        let of_points = in_order(near.len(), space, |k, (group, pairs), out| {
            pairs.clear();
            contact.step_of_point(near[k] as usize, x, settings, group, pairs);
            if !pairs.is_empty() {
                chunk(pairs, out);
            }
        });
        let planes = neighbours.planes.len();
        let of_others = in_order(
            neighbours.edges.len() + planes,
            || (),
            |k, (), out| {
                let pair = match k.checked_sub(planes) {
                    Some(edges) => contact.step_of_edges(edges, x, settings),
                    None => contact.step_of_plane(k, x, settings),
                };
                if let Some(pair) = pair {
                    chunk(&mut [pair], out);
                }
            },
        );
        of_points.iter().chain(&of_others).for_each(|acting| out.append(acting));
    }

    fn add_normal(&self, pairs: &[StepPair], x: [&[f64]; 2], out: &mut Acting) {
        let places = self.settings().places(x);
        for pair in pairs.iter().filter(|pair| pair.energy != [0.0; 2]) {
            let nodes = &pair.nodes;
            out.add_gradient(covector(nodes, &pair.gradient, 1.0));
            pair.each_tangent(|along, change| {
                out.add_tangent(covector(nodes, along, 1.0), covector(nodes, change, 1.0));
            });
            if out.turns {
                pair.each_turn(places, |left, right| {
                    out.add_tangent(covector(nodes, left, 1.0), covector(nodes, right, 1.0));
                });
            }
        }
    }

    fn add_friction(&self, pairs: &[StepPair], x: [&[f64]; 2], out: &mut Acting) {
        let Some(Step { anchors, settings }) = &self.step else { return };
        let partners = pairs[0].partners;
        let pressed = Pressed { force: pressing(pairs), iterate: Some(out) };
        let friction = self.contact().rub(partners, pressed, x, anchors, settings);
        let Some(pair) = &friction else { return };
        let FrictionPair {
            nodes, gradient, along, change, stiffness, sliding, coefficient, traction, ..
        } = pair;
        if *traction != Vec3::zeros() || *stiffness != 0.0 {
            out.add_friction(pair.rubbing, covector(nodes, gradient, 1.0));
            let sliding = Sliding {
                nodes,
                along: [&along[0], &along[1]],
                change_nodes: nodes,
                change: [&change[0], &change[1]],
                stiffness: *stiffness,
                direction: *sliding,
                coefficient: *coefficient,
            };
            sliding.add_tangents(pairs, out);
        }
    }
}
