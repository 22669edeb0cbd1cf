//! Tests the laws of every simulation: invariance, conservation, determinism, accuracy, error bars.

mod accuracy;
mod conservation;
mod convergence;
mod determinism;
mod guard;
mod known_answers;
mod measured;
#[path = "../program/mod.rs"]
mod program;
mod promise;
mod properties;
mod random;
mod safety;
mod stress;
mod truncated;
mod work_of_loads;
