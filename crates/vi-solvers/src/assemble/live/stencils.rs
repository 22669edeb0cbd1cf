//! Requests the stencils of live terms for the positions that are to be evaluated: anew when a node has left the reach of the
//! present ones, and with a shorter reach when the present one is much longer than a step needs.

use std::borrow::Cow;
use std::sync::Arc;

use vi_core::{Fault, Live, Potential, Terms, Tube};

use super::LiveSum;
use super::near::Near;
use super::state::{FAR, Region, distance};
use crate::assemble::fixed::FixedSum;
use crate::error::TermFault;

/// A matrix is not made of stencils whose reach is more than this multiple of the needed one.
const LONGEST_REACH: f64 = 2.0;

impl LiveSum {
    /// Requests the stencils of a region.
    pub(super) fn renew(&mut self, region: Region) {
        self.renewals += 1;
        self.tube = region.tube();
        match self.ask(&region, self.tube.as_ref()) {
            Ok(near) => (self.near, self.fault) = (Some(near), None),
            Err(fault) => (self.near, self.fault) = (None, Some(fault)),
        }
        self.state.region = region;
    }

    pub(super) fn ask(&self, region: &Region, tube: Option<&Tube>) -> Result<Near, TermFault> {
        let potential = |term: &Arc<dyn Live>| match tube {
            Some(tube) => term.within(tube),
            None => term.near(&region.about, region.reach.max(term.reach())),
        };
        let potentials: Vec<Arc<dyn Potential>> = self.terms.live().iter().map(potential).collect();
        for potential in &potentials {
            let stencils = potential.stencils();
            if self.block.is_some_and(|block| !stencils.block.is_multiple_of(block)) {
                let domain = "must be a multiple of that of the fixed terms";
                let value = stencils.block as f64;
                let quantity = "coordinates per node of a stencil";
                let fault = Fault { element: 0, quantity, value, domain, at_any_state: false };
                return Err(TermFault { term: potential.name().into(), fault });
            }
        }
        let assembler = |potentials: Vec<Arc<dyn Potential>>| {
            let terms = Terms::new(Arc::clone(self.terms.shared_coordinates()), potentials);
            let terms = terms.map_err(|error| match error {
                vi_core::CoreError::Stencil { term, stencil, node, .. } => {
                    let (quantity, domain) = ("node", "must be a node of the system");
                    let fault =
                        Fault { element: stencil, quantity, value: node as f64, domain, at_any_state: false };
                    TermFault { term: term.into(), fault }
                }
                other => {
                    let fault = Fault {
                        element: 0,
                        quantity: "term",
                        value: f64::NAN,
                        domain: "must have valid stencils",
                        at_any_state: false,
                    };
                    TermFault { term: other.to_string().into(), fault }
                }
            })?;
            Ok(FixedSum::new(terms, self.block))
        };
        let has_discrete = potentials.iter().any(|potential| potential.discrete_gradient().is_some());
        let numbered = potentials.iter().cloned().enumerate();
        let (discrete, plain): (Vec<_>, Vec<_>) =
            numbered.partition(|(_, potential)| potential.discrete_gradient().is_some());
        let parts = if self.splits && has_discrete {
            let plain = plain.into_iter().map(|(_, potential)| potential).collect();
            Some([assembler(plain)?, assembler(self.passage.paired(&discrete))?])
        } else {
            None
        };
        let over = self.passage.over_each(&discrete);
        Ok(Near { whole: assembler(potentials)?, parts, discrete, over, close: None })
    }

    /// Returns whether the stencils are valid at the places `x` of nodes.
    fn is_valid_at(&self, x: &[f64]) -> bool {
        match &self.tube {
            Some(tube) => tube.contains(x),
            None => self.state.region.is_near(x),
        }
    }

    /// Ensures that the stencils are valid at positions `x`, and at all `others` too. Positions that are not finite have no
    /// energy; the fixed terms report this to the caller.
    pub(super) fn follow<'a>(&mut self, x: &'a [f64], others: impl IntoIterator<Item = &'a [f64]>) {
        let coordinates = self.terms.coordinates();
        let x = coordinates.places(x);
        let others: Vec<Cow<'_, [f64]>> = others.into_iter().map(|x| coordinates.places(x)).collect();
        if self.is_valid_at(&x) && others.iter().all(|x| self.is_valid_at(x)) {
            return;
        }
        if let Some(region) =
            Region::around(coordinates, &x, others.iter().map(|x| &**x), self.shortest_reach())
        {
            self.renew(region);
        }
    }

    /// Ensures that the stencils are valid at positions `x` and `next` of one step. If they are not, requests them along the continued
    /// flight from x through `next`, so that they serve the steps that follow: the bar of `scenes/contact/bar-drop.toml` by
    /// `blanes-moan-4` in steps of .1 ms takes 1.4 instead of 3.2 s, with 66 searches in 1271 steps.
    pub(crate) fn follow_flight(&mut self, x: &[f64], next: &[f64]) {
        let [x, next] = [x, next].map(|x| self.terms.coordinates().places(x));
        let length = distance(&x, &next);
        if length == 0.0 || (self.is_valid_at(&x) && self.is_valid_at(&next)) {
            return self.follow(&x, Some(&*next));
        }
        let steps = (2.0 * FAR * self.shortest_reach() / length).max(1.0);
        let end: Vec<f64> = x.iter().zip(&*next).map(|(x, next)| x + steps * (next - x)).collect();
        self.follow(&x, Some(&end[..]));
    }

    /// Requests stencils with a shorter reach if a step from `start` to `end` needs much less than the present one: the
    /// matrix has an entry for every stencil.
    pub(super) fn tighten(&mut self, start: &[f64], end: &[f64]) {
        let coordinates = self.terms.coordinates();
        let [start, end] = [start, end].map(|x| coordinates.places(x));
        if let Some(needed) = Region::around(coordinates, &start, Some(&*end), self.shortest_reach())
            && self.near.is_some()
            && self.state.region.reach > LONGEST_REACH * needed.reach
        {
            self.renew(needed);
        }
    }

    /// Returns the shortest reach of the terms, m.
    pub(crate) fn shortest_reach(&self) -> f64 {
        shortest_reach(self.terms.live())
    }
}

/// Returns the shortest reach of live terms, m; infinite without terms.
pub(crate) fn shortest_reach(live: &[Arc<dyn Live>]) -> f64 {
    live.iter().map(|term| term.reach()).fold(f64::INFINITY, f64::min)
}
