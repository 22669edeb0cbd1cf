//! From a mesh file, which knows no physics, to the mesh of a body and its initial state.
//! It must not know formats or potentials.

use std::path::Path;

use vi_fem::{ElementBlock, ElementKind, Mesh, Region, orient_triangles};
use vi_io::{CellKind, DataArray, MeshFile};

/// A body as its mesh file has it.
#[derive(Debug)]
pub(crate) struct Imported {
    pub(crate) mesh: Mesh,
    /// Initial displacement, m, where the file has point data of this name.
    pub(crate) displacement: Option<Vec<f64>>,
    /// Initial velocity, m/s, where the file has point data of this name.
    pub(crate) velocity: Option<Vec<f64>>,
    pub(crate) notes: Vec<String>,
}

/// Reads a mesh file; lengths are multiplied by `scale`, then `translate` (m) is added. Its elements are
/// the cells of `dimension`: 3 for a solid, 2 for a sheet, whose triangles are made to face one way.
///
/// # Errors
/// Everything that is wrong with the file or the mesh, in words that name the file.
pub(crate) fn read(
    path: &Path,
    scale: f64,
    translate: [f64; 3],
    dimension: usize,
) -> Result<Imported, Vec<String>> {
    let file = vi_io::read_mesh(path).map_err(|error| vec![error.to_string()])?;
    import(file, scale, translate, dimension).map_err(|messages| {
        messages.into_iter().map(|message| format!("{}: {message}", path.display())).collect()
    })
}

fn import(
    file: MeshFile,
    scale: f64,
    translate: [f64; 3],
    dimension: usize,
) -> Result<Imported, Vec<String>> {
    let mut problems = Vec::new();
    let mut initial = |name: &str| match vector(&file, name) {
        Ok(values) => values,
        Err(problem) => {
            problems.push(problem);
            None
        }
    };
    let displacement = initial("displacement").map(|mut u| {
        u.iter_mut().for_each(|u| *u *= scale);
        u
    });
    let velocity = initial("velocity");
    let points = file.points.iter().map(|x| std::array::from_fn(|k| scale * x[k] + translate[k])).collect();
    let mut blocks = Vec::with_capacity(file.blocks.len());
    for block in file.blocks {
        match kind(block.kind) {
            Some(kind) => blocks.push(ElementBlock { kind, nodes: block.nodes }),
            None => problems.push(format!("cells of type {} are not supported", block.kind.name())),
        }
    }
    let regions = file
        .groups
        .into_iter()
        .map(|group| Region { name: group.name, dimension: group.dimension, elements: group.cells })
        .collect();
    if !problems.is_empty() {
        return Err(problems);
    }
    let mut mesh = Mesh { points, blocks, regions };
    let has = |dimension: usize| !mesh.cells_of_dimension(dimension).is_empty();
    if dimension == 2 && has(3) {
        let problem = "the mesh has volume cells: it is a solid, whose material has no `thickness`";
        return Err(vec![problem.to_owned()]);
    }
    if dimension == 3 && has(2) && !has(3) {
        let problem = "the mesh has triangles and no volume cells: it is a sheet, whose material needs the key \
                       `thickness` (m)";
        return Err(vec![problem.to_owned()]);
    }
    mesh.check(dimension).map_err(|errors| errors.iter().map(ToString::to_string).collect::<Vec<_>>())?;
    let mut notes = file.notes;
    if dimension == 2 {
        let elements = mesh.cells_of_dimension(2);
        let orientation = orient_triangles(&mut mesh, &elements).map_err(|error| vec![error.to_string()])?;
        notes.extend(orientation.notes());
    }
    Ok(Imported { mesh, displacement, velocity, notes })
}

/// A point array of three components, all finite.
fn vector(file: &MeshFile, name: &str) -> Result<Option<Vec<f64>>, String> {
    let Some(DataArray { components, values, .. }) = file.point_array(name) else { return Ok(None) };
    if *components != 3 {
        return Err(format!("point data `{name}` has {components} components; it needs 3"));
    }
    match values.iter().position(|value| !value.is_finite()) {
        Some(i) => Err(format!("point data `{name}` holds {} at point {}", values[i], i / 3)),
        None => Ok(Some(values.clone())),
    }
}

fn kind(kind: CellKind) -> Option<ElementKind> {
    ElementKind::from_vtk_code(kind.vtk_code())
}
