//! Contact between small bodies, proofs of separation, friction.

mod bar;
mod broad_phase;
mod ccd;
mod drift;
mod friction;
mod pairs;
#[path = "../support/mod.rs"]
mod support;
