//! The pairs that act at one configuration, with their stencils. The stencils of a point share the search for its closest features,
//! and a ball is a point that can have thousands of them: so the pairs are found once, not once for every batch of stencils.

use std::ops::Range;

use vi_core::{Account, Fault, Potential, Stencils, Traits, packed_len};

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

    /// Returns the contact energy of the stencils in `range`, for evaluations at x.
    pub(super) fn located(&self, range: &Range<usize>, x: &[f64]) -> impl Potential + use<> {
        Located { contact: self.clone(), listed: self.listed(range, x) }
    }
}

/// The contact energy of some stencils at one configuration.
struct Located {
    contact: ContactPotential,
    listed: Vec<Listed>,
}

impl Located {
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

    fn traits(&self) -> Traits {
        self.contact.traits()
    }

    fn energies(&self, range: Range<usize>, _x: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
        self.of(&range).iter().for_each(|listed| out[listed.stencil - range.start] += listed.pair.energy);
    }

    fn gradients(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
        for Listed { stencil, places, pair } in self.of(&range) {
            let first = (stencil - range.start) * SIZE;
            let out = &mut out[first..first + SIZE];
            for (place, gradient) in places.iter().zip(pair.gradient(x)).take(pair.shape.arity()) {
                (0..3).for_each(|k| out[3 * place + k] += gradient[k]);
            }
        }
    }

    fn hessians(&self, range: Range<usize>, x: &[f64], _t: f64, out: &mut [f64]) {
        out.fill(0.0);
        for Listed { stencil, places, pair } in self.of(&range) {
            let size = 3 * pair.shape.arity();
            let mut block = [0.0; PACKED];
            pair.hessian(x, &mut block[..packed_len(size)]);
            let first = (stencil - range.start) * PACKED;
            add_packed(&block, size, *places, &mut out[first..first + PACKED]);
        }
    }

    fn fault(&self, stencil: usize, _x: &[f64], _t: f64) -> Option<Fault> {
        let listed = self.of(&(stencil..stencil + 1));
        let value = listed.iter().rfind(|listed| !listed.pair.energy.is_finite())?.pair.gap;
        Some(Fault {
            element: stencil,
            quantity: "contact gap",
            value,
            domain: "must be positive",
            at_any_state: false,
        })
    }
}
