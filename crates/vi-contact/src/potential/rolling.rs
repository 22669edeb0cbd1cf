//! Friction of round rigid bodies as a separate live term. Besides the nodes of a pair it reads frames, eight nodes
//! together, and it has no energy. Its candidates are those of the contact with a round body.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{
    Account, Acting, DiscreteGradient, EndForces, HessianKind, Live, Potential, Stencils, StepOutcome,
    StepSpan, Traits, Tube, packed_len,
};

use super::acting::{Sliding, pressing};
use super::book::Book;
use super::damping::EndBristle;
use super::lagged::LaggedFriction;
use super::{ContactPotential, ContactTerm};
use crate::distance::{Vec3, at};
use crate::friction::{Pressed, RollingPair, Step};
use crate::pairs::{Group, Partners, StepPair, add_square};

/// Number of nodes of a stencil, and size of its gradient.
const ARITY: usize = 8;
const SIZE: usize = 3 * ARITY;

/// The friction of balls and capsules.
pub struct RollingTerm(Arc<ContactTerm>);

impl RollingTerm {
    /// Returns the friction of the round bodies of a contact; `None` if there is none.
    pub fn new(contact: &Arc<ContactTerm>) -> Option<Self> {
        contact.surface().has_rolling().then(|| Self(Arc::clone(contact)))
    }
}

impl Live for RollingTerm {
    fn name(&self) -> &str {
        "friction of round bodies"
    }

    fn reach(&self) -> f64 {
        self.0.reach()
    }

    fn near(&self, x: &[f64], reach: f64) -> Arc<dyn Potential> {
        Arc::new(RollingPotential::of(self.0.about(x, reach).of_round_bodies()))
    }

    fn within(&self, tube: &Tube) -> Arc<dyn Potential> {
        Arc::new(RollingPotential::of(self.0.along(tube).of_round_bodies()))
    }

    fn lists_pairs(&self) -> bool {
        true
    }

    fn dissipates(&self) -> bool {
        true
    }

    fn is_finite_on_free_paths(&self) -> bool {
        true
    }
}

/// A stencil: a pair with possible friction, and its place in the lists of the contact.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    partners: Partners,
    cell: u32,
    /// Number among the pairs of edges, or of points and half-spaces.
    number: usize,
}

/// Returns the candidates of a contact: points with the cells near them, edges, half-spaces.
fn candidates(contact: &ContactPotential) -> Vec<Candidate> {
    let view = contact.contact();
    let mut all = Vec::new();
    for &point in contact.neighbours().near() {
        for (body, cells) in view.bodies_of(point as usize) {
            let partners = Partners::PointBody(point, body);
            all.extend(cells.iter().map(|&cell| Candidate { partners, cell, number: 0 }));
        }
    }
    let neighbours = contact.neighbours();
    for (number, &[a, b]) in neighbours.edge_pairs().iter().enumerate() {
        all.push(Candidate { partners: Partners::Edges(a, b), cell: 0, number });
    }
    for (number, &[point, plane]) in neighbours.plane_pairs().iter().enumerate() {
        all.push(Candidate { partners: Partners::PointPlane(point, plane), cell: 0, number });
    }
    all
}

/// The friction of round bodies near one configuration.
#[derive(Clone)]
struct RollingPotential {
    /// The contact of the round bodies.
    contact: ContactPotential,
    candidates: Arc<[Candidate]>,
    nodes: Arc<[u32]>,
    /// The step in which it acts; `None` before a step is opened.
    step: Option<Step>,
}

impl RollingPotential {
    fn of(contact: ContactPotential) -> Self {
        let candidates = candidates(&contact);
        let view = contact.contact();
        let nodes =
            candidates.iter().flat_map(|candidate| view.rolling_nodes(candidate.partners, candidate.cell));
        Self { nodes: nodes.collect(), candidates: candidates.into(), contact, step: None }
    }

    /// Adds the friction of pairs with equal partners over the open step.
    fn add_friction(&self, pairs: &[StepPair], x: [&[f64]; 2], step: &Step, out: &mut Acting) {
        let contact = self.contact.contact();
        let partners = pairs[0].partners;
        let pressed = Pressed { force: pressing(pairs), iterate: Some(out) };
        let rolling = contact.roll(partners, pressed, x, &step.anchors, &step.settings);
        let (Some(pair), Some(law)) = (rolling, contact.law_of(partners)) else { return };
        let nodes = contact.rolling_nodes(partners, pair.cell);
        let gradient = pair.spread.of(pair.held.traction);
        out.add_friction(
            pair.held.rubbing(partners),
            nodes.into_iter().zip(gradient.map(|vector| vector.into())),
        );
        let along = pair.tangents.map(|tangent| pair.spread.of(tangent));
        let axis_nodes = contact.axis_nodes(partners, pair.cell);
        let Some(change) = contact.rolling_change(&pair, x) else { return };
        let sliding = Sliding {
            nodes: &nodes,
            along: [&along[0], &along[1]],
            change_nodes: &[&nodes[..], &axis_nodes].concat(),
            change: [&change[0], &change[1]],
            stiffness: pair.held.stiffness,
            direction: pair.held.sliding,
            coefficient: law.friction,
        };
        sliding.add_tangents(pairs, out);
    }

    /// Calls `each` with the pairs that have friction between x₀ and x₁ in the stencils of `range`.
    fn for_each(&self, range: Range<usize>, x: [&[f64]; 2], mut each: impl FnMut(usize, &RollingPair)) {
        let Some(step) = &self.step else { return };
        let contact = self.contact.contact();
        let (mut group, mut normal, mut rubbing) = (Group::new(), Vec::new(), Vec::<RollingPair>::new());
        let of_normal = step.settings.places(x);
        let mut known = None;
        for stencil in range {
            let Candidate { partners, cell, number } = self.candidates[stencil];
            let of = |normal: &[StepPair], out: &mut Vec<RollingPair>| {
                out.clear();
                for pairs in normal.chunk_by(|a, b| a.partners == b.partners) {
                    let force: Vec3 = pairs.iter().map(StepPair::force).sum();
                    let (pressed, Step { settings, anchors }) = (Pressed::by(force.norm()), step);
                    out.extend(contact.roll(pairs[0].partners, pressed, x, anchors, settings));
                }
            };
            match partners {
                Partners::PointBody(point, _) => {
                    if known != Some(point) {
                        normal.clear();
                        contact.step_of_point(
                            point as usize,
                            of_normal,
                            &step.settings,
                            &mut group,
                            &mut normal,
                        );
                        of(&normal, &mut rubbing);
                        known = Some(point);
                    }
                }
                Partners::Edges(..) => {
                    of(contact.step_of_edges(number, of_normal, &step.settings).as_slice(), &mut rubbing);
                }
                Partners::PointPlane(..) => {
                    of(contact.step_of_plane(number, of_normal, &step.settings).as_slice(), &mut rubbing);
                }
            }
            let found = rubbing.iter().find(|pair| pair.partners == partners && pair.cell == cell);
            if let Some(pair) = found {
                each(stencil, pair);
            }
        }
    }
}

impl Potential for RollingPotential {
    fn name(&self) -> &str {
        "friction of round bodies"
    }

    fn account(&self) -> Account {
        Account::Contact
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: ARITY, block: 3, nodes: &self.nodes }
    }

    fn traits(&self) -> Traits {
        Traits { hessian: HessianKind::Zero, time_dependent: false }
    }

    fn energy(&self, _x: &[f64], _t: f64) -> Option<f64> {
        Some(0.0)
    }

    fn energies(&self, _range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
    }

    fn gradients(&self, _range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
    }

    fn hessians(&self, _range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
    }

    fn discrete_gradient(&self) -> Option<&dyn DiscreteGradient> {
        Some(self)
    }

    fn lagged_friction(
        &self,
        span: StepSpan,
        memory: &[f64],
        places: [&[f64]; 2],
        acting: &Acting,
    ) -> Option<Arc<dyn Potential>> {
        let contact = self.contact.contact();
        let friction = |step: &Step, partners: Partners, pressed: Pressed<'_>| {
            let pair = contact.roll(partners, pressed, places, &step.anchors, &step.settings)?;
            let along = pair.tangents.map(|tangent| pair.spread.of(tangent));
            Some((contact.rolling_nodes(pair.partners, pair.cell), along, pair.held.cone))
        };
        LaggedFriction::over_step(&self.contact, (span, memory), places[1], acting, friction)
    }

    fn narrowed(&self, tube: &Tube) -> Option<Arc<dyn Potential>> {
        Some(Arc::new(Self::of(self.contact.narrowed_to(tube))))
    }
}

impl DiscreteGradient for RollingPotential {
    fn gradients(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let first = range.start;
        self.for_each(range, [start, end], |stencil, pair| {
            let out = &mut out[(stencil - first) * SIZE..(stencil - first + 1) * SIZE];
            for (out, gradient) in out.chunks_exact_mut(3).zip(pair.spread.of(pair.held.traction)) {
                (0..3).for_each(|k| out[k] += gradient[k]);
            }
        });
    }

    fn tangents(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]) {
        const PACKED: usize = packed_len(SIZE);
        out.fill(0.0);
        let first = range.start;
        self.for_each(range, [start, end], |stencil, pair| {
            let out = &mut out[(stencil - first) * PACKED..(stencil - first + 1) * PACKED];
            for tangent in pair.tangents {
                add_square(pair.held.stiffness, &pair.spread.of(tangent), out);
            }
        });
    }

    fn acting(&self, start: &[f64], end: &[f64], out: &mut Acting) {
        if let Some(step) = &self.step {
            // The normal forces must include the damping of the step.
            let contact = ContactPotential { step: self.step.clone(), ..self.contact.clone() };
            let x = [start, end];
            contact.for_each_acting(x, out, |pairs, out| self.add_friction(pairs, x, step, out));
        }
    }

    fn over_step(&self, span: StepSpan, memory: &[f64]) -> Option<Arc<dyn DiscreteGradient>> {
        let step = Some(Step::new(span, memory, self.contact.surface())?);
        Some(Arc::new(Self { step, ..self.clone() }))
    }

    fn end_forces(&self, x: &[f64], _velocity: &[f64], out: &mut EndForces) {
        let (Some(step), contact) = (&self.step, self.contact.contact()) else { return };
        self.for_each(0..self.candidates.len(), [x, x], |stencil, pair| {
            let Some(law) = contact.law_of(pair.partners) else { return };
            let along = pair.tangents.map(|tangent| pair.spread.of(tangent));
            let bristle = EndBristle {
                partners: pair.partners,
                bodies: self.contact.surface().bodies_of(pair.partners),
                nodes: &self.nodes[ARITY * stencil..ARITY * (stencil + 1)],
                along: [&along[0], &along[1]],
                on_first: pair.tangents,
                stiffness: pair.held.stiffness,
                traction: pair.held.components,
                pressing: pair.pressing,
                slid: pair.slid,
            };
            out.friction.extend(bristle.friction(&step.settings, &law));
        });
    }

    fn outcome(&self, start: &[f64], end: &[f64]) -> StepOutcome {
        let surface = self.contact.surface();
        let mut book = Book::new(self.step.as_ref());
        self.for_each(0..self.candidates.len(), [start, end], |stencil, pair| {
            book.push_force(surface.bodies_of(pair.partners), -pair.held.traction);
            let nodes = &self.nodes[ARITY * stencil..ARITY * (stencil + 1)];
            for (&node, gradient) in nodes.iter().zip(pair.spread.of(pair.held.traction)) {
                book.push_work(gradient.dot(&(at(end, node) - at(start, node))));
            }
            book.push_anchor(pair.anchor);
        });
        let has_dampers = surface.has_damping();
        StepOutcome { has_dampers, ..book.close(surface, self.step.as_ref()) }
    }
}
