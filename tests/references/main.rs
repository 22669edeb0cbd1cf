//! Tests reference cases, with their sources.

#[path = "../program/mod.rs"]
mod program;
mod reference_a;
mod theory_bar;
mod validation;
