//! Sheets of triangles: membrane laws, bending models and mass.

pub(crate) mod bending;
pub(crate) mod body;
pub(crate) mod dihedral;
pub(crate) mod direction;
pub(crate) mod law;
pub(crate) mod material;
pub(crate) mod membrane;
pub(crate) mod triangle;
