//! Reads or generates the meshes of the bodies of a scene, and finds the elements of their materials.

use std::collections::HashMap;
use std::sync::Arc;

use vi_fem::LockingCure;
use vi_mesh::{BoxMesh, CellKind, FarElements, FinerMesh, Mesh, MeshError, MeshPart, Numbering, SheetMesh};

use super::body::MaterialPart;
use super::import::{self, Imported};
use super::parted::{self, kind_in_parts, runs};
use super::size::Budget;
use super::spacing;
use crate::scene::{Body, BodyId, MOST_REFINED, MaterialEntry, Problem, Refine, RefineAlong, Scene};

/// What a process reads of the bodies.
#[derive(Debug, Clone, Copy)]
pub(super) enum Reading {
    /// All nodes and elements.
    Whole,
    /// The part that this process needs.
    Part(Share),
    /// All nodes, without elements.
    Nodes,
}

/// A process of several.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Share {
    pub(crate) process: usize,
    pub(crate) count: usize,
}

/// A body of the scene with its mesh.
pub(super) struct ReadBody<'a> {
    pub(super) id: BodyId,
    /// The body in the scene.
    pub(super) scene: &'a Body,
    pub(super) read: Imported,
    pub(super) materials: Vec<MaterialPart>,
    /// The order of the elements and nodes, if the mesh is a part of a larger one.
    pub(super) part: Option<PartOrder>,
    /// The elements, if the mesh is without them.
    pub(super) far: Option<Arc<dyn FarElements>>,
}

/// The order of a part of a mesh; see [`MeshPart`].
pub(super) struct PartOrder {
    pub(super) numbering: Numbering,
    pub(super) elements: Vec<u32>,
    pub(super) run_length: usize,
    runs: Vec<(u32, u32)>,
}

impl ReadBody<'_> {
    /// Returns the numbers of the runs of elements of a part in the whole mesh, and the processes that compute them.
    pub(super) fn runs(&self) -> Vec<(u32, u32)> {
        self.part.as_ref().map_or_else(Vec::new, |part| part.runs.clone())
    }
}

/// Reads all bodies, in the order of the scene, or what a process needs of them. A body that cannot be read adds
/// problems and gives `None`.
pub(super) fn bodies<'a>(
    scene: &'a Scene,
    reading: Reading,
    problems: &mut Vec<Problem>,
) -> Vec<Option<ReadBody<'a>>> {
    let mut budget = Budget::of_machine();
    let bodies = scene.bodies.iter().enumerate().map(|(index, body)| (BodyId::new(index), body));
    let mut read_body = |(id, body)| match reading {
        Reading::Part(share) => part(id, body, share).map_err(|problem| problems.push(problem)).ok(),
        Reading::Nodes => nodes(id, body).map_err(|problem| problems.push(problem)).ok(),
        Reading::Whole => read(id, body, &mut budget, problems),
    };
    bodies.map(&mut read_body).collect()
}

/// Generates the part of a box that a process needs, reads it from the pieces of a parted mesh, or cuts it out of the mesh of another
/// file, which is dropped.
fn part(id: BodyId, body: &Body, share: Share) -> Result<ReadBody<'_>, Problem> {
    let wrong = |why: String| wrong_in_parts(id, body, why);
    let Share { process, count } = share;
    let part = if let Some(placed) = placed_box(body) {
        let runs = runs(placed.element, placed.element_count() as usize, count);
        let made = placed.part(process, &runs).map_err(|error| wrong(error.to_string()))?;
        made.ok_or_else(|| wrong(format!("{} cannot be generated in parts", placed.element)))?
    } else if let Some(parted) = parted::open(body) {
        let parted = parted.map_err(|error| wrong(error.to_string()))?;
        let kind = kind_in_parts([parted.pieces().kind].into_iter()).map_err(wrong)?;
        let runs = runs(kind, parted.pieces().element_count(), count);
        parted.part(process, &runs).map_err(|error| wrong(error.to_string()))?
    } else {
        let path = body.mesh.as_ref().ok_or_else(|| wrong("has neither shape nor file".to_owned()))?;
        let mesh = import::read(path, body).map_err(|messages| wrong(messages.join("; ")))?.mesh;
        let kind = kind_in_parts(mesh.blocks.iter().map(|block| block.kind)).map_err(wrong)?;
        MeshPart::of_mesh(&mesh, process, &runs(kind, mesh.cells_of_dimension(3).len(), count))
    };
    let MeshPart { mesh, numbering, order, run_length, runs } = part;
    let materials = materials(body, &mesh).map_err(wrong)?;
    let part = Some(PartOrder { numbering, elements: order, run_length, runs });
    Ok(ReadBody { id, scene: body, read: Imported::generated(mesh), materials, part, far: None })
}

/// Generates the nodes of a box and the facets of its faces, or reads those of a parted mesh.
fn nodes(id: BodyId, body: &Body) -> Result<ReadBody<'_>, Problem> {
    let wrong = |why: String| wrong_in_parts(id, body, why);
    if let Some(parted) = parted::open(body) {
        let opened = parted.and_then(|parted| parted.without_elements());
        let (file, far) = opened.map_err(|error| wrong(error.to_string()))?;
        let mut read = import::without_elements(file, body).map_err(|messages| wrong(messages.join("; ")))?;
        name_source(&mut read, body);
        let materials = materials(body, &read.mesh).map_err(wrong)?;
        return Ok(ReadBody { id, scene: body, read, materials, part: None, far: Some(far) });
    }
    let placed = placed_box(body).ok_or_else(|| wrong("is not there".to_owned()))?;
    let made = placed.without_elements().map_err(|error| wrong(error.to_string()))?;
    let (mesh, far) = made.ok_or_else(|| wrong(format!("{} has nodes elsewhere", placed.element)))?;
    let materials = materials(body, &mesh).map_err(wrong)?;
    let (read, far) = (Imported::generated(mesh), Some(far));
    Ok(ReadBody { id, scene: body, read, materials, part: None, far })
}

/// Returns a problem of the mesh or box of a body of which a process reads a part.
fn wrong_in_parts(id: BodyId, body: &Body, why: String) -> Problem {
    let key = if body.mesh.is_some() { "mesh" } else { "box" };
    Problem::new(format!("body[{}].{key}", id.index()), why)
}

/// Names the file of a body, or the body, in the notes of the reader.
fn name_source(read: &mut Imported, body: &Body) {
    let source = body.mesh.as_ref().map_or_else(|| body.name.clone(), |path| path.display().to_string());
    read.notes.iter_mut().for_each(|note| *note = format!("{source}: {note}"));
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
    read.notes.extend(spacing::note(&body.name, &read.mesh));
    let materials = materials(body, &read.mesh).map_err(|message| wrong("material", message))?;
    Ok(ReadBody { id, scene: body, read, materials, part: None, far: None })
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
        (Some(path), _) => Some(import::read(path, body)),
        (None, Some(arrays)) => Some(import::from_arrays(arrays, body)),
        (None, None) => None,
    };
    let mut read = if let Some(read) = imported {
        let mut read = read.map_err(|messages| {
            let key = format!("{key}.mesh");
            messages.into_iter().map(|message| Problem::new(key.clone(), message)).collect::<Vec<_>>()
        })?;
        name_source(&mut read, body);
        let elements = read.mesh.blocks.iter().filter(|block| block.kind.dimension() == body.dimension());
        let counts: Vec<_> = elements.map(|block| (block.kind, block.cell_count())).collect();
        fits(&counts)?;
        if body.dimension() == 3
            && let Some([one, other]) = read.mesh.doubled_cells(3)
        {
            let message = format!(
                "elements {one} and {other} have the same corners, which would count twice: remove one"
            );
            let source = body.mesh.as_ref().map_or(String::new(), |path| format!("{}: ", path.display()));
            return Err(vec![Problem::new(format!("{key}.mesh"), source + &message)]);
        }
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
    if let Some(placed) = placed_box(body) {
        return Some((placed.build(), "box"));
    }
    Some((placed(body.sheet.as_ref()?, scale, translate).build(), "sheet"))
}

/// Returns the box of a body, scaled and translated as the body requires.
fn placed_box(body: &Body) -> Option<BoxMesh> {
    let (scale, translate) = (body.scale.unwrap_or(1.0), body.translate.unwrap_or_default());
    let shape = body.box_shape.as_ref()?;
    let size = shape.size.map(|size| scale * size);
    let origin = std::array::from_fn(|k| scale * shape.origin[k] + translate[k]);
    Some(BoxMesh { origin, size, ..shape.clone() })
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
    // The bodies keep them.
    parts.iter_mut().for_each(|part| part.elements.shrink_to_fit());
    Ok(parts)
}
