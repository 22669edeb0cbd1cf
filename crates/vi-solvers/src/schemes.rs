//! The time integrators: the table of schemes, the contract of a stepper, and one file or folder per family.

pub(crate) mod accounts;
mod at_rest;
mod comparison;
pub(crate) mod constraint;
mod damped_limit;
mod damping_rate;
mod energy_momentum;
pub(crate) mod filter;
mod gauss;
pub(crate) mod held;
pub(crate) mod kick_drift;
pub(crate) mod lanczos;
mod live_impulses;
pub(crate) mod method;
pub(crate) mod motion;
mod one_stage;
mod resolution;
pub(crate) mod stability;
pub(crate) mod stepper;
mod table;
