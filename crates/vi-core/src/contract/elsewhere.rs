//! A term whose stencils other processes hold.

use std::ops::Range;

use crate::contract::potential::{Account, Far, MakeFew, Potential, Stencils, Traits};

/// A term without stencils, in place of one whose stencils are divided among several processes
/// ([`SharedTerms`](crate::SharedTerms)). It makes a few of them where this process must know more than their sums.
pub struct Elsewhere {
    /// The name of the term.
    pub name: String,
    /// The account in which its energy is booked.
    pub account: Account,
    /// The properties of the term.
    pub traits: Traits,
    /// Nodes per stencil, with three coordinates each.
    pub arity: usize,
    /// Number of stencils.
    pub count: usize,
    /// Number of stencils that are summed together.
    pub run_length: usize,
    /// Makes the stencils with these numbers, in this order.
    pub make: Box<MakeFew>,
}

impl Potential for Elsewhere {
    fn name(&self) -> &str {
        &self.name
    }

    fn account(&self) -> Account {
        self.account
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils { arity: self.arity, block: 3, nodes: &[] }
    }

    fn run_length(&self) -> usize {
        self.run_length
    }

    fn traits(&self) -> Traits {
        self.traits
    }

    fn energies(&self, _range: Range<usize>, _x: &[f64], _t: f64, _out: &mut [f64]) {}

    fn gradients(&self, _range: Range<usize>, _x: &[f64], _t: f64, _out: &mut [f64]) {}

    fn hessians(&self, _range: Range<usize>, _x: &[f64], _t: f64, _out: &mut [f64]) {}

    fn elsewhere(&self) -> Option<Far<'_>> {
        Some(Far { count: self.count, run_length: self.run_length, make: self.make.as_ref() })
    }
}
