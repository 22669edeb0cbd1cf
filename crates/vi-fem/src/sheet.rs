//! Sheets of triangles: how they stretch, bend and weigh.

pub(crate) mod bending;
pub(crate) mod body;
pub(crate) mod dihedral;
pub(crate) mod direction;
pub(crate) mod law;
pub(crate) mod material;
pub(crate) mod membrane;
pub(crate) mod triangle;
