//! The part of contact damping that acts on velocities at the end of a step ([`AT_END`](crate::AT_END)), and its friction.
//!
//! A layer of stiffness k = C'' and damping time τ resists the rate of its gap with the force −a τ k ḋ, where a is the share of
//! damping that acts here. It does not pull: a pair that opens is held back by at most the part a of its force C', at the rate before the
//! dampers act, which reduce rates; damping over the step takes at most the rest. A bristle that stuck over the step resists the rate of its slip in the same way, up to what Coulomb's cone
//! leaves. If it slid, only the dampers that press its pair make friction here: the pressure of the layer has made its own over the step.

use vi_core::{Damper, DryFriction, EndForces};

use super::ContactPotential;
use super::step::Force;
use crate::distance::Vec3;
use crate::friction::FrictionPair;
use crate::pairs::{Partners, StepPair, StepSettings};
use crate::surface::Law;

/// The bristle of a pair at the end of a step.
pub(super) struct EndBristle<'a> {
    pub(super) partners: Partners,
    pub(super) bodies: [u32; 2],
    pub(super) nodes: &'a [u32],
    /// Covectors of the rate of slip along both tangents.
    pub(super) along: [&'a [Vec3]; 2],
    /// Sums of these covectors over the nodes of the first part.
    pub(super) on_first: [Vec3; 2],
    /// Tangent of the bristle over a step without motion, N/m.
    pub(super) stiffness: f64,
    /// Components of its traction along both tangents, N.
    pub(super) traction: [f64; 2],
    /// Force that presses the pair over the step, N.
    pub(super) pressing: f64,
    /// Whether the pair slid in the step.
    pub(super) slid: bool,
}

impl EndBristle<'_> {
    /// Returns the friction at the end of the step; `None` if nothing damps the pair.
    pub(super) fn friction(&self, settings: &StepSettings, law: &Law) -> Option<DryFriction> {
        let coefficient = settings.coefficient_at_end(self.stiffness, law.damping);
        let is_damped = settings.damping_at_end * law.damping > 0.0;
        let traction = self.traction[0].hypot(self.traction[1]);
        let (coefficient, reserve) = match self.slid {
            true => (f64::INFINITY, 0.0),
            false => (coefficient, law.friction * self.pressing - traction),
        };
        is_damped.then(|| DryFriction {
            along: [0, 1].map(|k: usize| {
                damper(self.partners, self.bodies, self.nodes, self.along[k], self.on_first[k])
            }),
            coefficient,
            reserve,
            friction: law.friction,
            pressing: self.pressing,
            direction: self.traction.map(|part| if traction > 0.0 { part / traction } else { 0.0 }),
        })
    }
}

impl ContactPotential {
    /// Appends the dampers and the friction of the pairs at x with these velocities.
    pub(super) fn add_end_forces(&self, x: &[f64], velocity: &[f64], out: &mut EndForces) {
        let Some(step) = self.step.as_ref().filter(|step| step.settings.damping_at_end > 0.0) else { return };
        self.for_each_step(0..self.neighbours.count(), [x, x], |_, acting, _| match acting {
            Force::Normal(pair) => out.dampers.extend(self.normal_damper(pair, &step.settings, velocity)),
            Force::Friction(pair) => out.friction.extend(self.end_friction(pair, &step.settings)),
        });
    }

    fn normal_damper(&self, pair: &StepPair, settings: &StepSettings, velocity: &[f64]) -> Option<Damper> {
        let bodies = self.surface.bodies_of(pair.partners);
        let law = self.surface.law(bodies[0], bodies[1])?;
        let coefficient = settings.damping_at_end * law.damping * pair.damped.curvature;
        if coefficient <= 0.0 {
            return None;
        }
        let along = &pair.distance[1][..pair.arity];
        let on_first = along[..pair.partners.first_count()].iter().sum();
        let mut damper = damper(pair.partners, bodies, &pair.nodes, along, on_first);
        let limit = settings.damping_at_end * pair.damped.push;
        let rate = damper.rate(velocity);
        damper.coefficient = if coefficient * rate <= limit { coefficient } else { limit.max(0.0) / rate };
        (damper.coefficient > 0.0).then_some(damper)
    }

    fn end_friction(&self, pair: &FrictionPair, settings: &StepSettings) -> Option<DryFriction> {
        let bodies = self.surface.bodies_of(pair.partners);
        let law = self.surface.law(bodies[0], bodies[1])?;
        let count = pair.partners.first_count();
        let bristle = EndBristle {
            partners: pair.partners,
            bodies,
            nodes: &pair.nodes[..pair.arity],
            along: [0, 1].map(|k: usize| &pair.along[k][..pair.arity]),
            on_first: pair.along.map(|along| along[..count].iter().sum()),
            stiffness: pair.stiffness,
            traction: pair.tangents.map(|tangent| tangent.dot(&pair.traction)),
            pressing: pair.normal_force,
            slid: pair.slid,
        };
        bristle.friction(settings, &law)
    }
}

/// Returns a damper without coefficient, with its parts in ascending order.
fn damper(partners: Partners, bodies: [u32; 2], nodes: &[u32], along: &[Vec3], on_first: Vec3) -> Damper {
    let [first, second] = bodies;
    let is_ordered = first <= second;
    let covector = nodes.iter().zip(along).map(|(&node, &b)| (node, b.into()));
    Damper {
        pair: partners.number(),
        coefficient: 0.0,
        covector: covector.collect(),
        between: if is_ordered { bodies } else { [second, first] },
        on_first: if is_ordered { on_first.into() } else { (-on_first).into() },
    }
}
