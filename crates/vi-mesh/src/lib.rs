//! Meshes: cells, nodes, regions, generators, refinement, boundaries.
//!
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod arrays;
mod boundary;
mod bounds;
mod cell;
mod check;
mod error;
mod facet;
mod far;
mod finer;
mod generate;
mod lift;
mod mesh;
mod nearest;
mod order;
mod part;
mod piece;
mod pieces;
mod refine;
mod runs;
mod triangulation;
mod vector;
mod volume;

pub use bounds::Bounds;
pub use cell::{CellKind, Side};
pub use check::volume_of_round_off;
pub use error::MeshError;
pub use facet::{FacetBlock, FacetPoint, Surface};
pub use far::{FarBlock, FarElements, FarMesh, Window};
pub use finer::FinerMesh;
pub use generate::{BoxMesh, SheetMesh, SheetPattern};
pub use mesh::{CellBlock, Mesh, Region, resolution};
pub use nearest::{NearestPoints, SurfacePoint};
pub use order::{Numbering, sort_by_place};
pub use part::MeshPart;
pub use piece::Piece;
pub use pieces::{CutMesh, MeshPieces};
pub use runs::Runs;
pub use triangulation::{Edge, Orientation, Triangulation, orient_triangles};
