//! Contact as a potential of positions: distances, candidates, proofs of separation, barrier and friction.
//!
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod barrier;
mod broad_phase;
mod ccd;
mod distance;
mod error;
mod friction;
mod pairs;
mod potential;
mod surface;
#[cfg(test)]
mod testing;

pub use barrier::Barrier;
pub use broad_phase::Neighbours;
pub use ccd::{Certificate, Impact, separated_until};
pub use distance::{Closest, Shape};
pub use error::ContactError;
pub use friction::{Anchor, Anchors, FrictionPair};
pub use pairs::{AT_END, ActivePair, Blend, Contact, Gap, Partners, StepPair, StepSettings, clusters};
pub use potential::{ContactPotential, ContactTerm, RollingTerm};
pub use surface::{
    Body, Cell, Edge, Gauge, HalfSpace, Law, PairRule, Point, Surface, SurfaceBuilder, median_edge,
};
