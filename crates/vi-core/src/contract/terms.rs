//! Lists of local terms over one set of coordinates: what an assembler sums.
//!
//! A list has a part that is fixed and a part that is *live*: terms whose stencils change while a body moves (contact,
//! cutting, adaptive terms). A potential is a value and never changes its stencils. A live term gives a new potential
//! instead when nodes have moved far enough.

use std::sync::Arc;

use crate::contract::coordinates::Coordinates;
use crate::contract::potential::{Potential, Stencils};
use crate::error::CoreError;

/// A sum of local terms over one set of coordinates. A clone shares the terms.
#[derive(Clone)]
pub struct Terms {
    coordinates: Arc<Coordinates>,
    fixed: Vec<Arc<dyn Potential>>,
    live: Vec<Arc<dyn Live>>,
}

impl Terms {
    /// The sum of these terms.
    ///
    /// # Errors
    /// [`CoreError::Stencil`] where a stencil names a missing node, [`CoreError::Block`] where a term does not
    /// count three coordinates per node and nodes have axes of their own.
    pub fn new(coordinates: Arc<Coordinates>, fixed: Vec<Arc<dyn Potential>>) -> Result<Self, CoreError> {
        for term in &fixed {
            check_term(term.as_ref(), &coordinates)?;
        }
        Ok(Self { coordinates, fixed, live: Vec::new() })
    }

    /// The sum of no terms.
    pub(crate) fn of_nothing(coordinates: Arc<Coordinates>) -> Self {
        Self { coordinates, fixed: Vec::new(), live: Vec::new() }
    }

    /// Returns a copy with these fixed terms added.
    ///
    /// # Errors
    /// [`CoreError::Stencil`] where a stencil names a missing node.
    pub fn with_more(mut self, more: Vec<Arc<dyn Potential>>) -> Result<Self, CoreError> {
        for term in &more {
            check_term(term.as_ref(), &self.coordinates)?;
        }
        self.fixed.extend(more);
        Ok(self)
    }

    /// Returns a copy with these live terms.
    #[must_use]
    pub fn with_live(self, live: Vec<Arc<dyn Live>>) -> Self {
        Self { live, ..self }
    }

    /// The map x(q, t).
    pub fn coordinates(&self) -> &Coordinates {
        &self.coordinates
    }

    /// The map x(q, t), to be shared with other terms.
    pub fn shared_coordinates(&self) -> &Arc<Coordinates> {
        &self.coordinates
    }

    /// The terms whose stencils never change.
    pub fn fixed(&self) -> &[Arc<dyn Potential>] {
        &self.fixed
    }

    /// The terms whose stencils change.
    pub fn live(&self) -> &[Arc<dyn Live>] {
        &self.live
    }

    /// The terms as they are about positions `x` (m) of all coordinates, none of them live.
    ///
    /// # Errors
    /// [`CoreError::Stencil`] where a live term names a missing node.
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
/// It is a function V(x) like any other potential. Only the stencils by which it is evaluated change, so that energy is
/// conserved across a change.
pub trait Live: Send + Sync {
    /// Name for reports and errors, e.g. `contact`.
    fn name(&self) -> &str;

    /// Distance, m, that nodes may move before [`Live::near`] is asked again. A larger one is asked less often and has
    /// more stencils.
    fn reach(&self) -> f64;

    /// A potential that equals this term at every configuration at which no node is farther than `reach` (m) from `x`.
    /// `x` holds all coordinates, m.
    ///
    /// Equal arguments give equal stencils in an equal order, on any number of threads.
    fn near(&self, x: &[f64], reach: f64) -> Arc<dyn Potential>;
}

/// Does a term fit these coordinates?
fn check_term(term: &dyn Potential, coordinates: &Coordinates) -> Result<(), CoreError> {
    let stencils = term.stencils();
    if stencils.block != 3 && !coordinates.node_axes().is_empty() {
        return Err(CoreError::Block { term: term.name().to_owned(), block: stencils.block });
    }
    check_stencils(term.name(), stencils, coordinates.dof_count())
}

/// Do the stencils of a term name only nodes within `count` coordinates?
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
