//! Loads, springs and damping: forces on bodies other than the elastic ones.

pub(crate) mod damping;
pub(crate) mod dead;
pub(crate) mod gravity;
pub(crate) mod pressure;
pub(crate) mod spread;
pub(crate) mod spring;
pub(crate) mod tie;
pub(crate) mod wind;
