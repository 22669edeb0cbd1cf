//! Makes the mesh and the initial state of a body from a mesh file.

pub(super) mod sheet;

use std::path::Path;

use vi_fem::{CellField, SOLIDS, check_body};
use vi_io::{DataArray, MeshFile};
use vi_mesh::{Mesh, Numbering, orient_triangles};

use crate::scene::{Body, RestShape, Substance};

/// A body as read from its mesh file.
#[derive(Debug)]
pub(crate) struct Imported {
    pub(crate) mesh: Mesh,
    /// Initial displacement, m, if the file has point data of this name.
    pub(crate) displacement: Option<Vec<f64>>,
    /// Initial velocity, m/s, if the file has point data of this name.
    pub(crate) velocity: Option<Vec<f64>>,
    /// The flat pattern of a sheet, m: the corners of every cell.
    pub(crate) pattern: Option<Vec<[[f64; 2]; 3]>>,
    /// Texture coordinates of a sheet at the corners of every cell.
    pub(crate) texture: Option<Vec<[[f64; 2]; 3]>>,
    /// Named vectors per cell.
    pub(crate) fields: Vec<CellField>,
    pub(crate) notes: Vec<String>,
}

impl Imported {
    /// Takes a generated mesh, at rest.
    pub(crate) fn generated(mesh: Mesh) -> Self {
        let (fields, notes) = (Vec::new(), Vec::new());
        Self { mesh, displacement: None, velocity: None, pattern: None, texture: None, fields, notes }
    }

    /// Renumbers the nodes. Also returns the mesh in the old numbering.
    pub(crate) fn renumbered(self, numbering: &Numbering) -> (Self, Mesh) {
        let reorder = |values: Option<Vec<f64>>| {
            values.map(|values| numbering.values(values.as_chunks::<3>().0).into_flattened())
        };
        let (displacement, velocity) = (reorder(self.displacement), reorder(self.velocity));
        (Self { mesh: numbering.mesh(&self.mesh), displacement, velocity, ..self }, self.mesh)
    }
}

/// Reads the mesh file of a body. Its elements are the cells of the body's dimension: 3 for a solid, 2 for a sheet. The
/// triangles of a sheet are welded and oriented consistently.
///
/// # Errors
/// Returns all problems of the file and the mesh, as messages that name the file.
pub(crate) fn read(path: &Path, body: &Body) -> Result<Imported, Vec<String>> {
    let file = vi_io::read_mesh(path).map_err(|error| vec![error.to_string()])?;
    import(file, body).map_err(|messages| {
        messages.into_iter().map(|message| format!("{}: {message}", path.display())).collect()
    })
}

/// Makes the mesh of a body from arrays in the same way.
///
/// # Errors
/// Returns all problems of the mesh.
pub(crate) fn from_arrays(mesh: &Mesh, body: &Body) -> Result<Imported, Vec<String>> {
    import(MeshFile { mesh: mesh.clone(), ..MeshFile::default() }, body)
}

fn import(mut file: MeshFile, body: &Body) -> Result<Imported, Vec<String>> {
    let (scale, translate) = (body.scale.unwrap_or(1.0), body.translate.unwrap_or_default());
    let dimension = body.dimension();
    let mut problems = Vec::new();
    if let Some(part) = &body.part {
        take_part(&mut file, part, dimension).map_err(|problem| vec![problem])?;
    }
    for block in &file.mesh.blocks {
        if block.kind.dimension() == 3 && !SOLIDS.contains(&block.kind) {
            problems.push(format!("cells of type {} are not supported", block.kind));
        }
    }
    problems.extend(dimension_problem(&file, dimension));
    if problems.is_empty() && dimension == 2 {
        problems.extend(sheet::prepare(&mut file, body.weld.map(|weld| weld / scale)).err());
    }
    let [displacement, velocity] = initial(&file, scale, &mut problems);
    if !problems.is_empty() {
        return Err(problems);
    }
    let mut mesh = file.mesh.clone();
    for x in &mut mesh.points {
        *x = [0, 1, 2].map(|k| scale * x[k] + translate[k]);
    }
    check_body(&mesh, dimension)
        .map_err(|errors| errors.iter().map(ToString::to_string).collect::<Vec<_>>())?;
    let fields = file.cell_data.iter().filter_map(cell_field).collect();
    let mut notes = std::mem::take(&mut file.notes);
    let (mut pattern, mut texture) = (None, None);
    if dimension == 2 {
        texture = sheet::texture(&file);
        if body.rest == Some(RestShape::Flat) {
            pattern = sheet::pattern(&file, &mesh, scale, body.uv_scale).map_err(|problem| vec![problem])?;
        }
        let elements = mesh.cells_of_dimension(2);
        let before = mesh.clone();
        let orientation = orient_triangles(&mut mesh, &elements).map_err(|error| vec![error.to_string()])?;
        for corners in pattern.iter_mut().chain(&mut texture) {
            for &cell in &elements {
                if mesh.cell(cell as usize) != before.cell(cell as usize) {
                    corners[cell as usize].swap(1, 2);
                }
            }
        }
        notes.extend(orientation.notes());
    }
    notes.extend(unit_note(body, &mesh));
    Ok(Imported { mesh, displacement, velocity, pattern, texture, fields, notes })
}

/// Makes the mesh of a body from a file of which the elements were left out; they were checked when the mesh was parted.
///
/// # Errors
/// Returns all problems of the arrays.
pub(super) fn without_elements(mut file: MeshFile, body: &Body) -> Result<Imported, Vec<String>> {
    let mut problems = Vec::new();
    let [displacement, velocity] = initial(&file, 1.0, &mut problems);
    if !problems.is_empty() {
        return Err(problems);
    }
    let mut notes = std::mem::take(&mut file.notes);
    notes.extend(unit_note(body, &file.mesh));
    Ok(Imported { displacement, velocity, notes, ..Imported::generated(file.mesh) })
}

/// Returns the initial displacement (m, from the unit of a mesh) and velocity (m/s), if the file has them.
fn initial(file: &MeshFile, scale: f64, problems: &mut Vec<String>) -> [Option<Vec<f64>>; 2] {
    let mut read = |name: &str| match vector(file, name) {
        Ok(values) => values,
        Err(problem) => {
            problems.push(problem);
            None
        }
    };
    let displacement = read("displacement").map(|mut u| {
        u.iter_mut().for_each(|u| *u *= scale);
        u
    });
    [displacement, read("velocity")]
}

/// Returns a note if the unit of a mesh seems to be the millimetre: the mesh is 50 m or larger, as dense as wood to
/// uranium, and as stiff as hard plastic or metal. Setting `scale = 1.0` suppresses the note.
fn unit_note(body: &Body, mesh: &Mesh) -> Option<String> {
    const EXTENT: f64 = 50.0;
    const DENSITY: std::ops::RangeInclusive<f64> = 500.0..=20_000.0;
    const MODULUS: f64 = 1e8;
    let is_like_metal = |law: &Substance| {
        let (density, modulus) = match law {
            Substance::Solid(law) => {
                let (lambda, mu) = law.parameters().lame();
                (law.density(), lambda + 2.0 * mu)
            }
            Substance::Sheet(law) => {
                let parameters = law.parameters();
                (law.area_density() / parameters.common().thickness, parameters.moduli()[0][0])
            }
        };
        DENSITY.contains(&density) && modulus >= MODULUS
    };
    let extent = (0..3)
        .map(|k| {
            let along = || mesh.points.iter().map(|x| x[k]);
            along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
        })
        .fold(0.0, f64::max);
    let is_like = body.material.0.iter().any(|entry| is_like_metal(&entry.law));
    (body.scale.is_none() && extent >= EXTENT && is_like).then(|| {
        format!(
            "the mesh is {extent:.4} m long; if its unit is the millimetre, give body '{}' the key `scale = 1e-3` \
             (`scale = 1.0` says that it is the metre)",
            body.name
        )
    })
}

/// Keeps the cells of the group `part`, and the cells of lower dimension on its nodes.
fn take_part(file: &mut MeshFile, part: &str, dimension: usize) -> Result<(), String> {
    let is_part = |group: &&vi_mesh::Region| group.dimension == dimension && group.name == part;
    let Some(group) = file.mesh.regions.iter().find(is_part) else {
        let of_dimension = file.mesh.regions.iter().filter(|group| group.dimension == dimension);
        let names: Vec<_> = of_dimension.map(|group| group.name.as_str()).collect();
        return Err(format!(
            "there is no group '{part}' of {}; there are: {}",
            if dimension == 3 { "volumes" } else { "surfaces" },
            if names.is_empty() { "none".to_owned() } else { names.join(", ") }
        ));
    };
    let cells = group.cells.clone();
    let mut used = vec![false; file.mesh.points.len()];
    for (_, (_, nodes)) in
        file.mesh.cells().enumerate().filter(|(cell, _)| cells.binary_search(&(*cell as u32)).is_ok())
    {
        nodes.iter().for_each(|&node| used[node as usize] = true);
    }
    file.retain_cells(|cell, kind, nodes| {
        cells.binary_search(&(cell as u32)).is_ok()
            || kind.dimension() < dimension && nodes.iter().all(|&node| used[node as usize])
    });
    Ok(())
}

/// Returns a problem if the mesh belongs to a solid and a sheet is expected, or the reverse.
fn dimension_problem(file: &MeshFile, dimension: usize) -> Option<String> {
    let has = |dimension: usize| file.mesh.blocks.iter().any(|block| block.kind.dimension() == dimension);
    if dimension == 2 && has(3) {
        let problem = "the mesh has volume cells: it is a solid, whose material has no `thickness`; for a sheet of \
                       one of its surface groups name that with `part`";
        return Some(problem.to_owned());
    }
    if dimension == 3 && has(2) && !has(3) {
        let problem = "the mesh has triangles and no volume cells: it is a sheet, whose material needs the key \
                       `thickness` (m)";
        return Some(problem.to_owned());
    }
    None
}

/// Returns a cell array if it holds vectors.
fn cell_field(array: &DataArray) -> Option<CellField> {
    let values = (array.components == 3).then(|| array.values.as_chunks::<3>().0.to_vec())?;
    Some(CellField { name: array.name.clone(), values })
}

/// Returns a point array of three components, all finite.
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
