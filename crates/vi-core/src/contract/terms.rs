//! Lists of local terms over one set of coordinates: the input of an assembler.
//!
//! A list has a fixed part and a *live* part: terms whose stencils change while a body moves (contact, cutting,
//! adaptive terms). A potential is a value and never changes its stencils. A live term instead builds a new potential
//! when nodes have moved far enough.

use std::sync::Arc;

use crate::contract::coordinates::Coordinates;
use crate::contract::potential::{Potential, Stencils};
use crate::contract::shared::SharedTerms;
use crate::contract::tube::Tube;
use crate::error::CoreError;

/// A sum of local terms over one set of coordinates. A clone shares the terms.
#[derive(Clone)]
pub struct Terms {
    coordinates: Arc<Coordinates>,
    fixed: Vec<Arc<dyn Potential>>,
    live: Vec<Arc<dyn Live>>,
    /// The sums of the fixed terms, if several processes compute them together.
    shared: Option<Arc<dyn SharedTerms>>,
}

impl Terms {
    /// Returns the sum of these terms.
    ///
    /// # Errors
    /// Returns [`CoreError::Stencil`] if a stencil refers to a missing node, [`CoreError::Block`] if a term does not
    /// have three coordinates per node although some nodes have their own axes.
    pub fn new(coordinates: Arc<Coordinates>, fixed: Vec<Arc<dyn Potential>>) -> Result<Self, CoreError> {
        for term in &fixed {
            check_term(term.as_ref(), &coordinates)?;
        }
        Ok(Self { coordinates, fixed, live: Vec::new(), shared: None })
    }

    /// Returns an empty sum.
    pub(crate) fn of_nothing(coordinates: Arc<Coordinates>) -> Self {
        Self { coordinates, fixed: Vec::new(), live: Vec::new(), shared: None }
    }

    /// Returns a copy with these fixed terms added.
    ///
    /// # Errors
    /// Returns [`CoreError::Stencil`] if a stencil refers to a missing node.
    pub fn with_more(mut self, more: Vec<Arc<dyn Potential>>) -> Result<Self, CoreError> {
        for term in &more {
            check_term(term.as_ref(), &self.coordinates)?;
        }
        self.fixed.extend(more);
        // Other processes do not hold the added terms, so the sums are no longer shared.
        Ok(Self { shared: None, ..self })
    }

    /// Returns a copy with these live terms.
    #[must_use]
    pub fn with_live(self, live: Vec<Arc<dyn Live>>) -> Self {
        Self { live, ..self }
    }

    /// Returns a copy whose fixed terms several processes sum together.
    #[must_use]
    pub fn with_shared(self, shared: Arc<dyn SharedTerms>) -> Self {
        Self { shared: Some(shared), ..self }
    }

    /// Returns the sums of the fixed terms, if several processes compute them together.
    pub fn shared(&self) -> Option<&Arc<dyn SharedTerms>> {
        self.shared.as_ref()
    }

    /// Returns the map x(q, t).
    pub fn coordinates(&self) -> &Coordinates {
        &self.coordinates
    }

    /// Returns the map x(q, t), to be shared with other terms.
    pub fn shared_coordinates(&self) -> &Arc<Coordinates> {
        &self.coordinates
    }

    /// Returns the terms whose stencils never change.
    pub fn fixed(&self) -> &[Arc<dyn Potential>] {
        &self.fixed
    }

    /// Returns the terms whose stencils change.
    pub fn live(&self) -> &[Arc<dyn Live>] {
        &self.live
    }

    /// Returns a copy that may be evaluated at positions `x` (m, all coordinates) only, with less work ([`Potential::at`]); `None`
    /// if no fixed term provides it.
    pub fn at(&self, x: &[f64]) -> Option<Self> {
        let mut located: Option<Self> = None;
        for (number, term) in self.fixed.iter().enumerate() {
            if let Some(term) = term.at(x) {
                located.get_or_insert_with(|| self.clone()).fixed[number] = term;
            }
        }
        located
    }

    /// Returns whether all live terms are [finite on free paths](Live::is_finite_on_free_paths).
    pub fn is_live_part_finite_on_free_paths(&self) -> bool {
        self.live.iter().all(|term| term.is_finite_on_free_paths())
    }

    /// Returns a copy for positions near `x` (m, all coordinates), in which potentials replace the live terms.
    ///
    /// # Errors
    /// Returns [`CoreError::Stencil`] if a live term refers to a missing node.
    pub fn near(&self, x: &[f64]) -> Result<Self, CoreError> {
        let live = self.live.iter().map(|term| term.near(x, term.reach()));
        Self::new(Arc::clone(&self.coordinates), self.fixed.iter().cloned().chain(live).collect())
    }
}

impl AsRef<Terms> for Terms {
    fn as_ref(&self) -> &Terms {
        self
    }
}

/// A term whose stencils change while a body moves.
///
/// It is a function V(x) like any other potential. Only the stencils that evaluate it change, so energy is conserved
/// when they do.
pub trait Live: Send + Sync {
    /// Returns the name for reports and errors, e.g. `contact`.
    fn name(&self) -> &str;

    /// Returns the distance, m, that nodes may move before [`Live::near`] is called again. A larger distance means
    /// fewer calls and more stencils.
    fn reach(&self) -> f64;

    /// Returns a potential that equals this term at every configuration in which no node is farther than `reach` (m)
    /// from its position in `x`. `x` holds all coordinates, m.
    ///
    /// Equal arguments must give the same stencils in the same order, on any number of threads.
    fn near(&self, x: &[f64], reach: f64) -> Arc<dyn Potential>;

    /// Returns a potential that equals this term at every configuration in a tube, with the same guarantee.
    fn within(&self, tube: &Tube) -> Arc<dyn Potential> {
        self.near(&tube.middle(), tube.largest_reach())
    }

    /// Returns whether the discrete gradients of this term list the forces of their pairs
    /// ([`DiscreteGradient::acting`](crate::DiscreteGradient::acting)).
    fn lists_pairs(&self) -> bool {
        false
    }

    /// Returns whether this term has forces without a potential, such as friction.
    fn dissipates(&self) -> bool {
        false
    }

    /// Returns whether its energy is finite at the end of every path on which nothing meets
    /// ([`Potential::meetings`]). The end of such a path need not be evaluated to know this.
    fn is_finite_on_free_paths(&self) -> bool {
        false
    }
}

/// Checks that a term fits these coordinates.
fn check_term(term: &dyn Potential, coordinates: &Coordinates) -> Result<(), CoreError> {
    let stencils = term.stencils();
    if stencils.block != 3 && !coordinates.node_axes().is_empty() {
        return Err(CoreError::Block { term: term.name().to_owned(), block: stencils.block });
    }
    check_stencils(term.name(), stencils, coordinates.dof_count())
}

/// Checks that the stencils of a term refer only to nodes within `count` coordinates.
pub(crate) fn check_stencils(term: &str, stencils: Stencils<'_>, count: usize) -> Result<(), CoreError> {
    for (k, &node) in stencils.nodes.iter().enumerate() {
        if (node as usize + 1) * stencils.block > count {
            return Err(CoreError::Stencil {
                term: term.to_owned(),
                stencil: k / stencils.arity,
                node: node as usize,
                count: count / stencils.block,
            });
        }
    }
    Ok(())
}
