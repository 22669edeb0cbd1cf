//! The pairs that act at one configuration, with their stencils. The stencils of a point share the search for its closest features,
//! and a ball is a point that can have thousands of them: so the pairs are found once, not once for every batch of stencils.

use std::ops::Range;
use std::sync::Arc;

use vi_core::{Account, DiscreteGradient, Fault, Meeting, Potential, Stencils, Traits, Tube, packed_len};

use super::{ContactPotential, PACKED, SIZE, add_packed};
use crate::pairs::{ActivePair, Group, in_order};

/// A pair that acts.
#[derive(Debug, Clone)]
struct Listed {
    stencil: usize,
    /// The places of the nodes of the pair in the stencil.
    places: [usize; 4],
    pair: ActivePair,
}

impl ContactPotential {
    /// Returns the pairs of the stencils in `range` that act at x, in the order of the stencils.
    fn listed(&self, range: &Range<usize>, x: &[f64]) -> Vec<Listed> {
        let contact = self.contact();
        let (cells, edges) = (self.neighbours.cells.len(), self.neighbours.edges.len());
        let points: Vec<usize> = self.points_from(range).collect();
        let space = || (Group::new(), Vec::new());
        let mut listed = in_order(points.len(), space, |k, (group, pairs), out: &mut Vec<Listed>| {
            pairs.clear();
            contact.active_at_point(points[k], x, group, pairs);
            out.extend(pairs.iter().map(|&pair| {
                let stencil = self.candidate(points[k], pair.cell);
                Listed { stencil, places: self.places(stencil, &pair.nodes), pair }
            }));
        });
        listed.retain(|listed| range.contains(&listed.stencil));
        // The stencils of a point follow those of the points before it.
        listed.sort_by_key(|listed| listed.stencil);
        let others = range.start.max(cells)..range.end.max(cells);
        listed.extend(in_order(
            others.len(),
            || (),
            |k, (), out| {
                let stencil = others.start + k;
                let pair = match (stencil - cells).checked_sub(edges) {
                    None => contact.active_edges(stencil - cells, x),
                    Some(plane) => contact.active_plane(plane, x),
                };
                out.extend(pair.map(|pair| Listed { stencil, places: [0, 1, 2, 3], pair }));
            },
        ));
        listed
    }

    /// Writes the energies at x of the stencils in `range`.
    pub(super) fn write_energies(&self, range: &Range<usize>, x: &[f64], out: &mut [f64]) {
        write_energies(&self.listed(range, x), range.start, out);
    }

    /// Writes the gradients at x of the stencils in `range`.
    pub(super) fn write_gradients(&self, range: &Range<usize>, x: &[f64], out: &mut [f64]) {
        write_gradients(&self.listed(range, x), range.start, x, out);
    }

    /// Writes the packed Hessians at x of the stencils in `range`.
    pub(super) fn write_hessians(&self, range: &Range<usize>, x: &[f64], out: &mut [f64]) {
        write_hessians(&self.listed(range, x), range.start, x, out);
    }

    /// Returns the gap (m) of a pair of a stencil whose energy at x is not finite; `None` if all are.
    pub(super) fn closed_gap(&self, stencil: usize, x: &[f64]) -> Option<f64> {
        let listed = self.listed(&(stencil..stencil + 1), x);
        Some(listed.iter().rfind(|listed| !listed.pair.energy.is_finite())?.pair.gap)
    }

    /// Returns the contact energy at x.
    pub(super) fn located(&self, x: &[f64]) -> Arc<dyn Potential> {
        Arc::new(Located::new(self.clone(), x))
    }
}

/// Writes the energies of the stencils from `first` on.
fn write_energies(listed: &[Listed], first: usize, out: &mut [f64]) {
    out.fill(0.0);
    listed.iter().for_each(|Listed { stencil, pair, .. }| out[stencil - first] += pair.energy);
}

/// Writes the gradients at x of the stencils from `first` on.
fn write_gradients(listed: &[Listed], first: usize, x: &[f64], out: &mut [f64]) {
    out.fill(0.0);
    for Listed { stencil, places, pair } in listed {
        let out = &mut out[(stencil - first) * SIZE..(stencil - first + 1) * SIZE];
        for (place, gradient) in places.iter().zip(pair.gradient(x)).take(pair.shape.arity()) {
            (0..3).for_each(|k| out[3 * place + k] += gradient[k]);
        }
    }
}

/// Writes the packed Hessians at x of the stencils from `first` on.
fn write_hessians(listed: &[Listed], first: usize, x: &[f64], out: &mut [f64]) {
    out.fill(0.0);
    for Listed { stencil, places, pair } in listed {
        let size = 3 * pair.shape.arity();
        let mut block = [0.0; PACKED];
        pair.hessian(x, &mut block[..packed_len(size)]);
        let out = &mut out[(stencil - first) * PACKED..(stencil - first + 1) * PACKED];
        add_packed(&block, size, *places, out);
    }
}

/// The contact energy at one configuration.
struct Located {
    contact: ContactPotential,
    listed: Vec<Listed>,
}

impl Located {
    fn new(contact: ContactPotential, x: &[f64]) -> Self {
        let listed = contact.listed(&(0..contact.neighbours.count()), x);
        Self { contact, listed }
    }

    fn of(&self, range: &Range<usize>) -> &[Listed] {
        let before = |stencil: usize| self.listed.partition_point(|listed| listed.stencil < stencil);
        &self.listed[before(range.start)..before(range.end)]
    }
}

impl Potential for Located {
    fn name(&self) -> &str {
        self.contact.name()
    }

    fn account(&self) -> Account {
        self.contact.account()
    }

    fn stencils(&self) -> Stencils<'_> {
        self.contact.stencils()
    }

    fn stencil_count(&self) -> usize {
        self.contact.stencil_count()
    }

    fn traits(&self) -> Traits {
        self.contact.traits()
    }

    fn energies(&self, range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        write_energies(self.of(&range), range.start, out);
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        write_gradients(self.of(&range), range.start, x, out);
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        write_hessians(self.of(&range), range.start, x, out);
    }

    fn discrete_gradient(&self) -> Option<&dyn DiscreteGradient> {
        self.contact.discrete_gradient()
    }

    fn limits_steps(&self) -> bool {
        self.contact.limits_steps()
    }

    fn largest_step(&self, x: &[f64], dx: &[f64]) -> f64 {
        self.contact.largest_step(x, dx)
    }

    fn meetings(&self, x: &[f64], end: &[f64], kept: f64) -> Vec<Meeting> {
        self.contact.meetings(x, end, kept)
    }

    fn narrowed(&self, tube: &Tube) -> Option<Arc<dyn Potential>> {
        self.contact.narrowed(tube)
    }

    fn fault(&self, stencil: usize, x: &[f64], t: f64) -> Option<Fault> {
        self.contact.fault(stencil, x, t)
    }
}
