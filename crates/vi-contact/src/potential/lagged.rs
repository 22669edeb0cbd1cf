//! Lagged friction: a potential of the end of a step, whose minimum is near the step with friction.
//!
//! The friction of a step depends on pressure, and so it has no potential. With the normal forces λ and the covectors of slip of one
//! configuration x̂ it has one: a sum over pairs of convex functions of the traction y = ŷ + k gᵀ(x − x̂) that a bristle has that
//! sticks,
//! ```text
//! ψ = |y|²/(2k) if |y| ≤ μλ,   otherwise μλ (|y| − μλ/2)/k,
//! ```
//! with ∂ψ/∂x = g T, where T is y shortened to μλ. At x̂ this is the friction of the step itself (M. Li et al., ACM Trans. Graph. 39
//! (2020) 49, §5, there with a mollified law instead of bristles).

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Account, Acting, HessianKind, Potential, Stencils, StepSpan, Traits, packed_len};

use super::ContactPotential;
use super::acting::pressing;
use crate::distance::{Vec3, at};
use crate::friction::{Cone, Pressed, Step};
use crate::pairs::{Partners, add_square};

/// The friction of a pair of N nodes.
#[derive(Debug, Clone)]
struct Lagged<const N: usize> {
    /// x̂ of the nodes, m.
    origin: [Vec3; N],
    /// Covectors g of slip along both tangents; zero for the repeated nodes of pairs with fewer nodes.
    along: [[Vec3; N]; 2],
    /// The law of the traction, whose trial is ŷ.
    cone: Cone,
}

/// The friction of pairs of N nodes each, with the normal forces and directions of one configuration.
#[derive(Debug, Clone)]
pub(super) struct LaggedFriction<const N: usize> {
    nodes: Vec<u32>,
    pairs: Vec<Lagged<N>>,
}

impl<const N: usize> Lagged<N> {
    /// Returns y, and the part of it that does not exceed the limit.
    fn trial(&self, nodes: &[u32], x: &[f64]) -> ([f64; 2], f64) {
        let Cone { trial, stiffness, limit } = self.cone;
        let moved = |covectors: &[Vec3; N]| -> f64 {
            (0..N).map(|a| covectors[a].dot(&(at(x, nodes[a]) - self.origin[a]))).sum()
        };
        let y = [0, 1].map(|k: usize| trial[k] + stiffness * moved(&self.along[k]));
        let size = y[0].hypot(y[1]);
        (y, if size <= limit { 1.0 } else { limit / size })
    }
}

impl<const N: usize> LaggedFriction<N> {
    /// Returns the friction over a step between two places, as a potential of the second one, of all pairs of a contact that press on each
    /// other there. `friction` returns the nodes of a pair, the covectors of its slip and its law. Returns `None` if no pair has friction, or
    /// if the forces of the step do not act at its end.
    pub(super) fn over_step(
        contact: &ContactPotential,
        (span, memory): (StepSpan, &[f64]),
        end: &[f64],
        acting: &Acting,
        friction: impl Fn(&Step, Partners, Pressed<'_>) -> Option<([u32; N], [[Vec3; N]; 2], Cone)>,
    ) -> Option<Arc<dyn Potential>> {
        let step = Step::new(span, memory, contact.surface()).filter(|step| step.settings.acts_at_end)?;
        let mut lagged = Self { nodes: Vec::new(), pairs: Vec::new() };
        let pairs = contact.contact().step(end, end, &step.settings);
        for pairs in pairs.chunk_by(|a, b| a.partners == b.partners) {
            let pressed = Pressed { force: pressing(pairs), iterate: Some(acting) };
            if let Some((nodes, along, cone)) = friction(&step, pairs[0].partners, pressed) {
                lagged.push(nodes, along, cone, end);
            }
        }
        (!lagged.pairs.is_empty()).then(|| Arc::new(lagged) as Arc<dyn Potential>)
    }

    /// Adds a pair of `nodes`, the last of which is repeated, with the covectors of its slip at x̂.
    fn push(&mut self, nodes: [u32; N], along: [[Vec3; N]; 2], cone: Cone, x: &[f64]) {
        if cone.limit > 0.0 {
            self.nodes.extend(nodes);
            self.pairs.push(Lagged { origin: nodes.map(|node| at(x, node)), along, cone });
        }
    }

    fn of(&self, pair: usize) -> (&[u32], &Lagged<N>) {
        (&self.nodes[N * pair..N * (pair + 1)], &self.pairs[pair])
    }
}

impl ContactPotential {
    /// See [`Potential::lagged_friction`](vi_core::Potential::lagged_friction).
    pub(super) fn lagged_at(
        &self,
        step: (StepSpan, &[f64]),
        places: [&[f64]; 2],
        acting: &Acting,
    ) -> Option<Arc<dyn Potential>> {
        let contact = self.contact();
        let friction = |Step { settings, anchors }: &Step, partners: Partners, pressed: Pressed<'_>| {
            let pair = contact.rub(partners, pressed, places, anchors, settings)?;
            let nodes = [0, 1, 2, 3].map(|a: usize| pair.nodes[a.min(pair.arity - 1)]);
            Some((nodes, pair.along, pair.cone))
        };
        LaggedFriction::over_step(self, step, places[1], acting, friction)
    }
}

impl<const N: usize> Potential for LaggedFriction<N> {
    fn name(&self) -> &str {
        "lagged friction"
    }

    fn account(&self) -> Account {
        Account::Contact
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: N, block: 3, nodes: &self.nodes }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Varying, time_dependent: false }
    }

    fn energies(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (pair, out) in range.zip(out) {
            let (nodes, lagged) = self.of(pair);
            let (y, part) = lagged.trial(nodes, x);
            let size = y[0].hypot(y[1]);
            *out = part * size * (size - 0.5 * part * size) / lagged.cone.stiffness;
        }
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (pair, out) in range.zip(out.chunks_exact_mut(3 * N)) {
            let (nodes, lagged) = self.of(pair);
            let (y, part) = lagged.trial(nodes, x);
            let [first, second] = lagged.along;
            for (a, out) in out.chunks_exact_mut(3).enumerate() {
                let gradient = (first[a] * y[0] + second[a] * y[1]) * part;
                out.copy_from_slice(gradient.as_slice());
            }
        }
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        for (pair, out) in range.zip(out.chunks_exact_mut(packed_len(3 * N))) {
            let (nodes, lagged) = self.of(pair);
            let (y, part) = lagged.trial(nodes, x);
            let [first, second] = lagged.along;
            let stiffness = part * lagged.cone.stiffness;
            // A bristle that slides resists across its direction only.
            let directions: [[f64; 2]; 2] = match part < 1.0 {
                false => [[1.0, 0.0], [0.0, 1.0]],
                true => {
                    let size = y[0].hypot(y[1]);
                    [[-y[1] / size, y[0] / size], [0.0; 2]]
                }
            };
            out.fill(0.0);
            for [a, b] in directions {
                let covector: [Vec3; N] = std::array::from_fn(|node| first[node] * a + second[node] * b);
                add_square(stiffness, &covector, out);
            }
        }
    }
}
