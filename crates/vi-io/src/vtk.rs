//! Parts common to the two VTK formats: number types, cells from connectivity, groups from arrays.

pub(crate) mod cells;
pub(crate) mod groups;
pub(crate) mod number;
pub(crate) mod pieces;
