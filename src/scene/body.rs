//! Scene keys of bodies, springs and strikes.

use std::path::PathBuf;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use vi_fem::LockingCure;
use vi_mesh::{BoxMesh, Mesh, SheetMesh};

use super::{FieldComponent, MaterialEntry, Materials, Selection, Substance};

/// `[[body]]`: a deformable body from a mesh file or a generated shape.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Name by which fixes, probes and springs refer to the body.
    pub name: String,
    /// Mesh file (.msh, .vtk, .vtu, .vtp, .inp, .obj, .stl), relative to the scene file: volume cells for a solid,
    /// triangles for a sheet. Its point data `displacement` (m) and `velocity` (m/s) are the initial state. For a
    /// sheet, quadrilaterals are cut into triangles, coincident points welded, triangles oriented consistently, and
    /// points without a triangle removed, each with a note; nodes are numbered after that.
    #[serde(default, skip_serializing_if = "Option::is_none", serialize_with = "super::path_as_text")]
    pub mesh: Option<PathBuf>,
    /// A mesh from arrays of the program, instead of a mesh file; scene files cannot hold one.
    #[serde(skip)]
    pub arrays: Option<Arc<Mesh>>,
    /// Use only this group of the mesh file: a volume group for a solid, a surface group for a sheet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part: Option<String>,
    /// Distance below which points of a sheet's mesh file are welded, m (≥ 0; default: 1e-9 of its extent).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weld: Option<f64>,
    /// A box, instead of a mesh. Regions: `box`, `x-min`, `x-max`, `y-min` … `z-max`.
    #[serde(rename = "box", default, skip_serializing_if = "Option::is_none")]
    pub box_shape: Option<BoxMesh>,
    /// A rectangle of cloth or shell, instead of a mesh. Regions: `sheet`, `x-min`, `x-max`, `y-min`,
    /// `y-max`, and the corners `x-min-y-min` … `x-max-y-max`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sheet: Option<SheetMesh>,
    /// Material: one, or a list by region. The material of a sheet has `thickness`.
    pub material: Materials,
    /// 2: replace a solid's linear elements by quadratic ones (tet10, hex20, wedge15), with straight edges except where
    /// the mesh has curved ones; elements that are quadratic are kept (default 1: as in the mesh).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub order: Option<u8>,
    /// Halve every element this many times (0 to 6; default 0): into 8 smaller ones per volume, 4 per triangle. To
    /// halve along some axes alone, write `{ axes = ["x", "y"], levels = 2 }`. Nodes keep their numbers, and regions
    /// cover the same part of the body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refine: Option<Refine>,
    /// Treatment of a solid's locking near incompressibility (default none). `mean-dilation` gives each element one
    /// volume ratio, for hex8 and wedge6 with ν near ½; it has no effect on tet4.
    #[serde(default, skip_serializing_if = "Body::is_plain")]
    pub locking: LockingCure,
    /// Shape of a sheet at rest (default: that of its mesh).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<RestShape>,
    /// Length of a unit of texture coordinates, m (> 0; default: the unit of the file), for rest = "flat".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub uv_scale: Option<f64>,
    /// Scale factor of the mesh coordinates, e.g. 0.001 for a mesh in millimetres (> 0).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Translation of the mesh after scaling, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub translate: Option<[f64; 3]>,
    /// Initial displacement, m: numbers, or formulas of x y z, the rest position (m). It is added to that of the mesh
    /// file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub displacement: Option<[FieldComponent; 3]>,
    /// Initial velocity, m/s: numbers, or formulas of x y z, the rest position (m). It is added to that of the mesh
    /// file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity: Option<[FieldComponent; 3]>,
    /// Initial angular velocity about the centre of mass, rad/s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angular_velocity: Option<[f64; 3]>,
}

/// Shape of a sheet at rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum RestShape {
    /// The shape of its mesh.
    Mesh,
    /// Flat. If the mesh file has texture coordinates (u, v), they are the pattern of the sheet, in one chart or
    /// several, and the sheet is without stress in that shape. Otherwise the lengths of the mesh are kept, and the
    /// sheet is flat for bending only.
    Flat,
}

/// Refinement of a mesh.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Refine {
    /// Halve every element this many times.
    Levels(u32),
    /// Halve every element along some axes alone.
    Along(RefineAlong),
}

/// Refinement that keeps the layers of a body of hexahedra or wedges extruded along an axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RefineAlong {
    /// The global axes along which elements are halved, one or two. With two, the body is extruded along the third
    /// axis; with one, along this axis. Each edge of an element is parallel or normal to the axis of extrusion.
    pub axes: Vec<Axis>,
    /// Number of refinements (0 to 6).
    pub levels: u32,
}

impl Refine {
    /// Returns how many times elements are halved.
    pub fn levels(&self) -> u32 {
        match self {
            Self::Levels(levels) | Self::Along(RefineAlong { levels, .. }) => *levels,
        }
    }

    /// Returns a copy with another number of refinements.
    #[must_use]
    pub fn with_levels(mut self, new: u32) -> Self {
        match &mut self {
            Self::Levels(levels) | Self::Along(RefineAlong { levels, .. }) => *levels = new,
        }
        self
    }
}

/// Largest number of times that elements can be halved.
pub(crate) const MOST_REFINED: u32 = 6;

impl Body {
    fn new(name: impl Into<String>, material: impl Into<Substance>) -> Self {
        Self {
            name: name.into(),
            mesh: None,
            arrays: None,
            part: None,
            weld: None,
            box_shape: None,
            sheet: None,
            material: Materials(vec![MaterialEntry { region: None, law: material.into() }]),
            order: None,
            refine: None,
            locking: LockingCure::None,
            rest: None,
            uv_scale: None,
            scale: None,
            translate: None,
            displacement: None,
            velocity: None,
            angular_velocity: None,
        }
    }

    /// Makes a body from a mesh file, of one material.
    pub fn from_mesh(
        name: impl Into<String>,
        mesh: impl Into<PathBuf>,
        material: impl Into<Substance>,
    ) -> Self {
        Self { mesh: Some(mesh.into()), ..Self::new(name, material) }
    }

    /// Makes a body from a mesh in memory ([`Mesh::from_arrays`]), of one material.
    pub fn from_arrays(name: impl Into<String>, mesh: Mesh, material: impl Into<Substance>) -> Self {
        Self { arrays: Some(Arc::new(mesh)), ..Self::new(name, material) }
    }

    /// Returns whether its mesh is given, in a file or as arrays, and not generated.
    pub(crate) fn has_mesh(&self) -> bool {
        self.mesh.is_some() || self.arrays.is_some()
    }

    /// Makes a generated box of one material.
    pub fn from_box(name: impl Into<String>, shape: BoxMesh, material: impl Into<Substance>) -> Self {
        Self { box_shape: Some(shape), ..Self::new(name, material) }
    }

    /// Makes a generated sheet of one material.
    pub fn from_sheet(name: impl Into<String>, shape: SheetMesh, material: impl Into<Substance>) -> Self {
        Self { sheet: Some(shape), ..Self::new(name, material) }
    }

    fn is_plain(locking: &LockingCure) -> bool {
        *locking == LockingCure::None
    }

    /// Sets the order of a solid's elements: 2 replaces linear elements by quadratic ones.
    pub fn order(mut self, order: u8) -> Self {
        self.order = Some(order);
        self
    }

    /// Halves every element this many times.
    pub fn refine(mut self, times: u32) -> Self {
        self.refine = Some(Refine::Levels(times));
        self
    }

    /// Halves every element this many times along some axes alone: a body of hexahedra or wedges extruded along another
    /// axis keeps its layers.
    pub fn refine_along(mut self, axes: &[Axis], levels: u32) -> Self {
        self.refine = Some(Refine::Along(RefineAlong { axes: axes.to_vec(), levels }));
        self
    }

    /// Sets the treatment of locking.
    pub fn locking(mut self, cure: LockingCure) -> Self {
        self.locking = cure;
        self
    }

    /// Returns the dimension of its elements, by its first material: 2 for a sheet, 3 for a solid.
    pub fn dimension(&self) -> usize {
        self.material.0.first().map_or(3, |entry| entry.law.dimension())
    }

    /// Sets the initial velocity, m/s.
    pub fn velocity(mut self, velocity: [f64; 3]) -> Self {
        self.velocity = Some(velocity.map(FieldComponent::Number));
        self
    }

    /// Sets the initial angular velocity about the centre of mass, rad/s.
    pub fn angular_velocity(mut self, angular_velocity: [f64; 3]) -> Self {
        self.angular_velocity = Some(angular_velocity);
        self
    }

    /// Translates the mesh, m.
    pub fn translate(mut self, translate: [f64; 3]) -> Self {
        self.translate = Some(translate);
        self
    }
}

/// A coordinate axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// First.
    X,
    /// Second.
    Y,
    /// Third.
    Z,
}

/// One end of a spring.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SpringEnd {
    /// A body, with `node` or `point`. Without a body, `point` is fixed in space.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body: Option<String>,
    /// The node nearest to this point at rest, m; without a body, the point itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub point: Option<[f64; 3]>,
    /// A node of the body, from 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<usize>,
}

/// `[[spring]]`: V = ½ k (|x_b − x_a| − L)².
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    /// One end, on a body.
    pub from: SpringEnd,
    /// The other end, on a body or in space.
    pub to: SpringEnd,
    /// Stiffness k, N/m (> 0).
    pub stiffness: f64,
    /// Length L of the spring without force, m (≥ 0; default: the distance of the ends at rest).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
}

/// `[[strike]]`: an impulse at t = 0, distributed over the nodes of a region in proportion to their mass. Nodes that
/// are tied, attached or sewn pass their part to the nodes or bodies that they follow. Supports take up the part of
/// held nodes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Strike {
    /// The body.
    pub body: String,
    /// The selected nodes.
    #[serde(flatten)]
    pub on: Selection,
    /// Impulse, N s.
    pub impulse: [f64; 3],
}
