//! Tests contact between small bodies, proofs of separation, and friction.

mod acting;
mod bar;
mod broad_phase;
mod ccd;
mod crossing;
mod dampers;
mod drift;
mod friction;
mod pairs;
#[path = "../support/mod.rs"]
mod support;
