//! The part of contact damping that acts on velocities at the end of a step ([`AT_END`](crate::AT_END)).
//!
//! A layer of stiffness k = C'' and damping time τ resists the rate of its gap with the force −a τ k ḋ, where a is the share of
//! damping that acts here. It does not pull: a pair that opens is held back by at most the part a of its force C', at the rate before the
//! dampers act, which reduce rates; damping over the step takes at most the rest. A bristle that stuck over the step resists the rate of its slip in the same way, up to what Coulomb's cone
//! leaves. If it slid, it is not damped: a force that depends on the pressure at one instant would add to its friction.

use vi_core::Damper;

use super::ContactPotential;
use super::step::Force;
use crate::distance::Vec3;
use crate::friction::FrictionPair;
use crate::pairs::{StepPair, StepSettings};

/// The dampers of a bristle along two tangents.
pub(super) struct TangentialDampers<'a> {
    pub(super) bodies: [u32; 2],
    pub(super) nodes: &'a [u32],
    /// Covectors of the rate of slip along both tangents.
    pub(super) along: [&'a [Vec3]; 2],
    /// Sums of these covectors over the nodes of the first part.
    pub(super) on_first: [Vec3; 2],
    /// Coefficient of both dampers, N s/m, unless `reserve` bounds it.
    pub(super) coefficient: f64,
    /// The force by which the traction is below Coulomb's limit μN, N.
    pub(super) reserve: f64,
}

impl TangentialDampers<'_> {
    pub(super) fn add(&self, velocity: &[f64], out: &mut Vec<Damper>) {
        let mut both =
            [0, 1].map(|k: usize| damper(self.bodies, self.nodes, self.along[k], self.on_first[k]));
        let rate = both[0].rate(velocity).hypot(both[1].rate(velocity));
        let coefficient = bounded(self.coefficient, self.reserve, rate);
        if coefficient > 0.0 {
            both.iter_mut().for_each(|damper| damper.coefficient = coefficient);
            out.extend(both);
        }
    }
}

impl ContactPotential {
    /// Appends the dampers of the pairs at x with these velocities.
    pub(super) fn add_dampers(&self, x: &[f64], velocity: &[f64], out: &mut Vec<Damper>) {
        let Some(step) = self.step.as_ref().filter(|step| step.settings.damping_at_end > 0.0) else { return };
        self.for_each_step(0..self.neighbours.count(), [x, x], |_, acting, _| match acting {
            Force::Normal(pair) => self.add_normal_damper(pair, &step.settings, velocity, out),
            Force::Friction(pair) if pair.slid => {}
            Force::Friction(pair) => self.add_tangential_dampers(pair, &step.settings, velocity, out),
        });
    }

    fn add_normal_damper(
        &self,
        pair: &StepPair,
        settings: &StepSettings,
        velocity: &[f64],
        out: &mut Vec<Damper>,
    ) {
        let bodies = self.surface.bodies_of(pair.partners);
        let Some(law) = self.surface.law(bodies[0], bodies[1]) else { return };
        let coefficient = settings.coefficient_at_end(pair.stiffness_of_ends(), law.damping);
        if coefficient <= 0.0 {
            return;
        }
        let along = &pair.distance[1][..pair.arity];
        let on_first = along[..pair.partners.first_count()].iter().sum();
        let mut damper = damper(bodies, &pair.nodes, along, on_first);
        damper.coefficient =
            bounded(coefficient, -settings.damping_at_end * pair.slope, damper.rate(velocity));
        if damper.coefficient > 0.0 {
            out.push(damper);
        }
    }

    fn add_tangential_dampers(
        &self,
        pair: &FrictionPair,
        settings: &StepSettings,
        velocity: &[f64],
        out: &mut Vec<Damper>,
    ) {
        let bodies = self.surface.bodies_of(pair.partners);
        let Some(law) = self.surface.law(bodies[0], bodies[1]) else { return };
        let count = pair.partners.first_count();
        let dampers = TangentialDampers {
            bodies,
            nodes: &pair.nodes[..pair.arity],
            along: [0, 1].map(|k: usize| &pair.along[k][..pair.arity]),
            on_first: pair.along.map(|along| along[..count].iter().sum()),
            coefficient: settings.coefficient_at_end(pair.stiffness, law.damping),
            reserve: pair.coefficient * pair.normal_force - pair.traction.norm(),
        };
        dampers.add(velocity, out);
    }
}

/// Returns a coefficient with which a damper resists a rate (m/s) with at most the force `limit` (N).
fn bounded(coefficient: f64, limit: f64, rate: f64) -> f64 {
    if coefficient * rate <= limit { coefficient } else { limit.max(0.0) / rate }
}

/// Returns a damper without coefficient, with its parts in ascending order.
fn damper(bodies: [u32; 2], nodes: &[u32], along: &[Vec3], on_first: Vec3) -> Damper {
    let [first, second] = bodies;
    let is_ordered = first <= second;
    let covector = nodes.iter().zip(along).map(|(&node, &b)| (node, b.into()));
    Damper {
        coefficient: 0.0,
        covector: covector.collect(),
        between: if is_ordered { bodies } else { [second, first] },
        on_first: if is_ordered { on_first.into() } else { (-on_first).into() },
    }
}
