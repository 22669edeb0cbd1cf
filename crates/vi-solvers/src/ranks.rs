//! Explicit steps of one system by several processes (ranks).
//!
//! The first rank conducts: it holds the whole system and its state, as one process does, and tells the others what to
//! do (`conductor.rs`). Every rank, the first one too, steps a portion of the system (`member.rs`).

pub(crate) mod command;
pub(crate) mod conductor;
pub(crate) mod member;
