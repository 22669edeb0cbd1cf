//! Friction by bristles between surfaces: slip stretches them, and Coulomb's cone limits their force.
//!
//! A point (or edge) that is pressed against a surface by the force λ of the current step is held by a spring of
//! stiffness k ∝ κ w/d̂, whose anchor moves with the surface. Over a step with slip u (`slip.rs`) its stretch changes
//! from e₀ to e₁. While it sticks the traction is T = k (e₀ + e₁)/2, so that T·u is exactly the change of ½ k |e|².
//! If |T| would exceed μ λ, it is reduced to μ λ and the rest of the work is dissipated (`bristle.rs`). No quantity
//! is lagged, and nothing creeps. The forces on the nodes do the work −T·u exactly and have neither a resultant nor a
//! moment. Between equilibria, they have none in the second one, and their work is exact where nothing turns or stretches.

mod anchors;
mod bristle;
mod cells;
mod rolling;
mod slip;

pub use anchors::{Anchor, Anchors};

use std::collections::BTreeMap;

pub(crate) use bristle::Cone;
use bristle::{Bristle, Linearised, Prediction, linearise, stretch};
pub(crate) use rolling::RollingPair;
use vi_core::{Acting, Rubbing, packed_len};

use crate::distance::{Vec3, at};
use crate::pairs::{Contact, Partners, StepPair, StepSettings, pack_rank_one};
use crate::surface::Law;

/// Relative error of a traction that counts as that of its law.
const LAWFUL: f64 = 1e-6;

/// Round-off of a slip relative to the coordinates of its nodes.
const RESOLUTION: f64 = 4.0 * f64::EPSILON;

/// A step with friction and damping.
#[derive(Debug, Clone)]
pub(crate) struct Step {
    pub(crate) settings: StepSettings,
    /// The bristles at the start of the step.
    pub(crate) anchors: Anchors,
}

/// Friction over a step, of one point against a body or half-space, or of two edges.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrictionPair {
    /// The parts of the sliding pair.
    pub partners: Partners,
    /// Number of nodes of the pair.
    pub arity: usize,
    /// Nodes of the pair.
    pub nodes: [u32; 4],
    /// G_a, N: the force on node a is −G_a, and Σ G·Δx = T·u; between equilibria, the derivative of T·u as for `change`.
    pub gradient: [Vec3; 4],
    /// Slip u of the first part over the second, m.
    pub slip: Vec3,
    /// Traction T on the second part, N.
    pub traction: Vec3,
    /// Force that presses the two parts together, N.
    pub normal_force: f64,
    /// Weights of the contact point, as in [`StepPair::weights`].
    pub weights: [f64; 4],
    /// k of ∂G/∂x₁ ≈ k c cᵀ ⊗ (t₁t₁ᵀ + t₂t₂ᵀ), N/m: half the stiffness of the bristle, less if it slides.
    pub stiffness: f64,
    /// Tangents t₁ and t₂ of the frame in which the slip is measured.
    pub tangents: [Vec3; 2],
    /// Covectors g¹ and g² with G = Σ_k (T·t_k) gᵏ.
    pub along: [[Vec3; 4]; 2],
    /// Derivatives of t_k·u with respect to the positions of the nodes at the end of the step, without terms of the order of u.
    pub change: [[Vec3; 4]; 2],
    /// Components of the direction of T along t₁ and t₂ if the pair slides; `None` if it sticks.
    pub sliding: Option<[f64; 2]>,
    /// The traction as a function of slip.
    pub(crate) cone: Cone,
    /// The traction and the state of friction of the pair, as Newton's method reads them.
    pub(crate) rubbing: Rubbing,
    /// Coefficient of friction μ.
    pub coefficient: f64,
    /// Dissipated energy, J: T·u minus the change of the stored energy; never negative.
    pub dissipated: f64,
    /// Energy stored at the end, J.
    pub stored: f64,
    /// Whether the pair slid in the step before.
    pub slid: bool,
    /// The anchor after the step.
    pub anchor: Anchor,
}

/// The normal force of a pair, and the iterate of Newton's method at which its friction is evaluated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pressed<'a> {
    /// Force that presses the two parts together, N.
    pub(crate) force: f64,
    /// The forces and predictions of an iterate on the way to a solution; `None` at a solution.
    pub(crate) iterate: Option<&'a Acting>,
}

impl Pressed<'_> {
    pub(crate) fn by(force: f64) -> Self {
        Self { force, iterate: None }
    }
}

/// The bristle of a pair at the start of a step, with its constants over the step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bristles<'a> {
    pub(crate) partners: Partners,
    /// Stretch along both tangents, m.
    pub(crate) stretch: [f64; 2],
    /// Stored energy, J.
    pub(crate) stored: f64,
    /// Stiffness k, N/m.
    pub(crate) stiffness: f64,
    /// Coefficient of friction μ.
    pub(crate) coefficient: f64,
    /// The factor r of the slip in the traction of a bristle that sticks; see [`StepSettings::response`].
    pub(crate) response: f64,
    /// Round-off of the slip, m.
    pub(crate) resolution: f64,
    /// The nodes that slip moves, with their weights in it.
    pub(crate) nodes: &'a [u32],
    pub(crate) weights: &'a [f64],
}

/// The bristle of a pair over a step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BristleStep {
    /// Traction T on the second part, N.
    pub(crate) traction: Vec3,
    /// Components of T along both tangents, N.
    pub(crate) components: [f64; 2],
    /// Half the stiffness of the bristle, less if it slides, N/m.
    pub(crate) stiffness: f64,
    /// The law of the traction as a function of slip, at the pressure of this evaluation.
    pub(crate) cone: Cone,
    /// Components of the direction of T along both tangents if the pair slides; `None` if it sticks.
    pub(crate) sliding: Option<[f64; 2]>,
    /// Whether T obeys the law of friction; an iterate may be far from it.
    pub(crate) is_lawful: bool,
    /// Dissipated energy, T·u minus the change of the stored energy, J; never negative.
    pub(crate) dissipated: f64,
    /// Energy stored at the end, J.
    pub(crate) stored: f64,
    /// Stretch at the end along both tangents, m.
    pub(crate) end: [f64; 2],
}

impl BristleStep {
    /// Returns the bristle after a slip.
    pub(crate) fn new(
        bristles: &Bristles<'_>,
        slip: Vec3,
        tangents: &[Vec3; 2],
        pressed: Pressed<'_>,
    ) -> Self {
        let Bristles { stretch: start, stored: before, stiffness: k, coefficient, .. } = *bristles;
        let response = bristles.response * pressed.iterate.map_or(1.0, |acting| acting.stiffness);
        let limit = coefficient * pressed.force;
        let along = tangents.map(|tangent| tangent.dot(&slip));
        let Bristle { end, traction, held } = stretch(start, along, k, response, limit);
        let size = |v: [f64; 2]| v[0].hypot(v[1]);
        let vector = |v: [f64; 2]| tangents[0] * v[0] + tangents[1] * v[1];
        let stored = 0.5 * k * (end[0].powi(2) + end[1].powi(2));
        let dissipated = (vector(traction).dot(&slip) - (stored - before)).max(0.0);
        let law = Self {
            traction: vector(traction),
            components: traction,
            stiffness: response * k * held,
            cone: Cone {
                trial: [0, 1].map(|a: usize| k * (start[a] + response * along[a])),
                stiffness: response * k,
                limit,
            },
            sliding: (held < 1.0).then(|| match size(traction) {
                0.0 => [0.0; 2],
                size => traction.map(|part| part / size),
            }),
            is_lawful: true,
            dissipated,
            stored,
            end,
        };
        let Some(acting) = pressed.iterate.filter(|acting| !acting.compliance.is_empty()) else { return law };
        if limit == 0.0 {
            return law;
        }
        let prediction = Prediction {
            traction: acting.traction_of(bristles.partners.number()),
            resistance: bristles.resistance(acting),
            penalty: acting.penalty,
        };
        let Linearised { traction, stiffness, sliding, cone } =
            linearise(start, along, k, response, limit, prediction);
        let error = size([traction[0] - law.components[0], traction[1] - law.components[1]]);
        let is_same = error <= LAWFUL * limit && sliding.is_some() == law.sliding.is_some();
        let is_lawful = is_same || error <= response * k * bristles.resolution;
        Self { traction: vector(traction), components: traction, stiffness, sliding, is_lawful, cone, ..law }
    }

    /// Returns what Newton's method knows of the friction of a pair.
    pub(crate) fn rubbing(&self, partners: Partners) -> Rubbing {
        let Self { components: traction, sliding, is_lawful, .. } = *self;
        Rubbing { pair: partners.number(), traction, sliding, is_lawful }
    }
}

/// Returns the round-off of a slip that moves these nodes, with all coordinates x, m.
pub(crate) fn resolution(nodes: &[u32], x: &[f64]) -> f64 {
    RESOLUTION * nodes.iter().map(|&node| at(x, node).amax()).fold(0.0, f64::max)
}

impl Bristles<'_> {
    /// Returns the force that moves both parts by a unit slip if only the inertia of their nodes resists, N/m.
    fn resistance(&self, acting: &Acting) -> f64 {
        let parts = self.nodes.iter().zip(self.weights);
        let moved: f64 =
            parts.map(|(&node, &weight)| weight * weight * acting.compliance[node as usize]).sum();
        moved.recip()
    }
}

impl FrictionPair {
    /// Adds G to `out`, three numbers per node.
    pub fn add_gradient(&self, out: &mut [f64]) {
        for (node, gradient) in self.nodes.iter().zip(&self.gradient).take(self.arity) {
            for k in 0..3 {
                out[3 * *node as usize + k] += gradient[k];
            }
        }
    }

    /// Returns the force on the first part of the pair, N.
    pub fn force(&self) -> Vec3 {
        -self.gradient[..self.partners.first_count()].iter().sum::<Vec3>()
    }

    /// Adds k c cᵀ ⊗ (t₁t₁ᵀ + t₂t₂ᵀ) to a packed lower triangle of 3·arity coordinates, N/m.
    pub(crate) fn add_packed_stiffness(&self, out: &mut [f64]) {
        let mut block = [0.0; packed_len(12)];
        for tangent in self.tangents {
            pack_rank_one(self.stiffness, &self.weights, tangent, 3 * self.arity, &mut block[..out.len()]);
            out.iter_mut().zip(&block).for_each(|(out, entry)| *out += entry);
        }
    }
}

impl Contact<'_> {
    /// Returns the friction over a step from x₀ to x₁ with the normal forces of `pairs`, in the order of partners.
    ///
    /// `anchors` is the memory at x₀ and does not change; [`Anchors::after`] returns the memory at x₁ once the step
    /// is accepted. The frame in which slip is measured is chosen at x₀, so it does not change while a solver varies
    /// x₁.
    pub fn friction(
        &self,
        x0: &[f64],
        x1: &[f64],
        pairs: &[StepPair],
        anchors: &Anchors,
        settings: &StepSettings,
    ) -> Vec<FrictionPair> {
        let mut pressed: BTreeMap<Partners, Vec3> = BTreeMap::new();
        for pair in pairs {
            *pressed.entry(pair.partners).or_insert_with(Vec3::zeros) += pair.force();
        }
        let rub = |(partners, force): (Partners, Vec3)| {
            self.rub(partners, Pressed::by(force.norm()), [x0, x1], anchors, settings)
        };
        pressed.into_iter().filter_map(rub).collect()
    }

    /// Returns the friction of the pairs of one point, or of one pair of edges, in their order. Pairs with equal
    /// partners are adjacent.
    pub(crate) fn friction_of_each(
        &self,
        pairs: &[StepPair],
        x: [&[f64]; 2],
        anchors: &Anchors,
        settings: &StepSettings,
    ) -> impl Iterator<Item = FrictionPair> {
        pairs.chunk_by(|a, b| a.partners == b.partners).filter_map(move |pairs| {
            let force: Vec3 = pairs.iter().map(StepPair::force).sum();
            self.rub(pairs[0].partners, Pressed::by(force.norm()), x, anchors, settings)
        })
    }

    pub(crate) fn rub(
        &self,
        partners: Partners,
        pressed: Pressed,
        x: [&[f64]; 2],
        anchors: &Anchors,
        settings: &StepSettings,
    ) -> Option<FrictionPair> {
        let law = self.law_of(partners)?;
        if self.surface.rolls(partners) {
            return None;
        }
        let before = anchors.of(partners);
        let (cell, slip) = self.slip_of(partners, x, before, settings)?;
        let stiffness = self.surface.bristle_stiffness(partners)?;
        let start = match before {
            Some(anchor) => (self.carry(anchor, cell, partners, x[0]), anchor.energy(stiffness)),
            None => ([0.0; 2], 0.0),
        };
        let bristles = Bristles {
            partners,
            stretch: start.0,
            stored: start.1,
            stiffness,
            coefficient: law.friction,
            response: settings.response(law.damping),
            resolution: resolution(&slip.nodes[..slip.arity], x[1]),
            nodes: &slip.nodes[..slip.arity],
            weights: &slip.weights,
        };
        let held = BristleStep::new(&bristles, slip.slip, &slip.tangents, pressed);
        Some(FrictionPair {
            partners,
            arity: slip.arity,
            nodes: slip.nodes,
            gradient: slip.gradient(held.traction),
            slip: slip.slip,
            traction: held.traction,
            normal_force: pressed.force,
            weights: slip.weights,
            stiffness: held.stiffness,
            tangents: slip.tangents,
            along: slip.tangents.map(|tangent| slip.gradient(tangent)),
            change: slip.tangents.map(|tangent| slip.change(tangent)),
            sliding: held.sliding,
            cone: held.cone,
            rubbing: held.rubbing(partners),
            coefficient: law.friction,
            dissipated: held.dissipated,
            stored: held.stored,
            slid: before.is_some_and(|anchor| anchor.slides),
            anchor: Anchor { partners, cell, stretch: held.end, slides: held.sliding.is_some() },
        })
    }

    /// Returns the law of both bodies if they have friction.
    pub(crate) fn law_of(&self, partners: Partners) -> Option<Law> {
        let [a, b] = self.surface.bodies_of(partners);
        self.surface.law(a, b).filter(|law| law.friction > 0.0)
    }
}
