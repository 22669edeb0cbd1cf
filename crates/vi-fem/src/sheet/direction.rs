//! Material directions of a sheet, triangle by triangle: constant, by formula, or from the cells of its mesh.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::FemError;
use crate::path::field::VectorField;
use crate::sheet::triangle::{barycentric_gradients, flatten, frame};
use crate::small::tensor::dot;
use vi_mesh::Triangulation;

/// Vectors on all cells of a mesh, with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct CellField {
    /// The name.
    pub name: String,
    /// The vectors, one per cell.
    pub values: Vec<[f64; 3]>,
}

/// A direction on a sheet at rest, of any length, which is projected onto each triangle: `[1, 0, 0]`, formulas of the
/// position at rest `["-y", "x", 0]`, or cell vectors of the mesh file `{ cell_data = "warp" }`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Direction {
    /// The same direction everywhere.
    Constant([f64; 3]),
    /// Formulas of x y z (m), the centre of each triangle at rest; in a flat pattern of u v 0.
    Formula([DirectionComponent; 3]),
    /// A cell array of three components in the mesh file, in the coordinates of the mesh.
    Cells(CellDirection),
}

/// A component of a direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum DirectionComponent {
    /// A number.
    Number(f64),
    /// A formula of x y z.
    Formula(String),
}

/// A direction from the cells of a mesh file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CellDirection {
    /// Name of the cell array, of three components.
    pub cell_data: String,
}

impl Direction {
    /// Returns the problem of the direction, as far as it can be found without the mesh.
    pub(crate) fn problem(&self, key: &'static str) -> Option<FemError> {
        match self {
            Self::Constant(v) => (!(dot(*v, *v).is_finite() && dot(*v, *v) > 0.0)).then(|| {
                let requirement = "a direction must be finite and not zero (this is its length)";
                FemError::Parameter { key, value: dot(*v, *v).sqrt(), requirement }
            }),
            Self::Formula(components) => field(components).err(),
            Self::Cells(_) => None,
        }
    }

    /// Returns the unit vector of the direction in the plane of each triangle at rest.
    ///
    /// # Errors
    /// Returns an error for formulas that do not parse, cell arrays that do not exist, and directions normal to a
    /// triangle.
    pub(crate) fn on(
        &self,
        surface: &Triangulation,
        fields: &[CellField],
    ) -> Result<Vec<[f64; 3]>, FemError> {
        let count = surface.triangles.len();
        let vectors: Vec<[f64; 3]> = match self {
            Self::Constant(v) => vec![*v; count],
            Self::Formula(components) => {
                let field = field(components)?;
                let middle = |triangle| {
                    let [a, b, c] = surface.corners(triangle);
                    [0, 1, 2].map(|i| (a[i] + b[i] + c[i]) / 3.0)
                };
                (0..count).map(|triangle| field.at(middle(triangle))).collect()
            }
            Self::Cells(CellDirection { cell_data }) => {
                let Some(field) = fields.iter().find(|field| field.name == *cell_data) else {
                    let names: Vec<_> = fields.iter().map(|field| field.name.as_str()).collect();
                    return Err(FemError::Invalid {
                        what: "direction",
                        problem: format!(
                            "the mesh has no cell data '{cell_data}' of three components; it has: {}",
                            if names.is_empty() { "none".to_owned() } else { names.join(", ") }
                        ),
                    });
                };
                let of_cell = |triangle: usize| {
                    let vector = field.values.get(surface.cells[triangle] as usize).copied();
                    vector.map_or([f64::NAN; 3], |vector| to_rest(surface, triangle, vector))
                };
                (0..count).map(of_cell).collect()
            }
        };
        vectors.into_iter().enumerate().map(|(triangle, v)| project(surface, triangle, v)).collect()
    }
}

fn field(components: &[DirectionComponent; 3]) -> Result<VectorField, FemError> {
    let text = components.each_ref().map(|component| match component {
        DirectionComponent::Number(value) => format!("{value:e}"),
        DirectionComponent::Formula(formula) => formula.clone(),
    });
    let [x, y, z] = text.each_ref().map(String::as_str);
    VectorField::expressions([x, y, z])
}

/// Maps a vector from the coordinates of the mesh to the triangle at rest: its components along the edges stay.
fn to_rest(surface: &Triangulation, triangle: usize, vector: [f64; 3]) -> [f64; 3] {
    if !surface.has_pattern() {
        return vector;
    }
    let here = surface.placed(triangle);
    let frame = frame(&here, None);
    let (gradients, _) = barycentric_gradients(&flatten(&here, &frame));
    let plane = [dot(vector, frame[0]), dot(vector, frame[1])];
    let rest = surface.corners(triangle);
    [0, 1, 2]
        .map(|i| (0..3).map(|k| (plane[0] * gradients[k][0] + plane[1] * gradients[k][1]) * rest[k][i]).sum())
}

fn project(surface: &Triangulation, triangle: usize, vector: [f64; 3]) -> Result<[f64; 3], FemError> {
    let normal = frame(&surface.corners(triangle), None)[2];
    let across = dot(vector, normal);
    let along = [0, 1, 2].map(|i| vector[i] - across * normal[i]);
    let (length, whole) = (dot(along, along).sqrt(), dot(vector, vector).sqrt());
    if length.is_finite() && length > 1e-6 * whole {
        return Ok(along.map(|c| c / length));
    }
    Err(FemError::Invalid {
        what: "direction",
        problem: format!(
            "{vector:?} has no part in the plane of element {}: give a direction that lies on the sheet, by \
             formulas or by cell data",
            surface.cells[triangle]
        ),
    })
}
