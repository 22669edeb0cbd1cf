//! Contact over a step, stencil by stencil: the discrete gradient of the contact energy, and with it friction and
//! damping. Friction remembers the stretch of its bristles from step to step.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Acting, DiscreteGradient, EndForces, StepOutcome, StepSpan, packed_len};

use super::book::Book;
use super::{ContactPotential, PACKED, SIZE, add_packed};
use crate::distance::{Vec3, at};
use crate::friction::{Anchors, FrictionPair, Step};
use crate::pairs::{Group, Partners, StepPair, StepSettings};
use crate::surface::Surface;

/// Settings without damping, which is a separate force.
const UNDAMPED: StepSettings = StepSettings::over(f64::INFINITY);

/// A force between x₀ and x₁: the normal force of a pair, or its friction.
pub(super) enum Force<'a> {
    Normal(&'a StepPair),
    Friction(&'a FrictionPair),
}

impl Force<'_> {
    fn nodes(&self) -> &[u32; 4] {
        match self {
            Self::Normal(pair) => &pair.nodes,
            Self::Friction(pair) => &pair.nodes,
        }
    }

    fn gradient(&self) -> &[Vec3] {
        match self {
            Self::Normal(pair) => &pair.gradient[..pair.arity],
            Self::Friction(pair) => &pair.gradient[..pair.arity],
        }
    }

    fn add_packed_stiffness(&self, out: &mut [f64]) {
        match self {
            Self::Normal(pair) => pair.packed_stiffness(out),
            Self::Friction(pair) => pair.add_packed_stiffness(out),
        }
    }

    /// Returns the force on the first part, N.
    fn force(&self) -> Vec3 {
        match self {
            Self::Normal(pair) => pair.force(),
            Self::Friction(pair) => pair.force(),
        }
    }

    fn partners(&self) -> Partners {
        match self {
            Self::Normal(pair) => pair.partners,
            Self::Friction(pair) => pair.partners,
        }
    }
}

impl Step {
    /// Returns a step that begins with the bristles in `memory`; `None` if they do not belong to the surface.
    pub(crate) fn new(span: StepSpan, memory: &[f64], surface: &Surface) -> Option<Self> {
        Some(Self { settings: StepSettings::of(span), anchors: Anchors::from_numbers(memory, surface)? })
    }
}

impl ContactPotential {
    /// Returns the settings of the step.
    pub(super) fn settings(&self) -> &StepSettings {
        self.step.as_ref().map_or(&UNDAMPED, |step| &step.settings)
    }

    /// Returns whether this is a force of the term over the step: between equilibria, normal forces come from the potential.
    fn is_own(&self, force: &Force<'_>) -> bool {
        matches!(force, Force::Friction(_)) || !self.settings().is_equilibrium()
    }

    /// Calls `each` with the forces of the stencils of `range` between x₀ and x₁, and the places of their nodes.
    pub(super) fn for_each_step(
        &self,
        range: Range<usize>,
        x: [&[f64]; 2],
        mut each: impl FnMut(usize, Force<'_>, [usize; 4]),
    ) {
        let contact = self.contact();
        let settings = self.settings();
        let friction = |pairs: &[StepPair], out: &mut Vec<FrictionPair>| {
            out.clear();
            if let Some(step) = &self.step {
                out.extend(contact.friction_of_each(pairs, x, &step.anchors, settings));
            }
        };
        let of_normal = settings.places(x);
        let cells = self.neighbours.cells.len();
        let (mut group, mut pairs, mut rubbing) = (Group::new(), Vec::new(), Vec::new());
        for point in self.points_from(&range) {
            pairs.clear();
            contact.step_of_point(point, of_normal, settings, &mut group, &mut pairs);
            friction(&pairs, &mut rubbing);
            let all = pairs.iter().map(Force::Normal).chain(rubbing.iter().map(Force::Friction));
            for acting in all {
                let cell = match &acting {
                    Force::Normal(pair) => pair.cell,
                    Force::Friction(pair) => pair.anchor.cell,
                };
                let stencil = self.candidate(point, cell);
                if range.contains(&stencil) {
                    let places = self.places(stencil, acting.nodes());
                    each(stencil, acting, places);
                }
            }
        }
        for stencil in range.start.max(cells)..range.end {
            let number = stencil - cells;
            let edges = self.neighbours.edges.len();
            let pair = if number < edges {
                contact.step_of_edges(number, of_normal, settings)
            } else {
                contact.step_of_plane(number - edges, of_normal, settings)
            };
            if let Some(pair) = pair {
                friction(std::slice::from_ref(&pair), &mut rubbing);
                each(stencil, Force::Normal(&pair), [0, 1, 2, 3]);
                rubbing.iter().for_each(|pair| each(stencil, Force::Friction(pair), [0, 1, 2, 3]));
            }
        }
    }
}

/// The work of the sum over the stencils of a point is exact, but that of a single stencil need not be. If several
/// stencils share a group, the features at both ends decide to which of them it is assigned.
impl DiscreteGradient for ContactPotential {
    fn gradients(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let first = range.start;
        self.for_each_step(range, [start, end], |stencil, acting, places| {
            if !self.is_own(&acting) {
                return;
            }
            let out = &mut out[(stencil - first) * SIZE..(stencil - first + 1) * SIZE];
            for (place, gradient) in places.into_iter().zip(acting.gradient()) {
                (0..3).for_each(|k| out[3 * place + k] += gradient[k]);
            }
        });
    }

    fn tangents(&self, range: Range<usize>, start: &[f64], end: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let first = range.start;
        self.for_each_step(range, [start, end], |stencil, acting, places| {
            if !self.is_own(&acting) {
                return;
            }
            let size = 3 * acting.gradient().len();
            let mut block = [0.0; PACKED];
            acting.add_packed_stiffness(&mut block[..packed_len(size)]);
            let out = &mut out[(stencil - first) * PACKED..(stencil - first + 1) * PACKED];
            add_packed(&block, size, places, out);
        });
    }

    fn acting(&self, start: &[f64], end: &[f64], out: &mut Acting) {
        self.add_acting([start, end], out);
    }

    fn over_step(&self, span: StepSpan, memory: &[f64]) -> Option<Arc<dyn DiscreteGradient>> {
        if span.duration.is_infinite() && !self.surface.has_friction() {
            return None;
        }
        let step = Some(Step::new(span, memory, &self.surface)?);
        Some(Arc::new(Self { step, ..self.clone() }))
    }

    fn end_forces(&self, x: &[f64], velocity: &[f64], out: &mut EndForces) {
        self.add_end_forces(x, velocity, out);
    }

    fn outcome(&self, start: &[f64], end: &[f64]) -> StepOutcome {
        let mut book = Book::new(self.step.as_ref());
        let (mut damping, mut smallest_gap, mut narrowest) = (0.0, None, None);
        self.for_each_step(0..self.neighbours.count(), [start, end], |_, acting, _| {
            book.push_force(self.surface.bodies_of(acting.partners()), acting.force());
            match acting {
                Force::Normal(pair) => {
                    damping += pair.dissipated;
                    if pair.energy != [0.0; 2] {
                        smallest_gap = Some(smallest_gap.map_or(pair.gap, |gap: f64| gap.min(pair.gap)));
                        let [start, end] = pair.relative;
                        let least = |[a, b]: [f64; 2]| [a.min(start), b.min(end)];
                        narrowest = Some(narrowest.map_or(pair.relative, least));
                    }
                }
                Force::Friction(pair) => {
                    for (&node, gradient) in pair.nodes.iter().zip(acting.gradient()) {
                        book.push_work(gradient.dot(&(at(end, node) - at(start, node))));
                    }
                    book.push_anchor(pair.anchor);
                }
            }
        });
        let has_dampers = self.surface.has_damping();
        StepOutcome {
            damping,
            smallest_gap,
            narrowest,
            has_dampers,
            ..book.close(&self.surface, self.step.as_ref())
        }
    }
}
