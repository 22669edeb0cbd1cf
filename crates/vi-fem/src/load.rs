//! Loads, springs and damping: what acts on bodies beside their own matter.

pub(crate) mod damping;
pub(crate) mod dead;
pub(crate) mod gravity;
pub(crate) mod pressure;
pub(crate) mod spread;
pub(crate) mod spring;
pub(crate) mod tie;
pub(crate) mod wind;
