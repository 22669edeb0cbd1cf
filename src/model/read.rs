//! Reads or generates the meshes of the bodies of a scene, and finds the elements of their materials.

use std::collections::HashMap;

use vi_fem::LockingCure;
use vi_mesh::{BoxMesh, CellKind, FinerMesh, Mesh, MeshError, SheetMesh};

use super::body::MaterialPart;
use super::import::{self, Imported};
use super::size::Budget;
use crate::scene::{Body, BodyId, MOST_REFINED, MaterialEntry, Problem, Refine, RefineAlong, Scene};

/// A body of the scene with its mesh.
pub(super) struct ReadBody<'a> {
    pub(super) id: BodyId,
    /// The body in the scene.
    pub(super) scene: &'a Body,
    pub(super) read: Imported,
    pub(super) materials: Vec<MaterialPart>,
}

/// Reads all bodies, in the order of the scene. A body that cannot be read adds problems and gives `None`.
pub(super) fn bodies<'a>(scene: &'a Scene, problems: &mut Vec<Problem>) -> Vec<Option<ReadBody<'a>>> {
    let mut budget = Budget::of_machine();
    let bodies = scene.bodies.iter().enumerate();
    bodies.map(|(index, body)| read(BodyId::new(index), body, &mut budget, problems)).collect()
}

fn read<'a>(
    id: BodyId,
    body: &'a Body,
    budget: &mut Budget,
    problems: &mut Vec<Problem>,
) -> Option<ReadBody<'a>> {
    if body.refine.as_ref().is_some_and(|refine| refine.levels() > MOST_REFINED) {
        // The checks of the scene have reported this problem.
        return None;
    }
    match try_read(id, body, budget) {
        Ok(read) => Some(read),
        Err(found) => {
            problems.extend(found);
            None
        }
    }
}

fn try_read<'a>(id: BodyId, body: &'a Body, budget: &mut Budget) -> Result<ReadBody<'a>, Vec<Problem>> {
    let wrong =
        |key: &str, message: String| vec![Problem::new(format!("body[{}].{key}", id.index()), message)];
    let coarse = mesh(id, body, budget)?;
    let mut read = refined(body, coarse).map_err(|message| wrong("refine", message))?;
    read.notes.extend(locking_note(body, &read.mesh).map_err(|message| wrong("locking", message))?);
    let materials = materials(body, &read.mesh).map_err(|message| wrong("material", message))?;
    Ok(ReadBody { id, scene: body, read, materials })
}

/// Returns the mesh of a body from its file or its shape, before refinement.
fn mesh(id: BodyId, body: &Body, budget: &mut Budget) -> Result<Imported, Vec<Problem>> {
    let key = format!("body[{}]", id.index());
    let mut fits = |in_file: &[(CellKind, usize)]| {
        budget.take(body, id.index(), in_file).map_err(|problem| vec![problem])
    };
    let scale = body.scale.unwrap_or(1.0);
    let translate = body.translate.unwrap_or_default();
    let imported = match (&body.mesh, &body.arrays) {
        (Some(path), _) => Some((import::read(path, body), path.display().to_string())),
        (None, Some(arrays)) => Some((import::from_arrays(arrays, body), body.name.clone())),
        (None, None) => None,
    };
    let mut read = if let Some((read, source)) = imported {
        let mut read = read.map_err(|messages| {
            let key = format!("{key}.mesh");
            messages.into_iter().map(|message| Problem::new(key.clone(), message)).collect::<Vec<_>>()
        })?;
        read.notes.iter_mut().for_each(|note| *note = format!("{source}: {note}"));
        let elements = read.mesh.blocks.iter().filter(|block| block.kind.dimension() == body.dimension());
        let counts: Vec<_> = elements.map(|block| (block.kind, block.cell_count())).collect();
        fits(&counts)?;
        read
    } else {
        fits(&[])?;
        // The checks of the scene report a body without mesh and shape.
        let (built, shape) = generate(body, scale, translate).ok_or_else(Vec::new)?;
        let wrong = |error: MeshError| vec![Problem::new(format!("{key}.{shape}"), error.to_string())];
        Imported::generated(built.map_err(wrong)?)
    };
    if let Some(sheet) = &body.sheet {
        read.texture = Some(placed(sheet, scale, translate).texture(&read.mesh));
    }
    Ok(read)
}

/// Refines the mesh of a body as `order` and `refine` require.
fn refined(body: &Body, read: Imported) -> Result<Imported, String> {
    let mut read = if body.order == Some(2) { on(read, Mesh::lifted) } else { read };
    let times = body.refine.as_ref().map_or(0, Refine::levels);
    if times > 0 && read.pattern.is_some() {
        return Err(
            "a sheet cut from a flat pattern of texture coordinates cannot be refined; remove this key"
                .to_owned(),
        );
    }
    for _ in 0..times {
        read = match &body.refine {
            Some(Refine::Along(RefineAlong { axes, .. })) => {
                let axes: Vec<usize> = axes.iter().map(|&axis| axis as usize).collect();
                let finer = read.mesh.refined_along(&axes).map_err(|error| error.to_string())?;
                on(read, |_| finer)
            }
            _ => on(read, Mesh::refined),
        };
    }
    Ok(read)
}

/// Returns a note if `locking` has no effect on some elements.
///
/// # Errors
/// Returns an error if it has no effect on any element.
fn locking_note(body: &Body, mesh: &Mesh) -> Result<Option<String>, String> {
    if body.locking == LockingCure::None {
        return Ok(None);
    }
    let solids = mesh.blocks.iter().filter(|block| block.kind.dimension() == 3);
    let (tet4, others): (Vec<_>, Vec<_>) = solids.partition(|block| block.kind == CellKind::Tet4);
    if others.is_empty() {
        return Err(
            "tet4 has one quadrature point, which mean dilation leaves as it is: use `order = 2`, or hex8"
                .to_owned(),
        );
    }
    let name = &body.name;
    Ok((!tet4.is_empty()).then(|| format!("{name}: mean dilation leaves the body's tet4 as they are")))
}

/// Moves a body to a finer mesh.
fn on(read: Imported, make: impl FnOnce(&Mesh) -> FinerMesh) -> Imported {
    let finer = make(&read.mesh);
    let carry = |values: Option<Vec<f64>>| values.map(|values| finer.interpolate(&values));
    let mut fields = read.fields;
    for field in &mut fields {
        field.values = finer.cells.iter().map(|&cell| field.values[cell as usize]).collect();
    }
    let (displacement, velocity) = (carry(read.displacement), carry(read.velocity));
    let texture = read.texture.map(|corners| finer.texture(&read.mesh, &corners));
    Imported { displacement, velocity, fields, texture, mesh: finer.mesh, ..read }
}

/// Generates the mesh of a shape; also returns the shape's key.
fn generate(body: &Body, scale: f64, translate: [f64; 3]) -> Option<(Result<Mesh, MeshError>, &'static str)> {
    let place = |origin: [f64; 3]| std::array::from_fn(|k| scale * origin[k] + translate[k]);
    if let Some(shape) = &body.box_shape {
        let size = shape.size.map(|size| scale * size);
        let placed = BoxMesh { origin: place(shape.origin), size, ..shape.clone() };
        return Some((placed.build(), "box"));
    }
    Some((placed(body.sheet.as_ref()?, scale, translate).build(), "sheet"))
}

/// Scales and translates a generated sheet as its body requires.
fn placed(sheet: &SheetMesh, scale: f64, translate: [f64; 3]) -> SheetMesh {
    let size = sheet.size.map(|size| scale * size);
    let origin = std::array::from_fn(|k| scale * sheet.origin[k] + translate[k]);
    SheetMesh { origin, size, ..sheet.clone() }
}

/// Returns the elements of each material.
fn materials(body: &Body, mesh: &Mesh) -> Result<Vec<MaterialPart>, String> {
    const NONE: usize = usize::MAX;
    let entries = &body.material.0;
    let dimension = body.dimension();
    let mut owner: HashMap<u32, usize> = HashMap::new();
    for (i, entry) in entries.iter().enumerate() {
        let Some(name) = &entry.region else { continue };
        let region = mesh.region(name).map_err(|error| error.to_string())?;
        if region.dimension != dimension {
            let fills = if dimension == 3 { "fills volumes" } else { "of a sheet covers surfaces" };
            return Err(format!("region '{name}' has dimension {}; a material {fills}", region.dimension));
        }
        for &element in &region.cells {
            if let Some(other) = owner.insert(element, i) {
                let other = entries[other].region.as_deref().unwrap_or_default();
                return Err(format!(
                    "element {element} is in the regions '{other}' and '{name}', which both have a material"
                ));
            }
        }
    }
    let rest = entries.iter().position(|entry| entry.region.is_none()).unwrap_or(NONE);
    let part = |entry: &MaterialEntry| MaterialPart {
        region: entry.region.clone(),
        law: entry.law.clone(),
        elements: Vec::new(),
    };
    let mut parts: Vec<MaterialPart> = entries.iter().map(part).collect();
    for element in mesh.cells_of_dimension(dimension) {
        let entry = owner.get(&element).copied().unwrap_or(rest);
        if entry == NONE {
            return Err(format!(
                "element {element} is in no region that has a material; add a material without `region` for the rest"
            ));
        }
        parts[entry].elements.push(element);
    }
    Ok(parts)
}
