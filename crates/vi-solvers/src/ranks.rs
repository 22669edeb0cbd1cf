//! One system on several processes (ranks).
//!
//! The first rank keeps the state and tells the others what to do (`partners.rs`). Every rank, the first one too, holds a
//! portion of the terms (`member.rs`), and of the linear systems of implicit steps (`rows.rs`, `outside.rs`); the first one knows what the
//! others hold (`layout.rs`). If nothing but terms acts on the nodes, the ranks make explicit steps of their portions
//! themselves (`conductor.rs`), and find its highest frequency (`lanczos.rs`). In all other cases the first rank makes the steps as one process does, and the
//! ranks sum energies and gradients for it.

pub(crate) mod command;
pub(crate) mod conductor;
mod lanczos;
pub(crate) mod layout;
pub(crate) mod member;
mod outside;
pub(crate) mod partners;
mod portion_data;
mod rows;
