//! Mesh and array files.
//!
#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

mod cursor;
mod edit;
mod error;
mod gmsh;
mod inp;
mod legacy;
mod mdd;
mod mesh;
mod obj;
mod parted;
mod pc2;
mod pvd;
mod pvtu;
mod pvtu_read;
mod read;
mod replace;
mod stl;
mod surface_write;
mod tags;
mod vtk;
#[cfg(feature = "vtkio")]
mod vtkio_model;
mod vtu;
mod vtu_frame;
mod vtu_write;

pub use error::{IoError, Place};
pub use gmsh::parse_msh;
pub use inp::parse_inp;
pub use legacy::parse_vtk;
pub use mdd::write_mdd;
pub use mesh::{DataArray, MeshFile};
pub use obj::parse_obj;
pub use parted::PartedMesh;
pub use parted::write::write_parted;
pub use pc2::Pc2File;
pub use pvd::PvdSeries;
pub use pvtu::write_pvtu;
pub use read::{parse_mesh, read_mesh};
pub use replace::replace_file;
pub use stl::parse_stl;
pub use surface_write::{TriangleSurface, write_obj, write_ply};
pub use vtu::parse_vtu;
pub use vtu_frame::{Precision, VtuArray, VtuFrame, VtuValues};
pub use vtu_write::{VtuEncoding, VtuOptions, encode_vtu, write_vtu};
